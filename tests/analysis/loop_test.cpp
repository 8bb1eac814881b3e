// The closed loop against a run of the real controller on a plant that is integrated in small
// steps, and its transfer functions against their definitions.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/loop_response.hpp>
#include <esokit/analysis/peak_gain.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <numbers>
#include <support/refusal.hpp>
#include <vector>

#include "support/numbers.hpp"

namespace analysis_loop_test {

using esokit_test::Random;
using esokit_test::refusal;

using namespace esokit;
using Complex = std::complex<double>;
using Plant = LinearPlant<2>;
using Observer = CascadeEso<2, 2>;

constexpr double T = 0.01;

Plant plant(double dead_time = 0.0) {
  return Plant::chain({.coefficients = {3.0, 0.4}, .input_gain = 2.5, .dead_time = dead_time})
      .value();
}
template <class Form = OutputBased>
Adrc<Observer, Form> controller(double sample_time = T) {
  return Adrc<Observer, Form>::make({.observer = {.observer_bandwidth = 20.0,
                                                  .bandwidth_factor = 2.0,
                                                  .input_gain = 2.0,
                                                  .sample_time = sample_time},
                                     .controller_bandwidth = 4.0})
      .value();
}

/// A plant under u(t - dead_time), by the classical Runge-Kutta method in small steps: neither the
/// sampling nor the algebra of the loop is shared.
template <int States, int Channels>
struct SteppedPlant {
  using Linear = LinearPlant<States, double, Channels, Channels>;
  Linear plant;
  typename Linear::State x{};
  std::vector<typename Linear::Input> sent{};

  void hold(const typename Linear::Input& u, const typename Linear::Input& d) {
    sent.push_back(u);
    const int steps = 200;  // dead times of the tests are multiples of a step
    const double h = T / steps;
    const auto late = static_cast<long>(std::lround(plant.dead_time / h));
    const long start = static_cast<long>(sent.size() - 1) * steps;
    for (long i = 0; i < steps; ++i) {
      const long at = start + i - late;
      const auto held =
          at < 0 ? typename Linear::Input{} : sent[static_cast<std::size_t>(at / steps)];
      const auto k1 = plant.derivative(x, held, d);
      const auto k2 = plant.derivative(x + 0.5 * h * k1, held, d);
      const auto k3 = plant.derivative(x + 0.5 * h * k2, held, d);
      const auto k4 = plant.derivative(x + h * k3, held, d);
      x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
  }
};

Plant::Input one(double value) { return Plant::Input(value); }

/// x of a loop's system, one sample on; out of it.
struct Model {
  DynamicSystem system;
  std::vector<double> x = std::vector<double>(static_cast<std::size_t>(system.a.rows()));

