// MimoExtendedStateFilter: one chain is ExtendedStateFilter, uncoupled chains are filters side by
// side, and the coupled ones follow the dense equations.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/mimo_extended_state_filter.hpp>
#include <support/dense_filter.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test::observer_mimo_extended_state_filter_test {

using esokit::ChainOrders;
using esokit::ExtendedStateFilter;
using esokit::InflationRule;
using esokit::MimoExtendedStateFilter;
using esokit::RiccatiMode;
using esokit::StepStatus;

constexpr double period = 1e-3;

/// Largest difference of correlations.
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

using Single = ExtendedStateFilter<2>;
Single::Config single(double scale = 1) {
  return {.input_gain = 230 * scale,
          .sample_time = period,
          .measurement_variance = 1e-6 * scale,
          .disturbance_bounds = {1e-6, 1e-3, 300},
          .initial_covariance = Eigen::Vector3d(1, 1e4, 1e6).asDiagonal(),
          .inflation = 0.5};
}

TEST(MimoExtendedStateFilter, one_chain_is_the_extended_state_filter) {
  using Filter = MimoExtendedStateFilter<ChainOrders<2>, 1>;
  for (const auto mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    auto one = single();
    one.mode = mode;
    Filter::Config config;
    config.input_matrix(0, 0) = one.input_gain;
    config.sample_time = period;
    config.measurement_covariance(0, 0) = one.measurement_variance;
    config.disturbance_bounds = one.disturbance_bounds;
    config.bound_factor = one.bound_factor;
    config.initial_covariance = one.initial_covariance;
    config.inflation = one.inflation;
    config.mode = mode;
    auto expected = Single::make(one).value();
    auto filter = Filter::make(config).value();
    Random random(3);
    // After a gap the two go back to the same limit by their own tests of a thousandth.
    const double unit = mode == RiccatiMode::frozen ? 2e-3 : 1e-9;
    for (int k = 0; k < 200; ++k) {
      const double y = random.uniform(-1, 1);
      const double u = random.uniform(-1, 1);
      if (k % 17 > 14) {
        filter.predict(Eigen::Matrix<double, 1, 1>(u));
        expected.predict(u);
      } else {
        EXPECT_EQ(filter.update(Eigen::Matrix<double, 1, 1>(y), Eigen::Matrix<double, 1, 1>(u)),
                  StepStatus::ok);
        expected.update(y, u);
        EXPECT_NEAR(filter.normalised_innovation(), expected.normalised_innovation(),
                    100 * unit * expected.normalised_innovation());
      }
      for (int r = 0; r < 3; ++r) {
        ASSERT_NEAR(filter.gain()(r, 0), expected.gain()(r), unit * expected.gain()(r)) << k;
        ASSERT_NEAR(filter.estimate()(r), expected.estimate()(r),
                    unit * (std::abs(expected.estimate()(r)) + expected.gain()(r)));
      }
      ASSERT_LE(covariance_distance(filter.covariance(), expected.covariance()), unit) << k;
    }
  }
}

using Coupled = MimoExtendedStateFilter<ChainOrders<1, 2>, 2>;

Coupled::Config coupled() {
  Coupled::Config config;
  config.input_matrix = {{2, 0.5}, {-30, 100}};
  config.sample_time = 0.01;
  config.measurement_covariance = {{1e-4, 0.8e-4}, {0.8e-4, 2e-4}};
  Coupled::Covariance q = Coupled::Covariance::Zero();
  q(1, 1) = 0.04;
  q(4, 4) = 9;
  q(1, 4) = q(4, 1) = 0.3;
  config.process_covariance = q;
  eigen(config.initial_covariance).diagonal() << 1, 4, 1, 100, 1e4;
  config.initial_covariance(0, 2) = config.initial_covariance(2, 0) = 0.5;
  config.inflation = 0.2;
  return config;
}

struct CoupledModel {
  Eigen::Matrix<double, 5, 5> a = Eigen::Matrix<double, 5, 5>::Zero();
  Eigen::Matrix<double, 5, 2> b = Eigen::Matrix<double, 5, 2>::Zero();
  Eigen::Matrix<double, 2, 5> c = Eigen::Matrix<double, 2, 5>::Zero();

