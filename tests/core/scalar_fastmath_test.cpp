// is_finite under -ffast-math, where the compiler may assume that there are no NaNs.
#include <gtest/gtest.h>

#include <esokit/core/scalar.hpp>
#include <limits>
#include <support/numbers.hpp>

namespace {

template <class T>
class FastMath : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, long double>;
TYPED_TEST_SUITE(FastMath, Scalars);

TYPED_TEST(FastMath, IsFiniteStillTells) {
  using T = TypeParam;
  for (const T good : {T(0), T(1), std::numeric_limits<T>::max(), std::numeric_limits<T>::min()}) {
    EXPECT_TRUE(esokit::is_finite(esokit_test::hidden(good)));
  }
  for (const T bad : {esokit_test::hidden_nan<T>(), esokit_test::hidden_infinity<T>(),
                      -esokit_test::hidden_infinity<T>()}) {
    EXPECT_FALSE(esokit::is_finite(bad));
  }
}

TYPED_TEST(FastMath, IsFiniteSeesWhatASumBecame) {
  using T = TypeParam;
  const T big = esokit_test::huge<T>();
  EXPECT_FALSE(esokit::is_finite(big + big));
  EXPECT_FALSE(esokit::is_finite(-big * big));
}

}  // namespace
