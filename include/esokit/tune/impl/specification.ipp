#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/analysis/loop.hpp>
#include <esokit/core/check.hpp>
#include <esokit/identify/identify.hpp>
#include <esokit/tune/specification.hpp>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION double TuneModel::lateness() const {
  if (order == 2) return latency();
  return may_rub() && pole > 0.0 ? latency() + 1.0 / pole : 0.0;
}

ESOKIT_FUNCTION Check<double> TuneModel::validate() const {
  Rules<double> rules;
  const auto size_fits = [&](const char* field, double value) {
    rules.demand((std::abs)(value) >= 1e-60 && (std::abs)(value) <= 1e60, field, value,
                 "must be between 1e-60 and 1e60: use another unit");
  };
  const auto lag_fits = [&](const char* field, double value) {
    rules.demand(!(value > 0.0) || (esokit::detail::at_most(1e-9 * sample_time, value) &&
                                    esokit::detail::at_most(value, 1e6 * sample_time)),
                 field, value, "must be 0, or between 1e-9 and 1e6 samples");
  };
  rules.demand(order >= 1 && order <= 3, "order", static_cast<double>(order), "must be 1, 2 or 3")
      .nonzero("input_gain", input_gain.value)
      .not_negative("input_gain.half_width", input_gain.half_width)
      .demand(!(input_gain.half_width >= (std::abs)(input_gain.value)), "input_gain.half_width",
              input_gain.half_width, "must be below b0: the sign of b0 has to be known")
      .demand(is_finite(pole), "pole", pole, "must be finite")
      .not_negative("lag", lag)
      .not_negative("dead_time", dead_time)
      .not_negative("latency_half_width", latency_half_width)
      .not_negative("lag_half_width", lag_half_width)
      .not_negative("sensor", sensor)
      .not_negative("friction", friction.value_or(0.0))
      .positive("noise", noise)
      .positive("disturbance", disturbance)
      .positive("sample_time", sample_time)
      .demand(is_finite(u_min), "u_min", u_min, "must be finite")
      .demand(is_finite(u_max), "u_max", u_max, "must be finite")
      .demand(u_min < u_max, "u_max", u_max, "must be above u_min")
      .demand(sinusoids.size() <= 1, "sinusoids", static_cast<double>(sinusoids.size()),
              "must be one at most")
      .demand(esokit::detail::at_most(dead_time, 100.0 * sample_time), "dead_time", dead_time,
              "must not be above 100 samples")
      .demand(esokit::detail::at_most(latency_half_width, 100.0 * sample_time),
              "latency_half_width", latency_half_width, "must not be above 100 samples")
      .demand(sample_time >= 1e-12 && sample_time <= 1e12, "sample_time", sample_time,
              "must be between 1e-12 s and 1e12 s")
      .demand(esokit::detail::at_most((std::abs)(pole)*sample_time, 100.0), "pole", pole,
              "must be at most a hundred times the sample rate")
      .demand((std::abs)(u_min) <= 1e60, "u_min", u_min, "is too large: use another unit")
      .demand((std::abs)(u_max) <= 1e60, "u_max", u_max, "is too large: use another unit");
  // For order 3 the computed LQG controller is wrong beyond this.
  rules.demand((std::abs)(input_gain.value) >= 1e-20 && (std::abs)(input_gain.value) <= 1e20,
               "input_gain", input_gain.value, "must be between 1e-20 and 1e20: use another unit");
  size_fits("noise", noise);
  size_fits("disturbance", disturbance);
  lag_fits("lag", lag);
  lag_fits("sensor", sensor);
  // Beyond this limit the criterion is a difference of numbers that agree to the last digit.
  rules.demand(esokit::detail::at_most(1e-6, filter_bandwidth() * sample_time), "disturbance",
               disturbance,
               "is so small for this noise that an observer would need a million samples");
  for (std::size_t i = 0; i < sinusoids.size(); ++i) {
    const int index = static_cast<int>(i);
    rules.positive("sinusoids.frequency", sinusoids[i].frequency, index)
        .demand(esokit::detail::below(sinusoids[i].frequency * sample_time, 3.1),
                "sinusoids.frequency", sinusoids[i].frequency, "must be below half the sample rate",
                index)
        .demand(esokit::detail::at_most(1e-9, sinusoids[i].frequency * sample_time),
                "sinusoids.frequency", sinusoids[i].frequency,
                "must be at least 1e-9 of the sample rate", index)
        .not_negative("sinusoids.amplitude", sinusoids[i].amplitude, index)
        .demand(!(sinusoids[i].amplitude > 1e60), "sinusoids.amplitude", sinusoids[i].amplitude,
                "is too large: use another unit", index)
        .not_negative("sinusoids.capture_bandwidth", sinusoids[i].capture_bandwidth, index);
  }
  return rules;
}

