// The law suite on AlgebraicEso.
#include "law_suite.hpp"
//
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit_test {

/// lambda = q = omega, estimates published at once.
template <int Order, class S, int Extension>
struct ObserverTraits<esokit::AlgebraicEso<Order, S, Extension>>
    : BandwidthTraits<esokit::AlgebraicEso<Order, S, Extension>,
                      esokit::ContinuousAlgebraicEso<Order, double, Extension>> {
  using Observer = esokit::AlgebraicEso<Order, S, Extension>;
  using Continuous = esokit::ContinuousAlgebraicEso<Order, double, Extension>;
  using Base = BandwidthTraits<Observer, Continuous>;
  using Config = typename Observer::Config;
  template <class T>
  using Rebind = esokit::AlgebraicEso<Order, T, Extension>;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config = Base::config(omega, sample_time, input_gain, max_gap);
    config.frequency_shift = static_cast<S>(omega);
    config.blanking = S(0);
    return config;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    auto config = Base::continuous_config(omega, input_gain);
    config.frequency_shift = omega;
    return config;
  }
  /// The first sample is deadbeat, all poles at z = 0.
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    return {equal_poles(Observer::size, 1000.0L / static_cast<long double>(config.sample_time))};
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::bounded_and_correct) {
      return "its tolerance is the response to a rounding error at the start, which is deadbeat "
             "here; see BoundedAndCorrectForEveryBandwidth in algebraic_eso_test.cpp";
    }
    if (law == Law::order_of_accuracy) {
      return "the continuous chain is singular at t = 0; see TendsToTheContinuousFormWithOrderOne "
             "in algebraic_eso_test.cpp";
    }
    return Base::excuse(law);
  }
};

using AlgebraicTypes = TypeList<esokit::AlgebraicEso<2>, esokit::AlgebraicEso<1, double, 2>,
                                esokit::AlgebraicEso<4, double, 3>, esokit::AlgebraicEso<2, float>,
                                esokit::AlgebraicEso<2, float, 2>>;
const bool algebraic_eso_registered = register_laws<ObserverLaws>("AlgebraicEso", AlgebraicTypes{});

}  // namespace esokit_test
