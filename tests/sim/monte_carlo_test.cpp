// monte_carlo: the same numbers for any threads and lanes, each run as sim::run repeats it, the
// statistics against sorted lists, runs that fail, what stops it, what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/monte_carlo.hpp>
#include <limits>
#include <span>
#include <sstream>
#include <string>
#include <support/refusal.hpp>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace sim_monte_carlo_test {

using namespace esokit;
using esokit_test::refusal;
using Controller = Adrc<LinearEso<2>>;
using Servo = LinearPlant<2>;
using Config = sim::MonteCarloConfig<Servo, Controller>;

constexpr double T = 2e-3;

Servo servo() { return Servo::chain({.coefficients = {7, 3}, .input_gain = 50}).value(); }
Controller::Config design() {
  return {.observer = {.observer_bandwidth = 80, .input_gain = 50, .sample_time = T},
          .controller_bandwidth = 12,
          .limits = {.lower = -6, .upper = 6}};
}
Controller adrc() { return Controller::make(design()).value(); }

/// Everything that may be there at once: 700 runs are three blocks, the last not full of packs.
Config busy() {
  return {.runs = 701,
          .loop = {.duration = 0.2,
                   .reference = [](double t) { return t < 0.02 ? 0.0 : 1.0; },
                   .disturbance = [](double t) { return t < 0.1 ? 0.0 : -40.0; },
                   .noise = 2e-3,
                   .sensor = [](double, double y) { return std::round(y * 1e4) / 1e4; },
                   .missing = 0.05,
                   .seed = 99,
                   .dead_time = 3e-3,
                   .start_time = 0.01,
                   .initial_input = 0.5}};
}
constexpr auto vary = [](auto& trial, sim::Draw& draw) {
  trial.plant.b(1) *= draw.uniform_ratio(0.5, 2.0);
  trial.plant.a(1, 1) *= draw.uniform(0.5, 1.5);
  trial.state(0) = 0.1 * draw.normal();
  trial.noise *= draw.uniform(0.0, 2.0);
  auto config = design();
  config.controller_bandwidth = draw.uniform(8.0, 16.0);
  trial.controller = Controller::make(config).value();
};

const auto error = [](const auto& sample) { return sample.output - sample.reference; };
const auto overshoot = sim::largest("overshoot", error, {.limit = 0.05});
const auto rms = sim::root_mean_square("rms", error, {.from = 0.1, .to = 0.15});
const auto mean_input = sim::average("mean u", [](const auto& sample) { return sample.input; });
const auto last = sim::final_value("dhat", [](const auto&, const auto& controller) {
  return controller.observer().total_disturbance();
});
const auto settled = sim::settling_time("settled", error, 0.1, {.from = 0.02});

/// The numbers of all runs, one after the other, as on_run gets them.
template <int Lanes, class Study>
std::vector<double> all_numbers(Config config, int threads, const Study& variation, int& lanes) {
  std::vector<double> all;
  std::int64_t expected = 0;
  config.threads = threads;
  config.on_run = [&](std::int64_t run, std::span<const double> numbers) {
    EXPECT_EQ(run, expected++);
    all.insert(all.end(), numbers.begin(), numbers.end());
  };
  const auto outcome = sim::monte_carlo(servo(), adrc(), config, variation)
                           .template run<Lanes>(overshoot, rms, mean_input, last, settled);
  EXPECT_TRUE(outcome.has_value());
  EXPECT_EQ(outcome->runs, config.runs);
  EXPECT_EQ(outcome->failed, 0);
  EXPECT_TRUE(outcome->completed);
  lanes = outcome->lanes;
  return all;
}

