// Plant, actuator, sensor and disturbances in one model: sampled exactly, its poles where they were
// asked for, equal to the chain where it is one, and refused where its numbers make no sense.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/model_eso.hpp>
#include <limits>
#include <random>

#include <support/augmented_reference.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace model_augmented_model_test {

using esokit::AugmentedModel;
using esokit::LinearEso;
using esokit::ModelEso;
using esokit::ModelParts;
using esokit::SampledModel;
using esokit::StepStatus;
using esokit_test::AugmentedReference;
using esokit_test::Poles;
using esokit_test::reference_of;
using esokit_test::refusal;

constexpr double kT = 1e-3;

constexpr ModelParts chain_parts{.order = 2, .constants = 2};
constexpr ModelParts lag_parts{.order = 1, .actuator = 1};
constexpr ModelParts poles_parts{.order = 2, .plant_poles = true};
constexpr ModelParts sensor_parts{.order = 2, .sensor = 1};
constexpr ModelParts swing_parts{.order = 2, .resonators = 2};
constexpr ModelParts fading_parts{.order = 1, .first_order = 1};
constexpr ModelParts all_parts{.order = 2,
                               .plant_poles = true,
                               .actuator = 2,
                               .sensor = 2,
                               .constants = 3,
                               .resonators = 1,
                               .first_order = 1};

template <ModelParts parts>
using Settings = typename AugmentedModel<parts>::Settings;

static_assert(SampledModel<AugmentedModel<chain_parts>, double> &&
              SampledModel<AugmentedModel<all_parts, float>, float>);
static_assert(esokit::LoopObserver<ModelEso<all_parts>> &&
              esokit::PredictableObserver<ModelEso<swing_parts, float>>);

// ---- Sampling.

/// Largest error of a row of Phi - I or Gamma, against the row's largest element, scaled as the
/// model is.
template <ModelParts parts>
double sampling_error(const Settings<parts>& settings, double time) {
  using Model = AugmentedModel<parts>;
  constexpr int N = Model::size;
  const Model model = Model::make(settings, -2.5, time).value();
  const auto exact = reference_of<parts>(settings, -2.5).step(time);
  const auto unit = [&](int state) {
    long double factor = 1;
    for (int j = 1; j <= Model::degree(state); ++j) factor *= static_cast<long double>(time) / j;
    return factor;
  };
  const auto step = model.increment();
  const auto gamma = model.add_input({}, 1.0);
  double worst = 0;
  for (int i = 0; i < N; ++i) {
    long double largest = 0;
    long double error = 0;
    const auto compare = [&](long double reference, double got) {
      largest = std::max(largest, std::abs(reference));
      error = std::max(error, std::abs(reference - static_cast<long double>(got)));
    };
    for (int j = 0; j < N; ++j) {
      compare(exact[size_t(i)][size_t(j)] * unit(i) / unit(j), step(i, j));
    }
    compare(exact[size_t(i)][size_t(N)] * unit(i), gamma[size_t(i)]);
    if (largest > 0) worst = std::max(worst, static_cast<double>(error / largest));
  }
  return worst;
}

// The poles of a swing go where they are asked to, or to its own frequency.
TEST(Resonance, PolesGoToTheCaptureBandwidth) {
  const std::array<esokit::Resonance<double>, 2> swings{{{50.0, 0.0, 5.0}, {80.0, 0.1, 0.0}}};
  const auto pairs = esokit::detail::own_pairs(swings);
  EXPECT_EQ(pairs[0][0], -5.0);
  EXPECT_EQ(pairs[0][1], 50.0);
  EXPECT_EQ(pairs[1][0], -80.0);
  EXPECT_EQ(pairs[1][1], 80.0);
}

