// run: against loops by hand bit for bit or to rounding, each kind of controller, gaps, jitter,
// dead time, what is refused and by which rule.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/held_plant.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/sim/signals.hpp>
#include <limits>
#include <string>
#include <support/refusal.hpp>
#include <vector>

namespace sim_run_test {

using namespace esokit;
using esokit_test::refusal;
using Eso = LinearEso<2>;
using State = Vector<double, 2>;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double T = 2e-3;
constexpr double b0 = 40;

/// y'' + 3 y' + 7 y = 50 u + d
LinearPlant<2> servo(double dead_time = 0) {
  return LinearPlant<2>::chain({.coefficients = {7, 3}, .input_gain = 50, .dead_time = dead_time})
      .value();
}
Adrc<Eso>::Config settings() {
  return {.observer = {.observer_bandwidth = 80, .input_gain = b0, .sample_time = T},
          .controller_bandwidth = 8,
          .limits = {.lower = -2, .upper = 2},
          .missing = {.most = 20, .input = 0.25}};
}
Adrc<Eso> adrc() { return Adrc<Eso>::make(settings()).value(); }
double step(double t) { return t < 0.1 ? 0.0 : 1.0; }
double load(double t) { return t < 0.5 ? 0.0 : -30.0; }

/// One sample of the servo under held u and d, as anyone would write it down.
State advance(const State& x, double u, double d, double time = T) {
  const auto held = held_plant(servo(), time).value();
  State next = x;
  for (int i = 0; i < 2; ++i) {
    double sum = x(i);
    for (int j = 0; j < 2; ++j) sum = sum + held.increment(i, j) * x(j);
    next(i) = sum + held.disturbance(i) * d + held.input(i) * u;
  }
  return next;
}

// ---- each kind of controller, beside a loop by hand ----

/// By hand: what `command(k, y, r)` returns is held.
template <class Command>
std::vector<double> by_hand(Command&& command, int samples) {
  std::vector<double> u;
  State x{0.2, -0.1};
  for (int k = 0; k < samples; ++k) {
    const double t = k * T;
    u.push_back(command(k, x(0), step(t)));
    x = advance(x, u.back(), load(t));
  }
  return u;
}

template <class C>
std::vector<double> by_run(const C& controller) {
  return sim::run(servo(), controller,
                  {.duration = 500 * T,
                   .sample_time = T,
                   .reference = step,
                   .disturbance = load,
                   .state = {0.2, -0.1}})
      .value()
      .input;
}

TEST(Run, IsALoopByHandWithAdrc) {
  auto hand = adrc();
  const auto u = by_hand([&](int, double y, double r) { return hand.update(y, r); }, 500);
  EXPECT_EQ(by_run(adrc()), u);
  // The limits count and the load is found: the test would see it if they did not.
  EXPECT_EQ(*std::max_element(u.begin(), u.end()), 2.0);
}

TEST(Run, IsALoopByHandWithTheOthers) {
  using Predictive = PredictiveAdrc<Eso>;
  const auto predictive = Predictive::make({.observer = settings().observer,
                                            .controller_bandwidth = 8,
                                            .limits = {.lower = -2, .upper = 2}})
                              .value();
  auto two = predictive;
  two.set_reference(step(0));
  EXPECT_EQ(by_run(predictive), by_hand(
                                    [&](int k, double y, double) {
                                      const double u = two.control(y);
                                      two.prepare(step((k + 1) * T));
                                      return u;
                                    },
                                    500));

  // A compensator around a controller that was there before.
  auto compensator = DisturbanceCompensator<Eso>::make(
                         {.observer = settings().observer, .limits = {.lower = -2, .upper = 2}})
                         .value();
  const auto wrapped = [compensator](double y, double r) mutable {
    return compensator.update(y, 3 * (r - y));
  };
  EXPECT_EQ(
      by_run(wrapped),
      by_hand([&](int, double y, double r) { return compensator.update(y, 3 * (r - y)); }, 500));
}

TEST(Run, GivesDerivativesToAdrcThatHasThem) {
  const auto smooth = sim::FilteredStep<4>::make({.time_constant = 0.05}).value();
  const auto recorded =
      sim::run(servo(), adrc(), {.duration = 300 * T, .reference = smooth, .state = {0.2, -0.1}})
          .value();
  const auto vectors = sim::run(servo(), adrc(),
                                {.duration = 300 * T,
                                 .reference =
                                     [&](double t) {
                                       const auto all = smooth.derivatives<2>(t);
                                       return State{all[0], all[1]};
                                     },
                                 .state = {0.2, -0.1}})
                           .value();
  auto hand = adrc(), shorter = adrc();
  State x{0.2, -0.1}, z = x;
  for (std::size_t k = 0; k < 300; ++k) {
    const auto r = smooth.derivatives<3>(static_cast<double>(k) * T);
    const double u = hand.update(x(0), {r[0], r[1], r[2]});
    ASSERT_EQ(recorded.input[k], u);
    ASSERT_EQ(recorded.reference[k], r[0]);
    x = advance(x, u, 0.0);
    const double w = shorter.update(z(0), {r[0], r[1]});
    ASSERT_EQ(vectors.input[k], w);
    z = advance(z, w, 0.0);
  }
}

using Pair = Vector<double, 2>;

TEST(Run, IsALoopByHandWithMimoAdrc) {
  using Mimo = MimoAdrc<Eso, LinearEso<1>>;
  const auto plant =
      LinearPlant<3, double, 2, 2>::state_space({.a = {{0, 1, 0}, {0, -1, 0}, {0, 0, -2}},
                                                 .b = {{0, 0}, {2, 1.4}, {1.2, 3}},
                                                 .c = {{1, 0, 0}, {0, 0, 1}}})
          .value();
  Mimo::Config config{.observers = {{.observer_bandwidth = 80, .sample_time = T},
                                    {.observer_bandwidth = 60, .sample_time = T}},
                      .controller_bandwidths = {8, 10}};
  config.input_matrix = plant.input_gain();
  auto mimo = Mimo::make(config).value();
  const auto r = [](double t) { return Pair{step(t), 0.5}; };
  const auto d = [](double t) { return Pair{0.1, -load(t) / 30}; };
  const auto recorded =
      sim::run(plant, mimo, {.duration = 1.0, .reference = r, .disturbance = d}).value();
  const auto held = held_plant(plant, T).value();
  Vector<double, 3> x;
  for (std::size_t k = 0; k < 500; ++k) {
    const double t = static_cast<double>(k) * T;
    const Pair u = mimo.update(plant.output(x), r(t));
    for (int i = 0; i < 2; ++i) {
      const auto channel = static_cast<std::size_t>(i);
      ASSERT_EQ(recorded.input[channel][k], u(i));
      ASSERT_EQ(recorded.output[channel][k], plant.output(x)(i));
      ASSERT_EQ(recorded.reference[channel][k], r(t)(i));
    }
    x = held.advanced(x, u, d(t));
  }
  EXPECT_EQ(recorded.state, x);
  EXPECT_TRUE(recorded.total_disturbance.empty());
  EXPECT_NE(recorded.csv().find("t,y1,y2,measurement1,measurement2,reference1,reference2,u1,u2\n"),
            std::string::npos);
}

TEST(Run, OfAFloatControllerComputesInFloat) {
  using Small = Adrc<LinearEso<2, float>>;
  const auto controller =
      Small::make({.observer = {.observer_bandwidth = 80, .input_gain = b0, .sample_time = 2e-3f},
                   .controller_bandwidth = 8,
                   .limits = {.lower = -2, .upper = 2}})
          .value();
  auto hand = controller;
  const auto narrow = [&](int, double y, double r) -> double {
    const float u = hand.update(static_cast<float>(y), static_cast<float>(r));
    return static_cast<double>(u);
  };
  EXPECT_EQ(by_run(controller), by_hand(narrow, 500));
  // The controller's own T, which is not the double's.
  EXPECT_EQ(sim::run(servo(), controller, {.duration = 1.0})->samples, 500);
}

// ---- nonlinear plants ----

TEST(Run, IntegratesANonlinearPlantWithOrderFour) {
  // A stiff linear plant as a function: the exact run is the reference.
  const auto plant = LinearPlant<2>::transfer_function(
      {.numerator = {5000}, .denominator = {5000, 20}, .dead_time = 0.004});
  const auto function = sim::nonlinear_plant<2>([](double, const State& x, double u) {
    return State{x(1), -5000 * x(0) - 20 * x(1) + 5000 * u};
  });
  const auto law = [](double y, double r) { return r - 0.3 * y; };
  const auto exact = sim::run(
      *plant, law,
      {.duration = 0.2, .sample_time = 0.01, .reference = step, .disturbance = [](double t) {
         return 3 * step(t);
       }});
  double before = 0;
  for (const int substeps : {2, 4, 8}) {
    const auto run = sim::run(function, law,
                              {.duration = 0.2,
                               .sample_time = 0.01,
                               .reference = step,
                               .disturbance = [](double t) { return 3 * step(t); },
                               .dead_time = 0.004,
                               .substeps = substeps});
    const double error = std::abs(run->state(0) - exact->state(0));
    if (before > 0) {
      EXPECT_NEAR(before / error, 16.0, 4.0) << substeps;
    }
    EXPECT_LT(error, 0.02);
    before = error;
  }
}

/// A plant of the continuous simulation, with states of Eigen's.
struct Pendulum {
  static constexpr int states = 2;
  using State = EigenMatrix<double, 2>;
  State derivative(double, const State& x, double u) const {
    return State(x(1), -9.81 * std::sin(x(0)) + u);
  }
  double output(double, const State& x) const { return x(0); }
};

TEST(Run, TakesAPlantOfTheContinuousSimulationAndOneWithTwoInputs) {
  const auto law = [](double y, double r) { return 30 * (r - y); };
  const auto function = sim::nonlinear_plant<2>([](double, const State& x, double u) {
    return State{x(1), -9.81 * std::sin(x(0)) + u};
  });
  const auto twice = sim::nonlinear_plant<2, double, 2, 2>(
      [](double, const State& x, const Pair& u) {
        return State{x(1), -9.81 * std::sin(x(0)) + u(0) - u(1)};
      },
      [](double, const State& x) { return x; });
  const auto split = [](const Pair& y, const Pair& r) { return Pair{30 * r(0), 30 * y(0)}; };
  const auto one =
      sim::run(Pendulum{}, law, {.duration = 0.5, .sample_time = 0.01, .reference = 1});
  const auto two = sim::run(function, law, {.duration = 0.5, .sample_time = 0.01, .reference = 1});
  const auto three =
      sim::run(twice, split, {.duration = 0.5, .sample_time = 0.01, .reference = Pair{1, 0}});
  EXPECT_EQ(one->output, two->output);
  for (std::size_t k = 0; k < 50; ++k) EXPECT_NEAR(three->output[0][k], two->output[k], 1e-13);
  EXPECT_GT(one->output.back(), 0.5);
}

// ---- dead time ----

TEST(Run, DelaysTheInputByWholeSamplesAndParts) {
  for (const double late : {0.0, 0.3, 1.0, 2.0, 2.7}) {
    // The last inputs, newest first; the oldest acts until its successor arrives.
    const auto recorded = sim::run(
        servo(late * T), adrc(),
        {.duration = 200 * T, .reference = 1.0, .disturbance = -30.0, .initial_input = 0.5});
    auto hand = adrc();
    std::vector<double> u(5, 0.5);
    State x;
    const int whole = static_cast<int>(late);
    const double part = late - whole;
    for (std::size_t k = 0; k < 200; ++k) {
      ASSERT_NEAR(recorded->output[k], x(0), 1e-12) << late << " " << k;
      u.insert(u.begin(), hand.update(x(0), 1.0));
      if (part > 0) x = advance(x, u[static_cast<std::size_t>(whole + 1)], -30.0, part * T);
      x = advance(x, u[static_cast<std::size_t>(whole)], -30.0, (1 - part) * T);
    }
    // Of the config it is the same, and both add up.
    for (const double share : {0.0, 0.4}) {
      const auto other = sim::run(servo(share * late * T), adrc(),
                                  {.duration = 200 * T,
                                   .reference = 1.0,
                                   .disturbance = -30.0,
                                   .dead_time = (1 - share) * late * T,
                                   .substeps = 3,
                                   .initial_input = 0.5});
      for (std::size_t k = 0; k < 200; ++k) {
        ASSERT_NEAR(recorded->output[k], other->output[k], 1e-12);
      }
    }
  }
}

// ---- noise, gaps, jitter ----

TEST(Run, LosesSamplesAsTheSensorSays) {
  const auto sensor = [](double t, double y) {
    return t > 0.6 && t < 0.7 ? not_a_number : y + 1e-3;
  };
  std::vector<LoopMode> modes;
  const auto end = sim::run(
      servo(), adrc(), {.duration = 1.0, .reference = step, .disturbance = load, .sensor = sensor},
      [&](const auto&, const Adrc<Eso>& controller) { modes.push_back(controller.mode()); });
  auto hand = adrc();
  State x;
  int safe = 0;
  for (std::size_t k = 0; k < 500; ++k) {
    const double t = static_cast<double>(k) * T;
    x = advance(x, hand.update(sensor(t, x(0)), step(t)), load(t));
    ASSERT_EQ(modes[k], hand.mode());
    safe += modes[k] == LoopMode::safe ? 1 : 0;
    if (modes[k] == LoopMode::safe) {
      EXPECT_EQ(hand.output(), 0.25);
    }
  }
  EXPECT_EQ(end->state, x);
  EXPECT_GT(safe, 20);
}

TEST(Run, DrawsNoiseAndLossesApart) {
  const sim::RunConfig<LinearPlant<2>, Adrc<Eso>> config{
      .duration = 40.0, .reference = 1.0, .noise = 0.01, .missing = 0.2, .seed = 5};
  const auto run = sim::run(servo(), adrc(), config).value();
  auto without = config;
  without.missing = 0;
  const auto whole = sim::run(servo(), adrc(), without).value();
  double sum = 0, square = 0;
  int lost = 0;
  sim::Gaussian noise(5);
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double v = whole.measurement[k] - whole.output[k];
    EXPECT_NEAR(v, 0.01 * noise.next(), 1e-15);
    sum += v;
    square += v * v;
    if (is_finite(run.measurement[k])) {
      EXPECT_NEAR(run.measurement[k] - run.output[k], v, 1e-15);
    } else {
      ++lost;
    }
  }
  const double count = static_cast<double>(run.t.size());
  EXPECT_NEAR(sum / count, 0.0, 4 * 0.01 / std::sqrt(count));
  EXPECT_NEAR(square / count, 1e-4, 4 * 1e-4 * std::sqrt(2 / count));
  EXPECT_NEAR(lost / count, 0.2, 4 * std::sqrt(0.16 / count));
  // Equal seeds, equal runs; others, others.
  EXPECT_EQ(sim::run(servo(), adrc(), config)->input, run.input);
  without = config;
  without.seed = 6;
  EXPECT_NE(sim::run(servo(), adrc(), without)->input, run.input);
}

