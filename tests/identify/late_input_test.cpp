// Logs as sketches write them: u a row late, short pieces, rows much shorter than the machine.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/identify/identify.hpp>
#include <esokit/sim/gaussian.hpp>
#include <vector>

namespace esokit_test {
namespace identify_late_input_test {

using namespace esokit;

struct Heater {
  double T = 1, b0 = 0.009, pole = 0.01, lag = 15, hysteresis = 1;
  std::size_t rows = 1500;
  bool late = true;
  bool controller = false;  // proportional, on y of its own row
};

/// A heater at 20 degrees behind the lag of its sensor, under a thermostat whose target steps.
Log thermostat(const Heater& h, std::uint64_t seed) {
  sim::Gaussian noise(seed);
  Log log;
  double x = 20, sensed = 20, before = 100;
  bool on = true;
  for (std::size_t k = 0; k < h.rows; ++k) {
    const double target = k / 300 % 2 == 0 ? 60 : 52;
    const double y = std::round(16 * (sensed + 0.02 * noise.next())) / 16;
    if (y > target + h.hysteresis / 2) on = false;
    if (y < target - h.hysteresis / 2) on = true;
    const double u = h.controller ? std::clamp(20 * (target + 5 - y), 0.0, 100.0)
                     : on         ? 100.0
                                  : 0.0;
    log.time.push_back(h.T * static_cast<double>(k));
    log.y.push_back(y);
    log.u.push_back(h.late ? before : u);
    before = u;
    for (int i = 0; i < 20; ++i) {
      x += h.T / 20 * (h.b0 * u - h.pole * (x - 20));
      sensed += h.T / 20 * (x - sensed) / h.lag;
    }
  }
  return log;
}

IdentifyOptions first_order() {
  IdentifyOptions options;
  options.orders = {1};
  return options;
}

TEST(LateInput, IsFoundOrRefused) {
  std::uint64_t seed = 1;
  for (const double lag : {6.0, 15.0, 28.0}) {
    for (const double hysteresis : {0.5, 2.0}) {
      const Log log = thermostat({.lag = lag, .hysteresis = hysteresis}, ++seed);
      const auto found = identify(log, first_order());
      ASSERT_TRUE(found) << lag << ", " << hysteresis << ": " << found.error().field;
      EXPECT_GT(found->late_rows, 0) << lag << ", " << hysteresis;
      EXPECT_NEAR(found->input_gain.value, 0.009, 0.15 * 0.009) << lag << ", " << hysteresis;
      IdentifyOptions literal = first_order();
      literal.late_input = false;
      const auto taken = identify(log, literal);
      if (taken) {
        EXPECT_NEAR(taken->input_gain.value, 0.009, 0.3 * 0.009) << lag << ", " << hysteresis;
      }
    }
  }
}

TEST(LateInput, IsNotFoundWhereUIsInItsRow) {
  for (const bool controller : {false, true}) {
    for (std::uint64_t seed = 1; seed < 4; ++seed) {
      const auto found =
          study(thermostat({.late = false, .controller = controller}, seed), first_order());
      ASSERT_TRUE(found);
      EXPECT_EQ(found->late_rows, 0) << controller << ", " << seed;
      EXPECT_NEAR(found->input_gain.value, 0.009, 0.15 * 0.009) << controller << ", " << seed;
    }
  }
}

// u late or in its row: what the lag has left of the u before the log is unknown, and taken for
// rest it makes b0 four per cent too small, beyond its interval in half of the logs.
TEST(LateInput, IntervalsHoldB0WhateverUWasBeforeTheLog) {
  int inside = 0, all = 0;
  double square = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const double part = static_cast<double>(seed) / 20;
    const Log log = thermostat({.T = 0.5 + part,
                                .b0 = 0.006 + 0.01 * part,
                                .pole = 0.02 - 0.01 * part,
                                .lag = 10 + 20 * part,
                                .hysteresis = 0.5 + 2 * part,
                                .late = seed % 2 == 0},
                               500 + seed);
    const auto found = identify(log, first_order());
    ASSERT_TRUE(found) << seed << ": " << found.error().field;
    const double off = found->input_gain.value / (0.006 + 0.01 * part) - 1;
    square += off * off / 20;
    // The steps of this simulation are a twentieth of a row.
    inside += std::abs(off) <= found->input_gain.share() + 0.002 ? 1 : 0;
    ++all;
  }
  EXPECT_GE(inside, 18) << "of " << all;
  EXPECT_LT(std::sqrt(square), 0.01);
}

// No b0 that the fastest rise of the log contradicts.
TEST(Rise, BeyondWhatB0AllowsIsRefused) {
  const Log log = thermostat({.late = false}, 7);
  const auto found = study(log, first_order());
  ASSERT_TRUE(found);
  EXPECT_GT(found->rise, 0.4);
  EXPECT_LT(found->rise, 1);
  EXPECT_TRUE(judge(*found, log, first_order()));
  Identified faster = *found;
  faster.rise = 1.3;
  const auto verdict = judge(faster, log, first_order());
  ASSERT_FALSE(verdict);
  EXPECT_STREQ(verdict.error().field, "rise");
}

// A machine under a PID whose reference stands still: u is a law of y. With the slope s of this law
// y' = b0 (u - s y) explains y by an unstable pole. Noise of y that is not white, and u rounded,
// hide from one row to the next that u follows from y.
TEST(Law, IsNotTakenForTheMachine) {
  sim::Gaussian noise(9);
  Log log;
  log.sample_time = 0.3;
  double x = 30, sensed = 30, integral = 0, colour = 0;
  for (int k = 0; k < 2000; ++k) {
    colour = 0.7 * colour + 0.15 * noise.next();
    const double y = std::round(4 * (sensed + colour)) / 4;
    integral += 0.3 * (93 - y);
    const double u = std::round(std::clamp(2 * (93 - y) + 0.0025 * integral, 0.0, 255.0));
    log.u.push_back(u);
    log.y.push_back(y);
    x += 0.3 * (0.007 * u - 0.0025 * (x - 22));
    sensed += 0.3 * (x - sensed) / 46;
  }
  const auto found = study(log, first_order());
  ASSERT_TRUE(found);
  const auto taken = identify(log, first_order());
  if (taken) {
    EXPECT_NEAR(taken->input_gain.value, 0.007, 0.0035);
  }
  // As it was found in the log of a real machine.
  Identified real = *found;
  real.own_input = 0.02;
  real.returns = 0.02;
  EXPECT_STREQ(judge(real, log).error().field, "returns");
}

// Thirteen recordings of a step each, the step at row 41 of 150 to 190.
TEST(Pieces, OfOneStepEachTellB0) {
  sim::Gaussian noise(3);
  Log log;
  const double T = 0.01, pole = 20, b0 = 5;
  double time = 0;
  for (int piece = 0; piece < 13; ++piece) {
    double v = 0;
    for (int k = 0; k < 150 + 3 * piece; ++k, time += T) {
      const double u = k < 40 ? 0 : (piece % 2 == 0 ? 1 : -1) * (40 + 10.0 * piece);
      log.time.push_back(time);
      log.u.push_back(u);
      log.y.push_back(v + 0.1 * noise.next());
      v += (b0 * u / pole - v) * (1 - std::exp(-pole * T));
    }
    time += 3;
  }
  const auto found = identify(log, first_order());
  ASSERT_TRUE(found) << found.error().field << " " << found.error().value;
  EXPECT_EQ(found->log.pieces, 13U);
  EXPECT_NEAR(found->input_gain.value, b0, 0.1 * b0);
}

// A tank with a row every 10 ms: its lag is 1,500 rows.
TEST(ShortRows, AreAveragedUntilTheLagIsWithinReach) {
  for (const double slower : {2.5}) {
    sim::Gaussian noise(4);
    Log log;
    log.sample_time = 0.01;
    const double b0 = 0.02, pole = 0.02 / slower, lag = 6 * slower;
    double x = 0, sensed = 0;
    const int hold = static_cast<int>(6000 * slower);
    for (int k = 0; k < 8 * hold; ++k) {
      const double u = k / hold % 2 == 0 ? 30 + k / hold : 70 - 2 * (k / hold);
      log.u.push_back(u);
      log.y.push_back(sensed + 0.01 * noise.next());
      x += log.sample_time * (b0 * u - pole * x);
      sensed += log.sample_time * (x - sensed) / lag;
    }
    const auto found = identify(log, first_order());
    ASSERT_TRUE(found) << slower << ": " << found.error().field << " " << found.error().value;
    EXPECT_GE(found->averaged, 8);
    EXPECT_NEAR(found->input_gain.value, b0, 0.1 * b0);
    EXPECT_NEAR(found->latency.value, lag, 0.2 * lag);
  }
}

}  // namespace identify_late_input_test
}  // namespace esokit_test
