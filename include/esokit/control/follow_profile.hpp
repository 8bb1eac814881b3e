/// @file
/// A reference that follows a moving target within limits of speed and acceleration.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/control/reference.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/math/detail/fine_sum.hpp>
#include <limits>

namespace esokit {

/// Config of FollowProfile.
template <int Order, class S = double>
requires(detail::is_a_plain_scalar<S>()) struct FollowProfileConfig {
  [[no_unique_address]] ByName<FollowProfileConfig> by_name{};  ///< nothing to set, see ByName
  Array<S, Order> limits{};  ///< largest abs(r'), and abs(r'') for Order 2, unit of the reference /
                             ///< s^i; 0: none. The last one is needed
  S filter_time{};           ///< h >= T, s: smooths a noisy target; 0: T
  S sample_time{};           ///< T, s
};

/// Follows a target that may change at each sample, from any state, in the least time within the
/// limits. Call `update(target)` once a sample; then `motion()` is (r, r', .., r^(n)) for a law of
/// order n.
///
///     profile.update({position, speed});        // of what it follows; a number: it stands still
///     u = controller.update(y, profile.motion());
///
/// r^(n) is what r does until the next sample: held like u, and r is computed from it exactly. So
/// it arrives after a whole number of samples, without chatter, and then goes with the target. If
/// the target moves, give its speed: without it r stays r'^2 / (2 A) behind (Order 2). Speed and
/// acceleration of a measured target are those of an observer, `LinearEso<2>`.
///
/// No limit is exceeded. After `start` with too high a speed, or a retune, r is back below it as
/// fast as the acceleration allows. A target that is too fast is followed at the limit.
///
/// Order 2 is the filter of R. Zanasi, C. Guarino Lo Bianco, A. Tonielli, Nonlinear filters for the
/// generation of smooth trajectories, Automatica 36 (2000). With the distance z = e - T e' / 2 and
/// the speed e' from the target, and d = A h^2:
///
///     y = (z + h e') / d,  m = floor((1 + sqrt(1 + 8 |y|)) / 2)
///     r'' = -A sat(h e' / d + y / m + sign(y) (m - 1) / 2)
///
/// For Order 1, r goes to the target within a sample, or at the limit. A jerk limit (Order 3) is a
/// matter for Ruckig, see the page of control practice. `to_c` writes both orders,
/// target/profile_code.hpp.
///
/// While the axis cannot move, call `wait()` in place of `update`: r brakes and stands still. If
/// others move it, `start(y)`.
template <int Order, class S = double>
requires(detail::is_a_plain_scalar<S>()) class FollowProfile {
  static_assert(Order == 1 || Order == 2, "esokit: a FollowProfile is of order 1 or 2");

 public:
  static constexpr int order = Order;            ///< n
  static constexpr bool runs_on = true;          ///< a refused target does not stop it
  using scalar_type = S;                         ///< type of signals and settings
  using Config = FollowProfileConfig<Order, S>;  ///< settings of make
  using Motion = Vector<S, Order + 1>;           ///< (r, r', .., r^(n))
  using Target = Reference<Order, S>;            ///< a number, `{p, p'}` or `{p, p', p''}`

  /// Checks the settings. @return the profile at rest at zero, or an error that names the field
  [[nodiscard]] static Expected<FollowProfile, Error<S>> make(const Config& config) {
    Rules<S> rules;
    if constexpr (Order == 2) rules.not_negative("limits", config.limits[0], 0);
    rules.positive("limits", config.limits[Order - 1], Order - 1)
        .positive("sample_time", config.sample_time)
        .not_negative("filter_time", config.filter_time)
        .demand(!(config.filter_time > S(0) && config.filter_time < config.sample_time),
                {"filter_time", config.filter_time, "must be 0 or not below sample_time, which is",
                 -1, config.sample_time, true});
    if (!rules) return rules.error();
    const FollowProfile profile(config);
    const S h = profile.width();
    const S way = config.limits[Order - 1] * h * (Order == 1 ? S(1) : h);  // of a sample
    for (const S& part : {S(S(1) / S(64)), Order == 1 ? S(1) : S(64)}) {
      rules.representable("limits", config.limits[Order - 1], S(part * way),
                          "times sample_time^n leaves the scalar's range", Order - 1);
    }
    if (!rules) return rules.error();
    return profile;
  }

  /// One sample. @param target where to be now, and its speed and acceleration
  /// @return false if it is not finite or too large: then the last one goes on at its speed
  bool update(const Target& target) noexcept {
    const bool good = aim(target);
    if (!good) aim_on();
    if constexpr (Order == 1) {
      go(within(S(speed_ - r_.minus(target_) / width()), config_.limits[0]));
    } else {
      go(acceleration());
    }
    return good;
  }

  /// One sample in which the axis cannot go on: r comes to rest within the limits.
  void wait() noexcept {
    if constexpr (Order == 1) {
      go(S(0));
    } else {
      go(within(S(-v_.value() / config_.sample_time), config_.limits[1]));
    }
  }

  /// (r, r', .., r^(n)) now, n + 1 x 1.
  [[nodiscard]] const Motion& motion() const noexcept { return motion_; }

  /// At y with this speed at the next update: before the first one, and where an operator hands
  /// over.
  /// @return false, and nothing changes, if one is not finite, or so large that what follows is not
  bool start(const S& y, const S& speed = S(0)) noexcept {
    if (!fits(y, speed)) return false;
    r_ = Sum(y);
    v_ = Sum(Order == 1 ? S(0) : speed);
    target_ = Sum(y);
    speed_ = thrust_ = S(0);
    motion_ = Motion::Zero();
    motion_(0) = y;
    if constexpr (Order == 2) motion_(1) = speed;
    return true;
  }

  /// Other settings, from the next update on. A refused config changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`.
  Check<S> adopt(const FollowProfile& fresh) noexcept {
    if (!fresh.fits(r_.value(), v_.value()) || !fresh.fits(target_.value(), speed_)) {
      return Error<S>{"sample_time", fresh.config_.sample_time,
                      "and limits do not suit the present motion"};
    }
    config_ = fresh.config_;
    return {};
  }

 private:
  friend struct detail::RecordAccess;
  using Sum = detail::FineSum<S>;

  explicit FollowProfile(const Config& config) noexcept : config_(config) {}

  static S within(const S& x, const S& limit) noexcept {
    return x > limit ? limit : x < -limit ? S(-limit) : x;
  }

  /// h.
  [[nodiscard]] S width() const noexcept {
    return config_.filter_time > S(0) ? config_.filter_time : config_.sample_time;
  }

  /// A speed within its limit, if there is one.
  [[nodiscard]] S allowed(const S& speed) const noexcept {
    return config_.limits[0] > S(0) ? within(speed, config_.limits[0]) : speed;
  }

  /// Whether all that follows from a place and a speed is finite.
  [[nodiscard]] bool fits(const S& place, const S& speed) const noexcept {
    S way = detail::absolute(place) + detail::absolute(speed) * width();
    if constexpr (Order == 2) way = way + speed / config_.limits[1] * speed;
    return is_finite(S(S(64) * way));
  }

  /// Takes a target, its motion within the limits; false, and nothing changes, if it cannot.
  bool aim(const Target& target) noexcept {
    const S speed = allowed(target(1));
    if (!is_finite(target(1)) || !is_finite(target(Order)) || !fits(target(0), speed)) return false;
    target_ = Sum(target(0));
    speed_ = speed;
    if constexpr (Order == 2) thrust_ = within(target(2), config_.limits[1]);
    return true;
  }

  /// The last target, a sample later, as long as it is not too far.
  void aim_on() noexcept {
    Sum next = target_;
    next.add(config_.sample_time * speed_);
    if (fits(next.value(), speed_)) target_ = next;
    thrust_ = S(0);
  }

  /// To the next sample, with r^(n) held.
  void go(const S& highest) noexcept {
    const S T = config_.sample_time;
    motion_(0) = r_.value();
    if constexpr (Order == 2) motion_(1) = v_.value();
    motion_(Order) = highest;
    if constexpr (Order == 1) {
      r_.add(T * highest);
    } else {
      r_.add(T * (v_.value() + T / S(2) * highest));
      v_.add(T * highest);
      // What rounding adds to a limit.
      const S beyond = detail::absolute(v_.value()) - config_.limits[0];
      if (beyond > S(0) && beyond < S(8) * detail::rounding<S>() * config_.limits[0]) {
        v_ = Sum(allowed(v_.value()));
      }
    }
  }

  /// r'' for the next sample.
  [[nodiscard]] S acceleration() const noexcept {
    const S T = config_.sample_time;
    const S h = width();
    const S most = config_.limits[1];
    const S v = v_.value();
    const S faster = v - speed_;
    const S place = r_.minus(target_) - T / S(2) * faster + h * faster;
    // What a target that accelerates leaves to brake with.
    S share = S(1) - (place > S(0) ? thrust_ : S(-thrust_)) / most;
    if (!(share > S(1) / S(16))) share = S(1) / S(16);
    const S unit = share * (most * h * h);
    constexpr S longest = (std::numeric_limits<S>::max)() / S(16);
    S y = detail::absolute(place) / unit;
    if (!(y < longest)) y = longest;
    const S samples = std::floor((S(1) + std::sqrt(S(1) + S(8) * y)) / S(2));
    const S curve = y / samples + (samples - S(1)) / S(2);
    S a = within(S(thrust_ - most * (share * (h * faster / unit + std::copysign(curve, place)))),
                 most);
    if (const S limit = config_.limits[0]; limit > S(0)) {
      const S up = within(S((limit - v) / T), most);
      const S down = within(S((-limit - v) / T), most);
      a = a > up ? up : a < down ? down : a;
    }
    return a;
  }

  Config config_;
  Sum r_{};  ///< at the next update
  Sum v_{};  ///< r' then
  Sum target_{};
  S speed_{};   ///< of the target, within the limit
  S thrust_{};  ///< its acceleration, within the limit
  Motion motion_ = Motion::Zero();
};

/// Distinguishes the type in snapshots.
template <int Order, PlainScalar S>
inline constexpr std::uint32_t type_tag<FollowProfile<Order, S>> = make_type_tag<S>("FollowProfile",
                                                                                    Order);

}  // namespace esokit
