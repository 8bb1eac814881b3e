// MappedInput in controllers: with the right curve the loop is that of a plant without one; units;
// a wrong curve; stiction, dead zone and encoder together.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <control/loop_traits.hpp>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/health.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <numbers>
#include <support/friction.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_mapped_input_test {

using namespace esokit;

constexpr double T = 0.0078125;

template <class Observer>
typename Observer::Config observer(double b0 = 2) {
  typename Observer::Config config{};
  auto& chain = chain_config<Observer>(config);
  using S = typename Observer::scalar_type;
  chain.observer_bandwidth = S(30);
  chain.input_gain = static_cast<S>(b0);
  chain.sample_time = static_cast<S>(T);
  chain.max_gap = 20;
  if constexpr (requires { config.delay; }) config.delay = 2;
  if constexpr (requires { config.period; }) config.period = 6;
  return config;
}

/// A controller with the observer in a map, or without one.
template <class C, class Inside>
typename C::Config config_of(double b0, const ActuatorCurve<typename C::scalar_type>& curve) {
  typename C::Config config{};
  if constexpr (requires { config.observer.curve; }) {
    config.observer = {.observer = observer<Inside>(b0), .curve = curve};
  } else {
    config.observer = observer<Inside>(b0);
  }
  if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth = 5;
  return config;
}

template <class C>
auto call(C& c, typename C::scalar_type y, typename C::scalar_type r) {
  if constexpr (requires { c.gains(); }) {
    return c.update(y, r);
  } else {
    return c.update(y, typename C::scalar_type(2.5 * (r - y)));
  }
}

/// The plant with the curve in the mapped loop, without it in the other: the same y, if the effect
/// is what the law asks for.
template <class Mapped, class Plain, class Inside>
void loop_is_that_without_a_curve(double b0,
                                  const ActuatorCurve<typename Plain::scalar_type>& curve) {
  using S = typename Plain::scalar_type;
  auto mapped = Mapped::make(config_of<Mapped, Inside>(b0, curve)).value();
  auto plain = Plain::make(config_of<Plain, Inside>(b0, {})).value();
  const auto map = ActuatorMap<S>::make(curve).value();
  constexpr int n = Inside::order;
  ChainPlant with(n, T, b0, 1.5);
  ChainPlant without(n, T, b0, 1.5);
  Random random(3);
  const double tolerance = sizeof(S) == 4 ? 2e-4 : 1e-11;
  for (int k = 0; k < 1500; ++k) {
    const bool lost = random.index(15) == 0;
    const S noise = static_cast<S>(random.uniform(-0.01, 0.01));
    const S r = k > 700 ? S(-0.5) : S(0.5);
    const auto y_of = [&](const ChainPlant& plant) {
      return lost ? std::numeric_limits<S>::quiet_NaN() : static_cast<S>(plant.output()) + noise;
    };
    const S r_or_zero = requires { plain.gains(); }
    ? r : S(0);
    const S u = mapped.update(y_of(with), r_or_zero);
    const S effect = plain.update(y_of(without), r_or_zero);
    ASSERT_NEAR(map.effect(u), effect, tolerance * 100) << k;
    if constexpr (requires { plain.gains(); }) {
      with.step(static_cast<double>(map.effect(u)));
      without.step(static_cast<double>(effect));
      ASSERT_NEAR(with.output(), without.output(), tolerance) << k;
    }
  }
}

template <class Inside>
void with_all_curves() {
  using S = typename Inside::scalar_type;
  using Curve = ActuatorCurve<S>;
  using Mapped = MappedInput<Inside>;
  for (const double b0 : {2.0, -2.0}) {
    for (const Curve& curve : {Curve::dead_zone(S(0.5), S(0.25)), Curve::two_gains(S(2), S(0.5)),
                               Curve::square(S(4)), Curve{}}) {
      loop_is_that_without_a_curve<Adrc<Mapped>, Adrc<Inside>, Inside>(b0, curve);
      loop_is_that_without_a_curve<Adrc<Mapped, ErrorBased>, Adrc<Inside, ErrorBased>, Inside>(
          b0, curve);
      loop_is_that_without_a_curve<DisturbanceCompensator<Mapped>, DisturbanceCompensator<Inside>,
                                   Inside>(b0, curve);
      if constexpr (observer_traits<Inside>.is_predictable) {
        loop_is_that_without_a_curve<PredictiveAdrc<Mapped>, PredictiveAdrc<Inside>, Inside>(b0,
                                                                                             curve);
      }
    }
  }
}

