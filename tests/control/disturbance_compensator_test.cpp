#include <support/no_allocation.hpp>
#include <support/refusal.hpp>
//
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_disturbance_compensator_test {

using esokit::DisturbanceCompensator;
using esokit::LinearEso;
using Compensator = DisturbanceCompensator<LinearEso<2>>;

constexpr double period = 1e-3;

Compensator::Config base() {
  return {.observer = {.observer_bandwidth = 80, .input_gain = 2, .sample_time = period}};
}

/// Around the state feedback of ADRC it is ADRC, limits included.
TEST(DisturbanceCompensator, AroundAStateFeedbackItIsAdrc) {
  auto settings = base();
  settings.limits = {.lower = -3, .upper = 4, .rate = 500};
  auto compensator = Compensator::make(settings).value();
  auto adrc =
      Adrc<LinearEso<2>>::make(
          {.observer = settings.observer, .controller_bandwidth = 10, .limits = settings.limits})
          .value();
  ChainPlant plant(2, period, 2, -3);
  for (int k = 0; k < 2000; ++k) {
    const double y = plant.output();
    const double u = adrc.update(y, 1.0);
    const auto z = adrc.observer().estimate();
    const double base_output = (100 * (1 - z(0)) - 20 * z(1)) / 2;
    ASSERT_NEAR(compensator.update(y, base_output), u, 1e-9) << k;
    plant.step(u);
  }
}

/// A PD controller has a steady error under a disturbance; wrapped, it has none.
template <class Observer>
void removes_the_steady_error(const typename Observer::Config& observer) {
  auto compensator = DisturbanceCompensator<Observer>::make({.observer = observer}).value();
  ChainPlant plain(2, period, 2, -3);
  ChainPlant wrapped = plain;
  const auto pd = [](const ChainPlant& plant) {
    return 50 * (1 - plant.output()) - 10 * plant.state()[1];
  };
  for (int k = 0; k < 8000; ++k) {
    plain.step(pd(plain));
    wrapped.step(compensator.update(wrapped.output(), pd(wrapped)));
  }
  EXPECT_NEAR(1 - plain.output(), 0.03, 1e-6);
  EXPECT_NEAR(wrapped.output(), 1, 1e-6);
}

TEST(DisturbanceCompensator, RemovesTheSteadyError) {
  removes_the_steady_error<LinearEso<2>>(base().observer);
  removes_the_steady_error<esokit::CascadeEso<2, 2>>(
      {.observer_bandwidth = 60, .bandwidth_factor = 2, .input_gain = 2, .sample_time = period});
  removes_the_steady_error<esokit::AlgebraicEso<2>>(
      {.observer_bandwidth = 60, .frequency_shift = 20, .input_gain = 2, .sample_time = period});
}

/// y' = x + w, x' = -4 x + u: w does not come in where u does. The observer stands at the first
/// equation, driven by x; u has to hold x at -w, that is K = -4.
TEST(DisturbanceCompensator, Mismatched) {
  constexpr double w = 0.7;
  const auto final_output = [&](double compensation_gain) {
    auto compensator =
        DisturbanceCompensator<LinearEso<1>>::make(
            {.observer = {.observer_bandwidth = 30, .input_gain = 1, .sample_time = period},
             .compensation_gain = compensation_gain})
            .value();
    double x = 0, y = 0, held = 0;
    for (int k = 0; k < 20000; ++k) {
      const double u = compensator.update_driven(y, -8 * y, held);
      held = x;  // about the mean over the coming millisecond
      for (int i = 0; i < 4; ++i) {
        y += period / 4 * (x + w);
        x += period / 4 * (-4 * x + u);
      }
    }
    EXPECT_NEAR(compensator.observer().total_disturbance(), w, 1e-3);
    return y;
  };
  EXPECT_NEAR(final_output(0), w / 2, 1e-3);
  EXPECT_NEAR(final_output(-4), 0, 1e-3);
  EXPECT_EQ(Compensator::make({.observer = base().observer, .compensation_gain = 0.25})
                .value()
                .compensation(),
            0);
  auto gained = Compensator::make({.observer = base().observer, .compensation_gain = 0.25}).value();
  gained.start(1, 3);  // dhat = -6
  EXPECT_NEAR(gained.compensation(), -1.5, 1e-12);
}

TEST(DisturbanceCompensator, StartTrackAndRetuneDoNotBump) {
  auto settings = base();
  settings.limits = {.lower = -9, .upper = 9};
  auto compensator = Compensator::make(settings).value();
  EXPECT_EQ(compensator.start(0.5, 1.5), StepStatus::ok);
  EXPECT_NEAR(compensator.base_output(), 0, 1e-12);
  ChainPlant plant(2, period, 2, -3);
  plant.set_state({0.5, 0});
  for (int k = 0; k < 50; ++k) {
    const double u = compensator.update(plant.output(), 0.0);
    ASSERT_NEAR(u, 1.5, 1e-9);
    plant.step(u);
  }
  settings.observer.observer_bandwidth = 120;
  settings.observer.input_gain = 3;
  ASSERT_TRUE(compensator.retune(settings).has_value());
  EXPECT_NEAR(compensator.update(plant.output(), 0.0), 1.5, 1e-9);
  // Off and on again: the controller's output is set to what keeps u.
  for (int k = 0; k < 3000; ++k) {
    compensator.track(plant.output(), 1.5);
    plant.step(1.5);
  }
  EXPECT_NEAR(compensator.update(plant.output(), compensator.base_output()), 1.5, 1e-9);
  settings.observer.input_gain = 0;
  EXPECT_EQ(refusal(compensator.retune(settings)),
            "input_gain: must be finite and not zero (negative is fine)");
}

TEST(DisturbanceCompensator, RefusesWhatItCannotRun) {
  auto settings = base();
  settings.observer.max_gap = 10;
  settings.measurement_divider = 20;  // each measurement would restart the observer
  const auto rare = Compensator::make(settings);
  ASSERT_EQ(refusal(rare),
            "measurement_divider: must not be above the observer's max_gap, which is");

  using Single = DisturbanceCompensator<LinearEso<1, float>>;
  const Single::Config tiny{
      .observer = {.observer_bandwidth = 1e-3f, .input_gain = 1e-39f, .sample_time = 1e3f}};
  const auto observer = LinearEso<1, float>::make(tiny.observer);
  ASSERT_TRUE(observer.has_value());
  const auto infinite = Single::make(tiny);
  ASSERT_EQ(refusal(infinite), "input_gain: has an inverse that the scalar cannot hold");
}

TEST(DisturbanceCompensator, LimitsMissingAndErrors) {
  auto settings = base();
  settings.limits = {.lower = -1, .upper = 2, .rate = 100};
  settings.missing = {.most = 2, .input = 0.5};
  settings.start_hold = {.time = 3 * period, .input = 0.25};
  auto compensator = Compensator::make(settings).value();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(compensator.update(0, 9.0), 0.25);
  EXPECT_NEAR(compensator.update(0, 9.0), 0.35, 1e-12);
  compensator.applied(1.95);
  EXPECT_NEAR(compensator.update(0, 9.0), 0.45, 1e-12);
  compensator.track(0, 1.95);
  EXPECT_EQ(compensator.update(0, 9.0), 2);
  compensator.update(hidden_nan<double>(), 0.0);
  compensator.update_without_measurement(0.0);
  EXPECT_EQ(compensator.mode(), LoopMode::running);
  for (int k = 0; k < 40; ++k) compensator.update_without_measurement(0.0);
  EXPECT_EQ(compensator.mode(), LoopMode::safe);
  EXPECT_EQ(compensator.output(), 0.5);
  {
    const NoAllocation guard;
    compensator.update(0.1, 0.2);
    EXPECT_EQ(guard.count(), 0);
  }
  settings = base();
  settings.compensation_gain = hidden_nan<double>();
  EXPECT_EQ(refusal(Compensator::make(settings)), "compensation_gain: must be finite");
  settings = base();
  settings.limits.rate = -1;
  EXPECT_EQ(refusal(Compensator::make(settings)), "limits.rate: must be finite and positive");
}

}  // namespace control_disturbance_compensator_test
}  // namespace esokit_test
