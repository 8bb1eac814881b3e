// The curve of an actuator is told where there is one, with its size, and not where there is none.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/identify/identify.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <esokit/sim/gaussian.hpp>
#include <functional>
#include <vector>

namespace identify_seen_curve_test {

using esokit::CurveKind;
using esokit::Identified;
using esokit::Log;
using esokit::SeenCurve;

constexpr double T = 0.01, pole = 3;

struct Machine {
  std::function<double(double)> effect = [](double u) { return u; };
  double gain = 20, size = 1, friction = 0, sticks = 0;
  double noise = 0.02;
  std::uint64_t seed = 11;
  std::size_t rows = 1500;
  bool two_levels = false;
};

// y' = b0 effect(u(t - 1.5 T)) - a y - friction, steps of u between -size and size. `sticks` holds
// y at rest and brakes it.
Log recorded(const Machine& machine) {
  esokit::sim::Gaussian gaussian(machine.seed);
  Log log;
  log.sample_time = T;
  double y = 0, u = 0, before = 0, earlier = 0;
  for (std::size_t k = 0; k < machine.rows; ++k) {
    if (k % 40 == 0) u = machine.size * std::erf(gaussian.next());
    if (machine.two_levels) u = std::copysign(machine.size, u);
    log.u.push_back(u);
    log.y.push_back(y + machine.noise * gaussian.next());
    for (int i = 0; i < 20; ++i) {
      const double force = machine.gain * machine.effect(i < 10 ? earlier : before);
      const bool stands = !(std::abs(y) > 0);
      if (stands && std::abs(force) <= machine.sticks) continue;
      const double dry = machine.sticks * std::copysign(1.0, stands ? force : y);
      const double next =
          y + T / 20 * (force - pole * y - machine.friction * std::tanh(y / 0.1) - dry);
      y = machine.sticks > 0 && y * next < 0 ? 0 : next;
    }
    earlier = before;
    before = u;
  }
  return log;
}

esokit::IdentifyOptions options() {
  esokit::IdentifyOptions options;
  options.orders = {1};
  options.averaged = 1;
  return options;
}

Identified studied(const Log& log) { return esokit::study(log, options()).value(); }

double dead_zone(double u, double width) {
  return std::copysign(std::max(std::abs(u) - width, 0.0), u);
}

struct Told {
  const char* name;
  CurveKind kind;
  double size;
  std::function<double(double)> effect;
};

const std::vector<Told> told{
    {"dead zone", CurveKind::dead_zone, 0.27, [](double u) { return dead_zone(u, 0.27); }},
    {"wide", CurveKind::dead_zone, 0.6, [](double u) { return dead_zone(u, 0.6); }},
    {"saturation", CurveKind::saturation, 0.45,
     [](double u) { return std::clamp(u, -0.45, 0.45); }},
    {"square", CurveKind::square, 1, [](double u) { return u * std::abs(u); }}};

// Both signs of b0, and u in another unit; then b0 of the effect is found within its interval.
TEST(SeenCurve, IsToldWithItsSizeAndB0OfTheEffect) {
  for (const Told& one : told) {
    for (const double gain : {20.0, -20.0}) {
      for (const double unit : {1.0, 255.0}) {
        const Log log = recorded(
            {.effect = [&](double u) { return one.effect(u / unit); }, .gain = gain, .size = unit});
        const SeenCurve found = studied(log).curve;
        ASSERT_EQ(found.kind, one.kind) << one.name;
        EXPECT_TRUE(found.seen());
        EXPECT_NEAR(found.size.value, one.size * unit, 0.01 * unit) << one.name;
        if (one.kind == CurveKind::square) {
          EXPECT_EQ(found.size.half_width, 0);
        } else {
          EXPECT_NEAR(found.size.value, one.size * unit, found.size.half_width) << one.name;
          EXPECT_LT(found.size.share(), 0.05) << one.name;
        }
        EXPECT_LT(found.left, 0.7) << one.name;
        const auto again = esokit::identify(found.acted(log), options());
        ASSERT_TRUE(again) << one.name;
        EXPECT_FALSE(again->by_size.differ()) << one.name;
        EXPECT_FALSE(again->curve.seen()) << one.name;
        // The unit of an effect is that of u: of a square it is u at its largest.
        EXPECT_NEAR(again->input_gain.value * unit / gain, 1, 0.02) << one.name;
      }
    }
  }
}

// Under noise the interval of a size is as wide as the sizes of other records scatter.
TEST(SeenCurve, IntervalOfTheSizeCoversTheNoise) {
  for (const Told& one : {told[0], told[2]}) {
    int seen = 0, covered = 0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      const SeenCurve found =
          studied(recorded({.effect = one.effect, .noise = 0.4, .seed = seed})).curve;
      if (found.kind != one.kind) continue;
      ++seen;
      covered += std::abs(found.size.value - one.size) <= found.size.half_width ? 1 : 0;
      EXPECT_LT(found.size.share(), 0.3) << one.name;
    }
    ASSERT_GE(seen, 8) << one.name;
    EXPECT_GE(covered, seen - 1) << one.name;
  }
}

