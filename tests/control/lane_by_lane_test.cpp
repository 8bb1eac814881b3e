// What goes lane by lane for a pack is so many of the plain scalar, behind the same members: every
// answer, with settings, faults and retunes of each lane its own. Adapters, and what goes around
// them; the controllers and filters of several channels; the differentiators. And what works on
// packs itself without an observer: the filter form, the nonlinear feedback.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/dual_feedback.hpp>
#include <esokit/control/incremental.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/core/pack.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/mimo_extended_state_filter.hpp>
#include <esokit/observer/model_eso.hpp>
#include <support/friction.hpp>
#include <support/lanes.hpp>
#include <vector>

namespace esokit_test {
namespace control_lane_by_lane_test {

using esokit::lane_count;
using esokit::LinearEso;
using esokit::Matrix;
using esokit::Vector;
using S = esokit::Pack<double, 2>;

/// A setting of lane i; `again` is that of a retune.
template <class T>
T set(int lane, bool again, double value) {
  return each_lane<T>(lane, [=](int i) { return value * (1 + 0.25 * i) * (again ? 1.125 : 1); });
}

template <class T>
auto linear(int lane, bool again) {
  typename LinearEso<1, T>::Config config{};
  config.observer_bandwidth = set<T>(lane, again, 30);
  config.input_gain = set<T>(lane, again, -2);
  config.sample_time = set<T>(lane, false, 0.01);
  config.max_gap = 4;
  return config;
}

struct Delayed {
  template <class T>
  using Type = esokit::DelayedInput<LinearEso<1, T>, 4>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.observer = linear<T>(lane, again), .delay = 2};
  }
};

struct Told {
  template <class T>
  using Type = esokit::Measured<LinearEso<1, T>, 1, 4>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{.observer = linear<T>(lane, again)};
    config.inputs[0] = {.gain = set<T>(lane, again, -3),
                        .lag = set<T>(lane, false, 0.05),
                        .dead_time = set<T>(lane, false, 0.013)};
    return config;
  }
};

/// Nested as it comes in practice.
struct GatedAngle {
  template <class T>
  using Type = esokit::WrappedOutput<esokit::OutlierGate<LinearEso<1, T>>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.observer = {.observer = linear<T>(lane, again),
                         .threshold = set<T>(lane, again, 0.75),
                         .running_factor = set<T>(lane, again, 3),
                         .most_in_a_row = 2},
            .period = set<T>(lane, again, 4)};
  }
};

struct Guards {
  template <class T>
  using Type = esokit::Adrc<esokit::Guarded<LinearEso<1, T>>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    config.observer = {.observer = linear<T>(lane, again),
                       .disturbance_bound = set<T>(lane, again, 20),
                       .release_samples = 3,
                       .leak_time = set<T>(lane, again, 4)};
    config.controller_bandwidth = set<T>(lane, again, 5);
    config.limits = {set<T>(lane, again, -2), set<T>(lane, again, 3), set<T>(lane, again, 200)};
    return config;
  }
};

struct KnownVarying {
  template <class T>
  using Type = esokit::VariableTime<esokit::KnownModel<LinearEso<1, T>, Friction<0, T>>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.observer = {.observer = linear<T>(lane, again), .model = {set<T>(lane, again, 3)}}};
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
  template <class T>
  using Type = esokit::ModelCascadeEso<parts, 2, T>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    config.observer_bandwidth = set<T>(lane, again, 20);
    config.bandwidth_factor = T(1.5);
    config.input_gain = set<T>(lane, again, -2);
    config.sample_time = set<T>(lane, false, 0.01);
    config.model.plant = {set<T>(lane, again, 3)};
    config.model.actuator.time_constant = set<T>(lane, again, 0.05);
    config.model.sensor.frequency = set<T>(lane, again, 40);
    config.model.resonators[0].frequency = set<T>(lane, again, 15);
    config.model.first_order[0] = set<T>(lane, again, 0.5);
    config.max_gap = 4;
    return config;
  }
};

struct GatedModel {
  template <class T>
  using Type = esokit::OutlierGate<Modelled::Type<T>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.observer = Modelled::config<T>(lane, again), .threshold = set<T>(lane, again, 0.75)};
  }
};

