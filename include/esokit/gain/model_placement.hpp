/// @file
/// Poles of the estimation error placed for any sampled model, in a form that keeps its digits.
///
/// With F = (Phi - I) / a, the states taken in units of a^degree, a the distance of the poles from
/// z = 1: of a chain whose poles all lie within a, F is the same matrix for every a but for terms
/// of order a, and so are the gains. Ackermann's formula is harmless there; in the plain states its
/// terms differ by a^N (N = 7, omega_o T = 1e-3: no digit is left).
#pragma once

#include <cmath>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/linear_equations.hpp>

namespace esokit {

/// Poles z_i of a sampled error as factors of its polynomial in x = (z - 1) / a: pairs
/// x^2 + sum x + product, and x + last where N is odd.
template <int Size, Scalar S>
struct PoleFactors {
  S unit{};                          ///< a, the largest of all abs(z_i - 1)
  Array<S, Size / 2 + 1> sum{};      ///< of the pairs; what is not used is zero
  Array<S, Size / 2 + 1> product{};  ///< of the pairs
  S last{};                          ///< of the one left
};

/// All poles at 1 - a.
template <int Size, Scalar S>
PoleFactors<Size, S> pole_factors(const EqualSampledPoles<Size, S>& poles) noexcept {
  PoleFactors<Size, S> factors;
  factors.unit = poles.contraction;
  factors.sum.fill(S(2.0));
  factors.product.fill(S(1.0));
  factors.last = S(1.0);
  return factors;
}

namespace detail {

/// a^degree of each state.
template <int Size, class Model, Scalar S>
Array<S, Size> degree_units(const Model& model, const S& a) noexcept {
  Array<S, Size> units{};
  for (int i = 0; i < Size; ++i) {
    S power(1.0);
    for (int k = 0; k < model.degree(i); ++k) power = power * a;
    units[static_cast<std::size_t>(i)] = power;
  }
  return units;
}

}  // namespace detail

/// The gain k of the correction z = z- + k (y - z-_1), scaled, that puts the poles of
/// (I - k C) Phi there.
/// @param model for Phi @param poles wanted
/// @return not finite where y does not tell all states
template <class Model, int Size, Scalar S>
ScaledGain<Size, S> placed_gain(const Model& model, const PoleFactors<Size, S>& poles) noexcept {
  using Square = Matrix<S, Size, Size>;
  const S& a = poles.unit;
  const auto unit = detail::degree_units<Size>(model, a);
  Square f = model.increment();
  for (int i = 0; i < Size; ++i) {
    for (int j = 0; j < Size; ++j) {
      // In this order nothing overflows on the way.
      f(i, j) = f(i, j) / a * unit[static_cast<std::size_t>(j)] / unit[static_cast<std::size_t>(i)];
    }
  }
  // C Phi F^i, i = 0 .. N - 1, and the vector that it takes to (0, .., 0, 1).
  Square seen;
  for (int j = 0; j < Size; ++j) seen(0, j) = S(j == 0 ? 1.0 : 0.0) + a * f(0, j);
  for (int i = 1; i < Size; ++i) {
    for (int j = 0; j < Size; ++j) {
      S sum(0.0);
      for (int k = 0; k < Size; ++k) sum = sum + seen(i - 1, k) * f(k, j);
      seen(i, j) = sum;
    }
  }
  Array<S, Size> x{};
  x.fill(S(0.0));
  for (int i = 0; i < Size; ++i) {
    S largest(0.0);
    for (int j = 0; j < Size; ++j) {
      const S size = detail::absolute(seen(i, j));
      largest = select(largest < size, size, largest);
    }
    for (int j = 0; j < Size; ++j) seen(i, j) = seen(i, j) / largest;
    if (i == Size - 1) x[Size - 1] = S(1.0) / largest;
  }
  detail::solve_in_place(detail::DenseView<S>{seen.data(), Size},
                         detail::DenseView<S>{x.data(), Size, 1});
  // The polynomial of F times x, factor by factor.
  const auto times_f = [&](const Array<S, Size>& v) {
    Array<S, Size> result{};
    for (int i = 0; i < Size; ++i) {
      S sum(0.0);
      for (int j = 0; j < Size; ++j) sum = sum + f(i, j) * v[static_cast<std::size_t>(j)];
      result[static_cast<std::size_t>(i)] = sum;
    }
    return result;
  };
  for (std::size_t pair = 0; pair < Size / 2; ++pair) {
    const auto once = times_f(x);
    const auto twice = times_f(once);
    for (std::size_t i = 0; i < Size; ++i) {
      x[i] = twice[i] + poles.sum[pair] * once[i] + poles.product[pair] * x[i];
    }
  }
  if constexpr (Size % 2 != 0) {
    const auto once = times_f(x);
    for (std::size_t i = 0; i < Size; ++i) x[i] = once[i] + poles.last * x[i];
  }
  ScaledGain<Size, S> gain{};
  for (std::size_t i = 0; i < Size; ++i) gain[i] = x[i] * unit[i] * a;
  return gain;
}

}  // namespace esokit
