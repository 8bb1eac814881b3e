// Absurd but finite numbers at the observers: no public member gives infinities, what is refused
// changes nothing, and good samples lead back.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/adapter/known_model.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace observer_absurd_numbers_test {

using esokit::CascadeEso;
using esokit::ExtendedStateFilter;
using esokit::LinearEso;
using esokit::StepStatus;

// ---- shifts

template <class Observer>
void shifts_are_finite_or_nothing() {
  using S = typename Observer::scalar_type;
  typename Observer::Config config{};
  config.observer_bandwidth = S(50);
  config.input_gain = S(2);
  config.sample_time = static_cast<S>(1e-3);
  if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = S(2);
  const S top = std::numeric_limits<S>::max();
  for (const S offset : {top, S(-top), S(top / 4), hidden_nan<S>(), hidden_infinity<S>()}) {
    for (const bool output : {false, true}) {
      auto observer = Observer::make(config).value();
      for (int k = 0; k < 3; ++k) {
        const auto before = observer.estimate();
        const StepStatus status =
            output ? observer.shift_output(offset) : observer.shift_disturbance(offset);
        for (int level = 0; level < Observer::levels; ++level) {
          ASSERT_TRUE(eigen(observer.level_estimate(level)).allFinite()) << offset;
        }
        if (status != StepStatus::ok) {
          EXPECT_EQ(status, StepStatus::state_rejected);
          EXPECT_EQ(observer.estimate(), before);
        } else {
          EXPECT_NE(observer.estimate(), before);
        }
        if (!esokit::is_finite(offset)) {
          EXPECT_EQ(status, StepStatus::state_rejected);
        }
      }
    }
  }
  // What fits is taken.
  auto observer = Observer::make(config).value();
  EXPECT_EQ(observer.shift_output(S(3)), StepStatus::ok);
  EXPECT_EQ(observer.template estimate<0>(), S(3));
}

TEST(Shift, IsFiniteOrNothing) {
  shifts_are_finite_or_nothing<LinearEso<2, float>>();
  shifts_are_finite_or_nothing<LinearEso<2, double>>();
  shifts_are_finite_or_nothing<CascadeEso<2, 3, float>>();
  shifts_are_finite_or_nothing<CascadeEso<1, 2, double>>();
}

// ---- levels of a cascade

