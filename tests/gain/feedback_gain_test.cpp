#include <gtest/gtest.h>
#include <esokit/gain/pole_set.hpp>

#include <cmath>
#include <complex>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/eigen.hpp>
#include <esokit/gain/feedback_gain.hpp>
#include <limits>
#include <support/refusal.hpp>

namespace gain_feedback_gain_test {

using esokit_test::refusal;

using esokit::Array;
using esokit::EigenMatrix;
using esokit::FeedbackSpec;
using esokit::TimeDomain;

constexpr double period = 0.02;

/// prod_i (Phi - Gamma K - rho_i 1), which is zero (Cayley and Hamilton) if the poles are rho_i;
/// in states scaled by T^r, so that all elements are of one size.
template <int Order>
double miss(const Array<double, Order>& gain, const Array<std::complex<double>, Order>& poles) {
  using Chain = esokit::IntegratorChain<Order, double>;
  using Complex = EigenMatrix<std::complex<double>, Order, Order>;
  EigenMatrix<double, Order, Order> closed =
      eigen(Chain::transition_matrix(period)).template topLeftCorner<Order, Order>();
  const EigenMatrix<double, Order> gamma =
      Chain::sampled_input_matrix(period, 1).template head<Order>();
  for (int i = 0; i < Order; ++i) closed.col(i) -= gamma * gain[static_cast<std::size_t>(i)];
  for (int i = 0; i < Order; ++i) {
    for (int j = 0; j < Order; ++j) closed(i, j) *= std::pow(period, i - j);
  }
  Complex product = Complex::Identity();
  for (const auto& rho : poles)
    product = product * (closed.template cast<std::complex<double>>() - rho * Complex::Identity());
  return product.cwiseAbs().maxCoeff();
}

template <int Order>
void places_poles() {
  for (const double omega : {0.5, 5.0, 50.0, 400.0}) {
    SCOPED_TRACE(::testing::Message() << "n = " << Order << ", omega = " << omega);
    Array<std::complex<double>, Order> poles;
    poles.fill(std::exp(-omega * period));
    const auto gain =
        esokit::feedback_gain<Order, double>({omega, TimeDomain::sampled, false}, period).value();
    const double rounding = 200 * std::pow(8.0, Order) * std::numeric_limits<double>::epsilon();
    EXPECT_LE((miss<Order>(gain, poles)), rounding);

    const auto continuous = esokit::half_gain_poles<Order, double>(omega);
    for (std::size_t i = 0; i < Order; ++i) poles[i] = std::exp(continuous[i] * period);
    const auto half =
        esokit::feedback_gain<Order, double>({omega, TimeDomain::sampled, true}, period).value();
    EXPECT_LE((miss<Order>(half, poles)), rounding);
    // It can tell: a gain that is off by 1e-3.
    auto off = gain;
    off[0] *= 1.001;
    poles.fill(std::exp(-omega * period));
    EXPECT_GT((miss<Order>(off, poles)), 1e-4 * std::pow(1 - poles[0].real(), Order));
  }
}

TEST(FeedbackGain, SampledPolesAreWhereTheyShallBe) {
  places_poles<1>();
  places_poles<2>();
  places_poles<3>();
  places_poles<4>();
  places_poles<6>();
}

TEST(FeedbackGain, LiteralFormulas) {
  // n = 1: (1 - rho)/T; n = 2: a^2/T^2 and (2a - a^2/2)/T.
  const double a = -std::expm1(-0.1);
  const auto one = esokit::sampled_feedback_gain<1, double>(5.0, 0.02);
  EXPECT_DOUBLE_EQ(one[0], a / 0.02);
  const auto two = esokit::sampled_feedback_gain<2, double>(5.0, 0.02);
  EXPECT_DOUBLE_EQ(two[0], a * a / 0.0004);
  EXPECT_DOUBLE_EQ(two[1], (2 * a - a * a / 2) / 0.02);
  const auto continuous =
      esokit::feedback_gain<3, double>({2.0, TimeDomain::continuous, false}, 0.1).value();
  EXPECT_EQ(continuous, (Array<double, 3>{8, 12, 6}));
  const auto half =
      esokit::feedback_gain<3, double>({2.0, TimeDomain::continuous, true}, 0.1).value();
  EXPECT_EQ(half, (Array<double, 3>{4, 6, 3}));
}

/// The sampled gains tend to the continuous ones with order 1 in T.
TEST(FeedbackGain, TendsToTheContinuousOne) {
  for (const bool half : {false, true}) {
    const auto limit =
        esokit::feedback_gain<3, double>({5.0, TimeDomain::continuous, half}, 1.0).value();
    const auto distance = [&](double sample_time) {
      const auto gain =
          esokit::feedback_gain<3, double>({5.0, TimeDomain::sampled, half}, sample_time).value();
      double worst = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        worst = std::max(worst, std::abs(gain[i] / limit[i] - 1));
      }
      return worst;
    };
    EXPECT_NEAR(std::log2(distance(2e-3) / distance(1e-3)), 1, 0.02);
    EXPECT_LT(distance(1e-5), 2e-4);
  }
}

TEST(FeedbackGain, HalfGainPolesGiveHalfTheGains) {
  // ((s + w)^N + s^N) / 2.
  const auto check = [](auto size) {
    constexpr int N = decltype(size)::value;
    const double omega = 7;
    const auto poles = esokit::half_gain_poles<N, double>(omega);
    const EigenMatrix<double, N> gain = esokit::continuous_gain<N, double>(poles);
    const EigenMatrix<double, N> whole = esokit::continuous_gain<N, double>(omega);
    for (int i = 0; i < N; ++i) EXPECT_NEAR(gain(i) / whole(i), 0.5, 1e-12) << N << ' ' << i;
    for (const auto& pole : poles) EXPECT_DOUBLE_EQ(pole.real(), -omega / 2);
    EXPECT_TRUE((esokit::HalfGainPoles::gain<N, double>(omega) == whole / 2));
  };
  check(std::integral_constant<int, 1>{});
  check(std::integral_constant<int, 2>{});
  check(std::integral_constant<int, 3>{});
  check(std::integral_constant<int, 4>{});
  check(std::integral_constant<int, 7>{});
}

TEST(FeedbackGain, RefusesBadBandwidths) {
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto refused = esokit::feedback_gain<2, double>({bad, TimeDomain::sampled, false}, 0.1);
    ASSERT_EQ(refusal(refused), "controller_bandwidth: must be finite and positive");
  }
  EXPECT_FALSE((esokit::feedback_gain<4, float>({1e12f, TimeDomain::continuous, false}, 0.1f)));
}

}  // namespace gain_feedback_gain_test
