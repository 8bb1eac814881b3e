/// @file
/// HalfGainEso: LinearEso with half-gain tuning, see gain/half_gain.hpp.
#pragma once

#include <esokit/gain/half_gain.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// LinearEso with the poles exp(s_k T), where s_k are the poles of half the continuous gains: about
/// half the noise in u with about the same disturbance rejection. `observer_bandwidth` is the
/// bandwidth before the gains are halved.
/// @tparam Order n @tparam S a plain scalar or a pack @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
using HalfGainEso = LinearEso<Order, S, Extension, HalfGainPoles>;

}  // namespace esokit