TEST(MonteCarlo, GivesTheSameBitsForAnyThreadsAndLanes) {
  int lanes = 0;
  const auto alone = all_numbers<1>(busy(), 1, vary, lanes);
  EXPECT_EQ(lanes, 1);
  EXPECT_EQ(alone.size(), 701u * 5);
  EXPECT_EQ(all_numbers<1>(busy(), 3, vary, lanes), alone);
  EXPECT_EQ(all_numbers<2>(busy(), 2, vary, lanes), alone);
  EXPECT_EQ(lanes, 2);
  EXPECT_EQ(all_numbers<4>(busy(), 3, vary, lanes), alone);
  EXPECT_EQ(lanes, 4);
}

// What a run's numbers are made of, by hand from what sim::run records of it.
TEST(MonteCarlo, RepeatsARunAndItsNumbers) {
  int lanes = 0;
  const auto all = all_numbers<4>(busy(), 2, vary, lanes);
  const auto study = sim::monte_carlo(servo(), adrc(), busy(), vary);
  for (const std::int64_t run : {0, 255, 256, 700}) {
    const auto recording = study.replay(run);
    ASSERT_TRUE(recording.has_value());
    double largest = -1e9, squares = 0, sum = 0, settles = 0;
    int in_window = 0;
    const std::size_t samples = recording->t.size();
    ASSERT_EQ(samples, 100u);
    for (std::size_t k = 0; k < samples; ++k) {
      const double e = recording->output[k] - recording->reference[k];
      const double t = recording->t[k];
      largest = std::max(largest, e);
      if (t > 0.0999 && t < 0.1501) {
        squares += e * e;
        ++in_window;
      }
      sum += recording->input[k];
      if (t > 0.0199 && std::abs(e) > 0.1) settles = t - 0.02;
    }
    EXPECT_EQ(in_window, 26);
    const double* numbers = &all[static_cast<std::size_t>(run) * 5];
    EXPECT_EQ(numbers[0], largest);
    EXPECT_DOUBLE_EQ(numbers[1], std::sqrt(squares / 26));
    EXPECT_DOUBLE_EQ(numbers[2], sum / 100);
    EXPECT_EQ(numbers[3], recording->controller.observer().total_disturbance());
    EXPECT_DOUBLE_EQ(numbers[4], settles);
  }
}

TEST(MonteCarlo, DrawsNewChanceForEachRunAndSeed) {
  Config config = busy();
  config.runs = 300;
  const auto numbers = [&] {
    std::vector<double> first;
    config.on_run = [&](std::int64_t, std::span<const double> n) { first.push_back(n[0]); };
    EXPECT_TRUE(sim::monte_carlo(servo(), adrc(), config).run<4>(overshoot).has_value());
    return first;
  };
  const auto drawn = numbers();
  auto sorted = drawn;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end());
  config.loop.seed = 100;
  EXPECT_NE(numbers(), drawn);
}

TEST(MonteCarlo, CountsWhatItSaw) {
  Config config = busy();
  std::vector<double> seen;
  config.on_run = [&](std::int64_t, std::span<const double> numbers) {
    seen.push_back(numbers[0]);
  };
  const auto outcome = sim::monte_carlo(servo(), adrc(), config, vary)
                           .run<4>(overshoot, rms, mean_input, last, settled)
                           .value();
  const auto& numbers = outcome.numbers[0];
  EXPECT_EQ(numbers.name(), "overshoot");
  EXPECT_EQ(numbers.count(), 701);
  const auto worst = std::max_element(seen.begin(), seen.end());
  EXPECT_EQ(numbers.largest(), *worst);
  EXPECT_EQ(numbers.run_of_largest(), worst - seen.begin());
  const auto kept = std::count_if(seen.begin(), seen.end(), [](double x) { return x <= 0.05; });
  EXPECT_GT(kept, 0);
  EXPECT_LT(kept, 701);
  EXPECT_EQ(numbers.kept(), kept);
  EXPECT_EQ(outcome.share_kept(0), static_cast<double>(kept) / 701);
}