// 1e-13 is asked for; squaring a norm of 1e4 fourteen times doubles the rounding as often.
TEST(AugmentedModel, IsSampledExactly) {
  EXPECT_LT(sampling_error<chain_parts>({}, kT), 1e-15);
  for (const double tau : {1e-5, 1e-3, 2e-2, 50.0}) {
    EXPECT_LT(sampling_error<lag_parts>({.actuator = {tau}}, kT), 1e-13) << tau;
    EXPECT_LT(sampling_error<sensor_parts>({.sensor = {tau}}, kT), 1e-13) << tau;
    EXPECT_LT(sampling_error<fading_parts>({.first_order = {tau}}, kT), 1e-13) << tau;
  }
  for (const double w : {0.1, 314.0, 3000.0}) {
    EXPECT_LT(sampling_error<swing_parts>({.resonators = {{{w}, {0.5 * w, 0.2}}}}, kT), 1e-13) << w;
    EXPECT_LT(sampling_error<poles_parts>({.plant = {w * w, 0.3 * w}}, kT), 1e-13) << w;
    EXPECT_LT(sampling_error<poles_parts>({.plant = {-w * w, 0.0}}, kT), 1e-13) << w;
  }
  // Spread by 1e7, and a fast lag behind a slow one.
  for (const auto& [fast, slow] :
       {std::pair(1e5, 0.1), std::pair(0.1, 1e5), std::pair(200.0, 90.0)}) {
    EXPECT_LT(sampling_error<all_parts>({.plant = {40.0, -3.0},
                                         .actuator = {fast, 0.4},
                                         .sensor = {slow, 1.0},
                                         .resonators = {{{700.0, 0.01}}},
                                         .first_order = {0.3}},
                                        kT),
              1e-13)
        << fast << ", " << slow;
  }
}

// ---- Poles.

/// omega_o T and everything else of it, as far as the rules go.
template <ModelParts parts>
void poles_are_placed(double tolerance, const std::vector<double>& speeds) {
  for (const double product : {1e-3, 1e-2, 0.1, 1.0, 10.0}) {
    for (const double speed : speeds) {
      const double bandwidth = product / kT;
      const double rate = speed * bandwidth;
      if (rate * kT > 75) continue;
      Settings<parts> settings{};
      Poles poles(static_cast<std::size_t>(parts.order + parts.constants + parts.first_order),
                  std::complex<long double>(-static_cast<long double>(bandwidth), 0));
      const auto add = [&](const Poles& more) {
        poles.insert(poles.end(), more.begin(), more.end());
      };
      if constexpr (parts.plant_poles) {
        for (int i = 0; i < parts.order; ++i) {
          settings.plant[size_t(i)] = std::pow(0.5 * bandwidth, parts.order - i);
        }
      }
      if constexpr (parts.actuator == 1) settings.actuator = {1 / rate};
      if constexpr (parts.actuator == 2) settings.actuator = {rate, 0.5};
      add(esokit_test::poles_of(settings.actuator));
      if constexpr (parts.sensor > 0) {
        if constexpr (parts.sensor == 1) settings.sensor = {1 / (1.1 * rate)};
        if constexpr (parts.sensor == 2) settings.sensor = {1.1 * rate, 1.2};
        add(1.1 * speed > 1
                ? esokit_test::poles_of(settings.sensor)
                : Poles(size_t(parts.sensor), {-static_cast<long double>(bandwidth), 0}));
      }
      bool below_nyquist = true;
      for (int c = 0; c < parts.resonators; ++c) {
        const double w = rate * (c + 1);
        below_nyquist = below_nyquist && w * kT < 3;
        settings.resonators[size_t(c)].frequency = w;
        const auto wide = static_cast<long double>(w);
        add({{-wide, wide}, {-wide, -wide}});
      }
      for (int c = 0; c < parts.first_order; ++c)
        settings.first_order[size_t(c)] = 3 / bandwidth * (c + 1);
      if (!below_nyquist) continue;
      SCOPED_TRACE(::testing::Message() << "omega_o T " << product << ", rate / omega_o " << speed);
      const auto observer = ModelEso<parts>::make({.observer_bandwidth = bandwidth,
                                                   .input_gain = 1.0,
                                                   .sample_time = kT,
                                                   .model = settings});
      ASSERT_TRUE(observer) << observer.error();
      EXPECT_LT(
          esokit_test::worst_coefficient(*observer, reference_of<parts>(settings, 1.0), poles),
          tolerance);
    }
  }
}

