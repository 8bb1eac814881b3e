/// @file
/// What a scalar must offer, and the functions that SIMD packs and autodiff types supply:
/// `is_finite`, `select`, `all` and the elementary functions, all found by argument-dependent
/// lookup (ADL).
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <esokit/core/language.hpp>
#include <limits>
#include <type_traits>
#include <utility>

/// Extended state observers, the controllers built on them, their design and their analysis.
namespace esokit {

/// A scalar whose comparisons give a bool on which code can branch: float, double, long double.
template <class T>
concept PlainScalar = std::floating_point<T>;

namespace detail {

/// Returns `value` in a way that Clang cannot see through. With -ffinite-math-only Clang may remove
/// even a bit test on a parameter; GCC does not.
template <class T>
constexpr T opaque(T value) noexcept {
#if defined(__clang__) && defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
  if (!std::is_constant_evaluated()) {
    const volatile T hidden = value;
    return hidden;
  }
#endif
  return value;
}

/// Infinity, made from its bits: Clang 19 warns about the use of std::numeric_limits::infinity()
/// under -ffast-math.
template <class S>
constexpr S unbounded() noexcept {
  return S(std::bit_cast<float>(0x7f800000u));
}

constexpr bool finite_bits(float value) noexcept {
  return (std::bit_cast<std::uint32_t>(opaque(value)) & 0x7f800000u) != 0x7f800000u;
}

constexpr bool finite_bits(double value) noexcept {
  constexpr std::uint64_t exponent = 0x7ff0000000000000u;
  return (std::bit_cast<std::uint64_t>(opaque(value)) & exponent) != exponent;
}

inline bool finite_bits(long double value) noexcept {
  constexpr int digits = std::numeric_limits<long double>::digits;
  static_assert(digits == 53 || digits == 64 || digits == 113, "unknown long double format");
  if constexpr (digits == 53) {
    return finite_bits(static_cast<double>(value));
  } else {
    static_assert(std::endian::native == std::endian::little, "unknown long double byte order");
    unsigned char bytes[sizeof(long double)];
    std::memcpy(bytes, &value, sizeof value);
    constexpr int top = digits == 64 ? 8 : 14;
    const unsigned exponent =
        static_cast<unsigned>(bytes[top]) | (static_cast<unsigned>(bytes[top + 1]) << 8u);
    return (exponent & 0x7fffu) != 0x7fffu;
  }
}

}  // namespace detail

/// Neither NaN nor infinite. Tests bits, so it also holds under -ffast-math. A pack overloads it in
/// its own namespace and returns a mask.
template <PlainScalar T>
constexpr bool is_finite(T value) noexcept {
  return detail::finite_bits(value);
}

namespace detail {

/// False if float is computed in software.
#if defined(__SOFTFP__) || defined(__riscv_float_abi_soft)
inline constexpr bool has_float_unit = false;
#else
inline constexpr bool has_float_unit = true;
#endif

/// `is_finite` of a number that is NaN or has no sign: one instruction less.
/// @{
template <class S>
constexpr auto is_finite_magnitude(const S& value) noexcept {
  return is_finite(value);
}
constexpr bool is_finite_magnitude(float value) noexcept {
  return std::bit_cast<std::uint32_t>(opaque(value)) < 0x7f800000u;
}
constexpr bool is_finite_magnitude(double value) noexcept {
  return std::bit_cast<std::uint64_t>(opaque(value)) < 0x7ff0000000000000u;
}
/// @}

}  // namespace detail

/// `condition ? a : b`, element by element for packs.
template <PlainScalar T>
constexpr T select(bool condition, T a, T b) noexcept {
  return condition ? a : b;
}

namespace detail {

/// `a < b ? b : a` and `b < a ? b : a`: one instruction, whose first operand is b.
/// @{
template <class T>
constexpr T upper_one(const T& a, const T& b) noexcept {
  if constexpr (requires { T::larger_of(a, b); }) {
    return T::larger_of(a, b);
  } else {
    return select(a < b, b, a);
  }
}
template <class T>
constexpr T lower_one(const T& a, const T& b) noexcept {
  if constexpr (requires { T::smaller_of(a, b); }) {
    return T::smaller_of(a, b);
  } else {
    return select(b < a, b, a);
  }
}
/// @}

}  // namespace detail

/// True if every lane of a mask is set; a plain scalar has one lane.
constexpr bool all(bool condition) noexcept { return condition; }

/// How many numbers a scalar holds: 1, or the lanes of a pack. A pack type specialises it and gives
/// its numbers as `x[i]`.
template <class T>
inline constexpr int lane_count = 1;

/// Whether a scalar records its operations, see target/recording_scalar.hpp. A step leaves out no
/// part of its work for such a scalar, whatever the numbers are: else the list would lack it.
template <class T>
inline constexpr bool records = false;

/// A comparison gives a bool; or it gives a mask, and the type has specialised `lane_count`.
template <class T>
concept DeclaresItsLanes =
    std::convertible_to<decltype(std::declval<const T&>() < std::declval<const T&>()), bool> ||
    requires(T x, const T& constant) {
  requires(lane_count<T> > 1);
  requires std::floating_point<std::remove_cvref_t<decltype(constant[0])>>;
  x[0] = constant[0];
};

/// A scalar of the library: float, double, long double, a SIMD pack or an autodiff type.
///
/// Arithmetic, construction from a double, comparison (bool or mask), and by ADL
/// `is_finite(x)`, `select(mask, a, b)`, `all(mask)`; `make` also needs `exp` and `expm1`.
///
/// A pack, whose comparisons give a mask, also specialises `lane_count` and gives its numbers as
/// `x[i]`: if a lane has a fault, the library processes the lanes one by one. `Pack` is such a
/// type.
template <class T>
concept Scalar = std::copyable<T> && requires(const T a, const T b) {
  T(1.0);
  T{};
  { a + b } -> std::convertible_to<T>;
  { a - b } -> std::convertible_to<T>;
  { a* b } -> std::convertible_to<T>;
  { a / b } -> std::convertible_to<T>;
  { -a } -> std::convertible_to<T>;
  { all(is_finite(a)) } -> std::convertible_to<bool>;
  { all(a < b) } -> std::convertible_to<bool>;
  { select(a < b, a, b) } -> std::convertible_to<T>;
} && DeclaresItsLanes<T>;

namespace detail {
template <class T>
consteval bool is_a_scalar() {
  static_assert(Scalar<T>,
                "esokit: the scalar is float or double, or a type of numbers of your own with all "
                "that the concept Scalar lists; it has no integers");
  return Scalar<T>;
}
template <class T>
consteval bool is_a_plain_scalar() {
  static_assert(PlainScalar<T>, "esokit: the scalar here is float, double or long double");
  return PlainScalar<T>;
}
}  // namespace detail

/// A scalar that holds several numbers.
template <class S>
concept PackScalar = Scalar<S> &&(lane_count<S> > 1);

namespace detail {

template <class S>
struct LaneScalarOf {
  using type = S;
};
template <PackScalar S>
struct LaneScalarOf<S> {
  using type = std::remove_cvref_t<decltype(std::declval<const S&>()[0])>;
};

}  // namespace detail

/// The scalar of one lane: double for a pack of doubles.
template <class S>
using LaneScalar = typename detail::LaneScalarOf<S>::type;

// Here alone it has to be the bare name, with which a macro of Arduino's would take its way.
#pragma push_macro("abs")
#undef abs
namespace detail {

/// |x|, one instruction for plain scalars and packs; for a complex number `abs` is found by ADL.
template <class T>
struct AbsoluteValue {
  static constexpr auto of(const T& value) noexcept {
#if defined(__GNUC__)
    if constexpr (std::is_same_v<T, float>) return __builtin_fabsf(value);
    if constexpr (std::is_same_v<T, double>) return __builtin_fabs(value);
    if constexpr (std::is_same_v<T, long double>) return __builtin_fabsl(value);
#endif
    if constexpr (requires { value < value; }) {
      return select(value < T(0.0), T(-value), value);
    } else {
      return abs(value);
    }
  }
};
#pragma pop_macro("abs")
template <class T>
constexpr auto absolute(const T& value) noexcept {
  return AbsoluteValue<T>::of(value);
}

/// A constant in the scalar type; plain scalars convert at compile time.
template <class T>
constexpr T constant(double value) noexcept {
  return static_cast<T>(value);
}

/// Type of the elements of compile-time tables, so that float code loads no doubles.
template <class S>
using TableScalar = std::conditional_t<PlainScalar<LaneScalar<S>>, LaneScalar<S>, double>;

/// Distance from one to the next larger number of the scalar; for autodiff types that of double.
template <class S>
constexpr S rounding() noexcept {
  return S(std::numeric_limits<TableScalar<S>>::epsilon());
}

/// x, or the largest finite number of the same sign if x is infinite.
template <class T>
constexpr T clipped(const T& x) noexcept {
  const T largest((std::numeric_limits<TableScalar<T>>::max)());
  return select(is_finite(x), x, select(x < T(0.0), T(-largest), largest));
}

/// An integer in the scalar type. Plain scalars convert directly: by way of a double, a
/// single-precision target would need two routines for software floating point.
template <class T, std::integral Count>
constexpr T integer(Count count) noexcept {
  if constexpr (PlainScalar<T>) {
    return static_cast<T>(count);
  } else {
    return T(static_cast<double>(count));
  }
}

}  // namespace detail
}  // namespace esokit
