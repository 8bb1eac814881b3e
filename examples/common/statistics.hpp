/// @file
/// What the stochastic examples report of their seeds.
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <ranges>
#include <vector>

namespace esokit::examples {

/// Mean and spread of one number over the seeds.
struct Statistics {
  std::size_t count = 0;
  double mean = 0.0;
  double standard_deviation = 0.0;  ///< of the sample: divided by count - 1; 0 for one value
  double standard_error = 0.0;      ///< of the mean
};

/// Two passes: the spread is often 1e-3 of the mean, where sums of squares lose their digits.
template <std::ranges::forward_range Values>
[[nodiscard]] Statistics statistics(const Values& values) {
  Statistics result;
  double sum = 0.0;
  for (const auto value : values) {
    sum += static_cast<double>(value);
    ++result.count;
  }
  if (result.count == 0) return result;
  const auto count = static_cast<double>(result.count);
  result.mean = sum / count;
  if (result.count == 1) return result;
  double squares = 0.0;
  for (const auto value : values) {
    const double deviation = static_cast<double>(value) - result.mean;
    squares += deviation * deviation;
  }
  result.standard_deviation = std::sqrt(squares / (count - 1.0));
  result.standard_error = result.standard_deviation / std::sqrt(count);
  return result;
}

/// Of the number that `number` takes out of every run, e.g. `statistics_of(runs, &Run::error)`.
template <std::ranges::forward_range Runs, class Number>
[[nodiscard]] Statistics statistics_of(const Runs& runs, Number number) {
  std::vector<double> values;
  for (const auto& run : runs) values.push_back(static_cast<double>(std::invoke(number, run)));
  return statistics(values);
}

}  // namespace esokit::examples
