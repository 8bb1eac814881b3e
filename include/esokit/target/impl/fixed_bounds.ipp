#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <utility>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION double ResponseSums::most(double low, double high) const {
  const double up = high * positive - low * negative;
  const double down = high * negative - low * positive;
  return up > down ? up : down;
}

ESOKIT_FUNCTION WorstCase::WorstCase(int size, Vector a, const Vector& weights)
    : n_(static_cast<std::size_t>(size)), a_(std::move(a)), weights_(weights) {
  Vector power = a_;
  step_ = 1;
  while (!(norm(power) <= 0.5) && step_ < most_steps) {
    power = times(power, power);
    step_ *= 2;
  }
  factor_ = norm(power);
  if (!stable()) return;
  Vector running(n_ * n_, 0.0);
  for (std::size_t i = 0; i < n_; ++i) running[i * n_ + i] = 1;
  for (int k = 0; k < step_; ++k) {
    const double size_now = norm(running);
    if (size_now > largest_) largest_ = size_now;
    if (k + 1 < step_) running = times(running, a_);
  }
}

ESOKIT_FUNCTION std::vector<ResponseSums> WorstCase::sums(const Vector& c,
                                                          const std::vector<Vector>& inputs,
                                                          const Vector& box,
                                                          double* most_at) const {
  std::vector<ResponseSums> all(inputs.size());
  Vector row = c;
  Vector next(n_);
  std::vector<double> sizes;
  for (const Vector& b : inputs) {
    double size = 0;
    for (std::size_t i = 0; i < n_; ++i) size = larger(size, std::fabs(b[i]) / weights_[i]);
    sizes.push_back(size);
  }
  double first = 0;
  for (int k = 0;; ++k) {
    double size = 0;
    for (std::size_t i = 0; i < n_; ++i) size += std::fabs(row[i]) * weights_[i];
    if (k == 0) first = size;
    // What is left is below this for b of size one.
    const double rest = size * largest_ * step_ / (1 - factor_);
    const bool ends = k % step_ == 0 && (rest <= 1e-7 * first || !(size > 0));
    if (most_at != nullptr) {
      double sum = 0;
      for (std::size_t i = 0; i < n_; ++i) sum += std::fabs(row[i]) * box[i];
      *most_at = larger(*most_at, sum);
    }
    for (std::size_t j = 0; j < inputs.size(); ++j) {
      if (ends) {
        all[j].positive = (all[j].positive + rest * sizes[j]) * (1 + 1e-6);
        all[j].negative = (all[j].negative + rest * sizes[j]) * (1 + 1e-6);
        continue;
      }
      double value = 0;
      for (std::size_t i = 0; i < n_; ++i) value += row[i] * inputs[j][i];
      (value > 0 ? all[j].positive : all[j].negative) += std::fabs(value);
    }
    if (ends) return all;
    for (std::size_t i = 0; i < n_; ++i) {
      next[i] = 0;
      for (std::size_t j = 0; j < n_; ++j) next[i] += row[j] * a_[j * n_ + i];
    }
    row.swap(next);
  }
}

ESOKIT_FUNCTION double WorstCase::norm(const Vector& m) const {
  double most = 0;
  for (std::size_t i = 0; i < n_; ++i) {
    double sum = 0;
    for (std::size_t j = 0; j < n_; ++j) sum += std::fabs(m[i * n_ + j]) * weights_[j];
    most = larger(most, sum / weights_[i]);
  }
  return most;
}

ESOKIT_FUNCTION WorstCase::Vector WorstCase::times(const Vector& a, const Vector& b) const {
  Vector product(n_ * n_, 0.0);
  for (std::size_t i = 0; i < n_; ++i) {
    for (std::size_t k = 0; k < n_; ++k) {
      for (std::size_t j = 0; j < n_; ++j) product[i * n_ + j] += a[i * n_ + k] * b[k * n_ + j];
    }
  }
  return product;
}

}  // namespace esokit::detail
