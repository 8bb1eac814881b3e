/// @file
/// Measurement noise: white per sample, and band-limited white noise held over intervals.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/sim/gaussian.hpp>
#include <limits>

namespace esokit::sim {

/// Independent normal numbers, one for each call. For independent channels use different seeds.
template <PlainScalar ScalarType = double>
class WhiteNoise {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType standard_deviation{};                 ///< in the unit of the signal; zero: no noise
    std::uint64_t seed = 0;                          ///< any number
  };

  /// Refuses a standard deviation that is negative or not finite.
  static Expected<WhiteNoise, Error<ScalarType>> make(const Config& config) {
    if (Rules<ScalarType> rules;
        !rules.not_negative("standard_deviation", config.standard_deviation))
      return rules.error();
    return WhiteNoise(config);
  }

  /// The next number, in the unit of the signal.
  ScalarType next() { return standard_deviation_ * static_cast<ScalarType>(gaussian_.next()); }

  /// Restarts the sequence.
  void reset() { gaussian_.reset(); }

  /// The standard deviation, in the unit of the signal.
  ScalarType standard_deviation() const noexcept { return standard_deviation_; }

 private:
  explicit WhiteNoise(const Config& config)
      : gaussian_(config.seed), standard_deviation_(config.standard_deviation) {}

  Gaussian gaussian_;
  ScalarType standard_deviation_;
};

/// The "band-limited white noise" of block-diagram tools: one normal number for each interval of
/// `hold` seconds, with variance power/hold, so that the spectral density at low frequency is
/// `power` for any interval.
///
/// Call `next()` once per interval; HeldNoise does this for a simulation with smaller steps.
template <PlainScalar ScalarType = double>
class BandLimitedWhiteNoise {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType power{};      ///< height of the two-sided power spectral density; zero is no noise
    ScalarType hold{1};      ///< interval, s
    std::uint64_t seed = 0;  ///< any number
  };

  /// Refuses a negative power, a hold that is not positive, and a variance that overflows.
  static Expected<BandLimitedWhiteNoise, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.not_negative("power", config.power).positive("hold", config.hold);
    if (!rules) return rules.error();
    const ScalarType variance = config.power / config.hold;
    if (!is_finite(variance) || (config.power > ScalarType{} && variance <= ScalarType{})) {
      return Error<ScalarType>{.field = "power",
                               .value = config.power,
                               .rule = "power/hold must not leave the range of the scalar"};
    }
    const auto white = WhiteNoise<ScalarType>::make(
        {.standard_deviation = std::sqrt(variance), .seed = config.seed});
    return BandLimitedWhiteNoise(white.value());
  }

  /// The number of the next interval.
  ScalarType next() { return white_.next(); }

  /// Restarts the sequence.
  void reset() { white_.reset(); }

  /// sqrt(power/hold), in the unit of the signal.
  ScalarType standard_deviation() const noexcept { return white_.standard_deviation(); }

 private:
  explicit BandLimitedWhiteNoise(const WhiteNoise<ScalarType>& white) : white_(white) {}

  WhiteNoise<ScalarType> white_;
};

/// Band-limited white noise for a simulation with a fixed step: at(k) is its value at t = k step.
///
/// It uses the index of the step and not the time, because rounding makes floor(k step / hold)
/// wrong at some edges of the intervals.
template <PlainScalar ScalarType = double>
class HeldNoise {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType power{};      ///< height of the two-sided power spectral density; zero is no noise
    ScalarType hold{1};      ///< interval of one value, s; a whole multiple of `step`
    ScalarType step{1};      ///< step of the simulation, s
    std::uint64_t seed = 0;  ///< any number
  };

  /// Returns the errors of BandLimitedWhiteNoise, and refuses a step that is not positive and a
  /// hold that is not a whole multiple of the step.
  static Expected<HeldNoise, Error<ScalarType>> make(const Config& config) {
    const auto noise = BandLimitedWhiteNoise<ScalarType>::make(
        {.power = config.power, .hold = config.hold, .seed = config.seed});
    if (!noise) return noise.error();
    if (Rules<ScalarType> rules; !rules.positive("step", config.step)) return rules.error();
    const ScalarType ratio = config.hold / config.step;
    const ScalarType whole = (std::round)(ratio);
    // Both numbers are rounded decimals: 0.01/0.001 is not 10 in every format.
    const ScalarType epsilon = std::numeric_limits<ScalarType>::epsilon() * ScalarType{16};
    const ScalarType decimal = static_cast<ScalarType>(1e-9);
    const ScalarType tolerance = epsilon > decimal ? epsilon : decimal;
    const ScalarType most = static_cast<ScalarType>(std::int64_t{1} << 31u);
    if (!(whole >= ScalarType{1} && whole <= most &&
          (std::abs)(ratio - whole) <= tolerance * whole)) {
      return Error<ScalarType>{.field = "hold",
                               .value = config.hold,
                               .rule = "must be a whole multiple (1 to 2^31) of the step",
                               .limit = config.step,
                               .has_limit = true};
    }
    return HeldNoise(*noise, static_cast<std::int64_t>(whole));
  }

  /// The value during step k, which starts at t = k step; zero before step 0. It depends on k only.
  /// Going back replays the sequence from its start, so ascending k is fast.
  ScalarType at(std::int64_t k) {
    if (k < 0) return ScalarType{};
    const std::int64_t interval = k / steps_per_hold_;
    if (interval + 1 < drawn_) reset();
    for (; drawn_ <= interval; ++drawn_) value_ = noise_.next();
    return value_;
  }

  /// Restarts the sequence; this does not change at(k).
  void reset() {
    noise_.reset();
    drawn_ = 0;
  }

  /// hold/step.
  std::int64_t steps_per_hold() const noexcept { return steps_per_hold_; }
  /// sqrt(power/hold), in the unit of the signal.
  ScalarType standard_deviation() const noexcept { return noise_.standard_deviation(); }

 private:
  HeldNoise(const BandLimitedWhiteNoise<ScalarType>& noise, std::int64_t steps_per_hold)
      : noise_(noise), steps_per_hold_(steps_per_hold) {}

  BandLimitedWhiteNoise<ScalarType> noise_;
  std::int64_t steps_per_hold_;
  std::int64_t drawn_ = 0;
  ScalarType value_{};
};

}  // namespace esokit::sim
