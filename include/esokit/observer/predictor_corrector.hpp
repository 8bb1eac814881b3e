/// @file
/// The sampled predictor-corrector that all observers share.
#pragma once

#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/kernels.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/gain/step_status.hpp>
#include <esokit/model/chain_model.hpp>
#include <esokit/observer/concepts.hpp>
#include <limits>

namespace esokit {

/// The settings that all sampled observers have in common.
template <Scalar S>
struct ChainConfig {
  S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};    ///< T, s
  int max_gap = 100;  ///< missing samples in a row that a correction may bridge, 1 .. 65000;
                      ///< after more it restarts from the measurement; see `max_gap()`
};

namespace detail {

/// Not a member of a class, so that all observers of an order share its code.
template <int Order, Scalar S>
Check<S> check_chain(const ChainConfig<S>& config) {
  using Chain = ScaledChain<Order, S, 1>;
  return Rules<S>{}
      .nonzero("input_gain", config.input_gain)
      .positive("sample_time", config.sample_time)
      .invertible("sample_time", config.sample_time)
      .representable("input_gain", config.input_gain,
                     Chain::scaled_input_gain(config.input_gain, config.sample_time),
                     "times T^n / n! gives a gain that the scalar cannot hold")
      .require(1 <= config.max_gap && config.max_gap <= 65000, "max_gap",
               detail::integer<S>(config.max_gap), "must be 1 .. 65000");
}

}  // namespace detail

/// `Levels` chains in series with one gain law each: one level is the plain observer, more are the
/// cascade. Level 1 is corrected by y and driven by u. Level i is corrected by the corrected output
/// of level i - 1 and driven by u and the disturbances found by the levels before it.
///
/// One instance belongs to one thread. No member allocates, throws or locks after `make`.
///
/// After any input, however bad, good samples lead back to a good estimate: the error decays by
/// e^(-r T) a sample, r the rate of its slowest pole, from the largest number of the scalar to
/// rounding in at most 60 + 2 ln(max / epsilon) / (r T) samples. This is tested with every observer
/// and adapter: double 60 + 1500 / (r T), float 60 + 210 / (r T) samples. With all poles at one
/// bandwidth r is omega_o; of a cascade it is the least bandwidth, of half gains omega_o / 2, and
/// no faster than what a model computes without correcting it, such as the lag of an actuator (1 /
/// tau). `-stability_abscissa(observer_system(observer))` (analysis) is 1 - e^(-r T).
///
/// @tparam Order n, order of the plant @tparam Extension m, extended states
/// @tparam Law gain law, see GainLaw @tparam Levels p
/// @tparam Model what is known of the plant, see ChainModel
template <int Order, Scalar S, int Extension, class Law, int Levels = 1,
          class Model = ChainModel<Order, S, Extension>>
requires GainLaw<Law, Order + Extension, S> && SampledModel<Model, S>
class PredictorCorrector {
  static_assert(Levels == 1 || model_traits<Model>.adds_levels ||
                    model_traits<Model>.tells_disturbance,
                "esokit: a cascade needs a model that separates the disturbance: "
                "ModelTraits::adds_levels or tells_disturbance");

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
  using Status = StatusOf<S>;                      ///< StepStatus, for a pack one per lane

  /// The same with another scalar.
  template <class T>
  using with_scalar = PredictorCorrector<Order, T, Extension, detail::WithScalar<Law, T>, Levels,
                                         detail::WithScalar<Model, T>>;

  /// What the observer can do beyond LoopObserver.
  static constexpr ObserverTraits traits{
      .publishes_chain = true,
      .acts_by_gain = gain_law_traits<Law>.kind == GainKind::preset,
      .is_predictable = Levels == 1 || gain_law_traits<Law>.kind == GainKind::preset,
      .gain_kind = gain_law_traits<Law>.kind,
      .measures_first_row = Model::state_of_row(0) == 0,
      .bears_guards =
          gain_law_traits<Law>.kind == GainKind::preset && !gain_law_traits<Law>.advances &&
          (model_traits<Model>.is_chain || (Levels == 1 && model_traits<Model>.tells_constant))};

