// From a model and a wish to designs: the criterion beside a Lyapunov equation, the optimum beside
// an independent solution, refusals, and that what is chosen keeps its margins.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/tune/pid_baselines.hpp>
#include <esokit/tune/tune.hpp>
#include <esokit/tune/tuned_controller.hpp>
#include <limits>
#include <random>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <type_traits>
#include <vector>

namespace tune_tune_test {

using esokit::DynamicMatrix;
using esokit::LinearController;
using esokit::LoopCost;
using esokit::LoopNumbers;
using esokit::Lqg;
using esokit::tune;
using esokit::TunedDesign;
using esokit::TuneFamily;
using esokit::TuneModel;
using esokit::TuneRules;

TuneModel plain(int order, double disturbance = 1.0) {
  TuneModel model;
  model.order = order;
  model.input_gain = {1.0, 0.0};
  model.noise = 1e-3;
  model.disturbance = disturbance;
  model.sample_time = 1e-3;
  model.u_min = -5.0;
  model.u_max = 5.0;
  return model;
}

/// All that a plant may have, b0 negative.
TuneModel full() {
  TuneModel model = plain(2, 40.0);
  model.input_gain = {-3.0, 0.15};
  model.pole = 0.7;
  model.lag = 0.02;
  model.dead_time = 0.0037;
  model.sensor = 0.004;
  return model;
}

/// sd of y, of u + d / b0 and of u by noise: by Lyapunov equations of the loop. A state s of the
/// loop stands at s1 d for a constant d; s - s1 d is stationary while d walks, driven by -s1 times
/// its increments.
LoopNumbers by_lyapunov(const TuneModel& model, const LinearController& controller) {
  const auto loop = closed_loop(model, controller).value();
  auto system = loop.system();
  const int n = system.a.rows();
  auto left = system.a;
  DynamicMatrix<double> stand(n, 1);
  for (int i = 0; i < n; ++i) stand(i, 0) = -system.b(i, 2);
  esokit::detail::solve_in_place(left.view(), stand.view());
  double y1 = 0.0, u1 = 0.0;
  for (int i = 0; i < n; ++i) {
    y1 += system.c(0, i) * stand(i, 0);
    u1 += system.c(1, i) * stand(i, 0);
    system.b(i, 2) = -stand(i, 0);
  }
  // Integral action: a constant load leaves nothing in y, and u at -d / b0.
  EXPECT_NEAR(y1, 0.0, 1e-9);
  EXPECT_NEAR(u1 * model.input_gain.value, -1.0, 1e-7);
  const auto deviations = [&](double noise, double walk) {
    DynamicMatrix<double> input(3, 3);
    input(1, 1) = noise * noise;
    input(2, 2) = walk;
    return esokit::output_covariance(system, input).value();
  };
  const auto all = deviations(model.noise, model.disturbance * model.sample_time);
  LoopNumbers numbers;
  numbers.output = std::sqrt(all(0, 0));
  numbers.control = std::sqrt(all(1, 1));
  numbers.control_noise = std::sqrt(deviations(model.noise, 0.0)(1, 1));
  return numbers;
}

TEST(LoopCostTest, IsTheLyapunovEquation) {
  for (const TuneModel& model : {plain(1), plain(2, 100.0), plain(3), full()}) {
    const LoopCost cost(model, {}, 1.0);
    for (const double w : {5.0, 30.0}) {
      const auto controller = Lqg(model).controller(std::pow(w, -2 * model.order));
      const auto fast = cost(controller);
      ASSERT_TRUE(fast.stable);
      const auto exact = by_lyapunov(model, controller);
      EXPECT_NEAR(fast.output / exact.output, 1.0, 1e-4) << model.order << ' ' << w;
      EXPECT_NEAR(fast.control / exact.control, 1.0, 1e-4);
      EXPECT_NEAR(fast.control_noise / exact.control_noise, 1.0, 1e-4);
    }
  }
}

// Beside the analysis of the same loops, each in turn: the margins are the least over the ends of
// the intervals, the tolerance is where the loop ends to be stable, and a swing adds half the
// square of what it does.
TEST(LoopCostTest, IsTheAnalysis) {
  TuneModel model = full();
  model.latency_half_width = 1e-3;
  model.lag_half_width = 4e-3;
  TuneModel late = model, long_lag = model, short_lag = model;
  late.dead_time += 1e-3;
  long_lag.lag += 4e-3;
  long_lag.dead_time += 1e-3 - 4e-3;
  short_lag.lag -= 4e-3;
  short_lag.dead_time += 1e-3 + 4e-3;
  for (const double w : {5.0, 20.0}) {
    const auto controller = Lqg(model).controller(std::pow(w, -4));
    const auto fast = LoopCost(model, {}, 1.0, 200.0)(controller);
    double modulus = 1e9, delay = 1e9;
    const auto take = [&](const TuneModel& variant, double gain) {
      const auto loop = closed_loop(variant, controller, gain).value();
      modulus = std::min(modulus, margins(loop).value().modulus.value);
      delay = std::min(delay, delay_margin(loop).value().value);
    };
    take(model, 1.0);
    for (double gain = 0.95; gain < 1.051; gain += 0.01) take(late, gain);
    take(long_lag, 1.05);
    take(short_lag, 1.05);
    EXPECT_NEAR(fast.modulus / modulus, 1.0, 1e-3) << w;
    EXPECT_NEAR(fast.delay / delay, 1.0, 1e-3) << w;
    const auto stable = [&](const TuneModel& variant, double gain) {
      return closed_loop(variant, controller, gain).value().stable();
    };
    const double inside = 0.999 * fast.tolerance, outside = 1.001 * fast.tolerance;
    EXPECT_TRUE(stable(model, inside) && stable(model, 1.0 / inside)) << w;
    EXPECT_FALSE(stable(model, outside) && stable(model, 1.0 / outside)) << w;
    for (double factor = 1.0; factor < 6.0; factor *= 1.04) {
      const auto numbers = LoopCost(model, {.gain_factor = factor}, 1.0)(controller);
      EXPECT_EQ(numbers.tolerant, stable(late, 1.05 * factor) && stable(late, 0.95 / factor))
          << w << ' ' << factor;
    }
    const double frequency = 30.0, amplitude = 3.0;
    auto swinging = model;
    swinging.sinusoids = {{frequency, amplitude, 0.0}};
    const auto swung = LoopCost(swinging, {}, 1.0, 200.0)(controller);
    const auto loop = closed_loop(model, controller).value();
    const auto response = frequency_response(loop.system(), frequency).value();
    const auto grown = [](double with, double without) { return with * with - without * without; };
    EXPECT_NEAR(grown(swung.output, fast.output) / (4.5 * std::norm(response(0, 2))), 1.0, 1e-6);
    EXPECT_NEAR(grown(swung.control, fast.control) / (4.5 * std::norm(response(1, 2) - 1.0 / 3.0)),
                1.0, 1e-6);
  }
  LoopNumbers numbers;
  numbers.output = 2.0;
  numbers.control = 3.0;
  EXPECT_EQ(numbers.cost(0.5, -4.0), 76.0);
}

/// Of a number between, its logarithm even.
double drawn(std::mt19937_64& random, double low, double high) {
  return low * std::pow(high / low, std::uniform_real_distribution<double>(0.0, 1.0)(random));
}

/// A problem from slow to so fast that the best controllers alternate.
TuneModel drawn_problem(std::mt19937_64& random, int order) {
  const auto chance = [&](double of) {
    return std::uniform_real_distribution<double>(0.0, 1.0)(random) < of;
  };
  TuneModel model;
  model.order = order;
  const double T = model.sample_time = drawn(random, 1e-4, 0.1);
  const double b = drawn(random, 1e-2, 1e2);
  model.input_gain = {chance(0.5) ? -b : b, chance(0.5) ? 0.3 * b : 0.0};
  if (chance(0.5)) model.dead_time = T * drawn(random, 0.1, 5.0);
  if (chance(0.4)) model.lag = T * drawn(random, 0.3, 20.0);
  if (chance(0.3)) model.sensor = T * drawn(random, 0.3, 5.0);
  if (chance(0.3)) model.pole = drawn(random, 1e-3, 0.1) / T;
  if (chance(0.5)) model.latency_half_width = 0.7 * T;
  const double w = drawn(random, 0.05, 20.0) / model.latency();
  model.noise = drawn(random, 1e-6, 1e-2);
  model.disturbance = model.disturbance_of(w);
  model.u_max = model.noise / b * std::pow(w, order) * drawn(random, 30.0, 1e5);
  model.u_min = -model.u_max;
  return model;
}

/// noise() of the Adrc of a design; 0 if there is none.
template <int Order>
double noise_of_adrc(const TuneModel& model, const TunedDesign& design) {
  double found = 0.0;
  const auto take = [&](const auto& plant) {
    const auto ok = esokit::with_controller<Order>(model, design, [&](const auto& controller) {
      const auto deviations = noise(plant, controller, {.measurement = {model.noise}});
      if (deviations) found = deviations->control[0];
    });
    EXPECT_TRUE(ok);
  };
  const auto seen = [&](const auto& plant) {
    model.sensor > 0.0 ? take(with_sensor(plant, model.sensor).value()) : take(plant);
  };
  std::array<double, static_cast<std::size_t>(Order)> coefficients{};
  coefficients.back() = model.pole;
  const auto chain = esokit::LinearPlant<Order>::chain({.coefficients = coefficients,
                                                        .input_gain = model.input_gain.value,
                                                        .dead_time = model.dead_time})
                         .value();
  model.lag > 0.0 ? seen(with_lag(chain, model.lag).value()) : seen(chain);
  return found;
}

double noise_of_adrc(const TuneModel& model, const TunedDesign& design) {
  return model.order == 1   ? noise_of_adrc<1>(model, design)
         : model.order == 2 ? noise_of_adrc<2>(model, design)
                            : noise_of_adrc<3>(model, design);
}

// The figures are those of the code that is pasted, wherever the poles of the loop are: drawn
// designs of every family, many of which ring at half the sample rate.
TEST(LoopCostTest, HidesNoPole) {
  std::mt19937_64 random(61);
  int compared = 0, alternating = 0, ringing = 0;
  for (int i = 0; i < 300; i += esokit_test::stride) {
    const int order = 1 + i % 3;
    const TuneModel model = drawn_problem(random, order);
    const double w = drawn(random, 0.02, 2.5) / model.sample_time;
    const LoopCost cost(model, {}, 0.01 * w, 50.0);
    for (const TuneFamily family :
         {TuneFamily::linear, TuneFamily::half_gain, TuneFamily::cascade, TuneFamily::free_poles}) {
      for (const double slower : {1.3, 2.0, 4.0, 16.0}) {
        TunedDesign design;
        design.family = family;
        design.levels = family == TuneFamily::cascade ? 2 : 1;
        auto& s = design.settings;
        s.observer_bandwidth = w;
        s.bandwidth_factor = 2.0;
        for (int j = 0; j <= order; j += 2) {
          const auto pair = esokit::detail::pole_pair(w, drawn(random, 0.05, 2.0));
          if (j == order) {
            s.observer_poles.emplace_back(-w);
          } else {
            s.observer_poles.insert(s.observer_poles.end(), pair.begin(), pair.end());
          }
        }
        s.gains = esokit::detail::polynomial(
            std::vector<std::complex<double>>(static_cast<std::size_t>(order), -w / slower));
        const auto kind = esokit::detail::chain_kind(model, family, 1, design.levels);
        const auto controller = esokit::detail::tuned_controller(kind, model.sample_time, s);
        ASSERT_TRUE(controller);
        const auto loop = closed_loop(model, *controller);
        if (!loop || loop->stability_abscissa() > -1e-4) continue;
        const double exact = noise_of_adrc(model, design);
        ASSERT_GT(exact, 0.0);
        auto numbers = cost(*controller);
        const double damping = esokit::pole_damping(*loop);
        double least = 2.0;
        for (const auto& pole : loop->poles()) least = std::min(least, 2.0 + pole.real());
        ++compared;
        alternating += least < 0.2 ? 1 : 0;
        ringing += damping < 0.1 ? 1 : 0;
        // A pole near z = -1 alone does not hide, whatever its damping.
        if (damping > 0.1 || least < 0.02) {
          EXPECT_NEAR(numbers.control_noise / exact, 1.0, 2e-3) << i << ' ' << damping;
        }
        esokit::exact_deviations(model, *loop, numbers);
        EXPECT_NEAR(numbers.control_noise / exact, 1.0, 1e-6) << i << ' ' << damping;
        if (damping < 0.1 || i % 10 > 0) continue;
        // Far from the limits of the equation, as an independent solution.
        const auto all = cost(*controller);
        EXPECT_NEAR(numbers.output / all.output, 1.0, 2e-3) << i;
        EXPECT_NEAR(numbers.control / all.control, 1.0, 2e-3) << i;
      }
    }
  }
  std::printf("%d loops, %d alternate, %d ring\n", compared, alternating, ringing);
  EXPECT_GT(compared, 150);
  EXPECT_GT(alternating, 5);
  EXPECT_GT(ringing, 10);
}

// Searched for, that is where an optimiser would hide: two problems whose best design rang at half
// the sample rate with a third of its noise stated, and drawn ones.
TEST(TuneTest, FiguresAreThoseOfTheController) {
  std::vector<TuneModel> models(2);
  models[0].sample_time = 0.0253301;
  models[0].input_gain = {0.0131391, 0.00215434};
  models[0].dead_time = 0.10132;
  models[0].sensor = 0.0757289;
  models[0].noise = 3.80626e-10;
  models[0].disturbance = 3.0409e-11;
  models[0].u_max = 0.193579;
  models[1].sample_time = 0.0104518871;
  models[1].input_gain = {0.0155766139, 0.00421149386};
  models[1].dead_time = 0.00805568156;
  models[1].sensor = 0.0410190913;
  models[1].noise = 1.25141583e-10;
  models[1].disturbance = 3.7409485e-07;
  models[1].u_max = 0.455692249;
  for (TuneModel& model : models) {
    model.order = 2;
    model.u_min = -model.u_max;
  }
  std::mt19937_64 random(4);
  for (int i = 0; i < 8; i += esokit_test::stride)
    models.push_back(drawn_problem(random, 1 + i % 2));
  int compared = 0, limited = 0;
  for (const TuneModel& given : models) {
    const auto tuning = tune(given, {}, {.simulate = esokit::TuneSimulation::none});
    if (!tuning) continue;
    for (const TunedDesign& design : tuning->designs) {
      if (design.constraint == "stability") continue;
      limited += design.constraint == "damping of the poles" ? 1 : 0;
      const auto loop = closed_loop(tuning->model, design.controller).value();
      if (design.feasible) {
        EXPECT_GE(design.pole_damping, 0.999 * 0.1) << design.name;
        for (const auto& pole : loop.poles()) EXPECT_GT(pole.real(), -1.732) << design.name;
      }
      EXPECT_EQ(design.pole_damping, esokit::pole_damping(loop)) << design.name;
      // Every gain and latency of the intervals.
      const double share = given.input_gain.half_width / std::abs(given.input_gain.value);
      for (int i = 0; design.feasible && i < 4; ++i) {
        TuneModel other = tuning->model;
        other.dead_time =
            std::max(0.0, other.dead_time + (i % 2 == 0 ? -0.6 : 0.4) * other.latency_half_width);
        const auto inside =
            closed_loop(other, design.controller, 1.0 + (i < 2 ? -0.5 : 0.5) * share).value();
        EXPECT_GE(margins(inside).value().modulus.value, 0.98 * design.modulus_margin)
            << design.name;
        EXPECT_GE(delay_margin(inside).value().value, 0.99 * design.delay_margin) << design.name;
      }
      if (design.knows.any() && !design.knows.lag) continue;
      if (design.knows.sensor) continue;
      ++compared;
      EXPECT_NEAR(design.control_noise / noise_of_adrc(tuning->model, design), 1.0, 1e-5)
          << design.name;
    }
  }
  EXPECT_GT(compared, 15);
  EXPECT_GT(limited, 0);
}

// A step that settles after more samples than are followed one by one.
TEST(TuneTest, FollowsASlowStepToItsEnd) {
  for (const double rate : {1e-2, 1e-4, 1e-6}) {
    esokit::DynamicSystem lag{DynamicMatrix<double>(1, 1), DynamicMatrix<double>(1, 1),
                              DynamicMatrix<double>(1, 1), DynamicMatrix<double>(1, 1), 1.0};
    lag.a(0, 0) = -rate;
    lag.b(0, 0) = rate;
    lag.c(0, 0) = 1.0;
    const auto answer = esokit::detail::step_answer(lag, 0, 1.0, 1.0, 12.0 / rate);
    EXPECT_NEAR(answer.settling * -std::log1p(-rate), std::log(50.0),
                rate < 1e-5 ? 1e-2 : 2.0 * rate)
        << rate;
  }
}

// X = A' X A - A' X b (r + b' X b)^-1 b' X A + Q, to the last digits.
TEST(LqgTest, SolvesTheRiccatiEquation) {
  using esokit::detail::product;
  using esokit::detail::transposed;
  DynamicMatrix<double> a(2, 2), b(2, 1), q(2, 2);
  a(0, 0) = a(1, 1) = 1.0;
  a(0, 1) = 0.1;
  b(0, 0) = 0.005;
  b(1, 0) = 0.1;
  q(0, 0) = 1.0;
  const auto x = esokit::detail::solve_riccati(a, b, 0.01, q);
  const auto ax = product(transposed(a), x);
  const auto axa = product(ax, a), axb = product(ax, b);
  const double size = 0.01 + product(product(transposed(b), x), b)(0, 0);
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      EXPECT_NEAR(axa(i, j) - axb(i, 0) * axb(j, 0) / size + q(i, j), x(i, j), 1e-12 * x(0, 0));
    }
  }
}