  CoupledModel() {
    const double t = 0.01;
    a << 1, t, 0, 0, 0,         //
        0, 1, 0, 0, 0,          //
        0, 0, 1, t, t * t / 2,  //
        0, 0, 0, 1, t,          //
        0, 0, 0, 0, 1;
    const Eigen::Matrix2d b0 = coupled().input_matrix;
    b.row(0) = t * b0.row(0);
    b.row(2) = t * t / 2 * b0.row(1);
    b.row(3) = t * b0.row(1);
    c(0, 0) = 1;
    c(1, 2) = 1;
  }
};

/// Two chains of different orders, nothing shared but the inputs.
TEST(MimoExtendedStateFilter, uncoupled_chains_are_filters_side_by_side) {
  static_assert(Coupled::size == 5);
  Coupled::Config config;
  config.input_matrix = {{-3, 0}, {0, 230}};
  config.sample_time = period;
  config.measurement_covariance = Eigen::Vector2d(1e-4, 1e-6).asDiagonal();
  config.disturbance_bounds = {0, 2, 1e-6, 1e-3, 300};
  eigen(config.initial_covariance).diagonal() << 0.1, 10, 1, 1e4, 1e6;
  config.inflation = 0.5;
  auto filter = Coupled::make(config).value();
  auto first =
      ExtendedStateFilter<1>::make({.input_gain = -3,
                                    .sample_time = period,
                                    .measurement_variance = 1e-4,
                                    .disturbance_bounds = {0, 2},
                                    .bound_factor = config.bound_factor,
                                    .initial_covariance = Eigen::Vector2d(0.1, 10).asDiagonal(),
                                    .inflation = 0.5})
          .value();
  auto settings = single();
  settings.bound_factor = config.bound_factor;
  auto second = Single::make(settings).value();
  Random random(5);
  for (int k = 0; k < 100; ++k) {
    const Eigen::Vector2d y(random.uniform(-1, 1), random.uniform(-1, 1));
    const Eigen::Vector2d u(random.uniform(-1, 1), random.uniform(-1, 1));
    Eigen::Vector2d fed = y;
    first.predict(u(0));
    second.predict(u(1));
    // A bad channel does not harm the other.
    if (k % 9 == 4) {
      fed(1) = hidden_nan<double>();
    } else {
      second.correct(y(1));
    }
    if (k % 11 == 4) {
      fed(0) = hidden_infinity<double>();
    } else {
      first.correct(y(0));
    }
    const bool all_good = fed == y;
    EXPECT_EQ(filter.update(fed, u), all_good ? StepStatus::ok : StepStatus::measurement_rejected);
    const Eigen::Vector2d z = filter.chain_estimate<0>();
    const Eigen::Vector3d x = filter.chain_estimate<1>();
    for (int r = 0; r < 3; ++r) {
      ASSERT_NEAR(x(r), second.estimate()(r),
                  1e-9 * (std::abs(second.estimate()(r)) + second.gain()(r)))
          << k;
    }
    for (int r = 0; r < 2; ++r) {
      ASSERT_NEAR(z(r), first.estimate()(r),
                  1e-9 * (std::abs(first.estimate()(r)) + first.gain()(r)))
          << k;
    }
    ASSERT_EQ(filter.total_disturbance()(0), z(1));
    const Eigen::Matrix<double, 5, 5> p = filter.covariance();
    ASSERT_LE(covariance_distance(p.bottomRightCorner<3, 3>(), second.covariance()), 1e-8) << k;
    ASSERT_LE(covariance_distance(p.topLeftCorner<2, 2>(), first.covariance()), 1e-8) << k;
  }
}

Eigen::Matrix2d inverse(const Eigen::Matrix2d& m) {
  Eigen::Matrix2d result;
  result << m(1, 1), -m(0, 1), -m(1, 0), m(0, 0);
  return result / (m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0));
}

