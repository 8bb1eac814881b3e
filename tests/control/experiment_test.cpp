// Relay and step experiments: exact on the model, honest beside noise, within limits whatever
// comes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
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
      EXPECT_EQ(away.reason(), AbortReason::wrong_sign);
    } else {
      EXPECT_EQ(refusal(away.result()),
                "latency: does not fit: friction or damping is too large for this amplitude, the "
                "cycle is too short (hysteresis, half_period), or the order or the sign of "
                "amplitude is wrong");
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
                         : experiment.samples() % 2 == 0 ? 0.03
                                                         : -0.03;
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
    // u drove it up.
    EXPECT_EQ(at_limit.reason(), side > 0 ? AbortReason::travel : AbortReason::wrong_sign);
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
            "latency: does not fit: friction or damping is too large for this amplitude, the cycle "
            "is too short (hysteresis, half_period), or the order or the sign of amplitude is "
            "wrong");
  // Too few samples a cycle: told by the result.
  auto quick = steps();
  quick.half_period = 0.011;
  EXPECT_EQ(refusal(run<1>(quick, Plant(1, 5, 0, 1, T)).result()),
            "cycle: (the shortest, in samples) must be at least");
  quick.half_period = 0.012;
  EXPECT_EQ(refusal(run<1>(quick, Plant(1, 5, 0, 1, T)).result()), "accepted");
}

/// A heater at rest at 20, 3 degrees a second at full power, 110 above in the end.
struct Heater {
  double temperature = 20, element = 0, ambient = 20;
  double power = 3, loss = 3.0 / 110, lag = 1.5, load = 0;
  std::array<double, 6> line{};
  std::size_t at = 0;
  void step(double u, double T_ = 0.1) {
    line[at] = u;
    at = (at + 1) % line.size();
    element += -std::expm1(-T_ / lag) * (line[at] - element);
    temperature += T_ * (power * element - loss * (temperature - ambient) + load);
  }
};

ExperimentConfig<double> cold() {
  return {.sample_time = 0.1,
          .amplitude = 0.4,
          .hysteresis = 0.5,
          .rest = 2,
          .approach = {{.input = 1, .output = 70}},
          .response = 2,
          .response_time = 12,
          .travel = 20,
          .lowest_output = 0,
          .highest_output = 100,
          .time_limit = 600,
          .limits = {.lower = 0, .upper = 1}};
}

/// Runs it until it ends. @param fault (heater, y, u, time), changes what the experiment sees or
/// what the heater gets
template <class Fault>
Experiment<1> heat(const ExperimentConfig<double>& config, Fault&& fault, Heater heater = {}) {
  auto experiment = Experiment<1>::make(config).value();
  for (double time = 0; !experiment.finished(); time += config.sample_time) {
    double y = heater.temperature, u = 0;
    fault(heater, y, u, time);
    u = experiment.update(y);
    EXPECT_TRUE(u >= config.limits.lower && u <= config.limits.upper);
    double given = u;
    fault(heater, y, given, time);
    heater.step(given);
    EXPECT_LE(time, config.time_limit + config.sample_time);
  }
  return experiment;
}
constexpr auto healthy = [](Heater&, double&, double&, double) {};

/// One-sided, from rest: power, the u that holds, the latency; the same for a cooler.
TEST(Experiment, FromColdItFindsWhatHolds) {
  const auto found = heat(cold(), healthy);
  ASSERT_EQ(found.phase(), ExperimentPhase::done);
  const auto result = found.result().value();
  EXPECT_NEAR(result.input_gain, 3, result.input_gain_half_width);
  EXPECT_LT(result.input_gain_half_width, 0.3);
  EXPECT_NEAR(result.latency, 2.0, 0.3);
  EXPECT_NEAR(found.centre(), 50.0 / 110, 0.02);
  EXPECT_EQ(found.rest_output(), 70);
  EXPECT_LT(found.approach_slope(), 3);  // part of the power is lost
  EXPECT_GT(found.approach_slope(), 2);
  EXPECT_NEAR(found.approach_delay(), 2, 0.7);
  EXPECT_EQ(found.output(), 0);
  // The other way: y falls from 20 to -30, u from 0 to -1.
  auto config = cold();
  config.approach = {{.input = -1, .output = -30}};
  config.lowest_output = -60;
  config.highest_output = 40;
  config.limits = {.lower = -1, .upper = 0};
  const auto cooler = heat(config, healthy);
  // Rounding moves some switches by a sample.
  EXPECT_NEAR(cooler.result()->input_gain, result.input_gain, 0.01);
  EXPECT_NEAR(cooler.centre(), -found.centre(), 0.01);
  // And where u lowers y.
  config.amplitude = -0.4;
  config.approach->input = 1;
  config.limits = {.lower = 0, .upper = 1};
  Heater chiller;
  chiller.power = -3;
  const auto chilled = heat(config, healthy, chiller);
  EXPECT_NEAR(chilled.result()->input_gain, -result.input_gain, 0.01);
}

