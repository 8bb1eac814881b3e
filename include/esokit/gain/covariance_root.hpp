/// @file
/// A covariance by its triangular square root, P = S S', for models with several outputs: array
/// forms by Householder reflections.
#pragma once

#include <cmath>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/covariance_factor.hpp>
#include <optional>

namespace esokit {

namespace detail {

/// Makes an array (R rows, C columns, R <= C) lower triangular from the right by reflections:
/// A A' stays the same, what is right of the diagonal becomes zero.
template <int Rows, int Columns, PlainScalar S>
void make_lower(Matrix<S, Rows, Columns>& a) noexcept {
  static_assert(Rows <= Columns);
  for (int i = 0; i < Rows; ++i) {
    // Scaled by the largest element: squares of small roots would leave float.
    S largest(0);
    for (int k = i; k < Columns; ++k) {
      const S size = detail::absolute(a(i, k));
      largest = largest < size ? size : largest;
    }
    if (!(largest > S(0))) continue;
    S squares(0);
    for (int k = i; k < Columns; ++k) {
      const S x = a(i, k) / largest;
      squares += x * x;
    }
    const S norm = largest * std::sqrt(squares);
    const S pivot = a(i, i);
    const S diagonal = pivot > S(0) ? -norm : norm;
    // v = row - diagonal e_i, over its first element.
    const S head = pivot - diagonal;
    const S weight = -head / diagonal;  // 2 head^2 / (v'v)
    Array<S, Columns> v{};
    for (int k = i + 1; k < Columns; ++k) v[static_cast<std::size_t>(k)] = a(i, k) / head;
    for (int row = i + 1; row < Rows; ++row) {
      S product = a(row, i);
      for (int k = i + 1; k < Columns; ++k) product += v[static_cast<std::size_t>(k)] * a(row, k);
      product *= weight;
      a(row, i) -= product;
      for (int k = i + 1; k < Columns; ++k) a(row, k) -= product * v[static_cast<std::size_t>(k)];
    }
    // The sign of a column is free: a positive diagonal.
    const S sign = diagonal < S(0) ? S(-1) : S(1);
    a(i, i) = detail::absolute(diagonal);
    for (int row = i + 1; row < Rows; ++row) a(row, i) *= sign;
    for (int k = i + 1; k < Columns; ++k) a(i, k) = S(0);
  }
}

}  // namespace detail

/// P = S S', S lower triangular, N x N.
template <int Size, PlainScalar S>
class CovarianceRoot {
 public:
  using Square = Matrix<S, Size, Size>;  ///< N x N

  /// Nothing if the matrix is not positive semidefinite to within rounding.
  static std::optional<CovarianceRoot> from_matrix(const Square& p) noexcept {
    const auto factor = CovarianceFactor<Size, S>::from_matrix(p);
    if (!factor) return std::nullopt;
    return CovarianceRoot(*factor);
  }

  /// The same for a matrix that is positive semidefinite but for rounding.
  static CovarianceRoot nearest(const Square& p) noexcept {
    return CovarianceRoot(CovarianceFactor<Size, S>::nearest(p));
  }

  /// P = 0.
  CovarianceRoot() noexcept = default;

  /// S, N x N.
  [[nodiscard]] const Square& lower() const noexcept { return lower_; }
  /// S S', N x N.
  [[nodiscard]] Square matrix() const noexcept {
    return detail::plus_product_transposed<Size, Size, Size, S>(Square::Zero(), lower_, lower_,
                                                                S(1));
  }
  /// Largest magnitude in S.
  [[nodiscard]] S largest() const noexcept { return largest(0, Size); }
  /// The same of the rows `begin` to `end` - 1.
  [[nodiscard]] S largest(int begin, int end) const noexcept {
    S most(0);
    for (int i = begin; i < end; ++i) most = detail::larger(most, largest_of_row(i));
    return most;
  }

  /// S times a factor.
  void scale(const S& factor) noexcept { lower_ *= factor; }

  /// Makes a row of S zero: this element is known for certain, and correlated with nothing.
  void clear_row(int row) noexcept {
    for (int j = 0; j < Size; ++j) lower_(row, j) = S(0);
  }

  /// Every element within a share of the other's, or of its row where it is small.
  [[nodiscard]] bool near(const CovarianceRoot& other, const S& share) const noexcept {
    for (int i = 0; i < Size; ++i) {
      const S row = other.largest_of_row(i);
      for (int j = 0; j <= i; ++j) {
        const S difference = detail::absolute(S(lower_(i, j) - other.lower_(i, j)));
        const S size = i == j ? other.lower_(i, j) : row;
        if (!(difference <= share * size)) return false;
      }
    }
    return true;
  }

  /// One sample ahead: P <- growth Phi P Phi' + Q.
  /// @param transition Phi, N x N @param growth > 0 @param noise Q
  void advance(const Square& transition, const S& growth, const CovarianceRoot& noise) noexcept {
    const Square moved = transition * lower_;
    const S root = std::sqrt(growth);
    Matrix<S, Size, 2 * Size> array;
    for (int i = 0; i < Size; ++i) {
      for (int j = 0; j < Size; ++j) {
        array(i, j) = moved(i, j) * root;
        array(i, Size + j) = noise.lower_(i, j);
      }
    }
    detail::make_lower<Size, 2 * Size, S>(array);
    for (int i = 0; i < Size; ++i) {
      for (int j = 0; j < Size; ++j) lower_(i, j) = array(i, j);
    }
  }

  /// P <- P - K C P with K = P C' (C P C' + R)^-1. Where an output is known for certain, that is
  /// C P C' + R is zero in some direction, nothing is corrected there.
  /// @param output C, p x N @param measurement R, p x p @return K, N x p
  template <int Outputs>
  Matrix<S, Size, Outputs> correct(const Matrix<S, Outputs, Size>& output,
                                   const CovarianceRoot<Outputs, S>& measurement) noexcept {
    constexpr int both = Outputs + Size;
    const Matrix<S, Outputs, Size> seen = output * lower_;
    Matrix<S, both, both> array = Matrix<S, both, both>::Zero();
    for (int i = 0; i < both; ++i) {
      for (int j = 0; j < both; ++j) {
        if (i < Outputs) {
          array(i, j) = j < Outputs ? measurement.lower()(i, j) : seen(i, j - Outputs);
        } else if (j >= Outputs) {
          array(i, j) = lower_(i - Outputs, j - Outputs);
        }
      }
    }
    detail::make_lower<both, both, S>(array);
    // K s^(1/2) = (lower left part), by back substitution over its columns.
    Matrix<S, Size, Outputs> gain;
    for (int i = 0; i < Size; ++i) {
      for (int j = 0; j < Size; ++j) lower_(i, j) = array(Outputs + i, Outputs + j);
      for (int j = Outputs - 1; j >= 0; --j) {
        S rest = array(Outputs + i, j);
        for (int k = j + 1; k < Outputs; ++k) rest -= gain(i, k) * array(k, j);
        gain(i, j) = array(j, j) > S(0) ? rest / array(j, j) : S(0);
      }
    }
    return gain;
  }

 private:
  explicit CovarianceRoot(const CovarianceFactor<Size, S>& factor) noexcept {
    for (int j = 0; j < Size; ++j) {
      const S root = std::sqrt(factor.variance(j));
      for (int i = j; i < Size; ++i) lower_(i, j) = factor.lower(i, j) * root;
    }
  }

  [[nodiscard]] S largest_of_row(int i) const noexcept {
    return detail::largest_magnitude(lower_.row(i));
  }

  Square lower_;
};

}  // namespace esokit
