// Every bad config is refused with an error that names the field. Also compiled with -ffast-math,
// where a comparison with NaN may go either way.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/core/error_text.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <type_traits>
#include <vector>

namespace observer_refused_config_test {

using esokit::CascadeEso;
using esokit::ContinuousCascadeEso;
using esokit::ContinuousLinearEso;
using esokit::LinearEso;
using esokit::PoleSet;
using esokit_test::hidden;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::refusal;

template <class S>
class Refused : public ::testing::Test {
 protected:
  static constexpr S tiny_value = std::is_same_v<S, float> ? S(1e-30) : S(1e-250);
  std::vector<S> not_positive{
      S(0), -S(0), S(-1), hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()};
  std::vector<S> not_nonzero{S(0), -S(0), hidden_nan<S>(), hidden_infinity<S>(),
                             -hidden_infinity<S>()};
  std::vector<S> not_finite{hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()};
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Refused, Scalars);

TYPED_TEST(Refused, LinearEso) {
  using S = TypeParam;
  using Observer = LinearEso<2, S>;
  const typename Observer::Config good{
      .observer_bandwidth = S(50), .input_gain = S(2), .sample_time = S(0.01)};
  EXPECT_EQ(refusal(Observer::make(good)), "accepted");
  for (const S bad : this->not_positive) {
    auto config = good;
    config.observer_bandwidth = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "observer_bandwidth: must be finite and positive");
    config = good;
    config.sample_time = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "sample_time: must be finite and positive");
  }
  for (const S bad : this->not_nonzero) {
    auto config = good;
    config.input_gain = bad;
    EXPECT_EQ(refusal(Observer::make(config)),
              "input_gain: must be finite and not zero (negative is fine)");
  }
  auto config = good;
  config.input_gain = S(-2);
  EXPECT_EQ(refusal(Observer::make(config)), "accepted");
  for (const int bad : {0, -1, std::numeric_limits<int>::min(), 65001, 70000}) {
    config = good;
    config.max_gap = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "max_gap: must be 1 .. 65000") << bad;
  }
  for (const int good_gap : {1, 65000}) {
    config.max_gap = good_gap;
    EXPECT_EQ(refusal(Observer::make(config)), "accepted");
  }
  // Nothing set at all: the defaults are no design.
  EXPECT_EQ(refusal(Observer::make({})),
            "input_gain: must be finite and not zero (negative is fine)");
}

/// Gains that are zero, subnormal or infinite in the scalar.
TYPED_TEST(Refused, WhatTheScalarCannotHold) {
  using S = TypeParam;
  using Observer = LinearEso<2, S>;
  EXPECT_EQ(refusal(Observer::make(
                {.observer_bandwidth = this->tiny_value, .input_gain = 1, .sample_time = S(0.01)})),
            "observer_bandwidth: times sample_time gives a gain that the scalar cannot hold");
  // 1/T is infinite (of a T that -ffast-math may take for zero) or subnormal; b0 T^2 / 2 is zero or
  // infinite.
  for (const S bad : {std::numeric_limits<S>::denorm_min(), std::numeric_limits<S>::max()}) {
    const auto made =
        Observer::make({.observer_bandwidth = 1, .input_gain = 1, .sample_time = bad});
#if defined(__FAST_MATH__)
    if (bad < 1) {
      EXPECT_STREQ(made.error().field, "sample_time");
      continue;
    }
#endif
    EXPECT_EQ(refusal(made), "sample_time: has an inverse that the scalar cannot hold");
  }
  EXPECT_EQ(refusal(Observer::make({.observer_bandwidth = S(1) / this->tiny_value,
                                    .input_gain = 1,
                                    .sample_time = this->tiny_value})),
            "input_gain: times T^n / n! gives a gain that the scalar cannot hold");
  EXPECT_EQ(refusal(Observer::make({.observer_bandwidth = 1,
                                    .input_gain = S(1) / this->tiny_value,
                                    .sample_time = S(1) / this->tiny_value})),
            "input_gain: times T^n / n! gives a gain that the scalar cannot hold");
  EXPECT_EQ(refusal(Observer::make({.observer_bandwidth = 1,
                                    .input_gain = std::numeric_limits<S>::max(),
                                    .sample_time = S(1000)})),
            "input_gain: times T^n / n! gives a gain that the scalar cannot hold");
  // Large but fine: all poles in the origin, deadbeat.
  EXPECT_EQ(refusal(Observer::make({.observer_bandwidth = S(1) / this->tiny_value,
                                    .input_gain = 1,
                                    .sample_time = S(0.01)})),
            "accepted");
}

