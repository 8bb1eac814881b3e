/// @file
/// ReducedOrderEso: a linear ESO that takes the measurement as it is and estimates only the rest.
#pragma once

#include <esokit/gain/reduced_order.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// Settings of ReducedOrderEso.
template <int Size, Scalar S>
struct LinearEsoConfig<Size, S, ReducedPoles> {
  S observer_bandwidth{};  ///< omega_o, rad/s: N - 1 poles at exp(-omega_o T), one at zero
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

/// Reduced-order extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// Less lag than LinearEso of the same omega_o (N - 1 poles instead of N), and measurement noise
/// goes through to z_1 unfiltered. After a correction z_1 is the measurement but for rounding. It
/// is the predictor-corrector with one pole at zero, so gaps, bad samples and retuning work as
/// everywhere; it spends a multiply-add more than an observer written for N - 1 states would.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
using ReducedOrderEso = LinearEso<Order, S, Extension, ReducedPoles>;

}  // namespace esokit