/// (11), (24) with full R, Q and P0, on dense matrices in physical units.
TEST(MimoExtendedStateFilter, coupled_chains_follow_the_dense_equations) {
  const CoupledModel model;
  for (const bool plain : {false, true}) {
    auto config = coupled();
    if (plain) {
      config.inflation_rule = InflationRule::none;
      config.inflation = 0;
    }
    const double theta = config.inflation;
    auto filter = Coupled::make(config).value();
    Eigen::Matrix<double, 5, 5> p = config.initial_covariance;
    Eigen::Matrix<double, 5, 1> z = Eigen::Matrix<double, 5, 1>::Zero();
    const Eigen::Matrix2d r = config.measurement_covariance;
    const Eigen::Matrix<double, 5, 5> q = *config.process_covariance;
    Random random(9);
    for (int k = 0; k < 100; ++k) {
      const Eigen::Vector2d y(random.uniform(-1, 1), random.uniform(-1, 1));
      const Eigen::Vector2d u(random.uniform(-1, 1), random.uniform(-1, 1));
      const Eigen::Matrix2d s = model.c * p * model.c.transpose() + r / (1 + theta);
      const Eigen::Matrix<double, 5, 2> l = p * model.c.transpose() * inverse(s);
      ASSERT_LE(eigen(filter.gain() - l).cwiseAbs().maxCoeff(), 1e-9 * l.cwiseAbs().maxCoeff())
          << k;
      const Eigen::Matrix2d whole = model.c * p * model.c.transpose() + r;
      ASSERT_LE(eigen(filter.innovation_covariance() - whole).cwiseAbs().maxCoeff(),
                1e-9 * whole.cwiseAbs().maxCoeff());
      filter.correct(y);
      const Eigen::Vector2d e = y - model.c * z;
      EXPECT_NEAR(filter.normalised_innovation(), e.dot(inverse(whole) * e),
                  1e-7 * filter.normalised_innovation());
      const Eigen::Matrix<double, 5, 5> rest =
          Eigen::Matrix<double, 5, 5>::Identity() - l * model.c;
      const Eigen::Matrix<double, 5, 5> bound = rest * p * rest.transpose() + l * r * l.transpose();
      ASSERT_LE(covariance_distance(filter.covariance(), bound), 1e-8) << k;
      z = model.a * (z + l * e) + model.b * u;
      const Eigen::Matrix<double, 5, 5> closed = model.a * rest;
      const Eigen::Matrix<double, 5, 2> gain = model.a * l;
      p = (plain ? 1.0 : 1 + theta) * closed * p * closed.transpose() +
          gain * r * gain.transpose() +
          (plain ? q : Eigen::Matrix<double, 5, 5>(q * (1 + theta) / theta));
      filter.predict(u);
      for (int i = 0; i < 5; ++i) {
        ASSERT_NEAR(filter.estimate()(i), z(i), 1e-8 * (std::abs(z(i)) + std::sqrt(p(i, i)))) << k;
      }
      ASSERT_LE(covariance_distance(filter.covariance(), p), 1e-8) << k;
    }
  }
}

/// A channel that is left out: the dense equations with the other row alone.
TEST(MimoExtendedStateFilter, a_missing_channel_is_a_missing_row) {
  const CoupledModel model;
  auto filter = Coupled::make(coupled()).value();
  for (int k = 0; k < 20; ++k) filter.update(Eigen::Vector2d(0.1, -0.1), Eigen::Vector2d(0, 0));
  filter.predict(Eigen::Vector2d(0, 0));
  for (int left_out = 0; left_out < 2; ++left_out) {
    auto one = filter;
    const int used = 1 - left_out;
    const Eigen::Matrix<double, 5, 5> p = filter.covariance();
    const Eigen::Matrix<double, 1, 5> c = model.c.row(used);
    const double r = coupled().measurement_covariance(used, used);
    const Eigen::Matrix<double, 5, 1> l = p * c.transpose() / (c.dot(c * p) + r / 1.2);
    Eigen::Vector2d y(0.3, 0.4);
    const Eigen::Matrix<double, 5, 1> before = filter.estimate();
    y(left_out) = esokit_test::hidden_nan<double>();
    EXPECT_EQ(one.correct(y), StepStatus::measurement_rejected);
    const Eigen::Matrix<double, 5, 1> expected = before + l * (y(used) - c.dot(before));
    for (int i = 0; i < 5; ++i)
      EXPECT_NEAR(one.estimate()(i), expected(i), 1e-9 * (1 + std::abs(expected(i))));
    const Eigen::Matrix<double, 5, 5> rest = Eigen::Matrix<double, 5, 5>::Identity() - l * c;
    const Eigen::Matrix<double, 5, 5> bound = rest * p * rest.transpose() + l * r * l.transpose();
    EXPECT_LE(covariance_distance(one.covariance(), bound), 1e-9);
    EXPECT_EQ(one.innovation()(left_out), 0);
    // The next sample has both again, and knows what was missing.
    one.predict(Eigen::Vector2d(0, 0));
    EXPECT_GT(one.covariance()(left_out == 0 ? 0 : 2, left_out == 0 ? 0 : 2),
              p(left_out == 0 ? 0 : 2, left_out == 0 ? 0 : 2));
  }
}

