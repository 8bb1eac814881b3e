/// @file
/// Small dense kernels: linear equations, Cholesky factors, Lyapunov sums by doubling, the
/// matrix exponential. The controller headers use nothing else for matrices.
///
/// They are plain loops on column-major storage of the caller, with the size as an argument, so
/// that one instantiation serves all sizes. Each of Eigen's decompositions of fixed size costs
/// seconds of compile time (EigenSolver: 7 s) and links malloc for blocked products that never run
/// at these sizes.
#pragma once

#include <cassert>
#include <cmath>
#include <cstddef>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <optional>
#include <utility>

namespace esokit::detail {

/// A view of a column-major matrix of the caller, as Eigen stores it.
template <class T>
struct DenseView {
  T* data;
  int rows;
  int columns = rows;
  [[nodiscard]] T& operator()(int i, int j) const noexcept {
    assert(i >= 0 && i < rows && j >= 0 && j < columns);
    return data[static_cast<std::ptrdiff_t>(j) * rows + i];
  }
};

/// Solves a x = b in place of b by elimination with row pivoting; `a` is overwritten. A singular a
/// is not reported: x is then large or not finite.
template <class T>
void solve_in_place(DenseView<T> a, DenseView<T> b) noexcept {
  const int n = a.rows;
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i) {
      if (absolute(a(i, k)) > absolute(a(pivot, k))) pivot = i;
    }
    if (pivot != k) {
      for (int j = k; j < n; ++j) std::swap(a(k, j), a(pivot, j));
      for (int j = 0; j < b.columns; ++j) std::swap(b(k, j), b(pivot, j));
    }
    for (int i = k + 1; i < n; ++i) {
      if (a(i, k) == T(0)) continue;
      const T factor = a(i, k) / a(k, k);
      for (int j = k + 1; j < n; ++j) a(i, j) -= factor * a(k, j);
      for (int j = 0; j < b.columns; ++j) b(i, j) -= factor * b(k, j);
    }
  }
  for (int j = 0; j < b.columns; ++j) {
    for (int i = n - 1; i >= 0; --i) {
      for (int k = i + 1; k < n; ++k) b(i, j) -= a(i, k) * b(k, j);
      b(i, j) /= a(i, i);
    }
  }
}

/// The magnitude of each element.
template <int Rows, int Columns, class S>
constexpr Matrix<S, Rows, Columns> magnitudes(Matrix<S, Rows, Columns> matrix) noexcept {
  for (S& element : matrix) element = absolute(element);
  return matrix;
}

/// a^-1 b, see solve_in_place.
template <int Size, int Columns, Scalar S>
Matrix<S, Size, Columns> solved(Matrix<S, Size, Size> a, Matrix<S, Size, Columns> b) noexcept {
  solve_in_place(DenseView<S>{a.data(), Size}, DenseView<S>{b.data(), Size, Columns});
  return b;
}

/// The Rows x Columns elements of `all` from element (i, j) on.
template <int Rows, int Columns, int AllRows, int AllColumns, class S>
constexpr Matrix<S, Rows, Columns> block(const Matrix<S, AllRows, AllColumns>& all, int i,
                                         int j) noexcept {
  Matrix<S, Rows, Columns> part;
  for (int c = 0; c < Columns; ++c) {
    for (int r = 0; r < Rows; ++r) part(r, c) = all(i + r, j + c);
  }
  return part;
}

/// Replaces the elements of `all` from element (i, j) on by `part`.
template <int Rows, int Columns, int AllRows, int AllColumns, class S>
constexpr void set_block(Matrix<S, AllRows, AllColumns>& all, int i, int j,
                         const Matrix<S, Rows, Columns>& part) noexcept {
  for (int c = 0; c < Columns; ++c) {
    for (int r = 0; r < Rows; ++r) all(i + r, j + c) = part(r, c);
  }
}

