// The observers on scalars that are neither float nor double: a SIMD pack and a dual number.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <esokit/control/adrc_law.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/dual.hpp>
#include <support/numbers.hpp>
#include <support/pack.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace {

using esokit::CascadeEso;
using esokit::LinearEso;
using esokit::StepStatus;
using esokit_test::Dual;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::Random;
using esokit_test::refusal;
using esokit_test::same_bits;

constexpr std::size_t width = 4;
using Four = esokit_test::Pack<double, width>;

/// Lane i of every pack setting.
struct Lanes {
  Four bandwidth{{10, 25, 60, 300}};
  Four input_gain{{1, -2, 0.5, 7}};
  Four sample_time{{0.01, 0.02, 0.01, 0.005}};
};

LinearEso<2, Four> linear_pack(const Lanes& lanes) {
  return LinearEso<2, Four>::make({.observer_bandwidth = lanes.bandwidth,
                                   .input_gain = lanes.input_gain,
                                   .sample_time = lanes.sample_time})
      .value();
}
LinearEso<2> linear_lane(const Lanes& lanes, std::size_t i) {
  return LinearEso<2>::make({.observer_bandwidth = lanes.bandwidth[i],
                             .input_gain = lanes.input_gain[i],
                             .sample_time = lanes.sample_time[i]})
      .value();
}
CascadeEso<2, 3, Four, 2> cascade_pack(const Lanes& lanes) {
  return CascadeEso<2, 3, Four, 2>::make({.observer_bandwidth = lanes.bandwidth,
                                          .bandwidth_factor = Four(1.5),
                                          .input_gain = lanes.input_gain,
                                          .sample_time = lanes.sample_time})
      .value();
}
CascadeEso<2, 3, double, 2> cascade_lane(const Lanes& lanes, std::size_t i) {
  return CascadeEso<2, 3, double, 2>::make({.observer_bandwidth = lanes.bandwidth[i],
                                            .bandwidth_factor = 1.5,
                                            .input_gain = lanes.input_gain[i],
                                            .sample_time = lanes.sample_time[i]})
      .value();
}

template <class Packed, class Lane>
void expect_lanes_equal(const Packed& packed, const std::vector<Lane>& lanes) {
  const auto estimate = packed.estimate();
  for (std::size_t i = 0; i < width; ++i) {
    const auto lane = lanes[i].estimate();
    for (int r = 0; r < Lane::size; ++r) {
      ASSERT_TRUE(same_bits(estimate(r)[i], lane(r)))
          << "lane " << i << " estimate " << r << ": " << estimate(r)[i] << ' ' << lane(r);
    }
    ASSERT_TRUE(same_bits(packed.innovation()[i], lanes[i].innovation()));
    ASSERT_TRUE(same_bits(packed.applied_input()[i], lanes[i].applied_input()));
  }
}