// scipy.linalg.solve_discrete_are and solve_discrete_lyapunov, R = 1e-6, T = 1 ms.
TEST(LqgTest, IsTheIndependentOptimum) {
  const struct {
    int order;
    double disturbance, bandwidth, cost, control_noise;
  } cases[] = {{1, 1.0, 3.0, 0.000908637576791936, 0.0455658456555288},
               {1, 100.0, 30.0, 0.00031439650133497043, 0.2646710955804776},
               {2, 1.0, 30.0, 8.207318954938578e-07, 0.5146769683643814},
               {2, 100.0, 3.0, 0.041063614176300806, 0.7891887862517623}};
  for (const auto& c : cases) {
    const TuneModel model = plain(c.order, c.disturbance);
    const double rho = std::pow(c.bandwidth, -2 * c.order);
    const auto numbers = LoopCost(model, {}, 0.1 * c.bandwidth, 50.0)(Lqg(model).controller(rho));
    EXPECT_NEAR(numbers.cost(rho, 1.0) / c.cost, 1.0, 1e-5);
    EXPECT_NEAR(numbers.control_noise / c.control_noise, 1.0, 1e-5);
  }
}

TEST(TuneTest, WhatIsChosenKeepsItsMargins) {
  TuneModel model = plain(2);
  model.input_gain = {1.0, 0.1};
  model.lag = 0.01;
  model.dead_time = 0.0025;
  const auto tuning = tune(model).value();
  // 5 % of the range, unless stated.
  EXPECT_NEAR(tuning.lqg.control_noise, 0.5, 1e-3);
  ASSERT_NE(tuning.chosen(), nullptr);
  for (const double gain : {0.9, 1.0, 1.1}) {
    const auto loop = closed_loop(model, tuning.chosen()->controller, gain).value();
    EXPECT_GE(margins(loop).value().modulus.value, 0.499) << gain;
    EXPECT_GE(delay_margin(loop).value().value, 2e-3 * 0.995) << gain;
  }
  for (const double gain : {0.5, 2.0}) {
    EXPECT_TRUE(closed_loop(model, tuning.chosen()->controller, gain).value().stable()) << gain;
  }
  for (const TunedDesign& design : tuning.designs) {
    EXPECT_GE(design.excess, 1.0 - 1e-3) << design.name;
    EXPECT_GE(design.excess, design.free_excess) << design.name;
  }
  EXPECT_LE(tuning.chosen()->cost, 1.01 * tuning.designs[1].cost);
}

TEST(LoopCostTest, SamplesAreTheSumOfTheirAliases) {
  for (int order = 1; order <= 3; ++order) {
    TuneModel model = plain(order);
    model.pole = 3.0;
    model.lag = 0.0017;
    const double T = model.sample_time;
    for (const double w : {20.0, 700.0, 3000.0}) {
      for (const double range : {0.0, 0.1 * T, 0.49 * T}) {
        model.dead_time = 0.7 * T;
        const auto found = esokit::detail::aliases(model, 1.0, w, range);
        ASSERT_GE(found.cells, 1);
        for (int cell = 0; cell <= found.cells; ++cell) {
          TuneModel late = model;
          late.dead_time += (2.0 * cell / found.cells - 1.0) * range;
          const auto sampled = esokit::detail::sampled_plant(esokit::detail::dense_plant(late), T);
          const auto exact = esokit::detail::response(sampled, std::polar(1.0, w * T) - 1.0)(0, 0);
          // Beyond ten times the sample rate is left out what falls by the cube, which at half the
          // sample rate is 2 (1 / 21^3 + 1 / 23^3 + ..) of the base.
          EXPECT_LE(std::abs(found.sums[cell] - exact), 1.3e-3 * std::abs(found.base))
              << order << ' ' << w;
          EXPECT_LE(std::abs(std::abs(exact) - std::abs(found.base)), 1.001 * found.rest);
        }
      }
      EXPECT_EQ(esokit::detail::aliases(model, 1.0, w, 0.5 * T).cells, 0);
    }
  }
}

