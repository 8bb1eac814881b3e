// Seeded mass test over random configs and random data, good and bad.
#include <gtest/gtest.h>
#include <esokit/gain/pole_set.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/observer_traits.hpp>
#include <vector>

// The references compute in long double on purpose; the library above is still checked.
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace observer_random_config_test {

using esokit::CascadeEso;
using esokit::has;
using esokit::LinearEso;
using esokit::PoleSet;
using esokit::StepStatus;
using esokit_test::choose;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::nordsieck;
using esokit_test::ObserverTraits;
using esokit_test::Random;

/// A config of any omega_o T, sample time, sign of b0.
template <class Observer>
typename Observer::Config random_config(Random& random) {
  using Traits = ObserverTraits<Observer>;
  const double t = random.log_uniform(1e-4, 1);
  const double omega_t = random.log_uniform(1e-3, 50);
  const double b0 = random.log_uniform(1e-2, 1e2) * (random.index(2) == 0 ? 1 : -1);
  auto config = Traits::config(omega_t / t, t, b0, 1 + random.index(50));
  if constexpr (requires { config.poles; }) {
    using S = typename Observer::scalar_type;
    for (std::size_t i = 0; i < config.poles.size();) {
      const auto re = -static_cast<S>(random.log_uniform(0.1, 3) * omega_t / t);
      if (i + 1 < config.poles.size() && random.index(2) == 0) {
        // Well damped: with less, irregular gaps can diverge.
        const auto im = static_cast<S>(random.uniform(0, 1)) * -re;
        config.poles[i++] = {re, im};
        config.poles[i++] = {re, -im};
      } else {
        config.poles[i++] = re;
      }
    }
  }
  return config;
}

template <class Observer>
::testing::AssertionResult all_finite(const Observer& observer) {
  for (int level = 0; level < Observer::levels; ++level) {
    const auto z = observer.level_estimate(level);
    for (int r = 0; r < Observer::size; ++r) {
      if (!std::isfinite(z(r))) {
        return ::testing::AssertionFailure()
               << "level " << level << " estimate " << r << ": " << z(r);
      }
    }
  }
  if (!std::isfinite(observer.innovation()) || !std::isfinite(observer.applied_input())) {
    return ::testing::AssertionFailure() << "innovation or input";
  }
  return ::testing::AssertionSuccess();
}

template <class Observer>
class RandomConfig : public ::testing::Test {};
using Observers =
    ::testing::Types<LinearEso<1, float>, LinearEso<2>, LinearEso<3, float, 2>,
                     LinearEso<5, double, 2>, LinearEso<2, float, 1, PoleSet>,
                     LinearEso<3, double, 2, PoleSet>, CascadeEso<2, 3, float>, CascadeEso<3, 2>>;
TYPED_TEST_SUITE(RandomConfig, Observers);

/// Data that may come from a sensor in order: every status says what happened, and the estimate
/// stays of the size of the data.
TYPED_TEST(RandomConfig, ModerateDataWithBadSamples) {
  using S = typename TypeParam::scalar_type;
  constexpr int N = TypeParam::size;
  constexpr int n = TypeParam::order;
  Random random(1234);
  int made = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const auto config = random_config<TypeParam>(random);
    const auto outcome = TypeParam::make(config);
    if (!outcome) {
      ASSERT_STREQ(outcome.error().field, ObserverTraits<TypeParam>::field);
      continue;
    }
    ++made;
    TypeParam observer = *outcome;
    const long double t = config.sample_time;
    // Drives of the size of y / 1000 and below.
    const double unit = 1e-3 / std::abs(static_cast<double>(config.input_gain) *
                                        static_cast<double>(nordsieck(n, t)));
    int missed = 0;
    S last = 0;
    for (int k = 0; k < 100; ++k) {
      SCOPED_TRACE(::testing::Message() << "trial " << trial << " sample " << k);
      const auto y = static_cast<S>(random.uniform(-1, 1));
      const auto u = static_cast<S>(random.uniform(-unit, unit));
      const S bad = random.index(2) == 0 ? hidden_nan<S>() : -hidden_infinity<S>();
      const int kind = random.index(20);
      const bool bad_u = kind == 0 || kind == 1;
      const bool bad_y = kind == 1 || kind == 2;
      ++missed;
      // A long gap restarts if it is too long, or if more than twice the most would then be due.
      const auto due_after = [&](int steps) {
        TypeParam fresh = *outcome;
        for (int step = 1; step < steps; ++step) (void)fresh.predict(S(0));
        (void)fresh.update(S(0), S(0));
        return fresh.recovering();
      };
      bool restarts = missed > observer.longest_gap() + 1;
      if (missed > observer.max_gap() + 1 && observer.recovering() > 0) {
        restarts = restarts || observer.recovering() + due_after(missed) >
                                   2 * due_after(observer.longest_gap() + 1);
      }
      StepStatus expected = bad_u ? StepStatus::input_rejected : StepStatus::ok;
      StepStatus status;
      if (kind == 3) {
        status = observer.predict(u);
      } else {
        status = observer.update(bad_y ? bad : y, bad_u ? bad : u);
        if (bad_y) {
          expected |= StepStatus::measurement_rejected;
        } else {
          if (restarts) {
            expected |= StepStatus::restarted;
          } else if (missed > 1) {
            expected |= StepStatus::gap_bridged;
          }
          missed = 0;
        }
      }
      if (!bad_u) last = u;
      ASSERT_EQ(status, expected);
      ASSERT_EQ(observer.missed(), missed);
      ASSERT_EQ(observer.applied_input(), last);
      ASSERT_TRUE(all_finite(observer));
      // Level by level no scaled state exceeds what its binomials make of data of size one, over
      // gaps of a few samples.
      const double bound = std::pow(4.0 * N, 2 * N * TypeParam::levels);
      const auto z = observer.estimate();
      for (int r = 0; r < N; ++r) {
        ASSERT_LE(std::abs(z(r)) * nordsieck(r, t), bound) << r;
      }
    }
  }
  EXPECT_GT(made, 100);
}

