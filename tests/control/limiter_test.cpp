// A limit of rate holds at any magnitude of u: also where the digits of u do not hold a step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_limiter_test {

using esokit::Adrc;
using esokit::Limiter;
using esokit::Limits;
using esokit::LinearEso;

template <class S>
constexpr S epsilon = std::numeric_limits<S>::epsilon();

/// From `start` towards far away: where u has to be after each sample, and how far it may be off.
/// @param bounded whether the magnitude has limits
template <class S>
void arrives(S start, S step, S direction, bool bounded, int samples) {
  SCOPED_TRACE(testing::Message() << "start " << start << ", step " << step << ", way " << direction
                                  << (bounded ? ", bounded" : ""));
  const S far = S(4) * std::fabs(start);
  Limits<S> limits{.rate = step};
  if (bounded) {
    limits.lower = -far;
    limits.upper = far;
  }
  auto limiter = Limiter<S>::make(limits, S(1)).value();
  limiter.track(start);
  S u = start;
  for (int k = 1; k <= samples && static_cast<S>(k) * step < S(2) * std::fabs(start) &&
                  !testing::Test::HasFailure();
       ++k) {
    u = limiter(direction * far);
    const long double moved = static_cast<long double>(direction) *
                              (static_cast<long double>(u) - static_cast<long double>(start));
    const long double wanted = static_cast<long double>(k) * step;
    // Steps above 1024 digits are added as they are, each rounded by half a digit.
    const long double digit = epsilon<S> * std::max(std::fabs(u), std::fabs(start));
    const bool waits = !bounded || step < S(1024) * epsilon<S> * far;
    const long double allowed = waits ? 2 * digit : k * digit / 2;
    // What is counted is itself rounded, by a digit of a step or of what waits.
    const long double counted =
        k * static_cast<long double>(epsilon<S>) * (static_cast<long double>(step) + digit);
    EXPECT_LE(std::fabs(moved - wanted), allowed + counted) << "sample " << k << ", u " << u;
  }
}

template <class S>
void arrives_from_anywhere() {
  Random random(7);
  for (int i = 0; i < 300; i += stride) {
    const auto start =
        static_cast<S>((random.index(2) == 0 ? -1 : 1) * random.log_uniform(1e-3, 1e6));
    const auto step = std::fabs(start) * epsilon<S> * static_cast<S>(random.log_uniform(1e-2, 1e5));
    arrives<S>(start, step, random.index(2) == 0 ? S(-1) : S(1), random.index(2) == 0, 2000);
  }
}

TEST(Limiter, ARateHoldsAtAnyMagnitude) {
  arrives_from_anywhere<float>();
  arrives_from_anywhere<double>();
  arrives_from_anywhere<long double>();
}

