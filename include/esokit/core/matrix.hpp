/// @file
/// Fixed-size vectors and matrices of the public interface.
///
/// Eigen stands at the interface only; states and gains of the observers are kept in std::array,
/// whose layout does not change with compiler flags.
#pragma once

#include <Eigen/Core>
#include <esokit/core/language.hpp>

namespace esokit {

/// Column vector of `Size` elements.
template <class ScalarType, int Size>
using Vector = Eigen::Matrix<ScalarType, Size, 1>;

/// Row vector of `Size` elements.
template <class ScalarType, int Size>
using RowVector = Eigen::Matrix<ScalarType, 1, Size>;

/// Matrix of `Rows` x `Columns` elements.
template <class ScalarType, int Rows, int Columns>
using Matrix = Eigen::Matrix<ScalarType, Rows, Columns>;

}  // namespace esokit