TEST(RefusedInFloat, GainsThatUnderflow) {
  // omega_o T = 1e-3, N = 9: 1e-27 / 8! is held; N = 12: 1e-36 / 11! is not.
  EXPECT_EQ((refusal(LinearEso<8, float>::make(
                {.observer_bandwidth = 0.1f, .input_gain = 1, .sample_time = 0.01f}))),
            "accepted");
  EXPECT_EQ((refusal(LinearEso<8, float, 4>::make(
                {.observer_bandwidth = 0.1f, .input_gain = 1, .sample_time = 0.01f}))),
            "observer_bandwidth: times sample_time gives a gain that the scalar cannot hold");
  EXPECT_EQ((refusal(LinearEso<8, double, 4>::make(
                {.observer_bandwidth = 0.1, .input_gain = 1, .sample_time = 0.01}))),
            "accepted");
  EXPECT_EQ((refusal(CascadeEso<8, 2, float, 4>::make(
                {.level_bandwidths = {{100, 0.1f}}, .input_gain = 1, .sample_time = 0.01f}))),
            "level_bandwidths[1]: times sample_time gives a gain that the scalar cannot hold");
  EXPECT_EQ((refusal(ContinuousLinearEso<8, float, 4>::make(
                {.observer_bandwidth = 1e-4f, .input_gain = 1}))),
            "observer_bandwidth: gives a gain that the scalar cannot hold");
  EXPECT_EQ((refusal(ContinuousLinearEso<8, float, 4>::make(
                {.observer_bandwidth = 1e5f, .input_gain = 1}))),
            "observer_bandwidth: gives a gain that the scalar cannot hold");
}

TYPED_TEST(Refused, CascadeByFactor) {
  using S = TypeParam;
  using Observer = CascadeEso<2, 3, S>;
  const typename Observer::Config good{.observer_bandwidth = S(50),
                                       .bandwidth_factor = S(2),
                                       .input_gain = S(2),
                                       .sample_time = S(0.01)};
  EXPECT_EQ(refusal(Observer::make(good)), "accepted");
  for (const S bad : this->not_positive) {
    auto config = good;
    config.observer_bandwidth = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "observer_bandwidth: must be finite and positive");
    config = good;
    config.sample_time = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "sample_time: must be finite and positive");
    config = good;
    config.bandwidth_factor = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "bandwidth_factor: must be finite and above");
  }
  for (const S bad : this->not_nonzero) {
    auto config = good;
    config.input_gain = bad;
    EXPECT_EQ(refusal(Observer::make(config)),
              "input_gain: must be finite and not zero (negative is fine)");
  }
  // alpha <= 1: the error says which limit.
  for (const S bad : {S(1), S(0.5), S(-3)}) {
    auto config = good;
    config.bandwidth_factor = bad;
    const auto made = Observer::make(config);
    ASSERT_EQ(refusal(made), "bandwidth_factor: must be finite and above");
    EXPECT_EQ(made.error().value, bad);
    EXPECT_TRUE(made.error().has_limit);
    EXPECT_EQ(made.error().limit, S(1));
  }
  auto config = good;
  config.max_gap = 0;
  EXPECT_EQ(refusal(Observer::make(config)), "max_gap: must be 1 .. 65000");
  // A factor so large that the last level is not finite.
  config = good;
  config.bandwidth_factor = std::numeric_limits<S>::max() / S(1000);
  EXPECT_EQ(
      refusal(Observer::make(config)),
      "bandwidth_factor: with observer_bandwidth gives a bandwidth that the scalar cannot hold");
  // One level needs no factor, but a wrong one is wrong.
  EXPECT_EQ((refusal(CascadeEso<2, 1, S>::make(
                {.observer_bandwidth = 50, .input_gain = 2, .sample_time = S(0.01)}))),
            "accepted");
  EXPECT_EQ((refusal(CascadeEso<2, 1, S>::make({.observer_bandwidth = 50,
                                                .bandwidth_factor = S(0.5),
                                                .input_gain = 2,
                                                .sample_time = S(0.01)}))),
            "bandwidth_factor: must be finite and above");
  EXPECT_EQ((refusal(CascadeEso<2, 1, S>::make({.observer_bandwidth = 50,
                                                .bandwidth_factor = hidden_nan<S>(),
                                                .input_gain = 2,
                                                .sample_time = S(0.01)}))),
            "bandwidth_factor: must be finite and above");
}