TEST(Run, TellsAControllerThatAsksHowLongAStepTook) {
  using Varying = Adrc<VariableTime<Eso>>;
  const auto controller = Varying::make({.observer = {.observer = settings().observer, .ratio = 2},
                                         .controller_bandwidth = 8})
                              .value();
  const auto length = [](std::int64_t k) {
    return T * (1 + 0.3 * std::sin(0.7 * static_cast<double>(k)));
  };
  for (const double late : {0.0, 1.6}) {
    const auto recorded = sim::run(servo(late * T), controller,
                                   {.duration = 300 * T, .reference = 1.0, .step_time = length})
                              .value();
    auto hand = controller;
    State x;
    double t = 0, passed = T;
    std::vector<double> u, sent;  // every input and when it was sent
    for (std::size_t k = 0; k < 300; ++k) {
      ASSERT_NEAR(recorded.t[k], t, 1e-12);
      ASSERT_NEAR(recorded.output[k], x(0), 1e-11);
      hand.set_step_time(passed).value();
      u.push_back(hand.update(x(0), 1.0));
      sent.push_back(t);
      passed = length(static_cast<std::int64_t>(k));
      // Cut where an input arrives.
      double from = t, acting = 0;
      for (std::size_t j = 0; j <= k; ++j) {
        const double arrival = sent[j] + late * T;
        if (arrival > t && arrival < t + passed) {
          x = advance(x, acting, 0.0, arrival - from);
          from = arrival;
        }
        if (arrival < t + passed) acting = u[j];
      }
      x = advance(x, acting, 0.0, t + passed - from);
      t += passed;
    }
    EXPECT_NEAR(recorded.time, t, 1e-12);
  }
  // At random: within the share, and both sides of T.
  const auto random = sim::run(servo(), controller, {.duration = 300 * T, .jitter = 0.5}).value();
  double least = 1, most = 0;
  for (std::size_t k = 1; k < 300; ++k) {
    least = std::min(least, random.t[k] - random.t[k - 1]);
    most = std::max(most, random.t[k] - random.t[k - 1]);
  }
  EXPECT_GT(least, 0.499 * T);
  EXPECT_LT(least, 0.55 * T);
  EXPECT_LT(most, 1.501 * T);
  EXPECT_GT(most, 1.45 * T);
  // Steps outside the observer's ratio, and pauses: it takes any time.
  const auto pauses = [](std::int64_t k) { return T * (k % 3 == 0 ? 0.1 : k % 50 == 49 ? 10 : 1); };
  const auto any =
      sim::run(servo(), controller, {.duration = 3000 * T, .reference = 1.0, .step_time = pauses});
  ASSERT_EQ(refusal(any), "accepted");
  EXPECT_NEAR(any->output.back(), 1, 1e-6);
}

