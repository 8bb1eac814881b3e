// ActuatorMap: the curves of the makers, the inverse to four digits both ways, packs, and what is
// refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <esokit/adapter/actuator_map.hpp>
#include <esokit/core/pack.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>

namespace esokit_test {
namespace adapter_actuator_map_test {

using namespace esokit;

template <class S = double>
auto map_of(const ActuatorCurve<S>& curve) {
  return ActuatorMap<S>::make(curve).value();
}

TEST(ActuatorMap, WithoutAPointTheEffectIsU) {
  const auto map = map_of<>({});
  for (const double x : {-1e300, -3.7, -0.0, 0.0, 1e-310, 12.3, 1e300}) {
    EXPECT_EQ(map.effect(x), x);
    EXPECT_EQ(map.input(x), x);
  }
  EXPECT_TRUE(map.is_straight());
  EXPECT_FALSE(map_of<>({.slope_above = 2}).is_straight());
  EXPECT_FALSE(map_of<>(ActuatorCurve<>::dead_zone(3)).is_straight());
}

TEST(ActuatorMap, DeadZone) {
  const auto map = map_of<>(ActuatorCurve<>::dead_zone(3, 0.5));
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_EQ(map.effect(sign * 3.5), sign * 0.5);
    EXPECT_EQ(map.effect(sign * 12), sign * 9);
    EXPECT_EQ(map.effect(sign * 1.75), sign * 0.25);
    EXPECT_EQ(map.input(sign * 9), sign * 12);
    EXPECT_EQ(map.input(sign * 0.25), sign * 1.75);
  }
  EXPECT_EQ(map.effect(0), 0);
  EXPECT_EQ(map.input(0), 0);
  // Left out, the softness is a sixtieth of the width.
  EXPECT_EQ(map_of<>(ActuatorCurve<>::dead_zone(3)).input(0.05), 3.05);
}

TEST(ActuatorMap, TwoGains) {
  const auto map = map_of<>(ActuatorCurve<>::two_gains(2, 0.5));
  EXPECT_EQ(map.effect(3), 6);
  EXPECT_EQ(map.effect(-3), -1.5);
  EXPECT_EQ(map.input(6), 3);
  EXPECT_EQ(map.input(-1.5), -3);
}

TEST(ActuatorMap, Square) {
  const auto curve = ActuatorCurve<>::square(2);
  const auto map = map_of<>(curve);
  EXPECT_EQ(map.effect(2), 2);
  EXPECT_EQ(map.effect(-2), -2);
  EXPECT_EQ(map.effect(0), 0);
  double most = 0;
  for (int i = -1000; i <= 1000; ++i) {
    const double u = 2e-3 * i;
    most = std::max(most, std::abs(map.effect(u) - u * std::abs(u) / 2));
  }
  // Between four lines a side, as stated; a line more would be less than half of it.
  EXPECT_LE(most, 2 / (4 * 16.0) * (1 + 1e-12));
  EXPECT_GT(most, 2 / (4 * 16.0) * 0.999);
  EXPECT_DOUBLE_EQ(map.effect(3) - map.effect(2), 7.0 / 4);  // the last line goes on
}

TEST(ActuatorMap, FromATable) {
  const auto map = map_of<>(ActuatorCurve<>::from_table<4>({-2, 1, 2, 4}, {10, 16, 17, 25}));
  for (const auto& [u, effect] : {std::pair{-3, 8}, {-2, 10}, {0, 14}, {2, 17}, {3, 21}, {5, 29}}) {
    EXPECT_EQ(map.effect(u), effect) << u;
    EXPECT_EQ(map.input(effect), u) << u;
  }
}

/// A curve whose points lie as they like.
template <class S>
ActuatorCurve<S> random_curve(Random& random) {
  ActuatorCurve<S> curve;
  curve.points = random.index(10);
  double u = random.uniform(-5, 1);
  double effect = random.uniform(-5, 1);
  for (int i = 0; i < curve.points; ++i) {
    const auto at = static_cast<std::size_t>(i);
    curve.input[at] = static_cast<S>(u += random.log_uniform(1e-2, 3));
    curve.effect[at] = static_cast<S>(effect += random.log_uniform(1e-2, 3));
  }
  curve.slope_below = static_cast<S>(random.log_uniform(0.1, 10));
  curve.slope_above = static_cast<S>(random.log_uniform(0.1, 10));
  return curve;
}

/// Both ways, in digits of the larger of the two numbers, by the slope in one unit: a digit of u is
/// one of its effect that is so many times larger, which no inverse can give back.
template <class S>
void inverse_is_exact() {
  Random random(11);
  double worst = 0;
  for (int i = 0; i < 3000; ++i) {
    const auto curve = random_curve<S>(random);
    const auto map = map_of<S>(curve);
    for (int k = 0; k < 40; ++k) {
      const S u = k < curve.points ? curve.input[static_cast<std::size_t>(k)]
                                   : static_cast<S>(random.uniform(-9, 9));
      const S effect = map.effect(u);
      const S back = map.input(effect);
      const S again = map.effect(back);
      const double eps = static_cast<double>(std::numeric_limits<S>::epsilon());
      // The slopes of the lines on which u is.
      double least = 1e300, largest = 0;
      const auto slope = [&](double s) {
        least = std::min(least, s);
        largest = std::max(largest, s);
      };
      if (curve.points == 0 || u <= curve.input[0]) slope(static_cast<double>(curve.slope_below));
      if (curve.points == 0) slope(static_cast<double>(curve.slope_above));
      for (int j = 0; j < curve.points; ++j) {
        const auto at = static_cast<std::size_t>(j);
        if (j + 1 == curve.points) {
          if (u >= curve.input[at]) slope(static_cast<double>(curve.slope_above));
        } else if (curve.input[at] <= u && u <= curve.input[at + 1]) {
          slope(static_cast<double>(curve.effect[at + 1] - curve.effect[at]) /
                static_cast<double>(curve.input[at + 1] - curve.input[at]));
        }
      }
      const double in_u =
          std::max(std::abs(static_cast<double>(u)), std::abs(static_cast<double>(effect)) / least);
      const double in_e = std::max(std::abs(static_cast<double>(effect)),
                                   std::abs(static_cast<double>(u)) * largest);
      worst = std::max(worst, std::abs(static_cast<double>(back - u)) / (eps * in_u));
      worst = std::max(worst, std::abs(static_cast<double>(again - effect)) / (eps * in_e));
    }
  }
  EXPECT_LT(worst, 4);
  EXPECT_GT(worst, 0.5);  // else nothing was measured
}
TEST(ActuatorMap, IsExactBothWays) {
  inverse_is_exact<double>();
  inverse_is_exact<float>();
}

/// Where the line begins at no effect, as all makers have it, no digit is lost near it either.
TEST(ActuatorMap, LosesNoDigitNearZero) {
  Random random(5);
  for (const auto& curve : {ActuatorCurve<>::dead_zone(3), ActuatorCurve<>::two_gains(1, 0.3),
                            ActuatorCurve<>::square(12)}) {
    const auto map = map_of<>(curve);
    for (int i = 0; i < 2000; ++i) {
      const double e = (random.index(2) == 0 ? -1 : 1) * random.log_uniform(1e-30, 0.04);
      EXPECT_NEAR(map.effect(map.input(e)) / e, 1, 4 * 0x1p-52) << e;
    }
  }
}

TEST(ActuatorMap, Rises) {
  Random random(17);
  for (int i = 0; i < 500; ++i) {
    const auto map = map_of<float>(random_curve<float>(random));
    for (int k = 0; k < 100; ++k) {
      const auto a = static_cast<float>(random.uniform(-9, 9));
      const auto b = a + static_cast<float>(random.log_uniform(1e-4, 2));
      EXPECT_LT(map.effect(a), map.effect(b));
      EXPECT_LT(map.input(a), map.input(b));
    }
  }
}

TEST(ActuatorMap, LanesOfAPackHaveTheirOwnCurve) {
  using P = Pack<float, 4>;
  Random random(23);
  for (int i = 0; i < 300; ++i) {
    auto packed = detail::blank<ActuatorMap<P>>();
    std::array<ActuatorMap<float>, 4> plain{map_of<float>({}), map_of<float>({}), map_of<float>({}),
                                            map_of<float>({})};
    P x;
    for (int lane = 0; lane < 4; ++lane) {
      const auto curve = random_curve<float>(random);
      auto& one = plain[static_cast<std::size_t>(lane)] = map_of<float>(curve);
      detail::set_lane(packed, one, lane);
      x[lane] = static_cast<float>(random.uniform(-9, 9));
      // Where lines meet, each has a digit of its own.
      if (curve.points > 0 && random.index(2) == 0) x[lane] = curve.input[0];
    }
    const P effect = packed.effect(x);
    const P input = packed.input(x);
    for (int lane = 0; lane < 4; ++lane) {
      const auto& one = plain[static_cast<std::size_t>(lane)];
      EXPECT_TRUE(same_bits(effect[lane], one.effect(x[lane])));
      EXPECT_TRUE(same_bits(input[lane], one.input(x[lane])));
    }
  }
}

TEST(ActuatorMap, PassesOnWhatIsNotANumber) {
  const auto map = map_of<>(ActuatorCurve<>::dead_zone(3));
  EXPECT_TRUE(std::isnan(map.effect(hidden_nan<double>())));
  EXPECT_TRUE(std::isnan(map.input(hidden_nan<double>())));
  EXPECT_EQ(map.effect(hidden_infinity<double>()), hidden_infinity<double>());
  EXPECT_EQ(map.input(-hidden_infinity<double>()), -hidden_infinity<double>());
}

TEST(ActuatorMap, KnowsWhatGainIsLeft) {
  const auto right = map_of<>(ActuatorCurve<>::dead_zone(3, 0.5));
  auto left = right.gain_left(right, -5, 5);
  EXPECT_EQ(left.least, 1);
  EXPECT_EQ(left.largest, 1);
  // None is there: within 0.5 the inverse is as steep as 7.
  left = right.gain_left(map_of<>({}), -5, 5);
  EXPECT_EQ(left.least, 1);
  EXPECT_EQ(left.largest, 7);
  EXPECT_EQ(right.gain_left(map_of<>({}), 1, 5).largest, 1);
  const auto gains = map_of<>(ActuatorCurve<>::two_gains(1, 0.25));
  left = gains.gain_left(map_of<>(ActuatorCurve<>::two_gains(1.2, 0.2)), -1, 1);
  EXPECT_DOUBLE_EQ(left.least, 0.8);
  EXPECT_DOUBLE_EQ(left.largest, 1.2);
}

/// field, index and rule of what is refused.
template <class S = double>
void refuses(const ActuatorCurve<S>& curve, const std::string& field, int index, S value,
             const std::string& rule) {
  const auto made = ActuatorMap<S>::make(curve);
  ASSERT_FALSE(made.has_value()) << field;
  EXPECT_EQ(made.error().field, field);
  EXPECT_EQ(made.error().index, index) << field;
  EXPECT_TRUE(same_bits(made.error().value, value) || made.error().value == value) << field;
  EXPECT_NE(std::string(made.error().rule).find(rule), std::string::npos) << made.error().rule;
}

TEST(ActuatorMap, SaysWhatItRefuses) {
  using Curve = ActuatorCurve<>;
  refuses(Curve{.points = 10}, "curve.points", -1, 10.0, "must be 0 up to");
  refuses(Curve{.points = -1}, "curve.points", -1, -1.0, "must be 0 up to");
  refuses(Curve::two_gains(0, 1), "curve.slope_above", -1, 0.0, "positive");
  refuses(Curve::two_gains(1, -1), "curve.slope_below", -1, -1.0, "positive");
  refuses(Curve::two_gains(1, hidden_nan<double>()), "curve.slope_below", -1, hidden_nan<double>(),
          "positive");
  refuses(Curve::two_gains(1e-310, 1), "curve.slope_above", -1, 1e-310, "cannot hold");
  refuses(Curve::dead_zone(-3, 0.5), "curve.input", 1, 0.0, "must be above the one before");
  refuses(Curve::dead_zone(3, 0), "curve.effect", 1, 0.0, "must be above the one before");
  refuses(Curve::dead_zone(hidden_infinity<double>(), 1), "curve.input", 0,
          -hidden_infinity<double>(), "finite");
  refuses(Curve::square(0), "curve.input", 1, 0.0, "must be above");
  refuses(Curve::from_table<3>({0, 1, 2}, {0, 1, 1}), "curve.slope_above", -1, 0.0, "positive");
  refuses(Curve::from_table<4>({0, 1, 2, 3}, {0, 1, 1, 2}), "curve.effect", 2, 1.0,
          "must be above");
  refuses(Curve::from_table<4>({0, 1, 1, 3}, {0, 1, 2, 3}), "curve.input", 2, 1.0, "must be above");
  refuses(Curve::from_table<4>({0, 1, 2, 3}, {0, 1, 1 + 1e-310, 3}), "curve.effect", 2, 1.0,
          "must be above");
  // Slopes between points.
  refuses(Curve::from_table<4>({-1, 1e-200, 1e-160, 1}, {-1, 0, 1e200, 2e200}), "curve.effect", 2,
          1e200, "cannot hold");
  EXPECT_TRUE(ActuatorMap<>::make(Curve::from_table<2>({0, 1}, {5, 6})).has_value());
}

}  // namespace adapter_actuator_map_test
}  // namespace esokit_test
