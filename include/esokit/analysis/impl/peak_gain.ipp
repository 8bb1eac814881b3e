#pragma once

#include <cmath>
#include <esokit/analysis/peak_gain.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION Check<double> peak_gain(const SystemView& system, double abscissa, double fastest,
                                        const DenseView<double>& peak, double* work) {
  if (auto ok = check_system(system); !ok) return ok;
  if (!(abscissa < 0.0)) {
    return Error<double>{"stability_abscissa", abscissa, "must be negative: it is not stable"};
  }
  const int n = system.states();
  double* const advance = work;
  double* const x = work + 3 * n * n;
  double* const next = x + n;
  for (int i = 0; i < n * n; ++i) advance[i] = system.a.data[i];
  double step = 1.0;
  if (!system.sampled()) {
    step = 0.01 / fastest;
    for (int i = 0; i < n * n; ++i) advance[i] *= step;
    exp_minus_identity(advance, work + n * n, n);
  }
  for (int input = 0; input < system.inputs(); ++input) {
    for (int r = 0; r < system.outputs(); ++r) peak(r, input) = (std::abs)(system.d(r, input));
    for (int i = 0; i < n; ++i) x[i] = system.b(i, input);
    for (long k = 0;; ++k) {
      // The trapezoid rule takes half of the first value, the sum of a sampled system all of it.
      const double weight = system.sampled() || k > 0 ? step : 0.5 * step;
      bool ended = true;
      for (int r = 0; r < system.outputs(); ++r) {
        double response = 0.0;
        double size = 0.0;
        for (int i = 0; i < n; ++i) {
          response += system.c(r, i) * x[i];
          size += (std::abs)(system.c(r, i) * x[i]);
        }
        peak(r, input) += weight * (std::abs)(response);
        // Relative to the remainder of a geometric series.
        const double slowest = system.sampled() ? -abscissa : -abscissa * step;
        if (size * step > 1e-9 * slowest * peak(r, input)) ended = false;
      }
      if (ended && k > 2 * n) break;
      if (k > 100'000'000L) {
        return Error<double>{"stability_abscissa", abscissa,
                             "is too close to zero: the sum does not converge"};
      }
      for (int i = 0; i < n; ++i) {
        double sum = x[i];
        for (int j = 0; j < n; ++j) sum += advance[j * n + i] * x[j];
        next[i] = sum;
      }
      for (int i = 0; i < n; ++i) x[i] = next[i];
    }
    double sum = 0.0;
    for (int r = 0; r < system.outputs(); ++r) sum += peak(r, input);
    if (!is_finite(sum)) {
      return Error<double>{"system", sum, "has a response that the scalar cannot hold", input};
    }
  }
  return {};
}

}  // namespace detail

ESOKIT_FUNCTION Expected<DynamicMatrix<double>, Error<double>> peak_gain(
    const DynamicSystem& system) {
  double fastest = 0.0;
  for (const std::complex<double>& p : poles(system)) fastest = (std::max)(fastest, (std::abs)(p));
  DynamicMatrix<double> peak(system.c.rows(), system.b.cols());
  DynamicMatrix<double> work(system.a.rows(), 3 * system.a.rows() + 2);
  if (const auto ok = detail::peak_gain(detail::view_of(system), stability_abscissa(system),
                                        fastest, peak.view(), work.data());
      !ok) {
    return ok.error();
  }
  return peak;
}

}  // namespace esokit
