// The recorded list, replayed, is the step: every number of the object, bit for bit, with limits,
// bad samples, gaps and both signs of b0. What is no good sample the object does itself. Types that
// cannot be recorded are named here, with the reason, and must not become recordable unnoticed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <control/loop_traits.hpp>
#include <cstring>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <esokit/target/recorder.hpp>
#include <string>
#include <support/friction.hpp>
#include <vector>

namespace esokit_test {
namespace target_recorder_test {

using namespace esokit;

template <class V>
bool equal_bits(V a, V b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// A list on numbers of V.
template <class V>
class Replay {
 public:
  /// @param inputs numbers of the object, then arguments @return false if a check does not hold
  bool run(const RecordedCall& call, const std::vector<V>& inputs) {
    results_.clear();
    for (const Instruction& one : call.list.instructions) results_.push_back(result(one, inputs));
    for (const int check : call.list.checks) {
      if (at(check) == 0) return false;
    }
    return true;
  }
  [[nodiscard]] V at(int index) const { return results_[static_cast<std::size_t>(index)]; }

 private:
  [[nodiscard]] V result(const Instruction& one, const std::vector<V>& inputs) const {
    const V a = one.a >= 0 && one.operation != Operation::argument ? at(one.a) : V(0);
    const V b = one.b >= 0 ? at(one.b) : V(0);
    switch (one.operation) {
      case Operation::constant:
        return static_cast<V>(one.value);
      case Operation::argument:
        return inputs[static_cast<std::size_t>(one.a)];
      case Operation::add:
        return a + b;
      case Operation::subtract:
        return a - b;
      case Operation::multiply:
        return a * b;
      case Operation::divide:
        return a / b;
      case Operation::negate:
        return -a;
      case Operation::magnitude:
        return std::fabs(a);
      case Operation::square_root:
        return std::sqrt(a);
      case Operation::power:
        return std::pow(a, b);
      case Operation::exponential:
        return std::exp(a);
      case Operation::exponential_less_one:
        return std::expm1(a);
      case Operation::sine:
        return std::sin(a);
      case Operation::cosine:
        return std::cos(a);
      case Operation::tangent:
        return std::tan(a);
      case Operation::arc_tangent:
        return std::atan(a);
      case Operation::hyperbolic_tangent:
        return std::tanh(a);
      case Operation::choose:
        return a != 0 ? b : at(one.c);
      case Operation::less:
        return static_cast<V>(a < b);
      case Operation::greater:
        return static_cast<V>(a > b);
      case Operation::at_most:
        return static_cast<V>(a <= b);
      case Operation::at_least:
        return static_cast<V>(a >= b);
      case Operation::finite:
        return static_cast<V>(is_finite(a));
      case Operation::both:
        return static_cast<V>(a != 0 && b != 0);
      case Operation::either:
        return static_cast<V>(a != 0 || b != 0);
      case Operation::opposite:
        return static_cast<V>(a == 0);
    }
    return V(0);
  }

  std::vector<V> results_;
};

/// `update(y, u)` of an observer.
struct Observe {
  static constexpr int arguments = 2;
  template <class O, class T>
  static std::vector<T> call(O& o, const std::vector<T>& in, bool& fine) {
    const auto status = o.update(in[0], in[1]);
    if constexpr (PlainScalar<T>) fine = status == StepStatus::ok;
    return {};
  }
};

/// `update(y, r)` of a controller; `Moving` with a moving reference. What `applied` reports, the
/// shell of what is written keeps (target/c_kinds_test).
struct Control {
  static constexpr int arguments = 2;
  template <class O, class T>
  static std::vector<T> call(O& o, const std::vector<T>& in, bool& fine) {
    const T u = o.update(in[0], in[1]);
    if constexpr (PlainScalar<T>) fine = o.status() == StepStatus::ok;
    return {u};
  }
};
struct Moving {
  static constexpr int arguments = 3;
  template <class O, class T>
  static std::vector<T> call(O& o, const std::vector<T>& in, bool& fine) {
    const T u = o.update(in[0], {in[1], in[2]});
    if constexpr (PlainScalar<T>) fine = o.status() == StepStatus::ok;
    return {u};
  }
};

template <class Step, class Object>
auto recorded(const Object& object) {
  Recorder<Object> recorder(object);
  using Number = typename Recorder<Object>::Number;
  recorder.add_step(Step::arguments, [](auto& o, const std::vector<Number>& in) {
    bool fine = true;
    return Step::call(o, in, fine);
  });
  return recorder.record();
}

constexpr int samples = 12000;

struct Counts {
  int compared = 0, refused = 0, other = 0, limited = 0;
};

/// The next arguments; `last` is the last u.
template <class V>
class Inputs {
 public:
  Inputs(int order, double input_gain, bool is_controller)
      : plant_(order, 0.0078125, input_gain, 1.5), is_controller_(is_controller) {}

  std::vector<V> next(int count, double last) {
    const double u = is_controller_ ? last : held_;
    plant_.set_disturbance(2 * std::sin(0.01 * samples_++));
    plant_.step(is_finite(u) ? u : 0.0);
    std::vector<V> in;
    for (int i = 0; i < count; ++i) in.push_back(static_cast<V>(held_));
    in[0] = static_cast<V>(plant_.output() + 1e-3 * random_.uniform(-1, 1));
    if (count > 2) in[2] = static_cast<V>(0.9 * last);
    if (random_.index(40) == 0) held_ = random_.uniform(-4, 4);
    if (lost_ > 0) --lost_;
    if (random_.index(150) == 0) lost_ = 1 + random_.index(8);
    if (lost_ > 0) in[0] = hidden_nan<V>();
    if (random_.index(100) == 0) {
      in[static_cast<std::size_t>(random_.index(count))] = anything<V>(random_);
    }
    return in;
  }

 private:
  ChainPlant plant_;
  bool is_controller_;
  Random random_{7};
  double held_ = 1;
  int samples_ = 0;
  int lost_ = 0;
};

template <class Step, class Object>
Counts replayed(Object object, double input_gain, int settle) {
  using V = typename Object::scalar_type;
  using Number = RecordingScalar<V>;
  constexpr bool is_controller = requires { object.output(); };
  Counts counts;
  for (int k = 0; k < settle; ++k) {
    bool fine = true;
    (void)Step::call(object, std::vector<V>(std::size_t{Step::arguments}), fine);
  }
  const auto all = recorded<Step>(object);
  if (!all) {
    ADD_FAILURE() << all.error().rule;
    return counts;
  }
  const auto& lists = all->calls[0];
  const auto& counters = all->counters[0];
  Replay<V> replay;
  Inputs<V> signals(Object::order, input_gain, is_controller);
  double last = 0;
  for (int k = 0; k < samples; ++k) {
    const std::vector<V> in = signals.next(Step::arguments, last);
    auto copy = Recorder<Object>::as_recorded(object);
    const auto now = detail::counters_of<Number>(copy);
    std::size_t list = 0;
    while (list < lists.size() && counters[list] != now) ++list;
    std::vector<V> inputs;
    for (const Number* number : detail::numbers_of<Number>(copy)) inputs.push_back(number->value());
    bool fine = true;
    const std::vector<V> outputs = Step::call(object, in, fine);
    if (!outputs.empty()) last = static_cast<double>(outputs[0]);
    if constexpr (is_controller) {
      counts.limited += !(object.requested() >= outputs[0] && object.requested() <= outputs[0]);
      // A command that is not finite is judged by the shell, in what is written, too.
      if (has(object.status(), esokit::StepStatus::reference_rejected)) {
        ++counts.other;
        continue;
      }
    }
    if (list == lists.size()) {
      ++counts.other;
      continue;
    }
    const std::vector<V> before = inputs;
    inputs.insert(inputs.end(), in.begin(), in.end());
    const RecordedCall& call = lists[list];
    if (!replay.run(call, inputs)) {
      ++counts.refused;
      EXPECT_FALSE(fine) << "sample " << k << ": the list refuses what the object takes";
      continue;
    }
    EXPECT_TRUE(fine) << "sample " << k << ": the list takes what the object refuses";
    ++counts.compared;
    copy = Recorder<Object>::as_recorded(object);
    EXPECT_EQ(detail::counters_of<Number>(copy), counters[(list + 1) % lists.size()]) << k;
    const auto after = detail::numbers_of<Number>(copy);
    for (std::size_t i = 0; i < after.size(); ++i) {
      const V mine = call.next[i] < 0 ? before[i] : replay.at(call.next[i]);
      EXPECT_TRUE(equal_bits(mine, after[i]->value())) << "sample " << k << ", number " << i;
    }
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      EXPECT_TRUE(equal_bits(replay.at(call.outputs[i]), outputs[i])) << "sample " << k;
    }
    if (testing::Test::HasFailure()) return counts;
  }
  return counts;
}

/// The law, for an object whose config `fill` completes; both signs of b0.
/// @param settle samples after which its counters stand still @param share of all samples that is
/// compared at least; the others are gaps and what follows them
template <class Object, class Step, class Fill>
void obeys(const Fill& fill, int settle = 0, double share = 0.58) {
  SCOPED_TRACE(testing::internal::GetTypeName<Object>());
  using V = typename Object::scalar_type;
  for (const double input_gain : {8.0, -8.0}) {
    typename Object::Config config{};
    const auto innermost = [](auto& some, const auto& again) -> auto& {
      if constexpr (requires { some.observer; }) {
        return again(some.observer, again);
      } else {
        return some;
      }
    };
    auto& chain = innermost(config, innermost);
    chain.sample_time = V(0.0078125);
    chain.input_gain = V(input_gain);
    chain.max_gap = 5;
    if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth = V(4);
    if constexpr (requires { config.limits; }) config.limits = {V(-3), V(2.5), V(60)};
    fill(config);
    const Counts counts = replayed<Step>(Object::make(config).value(), input_gain, settle);
    EXPECT_GT(counts.compared, share * samples);
    EXPECT_GT(counts.refused, 50);
    EXPECT_GT(counts.other, 100) << "gaps are the object's";
    if (!std::is_same_v<Step, Observe>) {
      EXPECT_GT(counts.limited, samples / 8);
    }
  }
}

constexpr auto by_bandwidth = [](auto& config) { config.observer_bandwidth = 30; };
constexpr auto by_bandwidths = [](auto& config) {
  config.observer_bandwidth = 20;
  config.bandwidth_factor = 1.5f;
};

/// A gain function that is no template of a scalar.
struct OfAnyScalar {
  template <class S>
  S operator()(const S& x) const {
    return S(1.0) / (S(0.75) + x);
  }
};

template <class V>
class Recorded : public testing::Test {};
#ifdef ESOKIT_ONE_TYPE
using Plains = testing::Types<float>;
#else
using Plains = testing::Types<double, float>;
#endif
TYPED_TEST_SUITE(Recorded, Plains);

TYPED_TEST(Recorded, ObserversWithConstantGain) {
  using V = TypeParam;
  obeys<LinearEso<1, V>, Observe>(by_bandwidth);
  obeys<LinearEso<2, V>, Observe>(by_bandwidth);
  obeys<LinearEso<3, V, 2>, Observe>(by_bandwidth);
  obeys<LinearEso<1, V, 2, PoleSet>, Observe>([](auto& config) {
    config.poles[0] = {-20, 5};
    config.poles[1] = {-20, -5};
    config.poles[2] = {-9, 0};
  });
  obeys<HalfGainEso<2, V>, Observe>(by_bandwidth);
  obeys<ReducedOrderEso<2, V>, Observe>(by_bandwidth);
  obeys<CascadeEso<1, 2, V>, Observe>(by_bandwidths);
  obeys<CascadeEso<2, 3, V, 2>, Observe>(by_bandwidths);
}

TYPED_TEST(Recorded, ObserversWithModels) {
  using V = TypeParam;
  static constexpr ModelParts parts{.order = 1, .plant_poles = true, .actuator = 1, .sensor = 1};
  const auto fill = [](auto& config) {
    by_bandwidth(config);
    config.model.plant[0] = V(0.5);
    config.model.actuator.time_constant = V(0.05);
    config.model.sensor.time_constant = V(0.03);
  };
  obeys<ModelEso<parts, V>, Observe>(fill);
  obeys<ModelCascadeEso<parts, 2, V>, Observe>([&](auto& config) {
    fill(config);
    config.observer_bandwidth = 20;
    config.bandwidth_factor = 1.5f;
  });
  obeys<PlantEso<2, ModelParts{.order = 2, .resonators = 1}, V>, Observe>([](auto& config) {
    by_bandwidth(config);
    config.model.plant = LinearPlant<2, V>::chain({.coefficients = {V(0.5), V(0.5)}}).value();
    config.model.resonators[0].frequency = 25;
  });
}

TYPED_TEST(Recorded, ObserversWithKnownTerms) {
  using V = TypeParam;
  obeys<KnownModel<LinearEso<2, V>, Friction<1, V>>, Observe>([](auto& config) {
    config.observer.observer_bandwidth = 30;
    config.model.coefficient = V(0.5);
  });
}

TYPED_TEST(Recorded, ObserversWithOtherGains) {
  using V = TypeParam;
  obeys<AdjustableBandwidthEso<2, V>, Observe>([](auto& config) {
    config.observer_bandwidth = 30;
    config.bandwidth_ratio = V(0.75);
  });
  obeys<NonlinearEso<1, V>, Observe>([](auto& config) {
    config.observer_bandwidth = 30;
    config.shape.gain_alpha = V(0.6);
    config.shape.alpha = V(0.75);
    config.shape.gain_beta = V(0.25);
    config.shape.beta = V(0.5);
    config.gain_min = V(0.55);
  });
  obeys<NonlinearEso<1, V, 1, FalGain<V>>, Observe>([](auto& config) {
    config.observer_bandwidth = 30;
    config.shape.exponent = V(0.5);
    config.shape.linear_width = V(0.05);
  });
  obeys<NonlinearEso<1, V, 1, OfAnyScalar>, Observe>(by_bandwidth);
  // Settled: while they start, their lists go with the age, see below.
  obeys<AlgebraicEso<2, V>, Observe>(
      [](auto& config) {
        config.observer_bandwidth = 30;
        config.frequency_shift = 20;
      },
      1000, 0.3);
  obeys<ExtendedStateFilter<1, V>, Observe>(
      [](auto& config) {
        config.measurement_variance = V(0.01);
        config.disturbance_bounds = {V(0), V(0.5)};
        config.inflation = V(0.05);
        config.mode = RiccatiMode::frozen;
      },
      1000, 0.3);
}

TYPED_TEST(Recorded, Controllers) {
  using V = TypeParam;
  const auto linear = [](auto& config) { config.observer.observer_bandwidth = 30; };
  obeys<Adrc<LinearEso<1, V>>, Control>(linear);
  obeys<Adrc<LinearEso<2, V>>, Control>(linear);
  obeys<Adrc<LinearEso<2, V>>, Moving>(linear);
  obeys<Adrc<LinearEso<2, V>, ErrorBased>, Control>(linear);
  obeys<Adrc<LinearEso<1, V>>, Control>([&](auto& config) {
    linear(config);
    config.limits.rate = Limits<V>{}.rate;
  });
  obeys<Adrc<CascadeEso<1, 2, V>>, Control>([](auto& config) {
    config.observer.observer_bandwidth = 20;
    config.observer.bandwidth_factor = V(1.5);
  });
  obeys<Adrc<AdjustableBandwidthEso<1, V>>, Control>([&](auto& config) {
    linear(config);
    config.observer.bandwidth_ratio = V(0.75);
  });
  // It softens.
  obeys<Adrc<LinearEso<3, V>>, Control>([](auto& config) {
    config.observer.observer_bandwidth = 15;
    config.controller_bandwidth = V(1.5);
  });
  obeys<DisturbanceCompensator<LinearEso<1, V>>, Control>(linear);
}

// ---- What cannot be recorded yet.

/// A known model of doubles.
struct OfDouble {
  double operator()(const Vector<double, 2>& x) const noexcept { return -x(0); }
};

/// Those whose pack is one plain object a lane: a recording scalar never gets into them.
TEST(NotRecorded, WhatRunsLaneByLane) {
  using Plain = LinearEso<1>;
  static constexpr ModelParts follows{.order = 1, .resonators = 1, .follows_speed = true};
  const struct {
    bool recorded;
    const char* reason;
  } types[] = {{can_be_recorded<ModelEso<follows>>, "its gains change with the speed"},
               {can_be_recorded<DelayedInput<Plain, 4>>, "of plain scalars"},
               {can_be_recorded<OutlierGate<Plain>>, "of plain scalars"},
               {can_be_recorded<WrappedOutput<Plain>>, "of plain scalars"},
               {can_be_recorded<Guarded<Plain>>, "of plain scalars"},
               {can_be_recorded<VariableTime<Plain>>,
                "of plain scalars, and its gains change with the time"},
               {can_be_recorded<KnownModel<Plain, OfDouble>>, "its function is of one scalar"},
               {can_be_recorded<Adrc<DelayedInput<Plain, 4>>>, "its observer"},
               {can_be_recorded<DisturbanceCompensator<OutlierGate<Plain>>>, "its observer"},
               {can_be_recorded<MimoAdrc<Plain, Plain>>, "several channels, lane by lane"},
               {can_be_recorded<TrackingDifferentiator<>>, "branches, lane by lane"}};
  for (const auto& type : types) {
    EXPECT_FALSE(type.recorded) << type.reason << ": now it can be, so add it to the law above";
  }
}

template <class Step, class Object>
std::string refusal_of(const Object& object) {
  const auto made = recorded<Step>(object);
  return made ? "" : made.error().rule;
}

constexpr const char* counts = "changes counters at each call, in too long a cycle";
constexpr const char* looks = "branches on a number of one lane";

/// Those that branch on numbers or count with each good sample.
TEST(NotRecorded, WhatBranchesOrCounts) {
  const auto chain = [](auto config) {
    config.sample_time = 0.0078125;
    config.input_gain = 8;
    return config;
  };
  auto algebraic = chain(AlgebraicEso<2>::Config{});
  algebraic.observer_bandwidth = 30;
  algebraic.frequency_shift = 20;
  EXPECT_EQ(refusal_of<Observe>(AlgebraicEso<2>::make(algebraic).value()), counts) << "its age";

  using Filter = ExtendedStateFilter<1>;
  auto filter = chain(Filter::Config{});
  filter.measurement_variance = 0.01;
  filter.disturbance_bounds = {0, 0.5};
  filter.inflation = 0.05;
  EXPECT_EQ(refusal_of<Observe>(Filter::make(filter).value()), looks) << "the recursion";
  filter.mode = RiccatiMode::frozen;
  EXPECT_EQ(refusal_of<Observe>(Filter::make(filter).value()), counts) << "its age";

  using Loop = Adrc<LinearEso<1>>;
  Loop::Config loop{};
  loop.observer = chain(loop.observer);
  loop.observer.observer_bandwidth = 30;
  loop.controller_bandwidth = 4;
  loop.start_hold = {.time = 0.1, .input = 0.5};
  EXPECT_EQ(refusal_of<Control>(Loop::make(loop).value()), looks) << "the hold";
  loop.start_hold = {};
  loop.measurement_divider = 3;
  EXPECT_EQ(refusal_of<Control>(Loop::make(loop).value()), looks) << "samples between";
}

/// A number that any call changes is a number that moves in all of them.
TEST(Recorder, JoinsWhatMovesInAllCalls) {
  auto config = Adrc<LinearEso<2>>::Config{};
  config.observer = {.observer_bandwidth = 30, .input_gain = 8, .sample_time = 0.01};
  config.controller_bandwidth = 4;
  config.limits = {-3, 2.5, 60};
  const auto controller = Adrc<LinearEso<2>>::make(config).value();
  using Number = Recorder<Adrc<LinearEso<2>>>::Number;
  const auto moving = [](const RecordedObject& all) {
    return std::count(all.moves.begin(), all.moves.end(), true);
  };
  const auto predict = [](auto& o, const std::vector<Number>& in) {
    (void)o.observer().predict(in[0]);
    return std::vector<Number>{};
  };
  const auto update = [](auto& o, const std::vector<Number>& in) {
    return std::vector<Number>{o.update(in[0], in[1])};
  };
  Recorder one(controller);
  one.add(1, predict);
  Recorder both(controller);
  both.add(1, predict);
  both.add_step(2, update);
  const auto alone = one.record().value();
  const auto joined = both.record().value();
  // A prediction from zero, d too: z_3 stays a constant, and z_1, z_2 and u move.
  EXPECT_EQ(moving(alone), 3);
  // z, the innovation, u applied, asked, put out and held, two bounds.
  EXPECT_EQ(moving(joined), 10);
  EXPECT_GT(joined.calls[0][0].list.instructions.size(),
            alone.calls[0][0].list.instructions.size());
}

}  // namespace target_recorder_test
}  // namespace esokit_test
