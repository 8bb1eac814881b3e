// Absurd but finite numbers at the controllers: whatever comes in, u is finite and within its
// limits, and good samples lead back.
#include <gtest/gtest.h>

#include <algorithm>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/tune/pid_conversion.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_absurd_numbers_test {

using esokit::Adrc;
using esokit::CascadeEso;
using esokit::Limits;
using esokit::LinearEso;
using esokit::LoopMode;
using esokit::PredictiveAdrc;
using esokit::StepStatus;

template <class Observer>
typename Observer::Config observer_config() {
  using S = typename Observer::scalar_type;
  typename Observer::Config config{};
  config.observer_bandwidth = S(50);
  config.input_gain = S(2);
  config.sample_time = static_cast<S>(1e-3);
  if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = S(2);
  return config;
}

template <class Controller>
typename Controller::Config config() {
  typename Controller::Config settings{};
  using Observer = std::remove_cvref_t<decltype(Controller::make(settings)->observer())>;
  settings.observer = observer_config<Observer>();
  settings.controller_bandwidth = 10;
  return settings;
}

// ---- angles

/// The error-based form rejects an angle without a branch, as the output-based one does.
template <class Form>
void rejects_angles_without_branch() {
  using Axis = Adrc<esokit::WrappedOutput<LinearEso<2>>, Form>;
  auto controller =
      Axis::make({.observer = {.observer = observer_config<LinearEso<2>>(), .period = 6.25},
                  .controller_bandwidth = 10})
          .value();
  for (int k = 0; k < 100; ++k) controller.update(1, 1);
  for (const double absurd : {1e16, 1e17, -1e20, 1e100, 1e300}) {
    auto fed = controller;
    auto left_out = controller;
    EXPECT_EQ(fed.update(absurd, 1), left_out.update_without_measurement(1)) << absurd;
    EXPECT_EQ(fed.status(), StepStatus::measurement_rejected) << absurd;
    EXPECT_EQ(fed.start(absurd, 0, 1), StepStatus::state_rejected) << absurd;
  }
  // Many turns away from the reference is no fault.
  auto turned = controller;
  EXPECT_NEAR(turned.update(1 + 1000 * 6.25, 1 - 3000 * 6.25), controller.update(1, 1), 1e-6);
  EXPECT_EQ(turned.status(), StepStatus::ok);
}

TEST(AbsurdAngle, IsRejectedInEitherForm) {
  rejects_angles_without_branch<esokit::OutputBased>();
  rejects_angles_without_branch<esokit::ErrorBased>();
}

// ---- missing.most

/// The largest that is accepted is ridden through, of every divider; one more is refused.
TEST(MissingMost, TheLargestIsCounted) {
  for (const int divider : {1, 2, 559, 560, 1000}) {
    SCOPED_TRACE(divider);
    auto settings = config<Adrc<LinearEso<2>>>();
    settings.observer.max_gap = 65000;
    settings.observer.observer_bandwidth = 10;  // bridges 1000 samples
    settings.measurement_divider = divider;
    settings.missing.most = 65534 / divider;
    const auto refused = Adrc<LinearEso<2>>::make(settings);
    ASSERT_EQ(refusal(refused), "missing.most: must be 0 up to 65534 samples, that is");
    EXPECT_EQ(refused.error().limit, 65534 / divider - 1);
    --settings.missing.most;
    auto controller = Adrc<LinearEso<2>>::make(settings).value();
    controller.update(0, 0.0);
    for (int k = 1; k <= settings.missing.most * divider; ++k) {
      controller.update(hidden_nan<double>(), 0.0);
      ASSERT_EQ(controller.mode(), LoopMode::running) << k;
    }
    for (int k = 0; k < divider; ++k) controller.update_without_measurement(0.0);
    EXPECT_EQ(controller.mode(), LoopMode::safe);
  }
}

/// Every sample measured: that needs no gap that the observer bridges.
TEST(MissingMost, AnObserverThatBridgesNothingIsTaken) {
  using Fast = Adrc<LinearEso<4>>;
  auto settings = config<Fast>();
  settings.observer.observer_bandwidth = 4 / settings.observer.sample_time;
  const auto made = Fast::make(settings);
  ASSERT_TRUE(made.has_value()) << refusal(made);
  EXPECT_EQ(made->observer().max_gap(), 0);
  settings.measurement_divider = 2;
  EXPECT_EQ(refusal(Fast::make(settings)),
            "measurement_divider: must not be above the observer's max_gap, which is");
}

/// With nothing missing nothing is safe.
TEST(MissingMost, MeasurementsThatComeAreNotMissing) {
  auto settings = config<Adrc<LinearEso<2>>>();
  settings.observer.max_gap = 65000;
  settings.observer.observer_bandwidth = 10;  // bridges 1000 samples
  settings.measurement_divider = 1000;
  settings.missing.most = 64;
  auto controller = Adrc<LinearEso<2>>::make(settings).value();
  for (int k = 0; k < 5000; ++k) {
    controller.update(0, 0.0);
    ASSERT_EQ(controller.mode(), LoopMode::running) << k;
  }
}

