// The steady state of the Riccati recursion, against 100 digits and against known solutions.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/gain/riccati.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/high_precision.hpp>
#include <support/numbers.hpp>

namespace esokit_test::gain_riccati_test {

using esokit::CovarianceFactor;
using esokit::steady_covariance;

/// Several right-hand sides beside each other, and what is not positive definite at each pivot.
TEST(SolvePositive, EachColumnOfItsOwn) {
  Eigen::Matrix3d a;
  a << 4, 1, -2, 1, 5, 0.5, -2, 0.5, 9;
  Eigen::Matrix<double, 3, 2> x;
  x << 1, -7, 2, 0.5, -3, 4;
  const auto solved = esokit::detail::solve_positive<3, 2, double>(a, a * x);
  ASSERT_TRUE(solved.has_value());
  EXPECT_LT((Eigen::Matrix<double, 3, 2>(*solved) - x).cwiseAbs().maxCoeff(), 1e-14);
  for (int i = 0; i < 3; ++i) {
    for (const double bad : {0.0, -1.0, hidden_nan<double>(), hidden_infinity<double>()}) {
      Eigen::Matrix3d spoilt = a;
      spoilt(i, i) = bad;
      EXPECT_FALSE((esokit::detail::solve_positive<3, 2, double>(spoilt, a * x).has_value()))
          << i << ' ' << bad;
    }
  }
}

/// x = f x f + w has the solution w / (1 - f^2); summed to the last digits, and a sum that the
/// scalar cannot hold, or that does not end, is none.
TEST(SolveStein, SumsToTheLastDigits) {
  const auto solved = [](double f, double w) {
    return esokit::detail::solve_stein<1, double>(esokit::Matrix<double, 1, 1>(f),
                                                  esokit::Matrix<double, 1, 1>(w));
  };
  for (const double f : {0.0, 0.5, -0.9, 0.99, 0.9999}) {
    const double x = 3.0 / ((1.0 - f) * (1.0 + f));
    ASSERT_TRUE(solved(f, 3.0)) << f;
    // The difference to one is what is squared: 1 - f has its digits.
    EXPECT_NEAR((*solved(f, 3.0))(0), x, 32 * std::numeric_limits<double>::epsilon() * x) << f;
  }
  EXPECT_FALSE(solved(1.0, 3.0));
  EXPECT_FALSE(solved(-1.01, 3.0));
  EXPECT_TRUE(solved(0.5, 1e308));
  EXPECT_FALSE(solved(0.9, 1e308));
}

/// Gain of the recursion on dense matrices in 100 digits, in Nordsieck scaling, run until it stands
/// still.
std::vector<Big> reference_limit(const std::vector<double>& q, double r, double theta) {
  using Square = std::vector<std::vector<Big>>;
  const std::size_t n = q.size();
  const Big growth = 1 + Big(theta);
  Square p(n, std::vector<Big>(n, Big(0)));
  for (std::size_t i = 0; i < n; ++i) p[i][i] = 1;
  std::vector<Big> gain(n, Big(0));
  for (int k = 0; k < 100000; ++k) {
    const Big s = p[0][0] + Big(r) / growth;
    Big change = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const Big next = p[i][0] / s;
      const Big moved = abs(next - gain[i]) / next;
      if (moved > change) change = moved;
      gain[i] = next;
    }
    if (change < Big(1e-25)) break;
    Square corrected = p;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) corrected[i][j] -= p[i][0] * p[0][j] / s;
    }
    Square half(n, std::vector<Big>(n, Big(0)));
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t l = i; l < n; ++l) {
          half[i][j] += Big(choose(static_cast<int>(l), static_cast<int>(i))) * corrected[l][j];
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        Big sum = 0;
        for (std::size_t l = j; l < n; ++l) {
          sum += Big(choose(static_cast<int>(l), static_cast<int>(j))) * half[i][l];
        }
        p[i][j] = growth * sum;
      }
      p[i][i] += Big(q[i]) * (theta > 0 ? growth / Big(theta) : Big(1));
    }
  }
  return gain;
}

