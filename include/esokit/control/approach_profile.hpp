/// @file
/// A reference for a machine of order 1: towards any target as fast as the limits of u leave.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/control/limiter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/math/detail/fine_sum.hpp>

namespace esokit {

/// Config of ApproachProfile.
template <int Order, class S = double>
requires(detail::is_a_plain_scalar<S>()) struct ApproachProfileConfig {
  [[no_unique_address]] ByName<ApproachProfileConfig> by_name{};  ///< nothing to set, see ByName
  S pole{};            ///< a, 1/s: the machine settles by itself with it; 0: it only integrates
  S lag{};             ///< tau of the actuator, s, for Order 2; else 0
  S input_gain{};      ///< b0, unit of y' per unit of u
  Limits<S> limits{};  ///< of u; a limit of rate does not count here
  S dead_time{};       ///< L, s; taken as whole samples, at most Capacity
  S bandwidth{};       ///< of the end of an approach, rad/s: about 0.7 / latency
  S sample_time{};     ///< T, s
};

/// Moves the reference of a machine of order 1,
///
///     y' = -a y + b0 v(t - L) + d,   tau v' + v = u,
///
/// from any state to any target, which may change at each sample: `update(target)` once a sample,
/// then `motion()` is what the law gets, (r, r') or with the actuator's lag (r, r', r''). `feed()`
/// is the u that the machine needs for it beside the law:
///
///     controller.applied(u - fed);                     // u as it was held, without the part added
///     u = controller.update(y, profile.motion()) + profile.feed();  // then within the limits
///
/// The reference goes at nine tenths of the speed that the limits leave at its place, and ends with
/// `bandwidth`. A heater slows down where it needs most of its power to stay warm, as it has to.
/// The feed goes ahead of the motion by the dead time, so that the law and its observer see r when
/// y can be there. It follows the reference and not y: it changes no margin. Errors of a, b0 and L
/// are left to the observer, as part of d.
///
/// `feed()` counts from the start, where it is zero. What u holds there is known from `start`; a
/// load that comes later is not. Where nothing is
/// left, the reference still goes at a tenth of the speed of half the range, so that it never
/// waits for a load to go away.
/// @tparam Order number of derivatives, that is of gains of the law: 1, or 2 with the lag
/// @tparam Capacity samples of the longest dead time, 0 .. 1000
template <int Order, int Capacity = 0, class S = double>
requires(detail::is_a_plain_scalar<S>()) class ApproachProfile {
  static_assert(Order == 1 || Order == 2, "esokit: an approach has one derivative, or two");
  static_assert(0 <= Capacity && Capacity <= 1000, "esokit: the dead time has 0 to 1000 samples");

 public:
  static constexpr int order = Order;              ///< derivatives of motion
  static constexpr int capacity = Capacity;        ///< of the dead time, samples
  static constexpr bool runs_on = true;            ///< a refused target does not stop it
  using scalar_type = S;                           ///< type of signals and settings
  using Config = ApproachProfileConfig<Order, S>;  ///< settings of make
  using Motion = Vector<S, Order + 1>;             ///< (r, r') or (r, r', r'')

  /// Checks the settings. @return at rest at zero under u = 0, or an error that names the field
  [[nodiscard]] static Expected<ApproachProfile, Error<S>> make(const Config& config) {
    Rules<S> rules;
    rules.not_negative("pole", config.pole)
        .demand(Order == 2 || !(config.lag > S(0)), "lag", config.lag, "needs Order 2");
    if constexpr (Order == 2) rules.positive("lag", config.lag);
    rules.nonzero("input_gain", config.input_gain)
        .demand(is_finite(S(config.limits.upper - config.limits.lower)), "limits.upper",
                config.limits.upper, "must be finite, and limits.lower, too")
        .demand(config.limits.lower < config.limits.upper, "limits.upper", config.limits.upper,
                "must be above limits.lower")
        .positive("bandwidth", config.bandwidth)
        .positive("sample_time", config.sample_time)
        .not_negative("dead_time", config.dead_time);
    if (!rules) return rules.error();
    rules.demand(detail::at_most(config.dead_time, S(S(Capacity) * config.sample_time)),
                 {"dead_time", config.dead_time, "must be at most Capacity samples, s:", -1,
                  S(S(Capacity) * config.sample_time), true});
    if (!rules) return rules.error();
    ApproachProfile profile(config);
    rules
        .demand(is_finite(profile.half_speed_) && profile.half_speed_ > S(0), "input_gain",
                config.input_gain, "times the range of u must be finite and positive")
        .demand(is_finite(S(S(8) * profile.half_speed_ * config.lag)), "lag", config.lag,
                "times the speed by the range of u must be finite");
    if (!rules) return rules.error();
    return profile;
  }

  /// One sample. @param target where to go, unit of the reference
  /// @return false if it is not finite, or so large that what follows is not: the last one counts
  bool update(S target) noexcept {
    const bool good = fits(target);
    if (good) target_ = target;
    const S T = config_.sample_time;
    const S place = sum_.value();
    const S change = within(-share_ * sum_.minus(target_), place);
    Motion now;
    now(0) = place - behind_;
    const S speed = change / T;
    if constexpr (Order == 1) {
      now(1) = speed;
    } else {
      now(1) = behind_ / config_.lag;
      now(2) = (speed - now(1)) / config_.lag;
      behind_ = speed * config_.lag + decay_ * (behind_ - speed * config_.lag);
    }
    sum_.add(change);
    const Motion late = delayed(now);
    // u is held for a sample: it needs what the middle of it does.
    S needed = config_.pole * (place - base_ + change / S(2)) + (now(1) - late(1));
    if constexpr (Order == 2) needed = needed + config_.lag * (now(2) - late(2));
    feed_ = needed / config_.input_gain;
    motion_ = late;
    return good;
  }

  /// What the law gets now: the motion of L ago, Order + 1 x 1.
  [[nodiscard]] const Motion& motion() const noexcept { return motion_; }

  /// The u to add to that of the law, in the same sample.
  [[nodiscard]] const S& feed() const noexcept { return feed_; }

  /// At rest at y under u: before the first update, and where an operator hands over.
  /// @return false, and nothing changes, if one is not finite, or so large that what follows is not
  bool start(const S& y, const S& u) noexcept {
    if (!fits(y) || !is_finite(S(config_.input_gain * (S(4) * u)))) return false;
    sum_ = detail::FineSum<S>(y);
    base_ = y;
    target_ = y;
    rest_ = u;
    feed_ = S(0);
    behind_ = S(0);
    motion_ = Motion::Zero();
    motion_(0) = y;
    for (Motion& motion : past_) motion = motion_;
    at_ = 0;
    return true;
  }

 private:
  friend struct detail::RecordAccess;

  explicit ApproachProfile(const Config& config) noexcept
      : config_(config),
        share_(-std::expm1(-config.bandwidth * config.sample_time)),
        decay_(Order == 2 ? std::exp(-config.sample_time / config.lag) : S(0)),
        half_speed_(detail::absolute(config.input_gain) *
                    (config.limits.upper / S(2) - config.limits.lower / S(2))) {
    delay_ = static_cast<std::int32_t>(config.dead_time / config.sample_time + S(1) / S(2));
  }

  /// Whether all that follows from a place is finite.
  [[nodiscard]] bool fits(const S& place) const noexcept {
    const S most = S(8) * place;
    const S speed = most / config_.sample_time;
    return is_finite(S(speed / config_.input_gain)) &&
           is_finite(S(config_.pole * most / config_.input_gain)) &&
           (Order == 1 || is_finite(S(speed / config_.lag)));
  }

  /// A change within what the limits of u leave at this place, in a sample.
  [[nodiscard]] S within(const S& change, const S& place) const noexcept {
    constexpr S most = S(9) / S(10);
    const S least = half_speed_ / S(10);
    const S held = rest_ + config_.pole * (place - base_) / config_.input_gain;
    S up = config_.input_gain * (config_.limits.upper - held) * most;
    S down = config_.input_gain * (config_.limits.lower - held) * most;
    if (config_.input_gain < S(0)) {
      const S other = up;
      up = down;
      down = other;
    }
    if (!(up > least)) up = least;
    if (!(down < -least)) down = -least;
    const S T = config_.sample_time;
    return change > up * T ? S(up * T) : change < down * T ? S(down * T) : change;
  }

  Motion delayed(const Motion& now) noexcept {
    if constexpr (Capacity == 0) {
      return now;
    } else {
      if (delay_ == 0) return now;
      Motion& oldest = past_[static_cast<std::size_t>(at_)];
      const Motion late = oldest;
      oldest = now;
      at_ = at_ + 1 < delay_ ? at_ + 1 : 0;
      return late;
    }
  }

  Config config_;
  S share_;       ///< of the way to the target in a sample, by the bandwidth
  S decay_;       ///< of the lag
  S half_speed_;  ///< that half the range of u makes
  S target_{};
  detail::FineSum<S> sum_{};  ///< where the reference without the lag is
  S behind_{};                ///< by how much r is behind it, by the lag
  S base_{};                  ///< y at the start
  S rest_{};                  ///< u that it needs
  S feed_{};
  Motion motion_ = Motion::Zero();
  Array<Motion, Capacity> past_{};
  std::int32_t delay_ = 0;  ///< of motion behind feed, samples
  std::int32_t at_ = 0;
};

/// Distinguishes the type in snapshots.
template <int Order, int Capacity, PlainScalar S>
inline constexpr std::uint32_t type_tag<ApproachProfile<Order, Capacity, S>> =
    make_type_tag<S>("ApproachProfile", Order, Capacity);

}  // namespace esokit
