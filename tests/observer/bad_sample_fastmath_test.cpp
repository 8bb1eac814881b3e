// Bad samples under -ffast-math, where the compiler may assume that NaN and infinity do not occur.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <vector>

namespace {

using esokit::CascadeEso;
using esokit::LinearEso;
using esokit::StepStatus;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::huge;

template <class Observer>
Observer observer();

template <>
LinearEso<2> observer() {
  return LinearEso<2>::make({.observer_bandwidth = 50, .input_gain = 2, .sample_time = 0.01})
      .value();
}
template <>
LinearEso<2, float> observer() {
  return LinearEso<2, float>::make(
             {.observer_bandwidth = 50, .input_gain = 2, .sample_time = 0.01f})
      .value();
}
template <>
CascadeEso<2, 3> observer() {
  return CascadeEso<2, 3>::make({.observer_bandwidth = 20,
                                 .bandwidth_factor = 2,
                                 .input_gain = 2,
                                 .sample_time = 0.01})
      .value();
}
template <>
CascadeEso<2, 2, float> observer() {
  return CascadeEso<2, 2, float>::make({.observer_bandwidth = 20,
                                        .bandwidth_factor = 2,
                                        .input_gain = 2,
                                        .sample_time = 0.01f})
      .value();
}

template <class Observer>
class FastMath : public ::testing::Test {
 protected:
  using Value = typename Observer::scalar_type;

  static Observer warm() {
    Observer result = observer<Observer>();
    for (int k = 0; k < 20; ++k) {
      EXPECT_EQ(result.update(static_cast<Value>(0.1 * k), static_cast<Value>(k % 5)),
                StepStatus::ok);
    }
    return result;
  }
  static std::vector<Value> bad_values() {
    return {hidden_nan<Value>(), -hidden_nan<Value>(), hidden_infinity<Value>(),
            -hidden_infinity<Value>()};
  }
  /// To rounding: -ffast-math may order the sums of two paths differently. Finite first, NaN may
  /// equal anything here.
  static void expect_same(const Observer& a, const Observer& b) {
    const auto za = a.estimate();
    const auto zb = b.estimate();
    Value size = 1;
    for (int r = 0; r < Observer::size; ++r) {
      ASSERT_TRUE(esokit::is_finite(za(r)));
      size = std::max(size, std::abs(zb(r)));
    }
    for (int r = 0; r < Observer::size; ++r) {
      EXPECT_NEAR(za(r), zb(r), 100 * std::numeric_limits<Value>::epsilon() * size);
    }
  }
};
using Observers =
    ::testing::Types<LinearEso<2>, LinearEso<2, float>, CascadeEso<2, 3>, CascadeEso<2, 2, float>>;
TYPED_TEST_SUITE(FastMath, Observers);

TYPED_TEST(FastMath, BadMeasurementIsAMissingOne) {
  using S = typename TypeParam::scalar_type;
  auto values = this->bad_values();
  values.push_back(huge<S>());
  values.push_back(-huge<S>());
  for (const S bad : values) {
    auto hit = this->warm();
    auto missing = hit;
    EXPECT_EQ(hit.update(bad, S(1)), StepStatus::measurement_rejected);
    EXPECT_EQ(missing.predict(S(1)), StepStatus::ok);
    this->expect_same(hit, missing);
    EXPECT_EQ(hit.correct(bad), StepStatus::measurement_rejected);
    this->expect_same(hit, missing);
    EXPECT_EQ(hit.update(S(2), S(1)), StepStatus::gap_bridged);
    EXPECT_EQ(missing.update(S(2), S(1)), StepStatus::gap_bridged);
    this->expect_same(hit, missing);
  }
}

TYPED_TEST(FastMath, BadInputIsTheLastGoodOne) {
  using S = typename TypeParam::scalar_type;
  for (const S bad : this->bad_values()) {
    auto hit = this->warm();
    auto held = hit;
    const S last = hit.applied_input();
    EXPECT_EQ(hit.update(S(2), bad), StepStatus::input_rejected);
    EXPECT_EQ(held.update(S(2), last), StepStatus::ok);
    this->expect_same(hit, held);
    EXPECT_EQ(hit.update(bad, bad), StepStatus::input_rejected | StepStatus::measurement_rejected);
    held.predict(last);
    this->expect_same(hit, held);
  }
}

TYPED_TEST(FastMath, ResetRefusesBadState) {
  using S = typename TypeParam::scalar_type;
  for (const S bad : this->bad_values()) {
    auto hit = this->warm();
    const auto before = hit;
    EXPECT_EQ(hit.reset(bad), StepStatus::state_rejected);
    typename TypeParam::Estimate state = TypeParam::Estimate::Constant(1);
    state(1) = bad;
    EXPECT_EQ(hit.reset(state), StepStatus::state_rejected);
    this->expect_same(hit, before);
  }
}

TYPED_TEST(FastMath, LongRunOfBadSamplesRestarts) {
  using S = typename TypeParam::scalar_type;
  auto hit = this->warm();
  for (int k = 0; k < 150; ++k) {
    EXPECT_EQ(hit.update(hidden_nan<S>(), hidden_nan<S>()),
              StepStatus::measurement_rejected | StepStatus::input_rejected);
  }
  EXPECT_EQ(hit.update(S(7), S(0)), StepStatus::restarted);
  EXPECT_EQ(hit.estimate()(0), S(7));
}

/// A law that looks at the innovation is shielded as well.
struct Watching {
  static inline int bad = 0;
  [[nodiscard]] esokit::ScaledGain<2, float> gain(float e) const noexcept {
    if (!esokit::is_finite(e)) ++bad;
    return {0.5f, 0.25f};
  }
};

TEST(FastMathGainLaw, NeverSeesABadInnovation) {
  auto eso = esokit::PredictorCorrector<1, float, 1, Watching>::make(
                 {.input_gain = 1, .sample_time = 1}, Watching{})
                 .value();
  for (int k = 0; k < 10; ++k) {
    eso.update(hidden_nan<float>(), 0);
    eso.update(1, hidden_nan<float>());
    eso.update(hidden_infinity<float>(), hidden_infinity<float>());
  }
  EXPECT_EQ(Watching::bad, 0);
  EXPECT_TRUE(esokit::is_finite(eso.estimate()(0)));
}

}  // namespace