TEST(MimoExtendedStateFilter, frozen_gain_is_the_limit_of_the_recursion) {
  for (const auto rule : {InflationRule::fixed, InflationRule::none}) {
    auto config = coupled();
    config.inflation_rule = rule;
    if (rule == InflationRule::none) config.inflation = 0;
    auto recursive = Coupled::make(config).value();
    config.mode = RiccatiMode::frozen;
    auto frozen = Coupled::make(config).value();
    const Eigen::Vector2d none(0, 0);
    for (int k = 0; k < 2000; ++k) recursive.update(none, none);
    const auto close = [&](double unit) {
      for (int i = 0; i < 5; ++i) {
        for (int j = 0; j < 2; ++j) {
          const double scale = eigen(recursive.gain().row(i)).cwiseAbs().maxCoeff();
          EXPECT_NEAR(frozen.gain()(i, j), recursive.gain()(i, j), unit * scale);
        }
      }
    };
    close(1e-10);
    EXPECT_TRUE(frozen.frozen());
    frozen.update(none, none);
    close(1e-10);
    // A gap, and a sample with one channel.
    for (auto* filter : {&recursive, &frozen}) {
      filter->predict(none);
      filter->predict(none);
      filter->correct(Eigen::Vector2d(0, esokit_test::hidden_nan<double>()));
      filter->predict(none);
    }
    EXPECT_FALSE(frozen.frozen());
    close(1e-9);
    for (int k = 0; k < 200; ++k) {
      frozen.update(none, none);
      recursive.update(none, none);
    }
    EXPECT_TRUE(frozen.frozen());
    close(1e-9);
  }
}

TEST(MimoExtendedStateFilter, bad_inputs_and_resets) {
  auto filter = Coupled::make(coupled()).value();
  const Eigen::Vector2d y(0.1, 0.2);
  filter.update(y, Eigen::Vector2d(1, 2));
  auto held = filter;
  EXPECT_EQ(filter.update(y, Eigen::Vector2d(hidden_nan<double>(), 0)), StepStatus::input_rejected);
  EXPECT_EQ(held.update(y, Eigen::Vector2d(1, 2)), StepStatus::ok);
  EXPECT_EQ(filter.estimate(), held.estimate());
  const Eigen::Vector2d bad(hidden_nan<double>(), hidden_infinity<double>());
  EXPECT_EQ(filter.update(bad, Eigen::Vector2d(1, 2)), StepStatus::measurement_rejected);
  held.predict(Eigen::Vector2d(1, 2));
  EXPECT_EQ(filter.estimate(), held.estimate());
  EXPECT_EQ(filter.reset(bad), StepStatus::state_rejected);
  EXPECT_EQ(filter.estimate(), held.estimate());
  EXPECT_EQ(filter.missed(0), 1);
  EXPECT_NE(filter.innovation()(0), 0);
  EXPECT_EQ(filter.reset(y), StepStatus::ok);
  for (const int channel : {0, 1}) {
    EXPECT_EQ(filter.innovation()(channel), 0);
    EXPECT_EQ(filter.missed(channel), 0);
  }
  EXPECT_EQ(filter.estimate()(0), 0.1);
  EXPECT_EQ(filter.estimate()(2), 0.2);
  EXPECT_LE(covariance_distance(filter.covariance(), coupled().initial_covariance), 1e-14);
}

