// From a log to a model: the plant that made the log, each refusal, bad numbers anywhere.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <esokit/analysis/margins.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/identify/identify.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace {

using esokit::Identified;
using esokit::IdentifyOptions;
using esokit::Log;

constexpr double T = 0.004;
constexpr double b0 = 50, tau = 0.02, dead = 0.004, noise = 1e-3;

// y'' = b0 v(t - L) + friction + drift, P and D around it, steps of the reference.
Log closed_loop(double excitation, std::uint64_t seed = 3, int rows = 3000) {
  esokit::sim::Gaussian gaussian(seed);
  Log log;
  log.sample_time = T;
  constexpr int steps = 40;
  constexpr double h = T / steps;
  std::vector<double> sent;
  const auto line = static_cast<std::size_t>(std::lround(dead / h));
  double v = 0, x0 = 0, x1 = 0, filtered = 0, walk = 0;
  for (int k = 0; k < rows; ++k) {
    const double reference =
        excitation * ((k / 180) % 2 == 0 ? 1 : -1) * (1 + 0.5 * ((k / 420) % 3));
    const double y = x0 + noise * gaussian.next();
    const double before = filtered;
    filtered += 0.15 * (y - filtered);
    const double u = (30 * (reference - y) - 9 * (filtered - before) / T) / b0;
    log.u.push_back(u);
    log.y.push_back(y);
    walk += 0.05 * gaussian.next();
    for (int i = 0; i < steps; ++i) {
      sent.push_back(u);
      const double delayed = sent.size() > line ? sent[sent.size() - 1 - line] : 0.0;
      v = delayed + (v - delayed) * std::exp(-h / tau);
      x1 += h * (b0 * v - 2.0 * std::tanh(x1 / 0.05) + walk);
      x0 += h * x1;
    }
  }
  return log;
}

IdentifyOptions quick() {
  IdentifyOptions options;
  options.orders = {2};
  options.averaged = 1;
  return options;
}

TEST(Identify, FindsTheModelThatMadeTheLog) {
  const Log log = closed_loop(1);
  IdentifyOptions options;
  options.averaged = 1;
  double heard = 0;
  options.progress = [&](double share) {
    EXPECT_GE(share, heard);
    heard = share;
  };
  const auto found = esokit::identify(log, options);
  ASSERT_TRUE(found) << found.error().field << " " << found.error().rule;
  EXPECT_EQ(heard, 1);
  EXPECT_EQ(found->order, 2);
  EXPECT_LT(std::abs(found->input_gain.value - b0), found->input_gain.half_width);
  EXPECT_LT(found->input_gain.share(), 0.1);
  EXPECT_NEAR(found->latency.value, tau + dead, 2e-3);
  EXPECT_NEAR(found->noise.value, noise, 0.05 * noise);
  EXPECT_NEAR(found->friction.value, 2, 0.4);
  EXPECT_EQ(found->log.rows, 3000u);
  ASSERT_EQ(found->orders.size(), 3u);
  EXPECT_LT(found->orders[1].criterion, found->orders[0].criterion);
  EXPECT_LE(found->plateau.from, found->plateau.to);

  // It goes on as a plant.
  const auto plant = found->plant<2>();
  ASSERT_TRUE(plant);
  EXPECT_EQ(plant->relative_degree(), 3);
  EXPECT_NEAR(plant->input_gain(), found->input_gain.value / found->lag.value, 1e-9 * b0 / tau);
  EXPECT_EQ(plant->dead_time, found->dead_time.value);
  const auto wrong = found->plant<1>();
  ASSERT_FALSE(wrong);
  EXPECT_STREQ(wrong.error().field, "order");
}

