/// @file
/// The gain laws of the continuous observers: what such a law has to be, and those of the named
/// observers.
#pragma once

#include <cmath>
#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/declared_traits.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/nonlinear_gain.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/gain/switched_gain.hpp>
#include <esokit/math/combinatorics.hpp>

namespace esokit {

/// What a gain law of a continuous observer can do besides `gain(t, e)`, declared in a member
/// `static constexpr ContinuousGainLawTraits traits{..}`.
struct ContinuousGainLawTraits {
  /// `begin_step(t, e)`, called at step boundaries of a simulation; the only place where a switched
  /// law may change its mode.
  bool begins_steps = false;
};

namespace detail {

ESOKIT_MEMBER_NAME(begin_step)

}  // namespace detail

/// `begin_step(t, e)` exists if and only if `traits.begins_steps` declares it.
template <class Law, class S>
concept BeginsStepsAsDeclared = detail::as_declared(
    detail::declared_traits<Law, ContinuousGainLawTraits>.begins_steps,
    detail::names_begin_step<Law>, requires(Law& law, const S& x) { law.begin_step(x, x); });

/// A gain law of a continuous observer: `gain(t, e) const` in physical units, N x 1. Everything
/// else is declared, see ContinuousGainLawTraits.
template <class Law, int Size, class S>
concept ContinuousGainLaw = std::copyable<Law> && requires(const Law& law, const S& x) {
  { law.gain(x, x) } -> std::convertible_to<Vector<S, Size>>;
} && DeclaresTraits<Law, ContinuousGainLawTraits> && BeginsStepsAsDeclared<Law, S>;

/// Constant gain of a continuous observer, in physical units.
template <int Size, Scalar S, class Placement = EqualPoles>
class ContinuousConstantGain {
 public:
  using Spec = typename Placement::template Spec<Size, S>;  ///< bandwidth or poles

  /// The gain for a set of poles.
  /// @param field name of the config member that holds `spec`, for the error
  /// @param spec poles of the error, checked by the placement
  /// @param index element of `field` that the error names, -1: none
  /// @return error for a spec that the placement refuses, or a gain that the scalar cannot hold
  static Expected<ContinuousConstantGain, Error<S>> make(const char* field, const Spec& spec,
                                                         int index = -1) {
    Rules<S> rules;
    rules.all_of(Placement::template validate<Size, S>(field, spec, index));
    if (!rules) return rules.error();
    ContinuousConstantGain law;
    law.gain_ = Placement::template gain<Size, S>(spec);
    rules.representable(field, Placement::template representative<Size, S>(spec),
                        law.gain_(Size - 1), "gives a gain that the scalar cannot hold", index);
    if (!rules) return rules.error();
    return law;
  }

  /// l, N x 1, row i in 1/s^(i+1).
  [[nodiscard]] const Vector<S, Size>& gain(const S&, const S&) const noexcept { return gain_; }

 private:
  ContinuousConstantGain() = default;

  Vector<S, Size> gain_;
};

/// SwitchedGain of a continuous observer; the mode changes at step boundaries only.
template <int Size, Scalar S>
class ContinuousSwitchedGain {
 public:
  static constexpr ContinuousGainLawTraits traits{.begins_steps =
                                                      true};  ///< what it can do besides `gain`

  /// @param shrinking, otherwise l, N x 1, row i in 1/s^(i+1)
  ContinuousSwitchedGain(const Vector<S, Size>& shrinking, const Vector<S, Size>& otherwise,
                         SignReading reading = SignReading::magnitude)
      : shrinking_(shrinking),
        otherwise_(otherwise),
        previous_(detail::nothing_watched<S>(reading)),
        reading_(reading) {}

  /// Compares e with that of the last step and selects the gain set of this step.
  void begin_step(const S&, const S& e) noexcept {
    const S now = detail::watched(reading_, e);
    is_shrinking_ = now < previous_;
    previous_ = now;
  }

