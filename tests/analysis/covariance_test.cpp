// Exact variances against sums of the squares of what an impulse makes of the observers, against
// the integral of the frequency response, and against the closed forms that exist.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <functional>
#include <numbers>
#include <support/refusal.hpp>
#include <vector>

namespace analysis_covariance_test {

using namespace esokit;
using esokit_test::refusal;

using Dynamic = DynamicMatrix<double>;
using detail::product;

template <class MatrixType>
Dynamic dynamic(const MatrixType& matrix) {
  return detail::dynamic_copy(matrix, static_cast<int>(matrix.rows()),
                              static_cast<int>(matrix.cols()));
}

/// The variances that white noise makes of a stable linear system are the sum of the squares of
/// what each impulse does, exact but for rounding.
/// @param step the outputs at the next sample, a column; it is told whether it is the first one
std::vector<double> sum_of_squares(int outputs, const std::function<Dynamic(bool first)>& step) {
  std::vector<double> sums(static_cast<std::size_t>(outputs));
  for (int k = 0; k < 4000; ++k) {
    const Dynamic values = step(k == 0);
    for (int r = 0; r < outputs; ++r)
      sums[static_cast<std::size_t>(r)] += values(r, 0) * values(r, 0);
  }
  return sums;
}

void expect_variances(const Dynamic& ours, const std::vector<double>& reference) {
  ASSERT_EQ(ours.rows(), static_cast<int>(reference.size()));
  for (int i = 0; i < ours.rows(); ++i) {
    const double exact = reference[static_cast<std::size_t>(i)];
    EXPECT_NEAR(ours(i, i), exact, 1e-9 * exact) << "row " << i;
  }
}

template <int Order, int Levels>
auto sampled(double bandwidth, double sample_time) {
  typename CascadeEso<Order, Levels>::Config config;
  config.observer_bandwidth = bandwidth;
  config.bandwidth_factor = Levels > 1 ? 2.0 : 0.0;
  config.input_gain = 1.0;
  config.sample_time = sample_time;
  return CascadeEso<Order, Levels>::make(config).value();
}

template <int Order, int Levels>
auto continuous(double bandwidth) {
  typename ContinuousCascadeEso<Order, Levels>::Config config;
  config.observer_bandwidth = bandwidth;
  config.bandwidth_factor = Levels > 1 ? 2.0 : 0.0;
  config.input_gain = 1.0;
  return ContinuousCascadeEso<Order, Levels>::make(config).value();
}

template <class Observer>
void expect_sum_of_squares(Observer observer) {
  expect_variances(dynamic(estimation_error_covariance(observer, {.measurement = 0.04}).value()),
                   sum_of_squares(Observer::size, [&](bool first) {
                     observer.update(first ? 0.2 : 0.0, 0.0);
                     return dynamic(observer.estimate());
                   }));
}

TEST(Covariance, OfSampledObserversIsTheSumOfSquaresOfTheirEstimates) {
  expect_sum_of_squares(sampled<1, 1>(8.0, 0.01));
  expect_sum_of_squares(sampled<1, 4>(8.0, 0.01));
  expect_sum_of_squares(sampled<2, 2>(8.0, 0.01));
  expect_sum_of_squares(sampled<3, 2>(8.0, 0.01));
}

/// z' = A z + B w by the trapezoid rule has, for white w, exactly the stationary covariance of the
/// ODE, for any step: (1+X) P (1+X)' + h B B' = (1-X) P (1-X)' with X = h A / 2 is A P + P A' =
/// -BB'.
/// @param input B times the root of h
std::vector<double> by_the_trapezoid_rule(const Dynamic& half_step, const Dynamic& input,
                                          const Dynamic& to_estimate) {
  const int n = half_step.rows();
  Dynamic left(n, n), right(n, n + 1);
  for (int i = 0; i < n; ++i) left(i, i) = right(i, i) = 1.0;
  detail::add(left, 0, 0, half_step, -1.0);
  detail::add(right, 0, 0, half_step);
  detail::add(right, 0, n, input);
  detail::solve_in_place(left.view(), right.view());
  const Dynamic transition = detail::dynamic_copy(right, n, n);
  Dynamic z(n, 1);
  for (int i = 0; i < n; ++i) z(i, 0) = right(i, n);
  return sum_of_squares(to_estimate.rows(), [&](bool first) {
    if (!first) z = product(transition, z);
    return product(to_estimate, z);
  });
}

template <class Observer>
void expect_trapezoid_rule(const Observer& observer) {
  constexpr int states = Observer::states;
  using State = EigenMatrix<double, states>;
  const double density = 4e-4;
  const double h = 0.01;
  Dynamic half_step(states, states), to_estimate(Observer::size, states);
  for (int j = 0; j < states; ++j) {
    const State unit = State::Unit(j);
    detail::add(half_step, 0, j, dynamic(observer.derivative(0.0, unit, 0.0, 0.0)), 0.5 * h);
    detail::add(to_estimate, 0, j, dynamic(Observer::estimate(unit)));
  }
  Dynamic input(states, 1);
  detail::add(input, 0, 0, dynamic(observer.derivative(0.0, State::Zero(), 1.0, 0.0)),
              std::sqrt(density * h));
  expect_variances(dynamic(estimation_error_covariance(observer, {.measurement = density}).value()),
                   by_the_trapezoid_rule(half_step, input, to_estimate));
}

TEST(Covariance, OfContinuousObserversIsThatOfTheTrapezoidRule) {
  expect_trapezoid_rule(continuous<1, 1>(8.0));
  expect_trapezoid_rule(continuous<2, 1>(8.0));
  expect_trapezoid_rule(continuous<2, 2>(8.0));
}

// White noise on y of a continuous LESO with N equal poles: the closed forms of int abs(G)^2.
TEST(Covariance, ClosedForms) {
  const double w = 7.0;
  // n = 1: yhat/v = (2ws + w^2)/(s+w)^2, dhat/v = w^2 s/(s+w)^2.
  const auto two = estimation_error_covariance(continuous<1, 1>(w), {.measurement = 3.0}).value();
  EXPECT_NEAR(two(0, 0), 3.0 * 1.25 * w, 1e-12 * two(0, 0));
  EXPECT_NEAR(two(1, 1), 3.0 * 0.25 * w * w * w, 1e-12 * two(1, 1));
  // n = 2, N = 3: 33/16 w, and dhat/v = w^3 s^2/(s+w)^3.
  const auto three = estimation_error_covariance(continuous<2, 1>(w), {.measurement = 1.0}).value();
  EXPECT_NEAR(three(0, 0), 33.0 / 16.0 * w, 1e-12 * three(0, 0));
  EXPECT_NEAR(three(2, 2), 3.0 / 16.0 * std::pow(w, 5), 1e-12 * three(2, 2));
  // A random walk of d: its error is s^2 (s + 3w) / (s + w)^3 times d = white / s.
  const auto walk = estimation_error_covariance(continuous<1, 1>(w), {.disturbance = 2.0}).value();
  EXPECT_NEAR(walk(1, 1), 2.0 * 1.25 / w, 1e-12 * walk(1, 1));  // (s + 2w)/(s+w)^2
  EXPECT_NEAR(walk(0, 0), 2.0 * 0.25 / (w * w * w), 1e-12 * walk(0, 0));
}

/// Mean of abs(G)^2 over all frequencies: a variance by Parseval, by the trapezoid rule in the
/// angle, which for a periodic function is exact beyond all powers.
template <class System>
double by_parseval(const System& system, int output) {
  const int count = 4000;
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    const double w = std::numbers::pi / system.sample_time * (i + 0.5) / count;
    sum += std::norm(frequency_response(system, w).value()(output, 0));
  }
  return sum / count;
}

