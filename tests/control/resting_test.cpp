// A loop that rests: stiction and an encoder, loads that come slowly, lost samples, limits of u.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_resting_test {

using namespace esokit;

constexpr double T = 1e-3;
constexpr double count = 2 * 3.14159265358979 / 4096;

template <class S = double>
using Axis = Resting<Adrc<LinearEso<2, S>>>;

template <class S = double>
typename Axis<S>::Config config(double error = 1.5 * count, double time = 0.25) {
  return {.controller = {.observer = {.observer_bandwidth = S(150),
                                      .input_gain = S(50),
                                      .sample_time = S(T)},
                         .controller_bandwidth = S(20),
                         .limits = {.lower = S(-12), .upper = S(12)}},
          .rest = {.error = static_cast<S>(error), .time = static_cast<S>(time)}};
}

/// An axis with stiction and Coulomb friction, y by an encoder.
struct Joint {
  double stick = 60, coulomb = 20, load = 0, x = 0, v = 0;
  double b0 = 50, dead = 0;
  void step(double u) {
    constexpr int parts = 20;
    constexpr double h = T / parts;
    const double acts = std::abs(u) < dead ? 0 : u - std::copysign(dead, u);
    for (int i = 0; i < parts; ++i) {
      const double f = b0 * acts + load;
      if (!(std::abs(v) > 0) && std::abs(f) <= stick) continue;
      const double sign = std::copysign(1.0, std::abs(v) > 0 ? v : f);
      const double next = v + h * (f - coulomb * sign - 3 * v);
      v = v * next < 0 ? 0 : next;
      x += h * v;
    }
  }
  [[nodiscard]] double measured() const { return count * std::round(x / count); }
};

struct Course {
  double way = 0, largest = 0;
  int changes = 0, rests = 0;
};
template <class C>
Course run(C& controller, Joint& joint, int samples, double r = 0.9995, double ramp = 0) {
  using S = typename C::scalar_type;
  Course course;
  double last = 0;
  for (int k = 0; k < samples; ++k) {
    const double before = joint.x;
    joint.load += ramp * T;
    const double u = double(controller.update(static_cast<S>(joint.measured()), static_cast<S>(r)));
    joint.step(u);
    course.way += std::abs(joint.x - before);
    course.changes += std::abs(u - last) > 0 ? 1 : 0;
    course.rests += controller.mode() == LoopMode::rest ? 1 : 0;
    course.largest = std::max(course.largest, std::abs(joint.x - r));
    last = u;
  }
  return course;
}

template <class S>
void comes_to_rest() {
  auto hunting = Axis<S>::make(config<S>(0, 0)).value();
  auto resting = Axis<S>::make(config<S>()).value();
  Joint a, b;
  run(hunting, a, 10000);
  run(resting, b, 10000);
  const Course hunts = run(hunting, a, 10000), rests = run(resting, b, 10000);
  EXPECT_GT(hunts.way, 100 * count);
  EXPECT_EQ(hunts.rests, 0);
  EXPECT_EQ(rests.way, 0);
  EXPECT_EQ(rests.changes, 1);  // from the 0 with which the course begins
  EXPECT_EQ(rests.rests, 10000);
  EXPECT_LE(rests.largest, 2 * count);
}
TEST(Resting, EndsTheLimitCycleOfStiction) {
  comes_to_rest<double>();
  comes_to_rest<float>();
}

/// Of any stiction, and after a ramp of load: a band above the error at which it sticks while it
/// hunts ends that. Below it some go on.
TEST(Resting, ABandOfTheHuntingEndsIt) {
  Random random(70127);
  int hunt = 0;
  constexpr int axes = 12;
  for (int i = 0; i < axes; ++i) {
    const double b0 = i % 2 == 0 ? 50 : -50, coulomb = random.uniform(8, 30);
    const double more = coulomb * random.uniform(0.1, 2);
    const double omega_c = random.uniform(10, 25), omega_o = omega_c * random.uniform(4, 10);
    const Joint begun{
        .stick = coulomb + more, .coulomb = coulomb, .b0 = b0 * random.uniform(0.8, 1.2)};
    const double ramp = random.log_uniform(10, 300) * (random.index(2) == 0 ? 1 : -1);
    const auto hunts = [&](double error) {
      auto settings = config(error, 5 / omega_c);
      settings.controller.observer.observer_bandwidth = omega_o;
      settings.controller.observer.input_gain = b0;
      settings.controller.controller_bandwidth = omega_c;
      auto axis = Axis<>::make(settings).value();
      Joint joint = begun;
      run(axis, joint, 8000);
      run(axis, joint, static_cast<int>(200 / std::abs(ramp) / T), 0.9995, ramp);
      run(axis, joint, 8000);
      return run(axis, joint, 2000).way > 0;
    };
    const double band = 0.5 * count + 1.5 * more / (omega_o * omega_c);
    EXPECT_FALSE(hunts(std::max(1.5 * count, band))) << i;
    hunt += hunts(1.5 * count) ? 1 : 0;
  }
  EXPECT_GT(hunt, axes / 4);
}