  std::vector<double> step(const std::vector<double>& w) {
    const auto times = [](const DynamicMatrix<double>& m, const std::vector<double>& v) {
      std::vector<double> out(static_cast<std::size_t>(m.rows()));
      for (int i = 0; i < m.rows(); ++i) {
        for (int j = 0; j < m.cols(); ++j) {
          out[static_cast<std::size_t>(i)] += m(i, j) * v[static_cast<std::size_t>(j)];
        }
      }
      return out;
    };
    const auto from_x = times(system.c, x);
    auto out = times(system.d, w);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += from_x[i];
    const auto rate = times(system.a, x);
    const auto driven = times(system.b, w);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += rate[i] + driven[i];
    return out;
  }
};

template <class Form>
void expect_same_run(double dead_time) {
  SCOPED_TRACE(dead_time);
  auto real = controller<Form>();
  const auto loop = closed_loop(plant(dead_time), real).value();
  EXPECT_EQ(loop.sample_time(), T);
  EXPECT_EQ(loop.input_gain(), 2.0);
  EXPECT_EQ(loop.stable(), dead_time < 2.1 * T);
  Model model{loop.system()};
  SteppedPlant<2, 1> run{plant(dead_time)};
  for (int k = 0; k < 300; ++k) {
    const double r = 1.0;
    const double v = 0.1 * std::sin(0.7 * k);
    const double d = k >= 100 ? 2.0 : 0.5;
    const auto outputs = model.step({r, v, d});
    const double y = run.x(0);
    const double u = real.update(y + v, r);
    ASSERT_NEAR(outputs[0], y, 1e-9);
    ASSERT_NEAR(outputs[1], u, 1e-8);
    for (int i = 0; i < 3; ++i) {
      ASSERT_NEAR(outputs[static_cast<std::size_t>(2 + i)], real.observer().estimate()(i), 1e-8);
    }
    run.hold(one(u), one(d));
  }
}

TEST(Loop, IsTheRunningLoop) {
  for (const double dead_time : {0.0, 0.25 * T, T, 2.0 * T, 2.3 * T}) {
    expect_same_run<OutputBased>(dead_time);
  }
  expect_same_run<ErrorBased>(0.0);
  // The loop gain does not depend on the form.
  const auto one = closed_loop(plant(), controller<OutputBased>()).value();
  const auto other = closed_loop(plant(), controller<ErrorBased>()).value();
  for (const double w : {0.5, 8.0, 200.0}) {
    const Complex l = one.loop_gain(w).value();
    EXPECT_LT(std::abs(l - other.loop_gain(w).value()), 1e-11 * std::abs(l));
  }
}

/// Two masses that pull at each other, behind a coupled input.
LinearPlant<4, double, 2, 2> coupled(double coupling, double dead_time = 0.0) {
  LinearPlant<4, double, 2, 2> two;
  two.a = {{0.0, 1.0, 0.0, 0.0},
           {-3.0, -0.4, coupling, 0.0},
           {0.0, 0.0, 0.0, 1.0},
           {coupling, 0.0, -5.0, -0.6}};
  two.b = {{0.0, 0.0}, {2.5, 0.3}, {0.0, 0.0}, {-0.6, 1.8}};
  two.e = {{0.0, 0.0}, {1.0, 0.0}, {0.0, 0.0}, {0.0, 1.0}};
  two.c = {{1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}};
  two.dead_time = dead_time;
  return two;
}
using Two = MimoAdrc<LinearEso<2>, LinearEso<2>>;
Two two_channels(const Matrix<double, 2, 2>& input_matrix) {
  Two::Config config;
  std::get<0>(config.observers) = {.observer_bandwidth = 20.0, .sample_time = T};
  std::get<1>(config.observers) = {.observer_bandwidth = 25.0, .sample_time = T};
  config.controller_bandwidths = {4.0, 5.0};
  config.input_matrix = input_matrix;
  return Two::make(config).value();
}

TEST(Loop, OfSeveralChannelsIsTheRunningLoop) {
  auto real = two_channels({{2.0, 0.5}, {-0.4, 2.0}});
  const auto two = coupled(1.5, 1.4 * T);
  const auto loop = closed_loop(two, real).value();
  EXPECT_TRUE(loop.stable());
  EXPECT_EQ(loop.channels(), 2);
  Model model{loop.system()};
  SteppedPlant<4, 2> run{two};
  for (int k = 0; k < 200; ++k) {
    const double v = 0.1 * std::sin(0.7 * k);
    const double d = k >= 100 ? 2.0 : 0.5;
    const auto out = model.step({1.0, -0.5, v, 0.0, 0.0, d});
    const auto y = two.output(run.x);
    const auto u = real.update({y(0) + v, y(1)}, {1.0, -0.5});
    for (std::size_t i = 0; i < 2; ++i) {
      ASSERT_NEAR(out[i], y(static_cast<int>(i)), 1e-9);
      ASSERT_NEAR(out[2 + i], u(static_cast<int>(i)), 1e-8);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_NEAR(out[4 + i], real.observer<0>().estimate()(static_cast<int>(i)), 1e-8);
      ASSERT_NEAR(out[7 + i], real.observer<1>().estimate()(static_cast<int>(i)), 1e-8);
    }
    run.hold({u(0), u(1)}, {0.0, d});
  }
}

/// The system's response by elimination in long double.
std::vector<Complex> evaluated(const DynamicSystem& system, double w, int input) {
  using Long = std::complex<long double>;
  const int n = system.a.rows();
  const Long angle(0.0L, static_cast<long double>(w) * system.sample_time);
  const Long value =
      system.sample_time > 0.0 ? std::exp(angle) - 1.0L : Long(0.0L, static_cast<long double>(w));
  std::vector<Long> pencil(static_cast<std::size_t>(n * n));
  std::vector<Long> x(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      pencil[static_cast<std::size_t>(j * n + i)] =
          (i == j ? value : Long(0.0L)) - static_cast<long double>(system.a(i, j));
    }
    x[static_cast<std::size_t>(i)] = static_cast<long double>(system.b(i, input));
  }
  esokit::detail::solve_in_place(esokit::detail::DenseView<Long>{pencil.data(), n},
                                 esokit::detail::DenseView<Long>{x.data(), n, 1});
  std::vector<Complex> out;
  for (int i = 0; i < system.c.rows(); ++i) {
    Long sum = static_cast<long double>(system.d(i, input));
    for (int j = 0; j < n; ++j) {
      sum += static_cast<long double>(system.c(i, j)) * x[static_cast<std::size_t>(j)];
    }
    out.emplace_back(static_cast<double>(sum.real()), static_cast<double>(sum.imag()));
  }
  return out;
}

void expect_consistent(const Loop& loop) {
  for (const double w : {0.3, 3.0, 20.0, 150.0}) {
    const Complex l = loop.loop_gain(w).value();
    const Complex s = loop.sensitivity(w).value();
    const Complex t = loop.complementary_sensitivity(w).value();
    EXPECT_LT(std::abs(s + t - 1.0), 1e-12);
    EXPECT_LT(std::abs(s * (1.0 + l) - 1.0), 1e-12);
    EXPECT_NEAR(loop.largest_sensitivity(w).value(), std::abs(s), 1e-12 * std::abs(s));
    // The same from the state space of the closed loop: v to y is -T, v to u is C S, d to y P_d S.
    const auto of_noise = evaluated(loop.system(), w, 1);
    const auto of_disturbance = evaluated(loop.system(), w, 2);
    EXPECT_LT(std::abs(of_noise[0] + t), 1e-9 * std::abs(t));
    const Complex noise = loop.noise_to_control(w).value();
    EXPECT_LT(std::abs(of_noise[1] - noise), 1e-9 * std::abs(noise));
    const Complex disturbance = loop.disturbance_to_output(w).value();
    EXPECT_LT(std::abs(of_disturbance[0] - disturbance), 1e-9 * std::abs(disturbance));
  }
  // Integral action: reference followed, disturbance rejected, at standstill.
  EXPECT_NEAR(evaluated(loop.system(), 0.0, 0)[0].real(), 1.0, 1e-10);
  EXPECT_NEAR(std::abs(evaluated(loop.system(), 0.0, 2)[0]), 0.0, 1e-10);
}

auto continuous_parts() {
  return ObserverWithLaw{
      ContinuousCascadeEso<2, 3>::make(
          {.observer_bandwidth = 10.0, .bandwidth_factor = 2.0, .input_gain = 2.0})
          .value(),
      AdrcLaw<2>::make({.controller_bandwidth = 4.0, .input_gain = 2.0}).value()};
}

TEST(Loop, TransferFunctionsAreConsistent) {
  expect_consistent(closed_loop(plant(), controller()).value());
  expect_consistent(closed_loop(plant(0.6 * T), controller()).value());
  expect_consistent(closed_loop(plant(3.0 * T), controller()).value());
  expect_consistent(closed_loop(plant(), continuous_parts()).value());
}

// Two channels that know nothing of each other are two loops.
TEST(Loop, OfTwoChannelsApartIsTwoLoops) {
  auto apart = coupled(0.0, 0.6 * T);
  apart.b = {{0.0, 0.0}, {2.5, 0.0}, {0.0, 0.0}, {0.0, 1.8}};
  const auto both = closed_loop(apart, two_channels({{2.0, 0.0}, {0.0, 2.0}})).value();
  const auto alone = [](double spring, double damper, double b, double wo, double wc) {
    const auto one =
        Plant::chain({.coefficients = {spring, damper}, .input_gain = b, .dead_time = 0.6 * T});
    const auto adrc = Adrc<LinearEso<2>>::make(
        {.observer = {.observer_bandwidth = wo, .input_gain = 2.0, .sample_time = T},
         .controller_bandwidth = wc});
    return closed_loop(one.value(), adrc.value()).value();
  };
  const auto first = alone(3.0, 0.4, 2.5, 20.0, 4.0);
  const auto second = alone(5.0, 0.6, 1.8, 25.0, 5.0);
  for (const double w : {0.5, 5.0, 40.0, 300.0}) {
    const Complex l1 = first.loop_gain(w).value();
    const Complex l2 = second.loop_gain(w).value();
    EXPECT_LT(std::abs(both.loop_gain(w, 0).value() - l1), 1e-11 * std::abs(l1));
    EXPECT_LT(std::abs(both.loop_gain(w, 1).value() - l2), 1e-11 * std::abs(l2));
    const double s =
        std::max(std::abs(first.sensitivity(w).value()), std::abs(second.sensitivity(w).value()));
    EXPECT_NEAR(both.largest_sensitivity(w).value(), s, 1e-11 * s);
    EXPECT_EQ(std::abs(both.noise_to_control(w, 0, 1).value()), 0.0);
    EXPECT_EQ(std::abs(both.disturbance_to_output(w, 1, 0).value()), 0.0);
  }
}

/// u = -K y, K a full matrix: a controller whose loop is written down by hand.
struct Static {
  Matrix<double, 2, 2> gain;
};
LinearController linear_controller(const Static& controller) {
  LinearController form(0, 2, 0, T);
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      form.y_to_u(i, j) = -controller.gain(i, j);
      form.r_to_u(i, j) = controller.gain(i, j);
    }
  }
  return form;
}

