// Adrc with LinearEso: what the law suite does not say.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <numbers>
#include <sstream>
#include <support/refusal.hpp>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_adrc_test {

using esokit::EigenMatrix;
using esokit::LinearEso;
using esokit::TimeDomain;
using Linear = Adrc<LinearEso<2>>;

constexpr double period = 1e-3;

Linear::Config base() {
  return {.observer = {.observer_bandwidth = 80, .input_gain = 2, .sample_time = period},
          .controller_bandwidth = 10};
}

// ---- timing and law

/// By hand: observer with the input of before, then u = (k_0 (r - y) - k_1 y' - d) / b0.
TEST(Adrc, IsObserverAndLaw) {
  auto controller = Linear::make(base()).value();
  auto observer = LinearEso<2>::make(base().observer).value();
  Random random(1);
  double u = 0;
  for (int k = 0; k < 200; ++k) {
    const double y = random.uniform(-1, 1);
    const double r = random.uniform(-1, 1);
    observer.update(y, u);
    const auto z = observer.estimate();
    u = (100 * (r - z(0)) - 20 * z(1) - z(2)) / 2;
    ASSERT_NEAR(controller.update(y, r), u, 1e-9 * (std::abs(u) + 100));
  }
  // With derivatives of the reference.
  const double y = 0.3;
  observer.update(y, controller.output());
  const auto z = observer.estimate();
  const double expected = (7 + 100 * (0.5 - z(0)) + 20 * (0.25 - z(1)) - z(2)) / 2;
  EXPECT_NEAR(controller.update(y, EigenMatrix<double, 3>(0.5, 0.25, 7)), expected, 1e-6);
}

TEST(Adrc, TakesAListOfTheReferenceAndItsDerivatives) {
  const double r = 0.5, r1 = 0.25, r2 = 7;
  auto listed = Linear::make(base()).value();
  auto given = Linear::make(base()).value();
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(listed.update(0.3, {r, r1, r2}),
              given.update(0.3, EigenMatrix<double, 3>(r, r1, r2)));
    EXPECT_EQ(listed.update(0.3, {r, r1}), given.update(0.3, EigenMatrix<double, 2>(r, r1)));
    listed.applied(0.1);
    given.applied(0.1);
    EXPECT_EQ(listed.update(0.3, {r, r1, 7}), given.update(0.3, EigenMatrix<double, 3>(r, r1, 7)));
    EXPECT_EQ(listed.update_without_measurement({r, r1}),
              given.update_without_measurement(EigenMatrix<double, 2>(r, r1)));
    EXPECT_NE(listed.output(), 0);
  }
}

/// A machine of a user's: the controller is a member like any other.
class Joint {
 public:
  double step(double angle) { return controller_.update(angle, 1.0); }
  [[nodiscard]] const Linear& controller() const { return controller_; }

 private:
  Linear controller_ = Linear::make(base()).value();
};

/// One whose config comes from outside: whoever makes it sees the refusal.
class Drive {
 public:
  explicit Drive(const Linear& controller) : controller_(controller) {}
  static esokit::Expected<Drive, esokit::Error<double>> make(const Linear::Config& config) {
    return Linear::make(config).and_then(
        [](const Linear& c) -> esokit::Expected<Drive, esokit::Error<double>> { return Drive(c); });
  }
  double step(double angle) { return controller_.update(angle, 1.0); }

 private:
  Linear controller_;
};

TEST(Adrc, IsAMemberOfAClass) {
  Joint joint;
  auto drive = Drive::make(base()).value();
  auto alone = Linear::make(base()).value();
  const double u = alone.update(0.2, 1.0);
  EXPECT_EQ(joint.step(0.2), u);
  EXPECT_EQ(drive.step(0.2), u);
  auto config = base();
  config.observer.input_gain = 0;
  EXPECT_EQ(refusal(Drive::make(config)),
            "input_gain: must be finite and not zero (negative is fine)");
}

