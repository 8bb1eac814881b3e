// Sampled gains against a reference of 100 digits, against closed forms, and by what they are for:
// the poles of the error.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/eigen.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/gain/reduced_order.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <limits>
#include <support/high_precision.hpp>
#include <support/numbers.hpp>
#include <utility>
#include <vector>

// The references compute in long double on purpose; the library above is still checked.
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace gain_sampled_gain_test {

using esokit::Array;
using esokit::current_gain;
using esokit::EqualSampledPoles;
using esokit::predictor_gain;
using esokit::ReducedSampledPoles;
using esokit::SampledPolePairs;
using esokit::SampledPoleSet;
using esokit::ScaledGain;
using esokit_test::Big;
using esokit_test::Poles;
using esokit_test::Random;
using Complex = std::complex<double>;

/// Calls f<N>() for N = 2 .. 12, all sizes of order 1 .. 8 with extension 1 .. 4.
template <class F>
void for_all_sizes(F&& f) {
  [&]<int... I>(std::integer_sequence<int, I...>) {
    (f(std::integral_constant<int, I + 2>{}), ...);
  }
  (std::make_integer_sequence<int, 11>{});
}

const std::vector<double> omega_t_grid{1e-4, 3e-4, 1e-3, 1e-2, 0.05, 0.1, 0.3, 0.5, 1,
                                       1.7,  3,    6,    10,   15,   20,  36,  50};

std::vector<Big> reference_polynomial(std::size_t size, double omega_t) {
  return esokit_test::reference_polynomial(Poles(size, -static_cast<long double>(omega_t)), 1.0L);
}

/// beta_j = Delta^(j-1) kappa(1) of a gain, in 100 digits.
std::vector<Big> polynomial_of(const std::vector<Big>& gain) {
  std::vector<Big> kappa;
  for (std::size_t t = 1; t <= gain.size(); ++t) {
    Big sum = 0;
    Big power = 1;
    for (const Big& k : gain) {
      sum += k * power;
      power *= Big(t);
    }
    kappa.push_back(sum);
  }
  std::vector<Big> beta{Big(1)};
  while (!kappa.empty()) {
    beta.push_back(kappa[0]);
    for (std::size_t t = 0; t + 1 < kappa.size(); ++t) kappa[t] = kappa[t + 1] - kappa[t];
    kappa.pop_back();
  }
  return beta;
}

template <class Gain>
std::vector<Big> widened(const Gain& gain) {
  std::vector<Big> wide;
  for (const auto k : gain) wide.emplace_back(k);
  return wide;
}

void expect_close(const std::vector<Big>& values, const std::vector<Big>& expected,
                  double tolerance, const char* name) {
  ASSERT_EQ(values.size(), expected.size());
  for (std::size_t r = 0; r < values.size(); ++r) {
    EXPECT_LE(static_cast<double>(abs(values[r] / expected[r] - 1)), tolerance) << name << ' ' << r;
  }
}

/// k, l and the characteristic polynomial of one design; too small gains are refused elsewhere.
void expect_exact(const std::vector<Big>& k, const std::vector<Big>& l, double omega_t,
                  double smallest, double tolerance) {
  const auto beta = reference_polynomial(k.size(), omega_t);
  const auto reference = esokit_test::reference_current_gain(beta);
  if (reference.back() < Big(smallest)) return;
  expect_close(k, reference, tolerance, "k");
  expect_close(l, esokit_test::reference_predictor_gain(beta), tolerance, "l");
  expect_close(polynomial_of(k), beta, tolerance, "beta");
}

template <class S>
void expect_equal_pole_gains_exact(double tolerance) {
  for_all_sizes([&](auto size) {
    constexpr int N = size;
    for (const double omega_t : omega_t_grid) {
      SCOPED_TRACE(::testing::Message() << "N " << N << " omega_o T " << omega_t);
      const auto weights =
          EqualSampledPoles<N, S>::from_bandwidth(static_cast<S>(omega_t), S(1)).weights();
      expect_exact(widened(current_gain<N, S>(weights)), widened(predictor_gain<N, S>(weights)),
                   static_cast<double>(static_cast<S>(omega_t)),
                   static_cast<double>(std::max<long double>(std::numeric_limits<S>::min(),
                                                             std::numeric_limits<double>::min())),
                   tolerance);
    }
  });
}

TEST(SampledGain, EqualPolesInDoubleTo1em12) { expect_equal_pole_gains_exact<double>(1e-12); }

/// a is good to 2 units in the last place, its powers and the sum to 5 N more.
TEST(SampledGain, EqualPolesInDoubleToRounding) {
  expect_equal_pole_gains_exact<double>(100 * std::numeric_limits<double>::epsilon());
}
TEST(SampledGain, EqualPolesInFloatToRounding) {
  expect_equal_pole_gains_exact<float>(100 *
                                       static_cast<double>(std::numeric_limits<float>::epsilon()));
}
TEST(SampledGain, EqualPolesInLongDoubleToRounding) {
  expect_equal_pole_gains_exact<long double>(
      static_cast<double>(100 * std::numeric_limits<long double>::epsilon()));
}

TEST(SampledGain, ReferenceAgreesWithTheClosedForms) {
  for (const double omega_t : omega_t_grid) {
    const Big rho = exp(-Big(omega_t));
    const Big a = 1 - rho;
    const auto two = esokit_test::reference_current_gain(reference_polynomial(2, omega_t));
    EXPECT_LT(abs(two[0] / (1 - rho * rho) - 1), Big(1e-60));
    EXPECT_LT(abs(two[1] / (a * a) - 1), Big(1e-60));
    const auto three = esokit_test::reference_current_gain(reference_polynomial(3, omega_t));
    EXPECT_LT(abs(three[0] / (1 - rho * rho * rho) - 1), Big(1e-60));
    EXPECT_LT(abs(three[1] / (Big(3) / 2 * a * a * (1 + rho)) - 1), Big(1e-60));
    EXPECT_LT(abs(three[2] / (a * a * a / 2) - 1), Big(1e-60));
  }
}

/// k = (1 - rho^3, 3/2 (1-rho)^2 (1+rho) / T, (1-rho)^3 / T^2), and l = Phi k.
TEST(SampledGain, ClosedFormForThreeStates) {
  const double t = 0.02;
  for (const double omega : {1.0, 40.0, 300.0}) {
    const double rho = std::exp(-omega * t);
    const auto weights = EqualSampledPoles<3, double>::from_bandwidth(omega, t).weights();
    const auto k = esokit::physical_gain<3, double>(current_gain<3, double>(weights), t);
    EXPECT_NEAR(k(0) / (1 - rho * rho * rho), 1, 1e-13);
    EXPECT_NEAR(k(1) / (1.5 * (1 - rho) * (1 - rho) * (1 + rho) / t), 1, 1e-13);
    EXPECT_NEAR(k(2) / ((1 - rho) * (1 - rho) * (1 - rho) / (t * t)), 1, 1e-12);
    const auto l = esokit::physical_gain<3, double>(predictor_gain<3, double>(weights), t);
    EXPECT_NEAR(l(0) / (3 * (1 - rho)), 1, 1e-13);
    EXPECT_NEAR(l(1) / (k(1) + t * k(2)), 1, 1e-13);
    EXPECT_NEAR(l(2) / k(2), 1, 1e-13);
    const auto back = esokit::scaled_gain<3, double>(k, t);
    for (std::size_t r = 0; r < 3; ++r) {
      EXPECT_NEAR(back[r] / (current_gain<3, double>(weights)[r]), 1, 1e-14);
    }
  }
}

/// All poles in the origin: k_r = c(N, r+1) / (N-1)!. For N = 3: 1, 3/2, 1/2.
TEST(SampledGain, DeadbeatIsPolynomialInterpolation) {
  const auto deadbeat = SampledPoleSet<3, double>::from_sampled({0.0, 0.0, 0.0});
  EXPECT_EQ((current_gain<3, double>(deadbeat.weights())), (ScaledGain<3, double>{1, 1.5, 0.5}));
  EXPECT_EQ((predictor_gain<3, double>(deadbeat.weights())), (ScaledGain<3, double>{3, 2.5, 0.5}));
}

/// (I - k C) Phi.
Eigen::MatrixXd error_matrix(const std::vector<double>& k) {
  const auto size = static_cast<Eigen::Index>(k.size());
  Eigen::MatrixXd phi = Eigen::MatrixXd::Zero(size, size);
  Eigen::MatrixXd reset = Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index r = 0; r < size; ++r) {
    for (Eigen::Index c = r; c < size; ++c) {
      phi(r, c) = esokit_test::choose(static_cast<int>(c), static_cast<int>(r));
    }
    reset(r, 0) -= k[static_cast<std::size_t>(r)];
  }
  return reset * phi;
}

