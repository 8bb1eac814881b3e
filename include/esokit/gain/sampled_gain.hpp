/// @file
/// Gains of the sampled predictor-corrector from the poles of its estimation error.
///
/// With w the delay operator, a constant gain gives the innovation e = (1-w)^N / prod(1 - rho_i w)
/// y. So the gain polynomial kappa(t) = sum_r k_r t^r (k_r scaled, t in samples) interpolates the
/// impulse response of prod(1 - rho_i w) / (1-w)^N at t = 1, 2, .. . Written with contractions a_i
/// = 1 - rho_i, 1 - rho_i w = a_i + rho_i (1-w), that gives
///
///     k_r = sum_{j>r} b_j c(j, r+1) / (j-1)!,   sum_j b_j s^j = prod_i (a_i s + rho_i)
///
/// (c: unsigned Stirling numbers of the first kind). For real poles in [0, 1) every term is
/// positive: nothing cancels, and each gain is accurate to a few units in the last place for any
/// omega_o T.
#pragma once

#include <cmath>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/combinatorics.hpp>
#include <esokit/model/scaled_chain.hpp>
#include <type_traits>

namespace esokit {

/// Scaled gain, k_r = T^r / r! times the gain in physical units; dimensionless.
template <int Size, Scalar S>
using ScaledGain = Array<S, Size>;

/// Coefficients b_0 .. b_N of prod_i (a_i s + rho_i).
template <int Size, Scalar S>
using PoleWeights = Array<S, Size + 1>;

namespace detail {

template <int Size, class T>
constexpr Array<Array<T, Size + 1>, Size> gain_table() noexcept {
  Array<Array<T, Size + 1>, Size> table{};
  for (int r = 0; r < Size; ++r) {
    for (int j = r + 1; j <= Size; ++j) {
      table[static_cast<std::size_t>(r)][static_cast<std::size_t>(j)] =
          static_cast<T>(unsigned_stirling_first(j, r + 1)) / static_cast<T>(factorial(j - 1));
    }
  }
  return table;
}

}  // namespace detail

/// Current-estimator gain (correction of the predicted state), scaled.
template <int Size, Scalar S>
constexpr ScaledGain<Size, S> current_gain(const PoleWeights<Size, S>& weights) noexcept {
  constexpr auto table = detail::gain_table<Size, detail::TableScalar<S>>();
  ScaledGain<Size, S> gain{};
  for (std::size_t r = 0; r < Size; ++r) {
    // Summed from the smallest term: for small omega_o T the b_j fall fast with j.
    S sum = weights[Size] * S(table[r][Size]);
    for (std::size_t j = Size - 1; j > r; --j) sum = sum + weights[j] * S(table[r][j]);
    gain[r] = sum;
  }
  return gain;
}

/// Gain of the predictor form z[k+1] = Phi z[k] + Gamma u + l (y - z_1[k]), scaled: l = Phi k.
template <int Size, Scalar S>
constexpr ScaledGain<Size, S> predictor_gain(const PoleWeights<Size, S>& weights) noexcept {
  ScaledGain<Size, S> gain = current_gain<Size, S>(weights);
  for (std::size_t pass = 0; pass + 1 < Size; ++pass) {
    for (std::size_t row = Size - 1; row-- > pass;) gain[row] = gain[row] + gain[row + 1];
  }
  return gain;
}

/// A scaled gain in physical units: r! / T^r k_r. @param sample_time T, s
/// @return N x 1, row r in 1/s^r
template <int Size, Scalar S>
Vector<S, Size> physical_gain(const ScaledGain<Size, S>& scaled, const S& sample_time) {
  return ScaledChain<Size - 1, S, 1>::physical(scaled, S(S(1.0) / sample_time));
}

/// A physical gain in scaled form, for a gain law written in physical units.
/// @param gain N x 1, row r in 1/s^r @param sample_time T, s
template <int Size, Scalar S>
ScaledGain<Size, S> scaled_gain(const Vector<S, Size>& gain, const S& sample_time) {
  return ScaledChain<Size - 1, S, 1>::scaled(gain, sample_time);
}

namespace detail {

/// A complex number without `<complex>`.
template <PlainScalar S>
struct Contraction {
  S real{};
  S imaginary{};
};

/// 1 - rho for rho = e^(x + j phi).
template <PlainScalar S>
Contraction<S> contraction(const S& x, const S& phi) noexcept {
  // 1 - e^x cos(phi) = -expm1(x) + 2 e^x sin^2(phi/2): no cancellation for small T.
  const S half_sine = std::sin(phi / 2);
  return {-std::expm1(x) + 2 * std::exp(x) * half_sine * half_sine, -std::exp(x) * std::sin(phi)};
}

}  // namespace detail

/// All N poles of the sampled error at rho = exp(-omega_o T), stored as the contraction 1 - rho.
template <int Size, Scalar S>
struct EqualSampledPoles {
  S contraction{};  ///< a = 1 - rho, in (0, 1]