// The statistics against those of a sorted list, numbers of either sign and zeros among them.
TEST(RunStatistics, AreThoseOfTheSortedList) {
  sim::RunStatistics statistics("x", 0.5);
  sim::Draw draw(1, 1);
  std::vector<double> all;
  long double sum = 0;
  for (int i = 0; i < 20000; ++i) {
    const double x = i % 100 == 0 ? 0.0 : draw.normal() * draw.uniform_ratio(1e-3, 1e3);
    all.push_back(x);
    statistics.add(i, x);
    sum += x;
  }
  const long double mean = sum / 20000;
  long double squares = 0;
  for (const double x : all) squares += (x - mean) * (x - mean);
  EXPECT_NEAR(statistics.mean(), static_cast<double>(mean), 1e-12 * 200);
  EXPECT_NEAR(statistics.deviation(), static_cast<double>(std::sqrt(squares / 19999)), 1e-12 * 200);
  std::sort(all.begin(), all.end());
  EXPECT_EQ(statistics.smallest(), all.front());
  EXPECT_EQ(statistics.largest(), all.back());
  EXPECT_EQ(statistics.kept(), std::upper_bound(all.begin(), all.end(), 0.5) - all.begin());
  for (const double share : {0.0, 0.001, 0.1, 0.45, 0.5, 0.6, 0.95, 0.999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::max(0.0, std::ceil(share * 20000) - 1));
    const double exact = all[rank];
    EXPECT_NEAR(statistics.quantile(share), exact, std::abs(exact) / 4096 + 1e-300) << share;
  }
  EXPECT_EQ(sim::RunStatistics().quantile(0.5), 0.0);
  // A number at the limit keeps it, the first of two equal ones tells the run, and what is in one
  // bin, the 2^-12 above 1, is spread over all of it.
  sim::RunStatistics one("one", 1.0);
  for (int i = 0; i < 4096; ++i) one.add(i, 1 + i % 2048 * std::ldexp(1, -23));
  EXPECT_EQ(one.kept(), 2);
  EXPECT_EQ(one.run_of_smallest(), 0);
  EXPECT_EQ(one.run_of_largest(), 2047);
  EXPECT_NEAR(one.quantile(0.5), 1 + std::ldexp(1, -13), std::ldexp(1, -23));
  EXPECT_EQ(sim::RunStatistics().deviation(), 0.0);
}

// Plants that blow up (a pole at +4000: 1e308 within 0.18 s) and a refused design, in packs with
// others, which must not feel it.
TEST(MonteCarlo, LeavesOutRunsThatFail) {
  Config config{.runs = 300, .loop = {.duration = 0.3, .reference = 1.0, .noise = 1e-3}};
  const auto some_fail = [](auto& trial, sim::Draw& draw) -> Check<double> {
    if (draw.run() % 50 == 17) trial.plant.a(1, 1) = 4000;
    if (draw.run() % 50 == 30) return Error<double>{"design", 3.0, "was refused"};
    return {};
  };
  std::vector<double> good, mixed;
  config.on_run = [&](std::int64_t, std::span<const double> n) { good.push_back(n[0]); };
  ASSERT_TRUE(sim::monte_carlo(servo(), adrc(), config).run<4>(overshoot).has_value());
  config.on_run = [&](std::int64_t, std::span<const double> n) { mixed.push_back(n[0]); };
  const auto study = sim::monte_carlo(servo(), adrc(), config, some_fail);
  const auto outcome = study.run<4>(overshoot).value();
  EXPECT_EQ(outcome.runs, 300);
  EXPECT_EQ(outcome.failed, 12);
  EXPECT_EQ(outcome.first_failure.run, 17);
  EXPECT_STREQ(outcome.first_failure.error.field, "plant");
  EXPECT_EQ(outcome.numbers[0].count(), 288);
  for (std::size_t i = 0; i < 300; ++i) {
    const bool fails = i % 50 == 17 || i % 50 == 30;
    EXPECT_EQ(std::isnan(mixed[i]), fails) << i;
    if (!fails) {
      EXPECT_EQ(mixed[i], good[i]);
    }
  }
  EXPECT_LT(outcome.share_kept(0), 288.5 / 300);
  EXPECT_EQ(refusal(study.trial(30)), "design: was refused");
  EXPECT_EQ(refusal(study.replay(30)), "design: was refused");
}

