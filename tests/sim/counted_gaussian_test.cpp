// CountedGaussian: the generator against its authors' known answers, the normal numbers against
// long double and against the distribution that they should have, lanes against runs alone.
#include <Random123/threefry.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <esokit/core/pack.hpp>
#include <esokit/sim/counted_gaussian.hpp>
#include <limits>
#include <vector>

namespace sim_counted_gaussian_test {

using esokit::lane_count;
using esokit::LaneScalar;
using esokit::Pack;
using esokit::detail::number_of_lane;
using esokit::sim::CountedGaussian;
using esokit::sim::RandomStream;

struct KnownAnswer {
  std::uint64_t counter[2], key[2], answer[2];
};

// Random123 of D. E. Shaw Research, tests/kat_vectors, threefry2x64 13.
constexpr std::uint64_t ones = ~std::uint64_t{0};
constexpr KnownAnswer known[] = {
    {{0, 0}, {0, 0}, {0xf167b032c3b480bd, 0xe91f9fee4b7a6fb5}},
    {{ones, ones}, {ones, ones}, {0xccdec5c917a874b1, 0x4df53abca26ceb01}},
    {{0x243f6a8885a308d3, 0x13198a2e03707344},
     {0xa4093822299f31d0, 0x082efa98ec4e6c89},
     {0xc3aac71561042993, 0x3fe7ae8801aff316}}};

TEST(Threefry, GivesTheKnownAnswers) {
  for (const KnownAnswer& one : known) {
    std::uint64_t first = one.counter[0];
    std::uint64_t second = one.counter[1];
    esokit::sim::detail::Threefry(one.key[0], one.key[1])(first, second);
    EXPECT_EQ(first, one.answer[0]);
    EXPECT_EQ(second, one.answer[1]);
  }
}

// The authors' own program (Debian: librandom123-dev), for any counters and keys.
TEST(Threefry, IsThatOfItsAuthors) {
  const esokit::sim::detail::Threefry dice(1, 2);
  for (std::uint64_t i = 0; i < 20000; ++i) {
    std::uint64_t word[4] = {i, 0, i, 1};
    dice(word[0], word[1]);
    dice(word[2], word[3]);
    const auto theirs =
        threefry2x64_R(13, threefry2x64_ctr_t{{word[0], word[1]}}, {{word[2], word[3]}});
    esokit::sim::detail::Threefry(word[2], word[3])(word[0], word[1]);
    ASSERT_EQ(word[0], theirs.v[0]) << i;
    ASSERT_EQ(word[1], theirs.v[1]) << i;
  }
}

// Radius of the 40 upper bits, angle of the 24 others, of which two choose the quarter.
TEST(NormalPair, IsThatOfLongDoubleForTheSameBits) {
  const esokit::sim::detail::Threefry random(5, 6);
  const long double quarter = std::acos(-1.0L) / 2;
  constexpr std::uint64_t extremes[] = {
      0, ones, 0xFFFFFFFFFF000000, 0x0000000000FFFFFF, 0x8000000000000000, 0xFFFFFFFFFE000001};
  for (std::uint64_t i = 0; i < 20000; ++i) {
    std::uint64_t bits = i;
    std::uint64_t unused = 0;
    random(bits, unused);
    if (i < std::size(extremes)) bits = extremes[i];
    double first = 0;
    double second = 0;
    esokit::sim::detail::normal_pair(bits, first, second);
    const long double share = 1 - std::ldexp(static_cast<long double>(bits >> 24), -40);
    const long double radius = std::sqrt(-2 * std::log(share));
    const auto place = static_cast<long double>((bits >> 2) & 0x3FFFFF);
    const long double angle = quarter * (std::ldexp(place + 0.5L, -22) - 0.5L);
    const bool other = (bits & 1) != 0;
    const long double sign = (bits & 2) != 0 ? -1 : 1;
    const long double along = sign * radius * std::cos(angle);
    const long double across = sign * radius * std::sin(angle);
    // Each of the functions is right to a few ulp; near 1 so is the share's logarithm.
    const long double tolerance = 8 * std::numeric_limits<double>::epsilon();
    EXPECT_NEAR(first, static_cast<double>(other ? across : along),
                static_cast<double>(tolerance * radius));
    EXPECT_NEAR(second, static_cast<double>(other ? along : across),
                static_cast<double>(tolerance * radius));
  }
}

/// How many deviations of its own a mean of `count` numbers of this variance is off.
double off(double sum, double expected, double variance, double count) {
  return (sum / count - expected) / std::sqrt(variance / count);
}

// Fixed seeds: a limit of 4 deviations is not met by chance, and what it finds at 4e6 numbers is a
// mean off by 0.002, a variance by 0.3 %.
TEST(CountedGaussian, HasMomentsAndNoCorrelation) {
  constexpr int runs = 2000;
  constexpr int numbers = 2000;
  double sums[4] = {};
  double lag1 = 0, lag2 = 0, next_run = 0, squares = 0, other_stream = 0;
  std::vector<double> before(numbers);
  for (int run = 0; run < runs; ++run) {
    CountedGaussian<> gaussian(17, RandomStream::noise, static_cast<std::uint64_t>(run));
    CountedGaussian<> other(17, RandomStream::noise, static_cast<std::uint64_t>(run), 1);
    double last = 0, last_but_one = 0;
    for (double& earlier : before) {
      const double x = gaussian.next();
      for (double power = x; double& sum : sums) {
        sum += power;
        power *= x;
      }
      lag1 += x * last;
      lag2 += x * last_but_one;
      next_run += x * earlier;
      squares += (x * x - 1) * (earlier * earlier - 1);
      other_stream += x * other.next();
      last_but_one = last;
      last = x;
      earlier = x;
    }
  }
  constexpr double count = 1.0 * runs * numbers;
  EXPECT_LT(std::abs(off(sums[0], 0, 1, count)), 4);
  EXPECT_LT(std::abs(off(sums[1], 1, 2, count)), 4);
  EXPECT_LT(std::abs(off(sums[2], 0, 15, count)), 4);
  EXPECT_LT(std::abs(off(sums[3], 3, 96, count)), 4);
  EXPECT_LT(std::abs(off(lag1, 0, 1, count)), 4);
  EXPECT_LT(std::abs(off(lag2, 0, 1, count)), 4);
  EXPECT_LT(std::abs(off(next_run, 0, 1, count)), 4);
  EXPECT_LT(std::abs(off(squares, 0, 4, count)), 4);
  EXPECT_LT(std::abs(off(other_stream, 0, 1, count)), 4);
}

/// (chi^2 - degrees of freedom) in its deviations, for numbers in [0, 1) that should be uniform.
template <class Next>
double uniformity(Next next) {
  constexpr int bins = 500;
  constexpr int count = 1000000;
  std::vector<int> found(bins);
  for (int i = 0; i < count; ++i) ++found[static_cast<std::size_t>(next() * bins)];
  double chi_square = 0;
  for (const int n : found) {
    const double expected = 1.0 * count / bins;
    chi_square += (n - expected) * (n - expected) / expected;
  }
  return (chi_square - (bins - 1)) / std::sqrt(2.0 * (bins - 1));
}

TEST(CountedGaussian, IsNormalByChiSquare) {
  CountedGaussian<> gaussian(3, RandomStream::noise, 9);
  const auto share_below = [&] { return 0.5 * std::erfc(-gaussian.next() / std::sqrt(2.0)); };
  EXPECT_LT(std::abs(uniformity(share_below)), 4);
}
TEST(CountedGaussian, IsUniformByChiSquare) {
  CountedGaussian<> gaussian(4, RandomStream::losses, 1);
  EXPECT_LT(std::abs(uniformity([&] { return gaussian.uniform(); })), 4);
  CountedGaussian<float> in_float(4, RandomStream::losses, 1);
  EXPECT_LT(std::abs(uniformity([&] { return static_cast<double>(in_float.uniform()); })), 4);
}

template <class S>
class CountedLanes : public testing::Test {};
using Packs = testing::Types<Pack<double, 2>, Pack<double, 8>, Pack<float, 2>, Pack<float, 16>>;
TYPED_TEST_SUITE(CountedLanes, Packs);

TYPED_TEST(CountedLanes, AreTheRunsThatTheyStandFor) {
  using S = TypeParam;
  using Plain = LaneScalar<S>;
  CountedGaussian<S> packed(8, RandomStream::noise, 1000);
  std::vector<CountedGaussian<Plain>> alone;
  for (int i = 0; i < lane_count<S>; ++i) {
    alone.emplace_back(8, RandomStream::noise, 1000 + static_cast<std::uint64_t>(i));
  }
  for (int k = 0; k < 70; ++k) {
    const S normal = packed.next();
    for (int i = 0; i < lane_count<S>; ++i) {
      EXPECT_EQ(number_of_lane(normal, i), alone[static_cast<std::size_t>(i)].next());
    }
    if (k % 3 != 0) continue;
    const S uniform = packed.uniform();
    for (int i = 0; i < lane_count<S>; ++i) {
      EXPECT_EQ(number_of_lane(uniform, i), alone[static_cast<std::size_t>(i)].uniform());
    }
  }
}

}  // namespace sim_counted_gaussian_test
