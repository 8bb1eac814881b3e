/// @file
/// Stability certificate for observers in which the correction of the disturbance is scaled by a
/// factor that changes from sample to sample.
///
/// The error has the characteristic polynomial p_1 with all gains, p_0 without the last one, and
/// p_0 + phi (p_1 - p_0) if the last correction is multiplied by phi. By the circle criterion any
/// phi(k) in [0, 1] is stable if Re G > -1 on the unit circle, where G = (p_1 - p_0) / p_0. This is
/// Re p_1 / p_0 > 0, the same test as for a pair of gain sets, except that p_0 has a root at z = 1,
/// because a disturbance that is not corrected stays. If the disturbance leaks, that is, is
/// multiplied by 1 - a after each correction, both polynomials p become (1 - a) p + a z p_m, where
/// p_m is that of all gains but the last; the root at z = 1 moves to 1 - a.
#pragma once

#include <cmath>
#include <esokit/gain/switching_certificate.hpp>
#include <esokit/math/dense.hpp>
#include <esokit/model/corrected_part.hpp>

namespace esokit {

namespace detail {

/// (1 - a) p + a z p_m after the bilinear map, see error_polynomial.
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

/// For q_0 = 0, which makes the product zero at w = 0: tests the rest, divided by w^2.
template <int Size, Scalar S>
bool positive_but_at_standstill(const Array<S, Size + 1>& product) {
  Array<S, Size> rest{};
  for (std::size_t i = 0; i < Size; ++i) rest[i] = product[i + 1];
  return positive_on_half_line<Size - 1, S>(rest);
}

}  // namespace detail

/// True if the error of a sampled observer of the chain with one extended state stays bounded (by a
/// common quadratic Lyapunov function) while corrections of the disturbance are multiplied by any
/// phi(k) in [0, 1].
/// @param gain scaled current-estimator gain
/// @param leak a: the share of the disturbance that is removed after each correction, 0 .. 1
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
  return detail::positive_but_at_standstill<Size, S>(product);
}

namespace detail {

/// The parts of one level of an observer with a model that concern its constant disturbance: the
/// corrected part, its gain, and the place of the constant among its states.
template <int Size, Scalar S>
struct ConstantLevel {
  Matrix<S, Size, Size> step;  ///< Phi - I
  Array<S, Size> ahead{};      ///< C Phi
  Array<S, Size> gain{};       ///< k
  Array<S, Size> row{};        ///< the constant is `row` x
  Array<S, Size> column{};     ///< change of x with the constant

  template <int Whole, int Pairs, class Model>
  ConstantLevel(const CorrectedPart<Size, Whole, Pairs, S>& part, const Model& model,
                const ScaledGain<Whole, S>& of_model)
      : step(part.step) {
    const auto constant_row = model.constant_row();
    const auto constant_column = model.constant_column();
    for (std::size_t j = 0; j < Size; ++j) {
      const auto state = static_cast<std::size_t>(part.states[j]);
      gain[j] = of_model[state];
      column[j] = constant_column[state];
      ahead[j] = part.output[j];
      row[j] = S(0.0);
      for (std::size_t i = 0; i < Size; ++i) {
        ahead[j] = ahead[j] + part.output[i] * step(static_cast<int>(i), static_cast<int>(j));
      }
      for (std::size_t i = 0; i < Whole; ++i) {
        row[j] = row[j] + constant_row[i] * part.whole(static_cast<int>(i), static_cast<int>(j));
      }
    }
  }

  /// A - I of the error dynamics with correction and leak. @param trust phi @param leak a
  [[nodiscard]] Matrix<S, Size, Size> error(const S& trust, const S& leak) const {
    S found(0.0);
    for (std::size_t i = 0; i < Size; ++i) found = found + row[i] * gain[i];
    auto all = step;
    for (std::size_t i = 0; i < Size; ++i) {
      const S k = gain[i] - (S(1.0) - trust) * found * column[i];
      for (std::size_t j = 0; j < Size; ++j) {
        S& x = all(static_cast<int>(i), static_cast<int>(j));
        // A prediction does not change the constant: row Phi = row.
        x = x - k * ahead[j] - leak * column[i] * (row[j] - trust * found * ahead[j]);
      }
    }
    return all;
  }
};

/// q_0 .. q_N of det(x I - M) for M = (I + E / 2)^-1 E / unit, by the Faddeev-LeVerrier algorithm.
/// With E = A - I this is the polynomial of A after the bilinear map, see error_polynomial.
template <int Size, Scalar S>
ErrorPolynomial<Size, S> bilinear_polynomial(const Matrix<S, Size, Size>& difference,
                                             const S& unit) {
  auto mapped = difference;
  auto half = Matrix<S, Size, Size>::Identity() + difference * S(0.5);
  solve_in_place(DenseView<S>{half.data(), Size}, DenseView<S>{mapped.data(), Size, Size});
  mapped = mapped / unit;
  ErrorPolynomial<Size, S> q{};
  q[Size] = S(1.0);
  auto adjugate = Matrix<S, Size, Size>::Identity();
  for (int k = 1; k <= Size; ++k) {
    adjugate = mapped * adjugate;
    const S next = -adjugate.trace() / S(static_cast<double>(k));
    q[static_cast<std::size_t>(Size - k)] = next;
    for (int i = 0; i < Size; ++i) adjugate(i, i) = adjugate(i, i) + next;
  }
  return q;
}

}  // namespace detail

/// The same for a model in which the constant is separate from the other parts of the disturbance,
/// which are corrected as usual.
/// @param level the level @param leak as above, for the constant
template <int Size, Scalar S>
[[nodiscard]] bool gating_certified(const detail::ConstantLevel<Size, S>& level,
                                    const S& leak = S(0.0)) {
  const auto trusted = level.error(S(1.0), leak);
  // Scaled by the geometric mean of its poles.
  const S product_of_poles =
      detail::absolute(detail::bilinear_polynomial<Size, S>(trusted, S(1.0))[0]);
  const S unit = std::pow(product_of_poles, S(1.0) / S(static_cast<double>(Size)));
  if (!is_finite(unit) || !(unit > S(0.0))) return false;
  const auto p = detail::bilinear_polynomial<Size, S>(trusted, unit);
  const auto q = detail::bilinear_polynomial<Size, S>(level.error(S(0.0), leak), unit);
  if (!is_hurwitz<Size, S>(p) || !(q[1] > S(0.0))) return false;
  const auto product = detail::half_plane_product<Size, S>(p, q);
  return leak > S(0.0) ? positive_on_half_line<Size, S>(product)
                       : detail::positive_but_at_standstill<Size, S>(product);
}

}  // namespace esokit
