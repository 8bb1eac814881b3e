// Measured disturbances in a log: gain, lag and dead time of each, what cannot be told, lost ones.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/error_text.hpp>
#include <esokit/identify/identify.hpp>
#include <esokit/sim/gaussian.hpp>
#include <limits>
#include <string>
#include <vector>

namespace identify_measured_columns_test {

using esokit::Estimate;
using esokit::IdentifyOptions;
using esokit::Log;

constexpr double T = 0.1;
constexpr double b0 = 2, pole = 0.02, lag = 0.8, dead = 0.3;

// What one w does, and how it moves.
struct Way {
  double gain, lag, dead, stay;
};

// A heater: y' = b0 v(t - L) - a y + what each w adds + drift; u and each w step at drawn times.
Log heater(const std::vector<Way>& ways, std::uint64_t seed, int rows = 3000) {
  esokit::sim::Gaussian gaussian(seed);
  constexpr int steps = 20;
  constexpr double h = T / steps;
  Log log;
  log.columns.resize(ways.size());
  std::vector<double> w(ways.size(), 0.0), next(w), filtered(w), sent_u;
  std::vector<std::vector<double>> sent(ways.size());
  double y = 0, v = 0, u = 0, next_u = 0, drift = 0;
  const auto delayed = [](const std::vector<double>& of, double dead_time) {
    const auto line = static_cast<std::size_t>(std::lround(dead_time / h));
    return of.size() > line ? of[of.size() - 1 - line] : 0.0;
  };
  const auto uniform = [&] { return 0.5 * std::erfc(-gaussian.next() / std::sqrt(2.0)); };
  for (int k = 0; k < rows; ++k) {
    const double t = k * T;
    if (t >= next_u) u = uniform(), next_u = t + 12 * (0.4 + 1.2 * uniform());
    for (std::size_t i = 0; i < ways.size(); ++i) {
      if (t >= next[i]) w[i] = uniform(), next[i] = t + ways[i].stay * (0.4 + 1.2 * uniform());
      log.columns[i].push_back(w[i]);
    }
    log.time.push_back(t);
    log.u.push_back(u);
    log.y.push_back(y + 0.03 * gaussian.next());
    for (int s = 0; s < steps; ++s) {
      const double before = v, drifted = drift;
      sent_u.push_back(u);
      v = delayed(sent_u, dead) + (v - delayed(sent_u, dead)) * std::exp(-h / lag);
      drift += 0.008 * std::sqrt(h) * gaussian.next();
      double sum = 0.5 * b0 * (before + v) + 0.5 * (drifted + drift);
      for (std::size_t i = 0; i < ways.size(); ++i) {
        sent[i].push_back(w[i]);
        const double to = delayed(sent[i], ways[i].dead), old = filtered[i];
        filtered[i] = to + (old - to) * std::exp(-h / ways[i].lag);
        sum += 0.5 * ways[i].gain * (old + filtered[i]);
      }
      y += h * (sum - pole * y);
    }
  }
  return log;
}

IdentifyOptions first_order() {
  IdentifyOptions options;
  options.orders = {1};
  return options;
}

bool covers(const Estimate& estimate, double truth) {
  return std::abs(estimate.value - truth) <= estimate.half_width;
}

std::string refusal(const Log& log) {
  const auto found = esokit::study(log, first_order());
  return found ? "accepted" : esokit::to_text(found.error());
}

TEST(MeasuredColumns, GainLagAndDeadTimeOfEach) {
  const std::vector<Way> ways = {{-1.2, 2.0, 1.0, 20}, {0.8, 0.5, 2.0, 31}};
  const Log log = heater(ways, 11);
  const auto found = esokit::identify(log, first_order());
  ASSERT_TRUE(found);
  EXPECT_TRUE(covers(found->input_gain, b0));
  for (std::size_t c = 0; c < ways.size(); ++c) {
    const auto& effect = found->columns[c];
    EXPECT_TRUE(effect.seen() && effect.timed && !effect.follows_output);
    EXPECT_TRUE(covers(effect.gain, ways[c].gain));
    EXPECT_LT(effect.gain.share(), 0.15);
    // It is held from its row to the next: half a row later than a straight line.
    EXPECT_TRUE(covers(effect.dead_time, ways[c].dead + 0.5 * T));
    EXPECT_TRUE(covers(effect.lag, ways[c].lag));
    EXPECT_TRUE(covers(effect.latency, ways[c].lag + ways[c].dead + 0.5 * T));
    EXPECT_LT(effect.latency.half_width, 0.2 * effect.latency.value);
    const auto held = effect.held(T);
    EXPECT_EQ(held.gain, effect.gain.value);
    EXPECT_NEAR(held.lag + held.dead_time, effect.latency.value - 0.5 * T, 1e-12);
    EXPECT_EQ(held.lag, effect.lag.value);
    const auto sooner = effect.held(T, effect.dead_time.value);
    EXPECT_EQ(sooner.dead_time, 0);
    EXPECT_NEAR(sooner.lag, effect.lag.value - 0.5 * T, 1e-12);
  }
  // Without them there is more to find, and with their gains alone they are not right.
  EXPECT_GT(found->disturbance_unmeasured, 5 * found->disturbance);
  IdentifyOptions at_once = first_order();
  at_once.late_columns = false;
  const auto wrong = esokit::study(log, at_once);
  ASSERT_TRUE(wrong);
  EXPECT_GT(wrong->columns[0].gain.half_width, 2 * found->columns[0].gain.half_width);
  EXPECT_FALSE(wrong->columns[0].timed);
  EXPECT_GT(wrong->disturbance, 2 * found->disturbance);
}

TEST(MeasuredColumns, WhatCannotBeTold) {
  Log log = heater({{-1.2, 2.0, 1.0, 20}}, 12);
  const auto both = log.columns[0];
  // Something that does nothing: its gain may be zero, so there are no times.
  esokit::sim::Gaussian gaussian(5);
  log.columns.emplace_back();
  for (std::size_t k = 0; k < log.y.size(); ++k)
    log.columns[1].push_back(k % 300 < 150 ? 0.0 : 1e-3 * (1 + 0.1 * gaussian.next()));
  const auto idle = esokit::study(log, first_order());
  ASSERT_TRUE(idle);
  EXPECT_TRUE(idle->columns[0].timed);
  EXPECT_FALSE(idle->columns[1].seen());
  EXPECT_FALSE(idle->columns[1].timed);
  EXPECT_EQ(idle->columns[1].lag.value, 0);
  EXPECT_TRUE(covers(idle->columns[1].gain, 0));
  // A function of y has a gain and no times.
  log.columns = {{}};
  for (const double y : log.y) log.columns[0].push_back(std::sin(0.05 * y));
  const auto bent = esokit::study(log, first_order());
  ASSERT_TRUE(bent);
  EXPECT_TRUE(bent->columns[0].follows_output);
  EXPECT_FALSE(bent->columns[0].timed);
  EXPECT_EQ(bent->columns[0].latency.value, 0);
  // A constant, a copy of u, and a copy of another column are refused by name; a copy of u with so
  // much of its own is not.
  const std::string none = "never changes, so it shows nothing";
  const std::string apart = "so the two cannot be distinguished";
  log.columns = {both, std::vector<double>(log.y.size(), 3.0)};
  EXPECT_TRUE(refusal(log).find("columns[1] = 3: ") != std::string::npos) << refusal(log);
  EXPECT_NE(refusal(log).find(none), std::string::npos) << refusal(log);
  for (const double own : {0.02, 0.05}) {
    log.columns = {log.u};
    double square = 0, mean = 0;
    const double rows = static_cast<double>(log.u.size());
    for (const double u : log.u) mean += u / rows;
    for (const double u : log.u) square += (u - mean) * (u - mean) / rows;
    for (double& w : log.columns[0]) w = 4 - 3 * w + 3 * own * std::sqrt(square) * gaussian.next();
    EXPECT_EQ(refusal(log).find(apart) != std::string::npos, own < 0.0316) << refusal(log);
  }
  log.columns = {both, both};
  for (double& w : log.columns[1]) w = 1 - 7 * w;
  EXPECT_NE(refusal(log).find(apart), std::string::npos) << refusal(log);
}

TEST(MeasuredColumns, LostOnesLieBetweenTheirNeighbours) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Log whole = heater({{-1.2, 2.0, 1.0, 20}}, 13, 1000);
  Log log = whole;
  for (std::size_t k = 500; k < 504; ++k) log.columns[0][k] = nan;
  auto prepared = esokit::prepare(log);
  ASSERT_TRUE(prepared);
  EXPECT_EQ(prepared->report.lost[0], 4u);
  EXPECT_EQ(prepared->report.rejected, 0u);
  EXPECT_EQ(prepared->report.pieces, 1u);
  const double step = (whole.columns[0][504] - whole.columns[0][499]) / 5;
  EXPECT_NEAR(prepared->data.columns[0][502], whole.columns[0][499] + 3 * step, 1e-12);
  EXPECT_EQ(prepared->data.y[502], whole.y[502]);
  // Five are too many: the log is split there.
  log.columns[0][504] = nan;
  prepared = esokit::prepare(log);
  ASSERT_TRUE(prepared);
  EXPECT_EQ(prepared->report.lost[0], 0u);
  EXPECT_EQ(prepared->report.rejected, 5u);
  EXPECT_EQ(prepared->report.pieces, 2u);
  // Unless it is measured as seldom as that.
  for (std::size_t k = 0; k < log.y.size(); ++k)
    log.columns[0][k] = k % 8 == 0 ? whole.columns[0][k] : nan;
  prepared = esokit::prepare(log);
  ASSERT_TRUE(prepared);
  EXPECT_EQ(prepared->report.lost[0], 7u * 124);
  EXPECT_EQ(prepared->report.rejected, 7u);  // behind the last
  EXPECT_EQ(prepared->report.pieces, 1u);
}

// Of straight lines, each delay and lag has an exact answer.
TEST(MeasuredColumns, LateIsExact) {
  std::vector<double> ramp;
  for (int k = 0; k < 60; ++k) ramp.push_back(k < 10 ? 0.0 : 0.3 * (k - 10));
  for (const double lag_time : {0.0, 0.02, 0.25}) {
    for (const double dead_time : {0.0, 0.03, 0.1, 0.47}) {
      const auto found = esokit::detail::late(ramp, {0}, T, lag_time, dead_time);
      for (int k = 0; k < 60; ++k) {
        const double since = k * T - 1.0 - dead_time;
        const double left = lag_time > 0 ? lag_time * (1 - std::exp(-since / lag_time)) : 0.0;
        const double wanted = since > 0 ? 3 * (since - left) : 0.0;
        EXPECT_NEAR(found[static_cast<std::size_t>(k)], wanted, 1e-12);
      }
    }
  }
}

}  // namespace identify_measured_columns_test