// ---- what comes back ----

TEST(Run, LeavesTheControllerAloneAndReturnsItsCopy) {
  const auto controller = adrc();
  const auto run =
      sim::run(servo(), controller, {.duration = 1.0, .reference = 1.0, .disturbance = -30.0});
  EXPECT_EQ(controller.output(), 0.0);
  EXPECT_EQ(run->controller.output(), run->input.back());
  EXPECT_EQ(run->samples, 500);
  EXPECT_EQ(run->time, 1.0);
  EXPECT_TRUE(run->completed);
  EXPECT_EQ(run->t.front(), 0.0);
  EXPECT_EQ(run->t.back(), 499 * T);
  EXPECT_EQ(run->total_disturbance.back(), run->controller.observer().total_disturbance());
  const auto later = sim::run(servo(), controller, {.duration = 1.0, .start_time = 3.0});
  EXPECT_EQ(later->t.front(), 3.0);
  EXPECT_EQ(later->time, 4.0);
}

TEST(Run, CallsBackAndStops) {
  // A retune while it runs, and an end when it has settled.
  auto faster = settings();
  faster.observer.observer_bandwidth = 120;
  std::vector<std::int64_t> seen;
  const auto end = sim::run(servo(), adrc(), {.duration = 2.0, .reference = 1.0},
                            [&](const auto& sample, Adrc<Eso>& controller) {
                              seen.push_back(sample.index);
                              if (sample.index == 50) controller.retune(faster).value();
                              return sample.t < 0.5;
                            });
  EXPECT_FALSE(end->completed);
  EXPECT_EQ(end->samples, 251);
  EXPECT_EQ(seen.size(), 251u);
  EXPECT_EQ(end->time, 0.5);
  auto hand = adrc();
  State x;
  for (int k = 0; k <= 250; ++k) {
    if (k > 0) x = advance(x, hand.output(), 0.0);
    hand.update(x(0), 1.0);
    if (k == 50) hand.retune(faster).value();
  }
  EXPECT_EQ(end->state, x);
  EXPECT_EQ(end->controller.output(), hand.output());
}