/// A machine that is already warm: no approach; above the set point u0 lets it cool.
TEST(Experiment, FromWarmItBeginsAtOnce) {
  for (const double start : {60.0, 85.0}) {
    Heater warm;
    warm.temperature = start;
    bool approached = false, on_above = false;
    auto experiment = Experiment<1>::make(cold()).value();
    while (!experiment.finished()) {
      const double y = warm.temperature, u = experiment.update(y);
      approached = approached || experiment.phase() == ExperimentPhase::approach;
      on_above = on_above || (experiment.phase() == ExperimentPhase::centring && y > 71 && u > 0);
      warm.step(u);
    }
    EXPECT_EQ(approached, start < 70) << start;
    EXPECT_FALSE(on_above);
    EXPECT_TRUE(experiment.result()) << start;
  }
}

/// Where u rests y may take its time.
TEST(Experiment, OnlyTheSideThatDrivesAwayIsWatched) {
  Heater slow;
  slow.temperature = 85;
  slow.power = 0.5;
  slow.loss = 0.002;  // 0.13 degrees a second, where 2 in 12 s are asked of full power
  auto config = cold();
  config.time_limit = 3000;
  EXPECT_EQ(heat(config, healthy, slow).reason(), AbortReason::none);
}

/// Each fault ends with its name, in each phase, with the safe u, and y within its limits.
TEST(Experiment, EveryEndHasANameAndTheSafeInput) {
  auto config = cold();
  config.safe_input = 0.01;
  using R = AbortReason;
  struct Case {
    const char* name;
    std::vector<R> reasons;
    void (*fault)(Heater&, double& y, double& u, double before);
  };
  // On the side of the safe u only the time ends a sensor that stands still.
  const Case cases[] = {
      {"sensor stands still",
       {R::no_response, R::time_limit, R::load_changed},
       [](Heater&, double& y, double&, double before) { y = before; }},
      {"sensor shows the room",
       {R::no_response, R::load_changed, R::travel, R::wrong_sign},
       [](Heater&, double& y, double&, double) { y = 20; }},
      {"heater off",
       {R::no_response, R::load_changed, R::wrong_sign},
       [](Heater&, double&, double& u, double) { u = 0; }},
      {"sensor lost",
       {R::bad_sample},
       [](Heater&, double& y, double&, double) { y = std::numeric_limits<double>::quiet_NaN(); }},
      {"short circuit", {R::output_limit}, [](Heater&, double& y, double&, double) { y = 500; }},
      {"a fan larger than the relay",
       {R::load_changed, R::no_response, R::wrong_sign, R::travel, R::too_noisy},
       [](Heater& heater, double&, double&, double) { heater.load = -4; }},
  };
  for (const Case& one : cases) {
    for (const double since : {0.0, 3.0, 10.0, 25.0, 40.0, 60.0, 90.0}) {
      double hottest = 0, before = 20;
      const auto ended = heat(config, [&](Heater& heater, double& y, double& u, double time) {
        hottest = std::max(hottest, heater.temperature);
        if (time >= since) {
          one.fault(heater, y, u, before);
        } else {
          before = y;
        }
      });
      EXPECT_EQ(ended.phase(), ExperimentPhase::aborted) << one.name << since;
      EXPECT_NE(std::find(one.reasons.begin(), one.reasons.end(), ended.reason()),
                one.reasons.end())
          << one.name << since << " " << static_cast<int>(ended.reason());
      EXPECT_EQ(ended.output(), 0.01) << one.name << since;
      EXPECT_FALSE(ended.result()) << one.name << since;
      EXPECT_LT(hottest, 100) << one.name << since;
    }
  }
  // From the beginning.
  EXPECT_EQ(heat(config, [](Heater&, double&, double& u, double) { u = -u; }).reason(),
            R::wrong_sign);
  config.time_limit = 30;
  EXPECT_EQ(heat(config, healthy).reason(), R::time_limit);
}

