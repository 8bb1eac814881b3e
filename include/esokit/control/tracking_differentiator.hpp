/// @file
/// Tracking differentiator: a reference that the plant can follow, and its derivative.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/math/detail/fine_sum.hpp>

namespace esokit {

/// Han's time-optimal control of a double integrator sampled with h, fhan(x1, x2, r, h0). It brings
/// (x1, x2) to zero in the smallest number of steps with a result of at most r in magnitude,
/// without chatter.
/// @param x1 distance @param x2 its derivative @param acceleration r > 0
/// @param width h0 > 0, s: the sample time h, or more to smooth the result
/// @return the acceleration to be applied, unit of x1 / s^2
template <PlainScalar S>
[[nodiscard]] S fhan(S x1, S x2, S acceleration, S width) noexcept {
  const S d = acceleration * width * width;
  const S a0 = width * x2;
  const S y = x1 + a0;
  // Further than d from the switching curve it is a square root, closer it is linear.
  const S root = std::sqrt(d * (d + S(8) * detail::absolute(y)));
  const S a = detail::absolute(y) > d ? a0 + std::copysign((root - d) / S(2), y) : a0 + y;
  return detail::absolute(a) > d ? -std::copysign(acceleration, a) : -acceleration * (a / d);
}

/// Config of TrackingDifferentiator.
template <Scalar S>
struct TrackingDifferentiatorConfig {
  [[no_unique_address]] ByName<TrackingDifferentiatorConfig>
      by_name{};     ///< nothing to set, see ByName
  S acceleration{};  ///< R > 0, unit of the reference / s^2
  S sample_time{};   ///< h, s
  S filter_time{};   ///< h0 >= h, s: smooths a noisy reference; 0: h
};

/// Tracking differentiator with fhan: r1 follows the reference as fast as |r1''| <= `acceleration`
/// allows, and r2 = r1'. Because it can always stop in time, it stays r2^2 / (2R) behind a moving
/// reference: follow that with a FollowProfile. It arrives, and stands still there, however small
/// its steps are beside r.
template <class S = double>
requires(detail::is_a_scalar<S>()) class TrackingDifferentiator {
 public:
  using scalar_type = S;                           ///< type of signals and settings
  using Config = TrackingDifferentiatorConfig<S>;  ///< settings of make

  /// Checks the settings and does all the design work.
  /// @return the differentiator at rest at zero, or an error that names the field
  static Expected<TrackingDifferentiator, Error<S>> make(const Config& config) {
    Rules<S> rules;
    rules.positive("acceleration", config.acceleration)
        .positive("sample_time", config.sample_time)
        .not_negative("filter_time", config.filter_time)
        .demand(!(config.filter_time > S(0) && config.filter_time < config.sample_time),
                {"filter_time", config.filter_time, "must be 0 or not below sample_time, which is",
                 -1, config.sample_time, true});
    if (!rules) return rules.error();
    TrackingDifferentiator result(config);
    rules.representable("acceleration", config.acceleration,
                        S(config.acceleration * result.width_ * result.width_),
                        "times sample_time squared leaves the scalar's range");
    if (!rules) return rules.error();
    return result;
  }

  /// One sample. False, and nothing changes, if the reference is not finite or too large.
  bool update(S reference) noexcept {
    const S change = fhan(r1_.minus(reference), r2_.value(), acceleration_, width_);
    auto r1 = r1_, r2 = r2_;
    r1.add(sample_time_ * r2_.value());
    r2.add(sample_time_ * change);
    // Without this test an infinite reference would be treated as a distant one.
    return is_finite(reference) && move_to(r1, r2, change);
  }

  /// r1, unit of the reference.
  [[nodiscard]] S value() const noexcept { return r1_.value(); }
  /// r2 = r1', unit of the reference / s.
  [[nodiscard]] S derivative() const noexcept { return r2_.value(); }
  /// (r1, r2).
  [[nodiscard]] Vector<S, 2> state() const noexcept { return {value(), derivative()}; }

  /// (r1, r1', r1''), 3 x 1: for a law that also takes the acceleration. r1'' is that of the last
  /// sample; its magnitude is at most `acceleration`.
  [[nodiscard]] Vector<S, 3> motion() const noexcept { return {value(), derivative(), change_}; }

  /// Restarts at rest at `value`; false, and nothing changes, if it is not finite.
  bool reset(S value = S(0)) noexcept { return move_to(Sum(value), Sum(S(0)), S(0)); }

 private:
  using Sum = detail::FineSum<S>;
  explicit TrackingDifferentiator(const Config& config)
      : acceleration_(config.acceleration),
        sample_time_(config.sample_time),
        width_(config.filter_time > S(0) ? config.filter_time : config.sample_time) {}

  /// False, and nothing changes, if one of them is not finite.
  bool move_to(const Sum& r1, const Sum& r2, S change) noexcept {
    if (!is_finite(r1.value()) || !is_finite(r2.value())) return false;
    r1_ = r1;
    r2_ = r2;
    change_ = change;
    return true;
  }

  S acceleration_;
  S sample_time_;
  S width_;
  Sum r1_{};         ///< value
  Sum r2_{};         ///< its derivative
  S change_ = S(0);  ///< r1'' that the last sample applied
};

}  // namespace esokit
