// ExtendedStateFilter: against the paper's equations on dense matrices, its modes and its
// identities.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <limits>
#include <support/dense_filter.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <type_traits>

namespace esokit_test::observer_extended_state_filter_test {

using esokit::ExtendedStateFilter;
using esokit::InflationRule;
using esokit::RiccatiMode;
using esokit::StepStatus;

constexpr double period = 1e-3;
constexpr double b0 = 230;

/// The settings that work for paper 5, in a library config.
template <int Order, class S, int Extension,
          class Filter = ExtendedStateFilter<Order, S, Extension>>
typename Filter::Config typical(InflationRule rule = InflationRule::fixed) {
  typename Filter::Config config{.input_gain = static_cast<S>(b0),
                                 .sample_time = static_cast<S>(period),
                                 .measurement_variance = static_cast<S>(1e-6),
                                 .inflation_rule = rule};
  if (rule == InflationRule::fixed) config.inflation = static_cast<S>(0.5);
  double bound = 1e-6;
  for (int i = 0; i < Order + Extension; ++i) {
    config.disturbance_bounds[static_cast<std::size_t>(i)] = static_cast<S>(bound);
    config.initial_covariance(i, i) = static_cast<S>(1e3 * bound * bound * 1e6);
    bound *= i == 0 ? 1e3 : 3e2;
  }
  return config;
}

/// The dense oracle with the same settings.
template <int Order, int Extension>
DenseFilter<Order, double, Extension> oracle(
    const typename ExtendedStateFilter<Order, double, Extension>::Config& config) {
  DenseFilter<Order, double, Extension> dense(config.sample_time, config.input_gain);
  dense.q.setZero();
  if (config.process_covariance) {
    dense.q = *config.process_covariance;
  } else {
    for (int i = 0; i < Order + Extension; ++i) {
      const double bound = config.disturbance_bounds[static_cast<std::size_t>(i)];
      dense.q(i, i) = config.bound_factor * bound * bound;
    }
  }
  dense.p = config.initial_covariance;
  dense.r = config.measurement_variance;
  dense.theta = config.inflation;
  dense.plain = config.inflation_rule == InflationRule::none;
  return dense;
}

template <class A, class B>
double covariance_distance(const A& a, const B& b) {
  double worst = 0;
  for (int i = 0; i < a.rows(); ++i) {
    for (int j = 0; j < a.cols(); ++j) {
      worst = std::max(
          worst, static_cast<double>(std::abs(a(i, j) - b(i, j)) / std::sqrt(b(i, i) * b(j, j))));
    }
  }
  return worst;
}

template <class A, class B>
double relative_distance(const A& a, const B& b) {
  double worst = 0;
  for (int i = 0; i < a.rows(); ++i) {
    worst = std::max(worst, static_cast<double>(std::abs(a(i) / b(i) - 1)));
  }
  return worst;
}

/// Positive definite, by the pivots of its correlations: the states differ by orders of magnitude.
template <class Square>
bool positive_definite(const Square& p) {
  Square rest = p;
  for (int i = 0; i < p.rows(); ++i) {
    for (int j = 0; j < p.cols(); ++j) rest(i, j) /= std::sqrt(p(i, i)) * std::sqrt(p(j, j));
  }
  for (int k = 0; k < rest.rows(); ++k) {
    if (!(rest(k, k) > 0)) return false;
    for (int i = k + 1; i < rest.rows(); ++i) {
      for (int j = k + 1; j < rest.rows(); ++j) {
        rest(i, j) -= rest(i, k) * rest(k, j) / rest(k, k);
      }
    }
  }
  return true;
}

// ---- the paper's equations ----

/// z+ = A z + B u - K (y - C z) with (11), (24): the predictor form, beside the library's corrected
/// form. Predicted states, gains and covariances are the same; so the two forms agree.
template <int Order, int Extension>
void follows_the_dense_recursion(InflationRule rule, bool full_noise, bool gaps) {
  using Filter = ExtendedStateFilter<Order, double, Extension>;
  constexpr int size = Order + Extension;
  auto config = typical<Order, double, Extension>(rule);
  config.bound_factor = 2;
  if (full_noise) {
    typename Filter::Covariance q;
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        const auto bound = [&](int r) {
          return config.disturbance_bounds[static_cast<std::size_t>(r)];
        };
        q(i, j) = bound(i) * bound(j) * (i == j ? 2.0 : 0.7);
      }
    }
    config.process_covariance = q;
    config.disturbance_bounds = {};
  }
  Filter filter = Filter::make(config).value();
  auto dense = oracle<Order, Extension>(config);
  Random random(17);
  // The dense form loses digits to its conditioning; 1e-8 of 1e-16 leaves no room for a wrong term.
  constexpr double unit = 1e-8;
  for (int k = 0; k < 200; ++k) {
    const double y = random.uniform(-1, 1);
    const double u = random.uniform(-1, 1);
    ASSERT_LE(relative_distance(filter.gain(), dense.current_gain()), unit) << k;
    ASSERT_LE(relative_distance(filter.predictor_gain(), dense.a * dense.current_gain()), unit);
    ASSERT_LE(covariance_distance(filter.covariance(), dense.p), unit) << k;
    ASSERT_NEAR(filter.innovation_variance(), dense.p(0, 0) + dense.r, unit * dense.p(0, 0));
    for (int r = 0; r < size; ++r) {
      const double scale = std::sqrt(dense.p(r, r)) / std::sqrt(dense.p(0, 0));
      ASSERT_NEAR(filter.estimate()(r), dense.z(r), unit * (std::abs(dense.z(r)) + scale)) << k;
    }
    if (gaps && k % 7 > 4) {
      dense.step_blind(u);
    } else {
      const auto l = dense.current_gain();
      const Eigen::Matrix<double, size, size> rest = Eigen::Matrix<double, size, size>::Identity() -
                                                     l * Eigen::Matrix<double, 1, size>::Unit(0);
      const Eigen::Matrix<double, size, size> bound =
          rest * dense.p * rest.transpose() + l * dense.r * l.transpose();
      filter.correct(y);
      ASSERT_LE(covariance_distance(filter.covariance(), bound), unit) << k;
      ASSERT_NEAR(filter.normalised_innovation(),
                  filter.innovation() * filter.innovation() / (dense.p(0, 0) + dense.r),
                  unit * filter.normalised_innovation());
      dense.step_predictor_form(y, u);
    }
    filter.predict(u);
  }
}