/// Without it, it is the controller: to the bit.
TEST(Resting, IsOffByDefault) {
  auto with = Axis<>::make({.controller = config().controller}).value();
  auto plain = Adrc<LinearEso<2>>::make(config().controller).value();
  Random random(1);
  for (int k = 0; k < 300; ++k) {
    const double y = random.index(9) == 0 ? hidden_nan<double>() : 1 + 1e-9 * random.uniform(-1, 1);
    ASSERT_TRUE(same_bits(with.update(y, 1), plain.update(y, 1)));
    ASSERT_EQ(with.mode(), plain.mode());
  }
}

TEST(Resting, BothSidesOfItsBandAndTime) {
  auto settings = config(0.25, 10 * T);
  settings.controller.limits = {};
  auto c = Axis<>::make(settings).value();
  const auto step = [&](double y, double r) {
    const double u = c.update(y, r);
    return std::pair(c.mode() == LoopMode::rest, u);
  };
  // Eleven samples make ten steps: from the eleventh on u is held. The first has another r.
  for (int k = 0; k < 11; ++k) EXPECT_FALSE(step(0.75, 1).first) << k;
  const double held = c.output();
  EXPECT_TRUE(step(0.75, 1).first);
  EXPECT_EQ(step(1.25, 1).second, held);
  EXPECT_EQ(step(0.9, 1).second, held);
  // The edge belongs to it; what is beyond does not.
  EXPECT_FALSE(step(1.2501, 1).first);
  EXPECT_NE(c.output(), held);
  for (int k = 0; k < 10; ++k) EXPECT_FALSE(step(1, 1).first) << k;
  EXPECT_TRUE(step(1, 1).first);
  // Another reference, however little, and one that moves.
  EXPECT_FALSE(step(1, 1 + 1e-12).first);
  for (int k = 0; k < 11; ++k) step(1, 1 + 1e-12);
  EXPECT_EQ(c.mode(), LoopMode::rest);
  c.update(1, {1 + 1e-12, 0.0, 1e-9});
  EXPECT_EQ(c.mode(), LoopMode::running);
  for (int k = 0; k < 100; ++k) c.update(1, {1 + 1e-12, 1e-9});
  EXPECT_EQ(c.mode(), LoopMode::running);
  // A list that does not move is a constant; start and track end it.
  for (int k = 0; k < 12; ++k) c.update(1, {1 + 1e-12, 0.0});
  EXPECT_EQ(c.mode(), LoopMode::rest);
  EXPECT_EQ(c.track(1, 1 + 1e-12, 3), 3);
  EXPECT_EQ(c.mode(), LoopMode::running);
  for (int k = 0; k < 12; ++k) step(1, 1 + 1e-12);
  EXPECT_EQ(c.mode(), LoopMode::rest);
  EXPECT_EQ(c.start(1, 0.5), StepStatus::ok);
  EXPECT_FALSE(step(1, 1 + 1e-12).first);
}

TEST(Resting, RefusesByName) {
  const auto refused = [](const Axis<>::Config& c) { return refusal(Axis<>::make(c)); };
  EXPECT_EQ(refused(config(-1e-9, 0)), "rest.error: must be finite and not negative");
  EXPECT_EQ(refused(config(hidden_nan<double>(), 0)),
            "rest.error: must be finite and not negative");
  EXPECT_EQ(refused(config(1, -1)), "rest.time: must be finite and not negative");
  EXPECT_EQ(refused(config(0, 1)), "rest.error: must be above 0, or rest.time be left out");
  EXPECT_EQ(refused(config(1, 65.534)), "accepted");
  EXPECT_EQ(refused(config(1, 65.536)), "rest.time: must be below 65535 samples");
  auto divided = config();
  divided.controller.measurement_divider = 2;
  EXPECT_EQ(refused(divided), "measurement_divider: must be 1 with rest.error");
  divided.rest = {};
  EXPECT_EQ(refused(divided), "accepted");
}

