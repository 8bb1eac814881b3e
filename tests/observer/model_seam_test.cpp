// The model is a seam of its own: a resonator, which is no chain, through placement, gain laws,
// observers, controller and analysis; and a chain that does not say that it is one.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <random>
#include <vector>

#include <support/augmented_reference.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <support/resonator_model.hpp>
#include <support/switching.hpp>

namespace observer_model_seam_test {

using esokit::Adrc;
using esokit::CascadeEso;
using esokit::ChainModel;
using esokit::EqualPoles;
using esokit::ExtendedStateFilter;
using esokit::InflationRule;
using esokit::LinearEso;
using esokit::ModelTraits;
using esokit::RiccatiMode;
using esokit::SampledModel;
using esokit::StepStatus;
using esokit_test::AugmentedReference;
using esokit_test::refusal;
using esokit_test::ResonatorModel;

template <int Order, class S = double>
using ResonatorEso = LinearEso<Order, S, 3, EqualPoles, ResonatorModel<Order, S>>;

/// The chain, placed numerically.
template <int Order, class S, int Extension>
struct UndeclaredChain : ChainModel<Order, S, Extension> {
  using Base = ChainModel<Order, S, Extension>;
  static constexpr ModelTraits traits{.shifts_output = true};
  struct Settings {};
  static esokit::Expected<UndeclaredChain, esokit::Error<S>> make(const Settings&,
                                                                  const S& input_gain,
                                                                  const S& sample_time) {
    return UndeclaredChain{Base(input_gain, sample_time)};
  }
};

// ---- The concept: what it asks for, each thing left out.

using Resonator = ResonatorModel<2, double>;
static_assert(SampledModel<Resonator, double> && SampledModel<ChainModel<3, float, 2>, float>);
static_assert(SampledModel<UndeclaredChain<2, double, 1>, double>);
static_assert(!SampledModel<Resonator, float>);

#define ESOKIT_TEST_WITHOUT(name)     \
  struct Without_##name : Resonator { \
    void name() const = delete;       \
  };                                  \
  static_assert(!SampledModel<Without_##name, double>)
ESOKIT_TEST_WITHOUT(input_gain);
ESOKIT_TEST_WITHOUT(sample_time);
ESOKIT_TEST_WITHOUT(drive);
ESOKIT_TEST_WITHOUT(predict);
ESOKIT_TEST_WITHOUT(add_input);
ESOKIT_TEST_WITHOUT(physical);
ESOKIT_TEST_WITHOUT(scaled);
ESOKIT_TEST_WITHOUT(rescaled);
ESOKIT_TEST_WITHOUT(scaled_disturbance);
ESOKIT_TEST_WITHOUT(same_drive);
ESOKIT_TEST_WITHOUT(finite_probe);
ESOKIT_TEST_WITHOUT(equilibrium);
ESOKIT_TEST_WITHOUT(increment);
ESOKIT_TEST_WITHOUT(degree);
ESOKIT_TEST_WITHOUT(state_of_row);
struct TraitsOfAnotherType : Resonator {
  static constexpr int traits = 1;
};
static_assert(!SampledModel<TraitsOfAnotherType, double>);

/// A known pole: y cannot be counted from elsewhere.
struct Anchored : Resonator {
  static constexpr ModelTraits traits{};
};
template <class Observer>
concept Shifts = requires(Observer& observer) {
  observer.shift_output(1.0);
};
static_assert(Shifts<ResonatorEso<2>> && esokit::ShiftableOutput<ResonatorEso<2>>);
static_assert(!Shifts<LinearEso<2, double, 3, EqualPoles, Anchored>>);
static_assert(!esokit::ShiftableOutput<LinearEso<2, double, 3, EqualPoles, Anchored>>);
static_assert(esokit::LoopObserver<ResonatorEso<2>> &&
              esokit::PredictableObserver<ResonatorEso<2>>);

// ---- References in 100 digits, from the differential equation.

/// y^(n) = c + q, q a sine of that frequency: published as (y, .., D, q, r).
template <int Order>
AugmentedReference swinging(double frequency) {
  return esokit_test::reference_of<esokit::ModelParts{.order = Order, .resonators = 1}>(
      {.resonators = {{{frequency}}}}, 1.0);
}

/// Phi of y'' = D.
esokit_test::Table transition(double frequency) {
  auto phi = swinging<2>(frequency).step(1e-3);
  for (std::size_t i = 0; i < phi.size(); ++i) phi[i][i] += 1;
  return phi;
}

template <class Observer>
double worst_coefficient(const Observer& observer, const AugmentedReference& reference,
                         double bandwidth) {
  return esokit_test::worst_coefficient(
      observer, reference,
      esokit_test::Poles(Observer::size, {-static_cast<long double>(bandwidth), 0}));
}

template <int Order>
void resonator_poles_are_placed(double tolerance) {
  constexpr double T = 1e-3;
  for (const double product : {1e-3, 1e-2, 0.1, 1.0, 10.0}) {
    for (const double ratio : {0.3, 1.0, 3.0}) {
      const double w = ratio * product / T;
      // At 3, next to half the sample rate, N = 8 in double and N = 5 in float are refused.
      if (w * T > 2) continue;
      SCOPED_TRACE(::testing::Message()
                   << "n " << Order << ", omega_o T " << product << ", w T " << w * T);
      const auto observer = ResonatorEso<Order>::make(
          {.observer_bandwidth = product / T, .input_gain = 1.0, .sample_time = T, .model = {w}});
      ASSERT_TRUE(observer) << observer.error();
      EXPECT_LT(worst_coefficient(*observer, swinging<Order>(w), product / T), tolerance);
    }
  }
}

// Phi goes into the gain by its elements' rounding, which the poles' distance from each other and
// from those of the model multiplies: 1e-9 was asked for, for N to 8.
TEST(ModelPlacement, PutsAResonatorsPolesWhereAsked) {
  resonator_poles_are_placed<1>(1e-11);
  resonator_poles_are_placed<2>(1e-11);
  resonator_poles_are_placed<3>(1e-10);
  resonator_poles_are_placed<4>(1e-9);
  resonator_poles_are_placed<5>(1e-9);
}

template <int Order, int Extension>
void chain_is_placed() {
  constexpr double T = 1e-3;
  using Chain = UndeclaredChain<Order, double, Extension>;
  for (const double product : {1e-3, 1e-2, 0.1, 1.0, 10.0}) {
    const auto placed = LinearEso<Order, double, Extension, EqualPoles, Chain>::make(
        {.observer_bandwidth = product / T, .input_gain = 2.0, .sample_time = T});
    ASSERT_TRUE(placed) << placed.error();
    const auto formula =
        LinearEso<Order, double, Extension>::make(
            {.observer_bandwidth = product / T, .input_gain = 2.0, .sample_time = T})
            .value();
    for (std::size_t r = 0; r < Order + Extension; ++r) {
      EXPECT_NEAR(placed->level_gain(0)[r] / formula.level_gain(0)[r], 1.0, 1e-12)
          << Order << "+" << Extension << " row " << r << ", omega_o T " << product;
    }
    const auto reference =
        esokit_test::reference_of<esokit::ModelParts{.order = Order, .constants = Extension}>({},
                                                                                              2.0);
    EXPECT_LT(worst_coefficient(*placed, reference, product / T), 1e-11);
  }
}

TEST(ModelPlacement, OfAChainEqualsTheFormula) {
  chain_is_placed<1, 1>();
  chain_is_placed<2, 1>();
  chain_is_placed<3, 2>();
  chain_is_placed<4, 4>();
}

TEST(ModelPlacement, InFloatDecaysWithinAQuarterOfWhatWasAskedFor) {
  constexpr double T = 1e-3;
  for (const double product : {1e-2, 0.1, 1.0}) {
    for (const double ratio : {0.3, 1.0, 3.0}) {
      const double w = ratio * product / T;
      // At 3, next to half the sample rate, N = 8 in double and N = 5 in float are refused.
      if (w * T > 2) continue;
      const auto observer = ResonatorEso<2, float>::make({.observer_bandwidth = float(product / T),
                                                          .input_gain = 1.0F,
                                                          .sample_time = float(T),
                                                          .model = {float(w)}});
      ASSERT_TRUE(observer) << observer.error();
      // Largest pole, in double.
      const auto phi = transition(w);
      typename ResonatorEso<2, float>::State ones{};
      ones.fill(1);
      const auto units = observer->model().physical(ones);
      esokit_test::Square<5> m;
      for (int i = 0; i < 5; ++i) {
        for (int j = 0; j < 5; ++j) {
          const auto k = static_cast<long double>(observer->level_gain(0)[size_t(i)]) *
                         static_cast<long double>(units(i));
          m(i, j) = static_cast<double>(phi[size_t(i)][size_t(j)] - k * phi[0][size_t(j)]);
        }
      }
      const double decay = -std::log(esokit_test::spectral_radius<5>(m)) / product;
      EXPECT_GT(decay, 0.75) << "omega_o T " << product << ", w / omega_o " << ratio;
      EXPECT_LT(decay, 1.25) << "omega_o T " << product << ", w / omega_o " << ratio;
    }
  }
}

TEST(ModelPlacement, RefusesWhatTheScalarCannotHold) {
  using Eso = ResonatorEso<2, float>;
  EXPECT_EQ(refusal(Eso::make({.observer_bandwidth = 1e-3F,
                               .input_gain = 1.0F,
                               .sample_time = 1e-3F,
                               .model = {1000.0F}})),
            "observer_bandwidth: gives poles that the scalar cannot place for this model");
}

// ---- Observers.

constexpr double kT = 1e-3;
constexpr double kW = 314.0;

/// y'' = 3 + 2 sin(w t + 0.3) from y = y' = 0 at the sine's own phase.
struct Swinging {
  static double disturbance(double t) { return 3 + 2 * std::sin(kW * t + 0.3); }
  static double y(double t) { return 1.5 * t * t - 2 / (kW * kW) * std::sin(kW * t + 0.3); }
};

/// Largest error of dhat in the second second.
template <class Observer>
double worst_disturbance(Observer observer) {
  double worst = 0;
  for (int k = 1; k < 2000; ++k) {
    EXPECT_EQ(observer.update(Swinging::y(k * kT), 0.0), StepStatus::ok);
    if (k < 1000) continue;
    worst = std::max(worst, std::abs(observer.total_disturbance() - Swinging::disturbance(k * kT)));
  }
  return worst;
}

ExtendedStateFilter<2, double, 3, esokit::NoNominalModel, 0, Resonator>::Config filter_config(
    RiccatiMode mode) {
  ExtendedStateFilter<2, double, 3, esokit::NoNominalModel, 0, Resonator>::Config config;
  config.input_gain = 1.0;
  config.sample_time = kT;
  config.measurement_variance = 1e-8;
  config.disturbance_bounds = {0, 0, 1, 1, 1};
  config.inflation_rule = InflationRule::none;
  config.mode = mode;
  config.plant_model = {kW};
  return config;
}
using ResonatorFilter = ExtendedStateFilter<2, double, 3, esokit::NoNominalModel, 0, Resonator>;

// y is up to 6 with a rounding of 1e-16 of it, and dhat is its second difference over T^2 = 1e-6.
TEST(ResonatorModel, ASineAtItsFrequencyIsEstimatedToRounding) {
  constexpr double rounding = 1e-16 * 6 / (kT * kT) * 100;
  EXPECT_LT(
      worst_disturbance(
          ResonatorEso<2>::make(
              {.observer_bandwidth = 100.0, .input_gain = 1.0, .sample_time = kT, .model = {kW}})
              .value()),
      rounding);
  using Cascade = CascadeEso<2, 3, double, 3, EqualPoles, Resonator>;
  EXPECT_LT(worst_disturbance(Cascade::make({.observer_bandwidth = 100.0,
                                             .bandwidth_factor = 2.0,
                                             .input_gain = 1.0,
                                             .sample_time = kT,
                                             .model = {kW}})
                                  .value()),
            rounding);
  for (const RiccatiMode mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    EXPECT_LT(worst_disturbance(ResonatorFilter::make(filter_config(mode)).value()), rounding);
  }
  // Without the model it is not.
  EXPECT_GT(
      worst_disturbance(
          LinearEso<2>::make({.observer_bandwidth = 100.0, .input_gain = 1.0, .sample_time = kT})
              .value()),
      0.5);
}

TEST(ResonatorModel, RefusesAFrequencyAboveHalfTheSampleRate) {
  const auto make = [](double w) { return Resonator::make({w}, 1.0, kT); };
  EXPECT_TRUE(make(3.09 / kT));
  EXPECT_EQ(refusal(make(3.11 / kT)), "model.frequency: must be below half the sample rate");
  // The observer hands on what its model says.
  const auto observer = ResonatorEso<2>::make(
      {.observer_bandwidth = 100.0, .input_gain = 1.0, .sample_time = kT, .model = {std::nan("")}});
  EXPECT_EQ(refusal(observer), "model.frequency: must be finite and positive");
}

/// Kalman filter of the augmented model on dense matrices in long double, Phi from 100 digits.
struct DenseKalman {
  using Square = Eigen::Matrix<long double, 5, 5>;
  Square phi, q = Square::Zero(), p = Square::Zero();
  long double r = 1e-8L;

  DenseKalman() {
    const auto exact = transition(kW);
    for (int i = 0; i < 5; ++i) {
      for (int j = 0; j < 5; ++j) {
        phi(i, j) = exact[size_t(i)][size_t(j)];
      }
    }
    for (int i = 2; i < 5; ++i) q(i, i) = 5;  // c = N
  }
  Eigen::Matrix<long double, 5, 1> gain() const { return p.col(0) / (p(0, 0) + r); }
  void step() {
    const auto k = gain();
    Square closed = Square::Identity();
    closed.col(0) -= k;
    p = (phi * (closed * p * closed.transpose() + k * r * k.transpose()) * phi.transpose() + q)
            .eval();
  }
  void step_blind() { p = (phi * p * phi.transpose() + q).eval(); }
};

TEST(ResonatorModel, TheFilterIsTheKalmanFilterOfTheAugmentedModel) {
  DenseKalman dense;
  auto filter = ResonatorFilter::make(filter_config(RiccatiMode::recursive)).value();
  for (int k = 0; k < 400; ++k) {
    const bool missing = k > 100 && k % 7 == 3;
    if (k > 0) {
      // The gain of the coming correction belongs to the prediction that is made now.
      if (k - 1 > 100 && (k - 1) % 7 == 3) {
        dense.step_blind();
      } else {
        dense.step();
      }
    } else {
      dense.step_blind();
    }
    (void)filter.predict(0.0);
    const auto gain = filter.gain();
    const auto reference = dense.gain();
    for (int i = 0; i < 5; ++i) {
      ASSERT_NEAR(gain(i), static_cast<double>(reference(i)),
                  1e-9 * static_cast<double>(reference.cwiseAbs()(i)) + 1e-12 * (i < 2 ? 1 : 1e4))
          << "sample " << k << " row " << i;
    }
    if (!missing) (void)filter.correct(0.0);
  }
  // The limit of the frozen filter.
  DenseKalman limit;
  for (int k = 0; k < 20000; ++k) limit.step();
  const auto frozen = ResonatorFilter::make(filter_config(RiccatiMode::frozen)).value().gain();
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(frozen(i) / static_cast<double>(limit.gain()(i)), 1.0, 1e-9) << i;
  }
}

