// A model put together from parts, through all that takes an observer: the filter, half gains, a
// pole set, adapters, controllers, analysis, snapshots.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <limits>

#include <support/augmented_reference.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace observer_model_eso_test {

using esokit::Adrc;
using esokit::AugmentedModel;
using esokit::LinearEso;
using esokit::ModelEso;
using esokit::ModelParts;
using esokit::StepStatus;
using esokit_test::reference_of;
using esokit_test::refusal;

constexpr double kT = 1e-3;
constexpr ModelParts lag_parts{.order = 1, .actuator = 1};
constexpr ModelParts both_parts{.order = 1, .actuator = 1, .sensor = 1};
constexpr ModelParts swing_parts{.order = 2, .resonators = 1};
using Lag = ModelEso<lag_parts>;
using Both = ModelEso<both_parts>;
using Swing = ModelEso<swing_parts>;

Both::Config both_config(double bandwidth = 100.0) {
  return {.observer_bandwidth = bandwidth,
          .input_gain = 2.0,
          .sample_time = kT,
          .model = {.actuator = {0.02}, .sensor = {0.005}}};
}

/// The plant of both_config, without a disturbance, (f, y, v), and something constant.
template <class Controller>
double settled_error(Controller controller, double load, int samples) {
  const auto all =
      reference_of<both_parts>({.actuator = {0.02}, .sensor = {0.005}}, 2.0).natural_step(kT);
  std::array<double, 5> x{0, 0, 0, load, 0};
  double worst = 0;
  for (int k = 0; k < samples; ++k) {
    x[4] = controller(x[0]);
    std::array<double, 5> next = x;
    for (std::size_t i = 0; i < 5; ++i) {
      for (std::size_t j = 0; j < 5; ++j) next[i] += static_cast<double>(all[i][j]) * x[j];
    }
    x = next;
    if (k > samples - 100) worst = std::max(worst, std::abs(x[1] - 1));
  }
  return worst;
}

// ---- Kalman.

/// The limit gain of a dense Kalman filter in long double on the published states.
template <ModelParts parts>
Eigen::VectorXd dense_limit(const typename AugmentedModel<parts>::Settings& settings,
                            const Eigen::VectorXd& noise, double variance) {
  using Square = Eigen::Matrix<long double, -1, -1>;
  using Model = AugmentedModel<parts>;
  constexpr int N = Model::size;
  const auto step = reference_of<parts>(settings, 2.0).step(kT);
  Square phi(N, N);
  Square q = Square::Zero(N, N);
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) {
      phi(i, j) = step[size_t(i)][size_t(j)] + (i == j ? 1.0L : 0.0L);
    }
    q(Model::state_of_row(i), Model::state_of_row(i)) =
        static_cast<long double>(noise(i)) * static_cast<long double>(noise(i)) * N;
  }
  Square p = q;
  Eigen::Matrix<long double, -1, 1> k;
  for (int s = 0; s < 20000; ++s) {
    k = p.col(0) / (p(0, 0) + static_cast<long double>(variance));
    Square closed = Square::Identity(N, N);
    closed.col(0) -= k;
    p = (phi *
             (closed * p * closed.transpose() +
              k * static_cast<long double>(variance) * k.transpose()) *
             phi.transpose() +
         q)
            .eval();
  }
  Eigen::VectorXd rows(N);
  for (int i = 0; i < N; ++i) rows(i) = static_cast<double>(k(Model::state_of_row(i)));
  return rows;
}

TEST(ModelFilter, ItsLimitIsThatOfAKalmanFilter) {
  using Model = AugmentedModel<both_parts>;
  using Filter = esokit::ExtendedStateFilter<2, double, 2, esokit::NoNominalModel, 0, Model>;
  Filter::Config config;
  config.input_gain = 2.0;
  config.sample_time = kT;
  config.measurement_variance = 1e-4;
  config.plant_model = {.actuator = {0.02}, .sensor = {0.005}};
  config.inflation_rule = esokit::InflationRule::none;
  config.mode = esokit::RiccatiMode::frozen;
  // d acts on y'; what is known of the actuator is not certain.
  config.disturbance_bounds = {0.001, 0.3, 20.0, 0.0};
  const auto frozen = Filter::make(config);
  ASSERT_TRUE(frozen) << frozen.error();
  Eigen::VectorXd noise(4);
  noise << 0.001, 0.3, 20.0, 0.0;
  const Eigen::VectorXd limit = dense_limit<both_parts>(config.plant_model, noise, 1e-4);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(frozen->gain()(i) / limit(i), 1.0, 1e-9) << "row " << i;
  }
  // An actuator that is certain is not corrected in the end: it runs open loop.
  config.disturbance_bounds[2] = 0;
  noise(2) = 0;
  const auto certain = Filter::make(config);
  ASSERT_TRUE(certain) << certain.error();
  const Eigen::VectorXd open = dense_limit<both_parts>(config.plant_model, noise, 1e-4);
  for (const int i : {0, 1, 3}) EXPECT_NEAR(certain->gain()(i) / open(i), 1.0, 1e-9) << i;
  EXPECT_NEAR(certain->gain()(2), 0.0, 1e-9 * frozen->gain()(2));
  // The covariance is that of the rows of the estimate: the sensor's is last.
  config.mode = esokit::RiccatiMode::recursive;
  config.disturbance_bounds = {0.001, 0.3, 20.0, 0.0};
  config.initial_covariance = esokit::Matrix<double, 4, 4>::Diagonal({1, 2, 3, 4});
  const auto filter = Filter::make(config).value();
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(filter.covariance()(i, i), i + 1.0, 1e-12) << i;
  EXPECT_NEAR(filter.innovation_variance(), 4.0 + 1e-4, 1e-12);
}