/// The longest time that is accepted ends: one sample more than 16 bits hold.
TEST(Resting, AtTheLongestTime) {
  auto c = Axis<>::make(config(1, 65.5345)).value();
  for (int k = 0; k < 65535; ++k) c.update(0, 0);
  EXPECT_EQ(c.mode(), LoopMode::running);
  c.update(0, 0);
  EXPECT_EQ(c.mode(), LoopMode::rest);
}

/// A part of a sample counts as part, and a whole one not more than once.
TEST(Resting, RoundsItsTimeUp) {
  for (const auto& [samples, most] : {std::pair(2.5, 3), {3.0, 3}, {3.0005, 3}, {3.01, 4}}) {
    auto c = Axis<>::make(config(1, samples * T)).value();
    for (int k = 0; k < most; ++k) c.update(0, 0);
    EXPECT_EQ(c.mode(), LoopMode::running) << samples;
    c.update(0, 0);
    EXPECT_EQ(c.mode(), LoopMode::rest) << samples;
  }
}

/// What comes too soon is no sample: it neither counts towards rest nor ends it.
TEST(Resting, NoTimeChangesNothing) {
  using C = Resting<Adrc<VariableTime<LinearEso<2>>>>;
  auto c = C::make({.controller = {.observer = {.observer = config().controller.observer},
                                   .controller_bandwidth = 20},
                    .rest = {.error = 0.1, .time = 3 * T}})
               .value();
  const auto soon = [&] {
    ASSERT_TRUE(c.elapsed(0));
    const double u = c.output();
    const LoopMode mode = c.mode();
    for (const double y : {1.0, 70.0, hidden_nan<double>()}) EXPECT_EQ(c.update(y, 1), u);
    EXPECT_EQ(c.update(1, 7), u);
    EXPECT_EQ(c.update_without_measurement(8), u);
    EXPECT_EQ(c.mode(), mode);
  };
  c.start(1, 0.5);
  for (int k = 0; k < 10; ++k) {
    soon();
    ASSERT_TRUE(c.elapsed(T));
    c.update(1, 1);
    EXPECT_EQ(c.mode() == LoopMode::rest, k >= 4) << k;
  }
  soon();
}

/// Lost samples and safe mode are no time in the band; one sample beyond it begins anew.
TEST(Resting, CountsGoodSamplesInARow) {
  auto settings = config(0.25, 4 * T);
  settings.controller.missing = {.most = 2, .input = -1.5};
  auto c = Axis<>::make(settings).value();
  c.start(1, 0.5);
  const auto samples = [&](std::initializer_list<double> ys) {
    for (const double y : ys) {
      c.update(y, 1);
      EXPECT_NE(c.mode(), LoopMode::rest);
    }
  };
  const double lost = hidden_nan<double>();
  samples({1, 1, lost, 1, 1, lost, 1, 1.3, 1, 1, 1, 1, lost, lost, lost});
  ASSERT_EQ(c.mode(), LoopMode::safe);
  samples({1, 1, 1, 1, 1});
  c.update(1, 1);
  EXPECT_EQ(c.mode(), LoopMode::rest);
}

/// Of a retune: what has passed counts for the new time.
TEST(Resting, TakesAnotherTime) {
  auto c = Axis<>::make(config(1, 0.25)).value();
  for (int k = 0; k < 6; ++k) c.update(0, 0);
  ASSERT_TRUE(c.retune(config(1, 8 * T)));
  for (int k = 6; k < 8; ++k) c.update(0, 0);
  EXPECT_EQ(c.mode(), LoopMode::running);
  c.update(0, 0);
  EXPECT_EQ(c.mode(), LoopMode::rest);
}

/// How far an axis gets that was at `speed` when it left the band: by a loop of omega_c = 20 rad/s,
/// from an estimate that lags 3 / omega_o.
double beyond(double speed) { return speed * (1 / (std::exp(1) * 20) + 3.0 / 150); }

