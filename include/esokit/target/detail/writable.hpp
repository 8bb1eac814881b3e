/// @file
/// Which types can be written in another language, and what is left of them without their adapters.
#pragma once

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/target/detail/record_access.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/recorder.hpp>
#include <type_traits>

namespace esokit {
namespace detail {

// ---- Adapters: what they count and choose is text of each language; the lists are of what they
// adapt.

// A delay acts on u and a gate on y, so that their order does not matter.

template <class Observer>
struct IsDelayed : std::false_type {};
template <class Observer, int Capacity>
struct IsDelayed<DelayedInput<Observer, Capacity>> : std::true_type {};
template <class Observer>
struct IsGate : std::false_type {};
template <class Observer>
struct IsGate<OutlierGate<Observer>> : std::true_type {};
template <class Observer>
struct IsWrapped : std::false_type {};
template <class Observer>
struct IsWrapped<WrappedOutput<Observer>> : std::true_type {};
template <class Observer>
struct IsGuarded : std::false_type {};
template <class Observer>
struct IsGuarded<Guarded<Observer>> : std::true_type {};
template <class Observer>
struct IsMeasured : std::false_type {};
template <class Observer, int Count, int Delay>
struct IsMeasured<Measured<Observer, Count, Delay>> : std::true_type {};
template <class Observer>
struct IsKnown : std::false_type {};
template <class Observer, class Model>
struct IsKnown<KnownModel<Observer, Model>> : std::true_type {};
template <class Observer>
struct IsMapped : std::false_type {};
template <class Observer, int Points>
struct IsMapped<MappedInput<Observer, Points>> : std::true_type {};
template <class C>
struct IsResting : std::false_type {};
template <class Controller>
struct IsResting<Resting<Controller>> : std::true_type {};
template <class Observer>
inline constexpr bool is_adapter =
    IsDelayed<Observer>::value || IsGate<Observer>::value || IsWrapped<Observer>::value ||
    IsGuarded<Observer>::value || IsMeasured<Observer>::value || IsMapped<Observer>::value;
/// Said at one place, and inside a WrappedOutput: around it the angle is read otherwise.
template <class Observer>
inline constexpr bool measures_plainly = [] {
  if constexpr (IsMeasured<Observer>::value) {
    using Inside = typename Observer::Adapted;
    return !observer_traits<Inside>.takes_measured && !observer_traits<Inside>.wraps_output &&
           measures_plainly<Inside>;
  } else if constexpr (IsGuarded<Observer>::value) {
    return !observer_traits<typename Observer::Adapted>.takes_measured;
  } else if constexpr (is_adapter<Observer> || IsKnown<Observer>::value) {
    return measures_plainly<typename Observer::Adapted>;
  } else {
    return true;
  }
}();
/// What the adapters around an observer count and choose.
template <class Observer>
void take_adapters(RecordedDesign& design, const Observer& observer) {
  if constexpr (IsDelayed<Observer>::value) design.line = RecordAccess::line(observer);
  if constexpr (IsGate<Observer>::value) design.gate = RecordAccess::gate(observer);
  if constexpr (IsGuarded<Observer>::value) design.guard = RecordAccess::guard(observer);
  if constexpr (IsWrapped<Observer>::value) design.wrap = RecordAccess::wrap(observer);
  if constexpr (IsMapped<Observer>::value) design.map = RecordAccess::map(observer);
  if constexpr (IsMeasured<Observer>::value) design.measured = RecordAccess::measured(observer);
  if constexpr (IsKnown<Observer>::value) {
    design.known = {true, observer_traits<typename Observer::Adapted>.wraps_output};
  }
  if constexpr (is_adapter<Observer> || IsKnown<Observer>::value)
    take_adapters(design, observer.observer());
}

/// An observer without the adapter around it, and a controller around the observer without it.
/// @{
template <class Object>
struct WithoutAdapter {
  using type = Object;
};
template <class Observer>
requires is_adapter<Observer>
struct WithoutAdapter<Observer> {
  using type = typename WithoutAdapter<typename Observer::Adapted>::type;
};
/// What is known is recorded with the observer.
template <class Observer, class Model>
struct WithoutAdapter<KnownModel<Observer, Model>> {
  using type = KnownModel<typename WithoutAdapter<Observer>::type, Model>;
};
template <class Observer, class Form>
struct WithoutAdapter<Adrc<Observer, Form>> {
  using type = Adrc<typename WithoutAdapter<Observer>::type, Form>;
};
template <class Controller>
struct WithoutAdapter<Resting<Controller>> : WithoutAdapter<Controller> {};
template <class Observer>
struct WithoutAdapter<DisturbanceCompensator<Observer>> {
  using type = DisturbanceCompensator<typename WithoutAdapter<Observer>::type>;
};
template <class Observer>
struct WithoutAdapter<ControlLoop<Observer>> {
  using type = ControlLoop<typename WithoutAdapter<Observer>::type>;
};

template <class To, class From>
void take_off_adapter(To& to, const From& from) {
  if constexpr (std::is_same_v<To, From>) {
    to = from;
  } else if constexpr (is_adapter<From>) {
    take_off_adapter(to, from.observer());
  } else if constexpr (IsResting<From>::value) {
    take_off_adapter(to, from.controller());
  } else if constexpr (!std::is_empty_v<To>) {
    LaneAccess::with_members(to, [&](auto&... into) {
      LaneAccess::with_members(
          from, [&](const auto&... out_of) { (take_off_adapter(into, out_of), ...); });
    });
  }
}
/// @}

// ---- What can be written.

/// Of any elapsed time, which is not.
template <class Object>
concept TakesAnyTime = requires {
  requires Object::traits.varies_time;
};

/// A law whose gain after a gap is a row of a table.
template <class Law>
concept GapGainsAreATable = gain_law_traits<Law>
.bridges_gaps && !gain_law_traits<Law>.advances && requires { typename WithScalar<Law, float>; };

template <class Observer>
using CoreOf = std::remove_cvref_t<decltype(RecordAccess::core(std::declval<Observer&>()))>;
/// PredictorCorrector with such laws, or with one that runs.
template <class Core>
concept HasWrittenGains = requires(const Core& o) {
  requires GapGainsAreATable<std::remove_cvref_t<decltype(RecordAccess::laws(o)[0])>> ||
      (RecordAccess::kind_of<std::remove_cvref_t<decltype(RecordAccess::laws(o)[0])>> !=
           RunningLaw::none &&
       RecordAccess::is_plain<Core>);
};

/// An observer whose lists are recorded, perhaps with a known model. What a schedule publishes is
/// not what is known of its estimate.
template <class Observer>
concept HasLists = can_be_recorded<Observer> && HasWrittenGains<CoreOf<Observer>> &&
    !(IsKnown<Observer>::value && RecordAccess::blanks<CoreOf<Observer>>);

/// False for what is refused because the function of a KnownModel is typed on one scalar.
template <class Object>
inline constexpr bool knows_in_general = true;
template <class Observer>
requires is_adapter<Observer>
inline constexpr bool knows_in_general<Observer> = knows_in_general<typename Observer::Adapted>;
template <class Observer, class Model>
inline constexpr bool knows_in_general<KnownModel<Observer, Model>> =
    can_be_recorded<typename WithoutAdapter<KnownModel<Observer, Model>>::type> ||
    !can_be_recorded<typename WithoutAdapter<Observer>::type>;
template <class Observer, class Form>
inline constexpr bool knows_in_general<Adrc<Observer, Form>> = knows_in_general<Observer>;
template <class Observer>
inline constexpr bool knows_in_general<DisturbanceCompensator<Observer>> =
    knows_in_general<Observer>;
template <class Controller>
inline constexpr bool knows_in_general<Resting<Controller>> = knows_in_general<Controller>;

/// What the curve of an actuator is around.
template <class Observer>
struct InMapOf {
  using type = Observer;
};
template <class Observer, int Points>
struct InMapOf<MappedInput<Observer, Points>> {
  using type = Observer;
};
template <class Observer>
using InMap = typename InMapOf<Observer>::type;

/// The same, perhaps in an adapter.
template <class Observer>
concept WritableObserver = HasLists<typename WithoutAdapter<Observer>::type> &&
    measures_plainly<Observer> && RecordAccess::guards_a_chain<InMap<Observer>>;

template <class C>
struct ObserverOfController;
template <class Observer, class Form>
struct ObserverOfController<Adrc<Observer, Form>> {
  using type = Observer;
  static constexpr bool error_based = std::is_same_v<Form, ErrorBased>;
};
template <class Observer>
struct ObserverOfController<DisturbanceCompensator<Observer>> {
  using type = Observer;
  static constexpr bool error_based = false;
};
template <class Controller>
struct ObserverOfController<Resting<Controller>> : ObserverOfController<Controller> {};
/// A controller around such an observer.
template <class C>
concept WritableController = WritableObserver<typename ObserverOfController<C>::type>;

/// For recording alone: packs of them run one by one.
template <class Observer, class T>
requires PredictableObserver<WithScalar<Observer, T>>
struct WithScalarOf<PredictiveAdrc<Observer>, T> {
  using type = PredictiveAdrc<WithScalar<Observer, T>>;
};

/// A controller in two phases around one whose gain is known before the measurement.
template <class C>
struct PredictiveOf {};
template <class Observer>
struct PredictiveOf<PredictiveAdrc<Observer>> {
  using type = Observer;
};
template <class C>
concept WritablePredictive =
    HasLists<typename PredictiveOf<C>::type> && observer_traits<typename PredictiveOf<C>::type>
.gain_kind == GainKind::preset;

template <class Object>
concept Writable =
    WritableController<Object> || WritableObserver<Object> || WritablePredictive<Object>;

template <class Object>
auto without_adapter(const Object& object) {
  auto bare = blank<typename WithoutAdapter<Object>::type>();
  take_off_adapter(bare, object);
  return bare;
}

}  // namespace detail
}  // namespace esokit
