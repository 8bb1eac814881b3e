// CascadeEso with a model: the paper's cascade written down in the states of plant, actuator,
// sensor and disturbance, what it does with what is known, gaps, and the angle.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <limits>
#include <vector>

#include <support/augmented_reference.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace observer_model_cascade_test {

using esokit::AugmentedModel;
using esokit::ModelParts;
using esokit::StepStatus;
using esokit_test::AugmentedReference;
using esokit_test::Random;
using esokit_test::reference_of;

constexpr double kT = 1e-3;
constexpr ModelParts all_parts{
    .order = 2, .plant_poles = true, .actuator = 1, .sensor = 1, .resonators = 1};
constexpr ModelParts plain_parts{.order = 2, .constants = 2};

template <ModelParts parts, int Levels>
using Cascade = esokit::ModelCascadeEso<parts, Levels>;

AugmentedModel<all_parts>::Settings all_settings() {
  return {.plant = {40.0, 5.0},
          .actuator = {0.02},
          .sensor = {0.005},
          .resonators = {{{.frequency = 60.0}}}};
}

template <int Levels>
Cascade<all_parts, Levels> make_all(double bandwidth = 80.0) {
  typename Cascade<all_parts, Levels>::Config config{.observer_bandwidth = bandwidth,
                                                     .input_gain = 2.0,
                                                     .sample_time = kT,
                                                     .model = all_settings()};
  if (Levels > 1) config.bandwidth_factor = 1.8;
  return Cascade<all_parts, Levels>::make(config).value();
}

/// The plant of all_settings, (f, y, y', v, c, q, r) and the input, sampled exactly.
struct Truth {
  static constexpr std::size_t size = 7;
  explicit Truth(const AugmentedReference& reference) : step(reference.natural_step(kT)) {}

  esokit_test::Table step;
  std::array<long double, size> x{};

  /// x one sample ahead of `from`.
  [[nodiscard]] std::array<long double, size> ahead(const std::array<long double, size>& from,
                                                    long double u) const {
    std::array<long double, size> next = from;
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) next[i] += step[i][j] * from[j];
      next[i] += step[i][size] * u;
    }
    return next;
  }
};
constexpr std::size_t first_disturbance = 4;

/// Equations (23), (24) with the model in the place of the chain: level i is driven by u and what
/// the levels below it have found, each level estimates a plant, an actuator, a sensor and a
/// disturbance of its own.
template <int Levels>
struct PapersCascade {
  using Model = AugmentedModel<all_parts>;
  AugmentedReference reference = reference_of<all_parts>(all_settings(), 2.0);
  Truth plant{reference};
  esokit_test::Table published = reference.published();
  esokit::Array<std::array<long double, Truth::size>, Levels> gains{};
  esokit::Array<std::array<long double, Truth::size>, Levels> z{};

  explicit PapersCascade(const Cascade<all_parts, Levels>& observer) {
    for (int i = 0; i < Levels; ++i) {
      const auto physical = observer.model().physical(observer.level_gain(i));
      std::vector<long double> column(Truth::size);
      for (int row = 0; row < Model::size; ++row) {
        column[static_cast<std::size_t>(Model::state_of_row(row))] =
            static_cast<long double>(physical(row));
      }
      const auto natural = reference.natural(column);
      std::copy(natural.begin(), natural.end(), gains[static_cast<std::size_t>(i)].begin());
    }
  }

  void update(long double y, long double u) {
    std::array<long double, Truth::size> below{};  // found so far, before this sample
    esokit::Array<std::array<long double, Truth::size>, Levels> next{};
    for (std::size_t i = 0; i < Levels; ++i) {
      auto driven = z[i];
      for (std::size_t r = first_disturbance; r < Truth::size; ++r) driven[r] += below[r];
      const auto of_plant = plant.ahead(driven, u);
      next[i] = plant.ahead(z[i], u);
      for (std::size_t r = 0; r < first_disturbance; ++r) next[i][r] = of_plant[r];
      for (std::size_t r = first_disturbance; r < Truth::size; ++r) below[r] += z[i][r];
    }
    z = next;
    long double measured = y;
    for (std::size_t i = 0; i < Levels; ++i) {
      const long double e = measured - z[i][0];
      for (std::size_t r = 0; r < Truth::size; ++r) z[i][r] += gains[i][r] * e;
      measured = z[i][0];
    }
  }