TEST(MimoExtendedStateFilter, refuses_bad_configs_by_name) {
  const auto refused = [](auto&& change) {
    auto config = coupled();
    change(config);
    return refusal(Coupled::make(config));
  };
  using Config = Coupled::Config;
  const double nan = hidden_nan<double>();
  EXPECT_EQ(refused([](Config& c) { c.sample_time = 0; }),
            "sample_time: must be finite and positive");
  EXPECT_EQ(refused([&](Config& c) { c.input_matrix(1, 0) = nan; }),
            "input_matrix[2]: must be finite");
  EXPECT_EQ(refused([](Config& c) { eigen(c.input_matrix).setZero(); }),
            "input_matrix: must not be zero");
  EXPECT_EQ(refused([](Config& c) { c.measurement_covariance(0, 0) = -1; }),
            "measurement_covariance: must be finite and positive semidefinite");
  EXPECT_EQ(refused([](Config& c) { c.measurement_covariance(1, 0) = 0.1; }),
            "measurement_covariance[2]: must be symmetric");
  EXPECT_EQ(refused([](Config& c) {
              c.measurement_covariance(1, 0) = c.measurement_covariance(0, 1) = 1;
            }),
            "measurement_covariance: must be finite and positive semidefinite");
  EXPECT_EQ(refused([](Config& c) { (*c.process_covariance)(3, 1) += 0.1; }),
            "process_covariance[16]: must be symmetric");
  EXPECT_EQ(refused([](Config& c) { c.initial_covariance(4, 3) += 0.1; }),
            "initial_covariance[23]: must be symmetric");
  EXPECT_EQ(refused([&](Config& c) { (*c.process_covariance)(4, 4) = nan; }),
            "process_covariance[24]: must be finite");
  EXPECT_EQ(refused([](Config& c) { (*c.process_covariance)(4, 4) = -1; }),
            "process_covariance: must be finite and positive semidefinite");
  EXPECT_EQ(refused([](Config& c) { c.initial_covariance(0, 2) = c.initial_covariance(2, 0) = 2; }),
            "initial_covariance: must be finite and positive semidefinite");
  EXPECT_EQ(refused([](Config& c) { c.disturbance_bounds[3] = 1; }),
            "disturbance_bounds[3]: must be left out if process_covariance is given");
  EXPECT_EQ(refused([](Config& c) { c.disturbance_bounds[3] = -1; }),
            "disturbance_bounds[3]: must be finite and not negative");
  EXPECT_EQ(refused([](Config& c) { c.bound_factor = 0; }),
            "bound_factor: must be finite and positive");
  EXPECT_EQ(
      refused([](Config& c) { c.inflation = 0; }),
      "inflation: must be finite and positive; the plain Kalman filter is InflationRule::none");
  EXPECT_EQ(refused([](Config& c) { c.inflation_rule = InflationRule::none; }),
            "inflation: must be left out unless inflation_rule is fixed");
  EXPECT_EQ(refused([](Config& c) { c.inflation_rule = InflationRule::adaptive; }),
            "inflation_rule: must be fixed or none for several chains");
  EXPECT_EQ(refused([](Config& c) { c.mode = RiccatiMode::start_table; }),
            "mode: must be recursive or frozen for several chains");
  EXPECT_EQ(refused([](Config& c) {
              c.process_covariance.reset();
              eigen(c.measurement_covariance).setZero();
            }),
            "measurement_covariance: must be positive definite if nothing disturbs the plants");
  EXPECT_EQ(refused([](Config& c) {
              c.inflation_rule = InflationRule::none;
              c.inflation = 0;
              eigen(*c.process_covariance).row(1).setZero();
              eigen(*c.process_covariance).col(1).setZero();
              c.allow_vanishing_gain = true;
              c.mode = RiccatiMode::frozen;
            }),
            "process_covariance: gives no limit gain: without inflation the highest state of every "
            "chain must be disturbed");
}

// ---- absurd numbers, long gaps

using Pair = MimoExtendedStateFilter<ChainOrders<2, 1>, 2, float>;

Pair::Config pair_config() {
  Pair::Config config;
  config.input_matrix = {{2, 0}, {1, 1}};
  config.sample_time = 1e-3f;
  config.measurement_covariance = {{1e-6f, 0}, {0, 1e-6f}};
  config.disturbance_bounds = {0, 0, 10, 0, 10};
  eigen(config.initial_covariance).diagonal().setConstant(100);
  config.inflation = 0.2f;
  return config;
}

