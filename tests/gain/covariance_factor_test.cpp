// CovarianceFactor: factors, the two updates against dense matrices, and what float makes of them.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/gain/detail/covariance_factor.hpp>
#include <limits>
#include <support/numbers.hpp>

namespace esokit_test::gain_covariance_factor_test {

using esokit::CovarianceFactor;

using Dense = Eigen::MatrixXd;

Dense random_covariance(Random& random, int size, int rank) {
  Dense p = Dense::Zero(size, size);
  for (int k = 0; k < rank; ++k) {
    Eigen::VectorXd v(size);
    for (int i = 0; i < size; ++i) v(i) = random.uniform(-1, 1) * std::pow(10.0, -i);
    p += v.lazyProduct(v.transpose());
  }
  return p;
}

/// Phi p Phi' of the chain.
Dense transported(const Dense& p) {
  Dense phi = Dense::Zero(p.rows(), p.rows());
  for (int i = 0; i < p.rows(); ++i) {
    for (int j = i; j < p.rows(); ++j) phi(i, j) = choose(j, i);
  }
  const Dense left = phi.lazyProduct(p);
  return left.lazyProduct(phi.transpose());
}

/// Largest difference of correlations: the states differ by orders of magnitude.
double distance(const Dense& a, const Dense& b) {
  double worst = 0;
  for (int i = 0; i < a.rows(); ++i) {
    for (int j = 0; j < a.cols(); ++j) {
      worst = std::max(worst, std::abs(a(i, j) - b(i, j)) / std::sqrt(b(i, i) * b(j, j)));
    }
  }
  return worst;
}

template <int N, class S>
Dense dense(const esokit::CovarianceFactor<N, S>& factor) {
  return eigen(factor.matrix()).template cast<double>();
}
template <int N, class S = double>
CovarianceFactor<N, S> factor_of(const Dense& p) {
  return CovarianceFactor<N, S>::from_matrix(Eigen::Matrix<S, N, N>(p.cast<S>())).value();
}

template <int N>
void updates_equal_dense() {
  Random random(3);
  constexpr double unit = 200 * N * std::numeric_limits<double>::epsilon();
  for (int run = 0; run < 50; ++run) {
    const Dense p = random_covariance(random, N, N);
    const bool diagonal = run % 2 == 0;
    Dense q = random_covariance(random, N, N);
    if (diagonal) q = Dense(q.diagonal().asDiagonal());
    auto factor = factor_of<N>(p);
    const auto noise = factor_of<N>(q);
    EXPECT_EQ(noise.diagonal(), diagonal);
    EXPECT_LE(distance(dense(factor), p), unit);

    const double r = random.log_uniform(1e-4, 1);
    const Eigen::VectorXd gain = p.col(0) / (p(0, 0) + r);
    const double share = factor.variance(0) / (factor.variance(0) + r);
    const auto k = factor.gain(share);
    for (int i = 0; i < N; ++i) {
      EXPECT_NEAR(k[static_cast<std::size_t>(i)], gain(i), unit * std::abs(gain(i)) + unit * 1e-9);
    }
    factor.set_variance(0, share * r);
    const Dense measured = dense(factor);
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        EXPECT_NEAR(measured(i, j), p(i, j) - gain(i) * p(0, j),
                    10 * unit * std::sqrt(p(i, i) * p(j, j)));
      }
    }

    const double inflation = random.uniform(1, 2);
    const Dense ahead = transported(measured) * inflation + q;
    auto other = factor;
    factor.template advance<false>(inflation, noise);
    EXPECT_LE(distance(dense(factor), ahead), unit);
    if (diagonal) {
      other.template advance<true>(inflation, noise);
      EXPECT_LE(distance(dense(other), ahead), unit);
    }

    esokit::Array<double, N> weights;
    double trace = 0;
    const Dense moved = transported(ahead);
    for (int i = 0; i < N; ++i) {
      weights[static_cast<std::size_t>(i)] = random.uniform(0.1, 3);
      trace += weights[static_cast<std::size_t>(i)] * moved(i, i);
    }
    EXPECT_NEAR(factor.transported_trace(weights), trace, unit * trace);
  }
}

TEST(CovarianceFactor, updates_equal_dense_matrices) {
  updates_equal_dense<2>();
  updates_equal_dense<3>();
  updates_equal_dense<6>();  // not unrolled
}

/// A measurement of any combination of the states, with noise and without.
TEST(CovarianceFactor, correction_by_any_row_equals_dense) {
  constexpr int N = 4;
  Random random(9);
  constexpr double unit = 200 * N * std::numeric_limits<double>::epsilon();
  for (int run = 0; run < 60; ++run) {
    const Eigen::Matrix4d p = random_covariance(random, N, run % 3 == 0 ? 2 : N);
    const double r = run % 2 == 0 ? 0 : random.log_uniform(1e-4, 1);
    auto factor = CovarianceFactor<N, double>::nearest(p);
    Eigen::RowVector4d c;
    esokit::Array<double, N> output{};
    for (int i = 0; i < N; ++i) {
      c(i) = i == run % N ? 0 : random.uniform(-1, 1);
      output[static_cast<std::size_t>(i)] = c(i);
    }
    const double variance = c * p * c.transpose() + r;
    const Eigen::Vector4d gain = p * c.transpose() / variance;
    const auto k = factor.correct(output, r);
    const Eigen::Matrix4d corrected = p - gain * c * p;
    const auto left = factor.matrix();
    const double loss = 1 + p.trace() / variance;  // digits that the dense gain loses
    for (int i = 0; i < N; ++i) {
      const double size = std::sqrt(p(i, i));
      EXPECT_NEAR(k[static_cast<std::size_t>(i)], gain(i),
                  loss * unit * size / std::sqrt(variance));
      EXPECT_GE(factor.variance(i), 0);
      for (int j = 0; j < N; ++j) {
        EXPECT_NEAR(left(i, j), corrected(i, j), loss * unit * size * std::sqrt(p(j, j)));
      }
    }
  }
}

