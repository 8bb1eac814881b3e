// The closed loop against a run of the real observer and law, and its transfer functions against
// their definitions.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/analysis/adrc_loop.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/closed_loop.hpp>
#include <support/refusal.hpp>

namespace {

using esokit_test::refusal;

using namespace esokit;
using Complex = std::complex<double>;

constexpr double T = 0.01;

auto observer_with(double b0) {
  return CascadeEso<2, 2>::make({.observer_bandwidth = 20.0,
                                 .bandwidth_factor = 2.0,
                                 .input_gain = b0,
                                 .sample_time = T})
      .value();
}
auto law_with(double b0) {
  return AdrcLaw<2>::make({.controller_bandwidth = 4.0, .input_gain = b0}).value();
}
auto plant() { return CompanionPlant<2>{{3.0, 0.4}, 2.5}.system().value(); }

/// x[k+1] - x[k] of a system's model, beside a run of the real thing. The plant is integrated by
/// small Runge-Kutta steps, so that neither sampling nor loop algebra is shared.
template <class Loop, class Observer, class Law>
void expect_same_run(const Loop& loop, Observer observer, Law&& control, double delay) {
  const auto& closed = loop.closed_loop();
  EXPECT_STREQ(loop.controller().input_names[0], "y");
  EXPECT_STREQ(loop.controller().input_names[1], "r");
  EXPECT_STREQ(loop.controller().output_names[0], "u");
  EXPECT_STREQ(closed.output_names[0], "y");
  EXPECT_STREQ(closed.output_names[1], "u");
  EXPECT_STREQ(closed.output_names[2], "yhat");
  constexpr int states = std::remove_cvref_t<decltype(closed)>::states;
  EigenMatrix<double, states> x = EigenMatrix<double, states>::Zero();
  EigenMatrix<double, 2> truth = EigenMatrix<double, 2>::Zero();
  double u = 0.0;
  double u_before = 0.0;
  const auto p = plant();
  for (int k = 0; k < 300; ++k) {
    const EigenMatrix<double, 3> inputs(1.0, 0.1 * std::sin(0.7 * k), k >= 100 ? 2.0 : 0.5);
    const EigenMatrix<double, 5> outputs = closed.c * x + closed.d * inputs;

    const double y = truth(0);
    const double r = inputs(0);
    observer.update(control.measured(y + inputs(1), r), u);
    u_before = u;
    u = control.input(observer.estimate(), r);
    EXPECT_NEAR(outputs(0), y, 1e-9);
    EXPECT_NEAR(outputs(1), u, 1e-8);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(outputs(2 + i), observer.estimate()(i), 1e-8);

    const int steps = 200;
    const double h = T / steps;
    for (int i = 0; i < steps; ++i) {
      const double held = (i + 0.5) * h < delay ? u_before : u;
      const auto rate = [&](double, const EigenMatrix<double, 2>& z) -> EigenMatrix<double, 2> {
        return p.a * z + p.b.col(0) * held + p.b.col(1) * inputs(2);
      };
      truth = sim::step(rate, 0.0, truth, h);
    }
    x += closed.a * x + closed.b * inputs;
  }
}

struct FedOutput {
  AdrcLaw<2> law;
  [[nodiscard]] double measured(double y, double) const { return y; }
  [[nodiscard]] double input(const EigenMatrix<double, 3>& z, double r) const {
    return law.control(z, r);
  }
};
struct FedError {
  AdrcLaw<2> law;
  [[nodiscard]] double measured(double y, double r) const { return r - y; }
  [[nodiscard]] double input(const EigenMatrix<double, 3>& z, double) const {
    return law.control_error_based(z);
  }
};

TEST(AdrcLoop, IsTheRunningLoop) {
  const auto loop =
      adrc_loop(sampled_plant(plant(), T).value(), observer_with(2.0), law_with(2.0)).value();
  EXPECT_TRUE(loop.stable());
  expect_same_run(loop, observer_with(2.0), FedOutput{law_with(2.0)}, 0.0);
}

TEST(AdrcLoop, IsTheRunningLoopErrorBased) {
  const auto loop =
      adrc_loop(sampled_plant(plant(), T).value(), observer_with(-2.0), law_with(2.0), ErrorBased{})
          .value();
  EXPECT_TRUE(loop.stable());
  expect_same_run(loop, observer_with(-2.0), FedError{law_with(2.0)}, 0.0);
  // The loop gain does not depend on the form.
  const auto other =
      adrc_loop(sampled_plant(plant(), T).value(), observer_with(2.0), law_with(2.0)).value();
  for (const double w : {0.5, 8.0, 200.0}) {
    const Complex l = loop.loop_gain(w).value();
    EXPECT_LT(std::abs(l - other.loop_gain(w).value()), 1e-11 * std::abs(l));
  }
}

TEST(AdrcLoop, IsTheRunningLoopWithADelay) {
  for (const double delay : {0.25 * T, T}) {
    const auto loop =
        adrc_loop(sampled_plant(plant(), T, delay).value(), observer_with(2.0), law_with(2.0))
            .value();
    expect_same_run(loop, observer_with(2.0), FedOutput{law_with(2.0)}, delay);
  }
}

template <class Loop>
void expect_consistent(const Loop& loop) {
  for (const double w : {0.3, 3.0, 20.0, 150.0}) {
    const Complex l = loop.loop_gain(w).value();
    const Complex s = loop.sensitivity(w).value();
    const Complex t = loop.complementary_sensitivity(w).value();
    EXPECT_LT(std::abs(s + t - 1.0), 1e-12);
    EXPECT_LT(std::abs(s * (1.0 + l) - 1.0), 1e-12);
    // The same from the state space of the closed loop: v to y is -T, v to u is C S, d to y P_d S.
    const auto closed = frequency_response(loop.closed_loop(), w).value();
    EXPECT_LT(std::abs(closed(0, 1) + t), 1e-9 * std::abs(t));
    const Complex noise = loop.noise_to_control(w).value();
    EXPECT_LT(std::abs(closed(1, 1) - noise), 1e-9 * std::abs(noise));
    const Complex disturbance = loop.disturbance_to_output(w).value();
    EXPECT_LT(std::abs(closed(0, 2) - disturbance), 1e-9 * std::abs(disturbance));
    const auto p = frequency_response(loop.plant(), w).value();
    EXPECT_LT(std::abs(noise * p(0, 0) + t), 1e-9 * std::abs(t));
  }
  // Integral action: reference followed, disturbance rejected, at standstill.
  const auto still = frequency_response(loop.closed_loop(), 0.0).value();
  EXPECT_NEAR(still(0, 0).real(), 1.0, 1e-10);
  EXPECT_NEAR(std::abs(still(0, 2)), 0.0, 1e-10);
}

TEST(AdrcLoop, TransferFunctionsAreConsistent) {
  expect_consistent(
      adrc_loop(sampled_plant(plant(), T).value(), observer_with(2.0), law_with(2.0)).value());
  expect_consistent(
      adrc_loop(sampled_plant(plant(), T, 0.6 * T).value(), observer_with(2.0), law_with(2.0))
          .value());
  const auto continuous =
      ContinuousCascadeEso<2, 3>::make(
          {.observer_bandwidth = 10.0, .bandwidth_factor = 2.0, .input_gain = 2.0})
          .value();
  expect_consistent(adrc_loop(plant(), continuous, law_with(2.0)).value());
}

TEST(AdrcLoop, RefusesWhatDoesNotBelongTogether) {
  const auto sampled = sampled_plant(plant(), T).value();

  EXPECT_EQ(
      refusal(adrc_loop(sampled_plant(plant(), 2 * T).value(), observer_with(2.0), law_with(2.0))),
      "plant.sample_time: must be that of the observer, which is");
  EXPECT_EQ(refusal(adrc_loop(plant(), observer_with(2.0), law_with(2.0))),
            "plant.sample_time: must be that of the observer, which is");
  EXPECT_EQ(refusal(adrc_loop(sampled, observer_with(2.0), law_with(3.0))),
            "input_gain: of the observer must be that of the law, which is");
  EXPECT_EQ(refusal(adrc_loop(sampled, observer_with(2.0), law_with(2.0), ErrorBased{})),
            "input_gain: of the observer must be minus that of the law, which is");
  // T and b0 come back as they were given, so the next number is another one.
  const auto next = [](double x) { return std::nextafter(x, 2 * x); };
  const auto other_time = sampled_plant(plant(), next(T)).value();
  EXPECT_EQ(refusal(adrc_loop(other_time, observer_with(2.0), law_with(2.0))),
            "plant.sample_time: must be that of the observer, which is");
  EXPECT_EQ(refusal(adrc_loop(sampled, observer_with(2.0), law_with(next(2.0)))),
            "input_gain: of the observer must be that of the law, which is");
  auto direct = sampled;
  direct.d(0, 0) = 1.0;
  EXPECT_EQ(refusal(adrc_loop(direct, observer_with(2.0), law_with(2.0))),
            "plant.d: must be zero: y may not follow an input at once");
  EXPECT_EQ(refusal(adrc_loop(sampled, observer_with(2.0), law_with(2.0))->loop_gain(0.0)),
            "frequency: must be finite and positive");
  EXPECT_EQ(refusal(adrc_loop(sampled, observer_with(2.0), law_with(2.0))->loop_gain(400.0)),
            "frequency: must not be above the Nyquist frequency");
}

/// The plant is in double whatever the observer is in.
TEST(AdrcLoop, TakesAnObserverAndALawInFloat) {
  const auto config = [](float time, float b0) {
    return LinearEso<2, float>::make(
               {.observer_bandwidth = 20.0f, .input_gain = b0, .sample_time = time})
        .value();
  };
  const auto in_float = [](float b0) {
    return AdrcLaw<2, float>::make({.controller_bandwidth = 4.0f, .input_gain = b0}).value();
  };
  const auto sampled = sampled_plant(plant(), T).value();
  const auto time = static_cast<float>(T);
  EXPECT_TRUE(adrc_loop(sampled, config(time, 0.3f), in_float(0.3f)).has_value());
  EXPECT_TRUE(adrc_loop(sampled, config(time, 0.3f), law_with(0.3)).has_value());
  EXPECT_EQ(refusal(adrc_loop(sampled, config(std::nextafter(time, 1.0f), 0.3f), in_float(0.3f))),
            "plant.sample_time: must be that of the observer, which is");
  EXPECT_EQ(refusal(adrc_loop(sampled, config(time, std::nextafter(0.3f, 1.0f)), law_with(0.3))),
            "input_gain: of the observer must be that of the law, which is");
}

TEST(NominalPlant, IsSampledExactly) {
  // y'' = -w^2 y + u: cosine and sine.
  const double w = 30.0;
  const auto oscillator = CompanionPlant<2>{{w * w, 0.0}, 2.0}.system().value();
  const auto s = sampled_plant(oscillator, 0.05).value();
  const double c = std::cos(w * 0.05);
  EXPECT_NEAR(s.a(0, 0), c - 1.0, 1e-13);
  EXPECT_NEAR(s.a(0, 1), std::sin(w * 0.05) / w, 1e-14);
  EXPECT_NEAR(s.a(1, 0), -std::sin(w * 0.05) * w, 1e-11);
  EXPECT_NEAR(s.b(0, 0), 2.0 * (1.0 - c) / (w * w), 1e-15);
  EXPECT_NEAR(s.b(1, 1), std::sin(w * 0.05) / w, 1e-14);
  // A fast pole: exp(-500) - 1 = -1, and a slow one keeps its digits.
  const auto lag = CompanionPlant<1>{{1e-9}, 1.0}.system().value();
  EXPECT_NEAR(sampled_plant(lag, 1e-3).value().a(0, 0) / std::expm1(-1e-12), 1.0, 1e-14);
  const auto fast = CompanionPlant<1>{{5e5}, 1.0}.system().value();
  EXPECT_NEAR(sampled_plant(fast, 1e-3).value().a(0, 0), -1.0, 1e-12);
  // A delay of a whole sample is the old input alone, one of none the new one.
  const auto late = sampled_plant(oscillator, 0.05, 0.05).value();
  EXPECT_NEAR(late.b(0, 0), 0.0, 1e-18);
  EXPECT_NEAR(late.a(0, 2), s.b(0, 0), 1e-15);
  const auto prompt = sampled_plant(oscillator, 0.05, 0.0).value();
  EXPECT_NEAR(prompt.b(1, 0), s.b(1, 0), 1e-15);
  EXPECT_EQ(prompt.a(0, 2), 0.0);
}

TEST(NominalPlant, RefusesBadOnes) {
  EXPECT_EQ(refusal((CompanionPlant<1>{{1.0}, 0.0}).system()),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refusal((CompanionPlant<1>{{std::nan("")}, 1.0}).system()),
            "coefficients[0]: must be finite");
  EXPECT_EQ(refusal(sampled_plant(plant(), 0.0)), "sample_time: must be finite and positive");
  EXPECT_EQ(refusal(sampled_plant(plant(), T, 2 * T)), "delay: must not be above sample_time");
  EXPECT_EQ(refusal(sampled_plant(plant(), T, -T)), "delay: must be finite and not negative");
  EXPECT_EQ(refusal(sampled_plant(sampled_plant(plant(), T).value(), T)),
            "plant.sample_time: must be zero: continuous");
  const auto unstable = CompanionPlant<1>{{-1e6}, 1.0}.system().value();
  EXPECT_EQ(refusal(sampled_plant(unstable, 1.0)), "system: must be finite");  // exp(1e6)
}

}  // namespace
