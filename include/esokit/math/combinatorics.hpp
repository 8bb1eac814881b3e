/// @file
/// Binomials, factorials and Stirling numbers of both kinds as compile-time doubles.
///
/// All of them are integers below 2^53 for the sizes of the library (order + extension <= 16), so
/// double holds them exactly.
#pragma once

#include <array>
#include <cstddef>
#include <esokit/core/language.hpp>

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

/// C(n, k) for n and k from 0 to Most, as T. For loops that are not unrolled: there float code
/// would call `binomial` at run time, which a single-precision target computes in software.
template <int Most, class T>
inline constexpr auto binomial_table = [] {
  constexpr auto count = static_cast<std::size_t>(Most) + 1;
  std::array<std::array<T, count>, count> table{};
  for (std::size_t n = 0; n < count; ++n) {
    for (std::size_t k = 0; k < count; ++k) {
      table[n][k] = static_cast<T>(binomial(static_cast<int>(n), static_cast<int>(k)));
    }
  }
  return table;
}();

/// Unsigned Stirling number of the first kind: x (x+1) .. (x+n-1) = sum_k c(n, k) x^k. Zero outside
/// 0 <= k <= n <= 20.
constexpr double unsigned_stirling_first(int n, int k) noexcept {
  if (k < 0 || k > n || n > 20) return 0.0;
  double row[21] = {1.0};
  for (int i = 1; i <= n; ++i) {
    for (int j = i; j >= 1; --j) row[j] = row[j - 1] + (i - 1) * row[j];
    row[0] = 0.0;
  }
  return row[k];
}

/// Signed Stirling number of the first kind: x (x-1) .. (x-n+1) = sum_k s(n, k) x^k. Zero outside
/// 0 <= k <= n <= 20.
constexpr double stirling_first(int n, int k) noexcept {
  const double magnitude = unsigned_stirling_first(n, k);
  return (n - k) % 2 == 0 ? magnitude : -magnitude;
}

/// Stirling number of the second kind: partitions of n things into k non-empty parts. Zero outside
/// 0 <= k <= n <= 20.
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
