/// @file
/// Explicit Runge-Kutta methods as Butcher tableaus, whose properties are checked at compile time.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <iterator>

namespace esokit::sim {

/// The constants of a Runge-Kutta method: `stages`, `order`, the stage weights `a` (stages x
/// stages), the result weights `b` (stages) and the nodes `c` (stages).
template <class Method>
concept ButcherTableau = requires {
  { Method::stages } -> std::convertible_to<int>;
  { Method::order } -> std::convertible_to<int>;
  { Method::a[0][0] } -> std::convertible_to<long double>;
  { Method::b[0] } -> std::convertible_to<long double>;
  { Method::c[0] } -> std::convertible_to<long double>;
  requires Method::stages >= 1;
  requires std::size(Method::a)
  == static_cast<std::size_t>(Method::stages);
  requires std::size(Method::a[0])
  == static_cast<std::size_t>(Method::stages);
  requires std::size(Method::b)
  == static_cast<std::size_t>(Method::stages);
  requires std::size(Method::c)
  == static_cast<std::size_t>(Method::stages);
};

namespace detail {

/// A tableau entry as long double.
template <class T>
constexpr long double entry(T value) {
  return static_cast<long double>(value);
}

}  // namespace detail

/// True if no stage depends on itself or a later one.
template <ButcherTableau Method>
consteval bool is_explicit() {
  for (std::size_t i = 0; i < Method::stages; ++i) {
    for (std::size_t j = i; j < Method::stages; ++j) {
      if (Method::a[i][j] != 0) return false;
    }
  }
  return true;
}

/// The order of accuracy of the tableau, from the order conditions; at most 4, because conditions
/// beyond order 4 are not tested. Zero if the tableau is not consistent.
///
/// Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed.,
/// II.2, Table 2.2. The coefficients may be rounded to double.
template <ButcherTableau Method>
consteval int proven_order() {
  const auto holds = [](long double sum, long double target) {
    return sum - target < 1e-14L && target - sum < 1e-14L;
  };
  // For time-dependent systems the order conditions require each node to be the sum of its row.
  long double b = 0, bc = 0, bc2 = 0, bac = 0, bc3 = 0, bcac = 0, bac2 = 0, baac = 0;
  for (std::size_t i = 0; i < Method::stages; ++i) {
    long double row = 0, ac = 0, ac2 = 0, aac = 0;
    for (std::size_t j = 0; j < Method::stages; ++j) {
      const long double weight = detail::entry(Method::a[i][j]);
      const long double node = detail::entry(Method::c[j]);
      row += weight;
      ac += weight * node;
      ac2 += weight * node * node;
      for (std::size_t k = 0; k < Method::stages; ++k) {
        aac += weight * detail::entry(Method::a[j][k]) * detail::entry(Method::c[k]);
      }
    }
    const long double node = detail::entry(Method::c[i]);
    const long double weight = detail::entry(Method::b[i]);
    if (!holds(row, node)) return 0;
    b += weight;
    bc += weight * node;
    bc2 += weight * node * node;
    bac += weight * ac;
    bc3 += weight * node * node * node;
    bcac += weight * node * ac;
    bac2 += weight * ac2;
    baac += weight * aac;
  }
  if (!holds(b, 1)) return 0;
  if (!holds(bc, 1 / 2.0L)) return 1;
  if (!holds(bc2, 1 / 3.0L) || !holds(bac, 1 / 6.0L)) return 2;
  if (!holds(bc3, 1 / 4.0L) || !holds(bcac, 1 / 8.0L)) return 3;
  if (!holds(bac2, 1 / 12.0L) || !holds(baac, 1 / 24.0L)) return 3;
  return 4;
}

/// An explicit method that has the order it claims (order conditions are tested up to 4).
template <class Method>
concept ExplicitRungeKutta = ButcherTableau<Method> && is_explicit<Method>() &&
                             (proven_order<Method>() >= (Method::order < 4 ? Method::order : 4)) &&
                             (Method::order >= 1);

}  // namespace esokit::sim
