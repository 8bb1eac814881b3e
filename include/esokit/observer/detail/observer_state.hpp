/// @file
/// ObservedLevels: the data of a predictor-corrector, and what can be read of it.
#pragma once

#include <cstdint>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/step_status.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/model/chain_model.hpp>
#include <esokit/observer/detail/update_step.hpp>
#include <limits>

namespace esokit {

namespace detail {
struct GuardAccess;  // adapter/detail/guarded_states.hpp
}

/// Base of PredictorCorrector: its data, and all members that only read them.
///
/// @tparam Order n, order of the plant @tparam Extension m, extended states
/// @tparam Law gain law, see GainLaw @tparam Levels p
/// @tparam Model what is known of the plant, see ChainModel
template <int Order, Scalar S, int Extension, class Law, int Levels, class Model>
class ObservedLevels {
 public:
  using Chain = ScaledChain<Order, S, Extension>;  ///< the sampled chain, in its scaling
  using PlantModel = Model;                        ///< what is known of the plant
  static constexpr int order = Order;              ///< n, order of the plant
  static constexpr int extension = Extension;      ///< m, extended states
  static constexpr int size = Model::size;         ///< N
  static constexpr int levels = Levels;            ///< p
  using scalar_type = S;                           ///< type of states and settings
  using Estimate = typename Model::Estimate;       ///< (y, .., y^(n-1), d, .., d^(m-1)), N x 1
  using State = typename Model::State;             ///< scaled, N elements
  using Laws = Array<Law, Levels>;                 ///< one for each level
  using StatusType = StatusOf<S>;                  ///< StepStatus, for a pack one per lane

  /// All estimates after the last step, N x 1, in physical units: plant states of the last level,
  /// disturbance summed over all levels.
  [[nodiscard]] ESOKIT_INLINE Estimate estimate() const noexcept {
    return numbers_.model.physical(numbers_.template up_to_level<Levels - 1>());
  }

  /// Estimate of y^(Row), or of d^(Row - n) for Row >= n.
  template <int Row>
  [[nodiscard]] constexpr S estimate() const noexcept {
    static_assert(Row >= 0 && Row < size, "esokit: no such estimate");
    return numbers_.model.template physical<Row>(numbers_.template up_to_level<Levels - 1>());
  }

  /// The same in the scaling of the chain, x_r = T^r z_r / r!, for laws that include the factors in
  /// their gains.
  template <int Row>
  [[nodiscard]] ESOKIT_INLINE constexpr S scaled_estimate() const noexcept {
    static_assert(Row >= 0 && Row < size, "esokit: no such estimate");
    constexpr int state = Model::state_of_row(Row);
    S sum = std::get<state>(numbers_.kept.states[Levels - 1]);
    detail::unroll<(Row >= Order ? Numbers::template levels_below<Levels - 1> : 0)>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { sum = sum + std::get<state>(numbers_.kept.states[i]); });
    return sum;
  }

  /// Estimate of level `level` = 0 .. p - 1 of a cascade: its plant states, and the disturbance
  /// found by it and the levels below it. All NaN for any other level.
  [[nodiscard]] Estimate level_estimate(int level) const noexcept {
    Estimate estimate = Estimate::Constant(S(std::numeric_limits<double>::quiet_NaN()));
    detail::unroll<Levels>([&](auto i) {
      if (i == level) estimate = numbers_.model.physical(numbers_.template up_to_level<i>());
    });
    return estimate;
  }

  /// dhat, unit of y^(n).
  [[nodiscard]] constexpr S total_disturbance() const noexcept { return estimate<Order>(); }

  /// The expected next measurement.
  [[nodiscard]] constexpr const S& predicted_measurement() const noexcept {
    return numbers_.kept.states[0][0];
  }

  /// y - z_1 of the last correction, with the predicted z_1 (of level 1).
  [[nodiscard]] constexpr const S& innovation() const noexcept { return numbers_.kept.innovation; }

  /// Number of predictions since the last correction; 0 if up to date. 65535 if the state was too
  /// large to be predicted: then the next good y restarts the observer. The count ends at 65533.
  [[nodiscard]] constexpr Lanes<int, S> missed() const noexcept {
    Lanes<int, S> missed = gap_;
    for (int i = 0; i < lane_count<S>; ++i) {
      if (detail::of_lane(gap_, i) == not_quick) detail::of_lane(missed, i) = 0;
    }
    return missed;
  }

  /// The input that the last prediction used.
  [[nodiscard]] constexpr const S& applied_input() const noexcept {
    return numbers_.kept.applied_input;
  }

