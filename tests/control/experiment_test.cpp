// Relay and step experiments: exact on the model, honest beside noise, within limits whatever
// comes.
#include <gtest/gtest.h>

#include <algorithm>

#include <cmath>
#include <cstddef>
#include <esokit/control/adrc.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <numbers>
#include <support/no_allocation.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_experiment_test {

using esokit::AbortReason;
using esokit::Excitation;
using esokit::Experiment;
using esokit::ExperimentConfig;
using esokit::ExperimentPhase;

/// y^(n) = b0 v(t - L) + d, tau v' + v = u: exact, u held over a sample, L in whole samples. A
/// pole (order 1) acts in halves before and after a sample: of second order.
class Plant {
 public:
  Plant(int order, double input_gain, double lag, int dead_samples, double T, double d = 0,
        double ramp = 0, double pole = 0)
      : order_(order), b0_(input_gain), lag_(lag), T_(T), d_(d), ramp_(ramp), pole_(pole) {
    line_.assign(static_cast<std::size_t>(dead_samples) + 1, 0.0);
  }
  void start(double y, double u) {
    x_ = y;
    v_ = u;
    line_.assign(line_.size(), u);
  }
  /// Coulomb's, order 2. @param speed below which it gives way
  Plant& rub(double force, double speed) {
    friction_ = force;
    rubbed_speed_ = speed;
    return *this;
  }
  void step(double u) {
    line_[at_] = u;
    at_ = (at_ + 1) % line_.size();
    const double held = line_[at_];
    // v = held + gap e^(-t / lag), integrated once and twice.
    const double gap = v_ - held;
    const double decay = lag_ > 0 ? std::exp(-T_ / lag_) : 0.0;
    const double once = held * T_ + gap * lag_ * (1 - decay);
    const double twice = held * T_ * T_ / 2 + gap * lag_ * (T_ - lag_ * (1 - decay));
    d_ += ramp_ * T_;
    if (order_ == 1) {
      x_ *= std::exp(-pole_ * T_ / 2);
      x_ += b0_ * once + d_ * T_;
      x_ *= std::exp(-pole_ * T_ / 2);
    } else {
      const double d = d_ - friction_ * std::tanh(speed_ / rubbed_speed_);
      x_ += speed_ * T_ + b0_ * twice + d * T_ * T_ / 2;
      speed_ += b0_ * once + d * T_;
    }
    v_ = held + gap * decay;
  }
  [[nodiscard]] double y() const { return x_; }
  [[nodiscard]] double speed() const { return speed_; }

 private:
  int order_;
  double b0_, lag_, T_, d_, ramp_, pole_;
  double x_ = 0, speed_ = 0, v_ = 0, friction_ = 0, rubbed_speed_ = 1;
  std::vector<double> line_;
  std::size_t at_ = 0;
};

constexpr double T = 1e-3;

ExperimentConfig<double> relay(int order) {
  return {.sample_time = T,
          .amplitude = 1,
          .hysteresis = order == 1 ? 0.1 : 0.004,
          .lead = order == 1 ? 0.0 : 0.12,
          .travel = 10,
          .time_limit = 100};
}

ExperimentConfig<double> steps() {
  return {.sample_time = T,
          .excitation = Excitation::steps,
          .amplitude = 1,
          .half_period = 0.1,
          .travel = 10,
          .time_limit = 100};
}

template <int Order, class S = double>
Experiment<Order, S> run(const ExperimentConfig<S>& config, Plant plant, double noise = 0,
                         std::uint64_t seed = 1) {
  auto experiment = Experiment<Order, S>::make(config).value();
  Random random(seed);
  while (!experiment.finished()) {
    // Uniform: as white, and no longer tails than an encoder has.
    const double y = plant.y() + noise * std::sqrt(3.0) * random.uniform(-1, 1);
    plant.step(static_cast<double>(experiment.update(static_cast<S>(y))));
  }
  return experiment;
}

