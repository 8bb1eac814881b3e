#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/detail/eigenvalues.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/analysis/poles.hpp>
#include <limits>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION double worst_pole(const std::complex<double>* poles, std::size_t count,
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

ESOKIT_FUNCTION std::vector<std::complex<double>> poles_of(const DynamicMatrix<double>& a) {
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

ESOKIT_FUNCTION std::vector<std::complex<double>> poles(const DynamicSystem& system) {
  return detail::poles_of(system.a);
}

ESOKIT_FUNCTION double stability_abscissa(const DynamicSystem& system) {
  const auto values = poles(system);
  return detail::worst_pole(values.data(), values.size(), system.sample_time > 0.0);
}

}  // namespace esokit