TEST(ResonatorModel, RetuningTheFilterKeepsItsCovariance) {
  auto filter = ResonatorFilter::make(filter_config(RiccatiMode::recursive)).value();
  for (int k = 1; k < 20; ++k) (void)filter.update(Swinging::y(k * kT), 0.0);
  const auto before = filter.covariance();
  auto other = filter_config(RiccatiMode::recursive);
  other.sample_time = 2.5 * kT;
  ASSERT_TRUE(filter.retune(other));
  const auto after = filter.covariance();
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) {
      EXPECT_NEAR(after(i, j), before(i, j), 1e-9 * std::sqrt(before(i, i) * before(j, j)))
          << i << ", " << j;
    }
  }
}

/// What R is asked for where errors may change sign at every sample: the chain's formula and that
/// of any model.
TEST(ModelRiccati, LeastMeasurementVarianceOfAChainEqualsTheFormula) {
  using Factor = esokit::CovarianceFactor<4, double>;
  const ChainModel<3> chain(1.0, kT);
  std::mt19937 random(5);
  std::normal_distribution<> normal;
  for (int k = 0; k < 20; ++k) {
    Factor::Square root;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) root(i, j) = k % 2 == 0 || i == j ? normal(random) : 0.0;
    }
    const auto noise = Factor::from_matrix(root * root.transpose()).value();
    const double formula = esokit::least_measurement_variance<4, double>(noise);
    const double general = esokit::least_measurement_variance<4, double>(
        noise, esokit::MatrixTransition<4, double>::of(chain));
    EXPECT_NEAR(general, formula, 1e-12 * (1 + std::abs(formula)));
  }
}

