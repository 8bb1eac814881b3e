/// @file
/// DisturbanceCompensator: adds disturbance rejection to an existing controller.
#pragma once

#include <esokit/control/control_loop.hpp>
#include <esokit/control/controller.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <limits>

namespace esokit {

/// Config of DisturbanceCompensator.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct DisturbanceCompensatorConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<DisturbanceCompensatorConfig>
      by_name{};                         ///< nothing to set, see ByName
  typename Observer::Config observer{};  ///< includes b0 and T
  std::optional<S> compensation_gain{};  ///< K, unit of u per unit of y^(n); left out: -1/b0
  Limits<S> limits{};                    ///< of the actuator
  StartHold<S> start_hold{};             ///< u at the start, while the observer converges
  MissingRule<S> missing{};              ///< what to do when measurements are missing
  int measurement_divider = 1;           ///< D: a measurement is due at every D-th update
};

/// u = u0 + K dhat, with u0 from any controller (a PID, say) and K = -1/b0. That controller then
/// sees a plant that is nearly y^(n) = b0 u0. Limits, start, missing measurements and retuning work
/// as in Adrc.
///
/// With an actuator in the observer's model its lag is removed as well. With a lag of first order
/// the controller sees y^(n+1) = b0 / tau u0 and has to be designed for that plant (a PD instead of
/// a P).
///
/// If the disturbance does not enter where u does (mismatched), apply the observer to the equation
/// in which it enters. Pass the quantity that drives this equation (another state instead of u) to
/// `update_driven`, and choose the gain K from dhat to u. For example K = -(C A^-1 B)^-1 C A^-1
/// B_d, with A, B, C and B_d (input of the disturbance) of the loop closed by u0, removes the
/// disturbance from y in the steady state.
///
/// An integrator in the wrapped controller is no longer needed. If it already compensates for the
/// disturbance, call `start(y, u)` and set the controller's output to `base_output()`: u then
/// continues without a bump. Pass `output() - compensation()` to the controller's anti-windup as
/// the applied u0.
///
/// If y is lost, dhat is no longer known, and the wrapped controller mostly reads the same sensor:
/// so u goes to `missing.input`, by default to zero, whatever u0 is. If u0 does not depend on this
/// sensor, put it out yourself in that mode, and say so by `track`. A u0 that is not finite is
/// reported as `reference_rejected`, and u is kept.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) class DisturbanceCompensator {
 public:
  static constexpr int order = Observer::order;        ///< n, order of the plant
  using scalar_type = typename Observer::scalar_type;  ///< type of signals and settings
  using S = scalar_type;                               ///< the same type

  /// What the compensator can do beyond `update(y, base_output)`.
  static constexpr ControllerTraits traits{
      .knows_sample_time = true,
      .varies_time = observer_traits<Observer>.varies_time,
      .takes_measured = observer_traits<Observer>.takes_measured,
      .observes = true};

  using Config = DisturbanceCompensatorConfig<Observer>;  ///< settings of make

  /// The same with another scalar.
  template <class T>
  requires LoopObserver<detail::WithScalar<Observer, T>>
  using with_scalar = DisturbanceCompensator<detail::WithScalar<Observer, T>>;

  /// Checks the settings and does all the design work.
  /// @return the compensator, or an error that names the field
  static Expected<DisturbanceCompensator, Error<S>> make(const Config& config) {
    static_assert(detail::refuses_packs<S>());
    const auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    const S input_gain = observer->input_gain();
    S gain = S(-1) / input_gain;
    if (config.compensation_gain) {
      gain = *config.compensation_gain;
      if (Rules<S> rules; !rules.finite("compensation_gain", gain)) return rules.error();
    } else if (!is_finite(gain)) {
      return Error<S>{"input_gain", input_gain, "has an inverse that the scalar cannot hold"};
    }
    const auto loop = Loop::make(
        *observer, {config.limits, config.start_hold, config.missing, config.measurement_divider});
    if (!loop) return loop.error();
    return DisturbanceCompensator(*loop, gain);
  }

  /// One sample. @param y measurement, NaN if missing @param base_output u0 of the wrapped
  /// controller @return u to be held until the next sample, within the limits
  S update(S y, S base_output) noexcept { return loop_.step(y, loop_.held(), asked(base_output)); }

  /// What the actuator held since the last sample, if it was not the last output: say it before
  /// `update`. @return ok, or input_rejected for a u that is not finite, which changes nothing @{
  StatusOf<S> applied(S u) noexcept { return loop_.applied(u); }
  S update(S y, S base_output, S u) = delete;  // call applied(u) before update
  /// @}

  /// The same if something other than u drives the observer's equation. Use it from `make` on,
  /// without `start` and `track`, which assume that u is the drive. Pass NaN if the measurement is
  /// missing.
  /// @param drive what drove the equation since the last sample in place of u, in units of y^(n) /
  /// b0
  template <class O = Observer>
  requires(!observer_traits<O>.maps_input) S update_driven(S y, S base_output, S drive)
  noexcept { return loop_.step(y, drive, asked(base_output)); }

  /// w[k], before the sample in which it is first used; for an observer that is Measured.
  /// @param w a number, or a vector of several; NaN: lost
  template <class W, class O = Observer>
  requires(observer_traits<O>.takes_measured) void measured(const W& w) noexcept {
    observer().measured(w);
  }

  /// One sample whose measurement is missing.
  S update_without_measurement(S base_output) noexcept {
    return loop_.step_without_measurement(asked(base_output));
  }

  /// Without compensation: the observer runs while u comes from elsewhere.
  /// @param u_applied what the actuator held since the last sample @return the same
  S track(S y, S u_applied) noexcept { return loop_.track(y, u_applied); }

  /// For a plant that is held by something else: the observer follows y, dhat is kept; see Guarded.
  /// @param u_applied what the actuator held since the last sample @return the same
  template <class O = Observer>
  requires(observer_traits<O>.gates_disturbance) S hold(S y, S u_applied)
  noexcept { return loop_.hold(y, u_applied); }

  /// Sets b0 before the next sample. @return as for Guarded::set_input_gain
  template <class O = Observer>
  requires(observer_traits<O>.schedules_input_gain) Check<S> set_input_gain(const S& b)
  noexcept { return observer().set_input_gain(b); }

  /// Takes over a plant at rest at y under u: dhat = -b0 u.
  /// @return ok, or input_rejected or state_rejected if u or y is not finite: nothing changes then
  StatusOf<S> start(S y, S u) noexcept { return loop_.start(y, u); }

  /// New settings while running. A refused config changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`: without design work, so it may
  /// run in an interrupt.
  Check<S> adopt(const DisturbanceCompensator& fresh) {
    if (auto ok = loop_.adopt(fresh.loop_); !ok) return ok;
    gain_ = fresh.gain_;
    return {};
  }

  /// Says how much time has passed, or sets the length of the next steps, s; see Adrc.
  /// @{
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> elapsed(const S& seconds)
  noexcept { return loop_.elapsed(seconds); }
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> set_step_time(const S& seconds)
  noexcept { return loop_.set_step_time(seconds); }
  /// @}

  /// K dhat, which is added to u0; limited to the range of the scalar.
  [[nodiscard]] S compensation() const noexcept {
    return detail::clipped(unbounded_compensation());
  }

  /// The u0 with which u would not change; limited to the range of the scalar.
  [[nodiscard]] S base_output() const noexcept {
    return detail::clipped(S(detail::effect_of(observer(), loop_.output()) - compensation()));
  }

  /// The observer, for its estimates.
  [[nodiscard]] const Observer& observer() const noexcept { return loop_.observer(); }
  /// The observer, for its own members (AlgebraicEso::rearm).
  [[nodiscard]] Observer& observer() noexcept { return loop_.observer(); }
  /// K, unit of u per unit of y^(n).
  [[nodiscard]] const S& compensation_gain() const noexcept { return gain_; }
  /// D: a measurement is due at every D-th update.
  [[nodiscard]] Lanes<int, S> measurement_divider() const noexcept {
    return loop_.measurement_divider();
  }
  /// T, s.
  [[nodiscard]] S sample_time() const noexcept { return loop_.observer().sample_time(); }
  /// The present u, within the limits, whatever is reported as applied.
  [[nodiscard]] S output() const noexcept { return loop_.output(); }
  /// u0 + K dhat before the limits.
  [[nodiscard]] const S& requested() const noexcept { return loop_.requested(); }
  /// The limits of u.
  [[nodiscard]] const Limiter<S>& limiter() const noexcept { return loop_.limiter(); }
  /// Status of the observer at the last sample.
  [[nodiscard]] StatusOf<S> status() const noexcept { return loop_.status(); }
  /// Whether u is determined by u0 + K dhat, the start hold or the rule for missing measurements.
  [[nodiscard]] Lanes<LoopMode, S> mode() const noexcept { return loop_.mode(); }
  /// Whether too little time has passed for a sample, see `elapsed`: `update` changes nothing.
  [[nodiscard]] bool too_soon() const noexcept { return loop_.too_soon(); }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr int data_members = 2;
  static constexpr bool advances = detail::LaneAccess::advances<Observer>;

  using Loop = ControlLoop<Observer>;

  /// For packs, see ControlLoop.
  /// @{
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) ESOKIT_INLINE bool advance() noexcept {
    return loop_.advance();
  }
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) ESOKIT_INLINE
      bool step(S& u, const S& y, const S& base_output) noexcept {
    return loop_.step_all(u, y, asked(base_output));
  }
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) S update_advanced(const S& y, const S& base_output)
  noexcept { return loop_.template step<true>(y, loop_.held(), asked(base_output)); }
  /// @}

  DisturbanceCompensator(const Loop& loop, S gain) noexcept : loop_(loop), gain_(gain) {}

  /// For a step, which tests the sum with u0 anyway.
  [[nodiscard]] ESOKIT_INLINE S unbounded_compensation() const noexcept {
    return detail::by_present_gain(loop_.observer(),
                                   S(gain_ * loop_.observer().total_disturbance()));
  }

  [[nodiscard]] ESOKIT_INLINE S command(S base_output) const noexcept {
    return base_output + unbounded_compensation();
  }
  ESOKIT_INLINE auto asked(S base_output) const noexcept {
    return detail::Asked{[this, base_output](bool)
                             ESOKIT_INLINE_LAMBDA { return command(base_output); },
                         [base_output] { return all(is_finite(base_output)); }};
  }

  Loop loop_;
  S gain_;
};

/// Distinguishes the type in snapshots.
template <class Observer>
inline constexpr std::uint32_t type_tag<DisturbanceCompensator<Observer>> =
    make_type_tag<Observer>("DisturbanceCompensator");

}  // namespace esokit
