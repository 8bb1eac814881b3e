/// @file
/// What the law suite must know of an observer: how to configure it, where its poles are, and which
/// laws do not apply to it, each with the reason.
#pragma once

#include <cmath>
#include <complex>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <type_traits>
#include <vector>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace esokit_test {

/// The laws of tests/observer/law_suite.cpp.
enum class Law {
  gains_equal_reference,
  polynomial_equals_reference,
  unbiased_on_own_model_class,
  bounded_and_correct,
  follows_motion,
  order_of_accuracy,
  reset_starts_anew,
  reset_refuses_bad_state,
  copies_are_independent,
  float_agrees_with_double,
  float_does_not_drift,
  no_allocation,
  update_is_predict_then_correct,
  bad_measurement_is_a_missing_one,
  bad_input_is_the_last_good_one,
  overflow_is_dropped,
  negative_input_gain,
  homogeneous,
  retune_keeps_estimate,
  retune_rebalances_input_gain,
  retune_rescales_sample_time,
  refused_retune_changes_nothing,
  gap_gain_is_that_of_longer_sample,
  recurring_gaps_are_stable,
  any_sequence_of_gaps_decays,
  long_gaps_are_forgotten,
  long_gap_restarts,
};

/// To be specialised for each observer. Members:
/// - `config(omega, T, b0, max_gap)`, `Continuous`, `continuous_config(omega, b0)`
/// - `Rebind<T>`: the same observer over another scalar
/// - `field`: config member that sets the poles, as an error names it
/// - `level_poles(config)`: continuous poles of the error, level by level, 1/s
/// - `slowest`, `fastest`: the range of abs(Re p) / omega over all levels
/// - `degree(r)`: estimate r is scaled by T^degree / degree!; left out where that is r, as of a
/// chain
/// - `unknown_amplitude(config, nu)`: of what has to be estimated while y = sin(nu t) without
/// input,
///   unit of y^(n); left out where that is y^(n)
/// - `is_output(r)`: row r stands where y does, as what a sensor shows; left out where none does
/// - `excuse(law)`: nullptr, or why the law does not apply
template <class Observer>
struct ObserverTraits;

/// Reasons that hold for every observer with constant gains.
template <class S, int Size>
constexpr const char* common_excuse(Law law) {
  constexpr bool single = std::is_same_v<S, float>;
  if (law == Law::float_agrees_with_double && !single) return "compares float with double";
  if (law == Law::float_does_not_drift && !single) return "about the rounding of float";
  if (law == Law::float_does_not_drift && Size > 9) return "stated for N <= 9";
  return nullptr;
}

/// Poles in the left half plane in conjugate pairs, and a real one for odd N, all for omega = 1.
template <int Size>
std::vector<std::complex<double>> pole_shape() {
  std::vector<std::complex<double>> poles;
  for (int pair = 0; 2 * pair + 1 < Size; ++pair) {
    const double re = -1.0 + 0.1 * pair;
    const double im = 0.2 + 0.1 * pair;
    poles.emplace_back(re, im);
    poles.emplace_back(re, -im);
  }
  if (Size % 2 == 1) poles.emplace_back(-0.9, 0.0);
  return poles;
}

inline std::vector<std::complex<long double>> equal_poles(int size, long double bandwidth) {
  return std::vector<std::complex<long double>>(static_cast<std::size_t>(size), -bandwidth);
}

template <class S, std::size_t Size>
std::vector<std::complex<long double>> widened(const std::array<std::complex<S>, Size>& poles) {
  std::vector<std::complex<long double>> wide;
  for (const auto& pole : poles) {
    wide.emplace_back(static_cast<long double>(pole.real()), static_cast<long double>(pole.imag()));
  }
  return wide;
}

template <class S, int Size>
esokit::Array<std::complex<S>, Size> scaled_shape(double omega) {
  esokit::Array<std::complex<S>, Size> poles{};
  const auto shape = pole_shape<Size>();
  for (std::size_t i = 0; i < Size; ++i) {
    poles[i] = {static_cast<S>(omega * shape[i].real()), static_cast<S>(omega * shape[i].imag())};
  }
  return poles;
}

/// What is common to observers of one bandwidth, all poles at -observer_bandwidth. A traits class
/// that inherits it adds `Rebind` and says what differs.
template <class ObserverType, class ContinuousType>
struct BandwidthTraits {
  using Observer = ObserverType;
  using Config = typename Observer::Config;
  using Continuous = ContinuousType;
  using S = typename Observer::scalar_type;
  static constexpr const char* field = "observer_bandwidth";
  static constexpr double slowest = 1;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config;
    config.observer_bandwidth = static_cast<S>(omega);
    config.input_gain = static_cast<S>(input_gain);
    config.sample_time = static_cast<S>(sample_time);
    config.max_gap = max_gap;
    return config;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    typename Continuous::Config config;
    config.observer_bandwidth = omega;
    config.input_gain = input_gain;
    return config;
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    return {equal_poles(Observer::size, config.observer_bandwidth)};
  }
  static constexpr const char* excuse(Law law) { return common_excuse<S, Observer::size>(law); }
};