  /// From settings and finished gain laws; use this for a gain law of your own.
  /// @return the observer, or an error for input_gain, sample_time or max_gap
  static Expected<PredictorCorrector, Error<S>> make(const ChainConfig<S>& config,
                                                     const Laws& laws) {
    if (auto ok = check_chain(config); !ok) return ok.error();
    return PredictorCorrector(config, laws);
  }

  /// The same for one level.
  static Expected<PredictorCorrector, Error<S>> make(const ChainConfig<S>& config,
                                                     const Law& law) requires(Levels == 1) {
    return make(config, Laws{law});
  }

  /// One sample: `predict(u_applied)`, then `correct(y)`.
  /// @param y measurement at sample k
  /// @param u_applied input that the actuator held from k - 1 to k, after its limits
  Status update(S y, S u_applied) noexcept {
    advance_laws();
    return update_advanced(y, u_applied);
  }

  /// Time update only: one sample without a measurement, or the first half of `update`.
  Status predict(S u_applied) noexcept {
    advance_laws();
    return predict_advanced(u_applied);
  }

  /// Measurement update only. After a gap it uses the gain for the time since the last correction.
  Status correct(S y) noexcept {
    if constexpr (records<S>) {
      (void)correct_all(y);
      return StepStatus::ok;
    } else {
      const unsigned elapsed = this->elapsed();
      const bool overdue = elapsed > max_gap_ + 1u;
      if (overdue || !corrected(y, elapsed)) [[unlikely]]
        return restart_from(y, overdue);
      gap_ = up_to_date();
      return elapsed > 1 ? StepStatus::gap_bridged : StepStatus::ok;
    }
  }

  /// All estimates after the last step, N x 1, in physical units: plant states of the last level,
  /// disturbance summed over all levels.
  [[nodiscard]] ESOKIT_INLINE Estimate estimate() const noexcept {
    return model_.physical(up_to_level<Levels - 1>());
  }

  /// Estimate of y^(Row), or of d^(Row - n) for Row >= n.
  template <int Row>
  [[nodiscard]] constexpr S estimate() const noexcept {
    static_assert(Row >= 0 && Row < size, "esokit: no such estimate");
    return model_.template physical<Row>(up_to_level<Levels - 1>());
  }