TEST(SeenCurve, IsNotToldWhereThereIsNone) {
  EXPECT_FALSE(studied(recorded({})).curve.seen());
  EXPECT_FALSE(studied(recorded({.friction = 8})).curve.seen());
  for (const Told& one : told) {
    EXPECT_FALSE(studied(recorded({.effect = one.effect, .two_levels = true})).curve.seen())
        << one.name;
  }
  // Other curves: b0 does depend on the size of u, but none of these explains it.
  for (const double knee : {0.5, 0.7}) {
    const auto found = studied(recorded({.effect = [&](double u) {
      return std::abs(u) < knee ? u : std::copysign(2 * std::abs(u) - knee, u);
    }}));
    EXPECT_TRUE(found.by_size.differ()) << knee;
    EXPECT_FALSE(found.curve.seen()) << knee;
  }
}

// Friction that sticks may pass for a dead zone: then the log tells friction, too, as it does not
// of a dead zone alone.
TEST(SeenCurve, FrictionTellsWhatSticksFromADeadZone) {
  int alike = 0;
  for (std::uint64_t seed = 31; seed < 35; ++seed) {
    const Identified dead =
        studied(recorded({.effect = [](double u) { return dead_zone(u, 0.3); }, .seed = seed}));
    EXPECT_EQ(dead.curve.kind, CurveKind::dead_zone) << seed;
    EXPECT_LE(dead.friction.low(), 0) << seed;
    const Identified sticks = studied(recorded({.sticks = 7, .seed = seed}));
    EXPECT_GT(sticks.friction.low(), 0) << seed;
    alike += sticks.curve.kind == CurveKind::dead_zone ? 1 : 0;
  }
  EXPECT_GT(alike, 0);
}

// Of a log that is refused, too: it says why.
TEST(SeenCurve, IsToldOfARefusedLog) {
  int refused = 0;
  for (const Told& one : told) {
    const Log log = recorded({.effect = one.effect, .rows = 600});
    const Identified found = studied(log);
    esokit::IdentifyOptions strict = options();
    strict.plateau_max = 0.0;
    refused += esokit::judge(found, log, strict) ? 0 : 1;
    EXPECT_EQ(found.curve.kind, one.kind) << one.name;
  }
  EXPECT_EQ(refused, 4);
}

TEST(SeenCurve, MapsALogAndGivesTheCurveOfAnAdapter) {
  const std::vector<double> u{-5, -2, -1, 0, 1, 2, 5};
  const auto effects = [&](CurveKind kind) {
    Log log;
    log.u = u;
    log.y = u;
    const Log acted = SeenCurve{kind, {2.0, 0.1}}.acted(log);
    EXPECT_EQ(acted.y, u);
    return acted.u;
  };
  EXPECT_EQ(effects(CurveKind::straight), u);
  EXPECT_EQ(effects(CurveKind::dead_zone), (std::vector<double>{-3, 0, 0, 0, 0, 0, 3}));
  EXPECT_EQ(effects(CurveKind::saturation), (std::vector<double>{-2, -2, -1, 0, 1, 2, 2}));
  EXPECT_EQ(effects(CurveKind::square), (std::vector<double>{-12.5, -2, -0.5, 0, 0.5, 2, 12.5}));
  EXPECT_FALSE(SeenCurve{}.seen());

  const auto inverse = [](CurveKind kind, double effect) {
    return esokit::ActuatorMap<>::make(SeenCurve{kind, {2.0, 0.1}}.curve()).value().input(effect);
  };
  EXPECT_NEAR(inverse(CurveKind::dead_zone, 3), 5, 1e-12);
  EXPECT_NEAR(inverse(CurveKind::dead_zone, -3), -5, 1e-12);
  EXPECT_NEAR(inverse(CurveKind::square, 0.5), 1, 1e-12);
  EXPECT_NEAR(inverse(CurveKind::square, -2), -2, 1e-12);
  EXPECT_EQ(inverse(CurveKind::saturation, 7), 7);
  EXPECT_EQ(inverse(CurveKind::straight, 7), 7);
}

}  // namespace identify_seen_curve_test
