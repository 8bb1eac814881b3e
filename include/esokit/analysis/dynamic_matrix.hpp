/// @file
/// A small matrix whose size is known only at run time. Loops of a plant and a controller are built
/// with it, so that their code is compiled once and not for each pair of sizes.
#pragma once

#include <cassert>
#include <cstddef>
#include <esokit/math/detail/dense.hpp>
#include <vector>

namespace esokit {

/// A rows x columns matrix, initially zero; stored by columns, as in Eigen. May be empty.
template <class T>
class DynamicMatrix {
 public:
  DynamicMatrix() = default;
  /// Zero throughout.
  DynamicMatrix(int rows, int columns)
      : rows_(rows),
        columns_(columns),
        values_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns)) {}

  /// Its size.
  /// @{
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] int cols() const noexcept { return columns_; }
  /// @}

  /// An element.
  /// @{
  [[nodiscard]] T& operator()(int i, int j) noexcept { return values_[place(i, j)]; }
  [[nodiscard]] const T& operator()(int i, int j) const noexcept { return values_[place(i, j)]; }
  /// @}

  /// All elements, by columns.
  /// @{
  [[nodiscard]] T* data() noexcept { return values_.data(); }
  [[nodiscard]] const T* data() const noexcept { return values_.data(); }
  /// @}

  /// A view for the kernels that work on the caller's storage.
  [[nodiscard]] detail::DenseView<T> view() noexcept { return {values_.data(), rows_, columns_}; }

 private:
  [[nodiscard]] std::size_t place(int i, int j) const noexcept {
    assert(i >= 0 && i < rows_ && j >= 0 && j < columns_);
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(rows_) +
           static_cast<std::size_t>(i);
  }

  int rows_ = 0;
  int columns_ = 0;
  std::vector<T> values_;
};

namespace detail {

template <class T>
DynamicMatrix<T> product(const DynamicMatrix<T>& a, const DynamicMatrix<T>& b) {
  assert(a.cols() == b.rows());
  DynamicMatrix<T> out(a.rows(), b.cols());
  for (int j = 0; j < b.cols(); ++j) {
    for (int k = 0; k < a.cols(); ++k) {
      const T factor = b(k, j);
      for (int i = 0; i < a.rows(); ++i) out(i, j) += a(i, k) * factor;
    }
  }
  return out;
}

/// Adds factor * block to the part of `to` that begins at a row and a column.
template <class T>
void add(DynamicMatrix<T>& to, int row, int column, const DynamicMatrix<T>& block,
         double factor = 1.0) {
  for (int j = 0; j < block.cols(); ++j) {
    for (int i = 0; i < block.rows(); ++i) to(row + i, column + j) += factor * block(i, j);
  }
}

/// A copy of any matrix with (i, j), in double.
template <class MatrixType>
DynamicMatrix<double> dynamic_copy(const MatrixType& matrix, int rows, int columns) {
  DynamicMatrix<double> out(rows, columns);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < rows; ++i) out(i, j) = static_cast<double>(matrix(i, j));
  }
  return out;
}

}  // namespace detail
}  // namespace esokit
