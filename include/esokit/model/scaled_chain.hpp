/// @file
/// The sampled chain in Nordsieck scaling, in which the observers compute.
#pragma once

#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/combinatorics.hpp>

namespace esokit {

/// Sizes of a chain: the plant y^(Order) = d + b0 u with d modelled by `Extension` integrators.
template <int Order, int Extension>
struct ChainSize {
  static constexpr int order = Order;             ///< n, order of the plant
  static constexpr int extension = Extension;     ///< m, extended states
  static constexpr int size = Order + Extension;  ///< N = n + m

  // These come last, because Clang leaves out the declarations after a failed static_assert.
  static_assert(Order >= 1, "esokit: the plant order must be at least 1");
  static_assert(Extension >= 1, "esokit: at least one extended state is needed");
  static_assert(Order + Extension <= 16, "esokit: order + extension above 16 is not supported");
};

/// States x_r = T^r z_r / r!, the Taylor coefficients of y over one sample (Nordsieck vector).
///
/// In this scaling Phi is Pascal's triangle, Phi_rj = C(j, r): a prediction is N (N-1) / 2
/// additions of small multiples (for N = 3 without a multiplication) and exact up to rounding. The
/// gains are dimensionless and depend on omega_o T alone, and nothing overflows float for small T
/// (an unscaled gain at T = 1e-4 s, N = 12 is 1e44).
template <int Order, Scalar ScalarType = double, int Extension = 1>
struct ScaledChain : ChainSize<Order, Extension> {
  using ChainSize<Order, Extension>::size;
  using State = Array<ScalarType, size>;      ///< x, scaled, N elements
  using Estimate = Vector<ScalarType, size>;  ///< z, physical units, N x 1

  /// Scaled effect of a unit input: b0 T^n / n!. Times u it adds to the scaled disturbance
  /// T^n d / n!, because the chain is driven by d + b0 u.
  static constexpr ScalarType scaled_input_gain(const ScalarType& input_gain,
                                                const ScalarType& sample_time) noexcept {
    ScalarType gain = input_gain;
    for (int i = 1; i <= Order; ++i) gain = gain * sample_time / detail::constant<ScalarType>(i);
    return gain;
  }

  /// The state one sample ahead. The disturbance and the drive act on the plant rows; the
  /// disturbance rows depend on themselves alone.
  /// @param drive what drives the chain besides its own disturbance, scaled like (d, d', ..): the
  ///        first element is scaled_input_gain * u; in a cascade the disturbance found by the
  ///        levels below is added
  template <int DriveCount>
  [[nodiscard]] ESOKIT_INLINE static constexpr State predict(
      const State& x, const Array<ScalarType, DriveCount>& drive) noexcept {
    static_assert(DriveCount >= 1 && DriveCount <= Extension);
    State next;
    Array<ScalarType, DriveCount> driven;
    detail::unroll<DriveCount>([&](auto r) ESOKIT_INLINE_LAMBDA {
      std::get<r>(driven) = std::get<Order + r>(x) + std::get<r>(drive);
    });
    detail::unroll<size>([&](auto row) ESOKIT_INLINE_LAMBDA {
      ScalarType sum = std::get<row>(x);
      detail::unroll<size - 1 - row>([&](auto k) ESOKIT_INLINE_LAMBDA {
        constexpr int column = row + 1 + k;
        constexpr double weight = binomial(column, row);
        ScalarType term = std::get<column>(x);
        if constexpr (row < Order && column >= Order && column < Order + DriveCount) {
          term = std::get<column - Order>(driven);
        }
        if constexpr (weight == 2.0) {
          term = term + term;
        } else if constexpr (weight != 1.0) {
          term = detail::constant<ScalarType>(weight) * term;
        }
        sum = sum + term;
      });
      std::get<row>(next) = sum;
    });
    return next;
  }

  /// y^(Row) in physical units from its scaled state. @param rate 1/T, 1/s
  ///
  /// Multiplied in steps: T^-Row alone may overflow when the estimate does not.
  template <int Row>
  [[nodiscard]] ESOKIT_INLINE static constexpr ScalarType physical(
      const ScalarType& scaled, const ScalarType& rate) noexcept {
    ScalarType value = scaled;
    detail::unroll<Row>([&](auto j) ESOKIT_INLINE_LAMBDA {
      constexpr double weight = static_cast<double>(Row - j);
      value = value * (detail::constant<ScalarType>(weight) * rate);
    });
    return value;
  }

  /// All estimates (y, .., y^(n-1), d, .., d^(m-1)) in physical units. @param rate 1/T, 1/s
  [[nodiscard]] static Estimate physical(const State& x, const ScalarType& rate) noexcept {
    Estimate estimate;
    detail::unroll<size>(
        [&](auto row) { estimate(int{row}) = physical<row>(std::get<row>(x), rate); });
    return estimate;
  }

  /// Scaled state from estimates in physical units. @param sample_time T, s
  [[nodiscard]] static State scaled(const Estimate& estimate,
                                    const ScalarType& sample_time) noexcept {
    State x;
    detail::unroll<size>([&](auto row) {
      ScalarType value = estimate(int{row});
      detail::unroll<row>([&](auto j) ESOKIT_INLINE_LAMBDA {
        constexpr double weight = static_cast<double>(j + 1);
        value = value * (sample_time / detail::constant<ScalarType>(weight));
      });
      std::get<row>(x) = value;
    });
    return x;
  }

  /// A number that is finite only if every estimate is finite in physical units: the sum of their
  /// magnitudes, so that large ones of opposite sign do not cancel. Computed by Horner's rule with
  /// N - 1 multiply-adds; its value has no other meaning. @param rate 1/T, 1/s
  [[nodiscard]] ESOKIT_INLINE static constexpr ScalarType finite_probe(
      const State& x, const ScalarType& rate) noexcept {
    ScalarType probe = detail::absolute(std::get<size - 1>(x));
    detail::unroll<size - 1>([&](auto k) ESOKIT_INLINE_LAMBDA {
      constexpr int row = size - 2 - k;
      constexpr double weight = static_cast<double>(row + 1);
      probe = probe * (detail::constant<ScalarType>(weight) * rate) +
              detail::absolute(std::get<row>(x));
    });
    return probe;
  }
};

}  // namespace esokit