TEST(Loop, OfCoupledChannelsByHand) {
  // Two integrators: y1' = u1 + d1, y2' = u2 + d2, sampled y+ = y + T u, so P = T / (z - 1).
  LinearPlant<2, double, 2, 2> integrators;
  integrators.b = {{1.0, 0.0}, {0.0, 1.0}};
  integrators.c = integrators.b;
  integrators.e = integrators.b;
  const Static gain{{{8.0, 3.0}, {-2.0, 5.0}}};
  const auto loop = closed_loop(integrators, gain).value();
  for (const double w : {1.0, 10.0, 100.0}) {
    const Complex p = T / (std::polar(1.0, w * T) - 1.0);
    // L = P K; channel 1 with channel 2 closed: l_11 - l_12 l_21 / (1 + l_22)
    const Complex first = 8.0 * p + 6.0 * p * p / (1.0 + 5.0 * p);
    const Complex second = 5.0 * p + 6.0 * p * p / (1.0 + 8.0 * p);
    EXPECT_LT(std::abs(loop.loop_gain(w, 0).value() - first), 1e-13 * std::abs(first));
    EXPECT_LT(std::abs(loop.loop_gain(w, 1).value() - second), 1e-13 * std::abs(second));
    // S = (I + P K)^-1; its singular values from the trace and determinant of S^H S.
    const Complex a = 1.0 + 8.0 * p;
    const Complex b = 3.0 * p;
    const Complex c = -2.0 * p;
    const Complex d = 1.0 + 5.0 * p;
    const Complex determinant = a * d - b * c;
    const double trace =
        (std::norm(a) + std::norm(b) + std::norm(c) + std::norm(d)) / std::norm(determinant);
    const double product = 1.0 / std::norm(determinant);
    const double largest = std::sqrt(0.5 * trace + std::sqrt(0.25 * trace * trace - product));
    EXPECT_NEAR(loop.largest_sensitivity(w).value(), largest, 1e-12 * largest);
    // From noise on y2 to u1: -(K S)_12, S_12 = -b / det, S_22 = a / det
    const Complex noise = -(8.0 * -b + 3.0 * a) / determinant;
    EXPECT_LT(std::abs(loop.noise_to_control(w, 0, 1).value() - noise), 1e-12 * std::abs(noise));
    // From d1 to y2: p S_21
    const Complex disturbance = p * -c / determinant;
    EXPECT_LT(std::abs(loop.disturbance_to_output(w, 1, 0).value() - disturbance),
              1e-12 * std::abs(disturbance));
  }
}