TEST(Experiment, LimitsOfTheOutputEndItFromBothSidesAndOnlyBeyond) {
  for (const double side : {1.0, -1.0}) {
    auto config = relay(1);
    config.lowest_output = -1.5;
    config.highest_output = 1.5;
    auto experiment = Experiment<1>::make(config).value();
    (void)experiment.update(0);
    (void)experiment.update(side * 1.5);
    EXPECT_EQ(experiment.reason(), AbortReason::none);
    (void)experiment.update(std::nextafter(side * 1.5, side * 2));
    // u drove it up until it was there.
    EXPECT_EQ(experiment.reason(), side > 0 ? AbortReason::output_limit : AbortReason::wrong_sign);
  }
}

/// A steady motion above the limit is ended within two pieces, in either direction; one below it,
/// noise included, is not.
TEST(Experiment, SpeedOfTheOutputEndsIt) {
  for (const double slope : {0.49, -0.49, 0.53, -0.53}) {
    auto config = cold();
    config.rest = 30;
    config.fastest = 0.5;  // 2 degrees in 40 samples
    auto experiment = Experiment<1>::make(config).value();
    int k = 0;
    for (; k < 250 && !experiment.finished(); ++k) {
      (void)experiment.update(50 + slope * (k < 100 ? 0 : 0.1 * (k - 100)));
    }
    const bool fast = std::abs(slope) > 0.5;
    EXPECT_EQ(experiment.reason(), fast ? AbortReason::too_fast : AbortReason::none) << slope;
    EXPECT_EQ(experiment.output(), 0);
    if (fast) {
      EXPECT_LE(k, 100 + 80);
    }
  }
  // Without the limit, and at once by one step.
  const auto after = [](double fastest, double step) {
    auto config = cold();
    config.fastest = fastest;
    auto experiment = Experiment<1>::make(config).value();
    (void)experiment.update(20);
    (void)experiment.update(20 + step);
    return experiment.reason();
  };
  EXPECT_EQ(after(0.5, 2), AbortReason::none);
  EXPECT_EQ(after(0.5, std::nextafter(2.01, 3)), AbortReason::too_fast);
  EXPECT_EQ(after(0, 15), AbortReason::none);
  // The machine whose motion is limited: as fast as it may be, and ended by less.
  auto config = relay(2);
  config.response = 0.01;
  config.response_time = 1;
  const Plant servo(2, 5, 0.015, 6, T);
  double speed = 0;
  {
    auto free = Experiment<2>::make(config).value();
    for (Plant one = servo; !free.finished();) {
      one.step(free.update(one.y()));
      speed = std::max(speed, std::abs(one.speed()));
    }
    EXPECT_EQ(free.reason(), AbortReason::none);
  }
  for (const double share : {1.01, 0.7}) {
    config.fastest = share * speed;
    Plant one = servo;
    auto limited = Experiment<2>::make(config).value();
    double most = 0;
    while (!limited.finished()) {
      one.step(limited.update(one.y()));
      most = std::max(most, std::abs(one.speed()));
    }
    EXPECT_EQ(limited.reason(), share > 1 ? AbortReason::none : AbortReason::too_fast);
    // What it gains in two pieces.
    EXPECT_LT(most, config.fastest + 2 * 5 * config.response / config.fastest);
  }
}