template <class Kind>
struct InAdrc {
  template <class T>
  using Type = esokit::Incremental<esokit::Adrc<typename Kind::template Type<T>>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    config.observer = Kind::template config<T>(lane, again);
    config.controller_bandwidth = set<T>(lane, again, 5);
    config.limits = {set<T>(lane, again, -2), set<T>(lane, again, 3), set<T>(lane, again, 200)};
    config.missing.most = 2;
    return config;
  }
};

struct Compensating {
  template <class T>
  using Type = esokit::DisturbanceCompensator<typename GatedAngle::Type<T>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    config.observer = GatedAngle::config<T>(lane, again);
    config.compensation_gain = set<T>(lane, again, 0.5);
    return config;
  }
};

/// Of a gain that is known before, one of two, and one that is a function of e.
template <template <class> class Observer>
struct Predictive {
  template <class T>
  using Type = esokit::PredictiveAdrc<Observer<T>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    if constexpr (requires { config.observer.bandwidth_factor; }) {
      config.observer.bandwidth_factor = T(2.0);
    }
    config.observer.observer_bandwidth = set<T>(lane, again, 30);
    config.observer.input_gain = set<T>(lane, again, -2);
    config.observer.sample_time = set<T>(lane, false, 0.01);
    config.controller_bandwidth = set<T>(lane, again, 5);
    config.limits = {set<T>(lane, again, -40), set<T>(lane, again, 30), T(1e3)};
    config.start_hold = set<T>(lane, false, 0.05);
    return config;
  }
};

struct TwoChannels {
  template <class T>
  using Type = esokit::MimoAdrc<LinearEso<1, T>, typename GatedAngle::Type<T>>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    std::get<0>(config.observers) = linear<T>(lane, again);
    std::get<1>(config.observers) = GatedAngle::config<T>(lane, again);
    std::get<0>(config.observers).input_gain = T(0.0);
    std::get<1>(config.observers).observer.observer.input_gain = T(0.0);
    config.controller_bandwidths = {set<T>(lane, again, 4), set<T>(lane, again, 5)};
    config.input_matrix = {{set<T>(lane, again, 2), T(0.25)}, {T(0.5), set<T>(lane, again, -1)}};
    for (auto& limits : config.limits) limits = {T(-4.0), set<T>(lane, again, 5), T(1e3)};
    return config;
  }
};

/// One chain of two inputs: what goes lane by lane are the vectors and matrices of its members.
struct TwoInputs {
  template <class T>
  using Type = esokit::MimoExtendedStateFilter<esokit::ChainOrders<1>, 2, T>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    config.input_matrix = {{set<T>(lane, again, 2), T(0.25)}};
    config.sample_time = set<T>(lane, false, 0.01);
    config.measurement_covariance(0, 0) = set<T>(lane, again, 0.01);
    for (auto& bound : config.disturbance_bounds) bound = set<T>(lane, again, 0.1);
    config.inflation = set<T>(lane, again, 0.05);
    config.max_gap = 4;
    return config;
  }
};

struct Differentiator {
  template <class T>
  using Type = esokit::TrackingDifferentiator<T>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.acceleration = set<T>(lane, again, 50), .sample_time = set<T>(lane, false, 0.01)};
  }
};

struct SignDifferentiator {
  template <class T>
  using Type = esokit::SignTrackingDifferentiator<T>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.acceleration = set<T>(lane, again, 50), .sample_time = set<T>(lane, false, 0.01)};
  }
};

template <class Operator, class Feedback>
struct Filter {
  template <class T>
  using Type = esokit::DualFeedbackAdrc<2, T, 1, Operator, Feedback>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    return {.observer_bandwidth = set<T>(lane, again, 30),
            .controller_bandwidth = set<T>(lane, again, 5),
            .input_gain = set<T>(lane, again, -2),
            .sample_time = set<T>(lane, false, 0.01),
            .limits = {set<T>(lane, again, -40), set<T>(lane, again, 30), T(1e3)}};
  }
};