TEST(Loop, IsOfAFloatController) {
  const auto in_float = Adrc<LinearEso<2, float>>::make(
      {.observer = {.observer_bandwidth = 20.0f, .input_gain = 2.0f, .sample_time = 0.01f},
       .controller_bandwidth = 4.0f});
  const auto in_double = Adrc<LinearEso<2>>::make(
      {.observer = {.observer_bandwidth = 20.0, .input_gain = 2.0, .sample_time = 0.01},
       .controller_bandwidth = 4.0});
  const auto one = closed_loop(plant(), in_float.value()).value();
  const auto other = closed_loop(plant(), in_double.value()).value();
  for (const double w : {0.5, 5.0, 40.0}) {
    const Complex l = other.loop_gain(w).value();
    EXPECT_LT(std::abs(one.loop_gain(w).value() - l), 1e-4 * std::abs(l));
    EXPECT_GT(std::abs(one.loop_gain(w).value() - l), 0.0);
  }
  // A plant in float, too.
  const auto single = LinearPlant<2, float>::chain({.coefficients = {3.0f, 0.5f}}).value();
  EXPECT_TRUE(closed_loop(single, in_double.value()).has_value());
}

TEST(Loop, RefusesWhatDoesNotBelongTogether) {
  const auto adrc = controller();
  EXPECT_EQ(refusal(closed_loop(coupled(0.0), adrc)),
            "plant.inputs: must be the channels of the controller, that is");
  LinearPlant<2, double, 1, 2> seen_twice;
  seen_twice.b = {{0.0}, {1.0}};
  seen_twice.c = {{1.0, 0.0}, {0.0, 1.0}};
  seen_twice.a = {{0.0, 1.0}, {0.0, 0.0}};
  EXPECT_EQ(refusal(closed_loop(seen_twice, adrc)),
            "plant.outputs: must be the channels of the controller, that is");
  // Dead time: up to 1000 samples, none with a continuous controller.
  EXPECT_TRUE(closed_loop(plant(T), adrc).has_value());
  EXPECT_EQ(refusal(closed_loop(plant(1000.5 * T), adrc)),
            "plant.dead_time: must not be above 1000 samples");
  EXPECT_EQ(refusal(closed_loop(plant(1e-9), continuous_parts())),
            "plant.dead_time: must be zero with a continuous controller");
  auto bad = plant();
  bad.a(0, 1) = std::nan("");
  EXPECT_EQ(refusal(closed_loop(bad, adrc)), "a[2]: must be finite");
  const auto unstable = LinearPlant<1>::chain({.coefficients = {-1e6}}).value();  // exp(1e4)
  const auto first = Adrc<LinearEso<1>>::make(
      {.observer = {.observer_bandwidth = 20.0, .input_gain = 2.0, .sample_time = T},
       .controller_bandwidth = 4.0});
  EXPECT_EQ(refusal(closed_loop(unstable, first.value())), "system: must be finite");

  const auto loop = closed_loop(plant(), adrc).value();
  EXPECT_EQ(refusal(loop.loop_gain(0.0)), "frequency: must be finite and positive");
  EXPECT_TRUE(loop.loop_gain(std::numbers::pi / T).has_value());
  EXPECT_EQ(refusal(loop.loop_gain(1.0001 * std::numbers::pi / T)),
            "frequency: must not be above the Nyquist frequency");
  for (const int channel : {-1, 1}) {
    EXPECT_EQ(refusal(loop.loop_gain(1.0, channel)),
              "channel: must be 0 .. channels - 1, that is at most");
    EXPECT_EQ(refusal(loop.noise_to_control(1.0, 0, channel)),
              "channel: must be 0 .. channels - 1, that is at most");
    EXPECT_EQ(refusal(loop.disturbance_to_output(1.0, channel)),
              "channel: must be 0 .. channels - 1, that is at most");
  }
  LinearController odd = linear_controller(adrc).value();
  for (auto* matrix : {&odd.a, &odd.from_y, &odd.from_r, &odd.from_u, &odd.to_u, &odd.y_to_u,
                       &odd.r_to_u, &odd.to_estimate, &odd.y_to_estimate, &odd.r_to_estimate}) {
    const double before = (*matrix)(0, 0);
    (*matrix)(0, 0) = std::numeric_limits<double>::infinity();
    EXPECT_EQ(refusal(closed_loop(plant(), odd)), "controller: must be finite");
    (*matrix)(0, 0) = before;
  }
  EXPECT_TRUE(closed_loop(plant(), odd).has_value());
  odd.sample_time = -T;
  EXPECT_EQ(refusal(closed_loop(plant(), odd)),
            "controller.sample_time: must be finite and not negative");
}

