// A reference that follows: as fast as the continuous optimum, no limit exceeded by any search, no
// chatter, with the target once it is there, and waiting for an axis that is held.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <esokit/control/adrc.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_follow_profile_test {

using esokit::FollowProfile;
using esokit::FollowProfileConfig;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A case: limits, a target with a constant speed, and where r begins beside it.
struct Case {
  double T, A, V, w, e, v;
  static Case random(Random& random, double fastest) {
    Case c{};
    c.T = random.log_uniform(1e-4, 10);
    c.A = random.log_uniform(1e-2, 1e2);
    const double samples = random.log_uniform(3, 500);
    c.V = c.A * samples * c.T * random.log_uniform(1, 10);
    c.w = fastest * c.V * random.uniform(-1, 1);
    c.e = c.A * samples * samples * c.T * c.T * random.uniform(-1, 1);
    c.v = random.index(3) == 0 ? 0.0 : c.V * random.uniform(-1.3, 1.3);
    return c;
  }
  /// Least time in samples, of a motion that may change r'' at any time: back within the limit of
  /// speed first, then full speed towards the target, and a full brake.
  [[nodiscard]] double least() const {
    double at = e, d = v - w;
    const double out = std::max(std::abs(v) - V, 0.0), first = out / A;
    at += d * first - std::copysign(A, v) * first * first / 2;
    d -= std::copysign(out, v);
    const double side = at + d * std::abs(d) / (2 * A) < 0 ? -1 : 1;
    at *= side;
    d *= side;
    const double most = V + side * w, peak = std::sqrt(std::max(A * at + d * d / 2, 0.0));
    if (peak <= most) return (first + (d + 2 * peak) / A) / T;
    return (first + (d + 2 * most) / A + (at + d * d / (2 * A) - most * most / A) / most) / T;
  }
};

template <class S>
FollowProfile<2, S> begun(const Case& c) {
  auto profile = FollowProfile<2, S>::make({.limits = {static_cast<S>(c.V), static_cast<S>(c.A)},
                                            .sample_time = static_cast<S>(c.T)})
                     .value();
  EXPECT_TRUE(profile.start(static_cast<S>(c.e), static_cast<S>(c.v)));
  return profile;
}

/// At most two samples behind the continuous optimum, which is below 5 % from 40 samples on. The
/// acceleration changes as often as that of the optimum: by 1, 2 (or 1, 1) and 1 times A.
void arrives_in_time(std::uint64_t seed, double fastest) {
  Random random(seed);
  for (int i = 0; i < long_run(1000); ++i) {
    const Case c = Case::random(random, fastest);
    const double least = c.least();
    if (least > 5000) continue;
    auto profile = begun<double>(c);
    int arrived = -1;
    double change = 0, before = 0;
    for (int k = 0; k < static_cast<int>(least) + 50; ++k) {
      const double target = c.w * c.T * k;
      ASSERT_TRUE(profile.update({target, c.w}));
      const auto r = profile.motion();
      if (k > 0) change += std::abs(r(2) - before) / c.A;
      before = r(2);
      const bool there = std::abs(r(0) - target) < 1e-7 * c.A * c.T * c.T &&
                         std::abs(r(1) - c.w) < 1e-7 * c.A * c.T;
      arrived = !there ? -1 : arrived < 0 ? k : arrived;
    }
    ASSERT_GE(arrived, 0) << i;
    ASSERT_LE(arrived, least + 2) << i;
    ASSERT_GE(arrived, least - 1e-6) << i;
    ASSERT_LE(change, 3 + 1e-5) << i;
    ASSERT_LT(std::abs(before), 1e-6 * c.A) << i;
  }
}
TEST(FollowProfile, ArrivesAsFastAsTheOptimumAndDoesNotChatter) {
  arrives_in_time(20261127, 0);
  arrives_in_time(20261128, 0.9);
}

