/// @file
/// Reference: what a controller follows, from a number, a list or a vector.
#pragma once

#include <concepts>
#include <cstddef>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit {

namespace detail {
template <int Order, int Count>
consteval bool is_a_reference() {
  static_assert(Count <= Order + 1,
                "esokit: a reference has r and at most as many derivatives as the plant has order: "
                "{r, r1, .., rn}");
  return true;
}
}  // namespace detail

/// (r, r', .., r^(n)), made from a number if r is constant. If it moves, from up to n + 1 elements,
/// as a list `{r, r1}` or as a vector (of Eigen, too); the others are zero. A tracking
/// differentiator or a profile gives such a vector.
/// @tparam Order n
template <int Order, Scalar S = double>
class Reference {
 public:
  using All = Vector<S, Order + 1>;  ///< type of `all`

  /// A constant reference.
  ESOKIT_INLINE constexpr Reference(const S& constant) noexcept : rows_{constant} {}

  /// A list; or a constant of another type, for a scalar that is no plain number.
  template <std::convertible_to<S>... Rows>
  requires(detail::is_a_reference<Order, sizeof...(Rows)>() &&
           (sizeof...(Rows) > 1 || (sizeof...(Rows) == 1 && !PlainScalar<S>)))  //
      ESOKIT_INLINE constexpr Reference(const Rows&... rows) noexcept
      : rows_{static_cast<S>(rows)...}, moves_(sizeof...(Rows) > 1) {}

  /// A vector.
  template <detail::VectorOf<S> Given>
  ESOKIT_INLINE constexpr Reference(const Given& given) noexcept : moves_(true) {
    constexpr int Count = detail::vector_size<Given>;
    static_assert(detail::is_a_reference<Order, Count>());
    const Vector<S, Count>& rows = given;
    for (int i = 0; i < Count; ++i) rows_[i] = rows(i);
  }

  /// r^(row).
  [[nodiscard]] ESOKIT_INLINE constexpr const S& operator()(int row) const noexcept {
    return rows_[row];
  }
  /// (r, r', .., r^(n)).
  [[nodiscard]] ESOKIT_INLINE constexpr All all() const noexcept {
    All all;
    for (int i = 0; i <= Order; ++i) all(i) = rows_[i];
    return all;
  }
  /// Whether it was made from a list or a vector.
  [[nodiscard]] ESOKIT_INLINE constexpr bool moves() const noexcept { return moves_; }

 private:
  S rows_[static_cast<std::size_t>(Order + 1)]{};
  bool moves_ = false;
};

}  // namespace esokit
