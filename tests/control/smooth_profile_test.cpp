// Smooth profiles: the printed polynomials, derivatives that belong together, limits that no
// search exceeds, targets that change on the way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/core/pack.hpp>
#include <esokit/core/snapshot.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_smooth_profile_test {

using esokit::smooth_step;
using esokit::SmoothProfile;
using esokit::SmoothProfileConfig;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// As the textbooks print them, also beyond the ends.
TEST(SmoothStep, EqualsThePrintedPolynomials) {
  for (double x = 0; x <= 1; x += 1.0 / 64) {
    EXPECT_NEAR(smooth_step<1>(x)(0), x * x * (3 - 2 * x), 1e-15);
    EXPECT_NEAR(smooth_step<1>(x)(1), 6 * x * (1 - x), 1e-14);
    EXPECT_NEAR(smooth_step<2>(x)(0), x * x * x * (10 + x * (-15 + 6 * x)), 1e-15);
    EXPECT_NEAR(smooth_step<2>(x)(2), 60 * x * (1 - x) * (1 - 2 * x), 1e-13);
    EXPECT_NEAR(smooth_step<3>(x)(0), std::pow(x, 4) * (35 + x * (-84 + x * (70 - 20 * x))), 1e-14);
    EXPECT_NEAR(smooth_step<3>(x)(1), 140 * std::pow(x * (1 - x), 3), 1e-13);
    EXPECT_NEAR(smooth_step<4>(x)(1), 630 * std::pow(x * (1 - x), 4), 1e-13);
  }
  for (const double x : {-1.0, 0.0, -nan}) {
    for (const double value : smooth_step<3>(x)) EXPECT_EQ(value, 0);
  }
  for (const double x : {1.0, 7.0}) {
    EXPECT_EQ(smooth_step<3>(x)(0), 1);
    for (int i = 1; i <= 3; ++i) EXPECT_EQ(smooth_step<3>(x)(i), 0);
  }
}

/// The peaks are those of the derivatives: none above in a scan, and reached.
template <int Order>
void expect_peaks() {
  esokit::Array<double, Order> most{};
  constexpr int points = 20000;
  for (int k = 0; k <= points; ++k) {
    const auto s = smooth_step<Order>(static_cast<double>(k) / points);
    for (int i = 1; i <= Order; ++i) {
      auto& m = most[static_cast<std::size_t>(i - 1)];
      m = std::max(m, std::abs(s(i)));
    }
  }
  for (std::size_t i = 0; i < Order; ++i) {
    // The scan misses a peak by a half of its step, squared.
    EXPECT_NEAR(most[i], esokit::smooth_step_peaks<Order>[i],
                1e-6 * esokit::smooth_step_peaks<Order>[i])
        << Order << " " << i;
  }
}
TEST(SmoothStep, PeaksAreThoseOfTheDerivatives) {
  expect_peaks<1>();
  expect_peaks<2>();
  expect_peaks<3>();
  expect_peaks<4>();
}

/// Differences of r over two samples are r', and so on: the rest is O(T^2).
template <int Order>
void expect_derivatives() {
  SmoothProfileConfig<Order> config{.sample_time = 1e-4};
  config.limits[Order - 1] = 3.0;
  auto profile = SmoothProfile<Order>::make(config).value();
  ASSERT_TRUE(profile.reset(-0.4));
  typename SmoothProfile<Order>::Motion before = profile.motion(), now = before;
  esokit::Array<double, Order + 1> size{};
  esokit::Array<double, Order> wrong{};
  do {
    ASSERT_TRUE(profile.update(1.1));
    const auto after = profile.motion();
    for (int i = 0; i < Order; ++i) {
      const double slope = (after(i) - before(i)) / (2 * config.sample_time);
      auto& w = wrong[static_cast<std::size_t>(i)];
      w = std::max(w, std::abs(slope - now(i + 1)));
      auto& s = size[static_cast<std::size_t>(i + 1)];
      s = std::max(s, std::abs(now(i + 1)));
    }
    before = now;
    now = after;
  } while (profile.moving());
  for (std::size_t i = 0; i < Order; ++i) {
    // r'' .. jumps in its slope at both ends: there the difference is of first order.
    EXPECT_LT(wrong[i], (i + 1 < Order ? 1e-6 : 2e-3) * size[i + 1]) << Order << " " << i;
  }
}
TEST(SmoothProfile, DerivativesBelongTogether) {
  expect_derivatives<1>();
  expect_derivatives<2>();
  expect_derivatives<3>();
  expect_derivatives<4>();
}