/// A target that accelerates leaves A - r'' on one side and A + r'' on the other: the optimum of
/// two parts, again at most 5 % away.
TEST(FollowProfile, ArrivesInTimeAtATargetThatAccelerates) {
  Random random(20261129);
  for (int i = 0; i < long_run(500); ++i) {
    const double thrust = random.uniform(-0.9, 0.9), speed = random.uniform(-100, 100);
    const double begin = speed + random.uniform(-50, 50);
    double e = random.log_uniform(1, 2000) * random.uniform(-1, 1), d = begin - speed;
    const double place = e;
    double up = 1 - thrust, down = 1 + thrust;  // of the distance
    if (e + d * std::abs(d) / (2 * (d > 0 ? down : up)) > 0) {
      e = -e;
      d = -d;
      std::swap(up, down);
    }
    // Towards the target, to a peak of speed, and a brake.
    const double peak = std::sqrt((-e + d * d / (2 * up)) * 2 * up * down / (up + down));
    const double least = (peak - d) / up + peak / down;
    if (least < 40) continue;
    auto profile = FollowProfile<2>::make({.limits = {{0, 1}}, .sample_time = 1}).value();
    ASSERT_TRUE(profile.start(place, begin));
    int arrived = -1;
    for (int k = 0; k < 2 * least; ++k) {
      const double target = speed * k + thrust * k * k / 2;
      ASSERT_TRUE(profile.update({target, speed + thrust * k, thrust}));
      const bool there = std::abs(profile.motion()(0) - target) < 1e-6;
      arrived = !there ? -1 : arrived < 0 ? k : arrived;
    }
    ASSERT_GE(arrived, least - 1e-6) << i;
    ASSERT_LE(arrived, 1.05 * least) << i;
  }
}

/// Targets that jump in each sample, or just where it hurts: no limit is exceeded, and a speed
/// beyond it only falls, as fast as it can. What motion says is how r goes on.
template <class S>
void searches(std::uint64_t seed) {
  Random random(seed);
  const double digit = static_cast<double>(std::numeric_limits<S>::epsilon());
  for (int i = 0; i < long_run(300); ++i) {
    const Case c = Case::random(random, 0.9);
    auto profile = begun<S>(c);
    const S V = static_cast<S>(c.V), A = static_cast<S>(c.A), T = static_cast<S>(c.T);
    auto last = profile.motion();
    double target = 0, speed = 0, thrust = 0;
    for (int k = 0; k < 500; ++k) {
      if (random.index(i % 3 == 0 ? 2 : 30) == 0) {
        target = std::abs(c.e) * random.uniform(-2, 2);
        speed = random.index(2) == 0 ? 0.0 : c.V * random.uniform(-2, 2);
        thrust = random.index(2) == 0 ? 0.0 : c.A * random.uniform(-2, 2);
      }
      // Just ahead of where it could still stop.
      const double v = static_cast<double>(last(1));
      if (i % 5 == 0) {
        target =
            static_cast<double>(last(0)) + v * std::abs(v) / (2 * c.A) * random.uniform(0.9, 1.1);
      }
      if (random.index(40) == 0) {
        profile.wait();
      } else {
        ASSERT_TRUE(profile.update(
            {static_cast<S>(target), static_cast<S>(speed), static_cast<S>(thrust)}));
      }
      const auto now = profile.motion();
      ASSERT_LE(std::abs(now(2)), A) << i << ' ' << k;
      if (k > 0) {
        const S before = std::abs(last(1));
        if (before <= V) {
          ASSERT_LE(std::abs(now(1)), V) << i << ' ' << k;
        } else {
          ASSERT_LE(std::abs(now(1)),
                    std::max(V, before - A * T + static_cast<S>(9 * digit) * before))
              << i << ' ' << k;
        }
        const double t = static_cast<double>(T), a = static_cast<double>(last(2));
        const double way = t * v + t * t / 2 * a;
        const double size = std::abs(static_cast<double>(now(0))) + std::abs(way) +
                            static_cast<double>(std::numeric_limits<S>::min()) / digit;
        ASSERT_NEAR(static_cast<double>(now(0)), static_cast<double>(last(0)) + way,
                    9 * digit * size);
        ASSERT_NEAR(static_cast<double>(now(1)), v + t * a, 9 * digit * (std::abs(v) + t * c.A));
      }
      last = now;
    }
  }
}
TEST(FollowProfile, NoSearchExceedsALimit) {
  searches<double>(3);
  searches<float>(4);
}

