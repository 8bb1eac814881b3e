// What the predictor-corrector offers beside the steps: previews, revised inputs, shifts, gains.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <support/observer_traits.hpp>

// The references compute in long double on purpose; the library above is still checked.
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace observer_predictor_corrector_test {

using esokit::CascadeEso;
using esokit::LinearEso;
using esokit::StepStatus;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::nordsieck;
using esokit_test::ObserverTraits;
using esokit_test::Random;
using esokit_test::same_bits;

constexpr double period = 0.01;

template <class Observer>
class PredictorCorrector : public ::testing::Test {
 protected:
  using Value = typename Observer::scalar_type;
  static constexpr int N = Observer::size;
  static constexpr auto eps = std::numeric_limits<Value>::epsilon();

  /// In the middle of things, up to date.
  static Observer warm(double omega_t = 0.4, int max_gap = 5) {
    auto observer =
        Observer::make(ObserverTraits<Observer>::config(omega_t / period, period, -2, max_gap))
            .value();
    Random random(12);
    for (int k = 0; k < 30; ++k) {
      observer.update(static_cast<Value>(random.uniform(-1, 1)), input(random.uniform(-1, 1)));
    }
    return observer;
  }
  static Value input(double x) {
    return static_cast<Value>(x / nordsieck(Observer::order, period) / 2);
  }
  static Value scaled(const Observer& observer, int r) {
    return static_cast<Value>(observer.estimate()(r) *
                              nordsieck(r, static_cast<long double>(static_cast<Value>(period))));
  }
  /// Largest scaled state: what rounding is relative to.
  static Value size(const Observer& observer) {
    Value largest = 1;
    for (int level = 0; level < Observer::levels; ++level) {
      const auto z = observer.level_estimate(level);
      for (int r = 0; r < N; ++r) {
        largest = std::max(largest, static_cast<Value>(std::abs(z(r)) * nordsieck(r, period)));
      }
    }
    return largest;
  }
  static void expect_same(const Observer& a, const Observer& b) {
    for (int level = 0; level < Observer::levels; ++level) {
      for (int r = 0; r < N; ++r) {
        EXPECT_TRUE(same_bits(a.level_estimate(level)(r), b.level_estimate(level)(r))) << r;
      }
    }
    EXPECT_TRUE(same_bits(a.applied_input(), b.applied_input()));
    EXPECT_EQ(a.missed(), b.missed());
  }
};
using Observers = ::testing::Types<LinearEso<2>, LinearEso<1, float, 2>, CascadeEso<2, 3>,
                                   CascadeEso<2, 2, float, 2>>;
TYPED_TEST_SUITE(PredictorCorrector, Observers);

TYPED_TEST(PredictorCorrector, PreviewIsWhatCorrectDoes) {
  using S = typename TypeParam::scalar_type;
  for (const int samples : {1, 4, 6, 7, 20}) {  // beyond 6 = max_gap + 1 it restarts
    auto observer = this->warm();
    for (int i = 0; i < samples; ++i) observer.predict(this->input(0.3));
    const auto before = observer;
    const auto preview = observer.preview();
    this->expect_same(observer, before);
    for (const S y : {S(-3), S(0), S(0.7)}) {
      auto corrected = before;
      const StepStatus status = corrected.correct(y);
      EXPECT_EQ(status, samples > 6   ? StepStatus::restarted
                        : samples > 1 ? StepStatus::gap_bridged
                                      : StepStatus::ok);
      const S tolerance = 20 * TypeParam::size * this->eps * (this->size(before) + 3);
      for (std::size_t r = 0; r < TypeParam::size; ++r) {
        EXPECT_NEAR(preview.offset[r] + preview.slope[r] * y,
                    this->scaled(corrected, static_cast<int>(r)), tolerance)
            << samples << ' ' << r;
      }
    }
  }
}

TYPED_TEST(PredictorCorrector, SaysWhetherItWillRestart) {
  auto observer = this->warm();
  for (int i = 1; i <= 8; ++i) {
    observer.predict(0);
    EXPECT_EQ(observer.restarts(), i > 6) << i;
  }
}

TYPED_TEST(PredictorCorrector, RevisedInputIsTheOneThatWasHeld) {
  using S = typename TypeParam::scalar_type;
  auto revised = this->warm();
  auto told = revised;
  revised.predict(this->input(0.8));
  EXPECT_EQ(revised.revise_input(this->input(-0.4)), StepStatus::ok);
  told.predict(this->input(-0.4));
  EXPECT_EQ(revised.applied_input(), this->input(-0.4));
  const S tolerance = 20 * TypeParam::size * this->eps * this->size(told);
  for (int level = 0; level < TypeParam::levels; ++level) {
    for (int r = 0; r < TypeParam::size; ++r) {
      const auto unit = static_cast<S>(nordsieck(r, period));
      EXPECT_NEAR(revised.level_estimate(level)(r) * unit, told.level_estimate(level)(r) * unit,
                  tolerance);
    }
  }
  const auto before = revised;
  for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()}) {
    EXPECT_EQ(revised.revise_input(bad), StepStatus::input_rejected);
    this->expect_same(revised, before);
  }
  EXPECT_EQ(revised.missed(), 1);
}

