/// @file
/// A sum of many small numbers that loses none of them.
#pragma once

#include <esokit/core/scalar.hpp>

namespace esokit::detail {

/// Sums what the digits of the sum do not hold beside it, until it has become large enough: in
/// float 10000 + 1e-4 is 10000, however often. Under -ffast-math a compiler may take the part that
/// is left over for zero; as it is split off only at each eighth digit, that costs little.
template <class S>
class FineSum {
 public:
  FineSum() = default;
  explicit constexpr FineSum(const S& start) noexcept : whole_(start) {}

  constexpr void add(const S& x) noexcept {
    rest_ = rest_ + x;
    if (absolute(rest_) <= S(8) * rounding<S>() * absolute(whole_)) return;
    const S sum = whole_ + rest_;
    const S taken = sum - whole_;
    const S left = (whole_ - (sum - taken)) + (rest_ - taken);
    whole_ = sum;
    rest_ = is_finite(left) ? left : S(0);  // of an infinite sum
  }

  /// The sum, rounded once.
  [[nodiscard]] constexpr S value() const noexcept { return whole_ + rest_; }
  /// The sum minus x, with all its digits where it is near x.
  [[nodiscard]] constexpr S minus(const S& x) const noexcept { return (whole_ - x) + rest_; }
  [[nodiscard]] constexpr S minus(const FineSum& x) const noexcept {
    return (whole_ - x.whole_) + (rest_ - x.rest_);
  }

 private:
  S whole_{};
  S rest_{};
};

}  // namespace esokit::detail