/// Norm of prod(F - rho_i I) over the product of the norms; complex ones in pairs.
double cayley_hamilton(const std::vector<double>& k, const std::vector<Complex>& poles) {
  const Eigen::MatrixXd f = error_matrix(k);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(f.rows(), f.cols());
  Eigen::MatrixXd product = one;
  double scale = 1;
  for (const Complex& rho : poles) {
    if (rho.imag() < 0) continue;
    const Eigen::MatrixXd factor =
        rho.imag() > 0 ? Eigen::MatrixXd(f * f - 2 * rho.real() * f + std::norm(rho) * one)
                       : Eigen::MatrixXd(f - rho.real() * one);
    product = product * factor;
    scale *= factor.norm();
  }
  return product.norm() / scale;
}

/// Without any formula for gains: the error matrix satisfies the polynomial of the poles that were
/// asked for (Cayley-Hamilton), and no other.
TEST(SampledGain, PutsThePolesWhereTheyWereAsked) {
  for_all_sizes([](auto size) {
    constexpr int N = size;
    if constexpr (N <= 8) {
      for (const double omega_t : {0.2, 0.5, 1.0, 3.0, 20.0}) {
        const auto k = current_gain<N, double>(
            EqualSampledPoles<N, double>::from_bandwidth(omega_t, 1).weights());
        const std::vector<double> gain(k.begin(), k.end());
        const std::vector<Complex> poles(N, std::exp(-omega_t));
        EXPECT_LT(cayley_hamilton(gain, poles), 1e-13) << N << ' ' << omega_t;
      }
    }
  });
  const Complex p(-0.7, 1.1);
  const Complex q(-1.6, 0.4);
  const Array<Complex, 5> poles{p, q, -0.9, std::conj(q), std::conj(p)};
  const auto k =
      current_gain<5, double>(SampledPoleSet<5, double>::from_continuous(poles, 1).weights());
  const std::vector<double> gain(k.begin(), k.end());
  std::vector<Complex> sampled;
  for (const Complex& pole : poles) sampled.push_back(std::exp(pole));
  EXPECT_LT(cayley_hamilton(gain, sampled), 1e-13);
  sampled[2] = 0.5;
  EXPECT_GT(cayley_hamilton(gain, sampled), 1e-7);
}