// A model that a log gave, next to no lag but a latency of six samples known to two: at half the
// sample rate the plant of this dead time has a fifth of the gain that another fraction of a sample
// gives it. The first of the designs once oscillated with the true one.
TEST(TuneTest, MarginsHoldAtEveryLatencyOfTheInterval) {
  TuneModel model = plain(1, 2.28);
  model.input_gain = {61.86, 1.64};
  model.pole = -0.184;
  model.lag = 2e-4;
  model.dead_time = 0.01276;
  model.lag_half_width = 0.00645;
  model.noise = 8.27e-4;
  model.sample_time = 0.002;
  model.u_max = 0.2016;
  model.u_min = -0.2016;
  int looked = 0;
  for (const double half_width :
       {0.00409, 0.0006}) {  // more than a sample, and less than half of one
    model.latency_half_width = half_width;
    const auto tuning = tune(model).value();
    const double late = half_width + 2.0 * model.sample_time;
    for (const TunedDesign& design : tuning.designs) {
      if (!design.feasible ||
          (&design != tuning.chosen() && design.family != TuneFamily::half_gain))
        continue;
      for (double by = -half_width; by < late; by += 0.11 * half_width) {
        for (const double lag : {model.lag, 0.005}) {
          TuneModel plant = model;
          plant.lag = lag;
          plant.dead_time += model.lag - lag + by;
          const auto loop = closed_loop(plant, design.controller).value();
          ASSERT_TRUE(loop.stable()) << design.name << ' ' << by << ' ' << lag;
          if (by > half_width) continue;
          EXPECT_GE(margins(loop).value().modulus.value, 0.499)
              << design.name << ' ' << by << ' ' << lag;
          ++looked;
        }
      }
    }
  }
  EXPECT_GE(looked, 50);
}

const TunedDesign& named(const esokit::Tuning& tuning, const std::string& name) {
  for (const TunedDesign& design : tuning.designs) {
    if (design.name == name) return design;
  }
  ADD_FAILURE() << name;
  return tuning.designs.front();
}

// Two numbers each: a grid of 45 x 45 over all that they may be. And of free gains, the families
// that are in them are no better.
TEST(TuneTest, EachFamilyIsAsGoodAsAGrid) {
  TuneModel model = plain(2);
  model.input_gain = {1.0, 0.05};
  model.dead_time = 0.002;
  const auto tuning = tune(model, {.control_noise = 0.5}).value();
  model = tuning.model;
  const esokit::detail::TuneSearch search{
      model,
      {},
      tuning.rho,
      0.0,
      std::pow(tuning.rho, -0.25),
      std::pow(model.disturbance / (model.noise * model.noise * model.sample_time), 1.0 / 6.0),
      1.0 / (model.dead_time + 1.5e-3),
      0.5,
      nullptr};
  auto brute = search;
  const LoopCost cost(model, {}, search.slowest());
  brute.cost = &cost;
  const double free = named(tuning, "LinearEso, free poles").cost;
  int compared = 0;
  for (const auto& contender : esokit::detail::contenders(model, false)) {
    if (contender.observer_numbers + contender.law_numbers != 2) continue;
    brute.seen.clear();
    const auto value = [&](const std::vector<double>& x) { return brute.value(contender, x, 1e3); };
    const auto best = esokit::detail::grid_search(
        value, {brute.low(contender, 0), brute.low(contender, 1)},
        {brute.high(contender, 0), brute.high(contender, 1)}, {45, 45}, 1);
    const TunedDesign& design = named(tuning, contender.design.name);
    EXPECT_TRUE(design.feasible) << design.name;
    EXPECT_LE(design.cost, 1.02 * std::exp(best[0].value)) << design.name;
    if (design.extension == 1) {
      EXPECT_LE(free, 1.02 * design.cost) << design.name;
    }
    ++compared;
  }
  EXPECT_EQ(compared, 4);
}

// What is searched is what runs: the linear system of each real controller is that of its design,
// and simulated it does what was predicted.
TEST(TuneTest, TheReadyControllerIsTheDesign) {
  TuneModel model = plain(2, 20.0);
  model.input_gain = {-2.0, 0.1};
  model.lag = 0.01;
  model.dead_time = 0.0025;
  model.u_max = 4.0;
  const auto tuning = tune(model).value();
  int seen = 0;
  for (const TunedDesign& design : tuning.designs) {
    const auto loop = closed_loop(model, design.controller).value();
    // A load that one unit of u balances.
    EXPECT_EQ(design.load_peak, esokit::detail::step_answer(loop.system(), 2, 2.0, 0.0, 3000).peak);
    const auto ok = esokit::with_controller<2>(model, design, [&](const auto& controller) {
      auto far = controller;
      EXPECT_EQ(far.update(1e6, 0.0), 4.0);
      EXPECT_EQ(far.update(-1e9, 0.0), -5.0);
      const esokit::Expected<LinearController, esokit::Error<double>> linear =
          linear_controller(controller);
      const auto real = esokit::detail::closed_upon_itself(linear.value());
      ++seen;
      for (const double w : {1.0, 10.0, 100.0, 1000.0}) {
        const std::complex<double> z1 = std::polar(1.0, w * model.sample_time) - 1.0;
        const auto found = esokit::detail::response(real, z1)(0, 0);
        const auto wanted = esokit::detail::response(design.controller, z1)(0, 0);
        EXPECT_LE(std::abs(found - wanted), 1e-7 * std::abs(wanted)) << design.name << ' ' << w;
      }
    });
    EXPECT_TRUE(ok) << design.name;
  }
  EXPECT_EQ(seen, static_cast<int>(tuning.designs.size()));
  const auto wrong =
      esokit::with_controller<1>(model, tuning.designs.front(), [](const auto&) { FAIL(); });
  EXPECT_STREQ(wrong.error().field, "order");
  const auto refused = [&](const auto& change) {
    TunedDesign design = named(tuning, "LinearEso, free poles");
    change(design);
    return esokit_test::refusal(
        esokit::with_controller<2>(model, design, [](const auto&) { FAIL(); }));
  };
  const std::string more = "knows: includes more than the lag: use the code of the design";
  EXPECT_EQ(refused([](TunedDesign& d) { d.knows.sensor = true; }), more);
  EXPECT_EQ(refused([](TunedDesign& d) { d.knows.sinusoid = true; }), more);
  const std::string alien = "design: was not made by tune for a model of this order";
  EXPECT_EQ(refused([](TunedDesign& d) { d = {}; }), alien);
  EXPECT_EQ(refused([](TunedDesign& d) { d.settings.gains.pop_back(); }), alien);
  EXPECT_EQ(refused([](TunedDesign& d) { d.settings.observer_poles.pop_back(); }), alien);
  for (const int number : {0, 4}) {
    EXPECT_EQ(refused([&](TunedDesign& d) { d.levels = number; }), alien);
    EXPECT_EQ(refused([&](TunedDesign& d) { d.extension = number; }), alien);
  }
}

// Feasible is what keeps the margins, and comes first; then what costs less, and of equals what is
// updated faster.
TEST(TuneTest, RanksByCostAmongThoseThatKeepTheirMargins) {
  TuneModel model = plain(2);
  model.dead_time = 0.002;
  const esokit::TuneRules rules{.modulus_margin = 0.75, .delay_samples = 6.0, .gain_factor = 3.0};
  const auto tuning = tune(model, {.controller_bandwidth = 30.0}, rules).value();
  int feasible = 0;
  for (std::size_t i = 0; i < tuning.designs.size(); ++i) {
    const TunedDesign& a = tuning.designs[i];
    feasible += a.feasible ? 1 : 0;
    const auto wrong = [&](double gain) {
      return closed_loop(model, a.controller, gain).value().stable();
    };
    EXPECT_EQ(a.feasible, a.modulus_margin >= 0.999 * 0.75 && a.delay_margin >= 0.999 * 6e-3 &&
                              wrong(3.0) && wrong(1.0 / 3.0))
        << a.name;
    for (std::size_t j = i + 1; j < tuning.designs.size(); ++j) {
      const TunedDesign& b = tuning.designs[j];
      EXPECT_TRUE(a.feasible || !b.feasible) << a.name << b.name;
      if (a.feasible != b.feasible) continue;
      EXPECT_LE(a.cost, 1.01 * b.cost) << a.name << b.name;
      if (b.cost <= a.cost) {
        EXPECT_LE(a.operations, b.operations) << a.name << b.name;
      }
    }
  }
  EXPECT_GT(feasible, 0);
  EXPECT_LT(feasible, static_cast<int>(tuning.designs.size()));
  // 1 - 0.9^k is within 2 % of 1 from k = 38 on, and a load that leaves nothing has its peak at
  // once.
  esokit::DynamicSystem lag;
  lag.a = lag.b = lag.c = lag.d = DynamicMatrix<double>(1, 1);
  lag.a(0, 0) = -0.1;
  lag.b(0, 0) = 0.1;
  lag.c(0, 0) = 1.0;
  lag.sample_time = 0.5;
  EXPECT_EQ(esokit::detail::step_answer(lag, 0, 1.0, 1.0, 100).settling, 19.0);
}

// 99 % are 2.576 standard errors, 95 % are 1.960.
TEST(TuneTest, TakesAModelWithIntervalsOfNinetyNinePercent) {
  esokit::Identified found;
  found.order = 2;
  found.input_gain = {3.0, 0.5};
  found.latency = {0.02, 0.001};
  found.lag = {0.01, 0.002};
  found.log.sample_time = 1e-3;
  const TuneModel model = esokit::tune_model(found, -1.0, 2.0);
  EXPECT_NEAR(model.input_gain.half_width, 0.5 * 2.576 / 1.960, 1e-3);
  EXPECT_NEAR(model.latency_half_width, 0.001 * 2.576 / 1.960, 1e-6);
  EXPECT_NEAR(model.lag_half_width, 0.002 * 2.576 / 1.960, 1e-6);
}

TEST(TuneTest, TakesADisturbanceWithASlopeAsARandomWalkOfTheSameBandwidth) {
  esokit::Identified found;
  found.order = 2;
  found.noise = {0.01, 0.0};
  found.log.sample_time = 1e-3;
  // w = 30 rad/s: q_m = w^(2 (n + m)) N^2 T.
  found.disturbance = std::pow(30.0, 6) * 1e-7;
  EXPECT_EQ(esokit::tune_model(found, -1.0, 1.0).disturbance, found.disturbance);
  found.extension = 2;
  found.disturbance = std::pow(30.0, 8) * 1e-7;
  const TuneModel model = esokit::tune_model(found, -1.0, 1.0);
  EXPECT_NEAR(model.disturbance, std::pow(30.0, 6) * 1e-7, 1e-9 * model.disturbance);
  EXPECT_NEAR(model.filter_bandwidth(), 30.0, 1e-9);
}

