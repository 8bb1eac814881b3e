/// @file
/// Any stable set of poles as a placement, complex poles in conjugate pairs. Not included by other
/// headers, because `<complex>` takes half as long to compile as a controller.
#pragma once

#include <cmath>
#include <complex>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/certificate/detail/gap_certificate.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/detail/model_placement.hpp>
#include <esokit/gain/feedback_gain.hpp>
#include <esokit/gain/half_gain.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/gain/sampled_gain.hpp>

namespace esokit {

/// Any set of poles of the sampled error, stored as contractions 1 - rho_i. Complex poles come with
/// their conjugates.
template <int Size, PlainScalar S>
struct SampledPoleSet {
  Array<std::complex<S>, Size> contractions{};  ///< a_i = 1 - rho_i

  /// From continuous-time poles p_i (1/s): rho_i = exp(p_i T). @param sample_time T, s
  static SampledPoleSet from_continuous(const Array<std::complex<S>, Size>& poles,
                                        S sample_time) noexcept {
    SampledPoleSet set;
    for (std::size_t i = 0; i < Size; ++i) {
      const auto a =
          detail::contraction(S(poles[i].real() * sample_time), S(poles[i].imag() * sample_time));
      set.contractions[i] = {a.real, a.imaginary};
    }
    return set;
  }

  /// From poles rho_i in the z-plane.
  static SampledPoleSet from_sampled(const Array<std::complex<S>, Size>& poles) noexcept {
    SampledPoleSet set;
    for (std::size_t i = 0; i < Size; ++i) set.contractions[i] = S(1) - poles[i];
    return set;
  }

  /// The poles for `samples` sample times in one: rho_i^samples.
  [[nodiscard]] SampledPoleSet power(unsigned samples) const noexcept {
    SampledPoleSet set;
    for (std::size_t i = 0; i < Size; ++i) {
      std::complex<S> base = contractions[i];
      std::complex<S> result(0);
      for (unsigned rest = samples; rest != 0; rest >>= 1u) {
        if ((rest & 1u) != 0) result += (S(1) - result) * base;
        base += (S(1) - base) * base;
      }
      set.contractions[i] = result;
    }
    return set;
  }

  /// beta_0 .. beta_N of prod_i (delta + a_i) = sum_j beta_j delta^(N-j).
  [[nodiscard]] Array<S, Size + 1> symmetric() const noexcept { return product<false>(); }
  /// b_0 .. b_N of prod_i (a_i s + rho_i), for `current_gain`.
  [[nodiscard]] PoleWeights<Size, S> weights() const noexcept { return product<true>(); }

 private:
  /// prod_i (a_i s + w_i), w_i = 1 or rho_i, by rising powers of s.
  template <bool WithPoles>
  [[nodiscard]] Array<S, Size + 1> product() const noexcept {
    Array<std::complex<S>, Size + 1> p{};
    p[0] = S(1);
    for (std::size_t i = 0; i < Size; ++i) {
      const std::complex<S> rest = WithPoles ? S(1) - contractions[i] : S(1);
      for (std::size_t j = i + 1; j > 0; --j) p[j] = p[j] * rest + p[j - 1] * contractions[i];
      p[0] *= rest;
    }
    Array<S, Size + 1> real{};
    for (std::size_t j = 0; j <= Size; ++j) real[j] = p[j].real();
    return real;
  }
};

/// Coefficients of prod_i (s - p_i) below s^N: poles of the error at p_i.
/// @param poles 1/s; complex ones with their conjugates
/// @return N x 1, row i in 1/s^i
template <int Size, PlainScalar S>
Vector<S, Size> continuous_gain(const Array<std::complex<S>, Size>& poles) {
  SampledPoleSet<Size, S> negative;
  for (std::size_t i = 0; i < Size; ++i) negative.contractions[i] = -poles[i];
  const auto coefficients = negative.symmetric();
  Vector<S, Size> gain;
  for (int i = 0; i < Size; ++i) gain(i) = coefficients[static_cast<std::size_t>(i) + 1];
  return gain;
}

/// Factors of a pole set; two real poles also make a pair.
template <int Size, PlainScalar S>
PoleFactors<Size, S> pole_factors(const SampledPoleSet<Size, S>& poles) noexcept {
  PoleFactors<Size, S> factors;
  factors.decay = S(1e3);
  for (const auto& a : poles.contractions) factors.unit = (std::max)(factors.unit, (std::abs)(a));
  std::size_t pair = 0;
  bool waits = false;
  S real{};
  for (const auto& a : poles.contractions) {
    const std::complex<S> x = a / factors.unit;
    // abs(rho)^2 = 1 - (2 Re a - abs(a)^2).
    const S lost = a.real() * (S(2) - a.real()) - a.imag() * a.imag();
    factors.decay = (std::min)(factors.decay, detail::decay_of(lost) / S(2));
    if (a.imag() > S(0)) {
      factors.sum[pair] = S(2) * x.real();
      factors.product[pair++] = std::norm(x);
    } else if (!(a.imag() < S(0))) {
      if (waits) {
        factors.sum[pair] = real + x.real();
        factors.product[pair++] = real * x.real();
      }
      real = x.real();
      waits = !waits;
    }
  }
  if (waits) factors.last = real;
  return factors;
}

/// Any stable set of poles p_i (1/s), complex ones in conjugate pairs.
struct PoleSet {
  static constexpr bool lists_poles = true;  ///< the config has a member `poles`

