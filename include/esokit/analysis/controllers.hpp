/// @file
/// The library's observers and controllers as linear systems, `linear_observer` and
/// `linear_controller`.
///
/// The linear form is valid within the limits, while no measurement is missing and the law
/// determines u. Adapters are taken in their linear mode: an angle within one turn, an open gate,
/// VariableTime at its present step, Guarded with its present b0 and full trust. A float controller
/// is analysed in double with its own gains. A type without a linear mode does not compile;
/// FrozenObserver holds a switched or nonlinear observer in one of its modes.
#pragma once

#include <cstddef>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/dual_feedback.hpp>
#include <esokit/control/incremental.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <utility>
#include <vector>

namespace esokit {

/// An observer that acts by its gains, or one that a delay is built around.
template <class T>
concept AnalysedObserver = detail::SaysObserver<T>;

/// A controller that can be analysed: Adrc, PredictiveAdrc, DisturbanceCompensator with an observer
/// that can, MimoAdrc, Incremental, ObserverWithLaw, Compensated, a LinearController, or your own
/// type with a function `linear_controller` beside it.
template <class T>
concept AnalysedController = detail::SaysController<T>;

/// Of an observer that acts by its gains.
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

/// Of one with a delay of u: d more states, the inputs under way.
template <class Observer, int Capacity>
requires detail::SaysObserver<Observer> LinearObserverForm
linear_observer(const DelayedInput<Observer, Capacity>& observer) {
  return detail::delayed(linear_observer(observer.observer()), observer.delay());
}

/// Of an adapter that is in its linear mode what it adapts.
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
template <class Observer>
requires detail::SaysObserver<Observer> &&(!LinearObserver<VariableTime<Observer>>)  //
    LinearObserverForm linear_observer(const VariableTime<Observer>& observer) {
  return linear_observer(observer.observer());
}
/// @}

/// With the b0 of now; with all trust, and within the bound.
template <class Observer>
requires detail::SaysObserver<Observer> LinearObserverForm
linear_observer(const Guarded<Observer>& observer) {
  LinearObserverForm form = linear_observer(observer.observer());
  const double ratio = 1.0 / static_cast<double>(observer.input_factor());
  for (int i = 0; i < form.from_u.rows(); ++i) form.from_u(i, 0) *= ratio;
  form.input_gain *= ratio;
  return form;
}

/// An observer and a law outside of a controller: a continuous observer, or a FrozenObserver for a
/// switched or nonlinear one. It can be used wherever a controller is expected.
/// @tparam Form OutputBased or ErrorBased
template <class Observer, class Law, AdrcForm Form = OutputBased>
struct ObserverWithLaw {
  Observer observer;  ///< with b0, error-based with -b0
  Law law;            ///< AdrcLaw with b0
  Form form{};        ///< what the observer is fed with
};
/// Fed with y.
template <class Observer, class Law>
ObserverWithLaw(Observer, Law) -> ObserverWithLaw<Observer, Law, OutputBased>;
/// Fed with what is said.
template <class Observer, class Law, class Form>
ObserverWithLaw(Observer, Law, Form) -> ObserverWithLaw<Observer, Law, Form>;

/// A DisturbanceCompensator and the controller inside it, which has its own `linear_controller`. It
/// can be used wherever a controller is expected.
template <class Compensator, class Base>
struct Compensated {
  Compensator compensator;  ///< adds K dhat
  Base base;                ///< puts out u0
};
/// Of copies.
template <class Compensator, class Base>
Compensated(Compensator, Base) -> Compensated<Compensator, Base>;

namespace detail {

/// Whether two numbers were given as the same one, as far as the coarser of two scalars tells:
/// 0.01 in float and in double.
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
  return Rules<double>{}.require(divider == 1, "measurement_divider", divider,
                                 "must be 1: the analysis takes a loop that is the same in every "
                                 "sample");
}

}  // namespace detail

/// A description is one.
inline LinearController linear_controller(const LinearController& controller) { return controller; }