// ---- noise

TEST(LoopNoise, IsWhatARunOfTheControllerHas) {
  auto real = controller();
  const auto found =
      noise(plant(0.3 * T), real, {.measurement = {0.1}, .disturbance = {2.0}}).value();
  // The sum of squares of the responses to each sample of noise, by the real controller and the
  // plant in small steps: independent of the Lyapunov equation and of the loop's matrices.
  const auto power = [&](double v0, double d0) {
    auto adrc = controller();
    SteppedPlant<2, 1> run{plant(0.3 * T)};
    std::vector<double> sums(5);
    for (int k = 0; k < 1500; ++k) {
      const double y = run.x(0);
      const double u = adrc.update(y + (k == 0 ? v0 : 0.0), 0.0);
      const auto estimate = adrc.observer().estimate();
      const std::vector<double> now = {y, u, estimate(0), estimate(1), estimate(2)};
      for (std::size_t i = 0; i < 5; ++i) sums[i] += now[i] * now[i];
      run.hold(one(u), one(k == 0 ? d0 : 0.0));
    }
    return sums;
  };
  const auto of_v = power(0.1, 0.0);
  const auto of_d = power(0.0, 2.0);
  const auto expect = [&](double deviation, std::size_t i) {
    EXPECT_NEAR(deviation, std::sqrt(of_v[i] + of_d[i]), 1e-6 * deviation);
  };
  ASSERT_EQ(found.output.size(), 1u);
  ASSERT_EQ(found.control.size(), 1u);
  ASSERT_EQ(found.estimates.size(), 3u);
  expect(found.output[0], 0);
  expect(found.control[0], 1);
  for (std::size_t i = 0; i < 3; ++i) expect(found.estimates[i], 2 + i);
  // What is left out is zero.
  EXPECT_NEAR(noise(plant(0.3 * T), real, {.measurement = {0.1}})->control[0], std::sqrt(of_v[1]),
              1e-6);
  EXPECT_EQ(noise(plant(), real, {})->control[0], 0.0);
}

