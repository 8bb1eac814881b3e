// AdjustableBandwidthEso: its identities, its switching rule against one written out by hand, what
// `make` refuses, and how the sampled form tends to the continuous one.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <cmath>
#include <esokit/core/error_text.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace observer_adjustable_bandwidth_eso_test {

using esokit::AdjustableBandwidthEso;
using esokit::ContinuousAdjustableBandwidthEso;
using esokit::has;
using esokit::LinearEso;
using esokit::SignReading;
using esokit::StepStatus;
using esokit::SwitchingRule;

template <int Order, class S, int Extension>
void ratio_of_one_is_linear_eso(SwitchingRule rule) {
  using Observer = AdjustableBandwidthEso<Order, S, Extension>;
  auto switched = Observer::make({.observer_bandwidth = S(25),
                                  .bandwidth_ratio = S(1),
                                  .rule = rule,
                                  .input_gain = S(-3),
                                  .sample_time = static_cast<S>(0.01)})
                      .value();
  auto linear =
      LinearEso<Order, S, Extension>::make(
          {.observer_bandwidth = S(25), .input_gain = S(-3), .sample_time = static_cast<S>(0.01)})
          .value();
  Random random(17);
  for (int k = 0; k < 500; ++k) {
    S y = static_cast<S>(random.uniform(-1, 1));
    const S u = static_cast<S>(random.uniform(-1, 1));
    if (k % 37 == 5) y = hidden_nan<S>();
    if (k % 23 < 3) {
      EXPECT_EQ(switched.predict(u), linear.predict(u));
    } else {
      EXPECT_EQ(switched.update(y, u), linear.update(y, u));
    }
    for (int r = 0; r < Observer::size; ++r) {
      ASSERT_TRUE(same_bits(switched.estimate()(r), linear.estimate()(r))) << k << ' ' << r;
    }
  }
}

TEST(AdjustableBandwidthEso, RatioOfOneIsLinearEsoBitForBit) {
  for (const auto rule : {SwitchingRule::abeso, SwitchingRule::beso}) {
    ratio_of_one_is_linear_eso<2, double, 1>(rule);
    ratio_of_one_is_linear_eso<1, double, 3>(rule);
    ratio_of_one_is_linear_eso<3, double, 2>(rule);
    ratio_of_one_is_linear_eso<2, float, 1>(rule);
  }
}

// ---- the rule

/// The observer as two linear ones that pass the estimate on: each sample the one is corrected that
/// the rule, written out here, asks for.
template <SignReading Reading>
void follows_rule(SwitchingRule rule) {
  constexpr double w = 40;
  constexpr double rho = 0.6;
  constexpr double T = 0.01;
  auto switched =
      AdjustableBandwidthEso<2, double, 1, Reading>::make({.observer_bandwidth = w,
                                                           .bandwidth_ratio = rho,
                                                           .rule = rule,
                                                           .allow_uncertified_switching = true,
                                                           .input_gain = 2,
                                                           .sample_time = T})
          .value();
  const auto linear = [&](double bandwidth) {
    return LinearEso<2>::make({.observer_bandwidth = bandwidth, .input_gain = 2, .sample_time = T})
        .value();
  };
  auto shrinking = linear(w * rho);
  auto otherwise = linear(rule == SwitchingRule::beso ? w / rho : w);
  Random random(3);
  bool has_previous = false;
  double previous = 0;
  int slow = 0;
  int fast = 0;
  for (int k = 0; k < 400; ++k) {
    const double y = random.uniform(-1, 1) + std::sin(0.05 * k);
    const double u = random.uniform(-1, 1);
    const bool missing = k % 50 > 46;
    const bool reset = k == 200;
    if (reset) {
      for (LinearEso<2>* one : {&shrinking, &otherwise}) one->reset(y);
      switched.reset(y);
      has_previous = false;
      continue;
    }
    if (missing) {
      if (k % 2 == 0) {
        switched.update(hidden_nan<double>(), u);
      } else {
        switched.predict(u);
      }
      for (LinearEso<2>* one : {&shrinking, &otherwise}) one->predict(u);
      continue;
    }
    const bool gap = shrinking.missed() > 0;
    for (LinearEso<2>* one : {&shrinking, &otherwise}) one->predict(u);
    const double innovation = y - shrinking.estimate()(0);
    double watched = std::abs(innovation);
    if (Reading == SignReading::printed) watched = -innovation;
    const bool shrinks = has_previous && !gap && watched < previous;
    (shrinks ? shrinking : otherwise).correct(y);
    // The other one goes on from the same estimate.
    const auto z = (shrinks ? shrinking : otherwise).estimate();
    shrinking.reset(z);
    otherwise.reset(z);
    previous = watched;
    has_previous = true;
    (shrinks ? slow : fast) += 1;

    const auto status = switched.update(y, u);
    EXPECT_EQ(status, gap ? StepStatus::gap_bridged : StepStatus::ok);
    EXPECT_NEAR(switched.innovation(), innovation, 1e-12);
    for (int r = 0; r < 3; ++r) {
      ASSERT_NEAR(switched.estimate()(r), z(r), 1e-10 * std::pow(w, r)) << "sample " << k;
    }
  }
  EXPECT_GT(slow, 100);
  EXPECT_GT(fast, 100);
}