// 1e-9 is asked for, for N to 8.
TEST(AugmentedModel, PutsThePolesWhereAsked) {
  poles_are_placed<chain_parts>(1e-11, {1});
  poles_are_placed<lag_parts>(1e-11, {0.1, 1, 9});
  poles_are_placed<poles_parts>(1e-11, {1});
  poles_are_placed<sensor_parts>(1e-11, {0.1, 0.9, 1, 9, 90});
  poles_are_placed<swing_parts>(1e-10, {0.1, 0.3, 1, 3, 10});
  poles_are_placed<fading_parts>(1e-11, {1});
  poles_are_placed<ModelParts{.order = 3, .actuator = 1, .constants = 2, .resonators = 1}>(
      1e-9, {0.1, 1, 9});
  poles_are_placed<ModelParts{
      .order = 2, .plant_poles = true, .actuator = 2, .sensor = 2, .first_order = 1}>(1e-9,
                                                                                      {0.3, 1, 9});
}

TEST(AugmentedModel, InFloatDecaysWithinAQuarterOrIsRefused) {
  constexpr ModelParts parts{.order = 2, .sensor = 1, .resonators = 1};
  int made = 0;
  for (const double product : {1e-3, 1e-2, 0.1, 1.0}) {
    for (const double speed : {0.3, 1.0, 2.5}) {
      const double w = speed * product / kT;
      ModelEso<parts, float>::Config config{
          .observer_bandwidth = float(product / kT),
          .input_gain = 1.0F,
          .sample_time = float(kT),
          .model = {.sensor = {float(3 / w)}, .resonators = {{{float(w)}}}}};
      const auto observer = ModelEso<parts, float>::make(config);
      if (!observer) {
        EXPECT_EQ(refusal(observer),
                  "observer_bandwidth: gives poles that the scalar cannot place for this model");
        continue;
      }
      ++made;
      // The error decays by the slowest of its poles: of the last of 40 / (omega T) samples.
      auto copy = *observer;
      (void)copy.reset(1.0F);
      const double slowest = std::min(product, w * kT);
      const auto size = [&] {
        double sum = 0;
        for (const float x : copy.model().scaled(copy.estimate())) sum += std::abs(double(x));
        return sum;
      };
      const int first = static_cast<int>(20 / slowest);
      const int last = static_cast<int>(30 / slowest);
      for (int k = 0; k < first; ++k) (void)copy.update(0.0F, 0.0F);
      const double before = size();
      for (int k = first; k < last; ++k) (void)copy.update(0.0F, 0.0F);
      // Equal poles have powers of k beside e^(-k): (30 / 20)^3 at most.
      const double decay = std::log(before / size()) / (10 / slowest) / slowest;
      EXPECT_GT(decay, 0.75 - 0.122) << product << ", " << speed;
      EXPECT_LT(decay, 1.25) << product << ", " << speed;
    }
  }
  EXPECT_GE(made, 8);
}

// ---- It is the chain where nothing else is known.

TEST(AugmentedModel, AChainEqualsLinearEso) {
  for (const double product : {1e-2, 0.3, 3.0}) {
    auto model = ModelEso<chain_parts>::make(
                     {.observer_bandwidth = product / kT, .input_gain = 3.0, .sample_time = kT})
                     .value();
    auto chain = LinearEso<2, double, 2>::make(
                     {.observer_bandwidth = product / kT, .input_gain = 3.0, .sample_time = kT})
                     .value();
    std::mt19937 random(3);
    std::normal_distribution<> normal;
    double largest[4] = {};
    for (int k = 0; k < 2000; ++k) {
      const double y = normal(random);
      const double u = normal(random);
      (void)model.update(y, u);
      (void)chain.update(y, u);
      for (int i = 0; i < 4; ++i) {
        largest[i] = std::max(largest[i], std::abs(chain.estimate()(i)));
        ASSERT_NEAR(model.estimate()(i), chain.estimate()(i), 1e-12 * largest[i]) << k << " " << i;
      }
    }
  }
}

// ---- What it estimates.

/// The system of a reference, from a state of its own, sampled at T in long double.
class Truth {
 public:
  explicit Truth(const AugmentedReference& reference)
      : step_(reference.natural_step(kT)), published_(reference.published()), x_(reference.size) {}

  long double& operator[](std::size_t i) { return x_[i]; }
  void advance(double u) {
    const std::size_t n = x_.size();
    std::vector<long double> next = x_;
    for (std::size_t i = 0; i < n; ++i) {
      next[i] += step_[i][n] * static_cast<long double>(u);
      for (std::size_t j = 0; j < n; ++j) next[i] += step_[i][j] * x_[j];
    }
    x_ = next;
  }
  [[nodiscard]] double measured() const { return static_cast<double>(x_[0]); }
  /// The library's state `i` in physical units.
  [[nodiscard]] double published(std::size_t i) const {
    long double sum = 0;
    for (std::size_t j = 0; j < x_.size(); ++j) sum += published_[i][j] * x_[j];
    return static_cast<double>(sum);
  }

