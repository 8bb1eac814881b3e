/// @file
/// What controllers, adapters and analysis require of an observer, one concept for each need; and
/// the traits by which an observer declares what else it can do.
///
/// | concept | who needs it |
/// |---|---|
/// | LoopObserver | ControlLoop, Adrc, DisturbanceCompensator, DelayedInput |
/// | RestartingObserver | VariableTime |
/// | ShiftableOutput | WrappedOutput |
/// | ShiftableDisturbance | KnownModel, MimoAdrc |
/// | ShiftableLoad | Measured |
/// | PredictableObserver | PredictiveAdrc |
/// | SampledLinearObserver | analysis |
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/declared_traits.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/core/step_status.hpp>
#include <esokit/gain/gain_law.hpp>
#include <type_traits>
#include <utility>

namespace esokit {

namespace detail {

/// Access of Guarded to the disturbance in an observer, through any adapters.
struct GuardAccess;

}  // namespace detail

/// What an observer declares beyond LoopObserver, in a member `static constexpr ObserverTraits
/// traits{..}`. For an observer without it the defaults apply.
struct ObserverTraits {
  /// It keeps its bandwidth if only every D-th sample has a measurement. False for AlgebraicEso: a
  /// gap among its first samples restarts its schedule.
  bool bears_regular_gaps = true;

  /// It publishes the state of its chain, and its sample time is fixed: `scaled_estimate<Row>()
  /// const` is T^r / r! times `estimate<Row>()`. Adrc then includes the factors in its gains. False
  /// for AlgebraicEso (blanked at first), KnownModel and VariableTime.
  bool publishes_chain = false;

  /// Its behaviour is determined by its chain and `level_gain(level) const`, so that analysis can
  /// derive a linear system. False if a delay or known terms are added.
  bool acts_by_gain = false;

  /// Its next correction is known before the measurement, see PredictableObserver.
  bool is_predictable = false;
  GainKind gain_kind = GainKind::general;  ///< the kind of its gain, if predictable

  /// The measurement is row 0 of the estimate; false if it passes a sensor with a lag.
  bool measures_first_row = true;

  /// It is an adapter around an observer `Adapted`, whose config is the member `observer` of the
  /// adapter's config.
  bool adapts = false;

  bool wraps_output = false;  ///< y is an angle: `wrap(difference) const`
  bool delays_input = false;  ///< u acts late: `fill_input(u)`, as if u had been applied for long

  /// Its actuator has a curve: `effect_of(u) const` and its inverse `input_for(effect) const`, by
  /// which a controller turns what its law asks for into a u, see MappedInput.
  bool maps_input = false;

  /// Disturbances are measured: `measured(w)` before each step, `revise_measured()`,
  /// `settle_measured()`, see Measured.
  bool takes_measured = false;
  bool varies_time = false;  ///< `set_step_time(seconds)` or `elapsed(seconds)`, before each step,
                             ///< and `step_time() const`, its present length, and `bridges(steps)
                             ///< const`, see VariableTime
  bool gates_outliers =
      false;  ///< `accepts(y) const`: false if `correct` would reject y as an outlier

  /// Its `correct`, or that of the adapted observer, may return `outlier_rejected`.
  bool rejects_outliers = false;

  bool blanks_estimate = false;  ///< `blanked() const`: true while `estimate` is an old one

  /// Its dhat is changed only by a constant gain, and its model separates it, so that it can be
  /// used in Guarded.
  bool bears_guards = false;

  /// It has `set_input_gain(b)` for use while it runs, and `input_factor() const`, by which a law
  /// multiplies a u computed with the config's b0; see Guarded.
  bool schedules_input_gain = false;

