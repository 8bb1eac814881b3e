// Any linear plant as a model: with a zero, with a disturbance that enters elsewhere, equal to the
// chain where it is one, and refused where y does not show it all.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/adrc.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/model/plant_model.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/run.hpp>

#include <support/refusal.hpp>

namespace {

using esokit::LinearEso;
using esokit::LinearPlant;
using esokit::LinearPlantModel;
using esokit::StepStatus;
using esokit_test::refusal;

constexpr double kT = 1e-3;

template <int States, int Order, int Constants = 1>
using PlantEso = LinearEso<Order, double, States + Constants - Order, esokit::EqualPoles,
                           LinearPlantModel<States, Order, double, Constants>>;

/// (s + 30) 200 / (s^3 + 12 s^2 + 47 s + 60), with d into the second state.
LinearPlant<3> with_zero() {
  auto plant =
      LinearPlant<3>::transfer_function({.numerator = {6000, 200, 0}, .denominator = {60, 47, 12}})
          .value();
  plant.e = {0.0, 1.0, 0.0};
  return plant;
}

TEST(LinearPlantModel, AChainEqualsLinearEso) {
  auto model =
      PlantEso<2, 2, 2>::make({.observer_bandwidth = 80.0,
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

// A disturbance that enters where u does not, and a zero: states and d to rounding, and D is what
// is left of y^(n) without u.
TEST(LinearPlantModel, FindsStatesAndAMismatchedDisturbance) {
  const auto plant = with_zero();
  ASSERT_EQ(plant.relative_degree(), 2);
  auto observer = PlantEso<3, 2>::make({.observer_bandwidth = 60.0,
                                        .input_gain = plant.input_gain(),
                                        .sample_time = kT,
                                        .model = {plant}})
                      .value();
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
        for (int i = 0; i < 3; ++i) {
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

TEST(LinearPlantModel, AdrcTakesThePlantAsItIs) {
  const auto plant = with_zero();
  using Controller = esokit::Adrc<PlantEso<3, 2>>;
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

TEST(LinearPlantModel, RestIsWhereThePlantStands) {
  const auto plant = with_zero();
  auto observer = PlantEso<3, 2>::make({.observer_bandwidth = 60.0,
                                        .input_gain = plant.input_gain(),
                                        .sample_time = kT,
                                        .model = {plant}})
                      .value();
  ASSERT_EQ(observer.reset(observer.rest(3.0, 0.4)), StepStatus::ok);
  const auto before = observer.estimate();
  EXPECT_EQ(before(0), 3.0);
  EXPECT_NEAR(before(2), -0.4 * plant.input_gain(), 1e-12);
  for (int k = 0; k < 300; ++k) (void)observer.update(3.0, 0.4);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(observer.estimate()(i), before(i), 1e-8 * (1 + std::abs(before(i)))) << i;
  }
}

TEST(LinearPlantModel, RefusesWhatYDoesNotShow) {
  using Model = LinearPlantModel<3, 2>;
  const auto make = [](const LinearPlant<3>& plant) { return Model::make({plant}, 1.0, kT); };
  auto plant = with_zero();
  EXPECT_TRUE(make(plant));
  plant.dead_time = 0.01;
  EXPECT_EQ(refusal(make(plant)),
            "model.plant.dead_time: must be 0: a delay of u is DelayedInput's");
  // A state that nothing hands on to y.
  LinearPlant<3> blind{.a = {{0, 1, 0}, {-2, -3, 0}, {1, 0, -5}}, .b = {0, 1, 0}, .c = {1, 0, 0}};
  EXPECT_EQ(refusal(make(blind)),
            "model.plant.c: leaves a state unobservable: of it y shows a share below");
  blind.a(1, 2) = 1e-3;
  blind.e = {0.0, 1.0, 0.0};
  EXPECT_TRUE(make(blind));
  // d into the first state of a plant that differentiates it: (s (s + 3)) / ..
  LinearPlant<2> hidden{.a = {{-3, 1}, {0, 0}}, .b = {0, 1}, .c = {1, 0}};
  hidden.e = {1.0, 0.0};
  const auto answer = LinearPlantModel<2, 2>::make({hidden}, 1.0, kT);
  EXPECT_EQ(refusal(answer),
            "model.plant.e: lets a constant disturbance hide behind a zero: of it y shows a share "
            "below");
  EXPECT_EQ(answer.error().value, 0.0);
  hidden.e = {1.0, 1e-6};
  EXPECT_TRUE((LinearPlantModel<2, 2>::make({hidden}, 1.0, kT)));
  const auto order = LinearPlantModel<3, 1>::make({with_zero()}, 1.0, kT);
  EXPECT_EQ(refusal(order), "model.plant: has another relative degree than");
  EXPECT_EQ(order.error().value, 2.0);
}

}  // namespace