// ---- Gaps.

/// Largest error of the estimate over the last samples, in units of what y would be over a sample;
/// `missing(k)` samples have no measurement.
template <class Observer, class Missing>
double error_after(Observer observer, Missing&& missing, int samples) {
  EXPECT_EQ(observer.reset(1e3), StepStatus::ok);
  for (int k = 1; k < samples; ++k) {
    (void)observer.predict(0.0);
    if (!missing(k)) (void)observer.correct(0.0);
  }
  double worst = 0;
  for (const double x : observer.model().scaled(observer.estimate())) {
    worst = std::max(worst, std::abs(x));
  }
  return worst;
}

TEST(ModelGain, EveryRecurringGapThatIsBridgedLetsErrorsDecay) {
  for (const double bandwidth : {50.0, 400.0}) {
    for (const double w : {31.4, 314.0}) {
      const auto observer =
          ResonatorEso<2>::make(
              {.observer_bandwidth = bandwidth, .input_gain = 1.0, .sample_time = kT, .model = {w}})
              .value();
      EXPECT_GE(observer.max_gap(), 3) << bandwidth << ", " << w;
      for (const int missing : esokit_test::lengths(1, observer.max_gap())) {
        const auto pattern = [&](int k) { return k % (missing + 1) != 0; };
        EXPECT_LT(error_after(observer, pattern, 400000), 1e-3)
            << bandwidth << " rad/s, w " << w << ", " << missing << " missing";
      }
    }
  }
}

