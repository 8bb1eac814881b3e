/// @file
/// A SIMD pack as a scalar of the library: an archetype that has what the Scalar concept names and
/// nothing more (no conversion to bool, no implicit construction).
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit_test {

template <int Width>
struct Mask {
  esokit::Array<bool, Width> lane{};
};

template <int Width>
bool all(const Mask<Width>& mask) {
  for (const bool set : mask.lane) {
    if (!set) return false;
  }
  return true;
}

template <class T, int Width>
class Pack {
 public:
  Pack() = default;
  explicit Pack(double value) { lane_.fill(static_cast<T>(value)); }
  explicit Pack(const esokit::Array<T, Width>& lanes) : lane_(lanes) {}

  template <class Index>
  T& operator[](Index i) {
    return lane_[static_cast<std::size_t>(i)];
  }
  template <class Index>
  const T& operator[](Index i) const {
    return lane_[static_cast<std::size_t>(i)];
  }

  friend Pack operator+(const Pack& a, const Pack& b) {
    return each(a, b, [](T x, T y) { return x + y; });
  }
  friend Pack operator-(const Pack& a, const Pack& b) {
    return each(a, b, [](T x, T y) { return x - y; });
  }
  friend Pack operator*(const Pack& a, const Pack& b) {
    return each(a, b, [](T x, T y) { return x * y; });
  }
  friend Pack operator/(const Pack& a, const Pack& b) {
    return each(a, b, [](T x, T y) { return x / y; });
  }
  friend Pack operator-(const Pack& a) {
    return each(a, a, [](T x, T) { return -x; });
  }
  friend Mask<Width> operator<(const Pack& a, const Pack& b) {
    return test(a, b, [](T x, T y) { return x < y; });
  }
  friend Mask<Width> operator>(const Pack& a, const Pack& b) { return b < a; }
  friend Mask<Width> operator>=(const Pack& a, const Pack& b) {
    return test(a, b, [](T x, T y) { return x >= y; });
  }

  friend Mask<Width> is_finite(const Pack& a) {
    return test(a, a, [](T x, T) { return esokit::is_finite(x); });
  }
  friend Pack select(const Mask<Width>& mask, const Pack& a, const Pack& b) {
    Pack result;
    for (std::size_t i = 0; i < Width; ++i) result[i] = mask.lane[i] ? a[i] : b[i];
    return result;
  }
  friend Pack exp(const Pack& a) {
    return each(a, a, [](T x, T) { return std::exp(x); });
  }
  friend Pack expm1(const Pack& a) {
    return each(a, a, [](T x, T) { return std::expm1(x); });
  }

 private:
  template <class F>
  static Pack each(const Pack& a, const Pack& b, F f) {
    Pack result;
    for (std::size_t i = 0; i < Width; ++i) result[i] = f(a[i], b[i]);
    return result;
  }
  template <class F>
  static Mask<Width> test(const Pack& a, const Pack& b, F f) {
    Mask<Width> mask;
    for (std::size_t i = 0; i < Width; ++i) mask.lane[i] = f(a[i], b[i]);
    return mask;
  }

  esokit::Array<T, Width> lane_{};
};

}  // namespace esokit_test

template <class T, int Width>
inline constexpr int esokit::lane_count<esokit_test::Pack<T, Width>> = Width;
