/// @file
/// LevelNumbers: the numbers of a predictor-corrector and its pure steps, on any scalar.
#pragma once

#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/model/chain_model.hpp>
#include <limits>
#include <type_traits>

namespace esokit {
namespace detail {

/// What a valid sample of a PredictorCorrector reads and writes. A step returns false, and has
/// changed nothing, if a result is not finite. It knows of no gap, restart or status.
///
/// For the chain, level i stores only the disturbance that it has found in addition to the levels
/// below and is driven by theirs: this takes the fewest operations. In other models the disturbance
/// has no separate rows: each level stores its whole estimate and also receives the corrections of
/// the disturbance by the levels below. For the chain this would be equivalent.
template <int Order, Scalar S, int Extension, class Law, int Levels, class Model>
struct LevelNumbers {
  static constexpr int size = Model::size;
  using State = typename Model::State;
  using LevelStates = Array<State, Levels>;
  using Laws = Array<Law, Levels>;

  static constexpr bool adds_up = Levels > 1 && model_traits<Model>.is_chain;
  /// The levels below one whose disturbance adds to its own.
  template <int Level>
  static constexpr int levels_below = adds_up ? Level : 0;

  /// Adds to the total disturbance of all levels.
  static constexpr void add_disturbance(LevelStates& states, const S& scaled) noexcept {
    constexpr auto state = static_cast<std::size_t>(Model::state_of_row(Order));
    for (std::size_t i = 0; i < (adds_up ? 1 : Levels); ++i) {
      states[i][state] = states[i][state] + scaled;
    }
  }

  /// The part of a correction that belongs to the disturbance.
  [[nodiscard]] ESOKIT_INLINE constexpr State disturbance_part(const State& x) const noexcept {
    if constexpr (model_traits<Model>.tells_disturbance) {
      return model.disturbance_part(x);
    } else {
      State part = x;
      unroll<Order>([&](auto r) ESOKIT_INLINE_LAMBDA { std::get<r>(part) = S(0.0); });
      return part;
    }
  }

  /// The state for (y, 0, .., 0), with a sensor that shows y.
  [[nodiscard]] static constexpr State standing(const S& y) noexcept {
    State state{};
    state.fill(S(0.0));
    state[0] = y;
    std::get<Model::state_of_row(0)>(state) = y;
    return state;
  }

  /// The states in the order of the estimate, as in `scaled_estimate`.
  [[nodiscard]] ESOKIT_INLINE static constexpr State by_rows(const State& states) noexcept {
    State rows{};
    unroll<size>([&](auto row) ESOKIT_INLINE_LAMBDA {
      std::get<row>(rows) = std::get<Model::state_of_row(row)>(states);
    });
    return rows;
  }

  /// Scaled state of a level, with the disturbances of the levels below it added to its own.
  template <int Level>
  [[nodiscard]] ESOKIT_INLINE static constexpr State up_to_level(
      const LevelStates& states) noexcept {
    State state = states[Level];
    unroll<levels_below<Level>>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { add_rows<Order, size - Order>(state, states[i]); });
    return state;
  }
  template <int Level>
  [[nodiscard]] ESOKIT_INLINE constexpr State up_to_level() const noexcept {
    return up_to_level<Level>(kept.states);
  }

  ESOKIT_INLINE constexpr void advance_laws() noexcept {
    unroll<(gain_law_traits<Law>.advances ? Levels : 0)>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { laws[i].advance(); });
  }

  [[nodiscard]] ESOKIT_INLINE constexpr LevelStates predicted(const S& u) const noexcept {
    LevelStates next;
    const auto drive = model.drive(u);
    next[0] = model.predict(kept.states[0], drive);
    if constexpr (!adds_up) {
      unroll<Levels - 1>([&](auto i) ESOKIT_INLINE_LAMBDA {
        next[i + 1] = model.predict(kept.states[i + 1], drive);
      });
    } else {
      auto joined = model.joined(drive, kept.states[0]);
      unroll<Levels - 1>([&](auto below) ESOKIT_INLINE_LAMBDA {
        constexpr int level = below + 1;
        next[level] = model.predict(kept.states[level], joined);
        if constexpr (level + 1 < Levels) joined = model.joined(joined, kept.states[level]);
      });
    }
    return next;
  }