 private:
  esokit_test::Table step_, published_;
  std::vector<long double> x_;
};

TEST(AugmentedModel, WhatFollowsTheModelIsEstimatedToRounding) {
  constexpr ModelParts parts{.order = 1,
                             .plant_poles = true,
                             .actuator = 1,
                             .sensor = 1,
                             .constants = 2,
                             .resonators = 1,
                             .first_order = 1};
  const Settings<parts> settings{.plant = {12.0},
                                 .actuator = {0.02},
                                 .sensor = {0.004},
                                 .resonators = {{{150.0, 0.001}}},
                                 .first_order = {0.5}};
  const AugmentedReference reference = reference_of<parts>(settings, 2.0);
  Truth truth(reference);
  truth[reference.c] = 3;
  truth[reference.c + 1] = 0.5;
  truth[reference.q] = 1;
  truth[reference.fade] = -4;
  auto observer =
      ModelEso<parts>::make(
          {.observer_bandwidth = 120.0, .input_gain = 2.0, .sample_time = kT, .model = settings})
          .value();
  const auto& model = observer.model();
  for (int k = 0; k < 3000; ++k) {
    const double u = std::sin(0.02 * k);
    truth.advance(u);
    ASSERT_EQ(observer.update(truth.measured(), u), StepStatus::ok);
    if (k < 1500) continue;
    const auto z = observer.estimate();
    double largest = 0;
    for (int row = 0; row < observer.size; ++row) largest = std::max(largest, std::abs(z(row)));
    for (int row = 0; row < observer.size; ++row) {
      // A rounding of y, 1e-16, comes out of the gain of the highest row, 1e9.
      ASSERT_NEAR(z(row), truth.published(size_t(model.state_of_row(row))), 1e-6)
          << k << " " << row;
    }
    const auto swing = model.sinusoidal_disturbance(z, 0);
    ASSERT_NEAR(swing.amplitude * std::sin(swing.phase), static_cast<double>(truth[reference.q]),
                1e-7);
    ASSERT_NEAR(model.constant(z), static_cast<double>(truth[reference.c]), 1e-7);
    ASSERT_NEAR(model.first_order_disturbance(z, 0), static_cast<double>(truth[reference.fade]),
                1e-7);
    ASSERT_NEAR(model.measured(z), truth.measured(), 1e-12);
  }
}

TEST(AugmentedModel, RestIsWhereThePlantStands) {
  const Settings<all_parts> settings{.plant = {40.0, 3.0},
                                     .actuator = {200.0},
                                     .sensor = {300.0},
                                     .resonators = {{{700.0}}},
                                     .first_order = {0.3}};
  auto observer =
      ModelEso<all_parts>::make(
          {.observer_bandwidth = 200.0, .input_gain = -2.0, .sample_time = kT, .model = settings})
          .value();
  ASSERT_EQ(observer.reset(observer.equilibrium(5.0, 0.7)), StepStatus::ok);
  const auto before = observer.estimate();
  EXPECT_EQ(before(0), 5.0);
  EXPECT_EQ(observer.model().measured(before), 5.0);
  // b0 v = 2 * 0.7, and the spring pulls: what the constant has to be.
  EXPECT_NEAR(observer.model().constant(before), 2.0 * 0.7 + 40.0 * 5.0, 1e-9);
  for (int k = 0; k < 100; ++k) (void)observer.update(5.0, 0.7);
  for (int i = 0; i < observer.size; ++i) {
    EXPECT_NEAR(observer.estimate()(i), before(i), 1e-9 * (1 + std::abs(before(4)))) << i;
  }
  // y alone: no disturbance is assumed beside what holds it there.
  ASSERT_EQ(observer.reset(3.0), StepStatus::ok);
  EXPECT_EQ(observer.estimate()(0), 3.0);
  EXPECT_EQ(observer.model().measured(observer.estimate()), 3.0);
  EXPECT_EQ(observer.total_disturbance(), 0.0);
}

