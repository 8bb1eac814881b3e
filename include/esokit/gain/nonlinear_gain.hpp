/// @file
/// The nonlinear gain law: bandwidth gains times an even function k of the innovation, kept between
/// two limits; and the functions k of the literature.
#pragma once

#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <esokit/math/fal.hpp>
#include <esokit/math/power.hpp>
#include <limits>

namespace esokit {

/// What an even gain can do besides k(x), declared in a member `static constexpr EvenGainTraits
/// traits{..}`.
struct EvenGainTraits {
  bool validates = false;  ///< `validate() const` gives the error of a bad parameter, as a Check
  bool prepares = false;   ///< `prepared() const` gives a function object that is faster to call
};

namespace detail {

ESOKIT_MEMBER_NAME(prepared)

template <class Shape>
inline constexpr EvenGainTraits even_gain_traits = declared_traits<Shape, EvenGainTraits>;

}  // namespace detail

/// `validate()` exists if and only if `traits.validates` declares it.
template <class Shape, class S>
concept ChecksAsDeclared = detail::as_declared(
    detail::even_gain_traits<Shape>.validates, detail::names_validate<Shape>,
    requires(const Shape& k) {
      { k.validate() } -> std::same_as<Check<S>>;
    });

/// `prepared()` exists if and only if `traits.prepares` declares it.
template <class Shape, class S>
concept PreparesAsDeclared = detail::as_declared(
    detail::even_gain_traits<Shape>.prepares, detail::names_prepared<Shape>,
    requires(const Shape& k, const S& x) {
      { k.prepared()(x) } -> std::convertible_to<S>;
    });

/// An even gain k(x), x = |e| / error_scale > 0, dimensionless: the correction is l k(x) e.
///
/// Any copyable function object can be used. What else it can do it declares in EvenGainTraits.
template <class Shape, class S>
concept EvenGain = std::copyable<Shape> && requires(const Shape& k, const S& x) {
  { k(x) } -> std::convertible_to<S>;
} && DeclaresTraits<Shape, EvenGainTraits> && ChecksAsDeclared<Shape, S> &&
    PreparesAsDeclared<Shape, S>;

namespace detail {
template <class Shape, class S>
consteval bool is_an_even_gain() {
  static_assert(EvenGain<Shape, S>,
                "esokit: a nonlinear gain is the type of a function k(e) that returns a number, "
                "and declares in its `traits` what else it has: the concept EvenGain");
  return EvenGain<Shape, S>;
}
}  // namespace detail

/// k(x) = K_alpha x^(alpha-1) + K_beta x^beta: g(e) / e of the NHOESO paper, (10). The default is k
/// = 1, which makes the observer linear.
template <class S>
requires(detail::is_a_scalar<S>()) struct PowerSumGain {
  static constexpr EvenGainTraits traits{.validates = true, .prepares = true};  ///< besides k
  template <class T>
  using with_scalar = PowerSumGain<T>;  ///< the same with another scalar

  S gain_alpha = S(1.0);  ///< K_alpha >= 0
  S alpha = S(1.0);       ///< alpha > 0; below 1, k is infinite at e = 0
  S gain_beta = S(0.0);   ///< K_beta >= 0
  S beta = S(1.0);        ///< beta >= 0

  /// k with its exponents classified, see Power.
  struct Prepared {
    static constexpr int data_members = 4;  ///< for snapshots

    S gain_alpha;    ///< K_alpha
    S gain_beta;     ///< K_beta
    Power<S> alpha;  ///< x^(alpha-1)
    Power<S> beta;   ///< x^beta

    /// k(x), x > 0.
    [[nodiscard]] S operator()(const S& x) const noexcept {
      return gain_alpha * alpha(x) + gain_beta * beta(x);
    }
  };

  /// A function object that is quicker to call.
  [[nodiscard]] constexpr Prepared prepared() const noexcept {
    return {gain_alpha, gain_beta, Power<S>(alpha - S(1.0)), Power<S>(beta)};
  }

  /// k(x), x > 0.
  [[nodiscard]] S operator()(const S& x) const noexcept { return prepared()(x); }

  /// An error for a parameter out of its range; called by `make` of the observer.
  [[nodiscard]] Check<S> validate() const {
    return Rules<S>{}
        .not_negative("shape.gain_alpha", gain_alpha)
        .positive("shape.alpha", alpha)
        .not_negative("shape.gain_beta", gain_beta)
        .not_negative("shape.beta", beta);
  }
};

/// Distinguishes the type in snapshots.
template <Scalar S>
inline constexpr std::uint32_t type_tag<PowerSumGain<S>> = make_type_tag<S>("PowerSumGain");

/// k(x) = K max(x, delta)^(a-1): K fal(e) / e of Han's observers.
template <Scalar S>
struct FalGain {
  static constexpr EvenGainTraits traits{.validates = true, .prepares = true};  ///< besides k
  template <class T>
  using with_scalar = FalGain<T>;  ///< the same with another scalar

  S gain = S(1.0);          ///< K >= 0
  S exponent = S(0.5);      ///< a > 0
  S linear_width = S(1.0);  ///< delta > 0, in units of the error scale

  /// k with its exponent classified, see Power.
  struct Prepared {
    static constexpr int data_members = 2;  ///< for snapshots

    S gain;      ///< K
    Fal<S> fal;  ///< of unit gain

    /// k(x), x >= 0.
    [[nodiscard]] S operator()(const S& x) const noexcept { return gain * fal.gain(x); }
  };

