/// @file
/// Sets an observer to the steady state of its plant, in which controllers start and restart.
#pragma once

#include <esokit/observer/concepts.hpp>

namespace esokit::detail {

/// Sets the observer to the steady state at y, as if u had been applied for a long time.
/// @return ok, or state_rejected if something is not finite: nothing changes then
template <class Observer, class S>
auto start_at_rest(Observer& observer, const S& y, const S& u) noexcept {
  Observer next = observer;
  if constexpr (observer_traits<Observer>.delays_input) next.fill_input(u);
  // Stores the input, which `revise_input` and a change of b0 need.
  (void)next.predict(u);
  if constexpr (observer_traits<Observer>.takes_measured) next.settle_measured();
  const auto status = next.reset(next.equilibrium(y, u));
  if (status == StepStatus::ok) observer = next;
  return status;
}

}  // namespace esokit::detail
