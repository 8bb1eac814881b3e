/// @file
/// Bounds on the estimation error that are proven by Lyapunov functions, as in the papers with
/// corrections. The exact worst case is given by `peak_gain`.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <esokit/math/combinatorics.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>

#include "analysis/lyapunov_matrix.hpp"

namespace analysis {

/// Upper limits of the sources of the error.
struct ErrorSources {
  double disturbance_rate = 0.0;   ///< largest abs(d^(m)), for m = 1 unit of d per s
  double measurement_noise = 0.0;  ///< largest abs(v), unit of y
};

/// A bound on z - zhat, in terms of the scaled error zeta_i = omega^(N-i) (z_i - zhat_i), i = 1..N:
/// norm(zeta(t)) <= gamma (norm(zeta(0)) e^(-rate t) + level (1 - e^(-rate t))).
template <int Size>
struct ErrorBound {
  double bandwidth = 0.0;  ///< omega, rad/s
  double gamma = 0.0;      ///< sqrt(lambda_max(P) / lambda_min(P))
  double level = 0.0;      ///< unit of d^(m-1)
  double rate = 0.0;       ///< 1/s

  /// Ultimate bound on each abs(z_i - zhat_i), for t to infinity, N x 1, physical units.
  [[nodiscard]] EigenMatrix<double, Size> ultimate() const { return unscaled(gamma * level); }

  /// The same at a time t (s), for an initial error z(0) - zhat(0), N x 1.
  [[nodiscard]] EigenMatrix<double, Size> at(double t,
                                             const EigenMatrix<double, Size>& initial) const {
    const double decay = std::exp(-rate * t);
    return unscaled(gamma * (scaled_norm(initial) * decay + level * (1.0 - decay)));
  }

  /// Time (s) after which the bound exceeds its ultimate value by at most a share of `excess`; 0 if
  /// it always does.
  /// @return error if there is no source of error (the bound is then never reached), for excess <=
  ///         0, or for an initial error that overflows in the scaling
  [[nodiscard]] Expected<double, Error<double>> convergence_time(
      const EigenMatrix<double, Size>& initial, double excess = 0.1) const {
    Rules<double> rules;
    rules.positive("excess", excess)
        .demand(level > 0.0, "level", level, "must be positive: a bound of zero is never reached")
        .finite("initial", initial);
    if (!rules) return rules.error();
    const double over = (scaled_norm(initial) - level) / (excess * level);
    if (!is_finite(over)) {
      return Error<double>{"initial", initial.norm(),
                           "leaves the range of the scalar in the scaling of the bound"};
    }
    return over > 1.0 ? std::log(over) / rate : 0.0;
  }

  /// norm(zeta) of an error in physical units.
  [[nodiscard]] double scaled_norm(const EigenMatrix<double, Size>& error) const {
    double sum = 0.0;
    for (int i = 0; i < Size; ++i) {
      const double zeta = error(i) * std::pow(bandwidth, Size - 1 - i);
      sum += zeta * zeta;
    }
    return std::sqrt(sum);
  }

