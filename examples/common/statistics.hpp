/// @file
/// What the stochastic examples report of their seeds.
#pragma once

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

[[nodiscard]] Statistics statistics(const std::vector<double>& values);

/// Of the number that `number` takes out of every run, e.g. `statistics_of(runs, &Run::error)`.
template <std::ranges::forward_range Runs, class Number>
[[nodiscard]] Statistics statistics_of(const Runs& runs, Number number) {
  std::vector<double> values;
  for (const auto& run : runs) values.push_back(static_cast<double>(std::invoke(number, run)));
  return statistics(values);
}

}  // namespace esokit::examples
