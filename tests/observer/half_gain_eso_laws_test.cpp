// The law suite on HalfGainEso and ReducedOrderEso, and what they are for.
#include "law_suite.hpp"
//
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit_test {

template <int Order, class S, int Extension>
struct ObserverTraits<esokit::LinearEso<Order, S, Extension, esokit::HalfGainPoles>>
    : BandwidthTraits<esokit::HalfGainEso<Order, S, Extension>,
                      esokit::ContinuousHalfGainEso<Order, double, Extension>> {
  using Observer = esokit::HalfGainEso<Order, S, Extension>;
  template <class T>
  using Rebind = esokit::HalfGainEso<Order, T, Extension>;
  static constexpr double slowest = 0.5;

  static std::vector<std::vector<std::complex<long double>>> level_poles(
      const typename Observer::Config& config) {
    return {widened(esokit::half_gain_poles<Observer::size, S>(config.observer_bandwidth))};
  }
};

template <int Order, class S, int Extension>
struct ObserverTraits<esokit::LinearEso<Order, S, Extension, esokit::ReducedPoles>>
    : BandwidthTraits<esokit::ReducedOrderEso<Order, S, Extension>,
                      esokit::ContinuousLinearEso<Order, double, Extension>> {
  using Observer = esokit::ReducedOrderEso<Order, S, Extension>;
  template <class T>
  using Rebind = esokit::ReducedOrderEso<Order, T, Extension>;

  /// One pole at z = 0, which is s = -infinity, or so far out that nothing is left of it.
  static std::vector<std::vector<std::complex<long double>>> level_poles(
      const typename Observer::Config& config) {
    auto poles = equal_poles(Observer::size - 1, config.observer_bandwidth);
    poles.emplace_back(-1e30L, 0.0L);
    return {poles};
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::order_of_accuracy) return "its continuous form has an infinite gain";
    return common_excuse<S, Observer::size>(law);
  }
};

using VariantTypes =
    TypeList<esokit::HalfGainEso<2>, esokit::HalfGainEso<3, double, 2>,
             esokit::HalfGainEso<2, float>, esokit::ReducedOrderEso<1>, esokit::ReducedOrderEso<2>,
             esokit::ReducedOrderEso<3, double, 2>, esokit::ReducedOrderEso<2, float>>;
const bool half_gain_eso_registered = register_laws<ObserverLaws>("LinearVariants", VariantTypes{});

/// After a correction the first estimate is the measurement.
TEST(ReducedOrderEso, TakesTheMeasurementAsItIs) {
  auto observer = esokit::ReducedOrderEso<2>::make(
                      {.observer_bandwidth = 20, .input_gain = 2, .sample_time = 0.01})
                      .value();
  Random random(2);
  for (int k = 0; k < 200; ++k) {
    if (k % 7 == 3) observer.predict(0.5);
    const double y = random.uniform(-1, 1);
    observer.update(y, random.uniform(-1, 1));
    ASSERT_NEAR(observer.estimate<0>(), y, 1e-14);
  }
}

/// It is the textbook's observer of order N - 1: x_r = F22 x_r + .. with y as an input.
TEST(ReducedOrderEso, IsTheObserverOfOneOrderLess) {
  constexpr double T = 0.01, omega = 20, b0 = 2;
  auto observer = esokit::ReducedOrderEso<1>::make(
                      {.observer_bandwidth = omega, .input_gain = b0, .sample_time = T})
                      .value();
  // n = 1: d[k+1] = d + L (y[k+1] - y[k] - T (d + b0 u)), pole 1 - L T = rho.
  const double gain = -std::expm1(-omega * T) / T;
  double d = 0, before = 0;
  Random random(4);
  for (int k = 0; k < 100; ++k) {
    const double y = random.uniform(-1, 1);
    const double u = random.uniform(-1, 1);
    d += gain * (y - before - T * (d + b0 * u));
    before = y;
    observer.update(y, u);
    ASSERT_NEAR(observer.total_disturbance(), d, 1e-10);
  }
}

/// White noise on y: about half the power in dhat for the same omega_o. The exact ratios in
/// continuous time, from the H2 norms of both: N = 2, (1/2)^2 ... see the printout.
TEST(HalfGainEso, LessNoise) {
  auto whole =
      esokit::LinearEso<2>::make({.observer_bandwidth = 50, .input_gain = 1, .sample_time = 1e-3})
          .value();
  auto half =
      esokit::HalfGainEso<2>::make({.observer_bandwidth = 50, .input_gain = 1, .sample_time = 1e-3})
          .value();
  Random random(5);
  double a = 0, b = 0;
  for (int k = 0; k < 200000; ++k) {
    const double y = random.uniform(-1, 1);
    whole.update(y, 0);
    half.update(y, 0);
    a += whole.total_disturbance() * whole.total_disturbance();
    b += half.total_disturbance() * half.total_disturbance();
  }
  EXPECT_LT(b, 0.6 * a);
  EXPECT_GT(b, 0.2 * a);
}

}  // namespace esokit_test
