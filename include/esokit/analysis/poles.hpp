/// @file
/// Poles of linear systems, and whether they are stable.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/dense.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <limits>

namespace esokit {

/// Poles: eigenvalues of A for a continuous system (1/s); for a sampled one z - 1, which keeps the
/// digits of slow poles. N poles in one place come out spread by about eps^(1/N) of their size.
template <int States, int Inputs, int Outputs>
EigenMatrix<std::complex<double>, States> poles(
    const LinearSystem<States, Inputs, Outputs>& system) {
  using Complex = std::complex<double>;
  EigenMatrix<Complex, States, States> work;
  for (int j = 0; j < States; ++j) {
    for (int i = 0; i < States; ++i) work(i, j) = system.a(i, j);
  }
  EigenMatrix<Complex, States> values;
  if (!detail::eigenvalues({work.data(), States}, values.data())) {
    values.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return values;
}

/// How far the worst pole is on the stable side: negative is stable. The largest real part (1/s),
/// or for a sampled system the largest |z| - 1.
template <int States, int Inputs, int Outputs>
double stability_abscissa(const LinearSystem<States, Inputs, Outputs>& system) {
  double worst = -std::numeric_limits<double>::infinity();
  for (const std::complex<double>& p : poles(system)) {
    // |1 + p| - 1 = (2 Re p + |p|^2) / (|1 + p| + 1)
    const double excess =
        system.sampled() ? (2.0 * p.real() + std::norm(p)) / (std::abs(1.0 + p) + 1.0) : p.real();
    if (!is_finite(excess)) return std::numeric_limits<double>::infinity();
    worst = std::max(worst, excess);
  }
  return worst;
}

/// Largest |z| of a sampled system.
template <int States, int Inputs, int Outputs>
double spectral_radius(const LinearSystem<States, Inputs, Outputs>& system) {
  return 1.0 + stability_abscissa(system);
}

}  // namespace esokit