TEST(MonteCarlo, StopsWithTheRunsThatItHas) {
  Config config{.runs = 5000, .loop = {.duration = 0.02, .noise = 1e-3}, .threads = 3};
  std::vector<std::int64_t> calls;
  config.progress = [&](std::int64_t done) {
    calls.push_back(done);
    return done < 1000;
  };
  const auto stopped = sim::monte_carlo(servo(), adrc(), config).run<4>(overshoot).value();
  EXPECT_EQ(calls, (std::vector<std::int64_t>{256, 512, 768, 1024}));
  EXPECT_FALSE(stopped.completed);
  EXPECT_EQ(stopped.runs, 1024);
  config.progress = {};
  config.runs = 1024;
  const auto whole = sim::monte_carlo(servo(), adrc(), config).run<4>(overshoot).value();
  EXPECT_TRUE(whole.completed);
  EXPECT_EQ(whole.numbers[0].mean(), stopped.numbers[0].mean());
  EXPECT_EQ(whole.numbers[0].deviation(), stopped.numbers[0].deviation());
}

TEST(Draw, IsWithinItsEnds) {
  sim::Draw draw(3, 5);
  double sum = 0, logarithms = 0;
  for (int i = 0; i < 100000; ++i) {
    const double x = draw.uniform(2, 3), ratio = draw.uniform_ratio(0.5, 8);
    ASSERT_TRUE(2 <= x && x <= 3 && 0.5 <= ratio && ratio <= 8);
    sum += x / 1e5;
    logarithms += std::log2(ratio) / 1e5;
  }
  // Four standard errors.
  EXPECT_NEAR(sum, 2.5, 4 / std::sqrt(12e5));
  EXPECT_NEAR(logarithms, 1, 4 * 4 / std::sqrt(12e5));
}

