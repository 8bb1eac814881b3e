// The law suite on NonlinearEso.
#include "law_suite.hpp"
//
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit_test {

/// k(x) = 1/2 + x/2, so that k(1) = 1. Shapes that rise towards e = 0 let rounding ring at gain_max
/// and are tested in nonlinear_eso_test.cpp. The poles are those of k = 1: the suite looks at an
/// innovation of one.
template <int Order, class S, int Extension>
struct ObserverTraits<esokit::NonlinearEso<Order, S, Extension>>
    : BandwidthTraits<esokit::NonlinearEso<Order, S, Extension>,
                      esokit::ContinuousNonlinearEso<Order, double, Extension>> {
  using Observer = esokit::NonlinearEso<Order, S, Extension>;
  using Continuous = esokit::ContinuousNonlinearEso<Order, double, Extension>;
  using Base = BandwidthTraits<Observer, Continuous>;
  using Config = typename Observer::Config;
  template <class T>
  using Rebind = esokit::NonlinearEso<Order, T, Extension>;
  static constexpr double slowest = 0.5;  // what is left of the bandwidth at gain_min

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config = Base::config(omega, sample_time, input_gain, max_gap);
    config.shape = {.gain_alpha = S(0.5), .alpha = S(1), .gain_beta = S(0.5), .beta = S(1)};
    return config;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    auto config = Base::continuous_config(omega, input_gain);
    config.shape = {.gain_alpha = 0.5, .alpha = 1, .gain_beta = 0.5, .beta = 1};
    return config;
  }
  static constexpr const char* excuse(Law law) {
    switch (law) {
      case Law::homogeneous:
        return "the gain depends on the size of the innovation";
      case Law::order_of_accuracy:
        return "the limits of k are not those of the continuous form; see nonlinear_eso_test.cpp";
      case Law::gap_gain_is_that_of_longer_sample:
        return "after a gap k = 1; see nonlinear_eso_test.cpp";
      case Law::bounded_and_correct:
        return "at gain_min it is never deadbeat: own settling time in nonlinear_eso_test.cpp";
      case Law::unbiased_on_own_model_class:
        return "no setting is deadbeat, as k differs from 1; see nonlinear_eso_test.cpp";
      default:
        return Base::excuse(law);
    }
  }
};

using NonlinearTypes = TypeList<esokit::NonlinearEso<2>, esokit::NonlinearEso<1, double, 1>,
                                esokit::NonlinearEso<2, float>, esokit::NonlinearEso<3, float, 1>>;
const bool nonlinear_eso_registered = register_laws<ObserverLaws>("NonlinearEso", NonlinearTypes{});

}  // namespace esokit_test