TEST(MappedInput, LeavesTheLoopOfThePlantBehindTheCurve) {
  with_all_curves<LinearEso<1>>();
  with_all_curves<LinearEso<2, float>>();
  with_all_curves<WrappedOutput<DelayedInput<LinearEso<1>, 3>>>();
  with_all_curves<Guarded<LinearEso<1>>>();
}

/// Without a point it is the controller without a map, bit for bit.
template <template <class> class C>
void is_nothing_without_a_point() {
  auto mapped_config = config_of<C<MappedInput<LinearEso<2>>>, LinearEso<2>>(2, {});
  auto plain_config = config_of<C<LinearEso<2>>, LinearEso<2>>(2, {});
  mapped_config.limits = plain_config.limits = {-3, 2.5, 50};
  mapped_config.missing = plain_config.missing = {.most = 3, .input = 1};
  auto mapped = C<MappedInput<LinearEso<2>>>::make(mapped_config).value();
  auto plain = C<LinearEso<2>>::make(plain_config).value();
  Random random(9);
  int lost = 0;
  for (int k = 0; k < 4000; ++k) {
    if (lost > 0) --lost;
    if (random.index(30) == 0) lost = random.index(8);
    const double y = lost > 0 ? hidden_nan<double>() : random.uniform(-1, 1);
    const double r = random.index(40) == 0 ? hidden_nan<double>() : random.uniform(-1, 1);
    if (random.index(20) == 0) {
      const double u = random.uniform(-3, 2.5);
      mapped.applied(u);
      plain.applied(u);
    }
    if (random.index(200) == 0) {
      EXPECT_EQ(mapped.start(0.5, 0.25), plain.start(0.5, 0.25));
    }
    ASSERT_EQ(mapped.update(y, r), plain.update(y, r)) << k;
    ASSERT_EQ(mapped.output(), plain.output());
    ASSERT_EQ(mapped.status(), plain.status());
  }
}
template <class O>
using OutputAdrc = Adrc<O>;
TEST(MappedInput, IsNothingWithoutAPoint) {
  is_nothing_without_a_point<OutputAdrc>();
  is_nothing_without_a_point<DisturbanceCompensator>();
  is_nothing_without_a_point<PredictiveAdrc>();
}

using Loop = Adrc<MappedInput<LinearEso<1>>>;
using Curve = ActuatorCurve<>;

/// Limits, their rate, and all else that is the actuator's is in the unit of u.
TEST(MappedInput, WhatIsTheActuatorsIsInItsUnit) {
  auto config = config_of<Loop, LinearEso<1>>(2, Curve::dead_zone(2, 0.5));
  config.limits = {-3, 4, 16};
  config.missing = {.most = 2, .input = 1.25};
  config.start_hold = {.time = 3 * T, .input = 0.75};
  auto loop = Loop::make(config).value();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(loop.update(0, 0), 0.75);  // in the dead zone, as it is
  // The rate: 16 per s are 0.125 a sample, whatever the effect.
  double last = 0.75;
  for (int k = 0; k < 40; ++k) {
    const double u = loop.update(0, 5);
    EXPECT_EQ(u, std::min(4.0, last + 0.125)) << k;
    EXPECT_DOUBLE_EQ(loop.observer().applied_input(), last);  // to four digits
    last = u;
  }
  EXPECT_EQ(loop.output(), 4);
  EXPECT_GT(loop.requested(), 4);
  // Lost: the safe u itself, not one with the same effect.
  for (int k = 0; k < 60; ++k) last = loop.update(hidden_nan<double>(), 5);
  EXPECT_EQ(loop.mode(), LoopMode::safe);
  EXPECT_EQ(last, 1.25);
  // A start, by hand, and what is reported.
  EXPECT_EQ(loop.start(1, 3), StepStatus::ok);
  EXPECT_NEAR(loop.observer().total_disturbance(), -2 * 1, 1e-12);  // -b0 times the effect of 3
  EXPECT_NEAR(loop.update(1, 1), 3, 1e-12);
  EXPECT_EQ(loop.track(1, 1, 2.75), 2.75);
  EXPECT_EQ(loop.output(), 2.75);
  EXPECT_DOUBLE_EQ(loop.observer().applied_input(), 2.75);
  EXPECT_EQ(loop.applied(hidden_nan<double>()), StepStatus::input_rejected);
  // From 2.75 on by hand, the rate counts from there.
  EXPECT_EQ(loop.update(1, 9), 2.875);
}

