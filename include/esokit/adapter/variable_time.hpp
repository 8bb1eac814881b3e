/// @file
/// VariableTime: an observer whose sample time changes from step to step.
#pragma once

#include <cmath>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/math/detail/fine_sum.hpp>

namespace esokit {

/// Config of VariableTime.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct VariableTimeConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<VariableTimeConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};  ///< config of the observer, with the nominal sample time T
  S ratio = S(4);                        ///< above 1: steps may take T / ratio .. T ratio
};

/// Before each step the observer is given how long the step took; model and gains follow exactly. A
/// controller takes any time, `elapsed(seconds)`, also a pause.
///
/// A step with another length than the last one is a retune: the whole `make` of the observer, with
/// its checks and one expm1 per level (LinearEso<2>: 40 .. 80 ns on a desktop, the time of some
/// thirty updates, see benchmarks/control). A step of the same length costs one comparison, so do
/// not pass on insignificant changes of the length. Observers with a slow `make` (AlgebraicEso
/// designs its whole schedule, AdjustableBandwidthEso and NonlinearEso compute their certificate)
/// are for logs, or for a rate that changes rarely. After missing samples the gain is that for the
/// total time since the last correction.
///
/// The gains for two lengths in turn can make the error grow although each alone is stable (order
/// 3, omega_o 460 rad/s: 3 and 16 ms). So a correction bridges steps and gaps only up to the length
/// for which errors decay in any sequence. For the chain with equal poles it is 14 / omega_o for
/// three states, 5 / omega_o for four, 3 / omega_o for five
/// (gain/certificate/detail/bridged_steps.hpp). After a longer one the observer restarts from the
/// measurement: what `longest_gap()` bridges is for steps of one length.
///
/// AlgebraicEso counts samples: while its bandwidth falls, it treats all samples so far as if they
/// had the present length; once settled it is exact. The gain sets of a switched observer follow
/// the step time, but its switching test compares successive innovations regardless of the time
/// between them.
template <class Observer>
requires(detail::restarts<Observer>()) class VariableTime
    : public NamedAdapter<VariableTime<Observer>, Observer, VariableTimeConfig<Observer>> {
  using Base = NamedAdapter<VariableTime, Observer, VariableTimeConfig<Observer>>;
  friend Base;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  static_assert(!observer_traits<Observer>.takes_measured,
                "esokit: put Measured around VariableTime, not inside it");

 public:
  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.varies_time = true;
    traits.publishes_chain = false;
    return traits;
  }();

  using typename Base::Config;

  /// Checks the settings and does all the design work.
  /// @return the observer at rest at zero, or an error that names the field. The observer's config
  /// must be valid at both ends of the range
  static Expected<VariableTime, Error<S>> make(const Config& config) {
    if (Rules<S> rules; !rules.above("ratio", config.ratio, S(1))) return rules.error();
    auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    // Every step time in the range must give a valid config; it does if both ends do. A time above
    // T ratio is divided into steps of T / 2 and more.
    S longest{};
    for (const S factor : {config.ratio, S(0.5), S(1) / config.ratio}) {
      auto edge = config.observer;
      auto& chain = chain_config<Observer>(edge);
      chain.sample_time = chain.sample_time * factor;
      constexpr int most = 65000;
      chain.max_gap = most;
      const auto made = Observer::make(edge);
      if (!made) return made.error();
      if (longest == detail::unbounded<S>()) continue;
      // What any sequence of samples at the shortest step bridges, any sequence of steps does.
      longest = factor > S(1) && made->max_gap() == most
                    ? detail::unbounded<S>()
                    : static_cast<S>(made->max_gap() + 1) * chain.sample_time;
    }
    if (const S nominal = chain_config<Observer>(config.observer).sample_time;
        !detail::at_most(nominal, longest)) {
      return Error<S>{"ratio",
                      config.ratio,
                      "allows steps of so different lengths that errors may grow; the longest step "
                      "(s) after which they decay is",
                      -1,
                      longest,
                      true};
    }
    // Steps and their limits are rounded products.
    return VariableTime(*observer, config, longest * (S(1) + S(4) * detail::rounding<S>()));
  }

  /// Sets the length of the next steps (s), until the next call: all that has passed, also what
  /// `elapsed` kept. A length outside T / ratio .. T ratio is refused, and the last one is kept.
  Check<S> set_step_time(const S& seconds) noexcept {
    const S nominal = chain_config<Observer>(config_.observer).sample_time;
    const S shortest = nominal / config_.ratio;
    const S longest = nominal * config_.ratio;
    if (!is_finite(seconds) || !detail::at_most(shortest, seconds)) {
      return Error<S>{"step_time", seconds, "must be finite and at least", -1, shortest, true};
    }
    if (!detail::at_most(seconds, longest)) {
      return Error<S>{"step_time", seconds, "must be at most", -1, longest, true};
    }
    step_time_ = seconds;
    kept_ = {};
    return {};
  }

  /// Says how much time has passed since the last sample: any, at the cost of at most max_gap + 1
  /// predictions more (of the config). A time above T ratio is divided into equal steps of at most
  /// T; after more than max_gap + 1 of them the next correction restarts. One below T / ratio is
  /// kept and added to the next one.
  /// @return how many steps have to follow, each of the new `step_time()`: `predict(u)`, and the
  /// last one is `update(y, u)`. 0: none, y comes too soon. Or the error of a time that is negative
  /// or not finite, which changes nothing
  Expected<int, Error<S>> elapsed(const S& seconds) noexcept {
    if (Rules<S> rules; !rules.not_negative("elapsed", seconds)) return rules.error();
    const auto& chain = chain_config<Observer>(config_.observer);
    const S nominal = chain.sample_time;
    kept_.add(seconds);
    const S due = kept_.value();
    if (!detail::at_most(S(nominal / config_.ratio), due)) return 0;
    kept_ = {};
    step_time_ = due;
    if (detail::at_most(due, S(nominal * config_.ratio))) return 1;
    const int restart = chain.max_gap + 2;
    step_time_ = nominal;
    if (!(due < static_cast<S>(restart) * nominal)) return restart;
    const S steps = (std::ceil)(due / nominal * (S(1) - S(4) * detail::rounding<S>()));
    step_time_ = due / steps;
    return static_cast<int>(steps);
  }

  /// One sample of length `step_time`, see PredictorCorrector::update.
  StepStatus update(S y, S u_applied) noexcept {
    if (!is_current() || this->missed() != 0 || step_time_ > longest_) [[unlikely]] {
      const StepStatus predicted = predict(u_applied);
      return predicted | correct(y);
    }
    elapsed_ = step_time_;
    return observer_.update(y, u_applied);
  }

  /// Time update only, over `step_time`.
  StepStatus predict(S u_applied) noexcept {
    if (!is_current()) take(step_time_);
    elapsed_ = this->missed() == 0 ? step_time_ : elapsed_ + step_time_;
    return observer_.predict(u_applied);
  }

  /// Measurement update only, with the gain for the total time since the last one.
  StepStatus correct(S y) noexcept {
    if (is_too_long()) {
      return observer_.reset(y) == StepStatus::ok ? StepStatus::restarted
                                                  : StepStatus::measurement_rejected;
    }
    take_gap();
    return observer_.correct(y);
  }

  /// Restarts at (y, 0, .., 0), or at a given estimate, N x 1. Time that was too short for a step
  /// is over, too.
  /// @{
  StepStatus reset(S y) noexcept { return begin(observer_.reset(y)); }
  StepStatus reset(const typename Observer::Estimate& state) noexcept {
    return begin(observer_.reset(state));
  }
  /// @}

  /// True if so much time has passed that the next `correct` restarts the observer.
  [[nodiscard]] bool restarts() const noexcept { return is_too_long() || observer_.restarts(); }

  /// Present length of the steps, s.
  [[nodiscard]] const S& step_time() const noexcept { return step_time_; }
  /// Whether it never restarts if every `steps`-th step has a measurement, whatever their lengths.
  [[nodiscard]] bool bridges(int steps) const noexcept {
    const S nominal = chain_config<Observer>(config_.observer).sample_time;
    return detail::at_most(S(static_cast<S>(steps) * (nominal * config_.ratio)), longest_);
  }

 private:
  VariableTime(const Observer& observer, const Config& config, const S& longest) noexcept
      : Base(observer),
        config_(config),
        step_time_(chain_config<Observer>(config_.observer).sample_time),
        current_(step_time_),
        longest_(longest) {}

  StepStatus begin(StepStatus status) noexcept {
    if (status == StepStatus::ok) kept_ = {};
    return status;
  }

  /// Sets the steps to the nominal length.
  void take(const VariableTime& fresh) noexcept {
    config_ = fresh.config_;
    step_time_ = fresh.step_time_;
    current_ = fresh.current_;
    longest_ = fresh.longest_;
  }

  [[nodiscard]] bool is_current() const noexcept {
    return !(step_time_ < current_ || step_time_ > current_);
  }

  [[nodiscard]] bool is_too_long() const noexcept {
    // The sum of the steps is rounded at each of them.
    const S rounded = S(1) + static_cast<S>(this->missed()) * detail::rounding<S>();
    return this->missed() != 0 && elapsed_ > longest_ * rounded;
  }

  /// The observer bridges a gap in `missed` equal steps: sets its sample time to their mean.
  void take_gap() noexcept {
    const int steps = this->missed();
    if (steps > 1 && !this->restarts()) take(elapsed_ / static_cast<S>(steps));
  }

  /// `make` has accepted the ends of the range, so only an estimate that would overflow can be
  /// refused. Then the old sample time is kept, and the next step reports it.
  void take(const S& seconds) noexcept {
    auto config = config_.observer;
    chain_config<Observer>(config).sample_time = seconds;
    if constexpr (requires { observer_.model().speed(); }) {
      const S speed = observer_.model().speed();  // a retune resets it to 1
      if (!detail::retune(observer_, config)) return;
      (void)observer_.set_speed(speed);  // it is within its range
      current_ = seconds;
    } else {
      if (detail::retune(observer_, config)) current_ = seconds;
    }
  }

  Config config_;
  S step_time_;
  detail::FineSum<S> kept_{};  ///< time too short for a step, s
  S current_;                  ///< present sample time of the observer
  S elapsed_{};
  S longest_;  ///< time since the last correction that the next one may bridge
};

/// Distinguishes the type in snapshots.
template <class Observer>
inline constexpr std::uint32_t type_tag<VariableTime<Observer>> =
    make_type_tag<Observer>("VariableTime");

}  // namespace esokit
