/// @file
/// The calls that a type may offer, by name, and the invariants. A type joins by a line in a list
/// of observers.cpp, controllers.cpp or laws.cpp; a member with a new name by a line here.
#pragma once

#include <algorithm>
#include <esokit/adapter/guarded.hpp>
#include <esokit/control/control_loop.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/core/step_status.hpp>
#include <type_traits>

#include "fuzz/game.hpp"

namespace fuzz {

using esokit::has;
using esokit::is_finite;
using esokit::LoopMode;
using esokit::StepStatus;

template <class T>
concept SaysItsScalar = requires {
  typename T::scalar_type;
};

template <class T>
struct ScalarOf;
template <SaysItsScalar T>
struct ScalarOf<T> {
  using type = typename T::scalar_type;
};
// Laws that are no more than their template arguments.
template <template <class> class T, class S>
requires(!SaysItsScalar<T<S>>) struct ScalarOf<T<S>> {
  using type = S;
};
template <template <int, class> class T, int Order, class S>
requires(!SaysItsScalar<T<Order, S>>) struct ScalarOf<T<Order, S>> {
  using type = S;
  static constexpr int order = Order;
};

template <class T>
constexpr int order_of() {
  if constexpr (requires { T::order; }) {
    return T::order;
  } else if constexpr (requires { ScalarOf<T>::order; }) {
    return ScalarOf<T>::order;
  } else {
    return 1;
  }
}

/// `update` takes (r, r', ..) too. A concept: Clang 14 wants every parameter of a
/// requires-expression in a member to exist.
template <class T>
concept TakesReferences = requires(T& o, typename T::scalar_type s, typename T::Reference::All r) {
  o.update(s, r);
  o.update_without_measurement(r);
};

/// N of the observer, where an adapter or controller is around it.
template <class T>
struct Nonlinear {
  static constexpr int size =
      std::remove_cvref_t<decltype(std::declval<const T&>().observer())>::size;
};
template <class T>
requires requires { T::size; }
struct Nonlinear<T> {
  static constexpr int size = T::size;
};

template <class T>
class Driver final : public Game {
 public:
  using S = typename ScalarOf<T>::type;
  using Config = typename T::Config;

  static Failure run(Episode& episode) { return Driver(episode).play(); }

 private:
  explicit Driver(Episode& episode) : Game(episode, actions()) {}

  void fill() override {
    Filler<S> filler(episode_.config, order_of<T>(), chains());
    filler.fill(config_);
    promise_ = filler.promise;
  }
  bool make() override {
    const auto made = quietly([&] { return T::make(config_); });
    if (!made) {
      explained(made.error().field, made.error().rule);
      return false;
    }
    object_at_ = &object_.emplace(*made);
    size_ = sizeof(T);
    return true;
  }
  void copy() override { twin_at_ = &twin_.emplace(*object_); }
  void act(const Action& action) override { reinterpret_cast<Act>(action.act)(*this); }

  /// Lengths of a filter's chains.
  static std::vector<int> chains() {
    std::vector<int> lengths;
    if constexpr (requires(const T& o) { o.template chain_estimate<0>(); }) {
      esokit::detail::unroll<T::outputs>([&](auto i) {
        using Chain = decltype(std::declval<const T&>().template chain_estimate<i>());
        lengths.push_back(Chain::rows());
      });
    }
    return lengths;
  }

  /// The config that has a bandwidth.
  template <class C>
  static const auto& innermost(const C& config) {
    if constexpr (requires { config.observer; }) {
      return innermost(config.observer);
    } else if constexpr (requires { config.controller.observer; }) {
      return innermost(config.controller);
    } else {
      return config;
    }
  }

  /// How far a varying gain keeps from where a constant one rings undamped, 1 / (1 - c^N) with
  /// c = (1 + exp(-omega T)) / 2; one of a thousandth takes thousands of samples.
  [[nodiscard]] bool far_from_ringing() const override {
    if constexpr (requires { innermost(config_).gain_max; }) {
      const auto& nonlinear = innermost(config_);
      if (!nonlinear.gain_max) return true;
      const auto omega_T = static_cast<double>(nonlinear.observer_bandwidth) *
                           static_cast<double>(nonlinear.sample_time);
      constexpr int states = Nonlinear<T>::size;
      const double edge = 1 / (1 - std::pow((1 + std::exp(-omega_T)) / 2, states));
      return static_cast<double>(*nonlinear.gain_max) < 0.99 * edge;
    } else {
      return true;
    }
  }

  /// One call, without allocation.
  template <class Function>
  auto quietly(Function&& call) {
    const long before = allocations();
    if constexpr (std::is_void_v<decltype(call())>) {
      call();
      without_allocation(before);
    } else {
      auto result = call();
      without_allocation(before);
      return result;
    }
  }

  /// What must not change anything where it is refused.
  template <class Function>
  void refusable(Function&& call) {
    remember();
    const auto outcome = quietly(call);
    if constexpr (std::is_same_v<std::remove_const_t<decltype(outcome)>, StepStatus>) {
      answered(outcome == StepStatus::ok);
    } else {
      answered(static_cast<bool>(outcome));
      if constexpr (requires { outcome.error(); }) {
        if (!outcome) explained(outcome.error().field, outcome.error().rule);
      }
    }
  }

  /// The same of what `runs_on`: at rest, if it says when it is. On the way each call goes on.
  template <class Function>
  void refusable_at_rest(Function&& call) {
    if constexpr (requires { object_->moving(); }) {
      const bool moved = object_->moving();
      remember();
      accepted_ = quietly(call);
      if (!moved) return answered(accepted_);
      if (!changed()) fail("a move does not go on");
    } else {
      accepted_ = quietly(call);
    }
  }

  // ------------------------------------------------------------------ invariants of steps
  /// @param y null where none was given
  void stepped(StepStatus status, const S* y, const S* u) {
    Game::stepped(status, y == nullptr || is_finite(*y), u == nullptr || is_finite(*u));
  }

  /// A controller put out u; `from` is what was commanded before.
  void put_out(S u, S from) {
    elsewhere_ = false;
    if (!is_finite(u)) return fail("u is not finite");
    check_limits(of_loop().limits, u, from);
  }