// What was found goes into an observer, and the plant into simulation and analysis, in a call each.
TEST(Identified, GoesStraightIntoAnObserverSimulationAndAnalysis) {
  Identified found;
  found.order = 2;
  found.input_gain = {b0, 1};
  found.lag = {tau, 1e-3};
  found.dead_time = {2.4 * T, 1e-3};
  found.pole = {1.5, 0.1};
  found.sinusoids = {{{30, 0.1}, {2, 0.1}}, {{70, 0.1}, {1, 0.1}}};
  constexpr esokit::ModelParts parts{
      .order = 2, .plant_poles = true, .actuator = 1, .resonators = 2};
  const auto config = found.observer<parts>(40, T);
  ASSERT_TRUE(config);
  EXPECT_EQ(config->input_gain, b0);
  EXPECT_EQ(config->sample_time, T);
  EXPECT_EQ(config->observer_bandwidth, 40);
  EXPECT_EQ(config->model.actuator.time_constant, tau);
  EXPECT_EQ(config->model.plant[0], 0);
  EXPECT_EQ(config->model.plant[1], 1.5);
  EXPECT_EQ(config->model.resonators[0].frequency, 30);
  EXPECT_EQ(config->model.resonators[1].frequency, 70);
  EXPECT_TRUE(esokit::ModelEso<parts>::make(*config));
  EXPECT_EQ(found.delay(T), 2);
  EXPECT_EQ(found.delay(1e-3), 10);
  constexpr esokit::ModelParts chain{.order = 2, .actuator = 1};
  const auto controller =
      esokit::Adrc<esokit::ModelEso<chain>>::make(
          {.observer = *found.observer<chain>(40, T), .controller_bandwidth = 6})
          .value();
  const auto machine = found.plant<2>().value();
  const auto run =
      esokit::sim::run(machine, controller, {.duration = 4.0, .reference = 1.0}).value();
  EXPECT_NEAR(run.output.back(), 1, 1e-3);
  EXPECT_GT(esokit::margins(machine, controller)->phase.value, 0.5);

  const auto rule = [](const auto& refused) {
    return refused ? std::string("accepted")
                   : std::string(refused.error().field) + ": " + refused.error().rule;
  };
  EXPECT_EQ(rule(found.model<esokit::ModelParts{.order = 1}>()),
            "order: is not the one that is asked for:");
  EXPECT_EQ(rule(found.observer<esokit::ModelParts{.order = 3}>(40, T)),
            "order: is not the one that is asked for:");
  found.sinusoids.pop_back();
  EXPECT_EQ(rule(found.model<parts>()),
            "sinusoids: were found, fewer than the resonators that are asked for:");
}

// Stamps since 1970, with jitter that they tell, missing rows and a long gap.
TEST(Identify, StampsMayJitterAndRowsMayBeMissing) {
  const Log clean = closed_loop(1);
  Log log;
  for (std::size_t k = 0; k < clean.y.size(); ++k) {
    if (k % 97 == 5 || (k > 1500 && k < 1540)) continue;
    log.time.push_back(1.7e9 + static_cast<double>(k) * T);
    log.u.push_back(clean.u[k]);
    log.y.push_back(clean.y[k]);
  }
  const auto found = esokit::study(log, quick());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->log.pieces, 2u);
  // 31 of the rows by 97 (one of them in the gap) and 39 in the gap.
  EXPECT_EQ(found->log.missing, clean.y.size() - log.y.size());
  EXPECT_NEAR(found->log.sample_time, T, 1e-6 * T + 1e-9);
  EXPECT_NEAR(found->input_gain.value, b0, 0.1 * b0);
}

TEST(Identify, RefusesALogWithoutExcitation) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const auto found = esokit::identify(closed_loop(0, seed), quick());
    ASSERT_FALSE(found) << seed;
    EXPECT_STREQ(found.error().field, "own_input");
  }
  Log still = closed_loop(1);
  for (double& u : still.u) u = 0.25;
  auto found = esokit::identify(still, quick());
  ASSERT_FALSE(found);
  EXPECT_STREQ(found.error().field, "u");
  EXPECT_EQ(found.error().value, 0.25);
  Log pinned = closed_loop(1);
  for (double& y : pinned.y) y = 3;
  found = esokit::identify(pinned, quick());
  ASSERT_FALSE(found);
  EXPECT_STREQ(found.error().field, "y");
}

