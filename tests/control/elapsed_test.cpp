// Any time between two samples: `elapsed(seconds)` of VariableTime and of what it is in.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/friction.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_elapsed_test {

using namespace esokit;

constexpr double T = 1e-3;

template <class S = double>
typename LinearEso<2, S>::Config eso(int max_gap = 100) {
  return {
      .observer_bandwidth = S(100), .input_gain = S(50), .sample_time = S(T), .max_gap = max_gap};
}

template <class S = double>
VariableTime<LinearEso<2, S>> timed(double ratio = 4, int max_gap = 100) {
  return VariableTime<LinearEso<2, S>>::make(
             {.observer = eso<S>(max_gap), .ratio = static_cast<S>(ratio)})
      .value();
}

template <class T>
bool same_object(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

// ---- what an observer says

TEST(Elapsed, IsDividedIntoSteps) {
  struct Case {
    double ratio, samples;
    int steps;
    double length;  // in T
  };
  constexpr double above = 1 + 1e-12;
  for (const Case& c :
       {Case{4, 0, 0, 1}, Case{4, 0.25 / above, 0, 1}, Case{4, 0.25, 1, 0.25}, Case{4, 1, 1, 1},
        Case{4, 4, 1, 4}, Case{4, 4 * above, 5, 0.8}, Case{4, 20, 20, 1},
        Case{4, 20.5, 21, 20.5 / 21},
        // What a small ratio leaves out is two steps.
        Case{1.2, 1.2, 1, 1.2}, Case{1.2, 1.2 * above, 2, 0.6}, Case{1.2, 1.3, 2, 0.65},
        Case{1.2, 1 / 1.2 / above, 0, 1}, Case{1.2, 1 / 1.2, 1, 1 / 1.2},
        // 101 samples are the longest gap of 100 missing ones; after more it restarts.
        Case{4, 101, 101, 1}, Case{4, 101.5, 102, 101.5 / 102}, Case{4, 102, 102, 1},
        Case{4, 102.5, 102, 1}, Case{4, 1e300, 102, 1}}) {
    auto observer = timed(c.ratio);
    const auto steps = observer.elapsed(c.samples * T);
    ASSERT_TRUE(steps.has_value());
    EXPECT_EQ(*steps, c.steps) << c.samples;
    EXPECT_NEAR(observer.step_time(), c.length * T, 1e-14) << c.samples;
    for (int i = 0; i < *steps; ++i) observer.predict(0);
    // 14 / omega_o is 140 samples, so that here the gap decides.
    EXPECT_EQ(observer.restarts(), c.steps == 102) << c.samples;
  }
}

TEST(Elapsed, RefusesWhatIsNoTime) {
  auto observer = timed();
  ASSERT_EQ(observer.elapsed(0.0002).value(), 0);
  const auto before = observer;
  for (const double bad : {-1e-300, -1.0, hidden_nan<double>(), hidden_infinity<double>()}) {
    EXPECT_EQ(refusal(observer.elapsed(bad)), "elapsed: must be finite and not negative") << bad;
    EXPECT_TRUE(same_object(observer, before));
  }
  EXPECT_EQ(observer.elapsed(0.0).value(), 0);
  EXPECT_TRUE(same_object(observer, before));
}

/// Calls that come too soon add up, also where a digit of the sum does not hold one of them.
TEST(Elapsed, KeepsWhatIsTooShort) {
  auto observer = timed();
  for (int i = 1; i <= 4; ++i) {
    EXPECT_EQ(observer.elapsed(T / 16).value(), i == 4 ? 1 : 0) << i;
  }
  EXPECT_NEAR(observer.step_time(), T / 4, 1e-18);
  EXPECT_EQ(observer.elapsed(T / 5).value(), 0);
  EXPECT_EQ(observer.elapsed(T).value(), 1);
  EXPECT_NEAR(observer.step_time(), 1.2 * T, 1e-18);

  auto single = timed<float>();
  ASSERT_EQ(single.elapsed(2.4e-4f).value(), 0);
  constexpr float tiny = 5e-12f;  // a third of a digit
  ASSERT_EQ(2.4e-4f + tiny, 2.4e-4f);
  int calls = 0;
  while (calls < 3000000 && single.elapsed(tiny).value() == 0) ++calls;
  EXPECT_NEAR(calls, 1e-5 / 5e-12, 0.01 * 2e6);
}

// ---- in a loop

/// y'' = 50 u + d with y given at each sample: an axis at constant speed, u near zero, dhat zero.
template <class C>
struct Axis {
  using S = typename C::scalar_type;
  C controller;
  double x = 0, v = 0, t = 0, worst = 0, u = 0;
  void pass(double dt) {
    for (int i = 0; i < 100; ++i) {
      const double h = dt / 100;
      x += h * v + h * h / 2 * 50 * u;
      v += h * 50 * u;
    }
    t += dt;
  }
  void step(double dt) {
    pass(dt);
    if (controller.elapsed(static_cast<S>(dt))) {
      u = controller.update(static_cast<S>(x), {static_cast<S>(5 * t), S(5)});
    }
    if (t > 0.5)
      worst = std::max(worst, std::abs(double(controller.observer().total_disturbance())));
  }
};

template <class S>
typename Adrc<VariableTime<LinearEso<2, S>>>::Config loop(double ratio = 4) {
  return {.observer = {.observer = eso<S>(), .ratio = static_cast<S>(ratio)},
          .controller_bandwidth = S(20)};
}

/// The case of issue 70: the idiom of before lost the pause, and dhat jumped to 86 .. 231.
TEST(Elapsed, LosesNothingInAPause) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  for (const double ratio : {1.05, 1.5, 4.0}) {
    for (const double samples : {0.0, 0.1, 0.3, 1.3, 3.99, 4.01, 20.0, 50.5, 100.0}) {
      Axis<C> axis{C::make(loop<double>(ratio)).value()};
      for (int k = 0; k < 1200; ++k) axis.step(k == 1000 ? samples * T : T);
      EXPECT_LT(axis.worst, 1e-6) << ratio << ' ' << samples;
    }
    // Longer than what is bridged: it restarts, and recovers.
    Axis<C> axis{C::make(loop<double>(ratio)).value()};
    for (int k = 0; k < 1000; ++k) axis.step(T);
    axis.pass(0.11);
    ASSERT_TRUE(axis.controller.elapsed(0.11));
    axis.u = axis.controller.update(axis.x, {5 * axis.t, 5.0});
    EXPECT_TRUE(has(axis.controller.status(), StepStatus::restarted));
    for (int k = 0; k < 1500; ++k) axis.step(T);
    axis.worst = 0;
    axis.step(T);
    EXPECT_LT(axis.worst, 1e-3);
  }
}

