// Herbst's forms beside the state-space form.
#include <support/no_allocation.hpp>
#include <support/refusal.hpp>
//
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc.hpp>
#include <esokit/control/dual_feedback.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <functional>
#include <limits>
#include <type_traits>
#include <vector>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_dual_feedback_test {

using esokit::DeltaOperator;
using esokit::DualFeedbackAdrc;
using esokit::LimitedFeedback;
using esokit::LinearEso;
using esokit::ShiftOperator;
using esokit::UnlimitedFeedback;

constexpr double period = 1e-3;
constexpr double gain = 1.7;
constexpr int samples = long_run(100'000);

/// What a form holds and asks for, of y and r.
struct Output {
  double u, requested;
};
using Form = std::function<Output(double y, double r)>;

template <class Controller>
Form form_of(const typename Controller::Config& config) {
  auto made = Controller::make(config).value();
  using S = std::remove_cvref_t<decltype(made.output())>;
  EXPECT_EQ(made.start(static_cast<S>(0.2), static_cast<S>(0.2)), StepStatus::ok);
  return [made](double y, double r) mutable -> Output {
    const S u = made.update(static_cast<S>(y), static_cast<S>(r));
    return {static_cast<double>(u), static_cast<double>(made.requested())};
  };
}

/// Largest difference of what the two forms ask for, relative to the largest |u| asked for.
double difference(const Form& filter, const Form& state, int order, double omega_t, bool limited,
                  bool closed) {
  // y and r of a size that makes u of order one.
  const double unit = gain / std::pow(omega_t / period / 5, order);
  ChainPlant plant(order, period, gain, -gain * 0.2);
  ChainPlant other = plant;
  Random random(1);
  double worst = 0;
  double largest = 0;
  int at_limit = 0;
  for (int k = 0; k < samples; ++k) {
    const double noise = 0.3 * unit * random.uniform(-1, 1);
    const double r = 0.3 * unit * random.uniform(-1, 1);
    const auto [u, requested] = state((closed ? plant.output() : 0) + noise, r);
    const auto [v, by_filter] = filter((closed ? other.output() : 0) + noise, r);
    worst = std::max(worst, std::abs(requested - by_filter));
    largest = std::max(largest, std::abs(requested));
    at_limit += std::abs(u - requested) > 0 ? 1 : 0;
    if (closed) {
      // Each has a plant of its own: unlimited and outside the loop its m integrators would sum up
      // what rounding leaves.
      plant.step(u);
      other.step(v);
    }
    if (limited) {
      EXPECT_LE(std::abs(v), 1);
    }
  }
  EXPECT_EQ(at_limit > samples / 10, limited);
  return worst / largest;
}

template <int Order, class S, int Extension, class Operator, class Feedback>
double difference(double omega_t, bool limited, bool closed) {
  const S omega = static_cast<S>(omega_t / period);
  const S b0 = static_cast<S>(gain);
  const S T = static_cast<S>(period);
  esokit::Limits<S> limits{};
  if (limited) limits = {.lower = S(-1), .upper = static_cast<S>(0.6), .rate = S(300)};
  const auto filter = form_of<DualFeedbackAdrc<Order, S, Extension, Operator, Feedback>>(
      {.observer_bandwidth = omega,
       .controller_bandwidth = omega / 5,
       .input_gain = b0,
       .sample_time = T,
       .limits = limits});
  const auto state = form_of<Adrc<LinearEso<Order, S, Extension>>>(
      {.observer = {.observer_bandwidth = omega, .input_gain = b0, .sample_time = T},
       .controller_bandwidth = omega / 5,
       .limits = limits});
  return difference(filter, state, Order, omega_t, limited, closed);
}

template <class S>
double bound(int size, double omega_t) {
  return 100 * static_cast<double>(std::numeric_limits<S>::epsilon()) /
         std::pow(-std::expm1(-omega_t), size);
}

template <int Order, class S, int Extension, class Operator>
void equal_to_state_space(int digits, const std::vector<double>& grid) {
  for (const double omega_t : grid) {
    SCOPED_TRACE(::testing::Message()
                 << "n = " << Order << ", m = " << Extension << ", omega T = " << omega_t);
    const double limit = bound<S>(digits, omega_t);
    // Limited: y and u are what they are, the filter's states must be the observer's.
    EXPECT_LE((difference<Order, S, Extension, Operator, LimitedFeedback>(omega_t, true, false)),
              limit);
    EXPECT_LE((difference<Order, S, Extension, Operator, LimitedFeedback>(omega_t, false, true)),
              limit);
  }
}

TEST(DualFeedback, EqualsStateSpace) {
  equal_to_state_space<1, double, 1, ShiftOperator>(2, {0.03, 0.3, 1});
  equal_to_state_space<2, double, 1, ShiftOperator>(3, {0.03, 0.3, 1});
  equal_to_state_space<2, double, 2, ShiftOperator>(4, {0.1, 0.3});
  equal_to_state_space<1, float, 1, ShiftOperator>(2, {0.3, 1});
  // In delta nothing is lost: the same bound without 1/(1-rho)^N, but for the 1/(1-rho) samples
  // that it remembers.
  equal_to_state_space<1, double, 1, DeltaOperator>(1, {0.03, 0.3, 1});
  equal_to_state_space<2, double, 1, DeltaOperator>(1, {0.03, 0.3, 1});
  equal_to_state_space<2, double, 2, DeltaOperator>(1, {0.1, 0.3});
  equal_to_state_space<1, float, 1, DeltaOperator>(1, {0.3, 1});
}

TEST(DualFeedback, TransferFunctionFormWindsUp) {
  EXPECT_LE((difference<2, double, 1, ShiftOperator, UnlimitedFeedback>(0.3, false, true)),
            bound<double>(3, 0.3));
  EXPECT_LE((difference<2, double, 1, DeltaOperator, UnlimitedFeedback>(0.3, false, true)),
            bound<double>(1, 0.3));
  EXPECT_GT((difference<2, double, 1, DeltaOperator, UnlimitedFeedback>(0.3, true, false)), 0.1);
}

TEST(DualFeedback, TooFewDigitsAreRefused) {
  using Shift = DualFeedbackAdrc<2, float>;
  using Delta = DualFeedbackAdrc<2, float, 1, DeltaOperator>;
  const Shift::Config coarse{
      .observer_bandwidth = 400, .controller_bandwidth = 20, .input_gain = 1, .sample_time = 1e-3f};
  EXPECT_TRUE(Shift::make(coarse).has_value());  // (1 - rho)^3 = 0.036
  const auto refused = Shift::make(
      {.observer_bandwidth = 20, .controller_bandwidth = 5, .input_gain = 1, .sample_time = 1e-3f});
  ASSERT_EQ(refusal(refused),
            "observer_bandwidth: times sample_time leaves too few digits in z; use DeltaOperator");
  EXPECT_TRUE(Delta::make({.observer_bandwidth = 20,
                           .controller_bandwidth = 5,
                           .input_gain = 1,
                           .sample_time = 1e-3f})
                  .has_value());
}

/// The polynomials of n = 1 by hand. delta (0): D = delta^2 + 2a delta + a^2.
TEST(DualFeedback, LiteralCoefficients) {
  const double omega = 300, T = 1e-3, b0 = 2, k0 = 20;
  const double a = -std::expm1(-omega * T);
  const auto form =
      DualFeedbackAdrc<1, double, 1, DeltaOperator>::make({.observer_bandwidth = omega,
                                                           .controller_bandwidth = k0,
                                                           .input_gain = b0,
                                                           .sample_time = T})
          .value()
          .form();
  EXPECT_DOUBLE_EQ(form.denominator[1], 2 * a);
  EXPECT_DOUBLE_EQ(form.denominator[2], a * a);
  EXPECT_DOUBLE_EQ(form.reference, k0 / b0);
  // c = -(k0 yhat + dhat)/b0; gain k = (2a - a^2, a^2/T), l = (2a, a^2/T).
  EXPECT_DOUBLE_EQ(form.measurement[0], (k0 * (2 * a - a * a) + a * a / T) / b0);
  EXPECT_DOUBLE_EQ(form.measurement[1], (k0 * 2 * a + a * a / T) / b0);
  EXPECT_DOUBLE_EQ(form.measurement[2], k0 * a * a / b0);
  // From u to yhat (1-a)^2 b0 T per sample and to dhat -a^2 b0 u at once: m_1 = k0 T (1-a)^2 - a^2.
  EXPECT_NEAR(form.input[1], k0 * T * (1 - a) * (1 - a) - a * a, 1e-15);
  // D + N_u has the integrator's root.
  EXPECT_NEAR(form.denominator[2] + form.input[2], 0, 1e-16);
}

TEST(DualFeedback, StartAndRetuneDoNotBump) {
  const auto check = [](auto filter, auto config) {
    EXPECT_EQ(filter.start(2.5, 0.4), StepStatus::ok);
    EXPECT_EQ(filter.output(), 0.4);
    ChainPlant plant(2, period, gain, -gain * 0.4);
    plant.set_state({2.5, 0});
    for (int k = 0; k < 100; ++k) {
      const double u = filter.update(plant.output(), 2.5);
      ASSERT_NEAR(u, 0.4, 1e-9) << k;
      plant.step(u);
    }
    config.observer_bandwidth = 700;
    config.controller_bandwidth = 30;
    config.input_gain = 2;
    ASSERT_TRUE(filter.retune(config).has_value());
    ASSERT_NEAR(filter.update(plant.output(), 2.5), 0.4, 1e-8);
    // Right after a start, too: the steady state of that y, of which nothing was measured yet.
    EXPECT_EQ(filter.start(-1.5, 0.4), StepStatus::ok);
    ASSERT_TRUE(filter.retune(config).has_value());
    ASSERT_NEAR(filter.update(-1.5, -1.5), 0.4, 1e-8);
    config.sample_time = -1;
    EXPECT_EQ(refusal(filter.retune(config)), "sample_time: must be finite and positive");
    EXPECT_EQ(filter.start(hidden_nan<double>(), 1), StepStatus::state_rejected);
    EXPECT_EQ(filter.start(1, hidden_nan<double>()), StepStatus::state_rejected);
  };
  const auto both = [&]<class Filter>(std::type_identity<Filter>) {
    const typename Filter::Config config{.observer_bandwidth = 300,
                                         .controller_bandwidth = 40,
                                         .input_gain = gain,
                                         .sample_time = period,
                                         .limits = {.lower = -2, .upper = 2, .rate = 1000}};
    check(Filter::make(config).value(), config);
  };
  both(std::type_identity<DualFeedbackAdrc<2>>{});
  both(std::type_identity<DualFeedbackAdrc<2, double, 1, DeltaOperator>>{});
}

TEST(DualFeedback, BadSamples) {
  auto filter = DualFeedbackAdrc<2>::make({.observer_bandwidth = 300,
                                           .controller_bandwidth = 40,
                                           .input_gain = gain,
                                           .sample_time = period,
                                           .limits = {.lower = -2, .upper = 2}})
                    .value();
  for (int k = 0; k < 50; ++k) filter.update(1e-3 * k, 0.04);
  for (const double bad : {hidden_nan<double>(), hidden_infinity<double>(), huge<double>()}) {
    auto hit = filter;
    auto repeated = filter;
    const double u = hit.update(bad, 0.04);
    EXPECT_EQ(hit.status(), StepStatus::measurement_rejected);
    EXPECT_EQ(u, repeated.update(49e-3, 0.04));
    EXPECT_EQ(hit.update(0.05, 0.04), repeated.update(0.05, 0.04));
    EXPECT_EQ(hit.status(), StepStatus::ok);
    // A bad reference keeps u; the filter goes on.
    auto lost = filter;
    EXPECT_EQ(lost.update(0.05, bad), filter.output());
    EXPECT_TRUE(std::isfinite(lost.update(0.05, 0.04)));
    // A bad report is none.
    auto told = filter;
    auto own = filter;
    if (!std::isfinite(bad)) {
      told.applied(bad);
      EXPECT_EQ(told.update(0.05, 0.04), own.update(0.05, 0.04));
    }
  }
}

TEST(DualFeedback, ReportedInput) {
  using State = Adrc<LinearEso<2>>;
  const esokit::Limits<double> limits{.lower = -2, .upper = 2};
  auto filter = DualFeedbackAdrc<2>::make({.observer_bandwidth = 300,
                                           .controller_bandwidth = 40,
                                           .input_gain = gain,
                                           .sample_time = period,
                                           .limits = limits})
                    .value();
  auto state =
      State::make(
          {.observer = {.observer_bandwidth = 300, .input_gain = gain, .sample_time = period},
           .controller_bandwidth = 40,
           .limits = limits})
          .value();
  Random random(8);
  for (int k = 0; k < 1000; ++k) {
    const double y = random.uniform(-1e-3, 1e-3);
    const double held = random.uniform(-1, 1);
    filter.applied(held);
    state.applied(held);
    ASSERT_NEAR(filter.update(y, 0.0), state.update(y, 0.0), 1e-9);
  }
}

TEST(DualFeedback, NoAllocationAndNamedErrors) {
  using Filter = DualFeedbackAdrc<2>;
  const Filter::Config good{.observer_bandwidth = 300,
                            .controller_bandwidth = 40,
                            .input_gain = gain,
                            .sample_time = period};
  auto filter = Filter::make(good).value();
  {
    const NoAllocation guard;
    for (int k = 0; k < 10; ++k) filter.update(k % 3 == 0 ? hidden_nan<double>() : 0.1, 0.1);
    filter.start(0.1, 0.1);
    EXPECT_EQ(guard.count(), 0);
  }
  const auto field = [&](auto change) {
    auto config = good;
    change(config);
    const auto made = Filter::make(config);
    return refusal(made);
  };
  EXPECT_EQ(field([](auto&) {}), "accepted");
  EXPECT_EQ(field([](auto& c) { c.observer_bandwidth = 0; }),
            "observer_bandwidth: must be finite and positive");
  EXPECT_EQ(field([](auto& c) { c.controller_bandwidth = 0; }),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(field([](auto& c) {
              c.gains = {{1, 1}};
            }),
            "controller_bandwidth: must be left out if gains is given");
  EXPECT_EQ(field([](auto& c) { c.input_gain = 0; }),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(field([](auto& c) { c.sample_time = 0; }), "sample_time: must be finite and positive");
  EXPECT_EQ(field([](auto& c) { c.observer_bandwidth = 1e-110; }),
            "observer_bandwidth: times sample_time gives a filter the scalar cannot hold");
  EXPECT_EQ(field([](auto& c) { c.input_gain = 1e-306; }),
            "sample_time: gives a filter that the scalar cannot hold");
  EXPECT_EQ(field([](auto& c) { c.limits.lower = 1, c.limits.upper = 0; }),
            "limits.lower: must be below limits.upper");
}

/// Any poles: the filter is the observer with the same poles and the law.
TEST(DualFeedback, WithAnyPoles) {
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

}  // namespace control_dual_feedback_test
}  // namespace esokit_test
