/// @file
/// HalfGainEso: LinearEso with half-gain tuning, see gain/half_gain.hpp.
#pragma once

#include <esokit/gain/half_gain.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// Settings of HalfGainEso.
template <int Size, Scalar S>
struct LinearEsoConfig<Size, S, HalfGainPoles> {
  S observer_bandwidth{};  ///< omega_o, rad/s, of the observer whose gains are halved
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};         ///< T, s
  int max_gap = 100;       ///< missing samples that a correction may bridge before it restarts

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "observer_bandwidth";
  /// What the poles are placed by.
  [[nodiscard]] const S& placement() const noexcept { return observer_bandwidth; }
  /// @cond
  static constexpr auto fields(auto& c) noexcept {
    return std::tie(c.observer_bandwidth, c.input_gain, c.sample_time, c.max_gap);
  }
  /// @endcond
};

/// Settings of ContinuousHalfGainEso.
template <int Size, PlainScalar S>
struct ContinuousLinearEsoConfig<Size, S, HalfGainPoles> {
  S observer_bandwidth{};  ///< omega_o, rad/s, of the observer whose gains are halved
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "observer_bandwidth";
  /// What the poles are placed by.
  [[nodiscard]] const S& placement() const noexcept { return observer_bandwidth; }
};

/// LinearEso with poles at exp(s_k T), s_k those of half the continuous gains: about half the noise
/// in u for about the same disturbance rejection.
/// @tparam Order n @tparam S a plain scalar or a pack @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
using HalfGainEso = LinearEso<Order, S, Extension, HalfGainPoles>;

/// The same as an ODE, with exactly half the gains.
template <int Order, PlainScalar S = double, int Extension = 1>
using ContinuousHalfGainEso = ContinuousLinearEso<Order, S, Extension, HalfGainPoles>;

}  // namespace esokit