TEST(Adrc, StatusAndModeHaveText) {
  const auto text = [](auto value) { return (std::ostringstream() << value).str(); };
  EXPECT_EQ(text(StepStatus::ok), "ok");
  EXPECT_EQ(text(StepStatus::measurement_rejected), "measurement_rejected");
  EXPECT_EQ(text(StepStatus::outlier_rejected), "outlier_rejected");
  EXPECT_EQ(text(StepStatus::input_rejected | StepStatus::gap_bridged | StepStatus::restarted),
            "input_rejected|gap_bridged|restarted");
  EXPECT_EQ(text(static_cast<StepStatus>(255)),
            "measurement_rejected|input_rejected|prediction_dropped|gap_bridged|restarted|"
            "state_rejected|outlier_rejected|turn_assumed");
  EXPECT_EQ(text(LoopMode::running), "running");
  EXPECT_EQ(text(LoopMode::start_hold), "start_hold");
  EXPECT_EQ(text(LoopMode::safe), "safe");
  auto controller = Linear::make(base()).value();
  controller.update(std::numeric_limits<double>::quiet_NaN(), 1.0);
  EXPECT_EQ(text(controller.status()), "measurement_rejected");
}

TEST(Adrc, ErrorBasedEqualsOutputBasedForAConstantReference) {
  auto output = Linear::make(base()).value();
  auto error = Adrc<LinearEso<2>, ErrorBased>::make(base()).value();
  ChainPlant plant(2, period, 2, -3);
  ChainPlant other = plant;
  // Matched: (y, y', d) = (0.2, 0, -2) is (e, e', d) = (r - 0.2, 0, 2).
  output.start(0.2, 1);
  error.start(0.2, 1, 0.9);
  for (int k = 0; k < 2000; ++k) {
    const double u = output.update(plant.output(), 0.9);
    const double v = error.update(other.output(), 0.9);
    ASSERT_NEAR(u, v, 1e-9) << k;
    plant.step(u);
    other.step(v);
  }
  EXPECT_NEAR(plant.output(), 0.9, 1e-6);
}

TEST(Adrc, FollowsATrackingDifferentiator) {
  auto controller = Linear::make(base()).value();
  auto profile =
      esokit::TrackingDifferentiator<double>::make({.acceleration = 4, .sample_time = period})
          .value();
  ChainPlant plant(2, period, 2, -3);
  // Bumpless from rest at y = 0.5 under u = 1.5, the differentiator reset to y.
  plant.set_state({0.5, 0});
  controller.start(0.5, 1.5);
  profile.reset(0.5);
  EXPECT_NEAR(controller.update(0.5, profile.state()), 1.5, 1e-9);
  plant.step(controller.output());
  double peak = 0;
  double fastest = 0;
  for (int k = 0; k < 3000; ++k) {
    profile.update(2);
    const double u = controller.update(plant.output(), profile.state());
    fastest = std::max(fastest, std::abs(u - 1.5));
    plant.step(u);
    peak = std::max(peak, plant.output());
  }
  EXPECT_NEAR(plant.output(), 2, 1e-5);
  EXPECT_LT(peak, 2.05);
  EXPECT_LT(fastest, 1.6 * 4 / 2);  // about the profile's acceleration, not the step's
}

// ---- controller gains

TEST(Adrc, GainsArePlacedAsAsked) {
  for (const TimeDomain domain : {TimeDomain::continuous, TimeDomain::sampled}) {
    for (const bool half : {false, true}) {
      auto settings = base();
      settings.domain = domain;
      settings.half_gain = half;
      const auto expected = esokit::feedback_gain<2, double>({10, domain, half}, period).value();
      const auto gains = Linear::make(settings).value().gains();
      EXPECT_EQ(gains[0], expected[0]);
      EXPECT_EQ(gains[1], expected[1]);
      // omega_c = 10: (100, 20), half of it, and about that in the sampled domain.
      EXPECT_NEAR(gains[0], half ? 50 : 100, domain == TimeDomain::sampled ? 1.5 : 1e-12);
      EXPECT_NEAR(gains[1], half ? 10 : 20, domain == TimeDomain::sampled ? 0.3 : 1e-12);
    }
  }
}

