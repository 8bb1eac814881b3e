#include "statistics.hpp"

#include <cmath>

namespace esokit::examples {

/// Two passes: the spread is often 1e-3 of the mean, where sums of squares lose their digits.
Statistics statistics(const std::vector<double>& values) {
  Statistics result;
  double sum = 0.0;
  for (const double value : values) {
    sum += value;
    ++result.count;
  }
  if (result.count == 0) return result;
  const auto count = static_cast<double>(result.count);
  result.mean = sum / count;
  if (result.count == 1) return result;
  double squares = 0.0;
  for (const double value : values) {
    const double deviation = value - result.mean;
    squares += deviation * deviation;
  }
  result.standard_deviation = std::sqrt(squares / (count - 1.0));
  result.standard_error = result.standard_deviation / std::sqrt(count);
  return result;
}

}  // namespace esokit::examples
