// OutlierGate: an outlier is a missing sample, for every observer and adapter; it opens within the
// stated number of samples, and is nothing when off.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <control/loop_traits.hpp>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <limits>
#include <support/friction.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace adapter_outlier_gate_test {

using namespace esokit;

constexpr double sample_time = 0.01;

template <class Observer>
typename Observer::Config with(typename Observer::Config config, double omega_T) {
  using S = typename Observer::scalar_type;
  auto& chain = chain_config<Observer>(config);
  chain.observer_bandwidth = static_cast<S>(omega_T / sample_time);
  chain.input_gain = S(2);
  chain.sample_time = static_cast<S>(sample_time);
  return config;
}

/// Gated and plain beside each other; the plain one is told to leave out what the gate has to find.
template <class Observer>
void outlier_is_a_missing_sample(typename Observer::Config config, double omega_T = 0.3) {
  using S = typename Observer::scalar_type;
  config = with<Observer>(config, omega_T);
  auto gated =
      OutlierGate<Observer>::make({.observer = config, .threshold = S(0.5), .most_in_a_row = 40})
          .value();
  auto plain = Observer::make(config).value();
  Random random(7);
  for (int k = 0; k < 600; ++k) {
    const S y = static_cast<S>(std::sin(0.02 * k) + 1e-3 * random.uniform(-1, 1));
    const S u = static_cast<S>(0.1 * random.uniform(-1, 1));
    const bool bad = k > 300 && random.index(4) == 0;
    const double largest = std::log(static_cast<double>(std::numeric_limits<S>::max()));
    const double size = random.index(2) == 0 ? random.uniform(6, 100)
                                             : std::exp(random.uniform(2, 0.999 * largest));
    const S outlier = y + static_cast<S>(random.index(2) == 0 ? size : -size);
    const StepStatus status = gated.update(bad ? outlier : y, u);
    const StepStatus expected = bad ? plain.predict(u) : plain.update(y, u);
    if (bad) {
      // One too large to compute with is rejected as such.
      ASSERT_TRUE(has(status, StepStatus::outlier_rejected) ||
                  has(status, StepStatus::measurement_rejected))
          << k << ' ' << static_cast<double>(outlier);
    } else {
      ASSERT_EQ(status, expected) << k;
    }
    ASSERT_EQ(gated.missed(), plain.missed());
    bool same = true;
    for (int i = 0; i < Observer::size; ++i) {
      same = same && same_bits(gated.estimate()(i), plain.estimate()(i));
    }
    ASSERT_TRUE(same) << k;
  }
}

TEST(OutlierGate, OutlierIsAMissingSample) {
  outlier_is_a_missing_sample<LinearEso<2>>({});
  outlier_is_a_missing_sample<LinearEso<2>>({}, 2);
  outlier_is_a_missing_sample<CascadeEso<2, 2>>({.bandwidth_factor = 2});
  outlier_is_a_missing_sample<AlgebraicEso<2>>({.frequency_shift = 30});
  outlier_is_a_missing_sample<AdjustableBandwidthEso<2, float>>({.bandwidth_ratio = 0.75f});
  outlier_is_a_missing_sample<NonlinearEso<2, double, 1>>(
      {.shape = {.gain_alpha = 0.75, .alpha = 1, .gain_beta = 0.25, .beta = 1}});
  outlier_is_a_missing_sample<DelayedInput<LinearEso<2>, 3>>({.delay = 2});
  outlier_is_a_missing_sample<VariableTime<LinearEso<2>>>({});
  outlier_is_a_missing_sample<KnownModel<LinearEso<2>, Friction<1, double>>>({.model = {2}});
}

/// Inside of WrappedOutput: an axis that turns by a sixth of a turn a sample is no outlier, one
/// that is off by half a turn, or by any number of them, is.
TEST(OutlierGate, Angle) {
  const auto linear = with<LinearEso<2>>({}, 0.3);
  auto plain = LinearEso<2>::make(linear).value();
  auto axis = WrappedOutput<OutlierGate<LinearEso<2>>>::make(
                  {.observer = {.observer = linear, .threshold = 20}, .period = 360})
                  .value();
  for (int k = 0; k < 500; ++k) {
    const double y = 60.0 * k + 5 * std::sin(0.1 * k);
    const bool bad = k > 200 && k % 7 < 2;
    const double off = bad ? (k % 2 == 0 ? 150 : 1e9) : 0;
    const StepStatus status = axis.update(y + off - 360 * std::floor((y + off) / 360), 0.1);
    const StepStatus expected = bad ? plain.predict(0.1) : plain.update(y, 0.1);
    if (bad) {
      ASSERT_EQ(status, StepStatus::outlier_rejected) << k;
    } else {
      ASSERT_EQ(status, expected) << k;
    }
    ASSERT_NEAR(axis.estimate<1>(), plain.estimate<1>(), 1e-5) << k;
  }
}

