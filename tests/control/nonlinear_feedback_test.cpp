// The nonlinear feedback law, against the formula and against the linear law.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/eigen.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_nonlinear_feedback_test {

using esokit::EigenMatrix;
using esokit::NonlinearFeedback;

double printed_fal(double e, double a, double delta) {
  if (std::abs(e) <= delta) return e / std::pow(delta, 1 - a);
  return std::pow(std::abs(e), a) * (e > 0 ? 1 : -1);
}

/// u = fal(e1) + fal(e2) - z3, the law of the NHOESO paper.
TEST(NonlinearFeedback, IsTheFormula) {
  const auto law = NonlinearFeedback<2>::make({.gains = {1.0, 2.5},
                                               .exponents = {1.0, 0.1},
                                               .linear_widths = {0.021, 0.001},
                                               .input_gain = -4})
                       .value();
  EXPECT_NEAR(law.input_gain(), -4, 1e-15);
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    const EigenMatrix<double, 4> z(random.uniform(-1, 1), random.uniform(-1, 1) * 1e-3,
                                   random.uniform(-3, 3), 7);
    const EigenMatrix<double, 2> r(random.uniform(-1, 1), random.uniform(-1, 1) * 1e-3);
    const double v =
        printed_fal(r(0) - z(0), 1.0, 0.021) + 2.5 * printed_fal(r(1) - z(1), 0.1, 0.001);
    EXPECT_NEAR(law.feedback(z, r), v, 1e-13);
    EXPECT_NEAR(law.control(z, r), (v - z(2)) / -4, 1e-13);
  }
}

/// Exponents of one: AdrcLaw with the same gains.
TEST(NonlinearFeedback, ExponentOneIsLinear) {
  const auto nonlinear = NonlinearFeedback<2>::make({.gains = {25, 10}, .input_gain = 2}).value();
  const auto linear = esokit::AdrcLaw<2>::make({.gains = {{25, 10}}, .input_gain = 2}).value();
  const EigenMatrix<double, 3> z(0.3, -0.7, 1.5);
  EXPECT_DOUBLE_EQ(nonlinear.control(z, {1.0, 0.5}), linear.control(z, {1.0, 0.5, 0.0}));
}

/// Of finite numbers a finite one, of the right sign; of a bad one a bad one, so that a limiter or
/// loop can tell.
template <class S>
void finite_of_finite() {
  const S largest = std::numeric_limits<S>::max();
  for (const S exponent : {S(0.5), S(1), S(1.5), S(3), S(40)}) {
    for (const S gain : {S(0), S(2), S(1e30)}) {
      for (const S b0 : {S(-1), S(1e-3)}) {
        const auto law = NonlinearFeedback<2, S>::make({.gains = {gain, gain},
                                                        .exponents = {exponent, exponent},
                                                        .linear_widths = {S(1), S(1)},
                                                        .input_gain = b0})
                             .value();
        for (const S a : {S(0), S(-1), S(1e10), -largest, largest}) {
          for (const S b : {S(0), S(1e10), -largest, largest}) {
            const EigenMatrix<S, 3> z(a, b, b);
            EXPECT_TRUE(std::isfinite(law.control(z, {-a, -b})))
                << exponent << ' ' << a << ' ' << b;
            EXPECT_TRUE(std::isfinite(law.feedback(z, {-b, -a})))
                << exponent << ' ' << a << ' ' << b;
          }
        }
        // Largest in the direction that reduces the error.
        if (gain > S(0)) {
          const EigenMatrix<S, 3> z(-largest, S(0), S(0));
          EXPECT_GT(law.control(z, {largest, S(0)}) * b0, S(0)) << exponent;
          EXPECT_LT(law.control(EigenMatrix<S, 3>(-z), {-largest, S(0)}) * b0, S(0)) << exponent;
        }
        const S bad = hidden_nan<S>();
        EXPECT_FALSE(std::isfinite(law.control(EigenMatrix<S, 3>(S(0), S(0), S(0)), {bad, S(0)})));
        EXPECT_FALSE(std::isfinite(law.control(EigenMatrix<S, 3>(S(0), S(0), bad), {S(0), S(0)})));
      }
    }
  }
}
TEST(NonlinearFeedback, FiniteOfFinite) {
  finite_of_finite<float>();
  finite_of_finite<double>();
}

TEST(NonlinearFeedback, RefusesByName) {
  using Law = NonlinearFeedback<2>;
  const auto refused = [](const Law::Config& config) { return refusal(Law::make(config)); };
  EXPECT_EQ(refused({.input_gain = 0}),
            "input_gain: must be finite and not zero (negative is fine)");
  for (const double bad : {1e-310, 1.5e308}) {
    EXPECT_EQ(refused({.input_gain = bad}),
              "input_gain: has an inverse that the scalar cannot hold");
  }
  EXPECT_EQ(refused({.exponents = {1, 0}, .input_gain = 1}),
            "exponents[1]: must be finite and positive");
  EXPECT_EQ(refused({.linear_widths = {0, 1}, .input_gain = 1}),
            "linear_widths[0]: must be finite and positive");
  EXPECT_EQ(refused({.gains = {1, hidden_nan<double>()}, .input_gain = 1}),
            "gains[1]: must be finite and not negative");
  EXPECT_EQ(refused({.gains = {-1, 1}, .input_gain = 1}),
            "gains[0]: must be finite and not negative");
}

}  // namespace control_nonlinear_feedback_test
}  // namespace esokit_test