/// omega_c T = 1.5: placed in the sampled domain the loop comes to rest, in the continuous one it
/// cannot (z^2 + (k_1 T + k_0 T^2 / 2 - 2) z + 1 - k_1 T + k_0 T^2 / 2 has a root at -2.48).
TEST(Adrc, SampledPlacementHoldsForAnyBandwidth) {
  const auto final_error = [](TimeDomain domain) {
    auto controller =
        Linear::make(
            {.observer = {.observer_bandwidth = 4000, .input_gain = 2, .sample_time = period},
             .controller_bandwidth = 1500,
             .domain = domain})
            .value();
    ChainPlant plant(2, period, 2, -3);
    for (int k = 0; k < 100; ++k) plant.step(controller.update(plant.output(), 1.0));
    return std::abs(plant.output() - 1);
  };
  EXPECT_LT(final_error(TimeDomain::sampled), 1e-9);
  EXPECT_GT(final_error(TimeDomain::continuous), 1e3);
}

/// A divider whose measurements VariableTime would take for the end of too long a gap is refused:
/// each one would restart the observer. Found by the fuzzer.
TEST(Adrc, DividerIsBridgedAtTheLongestStep) {
  using Variable = Adrc<esokit::VariableTime<LinearEso<2>>>;
  int largest = 0, refused = 0;
  for (int divider = 1; divider < 40; ++divider) {
    const auto made = Variable::make({.observer = {.observer = {.observer_bandwidth = 760,
                                                                .input_gain = 1,
                                                                .sample_time = 3e-3,
                                                                .max_gap = 38},
                                                   .ratio = 2.25},
                                      .controller_bandwidth = 8,
                                      .measurement_divider = divider});
    if (!made) {
      // Beyond what the observer bridges at its own step time the other rule speaks.
      if (refusal(made).find("max_gap") != std::string::npos) continue;
      ++refused;
      EXPECT_EQ(refusal(made),
                "measurement_divider: must be so small that VariableTime bridges as many of its "
                "longest steps");
      continue;
    }
    largest = divider;
    auto controller = *made;
    ASSERT_TRUE(controller.set_step_time(3e-3 * 2.25).has_value());
    bool restarted = false;
    for (int k = 0; k < 400; ++k) {
      controller.update(1.0, 1.0);
      restarted |= k > 0 && has(controller.status(), StepStatus::restarted);
    }
    EXPECT_FALSE(restarted) << divider;
  }
  EXPECT_GT(largest, 1);
  EXPECT_GT(refused, 1);
}

/// Gains in the sampled domain and the rate limit follow the step's length; a refused one changes
/// nothing.
TEST(Adrc, GainsAndRateFollowTheSampleTime) {
  using Variable = Adrc<esokit::VariableTime<LinearEso<2>>>;
  Variable::Config settings{.observer = {.observer = base().observer, .ratio = 2},
                            .controller_bandwidth = 300,
                            .domain = TimeDomain::sampled,
                            .limits = {.lower = -1e9, .upper = 1e9, .rate = 100}};
  auto controller = Variable::make(settings).value();
  const auto placed = [](double T) {
    return esokit::feedback_gain<2, double>({300, TimeDomain::sampled, false}, T).value();
  };
  EXPECT_EQ(controller.gains()[0], placed(period)[0]);
  ASSERT_TRUE(controller.set_step_time(1.5 * period).has_value());
  EXPECT_EQ(controller.gains()[0], placed(1.5 * period)[0]);
  EXPECT_EQ(controller.gains()[1], placed(1.5 * period)[1]);
  EXPECT_NEAR(controller.update(0.0, 100.0), 0.15, 1e-12);
  for (const double bad : {3 * period, 0.4 * period, 0.0, -1.0, hidden_nan<double>()}) {
    const auto refused = controller.set_step_time(bad);
    ASSERT_EQ(refusal(refused), bad > period ? "step_time: must be at most"
                                             : "step_time: must be finite and at least")
        << bad;
    EXPECT_EQ(controller.gains()[0], placed(1.5 * period)[0]);
    EXPECT_EQ(controller.observer().step_time(), 1.5 * period);
  }
  // In the continuous domain they stay.
  settings.domain = TimeDomain::continuous;
  auto continuous = Variable::make(settings).value();
  ASSERT_TRUE(continuous.set_step_time(1.5 * period).has_value());
  EXPECT_EQ(continuous.gains()[0], 90000);
}

