/// @file
/// The two controllers of fixed_drive.cpp: the host designs them and writes their C in integers
/// (write_c.cpp). Position by a counter that wraps, with the wanted current in counts of the
/// converter; current by 12 bits, with the duty cycle in counts of the timer.
#pragma once

#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/fixed_point.hpp>

namespace drive {

inline constexpr double tick = 6.283185307179586 / 4096;  ///< rad, a count of the encoder
inline constexpr double ampere_count = 10.0 / 2048;       ///< A, a count of the converter
inline constexpr double volt_count = 24.0 / 1200;         ///< V, a count of the timer

using Position = esokit::Adrc<esokit::LinearEso<2>>;  // current to angle: two integrations
using Current = esokit::Adrc<esokit::LinearEso<1>>;   // voltage to current: one

inline Position::Config position() {
  return {.observer = {.observer_bandwidth = 200,  // rad/s
                       .input_gain = 300,          // rad/s2 per A
                       .sample_time = 1e-3,
                       .max_gap = 4},
          .controller_bandwidth = 40,
          .limits = {.lower = -1024 * ampere_count, .upper = 1024 * ampere_count}};
}
inline esokit::FixedPointOptions position_counts() {
  // At most 60 rad/s: 40 counts a sample.
  return {.y = {.unit = tick, .most = 40, .counter_bits = 16},
          .u = {.unit = ampere_count, .most = 1024}};
}

inline Current::Config current() {
  return {.observer = {.observer_bandwidth = 6000,  // rad/s
                       .input_gain = 500,           // A/s per V: 2 mH
                       .sample_time = 1.25e-4,
                       .max_gap = 4},
          .controller_bandwidth = 1200,
          .limits = {.lower = -1200 * volt_count, .upper = 1200 * volt_count}};
}
inline esokit::FixedPointOptions current_counts() {
  return {.y = {.unit = ampere_count, .most = 2047}, .u = {.unit = volt_count, .most = 1200}};
}

}  // namespace drive