/// a_0 .. a_(n-1) of det(s I - A) = s^n + a_(n-1) s^(n-1) + .. + a_0, by the Faddeev-LeVerrier
/// algorithm. @param each called with n - 1 .. 0 and the coefficient of this power in adj(s I - A)
template <int Size, class S, class Each>
constexpr Array<S, Size> characteristic(const Matrix<S, Size, Size>& a, const Each& each) noexcept {
  Array<S, Size> all{};
  auto adjugate = Matrix<S, Size, Size>::Identity();
  for (int k = Size - 1; k >= 0; --k) {
    each(k, adjugate);
    adjugate = a * adjugate;
    const S next = -adjugate.trace() / integer<S>(Size - k);
    all[static_cast<std::size_t>(k)] = next;
    for (int i = 0; i < Size; ++i) adjugate(i, i) = adjugate(i, i) + next;
  }
  return all;
}

/// A column of these elements, and the elements of a column.
/// @{
template <class S, std::size_t Size>
constexpr Vector<S, static_cast<int>(Size)> column(const std::array<S, Size>& x) noexcept {
  Vector<S, static_cast<int>(Size)> all;
  for (int i = 0; i < all.size(); ++i) all(i) = x[static_cast<std::size_t>(i)];
  return all;
}
template <class S, int Size>
constexpr Array<S, Size> elements(const Vector<S, Size>& x) noexcept {
  Array<S, Size> all{};
  for (int i = 0; i < Size; ++i) all[static_cast<std::size_t>(i)] = x(i);
  return all;
}
/// @}

/// A^-1 B for a symmetric positive definite A, by Cholesky; nothing if A is not positive definite.
template <int Size, int Columns, Scalar S>
std::optional<Matrix<S, Size, Columns>> solve_positive(const Matrix<S, Size, Size>& a,
                                                       Matrix<S, Size, Columns> b) {
  Matrix<S, Size, Size> l = a;  // unit lower, the pivots on its diagonal
  for (int k = 0; k < Size; ++k) {
    if (!all(is_finite(l(k, k))) || !all(l(k, k) > S(0.0))) return std::nullopt;
    for (int i = k + 1; i < Size; ++i) {
      const S factor = l(i, k) / l(k, k);
      for (int j = k + 1; j <= i; ++j) l(i, j) = l(i, j) - factor * l(j, k);
    }
    for (int i = k + 1; i < Size; ++i) l(i, k) = l(i, k) / l(k, k);
  }
  for (int c = 0; c < Columns; ++c) {
    for (int i = 0; i < Size; ++i) {
      for (int k = 0; k < i; ++k) b(i, c) = b(i, c) - l(i, k) * b(k, c);
    }
    for (int i = Size - 1; i >= 0; --i) {
      b(i, c) = b(i, c) / l(i, i);
      for (int k = i + 1; k < Size; ++k) b(i, c) = b(i, c) - l(k, i) * b(k, c);
    }
  }
  return b;
}

/// C + A B' w.
template <int Rows, int Inner, int Columns, Scalar S>
Matrix<S, Rows, Columns> plus_product_transposed(Matrix<S, Rows, Columns> c,
                                                 const Matrix<S, Rows, Inner>& a,
                                                 const Matrix<S, Columns, Inner>& b,
                                                 const S& w) noexcept {
  for (int i = 0; i < Rows; ++i) {
    for (int j = 0; j < Columns; ++j) {
      S sum = a(i, 0) * b(j, 0);
      for (int k = 1; k < Inner; ++k) sum = sum + a(i, k) * b(j, k);
      c(i, j) = c(i, j) + sum * w;
    }
  }
  return c;
}

/// out = a b, all n x n, stored by columns; `out` is neither of them.
/// @param n an int, or a constant (std::integral_constant) to have the loops unrolled for it
template <class T, class N>
constexpr void multiply(const T* a, const T* b, T* out, N n) noexcept {
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) out[j * n + i] = T(0.0);
    for (int k = 0; k < n; ++k) {
      const T factor = b[j * n + k];
      for (int i = 0; i < n; ++i) out[j * n + i] = out[j * n + i] + a[k * n + i] * factor;
    }
  }
}

/// Largest row sum of magnitudes of a, n x n: the norm induced by the infinity norm of vectors.
template <class T>
constexpr T row_norm(const T* a, int n) noexcept {
  T largest(0.0);
  for (int i = 0; i < n; ++i) {
    T row(0.0);
    for (int j = 0; j < n; ++j) row = row + absolute(a[j * n + i]);
    if (!(row <= largest)) largest = row;  // a NaN stays
  }
  return largest;
}

