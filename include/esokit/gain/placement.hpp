/// @file
/// Where the poles of the estimation error go: all in one place; any stable set is in
/// gain/pole_set.hpp.
///
/// A placement is what a linear observer's config names: its `Spec`, the check of it, and the gains
/// it gives in both time domains.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/sampled_gain.hpp>

namespace esokit {

/// What the placements by a bandwidth have in common; each adds `Sampled` and `sample`, and `gain`
/// where there is a continuous one.
struct BandwidthPlacement {
  template <int Size, Scalar S>
  using Spec = S;  ///< omega_o, rad/s

  /// Error of a bandwidth that is not finite or not positive.
  template <int Size, Scalar S>
  static Check<S> check(const char* field, const S& bandwidth, int index = -1) {
    return Rules<S>{}.positive(field, bandwidth, index);
  }

  /// A number that names the spec in an error.
  template <int Size, Scalar S>
  static S representative(const S& bandwidth) {
    return bandwidth;
  }
};

/// All N poles at -omega_o (at exp(-omega_o T) when sampled): the bandwidth parameterisation.
struct EqualPoles : BandwidthPlacement {
  template <int Size, Scalar S>
  using Sampled = EqualSampledPoles<Size, S>;  ///< what `sample` gives

  /// Poles at exp(-omega_o T). @param bandwidth omega_o, rad/s @param sample_time T, s
  template <int Size, Scalar S>
  static EqualSampledPoles<Size, S> sample(const S& bandwidth, const S& sample_time) {
    return EqualSampledPoles<Size, S>::from_bandwidth(bandwidth, sample_time);
  }

  /// Gain of the continuous observer. @return l, N x 1, row i in 1/s^(i+1)
  template <int Size, Scalar S>
  static Vector<S, Size> gain(const S& bandwidth) {
    return continuous_gain<Size, S>(bandwidth);
  }
};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<EqualPoles> = make_type_tag<>("EqualPoles");

/// A placement whose spec is the poles themselves, as PoleSet's is.
template <class Placement>
concept ListsPoles = requires {
  requires Placement::lists_poles;
};

}  // namespace esokit
