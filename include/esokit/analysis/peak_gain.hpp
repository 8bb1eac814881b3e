/// @file
/// The largest output that a bounded input can bring about: what is true of a linear observer where
/// a Lyapunov bound only promises.
#pragma once

#include <cmath>
#include <esokit/analysis/dense.hpp>
#include <esokit/analysis/poles.hpp>

namespace esokit {

/// Peak of each output for an input of size one, Outputs x Inputs: the sum (integral) of the
/// magnitude of the impulse response. Sharp: some input of size one comes as near to it as you
/// like.
///
/// Sampled systems: to 1e-9, where the sum is broken off. Continuous ones: by the trapezoid rule,
/// to about 1e-4.
/// @return error for a system that is not stable, or whose response lasts longer than 1e8 steps or
///         is beyond the scalar
template <int States, int Inputs, int Outputs>
Expected<EigenMatrix<double, Outputs, Inputs>, Error<double>> peak_gain(
    const LinearSystem<States, Inputs, Outputs>& system) {
  if (auto ok = detail::check_system(system); !ok) return ok.error();
  const double abscissa = stability_abscissa(system);
  if (!(abscissa < 0.0)) {
    return Error<double>{"stability_abscissa", abscissa, "must be negative: it is not stable"};
  }
  double step = 1.0;
  EigenMatrix<double, States, States> advance = system.a;
  if (!system.sampled()) {
    double fastest = 0.0;
    for (const std::complex<double>& p : poles(system)) fastest = std::max(fastest, std::abs(p));
    step = 0.01 / fastest;
    Array<double, 2 * States * States> work;
    advance *= step;
    detail::exp_minus_identity(advance.data(), work.data(), States);
  }

  EigenMatrix<double, Outputs, Inputs> peak;
  for (int input = 0; input < Inputs; ++input) {
    for (int r = 0; r < Outputs; ++r) peak(r, input) = std::abs(system.d(r, input));
    EigenMatrix<double, States> x;
    for (int i = 0; i < States; ++i) x(i) = system.b(i, input);
    long k = 0;
    for (;; ++k) {
      // The trapezoid rule counts the first value half; a sampled sum counts it whole.
      const double weight = system.sampled() || k > 0 ? step : 0.5 * step;
      bool ended = true;
      for (int r = 0; r < Outputs; ++r) {
        double response = 0.0;
        double size = 0.0;
        for (int i = 0; i < States; ++i) {
          response += system.c(r, i) * x(i);
          size += std::abs(system.c(r, i) * x(i));
        }
        peak(r, input) += weight * std::abs(response);
        // Relative to the end of a geometric sum.
        const double slowest = system.sampled() ? -abscissa : -abscissa * step;
        if (size * step > 1e-9 * slowest * peak(r, input)) ended = false;
      }
      if (ended && k > 2 * States) break;
      if (k > 100'000'000L) {
        return Error<double>{"stability_abscissa", abscissa, "is too slow for the sum to end"};
      }
      EigenMatrix<double, States> next;
      for (int i = 0; i < States; ++i) {
        double sum = x(i);
        for (int j = 0; j < States; ++j) sum += advance(i, j) * x(j);
        next(i) = sum;
      }
      x = next;
    }
    if (const double sum = peak.col(input).sum(); !is_finite(sum)) {
      return Error<double>{"system", sum, "has a response that the scalar cannot hold", input};
    }
  }
  return peak;
}

}  // namespace esokit
