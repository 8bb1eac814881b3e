/// @file
/// Placement of the poles of the estimation error, all in one place. For any stable set see
/// gain/pole_set.hpp.
///
/// A placement is a template argument of a linear observer. It defines what the config specifies
/// (`Spec`), the check of it, the gains in both time domains, and what is known of steps over
/// several samples. That is `recovery`, see gain/certificate/detail/bridged_steps.hpp; without it
/// every gap restarts the observer.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/certificate/detail/bridged_steps.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/sampled_gain.hpp>

namespace esokit {

/// Common base of the placements by a bandwidth. Each adds `Sampled` and `sample`, and `gain` if it
/// has a continuous form.
struct BandwidthPlacement {
  template <int Size, Scalar S>
  using Spec = S;  ///< omega_o, rad/s

  /// An error for a bandwidth that is not finite or not positive.
  template <int Size, Scalar S>
  static Check<S> validate(const char* field, const S& bandwidth, int index = -1) {
    return Rules<S>{}.positive(field, bandwidth, index);
  }

  /// The number that stands for the spec in an error.
  template <int Size, Scalar S>
  static S representative(const S& bandwidth) {
    return bandwidth;
  }
};

/// All N poles at -omega_o (at exp(-omega_o T) when sampled): the bandwidth parameterisation.
struct EqualPoles : BandwidthPlacement {
  template <int Size, Scalar S>
  using Sampled = EqualSampledPoles<Size, S>;  ///< result of `sample`

  /// Poles at exp(-omega_o T). @param bandwidth omega_o, rad/s @param sample_time T, s
  template <int Size, Scalar S>
  static EqualSampledPoles<Size, S> sample(const S& bandwidth, const S& sample_time) {
    return EqualSampledPoles<Size, S>::from_bandwidth(bandwidth, sample_time);
  }

  /// After which steps over several samples errors decay.
  template <int Size, Scalar S>
  static constexpr auto recovery(const EqualSampledPoles<Size, S>& poles) noexcept {
    return detail::recovery_of<Size, detail::equal_steps, detail::equal_recovery>(
        S(S(1.0) - poles.contraction));
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

/// A placement whose spec is a list of poles, such as PoleSet.
template <class Placement>
concept ListsPoles = requires {
  requires Placement::lists_poles;
};

}  // namespace esokit
