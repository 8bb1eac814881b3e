// Identities of the linear observers: what equals what, and the equations of the paper written down
// independently (K. Lakomy, R. Madonski, ISA Transactions 109 (2021), equations (23), (24)).
#include <gtest/gtest.h>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/sim/continuous_observer.hpp>

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/numbers.hpp>
#include <vector>

namespace observer_cascade_identities_test {

using esokit::Array;
using esokit::CascadeEso;
using esokit::ContinuousCascadeEso;
using esokit::ContinuousLinearEso;
using esokit::EigenMatrix;
using esokit::LinearEso;
using esokit::PoleSet;
using esokit::StepStatus;
using esokit_test::Random;
using esokit_test::same_bits;
using Complex = std::complex<double>;

/// The same run for two observers, with gaps, bad samples and resets in it; `judge` compares.
template <class A, class B, class Judge>
void run_side_by_side(A& a, B& b, Judge&& judge) {
  using S = typename A::scalar_type;
  Random random(101);
  for (int k = 0; k < 300; ++k) {
    S y = static_cast<S>(random.uniform(-1, 1));
    S u = static_cast<S>(random.uniform(-100, 100));
    if (k % 17 == 3) y = esokit_test::hidden_nan<S>();
    if (k % 23 == 3) u = esokit_test::hidden_infinity<S>();
    if (k % 41 == 3) y = esokit_test::huge<S>();
    if (k == 150) {
      EXPECT_EQ(a.reset(y), b.reset(y));
    }
    if (k % 7 == 3) {
      EXPECT_EQ(a.predict(u), b.predict(u));
    } else {
      EXPECT_EQ(a.update(y, u), b.update(y, u));
    }
    ASSERT_EQ(a.missed(), b.missed());
    judge(a, b);
  }
}

template <class S>
void one_level_is_the_linear_eso() {
  auto cascade = CascadeEso<2, 1, S>::make(
                     {.observer_bandwidth = S(40), .input_gain = S(-1.5), .sample_time = S(0.01)})
                     .value();
  auto linear = LinearEso<2, S>::make(
                    {.observer_bandwidth = S(40), .input_gain = S(-1.5), .sample_time = S(0.01)})
                    .value();
  const auto judge = [](const auto& a, const auto& b) {
    for (int r = 0; r < 3; ++r) ASSERT_TRUE(same_bits(a.estimate()(r), b.estimate()(r)));
    ASSERT_TRUE(same_bits(a.total_disturbance(), b.total_disturbance()));
    ASSERT_TRUE(same_bits(a.innovation(), b.innovation()));
  };
  run_side_by_side(cascade, linear, judge);
  ASSERT_TRUE(
      cascade.retune({.observer_bandwidth = S(70), .input_gain = S(3), .sample_time = S(0.02)}));
  ASSERT_TRUE(
      linear.retune({.observer_bandwidth = S(70), .input_gain = S(3), .sample_time = S(0.02)}));
  judge(cascade, linear);
  run_side_by_side(cascade, linear, judge);
}

TEST(Cascade, OneLevelIsTheLinearEsoBitForBit) {
  one_level_is_the_linear_eso<double>();
  one_level_is_the_linear_eso<float>();
}

TEST(Cascade, FactorIsShorthandForLevelBandwidths) {
  auto factor =
      CascadeEso<2, 3>::make(
          {.observer_bandwidth = 10, .bandwidth_factor = 3, .input_gain = 1, .sample_time = 0.01})
          .value();
  auto given = CascadeEso<2, 3>::make(
                   {.level_bandwidths = {{10, 30, 90}}, .input_gain = 1, .sample_time = 0.01})
                   .value();
  run_side_by_side(factor, given, [](const auto& a, const auto& b) {
    for (int level = 0; level < 3; ++level) {
      for (int r = 0; r < 3; ++r) {
        ASSERT_TRUE(same_bits(a.level_estimate(level)(r), b.level_estimate(level)(r)));
      }
    }
  });
  // Any order of levels is fine where they are given one by one.
  EXPECT_TRUE((CascadeEso<2, 3>::make(
      {.level_bandwidths = {{90, 10, 30}}, .input_gain = 1, .sample_time = 0.01})));
}

/// Gains of a level by the closed forms for N = 2, 3 in physical units, for a step of `t` seconds.
EigenMatrix<double, 3> closed_form_gain(double omega, double t) {
  const double rho = std::exp(-omega * t);
  const double a = 1 - rho;
  return {1 - rho * rho * rho, 1.5 * a * a * (1 + rho) / t, a * a * a / (t * t)};
}

/// Equations (23), (24) sampled as the paper writes them: every level keeps its own disturbance
/// xi_{i,n+1} and is driven by b0 u plus the disturbances of the levels below it; the estimate
/// takes the states of the last level and the sum of all disturbances. n = 2, m = 1.
template <int Levels>
class PaperCascade {
 public:
  PaperCascade(std::vector<double> omega, double b0, double t) : omega_(omega), b0_(b0), t_(t) {
    for (auto& level : xi_) level.setZero();
  }

