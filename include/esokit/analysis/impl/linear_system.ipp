#pragma once

#include <cmath>
#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION void balance(DenseView<double> a, DenseView<double> b,
                             DenseView<double> c) noexcept {
  const int states = a.rows;
  for (int sweep = 0; sweep < 30; ++sweep) {
    bool changed = false;
    for (int i = 0; i < states; ++i) {
      double row = 0.0;
      double column = 0.0;
      for (int j = 0; j < states; ++j) {
        if (j == i) continue;
        row += (std::abs)(a(i, j));
        column += (std::abs)(a(j, i));
      }
      // Not finite if nothing couples to this state.
      const double exponent = (std::round)(0.5 * std::log2(row / column));
      if (!is_finite(exponent) || exponent == 0.0) continue;
      // x_i is replaced by x_i / 2^exponent.
      const double factor = std::exp2(exponent);
      for (int j = 0; j < states; ++j) a(i, j) /= factor;
      for (int j = 0; j < states; ++j) a(j, i) *= factor;
      for (int j = 0; j < b.columns; ++j) b(i, j) /= factor;
      for (int j = 0; j < c.rows; ++j) c(j, i) *= factor;
      changed = true;
    }
    if (!changed) return;
  }
}

ESOKIT_FUNCTION SystemView view_of(const DynamicSystem& system) noexcept {
  const auto part = [](const DynamicMatrix<double>& matrix) {
    return DenseView<const double>{matrix.data(), matrix.rows(), matrix.cols()};
  };
  return {part(system.a), part(system.b), part(system.c), part(system.d), system.sample_time};
}

ESOKIT_FUNCTION double sum_of_magnitudes(const DynamicMatrix<double>& matrix) noexcept {
  return sum_of_magnitudes(matrix.data(), matrix.rows() * matrix.cols());
}

ESOKIT_FUNCTION Check<double> check_system(const SystemView& system) {
  Rules<double> rules;
  if (!is_finite(system.sample_time) || system.sample_time < 0.0) {
    return Error<double>{"sample_time", system.sample_time, "must be finite and not negative"};
  }
  double sum = 0.0;
  for (const auto& part : {system.a, system.b, system.c, system.d}) {
    sum += sum_of_magnitudes(part.data, part.rows * part.columns);
  }
  return rules.finite("system", sum);
}

}  // namespace detail
}  // namespace esokit