TEST(FollowProfile, OfOrderOneGoesAtTheLimit) {
  auto profile = FollowProfile<1>::make({.limits = {{2.0}}, .sample_time = 0.1}).value();
  for (int k = 0; k <= 10; ++k) {
    ASSERT_TRUE(profile.update(1.5));
    EXPECT_NEAR(profile.motion()(0), std::min(0.2 * k, 1.5), 1e-12);
    EXPECT_NEAR(profile.motion()(1), k < 7 ? 2.0 : k == 7 ? 1.0 : 0.0, 1e-12);
  }
  // A target that moves is met, and not lagged behind.
  for (int k = 0; k <= 40; ++k) {
    const double target = 1.5 - 0.1 * k * 1.5;
    ASSERT_TRUE(profile.update({target, -1.5}));
    if (k > 1) {
      EXPECT_NEAR(profile.motion()(0), target, 1e-12);
    }
  }
  profile.wait();
  const double stopped = profile.motion()(0);
  profile.wait();
  EXPECT_EQ(profile.motion()(0), stopped);
  EXPECT_EQ(profile.motion()(1), 0);
}

/// With its speed and acceleration a sine is followed but for its third derivative, T^3 / 6 of it;
/// without the acceleration T^2 / 2 of that, without the speed T of that.
TEST(FollowProfile, GoesWithTheTarget) {
  constexpr double T = 1e-3, omega = 10;
  const auto largest = [&](int derivatives, double filter) {
    auto profile =
        FollowProfile<2>::make({.limits = {{50, 500}}, .filter_time = filter, .sample_time = T})
            .value();
    double error = 0;
    for (int k = 0; k < 3000; ++k) {
      const double s = std::sin(omega * T * k), c = omega * std::cos(omega * T * k);
      EXPECT_TRUE(derivatives == 0   ? profile.update(s)
                  : derivatives == 1 ? profile.update({s, c})
                                     : profile.update({s, c, -omega * omega * s}));
      if (k > 1000) error = std::max(error, std::abs(profile.motion()(0) - s));
    }
    return error;
  };
  const double third = omega * omega * omega * T * T * T / 6;
  EXPECT_LT(largest(2, 0), 4 * third);
  EXPECT_LT(largest(1, 0), 2 * omega * omega * T * T);
  EXPECT_GT(largest(1, 0), 4 * third);
  EXPECT_GT(largest(0, 0), 0.05);  // r'^2 / (2 A) = 0.1, about
  // A filter of 5 T: its double pole at 1 - T / h keeps 25 times as much.
  EXPECT_GT(largest(2, 5 * T), 5 * third);
  EXPECT_LT(largest(2, 5 * T), 4 * 25 * third);
}

/// A target that brakes leaves less to brake with: r comes from behind, and not past it. One that
/// is faster than the limit, however much, is followed at the limit.
TEST(FollowProfile, DoesNotOvershootATargetThatBrakes) {
  for (const double side : {1.0, -1.0}) {
    constexpr double T = 0.01;
    auto profile = FollowProfile<2>::make({.limits = {{0, 1}}, .sample_time = T}).value();
    ASSERT_TRUE(profile.start(-20 * side, 20 * side));
    double past = -1e9;
    for (int k = 0; k < 2000; ++k) {
      const double t = k * T;
      const double target = side * (20 * t - 0.35 * t * t);
      ASSERT_TRUE(profile.update({target, side * (20 - 0.7 * t), -0.7 * side}));
      past = std::max(past, side * (profile.motion()(0) - target));
    }
    EXPECT_LT(past, 1e-9);
    EXPECT_GT(past, -1e-9);
  }
  auto profile = FollowProfile<2>::make({.limits = {{2, 1}}, .sample_time = 0.1}).value();
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(profile.update({1e3 * k, 1e300}));
  EXPECT_EQ(profile.motion()(1), 2);
}