/// A reported u: its effect is what the observer gets.
TEST(MappedInput, TellsTheObserverTheEffectOfWhatWasApplied) {
  auto config = config_of<Loop, LinearEso<1>>(2, Curve::two_gains(2, 0.5));
  auto loop = Loop::make(config).value();
  auto eso = LinearEso<1>::make(observer<LinearEso<1>>()).value();
  Random random(4);
  for (int k = 0; k < 200; ++k) {
    const double held = random.uniform(-2, 2);
    const double y = random.uniform(-1, 1);
    loop.applied(held);
    loop.update(y, 0.5);
    eso.update(y, held > 0 ? 2 * held : 0.5 * held);
    ASSERT_EQ(loop.observer().estimate(), eso.estimate()) << k;
  }
}

/// In the steady state under a load a compensator gives the same u0 back, in the unit of an effect.
TEST(MappedInput, OfACompensatorIsBehindTheSum) {
  using C = DisturbanceCompensator<MappedInput<LinearEso<1>>>;
  auto c = C::make(config_of<C, LinearEso<1>>(2, Curve::dead_zone(2, 0.5))).value();
  ASSERT_EQ(c.start(1, 3.5), StepStatus::ok);
  EXPECT_NEAR(c.compensation(), 1.5, 1e-12);
  EXPECT_NEAR(c.base_output(), 0, 1e-12);
  EXPECT_NEAR(c.update(1, 0.25), 3.75, 1e-12);
}

/// While another curve is taken over, estimate and u are kept.
TEST(MappedInput, TakesAnotherCurveWhileItRuns) {
  auto config = config_of<Loop, LinearEso<1>>(2, Curve::dead_zone(2, 0.5));
  auto loop = Loop::make(config).value();
  for (int k = 0; k < 300; ++k) loop.update(0.3, 0.5);
  const auto estimate = loop.observer().estimate();
  const double u = loop.output();
  config.observer.curve = Curve::dead_zone(1, 0.5);
  ASSERT_TRUE(loop.retune(config).has_value());
  EXPECT_EQ(loop.observer().estimate(), estimate);
  EXPECT_EQ(loop.output(), u);
  EXPECT_EQ(loop.observer().effect_of(3), 2);
  config.observer.curve.effect[2] = -1;
  const auto refused = loop.retune(config);
  EXPECT_EQ(refusal(refused), "curve.effect[2]: must be above the one before, which is");
  EXPECT_EQ(loop.observer().effect_of(3), 2);
  const auto again = from_snapshot<Loop>(snapshot(loop));
  ASSERT_TRUE(again.has_value());
  auto restored = *again;
  for (int k = 0; k < 50; ++k) EXPECT_EQ(restored.update(0.1, 0.5), loop.update(0.1, 0.5));
}

TEST(MappedInput, LanesOfAPackAreControllers) {
  const auto config = [](int lane) {
    auto of = config_of<Loop, LinearEso<1>>(
        lane % 2 == 0 ? 2 : -2, lane < 2 ? Curve::dead_zone(0.5 + lane, 0.25) : Curve::square(3));
    of.limits = {-3, 2.5 + lane, lane == 1 ? 20.0 : 1e300};
    of.missing.most = 3;
    of.soften = lane % 3 == 0;
    return of;
  };
  auto packed = Packed<Loop, 4>::make(config).value();
  std::vector<Loop> plain;
  for (int lane = 0; lane < 4; ++lane) plain.push_back(Loop::make(config(lane)).value());
  Random random(31);
  for (int k = 0; k < 3000; ++k) {
    Pack<double, 4> y;
    Pack<double, 4> r;
    for (int lane = 0; lane < 4; ++lane) {
      y[lane] = random.index(12) == 0 ? hidden_nan<double>() : random.uniform(-1, 1);
      r[lane] = random.uniform(-1, 1);
    }
    const auto u = packed.update(y, r);
    for (int lane = 0; lane < 4; ++lane) {
      ASSERT_EQ(u[lane], plain[static_cast<std::size_t>(lane)].update(y[lane], r[lane])) << k;
    }
  }
}