/// Random stable sets. Complex poles may let the terms of a gain cancel, so the error is measured
/// against the sum of their magnitudes.
TEST(SampledGain, PoleSetsAgainstTheReference) {
  Random random(17);
  for (int trial = 0; trial < 60; ++trial) {
    const double t = random.log_uniform(1e-4, 2);
    constexpr int N = 7;
    const int pairs = random.index(4);
    Array<Complex, N> poles;
    std::size_t i = 0;
    for (; i < static_cast<std::size_t>(2 * pairs); i += 2) {
      poles[i] = Complex(-random.log_uniform(0.1, 10), random.uniform(-3, 3));
      poles[i + 1] = std::conj(poles[i]);
    }
    for (; i < N; ++i) poles[i] = -random.log_uniform(0.1, 10);
    Poles wide;
    for (const Complex& pole : poles) wide.emplace_back(pole.real(), pole.imag());
    const auto beta = esokit_test::reference_polynomial(wide, t);
    const auto reference = esokit_test::reference_current_gain(beta);
    const auto weights = SampledPoleSet<N, double>::from_continuous(poles, t).weights();
    const auto k = current_gain<N, double>(weights);
    for (std::size_t r = 0; r < N; ++r) {
      double terms = 0;
      for (std::size_t j = r + 1; j <= N; ++j) {
        terms += std::abs(weights[j]) *
                 esokit::unsigned_stirling_first(static_cast<int>(j), static_cast<int>(r) + 1) /
                 esokit::factorial(static_cast<int>(j) - 1);
      }
      EXPECT_LE(static_cast<double>(abs(Big(k[r]) - reference[r])), 1e-12 * terms) << trial;
      if (pairs == 0) {
        EXPECT_LE(esokit_test::relative_error(k[r], reference[r]), 1e-12) << trial;
      }
    }
    // The last gain is prod(1 - rho_i) / (N-1)!: nothing cancels there.
    EXPECT_LE(esokit_test::relative_error(k[N - 1], reference[N - 1]), 1e-12) << trial;
  }
}