  template <class L>
  void check_limits(const L& limits, S u, S from) {
    if (u < limits.lower || u > limits.upper) return fail("u is outside of its limits");
    if (from < limits.lower || from > limits.upper) return;
    const S step = limits.rate * step_time();
    if (limits.rate >= std::numeric_limits<S>::max() || !is_finite(step)) return;
    const S change = u - from;
    // Bounds are rounded sums.
    using std::abs;
    const S rounding = S(4) * std::numeric_limits<S>::epsilon() * (abs(u) + abs(from)) +
                       std::numeric_limits<S>::min();
    if (is_finite(change) &&
        abs(change) > step * (S(1) + S(8) * std::numeric_limits<S>::epsilon()) + rounding) {
      fail("u changes faster than its rate limit");
    }
  }

  /// The settings of the controller in a Resting, or of itself.
  [[nodiscard]] const auto& of_loop() const {
    if constexpr (requires { config_.controller; }) {
      return config_.controller;
    } else {
      return config_;
    }
  }
  [[nodiscard]] bool too_soon() const {
    if constexpr (requires { object_->too_soon(); }) {
      return object_->too_soon();
    } else {
      return false;
    }
  }

  [[nodiscard]] S step_time() const {
    if constexpr (requires(const T& o) { o.observer().step_time(); }) {
      return object_->observer().step_time();
    } else if constexpr (requires(const T& o) { o.observer().sample_time(); }) {
      return object_->observer().sample_time();
    } else {
      return config_time(config_);
    }
  }
  template <class C>
  static S config_time(const C& config) {
    if constexpr (requires { config.sample_time; }) {
      return config.sample_time;
    } else if constexpr (requires { config.observer; }) {
      return config_time(config.observer);
    } else if constexpr (requires { config.controller; }) {
      return config_time(config.controller);
    } else {
      return config_time(std::get<0>(config.observers));
    }
  }

  // ------------------------------------------------------------------ observables
  static bool fine(const S& x) { return is_finite(x); }
  template <int Rows, int Columns>
  static bool fine(const esokit::Matrix<S, Rows, Columns>& m) {
    for (int i = 0; i < m.size(); ++i) {
      if (!is_finite(m.data()[i])) return false;
    }
    return true;
  }
  template <std::size_t Count>
  static bool fine(const std::array<S, Count>& values) {
    for (const S& x : values) {
      if (!is_finite(x)) return false;
    }
    return true;
  }

  /// What is not, null where all is.
  template <class O>
  static const char* finite(const O& o, bool calm) {
// An observable by its name.
#define FINITE(member)                                    \
  if constexpr (requires { o.member; }) {                 \
    if (!fine(o.member)) return #member " is not finite"; \
  }
    FINITE(estimate())
    FINITE(total_disturbance())
    FINITE(innovation())
    FINITE(applied_input())
    FINITE(input_gain())
    FINITE(sample_time())
    FINITE(raw_estimate())
    FINITE(blanking())
    FINITE(residual_disturbance())
    FINITE(known_part())
    FINITE(step_time())
    FINITE(gain())
    FINITE(innovation_variance())
    FINITE(output())
    FINITE(requested())
    FINITE(compensation())
    FINITE(base_output())
    FINITE(blind_output())
    FINITE(value())
    FINITE(derivative())
    FINITE(motion())
    FINITE(state())
    FINITE(last())
    FINITE(gains())
    FINITE(softness())
    FINITE(covariance())
    FINITE(innovation_covariance())
    FINITE(normalised_innovation())
    if (calm) {
      FINITE(limit())
      FINITE(predictor_gain())
    }
#undef FINITE
    if constexpr (requires { o.level_estimate(0); }) {
      for (int level = 0; level < O::levels; ++level) {
        if (!fine(o.level_estimate(level))) return "level_estimate is not finite";
      }
    }
    if constexpr (requires { o.missed(); }) {
      if (o.missed() < 0 || o.missed() > 65535) return "missed() is no count";
    }
    return nullptr;
  }

  void invariants() override {
    if (const char* text = finite(*object_, calm_)) fail(text);
    if constexpr (requires(const T& o) { o.observer().missed(); }) {
      if (const char* text = finite(object_->observer(), calm_)) fail("observer", text);
    }
    if constexpr (requires(const T& o) { o.controller().output(); }) {
      if (const char* text = finite(object_->controller(), calm_)) fail("controller", text);
    }
    if constexpr (requires(const T& o) { o.template observer<0>(); }) {
      esokit::detail::unroll<T::channels>([&](auto i) {
        if (const char* text = finite(object_->template observer<i>(), calm_))
          fail("observer", text);
      });
    }
  }

  // ------------------------------------------------------------------ calls
  using Act = void (*)(Driver&);
  static void add(std::vector<Action>& a, const char* name, Act act) {
    add_action(a, name, reinterpret_cast<void (*)()>(act));
  }

  S number(const Range& range = signal) { return tape_->template number<S>(range); }
  template <class V>
  V vector() {
    V v;
    for (int i = 0; i < v.size(); ++i) v(i) = number();
    return v;
  }
  /// An estimate, of about the size that signals make it.
  template <class V>
  V state() {
    V v;
    for (int i = 0; i < v.size(); ++i) {
      double size = 1;
      for (int r = 1; r <= i % (order_of<T>() + 2); ++r) size *= r / promise_.sample_time;
      v(i) = number({-size, size});
    }
    return v;
  }

  [[nodiscard]] bool measurement_due() const {
    if constexpr (requires { of_loop().measurement_divider; })
      return of_loop().measurement_divider == 1;
    else
      return true;
  }

