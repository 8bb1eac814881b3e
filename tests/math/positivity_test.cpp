// Polynomials that are positive on the half line, Routh's test, and the bilinear map of a gain set.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <esokit/gain/certificate/error_polynomial.hpp>
#include <esokit/math/positivity.hpp>
#include <support/numbers.hpp>
#include <vector>

namespace esokit_test {
namespace math_positivity_test {

using esokit::positive_on_half_line;

/// Product of (x^2 - 2 a x + a^2 + b) (roots a +- i sqrt(b)) and (x + c).
std::array<double, 4> cubic(double a, double b, double c) {
  return {c * (a * a + b), a * a + b - 2 * a * c, c - 2 * a, 1};
}

TEST(PositiveOnHalfLine, DoubleRootIsTheBorder) {
  for (const double a : {1e-3, 0.1, 1.0, 7.0, 1e3}) {
    for (const double c : {0.01, 1.0, 50.0}) {
      EXPECT_TRUE((positive_on_half_line<3, double>(cubic(a, 1e-10 * a * a, c)))) << a << ' ' << c;
      EXPECT_FALSE((positive_on_half_line<3, double>(cubic(a, -1e-10 * a * a, c))))
          << a << ' ' << c;
      EXPECT_TRUE((positive_on_half_line<3, double>(cubic(-a, 0, c))));  // on the other side
    }
  }
}

TEST(PositiveOnHalfLine, EndsCount) {
  EXPECT_FALSE((positive_on_half_line<2, double>({0.0, 1.0, 1.0})));
  EXPECT_FALSE((positive_on_half_line<2, double>({1.0, 1.0, 0.0})));
  EXPECT_FALSE((positive_on_half_line<2, double>({-1.0, 1.0, 1.0})));
  EXPECT_FALSE((positive_on_half_line<2, double>({1.0, 1.0, -1e-9})));
  EXPECT_FALSE((positive_on_half_line<2, double>({1.0, hidden_nan<double>(), 1.0})));
  EXPECT_FALSE((positive_on_half_line<2, double>({1.0, hidden_infinity<double>(), 1.0})));
  EXPECT_TRUE((positive_on_half_line<2, double>({1.0, 0.0, 1.0})));
  EXPECT_TRUE((positive_on_half_line<2, double>({1.0, -1.9999, 1.0})));
  EXPECT_FALSE((positive_on_half_line<2, double>({1.0, -2.0001, 1.0})));
}

/// Random polynomials of degree 9 against their smallest value on a fine grid.
TEST(PositiveOnHalfLine, AgreesWithScan) {
  Random random(3);
  int yes = 0;
  int no = 0;
  for (int i = 0; i < 2000; ++i) {
    std::array<double, 10> c{};
    for (double& x : c) x = random.uniform(-20, 30);
    c[0] = random.uniform(0.1, 2);
    c[9] = random.uniform(0.1, 2);
    double least = 1e9;
    for (int k = 0; k <= 1000; ++k) {
      const double t = k / 1000.0;
      double sum = 0;
      for (std::size_t j = 0; j < 10; ++j) {
        sum += c[j] * std::pow(t, static_cast<double>(j)) *
               std::pow(1 - t, 9 - static_cast<double>(j));
      }
      least = std::min(least, sum);
    }
    if (std::abs(least) < 1e-5) continue;  // the grid may miss the minimum
    const bool found = positive_on_half_line<9, double>(c);
    EXPECT_EQ(found, least > 0) << least;
    (found ? yes : no) += 1;
  }
  EXPECT_GT(yes, 300);
  EXPECT_GT(no, 50);
}

/// A pack is positive if all its lanes are.
TEST(IsHurwitz, AgreesWithRoots) {
  Random random(9);
  int stable = 0;
  for (int i = 0; i < 2000; ++i) {
    // Five poles: two pairs and a real one.
    std::vector<std::complex<double>> p{1.0};
    bool expected = true;
    const auto times = [&](std::complex<double> root) {
      p.emplace_back(0.0);
      for (std::size_t j = p.size() - 1; j > 0; --j) p[j] = p[j - 1] - root * p[j];
      p[0] *= -root;
    };
    for (int pair = 0; pair < 2; ++pair) {
      const double re = random.uniform(-1, 0.2);
      const double im = random.uniform(0, 3);
      times({re, im});
      times({re, -im});
      expected = expected && re < 0;
    }
    const double last = random.uniform(-1, 0.1);
    times(last);
    expected = expected && last < 0;
    esokit::ErrorPolynomial<5, double> q{};
    for (std::size_t j = 0; j < 6; ++j) q[j] = p[j].real();
    EXPECT_EQ((esokit::is_hurwitz<5, double>(q)), expected);
    stable += expected ? 1 : 0;
  }
  EXPECT_GT(stable, 300);
}

/// Equal poles at rho give prod((1 - rho) + (1 + rho) s) / 2^N with z = (1 + s) / (1 - s), for
/// every omega T: no cancellation.
template <int N>
void bilinear_of_equal_poles() {
  for (const double omega_t : {1e-4, 0.01, 0.5, 2.0, 40.0}) {
    const auto poles = esokit::EqualSampledPoles<N, double>::from_bandwidth(omega_t, 1.0);
    const double a = poles.contraction;
    const double h = 1.7 * std::min(a, 1.0);
    const auto q =
        esokit::error_polynomial<N, double>(esokit::current_gain<N, double>(poles.weights()), h);
    for (int i = 0; i <= N; ++i) {
      // s -> h s / 2, divided by h^N: prod(a / h + (2 - a) s / 2).
      const double expected = choose(N, i) * std::pow((2 - a) / 2, i) * std::pow(a / h, N - i);
      EXPECT_NEAR(q[static_cast<std::size_t>(i)], expected, 1e-13 * N * std::pow(2, N) * expected)
          << "N = " << N << ", omega T = " << omega_t << ", i = " << i;
    }
  }
}

TEST(ErrorPolynomial, BilinearMapOfEqualPoles) {
  bilinear_of_equal_poles<2>();
  bilinear_of_equal_poles<3>();
  bilinear_of_equal_poles<5>();
  bilinear_of_equal_poles<8>();
}

}  // namespace math_positivity_test
}  // namespace esokit_test