TEST(AdjustableBandwidthEso, FollowsTheRuleWrittenOut) {
  for (const auto rule : {SwitchingRule::abeso, SwitchingRule::beso}) {
    follows_rule<SignReading::magnitude>(rule);
    follows_rule<SignReading::printed>(rule);
  }
}

/// An innovation of the same size does not shrink, and a dropped correction is not remembered.
TEST(AdjustableBandwidthEso, EqualMagnitudeAndDroppedSamples) {
  using Law = esokit::SwitchedGain<3, double>;
  const auto slow = Law::Set::make("", 20.0, 0.01).value();
  const auto fast = Law::Set::make("", 50.0, 0.01).value();
  Law law(slow, fast);
  const auto is_slow = [&](double e) { return law.gain(e)[0] == slow.gain(0.0)[0]; };
  EXPECT_FALSE(is_slow(0.0));
  EXPECT_FALSE(is_slow(-1e300));
  law.accept(-0.5);
  EXPECT_FALSE(is_slow(0.5));
  EXPECT_FALSE(is_slow(-0.5));
  EXPECT_TRUE(is_slow(0.499));
  EXPECT_TRUE(is_slow(-0.499));
  EXPECT_TRUE(is_slow(0.1));  // gain() does not remember
  EXPECT_TRUE(is_slow(0.2));
  law.reset();
  EXPECT_FALSE(is_slow(0.0));

  esokit::SwitchedGain<3, double, esokit::EqualPoles, SignReading::printed> printed(slow, fast);
  const auto printed_slow = [&](double e) { return printed.gain(e)[0] == slow.gain(0.0)[0]; };
  EXPECT_FALSE(printed_slow(1e300));
  printed.accept(0.5);
  EXPECT_TRUE(printed_slow(0.6));  // xhat - y falls although |e| grows
  EXPECT_FALSE(printed_slow(0.4));
  printed.reset();
  EXPECT_FALSE(printed_slow(1e300));
}

/// Retuning keeps what the next innovation is compared with.
TEST(AdjustableBandwidthEso, RetuneKeepsTheComparison) {
  const AdjustableBandwidthEso<2>::Config config{
      .observer_bandwidth = 40, .bandwidth_ratio = 0.6, .input_gain = 2, .sample_time = 0.01};
  auto kept = AdjustableBandwidthEso<2>::make(config).value();
  kept.update(1, 0);
  auto retuned = kept;
  ASSERT_TRUE(retuned.retune(config).has_value());
  kept.update(1, 0);  // shrinks
  retuned.update(1, 0);
  for (int r = 0; r < 3; ++r) EXPECT_EQ(kept.estimate()(r), retuned.estimate()(r));
}

// ---- refusals

template <class Config>
std::string text_of_refusal(const Config& config) {
  const auto made = AdjustableBandwidthEso<2>::make(config);
  return made ? "accepted" : esokit::to_text(made.error());
}

