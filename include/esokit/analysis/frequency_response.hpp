/// @file
/// Frequency responses of linear systems, logarithmic grids, and arrays for a Bode plot.
#pragma once

#include <cmath>
#include <complex>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/math/detail/dense.hpp>
#include <numbers>

namespace esokit {

namespace detail {

/// Value of D at a frequency: i omega, or exp(i omega T) - 1 without cancellation.
/// @param frequency rad/s @param sample_time s, 0: continuous
std::complex<double> frequency_operator(double frequency, double sample_time) noexcept;

/// c (value I - a)^-1 b + d; not finite at a pole.
template <int States, int Inputs, int Outputs>
EigenMatrix<std::complex<double>, Outputs, Inputs> evaluate(
    const LinearSystem<States, Inputs, Outputs>& system, std::complex<double> value) {
  using ComplexNumber = std::complex<double>;
  EigenMatrix<ComplexNumber, States, States> pencil;
  EigenMatrix<ComplexNumber, States, Inputs> x;
  for (int j = 0; j < States; ++j) {
    for (int i = 0; i < States; ++i) pencil(i, j) = -system.a(i, j);
    pencil(j, j) += value;
    for (int i = 0; i < Inputs; ++i) x(j, i) = system.b(j, i);
  }
  // Eigen stores row vectors by rows, which for a vector is the same.
  solve_in_place(DenseView<ComplexNumber>{pencil.data(), States},
                 DenseView<ComplexNumber>{x.data(), States, Inputs});
  EigenMatrix<ComplexNumber, Outputs, Inputs> response;
  for (int i = 0; i < Outputs; ++i) {
    for (int j = 0; j < Inputs; ++j) {
      ComplexNumber sum = system.d(i, j);
      for (int k = 0; k < States; ++k) sum += system.c(i, k) * x(k, j);
      response(i, j) = sum;
    }
  }
  return response;
}

using ComplexMatrix = DynamicMatrix<std::complex<double>>;

/// (value I - a)^-1 b.
ComplexMatrix resolvent(const DynamicMatrix<double>& a, std::complex<double> value,
                        ComplexMatrix b);

/// c x
ComplexMatrix seen(const DynamicMatrix<double>& c, const ComplexMatrix& x);

ComplexMatrix evaluate(const DynamicSystem& system, std::complex<double> value);

template <class MatrixType>
bool all_finite(const MatrixType& matrix) noexcept {
  for (int i = 0; i < matrix.rows(); ++i) {
    for (int j = 0; j < matrix.cols(); ++j) {
      const std::complex<double> value(matrix(i, j));
      if (!is_finite(value.real()) || !is_finite(value.imag())) return false;
    }
  }
  return true;
}

Check<double> check_frequency(double frequency, double sample_time);

}  // namespace detail

/// Response at one frequency, Outputs x Inputs.
///
/// For a sampled system it is the response from samples to samples, up to pi / T.
/// @param frequency omega, rad/s; 0 gives the static gain
/// @return error for a frequency that is negative, above pi / T, or a pole
template <int States, int Inputs, int Outputs>
Expected<EigenMatrix<std::complex<double>, Outputs, Inputs>, Error<double>> frequency_response(
    const LinearSystem<States, Inputs, Outputs>& system, double frequency) {
  if (auto ok = detail::check_frequency(frequency, system.sample_time); !ok) return ok.error();
  const EigenMatrix<std::complex<double>, Outputs, Inputs> response =
      detail::evaluate(system, detail::frequency_operator(frequency, system.sample_time));
  if (!detail::all_finite(response)) {
    return Error<double>{"frequency", frequency, "is a pole of the system"};
  }
  return response;
}

/// The same for a system whose sizes are known at run time.
Expected<DynamicMatrix<std::complex<double>>, Error<double>> frequency_response(
    const DynamicSystem& system, double frequency);

/// `Count` frequencies from `from` to `to`, evenly spaced in their logarithm, both ends included.
/// @param from, to rad/s, 0 < from < to
template <int Count>
Expected<Array<double, Count>, Error<double>> log_grid(double from, double to) {
  static_assert(Count >= 2, "esokit: a grid has at least two points");
  Rules<double> rules;
  rules.positive("from", from).above("to", to, from);
  if (!rules) return rules.error();
  Array<double, Count> grid{};
  const double step = std::log(to / from) / (Count - 1);
  for (int i = 0; i < Count; ++i) grid[static_cast<std::size_t>(i)] = from * std::exp(i * step);
  grid.back() = to;
  return grid;
}

/// Arrays for a Bode plot.
template <int Count>
struct Bode {
  Array<double, Count> frequency{};  ///< rad/s
  Array<double, Count> magnitude{};  ///< unit of the output per unit of the input
  Array<double, Count> decibel{};    ///< 20 log10 of the magnitude
  Array<double, Count> phase{};      ///< rad, without jumps; the first one in (-pi, pi]
};

/// Bode arrays of any response on a grid.
/// @param response response(omega), an Expected<std::complex<double>, Error<double>>
/// @return the first error of `response`
template <std::size_t Count, class Response>
Expected<Bode<static_cast<int>(Count)>, Error<double>> bode(const std::array<double, Count>& grid,
                                                            Response&& response) {
  Bode<static_cast<int>(Count)> curve;
  curve.frequency = grid;
  for (std::size_t i = 0; i < Count; ++i) {
    const Expected<std::complex<double>, Error<double>> value = response(grid[i]);
    if (!value) return value.error();
    curve.magnitude[i] = (std::abs)(*value);
    curve.decibel[i] = 20.0 * std::log10(curve.magnitude[i]);
    curve.phase[i] = std::arg(*value);
    if (i == 0) continue;
    const double turns = (curve.phase[i] - curve.phase[i - 1]) / (2.0 * std::numbers::pi);
    curve.phase[i] -= 2.0 * std::numbers::pi * (std::round)(turns);
  }
  return curve;
}

/// Bode arrays of one channel of a system.
template <int Input, int Output, std::size_t Count, int States, int Inputs, int Outputs>
Expected<Bode<static_cast<int>(Count)>, Error<double>> bode(
    const LinearSystem<States, Inputs, Outputs>& system, const std::array<double, Count>& grid) {
  const auto one = system.template channel<Input, Output>();
  return bode(grid, [&](double w) -> Expected<std::complex<double>, Error<double>> {
    const auto response = frequency_response(one, w);
    if (!response) return response.error();
    return std::complex<double>((*response)(0, 0));
  });
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/frequency_response.ipp>
#endif