  /// The rows that the library publishes of level `level`.
  [[nodiscard]] std::array<double, Truth::size> estimate(std::size_t level) const {
    auto sum = z[level];
    for (std::size_t i = 0; i < level; ++i) {
      for (std::size_t r = first_disturbance; r < Truth::size; ++r) sum[r] += z[i][r];
    }
    std::array<double, Truth::size> rows{};
    for (int row = 0; row < Model::size; ++row) {
      const auto state = static_cast<std::size_t>(Model::state_of_row(row));
      long double value = 0;
      for (std::size_t j = 0; j < Truth::size; ++j) {
        value += published[state][j] * sum[j];
      }
      rows[static_cast<std::size_t>(row)] = static_cast<double>(value);
    }
    return rows;
  }
};

TEST(ModelCascade, IsThePapersWithTheModelInThePlaceOfTheChain) {
  constexpr int levels = 3;
  auto observer = make_all<levels>();
  PapersCascade<levels> paper(observer);
  Random random(3);
  std::array<double, 7> largest{};
  for (int k = 0; k < 400; ++k) {
    const double y = std::sin(0.02 * k) + random.uniform(-0.01, 0.01);
    const double u = random.uniform(-1, 1);
    ASSERT_EQ(observer.update(y, u), StepStatus::ok);
    paper.update(static_cast<long double>(y), static_cast<long double>(u));
    for (std::size_t level = 0; level < levels; ++level) {
      const auto rows = paper.estimate(level);
      const auto estimate = observer.level_estimate(static_cast<int>(level));
      for (std::size_t r = 0; r < rows.size(); ++r) {
        largest[r] = std::max(largest[r], std::abs(rows[r]));
        ASSERT_NEAR(estimate(static_cast<int>(r)), rows[r], 1e-10 * largest[r])
            << k << " level " << level << " row " << r;
      }
    }
  }
}

TEST(ModelCascade, OfAChainIsTheChains) {
  auto model =
      Cascade<plain_parts, 3>::make(
          {.observer_bandwidth = 50, .bandwidth_factor = 1.7, .input_gain = 2, .sample_time = kT})
          .value();
  auto chain =
      esokit::CascadeEso<2, 3, double, 2>::make(
          {.observer_bandwidth = 50, .bandwidth_factor = 1.7, .input_gain = 2, .sample_time = kT})
          .value();
  const auto same = [&] {
    for (int level = 0; level < 3; ++level) {
      const auto a = model.level_estimate(level);
      const auto b = chain.level_estimate(level);
      for (int i = 0; i < 4; ++i) {
        if (!(std::abs(a(i) - b(i)) <= 1e-11 * std::pow(300.0, i))) return false;
      }
    }
    return true;
  };
  for (int k = 0; k < 1000; ++k) {
    const double y = std::sin(0.03 * k);
    const double u = std::cos(0.05 * k);
    ASSERT_EQ(model.update(y, u), chain.update(y, u));
    if (k == 300) {
      ASSERT_EQ(model.shift_output(0.5), chain.shift_output(0.5));
      ASSERT_EQ(model.shift_disturbance(3.0), chain.shift_disturbance(3.0));
      ASSERT_EQ(model.revise_input(0.7), chain.revise_input(0.7));
    }
    if (k == 400) {
      const esokit::Vector<double, 4> state(0.1, 2.0, -3.0, 4.0);
      ASSERT_EQ(model.reset(state), chain.reset(state));
    }
    if (k == 500) {  // what b0 no longer explains is the disturbance's
      ASSERT_TRUE(model.retune({.observer_bandwidth = 60,
                                .bandwidth_factor = 1.5,
                                .input_gain = 3,
                                .sample_time = kT / 2}));
      ASSERT_TRUE(chain.retune({.observer_bandwidth = 60,
                                .bandwidth_factor = 1.5,
                                .input_gain = 3,
                                .sample_time = kT / 2}));
    }
    ASSERT_TRUE(same()) << k;
  }
}

