// A sum of small numbers that loses none, and what is built on it.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/math/detail/fine_sum.hpp>
#include <esokit/sim/trapezoid.hpp>
#include <limits>
#include <support/numbers.hpp>

namespace esokit_test {
namespace math_fine_sum_test {

using esokit::detail::FineSum;

/// Within a digit of the sum in long double, and nearer than that to a number beside it.
template <class S>
void loses_nothing() {
  Random random(3);
  for (int i = 0; i < 200; i += stride) {
    const auto start = static_cast<S>(random.uniform(-1, 1) * random.log_uniform(1e-3, 1e6));
    const S step = std::fabs(start) * std::numeric_limits<S>::epsilon() *
                   static_cast<S>(random.log_uniform(1e-3, 1e3));
    FineSum<S> sum(start);
    long double exact = static_cast<long double>(start);
    for (int k = 0; k < 5000; ++k) {
      const S x = static_cast<S>(random.uniform(-0.2, 1)) * step;
      sum.add(x);
      exact += static_cast<long double>(x);
    }
    const auto digit = static_cast<long double>(std::numeric_limits<S>::epsilon());
    const auto size = static_cast<long double>(std::fabs(start));
    EXPECT_LE(std::fabs(static_cast<long double>(sum.value()) - exact), digit * size);
    // What is kept beside the sum has the digits of eight digits of it.
    EXPECT_LE(std::fabs(static_cast<long double>(sum.minus(start)) -
                        (exact - static_cast<long double>(start))),
              5000 * (8 * digit * digit + std::numeric_limits<long double>::epsilon()) * size +
                  digit * std::fabs(exact - static_cast<long double>(start)));
  }
}

TEST(FineSum, DiffersFromAnother) {
  FineSum<float> sum(1e4f), other(1e4f);
  for (int k = 0; k < 30; ++k) sum.add(1e-4f);
  other.add(-2e-4f);
  EXPECT_NEAR(sum.minus(other), 3.2e-3f, 1e-9f);
  EXPECT_NEAR(other.minus(sum), -3.2e-3f, 1e-9f);
  EXPECT_EQ(sum.minus(sum), 0);
}

TEST(FineSum, LosesNothing) {
  loses_nothing<float>();
  loses_nothing<double>();
}

TEST(FineSum, OfWhatIsNotFiniteIsNotFinite) {
  FineSum<float> sum(1);
  sum.add(std::numeric_limits<float>::infinity());
  EXPECT_TRUE(std::isinf(sum.value()));
  sum.add(1);
  EXPECT_TRUE(std::isinf(sum.value()));
  FineSum<float> largest(std::numeric_limits<float>::max());
  largest.add(std::numeric_limits<float>::max());
  EXPECT_FALSE(std::isfinite(largest.value()));
  FineSum<float> nothing;
  nothing.add(std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(std::isnan(nothing.value()));
}

/// Of times near zero, and so exact: an integral of small segments beside a large one.
TEST(FineSum, IntegratesSmallSegmentsBesideALargeOne) {
  esokit::sim::Trapezoid<float> integral;
  ASSERT_TRUE(integral.add(-4096, 1));
  ASSERT_TRUE(integral.add(0, 1));
  const int samples = 100'000;
  for (int k = 1; k <= samples; ++k) ASSERT_TRUE(integral.add(static_cast<float>(k) * 0x1p-14f, 1));
  EXPECT_FLOAT_EQ(integral.value(), 4096 + samples * 0x1p-14f);
  EXPECT_FLOAT_EQ(integral.duration(), 4096 + samples * 0x1p-14f);
}

}  // namespace math_fine_sum_test
}  // namespace esokit_test