TEST(ModelFilter, AGateLooksAtWhatIsMeasured) {
  using Model = AugmentedModel<both_parts>;
  using Filter = esokit::ExtendedStateFilter<2, double, 2, esokit::NoNominalModel, 0, Model>;
  Filter::Config config;
  config.input_gain = 2.0;
  config.sample_time = kT;
  config.measurement_variance = 1e-4;
  config.plant_model = {.actuator = {0.02}, .sensor = {0.005}};
  config.disturbance_bounds = {0.0, 0.3, 1.0, 0.0};
  config.inflation_rule = esokit::InflationRule::none;
  config.outlier_threshold = 25.0;
  auto filter = Filter::make(config).value();
  Filter::Estimate z = Filter::Estimate::Zero();
  z(0) = 7.0;  // y is there, and the sensor has not seen it
  ASSERT_EQ(filter.reset(z), StepStatus::ok);
  EXPECT_EQ(filter.predicted_measurement(), 0.0);
  EXPECT_TRUE(filter.accepts(0.0));
  EXPECT_FALSE(filter.accepts(7.0));
}

// ---- Other placements.

TEST(ModelPlacements, HalfGainsArePlacedAsPoles) {
  using Eso = LinearEso<2, double, 2, esokit::HalfGainPoles,
                        AugmentedModel<ModelParts{.order = 2, .constants = 2}>>;
  const auto model = Eso::make({.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = kT});
  const auto chain = esokit::HalfGainEso<2, double, 2>::make(
      {.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = kT});
  ASSERT_TRUE(model) << model.error();
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(model->level_gain(0)[i] / chain->level_gain(0)[i], 1.0, 1e-11) << i;
  }
  using Odd =
      LinearEso<2, double, 1, esokit::HalfGainPoles, AugmentedModel<ModelParts{.order = 2}>>;
  const auto odd = Odd::make({.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = kT});
  const auto odd_chain = esokit::HalfGainEso<2>::make(
      {.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = kT});
  ASSERT_TRUE(odd) << odd.error();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(odd->level_gain(0)[i] / odd_chain->level_gain(0)[i], 1.0, 1e-11) << i;
  }
}

TEST(ModelPlacements, APoleSetNamesThemAll) {
  using Poles = ModelEso<swing_parts, double, esokit::PoleSet>;
  const double w = 120.0;
  // Those of the default, listed.
  const auto listed = Poles::make({.poles = {{{-80, 0}, {-80, 0}, {-80, 0}, {-w, w}, {-w, -w}}},
                                   .input_gain = 1.0,
                                   .sample_time = kT,
                                   .model = {.resonators = {{{w}}}}});
  ASSERT_TRUE(listed) << listed.error();
  const auto swing = Swing::make({.observer_bandwidth = 80.0,
                                  .input_gain = 1.0,
                                  .sample_time = kT,
                                  .model = {.resonators = {{{w}}}}})
                         .value();
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(listed->level_gain(0)[i] / swing.level_gain(0)[i], 1.0, 1e-10) << i;
  }
}

TEST(ModelCascade, ASwingIsFoundByTheLevelsTogether) {
  using Model = AugmentedModel<swing_parts>;
  auto cascade = esokit::CascadeEso<2, 2, double, 3, esokit::EqualPoles, Model>::make(
                     {.observer_bandwidth = 60.0,
                      .bandwidth_factor = 2.0,
                      .input_gain = 1.0,
                      .sample_time = kT,
                      .model = {.resonators = {{{90.0}}}}})
                     .value();
  for (int k = 1; k < 3000; ++k) {
    const double t = k * kT;
    ASSERT_EQ(cascade.update(1.5 * t * t - 2 / 8100.0 * std::sin(90 * t), 0.0), StepStatus::ok);
    if (k > 2000) {
      ASSERT_NEAR(cascade.total_disturbance(), 3 + 2 * std::sin(90 * t), 1e-7) << k;
    }
  }
}

// ---- What a swing that is known gains.

/// sd of dhat for noise of 1 on y: of the response to one sample of it.
template <class Observer>
double noise_of(Observer observer) {
  double squares = 0;
  for (int k = 0; k < 3000; ++k) {
    (void)observer.update(k == 100 ? 1.0 : 0.0, 0.0);
    squares += observer.total_disturbance() * observer.total_disturbance();
  }
  return std::sqrt(squares);
}

