/// @file
/// A diagnosis in words, and a sample of a loop as a row of a table, for the host.
#pragma once

#include <esokit/control/health.hpp>
#include <esokit/control/telemetry.hpp>
#include <esokit/core/text.hpp>

namespace esokit {

/// What is likely wrong, and what to do.
struct Advice {
  const char* wrong;  ///< one sentence
  const char* doing;  ///< one sentence
};

/// In words.
[[nodiscard]] constexpr Advice advice(LoopFault fault) noexcept {
  switch (fault) {
    case LoopFault::none:
      return {"Nothing that shows.", "Go on."};
    case LoopFault::wrong_sign:
      return {
          "More u moves y the other way than b0 says: the sign of b0, of the sensor or of the "
          "wiring is wrong.",
          "Take the output to its safe value, change the sign of input_gain, and try again with "
          "narrow limits."};
    case LoopFault::gain_too_small:
      return {"u does several times what b0 says: b0 is too small, or in other units.",
              "Take the output to its safe value, multiply input_gain by the gain ratio found, and "
              "check the units of u."};
    case LoopFault::measurements_rejected:
      return {
          "Many measurements are no numbers, or outliers.",
          "Look at the sensor, its bus and its range; widen the outlier gate if they are true."};
    case LoopFault::saturated:
      return {"The actuator is at a limit more than half of the time.",
              "Ask for less (a slower reference, a lower controller_bandwidth), or give it a "
              "stronger actuator."};
    case LoopFault::bounded:
      return {"The disturbance is at its bound more than half of the time: a steady error remains.",
              "Find the load, or raise disturbance_bound."};
    case LoopFault::innovation_too_large:
      return {
          "y moves by much more than its noise between prediction and measurement.",
          "A lag or a delay is not in the model, b0 changes, or the noise is larger than given: "
          "identify from a log."};
    case LoopFault::gain_too_large_or_disturbed:
      return {
          "What u does is undone at once: a load drives u, or b0 is too large.",
          "Let GainProbe add small steps to u: a gain ratio that it finds small, too, says by how "
          "much input_gain is too large."};
  }
  return {"", ""};
}

/// Has text.
template <>
inline constexpr bool has_text<LoopFault> = true;

/// Writes both sentences.
template <class Stream>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, LoopFault fault) {
  const Advice words = advice(fault);
  out << words.wrong << ' ' << words.doing;
  return out;
}

/// Writes the names of the columns, for a log that `identify` and examples/from_log read: u is held
/// from its row to the next.
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