  /// Update of a controller. @param y measurement, null if none was given
  template <class Function>
  void control(const S* y, const S* u_applied, Function&& call) {
    S from = object_->output();
    // What the actuator reports is no command, unless something else commands it.
    if (elsewhere_ && u_applied != nullptr && is_finite(*u_applied)) from = *u_applied;
    soon_ = too_soon();
    if (soon_) {  // no sample
      remember();
      const S u = quietly(call);
      if (u_applied == nullptr && changed()) fail("too little time has passed, and it changes");
      // What something else commands may be outside the limits.
      const S kept = std::clamp(from, of_loop().limits.lower, of_loop().limits.upper);
      if (u < kept || u > kept || !same(u, object_->output()))
        fail("too little time has passed, and u changes");
      return;
    }
    elsewhere_ = false;
    const S u = quietly(call);
    put_out(u, from);
    if constexpr (requires(const T& o) { o.mode(); }) {
      if (measurement_due() && y != nullptr) stepped(object_->status(), y, nullptr);
      if constexpr (requires(T & o, S s) { o.prepare(s); }) {
        judge_next_mode();
      } else if constexpr (requires(const T& o) { o.observer().missed(); }) {
        judge_mode();
      }
    } else if constexpr (requires(const T& o) { o.form(); }) {
      stepped(object_->status(), y, nullptr);
    }
    if constexpr (requires(const T& o) { o.output(); }) {
      if (!(object_->output() >= u && object_->output() <= u))
        fail("output() is not what was put out");
    }
  }

  void judge_mode() {
    const int missed = object_->observer().missed();
    const auto& config = of_loop();
    const int divider = config.measurement_divider;
    const LoopMode mode = object_->mode();
    if (missed >= (config.missing.most + 1) * divider && mode != LoopMode::safe) {
      fail("too many measurements are missing, and the mode is not safe");
    }
    if (mode == LoopMode::safe && missed < divider && !config.missing.stay && measurement_due()) {
      fail("measurements are there, and the mode is safe");
    }
  }

  /// The same of a controller in two phases, of the next sample.
  void judge_next_mode() {
    const int missed = object_->observer().missed() - 1;
    if (missed > config_.missing.most && object_->mode() != LoopMode::safe) {
      fail("too many measurements are missing, and the next mode is not safe");
    }
    if (object_->mode() == LoopMode::safe && missed <= 0 && !config_.missing.stay) {
      fail("measurements are there, and the next mode is safe");
    }
  }

  static constexpr bool runs_on = [] {
    if constexpr (requires { T::runs_on; }) return T::runs_on;
    return false;
  }();
  /// The second number of an experiment's update is no reference.
  static constexpr bool reports_reference = requires(const T& o) {
    o.mode();
    o.requested();
  };
  static constexpr bool takes_applied_input = requires(const T& o) { o.rest_output(); };

