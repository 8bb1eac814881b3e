/// @file
/// The steady state of the Riccati recursion of a filter:
///
///     P- = inflation Phi P Phi' + Q,  K = P- C' (C P- C' + R)^-1,  P = (I - K C) P-
///
/// It is found by Newton's method on the gain (G. A. Hewer, 1971). The covariance for a given
/// stable gain solves a Stein equation, which is summed from positive terms by Smith's doubling
/// method, and gives the next gain. The first gain puts all poles at zero, which is always possible
/// for a chain of integrators. The iteration converges quadratically to the stabilising solution,
/// which is unique, if there is one. (The doubling algorithm SDA would find the smallest solution
/// instead, which is zero for Q = 0 and inflation > 1.)
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/detail/covariance_factor.hpp>
#include <esokit/gain/detail/model_placement.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/detail/dense.hpp>
#include <limits>
#include <optional>

namespace esokit {

/// A filter's model, N states, p outputs.
template <int Size, int Outputs, Scalar S>
struct RiccatiModel {
  Matrix<S, Size, Size> transition;         ///< Phi, N x N
  Matrix<S, Outputs, Size> output;          ///< C, p x N
  Matrix<S, Size, Size> noise;              ///< Q, N x N
  Matrix<S, Outputs, Outputs> measurement;  ///< R, p x p
  S inflation{1.0};                         ///< factor on Phi P Phi', > 0
};

namespace detail {

/// Largest relative change of the elements that are not negligible.
template <int Rows, int Columns, Scalar S>
S relative_change(const Matrix<S, Rows, Columns>& now, const Matrix<S, Rows, Columns>& before) {
  S worst(0.0);
  for (int i = 0; i < Rows; ++i) {
    for (int j = 0; j < Columns; ++j) {
      const S size = absolute(now(i, j));
      if (!all(size > S(0.0))) continue;
      const S change = absolute(S(now(i, j) - before(i, j))) / size;
      worst = select(worst < change, change, worst);
    }
  }
  return worst;
}

}  // namespace detail

/// Predicted covariance P- of the steady state, N x N.
/// @param start_gain K, N x p, for which inflation^(1/2) (Phi - Phi K C) is stable
/// @return nothing if `start_gain` is not stabilising, or if there is no stabilising solution (a
///         mode on the unit circle that is not excited by the noise)
template <int Size, int Outputs, Scalar S>
std::optional<Matrix<S, Size, Size>> riccati_covariance(const RiccatiModel<Size, Outputs, S>& model,
                                                        Matrix<S, Size, Outputs> start_gain) {
  using std::sqrt;
  constexpr int most_steps = 200;
  const S root = sqrt(model.inflation);
  Matrix<S, Size, Outputs> gain = start_gain;
  S last_change((std::numeric_limits<detail::TableScalar<S>>::max)());
  for (int step = 0; step < most_steps; ++step) {
    const auto predictor = model.transition * gain;
    const auto error = (model.transition - predictor * model.output) * root;
    const auto spread = predictor * model.measurement;
    const auto covariance =
        detail::solve_stein<Size, S>(error, detail::plus_product_transposed<Size, Outputs, Size, S>(
                                                model.noise, spread, predictor, model.inflation));
    if (!covariance) return std::nullopt;
    const auto crossed = model.output * *covariance;
    const auto innovation = detail::plus_product_transposed<Outputs, Size, Outputs, S>(
        model.measurement, crossed, model.output, S(1.0));
    const auto next = detail::solve_positive<Outputs, Size, S>(innovation, crossed);
    if (!next) return std::nullopt;
    const auto next_gain = next->transpose();
    const S change = detail::relative_change(next_gain, gain);
    gain = next_gain;
    // Quadratic convergence ends at the rounding error, when the changes no longer fall.
    const bool rounding_left = all(change < S(1e-3)) && !all(change < last_change * S(0.25));
    if (!all(change > S(8.0 * Size) * detail::rounding<S>()) || rounding_left) return covariance;
    last_change = change;
  }
  return std::nullopt;
}

namespace detail {

/// Phi.
template <int Size, Scalar S>
void set_transition(Matrix<S, Size, Size>& phi, const PascalTransition&) {
  for (int i = 0; i < Size; ++i) {
    for (int j = 0; j < Size; ++j) {
      phi(i, j) = S(binomial_table<Size, TableScalar<S>>[static_cast<std::size_t>(j)]
                                                        [static_cast<std::size_t>(i)]);
    }
  }
}
template <int Size, Scalar S>
void set_transition(Matrix<S, Size, Size>& phi, const MatrixTransition<Size, S>& transition) {
  phi = transition.phi;
}

/// A gain that puts all poles at zero.
template <int Size, Scalar S>
ScaledGain<Size, S> deadbeat_gain(const PascalTransition&) {
  return current_gain<Size, S>(EqualSampledPoles<Size, S>{S(1.0)}.weights());
}
template <int Size, Scalar S>
ScaledGain<Size, S> deadbeat_gain(const MatrixTransition<Size, S>& transition) {
  return placed_gain(transition.increment(), elements(Matrix<S, Size, Size>::Identity().col(0)),
                     transition.degrees, pole_factors(EqualSampledPoles<Size, S>{S(1.0)}));
}

/// C (-I - Phi)^-1; Phi of the chain is upper triangular.
template <int Size, Scalar S>
Array<S, Size> alternating_response(const PascalTransition&) {
  Array<S, Size> response{};
  for (int j = 0; j < Size; ++j) {
    S sum = j == 0 ? S(1.0) : S(0.0);
    for (int i = 0; i < j; ++i) {
      const auto& binomials = binomial_table<Size, detail::TableScalar<S>>;
      sum = sum + response[static_cast<std::size_t>(i)] *
                      S(binomials[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)]);
    }
    response[static_cast<std::size_t>(j)] = S(-0.5) * sum;
  }
  return response;
}
template <int Size, Scalar S>
Array<S, Size> alternating_response(const MatrixTransition<Size, S>& transition) {
  const auto identity = Matrix<S, Size, Size>::Identity();
  return elements(solved(-transition.phi.transpose() - identity, identity.col(0)));
}

}  // namespace detail

