/// @file
/// Han's function fal: a power of the error, linear around zero.
#pragma once

#include <esokit/core/scalar.hpp>
#include <esokit/math/power.hpp>

namespace esokit {

/// fal(e) = |e|^a sign(e) for |e| > delta, and e / delta^(1-a) for |e| <= delta. It is computed as
/// e k(|e|) with the even gain k(x) = max(x, delta)^(a-1), without a division by e or a sign
/// function.
template <Scalar S>
class Fal {
 public:
  /// @param exponent a > 0; below 1, small errors get a higher gain than large ones
  /// @param linear_width delta > 0, unit of e
  constexpr Fal(const S& exponent, const S& linear_width) noexcept
      : power_(exponent - S(1.0)), linear_width_(linear_width) {}

  /// k(x) = fal(x) / x for x = |e| >= 0.
  [[nodiscard]] S gain(const S& magnitude) const noexcept {
    return power_(select(magnitude < linear_width_, linear_width_, magnitude));
  }

  /// fal(e).
  [[nodiscard]] S operator()(const S& error) const noexcept {
    return error * gain(select(error < S(0.0), S(-error), error));
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 2;

  Power<S> power_;
  S linear_width_;
};

/// fal(e, a, delta) for one use; keep a `Fal` where it is evaluated often.
/// @param error e @param exponent a > 0 @param linear_width delta > 0, unit of e
template <Scalar S>
[[nodiscard]] S fal(const S& error, const S& exponent, const S& linear_width) noexcept {
  return Fal<S>(exponent, linear_width)(error);
}

}  // namespace esokit
