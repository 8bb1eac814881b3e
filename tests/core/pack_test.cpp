// Pack: its arithmetic, masks and tests are those of its lanes.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/core/pack.hpp>
#include <limits>
#include <support/numbers.hpp>

namespace esokit_test {
namespace core_pack_test {

using esokit::lane_count;
using esokit::LaneScalar;
using esokit::Pack;

static_assert(esokit::PackScalar<Pack<double>> && esokit::PackScalar<Pack<float, 16>>);
static_assert(!esokit::PlainScalar<Pack<double>> && !esokit::PackScalar<double>);
static_assert(lane_count<Pack<float, 16>> == 16 && lane_count<double> == 1);
static_assert(Pack<double>::lanes == esokit::default_lanes<double>);
static_assert(esokit::default_lanes<float> == 2 * esokit::default_lanes<double>);
static_assert(std::is_same_v<LaneScalar<Pack<float>>, float>);
static_assert(std::is_same_v<LaneScalar<double>, double>);

#if !defined(__clang__)
// At compile time; Clang 14 casts no bits of vectors there.
constexpr Pack<double, 4> ramp({1, 2, 3, 4});
static_assert(all(ramp + ramp > ramp) && !all(ramp > Pack<double, 4>(1.0)));
static_assert(all(select(ramp < Pack<double, 4>(2.5), ramp, -ramp) <= Pack<double, 4>(2.0)));
static_assert(all(is_finite(ramp)));
static_assert(!all(is_finite(Pack<double, 4>({1, 2, std::numeric_limits<double>::infinity(), 4}))));
static_assert(all((-ramp).magnitude() >= ramp) && all(ramp / ramp <= Pack<double, 4>(1.0)));
#endif

template <class P>
class PackOf : public ::testing::Test {
 protected:
  using Number = LaneScalar<P>;
  static constexpr int count = lane_count<P>;

  P draw() {
    P all(0.0);
    for (int i = 0; i < count; ++i) all[i] = static_cast<Number>(random.uniform(-2, 2));
    return all;
  }

  /// The pack's lanes are f of the operands' lanes.
  template <class F, class... Operands>
  static void expect_lanes(const P& result, F&& f, const Operands&... operands) {
    for (int i = 0; i < count; ++i) {
      EXPECT_TRUE(same_bits(result[i], static_cast<Number>(f(operands[i]...)))) << "lane " << i;
    }
  }
  template <class Mask, class F, class... Operands>
  static void expect_mask(const Mask& mask, F&& f, const Operands&... operands) {
    bool every = true;
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(mask[i], f(operands[i]...)) << "lane " << i;
      every = every && f(operands[i]...);
    }
    EXPECT_EQ(all(mask), every);
  }

  Random random{11};
};

using All = ::testing::Types<Pack<double>, Pack<float>, Pack<double, 2>, Pack<float, 2>,
                             Pack<double, 8>, Pack<float, 16>, Pack<double, 64>>;
TYPED_TEST_SUITE(PackOf, All);

TYPED_TEST(PackOf, CalculatesLaneByLane) {
  using P = TypeParam;
  for (int k = 0; k < 50; ++k) {
    const P a = this->draw();
    const P b = this->draw();
    this->expect_lanes(
        a + b, [](auto x, auto y) { return x + y; }, a, b);
    this->expect_lanes(
        a - b, [](auto x, auto y) { return x - y; }, a, b);
    this->expect_lanes(
        a * b, [](auto x, auto y) { return x * y; }, a, b);
    this->expect_lanes(
        -a, [](auto x) { return -x; }, a);
    this->expect_lanes(
        a.magnitude(), [](auto x) { return std::abs(x); }, a);
    this->expect_lanes(
        esokit::detail::absolute(a), [](auto x) { return std::abs(x); }, a);
    this->expect_lanes(
        exp(a), [](auto x) { return std::exp(x); }, a);
    this->expect_lanes(
        expm1(a), [](auto x) { return std::expm1(x); }, a);
// With -ffast-math division is by a reciprocal, which is not the same in vectors, and a root or a
// power of x * x need not be worked out at all.
#if !defined(__FAST_MATH__)
    this->expect_lanes(
        sqrt(a * a), [](auto x) { return std::sqrt(x * x); }, a);
    this->expect_lanes(
        pow(a * a, b), [](auto x, auto y) { return std::pow(x * x, y); }, a, b);
    this->expect_lanes(
        a / b, [](auto x, auto y) { return x / y; }, a, b);
#endif
    this->expect_lanes(
        select(a < b, a, b), [](auto x, auto y) { return x < y ? x : y; }, a, b);
  }
  this->expect_lanes(P{}, [] { return 0; });
  this->expect_lanes(P(0.1), [] { return 0.1; });
  this->expect_lanes(-P(0.0), [] { return -0.0; });
}

TYPED_TEST(PackOf, ComparesLaneByLane) {
  using P = TypeParam;
  for (int k = 0; k < 50; ++k) {
    const P a = this->draw();
    P b = this->draw();
    b[k % TestFixture::count] = a[k % TestFixture::count];  // equal in one lane
    this->expect_mask(
        a < b, [](auto x, auto y) { return x < y; }, a, b);
    this->expect_mask(
        a > b, [](auto x, auto y) { return x > y; }, a, b);
    this->expect_mask(
        a <= b, [](auto x, auto y) { return x <= y; }, a, b);
    this->expect_mask(
        a >= b, [](auto x, auto y) { return x >= y; }, a, b);
    this->expect_mask((a < b) && (a > P(0.0)), [](auto x, auto y) { return x < y && x > 0; }, a, b);
    this->expect_mask((a < b) || (a > P(0.0)), [](auto x, auto y) { return x < y || x > 0; }, a, b);
    this->expect_mask(
        !(a < b), [](auto x, auto y) { return !(x < y); }, a, b);
  }
}

/// In every lane, alone.
TYPED_TEST(PackOf, KnowsWhatIsNoNumber) {
  using P = TypeParam;
  using One = typename TestFixture::Number;
  const P good = this->draw();
  EXPECT_TRUE(all(is_finite(good)));
  for (int bad = 0; bad < TestFixture::count; ++bad) {
    for (const One value :
         {hidden_nan<One>(), -hidden_nan<One>(), hidden_infinity<One>(), -hidden_infinity<One>()}) {
      P some = good;
      some[bad] = value;
      const auto mask = is_finite(some);
      EXPECT_FALSE(all(mask));
      for (int i = 0; i < TestFixture::count; ++i) EXPECT_EQ(mask[i], i != bad);
      const P mended = select(mask, some, good);
      for (int i = 0; i < TestFixture::count; ++i) EXPECT_TRUE(same_bits(mended[i], good[i]));
    }
    for (const One value : {(std::numeric_limits<One>::max)(), std::numeric_limits<One>::lowest(),
                            (std::numeric_limits<One>::min)(), One(0)}) {
      P some = good;
      some[bad] = value;
      EXPECT_TRUE(all(is_finite(some)));
    }
  }
}

TYPED_TEST(PackOf, IsMadeOfAnArray) {
  using One = typename TestFixture::Number;
  esokit::Array<One, TestFixture::count> values{};
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<One>(i) - One(1.5);
  const TypeParam pack(values);
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(pack[static_cast<int>(i)], values[i]);
  }
}

}  // namespace core_pack_test
}  // namespace esokit_test
