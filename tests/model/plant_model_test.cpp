// Any linear plant as a model: with a zero, with a disturbance that enters elsewhere, equal to the
// chain where it is one, and refused where y does not show it all.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/held_plant.hpp>
#include <esokit/sim/run.hpp>
#include <limits>

#include <support/refusal.hpp>

namespace model_plant_model_test {

using esokit::AugmentedModel;
using esokit::LinearEso;
using esokit::LinearPlant;
using esokit::ModelParts;
using esokit::PlantEso;
using esokit::StepStatus;
using esokit_test::refusal;

constexpr double kT = 1e-3;

/// A plant with a zero, of order 2 for a law.
using ZeroEso = PlantEso<3, ModelParts{.order = 2}>;

/// (s + 30) 200 / (s^3 + 12 s^2 + 47 s + 60), with d into the second state.
LinearPlant<3> with_zero() {
  auto plant =
      LinearPlant<3>::transfer_function({.numerator = {6000, 200, 0}, .denominator = {60, 47, 12}})
          .value();
  plant.e = {0.0, 1.0, 0.0};
  return plant;
}

TEST(PlantModel, AChainEqualsLinearEso) {
  auto model = PlantEso<2, ModelParts{.order = 2, .constants = 2}>::make(
                   {.observer_bandwidth = 80.0,
                    .input_gain = 3.0,
                    .sample_time = kT,
                    .model = {LinearPlant<2>::chain({.input_gain = 3.0}).value()}})
                   .value();
  auto chain = LinearEso<2, double, 2>::make(
                   {.observer_bandwidth = 80.0, .input_gain = 3.0, .sample_time = kT})
                   .value();
  double largest[3] = {};
  for (int k = 0; k < 1000; ++k) {
    const double y = std::sin(0.05 * k);
    const double u = std::cos(0.03 * k);
    (void)model.update(y, u);
    (void)chain.update(y, u);
    for (int i = 0; i < 3; ++i) {
      largest[i] = std::max(largest[i], std::abs(chain.estimate()(i)));
      ASSERT_NEAR(model.estimate()(i), chain.estimate()(i), 1e-12 * largest[i]) << k << ", " << i;
    }
  }
}

// States and d to rounding, and D is what is left of y^(n) without u.
template <int States>
void finds_states_and_disturbance(const LinearPlant<States>& plant) {
  ASSERT_EQ(plant.relative_degree(), 2);
  auto made = PlantEso<States, ModelParts{.order = 2}>::make({.observer_bandwidth = 60.0,
                                                              .input_gain = plant.input_gain(),
                                                              .sample_time = kT,
                                                              .model = {plant}});
  ASSERT_TRUE(made) << made.error();
  auto& observer = *made;
  double before = 0;
  const auto run = esokit::sim::run(
      plant, [k = 0](double, double) mutable { return std::sin(0.01 * k++); },
      {.duration = 2.0, .sample_time = kT, .disturbance = 7.0},
      [&](const auto& sample) {
        const auto status = observer.update(sample.output, before);
        EXPECT_EQ(status, StepStatus::ok);
        before = sample.input;
        if (sample.index < 1000) return;
        const auto z = observer.estimate();
        const auto x = observer.model().plant_state(z);
        for (int i = 0; i < States; ++i) {
          ASSERT_NEAR(x(i), sample.state(i), 1e-8 * (1 + std::abs(sample.state(i))))
              << sample.index << ", " << i;
        }
        ASSERT_NEAR(observer.model().disturbance(z), 7.0, 1e-6) << sample.index;
        const auto rate = plant.derivative(sample.state, esokit::Vector<double, 1>(0.0),
                                           esokit::Vector<double, 1>(7.0));
        const auto second = plant.c * plant.a * rate;
        ASSERT_NEAR(observer.total_disturbance(), second, 1e-6 * (1 + std::abs(second)));
      });
  ASSERT_TRUE(run);
}

// Another plant at the same T: the estimates stay as they are, to the last bit.
TEST(PlantModel, ARetuneKeepsTheEstimates) {
  ZeroEso::Config config{
      .observer_bandwidth = 60.0, .input_gain = 200.0, .sample_time = kT, .model = {with_zero()}};
  auto eso = ZeroEso::make(config).value();
  for (int k = 0; k < 100; ++k) {
    (void)eso.update(std::sin(0.05 * k), std::cos(0.03 * k));
    const auto before = eso.estimate();
    config.model.plant.a *= k % 2 == 0 ? 1.25 : 0.8;
    ASSERT_TRUE(eso.retune(config));
    ASSERT_EQ(eso.estimate(), before) << k;
  }
}

// A disturbance that enters where u does not, and a zero.
TEST(PlantModel, FindsStatesAndAMismatchedDisturbance) {
  finds_states_and_disturbance(with_zero());
}

// More states than y, y' and D: the model keeps those of x that the rows of y, y' and D leave open.
// In each row the first state is the largest, so the open ones show only after an elimination.
TEST(PlantModel, FindsStatesThatAreNoneOfTheDerivatives) {
  LinearPlant<5> plant{.a = {{-3, 1, 0, 0, 0},
                             {4, -2, 1, 0, 0},
                             {0, 0, -6, 1, 0},
                             {0, 0, 0, -7, 1},
                             {1, 0, 0, 0, -8}},
                       .b = {0, 3, 0, 0, 0.5},
                       .c = {1, 0, 0, 0, 0}};
  plant.e = {0.0, 1.0, 0.0, 0.0, 0.0};
  finds_states_and_disturbance(plant);
}

/// All parts beside the plant, with a sensor that is corrected (omega_o = 80) or left to itself.
template <int Sensor, class Lag>
void equals_the_model_of_parts(const Lag& sensor) {
  constexpr ModelParts parts{
      .order = 2, .sensor = Sensor, .constants = 2, .resonators = 2, .first_order = 1};
  constexpr ModelParts with_poles{.order = 2,
                                  .plant_poles = true,
                                  .sensor = Sensor,
                                  .constants = 2,
                                  .resonators = 2,
                                  .first_order = 1};
  const auto plant =
      LinearPlant<2>::chain({.coefficients = {-40.0, 7.0}, .input_gain = 3.0}).value();
  const std::array<esokit::Resonance<double>, 2> swings{{{50.0, 0.1, 30.0}, {120.0}}};
  auto whole = PlantEso<2, parts>::make(
      {.observer_bandwidth = 80.0,
       .input_gain = 3.0,
       .sample_time = kT,
       .model = {.plant = plant, .sensor = sensor, .resonators = swings, .first_order = {0.3}}});
  ASSERT_TRUE(whole) << whole.error();
  auto made_of_parts = esokit::ModelEso<with_poles>::make({.observer_bandwidth = 80.0,
                                                           .input_gain = 3.0,
                                                           .sample_time = kT,
                                                           .model = {.plant = {-40.0, 7.0},
                                                                     .sensor = sensor,
                                                                     .resonators = swings,
                                                                     .first_order = {0.3}}})
                           .value();
  for (int i = 0; i < whole->size; ++i) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_NEAR(whole->level_gain(0)[at] / made_of_parts.level_gain(0)[at], 1.0, 1e-9) << i;
  }
  EXPECT_EQ(whole->max_gap(), made_of_parts.max_gap());
  std::array<double, 16> largest{};
  for (int k = 0; k < 600; ++k) {
    const double y = std::sin(0.05 * k);
    const double u = std::cos(0.03 * k);
    if (k % 7 == 3) {
      (void)whole->predict(u);
      (void)made_of_parts.predict(u);
    } else {
      (void)whole->update(y, u);
      (void)made_of_parts.update(y, u);
    }
    for (int i = 0; i < whole->size; ++i) {
      double& size = largest[static_cast<std::size_t>(i)];
      size = std::max(size, std::abs(made_of_parts.estimate()(i)));
      ASSERT_NEAR(whole->estimate()(i), made_of_parts.estimate()(i), 1e-8 * size) << k << ", " << i;
    }
  }
  const auto z = whole->estimate();
  const auto& model = made_of_parts.model();
  EXPECT_NEAR(whole->model().constant(z), model.constant(made_of_parts.estimate()),
              1e-7 * std::abs(whole->model().constant(z)));
  EXPECT_NEAR(whole->model().sinusoidal_disturbance(z, 1).amplitude,
              model.sinusoidal_disturbance(made_of_parts.estimate(), 1).amplitude,
              1e-7 * whole->model().sinusoidal_disturbance(z, 1).amplitude);
  EXPECT_NEAR(whole->model().first_order_disturbance(z, 0),
              model.first_order_disturbance(made_of_parts.estimate(), 0),
              1e-7 * std::abs(whole->model().first_order_disturbance(z, 0)));
  EXPECT_EQ(whole->model().measured(z), z(whole->size - std::max(Sensor, 1)));
  const auto rest = whole->equilibrium(3.0, 0.4);
  const auto rest_of_parts = made_of_parts.equilibrium(3.0, 0.4);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(rest(i), rest_of_parts(i), 1e-12) << i;
  EXPECT_EQ(whole->model().measured(rest), 3.0);
}

