// Exact variances against Monte-Carlo runs of the observers, against the integral of the frequency
// response, and against the closed forms that exist.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <numbers>
#include <support/refusal.hpp>

#include "support/numbers.hpp"

namespace analysis_covariance_test {

using namespace esokit;
using esokit_test::Random;
using esokit_test::refusal;
using esokit_test::sanitized;

constexpr long samples = sanitized ? 200'000 : 10'000'000;
constexpr long blocks = 100;

/// White, variance 1; that it is uniform does not matter to a variance.
double white(Random& random) { return random.uniform(-std::sqrt(3.0), std::sqrt(3.0)); }

/// Mean square of a correlated signal and its standard error, from the scatter of long blocks.
class MeanSquare {
 public:
  explicit MeanSquare(long count = samples) : block_(count / blocks) {}
  void add(double value) {
    sum_ += value * value;
    if (++count_ == block_) {
      const double mean = sum_ / static_cast<double>(count_);
      total_ += mean;
      squares_ += mean * mean;
      sum_ = 0.0;
      count_ = 0;
      ++done_;
    }
  }
  [[nodiscard]] double mean() const { return total_ / static_cast<double>(done_); }
  [[nodiscard]] double standard_error() const {
    const auto n = static_cast<double>(done_);
    return std::sqrt((squares_ / n - mean() * mean()) / (n - 1.0));
  }

