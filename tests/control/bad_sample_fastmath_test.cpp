// Bad samples under -ffast-math, where a comparison with NaN may go either way.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
namespace {

using esokit::Adrc;
using esokit::LinearEso;
using esokit::StepStatus;

template <class S>
typename LinearEso<2, S>::Config observer() {
  return {.observer_bandwidth = S(60), .input_gain = S(2), .sample_time = static_cast<S>(1e-3)};
}

template <class Controller>
inline constexpr bool error_based = false;
template <class Observer>
inline constexpr bool error_based<Adrc<Observer, esokit::ErrorBased>> = true;

template <class Controller>
void bad_samples(Controller controller) {
  using S = typename Controller::scalar_type;
  const S half = static_cast<S>(0.5);
  for (int k = 0; k < 50; ++k) controller.update(half, half);
  for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()}) {
    S u = controller.update(bad, half);
    EXPECT_TRUE(esokit::is_finite(u));
    EXPECT_TRUE(esokit::has(controller.status(), StepStatus::measurement_rejected));
    const S before = controller.output();
    u = controller.update(half, bad);
    if (!error_based<Controller>) {
      EXPECT_TRUE(same_bits(u, before));
    }
    controller.applied(bad);
    u = controller.update(half, half);
    EXPECT_TRUE(esokit::is_finite(u));
    for (int k = 0; k < 5; ++k) u = controller.update(half, half);
    EXPECT_TRUE(esokit::is_finite(u));
    // y and reference the same bad number: of y - y a compiler may make zero.
    u = controller.update(bad, bad);
    EXPECT_TRUE(esokit::is_finite(u));
    EXPECT_TRUE(esokit::has(controller.status(), StepStatus::measurement_rejected));
    EXPECT_NE(controller.start(bad, half), StepStatus::ok);
    EXPECT_NE(controller.start(half, bad), StepStatus::ok);
    EXPECT_TRUE(esokit::is_finite(controller.update(half, half)));
  }
}

template <class S>
void all_controllers() {
  const S ten = S(10);
  bad_samples(Adrc<LinearEso<2, S>>::make({.observer = observer<S>(), .controller_bandwidth = ten})
                  .value());
  bad_samples(Adrc<LinearEso<2, S>, esokit::ErrorBased>::make(
                  {.observer = observer<S>(), .controller_bandwidth = ten})
                  .value());
  using Nested =
      esokit::VariableTime<esokit::WrappedOutput<esokit::DelayedInput<LinearEso<2, S>, 2>>>;
  bad_samples(Adrc<Nested>::make(
                  {.observer = {.observer = {.observer = {.observer = observer<S>(), .delay = 1},
                                             .period = S(7)}},
                   .controller_bandwidth = ten})
                  .value());
}

TEST(BadSamplesOfControllers, Double) { all_controllers<double>(); }
TEST(BadSamplesOfControllers, Float) { all_controllers<float>(); }

TEST(BadSamplesOfControllers, EndAnExperiment) {
  const esokit::ExperimentConfig<float> config{.sample_time = 1e-3f,
                                               .input = 0.25f,
                                               .amplitude = 1,
                                               .hysteresis = 0.1f,
                                               .travel = 2,
                                               .time_limit = 9};
  for (const float bad : {hidden_nan<float>(), hidden_infinity<float>()}) {
    for (const bool first : {true, false}) {
      auto experiment = esokit::Experiment<1, float>::make(config).value();
      if (!first) {
        EXPECT_EQ(experiment.update(1), 1.25f);
      }
      auto other = experiment;
      EXPECT_EQ(experiment.update(bad), 0.25f);
      EXPECT_EQ(experiment.reason(), esokit::AbortReason::bad_sample);
      EXPECT_EQ(other.update(1, bad), 0.25f);
      EXPECT_EQ(other.reason(), esokit::AbortReason::bad_sample);
    }
    auto wrong = config;
    wrong.travel = bad;
    EXPECT_FALSE((esokit::Experiment<1, float>::make(wrong)));
  }
}

TEST(BadSamplesOfControllers, ConfigWithNan) {
  const double nan = hidden_nan<double>();
  using C = Adrc<LinearEso<2>>;
  EXPECT_FALSE(C::make({.observer = observer<double>(), .controller_bandwidth = nan}));
  EXPECT_FALSE(C::make(
      {.observer = observer<double>(), .controller_bandwidth = 10, .limits = {.lower = nan}}));
  EXPECT_FALSE(C::make(
      {.observer = observer<double>(), .controller_bandwidth = 10, .start_hold = {.time = nan}}));
  EXPECT_FALSE(C::make(
      {.observer = observer<double>(), .controller_bandwidth = 10, .missing = {.input = nan}}));
  auto variable =
      esokit::VariableTime<LinearEso<2>>::make({.observer = observer<double>()}).value();
  EXPECT_FALSE(variable.set_step_time(nan));
  EXPECT_FALSE(variable.set_step_time(hidden_infinity<double>()));
}

}  // namespace
}  // namespace esokit_test