TEST(SampledGain, EqualPoleSetIsTheBandwidthForm) {
  for (const double omega_t : omega_t_grid) {
    Array<Complex, 4> poles;
    poles.fill(-omega_t);
    const auto set = SampledPoleSet<4, double>::from_continuous(poles, 1).weights();
    const auto equal = EqualSampledPoles<4, double>::from_bandwidth(omega_t, 1).weights();
    for (std::size_t r = 0; r < 4; ++r) {
      EXPECT_NEAR((current_gain<4, double>(set)[r]) / (current_gain<4, double>(equal)[r]), 1,
                  1e-14);
    }
  }
}

TEST(SampledGain, ContinuousAndSampledPolesMeet) {
  const Array<Complex, 3> poles{Complex(-1, 2), Complex(-1, -2), -0.5};
  Array<Complex, 3> sampled;
  for (std::size_t i = 0; i < 3; ++i) sampled[i] = std::exp(poles[i] * 0.3);
  const auto a = SampledPoleSet<3, double>::from_continuous(poles, 0.3);
  const auto b = SampledPoleSet<3, double>::from_sampled(sampled);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(std::abs(a.contractions[i] - b.contractions[i]), 0, 1e-15);
  }
}

TEST(SampledGain, PowerIsTheLongerSample) {
  const double eps = std::numeric_limits<double>::epsilon();
  for (const double omega_t : {1e-4, 0.01, 0.3, 1.0, 3.0}) {
    for (const unsigned samples : {1u, 2u, 3u, 4u, 7u, 20u, 100u, 65535u}) {
      const double expected = -std::expm1(-omega_t * samples);
      EXPECT_NEAR(
          (EqualSampledPoles<3, double>::from_bandwidth(omega_t, 1).power(samples).contraction) /
              expected,
          1, 40 * eps)
          << omega_t << ' ' << samples;
      const Complex pole(-omega_t, 0.6 * omega_t);
      const auto set =
          SampledPoleSet<2, double>::from_continuous({pole, std::conj(pole)}, 1).power(samples);
      const Complex wanted = 1.0 - std::exp(pole * static_cast<double>(samples));
      // The reference itself cancels for small arguments.
      EXPECT_NEAR(std::abs(set.contractions[0] - wanted), 0, 100 * eps) << samples;
      EXPECT_EQ(set.contractions[1], std::conj(set.contractions[0]));
    }
    // Small ones without that: 1 - rho^M.
    EXPECT_EQ((EqualSampledPoles<3, double>{0.25}.power(2).contraction), 0.4375);
    EXPECT_EQ((EqualSampledPoles<3, double>{0.5}.power(3).contraction), 0.875);
    EXPECT_EQ((EqualSampledPoles<3, double>{0.5}.power(1).contraction), 0.5);
  }
}