// Each rule from both sides, on a study whose numbers are put there.
TEST(Judge, RefusesByName) {
  const Log log = closed_loop(1, 3, 400);
  Log stamped = log;
  stamped.time.resize(1);
  Identified good;
  good.input_gain = {50, 2};
  good.plateau.points.resize(3);
  good.plateau.middle = 1;
  good.plateau.spread = 0.1;
  good.excitation = 0.01;
  good.correlation = 0.1;
  good.friction_shift = 3;
  good.log.sample_time = T;
  good.log.jitter = 0.05 * T;
  good.log.saturated = 1;
  ASSERT_TRUE(esokit::judge(good, log));
  const auto field = [&](const Identified& found, const Log& of,
                         const IdentifyOptions& options = {}) {
    const auto verdict = esokit::judge(found, of, options);
    return verdict ? "" : verdict.error().field;
  };
  Identified bad = good;
  bad.log.jitter = 0.0501 * T;
  EXPECT_STREQ(field(bad, log), "jitter");
  EXPECT_STREQ(field(bad, stamped), "");
  IdentifyOptions commanded;
  commanded.applied = false;
  EXPECT_STREQ(field(good, log, commanded), "saturated");
  bad = good;
  bad.log.saturated = 0.49;
  EXPECT_STREQ(field(bad, log, commanded), "");
  bad = good;
  bad.own_input = 0.9e-5;
  EXPECT_STREQ(field(bad, log), "own_input");
  bad.own_input = 1.1e-5;
  EXPECT_STREQ(field(bad, log), "");
  bad = good;
  bad.excitation = 0.151;
  EXPECT_STREQ(field(bad, log), "excitation");
  bad.excitation = 0.149;
  EXPECT_STREQ(field(bad, log), "");
  bad.plateau.middle = 0;
  EXPECT_STREQ(field(bad, log), "excitation");
  bad = good;
  bad.correlation = 0.101;
  EXPECT_STREQ(field(bad, log), "correlation");
  bad = good;
  bad.at_bound = true;
  EXPECT_STREQ(field(bad, log), "latency");
  bad = good;
  bad.plateau.spread = 0.101;
  EXPECT_STREQ(field(bad, log), "plateau");
  bad = good;
  bad.friction_shift = 3.01;
  EXPECT_STREQ(field(bad, log), "friction_shift");
  bad = good;
  bad.input_gain.half_width = 5.01;
  EXPECT_STREQ(field(bad, log), "interval");
  bad.input_gain.half_width = 4.99;
  EXPECT_STREQ(field(bad, log), "");
  // A number that is none is no reason to trust.
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (double* value : {&bad.own_input, &bad.excitation, &bad.correlation, &bad.plateau.spread,
                        &bad.friction_shift, &bad.input_gain.half_width, &bad.log.jitter}) {
    bad = good;
    *value = nan;
    EXPECT_STRNE(field(bad, log), "");
  }
}

