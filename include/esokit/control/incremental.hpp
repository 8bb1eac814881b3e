/// @file
/// Incremental: a controller whose output is the change of u, for actuators that integrate.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/gain/step_status.hpp>
#include <limits>

namespace esokit {

/// Returns u[k] - u[k-1] of a controller: for stepper valves, motorised potentiometers and PLC
/// blocks that take increments.
///
/// The sum of the increments is u up to a constant, which need not be known, because the observer
/// takes it as a disturbance. The limits apply to the sum (counted from `start`), the rate limit to
/// each increment. If the actuator reports how much of the last increment it carried out, nothing
/// winds up. Because an increment is the difference of two u, limits beyond half the largest number
/// of the scalar (or left out) count as this half, and a report that exceeds it is ignored.
/// @tparam Controller a controller such as Adrc
template <class Controller>
class Incremental {
 public:
  using scalar_type = typename Controller::scalar_type;  ///< type of signals and settings
  using S = scalar_type;                                 ///< the same type
  using Config = typename Controller::Config;            ///< settings of make
  using Status = StatusOf<S>;                            ///< StepStatus, for a pack one per lane
  template <class T>
  using with_scalar = Incremental<detail::WithScalar<Controller, T>>;  ///< with another scalar

  /// Same as Controller::make.
  static Expected<Incremental, Error<S>> make(const Config& config) {
    auto controller = Controller::make(halved(config));
    if (!controller) return controller.error();
    return Incremental(*controller);
  }

  /// One sample. @param y measurement @param reference as the controller's `update` takes it
  /// @return the change of u to be carried out now
  template <class Reference>
  S update(const S& y, const Reference& reference) noexcept {
    const S before = controller_.output();
    increment_ = controller_.update(y, reference) - before;
    return increment_;
  }

  /// The same if the actuator reports what it carried out.
  /// @param increment_applied how much of the last increment the actuator carried out
  template <class Reference>
  S update(const S& y, const Reference& reference, const S& increment_applied) noexcept {
    const S missed = increment_applied - increment_;
    const S reported = controller_.output() + missed;
    const auto good = is_finite(reported) && within_half(reported);
    const S before = select(good, reported, S(controller_.output()));
    increment_ = controller_.update(y, reference, before) - before;
    return increment_;
  }

  /// The same with a list, if the controller takes one: `update(y, {r, r1, r2})`. @{
  template <std::size_t Count>
  S update(const S& y, const S (&reference)[Count]) noexcept {
    return update<S[Count]>(y, reference);
  }
  template <std::size_t Count>
  S update(const S& y, const S (&reference)[Count], const S& increment_applied) noexcept {
    return update<S[Count]>(y, reference, increment_applied);
  }
  /// @}

  /// Takes over a plant at rest at y; the sum of increments starts at `u`, zero if unknown.
  /// @return as for Controller::start; input_rejected for a u beyond half the largest number of the
  /// scalar
  Status start(const S& y, const S& u = S(0.0)) noexcept {
    const auto good = is_finite(u) && within_half(u);
    if constexpr (PackScalar<S>) {
      // With NaN as u the controller reports the error and changes nothing.
      const S none(std::numeric_limits<LaneScalar<S>>::quiet_NaN());
      Status status = controller_.start(y, select(good, u, none));
      for (int i = 0; i < lane_count<S>; ++i) {
        if (!good[i]) status[i] = StepStatus::input_rejected;
        if (status[i] == StepStatus::ok) increment_[i] = 0;
      }
      return status;
    } else {
      if (!good) return StepStatus::input_rejected;
      const StepStatus status = controller_.start(y, u);
      if (status == StepStatus::ok) increment_ = S(0.0);
      return status;
    }
  }

  /// Same as Controller::retune.
  Check<S> retune(const Config& config) { return controller_.retune(halved(config)); }

  /// The controller, whose output is the sum of the increments.
  [[nodiscard]] const Controller& controller() const noexcept { return controller_; }

 private:
  friend struct detail::LaneAccess;
  static constexpr auto fields(auto& o) noexcept {
    return detail::tie(o.controller_, o.increment_);
  }

  static S half() noexcept { return S((std::numeric_limits<LaneScalar<S>>::max)() / 2); }

  static auto within_half(const S& u) noexcept { return !(u < -half()) && !(u > half()); }

  static Config halved(Config config) {
    auto& limits = config.limits;
    limits.lower =
        select(is_finite(limits.lower) && limits.lower < -half(), S(-half()), limits.lower);
    limits.upper = select(is_finite(limits.upper) && limits.upper > half(), half(), limits.upper);
    return config;
  }

  explicit Incremental(const Controller& controller) noexcept : controller_(controller) {}

  Controller controller_;
  S increment_ = S(0.0);
};

/// Distinguishes the type in snapshots.
template <class Controller>
inline constexpr std::uint32_t type_tag<Incremental<Controller>> =
    make_type_tag<Controller>("Incremental");

}  // namespace esokit
