/// @file
/// The vector operations of which a step of an observer consists, unrolled at compile time.
/// Code that is hard to read for the sake of speed is kept here, so that a step reads like its
/// equation.
#pragma once

#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit::detail {

/// to = from. A plain assignment of a pack of several registers goes through memory with GCC.
template <class S>
ESOKIT_INLINE constexpr void assign(S& to, const S& from) noexcept {
  if constexpr (requires { to.assign(from); }) {
    to.assign(from);
  } else {
    to = from;
  }
}

/// x + k e, element by element: the correction step of an observer.
template <class S, std::size_t Size>
[[nodiscard]] ESOKIT_INLINE constexpr std::array<S, Size> add_scaled(const std::array<S, Size>& x,
                                                                     const std::array<S, Size>& k,
                                                                     const S& e) noexcept {
  std::array<S, Size> sum;
  unroll<Size>(
      [&](auto r) ESOKIT_INLINE_LAMBDA { std::get<r>(sum) = std::get<r>(x) + std::get<r>(k) * e; });
  return sum;
}

/// sum_i w_i x_i over `Count` elements, beginning with `First`.
template <int First, int Count, class W, class X>
[[nodiscard]] ESOKIT_INLINE constexpr auto weighed(const W& w, const X& x) noexcept {
  typename W::value_type sum = std::get<First>(w) * std::get<First>(x);
  unroll<Count - 1>([&](auto i) ESOKIT_INLINE_LAMBDA {
    sum = sum + std::get<First + i + 1>(w) * std::get<First + i + 1>(x);
  });
  return sum;
}

/// The same sum over the scaled estimates of an observer.
template <int First, int Count, class W, class Observer>
[[nodiscard]] ESOKIT_INLINE constexpr auto weighed_estimates(const W& w,
                                                             const Observer& observer) noexcept {
  typename W::value_type sum = std::get<First>(w) * observer.template scaled_estimate<First>();
  unroll<Count - 1>([&](auto i) ESOKIT_INLINE_LAMBDA {
    keep_scalar(sum);  // each estimate was stored alone
    sum = sum + std::get<First + i + 1>(w) * observer.template scaled_estimate<First + i + 1>();
  });
  return sum;
}

/// Adds the elements of `x` from `First` on to those of `sum`, `Count` of them.
template <int First, int Count, class S, std::size_t Size>
ESOKIT_INLINE constexpr void add_rows(std::array<S, Size>& sum,
                                      const std::array<S, Size>& x) noexcept {
  unroll<Count>([&](auto r) ESOKIT_INLINE_LAMBDA {
    std::get<First + r>(sum) = std::get<First + r>(sum) + std::get<First + r>(x);
  });
}

/// sum + |x|, element by element.
template <class S, std::size_t Size>
ESOKIT_INLINE constexpr void add_magnitudes(std::array<S, Size>& sum,
                                            const std::array<S, Size>& x) noexcept {
  unroll<Size>([&](auto r) ESOKIT_INLINE_LAMBDA {
    std::get<r>(sum) = std::get<r>(sum) + absolute(std::get<r>(x));
  });
}

/// The sum of the squares of all elements.
template <class S, std::size_t Size>
[[nodiscard]] ESOKIT_INLINE constexpr S sum_of_squares(const std::array<S, Size>& x) noexcept {
  S sum = std::get<0>(x) * std::get<0>(x);
  unroll<Size - 1>(
      [&](auto r) ESOKIT_INLINE_LAMBDA { sum = sum + std::get<r + 1>(x) * std::get<r + 1>(x); });
  return sum;
}

/// Adds the squares of all elements. One sum after the other: each is one multiply-add.
template <class S, std::size_t Size>
ESOKIT_INLINE constexpr void add_squares(S& sum, const std::array<S, Size>& x) noexcept {
  unroll<Size>([&](auto r) ESOKIT_INLINE_LAMBDA { sum = sum + std::get<r>(x) * std::get<r>(x); });
}

/// The magnitudes of all elements.
template <class S, std::size_t Size>
[[nodiscard]] ESOKIT_INLINE constexpr std::array<S, Size> magnitudes(
    const std::array<S, Size>& x) noexcept {
  std::array<S, Size> result;
  unroll<Size>([&](auto r)
                   ESOKIT_INLINE_LAMBDA { std::get<r>(result) = absolute(std::get<r>(x)); });
  return result;
}

/// Calls keep_scalar for each element.
template <class S>
ESOKIT_INLINE constexpr void keep_scalars(S& x) noexcept {
  keep_scalar(x);
}
template <class S, std::size_t Size>
ESOKIT_INLINE constexpr void keep_scalars(std::array<S, Size>& x) noexcept {
  unroll<Size>([&](auto r) ESOKIT_INLINE_LAMBDA { keep_scalars(std::get<r>(x)); });
}

}  // namespace esokit::detail
