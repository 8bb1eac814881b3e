#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <concepts>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/reference.hpp>
#include <esokit/core/pack.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace control_adrc_law_test {

using esokit::AdrcLaw;
using esokit::Array;
using esokit::EigenMatrix;
using esokit::LinearEso;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::refusal;

TEST(AdrcLaw, GainsFromTheBandwidth) {
  // (s + 2)^2 = s^2 + 4 s + 4: the gains of the paper's generic example.
  const auto two = AdrcLaw<2>::make({.controller_bandwidth = 2, .input_gain = 1}).value();
  EXPECT_EQ(two.gains(), (Array<double, 2>{4, 4}));
  // (s + 1.5)^4 = s^4 + 6 s^3 + 13.5 s^2 + 13.5 s + 5.0625: of its PVTOL example.
  const auto four = AdrcLaw<4>::make({.controller_bandwidth = 1.5, .input_gain = 1}).value();
  EXPECT_EQ(four.gains(), (Array<double, 4>{5.0625, 13.5, 13.5, 6}));
  const auto one = AdrcLaw<1, float>::make({.controller_bandwidth = 3.0f, .input_gain = 1}).value();
  EXPECT_EQ(one.gains(), (Array<float, 1>{3.0f}));
}

TEST(AdrcLaw, LiteralControl) {
  const auto law = AdrcLaw<2>::make({.gains = {{3, 5}}, .input_gain = -2}).value();
  EXPECT_EQ(law.input_gain(), -2);
  const EigenMatrix<double, 4> estimate(1, 2, 7, 100);  // y, y', d, d'
  const EigenMatrix<double, 3> reference(4, 6, 8);
  // v = 8 + 3 (4 - 1) + 5 (6 - 2) = 37; u = (37 - 7) / -2
  EXPECT_EQ(law.feedback(estimate, reference), 37);
  EXPECT_EQ(law.control(estimate, reference), -15);
  // v = 3 (4 - 1) + 5 (0 - 2) = -1; u = (-1 - 7) / -2
  EXPECT_EQ(law.control(estimate, 4.0), 4);
  // v = 3 (4 - 1) + 5 (6 - 2) = 29
  EXPECT_EQ(law.control(estimate, {4.0, 6.0}), -11);
  // error-based: u = (7 + 3 + 10) / -2
  EXPECT_EQ(law.control_error_based(estimate), -10);
  // Any source of state estimates will do for the feedback, it need not know the disturbance.
  EXPECT_EQ(law.feedback(EigenMatrix<double, 2>(1, 2), reference), 37);
}

template <class S>
void made_of_anything() {
  using R = esokit::Reference<2, S>;
  const auto rows = [](const R& r) {
    return std::array<double, 4>{double(r.moves()), r(0), r(1), r(2)};
  };
  EXPECT_EQ(rows(S(3)), (std::array<double, 4>{0, 3, 0, 0}));
  EXPECT_EQ(rows(3), (std::array<double, 4>{0, 3, 0, 0}));
  EXPECT_EQ(rows({S(3)}), (std::array<double, 4>{0, 3, 0, 0}));
  EXPECT_EQ(rows({S(3), 5}), (std::array<double, 4>{1, 3, 5, 0}));
  EXPECT_EQ(rows({S(3), S(5), S(7)}), (std::array<double, 4>{1, 3, 5, 7}));
  // A vector of one element moves: its other rows are known to be zero only by chance.
  EXPECT_EQ(rows(esokit::Vector<S, 1>(S(3))), (std::array<double, 4>{1, 3, 0, 0}));
  EXPECT_EQ(rows(esokit::Vector<S, 2>(S(3), S(5))), (std::array<double, 4>{1, 3, 5, 0}));
  EXPECT_EQ(rows(EigenMatrix<S, 3>(3, 5, 7)), (std::array<double, 4>{1, 3, 5, 7}));
  EXPECT_EQ(R({S(3), S(5)}).all(), (esokit::Vector<S, 3>(S(3), S(5), S(0))));
  static_assert(!std::convertible_to<const char*, R> && !std::default_initializable<R>);
}
TEST(Reference, FromANumberAListOrAVector) {
  made_of_anything<double>();
  made_of_anything<float>();
  using Two = esokit::Pack<double, 2>;
  const esokit::Reference<2, Two> constant = Two(3), moving = {Two({3, 4}), Two(5)};
  EXPECT_FALSE(constant.moves());
  EXPECT_EQ(constant(0)[1], 3);
  EXPECT_TRUE(moving.moves());
  EXPECT_EQ(moving(0)[1], 4);
  EXPECT_EQ(moving(1)[1], 5);
  EXPECT_EQ(moving(2)[1], 0);
}