// ---- limits

/// A double integrator, a step, tight limits: the law on the estimates overshoots as the same
/// limited law on the true states does; a controller whose observer is told the unlimited u does
/// clearly worse.
TEST(Adrc, NoWindUp) {
  struct Outcome {
    double overshoot;
    double settled;
  };
  constexpr double limit = 3;  // of u; the disturbance takes 1.5 of it
  constexpr double step = 10;
  const auto run = [&](int kind) {
    auto settings = base();
    if (kind != 2) settings.limits = {.lower = -limit, .upper = limit};
    auto controller = Linear::make(settings).value();
    ChainPlant plant(2, period, 2, -3);
    controller.start(0, 1.5);
    double peak = 0;
    for (int k = 0; k < 20000; ++k) {
      double u = 0;
      if (kind == 0) {  // true states
        const auto& x = plant.state();
        u = (100 * (step - x[0]) - 20 * x[1] + 3) / 2;
      } else {
        u = controller.update(plant.output(), step);
      }
      plant.step(std::clamp(u, -limit, limit));
      peak = std::max(peak, plant.output());
    }
    return Outcome{peak - step, std::abs(plant.output() - step)};
  };
  const Outcome truth = run(0);
  const Outcome limited = run(1);
  const Outcome ignorant = run(2);
  EXPECT_GT(truth.overshoot, 0.02 * step);  // saturation alone makes it overshoot
  EXPECT_NEAR(limited.overshoot, truth.overshoot, 0.01 * step);
  EXPECT_GT(ignorant.overshoot, truth.overshoot + 0.1 * step);
  EXPECT_LT(limited.settled, 1e-6);
  std::printf("overshoot of %g: true states %.4f, Adrc %.4f, observer told the unlimited u %.4f\n",
              step, truth.overshoot, limited.overshoot, ignorant.overshoot);
}

TEST(Adrc, AsymmetricLimitsAndRateFromTheLastCommand) {
  auto settings = base();
  settings.limits = {.lower = 0, .upper = 8, .rate = 1000};
  auto controller = Linear::make(settings).value();
  EXPECT_EQ(controller.update(0.0, 100.0), 1);  // one step of 1000 * 1 ms
  EXPECT_EQ(controller.update(0.0, -100.0), 0);
  controller.applied(6.0);
  EXPECT_EQ(controller.output(), 0);
  EXPECT_EQ(controller.update(0.0, 100.0), 1);  // not from what is held
  controller.applied(20.0);
  EXPECT_EQ(controller.update(0.0, 100.0), 2);
  // In manual operation the operator's u is the last command.
  controller.track(0.0, 100.0, 6.0);
  EXPECT_EQ(controller.update(0.0, 100.0), 7);
  controller.track(0.0, 100.0, 5.0);
  controller.applied(3.0);  // which the operator moved since
  EXPECT_EQ(controller.update(0.0, 100.0), 4);
  controller.applied(3.0);
  EXPECT_EQ(controller.update(0.0, 100.0), 5);
  controller.track(0.0, 100.0, 20.0);
  EXPECT_EQ(controller.update(0.0, 100.0), 8);  // beyond the limit: back to the limit
  controller.start(0.0, 4.0);
  EXPECT_EQ(controller.update(0.0, 100.0), 5);
}

// ---- delay and angle

