/// @file
/// VariableTime: an observer whose sample time changes from step to step.
#pragma once

#include <esokit/adapter/adapter.hpp>
#include <esokit/core/type_tag.hpp>

namespace esokit {

/// Config of VariableTime.
template <LoopObserver Observer>
struct VariableTimeConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  typename Observer::Config observer{};  ///< with the nominal sample time T
  S ratio = S(4);                        ///< above 1: steps may take T / ratio .. T ratio

  /// @cond
  static constexpr auto fields(auto& c) noexcept { return detail::tie(c.observer, c.ratio); }
  /// @endcond
};

/// The observer is told before each step how long the step took; chain and gains follow exactly.
///
/// A step of another length than the last one is a retune: the observer's whole `make`, with one
/// expm1 a level and its checks (LinearEso<2>: some thirty updates' time, 40 .. 80 ns on a desktop,
/// see benchmarks/control). A step of the same length costs one comparison, so do not report
/// changes too small to matter. Observers with a slow `make` (AlgebraicEso designs its whole
/// schedule, AdjustableBandwidthEso and NonlinearEso compute their certificate) are for logs, or
/// for a rate that changes rarely. After missing samples the gain is that of the whole time since
/// the last correction, whatever the single steps were.
///
/// AlgebraicEso counts samples: while its bandwidth falls, it treats all samples so far as if they
/// had the present length; once settled it is exact. The gain sets of a switched observer follow
/// time; its switching test compares successive innovations without regard to the time between
/// them.
template <RestartingObserver Observer>
class VariableTime
    : public NamedAdapter<VariableTime<Observer>, Observer, VariableTimeConfig<Observer>> {
  using Base = NamedAdapter<VariableTime, Observer, VariableTimeConfig<Observer>>;
  friend Base;
  using Base::observer_;
  using S = typename Observer::scalar_type;

 public:
  /// What it declares beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.varies_time = true;
    traits.publishes_chain = false;
    return traits;
  }();

  using typename Base::Config;

  /// Checks the settings and does all the design work.
  /// @return the observer at rest in zero, or an error that names the field; the observer's config
  /// must be good at both ends of the range
  static Expected<VariableTime, Error<S>> make(const Config& config) {
    if (Rules<S> rules; !rules.above("ratio", config.ratio, S(1))) return rules.error();
    auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    // All that may be asked for later must be a good config: the ends of the range are.
    for (const S factor : {config.ratio, S(1) / config.ratio}) {
      auto edge = config.observer;
      chain_config<Observer>(edge).sample_time = chain_config<Observer>(edge).sample_time * factor;
      if (auto ok = Observer::make(edge); !ok) return ok.error();
    }
    return VariableTime(*observer, config);
  }

  /// Sets the length of the next steps (s), until the next call. A length outside T / ratio .. T
  /// ratio is refused, and the last one stays.
  Check<S> set_step_time(const S& seconds) noexcept {
    const S nominal = chain_config<Observer>(config_.observer).sample_time;
    const S shortest = nominal / config_.ratio;
    const S longest = nominal * config_.ratio;
    if (!is_finite(seconds) || seconds < shortest) {
      return Error<S>{"step_time", seconds, "must be finite and at least", -1, shortest, true};
    }
    if (seconds > longest) {
      return Error<S>{"step_time", seconds, "must be at most", -1, longest, true};
    }
    step_time_ = seconds;
    return {};
  }

  /// One sample, see PredictorCorrector::update; it took `step_time`.
  StepStatus update(S y, S u_applied) noexcept {
    if (!is_current() || this->missed() != 0) [[unlikely]] {
      const StepStatus predicted = predict(u_applied);
      return predicted | correct(y);
    }
    elapsed_ = step_time_;
    return observer_.update(y, u_applied);
  }

  /// Time update alone, over `step_time`.
  StepStatus predict(S u_applied) noexcept {
    if (!is_current()) take(step_time_);
    elapsed_ = this->missed() == 0 ? step_time_ : elapsed_ + step_time_;
    return observer_.predict(u_applied);
  }

  /// Measurement update alone, with the gain for all the time since the last one.
  StepStatus correct(S y) noexcept {
    take_gap();
    return observer_.correct(y);
  }

  /// The same with the variance of this measurement's noise, see ExtendedStateFilter.
  template <class B = Base>
  requires requires(B& base, S s) { base.correct_weighted(s, s); }
  StepStatus correct_weighted(S y, S variance) noexcept {
    take_gap();
    return observer_.correct_weighted(y, variance);
  }

  /// Length of the steps now, s.
  [[nodiscard]] const S& step_time() const noexcept { return step_time_; }

 private:
  VariableTime(const Observer& observer, const Config& config) noexcept
      : Base(observer),
        config_(config),
        step_time_(chain_config<Observer>(config_.observer).sample_time),
        current_(step_time_) {}

  /// Sets the steps to the nominal length.
  void take(const VariableTime& fresh) noexcept {
    config_ = fresh.config_;
    step_time_ = fresh.step_time_;
    current_ = fresh.current_;
  }

  [[nodiscard]] bool is_current() const noexcept {
    return !(step_time_ < current_ || step_time_ > current_);
  }

  /// The observer bridges `missed` steps of its sample time: makes that their mean.
  void take_gap() noexcept {
    const int steps = this->missed();
    if (steps > 1 && !this->restarts()) take(elapsed_ / static_cast<S>(steps));
  }

  /// The ends of the range were accepted by `make`; an estimate that would overflow keeps the old
  /// sample time, and the guarded step reports what is not finite.
  void take(const S& seconds) noexcept {
    auto config = config_.observer;
    chain_config<Observer>(config).sample_time = seconds;
    if constexpr (requires { observer_.model().speed(); }) {
      const S speed = observer_.model().speed();  // a retune takes it back to 1
      if (!detail::retune(observer_, config)) return;
      (void)observer_.set_speed(speed);  // within the range that it was accepted in
      current_ = seconds;
    } else {
      if (detail::retune(observer_, config)) current_ = seconds;
    }
  }

  Config config_;
  S step_time_;
  S current_;  ///< the sample time that the observer has now
  S elapsed_{};
};

/// The same for packs, lane by lane.
template <RestartingObserver Observer>
requires PackScalar<typename Observer::scalar_type>
class VariableTime<Observer>
    : public PackAdapter<VariableTime<Observer>, VariableTime<detail::LaneOf<Observer>>, Observer,
                         VariableTimeConfig<Observer>> {
 public:
  using VariableTime::PackAdapter::PackAdapter;
  template <class T>
  using with_scalar =
      VariableTime<detail::WithScalar<Observer, T>>;  ///< the same with another scalar
};

/// Distinguishes the type in snapshots.
template <RestartingObserver Observer>
inline constexpr std::uint32_t type_tag<VariableTime<Observer>> =
    make_type_tag<Observer>("VariableTime");

}  // namespace esokit