/// u = (k_0 (r - yhat) - .. - dhat) / b0, of either form.
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

/// The same in two phases.
template <class Observer>
requires detail::SaysObserver<Observer> LinearController
linear_controller(const PredictiveAdrc<Observer>& controller) {
  const auto observer = linear_observer(controller.observer());
  return detail::feedback_of(observer, detail::law_weights(controller.gains(), observer.input_gain),
                             false);
}

/// @return error for input gains of observer and law that do not belong together
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
  rules.require(detail::same_as_given<ObserverScalar, S>(gain, law_gain),
                {"input_gain", observer.input_gain,
                 error_based ? "of the observer must be minus that of the law, which is"
                             : "of the observer must be that of the law, which is",
                 -1, law_gain, true});
  if (!rules) return rules.error();
  return detail::feedback_of(observer, detail::law_weights(parts.law.gains(), law_gain),
                             error_based);
}

/// u = r + K dhat: its reference is u0. What it makes of a plant is what the controller around
/// which it is put then sees.
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
  form.input_gain = 0.0;  // u0 does not go with 1 / b0
  return form;
}

/// u = u0 + K dhat.
/// @return error of either, and for other sample times than one
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

/// The controller whose increments are put out: the actuator's sum of them is its u.
template <class Controller>
requires detail::SaysController<Controller> Expected<LinearController, Error<double>>
linear_controller(const Incremental<Controller>& controller) {
  return linear_controller(controller.controller());
}

/// The filter. It keeps neither T nor b0: they are in the config that it was made from.
template <int Order, class S, int Extension, class Operator, class Feedback, class Placement>
LinearController linear_controller(
    const DualFeedbackAdrc<Order, S, Extension, Operator, Feedback, Placement>& controller,
    const typename DualFeedbackAdrc<Order, S, Extension, Operator, Feedback, Placement>::Config&
        config) {
  constexpr int size = Order + Extension;
  const auto& f = controller.form();
  LinearController form(size, 1, 0, static_cast<double>(config.sample_time));
  form.input_gain = static_cast<double>(config.input_gain);
  // c = s_1 - n_0 y, s_i+ [- s_i] = s_(i+1) - n_i y - d_i c - m_i u
  const auto first = static_cast<double>(f.measurement[0]);
  form.to_u(0, 0) = 1.0;
  form.y_to_u(0, 0) = -first;
  form.r_to_u(0, 0) = static_cast<double>(f.reference);
  for (int i = 0; i < size; ++i) {
    const auto next = static_cast<std::size_t>(i + 1);
    const auto d = static_cast<double>(f.denominator[next]);
    if (i + 1 < size) form.a(i, i + 1) = 1.0;
    if constexpr (std::is_same_v<Operator, ShiftOperator>) form.a(i, i) -= 1.0;
    form.a(i, 0) -= d;
    form.from_y(i, 0) = d * first - static_cast<double>(f.measurement[next]);
    form.from_u(i, 0) = -static_cast<double>(f.input[next]);
  }
  return form;
}

/// All channels: observer i is told (B0 u)_i, u = B0^-1 (v - dhat).
template <class... Observers>
requires(detail::SaysObserver<Observers>&&...)  //
    LinearController linear_controller(const MimoAdrc<Observers...>& controller) {
  std::vector<LinearController> channels;
  const auto add = [&]<std::size_t... I>(std::index_sequence<I...>) {
    (channels.push_back(detail::feedback_of(
         linear_observer(controller.template observer<static_cast<int>(I)>()),
         detail::law_weights(
             controller.template gains<static_cast<int>(I)>(),
             static_cast<double>(controller.template observer<static_cast<int>(I)>().input_gain())),
         false)),
     ...);
  };
  add(std::make_index_sequence<sizeof...(Observers)>{});
  constexpr int q = static_cast<int>(sizeof...(Observers));
  return detail::decoupled(channels, detail::dynamic_copy(controller.input_matrix(), q, q),
                           detail::dynamic_copy(controller.decoupling(), q, q));
}

}  // namespace esokit
