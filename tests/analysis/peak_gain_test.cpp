// The peak gain against closed forms, and against the impulse response of an observer that runs.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/analysis/peak_gain.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <numbers>
#include <support/refusal.hpp>

namespace analysis_peak_gain_test {

using namespace esokit;
using esokit_test::refusal;

TEST(PeakGain, OfAnOscillatorIsKnown) {
  for (const double zeta : {0.1, 0.5}) {
    LinearSystem<2, 1, 1> system;
    system.a << 0.0, 1.0, -25.0, -10.0 * zeta;
    system.b << 0.0, 25.0;
    system.c << 1.0, 0.0;
    const double root = std::sqrt(1.0 - zeta * zeta);
    const double exact = 1.0 / std::tanh(0.5 * std::numbers::pi * zeta / root);
    EXPECT_NEAR(peak_gain(system).value()(0, 0), exact, 2e-4 * exact);
  }
  LinearSystem<1, 1, 1> sampled;
  sampled.sample_time = 1.0;
  sampled.a(0, 0) = -1.8;  // A = -0.8
  sampled.b(0, 0) = 2.0;
  sampled.c(0, 0) = 1.0;
  sampled.d(0, 0) = -3.0;
  EXPECT_NEAR(peak_gain(sampled).value()(0, 0), 3.0 + 2.0 / 0.2, 1e-7);
  sampled.a(0, 0) = 0.0;
  EXPECT_EQ(refusal(peak_gain(sampled)), "stability_abscissa: must be negative: it is not stable");
}

TEST(PeakGain, OfASampledObserverIsTheSumOfItsImpulseResponse) {
  auto observer = CascadeEso<2, 2>::make({.observer_bandwidth = 20.0,
                                          .bandwidth_factor = 2.0,
                                          .input_gain = 1.0,
                                          .sample_time = 0.01})
                      .value();
  const auto peak = peak_gain(error_system(observer)).value();
  EigenMatrix<double, 3> sum = EigenMatrix<double, 3>::Zero();
  for (int k = 0; k < 2000; ++k) {
    observer.update(k == 0 ? 1.0 : 0.0, 0.0);
    sum += eigen(observer.estimate()).cwiseAbs();
  }
  for (int r = 0; r < 3; ++r) EXPECT_NEAR(peak(r, 0), sum(r), 1e-7 * sum(r));
  // w = d' of one, held over a sample: from then on d is a constant.
  const double T = observer.sample_time();
  ASSERT_EQ(observer.reset(EigenMatrix<double, 3>(0.0, 0.0, 0.0)), StepStatus::ok);
  EigenMatrix<double, 3> truth(T * T * T / 6.0, T * T / 2.0, T);
  sum.setZero();
  for (int k = 0; k < 2000; ++k) {
    observer.update(truth(0), 0.0);
    sum += eigen((truth - observer.estimate())).cwiseAbs();
    truth(0) += T * (truth(1) + 0.5 * T * truth(2));
    truth(1) += T * truth(2);
  }
  for (int r = 0; r < 3; ++r) EXPECT_NEAR(peak(r, 1), sum(r), 1e-7 * sum(r));
}

}  // namespace analysis_peak_gain_test