/// The largest dhat - d once it has settled, d = sin(w t) on a double integrator.
template <class Observer>
double left_of_a_sine(Observer observer, double w) {
  const int period = static_cast<int>(2 * std::acos(-1.0) / (w * kT)) + 1;
  const int settled = 3000;
  double worst = 0;
  for (int k = 0; k < settled + period; ++k) {
    const double d = std::sin(w * k * kT);
    (void)observer.update(-d / (w * w), 0.0);
    if (k >= settled) worst = std::max(worst, std::abs(observer.total_disturbance() - d));
  }
  return worst;
}

// 2 % beside the frequency, all poles at omega_o, against a chain that lets as much noise into
// dhat. numpy with 60-digit gains, by frequency response and Lyapunov equation, has 50.27, 38.90
// and 31.53 dB above the frequency, and the same noise.
TEST(ModelSwing, BesideItsFrequencyItIsFarBelowAChainOfEqualNoise) {
  const double bandwidth = 60;
  using Poles = ModelEso<swing_parts, double, esokit::PoleSet>;
  const auto chain = [](double omega_o) {
    return LinearEso<2>::make({.observer_bandwidth = omega_o, .input_gain = 1.0, .sample_time = kT})
        .value();
  };
  for (const auto& [share, noise, decibel] :
       {std::array{10.0, 8.40, 50.27}, {5.0, 8.27, 38.90}, {3.0, 7.95, 31.53}}) {
    const double w = bandwidth / share;
    Poles::Config config{.input_gain = 1.0, .sample_time = kT, .model = {.resonators = {{{w}}}}};
    for (auto& pole : config.poles) pole = {-bandwidth, 0.0};
    const auto swing = Poles::make(config).value();
    const double sd = noise_of(swing);
    EXPECT_NEAR(sd / noise_of(chain(bandwidth)), noise, 0.005) << share;
    double low = bandwidth, high = 10 * bandwidth;
    for (int i = 0; i < 30; ++i) {
      const double middle = std::sqrt(low * high);
      (noise_of(chain(middle)) < sd ? low : high) = middle;
    }
    const double gained =
        20 * std::log10(left_of_a_sine(chain(low), 1.02 * w) / left_of_a_sine(swing, 1.02 * w));
    EXPECT_NEAR(gained, decibel, 0.02) << share;
    EXPECT_GE(gained, 30.0) << share;
    EXPECT_LT(left_of_a_sine(swing, w), 1e-9) << share;
  }
}

// ---- The parts of a disturbance.

constexpr ModelParts read_parts{.order = 2, .constants = 2, .resonators = 2, .first_order = 1};

/// d = 3 + 0.5 t + 2 sin(90 t + 0.4) + 0.7 sin(25 t - 1) + 4 exp(-t / 0.8) on a double integrator:
/// what `feed(y)` was fed with is what `disturbance_parts` of `reader` tells.
template <class Feed, class Reader>
void reads_the_parts(const char* what, const Feed& feed, const Reader& reader, double sign = 1) {
  SCOPED_TRACE(what);
  double t = 0;
  for (int k = 1; k <= 2500; ++k) {
    t = k * kT;
    feed(1.5 * t * t + 0.5 / 6 * t * t * t - 2 / 8100.0 * std::sin(90 * t + 0.4) -
         0.7 / 625.0 * std::sin(25 * t - 1) + 4 * 0.64 * std::exp(-t / 0.8));
  }
  const auto parts = esokit::disturbance_parts(reader());
  EXPECT_NEAR(parts.constant, sign * (3 + 0.5 * t), 1e-5);
  EXPECT_NEAR(parts.sinusoids[0].amplitude, 2.0, 1e-6);
  EXPECT_NEAR(parts.sinusoids[1].amplitude, 0.7, 1e-6);
  EXPECT_NEAR(std::sin(parts.sinusoids[0].phase), sign * std::sin(90 * t + 0.4), 1e-6);
  EXPECT_NEAR(std::cos(parts.sinusoids[0].phase), sign * std::cos(90 * t + 0.4), 1e-6);
  EXPECT_NEAR(std::sin(parts.sinusoids[1].phase), sign * std::sin(25 * t - 1), 1e-6);
  EXPECT_NEAR(parts.first_order[0], sign * 4 * std::exp(-t / 0.8), 1e-5);
}