/// Random limits, targets and changes of mind: no derivative above its limit, r between the targets
/// of its move, at the target in the end; and the time is not wasted: a limit or the shortest time
/// is what determines the duration.
template <int Order, class S>
void search(std::uint64_t seed) {
  Random random(seed);
  for (int round = 0; round < long_run(1000); ++round) {
    SmoothProfileConfig<Order, S> config;
    config.sample_time = static_cast<S>(random.log_uniform(1e-4, 10));
    const double time = random.log_uniform(1, 500) * static_cast<double>(config.sample_time);
    const double unit = random.log_uniform(1e-3, 1e3);
    for (int i = 1; i <= Order; ++i) {
      if (i < Order && random.index(2) == 0) continue;
      config.limits[static_cast<std::size_t>(i - 1)] =
          static_cast<S>(random.log_uniform(0.1, 10) * unit / std::pow(time, i));
    }
    if (random.index(2) == 0)
      config.shortest_time = static_cast<S>(random.log_uniform(0.1, 2) * time);
    auto profile = SmoothProfile<Order, S>::make(config).value();
    S from = static_cast<S>(unit * random.uniform(-1, 1));
    ASSERT_TRUE(profile.reset(from));
    for (int move = 0; move < 3; ++move) {
      const S target = static_cast<S>(unit * random.uniform(-1, 1));
      const S least = profile.duration(target);
      esokit::Array<S, Order> most{};
      int samples = 0;
      S last = from;
      do {
        // Other targets on the way are not taken.
        ASSERT_TRUE(profile.update(samples == 0 ? target : static_cast<S>(random.uniform(-9, 9))));
        ++samples;
        const auto motion = profile.motion();
        for (std::size_t i = 0; i < Order; ++i) {
          most[i] = std::max(most[i], std::abs(motion(static_cast<int>(i) + 1)));
        }
        ASSERT_TRUE(from < target ? last <= motion(0) && motion(0) <= target
                                  : last >= motion(0) && motion(0) >= target);
        last = motion(0);
        ASSERT_LT(samples, 1'000'000);
      } while (profile.moving());
      ASSERT_EQ(profile.motion()(0), target);
      bool used = least <= config.shortest_time;
      for (std::size_t i = 0; i < Order; ++i) {
        if (!(config.limits[i] > 0)) continue;
        ASSERT_LE(most[i], config.limits[i]) << Order << " " << i;
        // Up to a whole number of samples, and to the sample next to the peak.
        used = used || most[i] > static_cast<S>(0.9) * config.limits[i] || samples < 60;
      }
      ASSERT_TRUE(used);
      ASSERT_GE(samples, static_cast<int>(least / config.sample_time));
      ASSERT_LE(samples, static_cast<int>(least / config.sample_time * static_cast<S>(1.0001)) + 2);
      from = target;
    }
  }
}
TEST(SmoothProfile, NoSearchExceedsALimit) {
  search<1, double>(1);
  search<2, double>(2);
  search<3, double>(3);
  search<4, double>(4);
  search<1, float>(5);
  search<2, float>(6);
  search<3, float>(7);
  search<4, float>(8);
}

