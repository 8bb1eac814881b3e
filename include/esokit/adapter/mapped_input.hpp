/// @file
/// MappedInput: an observer, and the controller around it, for a plant whose actuator has a curve.
#pragma once

#include <esokit/adapter/actuator_map.hpp>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/lanes.hpp>
#include <utility>

namespace esokit {

/// Config of MappedInput.
template <class Observer, int Points>
requires(detail::goes_into_a_loop<Observer>()) struct MappedInputConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<MappedInputConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};  ///< config of the observer; b0 is y^(n) per effect
  ActuatorCurve<S, Points> curve{};      ///< of the actuator
};

namespace detail {

template <class Observer, int Points>
inline constexpr bool goes_around_guards<MappedInputConfig<Observer, Points>> = true;

}  // namespace detail

/// For an actuator with a dead zone, two gains or a curve: the observer inside gets the effect of
/// u, so that b0 is one number. A controller around it puts out the u whose effect its law asks
/// for.
///
/// In the unit of u, as without a curve, is all that goes to the actuator or comes from it: limits
/// and their rate, `start_hold`, `missing.input`, `start`, `track`, `hold`, `applied`, `output()`,
/// `requested()`. In the unit of an effect is what belongs to the plant: b0, dhat / b0, and of
/// DisturbanceCompensator `compensation_gain`, u0 and `base_output()`.
///
/// It is the outermost adapter, also of Guarded, whose members it has. PredictiveAdrc takes it
/// around what it takes without. MimoAdrc does not: its channels are not its actuators.
///
/// Analysis (`linear_controller`) is of the loop from y to the effect. A curve that is not that of
/// the actuator leaves a gain that changes with u: ActuatorMap::gain_left says how much, and the
/// margins have to bear it.
/// @tparam Points most points of the curve; the memory is 5 scalars for each, and 3
template <class Observer, int Points = 9>
requires(detail::goes_into_a_loop<Observer>()) class MappedInput
    : public NamedAdapter<MappedInput<Observer, Points>, Observer,
                          MappedInputConfig<Observer, Points>> {
  using Base = NamedAdapter<MappedInput, Observer, MappedInputConfig<Observer, Points>>;
  friend Base;
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  using StatusType = StatusOf<S>;
  static constexpr bool guards = observer_traits<Observer>.gates_disturbance;
  static constexpr bool changes_gain = observer_traits<Observer>.schedules_input_gain;
  static constexpr bool foretells = observer_traits<Observer>.is_predictable;

 public:
  using Map = ActuatorMap<S, Points>;        ///< the curve in both directions
  using typename Base::Config;               ///< settings of make
  using Estimate = typename Base::Estimate;  ///< (y, .., y^(n-1), d, ..), N x 1

  /// The same with another scalar. Not one that records, as a line of the curve is chosen.
  template <class T>
  requires(!records<T> && LoopObserver<detail::WithScalar<Observer, T>>) using with_scalar =
      MappedInput<detail::WithScalar<Observer, T>, Points>;

  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = observer_traits<Observer>;
    traits.adapts = true;
    traits.maps_input = true;
    return traits;
  }();

  /// Checks the settings and does all the design work.
  /// @return the observer at rest at zero, or an error that names the field
  static Expected<MappedInput, Error<S>> make(const Config& config) {
    static_assert(detail::refuses_packs<S>());
    const auto map = Map::make(config.curve);
    if (!map) return map.error();
    const auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    return MappedInput(*observer, *map);
  }

  /// The map of the actuator.
  [[nodiscard]] const Map& map() const noexcept { return rest_.map; }
  /// The effect of u.
  [[nodiscard]] ESOKIT_INLINE S effect_of(const S& u) const noexcept { return map().effect(u); }
  /// The u with this effect.
  [[nodiscard]] ESOKIT_INLINE S input_for(const S& effect) const noexcept {
    return map().input(effect);
  }

  /// One sample, see PredictorCorrector::update. @param u_applied of the actuator, not its effect
  StatusType update(S y, S u_applied) noexcept { return observer_.update(y, reported(u_applied)); }
  /// Time update only, see PredictorCorrector::predict.
  StatusType predict(S u_applied) noexcept { return observer_.predict(reported(u_applied)); }

  /// Members of the observer that take or give a u.
  /// @{
  [[nodiscard]] S applied_input() const noexcept {
    return detail::clipped(input_for(observer_.applied_input()));
  }
  [[nodiscard]] Estimate equilibrium(const S& y, const S& u) const noexcept {
    return observer_.equilibrium(y, effect_of(u));
  }
  void fill_input(const S& u) noexcept requires(observer_traits<Observer>.delays_input) {
    observer_.fill_input(effect_of(u));
  }
  StatusType revise_input(const S& u_applied) noexcept requires requires(Observer& o, const S& s) {
    o.revise_input(s);
  }
  { return observer_.revise_input(reported(u_applied)); }
  S hold(const S& u_applied) noexcept requires guards {
    return input_for(observer_.hold(effect_of(u_applied)));
  }
  [[nodiscard]] S holding_input() const noexcept requires guards {
    return input_for(observer_.holding_input());
  }
  /// @}

  /// Members of Guarded.
  /// @{
  void release() noexcept requires guards { observer_.release(); }
  StatusType set_trust(const S& phi) noexcept requires guards { return observer_.set_trust(phi); }
  template <class Where>
  void set_pin(Where where) noexcept requires guards {
    observer_.set_pin(where);
  }
  [[nodiscard]] const S& trust() const noexcept requires guards { return observer_.trust(); }
  [[nodiscard]] auto pin() const noexcept requires guards { return observer_.pin(); }
  [[nodiscard]] Estimate leak_error() const noexcept requires guards {
    return observer_.leak_error();
  }
  Check<S> set_input_gain(const S& b) noexcept requires changes_gain {
    return observer_.set_input_gain(b);
  }
  [[nodiscard]] const S& input_factor() const noexcept requires changes_gain {
    return observer_.input_factor();
  }
  [[nodiscard]] S present_input_gain() const noexcept requires changes_gain {
    return observer_.present_input_gain();
  }
  [[nodiscard]] bool gated() const noexcept requires changes_gain { return observer_.gated(); }
  [[nodiscard]] bool bounded() const noexcept requires changes_gain { return observer_.bounded(); }
  [[nodiscard]] const S& leak_share() const noexcept requires changes_gain {
    return observer_.leak_share();
  }
  /// @}

  /// What PredictiveAdrc asks of the observer, see PredictableObserver.
  /// @{
  [[nodiscard]] auto correction_gain(const S& e) const noexcept requires
      requires(const Observer& o) {
    o.correction_gain(e);
  }
  { return observer_.correction_gain(e); }
  [[nodiscard]] auto preview() const noexcept requires requires(const Observer& o) { o.preview(); }
  { return observer_.preview(); }
  template <class State>
  [[nodiscard]] S finite_probe(const State& x) const noexcept requires foretells {
    return observer_.finite_probe(x);
  }
  [[nodiscard]] const auto& gain_law() const noexcept requires requires(const Observer& o) {
    o.gain_law();
  }
  { return observer_.gain_law(); }
  [[nodiscard]] auto accepts(const S& y) const noexcept
      requires(observer_traits<Observer>.gates_outliers) {
    return observer_.accepts(y);
  }
  [[nodiscard]] auto blanked() const noexcept requires(observer_traits<Observer>.blanks_estimate) {
    return observer_.blanked();
  }
  /// @}

 private:
  static constexpr bool advances = detail::LaneAccess::advances<Observer>;

  MappedInput(const Observer& observer, const Map& map) noexcept : Base(observer), rest_{map} {}

  void take(const MappedInput& fresh) noexcept { rest_.map = fresh.rest_.map; }

  /// For packs, see PredictorCorrector. Templates, as an explicit instantiation would ask it of
  /// every observer.
  /// @{
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) ESOKIT_INLINE bool advance() noexcept {
    return detail::LaneAccess::advance(observer_);
  }
  template <class O = Observer>
  ESOKIT_INLINE bool step(const S& y, const S& u) noexcept {
    return detail::LaneAccess::step(observer_, y, effect_of(u));
  }
  template <class O = Observer>
  StatusType update_advanced(const S& y, const S& u) noexcept {
    return detail::LaneAccess::update_advanced(observer_, y, effect_of(u));
  }
  template <class O = Observer>
  ESOKIT_INLINE bool advance_predict() noexcept {
    return detail::LaneAccess::advance_predict(observer_);
  }
  template <class O = Observer>
  ESOKIT_INLINE bool predict_all(const S& u) noexcept {
    return detail::LaneAccess::predict_all(observer_, effect_of(u));
  }
  template <class O = Observer>
  StatusType predict_advanced(const S& u) noexcept {
    return detail::LaneAccess::predict_advanced(observer_, effect_of(u));
  }
  template <class O = Observer>
  ESOKIT_INLINE bool correct_all(const S& y) noexcept {
    return detail::LaneAccess::correct_all(observer_, y);
  }
  /// @}

  /// The effect of a u that somebody reports: what is not finite stays so, also under -ffast-math,
  /// where the lines of a curve may make a number of it.
  [[nodiscard]] S reported(const S& u) const noexcept {
    return select(is_finite(u), effect_of(u), u);
  }

  struct Rest {
    Map map;
  };
  Rest rest_;
};

/// Distinguishes the type in snapshots.
template <class Observer, int Points>
inline constexpr std::uint32_t type_tag<MappedInput<Observer, Points>> =
    make_type_tag<Observer>("MappedInput", Points);

}  // namespace esokit