/// Largest y for which d can be told is 1e38 T^2 / k: more must not come in, and of the other
/// channel nothing is lost.
TEST(MimoExtendedStateFilter, absurd_measurements_are_rejected_alone) {
  for (const float absurd : {1e34f, -1e34f, 3e38f, -3e38f}) {
    for (const int channel : {0, 1}) {
      auto filter = Pair::make(pair_config()).value();
      Eigen::Vector2f y(0.25f, -0.5f);
      for (int k = 0; k < 50; ++k) filter.update(y, Eigen::Vector2f::Zero());
      Eigen::Vector2f bad = y;
      bad(channel) = absurd;
      for (int k = 0; k < 3; ++k) {
        const StepStatus status = filter.update(bad, Eigen::Vector2f::Zero());
        ASSERT_TRUE(eigen(filter.estimate()).allFinite()) << absurd;
        if (status != StepStatus::ok) {
          EXPECT_EQ(status, StepStatus::measurement_rejected);
          EXPECT_EQ(filter.missed(channel), k + 1);
          EXPECT_EQ(filter.missed(1 - channel), 0);
        }
      }
      for (int k = 0; k < 3000; ++k) filter.update(y, Eigen::Vector2f::Zero());
      EXPECT_NEAR(filter.estimate()(0), 0.25f, 1e-3f) << absurd << ' ' << channel;
      EXPECT_NEAR(filter.estimate()(3), -0.5f, 1e-3f) << absurd << ' ' << channel;
    }
  }
}

/// An absurd but finite u leaves states that no good y corrects, or that cannot be predicted.
TEST(MimoExtendedStateFilter, absurd_inputs_have_a_way_back) {
  for (const float absurd : {1e30f, 1e38f, 3e38f, -3e38f}) {
    auto filter = Pair::make(pair_config()).value();
    for (int k = 0; k < 6; ++k) {
      filter.update(Eigen::Vector2f(0.25f, -0.5f), Eigen::Vector2f(absurd, absurd));
      ASSERT_TRUE(eigen(filter.estimate()).allFinite()) << absurd;
    }
    for (int k = 0; k < 3000; ++k) {
      filter.update(Eigen::Vector2f(0.25f, -0.5f), Eigen::Vector2f::Zero());
    }
    EXPECT_NEAR(filter.estimate()(0), 0.25f, 1e-3f) << absurd;
    EXPECT_NEAR(filter.estimate()(3), -0.5f, 1e-3f) << absurd;
  }
}

/// One channel, both, and longer than max_gap: the covariance stays finite meanwhile.
TEST(MimoExtendedStateFilter, long_gaps_restart_the_chain) {
  for (const bool frozen : {false, true}) {
    for (const int gap : {20, 21, 5000}) {
      auto config = pair_config();
      config.max_gap = 20;
      if (frozen) config.mode = RiccatiMode::frozen;
      auto filter = Pair::make(config).value();
      auto both = filter;
      const Eigen::Vector2f y(0.25f, -0.5f);
      for (int k = 0; k < 50; ++k) {
        filter.update(y, Eigen::Vector2f::Zero());
        both.update(y, Eigen::Vector2f::Zero());
      }
      for (int k = 0; k < gap; ++k) {
        filter.update(Eigen::Vector2f(hidden_nan<float>(), -0.5f), Eigen::Vector2f::Zero());
        both.predict(Eigen::Vector2f::Zero());
        ASSERT_TRUE(eigen(filter.covariance()).allFinite() && eigen(filter.gain()).allFinite())
            << k;
        ASSERT_TRUE(eigen(both.covariance()).allFinite() && eigen(both.gain()).allFinite()) << k;
      }
      EXPECT_EQ(filter.missed(0), std::min(gap, 65535));
      EXPECT_EQ(filter.missed(1), 0);
      const StepStatus expected = gap > 20 ? StepStatus::restarted : StepStatus::ok;
      EXPECT_EQ(filter.update(Eigen::Vector2f(3, -0.5f), Eigen::Vector2f::Zero()), expected);
      EXPECT_EQ(both.update(Eigen::Vector2f(3, 4), Eigen::Vector2f::Zero()), expected);
      EXPECT_EQ(filter.missed(0), 0);
      if (gap > 20) {
        EXPECT_EQ(filter.estimate()(0), 3);
        EXPECT_EQ(filter.estimate()(2), 0);
        EXPECT_EQ(both.estimate()(3), 4);
      }
      for (int k = 0; k < 3000; ++k) {
        filter.update(Eigen::Vector2f(3, -0.5f), Eigen::Vector2f::Zero());
        both.update(Eigen::Vector2f(3, 4), Eigen::Vector2f::Zero());
      }
      EXPECT_EQ(filter.frozen(), frozen);
      EXPECT_NEAR(filter.estimate()(0), 3, 1e-3f);
      EXPECT_NEAR(filter.estimate()(3), -0.5f, 1e-3f);
      EXPECT_NEAR(both.estimate()(3), 4, 1e-3f);
    }
  }
}