TEST(DisturbanceParts, AreReadThroughEveryObserverAdapterAndController) {
  using Model = AugmentedModel<read_parts>;
  using Eso = ModelEso<read_parts>;
  const Model::Settings settings{.resonators = {{{90.0}, {25.0}}}, .first_order = {0.8}};
  const Eso::Config config{
      .observer_bandwidth = 60.0, .input_gain = 1.0, .sample_time = kT, .model = settings};
  const auto check = [](const char* what, auto made) {
    ASSERT_TRUE(made) << what << ": " << made.error();
    reads_the_parts(
        what, [&](double y) { (void)made->update(y, 0.0); }, [&] { return *made; });
  };
  check("LinearEso", Eso::make(config));
  using Cascade = esokit::CascadeEso<2, 2, double, Model::extension, esokit::EqualPoles, Model>;
  check("CascadeEso", Cascade::make({.observer_bandwidth = 40.0,
                                     .bandwidth_factor = 2.0,
                                     .input_gain = 1.0,
                                     .sample_time = kT,
                                     .model = settings}));
  check("DelayedInput", esokit::DelayedInput<Eso, 3>::make({.observer = config, .delay = 3}));
  check("OutlierGate in VariableTime",
        esokit::VariableTime<esokit::OutlierGate<Eso>>::make(
            {.observer = {.observer = config, .threshold = 5.0}, .ratio = 2.0}));
  check("WrappedOutput", esokit::WrappedOutput<Eso>::make({.observer = config, .period = 100.0}));
  const auto controls = [&](const char* what, auto made, double sign) {
    ASSERT_TRUE(made) << what << ": " << made.error();
    reads_the_parts(
        what,
        [&](double y) {
          made->applied(0.0);
          (void)made->update(y, 0.0);
        },
        [&] { return *made; }, sign);
  };
  controls("Adrc", Adrc<Eso>::make({.observer = config, .controller_bandwidth = 10.0}), 1);
  controls("error-based Adrc in a nest",
           Adrc<esokit::DelayedInput<Eso, 2>, esokit::ErrorBased>::make(
               {.observer = {.observer = config, .delay = 1}, .controller_bandwidth = 10.0}),
           -1);
  // A plant given as a whole.
  using Whole = esokit::PlantEso<2, read_parts>;
  check("PlantEso", Whole::make({.observer_bandwidth = 60.0,
                                 .input_gain = 1.0,
                                 .sample_time = kT,
                                 .model = {.plant = esokit::LinearPlant<2>::chain({}).value(),
                                           .resonators = settings.resonators,
                                           .first_order = settings.first_order}}));
  // A filter, which tells a ramp from what fades by its own weights only: their sum.
  using Filter =
      esokit::ExtendedStateFilter<2, double, Model::extension, esokit::NoNominalModel, 0, Model>;
  Filter::Config filter;
  filter.input_gain = 1.0;
  filter.sample_time = kT;
  filter.measurement_variance = 1e-12;
  filter.plant_model = settings;
  filter.disturbance_bounds = {0, 0, 1, 1, 1, 1, 1, 1, 1};
  filter.inflation_rule = esokit::InflationRule::none;
  filter.initial_covariance = Filter::Covariance::Identity();
  auto recursive = Filter::make(filter);
  ASSERT_TRUE(recursive) << recursive.error();
  for (int k = 0; k < 300; ++k) (void)recursive->update(std::sin(0.1 * k), 0.3);
  const auto parts = esokit::disturbance_parts(*recursive);
  double sum = parts.constant + parts.first_order[0];
  for (const auto& swing : parts.sinusoids) sum += swing.amplitude * std::sin(swing.phase);
  EXPECT_NEAR(sum, recursive->total_disturbance(), 1e-9 * std::abs(sum));
}

// ---- Adapters.

TEST(ModelAdapters, DelayGateAngleAndTimeWorkWithIt) {
  // The delay: the same as the model fed late.
  auto delayed =
      esokit::DelayedInput<Both, 3>::make({.observer = both_config(), .delay = 3}).value();
  auto plain = Both::make(both_config()).value();
  double u[400] = {};
  for (int k = 0; k < 400; ++k) {
    u[k] = std::sin(0.05 * k);
    const double y = std::cos(0.02 * k);
    (void)delayed.update(y, u[k]);
    (void)plain.update(y, k < 3 ? 0.0 : u[k - 3]);
  }
  for (int i = 0; i < plain.size; ++i) EXPECT_EQ(delayed.estimate()(i), plain.estimate()(i)) << i;

  // The gate: one outlier is a missing sample.
  auto gate =
      esokit::OutlierGate<Both>::make({.observer = both_config(), .threshold = 5.0}).value();
  auto missing = Both::make(both_config()).value();
  for (int k = 0; k < 100; ++k) {
    (void)gate.update(k == 70 ? 100.0 : 1.0, 0.1);
    if (k == 70) {
      (void)missing.predict(0.1);
    } else {
      (void)missing.update(1.0, 0.1);
    }
  }
  for (int i = 0; i < 4; ++i) EXPECT_EQ(gate.estimate()(i), missing.estimate()(i)) << i;

  // An angle that turns: as one that is not wrapped.
  auto wrapped = esokit::WrappedOutput<Lag>::make({.observer = {.observer_bandwidth = 100.0,
                                                                .input_gain = 2.0,
                                                                .sample_time = kT,
                                                                .model = {.actuator = {0.02}}},
                                                   .period = 1.0})
                     .value();
  auto turning = Lag::make({.observer_bandwidth = 100.0,
                            .input_gain = 2.0,
                            .sample_time = kT,
                            .model = {.actuator = {0.02}}})
                     .value();
  for (int k = 0; k < 500; ++k) {
    const double y = 0.013 * k;
    (void)wrapped.update(y - std::floor(y), 0.3);
    (void)turning.update(y, 0.3);
  }
  EXPECT_NEAR(wrapped.estimate()(1), turning.estimate()(1), 1e-9);
  EXPECT_NEAR(wrapped.estimate()(2), turning.estimate()(2), 1e-6);

  // Steps of another length: as an observer made for them.
  auto varying =
      esokit::VariableTime<Both>::make({.observer = both_config(), .ratio = 3.0}).value();
  ASSERT_TRUE(varying.set_step_time(2 * kT));
  auto slow_config = both_config();
  slow_config.sample_time = 2 * kT;
  auto slow = Both::make(slow_config).value();
  for (int k = 0; k < 200; ++k) {
    (void)varying.update(std::sin(0.02 * k), 0.2);
    (void)slow.update(std::sin(0.02 * k), 0.2);
  }
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(varying.estimate()(i), slow.estimate()(i),
                1e-9 * (1 + std::abs(slow.estimate()(i))));
  }
}

