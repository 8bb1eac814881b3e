// Responses against state spaces that were written from the papers' equations in 100 digits, and
// against what the observers themselves do with an impulse.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <array>
#include <complex>
#include <cstddef>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <functional>
#include <limits>
#include <numbers>
#include <support/refusal.hpp>
#include <vector>

#include "support/reference_observer.hpp"

namespace analysis_frequency_response_test {

using namespace esokit;
using Complex = std::complex<double>;
using ComplexMatrix = DynamicMatrix<Complex>;
using esokit_test::ReferenceObserver;
using esokit_test::refusal;

constexpr double b0 = -3.0;

template <int Order, int Levels, int Extension>
auto sampled(double bandwidth, double sample_time) {
  typename CascadeEso<Order, Levels, double, Extension>::Config config;
  config.observer_bandwidth = bandwidth;
  config.bandwidth_factor = Levels > 1 ? 1.8 : 0.0;
  config.input_gain = b0;
  config.sample_time = sample_time;
  return CascadeEso<Order, Levels, double, Extension>::make(config).value();
}

template <int Order, int Levels, int Extension>
auto continuous(double bandwidth) {
  typename ContinuousCascadeEso<Order, Levels, double, Extension>::Config config;
  config.observer_bandwidth = bandwidth;
  config.bandwidth_factor = Levels > 1 ? 1.8 : 0.0;
  config.input_gain = b0;
  return ContinuousCascadeEso<Order, Levels, double, Extension>::make(config).value();
}

template <int Order, int Levels, int Extension>
ReferenceObserver reference(double bandwidth, double sample_time) {
  ReferenceObserver r{Order, Extension, {}, b0, sample_time};
  for (int i = 0; i < Levels; ++i) {
    r.bandwidths.push_back(bandwidth);
    bandwidth *= 1.8;
  }
  return r;
}

/// @param response of the rows of the estimate to (y, u)
void expect_equal(const std::function<ComplexMatrix(double w)>& response,
                  const ReferenceObserver& reference, const std::vector<double>& frequencies) {
  for (const double w : frequencies) {
    const ComplexMatrix ours = response(w);
    const auto expected = reference.response(w);
    for (int r = 0; r < ours.rows(); ++r) {
      for (int input = 0; input < 2; ++input) {
        const Complex right =
            expected[static_cast<std::size_t>(r)][static_cast<std::size_t>(input)];
        EXPECT_LT(std::abs(ours(r, input) - right), 1e-10 * std::abs(right))
            << "row " << r << ", input " << input << ", w " << w << ", p "
            << reference.bandwidths.size() << ", T " << reference.sample_time;
      }
    }
  }
}

template <class Observer>
std::function<ComplexMatrix(double)> response_of(const Observer& observer) {
  return [system = observer_system(observer)](double w) {
    const auto response = frequency_response(system, w).value();
    ComplexMatrix all(Observer::size, 2);
    for (int r = 0; r < Observer::size; ++r) {
      for (int input = 0; input < 2; ++input) all(r, input) = response(r, input);
    }
    return all;
  };
}

template <int Order, int Levels, int Extension>
void check_sampled(double bandwidth) {
  for (const double wT : {1e-3, 0.3, 2.0}) {
    const double T = wT / bandwidth;
    std::vector<double> grid;
    for (const double share : {0.2, 0.9, 7.0, 60.0}) grid.push_back(share * bandwidth);
    std::erase_if(grid, [&](double w) { return w > std::numbers::pi / T; });
    grid.push_back(0.98 * std::numbers::pi / T);  // at pi / T itself some responses are zero
    expect_equal(response_of(sampled<Order, Levels, Extension>(bandwidth, T)),
                 reference<Order, Levels, Extension>(bandwidth, T), grid);
  }
}

template <int Order, int Levels, int Extension>
void check_continuous(double bandwidth) {
  expect_equal(response_of(continuous<Order, Levels, Extension>(bandwidth)),
               reference<Order, Levels, Extension>(bandwidth, 0.0),
               {0.1 * bandwidth, bandwidth, 10.0 * bandwidth, 300.0 * bandwidth});
}

TEST(FrequencyResponse, EqualsAnIndependentStateSpace) {
  check_sampled<2, 1, 1>(60.0);
  check_sampled<2, 2, 1>(60.0);
  check_sampled<2, 1, 2>(60.0);
  check_sampled<1, 4, 1>(20.0);
  check_sampled<3, 2, 2>(5.0);
  check_continuous<2, 1, 1>(60.0);
  check_continuous<2, 2, 1>(60.0);
  check_continuous<3, 1, 1>(5.0);
  check_continuous<1, 3, 3>(7.0);
}

// The response must be that of the object that a user runs: the sum of its impulse response.
template <class Observer>
void expect_response_of_update(const Observer& observer, double frequency) {
  const ComplexMatrix response = response_of(observer)(frequency);
  const double T = observer.sample_time();
  for (int input = 0; input < 2; ++input) {
    Observer running = observer;
    std::array<Complex, Observer::size> sum{};
    for (int k = 0; k < 20000; ++k) {
      // y[0] = 1 arrives with the first update, the input held from 0 to 1 with the second.
      running.update(input == 0 && k == 0 ? 1.0 : 0.0, input == 1 && k == 1 ? 1.0 : 0.0);
      const Complex turn = std::polar(1.0, -frequency * T * k);
      const auto estimate = running.estimate();
      for (int r = 0; r < Observer::size; ++r)
        sum[static_cast<std::size_t>(r)] += estimate(r) * turn;
    }
    for (int r = 0; r < Observer::size; ++r) {
      const Complex right = response(r, input);
      EXPECT_LT(std::abs(sum[static_cast<std::size_t>(r)] - right), 1e-9 * std::abs(right))
          << "row " << r << ", input " << input;
    }
  }
}

TEST(FrequencyResponse, IsThatOfTheRunningObserver) {
  expect_response_of_update(sampled<2, 1, 1>(20.0, 1e-3), 9.0);
  expect_response_of_update(sampled<1, 4, 1>(20.0, 2e-3), 5.0);
  expect_response_of_update(sampled<3, 2, 2>(40.0, 1e-3), 100.0);
}

TEST(FrequencyResponse, OfASettledAlgebraicObserverIsThatOfItsFinalBandwidth) {
  auto algebraic = AlgebraicEso<2>::make({.observer_bandwidth = 30.0,
                                          .frequency_shift = 40.0,
                                          .input_gain = b0,
                                          .sample_time = 1e-3})
                       .value();
  for (int k = 0; k < 20000 && !algebraic.settled(); ++k) algebraic.update(0.0, 0.0);
  ASSERT_TRUE(algebraic.settled());
  const auto linear =
      LinearEso<2>::make({.observer_bandwidth = 30.0, .input_gain = b0, .sample_time = 1e-3});
  const auto a = frequency_response(observer_system(algebraic), 20.0).value();
  const auto b = frequency_response(observer_system(*linear), 20.0).value();
  for (int r = 0; r < 3; ++r) {
    for (int i = 0; i < 2; ++i) EXPECT_LT(std::abs(a(r, i) - b(r, i)), 1e-11 * std::abs(b(r, i)));
  }
}

// One level can be probed: reset, predict and correct from unit states. What comes out is A, in
// which A - I has lost digits; built from the gains it has not.
TEST(FrequencyResponse, SystemFromGainsIsTheProbedOne) {
  auto observer = sampled<2, 1, 2>(25.0, 1e-3);
  const auto m = detail::observer_matrices(observer);
  for (int j = 0; j < 4; ++j) {
    const EigenMatrix<double, 4> unit = EigenMatrix<double, 4>::Unit(j);
    observer.reset(unit);
    observer.correct(0.0);
    const EigenMatrix<double, 4> corrected = observer.estimate();
    observer.predict(0.0);
    const EigenMatrix<double, 4> next = observer.estimate();
    for (int i = 0; i < 4; ++i) {
      const double size = std::max(1.0, std::abs(next(i)));
      EXPECT_NEAR(corrected(i), m.c(i, j), 1e-13 * std::max(1.0, std::abs(corrected(i))));
      EXPECT_NEAR(next(i), m.a(i, j) + (i == j ? 1.0 : 0.0), 1e-13 * size);
    }
  }
  observer.reset(0.0);
  observer.correct(1.0);
  const EigenMatrix<double, 4> corrected = observer.estimate();
  observer.predict(0.0);
  const EigenMatrix<double, 4> next = observer.estimate();
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(corrected(i), m.dy(i), 1e-13 * std::abs(m.dy(i)));
    EXPECT_NEAR(next(i), m.by(i), 1e-13 * std::abs(m.by(i)));
  }
}