/// A load that comes as slowly as you like is answered at the edge of the band, at the latest, and
/// dhat knows it.
TEST(Resting, MasksNoLoad) {
  for (const double ramp : {0.3, 3.0, 30.0, -30.0, 300.0}) {
    for (const bool sticks : {false, true}) {
      SCOPED_TRACE(std::to_string(ramp) + (sticks ? " with stiction" : ""));
      auto resting = Axis<>::make(config()).value();
      auto plain = Axis<>::make(config(0, 0)).value();
      Joint a, b;
      if (!sticks) a.stick = a.coulomb = b.stick = b.coulomb = 0;
      run(resting, a, 10000);
      run(plain, b, 10000);
      EXPECT_TRUE(!sticks || resting.mode() == LoopMode::rest);
      const int samples = std::min(static_cast<int>(300 / std::abs(ramp) / T), 100000);
      const Course with = run(resting, a, samples, 0.9995, ramp);
      const Course without = run(plain, b, samples, 0.9995, ramp);
      // What breaks away is faster by stiction than by friction across the whole band, which is
      // known to half a count at either end. What does not stick was given at most
      // omega_c^2 times the band.
      const double band = 1.5 * count + 0.5 * count;
      const double most = sticks ? band + beyond(std::sqrt(2 * 40 * 2 * band))
                                 : band + count + beyond(2 * 20 * (band + count));
      EXPECT_LT(with.largest, std::max(without.largest + count, most));
      if (!sticks) {
        EXPECT_NEAR(resting.observer().total_disturbance(), a.load - 3 * a.v,
                    0.05 * std::abs(a.load) + 25);
      }
    }
  }
}

/// Held within the band by nothing, an axis drifts to its edge and is answered there.
TEST(Resting, DoesNotDriftAway) {
  for (const double error : {5 * count, 20 * count, 80 * count}) {
    for (const double time : {0.0, 0.05, 0.25, 0.5}) {
      auto c = Axis<>::make(config(error, time)).value();
      Joint joint{.stick = 0, .coulomb = 0, .load = 5};
      run(c, joint, 5000);
      const Course course = run(c, joint, 60000);
      EXPECT_GT(course.rests, 1000);
      EXPECT_LT(course.largest, error + beyond(2 * 20 * error)) << error << ' ' << time;
    }
  }
}

TEST(Resting, ALostSensorEndsInItsInput) {
  auto settings = config(0.25, 0);
  settings.controller.missing = {.most = 5, .input = -1.5};
  auto c = Axis<>::make(settings).value();
  c.start(1, 0.5);
  for (int k = 0; k < 3; ++k) c.update(1, 1);
  ASSERT_EQ(c.mode(), LoopMode::rest);
  const double held = c.output();
  for (int k = 0; k < 5; ++k) {
    EXPECT_EQ(k % 2 == 0 ? c.update(hidden_nan<double>(), 1) : c.update_without_measurement(1),
              held);
    EXPECT_EQ(c.mode(), LoopMode::rest);
  }
  EXPECT_EQ(c.update(hidden_nan<double>(), 1), -1.5);
  EXPECT_EQ(c.mode(), LoopMode::safe);
  c.update(1, 1);
  EXPECT_EQ(c.mode(), LoopMode::running);
  // A reference that is lost is no rest.
  for (int k = 0; k < 3; ++k) c.update(1, 1);
  ASSERT_EQ(c.mode(), LoopMode::rest);
  c.update(1, hidden_nan<double>());
  EXPECT_EQ(c.mode(), LoopMode::running);
}