TEST(PlantModel, OfAPlantOfPolesIsTheModelOfParts) {
  equals_the_model_of_parts<1>(esokit::Lag<1, double>{0.02});
  equals_the_model_of_parts<1>(esokit::Lag<1, double>{0.005});
  equals_the_model_of_parts<2>(esokit::Lag<2, double>{40.0, 0.7});
  equals_the_model_of_parts<2>(esokit::Lag<2, double>{300.0, 0.7});
}

// All parts, mismatched, with a zero and a filtered y: the plant with its disturbance and its
// sensor as one LinearPlant is what it is compared with.
TEST(PlantModel, FindsASwingAndAConstantThatEnterElsewhereBehindASensor) {
  const auto plant = with_zero();
  const double w = 40.0;
  const double tau = 0.008;
  LinearPlant<7> all{};  // x, c, q, r, f
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) all.a(i, j) = plant.a(i, j);
    all.a(i, 3) = all.a(i, 4) = plant.e(i);
    all.b(i) = plant.b(i);
    all.a(6, i) = plant.c(i) / tau;
  }
  all.a(4, 5) = w;
  all.a(5, 4) = -w;
  all.a(6, 6) = -1 / tau;
  all.c(6) = 1.0;
  const auto step = esokit::held_plant(all, kT).value();
  esokit::Vector<double, 7> x{0.1, -2.0, 1.0, 7.0, 0.0, 3.0, 0.0};

  using Eso = PlantEso<3, ModelParts{.order = 2, .sensor = 1, .resonators = 1}>;
  auto observer = Eso::make({.observer_bandwidth = 60.0,
                             .input_gain = plant.input_gain(),
                             .sample_time = kT,
                             .model = {.plant = plant, .sensor = {tau}, .resonators = {{{w}}}}})
                      .value();
  for (int k = 0; k < 3000; ++k) {
    const double u = std::sin(0.01 * k);
    x = step.advanced(x, esokit::Vector<double, 1>(u), esokit::Vector<double, 1>(0.0));
    ASSERT_EQ(observer.update(x(6), u), StepStatus::ok);
    if (k < 2000) continue;
    const auto z = observer.estimate();
    const auto& model = observer.model();
    const auto state = model.plant_state(z);
    for (int i = 0; i < 3; ++i) ASSERT_NEAR(state(i), x(i), 1e-7 * (1 + std::abs(x(i)))) << k;
    ASSERT_NEAR(model.constant(z), 7.0, 1e-5) << k;
    ASSERT_NEAR(model.disturbance(z), 7.0 + x(4), 1e-5) << k;
    ASSERT_NEAR(model.sinusoidal_disturbance(z, 0).amplitude, 3.0, 1e-5) << k;
    ASSERT_NEAR(model.sinusoidal_disturbance(z, 0).amplitude *
                    std::sin(model.sinusoidal_disturbance(z, 0).phase),
                x(4), 1e-5)
        << k;
    ASSERT_NEAR(observer.estimate()(0), (plant.c * state)(0), 1e-8) << k;
    ASSERT_NEAR(model.measured(z), x(6), 1e-8) << k;
  }
}

