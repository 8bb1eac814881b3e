// The seam: a gain law of each kind, written as a user would, through the one predictor-corrector.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/predictor_corrector.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace gain_gain_law_test {

using esokit::Array;
using esokit::ChainConfig;
using esokit::EigenMatrix;
using esokit::GainLaw;
using esokit::has;
using esokit::PredictorCorrector;
using esokit::PresetGainLaw;
using esokit::ScaledGain;
using esokit::StepStatus;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;
using esokit_test::huge;
using esokit_test::Random;
using esokit_test::refusal;
using esokit_test::same_bits;

const ChainConfig<double> unit_chain{.input_gain = 1, .sample_time = 1};

// ---- constant

/// A law is no more than this.
struct Constant {
  ScaledGain<3, double> k{};
  [[nodiscard]] const ScaledGain<3, double>& gain(double) const noexcept { return k; }
};
static_assert(GainLaw<Constant, 3, double> && !PresetGainLaw<Constant, 3, double>);

ScaledGain<3, double> bandwidth_gain(double omega_t) {
  return esokit::current_gain<3, double>(
      esokit::EqualSampledPoles<3, double>::from_bandwidth(omega_t, 1).weights());
}

TEST(GainLaw, ConstantIsTheLinearEso) {
  auto own =
      PredictorCorrector<2, double, 1, Constant>::make(unit_chain, Constant{bandwidth_gain(0.4)})
          .value();
  auto linear =
      esokit::LinearEso<2>::make({.observer_bandwidth = 0.4, .input_gain = 1, .sample_time = 1})
          .value();
  Random random(1);
  for (int k = 0; k < 100; ++k) {
    const double y = k % 9 == 8 ? hidden_nan<double>() : random.uniform(-1, 1);
    const double u = random.uniform(-1, 1);
    EXPECT_EQ(own.update(y, u), linear.update(y, u));
    if (linear.missed() > 0) {  // from here on the two differ, by the gain for the gap
      own.reset(0.0);
      linear.reset(0.0);
    }
    for (int r = 0; r < 3; ++r) ASSERT_TRUE(same_bits(own.estimate()(r), linear.estimate()(r)));
  }
}

/// Why a constant law needs gap_gain: one correction in three with the nominal gain diverges, by
/// 1.66 each time (N = 3, omega_o T = 1).
TEST(GainLaw, NominalGainDivergesUnderRecurringGaps) {
  auto own =
      PredictorCorrector<2, double, 1, Constant>::make(unit_chain, Constant{bandwidth_gain(1)})
          .value();
  auto linear =
      esokit::LinearEso<2>::make({.observer_bandwidth = 1, .input_gain = 1, .sample_time = 1})
          .value();
  const auto third = [](auto& observer) {
    for (int i = 0; i < 3; ++i) observer.predict(0);
    EXPECT_EQ(observer.correct(0), StepStatus::gap_bridged);
    return eigen(observer.estimate()).norm();
  };
  own.reset({1.0, 0.1, 0.1});
  linear.reset({1.0, 0.1, 0.1});
  double early = 0;
  double late = 0;
  double settled = 0;
  for (int k = 0; k < 60; ++k) {
    late = third(own);
    settled = third(linear);
    if (k == 19) early = late;
  }
  EXPECT_NEAR(std::pow(late / early, 1.0 / 40), 1.66, 0.01);
  EXPECT_LT(settled, 1e-12);
}

struct Bridging : Constant {
  static constexpr esokit::GainLawTraits traits{.bridges_gaps = true};
  [[nodiscard]] ScaledGain<3, double> gap_gain(double, unsigned samples) const noexcept {
    return {0.5, static_cast<double>(samples), 0};
  }
  [[nodiscard]] int longest_gap(int asked) const noexcept { return asked < 6 ? asked : 6; }
};