TEST(LoopNoise, RefusesByRule) {
  const auto adrc = controller();
  EXPECT_EQ(refusal(noise(plant(), adrc, {.measurement = {-0.1}})),
            "measurement[0]: must be finite and not negative");
  EXPECT_EQ(refusal(noise(plant(), adrc, {.disturbance = {std::nan("")}})),
            "disturbance[0]: must be finite and not negative");
  EXPECT_EQ(refusal(noise(plant(), adrc, {.measurement = {0.1, 0.1}})),
            "measurement: must have at most");
  EXPECT_EQ(refusal(noise(plant(), adrc, {.disturbance = {0.1, 0.1}})),
            "disturbance: must have at most");
  auto wrong = plant();
  wrong.b = {0.0, -2.5};
  EXPECT_EQ(refusal(noise(wrong, adrc, {.measurement = {0.1}})),
            "stability_abscissa: must be negative: a loop that is not stable has no steady state");
  // C of a continuous ADRC is strictly proper: white noise gives u a variance; by hand for n = 1.
  const double wo = 10.0;
  const double wc = 3.0;
  const auto parts = ObserverWithLaw{
      ContinuousLinearEso<1>::make({.observer_bandwidth = wo, .input_gain = 1.0}).value(),
      AdrcLaw<1>::make({.controller_bandwidth = wc, .input_gain = 1.0}).value()};
  const auto integrator = LinearPlant<1>::chain({}).value();
  const auto still = noise(integrator, parts, {.measurement = {1.0}}).value();
  // u / v = -s (b1 s + b0) / ((s + wc)(s + wo)^2) with b1 = 2 wo wc + wo^2, b0 = wc wo^2, and the
  // variance of (c2 s^2 + c1 s) / (s^3 + a2 s^2 + a1 s + a0): (c2^2 a0 a1 + c1^2 a0) / (2 a0 (a1 a2
  // - a0))
  const double c2 = 2.0 * wo * wc + wo * wo;
  const double c1 = wc * wo * wo;
  const double a2 = wc + 2.0 * wo;
  const double a1 = wo * wo + 2.0 * wo * wc;
  const double a0 = wc * wo * wo;
  const double variance = (c2 * c2 * a0 * a1 + c1 * c1 * a0) / (2.0 * a0 * (a1 * a2 - a0));
  EXPECT_NEAR(still.control[0], std::sqrt(variance), 1e-10 * std::sqrt(variance));
}