/// y is watched to the sample and to the last bit.
TEST(Experiment, ResponseIsAskedForFromBothSides) {
  const auto after = [](double moved, int samples) {
    auto experiment = Experiment<1>::make(cold()).value();
    for (int k = 0; k <= 20; ++k) (void)experiment.update(20);
    EXPECT_EQ(experiment.phase(), ExperimentPhase::approach);
    for (int k = 1; k < samples; ++k) (void)experiment.update(20);
    (void)experiment.update(20 + moved);
    return experiment.reason();
  };
  const double less = std::nextafter(22.0, 0.0) - 20;
  EXPECT_EQ(after(less, 119), AbortReason::none);
  EXPECT_EQ(after(less, 120), AbortReason::no_response);
  // Two degrees in one step is a sensor that cannot show half of that.
  EXPECT_EQ(after(2, 120), AbortReason::resolution);
  EXPECT_EQ(after(-less, 5), AbortReason::none);
  EXPECT_EQ(after(-2, 5), AbortReason::wrong_sign);
}

/// What y still moves the old way in the latency is no missing response.
TEST(Experiment, ResponseCountsFromWhereItTurns) {
  auto config = relay(1);
  config.response = config.response_time = 1;
  auto experiment = Experiment<1>::make(config).value();
  const auto feed = [&](double y, int samples) {
    for (int k = 0; k < samples; ++k) (void)experiment.update(y);
    return experiment.reason();
  };
  feed(0, 1);
  EXPECT_EQ(feed(0.2, 1), AbortReason::none);  // u turns here
  EXPECT_EQ(feed(1.5, 500), AbortReason::none);
  EXPECT_EQ(feed(0.45, 600), AbortReason::none);
  EXPECT_EQ(feed(0.45, 600), AbortReason::no_response);
}

TEST(Experiment, NoiseResolutionAndRoomFromBothSides) {
  // y toggles by `step` a sample: its noise, as differences show it, is step / sqrt(2).
  const auto rests = [](double step, double response) {
    auto config = cold();
    config.response = response;
    auto experiment = Experiment<1>::make(config).value();
    for (int k = 0; k <= 20; ++k) (void)experiment.update(20 + (k % 2) * step);
    return experiment.reason();
  };
  const double most = 0.25 * std::sqrt(2.0) * std::sqrt(21.0 / 20);
  EXPECT_EQ(rests(most * 0.999, 4), AbortReason::none);
  EXPECT_EQ(rests(most * 1.001, 4), AbortReason::too_noisy);
  EXPECT_EQ(rests(most * 0.999, 0.9), AbortReason::too_noisy);
  for (const double step : {0.9, 1.1}) {
    auto coarse = cold();
    coarse.hysteresis = 4;
    const auto ended = heat(coarse, [&](Heater&, double& y, double&, double) {
      y = 20 + step * std::round((y - 20) / step);
    });
    EXPECT_EQ(ended.reason(), step > 1 ? AbortReason::resolution : AbortReason::none);
  }
  // The u that holds 70 is 0.4545: the limit next to it leaves a tenth of A or less.
  for (const double room : {0.03, 0.05}) {
    auto near = cold();
    near.limits.upper = near.approach->input = 50.0 / 110 + room;
    near.response_time = 60;
    const auto ended = heat(near, healthy);
    EXPECT_EQ(ended.reason(), room < 0.04 ? AbortReason::input_limit : AbortReason::none) << room;
  }
  // A relay whose overshoot would pass the limit is not begun.
  auto low = cold();
  low.highest_output = 72;
  EXPECT_EQ(heat(low, healthy).reason(), AbortReason::output_limit);
}