/// With steps and dead time the sums are those of a periodic u: nothing but rounding is left.
TEST(Experiment, IsExactOnAChainWithDeadTime) {
  for (const double d : {0.0, 0.3}) {
    const auto one = run<1>(steps(), Plant(1, 5, 0, 9, T, d));
    ASSERT_EQ(one.phase(), ExperimentPhase::done);
    EXPECT_NEAR(one.result()->input_gain, 5, 1e-9);
    EXPECT_NEAR(one.result()->latency, 9 * T, 1e-11);
    // What a lag could hide between the samples: (w T)^2 / 8.
    EXPECT_NEAR(one.result()->input_gain_half_width, 5 * 0.0314159 * 0.0314159 / 8, 1e-6);
    EXPECT_EQ(one.result()->windows, 4);
    EXPECT_NEAR(one.result()->frequency, 2 * std::numbers::pi / 0.2, 1e-9);
    const auto two = run<2>(steps(), Plant(2, 5, 0, 9, T, d));
    // The second difference of y loses y / (w T)^2 to rounding.
    EXPECT_NEAR(two.result()->input_gain, 5, 1e-6);
    EXPECT_NEAR(two.result()->latency, 9 * T, 1e-8);
  }
}

/// A lag is sampled: its error is of order T^2.
TEST(Experiment, TellsLagFromDeadTimeToSecondOrder) {
  double error[2];
  for (const int half : {0, 1}) {
    auto config = steps();
    config.sample_time = half == 1 ? T / 2 : T;
    const Plant plant(1, 5, 0.012, half == 1 ? 10 : 5, config.sample_time);
    const auto found = run<1>(config, plant).result().value();
    EXPECT_NEAR(found.input_gain, 5, 0.01);
    EXPECT_NEAR(found.latency, 0.017, 2e-4);
    EXPECT_LT(found.least, 5);
    EXPECT_GT(found.largest, 5);
    error[half] = std::abs(found.input_gain - 5);
  }
  EXPECT_NEAR(error[0] / error[1], 4, 0.5);
}

/// A ramp of d in unweighted sums of N samples would be r T N / (8 A) of H; weighted a third.
TEST(Experiment, TakesARampOfTheDisturbanceOut) {
  const auto found = run<1>(steps(), Plant(1, 5, 0, 9, T, 0, 1.5)).result().value();
  const double plain = 1.5 * T * 400 / 8;
  const double off =
      std::hypot(found.input_gain - 5, 5 * found.frequency * (found.latency - 9 * T));
  EXPECT_LT(off, 0.5 * plain);
}

/// Steps: half a turn, three more until the cycle is known, and 16 that are measured. The first
/// half keeps a machine of order 2 where it is.
TEST(Experiment, StepsKeepTheirTime) {
  auto config = steps();
  config.travel = 5.0 * 0.1 * 0.1 / 4 * 1.01;
  const auto found = run<2>(config, Plant(2, 5, 0, 0, T));
  EXPECT_EQ(found.reason(), AbortReason::none);
  EXPECT_EQ(found.samples(), 50 + 5 * 100 + 16 * 100 + 1);
}

/// Where lag and dead time hardly matter, it is the scatter of the windows that makes the interval.
TEST(Experiment, NoiseIsInTheInterval) {
  auto config = steps();
  config.cycles = 6;
  int covered = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto found = run<1>(config, Plant(1, 5, 0, 1, T), 0.05, seed).result();
    // Noise as large as the latency may turn its sign.
    if (!found) continue;
    covered += std::abs(found->input_gain - 5) <= found->input_gain_half_width ? 1 : 0;
    EXPECT_GT(found->input_gain_half_width, 1e-3);
  }
  EXPECT_GE(covered, 10);
}