/// Physical gain / T tends to the continuous gain, to first order.
TEST(SampledGain, TendsToTheContinuousGain) {
  constexpr double omega = 3;
  const auto continuous = esokit::continuous_gain<4>(omega);
  const auto deviation = [&](double t) {
    const auto poles = EqualSampledPoles<4, double>::from_bandwidth(omega, t);
    const auto k = esokit::physical_gain<4, double>(current_gain<4, double>(poles.weights()), t);
    return eigen(k / t - continuous).cwiseQuotient(eigen(continuous)).norm();
  };
  EXPECT_LT(deviation(1e-4), 2e-3);
  EXPECT_NEAR(std::log2(deviation(2e-3) / deviation(1e-3)), 1, 0.02);
}

TEST(SampledGain, IsAvailableAtCompileTime) {
  constexpr EqualSampledPoles<2, float> half{0.5f};
  constexpr auto k = current_gain<2, float>(half.weights());
  static_assert(k[0] == 0.75f && k[1] == 0.25f);
  static_assert(half.power(2).contraction == 0.75f);
  constexpr auto l = predictor_gain<2, float>(half.weights());
  static_assert(l[0] == 1.0f && l[1] == 0.25f);
}

// ---- steps of different lengths

/// e -> (I - k C) Phi e over a step of x / omega, errors in units of 1 / omega^r.
template <class Poles, int Size>
esokit::Matrix<double, Size, Size> step_error(double x) {
  Poles poles{};
  if constexpr (requires { poles.contraction; }) {
    poles.contraction = -std::expm1(-x);
  } else if constexpr (requires { poles.rest; }) {
    poles.rest.contraction = -std::expm1(-x);
  } else {
    poles = esokit::HalfGainPoles::sample<Size, double>(x, 1.0);
  }
  const auto gain = current_gain<Size, double>(poles.weights());
  esokit::Matrix<double, Size, Size> step;
  for (int i = 0; i < Size; ++i) {
    for (int j = 0; j < Size; ++j) {
      step(i, j) = (j < i ? 0 : esokit::binomial(j, i) * std::pow(x, j - i)) -
                   gain[static_cast<std::size_t>(i)] * std::pow(x, j - i);
    }
  }
  return step;
}

template <class Poles>
constexpr esokit::detail::BridgedSteps bridged_steps(int size) {
  if constexpr (requires(Poles poles) { poles.contraction; }) {
    return esokit::detail::equal_steps(size);
  } else if constexpr (requires(Poles poles) { poles.rest; }) {
    return esokit::detail::reduced_steps(size);
  } else {
    return esokit::detail::half_gain_steps(size);
  }
}

/// The certificate of gain/certificate/detail/bridged_steps.hpp: e' L' L e falls in every step up
/// to the reach. With one pole at zero the first error is zero after each correction, and L is that
/// of the others.
/// @param l upper triangle of L, row by row
template <class Poles, int Size>
void falls(const std::vector<double>& l) {
  constexpr double reach = bridged_steps<Poles>(Size).reach;
  SCOPED_TRACE(::testing::Message() << "N = " << Size << ", reach " << reach);
  constexpr int first = requires(Poles poles) { poles.rest; }
  ? 1 : 0;
  constexpr int count = Size - first;
  using Square = esokit::Matrix<double, count, count>;
  Square upper = Square::Zero();
  ASSERT_EQ(l.size(), static_cast<std::size_t>(count * (count + 1) / 2));
  std::size_t next = 0;
  for (int i = 0; i < count; ++i) {
    for (int j = i; j < count; ++j) upper(i, j) = l[next++];
  }
  const Square p = upper.transpose() * upper;
  for (int k = 1; k <= 400; ++k) {
    for (const double x : {reach * k / 400, reach * std::pow(1e-3, k / 400.0)}) {
      const auto whole = step_error<Poles, Size>(x);
      Square step;
      for (int i = 0; i < count; ++i) {
        for (int j = 0; j < count; ++j) step(i, j) = whole(i + first, j + first);
      }
      const Square fallen = p * (1 - 0.005 * std::min(x, 1.0)) - step.transpose() * p * step;
      const esokit::Matrix<double, count, 1> none{};
      ASSERT_TRUE((esokit::detail::solve_positive<count, 1, double>(fallen, none))) << x;
    }
  }
}

