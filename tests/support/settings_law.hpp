/// @file
/// The law of settings: what was made with one config and then got another, by `retune` or by
/// `adopt`, does from its next start what was made with that one. Each setting of each config is
/// changed alone, so that one that `adopt` forgets is seen.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <esokit/adapter/guarded.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "members.hpp"
#include "numbers.hpp"

namespace esokit_test::settings {

/// What a member answered, as bits, so that NaN is equal to NaN.
using Played = std::vector<std::uint64_t>;

template <class T>
void put(Played& out, const T& value) {
  if constexpr (std::is_floating_point_v<T>) {
    out.push_back(std::bit_cast<std::uint64_t>(static_cast<double>(value)));
  } else if constexpr (requires { value.size(); }) {
    for (decltype(value.size()) i = 0; i < value.size(); ++i) put(out, value.data()[i]);
  } else if constexpr (requires {
                         static_cast<bool>(value);
                         value.has_value();
                       }) {
    put(out, value.has_value());
  } else {
    out.push_back(static_cast<std::uint64_t>(value));
  }
}

/// What every call may be given: usual numbers, and now and then what no sensor should give.
class Signals {
 public:
  explicit Signals(std::uint64_t seed) : random(seed) {}

  /// Of a plant that moves, with runs of lost samples, outliers and jumps.
  template <class S>
  S y() {
    if (lost > 0) {
      --lost;
      return std::numeric_limits<S>::quiet_NaN();
    }
    constexpr int runs[] = {1, 3, 12, 130};
    if (random.index(25) == 0) lost = runs[random.index(4)];
    if (random.index(150) == 0) base = random.uniform(-9, 9);
    position += 0.02 * random.uniform(-1, 1.1);
    return static_cast<S>(base + position + (random.index(12) == 0 ? 4 : 0));
  }
  template <class S>
  S u() {
    return static_cast<S>(random.uniform(-2, 2));
  }