/// P = sum_k A^k Q A'^k with A = I + e, that is P = A P A' + Q, by doubling (Smith's squared
/// method): P_{j+1} = P_j + A^(2^j) P_j A'^(2^j). To square only the difference to I, (I + e)^2 - I
/// = 2 e + e^2, loses no digits of slow poles. Returns false if the sum does not converge; P may
/// overflow.
/// @param e n x n, is overwritten @param p in: Q, out: P @param work1, work2 n x n
template <class T>
bool sum_by_doubling(T* e, T* p, T* work1, T* work2, int n) noexcept {
  for (int step = 0; step < 64; ++step) {
    multiply(e, e, work1, n);
    for (int i = 0; i < n * n; ++i) work1[i] = work1[i] + T(2.0) * e[i];  // the next e
    for (int i = 0; i < n; ++i) e[i * n + i] = e[i * n + i] + T(1.0);     // A^(2^step)
    const T size = row_norm(e, n);
    if (!is_finite(size)) return false;
    multiply(e, p, work2, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j <= i; ++j) {
        T sum(0.0);
        for (int k = 0; k < n; ++k) sum = sum + work2[k * n + i] * e[k * n + j];
        p[j * n + i] = p[j * n + i] + sum;
        if (i != j) p[i * n + j] = p[j * n + i];
      }
    }
    // The rest of the sum is at most about size^2 times the term that was just added.
    if (size * size < T(1e-4) * rounding<T>()) return true;
    for (int i = 0; i < n * n; ++i) e[i] = work1[i];
  }
  return false;
}

/// Solves X = F X F' + W for a stable F. Returns nothing if F is not stable or if the scalar cannot
/// hold X. @param x W
template <int Size, Scalar S>
std::optional<Matrix<S, Size, Size>> solve_stein(Matrix<S, Size, Size> f, Matrix<S, Size, Size> x) {
  for (int i = 0; i < Size; ++i) f(i, i) = f(i, i) - S(1.0);
  Array<S, 2 * Size * Size> work;
  if (!sum_by_doubling(f.data(), x.data(), work.data(), work.data() + Size * Size, Size)) {
    return std::nullopt;
  }
  if (!is_finite(row_norm(x.data(), Size))) return std::nullopt;
  return x;
}

/// exp(a) - I in place: Taylor series of a / 2^k, then squared k times as 2 E + E^2. If a is not
/// finite or too large, the result is not finite.
/// @param a n x n @param work 2 n^2 numbers @param n an int, or a constant: see `multiply`
template <PlainScalar T, class N>
constexpr void exp_minus_identity(T* a, T* work, N n) noexcept {
  T* const sum = work;
  T* const product = work + n * n;
  int squarings = 0;
  T scale(1);
  if (const T size = row_norm(a, n); is_finite(size)) {
    for (; size * scale > T(0.25); scale *= T(0.5)) ++squarings;
  }
  for (int i = 0; i < n * n; ++i) a[i] *= scale;
  // With norm 1/4 the terms fall below 1e-17 by the 12th. Summed by Horner's rule, smallest first.
  for (int i = 0; i < n * n; ++i) sum[i] = T(0);
  for (int i = 0; i < n; ++i) sum[i * n + i] = T(1);
  for (int k = 14; k >= 2; --k) {
    multiply(a, sum, product, n);
    for (int i = 0; i < n * n; ++i) sum[i] = product[i] / static_cast<T>(k);
    for (int i = 0; i < n; ++i) sum[i * n + i] += T(1);
  }
  multiply(a, sum, product, n);
  for (int i = 0; i < n * n; ++i) a[i] = product[i];
  for (int i = 0; i < squarings; ++i) {
    multiply(a, a, product, n);
    for (int j = 0; j < n * n; ++j) a[j] = T(2) * a[j] + product[j];
  }
}

/// exp(a) - I. If a is scaled so that its elements are of similar size, the error is below 1e-13 of
/// the largest element, for norms up to 2e4.
template <PlainScalar T, int Size>
constexpr Matrix<T, Size, Size> exp_minus_identity(Matrix<T, Size, Size> a) noexcept {
  std::array<T, static_cast<std::size_t>(2 * Size * Size)> work{};
  exp_minus_identity(a.data(), work.data(), Size);
  return a;
}

}  // namespace esokit::detail
