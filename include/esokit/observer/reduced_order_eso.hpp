/// @file
/// ReducedOrderEso: a linear ESO that takes the measurement as the estimate of y and estimates only
/// the other states.
#pragma once

#include <esokit/gain/reduced_order.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// Reduced-order extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// N - 1 poles are at exp(-omega_o T), one at zero: less lag than LinearEso with the same omega_o,
/// but measurement noise reaches z_1 unfiltered. After a correction z_1 equals the measurement up
/// to rounding. It is the predictor-corrector with one pole at zero, so gaps, bad samples and
/// retuning work as in all observers. It costs one multiply-add more than an observer written for N
/// - 1 states.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
using ReducedOrderEso = LinearEso<Order, S, Extension, ReducedPoles>;

}  // namespace esokit
