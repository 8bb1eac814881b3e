/// @file
/// HalfGainEso: LinearEso with half-gain tuning, see gain/half_gain.hpp.
#pragma once

#include <esokit/gain/half_gain.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// LinearEso with poles at exp(s_k T), s_k those of half the continuous gains: about half the noise
/// in u for about the same disturbance rejection. `observer_bandwidth` is that of the observer
/// whose gains are halved.
/// @tparam Order n @tparam S a plain scalar or a pack @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
using HalfGainEso = LinearEso<Order, S, Extension, HalfGainPoles>;

/// The same as an ODE, with exactly half the gains.
template <int Order, PlainScalar S = double, int Extension = 1>
using ContinuousHalfGainEso = ContinuousLinearEso<Order, S, Extension, HalfGainPoles>;

}  // namespace esokit
