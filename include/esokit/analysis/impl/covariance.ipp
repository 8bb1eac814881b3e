#pragma once

#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/lyapunov.hpp>
#include <esokit/analysis/observer_system.hpp>

namespace esokit {

namespace detail {

/// sum_ij left(r, i) middle(i, j) left(s, j)
inline double quadratic(const DenseView<const double>& left, const DenseView<const double>& middle,
                        int r, int s) noexcept {
  double sum = 0.0;
  for (int i = 0; i < middle.rows; ++i) {
    for (int j = 0; j < middle.columns; ++j) sum += left(r, i) * middle(i, j) * left(s, j);
  }
  return sum;
}

ESOKIT_FUNCTION Check<double> output_covariance(const SystemView& system,
                                                const DenseView<const double>& input,
                                                const DenseView<double>& result, double* work) {
  const int n = system.states();
  Rules<double> rules;
  rules.all_of(check_system(system));
  for (int i = 0; i < input.rows; ++i) {
    rules.not_negative("input", input(i, i), i);
    for (int j = 0; j < input.rows; ++j) {
      const double value = input(i, j);
      rules.demand(is_finite(value) && value == input(j, i) &&
                       value * value <= input(i, i) * input(j, j) * (1.0 + 1e-12),
                   "input", value,
                   "must be a covariance matrix: symmetric and positive semidefinite", i);
    }
  }
  if (!rules) return rules.error();
  if (!system.sampled()) {
    for (int i = 0; i < system.outputs(); ++i) {
      const double direct = quadratic(system.d, input, i, i);
      rules.demand(!(direct > 0.0), "output", direct,
                   "receives continuous white noise directly: its variance is infinite", i);
    }
    if (!rules) return rules.error();
  }
  double* const p = work + n * n;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) work[j * n + i] = quadratic(system.b, input, i, j);
  }
  if (auto ok = solve_lyapunov(system.a.data, work, p, work + 2 * n * n, n, system.sampled());
      !ok) {
    return ok;
  }
  for (int i = 0; i < system.outputs(); ++i) {
    for (int j = 0; j < system.outputs(); ++j) {
      result(i, j) = quadratic(system.c, {p, n}, i, j) + quadratic(system.d, input, i, j);
      rules.demand(is_finite(result(i, j)), "output", result(i, j),
                   "has a covariance that the scalar cannot hold", i);
    }
  }
  return rules;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<DynamicMatrix<double>, Error<double>> output_covariance(
    const DynamicSystem& system, const DynamicMatrix<double>& input) {
  const int n = system.a.rows();
  if (input.rows() != system.b.cols() || input.cols() != system.b.cols()) {
    return Error<double>{"input",
                         static_cast<double>(input.rows()),
                         "must have a row and a column for each input, that is",
                         -1,
                         static_cast<double>(system.b.cols()),
                         true};
  }
  DynamicMatrix<double> result(system.c.rows(), system.c.rows());
  DynamicMatrix<double> work(n, 7 * n);
  if (const auto ok = detail::output_covariance(
          detail::view_of(system), {input.data(), input.rows()}, result.view(), work.data());
      !ok) {
    return ok.error();
  }
  return result;
}

}  // namespace esokit
