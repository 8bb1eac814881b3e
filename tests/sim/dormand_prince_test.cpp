// DormandPrince and VariableStep: order, oracle Boost.odeint's dopri5, each rule of the step
// control.
#include <gtest/gtest.h>

#include <array>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <cmath>
#include <esokit/core/matrix.hpp>
#include <esokit/eigen.hpp>
#include <esokit/sim/dormand_prince.hpp>
#include <limits>
#include <string>
#include <support/refusal.hpp>
#include <vector>

namespace sim_dormand_prince_test {

using namespace esokit;
using namespace esokit::sim;
using esokit_test::refusal;

using State2 = EigenMatrix<double, 2>;
using State1 = EigenMatrix<double, 1>;
using Array2 = std::array<double, 2>;

// y' = -2 t y^2 has y = 1/(1 + t^2); the second is coupled to it.
State2 nonlinear(double t, const State2& x) {
  return {-2.0 * t * x[0] * x[0], x[0] * x[1] * std::cos(t) - x[1] * x[1]};
}

static_assert(ExplicitRungeKutta<DormandPrince> && proven_order<DormandPrince>() == 4);

TEST(DormandPrince, MeasuredOrderIsFive) {
  const State2 start(1.0, 0.5);
  const State2 exact = integrate(nonlinear, 0.0, start, 2.0 / 40000, 40000);
  const auto error = [&](int steps) {
    return (integrate<DormandPrince>(nonlinear, 0.0, start, 2.0 / steps, steps) - exact).norm();
  };
  EXPECT_NEAR(std::log2(error(100) / error(200)), 5.0, 0.15);
}

// A step's end and the estimate of its error.
TEST(DormandPrince, AgreesWithBoostOdeint) {
  boost::numeric::odeint::runge_kutta_dopri5<Array2> theirs;
  const auto system = [](const Array2& x, Array2& rate, double t) {
    const State2 value = nonlinear(t, State2(x[0], x[1]));
    rate = {value[0], value[1]};
  };
  State2 ours(1.0, 0.5);
  Array2 x{1.0, 0.5};
  const double h = 0.05;
  double estimated = 0.0;
  double summed = 0.0;
  for (int k = 0; k < 100; ++k) {
    Array2 end{}, rate{}, rate_end{}, difference{};
    system(x, rate, k * h);
    theirs.do_step(system, x, rate, k * h, end, rate_end, h, difference);
    State2 sum = State2::Zero();
    std::array<State2, 7> stage;
    for (std::size_t i = 0; i < 7; ++i) {
      State2 at = ours;
      for (std::size_t j = 0; j < i; ++j) {
        at += h * static_cast<double>(DormandPrince::a[i][j]) * stage[j];
      }
      stage[i] = nonlinear(k * h + h * static_cast<double>(DormandPrince::c[i]), at);
      sum += h * static_cast<double>(DormandPrince::difference[i]) * stage[i];
    }
    ASSERT_NEAR(sum[0], difference[0], 1e-16) << k;
    ASSERT_NEAR(sum[1], difference[1], 1e-16) << k;
    estimated += std::abs(difference[0]);
    summed += std::abs(sum[0]);
    ours = step<DormandPrince>(nonlinear, k * h, ours, h);
    x = end;
    ASSERT_NEAR(ours[0], x[0], 1e-14) << k;
    ASSERT_NEAR(ours[1], x[1], 1e-14) << k;
  }
  EXPECT_GT(estimated, 1e-9);
  EXPECT_NEAR(summed, estimated, 1e-14);
}

struct Solution {
  std::vector<double> t;
  State2 x;
};

Solution solve(double relative, double absolute, double end) {
  auto stepper =
      VariableStep<State2>::make({.relative_tolerance = relative, .absolute_tolerance = absolute})
          .value();
  Solution result{{0.0}, State2(1.0, 0.5)};
  while (result.t.back() < end) {
    result.t.push_back(stepper.advance(nonlinear, result.t.back(), result.x, end).value());
  }
  return result;
}

TEST(VariableStep, ErrorAndStepsFollowTheTolerance) {
  const State2 exact = integrate(nonlinear, 0.0, State2(1.0, 0.5), 5.0 / 100000, 100000);
  double previous = 0.0;
  for (const double tolerance : {1e-7, 1e-9, 1e-11}) {
    const Solution ours = solve(tolerance, 1e-14, 5.0);
    const double error = (ours.x - exact).norm();
    // The local errors, below the tolerance each, hardly add up: the solution decays.
    EXPECT_LT(error, 3.0 * tolerance);
    EXPECT_GT(error, 1e-3 * tolerance);
    const auto steps = static_cast<double>(ours.t.size() - 1);
    // Order 5 in the estimate: 100 times the accuracy for 100^(1/5) = 2.5 times the steps.
    if (previous > 0.0) {
      EXPECT_NEAR(steps / previous, std::pow(100.0, 0.2), 0.15);
    }
    previous = steps;
  }
  // Halving the tolerance takes 2^(1/5) times the steps.
  const auto coarse = static_cast<double>(solve(2e-9, 1e-12, 50.0).t.size());
  const auto fine = static_cast<double>(solve(1e-9, 1e-12, 50.0).t.size());
  EXPECT_NEAR(fine / coarse, std::pow(2.0, 0.2), 0.03);
}

TEST(VariableStep, FirstStepByItsRule) {
  const auto constant = [](double, const State2&) -> State2 { return {2.0, 1e-3}; };
  const auto first = [&](State2 x, double relative, double absolute) {
    auto stepper =
        VariableStep<State2>::make({.relative_tolerance = relative, .absolute_tolerance = absolute})
            .value();
    return stepper.advance(constant, 0.0, x, 100.0).value();
  };
  const double root = std::pow(1e-3, 0.2);
  // The first element: 1 / 2.
  EXPECT_DOUBLE_EQ(first({1.0, 1.0}, 1e-3, 1e-6), 0.8 * root * 0.5);
  // The second is at zero, where 1e-6 / 1e-3 counts for it; as much as the other at 2.
  EXPECT_DOUBLE_EQ(first({4.0, 0.0}, 1e-3, 1e-6), 0.8 * root * 1.0);
  EXPECT_DOUBLE_EQ(first({4.0, 0.0}, 1e-3, 1e-7), 0.8 * root * 0.1);
}

TEST(VariableStep, GrowsAtMostFivefold) {
  auto stepper = VariableStep<State1>::make({}).value();
  const auto line = [](double, const State1&) -> State1 { return State1(1.0); };
  State1 x(1.0);
  double t = 0.0;
  double last = 0.0;
  for (int k = 0; k < 5; ++k) {
    const double next = stepper.advance(line, t, x, 1e9).value();
    if (k > 0) {
      EXPECT_NEAR((next - t) / last, 5.0, 1e-9);
    }
    last = next - t;
    t = next;
  }
}

// The estimate of a polynomial of degree 5 is kappa h^5 exactly, so the steps settle at once where
// h = h q^(-1/5) / 1.25, at q = 1.25^-5.
TEST(VariableStep, NextStepByItsRule) {
  const auto fourth = [](double t, const State1&) -> State1 { return State1(5.0 * t * t * t * t); };
  // An error of 1 is allowed as long as x = t^5 is below 1e9.
  auto stepper =
      VariableStep<State1>::make({.relative_tolerance = 1e-9, .absolute_tolerance = 1.0}).value();
  State1 x(1.0);
  std::vector<double> t{1.0};
  for (int k = 0; k < 6; ++k) t.push_back(stepper.advance(fourth, t.back(), x, 1e9).value());
  ASSERT_LT(x[0], 1e9);
  const double h = t[6] - t[5];
  EXPECT_NEAR(h, t[5] - t[4], 1e-6 * h);
  boost::numeric::odeint::runge_kutta_dopri5<double> theirs;
  const auto system = [&](double, double& rate, double time) { rate = fourth(time, {})[0]; };
  double end = 0.0, rate_end = 0.0, difference = 0.0;
  theirs.do_step(system, 0.0, fourth(t[5], {})[0], t[5], end, rate_end, h, difference);
  EXPECT_NEAR(std::abs(difference), std::pow(1.25, -5), 1e-5);
  // An error of q times what is allowed: refused, and tried again with 0.8 h / q^(1/5).
  const double q = 16 * std::pow(1.25, -5);
  const auto steeper = [&](double time, const State1& state) -> State1 {
    return State1(16.0 * fourth(time, state)[0]);
  };
  const double shorter = stepper.advance(steeper, t[6], x, 1e9).value() - t[6];
  EXPECT_NEAR(shorter, 0.8 * h * std::pow(q, -0.2), 1e-5 * h);
}

TEST(VariableStep, EndIsMetAndDoesNotShortenTheNextStep) {
  const auto decay = [](double, const State1& x) -> State1 { return -x; };
  auto free = VariableStep<State1>::make({}).value();
  auto cut = free;
  State1 x(1.0), y(1.0);
  double t = 0.0;
  for (int k = 0; k < 4; ++k) t = free.advance(decay, t, x, 1e9).value();
  double s = 0.0;
  for (int k = 0; k < 4; ++k) s = cut.advance(decay, s, y, 1e9).value();
  ASSERT_EQ(s, t);
  // From here one goes on, the other has to stop after a thousandth.
  const double whole = free.advance(decay, t, x, 1e9).value() - t;
  const double end = t + 1e-3 * whole;
  EXPECT_EQ(cut.advance(decay, s, y, end).value(), end);
  const double after = cut.advance(decay, end, y, 1e9).value() - end;
  EXPECT_GE(after, 0.99 * whole);
}

// exp(-t) at 1e-9: what counts is the 1 that it was, so that only stability limits the step (3.3).
TEST(VariableStep, LargestMagnitudeIsRemembered) {
  const auto decay = [](double, const State1& x) -> State1 { return -x; };
  auto stepper =
      VariableStep<State1>::make({.relative_tolerance = 1e-6, .absolute_tolerance = 1e-20}).value();
  State1 x(1.0);
  double t = 0.0;
  double longest = 0.0;
  while (t < 20.0) {
    const double next = stepper.advance(decay, t, x, 30.0).value();
    longest = next - t;
    t = next;
  }
  EXPECT_GT(longest, 2.0);
}

// Not only to rounding: t + (end - t) is another number for some of these.
TEST(VariableStep, EndIsMetExactly) {
  const auto rest = [](double, const State1&) -> State1 { return State1(0.0); };
  int rounded = 0;
  for (int k = 1; k < 1000; ++k) {
    auto stepper = VariableStep<State1>::make({}).value();
    State1 x(1.0);
    const double t = 1e-3 / k;
    const double end = 0.01 * k;
    rounded += t + (end - t) != end ? 1 : 0;
    EXPECT_EQ(stepper.advance(rest, t, x, end).value(), end);
  }
  EXPECT_GT(rounded, 0);
}

// A jump at `end` is no harm: the next step starts anew. One inside a step is found and refused
// until the step before it is short.
TEST(VariableStep, JumpsOfTheRightHandSide) {
  double input = 1.0;
  int calls = 0;
  const auto held = [&](double, const State1& x) -> State1 {
    ++calls;
    return State1(input - x[0]);
  };
  auto stepper =
      VariableStep<State1>::make({.relative_tolerance = 1e-8, .absolute_tolerance = 1e-9}).value();
  State1 x(0.0);
  double t = 0.0;
  while (t < 1.0) t = stepper.advance(held, t, x, 1.0).value();
  EXPECT_EQ(t, 1.0);
  input = -1.0;
  while (t < 2.0) t = stepper.advance(held, t, x, 2.0).value();
  EXPECT_NEAR(x[0], (1.0 - std::exp(-1.0) + 1.0) * std::exp(-1.0) - 1.0, 1e-7);
  const int smooth = calls;

  calls = 0;
  const auto jumps = [&](double time, const State1& state) -> State1 {
    ++calls;
    return State1((time < 1.0 ? 1.0 : -1.0) - state[0]);
  };
  auto other =
      VariableStep<State1>::make({.relative_tolerance = 1e-8, .absolute_tolerance = 1e-9}).value();
  x[0] = 0.0;
  t = 0.0;
  while (t < 2.0) t = other.advance(jumps, t, x, 2.0).value();
  EXPECT_NEAR(x[0], (1.0 - std::exp(-1.0) + 1.0) * std::exp(-1.0) - 1.0, 1e-7);
  EXPECT_GT(calls, smooth + 70);  // ten refused steps and more
}

TEST(VariableStep, ARefusedStepIsNotFollowedByALongerOne) {
  // Smooth, then fast: the step that runs into it is refused.
  const auto burst = [](double t, const State1&) -> State1 {
    return State1(t < 10.0 ? 1e-3 : std::cos(50.0 * t));
  };
  auto stepper = VariableStep<State1>::make({}).value();
  State1 x(1.0);
  double t = 0.0;
  std::vector<double> h;
  while (t < 12.0) {
    const double next = stepper.advance(burst, t, x, 12.0).value();
    h.push_back(next - t);
    t = next;
  }
  // Where the length falls to half or less it had been refused: the next is not longer.
  int seen = 0;
  for (std::size_t k = 1; k + 2 < h.size(); ++k) {
    if (h[k] > 0.5 * h[k - 1]) continue;
    ++seen;
    EXPECT_LE(h[k + 1], h[k] * (1.0 + 1e-9)) << k;
  }
  EXPECT_GT(seen, 0);
}

TEST(VariableStep, ASolutionThatEndsIsAnError) {
  // x = 1/(1 - t).
  const auto square = [](double, const State1& x) -> State1 { return State1(x[0] * x[0]); };
  auto stepper = VariableStep<State1>::make({}).value();
  State1 x(1.0);
  double t = 0.0;
  for (int k = 0; k < 100000; ++k) {
    const State1 before = x;
    const auto next = stepper.advance(square, t, x, 2.0);
    if (!next) {
      EXPECT_EQ(refusal(next),
                "t: is the time at which the step falls below the resolution of time");
      EXPECT_NEAR(next.error().value, 1.0, 1e-2);
      EXPECT_EQ(x, before);
      return;
    }
    ASSERT_GT(*next, t);
    t = *next;
  }
  FAIL() << "passed the end of the solution, t = " << t;
}

TEST(VariableStep, BadNumbersOfTheRightHandSideAreAnError) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, -infinity}) {
    for (int element = 0; element < 2; ++element) {
      for (int stage = 0; stage < 8; ++stage) {  // 0: the rate that sets the first step
        int call = 0;
        const auto rhs = [&](double, const State2& x) -> State2 {
          State2 rate = -x;
          // From this stage of the first step on, as a state that went bad stays bad.
          if (call++ >= stage) rate[element] = bad;
          return rate;
        };
        auto stepper = VariableStep<State2>::make({}).value();
        State2 x(1.0, 1.0);
        EXPECT_FALSE(stepper.advance(rhs, 0.0, x, 1.0)) << bad << ' ' << element << ' ' << stage;
        EXPECT_EQ(x, State2(1.0, 1.0));
      }
    }
  }
  auto stepper = VariableStep<State2>::make({}).value();
  State2 x(nan, 1.0);
  EXPECT_FALSE(stepper.advance(nonlinear, 0.0, x, 1.0));
}

