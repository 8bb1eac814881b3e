// The law suite on ExtendedStateFilter. Without disturbance bounds and with theta = e^(omega T) - 1
// it has all its poles at e^(-omega T): frozen, and by the recursion from the covariance of the
// steady state.
#include "law_suite.hpp"
//
#include <esokit/eigen.hpp>
#include <esokit/observer/extended_state_filter.hpp>

namespace esokit_test {

/// TableSize is but a mark here: 0 frozen, 1 recursive.
template <int Order, class S, int Extension, int Recursive>
struct ObserverTraits<
    esokit::ExtendedStateFilter<Order, S, Extension, esokit::NoNominalModel, Recursive>> {
  using Observer =
      esokit::ExtendedStateFilter<Order, S, Extension, esokit::NoNominalModel, Recursive>;
  using Config = typename Observer::Config;
  using Continuous = esokit::ContinuousLinearEso<Order, double, Extension>;
  template <class T>
  using Rebind =
      esokit::ExtendedStateFilter<Order, T, Extension, esokit::NoNominalModel, Recursive>;
  static constexpr const char* field = "inflation";
  static constexpr double slowest = 1;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config{.input_gain = static_cast<S>(input_gain),
                  .sample_time = static_cast<S>(sample_time),
                  .measurement_variance = S(1),
                  .inflation = static_cast<S>(std::expm1(omega * sample_time)),
                  .mode = esokit::RiccatiMode::frozen,
                  .max_gap = max_gap};
    if constexpr (Recursive != 0) {
      config.mode = esokit::RiccatiMode::recursive;
      config.initial_covariance = eigen(steady_covariance(config)).template cast<S>();
    }
    return config;
  }

  /// P after a correction in the steady state: (I - k C) P- (I - k C)' + k R k' / (1 + theta).
  static auto steady_covariance(const Config& config) {
    using Wide = Rebind<double>;
    typename Wide::Covariance p = Wide::Covariance::Zero();
    const auto theta = static_cast<double>(config.inflation);
    const auto frozen = Wide::make({.input_gain = 1,
                                    .sample_time = static_cast<double>(config.sample_time),
                                    .measurement_variance = 1,
                                    .inflation = theta,
                                    .mode = esokit::RiccatiMode::frozen});
    if (!frozen) return p;
    const auto before = frozen->covariance();
    const auto k = frozen->gain();
    const auto rest = [&](int i, int j) { return before(i, j) - k(i) * before(0, j); };
    for (int i = 0; i < Observer::size; ++i) {
      for (int j = 0; j <= i; ++j) {
        p(i, j) = rest(i, j) - rest(i, 0) * k(j) + k(i) * k(j) / (1 + theta);
        p(j, i) = p(i, j);
      }
    }
    return p;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    return {.observer_bandwidth = omega, .input_gain = input_gain};
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    const auto omega = std::log1p(static_cast<long double>(config.inflation)) /
                       static_cast<long double>(config.sample_time);
    return {equal_poles(Observer::size, omega)};
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::gap_gain_is_that_of_longer_sample) {
      return "the gain after a gap is that of the grown covariance, as if one sample had been "
             "missed "
             "and not as for a filter that always runs slower; see extended_state_filter_test.cpp";
    }
    if ((law == Law::gains_equal_reference || law == Law::polynomial_equals_reference) &&
        (std::is_same_v<S, float> || Observer::size > 3)) {
      return "at omega T = 50 variances differ by e^(50 (N-1)), for which the scalar has no "
             "digits; "
             "see riccati_test.cpp";
    }
    if (Recursive != 0 &&
        (law == Law::gains_equal_reference || law == Law::polynomial_equals_reference)) {
      return "its gain comes out of the recursion; see extended_state_filter_test.cpp";
    }
    if (Recursive != 0 &&
        (law == Law::retune_keeps_estimate || law == Law::retune_rescales_sample_time)) {
      return "the covariance is kept too; see retune_keeps_estimate_and_covariance";
    }
    return common_excuse<S, Observer::size>(law);
  }
};

template <int Order, class S, int Extension>
using Frozen = esokit::ExtendedStateFilter<Order, S, Extension>;
template <int Order, class S, int Extension>
using Recursive = esokit::ExtendedStateFilter<Order, S, Extension, esokit::NoNominalModel, 1>;

using FilterTypes = TypeList<Frozen<2, double, 1>, Frozen<2, float, 1>, Recursive<1, double, 2>,
                             Recursive<2, float, 1>>;
const bool registered = register_laws<ObserverLaws>("ExtendedStateFilter", FilterTypes{});

}  // namespace esokit_test
