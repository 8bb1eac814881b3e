// By how much the gains may be multiplied: constant factors, and factors that vary.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/gain/certificate/continuous_certificate.hpp>
#include <esokit/gain/certificate/gain_interval.hpp>
#include <numbers>
#include <support/numbers.hpp>
#include <support/switching.hpp>

namespace esokit_test {
namespace gain_gain_interval_test {

using esokit::constant_gain_interval;
using esokit::EqualSampledPoles;
using esokit::gain_range_certified;
using esokit::largest_certified_gain;
using esokit::least_certified_gain;
using std::numbers::pi;

template <int N>
EqualSampledPoles<N, double> poles(double omega_t) {
  return EqualSampledPoles<N, double>::from_bandwidth(omega_t, 1.0);
}

template <int N>
esokit::ScaledGain<N, double> sampled(double omega_t) {
  return esokit::current_gain<N, double>(poles<N>(omega_t).weights());
}

template <int N>
Column<N> continuous() {
  return esokit::continuous_gain<N, double>(1.0);
}

/// Number between low and high at which `stable` changes.
template <class Stable>
double edge(double low, double high, Stable stable) {
  const bool below = stable(low);
  EXPECT_NE(below, stable(high));
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (stable(middle) == below ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Where the eigenvalues of the error cross into instability.
template <int N>
void constant_gain_ends() {
  const double low = edge(N == 2 ? -0.5 : 1e-4, 1.0, [](double k) {
    return spectral_abscissa<N>(continuous_error_matrix<N>(Column<N>(continuous<N>() * k))) < 0;
  });
  EXPECT_NEAR(constant_gain_interval<N>().lower, low, 1e-9) << N;
  EXPECT_TRUE(std::isinf(constant_gain_interval<N>().upper));
  for (const double omega_t : {0.1, 0.5, 2.0, 10.0}) {
    const auto stable = [&](double k) {
      return spectral_radius<N>(sampled_error_matrix<N>(
                 esokit::multiplied<N, double>(sampled<N>(omega_t), k))) < 1;
    };
    const auto interval = constant_gain_interval(poles<N>(omega_t));
    EXPECT_NEAR(interval.lower, edge(N == 2 ? -0.5 : 1e-4, 1.0, stable), 1e-9)
        << N << ' ' << omega_t;
    EXPECT_NEAR(interval.upper, edge(1.0, 100.0, stable), 1e-9 * interval.upper)
        << N << ' ' << omega_t;
    const double c = (1 + std::exp(-omega_t)) / 2;
    EXPECT_NEAR(interval.upper, 1 / (1 - std::pow(c, N)), 1e-12 * interval.upper);
    if (N > 2) {
      EXPECT_NEAR(interval.lower, 1 / (1 + std::pow(c / std::cos(pi / N), N)), 1e-12);
    }
  }
}

TEST(ConstantGainInterval, EqualsEigenvalues) {
  constant_gain_ends<2>();
  constant_gain_ends<3>();
  constant_gain_ends<4>();
  constant_gain_ends<5>();
}

/// Sheet 4: 1/9 and 1/5; N = 3, omega T = 0.5: 0.194 .. 2.08.
TEST(ConstantGainInterval, PrintedNumbers) {
  EXPECT_NEAR(constant_gain_interval<3>().lower, 1.0 / 9.0, 1e-15);
  EXPECT_NEAR(constant_gain_interval<4>().lower, 1.0 / 5.0, 1e-15);
  EXPECT_EQ(constant_gain_interval<2>().lower, 0.0);
  const auto interval = constant_gain_interval(poles<3>(0.5));
  EXPECT_NEAR(interval.lower, 0.194, 5e-4);
  EXPECT_NEAR(interval.upper, 2.08, 5e-3);
}

/// Closed forms of what is certified, against the general test.
template <int N>
void certified_ends() {
  for (const double omega_t : {0.01, 0.3, 1.0, 5.0}) {
    const auto gain = sampled<N>(omega_t);
    const double least =
        edge(1e-3, 1.0, [&](double k) { return gain_range_certified<N, double>(gain, k, 1.0); });
    EXPECT_NEAR(least_certified_gain(poles<N>(omega_t)), least, 1e-9) << N << ' ' << omega_t;
    // With k_min = 1 every stable constant k above it is certified.
    const double ceiling = constant_gain_interval(poles<N>(omega_t)).upper;
    EXPECT_NEAR((largest_certified_gain<N, double>(gain, 1.0, 1.0, ceiling)), ceiling,
                1e-9 * ceiling);
  }
  const double least = edge(
      1e-3, 1.0, [](double k) { return gain_range_certified<N, double>(continuous<N>(), k, 1.0); });
  EXPECT_NEAR(least_certified_gain<N>(), least, 1e-9) << N;
  // Without an upper end from (N - 1) / (2 N) on (sheet 4: 1/3, 3/8 for N = 3, 4).
  const double free_from = edge(
      1e-3, 1.0, [](double k) { return gain_range_certified<N, double>(continuous<N>(), k, 1e7); });
  EXPECT_NEAR(esokit::unbounded_certified_gain<N>(), free_from, 1e-4) << N;
  EXPECT_LT(esokit::unbounded_certified_gain<N>(), 0.5);
}

TEST(CertifiedGain, ClosedFormsEqualTheTest) {
  certified_ends<3>();
  certified_ends<4>();
  certified_ends<6>();
  EXPECT_NEAR(esokit::unbounded_certified_gain<3>(), 1.0 / 3.0, 1e-15);
  EXPECT_NEAR(esokit::unbounded_certified_gain<4>(), 3.0 / 8.0, 1e-15);
}

TEST(CertifiedGain, LargestIsCertifiedAndTheNextIsNot) {
  for (const double omega_t : {0.05, 0.5, 1.5, 5.0}) {
    const auto gain = sampled<4>(omega_t);
    const double low = 1.1 * least_certified_gain(poles<4>(omega_t));
    const double ceiling = constant_gain_interval(poles<4>(omega_t)).upper;
    const double most = largest_certified_gain<4, double>(gain, low, std::max(low, 0.9), ceiling);
    EXPECT_TRUE((gain_range_certified<4, double>(gain, low, most)));
    EXPECT_FALSE((gain_range_certified<4, double>(gain, low, most * (1 + 1e-9))));
    EXPECT_GT(most, 1);
    EXPECT_LE(most, ceiling);
  }
}

// ---- why the constant-k interval is not enough

/// Sheet 4: N = 3, k = 0.15 for 3.5 / w, then 5 for 0.2 / w, grows at +0.034 w.
TEST(CertifiedGain, VaryingGainInsideTheConstantIntervalGrows) {
  const Column<3> l = continuous<3>();
  const Square<3> low = continuous_error_matrix<3>(Column<3>(l * 0.15));
  const Square<3> high = continuous_error_matrix<3>(Column<3>(l * 5));
  EXPECT_GT(0.15, constant_gain_interval<3>().lower);
  EXPECT_LT(spectral_abscissa<3>(low), 0);
  EXPECT_LT(spectral_abscissa<3>(high), 0);
  EXPECT_NEAR(periodic_growth<3>(low, 3.5, high, 0.2), 0.034, 0.001);
  EXPECT_FALSE((gain_range_certified<3, double>(l, 0.15, 5.0)));
}

/// No periodic, random or greedy switching makes a certified pair grow.
TEST(CertifiedGain, CertifiedPairDecays) {
  const Column<3> l = continuous<3>();
  ASSERT_TRUE((gain_range_certified<3, double>(l, 0.34, 50.0)));
  const Square<3> low = continuous_error_matrix<3>(Column<3>(l * 0.34));
  const Square<3> high = continuous_error_matrix<3>(Column<3>(l * 50));
  double worst = -1e9;
  for (double t_low = 0.05; t_low < 12; t_low *= 1.2) {
    for (double t_high = 0.002; t_high < 12; t_high *= 1.2) {
      worst = std::max(worst, periodic_growth<3>(low, t_low, high, t_high));
    }
  }
  EXPECT_LT(worst, 0);

  constexpr double omega_t = 0.2;
  const auto gain = sampled<4>(omega_t);
  const double k_min = 0.45;
  const double k_max = 3.0;
  ASSERT_TRUE((gain_range_certified<4, double>(gain, k_min, k_max)));
  const Column<4> weight(1, 5, 25, 125);
  for (int seed = 0; seed < 40; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    Column<4> x;
    for (int i = 0; i < 4; ++i) x(i) = random.uniform(-1, 1) / weight(i);
    const double start = x.cwiseProduct(weight).norm();
    for (int i = 0; i < 3000; ++i) {
      double k = random.uniform(k_min, k_max);
      if (seed % 2 == 1) {
        // The end that lets the error be larger 20 samples on.
        double largest = -1;
        for (const double candidate : {k_min, k_max}) {
          Column<4> next = x;
          const auto step = sampled_error_matrix<4>(esokit::multiplied<4, double>(gain, candidate));
          for (int j = 0; j < 1 + seed; ++j) next = step * next;
          if (next.cwiseProduct(weight).norm() > largest) {
            largest = next.cwiseProduct(weight).norm();
            k = candidate;
          }
        }
      }
      x = sampled_error_matrix<4>(esokit::multiplied<4, double>(gain, k)) * x;
    }
    EXPECT_LT(x.cwiseProduct(weight).norm(), 1e-3 * start) << seed;
  }
}

}  // namespace gain_gain_interval_test
}  // namespace esokit_test