TEST(Covariance, EqualsTheIntegralOfTheResponse) {
  const auto check = [](const auto& observer) {
    const auto exact = estimation_error_covariance(observer, {.measurement = 1.0}).value();
    const auto system = observer_system(observer);
    for (int r = 0; r < exact.rows(); ++r) {
      EXPECT_NEAR(by_parseval(system, r), exact(r, r), 1e-9 * exact(r, r));
    }
  };
  check(sampled<1, 4>(300.0, 0.01));
  check(sampled<3, 2>(1.0, 0.01));
  check(LinearEso<2, double, 2>::make(
            {.observer_bandwidth = 12.0, .input_gain = 1.0, .sample_time = 0.01})
            .value());
}

TEST(Covariance, SampledTendsToContinuous) {
  const EstimationNoise noise{.measurement = 2.0, .disturbance = 5.0};
  const auto exact = estimation_error_covariance(continuous<2, 2>(8.0), noise).value();
  std::array<double, 3> before{};
  for (const double T : {1e-4, 1e-5}) {
    const auto ours = estimation_error_covariance(
                          sampled<2, 2>(8.0, T),
                          {.measurement = 2.0 / T, .disturbance = 5.0})  // a sample holds T of it
                          .value();
    for (std::size_t r = 0; r < 3; ++r) {
      const auto i = static_cast<Eigen::Index>(r);
      const double error = ours(i, i) / exact(i, i) - 1.0;
      EXPECT_LT(std::abs(error), 0.02);
      if (before[r] != 0.0) {
        EXPECT_NEAR(before[r] / error, 10.0, 0.2);  // order 1 in T
      }
      before[r] = error;
    }
  }
}

