#include <gtest/gtest.h>

#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <paper4_nhoeso/sign_differentiator.hpp>

namespace esokit_test {
namespace examples_sign_differentiator_test {

using State = esokit::EigenMatrix<double, 2>;
constexpr double R = 12.4;
constexpr paper4::SignDifferentiator td{R};

/// By Runge-Kutta, against the time-optimal path: it chatters by R h around the switching curve.
TEST(SignDifferentiator, ReachesTheReference) {
  constexpr double h = 1e-4;
  const auto rate = [](double, const State& r) -> State { return td.rate(r, 1.0); };
  const double optimal = 2 * std::sqrt(1 / R);
  State r = State::Zero();
  for (int k = 1; k <= 10000; ++k) {
    r = esokit::sim::integrate(rate, (k - 1) * h, r, h, 1);
    const double t = k * h;
    const double path = t < optimal / 2 ? R * t * t / 2
                        : t < optimal   ? 1 - R * (optimal - t) * (optimal - t) / 2
                                        : 1;
    ASSERT_NEAR(r(0), path, 2 * R * h * optimal + 1e-6) << t;
  }
  EXPECT_NEAR(r(1), 0, 2 * R * h);
}

/// The switching curve: r1 - r = -r2^2 / (2 R), from both sides.
TEST(SignDifferentiator, SwitchesOnTheCurve) {
  EXPECT_EQ(td.rate({0.0, 0.5}, 1.0), State(0.5, R));
  EXPECT_EQ(td.rate({1.0, 0.5}, 1.0), State(0.5, -R));
  EXPECT_EQ(td.rate({1.0, 0.0}, 1.0), State(0.0, 0.0));
  EXPECT_EQ(td.rate({1 - 0.25 / (2 * R) - 1e-9, 0.5}, 1.0)(1), R);
  EXPECT_EQ(td.rate({1 - 0.25 / (2 * R) + 1e-9, 0.5}, 1.0)(1), -R);
}

}  // namespace examples_sign_differentiator_test
}  // namespace esokit_test
