/// @file
/// Whether a polynomial is positive on the whole half line.
#pragma once

#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/combinatorics.hpp>
#include <type_traits>

namespace esokit {

/// True if c_0 + c_1 x + .. + c_D x^D > 0 for every x >= 0 and c_D > 0.
///
/// With x = t / (1-t) the coefficients become c_i / C(D,i) in the Bernstein basis on [0, 1], and
/// the polynomial lies in their convex hull. If all are positive, so is the polynomial; if the
/// first or last is not, neither is the polynomial; otherwise the interval is halved (de
/// Casteljau). Near a double root the distance of the hull falls fourfold with each halving, so the
/// depth is bounded; an interval undecided at that depth counts as not positive.
template <int Degree, Scalar S>
bool positive_on_half_line(const Array<S, Degree + 1>& coefficients) {
  using Piece = Array<S, Degree + 1>;
  constexpr std::size_t depth = std::is_same_v<S, float> ? 14 : 28;
  constexpr auto& row = binomial_table<Degree, detail::TableScalar<S>>[Degree];
  Piece piece{};
  for (std::size_t i = 0; i <= Degree; ++i) {
    piece[i] = coefficients[i] / S(row[i]);
    if (!is_finite(piece[i])) return false;
  }
  Array<Piece, static_cast<int>(depth)> waiting{};
  Array<std::size_t, static_cast<int>(depth)> level{};
  std::size_t count = 0;
  std::size_t here = 0;
  for (;;) {
    if (!(piece[0] > S(0.0)) || !(piece[Degree] > S(0.0))) return false;
    bool proved = true;
    for (const S& c : piece) proved = proved && c > S(0.0);
    if (proved) {
      if (count == 0) return true;
      --count;
      piece = waiting[count];
      here = level[count];
      continue;
    }
    if (here == depth) return false;
    Piece left{};
    left[0] = piece[0];
    for (std::size_t pass = 1; pass <= Degree; ++pass) {
      for (std::size_t i = 0; i + pass <= Degree; ++i) {
        piece[i] = S(0.5) * (piece[i] + piece[i + 1]);
      }
      left[pass] = piece[0];
    }
    ++here;
    waiting[count] = piece;
    level[count] = here;
    ++count;
    piece = left;
  }
}

}  // namespace esokit