TEST(Experiment, DampingIsFoundAndTakenOut) {
  for (const double pole : {0.0, 1.5, 5.0, 20.0}) {
    const auto found = run<1>(steps(), Plant(1, 5, 0.01, 5, T, 0, 0, pole)).result();
    ASSERT_TRUE(found) << pole;
    EXPECT_NEAR(found->input_gain, 5, 0.01) << pole;
    EXPECT_LT(std::abs(found->input_gain - 5), found->input_gain_half_width) << pole;
    EXPECT_NEAR(found->latency, 0.015, 5e-4) << pole;
    EXPECT_NEAR(found->pole, pole, 0.01 * pole + 0.02) << pole;
  }
  EXPECT_EQ(refusal(run<1>(steps(), Plant(1, 5, 0.01, 5, T, 0, 0, 34)).result()),
            "pole: as a share of the frequency is too large: use a smaller hysteresis or "
            "half_period; must be at most");
  EXPECT_EQ(refusal(run<1>(steps(), Plant(1, 5, 0.01, 30, T, 0, 0, 50)).result()),
            "misfit: of the third harmonic, rad, is too large: the machine has another order or "
            "more than lag and dead time, or damping or friction is too large; must be at most");
}

TEST(Experiment, RelayFindsOrderOneAndTwo) {
  for (const auto& [lag, dead] : {std::pair{0.0, 20}, {0.02, 0}, {0.015, 6}}) {
    const double latency = lag + dead * T;
    const auto one = run<1>(relay(1), Plant(1, 5, lag, dead, T));
    ASSERT_EQ(one.phase(), ExperimentPhase::done) << lag;
    EXPECT_NEAR(one.result()->input_gain, 5, 0.05) << lag;
    EXPECT_NEAR(one.result()->latency, latency, 0.03 * latency) << lag;
    const auto two = run<2>(relay(2), Plant(2, 5, lag, dead, T));
    ASSERT_EQ(two.phase(), ExperimentPhase::done) << lag;
    EXPECT_NEAR(two.result()->input_gain, 5, 0.05) << lag;
    EXPECT_NEAR(two.result()->latency, latency, 0.03 * latency) << lag;
  }
}

/// Friction turns the first and third harmonic opposite ways.
TEST(Experiment, FrictionIsFoundAndTakenOut) {
  for (const double share : {0.05, 0.1, 0.2}) {
    for (const double sign : {1.0, -1.0}) {
      auto config = relay(2);
      config.amplitude = sign * 2;
      const auto found =
          run<2>(config, Plant(2, sign * 5, 0.01, 5, T).rub(share * 10, 0.01)).result();
      ASSERT_TRUE(found) << share;
      EXPECT_NEAR(found->input_gain * sign, 5, 0.1) << share;
      EXPECT_LT(std::abs(found->input_gain * sign - 5), found->input_gain_half_width);
      EXPECT_NEAR(found->latency, 0.015, 1.5e-3) << share;
      EXPECT_NEAR(found->friction, share * 10, share) << share;
    }
  }
  // A load that u0 does not hold makes the speed longer one way: in the interval.
  const auto loaded = run<2>(relay(2), Plant(2, 5, 0.01, 5, T, 1.5).rub(0.2 * 5, 0.01)).result();
  ASSERT_TRUE(loaded);
  EXPECT_GT(std::abs(loaded->input_gain - 5), 0.1);
  EXPECT_LT(std::abs(loaded->input_gain - 5), loaded->input_gain_half_width);
  EXPECT_EQ(refusal(run<2>(relay(2), Plant(2, 5, 0.01, 5, T).rub(0.35 * 5, 0.01)).result()),
            "friction: as a share of b0 A is too large: use a larger amplitude; must be at most");
  // None is seen where there is none, but for rounding.
  EXPECT_LT(run<2>(relay(2), Plant(2, 5, 0.01, 5, T)).result()->friction, 0.05);
}