  static const std::vector<Action>& actions() {
    static const std::vector<Action> list = [] {
      std::vector<Action> a;
      // An observer's.
      if constexpr (requires(T & o, S s) {
                      { o.update(s, s) } -> std::same_as<StepStatus>;
                    }) {
        for (int weight = 0; weight < 4; ++weight) {
          add(a, "update", [](Driver& d) {
            const S y = d.number(), u = d.number();
            d.stepped(d.quietly([&] { return d.object_->update(y, u); }), &y, &u);
          });
        }
        add(a, "predict", [](Driver& d) {
          const S u = d.number();
          d.stepped(d.quietly([&] { return d.object_->predict(u); }), nullptr, &u);
        });
        add(a, "predict several times", [](Driver& d) {
          const int count = d.tape_->choice(130);
          const S u = d.number();
          for (int i = 0; i < count; ++i) {
            d.stepped(d.quietly([&] { return d.object_->predict(u); }), nullptr, &u);
          }
        });
        add(a, "correct", [](Driver& d) {
          const S y = d.number();
          const auto before = d.object_->estimate();
          const StepStatus status = d.quietly([&] { return d.object_->correct(y); });
          d.stepped(status, &y, nullptr);
          if (status == StepStatus::measurement_rejected ||
              status == StepStatus::outlier_rejected) {
            // VariableTime takes the mean of the steps before it looks at y: that
            // rounds. WrappedOutput recentres: the same angle.
            constexpr bool another_number = requires(T & o, S s) { o.set_step_time(s); }
            || requires(T & o, S s) { o.wrap(s); };
            if (!another_number && d.object_->estimate() != before) {
              d.fail("rejected, but the estimate changed");
            }
          }
        });
        add(a, "reset(y)", [](Driver& d) {
          const S y = d.number();
          d.refusable([&] { return d.object_->reset(y); });
          if (!is_finite(y) && d.accepted_) d.fail("a bad y is taken");
          if (d.calm_ && d.tape_->plain() && !d.accepted_) d.fail("a good y is refused");
        });
        add(a, "reset(state)", [](Driver& d) {
          const auto z = d.template state<typename T::Estimate>();
          d.refusable([&] { return d.object_->reset(z); });
          if (!fine(z) && d.accepted_) d.fail("a bad state is taken");
        });
        add(a, "const members", [](Driver& d) {
          const S x = d.number();
          d.remember();
          d.quietly([&] { look(*d.object_, x); });
          if (d.changed()) d.fail("a const member changed something");
        });
      }
      if constexpr (requires(T & o, S s) { o.revise_input(s); }) {
        add(a, "revise_input", [](Driver& d) {
          const S u = d.number();
          d.refusable([&] { return d.object_->revise_input(u); });
        });
      }
      if constexpr (requires(T & o, S s) { o.update_weighted(s, s, s); }) {
        add(a, "update_weighted", [](Driver& d) {
          const S y = d.number(), u = d.number(), r = d.number({1e-3, 1, true});
          d.stepped(d.quietly([&] { return d.object_->update_weighted(y, u, r); }), &y, &u);
        });
      }
      if constexpr (requires(T & o, S s) { o.set_trust(s); }) {
        add(a, "set_trust", [](Driver& d) {
          const S phi = d.number({0, 1});
          const StepStatus said = d.quietly([&] { return d.object_->set_trust(phi); });
          if (is_finite(phi) != (said == StepStatus::ok)) d.fail("a bad trust is not reported");
        });
        add(a, "set_pin", [](Driver& d) {
          const int where = d.tape_->choice(4);
          d.quietly([&] { d.object_->set_pin(static_cast<esokit::Pin>(where)); });
        });
        add(a, "hold", [](Driver& d) {
          const S u = d.number();
          d.quietly([&] { return d.object_->hold(u); });
        });
        add(a, "release", [](Driver& d) { d.quietly([&] { d.object_->release(); }); });
      }
      if constexpr (requires(T & o, S s) { o.set_input_gain(s); }) {
        add(a, "set_input_gain", [](Driver& d) {
          const S b = config_gain(d.config_) * d.number({1e-2, 10, true});
          d.refusable([&] { return d.object_->set_input_gain(b); });
        });
      }
      if constexpr (requires(T & o) { o.rearm(); }) {
        add(a, "rearm", [](Driver& d) { d.quietly([&] { d.object_->rearm(); }); });
      }
      if constexpr (requires(T & o) { o.observer().rearm(); }) {
        add(a, "observer().rearm",
            [](Driver& d) { d.quietly([&] { d.object_->observer().rearm(); }); });
      }
      if constexpr (requires(T & o, S s) { o.shift_output(s); }) {
        add(a, "shift_output", [](Driver& d) {
          const S x = d.number();
          d.shift(x, [&] { d.object_->shift_output(x); });
        });
        add(a, "shift_disturbance", [](Driver& d) {
          const S x = d.number();
          d.shift(x, [&] { d.object_->shift_disturbance(x); });
        });
      }
      if constexpr (requires(T & o, S s) { o.fill_input(s); }) {
        add(a, "fill_input", [](Driver& d) {
          const S x = d.number();
          d.shift(x, [&] { d.object_->fill_input(x); });
        });
      }
      if constexpr (requires(T & o, S s) { o.measured(s); }) {
        for (int weight = 0; weight < 4; ++weight) {
          add(a, "measured", [](Driver& d) {
            const S w = d.number();
            d.quietly([&] { d.object_->measured(w); });
          });
        }
      }
      if constexpr (requires(T & o) { o.revise_measured(); }) {
        add(a, "revise_measured",
            [](Driver& d) { d.quietly([&] { d.object_->revise_measured(); }); });
        add(a, "settle_measured",
            [](Driver& d) { d.quietly([&] { d.object_->settle_measured(); }); });
      }
      if constexpr (requires(T & o, S s) { o.set_step_time(s); }) {
        add(a, "set_step_time", [](Driver& d) {
          const double t = d.promise_.sample_time;
          const S seconds = d.number({0.6 * t, 1.6 * t});
          d.refusable([&] { return d.object_->set_step_time(seconds); });
        });
      }
      if constexpr (requires(T & o, S s) { o.elapsed(s); }) {
        add(a, "elapsed", [](Driver& d) {
          const double t = d.promise_.sample_time;
          const bool is_long = d.tape_->once_in(4);
          const S seconds = d.number({0, is_long ? 100 * t : 2 * t});
          d.refusable([&] { return d.object_->elapsed(seconds); });
          if ((is_finite(seconds) && seconds >= S(0)) != d.accepted_ && d.calm_)
            d.fail("elapsed takes a bad time, or refuses one");
        });
      }
      // A controller's.
      if constexpr (!takes_applied_input && requires(T & o, S s) {
                      { o.update(s, s) } -> std::same_as<S>;
                      o.output();
                    }) {
        for (int weight = 0; weight < 4; ++weight) {
          add(a, "update(y, r)", [](Driver& d) {
            const S y = d.number(), r = d.number();
            d.control(&y, nullptr, [&] { return d.object_->update(y, r); });
            if constexpr (reports_reference) d.referred(is_finite(r));
          });
        }
      }
      if constexpr (requires(T & o, S s) {
                      { o.update(s, s) } -> std::same_as<S>;
                      o.applied(s);
                    }) {
        for (int weight = 0; weight < 2; ++weight) {
          add(a, "applied(u), update(y, r)", [](Driver& d) {
            const S y = d.number(), r = d.number(), u = d.number();
            d.control(&y, &u, [&] {
              d.object_->applied(u);
              return d.object_->update(y, r);
            });
            if constexpr (reports_reference) d.referred(is_finite(r));
          });
        }
      }
      if constexpr (requires(const Config& config) { config.rest.error; }) {
        add(a, "update at the reference", [](Driver& d) {
          const S r = d.number({-1, 1});
          for (int left = d.tape_->choice(120); left > 0; --left) {
            const bool rested = d.object_->mode() == LoopMode::rest;
            const S u = d.object_->output();
            d.control(&r, nullptr, [&] { return d.object_->update(r, r); });
            d.referred(is_finite(r));
            if (rested && d.object_->mode() == LoopMode::rest && !same(u, d.object_->output()))
              d.fail("it rests, and u changes");
          }
        });
      }
      if constexpr (TakesReferences<T>) {
        add(a, "update(y, references)", [](Driver& d) {
          const S y = d.number();
          const auto r = d.template state<typename T::Reference::All>();
          d.control(&y, nullptr, [&] { return d.object_->update(y, r); });
          d.referred_to(r);
        });
        add(a, "applied(u), update(y, references)", [](Driver& d) {
          const S y = d.number();
          const auto r = d.template state<typename T::Reference::All>();
          const S u = d.number();
          d.control(&y, &u, [&] {
            if (is_finite(u) == (d.object_->applied(u) != StepStatus::ok))
              d.fail("a bad u is taken");
            return d.object_->update(y, r);
          });
          d.referred_to(r);
        });
        add(a, "update_without_measurement(references)", [](Driver& d) {
          const auto r = d.template state<typename T::Reference::All>();
          d.control(nullptr, nullptr, [&] { return d.object_->update_without_measurement(r); });
          d.referred_to(r);
        });
      }
      if constexpr (requires(T & o, S s) { o.update_without_measurement(s); }) {
        add(a, "update_without_measurement several times", [](Driver& d) {
          const int count = 1 + d.tape_->choice(80);
          const S r = d.number();
          for (int i = 0; i < count; ++i) {
            d.control(nullptr, nullptr, [&] { return d.object_->update_without_measurement(r); });
            d.referred(is_finite(r));
          }
        });
      }
      if constexpr (requires(T & o, S s) { o.update_driven(s, s, s); }) {
        add(a, "update_driven", [](Driver& d) {
          const S y = d.number(), base = d.number(), drive = d.number();
          d.control(&y, nullptr, [&] { return d.object_->update_driven(y, base, drive); });
        });
      }
      if constexpr (requires(T & o, S s) { o.hold(s, s, s); }) {
        add(a, "hold", [](Driver& d) {
          const S y = d.number(), r = d.number(), u = d.number();
          d.tracked(d.quietly([&] { return d.object_->hold(y, r, u); }));
        });
      }
      if constexpr (requires(T & o, S s) { o.observer().set_trust(s); }) {
        add(a, "observer().set_trust", [](Driver& d) {
          const S phi = d.number({0, 1});
          d.quietly([&] { d.object_->observer().set_trust(phi); });
        });
        add(a, "observer().set_pin", [](Driver& d) {
          const int where = d.tape_->choice(4);
          d.quietly([&] { d.object_->observer().set_pin(static_cast<esokit::Pin>(where)); });
        });
      }
      if constexpr (requires(T & o, S s) { o.track(s, s, s); }) {
        add(a, "track", [](Driver& d) {
          const S y = d.number(), r = d.number(), u = d.number();
          d.tracked(d.quietly([&] { return d.object_->track(y, r, u); }));
        });
      } else if constexpr (requires(T & o, S s) {
                             o.track(s, s);
                             o.compensation();
                           }) {
        add(a, "track", [](Driver& d) {
          const S y = d.number(), u = d.number();
          d.tracked(d.quietly([&] { return d.object_->track(y, u); }));
        });
      }
      if constexpr (requires(T & o, S s) { o.start(s, s); }) {
        add(a, "start(y, u)", [](Driver& d) {
          const S y = d.number(), u = d.number();
          d.refusable([&] { return d.object_->start(y, u); });
          d.elsewhere_ = d.elsewhere_ || d.accepted_;
          if (!(is_finite(y) && is_finite(u)) && d.accepted_) d.fail("a bad start is taken");
        });
      }
      if constexpr (requires(T & o, S s) { o.start(s, s, s); }) {
        add(a, "start(y, u, r)", [](Driver& d) {
          const S y = d.number(), u = d.number(), r = d.number();
          d.refusable([&] { return d.object_->start(y, u, r); });
          d.elsewhere_ = d.elsewhere_ || d.accepted_;
          if (!(is_finite(y) && is_finite(u)) && d.accepted_) d.fail("a bad start is taken");
        });
      }
      if constexpr (requires(T & o, S s) {
                      o.control(s);
                      o.prepare(s);
                    })
        two_phases(a);
      if constexpr (
          requires { T::channels; } || requires { T::outputs; })
        several(a);
      // Any.
      add(a, "retune", [](Driver& d) {
        Config config{};
        Filler<S> filler(*d.tape_, order_of<T>(), chains());
        filler.fill(config);
        if constexpr (requires(T & o) { o.retune(config); }) {
          d.refusable([&] { return d.object_->retune(config); });
          if (d.accepted_) {
            d.config_ = config;
            // A sample time that stays: what is running goes on.
            filler.promise.waiting += d.promise_.waiting;
            d.promise_ = filler.promise;
          }
        } else {
          const auto made = d.quietly([&] { return T::make(config); });
          if (!made) d.explained(made.error().field, made.error().rule);
        }
      });
      if constexpr (requires(const T& o) {
                      esokit::snapshot(o);
                      typename T::scalar_type;
                    }) {
        add(a, "snapshot", [](Driver& d) {
          const auto words = esokit::snapshot(*d.object_);
          const auto restored = esokit::from_snapshot<T>(words);
          if (!restored) return d.fail("its own snapshot is refused");
          d.object_.emplace(*restored);
        });
      }
      law(a);
      return a;
    }();
    return list;
  }