template <int Size, class S>
esokit::ScaledGain<Size, S> limit_gain(const std::vector<double>& q, double r, double theta) {
  CovarianceFactor<Size, S> noise;
  for (int i = 0; i < Size; ++i) {
    const double inflated = theta > 0 ? (1 + theta) / theta : 1;
    noise.set_variance(i, static_cast<S>(q[static_cast<std::size_t>(i)] * inflated));
  }
  const auto factor =
      steady_covariance<Size, S>(noise, static_cast<S>(r / (1 + theta)), static_cast<S>(1 + theta));
  EXPECT_TRUE(factor.has_value());
  if (!factor) return {};
  const S d = factor->variance(0);
  return factor->gain(d / (d + static_cast<S>(r / (1 + theta))));
}

template <class Gain>
double distance(const Gain& gain, const std::vector<Big>& reference) {
  double worst = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    worst = std::max(worst, static_cast<double>(abs(Big(Big(gain[i]) / reference[i] - 1))));
  }
  return worst;
}

/// Largest absolute value of the poles of Phi (I - k C): |M^(2^40)|^(2^-40).
template <class Gain>
double spectral_radius(const Gain& gain) {
  const auto n = static_cast<int>(gain.size());
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = i; j < n; ++j) {
      const double phi = choose(j, i);
      m(i, j) += phi;
      m(i, 0) -= phi * static_cast<double>(gain[static_cast<std::size_t>(j)]);
    }
  }
  double log_radius = 0;
  double share = 1;
  for (int squaring = 0; squaring < 40; ++squaring) {
    double norm = 0;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) norm = std::max(norm, std::abs(m(i, j)));
    }
    if (!(norm > 0)) return 0;
    log_radius += share * std::log(norm);
    share /= 2;
    m /= norm;
    m = Eigen::MatrixXd(m.lazyProduct(m));
  }
  return std::exp(log_radius);
}

/// 1e-10 is asked for; the recursion's last word makes it a few units in the last place, which the
/// memory of the filter (up to 30 samples here) multiplies. Orders and extensions enter by N = n +
/// m alone: N = 2, 3 and 6 are n = 1, 2 and 4 with m = 1 and 2.
template <int Size>
void limit_equals_reference() {
  constexpr double unit = 100 * std::numeric_limits<double>::epsilon();
  constexpr double single_unit = 100 * static_cast<double>(std::numeric_limits<float>::epsilon());
  for (const double highest : {10.0, 1e-2, 1e-6}) {
    for (const double others : {0.0, 1e-3}) {
      for (const double theta : {0.0, 0.05, 0.5, 3.0}) {
        std::vector<double> q(Size, others);
        q.back() = highest;
        SCOPED_TRACE(::testing::Message() << "N = " << Size << ", q " << highest << ", " << others
                                          << ", theta " << theta);
        const auto reference = reference_limit(q, 1.0, theta);
        const auto gain = limit_gain<Size, double>(q, 1.0, theta);
        EXPECT_LE(distance(gain, reference), unit);
        EXPECT_LE(distance(limit_gain<Size, float>(q, 1.0, theta), reference), single_unit);
        EXPECT_LT(spectral_radius(gain), 1 / std::sqrt(1 + theta));
      }
    }
  }
}

TEST(Riccati, limit_equals_100_digits) {
  limit_equals_reference<2>();
  limit_equals_reference<3>();
  limit_equals_reference<6>();
}

/// Q -> 0: all poles go to 1 / (1 + theta). In proportion to Q once that is small beside a^2N, a =
/// 1 - 1 / (1 + theta), the variance that the filter without disturbance leaves; the next power of
/// Q is below a hundredth then.
TEST(Riccati, poles_as_the_disturbance_vanishes) {
  for (const double theta : {0.1, 0.5, 2.0}) {
    const double contraction = theta / (1 + theta);
    const auto limit = esokit::current_gain<3, double>(
        esokit::EqualSampledPoles<3, double>{contraction}.weights());
    double last = 0;
    for (const double share : {1e-6, 1e-8, 1e-10}) {
      const double q = share * std::pow(contraction, 6);
      const auto gain = limit_gain<3, double>({q, q, q}, 1.0, theta);
      double worst = 0;
      for (std::size_t i = 0; i < 3; ++i) worst = std::max(worst, std::abs(gain[i] / limit[i] - 1));
      if (last > 0) {
        EXPECT_NEAR(worst / last, 0.01, 1e-4) << theta << ", " << q;
      }
      last = worst;
    }
  }
}

