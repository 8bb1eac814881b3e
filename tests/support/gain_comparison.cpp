#include "support/gain_comparison.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/algebraic_reference.hpp"
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

std::vector<double> reference_algebraic_gain(std::size_t size, double bandwidth, double shift,
                                             std::int64_t k) {
  std::vector<double> gain;
  for (const Big& x : AlgebraicReference{size, Big(bandwidth), Big(shift)}.gain(k)) {
    gain.push_back(static_cast<double>(x));
  }
  return gain;
}

namespace {

/// Coefficients of the least-squares polynomial of degree N - 1 through y[0] .. y[k], in powers of
/// (i - k), by normal equations in 100 digits.
std::vector<Big> least_squares(const std::vector<Big>& y, std::size_t size) {
  std::vector<std::vector<Big>> a(size, std::vector<Big>(size + 1, Big(0)));
  for (std::size_t i = 0; i < y.size(); ++i) {
    const Big t = Big(static_cast<std::int64_t>(i)) - Big(static_cast<std::int64_t>(y.size() - 1));
    std::vector<Big> powers{Big(1)};
    while (powers.size() < size) powers.push_back(powers.back() * t);
    for (std::size_t r = 0; r < size; ++r) {
      for (std::size_t c = 0; c < size; ++c) a[r][c] += powers[r] * powers[c];
      a[r][size] += powers[r] * y[i];
    }
  }
  for (std::size_t p = 0; p < size; ++p) {
    for (std::size_t r = 0; r < size; ++r) {
      if (r == p) continue;
      const Big factor = a[r][p] / a[p][p];
      for (std::size_t c = p; c <= size; ++c) a[r][c] -= factor * a[p][c];
    }
  }
  std::vector<Big> x;
  for (std::size_t r = 0; r < size; ++r) x.push_back(a[r][size] / a[r][r]);
  return x;
}

}  // namespace

std::vector<double> least_squares_states(const std::vector<double>& y, const std::vector<double>& u,
                                         std::size_t order, std::size_t extension,
                                         double input_gain, double sample_time) {
  const std::size_t size = order + extension;
  // What the input alone does, in Nordsieck scaling.
  std::vector<Big> forced(size, Big(0));
  Big drive_unit = Big(input_gain);
  for (std::size_t i = 1; i <= order; ++i) drive_unit = drive_unit * Big(sample_time) / Big(i);
  std::vector<Big> free_part;
  for (std::size_t k = 0; k < y.size(); ++k) {
    forced[order] += drive_unit * Big(u[k]);
    forced = pascal_times(forced, false);
    for (std::size_t r = order; r < size; ++r) forced[r] = 0;
    free_part.push_back(Big(y[k]) - forced[0]);
  }
  const auto fit = least_squares(free_part, size);
  std::vector<double> states;
  Big unit = 1;
  for (std::size_t r = 0; r < size; ++r) {
    states.push_back(static_cast<double>((fit[r] + forced[r]) * unit));
    unit = unit * Big(r + 1) / Big(sample_time);
  }
  return states;
}

}  // namespace esokit_test
