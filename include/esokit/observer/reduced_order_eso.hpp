/// @file
/// ReducedOrderEso: a linear ESO that takes the measurement as it is and estimates only the rest.
#pragma once

#include <esokit/gain/reduced_order.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// Reduced-order extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// N - 1 poles are at exp(-omega_o T), one at zero: less lag than LinearEso of the same omega_o,
/// and measurement noise goes through to z_1 unfiltered. After a correction z_1 equals the
/// measurement up to rounding. It is the predictor-corrector with one pole at zero, so gaps, bad
/// samples and retuning work as everywhere; it costs one multiply-add more than an observer written
/// for N - 1 states.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
using ReducedOrderEso = LinearEso<Order, S, Extension, ReducedPoles>;

}  // namespace esokit
