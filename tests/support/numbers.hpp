/// @file
/// Small numeric helpers of the tests: seeded data, exact comparison, hidden bad values.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

namespace esokit_test {

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool sanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif
#else
inline constexpr bool sanitized = false;
#endif

/// Steps of a long run: a fiftieth of `full` under the sanitizers, which look at each step and not
/// at what a million of them add up to.
constexpr int long_run(int full) { return sanitized ? full / 50 : full; }

/// Whether a loop of so many samples is left out: the sanitizers see the same steps in shorter
/// ones.
constexpr bool too_long(int samples) { return sanitized && samples > 50'000; }

/// The step through many cases that take the same way: every fifth under the sanitizers.
inline constexpr int stride = sanitized ? 5 : 1;

/// The lengths of gaps from `first` on that are tried where hundreds are bridged: each of the short
/// ones, of the longer ones those an eighth apart, and the longest.
inline std::vector<int> lengths(int first, int longest) {
  std::vector<int> all;
  for (int n = first; n < longest; n += std::max(stride, n / 8)) all.push_back(n);
  if (first <= longest) all.push_back(longest);
  return all;
}

/// splitmix64: the same numbers on every platform and standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t bits() {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30u)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27u)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31u);
  }

  /// In [low, high).
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(bits() >> 11u) * 0x1p-53);
  }

  double log_uniform(double low, double high) {
    return std::exp(uniform(std::log(low), std::log(high)));
  }

  /// In 0 .. count - 1.
  int index(int count) { return static_cast<int>(bits() % static_cast<std::uint64_t>(count)); }

 private:
  std::uint64_t state_;
};

/// Equal bit for bit; the padding of a long double does not count.
template <class T>
bool same_bits(T a, T b) {
  if constexpr (std::is_same_v<T, long double>) {
    return a == b && std::signbit(a) == std::signbit(b);
  } else {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
  }
}

/// A value that the optimiser knows nothing of, so that -ffast-math cannot reason about it.
template <class T>
T hidden(T value) {
  const volatile T opaque = value;
  return opaque;
}

/// A number from its bits, which the compiler does not see; std::numeric_limits is of no use under
/// -ffast-math.
template <class T>
T hidden_from_bits(std::uint32_t single, std::uint64_t twofold) {
  if constexpr (std::is_same_v<T, float>) {
    return std::bit_cast<float>(hidden(single));
  } else {
    return static_cast<T>(std::bit_cast<double>(hidden(twofold)));
  }
}

/// Quiet NaN.
template <class T>
T hidden_nan() {
  return hidden_from_bits<T>(0x7fc00000u, 0x7ff8000000000000u);
}

/// Infinity.
template <class T>
T hidden_infinity() {
  return hidden_from_bits<T>(0x7f800000u, 0x7ff0000000000000u);
}

/// Finite, but too large to compute with: 3e38 in float.
template <class T>
T huge() {
  return hidden(static_cast<T>(std::numeric_limits<T>::max() * T(0.88)));
}

inline double factorial_of(int n) {
  double product = 1;
  for (int i = 2; i <= n; ++i) product *= i;
  return product;
}

inline double choose(int n, int k) {
  double value = 1;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

/// T^r / r!: physical to scaled (Nordsieck).
inline long double nordsieck(int r, long double sample_time) {
  long double value = 1;
  for (int i = 1; i <= r; ++i) value *= sample_time / i;
  return value;
}

}  // namespace esokit_test