 private:
  double sum_ = 0.0, total_ = 0.0, squares_ = 0.0;
  long block_, count_ = 0, done_ = 0;
};

void expect_within(const MeanSquare& measured, double exact, double errors = 3.0) {
  EXPECT_LT(std::abs(measured.mean() - exact), errors * measured.standard_error())
      << "exact " << exact << ", measured " << measured.mean() << " +- "
      << measured.standard_error();
  // The comparison must be worth something.
  EXPECT_LT(measured.standard_error(), (sanitized ? 0.1 : 0.03) * exact);
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

template <int Order, int Levels>
void monte_carlo_sampled() {
  constexpr std::size_t size = Order + 1;
  auto observer = sampled<Order, Levels>(8.0, 0.01);
  const auto exact = estimation_error_covariance(observer, {.measurement = 0.04}).value();
  Random random(std::uint64_t{1000 + 10 * Order + Levels});
  std::array<MeanSquare, size> measured;
  for (int k = 0; k < 3000; ++k) observer.update(0.2 * white(random), 0.0);
  for (long k = 0; k < samples; ++k) {
    observer.update(0.2 * white(random), 0.0);
    const auto z = observer.estimate();
    for (std::size_t r = 0; r < size; ++r) measured[r].add(z(static_cast<int>(r)));
  }
  for (std::size_t r = 0; r < size; ++r) {
    SCOPED_TRACE(testing::Message() << "n " << Order << ", p " << Levels << ", row " << r);
    expect_within(measured[r], exact(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(r)));
  }
}

TEST(Covariance, OfSampledObserversEqualsMonteCarlo) {
  monte_carlo_sampled<1, 1>();
  monte_carlo_sampled<1, 2>();
  monte_carlo_sampled<1, 3>();
  monte_carlo_sampled<1, 4>();
  monte_carlo_sampled<2, 1>();
  monte_carlo_sampled<2, 2>();
  monte_carlo_sampled<2, 3>();
  monte_carlo_sampled<2, 4>();
  monte_carlo_sampled<3, 1>();
  monte_carlo_sampled<3, 2>();
  monte_carlo_sampled<3, 3>();
  monte_carlo_sampled<3, 4>();
}

// z' = A z + B w by the trapezoid rule has, for white w, exactly the stationary covariance of the
// ODE, for any step: (1+X) P (1+X)' + h B B' = (1-X) P (1-X)' with X = h A / 2 is A P + P A' =
// -BB'.
template <int Order, int Levels>
void monte_carlo_continuous() {
  constexpr std::size_t size = Order + 1;
  const auto observer = continuous<Order, Levels>(8.0);
  using Observer = std::remove_cvref_t<decltype(observer)>;
  constexpr int states = Observer::states;
  using State = EigenMatrix<double, states>;
  const double density = 4e-4;
  const auto exact = estimation_error_covariance(observer, {.measurement = density}).value();

  const double h = 0.01;
  EigenMatrix<double, states, states> left = EigenMatrix<double, states, states>::Identity();
  EigenMatrix<double, states, states> right = left;
  for (int j = 0; j < states; ++j) {
    const State column = observer.derivative(0.0, State::Unit(j), 0.0, 0.0);
    left.col(j) -= 0.5 * h * column;
    right.col(j) += 0.5 * h * column;
  }
  const State from_y = observer.derivative(0.0, State::Zero(), 1.0, 0.0);
  // Gauss-Jordan, so that the test needs no solver of Eigen.
  EigenMatrix<double, states, states + 1> stacked;
  stacked << right, from_y * std::sqrt(density * h);
  for (int k = 0; k < states; ++k) {
    int pivot = k;
    for (int i = k; i < states; ++i) {
      if (std::abs(left(i, k)) > std::abs(left(pivot, k))) pivot = i;
    }
    left.row(k).swap(left.row(pivot));
    stacked.row(k).swap(stacked.row(pivot));
    stacked.row(k) /= left(k, k);
    left.row(k) /= left(k, k);
    for (int i = 0; i < states; ++i) {
      if (i == k) continue;
      stacked.row(i) -= left(i, k) * stacked.row(k);
      left.row(i) -= left(i, k) * left.row(k);
    }
  }

  Random random(std::uint64_t{2000 + 10 * Order + Levels});
  std::array<MeanSquare, size> measured;
  State z = State::Zero();
  for (long k = -3000; k < samples; ++k) {
    State next = stacked.col(states) * white(random);
    for (int j = 0; j < states; ++j) next += stacked.col(j) * z(j);
    z = next;
    if (k < 0) continue;
    const auto estimate = Observer::estimate(z);
    for (std::size_t r = 0; r < size; ++r) {
      measured[r].add(estimate(static_cast<int>(r)));
    }
  }
  for (std::size_t r = 0; r < size; ++r) {
    SCOPED_TRACE(testing::Message() << "n " << Order << ", p " << Levels << ", row " << r);
    expect_within(measured[r], exact(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(r)));
  }
}

TEST(Covariance, OfContinuousObserversEqualsMonteCarlo) {
  monte_carlo_continuous<1, 1>();
  monte_carlo_continuous<1, 4>();
  monte_carlo_continuous<2, 1>();
  monte_carlo_continuous<2, 3>();
  monte_carlo_continuous<3, 2>();
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
  const int count = 40000;
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
  check(sampled<2, 1>(8.0, 0.01));
  check(sampled<2, 3>(8.0, 0.01));
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

// The disturbance's noise acts between samples: simulated on a plant with 20 steps a sample.
TEST(Covariance, OfARandomWalkDisturbanceEqualsMonteCarlo) {
  const double T = 0.05;
  auto observer = sampled<2, 2>(4.0, T);
  const double density = 9.0;
  const double variance = 1e-4;
  const auto exact =
      estimation_error_covariance(observer, {.measurement = variance, .disturbance = density})
          .value();
  Random random(5);
  const long run = std::min(samples, 500'000L);
  std::array<MeanSquare, 3> measured{MeanSquare(run), MeanSquare(run), MeanSquare(run)};
  const int steps = 20;
  const double h = T / steps;
  double y = 0.0;
  double dy = 0.0;
  double d = 0.0;
  for (long k = -1000; k < run; ++k) {
    for (int i = 0; i < steps; ++i) {
      // Exact for a disturbance that jumps in the middle of each step.
      y += h * dy + 0.5 * h * h * d;
      dy += h * d;
      const double jump = std::sqrt(density * h) * white(random);
      y += 0.125 * h * h * jump;
      dy += 0.5 * h * jump;
      d += jump;
    }
    observer.update(y + std::sqrt(variance) * white(random), 0.0);
    // The walk takes y to about 1e10, which costs digits of the errors, but too few to be seen.
    const auto z = observer.estimate();
    if (k < 0) continue;
    measured[0].add(y - z(0));
    measured[1].add(dy - z(1));
    measured[2].add(d - z(2));
  }
  for (std::size_t r = 0; r < 3; ++r) {
    SCOPED_TRACE(testing::Message() << "row " << r);
    expect_within(measured[r], exact(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(r)));
  }
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