TEST(ModelGain, RandomGapsThatAreBridgedLetErrorsDecay) {
  std::mt19937 random(7);
  for (const double bandwidth : {50.0, 100.0, 200.0, 400.0}) {
    for (const double share : {0.1, 0.3, 0.5}) {
      const auto observer = ResonatorEso<2>::make({.observer_bandwidth = bandwidth,
                                                   .input_gain = 1.0,
                                                   .sample_time = kT,
                                                   .model = {kW}})
                                .value();
      int row = 0;
      const auto pattern = [&](int) {
        const bool misses =
            std::uniform_real_distribution<>(0, 1)(random) < share && row < observer.max_gap();
        row = misses ? row + 1 : 0;
        return misses;
      };
      EXPECT_LT(error_after(observer, pattern, 40000), 1e-3) << bandwidth << " rad/s, " << share;
    }
  }
}

TEST(ModelGain, LongGapsAreBridgedUntilTwiceTheMostIsDue) {
  auto observer =
      ResonatorEso<2>::make(
          {.observer_bandwidth = 200.0, .input_gain = 1.0, .sample_time = kT, .model = {kW}})
          .value();
  const int most = observer.max_gap();
  EXPECT_LT(most, 100);
  const auto update_after = [](auto& of, int missing) {
    for (int k = 0; k < missing; ++k) (void)of.predict(0.0);
    return of.update(1.0, 0.0);
  };
  const auto due_after = [&](int missing) {
    auto copy = observer;
    EXPECT_EQ(update_after(copy, missing), StepStatus::gap_bridged) << missing;
    return copy.recovering();
  };
  const int longest = observer.longest_gap();
  EXPECT_EQ(longest, 100);
  EXPECT_EQ(due_after(most), 0);
  EXPECT_GT(due_after(most + 1), 0);
  const int least = due_after(longest);
  EXPECT_GT(least, 1);
  auto twice = observer;
  for (int gap = 0; gap < 2; ++gap) {
    EXPECT_EQ(update_after(twice, longest), StepStatus::gap_bridged) << gap;
  }
  EXPECT_EQ(twice.recovering(), 2 * least);
  for (const bool waits : {false, true}) {
    auto copy = twice;
    for (int k = 0; k < (waits ? least : least - 1); ++k) (void)copy.update(1.0, 0.0);
    EXPECT_EQ(update_after(copy, longest), waits ? StepStatus::gap_bridged : StepStatus::restarted);
  }
  EXPECT_EQ(update_after(observer, longest + 1), StepStatus::restarted);
}

