// The controller law suite on the observers with constant gains, bare and in adapters: known delay,
// angle, changing sample time, known model, guards, and nests of them.
#include "controller_law_suite.hpp"
//
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <support/friction.hpp>

namespace esokit_test {

template <int Order, class S, int Extension, class Placement>
struct LoopTraits<esokit::LinearEso<Order, S, Extension, Placement>> {
  static typename esokit::LinearEso<Order, S, Extension, Placement>::Config config(double omega,
                                                                                   double T,
                                                                                   double b0) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .input_gain = static_cast<S>(b0),
            .sample_time = static_cast<S>(T)};
  }
};

template <int Order, int Levels, class S>
struct LoopTraits<esokit::CascadeEso<Order, Levels, S>> {
  static typename esokit::CascadeEso<Order, Levels, S>::Config config(double omega, double T,
                                                                      double b0) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .bandwidth_factor = S(2),
            .input_gain = static_cast<S>(b0),
            .sample_time = static_cast<S>(T)};
  }
};

using LinearControllers =
    TypeList<Adrc<esokit::LinearEso<1>>, Adrc<esokit::LinearEso<2>>,
             Adrc<esokit::LinearEso<2>, ErrorBased>, Adrc<esokit::LinearEso<3, double, 2>>,
             Adrc<esokit::LinearEso<1, float>>, Adrc<esokit::ReducedOrderEso<2>>,
             Adrc<esokit::HalfGainEso<2>, ErrorBased>, Adrc<esokit::CascadeEso<2, 3>, ErrorBased>>;
const bool linear_registered = register_controller_laws("Linear", LinearControllers{});

inline constexpr esokit::ModelParts swinging{.order = 2, .resonators = 1};

// A sine that this plant has not.
template <class S>
struct LoopTraits<esokit::ModelEso<swinging, S>> {
  static typename esokit::ModelEso<swinging, S>::Config config(double omega, double T, double b0) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .input_gain = static_cast<S>(b0),
            .sample_time = static_cast<S>(T),
            .model = {.resonators = {{{.frequency = static_cast<S>(omega)}}}}};
  }
};

// A capacity that this plant, which has no delay, leaves unused.
template <class O, int Capacity>
struct LoopTraits<esokit::DelayedInput<O, Capacity>> {
  static typename esokit::DelayedInput<O, Capacity>::Config config(double omega, double T,
                                                                   double b0) {
    return {.observer = LoopTraits<O>::config(omega, T, b0), .delay = 0};
  }
};

// So long a period that the laws' references are not wrapped.
template <class O>
struct LoopTraits<esokit::WrappedOutput<O>> {
  static typename esokit::WrappedOutput<O>::Config config(double omega, double T, double b0) {
    return {.observer = LoopTraits<O>::config(omega, T, b0),
            .period = static_cast<typename O::scalar_type>(64)};
  }
};

template <class O>
struct LoopTraits<esokit::VariableTime<O>> {
  static typename esokit::VariableTime<O>::Config config(double omega, double T, double b0) {
    return {.observer = LoopTraits<O>::config(omega, T, b0)};
  }
};

// Guards that are idle: a bound that this plant's load does not reach.
template <class O>
struct LoopTraits<esokit::Guarded<O>> {
  static typename esokit::Guarded<O>::Config config(double omega, double T, double b0) {
    return {.observer = LoopTraits<O>::config(omega, T, b0),
            .disturbance_bound = static_cast<typename O::scalar_type>(1e6)};
  }
};

// Nothing is measured: it counts as zero.
template <class O>
struct LoopTraits<esokit::Measured<O, 1, 3>> {
  static typename esokit::Measured<O, 1, 3>::Config config(double omega, double T, double b0) {
    typename esokit::Measured<O, 1, 3>::Config config{};
    config.observer = LoopTraits<O>::config(omega, T, b0);
    config.inputs[0] = {3, static_cast<typename O::scalar_type>(T), 0};
    return config;
  }
};

// A model that is wrong: what it says more than the plant does is disturbance.
template <class O>
struct LoopTraits<esokit::KnownModel<O, Friction<1, double>>> {
  static constexpr bool approximate = true;
  static typename esokit::KnownModel<O, Friction<1, double>>::Config config(double omega, double T,
                                                                            double b0) {
    return {.observer = LoopTraits<O>::config(omega, T, b0), .model = {0.25}};
  }
};

using DecoratedControllers =
    TypeList<Adrc<esokit::DelayedInput<esokit::LinearEso<2>, 3>>,
             Adrc<esokit::WrappedOutput<esokit::CascadeEso<2, 2>>, ErrorBased>,
             Adrc<esokit::VariableTime<esokit::LinearEso<2>>>,
             Adrc<esokit::Measured<esokit::LinearEso<2>, 1, 3>, ErrorBased>,
             Adrc<esokit::Guarded<esokit::CascadeEso<2, 2>>>,
             Adrc<esokit::Guarded<esokit::LinearEso<1, float>>, ErrorBased>,
             Adrc<esokit::Guarded<esokit::ModelEso<swinging>>>,
             Adrc<esokit::KnownModel<esokit::LinearEso<2>, Friction<1, double>>>,
             Adrc<esokit::VariableTime<
                      esokit::WrappedOutput<esokit::DelayedInput<esokit::LinearEso<1, float>, 2>>>,
                  ErrorBased>>;
const bool decorated_registered = register_controller_laws("Decorated", DecoratedControllers{});

}  // namespace esokit_test