/// A servo with little noise.
TuneModel servo() {
  TuneModel model;
  model.order = 2;
  model.input_gain = {80.0, 2.0};
  model.pole = 1.2;
  model.lag = 0.004;
  model.dead_time = 0.002;
  model.latency_half_width = 2e-4;
  model.lag_half_width = 4e-4;
  model.noise = 2e-4;
  model.sample_time = 1e-3;
  model.disturbance = model.disturbance_of(0.2 / model.latency());
  model.u_min = -5.0;
  model.u_max = 5.0;
  return model;
}

// J says nothing of the reference: of two loops with the same J the one with the fast law is taken,
// not the one with the fast observer (which would settle in 0.18 and 0.42 s here).
TEST(TuneTest, TakesTheFastLawWhereItCostsNothing) {
  for (const auto& [lag, filter, settles] : {std::array{0.005, 0.02, 0.03}, {0.02, 0.3, 0.06}}) {
    TuneModel model = plain(1);
    model.lag = lag;
    model.disturbance = model.disturbance_of(filter / model.latency());
    const auto tuning = tune(model).value();
    ASSERT_NE(tuning.chosen(), nullptr);
    EXPECT_LE(tuning.chosen()->excess, 1.01);
    EXPECT_LE(tuning.chosen()->settling_time, settles);
  }
}

/// Whether a design comes back without softening at its limits.
bool back_as_designed(TunedDesign design, const TuneModel& model) {
  design.settings.soften = false;
  esokit::detail::simulate_law(design, model);
  return design.recovers;
}

// Without the rules for the limits the best loop swings between them for ever unless its law is
// softened; with them it comes back, for next to the same J.
TEST(TuneTest, WhatIsChosenComesBackFromTheLimits) {
  TuneModel model = servo();
  model.input_gain = {80.0, 4.5};
  model.pole = 0.0;
  model.lag = 0.0012;
  model.dead_time = 0.0098;
  model.latency_half_width = 7.7e-4;
  model.lag_half_width = 2e-4;
  model.noise = 4.3e-4;
  model.sample_time = 1.8e-3;
  model.disturbance = model.disturbance_of(0.2 / model.latency());
  const esokit::TuneRules old{
      .damping_latencies = 0.0, .bandwidth_ratio = 0.0, .simulate = esokit::TuneSimulation::all};
  const auto before = tune(model, {}, old).value();
  const TunedDesign& fast =
      *std::min_element(before.designs.begin(), before.designs.end(),
                        [](const TunedDesign& a, const TunedDesign& b) { return a.cost < b.cost; });
  EXPECT_TRUE(fast.feasible);
  EXPECT_LT(fast.damping_latencies, 1.0);
  // It needs the softened law, and is lost without.
  EXPECT_FALSE(back_as_designed(fast, before.model));
  const auto tuning = tune(model, {}, {.simulate = esokit::TuneSimulation::all}).value();
  ASSERT_NE(tuning.chosen(), nullptr);
  EXPECT_TRUE(alarms(tuning, *tuning.chosen()).empty());
  const TunedDesign& chosen = *tuning.chosen();
  EXPECT_TRUE(back_as_designed(chosen, tuning.model));
  EXPECT_GE(chosen.damping_latencies, 1.3 * 0.999);
  // sqrt(J) x 1.015; with the slower disturbance of a floor of 0.2 it was x 1.01.
  EXPECT_LE(chosen.cost, 1.03 * fast.cost);
  for (std::size_t i = 0; i < tuning.designs.size(); ++i) {
    const TunedDesign& a = tuning.designs[i];
    if (i > 0) {
      const TunedDesign& b = tuning.designs[i - 1];
      const auto rank = [](const TunedDesign& d) { return !d.feasible ? 0 : !d.recovers ? 1 : 2; };
      EXPECT_GE(rank(b), rank(a)) << a.name;
    }
    EXPECT_EQ(a.simulated, a.feasible) << a.name;
    if (!a.feasible) continue;
    EXPECT_GE(a.damping_latencies, 1.3 * 0.999) << a.name;
    EXPECT_EQ(a.recovers, a.lost.empty()) << a.name;
    const auto variants = esokit::simulated_variants(tuning.model);
    EXPECT_EQ(variants.size(), 5U);
    const auto played = esokit::simulate_overload(
        variants[static_cast<std::size_t>(a.lost_on)].model,
        variants[static_cast<std::size_t>(a.lost_on)].gain, a.controller,
        a.recovers ? esokit::overloads[0] : a.lost_in, a.settling_time, [](auto...) {},
        a.softening_law());
    EXPECT_EQ(played.back, a.recovers) << a.name;
  }
}

// A law whose k_1 / k_0 is a tenth of the latency is stable, keeps its margins, and is lost.
TEST(OverloadTest, TellsALoopThatSwingsForEver) {
  TuneModel model = servo();
  const esokit::TuneRules free{
      .damping_latencies = 0.0, .bandwidth_ratio = 0.0, .simulate = esokit::TuneSimulation::all};
  const auto fast =
      tune(model, {.controller_bandwidth = 2.0 / (0.58 * model.latency())}, free).value();
  const auto slow = tune(model, {.controller_bandwidth = 1.9 / (1.3 * model.latency())}).value();
  const auto lost = [&](const TunedDesign& design) {
    return design.feasible && !back_as_designed(design, fast.model);
  };
  EXPECT_GE(std::count_if(fast.designs.begin(), fast.designs.end(), lost), 5);
  ASSERT_NE(slow.chosen(), nullptr);
  EXPECT_TRUE(back_as_designed(*slow.chosen(), slow.model));
}

// Played until one comes back: the same is chosen as of those that are all played, and of the
// others nothing is said.
TEST(OverloadTest, SimulatesUntilOneRecovers) {
  TuneModel fast = servo();
  for (const double law : {1.9 / (1.3 * fast.latency()), 2.0 / (0.58 * fast.latency())}) {
    const auto made = [&](esokit::TuneSimulation which) {
      const esokit::TuneRules free{
          .damping_latencies = 0.0, .bandwidth_ratio = 0.0, .simulate = which};
      return tune(fast, {.controller_bandwidth = law}, free).value();
    };
    const auto first = made(esokit::TuneSimulation::first), all = made(esokit::TuneSimulation::all);
    ASSERT_EQ(first.chosen() != nullptr, all.chosen() != nullptr);
    if (first.chosen() != nullptr) {
      EXPECT_EQ(first.chosen()->name, all.chosen()->name);
    }
    bool back = false;
    for (const TunedDesign& design : first.designs) {
      const TunedDesign& same = named(all, design.name);
      EXPECT_EQ(design.cost, same.cost) << design.name;
      if (!design.feasible) continue;
      if (design.simulated) {
        EXPECT_EQ(design.recovers, same.recovers) << design.name;
        EXPECT_EQ(design.settings.soften, same.settings.soften) << design.name;
        EXPECT_TRUE(&design == first.chosen() || !design.recovers || design.settings.soften)
            << design.name;
        back = back || design.recovers;
      } else {
        EXPECT_NE(first.chosen(), nullptr) << design.name;
        const auto said = alarms(first, design);
        ASSERT_FALSE(said.empty()) << design.name;
        EXPECT_EQ(std::string(said.front().name), "overload") << design.name;
      }
    }
    EXPECT_EQ(back, first.chosen() != nullptr);
    for (const TunedDesign& design : made(esokit::TuneSimulation::none).designs) {
      EXPECT_FALSE(design.simulated) << design.name;
    }
  }
}

// What is played is what runs: Adrc on the plant of the model, sample by sample.
TEST(OverloadTest, IsTheRealController) {
  TuneModel model = servo();
  model.pole = 0.0;
  const auto tuning = tune(model).value();
  TunedDesign design = named(tuning, "LinearEso, free poles");
  design.settings.soften = false;
  using Rigid = esokit::LinearPlant<2>;
  const auto plant = with_lag(
      Rigid::chain({.coefficients = {0.0, 0.0}, .input_gain = 80.0, .dead_time = 0.002}).value(),
      0.004);
  (void)esokit::with_controller<2>(model, design, [&](const auto& controller) {
    using Controller = std::remove_cvref_t<decltype(controller)>;
    using Eso = esokit::LinearEso<2, double, 1, esokit::PoleSet>;
    if constexpr (std::is_same_v<Controller, esokit::Adrc<Eso>>) {
      const double end = 10.0 * model.latency();
      const double load = 1.5 * 80.0 * 5.0;
      // The same noise as the play has.
      esokit::sim::Gaussian gaussian(1);
      std::vector<double> y, u;
      const auto ran = esokit::sim::run(
          plant.value(), controller,
          {.duration = 0.5,
           .disturbance =
               [&](double t) { return t < 1e-3 * std::ceil(end / 1e-3) - 1e-6 ? load : 0.0; },
           .sensor = [&](double, double exact) { return exact + model.noise * gaussian.next(); }},
          [&](const auto& sample) {
            y.push_back(sample.output);
            u.push_back(sample.input);
          });
      ASSERT_TRUE(ran);
      std::size_t k = 0, limited = 0;
      (void)esokit::simulate_overload(model, 1.0, design.controller, esokit::overloads[0],
                                      design.settling_time,
                                      [&](double, double, double output, double input) {
                                        if (k >= y.size()) return;
                                        EXPECT_NEAR(output, y[k], 1e-6) << k;
                                        EXPECT_NEAR(input, u[k], 1e-4) << k;
                                        limited += std::abs(input) >= 5.0 ? 1U : 0U;
                                        ++k;
                                      });
      EXPECT_GT(k, 200U);
      EXPECT_GT(limited, 50U);
    }
  });
}