TEST(PrepareLog, RefusesWhatCannotBeRead) {
  const Log log = closed_loop(1, 3, 400);
  const auto rule = [](const Log& bad, const char* field) {
    const auto prepared = esokit::prepare(bad);
    ASSERT_FALSE(prepared) << field;
    EXPECT_STREQ(prepared.error().field, field);
  };
  Log bad = log;
  bad.u.pop_back();
  rule(bad, "u");
  bad = log;
  bad.time.resize(5);
  rule(bad, "time");
  bad = log;
  bad.columns.push_back({1, 2});
  rule(bad, "columns");
  for (const double value : {0.0, -T, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    bad = log;
    bad.sample_time = value;
    rule(bad, "sample_time");
  }
  bad = log;
  bad.jitter = -1;
  rule(bad, "jitter");
  bad = log;
  bad.u.resize(199);
  bad.y.resize(199);
  rule(bad, "rows");
  bad.u.push_back(1);
  bad.y.push_back(1);
  EXPECT_TRUE(esokit::prepare(bad));
  bad = log;
  for (int k = 0; k < 400; ++k) bad.time.push_back(k < 300 ? k * T : 299 * T);
  const auto back = esokit::prepare(bad);
  ASSERT_FALSE(back);
  EXPECT_STREQ(back.error().rule, "does not rise");
  EXPECT_EQ(back.error().index, 300);
}

TEST(PrepareLog, RefusesUnitsOfWhichAFitCannotTakeSquares) {
  Log log = closed_loop(1, 3, 400);
  log.columns.push_back(log.y);
  const auto said = [](const Log& bad) -> std::string {
    const auto prepared = esokit::prepare(bad);
    return prepared ? "accepted"
                    : std::string(prepared.error().field) + ": " + prepared.error().rule;
  };
  const char* const large = "is too large: write it in another unit";
  const char* const little = "is all that it changes by: write it in another unit";
  for (int which = 0; which < 3; ++which) {
    const std::string field = which == 0 ? "u: " : which == 1 ? "y: " : "columns: ";
    Log bad = log;
    auto& values = which == 0 ? bad.u : which == 1 ? bad.y : bad.columns[0];
    for (const double sign : {1.0, -1.0}) {
      values[7] = sign * 1e60;
      EXPECT_EQ(said(bad), "accepted");
      values[7] = sign * 1.001e60;
      EXPECT_EQ(said(bad), field + large);
      values[7] = sign * std::numeric_limits<double>::max();
      EXPECT_EQ(said(bad), field + large);
    }
    std::fill(values.begin(), values.end(), 0.0);
    EXPECT_EQ(said(bad), "accepted");  // that it never changes is for the study to say
    values[9] = 1.001e-60;
    EXPECT_EQ(said(bad), "accepted");
    values[9] = 0.999e-60;
    EXPECT_EQ(said(bad), field + little);
  }
  for (const auto& [time, good] : {std::pair{1e-12, true}, std::pair{0.99e-12, false},
                                   std::pair{1e12, true}, std::pair{1.01e12, false}}) {
    Log slow = log;
    slow.sample_time = time;
    EXPECT_EQ(said(slow), good ? "accepted" : "sample_time: must be between 1e-12 s and 1e12 s");
  }
  // Stamps to the ends of the scalar, whose difference is beyond it.
  for (int k = 0; k < 400; ++k) log.time.push_back(1.7e308 * (k / 199.5 - 1));
  EXPECT_EQ(said(log), "time: does not rise");
  // A gap of ages is a gap, however many rows it lacks.
  for (std::size_t k = 0; k < 400; ++k) log.time[k] = static_cast<double>(k) * T;
  log.time[399] = 1e300;
  ASSERT_TRUE(esokit::prepare(log));
  EXPECT_EQ(esokit::prepare(log)->report.missing, 1000000000000000u);
}

// What is too large for squares, and what leaves no three bandwidths to compare.
TEST(Fit, WithoutAStepStaysWhereItIs) {
  esokit::FitData data;
  data.sample_time = T;
  for (int k = 0; k < 300; ++k) {
    data.u.push_back(k % 20 < 10 ? 1e200 : -1e200);
    data.y.push_back(k % 30 < 15 ? 1e200 : -1e200);
  }
  const esokit::FitBounds bounds{5.0, 300.0, 0.05 * T, 20 * T, 0.5};
  esokit::InnovationsFit fit(data, {2, 1, true}, bounds);
  const auto found = fit.minimise({50.0, 3 * T, 0.7, 0.0}, true);
  EXPECT_EQ(found.at.bandwidth, 50.0);
  EXPECT_EQ(found.at.latency, 3 * T);
  const auto plateau = esokit::find_plateau(fit, found);
  EXPECT_GT(plateau.points.size(), 3u);
  EXPECT_EQ(plateau.middle, 0u);
  EXPECT_EQ(plateau.spread, std::numeric_limits<double>::infinity());
}

// A number that is none, in any column and at any place of the log, costs its row and nothing else.
TEST(PrepareLog, BadNumbersCostTheirRow) {
  Log log = closed_loop(1, 3, 400);
  for (int k = 0; k < 400; ++k) log.time.push_back(5 + k * T);
  log.columns.push_back(log.y);
  const auto clean = esokit::prepare(log);
  ASSERT_TRUE(clean);
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    for (const std::size_t at :
         {std::size_t{0}, std::size_t{1}, std::size_t{200}, std::size_t{399}}) {
      for (int column = 0; column < 4; ++column) {
        Log bad = log;
        (column == 0   ? bad.time
         : column == 1 ? bad.u
         : column == 2 ? bad.y
                       : bad.columns[0])[at] = value;
        const auto prepared = esokit::prepare(bad);
        ASSERT_TRUE(prepared);
        EXPECT_EQ(prepared->report.rejected, 1u);
        for (const double y : prepared->data.y) ASSERT_TRUE(std::isfinite(y));
        for (const double u : prepared->data.u) ASSERT_TRUE(std::isfinite(u));
        EXPECT_NEAR(prepared->report.sample_time, T, 1e-12);
      }
    }
  }
}

