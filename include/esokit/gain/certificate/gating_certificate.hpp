/// @file
/// Stability certificate for observers in which the correction of the disturbance is scaled by a
/// factor that changes from sample to sample.
///
/// The error has the characteristic polynomial p_1 with all gains, p_0 without the last one, and
/// p_0 + phi (p_1 - p_0) if the last correction is multiplied by phi. By the circle criterion any
/// phi(k) in [0, 1] is stable if Re G > -1 on the unit circle, where G = (p_1 - p_0) / p_0. This is
/// Re p_1 / p_0 > 0, the same test as for a pair of gain sets. But p_0 has a root at z = 1, because
/// a disturbance that is not corrected stays. If the disturbance leaks (after each correction it is
/// multiplied by 1 - a), both polynomials p become (1 - a) p + a z p_m. Here p_m is that of all
/// gains but the last; the root at z = 1 moves to 1 - a.
///
/// Between two holds of the plant (y, 0, .., 0 is known then, so that only the disturbance is in
/// error) more can be said. Let e be its error and h(j) the answer of the innovation to an e of one
/// sample, while nothing corrects e. So the innovation is sum_j h(j) e(k - j), and e moves by at
/// most r = k sum |h| in a sample if abs(e) was never above 1. To pass -1 for the first time e
/// needs a positive innovation while it is at -1, hence was at most min(1, r j - 1) j samples
/// before. If sum h+(j) min(1, r j - 1) + h-(j) is below zero, with h+ - h- = h, that cannot be,
/// whatever phi(k) in [0, 1]. An error is never larger than at the hold before, and nothing can
/// grow over any number of holds.
#pragma once

#include <cmath>
#include <esokit/gain/certificate/switching_certificate.hpp>
#include <esokit/gain/detail/model_placement.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/model/chain_model.hpp>
#include <esokit/model/detail/observable_part.hpp>

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

/// Re p / q > 0 on the imaginary axis, with p stable. @param leaks false: q_0 = 0, which makes the
/// product zero at w = 0; the rest, divided by w^2, is tested
template <int Size, Scalar S>
bool certified_against(const ErrorPolynomial<Size, S>& p, const ErrorPolynomial<Size, S>& q,
                       bool leaks) {
  if (!is_hurwitz<Size, S>(p) || !(q[1] > S(0.0))) return false;
  const auto product = half_plane_product<Size, S>(p, q);
  if (leaks) return positive_on_half_line<Size, S>(product);
  Array<S, Size> rest{};
  for (std::size_t i = 0; i < Size; ++i) rest[i] = product[i + 1];
  return positive_on_half_line<Size - 1, S>(rest);
}

}  // namespace detail

/// True if the error of a sampled observer of the chain with one extended state stays bounded while
/// corrections of the disturbance are multiplied by any phi(k) in [0, 1]. Proven by a common
/// quadratic Lyapunov function.
/// @param gain scaled current-estimator gain
/// @param leak a: the share of the disturbance that is removed after each correction, 0 .. 1
template <int Size, Scalar S>
[[nodiscard]] bool gating_certified(const ScaledGain<Size, S>& gain, const S& leak = S(0.0)) {
  const S unit = frequency_scale<Size, S>(gain);
  if (!is_finite(unit) || !(unit > S(0.0))) return false;
  ScaledGain<Size, S> frozen = gain;
  frozen[Size - 1] = S(0.0);
  return detail::certified_against<Size, S>(detail::leaking_polynomial<Size, S>(gain, leak, unit),
                                            detail::leaking_polynomial<Size, S>(frozen, leak, unit),
                                            leak > S(0.0));
}

namespace detail {

/// The parts of one level of an observer with a model that concern its constant disturbance: the
/// corrected part, its gain, and the place of the constant among its states.
template <int Size, Scalar S>
struct ConstantLevel {
  Matrix<S, Size, Size> step;  ///< Phi - I
  Vector<S, Size> ahead;       ///< C Phi
  Vector<S, Size> gain;        ///< k
  Vector<S, Size> row;         ///< the constant is `row` x
  Vector<S, Size> column;      ///< change of x with the constant

