/// @file
/// Observers and controllers of the library as linear systems: `linear_observer` and
/// `linear_controller`.
///
/// The linear form is valid within the limits, while no measurement is missing and the law
/// determines u. Adapters are analysed in their linear mode: an angle within one turn, an open
/// gate, VariableTime with its present step, Guarded with its present b0 and full trust. Of a
/// MappedInput the loop is that from y to the effect (ActuatorMap::gain_left). A float
/// controller is analysed in double with its own gains. Of an Adrc that softens at the limits it is
/// the law as designed, also while it is soft (`softness()` < 1): then the loop is another one. A
/// type without a linear mode does not compile; use FrozenObserver for one mode of a switched or
/// nonlinear observer.
#pragma once

#include <cstddef>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <utility>
#include <vector>

namespace esokit {

/// An observer that can be analysed: one determined by its gains, with any adapters that have a
/// linear mode.
template <class T>
concept AnalysedObserver = detail::SaysObserver<T>;

/// A controller that can be analysed: Adrc (also in Resting), PredictiveAdrc or
/// DisturbanceCompensator with an AnalysedObserver, MimoAdrc, ObserverWithLaw, Compensated, a
/// LinearController, or your own type with a function `linear_controller` in its namespace.
template <class T>
concept AnalysedController = detail::SaysController<T>;

/// The linear form of an observer that is determined by its gains.
template <LinearObserver Observer>
LinearObserverForm linear_observer(const Observer& observer) {
  const auto m = detail::observer_matrices(observer);
  using Matrices = std::remove_cvref_t<decltype(m)>;
  LinearObserverForm form;
  form.a = detail::dynamic_copy(m.a, Matrices::states, Matrices::states);
  form.from_y = detail::dynamic_copy(m.by, Matrices::states, 1);
  form.from_u = detail::dynamic_copy(m.bu, Matrices::states, 1);
  form.to_estimate = detail::dynamic_copy(m.c, Matrices::size, Matrices::states);
  form.y_to_estimate = detail::dynamic_copy(m.dy, Matrices::size, 1);
  form.sample_time = m.sample_time;
  form.input_gain = m.input_gain;
  return form;
}

/// The linear form with a delay of u: d more states for the delayed inputs.
template <class Observer, int Capacity>
requires detail::SaysObserver<Observer> LinearObserverForm
linear_observer(const DelayedInput<Observer, Capacity>& observer) {
  return detail::delayed(linear_observer(observer.observer()), observer.delay());
}

/// The linear form of adapters that do nothing in their linear mode.
/// @{
template <class Observer>
requires detail::SaysObserver<Observer> &&(!LinearObserver<WrappedOutput<Observer>>)  //
    LinearObserverForm linear_observer(const WrappedOutput<Observer>& observer) {
  return linear_observer(observer.observer());
}
template <class Observer>
requires detail::SaysObserver<Observer> &&(!LinearObserver<OutlierGate<Observer>>)  //
    LinearObserverForm linear_observer(const OutlierGate<Observer>& observer) {
  return linear_observer(observer.observer());
}
template <class Observer, int Count, int Delay>
requires detail::SaysObserver<Observer> &&(!LinearObserver<Measured<Observer, Count, Delay>>)  //
    LinearObserverForm linear_observer(const Measured<Observer, Count, Delay>& observer) {
  return linear_observer(observer.observer());
}
template <class Observer>
requires detail::SaysObserver<Observer> &&(!LinearObserver<VariableTime<Observer>>)  //
    LinearObserverForm linear_observer(const VariableTime<Observer>& observer) {
  return linear_observer(observer.observer());
}
/// @}

namespace detail {

/// The observer with a disturbance of which a share is removed after each correction.
/// @param observer that of the form, without adapters
template <class Observer>
void add_leak(LinearObserverForm& form, const Observer& observer, double leak) {
  constexpr int size = Observer::size;
  using Model = std::remove_cvref_t<decltype(observer.model())>;
  const auto sampled = sampled_matrices(observer);
  // The disturbance as a row over the states, and a disturbance of one as states: after the
  // correction, and after the prediction.
  Vector<double, size> row = Vector<double, size>::Zero();
  Vector<double, size> column = row;
  if constexpr (model_traits<Model>.is_chain) {
    row(Observer::order) = column(Observer::order) = 1.0;
  } else {
    const auto of_model = observer.model().constant_row();
    const auto with_constant = observer.model().constant_column();
    for (int i = 0; i < size; ++i) {
      const auto at = static_cast<std::size_t>(i);
      row(i) = static_cast<double>(of_model[at]) / sampled.units(i);
      column(i) = static_cast<double>(with_constant[at]) * sampled.units(i);
    }
  }
  const Vector<double, size> predicted = column + sampled.step * column;
  // Each level has the sum of the disturbances found by it and the levels below it.
  for (int first = 0; first < size * Observer::levels; first += size) {
    const auto leave = [&](DynamicMatrix<double>& to, int j, double more) {
      double found = more;
      for (int i = 0; i < size; ++i) found += row(i) * to(first + i, j);
      for (int i = 0; i < size; ++i) to(first + i, j) -= leak * found * predicted(i);
    };
    for (int j = 0; j < form.states(); ++j) {
      // A - I is stored.
      const bool own = first <= j && j < first + size;
      leave(form.a, j, own ? row(j - first) : 0.0);
    }
    leave(form.from_y, 0, 0.0);
  }
  const auto leave_estimate = [&](DynamicMatrix<double>& to, int j) {
    double found = 0.0;
    for (int r = 0; r < size; ++r) found += row(state_of_row<Observer>(r)) * to(r, j);
    for (int r = 0; r < size; ++r) to(r, j) -= leak * found * column(state_of_row<Observer>(r));
  };
  for (int j = 0; j < form.states(); ++j) leave_estimate(form.to_estimate, j);
  leave_estimate(form.y_to_estimate, 0);
}

}  // namespace detail

/// The linear form with the present b0, full trust, the leak, and dhat within its bound.
template <class Observer>
requires detail::SaysObserver<Observer> LinearObserverForm
linear_observer(const Guarded<Observer>& observer) {
  LinearObserverForm form = linear_observer(observer.observer());
  if constexpr (Guarded<Observer>::gates) {
    const auto leak = static_cast<double>(observer.leak_share());
    if (leak > 0.0) detail::add_leak(form, detail::GuardAccess::innermost(observer), leak);
  }
  const double ratio = 1.0 / static_cast<double>(observer.input_factor());
  for (int i = 0; i < form.from_u.rows(); ++i) form.from_u(i, 0) *= ratio;
  form.input_gain *= ratio;
  return form;
}

/// The linear form of what the curve of an actuator is around: its u is an effect.
template <class Observer, int Points>
requires detail::SaysObserver<Observer> &&(!LinearObserver<MappedInput<Observer, Points>>)  //
    LinearObserverForm linear_observer(const MappedInput<Observer, Points>& observer) {
  return linear_observer(observer.observer());
}

/// An observer and a law without a controller: a continuous observer, or a FrozenObserver for a
/// switched or nonlinear one. It can be analysed like a controller.
/// @tparam Form OutputBased or ErrorBased
template <class Observer, class Law, AdrcForm Form = OutputBased>
struct ObserverWithLaw {
  Observer observer;  ///< with b0, error-based with -b0
  Law law;            ///< AdrcLaw with b0
  Form form{};        ///< OutputBased or ErrorBased: what the observer measures
};
/// The observer measures y.
template <class Observer, class Law>
ObserverWithLaw(Observer, Law) -> ObserverWithLaw<Observer, Law, OutputBased>;
/// The observer measures what the given form says.
template <class Observer, class Law, class Form>
ObserverWithLaw(Observer, Law, Form) -> ObserverWithLaw<Observer, Law, Form>;

/// A DisturbanceCompensator and the controller that it wraps, which has its own
/// `linear_controller`. It can be analysed like a controller.
template <class Compensator, class Base>
struct Compensated {
  Compensator compensator;  ///< adds K dhat
  Base base;                ///< controller with the output u0
};
/// Stores copies.
template <class Compensator, class Base>
Compensated(Compensator, Base) -> Compensated<Compensator, Base>;

namespace detail {

/// True if two numbers are equal within the rounding of the coarser scalar: 0.01 in float and in
/// double.
template <Scalar A, Scalar B>
bool same_as_given(double a, double b) noexcept {
  if constexpr (std::is_same_v<A, float> || std::is_same_v<B, float>) {
    return static_cast<float>(a) == static_cast<float>(b);
  } else {
    return a == b;
  }
}

/// (k_0, .., k_(n-1), 1) / b0.
template <class Gains>
std::vector<double> law_weights(const Gains& gains, double input_gain) {
  std::vector<double> weights;
  for (const auto& gain : gains) weights.push_back(static_cast<double>(gain) / input_gain);
  weights.push_back(1.0 / input_gain);
  return weights;
}

inline Check<double> measured_every_time(int divider) {
  return Rules<double>{}.demand(
      divider == 1, "measurement_divider", divider,
      "must be 1: the analysis needs a loop that is the same at every sample");
}

}  // namespace detail

/// A LinearController describes itself.
inline LinearController linear_controller(const LinearController& controller) { return controller; }

/// Adrc: u = (k_0 (r - yhat) - .. - dhat) / b0, in either form.
template <class Observer, class Form>
requires detail::SaysObserver<Observer> Expected<LinearController, Error<double>> linear_controller(
    const Adrc<Observer, Form>& controller) {
  constexpr bool error_based = std::is_same_v<Form, ErrorBased>;
  if (auto ok = detail::measured_every_time(controller.measurement_divider()); !ok) {
    return ok.error();
  }
  const auto observer = linear_observer(controller.observer());
  const double input_gain = error_based ? -observer.input_gain : observer.input_gain;
  return detail::feedback_of(observer, detail::law_weights(controller.gains(), input_gain),
                             error_based);
}

/// Resting: the controller while it does not rest.
template <class Controller>
requires detail::SaysController<Controller> Expected<LinearController, Error<double>>
linear_controller(const Resting<Controller>& controller) {
  return linear_controller(controller.controller());
}

/// PredictiveAdrc: the same law in two phases.
template <class Observer>
requires detail::SaysObserver<Observer> LinearController
linear_controller(const PredictiveAdrc<Observer>& controller) {
  const auto observer = linear_observer(controller.observer());
  return detail::feedback_of(observer, detail::law_weights(controller.gains(), observer.input_gain),
                             false);
}

/// An observer with a law. @return error if the input gains of observer and law do not agree
template <class Observer, int Order, class S, class Form>
requires detail::SaysObserver<Observer> Expected<LinearController, Error<double>> linear_controller(
    const ObserverWithLaw<Observer, AdrcLaw<Order, S>, Form>& parts) {
  static_assert(Order == Observer::order, "esokit: observer and law are of different orders");
  constexpr bool error_based = std::is_same_v<Form, ErrorBased>;
  const auto observer = linear_observer(parts.observer);
  const double gain = error_based ? -observer.input_gain : observer.input_gain;
  const auto law_gain = static_cast<double>(parts.law.input_gain());
  using ObserverScalar = typename Observer::scalar_type;
  Rules<double> rules;
  rules.demand(detail::same_as_given<ObserverScalar, S>(gain, law_gain),
               {"input_gain", observer.input_gain,
                error_based ? "of the observer must be minus that of the law, which is"
                            : "of the observer must be that of the law, which is",
                -1, law_gain, true});
  if (!rules) return rules.error();
  return detail::feedback_of(observer, detail::law_weights(parts.law.gains(), law_gain),
                             error_based);
}

/// DisturbanceCompensator: u = r + K dhat, with u0 as its reference r. Its closed loop with a plant
/// is the plant that the wrapped controller sees.
template <class Observer>
requires detail::SaysObserver<Observer> Expected<LinearController, Error<double>> linear_controller(
    const DisturbanceCompensator<Observer>& controller) {
  if (auto ok = detail::measured_every_time(controller.measurement_divider()); !ok) {
    return ok.error();
  }
  const auto observer = linear_observer(controller.observer());
  std::vector<double> weights(Observer::order + 1, 0.0);
  weights.back() = -static_cast<double>(controller.compensation_gain());
  if constexpr (observer_traits<Observer>.schedules_input_gain) {
    weights.back() *= static_cast<double>(controller.observer().input_factor());
  }
  auto form = detail::feedback_of(observer, weights, false);
  form.r_to_u(0, 0) = 1.0;
  form.input_gain = 0.0;  // u0 is not proportional to 1 / b0
  return form;
}

/// Compensated: u = u0 + K dhat.
/// @return the errors of both, or an error if their sample times differ
template <class Observer, class Base>
requires detail::SaysObserver<Observer> && detail::SaysController<Base>
    Expected<LinearController, Error<double>> linear_controller(
        const Compensated<DisturbanceCompensator<Observer>, Base>& both) {
  const auto compensator = linear_controller(both.compensator);
  if (!compensator) return compensator.error();
  const Expected<LinearController, Error<double>> base = linear_controller(both.base);
  if (!base) return base.error();
  return detail::compensated(*compensator, *base);
}

/// MimoAdrc, all channels: observer i gets (B0 u)_i, and u = B0^-1 (v - dhat).
template <class... Observers>
requires(detail::SaysObserver<Observers>&&...)  //
    LinearController linear_controller(const MimoAdrc<Observers...>& controller) {
  std::vector<LinearController> channels;
  const auto add = [&]<std::size_t... Index>(std::index_sequence<Index...>) {
    (channels.push_back(detail::feedback_of(
         linear_observer(controller.template observer<static_cast<int>(Index)>()),
         detail::law_weights(
             controller.template gains<static_cast<int>(Index)>(),
             static_cast<double>(
                 controller.template observer<static_cast<int>(Index)>().input_gain())),
         false)),
     ...);
  };
  add(std::make_index_sequence<sizeof...(Observers)>{});
  constexpr int q = static_cast<int>(sizeof...(Observers));
  return detail::decoupled(channels, detail::dynamic_copy(controller.input_matrix(), q, q),
                           detail::dynamic_copy(controller.decoupling(), q, q));
}

}  // namespace esokit