  template <class Function>
  void shift(const S& x, Function&& call) {
    remember();
    quietly(call);
    if (!is_finite(x) && changed()) fail("a bad number changed something");
  }

  void tracked(S u) {
    if (!is_finite(u)) fail("u is not finite");
    elsewhere_ = true;
  }

  /// A reference that cannot be followed is reported at each sample.
  void referred(bool fine) {
    if (!fine && !soon_ && !has(object_->status(), StepStatus::reference_rejected)) {
      fail("a bad reference is not reported");
    }
  }
  template <class R>
  void referred_to(const R& r) {
    // The error-based form takes only the first.
    referred(is_finite(S(r(0))));
  }

  template <class O>
  static void look(const O& o, const S& x) {
    if constexpr (requires { o.wrap(x); }) (void)o.wrap(x);
    if constexpr (requires { o.accepts(x); }) (void)o.accepts(x);
    if constexpr (requires { o.gain_factor(x); }) (void)o.gain_factor(x);
    if constexpr (requires { o.correction_gain(x); }) (void)o.correction_gain(x);
    if constexpr (requires { o.preview(); }) (void)o.preview();
    if constexpr (requires { o.level_gain(0); }) (void)o.level_gain(0);
    if constexpr (requires { o.covariance(); }) (void)o.covariance();
    if constexpr (requires { o.predictor_gain(); }) (void)o.predictor_gain();
    if constexpr (requires { o.normalised_innovation(); }) (void)o.normalised_innovation();
    if constexpr (requires { o.level_estimate(0); }) {
      (void)o.level_estimate(-1);
      (void)o.level_estimate(1000);
    }
  }