TEST(AugmentedModel, RetuningKeepsTheEstimate) {
  constexpr ModelParts parts{.order = 1, .actuator = 1, .sensor = 1};
  ModelEso<parts>::Config config{.observer_bandwidth = 100.0,
                                 .input_gain = 2.0,
                                 .sample_time = kT,
                                 .model = {.actuator = {0.02}, .sensor = {0.005}}};
  auto observer = ModelEso<parts>::make(config).value();
  for (int k = 0; k < 300; ++k) (void)observer.update(std::sin(0.03 * k), 0.5);
  const auto before = observer.estimate();
  config.sample_time = 2 * kT;
  config.observer_bandwidth = 150.0;
  config.model.sensor.time_constant = 0.003;
  ASSERT_TRUE(observer.retune(config));
  for (int i = 0; i < observer.size; ++i) {
    EXPECT_NEAR(observer.estimate()(i) / before(i), 1.0, 1e-12) << i;
  }
  // Another lag is another b = b0 / tau: what u no longer explains goes into D.
  config.model.actuator.time_constant = 0.03;
  ASSERT_TRUE(observer.retune(config));
  EXPECT_NEAR(observer.total_disturbance(), before(2) + (2.0 / 0.02 - 2.0 / 0.03) * 0.5,
              1e-9 * std::abs(before(2)));
}

// ---- Gaps.

template <class Observer, class Missing>
double error_after(Observer observer, Missing&& missing, int samples) {
  EXPECT_EQ(observer.reset(1e3), StepStatus::ok);
  for (int k = 1; k < samples; ++k) {
    (void)observer.predict(0.0);
    if (!missing(k)) {
      EXPECT_NE(observer.correct(0.0), StepStatus::restarted);
    }
  }
  double worst = 0;
  for (const double x : observer.model().scaled(observer.estimate())) {
    worst = std::max(worst, std::abs(x));
  }
  return worst;
}

TEST(AugmentedModel, EveryGapThatIsBridgedLetsErrorsDecay) {
  constexpr ModelParts parts{.order = 1, .actuator = 1, .sensor = 1, .resonators = 1};
  std::mt19937 random(7);
  for (const double bandwidth : {60.0, 300.0}) {
    for (const double w : {31.4, 314.0}) {
      const auto observer =
          ModelEso<parts>::make(
              {.observer_bandwidth = bandwidth,
               .input_gain = 1.0,
               .sample_time = kT,
               .model = {.actuator = {0.01}, .sensor = {0.005}, .resonators = {{{w}}}}})
              .value();
      EXPECT_GE(observer.max_gap(), 4) << bandwidth << ", " << w;
      for (const int missing : esokit_test::lengths(1, observer.max_gap())) {
        const auto pattern = [&](int k) { return k % (missing + 1) != 0; };
        EXPECT_LT(error_after(observer, pattern, 200000), 1e-3)
            << bandwidth << " rad/s, w " << w << ", " << missing << " missing";
      }
      int row = 0;
      const auto at_random = [&](int) {
        const bool misses =
            std::uniform_real_distribution<>(0, 1)(random) < 0.4 && row < observer.max_gap();
        row = misses ? row + 1 : 0;
        return misses;
      };
      EXPECT_LT(error_after(observer, at_random, 60000), 1e-3) << bandwidth << ", " << w;
    }
  }
}

// ---- The law.

/// Largest y less the reference, and the time to 0.9 of it, of a step of a rate loop whose motor
/// lags by `lag`.
struct Step {
  double overshoot;
  double rise;
};
template <class Controller>
Step rate_step(Controller controller, double lag) {
  Truth plant(reference_of<lag_parts>({.actuator = {lag}}, 1.0));
  Step step{0, 0};
  double before = 0;
  for (int k = 0; k < 600; ++k) {
    const double y = plant.measured();
    step.overshoot = std::max(step.overshoot, y - 1);
    if (step.rise == 0 && y > 0.9) step.rise = kT * (k - (y - 0.9) / (y - before));
    before = y;
    plant.advance(controller.update(y, 1.0));
  }
  return step;
}