TEST(BridgedSteps, ASquareFallsInEveryStepUpToTheReach) {
  falls<EqualSampledPoles<3, double>, 3>({1, -0.11266, 0.02537, 0.81257, -3.6325, 3.3309});
  falls<EqualSampledPoles<4, double>, 4>(
      {1, -0.37694, 0.99378, -6.3087, 1.1311, -5.3674, 30.374, 3.5124, -37.834, 11.421});
  falls<EqualSampledPoles<5, double>, 5>({1, -0.60843, 1.6734, -6.3654, 14.404, 1.2488, -5.8163,
                                          31.93, -206.98, 3.4379, -39.546, 402.49, 12.76, -239.63,
                                          36.214});
  falls<EqualSampledPoles<6, double>, 6>({1,       -0.46379, 1.0591, -3.7917, 15.075,  -78.243,
                                          1.093,   -4.0842,  17.6,   -87.456, 516.79,  2.5775,
                                          -24.733, 204.47,   -1635,  10.303,  -195.83, 2901.8,
                                          52.993,  -1524.6,  182.85});
  falls<EqualSampledPoles<7, double>, 7>(
      {1,       -0.26203, 0.3741,  -1.3958, 6.8008,  -31.436, -36.09,  0.78817, -2.4546, 9.9066,
       -51.725, 323.6,    -1997.9, 1.7339,  -14.172, 106.37,  -858.14, 7919.6,  5.73,    -89.622,
       1113.8,  -13499,   27.122,  -677.23, 12025,   154.21,  -5933.6, 864.87});
  falls<SampledPolePairs<3, double>, 3>({1, -0.26386, 0.47195, 1.0711, -4.447, 3.7502});
  falls<SampledPolePairs<4, double>, 4>(
      {1, -0.72613, 1.1811, -1.6943, 1.0287, -3.8997, 17.695, 2.4119, -22.181, 7.7414});
  falls<ReducedSampledPoles<3, double>, 3>({1, -3.3863, 3.2887});
  falls<ReducedSampledPoles<4, double>, 4>({1, -2.7453, 8.4283, 2.7117, -22.494, 8.7997});
}

template <class Poles, int Size>
constexpr auto recovery_at(double x) {
  using esokit::detail::recovery_of;
  if constexpr (requires(Poles poles) { poles.contraction; }) {
    return recovery_of<Size, esokit::detail::equal_steps, esokit::detail::equal_recovery>(
        std::exp(-x));
  } else if constexpr (requires(Poles poles) { poles.rest; }) {
    return recovery_of<Size, esokit::detail::reduced_steps, esokit::detail::reduced_recovery>(
        std::exp(-x));
  } else {
    return recovery_of<Size, esokit::detail::half_gain_steps, esokit::detail::half_gain_recovery>(
        std::exp(-x));
  }
}

/// What is due after a long step, see GapRecovery: V of an ordinary step with this discount falls
/// by it, and by no more than an ordinary correction takes where a step counts as one.
template <class Poles, int Size>
void recovers(double discount) {
  constexpr int first = requires(Poles poles) { poles.rest; }
  ? 1 : 0;
  constexpr int count = Size - first;
  using Square = esokit::Matrix<double, count, count>;
  const auto step = [](double x) {
    const auto whole = step_error<Poles, Size>(x);
    Square rest;
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < count; ++j) {
        rest(i, j) = whole(i + first, j + first) - (i == j ? 1 : 0);
      }
    }
    return rest;
  };
  double most = 0;  // of what is needed, of what is due
  for (const double x : {0.01, 0.07, 0.2, 0.46, 0.9, 1.7}) {
    SCOPED_TRACE(::testing::Message() << "N = " << Size << ", omega_o T = " << x);
    const Square one = step(x);
    // The gain is what the first error loses, in a step without time.
    esokit::Vector<double, count> k;
    const auto whole = step_error<Poles, Size>(x);
    for (int i = 0; i < count; ++i) k(i) = (i + first == 0 ? 1 : 0) - whole(i + first, 0);
    const double rate = discount * x;
    const auto square =
        esokit::detail::FallingSquare<count, double>::make(one, k * k.transpose(), rate);
    ASSERT_TRUE(square);
    const auto recovery = recovery_at<Poles, Size>(x);
    for (int samples = 2; samples <= 65001; samples += 1 + samples / 12) {
      const Square over = step(samples * x);
      const int due = recovery.due_after(static_cast<unsigned>(samples));
      if (due < 0) {
        EXPECT_TRUE(square->falls(over, -std::expm1(-rate))) << samples;
        continue;
      }
      // `growth` may be too large by the root of order 16 of the number of states.
      const double grown = std::log(square->growth(over)) - std::log(count) / 16;
      EXPECT_LE(grown, due * rate) << samples;
      if (due > 20) most = std::max(most, grown / (due * rate));
    }
  }
  EXPECT_GT(most, 0.8);
}