// ---- Controllers.

TEST(ModelControllers, AllSettleOnTheReference) {
  auto adrc = Adrc<Both>::make({.observer = both_config(), .controller_bandwidth = 30.0}).value();
  EXPECT_LT(settled_error([&](double y) { return adrc.update(y, 1.0); }, -3.0, 2000), 1e-9);
  // The reference is the plant's: what is measured lags behind it.
  auto error_based = Adrc<Both, esokit::ErrorBased>::make(
                         {.observer = both_config(), .controller_bandwidth = 30.0})
                         .value();
  EXPECT_LT(settled_error([&](double y) { return error_based.update(y, 1.0); }, -3.0, 2000), 1e-9);
  auto predictive =
      esokit::PredictiveAdrc<Both>::make({.observer = both_config(), .controller_bandwidth = 30.0})
          .value();
  EXPECT_LT(settled_error([&](double y) { return predictive.update(y, 1.0); }, -3.0, 2000), 1e-9);
  // With a proportional and derivative law of one's own around the compensator; b = b0 / tau.
  auto compensator =
      esokit::DisturbanceCompensator<Both>::make({.observer = both_config()}).value();
  const auto own = [&](double y) {
    const auto z = compensator.observer().estimate();
    return compensator.update(y, (900 * (1 - z(0)) - 60 * z(1)) / (2.0 / 0.02));
  };
  EXPECT_LT(settled_error(own, -3.0, 2000), 1e-9);
}

// By it a predictive controller refuses a y whose estimates would overflow. The sensor's state is
// the first of the model and the last of an estimate.
TEST(ModelControllers, ProbesAnEstimateByRows) {
  const Both observer = Both::make(both_config()).value();
  for (int row = 0; row < Both::size; ++row) {
    Both::State of_estimate{}, of_model{};
    of_estimate[static_cast<std::size_t>(row)] = 3.0;
    of_model[static_cast<std::size_t>(Both::PlantModel::state_of_row(row))] = 3.0;
    EXPECT_GT(observer.finite_probe(of_estimate), 0.0);
    EXPECT_EQ(observer.finite_probe(of_estimate), observer.model().finite_probe(of_model)) << row;
  }
}

TEST(ModelControllers, PredictiveIsAdrcWithTheSameSamples) {
  const auto compare = [](auto predictive, auto adrc) {
    predictive.prepare(1.0);
    for (int k = 0; k < 200; ++k) {
      const double y = 0.3 * std::sin(0.1 * k);
      if (k % 50 == 20) {
        const double missing = predictive.control_without_measurement();
        predictive.prepare(1.0);
        ASSERT_NEAR(missing, adrc.update_without_measurement(1.0), 1e-9 * (1 + std::abs(missing)));
        continue;
      }
      const double u = predictive.control(y);
      predictive.prepare(1.0);
      ASSERT_NEAR(u, adrc.update(y, 1.0), 1e-9 * (1 + std::abs(u))) << k;
    }
  };
  const esokit::PredictiveAdrc<Both>::Config config{.observer = both_config(),
                                                    .controller_bandwidth = 30.0};
  auto adrc = Adrc<Both>::make({.observer = both_config(), .controller_bandwidth = 30.0}).value();
  // `prepare` before the first measurement is the prediction that Adrc makes in its first update.
  compare(esokit::PredictiveAdrc<Both>::make(config).value(), adrc);
  const Swing::Config swing{.observer_bandwidth = 80.0,
                            .input_gain = 1.0,
                            .sample_time = kT,
                            .model = {.resonators = {{{120.0}}}}};
  compare(esokit::PredictiveAdrc<Swing>::make({.observer = swing, .controller_bandwidth = 20.0})
              .value(),
          Adrc<Swing>::make({.observer = swing, .controller_bandwidth = 20.0}).value());
}

