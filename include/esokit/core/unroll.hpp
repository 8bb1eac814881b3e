/// @file
/// Compile-time unrolled loops for the hot path.
///
/// Plain loops over std::array cost about twice hand-written code at g++ -O2 (its vectoriser packs
/// three-element states into partial vectors); a fold over local copies does not.
#pragma once

#include <array>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <type_traits>
#include <utility>

/// @def ESOKIT_INLINE
/// Forced inline, as all is that a step consists of: GCC at -O2 otherwise leaves parts of it as
/// calls, and the state goes through memory between them.

/// @def ESOKIT_INLINE_LAMBDA
/// The same behind the parameters of a lambda.

/// @def ESOKIT_COLD
/// Out of line: what happens rarely shall not cost the hot path.

#if defined(__GNUC__)
#define ESOKIT_INLINE [[gnu::always_inline]] inline
#define ESOKIT_INLINE_LAMBDA __attribute__((always_inline))
#define ESOKIT_COLD [[gnu::noinline, gnu::cold]]
#else
#define ESOKIT_INLINE inline
#define ESOKIT_INLINE_LAMBDA
#define ESOKIT_COLD
#endif

namespace esokit {

/// std::array with the signed sizes that the rest of the library counts in.
template <class T, int Size>
using Array = std::array<T, static_cast<std::size_t>(Size)>;

namespace detail {

/// Calls f(integral_constant<int, 0>), .., f(integral_constant<int, Count - 1>) in order.
template <int Count, class Function>
ESOKIT_INLINE constexpr void unroll(Function&& f) noexcept {
  [&]<int... I>(std::integer_sequence<int, I...>) ESOKIT_INLINE_LAMBDA {
    (f(std::integral_constant<int, I>{}), ...);
  }
  (std::make_integer_sequence<int, Count>{});
}

/// Keeps the vectoriser off a value, at no instruction: packing pairs of a three-element state
/// costs shuffles, and a wide load after narrow stores waits for the store buffer (clang 14, float:
/// twice the time of an update).
template <class T>
ESOKIT_INLINE constexpr void keep_scalar([[maybe_unused]] T& value) noexcept {
#if defined(__GNUC__) && defined(__SSE2__)
  if constexpr (std::is_same_v<T, float> || std::is_same_v<T, double>) {
    if (!std::is_constant_evaluated()) asm("" : "+x"(value));
  }
#elif defined(__GNUC__) && defined(__aarch64__)
  if constexpr (std::is_same_v<T, float> || std::is_same_v<T, double>) {
    if (!std::is_constant_evaluated()) asm("" : "+w"(value));
  }
#endif
}

}  // namespace detail
}  // namespace esokit