  /// That of a chain with one extended state.
  explicit ConstantLevel(const ScaledGain<Size, S>& of_chain)
      : step(ChainModel<Size - 1, S>::increment()),
        ahead(Vector<S, Size>::Constant(S(1.0))),
        gain(detail::column(of_chain)),
        row(Matrix<S, Size, Size>::Identity().col(Size - 1)),
        column(row) {}

  template <int Whole, int Pairs, class Model>
  ConstantLevel(const CorrectedPart<Size, Whole, Pairs, S>& part, const Model& model,
                const ScaledGain<Whole, S>& of_model)
      : step(part.step),
        ahead(detail::column(output_ahead<Size>(part.output, part.step))),
        row((detail::column(model.constant_row()).transpose() * part.whole).transpose()) {
    const auto constant_column = model.constant_column();
    for (int j = 0; j < Size; ++j) {
      const int state = part.states[static_cast<std::size_t>(j)];
      gain(j) = of_model[static_cast<std::size_t>(state)];
      column(j) = constant_column[static_cast<std::size_t>(state)];
    }
  }

  /// The correction of the constant by an innovation of one.
  [[nodiscard]] S correction() const { return row.dot(gain); }

  /// A - I of the error dynamics with correction and leak. @param trust phi @param leak a
  [[nodiscard]] Matrix<S, Size, Size> error(const S& trust, const S& leak) const {
    const S found = correction();
    auto all = step;
    for (int i = 0; i < Size; ++i) {
      const S k = gain(i) - (S(1.0) - trust) * found * column(i);
      for (int j = 0; j < Size; ++j) {
        // A prediction does not change the constant: row Phi = row.
        all(i, j) =
            all(i, j) - k * ahead(j) - leak * column(i) * (row(j) - trust * found * ahead(j));
      }
    }
    return all;
  }

  /// The steady error of the states under a constant d. @param d scaled @param leak a
  [[nodiscard]] Matrix<S, Size, 1> leak_error(const S& leak, const S& d) const {
    // (I - A) error = leak d.
    return solved(-error(S(1.0), leak), column * S(leak * d));
  }
};

/// The same for the levels of a chain, in closed form.
template <int Order, Scalar S, std::size_t Levels>
Array<S, Order + 1> leak_error(const std::array<ScaledGain<Order + 1, S>, Levels>& gains,
                               const S& leak, const S& d) noexcept {
  // In steady state dhat is (1 - leak) / leak times its correction.
  const S kept = (S(1.0) - leak) / leak;
  S left = d;
  Array<S, Order + 1> error{};
  for (const auto& k : gains) {
    // Each state is constant: in a step, the prediction adds what the correction removes.
    const S share = std::get<Order - 1>(k) / static_cast<S>(Order);
    const S innovation = left / (share + kept * std::get<Order>(k));
    left = share * innovation;
    error[Order] = left;
    for (int i = Order - 2; i >= 0; --i) {
      S sum = k[static_cast<std::size_t>(i)] * innovation;
      for (int j = i + 2; j <= Order; ++j) {
        sum = sum - static_cast<S>(binomial(j, i)) * error[static_cast<std::size_t>(j)];
      }
      error[static_cast<std::size_t>(i + 1)] = sum / static_cast<S>(i + 1);
    }
    // A level is corrected by the corrected y of the level before.
    error[0] = error[0] + (S(1.0) - k[0]) * innovation;
  }
  return error;
}

/// q_0 .. q_N of det(x I - M) for M = (I + E / 2)^-1 E / unit, by the Faddeev-LeVerrier algorithm.
/// With E = A - I this is the polynomial of A after the bilinear map, see error_polynomial.
template <int Size, Scalar S>
ErrorPolynomial<Size, S> bilinear_polynomial(const Matrix<S, Size, Size>& difference,
                                             const S& unit) {
  const auto half = Matrix<S, Size, Size>::Identity() + difference * S(0.5);
  const auto lower = characteristic(Matrix<S, Size, Size>(solved(half, difference) / unit),
                                    [](int, const auto&) {});
  ErrorPolynomial<Size, S> q{};
  for (std::size_t i = 0; i < Size; ++i) q[i] = lower[i];
  q[Size] = S(1.0);
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
  return detail::certified_against<Size, S>(
      detail::bilinear_polynomial<Size, S>(trusted, unit),
      detail::bilinear_polynomial<Size, S>(level.error(S(0.0), leak), unit), leak > S(0.0));
}

/// What is proven of a plant that is held and released, see `holding`.
struct Holding {
  bool stable = false;  ///< under full trust the error of the disturbance never grows
  int settling = 0;     ///< samples after a release in which corrections of the disturbance must
                        ///< either all count or, from one on, none; 0: any factors are proven
};

namespace detail {

/// The error after a hold, sample by sample: `of` the innovation and of the disturbance.
template <int Size, Scalar S>
struct ErrorAfterHold {
  static constexpr int steps = 512;
  Array<S, steps> change{};  ///< of the innovation, times the gain of the disturbance, in a step
  S all = S(0.0);            ///< sum of their magnitudes
  S largest = S(0.0);        ///< error of the disturbance, for 1 at first
  int length = 1;            ///< of a step, in samples
  int settled = 0;           ///< samples; 0: it does not settle