TEST(ModelControllers, StartDoesNotBump) {
  auto adrc = Adrc<Both>::make({.observer = both_config(), .controller_bandwidth = 30.0}).value();
  ASSERT_EQ(adrc.start(4.0, 0.7), StepStatus::ok);
  EXPECT_NEAR(adrc.update(4.0, 4.0), 0.7, 1e-9);
  EXPECT_NEAR(adrc.update(4.0, 4.0), 0.7, 1e-9);
}

TEST(ModelControllers, ChannelsThatAreNotCoupledAreSingleLoops) {
  using Two = esokit::MimoAdrc<Both, Both>;
  auto channel = both_config();
  channel.input_gain = 0;
  const auto two_config = [&](double b) {
    Two::Config config{.observers = {channel, channel}, .controller_bandwidths = {30, 30}};
    config.input_matrix = {{b, 0}, {0, -b}};
    return config;
  };
  const auto one_config = [&](double b) {
    Adrc<Both>::Config config{.observer = both_config(), .controller_bandwidth = 30.0};
    config.observer.input_gain = b;
    return config;
  };
  auto two = Two::make(two_config(2)).value();
  auto one = Adrc<Both>::make(one_config(2)).value();
  auto other = Adrc<Both>::make(one_config(-2)).value();
  for (int k = 0; k < 400; ++k) {
    const double y = std::sin(0.02 * k);
    const auto u = two.update({y, -y}, {1.0, 0.5});
    const double first = one.update(y, 1.0);
    const double second = other.update(-y, 0.5);
    ASSERT_NEAR(u(0), first, 1e-9 * (1 + std::abs(first))) << k;
    ASSERT_NEAR(u(1), second, 1e-9 * (1 + std::abs(second))) << k;
  }
  // No bump: what B0 no longer explains is the disturbance's.
  ASSERT_EQ(two.start({4.0, -1.0}, {0.7, 0.2}), StepStatus::ok);
  ASSERT_TRUE(two.retune(two_config(3)));
  const auto u = two.update({4.0, -1.0}, {4.0, -1.0});
  EXPECT_NEAR(u(0), 0.7, 1e-9);
  EXPECT_NEAR(u(1), 0.2, 1e-9);
}

// ---- A swing that follows a speed.

constexpr ModelParts following_parts{.order = 2, .resonators = 2, .follows_speed = true};
using Following = ModelEso<following_parts>;

Following::Config following_config(double bandwidth, double w) {
  return {.observer_bandwidth = bandwidth,
          .input_gain = 1.0,
          .sample_time = kT,
          .model = {.resonators = {{{w}, {2 * w}}}, .speed = {0.5, 2.0}}};
}

TEST(FollowsSpeed, IsTheModelOfThatFrequency) {
  using Model = Following::PlantModel;
  using Fixed = AugmentedModel<ModelParts{.order = 2, .resonators = 2}>;
  const auto model = Model::make(following_config(50, 80).model, 1.5, kT).value();
  for (const double factor : {0.5, 0.77, 1.0, 2.0}) {
    const auto fixed =
        Fixed::make({.resonators = {{{80 * factor}, {160 * factor}}}}, 1.5, kT).value();
    EXPECT_EQ(model.at_speed(factor).increment(), fixed.increment()) << factor;
  }
}

// A cogging torque and its second harmonic, from half to twice the speed in eight seconds: the
// error of dhat is that of a fixed speed's rounding plus what the change itself makes.
TEST(FollowsSpeed, EstimatesASwingWhoseFrequencyChanges) {
  for (const auto& [bandwidth, w] : {std::pair(60.0, 60.0), std::pair(40.0, 120.0)}) {
    auto following = Following::make(following_config(bandwidth, w)).value();
    auto fixed = ModelEso<ModelParts{.order = 2, .resonators = 2}>::make(
                     {.observer_bandwidth = bandwidth,
                      .input_gain = 1.0,
                      .sample_time = kT,
                      .model = {.resonators = {{{w}, {2 * w}}}}})
                     .value();
    long double y = 0, rate = 0, angle = 0;
    double worst = 0, worst_fixed = 0;
    for (int k = 0; k < 8000; ++k) {
      const double factor = 0.5 + 1.5 * k / 8000;
      ASSERT_TRUE(following.set_speed(factor));
      const auto load = [](long double a) { return 2 * std::sin(a) + std::sin(2 * a + 1); };
      constexpr int fine = 20;
      for (int i = 0; i < fine; ++i) {
        const long double h = static_cast<long double>(kT) / fine;
        const long double turn = static_cast<long double>(w * factor) * h;
        // Simpson's rule for the sine over the step, to y' and y.
        const long double a0 = load(angle), a1 = load(angle + turn / 2), a2 = load(angle + turn);
        y += rate * h + h * h / 6 * (a0 + 2 * a1);
        rate += h / 6 * (a0 + 4 * a1 + a2);
        angle += turn;
      }
      (void)following.update(static_cast<double>(y), 0.0);
      (void)fixed.update(static_cast<double>(y), 0.0);
      if (k < 1000) continue;
      const auto truth = static_cast<double>(load(angle));
      worst = std::max(worst, std::abs(following.total_disturbance() - truth));
      worst_fixed = std::max(worst_fixed, std::abs(fixed.total_disturbance() - truth));
    }
    // 1.5 / 8 s of its speed a second, against an error that is gone in some 5 / (bandwidth / 2).
    EXPECT_LT(worst, 3 * 1.5 / 8 * 5 / (bandwidth / 2)) << bandwidth << ", " << w;
    EXPECT_GT(worst_fixed, 0.5) << bandwidth << ", " << w;
  }
}