TEST(BridgedSteps, WhatIsDueAfterALongStepIsEnough) {
  recovers<EqualSampledPoles<3, double>, 3>(1.1);
  recovers<EqualSampledPoles<4, double>, 4>(1.2);
  recovers<EqualSampledPoles<5, double>, 5>(1.1);
  recovers<SampledPolePairs<3, double>, 3>(0.9);
  recovers<SampledPolePairs<4, double>, 4>(0.9);
  recovers<ReducedSampledPoles<3, double>, 3>(1.1);
  recovers<ReducedSampledPoles<4, double>, 4>(1.1);
  // Two states: any sequence of steps decays. From eight on nothing is proven.
  EXPECT_EQ((recovery_at<EqualSampledPoles<2, double>, 2>(0.1).due_after(65001)), -1);
  EXPECT_EQ((recovery_at<EqualSampledPoles<8, double>, 8>(0.1).due_after(9)),
            esokit::detail::GapRecovery<double>::never);
}

/// Largest spectral radius of A(a) A(b)^k, k = 1 .. 5, of all steps up to `longest`.
template <class Poles, int Size>
double worst_pattern(double longest) {
  using Square = esokit::Matrix<double, Size, Size>;
  std::vector<Square> steps;
  for (int k = 1; k <= 24; ++k) steps.push_back(step_error<Poles, Size>(longest * k / 24));
  for (int k = 1; k <= 8; ++k) {
    steps.push_back(step_error<Poles, Size>(longest / 24 * std::pow(0.6, k)));
  }
  double worst = 0;
  for (const Square& a : steps) {
    for (const Square& b : steps) {
      Square pattern = a;
      for (int k = 1; k <= 5; ++k) {
        pattern = pattern * b;
        Square power = pattern;
        double radius = 0;
        for (int squarings = 0; squarings < 30; ++squarings) {
          double size = 0;
          for (int i = 0; i < Size * Size; ++i) size = std::max(size, std::abs(power.data()[i]));
          radius += std::ldexp(std::log(size), -squarings);
          power = power * (1 / size);
          power = power * power;
        }
        worst = std::max(worst, std::exp(radius));
      }
    }
  }
  return worst;
}

/// The search finds nothing up to the reach, and it can find: not far above it errors grow.
TEST(BridgedSteps, TheSearchFindsNoGrowthUpToTheReachAndFindsItAbove) {
  const auto check = []<class Poles, int Size>(double above) {
    const double reach = bridged_steps<Poles>(Size).reach;
    EXPECT_LT((worst_pattern<Poles, Size>(reach)), 1) << Size;
    EXPECT_GT((worst_pattern<Poles, Size>(above * reach)), 1) << Size;
  };
  check.operator()<EqualSampledPoles<3, double>, 3>(1.35);
  check.operator()<EqualSampledPoles<4, double>, 4>(1.2);
  check.operator()<EqualSampledPoles<5, double>, 5>(1.25);
  check.operator()<EqualSampledPoles<6, double>, 6>(1.35);
  check.operator()<ReducedSampledPoles<4, double>, 4>(1.25);
}

}  // namespace gain_sampled_gain_test