TEST(Elapsed, InFloat) {
  using C = Adrc<VariableTime<LinearEso<2, float>>>;
  const auto worst = [](double samples) {
    Axis<C> axis{C::make(loop<float>()).value()};
    for (int k = 0; k < 1200; ++k) axis.step(k == 1000 ? samples * T : T);
    return axis.worst;
  };
  // The digits of y: 3e-7 / T^2 and the square of omega_o T.
  const double usual = worst(1);
  EXPECT_LT(usual, 0.05);
  for (const double samples : {0.0, 0.2, 4.5, 20.0, 100.0}) EXPECT_LT(worst(samples), 3 * usual);
}

/// A timer that jitters from nothing to many samples: y and its estimate stay together.
TEST(Elapsed, AnyTimesInAnyOrder) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  Axis<C> axis{C::make(loop<double>(1.5)).value()};
  Random random(4);
  for (int k = 0; k < 5000; ++k) {
    axis.step(random.index(4) == 0 ? random.log_uniform(1e-6, 0.05) : random.uniform(0, 2 * T));
  }
  EXPECT_LT(axis.worst, 1e-5);
}

TEST(Elapsed, NoTimeChangesNothing) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  auto config = loop<double>();
  config.limits = {.lower = -2, .upper = 2, .rate = 300};
  config.start_hold = {.time = 2 * T, .input = 0.5};
  auto controller = C::make(config).value();
  for (int k = 0; k < 30; ++k) {
    ASSERT_TRUE(controller.elapsed(0.1 * T));
    const auto before = controller;
    const double u = controller.output();
    EXPECT_EQ(controller.update(k, 2 * k), u);
    EXPECT_EQ(controller.update_without_measurement(-k), u);
    EXPECT_EQ(controller.update(hidden_nan<double>(), hidden_nan<double>()), u);
    EXPECT_TRUE(same_object(controller, before)) << k;
    ASSERT_TRUE(controller.elapsed(0.9 * T));
    controller.update(0.1 * k, 1);
  }
  EXPECT_EQ(controller.mode(), LoopMode::running);
  // An operator's u counts at once; the observer waits.
  ASSERT_TRUE(controller.elapsed(0));
  const double d = controller.observer().total_disturbance();
  EXPECT_EQ(controller.track(3, 1, 0.25), 0.25);
  EXPECT_EQ(controller.output(), 0.25);
  EXPECT_EQ(controller.observer().total_disturbance(), d);
  EXPECT_EQ(controller.observer().missed(), 0);
  // A length of the usual kind ends it.
  ASSERT_TRUE(controller.set_step_time(T));
  controller.update(3, 1);
  EXPECT_NE(controller.observer().total_disturbance(), d);
}