/// 40 machines of each order with lag, dead time, an offset and noise.
template <int Order>
void interval_covers(double most_friction = 0) {
  Random random(20261122);
  int covered = 0, done = 0;
  std::vector<double> errors;
  for (int i = 0; i < 40; ++i) {
    const double b0 = random.log_uniform(0.1, 1000), lag = random.log_uniform(2e-3, 4e-2);
    const int dead = random.index(10);
    const double latency = lag + dead * T;
    auto config = relay(Order);
    config.cycles = 6;
    config.hysteresis = Order == 1 ? b0 * latency * random.uniform(1, 3)
                                   : b0 * latency * latency * random.uniform(0.5, 3);
    if (Order == 2) config.lead = latency * random.uniform(5, 12);
    config.travel = 1e3 * config.hysteresis;
    const double noise = config.hysteresis / random.uniform(10, 50) / (Order == 2 ? 4 : 1);
    Plant plant(Order, b0, lag, dead, T, random.uniform(-0.3, 0.3) * b0);
    if (most_friction > 0) {
      // A load that u0 holds nearly.
      plant = Plant(Order, b0, lag, dead, T, random.uniform(-0.1, 0.1) * b0);
      plant.rub(random.uniform(0, most_friction) * b0, 0.01 * b0 * config.lead);
    }
    const auto experiment = run<Order>(config, plant, noise, random.bits());
    const auto found = experiment.result();
    if (!found) continue;
    ++done;
    const double error = std::abs(found->input_gain - b0);
    errors.push_back(error / b0);
    if (error <= found->input_gain_half_width) ++covered;
    EXPECT_LT(error, 0.15 * b0);
  }
  // 95 % less two standard errors of 40.
  EXPECT_GE(done, 35);
  EXPECT_GE(covered, 0.88 * done);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.02);
}
TEST(Experiment, IntervalCoversOrderOne) { interval_covers<1>(); }
TEST(Experiment, IntervalCoversOrderTwo) { interval_covers<2>(); }
TEST(Experiment, IntervalCoversFriction) { interval_covers<2>(0.25); }

/// In units that are powers of two the same bits.
TEST(Experiment, UnitsOfInputAndOutputDoNotMatter) {
  const auto plain = run<2>(relay(2), Plant(2, 5, 0.01, 5, T)).result().value();
  auto config = relay(2);
  config.amplitude *= 8;
  config.hysteresis *= 0.25;
  config.travel *= 0.25;
  const auto scaled = run<2>(config, Plant(2, 5.0 / 32, 0.01, 5, T)).result().value();
  EXPECT_EQ(scaled.input_gain, plain.input_gain / 32);
  EXPECT_EQ(scaled.input_gain_half_width, plain.input_gain_half_width / 32);
  EXPECT_EQ(scaled.latency, plain.latency);
}

TEST(Experiment, MachineThatTurnsTheOtherWay) {
  for (const auto& config : {relay(1), steps()}) {
    const auto plain = run<1>(config, Plant(1, 5, 0.01, 5, T)).result().value();
    auto turned = config;
    turned.amplitude = -1;
    const auto found = run<1>(turned, Plant(1, -5, 0.01, 5, T)).result().value();
    EXPECT_EQ(found.input_gain, -plain.input_gain);
    EXPECT_EQ(found.latency, plain.latency);
    EXPECT_EQ(found.input_gain_half_width, plain.input_gain_half_width);
    // Told the wrong sign, the relay drives it away, and the limit ends that.
    auto wrong = config;
    wrong.amplitude = -1;
    const auto away = run<1>(wrong, Plant(1, 5, 0.01, 5, T));
    if (config.excitation == Excitation::relay) {
      EXPECT_EQ(away.reason(), AbortReason::travel);
    } else {
      EXPECT_EQ(refusal(away.result()),
                "latency: does not fit: friction or damping is too large for this amplitude, or "
                "the order or the sign of amplitude is wrong");
    }
  }
}