/// What the actuator held instead drives the observer; u, its limits and a retune go on.
TEST(Resting, KeepsTheOrderOfALoop) {
  auto c = Axis<>::make(config(0.25, 0)).value();
  c.start(1, 0.5);
  for (int k = 0; k < 3; ++k) c.update(1, 1);
  ASSERT_EQ(c.mode(), LoopMode::rest);
  const double held = c.output();
  for (int k = 0; k < 400; ++k) {
    c.applied(held + 0.25);
    EXPECT_EQ(c.update(1, 1), held);
  }
  EXPECT_NEAR(c.observer().total_disturbance(), -50 * (held + 0.25), 1e-3);
  auto again = from_snapshot<Axis<>>(snapshot(c)).value();
  EXPECT_EQ(again.update(1, 1), held);
  EXPECT_EQ(again.mode(), LoopMode::rest);
  // A band that is smaller, then limits that u is outside of, then none.
  ASSERT_TRUE(c.retune(config(0.1, 0)));
  EXPECT_EQ(c.update(0.95, 1), held);
  auto narrow = config(0.1, 0);
  narrow.controller.limits = {.lower = -0.125, .upper = 0.125};
  ASSERT_TRUE(c.retune(narrow));
  EXPECT_EQ(c.update(1, 1), 0.125);
  EXPECT_EQ(c.mode(), LoopMode::rest);
  const double before = c.output();
  EXPECT_FALSE(c.retune(config(-1, 0)));
  EXPECT_EQ(c.update(1, 1), before);
  ASSERT_TRUE(c.retune(config(0, 0)));
  c.update(1, 1);
  EXPECT_EQ(c.mode(), LoopMode::running);
}

/// What the observer rejects is no measurement: a spike before a gate ends no rest, and an absurd
/// y, which is wrapped to anywhere, neither ends nor begins one.
template <class Observer>
void rejects(const typename Observer::Config& observer, const std::vector<double>& spikes) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  auto axis = Resting<Adrc<Observer>>::make(
                  {.controller = {.observer = observer, .controller_bandwidth = 20},
                   .rest = {.error = 0.1, .time = 0.05}})
                  .value();
  for (int k = 0; k < 500; ++k) axis.update(1.01, 1);
  ASSERT_EQ(axis.mode(), LoopMode::rest);
  const double u = axis.output();
  for (const double spike : spikes) {
    EXPECT_EQ(axis.update(spike, 1), u);
    EXPECT_TRUE(
        has(axis.status(), StepStatus::measurement_rejected | StepStatus::outlier_rejected));
    EXPECT_EQ(axis.mode(), LoopMode::rest) << spike;
    EXPECT_EQ(axis.observer().missed(), 1);
    EXPECT_EQ(axis.update(1.01, 1), u);
  }
  // They are no samples in the band either: it still takes 51 of those.
  axis.update(1.01, 2);
  ASSERT_EQ(axis.mode(), LoopMode::running);
  axis.update(1.01, 1);
  for (int k = 0; k < 50; ++k) {
    axis.update(spikes[static_cast<std::size_t>(k) % spikes.size()], 1);
    EXPECT_EQ(axis.mode(), LoopMode::running) << k;
    axis.update(1.01, 1);
    axis.update(1.01, 1);
    if (k == 20) break;
  }
  for (int k = 0; k < 60; ++k) axis.update(1.01, 1);
  EXPECT_EQ(axis.mode(), LoopMode::rest);
}
TEST(Resting, WhatIsRejectedIsNoMeasurement) {
  const LinearEso<2>::Config eso{.observer_bandwidth = 50, .input_gain = 50, .sample_time = T};
  rejects<OutlierGate<LinearEso<2>>>({.observer = eso, .threshold = 0.5}, {3, -40});
  rejects<WrappedOutput<LinearEso<2>>>({.observer = eso, .period = 6}, {1e17, 3e18, -1e300});
  rejects<LinearEso<2>>(eso, {1.7e308});
}