  static void two_phases(std::vector<Action>& a) {
    for (int weight = 0; weight < 3; ++weight) {
      add(a, "control, prepare", [](Driver& d) {
        const S y = d.number(), r = d.number();
        const S from = d.object_->output();
        const S u = d.quietly([&] { return d.object_->control(y); });
        d.put_out(u, from);
        const StepStatus status = d.quietly([&] { return d.object_->prepare(r); });
        d.stepped(status, &y, nullptr);
        if (status != d.object_->status()) d.fail("status() is another one");
        d.referred(is_finite(r));
        d.judge_next_mode();
      });
    }
    add(a, "update", [](Driver& d) {
      const S y = d.number(), r = d.number();
      const S from = d.object_->output();
      d.put_out(d.quietly([&] { return d.object_->update(y, r); }), from);
    });
    add(a, "control_without_measurement, prepare several times", [](Driver& d) {
      const int count = 1 + d.tape_->choice(80);
      const S r = d.number();
      for (int i = 0; i < count; ++i) {
        const S from = d.object_->output();
        d.put_out(d.quietly([&] { return d.object_->control_without_measurement(); }), from);
        (void)d.object_->prepare(r);
        d.judge_next_mode();
      }
    });
    add(a, "control, applied, prepare(references)", [](Driver& d) {
      const S y = d.number(), u = d.number();
      const auto r = d.template state<typename T::Reference::All>();
      const S from = d.object_->output();
      d.put_out(d.quietly([&] { return d.object_->control(y); }), from);
      const StepStatus reported = d.quietly([&] { return d.object_->applied(u); });
      if (!is_finite(u) && !has(reported, StepStatus::input_rejected))
        d.fail("a bad u is not reported");
      d.stepped(d.quietly([&] { return d.object_->prepare(r); }), &y, nullptr);
    });
    add(a, "applied", [](Driver& d) {
      const S u = d.number();
      (void)d.quietly([&] { return d.object_->applied(u); });
    });
    add(a, "set_reference", [](Driver& d) {
      const S r = d.number();
      d.quietly([&] { d.object_->set_reference(r); });
    });
    add(a, "set_reference(references)", [](Driver& d) {
      const auto r = d.template state<typename T::Reference::All>();
      d.quietly([&] { d.object_->set_reference(r); });
    });
    add(a, "reset", [](Driver& d) {
      const S y = d.number();
      d.refusable([&] { return d.object_->reset(y); });
      if (d.accepted_) d.elsewhere_ = false;
    });
  }

  static void several(std::vector<Action>& a) {
    if constexpr (requires { T::channels; }) {
      using V = typename T::Output;
      add(a, "update", [](Driver& d) {
        const V y = d.template vector<V>(), r = d.template vector<V>();
        const V from = d.object_->output();
        d.elsewhere_ = false;
        d.all_out(y, d.quietly([&] { return d.object_->update(y, r); }), from);
        d.all_referred(r);
      });
      add(a, "update, reported", [](Driver& d) {
        const V y = d.template vector<V>(), r = d.template vector<V>(), u = d.template vector<V>();
        V from = d.object_->output();
        for (int i = 0; d.elsewhere_ && i < from.size(); ++i) {
          if (is_finite(u(i))) from(i) = u(i);
        }
        d.elsewhere_ = false;
        const StepStatus reported = d.quietly([&] { return d.object_->applied(u); });
        if (fine(u) == has(reported, StepStatus::input_rejected)) d.fail("a bad u is not reported");
        d.all_out(y, d.quietly([&] { return d.object_->update(y, r); }), from);
        d.all_referred(r);
      });
      add(a, "start", [](Driver& d) {
        const V y = d.template vector<V>(), u = d.template vector<V>();
        d.refusable([&] { return d.object_->start(y, u); });
        d.elsewhere_ = d.elsewhere_ || d.accepted_;
        if (!(fine(y) && fine(u)) && d.accepted_) d.fail("a bad start is taken");
      });
      add(a, "set_input_matrix", [](Driver& d) {
        auto b = d.config_.input_matrix;
        for (auto& x : b) x = x * d.number({0.5, 2});
        d.refusable([&] { return d.object_->set_input_matrix(b); });
      });
      if constexpr (requires(T & o, const V& v) { o.hold(v, v); }) {
        add(a, "hold", [](Driver& d) {
          const V y = d.template vector<V>(), u = d.template vector<V>();
          V from = d.object_->output();
          for (int i = 0; i < from.size(); ++i) {
            if (is_finite(u(i))) from(i) = u(i);
          }
          const V now = d.quietly([&] { return d.object_->hold(y, u); });
          d.elsewhere_ = true;
          for (int i = 0; i < from.size(); ++i) {
            if (now(i) < from(i) || now(i) > from(i)) d.fail("hold changes u");
          }
        });
      }
    } else {
      using Y = typename T::Output;
      using U = typename T::Input;
      for (int weight = 0; weight < 3; ++weight) {
        add(a, "update", [](Driver& d) {
          const Y y = d.template vector<Y>();
          const U u = d.template vector<U>();
          d.all_seen(d.quietly([&] { return d.object_->update(y, u); }), &y, &u);
        });
      }
      add(a, "predict several times", [](Driver& d) {
        const int count = 1 + d.tape_->choice(80);
        const U u = d.template vector<U>();
        for (int i = 0; i < count; ++i) {
          d.all_seen(d.quietly([&] { return d.object_->predict(u); }),
                     static_cast<const Y*>(nullptr), &u);
        }
      });
      add(a, "correct", [](Driver& d) {
        const Y y = d.template vector<Y>();
        d.all_seen(d.quietly([&] { return d.object_->correct(y); }), &y,
                   static_cast<const U*>(nullptr));
      });
      add(a, "correct, some missing", [](Driver& d) {
        Y y = d.template vector<Y>();
        for (int i = 0; i < T::outputs; ++i) {
          if (d.tape_->once_in(2)) y(i) = esokit_test::hidden_nan<S>();
        }
        (void)d.quietly([&] { return d.object_->correct(y); });
      });
      add(a, "reset(y)", [](Driver& d) {
        const Y y = d.template vector<Y>();
        d.refusable([&] { return d.object_->reset(y); });
        if (!fine(y) && d.accepted_) d.fail("a bad y is taken");
      });
      add(a, "reset(state)", [](Driver& d) {
        const auto z = d.template state<typename T::Estimate>();
        d.refusable([&] { return d.object_->reset(z); });
        if (!fine(z) && d.accepted_) d.fail("a bad state is taken");
      });
    }
  }