TEST(ExtendedStateFilter, corrected_form_is_the_predictor_form_of_11_and_24) {
  follows_the_dense_recursion<1, 1>(InflationRule::fixed, false, false);
  follows_the_dense_recursion<2, 1>(InflationRule::fixed, false, false);
  follows_the_dense_recursion<3, 1>(InflationRule::fixed, false, false);
  follows_the_dense_recursion<2, 2>(InflationRule::fixed, false, false);
  follows_the_dense_recursion<2, 1>(InflationRule::fixed, true, false);
}

TEST(ExtendedStateFilter, a_missing_sample_is_the_time_update_alone) {
  follows_the_dense_recursion<2, 1>(InflationRule::fixed, false, true);
  follows_the_dense_recursion<2, 1>(InflationRule::none, true, true);
}

TEST(ExtendedStateFilter, without_inflation_it_is_the_kalman_filter) {
  follows_the_dense_recursion<1, 1>(InflationRule::none, false, false);
  follows_the_dense_recursion<2, 1>(InflationRule::none, false, false);
  follows_the_dense_recursion<3, 1>(InflationRule::none, true, false);
}

/// A printed gain: the sheet's settings, sigma = 0.001; the limit from a DARE solver in another
/// language (scipy.linalg.solve_discrete_are on sqrt(1.5) A, 3 Q, R / 1.5).
TEST(ExtendedStateFilter, limit_of_the_papers_example) {
  auto config = typical<2, double, 1>();
  config.disturbance_bounds = {1e-6, 1e-3, 300};
  config.bound_factor = 2;
  config.mode = RiccatiMode::frozen;
  const auto filter = ExtendedStateFilter<2>::make(config).value();
  const Eigen::Vector3d scipy(0.92424989086067, 892.61173018802, 394423.92326484);
  EXPECT_LE(relative_distance(filter.gain(), scipy), 1e-11);
}

// ---- identities ----

/// theta and no disturbance: all poles at 1 / (1 + theta), LinearEso with omega_o = ln(1+theta)/T.
TEST(ExtendedStateFilter, without_disturbance_it_tends_to_the_linear_observer) {
  auto config = typical<2, double, 1>();
  config.disturbance_bounds = {};
  eigen(config.initial_covariance).setIdentity();
  const auto linear =
      esokit::LinearEso<2>::make(
          {.observer_bandwidth = std::log(1.5) / period, .input_gain = b0, .sample_time = period})
          .value();
  auto filter = ExtendedStateFilter<2>::make(config).value();
  for (int k = 0; k < 300; ++k) filter.update(0, 0);
  const Eigen::Vector3d expected = esokit::physical_gain<3, double>(linear.level_gain(0), period);
  EXPECT_LE(relative_distance(filter.gain(), expected), 1e-12);
  config.mode = RiccatiMode::frozen;
  const auto frozen = ExtendedStateFilter<2>::make(config).value();
  EXPECT_LE(relative_distance(frozen.gain(), expected), 1e-13);
}

/// theta -> 0: the terms (1+theta)/theta Q must then stay bounded, so Q goes with theta; what is
/// left is the Kalman filter with the limit of Q (1+theta)/theta.
TEST(ExtendedStateFilter, small_theta_tends_to_the_kalman_filter) {
  auto plain = typical<2, double, 1>(InflationRule::none);
  const auto reference = ExtendedStateFilter<2>::make(plain).value();
  double last = 100;
  for (const double theta : {1e-2, 1e-4, 1e-6}) {
    auto config = typical<2, double, 1>();
    config.inflation = theta;
    config.bound_factor = plain.bound_factor * theta / (1 + theta);
    auto filter = ExtendedStateFilter<2>::make(config).value();
    auto kalman = reference;
    double worst = 0;
    for (int k = 0; k < 60; ++k) {
      filter.update(0, 0);
      kalman.update(0, 0);
      worst = std::max(worst, relative_distance(filter.gain(), kalman.gain()));
    }
    EXPECT_LT(worst, 20 * theta);
    EXPECT_LT(worst, last / 50);
    last = worst;
  }
}

/// theta -> 0 and no disturbance at all: the Kalman filter of a chain that is never disturbed,
/// which is least squares over all samples.
TEST(ExtendedStateFilter, small_theta_without_disturbance_is_the_undisturbed_kalman_filter) {
  auto plain = typical<2, double, 1>(InflationRule::none);
  plain.disturbance_bounds = {};
  plain.allow_vanishing_gain = true;
  double last = 1;
  for (const double theta : {1e-4, 1e-6, 1e-8}) {
    auto config = typical<2, double, 1>();
    config.disturbance_bounds = {};
    config.inflation = theta;
    auto filter = ExtendedStateFilter<2>::make(config).value();
    auto kalman = ExtendedStateFilter<2>::make(plain).value();
    double worst = 0;
    for (int k = 0; k < 60; ++k) {
      filter.update(0, 0);
      kalman.update(0, 0);
      worst = std::max(worst, relative_distance(filter.gain(), kalman.gain()));
    }
    EXPECT_LT(worst, 100 * theta);  // of 60 samples' growth
    EXPECT_LT(worst, last / 50);
    last = worst;
  }
}

// ---- modes ----

template <class S, int Order, int Extension>
void frozen_is_the_limit(InflationRule rule) {
  using Filter = ExtendedStateFilter<Order, S, Extension>;
  auto config = typical<Order, S, Extension>(rule);
  auto recursive = Filter::make(config).value();
  config.mode = RiccatiMode::frozen;
  auto frozen = Filter::make(config).value();
  for (int k = 0; k < 5000; ++k) recursive.update(S(0), S(0));
  const double unit = 1e4 * static_cast<double>(std::numeric_limits<S>::epsilon());
  for (int k = 0; k < 3; ++k) {
    EXPECT_TRUE(frozen.frozen());
    EXPECT_LE(relative_distance(frozen.gain(), recursive.gain()), unit);
    EXPECT_NEAR(static_cast<double>(frozen.inflation() / (recursive.inflation() + S(1e-30))),
                rule == InflationRule::none ? 0.0 : 1.0, unit);
    frozen.update(S(0.1), S(0.2));
    recursive.update(S(0.1), S(0.2));
    EXPECT_LE(covariance_distance(frozen.covariance(), recursive.covariance()), unit);
    EXPECT_NEAR(static_cast<double>(frozen.innovation_variance() / recursive.innovation_variance()),
                1.0, unit);
  }
}