/// Each curve takes the column of its name.
TEST(Run, IsDrawnByOneText) {
  const auto run = sim::run(servo(), adrc(), {.duration = 3 * T, .reference = 1.0}).value();
  const std::string text = run.gnuplot("own");
  EXPECT_NE(text.find("$run << END\n" + run.csv() + "END\n"), std::string::npos);
  EXPECT_NE(text.find("layout 3,1 "), std::string::npos);
  EXPECT_NE(text.find("title 'own'\n"), std::string::npos);
  const char* columns[] = {"t", "y", "measurement", "r", "u", "dhat"};
  int curves = 0;
  for (int i = 0; i < 6; ++i) {
    const std::string curve =
        "using 1:" + std::to_string(i + 1) + " with lines title '" + columns[i] + "'";
    curves += text.find(curve) != std::string::npos ? 1 : 0;
  }
  EXPECT_EQ(curves, 4);
  EXPECT_EQ(run.csv().substr(0, run.csv().find('\n')),
            "t,y,measurement,reference,u,total_disturbance");
  // Without an observer there is nothing to draw of it.
  const auto bare = sim::run(servo(), [](double y, double r) { return 20 * (r - y); },
                             {.duration = 3 * T, .sample_time = T})
                        .value();
  EXPECT_NE(bare.gnuplot().find("layout 2,1"), std::string::npos);
  EXPECT_EQ(bare.gnuplot().find("dhat"), std::string::npos);
}