/// With the delay known the innovations on the plant's own model vanish; unknown, they do not.
TEST(Adrc, KnownDelay) {
  constexpr int delay = 5;
  using Delayed = Adrc<esokit::DelayedInput<LinearEso<2>, 8>>;
  const auto innovation = [&](int assumed) {
    auto controller = Delayed::make({.observer = {.observer = base().observer, .delay = assumed},
                                     .controller_bandwidth = 10})
                          .value();
    EXPECT_EQ(controller.observer().delay(), assumed);
    ChainPlant plant(2, period, 2, -3);
    double line[delay] = {};
    double worst = 0;
    for (int k = 0; k < 4000; ++k) {
      const double r = k % 1000 < 500 ? 1 : 0;
      const double u = controller.update(plant.output(), r);
      plant.step(line[k % delay]);
      line[k % delay] = u;
      if (k > 1000) worst = std::max(worst, std::abs(controller.observer().innovation()));
    }
    return worst;
  };
  EXPECT_LT(innovation(delay), 1e-9);
  EXPECT_GT(innovation(delay - 1), 1e-6);
  EXPECT_GT(innovation(0), 5e-6);
}

TEST(Adrc, DelayedStartAndBadInput) {
  using Delayed = Adrc<esokit::DelayedInput<LinearEso<2>, 4>>;
  auto controller = Delayed::make({.observer = {.observer = base().observer, .delay = 3},
                                   .controller_bandwidth = 10})
                        .value();
  controller.start(1.0, 0.75);
  // The inputs under way are the u of the start.
  for (int k = 0; k < 10; ++k) {
    EXPECT_NEAR(controller.update(1.0, 1.0), 0.75, 1e-9);
    EXPECT_EQ(controller.observer().applied_input(),
              k < 3 ? 0.75 : controller.observer().applied_input());
  }
  esokit::DelayedInput<LinearEso<2>, 4> observer =
      esokit::DelayedInput<LinearEso<2>, 4>::make({.observer = base().observer, .delay = 1})
          .value();
  observer.update(0, 0.5);
  EXPECT_EQ(observer.update(0, hidden_nan<double>()), StepStatus::input_rejected);
  EXPECT_EQ(observer.applied_input(), 0.5);
  EXPECT_EQ(observer.update(0, 0.25), StepStatus::ok);
  EXPECT_EQ(observer.applied_input(), 0.5);  // the last good one took the bad one's place
  EXPECT_EQ(observer.update(0, 0.25), StepStatus::ok);
  EXPECT_EQ(observer.applied_input(), 0.25);
}

/// The measurement in any branch, references beyond a turn: the same u as with an unwrapped angle.
TEST(Adrc, Angle) {
  using Angle = Adrc<esokit::WrappedOutput<LinearEso<2>>>;
  constexpr double turn = 2 * std::numbers::pi;
  const auto check = [&]<class Form>(Form) {
    using Wrapped = Adrc<esokit::WrappedOutput<LinearEso<2>>, Form>;
    using Plain = Adrc<LinearEso<2>, Form>;
    auto plain = Plain::make({.observer = base().observer, .controller_bandwidth = 10}).value();
    auto angle = Wrapped::make({.observer = {.observer = base().observer, .period = turn},
                                .controller_bandwidth = 10})
                     .value();
    ChainPlant plant(2, period, 2, -3);
    plant.set_state({0.1, 0});
    plain.start(0.1, 1.5);
    angle.start(0.1, 1.5);
    for (int k = 0; k < 12000; ++k) {
      const double r = 0.1 + 4e-3 * k;  // several turns, never half a turn ahead
      const double y = plant.output();
      const double branch = y - turn * std::floor(y / turn);  // 0 .. 2 pi
      const double u = plain.update(y, r);
      const double v = angle.update(branch, r - turn * std::round(r / turn));
      ASSERT_NEAR(u, v, 1e-6 * (1 + std::abs(u))) << k;
      ASSERT_LE(std::abs(angle.observer().template estimate<0>()), turn / 2 + 1e-9);
      plant.step(u);
    }
    EXPECT_GT(plant.output(), 6 * turn);
  };
  check(OutputBased{});
  check(ErrorBased{});
  EXPECT_EQ(refusal(Angle::make({.observer = {.observer = base().observer, .period = 0},
                                 .controller_bandwidth = 10})),
            "period: must be finite and positive");
}

