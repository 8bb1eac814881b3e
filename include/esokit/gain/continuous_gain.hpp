/// @file
/// Gains of the continuous observer with all poles of its estimation error at one place.
#pragma once

#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/combinatorics.hpp>

namespace esokit {

/// l_i = C(N, i) omega_o^i, i = 1..N: all poles of the error at -omega_o.
/// @param bandwidth omega_o, rad/s
/// @return N x 1, row i in 1/s^i
template <int Size, Scalar S>
Vector<S, Size> continuous_gain(const S& bandwidth) {
  Vector<S, Size> gain;
  S power(1.0);
  for (int i = 1; i <= Size; ++i) {
    power = power * bandwidth;
    gain(i - 1) =
        S(binomial_table<Size, detail::TableScalar<S>>[Size][static_cast<std::size_t>(i)]) * power;
  }
  return gain;
}

}  // namespace esokit
