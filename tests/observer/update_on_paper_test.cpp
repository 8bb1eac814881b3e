// Every linear observer of a chain against the two equations at the head of
// predictor_corrector.hpp, with Phi and Gamma written out.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/numbers.hpp>

namespace observer_update_on_paper_test {

using esokit::HalfGainEso;
using esokit::LinearEso;
using esokit_test::Random;

template <class Observer>
class UpdateOnPaper : public ::testing::Test {};
using Observers =
    ::testing::Types<LinearEso<1>, LinearEso<2>, LinearEso<3>, LinearEso<2, double, 2>,
                     LinearEso<1, float>, LinearEso<2, float>, HalfGainEso<2>>;
TYPED_TEST_SUITE(UpdateOnPaper, Observers);

double power_over_factorial(double T, int i) { return std::pow(T, i) / std::tgamma(i + 1.0); }

TYPED_TEST(UpdateOnPaper, IsWhatUpdateComputes) {
  using S = typename TypeParam::scalar_type;
  constexpr int n = TypeParam::order;
  constexpr int N = TypeParam::size;
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;
  for (const double b0 : {3.0, -0.4}) {
    const double T = 0.01;
    auto observer =
        TypeParam::make(
            {.observer_bandwidth = S(0.4 / T), .input_gain = S(b0), .sample_time = S(T)})
            .value();
    Matrix phi = Matrix::Zero();
    Vector gamma = Vector::Zero();
    for (int i = 0; i < N; ++i) {
      for (int j = i; j < N; ++j) phi(i, j) = power_over_factorial(T, j - i);
      if (i < n) gamma(i) = b0 * power_over_factorial(T, n - i);
    }
    const auto estimate = [&] {
      Vector z;
      for (int i = 0; i < N; ++i) z(i) = static_cast<double>(observer.estimate()(i));
      return z;
    };
    // From rest one sample with y = 1 leaves the gain.
    observer.reset(S(0));
    observer.update(S(1), S(0));
    const Vector k = estimate();
    Random random(7);
    Vector z = k;
    double largest = 0;
    for (int sample = 0; sample < 2000; ++sample) {
      const double y = static_cast<S>(random.uniform(-1, 1));
      const double u = static_cast<S>(random.uniform(-1, 1));
      observer.update(static_cast<S>(y), static_cast<S>(u));
      z = esokit::update_on_paper(phi, gamma, k, z, u, y);
      for (int i = 0; i < N; ++i) {
        const double unit = power_over_factorial(T, i);
        largest = std::max(largest, std::abs((z(i) - estimate()(i)) * unit));
      }
    }
    EXPECT_LE(largest, 200 * static_cast<double>(std::numeric_limits<S>::epsilon()));
  }
}

}  // namespace observer_update_on_paper_test
