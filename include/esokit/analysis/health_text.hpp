/// @file
/// A diagnosis as text, and telemetry as rows of a table, for the host.
#pragma once

#include <concepts>
#include <esokit/control/health.hpp>
#include <esokit/control/telemetry.hpp>
#include <esokit/core/detail/text.hpp>

namespace esokit {

/// The likely fault, and what to do.
struct Advice {
  const char* wrong;  ///< one sentence
  const char* doing;  ///< one sentence
};

/// The advice for a fault.
[[nodiscard]] constexpr Advice advice(LoopFault fault) noexcept {
  switch (fault) {
    case LoopFault::none:
      return {"No fault found.", "Nothing to do."};
    case LoopFault::wrong_sign:
      return {
          "A larger u moves y in the opposite direction to b0: the sign of b0, of the sensor or of "
          "the wiring is wrong (or a load is stronger than the actuator).",
          "Set the output to its safe value; if no such load is there, change the sign of "
          "input_gain, and try again with narrow limits."};
    case LoopFault::gain_too_small:
      return {
          "u has several times the effect that b0 predicts: b0 is too small, or in other units.",
          "Set the output to its safe value, multiply input_gain by at least the response found, "
          "and check the units of u."};
    case LoopFault::measurements_rejected:
      return {"Many measurements are outliers or not finite.",
              "Look at the sensor, its bus and its range; widen the outlier gate if the values are "
              "right."};
    case LoopFault::saturated:
      return {"The actuator is at a limit more than half of the time.",
              "Demand less (a slower reference, a lower controller_bandwidth), or use a stronger "
              "actuator."};
    case LoopFault::bounded:
      return {"The disturbance is at its bound more than half of the time: a steady error remains.",
              "Find the load, or raise disturbance_bound."};
    case LoopFault::innovation_too_large:
      return {"Measurements differ from their predictions by much more than the noise.",
              "The model may lack a lag or a delay, b0 may change, or the noise may be larger than "
              "given: identify from a log."};
    case LoopFault::gain_too_large_or_disturbed:
      return {
          "The effect of u is cancelled at once: a load drives u, b0 is too large, or the actuator "
          "is off.",
          "Let GainProbe add small steps to u: if its gain ratio is small, too, multiply "
          "input_gain by it."};
    case LoopFault::sensor_still:
      return {
          "The measurement does not change although u moves or is at a limit: the sensor stands "
          "still, or the machine is held.",
          "Set the output to its safe value; look at the sensor, its cable and its bus, then for "
          "a stop, a brake or friction."};
  }
  return {"", ""};
}

/// A LoopFault can be written to a stream, see has_text.
template <>
inline constexpr bool has_text<LoopFault> = true;

/// Writes both sentences of the advice.
template <class Stream, std::same_as<LoopFault> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value fault) {
  const Advice words = advice(fault);
  out << words.wrong << ' ' << words.doing;
  return out;
}

/// Writes the names of the columns of a log that `identify` and examples/from_log can read: u is
/// held from its row to the next.
template <int States, class Stream>
void write_header(Stream& out) {
  out << "time,u,y,r,requested,dhat,innovation,status,mode,trust,bounded";
  for (int i = 0; i < States; ++i) out << ",estimate_" << i;
  out << '\n';
}

/// Writes a row. Give the stream 9 digits for float and 17 for double.
template <int States, PlainScalar S, class Stream>
void write_row(Stream& out, const Telemetry<States, S>& row) {
  out << row.time << ',' << row.u << ',' << row.y << ',' << row.r << ',' << row.requested << ','
      << row.disturbance << ',' << row.innovation << ',' << static_cast<int>(row.status) << ','
      << static_cast<int>(row.mode) << ',' << row.trust << ',' << (row.bounded ? 1 : 0);
  for (const S& z : row.estimate) out << ',' << z;
  out << '\n';
}

}  // namespace esokit