ESOKIT_FUNCTION TuneModel tune_model(const Identified& found, double u_min, double u_max) {
  TuneModel model;
  model.order = found.order;
  model.input_gain = {found.input_gain.value, interval_of_99 * found.input_gain.half_width};
  model.pole = found.pole.value;
  model.lag = found.lag.value;
  model.dead_time = found.dead_time.value;
  model.latency_half_width = interval_of_99 * found.latency.half_width;
  model.lag_half_width = interval_of_99 * found.lag.half_width;
  model.noise = found.noise.value;
  model.disturbance = found.random_walk();
  model.sample_time = found.log.sample_time;
  model.u_min = u_min;
  model.u_max = u_max;
  return model;
}

namespace detail {

ESOKIT_FUNCTION DensePlant dense_plant(const TuneModel& model, double gain) {
  const int n = model.order;
  const int lag = model.lag > 0.0 ? 1 : 0;
  const int sensor = model.sensor > 0.0 ? 1 : 0;
  const int states = n + lag + sensor;
  DensePlant plant{DynamicMatrix<double>(states, states),
                   DynamicMatrix<double>(states, 1),
                   DynamicMatrix<double>(1, states),
                   DynamicMatrix<double>(states, 1),
                   {model.dead_time}};
  for (int i = 0; i + 1 < n; ++i) plant.a(i, i + 1) = 1.0;
  plant.a(n - 1, n - 1) = -model.pole;
  plant.e(n - 1, 0) = 1.0;
  const double b = gain * model.input_gain.value;
  if (lag == 1) {
    plant.a(n - 1, n) = b;
    plant.a(n, n) = -1.0 / model.lag;
    plant.b(n, 0) = 1.0 / model.lag;
  } else {
    plant.b(n - 1, 0) = b;
  }
  if (sensor == 1) {
    plant.a(n + lag, 0) = 1.0 / model.sensor;
    plant.a(n + lag, n + lag) = -1.0 / model.sensor;
    plant.c(0, n + lag) = 1.0;
  } else {
    plant.c(0, 0) = 1.0;
  }
  return plant;
}

ESOKIT_FUNCTION std::vector<PlantVariant> plant_variants(const TuneModel& model) {
  std::vector<PlantVariant> variants;
  const double share = model.input_gain.half_width / (std::abs)(model.input_gain.value);
  const double more = model.latency_half_width;
  if (!(share > 0.0) && !(more > 0.0) && !(model.lag_half_width > 0.0)) return variants;
  TuneModel late = model;
  late.dead_time += more;
  variants.push_back({late, 1.0 + share});
  variants.push_back({late, 1.0 - share});
  if (model.lag > 0.0 && model.lag_half_width > 0.0) {
    const double latency = late.lag + late.dead_time;
    for (const double by : {model.lag_half_width, -model.lag_half_width}) {
      TuneModel other = late;
      other.lag = std::clamp(model.lag + by, 0.05 * model.lag, latency);
      other.dead_time = latency - other.lag;
      variants.push_back({other, 1.0 + share});
    }
  }
  return variants;
}

}  // namespace detail

ESOKIT_FUNCTION LoopResult closed_loop(const TuneModel& model, const LinearController& controller,
                                       double gain) {
  if (auto ok = model.validate(); !ok) return ok.error();
  return Loop::make(detail::dense_plant(model, gain), controller);
}

}  // namespace esokit