/// What was kept, and a pause that is still to be predicted, end with a start.
TEST(Elapsed, AStartIsNow) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  const auto fresh = C::make(loop<double>()).value();
  for (const double before : {0.0, 0.2, 20.0}) {
    auto controller = fresh, other = fresh;
    ASSERT_TRUE(controller.elapsed(before * T));
    ASSERT_EQ(controller.start(1, 0.5), StepStatus::ok);
    ASSERT_EQ(other.start(1, 0.5), StepStatus::ok);
    for (int k = 0; k < 3; ++k) {
      ASSERT_TRUE(controller.elapsed(T));
      EXPECT_EQ(controller.update(1.1, 1), other.update(1.1, 1));
    }
  }
}

/// Nothing that was said is lost or counts twice: two times before an update, a retune in between,
/// a length that replaces what was kept.
TEST(Elapsed, SaidTwiceBothCount) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  auto config = loop<double>();
  config.domain = TimeDomain::sampled;
  config.limits = {.lower = -1e6, .upper = 1e6, .rate = 100};
  auto begun = C::make(config).value();
  for (int k = 0; k < 50; ++k) begun.update(0.01 * k, 1);
  struct Case {
    double first, second;
  };
  for (const Case& c : {Case{0.1, 0.1}, Case{0.2, 1}, Case{1, 0.2}, Case{1, 1}, Case{2, 1.5},
                        Case{2, 3}, Case{20, 0}, Case{20, 0.5}, Case{20, 30}, Case{90, 90}}) {
    for (const bool retunes : {false, true}) {
      auto twice = begun, once = begun;
      ASSERT_TRUE(twice.elapsed(c.first * T));
      EXPECT_FALSE(twice.elapsed(-1));
      if (retunes) {
        ASSERT_TRUE(twice.retune(config));
      }
      ASSERT_TRUE(twice.elapsed(c.second * T));
      if (retunes) {
        ASSERT_TRUE(twice.retune(config));
      }
      ASSERT_TRUE(once.elapsed((c.first + c.second) * T));
      EXPECT_EQ(twice.too_soon(), once.too_soon());
      EXPECT_NEAR(twice.gains()[0], once.gains()[0], 1e-9 * once.gains()[0]);
      const double u = once.update(0.6, 1);
      EXPECT_NEAR(twice.update(0.6, 1), u, 1e-9) << c.first << ' ' << c.second << ' ' << retunes;
      for (int r = 0; r < 3; ++r) {
        const double is = once.observer().estimate()(r);
        EXPECT_NEAR(twice.observer().estimate()(r), is, 1e-9 * (1 + std::abs(is)));
      }
      // Once answered it is over.
      ASSERT_TRUE(twice.elapsed(T));
      ASSERT_TRUE(once.elapsed(T));
      EXPECT_NEAR(twice.observer().step_time(), once.observer().step_time(), 1e-15);
    }
  }
  auto observer = timed();
  ASSERT_EQ(observer.elapsed(0.2 * T).value(), 0);
  ASSERT_TRUE(observer.set_step_time(T));
  ASSERT_EQ(observer.elapsed(0.2 * T).value(), 0);  // not 0.4 T, which would be a step
}

