#include "support/exponential.hpp"

namespace esokit_test {

Eigen::MatrixXd exponential(const Eigen::MatrixXd& a) {
  using Long = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const Long small = a.cast<long double>() / 1048576.0L;
  Long sum = Long::Identity(a.rows(), a.cols());
  Long term = sum;
  for (int k = 1; k < 12; ++k) {
    term = Long(term.lazyProduct(small)) / static_cast<long double>(k);
    sum += term;
  }
  for (int i = 0; i < 20; ++i) sum = Long(sum.lazyProduct(sum));
  return sum.cast<double>();
}

}  // namespace esokit_test
