/// @file
/// The running integral of a sampled quantity.
#pragma once

#include <esokit/core/scalar.hpp>
#include <esokit/math/detail/fine_sum.hpp>
#include <esokit/sim/window.hpp>

namespace esokit::sim {

/// Trapezoid rule while a loop runs: call add(t, f(t)) at every sample with the integrand f
/// (abs(e), e^2, t abs(e), ..). If an edge of the window falls between two samples, the integrand
/// there is interpolated.
template <PlainScalar ScalarType = double>
class Trapezoid {
 public:
  /// Over all time.
  constexpr Trapezoid() = default;
  /// Over a window.
  explicit constexpr Trapezoid(const Window<ScalarType>& window) : window_(window) {}

  /// Adds a sample. False, and the sample is left out, if the time is not finite or before that of
  /// the last sample. A repeated time marks a jump. An integrand that is not finite is added and
  /// makes the value not finite.
  constexpr bool add(ScalarType t, ScalarType f) noexcept {
    if (!is_finite(t) || (started_ && t < time_)) return false;
    if (started_ && t > time_) add_segment(t, f);
    started_ = true;
    time_ = t;
    integrand_ = f;
    return true;
  }

  /// The integral so far; zero before two samples.
  constexpr ScalarType value() const noexcept { return value_.value(); }

  /// The time that it covers, s.
  constexpr ScalarType duration() const noexcept { return duration_.value(); }

  /// Forgets all samples, keeps the window.
  constexpr void reset() noexcept { *this = Trapezoid(window_); }

 private:
  constexpr void add_segment(ScalarType t, ScalarType f) noexcept {
    const ScalarType from = time_ < window_.start() ? window_.start() : time_;
    const ScalarType to = t > window_.end() ? window_.end() : t;
    if (!(from < to)) return;
    const ScalarType slope = (f - integrand_) / (t - time_);
    // Whole segments use the samples themselves, because interpolation would round them.
    const ScalarType f_from = from == time_ ? integrand_ : integrand_ + slope * (from - time_);
    const ScalarType f_to = to == t ? f : integrand_ + slope * (to - time_);
    value_.add((f_from + f_to) / ScalarType{2} * (to - from));
    duration_.add(to - from);
  }

  Window<ScalarType> window_{};
  ScalarType time_{};
  ScalarType integrand_{};
  esokit::detail::FineSum<ScalarType> value_{};
  esokit::detail::FineSum<ScalarType> duration_{};
  bool started_ = false;
};

}  // namespace esokit::sim