template <class Observer>
void expect_static_gains(const Observer& observer) {
  constexpr int n = Observer::order;
  const auto response = frequency_response(estimation_system(observer), 0.0).value();
  // A constant disturbance is found whole, its derivatives are zero, the states have no error.
  for (int r = 0; r < Observer::size; ++r) {
    const double from_d = r == n ? 1.0 : 0.0;
    EXPECT_NEAR(response(r, 1).real(), from_d, 1e-12) << "row " << r;
    EXPECT_EQ(response(r, 1).imag(), 0.0);
  }
  EXPECT_NEAR(response(0, 0).real(), 1.0, 1e-12);
  const auto of_y = frequency_response(observer_system(observer), 0.0).value();
  EXPECT_NEAR(of_y(0, 0).real(), 1.0, 1e-12);
  // y and u of a plant at rest, b0 u + d = 0, must not disagree: u = 1 is seen as d = -b0.
  EXPECT_NEAR(of_y(n, 1).real(), -b0, 1e-10);
}

TEST(FrequencyResponse, StaticGains) {
  expect_static_gains(sampled<2, 1, 1>(60.0, 1e-3));
  expect_static_gains(sampled<1, 4, 1>(60.0, 1e-4));
  expect_static_gains(sampled<3, 2, 2>(20.0, 1e-2));
  expect_static_gains(continuous<2, 1, 1>(60.0));
  expect_static_gains(continuous<1, 3, 3>(10.0));
}

