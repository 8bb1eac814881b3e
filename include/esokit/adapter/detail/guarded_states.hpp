/// @file
/// What guards do to the states of an observer inside adapters, see Guarded.
#pragma once

#include <cmath>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/gain/certificate/gating_certificate.hpp>
#include <esokit/model/detail/observable_part.hpp>
#include <esokit/model/disturbance_constant.hpp>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

namespace esokit {

namespace detail {

struct GuardAccess {
  /// The observer inside all adapters.
  template <class O>
  static constexpr auto& innermost(O& o) noexcept {
    using Plain = std::remove_const_t<O>;
    if constexpr (observer_traits<Plain>.adapts) {
      using Base = Adapter<typename Plain::Adapted>;
      using Same = std::conditional_t<std::is_const_v<O>, const Base, Base>;
      return innermost(static_cast<Same&>(o).observer_);
    } else {
      return o;
    }
  }
  /// What is due after a long gap is proven for corrections that count in full.
  template <class O>
  static constexpr void restart_after_long_gaps(O& o) noexcept {
    innermost(o).longest_gap_ = innermost(o).max_gap_;
  }
  /// The scaled states of the observer, level by level.
  template <class O>
  static constexpr auto& states(O& o) noexcept {
    return innermost(o).numbers_.kept.states;
  }
  /// The share of the innovation by which the next correction moves the measured value.
  template <class O>
  static constexpr auto measured_gain(const O& o) noexcept {
    const auto& inner = innermost(o);
    return std::get<0>(inner.numbers_.law_gain(inner.numbers_.laws[0], {}, inner.elapsed()));
  }
  /// True if all estimates that belong to these states are finite.
  template <class O, class States>
  static constexpr bool finite(const O& o, const States& states) noexcept {
    return is_finite(innermost(o).numbers_.probe(states));
  }
};

/// The constant of the disturbance in each level of an observer, and what guards do to it.
template <class Observer>
struct GuardedStates {
  using S = typename Observer::scalar_type;
  using Model = std::remove_cvref_t<decltype(std::declval<const Observer&>().model())>;
  using Constant = DisturbanceConstant<Model, S>;
  static constexpr int n = Observer::order;
  static constexpr int size = Observer::size;
  static constexpr int levels = Observer::levels;
  static constexpr bool on_chain = model_traits<Model>.is_chain;

  static constexpr bool turns_move_constant = observer_traits<Observer>.wraps_output && requires {
    requires Model::parts.plant_poles;
  };

  explicit constexpr GuardedStates(const Model& model) noexcept : constant(model) {}

  /// The disturbance states, level by level.
  using Found = Array<S, levels>;
  [[nodiscard]] ESOKIT_INLINE Found found(const Observer& observer) const noexcept {
    Found all{};
    const auto& states = GuardAccess::states(observer);
    unroll<levels>([&](auto level) ESOKIT_INLINE_LAMBDA {
      std::get<level>(all) = constant.of(std::get<level>(states));
    });
    return all;
  }

  /// Takes back the part of the correction that does not count. @param before what was found
  /// before it @param up, down factors on what raises or lowers it
  ESOKIT_INLINE void gate(Observer& observer, const Found& before, const S& up,
                          const S& down) const noexcept {
    auto& states = GuardAccess::states(observer);
    unroll<levels>([&](auto level) ESOKIT_INLINE_LAMBDA {
      auto& state = std::get<level>(states);
      const S d = constant.of(state);
      const S moved = d - std::get<level>(before);
      constant.put(observer.model(), state, d,
                   S(std::get<level>(before) + (moved > S(0) ? up : down) * moved));
    });
  }

  /// The share that leaks after each correction. @param config of Guarded
  template <class Config>
  static S leak_share(const Config& config) {
    if (!(config.leak_time > S(0))) return S(0);
    return -std::expm1(-chain_config<Observer>(config.observer).sample_time / config.leak_time);
  }
  /// Removes it.
  ESOKIT_INLINE void leak(Observer& observer, const S& share) const noexcept {
    for (auto& level : GuardAccess::states(observer)) {
      const S d = constant.of(level);
      constant.put(observer.model(), level, d, S(d - share * d));
    }
  }

  [[nodiscard]] ESOKIT_INLINE bool beyond(const Observer& observer, const S& most) const noexcept {
    if (!on_chain && !(most < (std::numeric_limits<S>::max)())) return false;
    const auto& states = GuardAccess::states(observer);
    S sum = constant.of(std::get<0>(states));
    bool beyond = absolute(sum) > most;
    unroll<levels - 1>([&](auto below) ESOKIT_INLINE_LAMBDA {
      sum = sum + constant.of(std::get<below + 1>(states));
      beyond = beyond || absolute(sum) > most;
    });
    return beyond;
  }

  /// Limits the dhat of each level, summed with the levels below it, to the bound.
  void keep_bound(Observer& observer, const S& most) const noexcept {
    S below{};
    for (auto& level : GuardAccess::states(observer)) {
      const S d = constant.of(level);
      const S sum = below + d;
      if (constant.beyond(level, sum, most)) {
        const S end = sum > S(0) ? most : S(-most);
        constant.put(observer.model(), level, d, S(end - below));
        if constexpr (on_chain && size > n + 1) {
          // The slopes of the levels are not distinguished: the slope of this one must not lead out
          // of the bound.
          if (level[n + 1] * end > S(0)) {
            for (std::size_t r = n + 1; r < size; ++r) level[r] = S(0);
          }
        }
      }
      below = below + constant.of(level);
    }
  }

