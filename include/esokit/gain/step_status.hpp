/// @file
/// What a step of an observer reports.
#pragma once

#include <esokit/core/lanes.hpp>
#include <esokit/core/text.hpp>

namespace esokit {

/// Bit flags; `ok` is zero. A step of packs reports one a lane, `StatusOf`.
enum class StepStatus : unsigned char {
  ok = 0,
  /// y was NaN, infinite, or so large that the estimate would not be finite: predicted only.
  measurement_rejected = 1,
  /// u was NaN, infinite or too large: predicted with the last good u.
  input_rejected = 2,
  /// No good u gives a finite prediction: the state stands still, and the next good y restarts it.
  prediction_dropped = 4,
  /// Samples were missing before this correction; it used the gain for the whole gap.
  gap_bridged = 8,
  /// More samples than `max_gap` were missing, or the state could not be predicted: restarted as by
  /// reset(y).
  restarted = 16,
  /// The state given to a reset was not finite, or an angle too large to tell its branch: nothing
  /// changed.
  state_rejected = 32,
  /// y lay too far from its prediction for the observer's outlier gate: predicted only.
  outlier_rejected = 64,
  /// An angle moved otherwise than before by more than a quarter of its period: its turn is not
  /// sure, see WrappedOutput.
  turn_assumed = 128,
};

/// Both flags.
/// @{
constexpr StepStatus operator|(StepStatus a, StepStatus b) noexcept {
  return static_cast<StepStatus>(static_cast<unsigned char>(a) | static_cast<unsigned char>(b));
}

constexpr StepStatus& operator|=(StepStatus& a, StepStatus b) noexcept { return a = a | b; }
/// @}

/// True if `flag` is set in `status`.
constexpr bool has(StepStatus status, StepStatus flag) noexcept {
  return (static_cast<unsigned char>(status) & static_cast<unsigned char>(flag)) != 0;
}

/// What a step of scalar S reports: a status, of a pack one a lane.
template <class S>
using StatusOf = Lanes<StepStatus, S>;

/// Lane by lane, and true if `flag` is set in any.
/// @{
template <int Count>
constexpr PerLane<StepStatus, Count> operator|(const PerLane<StepStatus, Count>& a,
                                               const PerLane<StepStatus, Count>& b) noexcept {
  PerLane<StepStatus, Count> both;
  for (int i = 0; i < Count; ++i) both[i] = a[i] | b[i];
  return both;
}

template <int Count>
constexpr bool has(const PerLane<StepStatus, Count>& status, StepStatus flag) noexcept {
  for (const StepStatus lane : status.values) {
    if (has(lane, flag)) return true;
  }
  return false;
}
/// @}

/// Has text.
template <>
inline constexpr bool has_text<StepStatus> = true;

/// Writes all flags that are set, `measurement_rejected|gap_bridged`, or `ok`.
template <class Stream>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, StepStatus status) {
  constexpr const char* names[] = {"measurement_rejected", "input_rejected", "prediction_dropped",
                                   "gap_bridged",          "restarted",      "state_rejected",
                                   "outlier_rejected",     "turn_assumed"};
  if (status == StepStatus::ok) out << "ok";
  const char* separator = "";
  unsigned flag = 1;
  for (const char* name : names) {
    if (has(status, static_cast<StepStatus>(flag))) {
      out << separator << name;
      separator = "|";
    }
    flag *= 2;
  }
  return out;
}

}  // namespace esokit