TEST(Experiment, RefusesBadSettingsFromCold) {
  using C = ExperimentConfig<double>;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](auto change) {
    auto config = cold();
    change(config);
    return refusal(Experiment<1>::make(config));
  };
  EXPECT_EQ(refused([](C&) {}), "accepted");
  EXPECT_EQ(refused([](C& c) { c.approach->input = nan; }),
            "approach.input: is above limits.upper, which is");
  EXPECT_EQ(refused([](C& c) { c.approach->input = 1.01; }),
            "approach.input: is above limits.upper, which is");
  EXPECT_EQ(refused([](C& c) { c.approach->input = -0.01; }),
            "approach.input: is below limits.lower, which is");
  EXPECT_EQ(refused([](C& c) { c.input = -0.01; }), "input: is below limits.lower, which is");
  EXPECT_EQ(refused([](C& c) { c.approach->input = 0; }), "approach.input: must not be input");
  EXPECT_EQ(refused([](C& c) { c.approach->output = nan; }), "approach.output: must be finite");
  const char* between =
      "approach.output: must be between lowest_output and highest_output by more than the "
      "hysteresis";
  EXPECT_EQ(refused([](C& c) { c.approach->output = 99.5; }), between);
  EXPECT_EQ(refused([](C& c) { c.approach->output = 99.4; }), "accepted");
  EXPECT_EQ(refused([](C& c) { c.approach->output = 0.5; }), between);
  EXPECT_EQ(refused([](C& c) { c.highest_output = C{}.highest_output; }),
            "highest_output: must be given with an approach");
  EXPECT_EQ(refused([](C& c) { c.lowest_output = C{}.lowest_output; }), "accepted");
  EXPECT_EQ(refused([](C& c) { c.highest_output = nan; }), "highest_output: must be finite");
  EXPECT_EQ(refused([](C& c) { c.lowest_output = -2 * c.highest_output / 0.0; }),
            "lowest_output: must be finite");
  EXPECT_EQ(refused([](C& c) { c.lowest_output = 100; }),
            "lowest_output: must be below highest_output");
  EXPECT_EQ(refused([](C& c) { c.response = 0; }), "response: must be finite and positive");
  EXPECT_EQ(refused([](C& c) { c.response_time = nan; }),
            "response_time: must be finite and not negative");
  EXPECT_EQ(refused([](C& c) { c.response_time = 0; }),
            "response: must be left out without response_time");
  EXPECT_EQ(refused([](C& c) { c.response = c.response_time = 0; }),
            "response_time: must be finite and positive");
  EXPECT_EQ(refused([](C& c) { c.response_time = 0.04; }),
            "response_time: must be at least one sample");
  EXPECT_EQ(refused([](C& c) { c.response_time = 600; }),
            "response_time: must be below time_limit");
  EXPECT_EQ(refused([](C& c) { c.fastest = nan; }), "fastest: must be finite and not negative");
  EXPECT_EQ(refused([](C& c) { c.fastest = 20.001; }),
            "fastest: must be at most response in a sample:");
  EXPECT_EQ(refused([](C& c) { c.fastest = 19.999; }), "accepted");
  auto unwatched = relay(1);
  unwatched.fastest = 1;
  EXPECT_EQ(refusal(Experiment<1>::make(unwatched)), "fastest: must be left out without response");
  EXPECT_EQ(refused([](C& c) { c.safe_input = 1.1; }),
            "safe_input: is above limits.upper, which is");
  EXPECT_EQ(refused([nan](C& c) { c.safe_input = nan; }),
            "safe_input: is above limits.upper, which is");
  EXPECT_EQ(refused([](C& c) {
              c.excitation = Excitation::steps;
              c.hysteresis = 0;
              c.half_period = 10;
            }),
            "approach.input: must be left out: an approach needs a relay of order 1");
  auto two = cold();
  two.lead = 10;
  EXPECT_EQ(refusal(Experiment<2>::make(two)),
            "approach.input: must be left out: an approach needs a relay of order 1");
}

