// The law suite on AdjustableBandwidthEso.
#include "law_suite.hpp"
//
#include <esokit/observer/adjustable_bandwidth_eso.hpp>

namespace esokit_test {

template <int Order, class S, int Extension>
struct ObserverTraits<esokit::AdjustableBandwidthEso<Order, S, Extension>> {
  using Observer = esokit::AdjustableBandwidthEso<Order, S, Extension>;
  using Config = typename Observer::Config;
  using Continuous = esokit::ContinuousAdjustableBandwidthEso<Order, double, Extension>;
  template <class T>
  using Rebind = esokit::AdjustableBandwidthEso<Order, T, Extension>;
  static constexpr const char* field = "observer_bandwidth";
  static constexpr double ratio = 0.75;
  static constexpr double slowest = ratio;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    return {.observer_bandwidth = static_cast<S>(omega),
            .bandwidth_ratio = static_cast<S>(ratio),
            .input_gain = static_cast<S>(input_gain),
            .sample_time = static_cast<S>(sample_time),
            .max_gap = max_gap};
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    return {.observer_bandwidth = omega, .bandwidth_ratio = ratio, .input_gain = input_gain};
  }
  /// The first innovation does not shrink: the gain set is that of omega_o.
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    return {equal_poles(Observer::size, config.observer_bandwidth)};
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::order_of_accuracy) {
      return "the two forms switch at different times; see adjustable_bandwidth_eso_test.cpp";
    }
    return common_excuse<S, Observer::size>(law);
  }
};

using SwitchedTypes =
    TypeList<esokit::AdjustableBandwidthEso<2>, esokit::AdjustableBandwidthEso<1, double, 2>,
             esokit::AdjustableBandwidthEso<2, float>, esokit::AdjustableBandwidthEso<4, float>>;
const bool registered = register_laws<ObserverLaws>("AdjustableBandwidthEso", SwitchedTypes{});

}  // namespace esokit_test