/// A target with noise of 1e-6: unfiltered r'' is all noise, with a filter of 8 T the part that
/// the double pole at 1 - T / h leaves, about (T / h)^2.
TEST(FollowProfile, FiltersANoisyTarget) {
  constexpr double T = 1e-3;
  const auto noise = [&](double filter) {
    Random random(5);
    auto profile =
        FollowProfile<2>::make({.limits = {{50, 1e3}}, .filter_time = filter, .sample_time = T})
            .value();
    double sum = 0;
    for (int k = 0; k < 4000; ++k) {
      EXPECT_TRUE(profile.update({1e-6 * random.uniform(-1, 1), 0}));
      sum += profile.motion()(2) * profile.motion()(2);
    }
    return std::sqrt(sum / 4000);
  };
  EXPECT_GT(noise(0), 0.5);
  EXPECT_LT(noise(8 * T), 2.0 / 64 * noise(0));
}

/// Slower limits while it runs: back inside as fast as they allow, and it still arrives.
TEST(FollowProfile, Retunes) {
  FollowProfileConfig<2> config{.limits = {{10, 50}}, .sample_time = 0.01};
  auto profile = FollowProfile<2>::make(config).value();
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(profile.update(100));
  EXPECT_EQ(profile.motion()(1), 10);
  config.limits = {{2, 20}};
  ASSERT_TRUE(profile.retune(config));
  double before = profile.motion()(1);
  for (int k = 0; k < 42; ++k) {
    ASSERT_TRUE(profile.update(100));
    // The first sample ends what the old limits had begun.
    if (k > 0) {
      EXPECT_NEAR(profile.motion()(1), std::max(2.0, before - 0.2), 1e-9);
    }
    before = profile.motion()(1);
  }
  EXPECT_EQ(profile.motion()(1), 2);
  config.limits[1] = -1;
  EXPECT_FALSE(profile.retune(config));
  for (int k = 0; k < 6000; ++k) ASSERT_TRUE(profile.update(100));
  EXPECT_NEAR(profile.motion()(0), 100, 1e-9);
  EXPECT_NEAR(profile.motion()(2), 0, 1e-6);
}

/// Another sample time: what a motion said of r until the next sample stays true, so no limit is
/// exceeded, and a start stays where it was.
template <int Order>
void retunes_the_time(std::uint64_t seed) {
  Random random(seed);
  for (int i = 0; i < long_run(200); ++i) {
    FollowProfileConfig<Order> config{.sample_time = random.log_uniform(1e-4, 1)};
    config.limits[0] = 2;
    config.limits[Order - 1] = random.log_uniform(0.1, 10) / config.sample_time;
    auto profile = FollowProfile<Order>::make(config).value();
    const double speed = Order == 1 ? 0 : random.uniform(-2, 2);
    ASSERT_TRUE(profile.start(1, speed));
    double next = 1, faster = speed, target = 0;
    for (int k = 0; k < 100; ++k) {
      config.sample_time *= random.index(3) == 0 ? random.log_uniform(0.1, 10) : 1;
      config.sample_time = std::clamp(config.sample_time, 1e-5, 10.0);
      ASSERT_TRUE(profile.retune(config));
      if (random.index(5) == 0) target = random.uniform(-10, 10);
      ASSERT_TRUE(profile.update(target));
      const auto& r = profile.motion();
      const double T = config.sample_time;
      const double most = T * config.limits[Order - 1];  // at once, of r or of r'
      ASSERT_NEAR(r(0), next, 1e-12 * (10 + (1 + T) * most)) << k;
      if constexpr (Order == 2) {
        ASSERT_NEAR(r(1), faster, 1e-12 * (1 + most)) << k;
      }
      ASSERT_LE(std::abs(r(1)), config.limits[0]) << k;
      next = r(0) + T * r(1) + (Order == 2 ? T * T / 2 * r(Order) : 0);
      faster = r(1) + T * r(Order);
    }
  }
}
TEST(FollowProfile, RetunesItsSampleTime) {
  retunes_the_time<1>(21);
  retunes_the_time<2>(22);
}

/// From so far that the way to brake is millions of samples long, it is still as fast as can be.
TEST(FollowProfile, CountsNoSamples) {
  auto profile = FollowProfile<2>::make({.limits = {{100, 1}}, .sample_time = 1e-6}).value();
  const auto change = [&](double place, double speed) {
    EXPECT_TRUE(profile.start(place, speed));
    EXPECT_TRUE(profile.update(0));
    return profile.motion()(2);
  };
  for (const double speed : {1.0, 11.0, 20.0, 90.0}) {
    EXPECT_EQ(change(-speed * speed / 2 * 1.01, speed), 1);
    EXPECT_EQ(change(-speed * speed / 2 * 0.99, speed), -1);
  }
  EXPECT_EQ(change(-1e6, 100), 0);
}

