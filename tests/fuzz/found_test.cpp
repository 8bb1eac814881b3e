// What the fuzzer found, each as the shortest calls that show it.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <cmath>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace fuzz_found_test {

using esokit::has;
using esokit::LinearEso;
using esokit::StepStatus;
using esokit_test::refusal;

template <class S>
constexpr S largest = std::numeric_limits<S>::max();

/// b0 was kept scaled by T^n / n! alone: one at the end of the scalar came back infinite by
/// rounding.
template <class S>
void input_gain_comes_back_finite() {
  using Observer = LinearEso<2, S>;
  for (int i = 1; i < 200; ++i) {
    typename Observer::Config config{};
    config.sample_time = static_cast<S>(0.001 * i);
    config.observer_bandwidth = S(1) / config.sample_time;
    config.input_gain = largest<S>;
    const auto made = Observer::make(config);
    ASSERT_TRUE(made) << made;
    EXPECT_EQ(made->input_gain(), largest<S>) << i;
  }
}
TEST(Found, InputGainComesBackFinite) {
  input_gain_comes_back_finite<float>();
  input_gain_comes_back_finite<double>();
}

/// K dhat and u - K dhat beyond the scalar: an anti-windup that was given them would be lost.
TEST(Found, CompensationIsFinite) {
  using Compensator = esokit::DisturbanceCompensator<LinearEso<2, float>>;
  auto compensator =
      Compensator::make(
          {.observer = {.observer_bandwidth = 2, .input_gain = 1, .sample_time = 0.5f},
           .compensation_gain = 3.0f})
          .value();
  for (const float sign : {1.0f, -1.0f}) {
    ASSERT_EQ(compensator.start(0, sign * largest<float> / 2), StepStatus::ok);
    EXPECT_EQ(compensator.compensation(), -sign * largest<float>);
    EXPECT_EQ(compensator.base_output(), sign * largest<float>);
  }
  ASSERT_EQ(compensator.start(0, 2), StepStatus::ok);
  EXPECT_FLOAT_EQ(compensator.compensation(), -6);
  EXPECT_FLOAT_EQ(compensator.base_output(), 8);
}

/// The bound of a covariance grows in a gap as samples^(2N-2), noise or not: in float it overflowed
/// within max_gap for seven states, and the gain was NaN with it.
TEST(Found, FilterBridgesALongGap) {
  using Filter = esokit::ExtendedStateFilter<6, float>;
  Filter::Config config{.input_gain = 1,
                        .sample_time = 1e-2f,
                        .measurement_variance = 1e-4f,
                        .inflation = 0.1f,
                        .max_gap = 60000};
  config.disturbance_bounds[6] = 1e7f;
  auto filter = Filter::make(config).value();
  for (int k = 0; k < 200; ++k) filter.update(1, 0);
  for (int k = 0; k < 50000; ++k) {
    filter.predict(0);
    ASSERT_TRUE(eigen(filter.gain()).allFinite()) << k;
    ASSERT_TRUE(eigen(filter.covariance()).allFinite()) << k;
  }
  EXPECT_EQ(filter.update(1, 0), StepStatus::gap_bridged);
  for (int k = 0; k < 200; ++k) filter.update(1, 0);
  EXPECT_NEAR(filter.estimate<0>(), 1, 1e-2);
}

/// An inflation so small that Q (1 + theta) / theta is at the end of the scalar.
TEST(Found, FilterOfTheSmallestInflationBridgesAGap) {
  using Filter = esokit::ExtendedStateFilter<1, float>;
  Filter::Config config{
      .input_gain = 1, .sample_time = 1, .measurement_variance = 0.1f, .inflation = 1.3e-37f};
  config.disturbance_bounds = {0.07f, 0.24f};
  const auto made = Filter::make(config);
  if (!made) {
    EXPECT_STREQ(made.error().field, "inflation");
    return;
  }
  auto filter = *made;
  for (int k = 0; k < 80; ++k) {
    filter.predict(0);
    ASSERT_TRUE(eigen(filter.gain()).allFinite()) << k;
  }
}

