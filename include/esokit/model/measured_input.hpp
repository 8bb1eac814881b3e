/// @file
/// MeasuredInput: what a disturbance that is measured does to the plant.
#pragma once

#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit {

/// What a measured disturbance w adds to y^(n): gain w, late by a dead time and through a lag of
/// first order, gain e^(-dead_time s) / (1 + lag s) W(s).
template <Scalar S = double>
struct MeasuredInput {
  S gain{};       ///< what w = 1 adds to y^(n) in the end, unit of y^(n) per unit of w; either sign
  S lag{};        ///< time constant, s; 0: none
  S dead_time{};  ///< from w to the beginning of its effect, s; 0: none

  /// @cond
  static constexpr auto fields(auto& m) noexcept { return detail::tie(m.gain, m.lag, m.dead_time); }
  /// @endcond
};

}  // namespace esokit
