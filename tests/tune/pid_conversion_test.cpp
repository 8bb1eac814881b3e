#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/eigen.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/tune/pid_conversion.hpp>
#include <limits>
#include <support/refusal.hpp>

namespace tune_pid_conversion_test {

using esokit_test::refusal;

using esokit::AdrcTuning;
using esokit::PidGains;

/// The feedback -u/y of the continuous ADRC at s, from its matrices: u = -(k, 1)/b0 z,
/// z' = (A - l C) z + B u + l y.
template <int Order>
std::complex<double> adrc_at(std::complex<double> s, const AdrcTuning<double>& tuning) {
  using Chain = esokit::IntegratorChain<Order, double>;
  constexpr int N = Order + 1;
  using Complex = Eigen::Matrix<std::complex<double>, N, N>;
  const esokit::EigenMatrix<double, N> l =
      esokit::continuous_gain<N, double>(tuning.observer_bandwidth);
  const esokit::EigenMatrix<double, Order> k =
      esokit::continuous_gain<Order, double>(tuning.controller_bandwidth);
  esokit::EigenMatrix<double, 1, N> law;
  for (int i = 0; i < Order; ++i) law(i) = k(Order - 1 - i) / tuning.input_gain;
  law(Order) = 1 / tuning.input_gain;
  const esokit::EigenMatrix<double, N, N> closed = Chain::state_matrix() -
                                                   l * Chain::output_matrix() -
                                                   Chain::input_matrix(tuning.input_gain) * law;
  const Complex pencil = s * Complex::Identity() - closed.template cast<std::complex<double>>();
  const Eigen::Matrix<std::complex<double>, N, 1> z =
      pencil.inverse() * l.template cast<std::complex<double>>();
  return (law.template cast<std::complex<double>>() * z).value();
}

std::complex<double> pid_at(std::complex<double> s, const PidGains<double>& pid) {
  return (pid.proportional + pid.integral / s + pid.derivative * s) /
         (1.0 + pid.filter_time * s + pid.filter_time_squared * s * s);
}

TEST(PidConversion, AdrcIsThisPidAtEveryFrequency) {
  for (const AdrcTuning<double>& tuning :
       {AdrcTuning<double>{2, 5, 20}, {-0.7, 12, 12}, {3, 9, 4}}) {
    const auto one = esokit::pid_from_adrc<1>(tuning).value();
    const auto two = esokit::pid_from_adrc<2>(tuning).value();
    for (const double omega : {0.01, 0.3, 3.0, 40.0, 700.0}) {
      const std::complex<double> s(0, omega);
      const auto a1 = adrc_at<1>(s, tuning);
      const auto a2 = adrc_at<2>(s, tuning);
      EXPECT_LT(std::abs(pid_at(s, one) - a1), 1e-10 * std::abs(a1));
      EXPECT_LT(std::abs(pid_at(s, two) - a2), 1e-10 * std::abs(a2));
    }
  }
}

TEST(PidConversion, ThereAndBack) {
  for (const double kappa : {1.0, 1.5, 3.0, 9.9}) {
    const AdrcTuning<double> tuning{-2, 7, 7 * kappa};
    const auto second = esokit::adrc_from_pid<2>(esokit::pid_from_adrc<2>(tuning).value()).value();
    // Near kappa = 1 the root is double: half the digits.
    const double tolerance = kappa < 1.2 ? 1e-6 : 1e-10;
    EXPECT_NEAR(second.input_gain / tuning.input_gain, 1, tolerance);
    EXPECT_NEAR(second.controller_bandwidth / 7, 1, tolerance);
    EXPECT_NEAR(second.observer_bandwidth / tuning.observer_bandwidth, 1, tolerance);
    const auto first =
        esokit::adrc_from_pid<1>(esokit::pid_from_adrc<1>(tuning).value(), kappa).value();
    EXPECT_NEAR(first.input_gain / tuning.input_gain, 1, 1e-12);
    EXPECT_NEAR(first.controller_bandwidth / 7, 1, 1e-12);
  }
}

/// Where no ADRC has the three gains it says which K_d one has.
TEST(PidConversion, RefusedWhereThereIsNone) {
  for (const double ratio : {3.0, 10.0, 100.0}) {
    // K_p^2 / (K_i K_d) at kappa = 1 and at the largest.
    const double most = 10.0 / 25.0;
    const double least = (ratio * ratio + 6 * ratio + 3) / ((2 * ratio + 3) * (2 * ratio + 3));
    for (const double derivative : {0.01, 0.2, 0.999 * least, 1.001 * least, 0.399, 0.401, 3.0}) {
      SCOPED_TRACE(::testing::Message() << derivative << ", ratio " << ratio);
      const PidGains<double> pid{1, 1, derivative};
      const auto tuning = esokit::adrc_from_pid<2>(pid, ratio);
      if (derivative > least && derivative < most) {
        ASSERT_TRUE(tuning.has_value());
        const auto back = esokit::pid_from_adrc<2>(*tuning).value();
        EXPECT_NEAR(back.proportional, 1, 1e-12);
        EXPECT_NEAR(back.integral, 1, 1e-12);
        EXPECT_NEAR(back.derivative, derivative, 1e-12);
        EXPECT_GE(tuning->observer_bandwidth, tuning->controller_bandwidth);
        continue;
      }
      ASSERT_EQ(refusal(tuning),
                "derivative: belongs to no ADRC with this proportional, integral and "
                "bandwidth_ratio; the nearest that does is");
      EXPECT_NEAR(tuning.error().limit, derivative < least ? least : most, 1e-12);
      // And that one is taken.
      const auto nearest =
          esokit::adrc_from_pid<2>(PidGains<double>{1, 1, tuning.error().limit}, ratio);
      ASSERT_TRUE(nearest.has_value());
      EXPECT_NEAR(esokit::pid_from_adrc<2>(*nearest)->derivative, tuning.error().limit, 1e-7);
    }
  }
  // A working PID that is far from every ADRC: K_d would be 8.2, and b0 wrong by as much.
  const auto far = esokit::adrc_from_pid<2>(PidGains<double>{40, 60, 1.5});
  ASSERT_FALSE(far.has_value());
  EXPECT_NEAR(far.error().limit, 8.217, 1e-3);
}

TEST(PidConversion, RefusedByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(esokit::adrc_from_pid<2>(PidGains<double>{0, 1, 1})),
            "proportional: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refusal(esokit::adrc_from_pid<2>(PidGains<double>{1, -1, 1})),
            "integral: must have the sign of proportional");
  EXPECT_EQ(refusal(esokit::adrc_from_pid<2>(PidGains<double>{1, 1, -1})),
            "derivative: must have the sign of proportional");
  EXPECT_EQ(refusal(esokit::adrc_from_pid<2>(PidGains<double>{1, 1, nan})),
            "derivative: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refusal(esokit::adrc_from_pid<2>(PidGains<double>{1, 1, 1}, 1.0)),
            "bandwidth_ratio: must be finite and above");
  EXPECT_EQ(refusal(esokit::adrc_from_pid<1>(PidGains<double>{1, 1, 0}, nan)),
            "bandwidth_ratio: must be finite and positive");
  EXPECT_EQ(refusal(esokit::adrc_from_pid<1>(PidGains<double>{1e-200, 1e100, 0}, 5.0)),
            "proportional: gives an input gain that the scalar cannot hold");
  EXPECT_EQ(refusal(esokit::pid_from_adrc<1>(AdrcTuning<double>{0, 1, 1})),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refusal(esokit::pid_from_adrc<1>(AdrcTuning<double>{1, 0, 1})),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(refusal(esokit::pid_from_adrc<1>(AdrcTuning<double>{1, 1, nan})),
            "observer_bandwidth: must be finite and positive");
}

}  // namespace tune_pid_conversion_test
