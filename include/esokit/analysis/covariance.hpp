/// @file
/// Exact stationary covariances under white noise.
#pragma once

#include <esokit/analysis/lyapunov.hpp>
#include <esokit/analysis/observer_system.hpp>

namespace esokit {

/// Covariance of all outputs, Outputs x Outputs, for white noise on the inputs.
/// @param input Inputs x Inputs. Sampled: covariance per sample. Continuous: two-sided spectral
///        density, unit^2 s (a held noise of variance s^2 and hold h has about s^2 h)
/// @return error for an unstable system, an `input` that is no covariance, or an output to which
///         continuous white noise comes straight (its variance is infinite), or whose variance is
///         beyond the scalar
template <int States, int Inputs, int Outputs>
Expected<EigenMatrix<double, Outputs, Outputs>, Error<double>> output_covariance(
    const LinearSystem<States, Inputs, Outputs>& system,
    const EigenMatrix<double, Inputs, Inputs>& input) {
  Rules<double> rules;
  rules.all_of(detail::check_system(system));
  for (int i = 0; i < Inputs; ++i) {
    rules.not_negative("input", input(i, i), i);
    for (int j = 0; j < Inputs; ++j) {
      const double value = input(i, j);
      rules.require(is_finite(value) && value == input(j, i) &&
                        value * value <= input(i, i) * input(j, j) * (1.0 + 1e-12),
                    "input", value, "must be a covariance: symmetric and not indefinite", i);
    }
  }
  if (!rules) return rules.error();
  // sum_ij left(r, i) middle(i, j) left(s, j)
  const auto quadratic = [](const auto& left, const auto& middle, int r, int s) {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < middle.rows(); ++i) {
      for (Eigen::Index j = 0; j < middle.cols(); ++j)
        sum += left(r, i) * middle(i, j) * left(s, j);
    }
    return sum;
  };
  if (!system.sampled()) {
    for (int i = 0; i < Outputs; ++i) {
      if (const double direct = quadratic(system.d, input, i, i); direct > 0.0) {
        return Error<double>{"output", direct,
                             "sees continuous white noise directly: its variance is infinite", i};
      }
    }
  }
  EigenMatrix<double, States, States> q;
  for (int i = 0; i < States; ++i) {
    for (int j = 0; j < States; ++j) q(i, j) = quadratic(system.b, input, i, j);
  }
  const auto p = solve_lyapunov<States>(system.a, q, system.sampled());
  if (!p) return p.error();
  EigenMatrix<double, Outputs, Outputs> result;
  for (int i = 0; i < Outputs; ++i) {
    for (int j = 0; j < Outputs; ++j) {
      result(i, j) = quadratic(system.c, *p, i, j) + quadratic(system.d, input, i, j);
      if (!is_finite(result(i, j))) {
        return Error<double>{"output", result(i, j), "has a covariance that the scalar cannot hold",
                             i};
      }
    }
  }
  return result;
}

/// What drives the estimation error.
struct EstimationNoise {
  /// White noise on y. Sampled: variance of a sample, unit of y^2. Continuous: two-sided spectral
  /// density, unit of y^2 s.
  double measurement = 0.0;
  /// White noise that drives d^(m), two-sided spectral density, (unit of d)^2 s^(1 - 2m): for m = 1
  /// d is a random walk whose variance grows by this per second.
  double disturbance = 0.0;
};

/// Covariance of z - zhat, N x N, rows (y, .., y^(n-1), d, .., d^(m-1)), right after a correction.
///
/// The disturbance's noise acts between the samples too; its effect over a sample is integrated
/// exactly. With disturbance = 0 the variances are those of the estimates themselves.
/// @return error for a negative noise or an observer that is not stable
template <LinearObserver Observer>
Expected<EigenMatrix<double, Observer::order + Observer::extension,
                     Observer::order + Observer::extension>,
         Error<double>>
estimation_error_covariance(const Observer& observer, const EstimationNoise& noise,
                            double t = 0.0) {
  constexpr int size = Observer::order + Observer::extension;
  Rules<double> rules;
  rules.not_negative("measurement", noise.measurement)
      .not_negative("disturbance", noise.disturbance);
  if (!rules) return rules.error();
  const auto m = detail::observer_matrices(observer, t);
  LinearSystem<decltype(m)::states, size + 1, size> system;
  system.a = m.a;
  system.c = m.c;
  system.sample_time = m.sample_time;
  for (int i = 0; i < decltype(m)::states; ++i) {
    system.b(i, 0) = -m.by(i);
    system.b(i, 1 + i % size) = 1.0;
  }
  for (int r = 0; r < size; ++r) system.d(r, 0) = -m.dy(r);
  balance(system);
  EigenMatrix<double, size + 1, size + 1> input = EigenMatrix<double, size + 1, size + 1>::Zero();
  input(0, 0) = noise.measurement;
  if (m.sample_time > 0.0) {
    // integral of Phi(s) e_N e_N' Phi(s)' over a sample
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        const int p = size - 1 - i;
        const int q = size - 1 - j;
        input(i + 1, j + 1) = noise.disturbance * std::pow(m.sample_time, p + q + 1) /
                              (factorial(p) * factorial(q) * (p + q + 1));
      }
    }
  } else {
    input(size, size) = noise.disturbance;
  }
  return output_covariance(system, input);
}

}  // namespace esokit