// omega_c keeps its meaning: two poles at -omega_c, 3.89 / omega_c to 0.9. The trial, and
// beside it numpy by matrix exponentials: where omega_c = 60 ignores the lag, 50.1 % at 20 ms and
// 23.2 % at 10; where it rises as fast as with the lag in the model (64 ms), 3.89 %; in 35 ms
// without overshoot, 6.05 % where the motor is 30 % slower than the model, 0.90 % where faster.
TEST(AugmentedModel, TheLawKnowsTheLag) {
  const auto known = [](double omega_c) {
    return esokit::Adrc<ModelEso<lag_parts>>::make({.observer = {.observer_bandwidth = 100.0,
                                                                 .input_gain = 1.0,
                                                                 .sample_time = kT,
                                                                 .model = {.actuator = {0.02}}},
                                                    .controller_bandwidth = omega_c})
        .value();
  };
  const auto ignored = [](double omega_c) {
    return esokit::Adrc<LinearEso<1>>::make(
               {.observer = {.observer_bandwidth = 100.0, .input_gain = 1.0, .sample_time = kT},
                .controller_bandwidth = omega_c})
        .value();
  };
  EXPECT_NEAR(rate_step(ignored(60.0), 0.02).overshoot, 0.50109, 5e-5);
  EXPECT_NEAR(rate_step(ignored(60.0), 0.01).overshoot, 0.23196, 5e-5);
  EXPECT_NEAR(rate_step(ignored(19.87), 0.02).rise, 0.064, 1e-5);
  EXPECT_NEAR(rate_step(ignored(19.87), 0.02).overshoot, 0.0389, 5e-4);
  for (const auto& [omega_c, rise] : {std::pair(59.91, 0.064), std::pair(108.6, 0.035)}) {
    const Step step = rate_step(known(omega_c), 0.02);
    EXPECT_NEAR(step.rise, rise, 1e-5);
    EXPECT_LT(step.overshoot, 1e-3);
  }
  EXPECT_NEAR(rate_step(known(108.6), 1.3 * 0.02).overshoot, 0.0605, 1e-4);
  EXPECT_NEAR(rate_step(known(108.6), 0.7 * 0.02).overshoot, 0.0090, 1e-4);
}

// ---- Refusals.