  /// l, N x 1, row i in 1/s^(i+1); constant over a whole step.
  [[nodiscard]] const Vector<S, Size>& gain(const S&, const S&) const noexcept {
    return is_shrinking_ ? shrinking_ : otherwise_;
  }

 private:
  Vector<S, Size> shrinking_;
  Vector<S, Size> otherwise_;
  S previous_;
  SignReading reading_;
  bool is_shrinking_ = false;
};

/// NonlinearGain of a continuous observer, in physical units.
template <int Size, Scalar S, class Shape = PowerSumGain<S>>
requires EvenGain<Shape, S>
class ContinuousNonlinearGain {
 public:
  /// @param linear l for k = 1, N x 1, row i in 1/s^(i+1) @param shape k
  /// @param error_scale > 0, unit of y @param gain_min, gain_max limits of k
  ContinuousNonlinearGain(const Vector<S, Size>& linear, const Shape& shape, const S& error_scale,
                          const S& gain_min, const S& gain_max)
      : linear_(linear),
        factor_{detail::prepared(shape), S(1.0) / error_scale, gain_min, gain_max} {}

  /// k(e) l, N x 1, row i in 1/s^(i+1).
  [[nodiscard]] Vector<S, Size> gain(const S&, const S& e) const { return linear_ * factor_(e); }

 private:
  Vector<S, Size> linear_;
  detail::LimitedGain<S, Shape> factor_;
};

/// Falling-bandwidth gain of the continuous observer: L_j(t) = C(N,j) P_j(t). Here P_0 = 1 and
/// P_{j+1} = (lambda + N q v) P_j + q v (1 + v) dP_j/dv, v = 1 / (e^{qt} - 1).
template <int Size, Scalar S>
class ContinuousAlgebraicGain {
 public:
  /// @param bandwidth lambda >= 0, rad/s @param shift q >= 0, rad/s
  ContinuousAlgebraicGain(const S& bandwidth, const S& shift)
      : bandwidth_(bandwidth), shift_(shift) {}

  /// P_0 .. P_N at t > 0 (s); P_j in 1/s^j. All terms are positive.
  [[nodiscard]] Array<S, Size + 1> factors(const S& t) const {
    using std::expm1;
    // With w = q v, which is 1/t for q = 0: P_{j+1} = (lambda + N w) P_j + w (q + w) dP_j/dw.
    const auto shifting = shift_ > S(0.0);
    const S growth = select(shifting, S(expm1(S(shift_ * t))), t);
    const S w = select(shifting, shift_, S(1.0)) / growth;
    Array<S, Size + 1> polynomial{};
    for (S& c : polynomial) c = S(0.0);
    polynomial[0] = S(1.0);
    Array<S, Size + 1> factors{};
    factors[0] = S(1.0);
    for (int j = 1; j <= Size; ++j) {
      for (int r = j; r >= 0; --r) {
        const auto i = static_cast<std::size_t>(r);
        polynomial[i] = (bandwidth_ + detail::integer<S>(r) * shift_) * polynomial[i];
        if (r > 0) {
          polynomial[i] = polynomial[i] + detail::integer<S>(Size + r - 1) * polynomial[i - 1];
        }
      }
      S value(0.0);
      for (int r = j; r >= 0; --r) value = value * w + polynomial[static_cast<std::size_t>(r)];
      factors[static_cast<std::size_t>(j)] = value;
    }
    return factors;
  }

  /// L(t), N x 1, for t > 0 (s); infinite at t = 0.
  [[nodiscard]] Vector<S, Size> gain(const S& t, const S&) const {
    const auto p = factors(t);
    Vector<S, Size> gain;
    for (int j = 1; j <= Size; ++j) {
      gain(j - 1) =
          S(binomial_table<Size, detail::TableScalar<S>>[Size][static_cast<std::size_t>(j)]) *
          p[static_cast<std::size_t>(j)];
    }
    return gain;
  }

 private:
  S bandwidth_;
  S shift_;
};

}  // namespace esokit