TEST(ModelCascade, WhatFollowsTheModelIsEstimatedToRounding) {
  auto observer = make_all<2>();
  Truth truth(reference_of<all_parts>(all_settings(), 2.0));
  Random random(5);
  // A known actuator under a known input, at rest at first: nothing is left to estimate.
  for (int k = 0; k < 500; ++k) {
    const double u = random.uniform(-5, 5);
    truth.x = truth.ahead(truth.x, static_cast<long double>(u));
    ASSERT_EQ(observer.update(static_cast<double>(truth.x[0]), u), StepStatus::ok);
    ASSERT_NEAR(observer.estimate()(1), static_cast<double>(truth.x[2]), 1e-11) << k;
    ASSERT_NEAR(observer.model().constant(observer.estimate()), 0.0, 1e-7) << k;
  }
  // Then a load and a swing.
  truth.x[4] = 3;
  truth.x[5] = 2;
  for (int k = 0; k < 3000; ++k) {
    const double u = random.uniform(-5, 5);
    truth.x = truth.ahead(truth.x, static_cast<long double>(u));
    ASSERT_EQ(observer.update(static_cast<double>(truth.x[0]), u), StepStatus::ok);
  }
  using Model = AugmentedModel<all_parts>;
  EXPECT_NEAR(observer.estimate()(0), static_cast<double>(truth.x[1]), 1e-11);
  EXPECT_NEAR(observer.model().constant(observer.estimate()), 3.0, 1e-6);
  EXPECT_NEAR(Model::sinusoidal_disturbance(observer.estimate(), 0).amplitude, 2.0, 1e-6);
  EXPECT_NEAR(Model::measured(observer.estimate()), static_cast<double>(truth.x[0]), 1e-11);
}

/// Of dhat for white noise of 1, from the impulse response.
template <class Observer>
double noise(Observer observer) {
  double sum = 0;
  for (int k = 0; k < 1000; ++k) {
    EXPECT_EQ(observer.update(k == 0 ? 1.0 : 0.0, 0.0), StepStatus::ok);
    const double found = observer.model().constant(observer.estimate());
    sum += found * found;
  }
  return std::sqrt(sum);
}

constexpr ModelParts lag_parts{.order = 2, .plant_poles = true, .actuator = 1, .sensor = 1};

template <int Levels>
Cascade<lag_parts, Levels> make_lags(double bandwidth) {
  typename Cascade<lag_parts, Levels>::Config config{
      .observer_bandwidth = bandwidth,
      .input_gain = 2.0,
      .sample_time = kT,
      .model = {.plant = {40.0, 5.0}, .actuator = {0.02}, .sensor = {0.005}}};
  if (Levels > 1) config.bandwidth_factor = 1.8;
  return Cascade<lag_parts, Levels>::make(config).value();
}

TEST(ModelCascade, PassesLessNoiseThanOneLevelOfItsLastBandwidth) {
  // As of the chain, where two levels pass 0.8 to 0.9 of what one does.
  EXPECT_LT(noise(make_lags<2>(80.0)), 0.95 * noise(make_lags<1>(80.0 * 1.8)));
  EXPECT_GT(noise(make_lags<2>(80.0)), noise(make_lags<1>(80.0)));
}

/// Largest error of the total disturbance where the swing is 2 % beside its model.
template <class Observer>
double error_beside(Observer observer) {
  const double w = 1.02 * 60.0;
  Truth truth(reference_of<all_parts>({.plant = {40.0, 5.0},
                                       .actuator = {0.02},
                                       .sensor = {0.005},
                                       .resonators = {{{.frequency = w}}}},
                                      2.0));
  truth.x[5] = 1;
  double most = 0;
  for (int k = 0; k < 4000; ++k) {
    truth.x = truth.ahead(truth.x, 0.0L);
    EXPECT_EQ(observer.update(static_cast<double>(truth.x[0]), 0.0), StepStatus::ok);
    const auto z = observer.estimate();
    const double q = observer.model().constant(z) + z(4);
    if (k > 3000) most = std::max(most, std::abs(q - static_cast<double>(truth.x[5])));
  }
  return most;
}

TEST(ModelCascade, LevelsFindTogetherASwingBesideItsFrequency) {
  // Each level has the resonator, as what the first one leaves swings, too.
  EXPECT_LT(error_beside(make_all<2>(80.0)), 0.4 * error_beside(make_all<1>(80.0 * 1.8)));
  EXPECT_LT(noise(make_all<2>(80.0)), 1.5 * noise(make_all<1>(80.0 * 1.8)));
}