  void predict(double u) {
    EigenMatrix<double, 3, 3> phi;
    phi << 1, t_, t_ * t_ / 2, 0, 1, t_, 0, 0, 1;
    const EigenMatrix<double, 3> gamma(t_ * t_ / 2, t_, 0);
    double found = 0;
    for (auto& level : xi_) {
      const double own = level(2);
      level = EigenMatrix<double, 3>(phi * level + gamma * (b0_ * u + found));
      found += own;
    }
    ++elapsed_;
  }

  void correct(double y) {
    double measured = y;
    for (std::size_t i = 0; i < Levels; ++i) {
      xi_[i] += closed_form_gain(omega_[i], t_ * elapsed_) * (measured - xi_[i](0));
      measured = xi_[i](0);
    }
    elapsed_ = 0;
  }

  [[nodiscard]] EigenMatrix<double, 3> estimate(std::size_t level) const {
    double sum = 0;
    for (std::size_t i = 0; i <= level; ++i) sum += xi_[i](2);
    return {xi_[level](0), xi_[level](1), sum};
  }

 private:
  std::vector<double> omega_;
  double b0_;
  double t_;
  int elapsed_ = 0;
  Array<EigenMatrix<double, 3>, Levels> xi_;
};

template <int Levels>
void expect_paper_form(const std::vector<double>& omega) {
  const double t = 0.02;
  Array<double, Levels> bandwidths;
  std::copy(omega.begin(), omega.end(), bandwidths.begin());
  auto ours = CascadeEso<2, Levels>::make(
                  {.level_bandwidths = bandwidths, .input_gain = -1.3, .sample_time = t})
                  .value();
  PaperCascade<Levels> paper(omega, -1.3, t);
  Random random(5);
  double y = 0;
  for (int k = 0; k < 400; ++k) {
    const double u = random.uniform(-5, 5);
    y += random.uniform(-0.05, 0.05);
    ours.predict(u);
    paper.predict(u);
    if (k % 5 == 2) continue;  // a missing sample
    ours.correct(y);
    paper.correct(y);
    for (int level = 0; level < Levels; ++level) {
      const auto mine = ours.level_estimate(level);
      const auto theirs = paper.estimate(static_cast<std::size_t>(level));
      const double scale = 1e-13 * omega.back();
      ASSERT_NEAR(mine(0), theirs(0), scale) << k;
      ASSERT_NEAR(mine(1), theirs(1), scale * omega.back()) << k;
      ASSERT_NEAR(mine(2), theirs(2), scale * omega.back() * omega.back()) << k;
    }
    ASSERT_EQ(ours.estimate(), ours.level_estimate(Levels - 1));
    ASSERT_EQ(ours.total_disturbance(), ours.estimate()(2));
  }
}

TEST(Cascade, IsThePaperFormSampled) {
  expect_paper_form<1>({30});
  expect_paper_form<2>({15, 40});
  expect_paper_form<3>({8, 20, 60});
}

TEST(Cascade, LevelEstimateOutOfRangeIsNaN) {
  const auto cascade =
      CascadeEso<2, 2>::make(
          {.observer_bandwidth = 10, .bandwidth_factor = 2, .input_gain = 1, .sample_time = 0.01})
          .value();
  for (const int level : {-1, 2, 100}) {
    for (int r = 0; r < 3; ++r) EXPECT_TRUE(std::isnan(cascade.level_estimate(level)(r)));
  }
}

/// Equation (23) literally: xi_i' = A xi_i + d (b0 u + sum_{j<i} xi_{j,n+1}) + l_i (..), with l_i =
/// (3 w, 3 w^2, w^3) for n = 2.
TEST(Cascade, ContinuousFormIsThePaperForm) {
  const double b0 = 0.7;
  const auto cascade = ContinuousCascadeEso<2, 3>::make(
                           {.observer_bandwidth = 4, .bandwidth_factor = 2, .input_gain = b0})
                           .value();
  EigenMatrix<double, 9> z;
  z << 0.3, -0.2, 0.9, 0.5, 0.1, -1.1, 0.8, -0.6, 0.4;
  const double y = 1.25;
  const double u = -2.5;
  const EigenMatrix<double, 9> rate = cascade.derivative(0.0, z, y, u);
  const double w[] = {4, 8, 16};
  double found = 0;
  double measured = y;
  for (int i = 0; i < 3; ++i) {
    const double e = measured - z(3 * i);
    EXPECT_NEAR(rate(3 * i), z(3 * i + 1) + 3 * w[i] * e, 1e-12);
    EXPECT_NEAR(rate(3 * i + 1), z(3 * i + 2) + b0 * u + found + 3 * w[i] * w[i] * e, 1e-12);
    EXPECT_NEAR(rate(3 * i + 2), w[i] * w[i] * w[i] * e, 1e-11);
    found += z(3 * i + 2);
    measured = z(3 * i);
  }
  const auto estimate = cascade.estimate(z);
  EXPECT_NEAR(estimate(0), 0.8, 1e-15);
  EXPECT_NEAR(estimate(1), -0.6, 1e-15);
  EXPECT_NEAR(estimate(2), 0.9 - 1.1 + 0.4, 1e-15);
  EXPECT_NEAR(cascade.total_disturbance(z), 0.9 - 1.1 + 0.4, 1e-15);
  const auto start = cascade.state_at({1, 2, 3});
  EXPECT_EQ(cascade.estimate(start), (EigenMatrix<double, 3>(1, 2, 3)));
  // In agreement the levels do not correct each other.
  const EigenMatrix<double, 9> calm = cascade.derivative(0.0, start, 1, -3 / b0);
  EXPECT_NEAR(calm(7), 0, 1e-14);
  EXPECT_EQ(calm(8), 0);
}

TEST(LinearEso, ContinuousFormIsLiteral) {
  const auto eso = ContinuousLinearEso<2>::make({.observer_bandwidth = 5, .input_gain = 2}).value();
  EXPECT_EQ(eso.input_gain(), 2);
  const EigenMatrix<double, 3> z(1, 2, 3);
  // e = 0.5; l = (15, 75, 125)
  EXPECT_EQ(eso.derivative(0.0, z, 1.5, -1.0),
            (EigenMatrix<double, 3>(2 + 7.5, 3 - 2 + 37.5, 62.5)));
  const auto poles = ContinuousLinearEso<1, double, 1, PoleSet>::make(
                         {.poles = {Complex(-3, 4), Complex(-3, -4)}, .input_gain = 1})
                         .value();
  // (s^2 + 6 s + 25)
  EXPECT_EQ(poles.derivative(0.0, {0, 0}, 1.0, 0.0), (EigenMatrix<double, 2>(6, 25)));
}

/// A generalised cascade and LESO (m = 2): the extended states are a chain of their own.
TEST(LinearEso, ContinuousGeneralisedForm) {
  const auto eso =
      ContinuousLinearEso<1, double, 2>::make({.observer_bandwidth = 2, .input_gain = 3}).value();
  // l = (6, 12, 8), e = -1
  EXPECT_EQ(eso.derivative(0.0, {1, 10, 100}, 0.0, 1.0),
            (EigenMatrix<double, 3>(10 + 3 - 6, 100 - 12, -8)));
}

/// z-[k+1] = Phi z-[k] + Gamma u + l (y - z-_1) runs beside predict and correct.
TEST(LinearEso, PredictorFormAndCurrentFormAgree) {
  constexpr int N = 4;
  using Chain = esokit::IntegratorChain<3>;
  const double t = 0.05;
  const double b0 = 1.4;
  auto eso =
      LinearEso<3>::make({.observer_bandwidth = 12, .input_gain = b0, .sample_time = t}).value();
  const auto weights = esokit::EqualSampledPoles<N, double>::from_bandwidth(12.0, t).weights();
  const EigenMatrix<double, N> l =
      esokit::physical_gain<N, double>(esokit::predictor_gain<N, double>(weights), t);
  EigenMatrix<double, N> predicted = EigenMatrix<double, N>::Zero();
  Random random(3);
  for (int k = 0; k < 200; ++k) {
    const double y = random.uniform(-1, 1);
    const double u = random.uniform(-50, 50);
    ASSERT_NEAR(eso.estimate()(0), predicted(0), 1e-12);
    for (int r = 0; r < N; ++r) {
      ASSERT_NEAR(eso.estimate()(r), predicted(r), 1e-11 * std::pow(1 / t, r)) << k;
    }
    const double e = y - predicted(0);
    eso.correct(y);
    ASSERT_NEAR(eso.innovation(), e, 1e-12);
    eso.predict(u);
    predicted = EigenMatrix<double, N>(Chain::transition_matrix(t) * predicted +
                                       Chain::sampled_input_matrix(t, b0) * u + l * e);
  }
}

TEST(LinearEso, GainOfThreeStatesIsTheClosedForm) {
  const double t = 0.01;
  for (const double omega : {0.05, 2.0, 50.0, 400.0}) {
    auto eso = LinearEso<2>::make({.observer_bandwidth = omega, .input_gain = 1, .sample_time = t})
                   .value();
    eso.predict(0);
    eso.correct(1);
    const auto k = closed_form_gain(omega, t);
    // The closed form cancels in 1 - rho.
    const double tolerance = 1e-15 / (omega * t) * 10;
    for (int r = 0; r < 3; ++r) EXPECT_NEAR(eso.estimate()(r) / k(r), 1, tolerance) << omega;
  }
}

TEST(LinearEso, EqualPolesOfASetAreTheBandwidth) {
  Array<Complex, 3> poles;
  poles.fill(-35.0);
  auto set =
      LinearEso<2, double, 1, PoleSet>::make({.poles = poles, .input_gain = 2, .sample_time = 0.01})
          .value();
  auto bandwidth =
      LinearEso<2>::make({.observer_bandwidth = 35, .input_gain = 2, .sample_time = 0.01}).value();
  run_side_by_side(set, bandwidth, [](const auto& a, const auto& b) {
    for (int r = 0; r < 3; ++r) {
      ASSERT_NEAR(a.estimate()(r), b.estimate()(r), 1e-12 * std::pow(100.0, r));
    }
  });
}

/// The order of the poles in a set does not matter but for rounding.
TEST(LinearEso, OrderOfPolesDoesNotMatter) {
  const Complex p(-10, 7);
  auto a = LinearEso<2, double, 1, PoleSet>::make(
               {.poles = {p, std::conj(p), -4.0}, .input_gain = 2, .sample_time = 0.01})
               .value();
  auto b = LinearEso<2, double, 1, PoleSet>::make(
               {.poles = {-4.0, std::conj(p), p}, .input_gain = 2, .sample_time = 0.01})
               .value();
  run_side_by_side(a, b, [](const auto& x, const auto& y) {
    for (int r = 0; r < 3; ++r) {
      ASSERT_NEAR(x.estimate()(r), y.estimate()(r), 1e-12 * std::pow(100.0, r));
    }
  });
}

/// Free response of the error: z_1 of a plant at rest in zero obeys the characteristic polynomial
/// in the delay, for complex pairs too.
TEST(LinearEso, ErrorObeysThePolesThatWereAskedFor) {
  const double t = 0.1;
  const Complex p(-3, 6);
  auto eso = LinearEso<2, double, 1, PoleSet>::make(
                 {.poles = {p, -2.0, std::conj(p)}, .input_gain = 1, .sample_time = t})
                 .value();
  eso.reset({1.0, -2.0, 5.0});
  std::vector<double> e;
  for (int k = 0; k < 30; ++k) {
    eso.update(0, 0);
    e.push_back(eso.innovation());
  }
  const Complex rho = std::exp(p * t);
  const double real = std::exp(-2.0 * t);
  // (z^2 - 2 Re rho z + |rho|^2) (z - real)
  const double c1 = -2 * rho.real() - real;
  const double c2 = std::norm(rho) + 2 * rho.real() * real;
  const double c3 = -std::norm(rho) * real;
  for (std::size_t k = 3; k < e.size(); ++k) {
    EXPECT_NEAR(e[k] + c1 * e[k - 1] + c2 * e[k - 2] + c3 * e[k - 3], 0, 1e-14);
  }
  EXPECT_GT(std::abs(e[0]), 0.1);
}

}  // namespace observer_cascade_identities_test
