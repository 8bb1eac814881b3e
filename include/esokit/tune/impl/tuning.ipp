#pragma once

#include <cstddef>
#include <cstdio>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/overload.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tuning.hpp>
#include <string>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION double TunedDesign::simulated_settling(const TuneModel& variant) const {
  return variant.friction.value_or(0.0) > 0.0 && !settings.gains.empty()
             ? 32.0 / detail::law_mean(settings.gains, variant.order)
             : settling_time;
}

ESOKIT_FUNCTION const TunedDesign* Tuning::chosen() const noexcept {
  return !designs.empty() && designs.front().feasible && designs.front().recovers ? &designs.front()
                                                                                  : nullptr;
}

ESOKIT_FUNCTION std::vector<TuneAlarm> alarms(const Tuning& tuning, const TunedDesign& design) {
  std::vector<TuneAlarm> all;
  const double range = tuning.model.u_max - tuning.model.u_min;
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return std::string(text);
  };
  if (!design.recovers) {
    all.push_back({"overload",
                   "This design does not recover from " + design.lost +
                       ": u goes from limit to limit or stays at one, or y oscillates for ever."});
  } else if (!design.simulated) {
    all.push_back({"overload",
                   "This design was not simulated within the limits of u: whether it "
                   "recovers from an overload is not known."});
  }
  if (tuning.settling_time > 0.0 && design.settling_time > 1.05 * tuning.settling_time) {
    all.push_back(
        {"settling",
         "A step of the reference settles in " + number(design.settling_time) + " s, asked was " +
             number(tuning.settling_time) +
             " s: its slowest poles are those of the observer, or the rules allow no faster law."});
  }
  if (design.control_noise > 1.001 * usual_control_noise * range) {
    all.push_back({"noise", "Noise moves u by " + number(100.0 * design.control_noise / range) +
                                " % of its range (standard deviation); usual is " +
                                number(100.0 * usual_control_noise) +
                                " %. The least that cancels the disturbance of the log is " +
                                number(100.0 * tuning.least_noise / range) +
                                " %. Measure y with less noise, or sample faster."});
  }
  if (design.excess > 3.0) {
    all.push_back({"excess", "Errors of y and u are " + number(design.excess) +
                                 " times the theoretical best: the rules leave little of what "
                                 "this machine could do. It is limited by: " +
                                 design.constraint + "."});
  }
  return all;
}

ESOKIT_FUNCTION int update_operations(int order, int extension, int levels,
                                      const TuneKnowledge& knows) {
  const auto n = static_cast<std::size_t>(order - 1);
  constexpr int chain[4] = {13, 21, 30, 41};
  constexpr int cascade[3][2] = {{26, 37}, {42, 60}, {60, 86}};
  constexpr int lag[3] = {24, 34, 45}, sensor[3] = {23, 33, 44}, sinusoid[3] = {35, 47, 60};
  constexpr int lag_sensor[3] = {36, 48, 61}, lag_sinusoid[3] = {52, 66, 81};
  if (knows.lag && knows.sensor) return lag_sensor[n];
  if (knows.lag && knows.sinusoid) return lag_sinusoid[n];
  if (knows.lag) return lag[n];
  if (knows.sensor) return sensor[n];
  if (knows.sinusoid) return sinusoid[n];
  if (levels > 1) return cascade[n][static_cast<std::size_t>(levels - 2)];
  return chain[n + static_cast<std::size_t>(extension - 1)];
}

}  // namespace esokit