  /// It has `set_trust(phi)`, `trust() const`, `hold(u)` and `release()`, see Guarded.
  bool gates_disturbance = false;
};

/// The traits that an observer declares, or the defaults.
template <class O>
inline constexpr ObserverTraits observer_traits = detail::declared_traits<O, ObserverTraits>;

/// The part of a config with `input_gain`, `sample_time` and `max_gap`: the config of an adapter
/// contains that of its observer as `observer`. @tparam O the observer to which the config belongs
template <class O, class Config>
constexpr auto& chain_config(Config& config) noexcept {
  if constexpr (observer_traits<O>.adapts) {
    return chain_config<typename O::Adapted>(config.observer);
  } else {
    return config;
  }
}

namespace detail {

template <class Class, class Result>
Class declaring_class(Result (Class::*)() const);
template <class Class, class Result>
Class declaring_class(Result (Class::*)() const noexcept);

/// False if a derived class overrides what its base publishes without declaring it.
template <class O>
concept PublishesWhatItsChainHas = !requires {
  declaring_class(&O::total_disturbance);
  declaring_class(&O::template scaled_estimate<O::order>);
}
|| requires {
  requires std::same_as<decltype(declaring_class(&O::total_disturbance)),
                        decltype(declaring_class(&O::template scaled_estimate<O::order>))>;
};

// What a type declares to have; another type may have it, too.
template <class O>
concept PublishesChainAsDeclared =
    !observer_traits<O>.publishes_chain || (PublishesWhatItsChainHas<O> && requires(const O& o) {
      { o.template scaled_estimate<0>() } -> std::convertible_to<typename O::scalar_type>;
      { o.template scaled_estimate<O::order>() } -> std::convertible_to<typename O::scalar_type>;
    });
template <class O>
concept ActsByGainAsDeclared = !observer_traits<O>.acts_by_gain || requires(const O& o) {
  { O::levels } -> std::convertible_to<int>;
  { o.level_gain(0) } -> GainOf<O::size, typename O::scalar_type>;
};
template <class O>
concept AdaptsAsDeclared = !observer_traits<O>.adapts || requires(typename O::Config config) {
  { config.observer } -> std::same_as<typename O::Adapted::Config&>;
};

template <class O>
concept TakesOneOrSeveral = requires(O& o, const typename O::scalar_type& s) {
  o.measured(s);
}
|| O::inputs > 1;

/// @cond
// clang-format off
// The hooks, as in gain/gain_law.hpp.
#define ESOKIT_OBSERVER_HOOKS(HOOK, MISTAKEN)                                                     \
  HOOK(WrapsOutput, wraps_output, wrap, { fixed.wrap(s) } -> std::convertible_to<S>;)             \
  MISTAKEN(wraps)                                                                                 \
  HOOK(DelaysInput, delays_input, fill_input, o.fill_input(s);)                                   \
  MISTAKEN(fill_inputs)                                                                           \
  HOOK(MapsInput, maps_input, input_for, { fixed.effect_of(s) } -> std::convertible_to<S>;        \
       { fixed.input_for(s) } -> std::convertible_to<S>;)                                         \
  HOOK(TakesMeasured, takes_measured, revise_measured, o.revise_measured(); o.settle_measured();  \
       requires TakesOneOrSeveral<O>;)                                                            \
  HOOK(VariesTime, varies_time, set_step_time, { o.set_step_time(s) } -> std::same_as<Check<S>>;  \
       { o.elapsed(s) } -> std::same_as<Expected<int, Error<S>>>;                                 \
       { fixed.step_time() } -> std::convertible_to<S>;                                           \
       { fixed.bridges(1) } -> std::same_as<bool>;)                                               \
  MISTAKEN(set_sample_time)                                                                       \
  HOOK(GatesOutliers, gates_outliers, accepts,                                                    \
       { fixed.accepts(s) } -> std::same_as<Lanes<bool, S>>;)                                     \
  MISTAKEN(accept)                                                                                \
  HOOK(BlanksEstimate, blanks_estimate, blanked,                                                  \
       { fixed.blanked() } -> std::same_as<Lanes<bool, S>>;)                                      \
  HOOK(SchedulesInputGain, schedules_input_gain, input_factor,                                    \
       { o.set_input_gain(s) } -> std::same_as<Check<S>>;                                         \
       { fixed.input_factor() } -> std::convertible_to<S>;)                                       \
  HOOK(GatesDisturbance, gates_disturbance, set_trust, o.set_trust(s); o.release();               \
       { fixed.trust() } -> std::convertible_to<S>;                                               \
       { o.hold(s) } -> std::convertible_to<S>;)
// clang-format on

// An adapter has members for everything that it passes on, even if what it consists of has no such
// member.
#define ESOKIT_OBSERVER_HOOK(Hook, declared, name, ...)        \
  ESOKIT_MEMBER_NAME(name)                                     \
  template <class O, class S = typename O::scalar_type>        \
  concept Hook = requires(O & o, const O& fixed, const S& s) { \
    __VA_ARGS__                                                \
  };                                                           \
  template <class O>                                           \
  concept Hook##AsDeclared =                                   \
      as_declared(observer_traits<O>.declared,                 \
                  observer_traits<O>.adapts ? Hook<O> : names_##name<O>, Hook<O>);
ESOKIT_OBSERVER_HOOKS(ESOKIT_OBSERVER_HOOK, ESOKIT_MEMBER_FUNCTION)

#define ESOKIT_AND_OBSERVER_HOOK(Hook, ...) &&detail::Hook##AsDeclared<O>
#define ESOKIT_AND_NOT_MISTAKEN_OBSERVER(name) &&!detail::calls_##name<O>
/// @endcond

}  // namespace detail

/// The type has everything that `traits` declares, and nothing that it does not declare, nor a
/// member function whose name is almost that of a hook.
template <class O>
concept ObserverAsDeclared = DeclaresTraits<O, ObserverTraits> &&
    detail::PublishesChainAsDeclared<O> && detail::ActsByGainAsDeclared<O> &&
    detail::AdaptsAsDeclared<O>
        ESOKIT_OBSERVER_HOOKS(ESOKIT_AND_OBSERVER_HOOK, ESOKIT_AND_NOT_MISTAKEN_OBSERVER);

/// A config with b0, T and the longest gap that is bridged.
template <class Config, class S>
concept ChainSettings = requires(Config& config) {
  { config.input_gain } -> std::same_as<S&>;
  { config.sample_time } -> std::same_as<S&>;
  { config.max_gap } -> std::same_as<int&>;
};

/// A sampled observer of plain scalars or packs, with a Config. For packs, results that are not
/// numbers have one value for each lane: Lanes<..>, StatusOf.
template <class O>
concept LoopObserver = std::copyable<O> && PlainScalar<LaneScalar<typename O::scalar_type>> &&
    requires(O& observer, const O& constant, const typename O::scalar_type& s,
             const typename O::Estimate& state, typename O::Config& config) {
  requires O::order >= 1 && O::size > O::order;
  requires std::same_as<typename O::Estimate, Vector<typename O::scalar_type, O::size>>;
  { O::make(config) } -> std::same_as<Expected<O, Error<typename O::scalar_type>>>;
  { observer.adopt(constant) } -> std::same_as<Check<typename O::scalar_type>>;
  { observer.update(s, s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.predict(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.correct(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.reset(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.reset(state) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { constant.estimate() } -> std::same_as<typename O::Estimate>;
  { constant.template estimate<0>() } -> std::convertible_to<typename O::scalar_type>;
  { constant.total_disturbance() } -> std::convertible_to<typename O::scalar_type>;
  { constant.applied_input() } -> std::convertible_to<typename O::scalar_type>;
  { constant.equilibrium(s, s) } -> std::same_as<typename O::Estimate>;
  { constant.input_gain() } -> std::convertible_to<typename O::scalar_type>;
  { constant.sample_time() } -> std::convertible_to<typename O::scalar_type>;
  { constant.missed() } -> std::convertible_to<Lanes<int, typename O::scalar_type>>;
  { constant.max_gap() } -> std::convertible_to<int>;
} && ObserverAsDeclared<O> && requires(typename O::Config& config) {
  { chain_config<O>(config) } -> ChainSettings<typename O::scalar_type>;
};

/// An observer that tells whether so many samples are missing that the next `correct` restarts it.
template <class O>
concept RestartingObserver = LoopObserver<O> && requires(const O& observer) {
  { observer.restarts() } -> std::same_as<Lanes<bool, typename O::scalar_type>>;
};

/// An observer with `level_estimate(level)`: the computed estimate of each level, even if another
/// one is published. Level 0 is corrected by the measurement, the last level is the estimate.
template <class O>
concept LevelledObserver = LoopObserver<O> && requires(const O& observer) {
  { O::levels } -> std::convertible_to<int>;
  { observer.level_estimate(0) } -> std::same_as<typename O::Estimate>;
};

/// A levelled observer whose y may be shifted: `shift_output(offset)` adds to y in all levels. It
/// returns ok, or state_rejected if the estimate would not be finite; nothing changes then.
template <class O>
concept ShiftableOutput = LevelledObserver<O> &&
    requires(O& observer, const typename O::scalar_type& s) {
  { observer.shift_output(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
};

/// An observer whose disturbance may be shifted: `shift_disturbance(offset)` adds to dhat, for when
/// another term takes over a part of y^(n). It returns the same as `shift_output`.
template <class O>
concept ShiftableDisturbance = LoopObserver<O> &&
    requires(O& observer, const typename O::scalar_type& s) {
  { observer.shift_disturbance(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
};

/// An observer that can be given a load on the plant: `shift_load(offset)` adds to the constant
/// part of the disturbance, unit of y^(n) with n of the plant. It returns the same as
/// `shift_output`.
template <class O>
concept ShiftableLoad = LoopObserver<O> && requires(O& observer, const typename O::scalar_type& s) {
  { observer.shift_load(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
};

namespace detail {

/// The effect of a u, and the u with an effect, by the curve of an actuator; without one the same
/// number, not even copied.
/// @{
template <class Observer, Scalar S>
using Turned = std::conditional_t<observer_traits<Observer>.maps_input, S, const S&>;
template <class Observer, Scalar S>
ESOKIT_INLINE Turned<Observer, S> effect_of(const Observer& observer, const S& u) noexcept {
  if constexpr (observer_traits<Observer>.maps_input) {
    return observer.effect_of(u);
  } else {
    return u;
  }
}
template <class Observer, Scalar S>
ESOKIT_INLINE Turned<Observer, S> input_for(const Observer& observer, const S& effect) noexcept {
  if constexpr (observer_traits<Observer>.maps_input) {
    return observer.input_for(effect);
  } else {
    return effect;
  }
}
/// @}

/// The members that PredictiveAdrc needs for a kind of gain.
template <class O, GainKind kind>
concept ForetellsByKind = kind == GainKind::general || requires(const O& o) {
  requires kind == GainKind::preset;
  { o.preview().offset } -> GainOf<O::size, typename O::scalar_type>;
  { o.preview().slope } -> GainOf<O::size, typename O::scalar_type>;
  { o.finite_probe(o.preview().slope) } -> std::convertible_to<typename O::scalar_type>;
}
|| requires(const O& o) {
  requires kind == GainKind::switched;
  requires Switched < std::remove_cvref_t<decltype(o.gain_law())>, O::size,
  typename O::scalar_type > ;
}
|| requires(const O& o) {
  requires kind == GainKind::factored;
  requires Factored < std::remove_cvref_t<decltype(o.gain_law())>, O::size,
  typename O::scalar_type > ;
};

}  // namespace detail

/// An observer whose next correction is known before the measurement. Adapters are not, because
/// they change y, u or the estimate; but Measured, which only predicts more, is. Packs are
/// accepted.
///
/// It declares `traits.is_predictable` and the kind of its gain, see GainKind:
/// - with one level `correction_gain(e) const` is the scaled gain of the next correction;
/// - preset: `preview() const`, and `finite_probe(x) const`, see PredictorCorrector;
/// - switched, factored: `gain_law() const` has the members that the kind requires;
/// - general: nothing more; everything is then computed after the measurement.
template <class O>
concept PredictableObserver = std::copyable<O> && Scalar<typename O::scalar_type> &&
    ObserverAsDeclared<O> && observer_traits<O>
.is_predictable&& requires(O& observer, const O& constant, const typename O::scalar_type& s,
                           const typename O::Estimate& state, typename O::Config& config) {
  requires O::order >= 1 && O::size > O::order&& O::levels >= 1;
  { chain_config<O>(config) } -> ChainSettings<typename O::scalar_type>;
  { O::make(config) } -> std::same_as<Expected<O, Error<typename O::scalar_type>>>;
  { observer.adopt(constant) } -> std::same_as<Check<typename O::scalar_type>>;
  { observer.predict(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.correct(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.revise_input(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.reset(s) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { observer.reset(state) } -> std::same_as<StatusOf<typename O::scalar_type>>;
  { constant.estimate() } -> std::same_as<typename O::Estimate>;
  { constant.template scaled_estimate<0>() } -> std::convertible_to<typename O::scalar_type>;
  { constant.equilibrium(s, s) } -> std::same_as<typename O::Estimate>;
  { constant.input_gain() } -> std::convertible_to<typename O::scalar_type>;
  { constant.sample_time() } -> std::convertible_to<typename O::scalar_type>;
  { constant.missed() } -> std::convertible_to<Lanes<int, typename O::scalar_type>>;
  { constant.restarts() } -> std::same_as<Lanes<bool, typename O::scalar_type>>;
}
&&(O::levels > 1 ||
   requires(const O& constant, const typename O::scalar_type& s) {
     { constant.correction_gain(s) } -> detail::GainOf<O::size, typename O::scalar_type>;
   }) &&
    detail::ForetellsByKind<O, observer_traits<O>.gain_kind>;

/// A sampled observer whose gain does not depend on the measurement: LinearEso, CascadeEso, a
/// settled AlgebraicEso, an ExtendedStateFilter. It is analysed with its present gain.
template <class O>
concept SampledLinearObserver = ObserverAsDeclared<O> && observer_traits<O>
.acts_by_gain&& requires(const O& observer) {
  { O::order + O::extension + O::levels } -> std::convertible_to<int>;
  static_cast<double>(observer.input_gain());
  static_cast<double>(observer.sample_time());
  observer.model().increment();
};

namespace detail {

/// What a class template demands of its arguments, in a sentence: a constraint of it alone begins
/// its error with the template's heading, and says at the end what is meant. @{
template <class O>
consteval bool goes_into_a_loop() {
  static_assert(LoopObserver<O>,
                "esokit: controllers and adapters take the type of an observer, such as "
                "LinearEso<2>, with all that LoopObserver lists and declared in its traits");
  return LoopObserver<O>;
}
template <class O>
consteval bool foretells() {
  static_assert(PredictableObserver<O>,
                "esokit: PredictiveAdrc needs an observer that knows its next correction before "
                "the measurement: a LinearEso, CascadeEso, .., in no adapter but Measured");
  return PredictableObserver<O>;
}
template <class O>
consteval bool restarts() {
  static_assert(RestartingObserver<O>,
                "esokit: VariableTime needs an observer that tells when it restarts, such as "
                "LinearEso<2>: the concept RestartingObserver");
  return RestartingObserver<O>;
}
template <class O>
consteval bool shifts_output() {
  static_assert(ShiftableOutput<O>,
                "esokit: WrappedOutput needs an observer whose y may be shifted, such as "
                "LinearEso<2> without a plant's poles: the concept ShiftableOutput");
  return ShiftableOutput<O>;
}
template <class O>
consteval bool bears_a_gate() {
  static_assert(LevelledObserver<O> && RestartingObserver<O>,
                "esokit: OutlierGate needs an observer with level_estimate and restarts, such as "
                "LinearEso<2>: the concepts LevelledObserver and RestartingObserver");
  return LevelledObserver<O> && RestartingObserver<O>;
}
template <class O>
consteval bool shifts_disturbance() {
  static_assert(ShiftableDisturbance<O>,
                "esokit: KnownModel and MimoAdrc need an observer whose disturbance may be "
                "shifted, such as LinearEso<2>: the concept ShiftableDisturbance");
  return ShiftableDisturbance<O>;
}
template <class O>
consteval bool shifts_load() {
  static_assert(
      ShiftableLoad<O>,
      "esokit: Measured needs an observer that can be given a load, such as LinearEso<2>: "
      "the concept ShiftableLoad");
  return ShiftableLoad<O>;
}
/// @}

}  // namespace detail

}  // namespace esokit
