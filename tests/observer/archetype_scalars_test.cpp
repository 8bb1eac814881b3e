// The observers on a scalar that is no number of the machine: a dual number. Packs: pack_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/dual.hpp>
#include <support/numbers.hpp>

namespace observer_archetype_scalars_test {

using esokit::CascadeEso;
using esokit::LinearEso;
using esokit::StepStatus;
using esokit_test::Dual;
using esokit_test::hidden_nan;

/// An estimate after a run, as a function of one setting.
template <class S>
struct Settings {
  S bandwidth{40.0};
  S input_gain{2.0};
  S sample_time{0.01};
};

template <class S>
S linear_outcome(const Settings<S>& s) {
  auto eso = LinearEso<2, S>::make({.observer_bandwidth = s.bandwidth,
                                    .input_gain = s.input_gain,
                                    .sample_time = s.sample_time})
                 .value();
  const auto law =
      esokit::AdrcLaw<2, S>::make({.controller_bandwidth = S(3.0), .input_gain = s.input_gain})
          .value();
  S u(0.0);
  for (int k = 0; k < 40; ++k) {
    if (k % 6 == 4) {
      eso.predict(u);
    } else {
      eso.update(S(std::sin(0.1 * k)), u);
    }
    u = law.control(eso.estimate(), S(1.0));
  }
  return u;
}

template <class S>
S cascade_outcome(const Settings<S>& s) {
  auto eso = CascadeEso<1, 2, S, 2>::make({.observer_bandwidth = s.bandwidth,
                                           .bandwidth_factor = S(2.0),
                                           .input_gain = s.input_gain,
                                           .sample_time = s.sample_time})
                 .value();
  for (int k = 0; k < 30; ++k) eso.update(S(std::cos(0.2 * k)), S(0.3 * k));
  return eso.total_disturbance();
}

/// Central difference of step h: error h^2, rounding eps / h.
template <class F>
void expect_derivative(F&& outcome) {
  const auto check = [&](double Settings<double>::*plain, Dual Settings<Dual>::*dual) {
    Settings<Dual> seeded;
    (seeded.*dual).derivative = 1;
    const Dual exact = outcome(seeded);
    Settings<double> settings;
    const double h = 1e-5 * settings.*plain;
    settings.*plain += h;
    const double high = outcome(settings);
    settings.*plain -= 2 * h;
    const double low = outcome(settings);
    EXPECT_NEAR(exact.derivative / ((high - low) / (2 * h)), 1, 1e-6);
    EXPECT_DOUBLE_EQ(exact.value, outcome(Settings<double>{}));
    EXPECT_NE(exact.derivative, 0);
  };
  check(&Settings<double>::bandwidth, &Settings<Dual>::bandwidth);
  check(&Settings<double>::input_gain, &Settings<Dual>::input_gain);
  check(&Settings<double>::sample_time, &Settings<Dual>::sample_time);
}

TEST(Dual, DerivativeOfALinearEsoAndItsController) {
  expect_derivative([](const auto& settings) { return linear_outcome(settings); });
}

TEST(Dual, DerivativeOfACascade) {
  expect_derivative([](const auto& settings) { return cascade_outcome(settings); });
}

/// An infinite derivative is as bad as an infinite value.
TEST(Dual, BadDerivativeIsABadMeasurement) {
  auto eso = LinearEso<1, Dual>::make(
                 {.observer_bandwidth = Dual(10), .input_gain = Dual(1), .sample_time = Dual(0.1)})
                 .value();
  eso.update(Dual(1), Dual(0));
  EXPECT_EQ(eso.update(Dual(1, hidden_nan<double>()), Dual(0)), StepStatus::measurement_rejected);
  EXPECT_TRUE(std::isfinite(eso.estimate()(1).derivative));
}

}  // namespace observer_archetype_scalars_test
