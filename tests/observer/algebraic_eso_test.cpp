// AlgebraicEso: exact at once, least squares, missing samples, hold, re-arming, retuning, refusals.
// The common laws are in algebraic_eso_laws_test.cpp, the gains in algebraic_gain_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/eigen.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <paper2_fsb_algebraic_eso/algebraic_filter.hpp>
#include <string>
#include <support/dual.hpp>
#include <support/gain_comparison.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <utility>
#include <vector>

namespace esokit_test {
namespace observer_algebraic_eso_test {

using esokit::AlgebraicEso;
using esokit::has;
using esokit::LinearEso;
using esokit::StepStatus;

/// y^(n) = d + b0 u with d a polynomial of degree m - 1 in time and u held over the samples, in
/// long double and physical units.
template <int Order, int Extension>
class SampledPlant {
 public:
  static constexpr int size = Order + Extension;

  SampledPlant(double sample_time, double input_gain)
      : time_(static_cast<long double>(sample_time)), gain_(static_cast<long double>(input_gain)) {}

  std::vector<long double> z = std::vector<long double>(size, 0.0L);

  void step(double u) {
    std::vector<long double> next(size, 0.0L);
    for (std::size_t i = 0; i < size; ++i) {
      long double power = 1;
      for (std::size_t j = i; j < size; ++j) {
        next[i] += z[j] * power;
        power *= time_ / static_cast<long double>(j - i + 1);
      }
      if (i >= Order) continue;
      long double gamma = gain_;
      for (std::size_t j = 1; j <= Order - i; ++j) gamma *= time_ / static_cast<long double>(j);
      next[i] += gamma * static_cast<long double>(u);
    }
    z = next;
  }

 private:
  long double time_;
  long double gain_;
};

constexpr double input_gain = 2.0;

/// lambda and q of the paper's servo drive.
template <int Order, class S = double, int Extension = 1>
typename AlgebraicEso<Order, S, Extension>::Config paper_config(double sample_time = 1e-3,
                                                                double lambda = 60,
                                                                double shift = 0.1) {
  return {.observer_bandwidth = static_cast<S>(lambda),
          .frequency_shift = static_cast<S>(shift),
          .input_gain = static_cast<S>(input_gain),
          .sample_time = static_cast<S>(sample_time)};
}

/// A motion with O(1) position, velocity and so on, and its largest relative error in the published
/// estimates from sample N - 1 on.
template <int Order, class S, int Extension>
struct ExactRun {
  static constexpr int size = Order + Extension;
  std::vector<double> at_first;  ///< relative error of each estimate at sample N - 1
  std::vector<double> later;     ///< the largest up to sample 60