TEST(Limiter, TheCaseOfAHeater) {
  for (const float rate : {1.0f, 2.0f, 3.7f, 10.0f}) {
    auto limiter = Limiter<float>::make({.lower = 0, .upper = 3000, .rate = rate}, 1e-4f).value();
    limiter.track(2500);
    float u = 0;
    for (int k = 0; k < 100'000; ++k) u = limiter(0);
    EXPECT_NEAR(u, 2500 - 10 * rate, 2e-3) << rate;
  }
}

/// Over no time u moves by more than the rate allows, and a digit: with commands that jump, and
/// outputs that are reported over and over in between.
TEST(Limiter, NoCommandMovesFasterThanTheRate) {
  Random random(11);
  for (int i = 0; i < 200; i += stride) {
    const auto scale = static_cast<float>(random.log_uniform(1, 1e5));
    const auto step = scale * epsilon<float> * static_cast<float>(random.log_uniform(1e-2, 3e3));
    auto limiter = Limiter<float>::make({.lower = -scale, .upper = scale, .rate = step}, 1).value();
    const auto at = static_cast<float>(random.uniform(-scale, scale));
    limiter.track(at);
    double path = 0;
    float last = at;
    for (int k = 1; k <= 1000; ++k) {
      const float command = random.index(3) == 0
                                ? static_cast<float>(random.uniform(-scale, scale))
                                : last + static_cast<float>(random.uniform(-2, 2)) *
                                             std::max(step, epsilon<float> * scale);
      for (int again = random.index(3); again > 0; --again) limiter.track(last);
      const float u = limiter(command);
      ASSERT_LE(std::fabs(u), scale);
      path += std::fabs(static_cast<double>(u) - static_cast<double>(last));
      last = u;
      const double digit = static_cast<double>(epsilon<float> * scale);
      const bool waits = limiter.waits();
      ASSERT_LE(path, k * static_cast<double>(step) * (1 + 2e-7) +
                          (waits ? 2 + k * 2e-7 : k / 2.0) * digit)
          << scale << ", step " << step << ", sample " << k;
    }
  }
}

/// What waits survives a retune and a change of the sample time at each sample.
TEST(Limiter, WhatWaitsIsKeptByAdopt) {
  const auto fresh = Limiter<float>::make({.lower = 0, .upper = 3000, .rate = 1}, 1e-4f).value();
  const auto longer = Limiter<float>::make({.lower = 0, .upper = 3000, .rate = 1}, 2e-4f).value();
  auto limiter = fresh;
  limiter.track(2500);
  float u = 0;
  for (int k = 0; k < 100'000; ++k) {
    limiter.adopt(k % 2 == 0 ? fresh : longer, limiter.last());
    u = limiter(0);
  }
  EXPECT_NEAR(u, 2485, 2e-3);
}

TEST(Limiter, ALargeStepIsBitForBitAsWithoutWaiting) {
  Random random(3);
  const Limits<float> limits{.lower = -5, .upper = 4, .rate = 100};
  auto limiter = Limiter<float>::make(limits, 1e-3f).value();
  EXPECT_FALSE(limiter.waits());
  float last = 0;
  for (int k = 0; k < 1000; ++k) {
    const auto command = static_cast<float>(random.uniform(-6, 6));
    const float low = std::max(-5.0f, last - 100 * 1e-3f),
                high = std::min(4.0f, last + 100 * 1e-3f);
    const float wanted = std::min(std::max(command, low), high);
    last = limiter(command);
    EXPECT_TRUE(same_bits(last, wanted));
  }
}

/// 1024 digits of the larger limit are the border, from both sides.
TEST(Limiter, WaitsWhereItHasTo) {
  const auto waits = [](float lower, float upper, float step) {
    return Limiter<float>::make({.lower = lower, .upper = upper, .rate = step}, 1).value().waits();
  };
  for (const float sign : {-1.0f, 1.0f}) {
    const float border = 1024 * epsilon<float> * 8;
    EXPECT_FALSE(waits(std::min(1.0f, 8 * sign), std::max(1.0f, 8 * sign), border * 1.001f));
    EXPECT_TRUE(waits(std::min(1.0f, 8 * sign), std::max(1.0f, 8 * sign), border * 0.999f));
  }
  EXPECT_TRUE(waits(Limits<float>{}.lower, 1, 1e20f));
  EXPECT_TRUE(waits(-1, Limits<float>{}.upper, 1e20f));
  EXPECT_FALSE(Limiter<float>::make({.lower = -1}, 1).value().waits());
}

TEST(Limiter, RefusesARateThatWouldBeLost) {
  using S = float;
  const auto made = [](S rate, S T) {
    return Limiter<S>::make({.lower = -8, .upper = 1, .rate = rate}, T);
  };
  const S least = 8 * epsilon<S> * epsilon<S>;
  EXPECT_EQ(refusal(made(1.001f * least, 1)), "accepted");
  EXPECT_EQ(refusal(made(0.999f * least, 1)),
            "limits.rate: is lost beside the limits; in a sample u must move by more than");
  EXPECT_EQ(made(0.5f * least, 1).error().limit, least);
  EXPECT_EQ(refusal(made(1e-20f, 1e-20f)),
            "limits.rate: times sample_time leaves the scalar's range");
  EXPECT_EQ(refusal(Limiter<S>::make({.rate = 1e-30f}, 1)), "accepted");
  EXPECT_EQ(refusal(made(Limits<S>{}.rate, 1e-30f)), "accepted");
}

/// A lane that waits beside one that need not, and one without a limit of rate.
TEST(Limiter, LanesWaitEachForItself) {
  using Loop = Adrc<LinearEso<1, float>>;
  using Lanes = esokit::Packed<Loop, 4>;
  const auto config = [](float rate) {
    Loop::Config settings{};
    settings.observer = {.observer_bandwidth = 10, .input_gain = 1e-3f, .sample_time = 1e-4f};
    settings.controller_bandwidth = 1;
    settings.limits = {.lower = 0, .upper = 3000, .rate = rate};
    return settings;
  };
  const float rates[] = {1, 1e5f, Limits<float>{}.rate, 3};
  std::array<Loop, 4> plain{
      Loop::make(config(rates[0])).value(), Loop::make(config(rates[1])).value(),
      Loop::make(config(rates[2])).value(), Loop::make(config(rates[3])).value()};
  for (Loop& one : plain) (void)one.start(100, 2500);
  Lanes lanes([&](int i) { return plain[static_cast<std::size_t>(i)]; });
  Random random(5);
  for (int k = 0; k < 20'000; ++k) {
    typename Lanes::scalar_type y{}, r{};
    for (int i = 0; i < 4; ++i) {
      y[i] = static_cast<float>(200 + random.uniform(-1, 1));
      r[i] = 20;
    }
    const auto u = lanes.update(y, r);
    for (int i = 0; i < 4; ++i) {
      ASSERT_TRUE(same_bits(u[i], plain[static_cast<std::size_t>(i)].update(y[i], r[i])))
          << "lane " << i << ", sample " << k;
    }
  }
  EXPECT_NEAR(plain[0].output(), 2498, 1e-2);
  EXPECT_NEAR(plain[3].output(), 2494, 1e-2);
}

/// The rate holds in every controller, also when it is told its steps one by one.
TEST(Limiter, ControllersKeepASlowRate) {
  const LinearEso<1, float>::Config observer{
      .observer_bandwidth = 10, .input_gain = 1e-3f, .sample_time = 1e-4f};
  const Limits<float> limits{.lower = 0, .upper = 3000, .rate = 1};
  const int samples = 50'000;  // 5 s
  auto adrc = Adrc<LinearEso<1, float>>::make(
                  {.observer = observer, .controller_bandwidth = 1, .limits = limits})
                  .value();
  (void)adrc.start(100, 2500);
  auto predictive = esokit::PredictiveAdrc<LinearEso<1, float>>::make(
                        {.observer = observer, .controller_bandwidth = 1, .limits = limits})
                        .value();
  (void)predictive.start(100, 2500);
  using Varied = Adrc<esokit::VariableTime<LinearEso<1, float>>>;
  auto varied =
      Varied::make(
          {.observer = {.observer = observer}, .controller_bandwidth = 1, .limits = limits})
          .value();
  (void)varied.start(100, 2500);
  for (int k = 0; k < samples; ++k) {
    adrc.update(200, 20);
    predictive.update(200, 20);
    ASSERT_TRUE(varied.set_step_time(k % 2 == 0 ? 0.5e-4f : 1.5e-4f));
    varied.update(200, 20);
  }
  EXPECT_NEAR(adrc.output(), 2495, 1e-2);
  EXPECT_NEAR(predictive.output(), 2495, 1e-2);
  EXPECT_NEAR(varied.output(), 2495, 1e-2);
}

}  // namespace control_limiter_test
}  // namespace esokit_test
