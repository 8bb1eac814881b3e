/// @file
/// Loops that are unrolled at compile time, for the code that runs at every sample.
///
/// At g++ -O2 plain loops over std::array take about twice as long as hand-written code, because
/// its vectoriser packs three-element states into partial vectors; a fold over local copies does
/// not.
#pragma once

#include <array>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <type_traits>
#include <utility>

/// @def ESOKIT_INLINE
/// Forces inlining. Used for all parts of a step: otherwise GCC at -O2 leaves
/// some of them as calls, and the state goes through memory between them. Not without optimisation:
/// there every copy stays whole, and a run of a simulation takes up to 480 kB.

/// @def ESOKIT_INLINE_LAMBDA
/// The same for a lambda, written after its parameters.

/// @def ESOKIT_COLD
/// Keeps code that runs rarely out of line, so that it costs the normal step
/// nothing.

#if defined(__GNUC__) && defined(__OPTIMIZE__)
#define ESOKIT_INLINE [[gnu::__always_inline__]] inline
#define ESOKIT_INLINE_LAMBDA __attribute__((__always_inline__))
#define ESOKIT_COLD [[gnu::__noinline__, gnu::__cold__]]
#else
#define ESOKIT_INLINE inline
#define ESOKIT_INLINE_LAMBDA
#define ESOKIT_COLD
#endif

namespace esokit {

/// std::array with an int as size, as everywhere in the library.
template <class T, int Size>
using Array = std::array<T, static_cast<std::size_t>(Size)>;

namespace detail {

/// Calls f(integral_constant<int, 0>), .., f(integral_constant<int, Count - 1>) in order.
template <int Count, class Function>
ESOKIT_INLINE constexpr void unroll(Function&& f) noexcept {
  [&]<int... Index>(std::integer_sequence<int, Index...>) ESOKIT_INLINE_LAMBDA {
    (f(std::integral_constant<int, Index>{}), ...);
  }
  (std::make_integer_sequence<int, Count>{});
}

/// Keeps the vectoriser from packing a value, without adding an instruction. Packing pairs of a
/// three-element state costs shuffles, and a wide load after narrow stores stalls (Clang 14, float:
/// an update takes twice as long).
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

/// Keeps the vectoriser from packing stores before this with stores after it, without adding an
/// instruction: the next load of one of them stalls if it is narrower or wider. @param value what
/// is stored next
template <class T>
ESOKIT_INLINE constexpr void keep_stores_apart([[maybe_unused]] T& value) noexcept {
#if defined(__GNUC__) && !defined(__clang__) && (defined(__SSE2__) || defined(__aarch64__))
  if constexpr (std::is_same_v<T, float> || std::is_same_v<T, double>) {
    if (!std::is_constant_evaluated()) asm("" : "+m"(value));
  }
#endif
}

}  // namespace detail
}  // namespace esokit