// Also where the law is softened: a law of order 3 whose linear form swings for ever.
TEST(OverloadTest, PlaysTheSoftenedLawAsItRuns) {
  TuneModel model = servo();
  model.order = 3;
  model.pole = 0.0;
  model.friction = 0.0;
  const auto tuning = tune(model, {.controller_bandwidth = 0.3 / model.latency()},
                           {.bandwidth_ratio = 0.0, .simulate = esokit::TuneSimulation::all})
                          .value();
  const TunedDesign& design = named(tuning, "LinearEso");
  ASSERT_TRUE(design.feasible);
  ASSERT_TRUE(design.settings.soften);
  ASSERT_FALSE(design.softening_law().gains.empty());
  EXPECT_NE(design.code.find(".soften = true"), std::string::npos);
  const auto plain = esokit::simulate_overload(model, 1.0, design.controller, esokit::overloads[1],
                                               design.settling_time, [](auto...) {});
  EXPECT_FALSE(plain.back);
  using Rigid = esokit::LinearPlant<3>;
  const auto plant = with_lag(
      Rigid::chain({.coefficients = {0.0, 0.0, 0.0}, .input_gain = 80.0, .dead_time = 0.002})
          .value(),
      0.004);
  double softest = 1.0;
  std::size_t k = 0;
  const auto ok = esokit::with_controller<3>(model, design, [&](const auto& controller) {
    using Controller = std::remove_cvref_t<decltype(controller)>;
    using Eso = esokit::LinearEso<3, double, 1, esokit::PoleSet>;
    if constexpr (std::is_same_v<Controller, esokit::Adrc<Eso>>) {
      const double end = 10.0 * model.latency();
      const double load = 1.5 * 80.0 * 5.0;
      esokit::sim::Gaussian gaussian(1);
      std::vector<double> y, u, bounds;
      const auto ran = esokit::sim::run(
          plant.value(), controller,
          {.duration = 0.5,
           .disturbance =
               [&](double t) { return t < 1e-3 * std::ceil(end / 1e-3) - 1e-6 ? load : 0.0; },
           .sensor = [&](double, double exact) { return exact + model.noise * gaussian.next(); }},
          [&](const auto& sample) {
            y.push_back(sample.output);
            u.push_back(sample.input);
          });
      ASSERT_TRUE(ran);
      (void)esokit::simulate_overload(
          model, 1.0, design.controller, esokit::overloads[0], design.settling_time,
          [&](double, double, double output, double input) {
            if (k >= y.size()) return;
            EXPECT_NEAR(output, y[k], 1e-6 * (1.0 + std::abs(y[k]))) << k;
            EXPECT_NEAR(input, u[k], 1e-3) << k;
            ++k;
          },
          design.softening_law());
      auto same = controller;
      for (std::size_t i = 0; i < y.size(); ++i) {
        (void)same.update(y[i], 0.0);
        softest = std::min(softest, same.softness());
      }
    }
  });
  EXPECT_TRUE(ok);
  EXPECT_GT(k, 200U);
  EXPECT_LT(softest, 0.9);
}

// What is lost with the law as designed is softened, and ranks behind what is not.
TEST(TuneTest, SoftensOnlyWhatIsLostWithoutIt) {
  TuneModel model = servo();
  model.order = 3;
  model.pole = 0.0;
  model.friction = 0.0;
  const auto tuning = tune(model, {}, {.simulate = esokit::TuneSimulation::all}).value();
  int plain = 0, soft = 0;
  bool softened = false;
  for (const TunedDesign& design : tuning.designs) {
    if (!design.feasible) continue;
    const auto alone = esokit::simulated_variants(tuning.model);
    bool lost = false;
    for (const auto& variant : alone) {
      for (const auto& event : esokit::overloads) {
        const auto played =
            esokit::simulate_overload(variant.model, variant.gain, design.controller, event,
                                      design.settling_time, [](auto...) {});
        lost = lost || (played.counts && !played.back);
      }
    }
    EXPECT_EQ(design.settings.soften, lost) << design.name;
    EXPECT_EQ(design.softening_law().gains.empty(), !lost) << design.name;
    ++(lost ? soft : plain);
    if (!design.recovers) continue;
    EXPECT_TRUE(lost || !softened) << design.name;
    softened = softened || lost;
  }
  EXPECT_GT(plain, 0);
  EXPECT_GT(soft, 0);
}

// A load that grows moves the machine once it is above the friction: y = load (t - t0)^3 / 6, with
// and without a sensor's lag, for which the states have other units. u is zero.
TEST(OverloadTest, FrictionHoldsUntilTheForceIsLarger) {
  TuneModel model = servo();
  model.order = 3;
  model.pole = 0.0;
  model.noise = 1e-60;
  for (const double sensor : {0.0, 0.003}) {
    model.sensor = sensor;
    esokit::LinearController idle;
    for (auto* matrix : {&idle.y_to_u, &idle.r_to_u}) *matrix = esokit::DynamicMatrix<double>(1, 1);
    const double latency = model.latency();
    const double load = 0.5 * 80.0 * 0.5 * (model.u_max - model.u_min);
    // Half of the final force.
    model.friction = load * 5.0 * latency;
    const double whole = load * std::pow(5.0 * latency, 3) / 6.0;
    double moved = 0.0;
    (void)esokit::simulate_overload(
        model, 1.0, idle, esokit::friction_overloads[0], 1.0,
        [&](double t, double, double y, double u) {
          EXPECT_EQ(u, 0.0);
          if (t > 10.0 * latency) return;
          const double since = std::max(t - 5.0 * latency, 0.0);
          moved = load * std::pow(since, 3) / 6.0;
          // The sensor is late by its lag.
          if (sensor > 0.0 && since < latency) return;
          EXPECT_NEAR(y, load * std::pow(since - sensor, 3) / 6.0, 0.03 * whole) << t;
        });
    EXPECT_GT(moved, 0.9 * whole);
  }
}

// Three integrators behind friction: nothing is recommended, unless there is none. With a pole of
// the actuator there is a law that is slow enough.
TEST(TuneTest, OrderThreeHasToStandFriction) {
  TuneModel model = servo();
  model.order = 3;
  model.pole = 0.0;
  const esokit::TuneRules all{.simulate = esokit::TuneSimulation::all};
  const auto unknown = tune(model, {}, all).value();
  EXPECT_EQ(unknown.chosen(), nullptr);
  EXPECT_TRUE(unknown.designs.front().feasible);
  for (const TunedDesign& design : unknown.designs) {
    if (!design.feasible) continue;
    EXPECT_NE(design.lost.find("friction"), std::string::npos) << design.name;
    EXPECT_EQ(std::string(alarms(unknown, design).front().name), "overload") << design.name;
    EXPECT_TRUE(esokit::oscillates_with_friction(unknown.model, design.controller)) << design.name;
  }
  model.friction = 1e-300;
  EXPECT_TRUE(model.may_rub());
  model.friction = 0.0;
  EXPECT_FALSE(model.may_rub());
  EXPECT_NE(tune(model).value().chosen(), nullptr);
  model.friction.reset();
  model.pole = 0.1 / model.latency();
  const auto first_order = tune(model, {}, all).value();
  int kept = 0;
  for (const TunedDesign& design : first_order.designs) {
    if (!design.feasible) continue;
    EXPECT_GE(design.damping_latencies, 1.3 * 0.999 * 11.0) << design.name;
    if (!design.recovers) continue;
    ++kept;
    EXPECT_FALSE(esokit::oscillates_with_friction(first_order.model, design.controller))
        << design.name;
    for (const auto& variant : esokit::simulated_variants(first_order.model)) {
      for (const auto& event : esokit::overloads_of(variant.model)) {
        const auto played = esokit::simulate_overload(
            variant.model, variant.gain, design.controller, event,
            design.simulated_settling(variant.model), [](auto...) {}, design.softening_law());
        EXPECT_TRUE(played.back || !played.counts) << design.name;
      }
    }
  }
  EXPECT_GT(kept, 0);
}

// Order 2 is softened, and as designed where only that comes back; neither ranks behind.
TEST(TuneTest, SoftensOrderTwo) {
  const auto tuning = tune(servo(), {}, {.simulate = esokit::TuneSimulation::all}).value();
  int soft = 0;
  for (const TunedDesign& design : tuning.designs) {
    if (!design.feasible) continue;
    TunedDesign again = design;
    again.settings.soften = true;
    esokit::detail::simulate_law(again, tuning.model);
    EXPECT_EQ(design.settings.soften, again.recovers) << design.name;
    soft += design.settings.soften ? 1 : 0;
  }
  EXPECT_GT(soft, 0);
  EXPECT_NE(tuning.designs.front().code.find(".soften = true"), std::string::npos);
  std::vector<TunedDesign> two(2, tuning.designs.front());
  two[1].settings.soften = false;
  two[1].name = "dearer";
  two[1].cost *= 1.5;
  esokit::detail::rank(two, 2);
  EXPECT_EQ(two[1].name, "dearer");
  esokit::detail::rank(two, 3);
  EXPECT_EQ(two[0].name, "dearer");
}

// Of the same J first what computes less, then the observer without a covariance, then the margin.
TEST(TuneTest, RanksEqualsByWhatAnUpdateCosts) {
  const auto tuning = tune(servo(), {}).value();
  const auto first_of = [&](const auto& change) {
    std::vector<TunedDesign> two(2, tuning.designs.front());
    two[0].family = two[1].family = TuneFamily::linear;
    two[0].name = "changed";
    change(two[0], two[1]);
    esokit::detail::rank(two, 2);
    return two[0].name == "changed";
  };
  EXPECT_FALSE(first_of([](TunedDesign& a, TunedDesign&) { a.operations += 1; }));
  EXPECT_FALSE(first_of([](TunedDesign& a, TunedDesign&) { a.family = TuneFamily::filter; }));
  // A covariance counts less than one operation, a margin less than either.
  EXPECT_TRUE(first_of([](TunedDesign& a, TunedDesign& b) {
    a.family = TuneFamily::filter;
    b.operations += 1;
  }));
  EXPECT_FALSE(first_of([](TunedDesign& a, TunedDesign& b) {
    a.family = TuneFamily::filter;
    a.modulus_margin = 2.0 * b.modulus_margin;
  }));
  EXPECT_TRUE(
      first_of([](TunedDesign& a, TunedDesign& b) { b.modulus_margin = 0.9 * a.modulus_margin; }));
  EXPECT_FALSE(
      first_of([](TunedDesign& a, TunedDesign& b) { a.modulus_margin = 0.9 * b.modulus_margin; }));
}

// A stated law that breaks the rule is refused, with the nearest that keeps it.
TEST(TuneTest, NamesTheNearestThatKeepsTheRule) {
  const TuneModel model = servo();
  const auto refused = tune(model, {.controller_bandwidth = 2.01 / (1.3 * model.latency())});
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "controller_bandwidth");
  EXPECT_NEAR(refused.error().limit, 2.0 / (1.3 * model.latency()), 1e-9);
  EXPECT_TRUE(tune(model, {.controller_bandwidth = refused.error().limit}));
  const auto hasty = tune(model, {.settling_time = 0.02});
  ASSERT_FALSE(hasty);
  EXPECT_STREQ(hasty.error().field, "settling_time");
  EXPECT_STREQ(
      hasty.error().rule,
      "is so short for this latency that the loop would oscillate between its limits for ever; "
      "must be at least");
  EXPECT_TRUE(tune(model, {.settling_time = 1.001 * hasty.error().limit}));
}