TEST(ModelGain, AGapShorterThanTheModelAllowsIsKept) {
  const auto observer = ResonatorEso<2>::make({.observer_bandwidth = 200.0,
                                               .input_gain = 1.0,
                                               .sample_time = kT,
                                               .model = {kW},
                                               .max_gap = 3})
                            .value();
  EXPECT_EQ(observer.max_gap(), 3);
}

/// Finite garbage of any size in y and u, gaps and restarts; then good samples of a plant at rest.
template <class Observer>
void finds_back(const Observer& fresh, int samples) {
  using S = typename Observer::scalar_type;
  std::mt19937 random(11);
  std::uniform_real_distribution<> share(0, 1);
  const auto absurd = [&] {
    const double size = share(random) * 2 * std::numeric_limits<S>::max_exponent10 -
                        std::numeric_limits<S>::max_exponent10;
    return static_cast<S>((share(random) - 0.5) * std::pow(10.0, size));
  };
  for (int run = 0; run < 40; ++run) {
    auto observer = fresh;
    for (int k = 0; k < 30; ++k) {
      const double what = share(random);
      if (what < 0.6) {
        (void)observer.update(absurd(), absurd());
      } else if (what < 0.9) {
        (void)observer.predict(absurd());
      } else {
        (void)observer.reset(absurd());
      }
      const auto z = observer.estimate();
      for (int i = 0; i < Observer::size; ++i) ASSERT_TRUE(esokit::is_finite(z(i)));
    }
    for (int k = 0; k < samples; ++k) (void)observer.update(S(2), S(0));
    const auto state = observer.model().scaled(observer.estimate());
    EXPECT_NEAR(static_cast<double>(state[0]), 2.0, 1e-3) << run;
    for (std::size_t i = 1; i < state.size(); ++i) {
      EXPECT_LT(std::abs(static_cast<double>(state[i])), 1e-3) << run << ", " << i;
    }
  }
}