/// One bad angle, one bad report of u, a start two radians off: the loop ends at its reference, at
/// rest, at every omega_o T, in both forms.
TEST(Adrc, AngleLoopNeverRunsAway) {
  constexpr double turn = 2 * std::numbers::pi;
  const auto check = [&]<class Form>(Form) {
    using Wrapped = Adrc<esokit::WrappedOutput<LinearEso<2>>, Form>;
    for (const double omega_T : {0.1, 0.3, 0.7, 1.0, 1.5, 2.0, 3.0}) {
      for (const int fault : {0, 1, 2}) {
        auto controller =
            Wrapped::make({.observer = {.observer = {.observer_bandwidth = omega_T / 0.01,
                                                     .input_gain = 1,
                                                     .sample_time = 0.01},
                                        .period = turn},
                           .controller_bandwidth = 4,
                           .limits = {.lower = -5, .upper = 5}})
                .value();
        ChainPlant plant(2, 0.01, 1, -1);
        plant.set_state({fault == 2 ? 2.0 : 0.0, 0});
        double fastest = 0;
        for (int k = 0; k < 4000; ++k) {
          const double before = plant.output();
          const double y = before - (fault == 0 && k == 500 ? 2.6 : 0);
          const double measured = y - turn * std::floor(y / turn);
          if (fault == 1 && k == 500) controller.applied(4e6);
          const double u = controller.update(measured, 0.5);
          plant.step(u);
          fastest = std::max(fastest, std::abs(plant.output() - before) / 0.01);
        }
        EXPECT_NEAR(std::remainder(plant.output() - 0.5, turn), 0, 1e-6) << omega_T << ' ' << fault;
        EXPECT_NEAR(controller.observer().template estimate<1>(), 0, 1e-6);
        EXPECT_EQ(controller.status(), StepStatus::ok);
        EXPECT_LT(fastest, 20) << omega_T << ' ' << fault;  // it ran at 83 and more
      }
    }
  };
  check(OutputBased{});
  check(ErrorBased{});
}

// ---- retuning

/// A change of b0 moves what b0 u explained into the disturbance, in motion too.
TEST(Adrc, RetuneOfInputGainKeepsWhatTheDisturbanceExplains) {
  auto controller = Linear::make(base()).value();
  ChainPlant plant(2, period, 2, -3);
  for (int k = 0; k < 100; ++k) plant.step(controller.update(plant.output(), 1.0));
  const double before = controller.observer().total_disturbance();
  const double u = controller.output();
  controller.observer().predict(u);  // what was applied is u
  auto settings = base();
  settings.observer.input_gain = 3;
  ASSERT_TRUE(controller.retune(settings).has_value());
  const double predicted = controller.observer().total_disturbance();
  EXPECT_NEAR(predicted, before + (2 - 3) * u, 1e-9 * std::abs(before));
  EXPECT_EQ(controller.output(), u);
}

/// So u alters by no more than it changes by in a sample; without that by v (1/b0_new - 1/b0_old).
TEST(Adrc, RetuneOfInputGainDoesNotBumpInMotion) {
  auto settings = base();
  settings.observer.sample_time = 1e-4;
  auto controller = Linear::make(settings).value();
  ChainPlant plant(2, 1e-4, 2, -3);
  double before = 0;
  for (int k = 0; k < 600; ++k) {
    before = controller.output();
    plant.step(controller.update(plant.output(), 1.0));
  }
  const double u = controller.output();
  const double v = 2 * u + controller.observer().total_disturbance();
  auto kept = controller;
  settings.observer.input_gain = 3;
  ASSERT_TRUE(controller.retune(settings).has_value());
  const double step = std::abs(controller.update(plant.output(), 1.0) - u);
  const double usual = std::abs(kept.update(plant.output(), 1.0) - u) + std::abs(u - before);
  EXPECT_LE(step, usual);
  EXPECT_GT(std::abs(v * (1.0 / 3 - 1.0 / 2)), 20 * usual);
}