// What is asked is what the first design does, or there is an alarm.
TEST(TuneTest, SettlesInTheTimeAsked) {
  int held = 0;
  for (int order = 1; order <= 2; ++order) {
    TuneModel model = servo();
    model.order = order;
    model.disturbance = model.disturbance_of(0.2 / model.latency());
    for (const double latencies : {40.0, 120.0}) {
      const double wish = latencies * model.latency();
      const auto tuning =
          tune(model, {.settling_time = wish}, {.simulate = esokit::TuneSimulation::none}).value();
      EXPECT_EQ(tuning.settling_time, wish);
      ASSERT_NE(tuning.chosen(), nullptr) << order;
      TunedDesign design = *tuning.chosen();
      const auto late = [&] {
        const auto said = alarms(tuning, design);
        return std::any_of(said.begin(), said.end(), [](const esokit::TuneAlarm& alarm) {
          return std::string(alarm.name) == "settling";
        });
      };
      held += std::abs(design.settling_time / wish - 1.0) < 0.025 ? 1 : 0;
      EXPECT_EQ(late(), design.settling_time > 1.05 * wish) << order << ' ' << latencies;
      design.settling_time = 1.049 * wish;
      EXPECT_FALSE(late());
      design.settling_time = 1.051 * wish;
      EXPECT_TRUE(late());
    }
  }
  EXPECT_GE(held, 3);
}

// A log without disturbance: the floor stands for it, as far as the noise allows; a larger
// disturbance is not touched.
TEST(TuneTest, ReckonsWithAFloorOfTheDisturbance) {
  TuneModel quiet = servo();
  quiet.disturbance = quiet.disturbance_of(0.001 / quiet.latency());
  const esokit::TuneRules plain_rules{.simulate = esokit::TuneSimulation::none};
  const auto raised = tune(quiet, {.controller_bandwidth = 10.0}, plain_rules).value();
  EXPECT_NEAR(raised.model.filter_bandwidth() * quiet.latency(), 0.4, 1e-9);
  EXPECT_EQ(raised.model_disturbance, quiet.disturbance);
  for (int order = 1; order <= 3; ++order) {
    TuneModel other = quiet;
    other.order = order;
    other.disturbance = other.disturbance_of(0.01 / other.latency());
    const auto bandwidth = [&](TuneRules rules) {
      rules.simulate = esokit::TuneSimulation::none;
      return tune(other, {.controller_bandwidth = 10.0}, rules).value().model.filter_bandwidth() *
             other.latency();
    };
    EXPECT_NEAR(bandwidth({}), esokit::usual_filter_floor[static_cast<std::size_t>(order - 1)],
                1e-9);
    if (order > 1) continue;
    EXPECT_NEAR(bandwidth({.filter_floor = 0.05}), 0.05, 1e-9);
    EXPECT_NEAR(bandwidth({.filter_floor = 0.0}), 0.01, 1e-9);
  }
  // The noise that it takes to cancel the disturbance grows by the power 2.5 of the bandwidth.
  const double allowed = 4.0 * raised.least_noise;
  const auto held = tune(quiet, {.control_noise = allowed}, plain_rules).value();
  EXPECT_LT(held.model.filter_bandwidth() * quiet.latency(), 0.399);
  EXPECT_GT(held.model.disturbance, quiet.disturbance);
  TuneModel moved = servo();
  moved.disturbance = moved.disturbance_of(0.45 / moved.latency());
  EXPECT_EQ(tune(moved, {.controller_bandwidth = 10.0}, plain_rules).value().model.disturbance,
            moved.disturbance);
  // The noise that is asked is kept by all that is feasible.
  for (const TunedDesign& design : held.designs) {
    if (design.feasible) {
      EXPECT_LE(design.control_noise, 1.002 * allowed) << design.name;
    }
  }
}

// 5 % unless stated, also where cancelling the disturbance takes more: then it is refused.
TEST(TuneTest, NeverRaisesWhatItMayAsk) {
  TuneModel model = servo();
  model.noise *= 100.0;
  model.disturbance = model.disturbance_of(1.0 / model.latency());
  const auto refused = tune(model);
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "control_noise");
  EXPECT_EQ(refused.error().value, 0.5);
  EXPECT_GT(refused.error().limit, 0.5);
  const auto stated = tune(model, {.control_noise = 1.5 * refused.error().limit},
                           {.simulate = esokit::TuneSimulation::none})
                          .value();
  const auto said = alarms(stated, stated.designs.front());
  EXPECT_TRUE(std::any_of(said.begin(), said.end(), [](const esokit::TuneAlarm& alarm) {
    return std::string(alarm.name) == "noise";
  }));
}

// A design for more noise is not worse in everything: in J of its own problem, noise, modulus
// margin and peak of a load, of models and pairs of wishes that are drawn; but for the 1 % of J
// within which the cheaper update is preferred (seen: worse by 1 to 3 % in all four). More:
// --gtest_filter=*MoreNoise* --gtest_shuffle --gtest_random_seed=1 --gtest_repeat=100
TEST(TuneTest, MoreNoiseIsNeverWorseInEverything) {
  esokit_test::Random random(
      static_cast<std::uint64_t>(testing::UnitTest::GetInstance()->random_seed()));
  const TuneRules rules{.simulate = esokit::TuneSimulation::none};
  int pairs = 0;
  for (int order = 1; order <= 3; ++order) {
    TuneModel model = plain(order);
    model.input_gain = {random.log_uniform(0.1, 10.0), 0.0};
    model.input_gain.half_width = model.input_gain.value * random.uniform(0.0, 0.15);
    model.sample_time = random.log_uniform(0.05, 0.3);
    model.lag = random.uniform(0.1, 0.9);
    model.dead_time = 1.0 - model.lag;
    model.latency_half_width = random.uniform(0.0, 0.1);
    model.noise = random.log_uniform(1e-4, 1e-3);
    model.disturbance = model.disturbance_of(random.log_uniform(0.003, 0.3) / model.latency());
    const double less = random.log_uniform(0.01, 1.0);
    const double more = less * random.log_uniform(1.1, 10.0);
    const auto quiet = tune(model, {.control_noise = less}, rules);
    if (!quiet || quiet->chosen() == nullptr) continue;
    const auto loud = tune(model, {.control_noise = more}, rules);
    ASSERT_TRUE(loud);
    ASSERT_NE(loud->chosen(), nullptr);
    ++pairs;
    const TunedDesign& before = *quiet->chosen();
    const TunedDesign& now = *loud->chosen();
    const double slowest = 1e-3 * loud->model.filter_bandwidth();
    const double j = LoopCost(loud->model, rules, slowest)(before.controller)
                         .cost(loud->rho, model.input_gain.value);
    EXPECT_FALSE(now.cost > 1.01 * j && now.control_noise > 1.005 * before.control_noise &&
                 now.modulus_margin < 0.995 * before.modulus_margin &&
                 now.load_peak > 1.005 * before.load_peak)
        << "order " << order << ", " << less << " and " << more << ": J " << now.cost << " and "
        << j << ", load " << now.load_peak << " and " << before.load_peak;
    // What the smaller wish allows is allowed by the larger one.
    EXPECT_LE(now.cost, 1.03 * j) << "order " << order << ", " << less << " and " << more;
  }
  EXPECT_GT(pairs, 0);
}

/// The rule named is the one that costs: without it J is smaller, without any other it is the same.
TEST(TuneTest, NamesTheRuleThatLimits) {
  TuneModel model = plain(1, 40.0);
  model.lag = 0.01;
  model.dead_time = 0.004;
  const auto linear = [&](const TuneRules& rules) {
    const auto tuning = tune(model, {.control_noise = 5.0}, rules).value();
    for (const TunedDesign& d : tuning.designs) {
      if (d.name == "LinearEso") return d;
    }
    return TunedDesign{};
  };
  const TuneRules loose{.modulus_margin = 0.1,
                        .delay_samples = 0.1,
                        .gain_factor = 1.0,
                        .pole_damping = 0.0,
                        .damping_latencies = 0.0,
                        .bandwidth_ratio = 0.0,
                        .filter_floor = 0.0,
                        .simulate = esokit::TuneSimulation::none};
  const double free = linear(loose).cost;
  const std::pair<const char*, TuneRules> cases[] = {{"modulus margin",
                                                      [&] {
                                                        auto r = loose;
                                                        r.modulus_margin = 0.75;
                                                        return r;
                                                      }()},
                                                     {"delay margin",
                                                      [&] {
                                                        auto r = loose;
                                                        r.delay_samples = 25.0;
                                                        return r;
                                                      }()},
                                                     {"b0 wrong by a factor",
                                                      [&] {
                                                        auto r = loose;
                                                        r.gain_factor = 4.0;
                                                        return r;
                                                      }()},
                                                     {"damping of the poles",
                                                      [&] {
                                                        auto r = loose;
                                                        r.pole_damping = 0.65;
                                                        return r;
                                                      }()},
                                                     {"phase margin", [&] {
                                                        auto r = loose;
                                                        r.phase_margin = 1.2;
                                                        return r;
                                                      }()}};
  for (const auto& [name, rules] : cases) {
    const TunedDesign d = linear(rules);
    ASSERT_TRUE(d.feasible) << name;
    EXPECT_EQ(d.constraint, name);
    EXPECT_GT(d.cost, 1.002 * free) << name;
  }
}

TEST(TuneTest, SimulatedItDoesWhatWasPredicted) {
  TuneModel model = plain(2, 20.0);
  model.input_gain = {2.0, 0.0};
  model.lag = 0.01;
  model.dead_time = 0.0025;
  // No walk comes near the limits.
  model.u_min = -1e3;
  model.u_max = 1e3;
  const auto tuning = tune(model, {.control_noise = 0.5}).value();
  const TunedDesign& design = named(tuning, "LinearEso, free poles");
  using Rigid = esokit::LinearPlant<2>;
  const auto plant = with_lag(
      Rigid::chain({.coefficients = {0.0, 0.0}, .input_gain = 2.0, .dead_time = 0.0025}).value(),
      0.01);
  constexpr int runs = 40, samples = 6000, settled = 1500;
  std::vector<double> output, control;
  esokit::sim::Gaussian gaussian(11);
  (void)esokit::with_controller<2>(model, design, [&](const auto& controller) {
    using Controller = std::remove_cvref_t<decltype(controller)>;
    using Eso = esokit::LinearEso<2, double, 1, esokit::PoleSet>;
    if constexpr (std::is_same_v<Controller, esokit::Adrc<Eso>>) {
      for (int run = 0; run < runs; ++run) {
        std::vector<double> walk(samples + 1, 0.0);
        for (int k = 1; k <= samples; ++k) {
          walk[static_cast<std::size_t>(k)] =
              walk[static_cast<std::size_t>(k - 1)] +
              std::sqrt(model.disturbance * model.sample_time) * gaussian.next();
        }
        const auto at = [&](double t) {
          return walk[static_cast<std::size_t>(std::floor(t / model.sample_time + 1e-6))];
        };
        double y = 0.0, u = 0.0;
        const auto end = esokit::sim::run(plant.value(), controller,
                                          {.duration = samples * model.sample_time,
                                           .disturbance = at,
                                           .noise = model.noise,
                                           .seed = static_cast<std::uint64_t>(run + 1)},
                                          [&](const auto& sample) {
                                            if (sample.index < settled) return;
                                            const double rest = sample.input + at(sample.t) / 2.0;
                                            y +=
                                                sample.output * sample.output / (samples - settled);
                                            u += rest * rest / (samples - settled);
                                          });
        ASSERT_TRUE(end);
        output.push_back(y);
        control.push_back(u);
      }
    }
  });
  ASSERT_EQ(output.size(), static_cast<std::size_t>(runs));
  const auto agrees = [&](const std::vector<double>& found, double deviation) {
    double mean = 0.0, square = 0.0;
    for (const double value : found) mean += value / runs;
    for (const double value : found) square += (value - mean) * (value - mean) / (runs - 1);
    EXPECT_LE(std::abs(mean - deviation * deviation), 3.0 * std::sqrt(square / runs));
    // And that says something.
    EXPECT_LE(3.0 * std::sqrt(square / runs), 0.15 * mean);
  };
  agrees(output, design.output_deviation);
  agrees(control, design.control_deviation);
}