TEST(ExtendedStateFilter, frozen_gain_is_the_limit_of_the_recursion) {
  for (const auto rule : {InflationRule::fixed, InflationRule::none, InflationRule::adaptive}) {
    SCOPED_TRACE(static_cast<int>(rule));
    frozen_is_the_limit<double, 1, 1>(rule);
    frozen_is_the_limit<double, 2, 1>(rule);
    frozen_is_the_limit<double, 3, 1>(rule);
    frozen_is_the_limit<double, 2, 2>(rule);
    frozen_is_the_limit<float, 2, 1>(rule);
  }
}

/// A gap wakes the recursion up; afterwards it goes back to rest.
TEST(ExtendedStateFilter, frozen_filter_bridges_gaps_by_the_recursion) {
  auto config = typical<2, double, 1>();
  auto recursive = ExtendedStateFilter<2>::make(config).value();
  config.mode = RiccatiMode::frozen;
  auto frozen = ExtendedStateFilter<2>::make(config).value();
  for (int k = 0; k < 1000; ++k) recursive.update(0, 0);
  frozen.update(0, 0);
  for (int missing = 0; missing < 4; ++missing) {
    recursive.predict(0);
    frozen.predict(0);
    EXPECT_EQ(frozen.frozen(), missing == 0);
    EXPECT_LE(relative_distance(frozen.gain(), recursive.gain()), 1e-10);
  }
  EXPECT_EQ(frozen.correct(1), StepStatus::gap_bridged);
  recursive.correct(1);
  for (int k = 0; k < 100; ++k) {
    recursive.update(0, 0);
    frozen.update(0, 0);
    EXPECT_LE(relative_distance(frozen.gain(), recursive.gain()), 1.1e-3) << k;
  }
  EXPECT_TRUE(frozen.frozen());
  EXPECT_LE(relative_distance(frozen.gain(), recursive.gain()), 1e-10);
}

/// One correction in M for ever: stable, where a constant gain is not.
TEST(ExtendedStateFilter, recurring_gaps_are_stable) {
  for (const auto mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    for (const int every : {2, 3, 5, 20}) {
      auto config = typical<2, double, 1>();
      config.mode = mode;
      auto filter = ExtendedStateFilter<2>::make(config).value();
      filter.reset(Eigen::Vector3d(1, 1e3, 1e6));
      for (int k = 0; k < 100; ++k) {
        for (int i = 0; i < every; ++i) filter.predict(0);
        filter.correct(0);
      }
      EXPECT_LE(std::abs(filter.estimate()(0)), 1e-9) << every;
      EXPECT_LE(std::abs(filter.estimate()(2)), 1e-3) << every;
    }
  }
}

using Tabled = ExtendedStateFilter<2, double, 1, esokit::NoNominalModel, 40>;

TEST(ExtendedStateFilter, start_table_holds_the_first_gains_of_the_recursion) {
  auto config = typical<2, double, 1, Tabled>();
  auto recursive = Tabled::make(config).value();
  config.mode = RiccatiMode::start_table;
  auto tabled = Tabled::make(config).value();
  for (int round = 0; round < 2; ++round) {
    for (int k = 0; k < 60; ++k) {
      recursive.update(0.1, 0);
      tabled.update(0.1, 0);
      EXPECT_TRUE(tabled.frozen());
      const double unit = k < 40 ? 1e-15 : 2e-3;  // the limit is not quite reached
      ASSERT_LE(relative_distance(tabled.gain(), recursive.gain()), unit) << k;
      ASSERT_LE(covariance_distance(tabled.covariance(), recursive.covariance()), unit) << k;
    }
    recursive.reset(0.5);
    tabled.reset(0.5);
  }
  // A gap among the first samples: on by the recursion, from where the table was.
  for (int k = 0; k < 5; ++k) {
    recursive.update(0.1, 0);
    tabled.update(0.1, 0);
  }
  for (int k = 0; k < 3; ++k) {
    recursive.predict(0);
    tabled.predict(0);
  }
  EXPECT_FALSE(tabled.frozen());
  EXPECT_LE(relative_distance(tabled.gain(), recursive.gain()), 1e-14);
}

TEST(ExtendedStateFilter, start_table_may_be_too_short) {
  auto config = typical<2, double, 1, Tabled>();
  config.mode = RiccatiMode::start_table;
  config.inflation = 0.01;  // remembers 100 samples
  config.disturbance_bounds = {};
  const auto made = Tabled::make(config);
  ASSERT_FALSE(made.has_value());
  EXPECT_EQ(
      refusal(made),
      "mode[0]: has too short a start table: its last gain is more than a tenth off the limit");
  EXPECT_TRUE(made.error().has_limit);
  auto other = typical<2, double, 1>();
  other.mode = RiccatiMode::start_table;
  EXPECT_EQ(refusal(ExtendedStateFilter<2>::make(other)),
            "mode: needs a filter with a TableSize above 0 for a start table");
}

/// theta by the rule, with the gain of the theta before; the bound (11) holds for it. Checked on
/// dense matrices.
TEST(ExtendedStateFilter, adaptive_theta_makes_the_weighted_trace_least) {
  auto config = typical<2, double, 1>(InflationRule::adaptive);
  config.trace_weights = {1, 2, 0.5};
  auto filter = ExtendedStateFilter<2>::make(config).value();
  DenseFilter<2, double> dense = oracle<2, 1>(config);
  dense.theta = 0;
  dense.plain = true;  // before the first step R is not reduced
  Eigen::Vector3d weights;
  for (int i = 0; i < 3; ++i) {
    const auto unit = static_cast<double>(nordsieck(i, period));
    weights(i) = config.trace_weights[static_cast<std::size_t>(i)] * unit * unit;
  }
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector3d l = dense.current_gain();
    EXPECT_LE(relative_distance(filter.gain(), l), 1e-8) << k;
    const bool missing = k % 10 == 6;
    const Eigen::Vector3d gain =
        missing ? Eigen::Vector3d(0, 0, 0) : Eigen::Vector3d(-(dense.a * l));
    Eigen::Matrix3d closed = dense.a;
    closed.col(0) += gain;
    const Eigen::Matrix3d homogeneous = closed * dense.p * closed.transpose();
    const double theta =
        std::sqrt(weights.dot(dense.q.diagonal()) / weights.dot(homogeneous.diagonal()));
    const auto trace = [&](double t) {
      return weights.dot(((1 + t) * homogeneous + (1 + 1 / t) * dense.q).diagonal());
    };
    EXPECT_LT(trace(theta), trace(1.01 * theta));
    EXPECT_LT(trace(theta), trace(0.99 * theta));
    dense.theta = theta;
    dense.plain = false;
    dense.step_covariance(gain);
    if (!missing) filter.correct(0);
    filter.predict(0);
    EXPECT_NEAR(filter.inflation() / theta, 1, 1e-8) << k;
    EXPECT_LE(covariance_distance(filter.covariance(), dense.p), 1e-8) << k;
  }
}

