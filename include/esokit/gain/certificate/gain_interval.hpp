/// @file
/// Stable ranges of a factor k on the bandwidth gains of a linear observer: intervals for a
/// constant k, and limits between which k may vary arbitrarily.
///
/// With all poles in one place, the loop opened at k has the frequency response (c (1 - j v))^N -
/// 1, v = 0 .. infinity, with c = 1 for the continuous observer and c = (1 + exp(-omega T)) / 2 for
/// the sampled one. All closed forms here follow from it.
#pragma once

#include <cmath>
#include <esokit/core/interval.hpp>
#include <esokit/gain/certificate/switching_certificate.hpp>
#include <limits>
#include <numbers>

namespace esokit {

namespace detail {

/// cos(pi / n)^power, n >= 2, at compile time.
constexpr double cosine_power(int n, int power) noexcept {
  const double half = constexpr_sine(std::numbers::pi / (2 * n));
  const double cosine = n == 2 ? 0.0 : 1.0 - 2.0 * half * half;
  double product = 1.0;
  for (int i = 0; i < power; ++i) product *= cosine;
  return product;
}

/// c^N, c = (1 + exp(-omega T)) / 2.
template <int Size, Scalar S>
constexpr S centre_power(const EqualSampledPoles<Size, S>& poles) noexcept {
  const S centre = S(1.0) - S(0.5) * poles.contraction;
  S power(1.0);
  for (int i = 0; i < Size; ++i) power = power * centre;
  return power;
}

/// c / (c + p) with c = cos(pi/n)^n, which is 1 / (1 + p / c) also for c = 0.
template <int N, Scalar S>
constexpr S least_factor(const S& power) noexcept {
  constexpr double c = cosine_power(N, N);
  return constant<S>(c) / (constant<S>(c) + power);
}

}  // namespace detail

/// Constant k for which the continuous error polynomial s^N + k ((s + omega)^N - s^N) is stable. It
/// is k > 1 / (1 + sec(pi/N)^N), which is 0 for N = 2, without an upper limit.
template <int Size>
constexpr Interval<double> constant_gain_interval() noexcept {
  return {detail::least_factor<Size>(1.0), detail::unbounded<double>()};
}

/// The same for the sampled observer: 1 / (1 + (c / cos(pi/N))^N) < k < 1 / (1 - c^N).
template <int Size, Scalar S>
constexpr Interval<S> constant_gain_interval(const EqualSampledPoles<Size, S>& poles) noexcept {
  const S power = detail::centre_power(poles);
  // 1 - c^N from the contraction, without cancellation: 1 - (1 - b)^N = b (1 + c + .. + c^(N-1)).
  const S b = S(0.5) * poles.contraction;
  S sum(0.0);
  S term(1.0);
  for (int i = 0; i < Size; ++i) {
    sum = sum + term;
    term = term * (S(1.0) - b);
  }
  return {detail::least_factor<Size>(power), S(1.0) / (b * sum)};
}

/// Smallest k_min for which any variation of k within [k_min, 1] is certified: 1 / (1 + c^N
/// sec(pi/(N+1))^(N+1)).
template <int Size, Scalar S>
constexpr S least_certified_gain(const EqualSampledPoles<Size, S>& poles) noexcept {
  return detail::least_factor<Size + 1>(detail::centre_power(poles));
}

/// k times a gain set.
template <int Size, Scalar S>
constexpr ScaledGain<Size, S> multiplied(ScaledGain<Size, S> gain, const S& k) noexcept {
  for (S& value : gain) value = value * k;
  return gain;
}

/// True if the sampled observer is certified stable for any variation of the factor between `low`
/// and `high`.
template <int Size, Scalar S>
[[nodiscard]] bool gain_range_certified(const ScaledGain<Size, S>& gain, const S& low,
                                        const S& high) {
  return switching_certified<Size, S>(multiplied<Size, S>(gain, low),
                                      multiplied<Size, S>(gain, high));
}

/// Largest k_max in (base, ceiling) that is certified together with the limit `low`, by bisection;
/// `base` if there is none.
/// @param gain a ScaledGain, or the gain vector of a continuous observer
template <int Size, Scalar S, class Gain>
[[nodiscard]] S largest_certified_gain(const Gain& gain, const S& low, const S& base,
                                       const S& ceiling) {
  constexpr int steps = std::numeric_limits<detail::TableScalar<S>>::digits;
  S reached(0.0);
  S step(1.0);
  for (int i = 0; i <= steps; ++i) {
    const S candidate = reached + step;
    if (!(candidate > S(1.0)) &&
        gain_range_certified<Size, S>(gain, low, S(base + candidate * (ceiling - base)))) {
      reached = candidate;
    }
    step = step * S(0.5);
  }
  return base + reached * (ceiling - base);
}

}  // namespace esokit
