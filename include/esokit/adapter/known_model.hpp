/// @file
/// KnownModel: passes known nonlinear terms of the plant to the observer, which estimates only the
/// rest.
#pragma once

#include <esokit/adapter/adapter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>

namespace esokit {

/// What a known model can do besides fbar, declared in a member `static constexpr PlantModelTraits
/// traits{..}`.
struct PlantModelTraits {
  bool validates = false;  ///< `validate() const` gives the error of a bad parameter, as a Check
};

/// A known part of y^(n): fbar(estimate), noexcept, in the unit of y^(n), a function of y ..
/// y^(n-1) only. What else it can do it declares in PlantModelTraits.
template <class Model, class Observer>
concept PlantModel = std::copyable<Model> &&
    requires(const Model& model, const typename Observer::Estimate& estimate) {
  { model(estimate) } -> std::convertible_to<typename Observer::scalar_type>;
} && DeclaresTraits<Model, PlantModelTraits> && detail::as_declared(
    detail::declared_traits<Model, PlantModelTraits>.validates, detail::names_validate<Model>,
    requires(const Model& model) {
      { model.validate() } -> std::same_as<Check<typename Observer::scalar_type>>;
    });

namespace detail {
template <class Model, class Observer>
consteval bool is_a_term() {
  static_assert(PlantModel<Model, Observer>,
                "esokit: KnownModel needs the type of a function fbar(estimate) that returns a "
                "number, with validate() only if its traits declare it: the concept PlantModel");
  return PlantModel<Model, Observer>;
}
}  // namespace detail

/// Config of KnownModel.
template <class Observer, class Model>
requires(detail::goes_into_a_loop<Observer>()) struct KnownModelConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<KnownModelConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};                      ///< config of the observer
  Model model{};                                             ///< fbar
};

