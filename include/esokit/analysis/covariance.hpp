/// @file
/// Exact stationary covariances under white noise.
#pragma once

#include <esokit/analysis/lyapunov.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/core/detail/compiled.hpp>

namespace esokit {

namespace detail {

/// `output_covariance` on the caller's storage. @param work 7 n^2
Check<double> output_covariance(const SystemView& system, const DenseView<const double>& input,
                                const DenseView<double>& result, double* work);

}  // namespace detail

/// Stationary covariance of all outputs, Outputs x Outputs, for white noise on the inputs.
/// @param input Inputs x Inputs. Sampled: covariance per sample. Continuous: two-sided spectral
///        density, unit^2 s (noise of variance v that is held for h has about v h)
/// @return error for an unstable system, an `input` that is not a covariance matrix, or an output
///         that receives continuous white noise directly (infinite variance) or whose variance
///         overflows
template <int States, int Inputs, int Outputs>
Expected<EigenMatrix<double, Outputs, Outputs>, Error<double>> output_covariance(
    const LinearSystem<States, Inputs, Outputs>& system,
    const EigenMatrix<double, Inputs, Inputs>& input) {
  EigenMatrix<double, Outputs, Outputs> result;
  Array<double, 7 * States * States> work;
  if (const auto ok = detail::output_covariance(detail::view_of(system), {input.data(), Inputs},
                                                {result.data(), Outputs}, work.data());
      !ok) {
    return ok.error();
  }
  return result;
}

/// The same for a system whose sizes are known at run time.
Expected<DynamicMatrix<double>, Error<double>> output_covariance(
    const DynamicSystem& system, const DynamicMatrix<double>& input);

/// The noise that drives the estimation error.
struct EstimationNoise {
  /// White noise on y. Sampled: variance per sample, unit of y^2. Continuous: two-sided spectral
  /// density, unit of y^2 s.
  double measurement = 0.0;
  /// White noise that drives d^(m), two-sided spectral density, (unit of d)^2 s^(1 - 2m): for m = 1
  /// d is a random walk whose variance grows by this number per second.
  double disturbance = 0.0;
};

/// Covariance of z - zhat, N x N, rows (y, .., y^(n-1), d, .., d^(m-1)), right after a correction.
///
/// The noise of the disturbance also acts between the samples; its effect over a sample is
/// integrated exactly. With disturbance = 0 the variances are those of the estimates themselves.
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
    // The integral of Phi(s) e_N e_N' Phi(s)' over a sample.
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

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/covariance.ipp>
#endif