  /// From the bandwidth. @param bandwidth omega_o, rad/s @param sample_time T, s
  static EqualSampledPoles from_bandwidth(const S& bandwidth, const S& sample_time) noexcept {
    using std::expm1;
    return {-expm1(-(bandwidth * sample_time))};
  }

  /// The poles for `samples` sample times in one: rho^samples. By repeated squaring, without an
  /// exponential.
  [[nodiscard]] constexpr EqualSampledPoles power(unsigned samples) const noexcept {
    S base = contraction;
    S result(0.0);
    for (; samples != 0; samples >>= 1u) {
      if ((samples & 1u) != 0) result = joined(result, base);
      base = joined(base, base);
    }
    return {result};
  }
  /// 1 - (1-a)(1-b), without cancellation.
  [[nodiscard]] static constexpr S joined(const S& a, const S& b) noexcept {
    return a + (S(1.0) - a) * b;
  }

  /// beta_0 .. beta_N of prod_i (delta + a_i) = sum_j beta_j delta^(N-j).
  [[nodiscard]] constexpr Array<S, Size + 1> symmetric() const noexcept {
    constexpr auto& row = binomial_table<Size, detail::TableScalar<S>>[Size];
    Array<S, Size + 1> beta{};
    S power(1.0);
    for (int j = 0; j <= Size; ++j) {
      beta[static_cast<std::size_t>(j)] = S(row[static_cast<std::size_t>(j)]) * power;
      power = power * contraction;
    }
    return beta;
  }

  /// b_0 .. b_N, for `current_gain`.
  [[nodiscard]] constexpr PoleWeights<Size, S> weights() const noexcept {
    const S decay = S(1.0) - contraction;
    PoleWeights<Size, S> weights = symmetric();
    S power(1.0);
    for (int j = Size; j >= 0; --j) {
      weights[static_cast<std::size_t>(j)] = weights[static_cast<std::size_t>(j)] * power;
      power = power * decay;
    }
    return weights;
  }
};

/// Gain of a correction after `samples` sample times, scaled with one sample time.
/// @param poles of the long step
template <int Size, Scalar S, class Poles>
constexpr ScaledGain<Size, S> long_step_gain(const Poles& poles, const S& samples) noexcept {
  ScaledGain<Size, S> gain = current_gain<Size, S>(poles.weights());
  const S rate = S(1.0) / samples;
  S factor(1.0);
  for (std::size_t r = 1; r < Size; ++r) {
    factor = factor * rate;
    gain[r] = gain[r] * factor;
  }
  return gain;
}

/// The same with the poles of one step: it places those of the long step at rho_i^samples.
template <int Size, Scalar S, class Poles>
constexpr ScaledGain<Size, S> gap_gain(const Poles& poles, unsigned samples) noexcept {
  return long_step_gain<Size, S>(poles.power(samples), detail::integer<S>(samples));
}

}  // namespace esokit
