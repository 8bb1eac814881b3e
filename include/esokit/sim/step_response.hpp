/// @file
/// Overshoot, settling time and rise time of a response to a step.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <limits>
#include <optional>

namespace esokit::sim {

/// Measures a step response while a loop runs: call add(t, y) at every sample. Crossings between
/// samples are interpolated linearly; all times count from `step_time`, and samples before it are
/// ignored.
template <PlainScalar ScalarType = double>
class StepResponse {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType initial_value{};                      ///< value before the step
    ScalarType final_value{1};  ///< value after it, not equal to the initial one
    ScalarType step_time{};     ///< s
    ScalarType band =
        static_cast<ScalarType>(0.02L);  ///< settling band, as a fraction of the step, positive
    ScalarType rise_from =
        static_cast<ScalarType>(0.1L);  ///< start of the rise, as a fraction of the step
    ScalarType rise_to = static_cast<ScalarType>(0.9L);  ///< end of the rise, above `rise_from`
  };

  /// Refuses members that are not finite, a step that is zero or overflows, a band that is not
  /// positive, and a `rise_to` that is not above `rise_from`.
  static constexpr Expected<StepResponse, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.finite("initial_value", config.initial_value)
        .finite("final_value", config.final_value)
        .and_then([&] {
          const ScalarType height = config.final_value - config.initial_value;
          return Rules<ScalarType>{}.demand(
              is_finite(height) && height != ScalarType{},
              {.field = "final_value",
               .value = config.final_value,
               .rule = "must differ, by a finite step, from initial_value",
               .limit = config.initial_value,
               .has_limit = true});
        })
        .finite("step_time", config.step_time)
        .positive("band", config.band)
        .finite("rise_from", config.rise_from)
        .finite("rise_to", config.rise_to)
        .demand(config.rise_to > config.rise_from,
                {.field = "rise_to",
                 .value = config.rise_to,
                 .rule = "must be greater than rise_from, which is",
                 .limit = config.rise_from,
                 .has_limit = true});
    if (!rules) return rules.error();
    return StepResponse(config);
  }

  /// Adds a sample. False if it is not finite or its time is before that of the last one; no result
  /// exists from then on.
  constexpr bool add(ScalarType t, ScalarType y) noexcept {
    if (!is_finite(t) || !is_finite(y) || (started_ && t < time_)) {
      spoilt_ = true;
      return false;
    }
    if (t < config_.step_time) return true;
    const ScalarType progress =
        (y - config_.initial_value) / (config_.final_value - config_.initial_value);
    note_crossing(rise_start_, config_.rise_from, t, progress);
    note_crossing(rise_end_, config_.rise_to, t, progress);
    note_band(t, progress);
    if (!started_ || progress > largest_) largest_ = progress;
    started_ = true;
    time_ = t;
    progress_ = progress;
    return true;
  }

  /// The largest excess over the final value, as a fraction of the step; zero if there is none.
  /// Nothing before the first sample.
  constexpr std::optional<ScalarType> overshoot() const noexcept {
    if (!valid()) return std::nullopt;
    return largest_ > ScalarType{1} ? largest_ - ScalarType{1} : ScalarType{};
  }

  /// Time after which the response stays in the band until the last sample, s; nothing if the last
  /// sample is outside.
  constexpr std::optional<ScalarType> settling_time() const noexcept {
    if (!valid() || !inside_) return std::nullopt;
    return entry_ - config_.step_time;
  }

  /// Time from the first crossing of `rise_from` to the first crossing of `rise_to`, s; nothing if
  /// the latter is not reached.
  constexpr std::optional<ScalarType> rise_time() const noexcept {
    if (!valid() || !rise_start_ || !rise_end_) return std::nullopt;
    return *rise_end_ - *rise_start_;
  }

  /// Forgets all samples, keeps the settings.
  constexpr void reset() noexcept { *this = StepResponse(config_); }

 private:
  explicit constexpr StepResponse(const Config& config) : config_(config) {}

  constexpr bool valid() const noexcept { return started_ && !spoilt_; }

  /// Time at which the line from the last sample to (t, progress) has the given level.
  constexpr ScalarType crossing(ScalarType level, ScalarType t,
                                ScalarType progress) const noexcept {
    return time_ + (t - time_) * ((level - progress_) / (progress - progress_));
  }

  constexpr void note_crossing(std::optional<ScalarType>& found, ScalarType level, ScalarType t,
                               ScalarType progress) const noexcept {
    if (found || progress < level) return;
    found = started_ ? crossing(level, t, progress) : t;
  }

  constexpr void note_band(ScalarType t, ScalarType progress) noexcept {
    const ScalarType error = progress - ScalarType{1};
    const bool inside = error <= config_.band && error >= -config_.band;
    if (inside && !inside_) {
      const ScalarType side = progress_ > ScalarType{1} ? config_.band : -config_.band;
      entry_ = started_ ? crossing(ScalarType{1} + side, t, progress) : t;
    }
    inside_ = inside;
  }

  Config config_;
  std::optional<ScalarType> rise_start_{};
  std::optional<ScalarType> rise_end_{};
  ScalarType time_{};
  ScalarType progress_{};
  ScalarType largest_{};
  ScalarType entry_{};
  bool inside_ = false;
  bool started_ = false;
  bool spoilt_ = false;
};

}  // namespace esokit::sim
