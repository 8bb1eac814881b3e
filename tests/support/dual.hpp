/// @file
/// A dual number (forward-mode autodiff) as a scalar of the library.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <esokit/core/scalar.hpp>

namespace esokit_test {

/// value + derivative epsilon, epsilon^2 = 0.
struct Dual {
  double value = 0;
  double derivative = 0;

  Dual() = default;
  explicit Dual(double v, double d = 0) : value(v), derivative(d) {}

  friend Dual operator+(const Dual& a, const Dual& b) {
    return Dual(a.value + b.value, a.derivative + b.derivative);
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    return Dual(a.value - b.value, a.derivative - b.derivative);
  }
  friend Dual operator*(const Dual& a, const Dual& b) {
    return Dual(a.value * b.value, a.value * b.derivative + a.derivative * b.value);
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const double ratio = a.value / b.value;
    return Dual(ratio, (a.derivative - ratio * b.derivative) / b.value);
  }
  friend Dual operator-(const Dual& a) { return Dual(-a.value, -a.derivative); }
  friend bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
  friend bool operator>=(const Dual& a, const Dual& b) { return a.value >= b.value; }

  friend bool is_finite(const Dual& a) {
    return esokit::is_finite(a.value) && esokit::is_finite(a.derivative);
  }
  friend Dual select(bool condition, const Dual& a, const Dual& b) { return condition ? a : b; }
  friend Dual exp(const Dual& a) {
    const double exponential = std::exp(a.value);
    return Dual(exponential, exponential * a.derivative);
  }
  friend Dual expm1(const Dual& a) {
    return Dual(std::expm1(a.value), std::exp(a.value) * a.derivative);
  }
};

}  // namespace esokit_test
