/// @file
/// Poles of linear systems, and whether they are stable.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/eigenvalues.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <limits>
#include <vector>

namespace esokit {

namespace detail {

/// stability_abscissa of the given poles.
inline double worst_pole(const std::complex<double>* poles, std::size_t count,
                         bool sampled) noexcept {
  double worst = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    const std::complex<double> p = poles[i];
    // |1 + p| - 1 = (2 Re p + |p|^2) / (|1 + p| + 1)
    const double excess =
        sampled ? (2.0 * p.real() + std::norm(p)) / ((std::abs)(1.0 + p) + 1.0) : p.real();
    if (!is_finite(excess)) return std::numeric_limits<double>::infinity();
    worst = (std::max)(worst, excess);
  }
  return worst;
}

/// Poles of a matrix as stored in LinearSystem; not finite if the iteration fails.
inline std::vector<std::complex<double>> poles_of(const DynamicMatrix<double>& a) {
  DynamicMatrix<std::complex<double>> work(a.rows(), a.rows());
  for (int j = 0; j < a.rows(); ++j) {
    for (int i = 0; i < a.rows(); ++i) work(i, j) = a(i, j);
  }
  std::vector<std::complex<double>> values(static_cast<std::size_t>(a.rows()));
  if (!eigenvalues(work.view(), values.data())) {
    for (auto& value : values) value = std::numeric_limits<double>::quiet_NaN();
  }
  return values;
}

}  // namespace detail

/// Poles of a system: for a continuous one the eigenvalues of A (1/s), for a sampled one z - 1,
/// which keeps the digits of slow poles. N equal poles are computed with a spread of about
/// eps^(1/N) of their size.
template <int States, int Inputs, int Outputs>
EigenMatrix<std::complex<double>, States> poles(
    const LinearSystem<States, Inputs, Outputs>& system) {
  using ComplexNumber = std::complex<double>;
  EigenMatrix<ComplexNumber, States, States> work;
  for (int j = 0; j < States; ++j) {
    for (int i = 0; i < States; ++i) work(i, j) = system.a(i, j);
  }
  EigenMatrix<ComplexNumber, States> values;
  if (!detail::eigenvalues({work.data(), States}, values.data())) {
    values.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return values;
}

/// Distance of the worst pole from the stability limit, negative if stable: the largest real part
/// (1/s), for a sampled system the largest |z| - 1.
template <int States, int Inputs, int Outputs>
double stability_abscissa(const LinearSystem<States, Inputs, Outputs>& system) {
  const auto values = poles(system);
  return detail::worst_pole(values.data(), States, system.sampled());
}

/// Largest |z| of a sampled system.
template <int States, int Inputs, int Outputs>
double spectral_radius(const LinearSystem<States, Inputs, Outputs>& system) {
  return 1.0 + stability_abscissa(system);
}

/// The same for a system whose sizes are known at run time. @{
inline std::vector<std::complex<double>> poles(const DynamicSystem& system) {
  return detail::poles_of(system.a);
}
inline double stability_abscissa(const DynamicSystem& system) {
  const auto values = poles(system);
  return detail::worst_pole(values.data(), values.size(), system.sample_time > 0.0);
}
/// @}

}  // namespace esokit
