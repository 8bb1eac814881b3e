// The plain-loop kernels against Eigen and against equations that are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/detail/eigenvalues.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/analysis/lyapunov.hpp>
#include <esokit/analysis/poles.hpp>
#include <support/refusal.hpp>
#include <vector>

#include "support/numbers.hpp"

namespace analysis_dense_test {

using esokit_test::refusal;

using namespace esokit;
using Complex = std::complex<double>;
using esokit_test::Random;

template <int N>
EigenMatrix<double, N, N> random_matrix(Random& random) {
  EigenMatrix<double, N, N> a;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) a(i, j) = random.uniform(-1.0, 1.0);
  }
  return a;
}

TEST(Dense, SolvesLinearEquations) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const auto re = random_matrix<5>(random);
    const auto im = random_matrix<5>(random);
    EigenMatrix<Complex, 5, 5> a;
    EigenMatrix<Complex, 5, 2> b;
    for (int i = 0; i < 5; ++i) {
      for (int j = 0; j < 5; ++j) a(i, j) = {re(i, j), im(i, j)};
      for (int j = 0; j < 2; ++j) b(i, j) = {random.uniform(-1.0, 1.0), 0.5};
    }
    if (trial % 3 == 0) a(0, 0) = 0.0;  // needs the pivot
    EigenMatrix<Complex, 5, 5> work = a;
    EigenMatrix<Complex, 5, 2> x = b;
    detail::solve_in_place(detail::DenseView<Complex>{work.data(), 5},
                           detail::DenseView<Complex>{x.data(), 5, 2});
    EXPECT_LT((a * x - b).cwiseAbs().maxCoeff(), 1e-11 * (1.0 + x.cwiseAbs().maxCoeff()));
  }
}

/// Eigenvalues that were chosen: a = s diag(values) s^-1 with 2 x 2 blocks for pairs.
TEST(Dense, EigenvaluesOfABuiltMatrix) {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    EigenMatrix<double, 6, 6> diagonal = EigenMatrix<double, 6, 6>::Zero();
    std::vector<Complex> expected;
    for (int i = 0; i < 6; i += 2) {
      const double re = random.uniform(-2.0, 2.0);
      const double im = trial % 2 == 0 ? random.uniform(0.0, 3.0) : 0.0;
      const double other = im > 0.0 ? re : random.uniform(-2.0, 2.0);
      diagonal(i, i) = re;
      diagonal(i + 1, i + 1) = other;
      diagonal(i, i + 1) = im;
      diagonal(i + 1, i) = -im;
      expected.emplace_back(re, im);
      expected.emplace_back(other, -im);
    }
    EigenMatrix<double, 6, 6> s =
        random_matrix<6>(random) + 3.0 * EigenMatrix<double, 6, 6>::Identity();
    EigenMatrix<double, 6, 6> work = s.transpose();
    EigenMatrix<double, 6, 6> right = (s * diagonal).transpose();  // a' = s'^-1 (s diagonal)'
    detail::solve_in_place(detail::DenseView<double>{work.data(), 6},
                           detail::DenseView<double>{right.data(), 6});
    LinearSystem<6, 1, 1> system;
    system.a = right.transpose();
    const auto values = poles(system);
    for (const Complex& value : expected) {
      double nearest = 1e9;
      for (const Complex& ours : values) nearest = std::min(nearest, std::abs(ours - value));
      EXPECT_LT(nearest, 1e-10) << trial;
    }
  }
}

TEST(Dense, EigenvaluesOfSpecialMatrices) {
  LinearSystem<4, 1, 1> system;
  for (const Complex& value : poles(system)) EXPECT_EQ(value, Complex(0.0));
  for (int i = 0; i < 3; ++i) system.a(i, i + 1) = 1.0;
  for (const Complex& value : poles(system)) EXPECT_EQ(value, Complex(0.0));  // nilpotent
  system.a(3, 0) = 1.0;  // cyclic: the shifts of a plain QR would go round in circles
  for (const Complex& value : poles(system)) {
    EXPECT_NEAR(std::abs(value), 1.0, 1e-14);
    EXPECT_NEAR(std::abs(std::pow(value, 4) - 1.0), 0.0, 1e-13);
  }
  system.a(0, 0) = std::nan("");
  EXPECT_FALSE(is_finite(poles(system)(0).real()));
  EXPECT_GT(stability_abscissa(system), 0.0);
}