  template <int Size, PlainScalar S>
  using Spec = Array<std::complex<S>, Size>;  ///< p_i, 1/s

  template <int Size, PlainScalar S>
  using Sampled = SampledPoleSet<Size, S>;  ///< result of `sample`

  /// An error for the first pole that is not finite, not in the left half plane, or complex without
  /// its conjugate.
  /// @param set number of the set in an array of sets; the error then counts poles through all sets
  template <int Size, PlainScalar S>
  static Check<S> validate(const char* field, const Spec<Size, S>& poles, int set = -1) {
    const int first = set < 0 ? 0 : set * Size;
    Rules<S> rules;
    for (std::size_t i = 0; i < Size; ++i) {
      const int index = first + static_cast<int>(i);
      const S real = poles[i].real();
      const S imaginary = poles[i].imag();
      rules.demand(is_finite(real), field, real, "must have a finite real part", index)
          .demand(is_finite(imaginary), field, imaginary, "must have a finite imaginary part",
                  index)
          .demand(real < S(0), field, real, "must have a negative real part", index);
    }
    for (std::size_t i = 0; i < Size; ++i) {
      if (poles[i].imag() == S(0)) continue;
      int balance = 0;
      for (std::size_t j = 0; j < Size; ++j) {
        balance += poles[j] == poles[i] ? 1 : 0;
        balance -= poles[j] == std::conj(poles[i]) ? 1 : 0;
      }
      rules.demand(balance == 0, field, poles[i].imag(),
                   "is complex without its conjugate in the set", first + static_cast<int>(i));
    }
    return rules;
  }

  /// Poles at exp(p_i T). @param poles p_i, 1/s @param sample_time T, s
  template <int Size, PlainScalar S>
  static SampledPoleSet<Size, S> sample(const Spec<Size, S>& poles, const S& sample_time) {
    return SampledPoleSet<Size, S>::from_continuous(poles, sample_time);
  }

  /// After which steps over several samples errors decay; see
  /// gain/certificate/detail/gap_certificate.hpp.
  template <int Size, PlainScalar S>
  static detail::GapRecovery<S> recovery(const SampledPoleSet<Size, S>& poles) noexcept {
    using Fine = std::conditional_t<std::is_same_v<S, float>, double, S>;
    SampledPoleSet<Size, Fine> fine;
    for (std::size_t i = 0; i < Size; ++i) {
      fine.contractions[i] = {static_cast<Fine>(poles.contractions[i].real()),
                              static_cast<Fine>(poles.contractions[i].imag())};
    }
    const auto factors = pole_factors(fine);
    const auto of = detail::recovery_by_square<Size, Fine>(fine, factors.unit, factors.decay);
    return {of.longest_step, of.counted, static_cast<S>(of.per_octave), static_cast<S>(of.free)};
  }

  /// Gain of the continuous observer. @return l, N x 1, row i in 1/s^(i+1)
  template <int Size, PlainScalar S>
  static Vector<S, Size> gain(const Spec<Size, S>& poles) {
    return continuous_gain<Size, S>(poles);
  }

  /// The number that stands for the spec in an error.
  template <int Size, PlainScalar S>
  static S representative(const Spec<Size, S>& poles) {
    return poles[0].real();
  }
};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<PoleSet> = make_type_tag<>("PoleSet");

/// Gains for the poles `rho_i = 1 - contractions_i` of the sampled loop under a held input.
/// @param contractions 1 - rho_i; complex ones with their conjugates @param sample_time T, s
/// @return k_0 .. k_(n-1), k_i in 1/s^(n-i)
template <int Order, PlainScalar S>
Array<S, Order> sampled_feedback_gain(const Array<std::complex<S>, Order>& contractions,
                                      const S& sample_time) {
  const SampledPoleSet<Order, S> poles{contractions};
  return detail::held_input_feedback<Order, S>(poles.symmetric(), S(1) / sample_time);
}

/// The poles s_k of half the gains of the bandwidth parameterisation, 1/s, in conjugate pairs, see
/// gain/half_gain.hpp. @param bandwidth omega, rad/s
template <int Size, PlainScalar S>
Array<std::complex<S>, Size> half_gain_poles(const S& bandwidth) {
  Array<std::complex<S>, Size> poles{};
  for (int k = 0; 2 * k < Size; ++k) {
    const std::complex<S> pole(-bandwidth / S(2),
                               detail::half_gain_imaginary<Size, S>(bandwidth, k));
    poles[static_cast<std::size_t>(k)] = pole;
    poles[static_cast<std::size_t>(Size - 1 - k)] = std::conj(pole);
  }
  return poles;
}

}  // namespace esokit