/// Where a whole number of samples just fits, rounding does not exceed the limit either.
template <int Order, class S>
void just_fits(std::uint64_t seed) {
  Random random(seed);
  for (int samples = 4; samples < 2000; samples += 2) {
    const double way = random.uniform(0.5, 2);
    SmoothProfileConfig<Order, S> config{.sample_time = 1};
    config.limits[Order - 1] = static_cast<S>(way * esokit::smooth_step_peaks<Order>[Order - 1] /
                                              std::pow(samples, Order));
    auto profile = SmoothProfile<Order, S>::make(config).value();
    ASSERT_TRUE(profile.update(static_cast<S>(way)));
    while (profile.moving()) {
      ASSERT_LE(std::abs(profile.motion()(Order)), config.limits[Order - 1]) << samples;
      ASSERT_TRUE(profile.update(static_cast<S>(way)));
    }
  }
}
TEST(SmoothProfile, RoundingDoesNotExceedALimit) {
  just_fits<1, double>(11);
  just_fits<3, double>(12);
  just_fits<1, float>(13);
  just_fits<2, float>(14);
  just_fits<3, float>(15);
}

/// Of two limits the one that needs more time rules.
TEST(SmoothProfile, EachLimitRules) {
  const auto profile = [](double speed, double acceleration, double shortest) {
    return SmoothProfile<2>::make(
               {.limits = {{speed, acceleration}}, .shortest_time = shortest, .sample_time = 1e-3})
        .value();
  };
  EXPECT_NEAR(profile(0, 5.773502691896258, 0).duration(4), 2, 1e-12);
  EXPECT_NEAR(profile(1.875, 1e6, 0).duration(-4), 4, 1e-12);
  EXPECT_NEAR(profile(1.875, 1e6, 5).duration(4), 5, 1e-12);
  EXPECT_EQ(profile(1, 1, 5).duration(0), 0);
}

/// A new target is taken up at rest; one that is reached is no move.
TEST(SmoothProfile, TargetsChange) {
  auto profile = SmoothProfile<2>::make({.limits = {{0, 4}}, .sample_time = 0.01}).value();
  EXPECT_FALSE(profile.moving());
  ASSERT_TRUE(profile.update(0));
  EXPECT_FALSE(profile.moving());
  ASSERT_TRUE(profile.update(1));
  EXPECT_TRUE(profile.moving());
  EXPECT_GT(profile.motion()(0), 0);
  while (profile.moving()) ASSERT_TRUE(profile.update(-1));
  EXPECT_EQ(profile.motion()(0), 1);
  ASSERT_TRUE(profile.update(-1));
  EXPECT_TRUE(profile.moving());
  EXPECT_LT(profile.motion()(0), 1);
  ASSERT_TRUE(profile.reset(3));
  EXPECT_FALSE(profile.moving());
  EXPECT_EQ(profile.motion()(0), 3);
}

/// What is not finite or too far away begins no move, and does not stop one.
TEST(SmoothProfile, BadTargets) {
  auto profile = SmoothProfile<1>::make({.limits = {{1.5}}, .sample_time = 1}).value();
  for (const double bad : {nan, std::numeric_limits<double>::infinity(), 1e300, 0x1p30}) {
    EXPECT_FALSE(profile.update(bad));
    EXPECT_FALSE(profile.moving());
    EXPECT_EQ(profile.motion()(0), 0);
  }
  EXPECT_FALSE(profile.reset(nan));
  ASSERT_TRUE(profile.update(10));
  EXPECT_FALSE(profile.update(nan));
  EXPECT_TRUE(profile.moving());
  const double before = profile.motion()(0);
  EXPECT_FALSE(profile.update(nan));
  EXPECT_GT(profile.motion()(0), before);
  auto far = SmoothProfile<1>::make({.limits = {{1.5}}, .sample_time = 1}).value();
  EXPECT_TRUE(far.update(0x1p30 * (1 - 1e-9)));
}

