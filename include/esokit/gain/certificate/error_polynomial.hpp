/// @file
/// Characteristic polynomials of the estimation error for given gains, in a form that allows the
/// same tests for continuous and sampled observers.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/sampled_gain.hpp>

namespace esokit {

/// q_0 .. q_N of q(s) = q_N s^N + .. + q_0.
template <int Size, Scalar S>
using ErrorPolynomial = Array<S, Size + 1>;

namespace detail {

/// g_{r,i} / 2^i: coefficients of G_r(s) = (1+s)^(r+1) A_r((1-s)/(1+s)), where A_r(w) / (1-w)^(r+1)
/// is the sum of t^r w^t over t >= 1. G_0 = 1 - s, G_{r+1} = (1 - s^2) ((r+1) G_r - s G_r').
template <int Size, class T>
constexpr Array<Array<T, Size + 1>, Size> eulerian_table() noexcept {
  constexpr auto count = static_cast<std::size_t>(Size);
  double row[count + 3] = {1.0, -1.0};
  Array<Array<T, Size + 1>, Size> table{};
  for (std::size_t r = 0; r < count; ++r) {
    double power = 1.0;
    for (std::size_t i = 0; i <= count; ++i) {
      table[r][i] = static_cast<T>(row[i] * power);
      power /= 2.0;
    }
    for (std::size_t i = 0; i < count + 1; ++i) {
      row[i] *= static_cast<double>(r) + 1.0 - static_cast<double>(i);
    }
    for (std::size_t i = count + 2; i >= 2; --i) row[i] -= row[i - 2];
  }
  return table;
}

}  // namespace detail

/// The error of a sampled observer, by the bilinear map z = (1 + s h/2) / (1 - s h/2) with h =
/// `unit`: a positive multiple of the characteristic polynomial in z. That of a continuous observer
/// is in gain/certificate/continuous_certificate.hpp.
///
/// q(s) = s^N + sum_r k_r h^-(r+1) G_r(h s/2) s^(N-1-r). The map takes the unit circle to the
/// imaginary axis, and keeps common Lyapunov matrices and differences of rank one.
/// @param gain scaled current-estimator gain
template <int Size, Scalar S>
ErrorPolynomial<Size, S> error_polynomial(const ScaledGain<Size, S>& gain, const S& unit) {
  constexpr auto table = detail::eulerian_table<Size, detail::TableScalar<S>>();
  ErrorPolynomial<Size, S> q{};
  for (S& coefficient : q) coefficient = S(0.0);
  q[Size] = S(1.0);
  const S inverse = S(1.0) / unit;
  for (std::size_t r = 0; r < Size; ++r) {
    S value = gain[r];
    for (std::size_t j = 0; j <= r; ++j) value = value * inverse;
    for (std::size_t i = 0; i <= r + 1; ++i) {
      const std::size_t power = Size - 1 - r + i;
      q[power] = q[power] + value * S(table[r][i]);
      value = value * unit;
    }
  }
  return q;
}

/// A frequency scale of a scaled gain, in units of 1/T: the harmonic mean of its poles, about omega
/// T, and at most 2 for equal poles.
template <int Size, Scalar S>
S frequency_scale(const ScaledGain<Size, S>& gain) {
  static_assert(Size >= 2);
  return S(static_cast<double>(Size * (Size - 1))) * gain[Size - 1] / gain[Size - 2];
}

/// True if every root has a negative real part (Routh's test). q_N must be positive.
template <int Size, Scalar S>
bool is_hurwitz(const ErrorPolynomial<Size, S>& q) {
  // Two rows of the Routh array at a time, beginning with every other coefficient from the highest
  // and from the second.
  constexpr auto width = static_cast<std::size_t>(Size / 2 + 1);
  std::array<S, width + 1> upper{};
  std::array<S, width + 1> lower{};
  for (std::size_t i = 0; i <= width; ++i) {
    upper[i] = 2 * i <= Size ? q[Size - 2 * i] : S(0.0);
    lower[i] = 2 * i + 1 <= Size ? q[Size - 2 * i - 1] : S(0.0);
  }
  for (int row = 0; row < Size; ++row) {
    if (!all(is_finite(lower[0])) || !all(lower[0] > S(0.0)) || !all(upper[0] > S(0.0))) {
      return false;
    }
    const S ratio = upper[0] / lower[0];
    for (std::size_t i = 0; i < width; ++i) {
      const S next = upper[i + 1] - ratio * lower[i + 1];
      upper[i] = lower[i];
      lower[i] = next;
    }
    upper[width] = S(0.0);
    lower[width] = S(0.0);
  }
  return true;
}

}  // namespace esokit