/// The measurement stays due when it was.
TEST(Adrc, RetuneKeepsThePhaseOfTheDivider) {
  auto settings = base();
  settings.measurement_divider = 5;
  settings.missing.most = 2;
  auto controller = Linear::make(settings).value();
  ChainPlant plant(2, period, 2, -3);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 4000; ++k) {
    if (k == 2002) {
      ASSERT_TRUE(controller.retune(settings).has_value());
    }
    plant.step(controller.update(k % 5 == 0 ? plant.output() : nan, 1.0));
    ASSERT_EQ(controller.mode(), LoopMode::running) << k;
  }
  EXPECT_NEAR(plant.output(), 1, 1e-6);
}

TEST(Adrc, RetuneKeepsHoldAndSafeMode) {
  auto settings = base();
  settings.start_hold = {.time = 5 * period, .input = 1};
  settings.missing.most = 0;
  auto controller = Linear::make(settings).value();
  controller.update(0, 0.0);
  ASSERT_TRUE(controller.retune(settings).has_value());
  for (int k = 0; k < 4; ++k) {
    EXPECT_EQ(controller.mode(), LoopMode::start_hold);
    controller.update(0, 0.0);
  }
  EXPECT_EQ(controller.mode(), LoopMode::running);
  controller.update_without_measurement(0.0);
  EXPECT_EQ(controller.mode(), LoopMode::safe);
  ASSERT_TRUE(controller.retune(settings).has_value());
  EXPECT_EQ(controller.mode(), LoopMode::safe);
}

/// After a gap that cannot be bridged the observer restarts, and u goes on from where it was.
TEST(Adrc, RestartAfterALongGapDoesNotBump) {
  auto settings = base();
  settings.observer.max_gap = 10;
  settings.missing.most = 100;
  auto controller = Linear::make(settings).value();
  controller.start(1, 1.5);
  for (int k = 0; k < 50; ++k) EXPECT_NEAR(controller.update_without_measurement(1.0), 1.5, 1e-9);
  EXPECT_NEAR(controller.update(1, 1.0), 1.5, 1e-9);
  EXPECT_TRUE(esokit::has(controller.status(), StepStatus::restarted));
  EXPECT_EQ(controller.mode(), LoopMode::running);
  EXPECT_NEAR(controller.update(1, 1.0), 1.5, 1e-9);
}

// ---- refused