TEST(AdjustableBandwidthEso, RefusesByName) {
  const AdjustableBandwidthEso<2>::Config good{
      .observer_bandwidth = 50, .bandwidth_ratio = 0.7, .input_gain = 2, .sample_time = 1e-3};
  EXPECT_EQ(text_of_refusal(good), "accepted");
  auto bad = good;
  for (const double rho : {0.0, -0.5, hidden_nan<double>(), hidden_infinity<double>()}) {
    bad = good;
    bad.bandwidth_ratio = rho;
    EXPECT_EQ(refusal(AdjustableBandwidthEso<2>::make(bad)),
              "bandwidth_ratio: must be finite and positive")
        << rho;
    bad.allow_uncertified_switching = true;
    EXPECT_EQ(refusal(AdjustableBandwidthEso<2>::make(bad)),
              "bandwidth_ratio: must be finite and positive")
        << rho;
  }
  bad = good;
  bad.observer_bandwidth = -1;
  EXPECT_EQ(text_of_refusal(bad), "observer_bandwidth = -1: must be finite and positive");
  bad = good;
  bad.input_gain = 0;
  EXPECT_EQ(refusal(AdjustableBandwidthEso<2>::make(bad)),
            "input_gain: must be finite and not zero (negative is fine)");
  bad = good;
  bad.sample_time = 0;
  EXPECT_EQ(refusal(AdjustableBandwidthEso<2>::make(bad)),
            "sample_time: must be finite and positive");
  bad = good;
  bad.bandwidth_ratio = 1e-320;
  bad.allow_uncertified_switching = true;
  EXPECT_EQ(
      refusal(AdjustableBandwidthEso<2>::make(bad)),
      "bandwidth_ratio: with observer_bandwidth gives a bandwidth that the scalar cannot hold");

  // Without the certificate, with the limit.
  bad = good;
  bad.bandwidth_ratio = 0.2;
  EXPECT_EQ(text_of_refusal(bad),
            "bandwidth_ratio = 0.2: must be certified against every switching (or set "
            "allow_uncertified_switching): above 0.333272");
  const auto refused = AdjustableBandwidthEso<2>::make(bad);
  const double x = 50 * 1e-3;
  EXPECT_NEAR(refused.error().limit, 2 * std::atanh(std::tanh(x / 2) / 3) / x, 1e-12);
  bad.allow_uncertified_switching = true;
  EXPECT_EQ(text_of_refusal(bad), "accepted");
  bad = good;
  bad.bandwidth_ratio = 3.1;
  EXPECT_EQ(text_of_refusal(bad),
            "bandwidth_ratio = 3.1: must be certified against every switching (or set "
            "allow_uncertified_switching): below 3.00502");
  bad.bandwidth_ratio = 3.0;
  EXPECT_EQ(text_of_refusal(bad), "accepted");
  bad = good;
  bad.rule = SwitchingRule::beso;
  bad.bandwidth_ratio = 0.5;
  EXPECT_EQ(text_of_refusal(bad),
            "bandwidth_ratio = 0.5: must be certified against every switching (or set "
            "allow_uncertified_switching): above 0.57719");
  bad.bandwidth_ratio = 0.6;
  EXPECT_EQ(text_of_refusal(bad), "accepted");
}

/// The limit depends on the size: 0.5 is fine for N = 4, not for N = 5.
template <class Observer>
bool accepts_one_half() {
  return Observer::make({.observer_bandwidth = 50,
                         .bandwidth_ratio = 0.5,
                         .input_gain = 2,
                         .sample_time = 1e-4})
      .has_value();
}

TEST(AdjustableBandwidthEso, LimitFollowsTheSize) {
  EXPECT_TRUE(accepts_one_half<AdjustableBandwidthEso<2>>());
  EXPECT_TRUE((accepts_one_half<AdjustableBandwidthEso<2, double, 2>>()));
  EXPECT_TRUE(accepts_one_half<AdjustableBandwidthEso<3>>());
  EXPECT_FALSE((accepts_one_half<AdjustableBandwidthEso<3, double, 2>>()));
  EXPECT_FALSE(accepts_one_half<AdjustableBandwidthEso<4>>());
}

