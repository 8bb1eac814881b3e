/// @file
/// Half-gain tuning (G. Herbst, A.-J. Hempel, T. Goehrt, S. Streif, "Half-gain tuning for active
/// disturbance rejection control", IFAC-PapersOnLine 53 (2020) 1492-1497): half the gains of the
/// bandwidth parameterisation, with about the same closed loop and less noise on u.
///
/// Half gains turn (s + omega)^N into ((s + omega)^N + s^N) / 2, whose roots are
///
///     s_k = -omega/2 (1 + j cot(theta_k / 2)),  theta_k = pi (2k + 1) / N,
///
/// so it is an ordinary pole set. In the sampled observer the poles are at exp(s_k T): stable for
/// every omega T, while halved sampled gains are not (for N = 4 they are unstable from omega T =
/// 0.88). For T -> 0 both agree.
#pragma once

#include <cmath>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/gain/placement.hpp>
#include <numbers>

namespace esokit {

namespace detail {

/// -omega/2 cot(theta_k / 2), the imaginary part of s_k, 1/s; its conjugate is s_(N-1-k).
template <int Size, PlainScalar S>
S half_gain_imaginary(const S& bandwidth, int k) {
  // For odd N the middle pole is real: cot(pi/2) = 0, which rounding would miss.
  if (2 * k + 1 == Size) return S(0);
  const S angle = std::numbers::pi_v<S> * static_cast<S>(2 * k + 1) / static_cast<S>(2 * Size);
  return -bandwidth / S(2) / std::tan(angle);
}

}  // namespace detail

/// Poles of the sampled error in conjugate pairs and, if their number is odd, one real pole; stored
/// as contractions 1 - rho. In real arithmetic, because std::complex takes 4 KiB of flash.
template <int Size, PlainScalar S>
struct SampledPolePairs {
  using Contraction = detail::Contraction<S>;   ///< 1 - rho
  static constexpr int count = (Size + 1) / 2;  ///< pairs; the last may be the real pole
  Array<Contraction, count> pairs{};            ///< one of each pair

  /// The poles for `samples` sample times in one: rho_i^samples.
  [[nodiscard]] constexpr SampledPolePairs power(unsigned samples) const noexcept {
    SampledPolePairs result;
    for (std::size_t i = 0; i < count; ++i) {
      Contraction base = pairs[i];
      for (unsigned rest = samples; rest != 0; rest >>= 1u) {
        if ((rest & 1u) != 0) result.pairs[i] = after(result.pairs[i], base);
        base = after(base, base);
      }
    }
    return result;
  }

  /// abs(rho_1)^2. Of half gains it is exp(-omega_o T), and that of all poles.
  [[nodiscard]] constexpr S decay() const noexcept {
    const auto& [real, imaginary] = pairs[0];
    return (S(1) - real) * (S(1) - real) + imaginary * imaginary;
  }

  /// beta_0 .. beta_N of prod_i (delta + a_i) = sum_j beta_j delta^(N-j).
  [[nodiscard]] constexpr Array<S, Size + 1> symmetric() const noexcept { return product<false>(); }

  /// b_0 .. b_N of prod_i (a_i s + rho_i), for `current_gain`.
  [[nodiscard]] constexpr PoleWeights<Size, S> weights() const noexcept { return product<true>(); }

 private:
  /// Contraction of the product of two poles: 1 - (1 - a)(1 - b), without cancellation.
  static constexpr Contraction after(const Contraction& a, const Contraction& b) noexcept {
    const S rest = S(1) - a.real;
    return {a.real + (rest * b.real + a.imaginary * b.imaginary),
            a.imaginary + (rest * b.imaginary - a.imaginary * b.real)};
  }

  /// prod_i (a_i s + w_i), w_i = 1 or rho_i, by rising powers of s.
  template <bool WithPoles>
  [[nodiscard]] constexpr Array<S, Size + 1> product() const noexcept {
    Array<S, Size + 1> p{};
    p[0] = S(1);
    for (std::size_t i = 0; i < count; ++i) {
      const Contraction& a = pairs[i];
      const S square = a.imaginary * a.imaginary;
      const S rest = WithPoles ? S(1) - a.real : S(1);
      if (2 * i + 1 == Size) {  // the real one
        for (std::size_t j = Size; j > 0; --j) p[j] = p[j] * rest + p[j - 1] * a.real;
        p[0] *= rest;
        break;
      }
      const S high = a.real * a.real + square;
      const S middle = S(2) * (a.real * rest - (WithPoles ? square : S(0)));
      const S low = rest * rest + (WithPoles ? square : S(0));
      for (std::size_t j = 2 * i + 2; j > 1; --j) {
        p[j] = p[j] * low + p[j - 1] * middle + p[j - 2] * high;
      }
      p[1] = p[1] * low + p[0] * middle;
      p[0] *= low;
    }
    return p;
  }
};

/// Placement of an observer with half the gains of the bandwidth parameterisation.
struct HalfGainPoles : BandwidthPlacement {
  template <int Size, PlainScalar S>
  using Sampled = SampledPolePairs<Size, S>;  ///< what `sample` gives

  /// Poles at exp(s_k T). @param bandwidth omega_o, rad/s @param sample_time T, s
  template <int Size, PlainScalar S>
  static SampledPolePairs<Size, S> sample(const S& bandwidth, const S& sample_time) {
    SampledPolePairs<Size, S> poles;
    const S x = -bandwidth / S(2) * sample_time;
    for (int k = 0; 2 * k < Size; ++k) {
      const S phi = detail::half_gain_imaginary<Size, S>(bandwidth, k) * sample_time;
      poles.pairs[static_cast<std::size_t>(k)] = detail::contraction(x, phi);
    }
    return poles;
  }

  /// After which steps over several samples errors decay.
  template <int Size, PlainScalar S>
  static constexpr auto recovery(const SampledPolePairs<Size, S>& poles) noexcept {
    return detail::recovery_of<Size, detail::half_gain_steps, detail::half_gain_recovery>(
        poles.decay());
  }

  /// Exactly half the gain of the bandwidth parameterisation. @return l, N x 1, row i in 1/s^(i+1)
  template <int Size, PlainScalar S>
  static Vector<S, Size> gain(const S& bandwidth) {
    return continuous_gain<Size, S>(bandwidth) / S(2);
  }
};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<HalfGainPoles> = make_type_tag<>("HalfGainPoles");

}  // namespace esokit
