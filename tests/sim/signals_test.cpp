// Signals: values and derivatives against 50-digit references, Taylor series and integration.
#include <gtest/gtest.h>

#include <array>
#include <boost/math/special_functions/binomial.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <esokit/core/matrix.hpp>
#include <esokit/eigen.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <esokit/sim/signals.hpp>

namespace sim_signals_test {

using namespace esokit;
using namespace esokit::sim;
using Precise = boost::multiprecision::cpp_bin_float_50;

static_assert(DifferentiableSignal<Constant<>> && DifferentiableSignal<Step<>>);
static_assert(DifferentiableSignal<Sine<>> && DifferentiableSignal<FilteredStep<5>>);
static_assert(DifferentiableSignal<Sum<Sine<>, Step<>>>);
static_assert(DifferentiableSignal<Sum<Sine<float>, Constant<float>>, float>);
// A float signal in a double simulation would lose digits unseen.
static_assert(!Signal<Sine<float>, double>);
constexpr auto lambda = [](double t) { return t; };
static_assert(Signal<decltype(lambda)> && !DifferentiableSignal<decltype(lambda)>);
static_assert(!Signal<int>);

// The derivatives at t must foretell the value at t + h.
template <class S>
void expect_taylor(const S& s, double t, double h, double tolerance) {
  const auto d = s.template derivatives<14>(t);
  EXPECT_DOUBLE_EQ(d[0], s(t));
  double sum = 0.0;
  double power = 1.0;
  for (std::size_t j = 0; j < d.size(); ++j) {
    sum += d[j] * power;
    power *= h / static_cast<double>(j + 1);
  }
  EXPECT_NEAR(sum, s(t + h), tolerance) << t;
}

TEST(Signals, Constant) {
  const auto s = Constant<>::make({.value = 3.0}).value();
  EXPECT_EQ(s(-5.0), 3.0);
  EXPECT_EQ(s.derivatives<3>(1.0), (std::array<double, 3>{3.0, 0.0, 0.0}));
  EXPECT_EQ(Constant<>{}(1.0), 0.0);
}

TEST(Signals, StepIncludesItsStart) {
  const auto s = Step<>::make({.time = 2.0, .size = -4.0}).value();
  EXPECT_EQ(s(std::nextafter(2.0, 0.0)), 0.0);
  EXPECT_EQ(s(2.0), -4.0);
  EXPECT_EQ(s.derivatives<3>(2.0), (std::array<double, 3>{-4.0, 0.0, 0.0}));
  EXPECT_EQ(s.derivatives<3>(1.0), (std::array<double, 3>{}));
}

TEST(Signals, SineAgainstFiftyDigits) {
  const auto s =
      Sine<>::make({.amplitude = 2.5, .angular_frequency = 3.0, .phase = 0.25, .offset = -1.0})
          .value();
  for (const double t : {-2.0, 0.0, 0.5, 7.25}) {
    const auto d = s.derivatives<10>(t);
    EXPECT_DOUBLE_EQ(d[0], s(t));
    for (std::size_t j = 0; j < d.size(); ++j) {
      const Precise quarter = boost::math::constants::half_pi<Precise>() * static_cast<int>(j);
      Precise exact = 2.5 * sin(Precise(3.0 * t + 0.25) + quarter);
      for (std::size_t k = 0; k < j; ++k) exact *= 3;
      if (j == 0) exact -= 1;
      EXPECT_NEAR(d[j], static_cast<double>(exact), 4e-16 * 2.5 * std::pow(3.0, j))
          << t << ' ' << j;
    }
    expect_taylor(s, t, 0.1, 2e-14);  // the argument is rounded to 4e-15
  }
}

// The stages of the filter are regularised incomplete gamma functions P(k, x), and x_k' =
// (x_{k-1} - x_k)/tau with x_0 = x_-1 = .. = 1: a closed form that shares nothing with the code.
template <int Order>
Precise filter_derivative(int j, const Precise& x, const Precise& tau) {
  const auto stage = [&](int k) -> Precise {
    if (k <= 0) return 1;
    return boost::math::gamma_p(Precise(k), x);
  };
  Precise sum = 0;
  for (int i = 0; i <= j; ++i) {
    const Precise weight = boost::math::binomial_coefficient<double>(static_cast<unsigned>(j),
                                                                     static_cast<unsigned>(i));
    sum += ((j - i) % 2 == 0 ? weight : -weight) * stage(Order - i);
  }
  return sum / pow(tau, j);
}

template <int Order>
void expect_exact_filter() {
  const double tau = 0.125;
  const double start = 0.25;
  const auto s =
      FilteredStep<Order>::make({.time = start, .size = 2.0, .time_constant = tau}).value();
  for (const double x : {1e-3, 0.1, 0.75, 1.0, 2.5, 5.75, 6.5, 12.0, 40.0}) {
    const double t = start + x * tau;
    const auto d = s.template derivatives<9>(t);
    const Precise exact_x = (Precise(t) - start) / tau;
    const double value = static_cast<double>(2 * filter_derivative<Order>(0, exact_x, tau));
    EXPECT_NEAR(d[0], value, 1e-14 * value) << Order << ' ' << x;
    for (int j = 1; j < 9; ++j) {
      const double exact = static_cast<double>(2 * filter_derivative<Order>(j, exact_x, tau));
      EXPECT_NEAR(d[static_cast<std::size_t>(j)], exact, 1e-14 * std::pow(2.0 / tau, j))
          << Order << ' ' << x << ' ' << j;
    }
    if (x > 0.5) expect_taylor(s, t, 0.25 * tau, 1e-13);
  }
}

TEST(Signals, FilteredStepAgainstFiftyDigits) {
  expect_exact_filter<1>();
  expect_exact_filter<2>();
  expect_exact_filter<3>();
  expect_exact_filter<5>();
  expect_exact_filter<8>();
}

TEST(Signals, FilteredStepAgainstIntegration) {
  const double tau = 0.1;
  const auto s = FilteredStep<5>::make({.time = 0.2, .time_constant = tau}).value();
  using State = EigenMatrix<double, 5>;
  const auto filter = [tau](double /*t*/, const State& x) -> State {
    State rate;
    rate[0] = (1.0 - x[0]) / tau;
    for (int i = 1; i < 5; ++i) rate[i] = (x[i - 1] - x[i]) / tau;
    return rate;
  };
  State x = State::Zero();
  const double h = 1e-4;
  for (int k = 0; k < 20000; ++k) {
    x = step(filter, 0.0, x, h);
    if (k % 500 != 0) continue;
    const auto d = s.derivatives<3>(0.2 + (k + 1) * h);
    const State rate = filter(0.0, x);
    ASSERT_NEAR(d[0], x[4], 2e-12) << k;
    ASSERT_NEAR(d[1], rate[4], 2e-11) << k;
    ASSERT_NEAR(d[2], (rate[3] - rate[4]) / tau, 2e-10) << k;
  }
}

TEST(Signals, FilteredStepStartAndEnd) {
  const auto s = FilteredStep<3>::make({.time = 1.0, .size = 4.0, .time_constant = 0.5}).value();
  EXPECT_EQ(s.derivatives<5>(std::nextafter(1.0, 0.0)), (std::array<double, 5>{}));
  // From the right: only the derivative 3 jumps to size/tau^3, 4 follows as -3 size/tau^4.
  EXPECT_EQ(s.derivatives<5>(1.0), (std::array<double, 5>{0.0, 0.0, 0.0, 32.0, -192.0}));
  EXPECT_EQ(s(100.0), 4.0);
  const auto far = s.derivatives<5>(1e300);
  EXPECT_EQ(far, (std::array<double, 5>{4.0, 0.0, 0.0, 0.0, 0.0}));
  const auto f = FilteredStep<5, float>::make({.time_constant = 0.1F}).value();
  EXPECT_EQ(f(3e38F), 1.0F);
  EXPECT_NEAR(f(0.05F), 1.7211563e-4F, 1e-10F);  // P(5, 0.5)
}

TEST(Signals, SumAddsAllDerivatives) {
  const auto sine = Sine<>::make({.angular_frequency = 2.0}).value();
  const auto slow = Sine<>::make({.amplitude = 3.0, .offset = 1.0}).value();
  const Sum s{sine, slow};
  const auto d = s.derivatives<3>(0.5);
  EXPECT_DOUBLE_EQ(d[0], std::sin(1.0) + 3.0 * std::sin(0.5) + 1.0);
  EXPECT_DOUBLE_EQ(d[1], 2.0 * std::cos(1.0) + 3.0 * std::cos(0.5));
  EXPECT_DOUBLE_EQ(d[2], -4.0 * std::sin(1.0) - 3.0 * std::sin(0.5));
  EXPECT_DOUBLE_EQ(s(0.5), d[0]);
  expect_taylor(s, 0.5, 0.1, 1e-14);
}

TEST(Signals, AreConstantExpressionsWhereTheyCanBe) {
  constexpr auto s = Step<float>::make({.time = 1.0F}).value();
  static_assert(s(2.0F) == 1.0F && s(0.5F) == 0.0F);
}

}  // namespace sim_signals_test