/// What a change of b0 no longer explains went into the held dhat, infinite or not.
TEST(Found, RetuneInTheHoldIsRefusedOrFinite) {
  using Observer = esokit::AlgebraicEso<2, float>;
  Observer::Config config{
      .observer_bandwidth = 1, .input_gain = 1, .sample_time = 0.55f, .blanking = 10.0f};
  auto observer = Observer::make(config).value();
  observer.revise_input(-1.7f);
  config.input_gain = -1.7e38f;
  ASSERT_TRUE(observer.retune(config));
  observer.update(0, 1);
  config.input_gain = 1;
  const auto refused = observer.retune(config);
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "input_gain");
  EXPECT_STREQ(refused.error().rule, "would make the estimate not finite");
  EXPECT_TRUE(eigen(observer.estimate()).allFinite());
  EXPECT_TRUE(observer.blanked());
  observer.update(0, 0);
  EXPECT_TRUE(observer.retune(config));
}

/// An inflation that the recursion bears at every sample, and not in gaps that recur.
TEST(Found, FilterOfAnyInflationBearsGapsOrIsRefused) {
  using Filter = esokit::ExtendedStateFilter<1, float>;
  int refused = 0;
  int taken = 0;
  for (float inflation = 1.3e-37f; inflation < 1e30f; inflation *= 10) {
    Filter::Config config{
        .input_gain = 1, .sample_time = 0.2f, .measurement_variance = 0.7f, .inflation = inflation};
    config.disturbance_bounds = {0.7f, 12.0f};
    const auto made = Filter::make(config);
    if (!made) {
      ++refused;
      EXPECT_STREQ(made.error().field, "inflation");
      continue;
    }
    ++taken;
    auto filter = *made;
    for (const int gap : {0, 1, 2, 3, 80}) {
      for (int k = 0; k < 20; ++k) {
        for (int i = 0; i < gap; ++i) {
          filter.predict(0);
          ASSERT_TRUE(eigen(filter.gain()).allFinite()) << inflation << ' ' << gap;
        }
        filter.update(0, 0);
        ASSERT_TRUE(eigen(filter.gain()).allFinite()) << inflation << ' ' << gap;
      }
    }
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(taken, 8);
}

/// An innovation whose square overflowed passed the gate, a smaller one did not: an absurd u left
/// the filter going between the two for good.
TEST(Found, FilterWithAGateComesBackFromAnyInput) {
  using Filter = esokit::ExtendedStateFilter<2, float>;
  Filter::Config config{.input_gain = 1.2f,
                        .sample_time = 0.36f,
                        .measurement_variance = 0.6f,
                        .inflation_rule = esokit::InflationRule::adaptive,
                        .outlier_threshold = 34,
                        .max_gap = 55};
  config.disturbance_bounds = {0.59f, 0.14f, 15};
  auto filter = Filter::make(config).value();
  for (const float u : {1e18f, 1e19f, 1e20f, 1e30f, 6.2e37f}) {
    filter.update(1.25f, u);
    for (int k = 0; k < 500; ++k) filter.update(1.25f, 0);
    EXPECT_EQ(filter.update(1.25f, 0), StepStatus::ok) << u;
    EXPECT_NEAR(filter.estimate()(0), 1.25f, 1e-3f) << u;
    EXPECT_NEAR(filter.total_disturbance(), 0, 1e-3f) << u;
  }
}

/// A gate around which turns were counted only between what it let in: a motion of before, that no
/// rejected measurement could correct, and good samples went between accepted and rejected for
/// good.
TEST(Found, AngleWithAGateComesBack) {
  using Angle = esokit::WrappedOutput<esokit::OutlierGate<esokit::CascadeEso<2, 2>>>;
  auto angle = Angle::make({.observer = {.observer = {.observer_bandwidth = 31.432730180611802,
                                                      .bandwidth_factor = 2.461588955951397,
                                                      .input_gain = 29461,
                                                      .sample_time = 0.014681177493137791},
                                         .threshold = 2.8093840962100143,
                                         .most_in_a_row = 1},
                            .period = 6.2163995168819151})
                   .value();
  ASSERT_EQ(angle.reset({0, 0, 4907.3929242982693}), StepStatus::ok);
  angle.update(-1.4685115936333686, 0);
  for (int k = 0; k < 1000; ++k) angle.update(1.25, 0);
  EXPECT_EQ(angle.update(1.25, 0), StepStatus::ok);
  EXPECT_NEAR(angle.estimate()(0), 1.25, 1e-9);
  EXPECT_NEAR(angle.total_disturbance(), 0, 1e-6);
}

/// Answers of the analysis that were not numbers, and one that ended the program: a plant that the
/// scalar holds sampled without a delay, and not with one.
TEST(Found, AnalysisAnswersWithANumberOrAnError) {
  using Observer = LinearEso<2>;
  const auto observer =
      Observer::make({.observer_bandwidth = 20, .input_gain = 1, .sample_time = 0.02}).value();
  const auto controller =
      esokit::Adrc<Observer>::make(
          {.observer = {.observer_bandwidth = 20, .input_gain = 1, .sample_time = 0.02},
           .controller_bandwidth = 4})
          .value();
  EXPECT_EQ(refusal(esokit::estimation_error_covariance(observer, {largest<double>, 1})),
            "output[0]: has a covariance that the scalar cannot hold");
  int answers = 0;
  int errors = 0;
  for (const double sign : {1.0, -1.0}) {
    for (double size = 1; size < 1e308; size *= 3) {
      for (const bool on_input : {false, true}) {
        for (const double dead_time : {0.0, 0.007}) {
          const auto plant =
              esokit::LinearPlant<2>::chain({.coefficients = {on_input ? 1.0 : sign * size, 1},
                                             .input_gain = on_input ? sign * size : 1.0,
                                             .dead_time = dead_time});
          const auto loop = closed_loop(plant.value(), controller);
          if (!loop) {
            ++errors;
            continue;
          }
          EXPECT_TRUE(std::isfinite(loop->stability_abscissa())) << size;
          const auto margin = delay_margin(*loop);
          if (margin) {
            EXPECT_FALSE(std::isnan(margin->value)) << size;
          }
          (margin ? answers : errors) += 1;
        }
      }
    }
  }
  EXPECT_GT(answers, 10);
  EXPECT_GT(errors, 10);
}

TEST(Found, MarginsOfAPlantWithNextToNoGainAreNumbers) {
  const auto observer =
      esokit::ContinuousLinearEso<2>::make({.observer_bandwidth = 12, .input_gain = 3}).value();
  const auto law = esokit::AdrcLaw<2>::make({.controller_bandwidth = 7, .input_gain = 3}).value();
  for (const double b : {1e-300, 1e-310, 1e-320}) {
    if (esokit_test::sanitized && b > 1e-315) continue;  // takes long
    const auto plant =
        esokit::LinearPlant<2>::chain({.coefficients = {0.007, 4.9}, .input_gain = b});
    const auto found = margins(plant.value(), esokit::ObserverWithLaw{observer, law});
    ASSERT_TRUE(found) << b;
    EXPECT_NEAR(found->modulus.value, 1.0, 1e-9) << b;
    EXPECT_FALSE(std::isnan(found->phase.value) || std::isnan(found->gain_increase.value)) << b;
  }
}

/// way / limit was 0 in float, so a move took one sample, and its fourth derivative was infinite.
TEST(Found, ALimitHoldsForAVeryShortWay) {
  esokit::SmoothProfileConfig<4, float> config{.sample_time = 1.80055185e-36f};
  config.limits = {{9.81152152e-06f, 1790.18494f, 88859.0234f, 563835.125f}};
  auto profile = esokit::SmoothProfile<4, float>::make(config).value();
  (void)profile.update(-1.51432664e-38f);
  for (const float value : profile.motion()) EXPECT_TRUE(esokit::is_finite(value));
}

}  // namespace fuzz_found_test