TYPED_TEST(PredictorCorrector, ScaledEstimateIsTheEstimateScaled) {
  using S = typename TypeParam::scalar_type;
  const auto observer = this->warm();
  const S tolerance = 4 * TypeParam::size * this->eps * this->size(observer);
  EXPECT_NEAR(observer.template scaled_estimate<0>(), this->scaled(observer, 0), tolerance);
  EXPECT_NEAR(observer.template scaled_estimate<1>(), this->scaled(observer, 1), tolerance);
  constexpr int last = TypeParam::size - 1;
  EXPECT_NEAR(observer.template scaled_estimate<last>(), this->scaled(observer, last), tolerance);
  EXPECT_TRUE(same_bits(observer.template estimate<1>(), observer.estimate()(1)));
  EXPECT_TRUE(same_bits(observer.template estimate<last>(), observer.estimate()(last)));
  EXPECT_TRUE(same_bits(observer.total_disturbance(), observer.estimate()(TypeParam::order)));
}

/// The observer does not care where y has its origin.
TYPED_TEST(PredictorCorrector, ShiftedOutputIsAnotherOrigin) {
  using S = typename TypeParam::scalar_type;
  auto shifted = this->warm();
  auto original = shifted;
  shifted.shift_output(S(-8));
  for (int level = 0; level < TypeParam::levels; ++level) {
    const auto a = shifted.level_estimate(level);
    const auto b = original.level_estimate(level);
    EXPECT_NEAR(a(0), b(0) - 8, 20 * this->eps);
    for (int r = 1; r < TypeParam::size; ++r) EXPECT_TRUE(same_bits(a(r), b(r)));
  }
  for (int k = 0; k < 20; ++k) {
    shifted.update(S(0.25) * static_cast<S>(k) - 8, this->input(0.1));
    original.update(S(0.25) * static_cast<S>(k), this->input(0.1));
  }
  for (int r = 0; r < TypeParam::size; ++r) {
    const S offset = r == 0 ? S(-8) : S(0);
    EXPECT_NEAR(this->scaled(shifted, r), this->scaled(original, r) + offset,
                1000 * this->eps * this->size(original));
  }
}

TYPED_TEST(PredictorCorrector, ShiftedDisturbanceIsSeenByAllLevels) {
  using S = typename TypeParam::scalar_type;
  auto shifted = this->warm();
  const auto original = shifted;
  const S offset = static_cast<S>(3 / nordsieck(TypeParam::order, period));
  shifted.shift_disturbance(offset);
  for (int level = 0; level < TypeParam::levels; ++level) {
    const auto a = shifted.level_estimate(level);
    const auto b = original.level_estimate(level);
    for (int r = 0; r < TypeParam::size; ++r) {
      if (r == TypeParam::order) {
        EXPECT_NEAR(a(r) / offset, b(r) / offset + 1, 20 * this->eps * this->size(original));
      } else {
        EXPECT_TRUE(same_bits(a(r), b(r))) << r;
      }
    }
  }
}

TYPED_TEST(PredictorCorrector, LevelGainsAreThoseOfTheBandwidths) {
  using S = typename TypeParam::scalar_type;
  const auto observer = this->warm(0.4);
  for (int level = 0; level < TypeParam::levels; ++level) {
    const auto expected = esokit::current_gain<TypeParam::size, S>(
        esokit::EqualSampledPoles<TypeParam::size, S>::from_bandwidth(
            static_cast<S>(0.4 / period * (1 << level)), static_cast<S>(period))
            .weights());
    EXPECT_EQ(observer.level_gain(level), expected) << level;
  }
}

TYPED_TEST(PredictorCorrector, ResetForgetsTheInnovation) {
  using S = typename TypeParam::scalar_type;
  auto observer = TestFixture::warm();
  EXPECT_NE(observer.innovation(), S(0));
  ASSERT_EQ(observer.reset(S(0.5)), esokit::StepStatus::ok);
  EXPECT_EQ(observer.innovation(), S(0));
}

TEST(CorrectionGain, IsTheGainForTheGap) {
  auto observer =
      LinearEso<2>::make({.observer_bandwidth = 40, .input_gain = 1, .sample_time = period})
          .value();
  for (const int samples : {1, 3}) {
    observer.reset(0.0);
    for (int i = 0; i < samples; ++i) observer.predict(0);
    const auto k = observer.correction_gain(1.0);
    observer.correct(1);
    EXPECT_DOUBLE_EQ(observer.scaled_estimate<0>(), k[0]);
    EXPECT_DOUBLE_EQ(observer.scaled_estimate<1>(), k[1]);
    EXPECT_DOUBLE_EQ(observer.scaled_estimate<2>(), k[2]);
  }
  EXPECT_EQ(observer.gain_law().gain(0.0), observer.level_gain(0));
}

}  // namespace observer_predictor_corrector_test
