/// @file
/// Feedback gains k_0 .. k_(n-1) of ADRC: poles of a chain of n integrators under
/// v = sum_i k_i (r^(i) - y^(i)), in continuous time or exactly for a held input.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/half_gain.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/combinatorics.hpp>

namespace esokit {

/// The domain in which controller poles are placed.
enum class TimeDomain : unsigned char {
  continuous,  ///< poles of the continuous loop at -omega_c, as in most of the literature
  sampled      ///< poles at exp(-omega_c T) for a held input; exact for any omega_c T
};

/// Where a controller puts its n poles.
template <Scalar S>
struct FeedbackSpec {
  S bandwidth{};                               ///< omega_c, rad/s
  TimeDomain domain = TimeDomain::continuous;  ///< see TimeDomain
  bool half_gain = false;                      ///< half the gains, see gain/half_gain.hpp
};

namespace detail {

/// s(n-i, n-r) / (n-i)! for i <= r < n.
template <int Order, class T>
constexpr Array<Array<T, Order>, Order> held_input_table() noexcept {
  Array<Array<T, Order>, Order> table{};
  for (int r = 0; r < Order; ++r) {
    for (int i = 0; i <= r; ++i) {
      table[static_cast<std::size_t>(i)][static_cast<std::size_t>(r)] =
          static_cast<T>(stirling_first(Order - i, Order - r) / factorial(Order - i));
    }
  }
  return table;
}

/// Gains from e_m, the elementary symmetric functions of the contractions a_i = 1 - rho_i:
///
///     k_r = (n-r)! / T^(n-r) sum_{i<=r} e_(n-i) s(n-i, n-r) / (n-i)!
///
/// (s: signed Stirling numbers of the first kind). It is Ackermann's formula written in delta = Phi
/// - 1: the last row of the inverse of (Gamma, delta Gamma, ..) is e_1^T e^A (A / (e^A - 1))^(n+1).
template <int Order, Scalar S>
Array<S, Order> held_input_feedback(const Array<S, Order + 1>& symmetric, const S& rate) {
  constexpr auto table = held_input_table<Order, TableScalar<S>>();
  Array<S, Order> gain{};
  S unit(1.0);
  for (int r = Order - 1; r >= 0; --r) {
    unit = unit * (detail::integer<S>(Order - r) * rate);
    S sum(0.0);
    for (int i = 0; i <= r; ++i) {
      const S weight(table[static_cast<std::size_t>(i)][static_cast<std::size_t>(r)]);
      sum = sum + weight * symmetric[static_cast<std::size_t>(Order - i)];
    }
    gain[static_cast<std::size_t>(r)] = unit * sum;
  }
  return gain;
}

}  // namespace detail

/// Gains for all poles at exp(-omega_c T) under a held input.
/// @param bandwidth omega_c, rad/s @param sample_time T, s
/// @return k_0 .. k_(n-1), k_i in 1/s^(n-i)
template <int Order, Scalar S>
Array<S, Order> sampled_feedback_gain(const S& bandwidth, const S& sample_time) {
  const auto poles = EqualSampledPoles<Order, S>::from_bandwidth(bandwidth, sample_time);
  return detail::held_input_feedback<Order, S>(poles.symmetric(), S(S(1.0) / sample_time));
}

/// Gains for a spec. @param sample_time T, s; used in the sampled domain only
/// @return k_0 .. k_(n-1), k_i in 1/s^(n-i), or an error for a bandwidth that is not positive or
///         too large
template <int Order, PlainScalar S>
Expected<Array<S, Order>, Error<S>> feedback_gain(const FeedbackSpec<S>& spec,
                                                  const S& sample_time) {
  Rules<S> rules;
  if (!rules.positive("controller_bandwidth", spec.bandwidth)) return rules.error();
  Array<S, Order> gain{};
  if (spec.domain == TimeDomain::continuous) {
    const Vector<S, Order> coefficients = continuous_gain<Order, S>(spec.bandwidth);
    const S share = spec.half_gain ? S(0.5) : S(1);
    for (int i = 0; i < Order; ++i) {
      gain[static_cast<std::size_t>(i)] = share * coefficients(Order - 1 - i);
    }
  } else if (spec.half_gain) {
    const auto poles = HalfGainPoles::sample<Order, S>(spec.bandwidth, sample_time);
    gain = detail::held_input_feedback<Order, S>(poles.symmetric(), S(1) / sample_time);
  } else {
    gain = sampled_feedback_gain<Order, S>(spec.bandwidth, sample_time);
  }
  rules.representable("controller_bandwidth", spec.bandwidth, gain[0],
                      "gives a gain that the scalar cannot hold");
  if (!rules) return rules.error();
  return gain;
}

}  // namespace esokit