/// Where nothing is uncertain the rule asks for an infinite theta: it gets the largest, and theta
/// follows once there is a covariance.
TEST(ExtendedStateFilter, adaptive_theta_of_a_known_start) {
  auto config = typical<2, double, 1>(InflationRule::adaptive);
  eigen(config.initial_covariance).setZero();
  auto filter = ExtendedStateFilter<2>::make(config).value();
  filter.predict(0);
  EXPECT_EQ(filter.inflation(), 1e3);
  filter.predict(0);
  EXPECT_LT(filter.inflation(), 1e3);
}

// ---- measurements ----

TEST(ExtendedStateFilter, variance_per_sample) {
  auto config = typical<2, double, 1>();
  for (const auto mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    config.mode = RiccatiMode::recursive;
    auto filter = ExtendedStateFilter<2>::make(config).value();
    for (int k = 0; k < 400; ++k) filter.update(0, 0);
    auto other = filter;
    if (mode == RiccatiMode::frozen) {
      config.mode = mode;
      other = ExtendedStateFilter<2>::make(config).value();
      other.reset(Eigen::Vector3d(filter.estimate()));
    }
    DenseFilter<2, double> dense = oracle<2, 1>(config);
    filter.predict(0);
    dense.p = filter.covariance();
    filter = other;
    for (const double r : {1e-3, 1e-9, 1e-6, 0.0}) {
      dense.r = r;
      const double s = dense.p(0, 0) + r / 1.5;
      const Eigen::Vector3d gain = dense.p.col(0) / s;
      EXPECT_EQ(filter.update_weighted(filter.estimate()(0), 0, r), StepStatus::ok);
      EXPECT_LE(relative_distance(filter.gain(), gain), 1e-8) << r;
      EXPECT_NEAR(filter.innovation_variance(), dense.p(0, 0) + r,
                  1e-8 * filter.innovation_variance());
      dense.step_covariance(-(dense.a * gain));
    }
    // The next one has R again.
    filter.update(0, 0);
    dense.r = config.measurement_variance;
    EXPECT_LE(relative_distance(filter.gain(), dense.current_gain()), 1e-8);

    const auto before = filter.estimate();
    EXPECT_EQ(filter.update_weighted(1, 1, -1e-3), StepStatus::measurement_rejected);
    EXPECT_EQ(filter.update_weighted(1, 0, hidden_nan<double>()), StepStatus::measurement_rejected);
    EXPECT_EQ(filter.missed(), 2);
    EXPECT_NE(filter.estimate(), before);
  }
}

TEST(ExtendedStateFilter, outliers_are_missing_samples) {
  auto config = typical<2, double, 1>();
  config.outlier_threshold = 15.1;
  for (const auto mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    config.mode = mode;
    auto gated = ExtendedStateFilter<2>::make(config).value();
    auto open = config;
    open.outlier_threshold = 0;
    auto plain = ExtendedStateFilter<2>::make(open).value();
    for (int k = 0; k < 50; ++k) {
      EXPECT_EQ(gated.update(0.5e-3, 0), plain.update(0.5e-3, 0));
    }
    EXPECT_EQ(gated.update(10, 0), StepStatus::outlier_rejected);
    plain.predict(0);
    EXPECT_EQ(gated.estimate(), plain.estimate());
    EXPECT_EQ(gated.covariance(), plain.covariance());
    EXPECT_EQ(gated.missed(), 1);
    // Just inside and just outside.
    plain.predict(0);
    auto outside = gated;
    const double width = std::sqrt(15.1 * plain.innovation_variance());
    const double centre = plain.estimate()(0);
    EXPECT_EQ(gated.update(centre + 0.999 * width, 0), StepStatus::gap_bridged);
    EXPECT_EQ(outside.update(centre + 1.001 * width, 0), StepStatus::outlier_rejected);
    EXPECT_TRUE(outside.accepts(hidden_nan<double>()));  // not the gate's business
    EXPECT_EQ(outside.update(hidden_nan<double>(), 0), StepStatus::measurement_rejected);
    EXPECT_NEAR(gated.normalised_innovation(), 15.1 * 0.999 * 0.999, 1e-6);
    // A jump that stays is believed in once the gate has widened.
    int refused = 0;
    while (has(outside.update(1, 0), StepStatus::outlier_rejected)) ++refused;
    EXPECT_GT(refused, 0);
    EXPECT_LT(refused, 40);
  }
}

TEST(ExtendedStateFilter, a_gate_that_refuses_everything_restarts_after_the_longest_gap) {
  auto config = typical<2, double, 1>();
  config.outlier_threshold = 1e-9;
  config.max_gap = 5;
  auto filter = ExtendedStateFilter<2>::make(config).value();
  for (int k = 0; k < 6; ++k) EXPECT_EQ(filter.update(1e3, 0), StepStatus::outlier_rejected);
  EXPECT_EQ(filter.update(1e3, 0), StepStatus::restarted);
  EXPECT_EQ(filter.estimate()(0), 1e3);
}

/// With Gaussian noise of the stated levels NIS is chi-squared with one degree of freedom: mean 1,
/// variance 2, and 1 % above 6.63.
TEST(ExtendedStateFilter, normalised_innovation_is_chi_squared) {
  auto config = typical<2, double, 1>(InflationRule::none);
  config.disturbance_bounds = {0, 0, 300};
  config.bound_factor = 1;
  auto filter = ExtendedStateFilter<2>::make(config).value();
  esokit::sim::Gaussian gaussian(5);
  DenseFilter<2, double> plant = oracle<2, 1>(config);
  double sum = 0;
  int above = 0;
  constexpr int samples = 20000;
  for (int k = 0; k < samples + 100; ++k) {
    const double u = std::sin(0.01 * k);
    plant.z = (plant.a * plant.z + plant.b * u).eval();
    plant.z(2) += 300 * gaussian.next();
    filter.update(plant.z(0) + 1e-3 * gaussian.next(), u);
    if (k < 100) continue;
    sum += filter.normalised_innovation();
    above += filter.normalised_innovation() > 6.63 ? 1 : 0;
  }
  EXPECT_NEAR(sum / samples, 1, 4 * std::sqrt(2.0 / samples));
  EXPECT_NEAR(above, 0.01 * samples, 4 * std::sqrt(0.01 * samples));
}