TEST(ModelCascade, ItsSystemIsTheObserver) {
  auto observer = make_all<2>();
  const auto system = esokit::observer_system(observer);
  Eigen::VectorXd state = Eigen::VectorXd::Zero(14);
  for (int k = 0; k < 60; ++k) {
    const Eigen::Vector2d input(std::sin(0.3 * k), std::cos(0.2 * k));
    ASSERT_EQ(observer.correct(input(0)), StepStatus::ok);
    const Eigen::VectorXd output = system.c * state + system.d * input;
    for (int i = 0; i < 7; ++i) {
      ASSERT_NEAR(output(i), observer.estimate()(i), 1e-9 * (1 + std::abs(observer.estimate()(i))))
          << k << " row " << i;
    }
    state = (state + system.a * state + system.b * input).eval();
    ASSERT_EQ(observer.predict(input(1)), StepStatus::ok);
  }
}

TEST(ModelCascade, PreviewIsTheComingCorrection) {
  auto observer = make_all<3>();
  Random random(7);
  for (int k = 0; k < 50; ++k) {
    ASSERT_EQ(observer.predict(random.uniform(-1, 1)), StepStatus::ok);
    const auto preview = observer.preview();
    const double y = random.uniform(-1, 1);
    ASSERT_EQ(observer.correct(y), StepStatus::ok);
    const auto estimate = observer.estimate();
    // Rows in scaled states: told by the rows that are theirs.
    auto rows = [&]<int... Row>(std::integer_sequence<int, Row...>) {
      return std::array{observer.template scaled_estimate<Row>()...};
    }
    (std::make_integer_sequence<int, 7>{});
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double told = preview.offset[i] + preview.slope[i] * y;
      ASSERT_NEAR(told, rows[i], 1e-12 * (1 + std::abs(rows[i]))) << k << " row " << i;
    }
    ASSERT_NEAR(estimate(0), rows[0], 0.0);
  }
}

// ---- Gaps: one correction in M for ever, and random patterns.

template <class Observer>
void gaps_decay(const Observer& made) {
  ASSERT_GE(made.max_gap(), 4);
  const auto size = [&](const Observer& o) {
    const auto x = o.model().scaled(o.estimate());
    double most = 0;
    for (const double v : x) most = std::max(most, std::abs(v));
    return most;
  };
  typename Observer::State ones;
  ones.fill(1.0);
  for (int every = 2; every <= made.max_gap() + 1; ++every) {
    Observer observer = made;
    ASSERT_EQ(observer.reset(observer.model().physical(ones)), StepStatus::ok);
    int corrections = 0;
    for (; corrections < 20000 && size(observer) > 1e-9; ++corrections) {
      for (int i = 0; i < every; ++i) ASSERT_EQ(observer.predict(0.0), StepStatus::ok);
      ASSERT_EQ(observer.correct(0.0), StepStatus::gap_bridged);
    }
    EXPECT_LT(corrections, 20000) << "every " << every;
  }
  Random random(11);
  Observer observer = made;
  ASSERT_EQ(observer.reset(observer.model().physical(ones)), StepStatus::ok);
  int corrections = 0;
  for (; corrections < 20000 && size(observer) > 1e-9; ++corrections) {
    const int every = 1 + static_cast<int>(random.uniform(0, made.max_gap() + 0.999));
    for (int i = 0; i < every; ++i) ASSERT_EQ(observer.predict(0.0), StepStatus::ok);
    ASSERT_EQ(observer.correct(0.0), every > 1 ? StepStatus::gap_bridged : StepStatus::ok);
  }
  EXPECT_LT(corrections, 20000) << "at random";
  while (observer.recovering() > 0) (void)observer.update(0.0, 0.0);
  for (int i = 0; i < made.max_gap() + 2; ++i) (void)observer.predict(0.0);
  EXPECT_EQ(observer.correct(0.0),
            made.longest_gap() > made.max_gap() ? StepStatus::gap_bridged : StepStatus::restarted);
  for (int i = 0; i < made.longest_gap() + 2; ++i) (void)observer.predict(0.0);
  EXPECT_EQ(observer.correct(0.0), StepStatus::restarted);
}

TEST(ModelCascade, EveryGapThatIsBridgedLetsErrorsDecay) { gaps_decay(make_all<2>()); }

// ---- A whole plant.

