/// @file
/// Quadratic Lyapunov functions V = x' P x for one linear system or common to several, for the
/// error bounds.
#pragma once

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <esokit/analysis/lyapunov.hpp>
#include <esokit/eigen.hpp>

namespace analysis {

using namespace esokit;

/// P with A'P + P A <= -I, and its extreme eigenvalues.
template <int Size>
struct LyapunovMatrix {
  EigenMatrix<double, Size, Size> p;  ///< N x N, symmetric
  double smallest = 0.0;              ///< smallest eigenvalue of P, above 0
  double largest = 0.0;               ///< largest eigenvalue of P

  /// gamma = sqrt(largest / smallest).
  [[nodiscard]] double gamma() const { return std::sqrt(largest / smallest); }
};

/// Extreme eigenvalues of a symmetric matrix, and their eigenvectors.
template <int Size>
struct Extremes {
  double smallest, largest;
  EigenMatrix<double, Size> at_smallest, at_largest;
};

template <int Size>
Extremes<Size> extremes(const EigenMatrix<double, Size, Size>& a) {
  const Eigen::SelfAdjointEigenSolver<EigenMatrix<double, Size, Size>> of(a);
  return {of.eigenvalues()(0), of.eigenvalues()(Size - 1), of.eigenvectors().col(0),
          of.eigenvectors().col(Size - 1)};
}

template <int Size>
Expected<LyapunovMatrix<Size>, Error<double>> with_eigenvalues(
    const EigenMatrix<double, Size, Size>& p) {
  const Extremes<Size> values = extremes<Size>(p);
  const LyapunovMatrix<Size> result{p, values.smallest, values.largest};
  if (!(result.smallest > 0.0)) {
    return Error<double>{"system", result.smallest, "has no positive Lyapunov matrix"};
  }
  return result;
}

/// P as the vector of its upper triangle; off-diagonal entries stand for both places.
template <int Size>
constexpr int triangle = Size*(Size + 1) / 2;

template <int Size>
EigenMatrix<double, Size, Size> from_triangle(const Array<double, triangle<Size>>& x) {
  EigenMatrix<double, Size, Size> p;
  std::size_t k = 0;
  for (int j = 0; j < Size; ++j) {
    for (int i = 0; i <= j; ++i, ++k) {
      p(i, j) = x[k];
      p(j, i) = x[k];
    }
  }
  return p;
}

/// Ellipsoid {center + factor u, norm(u) <= 1} that contains the solution. Stored by its factor,
/// because for a long ellipsoid factor factor' would become indefinite by rounding.
template <int Count>
struct Ellipsoid {
  Array<double, Count> center{};
  Array<double, Count * Count> factor{};

  explicit Ellipsoid(double radius) {
    for (std::size_t i = 0; i < Count; ++i) factor[i * (Count + 1)] = radius;
  }

  /// factor' g; its norm is half the width of the ellipsoid along g.
  [[nodiscard]] Array<double, Count> seen_along(const Array<double, Count>& g) const {
    Array<double, Count> seen{};
    for (std::size_t i = 0; i < Count; ++i) {
      for (std::size_t j = 0; j < Count; ++j) seen[j] += factor[i * Count + j] * g[i];
    }
    return seen;
  }
  [[nodiscard]] double half_width(const Array<double, Count>& g) const {
    double sum = 0.0;
    for (const double value : seen_along(g)) sum += value * value;
    return std::sqrt(sum);
  }