  /// The estimate after the next `correct(y)` as a linear function of y, in scaled states (x_r =
  /// T^r z_r / r!). For a controller that computes before the measurement arrives.
  struct Preview {
    State offset;  ///< after correct(y) the estimate will be offset + slope y
    State slope;   ///< its derivative with respect to y
  };

  /// Call this between `predict` and `correct`. For gain laws whose gain is known before the
  /// measurement.
  [[nodiscard]] Preview preview() const noexcept requires PresetGainLaw<Law, size, S> {
    typename Numbers::Correction slope{};
    for (State& state : slope.states) state.fill(S(0.0));
    auto offset = slope;
    if (restarts()) [[unlikely]] {
      for (auto& state : slope.states) state = Numbers::standing(S(1.0));
    } else {
      offset.states = numbers_.kept.states;
      numbers_.template correct_levels<false>(offset, S(0.0), elapsed());
      numbers_.template correct_levels<false>(slope, S(1.0), elapsed());
    }
    return {Numbers::by_rows(numbers_.template up_to_level<Levels - 1>(offset.states)),
            Numbers::by_rows(numbers_.template up_to_level<Levels - 1>(slope.states))};
  }

  /// The scaled gain with which the next `correct(y)` will weight the innovation e; after a gap,
  /// the gain for the gap. It does not apply where `correct` `restarts`.
  [[nodiscard]] ScaledGain<size, S> correction_gain(const S& e) const noexcept
      requires(Levels == 1) {
    return Numbers::law_gain(numbers_.laws[0], e, elapsed());
  }

  /// The gain law, for a controller that computes before the measurement arrives.
  [[nodiscard]] constexpr const Law& gain_law() const noexcept requires(Levels == 1) {
    return numbers_.laws[0];
  }

  /// True if so many samples are missing that the next `correct` restarts the observer.
  [[nodiscard]] constexpr Lanes<bool, S> restarts() const noexcept {
    Lanes<bool, S> each{};
    const Lanes<int, S> gaps = missed();
    for (int i = 0; i < lane_count<S>; ++i) {
      const int steps = detail::of_lane(gaps, i);
      if (steps > detail::of_lane(max_gap_, i) + 1) [[unlikely]] {
        detail::of_lane(each, i) =
            steps > detail::of_lane(longest_gap_, i) + 1 || owes_too_much(steps, i);
      }
    }
    return each;
  }

  /// b0, as it was given.
  [[nodiscard]] constexpr const S& input_gain() const noexcept {
    return numbers_.model.input_gain();
  }

  /// T, s, as it was given.
  [[nodiscard]] constexpr const S& sample_time() const noexcept {
    return numbers_.model.sample_time();
  }

  /// Missing samples that any correction bridges: the config's number, or fewer if errors would not
  /// decay in every sequence of gaps up to it. After more, a gain that is not constant
  /// (AlgebraicEso, the filters, AdjustableBandwidthEso, NonlinearEso) restarts, and so do Guarded,
  /// VariableTime and what is written in integers. A constant gain may go on, see `longest_gap`.
  [[nodiscard]] constexpr int max_gap() const noexcept { return max_gap_; }

  /// Missing samples that a correction bridges if no others are due, see `recovering`; after more
  /// it restarts. The config's number for a constant gain (LinearEso, HalfGainEso, ReducedOrderEso,
  /// ModelEso, cascades): for the chain with any list of poles, or up to 7 states by a bandwidth;
  /// for a model at most 400. Of other gains, in Guarded, and while a model follows a
  /// speed, it is `max_gap()`.
  [[nodiscard]] constexpr int longest_gap() const noexcept { return longest_gap_; }

  /// Corrections that are due after gaps beyond `max_gap()`. One without a gap, or after a few
  /// samples, takes one away, one after a long gap adds some: after 50 / omega_o about 6 / (omega_o
  /// T) for three states, 13 for four. The next long gap restarts the observer if more than twice
  /// what `longest_gap()` alone makes due would be. So errors decay in any sequence of gaps.
  [[nodiscard]] constexpr Lanes<int, S> recovering() const noexcept { return recovering_; }

  /// What is known of the plant.
  [[nodiscard]] constexpr const Model& model() const noexcept { return numbers_.model; }

  /// Gain of the next correction of level `level` = 0 .. p - 1, scaled; for laws whose gain is
  /// known before the measurement.
  [[nodiscard]] constexpr ScaledGain<size, S> level_gain(int level) const noexcept requires
      PresetGainLaw<Law, size, S> {
    return numbers_.laws[static_cast<std::size_t>(level)].gain_before_measurement();
  }

