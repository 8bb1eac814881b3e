// Tracking differentiators: time-optimal, without overshoot and chatter, exact at the reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/core/error_text.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_tracking_differentiator_test {

using esokit::TrackingDifferentiator;

/// fhan as Han's book prints it, with its intermediate names and signs.
double fhan_printed(double x1, double x2, double r, double h) {
  const auto sign = [](double x) { return x > 0 ? 1.0 : x < 0 ? -1.0 : 0.0; };
  const double d = r * h * h;
  const double a0 = h * x2;
  const double y = x1 + a0;
  const double a1 = std::sqrt(d * (d + 8 * std::abs(y)));
  const double a2 = a0 + sign(y) * (a1 - d) / 2;
  const double sy = (sign(y + d) - sign(y - d)) / 2;
  const double a = (a0 + y - a2) * sy + a2;
  const double sa = (sign(a + d) - sign(a - d)) / 2;
  return -r * (a / d - sign(a)) * sa - r * sign(a);
}

TEST(Fhan, EqualsThePrintedForm) {
  Random random(4);
  for (int i = 0; i < 5000; ++i) {
    const double r = random.log_uniform(0.1, 1e3);
    const double h = random.log_uniform(1e-3, 0.1);
    const double scale = r * h * h * random.log_uniform(0.01, 1e3);
    const double x1 = random.uniform(-1, 1) * scale;
    const double x2 = random.uniform(-1, 1) * scale / h;
    EXPECT_NEAR(esokit::fhan(x1, x2, r, h), fhan_printed(x1, x2, r, h), 1e-9 * r);
  }
  EXPECT_EQ(esokit::fhan(0.0, 0.0, 2.0, 0.1), 0.0);
}

/// A unit step takes 2 sqrt(1 / R) and ends exactly on the reference; |r2'| <= R on the way.
TEST(TrackingDifferentiator, StepIsTimeOptimalWithoutChatter) {
  constexpr double R = 25;
  constexpr double h = 1e-3;
  auto td = TrackingDifferentiator<>::make({.acceleration = R, .sample_time = h}).value();
  const double optimal = 2 * std::sqrt(1 / R);
  double arrived = 0;
  double last = 0;
  for (int k = 1; k <= 2000; ++k) {
    ASSERT_TRUE(td.update(1));
    EXPECT_LE(std::abs(td.derivative() - last), R * h * (1 + 1e-9));
    EXPECT_LE(td.value(), 1 + 1e-12);
    EXPECT_GE(td.value(), -1e-15);
    last = td.derivative();
    if (std::abs(td.value() - 1) > 1e-9) arrived = k * h;
  }
  EXPECT_NEAR(arrived, optimal, 5 * h);
  EXPECT_NEAR(td.value(), 1, 1e-12);
  EXPECT_NEAR(td.derivative(), 0, 1e-9);
}

/// It is always ready to stop at the reference, so it stays r2^2 / (2 R) behind a moving one.
/// The acceleration is that by which r2 has changed; what is refused changes none of the three.
TEST(TrackingDifferentiator, MotionTellsTheAcceleration) {
  constexpr double h = 1e-3;
  auto td = TrackingDifferentiator<>::make({.acceleration = 25, .sample_time = h}).value();
  EXPECT_EQ(td.motion()(2), 0.0);
  double largest = 0;
  for (int k = 0; k < 300; ++k) {
    const double before = td.derivative();
    ASSERT_TRUE(td.update(1));
    const auto motion = td.motion();
    EXPECT_EQ(motion(0), td.value());
    EXPECT_EQ(motion(1), td.derivative());
    EXPECT_NEAR(motion(2), (td.derivative() - before) / h, 1e-9 * 25);
    largest = std::max(largest, std::abs(motion(2)));
  }
  EXPECT_NEAR(largest, 25, 1e-9);
  ASSERT_TRUE(td.update(2));
  const auto moving = td.motion();
  EXPECT_NE(moving(2), 0.0);
  EXPECT_FALSE(td.update(hidden_nan<double>()));
  EXPECT_FALSE(td.reset(hidden_nan<double>()));
  EXPECT_EQ(td.motion(), moving);
  ASSERT_TRUE(td.reset(1));
  EXPECT_EQ(td.motion()(2), 0.0);
}

TEST(TrackingDifferentiator, FollowsASine) {
  constexpr double h = 1e-3;
  constexpr double R = 200;
  auto td = TrackingDifferentiator<>::make({.acceleration = R, .sample_time = h}).value();
  double behind = 0;
  for (int k = 0; k < 20000; ++k) {
    const double t = k * h;
    td.update(std::sin(2 * t));
    if (t < 2) continue;
    const double speed = 2 * std::cos(2 * t);
    const double lag = speed * speed / (2 * R);
    EXPECT_NEAR(td.value(), std::sin(2 * t), lag + 4 * R * h * h + 2 * h);
    EXPECT_NEAR(td.derivative(), speed, 4 * (2 / (2 * R) + h) + 2 * R * h);
    behind = std::max(behind, std::abs(td.value() - std::sin(2 * t)));
  }
  EXPECT_NEAR(behind, 4 / (2 * R), 2 * h);
}