  /// Keeps the part where excess + g' (x - center) <= 0, excess >= 0. False if nothing is left.
  bool cut(const Array<double, Count>& g, double excess) {
    constexpr double n = Count;
    Array<double, Count> unit = seen_along(g);
    const double size = half_width(g);
    const double depth = excess / size;
    if (!(depth < 1.0)) return false;
    for (double& value : unit) value /= size;
    const double move = (1.0 + n * depth) / (n + 1.0);
    const double across = 1.0 - std::sqrt(1.0 - 2.0 * move / (1.0 + depth));
    const double grow = std::sqrt(n * n * (1.0 - depth * depth) / (n * n - 1.0));
    for (std::size_t i = 0; i < Count; ++i) {
      double step = 0.0;
      for (std::size_t j = 0; j < Count; ++j) step += factor[i * Count + j] * unit[j];
      center[i] -= move * step;
      for (std::size_t j = 0; j < Count; ++j) {
        factor[i * Count + j] = grow * (factor[i * Count + j] - across * step * unit[j]);
      }
    }
    return true;
  }
};

/// P with A'P + P A = -I.
/// @param a A, N x N, 1/s
/// @return error if A is not stable
template <int Size>
Expected<LyapunovMatrix<Size>, Error<double>> lyapunov_matrix(
    const EigenMatrix<double, Size, Size>& a) {
  const EigenMatrix<double, Size, Size> transposed = a.transpose();
  const EigenMatrix<double, Size, Size> identity = EigenMatrix<double, Size, Size>::Identity();
  const auto p = solve_lyapunov<Size>(transposed, identity, false);
  if (!p) return p.error();
  return with_eigenvalues<Size>(*p);
}

/// One P with A_i'P + P A_i <= -I for all given A_i, and therefore for every convex combination of
/// them and any switching between them. Among all such P it is approximately the one with the
/// smallest gamma * largest, to which the error bounds are proportional.
///
/// The inequalities are solved by the ellipsoid method: cuts along the eigenvectors that violate
/// them, and along the gradient of the (quasi-convex) objective. Milliseconds for N = 3, a second
/// for N = 6.
/// @param a the A_i, each N x N @param most bound on the entries of P; scale the A_i so that their
///        poles are of size one
/// @return error if there is none; its value is the remaining violation of the inequalities
template <int Size, std::size_t Modes>
Expected<LyapunovMatrix<Size>, Error<double>> common_lyapunov_matrix(
    const std::array<EigenMatrix<double, Size, Size>, Modes>& a, double most = 1e5) {
  static_assert(Size >= 2, "esokit: at least two states");
  constexpr int count = triangle<Size>;
  using Square = EigenMatrix<double, Size, Size>;
  Rules<double> rules;
  for (const Square& mode : a) {
    rules.finite("system", detail::sum_of_magnitudes(mode.data(), Size * Size));
  }
  if (!rules) return rules.error();
  Ellipsoid<count> ellipsoid(most * std::sqrt(double(count)));
  double best = std::numeric_limits<double>::infinity();
  double violation = 0.0;
  Square best_p = Square::Zero();
  for (int step = 0; step < 100 * count * count; ++step) {
    const Square p = from_triangle<Size>(ellipsoid.center);
    // d/dP of left' P right + right' P left
    Array<double, count> gradient{};
    const auto add = [&](const EigenMatrix<double, Size>& left,
                         const EigenMatrix<double, Size>& right) {
      std::size_t k = 0;
      for (int j = 0; j < Size; ++j) {
        for (int i = 0; i <= j; ++i, ++k) {
          gradient[k] += (i == j ? 1.0 : 2.0) * (left(i) * right(j) + left(j) * right(i));
        }
      }
    };

    // The most violated inequality: v' (A'P + P A + I) v > 0.
    double excess = -std::numeric_limits<double>::infinity();
    EigenMatrix<double, Size> v = EigenMatrix<double, Size>::Zero();
    const Square* violated = &a[0];
    for (const Square& mode : a) {
      const auto found = extremes<Size>(Square::Identity() + mode.transpose() * p + p * mode);
      if (found.largest > excess) {
        excess = found.largest;
        v = found.at_largest;
        violated = &mode;
      }
    }
    violation = excess;
    if (excess > 0.0) {
      add(v, *violated * v);
      if (!ellipsoid.cut(gradient, excess)) break;
      continue;
    }

    // log(largest^3 / smallest), twice the logarithm of gamma * largest. Its sublevel sets are
    // convex.
    const auto values = extremes<Size>(p);
    const double aim = 3.0 * std::log(values.largest) - std::log(values.smallest);
    if (aim < best) {
      best = aim;
      best_p = p;
    }
    add(values.at_largest, values.at_largest * (1.5 / values.largest));
    add(values.at_smallest, values.at_smallest * (-0.5 / values.smallest));
    if (ellipsoid.half_width(gradient) < 1e-3 || !ellipsoid.cut(gradient, 0.0)) break;
  }
  if (!is_finite(best)) {
    return Error<double>{"system", violation, "has no Lyapunov matrix common to all modes"};
  }
  return with_eigenvalues<Size>(best_p);
}

}  // namespace analysis
