/// @file
/// The noise settings of ExtendedStateFilter, checked and factored.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/detail/covariance_factor.hpp>
#include <esokit/gain/riccati_gain.hpp>

namespace esokit::detail {

/// The rules for the inflation.
template <Scalar S, class Config>
Check<S> check_inflation(const Config& config) {
  Rules<S> rules;
  if (config.inflation_rule == InflationRule::fixed) {
    rules.demand(all(is_finite(config.inflation)) && all(config.inflation > S(0.0)), "inflation",
                 config.inflation,
                 "must be finite and positive; the plain Kalman filter is InflationRule::none");
  } else {
    rules.left_out("inflation", config.inflation,
                   "must be left out unless inflation_rule is fixed");
  }
  return rules;
}

/// The config member from which Q is made.
template <class Config>
const char* noise_field(const Config& config) noexcept {
  return config.process_covariance ? "process_covariance" : "disturbance_bounds";
}

/// Finite, symmetric and without a negative variance.
template <int N, Scalar S>
Check<S> check_covariance(const char* field, const Matrix<S, N, N>& p) {
  Rules<S> rules;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) rules.finite(field, p(i, j), i * N + j);
    rules.demand(all(p(i, i) >= S(0.0)), field, p(i, i), "must be positive semidefinite",
                 i * N + i);
  }
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < i; ++j) {
      const S difference = absolute(S(p(i, j) - p(j, i)));
      const S bound = S(8.0) * rounding<S>() * absolute(p(i, j));
      rules.demand(all(difference <= bound), field, p(i, j), "must be symmetric", i * N + j);
    }
  }
  return rules;
}

/// Checks the bounds of the disturbance and writes their squares to Q.
/// @param twice state whose bound counts twice, -1: none
template <int N, Scalar S, class Config>
Check<S> add_bounds(const Config& config, Matrix<S, N, N>& q, int twice = -1) {
  Rules<S> rules;
  rules.positive("bound_factor", config.bound_factor);
  for (int i = 0; i < N; ++i) {
    const S& bound = config.disturbance_bounds[static_cast<std::size_t>(i)];
    rules.not_negative("disturbance_bounds", bound, i);
    if (!all(bound > S(0.0))) continue;
    const S whole = i == twice ? S(bound + bound) : bound;
    q(i, i) = config.bound_factor * whole * whole;
    rules
        .demand(!config.process_covariance, "disturbance_bounds", bound,
                "must be left out if process_covariance is given", i)
        .demand(normal(q(i, i)), "disturbance_bounds", bound,
                "has a square that the scalar cannot hold", i);
  }
  return rules;
}

/// True if a variance is far enough from both ends of the scalar's range for the recursion.
template <Scalar S>
bool is_held(const S& variance) noexcept {
  return all(is_finite(variance)) && all(variance > smallest_normal<S>() / rounding<S>()) &&
         all(variance < largest_variance<S>());
}

/// P with state i in units of `units[i]`. Reads the lower triangle.
template <int N, Scalar S>
Matrix<S, N, N> in_units(const Matrix<S, N, N>& p, const S* units) noexcept {
  Matrix<S, N, N> scaled;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j <= i; ++j) scaled(i, j) = scaled(j, i) = (p(i, j) * units[i]) * units[j];
  }
  return scaled;
}

/// The factor of P in these units, or an error.
/// @param held, semidefinite texts of the two rules @param place index in the error of the second
template <int N, Scalar S>
Expected<CovarianceFactor<N, S>, Error<S>> factored(const char* field, const Matrix<S, N, N>& p,
                                                    const S* units, const char* held,
                                                    const char* semidefinite, int place) {
  const Matrix<S, N, N> scaled = in_units(p, units);
  for (int i = 0; i < N; ++i) {
    if (all(p(i, i) > S(0.0)) && !is_held(scaled(i, i))) {
      return Error<S>{field, p(i, i), held, i * N + i};
    }
  }
  const auto factor = CovarianceFactor<N, S>::from_matrix(scaled);
  if (!factor) return Error<S>{field, p(N - 1, N - 1), semidefinite, place};
  return *factor;
}

/// The error for a limit with a pole at z = -1. @param least smallest variance that avoids it
template <Scalar S>
Error<S> alternating(const char* field, const S& variance, int place, const S& least) {
  return {field,
          variance,
          "does not damp an error that alternates in sign: give y' a bound, or y a variance of at "
          "least",
          place,
          least,
          true};
}

}  // namespace esokit::detail