  /// A function object that is quicker to call.
  [[nodiscard]] constexpr Prepared prepared() const noexcept {
    return {gain, Fal<S>(exponent, linear_width)};
  }

  /// k(x), x > 0.
  [[nodiscard]] S operator()(const S& x) const noexcept { return prepared()(x); }

  /// An error for a parameter out of its range; called by `make` of the observer.
  [[nodiscard]] Check<S> validate() const {
    return Rules<S>{}
        .not_negative("shape.gain", gain)
        .positive("shape.exponent", exponent)
        .positive("shape.linear_width", linear_width);
  }
};

/// Distinguishes the type in snapshots.
template <Scalar S>
inline constexpr std::uint32_t type_tag<FalGain<S>> = make_type_tag<S>("FalGain");

namespace detail {

template <class Shape>
constexpr auto prepared(const Shape& shape) noexcept {
  if constexpr (even_gain_traits<Shape>.prepares) {
    return shape.prepared();
  } else {
    return shape;
  }
}

/// 2^exponent at compile time.
template <class T>
constexpr T power_of_two(int exponent) noexcept {
  T value(1);
  for (int i = 0; i < exponent; ++i) value = value * T(2);
  for (int i = 0; i > exponent; --i) value = value / T(2);
  return value;
}

/// Smaller magnitudes are replaced by this one, because k may be infinite at zero.
template <Scalar S>
constexpr S least_magnitude() noexcept {
  // A named constant, so that no compiler computes the power at run time.
  constexpr auto least =
      power_of_two<TableScalar<S>>(std::numeric_limits<TableScalar<S>>::min_exponent / 3);
  return S(least);
}

/// k(|e| / scale) within its limits; common to the sampled and the continuous law.
template <Scalar S, class Shape>
struct LimitedGain {
  static constexpr int data_members = 4;
  decltype(prepared(std::declval<const Shape&>())) function;
  S inverse_scale;
  S lower;
  S upper;

  [[nodiscard]] ESOKIT_INLINE constexpr S operator()(const S& e) const noexcept {
    const S x = absolute(e) * inverse_scale;
    const S k = function(select(least_magnitude<S>() < x, x, least_magnitude<S>()));
    // In this order a NaN becomes `upper`.
    const S from_above = select(k < upper, k, upper);
    return select(lower < from_above, from_above, lower);
  }
};

}  // namespace detail

/// Gain law of NonlinearEso: k(|e| / error_scale) times constant bandwidth gains, with k limited to
/// `gain_min` .. `gain_max`.
///
/// After a gap of M samples the linear gain for M T is used with k = 1, because limits certified
/// for T need not be stable for M T.
template <int Size, Scalar S, class Shape = PowerSumGain<S>>
requires EvenGain<Shape, S>
class NonlinearGain {
 public:
  /// What the law can do besides `gain`.
  static constexpr GainLawTraits traits{.kind = GainKind::factored, .bridges_gaps = true};

  using Linear = ConstantGain<Size, S>;  ///< the gain for k = 1
  template <class T>
  using with_scalar =
      NonlinearGain<Size, T, typename detail::ForScalar<Shape, T>::type>;  ///< with another scalar

  /// @param linear the bandwidth gains @param shape k @param error_scale > 0, unit of y
  /// @param gain_min, gain_max limits of k
  constexpr NonlinearGain(const Linear& linear, const Shape& shape, const S& error_scale,
                          const S& gain_min, const S& gain_max) noexcept
      : linear_(linear),
        factor_{detail::prepared(shape), S(1.0) / error_scale, gain_min, gain_max} {}

  /// k(e) l, scaled.
  [[nodiscard]] ESOKIT_INLINE constexpr ScaledGain<Size, S> gain(const S& e) const noexcept {
    const S k = factor_(e);
    const auto& l = linear_.gain_before_measurement();
    ScaledGain<Size, S> result;
    detail::unroll<Size>([&](auto r)
                             ESOKIT_INLINE_LAMBDA { std::get<r>(result) = k * std::get<r>(l); });
    return result;
  }

  /// The linear gain for the whole gap.
  [[nodiscard]] ScaledGain<Size, S> gap_gain(const S& e, unsigned samples) const noexcept {
    return linear_.gap_gain(e, samples);
  }

  /// The largest number of missing samples that is bridged, at most `asked`.
  [[nodiscard]] constexpr int longest_gap(int asked) const noexcept {
    return detail::half_gap(linear_, asked);
  }

  /// The gain for k = 1, scaled: gain(e) is factor(e) times this.
  [[nodiscard]] constexpr const ScaledGain<Size, S>& linear_gain() const noexcept {
    return linear_.gain_before_measurement();
  }

  /// k for an innovation, within its limits.
  [[nodiscard]] constexpr S factor(const S& e) const noexcept { return factor_(e); }

  /// Limits of k.
  /// @{
  [[nodiscard]] constexpr const S& gain_min() const noexcept { return factor_.lower; }
  [[nodiscard]] constexpr const S& gain_max() const noexcept { return factor_.upper; }
  /// @}

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 2;

  Linear linear_;
  detail::LimitedGain<S, Shape> factor_;
};

/// Distinguishes the type in snapshots.
template <int Size, Scalar S, class Shape>
inline constexpr std::uint32_t type_tag<NonlinearGain<Size, S, Shape>> =
    make_type_tag<S, Shape>("NonlinearGain", Size);

}  // namespace esokit