TEST(TuneTest, RefusesWhatIsNoProblem) {
  const auto refused = [](const auto& change, esokit::TuneSpecification wish = {}) {
    TuneModel model = plain(1);
    change(model);
    const auto tuning = tune(model, wish);
    EXPECT_FALSE(tuning);
    return tuning ? std::string() : std::string(tuning.error().field) + " " + tuning.error().rule;
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  // The largest without an overflow, which the sanitizers see.
  for (const int order : {0, 4, -1, std::numeric_limits<int>::max()}) {
    EXPECT_EQ(refused([&](TuneModel& m) { m.order = order; }), "order must be 1, 2 or 3");
  }
  EXPECT_EQ(refused([](TuneModel& m) { m.noise = 0.0; }), "noise must be finite and positive");
  EXPECT_EQ(refused([](TuneModel& m) { m.disturbance = nan; }),
            "disturbance must be finite and positive");
  for (const double friction : {-1e-300, nan, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(refused([&](TuneModel& m) { m.friction = friction; }),
              "friction must be finite and not negative");
  }
  EXPECT_EQ(refused([](TuneModel& m) { m.input_gain.half_width = 1.0; }),
            "input_gain.half_width must be below b0: the sign of b0 has to be known");
  EXPECT_EQ(refused([](TuneModel& m) { m.u_max = m.u_min; }), "u_max must be above u_min");
  const auto same = [](TuneModel&) {};
  EXPECT_EQ(refused(same, {.control_noise = 1e-3}),
            "control_noise is less than needed to cancel the disturbance alone, which is");
  EXPECT_EQ(refused(same, {.settling_time = 1e-3}),
            "settling_time is shorter than sample time and dead time allow, which is");
  EXPECT_EQ(refused(same, {.settling_time = 1.0, .controller_bandwidth = 4.0}),
            "controller_bandwidth must be left out if control_noise or settling_time is given");
  EXPECT_EQ(refused(same, {.settling_time = 1e9}),
            "settling_time is far slower than the disturbance; must be at most");
  EXPECT_EQ(refused(same, {.controller_bandwidth = 501.0}),
            "controller_bandwidth must not be above half the sample rate, which is");
  EXPECT_EQ(refused(same, {.controller_bandwidth = 0.99e-3}),
            "controller_bandwidth must be at least 1e-6 of the sample rate");
  // Numbers of an LQG controller that no double holds.
  EXPECT_EQ(refused([](TuneModel& m) { m.pole = -9e4; }),
            "optimum cannot be computed: the numbers of this model are too far apart");
  for (const esokit::TuneRules& rules :
       {esokit::TuneRules{.modulus_margin = 1.0}, esokit::TuneRules{.gain_factor = 0.99}}) {
    EXPECT_EQ(esokit_test::refusal(tune(plain(1), {}, rules)),
              rules.gain_factor < 1.0 ? "gain_factor: must be finite and 1 or more"
                                      : "modulus_margin: must be below 1");
  }
  for (const double damping : {-1e-300, nan, 0.7}) {
    EXPECT_EQ(esokit_test::refusal(tune(plain(1), {}, {.pole_damping = damping})),
              damping > 0.0 ? "pole_damping: must be below 0.7"
                            : "pole_damping: must be finite and not negative");
  }
}

// Sizes with which nothing can be computed, each from both sides of its limit.
TEST(TuneModelTest, RefusesWhatIsTooFarApart) {
  const struct {
    double TuneModel::*member;
    double good, bad;
    const char* rule;
  } cases[] = {
      {&TuneModel::noise, 1e-60, 0.9e-60,
       "noise: must be between 1e-60 and 1e60: use another unit"},
      {&TuneModel::disturbance, 1e60, 1.1e60,
       "disturbance: must be between 1e-60 and 1e60: use another unit"},
      // (q / (N^2 T))^(1/4) T = 1e-6 of order 1
      {&TuneModel::disturbance, 1.1e-21, 0.9e-21,
       "disturbance: is so small for this noise that an observer would need a million samples"},
      {&TuneModel::lag, 1.001e-12, 0.999e-12, "lag: must be 0, or between 1e-9 and 1e6 samples"},
      {&TuneModel::lag, 1e3, 1.1e3, "lag: must be 0, or between 1e-9 and 1e6 samples"},
      {&TuneModel::sensor, 1e3, 1.1e3, "sensor: must be 0, or between 1e-9 and 1e6 samples"},
      {&TuneModel::pole, 1e5, 1.1e5, "pole: must be at most a hundred times the sample rate"},
      {&TuneModel::pole, -1e5, -1.1e5, "pole: must be at most a hundred times the sample rate"},
      {&TuneModel::dead_time, 0.1, 0.101, "dead_time: must not be above 100 samples"},
      {&TuneModel::latency_half_width, 0.1, 0.101,
       "latency_half_width: must not be above 100 samples"},
      {&TuneModel::sample_time, 1e-12, 0.9e-12, "sample_time: must be between 1e-12 s and 1e12 s"},
      {&TuneModel::u_max, 1e60, 1.1e60, "u_max: is too large: use another unit"},
      {&TuneModel::u_min, -1e60, -1.1e60, "u_min: is too large: use another unit"}};
  for (const auto& c : cases) {
    TuneModel model = plain(1, 1e9);
    model.*c.member = c.good;
    EXPECT_EQ(esokit_test::refusal(model.validate()), "accepted") << c.rule;
    model.*c.member = c.bad;
    EXPECT_EQ(esokit_test::refusal(model.validate()), c.rule);
  }
  const auto swinging = [](const esokit::KnownSinusoid& swing) {
    TuneModel model = plain(1);
    model.sinusoids = {swing};
    return esokit_test::refusal(model.validate());
  };
  EXPECT_EQ(swinging({1e-6, 1e60, 0.0}), "accepted");
  EXPECT_EQ(swinging({0.9e-6, 1.0, 0.0}),
            "sinusoids.frequency[0]: must be at least 1e-9 of the sample rate");
  EXPECT_EQ(swinging({3101.0, 1.0, 0.0}),
            "sinusoids.frequency[0]: must be below half the sample rate");
  EXPECT_EQ(swinging({1.0, 1.1e60, 0.0}), "sinusoids.amplitude[0]: is too large: use another unit");
  TuneModel two = plain(1);
  two.sinusoids.resize(2);
  EXPECT_EQ(esokit_test::refusal(two.validate()), "sinusoids: must be one at most");
  for (const double gain : {1e-20, -1e20, 0.9e-20, -1.1e20}) {
    TuneModel model = plain(1);
    model.input_gain = {gain, 0.0};
    EXPECT_EQ(esokit_test::refusal(model.validate()),
              gain == 1e-20 || gain == -1e20
                  ? "accepted"
                  : "input_gain: must be between 1e-20 and 1e20: use another unit");
  }
}

using esokit::PidKind;
using esokit::PlainPid;
using esokit::PlainPidConfig;
using esokit::TunedPid;

/// A PID of each structure.
std::vector<PlainPidConfig> pids() {
  const PlainPidConfig pi{.proportional = 3.0,
                          .integral = 40.0,
                          .reference_weight = 0.6,
                          .tracking_time = 0.03,
                          .lower = -2.0,
                          .upper = 2.0,
                          .sample_time = 0.01};
  std::vector<PlainPidConfig> all(6, pi);
  for (std::size_t i = 1; i < all.size(); ++i) all[i].derivative = 0.2;
  all[2].derivative_filter = 0.02;
  all[3].filter_frequency = 60.0;
  all[4].filter_frequency = 60.0;
  all[4].filter_damping = 1.7;
  all[5].filter_frequency = 60.0;
  all[5].derivative = 0.0;
  return all;
}

// What is judged is what runs: sample by sample beside the form that is told the applied u, in and
// out of the limits.
TEST(PidBaselineTest, ThePidIsItsLinearForm) {
  for (const PlainPidConfig& config : pids()) {
    const auto form = esokit::detail::pid_form(config);
    auto pid = PlainPid::make(config).value();
    pid.start(0.0, 0.0, 0.0);
    std::vector<double> z(static_cast<std::size_t>(form.states()), 0.0);
    esokit::sim::Gaussian gaussian(3);
    int limited = 0;
    for (int k = 0; k < 300; ++k) {
      const double y = 0.3 * gaussian.next(), r = k < 100 ? 0.0 : 0.4 * gaussian.next();
      double u = form.y_to_u(0, 0) * y + form.r_to_u(0, 0) * r;
      for (int i = 0; i < form.states(); ++i) u += form.to_u(0, i) * z[static_cast<std::size_t>(i)];
      const double applied = std::clamp(u, config.lower, config.upper);
      limited += applied != u ? 1 : 0;
      EXPECT_NEAR(pid.update(y, r), applied, 1e-9) << k;
      auto next = z;
      for (int i = 0; i < form.states(); ++i) {
        double& x = next[static_cast<std::size_t>(i)];
        x += form.from_y(i, 0) * y + form.from_r(i, 0) * r + form.from_u(i, 0) * applied;
        for (int j = 0; j < form.states(); ++j) x += form.a(i, j) * z[static_cast<std::size_t>(j)];
      }
      z = next;
    }
    EXPECT_GT(limited, 10);
    EXPECT_LT(limited, 290);
  }
}

TEST(PidBaselineTest, ThePidStopsItsIntegralOrFollowsTheLimit) {
  PlainPidConfig config = pids()[0];
  const auto left_after = [&](double tracking_time) {
    config.tracking_time = tracking_time;
    auto pid = PlainPid::make(config).value();
    pid.start(0.0, 0.0, 0.0);
    for (int k = 0; k < 500; ++k) EXPECT_LE(pid.update(0.0, 1.0), 2.0);
    int samples = 0;
    while (pid.update(1.1, 1.0) > 0.0 && samples < 1000) ++samples;
    return samples;
  };
  EXPECT_LT(left_after(0.0), 60);
  EXPECT_LT(left_after(0.03), 60);
  EXPECT_EQ(left_after(1e9), 1000);  // winds up
  // Goes on from u.
  auto pid = PlainPid::make(config).value();
  pid.start(0.5, 0.5, 1.25);
  EXPECT_NEAR(pid.update(0.5, 0.5), 1.25, 1e-12);
}

// What is pasted runs on a machine: a bad number keeps u, and changes nothing.
TEST(PidBaselineTest, ThePidKeepsItsOutputAtABadNumber) {
  std::mt19937 random(11);
  for (const PlainPidConfig& config : pids()) {
    auto pid = PlainPid::make(config).value();
    auto twin = pid;
    const double bad[] = {NAN, INFINITY, -INFINITY};
    const auto any_bad = [&] { return bad[random() % 3]; };
    EXPECT_EQ(pid.update(NAN, 0.0), std::clamp(0.0, config.lower, config.upper));
    double u = pid.update(0.1, 0.2);
    EXPECT_EQ(u, twin.update(0.1, 0.2));
    for (int k = 0; k < 400; ++k) {
      const auto what = random() % 6;
      if (what == 0) {
        EXPECT_EQ(pid.update(any_bad(), 0.3), u);
      }
      if (what == 1) {
        EXPECT_EQ(pid.update(0.3, any_bad()), u);
      }
      if (what == 2) {
        EXPECT_EQ(pid.update(0.3, 0.3, any_bad()), u);
      }
      if (what == 3) pid.start(any_bad(), 0.0, 0.0);
      if (what == 4) pid.start(0.0, 0.0, any_bad());
      if (what == 5) {
        EXPECT_EQ(pid.update(-std::numeric_limits<double>::max(), 1e308), u);
      }
      const double y = 1e-3 * static_cast<double>(random() % 1000);
      u = pid.update(y, 0.5);
      EXPECT_EQ(u, twin.update(y, 0.5)) << k << ", " << what;
    }
  }
}

TEST(PidBaselineTest, RefusesWhatIsNoPid) {
  const auto refused = [](auto change) {
    PlainPidConfig config = pids()[3];
    change(config);
    return esokit_test::refusal(PlainPid::make(config));
  };
  EXPECT_EQ(refused([](auto&) {}), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.derivative = NAN; }), "derivative: must be finite");
  EXPECT_EQ(refused([](auto& c) { c.upper = c.lower; }), "upper: must be above lower");
  EXPECT_EQ(refused([](auto& c) { c.tracking_time = 0.5 * c.sample_time; }),
            "tracking_time: must be 0 or at least a sample");
  EXPECT_EQ(refused([](auto& c) { c.tracking_time = c.sample_time; }), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.filter_damping = 0.0; }),
            "filter_damping: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.sample_time = 0.0; }),
            "sample_time: must be finite and positive");
  esokit::Tuning none;
  none.model = plain(1);
  EXPECT_EQ(esokit_test::refusal(given_pid(none, pids()[0])), "tuning.designs: must not be empty");
  EXPECT_TRUE(tune_pids(none).empty());
}