TEST(MonteCarlo, RefusesByName) {
  const auto answer = [](Config config, sim::MeasureOptions options = {}) {
    return refusal(
        sim::monte_carlo(servo(), adrc(), config).run<1>(sim::largest("e", error, options)));
  };
  Config config{.runs = 2, .loop = {.duration = 0.02}};
  EXPECT_EQ(answer(config), "accepted");
  config.runs = 0;
  EXPECT_EQ(answer(config), "runs: must be 1 or more");
  config.runs = 1;
  EXPECT_EQ(answer(config), "accepted");
  config.threads = -1;
  EXPECT_EQ(answer(config), "threads: must be 0 .. 4096");
  config.threads = 4097;
  EXPECT_EQ(answer(config), "threads: must be 0 .. 4096");
  config.threads = 1;
  config.loop.number = 3;
  EXPECT_EQ(answer(config), "loop.number: must be left out");
  config.loop.number.reset();
  config.loop.duration = 0.0211;
  EXPECT_EQ(answer(config), "duration: must be a whole multiple of sample_time, which is");
  config.loop.duration = 0.02;
  config.loop.noise = -1;
  EXPECT_EQ(answer(config), "noise: must be finite and not negative");
  config.loop.noise = 0;
  EXPECT_EQ(answer(config, {.from = 0.018}), "accepted");
  EXPECT_EQ(answer(config, {.from = 0.02}),
            "measure.from: must be before the last sample of the loop");
  EXPECT_EQ(answer(config, {.from = 0.01, .to = 0.01}), "accepted");
  EXPECT_EQ(answer(config, {.from = 0.01, .to = 0.009}),
            "measure.to: must not be before measure.from");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(answer(config, {.from = nan}),
            "measure.from: must be before the last sample of the loop");
  EXPECT_EQ(answer(config, {.to = nan}), "measure.to: must not be before measure.from");
  for (const double bad : {nan, -std::numeric_limits<double>::infinity()})
    EXPECT_EQ(answer(config, {.limit = bad}), "measure.limit: must be finite, or left out");
  EXPECT_EQ(answer(config, {.limit = -1.0}), "accepted");
  for (const double bad : {nan, -1.0, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(
        refusal(
            sim::monte_carlo(servo(), adrc(), config).run<1>(sim::settling_time("s", error, bad))),
        "measure.band: must be finite and not negative");
  }
}

// A number of no sample, or of one that is none, would look like any other.
TEST(MonteCarlo, FailsRunsWithoutANumber) {
  const Config config{.runs = 4, .loop = {.duration = 0.02, .noise = 1e-3}};
  const auto wrong = [&](const auto& measure) {
    const auto outcome = sim::monte_carlo(servo(), adrc(), config).run<1>(measure).value();
    EXPECT_EQ(outcome.numbers[0].count(), 4 - outcome.failed);
    return outcome.failed == 4 ? outcome.first_failure.error.rule : "";
  };
  const sim::MeasureOptions between{.from = 0.0103, .to = 0.0117};
  EXPECT_STREQ(wrong(sim::largest("e", error, between)), "(its window) has no sample");
  EXPECT_STREQ(wrong(sim::settling_time("e", error, 0.1, between)), "(its window) has no sample");
  EXPECT_STREQ(wrong(sim::largest("e", error, {.from = 0.01, .to = 0.01})), "");
  const auto none = [](const auto& sample) {
    using S = std::remove_cvref_t<decltype(sample.output)>;
    return sample.output + S(sample.t > 0.01 ? std::numeric_limits<double>::quiet_NaN() : 0.0);
  };
  EXPECT_STREQ(wrong(sim::largest("e", none)), "(its number) is not finite");
  EXPECT_STREQ(wrong(sim::settling_time("e", none, 0.1)), "(its number) is not finite");
  EXPECT_STREQ(wrong(sim::largest("e", none, {.to = 0.01})), "");
  // What only goes wrong in a run is no refusal, even where it does at the first sample.
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto failed_by = [&](const auto& controller, auto loop) {
    loop.duration = 0.02;
    const auto outcome =
        sim::monte_carlo(servo(), controller, {.runs = 2, .loop = loop}).template run<1>(overshoot);
    return outcome ? std::string(outcome->first_failure.error.field) : "refused";
  };
  EXPECT_EQ(failed_by(adrc(), sim::RunConfig<Servo, Controller>{.disturbance = nan}),
            "disturbance");
  const auto own = [nan](double, double) { return nan; };
  using Own = sim::RunConfig<Servo, std::remove_const_t<decltype(own)>>;
  EXPECT_EQ(failed_by(own, Own{.sample_time = T}), "controller");
}

/// A pendulum whose length differs: a function that holds a number says what it is in packs.
template <class S>
struct Pendulum {
  template <class T>
  using with_scalar = Pendulum<T>;

  Vector<S, 2> operator()(double, const Vector<S, 2>& x, const S& u) const {
    const S cubic = x(0) - x(0) * x(0) * x(0) * S(1.0 / 6);
    return {x(1), u - rate * cubic};
  }
  S rate{9.81};
};

// What cannot go through packs goes one by one, and gives the same.
TEST(MonteCarlo, RunsWhatPacksCannot) {
  const auto own = [](double y, double r) { return 20 * (r - y); };
  const auto one_by_one =
      sim::monte_carlo(servo(), own, {.runs = 10, .loop = {.duration = 0.02, .sample_time = T}})
          .run<4>(overshoot);
  EXPECT_EQ(one_by_one->lanes, 1);

  const Config shaky{.runs = 10, .loop = {.duration = 0.02, .noise = 1e-3, .jitter = 0.2}};
  const auto jitter = sim::monte_carlo(servo(), adrc(), shaky).run<4>(overshoot);
  EXPECT_EQ(jitter->lanes, 1);
  EXPECT_GT(jitter->numbers[0].deviation(), 0);

  using P = Pack<double, 2>;
  const auto packed = LinearPlant<2, P>::chain({.coefficients = {P(7), P(3)}}).value();
  const auto fourfold = [](const P& y, const P& r) { return r - y; };
  EXPECT_EQ(refusal(sim::run(packed, fourfold,
                             {.duration = 0.02, .sample_time = T, .jitter = 0.1, .number = 1})),
            "jitter: must be left out if packs run by number");
}

/// The table has each run with the numbers that `on_run` is told, all their digits.
TEST(MonteCarlo, WritesATable) {
  const auto own = [](double y, double r) { return 20 * (r - y); };
  std::vector<double> numbers;
  const auto study = sim::monte_carlo(
      servo(), own,
      {.runs = 300,
       .loop = {.duration = 0.02, .sample_time = T, .reference = 1.0, .noise = 1e-3},
       .on_run = [&](std::int64_t, std::span<const double> n) {
         numbers.insert(numbers.end(), n.begin(), n.end());
       }});
  std::string csv;
  const auto end = sim::final_value("the \"end\"", error);
  const auto top = sim::largest("top, m", error);
  const auto outcome = study.run_to_csv(csv, end, top, sim::average("plain", error)).value();
  ASSERT_EQ(numbers.size(), 900u);
  EXPECT_EQ(outcome.runs, 300);
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "run,\"the \"\"end\"\"\",\"top, m\",plain");
  for (std::size_t i = 0; i < 300; ++i) {
    ASSERT_TRUE(std::getline(lines, line));
    char* at = nullptr;
    ASSERT_EQ(std::strtol(line.c_str(), &at, 10), static_cast<long>(i));
    for (std::size_t k = 0; k < 3; ++k) ASSERT_EQ(std::strtod(at + 1, &at), numbers[3 * i + k]);
    ASSERT_EQ(*at, '\0');
  }
  EXPECT_FALSE(std::getline(lines, line));
}

