/// @file
/// Magnitude and rate limits of an actuator.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <limits>

namespace esokit {

/// Limits of an actuator. A limit that is left out has no effect.
template <Scalar S = double>
struct Limits {
  S lower = S(std::numeric_limits<LaneScalar<S>>::lowest());  ///< least u, unit of u
  S upper = S((std::numeric_limits<LaneScalar<S>>::max)());   ///< largest u, above lower
  S rate =
      S((std::numeric_limits<LaneScalar<S>>::max)());  ///< largest abs(du/dt), unit of u per s, > 0
};

/// Limits a command in magnitude (also asymmetrically) and rate.
///
/// The bounds of the next step are computed in advance from the last output, so that only a minimum
/// and a maximum are left between command and output.
template <Scalar S = double>
class Limiter {
 public:
  using scalar_type = S;  ///< type of u
  template <class T>
  using with_scalar = Limiter<T>;  ///< the same with another scalar

  /// Checks the limits.
  /// @param limits limits of the actuator @param sample_time T, s
  /// @return error for limits that are crossed or not finite, or a rate or sample time that is not
  ///         positive
  static Expected<Limiter, Error<S>> make(const Limits<S>& limits, const S& sample_time) {
    detail::refuse_packs<S>();
    Rules<S> rules;
    rules.positive("sample_time", sample_time)
        .finite("limits.lower", limits.lower)
        .finite("limits.upper", limits.upper)
        .demand(
            all(limits.lower < limits.upper),
            {"limits.lower", limits.lower, "must be below limits.upper", -1, limits.upper, true})
        .positive("limits.rate", limits.rate);
    if (!rules) return rules.error();
    return Limiter(limits, sample_time);
  }

  /// The output nearest to `command` within the limits; stored as the last output.
  /// @param command finite, as is everything computed from an observer's estimate
  constexpr S operator()(const S& command) noexcept {
    const S output = clamp(command);
    track(output);
    return output;
  }

  /// The output that `command` would give; nothing is stored.
  [[nodiscard]] constexpr S clamp(const S& command) const noexcept {
    return smaller(larger(command, low_), high_);
  }

  /// `u` within the magnitude limits, without the rate limit.
  [[nodiscard]] constexpr S within(const S& u) const noexcept {
    return smaller(larger(u, lower_), upper_);
  }

  /// Reports what the actuator really held; the rate limit counts from there.
  constexpr void track(const S& output) noexcept {
    last_ = output;
    // Without a rate limit the bounds do not change.
    if (rate_limited_ == false) return;
    low_ = larger(lower_, S(output - step_));
    high_ = smaller(upper_, S(output + step_));
    // A reported output may be beyond a magnitude limit by more than a step.
    low_ = smaller(low_, upper_);
    high_ = larger(high_, lower_);
  }

  /// The last output.
  [[nodiscard]] constexpr const S& last() const noexcept { return last_; }
  /// Magnitude limits.
  /// @{
  [[nodiscard]] constexpr const S& lower() const noexcept { return lower_; }
  [[nodiscard]] constexpr const S& upper() const noexcept { return upper_; }
  /// @}

 private:
  friend struct detail::LaneAccess;

  static constexpr int data_members = 7;

  Limiter(const Limits<S>& limits, const S& sample_time) noexcept
      : lower_(limits.lower),
        upper_(limits.upper),
        step_(limits.rate * sample_time),
        low_(limits.lower),
        high_(limits.upper),
        rate_limited_(!all(limits.rate >= Limits<S>{}.rate) && all(is_finite(step_))) {
    // In a pack a lane without a rate limit gets an infinite step.
    if (rate_limited_ == false) step_ = S(detail::unbounded<LaneScalar<S>>());
    track(within(S(0.0)));
  }

  static constexpr S smaller(const S& a, const S& b) noexcept { return detail::lower_one(a, b); }
  static constexpr S larger(const S& a, const S& b) noexcept { return detail::upper_one(a, b); }

  S lower_;
  S upper_;
  S step_;
  S last_{};
  S low_;
  S high_;
  Lanes<bool, S> rate_limited_;
};

}  // namespace esokit