struct Feedback {
  template <class T>
  using Type = esokit::NonlinearFeedback<2, T>;
  template <class T>
  static typename Type<T>::Config config(int lane, bool again) {
    typename Type<T>::Config config{};
    config.gains = {set<T>(lane, again, 4), set<T>(lane, again, 1)};
    // Of one kind, and of two.
    config.exponents = {T(0.5), each_lane<T>(lane, [](int i) { return i == 0 ? 0.75 : 0.5; })};
    config.linear_widths = {set<T>(lane, again, 0.25), set<T>(lane, again, 0.125)};
    config.input_gain = set<T>(lane, again, 2);
    return config;
  }
};

/// `step(object, signals, k)` gives all that is to be compared; it sees a pack, and then each plain
/// scalar.
template <class Kind, class Step>
void expect_lanes(const Step& step) {
  using One = esokit::LaneScalar<S>;
  using Plain = typename Kind::template Type<One>;
  static_assert(lane_count<S> == 2);
  const auto make = [](int lane) {
    return Plain::make(Kind::template config<One>(lane, false)).value();
  };
  auto packed = Kind::template Type<S>::make(Kind::template config<S>(0, false)).value();
  Plain lanes[] = {make(0), make(1)};
  FaultySignal<S> sources[] = {FaultySignal<S>(1, 0.08), FaultySignal<S>(2, 0.02),
                               FaultySignal<S>(3, 0.05), FaultySignal<S>(4, 0.02)};
  bool parted = false;
  for (int k = 0; k < 1500; ++k) {
    Vector<S, 4> signals;
    for (int i = 0; i < 4; ++i) signals[i] = sources[i]();
    if constexpr (esokit::detail::Retunable<decltype(packed)>) {
      if (k % 300 == 150) {
        const bool again = k % 600 == 150;
        const bool done = packed.retune(Kind::template config<S>(0, again)).has_value();
        Plain retuned[] = {lanes[0], lanes[1]};
        bool all_done = true;
        for (int i = 0; i < lane_count<S>; ++i) {
          all_done = retuned[i].retune(Kind::template config<One>(i, again)) && all_done;
        }
        for (int i = 0; i < lane_count<S> && all_done; ++i) lanes[i] = retuned[i];
        ASSERT_EQ(done, all_done);
      }
    }
    const Answers results = step(packed, signals, k);
    for (int i = 0; i < lane_count<S>; ++i) {
      Vector<One, 4> of_lane;
      for (int j = 0; j < 4; ++j) of_lane[j] = signals[j][i];
      const Answers expected = step(lanes[i], of_lane, k);
      ASSERT_EQ(results.differs(i, expected), -1) << "sample " << k << ", lane " << i;
      parted = parted || results.differs(0, expected) == 0;
    }
  }
  EXPECT_TRUE(parted) << "the lanes did the same";
}

const auto observe = [](auto& o, const auto& x, int k) {
  if (k % 97 == 60) (void)o.reset(x[0]);
  if (k % 97 == 80) (void)o.correct(x[2]);
  const auto status = k % 11 == 7 ? o.predict(x[1]) : o.update(x[0], x[1]);
  return Answers(status, o.estimate(), o.template estimate<1>(), o.total_disturbance(), o.missed(),
                 o.restarts(), o.applied_input(), o.input_gain(), o.level_estimate(0),
                 o.equilibrium(x[0], x[1]));
};

TEST(LaneByLane, Measured) {
  expect_lanes<Told>([](auto& o, const auto& x, int k) {
    if (k % 13 != 5) o.measured(x[2]);
    return observe(o, x, k).and_also(o.known_part(), o.residual_disturbance());
  });
}

TEST(LaneByLane, DelayedInput) {
  expect_lanes<Delayed>([](auto& o, const auto& x, int k) {
    if (k % 50 == 20) o.fill_input(x[1]);
    return observe(o, x, k);
  });
}

TEST(LaneByLane, AGateInAWrappedOutput) {
  expect_lanes<GatedAngle>([](auto& o, const auto& x, int k) {
    return observe(o, x, k).and_also(o.wrap(x[2]), o.period());
  });
}

