/// @file
/// What the examples of this folder share: they show no paper, but what a model gains and costs.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/run.hpp>

#include "common/report.hpp"

namespace models {

using esokit::examples::CsvRow;
using esokit::examples::number_text;

inline constexpr double sample_time = 1e-3;  ///< T, s

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "Putting what you know into the model",
          .citation =
              "No paper. Actuator, sensor and oscillating disturbances in the model of the "
              "observer: what they gain and cost",
          .link = "",
          .title = std::move(title),
          .description = std::move(description)};
}

/// A step of the reference from 0 to 1 at t = 0.
struct Step {
  std::vector<double> t, y, u;
  double overshoot = 0;  ///< %
  double rise = 0;       ///< until it first is at 0.9, s
};

template <class Plant, class Controller>
Step step_of(const Plant& plant, const Controller& controller, double duration = 0.5) {
  const auto run = esokit::sim::run(plant, controller, {.duration = duration, .reference = 1.0});
  Step step;
  if (!run) return step;
  step.t = run->t;
  step.y = run->output;
  step.u = run->input;
  const auto crossing = [&](double level) {
    for (std::size_t k = 1; k < step.y.size(); ++k) {
      if (step.y[k] < level) continue;
      return step.t[k] - sample_time * (step.y[k] - level) / (step.y[k] - step.y[k - 1]);
    }
    return duration;
  };
  for (const double y : step.y) step.overshoot = std::max(step.overshoot, 100 * (y - 1));
  step.rise = crossing(0.9);
  return step;
}

/// The bandwidth of the law at which a step rises in `rise` seconds, between two that enclose it.
template <class Plant, class Make>
double bandwidth_for_rise(const Plant& plant, const Make& make, double rise, double low,
                          double high) {
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(low * high);
    (step_of(plant, make(middle)).rise > rise ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

/// A number of a loop that may have none.
inline std::string or_unstable(double number, int digits) {
  return std::isnan(number) ? "unstable" : number_text(number, digits);
}

/// What a loop costs: u's standard deviation for noise of 1 on y, and its margins. NaN where the
/// loop is not stable and has none.
struct Price {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  double noise = none, modulus = none, delay = none;
};
template <class Plant, class Controller>
Price price_of(const Plant& plant, const Controller& controller) {
  Price price;
  if (const auto n = esokit::noise(plant, controller, {.measurement = {1.0}})) {
    price.noise = n->control[0];
  }
  if (const auto m = esokit::margins(plant, controller)) price.modulus = m->modulus.value;
  if (const auto d = esokit::delay_margin(plant, controller)) price.delay = d->value;
  return price;
}

}  // namespace models