  /// The estimate for a plant at rest at y under a constant u, N x 1, physical units: the start of
  /// a controller.
  [[nodiscard]] constexpr Estimate equilibrium(const S& y, const S& u) const noexcept {
    return numbers_.model.equilibrium(y, u);
  }

  /// A number that is finite only if the estimate that belongs to x is finite. @param x scaled
  /// estimates, row by row
  [[nodiscard]] constexpr S finite_probe(const State& x) const noexcept {
    State states{};
    detail::unroll<size>([&](auto row) ESOKIT_INLINE_LAMBDA {
      std::get<Model::state_of_row(row)>(states) = std::get<row>(x);
    });
    return numbers_.model.finite_probe(states);
  }

 protected:
  friend struct detail::LaneAccess;
  friend struct detail::GuardAccess;
  friend struct detail::RecordAccess;

  /// At rest at zero.
  ObservedLevels(const Laws& laws, const Model& model, int max_gap) noexcept
      : numbers_{{}, laws, model},
        max_gap_(static_cast<std::uint16_t>(detail::bridged_gap(laws, max_gap))),
        longest_gap_(static_cast<std::uint16_t>(detail::predicted_gap(laws, max_gap))) {
    for (State& state : numbers_.kept.states) state.fill(S(0.0));
    gap_ = up_to_date();
  }

  /// The gain laws, for derived observers.
  [[nodiscard]] constexpr const Laws& laws() const noexcept { return numbers_.laws; }
  /// The gain laws, for changing them.
  [[nodiscard]] constexpr Laws& laws() noexcept { return numbers_.laws; }

  /// True if `step` may be tried.
  [[nodiscard]] ESOKIT_INLINE constexpr bool may_be_quick() const noexcept { return gap_ == 0; }

  /// All data members, for derived classes.
  static constexpr int data_members = 5;

  /// @cond
  using Numbers = detail::LevelNumbers<Order, S, Extension, Law, Levels, Model>;

  /// Number of samples that the next correction bridges.
  [[nodiscard]] constexpr unsigned elapsed() const noexcept {
    const int gap = missed();
    return gap > 1 ? static_cast<unsigned>(gap) : 1u;
  }

  /// In the place of a gap of 0 if `step` is not to be tried: corrections are due, or 1/T is too
  /// large for it.
  static constexpr std::uint16_t not_quick = 65534;

  /// The gap after a correction.
  [[nodiscard]] constexpr Lanes<std::uint16_t, S> up_to_date() const noexcept {
    Lanes<std::uint16_t, S> gap{};
    if constexpr (Numbers::has_squares) {
      constexpr auto least = Numbers::least_time();
      if (!all(sample_time() >= S(least))) [[unlikely]] {
        for (int i = 0; i < lane_count<S>; ++i) {
          if (!(detail::number_of_lane(sample_time(), i) >= least)) {
            detail::of_lane(gap, i) = not_quick;
          }
        }
      }
    }
    for (int i = 0; i < (recovers ? lane_count<S> : 0); ++i) {
      if (detail::of_lane(recovering_, i) > 0) detail::of_lane(gap, i) = not_quick;
    }
    return gap;
  }

  static constexpr bool recovers = gain_law_traits<Law>.recovers;

  /// What is due after the longest gap that is bridged.
  [[nodiscard]] constexpr int most_due(int lane = 0) const noexcept {
    const auto samples = static_cast<unsigned>(detail::of_lane(longest_gap_, lane)) + 1u;
    const int due = detail::recovery_after(numbers_.laws, samples, lane);
    return due > 0 && due < 65535 ? due : 0;
  }
  /// Whether a correction after `samples`, more than any correction bridges, has to wait for those
  /// that are due. With V and q of GapRecovery, V q^due falls over every correction however many
  /// are due; that these are bounded bounds V. For two of the longest gaps there has to be room.
  [[nodiscard]] constexpr bool owes_too_much(int samples, int lane) const noexcept {
    const int due = detail::of_lane(recovering_, lane);
    if (due == 0) return false;
    const int more = detail::recovery_after(numbers_.laws, static_cast<unsigned>(samples), lane);
    return more > 2 * most_due(lane) - due;
  }

  Numbers numbers_;
  Lanes<std::uint16_t, S> gap_{};
  Lanes<std::uint16_t, S> max_gap_;
  Lanes<std::uint16_t, S> longest_gap_;
  Lanes<std::uint16_t, S> recovering_{};
  /// @endcond
};

}  // namespace esokit
