/// @file
/// Poles of a reduced-order observer, whose estimate of y is the measurement itself.
///
/// The predictor-corrector with one pole at z = 0 has the gain k_0 = 1: each correction sets z_1 to
/// the measurement, which leaves an observer of order N - 1 for the other states.
#pragma once

#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/placement.hpp>

namespace esokit {

/// One sampled pole at zero, the others at rho, stored as the contraction 1 - rho.
template <int Size, Scalar S>
struct ReducedSampledPoles {
  static_assert(Size >= 2, "esokit: a reduced-order observer needs two states or more");

  EqualSampledPoles<Size - 1, S> rest{};  ///< the N - 1 poles that are not at zero

  /// The poles for `samples` sample times in one.
  [[nodiscard]] constexpr ReducedSampledPoles power(unsigned samples) const noexcept {
    return {rest.power(samples)};
  }

  /// s prod(a s + rho): the pole at zero shifts the weights by one.
  [[nodiscard]] constexpr PoleWeights<Size, S> weights() const noexcept {
    const PoleWeights<Size - 1, S> lower = rest.weights();
    PoleWeights<Size, S> weights{};
    weights[0] = S(0.0);
    for (std::size_t j = 0; j < Size; ++j) weights[j + 1] = lower[j];
    return weights;
  }
};

/// Placement of a reduced-order observer: N - 1 poles at exp(-omega_o T), one at zero. For sampled
/// observers only; there is no such continuous gain.
struct ReducedPoles : BandwidthPlacement {
  template <int Size, Scalar S>
  using Sampled = ReducedSampledPoles<Size, S>;  ///< result of `sample`

  /// The poles. @param bandwidth omega_o, rad/s @param sample_time T, s
  template <int Size, Scalar S>
  static ReducedSampledPoles<Size, S> sample(const S& bandwidth, const S& sample_time) {
    return {EqualSampledPoles<Size - 1, S>::from_bandwidth(bandwidth, sample_time)};
  }

  /// After which steps over several samples errors decay.
  template <int Size, Scalar S>
  static constexpr auto recovery(const ReducedSampledPoles<Size, S>& poles) noexcept {
    return detail::recovery_of<Size, detail::reduced_steps, detail::reduced_recovery>(
        S(S(1.0) - poles.rest.contraction));
  }
};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<ReducedPoles> = make_type_tag<>("ReducedPoles");

}  // namespace esokit
