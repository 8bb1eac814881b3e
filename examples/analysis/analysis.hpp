/// @file
/// What the examples of the analysis share: its name on the page, and observers of equal
/// disturbance bandwidth.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>

#include "common/report.hpp"

namespace analysis {

using namespace esokit;
using Complex = std::complex<double>;

inline const std::string folder = "analysis";

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "Analysis of finished designs",
          .citation =
              "Our own numbers, computed by include/esokit/analysis; the observers and the bounds "
              "are those of the papers",
          .link = "",
          .title = std::move(title),
          .description = std::move(description)};
}

inline constexpr double level_factor = 2.0;  ///< alpha

/// A sampled observer with b0 = 1; one level is the standard LESO.
template <int Order, int Levels>
typename CascadeEso<Order, Levels>::Config observer_config(double bandwidth, double sample_time) {
  typename CascadeEso<Order, Levels>::Config config;
  config.observer_bandwidth = bandwidth;
  config.bandwidth_factor = Levels > 1 ? level_factor : 0.0;
  config.input_gain = 1.0;
  config.sample_time = sample_time;
  return config;
}
template <int Order, int Levels>
CascadeEso<Order, Levels> observer_with(double bandwidth, double sample_time) {
  return CascadeEso<Order, Levels>::make(observer_config<Order, Levels>(bandwidth, sample_time))
      .value();
}

/// The controller around it.
template <int Order, int Levels>
Adrc<CascadeEso<Order, Levels>> controller_with(double bandwidth, double sample_time,
                                                double control) {
  return Adrc<CascadeEso<Order, Levels>>::make(
             {.observer = observer_config<Order, Levels>(bandwidth, sample_time),
              .controller_bandwidth = control})
      .value();
}

/// From d to dhat at a frequency.
template <class Observer>
Complex disturbance_response(const Observer& observer, double frequency) {
  return frequency_response(estimation_system(observer).template channel<1, Observer::order>(),
                            frequency)
      .value()(0, 0);
}

/// Lowest frequency (rad/s) where dhat has fallen to -3 dB of d.
template <class Observer>
double disturbance_bandwidth(const Observer& observer) {
  const auto system = estimation_system(observer).template channel<1, Observer::order>();
  const auto size = [&](double w) { return std::abs(frequency_response(system, w).value()(0, 0)); };
  const double nyquist = 3.14159 / observer.sample_time();
  double low = 1e-6 * nyquist;
  double high = low;
  while (high < nyquist && size(high) > std::sqrt(0.5)) {
    low = high;
    high *= 1.05;
  }
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(low * high);
    (size(middle) > std::sqrt(0.5) ? low : high) = middle;
  }
  return low;
}

/// The omega_o1 (rad/s) at which the observer has a wanted disturbance bandwidth.
template <int Order, int Levels>
double bandwidth_for(double wanted, double sample_time) {
  double low = 0.02 * wanted;
  double high = 20.0 * wanted;
  for (int i = 0; i < 50; ++i) {
    const double middle = std::sqrt(low * high);
    (disturbance_bandwidth(observer_with<Order, Levels>(middle, sample_time)) < wanted ? low
                                                                                       : high) =
        middle;
  }
  return std::sqrt(low * high);
}

}  // namespace analysis
