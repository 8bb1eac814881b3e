/// @file
/// Compile-time unrolled loops for the hot path.
///
/// Plain loops over std::array cost about twice hand-written code at g++ -O2 (its vectoriser packs
/// three-element states into partial vectors); a fold over local copies does not.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

// What a step consists of is forced inline: GCC at -O2 otherwise leaves parts of it as calls, and
// the state goes through memory between them.
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

}  // namespace detail
}  // namespace esokit