TEST(ResonatorModel, FindsBackFromGarbage) {
  // From the largest number to 1e-3: ln(1e312) / (omega_o T) = 7200 samples of a single pole.
  finds_back(ResonatorEso<2>::make(
                 {.observer_bandwidth = 100.0, .input_gain = 1.0, .sample_time = kT, .model = {kW}})
                 .value(),
             12000);
  finds_back(ResonatorEso<2, float>::make({.observer_bandwidth = 200.0F,
                                           .input_gain = 1.0F,
                                           .sample_time = 1e-3F,
                                           .model = {314.0F}})
                 .value(),
             2000);
  using Cascade = CascadeEso<2, 3, double, 3, EqualPoles, Resonator>;
  finds_back(Cascade::make({.observer_bandwidth = 100.0,
                            .bandwidth_factor = 2.0,
                            .input_gain = 1.0,
                            .sample_time = kT,
                            .model = {kW}})
                 .value(),
             12000);
  for (const RiccatiMode mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    finds_back(ResonatorFilter::make(filter_config(mode)).value(), 12000);
  }
}

// ---- On top: retuning, preview, controller, adapter, analysis.

TEST(ResonatorModel, RetuningKeepsEstimateAndControl) {
  auto observer =
      ResonatorEso<2>::make(
          {.observer_bandwidth = 100.0, .input_gain = 2.0, .sample_time = kT, .model = {kW}})
          .value();
  for (int k = 1; k < 500; ++k) (void)observer.update(Swinging::y(k * kT), 0.5);
  const auto before = observer.estimate();
  ASSERT_TRUE(observer.retune(
      {.observer_bandwidth = 150.0, .input_gain = 3.0, .sample_time = 2e-3, .model = {kW}}));
  const auto after = observer.estimate();
  for (int i : {0, 1, 3, 4}) EXPECT_NEAR(after(i) / before(i), 1.0, 1e-12) << i;
  EXPECT_NEAR(after(2), before(2) + (2.0 - 3.0) * 0.5, 1e-9 * std::abs(before(2)));
}

