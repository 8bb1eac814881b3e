/// @file
/// Eigen's operations on the vectors and matrices of esokit.
///
/// `Eigen::Vector3d z = observer.estimate()` and an expression of Eigen's as an argument need no
/// header; this one is for expressions of both: `(eigen(observer.estimate()) - truth).norm()`.
#pragma once

#include <Eigen/Core>
#include <esokit/core/matrix.hpp>

namespace esokit {

/// The type of Eigen's that is like a Matrix.
template <class ScalarType, int Rows, int Columns = 1>
using EigenMatrix = Eigen::Matrix<ScalarType, Rows, Columns>;

/// The elements of `matrix`, as Eigen's; a copy of those of a temporary.
/// @{
template <class ScalarType, int Rows, int Columns>
[[nodiscard]] Eigen::Map<EigenMatrix<ScalarType, Rows, Columns>> eigen(
    Matrix<ScalarType, Rows, Columns>& matrix) noexcept {
  return Eigen::Map<EigenMatrix<ScalarType, Rows, Columns>>(matrix.data());
}
template <class ScalarType, int Rows, int Columns>
[[nodiscard]] Eigen::Map<const EigenMatrix<ScalarType, Rows, Columns>> eigen(
    const Matrix<ScalarType, Rows, Columns>& matrix) noexcept {
  return Eigen::Map<const EigenMatrix<ScalarType, Rows, Columns>>(matrix.data());
}
template <class ScalarType, int Rows, int Columns>
[[nodiscard]] EigenMatrix<ScalarType, Rows, Columns> eigen(
    const Matrix<ScalarType, Rows, Columns>&& matrix) {
  return eigen(matrix);
}
/// @}

}  // namespace esokit
