/// @file
/// What a step of an observer reports.
#pragma once

#include <concepts>
#include <cstdint>
#include <esokit/core/detail/text.hpp>
#include <esokit/core/lanes.hpp>

namespace esokit {

/// Bit flags; `ok` is zero. A step of packs reports one status per lane, see `StatusOf`.
enum class StepStatus : std::uint16_t {
  ok = 0,
  /// y was NaN, infinite, or so large that the estimate would not be finite. It was not used: the
  /// step only predicted.
  measurement_rejected = 1,
  /// u was NaN, infinite or too large. The last good u was used instead.
  input_rejected = 2,
  /// Not even the last good u gives a finite prediction: the state was kept, and the next good y
  /// restarts the observer.
  prediction_dropped = 4,
  /// Samples were missing before this correction, which used the gain for the whole gap.
  gap_bridged = 8,
  /// More samples than `longest_gap()` were missing, or more than `max_gap()` too soon after other
  /// long gaps (`recovering()`), or the state could not be predicted: the
  /// observer was restarted as by reset(y). A controller then sets it to rest at y under the
  /// present u, so that u does not jump.
  restarted = 16,
  /// The state given to a reset was not finite, or its angle was too large to determine its turn:
  /// nothing was changed.
  state_rejected = 32,
  /// y was too far from its prediction and was rejected by the outlier gate: the step only
  /// predicted.
  outlier_rejected = 64,
  /// An angle differed by more than a quarter of its period from what its motion so far predicts:
  /// its turn is uncertain, see WrappedOutput.
  turn_assumed = 128,
  /// Of a controller: the reference (or u0 of a DisturbanceCompensator) was NaN, infinite or so
  /// large that the law would not be finite. In a form that needs it u stayed as it was last
  /// commanded.
  reference_rejected = 256,
};

/// The flags of both.
/// @{
constexpr StepStatus operator|(StepStatus a, StepStatus b) noexcept {
  return static_cast<StepStatus>(static_cast<std::uint16_t>(a) | static_cast<std::uint16_t>(b));
}

constexpr StepStatus& operator|=(StepStatus& a, StepStatus b) noexcept { return a = a | b; }
/// @}

/// True if `flag` is set in `status`.
constexpr bool has(StepStatus status, StepStatus flag) noexcept {
  return (static_cast<std::uint16_t>(status) & static_cast<std::uint16_t>(flag)) != 0;
}

/// What a step with scalar S reports: a status, for a pack one per lane.
template <class S>
using StatusOf = Lanes<StepStatus, S>;

/// The same for packs: the flags of both lane by lane; true if `flag` is set in any lane.
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

namespace detail {

/// `flag` where a test of an S failed, lane by lane.
template <class S, class Mask>
constexpr StatusOf<S> unless(const Mask& good, StepStatus flag) noexcept {
  if constexpr (lane_count<S> == 1) {
    return all(good) ? StepStatus::ok : flag;
  } else {
    StatusOf<S> each;
    for (int i = 0; i < lane_count<S>; ++i) each[i] = good[i] ? StepStatus::ok : flag;
    return each;
  }
}

}  // namespace detail

/// A status can be written to a stream, see has_text.
template <>
inline constexpr bool has_text<StepStatus> = true;

/// Writes all flags that are set, for example `measurement_rejected|gap_bridged`, or `ok`.
template <class Stream, std::same_as<StepStatus> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value status) {
  constexpr const char* names[] = {"measurement_rejected", "input_rejected", "prediction_dropped",
                                   "gap_bridged",          "restarted",      "state_rejected",
                                   "outlier_rejected",     "turn_assumed",   "reference_rejected"};
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