/// What only a guarded observer has: held by something else it does not rest, and begins anew
/// after; another b0 is no end of a rest, and counts from then on.
TEST(Resting, HeldByABrakeAndWithAnotherGain) {
  using Held = Resting<Adrc<Guarded<LinearEso<2>>>>;
  for (const double sign : {1.0, -1.0}) {
    Held::Config settings{};
    settings.controller.observer.observer = config().controller.observer;
    settings.controller.observer.observer.input_gain = sign * 50;
    settings.controller.controller_bandwidth = 20;
    settings.rest = {.error = 0.25, .time = 2 * T};
    auto c = Held::make(settings).value();
    const auto rests_after = [&](int samples) {
      for (int k = 0; k < samples; ++k) {
        EXPECT_EQ(c.mode(), LoopMode::running) << k;
        c.update(1, 1);
      }
      EXPECT_EQ(c.mode(), LoopMode::rest);
    };
    c.start(1, 0.5);
    rests_after(4);  // the first has another reference than the start
    const double held = c.output();
    EXPECT_FALSE(c.set_input_gain(0));
    EXPECT_FALSE(c.set_input_gain(hidden_nan<double>()));
    ASSERT_TRUE(c.set_input_gain(sign * 100));
    EXPECT_EQ(c.mode(), LoopMode::rest);
    for (int k = 0; k < 500; ++k) EXPECT_EQ(c.update(1, 1), held);
    EXPECT_NEAR(c.observer().total_disturbance(), -sign * 100 * held, 1e-3);
    const double d = c.observer().total_disturbance();
    for (int k = 0; k < 20; ++k) {
      EXPECT_EQ(c.hold(1, 1, 2), 2);  // a brake
      EXPECT_EQ(c.mode(), LoopMode::running);
    }
    EXPECT_NEAR(c.observer().total_disturbance(), d, 1e-9 * std::abs(d));
    rests_after(3);
  }
}

/// An angle by the shorter way; any time between samples; lanes.
TEST(Resting, AroundAdaptersAndInLanes) {
  using Turning = Resting<Adrc<WrappedOutput<VariableTime<LinearEso<2>>>>>;
  auto c = Turning::make(
               {.controller = {.observer = {.observer = {.observer = config().controller.observer},
                                            .period = 6},
                               .controller_bandwidth = 20},
                .rest = {.error = 0.1, .time = 0}})
               .value();
  c.start(2.95, 0.5);
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(c.elapsed(k == 1 ? 20 * T : T));
    c.update(2.95, -2.98);
  }
  EXPECT_EQ(c.mode(), LoopMode::rest);
  ASSERT_TRUE(c.elapsed(T));
  c.update(2.85, -2.98);
  EXPECT_EQ(c.mode(), LoopMode::running);

  static_assert(Controller<Axis<>, double>);
  auto packed = Packed<Axis<>, 2>(Axis<>::make(config(0.25, 0)).value());
  for (int k = 0; k < 4; ++k) {
    Pack<double, 2> y;
    y[0] = 1;
    y[1] = k;
    packed.update(y, Pack<double, 2>(1.0));
  }
  EXPECT_EQ(packed[0].mode(), LoopMode::rest);
  EXPECT_EQ(packed[1].mode(), LoopMode::running);
}

// ---- Behind an actuator with a dead zone.

template <class S = double>
using Mapped = Resting<Adrc<MappedInput<LinearEso<2, S>>>>;

/// A dead zone of 3 in the map, whose jump is a slope of five.
template <class S = double>
typename Mapped<S>::Config mapped_config(double b0, double error = 1.5 * count) {
  typename Mapped<S>::Config all{};
  all.controller.observer.observer = config<S>().controller.observer;
  all.controller.observer.observer.input_gain = static_cast<S>(b0);
  all.controller.observer.curve = ActuatorCurve<S>::dead_zone(S(3), S(0.75));
  all.controller.controller_bandwidth = S(20);
  all.controller.limits = {.lower = S(-12), .upper = S(12)};
  all.rest = {.error = static_cast<S>(error), .time = S(error > 0 ? 0.25 : 0)};
  return all;
}

/// With stiction, whatever the dead zone is: at rest within the band, which is known to half a
/// count. Without rest some of them hunt.
template <class S>
void rests_behind_a_dead_zone() {
  Random random(672);
  int hunt = 0;
  for (int i = 0; i < 16; ++i) {
    const double dead = random.uniform(0, 3.6);
    const double b0 = i % 2 == 0 ? 50 : -50;
    SCOPED_TRACE(dead);
    auto resting = Mapped<S>::make(mapped_config<S>(b0)).value();
    auto hunting = Mapped<S>::make(mapped_config<S>(b0, 0)).value();
    Joint a{.stick = 30, .coulomb = 15, .b0 = b0, .dead = dead}, b = a;
    run(resting, a, 10000, 1);
    run(hunting, b, 10000, 1);
    const Course rests = run(resting, a, 10000, 1);
    EXPECT_EQ(rests.way, 0);
    EXPECT_EQ(rests.rests, 10000);
    EXPECT_LE(rests.largest, 2 * count);
    hunt += run(hunting, b, 10000, 1).way > count ? 1 : 0;
  }
  EXPECT_GT(hunt, 0);
}
TEST(Resting, BehindADeadZone) {
  rests_behind_a_dead_zone<double>();
  rests_behind_a_dead_zone<float>();
}