/// A joint of order 2 that a brake holds for two seconds while its target goes on. A reference that
/// waits asks for no more than its limit of speed afterwards, and one that does not has the joint
/// catch up.
TEST(FollowProfile, WaitsWhileTheAxisIsHeld) {
  constexpr double T = 1e-3, b0 = 50, fastest = 1;
  enum class Then { goes_on, waits, starts };
  const auto speed_afterwards = [&](Then then) {
    auto controller =
        esokit::Adrc<esokit::LinearEso<2>>::make(
            {.observer = {.observer_bandwidth = 150, .input_gain = b0, .sample_time = T},
             .controller_bandwidth = 25,
             .limits = {.lower = -4, .upper = 4}})
            .value();
    auto profile = FollowProfile<2>::make({.limits = {{fastest, 20}}, .sample_time = T}).value();
    double y = 0, v = 0, most = 0;
    for (int k = 0; k < 8000; ++k) {
      const bool held = k > 1000 && k < 3000;
      if (held && then == Then::waits) {
        profile.wait();
      } else {
        if (held && then == Then::starts) {
          EXPECT_TRUE(profile.start(y));
        }
        EXPECT_TRUE(profile.update({0.9 * T * k, 0.9}));
      }
      EXPECT_LE(std::abs(profile.motion()(1)), fastest);
      if (held) {
        (void)controller.track(y, profile.motion()(0), 0);
        v = 0;
        continue;
      }
      const double u = controller.update(y, profile.motion());
      y += T * v + T * T / 2 * b0 * u;
      v += T * b0 * u;
      if (k >= 3000) most = std::max(most, std::abs(v));
    }
    EXPECT_NEAR(y, then == Then::goes_on ? 7.2 : 5.9, 0.1);  // at 1 it has not caught up yet
    return most;
  };
  // On top of the limit: the way of the brake, 1 / (2 * 20) = 0.025, times omega_c / e.
  EXPECT_LT(speed_afterwards(Then::waits), fastest + 0.025 * 25 / 2.7 + 0.1);
  EXPECT_LT(speed_afterwards(Then::starts), fastest + 0.1);
  EXPECT_GT(speed_afterwards(Then::goes_on), 8 * fastest);
}

/// What is lost goes on at its speed; what is not finite or too large counts as lost.
TEST(FollowProfile, LostTargetsGoOn) {
  const FollowProfileConfig<2> config{.limits = {{5, 50}}, .sample_time = 0.01};
  auto profile = FollowProfile<2>::make(config).value();
  auto whole = profile;
  Random random(8);
  for (int k = 0; k < 1000; ++k) {
    const double target = 0.3 + 0.02 * k;
    ASSERT_TRUE(whole.update({target, 2}));
    const double bad[] = {nan, std::numeric_limits<double>::infinity(), 1.7e308, -1e307};
    if (k > 0 && random.index(3) == 0) {
      const double absurd = bad[random.index(4)];
      ASSERT_FALSE(random.index(2) == 0   ? profile.update({absurd, 2})
                   : random.index(2) == 0 ? profile.update({target, nan})
                                          : profile.update({target, 2, nan}));
    } else {
      ASSERT_TRUE(profile.update({target, 2}));
    }
    for (int i = 0; i <= 2; ++i) ASSERT_NEAR(profile.motion()(i), whole.motion()(i), 1e-6) << k;
  }
  const auto before = profile.motion();
  EXPECT_FALSE(profile.start(nan));
  EXPECT_FALSE(profile.start(0, nan));
  EXPECT_FALSE(profile.start(1.7e308));
  EXPECT_FALSE(profile.start(0, 1e200));
  EXPECT_EQ(profile.motion()(0), before(0));
  ASSERT_TRUE(profile.start(7, 1));
  EXPECT_FALSE(profile.update(nan));
  EXPECT_NEAR(profile.motion()(0), 7, 1e-12);
  EXPECT_EQ(profile.motion()(1), 1);
  // A start is a target that stands; one that accelerated goes on at its speed.
  for (int k = 0; k < 100; ++k) EXPECT_FALSE(profile.update(nan));
  EXPECT_NEAR(profile.motion()(0), 7, 1e-9);
  ASSERT_TRUE(profile.update({7, 1, 20}));
  for (int k = 0; k < 100; ++k) EXPECT_FALSE(profile.update(nan));
  EXPECT_NEAR(profile.motion()(0), 7 + 1, 1e-9);
  EXPECT_NEAR(profile.motion()(1), 1, 1e-9);
}