/// Any numbers from cold: u is within the limits, it ends in time, and results are finite.
TEST(Experiment, GarbageFromColdChangesNoPromise) {
  Random random(48);
  const NoAllocation allocations;
  int ends[13] = {};
  for (int trial = 0; trial < 3000; ++trial) {
    auto config = cold();
    config.time_limit = 200;
    config.cycles = 6;
    config.hysteresis = random.uniform(0.1, 5);
    config.response = random.uniform(0.1, 10);
    config.response_time = random.uniform(0.1, 60);
    config.travel = random.uniform(6, 50);
    if (trial % 4 == 0) config.fastest = config.response * random.uniform(0.01, 5);
    auto experiment = Experiment<1>::make(config).value();
    Heater heater;
    const double wild = std::pow(10.0, random.uniform(-5, -1));
    int k = 0;
    for (; !experiment.finished(); ++k) {
      ASSERT_LE(k, 2001);
      double y = heater.temperature + random.uniform(-0.1, 0.1);
      if (random.uniform(0, 1) < wild) y = random.uniform(0, 100);
      if (random.uniform(0, 1) < wild / 10) y = std::pow(10.0, random.uniform(-308, 308));
      const double u = experiment.update(y);
      ASSERT_TRUE(u >= 0 && u <= 1);
      heater.step(random.uniform(0, 1) < wild ? random.uniform(0, 1) : u);
    }
    ++ends[static_cast<int>(experiment.reason())];
    ASSERT_EQ(experiment.output(), 0);
    if (const auto found = experiment.result()) {
      ASSERT_TRUE(esokit::is_finite(found->input_gain));
      ASSERT_GE(found->input_gain_half_width, 0.0);
      ASSERT_LT(found->input_gain_half_width, std::abs(found->input_gain));
    }
  }
  EXPECT_EQ(allocations.count(), 0);
  // All ways but `stopped` and `input_limit`, and `bad_sample`, were taken.
  for (const auto reason :
       {AbortReason::none, AbortReason::travel, AbortReason::time_limit, AbortReason::no_response,
        AbortReason::wrong_sign, AbortReason::load_changed, AbortReason::output_limit,
        AbortReason::too_noisy, AbortReason::too_fast}) {
    EXPECT_GT(ends[static_cast<int>(reason)], 0) << static_cast<int>(reason);
  }
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

/// A sensor that stands still, from the start or after the first switch, is noticed on both sides
/// for every u0 and A; so it is where the safe u is u0, computed in another way, or between the
/// two.
template <class S>
void is_watched_on_both_sides() {
  Random random(47);
  for (int i = 0; i < 3000; i += stride) {
    const int places = i % 3 == 0 ? 1 : 2;
    const S scale = places == 1 ? S(10) : S(100);
    const S u0 = static_cast<S>(random.index(399) - 199) / scale;
    const S size = static_cast<S>(1 + random.index(399)) / scale;
    const S A = random.index(2) == 0 ? size : -size;
    ExperimentConfig<S> config{.sample_time = S(0.01),
                               .excitation = Excitation::steps,
                               .input = u0,
                               .amplitude = A,
                               .half_period = S(4),
                               .response = size,
                               .response_time = S(1.5),
                               .travel = S(1000),
                               .time_limit = S(60),
                               .limits = {.lower = S(-100), .upper = S(100)}};
    const int safe = random.index(3);
    if (safe == 1) config.safe_input = (u0 + S(0.1)) - S(0.1);
    if (safe == 2) config.safe_input = u0 + static_cast<S>(random.uniform(-0.9, 0.9)) * size;
    auto one = Experiment<1, S>::make(config).value();
    const bool later = random.index(2) == 0;
    double y = 20;
    double seen = 20;
    double since = 0;
    bool stuck = !later;
    while (!one.finished()) {
      const double u = static_cast<double>(one.update(static_cast<S>(seen)));
      if (one.finished()) break;
      // The machine follows, the sensor stands still from the first time below y0 on.
      y += 0.01 * (A > S(0) ? 1 : -1) * (u - static_cast<double>(u0));
      if (later && one.samples() == 205) stuck = true;
      if (!stuck) seen = y;
      if (stuck) since += 0.01;
    }
    EXPECT_EQ(one.reason(), AbortReason::no_response) << u0 << ", " << A << ", safe " << safe;
    EXPECT_LT(since, 1.6) << u0 << ", " << A << ", later " << later;
  }
}

TEST(Experiment, IsWatchedOnBothSides) {
  is_watched_on_both_sides<double>();
  is_watched_on_both_sides<float>();
}

/// Where the safe u leads as far or further nothing can run away: the cold machine.
TEST(Experiment, IsNotWatchedWhereTheSafeInputLeadsFurther) {
  for (const double safe : {0.1, -0.3}) {
    ExperimentConfig<double> config = steps();
    config.input = 0.3;
    config.amplitude = 0.2;
    config.half_period = 1;
    config.response = 0.02;
    config.response_time = 0.4;
    config.time_limit = 30;
    config.safe_input = safe;  // 0.3 - 0.2 is 0.09999999999999998
    auto one = Experiment<1>::make(config).value();
    double y = 0;
    // Moves up at once, and down only by its own.
    for (int k = 0; k < 3000 && !one.finished(); ++k) {
      const double u = one.update(y);
      y += 1e-3 * (u > 0.3 ? 0.2 : -0.01);
    }
    EXPECT_NE(one.reason(), AbortReason::no_response) << safe;
  }
}

}  // namespace control_experiment_test
}  // namespace esokit_test
