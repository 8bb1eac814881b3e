// fal and x^p: against the definitions, and without pow where a plain operation does it.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/math/fal.hpp>
#include <esokit/math/power.hpp>
#include <support/numbers.hpp>
#include <type_traits>

namespace counted {

/// A scalar that counts its calls of pow and sqrt.
struct Number {
  double value = 0;
  Number() = default;
  explicit Number(double v) : value(v) {}
  friend Number operator+(Number a, Number b) { return Number(a.value + b.value); }
  friend Number operator-(Number a, Number b) { return Number(a.value - b.value); }
  friend Number operator*(Number a, Number b) { return Number(a.value * b.value); }
  friend Number operator/(Number a, Number b) { return Number(a.value / b.value); }
  friend Number operator-(Number a) { return Number(-a.value); }
  friend bool operator<(Number a, Number b) { return a.value < b.value; }
  friend bool operator>(Number a, Number b) { return a.value > b.value; }
  friend bool operator>=(Number a, Number b) { return a.value >= b.value; }
};

inline int powers = 0;
inline int roots = 0;
inline Number pow(Number x, Number p) {
  ++powers;
  return Number(std::pow(x.value, p.value));
}
inline Number sqrt(Number x) {
  ++roots;
  return Number(std::sqrt(x.value));
}
inline bool is_finite(Number x) { return esokit::is_finite(x.value); }
inline Number select(bool condition, Number a, Number b) { return condition ? a : b; }

}  // namespace counted

namespace esokit_test {
namespace math_fal_test {

double printed_fal(double e, double a, double delta) {
  if (std::abs(e) <= delta) return e / std::pow(delta, 1 - a);
  return std::pow(std::abs(e), a) * (e > 0 ? 1 : -1);
}

TEST(Fal, EqualsTheDefinition) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const double a = random.uniform(0.05, 2.5);
    const double delta = random.log_uniform(1e-4, 1);
    const double e = random.log_uniform(1e-6, 1e3) * (i % 2 == 0 ? 1 : -1);
    const double expected = printed_fal(e, a, delta);
    EXPECT_NEAR(esokit::fal(e, a, delta), expected, 1e-13 * std::abs(expected));
  }
  EXPECT_EQ(esokit::fal(0.0, 0.5, 0.1), 0.0);
  EXPECT_EQ(esokit::fal(-0.3, 1.0, 0.1), -0.3);
}

/// Continuous at the edge of its linear piece, and odd.
TEST(Fal, ContinuousAndOdd) {
  const esokit::Fal<double> f(0.3, 0.02);
  EXPECT_NEAR(f(0.02 * (1 - 1e-12)), f(0.02 * (1 + 1e-12)), 1e-11);
  for (const double e : {0.001, 0.02, 0.5, 9.0}) EXPECT_EQ(f(-e), -f(e));
  EXPECT_EQ(f.gain(0), f.gain(0.02));
}

TEST(Fal, FloatStaysFloat) {
  static_assert(std::is_same_v<decltype(esokit::fal(1.0f, 0.5f, 0.1f)), float>);
  EXPECT_NEAR(static_cast<double>(esokit::fal(0.25f, 0.5f, 0.1f)), 0.5, 1e-6);
}

TEST(Power, EqualsPow) {
  for (const double p : {-0.9, -0.5, -0.2, 0.0, 0.1, 0.5, 1.0, 1.7, 2.0, 3.0}) {
    for (const double x : {1e-9, 0.3, 1.0, 17.0, 1e8}) {
      EXPECT_NEAR(esokit::Power<double>(p)(x), std::pow(x, p), 1e-15 * std::pow(x, p))
          << x << '^' << p;
    }
  }
}

TEST(Power, NoPowForPlainExponents) {
  using counted::Number;
  for (const double p : {0.0, 1.0, 2.0, 0.5, -0.5, 0.3}) {
    counted::powers = 0;
    counted::roots = 0;
    const esokit::Power<Number> power{Number(p)};
    EXPECT_NEAR(power(Number(7)).value, std::pow(7, p), 1e-14 * std::pow(7, p));
    EXPECT_EQ(counted::powers, p == 0.3 ? 1 : 0) << p;
    EXPECT_EQ(counted::roots, std::abs(p) == 0.5 ? 1 : 0) << p;
  }
}

}  // namespace math_fal_test
}  // namespace esokit_test