/// P covers the covariance of the error in an open loop: disturbance changes within the bound, as
/// correlated with the error as can be.
TEST(ExtendedStateFilter, covariance_bounds_the_error) {
  auto config = typical<2, double, 1>();
  config.disturbance_bounds = {0, 0, 300};
  config.bound_factor = 1;
  constexpr int runs = 400;
  constexpr int length = 120;
  std::vector<Eigen::Matrix3d> error(length, Eigen::Matrix3d::Zero());
  std::vector<Eigen::Matrix3d> bound(length);
  esokit::sim::Gaussian gaussian(11);
  for (int run = 0; run < runs; ++run) {
    auto filter = ExtendedStateFilter<2>::make(config).value();
    DenseFilter<2, double> plant = oracle<2, 1>(config);
    for (int i = 0; i < 3; ++i) {
      plant.z(i) = std::sqrt(config.initial_covariance(i, i)) * gaussian.next();
    }
    for (int k = 0; k < length; ++k) {
      const double lag = plant.z(2) - filter.estimate()(2);
      plant.z = (plant.a * plant.z).eval();
      plant.z(2) += lag > 0 ? 300 : -300;  // always away from the estimate
      filter.update(plant.z(0) + 1e-3 * gaussian.next(), 0);
      const Eigen::Vector3d e = plant.z - filter.estimate();
      error[static_cast<std::size_t>(k)] += e * e.transpose() / runs;
      bound[static_cast<std::size_t>(k)] = filter.covariance();
    }
  }
  for (std::size_t k = 0; k < length; ++k) {
    // As matrices; the sample covariance scatters by sqrt(2 / runs).
    const Eigen::Matrix3d room = (1 + 4 * std::sqrt(2.0 / runs)) * bound[k] - error[k];
    EXPECT_TRUE(positive_definite(room)) << k;
  }
  // And is not idle: of the right order.
  EXPECT_GE(error[60](2, 2), 0.1 * bound[60](2, 2));
}

// ---- the nominal model ----

/// f of the paper's plant, and a swing in time.
struct Known {
  double plant = 0;
  double swing = 0;
  double operator()(const Eigen::Vector2d& x, double, double t) const {
    return plant * (20 * x(0) + 78 * x(1) + 10) + swing * std::sin(20 * t);
  }
};
using Modelled = ExtendedStateFilter<2, double, 1, Known>;

TEST(ExtendedStateFilter, nominal_model_moves_the_disturbance_within_its_bound) {
  auto config = typical<2, double, 1, Modelled>();
  config.disturbance_bounds = {0, 0, 100};
  config.model = {.plant = 0, .swing = 1e4};
  auto filter = Modelled::make(config).value();
  filter.reset(Eigen::Vector3d(0, 0, 0));
  double d = 0;
  for (int k = 0; k < 200; ++k) {
    const double change = 1e4 * (std::sin(20 * (k + 1) * period) - std::sin(20 * k * period));
    d += std::clamp(change, -100.0, 100.0);
    filter.predict(0);
    EXPECT_NEAR(filter.total_disturbance(), d, 1e-9 * 1e4) << k;
  }
  // Q covers twice the bound: (2 q2)^2.
  auto without = typical<2, double, 1>();
  without.disturbance_bounds = {0, 0, 200};
  auto plain = ExtendedStateFilter<2>::make(without).value();
  auto fresh = Modelled::make(config).value();
  for (int k = 0; k < 5; ++k) {
    plain.predict(0);
    fresh.predict(0);
    EXPECT_LE(relative_distance(fresh.gain(), plain.gain()), 1e-14);
  }
}

/// Ahead by the plant's own equation, with the input that (6) leaves out.
TEST(ExtendedStateFilter, nominal_model_is_taken_along_the_chain) {
  auto config = typical<2, double, 1, Modelled>();
  config.disturbance_bounds = {0, 0, 1e9};
  config.model = {.plant = 1, .swing = 0};
  auto filter = Modelled::make(config).value();
  const Eigen::Vector3d state(0.3, -2, 50);
  filter.reset(state);
  const double u = 0.7;
  filter.predict(u);
  const Known model = config.model;
  const double now = model(state.head<2>(), u, 0);
  const Eigen::Vector2d ahead(state(0) + period * state(1) + period * period / 2 * (now + b0 * u),
                              state(1) + period * (now + b0 * u));
  EXPECT_NEAR(filter.total_disturbance(), 50 + model(ahead, u, 0) - now, 1e-9);
  // The states themselves go with the estimated disturbance.
  EXPECT_NEAR(filter.estimate()(1), state(1) + period * (50 + b0 * u), 1e-12);
}

// ---- retuning, gaps without end ----

TEST(ExtendedStateFilter, retune_keeps_estimate_and_covariance) {
  auto config = typical<2, double, 1>();
  auto filter = ExtendedStateFilter<2>::make(config).value();
  Random random(3);
  for (int k = 0; k < 6; ++k) filter.update(random.uniform(-1, 1), random.uniform(-1, 1));
  for (const bool predicted : {false, true}) {
    if (predicted) filter.predict(0.3);
    const auto before = filter;
    auto other = config;
    other.measurement_variance = 1e-4;
    other.sample_time = 2e-3;
    other.initial_covariance *= 100;
    ASSERT_TRUE(filter.retune(other).has_value());
    EXPECT_LE(eigen(filter.estimate() - before.estimate()).cwiseAbs().maxCoeff(),
              1e-12 * eigen(before.estimate()).cwiseAbs().maxCoeff());
    if (predicted) {
      EXPECT_LE(covariance_distance(filter.covariance(), before.covariance()), 1e-12);
      const Eigen::Matrix3d p = before.covariance();
      EXPECT_LE(relative_distance(filter.gain(), p.col(0) / (p(0, 0) + 1e-4 / 1.5)), 1e-12);
    }
    ASSERT_TRUE(filter.retune(config).has_value());
    auto going_on = before;
    filter.predict(0);
    going_on.predict(0);
    EXPECT_LE(covariance_distance(filter.covariance(), going_on.covariance()), 1e-12);
    filter = before;
  }
  // To a frozen gain: on by the recursion until the limit is reached.
  config.mode = RiccatiMode::frozen;
  ASSERT_TRUE(filter.retune(config).has_value());
  EXPECT_FALSE(filter.frozen());
  for (int k = 0; k < 60; ++k) filter.update(0, 0);
  EXPECT_TRUE(filter.frozen());
  const auto rested = filter;
  config.inflation = -1;
  EXPECT_EQ(
      refusal(filter.retune(config)),
      "inflation: must be finite and positive; the plain Kalman filter is InflationRule::none");
  EXPECT_EQ(filter.gain(), rested.gain());
}

