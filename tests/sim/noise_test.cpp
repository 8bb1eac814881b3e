// Noise: reproducible to the digit, of the stated moments, held as long as stated.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <esokit/sim/noise.hpp>
#include <vector>

namespace sim_noise_test {

using namespace esokit::sim;

// Made by an independent program (Python, own mt19937_64 checked against the 10000th number that
// the C++ standard prints, polar method).
TEST(Noise, GoldenValues) {
  const double seed_1[] = {-0.039399956754155314, -0.38683176162103955, -0.24894784633514516,
                           0.6868236391793252,    -0.05464685232137162, -0.7951462437094919};
  const double seed_2024[] = {0.4846376703949671,  1.267525262480713,  -1.2166635819871587,
                              -0.8602975386147099, 0.6971382143369529, 0.10673064915252513};
  Gaussian first(1);
  Gaussian second(2024);
  for (const double expected : seed_1) EXPECT_NEAR(first.next(), expected, 2e-15);
  for (const double expected : seed_2024) EXPECT_NEAR(second.next(), expected, 2e-15);
}

TEST(Noise, MomentsOfTheNormalDistribution) {
  Gaussian gaussian(7);
  const int count = 1000000;
  double sum = 0, square = 0, fourth = 0, neighbour = 0, last = 0, second_last = 0, skip = 0;
  int beyond_2 = 0;
  for (int i = 0; i < count; ++i) {
    const double value = gaussian.next();
    sum += value;
    square += value * value;
    fourth += value * value * value * value;
    neighbour += value * last;
    skip += value * second_last;
    second_last = last;
    last = value;
    if (std::abs(value) > 2.0) ++beyond_2;
  }
  // Four standard deviations of each estimate.
  const double unit = 4.0 / std::sqrt(count);
  EXPECT_NEAR(sum / count, 0.0, unit);
  EXPECT_NEAR(square / count, 1.0, unit * std::sqrt(2.0));
  EXPECT_NEAR(fourth / count, 3.0, unit * std::sqrt(96.0));
  EXPECT_NEAR(neighbour / count, 0.0, unit);
  EXPECT_NEAR(skip / count, 0.0, unit);
  EXPECT_NEAR(static_cast<double>(beyond_2) / count, std::erfc(std::sqrt(2.0)), unit * 0.21);
}

TEST(Noise, SeedsAreIndependent) {
  Gaussian first(1);
  Gaussian second(2);
  const int count = 100000;
  double product = 0;
  for (int i = 0; i < count; ++i) product += first.next() * second.next();
  EXPECT_NEAR(product / count, 0.0, 4.0 / std::sqrt(count));
}

TEST(Noise, WhiteNoiseScalesAndRewinds) {
  auto noise = WhiteNoise<>::make({.standard_deviation = 3.0, .seed = 1}).value();
  Gaussian gaussian(1);
  std::vector<double> drawn;
  for (int i = 0; i < 5; ++i) {
    drawn.push_back(noise.next());
    EXPECT_DOUBLE_EQ(drawn.back(), 3.0 * gaussian.next());
  }
  noise.reset();
  for (const double expected : drawn) EXPECT_EQ(noise.next(), expected);
  auto copy = noise;
  EXPECT_EQ(copy.next(), noise.next());
}

TEST(Noise, FloatSeesTheSameNoise) {
  auto f = WhiteNoise<float>::make({.standard_deviation = 1.0F, .seed = 5}).value();
  auto d = WhiteNoise<double>::make({.standard_deviation = 1.0, .seed = 5}).value();
  for (int i = 0; i < 100; ++i) EXPECT_EQ(f.next(), static_cast<float>(d.next()));
}

TEST(Noise, BandLimitedVarianceIsPowerOverHold) {
  auto noise = BandLimitedWhiteNoise<>::make({.power = 1e-9, .hold = 0.01, .seed = 3}).value();
  EXPECT_DOUBLE_EQ(noise.standard_deviation(), std::sqrt(1e-7));
  const int count = 200000;
  double square = 0;
  for (int i = 0; i < count; ++i) {
    const double value = noise.next();
    square += value * value;
  }
  EXPECT_NEAR(square / count, 1e-7, 1e-7 * 4.0 * std::sqrt(2.0 / count));
}

TEST(Noise, ZeroPowerIsNoNoise) {
  auto noise = BandLimitedWhiteNoise<>::make({.power = 0.0, .hold = 0.01}).value();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(noise.next(), 0.0);
}

// With step 0.001 and hold 0.01, floor(k step/hold) is wrong at some k; the index never is.
TEST(Noise, HeldNoiseChangesAtTheEdgesOnly) {
  auto held = HeldNoise<>::make({.power = 1.0, .hold = 0.01, .step = 0.001, .seed = 9}).value();
  auto drawn = BandLimitedWhiteNoise<>::make({.power = 1.0, .hold = 0.01, .seed = 9}).value();
  EXPECT_EQ(held.steps_per_hold(), 10);
  double expected = 0.0;
  for (int k = 0; k < 5000; ++k) {
    if (k % 10 == 0) expected = drawn.next();
    ASSERT_EQ(held.at(k), expected) << k;
    ASSERT_EQ(held.at(k), expected) << k;
  }
}

TEST(Noise, HeldNoiseDependsOnTheIndexAlone) {
  const HeldNoise<>::Config config{.power = 1.0, .hold = 0.003, .step = 0.001, .seed = 4};
  auto forward = HeldNoise<>::make(config).value();
  std::vector<double> values;
  for (int k = 0; k < 60; ++k) values.push_back(forward.at(k));
  auto jumping = HeldNoise<>::make(config).value();
  for (const std::size_t k : {59u, 0u, 31u, 30u, 2u, 3u, 58u, 5u}) {
    EXPECT_EQ(jumping.at(static_cast<int>(k)), values[k]) << k;
  }
  EXPECT_EQ(jumping.at(-1), 0.0);
  EXPECT_EQ(jumping.at(0), values[0]);
  EXPECT_NE(values[2], values[3]);
}

TEST(Noise, HoldOfOneStepAndRoundedRatios) {
  EXPECT_EQ(HeldNoise<>::make({.power = 1.0, .hold = 1e-3, .step = 1e-3})->steps_per_hold(), 1);
  EXPECT_EQ(HeldNoise<>::make({.power = 1.0, .hold = 0.3, .step = 0.1})->steps_per_hold(), 3);
  EXPECT_EQ(HeldNoise<float>::make({.power = 1.0F, .hold = 0.07F, .step = 1e-3F})->steps_per_hold(),
            70);
  // Every decimal pair up to 1 s is accepted.
  for (int ratio = 1; ratio <= 1000; ++ratio) {
    const auto held = HeldNoise<>::make({.power = 1.0, .hold = ratio / 1000.0, .step = 0.001});
    ASSERT_TRUE(held) << ratio;
    ASSERT_EQ(held->steps_per_hold(), ratio);
  }
}

}  // namespace sim_noise_test