// What else is asked of any linear system.
TEST(Loop, HasASystemForAllElse) {
  const auto loop = closed_loop(plant(0.3 * T), controller()).value();
  const DynamicSystem& system = loop.system();
  // The largest y that d of size one can bring about: the sum of the magnitudes of its response.
  const auto peaks = peak_gain(system).value();
  Model model{system};
  double sum = 0.0;
  for (int k = 0; k < 3000; ++k) sum += std::abs(model.step({0.0, 0.0, k == 0 ? 1.0 : 0.0})[0]);
  EXPECT_NEAR(peaks(0, 2), sum, 1e-8 * sum);
  const auto response = frequency_response(system, 3.0).value();
  EXPECT_LT(std::abs(response(1, 1) - evaluated(system, 3.0, 1)[1]),
            1e-9 * std::abs(response(1, 1)));
  EXPECT_EQ(refusal(frequency_response(system, -1.0)),
            "frequency: must be finite and not negative");
  EXPECT_NEAR(stability_abscissa(system), loop.stability_abscissa(), 1e-15);
  EXPECT_EQ(poles(system).size(), static_cast<std::size_t>(system.a.rows()));
  // Noise that reaches two places at once.
  DynamicMatrix<double> input(3, 3);
  input(1, 1) = 0.01;
  input(2, 2) = 4.0;
  input(1, 2) = input(2, 1) = 0.1;
  const auto together = output_covariance(system, input).value();
  input(1, 2) = input(2, 1) = 0.0;
  const auto apart = noise(loop, {.measurement = {0.1}, .disturbance = {2.0}}).value();
  EXPECT_NEAR(std::sqrt(output_covariance(system, input).value()(1, 1)), apart.control[0], 1e-12);
  EXPECT_GT(std::abs(together(1, 1) - apart.control[0] * apart.control[0]), 1e-3);
  input(1, 2) = 0.1;
  EXPECT_EQ(refusal(output_covariance(system, input)),
            "input[1]: must be a covariance matrix: symmetric and positive semidefinite");
  EXPECT_EQ(refusal(output_covariance(system, DynamicMatrix<double>(2, 2))),
            "input: must have a row and a column for each input, that is");
}

