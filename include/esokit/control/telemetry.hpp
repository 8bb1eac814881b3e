/// @file
/// Telemetry: the quantities to log for each sample of a loop.
#pragma once

#include <esokit/control/control_loop.hpp>
#include <esokit/core/matrix.hpp>
#include <type_traits>

namespace esokit {

/// A sample of a loop. Trivially copyable, so that it can be stored in a ring buffer or sent over a
/// link.
/// @tparam States N, number of states status of the observer
template <int States, PlainScalar S = double>
struct Telemetry {
  S time{};                            ///< s
  S u{};                               ///< output, held until the next row
  S y{};                               ///< measured
  S r{};                               ///< reference
  S requested{};                       ///< u requested by the law, before the limits
  S disturbance{};                     ///< dhat
  S innovation{};                      ///< of the last correction; 0 if not available
  S trust = 1;                         ///< trust in dhat, see Guarded
  bool bounded = false;                ///< dhat is at its bound
  StepStatus status = StepStatus::ok;  ///< of the observer
  LoopMode mode = LoopMode::running;   ///< what determines u
  Array<S, States> estimate{};         ///< (y, .., y^(n-1), d, ..)
};

/// The telemetry of the last sample of a controller (Adrc, DisturbanceCompensator).
/// @param time of the sample, s @param y, r measurement and reference of the sample
template <class Controller, PlainScalar S = typename Controller::scalar_type>
[[nodiscard]] auto telemetry(const Controller& controller, const S& time, const S& y,
                             const S& r) noexcept {
  const auto& observer = controller.observer();
  using Observer = std::remove_cvref_t<decltype(observer)>;
  Telemetry<Observer::size, S> row;
  row.time = time;
  row.u = controller.output();
  row.y = y;
  row.r = r;
  row.requested = controller.requested();
  row.disturbance = observer.total_disturbance();
  if constexpr (requires { observer.innovation(); }) row.innovation = observer.innovation();
  if constexpr (observer_traits<Observer>.gates_disturbance) row.trust = observer.trust();
  if constexpr (observer_traits<Observer>.schedules_input_gain) row.bounded = observer.bounded();
  row.status = controller.status();
  row.mode = controller.mode();
  const auto z = observer.estimate();
  for (int i = 0; i < Observer::size; ++i) row.estimate[static_cast<std::size_t>(i)] = z(i);
  return row;
}

}  // namespace esokit