  /// The same in the scaling of the chain, x_r = T^r z_r / r!, for laws that include the factors in
  /// their gains.
  template <int Row>
  [[nodiscard]] ESOKIT_INLINE constexpr S scaled_estimate() const noexcept {
    static_assert(Row >= 0 && Row < size, "esokit: no such estimate");
    constexpr int state = Model::state_of_row(Row);
    S sum = std::get<state>(kept_.states[Levels - 1]);
    detail::unroll<(Row >= Order ? levels_below<Levels - 1> : 0)>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { sum = sum + std::get<state>(kept_.states[i]); });
    return sum;
  }

  /// Estimate of level `level` = 0 .. p - 1 of a cascade: its plant states, and the disturbance
  /// found by it and the levels below it. All NaN for any other level.
  [[nodiscard]] Estimate level_estimate(int level) const noexcept {
    Estimate estimate = Estimate::Constant(S(std::numeric_limits<double>::quiet_NaN()));
    detail::unroll<Levels>([&](auto i) {
      if (i == level) estimate = model_.physical(up_to_level<i>());
    });
    return estimate;
  }

  /// dhat, unit of y^(n).
  [[nodiscard]] constexpr S total_disturbance() const noexcept { return estimate<Order>(); }

  /// The expected next measurement.
  [[nodiscard]] constexpr const S& predicted_measurement() const noexcept {
    return kept_.states[0][0];
  }

  /// y - z_1 of the last correction, with the predicted z_1 (of level 1).
  [[nodiscard]] constexpr const S& innovation() const noexcept { return kept_.innovation; }

  /// Number of predictions since the last correction; 0 if up to date. 65535 if the state was too
  /// large to be predicted: then the next good y restarts the observer. The count ends at 65533.
  [[nodiscard]] constexpr Lanes<int, S> missed() const noexcept {
    Lanes<int, S> missed = gap_;
    for (int i = 0; i < (has_squares ? lane_count<S> : 0); ++i) {
      if (detail::of_lane(gap_, i) == beyond_squares) detail::of_lane(missed, i) = 0;
    }
    return missed;
  }

  /// The input that the last prediction used.
  [[nodiscard]] constexpr const S& applied_input() const noexcept { return kept_.applied_input; }

  /// The estimate after the next `correct(y)` as a linear function of y, in scaled states (x_r =
  /// T^r z_r / r!). For a controller that computes before the measurement arrives.
  struct Preview {
    State offset;  ///< after correct(y) the estimate will be offset + slope y
    State slope;   ///< its derivative with respect to y
  };

  /// Call this between `predict` and `correct`. For gain laws whose gain is known before the
  /// measurement.
  [[nodiscard]] Preview preview() const noexcept requires PresetGainLaw<Law, size, S> {
    Correction slope{};
    for (State& state : slope.states) state.fill(S(0.0));
    Correction offset = slope;
    if (restarts()) [[unlikely]] {
      for (auto& state : slope.states) state = standing(S(1.0));
    } else {
      offset.states = kept_.states;
      correct_levels<false>(offset, S(0.0), elapsed());
      correct_levels<false>(slope, S(1.0), elapsed());
    }
    return {by_rows(up_to_level<Levels - 1>(offset.states)),
            by_rows(up_to_level<Levels - 1>(slope.states))};
  }

  /// The scaled gain with which the next `correct(y)` will weight the innovation e; after a gap,
  /// the gain for the gap. For gaps above `max_gap` it does not apply, because `correct` restarts.
  [[nodiscard]] ScaledGain<size, S> correction_gain(const S& e) const noexcept
      requires(Levels == 1) {
    return law_gain(laws_[0], e, elapsed());
  }

  /// The gain law, for a controller that computes before the measurement arrives.
  [[nodiscard]] constexpr const Law& gain_law() const noexcept requires(Levels == 1) {
    return laws_[0];
  }

  /// True if so many samples are missing that the next `correct` restarts the observer.
  [[nodiscard]] constexpr Lanes<bool, S> restarts() const noexcept {
    return missed() > max_gap_ + 1;
  }

  /// Call this between `predict` and `correct` if the actuator held `u_applied` instead of the u
  /// given to `predict`. Adds Gamma (u_applied - u_given) to the prediction. A u that is not
  /// finite, or would make the prediction not finite, changes nothing and is reported.
  Status revise_input(S u_applied) noexcept {
    LevelStates next = kept_.states;
    for (auto& state : next) state = model_.add_input(state, S(u_applied - kept_.applied_input));
    if (!all(is_finite(probe(next)))) [[unlikely]]
      return StepStatus::input_rejected;
    kept_.states = next;
    kept_.applied_input = u_applied;
    return StepStatus::ok;
  }

  /// b0, as it was given.
  [[nodiscard]] constexpr const S& input_gain() const noexcept { return model_.input_gain(); }

  /// T, s, as it was given.
  [[nodiscard]] constexpr const S& sample_time() const noexcept { return model_.sample_time(); }

  /// Missing samples that a correction bridges before it restarts: the config's number, or fewer if
  /// errors would not decay in every sequence of gaps up to it.
  [[nodiscard]] constexpr int max_gap() const noexcept { return max_gap_; }

  /// What is known of the plant.
  [[nodiscard]] constexpr const Model& model() const noexcept { return model_; }

  /// From the next step on the frequencies of the model are `factor` times those of the config. Phi
  /// is computed exactly, the gain is interpolated in a table from `make`. The estimate is kept,
  /// and with it the phase of each sine. The work is bounded and involves no design. The speed must
  /// change slowly in comparison with the slowest pole. After a retune the factor is 1 again.
  /// @return error for a factor outside the range in the settings: nothing changes then
  Check<S> set_speed(const S& factor) noexcept requires(model_traits<Model>.follows_speed) {
    Laws laws = laws_;
    for (Law& law : laws) {
      if (auto ok = law.set_speed(factor); !ok) return ok;
    }
    laws_ = laws;
    model_ = model_.at_speed(factor);
    return {};
  }

  /// Gain of the next correction of level `level` = 0 .. p - 1, scaled; for laws whose gain is
  /// known before the measurement.
  [[nodiscard]] constexpr ScaledGain<size, S> level_gain(int level) const noexcept requires
      PresetGainLaw<Law, size, S> {
    return laws_[static_cast<std::size_t>(level)].gain_before_measurement();
  }

  /// The estimate for a plant at rest at y under a constant u, N x 1, physical units: the start of
  /// a controller.
  [[nodiscard]] constexpr Estimate equilibrium(const S& y, const S& u) const noexcept {
    return model_.equilibrium(y, u);
  }

  /// A number that is finite only if the estimate that belongs to x is finite. @param x scaled
  /// estimates, row by row
  [[nodiscard]] constexpr S finite_probe(const State& x) const noexcept {
    if constexpr (traits.measures_first_row) {
      return model_.finite_probe(x);
    } else {
      State states{};
      for (int row = 0; row < size; ++row) {
        states[static_cast<std::size_t>(Model::state_of_row(row))] =
            x[static_cast<std::size_t>(row)];
      }
      return model_.finite_probe(states);
    }
  }

  /// Restarts at (y, 0, .., 0). A y that is not finite changes nothing and is reported.
  Status reset(S y) noexcept { return reset_scaled(standing(y)); }

  /// Restarts at a given estimate, N x 1, physical units. A state that is not finite changes
  /// nothing and is reported.
  Status reset(const Estimate& state) noexcept { return reset_scaled(model_.scaled(state)); }

  /// Moves the origin of y: adds `offset` to z_1 of every level. For periodic quantities, whose
  /// estimate would otherwise grow with every turn.
  /// @return ok, or state_rejected if the offset or the new estimate is not finite: nothing changes
  ///         then
  constexpr Status shift_output(const S& offset) noexcept
      requires(model_traits<Model>.shifts_output) {
    constexpr auto y = static_cast<std::size_t>(Model::state_of_row(0));
    LevelStates next = kept_.states;
    for (auto& state : next) {
      state[0] = state[0] + offset;
      if (y > 0) state[y] = state[y] + offset;
    }
    return shift_to(next);
  }

  /// Adds `offset` (unit of y^(n)) to dhat, for when another term takes over a part of y^(n).
  /// @return as for `shift_output`
  constexpr Status shift_disturbance(const S& offset) noexcept {
    LevelStates next = kept_.states;
    add_disturbance(next, model_.scaled_disturbance(offset));
    return shift_to(next);
  }

  /// Adds `offset` (unit of y^(n), n of the plant) to the load on the plant, for when it is known.
  /// With an actuator in the model the load acts behind it, on y^(n). @return as for `shift_output`
  constexpr Status shift_load(const S& offset) noexcept
      requires(model_traits<Model>.is_chain || model_traits<Model>.tells_constant) {
    if constexpr (model_traits<Model>.is_chain) {
      return shift_disturbance(offset);
    } else {
      LevelStates next = kept_.states;
      const State column = model_.constant_column();
      const S scaled = model_.scaled_constant(offset);
      for (auto& state : next) {
        for (std::size_t i = 0; i < column.size(); ++i) state[i] = state[i] + column[i] * scaled;
      }
      return shift_to(next);
    }
  }

  /// Takes over the settings of `fresh` and keeps the estimate: states are rescaled to its sample
  /// time, and a change of b0 is moved into the disturbance, dhat += (b0_old - b0_new) u, so that
  /// the control does not jump. A law goes on with its memory, if it declares that it can.
  Check<S> adopt(const PredictorCorrector& fresh) {
    PredictorCorrector next = fresh;
    if constexpr (gain_law_traits<Law>.continues) {
      const S time_ratio = fresh.sample_time() / sample_time();
      for (std::size_t i = 0; i < Levels; ++i) {
        if (auto ok = next.laws_[i].continue_from(laws_[i], time_ratio); !ok) return ok;
      }
    }
    next.kept_ = kept_;
    next.gap_ = missed() == 0 ? next.up_to_date() : gap_;
    for (State& state : next.kept_.states) state = next.model_.rescaled(state, model_);
    if (!next.model_.same_drive(model_)) {
      const S explained = (input_gain() - fresh.input_gain()) * kept_.applied_input;
      add_disturbance(next.kept_.states, next.model_.scaled_disturbance(explained));
    }
    if (!all(is_finite(next.probe(next.kept_.states)))) {
      return Error<S>{"input_gain", fresh.input_gain(), "would make the estimate not finite"};
    }
    *this = next;
    return {};
  }

 protected:
  /// At rest at zero; `config` is already checked.
  PredictorCorrector(const ChainConfig<S>& config, const Laws& laws) noexcept requires
      std::same_as<Model, ChainModel<Order, S, Extension>>
      : laws_(laws),
        model_(config.input_gain, config.sample_time),
        max_gap_(bridged(laws, config.max_gap)) {
    for (State& state : kept_.states) state.fill(S(0.0));
    gap_ = up_to_date();
  }

  /// The same with a model from its own `make`. @param laws one for each level, or one law for one
  /// level
  template <class Given>
  PredictorCorrector(const Model& model, const Given& laws, int max_gap) noexcept
      : laws_{laws}, model_(model), max_gap_(static_cast<std::uint16_t>(max_gap)) {
    for (State& state : kept_.states) state.fill(S(0.0));
    gap_ = up_to_date();
  }

  /// The rules for input_gain, sample_time and max_gap.
  static Check<S> check_chain(const ChainConfig<S>& config) {
    return detail::check_chain<Order, S>(config);
  }

  /// The gain laws, for derived observers.
  [[nodiscard]] constexpr const Laws& laws() const noexcept { return laws_; }
  /// The gain laws, for changing them.
  [[nodiscard]] constexpr Laws& laws() noexcept { return laws_; }

  /// For packs and while all is well: whether no lane needs more than `step`. Then the laws are one
  /// sample on.
  ESOKIT_INLINE bool advance() noexcept {
    if (!may_be_quick()) [[unlikely]]
      return false;
    advance_laws();
    return true;
  }

  /// One sample, after `advance`. False, and nothing has changed, if it is not a good one. One test
  /// for all faults: a bad y or u makes the new state non-finite.
  ESOKIT_INLINE bool step(const S& y, const S& u_applied) noexcept {
    Correction next{predicted_levels(u_applied)};
    const bool looked = correct_levels<true>(next, y, 1u);
    detail::keep_scalars(next.states);
    if (!looked || !surely_finite(next.states)) [[unlikely]]
      return false;
    commit(next);
    kept_.applied_input = u_applied;
    return true;
  }

  /// @cond
  // The halves of it, the first after `advance_predict`.
  ESOKIT_INLINE bool advance_predict() noexcept {
    advance_laws();
    return true;
  }
  ESOKIT_INLINE bool predict_all(const S& u_applied) noexcept {
    return take_prediction(predicted_levels(u_applied), u_applied);
  }
  ESOKIT_INLINE bool correct_all(const S& y) noexcept {
    if (!(gap_ == 1 || gap_ == 0)) [[unlikely]]
      return false;
    Correction next{kept_.states};
    if (!correct_levels<true>(next, y, 1u) || !all(is_finite(probe(next.states)))) [[unlikely]]
      return false;
    commit(next);
    gap_ = up_to_date();
    return true;
  }
  /// @endcond

  /// `update` after the laws have advanced, for derived observers.
  ESOKIT_INLINE Status update_advanced(const S& y, const S& u_applied) noexcept {
    if (may_be_quick() && step(y, u_applied)) [[likely]]
      return StepStatus::ok;
    if constexpr (records<S>) {
      return StepStatus::ok;
    } else {
      return update_guarded(y, u_applied);
    }
  }

  /// All data members, for derived classes.
  static constexpr int data_members = 5;

  static constexpr bool advances = gain_law_traits<Law>.advances;  ///< `advance` changes the laws

  /// True if `step` may be tried.
  [[nodiscard]] ESOKIT_INLINE constexpr bool may_be_quick() const noexcept { return gap_ == 0; }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::GuardAccess;
  friend struct detail::RecordAccess;

  using LevelStates = Array<State, Levels>;

  /// The states in the order of the estimate, as in `scaled_estimate`.
  [[nodiscard]] ESOKIT_INLINE static constexpr State by_rows(const State& states) noexcept {
    if constexpr (traits.measures_first_row) {
      return states;
    } else {
      State rows{};
      detail::unroll<size>([&](auto row) ESOKIT_INLINE_LAMBDA {
        std::get<row>(rows) = std::get<Model::state_of_row(row)>(states);
      });
      return rows;
    }
  }

  /// What the levels store. For the chain, level i stores only the disturbance that it has found in
  /// addition to the levels below and is driven by theirs: this takes the fewest operations. In
  /// other models the disturbance has no separate rows: each level stores its whole estimate and
  /// also receives the corrections of the disturbance by the levels below. For the chain this would
  /// be equivalent.
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
      return model_.disturbance_part(x);
    } else {
      State part = x;
      detail::unroll<Order>([&](auto r) ESOKIT_INLINE_LAMBDA { std::get<r>(part) = S(0.0); });
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

  /// The gaps that the laws bridge, at most `asked`.
  static constexpr std::uint16_t bridged(const Laws& laws, int asked) noexcept {
    return static_cast<std::uint16_t>(detail::bridged_gap(laws, asked));
  }

  /// A gap longer than any max_gap.
  static constexpr std::uint16_t restart_due = 65535;

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

  constexpr Status shift_to(const LevelStates& next) noexcept {
    if (!all(is_finite(probe(next)))) [[unlikely]]
      return StepStatus::state_rejected;
    kept_.states = next;
    return StepStatus::ok;
  }

  /// Number of samples that the next correction bridges.
  [[nodiscard]] constexpr unsigned elapsed() const noexcept {
    const int gap = missed();
    return gap > 1 ? static_cast<unsigned>(gap) : 1u;
  }

  ESOKIT_INLINE constexpr void advance_laws() noexcept {
    detail::unroll<(gain_law_traits<Law>.advances ? Levels : 0)>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { laws_[i].advance(); });
  }

  [[nodiscard]] ESOKIT_INLINE constexpr LevelStates predicted_levels(const S& u) const noexcept {
    LevelStates next;
    const auto drive = model_.drive(u);
    next[0] = model_.predict(kept_.states[0], drive);
    if constexpr (!adds_up) {
      detail::unroll<Levels - 1>([&](auto i) ESOKIT_INLINE_LAMBDA {
        next[i + 1] = model_.predict(kept_.states[i + 1], drive);
      });
    } else {
      auto joined = model_.joined(drive, kept_.states[0]);
      detail::unroll<Levels - 1>([&](auto below) ESOKIT_INLINE_LAMBDA {
        constexpr int level = below + 1;
        next[level] = model_.predict(kept_.states[level], joined);
        if constexpr (level + 1 < Levels) joined = model_.joined(joined, kept_.states[level]);
      });
    }
    return next;
  }

  /// Scaled state of a level, with the disturbances of the levels below it added to its own.
  template <int Level>
  [[nodiscard]] ESOKIT_INLINE constexpr State up_to_level() const noexcept {
    return up_to_level<Level>(kept_.states);
  }

  template <int Level>
  [[nodiscard]] ESOKIT_INLINE static constexpr State up_to_level(
      const LevelStates& states) noexcept {
    State state = states[Level];
    detail::unroll<levels_below<Level>>([&](auto i) ESOKIT_INLINE_LAMBDA {
      detail::add_rows<Order, size - Order>(state, states[i]);
    });
    return state;
  }

  /// Finite only if all scaled states and the estimates of all levels in physical units are finite,
  /// see ScaledChain::finite_probe. It is taken of the sum of the magnitudes of all levels, an
  /// upper bound on any sum of their disturbances.
  [[nodiscard]] ESOKIT_INLINE constexpr S probe(const LevelStates& states) const noexcept {
    if constexpr (Levels == 1) {
      return model_.finite_probe(states[0]);
    } else {
      State sum = detail::magnitudes(states[Levels - 1]);
      detail::unroll<Levels - 1>(
          [&](auto i) ESOKIT_INLINE_LAMBDA { detail::add_magnitudes(sum, states[i]); });
      return model_.finite_probe(sum);
    }
  }

  /// If the sum of all squares is finite, so is the probe, unless 1/T is absurdly large. This test
  /// is cheaper, as squares need no absolute value and no weights. Not used for float with one
  /// level and many states, where 1/T = 20 kHz would be too large, or in software, where a product
  /// costs more than a magnitude.
  static constexpr bool has_squares = PlainScalar<LaneScalar<S>> && !records<S> &&
                                      model_traits<Model>.is_chain &&
                                      (Levels > 1 || (size <= 4 && detail::has_float_unit) ||
                                       sizeof(LaneScalar<S>) > sizeof(float));

  /// In the place of a gap of 0 if 1/T is too large for it: `step` is not tried.
  static constexpr std::uint16_t beyond_squares = 65534;

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

  /// The gap after a correction.
  [[nodiscard]] constexpr Lanes<std::uint16_t, S> up_to_date() const noexcept {
    Lanes<std::uint16_t, S> gap{};
    if constexpr (has_squares) {
      constexpr auto least = least_time();
      if (!all(sample_time() >= S(least))) [[unlikely]] {
        for (int i = 0; i < lane_count<S>; ++i) {
          if (!(detail::number_of_lane(sample_time(), i) >= least)) {
            detail::of_lane(gap, i) = beyond_squares;
          }
        }
      }
    }
    return gap;
  }

  /// True implies that `probe` is finite; false does not imply the opposite.
  [[nodiscard]] ESOKIT_INLINE constexpr bool surely_finite(
      const LevelStates& states) const noexcept {
    if constexpr (has_squares) {
      S sum = detail::sum_of_squares(std::get<0>(states));
      detail::unroll<Levels - 1>(
          [&](auto i) ESOKIT_INLINE_LAMBDA { detail::add_squares(sum, std::get<i + 1>(states)); });
      return all(detail::is_finite_magnitude(sum));
    } else {
      return all(is_finite(probe(states)));
    }
  }

  [[nodiscard]] constexpr decltype(auto) law_gain(const Law& law, const S& innovation,
                                                  unsigned elapsed) const noexcept {
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
        return laws_[level].gain(e);
      } else {
        return law_gain(laws_[level], e, elapsed);
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
    detail::unroll<Levels>([&](auto level) ESOKIT_INLINE_LAMBDA {
      auto& z = step.states[level];
      const S e = measured - z[0];
      if constexpr (level == 0) detail::assign(step.innovation, e);
      if constexpr (law_traits.accepts) step.innovations[level] = e;
      if constexpr (law_looks) {
        if (!all(is_finite(e))) [[unlikely]] {
          fine = false;
          return;
        }
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
      z = detail::add_scaled(z, gain, e);
    } else {
      const State step = detail::add_scaled(found, gain, e);
      z = detail::add_scaled(z, step, S(1.0));
      found = disturbance_part(step);
    }
  }

  ESOKIT_INLINE constexpr void commit(const Correction& step) noexcept {
    detail::assign(kept_.innovation, step.innovation);
    detail::keep_stores_apart(kept_.states[0][0]);
    kept_.states = step.states;
    detail::unroll<(gain_law_traits<Law>.accepts ? Levels : 0)>(
        [&](auto i) ESOKIT_INLINE_LAMBDA { laws_[i].accept(step.innovations[i]); });
  }

  /// False, and nothing has changed, if the result is not finite. @param elapsed 1: no gap
  constexpr bool corrected(S y, unsigned elapsed) noexcept {
    Correction step{kept_.states};
    if (!correct_levels<false>(step, y, elapsed) || !is_finite(probe(step.states))) return false;
    commit(step);
    return true;
  }
  /// After a gap that is not bridged, or if y cannot correct the state.
  ESOKIT_COLD StepStatus restart_from(S y, bool overdue) noexcept {
    // A finite but absurdly large u can lead to a prediction from which no good y recovers.
    const bool due = overdue || detail::absolute(y) < detail::absolute(kept_.states[0][0]);
    return is_finite(y) && due && reset(y) == StepStatus::ok ? StepStatus::restarted
                                                             : StepStatus::measurement_rejected;
  }
  /// False, and nothing has changed, if the prediction is not finite.
  ESOKIT_INLINE bool take_prediction(const LevelStates& next, const S& u) noexcept {
    if (!all(is_finite(probe(next)))) [[unlikely]]
      return false;
    count_missed();
    kept_.states = next;
    kept_.applied_input = u;
    return true;
  }
  ESOKIT_COLD LevelStates predicted_seldom(S u) const noexcept { return predicted_levels(u); }

  ESOKIT_COLD Status update_guarded(S y, S u_applied) noexcept {
    const LevelStates before = kept_.states;
    const LevelStates next = predicted_seldom(u_applied);
    if constexpr (has_squares) {
      if (missed() == 0) {  // perhaps only the squares overflowed
        kept_.states = next;
        if (corrected(y, 1u)) {
          kept_.applied_input = u_applied;
          return StepStatus::ok;
        }
        kept_.states = before;
      }
    }
    const StepStatus predicted =
        take_prediction(next, u_applied) ? StepStatus::ok : predict_rejecting(u_applied);
    return predicted | correct(y);
  }

  Status predict_advanced(S u_applied) noexcept {
    if (predict_all(u_applied)) [[likely]]
      return StepStatus::ok;
    if constexpr (records<S>) {
      return StepStatus::ok;
    } else {
      return predict_rejecting(u_applied);
    }
  }

  constexpr void count_missed() noexcept {
    for (int i = 0; i < lane_count<S>; ++i) {
      std::uint16_t& gap = detail::of_lane(gap_, i);
      if (has_squares && gap == beyond_squares) gap = 0;
      gap = gap < beyond_squares - 1 ? static_cast<std::uint16_t>(gap + 1) : restart_due;
    }
  }

  /// Handles a u or a state so large that the prediction is not finite.
  ESOKIT_COLD StepStatus predict_rejecting(S u_applied) noexcept {
    count_missed();
    if (is_finite(u_applied) &&
        !(detail::absolute(u_applied) > detail::absolute(kept_.applied_input))) {
      // u is no larger than the last one, so it is not the cause.
      kept_.applied_input = u_applied;
      gap_ = restart_due;
      return StepStatus::prediction_dropped;
    }
    const LevelStates next = predicted_seldom(kept_.applied_input);
    if (!is_finite(probe(next))) {
      // The state itself cannot be predicted, and perhaps never can again: the next y restarts the
      // observer.
      gap_ = restart_due;
      return StepStatus::input_rejected | StepStatus::prediction_dropped;
    }
    kept_.states = next;
    return StepStatus::input_rejected;
  }

  Status reset_scaled(const State& state) noexcept {
    LevelStates states;
    for (auto& level : states) level = state;
    for (std::size_t i = 1; i < Levels && adds_up; ++i) {
      for (std::size_t r = Order; r < size; ++r) states[i][r] = S(0.0);
    }
    if (!all(is_finite(probe(states)))) return StepStatus::state_rejected;
    kept_.states = states;
    kept_.innovation = S(0.0);
    gap_ = up_to_date();
    detail::unroll<(gain_law_traits<Law>.resets ? Levels : 0)>([&](auto i) { laws_[i].reset(); });
    return StepStatus::ok;
  }

  /// What a good sample writes: scalars only. It survives a retune, all else is replaced.
  struct Numbers {
    LevelStates states{};
    S innovation = S(0.0);
    S applied_input = S(0.0);
  } kept_;
  Laws laws_;
  Model model_;
  Lanes<std::uint16_t, S> gap_{};
  Lanes<std::uint16_t, S> max_gap_;

  // Last, because after a failed assertion the members below it would be missing in derived
  // classes.
  static_assert(Levels >= 1, "esokit: at least one level is needed");
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension, class Law, int Levels, class Model>
inline constexpr std::uint32_t
    type_tag<PredictorCorrector<Order, S, Extension, Law, Levels, Model>> =
        make_type_tag<S, Law, Model>("PredictorCorrector", Order, Extension, Levels);

}  // namespace esokit