TEST(PrepareLog, TellsOutliersFromMotion) {
  Log log = closed_loop(1, 3, 400);
  EXPECT_EQ(esokit::prepare(log)->report.outliers, 0u);
  log.y[150] += 50;
  const auto prepared = esokit::prepare(log);
  EXPECT_EQ(prepared->report.outliers, 1u);
  EXPECT_NEAR(prepared->data.y[150], log.y[149], 0.1);
}

// An encoder's step is found, also written with few digits; noise has none.
TEST(PrepareLog, TellsQuantisationFromNoise) {
  Log log = closed_loop(1, 3, 1000);
  EXPECT_EQ(esokit::prepare(log)->report.quantisation, 0);
  for (double& y : log.y) y = std::round(y / 0.0123) * 0.0123;
  EXPECT_NEAR(esokit::prepare(log)->report.quantisation, 0.0123, 1e-9);
  for (double& y : log.y) y = std::round(y * 1e4) / 1e4;
  EXPECT_NEAR(esokit::prepare(log)->report.quantisation, 0.0123, 1e-4);
  // So fine that hardly a value comes twice.
  Log fine;
  fine.sample_time = T;
  esokit::sim::Gaussian gaussian(6);
  for (int k = 0; k < 1000; ++k) {
    fine.u.push_back(k % 7);
    fine.y.push_back(std::round(20000 * gaussian.next()) * 1e-5);
  }
  EXPECT_NEAR(esokit::prepare(fine)->report.quantisation, 1e-5, 1e-10);
}

// Jitter that the stamps tell is taken out: a ramp stays one, a held input keeps its area.
TEST(PrepareLog, BringsJitteryStampsToOneSampleTime) {
  Log log;
  esokit::sim::Gaussian gaussian(4);
  double t = 100;
  double area = 0;
  for (int k = 0; k < 1000; ++k) {
    log.time.push_back(t);
    log.y.push_back(3 + 2 * (t - 100));
    log.u.push_back(k % 7);
    const double step = T * (1 + 0.15 * std::tanh(gaussian.next()));
    if (k < 999) area += step * (k % 7);
    t += step;
  }
  const auto prepared = esokit::prepare(log);
  ASSERT_TRUE(prepared);
  EXPECT_GT(prepared->report.jitter, 0.05 * T);
  const auto& data = prepared->data;
  double found = 0;
  for (std::size_t k = 0; k < data.y.size(); ++k) {
    EXPECT_NEAR(data.y[k], 3 + 2 * static_cast<double>(k) * data.sample_time, 1e-9);
    found += data.u[k] * data.sample_time;
  }
  // The last row and what is left of a row are not in it.
  EXPECT_NEAR(found, area, 2 * 6 * T);
}