// A filter takes it, too.
TEST(PlantModel, AFilterFindsStatesAndDisturbance) {
  using Model = AugmentedModel<ModelParts{.order = 2, .states = 3, .resonators = 1}>;
  using Filter =
      esokit::ExtendedStateFilter<2, double, Model::extension, esokit::NoNominalModel, 0, Model>;
  const auto plant = with_zero();
  Filter::Config config;
  config.input_gain = plant.input_gain();
  config.sample_time = kT;
  config.measurement_variance = 1e-8;
  config.plant_model = {.plant = plant, .resonators = {{{40.0}}}};
  config.disturbance_bounds = {0.0, 0.0, 0.0, 1.0, 0.1, 0.1};
  config.inflation_rule = esokit::InflationRule::none;
  config.initial_covariance = Filter::Covariance::Diagonal({1, 1e2, 1e4, 1e4, 1e2, 1e2});
  auto filter = Filter::make(config);
  ASSERT_TRUE(filter) << filter.error();
  LinearPlant<6> all{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) all.a(i, j) = plant.a(i, j);
    all.a(i, 3) = all.a(i, 4) = plant.e(i);
    all.b(i) = plant.b(i);
  }
  all.a(4, 5) = 40.0;
  all.a(5, 4) = -40.0;
  all.c(0) = 1.0;
  const auto step = esokit::held_plant(all, kT).value();
  esokit::Vector<double, 6> state{0.1, -2.0, 1.0, 7.0, 0.0, 3.0};
  for (int k = 0; k < 4000; ++k) {
    state = step.advanced(state, esokit::Vector<double, 1>(0.3), esokit::Vector<double, 1>(0.0));
    (void)filter->update((plant.c * state.head<3>())(0), 0.3);
  }
  EXPECT_NEAR(filter->model().disturbance(filter->estimate()), 7.0 + state(4), 1e-5);
  EXPECT_NEAR(filter->model().sinusoidal_disturbance(filter->estimate(), 0).amplitude, 3.0, 1e-5);
}