 private:
  [[nodiscard]] EigenMatrix<double, Size> unscaled(double norm) const {
    EigenMatrix<double, Size> bound;
    for (int i = 0; i < Size; ++i) bound(i) = norm * std::pow(bandwidth, i + 1 - Size);
    return bound;
  }
};

inline Check<double> check_sources(const ErrorSources& sources) {
  return Rules<double>{}
      .not_negative("disturbance_rate", sources.disturbance_rate)
      .not_negative("measurement_noise", sources.measurement_noise);
}

/// kappa_i = C(N, i) factor^i: the scaled gains of poles at -factor omega.
template <int Size>
EigenMatrix<double, Size> binomial_gain(double factor = 1.0) {
  EigenMatrix<double, Size> gain;
  for (int i = 0; i < Size; ++i) gain(i) = binomial(Size, i + 1) * std::pow(factor, i + 1);
  return gain;
}

/// H* = A - kappa c', where the scaled error obeys zeta' = omega H* zeta + .. .
template <int Size>
EigenMatrix<double, Size, Size> scaled_error_matrix(const EigenMatrix<double, Size>& gain) {
  EigenMatrix<double, Size, Size> h = EigenMatrix<double, Size, Size>::Zero();
  for (int i = 0; i < Size; ++i) {
    h(i, 0) = -gain(i);
    if (i + 1 < Size) h(i, i + 1) += 1.0;
  }
  return h;
}

/// From V = zeta' P zeta: V' <= -omega norm^2 + 2 norm(P) norm drive.
/// @return error for a bound that overflows
template <int Size>
Expected<ErrorBound<Size>, Error<double>> bound_from(const LyapunovMatrix<Size>& lyapunov,
                                                     double bandwidth, double drive) {
  const ErrorBound<Size> bound{bandwidth, lyapunov.gamma(),
                               2.0 * lyapunov.largest * drive / bandwidth,
                               bandwidth / (2.0 * lyapunov.largest)};
  double sum = bound.gamma + bound.level + bound.rate;
  for (const double each : bound.ultimate()) sum += each;
  Rules<double> rules;
  rules.demand(is_finite(sum), "observer_bandwidth", bandwidth,
               "gives with these sources a bound that the scalar cannot hold");
  if (!rules) return rules.error();
  return bound;
}

/// Bound for an observer whose scaled gain varies arbitrarily between two gains.
template <int Size>
Expected<ErrorBound<Size>, Error<double>> bound_between(const EigenMatrix<double, Size>& gain1,
                                                        const EigenMatrix<double, Size>& gain2,
                                                        double bandwidth,
                                                        const ErrorSources& sources) {
  Rules<double> rules;
  rules.positive("observer_bandwidth", bandwidth).all_of(check_sources(sources));
  if (!rules) return rules.error();
  const std::array<EigenMatrix<double, Size, Size>, 2> modes = {scaled_error_matrix<Size>(gain1),
                                                                scaled_error_matrix<Size>(gain2)};
  const auto lyapunov = common_lyapunov_matrix<Size>(modes);
  if (!lyapunov) return lyapunov.error();
  const double gain = (std::max)(gain1.norm(), gain2.norm());
  return bound_from(
      *lyapunov, bandwidth,
      sources.disturbance_rate + std::pow(bandwidth, Size) * gain * sources.measurement_noise);
}

/// Bound for the continuous linear ESO: K. Lakomy, R. Madonski, ISA Transactions 109 (2021), (11),
/// with P from (8) and the corrections: norm(kappa) for kappa_max, squared norms in (7).
///
///     drive = max abs(d^(m)) + omega^N norm(kappa) max abs(v),  level = 2 norm(P) drive / omega
///
/// @return error for a bad config or source
template <int Size>
Expected<ErrorBound<Size>, Error<double>> linear_error_bound(
    const ContinuousLinearEsoConfig<Size, double, EqualPoles>& config,
    const ErrorSources& sources) {
  const double w = config.observer_bandwidth;
  Rules<double> rules;
  rules.positive("observer_bandwidth", w).all_of(check_sources(sources));
  if (!rules) return rules.error();
  const EigenMatrix<double, Size> gain = binomial_gain<Size>();
  const auto lyapunov = lyapunov_matrix<Size>(scaled_error_matrix<Size>(gain));
  if (!lyapunov) return lyapunov.error();
  return bound_from(
      *lyapunov, w,
      sources.disturbance_rate + std::pow(w, Size) * gain.norm() * sources.measurement_noise);
}

/// Bounds for the continuous cascade ESO, one per level, each for the error of (24) with the levels
/// up to it: (22), (30) of the paper by Lakomy and Madonski, corrected. The last one is the bound
/// for the estimate.
///
/// With z_i the estimate by the levels up to i and l_i their gains, (26) reads
///
///     z~_i' = H_i z~_i + b d' + (l_i - b b' l_{i-1}) c' z~_{i-1}
///             + sum_{j<i-1} b b' (l_{j+1} - l_j) c' z~_j - b b' l_1 v
///
/// (for m > 1 b b' is the projection on all disturbance rows). So besides d' the levels before
/// drive level i, which their bounds limit, for j < i - 1 with omega_j (alpha^(n+1) - 1); noise
/// enters with norm(kappa) omega^N at level 1 only. `rate` and `at` count from the time at which
/// the levels before have settled.
/// @tparam Order n @return error for a bad config or source
template <int Order, int Size, int Levels>
Expected<Array<ErrorBound<Size>, Levels>, Error<double>> cascade_error_bounds(
    const ContinuousCascadeEsoConfig<Size, Levels, double, EqualPoles>& config,
    const ErrorSources& sources) {
  static_assert(Order >= 1 && Order < Size, "esokit: the order leaves no extended state");
  const auto levels = esokit::detail::level_specs<EqualPoles, Size, Levels, double>(config);
  if (!levels) return levels.error();
  const Array<double, Levels>& w = levels->specs;
  Rules<double> rules;
  rules.all_of(check_sources(sources)).positive(levels->field, w);
  if (!rules) return rules.error();
  const EigenMatrix<double, Size> gain = binomial_gain<Size>();
  const auto lyapunov = lyapunov_matrix<Size>(scaled_error_matrix<Size>(gain));
  if (!lyapunov) return lyapunov.error();

  Array<ErrorBound<Size>, Levels> bounds{};
  for (std::size_t i = 0; i < Levels; ++i) {
    // A term g c' z~_j, scaled for level i: the norm of omega_i^(N-r) g_r, times the bound on
    // z~_j1.
    const auto size_of = [&](const auto& term) {
      double sum = 0.0;
      for (int r = 0; r < Size; ++r) {
        const double scaled = term(r) * std::pow(w[i], Size - 1 - r);
        sum += scaled * scaled;
      }
      return std::sqrt(sum);
    };
    const auto row = [&](std::size_t level, int r) { return gain(r) * std::pow(w[level], r + 1); };
    const auto disturbance = [](int r) { return r >= Order; };
    double drive = sources.disturbance_rate;
    drive += sources.measurement_noise *
             size_of([&](int r) { return i == 0 || disturbance(r) ? row(0, r) : 0.0; });
    for (std::size_t j = 0; j < i; ++j) {
      const double before = bounds[j].ultimate()(0);
      drive += before * size_of([&](int r) {
                 if (j + 1 == i) return row(i, r) - (disturbance(r) ? row(j, r) : 0.0);
                 return disturbance(r) ? row(j + 1, r) - row(j, r) : 0.0;
               });
    }
    const auto bound = bound_from(*lyapunov, w[i], drive);
    if (!bound) return bound.error();
    bounds[i] = *bound;
  }
  return bounds;
}

/// An observer that switches between two bandwidths: the ABESO has the factors rho and 1, the BESO
/// rho and 1/rho.
struct SwitchedBandwidth {
  double observer_bandwidth{};      ///< omega, rad/s
  double factor_while_shrinking{};  ///< delta while abs(e) shrinks
  double factor_otherwise = 1.0;    ///< delta otherwise
};

/// Bound and convergence time for the adjustable-bandwidth ESO under any switching: S. Zhang, X.
/// Qi, S. Yang, J. Systems Engineering and Electronics (2023), (15), (20), (21). The P common to
/// both modes is computed from the inequalities, and delta-bar = norm of the larger gain (in (13)
/// the square root is missing).
/// @tparam Size N @return error for a bad setting, or factors without a common P
template <int Size>
Expected<ErrorBound<Size>, Error<double>> switched_error_bound(const SwitchedBandwidth& setting,
                                                               const ErrorSources& sources) {
  Rules<double> rules;
  rules.positive("factor_while_shrinking", setting.factor_while_shrinking)
      .positive("factor_otherwise", setting.factor_otherwise);
  if (!rules) return rules.error();
  return bound_between<Size>(binomial_gain<Size>(setting.factor_while_shrinking),
                             binomial_gain<Size>(setting.factor_otherwise),
                             setting.observer_bandwidth, sources);
}

/// An observer whose gains are k(e) times those of the bandwidth.
struct GainRange {
  double observer_bandwidth{};  ///< omega_0, rad/s
  double gain_min{};            ///< k_min
  double gain_max{};            ///< k_max
};

/// Bound for the nonlinear higher-order ESO: A. T. Azar et al., Mathematics 10 (2022) 2261, (34),
/// (35). It assumes what the paper omits: k(e) stays within (k_min, k_max), and both limits share a
/// P. The bound then covers any variation of k between them.
/// @tparam Size N @return error for a bad setting, or a range without a common P
template <int Size>
Expected<ErrorBound<Size>, Error<double>> nonlinear_error_bound(const GainRange& setting,
                                                                const ErrorSources& sources) {
  Rules<double> rules;
  rules.positive("gain_min", setting.gain_min)
      .demand(is_finite(setting.gain_max) && setting.gain_max >= setting.gain_min,
              {"gain_max", setting.gain_max, "must be finite and not below gain_min", -1,
               setting.gain_min, true});
  if (!rules) return rules.error();
  const EigenMatrix<double, Size> gain = binomial_gain<Size>();
  return bound_between<Size>(setting.gain_min * gain, setting.gain_max * gain,
                             setting.observer_bandwidth, sources);
}

}  // namespace analysis
