/// @file
/// What the stability certificates (gain/certificate/switching_certificate.hpp,
/// gain/certificate/gain_interval.hpp) need of a continuous observer.
#pragma once

#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/certificate/gain_interval.hpp>

namespace esokit {

/// s^N + l_1 s^(N-1) + .. + l_N with s in units of `unit` (1/s), so that the q_i are near one.
/// @param gain N x 1, row i in 1/s^(i+1)
template <int Size, Scalar S>
ErrorPolynomial<Size, S> error_polynomial(const Vector<S, Size>& gain, const S& unit) {
  ErrorPolynomial<Size, S> q{};
  q[Size] = S(1.0);
  const S inverse = S(1.0) / unit;
  for (int i = 1; i <= Size; ++i) {
    S value = gain(i - 1);
    for (int j = 0; j < i; ++j) value = value * inverse;
    q[static_cast<std::size_t>(Size - i)] = value;
  }
  return q;
}

/// A frequency scale of a gain set, 1/s: the harmonic mean of its poles; equal to their magnitude
/// if all are equal.
template <int Size, Scalar S>
S frequency_scale(const Vector<S, Size>& gain) {
  static_assert(Size >= 2);
  return S(static_cast<double>(Size)) * gain(Size - 1) / gain(Size - 2);
}

/// True if the errors of two gain sets of a continuous observer share a quadratic Lyapunov
/// function: then every l(t) on the segment between them is stable, however it varies.
/// @param first, second l, N x 1, row i in 1/s^(i+1)
template <int Size, Scalar S>
[[nodiscard]] bool switching_certified(const Vector<S, Size>& first,
                                       const Vector<S, Size>& second) {
  return detail::certified_pair<Size, S>(first, second);
}

/// True if the continuous observer is certified stable for any variation of the factor between
/// `low` and `high`. @param gain l
template <int Size, Scalar S>
[[nodiscard]] bool gain_range_certified(const Vector<S, Size>& gain, const S& low, const S& high) {
  const Vector<S, Size> first = gain * low, second = gain * high;
  return switching_certified<Size, S>(first, second);
}

/// Smallest k_min for which any variation of k within [k_min, 1] is certified for the continuous
/// observer.
template <int Size>
constexpr double least_certified_gain() noexcept {
  return detail::least_factor<Size + 1>(1.0);
}

/// (N-1) / (2N): with a k_min of at least this, every k_max is certified for the continuous
/// observer.
template <int Size>
constexpr double unbounded_certified_gain() noexcept {
  return (Size - 1.0) / (2.0 * Size);
}

}  // namespace esokit