TEST(ResonatorModel, PreviewIsTheComingCorrection) {
  using Cascade = CascadeEso<2, 2, double, 3, EqualPoles, Resonator>;
  auto observer = Cascade::make({.observer_bandwidth = 100.0,
                                 .bandwidth_factor = 2.0,
                                 .input_gain = 1.0,
                                 .sample_time = kT,
                                 .model = {kW}})
                      .value();
  for (int k = 1; k < 50; ++k) (void)observer.update(std::sin(0.1 * k), 0.5);
  (void)observer.predict(0.2);
  const auto preview = observer.preview();
  const double y = 0.7;
  (void)observer.correct(y);
  const auto state = observer.model().scaled(observer.estimate());
  for (std::size_t r = 0; r < 5; ++r) {
    EXPECT_NEAR(preview.offset[r] + preview.slope[r] * y, state[r],
                1e-12 * (1 + std::abs(state[r])));
  }
}

/// Double integrator with a load of -5 + 3 sin(w t), exactly sampled: the largest |1 - y| in the
/// sixth second.
template <class Observer>
double tracking_error(const typename Adrc<Observer>::Config& config) {
  auto controller = Adrc<Observer>::make(config).value();
  // (y, y', D, q, r) without control, the input added.
  const auto phi = transition(kW);
  double z[5] = {0, 0, -5, 0, 3};
  double worst = 0;
  for (int k = 0; k < 6000; ++k) {
    const double u = controller.update(z[0], 1.0);
    double next[5] = {u * kT * kT / 2, u * kT, 0, 0, 0};
    for (std::size_t i = 0; i < 5; ++i) {
      for (std::size_t j = 0; j < 5; ++j) next[i] += static_cast<double>(phi[i][j]) * z[j];
    }
    std::copy(next, next + 5, z);
    if (k > 5000) worst = std::max(worst, std::abs(z[0] - 1));
  }
  return worst;
}

TEST(ResonatorModel, AdrcCancelsALoadThatSwings) {
  const double with = tracking_error<ResonatorEso<2>>({.observer = {.observer_bandwidth = 100.0,
                                                                    .input_gain = 1.0,
                                                                    .sample_time = kT,
                                                                    .model = {kW}},
                                                       .controller_bandwidth = 20.0});
  const double without = tracking_error<LinearEso<2>>(
      {.observer = {.observer_bandwidth = 100.0, .input_gain = 1.0, .sample_time = kT},
       .controller_bandwidth = 20.0});
  // u is held over the sample and the load is not: the ripple between is T w / 2 of what the load
  // does to y within a period, and the hold's delay adds as much again.
  EXPECT_LT(with, 3 / (kW * kW) * kT * kW);
  EXPECT_GT(without, 0.5 * 3 / (kW * kW));
}

