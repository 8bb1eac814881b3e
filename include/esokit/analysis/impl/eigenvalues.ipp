#pragma once

#include <cmath>
#include <complex>
#include <esokit/analysis/detail/eigenvalues.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/detail/dense.hpp>
#include <utility>

namespace esokit::detail {

/// Transforms h to upper Hessenberg form by elimination with pivoting.
inline void to_hessenberg(DenseView<std::complex<double>> h) noexcept {
  const int n = h.rows;
  for (int m = 1; m + 1 < n; ++m) {
    int pivot = m;
    for (int i = m + 1; i < n; ++i) {
      if ((std::abs)(h(i, m - 1)) > (std::abs)(h(pivot, m - 1))) pivot = i;
    }
    if (pivot != m) {
      for (int j = 0; j < n; ++j) std::swap(h(m, j), h(pivot, j));
      for (int i = 0; i < n; ++i) std::swap(h(i, m), h(i, pivot));
    }
    if (h(m, m - 1) == 0.0) continue;
    for (int i = m + 1; i < n; ++i) {
      const std::complex<double> factor = h(i, m - 1) / h(m, m - 1);
      if (factor == 0.0) continue;
      for (int j = 0; j < n; ++j) h(i, j) -= factor * h(m, j);
      for (int k = 0; k < n; ++k) h(k, m) += factor * h(k, i);
    }
  }
}

/// The eigenvalue of ((h11, h12), (h21, h22)) that is closer to h22.
inline std::complex<double> wilkinson_shift(std::complex<double> h11, std::complex<double> h12,
                                            std::complex<double> h21,
                                            std::complex<double> h22) noexcept {
  const std::complex<double> half = 0.5 * (h11 - h22);
  const std::complex<double> product = h12 * h21;
  const std::complex<double> root = std::sqrt(half * half + product);
  const std::complex<double> one = half + root;
  const std::complex<double> other = half - root;
  const std::complex<double> larger = (std::abs)(one) > (std::abs)(other) ? one : other;
  return larger == 0.0 ? h22 : h22 - product / larger;
}

/// One shifted QR step on rows and columns low .. high of a Hessenberg matrix. The rest is not
/// updated, because only eigenvalues are needed.
inline void qr_step(DenseView<std::complex<double>> h, int low, int high,
                    std::complex<double> shift) noexcept {
  using ComplexNumber = std::complex<double>;
  // The rotation of rows k, k + 1 is applied to the columns one step later.
  double c_before = 0.0;
  ComplexNumber s_before = 0.0;
  for (int i = low; i <= high; ++i) h(i, i) -= shift;
  for (int k = low; k <= high; ++k) {
    double c = 1.0;
    ComplexNumber s = 0.0;
    if (k < high) {
      const double size = std::hypot((std::abs)(h(k, k)), (std::abs)(h(k + 1, k)));
      if (size > 0.0) {
        const double diagonal = (std::abs)(h(k, k));
        const ComplexNumber phase = diagonal > 0.0 ? h(k, k) / diagonal : ComplexNumber(1.0);
        c = diagonal / size;
        s = phase * std::conj(h(k + 1, k)) / size;
        for (int j = k; j <= high; ++j) {
          const ComplexNumber upper = h(k, j);
          const ComplexNumber lower = h(k + 1, j);
          h(k, j) = c * upper + s * lower;
          h(k + 1, j) = -std::conj(s) * upper + c * lower;
        }
      }
    }
    if (k > low) {
      for (int i = low; i <= k; ++i) {
        const ComplexNumber left = h(i, k - 1);
        const ComplexNumber right = h(i, k);
        h(i, k - 1) = c_before * left + std::conj(s_before) * right;
        h(i, k) = -s_before * left + c_before * right;
      }
    }
    c_before = c;
    s_before = s;
  }
  for (int i = low; i <= high; ++i) h(i, i) += shift;
}

ESOKIT_FUNCTION bool eigenvalues(DenseView<std::complex<double>> h,
                                 std::complex<double>* values) noexcept {
  const int n = h.rows;
  double size = 0.0;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) size += (std::abs)(h(i, j));
  }
  if (!is_finite(size)) return false;
  to_hessenberg(h);
  int high = n - 1;
  int steps = 0;
  while (high >= 0) {
    int low = high;
    for (; low > 0; --low) {
      const double beside = (std::abs)(h(low, low)) + (std::abs)(h(low - 1, low - 1));
      if ((std::abs)(h(low, low - 1)) <= 1e-16 * (beside > 0.0 ? beside : size)) break;
    }
    if (low > 0) h(low, low - 1) = 0.0;
    if (low == high) {
      values[high] = h(high, high);
      --high;
      steps = 0;
      continue;
    }
    if (++steps > 200) return false;
    std::complex<double> shift =
        wilkinson_shift(h(high - 1, high - 1), h(high - 1, high), h(high, high - 1), h(high, high));
    // An exceptional shift, to leave a cycle.
    if (steps % 20 == 0) shift += (std::abs)(h(high, high - 1));
    qr_step(h, low, high, shift);
  }
  return true;
}

}  // namespace esokit::detail