TEST(ExtendedStateFilter, a_gap_without_end_overflows_nothing) {
  auto config = typical<2, float, 1>();
  config.max_gap = 65000;
  auto filter = ExtendedStateFilter<2, float>::make(config).value();
  filter.update(0.5f, 0);
  for (int k = 0; k < 5000; ++k) {
    filter.predict(0);
    ASSERT_TRUE(std::isfinite(filter.innovation_variance())) << k;
  }
  EXPECT_EQ(filter.correct(1), StepStatus::gap_bridged);
  for (int k = 0; k < 100; ++k) filter.update(1, 0);
  auto fresh = ExtendedStateFilter<2, float>::make(config).value();
  for (int k = 0; k < 500; ++k) fresh.update(1, 0);
  EXPECT_LE(relative_distance(filter.gain(), fresh.gain()), 1e-4);
}

// ---- float, a million steps ----

void a_million_updates_in_float(float r, float p0) {
  auto config = typical<2, float, 1>();
  config.measurement_variance = r;
  config.disturbance_bounds = {0, 0, 300};
  config.initial_covariance = Eigen::Vector3f(p0, p0, p0).asDiagonal();
  auto filter = ExtendedStateFilter<2, float>::make(config).value();
  auto wide_config = typical<2, double, 1>();
  wide_config.measurement_variance = static_cast<double>(r);
  wide_config.disturbance_bounds = {0, 0, 300};
  wide_config.initial_covariance = Eigen::Vector3d::Constant(static_cast<double>(p0)).asDiagonal();
  auto wide = ExtendedStateFilter<2>::make(wide_config).value();
  Random random(9);
  for (int k = 0; k < 1000000; ++k) {
    const auto y = static_cast<float>(random.uniform(-1, 1));
    if (k % 1000 == 999) {
      filter.predict(0);
      wide.predict(0);
    } else {
      ASSERT_FALSE(has(filter.update(y, y), StepStatus::measurement_rejected));
      wide.update(static_cast<double>(y), static_cast<double>(y));
    }
    if (k > 100 && k % 997 != 0) continue;
    const Eigen::Matrix3f p = filter.covariance();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < i; ++j) ASSERT_EQ(p(i, j), p(j, i)) << k;
      // What the recursion keeps is L D L', L unit lower triangular.
      ASSERT_GT(filter.gain_law().covariance_factor().variance(i), 0) << k;
    }
    // And so is P multiplied out, as float rounds it.
    const Eigen::Matrix3d exact = p.cast<double>();
    ASSERT_TRUE(positive_definite(exact)) << k;
    const Eigen::Matrix3d q = wide.covariance();
    ASSERT_LE(covariance_distance(exact, q), 1e-4) << k;
    ASSERT_TRUE(eigen(filter.estimate()).allFinite());
    // A filter may go on from where another stopped.
    config.initial_covariance = p;
    const auto next = ExtendedStateFilter<2, float>::make(config);
    ASSERT_TRUE(next.has_value()) << k;
    ASSERT_LE(covariance_distance(next->covariance(), p), 100 * 1.2e-7);
  }
}

TEST(ExtendedStateFilter, a_million_steps_in_float_with_tiny_noise) {
  a_million_updates_in_float(1e-12f, 1);
}

TEST(ExtendedStateFilter, a_million_steps_in_float_with_huge_initial_covariance) {
  a_million_updates_in_float(1e-6f, 1e8f);
}

// ---- refused configs ----

template <class Change>
std::string refused(Change&& change, InflationRule rule = InflationRule::fixed) {
  auto config = typical<2, double, 1>(rule);
  change(config);
  return refusal(ExtendedStateFilter<2>::make(config));
}