/// Observer of y^(n) = fbar(y, ..) + d + b0 u with fbar known. The chain is driven by u + fbar/b0,
/// with fbar computed from the last estimate and held over the step; so it estimates d only.
///
/// Row n of `estimate`, like `total_disturbance`, is fbar + dhat: this is what a controller
/// cancels. `residual_disturbance` is dhat only.
///
/// For nonlinear terms: friction, gravity, a spring that hardens. Known poles belong in the model
/// of the observer, which is exact and can be analysed (`ModelEso`, `.plant_poles`).
///
/// The change of fbar within a step, O(T), remains in dhat. Because fbar is computed from the
/// estimate, it is part of the error dynamics: omega_o should be well above the slopes of fbar.
///
/// Retuning keeps the estimate fbar + d, so u does not jump: d becomes what the new fbar does not
/// explain.
///
/// A function that is generic in the scalar, `template <class E> auto operator()(const E& x) const
/// noexcept` with `select` for branches, can be written in C by `to_c`, too.
/// @tparam Model your function fbar(estimate)
template <class Observer, class Model>
requires(detail::shifts_disturbance<Observer>() &&
         detail::is_a_term<Model, Observer>()) class KnownModel
    : public NamedAdapter<KnownModel<Observer, Model>, Observer,
                          KnownModelConfig<Observer, Model>> {
  using Base = NamedAdapter<KnownModel, Observer, KnownModelConfig<Observer, Model>>;
  friend Base;
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  using StatusType = StatusOf<S>;
  static_assert(!observer_traits<Observer>.delays_input,
                "esokit: put DelayedInput around KnownModel, not inside it: fbar is not delayed");

 public:
  using Base::order;
  using typename Base::Estimate;

  /// The same on a scalar that records, see `to_c`: packs of it run one by one.
  template <class T>
  requires(records<T>&& ShiftableDisturbance<detail::WithScalar<Observer, T>>&&
               PlantModel<typename detail::ForScalar<Model, T>::type,
                          detail::WithScalar<Observer, T>>) using with_scalar =
      KnownModel<detail::WithScalar<Observer, T>, typename detail::ForScalar<Model, T>::type>;

  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.publishes_chain = false;
    traits.acts_by_gain = false;
    traits.bears_guards = false;
    return traits;
  }();

  /// One sample, see PredictorCorrector::update. `u_applied` is the u that the actuator held,
  /// without the contribution of the model.
  StatusType update(S y, S u_applied) noexcept {
    const S input = accepted(u_applied);
    return report(u_applied) | observer_.update(y, input);
  }

  /// Time update only, see PredictorCorrector::predict.
  StatusType predict(S u_applied) noexcept {
    const S input = accepted(u_applied);
    return report(u_applied) | observer_.predict(input);
  }

  /// Restarts at (y, 0, .., 0), with d zero, as after too long a gap.
  StatusType reset(S y) noexcept { return observer_.reset(y); }

  /// Restarts at a given estimate, whose row n is fbar + d.
  StatusType reset(const Estimate& state) noexcept { return observer_.reset(without_known(state)); }

  /// (y, .., y^(n-1), fbar + d, d', .., d^(m-1)), N x 1, physical units.
  [[nodiscard]] Estimate estimate() const noexcept {
    Estimate state = observer_.estimate();
    state(order) = state(order) + known_part(state);
    return state;
  }

  /// One row of the estimate.
  template <int Row>
  [[nodiscard]] S estimate() const noexcept {
    if constexpr (Row == order) {
      return total_disturbance();
    } else {
      return observer_.template estimate<Row>();
    }
  }

  /// fbar + dhat, unit of y^(n): everything that acts besides b0 u.
  [[nodiscard]] S total_disturbance() const noexcept {
    return known_part() + residual_disturbance();
  }

  /// Estimate of level `level`, N x 1; fbar in its row n is computed from that level's estimate.
  [[nodiscard]] Estimate level_estimate(int level) const noexcept requires
      LevelledObserver<Observer> {
    Estimate state = observer_.level_estimate(level);
    state(order) = state(order) + known_part(state);
    return state;
  }

  /// Deleted, because the chain of the observer contains dhat, not fbar + dhat.
  template <int Row>
  S scaled_estimate() const noexcept = delete;

  /// Deleted, because the contribution of fbar would be lost.
  StepStatus revise_input(const S&) noexcept = delete;

  /// dhat without the known part, unit of y^(n).
  [[nodiscard]] S residual_disturbance() const noexcept { return observer_.total_disturbance(); }

  /// fbar.
  [[nodiscard]] const Model& known_model() const noexcept { return rest_.model; }

  /// fbar at the present estimate, unit of y^(n); zero if it, or fbar + dhat, is not finite.
  [[nodiscard]] S known_part() const noexcept { return known_part(observer_.estimate()); }

  /// The input that the last step used, without the contribution of the model.
  [[nodiscard]] const S& applied_input() const noexcept { return rest_.applied_input; }

 private:
  KnownModel(const Observer& observer, const KnownModelConfig<Observer, Model>& config) noexcept
      : Base(observer), rest_{config.model, S(1) / observer.input_gain(), S(0)} {}

  /// As with `retune`, the estimate fbar + d is kept; d becomes the part that the new fbar does not
  /// explain, and a change of b0 is moved into d as usual. u does not jump.
  Check<S> take(const KnownModel& fresh, const KnownModel& before) noexcept {
    rest_.model = fresh.rest_.model;
    rest_.inverse_gain = fresh.rest_.inverse_gain;
    // The observer added (b0_old - b0_new) times its whole input to d; the share of fbar in this
    // input must be taken out again.
    const S fed = before.observer_.applied_input() - before.rest_.applied_input;
    const S gain_change = before.input_gain() - fresh.input_gain();
    const S moved = before.known_part() - known_part() - gain_change * fed;
    const bool some = !is_finite(moved) || moved < S(0) || moved > S(0);
    if (some && observer_.shift_disturbance(moved) != StepStatus::ok) {
      return Error<S>{"model", moved, "would make the estimate not finite"};
    }
    return {};
  }

  static Check<S> validate(const KnownModelConfig<Observer, Model>& config) {
    if constexpr (detail::declared_traits<Model, PlantModelTraits>.validates) {
      return config.model.validate();
    } else {
      return {};
    }
  }

  /// fbar at an estimate whose row n is dhat.
  [[nodiscard]] S known_part(const Estimate& state) const noexcept {
    const S known = rest_.model(state);
    return select(is_finite(S(known + state(order))), known, S(0.0));
  }

  /// An estimate of y, .., fbar + d as one of the rest.
  [[nodiscard]] Estimate without_known(const Estimate& state) const noexcept {
    Estimate rest = state;
    rest(order) = state(order) - rest_.model(state);
    return rest;
  }

  /// u, or the last good one, plus the contribution of the model.
  S accepted(const S& u) noexcept {
    rest_.applied_input = select(is_finite(u), u, rest_.applied_input);
    return rest_.applied_input + known_part() * rest_.inverse_gain;
  }

  static StatusType report(const S& u) noexcept {
    return all(is_finite(u)) ? StepStatus::ok : StepStatus::input_rejected;
  }

  struct Rest {
    static constexpr int data_members = 3;
    [[no_unique_address]] Model model;
    S inverse_gain;
    S applied_input;
  };
  Rest rest_;
};

/// Distinguishes the type in snapshots.
template <class Observer, class Model>
inline constexpr std::uint32_t type_tag<KnownModel<Observer, Model>> =
    make_type_tag<Observer, Model>("KnownModel");

}  // namespace esokit
