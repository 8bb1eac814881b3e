/// @file
/// What the controller law suite must know of an observer, and the plant that the laws run on.
#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/control/adrc.hpp>
#include <esokit/eigen.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <vector>

namespace esokit_test {

using esokit::Adrc;
using esokit::ErrorBased;
using esokit::LoopMode;
using esokit::OutputBased;
using esokit::StepStatus;

/// To be specialised: `config(omega, T, b0)` of the observer with bandwidth omega.
template <class Observer>
struct LoopTraits;

/// y^(n) = d + b0 u with constant d, exact between samples, in double whatever the controller is.
class ChainPlant {
 public:
  ChainPlant(int order, double sample_time, double input_gain, double disturbance)
      : x_(static_cast<std::size_t>(order)),
        sample_time_(sample_time),
        input_gain_(input_gain),
        disturbance_(disturbance) {}

  void step(double u) {
    const double highest = disturbance_ + input_gain_ * u;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      double term = 1;
      for (std::size_t j = i + 1; j <= x_.size(); ++j) {
        term *= sample_time_ / static_cast<double>(j - i);
        x_[i] += term * (j < x_.size() ? x_[j] : highest);
      }
    }
  }

  [[nodiscard]] double output() const { return x_[0]; }
  [[nodiscard]] const std::vector<double>& state() const { return x_; }
  void set_state(const std::vector<double>& x) { x_ = x; }
  void set_disturbance(double d) { disturbance_ = d; }

 private:
  std::vector<double> x_;
  double sample_time_;
  double input_gain_;
  double disturbance_;
};

/// A number of any kind that a sensor or a report may give.
template <class S>
S anything(Random& random) {
  switch (random.index(8)) {
    case 0:
      return hidden_nan<S>();
    case 1:
      return random.index(2) == 0 ? hidden_infinity<S>() : -hidden_infinity<S>();
    case 2:
    case 3:
      return static_cast<S>(random.uniform(-4, 4));
    default: {
      const double top = 0.999 * std::log(static_cast<double>(std::numeric_limits<S>::max()));
      const double size = std::exp(random.uniform(-5, top));
      return static_cast<S>(random.index(2) == 0 ? size : -size);
    }
  }
}

/// The settings of an observer of one bandwidth, or of a nest of adapters around it.
template <class S, class Config>
void fill_settings(Config& config, double omega_o, double sample_time, double input_gain) {
  if constexpr (requires { config.observer; }) {
    fill_settings<S>(config.observer, omega_o, sample_time, input_gain);
  } else {
    config.observer_bandwidth = static_cast<S>(omega_o);
    if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = S(1.5);
    config.input_gain = static_cast<S>(input_gain);
    config.sample_time = static_cast<S>(sample_time);
  }
}

}  // namespace esokit_test