/// From any state, of an axis at any speed: where turns were counted only between the measurements
/// that the gate let in, the two together could keep a wrong speed for good.
TEST(OutlierGate, AngleComesBackFromAnyState) {
  Random random(5);
  for (int trial = 0; trial < 2000; ++trial) {
    const double omega_T = random.uniform(0.2, 1.5);
    const double period = random.log_uniform(0.1, 1000);
    auto axis = WrappedOutput<OutlierGate<LinearEso<2>>>::make(
                    {.observer = {.observer = with<LinearEso<2>>({}, omega_T),
                                  .threshold = period * random.uniform(0.02, 1),
                                  .most_in_a_row = 1 + random.index(8)},
                     .period = period})
                    .value();
    const double speed = period * random.uniform(-0.45, 0.45);  // a sample
    double y = 0;
    const auto step = [&] {
      y += speed;
      return axis.update(y - period * std::floor(y / period), 0);
    };
    ASSERT_EQ(axis.reset({0, period * random.uniform(-9, 9) / sample_time,
                          period * random.uniform(-9, 9) / (sample_time * sample_time)}),
              StepStatus::ok);
    for (int k = 0; k < random.index(4); ++k) (void)axis.update(period * random.uniform(0, 1), 0);
    for (int k = 0; k < 1000; ++k) (void)step();
    ASSERT_EQ(step(), StepStatus::ok) << trial;
    ASSERT_NEAR(axis.estimate<1>() * sample_time / period, speed / period, 1e-9) << trial;
  }
}

/// A true step of any size: so many samples late, no more, and then the observer follows it as one
/// that began there would.
TEST(OutlierGate, OpensAfterAStepOfAnySize) {
  Random random(3);
  for (int trial = 0; trial < 300; ++trial) {
    // The observer bridges 14 / (omega_o T).
    const double omega_T = random.uniform(0.2, 2);
    const int most = 1 + random.index(std::min(20, static_cast<int>(14 / omega_T) - 2));
    auto gated =
        OutlierGate<LinearEso<2>>::make({.observer = with<LinearEso<2>>({}, omega_T),
                                         .threshold = random.log_uniform(1e-3, 1),
                                         .running_factor = random.index(2) == 0 ? 0.0 : 6.0,
                                         .most_in_a_row = most})
            .value();
    EXPECT_TRUE(gated.open());
    for (int k = 0; k < 400; ++k) (void)gated.update(1.0, 0);
    EXPECT_FALSE(gated.open());
    const double step = random.log_uniform(100, 1e30) * (random.index(2) == 0 ? 1 : -1);
    for (int k = 0; k < most; ++k) {
      ASSERT_EQ(gated.update(step, 0), StepStatus::outlier_rejected) << k << ' ' << step;
      ASSERT_EQ(gated.missed(), k + 1);
    }
    ASSERT_EQ(gated.update(step, 0), StepStatus::gap_bridged);
    EXPECT_TRUE(gated.open());
    const int settling = 100 + static_cast<int>(2 * 110 / omega_T);
    // Where the error swings through zero it may shut for a while, never for longer than before.
    int in_a_row = 0;
    for (int k = 0; k < settling; ++k) {
      in_a_row = has(gated.update(step, 0), StepStatus::outlier_rejected) ? in_a_row + 1 : 0;
      ASSERT_LE(in_a_row, most) << k;
    }
    EXPECT_NEAR(gated.estimate<0>(), step, 1e-9 * std::abs(step));
    EXPECT_NEAR(gated.estimate<1>() * sample_time, 0, 1e-9 * std::abs(step));
    // And it shuts again, where a rounding of y is within the threshold.
    if (std::abs(step) > 1e8) continue;
    EXPECT_FALSE(gated.open());
    EXPECT_EQ(gated.update(1.001 * step + 1e9, 0), StepStatus::outlier_rejected);
  }
}

