/// @file
/// The sampled predictor-corrector that all observers share.
#pragma once

#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/step_status.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/model/chain_model.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/observer/detail/observer_state.hpp>

namespace esokit {

/// One sample of an observer, as it stands on paper:
///
///     z(k|k-1) = Phi z(k-1) + Gamma u(k-1)             predict
///     z(k)     = z(k|k-1) + k (y(k) - z_1(k|k-1))      correct
///
/// The model gives Phi and Gamma, the gain law gives k. `PredictorCorrector` computes the same in
/// scaled states, which need no products with zeros and ones. It adds levels, missing samples and
/// bad numbers. Tests compare its observers with this one; nothing else calls it.
/// @param phi N x N, exact for a u that is held @param gamma N x 1 @param k N x 1
/// @param z estimate of the sample before, N x 1, physical units like all here
/// @param u what the actuator held since then @param y measurement of now
/// @tparam Matrix, Vector any with `*`, `+` and `(row)`, such as those of Eigen
template <class Matrix, class Vector, class S>
[[nodiscard]] constexpr Vector update_on_paper(const Matrix& phi, const Vector& gamma,
                                               const Vector& k, const Vector& z, S u, S y) {
  const Vector predicted = phi * z + gamma * u;
  return predicted + k * (y - predicted(0));
}

/// The settings that all sampled observers have in common.
template <Scalar S>
struct ChainConfig {
  S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};    ///< T, s
  int max_gap = 100;  ///< missing samples after which the prediction still counts, 1 .. 65000;
                      ///< after more a correction restarts; see `max_gap()`, `longest_gap()`
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
      .demand(1 <= config.max_gap && config.max_gap <= 65000, "max_gap",
              detail::integer<S>(config.max_gap), "must be 1 .. 65000");
}

}  // namespace detail

/// `Levels` chains in series with one gain law each: one level is the plain observer, more are the
/// cascade. Level 1 is corrected by y and driven by u. Level i is corrected by the corrected output
/// of level i - 1 and driven by u and the disturbances found by the levels before it.
///
/// One instance belongs to one thread. No member allocates, throws or locks after `make`.
///
/// After any input, however bad, valid samples lead back to a good estimate. The error decays by
/// e^(-r T) a sample, r the rate of its slowest pole. From the largest number of the scalar to
/// rounding it takes at most 60 + 2 ln(max / epsilon) / (r T) samples. This is tested with every
/// observer and adapter: double 60 + 1500 / (r T), float 60 + 210 / (r T) samples. With all poles
/// at one bandwidth r is omega_o, of a cascade the least bandwidth, of half gains omega_o / 2. It
/// is no faster than what a model computes without correcting it, such as the lag of an actuator (1
/// / tau). `-stability_abscissa(observer_system(observer))` (analysis) is 1 - e^(-r T).
///
/// @tparam Order n, order of the plant @tparam Extension m, extended states
/// @tparam Law gain law, see GainLaw @tparam Levels p
/// @tparam Model what is known of the plant, see ChainModel
template <int Order, class S, int Extension, class Law, int Levels = 1,
          class Model = ChainModel<Order, S, Extension>>
