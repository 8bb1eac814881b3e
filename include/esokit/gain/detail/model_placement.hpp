/// @file
/// Pole placement of the estimation error for any sampled model, in a form that loses no digits.
///
/// It applies Ackermann's formula to F = (Phi - I) / a with state r in units of a^degree(r), where
/// a is the largest distance of a pole from z = 1. In these units F and the gains of a chain do not
/// depend on a, up to terms of order a, and the formula is accurate. In the original states its
/// terms differ by a^N, and with N = 7 and omega_o T = 1e-3 no digit is left.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/half_gain.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/model/detail/observable_part.hpp>

namespace esokit {

/// Poles z_i of a sampled error as factors of its polynomial in x = (z - 1) / a: pairs x^2 + sum x
/// + product, and x + last if N is odd.
template <int Size, Scalar S>
struct PoleFactors {
  S unit{};                          ///< a, the largest of all abs(z_i - 1)
  S decay{};                         ///< -ln of the largest abs(z_i)
  Array<S, Size / 2 + 1> sum{};      ///< sum of each pair; unused elements are zero
  Array<S, Size / 2 + 1> product{};  ///< product of each pair
  S last{};                          ///< for odd N the remaining pole
};

namespace detail {

/// -ln(1 - a) for a from 0 to 1; at a = 1 a large number.
template <Scalar S>
S decay_of(const S& contraction) {
  using std::log;
  const S left = S(1.0) - contraction;
  return left > smallest_normal<S>() ? S(-log(left)) : S(1e3);
}

}  // namespace detail

/// All poles at 1 - a.
template <int Size, Scalar S>
PoleFactors<Size, S> pole_factors(const EqualSampledPoles<Size, S>& poles) noexcept {
  PoleFactors<Size, S> factors;
  factors.unit = poles.contraction;
  factors.decay = detail::decay_of(poles.contraction);
  factors.sum.fill(S(2.0));
  factors.product.fill(S(1.0));
  factors.last = S(1.0);
  return factors;
}

/// Adds pairs of conjugate poles to `factors`.
/// @param pairs 1 - rho of one of each pair
template <int Size, std::size_t Count, PlainScalar S>
PoleFactors<Size + 2 * static_cast<int>(Count), S> with_pairs(
    const PoleFactors<Size, S>& factors, const std::array<detail::Contraction<S>, Count>& pairs) {
  PoleFactors<Size + 2 * static_cast<int>(Count), S> all;
  all.unit = factors.unit;
  all.decay = factors.decay;
  for (const auto& a : pairs) all.unit = (std::max)(all.unit, std::hypot(a.real, a.imaginary));
  const S shrink = factors.unit / all.unit;
  for (std::size_t i = 0; i < Size / 2; ++i) {
    all.sum[i] = factors.sum[i] * shrink;
    all.product[i] = factors.product[i] * shrink * shrink;
  }
  all.last = factors.last * shrink;
  for (std::size_t i = 0; i < Count; ++i) {
    const S real = pairs[i].real / all.unit;
    const S imaginary = pairs[i].imaginary / all.unit;
    all.sum[Size / 2 + i] = real + real;
    all.product[Size / 2 + i] = real * real + imaginary * imaginary;
    // abs(rho)^2 = 1 - (2 Re a - abs(a)^2).
    const S lost = pairs[i].real * (S(2) - pairs[i].real) - pairs[i].imaginary * pairs[i].imaginary;
    all.decay = (std::min)(all.decay, detail::decay_of(lost) / S(2));
  }
  return all;
}

/// Factors of conjugate pairs, with a real pole if N is odd.
template <int Size, PlainScalar S>
PoleFactors<Size, S> pole_factors(const SampledPolePairs<Size, S>& poles) noexcept {
  PoleFactors<Size % 2, S> real;
  real.unit = S(0);
  real.decay = S(1e3);
  if constexpr (Size % 2 != 0) {
    real.unit = poles.pairs[Size / 2].real;
    real.decay = detail::decay_of(real.unit);
    real.last = S(1);
  }
  Array<detail::Contraction<S>, Size / 2> pairs{};
  for (std::size_t i = 0; i < Size / 2; ++i) pairs[i] = poles.pairs[i];
  return with_pairs(real, pairs);
}

namespace detail {

/// a^degree of each state.
template <int Size, Scalar S>
Array<S, Size> degree_units(const Array<int, Size>& degrees, const S& a) noexcept {
  Array<S, Size> units{};
  for (std::size_t i = 0; i < Size; ++i) {
    S power(1.0);
    for (int k = 0; k < degrees[i]; ++k) power = power * a;
    units[i] = power;
  }
  return units;
}

/// C (I + A).
template <int Size, Scalar S>
Array<S, Size> output_ahead(const Array<S, Size>& output, const Matrix<S, Size, Size>& a) noexcept {
  Array<S, Size> ahead = output;
  for (int j = 0; j < Size; ++j) {
    S& sum = ahead[static_cast<std::size_t>(j)];
    for (int i = 0; i < Size; ++i) sum = sum + output[static_cast<std::size_t>(i)] * a(i, j);
  }
  return ahead;
}

}  // namespace detail

/// The gain k of the correction z = z- + k (y - C z-), scaled, that gives (I - k C) Phi the poles
/// `poles`.
/// @param step Phi - I @param output C @param degrees power of T in the scaling of each state
/// @param poles poles to be placed
/// @return the gain; not finite if the model is not observable
template <int Size, Scalar S>
ScaledGain<Size, S> placed_gain(const Matrix<S, Size, Size>& step, const Array<S, Size>& output,
                                const Array<int, Size>& degrees,
                                const PoleFactors<Size, S>& poles) noexcept {
  using Square = Matrix<S, Size, Size>;
  const S& a = poles.unit;
  const auto unit = detail::degree_units<Size>(degrees, a);
  Square f = step;
  for (int i = 0; i < Size; ++i) {
    for (int j = 0; j < Size; ++j) {
      // In this order no intermediate result overflows.
      f(i, j) = f(i, j) / a * unit[static_cast<std::size_t>(j)] / unit[static_cast<std::size_t>(i)];
    }
  }
  // The rows C Phi F^i, i = 0 .. N - 1, and the vector that they map to (0, .., 0, 1).
  Square seen;
  RowVector<S, Size> row;
  for (int j = 0; j < Size; ++j) {
    row(j) = output[static_cast<std::size_t>(j)] * unit[static_cast<std::size_t>(j)];
  }
  row += row * f * a;
  auto x = Vector<S, Size>::Zero();
  for (int i = 0; i < Size; ++i) {
    if (i > 0) row = row * f;
    const S largest = detail::largest_magnitude(row);
    detail::set_block(seen, i, 0, row / largest);
    x(Size - 1) = S(1.0) / largest;
  }
  x = detail::solved(seen, x);
  // The polynomial of F times x, factor by factor.
  for (std::size_t pair = 0; pair < Size / 2; ++pair) {
    const auto once = f * x;
    x = f * once + once * poles.sum[pair] + x * poles.product[pair];
  }
  if constexpr (Size % 2 != 0) x = f * x + x * poles.last;
  ScaledGain<Size, S> gain{};
  for (std::size_t i = 0; i < Size; ++i) gain[i] = x(static_cast<int>(i)) * unit[i] * a;
  return gain;
}

}  // namespace esokit