  template <class V>
  void all_referred(const V& r) {
    int missed = 0;
    bool stays = false;
    esokit::detail::unroll<T::channels>([&](auto i) {
      if (!is_finite(S(r(i))) && !has(object_->status(i), StepStatus::reference_rejected)) {
        fail("a bad reference is not reported");
      }
      const auto& rule = config_.missing[static_cast<std::size_t>(i)];
      const int lost = object_->template observer<i>().missed();
      missed = std::max(missed, lost);
      stays = stays || rule.stay;
      if (lost > rule.most && object_->mode() != LoopMode::safe) {
        fail("too many measurements are missing, and the mode is not safe");
      }
    });
    if (missed == 0 && !stays && object_->mode() == LoopMode::safe) {
      fail("measurements are there, and the mode is safe");
    }
  }
  template <class V>
  void all_out(const V& y, const V& u, const V& from) {
    for (int i = 0; i < u.size(); ++i) {
      if (!is_finite(u(i))) return fail("u is not finite");
      check_limits(config_.limits[static_cast<std::size_t>(i)], u(i), from(i));
      const S each = y(i);
      stepped(object_->status(i), &each, nullptr);
    }
  }
  template <class Y, class U>
  void all_seen(StepStatus status, const Y* y, const U* u) {
    const S good(0);
    const S bad = esokit_test::hidden_nan<S>();
    stepped(status, y == nullptr || fine(*y) ? &good : &bad,
            u == nullptr || fine(*u) ? &good : &bad);
  }

  // Differentiators and limiters.
  /// An experiment.
  template <class Function>
  void moves(Function&& call) {
    const S from = object_->output();
    const S u = quietly(call);
    check_limits(config_.limits, u, from);
    moved(u);
  }
  void moved(S u) {
    const S low = config_.input - config_.amplitude, high = config_.input + config_.amplitude;
    const bool at_once = !(config_.limits.rate < esokit::Limits<S>{}.rate);
    if (!is_finite(u)) fail("u is not finite");
    const bool aborted = object_->phase() == esokit::ExperimentPhase::aborted;
    const S end = aborted ? config_.safe_input.value_or(config_.input) : config_.input;
    if (config_.approach) {
      if (u < config_.limits.lower || u > config_.limits.upper) fail("u is beyond its limits");
    } else if (at_once && !same(u, config_.input) && !same(u, low) && !same(u, high) &&
               !same(u, end)) {
      fail("u is another one");
    }
    if (!same(u, object_->output())) fail("output() is not what was put out");
    if (at_once && object_->finished() && !same(u, end)) fail("finished, and not at rest");
    if (aborted != (object_->reason() != esokit::AbortReason::none)) fail("no reason");
    const auto found = quietly([&] { return object_->result(); });
    if (!found) {
      explained(found.error().field, found.error().rule);
    } else if (!is_finite(found->input_gain) || !is_finite(found->latency)) {
      fail("the result is not finite");
    }
  }
  static bool same(S a, S b) { return !(a < b) && !(b < a); }

  static void law(std::vector<Action>& a) {
    if constexpr (requires(const T& o) { o.rest_output(); }) {
      for (int weight = 0; weight < 4; ++weight) {
        add(a, "update", [](Driver& d) {
          const S y = d.number();
          d.moves([&] { return d.object_->update(y); });
        });
        add(a, "update to and fro", [](Driver& d) {
          const S one = d.number({-1, 1}), other = d.number({-1, 1});
          const int half = 1 + d.tape_->choice(40), count = d.tape_->choice(1000);
          for (int i = 0; i < count; ++i) {
            const S y = i / half % 2 == 0 ? one : other;
            d.moves([&] { return d.object_->update(y); });
          }
        });
      }
      add(a, "update(y, u)", [](Driver& d) {
        const S y = d.number(), u = d.number();
        d.moves([&] { return d.object_->update(y, u); });
      });
      add(a, "stop", [](Driver& d) {
        if (d.tape_->choice(8) != 0) return;
        d.moves([&] { return d.object_->stop(); });
        if (!d.object_->finished()) d.fail("stopped, and not finished");
      });
    }
    if constexpr (requires(T & o, S s) {
                    o.begins();
                    o.applied();
                  }) {
      add(a, "update", [](Driver& d) {
        const S u = d.number();
        const bool begins = d.object_->begins();
        const bool is_on = d.quietly([&] { return d.object_->update(u); });
        if (begins && !is_finite(u) && is_on) d.fail("on by a bad u");
        const S low = std::min(d.config_.off, d.config_.on);
        const S high = std::max(d.config_.off, d.config_.on);
        if (!(low <= d.object_->applied() && d.object_->applied() <= high))
          d.fail("more than on, or less than off");
      });
    } else if constexpr (requires(T & o, S s) {
                           { o.update(s) } -> std::same_as<bool>;
                         }) {
      for (int weight = 0; weight < 4; ++weight) {
        add(a, "update", [](Driver& d) {
          const S r = d.number();
          if constexpr (runs_on) {
            d.refusable_at_rest([&] { return d.object_->update(r); });
          } else {
            d.refusable([&] { return d.object_->update(r); });
          }
          if (!is_finite(r) && d.accepted_) d.fail("a bad reference is taken");
          if (d.calm_ && d.tape_->plain() && !d.accepted_) d.fail("a good reference is refused");
        });
      }
      if constexpr (requires(T & o, S s) { o.reset(s); }) {
        add(a, "reset", [](Driver& d) {
          const S r = d.number();
          d.refusable([&] { return d.object_->reset(r); });
          if (is_finite(r) != d.accepted_)
            d.fail("reset takes what is not finite, or refuses what is");
        });
      } else if constexpr (requires(T & o, S s) {
                             o.motion();
                             o.start(s, s);
                           }) {
        add(a, "start", [](Driver& d) {
          const S y = d.number(), u = d.number();
          d.refusable([&] { return d.object_->start(y, u); });
          if (d.accepted_ && !(is_finite(y) && is_finite(u)))
            d.fail("start takes what is not finite");
        });
        if constexpr (requires(T & o) { o.wait(); }) {
          add(a, "update at a speed", [](Driver& d) {
            const S r = d.number(), speed = d.number();
            (void)d.quietly([&] { return d.object_->update({r, speed}); });
          });
          add(a, "wait", [](Driver& d) { d.quietly([&] { d.object_->wait(); }); });
        }
      }
    }
    if constexpr (requires(const T& o, const esokit::Vector<S, order_of<T>() + 1>& z,
                           const esokit::Vector<S, order_of<T>()>& r) {
                    o.control(z, r);
                    o.feedback(z, r);
                  }) {
      add(a, "control", [](Driver& d) {
        const auto z = d.template state<esokit::Vector<S, order_of<T>() + 1>>();
        const auto r = d.template state<esokit::Vector<S, order_of<T>()>>();
        const S u = d.quietly([&] { return d.object_->control(z, r); });
        if (fine(z) && fine(r) && !is_finite(u)) d.fail("u is not finite");
      });
    }
  }