  /// A bound in the scaling of the states. @param bound unit of y^(n); 0: none
  [[nodiscard]] static S limit(const Observer& observer, const S& bound) noexcept {
    constexpr S most = (std::numeric_limits<S>::max)();
    const bool bounds = bound > S(0) && is_finite(bound) && bound < most;
    const S scaled = Constant::scaled(observer.model(), bounds ? bound : S(1));
    return bounds && is_finite(scaled) ? scaled : most;
  }

  /// True if dhat is at its bound.
  [[nodiscard]] bool bounded(const Observer& observer, const S& most) const noexcept {
    S sum{};
    for (const auto& level : GuardAccess::states(observer)) {
      sum = sum + constant.of(level);
      if (constant.reaches(level, sum, most)) return true;
    }
    return false;
  }

  /// The states with b0 v multiplied by `factor`; with `all` also the disturbance.
  [[nodiscard]] auto rescaled(const Observer& observer, const S& factor, bool all) const noexcept {
    auto states = GuardAccess::states(observer);
    for (auto& level : states) level = constant.rescaled(observer.model(), level, factor, all);
    return states;
  }

  /// Puts each level at rest at y, with its disturbance of `with`.
  template <class States>
  void stand(Observer& observer, const States& with, const S& y) const noexcept {
    States still = with;
    for (auto& level : still) level = constant.standing(observer.model(), level, y);
    if (GuardAccess::finite(observer, still)) GuardAccess::states(observer) = still;
  }

  /// After a prediction of a plant that is held: d and the actuator continue, and the sensor
  /// follows a constant y. @param before the states before it @return true if something had moved
  template <class States>
  bool stand_still(Observer& observer, const States& before) const noexcept {
    constexpr auto y = static_cast<std::size_t>(Model::state_of_row(0));
    const auto& model = observer.model();
    auto& states = GuardAccess::states(observer);
    // The shift of y by an adapter.
    const S u = GuardAccess::innermost(observer).applied_input();
    const S turns = states[0][y] - model.predict(before[0], model.drive(u))[y];
    auto still = before[0];
    bool moved = false;
    for (std::size_t i = y + 1; i < still.size(); ++i) {
      const bool moves = i < y + n || i > y + Model::order;  // a derivative of y, or a sine
      moved = moved || (moves && (still[i] < S(0) || still[i] > S(0)));
      still[i] = S(0);
    }
    stand(observer, states, S(before[0][y] + turns));
    if constexpr (y > 0) {
      still = model.predict(still, model.drive(S(0)));
      for (std::size_t i = 0; i < y; ++i) states[0][i] = still[i] + (i == 0 ? turns : S(0));
    }
    return moved;
  }

  /// After a correction of a plant that is held: at y itself, in the turn in which an adapter has
  /// put it. @param left share of the innovation that the correction has left
  template <class States>
  void stand_at_measurement(Observer& observer, const States& before,
                            const S& left) const noexcept {
    const S innovation = GuardAccess::innermost(observer).innovation();
    stand(observer, before, S(GuardAccess::states(observer)[0][0] + left * innovation));
  }

  /// Calls `use(part, level)` with the corrected part of the model, including all of its sensor.
  /// The part of a chain is all of it.
  template <class Use>
  static auto with_level(const Observer& observer, [[maybe_unused]] int level, const Use& use) {
    if constexpr (on_chain) {
      return use(observer.model(), detail::ConstantLevel<size, S>(observer.level_gain(level)));
    } else {
      const auto& model = observer.model();
      const auto run = [&](const auto& part) {
        return use(part, detail::ConstantLevel(part, model, observer.level_gain(0)));
      };
      using Settings = std::remove_cvref_t<decltype(chain_config<Observer>(
          std::declval<const typename Observer::Config&>()))>;
      if constexpr (requires(const Settings& settings) { settings.poles; }) {
        return run(corrected_whole(model));
      } else {
        return model.with_corrected_part((std::numeric_limits<S>::max)(), run);
      }
    }
  }

  /// What is proven of a level. @return the samples in which it settles after a hold, see Holding
  static Expected<int, Error<S>> settling_samples(const Observer& observer, int level,
                                                  const S& leak) {
    const auto error = [level](const char* why) {
      return Error<S>{"level", static_cast<S>(level), why};
    };
    using Proven = Expected<int, Error<S>>;
    return with_level(observer, level, [&](const auto&, const auto& corrected) -> Proven {
      bool certified;
      if constexpr (on_chain) {
        certified = gating_certified<size, S>(detail::elements(corrected.gain), leak);
      } else {
        certified = gating_certified(corrected, leak);
      }
      if (!certified) {
        return error(
            "has a gain that is not proven stable if corrections of dhat are scaled: Re G > -1 "
            "fails");
      }
      const Holding held = holding(corrected, leak > S(0));
      if (!held.stable) {
        return error("has a gain that is not proven stable if the plant is held and released");
      }
      return held.settling;
    });
  }

  /// The steady error caused by a leak, for a constant d = 1 (unit of y^(n)).
  [[nodiscard]] static auto leak_error(const Observer& observer, const S& share) {
    const auto& model = observer.model();
    const S d = Constant::scaled(model, S(1));
    if constexpr (on_chain) {
      Array<ScaledGain<size, S>, levels> gains;
      for (int i = 0; i < levels; ++i) gains[static_cast<std::size_t>(i)] = observer.level_gain(i);
      return model.physical(detail::leak_error<n, S>(gains, share, d));
    } else {
      return with_level(observer, 0, [&](const auto& part, const auto& level) {
        const auto all = part.whole * level.leak_error(share, d);
        typename Model::State x{};
        for (int i = 0; i < size; ++i) x[static_cast<std::size_t>(i)] = all(i);
        return model.physical(x);
      });
    }
  }

  Constant constant;
};

}  // namespace detail
}  // namespace esokit
