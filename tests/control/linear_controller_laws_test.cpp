// The controller law suite on the observers with constant gains.
#include "controller_law_suite.hpp"
//
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>

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
const bool registered = register_controller_laws("Linear", LinearControllers{});

}  // namespace esokit_test
