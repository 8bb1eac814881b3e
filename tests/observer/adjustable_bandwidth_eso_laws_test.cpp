// The law suite on AdjustableBandwidthEso.
#include "law_suite.hpp"
//
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit_test {

/// The first innovation does not shrink: the gain set is that of omega_o.
template <int Order, class S, int Extension>
struct ObserverTraits<esokit::AdjustableBandwidthEso<Order, S, Extension>>
    : BandwidthTraits<esokit::AdjustableBandwidthEso<Order, S, Extension>,
                      esokit::ContinuousAdjustableBandwidthEso<Order, double, Extension>> {
  using Observer = esokit::AdjustableBandwidthEso<Order, S, Extension>;
  using Continuous = esokit::ContinuousAdjustableBandwidthEso<Order, double, Extension>;
  using Base = BandwidthTraits<Observer, Continuous>;
  using Config = typename Observer::Config;
  template <class T>
  using Rebind = esokit::AdjustableBandwidthEso<Order, T, Extension>;
  static constexpr double ratio = 0.75;
  static constexpr double slowest = ratio;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config = Base::config(omega, sample_time, input_gain, max_gap);
    config.bandwidth_ratio = static_cast<S>(ratio);
    return config;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    auto config = Base::continuous_config(omega, input_gain);
    config.bandwidth_ratio = ratio;
    return config;
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::order_of_accuracy) {
      return "the two forms switch at different times; see adjustable_bandwidth_eso_test.cpp";
    }
    return Base::excuse(law);
  }
};

using SwitchedTypes =
    TypeList<esokit::AdjustableBandwidthEso<2>, esokit::AdjustableBandwidthEso<1, double, 2>,
             esokit::AdjustableBandwidthEso<2, float>, esokit::AdjustableBandwidthEso<4, float>>;
const bool adjustable_bandwidth_eso_registered =
    register_laws<ObserverLaws>("AdjustableBandwidthEso", SwitchedTypes{});

}  // namespace esokit_test