/// A pause is as many steps without a measurement, and then one with: to the bit.
TEST(Elapsed, IsStepsWithoutAMeasurement) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  auto config = loop<double>();
  config.missing.most = 30;
  auto one = C::make(config).value();
  for (int k = 0; k < 100; ++k) one.update(0.01 * k, 1);
  for (const int gap : {2, 5, 20, 29, 30, 31, 90}) {
    for (const bool lost : {false, true}) {
      auto paused = one;
      auto stepped = one.observer();
      const double u = one.output();
      ASSERT_TRUE(paused.elapsed((gap + 0.5) * T));
      ASSERT_EQ(stepped.elapsed((gap + 0.5) * T).value(), gap < 4 ? 1 : gap + 1);
      for (int i = gap < 4 ? gap : 0; i < gap; ++i) stepped.predict(u);
      const double y = lost ? hidden_nan<double>() : 0.7;
      stepped.update(y, u);
      paused.update(y, 1);
      for (int r = 0; r < 3; ++r) EXPECT_EQ(paused.observer().estimate()(r), stepped.estimate()(r));
      // A loop whose sensor is lost for so long goes to its safe mode.
      EXPECT_EQ(paused.mode() == LoopMode::safe, lost && gap >= 30) << gap;
      ASSERT_TRUE(paused.elapsed(T));
      paused.update(y, 1);
      EXPECT_EQ(paused.observer().missed(), lost ? (gap < 4 ? 2 : gap + 2) : 0);
    }
  }
}

/// The rate limit counts one step: what was held in a pause did not move.
TEST(Elapsed, APauseIsNoLeaveToJump) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  auto config = loop<double>();
  config.limits = {.lower = -1e6, .upper = 1e6, .rate = 100};
  for (const double samples : {0.5, 2.0, 10.0, 1e6}) {
    auto controller = C::make(config).value();
    controller.update(0, 0);
    ASSERT_TRUE(controller.elapsed(samples * T));
    EXPECT_NEAR(controller.update(0, 1e6), 100 * (samples < 4 ? samples * T : T), 1e-9);
  }
  // What the limiter refuses at that length changes nothing.
  using F = Adrc<VariableTime<LinearEso<2, float>>>;
  auto narrow = loop<float>(100);
  narrow.limits = {.lower = -1e4f, .upper = 1e4f, .rate = 1e-20f};
  const float least = F::make(narrow).error().limit;  // of a step
  narrow.limits.rate = 2 * least / 1e-3f;
  auto controller = F::make(narrow).value();
  controller.update(1, 2);
  const auto before = controller;
  EXPECT_EQ(refusal(controller.elapsed(0.0101e-3f)),
            "limits.rate: is lost beside the limits; in a sample u must move by more than");
  EXPECT_EQ(refusal(controller.set_step_time(0.0101e-3f)),
            "limits.rate: is lost beside the limits; in a sample u must move by more than");
  EXPECT_TRUE(same_object(controller, before));
}

/// The rate limit counts from what was commanded, whatever the actuator reports before `elapsed`.
TEST(Elapsed, CountsTheRateFromTheCommand) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  auto config = loop<double>();
  config.limits = {.lower = -1e6, .upper = 1e6, .rate = 100};
  for (const double samples : {1.0, 2.0, 10.0}) {
    auto controller = C::make(config).value();
    const double before = controller.update(0, 1e6);
    controller.applied(-3);
    ASSERT_TRUE(controller.elapsed(samples * T));
    const double u = controller.update(0, 1e6);
    EXPECT_NEAR(u - before, 100 * (samples < 4 ? samples * T : T), 1e-9);
    EXPECT_EQ(controller.observer().applied_input(), -3);
  }
}

