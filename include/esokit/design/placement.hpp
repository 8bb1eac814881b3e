/// @file
/// Where the poles of the estimation error go: all in one place, or any stable set.
///
/// A placement is what a linear observer's config names: its `Spec`, the check of it, and the gains
/// it gives in both time domains.
#pragma once

#include <complex>
#include <esokit/core/check.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/design/continuous_gain.hpp>
#include <esokit/design/sampled_gain.hpp>

namespace esokit {

/// All N poles at -omega_o (at exp(-omega_o T) when sampled): the bandwidth parameterisation.
struct EqualPoles {
  template <int Size, Scalar S>
  using Spec = S;  ///< omega_o, rad/s

  template <int Size, Scalar S>
  using Sampled = EqualSampledPoles<Size, S>;  ///< what `sample` gives

  /// Error of a bandwidth that is not finite or not positive.
  template <int Size, Scalar S>
  static Check<S> check(const char* field, const S& bandwidth, int index = -1) {
    return Rules<S>{}.positive(field, bandwidth, index);
  }

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

  /// A number that names the spec in an error.
  template <int Size, Scalar S>
  static S representative(const S& bandwidth) {
    return bandwidth;
  }
};

/// Told apart in snapshots.
template <>
inline constexpr std::uint32_t type_tag<EqualPoles> = make_type_tag<>("EqualPoles");

/// Any stable set of poles p_i (1/s), complex ones in conjugate pairs.
struct PoleSet {
  template <int Size, PlainScalar S>
  using Spec = Array<std::complex<S>, Size>;  ///< p_i, 1/s

  template <int Size, PlainScalar S>
  using Sampled = SampledPoleSet<Size, S>;  ///< what `sample` gives

  /// Error of the first pole that is not finite, not in the left half plane, or complex without its
  /// conjugate.
  /// @param set number of the set in an array of sets; the error then counts poles through all sets
  template <int Size, PlainScalar S>
  static Check<S> check(const char* field, const Spec<Size, S>& poles, int set = -1) {
    const int first = set < 0 ? 0 : set * Size;
    Rules<S> rules;
    for (std::size_t i = 0; i < Size; ++i) {
      const int index = first + static_cast<int>(i);
      const S real = poles[i].real();
      const S imaginary = poles[i].imag();
      rules.require(is_finite(real), field, real, "must have a finite real part", index)
          .require(is_finite(imaginary), field, imaginary, "must have a finite imaginary part",
                   index)
          .require(real < S(0), field, real, "must have a negative real part", index);
    }
    for (std::size_t i = 0; i < Size; ++i) {
      if (poles[i].imag() == S(0)) continue;
      int balance = 0;
      for (std::size_t j = 0; j < Size; ++j) {
        balance += poles[j] == poles[i] ? 1 : 0;
        balance -= poles[j] == std::conj(poles[i]) ? 1 : 0;
      }
      rules.require(balance == 0, field, poles[i].imag(),
                    "is complex without its conjugate in the set", first + static_cast<int>(i));
    }
    return rules;
  }

  /// Poles at exp(p_i T). @param poles p_i, 1/s @param sample_time T, s
  template <int Size, PlainScalar S>
  static SampledPoleSet<Size, S> sample(const Spec<Size, S>& poles, const S& sample_time) {
    return SampledPoleSet<Size, S>::from_continuous(poles, sample_time);
  }

  /// Gain of the continuous observer. @return l, N x 1, row i in 1/s^(i+1)
  template <int Size, PlainScalar S>
  static Vector<S, Size> gain(const Spec<Size, S>& poles) {
    return continuous_gain<Size, S>(poles);
  }

  /// A number that names the spec in an error.
  template <int Size, PlainScalar S>
  static S representative(const Spec<Size, S>& poles) {
    return poles[0].real();
  }
};

/// Told apart in snapshots.
template <>
inline constexpr std::uint32_t type_tag<PoleSet> = make_type_tag<>("PoleSet");

}  // namespace esokit