TYPED_TEST(Refused, CascadeByLevels) {
  using S = TypeParam;
  using Observer = CascadeEso<2, 2, S>;
  const typename Observer::Config good{
      .level_bandwidths = {{20, 60}}, .input_gain = S(2), .sample_time = S(0.01)};
  EXPECT_EQ(refusal(Observer::make(good)), "accepted");
  for (std::size_t i = 0; i < 2; ++i) {
    for (const S bad : this->not_positive) {
      auto config = good;
      (*config.level_bandwidths)[i] = bad;
      EXPECT_EQ(refusal(Observer::make(config)),
                "level_bandwidths[" + std::to_string(i) + "]: must be finite and positive");
    }
  }
  // Both ways at once.
  for (const S given : {S(20), S(-20), hidden_nan<S>(), hidden_infinity<S>()}) {
    auto config = good;
    config.observer_bandwidth = given;
    EXPECT_EQ(refusal(Observer::make(config)),
              "observer_bandwidth: must be left out if level_bandwidths is given");
    config = good;
    config.bandwidth_factor = given;
    EXPECT_EQ(refusal(Observer::make(config)),
              "bandwidth_factor: must be left out if level_bandwidths is given");
  }
}

TYPED_TEST(Refused, PoleSets) {
  using S = TypeParam;
  using Complex = std::complex<S>;
  using Observer = LinearEso<2, S, 1, PoleSet>;
  const typename Observer::Config good{.poles = {Complex(-20, 5), S(-30), Complex(-20, -5)},
                                       .input_gain = S(2),
                                       .sample_time = S(0.01)};
  EXPECT_EQ(refusal(Observer::make(good)), "accepted");
  for (const S bad : this->not_finite) {
    auto config = good;
    config.poles[1] = Complex(bad, 0);
    EXPECT_EQ(refusal(Observer::make(config)), "poles[1]: must have a finite real part");
    config = good;
    config.poles[2] = Complex(-20, bad);
    EXPECT_EQ(refusal(Observer::make(config)), "poles[2]: must have a finite imaginary part");
  }
  for (const S bad : {S(0), -S(0), S(1), S(1e-6)}) {
    auto config = good;
    config.poles[1] = Complex(bad, 0);
    EXPECT_EQ(refusal(Observer::make(config)), "poles[1]: must have a negative real part")
        << "unstable";
  }
  auto config = good;
  config.poles[0] = Complex(2, 5);
  config.poles[2] = Complex(2, -5);
  EXPECT_EQ(refusal(Observer::make(config)), "poles[0]: must have a negative real part")
      << "unstable pair";
  config = good;
  config.poles[2] = Complex(-20, 5);
  EXPECT_EQ(refusal(Observer::make(config)),
            "poles[0]: is complex without its conjugate in the set")
      << "no conjugate";
  config = good;
  config.poles[2] = Complex(-21, -5);
  EXPECT_EQ(refusal(Observer::make(config)),
            "poles[0]: is complex without its conjugate in the set")
      << "not quite the conjugate";
  config = good;
  config.poles[1] = Complex(-20, 5);
  EXPECT_EQ(refusal(Observer::make(config)),
            "poles[0]: is complex without its conjugate in the set")
      << "two for one conjugate";
  config = good;
  config.poles[1] = Complex(-30, 1);
  EXPECT_EQ(refusal(Observer::make(config)),
            "poles[1]: is complex without its conjugate in the set")
      << "complex and alone";
  EXPECT_EQ((refusal(LinearEso<3, S, 1, PoleSet>::make(
                {.poles = {Complex(-1, 2), Complex(-1, -2), Complex(-1, -2), Complex(-1, 2)},
                 .input_gain = 1,
                 .sample_time = S(0.1)}))),
            "accepted")
      << "a double pair";
  // Slow poles: the smallest gain is lost.
  config = good;
  for (auto& pole : config.poles) pole = -this->tiny_value;
  EXPECT_EQ(refusal(Observer::make(config)),
            "poles: times sample_time gives a gain that the scalar cannot hold");
  for (const S bad : this->not_positive) {
    config = good;
    config.sample_time = bad;
    EXPECT_EQ(refusal(Observer::make(config)), "sample_time: must be finite and positive");
  }
  for (const S bad : this->not_nonzero) {
    config = good;
    config.input_gain = bad;
    EXPECT_EQ(refusal(Observer::make(config)),
              "input_gain: must be finite and not zero (negative is fine)");
  }
}