TEST(GainLaw, OwnGapGainIsUsed) {
  auto observer =
      PredictorCorrector<2, double, 1, Bridging>::make(unit_chain, Bridging{{{0.25, 0, 0}}})
          .value();
  EXPECT_EQ(observer.update(4, 0), StepStatus::ok);
  EXPECT_EQ(observer.estimate()(0), 1);
  observer.reset(0.0);
  for (int i = 0; i < 5; ++i) observer.predict(0);
  EXPECT_EQ(observer.correct(4), StepStatus::gap_bridged);
  EXPECT_EQ(observer.estimate()(0), 2);
  EXPECT_EQ(observer.estimate()(1), 20);
  // Six missing samples are the last that it bridges.
  EXPECT_EQ(observer.max_gap(), 6);
  for (const int predictions : {7, 8}) {
    for (int i = 0; i < predictions; ++i) observer.predict(0);
    EXPECT_EQ(observer.correct(4),
              predictions == 7 ? StepStatus::gap_bridged : StepStatus::restarted);
  }
}

// ---- switched, with memory

/// High gain while the innovation shrinks, low gain otherwise.
struct Switched {
  static constexpr esokit::GainLawTraits traits{.accepts = true, .resets = true};
  ScaledGain<2, double> shrinking{0.75, 0.25};
  ScaledGain<2, double> growing{0.5, 0.125};
  double last = std::numeric_limits<double>::infinity();
  int accepted = 0;
  int resets = 0;

  [[nodiscard]] const ScaledGain<2, double>& gain(double e) const noexcept {
    return std::abs(e) < last ? shrinking : growing;
  }
  void accept(double e) noexcept {
    last = std::abs(e);
    ++accepted;
  }
  void reset() noexcept {
    last = std::numeric_limits<double>::infinity();
    ++resets;
  }
};
static_assert(GainLaw<Switched, 2, double> && !PresetGainLaw<Switched, 2, double>);

/// Gives access to the law, as an observer built on the seam has it.
template <int Order, class S, int Extension, class Law, int Levels = 1>
struct Open : PredictorCorrector<Order, S, Extension, Law, Levels> {
  using Base = PredictorCorrector<Order, S, Extension, Law, Levels>;
  Open(const ChainConfig<S>& config, const Law& law) : Base(config, filled(law)) {}
  const Law& law(std::size_t level = 0) const { return this->laws()[level]; }

 private:
  static typename Base::Laws filled(const Law& law) {
    return [&]<int... I>(std::integer_sequence<int, I...>) {
      return typename Base::Laws{((void)I, law)...};
    }
    (std::make_integer_sequence<int, Levels>{});
  }
};

TEST(GainLaw, SwitchedLawRemembersWhatWasAccepted) {
  Open<1, double, 1, Switched> observer(unit_chain, Switched{});
  // e = 4: anything shrinks from infinity.
  observer.update(4, 0);
  EXPECT_EQ(observer.estimate(), (EigenMatrix<double, 2>(3, 1)));
  // predicted 4, e = -8: grows; 4 - 4 = 0, 1 - 1 = 0.
  observer.update(-4, 0);
  EXPECT_EQ(observer.innovation(), -8);
  EXPECT_EQ(observer.estimate(), (EigenMatrix<double, 2>(0, 0)));
  // e = 4 < 8: shrinks.
  observer.update(4, 0);
  EXPECT_EQ(observer.estimate(), (EigenMatrix<double, 2>(3, 1)));
  EXPECT_EQ(observer.law().accepted, 3);
  // Dropped corrections leave no trace in the memory.
  const double last = observer.law().last;
  EXPECT_EQ(observer.update(hidden_nan<double>(), 0), StepStatus::measurement_rejected);
  EXPECT_EQ(observer.update(-hidden_infinity<double>(), hidden_nan<double>()),
            StepStatus::measurement_rejected | StepStatus::input_rejected);
  EXPECT_EQ(observer.law().accepted, 3);
  EXPECT_EQ(observer.law().last, last);
  observer.reset(1.0);
  EXPECT_EQ(observer.law().resets, 1);
  EXPECT_EQ(observer.law().last, std::numeric_limits<double>::infinity());
  EXPECT_EQ(observer.reset(hidden_nan<double>()), StepStatus::state_rejected);
  EXPECT_EQ(observer.law().resets, 1);
}