requires(detail::is_a_gain_law<Law, Order + Extension, S>() &&
         detail::is_a_sampled_model<Model, S>()) class PredictorCorrector
    : public ObservedLevels<Order, S, Extension, Law, Levels, Model> {
  static_assert(Levels == 1 || model_traits<Model>.adds_levels ||
                    model_traits<Model>.tells_disturbance,
                "esokit: a cascade needs a model that separates the disturbance: "
                "ModelTraits::adds_levels or tells_disturbance");

  using Base = ObservedLevels<Order, S, Extension, Law, Levels, Model>;

 public:
  using typename Base::Estimate;
  using typename Base::Laws;
  using typename Base::State;
  using typename Base::StatusType;

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
  StatusType update(S y, S u_applied) noexcept {
    numbers_.advance_laws();
    return update_advanced(y, u_applied);
  }

  /// Time update only: one sample without a measurement, or the first half of `update`.
  StatusType predict(S u_applied) noexcept {
    numbers_.advance_laws();
    return predict_advanced(u_applied);
  }

  /// Measurement update only. After a gap it uses the gain for the time since the last correction.
  StatusType correct(S y) noexcept {
    if constexpr (records<S>) {
      (void)correct_all(y);
      return StepStatus::ok;
    } else {
      const unsigned elapsed = this->elapsed();
      const bool overdue = this->restarts();
      if (overdue || !corrected(y, elapsed)) [[unlikely]]
        return restart_from(y, overdue);
      count_correction(elapsed);
      return elapsed > 1 ? StepStatus::gap_bridged : StepStatus::ok;
    }
  }

  /// Call this between `predict` and `correct` if the actuator held `u_applied` instead of the u
  /// given to `predict`. Adds Gamma (u_applied - u_given) to the prediction. A u that is not
  /// finite, or would make the prediction not finite, changes nothing and is reported.
  StatusType revise_input(S u_applied) noexcept {
    LevelStates next = numbers_.kept.states;
    const S more = u_applied - numbers_.kept.applied_input;
    for (auto& state : next) state = numbers_.model.add_input(state, more);
    if (!numbers_.take(next)) [[unlikely]]
      return StepStatus::input_rejected;
    numbers_.kept.applied_input = u_applied;
    return StepStatus::ok;
  }

  /// From the next step on the frequencies of the model are `factor` times those of the config. Phi
  /// is computed exactly, the gain is interpolated in a table from `make`. The estimate is kept,
  /// and with it the phase of each sine. The work is bounded and involves no design. The speed must
  /// change slowly in comparison with the slowest pole. After a retune the factor is 1 again.
  /// @return error for a factor outside the range in the settings: nothing changes then
  Check<S> set_speed(const S& factor) noexcept requires(model_traits<Model>.follows_speed) {
    Laws laws = numbers_.laws;
    for (Law& law : laws) {
      if (auto ok = law.set_speed(factor); !ok) return ok;
    }
    numbers_.laws = laws;
    numbers_.model = numbers_.model.at_speed(factor);
    return {};
  }

  /// Restarts at (y, 0, .., 0). A y that is not finite changes nothing and is reported.
  StatusType reset(S y) noexcept { return reset_scaled(Numbers::standing(y)); }

  /// Restarts at a given estimate, N x 1, physical units. A state that is not finite changes
  /// nothing and is reported.
  StatusType reset(const Estimate& state) noexcept {
    return reset_scaled(numbers_.model.scaled(state));
  }

  /// Moves the origin of y: adds `offset` to z_1 of every level. For periodic quantities, whose
  /// estimate would otherwise grow with every turn.
  /// @return ok, or state_rejected if the offset or the new estimate is not finite: nothing changes
  ///         then
  constexpr StatusType shift_output(const S& offset) noexcept
      requires(model_traits<Model>.shifts_output) {
    constexpr auto y = static_cast<std::size_t>(Model::state_of_row(0));
    LevelStates next = numbers_.kept.states;
    for (auto& state : next) {
      state[0] = state[0] + offset;
      if (y > 0) state[y] = state[y] + offset;
    }
    return shift_to(next);
  }

  /// Adds `offset` (unit of y^(n)) to dhat, for when another term takes over a part of y^(n).
  /// @return as for `shift_output`
  constexpr StatusType shift_disturbance(const S& offset) noexcept {
    LevelStates next = numbers_.kept.states;
    Numbers::add_disturbance(next, numbers_.model.scaled_disturbance(offset));
    return shift_to(next);
  }

  /// Adds `offset` (unit of y^(n), n of the plant) to the load on the plant, for when it is known.
  /// With an actuator in the model the load acts behind it, on y^(n). @return as for `shift_output`
  constexpr StatusType shift_load(const S& offset) noexcept
      requires(model_traits<Model>.is_chain || model_traits<Model>.tells_constant) {
    if constexpr (model_traits<Model>.is_chain) {
      return shift_disturbance(offset);
    } else {
      LevelStates next = numbers_.kept.states;
      const State column = numbers_.model.constant_column();
      const S scaled = numbers_.model.scaled_constant(offset);
      for (auto& state : next) {
        for (std::size_t i = 0; i < column.size(); ++i) state[i] = state[i] + column[i] * scaled;
      }
      return shift_to(next);
    }
  }

  /// Takes over the settings of `fresh` and keeps the estimate. States are rescaled to its sample
  /// time, and a change of b0 is moved into the disturbance, dhat += (b0_old - b0_new) u, so that
  /// the control does not jump. A law goes on with its memory, if it declares that it can.
  Check<S> adopt(const PredictorCorrector& fresh) {
    PredictorCorrector next = fresh;
    if constexpr (gain_law_traits<Law>.continues) {
      const S time_ratio = fresh.sample_time() / this->sample_time();
      for (std::size_t i = 0; i < Levels; ++i) {
        if (auto ok = next.numbers_.laws[i].continue_from(numbers_.laws[i], time_ratio); !ok)
          return ok;
      }
    }
    next.numbers_.kept = numbers_.kept;
    // What is due was counted with other gains: it begins anew.
    if (recovering_ > 0) next.recovering_ = static_cast<std::uint16_t>(next.most_due());
    next.gap_ = this->missed() == 0 ? next.up_to_date() : gap_;
    LevelStates states = numbers_.kept.states;
    const Model& model = fresh.model();
    for (State& state : states) state = model.rescaled(state, numbers_.model);
    if (!model.same_drive(numbers_.model)) {
      const S explained = (this->input_gain() - fresh.input_gain()) * numbers_.kept.applied_input;
      Numbers::add_disturbance(states, model.scaled_disturbance(explained));
    }
    if (!next.numbers_.take(states)) {
      return Error<S>{"input_gain", fresh.input_gain(), "would make the estimate not finite"};
    }
    *this = next;
    return {};
  }

 protected:
  /// At rest at zero; `config` is already checked.
  PredictorCorrector(const ChainConfig<S>& config, const Laws& laws) noexcept requires
      std::same_as<Model, ChainModel<Order, S, Extension>>
      : Base(laws, Model(config.input_gain, config.sample_time), config.max_gap) {}

  /// The same with a model from its own `make`. @param laws one for each level, or one law for one
  /// level @param max_gap as in the config
  template <class Given>
  PredictorCorrector(const Model& model, const Given& laws, int max_gap) noexcept
      : Base(Laws{laws}, model, max_gap) {}

  /// The rules for input_gain, sample_time and max_gap.
  static Check<S> check_chain(const ChainConfig<S>& config) {
    return detail::check_chain<Order, S>(config);
  }

  /// For packs and while all is well: whether no lane needs more than `step`. Then the laws are one
  /// sample on.
  ESOKIT_INLINE bool advance() noexcept {
    if (!this->may_be_quick()) [[unlikely]]
      return false;
    numbers_.advance_laws();
    return true;
  }

  /// One sample, after `advance`. False, and nothing has changed, if it is not a good one. One test
  /// for all faults: a bad y or u makes the new state non-finite.
  ESOKIT_INLINE bool step(const S& y, const S& u_applied) noexcept {
    return numbers_.step(y, u_applied);
  }

  /// @cond
  // The halves of it, the first after `advance_predict`.
  ESOKIT_INLINE bool advance_predict() noexcept {
    numbers_.advance_laws();
    return true;
  }
  ESOKIT_INLINE bool predict_all(const S& u_applied) noexcept {
    if (!numbers_.take(numbers_.predicted(u_applied))) [[unlikely]]
      return false;
    count_prediction(u_applied);
    return true;
  }
  ESOKIT_INLINE bool correct_all(const S& y) noexcept {
    if (!(gap_ == 1 || gap_ == 0) || (Base::recovers && !(recovering_ == 0))) [[unlikely]]
      return false;
    if (!numbers_.template correct<true>(y, 1u)) [[unlikely]]
      return false;
    gap_ = up_to_date();
    return true;
  }
  /// @endcond

  /// `update` after the laws have advanced, for derived observers.
  ESOKIT_INLINE StatusType update_advanced(const S& y, const S& u_applied) noexcept {
    if (this->may_be_quick() && step(y, u_applied)) [[likely]]
      return StepStatus::ok;
    if constexpr (records<S>) {
      return StepStatus::ok;
    } else {
      return update_guarded(y, u_applied);
    }
  }

  static constexpr bool advances = gain_law_traits<Law>.advances;  ///< `advance` changes the laws

 private:
  friend struct detail::LaneAccess;
  friend struct detail::GuardAccess;
  friend struct detail::RecordAccess;

  using typename Base::Numbers;
  using LevelStates = typename Numbers::LevelStates;
  using Base::gap_;
  using Base::max_gap_;
  using Base::numbers_;
  using Base::recovering_;
  using Base::up_to_date;

  /// A gap longer than any max_gap.
  static constexpr std::uint16_t restart_due = 65535;

  constexpr StatusType shift_to(const LevelStates& next) noexcept {
    return numbers_.take(next) ? StepStatus::ok : StepStatus::state_rejected;
  }

  /// False, and nothing has changed, if the result is not finite. @param elapsed 1: no gap
  constexpr bool corrected(S y, unsigned elapsed) noexcept {
    return numbers_.template correct<false>(y, elapsed);
  }
  /// After a correction. @param elapsed 1: no gap
  constexpr void count_correction(unsigned elapsed) noexcept {
    if constexpr (Base::recovers) {
      if (elapsed > 1 || recovering_ > 0) [[unlikely]]
        count_recovery(elapsed);
    }
    gap_ = up_to_date();
  }
  ESOKIT_COLD void count_recovery(unsigned elapsed) noexcept {
    constexpr std::uint16_t beyond = 65535;  // more than can be counted: until a restart
    if (recovering_ == beyond) return;
    const int due =
        recovering_ + (elapsed > 1 ? detail::recovery_after(numbers_.laws, elapsed) : -1);
    recovering_ = due < 0        ? std::uint16_t{0}
                  : due < beyond ? static_cast<std::uint16_t>(due)
                                 : beyond;
  }
  /// After a gap that is not bridged, or if y cannot correct the state.
  ESOKIT_COLD StepStatus restart_from(S y, bool overdue) noexcept {
    // A finite but absurdly large u can lead to a prediction from which no good y recovers.
    const bool due = overdue || detail::absolute(y) < detail::absolute(numbers_.kept.states[0][0]);
    return is_finite(y) && due && reset(y) == StepStatus::ok ? StepStatus::restarted
                                                             : StepStatus::measurement_rejected;
  }
  constexpr void count_prediction(const S& u) noexcept {
    count_missed();
    numbers_.kept.applied_input = u;
  }
  ESOKIT_COLD LevelStates predicted_seldom(S u) const noexcept { return numbers_.predicted(u); }
  ESOKIT_COLD bool take_seldom(const LevelStates& next) noexcept { return numbers_.take(next); }

  ESOKIT_COLD StatusType update_guarded(S y, S u_applied) noexcept {
    const LevelStates before = numbers_.kept.states;
    const LevelStates next = predicted_seldom(u_applied);
    if (Numbers::has_squares && this->missed() == 0) {  // perhaps only the squares overflowed
      numbers_.kept.states = next;
      if (corrected(y, 1u)) {
        numbers_.kept.applied_input = u_applied;
        count_correction(1u);
        return StepStatus::ok;
      }
      numbers_.kept.states = before;
    }
    StepStatus predicted = StepStatus::ok;
    if (take_seldom(next)) {
      count_prediction(u_applied);
    } else {
      predicted = predict_rejecting(u_applied);
    }
    return predicted | correct(y);
  }

  StatusType predict_advanced(S u_applied) noexcept {
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
      if (gap == Base::not_quick) gap = 0;
      gap = gap < Base::not_quick - 1 ? static_cast<std::uint16_t>(gap + 1) : restart_due;
    }
  }

  /// Handles a u or a state so large that the prediction is not finite.
  ESOKIT_COLD StepStatus predict_rejecting(S u_applied) noexcept {
    count_missed();
    if (is_finite(u_applied) &&
        !(detail::absolute(u_applied) > detail::absolute(numbers_.kept.applied_input))) {
      // u is no larger than the last one, so it is not the cause.
      numbers_.kept.applied_input = u_applied;
      gap_ = restart_due;
      return StepStatus::prediction_dropped;
    }
    if (take_seldom(predicted_seldom(numbers_.kept.applied_input))) {
      return StepStatus::input_rejected;
    }
    // The state itself cannot be predicted, and perhaps never can again: the next y restarts the
    // observer.
    gap_ = restart_due;
    return StepStatus::input_rejected | StepStatus::prediction_dropped;
  }

  StatusType reset_scaled(const State& state) noexcept {
    LevelStates states;
    for (auto& level : states) level = state;
    for (std::size_t i = 1; i < Levels && Numbers::adds_up; ++i) {
      for (std::size_t r = Order; r < state.size(); ++r) states[i][r] = S(0.0);
    }
    if (!take_seldom(states)) return StepStatus::state_rejected;
    numbers_.kept.innovation = S(0.0);
    recovering_ = {};
    gap_ = up_to_date();
    detail::unroll<(gain_law_traits<Law>.resets ? Levels : 0)>(
        [&](auto i) { numbers_.laws[i].reset(); });
    return StepStatus::ok;
  }

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