// A divider that the observer would take for a gap to restart after, at every measurement.
TEST(ResonatorModel, AdrcRefusesADividerBeyondWhatTheModelBears) {
  using Controller = Adrc<ResonatorEso<2>>;
  Controller::Config config{.observer = {.observer_bandwidth = 100.0,
                                         .input_gain = 1.0,
                                         .sample_time = kT,
                                         .model = {kW}},
                            .controller_bandwidth = 20.0};
  const int most = ResonatorEso<2>::make(config.observer).value().max_gap();
  config.measurement_divider = most;
  EXPECT_TRUE(Controller::make(config));
  config.measurement_divider = most + 1;
  EXPECT_EQ(refusal(Controller::make(config)),
            "measurement_divider: must not be above the observer's max_gap, which is");
}

TEST(ResonatorModel, AnAngleIsWrapped) {
  using Eso = esokit::WrappedOutput<ResonatorEso<2>>;
  auto observer = Eso::make({.observer = {.observer_bandwidth = 100.0,
                                          .input_gain = 1.0,
                                          .sample_time = kT,
                                          .model = {kW}},
                             .period = 2 * std::acos(-1.0)})
                      .value();
  double t = 0;
  for (int k = 1; k < 4000; ++k) {
    t = k * kT;
    (void)observer.update(std::remainder(Swinging::y(t), 2 * std::acos(-1.0)), 0.0);
  }
  EXPECT_NEAR(observer.total_disturbance(), Swinging::disturbance(t), 1e-5);
}

TEST(ResonatorModel, AnalysisIsThatOfTheDenseSystem) {
  const auto observer =
      ResonatorEso<2>::make(
          {.observer_bandwidth = 100.0, .input_gain = 2.0, .sample_time = kT, .model = {kW}})
          .value();
  const auto system = esokit::observer_system(observer);
  using Complex = std::complex<long double>;
  using Square = Eigen::Matrix<Complex, 5, 5>;
  using Column = Eigen::Matrix<Complex, 5, 1>;
  const auto exact = transition(kW);
  Square phi;
  Column k;
  typename ResonatorEso<2>::State ones{};
  ones.fill(1);
  const auto units = observer.model().physical(ones);
  for (int i = 0; i < 5; ++i) {
    k(i) = static_cast<long double>(observer.level_gain(0)[size_t(i)] * units(i));
    for (int j = 0; j < 5; ++j) {
      phi(i, j) = exact[size_t(i)][size_t(j)];
    }
  }
  Column gamma = Column::Zero();
  gamma(0) = 2.0L * static_cast<long double>(kT) * static_cast<long double>(kT) / 2.0L;
  gamma(1) = 2.0L * static_cast<long double>(kT);
  Eigen::Matrix<long double, 5, 2> largest = Eigen::Matrix<long double, 5, 2>::Zero();
  Eigen::Matrix<long double, 5, 2> difference = largest;
  for (const double w : {0.5, 20.0, 314.0, 900.0, 3000.0}) {
    // zhat[k] = (I - k C) (Phi zhat[k-1] + Gamma u[k-1]) + k y[k]
    const Complex back = std::exp(Complex(0, -static_cast<long double>(w * kT)));
    Square correction = Square::Identity();
    correction.col(0) -= k;
    const Square inverse = (Square::Identity() - correction * phi * back).inverse();
    const Column of_y = inverse * k;
    const Column of_u = inverse * (correction * gamma * back);
    const auto response = esokit::frequency_response(system, w).value();
    for (int i = 0; i < 5; ++i) {
      for (int input = 0; input < 2; ++input) {
        const Complex reference = input == 0 ? of_y(i) : of_u(i);
        largest(i, input) = std::max(largest(i, input), std::abs(reference));
        difference(i, input) =
            std::max(difference(i, input), std::abs(Complex(response(i, input)) - reference));
      }
    }
  }
  for (int i = 0; i < 5; ++i) {
    for (int input = 0; input < 2; ++input) {
      EXPECT_LT(difference(i, input), 1e-11L * largest(i, input)) << i << ", " << input;
    }
  }
}

}  // namespace observer_model_seam_test