/// Whatever comes: the state stays finite, and a settled observer is found again after a good run.
TYPED_TEST(RandomConfig, WildData) {
  using S = typename TypeParam::scalar_type;
  constexpr int N = TypeParam::size;
  const double largest = static_cast<double>(std::numeric_limits<S>::max());
  Random random(99);
  const auto wild = [&]() -> S {
    switch (random.index(8)) {
      case 0:
        return hidden_nan<S>();
      case 1:
        return random.index(2) == 0 ? hidden_infinity<S>() : -hidden_infinity<S>();
      case 2:
        return static_cast<S>(random.uniform(-1, 1) * largest);
      case 3:
        return S(0);
      default: {
        const double size = std::exp(random.uniform(-std::log(largest), std::log(largest)));
        return static_cast<S>(random.index(2) == 0 ? size : -size);
      }
    }
  };
  for (int trial = 0; trial < 200; ++trial) {
    const auto config = random_config<TypeParam>(random);
    const auto outcome = TypeParam::make(config);
    if (!outcome) continue;
    TypeParam observer = *outcome;
    for (int k = 0; k < 60; ++k) {
      SCOPED_TRACE(::testing::Message() << "trial " << trial << " sample " << k);
      const S y = wild();
      const S u = wild();
      StepStatus status = StepStatus::ok;
      const int kind = random.index(6);
      switch (kind) {
        case 0:
          status = observer.predict(u);
          break;
        case 1:
          status = observer.correct(y);
          break;
        case 2: {
          typename TypeParam::Estimate state;
          for (int r = 0; r < N; ++r) state(r) = wild();
          const TypeParam before = observer;
          status = observer.reset(state);
          if (status != StepStatus::ok) {
            ASSERT_EQ(status, StepStatus::state_rejected);
            ASSERT_EQ(observer.missed(), before.missed());
          }
          break;
        }
        default:
          status = observer.update(y, u);
      }
      ASSERT_TRUE(all_finite(observer)) << static_cast<int>(status);
      if (kind != 2) {
        const bool saw_y = kind != 0;
        const bool saw_u = kind != 1;
        if (saw_y && !std::isfinite(y)) {
          ASSERT_TRUE(has(status, StepStatus::measurement_rejected));
        }
        if (saw_u && !std::isfinite(u)) {
          ASSERT_TRUE(has(status, StepStatus::input_rejected));
        }
      }
    }
    // However it was left, a reset brings it back.
    ASSERT_EQ(observer.reset(S(1)), StepStatus::ok);
    ASSERT_EQ(observer.update(S(1), S(0)), StepStatus::ok);
    ASSERT_EQ(observer.estimate()(0), S(1));
  }
}

/// The innovation of the undisturbed observer obeys the characteristic polynomial that was asked
/// for, sum_j C(N, j) (-rho)^j e[k-j] = 0.
template <class Observer>
void expect_polynomial(std::uint64_t seed) {
  constexpr int N = Observer::size;
  Random random(seed);
  for (int trial = 0; trial < 300; ++trial) {
    auto config = random_config<Observer>(random);
    const double omega_t = random.log_uniform(0.05, 20);
    config.observer_bandwidth = omega_t / config.sample_time;
    Observer observer = Observer::make(config).value();
    typename Observer::Estimate state;
    for (int r = 0; r < N; ++r) {
      state(r) = random.uniform(-1, 1) / static_cast<double>(nordsieck(r, config.sample_time));
    }
    observer.reset(state);
    std::vector<double> e;
    for (int k = 0; k < 3 * N; ++k) {
      observer.update(0, 0);
      e.push_back(observer.innovation());
    }
    const double rho = std::exp(-omega_t);
    for (std::size_t k = N; k < e.size(); ++k) {
      double sum = 0;
      double terms = 0;
      for (int j = 0; j <= N; ++j) {
        const double term = choose(N, j) * std::pow(-rho, j) * e[k - static_cast<std::size_t>(j)];
        sum += term;
        terms += std::abs(term);
      }
      // States are larger than the innovation by binomials; so is their rounding.
      EXPECT_LE(std::abs(sum), 1e-13 * std::ldexp(terms + 1, N)) << trial << ' ' << omega_t;
    }
  }
}

