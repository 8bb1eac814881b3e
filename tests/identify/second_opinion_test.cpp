// The second opinion: output error finds b0 from any start, with an interval, and says what it is
// worth.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/identify.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/sim/gaussian.hpp>

namespace identify_second_opinion_test {

using esokit::FitData;
using esokit::FitPoint;
using esokit::SecondOpinion;

constexpr double T = 0.01, b0 = 20, pole = 3;

// y' = b0 u(t - T) - a y + load, steps of u, and slow noise in y that has nothing to do with u.
FitData machine(std::uint64_t seed, double slow, double gain = b0) {
  esokit::sim::Gaussian gaussian(seed);
  FitData data;
  data.sample_time = T;
  double y = 0, u = 0, before = 0, coloured = 0;
  for (int k = 0; k < 1500; ++k) {
    if (k % 60 == 0) u = gaussian.next();
    coloured += 0.3 * (slow * gaussian.next() - coloured);
    data.u.push_back(u);
    data.y.push_back(y + coloured + 0.02 * gaussian.next());
    y += (1 - std::exp(-pole * T)) / pole * ((gain * before + 5) - pole * y);
    before = u;
  }
  return data;
}

SecondOpinion opinion(const FitData& data, const FitPoint& at) {
  const auto bounds = esokit::detail::fit_bounds(data, false);
  return esokit::second_opinion(data, {1, 1, true}, bounds, at, 0.1 * bounds.bandwidth_min);
}

// Single steps, each a short piece, and one load: y has settled in the rows that a u of zeros would
// leave.
TEST(SecondOpinion, WhatIsLeftWithoutUIsOfTheSameRows) {
  FitData data;
  data.sample_time = T;
  data.starts.clear();
  data.one_load = true;
  esokit::sim::Gaussian gaussian(4);
  for (const double level : {3.0, -2.0, 5.0, 1.5, -4.0, 6.0}) {
    data.starts.push_back(data.y.size());
    double y = 0;
    for (int k = 0; k < 190; ++k) {
      const double u = k < 15 ? 0 : level;
      data.u.push_back(u);
      data.y.push_back(y + 0.1 * gaussian.next());
      y += (1 - std::exp(-30 * T)) / 30 * (b0 * u - 30 * y);
    }
  }
  const auto bounds = esokit::detail::fit_bounds(data, false);
  // Also where the filter follows all that is slow.
  for (const double bandwidth : {0.1 * bounds.bandwidth_min, 3.0}) {
    const SecondOpinion found =
        esokit::second_opinion(data, {1, 1, true}, bounds, {1, 2 * T, 0.5, 30}, bandwidth);
    EXPECT_GT(found.explained, 0.8) << bandwidth;
    EXPECT_LT(found.explained, 1) << bandwidth;
    EXPECT_NEAR(found.input_gain.value, b0, found.input_gain.half_width) << bandwidth;
  }
}

TEST(SecondOpinion, FindsB0FromAnyStart) {
  const FitData data = machine(3, 0.5);
  const auto bounds = esokit::detail::fit_bounds(data, false);
  const SecondOpinion near = opinion(data, {1, 2 * T, 0.5, pole});
  EXPECT_EQ(near.bandwidth, 0.1 * bounds.bandwidth_min);
  EXPECT_LT(std::abs(near.input_gain.value - b0), near.input_gain.half_width);
  EXPECT_LT(near.input_gain.share(), 0.1);
  EXPECT_TRUE(near.informative());
  EXPECT_TRUE(near.agrees(b0));
  for (const FitPoint& far : {FitPoint{1, 0.05 * T, 1.0, 0.0}, FitPoint{1, 0.4, 0.1, -0.1},
                              FitPoint{1, 0.45, 1.0, 1.0}}) {
    const SecondOpinion found = opinion(data, far);
    EXPECT_NEAR(found.input_gain.value, near.input_gain.value, 0.02 * b0);
    EXPECT_NEAR(found.explained, near.explained, 1e-3);
  }
  // It is the fit at this bandwidth: there, no neighbour leaves less.
  esokit::FitBounds wide = bounds;
  wide.bandwidth_min = near.bandwidth;
  esokit::InnovationsFit fit(data, {1, 1, true}, wide);
  const auto best = fit.minimise({near.bandwidth, 2 * T, 0.5, pole}, false);
  EXPECT_NEAR(best.linear[0], near.input_gain.value, 1e-3 * b0);
  const auto errors = esokit::jackknife(fit, fit.at(best.at), false);
  EXPECT_NEAR(near.input_gain.half_width, esokit::student_95(19) * errors.linear[0],
              0.02 * near.input_gain.half_width);
  // Whatever the range of the bandwidth was before.
  esokit::FitBounds high = bounds;
  high.bandwidth_min = 30;
  const SecondOpinion same =
      esokit::second_opinion(data, {1, 1, true}, high, {1, 2 * T, 0.5, pole}, near.bandwidth);
  EXPECT_NEAR(same.input_gain.value, near.input_gain.value, 1e-6 * b0);
  // Of what is left without u: the noise, and the load that the filter takes.
  FitData still = data;
  std::fill(still.u.begin(), still.u.end(), 0.0);
  esokit::InnovationsFit without(still, {1, 1, true}, wide);
  double least = 1e300;
  for (const double a : {0.1, 1.0, 3.0, 10.0})
    least = std::min(least, without.minimise({near.bandwidth, 2 * T, 0.5, a}, false).mean_square);
  EXPECT_NEAR(1 - near.explained, best.mean_square / least, 0.2 * (1 - near.explained));
}

TEST(SecondOpinion, SaysWhatItIsWorth) {
  const SecondOpinion nothing = opinion(machine(4, 0.5, 0), {1, 2 * T, 0.5, pole});
  EXPECT_LT(nothing.explained, 0.3);
  EXPECT_FALSE(nothing.informative());
  // Below half of b0, from 70 % on; its sign does not matter.
  SecondOpinion found{{-10, 4.99}, 0.7, 1};
  EXPECT_TRUE(found.informative());
  found.explained = 0.699;
  EXPECT_FALSE(found.informative());
  found = {{-10, 5.01}, 0.7, 1};
  EXPECT_FALSE(found.informative());
  EXPECT_TRUE(found.agrees(-6.01));
  EXPECT_FALSE(found.agrees(-5.99));
  EXPECT_TRUE(found.agrees(-16.99));
  EXPECT_FALSE(found.agrees(-17.01));
  EXPECT_FALSE(found.agrees(10));
}

}  // namespace identify_second_opinion_test
