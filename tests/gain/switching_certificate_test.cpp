// The certificate for switching between two gain sets: limits, against eigenvalues and against the
// circle criterion, and what happens below and above them.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <esokit/gain/certificate/continuous_certificate.hpp>
#include <esokit/gain/certificate/switching_certificate.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <numbers>
#include <support/numbers.hpp>
#include <support/switching.hpp>

namespace esokit_test {
namespace gain_switching_certificate_test {

using esokit::Array;
using esokit::certified_ratio_limit;
using esokit::EqualSampledPoles;
using esokit::least_bandwidth_ratio;
using esokit::ScaledGain;
using esokit::switching_certified;
using esokit::SwitchingRule;
using std::numbers::pi;

template <int N>
ScaledGain<N, double> sampled(double omega_t) {
  return esokit::current_gain<N, double>(
      EqualSampledPoles<N, double>::from_bandwidth(omega_t, 1.0).weights());
}

template <int N>
Column<N> continuous(double omega) {
  return esokit::continuous_gain<N, double>(omega);
}

/// Least number above which `certified` holds, from below 1.
template <class Certified>
double least(Certified certified) {
  double low = 1e-9;
  double high = 1;
  for (int i = 0; i < 70; ++i) {
    const double middle = 0.5 * (low + high);
    (certified(middle) ? high : low) = middle;
  }
  return high;
}

template <int N>
void limits_equal_closed_forms() {
  const double limit = std::pow(std::tan(pi * (N - 1) / (4.0 * N)), 2);
  EXPECT_NEAR(least_bandwidth_ratio<N>(), limit, 1e-14);
  for (const double omega : {1.0, 37.0, 1e-3}) {
    const double found = least([&](double rho) {
      return switching_certified<N, double>(continuous<N>(omega), continuous<N>(rho * omega));
    });
    EXPECT_NEAR(found, limit, 1e-9) << "N = " << N;
  }
  for (const double omega_t : {1e-4, 1e-2, 0.1, 1.0, 3.0, 10.0}) {
    const double found = least([&](double rho) {
      return switching_certified<N, double>(sampled<N>(omega_t), sampled<N>(rho * omega_t));
    });
    // tanh(rho w T/2) / tanh(w T/2) = limit
    const double expected = 2 * std::atanh(limit * std::tanh(omega_t / 2)) / omega_t;
    EXPECT_NEAR(found, expected, 1e-9) << "N = " << N << ", omega T = " << omega_t;
    EXPECT_NEAR(certified_ratio_limit<N>(SwitchingRule::abeso, omega_t, 0.01, 1.0), expected,
                1e-12);
  }
}

TEST(SwitchingCertificate, LimitsEqualClosedForms) {
  limits_equal_closed_forms<2>();
  limits_equal_closed_forms<3>();
  limits_equal_closed_forms<5>();
  limits_equal_closed_forms<8>();
}

/// Sheet 3: 0.1716, 0.3333, 0.4465, 0.5279 for N = 2 .. 5.
TEST(SwitchingCertificate, PrintedLimits) {
  EXPECT_NEAR(least_bandwidth_ratio<2>(), 0.1716, 5e-5);
  EXPECT_NEAR(least_bandwidth_ratio<3>(), 1.0 / 3.0, 1e-15);
  EXPECT_NEAR(least_bandwidth_ratio<4>(), 0.4465, 5e-5);
  EXPECT_NEAR(least_bandwidth_ratio<5>(), 0.5279, 5e-5);
}

/// (9) of the paper, N = 3: (x - w^2 rho)(x^2 + w^2 (3 rho^2 - 8 rho + 3) x + w^4 rho^2) is the
/// characteristic polynomial of A_2 A_1.
TEST(SwitchingCertificate, PrintedCharacteristicPolynomial) {
  for (const double rho : {0.2, 0.7, 2.5}) {
    const double w = 5;
    const Square<3> product = continuous_error_matrix<3>(continuous<3>(rho * w)) *
                              continuous_error_matrix<3>(continuous<3>(w));
    for (const double x : {-3.0, 0.5, 40.0}) {
      const Square<3> shifted = x * Square<3>::Identity() - product;
      const double expected =
          (x - w * w * rho) *
          (x * x + w * w * (3 * rho * rho - 8 * rho + 3) * x + std::pow(w, 4) * rho * rho);
      EXPECT_NEAR(shifted.determinant(), expected, 1e-9 * std::abs(expected) + 1e-6);
    }
  }
}

/// The whole range of rho, on both sides of one.
TEST(SwitchingCertificate, RangeOfTheRatio) {
  EXPECT_NEAR((certified_ratio_limit<3>(SwitchingRule::abeso, 5.0, 0.1, 0.0)), 1.0 / 3.0, 1e-15);
  EXPECT_NEAR((certified_ratio_limit<3>(SwitchingRule::abeso, 5.0, 9.0, 0.0)), 3.0, 1e-14);
  EXPECT_NEAR((certified_ratio_limit<3>(SwitchingRule::beso, 5.0, 0.1, 0.0)), std::sqrt(1.0 / 3.0),
              1e-15);
  EXPECT_NEAR((certified_ratio_limit<3>(SwitchingRule::beso, 5.0, 9.0, 0.0)), std::sqrt(3.0),
              1e-14);
  // Sampled: the limit is where the test flips.
  for (const auto rule : {SwitchingRule::abeso, SwitchingRule::beso}) {
    for (const double omega_t : {1e-3, 0.3, 1.0, 4.0, 20.0}) {
      for (const double side : {0.1, 10.0}) {
        const double limit = certified_ratio_limit<3>(rule, omega_t / 0.01, side, 0.01);
        if (std::isinf(limit)) {
          EXPECT_GT(side, 1);
          EXPECT_TRUE((esokit::bandwidth_switching_certified<3>(rule, omega_t / 0.01, 1e3, 0.01)));
          continue;
        }
        const double inside = side < 1 ? limit * (1 + 1e-9) : limit * (1 - 1e-9);
        const double outside = side < 1 ? limit * (1 - 1e-9) : limit * (1 + 1e-9);
        EXPECT_TRUE((esokit::bandwidth_switching_certified<3>(rule, omega_t / 0.01, inside, 0.01)))
            << omega_t;
        EXPECT_FALSE(
            (esokit::bandwidth_switching_certified<3>(rule, omega_t / 0.01, outside, 0.01)))
            << omega_t;
        // Less strict than the continuous limit.
        const double strict = certified_ratio_limit<3>(rule, 1.0, side, 0.0);
        if (side < 1) {
          EXPECT_LT(limit, strict);
        } else {
          EXPECT_GT(limit, strict);
        }
      }
    }
  }
}

/// The closed form and the general test agree, also on the BESO pair.
TEST(SwitchingCertificate, ClosedFormAgreesWithGeneralTest) {
  Random random(5);
  for (int i = 0; i < 400; ++i) {
    const double omega_t = random.log_uniform(1e-3, 20);
    const double rho = random.log_uniform(0.05, 20);
    const auto a = sampled<4>(omega_t * rho);
    EXPECT_EQ((esokit::bandwidth_switching_certified<4>(SwitchingRule::abeso, omega_t, rho, 1.0)),
              (switching_certified<4, double>(a, sampled<4>(omega_t))))
        << omega_t << ' ' << rho;
    EXPECT_EQ((esokit::bandwidth_switching_certified<4>(SwitchingRule::beso, omega_t, rho, 1.0)),
              (switching_certified<4, double>(a, sampled<4>(omega_t / rho))));
    EXPECT_EQ((esokit::bandwidth_switching_certified<4>(SwitchingRule::beso, omega_t, rho, 0.0)),
              (switching_certified<4, double>(continuous<4>(omega_t * rho),
                                              continuous<4>(omega_t / rho))));
  }
}

/// Random real and complex poles with real parts in (-1.5, -0.3).
template <int N>
Array<std::complex<double>, N> random_poles(Random& random) {
  Array<std::complex<double>, N> poles{};
  for (std::size_t i = 0; i < N; ++i) {
    const double re = -random.uniform(0.3, 1.5);
    if (i + 1 < N && random.index(2) == 0) {
      const double im = random.uniform(0.1, 0.8);
      poles[i] = {re, im};
      poles[++i] = {re, -im};
    } else {
      poles[i] = re;
    }
  }
  return poles;
}

/// Least of cos(angle between p_1 and p_2) on the axis or the circle: the circle criterion.
template <class Phase>
double least_cosine(Phase phase) {
  double worst = 1;
  for (int i = 1; i < 2000; ++i) worst = std::min(worst, std::cos(phase(pi * i / 2000)));
  return worst;
}

/// Any pair: the test, the eigenvalues of the product, and the circle criterion say the same.
template <int N>
void general_pairs(int seed) {
  constexpr int pairs = 300 / stride;
  Random random(static_cast<std::uint64_t>(seed));
  int certified = 0;
  int refused = 0;
  for (int i = 0; i < pairs; ++i) {
    const double spread = random.log_uniform(0.2, 1);
    auto p = random_poles<N>(random);
    auto q = random_poles<N>(random);
    for (auto& pole : q) pole *= spread;

    const Column<N> first = esokit::continuous_gain<N, double>(p);
    const Column<N> second = esokit::continuous_gain<N, double>(q);
    const double continuous_cosine = least_cosine([&](double x) {
      const std::complex<double> s(0, std::tan(x / 2));
      double angle = 0;
      for (std::size_t j = 0; j < N; ++j) angle += std::arg(s - p[j]) - std::arg(s - q[j]);
      return angle;
    });
    if (std::abs(continuous_cosine) > 1e-4) {
      const bool found = switching_certified<N, double>(first, second);
      EXPECT_EQ(found, continuous_cosine > 0) << continuous_cosine;
      EXPECT_EQ(found, (product_avoids_negative_axis<N>(continuous_error_matrix<N>(second),
                                                        continuous_error_matrix<N>(first))))
          << continuous_cosine;
      (found ? certified : refused) += 1;
    }

    const double sample_time = random.log_uniform(0.05, 4);
    const auto place = [&](const Array<std::complex<double>, N>& poles) {
      return esokit::current_gain<N, double>(
          esokit::SampledPoleSet<N, double>::from_continuous(poles, sample_time).weights());
    };
    const double sampled_cosine = least_cosine([&](double x) {
      const std::complex<double> z = std::polar(1.0, x);
      double angle = 0;
      for (std::size_t j = 0; j < N; ++j) {
        angle +=
            std::arg(z - std::exp(p[j] * sample_time)) - std::arg(z - std::exp(q[j] * sample_time));
      }
      return angle;
    });
    if (std::abs(sampled_cosine) > 1e-4) {
      const bool found = switching_certified<N, double>(place(p), place(q));
      EXPECT_EQ(found, sampled_cosine > 0) << sampled_cosine;
      const Square<N> a = cayley<N>(sampled_error_matrix<N>(place(p)));
      const Square<N> b = cayley<N>(sampled_error_matrix<N>(place(q)));
      EXPECT_EQ(found, (product_avoids_negative_axis<N>(b, a))) << sampled_cosine;
      (found ? certified : refused) += 1;
    }
  }
  EXPECT_GT(certified, pairs / 8);
  EXPECT_GT(refused, pairs / 8);
}

TEST(SwitchingCertificate, AnyPairAgreesWithEigenvaluesAndCircleCriterion) {
  general_pairs<3>(2);
  general_pairs<6>(4);
}

/// An unstable gain set is never certified, not even with itself.
TEST(SwitchingCertificate, RefusesUnstableGains) {
  const Column<3> good = continuous<3>(2);
  for (const double k : {0.111, 0.05, 0.0, -1.0}) {  // stable for k > 1/9
    const Column<3> bad = good * k;
    EXPECT_FALSE((switching_certified<3, double>(bad, bad))) << k;
    EXPECT_FALSE((switching_certified<3, double>(good, bad))) << k;
    EXPECT_FALSE((switching_certified<3, double>(bad, good))) << k;
  }
  EXPECT_TRUE((switching_certified<3, double>(Column<3>(good * 0.112), Column<3>(good * 0.112))));
  const auto k = sampled<3>(0.5);
  auto bad = k;
  for (double& x : bad) x *= 2.08;  // stable for k < 2.076
  EXPECT_FALSE((switching_certified<3, double>(bad, bad)));
  EXPECT_TRUE((switching_certified<3, double>(k, k)));
  bad[1] = hidden_nan<double>();
  EXPECT_FALSE((switching_certified<3, double>(k, bad)));
  EXPECT_FALSE((switching_certified<3, double>(bad, k)));
}

/// In float the test is the same to within float: never certified beyond the limit, and close to
/// it.
TEST(SwitchingCertificate, FloatIsSafe) {
  using Poles = EqualSampledPoles<4, float>;
  for (const float omega_t : {1e-3f, 0.1f, 2.0f}) {
    const double limit =
        certified_ratio_limit<4>(SwitchingRule::abeso, static_cast<double>(omega_t), 0.1, 1.0);
    const auto gain = [&](double rho) {
      return esokit::current_gain<4, float>(
          Poles::from_bandwidth(omega_t * static_cast<float>(rho), 1.0f).weights());
    };
    EXPECT_FALSE((switching_certified<4, float>(gain(1), gain(limit * (1 - 1e-6)))));
    EXPECT_TRUE((switching_certified<4, float>(gain(1), gain(limit * (1 + 1e-3)))));
    EXPECT_NEAR(
        static_cast<double>(certified_ratio_limit<4>(SwitchingRule::abeso, omega_t, 0.1f, 1.0f)),
        limit, 1e-6);
  }
}

// ---- what the certificate is for

/// Largest growth rate over periodic switching with dwell times on a grid, for w = 1.
double worst_growth(const Square<3>& a, const Square<3>& b) {
  double worst = -1e9;
  for (double t_a = 0.1; t_a < 8; t_a *= 1.15) {
    for (double t_b = 0.1; t_b < 8; t_b *= 1.15) {
      worst = std::max(worst, periodic_growth<3>(a, t_a, b, t_b));
    }
  }
  return worst;
}

/// Sheet 3: at rho = 0.2 a periodic switching grows at +0.048 w, at 0.7 there is none.
TEST(SwitchingCertificate, CounterExampleBelowTheLimit) {
  const Square<3> full = continuous_error_matrix<3>(continuous<3>(1));
  const Square<3> slow = continuous_error_matrix<3>(continuous<3>(0.2));
  const Square<3> fair = continuous_error_matrix<3>(continuous<3>(0.7));
  EXPECT_LT(spectral_abscissa<3>(slow), 0);
  EXPECT_FALSE((switching_certified<3, double>(continuous<3>(1), continuous<3>(0.2))));
  EXPECT_NEAR(worst_growth(full, slow), 0.048, 0.002);
  EXPECT_TRUE((switching_certified<3, double>(continuous<3>(1), continuous<3>(0.7))));
  EXPECT_LT(worst_growth(full, fair), -0.3);
}

/// At a certified pair the error decays under random switching, and under the one that is chosen at
/// every moment to let it grow most.
TEST(SwitchingCertificate, CertifiedPairDecaysUnderRandomAndWorstSwitching) {
  const auto slow = sampled<3>(0.1 * 0.36);
  const auto fast = sampled<3>(0.1);
  ASSERT_TRUE((switching_certified<3, double>(slow, fast)));
  const std::array<Square<3>, 2> step = {sampled_error_matrix<3>(slow),
                                         sampled_error_matrix<3>(fast)};
  // States of the chain for T = 1 / w: about equal weights.
  const Column<3> weight(1, 10, 100);
  for (int seed = 0; seed < 40; seed += stride) {
    Random random(static_cast<std::uint64_t>(seed));
    Column<3> x(random.uniform(-1, 1), random.uniform(-1, 1) / 10, random.uniform(-1, 1) / 100);
    const double start = x.cwiseProduct(weight).norm();
    int mode = 0;
    for (int k = 0; k < 6000; ++k) {
      if (seed % 2 == 0) {
        if (random.index(1 + seed) == 0) mode = 1 - mode;
      } else {
        // Look 30 samples ahead with each mode.
        Column<3> zero = x;
        Column<3> one = x;
        for (int i = 0; i < 30; ++i) {
          zero = step[0] * zero;
          one = step[1] * one;
        }
        mode = zero.cwiseProduct(weight).norm() > one.cwiseProduct(weight).norm() ? 0 : 1;
      }
      x = step[static_cast<std::size_t>(mode)] * x;
    }
    EXPECT_LT(x.cwiseProduct(weight).norm(), 1e-3 * start) << seed;
  }
}

}  // namespace gain_switching_certificate_test
}  // namespace esokit_test