// A long log is read in twenty stretches, none across a gap.
TEST(PrepareLog, ReadsALongLogInStretches) {
  esokit::FitData data;
  data.sample_time = T;
  data.columns.resize(1);
  for (int k = 0; k < 10000; ++k) {
    data.u.push_back(k);
    data.y.push_back(2 * k);
    data.columns[0].push_back(3 * k);
  }
  data.starts = {0, 1030, 4000};
  EXPECT_EQ(esokit::excerpt(data, 10000).y.size(), 10000u);
  const auto part = esokit::excerpt(data, 2000);
  ASSERT_EQ(part.y.size(), 2000u);
  // 20 stretches of 100 rows from every 500th; the third has the gap at 1030, the ninth begins at
  // the one at 4000.
  ASSERT_EQ(part.starts.size(), 21u);
  EXPECT_EQ(part.starts[2], 200u);
  EXPECT_EQ(part.starts[3], 230u);
  EXPECT_EQ(part.starts[9], 800u);
  EXPECT_EQ(part.u[230], 1030);
  EXPECT_EQ(part.y[230], 2060);
  EXPECT_EQ(part.columns[0][230], 3090);
}

TEST(PrepareLog, AveragesWithinPieces) {
  esokit::FitData data;
  data.sample_time = T;
  for (int k = 0; k < 11; ++k) {
    data.u.push_back(k);
    data.y.push_back(k * k);
  }
  data.starts = {0, 5};
  const auto means = esokit::averaged(data, 4);
  EXPECT_EQ(means.sample_time, 4 * T);
  EXPECT_EQ(means.averaged, 4);
  ASSERT_EQ(means.u.size(), 2u);
  EXPECT_EQ(means.starts, (std::vector<std::size_t>{0, 1}));
  EXPECT_EQ(means.u[0], 1.5);
  EXPECT_EQ(means.u[1], 6.5);
  EXPECT_EQ(means.y[1], (25 + 36 + 49 + 64) / 4.0);
}

// Tables: 2.093 for 19, 2.262 for 9.
TEST(Intervals, StudentsT) {
  EXPECT_NEAR(esokit::student_95(19), 2.0930, 5e-4);
  EXPECT_NEAR(esokit::student_95(9), 2.2622, 5e-3);
}

// Power of white noise is its variance at each frequency, of a sine that of its bin.
TEST(Spectrum, WhiteNoiseGivesItsVariance) {
  esokit::sim::Gaussian gaussian(8);
  std::vector<double> white(40000);
  for (double& value : white) value = 3 * gaussian.next();
  std::vector<double> power(17, 0.0);
  double count = 0;
  esokit::each_spectrum(white, {0, 1000}, 10, 32, [&](const std::vector<double>& p) {
    for (std::size_t j = 0; j < power.size(); ++j) power[j] += p[j];
    ++count;
  });
  // 990 and 38990 rows in stretches of 32 that overlap by half.
  EXPECT_EQ(count, 60 + 2435);
  // Four standard errors of so many that share a third; at both ends of half the freedom.
  for (const double p : power) EXPECT_NEAR(p / count, 9, 9 * 4 * std::sqrt(2 * 1.4 / count));
  for (std::size_t k = 0; k < white.size(); ++k) {
    white[k] = std::cos(2 * 3.14159265358979323846 * 5 / 32 * static_cast<double>(k));
  }
  esokit::each_spectrum(white, {0}, 0, 32, [&](const std::vector<double>& p) {
    // (sum of the window / 2)^2 over the sum of its squares: 64 / 12, and a quarter beside it.
    EXPECT_NEAR(p[5], 64.0 / 12, 1e-9);
    EXPECT_NEAR(p[4], 16.0 / 12, 1e-9);
    EXPECT_NEAR(p[7], 0, 1e-9);
  });
}