TEST(GainLaw, UpdateAndHalvesAgreeForALawWithMemory) {
  Open<1, double, 1, Switched> whole(unit_chain, Switched{});
  Open<1, double, 1, Switched> halves = whole;
  Random random(9);
  for (int k = 0; k < 200; ++k) {
    const double y = k % 13 == 4 ? hidden_nan<double>() : random.uniform(-1, 1);
    const StepStatus status = whole.update(y, 0.5);
    const StepStatus predicted = halves.predict(0.5);
    EXPECT_EQ(status, predicted | halves.correct(y));
    ASSERT_EQ(whole.estimate(), halves.estimate());
    ASSERT_EQ(whole.law().last, halves.law().last);
    ASSERT_EQ(whole.law().accepted, halves.law().accepted);
  }
}

// ---- nonlinear

int looked_at_bad = 0;
int looked = 0;

/// Gain that grows with the innovation.
struct Nonlinear {
  [[nodiscard]] ScaledGain<2, double> gain(double e) const noexcept {
    ++looked;
    if (!esokit::is_finite(e)) ++looked_at_bad;
    const double factor = 1 / (1 + std::abs(e));
    return {1 - 0.5 * factor, 0.25 * factor};
  }
};
static_assert(GainLaw<Nonlinear, 2, double>);

TEST(GainLaw, NonlinearLawSeesTheInnovation) {
  auto observer =
      PredictorCorrector<1, double, 1, Nonlinear>::make(unit_chain, Nonlinear{}).value();
  observer.update(1, 0);
  EXPECT_EQ(observer.estimate(), (EigenMatrix<double, 2>(0.75, 0.125)));
  // predicted 0.875, e = -1
  observer.update(-0.125, 0);
  EXPECT_EQ(observer.estimate(), (EigenMatrix<double, 2>(0.875 - 0.75, 0)));
}

TEST(GainLaw, ALawThatLooksNeverSeesABadInnovation) {
  looked_at_bad = 0;
  looked = 0;
  auto one = PredictorCorrector<1, double, 1, Nonlinear>::make(unit_chain, Nonlinear{}).value();
  auto two =
      PredictorCorrector<1, double, 1, Nonlinear, 2>::make(unit_chain, {Nonlinear{}, Nonlinear{}})
          .value();
  for (const double bad : {hidden_nan<double>(), hidden_infinity<double>(),
                           -hidden_infinity<double>(), huge<double>(), -huge<double>()}) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_TRUE(has(one.update(bad, 0.1), StepStatus::measurement_rejected) ||
                  bad == huge<double>() || bad == -huge<double>());
      two.update(bad, 0.1);
      one.update(1, bad);
      two.update(1, bad);
      one.predict(bad);
      two.predict(bad);
      one.correct(bad);
      two.correct(bad);
      EXPECT_TRUE(eigen(one.estimate()).allFinite());
      EXPECT_TRUE(eigen(two.estimate()).allFinite());
    }
    one.reset(0.0);
    two.reset(0.0);
  }
  EXPECT_EQ(looked_at_bad, 0);
  EXPECT_GT(looked, 20);
}

TEST(GainLaw, EachLevelOfACascadeHasItsOwnLawAndInnovation) {
  Open<1, double, 1, Switched, 2> observer(unit_chain, Switched{});
  // Level 1: e = 4, to (3, 1). Level 2: e = 3, to (2.25, 0.75).
  observer.update(4, 0);
  EXPECT_EQ(observer.level_estimate(0), (EigenMatrix<double, 2>(3, 1)));
  EXPECT_EQ(observer.level_estimate(1), (EigenMatrix<double, 2>(2.25, 1.75)));
  EXPECT_EQ(observer.law(0).last, 4);
  EXPECT_EQ(observer.law(1).last, 3);
  EXPECT_EQ(observer.innovation(), 4);
  observer.reset(0.0);
  EXPECT_EQ(observer.law(0).resets, 1);
  EXPECT_EQ(observer.law(1).resets, 1);
}

// ---- time-varying

