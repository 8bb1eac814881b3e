// The law suite on AlgebraicEso.
#include "law_suite.hpp"
//
#include <esokit/observer/algebraic_eso.hpp>

namespace esokit_test {

/// lambda = q = omega, estimates published at once.
template <int Order, class S, int Extension>
struct ObserverTraits<esokit::AlgebraicEso<Order, S, Extension>> {
  using Observer = esokit::AlgebraicEso<Order, S, Extension>;
  using Config = typename Observer::Config;
  using Continuous = esokit::ContinuousAlgebraicEso<Order, double, Extension>;
  template <class T>
  using Rebind = esokit::AlgebraicEso<Order, T, Extension>;
  static constexpr const char* field = "observer_bandwidth";
  static constexpr double slowest = 1;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .frequency_shift = static_cast<S>(omega),
            .input_gain = static_cast<S>(input_gain),
            .sample_time = static_cast<S>(sample_time),
            .hold = S(0),
            .max_gap = max_gap};
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    return {.observer_bandwidth = omega, .frequency_shift = omega, .input_gain = input_gain};
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
    return common_excuse<S, Observer::size>(law);
  }
};

using AlgebraicTypes = TypeList<esokit::AlgebraicEso<2>, esokit::AlgebraicEso<1, double, 2>,
                                esokit::AlgebraicEso<4, double, 3>, esokit::AlgebraicEso<2, float>,
                                esokit::AlgebraicEso<2, float, 2>>;
const bool registered = register_laws<ObserverLaws>("AlgebraicEso", AlgebraicTypes{});

}  // namespace esokit_test