TEST(Elapsed, GainsOfTheSampledDomainFollow) {
  using C = Adrc<VariableTime<LinearEso<2>>>;
  auto config = loop<double>();
  config.domain = TimeDomain::sampled;
  auto controller = C::make(config).value();
  const auto placed = [](double time) {
    return feedback_gain<2, double>({20, TimeDomain::sampled, false}, time).value()[0];
  };
  ASSERT_TRUE(controller.elapsed(2 * T));
  EXPECT_EQ(controller.gains()[0], placed(2 * T));
  ASSERT_TRUE(controller.elapsed(20.5 * T));
  EXPECT_EQ(controller.gains()[0], placed(controller.observer().step_time()));
  EXPECT_NEAR(controller.observer().step_time(), 22.5 / 23 * T, 1e-15);  // with the 2 T
  const auto before = controller;
  EXPECT_EQ(refusal(controller.elapsed(-1)), "elapsed: must be finite and not negative");
  EXPECT_TRUE(same_object(controller, before));
}

/// What drove the equation counts in a pause, too, not u.
TEST(Elapsed, OfACompensatorWithADriveOfItsOwn) {
  using C = DisturbanceCompensator<VariableTime<LinearEso<2>>>;
  auto controller = C::make({.observer = {.observer = eso(), .ratio = 4}}).value();
  double x = 0, v = 0;
  const double drive = 0.3;
  for (int k = 0; k < 600; ++k) {
    const double dt = k % 100 == 99 ? 20 * T : T;
    x += dt * v + dt * dt / 2 * (50 * drive + 4);
    v += dt * (50 * drive + 4);
    ASSERT_TRUE(controller.elapsed(dt));
    controller.update_driven(x, 0, drive);
    if (k > 300) {
      ASSERT_NEAR(controller.observer().total_disturbance(), 4, 1e-5) << k;
    }
  }
}

// ---- adapters

/// y' = 2 u + d at rest under 1.5, in each adapter around and inside: a pause is no event.
template <class Observer>
void rests(const typename Observer::Config& config) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  auto made = Adrc<Observer>::make({.observer = config, .controller_bandwidth = 8});
  ASSERT_EQ(refusal(made), "accepted");
  auto controller = *made;
  ChainPlant plant(1, T, 2, 1.5);
  double u = 0;
  const auto step = [&](int samples) {
    for (int i = 0; i < samples; ++i) plant.step(u);
    ASSERT_TRUE(controller.elapsed(samples * T));
    u = controller.update(plant.output(), 0.5);
  };
  for (int k = 0; k < 4000; ++k) step(1);
  for (const int samples : {6, 20, 1, 0, 3, 90, 1, 1, 20}) {
    step(samples);
    EXPECT_NEAR(u, -0.75, 1e-5) << samples;
    EXPECT_FALSE(has(controller.status(), StepStatus::restarted));
  }
  // It may be kept over a power cut in the middle of a pause, and retuned.
  for (int i = 0; i < 20; ++i) plant.step(u);
  ASSERT_TRUE(controller.elapsed(20 * T));
  auto again = from_snapshot<Adrc<Observer>>(snapshot(controller)).value();
  const double next = controller.update(plant.output(), 0.5);
  EXPECT_EQ(again.update(plant.output(), 0.5), next);
  ASSERT_TRUE(controller.elapsed(20 * T));
  ASSERT_TRUE(controller.retune({.observer = config, .controller_bandwidth = 8}));
  for (int i = 0; i < 20; ++i) plant.step(next);
  EXPECT_NEAR(controller.update(plant.output(), 0.5), -0.75, 1e-5);
}

LinearEso<1>::Config first() {
  return {.observer_bandwidth = 40, .input_gain = 2, .sample_time = T};
}