// What friction does now and then, and a mode that is slower, is no noise.
TEST(NoiseFloor, IsTheNoiseBesideBursts) {
  esokit::sim::Gaussian gaussian(5);
  esokit::FitData data;
  data.sample_time = T;
  double y = 0;
  for (int k = 0; k < 6000; ++k) {
    const double u = std::sin(0.07 * k) + (k / 60 % 2 == 0 ? 1 : -1);
    const double burst = k % 500 < 10 ? 0.3 * gaussian.next() : 0;
    data.u.push_back(u);
    data.y.push_back(y + 0.01 * gaussian.next() + burst);
    y += T * (2 * u + std::sin(0.02 * k));
  }
  esokit::InnovationsFit fit(data, {1, 1, false}, {1, 300, 1e-4, 0.03, 0.5});
  const esokit::Fit found = fit.at({5, 1e-3, 0.5, 0});
  const esokit::Estimate floor = fit.noise_floor(found);
  // Bursts of 30 times the noise in a fiftieth of the rows quadruple the mean.
  EXPECT_GT(found.noise, 0.04);
  EXPECT_NEAR(floor.value, 0.01, 0.01 * 0.05);
  EXPECT_LT(std::abs(floor.value - 0.01), 2 * floor.half_width);
  EXPECT_LT(floor.half_width, 0.001);
  // At the largest w all frequencies are the disturbance's.
  EXPECT_EQ(fit.noise_floor(fit.at({300, 1e-3, 0.5, 0})).value, 0);
}

// For a mean of white noise the jackknife is the standard error; here b0 is read off innovations
// that are nearly white, over seeds as it says itself.
TEST(Intervals, TheJackknifeIsTheSpreadOverSeeds) {
  double mean = 0, square = 0, error = 0;
  constexpr int seeds = 40;
  for (int seed = 0; seed < seeds; ++seed) {
    // y' = 2 u + walk, white noise.
    esokit::sim::Gaussian gaussian(static_cast<std::uint64_t>(seed));
    esokit::FitData data;
    data.sample_time = T;
    double y = 0, walk = 0;
    for (int k = 0; k < 2000; ++k) {
      const double u = std::sin(0.07 * k) + (k / 60 % 2 == 0 ? 1 : -1);
      data.u.push_back(u);
      data.y.push_back(y + 0.01 * gaussian.next());
      y += T * (2 * u + walk);
      walk += 0.05 * gaussian.next();
    }
    esokit::InnovationsFit fit(data, {1, 1, false}, {1, 300, 1e-4, 0.03, 0.5});
    const esokit::Fit found = fit.minimise({10, 1e-3, 0.5, 0}, true);
    const double b = found.linear[0];
    mean += b / seeds;
    square += b * b / seeds;
    error += esokit::jackknife(fit, found, true).linear[0] / seeds;
  }
  const double spread = std::sqrt((square - mean * mean) * seeds / (seeds - 1));
  EXPECT_NEAR(mean, 2, 4 * spread / std::sqrt(seeds));
  // A spread over 40 seeds is known to 11 %: three times that.
  EXPECT_NEAR(error / spread, 1, 0.34);
}

TEST(Study, RefusesBadOptions) {
  const Log log = closed_loop(1, 3, 400);
  IdentifyOptions options = quick();
  options.orders = {};
  EXPECT_STREQ(esokit::study(log, options).error().field, "orders");
  for (const int order : {0, 4}) {
    options.orders = {order};
    EXPECT_STREQ(esokit::study(log, options).error().field, "orders");
  }
  options = quick();
  options.averaged = 16;
  EXPECT_STREQ(esokit::study(log, options).error().field, "averaged");
}

}  // namespace
