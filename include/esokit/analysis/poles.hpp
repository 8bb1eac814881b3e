/// @file
/// Poles of linear systems, and whether they are stable.
#pragma once

#include <complex>
#include <esokit/analysis/detail/eigenvalues.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <limits>
#include <vector>

namespace esokit {

namespace detail {

/// stability_abscissa of the given poles.
double worst_pole(const std::complex<double>* poles, std::size_t count, bool sampled) noexcept;

/// Poles of a matrix as stored in LinearSystem; not finite if the iteration fails.
std::vector<std::complex<double>> poles_of(const DynamicMatrix<double>& a);

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
std::vector<std::complex<double>> poles(const DynamicSystem& system);

double stability_abscissa(const DynamicSystem& system);

/// @}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/poles.ipp>
#endif
