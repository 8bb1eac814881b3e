// Vectors and matrices of the public interface, and what of Eigen's converts from and to them.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <complex>
#include <concepts>
#include <esokit/core/error_text.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <sstream>
#include <support/pack.hpp>
#include <type_traits>

namespace core_matrix_test {

using esokit::eigen;
using esokit::Matrix;
using esokit::RowVector;
using esokit::Vector;

// ---- without Eigen

constexpr Matrix<double, 2, 3> wide{{1, 2, 3}, {4, 5, 6}};

TEST(Matrix, IsListedByRowsAndKeptByColumns) {
  static_assert(wide(0, 2) == 3 && wide(1, 0) == 4);
  static_assert(wide.rows() == 2 && wide.cols() == 3 && wide.size() == 6);
  const double columns[] = {1, 4, 2, 5, 3, 6};
  for (int i = 0; i < 6; ++i) EXPECT_EQ(wide.data()[i], columns[i]);
  int count = 0;
  for (const double element : wide) EXPECT_EQ(element, columns[count++]);
  EXPECT_EQ(count, 6);

  constexpr Vector<float, 3> v{1, 2.5, 3};
  static_assert(v(1) == 2.5f && v[2] == 3 && v == Vector<float, 3>{{1, 2.5, 3}});
  constexpr RowVector<double, 2> row{7, 8};
  static_assert(row(0, 1) == 8 && row[1] == 8);
  static_assert(Vector<double, 1>(3.0)(0) == 3);
  static_assert(Matrix<double, 2, 2>{} == Matrix<double, 2, 2>{{0, 0}, {0, 0}});
}

/// The language counts the elements, and takes none that does not fit.
template <class M, class... Elements>
concept Listed = requires(Elements... elements) {
  M{elements...};
};

TEST(Matrix, ListsOfAnotherLengthAreRefused) {
  using Vector3 = Vector<double, 3>;
  static_assert(Listed<Vector3, double, double, double> && Listed<Vector3>);
  static_assert(!Listed<Vector3, double> && !Listed<Vector3, double, double>);
  static_assert(!Listed<Vector3, double, double, double, double>);
  static_assert(Listed<Vector<float, 2>, float, float>);
#if !defined(__clang__)  // takes a narrowing list for a valid one in a requires-expression
  static_assert(!Listed<Vector<float, 2>, double, float>);
#endif
  static_assert(!std::is_convertible_v<double, Vector<double, 1>>);
  static_assert(std::is_constructible_v<Vector<double, 1>, double>);
}

TEST(Matrix, Operations) {
  constexpr Matrix<double, 2, 2> a{{1, 2}, {3, 4}};
  static_assert(a * a == Matrix<double, 2, 2>{{7, 10}, {15, 22}});
  static_assert(a * wide == Matrix<double, 2, 3>{{9, 12, 15}, {19, 26, 33}});
  static_assert(wide.transpose() == Matrix<double, 3, 2>{{1, 4}, {2, 5}, {3, 6}});
  static_assert(a + a == 2 * a && a - 2 * a == -a && a * 2 / 4 == a * 0.5);
  static_assert(a.row(1) == RowVector<double, 2>{3, 4} && a.col(1) == Vector<double, 2>{2, 4});
  static_assert(a.sum() == 10 && a.trace() == 5);
  static_assert(Matrix<double, 2, 2>::Identity() * a == a);
  static_assert(Matrix<double, 2, 2>::Constant(3) == Matrix<double, 2, 2>{{3, 3}, {3, 3}});
  static_assert(Matrix<double, 2, 2>::Diagonal({5, 6}) == Matrix<double, 2, 2>{{5, 0}, {0, 6}});
  constexpr Vector<double, 4> v{1, 2, 3, 4};
  static_assert(v.head<2>() == Vector<double, 2>{1, 2});
  static_assert(v.segment<2>(1) == Vector<double, 2>{2, 3});
  static_assert(v.dot(v) == 30);
  static_assert(double{v.transpose() * v} == 30);  // the only element
  static_assert(a != 2 * a && !(a == -a));
  Matrix<double, 2, 2> b = a;
  b += a;
  b -= 3 * a;
  b *= 4;
  b /= 2;
  EXPECT_EQ(b, -2 * a);
  b(0, 1) = 9;
  EXPECT_EQ(b, (Matrix<double, 2, 2>{{-2, 9}, {-6, -8}}));
}

TEST(Matrix, HasTheLayoutOfItsElements) {
  static_assert(sizeof(Vector<float, 3>) == 3 * sizeof(float));
  static_assert(alignof(Vector<double, 4>) == alignof(double));
  static_assert(std::is_trivially_copyable_v<Matrix<float, 2, 2>>);
}

TEST(Matrix, HasText) {
  std::ostringstream out;
  out << wide << "; " << wide.row(0);
  EXPECT_EQ(out.str(), "1 2 3\n4 5 6; 1 2 3");
  EXPECT_EQ(esokit::to_text(Vector<int, 2>{1, -2}), "1\n-2");
}

TEST(Matrix, OfPacksAndComplexNumbers) {
  using Pack = esokit_test::Pack<double, 4>;
  const Vector<Pack, 2> v{Pack(1), Pack(2)};
  EXPECT_EQ((v + v)(1)[3], 4);
  EXPECT_EQ(v.dot(v)[3], 5);
  const std::complex<double> i(0, 1);
  EXPECT_EQ((Vector<std::complex<double>, 2>{i, 2.0 * i} * i)(1), -2.0);
}

#ifndef NDEBUG
TEST(MatrixDeathTest, IndexOutOfBounds) {
  Vector<double, 2> v;
  volatile int i = 2;
  EXPECT_DEATH(v(i) = 1, "i < count");
  i = -1;
  EXPECT_DEATH(v[i] = 1, "i >= 0");
  Matrix<double, 2, 3> m;
  EXPECT_DEATH(m(0, i) = 1, "j >= 0");
  i = 2;
  EXPECT_DEATH(m(i, 0) = 1, "i < Rows");
  EXPECT_DEATH((void)v.segment<2>(i - 1), "i < count");
  EXPECT_DEATH(v = Eigen::VectorXd::Zero(3), "expression.rows");
}
#endif

// ---- with Eigen

TEST(Matrix, BecomesAnEigenType) {
  const Vector<double, 3> z{1, 2, 3};
  const Eigen::Vector3d expected(1, 2, 3);
  const Eigen::Vector3d copied = z;
  const Eigen::Vector3d direct(z);
  const Eigen::Vector3d listed{z};
  const Eigen::Vector3d& bound = z;
  Eigen::Vector3d assigned;
  assigned = z;
  Eigen::VectorXd dynamic = z;
  const Eigen::Array3d array = z;
  for (const Eigen::Vector3d& v : {copied, direct, listed, bound, assigned}) {
    EXPECT_EQ(v, expected);
  }
  EXPECT_EQ(dynamic, expected);
  EXPECT_EQ(array.matrix(), expected);
  dynamic.resize(7);
  dynamic = z;
  EXPECT_EQ(dynamic, expected);
  EXPECT_EQ([](const Eigen::VectorXd& x) { return x.sum(); }(z), 6);
  const Eigen::MatrixXd matrix = wide;
  EXPECT_EQ(matrix(1, 0), 4);
  const Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_rows = wide;
  EXPECT_EQ(by_rows(0, 2), 3);
  const Eigen::RowVector3d row = z.transpose();
  EXPECT_EQ(row, expected.transpose());
}

TEST(Matrix, IsMadeOfAnEigenExpression) {
  const Eigen::Vector3d a(1, 2, 3);
  const Eigen::Matrix3d twice = 2 * Eigen::Matrix3d::Identity();
  const Vector<double, 3> expected{2, 4, 6};
  EXPECT_EQ((Vector<double, 3>(a + a)), expected);
  EXPECT_EQ((Vector<double, 3>(twice * a)), expected);
  EXPECT_EQ((Vector<double, 3>(Eigen::VectorXd(2 * a))), expected);
  EXPECT_EQ((Vector<double, 3>(twice.diagonal().cwiseProduct(a))), expected);
  const Matrix<double, 3, 3> diagonal = a.asDiagonal();
  EXPECT_EQ(diagonal, (Matrix<double, 3, 3>::Diagonal({1, 2, 3})));
  const Matrix<double, 2, 2> block =
      (Eigen::Matrix3d() << 1, 2, 3, 4, 5, 6, 7, 8, 9).finished().topRightCorner<2, 2>();
  EXPECT_EQ(block, (Matrix<double, 2, 2>{{2, 3}, {5, 6}}));
  Vector<double, 3> assigned;
  assigned = a;
  EXPECT_EQ(assigned + a, expected);
  EXPECT_EQ(a + assigned, expected);
  EXPECT_EQ(twice * assigned, expected);
  EXPECT_EQ(expected - a, assigned);
  EXPECT_EQ(double(a.transpose() * assigned), 14);
  EXPECT_EQ(double(assigned.transpose() * a), 14);
  EXPECT_TRUE(assigned == a && a == assigned);
}

TEST(Matrix, OfAnotherSizeOrScalarDoesNotConvert) {
  using Vector3 = Vector<double, 3>;
  static_assert(std::is_convertible_v<Vector3, Eigen::Vector3d>);
  static_assert(std::is_convertible_v<Eigen::Vector3d, Vector3>);
  static_assert(!std::is_convertible_v<Vector3, Eigen::Vector2d>);
  static_assert(!std::is_convertible_v<Vector3, Eigen::RowVector3d>);
  static_assert(!std::is_convertible_v<Vector3, Eigen::Vector3f>);
  static_assert(!std::is_convertible_v<Vector3, Eigen::RowVectorXd>);
  static_assert(!std::is_convertible_v<Eigen::Vector2d, Vector3>);
  static_assert(!std::is_convertible_v<Eigen::RowVector3d, Vector3>);
  static_assert(!std::is_convertible_v<Eigen::Vector3f, Vector3>);
  static_assert(!std::is_convertible_v<Vector3, double>);
  static_assert(!std::is_convertible_v<Vector3, std::string>);
}

TEST(Matrix, IsMappedByEigen) {
  Vector<double, 3> z{3, 0, 4};
  EXPECT_EQ(eigen(z).norm(), 5);
  eigen(z) *= 2;
  eigen(z).tail<1>().setZero();
  EXPECT_EQ(z, (Vector<double, 3>{6, 0, 0}));
  const Vector<double, 3> fixed = z;
  static_assert(!std::is_assignable_v<decltype(eigen(fixed)(0)), double>);
  EXPECT_EQ(eigen(fixed).data(), fixed.data());
  // What a temporary had is copied.
  const auto kept = eigen(Vector<double, 3>{1, 2, 3});
  static_assert(std::same_as<const Eigen::Vector3d, decltype(kept)>);
  EXPECT_EQ(kept.sum(), 6);
  Matrix<double, 2, 3> m = wide;
  EXPECT_EQ(eigen(m)(0, 2), 3);
  EXPECT_EQ(eigen(m.row(1)).sum(), 15);
}

TEST(Matrix, OfAnObserverWithEigen) {
  auto observer =
      esokit::LinearEso<2>::make({.observer_bandwidth = 30, .input_gain = 2, .sample_time = 1e-3})
          .value();
  EXPECT_EQ(observer.reset(Eigen::Vector3d{1, 2, 3}), esokit::StepStatus::ok);
  EXPECT_EQ(observer.reset(2 * Eigen::Vector3d{1, 2, 3}), esokit::StepStatus::ok);
  const Eigen::Vector3d z = observer.estimate();
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(z(i), 2 * (i + 1), 1e-13);
    EXPECT_EQ(z(i), observer.estimate()(i));
    EXPECT_EQ(z(i), observer.estimate()[i]);
  }
  EXPECT_EQ((eigen(observer.estimate()) - z).norm(), 0);
}

}  // namespace core_matrix_test
