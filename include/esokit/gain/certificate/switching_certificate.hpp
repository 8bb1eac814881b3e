/// @file
/// Stability certificates for observers that switch between two gain sets.
///
/// The error dynamics A_1, A_2 of two gain sets on the same chain differ by a matrix of rank one.
/// They share a quadratic Lyapunov function, and so stay stable under any switching and any
/// blending, iff both are stable and A_2 A_1 has no negative real eigenvalue. H. Lin, P. J.
/// Antsaklis, IEEE Transactions on Automatic Control 54 (2009) 308-322. det(A_2 A_1 + x I) is, up
/// to its sign, the polynomial Re[p_2(jw) p_1(-jw)] in x = w^2, p_i the characteristic polynomials:
/// an eigenvalue -x is a root x > 0 of it. So the test of the eigenvalues becomes one of the
/// positivity of a polynomial, without an eigenvalue solver. Sampled pairs are tested after the
/// bilinear map.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/gain/certificate/error_polynomial.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/math/positivity.hpp>
#include <limits>
#include <numbers>

namespace esokit {

namespace detail {

/// sin(x) for |x| <= pi, at compile time.
constexpr double constexpr_sine(double x) noexcept {
  double term = x;
  double sum = 0.0;
  for (int i = 1; i < 40; i += 2) {
    sum += term;
    term *= -x * x / ((i + 1) * (i + 2));
  }
  return sum;
}

/// The coefficients of Re[p(jw) q(-jw)] in w^2, each reduced by more than its possible rounding
/// error.
template <int Size, Scalar S>
Array<S, Size + 1> half_plane_product(const ErrorPolynomial<Size, S>& p,
                                      const ErrorPolynomial<Size, S>& q) {
  const S margin = S(8.0 * Size) * rounding<S>();
  Array<S, Size + 1> product{};
  for (S& c : product) c = S(0.0);
  for (std::size_t a = 0; a <= Size; ++a) {
    for (std::size_t b = a % 2; b <= Size; b += 2) {
      const S term = p[a] * q[b];
      // j^a (-j)^b = j^(a-b), a - b even.
      const std::size_t power = (a + b) / 2;
      const bool positive = (a + 3 * b) % 4 == 0;
      const S signed_term = positive ? term : S(-term);
      product[power] = product[power] + signed_term - margin * absolute(term);
    }
  }
  return product;
}

/// Re[p(jw) q(-jw)] > 0 for every w.
template <int Size, Scalar S>
bool same_half_plane(const ErrorPolynomial<Size, S>& p, const ErrorPolynomial<Size, S>& q) {
  return positive_on_half_line<Size, S>(half_plane_product<Size, S>(p, q));
}

template <int Size, Scalar S, class Gain>
[[nodiscard]] bool certified_pair(const Gain& first, const Gain& second) {
  const S unit = S(0.5) * (frequency_scale<Size, S>(first) + frequency_scale<Size, S>(second));
  if (!is_finite(unit) || !(unit > S(0.0))) return false;
  const auto p = error_polynomial<Size, S>(first, unit);
  const auto q = error_polynomial<Size, S>(second, unit);
  // If it is positive along the whole axis, p and q have equally many roots in the right half
  // plane, so Routh's test of p is enough.
  return is_hurwitz<Size, S>(p) && same_half_plane<Size, S>(p, q);
}

}  // namespace detail

/// True if the errors of two gain sets of one sampled observer share a quadratic Lyapunov function.
/// Then every gain on the segment between them is stable, however it varies.
/// @param first, second scaled current-estimator gains
template <int Size, Scalar S>
[[nodiscard]] bool switching_certified(const ScaledGain<Size, S>& first,
                                       const ScaledGain<Size, S>& second) {
  return detail::certified_pair<Size, S>(first, second);
}

/// tan^2(pi (N-1) / (4N)): two continuous gain sets with all poles at -w and at -rho w, rho < 1,
/// share a quadratic Lyapunov function iff rho is above it. 0.1716, 0.3333, 0.4465, 0.5279 for N =
/// 2 .. 5.
template <int Size>
constexpr double least_bandwidth_ratio() noexcept {
  // tan^2(pi/4 - x/2) = (1 - sin x) / (1 + sin x)
  const double sine = detail::constexpr_sine(std::numbers::pi / (2 * Size));
  return (1.0 - sine) / (1.0 + sine);
}

/// The ratio that replaces the bandwidth ratio for sampled gain sets with equal poles: tanh(w_1
/// T/2) / tanh(w_2 T/2), to be compared with least_bandwidth_ratio.
template <int Size, Scalar S>
S sampled_bandwidth_ratio(const EqualSampledPoles<Size, S>& first,
                          const EqualSampledPoles<Size, S>& second) {
  // tanh(w T/2) = (1 - rho) / (1 + rho) = a / (2 - a).
  return first.contraction * (S(2.0) - second.contraction) /
         (second.contraction * (S(2.0) - first.contraction));
}

/// The two bandwidths between which an observer switches.
enum class SwitchingRule : unsigned char {
  abeso,  ///< rho w while the innovation shrinks, w otherwise
  beso,   ///< rho w while the innovation shrinks, w / rho otherwise
};

/// True if the two bandwidths of a rule are certified; the closed form for equal poles.
/// @param sample_time T, s; 0 for a continuous observer
template <int Size, Scalar S>
[[nodiscard]] bool bandwidth_switching_certified(SwitchingRule rule, const S& bandwidth,
                                                 const S& ratio, const S& sample_time) {
  const S shrinking = bandwidth * ratio;
  const S otherwise = rule == SwitchingRule::beso ? S(bandwidth / ratio) : bandwidth;
  S quotient = shrinking / otherwise;
  if (sample_time > S(0.0)) {
    using Poles = EqualSampledPoles<Size, S>;
    quotient = sampled_bandwidth_ratio(Poles::from_bandwidth(shrinking, sample_time),
                                       Poles::from_bandwidth(otherwise, sample_time));
  }
  constexpr double least = least_bandwidth_ratio<Size>();
  const S limit = detail::constant<S>(
      least * (1.0 + 16.0 * static_cast<double>(detail::rounding<detail::TableScalar<S>>())));
  return is_finite(quotient) && quotient > limit && S(1.0) / quotient > limit;
}

/// The limit of the certified range of rho on the side of `ratio`: for a ratio below 1 the
/// smallest, above 1 the largest certified rho (infinite if every rho > 1 is certified). A closed
/// form for the ABESO, by bisection for the BESO.
/// @param sample_time T, s; 0 for a continuous observer
template <int Size, PlainScalar S>
[[nodiscard]] S certified_ratio_limit(SwitchingRule rule, const S& bandwidth, const S& ratio,
                                      const S& sample_time) {
  const S least = static_cast<S>(least_bandwidth_ratio<Size>());
  const bool above = ratio > S(1);
  const S x = bandwidth * sample_time;
  if (!(x > S(0))) {
    const S end = rule == SwitchingRule::beso ? std::sqrt(least) : least;
    return above ? S(1) / end : end;
  }
  if (rule == SwitchingRule::abeso) {
    const S here = std::tanh(x / S(2));
    const S t = above ? here / least : here * least;
    if (!(t < S(1))) return detail::unbounded<S>();
    return std::log1p(S(2) * t / (S(1) - t)) / x;
  }
  // rho and 1 / rho are interchangeable, so the range is symmetric in the logarithm.
  S low = least;  // sampled, it lies between zero and sqrt(least), the value in continuous time
  S high = S(1);
  while (low > (std::numeric_limits<S>::min)() * S(1e6) &&
         bandwidth_switching_certified<Size, S>(rule, bandwidth, low, sample_time)) {
    low = low * low;
  }
  for (int i = 0; i < std::numeric_limits<S>::digits + 8; ++i) {
    const S middle = S(0.5) * (low + high);
    (bandwidth_switching_certified<Size, S>(rule, bandwidth, middle, sample_time) ? high : low) =
        middle;
  }
  return above ? S(1) / high : high;
}

namespace detail {

/// The two bandwidths of a rule.
template <Scalar S>
struct BandwidthPair {
  S shrinking{};
  S otherwise{};
};

/// @param sample_time T, s; 0 for a continuous observer
template <int Size, Scalar S>
Expected<BandwidthPair<S>, Error<S>> bandwidth_pair(const S& bandwidth, const S& ratio,
                                                    SwitchingRule rule, const S& sample_time,
                                                    bool allow_uncertified) {
  Rules<S> rules;
  rules.positive("observer_bandwidth", bandwidth).positive("bandwidth_ratio", ratio);
  if (!rules) return rules.error();
  const BandwidthPair<S> pair{bandwidth * ratio,
                              rule == SwitchingRule::beso ? S(bandwidth / ratio) : bandwidth};
  for (const S& product : {pair.shrinking, pair.otherwise}) {
    rules.representable("bandwidth_ratio", ratio, product,
                        "with observer_bandwidth gives a bandwidth that the scalar cannot hold");
  }
  if (!rules) return rules.error();
  if (allow_uncertified ||
      bandwidth_switching_certified<Size, S>(rule, bandwidth, ratio, sample_time)) {
    return pair;
  }
  constexpr const char* below =
      "must be certified against every switching (or set allow_uncertified_switching): above";
  constexpr const char* above =
      "must be certified against every switching (or set allow_uncertified_switching): below";
  if constexpr (PlainScalar<S>) {
    const S limit = certified_ratio_limit<Size, S>(rule, bandwidth, ratio, sample_time);
    return Error<S>{"bandwidth_ratio", ratio, ratio < S(1) ? below : above, -1, limit, true};
  } else {
    return Error<S>{
        "bandwidth_ratio", ratio,
        "must be certified against every switching (or set allow_uncertified_switching)"};
  }
}

}  // namespace detail

}  // namespace esokit