TEST(VariableStep, AnEndThatIsNotAheadIsAnError) {
  auto stepper = VariableStep<State2>::make({}).value();
  State2 x(1.0, 0.5);
  EXPECT_FALSE(stepper.advance(nonlinear, 1.0, x, 1.0));
  EXPECT_FALSE(stepper.advance(nonlinear, 1.0, x, 0.5));
  EXPECT_TRUE(stepper.advance(nonlinear, 1.0, x, 1.5));
}

TEST(VariableStep, RefusedConfigs) {
  const auto error = [](double relative, double absolute) {
    const auto made = VariableStep<State2>::make(
        {.relative_tolerance = relative, .absolute_tolerance = absolute});
    return made ? std::string() : std::string(made.error().field) + " " + made.error().rule;
  };
  EXPECT_EQ(error(1e-3, 1e-6), "");
  EXPECT_EQ(error(std::nextafter(1.0, 0.0), 1e-6), "");
  EXPECT_EQ(error(1.0, 1e-6), "relative_tolerance must be below 1");
  for (const double bad : {0.0, -1e-3, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(error(bad, 1e-6), "relative_tolerance must be finite and positive") << bad;
    EXPECT_EQ(error(1e-3, bad), "absolute_tolerance must be finite and positive") << bad;
  }
}

TEST(VariableStep, Float) {
  using StateF = EigenMatrix<float, 1>;
  auto stepper = VariableStep<StateF>::make({.relative_tolerance = 1e-4F}).value();
  StateF x(1.0F);
  float t = 0.0F;
  const auto decay = [](float, const StateF& state) -> StateF { return -state; };
  while (t < 1.0F) t = stepper.advance(decay, t, x, 1.0F).value();
  EXPECT_NEAR(x[0], std::exp(-1.0F), 2e-4F);
}

}  // namespace sim_dormand_prince_test
