/// @file
/// Gives the vectors and matrices of esokit all operations of Eigen.
///
/// `Eigen::Vector3d z = observer.estimate()` and passing an Eigen expression as an argument work
/// without this header. Include it to mix both in one expression: `(eigen(observer.estimate()) -
/// truth).norm()`.
#pragma once

#include <Eigen/Core>
#include <esokit/core/matrix.hpp>

namespace esokit {

/// The Eigen type that corresponds to a Matrix.
template <class ScalarType, int Rows, int Columns = 1>
using EigenMatrix = Eigen::Matrix<ScalarType, Rows, Columns>;

/// `matrix` as an Eigen object: a map onto its elements, for a temporary a copy of them.
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