/// However long it is lost, it does not go on beyond the range; nor does a retune bring it there.
TEST(FollowProfile, LostTargetsStayFinite) {
  FollowProfileConfig<1, float> config{.limits = {{1e36f}}, .sample_time = 1};
  auto profile = FollowProfile<1, float>::make(config).value();
  ASSERT_TRUE(profile.update({0, 1e35f}));
  for (int k = 0; k < 10'000; ++k) {
    ASSERT_FALSE(profile.update(static_cast<float>(nan)));
    for (const float x : profile.motion()) ASSERT_TRUE(std::isfinite(x)) << k;
  }
  ASSERT_TRUE(profile.start(0));
  ASSERT_TRUE(profile.update({0, 1e36f}));
  config = {.limits = {{1}}, .filter_time = 100, .sample_time = 1};
  EXPECT_EQ(refusal(profile.retune(config)),
            "sample_time: and limits do not suit the present motion");
  config.filter_time = 2;
  EXPECT_EQ(refusal(profile.retune(config)), "accepted");
}

/// The step of a lost target, too, may be below a digit of where it is.
template <int Order>
void goes_on_in_float() {
  FollowProfileConfig<Order, float> config{.sample_time = 1e-4f};
  config.limits[0] = 5;
  config.limits[Order - 1] = 50;
  auto profile = FollowProfile<Order, float>::make(config).value();
  ASSERT_TRUE(profile.start(1e4f, 0.5f));
  ASSERT_TRUE(profile.update({1e4f, 0.5f}));
  for (int k = 1; k <= 10'000; ++k) {
    ASSERT_FALSE(profile.update(static_cast<float>(nan)));
    ASSERT_NEAR(static_cast<double>(profile.motion()(0)), 1e4 + 0.5e-4 * k, 2e-3) << k;
  }
}
TEST(FollowProfile, LostTargetsGoOnInFloat) {
  goes_on_in_float<1>();
  goes_on_in_float<2>();
}

