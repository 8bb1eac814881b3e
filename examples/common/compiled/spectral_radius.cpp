#include "spectral_radius.hpp"

#include <Eigen/Eigenvalues>

namespace esokit::examples::compiled {

double spectral_radius(const Eigen::MatrixXd& matrix) {
  return matrix.eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace esokit::examples::compiled
