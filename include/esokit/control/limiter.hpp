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
///
/// A step of rate x T that the digits of u cannot hold waits until it has become large enough. So
/// the rate holds at any magnitude; it may be exceeded by one digit of u. Where a step is above
/// 1024 digits of the larger magnitude limit nothing can be lost, and nothing is added to the work.
///
/// What was commanded and what the actuator held are two numbers: the rate limit counts from the
/// first, an observer is driven by the second. An actuator that reports an offset, noise or a lag
/// would otherwise move its own limit.
template <Scalar S = double>
class Limiter {
 public:
  using scalar_type = S;  ///< type of u
  template <class T>
  using with_scalar = Limiter<T>;  ///< the same with another scalar

  /// Checks the limits.
  /// @param limits limits of the actuator @param sample_time T, s
  /// @return error for limits that are crossed or not finite, a rate or sample time that is not
  ///         positive, or a rate that the scalar cannot hold beside the limits
  static Expected<Limiter, Error<S>> make(const Limits<S>& limits, const S& sample_time) {
    static_assert(detail::refuses_packs<S>());
    Rules<S> rules;
    rules.positive("sample_time", sample_time)
        .finite("limits.lower", limits.lower)
        .finite("limits.upper", limits.upper)
        .demand(
            all(limits.lower < limits.upper),
            {"limits.lower", limits.lower, "must be below limits.upper", -1, limits.upper, true})
        .positive("limits.rate", limits.rate);
    if (!rules) return rules.error();
    Limiter limiter(limits, sample_time);
    if (!(limiter.rate_limited_ == false)) {
      rules.representable("limits.rate", limits.rate, limiter.step_,
                          "times sample_time leaves the scalar's range");
      // What waits would be lost itself.
      const S least = detail::rounding<S>() * limiter.grain();
      const bool bounded =
          all(limits.lower > Limits<S>{}.lower && limits.upper < Limits<S>{}.upper);
      rules.demand(
          !bounded || all(limiter.step_ > least),
          {"limits.rate", limits.rate,
           "is lost beside the limits; in a sample u must move by more than", -1, least, true});
    }
    if (!rules) return rules.error();
    return limiter;
  }

  /// The output nearest to `command` within the limits; stored as the last output.
  /// @param command finite
  constexpr S operator()(const S& command) noexcept { return settle(clamp(command)); }