/// In float a step is far below a digit of r; it arrives, and stands still there.
TEST(FollowProfile, LosesNoSmallStepInFloat) {
  auto profile =
      FollowProfile<2, float>::make({.limits = {0.05f, 0.5f}, .sample_time = 1e-4f}).value();
  ASSERT_TRUE(profile.start(1e4f));
  for (int k = 0; k < 300'000; ++k) ASSERT_TRUE(profile.update(1e4f + 1.0f));
  EXPECT_EQ(profile.motion()(0), 1e4f + 1.0f);
  for (int k = 0; k < 1000; ++k) {
    ASSERT_TRUE(profile.update(1e4f + 1.0f));
    EXPECT_LT(std::abs(profile.motion()(1)), 1e-6f);
    EXPECT_LT(std::abs(profile.motion()(2)), 1e-2f * 0.5f);
  }
}

/// At the ends of the range of float nothing becomes infinite.
template <int Order>
void stays_finite(std::uint64_t seed) {
  Random random(seed);
  int made = 0;
  for (int i = 0; i < long_run(1000); ++i) {
    const auto any = [&] { return static_cast<float>(random.log_uniform(1e-37, 1e37)); };
    FollowProfileConfig<Order, float> config;
    config.sample_time = static_cast<float>(random.log_uniform(1e-12, 1e12));
    if (random.index(3) == 0) config.filter_time = config.sample_time * any();
    config.limits[0] = random.index(2) == 0 && Order == 2 ? 0.0f : any();
    config.limits[Order - 1] = any();
    if (random.index(4) == 0) config.limits[Order - 1] = std::numeric_limits<float>::max();
    auto profile = FollowProfile<Order, float>::make(config);
    if (!profile) continue;
    ++made;
    for (int k = 0; k < 200; ++k) {
      const auto given = [&] { return random.index(2) == 0 ? any() : -any(); };
      if (random.index(20) == 0) (void)profile->start(given(), given());
      if (random.index(20) == 0) {
        config.sample_time = random.index(3) == 0 ? any() : config.sample_time;
        config.limits[Order - 1] = any();
        (void)profile->retune(config);
      }
      if (random.index(10) == 0) profile->wait();
      esokit::Vector<float, Order + 1> target;
      for (float& x : target) x = random.index(2) == 0 ? 0.0f : given();
      (void)profile->update(target);
      for (const float x : profile->motion()) ASSERT_TRUE(std::isfinite(x)) << i << ' ' << k;
    }
  }
  EXPECT_GT(made, long_run(1000) / 10);
}
TEST(FollowProfile, StaysFinite) {
  stays_finite<1>(11);
  stays_finite<2>(12);
}

template <int Order, class S>
void expect_same_life() {
  using Profile = FollowProfile<Order, S>;
  FollowProfileConfig<Order, S> config{.sample_time = S(0.01)};
  config.limits[0] = S(1);
  config.limits[Order - 1] = S(5);
  auto profile = Profile::make(config).value();
  Random random(17);
  S target(0);
  for (int k = 0; k < 300; ++k) {
    if (k % 17 == 0) target = static_cast<S>(random.uniform(-1, 1));
    auto copy = profile;
    auto restored = esokit::from_snapshot<Profile>(esokit::snapshot(profile)).value();
    for (Profile* each : {&profile, &copy, &restored}) ASSERT_TRUE(each->update({target, S(0.1)}));
    for (int i = 0; i <= Order; ++i) {
      ASSERT_TRUE(same_bits(profile.motion()(i), copy.motion()(i))) << k;
      ASSERT_TRUE(same_bits(profile.motion()(i), restored.motion()(i))) << k;
    }
  }
}
TEST(FollowProfile, GoesOnFromASnapshotWithTheSameBits) {
  expect_same_life<1, float>();
  expect_same_life<2, float>();
  expect_same_life<2, double>();
}

TEST(FollowProfile, RefusesByRule) {
  const auto refused = [](auto change) {
    FollowProfileConfig<2> config{.limits = {{0, 1}}, .sample_time = 1e-3};
    change(config);
    return refusal(FollowProfile<2>::make(config));
  };
  EXPECT_EQ(refused([](auto&) {}), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.limits[0] = -1; }),
            "limits[0]: must be finite and not negative");
  EXPECT_EQ(refused([](auto& c) { c.limits[1] = 0; }), "limits[1]: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.sample_time = nan; }),
            "sample_time: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.filter_time = -1; }),
            "filter_time: must be finite and not negative");
  EXPECT_EQ(refused([](auto& c) { c.filter_time = 1e-3; }), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.filter_time = 0.9e-3; }),
            "filter_time: must be 0 or not below sample_time, which is");
  EXPECT_EQ(refused([](auto& c) { c.sample_time = 1e-160; }),
            "limits[1]: times sample_time^n leaves the scalar's range");
  // Both ends of the range: no limit of acceleration, a second apart, and a millisecond.
  constexpr double largest = std::numeric_limits<double>::max();
  EXPECT_EQ(refused([&](auto& c) {
              c.limits[1] = largest;
              c.sample_time = 2;
            }),
            "limits[1]: times sample_time^n leaves the scalar's range");
  EXPECT_EQ(refused([&](auto& c) { c.limits[1] = largest; }), "accepted");
  EXPECT_EQ(refused([&](auto& c) {
              c.limits[1] = 32 * std::numeric_limits<double>::min();
              c.sample_time = 1;
            }),
            "limits[1]: times sample_time^n leaves the scalar's range");
  EXPECT_EQ(refused([&](auto& c) {
              c.limits[1] = 64 * std::numeric_limits<double>::min();
              c.sample_time = 1;
            }),
            "accepted");
  EXPECT_EQ(refusal(FollowProfile<1>::make({.sample_time = 1})),
            "limits[0]: must be finite and positive");
}

}  // namespace control_follow_profile_test
}  // namespace esokit_test