/// Least squares over all samples since the start: k = (2 (2k-1), 6) / (k (k+1)) at sample k.
struct ExpandingMemory {
  static constexpr esokit::GainLawTraits traits{
      .kind = esokit::GainKind::preset, .advances = true, .resets = true};
  double sample = 0;
  int advances = 0;
  int resets = 0;

  void advance() noexcept {
    ++sample;
    ++advances;
  }
  void reset() noexcept {
    sample = 0;
    ++resets;
  }
  [[nodiscard]] ScaledGain<2, double> gain_before_measurement() const noexcept {
    if (sample < 2) return {1, 0};
    return {2 * (2 * sample - 1) / (sample * (sample + 1)), 6 / (sample * (sample + 1))};
  }
  [[nodiscard]] ScaledGain<2, double> gain(double) const noexcept {
    return gain_before_measurement();
  }
};
static_assert(PresetGainLaw<ExpandingMemory, 2, double>);

TEST(GainLaw, ScheduledLawIsALeastSquaresLine) {
  Open<1, double, 1, ExpandingMemory> observer(unit_chain, ExpandingMemory{});
  Random random(21);
  double sum = 0;
  double moment = 0;
  for (int k = 1; k <= 60; ++k) {
    const double y = random.uniform(-1, 1) + 0.3 * k;
    observer.update(y, 0);
    sum += y;
    moment += k * y;
    if (k < 2) continue;
    // Normal equations of y = a + b k.
    const double mean = (k + 1) / 2.0;
    const double slope = (moment - mean * sum) / (k * (k * k - 1.0) / 12);
    EXPECT_NEAR(observer.estimate()(1), slope, 1e-12);
    EXPECT_NEAR(observer.estimate()(0), sum / k + slope * (k - mean), 1e-12);
  }
  EXPECT_EQ(observer.law().advances, 60);
}

/// Time passes in every predict: also in a bare one, in one with a bad input, with a bad
/// measurement; once each.
TEST(GainLaw, AdvanceIsCalledOncePerSample) {
  Open<1, double, 1, ExpandingMemory> observer(unit_chain, ExpandingMemory{});
  int samples = 0;
  const double nan = hidden_nan<double>();
  for (int k = 0; k < 5; ++k) {
    observer.update(1, 0);
    observer.update(nan, 0);
    observer.update(1, nan);
    observer.update(nan, nan);
    observer.update(huge<double>(), huge<double>());
    observer.predict(0);
    observer.predict(nan);
    samples += 7;
    EXPECT_EQ(observer.law().advances, samples);
    observer.correct(1);
    observer.correct(nan);
    EXPECT_EQ(observer.law().advances, samples);
  }
  EXPECT_EQ(observer.level_gain(0), observer.law().gain_before_measurement());
}

// ---- Riccati

/// Kalman gain with its own covariance, in the scaled states of n = 1, m = 1: the error covariance
/// is advanced with time and updated by what was accepted.
struct Riccati {
  static constexpr esokit::GainLawTraits traits{
      .kind = esokit::GainKind::preset, .advances = true, .accepts = true, .resets = true};
  double p00 = 1e6, p01 = 0, p11 = 1e6;
  double q = 0.01;
  double r = 0.5;

  void advance() noexcept {
    p00 += 2 * p01 + p11;
    p01 += p11;
    p11 += q;
  }
  [[nodiscard]] ScaledGain<2, double> gain_before_measurement() const noexcept {
    return {p00 / (p00 + r), p01 / (p00 + r)};
  }
  [[nodiscard]] ScaledGain<2, double> gain(double) const noexcept {
    return gain_before_measurement();
  }
  void accept(double) noexcept {
    const auto k = gain_before_measurement();
    p11 -= k[1] * p01;
    p01 -= k[0] * p01;
    p00 -= k[0] * p00;
  }
  void reset() noexcept { *this = Riccati{}; }
};
static_assert(PresetGainLaw<Riccati, 2, double>);