TEST(PlantModel, AdrcTakesThePlantAsItIs) {
  const auto plant = with_zero();
  using Controller = esokit::Adrc<ZeroEso>;
  auto controller = Controller::make({.observer = {.observer_bandwidth = 60.0,
                                                   .input_gain = plant.input_gain(),
                                                   .sample_time = kT,
                                                   .model = {plant}},
                                      .controller_bandwidth = 15.0})
                        .value();
  const auto run =
      esokit::sim::run(plant, controller, {.duration = 3.0, .reference = 2.0, .disturbance = 7.0});
  ASSERT_TRUE(run);
  EXPECT_NEAR(run->output.back(), 2.0, 1e-6);
  // Two poles at omega_c: no overshoot but for the disturbance, whose share is small.
  EXPECT_LT(*std::max_element(run->output.begin(), run->output.end()), 2.1);
}

TEST(PlantModel, RestIsWhereThePlantStands) {
  const auto plant = with_zero();
  auto observer = ZeroEso::make({.observer_bandwidth = 60.0,
                                 .input_gain = plant.input_gain(),
                                 .sample_time = kT,
                                 .model = {plant}})
                      .value();
  ASSERT_EQ(observer.reset(observer.equilibrium(3.0, 0.4)), StepStatus::ok);
  const auto before = observer.estimate();
  EXPECT_EQ(before(0), 3.0);
  EXPECT_NEAR(before(2), -0.4 * plant.input_gain(), 1e-12);
  for (int k = 0; k < 300; ++k) (void)observer.update(3.0, 0.4);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(observer.estimate()(i), before(i), 1e-8 * (1 + std::abs(before(i)))) << i;
  }
}