TEST(MimoExtendedStateFilter, refuses_what_the_scalar_cannot_hold) {
  const auto rule = [](auto&& change) {
    auto config = pair_config();
    change(config);
    const auto made = Pair::make(config);
    return refusal(made);
  };
  using Config = Pair::Config;
  EXPECT_EQ(rule([](Config& c) { c.sample_time = 1e-25f; }),
            "sample_time: to the power of a chain's highest state, over its factorial, leaves the "
            "scalar's range");
  EXPECT_EQ(rule([](Config& c) { c.sample_time = 1e-40f; }),
            "sample_time: has an inverse that the scalar cannot hold");
  EXPECT_EQ(rule([](Config& c) { c.input_matrix(1, 0) = 1e-37f; }),
            "input_matrix[2]: times T^n / n! gives a gain that the scalar cannot hold");
  EXPECT_EQ(rule([](Config& c) { c.max_gap = 0; }), "max_gap: must be 1 .. 65000");
  EXPECT_EQ(rule([](Config& c) { c.max_gap = 1; }), "accepted");
  EXPECT_EQ(rule([](Config& c) { c.max_gap = 65000; }), "accepted");
  EXPECT_EQ(rule([](Config& c) { c.max_gap = 65001; }), "max_gap: must be 1 .. 65000");
  EXPECT_EQ(rule([](Config& c) { c.inflation = 3e38f; }),
            "inflation: lets the covariance grow beyond what the scalar can hold");
}

/// Exact measurements and disturbances of any size: refused, or the gain finds back. One so small
/// that the scalar holds no square of it left a gain of zero once P0 was used up, and status ok.
TEST(MimoExtendedStateFilter, exact_measurements_of_any_size_find_back) {
  int accepted = 0;
  std::string last_rule;
  for (double bound = 1e-25; bound < 1e18; bound *= 10) {
    auto config = pair_config();
    eigen(config.measurement_covariance).setZero();
    eigen(config.initial_covariance).diagonal().setConstant(static_cast<float>(bound * bound));
    config.disturbance_bounds = {0, 0, static_cast<float>(bound), 0, static_cast<float>(bound)};
    const auto made = Pair::make(config);
    if (!made) {
      last_rule = refusal(made);
      continue;
    }
    ++accepted;
    auto filter = *made;
    for (int k = 0; k < 100; ++k) filter.update(Eigen::Vector2f(1, 2), Eigen::Vector2f::Zero());
    for (int k = 0; k < 300; ++k) filter.update(Eigen::Vector2f(3, 5), Eigen::Vector2f::Zero());
    EXPECT_NEAR(filter.estimate()(0), 3, 1e-5f) << bound;
    EXPECT_NEAR(filter.estimate()(3), 5, 1e-5f) << bound;
  }
  EXPECT_GT(accepted, 30);
  EXPECT_EQ(last_rule, "disturbance_bounds[2]: has a square that the scalar cannot hold");
}