TEST(Elapsed, InEveryAdapter) {
  using Inner = LinearEso<1>;
  using V = VariableTime<Inner>;
  const V::Config v{.observer = first(), .ratio = 1.5};
  rests<V>(v);
  rests<DelayedInput<V, 4>>({.observer = v, .delay = 3});
  rests<OutlierGate<V>>({.observer = v, .threshold = 0.01});
  rests<WrappedOutput<V>>({.observer = v, .period = 6});
  rests<Measured<V>>({.observer = v, .inputs = {{{.gain = 1}}}});
  rests<KnownModel<V, Friction<0, double>>>({.observer = v, .model = {.coefficient = 0}});
  rests<DelayedInput<WrappedOutput<V>, 4>>({.observer = {.observer = v, .period = 6}, .delay = 2});
  rests<VariableTime<DelayedInput<Inner, 4>>>(
      {.observer = {.observer = first(), .delay = 3}, .ratio = 1.5});
  rests<VariableTime<CascadeEso<1, 2>>>({.observer = {.observer_bandwidth = 20,
                                                      .bandwidth_factor = 2,
                                                      .input_gain = 2,
                                                      .sample_time = T},
                                         .ratio = 1.5});
}

/// u acts three samples late and changes in the last one before the pause: in it the delay line
/// moves by as many samples.
TEST(Elapsed, ADelayLineMovesOn) {
  using C = Adrc<DelayedInput<VariableTime<LinearEso<1>>, 4>>;
  auto controller =
      C::make({.observer = {.observer = {.observer = first(), .ratio = 4}, .delay = 3},
               .controller_bandwidth = 1})
          .value();
  double y = 0, held[4] = {0, 0, 0, 0};
  const auto pass = [&](double u) {
    y += T * 2 * held[2];
    held[2] = held[1];
    held[1] = held[0];
    held[0] = u;
  };
  for (int k = 0; k < 3000; ++k) {
    ASSERT_TRUE(controller.elapsed(T));
    controller.track(y, 0, 0);
    pass(0);
  }
  ASSERT_TRUE(controller.elapsed(T));
  controller.track(y, 0, 0);
  for (int i = 0; i < 20; ++i) pass(5);
  ASSERT_TRUE(controller.elapsed(20 * T));
  controller.track(y, 0, 5);
  EXPECT_NEAR(controller.observer().total_disturbance(), 0, 1e-9);
}

/// w[k] acts from k on: not in the pause before it, and no w of the pause counts as lost.
TEST(Elapsed, AMeasuredDisturbanceActsFromItsSample) {
  using C = Adrc<Measured<VariableTime<LinearEso<1>>>>;
  auto controller = C::make({.observer = {.observer = {.observer = first(), .ratio = 4},
                                          .inputs = {{{.gain = 3}}},
                                          .most_lost = 2},
                             .controller_bandwidth = 5})
                        .value();
  double y = 0, u = 0, w = 0;
  Random random(3);
  for (int k = 0; k < 900; ++k) {
    const double dt = k % 50 == 49 ? 20 * T : T;
    y += dt * (2 * u + 3 * w);
    ASSERT_TRUE(controller.elapsed(dt));
    w = random.uniform(-1, 1);
    controller.measured(w);
    u = controller.update(y, 1);
    ASSERT_NEAR(controller.observer().residual_disturbance(), 0, 1e-8) << k;
    EXPECT_EQ(controller.observer().lost(), 0);
  }
}

TEST(Elapsed, OfLanes) {
  using One = Adrc<VariableTime<LinearEso<2>>>;
  constexpr int lanes = 2;
  auto packed = Packed<One, lanes>(One::make(loop<double>()).value());
  One alone[lanes] = {packed[0], packed[1]};
  Random random(9);
  for (int k = 0; k < 300; ++k) {
    const double seconds[] = {random.uniform(0, 3 * T), random.log_uniform(1e-6, 0.05)};
    ASSERT_TRUE(packed.all_or_none([&](auto& lane, int i) { return lane.elapsed(seconds[i]); }));
    Pack<double, lanes> y;
    for (int i = 0; i < lanes; ++i) {
      y[i] = random.uniform(-1, 1);
      ASSERT_TRUE(alone[i].elapsed(seconds[i]));
    }
    const auto u = packed.update(y, Pack<double, lanes>(0.5));
    for (int i = 0; i < lanes; ++i) ASSERT_TRUE(same_bits(u[i], alone[i].update(y[i], 0.5)));
  }
}

}  // namespace control_elapsed_test
}  // namespace esokit_test