TEST(PlantModel, RefusesWhatYDoesNotShow) {
  using Model = AugmentedModel<ModelParts{.order = 2, .states = 3}>;
  const auto make = [](const LinearPlant<3>& plant) { return Model::make({plant}, 1.0, kT); };
  auto plant = with_zero();
  EXPECT_TRUE(make(plant));
  plant.dead_time = 0.01;
  EXPECT_EQ(refusal(make(plant)),
            "model.plant.dead_time: must be 0: a delay of u is DelayedInput's");
  // A state that nothing hands on to y.
  LinearPlant<3> blind{.a = {{0, 1, 0}, {-2, -3, 0}, {1, 0, -5}}, .b = {0, 1, 0}, .c = {1, 0, 0}};
  EXPECT_EQ(refusal(make(blind)),
            "model.plant.c: makes a state unobservable: the share that y shows of it is below");
  blind.a(1, 2) = 1e-3;
  blind.e = {0.0, 1.0, 0.0};
  EXPECT_TRUE(make(blind));
  // d into the first state of a plant that differentiates it: (s (s + 3)) / ..
  LinearPlant<2> hidden{.a = {{-3, 1}, {0, 0}}, .b = {0, 1}, .c = {1, 0}};
  hidden.e = {1.0, 0.0};
  const auto answer = AugmentedModel<ModelParts{.order = 2, .states = 2}>::make({hidden}, 1.0, kT);
  EXPECT_EQ(refusal(answer),
            "model.plant.e: hides a constant disturbance behind a zero: the share that "
            "y shows of it is below");
  EXPECT_EQ(answer.error().value, 0.0);
  hidden.e = {1.0, 1e-6};
  EXPECT_TRUE((AugmentedModel<ModelParts{.order = 2, .states = 2}>::make({hidden}, 1.0, kT)));
  const auto order =
      AugmentedModel<ModelParts{.order = 1, .states = 3}>::make({with_zero()}, 1.0, kT);
  EXPECT_EQ(refusal(order), "model.plant: has another relative degree than");
  EXPECT_EQ(order.error().value, 2.0);
}

// The states beside y and y' are those that these two leave out: here both are of the first two,
// and of the first most. By the largest element of each row alone the second would be taken.
TEST(PlantModel, TakesTheStateThatYAndItsDerivativeLeaveOut) {
  LinearPlant<3> plant{
      .a = {{-3, 0, -1}, {1, -1, 1}, {-2, -3, -1}}, .b = {1, 0, 0}, .c = {2, 2, 0}};
  plant.e = plant.b;
  EXPECT_EQ(refusal(AugmentedModel<ModelParts{.order = 1, .states = 3}>::make({plant}, 2.0, kT)),
            "accepted");
}

/// (s^2 + w^2 + beside) / (s + 1)(s + 2)(s + 3) from d to y, 1 / .. from u.
LinearPlant<3> with_notch(double w, double beside) {
  auto plant =
      LinearPlant<3>::transfer_function({.numerator = {1, 0, 0}, .denominator = {6, 11, 6}})
          .value();
  plant.e = LinearPlant<3>::transfer_function(
                {.numerator = {w * w + beside, 0, 1}, .denominator = {6, 11, 6}})
                .value()
                .b;
  return plant;
}