TEST(RandomConfigLinear, InnovationObeysThePolynomial) {
  expect_polynomial<LinearEso<1>>(1);
  expect_polynomial<LinearEso<2>>(2);
  expect_polynomial<LinearEso<3, double, 2>>(3);
  expect_polynomial<LinearEso<6>>(4);
}

/// Each gain for a gap is stable where that gap recurs, but a mixture of gaps need not be: for N >=
/// 5 and omega_o T = 3 gaps of 1 and 2 samples in turn diverge, by 1.47 each pair. Half of the
/// samples may be missing at random up to N = 4, four in five up to N = 3.
template <class Observer>
void expect_decay_under_irregular_gaps(const std::vector<double>& shares) {
  using Traits = ObserverTraits<Observer>;
  Random random(8);
  for (const double omega_t : {0.1, 0.5, 1.0, 3.0, 20.0}) {
    for (const double missing : shares) {
      const double t = 0.01;
      auto observer = Observer::make(Traits::config(omega_t / t, t, 1)).value();
      typename Observer::Estimate state;
      for (int r = 0; r < Observer::size; ++r) state(r) = 1 / static_cast<double>(nordsieck(r, t));
      observer.reset(state);
      for (int k = 0; k < 2000; ++k) {
        if (random.uniform(0, 1) < missing) {
          observer.predict(0);
        } else {
          observer.update(0, 0);
        }
      }
      observer.update(0, 0);
      for (int r = 0; r < Observer::size; ++r) {
        EXPECT_LT(std::abs(observer.estimate()(r)) * nordsieck(r, t), 1e-9)
            << omega_t << ' ' << missing;
      }
    }
  }
}

TEST(IrregularGaps, DecayUpToFourStates) {
  expect_decay_under_irregular_gaps<LinearEso<1>>({0.1, 0.5, 0.8});
  expect_decay_under_irregular_gaps<LinearEso<2>>({0.1, 0.5, 0.8});
  expect_decay_under_irregular_gaps<LinearEso<2, double, 2>>({0.1, 0.5});
  expect_decay_under_irregular_gaps<CascadeEso<2, 3>>({0.1, 0.5, 0.8});
}

/// States of a long chain can overflow in the prediction while the estimate of y is good.
TEST(RandomConfig, LeavesAStateThatCannotBePredicted) {
  auto observer = esokit::LinearEso<2, float, 2>::make(
                      {.observer_bandwidth = 0.3f, .input_gain = 1, .sample_time = 10})
                      .value();
  observer.update(1.7e38f, 0);
  observer.update(-1.7e38f, 0);
  StepStatus status{};
  for (int k = 0; k < 100; ++k) status = observer.update(1, 0);
  EXPECT_EQ(status, StepStatus::ok);
  EXPECT_NEAR(observer.estimate()(0), 1, 1e-3);
  EXPECT_NEAR(observer.total_disturbance(), 0, 1e-3);
}

/// An absurd u that dhat has come to cancel: the good u after it is not the one to refuse.
TEST(RandomConfig, LeavesAnAbsurdInputThatTheDisturbanceCancels) {
  auto observer = esokit::LinearEso<4, float>::make(
                      {.observer_bandwidth = 30, .input_gain = 1, .sample_time = 0.1f})
                      .value();
  for (int k = 0; k < 5; ++k) observer.update(1, std::numeric_limits<float>::max());
  StepStatus status{};
  for (int k = 0; k < 100; ++k) status = observer.update(1, 0);
  EXPECT_EQ(status, StepStatus::ok);
  EXPECT_NEAR(observer.total_disturbance(), 0, 1e-3);
}

/// An absurd but finite u is taken at its word, and may carry the estimate so far away that no
/// correction is finite any more. The restart after max_gap samples ends that.
TEST(RandomConfigLinear, RecoversFromAnyInput) {
  Random random(55);
  for (int trial = 0; trial < 2000; ++trial) {
    const auto config = random_config<LinearEso<2, float>>(random);
    const auto outcome = LinearEso<2, float>::make(config);
    if (!outcome) continue;
    auto observer = *outcome;
    for (int k = 0; k < 10; ++k) observer.update(1, 0);
    const float u = static_cast<float>(random.log_uniform(1e30, 3.4e38));
    observer.update(1, u);
    int rejected = 0;
    while (rejected < 1000 && has(observer.update(1, 0), StepStatus::measurement_rejected)) {
      ++rejected;
    }
    EXPECT_LE(rejected, config.max_gap + 1);
    EXPECT_TRUE(all_finite(observer));
  }
}

}  // namespace observer_random_config_test
