// A Packed is so many of its type: every answer, with settings, faults and retunes of each lane its
// own. Of what goes lane by lane: most adapters, and what goes around them; the controllers and
// filters of several channels; the differentiators. Of what works on packs itself: DelayedInput,
// and without an observer the nonlinear feedback. Observers: observer/pack_test.cpp, Adrc:
// pack_test.cpp.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <support/friction.hpp>
#include <support/lanes.hpp>
#include <vector>

namespace esokit_test {
namespace control_packed_test {

using esokit::LinearEso;
using esokit::Matrix;
using esokit::Packed;
using esokit::Vector;
constexpr int lanes = 2;
using S = esokit::Pack<double, lanes>;

/// A setting of a lane; `again` is that of a retune.
double set(int lane, bool again, double value) {
  return value * (1 + 0.25 * lane) * (again ? 1.125 : 1);
}

/// f(object, signals) of each lane of a Packed, or of the one plain object.
template <class O, class X, class F>
auto on(O& o, const X& x, F f) {
  if constexpr (requires { O::lanes; }) {
    return o.each([&](auto& lane, int i) {
      Vector<double, 4> of_lane;
      for (int j = 0; j < 4; ++j) of_lane[j] = x[j][i];
      return f(lane, of_lane);
    });
  } else {
    return f(o, x);
  }
}

auto linear(int lane, bool again) {
  LinearEso<1>::Config config{};
  config.observer_bandwidth = set(lane, again, 30);
  config.input_gain = set(lane, again, -2);
  config.sample_time = set(lane, false, 0.01);
  config.max_gap = 4;
  return config;
}

/// @tparam First d of lane 0, with `again` one more @tparam Second of lane 1
template <class Observer, int First = 2, int Second = 2>
struct DelayedBy {
  using Type = esokit::DelayedInput<Observer, 4>;
  static typename Type::Config config(int lane, bool again) {
    typename Type::Config config{};
    auto& observer = config.observer;
    observer.input_gain = set(lane, again, -2);
    observer.sample_time = set(lane, false, 0.01);
    observer.max_gap = 4;
    observer.observer_bandwidth = set(lane, again, 30);
    config.delay = (lane == 0 ? First : Second) + (again ? 1 : 0);
    return config;
  }
};
using Delayed = DelayedBy<LinearEso<1>>;

struct Told {
  using Type = esokit::Measured<LinearEso<1>, 1, 4>;
  static Type::Config config(int lane, bool again) {
    Type::Config config{.observer = linear(lane, again)};
    config.inputs[0] = {.gain = set(lane, again, -3),
                        .lag = set(lane, false, 0.05),
                        .dead_time = set(lane, false, 0.013)};
    return config;
  }
};

/// Nested as it comes in practice.
struct GatedAngle {
  using Type = esokit::WrappedOutput<esokit::OutlierGate<LinearEso<1>>>;
  static Type::Config config(int lane, bool again) {
    return {.observer = {.observer = linear(lane, again),
                         .threshold = set(lane, again, 0.75),
                         .running_factor = set(lane, again, 3),
                         .most_in_a_row = 2},
            .period = set(lane, again, 4)};
  }
};

struct Guards {
  using Type = esokit::Adrc<esokit::Guarded<LinearEso<1>>>;
  static Type::Config config(int lane, bool again) {
    Type::Config config{};
    config.observer = {.observer = linear(lane, again),
                       .disturbance_bound = set(lane, again, 20),
                       .release_samples = 3,
                       .leak_time = set(lane, again, 4)};
    config.controller_bandwidth = set(lane, again, 5);
    config.limits = {set(lane, again, -2), set(lane, again, 3), set(lane, again, 200)};
    return config;
  }
};

struct Curved {
  using Type = esokit::MappedInput<DelayedBy<LinearEso<1>>::Type, 3>;
  static Type::Config config(int lane, bool again) {
    return {.observer = Delayed::config(lane, again),
            .curve = lane == 0 ? esokit::ActuatorCurve<double, 3>::dead_zone(0.5, 0.25)
                               : esokit::ActuatorCurve<double, 3>::two_gains(again ? 3 : 2, 0.5)};
  }
};

struct KnownVarying {
  using Type = esokit::VariableTime<esokit::KnownModel<LinearEso<1>, Friction<0, double>>>;
  static Type::Config config(int lane, bool again) {
    return {.observer = {.observer = linear(lane, again), .model = {set(lane, again, 3)}}};
  }
};

/// All parts, of a lag of second order the damping that is left out.
struct Modelled {
  static constexpr esokit::ModelParts parts{.order = 1,
                                            .plant_poles = true,
                                            .actuator = 1,
                                            .sensor = 2,
                                            .resonators = 1,
                                            .first_order = 1};
  using Type = esokit::ModelCascadeEso<parts, 2>;
  static Type::Config config(int lane, bool again) {
    Type::Config config{};
    config.observer_bandwidth = set(lane, again, 20);
    config.bandwidth_factor = 1.5;
    config.input_gain = set(lane, again, -2);
    config.sample_time = set(lane, false, 0.01);
    config.model.plant = {set(lane, again, 3)};
    config.model.actuator.time_constant = set(lane, again, 0.05);
    config.model.sensor.frequency = set(lane, again, 40);
    config.model.resonators[0].frequency = set(lane, again, 15);
    config.model.first_order[0] = set(lane, again, 0.5);
    config.max_gap = 4;
    return config;
  }
};

struct GatedModel {
  using Type = esokit::OutlierGate<Modelled::Type>;
  static Type::Config config(int lane, bool again) {
    return {.observer = Modelled::config(lane, again), .threshold = set(lane, again, 0.75)};
  }
};

template <class Kind>
struct InAdrc {
  using Type = esokit::Adrc<typename Kind::Type>;
  static typename Type::Config config(int lane, bool again) {
    typename Type::Config config{};
    config.observer = Kind::config(lane, again);
    config.controller_bandwidth = set(lane, again, 5);
    config.limits = {set(lane, again, -2), set(lane, again, 3), set(lane, again, 200)};
    config.missing.most = 2;
    return config;
  }
};

struct Compensating {
  using Type = esokit::DisturbanceCompensator<GatedAngle::Type>;
  static Type::Config config(int lane, bool again) {
    Type::Config config{};
    config.observer = GatedAngle::config(lane, again);
    config.compensation_gain = set(lane, again, 0.5);
    return config;
  }
};

/// Of a gain that is known before, one of two, and one that is a function of e.
template <class Observer>
struct Predictive {
  using Type = esokit::PredictiveAdrc<Observer>;
  static typename Type::Config config(int lane, bool again) {
    typename Type::Config config{};
    if constexpr (requires { config.observer.bandwidth_factor; }) {
      config.observer.bandwidth_factor = 2.0;
    }
    config.observer.observer_bandwidth = set(lane, again, 30);
    config.observer.input_gain = set(lane, again, -2);
    config.observer.sample_time = set(lane, false, 0.01);
    config.controller_bandwidth = set(lane, again, 5);
    config.limits = {set(lane, again, -40), set(lane, again, 30), 1e3};
    config.start_hold = set(lane, false, 0.05);
    return config;
  }
};

struct TwoChannels {
  using Type = esokit::MimoAdrc<LinearEso<1>, GatedAngle::Type>;
  static Type::Config config(int lane, bool again) {
    Type::Config config{};
    std::get<0>(config.observers) = linear(lane, again);
    std::get<1>(config.observers) = GatedAngle::config(lane, again);
    std::get<0>(config.observers).input_gain = 0.0;
    std::get<1>(config.observers).observer.observer.input_gain = 0.0;
    config.controller_bandwidths = {set(lane, again, 4), set(lane, again, 5)};
    config.input_matrix = {{set(lane, again, 2), 0.25}, {0.5, set(lane, again, -1)}};
    for (auto& limits : config.limits) limits = {-4.0, set(lane, again, 5), 1e3};
    return config;
  }
};

struct Differentiator {
  using Type = esokit::TrackingDifferentiator<>;
  static Type::Config config(int lane, bool again) {
    return {.acceleration = set(lane, again, 50), .sample_time = set(lane, false, 0.01)};
  }
};

struct Feedback {
  using Type = esokit::NonlinearFeedback<2>;
  static Type::Config config(int lane, bool again) {
    Type::Config config{};
    config.gains = {set(lane, again, 4), set(lane, again, 1)};
    // Of one kind, and of two.
    config.exponents = {0.5, lane == 0 ? 0.75 : 0.5};
    config.linear_widths = {set(lane, again, 0.25), set(lane, again, 0.125)};
    config.input_gain = set(lane, again, 2);
    return config;
  }
};

/// `step(object, signals, k)` calls the Packed, and then each plain object, and gives what they
/// answer; `state(object)` gives all that is to be compared of a lane.
template <class Kind, class Step, class State>
void expect_lanes(const Step& step, const State& state) {
  using Plain = typename Kind::Type;
  const auto settings = [](bool again) { return [=](int i) { return Kind::config(i, again); }; };
  auto packed = Packed<Plain, lanes>::make(settings(false)).value();
  std::vector<Plain> plain;
  for (int i = 0; i < lanes; ++i) plain.push_back(Plain::make(settings(false)(i)).value());
  FaultySignal<S> sources[] = {FaultySignal<S>(1, 0.08), FaultySignal<S>(2, 0.02),
                               FaultySignal<S>(3, 0.05), FaultySignal<S>(4, 0.02)};
  bool parted = false;
  for (int k = 0; k < 1500; ++k) {
    Vector<S, 4> signals;
    for (int i = 0; i < 4; ++i) signals[i] = sources[i]();
    if constexpr (requires { plain[0].adopt(plain[0]); }) {
      if (k % 300 == 150) {
        const bool again = k % 600 == 150;
        auto retuned = plain;
        bool all_done = true;
        for (int i = 0; i < lanes; ++i) {
          all_done = retuned[static_cast<std::size_t>(i)].retune(settings(again)(i)) && all_done;
        }
        if (all_done) plain = retuned;
        ASSERT_EQ(packed.retune(settings(again)).has_value(), all_done);
      }
    }
    const Answers results = step(packed, signals, k);
    for (int i = 0; i < lanes; ++i) {
      Plain& one = plain[static_cast<std::size_t>(i)];
      Vector<double, 4> of_lane;
      for (int j = 0; j < 4; ++j) of_lane[j] = signals[j][i];
      const Answers expected = step(one, of_lane, k);
      ASSERT_EQ(results.differs(i, expected), -1) << "sample " << k << ", lane " << i;
      ASSERT_EQ(state(packed[i]).differs(0, state(one)), -1) << "sample " << k << ", lane " << i;
      parted = parted || state(packed[0]).differs(0, state(one)) != -1;
    }
  }
  EXPECT_TRUE(parted) << "the lanes did the same";
}

const auto observe = [](auto& o, const auto& x, int k) {
  if (k % 97 == 60) (void)o.reset(x[0]);
  if (k % 97 == 80) (void)o.correct(x[2]);
  return Answers(k % 11 == 7 ? o.predict(x[1]) : o.update(x[0], x[1]));
};
const auto seen = [](const auto& o) {
  return Answers(o.estimate(), o.template estimate<1>(), o.total_disturbance(), o.missed(),
                 o.restarts(), o.applied_input(), o.input_gain(), o.level_estimate(0),
                 o.equilibrium(0.5, 0.25));
};

TEST(Packed, Measured) {
  expect_lanes<Told>(
      [](auto& o, const auto& x, int k) {
        if (k % 13 != 5) on(o, x, [](auto& one, const auto& now) { one.measured(now[2]); });
        return observe(o, x, k);
      },
      [](const auto& o) { return seen(o).and_also(o.known_part(), o.residual_disturbance()); });
}

const auto observe_late = [](auto& o, const auto& x, int k) {
  if (k % 50 == 20) on(o, x, [](auto& one, const auto& now) { one.fill_input(now[1]); });
  return observe(o, x, k);
};

TEST(Packed, MappedInput) {
  static_assert(Packed<Curved::Type, lanes>::at_once);
  expect_lanes<Curved>(observe_late, seen);
}

TEST(Packed, DelayedInput) {
  static_assert(Packed<Delayed::Type, lanes>::at_once);
  expect_lanes<Delayed>(observe_late, seen);
  expect_lanes<DelayedBy<LinearEso<1>, 0, 0>>(observe_late, seen);
  expect_lanes<DelayedBy<LinearEso<1>, 3, 1>>(observe_late, seen);
  // A law that advances before the step.
  using Advancing = esokit::AdjustableBandwidthEso<1>;
  static_assert(Packed<DelayedBy<Advancing>::Type, lanes>::at_once);
  expect_lanes<DelayedBy<Advancing>>(observe_late, seen);
  expect_lanes<DelayedBy<Advancing, 1, 2>>(observe_late, seen);
  // One that has no form on packs.
  static_assert(!Packed<esokit::DelayedInput<GatedAngle::Type, 4>, lanes>::at_once);
}

TEST(Packed, LanesAtOtherPlacesInTheDelayLine) {
  expect_lanes<Delayed>(
      [](auto& o, const auto& x, int k) {
        // Lane 1, which has the longer sample time, is predicted once more.
        if (k % 60 == 40) {
          on(o, x, [](auto& one, const auto& now) {
            if (one.sample_time() > 0.011) (void)one.predict(now[3]);
          });
        }
        return observe_late(o, x, k);
      },
      seen);
}

TEST(Packed, AGateInAWrappedOutput) {
  expect_lanes<GatedAngle>(observe,
                           [](const auto& o) { return seen(o).and_also(o.wrap(3), o.period()); });
}

TEST(Packed, Guards) {
  expect_lanes<Guards>(
      [](auto& c, const auto& x, int k) {
        if (k % 17 == 9) {
          on(c, x, [](auto& one, const auto& now) { (void)one.hold(now[0], now[2], now[1]); });
        }
        if (k % 29 == 3) {
          on(c, x, [k](auto& one, const auto&) {  // one that no lane refuses
            const double b = one.observer().input_gain();
            EXPECT_TRUE(one.set_input_gain(k % 2 == 0 ? b + b : b).has_value());
          });
        }
        return Answers(c.update(x[0], x[2]));
      },
      [](const auto& c) {
        const auto& o = c.observer();
        return Answers(o.estimate(), o.bounded(), o.gated(), o.trust(), o.holding_input(),
                       o.input_factor(), o.present_input_gain(), o.applied_input());
      });
}

TEST(Packed, AKnownModelInVariableTime) {
  expect_lanes<KnownVarying>(
      [](auto& o, const auto& x, int k) {
        // A step of the length that it was given alone: what is refused in a lane is refused in
        // all.
        if (k % 20 == 3) {
          on(o, x,
             [](auto& one, const auto&) { EXPECT_TRUE(one.set_step_time(one.sample_time())); });
        }
        return observe(o, x, k);
      },
      [](const auto& o) { return seen(o).and_also(o.step_time()); });
}

TEST(Packed, ACascadeWithAModel) {
  static_assert(esokit::Packed<Modelled::Type, 4>::at_once);
  expect_lanes<Modelled>(observe, seen);
}

const auto control = [](auto& c, const auto& x, int k) {
  using T = std::remove_cvref_t<decltype(x[0])>;
  if (k % 113 == 50) (void)c.start(x[0], x[1]);
  if (k % 13 == 5) return Answers(c.update(x[0], Vector<T, 2>{x[1], x[2]}));
  if (k % 7 == 3) c.applied(x[3]);
  return Answers(c.update(x[0], x[1]));
};
const auto controlled = [](const auto& c) {
  return Answers(c.output(), c.requested(), c.status(), c.mode(), c.observer().estimate());
};

TEST(Packed, AdrcOfAnAngle) {
  expect_lanes<InAdrc<GatedAngle>>(control,
                                   [](const auto& c) { return controlled(c).and_also(c.gains()); });
}

TEST(Packed, AdrcOfADelayedInput) {
  static_assert(Packed<InAdrc<Delayed>::Type, lanes>::at_once);
  expect_lanes<InAdrc<Delayed>>(control, controlled);
  static_assert(Packed<InAdrc<Curved>::Type, lanes>::at_once);
  expect_lanes<InAdrc<Curved>>(control, controlled);
  expect_lanes<InAdrc<DelayedBy<LinearEso<1>, 0, 3>>>(control, controlled);
}

TEST(Packed, AdrcOfAGatedModel) { expect_lanes<InAdrc<GatedModel>>(control, controlled); }

TEST(Packed, DisturbanceCompensator) {
  expect_lanes<Compensating>(
      [](auto& c, const auto& x, int) { return Answers(c.update(x[0], x[1])); }, controlled);
}

TEST(Packed, PredictiveAdrc) {
  const auto step = [](auto& c, const auto& x, int k) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    if (k % 113 == 50) (void)c.start(x[0], x[1]);
    if (k % 113 == 90) (void)c.reset(x[0]);
    const auto u =
        k % 11 == 7
            ? on(c, x, [](auto& one, const auto&) { return one.control_without_measurement(); })
            : c.control(x[0]);
    if (k % 5 == 2) (void)c.applied(x[3]);
    const auto status = k % 13 == 5 ? c.prepare(Vector<T, 2>{x[1], x[2]}) : c.prepare(x[1]);
    if (k % 7 == 1) (void)c.applied(x[3]);
    if (k % 17 == 3) on(c, x, [](auto& one, const auto& now) { one.set_reference(now[2]); });
    return Answers(u, status);
  };
  const auto state = [](const auto& c) {
    return Answers(c.output(), c.blind_output(), c.status(), c.gains(), c.observer().estimate());
  };
  expect_lanes<Predictive<esokit::CascadeEso<1, 2>>>(step, state);
  expect_lanes<Predictive<esokit::AdjustableBandwidthEso<1>>>(step, state);
}

TEST(Packed, MimoAdrc) {
  expect_lanes<TwoChannels>(
      [](auto& c, const auto& x, int k) {
        using Two = Vector<std::remove_cvref_t<decltype(x[0])>, 2>;
        if (k % 113 == 50) (void)c.start(Two{x[0], x[2]}, Two{x[1], x[3]});
        if (k % 7 == 3) c.applied(Two{x[3], x[1]});
        return Answers(c.update(Two{x[0], x[2]}, Two{x[1], x[3]}));
      },
      [](const auto& c) {
        return Answers(c.output(), c.status(0), c.status(1), c.template observer<0>().estimate(),
                       c.template observer<1>().estimate());
      });
}

TEST(Packed, Differentiators) {
  const auto track = [](auto& d, const auto& x, int k) {
    if (k % 113 == 50) (void)d.reset(x[1]);
    return Answers(d.update(x[0]));
  };
  const auto state = [](const auto& d) { return Answers(d.value(), d.derivative(), d.state()); };
  expect_lanes<Differentiator>(track, state);
}

TEST(Packed, NonlinearFeedback) {
  const Packed<Feedback::Type, lanes> packed(
      [](int i) { return Feedback::Type::make(Feedback::config(i, false)).value(); });
  const Feedback::Type plain[] = {packed[0], packed[1]};
  FaultySignal<S> next(1, 0.05);
  for (int k = 0; k < 1500; ++k) {
    const Vector<S, 3> z{next(), next(), next()};
    const Vector<S, 2> r{next(), next()};
    const S u = packed.together().control(z, r);
    for (int i = 0; i < lanes; ++i) {
      ASSERT_TRUE(same_bits(u[i], plain[i].control(Vector<double, 3>{z[0][i], z[1][i], z[2][i]},
                                                   Vector<double, 2>{r[0][i], r[1][i]})));
    }
  }
}

using Angles = Packed<GatedAngle::Type, lanes>;
Angles::Plain::Config angle(int lane) { return GatedAngle::config(lane, false); }
Angles::Plain::Config bad_angle(int lane) {
  auto config = angle(lane);
  if (lane == 1) config.period = -1;
  return config;
}

TEST(Packed, AdoptsEachLaneFromItsOwn) {
  auto adopting = Angles::make(angle).value();
  const auto fresh = Angles::make([](int lane) { return GatedAngle::config(lane, true); }).value();
  ASSERT_TRUE(adopting.adopt(fresh));
  for (int i = 0; i < lanes; ++i) {
    EXPECT_NE(fresh[i].period(), fresh[1 - i].period());
    EXPECT_EQ(adopting[i].period(), fresh[i].period());
    EXPECT_EQ(adopting[i].input_gain(), fresh[i].input_gain());
  }
}

TEST(Packed, NamesTheLaneOfAnError) {
  auto made = Angles::make(angle).value();
  const auto before = made;
  EXPECT_EQ(Angles::make(bad_angle).error().lane, 1);
  const auto refused = made.retune(bad_angle);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, 1);
  EXPECT_STREQ(refused.error().field, "period");
  EXPECT_STREQ(refused.error().rule, "must be finite and positive");
  EXPECT_EQ(refused.error().value, -1);
  // Of all lanes or of none.
  EXPECT_EQ(made[0].period(), before[0].period());
  using Varying = Packed<KnownVarying::Type, lanes>;
  auto varied = Varying::make([](int lane) { return KnownVarying::config(lane, false); }).value();
  const double times[] = {0.011, 1e3};
  EXPECT_EQ(varied.all_or_none([&](auto& lane, int i) { return lane.set_step_time(times[i]); })
                .error()
                .lane,
            1);
  EXPECT_EQ(varied[0].step_time(), 0.01);
}

TEST(Packed, IsTheSameInEveryLaneOfOneObject) {
  const auto one = GatedAngle::Type::make(angle(1)).value();
  const Angles all(one);
  for (int i = 0; i < lanes; ++i) EXPECT_EQ(all[i].period(), one.period());
}

}  // namespace control_packed_test
}  // namespace esokit_test