/// Disturbances of opposite sign cancel in the estimate, not in the level below. The slow level is
/// told of a disturbance again and again, and fed a y that keeps its own y where it is, so that the
/// quick level, which follows that, takes the disturbance back.
template <class S>
void levels_stay_finite() {
  using Observer = CascadeEso<1, 2, S>;
  auto observer = Observer::make({.observer_bandwidth = S(1),
                                  .bandwidth_factor = S(400),
                                  .input_gain = S(1),
                                  .sample_time = static_cast<S>(1e-3)})
                      .value();
  const S top = std::numeric_limits<S>::max();
  int refused = 0;
  S largest(0);
  for (int k = 0; k < 400; ++k) {
    if (k % 40 == 0) refused += observer.shift_disturbance(top / S(3)) != StepStatus::ok ? 1 : 0;
    const auto slow = observer.level_estimate(0);
    observer.update(slow(0) - slow(1) / S(2), S(0));
    for (int level = 0; level < 2; ++level) {
      ASSERT_TRUE(eigen(observer.level_estimate(level)).allFinite()) << "sample " << k;
    }
    if (std::abs(observer.total_disturbance()) < top / S(10)) {
      largest = std::max(largest, observer.level_estimate(0)(1));
    }
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(largest, top / S(4));
}

TEST(CascadeLevels, StayFinite) {
  levels_stay_finite<float>();
  levels_stay_finite<double>();
}

// ---- sample times at which finite squares do not mean finite estimates

/// @param time T, so short that the root of the largest number as a state is not finite as an
/// estimate
template <class Observer, class S = typename Observer::scalar_type>
void no_time_is_too_short(S time) {
  typename Observer::Config config{};
  config.observer_bandwidth = S(1) / (S(100) * time);
  config.input_gain = S(1) / (time * time);
  config.sample_time = time;
  if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = S(2);
  auto observer = Observer::make(config).value();
  EXPECT_EQ(observer.missed(), 0);
  const S top = std::numeric_limits<S>::max();
  int refused = 0, taken = 0;
  for (S y = S(1); y < top / S(16); y = y * S(4)) {
    const StepStatus status = observer.update(y, S(0));
    (status == StepStatus::ok ? taken : refused) += 1;
    if (status == StepStatus::ok) {
      EXPECT_EQ(observer.missed(), 0);
    }
    ASSERT_TRUE(eigen(observer.estimate()).allFinite()) << y;
    const auto before = observer.missed();
    observer.predict(S(0));
    EXPECT_EQ(observer.missed(), before == 65535 ? before : before + 1);
    observer.correct(S(0));
    ASSERT_TRUE(eigen(observer.estimate()).allFinite()) << y;
  }
  EXPECT_GT(taken, 0);
  EXPECT_GT(refused, 0);
  // Retuned to another time and back, it knows which test it needs.
  EXPECT_EQ(observer.reset(S(0)), StepStatus::ok);
  auto fresh = observer;
  config.sample_time = S(2) * time;
  ASSERT_TRUE(fresh.retune(config).has_value());
  EXPECT_EQ(fresh.missed(), 0);
  EXPECT_EQ(fresh.update(S(0.5), S(0)), StepStatus::ok);
}

TEST(SampleTime, NoneIsTooShortForFiniteEstimates) {
  no_time_is_too_short<LinearEso<2, float>>(1e-12f);
  no_time_is_too_short<LinearEso<3, float>>(1e-8f);
  no_time_is_too_short<CascadeEso<2, 3, float>>(1e-12f);
  no_time_is_too_short<LinearEso<2, double>>(1e-90);
  no_time_is_too_short<CascadeEso<2, 3, double>>(1e-90);
}

TEST(SampleTime, MissingSamplesAreCountedUpToTheEnd) {
  for (const float time : {1e-3f, 1e-12f}) {
    auto observer = LinearEso<2, float>::make({.observer_bandwidth = 0.01f / time,
                                               .input_gain = 1.0f / (time * time),
                                               .sample_time = time,
                                               .max_gap = 65000})
                        .value();
    for (int k = 1; k < 65600; ++k) {
      ASSERT_EQ(observer.predict(0.0f), StepStatus::ok);
      ASSERT_EQ(observer.missed(), k < 65534 ? k : 65535);
    }
    EXPECT_EQ(observer.correct(1.0f), StepStatus::restarted);
    EXPECT_EQ(observer.missed(), 0);
  }
}

// ---- a model that overflows

struct Steep {
  std::array<float, 2> slopes{};
  float operator()(const esokit::Vector<float, 3>& z) const noexcept {
    return -(slopes[0] * z(0)) - slopes[1] * z(1);
  }
};

TEST(KnownModelAbsurd, WhatTheModelSaysIsFiniteOrNothing) {
  using Observer = esokit::KnownModel<LinearEso<2, float>, Steep>;
  const auto made =
      Observer::make({.observer = {.observer_bandwidth = 50, .input_gain = 2, .sample_time = 1e-3f},
                      .model = {{1e30f, 1e20f}}});
  ASSERT_TRUE(made.has_value());
  auto observer = *made;
  for (const float y : {1e10f, -1e10f, 3e8f, 1e34f, -1e38f}) {
    for (int k = 0; k < 4; ++k) {
      observer.update(y, 1.0f);
      ASSERT_TRUE(eigen(observer.estimate()).allFinite()) << y;
      ASSERT_TRUE(esokit::is_finite(observer.total_disturbance())) << y;
      ASSERT_TRUE(esokit::is_finite(observer.known_part())) << y;
      ASSERT_TRUE(esokit::is_finite(observer.estimate<2>())) << y;
      ASSERT_EQ(observer.estimate()(2), observer.total_disturbance()) << y;
    }
  }
  // Where it fits it is told.
  EXPECT_EQ(observer.reset(0.0f), StepStatus::ok);
  EXPECT_EQ(observer.reset({1e-30f, 0, 0}), StepStatus::ok);
  EXPECT_NEAR(std::abs(observer.known_part()), 1, 1e-5);
  // Another model, of which the difference cannot be held, is refused.
  EXPECT_EQ(observer.reset({2e8f, 0, -2e38f}), StepStatus::ok);
  const auto before = observer;
  auto other = typename Observer::Config{
      .observer = {.observer_bandwidth = 50, .input_gain = 2, .sample_time = 1e-3f},
      .model = {{-1e30f, 0}}};
  const auto refused = observer.retune(other);
  ASSERT_EQ(refusal(refused), "model: would make the estimate not finite");
  EXPECT_EQ(observer.estimate(), before.estimate());
  EXPECT_EQ(observer.known_part(), before.known_part());
}

// ---- variances at both ends

template <class S>
typename ExtendedStateFilter<2, S>::Config filter_config() {
  typename ExtendedStateFilter<2, S>::Config config;
  config.input_gain = S(2);
  config.sample_time = static_cast<S>(1e-3);
  config.measurement_variance = static_cast<S>(1e-4);
  config.disturbance_bounds = {S(0), S(0), S(10)};
  config.inflation = static_cast<S>(0.1);
  eigen(config.initial_covariance).diagonal() << S(1), S(100), S(10000);
  config.outlier_threshold = S(25);
  return config;
}

template <class S>
void any_variance_is_harmless() {
  using Filter = ExtendedStateFilter<2, S>;
  const S top = std::numeric_limits<S>::max();
  for (const auto mode : {esokit::RiccatiMode::recursive, esokit::RiccatiMode::frozen}) {
    for (const S unit : {static_cast<S>(1e-4), S(1e6)}) {
      auto config = filter_config<S>();
      config.mode = mode;
      config.measurement_variance = unit;
      for (const S variance :
           {top, S(top / 2), S(top / 16), S(top / S(1e5f)), S(0), std::numeric_limits<S>::min(),
            std::numeric_limits<S>::denorm_min()}) {
        SCOPED_TRACE(::testing::Message() << "variance " << variance << ", R " << unit);
        auto filter = Filter::make(config).value();
        for (int k = 0; k < 20; ++k) filter.update(S(0.25), S(0));
        for (int k = 0; k < 3; ++k) {
          const auto before = filter.estimate();
          ASSERT_EQ(filter.update_weighted(S(0.25), S(0), variance), StepStatus::ok);
          ASSERT_TRUE(eigen(filter.covariance()).allFinite());
          ASSERT_TRUE(eigen(filter.gain()).allFinite());
          ASSERT_TRUE(esokit::is_finite(filter.innovation_variance()));
          ASSERT_TRUE(eigen(filter.estimate()).allFinite());
          if (variance > S(1e20f)) {
            // Says nothing: as if it had not come, but for the last digits.
            ASSERT_NEAR(filter.estimate()(0), before(0) + S(1e-3f) * before(1), S(1e-2f));
          }
        }
        // Every good sample is taken from then on.
        for (int k = 0; k < 200; ++k) {
          ASSERT_EQ(filter.update(S(0.25), S(0)), StepStatus::ok) << k;
          ASSERT_TRUE(eigen(filter.covariance()).allFinite());
          ASSERT_TRUE(eigen(filter.gain()).allFinite());
        }
        EXPECT_NEAR(filter.estimate()(0), S(0.25), S(0.01));
      }
    }
  }
}

TEST(FilterVariance, AnyIsHarmless) {
  any_variance_is_harmless<float>();
  any_variance_is_harmless<double>();
}

/// P0 = 0 and a first measurement without noise: the least of variances has no inverse.
TEST(FilterVariance, ZeroPriorAndTheLeastVariance) {
  auto config = filter_config<float>();
  eigen(config.initial_covariance).setZero();
  config.outlier_threshold = 0;
  auto filter = ExtendedStateFilter<2, float>::make(config).value();
  filter.update_weighted(1.0f, 0.0f, std::numeric_limits<float>::denorm_min());
  EXPECT_TRUE(eigen(filter.gain()).allFinite());
  EXPECT_TRUE(eigen(filter.covariance()).allFinite());
  EXPECT_TRUE(eigen(filter.estimate()).allFinite());
}

/// After a gap the covariance is large; in the unit of a tiny R it may be more than can be held.
template <class S>
void retune_to_any_variance_is_finite_or_refused() {
  using Filter = ExtendedStateFilter<2, S>;
  auto config = filter_config<S>();
  config.outlier_threshold = S(0);  // of an R below rounding the gate lets nothing through
  eigen(config.initial_covariance).setZero();
  config.sample_time = S(0.1);
  config.disturbance_bounds[2] = S(1000);
  int refusals = 0;
  int taken = 0;
  for (const int gap : {0, 5, 60}) {
    for (int exponent = -4; exponent > std::numeric_limits<S>::min_exponent10; exponent -= 3) {
      SCOPED_TRACE(::testing::Message() << "R = 1e" << exponent << " after " << gap);
      auto filter = Filter::make(config).value();
      for (int k = 0; k < 50; ++k) filter.update(S(0.25), S(0));
      for (int k = 0; k < gap; ++k) filter.predict(S(0));
      auto other = config;
      other.measurement_variance = static_cast<S>(std::pow(10.0, exponent));
      other.disturbance_bounds[2] = S(10) * std::sqrt(other.measurement_variance);
      if (!Filter::make(other)) continue;
      const auto before = filter;
      const auto outcome = filter.retune(other);
      ASSERT_TRUE(eigen(filter.covariance()).allFinite());
      ASSERT_TRUE(eigen(filter.gain()).allFinite());
      if (!outcome) {
        ++refusals;
        EXPECT_EQ(refusal(outcome),
                  "measurement_variance: is too small, or sample_time changed too much, to carry "
                  "over the present covariance: measure first");
        EXPECT_EQ(filter.covariance(), before.covariance());
        EXPECT_EQ(filter.gain(), before.gain());
        continue;
      }
      ++taken;
      for (int k = 0; k < 300; ++k) {
        filter.update(S(0.25), S(0));
        ASSERT_TRUE(eigen(filter.covariance()).allFinite()) << k;
        ASSERT_TRUE(eigen(filter.gain()).allFinite()) << k;
      }
      EXPECT_EQ(filter.missed(), 0);
    }
  }
  EXPECT_GT(refusals, 0);
  EXPECT_GT(taken, 10);
}

/// Each state counts: here the variance of y alone is beyond the scalar in the unit of the new R,
/// the others are known exactly.
TEST(FilterVariance, OneThatCannotBeCarriedOverIsEnough) {
  using Filter = esokit::ExtendedStateFilter<2>;
  Filter::Config config{
      .input_gain = 1, .sample_time = 1e-3, .measurement_variance = 1, .inflation = 0.1};
  config.initial_covariance(0, 0) = 1e10;
  config.allow_vanishing_gain = true;
  for (const double variance : {1e-270, 1e-280}) {
    auto filter = Filter::make(config).value();
    auto other = config;
    other.measurement_variance = variance;
    other.initial_covariance = Filter::Covariance::Zero();
    EXPECT_EQ(refusal(filter.retune(other)),
              variance > 1e-275 ? "accepted"
                                : "measurement_variance: is too small, or sample_time changed too "
                                  "much, to carry over the present covariance: measure first");
  }
}

TEST(FilterVariance, RetuneToAnyIsFiniteOrRefused) {
  retune_to_any_variance_is_finite_or_refused<float>();
  retune_to_any_variance_is_finite_or_refused<double>();
}

// ---- sample times

/// The quick test of an update knows the square of a state, not what 1/T makes of it: where that
/// could overflow it may not be relied upon.
template <class Observer>
void is_finite_at_any_rate() {
  int taken = 0;
  int refused = 0;
  for (int rate = 0; rate <= 150; rate += 5) {
    typename Observer::Config config{};
    config.sample_time = std::pow(10.0, -rate);
    config.observer_bandwidth = 0.5 / config.sample_time;
    config.input_gain = 1;
    if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = 2;
    const auto made = Observer::make(config);
    if (!made) continue;
    for (int size = 0; size <= 300; size += 10) {
      auto observer = made.value();
      auto halves = observer;
      const double y = std::pow(10.0, size);
      const StepStatus status = observer.update(y, 0);
      for (int level = 0; level < Observer::levels; ++level) {
        ASSERT_TRUE(eigen(observer.level_estimate(level)).allFinite()) << rate << ", " << size;
      }
      const StepStatus predicted = halves.predict(0);
      EXPECT_EQ(status, predicted | halves.correct(y)) << rate << ", " << size;
      EXPECT_EQ(observer.estimate(), halves.estimate());
      ++(status == StepStatus::ok ? taken : refused);
    }
  }
  EXPECT_GT(taken, 100);
  EXPECT_GT(refused, 100);
}

TEST(Update, IsFiniteAtAnyRate) {
  is_finite_at_any_rate<LinearEso<2>>();
  is_finite_at_any_rate<CascadeEso<2, 3>>();
}

// Lanes of a pack at 1/T of 1e3 and 1e90, where squares tell nothing, fed what is near the largest
// number: each is the plain observer, and none is infinite.
TEST(Update, OfPacksIsFiniteAtAnyRate) {
  using Two = esokit::Pack<double, 2>;
  const double times[] = {1e-3, 1e-90};
  const auto plain = [&](int i) {
    return LinearEso<2>::make(
               {.observer_bandwidth = 0.1 / times[i], .input_gain = 2, .sample_time = times[i]})
        .value();
  };
  LinearEso<2> alone[] = {plain(0), plain(1)};
  esokit::Packed<LinearEso<2>, 2> both(plain);
  int refused = 0;
  double size = 1;
  for (int k = 0; k < 2000; ++k) {
    size = k % 200 == 0 ? 1 : size * 40;
    if (!(size < 1e307)) size = 1e-3;
    const double y = k % 2 == 0 ? size : -size;
    const auto status = both.update(Two(y), Two(0.0));
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(status[i], alone[i].update(y, 0));
      refused += status[i] == StepStatus::ok ? 0 : 1;
      for (int row = 0; row < 3; ++row) {
        ASSERT_TRUE(esokit::is_finite(both.estimate()(row)[i])) << k << ", " << i;
        EXPECT_EQ(both.estimate()(row)[i], alone[i].estimate()(row));
      }
    }
  }
  EXPECT_GT(refused, 20);
}

}  // namespace observer_absurd_numbers_test
}  // namespace esokit_test