TEST(ExtendedStateFilter, refuses_bad_configs_by_name) {
  const double nan = hidden_nan<double>();
  using Config = ExtendedStateFilter<2>::Config;
  for (const double bad : {-1e-6, nan, hidden_infinity<double>()}) {
    EXPECT_EQ(refused([&](Config& c) { c.measurement_variance = bad; }),
              "measurement_variance: must be finite and not negative");
    EXPECT_EQ(refused([&](Config& c) { c.disturbance_bounds[1] = bad; }),
              "disturbance_bounds[1]: must be finite and not negative");
    EXPECT_EQ(refused([&](Config& c) { c.outlier_threshold = bad; }),
              "outlier_threshold: must be finite and not negative");
    EXPECT_EQ(
        refused([&](Config& c) { c.inflation = bad; }),
        "inflation: must be finite and positive; the plain Kalman filter is InflationRule::none");
    EXPECT_EQ(refused([&](Config& c) { c.bound_factor = bad; }),
              "bound_factor: must be finite and positive");
    const std::string rule = bad < 0 ? "must be positive semidefinite" : "must be finite";
    EXPECT_EQ(refused([&](Config& c) { c.initial_covariance(1, 1) = bad; }),
              "initial_covariance[4]: " + rule);
    EXPECT_EQ(refused([&](Config& c) {
                c.disturbance_bounds = {};
                c.process_covariance = c.initial_covariance;
                (*c.process_covariance)(2, 2) = bad;
              }),
              "process_covariance[8]: " + rule);
  }
  EXPECT_EQ(
      refused([](Config& c) { c.inflation = 0; }),
      "inflation: must be finite and positive; the plain Kalman filter is InflationRule::none");
  EXPECT_EQ(refused([](Config& c) { c.inflation = 0.1; }, InflationRule::none),
            "inflation: must be left out unless inflation_rule is fixed");
  EXPECT_EQ(refused([](Config& c) { c.inflation = 0.1; }, InflationRule::adaptive),
            "inflation: must be left out unless inflation_rule is fixed");
  EXPECT_EQ(refused([](Config& c) { c.trace_weights[2] = 0; }, InflationRule::adaptive),
            "trace_weights[2]: must be finite and positive");
  EXPECT_EQ(
      refused([](Config& c) { c.disturbance_bounds = {}; }, InflationRule::adaptive),
      "disturbance_bounds: (or process_covariance) must not be zero if the inflation is adaptive");
  const auto indefinite = [](auto& p) {
    p = Eigen::Vector3d(1, 1e4, 1e6).asDiagonal();
    p(0, 1) = p(1, 0) = 101;
  };
  EXPECT_EQ(refused([&](Config& c) { indefinite(c.initial_covariance); }),
            "initial_covariance[8]: must be positive semidefinite");
  EXPECT_EQ(refused([&](Config& c) {
              c.disturbance_bounds = {};
              c.process_covariance = Eigen::Matrix3d::Zero();
              indefinite(*c.process_covariance);
            }),
            "process_covariance[8]: must be positive semidefinite");
  EXPECT_EQ(refused([](Config& c) { c.initial_covariance(1, 0) = 1e-9; }),
            "initial_covariance[3]: must be symmetric");
  EXPECT_EQ(refused([](Config& c) { c.process_covariance = Eigen::Matrix3d::Identity(); }),
            "disturbance_bounds[0]: must be left out if process_covariance is given");
  // P0 = Q = R = 0, and Q = R = 0 as well: nothing is left to find a gain from.
  EXPECT_EQ(refused([](Config& c) {
              c.measurement_variance = 0;
              c.disturbance_bounds = {};
              eigen(c.initial_covariance).setZero();
            }),
            "measurement_variance: must be positive if nothing disturbs the plant");
  EXPECT_EQ(refused([](Config& c) {
              c.measurement_variance = 0;
              c.disturbance_bounds = {};
            }),
            "measurement_variance: must be positive if nothing disturbs the plant");
  EXPECT_EQ(refused(
                [](Config& c) {
                  c.disturbance_bounds[2] = 0;
                  c.allow_vanishing_gain = true;
                  c.mode = RiccatiMode::frozen;
                },
                InflationRule::none),
            "disturbance_bounds[2]: must disturb the highest state if the gain is frozen without "
            "inflation: its limit is zero");
  for (const double bad : {1e-170, 1e200}) {
    EXPECT_EQ(refused([&](Config& c) { c.disturbance_bounds[1] = bad; }),
              "disturbance_bounds[1]: has a square that the scalar cannot hold");
  }
  EXPECT_EQ(refused([](Config& c) { c.process_covariance = Eigen::Matrix3d::Constant(-1); }),
            "process_covariance[0]: must be positive semidefinite");
  EXPECT_EQ(refused([](Config& c) { c.input_gain = 0; }),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refused([](Config& c) { c.sample_time = 0; }),
            "sample_time: must be finite and positive");
  EXPECT_EQ(refused([](Config& c) { c.max_gap = 0; }), "max_gap: must be 1 .. 65000");

  // What float cannot hold: T^2 / 2 q squared, over R.
  auto config = typical<2, float, 1>();
  config.sample_time = 1e-9f;
  config.disturbance_bounds = {0, 0, 1e-3f};
  const auto made = ExtendedStateFilter<2, float>::make(config);
  ASSERT_FALSE(made.has_value());

  // Nor a limit of (1 + theta)^(N-1) R.
  config = typical<2, float, 1>();
  config.inflation = 1e20f;
  const auto grown = ExtendedStateFilter<2, float>::make(config);
  ASSERT_EQ(refusal(grown), "inflation: lets the covariance grow beyond what the scalar can hold");
}

/// Samples until an innovation of one is 1e-6 for good.
template <class Filter>
int samples_to_fade(Filter filter) {
  for (int k = 0; k < 3000; ++k) filter.update(0, 0);
  filter.update(1, 0);
  int last = 0;
  for (int k = 1; k < 50000; ++k) {
    filter.update(0, 0);
    if (std::abs(static_cast<double>(filter.innovation())) > 1e-6) last = k;
  }
  return last;
}

/// A limit with a pole at -1: refused, from both sides of the stated millionth and of the stated
/// inflation; the same times with which the accepted ones fade are in the documentation.
template <int Order, int Extension, class S = double>
void alternating_error_fades(int stated) {
  SCOPED_TRACE(Order + 10 * Extension);
  using Filter = ExtendedStateFilter<Order, S, Extension>;
  constexpr int size = Order + Extension;
  typename Filter::Config config{
      .input_gain = 1, .sample_time = S(0.01), .inflation_rule = InflationRule::none};
  config.disturbance_bounds[size - 1] = S(300);
  if (size % 2 == 0) {
    EXPECT_LT(samples_to_fade(Filter::make(config).value()), stated);
    return;
  }
  double unit = 300;
  for (int r = 1; r < size; ++r) unit *= 0.01 / r;
  const double least = 1e-6 * size * unit * unit;
  for (const auto mode : {esokit::RiccatiMode::recursive, esokit::RiccatiMode::frozen}) {
    config.mode = mode;
    config.measurement_variance = static_cast<S>(0.999 * least);
    const auto refused = Filter::make(config);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refusal(refused),
              "measurement_variance: does not damp an error that alternates in sign: give y' a "
              "bound, or y a variance of at least");
    EXPECT_NEAR(static_cast<double>(refused.error().limit) / least, 1, 1e-5);
    config.measurement_variance = static_cast<S>(1.001 * least);
    const int samples = samples_to_fade(Filter::make(config).value());
    EXPECT_LT(samples, stated);
    EXPECT_GT(samples, 0.9 * stated);
  }
  // Without R: by an inflation, or a bound of y'.
  config.measurement_variance = 0;
  config.inflation_rule = InflationRule::fixed;
  eigen(config.initial_covariance).diagonal().setOnes();
  config.inflation = S(0.0099);
  EXPECT_FALSE(Filter::make(config));
  config.inflation = S(0.0101);
  EXPECT_LT(samples_to_fade(Filter::make(config).value()), 1.5 * stated);
  config.inflation_rule = InflationRule::none;
  config.inflation = 0;
  const double share = 16 * least / (1e4 * (1 - 16e-6));  // (T / 4)^2 of q_1^2 is seen
  config.disturbance_bounds[1] = static_cast<S>(std::sqrt(1.01 * share / size) * 1e4);
  EXPECT_LT(samples_to_fade(Filter::make(config).value()), 1.5 * stated);
  config.disturbance_bounds[1] = static_cast<S>(std::sqrt(0.99 * share / size) * 1e4);
  EXPECT_FALSE(Filter::make(config));
}