TEST(LaneByLane, Guards) {
  expect_lanes<Guards>([](auto& c, const auto& x, int k) {
    if (k % 17 == 9) (void)c.hold(x[0], x[2], x[1]);
    if (k % 29 == 3) {
      // One that no lane refuses.
      const auto b = c.observer().input_gain();
      EXPECT_TRUE(c.set_input_gain(k % 2 == 0 ? b + b : b).has_value());
    }
    const auto u = c.update(x[0], x[2]);
    const auto& o = c.observer();
    return Answers(u, o.estimate(), o.bounded(), o.gated(), o.trust(), o.holding_input(),
                   o.input_factor(), o.present_input_gain(), o.applied_input());
  });
}

TEST(LaneByLane, AKnownModelInVariableTime) {
  expect_lanes<KnownVarying>([](auto& o, const auto& x, int k) {
    // A step of the length that it was given alone: what is refused in a lane is refused in all.
    if (k % 20 == 3) {
      EXPECT_TRUE(o.set_step_time(o.sample_time()));
    }
    return observe(o, x, k).and_also(o.step_time());
  });
}

TEST(LaneByLane, ACascadeWithAModel) { expect_lanes<Modelled>(observe); }

const auto control = [](auto& c, const auto& x, int k) {
  if (k % 113 == 50) (void)c.start(x[0], x[1]);
  if (k % 13 == 5) return c.update(x[0], {x[1], x[2]});
  return k % 7 == 3 ? c.update(x[0], x[1], x[3]) : c.update(x[0], x[1]);
};

TEST(LaneByLane, IncrementalAdrcOfAnAngle) {
  expect_lanes<InAdrc<GatedAngle>>([](auto& c, const auto& x, int k) {
    const auto u = control(c, x, k);
    const auto& inner = c.controller();
    return Answers(u, inner.output(), inner.requested(), inner.status(), inner.mode(),
                   inner.gains(), inner.observer().estimate());
  });
}

TEST(LaneByLane, AdrcOfAGatedModel) {
  expect_lanes<InAdrc<GatedModel>>([](auto& c, const auto& x, int k) {
    const auto u = control(c, x, k);
    const auto& inner = c.controller();
    return Answers(u, inner.status(), inner.mode(), inner.observer().estimate());
  });
}

TEST(LaneByLane, DisturbanceCompensator) {
  expect_lanes<Compensating>([](auto& c, const auto& x, int) {
    const auto u = c.update(x[0], x[1]);
    return Answers(u, c.output(), c.status(), c.mode());
  });
}

template <class T>
using Cascaded = esokit::CascadeEso<1, 2, T>;
template <class T>
using Switching = esokit::AdjustableBandwidthEso<1, T>;

const auto predict_control = [](auto& c, const auto& x, int k) {
  if (k % 113 == 50) (void)c.start(x[0], x[1]);
  if (k % 113 == 90) (void)c.reset(x[0]);
  const auto u = k % 11 == 7 ? c.control_without_measurement() : c.control(x[0]);
  if (k % 5 == 2) (void)c.report_applied(x[3]);
  const auto status = k % 13 == 5 ? c.prepare({x[1], x[2]}) : c.prepare(x[1]);
  if (k % 7 == 1) (void)c.report_applied(x[3]);
  if (k % 17 == 3) c.set_reference(x[2]);
  return Answers(u, status, c.output(), c.blind_output(), c.status(), c.gains(),
                 c.observer().estimate());
};

TEST(LaneByLane, PredictiveAdrc) {
  expect_lanes<Predictive<Cascaded>>(predict_control);
  expect_lanes<Predictive<Switching>>(predict_control);
}

TEST(LaneByLane, MimoAdrc) {
  expect_lanes<TwoChannels>([](auto& c, const auto& x, int k) {
    if (k % 113 == 50) (void)c.start({x[0], x[2]}, {x[1], x[3]});
    const auto u = k % 7 == 3 ? c.update({x[0], x[2]}, {x[1], x[3]}, {x[3], x[1]})
                              : c.update({x[0], x[2]}, {x[1], x[3]});
    return Answers(u, c.output(), c.status(0), c.status(1), c.template observer<0>().estimate(),
                   c.template observer<1>().estimate());
  });
}