template <int Order, class S, int Extension>
struct ObserverTraits<esokit::LinearEso<Order, S, Extension>>
    : BandwidthTraits<esokit::LinearEso<Order, S, Extension>,
                      esokit::ContinuousLinearEso<Order, double, Extension>> {
  template <class T>
  using Rebind = esokit::LinearEso<Order, T, Extension>;
};

template <int Order, class S, int Extension>
struct ObserverTraits<esokit::LinearEso<Order, S, Extension, esokit::PoleSet>> {
  using Observer = esokit::LinearEso<Order, S, Extension, esokit::PoleSet>;
  using Config = typename Observer::Config;
  using Continuous = esokit::ContinuousLinearEso<Order, double, Extension, esokit::PoleSet>;
  template <class T>
  using Rebind = esokit::LinearEso<Order, T, Extension, esokit::PoleSet>;
  static constexpr const char* field = "poles";
  static constexpr double slowest = 0.5;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    return {.poles = scaled_shape<S, Observer::size>(omega),
            .input_gain = static_cast<S>(input_gain),
            .sample_time = static_cast<S>(sample_time),
            .max_gap = max_gap};
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    return {.poles = scaled_shape<double, Observer::size>(omega), .input_gain = input_gain};
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    return {widened(config.poles)};
  }
  static constexpr const char* excuse(Law law) { return common_excuse<S, Observer::size>(law); }
};

/// Power of two: the level bandwidths are then exact products in every scalar.
inline constexpr double cascade_factor = 2;

template <int Order, int Levels, class S, int Extension>
struct ObserverTraits<esokit::CascadeEso<Order, Levels, S, Extension>>
    : BandwidthTraits<esokit::CascadeEso<Order, Levels, S, Extension>,
                      esokit::ContinuousCascadeEso<Order, Levels, double, Extension>> {
  using Observer = esokit::CascadeEso<Order, Levels, S, Extension>;
  using Continuous = esokit::ContinuousCascadeEso<Order, Levels, double, Extension>;
  using Base = BandwidthTraits<Observer, Continuous>;
  using Config = typename Observer::Config;
  template <class T>
  using Rebind = esokit::CascadeEso<Order, Levels, T, Extension>;
  static constexpr double fastest = 1 << (Levels - 1);

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config = Base::config(omega, sample_time, input_gain, max_gap);
    config.bandwidth_factor = static_cast<S>(cascade_factor);
    return config;
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    auto config = Base::continuous_config(omega, input_gain);
    config.bandwidth_factor = cascade_factor;
    return config;
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    std::vector<std::vector<std::complex<long double>>> poles;
    long double bandwidth = config.observer_bandwidth;
    for (int i = 0; i < Levels; ++i) {
      poles.push_back(equal_poles(Observer::size, bandwidth));
      bandwidth *= config.bandwidth_factor;
    }
    return poles;
  }
};

template <int Order, int Levels, class S, int Extension>
struct ObserverTraits<esokit::CascadeEso<Order, Levels, S, Extension, esokit::PoleSet>> {
  using Observer = esokit::CascadeEso<Order, Levels, S, Extension, esokit::PoleSet>;
  using Config = typename Observer::Config;
  using Continuous =
      esokit::ContinuousCascadeEso<Order, Levels, double, Extension, esokit::PoleSet>;
  template <class T>
  using Rebind = esokit::CascadeEso<Order, Levels, T, Extension, esokit::PoleSet>;
  static constexpr const char* field = "level_poles";
  static constexpr double slowest = 0.5;
  static constexpr double fastest = 1 << (Levels - 1);

  template <class T>
  static auto poles_of(double omega) {
    esokit::Array<esokit::Array<std::complex<T>, Observer::size>, Levels> poles{};
    for (auto& level : poles) {
      level = scaled_shape<T, Observer::size>(omega);
      omega *= cascade_factor;
    }
    return poles;
  }
  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    return {.level_poles = poles_of<S>(omega),
            .input_gain = static_cast<S>(input_gain),
            .sample_time = static_cast<S>(sample_time),
            .max_gap = max_gap};
  }
  static typename Continuous::Config continuous_config(double omega, double input_gain) {
    return {.level_poles = poles_of<double>(omega), .input_gain = input_gain};
  }
  static std::vector<std::vector<std::complex<long double>>> level_poles(const Config& config) {
    std::vector<std::vector<std::complex<long double>>> poles;
    for (const auto& level : config.level_poles) poles.push_back(widened(level));
    return poles;
  }
  static constexpr const char* excuse(Law law) { return common_excuse<S, Observer::size>(law); }
};

}  // namespace esokit_test

#pragma GCC diagnostic pop
