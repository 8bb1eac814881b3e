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