/// Nothing is corrected where neither the noise nor the states leave anything open.
TEST(CovarianceFactor, what_is_known_for_certain_is_not_corrected) {
  for (const double r : {0.0, std::numeric_limits<double>::denorm_min()}) {
    Eigen::Matrix3d p = Eigen::Matrix3d::Zero();
    p(2, 2) = 4;
    auto factor = CovarianceFactor<3, double>::from_matrix(p).value();
    for (const double k : factor.correct({1, 2, 0}, r)) EXPECT_EQ(k, 0);
    EXPECT_EQ(factor.matrix()(2, 2), 4);
    EXPECT_EQ(factor.correct({1, 0, 2}, r)[2], 0.5);
    EXPECT_EQ(factor.matrix()(2, 2), 0);
  }
}

TEST(CovarianceFactor, takes_semidefinite_matrices) {
  Random random(5);
  for (int rank = 0; rank <= 4; ++rank) {
    const Eigen::Matrix4d p = random_covariance(random, 4, rank);
    const auto factor = CovarianceFactor<4, double>::from_matrix(p);
    ASSERT_TRUE(factor.has_value()) << rank;
    EXPECT_TRUE(eigen(factor->matrix() - p).cwiseAbs().maxCoeff() <= 1e-14) << rank;
    for (int i = 0; i < 4; ++i) EXPECT_GE(factor->variance(i), 0);
  }
}

/// Nearly singular matrices, rounded to float: what is lost is within the rounding.
TEST(CovarianceFactor, takes_nearly_singular_matrices_of_float) {
  Random random(6);
  for (int run = 0; run < 2000; ++run) {
    const double least = random.log_uniform(1e-9, 1e-3);
    Eigen::Matrix4d p = random_covariance(random, 4, 1 + run % 3);
    p.diagonal() *= 1 + least;
    const Eigen::Matrix4f rounded = p.cast<float>();
    const auto factor = CovarianceFactor<4, float>::from_matrix(rounded);
    ASSERT_TRUE(factor.has_value()) << run;
    EXPECT_LE(distance(dense(*factor), p), 100 * 1.2e-7) << run;
  }
}

TEST(CovarianceFactor, refuses_indefinite_matrices) {
  Eigen::Matrix3d p = Eigen::Matrix3d::Identity();
  p(1, 0) = p(0, 1) = 1.001;
  EXPECT_FALSE((CovarianceFactor<3, double>::from_matrix(p)));
  p = Eigen::Matrix3d::Identity();
  p(2, 2) = -1e-9;
  EXPECT_FALSE((CovarianceFactor<3, double>::from_matrix(p)));
  p = Eigen::Matrix3d::Zero();
  p(1, 1) = 1;
  p(1, 0) = p(0, 1) = 1e-3;  // correlated with a state that has no variance
  EXPECT_FALSE((CovarianceFactor<3, double>::from_matrix(p)));
  p = Eigen::Matrix3d::Identity();
  p(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE((CovarianceFactor<3, double>::from_matrix(p)));
}

TEST(CovarianceFactor, rescales_units) {
  Random random(7);
  const Dense p = random_covariance(random, 3, 3);
  auto factor = factor_of<3>(p);
  factor.rescale(0.1, 5);
  Dense expected = 5 * p;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) expected(i, j) *= std::pow(0.1, i + j);
  }
  EXPECT_LE(distance(dense(factor), expected), 1e-13);
}

/// A factor in float for which the plain and the Joseph update are known to fail: R = 1e-12,
/// P0 = 1e8, or both.
template <int N>
void stays_definite_in_float(float r, double p0, double theta) {
  using Factor = CovarianceFactor<N, float>;
  Factor factor;
  Factor noise;
  double unit = 1;
  for (int i = 0; i < N; ++i) {
    if (i > 0) unit *= 1e-3 / i;
    factor.set_variance(i, static_cast<float>(p0 * unit * unit / static_cast<double>(r)));
    const double q = i + 1 < N ? 0 : 300 * std::pow(1000.0, N - 3);
    noise.set_variance(i, static_cast<float>(q * q * unit * unit / static_cast<double>(r) *
                                             (theta > 0 ? (1 + theta) / theta : 1)));
  }
  const auto growth = static_cast<float>(1 + theta);
  const float s = 1 / growth;
  bool definite = true;
  for (int k = 0; k < long_run(250'000) && definite; ++k) {
    const float share = factor.variance(0) / (factor.variance(0) + s);
    factor.set_variance(0, share * s);
    factor.template advance<true>(growth, noise);
    for (int i = 0; i < N; ++i) {
      definite = definite && std::isfinite(factor.variance(i)) && factor.variance(i) > 0;
    }
    ASSERT_TRUE(definite) << "N = " << N << ", step " << k;
  }
  const auto p = factor.matrix();
  EXPECT_EQ(p, p.transpose());
}

TEST(CovarianceFactor, many_steps_in_float) {
  for (const auto& [r, p0] : {std::pair{1e-12f, 1.0}, {1e-12f, 1e8}, {1e-4f, 1e8}}) {
    stays_definite_in_float<2>(r, p0, 0.5);
    stays_definite_in_float<3>(r, p0, 0);
    stays_definite_in_float<6>(r, p0, 0.02);
  }
}

}  // namespace esokit_test::gain_covariance_factor_test