// ---- output() after make

template <class Controller>
void expect_output_within_limits(typename Controller::Config settings) {
  for (const auto& [lower, upper] : {std::pair{1.0, 2.0}, std::pair{-2.0, -1.0}}) {
    settings.limits = {.lower = lower, .upper = upper, .rate = 100};
    settings.missing.hold = true;
    if constexpr (requires { settings.start_hold.input; }) {
      if (settings.start_hold.time > 0) settings.start_hold.input = 0.5 * (lower + upper);
    }
    const auto made = Controller::make(settings);
    ASSERT_TRUE(made.has_value());
    const double u = made->output();
    EXPECT_GE(u, lower);
    EXPECT_LE(u, upper);
  }
}

/// Limits that exclude zero, with and without a hold.
TEST(OutputAfterMake, IsWithinTheLimits) {
  expect_output_within_limits<Adrc<LinearEso<2>>>(config<Adrc<LinearEso<2>>>());
  auto held = config<Adrc<LinearEso<2>>>();
  held.start_hold.time = 0.1;
  expect_output_within_limits<Adrc<LinearEso<2>>>(held);
  expect_output_within_limits<esokit::DisturbanceCompensator<LinearEso<2>>>(
      {.observer = observer_config<LinearEso<2>>(), .start_hold = {.time = 0.1}});
  expect_output_within_limits<PredictiveAdrc<LinearEso<2>>>(config<PredictiveAdrc<LinearEso<2>>>());
  auto predictive = config<PredictiveAdrc<LinearEso<2>>>();
  predictive.start_hold = 0.1;
  predictive.limits = {.lower = 1, .upper = 2};
  predictive.missing.hold = true;
  EXPECT_EQ(refusal(PredictiveAdrc<LinearEso<2>>::make(predictive)),
            "start_hold: must be left out, as its u = 0 is not within the limits");
  using Mimo = esokit::MimoAdrc<LinearEso<1>>;
  Mimo::Config mimo{.observers = {{.observer_bandwidth = 50, .sample_time = 1e-3}},
                    .controller_bandwidths = {10}};
  mimo.input_matrix(0, 0) = 2;
  mimo.limits[0] = {.lower = 1, .upper = 2};
  mimo.missing[0].hold = true;
  EXPECT_EQ(Mimo::make(mimo)->output()(0), 1);
}

// ---- PredictiveAdrc

template <class Observer>
void predictive_stays_within_limits() {
  using S = typename Observer::scalar_type;
  auto settings = config<PredictiveAdrc<Observer>>();
  settings.limits = {.lower = S(-3), .upper = S(3)};
  const S top = std::numeric_limits<S>::max();
  for (const S absurd : {S(top / 340), S(-top / 340), S(top / 3), S(-top), std::sqrt(top)}) {
    auto started = PredictiveAdrc<Observer>::make(settings).value();
    (void)started.start(absurd, S(0));
    auto corrupted = PredictiveAdrc<Observer>::make(settings).value();
    for (int k = 0; k < 20000; ++k) {
      const S y = k == 3 || k == 4 ? absurd : S(0);
      for (const S u : {started.update(S(0), S(0)), corrupted.update(y, S(0))}) {
        ASSERT_TRUE(esokit::is_finite(u)) << absurd << ", sample " << k;
        ASSERT_LE(std::abs(u), S(3)) << absurd << ", sample " << k;
      }
    }
    // All of it fades by exp(-omega_o T) a sample, what the scalar holds within 20000.
    EXPECT_LT(std::abs(corrupted.observer().template estimate<0>()), S(1e-3)) << absurd;
    EXPECT_LT(std::abs(started.observer().template estimate<0>()), S(1e-3)) << absurd;
  }
}

TEST(PredictiveAdrcAbsurd, OutputStaysWithinLimits) {
  predictive_stays_within_limits<LinearEso<2, double>>();
  predictive_stays_within_limits<LinearEso<1, float, 2>>();
  predictive_stays_within_limits<CascadeEso<2, 3, float>>();
}

// ---- retune after absurd numbers