/// The operating point: the machine stands at y0 under u0, and the experiment stays around it.
TEST(Experiment, StaysAroundTheOperatingPoint) {
  auto config = relay(1);
  config.input = 0.4;
  config.rest = 0.05;
  config.hand_over = 0.03;
  auto experiment = Experiment<1>::make(config).value();
  Plant plant(1, 5, 0.01, 5, T, -2);
  plant.start(7, 0.4);
  int moved = 0, resting = 0, handing = 0;
  std::vector<esokit::ExperimentRow<double>> rows;
  std::vector<double> u, y;
  while (!experiment.finished()) {
    // In the rest it swings by what the mean takes out.
    const double swing = experiment.samples() >= 50      ? 0
                         : experiment.samples() % 2 == 0 ? 0.2
                                                         : -0.2;
    y.push_back(plant.y() + swing);
    u.push_back(experiment.update(y.back()));
    if (experiment.samples() > 1) rows.push_back(experiment.row());
    plant.step(u.back());
    resting += experiment.phase() == ExperimentPhase::rest ? 1 : 0;
    handing += experiment.phase() == ExperimentPhase::hand_over ? 1 : 0;
    if (u.back() != 0.4) ++moved;
    EXPECT_TRUE(u.back() == 0.4 || u.back() == 1.4 || u.back() == -0.6);
    EXPECT_EQ(u.back(), experiment.output());
    EXPECT_LT(std::abs(plant.y() - 7), 0.4);
  }
  EXPECT_EQ(resting, 50);
  EXPECT_EQ(handing, 30);
  // Of the 50 and the one with which the relay begins.
  EXPECT_NEAR(experiment.rest_output(), 7, 1e-12);
  EXPECT_EQ(experiment.output(), 0.4);
  EXPECT_EQ(experiment.update(7), 0.4);
  EXPECT_EQ(experiment.stop(), 0.4);
  EXPECT_EQ(experiment.phase(), ExperimentPhase::done);
  // The log has every row but the last, whose u is not known yet.
  ASSERT_EQ(rows.size() + 1, u.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    ASSERT_EQ(rows[k].u, u[k]);
    ASSERT_EQ(rows[k].y, y[k]);
    ASSERT_NEAR(rows[k].time, static_cast<double>(k) * T, 1e-12);
  }
}

TEST(Experiment, TravelEndsItFromBothSidesAndOnlyBeyond) {
  for (const double side : {1.0, -1.0}) {
    auto at_limit = Experiment<1>::make(relay(1)).value();
    (void)at_limit.update(2.0);
    (void)at_limit.update(2.0 + side * 10);
    EXPECT_EQ(at_limit.reason(), AbortReason::none);
    EXPECT_EQ(at_limit.update(std::nextafter(2.0 + side * 10, side * 100)), 0.0);
    EXPECT_EQ(at_limit.phase(), ExperimentPhase::aborted);
    EXPECT_EQ(at_limit.reason(), AbortReason::travel);
    EXPECT_EQ(at_limit.update(2.0), 0.0);
    EXPECT_EQ(refusal(at_limit.result()), "phase: of the experiment has no result yet");
  }
}

TEST(Experiment, TimeEndsIt) {
  auto config = relay(1);
  config.input = 0.25;
  config.time_limit = 0.1;
  auto stuck = Experiment<1>::make(config).value();
  for (int k = 0; k < 100; ++k) {
    EXPECT_EQ(stuck.update(3), 1.25);
    EXPECT_EQ(stuck.reason(), AbortReason::none);
  }
  EXPECT_EQ(stuck.update(3), 0.25);
  EXPECT_EQ(stuck.reason(), AbortReason::time_limit);
}