// The disturbance's noise acts between samples, where the plant is (y, y', d), a chain. What a jump
// of d makes of the errors is quadratic in its time before the next sample: three nodes of Gauss
// integrate the square exactly.
TEST(Covariance, OfARandomWalkDisturbanceIsTheSumOfSquaresOfTheErrors) {
  const double T = 0.05;
  const double density = 9.0;
  const auto made = sampled<2, 2>(4.0, T);
  std::vector<double> reference(3);
  const double node = std::sqrt(0.15);
  for (const int i : {-1, 0, 1}) {
    auto observer = made;
    double t = (0.5 + i * node) * T;  // since the jump
    const auto squares = sum_of_squares(3, [&](bool) {
      const double y = 0.5 * t * t;
      observer.update(y, 0.0);
      Dynamic errors = dynamic(observer.estimate());
      errors(0, 0) -= y;
      errors(1, 0) -= t;
      errors(2, 0) -= 1.0;
      t += T;
      return errors;
    });
    for (std::size_t r = 0; r < 3; ++r)
      reference[r] += (i == 0 ? 8 : 5) / 18.0 * T * density * squares[r];
  }
  const auto ours = [&](double variance) {
    return dynamic(
        estimation_error_covariance(made, {.measurement = variance, .disturbance = density})
            .value());
  };
  expect_variances(ours(0.0), reference);

  auto observer = made;
  const auto squares = sum_of_squares(3, [&](bool first) {
    observer.update(first ? 0.01 : 0.0, 0.0);
    return dynamic(observer.estimate());
  });
  for (std::size_t r = 0; r < 3; ++r) reference[r] += squares[r];
  expect_variances(ours(1e-4), reference);
}

// The steady filter is the Kalman filter of the chain; its own covariance is another way to ours.
TEST(Covariance, OfAFrozenFilterIsItsRiccatiSolution) {
  EigenMatrix<double, 3, 3> q = EigenMatrix<double, 3, 3>::Zero();
  const double T = 0.01;
  const double density = 2.0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int a = 2 - i;
      const int b = 2 - j;
      q(i, j) = density * std::pow(T, a + b + 1) / (factorial(a) * factorial(b) * (a + b + 1));
    }
  }
  ExtendedStateFilter<2>::Config config;
  config.input_gain = 1.0;
  config.sample_time = T;
  config.measurement_variance = 1e-4;
  config.process_covariance = q;
  config.inflation_rule = InflationRule::none;
  config.initial_covariance = EigenMatrix<double, 3, 3>::Identity();
  auto filter = ExtendedStateFilter<2>::make(config).value();
  for (int k = 0; k < 5000; ++k) filter.update(0.0, 0.0);
  const auto ours =
      estimation_error_covariance(filter, {.measurement = 1e-4, .disturbance = density}).value();
  const auto own = filter.covariance();
  for (int r = 0; r < 3; ++r) EXPECT_NEAR(ours(r, r), own(r, r), 1e-8 * own(r, r)) << "row " << r;
}

TEST(Covariance, WhatDoesNotExistIsAnError) {
  EigenMatrix<double, 1, 1> one = EigenMatrix<double, 1, 1>::Constant(1.0);
  LinearSystem<1, 1, 1> system;
  system.b(0, 0) = 1.0;
  system.c(0, 0) = 1.0;
  EXPECT_EQ(refusal(output_covariance(system, one)),
            "system: is not stable: the stationary covariance does not exist");  // integrator
  system.a(0, 0) = 1e-3;
  EXPECT_EQ(refusal(output_covariance(system, one)),
            "system: is not stable: the stationary covariance does not exist");
  system.a(0, 0) = -1e-3;
  EXPECT_NEAR(output_covariance(system, one).value()(0, 0), 500.0, 1e-9);
  system.d(0, 0) = 1.0;
  const auto direct = output_covariance(system, one);
  ASSERT_EQ(refusal(direct),
            "output[0]: receives continuous white noise directly: its variance is infinite");
  system.sample_time = 1.0;  // a = A - 1: A = 0.999
  EXPECT_NEAR(output_covariance(system, one).value()(0, 0), 1.0 + 1.0 / (1.0 - 0.999 * 0.999),
              1e-9);
  system.a(0, 0) = -2.0;  // A = -1
  EXPECT_EQ(refusal(output_covariance(system, one)),
            "system: is not stable: the stationary covariance does not exist");
  LinearSystem<1, 2, 1> two;
  two.a(0, 0) = -1.0;
  two.b(0, 0) = two.b(0, 1) = two.c(0, 0) = 1.0;
  EigenMatrix<double, 2, 2> noise;
  for (const double across : {-2.0, 2.0}) {
    noise << 1.0, across, across, 4.0;
    EXPECT_NEAR(output_covariance(two, noise).value()(0, 0), 0.5 * (5.0 + 2.0 * across), 1e-12);
    noise(0, 1) = noise(1, 0) = 1.001 * across;
    EXPECT_EQ(refusal(output_covariance(two, noise)),
              "input[0]: must be a covariance matrix: symmetric and positive semidefinite");
  }
  noise << 1.0, 0.5, 0.4, 4.0;
  EXPECT_EQ(refusal(output_covariance(two, noise)),
            "input[0]: must be a covariance matrix: symmetric and positive semidefinite");
  noise(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(output_covariance(two, noise)),
            "input[0]: must be a covariance matrix: symmetric and positive semidefinite");
  one(0, 0) = -1.0;
  system.a(0, 0) = -1.0;
  EXPECT_EQ(refusal(output_covariance(system, one)), "input[0]: must be finite and not negative");
  EXPECT_EQ(refusal(estimation_error_covariance(sampled<1, 1>(1.0, 0.1), {.measurement = -1.0})),
            "measurement: must be finite and not negative");
}

}  // namespace analysis_covariance_test
