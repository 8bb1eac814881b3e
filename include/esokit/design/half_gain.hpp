/// @file
/// Half-gain tuning (G. Herbst, A.-J. Hempel, T. Goehrt, S. Streif, "Half-gain tuning for active
/// disturbance rejection control", IFAC-PapersOnLine 53 (2020) 1492-1497): half the gains of the
/// bandwidth parameterisation, with about the same closed loop and less noise on u.
///
/// Half gains turn (s + omega)^N into ((s + omega)^N + s^N) / 2, whose roots are
///
///     s_k = -omega/2 (1 + j cot(theta_k / 2)),  theta_k = pi (2k + 1) / N,
///
/// so it is a pole set like any other. Sampled, the poles go to exp(s_k T): stable for every
/// omega T, which halved sampled gains are not (N = 4 loses stability at omega T = 0.88), and with
/// the half gains as the limit for T -> 0.
#pragma once

#include <cmath>
#include <complex>
#include <esokit/core/type_tag.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/design/placement.hpp>
#include <numbers>

namespace esokit {

/// s_k, 1/s, in conjugate pairs. @param bandwidth omega, rad/s
template <int Size, PlainScalar S>
Array<std::complex<S>, Size> half_gain_poles(const S& bandwidth) {
  Array<std::complex<S>, Size> poles{};
  const S real = -bandwidth / S(2);
  for (int k = 0; 2 * k < Size; ++k) {
    // The middle one of an odd number is real: cot(pi/2) = 0, which rounding would miss.
    const bool middle = 2 * k + 1 == Size;
    const S angle = std::numbers::pi_v<S> * static_cast<S>(2 * k + 1) / static_cast<S>(2 * Size);
    const S imaginary = middle ? S(0) : real / std::tan(angle);
    poles[static_cast<std::size_t>(k)] = {real, imaginary};
    poles[static_cast<std::size_t>(Size - 1 - k)] = {real, -imaginary};
  }
  return poles;
}

/// Placement of an observer with half the gains of the bandwidth parameterisation.
struct HalfGainPoles {
  template <int Size, PlainScalar S>
  using Spec = S;  ///< omega_o, rad/s, of the observer whose gains are halved

  template <int Size, PlainScalar S>
  using Sampled = SampledPoleSet<Size, S>;  ///< what `sample` gives

  /// Error of a bandwidth that is not finite or not positive.
  template <int Size, PlainScalar S>
  static Check<S> check(const char* field, const S& bandwidth, int index = -1) {
    return Rules<S>{}.positive(field, bandwidth, index);
  }

  /// Poles at exp(s_k T). @param bandwidth omega_o, rad/s @param sample_time T, s
  template <int Size, PlainScalar S>
  static SampledPoleSet<Size, S> sample(const S& bandwidth, const S& sample_time) {
    return SampledPoleSet<Size, S>::from_continuous(half_gain_poles<Size, S>(bandwidth),
                                                    sample_time);
  }

  /// Exactly half of the bandwidth parameterisation's. @return l, N x 1, row i in 1/s^(i+1)
  template <int Size, PlainScalar S>
  static Vector<S, Size> gain(const S& bandwidth) {
    return continuous_gain<Size, S>(bandwidth) / S(2);
  }

  /// A number that names the spec in an error.
  template <int Size, PlainScalar S>
  static S representative(const S& bandwidth) {
    return bandwidth;
  }
};

/// Told apart in snapshots.
template <>
inline constexpr std::uint32_t type_tag<HalfGainPoles> = make_type_tag<>("HalfGainPoles");

}  // namespace esokit