TEST(FollowsSpeed, EveryGapDecaysAtEverySpeed) {
  for (const double factor : {0.5, 0.61, 1.0, 1.37, 2.0}) {
    auto observer = Following::make(following_config(60, 90)).value();
    ASSERT_TRUE(observer.set_speed(factor));
    // The last time at random, none of them longer.
    for (int missing = observer.max_gap() + 1; missing >= 0; missing -= esokit_test::stride) {
      auto copy = observer;
      (void)copy.reset(1e3);
      esokit_test::Random random(67);
      int left = 0;
      for (int k = 1; k < 60000; ++k) {
        (void)copy.predict(0.0);
        if (left-- > 0) continue;
        left = missing <= observer.max_gap() ? missing : random.index(observer.max_gap() + 1);
        ASSERT_NE(copy.correct(0.0), StepStatus::restarted);
      }
      for (const double x : copy.model().scaled(copy.estimate())) {
        EXPECT_LT(std::abs(x), 1e-3) << factor << ", " << missing << " missing";
      }
    }
  }
}

TEST(FollowsSpeed, AdaptersHandItOn) {
  using Nest = esokit::DelayedInput<esokit::VariableTime<esokit::WrappedOutput<Following>>, 2>;
  auto nest =
      Nest::make({.observer = {.observer = {.observer = following_config(60, 90), .period = 100.0},
                               .ratio = 2.0},
                  .delay = 0})
          .value();
  auto bare = Following::make(following_config(60, 90)).value();
  ASSERT_TRUE(nest.set_speed(1.25));
  ASSERT_TRUE(bare.set_speed(1.25));
  // A step of another length is a retune, which takes the speed back: VariableTime keeps it.
  ASSERT_TRUE(nest.set_step_time(1.5 * kT));
  auto slower = following_config(60, 90);
  slower.sample_time = 1.5 * kT;
  for (int k = 0; k < 300; ++k) {
    const double y = std::sin(0.05 * k);
    ASSERT_EQ(nest.update(y, 0.3), StepStatus::ok);
    if (k == 0) {
      ASSERT_TRUE(bare.retune(slower));
      ASSERT_TRUE(bare.set_speed(1.25));
    }
    ASSERT_EQ(bare.update(y, 0.3), StepStatus::ok);
    for (int i = 0; i < bare.size; ++i) ASSERT_EQ(nest.estimate()(i), bare.estimate()(i)) << k;
  }
  EXPECT_EQ(nest.model().speed(), 1.25);
  EXPECT_EQ(refusal(nest.set_speed(50.0)), "speed: must be at most");
}