/// A copy, and a snapshot of any sample, go on with the same bits.
template <int Order, class S>
void expect_same_life() {
  Random random(17);
  SmoothProfileConfig<Order, S> config{.sample_time = S(0.01)};
  config.limits[Order - 1] = S(0.5);
  using Profile = SmoothProfile<Order, S>;
  auto profile = Profile::make(config).value();
  S target(0);
  int moved = 0;
  for (int k = 0; k < 600; ++k) {
    if (k % 97 == 0) target = static_cast<S>(random.uniform(-1, 1));
    auto copy = profile;
    auto restored = esokit::from_snapshot<Profile>(esokit::snapshot(profile));
    ASSERT_TRUE(restored);
    const bool taken = profile.update(target);
    ASSERT_EQ(copy.update(target), taken);
    ASSERT_EQ(restored->update(target), taken);
    moved += profile.moving() ? 1 : 0;
    for (const auto& other : {copy, *restored}) {
      ASSERT_EQ(other.moving(), profile.moving());
      for (int i = 0; i <= Order; ++i) {
        ASSERT_TRUE(same_bits(other.motion()(i), profile.motion()(i))) << k << ' ' << i;
      }
    }
  }
  EXPECT_GT(moved, 100);
  auto words = esokit::snapshot(profile);
  using Other = SmoothProfile<Order == 4 ? 3 : Order + 1, S>;
  if constexpr (sizeof(Other) == sizeof(Profile)) {
    EXPECT_FALSE(esokit::from_snapshot<Other>(words));
  }
  words[1] ^= 1U;
  EXPECT_FALSE(esokit::from_snapshot<Profile>(words));
}
TEST(SmoothProfile, GoesOnFromASnapshotWithTheSameBits) {
  expect_same_life<1, float>();
  expect_same_life<2, float>();
  expect_same_life<3, double>();
  expect_same_life<4, double>();
}

TEST(SmoothProfile, RefusesByRule) {
  const SmoothProfileConfig<2> good{.limits = {{0, 1}}, .sample_time = 1e-3};
  const auto refused = [&](auto change) {
    auto config = good;
    change(config);
    return refusal(SmoothProfile<2>::make(config));
  };
  EXPECT_EQ(refused([](auto&) {}), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.limits[1] = 0; }), "limits[1]: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.limits[1] = nan; }), "limits[1]: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.limits[0] = -1; }),
            "limits[0]: must be finite and not negative");
  EXPECT_EQ(refused([](auto& c) { c.shortest_time = -1; }),
            "shortest_time: must be finite and not negative");
  EXPECT_EQ(refused([](auto& c) { c.sample_time = 0; }),
            "sample_time: must be finite and positive");
}

/// Slow moves beside a large reference, of so many samples that one moves r by less than a digit:
/// it arrives, and on the way is the profile in double but for a digit.
TEST(SmoothProfile, LosesNoSmallStepInFloat) {
  Random random(71);
  for (int i = 0; i < 30; i += stride) {
    const double base = random.uniform(-1, 1) * random.log_uniform(1, 1e6);
    const float from = static_cast<float>(base);
    const float to = from + std::fabs(from) * 1e-4f * static_cast<float>(random.uniform(-1, 1));
    const int samples = 1000 + random.index(long_run(20'000));
    const auto shortest = static_cast<float>(samples) * 1e-4f;
    auto in_float = SmoothProfile<2, float>::make(
                        {.limits = {0, 1e30f}, .shortest_time = shortest, .sample_time = 1e-4f})
                        .value();
    auto in_double = SmoothProfile<2>::make({.limits = {0, 1e30},
                                             .shortest_time = static_cast<double>(shortest),
                                             .sample_time = static_cast<double>(1e-4f)})
                         .value();
    ASSERT_TRUE(in_float.reset(from));
    ASSERT_TRUE(in_double.reset(static_cast<double>(from)));
    const double size = static_cast<double>(std::max(std::fabs(from), std::fabs(to)));
    for (int k = 0; k < samples + 100; ++k) {
      ASSERT_TRUE(in_float.update(to));
      ASSERT_TRUE(in_double.update(static_cast<double>(to)));
      // A sample more or less is what rounding the duration may cost.
      const double a_sample = 2 * std::fabs(static_cast<double>(to - from)) / samples;
      ASSERT_NEAR(static_cast<double>(in_float.motion()(0)), in_double.motion()(0),
                  1.2e-7 * size + 8 * a_sample)
          << k;
    }
    EXPECT_FALSE(in_float.moving());
    EXPECT_EQ(in_float.motion()(0), to);
    EXPECT_EQ(in_float.motion()(1), 0);
  }
}

}  // namespace control_smooth_profile_test
}  // namespace esokit_test
