/// @file
/// The time window of a criterion.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <limits>

namespace esokit::sim {

/// From `start` to `end`, both included; the default is all time.
template <PlainScalar ScalarType = double>
class Window {
 public:
  /// Settings of make.
  struct Config {
    ScalarType start = std::numeric_limits<ScalarType>::lowest();  ///< s
    ScalarType end = (std::numeric_limits<ScalarType>::max)();     ///< s, after `start`
  };

  /// All time.
  constexpr Window() = default;

  /// Refuses members that are not finite and an end that is not after the start.
  static constexpr Expected<Window, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.finite("start", config.start)
        .finite("end", config.end)
        .demand(config.end > config.start, {.field = "end",
                                            .value = config.end,
                                            .rule = "must be greater than start, which is",
                                            .limit = config.start,
                                            .has_limit = true});
    if (!rules) return rules.error();
    return Window(config);
  }

  /// First moment, s.
  constexpr ScalarType start() const noexcept { return config_.start; }
  /// Last moment, s.
  constexpr ScalarType end() const noexcept { return config_.end; }
  /// True if t (s) is in the window, ends included.
  constexpr bool contains(ScalarType t) const noexcept { return t >= start() && t <= end(); }

 private:
  explicit constexpr Window(const Config& config) : config_(config) {}

  Config config_{};
};

}  // namespace esokit::sim