/// A law that softens is judged by the u of the actuator: with half the effect for each u it does
/// what a law for half the b0 does.
TEST(MappedInput, SoftensByTheUOfTheActuator) {
  auto config = config_of<Loop, LinearEso<1>>(2, Curve::two_gains(0.5, 0.5));
  auto plain_config = config_of<Adrc<LinearEso<1>>, LinearEso<1>>(1, {});
  config.limits = plain_config.limits = {-1, 2};
  config.soften = plain_config.soften = true;
  auto mapped = Loop::make(config).value();
  auto plain = Adrc<LinearEso<1>>::make(plain_config).value();
  Random random(73);
  double least = 1;
  for (int k = 0; k < 4000; ++k) {
    const double size = k % 1000 < 500 ? 1 : 0.1;
    const double y = size * random.uniform(-1, 1);
    ASSERT_EQ(mapped.update(y, 0.2), plain.update(y, 0.2)) << k;
    ASSERT_EQ(mapped.softness(), plain.softness()) << k;
    least = std::min(least, plain.softness());
  }
  EXPECT_LT(least, 0.9);
  EXPECT_GT(plain.softness(), least);
}

/// The monitor measures b0 of the effect.
TEST(MappedInput, HealthIsOfTheEffect) {
  auto loop = Loop::make(config_of<Loop, LinearEso<1>>(2, Curve::square(4))).value();
  auto monitor =
      HealthMonitor<2>::make({.observer_bandwidth = 30, .sample_time = T, .input_range = 4})
          .value();
  const auto map = ActuatorMap<>::make(Curve::square(4)).value();
  ChainPlant plant(1, T, 2.6, 0);
  for (int k = 0; k < 6000; ++k) {
    plant.step(map.effect(loop.update(plant.output(), std::sin(0.02 * k))));
    monitor.look(loop);
  }
  EXPECT_NEAR(monitor.health().gain_ratio, 1.3, 0.03);
}

TEST(MappedInput, AnalysisIsOfTheLoopFromYToTheEffect) {
  const auto loop = Loop::make(config_of<Loop, LinearEso<1>>(2, Curve::square(4))).value();
  const auto plain =
      Adrc<LinearEso<1>>::make(config_of<Adrc<LinearEso<1>>, LinearEso<1>>(2, {})).value();
  const auto of_map = linear_controller(loop).value();
  const auto without = linear_controller(plain).value();
  ASSERT_EQ(of_map.states(), without.states());
  for (int i = 0; i < without.states(); ++i) {
    EXPECT_EQ(of_map.from_y(i, 0), without.from_y(i, 0));
    EXPECT_EQ(of_map.from_u(i, 0), without.from_u(i, 0));
    EXPECT_EQ(of_map.to_u(0, i), without.to_u(0, i));
  }
}

// ---- What the issue began with: stiction, dead zone and encoder (hunt.cpp).

struct Axis {
  double stiction = 0, coulomb = 0, dead = 0;
  double x = 0, v = 0;

  void run(double u) {
    const double left = std::abs(u) < dead ? 0 : u - std::copysign(dead, u);
    const double f = 50 * left;
    constexpr double step = 1e-3 / 20;
    for (int i = 0; i < 20; ++i) {
      if (v == 0 && std::abs(f) <= stiction) continue;
      const double sign = std::copysign(1.0, v != 0 ? v : f);
      const double next = v + step * (f - coulomb * sign - 3 * v);
      v = v != 0 && next * v < 0 ? 0 : next;
      x += step * v;
    }
  }
};

constexpr double count = 2 * std::numbers::pi / 4096;

