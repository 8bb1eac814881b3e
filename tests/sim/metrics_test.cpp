// Criteria: against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/sim/metrics.hpp>
#include <limits>
#include <numbers>
#include <vector>

namespace sim_metrics_test {

using namespace esokit::sim;

template <class F>
std::vector<double> sampled(F&& f, double h, int count, double start = 0.0) {
  std::vector<double> values;
  for (int k = 0; k < count; ++k) values.push_back(f(start + k * h));
  return values;
}

Series<> uniform(const std::vector<double>& values, double h, double start = 0.0) {
  return Series<>::make_uniform({.start = start, .sample_time = h, .values = values}).value();
}

TEST(Metrics, IntegralsOfALine) {
  // e = t - 1 on [0, 3], samples on the zero: the trapezoid rule is exact for e and abs(e).
  const auto values = sampled([](double t) { return t - 1.0; }, 0.25, 13);
  const auto e = uniform(values, 0.25);
  EXPECT_DOUBLE_EQ(integral(e), 1.5);
  EXPECT_DOUBLE_EQ(integral_abs(e), 0.5 + 2.0);
  // For e^2 it is too large by h^2/12 (f'(b) - f'(a)) = h^2/12 * 6.
  EXPECT_DOUBLE_EQ(integral_square(e), 3.0 + 0.0625 / 2);
  EXPECT_DOUBLE_EQ(*rms(e), std::sqrt((3.0 + 0.0625 / 2) / 3.0));
}

TEST(Metrics, IntegralsOfADecay) {
  const double h = 1e-3;
  const auto values = sampled([](double t) { return -std::exp(-t); }, h, 30001);
  const auto e = uniform(values, h);
  // The trapezoid rule errs by h^2/12 times the jump of f' over the interval.
  EXPECT_NEAR(integral_abs(e), 1.0 + h * h / 12, 1e-12);
  EXPECT_NEAR(integral(e), -1.0 - h * h / 12, 1e-12);
  EXPECT_NEAR(integral_square(e), 0.5 + h * h / 6, 1e-12);
  EXPECT_NEAR(integral_time_abs(e), 1.0 - h * h / 12, 1e-11);
  // Time counted from 2: int (t - 2) e^-t = -1.
  EXPECT_NEAR(integral_time_abs(e, {}, 2.0), -1.0 - 3 * h * h / 12, 1e-11);
}

TEST(Metrics, WindowCutsWithinSegments) {
  const auto values = sampled([](double t) { return 2.0 * t; }, 0.5, 9);
  const auto e = uniform(values, 0.5);
  const auto window = [](double start, double end) {
    return Window<>::make({.start = start, .end = end}).value();
  };
  EXPECT_DOUBLE_EQ(integral(e, window(0.6, 0.8)), 0.64 - 0.36);  // inside one segment
  EXPECT_DOUBLE_EQ(integral(e, window(0.6, 3.1)), 3.1 * 3.1 - 0.36);
  EXPECT_DOUBLE_EQ(integral(e, window(1.0, 2.0)), 3.0);
  EXPECT_DOUBLE_EQ(integral(e, window(3.5, 10.0)), 16.0 - 12.25);
  EXPECT_EQ(integral(e, window(5.0, 6.0)), 0.0);
  EXPECT_DOUBLE_EQ(*rms(e, window(1.0, 2.0)), std::sqrt((4 + 9) / 4.0 + (9 + 16) / 4.0));
  EXPECT_FALSE(rms(e, window(5.0, 6.0)));
  EXPECT_FALSE(peak(e, window(5.0, 6.0)));
  EXPECT_EQ(peak(e, window(0.9, 2.1))->time, 2.0);
  EXPECT_EQ(peak(e, window(1.0, 2.0))->value, 4.0);
}

TEST(Metrics, UnevenTimesAndJumps) {
  const std::vector<double> times{0.0, 1.0, 1.0, 4.0};
  const std::vector<double> values{0.0, 2.0, -1.0, -1.0};
  const auto e = Series<>::make({.times = times, .values = values}).value();
  EXPECT_DOUBLE_EQ(integral(e), 1.0 - 3.0);
  EXPECT_DOUBLE_EQ(integral_abs(e), 1.0 + 3.0);
}

TEST(Metrics, TrapezoidInALoop) {
  Trapezoid<> sum;
  EXPECT_EQ(sum.value(), 0.0);
  EXPECT_TRUE(sum.add(0.0, 1.0));
  EXPECT_EQ(sum.value(), 0.0);
  EXPECT_TRUE(sum.add(2.0, 3.0));
  EXPECT_EQ(sum.value(), 4.0);
  EXPECT_EQ(sum.duration(), 2.0);
  EXPECT_FALSE(sum.add(1.0, 100.0));
  EXPECT_FALSE(sum.add(std::numeric_limits<double>::quiet_NaN(), 100.0));
  EXPECT_EQ(sum.value(), 4.0);
  EXPECT_TRUE(sum.add(3.0, 3.0));
  EXPECT_EQ(sum.value(), 7.0);
  EXPECT_TRUE(sum.add(4.0, std::numeric_limits<double>::quiet_NaN()));
  EXPECT_TRUE(std::isnan(sum.value()));
  sum.reset();
  EXPECT_EQ(sum.value(), 0.0);
  EXPECT_TRUE(sum.add(0.0, 1.0));
  EXPECT_EQ(sum.duration(), 0.0);
}

TEST(Metrics, Peak) {
  const auto values =
      sampled([](double t) { return std::exp(-t) * std::sin(4.0 * t); }, 0.001, 5000);
  std::vector<double> negated(values);
  for (double& value : negated) value = -value;
  const auto found = peak(uniform(negated, 0.001)).value();
  const double time = std::atan(4.0) / 4.0;
  EXPECT_NEAR(found.time, time, 0.0006);
  EXPECT_NEAR(found.magnitude, std::exp(-time) * std::sin(4.0 * time), 2e-6);
  EXPECT_EQ(found.value, -found.magnitude);
  const std::vector<double> ties{1.0, -3.0, 3.0};
  EXPECT_EQ(peak(uniform(ties, 1.0))->time, 1.0);
  PeakMeter<> meter;
  EXPECT_FALSE(meter.value());
  EXPECT_TRUE(meter.add(0.0, 1.0));
  EXPECT_FALSE(meter.add(1.0, std::numeric_limits<double>::infinity()));
  EXPECT_FALSE(meter.value());
  meter.reset();
  EXPECT_TRUE(meter.add(0.0, 0.0));
  EXPECT_EQ(meter.value()->magnitude, 0.0);
}

TEST(StepResponse, SecondOrderLag) {
  // Damping 0.5, natural frequency 2, from 3 down to 1 at t = 0.7.
  const double damping = 0.5;
  const double omega = 2.0;
  const double damped = omega * std::sqrt(1 - damping * damping);
  const auto unit = [&](double t) {
    return 1 - std::exp(-damping * omega * t) *
                   (std::cos(damped * t) + damping * omega / damped * std::sin(damped * t));
  };
  const auto y = [&](double t) { return t < 0.7 ? 3.0 : 3.0 - 2.0 * unit(t - 0.7); };
  const double h = 1e-4;
  const auto values = sampled(y, h, 200001);
  const auto response =
      step_response(uniform(values, h),
                    {.initial_value = 3.0, .final_value = 1.0, .step_time = 0.7, .band = 0.05})
          .value();
  const auto bisected = [&](double level, double low, double high) {
    for (int i = 0; i < 100; ++i) {
      const double middle = 0.5 * (low + high);
      ((unit(middle) - level) * (unit(high) - level) > 0 ? high : low) = middle;
    }
    return low;
  };
  EXPECT_NEAR(*response.overshoot(), std::exp(-std::numbers::pi * damping * omega / damped), 1e-7);
  EXPECT_NEAR(*response.rise_time(), bisected(0.9, 0, 1.5) - bisected(0.1, 0, 0.5), 1e-7);
  // The overshoot is 16 %, the undershoot 2.7 %: it enters the band for good on the way down.
  EXPECT_NEAR(*response.settling_time(), bisected(1.05, 1.9, 3.6), 1e-7);
}

TEST(StepResponse, FirstOrderLag) {
  const double h = 1e-3;
  const auto values = sampled([](double t) { return 1 - std::exp(-t); }, h, 10001);
  const auto response = step_response(uniform(values, h), {}).value();
  EXPECT_EQ(*response.overshoot(), 0.0);
  EXPECT_NEAR(*response.rise_time(), std::log(9.0), 1e-5);
  EXPECT_NEAR(*response.settling_time(), std::log(50.0), 1e-5);
  const auto custom =
      step_response(uniform(values, h), {.band = 0.01, .rise_from = 0.0, .rise_to = 0.5}).value();
  EXPECT_NEAR(*custom.settling_time(), std::log(100.0), 1e-4);
  EXPECT_NEAR(*custom.rise_time(), std::log(2.0), 1e-5);
}

TEST(StepResponse, WhatDoesNotExist) {
  const auto measure = [](std::vector<double> values) {
    return step_response(uniform(values, 1.0), {}).value();
  };
  EXPECT_FALSE(measure({}).overshoot());
  EXPECT_FALSE(measure({}).settling_time());
  EXPECT_FALSE(measure({0.0, 0.5}).rise_time());
  EXPECT_FALSE(measure({0.0, 0.5}).settling_time());
  EXPECT_FALSE(measure({0.0, 1.0, 1.0, 1.3}).settling_time());
  EXPECT_DOUBLE_EQ(*measure({0.0, 2.0, 0.0, 1.0, 1.0}).settling_time(), 2.98);
  EXPECT_EQ(measure({1.0, 1.0}).settling_time(), 0.0);
  EXPECT_EQ(measure({1.0, 1.0}).rise_time(), 0.0);
  EXPECT_DOUBLE_EQ(*measure({0.0, 2.0}).overshoot(), 1.0);
  auto spoilt = measure({0.0, 1.0});
  EXPECT_TRUE(spoilt.settling_time());
  EXPECT_FALSE(spoilt.add(2.0, std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(spoilt.overshoot());
  EXPECT_FALSE(spoilt.settling_time());
  EXPECT_FALSE(spoilt.rise_time());
  spoilt.reset();
  EXPECT_TRUE(spoilt.add(0.0, 1.0));
  EXPECT_TRUE(spoilt.add(1.0, 1.0));
  EXPECT_TRUE(spoilt.overshoot());
  EXPECT_FALSE(spoilt.add(0.5, 1.0));
  EXPECT_FALSE(spoilt.overshoot());
}

/// Two samples at one time are a jump; only a time before the last one is refused.
TEST(StepResponse, TwoSamplesAtOneTime) {
  auto response = step_response(uniform(std::vector<double>{0.0, 0.0}, 1.0), {}).value();
  EXPECT_TRUE(response.add(1.0, 1.2));
  EXPECT_TRUE(response.add(2.0, 1.0));
  EXPECT_EQ(response.rise_time(), 0.0);
  EXPECT_NEAR(*response.overshoot(), 0.2, 1e-15);
  EXPECT_FALSE(response.add(std::nextafter(2.0, 0.0), 1.0));
  EXPECT_FALSE(response.rise_time());
}

TEST(StepResponse, PassesOverWhatIsBeforeTheStep) {
  const std::vector<double> values{5.0, 5.0, 0.0, 1.0, 1.0};
  const auto response = step_response(uniform(values, 1.0), {.step_time = 2.0}).value();
  EXPECT_EQ(*response.overshoot(), 0.0);
  EXPECT_DOUBLE_EQ(*response.settling_time(), 0.98);
  EXPECT_DOUBLE_EQ(*response.rise_time(), 0.8);
}

TEST(Metrics, WorkInFloat) {
  const std::vector<float> values{0.0F, 1.0F, 1.0F};
  const auto e = Series<float>::make_uniform({.sample_time = 0.5F, .values = values}).value();
  EXPECT_FLOAT_EQ(integral_abs(e), 0.75F);
  EXPECT_FLOAT_EQ(*step_response(e, {}).value().rise_time(), 0.4F);
}

}  // namespace sim_metrics_test