TEST(Riccati, limit_without_noise_is_deadbeat_like) {
  // R = 0 and only the highest state disturbed: the measured state is known exactly.
  EXPECT_LE(
      distance(limit_gain<3, double>({0, 0, 1}, 0.0, 0.5), reference_limit({0, 0, 1}, 0.0, 0.5)),
      1e-13);
}

/// Q = 0: all poles at 1 / (1 + theta), the linear observer.
template <int Size>
void without_disturbance_it_is_the_linear_observer() {
  for (const double theta : {0.02, 0.3, 2.0, 100.0}) {
    const auto factor = steady_covariance<Size, double>({}, 1 / (1 + theta), 1 + theta);
    ASSERT_TRUE(factor.has_value());
    const double d = factor->variance(0);
    const auto gain = factor->gain(d / (d + 1 / (1 + theta)));
    const auto expected = esokit::current_gain<Size, double>(
        esokit::EqualSampledPoles<Size, double>{theta / (1 + theta)}.weights());
    for (std::size_t i = 0; i < Size; ++i) {
      // The recursion remembers 1 / theta samples' rounding.
      EXPECT_NEAR(gain[i] / expected[i], 1, 1e-13 * (1 + 1 / theta)) << theta << " row " << i;
    }
  }
}

TEST(Riccati, without_disturbance_it_is_the_linear_observer) {
  without_disturbance_it_is_the_linear_observer<2>();
  without_disturbance_it_is_the_linear_observer<3>();
  without_disturbance_it_is_the_linear_observer<6>();
}

TEST(Riccati, says_when_there_is_no_limit) {
  CovarianceFactor<3, double> noise;
  EXPECT_FALSE((steady_covariance<3, double>(noise, 1.0, 1.0)));  // the gain goes to zero
  noise.set_variance(1, 1.0);  // the highest state is not reached
  EXPECT_FALSE((steady_covariance<3, double>(noise, 1.0, 1.0)));
  noise = {};
  EXPECT_FALSE((steady_covariance<3, double>(noise, 0.0, 1.5)));  // Q = R = 0
}

TEST(Riccati, general_model_says_when_not_stabilisable) {
  esokit::RiccatiModel<2, 1, double> model;
  model.transition = {{1.2, 0}, {0, 0.5}};  // an unstable mode that is not measured
  model.output = {0, 1};
  eigen(model.noise).setIdentity();
  model.measurement(0, 0) = 1;
  EXPECT_FALSE((esokit::riccati_covariance<2, 1, double>(model, Eigen::Vector2d(0, 0.1))));
}

/// Two outputs, full R: the residual of the equation itself.
TEST(Riccati, general_model_solves_the_equation) {
  esokit::RiccatiModel<3, 2, double> model;
  model.transition = {{1, 1, 0}, {0, 1, 0}, {0, 0, 1}};
  model.output = {{1, 0, 0}, {0, 0, 1}};
  model.noise = Eigen::Vector3d(0.1, 0.01, 0.5).asDiagonal();
  model.measurement = {{1, 0.3}, {0.3, 2}};
  model.inflation = 1.1;
  Eigen::Matrix<double, 3, 2> start;
  start << 1, 0, 1, 0, 0, 1;
  const auto p = esokit::riccati_covariance<3, 2, double>(model, start);
  ASSERT_TRUE(p.has_value());
  const Eigen::Matrix2d s = model.output * *p * model.output.transpose() + model.measurement;
  Eigen::Matrix2d inverse;
  inverse << s(1, 1), -s(0, 1), -s(1, 0), s(0, 0);
  inverse /= s(0, 0) * s(1, 1) - s(0, 1) * s(1, 0);
  const Eigen::Matrix<double, 3, 2> k = *p * model.output.transpose() * inverse;
  const Eigen::Matrix3d next = model.inflation * model.transition * (*p - k * model.output * *p) *
                                   model.transition.transpose() +
                               model.noise;
  EXPECT_LE(eigen(next - *p).cwiseAbs().maxCoeff(), 1e-12 * eigen(*p).cwiseAbs().maxCoeff());
}

}  // namespace esokit_test::gain_riccati_test
