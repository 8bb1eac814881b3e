/// @file
/// PredictiveAdrc (PADRC, and EPADRC with the extended state filter): ADRC in two phases, with
/// almost no computation between the measurement and u. S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen,
/// Energies 15 (2022) 5799, (26), (51)-(53) corrected.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/control_loop.hpp>
#include <esokit/control/controller.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/step_status.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/observer/detail/steady_state.hpp>
#include <optional>

namespace esokit {

namespace detail {

/// What the caller said of the present sample.
enum class PredictivePhase : unsigned char {
  started,  // and u is not yet one of the controller
  prepared,
  measured,
  missing,
  measured_and_applied,
  missing_and_applied
};

}  // namespace detail

/// Config of PredictiveAdrc. Give `controller_bandwidth` or `gains`, not both.
template <class Observer>
requires(detail::foretells<Observer>()) struct PredictiveAdrcConfig {
  using S = typename Observer::scalar_type;                      ///< type of signals and settings
  [[no_unique_address]] ByName<PredictiveAdrcConfig> by_name{};  ///< nothing to set, see ByName
  static constexpr int order = Observer::order;                  ///< n, order of the plant

  typename Observer::Config observer{};    ///< includes b0 and T
  S controller_bandwidth{};                ///< omega_c, rad/s: k_i = C(n, i) omega_c^(n-i)
  std::optional<Array<S, order>> gains{};  ///< k_0 .. k_(n-1)
  Limits<S> limits{};                      ///< of the actuator
  S start_hold{};  ///< t_u >= 0, s: time after the start with u = 0 (within the limits), while
                   ///< the observer settles; rounded up to whole samples
  MissingRule<S> missing{};  ///< what to do when measurements are missing
};

/// u = (v - dhat) / b0, the same as AdrcLaw after the observer's correction, but written as u_k =
/// ubar_k - slope y_k, where ubar_k and slope are known before y_k.
///
/// ```cpp
/// const double u = controller.control(y);   // at the sample: to the actuator at once
/// controller.prepare(next_reference);       // then the rest, any time before the next sample
/// ```
///
/// For gains that are known before the measurement (constant, cascade, algebraic, ESF), `control`
/// takes a multiplication, a subtraction, a test for finiteness and the limits. A switched gain
/// needs one more `select`, a nonlinear gain its k(e), an outlier gate one comparison. `prepare`
/// corrects the observer, predicts, and computes the next ubar. Together they give the result of
/// the observer's `update` followed by AdrcLaw, up to rounding.
///
/// The price is that the reference must be known one sample in advance.
///
/// After `make`, `start` and `reset` the observer's state is the prediction for the first sample;
/// pass the reference of that sample to `set_reference`.
///
/// If a measurement is NaN, infinite, too large, or an outlier for the observer's gate, u is
/// computed from the prediction only and the sample counts as missing. After more than
/// `missing.most` in a row `mode()` is `safe`, and from the next sample on u goes to
/// `missing.input`, by default to zero: see MissingRule for what to choose. With a bad reference
/// the last u is kept, and `reference_rejected` reported.
///
/// The actuator is assumed to hold what `control` returned. If it reports another value, before or
/// after `prepare`, say `applied(u)`: the prediction is corrected by Gamma (u_reported -
/// u_assumed) before the next correction. A rate limit counts from what `control` returned.
///
/// Calls other than make and retune only multiply and add, except in the observer's gain law (the
/// division of a filter, the power of fal). No call allocates, throws or locks.
template <class Observer>
requires(detail::foretells<Observer>()) class PredictiveAdrc {
 public:
  static constexpr int order = Observer::order;        ///< n, order of the plant
  using scalar_type = typename Observer::scalar_type;  ///< type of signals and settings
  using S = scalar_type;                               ///< the same type
  using Estimate = typename Observer::Estimate;        ///< (y, .., y^(n-1), d, ..), N x 1
  using Reference = esokit::Reference<order, S>;       ///< r, `{r, r1}` or a vector

  /// What the controller can do beyond `update(y, reference)`.
  static constexpr ControllerTraits traits{
      .two_phases = true,
      .takes_derivatives = true,
      .knows_sample_time = true,
      .takes_measured = observer_traits<Observer>.takes_measured,
      .observes = true};

  using Config = PredictiveAdrcConfig<Observer>;  ///< settings of make

  /// Checks the settings and does all the design work.
  /// @return the controller at rest, reference 0, or an error that names the field
  static Expected<PredictiveAdrc, Error<S>> make(const Config& config) {
    const auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    const auto law = AdrcLaw<order, S>::make({.controller_bandwidth = config.controller_bandwidth,
                                              .gains = config.gains,
                                              .input_gain = observer->input_gain()});
    if (!law) return law.error();
    const auto limiter = Limiter<S>::make(config.limits, observer->sample_time());
    if (!limiter) return limiter.error();
    const auto hold = hold_samples(config.start_hold, observer->sample_time());
    if (!hold) return hold.error();
    Rules<S> rules;
    const bool contain_zero = !(config.limits.lower > S(0.0)) && !(config.limits.upper < S(0.0));
    rules.demand(*hold == 0 || contain_zero, "start_hold", config.start_hold,
                 "must be left out, as its u = 0 is not within the limits");
    if (!rules) return rules.error();
    if (auto ok = detail::check_missing(config.missing, config.limits); !ok) return ok.error();
    PredictiveAdrc controller(*observer, *law, *limiter, *hold, config.missing);
    for (const S& weight : controller.set_.weights) {
      if (!all(is_finite(weight))) {
        return Error<S>{"observer.sample_time", observer->sample_time(),
                        "with these gains gives a law that the scalar cannot hold"};
      }
    }
    controller.arm();
    return controller;
  }

  /// First phase, at the sample. @param y measurement @return u, within the limits
  ESOKIT_INLINE S control(S y) noexcept {
    measurement_ = y;
    S raw = wanted(y);
    if constexpr (observer_traits<Observer>.gates_outliers) {
      if (!observer_.accepts(y)) [[unlikely]]
        raw = next_.blind;
    }
    output_ = limiter_.clamp(actuated(select(usable(y, raw), raw, next_.blind)));
    phase_ = Phase::measured;
    return output_;
  }

  /// w of this sample, before `control`, for an observer that is Measured; computes the next u
  /// anew. If it is left out, w is lost. @param w a number, or a vector of several; NaN: lost
  template <class W, class O = Observer>
  requires(observer_traits<O>.takes_measured) void measured(const W& w) noexcept {
    observer_.measured(w);
    observer_.revise_measured();
    arm();
  }

  /// First phase of a sample without a measurement.
  S control_without_measurement() noexcept {
    output_ = limiter_.clamp(actuated(next_.blind));
    phase_ = Phase::missing;
    return output_;
  }

  /// Second phase. @param next_reference of the next sample: r, `{r, r1}` or a vector
  StepStatus prepare(const Reference& next_reference) noexcept {
    StepStatus status = StepStatus::ok;
    S drive = output_;
    if (phase_ == Phase::measured) {
      status |= observer_.correct(measurement_);
    } else [[unlikely]] {
      if (phase_ == Phase::measured_and_applied) status |= observer_.correct(measurement_);
      if (phase_ >= Phase::measured_and_applied) drive = limiter_.last();
    }
    limiter_.settle(output_);
    status |= observer_.predict(drive);
    if (phase_ != Phase::measured || status != StepStatus::ok || mode_ != LoopMode::running)
        [[unlikely]] {
      judge();
    }
    phase_ = Phase::prepared;
    status_ = status;
    set_reference(next_reference);
    return status_;
  }

  /// Both phases at once, if the computing delay does not matter. @return u
  S update(S y, const Reference& next_reference) noexcept {
    const S u = control(y);
    prepare(next_reference);
    return u;
  }

  /// Changes the reference of the next sample, any time before it.
  void set_reference(const Reference& next_reference) noexcept {
    for (int i = 0; i <= order; ++i) {
      reference_[static_cast<std::size_t>(i)] = next_reference(i);
    }
    arm();
  }

  /// What the actuator held since the last `control`, if it was not its u. @return ok, or
  /// input_rejected for a number that is not finite, which changes nothing @{
  StepStatus applied(S u) noexcept {
    if (!all(is_finite(u))) return StepStatus::input_rejected;
    StepStatus status = StepStatus::ok;
    if (phase_ == Phase::started) {
      output_ = u;
      limiter_.track(u);
    }
    if (phase_ <= Phase::prepared) {
      status |= observer_.revise_input(u);
      arm();
    } else {
      limiter_.applied(u);
      const bool missing = phase_ == Phase::missing || phase_ == Phase::missing_and_applied;
      phase_ = missing ? Phase::missing_and_applied : Phase::measured_and_applied;
    }
    return status;
  }
  StepStatus report_applied(S u) noexcept = delete;  // its name is applied(u)
  /// @}

  /// Takes over a plant at rest at y under u without a bump: with the reference at y the first
  /// output is this u.
  StepStatus start(S y, S u) noexcept {
    const StepStatus status = detail::start_at_rest(observer_, y, u);
    if (status != StepStatus::ok) return StepStatus::state_rejected;
    hold_left_ = 0;
    mode_ = LoopMode::running;
    output_ = u;
    limiter_.track(u);
    phase_ = Phase::started;
    set_reference(y);
    return status;
  }

  /// Restarts the observer at (y, 0, .., 0), and the start hold.
  StepStatus reset(S y) noexcept {
    const StepStatus status = observer_.reset(y);
    if (status != StepStatus::ok) return status;
    hold_left_ = set_.hold;
    mode_ = set_.hold > 0 ? LoopMode::start_hold : LoopMode::running;
    phase_ = Phase::prepared;
    arm();
    return status;
  }

  /// New settings while running: the estimate and u are kept. Do not call it between `control` and
  /// `prepare`. A refused config changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`: without design work, so it may
  /// run in an interrupt.
  Check<S> adopt(const PredictiveAdrc& fresh) {
    if (auto ok = observer_.adopt(fresh.observer_); !ok) return ok;
    set_ = fresh.set_;
    limiter_.adopt(fresh.limiter_, output_);
    arm();
    return {};
  }

  /// The observer, for its estimates.
  [[nodiscard]] const Observer& observer() const noexcept { return observer_; }
  /// T, s.
  [[nodiscard]] S sample_time() const noexcept { return observer_.sample_time(); }
  /// The present u.
  [[nodiscard]] const S& output() const noexcept { return output_; }
  /// Status of the observer at the last sample.
  [[nodiscard]] StepStatus status() const noexcept { return status_; }
  /// Whether u is determined by the law, the start hold or the rule for missing measurements.
  [[nodiscard]] LoopMode mode() const noexcept { return mode_; }
  /// The next u if its measurement is missing, before the limits.
  [[nodiscard]] detail::Turned<Observer, S> blind_output() const noexcept {
    if constexpr (observer_traits<Observer>.maps_input) {
      return detail::clipped(actuated(next_.blind));
    } else {
      return next_.blind;
    }
  }
  /// k_0 .. k_(n-1).
  [[nodiscard]] const Array<S, order>& gains() const noexcept { return set_.law.gains(); }

 private:
  using Weights = Array<S, order + 1>;
  using Phase = detail::PredictivePhase;
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr int data_members = 11;

  /// What is known about the gain before the measurement.
  static constexpr GainKind kind = observer_traits<Observer>.gain_kind;
  static constexpr bool preset = kind == GainKind::preset;
  static constexpr bool measures_first_row = observer_traits<Observer>.measures_first_row;
  static_assert(preset || measures_first_row,
                "esokit: with a sensor's lag in the model PredictiveAdrc needs a gain that is "
                "known before the measurement");
  static constexpr bool switched = kind == GainKind::switched;
  static constexpr bool factored = kind == GainKind::factored;

  PredictiveAdrc(const Observer& observer, const AdrcLaw<order, S>& law, const Limiter<S>& limiter,
                 std::uint32_t hold, const MissingRule<S>& missing) noexcept
      : limiter_(limiter),
        output_(limiter.last()),
        mode_(hold > 0 ? LoopMode::start_hold : LoopMode::running),
        observer_(observer),
        set_{.law = law,
             .safe_input = missing.input.value_or(S(0.0)),
             .hold = hold,
             .missing_limit = static_cast<std::uint16_t>(missing.most + 1),
             .hold_safe = missing.hold,
             .stay_safe = missing.stay},
        hold_left_(hold) {
    // The weights include 1/b0 and the scaling T^i / i! of the chain.
    const S inverse = S(1.0) / law.input_gain();
    const S rate = S(1.0) / observer.sample_time();
    S unit = inverse;
    for (int i = 0; i <= order; ++i) {
      const auto row = static_cast<std::size_t>(i);
      if (i > 0) unit = unit * (detail::integer<S>(i) * rate);
      const S gain = i < order ? law.gains()[static_cast<std::size_t>(i % order)] : S(1.0);
      set_.weights[row] = i < order ? S(gain * unit) : unit;
      set_.feeds[row] = i < order ? S(gain * inverse) : inverse;
      reference_[row] = S(0.0);
    }
  }

  static Expected<std::uint32_t, Error<S>> hold_samples(const S& seconds, const S& sample_time) {
    const S samples = seconds / sample_time - S(1e-3);
    Rules<S> rules;
    rules.not_negative("start_hold", seconds)
        .demand(detail::at_most(S(seconds / sample_time), S(1e6)), "start_hold", seconds,
                "must be 1e6 samples or less");
    if (!rules) return rules.error();
    std::uint32_t count = 0;
    while (!all(detail::integer<S>(count) >= samples)) ++count;
    return count;
  }

  /// The u with an effect, and back. What is `next_` and `wanted` are effects.
  /// @{
  [[nodiscard]] ESOKIT_INLINE detail::Turned<Observer, S> actuated(const S& effect) const noexcept {
    return detail::input_for(observer_, effect);
  }
  [[nodiscard]] ESOKIT_INLINE detail::Turned<Observer, S> effect_of(const S& u) const noexcept {
    return detail::effect_of(observer_, u);
  }
  /// @}

  /// u before the limits.
  [[nodiscard]] ESOKIT_INLINE S wanted(const S& y) const noexcept {
    if constexpr (preset) {
      return next_.offset - next_.slope * y;
    } else {
      const S e = y - next_.offset;
      if (next_.general) [[unlikely]]
        return wanted_in_general(y);
      if constexpr (switched) {
        return next_.blind -
               select(observer_.gain_law().shrinks(e), next_.slope, next_.other_slope) * e;
      } else if constexpr (factored) {
        return next_.blind - (next_.slope * observer_.gain_law().factor(e)) * e;
      } else {
        if (!all(is_finite(e))) [[unlikely]]
          return e;  // such a law never sees one
        return next_.blind - weigh(observer_.correction_gain(e)) * e;
      }
    }
  }

  /// True if the observer will accept y, that is, if no estimate would become infinite.
  [[nodiscard]] ESOKIT_INLINE auto usable(const S& y, const S& raw) const noexcept {
    return is_finite(preset ? S(next_.guard * y) : raw);
  }

  /// For samples after a gap, or if u does not depend on y.
  [[nodiscard]] ESOKIT_COLD S wanted_in_general(const S& y) const noexcept {
    if (next_.settled) return next_.blind;
    if (observer_.restarts()) return next_.feed - set_.weights[0] * y;
    const S e = y - next_.offset;
    if (!all(is_finite(e))) return e;
    return next_.blind - weigh(observer_.correction_gain(e)) * e;
  }

  /// sum_i w_i x_i over the plant states and the disturbance.
  template <class State>
  [[nodiscard]] ESOKIT_INLINE S weigh(const State& x) const noexcept {
    return detail::weighed<0, order + 1>(set_.weights, x);
  }

  /// Computes all parts of the next u that do not need the measurement.
  void arm() noexcept {
    next_.settled = false;
    look_ahead();
    if constexpr (preset) {
      if (Observer::levels > 1 || !measures_first_row || observer_.restarts()) {
        arm_by(observer_.preview());
      } else if constexpr (Observer::levels == 1) {
        arm_by(observer_.correction_gain(S(0.0)));
      }
    } else {
      next_.offset = observer_.template scaled_estimate<0>();
      next_.general = observer_.missed() > 1;
      if constexpr (switched) {
        next_.slope = weigh(observer_.gain_law().shrinking_gain());
        next_.other_slope = weigh(observer_.gain_law().otherwise_gain());
      } else if constexpr (factored) {
        next_.slope = weigh(observer_.gain_law().linear_gain());
      }
    }
    if constexpr (observer_traits<Observer>.blanks_estimate) {
      if (observer_.blanked()) [[unlikely]] {
        // A blanked observer publishes the estimate from its start, so u does not depend on y.
        typename Reference::All reference;
        for (int i = 0; i <= order; ++i) reference(i) = reference_[static_cast<std::size_t>(i)];
        settle_for(set_.law.control(observer_.estimate(), reference));
      }
    }
    if (mode_ != LoopMode::running) [[unlikely]] {
      if (!all(is_finite(next_.feed))) status_ |= StepStatus::reference_rejected;
      settle_for(effect_of(mode_ == LoopMode::start_hold ? S(0.0)
                           : set_.hold_safe              ? output_
                                                         : set_.safe_input));
    }
    // If this is not finite, u would be NaN with a measurement, and a NaN passes the limits.
    if (!all(is_finite(next_.blind)) || !all(is_finite(next_.offset)) ||
        !all(is_finite(next_.slope))) [[unlikely]] {
      settle_for_blind();
    }
  }

  /// u without a measurement.
  void look_ahead() noexcept {
    next_.feed = detail::weighed<0, order + 1>(set_.feeds, reference_);
    const S tail = detail::weighed_estimates<1, order>(set_.weights, observer_);
    const S ahead = detail::weighed<1, order>(set_.feeds, reference_);
    next_.blind = set_.weights[0] * (reference_[0] - observer_.template scaled_estimate<0>()) +
                  (ahead - tail);
  }

  /// For the gain of the next correction.
  void arm_by(const ScaledGain<Observer::size, S>& gain) noexcept {
    next_.slope = weigh(gain);
    next_.offset = next_.blind + next_.slope * observer_.template scaled_estimate<0>();
    next_.guard = observer_.finite_probe(gain);
  }

  /// For cascades, and if the observer will restart.
  template <class Preview>
  requires requires(const Preview& next) { next.slope; }
  void arm_by(const Preview& next) noexcept {
    next_.slope = weigh(next.slope);
    next_.offset = next_.feed - weigh(next.offset);
    next_.guard = observer_.finite_probe(next.slope);
  }

  ESOKIT_COLD void settle_for_blind() noexcept {
    if constexpr (!records<S>) {
      if (!is_finite(next_.blind)) status_ |= StepStatus::reference_rejected;
    }
    settle_for(select(is_finite(next_.blind), next_.blind, effect_of(output_)));
  }

  /// Which u is next: after the prediction, when a measurement that is missing counts as two.
  ESOKIT_COLD void judge() noexcept {
    if (mode_ == LoopMode::start_hold && --hold_left_ == 0) mode_ = LoopMode::running;
    const int missed = observer_.missed() - 1;
    if (missed >= set_.missing_limit) {
      mode_ = LoopMode::safe;
    } else if (mode_ == LoopMode::safe && !set_.stay_safe && missed <= 0) {
      mode_ = LoopMode::running;
    }
  }

  /// The next u does not depend on y.
  void settle_for(const S& u) noexcept {
    next_.blind = u;
    next_.settled = true;
    next_.general = true;
    if constexpr (preset) {
      next_.offset = u;
      next_.slope = S(0.0);
    }
  }

  // What `control` uses comes first.

  /// The next u, see `arm`.
  struct Next {
    static constexpr int data_members = 8;
    S offset{};  ///< ubar_k; if the gain depends on e, the predicted y
    S slope{};   ///< minus du/dy
    S guard{};   ///< largest factor, with units, by which y enters the estimates
    S other_slope{};
    S blind{};  ///< u without a measurement
    S feed{};
    bool general = false;  ///< the gain depends on e: no short way
    bool settled = false;  ///< u is `blind` for any y
  } next_;
  Limiter<S> limiter_;
  S measurement_{};
  S output_{};  ///< as it was commanded
  Phase phase_ = Phase::prepared;
  LoopMode mode_;

  Observer observer_;
  /// What a retune replaces.
  struct Set {
    static constexpr int data_members = 8;
    AdrcLaw<order, S> law;
    Weights weights{};  ///< of the scaled states
    Weights feeds{};    ///< of the reference and its derivatives
    S safe_input{};
    std::uint32_t hold{};
    std::uint16_t missing_limit{};
    bool hold_safe{};
    bool stay_safe{};
  } set_;
  Weights reference_{};  ///< (r, r', .., r^(n)) of the next sample
  StepStatus status_ = StepStatus::ok;
  std::uint32_t hold_left_;
};

/// Distinguishes the type in snapshots.
template <class Observer>
inline constexpr std::uint32_t type_tag<PredictiveAdrc<Observer>> =
    make_type_tag<Observer>("PredictiveAdrc");

}  // namespace esokit