// Above its bandwidth an estimate of row r follows y as l_r / (i w); a cascade falls by one more
// power a level for the plant states, and stays with the slow first gain for the disturbance.
TEST(FrequencyResponse, HighFrequencyLimits) {
  const double w = 1e5;
  const auto one = frequency_response(observer_system(continuous<2, 1, 1>(60.0)), w).value();
  const double l[] = {3.0 * 60.0, 3.0 * 3600.0, 216000.0};
  for (int r = 0; r < 3; ++r) EXPECT_NEAR(std::abs(one(r, 0)) * w / l[r], 1.0, 0.01);
  const auto two = frequency_response(observer_system(continuous<2, 2, 1>(60.0)), w).value();
  EXPECT_NEAR(std::abs(two(0, 0)) * w * w / (l[0] * 3.0 * 108.0), 1.0, 0.01);
  EXPECT_NEAR(std::abs(two(2, 0)) * w / l[2], 1.0, 0.02);

  // From d to dhat: omega^N / (s + omega)^N.
  const auto d = frequency_response(estimation_system(continuous<2, 1, 1>(60.0)), 200.0).value();
  const Complex expected = std::pow(60.0 / Complex(60.0, 200.0), 3.0);
  EXPECT_LT(std::abs(d(2, 1) - expected), 1e-13);
}

TEST(FrequencyResponse, SampledTendsToContinuous) {
  const auto exact = frequency_response(observer_system(continuous<2, 2, 1>(20.0)), 30.0).value();
  double before = 0.0;
  for (const double T : {2e-4, 1e-4}) {
    const auto ours = frequency_response(observer_system(sampled<2, 2, 1>(20.0, T)), 30.0).value();
    const double error = std::abs(ours(2, 0) - exact(2, 0)) / std::abs(exact(2, 0));
    EXPECT_LT(error, 0.05);
    if (before > 0.0) {
      EXPECT_NEAR(before / error, 2.0, 0.05);  // order 1
    }
    before = error;
  }
}