TEST(FollowsSpeed, RefusesWhatIsBeyondItsRange) {
  auto observer = Following::make(following_config(60, 90)).value();
  const auto before = observer.level_gain(0);
  for (const double bad : {0.499, 0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto answer = observer.set_speed(bad);
    ASSERT_FALSE(answer);
    EXPECT_EQ(refusal(answer), "speed: must be finite and at least");
    EXPECT_EQ(answer.error().limit, 0.5);
  }
  EXPECT_EQ(refusal(observer.set_speed(2.01)), "speed: must be at most");
  EXPECT_EQ(observer.level_gain(0), before);
  EXPECT_TRUE(observer.set_speed(0.5));
  EXPECT_TRUE(observer.set_speed(2.0));
  EXPECT_NE(observer.level_gain(0), before);

  auto config = following_config(60, 90);
  config.model.speed.lowest = 1.01;
  EXPECT_EQ(refusal(Following::make(config)), "model.speed.lowest: must be 1 at most");
  config.model.speed = {0.5, 0.99};
  EXPECT_EQ(refusal(Following::make(config)), "model.speed.highest: must be 1 or more");
  config.model.speed = {0.0, 2.0};
  EXPECT_EQ(refusal(Following::make(config)), "model.speed.lowest: must be finite and positive");
  config.model.speed = {0.5, 18.0};
  EXPECT_EQ(refusal(Following::make(config)),
            "model.speed.highest: takes a resonator to half the sample rate");
  config.model.speed = {0.02, 8.0};
  EXPECT_EQ(refusal(Following::make(config)),
            "model.speed.highest: is too far from lowest: the error does not decay between two "
            "speeds of the table, at");
}

// ---- Analysis and snapshots.

TEST(ModelAnalysis, TheSystemIsTheObserver) {
  auto observer = Both::make(both_config()).value();
  const auto system = esokit::observer_system(observer);
  Eigen::VectorXd state = Eigen::VectorXd::Zero(4);
  for (int k = 0; k < 60; ++k) {
    const double y = std::sin(0.3 * k);
    const double u = std::cos(0.2 * k);
    (void)observer.correct(y);
    const Eigen::Vector2d input(y, u);
    const Eigen::VectorXd output = system.c * state + system.d * input;
    for (int i = 0; i < 4; ++i) {
      ASSERT_NEAR(output(i), observer.estimate()(i), 1e-9 * (1 + std::abs(observer.estimate()(i))))
          << k << " row " << i;
    }
    state = (state + system.a * state + system.b * input).eval();
    (void)observer.predict(u);
  }
}

TEST(ModelSnapshots, KnowWhichModel) {
  EXPECT_NE(esokit::type_tag<Both>, esokit::type_tag<Lag>);
  constexpr ModelParts other{.order = 1, .actuator = 1, .first_order = 1};  // of the size of Both
  static_assert(sizeof(ModelEso<other>) != 0);
  EXPECT_NE(esokit::type_tag<Both>, esokit::type_tag<ModelEso<other>>);
  EXPECT_NE((esokit::type_tag<AugmentedModel<both_parts, float>>),
            (esokit::type_tag<AugmentedModel<both_parts, double>>));
}

/// rms of dhat - d over 100 s in which a tenth of the samples is lost, at random, and the restarts.
template <class Observer>
std::pair<double, int> with_lost_samples(Observer observer, double sine) {
  esokit_test::Random random(9003);
  double y = 0, v = 0, t = 0, sum = 0;
  int restarts = 0;
  const auto d = [sine](double at) { return std::sin(0.5 * at) + 3 * std::sin(sine * at); };
  for (int k = 0; k < 100000; ++k) {
    constexpr double T = 1e-3;
    const double middle = d(t + T / 2);
    y += T * v + T * T / 6 * (d(t) + 2 * middle);
    v += T / 6 * (d(t) + 4 * middle + d(t + T));
    t += T;
    observer.predict(0);
    if (random.index(10) > 0 && has(observer.correct(y), esokit::StepStatus::restarted)) ++restarts;
    if (t > 5) sum += std::pow(observer.total_disturbance() - d(t), 2);
  }
  return {std::sqrt(sum / 95000), restarts};
}

/// With gaps bridged up to the longest that recurs stably there were 10 restarts with the sine, 90
/// with three constants.
TEST(ModelEso, LostSamplesCostNoMoreThanOnTheChain) {
  const auto sine = with_lost_samples(ModelEso<ModelParts{.order = 2, .resonators = 1}>::make(
                                          {.observer_bandwidth = 20,
                                           .input_gain = 1,
                                           .sample_time = 1e-3,
                                           .model = {.resonators = {{{.frequency = 10}}}}})
                                          .value(),
                                      10);
  EXPECT_EQ(sine.second, 0);
  EXPECT_LT(sine.first, 0.1);
  const auto constants =
      with_lost_samples(ModelEso<ModelParts{.order = 2, .constants = 3}>::make(
                            {.observer_bandwidth = 20, .input_gain = 1, .sample_time = 1e-3})
                            .value(),
                        0);
  const auto chain =
      with_lost_samples(LinearEso<2, double, 3>::make(
                            {.observer_bandwidth = 20, .input_gain = 1, .sample_time = 1e-3})
                            .value(),
                        0);
  EXPECT_EQ(constants.second, 0);
  EXPECT_LT(constants.first, 1.2 * chain.first);
}

/// Poles as `tune` lists them, that of the lag among them, which nothing corrects: gaps were 0 and
/// 15 samples.
TEST(ModelEso, AListedLagBridgesGaps) {
  using Eso = ModelEso<ModelParts{.order = 1, .actuator = 1}, double, esokit::PoleSet>;
  const auto longest = [](double lag, std::complex<double> pole) {
    auto observer = Eso::make({.poles = {{{-1.0 / lag, 0.0}, pole, std::conj(pole)}},
                               .input_gain = 1,
                               .sample_time = 1,
                               .model = {.actuator = {.time_constant = lag}}})
                        .value();
    // Errors decay: random gaps, and the shortest and the longest in turn.
    esokit_test::Random random(47);
    for (const bool turns : {false, true}) {
      Eso::Estimate state;
      for (int i = 0; i < Eso::size; ++i) state(i) = 1.0;
      observer.reset(state);
      for (int k = 0; k < 4000; ++k) {
        int missing = random.index(observer.max_gap() + 1);
        if (turns) missing = k % 2 == 0 ? 0 : observer.max_gap();
        for (; missing >= 0; --missing) observer.predict(0);
        EXPECT_FALSE(has(observer.correct(0), esokit::StepStatus::restarted));
      }
      for (int i = 0; i < Eso::size; ++i) {
        EXPECT_LT(std::abs(observer.estimate()(i)), 1e-2) << turns << ' ' << i;
      }
    }
    return observer.max_gap();
  };
  EXPECT_EQ(longest(30, {-0.0003053, 0.163}), 100);
  EXPECT_EQ(longest(15, {-0.03746, 0.0584}), 100);
}

}  // namespace observer_model_eso_test