TEST(ModelCascade, OfAWholePlantIsThatOfItsPoles) {
  constexpr ModelParts poles{.order = 2, .plant_poles = true, .sensor = 1};
  auto parts = Cascade<poles, 2>::make({.observer_bandwidth = 50,
                                        .bandwidth_factor = 1.7,
                                        .input_gain = 2,
                                        .sample_time = kT,
                                        .model = {.plant = {40.0, 5.0}, .sensor = {0.005}}})
                   .value();
  const auto plant =
      esokit::LinearPlant<2>::chain({.coefficients = {40.0, 5.0}, .input_gain = 2.0}).value();
  using Whole = esokit::PlantCascadeEso<2, ModelParts{.order = 2, .sensor = 1}, 2>;
  auto whole = Whole::make({.observer_bandwidth = 50,
                            .bandwidth_factor = 1.7,
                            .input_gain = 2,
                            .sample_time = kT,
                            .model = {.plant = plant, .sensor = {0.005}}})
                   .value();
  for (int k = 0; k < 1000; ++k) {
    const double y = std::sin(0.03 * k);
    const double u = std::cos(0.05 * k);
    ASSERT_EQ(parts.update(y, u), whole.update(y, u));
    for (int level = 0; level < 2; ++level) {
      for (int i = 0; i < 4; ++i) {
        ASSERT_NEAR(parts.level_estimate(level)(i), whole.level_estimate(level)(i),
                    1e-9 * std::pow(200.0, i))
            << k << " level " << level << " row " << i;
      }
    }
  }
}

/// A zero, and a load that enters elsewhere than u, with a swing.
TEST(ModelCascade, OfAWholePlantSharesItsDisturbanceAlone) {
  esokit::LinearPlant<3> plant;
  plant.a = {{-3, 1, 0}, {0, -5, 1}, {0, 0, -2}};
  plant.b = {0, 1, 4};
  plant.c = {1, 0, 0};
  plant.e = {1, 0, 2};
  using Whole = esokit::PlantCascadeEso<3, ModelParts{.order = 2, .sensor = 1, .resonators = 1}, 2>;
  const Whole::Config config{
      .observer_bandwidth = 60,
      .bandwidth_factor = 1.8,
      .input_gain = plant.input_gain(),
      .sample_time = kT,
      .model = {.plant = plant, .sensor = {0.005}, .resonators = {{{.frequency = 40.0}}}}};
  auto observer = Whole::make(config).value();
  const auto& model = observer.model();
  Random random(13);
  for (int trial = 0; trial < 20; ++trial) {
    Whole::State x{};
    for (double& element : x) element = random.uniform(-1, 1);
    const auto part = model.physical(model.disturbance_part(x));
    const auto whole = model.physical(x);
    // d is all there, x is not, nor what the sensor shows.
    EXPECT_NEAR(model.disturbance(part), model.disturbance(whole),
                1e-9 * std::abs(model.disturbance(whole)));
    EXPECT_EQ(part(0), 0.0);
    EXPECT_EQ(model.measured(part), 0.0);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(model.plant_state(part)(i), 0.0, 1e-9 * std::abs(model.plant_state(whole)(i)))
          << i;
    }
  }
  gaps_decay(observer);
}

// ---- Whatever the plant's poles, y may be counted from elsewhere.

TEST(ModelCascade, AnAngleWithKnownPolesAndASensorIsWrapped) {
  auto free = make_all<2>();
  auto wrapped =
      esokit::WrappedOutput<Cascade<all_parts, 2>>::make({.observer = {.observer_bandwidth = 80.0,
                                                                       .bandwidth_factor = 1.8,
                                                                       .input_gain = 2.0,
                                                                       .sample_time = kT,
                                                                       .model = all_settings()},
                                                          .period = 1.0})
          .value();
  ASSERT_EQ(free.reset(0.0), wrapped.reset(0.0));
  for (int k = 0; k < 2000; ++k) {
    const double y = 0.013 * k;
    const double u = std::sin(0.01 * k);
    ASSERT_EQ(wrapped.update(y - std::floor(y), u), free.update(y, u)) << k;
    const auto a = wrapped.estimate();
    const auto b = free.estimate();
    ASSERT_NEAR(a(0), b(0) - std::round(b(0)), 1e-10);
    // What a law cancels does not jump with the turn.
    ASSERT_NEAR(wrapped.total_disturbance(), free.total_disturbance(), 1e-5) << k;
    for (int i = 1; i < 3; ++i) ASSERT_NEAR(a(i), b(i), 1e-7) << k << " row " << i;
  }
}

}  // namespace observer_model_cascade_test