/// Chain by chain, what the filter of one output refuses as well.
TEST(MimoExtendedStateFilter, refuses_what_has_no_way_back) {
  const auto rule = [](auto&& change) {
    auto config = pair_config();
    change(config);
    return refusal(Pair::make(config));
  };
  using Config = Pair::Config;
  const std::string exact =
      "measurement_covariance: must be positive definite if nothing disturbs the plants";
  EXPECT_EQ(rule([](Config& c) { c.disturbance_bounds[4] = 0; }), "accepted");
  EXPECT_EQ(rule([](Config& c) {
              c.disturbance_bounds[4] = 0;
              c.measurement_covariance(1, 1) = 0;
            }),
            exact);
  EXPECT_EQ(rule([](Config& c) { c.measurement_covariance(1, 1) = 0; }), "accepted");

  const std::string certain =
      "initial_covariance[24]: must leave the highest state of a chain uncertain if nothing "
      "disturbs it: it would never be corrected (or set allow_vanishing_gain)";
  EXPECT_EQ(rule([](Config& c) {
              c.disturbance_bounds[4] = 0;
              c.initial_covariance(4, 4) = 0;
            }),
            certain);
  EXPECT_EQ(rule([](Config& c) {
              c.disturbance_bounds[4] = 0;
              c.initial_covariance(4, 4) = 0;
              c.allow_vanishing_gain = true;
            }),
            "accepted");
  const std::string vanishing =
      "disturbance_bounds[2]: must disturb the highest state of every chain: without inflation its "
      "gain tends to zero (or set allow_vanishing_gain)";
  const auto plain = [](Config& c) {
    c.inflation_rule = InflationRule::none;
    c.inflation = 0;
  };
  EXPECT_EQ(rule([&](Config& c) { plain(c); }), "accepted");
  EXPECT_EQ(rule([&](Config& c) {
              plain(c);
              c.disturbance_bounds[2] = 0;
            }),
            vanishing);
  EXPECT_EQ(rule([&](Config& c) {
              plain(c);
              c.disturbance_bounds[2] = 0;
              c.allow_vanishing_gain = true;
            }),
            "accepted");

  // The chain of three states has a pole at -1 without noise; the other has not.
  const std::string alternating =
      "measurement_covariance[0]: does not damp an error that alternates in sign: give y' a bound, "
      "or y a variance of at least";
  const float least = 1e-6f * 5 * 5e-6f * 5e-6f;  // a millionth of 5 (10 T^2 / 2)^2
  for (const float share : {0.99f, 1.01f}) {
    EXPECT_EQ(rule([&](Config& c) {
                plain(c);
                c.measurement_covariance(0, 0) = share * least;
              }),
              share < 1 ? alternating : "accepted");
  }
  EXPECT_EQ(rule([&](Config& c) {
              plain(c);
              c.measurement_covariance(1, 1) = 0;
            }),
            "accepted");
  EXPECT_EQ(rule([](Config& c) { c.measurement_covariance(0, 0) = 0; }), "accepted");
}

/// Variances at the ends of the scalar: what is told of them is a number, what cannot be held is
/// refused.
TEST(MimoExtendedStateFilter, what_is_told_is_finite) {
  int accepted = 0;
  for (double r = 1e-38; r < 3e38; r *= 10) {
    auto config = pair_config();
    eigen(config.measurement_covariance).diagonal().setConstant(static_cast<float>(r));
    const auto made = Pair::make(config);
    if (!made) continue;
    ++accepted;
    auto filter = *made;
    for (const float y : {0.0f, 1.0f, 1e19f, 3e37f, 1.0f}) {
      filter.update(Eigen::Vector2f(y, -y), Eigen::Vector2f::Zero());
      EXPECT_TRUE(eigen(filter.covariance()).allFinite()) << r << ' ' << y;
      EXPECT_TRUE(eigen(filter.innovation_covariance()).allFinite()) << r << ' ' << y;
      EXPECT_TRUE(std::isfinite(filter.normalised_innovation())) << r << ' ' << y;
      EXPECT_GE(filter.normalised_innovation(), 0) << r << ' ' << y;
    }
  }
  EXPECT_GT(accepted, 20);
}

/// R = 1e-12 and P0 = 1e8 in float.
TEST(MimoExtendedStateFilter, many_steps_in_float) {
  using Filter = MimoExtendedStateFilter<ChainOrders<2, 2>, 2, float>;
  Filter::Config config;
  eigen(config.input_matrix).setIdentity();
  config.sample_time = 1e-3f;
  config.measurement_covariance = {{1e-12f, 0.5e-12f}, {0.5e-12f, 1e-12f}};
  config.disturbance_bounds = {0, 0, 300, 0, 0, 300};
  eigen(config.initial_covariance).diagonal().setConstant(1e8f);
  config.inflation = 0.5f;
  auto filter = Filter::make(config).value();
  Random random(13);
  for (int k = 0; k < long_run(200'000); ++k) {
    const auto y = static_cast<float>(random.uniform(-1, 1));
    ASSERT_EQ(filter.update(Eigen::Vector2f(y, -y), Eigen::Vector2f(y, y)), StepStatus::ok);
    if (k > 20 && k % 1009 != 0) continue;
    const auto p = filter.covariance();
    for (int i = 0; i < 6; ++i) ASSERT_GT(p(i, i), 0) << k;
    ASSERT_EQ(p, p.transpose());
    ASSERT_TRUE(eigen(filter.gain()).allFinite());
  }
}

}  // namespace esokit_test::observer_mimo_extended_state_filter_test