/// The limit from both sides; it widens with what is missing; noise widens it by the running mean.
TEST(OutlierGate, Limit) {
  const auto made = [](double factor) {
    auto gate =
        OutlierGate<LinearEso<2>>::make(
            {.observer = with<LinearEso<2>>({}, 0.3), .threshold = 0.5, .running_factor = factor})
            .value();
    for (int k = 0; k < 5; ++k) {
      EXPECT_TRUE(gate.open());
      EXPECT_EQ(gate.update(0, 0), StepStatus::ok);
    }
    EXPECT_FALSE(gate.open());
    return gate;
  };
  auto gate = made(0);
  auto inside = gate;
  EXPECT_EQ(inside.update(0.499, 0), StepStatus::ok);
  inside = gate;
  EXPECT_EQ(inside.update(-0.501, 0), StepStatus::outlier_rejected);
  gate.predict(0);
  gate.predict(0);
  inside = gate;
  EXPECT_EQ(inside.update(-1.499, 0), StepStatus::gap_bridged);
  EXPECT_EQ(gate.update(1.501, 0), StepStatus::outlier_rejected);
  EXPECT_EQ(gate.correct(1.501), StepStatus::outlier_rejected);
  EXPECT_EQ(gate.correct(1.499), StepStatus::gap_bridged);

  auto running = made(5);
  Random random(1);
  EXPECT_EQ(running.limit(), 0.5);
  double sum = 0;
  int rejected = 0;
  constexpr int samples = 4000;
  for (int k = 0; k < samples; ++k) {
    // Slowly, from within the gate.
    const double noise = random.uniform(-1, 1) * std::min(1.0, 0.2 + 1e-3 * k);
    if (running.update(noise, 0) != StepStatus::ok) ++rejected;
    if (k >= samples / 2) sum += std::abs(running.innovation());
  }
  EXPECT_EQ(rejected, 0);
  // The mean over 64 samples is that over 2000 within its own scatter, 1 / sqrt(128) here.
  EXPECT_NEAR(running.limit(), 5 * sum / (samples / 2), 0.5 * running.limit());
  EXPECT_EQ(running.update(1e30, 0), StepStatus::outlier_rejected);
  // What got in while it was open does not keep it open.
  auto opened =
      OutlierGate<LinearEso<2>>::make(
          {.observer = with<LinearEso<2>>({}, 1.5), .threshold = 0.5, .running_factor = 5})
          .value();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(opened.update(1e30, 0), StepStatus::ok);
  for (int k = 0; k < 300; ++k) (void)opened.update(0, 0);
  EXPECT_LT(opened.limit(), 5.0);
  EXPECT_FALSE(opened.open());
}

/// The running scale is learned from measurements that come at every D-th sample, too.
TEST(OutlierGate, RunningLimitWithoutNeighbours) {
  for (const int divider : {1, 2, 5}) {
    auto gate =
        OutlierGate<LinearEso<2>>::make(
            {.observer = with<LinearEso<2>>({}, 0.3), .threshold = 1e-3, .running_factor = 5})
            .value();
    Random random(1);
    double sum = 0;
    constexpr int measurements = 4000;
    int rejected = 0;
    for (int k = 0; k < measurements; ++k) {
      for (int i = 1; i < divider; ++i) gate.predict(0);
      const StepStatus status = gate.update(random.uniform(-1, 1), 0);
      if (k < measurements / 2) continue;
      if (has(status, StepStatus::outlier_rejected)) ++rejected;
      sum += std::abs(gate.innovation());
    }
    EXPECT_EQ(rejected, 0) << divider;
    EXPECT_FALSE(gate.open()) << divider;
    // As in Limit.
    EXPECT_NEAR(gate.limit(), 5 * sum / (measurements / 2), 0.5 * gate.limit()) << divider;
    // A long gap counts as one measurement.
    const double before = gate.limit();
    for (int i = 0; i < 40; ++i) gate.predict(0);
    EXPECT_EQ(gate.update(before * 30, 0), StepStatus::gap_bridged);
    EXPECT_LE(gate.limit(), before * (1 + 4.0 / 64 + 1e-12)) << divider;
  }
}