/// Largest error in 10 s after 10 s, in counts of the encoder.
template <class C>
double hunts(Axis axis, C loop, int samples = 20000) {
  double worst = 0;
  for (int k = 0; k < samples; ++k) {
    axis.run(loop.update(count * std::round(axis.x / count), 1.0));
    if (2 * k > samples) worst = std::max(worst, std::abs(axis.x - 1) / count);
  }
  return worst;
}

using AxisEso = LinearEso<2>;
constexpr AxisEso::Config axis_observer{
    .observer_bandwidth = 150, .input_gain = 50, .sample_time = 1e-3};
auto plain_axis() {
  return Adrc<AxisEso>::make({.observer = axis_observer,
                              .controller_bandwidth = 20,
                              .limits = {.lower = -12, .upper = 12}})
      .value();
}
auto mapped_axis(const Curve& curve) {
  return Adrc<MappedInput<AxisEso>>::make({.observer = {.observer = axis_observer, .curve = curve},
                                           .controller_bandwidth = 20,
                                           .limits = {.lower = -12, .upper = 12}})
      .value();
}

TEST(MappedInput, EndsTheLimitCycleOfADeadZone) {
  const Axis axis{.dead = 3};
  EXPECT_GT(hunts(axis, plain_axis()), 40);
  EXPECT_LT(hunts(axis, mapped_axis(Curve::dead_zone(3))), 1);
  // With stiction none of both rests; the map is no worse than the axis without a dead zone.
  const Axis sticks{.stiction = 30, .coulomb = 15, .dead = 3};
  EXPECT_LT(hunts(sticks, mapped_axis(Curve::dead_zone(3))),
            1.1 * hunts(Axis{.stiction = 30, .coulomb = 15}, plain_axis()));
}

/// The width that is configured is the largest that there may be: of less there remains a chatter
/// of some counts, of more the old cycle, of what is missing.
TEST(MappedInput, BearsADeadZoneThatIsNotAsConfigured) {
  Random random(67);
  double less = 0, more = 0;
  for (int i = 0; i < 100; i += stride) {
    const double share = random.uniform(0, 1.2);
    const double counts = hunts(Axis{.dead = 3 * share}, mapped_axis(Curve::dead_zone(3)));
    (share <= 1 ? less : more) = std::max(share <= 1 ? less : more, counts);
    if (share < 0.8) continue;
    // A map that is wrong by 20 % is better than none.
    EXPECT_LT(counts, hunts(Axis{.dead = 3 * share}, plain_axis())) << share;
  }
  EXPECT_LT(less, 3.5);
  EXPECT_LT(more, 11);
}

/// What is missing of a dead zone is a limit cycle of the observer's integrator: a leak of it ends
/// the large ones.
TEST(MappedInput, WithALeakHuntsByCountsOnly) {
  using Eso = MappedInput<Guarded<AxisEso>>;
  const auto leaking =
      Adrc<Eso>::make({.observer = {.observer = {.observer = axis_observer, .leak_time = 0.3},
                                    .curve = Curve::dead_zone(3)},
                       .controller_bandwidth = 20,
                       .limits = {.lower = -12, .upper = 12}})
          .value();
  Random random(68);
  for (int i = 0; i < 100; i += stride) {
    const Axis axis{.dead = random.uniform(0, 3.6)};
    EXPECT_LT(hunts(axis, leaking), 3.5) << axis.dead;
  }
}

/// With friction that sticks: at rest, and the encoder shows the count of the reference or the next
/// one.
TEST(MappedInput, RestsWithinACountOfTheEncoder) {
  using Rests = Resting<Adrc<MappedInput<AxisEso>>>;
  const auto rests = [](const Curve& curve) {
    return Rests::make({.controller = {.observer = {.observer = axis_observer, .curve = curve},
                                       .controller_bandwidth = 20,
                                       .limits = {.lower = -12, .upper = 12}},
                        .rest = {.error = 1.5 * count, .time = 0.25}})
        .value();
  };
  const auto counts = [](double y) { return std::round(y / count); };
  Random random(69);
  for (int i = 0; i < 100; i += stride) {
    Axis axis{.stiction = 30, .coulomb = 15, .dead = random.uniform(0, 3.6)};
    SCOPED_TRACE(axis.dead);
    auto loop = rests(Curve::dead_zone(3, 0.75));
    double at_rest = 0;
    for (int k = 0; k < 20000; ++k) {
      axis.run(loop.update(count * counts(axis.x), 1.0));
      if (k == 10000) at_rest = axis.x;
    }
    EXPECT_EQ(axis.x, at_rest);
    EXPECT_LE(std::abs(counts(axis.x) - counts(1.0)), 1);
    if (axis.dead < 0.8 * 3) continue;
    // The map is wrong by a fifth at most: never worse than none, at rest or not.
    const Axis again{.stiction = 30, .coulomb = 15, .dead = axis.dead};
    EXPECT_LE(hunts(again, rests(Curve::dead_zone(3, 0.75))), 1.1 * hunts(again, plain_axis()));
  }
}

