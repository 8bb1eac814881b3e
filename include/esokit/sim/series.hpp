/// @file
/// A sampled signal: values and their times.
#pragma once

#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <span>

namespace esokit::sim {

/// A view of samples, at given times or with a constant step. It does not own them.
template <PlainScalar ScalarType = double>
class Series {
 public:
  /// Settings of make: samples at given times.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    std::span<const ScalarType> times{};             ///< s, finite, never descending
    std::span<const ScalarType> values{};            ///< finite, as many as times
  };

  /// Settings of make_uniform: samples with a constant step.
  struct UniformConfig {
    [[no_unique_address]] ByName<UniformConfig> by_name{};  ///< nothing to set, see ByName
    ScalarType start{};                                     ///< time of the first value, s
    ScalarType sample_time{1};                              ///< s, positive
    std::span<const ScalarType> values{};                   ///< finite
  };

  /// Refuses sizes that differ (the value of the error is then the number of times), times that
  /// descend, and numbers that are not finite.
  static Expected<Series, Error<ScalarType>> make(const Config& config) {
    const std::size_t size = config.times.size();
    Rules<ScalarType> rules;
    rules.demand(size == config.values.size(),
                 {.field = "times",
                  .value = static_cast<ScalarType>(size),
                  .rule = "must have as many elements as values, which has",
                  .limit = static_cast<ScalarType>(config.values.size()),
                  .has_limit = true});
    for (std::size_t i = 0; rules && i < size; ++i) {
      const int index = static_cast<int>(i);
      const ScalarType time = config.times[i];
      rules.finite("times", time, index)
          .finite("values", config.values[i], index)
          .demand(i == 0 || !(time < config.times[i - 1]), "times", time, "must not descend",
                  index);
    }
    if (!rules) return rules.error();
    Series series;
    series.times_ = config.times;
    series.values_ = config.values;
    return series;
  }

  /// Values at start + i sample_time. Refuses numbers that are not finite and a sample time that is
  /// not positive.
  static Expected<Series, Error<ScalarType>> make_uniform(const UniformConfig& config) {
    Rules<ScalarType> rules;
    rules.finite("start", config.start)
        .positive("sample_time", config.sample_time)
        .finite("values", config.values);
    if (!rules) return rules.error();
    Series series;
    series.values_ = config.values;
    series.start_ = config.start;
    series.sample_time_ = config.sample_time;
    return series;
  }

  /// Number of samples.
  std::size_t size() const noexcept { return values_.size(); }

  /// Time of sample i < size(), s.
  ScalarType time(std::size_t i) const noexcept {
    if (!times_.empty()) return times_[i];
    return start_ + static_cast<ScalarType>(i) * sample_time_;
  }

  /// Value of sample i < size().
  ScalarType value(std::size_t i) const noexcept { return values_[i]; }

 private:
  Series() = default;

  std::span<const ScalarType> times_{};
  std::span<const ScalarType> values_{};
  ScalarType start_{};
  ScalarType sample_time_{};
};

}  // namespace esokit::sim
