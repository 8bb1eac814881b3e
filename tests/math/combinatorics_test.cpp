#include <gtest/gtest.h>

#include <cmath>
#include <esokit/math/combinatorics.hpp>

namespace math_combinatorics_test {

using namespace esokit;

TEST(Combinatorics, LiteralValues) {
  static_assert(factorial(0) == 1 && factorial(1) == 1 && factorial(5) == 120);
  static_assert(factorial(15) == 1307674368000.0);
  static_assert(binomial(0, 0) == 1 && binomial(4, 2) == 6 && binomial(16, 8) == 12870);
  static_assert(binomial(3, 4) == 0 && binomial(3, -1) == 0);
  // x (x+1) (x+2) (x+3) = x^4 + 6 x^3 + 11 x^2 + 6 x
  static_assert(unsigned_stirling_first(4, 0) == 0 && unsigned_stirling_first(4, 1) == 6);
  static_assert(unsigned_stirling_first(4, 2) == 11 && unsigned_stirling_first(4, 3) == 6);
  static_assert(unsigned_stirling_first(4, 4) == 1 && unsigned_stirling_first(0, 0) == 1);
  static_assert(unsigned_stirling_first(4, 5) == 0 && unsigned_stirling_first(4, -1) == 0);
  static_assert(unsigned_stirling_first(16, 1) == 1307674368000.0);
  static_assert(stirling_first(4, 1) == -6 && stirling_first(4, 2) == 11);
  static_assert(stirling_first(4, 3) == -6 && stirling_first(3, 1) == 2);
  static_assert(stirling_second(4, 2) == 7 && stirling_second(5, 3) == 25);
  static_assert(stirling_second(4, 0) == 0 && stirling_second(0, 0) == 1);
  static_assert(stirling_second(4, 5) == 0);
}

TEST(Combinatorics, ProductsAndSumsAtPoints) {
  // The definitions, at arguments where all is exact in double.
  for (int n = 0; n <= 12; ++n) {
    for (const double x : {1.0, 2.0, -3.0}) {
      double rising = 1;
      double falling = 1;
      for (int i = 0; i < n; ++i) {
        rising *= x + i;
        falling *= x - i;
      }
      double rising_sum = 0;
      double falling_sum = 0;
      double power_sum = 0;
      for (int k = 0; k <= n; ++k) {
        rising_sum += unsigned_stirling_first(n, k) * std::pow(x, k);
        falling_sum += stirling_first(n, k) * std::pow(x, k);
        double falling_k = 1;
        for (int i = 0; i < k; ++i) falling_k *= x - i;
        power_sum += stirling_second(n, k) * falling_k;
      }
      EXPECT_EQ(rising_sum, rising) << n << ' ' << x;
      EXPECT_EQ(falling_sum, falling) << n << ' ' << x;
      EXPECT_EQ(power_sum, std::pow(x, n)) << n << ' ' << x;
    }
  }
}

TEST(Combinatorics, SumsOverRows) {
  for (int n = 1; n <= 16; ++n) {
    double binomials = 0;
    double stirlings = 0;
    for (int k = 0; k <= n; ++k) {
      binomials += binomial(n, k);
      stirlings += unsigned_stirling_first(n, k);
    }
    EXPECT_EQ(binomials, std::ldexp(1.0, n));
    EXPECT_EQ(stirlings, factorial(n));
  }
}

}  // namespace math_combinatorics_test
