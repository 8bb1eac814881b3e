/// @file
/// The exponential of a small matrix, in plain loops on the caller's storage, so that one
/// instantiation serves all sizes.
#pragma once

#include <cmath>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit::detail {

/// out = a b, all n x n, stored by columns; `out` is neither of them.
template <PlainScalar T>
constexpr void multiply(const T* a, const T* b, T* out, int n) noexcept {
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) out[j * n + i] = T(0);
    for (int k = 0; k < n; ++k) {
      const T factor = b[j * n + k];
      for (int i = 0; i < n; ++i) out[j * n + i] += a[k * n + i] * factor;
    }
  }
}

/// Largest sum of magnitudes of a row of a, n x n: the norm that goes with the largest component.
template <PlainScalar T>
constexpr T row_norm(const T* a, int n) noexcept {
  T largest(0);
  for (int i = 0; i < n; ++i) {
    T row(0);
    for (int j = 0; j < n; ++j) row += absolute(a[j * n + i]);
    if (!(row <= largest)) largest = row;  // a NaN stays
  }
  return largest;
}

/// exp(a) - I in place: Taylor series of a / 2^k, then squared k times as 2 E + E^2. Of an a that
/// is not finite, or too large, nothing is finite.
/// @param a n x n @param work 2 n^2 numbers
template <PlainScalar T>
constexpr void exp_minus_identity(T* a, T* work, int n) noexcept {
  T* const sum = work;
  T* const product = work + n * n;
  int squarings = 0;
  T scale(1);
  if (const T size = row_norm(a, n); is_finite(size)) {
    for (; size * scale > T(0.25); scale *= T(0.5)) ++squarings;
  }
  for (int i = 0; i < n * n; ++i) a[i] *= scale;
  // With norm 1/4 the terms fall below 1e-17 by the 12th. Horner, from the smallest.
  for (int i = 0; i < n * n; ++i) sum[i] = T(0);
  for (int i = 0; i < n; ++i) sum[i * n + i] = T(1);
  for (int k = 14; k >= 2; --k) {
    multiply(a, sum, product, n);
    for (int i = 0; i < n * n; ++i) sum[i] = product[i] / static_cast<T>(k);
    for (int i = 0; i < n; ++i) sum[i * n + i] += T(1);
  }
  multiply(a, sum, product, n);
  for (int i = 0; i < n * n; ++i) a[i] = product[i];
  for (int i = 0; i < squarings; ++i) {
    multiply(a, a, product, n);
    for (int j = 0; j < n * n; ++j) a[j] = T(2) * a[j] + product[j];
  }
}

/// exp(a) - I. In units that keep its elements of one size: below 1e-13 of the largest, with
/// squarings for norms to 2e4.
template <PlainScalar T, int Size>
constexpr Matrix<T, Size, Size> exp_minus_identity(Matrix<T, Size, Size> a) noexcept {
  std::array<T, static_cast<std::size_t>(2 * Size * Size)> work{};
  exp_minus_identity(a.data(), work.data(), Size);
  return a;
}

}  // namespace esokit::detail