  /// Finite only if all scaled states and the estimates of all levels in physical units are finite,
  /// see ScaledChain::finite_probe. It is taken of the sum of the magnitudes of all levels, an
  /// upper bound on any sum of their disturbances.
  [[nodiscard]] ESOKIT_INLINE constexpr S probe(const LevelStates& states) const noexcept {
    if constexpr (Levels == 1) {
      return model.finite_probe(states[0]);
    } else {
      State sum = magnitudes(states[Levels - 1]);
      unroll<Levels - 1>([&](auto i) ESOKIT_INLINE_LAMBDA { add_magnitudes(sum, states[i]); });
      return model.finite_probe(sum);
    }
  }

  /// If the sum of all squares is finite, so is the probe, unless 1/T is absurdly large. This test
  /// is cheaper, as squares need no absolute value and no weights. Not used for float with one
  /// level and many states, where 1/T = 20 kHz would be too large, or in software, where a product
  /// costs more than a magnitude.
  static constexpr bool has_squares =
      PlainScalar<LaneScalar<S>> && !records<S> && model_traits<Model>.is_chain &&
      (Levels > 1 || (size <= 4 && has_float_unit) || sizeof(LaneScalar<S>) > sizeof(float));

  /// A power of two. From this T on, states up to the root of the largest number are finite in
  /// physical units, summed over all levels.
  static constexpr auto least_time() noexcept {
    using Lane = LaneScalar<S>;
    Lane root(1);
    for (int i = 1; i < std::numeric_limits<Lane>::max_exponent / 2; ++i) root = root * Lane(2);
    Array<Lane, size> ones{};
    ones.fill(Lane(1));
    const auto suffice = [&](Lane rate) {
      return ScaledChain<Order, Lane, Extension>::finite_probe(ones, rate) * Lane(Levels) < root;
    };
    Lane time(1);
    while (!suffice(Lane(1) / time)) time = time * Lane(2);
    while (suffice(Lane(2) / time)) time = time / Lane(2);
    return time;
  }

  /// True implies that `probe` is finite; false does not imply the opposite.
  [[nodiscard]] ESOKIT_INLINE constexpr bool surely_finite(
      const LevelStates& states) const noexcept {
    if constexpr (has_squares) {
      S sum = sum_of_squares(std::get<0>(states));
      unroll<Levels - 1>([&](auto i)
                             ESOKIT_INLINE_LAMBDA { add_squares(sum, std::get<i + 1>(states)); });
      return all(is_finite_magnitude(sum));
    } else {
      return all(is_finite(probe(states)));
    }
  }

  struct Nothing {};
  struct Correction {
    LevelStates states;
    S innovation{};  ///< of level 1
    // Of all levels, if the laws have `accept`. Otherwise omitted, because compilers would store it
    // although nobody reads it.
    [[no_unique_address]] std::conditional_t<gain_law_traits<Law>.accepts, Array<S, Levels>,
                                             Nothing>
        innovations{};
  };

  [[nodiscard]] static constexpr decltype(auto) law_gain(const Law& law, const S& innovation,
                                                         unsigned elapsed) noexcept {
    if constexpr (gain_law_traits<Law>.bridges_gaps) {
      using Gain = ScaledGain<size, S>;
      return elapsed > 1 ? Gain(law.gap_gain(innovation, elapsed)) : Gain(law.gain(innovation));
    } else {
      return law.gain(innovation);
    }
  }