TEST(LaneByLane, MimoExtendedStateFilter) {
  expect_lanes<TwoInputs>([](auto& f, const auto& x, int k) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    if (k % 113 == 50) (void)f.reset(Vector<T, 1>{x[0]});
    const auto status = f.update(Vector<T, 1>{x[0]}, {x[1], x[3]});
    return Answers(status, f.estimate(), f.template chain_estimate<0>(), f.total_disturbance(),
                   f.missed(0), f.innovation(), f.normalised_innovation());
  });
}

TEST(LaneByLane, Differentiators) {
  const auto track = [](auto& d, const auto& x, int k) {
    if (k % 113 == 50) (void)d.reset(x[1]);
    const auto good = d.update(x[0]);
    return Answers(d.value(), d.derivative(), d.state(), good);
  };
  expect_lanes<Differentiator>(track);
  expect_lanes<SignDifferentiator>(track);
}

const auto filter = [](auto& c, const auto& x, int k) {
  if (k % 113 == 50) (void)c.start(x[1], x[3]);
  const auto u = k % 7 == 3 ? c.update(x[0], x[1], x[3]) : c.update(x[0], x[1]);
  return Answers(u, c.output(), c.requested(), c.status());
};

TEST(PackOfAFilter, IsItsLanes) {
  expect_lanes<Filter<esokit::DeltaOperator, esokit::LimitedFeedback>>(filter);
  expect_lanes<Filter<esokit::ShiftOperator, esokit::UnlimitedFeedback>>(filter);
  auto config = Filter<esokit::ShiftOperator, esokit::LimitedFeedback>::config<S>(0, false);
  config.sample_time[1] = -1;
  const auto refused = esokit::DualFeedbackAdrc<2, S>::make(config);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, 1);
}

TEST(PackOfANonlinearFeedback, IsItsLanes) {
  expect_lanes<Feedback>([](auto& law, const auto& x, int) {
    using T = std::remove_cvref_t<decltype(x[0])>;
    return Answers(law.control(Vector<T, 3>{x[0], x[1], x[2]}, Vector<T, 2>{x[3], x[1]}));
  });
  auto config = Feedback::config<S>(0, false);
  config.exponents[1][1] = 0;
  const auto refused = esokit::NonlinearFeedback<2, S>::make(config);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, 1);
  EXPECT_EQ(refused.error().index, 1);
  EXPECT_STREQ(refused.error().field, "exponents");
}

TEST(LaneByLane, AdoptsEachLaneFromItsOwn) {
  auto adopting = GatedAngle::Type<S>::make(GatedAngle::config<S>(0, false)).value();
  const auto fresh = GatedAngle::Type<S>::make(GatedAngle::config<S>(0, true)).value();
  ASSERT_TRUE(adopting.adopt(fresh));
  for (int i = 0; i < lane_count<S>; ++i) {
    EXPECT_NE(fresh[i].period(), fresh[1 - i].period());
    EXPECT_EQ(adopting[i].period(), fresh[i].period());
    EXPECT_EQ(adopting[i].input_gain(), fresh[i].input_gain());
  }
}

TEST(LaneByLane, NamesTheLaneOfAnError) {
  auto config = GatedAngle::config<S>(0, false);
  auto made = GatedAngle::Type<S>::make(config);
  ASSERT_TRUE(made);
  auto before = *made;
  config.period[1] = -1;
  EXPECT_EQ(GatedAngle::Type<S>::make(config).error().lane, 1);
  const auto refused = made->retune(config);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().lane, 1);
  EXPECT_STREQ(refused.error().field, "period");
  EXPECT_STREQ(refused.error().rule, "must be finite and positive");
  EXPECT_EQ(refused.error().value[1], -1);
  // Of all lanes or of none.
  EXPECT_TRUE(lane_equals(made->period(), before[0].period(), 0));
  const auto step = KnownVarying::Type<S>::make(KnownVarying::config<S>(0, false)).value();
  auto varied = step;
  EXPECT_EQ(varied.set_step_time(S({0.011, 1e3})).error().lane, 1);
  EXPECT_TRUE(lane_equals(varied.step_time(), step[0].step_time(), 0));
}

}  // namespace control_lane_by_lane_test
}  // namespace esokit_test
