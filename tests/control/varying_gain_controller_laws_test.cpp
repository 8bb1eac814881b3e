// The controller law suite on the observers whose gains change.
#include "controller_law_suite.hpp"
//
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/nonlinear_eso.hpp>

namespace esokit_test {

template <int Order, class S, int Extension>
struct LoopTraits<esokit::AlgebraicEso<Order, S, Extension>> {
  static typename esokit::AlgebraicEso<Order, S, Extension>::Config config(double omega, double T,
                                                                           double b0) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .frequency_shift = static_cast<S>(omega / 2),
            .input_gain = static_cast<S>(b0),
            .sample_time = static_cast<S>(T)};
  }
};

template <int Order, class S, int Extension>
struct LoopTraits<esokit::AdjustableBandwidthEso<Order, S, Extension>> {
  static typename esokit::AdjustableBandwidthEso<Order, S, Extension>::Config config(double omega,
                                                                                     double T,
                                                                                     double b0) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .bandwidth_ratio = S(0.75),
            .input_gain = static_cast<S>(b0),
            .sample_time = static_cast<S>(T)};
  }
};

template <int Order, class S, int Extension>
struct LoopTraits<esokit::NonlinearEso<Order, S, Extension>> {
  static typename esokit::NonlinearEso<Order, S, Extension>::Config config(double omega, double T,
                                                                           double b0) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .shape = {.gain_alpha = S(0.8), .alpha = S(1), .gain_beta = S(0.2), .beta = S(1)},
            .input_gain = static_cast<S>(b0),
            .sample_time = static_cast<S>(T)};
  }
};

template <int Order, class S>
struct LoopTraits<esokit::ExtendedStateFilter<Order, S>> {
  /// Bounds that put the limit of the gain near the bandwidth omega.
  static typename esokit::ExtendedStateFilter<Order, S>::Config config(double omega, double T,
                                                                       double b0) {
    typename esokit::ExtendedStateFilter<Order, S>::Config settings{};
    settings.input_gain = static_cast<S>(b0);
    settings.sample_time = static_cast<S>(T);
    settings.measurement_variance = static_cast<S>(1e-4);
    settings.disturbance_bounds[Order] = static_cast<S>(1e-2 * std::pow(omega, Order + 1) * T / 2);
    settings.inflation = static_cast<S>(0.02);
    eigen(settings.initial_covariance).diagonal().setConstant(S(1));
    return settings;
  }
};

using VaryingControllers = TypeList<
    Adrc<esokit::AlgebraicEso<2>>, Adrc<esokit::AlgebraicEso<1>, ErrorBased>,
    Adrc<esokit::AlgebraicEso<2, float>>, Adrc<esokit::AdjustableBandwidthEso<2>, ErrorBased>,
    Adrc<esokit::NonlinearEso<2, double, 1>>, Adrc<esokit::NonlinearEso<1, double, 2>, ErrorBased>,
    Adrc<esokit::ExtendedStateFilter<2>>>;
const bool varying_gain_controller_registered =
    register_controller_laws("VaryingGain", VaryingControllers{});

}  // namespace esokit_test