/// Off, it is the observer, bit for bit; it can be switched on and off while running.
TEST(OutlierGate, OffAndRetuned) {
  using Gate = OutlierGate<LinearEso<2>>;
  const auto linear = with<LinearEso<2>>({}, 0.3);
  auto gate = Gate::make({.observer = linear}).value();
  auto plain = LinearEso<2>::make(linear).value();
  Random random(5);
  for (int k = 0; k < 100; ++k) {
    const double y = k == 50 ? 1e30 : random.uniform(-1, 1);
    ASSERT_EQ(gate.update(y, 0.1), plain.update(y, 0.1));
    ASSERT_EQ(gate.estimate(), plain.estimate());
  }
  for (int k = 0; k < 1000; ++k) gate.update(1, 0);
  Gate::Config config{.observer = linear, .threshold = 0.1, .most_in_a_row = 2};
  ASSERT_TRUE(gate.retune(config).has_value());
  for (int k = 0; k < 2; ++k) gate.update(1, 0);
  EXPECT_EQ(gate.update(9, 0), StepStatus::outlier_rejected);
  const auto before = gate.estimate();
  const auto refused = [&](const Gate::Config& bad, const char* field, const char* rule) {
    const auto error = gate.retune(bad);
    ASSERT_FALSE(error.has_value()) << field;
    EXPECT_STREQ(error.error().field, field);
    EXPECT_STREQ(error.error().rule, rule);
    EXPECT_STREQ(Gate::make(bad).error().rule, rule);
    EXPECT_EQ(gate.estimate(), before);
  };
  for (const double bad : {-0.1, hidden_nan<double>(), hidden_infinity<double>()}) {
    const auto number = esokit::Rules<double>{}.not_negative("x", bad).error().rule;
    refused({.observer = linear, .threshold = bad}, "threshold", number);
    refused({.observer = linear, .threshold = 1, .running_factor = bad}, "running_factor", number);
  }
  refused({.observer = linear, .running_factor = 3}, "threshold",
          "must be positive if running_factor is: without noise nothing would pass");
  for (const int bad : {-1, 0, 65001}) {
    refused({.observer = linear, .threshold = 1, .most_in_a_row = bad}, "most_in_a_row",
            "must be 1 .. 65000");
  }
  refused({.observer = {}, .threshold = 1}, "input_gain",
          Gate::make({.observer = {}}).error().rule);
  EXPECT_TRUE(Gate::make({.observer = linear, .threshold = 1, .most_in_a_row = 65000}));
  ASSERT_TRUE(gate.retune({.observer = linear}).has_value());
  EXPECT_FALSE(has(gate.update(9, 0), StepStatus::outlier_rejected));
  // A bad u is reported beside the outlier.
  ASSERT_TRUE(gate.retune(config).has_value());
  for (int k = 0; k < 1000; ++k) gate.update(1, 0);
  EXPECT_EQ(gate.update(1e9, hidden_nan<double>()),
            StepStatus::input_rejected | StepStatus::outlier_rejected);
  // After a reset it is open until a measurement fits.
  gate.reset(1.0);
  EXPECT_TRUE(gate.open());
  EXPECT_EQ(gate.reset(hidden_nan<double>()), StepStatus::state_rejected);
  EXPECT_EQ(gate.update(5, 0), StepStatus::ok);
  EXPECT_EQ(gate.reset(EigenMatrix<double, 3>(5, 0, 0)), StepStatus::ok);
  EXPECT_EQ(gate.update(5, 0), StepStatus::ok);
  EXPECT_TRUE(gate.open());
  EXPECT_EQ(gate.update(5, 0), StepStatus::ok);
  EXPECT_FALSE(gate.open());
  EXPECT_EQ(gate.update(7, 0), StepStatus::outlier_rejected);
}

/// In a loop: 1e30 every fiftieth sample is as good as missing; without the gate it saturates u.
TEST(OutlierGate, InAdrc) {
  const auto worst = []<class Observer>(const typename Observer::Config& config, Observer*) {
    auto controller =
        Adrc<Observer>::make(
            {.observer = config, .controller_bandwidth = 8, .limits = {.lower = -5, .upper = 5}})
            .value();
    ChainPlant plant(2, sample_time, 2, -3);
    double largest = 0;
    for (int k = 0; k < 3000; ++k) {
      const double y = k > 1000 && k % 50 == 0 ? 1e30 : plant.output();
      plant.step(controller.update(y, 1.0));
      EXPECT_EQ(controller.mode(), LoopMode::running);
      if (k > 1000) largest = std::max(largest, std::abs(plant.output() - 1));
    }
    return largest;
  };
  const auto linear = with<LinearEso<2>>({}, 0.5);
  using Gate = OutlierGate<LinearEso<2>>;
  EXPECT_LT(worst({.observer = linear, .threshold = 0.5}, static_cast<Gate*>(nullptr)), 1e-6);
  EXPECT_GT(worst(linear, static_cast<LinearEso<2>*>(nullptr)), 1);
}

static_assert(LoopObserver<WrappedOutput<OutlierGate<LinearEso<2, float>>>>);
static_assert(sizeof(OutlierGate<LinearEso<2, float>>) == sizeof(LinearEso<2, float>) + 20);

}  // namespace adapter_outlier_gate_test
}  // namespace esokit_test