TEST(MimoAbsurd, RetuneIsRefusedOrFinite) {
  using Mimo = esokit::MimoAdrc<LinearEso<1>, LinearEso<2>>;
  Mimo::Config settings{.observers = {{.observer_bandwidth = 50, .sample_time = 1e-3},
                                      {.observer_bandwidth = 50, .sample_time = 1e-3}},
                        .controller_bandwidths = {10, 10}};
  settings.input_matrix = {{2, 1}, {0, 2}};
  auto controller = Mimo::make(settings).value();
  const double top = std::numeric_limits<double>::max();
  controller.applied({0.9 * top, 0.9 * top});
  (void)controller.update({0, 0}, {0, 0});
  for (const double scale : {1e-3, 1.0, 3.0}) {
    auto changed = settings;
    changed.input_matrix = {{2 * scale, -scale}, {0, -2 * scale}};
    auto tried = controller;
    const auto outcome = tried.retune(changed);
    for (int k = 0; k < 5; ++k) {
      EXPECT_TRUE(eigen(tried.observer<0>().estimate()).allFinite()) << scale;
      EXPECT_TRUE(eigen(tried.observer<1>().estimate()).allFinite()) << scale;
      EXPECT_TRUE(eigen(tried.output()).allFinite()) << scale;
      if (!outcome) {
        EXPECT_EQ(tried.observer<0>().estimate(), controller.observer<0>().estimate());
        EXPECT_EQ(tried.observer<1>().estimate(), controller.observer<1>().estimate());
        break;
      }
      tried.update({0, 0}, {0, 0});
    }
  }
  // u is absurd, the change of B0 is not.
  Mimo single = Mimo::make(settings).value();
  (void)single.start({0, 0}, {1e307, 0});
  auto changed = settings;
  changed.input_matrix = {{200, 1}, {0, 2}};
  const auto refused = single.retune(changed);
  ASSERT_EQ(refusal(refused),
            "input_matrix: turns the present u (the value here) into a disturbance that the scalar "
            "cannot hold");
  EXPECT_EQ(refused.error().value, 1e307);
  EXPECT_DOUBLE_EQ(single.observer<0>().estimate()(1), -2e307);
}

/// Without a rate limit no u is out of reach, however far apart the two are.
TEST(AbsurdNumbers, NoRateLimitIsNone) {
  auto limiter = esokit::Limiter<double>::make({}, 1e-3).value();
  EXPECT_EQ(limiter(1e308), 1e308);
  EXPECT_EQ(limiter(-1e308), -1e308);
}

TEST(AbsurdNumbers, WithinIsTheMagnitudeOnBothSides) {
  const auto limiter = esokit::Limiter<double>::make({-1, 2, 1}, 1e-3).value();
  for (const double u : {-1e308, -1.0, 0.5, 2.0, 1e308}) {
    EXPECT_EQ(limiter.within(u), std::clamp(u, -1.0, 2.0));
  }
}

// ---- make

TEST(AbsurdSettings, LawsWhoseResultIsNotFiniteAreRefused) {
  using Feedback = esokit::NonlinearFeedback<2, float>;
  const auto refused =
      Feedback::make({.exponents = {1, 0.01f}, .linear_widths = {1, 1e-44f}, .input_gain = 1});
  ASSERT_EQ(refusal(refused),
            "linear_widths[1]: with this exponent, gain and input_gain gives a slope that the "
            "scalar cannot hold");
  EXPECT_EQ(refused.error().index, 1);
  EXPECT_TRUE(
      Feedback::make({.exponents = {1, 0.01f}, .linear_widths = {1, 1e-30f}, .input_gain = 1}));
  EXPECT_FALSE(Feedback::make({.gains = {1e30f, 1}, .input_gain = 1e-30f}));
  EXPECT_TRUE(Feedback::make({.gains = {1e7f, 1}, .input_gain = 1e-30f}));

  using Law = esokit::AdrcLaw<2, float>;
  for (const auto& law : {Law::make({.gains = {{1, 1e30f}}, .input_gain = 1e-30f}),
                          Law::make({.controller_bandwidth = 1e6f, .input_gain = 1e-30f})}) {
    ASSERT_EQ(refusal(law), "input_gain: with these gains gives a law that the scalar cannot hold");
  }
  EXPECT_TRUE(Law::make({.gains = {{1, 1e7f}}, .input_gain = 1e-30f}).has_value());
  EXPECT_TRUE(Law::make({.controller_bandwidth = 1e3f, .input_gain = 1e-30f}).has_value());
}

TEST(AbsurdSettings, PidOfAnAdrcIsFinite) {
  using esokit::pid_from_adrc;
  for (const esokit::AdrcTuning<float> tuning :
       {esokit::AdrcTuning<float>{1e-36f, 100, 1000}, {1, 1e20f, 1e20f}, {1, 1e-20f, 1e-20f}}) {
    for (const auto& pid : {pid_from_adrc<1>(tuning), pid_from_adrc<2>(tuning)}) {
      if (!pid) {
        ASSERT_EQ(refusal(pid),
                  "observer_bandwidth: with controller_bandwidth and input_gain gives a PID that "
                  "the scalar cannot hold");
        continue;
      }
      EXPECT_TRUE(esokit::is_finite(pid->proportional));
      EXPECT_TRUE(esokit::is_finite(pid->integral));
      EXPECT_TRUE(esokit::is_finite(pid->derivative));
      EXPECT_TRUE(esokit::is_finite(pid->filter_time));
      EXPECT_TRUE(esokit::is_finite(pid->filter_time_squared));
      EXPECT_GT(pid->integral, 0);
    }
  }
  EXPECT_EQ(refusal(pid_from_adrc<2>(esokit::AdrcTuning<float>{1e-36f, 100, 1000})),
            "observer_bandwidth: with controller_bandwidth and input_gain gives a PID that the "
            "scalar cannot hold");
  EXPECT_TRUE(pid_from_adrc<2>(esokit::AdrcTuning<float>{1e-3f, 100, 1000}).has_value());
}

}  // namespace control_absurd_numbers_test
}  // namespace esokit_test