/// An observer of a user, who knows of no packs: what it inherits of them is not its own.
struct Own : LinearEso<2> {
  static Expected<Own, Error<double>> make(const Config& config) {
    const auto made = LinearEso<2>::make(config);
    if (!made) return made.error();
    return Own{*made};
  }
  StepStatus update(double y, double u) noexcept { return LinearEso<2>::update(0.5 * y, u); }
};

/// The lanes in which runs go, whose numbers are those of single runs.
template <class C>
int lanes_of(void (*settings)(typename C::Config&) = nullptr) {
  typename C::Config all{};
  auto& config = [&all]() -> auto& {
    if constexpr (requires { all.controller; }) {
      return all.controller;
    } else {
      return all;
    }
  }
  ();
  auto& chain = chain_config<std::remove_cvref_t<decltype(std::declval<const C&>().observer())>>(
      config.observer);
  chain.observer_bandwidth = 80;
  chain.input_gain = 50;
  chain.sample_time = T;
  config.limits = {.lower = -6, .upper = 6};
  if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth = 12;
  if (settings != nullptr) settings(all);
  std::vector<double> numbers;
  const sim::MonteCarloConfig<Servo, C> study{
      .runs = 6,
      .loop = {.duration = 0.06, .reference = 0.5, .disturbance = 3.0, .noise = 1e-3},
      .on_run = [&](std::int64_t, std::span<const double> n) { numbers.push_back(n[0]); }};
  const auto runs = sim::monte_carlo(servo(), C::make(all).value(), study);
  const auto outcome = runs.template run<4>(sim::final_value("y", error)).value();
  EXPECT_EQ(outcome.failed, 0);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto alone = runs.replay(static_cast<std::int64_t>(i)).value();
    EXPECT_EQ(numbers[i], alone.output.back() - alone.reference.back()) << i;
  }
  return outcome.lanes;
}