TEST(Dense, StabilityOfSlowSampledPolesKeepsItsDigits) {
  LinearSystem<2, 1, 1> system;
  system.sample_time = 1.0;
  system.a << -1e-12, 0.0, 3.0, -0.5;
  EXPECT_NEAR(stability_abscissa(system), -1e-12, 1e-15);
  system.a(0, 0) = 1e-12;
  EXPECT_NEAR(stability_abscissa(system), 1e-12, 1e-15);
  system.a(0, 0) = -2.5;
  EXPECT_NEAR(spectral_radius(system), 1.5, 1e-14);
}

TEST(Balance, ChangesNoTransferFunction) {
  LinearSystem<3, 1, 1> system;
  system.a << -1.0, 1e6, 0.0, 1e-7, -2.0, 1e9, 3e-9, 1e-8, -3.0;
  system.b << 1.0, 1e-6, 5e-12;
  system.c << 1.0, 2.0, 3.0;
  auto scaled = system;
  balance(scaled);
  // Markov parameters c a^k b do not depend on the scaling, which is by powers of two.
  EigenMatrix<double, 3> x = system.b;
  EigenMatrix<double, 3> y = scaled.b;
  for (int k = 0; k < 5; ++k) {
    EXPECT_NEAR(scaled.c.dot(y) / system.c.dot(x), 1.0, 1e-12);
    x = system.a * x;
    y = scaled.a * y;
  }
  const double most = scaled.a.cwiseAbs().maxCoeff();
  EXPECT_LT(most, 2000.0);
}

TEST(Lyapunov, SolvesBothEquations) {
  Random random(6);
  int solved = 0;
  for (int trial = 0; trial < 300; ++trial) {
    EigenMatrix<double, 4, 4> a =
        random_matrix<4>(random) - 0.6 * EigenMatrix<double, 4, 4>::Identity();
    const auto half = random_matrix<4>(random);
    const EigenMatrix<double, 4, 4> q = half * half.transpose();
    LinearSystem<4, 1, 1> system;
    system.a = a;
    const bool sampled = trial % 2 == 0;
    system.sample_time = sampled ? 1.0 : 0.0;
    const bool stable = stability_abscissa(system) < 0.0;
    const auto p = solve_lyapunov<4>(a, q, sampled);
    ASSERT_EQ(p.has_value(), stable);
    if (!stable) continue;
    ++solved;
    EigenMatrix<double, 4, 4> left = a * *p + *p * a.transpose() + q;
    if (sampled) left += a * *p * a.transpose();
    EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-11 * p->cwiseAbs().maxCoeff());
  }
  EXPECT_GT(solved, 20);
  // Near the edge, where a wrong number of doublings would show.
  EigenMatrix<double, 1, 1> a = EigenMatrix<double, 1, 1>::Constant(-1e-9);
  const EigenMatrix<double, 1, 1> q = EigenMatrix<double, 1, 1>::Constant(1.0);
  EXPECT_NEAR(solve_lyapunov<1>(a, q, true).value()(0, 0) / (1.0 / (2e-9 - 1e-18)), 1.0, 1e-12);
  EXPECT_NEAR(solve_lyapunov<1>(a, q, false).value()(0, 0) / 5e8, 1.0, 1e-12);
  a(0, 0) = 0.0;
  EXPECT_EQ(refusal(solve_lyapunov<1>(a, q, true)),
            "system: is not stable: the stationary covariance does not exist");
  EXPECT_EQ(refusal(solve_lyapunov<1>(a, q, false)),
            "system: is not stable: the stationary covariance does not exist");
  a(0, 0) = std::nan("");
  EXPECT_EQ(refusal(solve_lyapunov<1>(a, q, true)),
            "system: is not stable: the stationary covariance does not exist");
  EXPECT_EQ(refusal(solve_lyapunov<1>(a, q, false)),
            "system: is not stable: the stationary covariance does not exist");
}

}  // namespace analysis_dense_test
