/// @file
/// A sampled signal: values and their times.
#pragma once

#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <span>

namespace esokit::sim {

/// A view of samples, at given times or with a constant step. It owns nothing.
template <PlainScalar ScalarType = double>
class Series {
 public:
  /// Settings of make: samples at given times.
  struct Config {
    std::span<const ScalarType> times{};   ///< s, finite, never descending
    std::span<const ScalarType> values{};  ///< finite, as many as times
  };

  /// Settings of make_uniform: samples with a constant step.
  struct UniformConfig {
    ScalarType start{};                    ///< time of the first value, s
    ScalarType sample_time{1};             ///< s, positive
    std::span<const ScalarType> values{};  ///< finite
  };

  /// Refuses sizes that differ (the value of the error is then the number of times), times that
  /// descend, and numbers that are not finite.
  static Expected<Series, Error<ScalarType>> make(const Config& config) {
    if (config.times.size() != config.values.size()) {
      return Error<ScalarType>{.field = "times",
                               .value = static_cast<ScalarType>(config.times.size()),
                               .rule = "must have as many elements as values, which has",
                               .limit = static_cast<ScalarType>(config.values.size()),
                               .has_limit = true};
    }
    for (std::size_t i = 0; i < config.times.size(); ++i) {
      const int index = static_cast<int>(i);
      if (auto check = check_finite("times", config.times[i], index); !check) return check.error();
      if (auto check = check_finite("values", config.values[i], index); !check)
        return check.error();
      if (i > 0 && config.times[i] < config.times[i - 1]) {
        return Error<ScalarType>{
            .field = "times", .value = config.times[i], .rule = "must not descend", .index = index};
      }
    }
    Series series;
    series.times_ = config.times;
    series.values_ = config.values;
    return series;
  }

  /// Values at start + i sample_time. Refuses numbers that are not finite and a sample time that is
  /// not positive.
  static Expected<Series, Error<ScalarType>> make_uniform(const UniformConfig& config) {
    if (auto check = check_finite("start", config.start); !check) return check.error();
    if (auto check = check_positive("sample_time", config.sample_time); !check)
      return check.error();
    for (std::size_t i = 0; i < config.values.size(); ++i) {
      const int index = static_cast<int>(i);
      if (auto check = check_finite("values", config.values[i], index); !check)
        return check.error();
    }
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
