#include <gtest/gtest.h>

#include <complex>
#include <esokit/eigen.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/gain/pole_set.hpp>

namespace gain_continuous_gain_test {

using esokit::Array;
using esokit::continuous_gain;
using esokit::EigenMatrix;
using Complex = std::complex<double>;

TEST(ContinuousGain, FromBandwidthIsBinomial) {
  // (s + 10)^3 = s^3 + 30 s^2 + 300 s + 1000
  EXPECT_EQ((continuous_gain<3>(10.0)), (EigenMatrix<double, 3>(30, 300, 1000)));
  EXPECT_EQ((continuous_gain<2>(250.0f)), (EigenMatrix<float, 2>(500, 62500)));
  EXPECT_EQ((continuous_gain<5>(2.0)), (EigenMatrix<double, 5>() << 10, 40, 80, 80, 32).finished());
}

TEST(ContinuousGain, FromPolesIsTheirPolynomial) {
  // (s + 1)(s + 2)(s + 4) = s^3 + 7 s^2 + 14 s + 8
  EXPECT_EQ((continuous_gain<3>(Array<Complex, 3>{-1.0, -2.0, -4.0})),
            (EigenMatrix<double, 3>(7, 14, 8)));
  // (s^2 + 6 s + 25)(s + 2) = s^3 + 8 s^2 + 37 s + 50
  EXPECT_EQ((continuous_gain<3>(Array<Complex, 3>{Complex(-3, 4), -2.0, Complex(-3, -4)})),
            (EigenMatrix<double, 3>(8, 37, 50)));
  // ((s + 1)^2 + 1)^2 = s^4 + 4 s^3 + 8 s^2 + 8 s + 4
  EXPECT_EQ((continuous_gain<4>(Array<Complex, 4>{Complex(-1, 1), Complex(-1, 1), Complex(-1, -1),
                                                  Complex(-1, -1)})),
            (EigenMatrix<double, 4>(4, 8, 8, 4)));
}

TEST(ContinuousGain, EqualPolesEqualTheBandwidth) {
  Array<Complex, 6> poles;
  poles.fill(-7.5);
  const auto a = continuous_gain<6>(poles);
  const auto b = continuous_gain<6>(7.5);
  EXPECT_TRUE(eigen(a).isApprox(eigen(b), 1e-15));
}

}  // namespace gain_continuous_gain_test