TEST(FrequencyResponse, WhatDoesNotExistIsAnError) {
  const auto system = observer_system(sampled<2, 1, 1>(60.0, 1e-3));
  EXPECT_TRUE(frequency_response(system, std::numbers::pi / 1e-3).has_value());
  const auto above = frequency_response(system, 3200.0);
  ASSERT_EQ(refusal(above), "frequency: must not be above the Nyquist frequency");
  EXPECT_NEAR(above.error().limit, 3141.59, 0.01);
  EXPECT_EQ(refusal(frequency_response(system, -1.0)),
            "frequency: must be finite and not negative");
  EXPECT_EQ(refusal(frequency_response(system, std::numeric_limits<double>::quiet_NaN())),
            "frequency: must be finite and not negative");

  LinearSystem<1, 1, 1> integrator;
  integrator.b(0, 0) = 1.0;
  integrator.c(0, 0) = 1.0;
  EXPECT_EQ(refusal(frequency_response(integrator, 0.0)), "frequency: is a pole of the system");
  EXPECT_NEAR(frequency_response(integrator, 2.0).value()(0, 0).imag(), -0.5, 1e-15);
}

TEST(LogGrid, EndsAndRatios) {
  const auto grid = log_grid<7>(1e-2, 1e4).value();
  EXPECT_EQ(grid.front(), 1e-2);
  EXPECT_EQ(grid.back(), 1e4);
  for (std::size_t i = 1; i < grid.size(); ++i) EXPECT_NEAR(grid[i] / grid[i - 1], 10.0, 1e-12);
  EXPECT_EQ(refusal(log_grid<3>(0.0, 1.0)), "from: must be finite and positive");
  EXPECT_EQ(refusal(log_grid<3>(2.0, 1.0)), "to: must be finite and above");
}

TEST(Bode, MagnitudesAndPhaseWithoutJumps) {
  const auto system = estimation_system(continuous<3, 1, 1>(10.0));  // 10^4 / (s + 10)^4
  const auto grid = log_grid<40>(0.1, 1e4).value();
  const auto curve = bode<1, 3>(system, grid).value();
  for (std::size_t i = 0; i < grid.size(); ++i) {
    EXPECT_NEAR(curve.phase[i], -4.0 * std::atan(grid[i] / 10.0), 1e-9);
    EXPECT_NEAR(curve.decibel[i], -40.0 * std::log10(1.0 + grid[i] * grid[i] / 100.0), 1e-9);
    EXPECT_NEAR(curve.magnitude[i], std::pow(10.0, curve.decibel[i] / 20.0),
                1e-12 * curve.magnitude[i]);
  }
  const auto bad = log_grid<4>(1.0, 1e5).value();
  EXPECT_EQ(refusal((bode<0, 0>(observer_system(sampled<2, 1, 1>(1.0, 1e-3)), bad))),
            "frequency: must not be above the Nyquist frequency");
}

TEST(ObserverSystem, NamesAndFloat) {
  const auto system = observer_system(sampled<2, 1, 2>(10.0, 1e-3));
  EXPECT_STREQ(system.input_names[0], "y");
  EXPECT_STREQ(system.output_names[1], "yhat'");
  EXPECT_STREQ(system.output_names[2], "dhat");
  EXPECT_STREQ(system.output_names[3], "dhat'");
  const auto narrow = LinearEso<2, float>::make(
      {.observer_bandwidth = 10.0f, .input_gain = -3.0f, .sample_time = 1e-3f});
  const auto a = frequency_response(observer_system(*narrow), 8.0).value();
  const auto b = frequency_response(observer_system(sampled<2, 1, 1>(10.0, 1e-3)), 8.0).value();
  EXPECT_LT(std::abs(a(2, 0) - b(2, 0)), 1e-5 * std::abs(b(2, 0)));
  EXPECT_GT(std::abs(a(2, 0) - b(2, 0)), 0.0);
}

}  // namespace analysis_frequency_response_test
