#pragma once

#include <cmath>
#include <complex>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/math/detail/dense.hpp>
#include <numbers>
#include <utility>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION std::complex<double> frequency_operator(double frequency,
                                                        double sample_time) noexcept {
  if (!(sample_time > 0.0)) return {0.0, frequency};
  const double angle = frequency * sample_time;
  const double half_sine = std::sin(0.5 * angle);
  return {-2.0 * half_sine * half_sine, std::sin(angle)};
}

ESOKIT_FUNCTION ComplexMatrix resolvent(const DynamicMatrix<double>& a, std::complex<double> value,
                                        ComplexMatrix b) {
  ComplexMatrix pencil(a.rows(), a.rows());
  for (int j = 0; j < a.rows(); ++j) {
    for (int i = 0; i < a.rows(); ++i) pencil(i, j) = -a(i, j);
    pencil(j, j) += value;
  }
  solve_in_place(pencil.view(), b.view());
  return b;
}

ESOKIT_FUNCTION ComplexMatrix seen(const DynamicMatrix<double>& c, const ComplexMatrix& x) {
  ComplexMatrix out(c.rows(), x.cols());
  for (int j = 0; j < x.cols(); ++j) {
    for (int k = 0; k < c.cols(); ++k) {
      for (int i = 0; i < c.rows(); ++i) out(i, j) += c(i, k) * x(k, j);
    }
  }
  return out;
}

ESOKIT_FUNCTION ComplexMatrix evaluate(const DynamicSystem& system, std::complex<double> value) {
  ComplexMatrix b(system.b.rows(), system.b.cols());
  for (int j = 0; j < b.cols(); ++j) {
    for (int i = 0; i < b.rows(); ++i) b(i, j) = system.b(i, j);
  }
  ComplexMatrix out = seen(system.c, resolvent(system.a, value, std::move(b)));
  for (int j = 0; j < out.cols(); ++j) {
    for (int i = 0; i < out.rows(); ++i) out(i, j) += system.d(i, j);
  }
  return out;
}

ESOKIT_FUNCTION Check<double> check_frequency(double frequency, double sample_time) {
  const double nyquist = std::numbers::pi / sample_time;
  return Rules<double>{}
      .not_negative("frequency", frequency)
      .demand(
          !(sample_time > 0.0) || esokit::detail::at_most(frequency, nyquist),
          {"frequency", frequency, "must not be above the Nyquist frequency", -1, nyquist, true});
}

}  // namespace detail

ESOKIT_FUNCTION Expected<DynamicMatrix<std::complex<double>>, Error<double>> frequency_response(
    const DynamicSystem& system, double frequency) {
  if (auto ok = detail::check_frequency(frequency, system.sample_time); !ok) return ok.error();
  auto response =
      detail::evaluate(system, detail::frequency_operator(frequency, system.sample_time));
  if (!detail::all_finite(response)) {
    return Error<double>{"frequency", frequency, "is a pole of the system"};
  }
  return response;
}

}  // namespace esokit
