// GainProbe: b / b0 under a load that u reacts to, in any sign and unit, and an end in the steps'
// limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <control/loop_traits.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_gain_probe_test {

using namespace esokit;

constexpr double sample_time = 1e-3;
constexpr double omega_o = 100;

template <class S>
auto loop_of(double b0) {
  using Loop = Adrc<Guarded<LinearEso<2, S>>>;
  typename Loop::Config config{};
  config.observer.observer = {.observer_bandwidth = static_cast<S>(omega_o),
                              .input_gain = static_cast<S>(b0),
                              .sample_time = static_cast<S>(sample_time)};
  config.controller_bandwidth = S(20);
  config.limits = {.lower = S(-1), .upper = S(1)};
  return Loop::make(config).value();
}

template <class S>
typename GainProbe<3, S>::Config settings() {
  return {.observer_bandwidth = static_cast<S>(omega_o),
          .sample_time = static_cast<S>(sample_time),
          .amplitude = static_cast<S>(0.1),
          .travel = S(5),
          .limits = {.lower = S(-1), .upper = S(1)}};
}

/// A regulator under a load that swings, which drives u by more than the steps do.
template <class S>
void ratio_is_that_of_the_gains() {
  for (const double sign : {1.0, -1.0}) {
    for (const double ratio : {0.1, 0.5, 1.0, 1.6}) {
      const double b0 = sign * 20;
      auto loop = loop_of<S>(b0);
      auto probe = GainProbe<3, S>::make(settings<S>()).value();
      ChainPlant plant(2, sample_time, b0 * ratio, 0);
      S applied{};
      double most = 0;
      int samples = 0;
      while (!probe.finished() && ++samples < 2000) {
        plant.set_disturbance(2 * ratio * std::sin(0.005 * samples));
        const auto y = static_cast<S>(plant.output());
        const S u = loop.update(y, S(0), applied);
        applied = probe.update(loop, y);
        most = std::max(most, std::abs(static_cast<double>(applied - u)));
        plant.step(static_cast<double>(applied));
      }
      ASSERT_FALSE(probe.aborted());
      // Nine periods of 10 / omega_o.
      EXPECT_EQ(samples, 900);
      EXPECT_NEAR(most, 0.1, 1e-6);
      const auto found = probe.result().value();
      EXPECT_NEAR(static_cast<double>(found.gain_ratio), ratio, 0.05) << sign;
      EXPECT_GT(found.half_width, S(0));
      EXPECT_LT(found.half_width, S(0.15));
      // After it u is the loop's.
      const S u = loop.update(S(0), S(0), applied);
      EXPECT_EQ(probe.update(loop, S(0)), u);
    }
  }
}

TEST(GainProbe, RatioIsThatOfTheGainsUnderALoad) {
  ratio_is_that_of_the_gains<double>();
  ratio_is_that_of_the_gains<float>();
}

TEST(GainProbe, EndsWhereItMustNotGoOn) {
  for (const bool far : {true, false}) {
    auto loop = loop_of<double>(20);
    auto probe = GainProbe<3>::make(settings<double>()).value();
    (void)loop.update(0, 0);
    EXPECT_NE(probe.update(loop, 0), loop.output());
    EXPECT_EQ(refusal(probe.result()), "periods: are too few: not finished, or aborted");
    const double y = far ? 5.01 : hidden_nan<double>();
    EXPECT_EQ(probe.update(loop, y), loop.output()) << far;
    EXPECT_TRUE(probe.aborted());
    EXPECT_EQ(probe.update(loop, 0), loop.output());
    EXPECT_EQ(refusal(probe.result()), "periods: are too few: not finished, or aborted");
  }
  auto loop = loop_of<double>(20);
  auto probe = GainProbe<3>::make(settings<double>()).value();
  (void)loop.update(0, 0);
  (void)probe.update(loop, 0);
  (void)probe.update(loop, 4.99);
  EXPECT_FALSE(probe.aborted());
}

/// What a probe asks of a controller, under the test's control.
struct Fake {
  struct Observer {
    static constexpr int size = 2;
    double u = 0, d = 0;
    double input_gain() const { return 1; }
    double applied_input() const { return u; }
    double total_disturbance() const { return d; }
  };
  Observer seen;
  double wanted = 0;
  const Observer& observer() const { return seen; }
  LoopMode mode() const { return LoopMode::running; }
  double output() const { return wanted; }
};