template <class S>
std::string refused(const typename AdrcLaw<2, S>::Config& config) {
  return refusal(AdrcLaw<2, S>::make(config));
}

TEST(AdrcLaw, RefusesBadConfigs) {
  using Law = AdrcLaw<2>;
  const double nan = hidden_nan<double>();
  const double inf = hidden_infinity<double>();
  for (const double bad : {0.0, -1.0, nan, inf, -inf}) {
    EXPECT_EQ(refused<double>({.controller_bandwidth = bad, .input_gain = 1}),
              "controller_bandwidth: must be finite and positive")
        << bad;
  }
  for (const double bad : {1e200, 1e-200}) {
    EXPECT_EQ(refused<double>({.controller_bandwidth = bad, .input_gain = 1}),
              "controller_bandwidth: gives a gain that the scalar cannot hold");
  }
  for (const double bad : {0.0, -0.0, nan, inf, -inf}) {
    EXPECT_EQ(refused<double>({.controller_bandwidth = 1, .input_gain = bad}),
              "input_gain: must be finite and not zero (negative is fine)")
        << bad;
  }
  for (const double bad : {1e-310, 1.5e308}) {
    EXPECT_EQ(refused<double>({.controller_bandwidth = 1, .input_gain = bad}),
              "input_gain: has an inverse that the scalar cannot hold");
  }
  EXPECT_EQ(refused<double>({.input_gain = 1}),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(refused<double>({.controller_bandwidth = 1, .gains = {{1, 2}}, .input_gain = 1}),
            "controller_bandwidth: must be left out if gains is given");
  EXPECT_EQ(refused<double>({.controller_bandwidth = nan, .gains = {{1, 2}}, .input_gain = 1}),
            "controller_bandwidth: must be left out if gains is given");
  for (const double bad : {nan, inf, -inf}) {
    const auto refused = Law::make({.gains = {{1, bad}}, .input_gain = 1});
    EXPECT_EQ(refusal(refused), "gains[1]: must be finite");
  }
  EXPECT_EQ(refused<float>({.controller_bandwidth = 1e30f, .input_gain = 1}),
            "controller_bandwidth: gives a gain that the scalar cannot hold");
  EXPECT_TRUE(Law::make({.controller_bandwidth = 1, .input_gain = -1}));
  EXPECT_TRUE(Law::make({.gains = {{0, -1}}, .input_gain = 1})) << "any finite gain is the user's";
}

/// A double integrator with a constant disturbance, exactly sampled.
struct Plant {
  double y = 0, v = 0;
  void step(double u, double d, double b0, double t) {
    const double a = d + b0 * u;
    y += t * v + t * t / 2 * a;
    v += t * a;
  }
};

TEST(AdrcLaw, BringsThePlantToTheReference) {
  const double t = 0.01;
  for (const double b0 : {2.5, -2.5}) {
    auto observer =
        LinearEso<2>::make({.observer_bandwidth = 60, .input_gain = b0, .sample_time = t}).value();
    const auto law = AdrcLaw<2>::make({.controller_bandwidth = 5, .input_gain = b0}).value();
    Plant plant;
    double u = 0;
    for (int k = 0; k < 1000; ++k) {
      plant.step(u, 3.0, b0, t);
      observer.update(plant.y, u);
      u = law.control(observer.estimate(), 1.0);
    }
    EXPECT_NEAR(plant.y, 1, 1e-9);
    EXPECT_NEAR(observer.total_disturbance(), 3, 1e-8);
    EXPECT_NEAR(u, -3 / b0, 1e-8);
  }
}

/// Fed with e = r - y and the input gain -b0 the error-based form is the output-based one while r
/// is constant: z_1 = r - z_1, the other states and the disturbance change sign.
TEST(AdrcLaw, ErrorBasedEqualsOutputBasedForAConstantReference) {
  const double t = 0.01;
  const double b0 = -1.7;
  const double r = 0.8;
  auto output =
      LinearEso<2>::make({.observer_bandwidth = 50, .input_gain = b0, .sample_time = t}).value();
  auto error =
      LinearEso<2>::make({.observer_bandwidth = 50, .input_gain = -b0, .sample_time = t}).value();
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 4, .input_gain = b0}).value();
  output.reset(0.0);
  error.reset(r);
  Plant a;
  Plant b;
  double ua = 0;
  double ub = 0;
  for (int k = 0; k < 400; ++k) {
    const double d = 2 * std::sin(0.03 * k);
    a.step(ua, d, b0, t);
    b.step(ub, d, b0, t);
    output.update(a.y, ua);
    error.update(r - b.y, ub);
    ua = law.control(output.estimate(), r);
    ub = law.control_error_based(error.estimate());
    ASSERT_NEAR(ua, ub, 1e-10) << k;
    ASSERT_NEAR(output.total_disturbance(), -error.total_disturbance(), 1e-9) << k;
    ASSERT_NEAR(a.y, b.y, 1e-12) << k;
  }
}

