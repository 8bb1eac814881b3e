/// @file
/// An output that is on or off, for u between the two: a heater on a relay.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/snapshot.hpp>

namespace esokit {

/// Config of TimeProportioned.
template <class S = double>
requires(detail::is_a_plain_scalar<S>()) struct TimeProportionedConfig {
  [[no_unique_address]] ByName<TimeProportionedConfig> by_name{};  ///< nothing to set, see ByName
  S off{};                                                         ///< u while it is off
  S on{};           ///< u while it is on; below `off` for what cools
  S window{};       ///< s; 1 to 65536 samples, a whole number of them
  S least_on{};     ///< s; taken as whole samples, rounded up
  S least_off{};    ///< s; the same; with least_on at most a window
  S sample_time{};  ///< of a call, s: switches at such times only
};

/// Time-proportioned output: on for a share of each window, so that its mean is u. The controller's
/// sample time is the window:
///
///     if (relay.begins()) u = controller.update(y, r);  // once a window
///     digital_write(pin, relay.update(u));               // once a sample of the relay
///     controller.applied(relay.applied());               // what really went out
///
/// On comes first in a window. Times that a window cannot have (parts of a sample, less than the
/// least on or off time) are rounded to the nearest that it can. The remainder is carried to the
/// next one: the mean over many windows is that of u. What is carried never exceeds half a
/// sample, or half of a least time. `applied` is the mean of this window, known from its start.
///
/// A controller that is faster than the window sees the windows in y and fights them. A window is
/// short enough if full power moves y by little in a quarter of it.
template <class S = double>
requires(detail::is_a_plain_scalar<S>()) class TimeProportioned {
 public:
  using scalar_type = S;                     ///< type of u and settings
  using Config = TimeProportionedConfig<S>;  ///< settings of make

  /// Checks the settings. @return off, as if for long, at the start of a window; or an error that
  /// names the field
  [[nodiscard]] static Expected<TimeProportioned, Error<S>> make(const Config& config) {
    Rules<S> rules;
    rules.finite("off", config.off)
        .finite("on", config.on)
        .demand(is_finite(S(config.on - config.off)), "on", config.on, "minus off must be finite")
        .demand(config.on - config.off < S(0) || config.on - config.off > S(0), "on", config.on,
                "must differ from off")
        .positive("sample_time", config.sample_time)
        .positive("window", config.window)
        .not_negative("least_on", config.least_on)
        .not_negative("least_off", config.least_off);
    if (!rules) return rules.error();
    const S samples = config.window / config.sample_time;
    constexpr S most = S(65536);
    rules.demand(S(1) - part < samples && samples < most + part, "window", config.window,
                 "must be 1 to 65536 samples");
    if (!rules) return rules.error();
    const S whole = static_cast<S>(static_cast<std::int32_t>(samples + S(1) / S(2)));
    rules.demand(samples < whole + part && whole - part < samples, "window", config.window,
                 "must be a whole number of samples");
    const S both = rounded_up(config.least_on / config.sample_time) +
                   rounded_up(config.least_off / config.sample_time);
    rules.demand(both <= whole, "least_on", config.least_on,
                 "and least_off, rounded up to samples, must fit into the window");
    if (!rules) return rules.error();
    return TimeProportioned(config);
  }

  /// Whether the next sample begins a window: u counts then.
  [[nodiscard]] bool begins() const noexcept { return sample_ == 0; }

  /// One sample. @param u beyond `off` and `on` it is the nearer of them; one that is not finite
  /// counts as `off`, and what is carried is forgotten @return whether it is on
  bool update(const S& u) noexcept {
    if (begins()) plan(u);
    const bool is_on = sample_ < on_samples_;
    sample_ = sample_ + 1 < window_ ? sample_ + 1 : 0;
    return is_on;
  }

  /// The mean of the window that `update` began last, between `off` and `on`.
  [[nodiscard]] S applied() const noexcept {
    if (on_samples_ == window_) return on_;
    return off_ + (on_ - off_) * (static_cast<S>(on_samples_) / static_cast<S>(window_));
  }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr int data_members = 9;

  /// Of a sample: what rounding may be off by.
  static constexpr S part = S(1) / S(100);

  static constexpr S at_least_one(S samples) noexcept { return samples < S(1) ? S(1) : samples; }

  /// Up to a window; longer times stay what they are.
  static S rounded_up(const S& samples) noexcept {
    if (!(samples < S(65537))) return samples;
    const S whole = static_cast<S>(static_cast<std::int32_t>(samples));
    return samples - whole < part ? whole : whole + S(1);
  }

  explicit TimeProportioned(const Config& config) noexcept
      : off_(config.off),
        on_(config.on),
        sample_time_(config.sample_time),
        window_(static_cast<std::int32_t>(config.window / config.sample_time + S(1) / S(2))),
        shortest_(static_cast<std::int32_t>(
            at_least_one(rounded_up(config.least_on / config.sample_time)))),
        longest_(window_ - static_cast<std::int32_t>(
                               at_least_one(rounded_up(config.least_off / config.sample_time)))) {}

  void plan(const S& u) noexcept {
    if (!is_finite(u)) {
      on_samples_ = 0;
      carried_ = S(0);
      return;
    }
    const bool falls = on_ < off_;
    const S low = falls ? on_ : off_, high = falls ? off_ : on_;
    const S within = u < low ? low : high < u ? high : u;
    const S wanted = static_cast<S>(window_) * ((within - off_) / (on_ - off_)) + carried_;
    on_samples_ = nearest(wanted);
    carried_ = wanted - static_cast<S>(on_samples_);
  }

  /// The time on that a window may have, samples.
  [[nodiscard]] std::int32_t nearest(const S& wanted) const noexcept {
    // What is on since the last window has been on for long enough.
    const std::int32_t least = on_samples_ == window_ ? 1 : shortest_;
    constexpr S half = S(1) / S(2);
    if (!(wanted > half)) return 0;
    if (!(wanted < static_cast<S>(window_))) return window_;
    const auto rounded = static_cast<std::int32_t>(std::ceil(wanted - half));
    if (rounded < least) return S(2) * wanted < static_cast<S>(least) ? 0 : least;
    if (rounded > longest_)
      return S(2) * wanted < static_cast<S>(longest_ + window_) ? longest_ : window_;
    return rounded;
  }

  S off_;
  S on_;
  S sample_time_;
  S carried_{};  ///< that the windows so far owe, samples
  std::int32_t window_;
  std::int32_t shortest_;  ///< time on, if it is not zero
  std::int32_t longest_;   ///< time on, if it is not the whole window
  std::int32_t sample_ = 0;
  std::int32_t on_samples_ = 0;
};

/// Distinguishes the type in snapshots.
template <PlainScalar S>
inline constexpr std::uint32_t type_tag<TimeProportioned<S>> = make_type_tag<S>("TimeProportioned");

}  // namespace esokit
