#include "support/gain_comparison.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/high_precision.hpp"

namespace esokit_test {

long double smallest_gain(const std::vector<Poles>& level_poles, long double sample_time) {
  Big smallest = 1;
  for (const Poles& poles : level_poles) {
    smallest =
        std::min(smallest, reference_current_gain(reference_polynomial(poles, sample_time)).back());
  }
  return static_cast<long double>(smallest);
}

int compare_gains(const std::vector<std::vector<long double>>& estimates, int order,
                  const std::vector<Poles>& level_poles, long double sample_time,
                  long double tolerance, long double smallest, long double largest) {
  int compared = 0;
  Big innovation = 1;
  std::vector<Big> found(estimates[0].size(), Big(0));
  for (std::size_t level = 0; level < estimates.size(); ++level) {
    const auto k = reference_current_gain(reference_polynomial(level_poles[level], sample_time));
    Big to_physical = 1;
    for (std::size_t r = 0; r < k.size(); ++r) {
      Big expected = k[r] * innovation;
      if (r >= static_cast<std::size_t>(order)) expected = found[r] += expected;
      expected *= to_physical;
      to_physical *= Big(r + 1) / Big(sample_time);
      if (abs(expected) > Big(largest) || abs(expected) < Big(smallest)) continue;
      EXPECT_LE(relative_error(estimates[level][r], expected), static_cast<double>(tolerance))
          << "level " << level << " row " << r;
      ++compared;
    }
    innovation *= k[0];
  }
  return compared;
}

void compare_polynomial(const std::vector<long double>& gain, const Poles& poles,
                        long double sample_time, long double tolerance) {
  std::vector<Big> kappa;  // at t = 1 .. N
  for (std::size_t t = 1; t <= gain.size(); ++t) {
    Big sum = 0;
    Big power = 1;
    for (std::size_t r = 0; r < gain.size(); ++r) {
      sum += Big(gain[r]) * power;
      power *= Big(t) * Big(sample_time) / Big(r + 1);
    }
    kappa.push_back(sum);
  }
  const auto beta = reference_polynomial(poles, sample_time);
  for (std::size_t j = 1; j < beta.size(); ++j) {
    EXPECT_LE(relative_error(kappa[0], beta[j]), static_cast<double>(tolerance)) << "beta_" << j;
    for (std::size_t t = 0; t + 1 < kappa.size(); ++t) kappa[t] = kappa[t + 1] - kappa[t];
    kappa.pop_back();
  }
}

}  // namespace esokit_test