// ---- responses

TEST(LoopResponse, IsWhatARunOfTheControllerDoes) {
  for (const bool load : {false, true}) {
    auto adrc = controller();
    const LoopStep step{.duration = 1.0, .height = 3.0};
    const auto found = load ? load_response(plant(0.3 * T), adrc, step).value()
                            : reference_response(plant(0.3 * T), adrc, step).value();
    ASSERT_EQ(found.time.size(), 101u);
    SteppedPlant<2, 1> run{plant(0.3 * T)};
    for (std::size_t k = 0; k <= 100; ++k) {
      const double y = run.x(0);
      const double u = adrc.update(y, load ? 0.0 : 3.0);
      ASSERT_NEAR(found.time[k], static_cast<double>(k) * T, 1e-12);
      ASSERT_NEAR(found.output[0][k], y, 1e-9);
      ASSERT_NEAR(found.control[0][k], u, 1e-8);
      ASSERT_NEAR(found.estimates[2][k], adrc.observer().estimate()(2), 1e-7);
      run.hold(one(u), one(load ? 3.0 : 0.0));
    }
  }
  // Of a continuous loop: a first-order lag, 1 - e^(-t).
  LinearController proportional(0, 1, 0, 0.0);
  proportional.y_to_u(0, 0) = -1.0;
  proportional.r_to_u(0, 0) = 1.0;
  const auto lag = reference_response(LinearPlant<1>::chain({}).value(), proportional,
                                      {.duration = 2.0, .sample_time = 0.5})
                       .value();
  ASSERT_EQ(lag.time.size(), 5u);
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_NEAR(lag.output[0][k], -std::expm1(-lag.time[k]), 1e-14);
  }
}

TEST(LoopResponse, RefusesByRule) {
  const auto adrc = controller();
  EXPECT_EQ(refusal(reference_response(plant(), adrc, {})),
            "duration: must be finite and positive");
  EXPECT_EQ(refusal(reference_response(plant(), adrc, {.duration = 1e7 * T})),
            "duration: must be below 1e7 samples");
  auto wrong = plant();
  wrong.b = {0.0, -2.5};
  EXPECT_EQ(refusal(reference_response(wrong, adrc, {.duration = 1e4 * T})),
            "duration: gives a response that the scalar cannot hold: the loop is not stable");
  // A state that is finite, and an output that is not: u = 1e400.
  LinearController strong(0, 1, 0, 0.0);
  strong.y_to_u(0, 0) = -1.0;
  strong.r_to_u(0, 0) = 1e200;
  const auto weak = LinearPlant<1>::chain({.coefficients = {1.0}, .input_gain = 1e-150}).value();
  EXPECT_EQ(refusal(reference_response(weak, strong,
                                       {.duration = 1.0, .height = 1e200, .sample_time = 0.5})),
            "duration: gives a response that the scalar cannot hold: the loop is not stable");
  EXPECT_TRUE(
      reference_response(weak, strong, {.duration = 1.0, .height = 1e100, .sample_time = 0.5}));
  for (const int channel : {-1, 1}) {
    EXPECT_EQ(refusal(reference_response(plant(), adrc, {.duration = 1.0, .channel = channel})),
              "channel: must be one that the loop has");
    EXPECT_EQ(refusal(load_response(plant(), adrc, {.duration = 1.0, .channel = channel})),
              "channel: must be one that the loop has");
  }
  EXPECT_EQ(refusal(load_response(plant(), adrc, {.duration = 1.0, .height = std::nan("")})),
            "height: must be finite");
  EXPECT_EQ(refusal(load_response(plant(), adrc, {.duration = 1.0, .sample_time = T})),
            "sample_time: must be left out: the loop has one");
  EXPECT_EQ(refusal(load_response(plant(), continuous_parts(), {.duration = 1.0})),
            "sample_time: must be finite and positive");
}

}  // namespace analysis_loop_test
