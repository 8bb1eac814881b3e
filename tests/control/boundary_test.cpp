// What mutations survived: forms that were never instantiated, a limit at which a setting is still
// good, a bad number at every place of a matrix.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc.hpp>
#include <esokit/control/dual_feedback.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_boundary_test {

using esokit::Adrc;
using esokit::LinearEso;

/// Any poles: the filter is the observer with the same poles and the law.
TEST(Boundary, DualFeedbackWithAnyPoles) {
  using Poles = esokit::PoleSet;
  using Filter =
      esokit::DualFeedbackAdrc<2, double, 1, esokit::DeltaOperator, esokit::LimitedFeedback, Poles>;
  using State = Adrc<LinearEso<2, double, 1, Poles>>;
  const esokit::Array<std::complex<double>, 3> poles{{{-40, 25}, {-40, -25}, {-90, 0}}};
  auto filter = Filter::make({.observer_bandwidth = poles,
                              .controller_bandwidth = 10,
                              .input_gain = 2,
                              .sample_time = 1e-3,
                              .limits = {.lower = -3, .upper = 2}})
                    .value();
  auto state = State::make({.observer = {.poles = poles, .input_gain = 2, .sample_time = 1e-3},
                            .controller_bandwidth = 10,
                            .limits = {.lower = -3, .upper = 2}})
                   .value();
  Random random(8);
  double largest = 0;
  for (int k = 0; k < 2000; ++k) {
    const double y = 0.01 * std::sin(0.01 * k) + 1e-4 * random.uniform(-1, 1);
    const double r = k % 200 < 100 ? 0.02 : -0.02;
    largest = std::max(largest, std::abs(state.requested()));
    ASSERT_NEAR(filter.update(y, r), state.update(y, r), 1e-9) << k;
    ASSERT_NEAR(filter.requested(), state.requested(), 1e-9) << k;
  }
  EXPECT_GT(largest, 0.5);
}

TEST(Boundary, HoldAndSafeInputAtTheLimit) {
  Adrc<LinearEso<2>>::Config config{
      .observer = {.observer_bandwidth = 50, .input_gain = 2, .sample_time = 1e-3},
      .controller_bandwidth = 10,
      .limits = {.lower = -1, .upper = 2}};
  const auto with = [&](double hold, double safe) {
    auto changed = config;
    changed.start_hold = {.time = 0.01, .input = hold};
    changed.missing.input = safe;
    return refusal(Adrc<LinearEso<2>>::make(changed));
  };
  const double above = std::nextafter(2.0, 3.0);
  const double below = std::nextafter(-1.0, -2.0);
  EXPECT_EQ(with(2, 2), "accepted");
  EXPECT_EQ(with(-1, -1), "accepted");
  EXPECT_EQ(with(above, 0), "start_hold.input: must not be above limits.upper");
  EXPECT_EQ(with(below, 0), "start_hold.input: must not be below limits.lower");
  EXPECT_EQ(with(0, above), "missing.input: must not be above limits.upper");
  EXPECT_EQ(with(0, below), "missing.input: must not be below limits.lower");
  EXPECT_EQ(with(hidden_nan<double>(), 0), "start_hold.input: must be finite");
  EXPECT_EQ(with(0, hidden_infinity<double>()), "missing.input: must be finite");
}

TEST(Boundary, BadNumberAnywhereInTheInputMatrix) {
  using Mimo = esokit::MimoAdrc<LinearEso<1>, LinearEso<2>>;
  Mimo::Config config{.observers = {{.observer_bandwidth = 50, .sample_time = 1e-3},
                                    {.observer_bandwidth = 50, .sample_time = 1e-3}},
                      .controller_bandwidths = {10, 10}};
  config.input_matrix = {{2, 1}, {0.5, 3}};
  ASSERT_EQ(refusal(Mimo::make(config)), "accepted");
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (const double bad : {hidden_nan<double>(), hidden_infinity<double>()}) {
        auto changed = config;
        changed.input_matrix(i, j) = bad;
        EXPECT_EQ(refusal(Mimo::make(changed)),
                  "input_matrix[" + std::to_string(2 * i + j) + "]: must be finite");
      }
    }
  }
}

/// The largest and the least variance that a filter starts from, from both sides.
TEST(Boundary, StartVariance) {
  using Filter = esokit::ExtendedStateFilter<2, float>;
  Filter::Config config;
  config.input_gain = 2;
  config.sample_time = 1;
  config.measurement_variance = 1;
  config.disturbance_bounds = {0, 0, 10};
  config.inflation = 0.1f;
  const float range = std::numeric_limits<float>::epsilon() / std::numeric_limits<float>::min();
  const auto with = [&](float variance) {
    config.initial_covariance(0, 0) = variance;
    return refusal(Filter::make(config));
  };
  const std::string rule =
      "initial_covariance[0]: in the scaling T^2r / r!^2 and divided by R is a variance that the "
      "scalar cannot hold";
  EXPECT_EQ(with(0.9e-6f * range), "accepted");
  EXPECT_EQ(with(1.1e-6f * range), rule);
  EXPECT_EQ(with(1.1f / range), "accepted");
  EXPECT_EQ(with(0.9f / range), rule);
  EXPECT_EQ(with(0), "accepted");
}

}  // namespace control_boundary_test
}  // namespace esokit_test