  Random random;
  int lost = 0;
  double base = 0, position = 0;
};

/// What every type has, by name.
template <class Config>
void fill(Config& config) {
  if constexpr (requires { config.observer; }) fill(config.observer);
  if constexpr (requires { config.controller; }) fill(config.controller);
  if constexpr (requires { config.rest.error; }) config.rest = {.error = 3, .time = 0.03};
  if constexpr (requires { config.observers; }) {
    std::apply([](auto&... each) { ((fill(each), each.input_gain = 0), ...); }, config.observers);
    config.controller_bandwidths.fill(4);
    config.input_matrix = {{2, 0.25}, {0.5, -1}};
    for (auto& limits : config.limits) limits = {-3, 2.5, 150};
    for (auto& missing : config.missing) missing = {.most = 8, .input = 1};
  }
  if constexpr (requires { config.sample_time; }) {
    config.sample_time = 0.0078125;
    config.input_gain = 2;
  }
  if constexpr (requires { config.observer_bandwidth = 30; }) config.observer_bandwidth = 30;
  if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth = 5;
  if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = 1.5;
  if constexpr (requires { config.limits.rate; }) config.limits = {-3, 2.5, 150};
  if constexpr (requires { config.max_gap; }) config.max_gap = 20;
  if constexpr (requires { config.missing.most; }) config.missing = {.most = 8, .input = 1};
  if constexpr (requires { config.start_hold.input; }) {
    config.start_hold = {.time = 0.1, .input = 0.5};
  } else if constexpr (requires { config.start_hold; }) {
    config.start_hold = 0.1;
  }
  if constexpr (requires { config.threshold; }) {
    config.threshold = 0.75;
    config.running_factor = 3;
  }
  if constexpr (requires { config.period; }) config.period = 6;
  if constexpr (requires { config.ratio; }) config.ratio = 3;
  if constexpr (requires { config.delay; }) config.delay = 2;
  if constexpr (requires { config.curve.points; }) {
    config.curve = {.input = {-1, 0.25, 1},
                    .effect = {-0.75, 0.125, 1.25},
                    .points = 3,
                    .slope_below = 0.875,
                    .slope_above = 1.125};
  }
  if constexpr (requires { config.most_lost; }) {
    config.inputs.fill({.gain = 3, .lag = 0.05, .dead_time = 0.02});
    config.most_lost = 2;
  }
  if constexpr (requires { config.leak_time; }) {
    config.leak_time = 2;
    config.disturbance_bound = 3;
    config.release_samples = 3;
  }
  if constexpr (requires { config.model.coefficient; }) config.model.coefficient = 3;
}

#define ESOKIT_ANSWER(name) \
  if constexpr (requires { o.name(); }) put(out, o.name());

/// The calls and answers of an observer, by name; a member with a new name joins by a line.
template <class O>
void step_observer(O& o, Signals& in, Played& out) {
  using S = typename O::scalar_type;
  if constexpr (requires { o.measured(S(0)); }) {
    if (in.random.index(8) > 1) o.measured(in.u<S>());
    if (in.random.index(9) == 0) o.revise_measured();
    if (in.random.index(99) == 0) o.settle_measured();
  }
  [[maybe_unused]] const S T = o.sample_time();
  const int what = in.random.index(24);
  if constexpr (requires { o.set_step_time(T); }) {
    constexpr double lengths[] = {1, 1, 1.3, 0.6, 2.2, 4.5, 0.22};
    if (in.random.index(3) == 0) {
      put(out, o.set_step_time(T * static_cast<S>(lengths[in.random.index(7)])).has_value());
    }
    if (in.random.index(9) == 0) {
      const auto steps = o.elapsed(T * static_cast<S>(in.random.uniform(0, 12)));
      for (int i = 0; i < steps.value_or(0); ++i) put(out, o.predict(in.u<S>()));
    }
  }
  if constexpr (requires { o.set_trust(T); }) {
    if (what == 1) o.set_trust(static_cast<S>(in.random.uniform(0, 1)));
    if (what == 2) o.set_trust(S(1));
    if (what == 3) o.set_pin(static_cast<esokit::Pin>(in.random.index(4)));
    if (what == 4 || what == 5) o.set_pin(esokit::Pin::free);
    if (what == 6) put(out, o.hold(in.u<S>()));
    if (what == 7 || what == 8) o.release();
  }
  if constexpr (requires { o.set_input_gain(T); }) {
    if (what == 9) {
      const S b = o.input_gain() * static_cast<S>(in.random.uniform(0.5, 2));
      put(out, o.set_input_gain(b).has_value());
    }
  }
  if constexpr (requires { o.fill_input(T); }) {
    if (what == 10) o.fill_input(in.u<S>());
  }
  if constexpr (requires { o.rearm(); }) {
    if (what == 11) o.rearm();
  }
  if (what == 12) {
    put(out, o.predict(in.u<S>()));
  } else if (what == 13 && in.random.index(6) == 0) {
    put(out, o.reset(in.u<S>()));
  } else {
    const S y = in.y<S>();
    put(out, o.update(y, in.u<S>()));
  }
  put(out, o.estimate());
  put(out, o.total_disturbance());
  put(out, o.missed());
  put(out, o.max_gap());
  put(out, o.input_gain());
  put(out, o.equilibrium(S(1), S(2)));
  ESOKIT_ANSWER(restarts)
  ESOKIT_ANSWER(innovation)
  if constexpr (requires { o.map(); }) {
    const S u = in.u<S>();
    put(out, o.effect_of(u));
    put(out, o.input_for(u));
  }
  ESOKIT_ANSWER(gated)
  ESOKIT_ANSWER(bounded)
  ESOKIT_ANSWER(present_input_gain)
  ESOKIT_ANSWER(open)
  ESOKIT_ANSWER(period)
  ESOKIT_ANSWER(known_part)
  ESOKIT_ANSWER(gain_min)
  ESOKIT_ANSWER(gain_max)
  ESOKIT_ANSWER(blanking)
}

template <class C>
void step_controller(C& o, Signals& in, Played& out) {
  using S = typename C::scalar_type;
  const int what = in.random.index(24);
  const auto y = [&] {
    if constexpr (requires { C::channels; }) {
      typename C::Output all;
      for (int i = 0; i < C::channels; ++i) all[i] = in.y<S>();
      return all;
    } else {
      return in.y<S>();
    }
  };
  const auto u = [&] {
    if constexpr (requires { C::channels; }) {
      typename C::Output all;
      for (int i = 0; i < C::channels; ++i) all[i] = in.u<S>();
      return all;
    } else {
      return in.u<S>();
    }
  };
  // One that stands lets a controller rest.
  const auto r = [&] {
    if constexpr (requires(const typename C::Config& config) { config.rest.error; }) {
      return in.random.index(50) == 0 ? in.u<S>() : S(0);
    } else {
      return u();
    }
  };
  if constexpr (requires { o.set_step_time(in.u<S>()); }) {
    constexpr double lengths[] = {1, 1, 1.3, 0.6, 2.2, 4.5, 0.22};
    if (in.random.index(3) == 0) {
      const S length = o.sample_time() * static_cast<S>(lengths[in.random.index(7)]);
      put(out, o.set_step_time(length).has_value());
    }
    if (in.random.index(9) == 0) {
      put(out, o.elapsed(o.sample_time() * static_cast<S>(in.random.uniform(0, 12))).has_value());
    }
  }
  if constexpr (requires { o.measured(in.u<S>()); }) {
    if (in.random.index(8) > 1) o.measured(in.u<S>());
  }
  if constexpr (requires { o.hold(y(), y(), u()); }) {
    if (what == 1) put(out, o.hold(y(), y(), u()));
  }
  if constexpr (requires { o.track(y(), y(), u()); }) {
    if (what == 2) put(out, o.track(y(), y(), u()));
  }
  if constexpr (requires { o.set_input_gain(in.u<S>()); }) {
    if (what == 3) put(out, o.set_input_gain(in.u<S>()).has_value());
  }
  if constexpr (requires { o.set_input_matrix(o.input_matrix()); }) {
    if (what == 4) {
      auto b = o.input_matrix();
      // Up to one that is nearly singular.
      b(0, 1) = b(0, 0) * b(1, 1) / b(1, 0) * static_cast<S>(1 - in.random.log_uniform(1e-4, 1));
      put(out, o.set_input_matrix(b).has_value());
    }
  }
  if constexpr (requires { o.observer().set_pin(esokit::Pin::free); }) {
    if (what == 8) o.observer().set_pin(static_cast<esokit::Pin>(in.random.index(4)));
    if (what == 9) o.observer().set_pin(esokit::Pin::free);
  }
  if constexpr (requires { o.reset(in.u<S>()); }) {
    if (what == 10 && in.random.index(4) == 0) put(out, o.reset(in.u<S>()));
  }
  if (what == 5 && in.random.index(4) == 0) {
    if constexpr (requires { o.start(y(), u()); }) put(out, o.start(y(), u()));
  } else if constexpr (requires { o.prepare(in.u<S>()); }) {
    put(out, what == 6 ? o.control_without_measurement() : o.control(y()));
    if (what == 7) put(out, o.applied(u()));
    put(out, o.prepare(in.u<S>()));
  } else if (what < 12) {
    const auto measured = y();
    const auto reference = r();
    if constexpr (requires { o.applied(u()); }) o.applied(u());
    put(out, o.update(measured, reference));
  } else {
    const auto measured = y();
    put(out, o.update(measured, r()));
  }
  ESOKIT_ANSWER(output)
  ESOKIT_ANSWER(requested)
  if (what != 5) {  // that of the last sample; a start is none
    ESOKIT_ANSWER(status)
  }
  ESOKIT_ANSWER(gains)
  if constexpr (requires { o.mode(); }) put(out, static_cast<int>(o.mode()));
  if constexpr (requires { o.observer().estimate(); }) {
    put(out, o.observer().estimate());
    put(out, o.observer().missed());
    put(out, o.observer().max_gap());
  }
  if constexpr (requires { o.controller(); }) put(out, o.controller().observer().max_gap());
  if constexpr (requires { C::channels; }) {
    esokit::detail::unroll<C::channels>([&](auto i) {
      put(out, o.template observer<i>().estimate());
      put(out, o.template observer<i>().max_gap());
    });
  }
}
#undef ESOKIT_ANSWER

/// What no start changes, because it is told from outside.
template <class O>
void let_go([[maybe_unused]] O& o) {
  using S = typename O::scalar_type;
  if constexpr (requires { o.set_pin(esokit::Pin::free); }) {
    o.set_trust(S(1));
    o.set_pin(esokit::Pin::free);
    o.release();
    EXPECT_TRUE(o.set_input_gain(o.input_gain()).has_value());
    // A pin's release is over, and the last input is one of this b0.
    for (int k = 0; k < 16; ++k) (void)o.update(S(0), S(0));
  }
  if constexpr (requires { o.fill_input(S(0)); }) o.fill_input(S(0));
  if constexpr (requires { o.settle_measured(); }) {
    o.measured(S(0));
    (void)o.predict(S(0));
    o.settle_measured();
  }
}

/// What calls are played: so many, after a start or not. The seed says which.
struct Calls {
  std::uint64_t seed;
  bool start = true;
};

template <class T>
Played play(T& object, const Calls& calls) {
  using S = typename T::scalar_type;
  Signals in(calls.seed);
  Played out;
  if constexpr (requires { object.observer().set_pin(esokit::Pin::free); }) {
    let_go(object.observer());
  } else {
    let_go(object);
  }
  if (!calls.start) {
  } else if constexpr (requires { T::channels; }) {
    put(out, object.start(typename T::Output{}, typename T::Output{}));
  } else if constexpr (requires { object.start(S(0), S(0)); }) {
    put(out, object.start(S(0.25), S(0.5)));
  } else {
    put(out, object.reset(S(0.25)));
  }
  for (int k = 0; k < 500; ++k) {
    if constexpr (requires { object.equilibrium(S(0), S(0)); }) {
      step_observer(object, in, out);
    } else {
      step_controller(object, in, out);
    }
  }
  return out;
}

/// A type without its type, for one base config: what its settings do.
struct Subject {
  int settings = 0;
  /// Of a change: whether make takes it, whether that is seen, and whether it is adopted.
  struct Outcome {
    bool taken = false, seen = false, refused = false;
    bool kept = true;   ///< a refused retune changed nothing
    bool told = true;   ///< by `retune`
    bool given = true;  ///< by `adopt`
    bool worn = true;   ///< by `retune` of one that had run before
  };
  std::function<std::optional<Outcome>(int setting, int kind, const Calls&)> change;
};

/// @param starts_anew nothing outlives a start
template <class T>
Subject subject(const typename T::Config& config, bool starts_anew = true) {
  const auto change = [config, starts_anew](int setting, int kind,
                                            const Calls& calls) -> std::optional<Subject::Outcome> {
    auto other = config;
    if (!Change(setting, kind)(other)) return std::nullopt;
    Subject::Outcome out;
    const auto fresh = T::make(other);
    out.taken = fresh.has_value();
    if (!out.taken) return out;
    const auto first = T::make(config).value();
    const auto played = [&calls](T object) { return play(object, calls); };
    const Played wanted = played(*fresh);
    const Played before = played(first);
    out.seen = wanted != before;
    T told = first;
    out.refused = !told.retune(other).has_value();
    if (out.refused) {
      out.kept = played(told) == before;
      return out;
    }
    out.told = played(told) == wanted;
    if (calls.start && starts_anew) {
      T worn = first;
      play(worn, {calls.seed + 100});
      out.worn = !worn.retune(other) || played(worn) == wanted;
    }
    if constexpr (requires { told.adopt(*fresh); }) {
      T given = first;
      out.given = given.adopt(*fresh).has_value() && played(given) == wanted;
    }
    return out;
  };
  return {Change::settings(config), change};
}

/// Of each setting, for at least one of the base configs: some change is taken by `make`, seen in
/// what is answered, and adopted. @param unseen settings that only say what is accepted
inline void every_setting_is_adopted(const char* name, const std::vector<Subject>& bases,
                                     std::vector<int> unseen = {}) {
  SCOPED_TRACE(name);
  constexpr int kinds = 12;
  for (int setting = 0; setting < bases.front().settings; ++setting) {
    SCOPED_TRACE("setting " + std::to_string(setting));
    bool taken = false, seen = false, adopted = false;
    const bool hidden = std::find(unseen.begin(), unseen.end(), setting) != unseen.end();
    // Where a start hides it, without one.
    for (const bool start : {true, false}) {
      if (!start && (hidden || seen)) continue;
      for (int i = 0; i < kinds * static_cast<int>(bases.size()) && !adopted; ++i) {
        const int kind = i % kinds;
        const auto outcome = bases[static_cast<std::size_t>(i / kinds)].change(
            setting, kind, {static_cast<std::uint64_t>(i) + 1, start});
        if (!outcome) continue;
        taken = taken || outcome->taken;
        seen = seen || outcome->seen;
        adopted = adopted || (outcome->seen && !outcome->refused);
        EXPECT_TRUE(outcome->kept) << "a refused retune changed it, kind " << kind;
        EXPECT_TRUE(outcome->told) << "retune forgot it, kind " << kind;
        EXPECT_TRUE(outcome->given) << "adopt forgot it, kind " << kind;
        EXPECT_TRUE(outcome->worn) << "worn forgot it, kind " << kind;
      }
    }
    // Whole numbers at their ends: refused or taken, without an overflow.
    for (const int kind : {4, 5}) {
      const auto outcome = bases.front().change(setting, kind, {1});
      EXPECT_TRUE(!outcome || (outcome->kept && outcome->told && outcome->given)) << kind;
    }
    EXPECT_TRUE(taken || hidden) << "no change is taken";
    EXPECT_NE(seen, hidden) << (hidden ? "is seen" : "is not seen");
    EXPECT_TRUE(adopted || hidden) << "is not adopted";
  }
}

}  // namespace esokit_test::settings