/// In a settled loop, where the applied input is the one that the law asks for, a change of b0 does
/// not move the control: neither in the output-based form nor in the error-based one.
TEST(AdrcLaw, ChangeOfInputGainDoesNotJump) {
  const double t = 0.01;
  const auto law = [](double b0) {
    return AdrcLaw<2>::make({.controller_bandwidth = 4, .input_gain = b0}).value();
  };
  using Cascade = esokit::CascadeEso<2, 2>;
  const auto config = [&](double b0) -> Cascade::Config {
    return {.observer_bandwidth = 20, .bandwidth_factor = 2, .input_gain = b0, .sample_time = t};
  };
  auto output = Cascade::make(config(2)).value();
  auto error = Cascade::make(config(-2)).value();
  Plant a;
  Plant b;
  double ua = 0;
  double ub = 0;
  for (int k = 0; k < 3000; ++k) {
    a.step(ua, 3.0, 2, t);
    b.step(ub, 3.0, 2, t);
    output.update(a.y, ua);
    error.update(1.0 - b.y, ub);
    ua = law(2).control(output.estimate(), 1.0);
    ub = law(2).control_error_based(error.estimate());
  }
  ASSERT_NEAR(ua, -1.5, 1e-9);
  ASSERT_NEAR(ub, -1.5, 1e-9);
  for (const double b0 : {3.1, 0.7, -2.2}) {
    auto out = output;
    auto err = error;
    ASSERT_TRUE(out.retune(config(b0)));
    ASSERT_TRUE(err.retune(config(-b0)));
    // The last applied input is the asked-for one up to the noise of rounding in the loop.
    const double noise = std::abs(ua - out.applied_input()) + std::abs(ub - err.applied_input());
    ASSERT_LT(noise, 1e-9);
    const double allowed = 1e-12 * 1.5 + 10 * noise;
    EXPECT_NEAR(law(b0).control(out.estimate(), 1.0), ua, allowed);
    EXPECT_NEAR(law(b0).control_error_based(err.estimate()), ub, allowed);
  }
}

}  // namespace control_adrc_law_test
