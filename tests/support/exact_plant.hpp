/// @file
/// The sampled chain of integrators in whole numbers: no rounding at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace esokit_test {

/// y^(n) = d + b0 u with a polynomial d, in Nordsieck scaling x_r = T^r z_r / r!. There Phi is
/// Pascal's triangle and the drive b0 T^n u / n! adds to x_n, so that whole states and drives stay
/// whole. Written from the definition, without the library.
class ExactPlant {
 public:
  using Integer = std::int64_t;

  ExactPlant(int order, std::vector<Integer> state) : order_(order), x_(std::move(state)) {}

  /// One sample forward under a held input.
  void step(Integer drive) {
    std::vector<Integer> next(x_.size(), 0);
    for (std::size_t r = 0; r < x_.size(); ++r) {
      for (std::size_t c = r; c < x_.size(); ++c) next[r] += choose_exactly(c, r) * x_[c];
      next[r] += driven(r, drive);
    }
    x_ = next;
  }

  /// One sample back: the state before `step(drive)`.
  void step_back(Integer drive) {
    std::vector<Integer> before(x_.size(), 0);
    for (std::size_t r = 0; r < x_.size(); ++r) x_[r] -= driven(r, drive);
    for (std::size_t r = 0; r < x_.size(); ++r) {
      for (std::size_t c = r; c < x_.size(); ++c) {
        const Integer term = choose_exactly(c, r) * x_[c];
        before[r] += (c - r) % 2 == 0 ? term : -term;
      }
    }
    x_ = before;
  }

  [[nodiscard]] Integer state(int r) const { return x_[static_cast<std::size_t>(r)]; }
  [[nodiscard]] Integer output() const { return x_[0]; }

 private:
  static Integer choose_exactly(std::size_t n, std::size_t k) {
    Integer value = 1;
    for (std::size_t i = 1; i <= k; ++i) {
      value = value * static_cast<Integer>(n - k + i) / static_cast<Integer>(i);
    }
    return value;
  }

  [[nodiscard]] Integer driven(std::size_t r, Integer drive) const {
    const auto n = static_cast<std::size_t>(order_);
    return r < n ? choose_exactly(n, r) * drive : 0;
  }

  int order_;
  std::vector<Integer> x_;
};

}  // namespace esokit_test