/// A load that comes slowly is answered at the edge of the band here, too.
TEST(Resting, BehindADeadZoneMasksNoLoad) {
  for (const double dead : {2.4, 3.0, 3.6}) {
    for (const double ramp : {3.0, -30.0, 100.0}) {
      SCOPED_TRACE(std::to_string(dead) + ' ' + std::to_string(ramp));
      auto resting = Mapped<>::make(mapped_config(50)).value();
      auto plain = Mapped<>::make(mapped_config(50, 0)).value();
      Joint a{.stick = 30, .coulomb = 15, .dead = dead}, b = a;
      run(resting, a, 10000, 1);
      run(plain, b, 10000, 1);
      EXPECT_EQ(resting.mode(), LoopMode::rest);
      const int samples = std::min(static_cast<int>(300 / std::abs(ramp) / T), 30000);
      const Course with = run(resting, a, samples, 1, ramp);
      const Course without = run(plain, b, samples, 1, ramp);
      // What breaks away is also faster by the force that is missing while u crosses the slope, of
      // which the actuator gives nothing below 0.6, and by what the map lacks.
      const double band = 1.5 * count + 0.5 * count;
      const double force = 15 + 50 * (0.6 + std::abs(dead - 3));
      EXPECT_LT(with.largest,
                std::max(without.largest + count, band + beyond(std::sqrt(2 * force * 2 * band))));
      const double effect = resting.observer().effect_of(resting.output());
      // What the map lacks, what sticks, and what came in the time of the loop.
      EXPECT_NEAR(50 * effect, -a.load, 50 * std::abs(dead - 3) + 30 + 0.1 * std::abs(ramp));
    }
  }
}

/// What is held is u, whatever its effect; a snapshot goes on there, and each lane of a pack rests
/// by itself.
TEST(Resting, BehindADeadZoneInSnapshotsAndLanes) {
  for (const double b0 : {50.0, -50.0}) {
    auto c = Mapped<>::make(mapped_config(b0, 0.25)).value();
    c.start(1, 4);
    for (int k = 0; k < 300; ++k) c.update(1, 1);
    ASSERT_EQ(c.mode(), LoopMode::rest);
    const double held = c.output();
    EXPECT_NEAR(held, 4, 1e-9);
    auto again = from_snapshot<Mapped<>>(snapshot(c)).value();
    EXPECT_EQ(again.update(0.9, 1), held);
    EXPECT_EQ(again.mode(), LoopMode::rest);
    EXPECT_EQ(c.update(0.9, 1), held);
    // The one that was restored and the other are the same, also once they leave.
    for (int k = 0; k < 500; ++k) {
      const double y = k < 100 ? 0.5 : 1;
      ASSERT_EQ(again.update(y, 1), c.update(y, 1)) << k;
      ASSERT_EQ(again.mode(), c.mode()) << k;
    }
    // Another curve while it rests: u stays.
    ASSERT_EQ(c.mode(), LoopMode::rest);
    const double before = c.output();
    auto other = mapped_config(b0, 0.25);
    other.controller.observer.curve = ActuatorCurve<>::dead_zone(2);
    ASSERT_TRUE(c.retune(other));
    EXPECT_EQ(c.update(1, 1), before);

    auto packed = Packed<Mapped<>, 2>(Mapped<>::make(mapped_config(b0, 0.25)).value());
    Mapped<> alone[] = {packed[0], packed[1]};
    Random random(5);
    for (int k = 0; k < 1000; ++k) {
      Pack<double, 2> y;
      y[0] = 1 + random.uniform(-0.01, 0.01);
      y[1] = random.uniform(0, 2);
      const auto u = packed.update(y, Pack<double, 2>(1.0));
      for (int lane = 0; lane < 2; ++lane) ASSERT_EQ(u[lane], alone[lane].update(y[lane], 1)) << k;
    }
    EXPECT_EQ(packed[0].mode(), LoopMode::rest);
    EXPECT_EQ(packed[1].mode(), LoopMode::running);
  }
}

}  // namespace control_resting_test
}  // namespace esokit_test