template <class Packed, class Lane>
void run_pack(Packed packed, std::vector<Lane> lanes) {
  Random random(1);
  const auto draw = [&](double size) {
    return Four({random.uniform(-size, size), random.uniform(-size, size),
                 random.uniform(-size, size), random.uniform(-size, size)});
  };
  for (int k = 0; k < 100; ++k) {
    const Four y = draw(1);
    const Four u = draw(100);
    EXPECT_EQ(packed.predict(u), StepStatus::ok);
    for (std::size_t i = 0; i < width; ++i) lanes[i].predict(u[i]);
    if (k % 5 == 3) continue;  // all lanes miss it
    const StepStatus status = packed.correct(y);
    for (std::size_t i = 0; i < width; ++i) EXPECT_EQ(lanes[i].correct(y[i]), StepStatus(status));
    expect_lanes_equal(packed, lanes);
  }
  // A NaN in one lane: it predicts, the others go on.
  packed.reset(Four(0.5));
  for (auto& lane : lanes) lane.reset(0.5);
  for (const double bad : {hidden_nan<double>(), hidden_infinity<double>(), 1.7e308}) {
    Four y = draw(1);
    const Four u = draw(1);
    y[2] = bad;
    EXPECT_TRUE(esokit::has(packed.update(y, u), StepStatus::measurement_rejected));
    for (std::size_t i = 0; i < width; ++i) {
      if (i == 2) {
        lanes[i].predict(u[i]);
      } else {
        lanes[i].update(y[i], u[i]);
      }
    }
    for (std::size_t i = 0; i < width; ++i) {
      for (int r = 0; r < Lane::size; ++r) {
        ASSERT_TRUE(same_bits(packed.estimate()(r)[i], lanes[i].estimate()(r)));
      }
    }
    EXPECT_TRUE(std::isfinite(packed.innovation()[2])) << "what a law would be told";
    packed.reset(Four(0.5));
    for (auto& lane : lanes) lane.reset(0.5);
    Four input = draw(1);
    packed.update(Four(0.25), input);
    for (std::size_t i = 0; i < width; ++i) lanes[i].update(0.25, input[i]);
    const double last = input[1];
    if (bad == 1.7e308) continue;  // not too large for an input
    input[1] = bad;
    EXPECT_EQ(packed.update(Four(0.75), input), StepStatus::input_rejected);
    for (std::size_t i = 0; i < width; ++i) {
      lanes[i].update(0.75, i == 1 ? last : input[i]);
    }
    expect_lanes_equal(packed, lanes);
  }
}

TEST(Pack, LanesOfALinearEsoAreScalarObservers) {
  const Lanes lanes;
  std::vector<LinearEso<2>> scalars;
  for (std::size_t i = 0; i < width; ++i) scalars.push_back(linear_lane(lanes, i));
  run_pack(linear_pack(lanes), scalars);
}

TEST(Pack, LanesOfACascadeAreScalarObservers) {
  const Lanes lanes;
  std::vector<CascadeEso<2, 3, double, 2>> scalars;
  for (std::size_t i = 0; i < width; ++i) scalars.push_back(cascade_lane(lanes, i));
  run_pack(cascade_pack(lanes), scalars);
}

TEST(Pack, RetunesLaneByLane) {
  Lanes lanes;
  auto packed = linear_pack(lanes);
  std::vector<LinearEso<2>> scalars;
  for (std::size_t i = 0; i < width; ++i) scalars.push_back(linear_lane(lanes, i));
  packed.update(Four(1), Four(2));
  for (auto& lane : scalars) lane.update(1, 2);
  lanes.input_gain = Four({3, -1, 0.25, 9});
  lanes.bandwidth = Four({20, 30, 40, 50});
  ASSERT_TRUE(packed.retune({.observer_bandwidth = lanes.bandwidth,
                             .input_gain = lanes.input_gain,
                             .sample_time = lanes.sample_time}));
  for (std::size_t i = 0; i < width; ++i) {
    ASSERT_TRUE(scalars[i].retune({.observer_bandwidth = lanes.bandwidth[i],
                                   .input_gain = lanes.input_gain[i],
                                   .sample_time = lanes.sample_time[i]}));
  }
  expect_lanes_equal(packed, scalars);
}

TEST(Pack, OneBadLaneRefusesTheConfig) {
  Lanes lanes;
  lanes.bandwidth[3] = hidden_nan<double>();
  const auto made = LinearEso<2, Four>::make({.observer_bandwidth = lanes.bandwidth,
                                              .input_gain = lanes.input_gain,
                                              .sample_time = lanes.sample_time});
  ASSERT_EQ(refusal(made), "observer_bandwidth: must be finite and positive");
  lanes = {};
  lanes.input_gain[0] = 0;
  EXPECT_EQ(refusal((LinearEso<2, Four>::make({.observer_bandwidth = lanes.bandwidth,
                                               .input_gain = lanes.input_gain,
                                               .sample_time = lanes.sample_time}))),
            "input_gain: must be finite and not zero (negative is fine)");
}

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

}  // namespace