TEST(ContinuousAdjustableBandwidthEso, RefusesByName) {
  using Observer = ContinuousAdjustableBandwidthEso<2>;
  const auto field = [](const Observer::Config& config) -> std::string {
    const auto made = Observer::make(config);
    return refusal(made);
  };
  EXPECT_EQ(field({.observer_bandwidth = 7, .bandwidth_ratio = 0.7, .input_gain = 1}), "accepted");
  EXPECT_EQ(field({.observer_bandwidth = 7, .bandwidth_ratio = 0.33, .input_gain = 1}),
            "bandwidth_ratio: must be certified against every switching (or set "
            "allow_uncertified_switching): above");
  EXPECT_EQ(field({.observer_bandwidth = 7, .bandwidth_ratio = 0.34, .input_gain = 1}), "accepted");
  EXPECT_EQ(field({.observer_bandwidth = 7,
                   .bandwidth_ratio = 0.33,
                   .allow_uncertified_switching = true,
                   .input_gain = 1}),
            "accepted");
  EXPECT_EQ(field({.observer_bandwidth = 0, .bandwidth_ratio = 0.7, .input_gain = 1}),
            "observer_bandwidth: must be finite and positive");
  EXPECT_EQ(field({.observer_bandwidth = 7, .bandwidth_ratio = 0.7, .input_gain = 0}),
            "input_gain: must be finite and not zero (negative is fine)");
}

// ---- the two ways

/// Continuous observer with its switching at the samples of the sampled one, and a smooth y: the
/// estimates meet as T -> 0 with order 1, as those of LinearEso do. Around a crossing of the
/// comparison the two may switch a sample apart, so the order is measured over several halvings.
TEST(AdjustableBandwidthEso, TendsToTheContinuousForm) {
  constexpr double w = 6;
  constexpr double rho = 0.7;
  constexpr double end = 2.0;
  const auto output = [](double t) { return 0.4 + std::sin(1.3 * t); };
  const auto deviation = [&](int samples) {
    const double T = end / samples;
    auto sampled =
        AdjustableBandwidthEso<2>::make(
            {.observer_bandwidth = w, .bandwidth_ratio = rho, .input_gain = 1, .sample_time = T})
            .value();
    auto continuous = ContinuousAdjustableBandwidthEso<2>::make(
                          {.observer_bandwidth = w, .bandwidth_ratio = rho, .input_gain = 1})
                          .value();
    using State = decltype(continuous)::State;
    State z = State::Zero();
    constexpr int fine = 4;
    for (int k = 0; k < samples; ++k) {
      continuous.begin_step(k * T, z, output(k * T));
      for (int i = 0; i < fine; ++i) {
        const double h = T / fine;
        const double t = k * T + i * h;
        const State k1 = continuous.derivative(t, z, output(t), 0);
        const State k2 = continuous.derivative(t + h / 2, z + h / 2 * k1, output(t + h / 2), 0);
        const State k3 = continuous.derivative(t + h / 2, z + h / 2 * k2, output(t + h / 2), 0);
        const State k4 = continuous.derivative(t + h, z + h * k3, output(t + h), 0);
        z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      }
      sampled.update(output((k + 1) * T), 0);
    }
    double worst = 0;
    for (int r = 0; r < 3; ++r) {
      worst = std::max(worst, std::abs(sampled.estimate()(r) - z(r)) / std::pow(w, r));
    }
    return worst;
  };
  const double coarse = deviation(250);
  const double halved_four_times = deviation(250 * 16);
  EXPECT_LT(halved_four_times, 2e-3);
  EXPECT_NEAR(std::log2(coarse / halved_four_times) / 4, 1.0, 0.2);
}

/// The mode changes in begin_step only, and at the first step it is the full bandwidth.
TEST(ContinuousAdjustableBandwidthEso, SwitchesAtStepBoundaries) {
  auto observer = ContinuousAdjustableBandwidthEso<2>::make(
                      {.observer_bandwidth = 10, .bandwidth_ratio = 0.5, .input_gain = 1})
                      .value();
  const decltype(observer)::State z = decltype(observer)::State::Zero();
  const auto bandwidth = [&](double e) {
    return std::cbrt(observer.derivative(0, z, e, 0)(2) / e);  // l_3 = w^3
  };
  EXPECT_NEAR(bandwidth(1), 10, 1e-12);
  observer.begin_step(0, z, 1);
  EXPECT_NEAR(bandwidth(1), 10, 1e-12);
  EXPECT_NEAR(bandwidth(0.1), 10, 1e-12);
  observer.begin_step(0, z, -0.9);
  EXPECT_NEAR(bandwidth(1), 5, 1e-12);
  observer.begin_step(0, z, 0.95);
  EXPECT_NEAR(bandwidth(1), 10, 1e-12);
}

}  // namespace observer_adjustable_bandwidth_eso_test
}  // namespace esokit_test