/// The interval of 6 periods of noise alone covers b = b0 as often as 95 % do.
TEST(GainProbe, IntervalCoversTheNoise) {
  Random random(17);
  int covered = 0;
  constexpr int trials = 4000;
  for (int trial = 0; trial < trials; ++trial) {
    auto probe = GainProbe<2>::make({.observer_bandwidth = 1,
                                     .sample_time = 1,
                                     .amplitude = 1,
                                     .travel = 1,
                                     .periods = 6,
                                     .limits = {.lower = -9, .upper = 9}})
                     .value();
    Fake loop;
    while (!probe.finished()) {
      loop.seen.u = probe.update(loop, 0);
      loop.seen.d = random.uniform(-1, 1) + random.uniform(-1, 1) + random.uniform(-1, 1);
    }
    const auto found = probe.result().value();
    covered += std::abs(found.gain_ratio - 1) <= found.half_width ? 1 : 0;
  }
  // Three standard errors of the share.
  EXPECT_NEAR(static_cast<double>(covered) / trials, 0.95, 3 * std::sqrt(0.95 * 0.05 / trials));
}

TEST(GainProbe, RateCountsFromWhatWasHeldAndTravelFromTheStart) {
  auto config = settings<double>();
  config.limits.rate = 10;  // 0.01 a sample
  auto probe = GainProbe<2>::make({.observer_bandwidth = omega_o,
                                   .sample_time = sample_time,
                                   .amplitude = 0.1,
                                   .travel = 5,
                                   .limits = config.limits})
                   .value();
  Fake loop;
  loop.seen.u = 0.5;
  EXPECT_NEAR(probe.update(loop, 2), 0.49, 1e-12);
  (void)probe.update(loop, 7);
  EXPECT_FALSE(probe.aborted());
  (void)probe.update(loop, -3.000001);
  EXPECT_TRUE(probe.aborted());
}

TEST(GainProbe, StaysWithinTheLimits) {
  auto loop = loop_of<double>(20);
  auto config = settings<double>();
  config.limits = {.lower = -0.05, .upper = 0.08};
  auto probe = GainProbe<3>::make(config).value();
  double applied = 0, high = 0, low = 0;
  while (!probe.finished()) {
    (void)loop.update(0, 0, applied);
    applied = probe.update(loop, 0);
    high = std::max(high, applied);
    low = std::min(low, applied);
  }
  EXPECT_EQ(high, 0.08);
  EXPECT_EQ(low, -0.05);
}

TEST(GainProbe, Refusals) {
  const auto refused = [](auto change) {
    auto config = settings<double>();
    change(config);
    return refusal(GainProbe<3>::make(config));
  };
  using Config = GainProbe<3>::Config;
  for (const double bad : {0.0, -1.0, hidden_nan<double>(), hidden_infinity<double>()}) {
    const char* const rule = ": must be finite and positive";
    EXPECT_EQ(refused([&](Config& c) { c.observer_bandwidth = bad; }),
              std::string("observer_bandwidth") + rule);
    EXPECT_EQ(refused([&](Config& c) { c.sample_time = bad; }), std::string("sample_time") + rule);
    EXPECT_EQ(refused([&](Config& c) { c.amplitude = bad; }), std::string("amplitude") + rule);
    EXPECT_EQ(refused([&](Config& c) { c.travel = bad; }), std::string("travel") + rule);
  }
  for (const int periods : {5, 201}) {
    EXPECT_EQ(refused([&](Config& c) { c.periods = periods; }), "periods: must be 6 .. 200");
  }
  EXPECT_EQ(refused([](Config& c) { c.sample_time = 0.0101; }),
            "observer_bandwidth: times sample_time must be at most");
  EXPECT_EQ(refused([](Config& c) { c.sample_time = 1e-10; }),
            "observer_bandwidth: makes half a period longer than 2^24 samples");
  EXPECT_NE(refused([](Config& c) { c.limits.lower = 2; }), "");
  for (const int periods : {6, 200}) {
    auto config = settings<double>();
    config.sample_time = 0.01;
    config.periods = periods;
    EXPECT_TRUE(GainProbe<3>::make(config).has_value());
  }
}

}  // namespace control_gain_probe_test
}  // namespace esokit_test