  /// Ends a step. @param output what `clamp` gave for it @return the same
  constexpr S settle(S output) noexcept {
    if (rate_limited_ == false) {
      held_ = output;
      return output;
    }
    if (!(waits_ == false)) [[unlikely]]
      return settle_digits(output);
    reach(output, step_);
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

  /// Takes over a u that was commanded elsewhere (by an operator): the rate limit counts from
  /// there.
  constexpr void track(const S& output) noexcept {
    held_ = output;
    // Without a rate limit the bounds do not change.
    if (rate_limited_ == false) return;
    // What waits belongs to the last output.
    waiting_ = select(output < commanded_, S(0.0), select(commanded_ < output, S(0.0), waiting_));
    reach(output, larger(S(step_ + waiting_), S(0.0)));
  }

  /// What the actuator held, as it reports. The limits of the next output do not depend on it.
  constexpr void applied(const S& u) noexcept { held_ = u; }
  /// The same for a caller that does not store what it asks for. @param again true if it was said
  /// since the last output
  constexpr void applied(const S& u, bool again) noexcept {
    if (!again && rate_limited_ == false) commanded_ = held_;
    held_ = u;
  }

  /// What the actuator holds: the last output, or what was reported since.
  [[nodiscard]] constexpr const S& last() const noexcept { return held_; }

  /// The last output, within the magnitude limits, whatever was reported since. @param requested
  /// what was asked for then: without a rate limit nothing else is stored
  [[nodiscard]] ESOKIT_COLD constexpr S commanded(const S& requested) const noexcept {
    if constexpr (lane_count<S> == 1) {
      return within(rate_limited_ ? commanded_ : requested);
    } else {
      S u = commanded_;
      for (int i = 0; i < lane_count<S>; ++i) {
        if (!rate_limited_[i]) u[i] = requested[i];
      }
      return within(u);
    }
  }

  /// The same for a caller that says in `applied` what was said before.
  /// @param reported `applied` was said since the last output
  [[nodiscard]] constexpr const S& commanded(bool reported) const noexcept {
    return reported ? commanded_ : held_;
  }

  /// Takes over the limits of `fresh`; what is held is kept. @param command the last output, as
  /// `commanded` gives it
  constexpr void adopt(const Limiter& fresh, S command) noexcept {
    const S held = held_, waiting = waiting_;
    *this = fresh;
    held_ = command;
    if (!(rate_limited_ == false)) {
      waiting_ = select(is_coarse(), S(0.0), waiting);
      reach(command, larger(S(step_ + waiting_), S(0.0)));
    }
    applied(held, false);
  }

  /// Magnitude limits.
  /// @{
  [[nodiscard]] constexpr const S& lower() const noexcept { return lower_; }
  [[nodiscard]] constexpr const S& upper() const noexcept { return upper_; }
  /// @}
  /// Largest change of u in a sample, unit of u; infinite without a limit of rate.
  [[nodiscard]] constexpr const S& step() const noexcept { return step_; }
  /// Whether a step may be too small for the digits of u, and then waits.
  [[nodiscard]] constexpr Lanes<bool, S> waits() const noexcept { return waits_; }
  /// What waits at present, unit of u.
  [[nodiscard]] constexpr const S& waiting() const noexcept { return waiting_; }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;

  static constexpr int data_members = 10;

  Limiter(const Limits<S>& limits, const S& sample_time) noexcept
      : lower_(limits.lower),
        upper_(limits.upper),
        step_(limits.rate * sample_time),
        low_(limits.lower),
        high_(limits.upper),
        rate_limited_(!all(limits.rate >= Limits<S>{}.rate) && all(is_finite(step_))) {
    // In a pack a lane without a rate limit gets an infinite step.
    if (rate_limited_ == false) step_ = S(detail::unbounded<LaneScalar<S>>());
    waits_ = !all(is_coarse());
    track(within(S(0.0)));
  }

  /// A digit of the largest u.
  [[nodiscard]] constexpr S grain() const noexcept {
    return detail::rounding<S>() * larger(detail::absolute(lower_), detail::absolute(upper_));
  }

  /// Whether the digits of any u hold a step.
  [[nodiscard]] constexpr auto is_coarse() const noexcept { return S(1024.0) * grain() < step_; }

  /// `settle`, with what the step left over or took in advance: at most a digit of the output.
  ESOKIT_COLD constexpr S settle_digits(S output) noexcept {
    const S digit = detail::rounding<S>() * detail::absolute(output);
    const S left = waiting_ + (step_ - detail::absolute(S(output - commanded_)));
    // Further away than a step: something else commanded it. And a lane may need no waiting.
    waiting_ = smaller(select(left < -digit, S(0.0), left), digit);
    waiting_ = select(is_coarse(), S(0.0), waiting_);
    reach(output, larger(S(step_ + waiting_), S(0.0)));
    return output;
  }

  constexpr void reach(const S& from, const S& step) noexcept {
    held_ = from;
    commanded_ = from;
    low_ = larger(lower_, S(from - step));
    high_ = smaller(upper_, S(from + step));
    // An operator's u may be beyond a magnitude limit by more than a step.
    low_ = smaller(low_, upper_);
    high_ = larger(high_, lower_);
  }

  static constexpr S smaller(const S& a, const S& b) noexcept { return detail::lower_one(a, b); }
  static constexpr S larger(const S& a, const S& b) noexcept { return detail::upper_one(a, b); }

  S waiting_{};  ///< part of the steps so far that the digits of the output could not hold
  // Only with a limit of rate; what every output needs is at the end.
  S lower_;
  S upper_;
  S step_;
  S commanded_{};  ///< kept with a rate limit, or where held_ is another and nobody keeps it
  S held_{};
  S low_;
  S high_;
  Lanes<bool, S> rate_limited_;
  Lanes<bool, S> waits_{};  ///< whether the digits of some u do not hold a step
};

}  // namespace esokit