TYPED_TEST(Refused, PoleSetsOfACascade) {
  using S = TypeParam;
  using Complex = std::complex<S>;
  using Observer = CascadeEso<1, 2, S, 1, PoleSet>;
  const typename Observer::Config good{
      .level_poles = {{{S(-1), S(-2)}, {Complex(-3, 1), Complex(-3, -1)}}},
      .input_gain = S(2),
      .sample_time = S(0.01)};
  EXPECT_EQ(refusal(Observer::make(good)), "accepted");
  auto config = good;
  config.level_poles[1][1] = Complex(-3, 1);
  EXPECT_EQ(refusal(Observer::make(config)),
            "level_poles[2]: is complex without its conjugate in the set");
  config = good;
  config.level_poles[0][1] = hidden_nan<S>();
  EXPECT_EQ(refusal(Observer::make(config)), "level_poles[1]: must have a finite real part");
  EXPECT_EQ(refusal(Observer::make({})),
            "input_gain: must be finite and not zero (negative is fine)");
}

TYPED_TEST(Refused, ContinuousObservers) {
  using S = TypeParam;
  using Complex = std::complex<S>;
  for (const S bad : this->not_positive) {
    EXPECT_EQ(
        (refusal(ContinuousLinearEso<2, S>::make({.observer_bandwidth = bad, .input_gain = 1}))),
        "observer_bandwidth: must be finite and positive");
    EXPECT_EQ((refusal(ContinuousCascadeEso<2, 2, S>::make(
                  {.observer_bandwidth = bad, .bandwidth_factor = 2, .input_gain = 1}))),
              "observer_bandwidth: must be finite and positive");
    EXPECT_EQ((refusal(ContinuousCascadeEso<2, 2, S>::make(
                  {.observer_bandwidth = 1, .bandwidth_factor = bad, .input_gain = 1}))),
              "bandwidth_factor: must be finite and above");
    EXPECT_EQ((refusal(ContinuousCascadeEso<2, 2, S>::make(
                  {.level_bandwidths = {{1, bad}}, .input_gain = 1}))),
              "level_bandwidths[1]: must be finite and positive");
  }
  for (const S bad : this->not_nonzero) {
    EXPECT_EQ(
        (refusal(ContinuousLinearEso<2, S>::make({.observer_bandwidth = 1, .input_gain = bad}))),
        "input_gain: must be finite and not zero (negative is fine)");
    EXPECT_EQ((refusal(ContinuousCascadeEso<2, 2, S>::make(
                  {.observer_bandwidth = 1, .bandwidth_factor = 2, .input_gain = bad}))),
              "input_gain: must be finite and not zero (negative is fine)");
  }
  EXPECT_EQ((refusal(ContinuousLinearEso<1, S, 1, PoleSet>::make(
                {.poles = {Complex(-1, 1), Complex(-1, 1)}, .input_gain = 1}))),
            "poles[0]: is complex without its conjugate in the set");
  EXPECT_EQ((refusal(ContinuousLinearEso<1, S, 1, PoleSet>::make(
                {.poles = {S(-1), S(0)}, .input_gain = 1}))),
            "poles[1]: must have a negative real part");
}

TEST(RefusedText, SaysFieldValueAndRule) {
  const auto zero = LinearEso<2>::make({.observer_bandwidth = 50, .sample_time = 0.01});
  EXPECT_EQ(to_text(zero.error()),
            "input_gain = 0: must be finite and not zero (negative is fine)");
  const auto alpha = CascadeEso<2, 2>::make(
      {.observer_bandwidth = 50, .bandwidth_factor = 0.5, .input_gain = 1, .sample_time = 0.01});
  EXPECT_EQ(to_text(alpha.error()), "bandwidth_factor = 0.5: must be finite and above 1");
  const auto poles = LinearEso<1, double, 1, PoleSet>::make(
      {.poles = {-1.0, 2.0}, .input_gain = 1, .sample_time = 0.01});
  EXPECT_EQ(to_text(poles.error()), "poles[1] = 2: must have a negative real part");
  const auto gap = LinearEso<2>::make(
      {.observer_bandwidth = 50, .input_gain = 1, .sample_time = 0.01, .max_gap = 0});
  EXPECT_EQ(to_text(gap.error()).substr(0, 12), "max_gap = 0:");
}

}  // namespace observer_refused_config_test
