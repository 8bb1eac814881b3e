/// @file
/// The exponential of a matrix: the exact step of a linear reference.
#pragma once

#include <Eigen/Core>

namespace esokit_test {

/// exp(a) by its series with many halvings, in long double. In a library, as Eigen's own takes
/// seconds of compile time.
Eigen::MatrixXd exponential(const Eigen::MatrixXd& a);

}  // namespace esokit_test