/// A larger h0 lets less noise into the derivative.
TEST(TrackingDifferentiator, FilterTimeSmooths) {
  const auto roughness = [](double filter_time) {
    auto td = TrackingDifferentiator<>::make(
                  {.acceleration = 100, .sample_time = 1e-3, .filter_time = filter_time})
                  .value();
    Random random(8);
    double sum = 0;
    for (int k = 0; k < 5000; ++k) {
      td.update(random.uniform(-1e-3, 1e-3));
      sum += td.derivative() * td.derivative();
    }
    return std::sqrt(sum / 5000);
  };
  EXPECT_LT(roughness(0.02), 0.3 * roughness(0));
}

TEST(TrackingDifferentiator, BadReferenceChangesNothing) {
  auto td = TrackingDifferentiator<float>::make({.acceleration = 5, .sample_time = 1e-2f}).value();
  for (int k = 0; k < 10; ++k) td.update(1);
  for (const float bad : {hidden_nan<float>(), hidden_infinity<float>()}) {
    const auto before = td.state();
    EXPECT_FALSE(td.update(bad));
    EXPECT_FALSE(td.reset(bad));
    EXPECT_EQ(td.state(), before);
  }
  EXPECT_TRUE(td.reset(2));
  EXPECT_EQ(td.value(), 2);
  EXPECT_EQ(td.derivative(), 0);
}

TEST(TrackingDifferentiator, RefusesByName) {
  const auto text = [](double R, double h, double h0) -> std::string {
    const auto made =
        TrackingDifferentiator<>::make({.acceleration = R, .sample_time = h, .filter_time = h0});
    return made ? "accepted" : esokit::to_text(made.error());
  };
  EXPECT_EQ(text(1, 0.01, 0), "accepted");
  EXPECT_EQ(text(1, 0.01, 0.05), "accepted");
  EXPECT_EQ(text(0, 0.01, 0), "acceleration = 0: must be finite and positive");
  EXPECT_EQ(text(1, -1, 0), "sample_time = -1: must be finite and positive");
  EXPECT_EQ(text(1, 0.01, 0.001),
            "filter_time = 0.001: must be 0 or not below sample_time, which is 0.01");
  EXPECT_EQ(text(1, 0.01, -1), "filter_time = -1: must be finite and not negative");
  EXPECT_EQ(refusal(TrackingDifferentiator<>::make({.acceleration = 1e-300, .sample_time = 1e-10})),
            "acceleration: times sample_time squared leaves the scalar's range");
}

/// It arrives from any place at any other, and stands still there, in float as in double: however
/// small its steps are beside r.
template <class S>
void arrives_anywhere() {
  Random random(53);
  const double digit = static_cast<double>(std::numeric_limits<S>::epsilon());
  for (int i = 0; i < 300; i += stride) {
    const double h = random.log_uniform(1e-5, 1e-2);
    const double R = random.log_uniform(1e-2, 1e3);
    const double way = R * h * h * random.log_uniform(1, 1e6) / 4;
    // So that the double digits, those of r and those kept beside it, hold a step R h^2.
    const double base = random.uniform(-1, 1) * R * h * h * 1e-3 / (digit * digit * 64);
    auto td = TrackingDifferentiator<S>::make(
                  {.acceleration = static_cast<S>(R), .sample_time = static_cast<S>(h)})
                  .value();
    ASSERT_TRUE(td.reset(static_cast<S>(base)));
    const S target = static_cast<S>(base + way);
    const double distance =
        std::fabs(static_cast<double>(target) - static_cast<double>(static_cast<S>(base)));
    const int samples = static_cast<int>(2 * std::sqrt(distance / R) / h) + 50;
    for (int k = 0; k < samples + samples / 10; ++k) ASSERT_TRUE(td.update(target));
    EXPECT_LE(std::fabs(td.value() - target), std::numeric_limits<S>::epsilon() * std::fabs(target))
        << "R " << R << ", h " << h << ", from " << base << " by " << distance;
    EXPECT_LE(std::fabs(static_cast<double>(td.derivative())), 0.1 * R * h)
        << "R " << R << ", h " << h << ", from " << base << " by " << distance;
  }
}

TEST(TrackingDifferentiator, ArrivesAnywhere) {
  arrives_anywhere<float>();
  arrives_anywhere<double>();
}

/// The case of 10000 -> 10001 in float.
TEST(TrackingDifferentiator, StandsStillBesideALargeReference) {
  auto td = TrackingDifferentiator<float>::make({.acceleration = 10, .sample_time = 1e-4f}).value();
  ASSERT_TRUE(td.reset(10000));
  for (int k = 0; k < 20'000; ++k) ASSERT_TRUE(td.update(10001));
  EXPECT_EQ(td.value(), 10001);
  EXPECT_NEAR(td.derivative(), 0, 1e-5);
}

}  // namespace control_tracking_differentiator_test
}  // namespace esokit_test
