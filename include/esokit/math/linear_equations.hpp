/// @file
/// Small linear equations by elimination, in plain loops on the caller's storage.
///
/// Eigen's decompositions of fixed size cost seconds of compile time for each size, and link malloc
/// for their blocked products, which they never run at these sizes.
#pragma once

#include <cassert>
#include <cmath>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <utility>

namespace esokit::detail {

/// A column-major square or rectangle of the caller's, as Eigen stores it.
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

/// Solves a x = b in place of b by elimination with row pivoting; `a` is overwritten. Nothing is
/// reported of a singular a: x is not finite then, or large.
template <class T>
void solve_in_place(DenseView<T> a, DenseView<T> b) noexcept {
  using std::abs;
  const int n = a.rows;
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i) {
      if (abs(a(i, k)) > abs(a(pivot, k))) pivot = i;
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

}  // namespace esokit::detail