  // ------------------------------------------------------------------ the way back
  /// Good samples of a plant at rest.
  void recover() override {
    if constexpr (requires { object_->set_step_time(S(1)); }) {
      (void)object_->set_step_time(config_time(config_));  // also what `elapsed` keeps is over
    } else if constexpr (requires { object_->elapsed(S(1)); }) {
      (void)object_->elapsed(config_time(config_));
    }
    if constexpr (
        requires { T::channels; } || requires { T::outputs; }) {
      recover_several();
    } else if constexpr (
        requires(const T& o) { o.controller(); } && !requires(const T& o) { o.mode(); }) {
      // Its controller has been looked at.
    } else if constexpr (requires(T & o, S s) {
                           { o.update(s, s) } -> std::same_as<StepStatus>;
                         }) {
      if constexpr (requires { object_->set_trust(S(1)); }) {
        object_->set_trust(S(1));
        object_->set_pin(esokit::Pin::free);
        object_->release();
      }
      settle([&](const S& y) { return object_->update(y, S(0)); },
             [&](const S& y) { return distance(*object_, y); });
    } else if constexpr (requires(T & o, S s) {
                           o.control(s);
                           o.prepare(s);
                         }) {
      settle(
          [&](const S& y) {
            (void)object_->control(y);
            (void)object_->applied(S(0));
            return object_->prepare(y);
          },
          [&](const S& y) { return distance(object_->observer(), y); });
    } else if constexpr (requires(const T& o) {
                           o.mode();
                           o.observer().missed();
                         }) {
      if (promise_.stays_safe) (void)object_->start(S(1), S(0));
      if constexpr (requires { object_->observer().set_trust(S(1)); }) {
        object_->observer().set_trust(S(1));
        object_->observer().set_pin(esokit::Pin::free);
      }
      settle(
          [&](const S& y) {
            object_->applied(S(0));
            (void)object_->update(y, y);
            const LoopMode mode = object_->mode();
            return mode == LoopMode::running || mode == LoopMode::rest
                       ? object_->status()
                       : StepStatus::prediction_dropped;
          },
          [&](const S& y) {
            // The error-based form is fed r - y.
            if constexpr (requires { object_->track(y, y, y); }) {
              const bool by_error = object_->observer().input_gain() * config_gain(config_) < S(0);
              return distance(object_->observer(), by_error ? S(0) : y);
            } else {
              return distance(object_->observer(), y);
            }
          });
    }
  }

  template <class C>
  static S config_gain(const C& config) {
    if constexpr (requires { config.input_gain; }) {
      return config.input_gain;
    } else if constexpr (requires { config.controller; }) {
      return config_gain(config.controller);
    } else {
      return config_gain(config.observer);
    }
  }

  /// Largest error of the estimate of a plant at rest at y, each row in the unit of y.
  template <class O>
  static double distance(const O& observer, const S& y) {
    const auto z = observer.estimate();
    const auto rest = observer.equilibrium(y, S(0));
    double worst = 0;
    double unit = 1;
    for (int r = 0; r < O::size; ++r) {
      if (r > 0) unit *= static_cast<double>(observer.sample_time()) / r;
      double error = static_cast<double>(z(r)) - static_cast<double>(rest(r));
      if constexpr (requires { observer.wrap(y); }) {
        if (r == 0) error = static_cast<double>(observer.wrap(static_cast<S>(error)));
      }
      worst = std::max(worst, std::abs(error) * unit);
    }
    return worst;
  }

  template <class Step, class Distance>
  void settle(Step&& step, Distance&& distance) {
    const S y(1.25);
    set_out(std::is_same_v<S, float> ? 3e-3 : 1e-5, std::numeric_limits<S>::max_exponent10);
    StepStatus status{};
    do {
      status = step(y);
      invariants();
    } while (!back(status, distance(y)));
  }

  void recover_several() {
    if constexpr (requires { T::channels; }) {
      using V = typename T::Output;
      settle(
          [&](const S& y) {
            const V all = V::Constant(y);
            object_->applied(V::Zero());
            (void)object_->update(all, all);
            StepStatus status = StepStatus::ok;
            for (int i = 0; i < T::channels; ++i) status |= object_->status(i);
            return status;
          },
          [&](const S& y) {
            double worst = 0;
            esokit::detail::unroll<T::channels>([&](auto i) {
              worst = std::max(worst, distance(object_->template observer<i>(), y));
            });
            return worst;
          });
    } else {
      settle([&](const S& y) { return object_->update(T::Output::Constant(y), T::Input::Zero()); },
             [&](const S& y) {
               double worst = 0;
               esokit::detail::unroll<T::outputs>([&](auto i) {
                 const auto z = object_->template chain_estimate<i>();
                 double unit = 1;
                 for (int r = 0; r < z.size(); ++r) {
                   if (r > 0) unit *= static_cast<double>(object_->sample_time()) / r;
                   const double error =
                       static_cast<double>(z(r)) - (r == 0 ? static_cast<double>(y) : 0.0);
                   worst = std::max(worst, std::abs(error) * unit);
                 }
               });
               return worst;
             });
    }
  }

  Config config_{};
  bool elsewhere_ = false;  ///< u is commanded by something else
  bool soon_ = false;       ///< too little time has passed for a sample
  std::optional<T> object_{};
  std::optional<T> twin_{};
};

}  // namespace fuzz

/// A line of a list, by the type's name.
#define KIND(...) add_kind(kinds, #__VA_ARGS__, &Driver<__VA_ARGS__>::run)