TEST(Experiment, BadSampleEndsItInEveryPhase) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  auto config = relay(1);
  config.rest = 0.01;
  config.hand_over = 0.05;
  for (const auto phase : {ExperimentPhase::rest, ExperimentPhase::settling,
                           ExperimentPhase::measuring, ExperimentPhase::hand_over}) {
    for (const auto& [y, u] :
         {std::pair{nan, 0.0}, {infinity, 0.0}, {0.0, nan}, {0.0, -infinity}}) {
      auto experiment = Experiment<1>::make(config).value();
      Plant plant(1, 5, 0.01, 5, T);
      do {
        plant.step(experiment.update(plant.y()));
      } while (experiment.phase() != phase);
      const bool known = experiment.result().has_value();
      EXPECT_EQ(known, phase == ExperimentPhase::hand_over);
      EXPECT_EQ(experiment.update(y, u), 0.0);
      EXPECT_EQ(experiment.reason(), AbortReason::bad_sample);
      EXPECT_EQ(experiment.result().has_value(), known);
    }
    auto experiment = Experiment<1>::make(config).value();
    Plant plant(1, 5, 0.01, 5, T);
    do {
      plant.step(experiment.update(plant.y()));
    } while (experiment.phase() != phase);
    EXPECT_EQ(experiment.stop(), 0.0);
    EXPECT_EQ(experiment.reason(), AbortReason::stopped);
    EXPECT_EQ(experiment.stop(), 0.0);
  }
}

/// The sums are of the u that there was: an actuator's rate costs nothing but time.
TEST(Experiment, RateLimitHolds) {
  auto config = steps();
  config.limits.rate = 100;
  auto experiment = Experiment<1>::make(config).value();
  Plant plant(1, 5, 0, 9, T);
  double last = 0, fastest = 0;
  while (!experiment.finished()) {
    const double u = experiment.update(plant.y());
    fastest = std::max(fastest, std::abs(u - last));
    last = u;
    plant.step(u);
  }
  EXPECT_NEAR(fastest, 0.1, 1e-12);
  EXPECT_NEAR(experiment.result()->input_gain, 5, 1e-9);
  for (int k = 0; k < 10; ++k) last = experiment.update(0);
  EXPECT_EQ(last, 0.0);
}

/// What the actuator held counts, not what was asked.
TEST(Experiment, TakesTheInputThatWasHeld) {
  auto experiment = Experiment<1>::make(steps()).value();
  Plant plant(1, 5, 0, 9, T);
  double held = 0;
  while (!experiment.finished()) {
    const double wanted = experiment.update(plant.y(), held);
    held = 0.5 * wanted;
    plant.step(held);
  }
  EXPECT_NEAR(experiment.result()->input_gain, 5, 1e-9);
}

TEST(Experiment, FloatIsAsGood) {
  const ExperimentConfig<float> config{.sample_time = 1e-3f,
                                       .amplitude = 1,
                                       .hysteresis = 0.004f,
                                       .lead = 0.12f,
                                       .travel = 10,
                                       .time_limit = 100};
  const auto coarse = run<2, float>(config, Plant(2, 5, 0.015, 6, T));
  const auto fine = run<2>(relay(2), Plant(2, 5, 0.015, 6, T));
  // Rounding of y over (w T)^2, averaged over a window.
  EXPECT_NEAR(static_cast<double>(coarse.result()->input_gain) / fine.result()->input_gain, 1,
              2e-3);
}

/// Numbers of any kind: u is one of three, results are finite or refused, nothing is allocated.
TEST(Experiment, GarbageChangesNoPromise) {
  Random random(7);
  const NoAllocation allocations;
  int results = 0;
  for (int trial = 0; trial < 400; ++trial) {
    auto config = trial % 2 == 0 ? relay(2) : steps();
    const double size = std::pow(10.0, random.uniform(-300, 300));
    if (trial % 2 == 0) config.hysteresis = size * 1e-3;
    config.travel = size;
    config.half_period = trial % 2 == 0 ? 0.0 : 0.03;
    config.cycles = 6;
    auto experiment = Experiment<2>::make(config).value();
    for (int k = 0; k < 2000 && !experiment.finished(); ++k) {
      const bool wild = random.index(3000) == 0;
      const double y =
          wild ? std::pow(10.0, random.uniform(-308, 308)) : 0.49 * size * random.uniform(-1, 1);
      const double u = experiment.update(y);
      ASSERT_TRUE(u == 0 || u == 1 || u == -1);
    }
    const auto found = experiment.result();
    if (!found) continue;
    ++results;
    EXPECT_TRUE(esokit::is_finite(found->input_gain));
    EXPECT_TRUE(esokit::is_finite(found->latency));
    EXPECT_GE(found->input_gain_half_width, 0.0);
  }
  EXPECT_EQ(allocations.count(), 0);
  EXPECT_GT(results, 0);
}