TEST(ExtendedStateFilter, alternating_error_fades_or_is_refused) {
  alternating_error_fades<1, 1>(100);
  alternating_error_fades<2, 1>(2000);
  alternating_error_fades<2, 1, float>(2000);
  alternating_error_fades<1, 2>(2000);
  alternating_error_fades<3, 1>(100);
  alternating_error_fades<4, 1>(4400);
}

/// R = 0, P0 = 0 and nothing but the highest state disturbed: P- = Q is a fixed point of the
/// recursion, at which the estimate diverges. It must not depend on rounding whether the filter
/// leaves it: T and q are such that nothing is rounded.
TEST(ExtendedStateFilter, leaves_the_fixed_point_of_an_exact_start) {
  using Filter = ExtendedStateFilter<3>;
  Filter::Config config{.input_gain = 1, .sample_time = 1, .inflation_rule = InflationRule::none};
  config.disturbance_bounds[3] = 6;
  config.bound_factor = 1;
  auto filter = Filter::make(config).value();
  for (int k = 0; k < 100; ++k) (void)filter.update(0, 0);
  // The zeros of z^2 + 4 z + 1 and its inverse: a double pole at sqrt(3) - 2, two at zero.
  const double pole = std::sqrt(3.0) - 2;
  const auto gain = filter.level_gain(0);
  EXPECT_NEAR(gain[0], 1, 1e-12);
  EXPECT_NEAR(gain[1], 2, 1e-9);
  EXPECT_NEAR(gain[2], 3 - (2 + pole), 1e-9);
  EXPECT_NEAR(gain[3], -pole, 1e-9);
  EXPECT_LT(samples_to_fade(filter), 100);
}

/// A highest state that nothing disturbs: its gain tends to zero without inflation, and is zero
/// from the first sample on where it is known for certain.
TEST(ExtendedStateFilter, vanishing_gain_has_to_be_asked_for) {
  using Filter = ExtendedStateFilter<2>;
  const auto rule = [](const Filter::Config& config) { return refusal(Filter::make(config)); };
  auto config = typical<2, double, 1>(InflationRule::none);
  EXPECT_EQ(rule(config), "accepted");
  config.disturbance_bounds[2] = 0;
  EXPECT_EQ(
      rule(config),
      "disturbance_bounds[2]: must disturb the highest state: without inflation its gain tends "
      "to zero (or set allow_vanishing_gain)");
  auto covariance = config;
  covariance.disturbance_bounds = {};
  covariance.process_covariance = Eigen::Vector3d(1, 1, 0).asDiagonal();
  EXPECT_EQ(rule(covariance).substr(0, 18), "process_covariance");
  config.allow_vanishing_gain = true;
  EXPECT_EQ(rule(config), "accepted");
  auto filter = Filter::make(config).value();
  for (int k = 0; k < 100000; ++k) filter.update(0, 0);
  EXPECT_LT(filter.gain()(2), 0.1);

  config = typical<2, double, 1>();
  config.disturbance_bounds = {};
  EXPECT_EQ(rule(config), "accepted");
  config.initial_covariance(2, 2) = 0;
  EXPECT_EQ(rule(config),
            "initial_covariance[8]: must leave the highest state uncertain if nothing disturbs it "
            "(or set allow_vanishing_gain)");
  // The limit is there from the start.
  config.mode = esokit::RiccatiMode::frozen;
  EXPECT_EQ(rule(config), "accepted");
  config.mode = esokit::RiccatiMode::recursive;
  config.allow_vanishing_gain = true;
  EXPECT_EQ(rule(config), "accepted");
}

/// Variances and innovations near the ends of the scalar: what is told of them is a number.
template <class S>
void what_is_told_is_finite() {
  using Filter = ExtendedStateFilter<2, S>;
  const S largest = std::numeric_limits<S>::max();
  int told = 0;
  for (const S variance : {S(0), S(1), largest / 100, largest / 2, largest}) {
    typename Filter::Config config{.input_gain = 1,
                                   .sample_time = S(1e-3),
                                   .measurement_variance = variance,
                                   .inflation = S(0.5)};
    config.disturbance_bounds = {0, 0, 300};
    eigen(config.initial_covariance).diagonal().setOnes();
    const auto made = Filter::make(config);
    if (!made) continue;
    auto filter = *made;
    for (const S y : {S(0), S(1), std::sqrt(largest), largest / 8, S(0)}) {
      filter.update(y, 0);
      EXPECT_TRUE(std::isfinite(filter.normalised_innovation())) << variance << ' ' << y;
      EXPECT_TRUE(std::isfinite(filter.innovation_variance())) << variance << ' ' << y;
      EXPECT_TRUE(eigen(filter.covariance()).allFinite()) << variance << ' ' << y;
      if (filter.normalised_innovation() >= largest) ++told;
    }
  }
  EXPECT_GT(told, 0);
}
TEST(ExtendedStateFilter, what_is_told_is_finite) {
  what_is_told_is_finite<float>();
  what_is_told_is_finite<double>();
}

TEST(ExtendedStateFilter, exact_measurements_are_allowed) {
  auto config = typical<2, double, 1>();
  config.measurement_variance = 0;
  auto filter = ExtendedStateFilter<2>::make(config).value();
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(filter.update(std::sin(0.1 * k), 0), StepStatus::ok);
    EXPECT_NEAR(filter.estimate()(0), std::sin(0.1 * k), 1e-12);
  }
  // A start that is known exactly, too, and is not what is measured: the measurement is believed.
  config.initial_covariance = ExtendedStateFilter<2>::Covariance::Zero();
  config.disturbance_bounds = {0, 0, 300};
  filter = ExtendedStateFilter<2>::make(config).value();
  EXPECT_EQ(filter.correct(1), StepStatus::ok);
  EXPECT_NEAR(filter.estimate()(0), 1, 1e-12);
  EXPECT_EQ(filter.update(2, 0), StepStatus::ok);
  EXPECT_NEAR(filter.estimate()(0), 2, 1e-12);
}

TEST(ExtendedStateFilter, model_costs_nothing_when_absent) {
  static_assert(std::is_empty_v<esokit::NoNominalModel>);
  using Filter = ExtendedStateFilter<2>;
  static_assert(esokit::PresetGainLaw<esokit::RiccatiGain<3, double>, 3, double>);
  static_assert(sizeof(Filter) <= 70 * sizeof(double));
}

/// The largest and the least variance that a filter starts from, from both sides.
TEST(ExtendedStateFilter, start_variance_from_both_sides) {
  using Filter = ExtendedStateFilter<2, float>;
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

}  // namespace esokit_test::observer_extended_state_filter_test
