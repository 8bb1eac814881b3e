/// @file
/// How much corrections of the disturbance count: trust, pin, hold, and the time after a hold.
#pragma once

#include <cstdint>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/core/step_status.hpp>

namespace esokit {

/// The limit at which an actuator with unknown output is saturated.
enum class Pin : unsigned char {
  free,    ///< at none: the actuator outputs the u given to the observer
  upper,   ///< at its upper limit: a larger u has no effect
  lower,   ///< at its lower limit: a smaller u has no effect
  either,  ///< at the limit given by the sign of the last u
};

namespace detail {

/// What the caller said of the present corrections, and the factors that follow, see Guarded. After
/// a change of it `weigh` has to be called.
template <PlainScalar S>
struct CorrectionWeights {
  S trust = S(1);
  S up = S(1);    ///< factor on corrections that raise dhat
  S down = S(1);  ///< factor on corrections that lower dhat
  Pin pin = Pin::free;
  signed char side = 0;  ///< limit at which the actuator is pinned: 1 upper, -1 lower, 0 unknown
  bool held = false;
  bool unsettled = false;  ///< held, but no measurement has shown where since
  bool gated = false;
  bool frozen = false;  ///< no correction of dhat counts until the observer has settled
  bool acts = false;    ///< any of these, or a leak: one test in the hot path
  std::uint16_t release_left = 0;
  int settling_left = 0;  ///< since the last sample held, see Holding

  /// Whether there was no correction.
  [[nodiscard]] static constexpr bool refused(StepStatus status) noexcept {
    return has(status, StepStatus::measurement_rejected | StepStatus::outlier_rejected);
  }

  /// @param positive the sign of b0 @param leaks whether dhat leaks
  ESOKIT_COLD void weigh(bool positive, bool leaks) noexcept {
    const bool one_sided = pin != Pin::free || release_left > 0;
    const int freeing = positive ? side : -side;
    const bool none = held || frozen;
    up = none || (one_sided && freeing <= 0) ? S(0) : trust;
    down = none || (one_sided && freeing >= 0) ? S(0) : trust;
    gated = none || one_sided || trust < S(1);
    acts = gated || unsettled || settling_left > 0 || leaks;
  }

  /// @param u the last one @param release_samples of the end of a pin
  void set_pin(Pin where, const S& u, std::uint16_t release_samples) noexcept {
    if (where == Pin::either) {
      side = u > S(0) ? 1 : u < S(0) ? -1 : 0;
    } else if (where != Pin::free) {
      side = where == Pin::upper ? 1 : -1;
    }
    if (where != Pin::free) {
      release_left = 0;
    } else if (pin != Pin::free) {
      release_left = release_samples;
    }
    pin = where;
  }

  /// The plant stood until now. @param settling_samples until the observer has settled
  constexpr void stand_for(int settling_samples) noexcept {
    settling_left = settling_samples;
    frozen = unsettled = false;
  }

  /// True if the next correction is the first that is scaled before the observer has settled:
  /// then none counts until it has.
  bool freezes(int settling_samples) noexcept {
    if (settling_left == 0 || !gated || held || frozen) return false;
    frozen = true;
    settling_left = settling_samples;
    return true;
  }

  /// Counts a measurement. @return true if the time after a pin or a hold is over
  bool counts_down() noexcept {
    const bool released = release_left > 0 && --release_left == 0;
    const bool settled = settling_left > 0 && --settling_left == 0;
    if (settled) frozen = false;
    return released || settled;
  }
};

}  // namespace detail
}  // namespace esokit
