// A reference for a machine of order 1: the machine follows it exactly under what it asks of u, u
// stays within its limits, any target is reached, and nothing is stuck.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/control/approach_profile.hpp>
#include <esokit/core/snapshot.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_approach_profile_test {

using esokit::ApproachProfile;
using esokit::ApproachProfileConfig;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// y' = -a y + b0 v(t - L), tau v' + v = u, u held: in small steps of the sample.
struct Machine {
  double pole, lag, gain, sample_time;
  std::vector<double> line;  // of the dead time
  double y, v;

  void step(double u) {
    line.push_back(u);
    const double delivered = line.front();
    line.erase(line.begin());
    constexpr int parts = 64;
    const double h = sample_time / parts;
    const auto slope = [&](double at_y, double at_v) { return gain * at_v - pole * at_y; };
    for (int i = 0; i < parts; ++i) {
      const double next = lag > 0 ? delivered + std::exp(-h / lag) * (v - delivered) : delivered;
      const double first = lag > 0 ? v : delivered;
      const double k1 = slope(y, first);
      const double k2 = slope(y + h * k1, next);
      y += h * (k1 + k2) / 2;
      v = next;
    }
  }
};

template <int Order, int Delay>
void follows(std::uint64_t seed) {
  Random random(seed);
  for (int i = 0; i < 40; ++i) {
    const double T = random.log_uniform(1e-3, 10);
    const double pole = i % 4 == 0 ? 0.0 : random.log_uniform(1e-4, 0.05) / T;
    const double lag = Order == 2 ? random.log_uniform(2, 20) * T : 0.0;
    const double gain =
        (random.index(2) == 0 ? 1 : -1) * random.log_uniform(1e-3, 1e2) * std::max(pole, 1e-3 / T);
    const double lower = random.uniform(-100, 0), upper = lower + random.uniform(50, 200);
    const double u0 = lower + random.uniform(0.2, 0.8) * (upper - lower);
    const double y0 = random.uniform(-50, 50);
    // Capacity to spare, or none.
    auto profile = ApproachProfile<Order, Delay + (Delay > 5 ? 3 : 0)>::make(
                       {.pole = pole,
                        .lag = lag,
                        .input_gain = gain,
                        .limits = {.lower = lower, .upper = upper},
                        .dead_time = Delay * T,
                        .bandwidth = 0.1 / T,
                        .sample_time = T})
                       .value();
    ASSERT_TRUE(profile.start(y0, u0));
    // A constant disturbance keeps it at rest there.
    const double load = pole * y0 - gain * u0;
    Machine machine{pole, lag, gain, T, std::vector<double>(Delay, u0), y0, u0};
    const double fastest = std::abs(gain) * (upper - lower) * T;
    double target = y0;
    // u of the law that finds the load and no error.
    for (int k = 0; k < 3000; ++k) {
      // More is left on the way than what the reference takes at least.
      if (k % 500 == 100) {
        const double reach = pole > 0 ? std::abs(gain) / pole : 1000 * fastest;
        target = y0 + random.uniform(-1, 1) *
                          std::min(0.7 * reach * std::min(upper - u0, u0 - lower), 400 * fastest);
      }
      ASSERT_TRUE(profile.update(target));
      const auto& motion = profile.motion();
      ASSERT_NEAR(machine.y, motion(0), (3e-3 + 0.2 * pole * T) * fastest) << i << " " << k;
      double of_law = u0 + motion(1) / gain;
      if constexpr (Order == 2) of_law += lag * motion(2) / gain;
      const double u = of_law + profile.feed();
      ASSERT_GE(u, lower - 0.001 * (upper - lower)) << i << " " << k;
      ASSERT_LE(u, upper + 0.001 * (upper - lower)) << i << " " << k;
      Machine& m = machine;
      const double before = m.y;
      m.step(u);
      m.y += load * (pole > 0 ? -std::expm1(-pole * T) / pole : T);
      ASSERT_TRUE(std::isfinite(before));
    }
  }
}

