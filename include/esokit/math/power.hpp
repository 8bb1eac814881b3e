/// @file
/// x^p for a p that is fixed in advance, without `pow` if a simple operation does it.
#pragma once

#include <cmath>
#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit {

namespace detail {

/// Exponents that need no `pow`, and `general` for all others.
enum class PowerKind : unsigned char { zero, one, two, half, minus_half, general };

template <Scalar S>
constexpr PowerKind power_kind(const S& p) noexcept {
  const auto is = [&p](double value) { return all(p >= S(value)) && all(S(value) >= p); };
  if (is(0.0)) return PowerKind::zero;
  if (is(1.0)) return PowerKind::one;
  if (is(2.0)) return PowerKind::two;
  if (is(0.5)) return PowerKind::half;
  if (is(-0.5)) return PowerKind::minus_half;
  return PowerKind::general;
}

}  // namespace detail

/// x -> x^p for x > 0. The exponents -1/2, 0, 1/2, 1 and 2 are recognised at construction and need
/// no `pow`. A pack may have another exponent in each lane; it is fastest if all lanes are of one
/// kind.
///
/// Packs and autodiff types supply `pow(x, p)` and `sqrt(x)`, found by ADL.
template <Scalar S>
class Power {
 public:
  /// @param exponent p, any finite number
  constexpr explicit Power(const S& exponent) noexcept : exponent_(exponent) {
    for (int i = 0; i < lane_count<S>; ++i) {
      detail::of_lane(kind_, i) = detail::power_kind(detail::number_of_lane(exponent, i));
    }
  }

  /// x^p, x > 0.
  [[nodiscard]] S operator()(const S& x) const noexcept {
    const Kind kind = detail::of_lane(kind_, 0);
    if (kind_ == kind) [[likely]]
      return raised(x, exponent_, kind);
    S each = x;
    for (int i = 0; i < lane_count<S>; ++i) {
      detail::set_lane(each,
                       raised(detail::number_of_lane(x, i), detail::number_of_lane(exponent_, i),
                              detail::of_lane(kind_, i)),
                       i);
    }
    return each;
  }

  /// p.
  [[nodiscard]] constexpr const S& exponent() const noexcept { return exponent_; }

 private:
  using Kind = detail::PowerKind;
  friend struct detail::LaneAccess;
  static constexpr int data_members = 2;

  template <class T>
  [[nodiscard]] static T raised(const T& x, const T& exponent, Kind kind) noexcept {
    using std::pow;
    using std::sqrt;
    switch (kind) {
      case Kind::zero:
        return T(1.0);
      case Kind::one:
        return x;
      case Kind::two:
        return x * x;
      case Kind::half:
        return sqrt(x);
      case Kind::minus_half:
        return T(1.0) / sqrt(x);
      case Kind::general:
        break;
    }
    return pow(x, exponent);
  }

  S exponent_;
  Lanes<Kind, S> kind_{};
};

}  // namespace esokit
