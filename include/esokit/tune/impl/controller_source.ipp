#pragma once

#include <complex>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <esokit/tune/controller_source.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tuning.hpp>
#include <string>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION std::string source(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  std::string number = text;
  if (number.find_first_of(".en") == std::string::npos) number += ".0";
  return number;
}

ESOKIT_FUNCTION double printed(double value) { return std::strtod(source(value).c_str(), nullptr); }

ESOKIT_FUNCTION TuneSettings as_printed(TuneSettings s) {
  for (double* number :
       {&s.observer_bandwidth, &s.bandwidth_factor, &s.disturbance_bound, &s.capture_bandwidth}) {
    *number = printed(*number);
  }
  for (auto& pole : s.observer_poles) pole = {printed(pole.real()), printed(pole.imag())};
  if (s.controller_bandwidth > 0.0) {
    s.controller_bandwidth = printed(s.controller_bandwidth);
    s.gains =
        polynomial(std::vector<std::complex<double>>(s.gains.size(), -s.controller_bandwidth));
  } else {
    for (double& gain : s.gains) gain = printed(gain);
  }
  return s;
}

ESOKIT_FUNCTION std::string ControllerSource::text(const TuneModel& model) const {
  return "using Observer = " + observer + ";\n" +
         "auto controller = esokit::Adrc<Observer>::make({.observer = {" + config + "},\n    " +
         law + ",\n    .limits = {.lower = " + source(model.u_min) +
         ", .upper = " + source(model.u_max) +
         "},\n    .missing = {.input = " + source(model.safe_input()) +
         "},  // u if y stays away: choose\n    " + soften + "});\n";
}

inline std::string source_list(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ", ") + source(number);
  return text;
}

/// @param kept the pole that the design keeps, or nothing
inline std::string source_poles(const TunedDesign& d, std::string kept) {
  for (const auto& p : d.settings.observer_poles) {
    kept += (kept.empty() ? "{" : ", {") + source(p.real()) + ", " + source(p.imag()) + "}";
  }
  return ".poles = {{" + kept + "}}";
}

/// `.max_gap`, where the dead time is longer than what it is by default.
inline std::string source_gap(const TuneModel& model) {
  const int predicted = model.predicted_samples();
  return predicted > 100 ? ", .max_gap = " + std::to_string(predicted) : "";
}

/// Type and config of an observer that knows parts of the plant.
inline std::pair<std::string, std::string> known_source(const TunedDesign& d,
                                                        const TuneModel& model) {
  std::string type = "esokit::ModelEso<esokit::ModelParts{.order = " + std::to_string(model.order);
  std::string parts;
  const auto part = [&](const std::string& text) { parts += (parts.empty() ? "" : ", ") + text; };
  if (d.knows.lag) {
    type += ", .actuator = 1";
    part(".actuator = {.time_constant = " + source(model.lag) + "}");
  }
  if (d.knows.sensor) {
    type += ", .sensor = 1";
    part(".sensor = {.time_constant = " + source(model.sensor) + "}");
  }
  if (d.knows.sinusoid) {
    type += ", .resonators = 1";
    part(".resonators = {{{.frequency = " + source(model.sinusoids.front().frequency) +
         ", .capture_bandwidth = " + source(d.settings.capture_bandwidth) + "}}}");
  }
  const bool free = d.family == TuneFamily::free_poles;
  type += d.family == TuneFamily::half_gain ? "}, double, esokit::HalfGainPoles>"
          : free                            ? "}, double, esokit::PoleSet>"
                                            : "}>";
  // The pole of the lag is kept.
  return {type, (free ? source_poles(d, "{-1.0 / " + source(model.lag) + ", 0.0}")
                      : ".observer_bandwidth = " + source(d.settings.observer_bandwidth)) +
                    ", .input_gain = " + source(model.input_gain.value) + ", .sample_time = " +
                    source(model.sample_time) + ", .model = {" + parts + "}" + source_gap(model)};
}

/// Type and config of an observer that knows the chain alone.
inline std::pair<std::string, std::string> chain_source(const TunedDesign& d,
                                                        const TuneModel& model) {
  const std::string n = std::to_string(model.order);
  const std::string common = ".input_gain = " + source(model.input_gain.value) +
                             ", .sample_time = " + source(model.sample_time);
  const std::string bandwidth =
      ".observer_bandwidth = " + source(d.settings.observer_bandwidth) + ", ";
  const std::string gap = source_gap(model);
  switch (d.family) {
    case TuneFamily::linear:
      return {"esokit::LinearEso<" + n + (d.extension > 1 ? ", double, 2>" : ">"),
              bandwidth + common + gap};
    case TuneFamily::half_gain:
      return {"esokit::HalfGainEso<" + n + ">", bandwidth + common + gap};
    case TuneFamily::cascade:
      return {"esokit::CascadeEso<" + n + ", " + std::to_string(d.levels) + ">",
              bandwidth + ".bandwidth_factor = " + source(d.settings.bandwidth_factor) + ", " +
                  common + gap};
    case TuneFamily::filter: {
      std::vector<double> bounds(static_cast<std::size_t>(model.order), 0.0);
      bounds.push_back(d.settings.disturbance_bound);
      return {"esokit::ExtendedStateFilter<" + n + ">",
              common + ", .measurement_variance = " + source(model.noise) + " * " +
                  source(model.noise) + ", .disturbance_bounds = {{" + source_list(bounds) +
                  "}}, .bound_factor = 1.0, .inflation_rule = esokit::InflationRule::none, "
                  ".mode = esokit::RiccatiMode::frozen"};
    }
    case TuneFamily::free_poles:
      return {"esokit::LinearEso<" + n + ", double, 1, esokit::PoleSet>",
              source_poles(d, "") + ", " + common + gap};
  }
  return {};
}

ESOKIT_FUNCTION ControllerSource controller_source(const TunedDesign& d, const TuneModel& model) {
  const auto [type, config] = d.knows.any() ? known_source(d, model) : chain_source(d, model);
  return {type, config,
          d.settings.controller_bandwidth > 0.0
              ? ".controller_bandwidth = " + source(d.settings.controller_bandwidth)
              : ".gains = {{" + source_list(d.settings.gains) + "}}",
          std::string(".soften = ") + (d.settings.soften ? "true" : "false")};
}

}  // namespace detail
}  // namespace esokit
