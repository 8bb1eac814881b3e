/// @file
/// Binomials, factorials and Stirling numbers of the first kind as compile-time doubles.
///
/// All of them are integers below 2^53 for the sizes of the library (order + extension <= 16), so
/// double holds them exactly.
#pragma once

namespace esokit {

/// n! for n >= 0.
constexpr double factorial(int n) noexcept {
  double product = 1.0;
  for (int i = 2; i <= n; ++i) product *= i;
  return product;
}

/// C(n, k); zero outside 0 <= k <= n.
constexpr double binomial(int n, int k) noexcept {
  if (k < 0 || k > n) return 0.0;
  double value = 1.0;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

/// Unsigned Stirling number of the first kind: x (x+1) .. (x+n-1) = sum_k c(n, k) x^k.
constexpr double unsigned_stirling_first(int n, int k) noexcept {
  if (k < 0 || k > n || n > 20) return 0.0;
  double row[21] = {1.0};
  for (int i = 1; i <= n; ++i) {
    for (int j = i; j >= 1; --j) row[j] = row[j - 1] + (i - 1) * row[j];
    row[0] = 0.0;
  }
  return row[k];
}

/// Signed Stirling number of the first kind: x (x-1) .. (x-n+1) = sum_k s(n, k) x^k.
constexpr double stirling_first(int n, int k) noexcept {
  const double magnitude = unsigned_stirling_first(n, k);
  return (n - k) % 2 == 0 ? magnitude : -magnitude;
}

/// Stirling number of the second kind: partitions of n things into k non-empty parts.
constexpr double stirling_second(int n, int k) noexcept {
  if (k < 0 || k > n || n > 20) return 0.0;
  double row[21] = {1.0};
  for (int i = 1; i <= n; ++i) {
    for (int j = i; j >= 1; --j) row[j] = row[j - 1] + j * row[j];
    row[0] = 0.0;
  }
  return row[k];
}

}  // namespace esokit