/// Two reports of a u that no actuator holds: the sums may overflow one by one, and what is
/// accepted is numbers.
TEST(Experiment, AbsurdReportsOfUAreNoResult) {
  const ExperimentConfig<float> config{.sample_time = 1e-3f,
                                       .excitation = Excitation::steps,
                                       .amplitude = 1,
                                       .half_period = 0.03f,
                                       .travel = 10,
                                       .time_limit = 100};
  for (int first = 0; first < 120; first += 4) {
    auto experiment = Experiment<2, float>::make(config).value();
    Plant plant(2, 5, 0, 3, T);
    int measured = 0;
    while (!experiment.finished()) {
      measured += experiment.phase() == ExperimentPhase::measuring ? 1 : 0;
      const float held = experiment.output();
      const bool absurd = measured == 120 + first || measured == 120 + first + 29;
      const float u = experiment.update(static_cast<float>(plant.y()), absurd ? 1.2e38f : held);
      plant.step(static_cast<double>(u));
    }
    const auto found = experiment.result();
    if (!found) continue;
    EXPECT_TRUE(esokit::is_finite(found->input_gain_half_width)) << first;
    EXPECT_TRUE(esokit::is_finite(found->latency)) << first;
  }
}

TEST(Experiment, RefusesBadSettings) {
  const auto refused = [](int order, auto change) {
    auto config = relay(order);
    change(config);
    return order == 1 ? refusal(Experiment<1>::make(config)) : refusal(Experiment<2>::make(config));
  };
  using C = ExperimentConfig<double>;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refused(1, [](C&) {}), "accepted");
  EXPECT_EQ(refused(2, [](C&) {}), "accepted");
  EXPECT_EQ(refused(1, [](C& c) { c.sample_time = 0; }),
            "sample_time: must be finite and positive");
  EXPECT_EQ(refused(1, [](C& c) { c.input = nan; }), "input: must be finite");
  EXPECT_EQ(refused(1, [](C& c) { c.amplitude = 0; }),
            "amplitude: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refused(1, [](C& c) { c.hysteresis = 0; }), "hysteresis: must be finite and positive");
  EXPECT_EQ(refused(1, [](C& c) { c.hysteresis = 10; }), "hysteresis: must be below travel");
  EXPECT_EQ(refused(1, [](C& c) { c.lead = 0.1; }),
            "lead: must be left out: it is for a relay of order 2");
  EXPECT_EQ(refused(2, [](C& c) { c.lead = 0; }), "lead: must be finite and positive");
  EXPECT_EQ(refused(1, [](C& c) { c.half_period = 1; }),
            "half_period: must be left out with a relay");
  EXPECT_EQ(refused(1, [](C& c) { c.rest = -1; }), "rest: must be finite and not negative");
  EXPECT_EQ(refused(1, [](C& c) { c.rest = 100; }), "rest: must be below time_limit");
  EXPECT_EQ(refused(1, [](C& c) { c.travel = nan; }), "travel: must be finite and positive");
  EXPECT_EQ(refused(1, [](C& c) { c.time_limit = 0; }), "time_limit: must be finite and positive");
  EXPECT_EQ(refused(1, [](C& c) { c.time_limit = 16778; }),
            "time_limit: must be below 2^24 samples");
  EXPECT_EQ(refused(1, [](C& c) { c.time_limit = 16777; }), "accepted");
  EXPECT_EQ(refused(1, [](C& c) { c.hand_over = nan; }),
            "hand_over: must be finite and not negative");
  EXPECT_EQ(refused(1, [](C& c) { c.hand_over = 100; }), "hand_over: must be below time_limit");
  for (const int bad : {4, 7, 202})
    EXPECT_EQ(refused(1, [&](C& c) { c.cycles = bad; }), "cycles: must be even, 6 .. 200");
  EXPECT_EQ(refused(1, [](C& c) { c.limits.upper = 1; }), "accepted");
  EXPECT_EQ(refused(1, [](C& c) { c.limits.upper = 0.99; }),
            "amplitude: with input goes above limits.upper, which is");
  EXPECT_EQ(refused(1, [](C& c) { c.limits.lower = -1; }), "accepted");
  EXPECT_EQ(refused(1, [](C& c) { c.limits.lower = -0.99; }),
            "amplitude: with input goes below limits.lower, which is");
  EXPECT_EQ(refused(1, [](C& c) { c.limits.rate = 0; }),
            "limits.rate: must be finite and positive");
  const auto stepped = [](auto change) {
    auto config = steps();
    change(config);
    return refusal(Experiment<2>::make(config));
  };
  EXPECT_EQ(stepped([](C&) {}), "accepted");
  EXPECT_EQ(stepped([](C& c) { c.half_period = 0.0074; }),
            "half_period: must be at least 8 samples");
  EXPECT_EQ(stepped([](C& c) { c.half_period = 100; }), "half_period: must be below time_limit");
  EXPECT_EQ(stepped([](C& c) { c.hysteresis = 1; }), "hysteresis: must be left out with steps");
  EXPECT_EQ(stepped([](C& c) { c.lead = 1; }),
            "lead: must be left out: it is for a relay of order 2");
  // A latency of more than a quarter of the cycle.
  EXPECT_EQ(refusal(run<1>(steps(), Plant(1, 5, 0, 60, T)).result()),
            "latency: does not fit: friction or damping is too large for this amplitude, or the "
            "order or the sign of amplitude is wrong");
  // Too few samples a cycle: told by the result.
  auto quick = steps();
  quick.half_period = 0.011;
  EXPECT_EQ(refusal(run<1>(quick, Plant(1, 5, 0, 1, T)).result()),
            "cycle: (the shortest, in samples) must be at least");
  quick.half_period = 0.012;
  EXPECT_EQ(refusal(run<1>(quick, Plant(1, 5, 0, 1, T)).result()), "accepted");
}