TEST(ApproachProfile, IsWhatTheMachineDoesWithinItsLimits) {
  follows<1, 0>(1);
  follows<1, 7>(2);
  follows<2, 0>(3);
  follows<2, 4>(4);
}

template <class S>
void arrives() {
  const auto size = static_cast<S>(10000);
  auto profile = ApproachProfile<1, 3, S>::make({.pole = S(0.001),
                                                 .input_gain = S(0.01),
                                                 .limits = {.lower = S(-5000), .upper = S(5000)},
                                                 .dead_time = S(3e-4),
                                                 .bandwidth = S(0.5),
                                                 .sample_time = S(1e-4)})
                     .value();
  ASSERT_TRUE(profile.start(size, S(1000)));
  for (int k = 0; k < 600'000; ++k) ASSERT_TRUE(profile.update(size + S(1)));
  EXPECT_EQ(profile.motion()(0), size + S(1));
  // What is left is below a digit of the remainder, a digit of eight digits of r.
  const double digit = 8 * static_cast<double>(std::numeric_limits<S>::epsilon());
  EXPECT_NEAR(static_cast<double>(profile.motion()(1)), 0,
              1e-12 + 0.5 * 1e4 * digit * digit / 5e-5);
  EXPECT_NEAR(static_cast<double>(profile.feed()), 0.1, 1e-6);
}

/// In float a step is far below a digit of r.
TEST(ApproachProfile, LosesNoSmallStep) {
  arrives<double>();
  arrives<float>();
}

ApproachProfileConfig<2> usual() {
  return {.pole = 0.1,
          .lag = 2.0,
          .input_gain = -3.0,
          .limits = {.lower = 0.0, .upper = 100.0},
          .dead_time = 0.2,
          .bandwidth = 0.2,
          .sample_time = 0.1};
}

/// With either sign of b0: nine tenths of what is left, so half way in that time.
TEST(ApproachProfile, TakesWhatIsLeft) {
  for (const double sign : {1.0, -1.0}) {
    for (const double way : {500.0, -500.0}) {
      auto profile = ApproachProfile<1>::make({.input_gain = 2.0 * sign,
                                               .limits = {.lower = -10.0, .upper = 40.0},
                                               .bandwidth = 1.0,
                                               .sample_time = 0.1})
                         .value();
      ASSERT_TRUE(profile.start(0.0, 10.0));
      const double left = sign * way > 0 ? 30.0 : 20.0;
      for (int k = 0; k <= 50; ++k) profile.update(way);
      EXPECT_NEAR(profile.motion()(0), std::copysign(5.0 * 0.9 * 2.0 * left, way), 1e-9);
    }
  }
}

/// Without a valid target it stays where it started.
TEST(ApproachProfile, StaysWhereItStarts) {
  auto profile = ApproachProfile<2, 3>::make(usual()).value();
  ASSERT_TRUE(profile.start(5.0, 50.0));
  for (int k = 0; k < 50; ++k) {
    EXPECT_FALSE(profile.update(nan));
    EXPECT_EQ(profile.motion()(0), 5.0);
    EXPECT_EQ(profile.motion()(1), 0.0);
  }
}

/// At a limit at the start, or above what it can hold, it moves all the same, both ways.
TEST(ApproachProfile, NeverWaits) {
  for (const double held : {0.0, 100.0, 250.0, -40.0}) {
    for (const double target : {20.0, -20.0}) {
      auto profile = ApproachProfile<2, 2>::make(usual()).value();
      ASSERT_TRUE(profile.start(0.0, held));
      for (int k = 0; k < 1000; ++k) profile.update(target);
      EXPECT_NEAR(profile.motion()(0), target, 1e-6) << held;
    }
  }
}

TEST(ApproachProfile, BadTargetsAndStartsChangeNothing) {
  auto profile = ApproachProfile<2, 3>::make(usual()).value();
  ASSERT_TRUE(profile.start(5.0, 50.0));
  for (int k = 0; k < 10; ++k) profile.update(9.0);
  auto other = profile;
  for (int k = 0; k < 300; ++k) {
    const bool good = k % 3 == 0;
    EXPECT_EQ(profile.update(good ? 9.0 : k % 3 == 1 ? nan : 1 / 0.0), good);
    EXPECT_TRUE(other.update(9.0));
    EXPECT_EQ(profile.motion()(0), other.motion()(0));
    EXPECT_EQ(profile.feed(), other.feed());
  }
  EXPECT_FALSE(profile.start(nan, 0.0));
  EXPECT_FALSE(profile.start(0.0, 1 / 0.0));
  for (const double absurd : {1.7e308, -1e308}) {
    EXPECT_FALSE(profile.start(absurd, 0.0));
    EXPECT_FALSE(profile.start(0.0, absurd));
    EXPECT_FALSE(profile.update(absurd));
    EXPECT_TRUE(other.update(9.0));
  }
  EXPECT_EQ(profile.motion()(0), other.motion()(0));
}

TEST(ApproachProfile, GoesOnFromASnapshotWithTheSameBits) {
  auto profile = ApproachProfile<2, 3>::make(usual()).value();
  ASSERT_TRUE(profile.start(5.0, 50.0));
  for (int k = 0; k < 10; ++k) profile.update(9.0);
  auto other = esokit::from_snapshot<ApproachProfile<2, 3>>(esokit::snapshot(profile)).value();
  for (int k = 0; k < 50; ++k) {
    profile.update(9.0);
    other.update(9.0);
    ASSERT_EQ(profile.motion()(2), other.motion()(2));
    ASSERT_EQ(profile.feed(), other.feed());
  }
}

TEST(ApproachProfile, RefusesByRule) {
  const auto rule = [](const auto& change) {
    auto config = usual();
    change(config);
    return refusal(ApproachProfile<2, 2>::make(config));
  };
  EXPECT_EQ(rule([](auto&) {}), "accepted");
  EXPECT_EQ(rule([](auto& c) { c.pole = -1e-300; }), "pole: must be finite and not negative");
  EXPECT_EQ(rule([](auto& c) { c.pole = 0; }), "accepted");
  EXPECT_EQ(rule([](auto& c) { c.lag = 0; }), "lag: must be finite and positive");
  EXPECT_EQ(rule([](auto& c) { c.input_gain = 0; }),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(rule([](auto& c) { c.limits = {}; }),
            "limits.upper: must be finite, and limits.lower, too");
  EXPECT_EQ(rule([](auto& c) { c.limits.lower = 100.0; }),
            "limits.upper: must be above limits.lower");
  EXPECT_EQ(rule([](auto& c) { c.limits.upper = nan; }),
            "limits.upper: must be finite, and limits.lower, too");
  EXPECT_EQ(rule([](auto& c) { c.bandwidth = 0; }), "bandwidth: must be finite and positive");
  EXPECT_EQ(rule([](auto& c) { c.sample_time = nan; }), "sample_time: must be finite and positive");
  EXPECT_EQ(rule([](auto& c) { c.dead_time = -0.1; }),
            "dead_time: must be finite and not negative");
  EXPECT_EQ(rule([](auto& c) { c.dead_time = 0.2 * (1 + 1e-6); }),
            "dead_time: must be at most Capacity samples, s:");
  EXPECT_EQ(rule([](auto& c) { c.input_gain = 1e308; }),
            "input_gain: times the range of u must be finite and positive");
  EXPECT_EQ(rule([](auto& c) { c.lag = 1e307; }),
            "lag: times the speed by the range of u must be finite");
  ApproachProfileConfig<1> first{.input_gain = 1.0,
                                 .limits = {.lower = -1.0, .upper = 1.0},
                                 .bandwidth = 1.0,
                                 .sample_time = 1e-3};
  EXPECT_EQ(refusal(ApproachProfile<1>::make(first)), "accepted");
  first.lag = 1.0;
  EXPECT_EQ(refusal(ApproachProfile<1>::make(first)), "lag: needs Order 2");
}

}  // namespace control_approach_profile_test
}  // namespace esokit_test