TEST(Adrc, BadConfigIsRefusedByName) {
  const double nan = hidden_nan<double>();
  const auto field = [](auto change) {
    auto settings = base();
    change(settings);
    const auto made = Linear::make(settings);
    return refusal(made);
  };
  EXPECT_EQ(field([](auto&) {}), "accepted");
  EXPECT_EQ(field([](auto& c) { c.limits = {.lower = 1, .upper = -1}; }),
            "limits.lower: must be below limits.upper");
  EXPECT_EQ(field([](auto& c) { c.limits = {.lower = 1, .upper = 1}; }),
            "limits.lower: must be below limits.upper");
  EXPECT_EQ(field([&](auto& c) { c.limits.upper = nan; }), "limits.upper: must be finite");
  EXPECT_EQ(field([](auto& c) { c.limits.rate = -1; }), "limits.rate: must be finite and positive");
  EXPECT_EQ(field([](auto& c) { c.limits.rate = 0; }), "limits.rate: must be finite and positive");
  EXPECT_EQ(field([](auto& c) { c.controller_bandwidth = 0; }),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(field([](auto& c) { c.controller_bandwidth = -2; }),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(field([&](auto& c) { c.controller_bandwidth = nan; }),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(field([](auto& c) {
              c.gains = {{1, 2}};
            }),
            "controller_bandwidth: must be left out if gains is given");
  EXPECT_EQ(field([](auto& c) {
              c.gains = {{1, 2}};
              c.controller_bandwidth = 0;
            }),
            "accepted");
  EXPECT_EQ(field([](auto& c) {
              c.gains = {{1, 2}};
              c.controller_bandwidth = 0;
              c.half_gain = true;
            }),
            "half_gain: must be left out if gains is given");
  EXPECT_EQ(field([](auto& c) { c.observer.input_gain = 0; }),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(field([](auto& c) { c.observer.sample_time = 0; }),
            "sample_time: must be finite and positive");
  EXPECT_EQ(field([](auto& c) { c.start_hold.time = -1; }),
            "start_hold.time: must be finite and not negative");
  EXPECT_EQ(field([](auto& c) { c.start_hold.time = 1e9; }),
            "start_hold.time: must be below 2^24 samples");
  EXPECT_EQ(field([](auto& c) {
              c.limits.upper = 1;
              c.start_hold.input = 2;
            }),
            "start_hold.input: must not be above limits.upper");
  EXPECT_EQ(field([](auto& c) {
              c.limits.lower = -1;
              c.missing.input = -2;
            }),
            "missing.input: must not be below limits.lower");
  EXPECT_EQ(field([](auto& c) { c.missing.most = -1; }),
            "missing.most: must be 0 up to 65534 samples, that is");
  EXPECT_EQ(field([](auto& c) { c.missing.most = 65535; }),
            "missing.most: must be 0 up to 65534 samples, that is");
  EXPECT_EQ(field([](auto& c) { c.measurement_divider = 0; }),
            "measurement_divider: must be 1 .. 1000");
  EXPECT_EQ(field([](auto& c) { c.measurement_divider = 101; }),
            "measurement_divider: must not be above the observer's max_gap, which is");

  using Delayed = esokit::DelayedInput<LinearEso<2>, 4>;
  for (const int delay : {-1, 5}) {
    const auto refused = Delayed::make({.observer = base().observer, .delay = delay});
    ASSERT_EQ(refusal(refused), "delay: must be 0 up to the capacity of the delay line, which is");
    EXPECT_EQ(refused.error().value, delay);
    EXPECT_EQ(refused.error().limit, 4);
  }
  EXPECT_TRUE(Delayed::make({.observer = base().observer, .delay = 4}).has_value());
}

TEST(Adrc, CostsNothingThatIsNotAskedFor) {
  // The observer, the limiter, the two laws and the loop's bookkeeping.
  EXPECT_LE(sizeof(Adrc<LinearEso<2, float>>), sizeof(LinearEso<2, float>) + 112);
  EXPECT_LT(sizeof(Adrc<LinearEso<2, float>>),
            sizeof(Adrc<esokit::DelayedInput<LinearEso<2, float>, 4>>));
}

TEST(Adrc, HoldAndSafeInputAtTheLimit) {
  auto config = base();
  config.limits = {.lower = -1, .upper = 2};
  const auto with = [&](double hold, double safe) {
    auto changed = config;
    changed.start_hold = {.time = 0.01, .input = hold};
    changed.missing.input = safe;
    return refusal(Linear::make(changed));
  };
  // Of what is at the limit in decimals the limiter takes the rest away.
  const double above = 2.0 + 2e-15;
  const double below = -1.0 - 1e-15;
  EXPECT_EQ(with(std::nextafter(2.0, 3.0), std::nextafter(-1.0, -2.0)), "accepted");
  EXPECT_EQ(with(2, 2), "accepted");
  EXPECT_EQ(with(-1, -1), "accepted");
  EXPECT_EQ(with(above, 0), "start_hold.input: must not be above limits.upper");
  EXPECT_EQ(with(below, 0), "start_hold.input: must not be below limits.lower");
  EXPECT_EQ(with(0, above), "missing.input: must not be above limits.upper");
  EXPECT_EQ(with(0, below), "missing.input: must not be below limits.lower");
  EXPECT_EQ(with(hidden_nan<double>(), 0), "start_hold.input: must be finite");
  EXPECT_EQ(with(0, hidden_infinity<double>()), "missing.input: must be finite");
}

}  // namespace control_adrc_test
}  // namespace esokit_test