/// The controller that was led along goes on with what its law asks of the true state; one that is
/// started at rest does not know that the machine moves.
TEST(Experiment, HandsOverWithoutABump) {
  using Controller = esokit::Adrc<esokit::LinearEso<2>>;
  constexpr double omega = 40, b0 = 5, d = 1;
  auto config = relay(2);
  config.hand_over = 0.3;  // twelve time constants of the observer
  auto experiment = Experiment<2>::make(config).value();
  Plant plant(2, b0, 0, 2, T, d);
  const typename Controller::Config settings{
      .observer = {.observer_bandwidth = omega, .input_gain = b0, .sample_time = T},
      .controller_bandwidth = 10};
  auto led = Controller::make(settings).value();
  while (!experiment.finished()) {
    const double y = plant.y(), held = experiment.output();
    const double u = experiment.update(y);
    if (experiment.phase() == ExperimentPhase::hand_over) (void)led.track(y, 0.0, held);
    if (!experiment.finished()) plant.step(u);
  }
  const double y = plant.y(), held = led.output();
  auto started = Controller::make(settings).value();
  ASSERT_EQ(started.start(y, held), esokit::StepStatus::ok);
  const double asked = (100 * (0 - y) - 20 * plant.speed() - d) / b0;
  // The two samples of dead time are b0 A * 2 T in the speed, and the observer's in d.
  const double share = 20 * 2 * T + 3 * omega * 2 * T;
  EXPECT_NEAR(led.update(y, 0.0), asked, share);
  EXPECT_GT(std::abs(started.update(y, 0.0) - asked), 2 * share);
}

}  // namespace control_experiment_test
}  // namespace esokit_test
