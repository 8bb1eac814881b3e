/// @file
/// x^p for a p that is known early, without `pow` where a plain operation does it.
#pragma once

#include <cmath>
#include <esokit/core/scalar.hpp>

namespace esokit {

/// x -> x^p for x > 0. The exponents -1/2, 0, 1/2, 1 and 2 are told apart at construction and need
/// no `pow`. For packs an exponent counts as one of these if it is that in all lanes.
///
/// Packs and autodiff types supply `pow(x, p)` and `sqrt(x)` by ADL.
template <Scalar S>
class Power {
 public:
  /// @param exponent p, any finite number
  constexpr explicit Power(const S& exponent) noexcept
      : exponent_(exponent), kind_(kind_of(exponent)) {}

  /// x^p, x > 0.
  [[nodiscard]] S operator()(const S& x) const noexcept {
    using std::pow;
    using std::sqrt;
    switch (kind_) {
      case Kind::zero:
        return S(1.0);
      case Kind::one:
        return x;
      case Kind::two:
        return x * x;
      case Kind::half:
        return sqrt(x);
      case Kind::minus_half:
        return S(1.0) / sqrt(x);
      case Kind::general:
        break;
    }
    return pow(x, exponent_);
  }

  /// p.
  [[nodiscard]] constexpr const S& exponent() const noexcept { return exponent_; }

 private:
  enum class Kind : unsigned char { zero, one, two, half, minus_half, general };

  static constexpr Kind kind_of(const S& p) noexcept {
    const auto is = [&p](double value) { return all(p >= S(value)) && all(S(value) >= p); };
    if (is(0.0)) return Kind::zero;
    if (is(1.0)) return Kind::one;
    if (is(2.0)) return Kind::two;
    if (is(0.5)) return Kind::half;
    if (is(-0.5)) return Kind::minus_half;
    return Kind::general;
  }

  S exponent_;
  Kind kind_;
};

}  // namespace esokit