/// A tuning with nothing in it but its problem and one design, for the search of baselines.
esokit::Tuning problem_of(const TuneModel& model, double bandwidth, const TuneRules& rules) {
  esokit::Tuning tuning;
  tuning.model = model;
  tuning.rules = rules;
  tuning.rho = std::pow(bandwidth, -2 * model.order);
  tuning.optimum = 1.0;
  tuning.designs.emplace_back();
  return tuning;
}

const TunedPid& pid_of(const std::vector<TunedPid>& all, PidKind kind) {
  return *std::find_if(all.begin(), all.end(),
                       [kind](const TunedPid& baseline) { return baseline.kind == kind; });
}

const TuneRules no_rules{.modulus_margin = 0.0,
                         .delay_samples = 0.0,
                         .gain_factor = 1.0,
                         .damping_latencies = 0.0,
                         .bandwidth_ratio = 0.0,
                         .filter_floor = 0.0,
                         .simulate = esokit::TuneSimulation::none};

// scipy's simplex method on an own evaluation of J (Lyapunov equations of the loop, no frequency
// grid), from starts of its own; equal to 0.25 %, in a flat valley of the filtered derivative.
TEST(PidBaselineTest, IsTheIndependentOptimum) {
  const struct {
    int order;
    double input_gain, pole, lag, bandwidth;
    std::vector<std::pair<PidKind, double>> costs;
  } cases[] = {{2,
                3.0,
                0.0,
                0.0,
                20.0,
                {{PidKind::derivative, 1.313489458e-06},
                 {PidKind::filtered, 4.663246774e-07},
                 {PidKind::freely_filtered, 4.663202933e-07}}},
               {2,
                -3.0,
                2.0,
                0.015,
                15.0,
                {{PidKind::derivative, 1.135414727e-06},
                 {PidKind::filtered, 3.811867285e-07},
                 {PidKind::freely_filtered, 3.794139223e-07}}},
               {1,
                1.0,
                1.0,
                0.02,
                20.0,
                {{PidKind::pi, 3.029533376e-07},
                 {PidKind::derivative, 3.029506154e-07},
                 {PidKind::filtered, 1.257341639e-07},
                 {PidKind::freely_filtered, 1.25511375e-07}}}};
  for (const auto& c : cases) {
    TuneModel model = plain(c.order);
    model.input_gain = {c.input_gain, 0.0};
    model.pole = c.pole;
    model.lag = c.lag;
    model.disturbance = model.disturbance_of(c.bandwidth);
    model.u_min = -50.0;
    model.u_max = 50.0;
    const auto baselines = tune_pids(problem_of(model, c.bandwidth, no_rules));
    ASSERT_EQ(baselines.size(), 4U);
    for (const auto& [kind, cost] : c.costs) {
      EXPECT_NEAR(pid_of(baselines, kind).design.cost / cost, 1.0, 3e-3)
          << c.order << ' ' << static_cast<int>(kind);
    }
  }
}

// The PID with a filter of second order is the free poles of order 2 where its loop around the
// chain b0 / s^2 is stable, and never worse.
TEST(PidBaselineTest, ThePidIsTheFreePoles) {
  esokit_test::Random random(47);
  int stable = 0;
  for (int i = 0; i < 3; ++i) {
    TuneModel model = plain(2);
    model.input_gain.value = i == 1 ? -2.0 : 5.0;
    model.lag = i == 0 ? 0.0 : random.uniform(1e-3, 8e-3);
    const double w = random.uniform(3.0, 20.0);
    model.disturbance = model.disturbance_of(w);
    const auto tuning = tune(model, {.controller_bandwidth = 0.0}, no_rules).value();
    const auto baselines = tune_pids(tuning);
    const TunedPid& pid = pid_of(baselines, PidKind::freely_filtered);
    const auto free =
        std::find_if(tuning.designs.begin(), tuning.designs.end(), [](const TunedDesign& design) {
          return design.family == TuneFamily::free_poles && !design.knows.any();
        });
    EXPECT_LE(pid.design.cost, 1.0001 * free->cost) << i;
    // The wish binds by the noise in u, where the two searches end apart: equal is what is free.
    const double ratio = std::pow(pid.design.free_excess / free->free_excess, 2);
    EXPECT_LE(ratio, 1.0001) << i;
    TuneModel chain = model;
    chain.lag = 0.0;
    const auto loop = closed_loop(chain, pid.design.controller);
    if (loop.value().stable()) {
      ++stable;
      EXPECT_GE(ratio, 0.999) << i;
    }
    // As a controller, too: the conversion of the design has its poles and zeros.
    const esokit::detail::PidSearch search(tuning);
    const auto x = search.equal_to(free->controller);
    ASSERT_EQ(x.size(), 5U);
    const auto equal = esokit::detail::closed_upon_itself(
        esokit::detail::pid_form(search.settings(PidKind::freely_filtered, x)));
    esokit::detail::FastResponse a(free->controller), b(equal);
    for (const double v : {0.001, 0.01, 0.1, 1.0}) {
      const auto there = std::polar(1.0, v) - 1.0;
      EXPECT_LE(std::abs(a.at(there).gain / b.at(there).gain - 1.0), 1e-6) << v;
    }
  }
  EXPECT_GE(stable, 2);
}

TEST(PidBaselineTest, KeepsTheRulesOfTheFamilies) {
  TuneModel model = servo();
  const auto tuning = tune(model).value();
  const auto baselines = tune_pids(tuning);
  ASSERT_EQ(baselines.size(), 4U);
  const LoopCost cost(tuning.model, tuning.rules, 0.1);
  bool all = true;
  for (const TunedPid& baseline : baselines) {
    const TunedDesign& d = baseline.design;
    EXPECT_EQ(d.numbers, baseline.kind == PidKind::pi                ? 2
                         : baseline.kind == PidKind::freely_filtered ? 5
                                                                     : 4);
    if (!d.feasible) {
      all = false;
      EXPECT_NE(d.constraint, "none") << d.name;
      continue;
    }
    EXPECT_TRUE(all) << d.name << ": behind one that does not keep the rules";
    const auto numbers = cost(esokit::detail::closed_upon_itself(d.controller));
    EXPECT_GE(numbers.modulus, 0.498) << d.name;
    EXPECT_GE(numbers.delay, 0.995 * 2.0 * model.sample_time) << d.name;
    EXPECT_LE(numbers.control_noise, 1.002 * tuning.control_noise) << d.name;
    EXPECT_NEAR(numbers.cost(tuning.rho, model.input_gain.value) / d.cost, 1.0, 2e-3) << d.name;
    EXPECT_TRUE(d.simulated) << d.name;
    EXPECT_NE(d.code.find("PlainPid::make({.proportional = "), std::string::npos);
    // Given as it is, it is the same.
    const auto given = given_pid(tuning, baseline.pid).value();
    EXPECT_EQ(given.design.cost, d.cost) << d.name;
    EXPECT_EQ(given.design.recovers, d.recovers) << d.name;
    const auto same = migration(tuning, baseline, d);
    EXPECT_TRUE(same.gains.empty() && same.losses.empty()) << d.name;
    EXPECT_EQ(same.ties.size(), 8U) << d.name;
  }
  // A PID that is too weak in everything, and one that is not stable.
  PlainPidConfig weak = baselines.front().pid;
  weak.proportional *= 0.25;
  weak.integral *= 0.05;
  weak.derivative *= 0.25;
  const auto change = migration(tuning, given_pid(tuning, weak).value(), *tuning.chosen());
  EXPECT_FALSE(change.gains.empty());
  EXPECT_FALSE(change.losses.empty());  // noise in u
  EXPECT_NE(change.gains.front().find("load"), std::string::npos);
  weak.proportional = -weak.proportional;
  const auto lost = migration(tuning, given_pid(tuning, weak).value(), *tuning.chosen());
  ASSERT_EQ(lost.gains.size(), 1U);
  EXPECT_NE(lost.gains.front().find("not stable"), std::string::npos);
}

}  // namespace tune_tune_test