// Whether it is in packs is a question that every controller bears.
TEST(MonteCarlo, AsksEveryControllerForPacks) {
  using Swinging = ModelEso<ModelParts{.order = 2, .resonators = 1}>;
  const auto swing = [](auto& config) { config.observer.model.resonators[0].frequency = 20; };
  EXPECT_EQ(lanes_of<Adrc<LinearEso<2>>>(), 4);
  EXPECT_EQ(lanes_of<Adrc<Swinging>>(swing), 4);
  EXPECT_EQ(lanes_of<Adrc<Own>>(), 1);
#ifndef ESOKIT_ONE_TYPE
  EXPECT_EQ(lanes_of<DisturbanceCompensator<Swinging>>(swing), 4);
  EXPECT_EQ(lanes_of<Adrc<Guarded<LinearEso<2>>>>(), 1);
  EXPECT_EQ((lanes_of<Adrc<DelayedInput<LinearEso<2>, 4>>>()), 4);
  EXPECT_EQ(lanes_of<Adrc<VariableTime<LinearEso<2>>>>(), 1);
  const auto near = [](auto& config) { config.rest = {.error = 0.3, .time = 4 * T}; };
  EXPECT_EQ(lanes_of<Resting<Adrc<LinearEso<2>>>>(near), 1);
  EXPECT_EQ(lanes_of<Adrc<OutlierGate<LinearEso<2>>>>(), 1);
  EXPECT_EQ((lanes_of<Adrc<PlantEso<2, ModelParts{.order = 2}>>>(
                [](auto& config) { config.observer.model.plant = servo(); })),
            4);
#endif
}

TEST(MonteCarlo, TakesNonlinearPlantsInPacks) {
  std::vector<double> all;
  const auto study_of = [&all](const auto& plant, const auto& change) {
    using P = std::remove_cvref_t<decltype(plant)>;
    return sim::monte_carlo(
        plant, adrc(),
        sim::MonteCarloConfig<P, Controller>{
            .runs = 37,
            .loop = {.duration = 0.1,
                     .reference = 1.0,
                     .noise = 1e-3,
                     .substeps = 3,
                     .state = Vector<double, 2>{0.0, 3.0}},
            .on_run = [&all](std::int64_t, std::span<const double> n) { all.push_back(n[0]); }},
        change);
  };
  const auto lengths =
      study_of(sim::nonlinear_plant<2>(Pendulum<double>{}),
               [](auto& trial, sim::Draw& draw) { trial.plant.f.rate = draw.uniform(5, 15); });
  EXPECT_EQ(lengths.run<4>(overshoot)->lanes, 4);
  const auto in_packs = std::exchange(all, {});
  EXPECT_EQ(lengths.run<1>(overshoot)->lanes, 1);
  EXPECT_EQ(in_packs, all);
  EXPECT_NE(all[0], all[1]);
  const auto lanes_of = [&](const auto& plant) {
    return study_of(plant, sim::NoVariation{}).template run<4>(overshoot)->lanes;
  };
  EXPECT_EQ(lanes_of(sim::nonlinear_plant<2>([](const auto&, const auto& x, const auto& u) {
              return std::remove_cvref_t<decltype(x)>{x(1), u - x(0) * x(0) * x(1)};
            })),
            4);
  // A function of doubles alone, and one that holds a number without saying what it is in packs.
  EXPECT_EQ(lanes_of(sim::nonlinear_plant<2>([](double, const Vector<double, 2>& x, double u) {
              return Vector<double, 2>{x(1), u - std::sin(x(0))};
            })),
            1);
  const double rate = 3;
  EXPECT_EQ(lanes_of(sim::nonlinear_plant<2>([rate](const auto&, const auto& x, const auto& u) {
              return std::remove_cvref_t<decltype(x)>{
                  x(1), u - x(0) * std::remove_cvref_t<decltype(u)>(rate)};
            })),
            1);
}

}  // namespace sim_monte_carlo_test