  explicit ExactRun(const typename AlgebraicEso<Order, S, Extension>::Config& config)
      : at_first(size, 0.0), later(size, 0.0) {
    auto observer = AlgebraicEso<Order, S, Extension>::make(config).value();
    SampledPlant<Order, Extension> plant(static_cast<double>(config.sample_time), input_gain);
    for (std::size_t i = 0; i < size; ++i)
      plant.z[i] = (i % 2 == 0 ? 1.0L : -0.7L) * (i < Order ? 1 : 50);
    Random random(5);
    for (int k = 0; k < 60; ++k) {
      const S u = k == 0 ? S(0) : static_cast<S>(random.uniform(-1, 1));
      if (k > 0) plant.step(static_cast<double>(u));
      EXPECT_EQ(observer.update(static_cast<S>(plant.z[0]), u), StepStatus::ok);
      if (k < size - 1) continue;
      for (std::size_t i = 0; i < size; ++i) {
        const auto truth = static_cast<double>(plant.z[i]);
        const auto shown = static_cast<double>(observer.estimate()(static_cast<int>(i)));
        const double error = std::abs(shown - truth) / std::max(std::abs(truth), 1.0);
        if (k == size - 1) at_first[i] = error;
        later[i] = std::max(later[i], error);
      }
    }
  }
};

/// Rounding of y (and of the N predictions that carry it), differenced up to N - 1 times: r! / T^r
/// of 2^N or so. The disturbance, about 50, is what its error is compared with.
template <int Order, class S, int Extension>
void exact_from_the_nth_sample(double sample_time, double limit) {
  SCOPED_TRACE(::testing::Message() << Order << ", " << Extension << ", T " << sample_time);
  constexpr int size = Order + Extension;
  const ExactRun<Order, S, Extension> run(paper_config<Order, S, Extension>(sample_time));
  for (int i = 0; i < size; ++i) {
    const auto r = static_cast<std::size_t>(i);
    const double difference = std::ldexp(factorial_of(i), 2 * size) / std::pow(sample_time, i) *
                              static_cast<double>(std::numeric_limits<S>::epsilon());
    EXPECT_LE(run.at_first[r], std::max(difference, 1e-15)) << i;
    EXPECT_LE(run.at_first[r], limit) << i;
    // Rounding averages out from there on.
    EXPECT_LE(run.later[r], 2 * std::max(difference, 1e-15)) << i;
  }
}

TEST(AlgebraicEso, ExactFromTheNthSampleInDouble) {
  // The sheet's levels: 1e-10 for (2, 1), 7e-8 for (2, 2), at T = 1 ms.
  exact_from_the_nth_sample<2, double, 1>(1e-3, 1e-8);
  exact_from_the_nth_sample<1, double, 2>(1e-3, 1e-8);
  exact_from_the_nth_sample<2, double, 2>(1e-3, 7e-7);
  exact_from_the_nth_sample<1, double, 1>(1e-3, 1e-11);
  exact_from_the_nth_sample<3, double, 1>(1e-3, 1e-6);
  exact_from_the_nth_sample<2, double, 1>(0.1, 1e-12);
  exact_from_the_nth_sample<4, double, 3>(0.5, 1e-8);
}

/// The sheet: in float, T = 1 ms, the error of (2, 1) is about 1e-3 at 20 ms and 7e-5 at 100 ms.
TEST(AlgebraicEso, FloatGainsDigitsAsItAverages) {
  auto observer = AlgebraicEso<2, float>::make(paper_config<2, float>()).value();
  SampledPlant<2, 1> plant(static_cast<double>(1e-3f), input_gain);
  plant.z = {1.0L, -0.7L, 50.0L};
  for (int k = 0; k <= 100; ++k) {
    if (k > 0) plant.step(0.5);
    observer.update(static_cast<float>(plant.z[0]), 0.5f);
    const double error = std::abs(static_cast<double>(observer.total_disturbance()) / 50 - 1);
    if (k == 20) {
      EXPECT_LE(error, 3e-3);
    }
    if (k == 100) {
      EXPECT_LE(error, 2e-4);
    }
  }
}

/// Whatever the observer starts from.
TEST(AlgebraicEso, InitialStateDoesNotMatter) {
  auto observer = AlgebraicEso<2>::make(paper_config<2>()).value();
  observer.reset(esokit::EigenMatrix<double, 3>(3.0, -8.0, 200.0));
  SampledPlant<2, 1> plant(1e-3, input_gain);
  plant.z = {1.0L, -0.7L, 50.0L};
  for (int k = 0; k < 3; ++k) {
    if (k > 0) plant.step(0.0);
    EXPECT_TRUE(observer.blanked());
    EXPECT_EQ(observer.estimate()(2), 200.0);
    observer.update(static_cast<double>(plant.z[0]), 0.0);
  }
  EXPECT_FALSE(observer.blanked());
  EXPECT_NEAR(observer.estimate()(0), static_cast<double>(plant.z[0]), 1e-14);
  EXPECT_NEAR(observer.estimate()(1), static_cast<double>(plant.z[1]), 1e-10);
  EXPECT_NEAR(observer.estimate()(2), 50.0, 5e-7);
}

/// No bias on disturbances of degree < m, from sample N - 1 to the settled observer; one of degree
/// m is followed with the lag of the linear ESO.
template <int Order, int Extension>
void unbiased_at_once_and_linear_in_the_end() {
  SCOPED_TRACE(::testing::Message() << Order << ", " << Extension);
  constexpr int size = Order + Extension;
  constexpr double sample_time = 0.1;
  constexpr double lambda = 2;
  using Observer = AlgebraicEso<Order, double, Extension>;
  const typename Observer::Config config{.observer_bandwidth = lambda,
                                         .frequency_shift = 3,
                                         .input_gain = input_gain,
                                         .sample_time = sample_time};
  auto observer = Observer::make(config).value();
  auto linear =
      LinearEso<Order, double, Extension>::make(
          {.observer_bandwidth = lambda, .input_gain = input_gain, .sample_time = sample_time})
          .value();
  SampledPlant<Order, Extension> plant(sample_time, input_gain);
  for (std::size_t i = 0; i < size; ++i) plant.z[i] = i % 2 == 0 ? 1.0L : -0.7L;
  Random random(17);
  for (int k = 0; k < 40; ++k) {
    const double u = random.uniform(-1, 1);
    plant.step(u);
    observer.update(static_cast<double>(plant.z[0]), u);
    linear.update(static_cast<double>(plant.z[0]), u);
    if (k < size - 1) continue;
    for (int i = 0; i < size; ++i) {
      const auto truth = static_cast<double>(plant.z[static_cast<std::size_t>(i)]);
      double scale = 0;
      for (const long double z : plant.z) scale = std::max(scale, std::abs(static_cast<double>(z)));
      const double rounding =
          std::ldexp(factorial_of(i), 2 * size) / std::pow(sample_time, i) * 2.3e-16 * scale;
      ASSERT_NEAR(observer.estimate()(i), truth, rounding) << "sample " << k << ", row " << i;
    }
  }
  // Now two observers from different states, on arbitrary data: they come together, and once the
  // schedule has settled they share their gains.
  linear.reset(typename Observer::Estimate(Observer::Estimate::Zero()));
  int k = 0;
  while (!observer.settled()) {
    ASSERT_LT(++k, 10'000);
    observer.update(std::sin(0.3 * k), 0.0);
    linear.update(std::sin(0.3 * k), 0.0);
  }
  ASSERT_EQ(linear.reset(observer.estimate()), StepStatus::ok);
  observer.reset(observer.estimate());
  while (!observer.settled()) {
    ++k;
    observer.update(std::sin(0.3 * k), 0.0);
  }
  linear.reset(observer.estimate());
  const auto same = [&](double tolerance) {
    for (int i = 0; i < size; ++i) {
      const double a = observer.estimate()(i);
      ASSERT_NEAR(a, linear.estimate()(i), tolerance * std::pow(1 / sample_time, i)) << i;
    }
  };
  // The estimate in physical units and back again rounds once.
  for (int j = 0; j < 50; ++j) {
    ++k;
    observer.update(std::sin(0.3 * k), 0.4);
    linear.update(std::sin(0.3 * k), 0.4);
    same(1e-12);
  }
  // Gaps too.
  for (int j = 0; j < 5; ++j) {
    observer.predict(0.4);
    linear.predict(0.4);
  }
  EXPECT_EQ(observer.update(0.7, 0.1), linear.update(0.7, 0.1));
  same(1e-12);
}

TEST(AlgebraicEso, UnbiasedAtOnceAndLinearInTheEnd) {
  unbiased_at_once_and_linear_in_the_end<1, 1>();
  unbiased_at_once_and_linear_in_the_end<2, 1>();
  unbiased_at_once_and_linear_in_the_end<3, 1>();
  unbiased_at_once_and_linear_in_the_end<1, 2>();
  unbiased_at_once_and_linear_in_the_end<2, 2>();
  unbiased_at_once_and_linear_in_the_end<3, 2>();
  unbiased_at_once_and_linear_in_the_end<4, 3>();
}

/// lambda = q = 0 on noise: the states are those of the least-squares fit to all data since the
/// start, once the effect of the input is taken out.
template <int Order, int Extension>
void is_least_squares(double tolerance) {
  SCOPED_TRACE(::testing::Message() << Order << ", " << Extension);
  constexpr int size = Order + Extension;
  constexpr double sample_time = 0.5;
  auto observer = AlgebraicEso<Order, double, Extension>::make({.observer_bandwidth = 0,
                                                                .frequency_shift = 0,
                                                                .input_gain = input_gain,
                                                                .sample_time = sample_time})
                      .value();
  std::vector<double> measurements;
  std::vector<double> inputs;
  Random random(23);
  for (int k = 0; k < 200; ++k) {
    inputs.push_back(random.uniform(-1, 1));
    measurements.push_back(random.uniform(-1, 1));
    observer.update(measurements.back(), inputs.back());
    if (k != size - 1 && k != size && k != 20 && k != 199) continue;
    const auto fit =
        least_squares_states(measurements, inputs, Order, Extension, input_gain, sample_time);
    for (int r = 0; r < size; ++r) {
      const double expected = fit[static_cast<std::size_t>(r)];
      EXPECT_NEAR(observer.estimate()(r), expected, tolerance * std::max(1.0, std::abs(expected)))
          << "sample " << k << ", row " << r;
    }
  }
}

TEST(AlgebraicEso, WithoutBandwidthAndShiftItIsLeastSquares) {
  is_least_squares<1, 1>(1e-9);
  is_least_squares<2, 1>(1e-9);
  is_least_squares<1, 2>(1e-9);
  is_least_squares<2, 2>(1e-9);
  is_least_squares<3, 1>(1e-9);
}

// ---- missing samples

/// One lost among the first N: the schedule starts again there, and N samples later the estimate is
/// exact.
template <int Order, int Extension>
void lost_among_the_first(int lost, bool bad_value) {
  SCOPED_TRACE(::testing::Message() << Order << ", " << Extension << ", lost " << lost);
  constexpr int size = Order + Extension;
  constexpr double sample_time = 0.1;
  auto observer = AlgebraicEso<Order, double, Extension>::make(
                      paper_config<Order, double, Extension>(sample_time, 3, 0.2))
                      .value();
  SampledPlant<Order, Extension> plant(sample_time, input_gain);
  for (std::size_t i = 0; i < size; ++i) plant.z[i] = i % 2 == 0 ? 1.0L : -0.7L;
  Random random(29);
  for (int k = 0; k < 3 * size; ++k) {
    const double u = k == 0 ? 0.0 : random.uniform(-1, 1);
    if (k > 0) plant.step(u);
    const auto y = static_cast<double>(plant.z[0]);
    StepStatus status = StepStatus::ok;
    if (k == lost) {
      status = bad_value ? observer.update(hidden_nan<double>(), u) : observer.predict(u);
      EXPECT_EQ(status, bad_value ? StepStatus::measurement_rejected : StepStatus::ok);
    } else {
      status = observer.update(y, u);
      EXPECT_EQ(status, k == lost + 1 ? StepStatus::gap_bridged : StepStatus::ok);
    }
    if (k == lost + 1) {
      EXPECT_EQ(observer.age(), 1u);
    }
    if (k > lost && k < lost + size) {
      EXPECT_TRUE(observer.blanked()) << k;
    }
    if (k < lost + size) continue;
    EXPECT_FALSE(observer.blanked()) << k;
    for (int i = 0; i < size; ++i) {
      const auto truth = static_cast<double>(plant.z[static_cast<std::size_t>(i)]);
      const double rounding =
          std::ldexp(factorial_of(i), 2 * size) / std::pow(sample_time, i) * 2.3e-16 * 10;
      EXPECT_NEAR(observer.estimate()(i), truth, rounding) << "sample " << k << ", row " << i;
    }
  }
}

TEST(AlgebraicEso, LostAmongTheFirstSamplesStartsAnew) {
  for (int lost = 0; lost < 3; ++lost) {
    lost_among_the_first<2, 1>(lost, false);
    lost_among_the_first<2, 1>(lost, true);
  }
  for (int lost = 0; lost < 5; ++lost) lost_among_the_first<3, 2>(lost, lost % 2 == 0);
  lost_among_the_first<1, 1>(1, false);
}

TEST(AlgebraicEso, LostLaterIsBridgedAndStaysExact) {
  constexpr double sample_time = 0.1;
  auto observer = AlgebraicEso<2>::make(paper_config<2>(sample_time, 3, 0.2)).value();
  SampledPlant<2, 1> plant(sample_time, input_gain);
  plant.z = {1.0L, -0.7L, 0.4L};
  for (int k = 0; k < 60; ++k) {
    if (k > 0) plant.step(0.3);
    if (k > 2 && k % 4 == 3) {
      observer.predict(0.3);
    } else {
      observer.update(static_cast<double>(plant.z[0]), 0.3);
    }
    if (k < 2) continue;
    EXPECT_EQ(observer.age(), static_cast<std::uint32_t>(k + 1));
    for (int i = 0; i < 3; ++i) {
      const auto truth = static_cast<double>(plant.z[static_cast<std::size_t>(i)]);
      ASSERT_NEAR(observer.estimate()(i), truth, 1e-11 * (1 + std::abs(truth))) << k;
    }
  }
}

/// One measurement in M for ever, from the start: the schedule never gets going, but the estimate
/// is that of deadbeat correction over M samples and does not diverge.
TEST(AlgebraicEso, RecurringGapsFromTheStartDoNotDiverge) {
  for (const int every : {2, 3, 7}) {
    auto observer = AlgebraicEso<2>::make(paper_config<2>(0.1, 3, 0.2)).value();
    SampledPlant<2, 1> plant(0.1, input_gain);
    plant.z = {1.0L, -0.7L, 0.4L};
    for (int k = 0; k < 40 * every; ++k) {
      if (k > 0) plant.step(0.3);
      if (k % every != 0) {
        observer.predict(0.3);
        continue;
      }
      observer.update(static_cast<double>(plant.z[0]), 0.3);
      if (k < 3 * every) continue;
      const auto raw = observer.raw_estimate();
      for (int i = 0; i < 3; ++i) {
        const auto truth = static_cast<double>(plant.z[static_cast<std::size_t>(i)]);
        ASSERT_NEAR(raw(i), truth, 1e-9 * (1 + std::abs(truth))) << every << ", " << k;
      }
    }
  }
}

/// After more than max_gap the observer starts from the measurement; what it published in an
/// earlier life is not held again.
TEST(AlgebraicEso, LongGapRestartsTheHoldWithTheMeasurement) {
  auto config = paper_config<2>();
  config.blanking = 0.01;
  config.max_gap = 5;
  for (const bool two_phase : {false, true}) {
    auto observer = AlgebraicEso<2>::make(config).value();
    observer.reset(esokit::EigenMatrix<double, 3>(7, 8, 9));
    for (int k = 0; k < 100; ++k) observer.update(1.0, 0.0);
    for (int k = 0; k < 6; ++k) observer.predict(0.0);
    if (two_phase) {
      observer.predict(0.0);
      EXPECT_EQ(observer.correct(2.5), StepStatus::restarted);
    } else {
      EXPECT_EQ(observer.update(2.5, 0.0), StepStatus::restarted);
    }
    EXPECT_TRUE(observer.blanked());
    EXPECT_EQ(observer.age(), 0u);
    for (int k = 0; k < 10; ++k) {
      EXPECT_EQ(observer.estimate()(0), 2.5);
      EXPECT_EQ(observer.estimate()(1), 0.0);
      EXPECT_EQ(observer.template estimate<2>(), 0.0);
      observer.update(2.6, 0.0);
    }
    EXPECT_TRUE(observer.blanked());
    observer.update(2.6, 0.0);
    EXPECT_FALSE(observer.blanked());
  }
}

// ---- hold

TEST(AlgebraicEso, PublishesAfterTheHold) {
  auto config = paper_config<2>();
  config.blanking = 0.02;  // at t = k T >= 0.02, k = 20
  auto observer = AlgebraicEso<2>::make(config).value();
  EXPECT_NEAR(observer.blanking(), 0.02, 1e-15);
  for (int k = 0; k < 40; ++k) {
    observer.update(0.5 + 1e-3 * k, 0.0);
    if (k < 20) {
      EXPECT_TRUE(observer.blanked());
      for (int i = 0; i < 3; ++i) EXPECT_EQ(observer.estimate()(i), 0.0);
      EXPECT_EQ(observer.estimate<0>(), 0.0);
      EXPECT_EQ(observer.total_disturbance(), 0.0);
      if (k >= 2) {
        EXPECT_NEAR(observer.raw_estimate()(0), 0.5 + 1e-3 * k, 1e-12);
      }
    } else {
      EXPECT_FALSE(observer.blanked());
      EXPECT_NEAR(observer.estimate()(1), 1.0, 1e-9);
      EXPECT_EQ(observer.estimate<1>(), observer.raw_estimate()(1));
    }
  }
}

TEST(AlgebraicEso, HoldDefaults) {
  // N - 1 samples: published from the first sample on that can be exact.
  EXPECT_NEAR(AlgebraicEso<2>::make(paper_config<2>()).value().blanking(), 2e-3, 1e-15);
  auto config = paper_config<2>();
  config.blanking = 0;
  EXPECT_EQ(AlgebraicEso<2>::make(config).value().blanking(), 0.0);
  // From the noise: t^5 = 720 sigma^2 T / tolerated^2. sigma = 1e-3, tolerated 1: 0.0593 s.
  config = paper_config<2>();
  config.measurement_noise = 1e-3;
  config.disturbance_noise = 1.0;
  const double seconds = std::pow(720 * 1e-6 * 1e-3, 0.2);
  EXPECT_NEAR(AlgebraicEso<2>::make(config).value().blanking(), std::ceil(seconds * 1e3) * 1e-3,
              1e-12);
  // Never before it can be exact, and without overflow in float.
  config.measurement_noise = 1e-15;
  EXPECT_NEAR(AlgebraicEso<2>::make(config).value().blanking(), 2e-3, 1e-15);
  auto large = paper_config<4, float, 3>(1e-4);
  large.measurement_noise = 1e-3f;
  large.disturbance_noise = 1.0f;
  // (13! 12! / (6!)^2 sigma^2 T / tolerated^2)^(1/13)
  const double factor = factorial_of(13) * factorial_of(12) / (factorial_of(6) * factorial_of(6));
  const double long_hold = std::pow(factor * 1e-6 * 1e-4, 1.0 / 13);
  EXPECT_NEAR(static_cast<double>(AlgebraicEso<4, float, 3>::make(large).value().blanking()),
              long_hold, 2e-4);
}

/// What the default promises: after it the standard deviation of the highest estimate is about the
/// one that was tolerated.
TEST(AlgebraicEso, HoldKeepsTheNoiseLevel) {
  auto config = paper_config<2>(1e-3, 1, 0.01);
  config.measurement_noise = 1e-3;
  config.disturbance_noise = 0.5;
  const auto fresh = AlgebraicEso<2>::make(config).value();
  Random random(31);
  double squares = 0;
  constexpr int runs = 2000;
  for (int run = 0; run < runs; ++run) {
    auto observer = fresh;
    while (observer.blanked()) {
      // Uniform with the standard deviation sigma.
      observer.update(random.uniform(-1, 1) * 1e-3 * std::sqrt(3.0), 0.0);
    }
    squares += observer.total_disturbance() * observer.total_disturbance();
  }
  // The formula is that of lambda = q = 0 and many samples; 2000 runs give 2 %.
  EXPECT_NEAR(std::sqrt(squares / runs) / 0.5, 1.0, 0.15);
}

/// A hold that is longer than the schedule takes to settle ends all the same.
TEST(AlgebraicEso, HoldEndsThoughTheScheduleSettlesFirst) {
  auto config = paper_config<2>(1e-3, 60, 500);
  config.blanking = 0.3;
  auto observer = AlgebraicEso<2>::make(config).value();
  for (int k = 0; k < 300; ++k) {
    observer.update(1.0, 0.0);
    ASSERT_TRUE(observer.blanked()) << k;
  }
  observer.update(1.0, 0.0);
  EXPECT_FALSE(observer.blanked());
  EXPECT_TRUE(observer.settled());
}

TEST(AlgebraicEso, RearmBeginsAnewAndHoldsWhatWasPublished) {
  constexpr double sample_time = 0.01;
  auto observer = AlgebraicEso<2>::make(paper_config<2>(sample_time, 2, 40)).value();
  SampledPlant<2, 1> plant(sample_time, input_gain);
  plant.z = {1.0L, 0.5L, 3.0L};
  const auto run = [&](int samples) {
    for (int k = 0; k < samples; ++k) {
      plant.step(0.0);
      observer.update(static_cast<double>(plant.z[0]), 0.0);
    }
  };
  run(400);
  ASSERT_TRUE(observer.settled());
  EXPECT_NEAR(observer.total_disturbance(), 3.0, 1e-8);
  auto stays = observer;
  plant.z[2] = -20.0L;
  const auto held = observer.estimate();
  observer.rearm();
  EXPECT_TRUE(observer.blanked());
  EXPECT_FALSE(observer.settled());
  EXPECT_EQ(observer.age(), 0u);
  auto twin = plant;
  run(2);
  EXPECT_TRUE(observer.blanked());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(observer.estimate()(i), held(i));
  run(1);
  EXPECT_FALSE(observer.blanked());
  EXPECT_NEAR(observer.total_disturbance(), -20.0, 1e-7);
  EXPECT_NEAR(observer.estimate()(1), static_cast<double>(plant.z[1]), 1e-9);
  // Without it the linear ESO is still far away.
  for (int k = 0; k < 3; ++k) {
    twin.step(0.0);
    stays.update(static_cast<double>(twin.z[0]), 0.0);
  }
  EXPECT_GT(stays.total_disturbance(), 2.0);
}

TEST(AlgebraicEso, ResetHoldsTheGivenState) {
  auto config = paper_config<2>();
  config.blanking = 0.005;
  auto observer = AlgebraicEso<2>::make(config).value();
  for (int k = 0; k < 50; ++k) observer.update(1.0, 0.0);
  EXPECT_EQ(observer.reset(4.0), StepStatus::ok);
  EXPECT_EQ(observer.estimate()(0), 4.0);
  EXPECT_EQ(observer.age(), 0u);
  observer.update(4.5, 0.0);
  EXPECT_EQ(observer.estimate()(0), 4.0);
  // A refused one holds nothing new.
  for (int k = 0; k < 50; ++k) observer.update(1.0, 0.0);
  const auto before = observer.estimate();
  EXPECT_EQ(observer.reset(hidden_nan<double>()), StepStatus::state_rejected);
  EXPECT_FALSE(observer.blanked());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(observer.estimate()(i), before(i));
}

// ---- retuning

TEST(AlgebraicEso, RetuneKeepsThePlaceInTheSchedule) {
  auto observer = AlgebraicEso<2>::make(paper_config<2>(1e-3, 60, 0.1)).value();
  for (int k = 0; k < 200; ++k) observer.update(std::sin(0.01 * k), 0.0);
  const auto before = observer.estimate();
  ASSERT_TRUE(observer.retune(paper_config<2>(1e-3, 20, 5)).has_value());
  EXPECT_EQ(observer.age(), 200u);
  EXPECT_FALSE(observer.blanked());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(observer.estimate()(i), before(i));
  // The gain is that of the new settings, 200 samples on.
  auto other = AlgebraicEso<2>::make(paper_config<2>(1e-3, 20, 5)).value();
  for (int k = 0; k < 200; ++k) other.update(0.0, 0.0);
  other.reset(esokit::EigenMatrix<double, 3>(0, 0, 0));
  auto young = other;  // age 0
  young.update(1.0, 0.0);
  const double e_before = observer.raw_estimate()(2);
  auto twin = observer;
  observer.predict(0.0);
  const double predicted = observer.raw_estimate()(2);
  EXPECT_EQ(e_before, predicted);
  observer.correct(1.0);
  const auto gain = reference_algebraic_gain(3, 20 * 1e-3, 5 * 1e-3, 200);
  const double k2 = (observer.raw_estimate()(2) - predicted) / observer.innovation();
  EXPECT_NEAR(k2 / (gain[2] * 2e6), 1.0, 1e-9);
  EXPECT_EQ(twin.age(), 200u);
}

TEST(AlgebraicEso, RetuneOfASettledOneStaysSettled) {
  auto observer = AlgebraicEso<2>::make(paper_config<2>(1e-3, 60, 100)).value();
  for (int k = 0; k < 1000; ++k) observer.update(std::sin(0.01 * k), 0.0);
  ASSERT_TRUE(observer.settled());
  auto config = paper_config<2>(1e-3, 30, 0.1);
  config.blanking = 0.5;  // longer than its count of samples ever was
  ASSERT_TRUE(observer.retune(config).has_value());
  EXPECT_FALSE(observer.blanked());
  auto linear =
      LinearEso<2>::make({.observer_bandwidth = 30, .input_gain = input_gain, .sample_time = 1e-3})
          .value();
  linear.reset(observer.estimate());
  for (int k = 0; k < 100; ++k) {
    observer.update(std::sin(0.01 * k), 0.3);
    linear.update(std::sin(0.01 * k), 0.3);
    EXPECT_TRUE(observer.settled());
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(observer.estimate()(i), linear.estimate()(i), 1e-12 * std::pow(1e3, i));
    }
  }
}

/// u must not jump, so what is held moves with b0 too.
TEST(AlgebraicEso, RetuneRebalancesHeldEstimates) {
  auto config = paper_config<2>();
  config.blanking = 0.02;
  auto observer = AlgebraicEso<2>::make(config).value();
  observer.reset(esokit::EigenMatrix<double, 3>(1, 2, 3));
  observer.update(1.0, 0.7);
  config.input_gain = 5;
  ASSERT_TRUE(observer.retune(config).has_value());
  EXPECT_TRUE(observer.blanked());
  EXPECT_NEAR(observer.total_disturbance(), 3 + (input_gain - 5) * 0.7, 1e-12);
  EXPECT_EQ(observer.estimate()(1), 2.0);
  for (int k = 1; k < 20; ++k) observer.update(1.0, 0.7);
  EXPECT_TRUE(observer.blanked());
  observer.update(1.0, 0.7);
  EXPECT_FALSE(observer.blanked());
}

/// A longer hold than before holds what is published now, not the start of long ago.
TEST(AlgebraicEso, RetuneToALongerHoldDoesNotJump) {
  auto config = paper_config<2>();
  config.blanking = 0.005;
  auto observer = AlgebraicEso<2>::make(config).value();
  for (int k = 0; k < 50; ++k) observer.update(1.0 + 0.1 * k, 0.0);
  const auto before = observer.estimate();
  config.blanking = 0.06;
  ASSERT_TRUE(observer.retune(config).has_value());
  EXPECT_TRUE(observer.blanked());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(observer.estimate()(i), before(i));
  for (int k = 0; k < 11; ++k) observer.update(6.0 + 0.1 * k, 0.0);
  EXPECT_FALSE(observer.blanked());
}

// ---- refusals

TEST(AlgebraicEso, RefusesBadConfigByName) {
  using Config = AlgebraicEso<2>::Config;
  const double nan = hidden_nan<double>();
  const double infinity = hidden_infinity<double>();
  const auto changed = [](auto change) {
    Config config = paper_config<2>();
    change(config);
    return config;
  };
  struct Bad {
    Config config;
    const char* refusal;
    double value;
  };
  const Bad bad[] = {
      {changed([](Config& c) { c.observer_bandwidth = -1; }),
       "observer_bandwidth: must be finite and not negative", -1},
      {changed([&](Config& c) { c.observer_bandwidth = nan; }),
       "observer_bandwidth: must be finite and not negative", nan},
      {changed([&](Config& c) { c.observer_bandwidth = infinity; }),
       "observer_bandwidth: must be finite and not negative", infinity},
      {changed([](Config& c) { c.observer_bandwidth = 0; }),
       "observer_bandwidth: must be above zero if frequency_shift is: the gains vanish (or set "
       "allow_vanishing_gain)",
       0},
      {changed([](Config& c) { c.observer_bandwidth = 1e-110; }),
       "observer_bandwidth: times sample_time gives a gain that the scalar cannot hold", 1e-110},
      {changed([](Config& c) { c.frequency_shift = -0.1; }),
       "frequency_shift: must be finite and not negative", -0.1},
      {changed([&](Config& c) { c.frequency_shift = nan; }),
       "frequency_shift: must be finite and not negative", nan},
      {changed([&](Config& c) { c.frequency_shift = infinity; }),
       "frequency_shift: must be finite and not negative", infinity},
      {changed([](Config& c) { c.input_gain = 0; }),
       "input_gain: must be finite and not zero (negative is fine)", 0},
      {changed([&](Config& c) { c.input_gain = nan; }),
       "input_gain: must be finite and not zero (negative is fine)", nan},
      {changed([](Config& c) { c.sample_time = 0; }), "sample_time: must be finite and positive",
       0},
      {changed([](Config& c) { c.sample_time = -1e-3; }),
       "sample_time: must be finite and positive", -1e-3},
      {changed([&](Config& c) { c.sample_time = infinity; }),
       "sample_time: must be finite and positive", infinity},
      {changed([](Config& c) { c.blanking = -0.1; }), "blanking: must be finite and not negative",
       -0.1},
      {changed([&](Config& c) { c.blanking = nan; }), "blanking: must be finite and not negative",
       nan},
      {changed([](Config& c) { c.blanking = 2000.0; }),
       "blanking: gives a blanking of more than 1e6 samples", 2000},
      {changed([](Config& c) { c.measurement_noise = -1; }),
       "measurement_noise: must be finite and not negative", -1},
      {changed([&](Config& c) { c.measurement_noise = nan; }),
       "measurement_noise: must be finite and not negative", nan},
      {changed([](Config& c) { c.disturbance_noise = -1; }),
       "disturbance_noise: must be finite and not negative", -1},
      {changed([](Config& c) { c.measurement_noise = 1; }),
       "disturbance_noise: must be given together with the other noise level", 0},
      {changed([](Config& c) { c.disturbance_noise = 1; }),
       "measurement_noise: must be given together with the other noise level", 0},
      {changed([](Config& c) {
         c.measurement_noise = 1e9;
         c.disturbance_noise = 1e-9;
       }),
       "measurement_noise: gives a blanking of more than 1e6 samples", 1e9},
      {changed([](Config& c) { c.start_index = -1; }), "start_index: must be 0 .. 1000000", -1},
      {changed([](Config& c) { c.start_index = 1000001; }), "start_index: must be 0 .. 1000000",
       1000001},
      {changed([](Config& c) { c.max_gap = 0; }), "max_gap: must be 1 .. 65000", 0},
      {changed([](Config& c) { c.max_gap = 65535; }), "max_gap: must be 1 .. 65000", 65535},
  };
  for (const Bad& b : bad) {
    const auto made = AlgebraicEso<2>::make(b.config);
    ASSERT_EQ(refusal(made), b.refusal) << b.value;
    if (b.value == b.value) {
      EXPECT_EQ(made.error().value, b.value) << b.refusal;
    }
  }
  // What is asked for by name is given: a gain that vanishes, and growing memory.
  Config vanishing = paper_config<2>(1e-3, 0, 1);
  EXPECT_EQ(refusal(AlgebraicEso<2>::make(vanishing)),
            "observer_bandwidth: must be above zero if frequency_shift is: the gains vanish (or "
            "set allow_vanishing_gain)");
  vanishing.allow_vanishing_gain = true;
  EXPECT_TRUE(AlgebraicEso<2>::make(vanishing).has_value());
  EXPECT_TRUE(AlgebraicEso<2>::make(paper_config<2>(1e-3, 0, 0)).has_value());
  EXPECT_TRUE(AlgebraicEso<2>::make(paper_config<2>(1e-3, 60, 0)).has_value());
  // Gains that float cannot hold.
  EXPECT_EQ(refusal(AlgebraicEso<4, float, 3>::make(paper_config<4, float, 3>(1e-6, 1, 1))),
            "observer_bandwidth: times sample_time gives a gain that the scalar cannot hold");
}

// ---- soft start, scalars, long runs

/// Begun at sample k0 of the schedule it is not deadbeat, and it moves less: the noise of the
/// first correction is that of sample k0.
TEST(AlgebraicEso, SoftStartIsGentler) {
  auto config = paper_config<2>(1e-3, 5, 0.1);
  config.blanking = 0;
  auto hard = AlgebraicEso<2>::make(config).value();
  config.start_index = 50;
  auto soft = AlgebraicEso<2>::make(config).value();
  hard.update(1.0, 0.0);
  soft.update(1.0, 0.0);
  EXPECT_NEAR(hard.total_disturbance(), 1e6, 1e-3);
  const auto gain = reference_algebraic_gain(3, 5e-3, 1e-4, 50);
  EXPECT_NEAR(soft.total_disturbance() / (gain[2] * 2e6), 1.0, 1e-9);
  EXPECT_LT(soft.total_disturbance(), 1e3);
  EXPECT_EQ(soft.age(), 1u);
  // It does not restart for a lost sample.
  soft.predict(0.0);
  soft.update(1.0, 0.0);
  EXPECT_EQ(soft.age(), 3u);
}

/// N = 3, 5 and 7 in float, 200 s at 1 kHz with noise: where the ratio-of-W gains diverge.
template <int Order, int Extension>
void float_is_stable() {
  SCOPED_TRACE(::testing::Message() << Order << ", " << Extension);
  constexpr int size = Order + Extension;
  const auto config = [](auto scalar) {
    using S = decltype(scalar);
    return paper_config<Order, S, Extension>(1e-3, 20, 0.1);
  };
  auto single = AlgebraicEso<Order, float, Extension>::make(config(0.0f)).value();
  auto reference = AlgebraicEso<Order, double, Extension>::make(config(0.0)).value();
  Random random(37);
  double worst_innovation = 0;
  double worst = 0;
  for (int k = 0; k < 200'000; ++k) {
    const auto y = static_cast<float>(std::sin(2e-3 * k) + 1e-3 * random.uniform(-1, 1));
    ASSERT_EQ(single.update(y, 0.1f), StepStatus::ok);
    reference.update(static_cast<double>(y), static_cast<double>(0.1f));
    if (k < 10 * size) continue;
    worst_innovation =
        std::max(worst_innovation, std::abs(static_cast<double>(single.innovation())));
    worst = std::max(worst,
                     std::abs(static_cast<double>(single.estimate()(0)) - reference.estimate()(0)));
  }
  EXPECT_LT(worst_innovation, 0.1);
  EXPECT_LT(worst, 1e-3);
}

TEST(AlgebraicEso, FloatIsStableThroughSevenStates) {
  float_is_stable<2, 1>();
  float_is_stable<3, 2>();
  float_is_stable<4, 3>();
}

/// d dhat / d lambda, against a difference.
TEST(AlgebraicEso, DerivativeBySettings) {
  const auto run = [](const auto& lambda) {
    using T = std::remove_cvref_t<decltype(lambda)>;
    auto observer = AlgebraicEso<2, T>::make({.observer_bandwidth = lambda,
                                              .frequency_shift = T(3.0),
                                              .input_gain = T(input_gain),
                                              .sample_time = T(0.01),
                                              .blanking = T(0.0)})
                        .value();
    for (int k = 0; k < 100; ++k) observer.update(T(std::sin(0.2 * k)), T(0.3));
    return observer.total_disturbance();
  };
  const Dual with = run(Dual(5.0, 1.0));
  const double difference = (run(5.0 + 1e-6) - run(5.0 - 1e-6)) / 2e-6;
  EXPECT_NEAR(with.value, run(5.0), 1e-9);
  EXPECT_NEAR(with.derivative / difference, 1.0, 1e-6);
}

/// Towards the filter form as T -> 0: y enters at the end of a sample, so the order is 1.
template <int Order, int Extension>
void tends_to_the_continuous_form() {
  SCOPED_TRACE(::testing::Message() << Order << ", " << Extension);
  constexpr int size = Order + Extension;
  constexpr double lambda = 3;
  constexpr double shift = 0.5;
  constexpr double end = 1.0;
  const auto output = [](double t) { return 0.4 + std::sin(1.3 * t); };
  const auto input = [](double t) { return t < 0.5 ? 1.0 : -0.4; };
  const auto filter =
      esokit::examples::AlgebraicFilter<Order, double, Extension>::make(
          {.observer_bandwidth = lambda, .frequency_shift = shift, .input_gain = input_gain})
          .value();
  using State = esokit::EigenMatrix<double, size>;
  State x = State::Zero();
  constexpr int fine = 4096;
  constexpr double h = end / fine;
  for (int k = 0; k < fine; ++k) {
    const double t = k * h;
    const double u = input(t);
    const auto rate = [&](double s, const State& state) -> State {
      return filter.derivative(s, state, output(s), u);
    };
    const State k1 = rate(t, x);
    const State k2 = rate(t + h / 2, x + h / 2 * k1);
    const State k3 = rate(t + h / 2, x + h / 2 * k2);
    const State k4 = rate(t + h, x + h * k3);
    x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }
  const State truth = filter.estimate(end, x);
  const auto deviation = [&](int samples) {
    const double sample_time = end / samples;
    auto observer = AlgebraicEso<Order, double, Extension>::make({.observer_bandwidth = lambda,
                                                                  .frequency_shift = shift,
                                                                  .input_gain = input_gain,
                                                                  .sample_time = sample_time})
                        .value();
    for (int k = 0; k <= samples; ++k) {
      observer.update(output(k * sample_time), k == 0 ? 0.0 : input((k - 0.5) * sample_time));
    }
    double worst = 0;
    for (int i = 0; i < size; ++i) {
      worst = std::max(worst, std::abs(observer.estimate()(i) - truth(i)) /
                                  (choose(size, i) * std::pow(lambda + size, i)));
    }
    return worst;
  };
  const double coarse = deviation(256);
  const double halved = deviation(512);
  EXPECT_LT(halved, 0.05);
  EXPECT_NEAR(std::log2(coarse / halved), 1.0, 0.1);
}

TEST(AlgebraicEso, TendsToTheContinuousFormWithOrderOne) {
  tends_to_the_continuous_form<2, 1>();
  tends_to_the_continuous_form<1, 1>();
  tends_to_the_continuous_form<2, 2>();
  tends_to_the_continuous_form<3, 1>();
}

/// From rest to a plant that stands at y = 1 under a constant disturbance, over the bandwidths.
TEST(AlgebraicEso, BoundedAndCorrectForEveryBandwidth) {
  for (const double bandwidth : {1e-4, 1e-2, 0.5, 3.0, 15.0, 50.0}) {
    for (const double shift : {0.0, 1e-4, 0.1, 5.0}) {
      auto observer = AlgebraicEso<2>::make({.observer_bandwidth = bandwidth,
                                             .frequency_shift = shift,
                                             .input_gain = input_gain,
                                             .sample_time = 1.0})
                          .value();
      for (int k = 0; k < 3000; ++k) {
        ASSERT_EQ(observer.update(1.0, -0.25), StepStatus::ok);
        if (k < 2) continue;
        // A constant rounding error of the input, integrated by the slowest observer.
        const double memory = std::min(3000.0, 1 / bandwidth + 1);
        ASSERT_NEAR(observer.estimate()(0), 1.0, 1e-15 * memory * memory) << k;
        ASSERT_NEAR(observer.estimate()(1), 0.0, 1e-15 * memory * memory) << k;
        ASSERT_NEAR(observer.total_disturbance(), 0.5, 1e-14 * memory) << k;
      }
    }
  }
}

/// Settled, and driven until the state cannot be predicted: the restart at y is published, and not
/// what was held at the start.
TEST(AlgebraicEso, PublishesTheRestartOfASettledObserver) {
  auto eso = AlgebraicEso<2>::make({.observer_bandwidth = 0.5,
                                    .frequency_shift = 500,
                                    .input_gain = 1,
                                    .sample_time = 0.01,
                                    .blanking = 0.05})
                 .value();
  for (int k = 0; k < 20000 && !eso.settled(); ++k) eso.update(0.25, 0);
  ASSERT_TRUE(eso.settled());
  StepStatus status = StepStatus::ok;
  for (int k = 0; k < 1000 && !has(status, StepStatus::restarted); ++k) {
    ASSERT_TRUE(eso.settled());
    status = eso.update(0.5, 1e308);
  }
  ASSERT_TRUE(has(status, StepStatus::restarted));
  EXPECT_EQ(eso.estimate()(0), 0.5);
}

}  // namespace observer_algebraic_eso_test
}  // namespace esokit_test
