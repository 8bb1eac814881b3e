/// @file
/// Certificate for observers whose corrections of the disturbance are scaled from sample to sample.
///
/// Without the last gain the error has the characteristic polynomial p_0, with all gains p_1; if
/// the last correction is multiplied by phi, it is p_0 + phi (p_1 - p_0). By the circle criterion
/// any phi(k) in [0, 1] is stable if Re G > -1 on the unit circle, G = (p_1 - p_0) / p_0: that is
/// Re p_1 / p_0 > 0, the test of a pair of gain sets, at whose end p_0 has its root at z = 1 (a
/// disturbance that is not corrected stays). A disturbance that leaks, multiplied by 1 - a after
/// each correction, makes (1 - a) p + a z p_m of both, p_m that of the gains but the last; the root
/// at z = 1 is at 1 - a then.
#pragma once

#include <esokit/gain/switching_certificate.hpp>

namespace esokit {

namespace detail {

/// (1 - a) p + a z p_m by the bilinear map, see error_polynomial.
template <int Size, Scalar S>
ErrorPolynomial<Size, S> leaking_polynomial(const ScaledGain<Size, S>& gain, const S& leak,
                                            const S& unit) {
  ErrorPolynomial<Size, S> p = error_polynomial<Size, S>(gain, unit);
  if (!(leak > S(0.0))) return p;
  ScaledGain<Size - 1, S> others{};
  for (std::size_t i = 0; i + 1 < Size; ++i) others[i] = gain[i];
  const auto m = error_polynomial<Size - 1, S>(others, unit);
  for (S& coefficient : p) coefficient = (S(1.0) - leak) * coefficient;
  for (std::size_t i = 0; i < Size; ++i) {
    p[i] = p[i] + leak / unit * m[i];
    p[i + 1] = p[i + 1] + leak / S(2.0) * m[i];
  }
  return p;
}

}  // namespace detail

/// Whether the error of a sampled observer of the chain with one extended state stays bounded, by a
/// common quadratic Lyapunov function, while corrections of the disturbance are multiplied by any
/// phi(k) in [0, 1].
/// @param gain scaled current-estimator gain
/// @param leak a: the part of the disturbance that goes after each correction, 0 .. 1
template <int Size, Scalar S>
[[nodiscard]] bool gating_certified(const ScaledGain<Size, S>& gain, const S& leak = S(0.0)) {
  const S unit = frequency_scale<Size, S>(gain);
  if (!is_finite(unit) || !(unit > S(0.0))) return false;
  ScaledGain<Size, S> frozen = gain;
  frozen[Size - 1] = S(0.0);
  const auto p = detail::leaking_polynomial<Size, S>(gain, leak, unit);
  const auto q = detail::leaking_polynomial<Size, S>(frozen, leak, unit);
  if (!is_hurwitz<Size, S>(p) || !(q[1] > S(0.0))) return false;
  const auto product = detail::half_plane_product<Size, S>(p, q);
  if (leak > S(0.0)) return positive_on_half_line<Size, S>(product);
  // q_0 is zero, and with it the value at standstill: what is positive is the rest, over w^2.
  Array<S, Size> rest{};
  for (std::size_t i = 0; i < Size; ++i) rest[i] = product[i + 1];
  return positive_on_half_line<Size - 1, S>(rest);
}

}  // namespace esokit