// ---- Two gains, and curves that are wrong by 20 %.

/// rms of the error of a loop y' = effect + d under steps of r and d, with the real curve.
template <class C>
double error_of(C loop, const ActuatorMap<>& real, double b0, std::uint64_t seed) {
  Random random(seed);
  double y = 0, sum = 0, r = 0, d = 0;
  constexpr int samples = 6000;
  for (int k = 0; k < samples; ++k) {
    if (k % 700 == 0) r = random.uniform(-1, 1);
    if (k % 500 == 0) d = random.uniform(-0.5, 0.5);
    const double u = loop.update(y + random.uniform(-1e-3, 1e-3), r);
    y += T * (b0 * real.effect(u) + d);
    sum += (y - r) * (y - r);
  }
  return std::sqrt(sum / samples);
}
auto mapped_loop(const Curve& curve, double b0 = 1) {
  auto config = config_of<Loop, LinearEso<1>>(b0, curve);
  config.limits = {-20, 20};
  return Loop::make(config).value();
}
auto plain_loop(double b0 = 1) {
  auto config = config_of<Adrc<LinearEso<1>>, LinearEso<1>>(b0, {});
  config.limits = {-20, 20};
  return Adrc<LinearEso<1>>::make(config).value();
}

TEST(MappedInput, OfTwoGainsHasTheErrorOfOne) {
  const auto one = ActuatorMap<>::make({}).value();
  const auto two = ActuatorMap<>::make(Curve::two_gains(1, 0.3)).value();
  for (const double b0 : {1.0, -1.0}) {
    for (std::uint64_t seed = 1; seed < 20; ++seed) {
      const double wanted = error_of(plain_loop(b0), one, b0, seed);
      EXPECT_NEAR(error_of(mapped_loop(Curve::two_gains(1, 0.3), b0), two, b0, seed), wanted,
                  0.1 * wanted);
      // Without the map half of the steps go with a third of the gain.
      EXPECT_GT(error_of(plain_loop(b0), two, b0, seed), 1.05 * wanted);
    }
  }
}

/// Random actuators of every maker, and maps of them whose numbers are wrong by up to 20 %.
TEST(MappedInput, WrongByAFifthIsNotWorseThanNone) {
  Random random(20);
  double worst = 0;
  for (int i = 0; i < 200; i += stride) {
    const auto wrong = [&](double x) { return x * random.uniform(0.8, 1.2); };
    const double width = random.uniform(0.1, 2);
    const double up = random.uniform(1, 1.5), down = random.uniform(0.2, 0.5);
    const double full = random.uniform(2, 6);
    const std::array<std::array<Curve, 2>, 3> kinds{
        {{Curve::dead_zone(width, 0.02), Curve::dead_zone(wrong(width), 0.02)},
         {Curve::two_gains(up, down), Curve::two_gains(wrong(up), wrong(down))},
         {Curve::square(full), Curve::square(wrong(full))}}};
    for (const auto& [real, map] : kinds) {
      const auto actuator = ActuatorMap<>::make(real).value();
      const double none = error_of(plain_loop(), actuator, 1, 100 + static_cast<unsigned>(i));
      const double with = error_of(mapped_loop(map), actuator, 1, 100 + static_cast<unsigned>(i));
      worst = std::max(worst, with / none);
    }
  }
  EXPECT_LT(worst, 1.1);
}

}  // namespace control_mapped_input_test
}  // namespace esokit_test