TEST(PlantModel, RefusesASwingBehindAZeroAtItsFrequency) {
  using Model =
      AugmentedModel<ModelParts{.order = 3, .states = 3, .resonators = 2, .first_order = 1}>;
  const double w = 30.0;
  const auto make = [&](double beside, double frequency, double damping = 0.0,
                        double first_order = 0.123) {
    return Model::make({.plant = with_notch(w, beside),
                        .resonators = {{{77.0}, {frequency, damping}}},
                        .first_order = {first_order}},
                       1.0, kT);
  };
  EXPECT_TRUE(make(0.0, 31.0));
  const auto answer = make(0.0, w);
  EXPECT_EQ(refusal(answer),
            "model.resonators.frequency[1]: hides a sine behind a zero: the share that "
            "y shows of it is below");
  EXPECT_LT(answer.error().value, answer.error().limit);
  EXPECT_EQ(answer.error().limit, 1024 * std::numeric_limits<double>::epsilon());
  // As close as the value says: beside / (4 w^2), for terms of size w^2 + .. in both coefficients.
  for (const double share : {1e-12, 1e-10}) {
    EXPECT_TRUE(make(share * 8 * w * w, w)) << share;
  }
  EXPECT_FALSE(make(1e-14 * w * w, w));
  // Refused, with the share as its value, up to the rounding of the coefficients.
  EXPECT_NEAR(make(4e-13 * w * w, w).error().value / make(2e-13 * w * w, w).error().value, 2, 0.05);
  // A damped one has no zero there.
  EXPECT_TRUE(make(0.0, w, 0.01));
  // A damped zero hides the sine that decays as it does, and neither one that does not nor one that
  // decays faster.
  auto damped = with_notch(w, 0.0);
  damped.e = LinearPlant<3>::transfer_function(
                 {.numerator = {w * w, 2 * 0.2 * w, 1}, .denominator = {6, 11, 6}})
                 .value()
                 .b;
  const auto swinging = [&](double damping) {
    return refusal(Model::make(
        {.plant = damped, .resonators = {{{77.0}, {w, damping}}}, .first_order = {0.123}}, 1.0,
        kT));
  };
  EXPECT_EQ(swinging(0.2), refusal(answer));
  for (const double damping : {0.0, 0.19, 0.21}) EXPECT_EQ(swinging(damping), "accepted");
  // A zero that grows as the sine decays hides nothing.
  damped.e = LinearPlant<3>::transfer_function(
                 {.numerator = {w * w, -2 * 0.2 * w, 1}, .denominator = {6, 11, 6}})
                 .value()
                 .b;
  EXPECT_EQ(swinging(0.2), "accepted");
  // (s + 4)(s + 5) hides what fades with 1/4 s.
  auto plant = with_notch(w, 0.0);
  plant.e = LinearPlant<3>::transfer_function({.numerator = {20, 9, 1}, .denominator = {6, 11, 6}})
                .value()
                .b;
  const auto fading = [&](double tau) {
    return Model::make({.plant = plant, .resonators = {{{77.0}, {20.0}}}, .first_order = {tau}},
                       1.0, kT);
  };
  EXPECT_EQ(refusal(fading(0.25)),
            "model.first_order[0]: hides a decaying disturbance behind a zero: the share that "
            "y shows of it is below");
  EXPECT_TRUE(fading(0.26));
}

TEST(PlantModel, RefusesPartsThatMakeNoSense) {
  using Model = AugmentedModel<ModelParts{
      .order = 2, .states = 3, .sensor = 2, .resonators = 2, .first_order = 1}>;
  Model::Settings settings{.plant = with_zero(),
                           .sensor = {200.0, 0.7},
                           .resonators = {{{20.0}, {40.0}}},
                           .first_order = {0.5}};
  const auto changed = [&](const auto& change) {
    auto other = settings;
    change(other);
    return refusal(Model::make(other, 1.0, kT));
  };
  EXPECT_EQ(changed([](auto&) {}), "accepted");
  EXPECT_EQ(changed([](auto& s) { s.sensor.frequency = 0.0; }),
            "model.sensor.frequency: must be finite and positive");
  EXPECT_EQ(changed([](auto& s) { s.resonators[1].frequency = 20.0; }),
            "model.resonators.frequency[1]: must differ by a thousandth of itself from");
  EXPECT_EQ(changed([](auto& s) { s.resonators[0].frequency = -20.0; }),
            "model.resonators.frequency[0]: must be finite and positive");
  EXPECT_EQ(changed([](auto& s) { s.resonators[0].frequency = 3100.0; }),
            "model.resonators.frequency[0]: must be below half the sample rate");
  EXPECT_EQ(changed([](auto& s) { s.first_order[0] = 0.9e-5; }),
            "model.first_order[0]: must be at least a hundredth of sample_time");
  EXPECT_EQ(changed([](auto& s) { s.plant.a(1, 1) = std::nan(""); }),
            "model.plant.a[4]: must be finite");
  EXPECT_EQ(changed([](auto& s) { s.plant.b(1) = std::nan(""); }),
            "model.plant.b[1]: must be finite");
  EXPECT_EQ(changed([](auto& s) { s.plant.c(2) = std::nan(""); }),
            "model.plant.c[2]: must be finite");
  EXPECT_EQ(changed([](auto& s) { s.plant.e(0) = std::nan(""); }),
            "model.plant.e[0]: must be finite");
  EXPECT_EQ(changed([](auto& s) { s.plant.dead_time = -1.0; }),
            "model.plant.dead_time: must be finite and not negative");
}

}  // namespace model_plant_model_test