TEST(Run, IsWrittenWithAllDigits) {
  const auto run =
      sim::run(servo(), adrc(), {.duration = 3 * T, .reference = 1.0, .noise = 0.1}).value();
  const std::string text = run.csv();
  EXPECT_EQ(text.substr(0, text.find('\n')), "t,y,measurement,reference,u,total_disturbance");
  const char* at = text.c_str() + text.find('\n');
  for (std::size_t k = 0; k < 3; ++k) {
    for (const double expected : {run.t[k], run.output[k], run.measurement[k], run.reference[k],
                                  run.input[k], run.total_disturbance[k]}) {
      char* end = nullptr;
      EXPECT_EQ(std::strtod(at + 1, &end), expected);
      at = end;
    }
  }
  EXPECT_STREQ(at, "\n");
}

TEST(Run, OfPacksIsThatOfEachLane) {
  using Two = Pack<double, 2>;
  const auto plants = LinearPlant<2, Two>::chain(
      {.coefficients = {Two({7, 5}), Two({3, 1})}, .input_gain = Two({50, 45})});
  const auto of = [](double b, double omega) {
    return Adrc<LinearEso<2>>::make(
               {.observer = {.observer_bandwidth = omega, .input_gain = b, .sample_time = T},
                .controller_bandwidth = 8.0,
                .limits = {.lower = -2.0, .upper = 2.0}})
        .value();
  };
  const Packed<Adrc<LinearEso<2>>, 2> controllers(
      [&](int lane) { return lane == 0 ? of(40, 80) : of(50, 60); });
  const auto both = sim::run(*plants, controllers,
                             {.duration = 1.0, .reference = Two(1.0), .disturbance = Two(-30.0)});
  for (int lane = 0; lane < 2; ++lane) {
    const bool first = lane == 0;
    const auto plant =
        LinearPlant<2>::chain({.coefficients = {first ? 7.0 : 5.0, first ? 3.0 : 1.0},
                               .input_gain = first ? 50.0 : 45.0});
    const auto one = sim::run(*plant, of(first ? 40.0 : 50.0, first ? 80.0 : 60.0),
                              {.duration = 1.0, .reference = 1.0, .disturbance = -30.0});
    for (std::size_t k = 0; k < 500; ++k) {
      ASSERT_EQ(both->output[k][lane], one->output[k]);
      ASSERT_EQ(both->input[k][lane], one->input[k]);
    }
  }
}