/// Against the Kalman filter of the textbook in matrices (Joseph form), missing samples and all.
TEST(GainLaw, RiccatiLawIsTheKalmanFilter) {
  using Matrix2 = esokit::EigenMatrix<double, 2, 2>;
  using Vector2 = EigenMatrix<double, 2>;
  Open<1, double, 1, Riccati> observer(unit_chain, Riccati{});
  const Riccati law;
  Matrix2 phi;
  phi << 1, 1, 0, 1;
  Matrix2 noise = Matrix2::Zero();
  noise(1, 1) = law.q;
  Matrix2 covariance = Vector2(law.p00, law.p11).asDiagonal();
  Vector2 state = Vector2::Zero();
  Random random(77);
  for (int k = 0; k < 60; ++k) {
    const double y = random.uniform(-1, 1);
    const double u = random.uniform(-1, 1);
    const bool missing = k % 6 == 2;
    const bool bad = k % 7 == 3;
    if (missing) {
      observer.predict(u);
    } else {
      observer.update(bad ? hidden_nan<double>() : y, u);
    }
    state = Vector2(phi * state + Vector2(u, 0));
    covariance = Matrix2(phi * covariance * phi.transpose() + noise);
    if (!missing && !bad) {
      const Vector2 gain = covariance.col(0) / (covariance(0, 0) + law.r);
      Matrix2 rest = Matrix2::Identity();
      rest.col(0) -= gain;
      state += gain * (y - state(0));
      covariance = Matrix2(rest * covariance * rest.transpose() + law.r * gain * gain.transpose());
    }
    ASSERT_NEAR(observer.estimate()(0), state(0), 1e-9);
    ASSERT_NEAR(observer.estimate()(1), state(1), 1e-9);
    // The prior covariance of 1e6 takes its digits at first.
    ASSERT_NEAR(observer.law().p00 / covariance(0, 0), 1, k < 3 ? 1e-3 : 1e-6);
  }
  observer.reset(0.0);
  EXPECT_EQ(observer.law().p00, law.p00);
}

// ---- continuous laws

struct Shrinking {
  [[nodiscard]] EigenMatrix<double, 2> gain(double t, double e) const {
    return EigenMatrix<double, 2>(t, std::abs(e));
  }
};
struct ContinuousWithMode {
  static constexpr esokit::ContinuousGainLawTraits traits{.begins_steps = true};
  bool fast = false;
  void begin_step(double, double e) { fast = std::abs(e) > 1; }
  [[nodiscard]] EigenMatrix<double, 2> gain(double, double) const {
    return fast ? EigenMatrix<double, 2>(20, 100) : EigenMatrix<double, 2>(2, 1);
  }
};

TEST(ContinuousGainLaw, SeesTimeAndInnovation) {
  using Observer = esokit::ContinuousObserver<1, double, 1, Shrinking>;
  const auto observer = Observer::make(2.0, {Shrinking{}}).value();
  // e = -3
  EXPECT_EQ(observer.derivative(5.0, {4, 10}, 1.0, 0.5), (EigenMatrix<double, 2>(10 + 1 - 15, -9)));
  EXPECT_FALSE(Observer::make(0.0, {Shrinking{}}));
  EXPECT_EQ(refusal(Observer::make(hidden_nan<double>(), {Shrinking{}})),
            "input_gain: must be finite and not zero (negative is fine)");
}

TEST(ContinuousGainLaw, ModeChangesAtStepBoundariesAlone) {
  using Observer = esokit::ContinuousObserver<1, double, 1, ContinuousWithMode, 2>;
  auto observer = Observer::make(1.0, {ContinuousWithMode{}, ContinuousWithMode{}}).value();
  const EigenMatrix<double, 4> z(0, 0, -0.5, 0);
  const EigenMatrix<double, 4> slow = observer.derivative(0.0, z, 3.0, 0.0);
  EXPECT_EQ(slow, (EigenMatrix<double, 4>(6, 3, 1, 0.5)));
  observer.begin_step(0.0, z, 3.0);  // e = 3 in level 1, 0.5 in level 2
  EXPECT_EQ(observer.derivative(0.0, z, 3.0, 0.0), (EigenMatrix<double, 4>(60, 300, 1, 0.5)));
}

}  // namespace gain_gain_law_test
