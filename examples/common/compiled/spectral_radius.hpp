/// @file
/// Eigen's eigenvalues, compiled once for all programs: seven seconds of compile in each otherwise.
#pragma once

#include <Eigen/Core>

namespace esokit::examples::compiled {

/// Of any square matrix.
[[nodiscard]] double spectral_radius(const Eigen::MatrixXd& matrix);

}  // namespace esokit::examples::compiled