// ---- refused ----

TEST(Run, RefusesBadSettings) {
  using Config = sim::RunConfig<LinearPlant<2>, Adrc<Eso>>;
  const auto said = [](const Config& config) { return refusal(sim::run(servo(), adrc(), config)); };
  for (const double bad : {not_a_number, infinity, -infinity}) {
    EXPECT_EQ(said({.duration = 1.0, .sample_time = bad}),
              "sample_time: must be finite and not negative");
    EXPECT_EQ(said({.duration = bad}), "duration: must be finite and positive");
    EXPECT_EQ(said({.duration = 1.0, .reference = bad}), "reference[0]: must be finite");
    EXPECT_EQ(said({.duration = 1.0, .disturbance = bad}), "disturbance: must be finite");
    EXPECT_EQ(said({.duration = 1.0, .noise = bad}), "noise: must be finite and not negative");
    EXPECT_EQ(said({.duration = 1.0, .missing = bad}), "missing: must be finite and not negative");
    EXPECT_EQ(said({.duration = 1.0, .jitter = bad}), "jitter: must be finite and not negative");
    EXPECT_EQ(said({.duration = 1.0, .dead_time = bad}),
              "dead_time: must be finite and not negative");
    EXPECT_EQ(said({.duration = 1.0, .start_time = bad}), "start_time: must be finite");
    EXPECT_EQ(said({.duration = 1.0, .initial_input = bad}), "initial_input: must be finite");
    EXPECT_EQ(said({.duration = 1.0, .state = {bad, 0}}), "state[0]: must be finite");
    EXPECT_EQ(said({.duration = 1.0, .state = {0, bad}}), "state[1]: must be finite");
    auto plant = servo();
    plant.a(1, 0) = bad;
    EXPECT_EQ(refusal(sim::run(plant, adrc(), {.duration = 1.0})), "a[1]: must be finite");
    // A function: at the time at which it gives it.
    const auto later = [bad](double t) { return t < 0.5 ? 0.0 : bad; };
    const auto d = sim::run(servo(), adrc(), {.duration = 1.0, .disturbance = later});
    EXPECT_EQ(refusal(d), "disturbance: is not finite in the sample at this time");
    EXPECT_EQ(d.error().value, 0.5);
    const auto u = sim::run(servo(), [&](double, double r) { return r; },
                            {.duration = 1.0, .sample_time = T, .reference = later});
    EXPECT_EQ(refusal(u), "controller: gave an input that is not finite at this time");
    EXPECT_EQ(u.error().value, 0.5);
    const auto x =
        sim::run(sim::nonlinear_plant<1>([&](double t, const Vector<double, 1>&, double) {
                   return Vector<double, 1>(t > 0.51 ? bad : 0.0);
                 }),
                 [](double, double) { return 0.0; }, {.duration = 1.0, .sample_time = 0.01});
    EXPECT_EQ(refusal(x), "plant: has a state that is not finite after the sample at this time");
    EXPECT_NEAR(x.error().value, 0.51, 1e-9);
    // Adrc keeps u under such a reference, as it promises.
    EXPECT_EQ(said({.duration = 1.0, .reference = later}), "accepted");
    EXPECT_EQ(said({.duration = 1.0, .step_time = [bad](std::int64_t) { return bad; }}),
              "step_time: must be 0.1 .. 10 times sample_time, which is");
  }
  EXPECT_EQ(said({}), "duration: must be finite and positive");
  EXPECT_EQ(said({.duration = 1.0, .sample_time = 1.001 * T}),
            "sample_time: must be that of the controller, which is");
  EXPECT_EQ(said({.duration = 1.0, .sample_time = T}), "accepted");
  EXPECT_EQ(said({.duration = 1.0007}),
            "duration: must be a whole multiple of sample_time, which is");
  EXPECT_EQ(said({.duration = 1.0, .noise = -1e-9}), "noise: must be finite and not negative");
  EXPECT_EQ(said({.duration = 1.0, .missing = 1.0}), "accepted");
  EXPECT_EQ(said({.duration = 1.0, .missing = 1.0001}), "missing: must not be above 1");
  EXPECT_EQ(said({.duration = 1.0, .jitter = 0.9}), "accepted");
  EXPECT_EQ(said({.duration = 1.0, .jitter = 0.91}), "jitter: must not be above 0.9");
  EXPECT_EQ(said({.duration = 1.0, .dead_time = 1000001 * T}),
            "dead_time: must be below 1e6 samples (1e5 with jitter)");
  for (const int bad : {0, -1, 1000001}) {
    EXPECT_EQ(said({.duration = 1.0, .substeps = bad}), "substeps: must be 1 .. 1000000");
  }
  for (const double share : {0.099, 10.01}) {
    EXPECT_EQ(said({.duration = 1.0, .step_time = [share](std::int64_t) { return share * T; }}),
              "step_time: must be 0.1 .. 10 times sample_time, which is");
  }
  // One's own controller has no T to fall back on.
  const auto own = [](double y, double r) { return r - y; };
  EXPECT_EQ(refusal(sim::run(servo(), own, {.duration = 1.0})),
            "sample_time: must be finite and positive");
  const auto unstable = LinearPlant<1>::chain({.coefficients = {-1000.0}}).value();
  EXPECT_EQ(refusal(sim::run(unstable, own, {.duration = 2.0, .sample_time = 1.0})),
            "sample_time: is so long that the plant's states leave the range of the scalar");
}

/// The loop skips the product with C where y is the first state, and the noise where there is none.
TEST(Run, MeasuresByAnyRowOfC) {
  for (const State& row : {State{1, 0}, State{0.5, 0}, State{1, 0.1}, State{0, 1}}) {
    for (const double noise : {0.0, 1e-3}) {
      auto plant = servo();
      plant.c = {{row(0), row(1)}};
      int wrong = 0, noisy = 0;
      (void)sim::run(plant, adrc(), {.duration = 200 * T, .reference = step, .noise = noise},
                     [&](const auto& sample) {
                       wrong += sample.output != plant.output(sample.state) ? 1 : 0;
                       noisy += sample.measurement != sample.output ? 1 : 0;
                     })
          .value();
      EXPECT_EQ(wrong, 0);
      EXPECT_EQ(noisy, noise > 0 ? 200 : 0);
    }
  }
}

}  // namespace sim_run_test
