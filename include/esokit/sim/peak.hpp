/// @file
/// The running peak of a sampled signal.
#pragma once

#include <esokit/core/scalar.hpp>
#include <esokit/sim/window.hpp>
#include <optional>

namespace esokit::sim {

/// The sample of largest magnitude; the first of equal ones.
template <PlainScalar ScalarType = double>
struct Peak {
  ScalarType time{};       ///< s
  ScalarType value{};      ///< with its sign
  ScalarType magnitude{};  ///< abs(value)
};

/// Finds the peak while a loop runs: call add(t, y) at every sample.
template <PlainScalar ScalarType = double>
class PeakMeter {
 public:
  /// Over all time.
  constexpr PeakMeter() = default;
  /// Over a window.
  explicit constexpr PeakMeter(const Window<ScalarType>& window) : window_(window) {}

  /// Adds a sample. False if it is not finite; there is no peak from then on.
  constexpr bool add(ScalarType t, ScalarType y) noexcept {
    if (!is_finite(t) || !is_finite(y)) {
      spoilt_ = true;
      return false;
    }
    if (!window_.contains(t)) return true;
    const ScalarType magnitude = y < ScalarType{} ? -y : y;
    if (!peak_ || magnitude > peak_->magnitude) peak_ = {t, y, magnitude};
    return true;
  }

  /// The peak so far; nothing without a sample in the window or after one that was not finite.
  constexpr std::optional<Peak<ScalarType>> value() const noexcept {
    return spoilt_ ? std::nullopt : peak_;
  }

  /// Forgets all samples, keeps the window.
  constexpr void reset() noexcept { *this = PeakMeter(window_); }

 private:
  Window<ScalarType> window_{};
  std::optional<Peak<ScalarType>> peak_{};
  bool spoilt_ = false;
};

}  // namespace esokit::sim