TEST(AugmentedModel, RefusesWhatMakesNoSense) {
  const auto with = [](const auto& settings) {
    using S = std::remove_cvref_t<decltype(settings)>;
    if constexpr (std::is_same_v<S, Settings<lag_parts>>) {
      return refusal(AugmentedModel<lag_parts>::make(settings, 1.0, kT));
    } else {
      return refusal(AugmentedModel<all_parts>::make(settings, 1.0, kT));
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using One = Settings<lag_parts>;
  for (const double bad : {0.0, -1.0, nan}) {
    EXPECT_EQ(with(One{.actuator = {bad}}),
              "model.actuator.time_constant: must be finite and positive");
  }
  EXPECT_TRUE(AugmentedModel<lag_parts>::make({.actuator = {1.001e-5}}, 1.0, kT));
  EXPECT_EQ(with(One{.actuator = {0.999e-5}}),
            "model.actuator.time_constant: must be at least a hundredth of sample_time");

  const Settings<all_parts> good{.plant = {40.0, 3.0},
                                 .actuator = {200.0},
                                 .sensor = {300.0},
                                 .resonators = {{{700.0}}},
                                 .first_order = {0.3}};
  EXPECT_TRUE(AugmentedModel<all_parts>::make(good, 1.0, kT));
  const auto changed = [&](auto&& change) {
    auto settings = good;
    change(settings);
    return with(settings);
  };
  EXPECT_EQ(changed([&](auto& s) { s.plant[1] = nan; }), "model.plant[1]: must be finite");
  for (const double bad : {0.0, -1.0, nan}) {
    EXPECT_EQ(changed([&](auto& s) { s.actuator.frequency = bad; }),
              "model.actuator.frequency: must be finite and positive");
    EXPECT_EQ(changed([&](auto& s) { s.actuator.damping = bad; }),
              "model.actuator.damping: must be finite and positive");
    EXPECT_EQ(changed([&](auto& s) { s.sensor.frequency = bad; }),
              "model.sensor.frequency: must be finite and positive");
    EXPECT_EQ(changed([&](auto& s) { s.resonators[0].frequency = bad; }),
              "model.resonators.frequency[0]: must be finite and positive");
    EXPECT_EQ(changed([&](auto& s) { s.first_order[0] = bad; }),
              "model.first_order[0]: must be finite and positive");
  }
  EXPECT_EQ(changed([](auto& s) { s.sensor.frequency = 1.01e5; }),
            "model.sensor.frequency: must be at most a hundred times the sample rate");
  EXPECT_EQ(changed([](auto& s) { s.sensor.frequency = 0.99e5; }), "accepted");
  // Of w = 300 the faster time constant is 1e-5 at zeta = 166.67.
  EXPECT_EQ(changed([](auto& s) { s.sensor.damping = 166.6; }), "accepted");
  EXPECT_EQ(changed([](auto& s) { s.sensor.damping = 166.8; }),
            "model.sensor.damping: gives a time constant below a hundredth of sample_time");
  EXPECT_EQ(changed([](auto& s) { s.resonators[0].frequency = 3.11e3; }),
            "model.resonators.frequency[0]: must be below half the sample rate");
  EXPECT_EQ(changed([](auto& s) { s.resonators[0].frequency = 3.09e3; }), "accepted");
  EXPECT_EQ(changed([](auto& s) { s.resonators[0].damping = 0.99; }), "accepted");
  for (const double bad : {-0.1, 1.0, nan}) {
    EXPECT_EQ(changed([&](auto& s) { s.resonators[0].damping = bad; }),
              "model.resonators.damping[0]: must be 0 or above, below 1");
  }
  EXPECT_EQ(changed([](auto& s) { s.resonators[0].capture_bandwidth = -1; }),
            "model.resonators.capture_bandwidth[0]: must be finite and not negative");
  EXPECT_EQ(changed([](auto& s) { s.first_order[0] = 1.01e-5; }), "accepted");
  EXPECT_EQ(changed([](auto& s) { s.first_order[0] = 0.99e-5; }),
            "model.first_order[0]: must be at least a hundredth of sample_time");
  const auto sensor = [](double tau) {
    return refusal(AugmentedModel<sensor_parts>::make({.sensor = {tau}}, 1.0, kT));
  };
  EXPECT_EQ(sensor(1.001e-5), "accepted");
  EXPECT_EQ(sensor(0.999e-5),
            "model.sensor.time_constant: must be at least a hundredth of sample_time");
  EXPECT_EQ(sensor(-1.0), "model.sensor.time_constant: must be finite and positive");
  const auto fading = [](double first, double second) {
    return refusal(AugmentedModel<ModelParts{.order = 1, .first_order = 2}>::make(
        {.first_order = {first, second}}, 1.0, kT));
  };
  EXPECT_EQ(fading(0.3, 0.3004), "accepted");
  EXPECT_EQ(fading(0.3, 0.3002),
            "model.first_order[1]: must differ by a thousandth of itself from");

  const auto pair = [](double first, double second) {
    return AugmentedModel<swing_parts>::make({.resonators = {{{first}, {second}}}}, 1.0, kT);
  };
  EXPECT_TRUE(pair(100.0, 100.11));
  EXPECT_FALSE(pair(100.0, 100.09));
  EXPECT_EQ(refusal(pair(100.0, 100.0)),
            "model.resonators.frequency[1]: must differ by a thousandth of itself from");
  EXPECT_EQ(pair(100.0, 99.95).error().limit, 100.0);
}

// A swing that is far above what the observer is to follow: rounding would put the slow poles
// elsewhere.
TEST(AugmentedModel, RefusesASwingAboveWhatTheBandwidthCanPlace) {
  const auto slow = []<class S>(S bandwidth, S w) {
    return ModelEso<ModelParts{.order = 2, .resonators = 1}, S>::make(
        {.observer_bandwidth = bandwidth,
         .input_gain = S(1),
         .sample_time = static_cast<S>(kT),
         .model = {.resonators = {{{w}}}}});
  };
  EXPECT_TRUE(slow(1.0, 400.0));
  EXPECT_TRUE(slow(20.0f, 250.0f));
  const auto answer = slow(1.0, 800.0);
  EXPECT_EQ(refusal(answer),
            "observer_bandwidth: gives poles that the scalar cannot place for this model");
  EXPECT_EQ(answer.error().value, 1.0);
  EXPECT_EQ(refusal(slow(20.0f, 600.0f)),
            "observer_bandwidth: gives poles that the scalar cannot place for this model");
}

}  // namespace model_augmented_model_test
