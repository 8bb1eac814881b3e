/// @file
/// Guarded: holds, gates, bounds or leaks the disturbance estimate, or changes b0, for any observer
/// with a constant gain.
#pragma once

#include <cstdint>
#include <esokit/adapter/adapter.hpp>
#include <esokit/adapter/correction_weights.hpp>
#include <esokit/adapter/detail/guarded_states.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <limits>

namespace esokit {

/// Config of Guarded.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct GuardedConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<GuardedConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};                   ///< config of the observer
  S disturbance_bound{};  ///< largest abs(dhat); 0: no bound. Unit of y^(n) or u, see `unit`
  DisturbanceUnit unit = DisturbanceUnit::output;  ///< unit of dhat and its bound
  int release_samples = 0;  ///< measurements from the end of a pin until dhat is free, 0 .. 65000
  S leak_time{};            ///< time constant of the decay of dhat, s; 0: none
};

/// Guards dhat while the plant does not follow y^(n) = d + b0 u. Each guard is off by default.
/// While all are off, the estimate is the same, bit for bit, as that of the observer inside.
///
/// - Trust: `set_trust(phi)`, 0 .. 1, multiplies every correction of dhat; y and its derivatives
///   are corrected as usual.
/// - Held: something else (the ground, a brake) keeps the plant at a standstill, so the measurement
///   contains no information about d. Between `hold(u)` and `release()` the estimate is (y, 0, ..,
///   0, dhat) with the y that is measured and the dhat of before, whatever u is. A hold without any
///   measurement is completed by the first one after it. `hold` returns the u to give to the
///   observer, on the chain the one that makes y^(n) zero. `Adrc::hold` does this for one sample;
///   on release start the reference at y. A plant that moves while its output is off needs no hold:
///   u is known to be zero.
/// - Pinned: the actuator or a mixer is at a limit, and its output is not known (a known output is
///   passed as u_applied and needs no guard). dhat may only move in the direction that brings u
///   back from the limit: upwards if u is at its upper limit and b0 > 0. dhat is free again
///   `release_samples` measurements after the end of the pin. There is no time-out during the pin,
///   because it would only restore the fault. Use this guard only if the output is unrelated to u:
///   if half of u still acts, dhat compensates for the other half, and holding it does more harm
///   than good (examples/guards).
/// - Bound: abs(dhat) <= disturbance_bound, after the correction and before the prediction, at
///   every level of a cascade. A load above the bound causes a steady error; `bounded()` reports
///   this. With m > 1 a slope of dhat that would exceed the bound is set to zero.
/// - Leak: each correction multiplies dhat by exp(-T / leak_time), for any trust, so that an
///   outdated dhat decays. This removes the integral action: a constant load leaves a steady error,
///   in the estimate `leak_error()`, in y `Adrc::leak_error()`.
/// - A changing b0: `set_input_gain(b)` before a sample, without design work. Adrc and
///   DisturbanceCompensator use the new b0, too. A retune keeps trust, pin and the ratio of this b0
///   to that of the config.
///
/// With a model (ModelEso) all guards act on the constant part of d only, not on the contributions
/// of plant poles, actuator and sines to `total_disturbance`. The unit of d and its bound is that
/// of y^(n), with n of the plant, or that of the actuator's output.
/// - The actuator is always simulated from the applied u. While the plant is held, give the applied
///   u; v is correct on release.
/// - A changing b0 is the gain of the actuator's output v: y .. y^(n-1), v and d continue without a
///   jump, and y^(n) jumps as in the plant. (For a gain before the lag, such as a supply voltage,
///   multiply u_applied.)
/// - Sines are always corrected as usual, and are not included in the bound. If their corrections
///   were left out for some samples of each period, they would be unstable, because G has a pole at
///   their frequency. So a hold cannot keep them: after it they start again from zero.
/// - Choose `release_samples` long enough for the simulated lag to forget the wrong u after a pin.
///
/// The first three multiply the correction of dhat by a phi in [0, 1], which may change at every
/// sample. With m = 1 the bound does the same, as long as the true d is within it. What is proven
/// of this, level by level:
/// - By the circle criterion errors stay bounded, and decay once the trust returns, if Re G > -1 on
///   the unit circle. G is the transfer function from the correction of dhat to its innovation.
///   `make` checks this, including the leak. Poles in one place pass at any bandwidth (tested up to
///   n = 5, omega_o T = 20). For them min Re G is -1/4 (n = 1), -1/3 (n = 2), -3/8 (n = 3) for fast
///   sampling, and never below -1/2. Known poles and an actuator do not change it; a sensor has an
///   effect like up to one more order per lag. A sine that is captured too fast for its frequency
///   is refused (20 rad/s at omega_o = 100: `capture_bandwidth` 20 fails, 4 passes).
/// - At each hold the error of dhat is at most that at the hold before, whatever phi was between
///   them: `make` checks this, too (gain/certificate/gating_certificate.hpp). Poles in one place
///   pass as they are up to omega_o T = 1 at least. For other gains, with slow sines for example,
///   the first correction that is scaled within the settling time after a release stops all
///   corrections of dhat for this time.
///
/// Gaps and the effect of a level of a cascade on the next are not part of the proof. Searched,
/// without a sequence that grows: all of the above with gaps of any length, for n = 1 .. 5, models
/// with lags and sines, two and three levels. While dhat is at its bound, the other states decay as
/// if it were not corrected, which is slower.
///
/// With m > 1 the estimated slope would continue while dhat is held, and with VariableTime the gain
/// is not constant: for these only the bound and a changing b0 are available.
///
/// Requires a constant gain, on the chain or on an AugmentedModel with one constant, and must be
/// the outermost adapter. KnownModel is excluded, because the proof does not cover fbar, and so are
/// first-order parts (use `leak_time` instead), because a held constant next to a decaying one is
/// unstable.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) class Guarded
    : public NamedAdapter<Guarded<Observer>, Observer, GuardedConfig<Observer>> {
  static_assert(
      observer_traits<Observer>.bears_guards,
      "esokit: Guarded needs a constant gain on the chain of integrators: LinearEso, "
      "CascadeEso and adapters of them, without KnownModel; or for LinearEso "
      "with an AugmentedModel of one constant, without first-order parts or a varying speed");
  using Base = NamedAdapter<Guarded, Observer, GuardedConfig<Observer>>;
  friend Base;
  friend struct detail::RecordAccess;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  static constexpr int n = Observer::order;
  using Guards = detail::GuardedStates<Observer>;
  using Model = typename Guards::Model;
  static constexpr bool varies_time = observer_traits<Observer>.varies_time;
  static constexpr bool takes_measured = observer_traits<Observer>.takes_measured;
  static constexpr bool on_chain = model_traits<Model>.is_chain;
  static_assert(on_chain || !varies_time,
                "esokit: with a model Guarded needs a fixed sample time: not with "
                "VariableTime");
  static_assert(!Guards::turns_move_constant,
                "esokit: with the poles of a plant a whole turn is a step of the constant: Guarded "
                "takes WrappedOutput without plant_poles");

 public:
  using Base::levels;
  using Base::size;
  using typename Base::Config;
  using typename Base::Estimate;

  /// Whether corrections of dhat may be scaled (trust, pin and hold).
  static constexpr bool gates = !on_chain || (size == n + 1 && !varies_time);

  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.acts_by_gain = false;  // it also depends on the present b0
    traits.schedules_input_gain = true;
    traits.gates_disturbance = gates;
    return traits;
  }();

  /// Checks the settings and does all the design work.
  /// @return the observer at rest at zero, without a pin and with full trust; or an error that
  /// names the field, or `level` and its number if the circle criterion fails
  static Expected<Guarded, Error<S>> make(const Config& config) {
    auto made = Base::make(config);
    if (!made) return made.error();
    if constexpr (gates) {
      for (int level = 0; level < levels; ++level) {
        const auto samples = Guards::settling_samples(made->observer_, level, made->set_.leak);
        if (!samples) return samples.error();
        if (*samples > made->set_.settling_samples) made->set_.settling_samples = *samples;
      }
    }
    return *made;
  }

  /// One sample, see PredictorCorrector::update.
  StepStatus update(S y, S u_applied) noexcept {
    const bool stands = weights_.acts && (weights_.held || weights_.unsettled);
    // What is measured moves dhat with the prediction, which is not to be guarded.
    if (takes_measured || stands || (!on_chain && changes_gain())) [[unlikely]] {
      const StepStatus predicted = predict(u_applied);
      return predicted | correct(y);
    }
    const Found before = found();
    const StepStatus status = observer_.update(y, S(u_applied * given_ratio_));
    given_ratio_ = gain_ratio_;
    keep_guards(before, status);
    return status;
  }

  /// Time update only, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    const S told = u_applied * given_ratio_;
    const StepStatus status =
        gates && weights_.held ? predict_standing(told) : observer_.predict(told);
    if (takes_measured) keep_bound();
    take_gain();
    return status;
  }

  /// Measurement update only, see PredictorCorrector::correct.
  StepStatus correct(S y) noexcept {
    if (gates && (weights_.held || weights_.unsettled)) [[unlikely]]
      return correct_standing(y);
    const Found before = found();
    const StepStatus status = observer_.correct(y);
    keep_guards(before, status);
    return status;
  }

  /// Restarts at (y, 0, .., 0), with its dhat limited to the bound. (With the poles of a plant this
  /// dhat is the one that lets the plant rest at y.) Trust, pin and b0 are kept.
  StepStatus reset(S y) noexcept { return begin(observer_.reset(y)); }

  /// Restarts at a given estimate, N x 1, with its dhat limited to the bound.
  StepStatus reset(const Estimate& state) noexcept { return begin(observer_.reset(state)); }

  /// From the next correction on, corrections of dhat are multiplied by `phi`, 0 .. 1. A smaller or
  /// larger phi counts as 0 or 1. @return ok, or input_rejected for one that is not finite, which
  /// changes nothing
  StepStatus set_trust(const S& phi) noexcept requires gates {
    if (!is_finite(phi)) return StepStatus::input_rejected;
    weights_.trust = phi < S(0) ? S(0) : phi < S(1) ? phi : S(1);
    set_weights();
    return StepStatus::ok;
  }

  /// Tells at which limit the actuator is, from the next correction on. Call it once, or at every
  /// sample.
  void set_pin(Pin where) noexcept requires gates {
    weights_.set_pin(where, applied_input(), set_.release_samples);
    set_weights();
  }

  /// Tells that something else holds the plant, until `release`: dhat is not corrected.
  /// @param u_applied the u that was held since the last sample
  /// @return the u to give to the observer instead: on the chain `holding_input`; with a model the
  ///         same u, for its actuator, while its prediction of y stands still
  S hold(const S& u_applied) noexcept requires gates {
    weights_.held = true;
    set_weights();
    return on_chain ? holding_input() : u_applied;
  }
  /// Ends `hold`.
  void release() noexcept requires gates {
    weights_.held = false;
    set_weights();
  }

  /// The u under which the plant would stand still if d were dhat.
  [[nodiscard]] S holding_input() const noexcept requires gates {
    const S u = Guards::Constant::holding(observer_) * (set_.inverse_gain * input_factor_);
    return is_finite(u) ? u : applied_input();
  }

  /// Sets b0 from the next sample on: it applies to the next output of the law, and therefore to
  /// the u that is passed to the observer one sample later. dhat is kept in its unit, see
  /// DisturbanceUnit.
  /// @return error for a b that is not finite, has not the sign of the config's input_gain, or is
  /// too far from it for the scalar: nothing changes then
  Check<S> set_input_gain(const S& b) noexcept {
    const S ratio = b * set_.inverse_gain;
    const S factor = S(1) / ratio;
    if (!is_finite(b) || !is_finite(ratio) || !is_finite(factor) || !(ratio > S(0))) {
      return Error<S>{
          "input_gain",      b,   "must be finite, not zero, and have the sign of the config's", -1,
          configured_gain(), true};
    }
    // With a model the sample that ends now still has the previous b0.
    const S change = on_chain ? S(ratio * input_factor_) : S(ratio / given_ratio_);
    if (!on_chain || set_.unit == DisturbanceUnit::input) {
      const auto next = rescaled(change);
      if (!detail::GuardAccess::finite(observer_, next)) {
        return Error<S>{"input_gain", b, "would make the estimate not finite"};
      }
      if (on_chain) detail::GuardAccess::states(observer_) = next;
    }
    gain_ratio_ = ratio;
    input_factor_ = factor;
    if (on_chain) renew_bound();
    return {};
  }

  /// The trust phi, 0 .. 1.
  [[nodiscard]] const S& trust() const noexcept { return weights_.trust; }
  /// The last argument of `set_pin`.
  [[nodiscard]] Pin pin() const noexcept { return weights_.pin; }
  /// True if the next correction of dhat will be scaled: by less than full trust, a pin, or the
  /// time after a pin.
  [[nodiscard]] bool gated() const noexcept { return weights_.gated; }
  /// True if dhat is at its bound.
  [[nodiscard]] bool bounded() const noexcept { return set_.guarded.bounded(observer_, limit()); }
  /// The share of dhat that the leak removes after each correction, 0 .. 1.
  [[nodiscard]] const S& leak_share() const noexcept { return set_.leak; }
  /// The steady error x - xhat caused by the leak, for a constant y and a constant d = 1 (unit of
  /// y^(n)): (y, .., d), N x 1. Zero without a leak.
  [[nodiscard]] Estimate leak_error() const noexcept requires gates {
    return set_.leak > S(0) ? Guards::leak_error(observer_, set_.leak) : Estimate(Estimate::Zero());
  }

  /// The present b0, unit of y^(n) per unit of u.
  [[nodiscard]] S present_input_gain() const noexcept { return configured_gain() * gain_ratio_; }
  /// b0 of the config divided by the present b0: the factor on the output of a law that uses the
  /// former.
  [[nodiscard]] const S& input_factor() const noexcept { return input_factor_; }

  /// Adds `offset` to dhat, limited to the bound, see PredictorCorrector.
  StepStatus shift_disturbance(const S& offset) noexcept requires ShiftableDisturbance<Observer> {
    return bounded_after(observer_.shift_disturbance(offset));
  }

  /// Adds `offset` to the load, limited to the bound, see PredictorCorrector.
  StepStatus shift_load(const S& offset) noexcept requires ShiftableLoad<Observer> {
    return bounded_after(observer_.shift_load(offset));
  }

  /// As of Measured, with dhat limited to the bound.
  template <class O = Observer>
  requires(observer_traits<O>.takes_measured) void revise_measured() noexcept {
    observer_.revise_measured();
    keep_bound();
  }

  /// The input that the last prediction used, converted to the present b0.
  [[nodiscard]] S applied_input() const noexcept {
    return detail::clipped(S(observer_.applied_input() * input_factor_));
  }
  /// The estimate for a plant at rest at y under a constant u, N x 1.
  [[nodiscard]] Estimate equilibrium(const S& y, const S& u) const noexcept {
    return observer_.equilibrium(y, S(u * gain_ratio_));
  }
  /// Sets the state as if `u` had been applied for a long time.
  template <class O = Observer>
  requires(observer_traits<O>.delays_input) void fill_input(const S& u) noexcept {
    observer_.fill_input(S(u * gain_ratio_));
  }
  /// Tells that the actuator held `u_applied`, see PredictorCorrector.
  StepStatus revise_input(const S& u_applied) noexcept requires requires(Observer& o, const S& s) {
    o.revise_input(s);
  }
  { return observer_.revise_input(S(u_applied * gain_ratio_)); }

 private:
  Guarded(const Observer& observer, const Config& config) noexcept
      : Base(observer),
        set_{config.disturbance_bound,
             S(1) / chain_config<Observer>(config.observer).input_gain,
             Guards::leak_share(config),
             Guards(observer.model()),
             config.unit,
             static_cast<std::uint16_t>(config.release_samples)} {
    detail::GuardAccess::restart_after_long_gaps(observer_);
    set_weights();
    set_limit();
  }

  /// What a retune replaces: trust, pin and the ratio of the present b0 to that of the config stay.
  void take(const Guarded& fresh) noexcept {
    set_ = fresh.set_;
    if (weights_.release_left > set_.release_samples) weights_.release_left = set_.release_samples;
    if (weights_.settling_left > 0) weights_.settling_left = set_.settling_samples;
    set_weights();
    renew_bound();
  }

  static Check<S> validate(const Config& config) {
    return Rules<S>{}
        .invertible("input_gain", chain_config<Observer>(config.observer).input_gain)
        .not_negative("disturbance_bound", config.disturbance_bound)
        .demand(0 <= config.release_samples && config.release_samples <= 65000, "release_samples",
                static_cast<S>(config.release_samples), "must be 0 .. 65000")
        .not_negative("leak_time", config.leak_time)
        .demand(gates || !(config.leak_time > S(0)), "leak_time", config.leak_time,
                "must be 0 with an extension above 1 or a varying sample time")
        .demand(!(config.leak_time > S(0)) ||
                    Guards::leak_share(config) >= std::numeric_limits<S>::epsilon(),
                "leak_time", config.leak_time,
                "is too long: what leaks in one sample is below the rounding of the scalar");
  }

  /// b0 of the config. (Of a model with an actuator input_gain() is b0 / tau.)
  [[nodiscard]] S configured_gain() const noexcept {
    return on_chain ? observer_.input_gain() : S(S(1) / set_.inverse_gain);
  }

  /// The states under another b0.
  [[nodiscard]] auto rescaled(const S& factor) const noexcept {
    return set_.guarded.rescaled(observer_, factor, set_.unit == DisturbanceUnit::input);
  }

  /// Whether the next sample has another b0.
  [[nodiscard]] ESOKIT_INLINE bool changes_gain() const noexcept {
    return given_ratio_ < gain_ratio_ || given_ratio_ > gain_ratio_;
  }

  /// Puts the b0 of `set_input_gain` into effect.
  ESOKIT_INLINE void take_gain() noexcept {
    if (!on_chain && changes_gain()) [[unlikely]] {
      const auto next = rescaled(S(gain_ratio_ / given_ratio_));
      if (detail::GuardAccess::finite(observer_, next)) {
        detail::GuardAccess::states(observer_) = next;
      }
      renew_bound();
    }
    given_ratio_ = gain_ratio_;
  }

  /// After a restart at a given estimate.
  StepStatus begin(StepStatus status) noexcept {
    if (status == StepStatus::ok) stand_for(0);
    return bounded_after(status);
  }
  StepStatus bounded_after(StepStatus status) noexcept {
    if (status == StepStatus::ok) keep_bound();
    return status;
  }
  void stand_for(int settling_samples) noexcept {
    weights_.stand_for(settling_samples);
    set_weights();
  }

  /// Prediction while held: d and the actuator continue, and the sensor follows a constant y.
  ESOKIT_COLD StepStatus predict_standing(S told) noexcept {
    const auto before = detail::GuardAccess::states(observer_);
    const StepStatus status = observer_.predict(told);
    if (!has(status, StepStatus::prediction_dropped)) {
      if (set_.guarded.stand_still(observer_, before)) weights_.unsettled = true;
      set_weights();
    }
    return status;
  }

  /// Correction while held: y is what is measured, and dhat stays.
  ESOKIT_COLD StepStatus correct_standing(S y) noexcept {
    const auto before = detail::GuardAccess::states(observer_);
    const S left = S(1) - detail::GuardAccess::measured_gain(observer_);
    const StepStatus status = observer_.correct(y);
    if (!weights_.refused(status)) {
      stand_for(set_.settling_samples);
      set_.guarded.stand_at_measurement(observer_, before, left);
    }
    // What stands has no correction to scale, also after a restart.
    keep_guards(found(), status);
    return status;
  }

  using Found = typename Guards::Found;
  ESOKIT_INLINE Found found() const noexcept {
    return on_chain || weights_.acts ? set_.guarded.found(observer_) : Found{};
  }

  /// Applies the guards after a correction. @param before dhat of the levels before it, which no
  /// prediction changes (m = 1)
  ESOKIT_INLINE void keep_guards(const Found& before, StepStatus status) noexcept {
    if (gates && weights_.acts) [[unlikely]] {
      if (weights_.freezes(set_.settling_samples)) set_weights();
      // After a restart the old dhat is meaningless.
      if (weights_.gated && !has(status, StepStatus::restarted)) {
        set_.guarded.gate(observer_, before, weights_.up, weights_.down);
      }
      if (!weights_.refused(status)) {
        set_.guarded.leak(observer_, set_.leak);
        if (weights_.counts_down()) set_weights();
      }
    }
    // With a model a refused measurement changes nothing, not even by rounding.
    if (!on_chain && weights_.refused(status)) return;
    if (set_.guarded.beyond(observer_, limit())) [[unlikely]]
      keep_bound();
  }
  ESOKIT_COLD void keep_bound() noexcept { set_.guarded.keep_bound(observer_, limit()); }

  void set_weights() noexcept { weights_.weigh(observer_.input_gain() > S(0), set_.leak > S(0)); }

  void renew_bound() noexcept {
    set_limit();
    keep_bound();
  }
  void set_limit() noexcept {
    const bool by_input = set_.unit == DisturbanceUnit::input;
    const S present = by_input ? detail::absolute(S(configured_gain() * gain_ratio_)) : S(1);
    bound_in_force_ = set_.bound * present;
    limit_ = Guards::limit(observer_, bound_in_force_);
  }

  /// The bound in the scaling of the states.
  [[nodiscard]] S limit() const noexcept {
    return varies_time ? Guards::limit(observer_, bound_in_force_) : limit_;
  }

  /// What a retune replaces.
  struct Set {
    S bound;                               ///< in the unit of the config
    S inverse_gain;                        ///< 1 / b0 of the config
    S leak;                                ///< share of dhat that is removed after each correction
    [[no_unique_address]] Guards guarded;  ///< of a model
    DisturbanceUnit unit;
    std::uint16_t release_samples;
    int settling_samples = 0;  ///< see Holding
  };

  S bound_in_force_;       ///< unit of y^(n), at the present b0; 0: none
  S limit_;                ///< the same, scaled
  S gain_ratio_ = S(1);    ///< present b0 divided by b0 of the config
  S given_ratio_ = S(1);   ///< gain_ratio when the law computed the u that comes next
  S input_factor_ = S(1);  ///< 1 / gain_ratio
  Set set_;
  detail::CorrectionWeights<S> weights_{};
};

/// Distinguishes the type in snapshots.
template <class Observer>
inline constexpr std::uint32_t type_tag<Guarded<Observer>> = make_type_tag<Observer>("Guarded");

}  // namespace esokit