  /// Corrects `step.states` in place. False if an innovation is not finite and the law does not
  /// accept such innovations.
  template <bool NominalGain>
  ESOKIT_INLINE constexpr bool correct_levels(Correction& step, S y,
                                              unsigned elapsed) const noexcept {
    return correct_by(step, y, [&](auto level, const S& e) ESOKIT_INLINE_LAMBDA -> decltype(auto) {
      if constexpr (NominalGain) {
        return laws[level].gain(e);
      } else {
        return law_gain(laws[level], e, elapsed);
      }
    });
  }

  /// The same with gains from elsewhere. @param gain_of gives that of a level for an innovation
  template <class GainOf>
  ESOKIT_INLINE constexpr bool correct_by(Correction& step, S y,
                                          const GainOf& gain_of) const noexcept {
    constexpr GainLawTraits law_traits = gain_law_traits<Law>;
    constexpr bool law_looks =
        law_traits.kind != GainKind::preset && !law_traits.bears_any_innovation;
    bool fine = true;
    S measured = y;
    std::conditional_t<Levels == 1 || adds_up, Nothing, State> found{};
    unroll<Levels>([&](auto level) ESOKIT_INLINE_LAMBDA {
      auto& z = step.states[level];
      const S e = measured - z[0];
      if constexpr (level == 0) assign(step.innovation, e);
      if constexpr (law_traits.accepts) step.innovations[level] = e;
      if (law_looks && !all(is_finite(e))) [[unlikely]] {
        fine = false;
        return;
      }
      correct_level(z, gain_of(level, e), e, found);
      measured = z[0];
    });
    return fine;
  }

  /// @param found corrections of the disturbance by the levels so far
  template <class Gain, class Found>
  ESOKIT_INLINE constexpr void correct_level(State& z, const Gain& gain, const S& e,
                                             [[maybe_unused]] Found& found) const noexcept {
    if constexpr (std::is_same_v<Found, Nothing>) {
      z = add_scaled(z, gain, e);
    } else {
      const State step = add_scaled(found, gain, e);
      z = add_scaled(z, step, S(1.0));
      found = disturbance_part(step);
    }
  }

  ESOKIT_INLINE constexpr void commit(const Correction& step) noexcept {
    assign(kept.innovation, step.innovation);
    keep_stores_apart(kept.states[0][0]);
    kept.states = step.states;
    unroll<(gain_law_traits<Law>.accepts ? Levels : 0)>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { laws[i].accept(step.innovations[i]); });
  }

  /// One sample, after `advance_laws`. One test for all faults: a bad y or u makes the new state
  /// non-finite.
  ESOKIT_INLINE constexpr bool step(const S& y, const S& u) noexcept {
    Correction next{predicted(u)};
    const bool looked = correct_levels<true>(next, y, 1u);
    keep_scalars(next.states);
    if (!looked || !surely_finite(next.states)) [[unlikely]]
      return false;
    commit(next);
    kept.applied_input = u;
    return true;
  }

  /// The second half of it. @param elapsed samples since the last correction; 1 if `NominalGain`
  template <bool NominalGain>
  ESOKIT_INLINE constexpr bool correct(const S& y, unsigned elapsed) noexcept {
    Correction next{kept.states};
    if (!correct_levels<NominalGain>(next, y, elapsed) || !all(is_finite(probe(next.states))))
        [[unlikely]]
      return false;
    commit(next);
    return true;
  }

  /// Replaces the states.
  ESOKIT_INLINE constexpr bool take(const LevelStates& next) noexcept {
    if (!all(is_finite(probe(next)))) [[unlikely]]
      return false;
    kept.states = next;
    return true;
  }

  /// What a valid sample writes: scalars only. It survives a retune, all else is replaced.
  struct Kept {
    LevelStates states{};
    S innovation = S(0.0);
    S applied_input = S(0.0);
  } kept;
  Laws laws;
  Model model;

  static constexpr int data_members = 3;
};

}  // namespace detail
}  // namespace esokit