/// Smallest R for which an error that changes sign at every sample decays, in the unit of `noise`.
/// If it is zero or negative, no R is needed.
///
/// By spectral factorisation, |p(-1)|^2 for the characteristic polynomial p of the limit is
/// proportional to the spectral density of the innovations at half the sampling rate, R + |C (-I -
/// Phi)^-1 Q^(1/2)|^2. If that is zero, the limit has a pole at -1. At least a millionth of the
/// trace of Q is required.
/// @param noise Q, scaled @param transition Phi
template <int Size, Scalar S, class Transition = PascalTransition>
S least_measurement_variance(const CovarianceFactor<Size, S>& noise,
                             const Transition& transition = {}) {
  const auto response = detail::alternating_response<Size, S>(transition);
  S density(0.0);
  S trace(0.0);
  for (int k = 0; k < Size; ++k) {
    S seen(0.0);
    for (int i = k; i < Size; ++i) {
      const S l = noise.lower(i, k);
      seen = seen + response[static_cast<std::size_t>(i)] * l;
      trace = trace + l * l * noise.variance(k);
    }
    density = density + seen * seen * noise.variance(k);
  }
  return S(1e-6) * trace - density;
}

/// Steady state for the chain of integrators in Nordsieck scaling, or another model whose first
/// state is measured, P- = L D L'; its gain is accurate to a few units in the last place.
/// @param noise Q @param measurement R >= 0 @param inflation >= 1 @param transition Phi
/// @return nothing if there is none: if inflation = 1 and nothing drives the highest state, or if Q
///         = R = 0; for other models also if nothing disturbs a state that decays by itself
template <int Size, Scalar S, class Transition = PascalTransition>
std::optional<CovarianceFactor<Size, S>> steady_covariance(const CovarianceFactor<Size, S>& noise,
                                                           const S& measurement, const S& inflation,
                                                           const Transition& transition = {}) {
  RiccatiModel<Size, 1, S> model;
  detail::set_transition(model.transition, transition);
  model.noise = noise.matrix();
  model.measurement(0, 0) = measurement;
  model.inflation = inflation;
  model.output = Matrix<S, Size, Size>::Identity().row(0);
  // For other models the recursion below detects it: a gain that tends to zero does not converge.
  if (std::is_same_v<Transition, PascalTransition> && !all(inflation > S(1.0)) &&
      !all(model.noise(Size - 1, Size - 1) > S(0.0))) {
    return std::nullopt;
  }
  const auto covariance = riccati_covariance<Size, 1, S>(
      model, detail::column(detail::deadbeat_gain<Size, S>(transition)));

  // The recursion itself is more accurate than the sums above, whose small variances are lost in
  // the rounding of the large ones, so it is run at the end. If poles near zero leave the sums no
  // digits at all (float, N = 6), it starts from another covariance, because it then converges
  // fast.
  constexpr int most_steps = 4000;
  CovarianceFactor<Size, S> factor;
  if (covariance) {
    factor = CovarianceFactor<Size, S>::nearest(*covariance);
  } else {
    for (int i = 0; i < Size; ++i) factor.set_variance(i, S(model.noise.trace() + measurement));
  }
  ScaledGain<Size, S> gain{};
  int quiet = 0;
  S change(1.0);
  for (int step = 0; step < most_steps && quiet < 4; ++step) {
    const S sum = factor.variance(0) + measurement;
    if (!all(sum > S(0.0)) || !all(is_finite(sum))) return std::nullopt;
    const auto next = factor.gain(S(factor.variance(0) / sum));
    change = S(0.0);
    for (std::size_t i = 0; i < Size; ++i) {
      const S moved = detail::absolute(S(next[i] - gain[i])) / detail::absolute(next[i]);
      change = select(change < moved, moved, change);
    }
    if (!all(is_finite(change))) return std::nullopt;
    gain = next;
    quiet = all(change <= S(2.0) * detail::rounding<S>()) ? quiet + 1 : 0;
    if (quiet == 4) break;
    factor.set_variance(0, S(factor.variance(0) * (measurement / sum)));
    factor.advance_seldom(inflation, noise, transition);
  }
  if (!all(change <= S(64.0) * detail::rounding<S>())) return std::nullopt;
  return factor;
}

}  // namespace esokit