  /// @param trust phi, the same at every sample
  ErrorAfterHold(const ConstantLevel<Size, S>& level, const S& trust) {
    auto error = level.error(trust, S(0.0));
    const S gain = level.correction();
    for (; length < 1 << 20; length *= 2) {
      play(level, error, gain);
      if (!is_finite(all)) return;
      S left(0.0);
      int last = steps;
      while (last > 0 && !(left > S(0.001) * all)) left = left + absolute(change[index(--last)]);
      if (2 * last < steps) {
        settled = (last + 1) * length;
        return;
      }
      error = error * S(2.0) + error * error;  // A^2 - I of A - I
    }
  }

 private:
  static constexpr std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }

  void play(const ConstantLevel<Size, S>& level, const Matrix<S, Size, Size>& error,
            const S& gain) {
    auto x = level.column;
    S before(0.0);
    all = largest = S(0.0);
    for (S& moved : change) {
      const S innovation = level.ahead.dot(x);
      const S disturbance = level.row.dot(x);
      moved = gain * (innovation - before);
      before = innovation;
      all = all + absolute(moved);
      if (absolute(disturbance) > largest) largest = absolute(disturbance);
      const auto now = x;
      for (int r = 0; r < Size; ++r) {
        for (int j = 0; j < Size; ++j) x(r) = x(r) + error(r, j) * now(j);
      }
    }
  }
};

/// The argument at the head of this file.
template <int Size, Scalar S>
bool never_grows(const ErrorAfterHold<Size, S>& frozen, bool leaks) {
  S positive(0.0);
  S sum(0.0);
  S highest = S(-1.0);  // min(1, r j - 1)
  for (const S& moved : frozen.change) {
    if (moved > S(0.0)) positive = positive + moved;
    sum = sum + (moved > S(0.0) ? moved * highest : S(-moved));
    if (sum > S(0.0)) return false;
    highest = highest + frozen.all * S(static_cast<double>(frozen.length));
    // A leak takes an error above zero faster to zero.
    if (highest > S(1.0) || (leaks && highest > S(0.0))) highest = S(1.0);
  }
  return positive <= S(1.0) && sum < S(-0.01) * frozen.all;
}

}  // namespace detail

/// What holds and releases of the plant do to the error of the disturbance, see the head of this
/// file. Where the argument there fails (slow sines), the common Lyapunov function V of
/// `gating_certified` serves. Among all errors with the same error of the disturbance V is least
/// for the one to which an uncorrected observer settles. So if nothing is corrected until this has
/// settled, whatever follows cannot take the error of the disturbance beyond its value then.
/// @param level the level, which is gating_certified @param leaks whether the constant leaks
template <int Size, Scalar S>
[[nodiscard]] Holding holding(const detail::ConstantLevel<Size, S>& level, bool leaks) {
  const detail::ErrorAfterHold<Size, S> frozen(level, S(0.0));
  if (frozen.settled > 0 && detail::never_grows(frozen, leaks)) return {true, 0};
  const detail::ErrorAfterHold<Size, S> trusted(level, S(1.0));
  const bool settles = frozen.settled > 0 && trusted.settled > 0;
  return {settles && trusted.largest <= S(1.0) + S(8.0 * Size) * detail::rounding<S>(),
          frozen.settled > trusted.settled ? frozen.settled : trusted.settled};
}

}  // namespace esokit
