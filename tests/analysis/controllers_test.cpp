// Every kind of controller against the linear system that the analysis makes of it: the object
// itself is run with a measurement, a reference and an applied input that have nothing to do with
// each other, so that each matrix is seen on its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/adapter/known_model.hpp>
#include <esokit/analysis/disturbance_alarm.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/loop_response.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <functional>
#include <support/refusal.hpp>
#include <support/resonator_model.hpp>
#include <utility>
#include <vector>

#include "support/numbers.hpp"

namespace analysis_controllers_test {

using namespace esokit;
using esokit_test::Random;
using esokit_test::refusal;
using List = std::vector<double>;

constexpr double T = 0.01;

/// A controller as it runs: u of (y, r, what the actuator held since the last sample).
using Step = std::function<List(const List& y, const List& r, const List& u_applied)>;
using Estimates = std::function<List()>;

/// @param share of the largest output that rounding may make
void expect_is(const LinearController& form, const Step& object, const Estimates& estimates,
               double share) {
  const int q = form.channels();
  Random random(7);
  const auto draw = [&] {
    List values;
    for (int i = 0; i < q; ++i) values.push_back(random.uniform(-1.0, 1.0));
    return values;
  };
  const auto add = [](List& to, const DynamicMatrix<double>& matrix, const List& from) {
    for (int i = 0; i < matrix.rows(); ++i) {
      for (int j = 0; j < matrix.cols(); ++j) {
        to[static_cast<std::size_t>(i)] += matrix(i, j) * from[static_cast<std::size_t>(j)];
      }
    }
  };
  List z(static_cast<std::size_t>(form.states()));
  List applied(static_cast<std::size_t>(q));
  std::vector<std::pair<double, double>> pairs;
  double largest = 0.0;
  double largest_estimate = 0.0;
  std::vector<std::pair<double, double>> estimate_pairs;
  for (int k = 0; k < 80; ++k) {
    const List y = draw();
    const List r = draw();
    const List real = object(y, r, applied);
    List u(static_cast<std::size_t>(q));
    add(u, form.to_u, z);
    add(u, form.y_to_u, y);
    add(u, form.r_to_u, r);
    for (std::size_t i = 0; i < u.size(); ++i) {
      pairs.emplace_back(u[i], real[i]);
      largest = std::max(largest, std::abs(real[i]));
    }
    if (form.estimates() > 0) {
      const List told = estimates();
      List zhat(told.size());
      ASSERT_EQ(form.estimates(), static_cast<int>(told.size()));
      add(zhat, form.to_estimate, z);
      add(zhat, form.y_to_estimate, y);
      add(zhat, form.r_to_estimate, r);
      for (std::size_t i = 0; i < zhat.size(); ++i) {
        estimate_pairs.emplace_back(zhat[i], told[i]);
        largest_estimate = std::max(largest_estimate, std::abs(told[i]));
      }
    }
    applied = draw();
    for (double& u_applied : applied) u_applied *= 0.2;
    List change(z.size());
    add(change, form.a, z);
    add(change, form.from_y, y);
    add(change, form.from_r, r);
    add(change, form.from_u, applied);
    for (std::size_t i = 0; i < z.size(); ++i) z[i] += change[i];
  }
  EXPECT_GT(largest, 0.1);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    ASSERT_NEAR(pairs[i].first, pairs[i].second, share * largest) << "u, sample " << i;
  }
  for (std::size_t i = 0; i < estimate_pairs.size(); ++i) {
    ASSERT_NEAR(estimate_pairs[i].first, estimate_pairs[i].second, share * largest_estimate)
        << "estimate " << i;
  }
}

template <class Estimate>
List listed(const Estimate& estimate) {
  List list;
  for (const auto& value : estimate) list.push_back(static_cast<double>(value));
  return list;
}

/// One with applied(u), update(y, r) and an observer.
template <class Controller>
void expect_is_linear(Controller controller, double share = 1e-11) {
  static_assert(AnalysedController<Controller>);
  using S = typename Controller::scalar_type;
  const Expected<LinearController, Error<double>> form = linear_controller(controller);
  ASSERT_TRUE(form.has_value()) << form;
  expect_is(
      *form,
      [&](const List& y, const List& r, const List& u) -> List {
        controller.applied(static_cast<S>(u[0]));
        return {static_cast<double>(controller.update(static_cast<S>(y[0]), static_cast<S>(r[0])))};
      },
      [&] { return listed(controller.observer().estimate()); }, share);
}

/// An Adrc around any observer. @param run samples at rest first, for gains that settle
template <class Observer, class Form = OutputBased>
void expect_adrc(const typename Observer::Config& config, double share = 1e-11, int run = 0) {
  using Controller = Adrc<Observer, Form>;
  using S = typename Controller::scalar_type;
  auto controller = Controller::make({.observer = config, .controller_bandwidth = S(4)}).value();
  for (int k = 0; k < run; ++k) {
    controller.applied(S(0));
    controller.update(S(0), S(0));
  }
  expect_is_linear(controller, share);
}

const LinearEso<2>::Config linear{.observer_bandwidth = 20.0, .input_gain = 2.5, .sample_time = T};

TEST(LinearController, OfEveryObserver) {
  expect_adrc<LinearEso<2>>(linear);
  expect_adrc<LinearEso<2>, ErrorBased>(linear);
  expect_adrc<LinearEso<1, double, 2>>(
      {.observer_bandwidth = 20.0, .input_gain = -2.5, .sample_time = T});
  expect_adrc<LinearEso<2, float>>(
      {.observer_bandwidth = 20.0f, .input_gain = 2.5f, .sample_time = 0.01f}, 1e-4);
  LinearEso<1, double, 1, PoleSet>::Config placed;
  placed.poles = {{{-10.0, 5.0}, {-10.0, -5.0}}};
  placed.input_gain = 2.5;
  placed.sample_time = T;
  expect_adrc<LinearEso<1, double, 1, PoleSet>>(placed);
  expect_adrc<HalfGainEso<1>>({.observer_bandwidth = 20.0, .input_gain = 2.5, .sample_time = T});
  expect_adrc<ReducedOrderEso<2>>(
      {.observer_bandwidth = 20.0, .input_gain = 2.5, .sample_time = T});
  expect_adrc<CascadeEso<2, 3>>(
      {.observer_bandwidth = 10.0, .bandwidth_factor = 2.0, .input_gain = 2.5, .sample_time = T});
  using Resonator = LinearEso<1, double, 3, EqualPoles, esokit_test::ResonatorModel<1, double>>;
  Resonator::Config swinging;
  swinging.observer_bandwidth = 20.0;
  swinging.input_gain = 2.5;
  swinging.sample_time = T;
  swinging.model.frequency = 7.0;
  expect_adrc<Resonator>(swinging, 1e-10);
}

TEST(LinearController, OfAModelOfSensorActuatorAndSwing) {
  constexpr ModelParts parts{
      .order = 1, .plant_poles = true, .actuator = 1, .sensor = 2, .resonators = 1};
  using Eso = ModelEso<parts>;
  Eso::Config config;
  config.observer_bandwidth = 20.0;
  config.input_gain = 2.5;
  config.sample_time = T;
  config.model.plant = {1.5};
  config.model.actuator.time_constant = 0.05;
  config.model.sensor.frequency = 150.0;
  config.model.resonators[0].frequency = 7.0;
  expect_adrc<Eso>(config, 1e-9);
}

TEST(LinearController, OfAGainThatHasSettled) {
  expect_adrc<AlgebraicEso<1>>(
      {.observer_bandwidth = 20.0, .frequency_shift = 50.0, .input_gain = 2.5, .sample_time = T},
      1e-9, 600);
  ExtendedStateFilter<1>::Config filter;
  filter.input_gain = 2.5;
  filter.sample_time = T;
  filter.measurement_variance = 0.01;
  filter.disturbance_bounds = {0.0, 0.5};
  filter.inflation_rule = InflationRule::none;
  expect_adrc<ExtendedStateFilter<1>>(filter, 1e-9, 3000);
}

using Poles = ModelEso<ModelParts{.order = 2, .plant_poles = true}>;

TEST(LinearController, OfEveryAdapter) {
  for (const int delay : {0, 1, 3}) {
    SCOPED_TRACE(delay);
    expect_adrc<DelayedInput<LinearEso<2>, 3>>({.observer = linear, .delay = delay});
  }
  const Poles::Config poles{
      .observer_bandwidth = 20.0, .input_gain = 2.5, .sample_time = T, .model = {{30.0, 4.0}}};
  expect_adrc<Poles>(poles);
  expect_adrc<Poles, ErrorBased>(poles);
  expect_adrc<DelayedInput<Poles, 2>>({.observer = poles, .delay = 2});
  expect_adrc<WrappedOutput<LinearEso<2>>>({.observer = linear, .period = 100.0});
  expect_adrc<WrappedOutput<Poles>>({.observer = poles, .period = 100.0});
  expect_adrc<OutlierGate<LinearEso<2>>>({.observer = linear, .threshold = 1e6});
  expect_adrc<VariableTime<LinearEso<2>>>({.observer = linear});
  expect_adrc<VariableTime<DelayedInput<LinearEso<2>, 2>>>(
      {.observer = {.observer = linear, .delay = 2}});
}

/// While it does not rest, it is the controller.
TEST(LinearController, OfOneThatMayRest) {
  const auto rests = [&](double time) {
    return Resting<Adrc<LinearEso<2>>>::make(
               {.controller = {.observer = linear, .controller_bandwidth = 4.0},
                .rest = {.error = 1e-3, .time = time}})
        .value();
  };
  expect_is_linear(rests(100.0));
  const auto plant = LinearPlant<2>::chain({.input_gain = 2.5}).value();
  const auto there =
      disturbance_alarm(plant, rests(0.1), {.load = 1, .noise = {.measurement = {1e-3}}});
  ASSERT_TRUE(there.has_value()) << there;
  const auto plain = disturbance_alarm(plant, rests(0.1).controller(),
                                       {.load = 1, .noise = {.measurement = {1e-3}}});
  EXPECT_EQ(there->threshold, plain->threshold);
}

TEST(LinearController, OfGuardsWithTheB0OfNow) {
  using Observer = Guarded<DelayedInput<LinearEso<2>, 2>>;
  const Observer::Config config{.observer = {.observer = linear, .delay = 1}};
  auto controller = Adrc<Observer>::make({.observer = config, .controller_bandwidth = 4.0}).value();
  expect_is_linear(controller);
  ASSERT_TRUE(controller.set_input_gain(4.0).has_value());
  expect_is_linear(controller);
  auto compensator = DisturbanceCompensator<Observer>::make({.observer = config}).value();
  ASSERT_TRUE(compensator.set_input_gain(1.5).has_value());
  expect_is_linear(compensator);
}

template <class Observer>
void expect_leaking(const typename Observer::Config& config, double share = 1e-11) {
  using Leaking = Guarded<Observer>;
  using S = typename Observer::scalar_type;
  for (const S leak_time : {S(0), S(1) / S(8), S(2)}) {
    SCOPED_TRACE(leak_time);
    const typename Leaking::Config guarded{.observer = config, .leak_time = leak_time};
    auto controller =
        Adrc<Leaking>::make({.observer = guarded, .controller_bandwidth = S(4)}).value();
    expect_is_linear(controller, share);
    ASSERT_TRUE(controller.set_input_gain(S(4)).has_value());
    expect_is_linear(controller, share);
  }
}

TEST(LinearController, OfALeak) {
  expect_leaking<LinearEso<2>>(linear);
  expect_leaking<LinearEso<2, float>>(
      {.observer_bandwidth = 20.0f, .input_gain = 2.5f, .sample_time = 0.01f}, 1e-4);
  expect_leaking<DelayedInput<LinearEso<2>, 3>>({.observer = linear, .delay = 2});
  expect_leaking<WrappedOutput<DelayedInput<LinearEso<2>, 3>>>(
      {.observer = {.observer = linear, .delay = 2}, .period = 100.0});
  expect_leaking<CascadeEso<2, 3>>(
      {.observer_bandwidth = 10.0, .bandwidth_factor = 2.0, .input_gain = 2.5, .sample_time = T});
  constexpr ModelParts parts{
      .order = 1, .plant_poles = true, .actuator = 1, .sensor = 2, .resonators = 1};
  ModelEso<parts>::Config config;
  config.observer_bandwidth = 20.0;
  config.input_gain = 2.5;
  config.sample_time = T;
  config.model.plant = {1.5};
  config.model.actuator.time_constant = 0.05;
  config.model.sensor.frequency = 150.0;
  config.model.resonators[0] = {.frequency = 7.0, .capture_bandwidth = 1.0};
  expect_leaking<ModelEso<parts>>(config, 1e-9);
}

/// What a load leads to in the analysis is what it leads to in the loop.
TEST(LinearController, LeakLeavesALoad) {
  using Controller = Adrc<Guarded<LinearEso<2>>>;
  const auto controller = Controller::make({.observer = {.observer = linear, .leak_time = 2.0},
                                            .controller_bandwidth = 4.0})
                              .value();
  const auto plant = LinearPlant<2>::chain({.input_gain = 2.5}).value();
  const auto response = load_response(plant, controller, {.duration = 60.0}).value();
  EXPECT_NEAR(response.output[0].back(), controller.leak_error(), 1e-9);
  EXPECT_GT(std::abs(controller.leak_error()), 1e-3);
}

TEST(LinearController, OfSettingsOfTheController) {
  using Controller = Adrc<LinearEso<2>>;
  expect_is_linear(Controller::make({.observer = linear,
                                     .controller_bandwidth = 4.0,
                                     .domain = TimeDomain::sampled,
                                     .half_gain = true})
                       .value());
  expect_is_linear(
      Controller::make({.observer = linear, .gains = Array<double, 2>{9.0, 5.0}}).value());
  expect_is_linear(DisturbanceCompensator<LinearEso<2>>::make({.observer = linear}).value());
  expect_is_linear(
      DisturbanceCompensator<LinearEso<2>>::make({.observer = linear, .compensation_gain = 0.7})
          .value());
  EXPECT_EQ(
      refusal(linear_controller(
          Controller::make(
              {.observer = linear, .controller_bandwidth = 4.0, .measurement_divider = 2})
              .value())),
      "measurement_divider: must be 1: the analysis needs a loop that is the same at every sample");
  EXPECT_EQ(
      refusal(linear_controller(
          DisturbanceCompensator<LinearEso<2>>::make({.observer = linear, .measurement_divider = 2})
              .value())),
      "measurement_divider: must be 1: the analysis needs a loop that is the same at every sample");
}

TEST(LinearController, OfTwoPhases) {
  // The estimates are those of the prediction there; u is what counts.
  const auto run = [](auto controller) {
    LinearController form = linear_controller(controller);
    form.to_estimate = {};
    expect_is(
        form,
        [&](const List& y, const List& r, const List& u) -> List {
          controller.applied(u[0]);
          controller.set_reference(r[0]);
          const double now = controller.control(y[0]);
          controller.prepare(0.0);
          return {now};
        },
        {}, 1e-11);
  };
  run(PredictiveAdrc<LinearEso<2>>::make({.observer = linear, .controller_bandwidth = 4.0})
          .value());
  run(PredictiveAdrc<CascadeEso<1, 2>>::make({.observer = {.observer_bandwidth = 10.0,
                                                           .bandwidth_factor = 2.0,
                                                           .input_gain = 2.5,
                                                           .sample_time = T},
                                              .controller_bandwidth = 4.0})
          .value());
}

/// A PI with a filtered derivative of the measurement, as a user has it.
struct Pid {
  double proportional, integral, derivative, filter;
  double sum = 0.0, slope = 0.0, last = 0.0;

  double update(double y, double r) {
    const double blend = T / (filter + T);
    slope += blend * ((y - last) / T - slope);
    last = y;
    const double u = proportional * (r - y) + sum - derivative * slope;
    sum += integral * T * (r - y);
    return u;
  }
};

LinearController linear_controller(const Pid& pid) {
  LinearController form(3, 1, 0, T);  // sum, slope and y of the sample before
  const double blend = T / (pid.filter + T);
  form.from_y(0, 0) = -pid.integral * T;
  form.from_r(0, 0) = pid.integral * T;
  form.a(1, 1) = -blend;
  form.a(1, 2) = -blend / T;
  form.from_y(1, 0) = blend / T;
  form.a(2, 2) = -1.0;
  form.from_y(2, 0) = 1.0;
  form.to_u(0, 0) = 1.0;
  form.to_u(0, 1) = -pid.derivative * (1.0 - blend);
  form.to_u(0, 2) = pid.derivative * blend / T;
  form.y_to_u(0, 0) = -pid.proportional - pid.derivative * blend / T;
  form.r_to_u(0, 0) = pid.proportional;
  return form;
}

TEST(LinearController, OfAControllerOfYoursAndACompensatorAroundIt) {
  Pid pid{3.0, 2.0, 0.5, 0.03};
  static_assert(AnalysedController<Pid>);
  expect_is(
      linear_controller(pid),
      [&](const List& y, const List& r, const List&) -> List { return {pid.update(y[0], r[0])}; },
      {}, 1e-11);

  Pid base{3.0, 2.0, 0.5, 0.03};
  auto compensator = DisturbanceCompensator<LinearEso<2>>::make({.observer = linear}).value();
  expect_is(
      linear_controller(Compensated{compensator, base}).value(),
      [&](const List& y, const List& r, const List& u) -> List {
        compensator.applied(u[0]);
        return {compensator.update(y[0], base.update(y[0], r[0]))};
      },
      [&] { return listed(compensator.observer().estimate()); }, 1e-11);
  // Its own description is told u0, what the compensator adds is not its own.
  EXPECT_EQ(linear_controller(Compensated{compensator, base})->input_gain, 0.0);
  auto other = linear_controller(base);
  other.sample_time = 2.0 * T;
  EXPECT_EQ(refusal(linear_controller(Compensated{compensator, other})),
            "base.sample_time: must be that of the compensator, which is");
  EXPECT_EQ(refusal(linear_controller(Compensated{compensator, LinearController(1, 2, 0, T)})),
            "base.channels: must be one, as the compensator has");
}

template <class First>
void expect_two_channels(const typename First::Config& first) {
  using Controller = MimoAdrc<First, CascadeEso<1, 2>>;
  typename Controller::Config config;
  std::get<0>(config.observers) = first;
  std::get<1>(config.observers) = {
      .observer_bandwidth = 10.0, .bandwidth_factor = 2.0, .sample_time = T};
  config.controller_bandwidths = {4.0, 3.0};
  config.input_matrix = {{2.0, 0.7}, {-0.4, 1.5}};
  auto controller = Controller::make(config).value();
  expect_is(
      linear_controller(controller),
      [&](const List& y, const List& r, const List& u) -> List {
        controller.applied({u[0], u[1]});
        return listed(controller.update({y[0], y[1]}, {r[0], r[1]}));
      },
      [&] {
        List all = listed(controller.template observer<0>().estimate());
        for (const double value : controller.template observer<1>().estimate()) {
          all.push_back(value);
        }
        return all;
      },
      1e-11);
}

TEST(LinearController, OfSeveralChannels) {
  expect_two_channels<LinearEso<2>>({.observer_bandwidth = 20.0, .sample_time = T});
  expect_two_channels<ModelEso<ModelParts{.order = 1, .actuator = 1}>>(
      {.observer_bandwidth = 20.0, .sample_time = T, .model = {.actuator = {0.05}}});
}

TEST(LinearController, OfAnObserverAndALaw) {
  const auto observer = LinearEso<2>::make(linear).value();
  const auto law = [](double b0) {
    return AdrcLaw<2>::make({.controller_bandwidth = 4.0, .input_gain = b0}).value();
  };
  const auto adrc =
      linear_controller(
          Adrc<LinearEso<2>>::make({.observer = linear, .controller_bandwidth = 4.0}).value())
          .value();
  const auto parts = linear_controller(ObserverWithLaw{observer, law(2.5)}).value();
  EXPECT_EQ(parts.to_u(0, 1), adrc.to_u(0, 1));
  EXPECT_EQ(parts.r_to_u(0, 0), adrc.r_to_u(0, 0));
  // A frozen observer with the gains of a linear one is that.
  FrozenObserver<2> frozen;
  frozen.gains[0] = observer.level_gain(0);
  frozen.gain_of_input = 2.5;
  frozen.time_step = T;
  const auto held = linear_controller(ObserverWithLaw{frozen, law(2.5)}).value();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(held.from_y(i, 0), adrc.from_y(i, 0));

  EXPECT_EQ(refusal(linear_controller(ObserverWithLaw{observer, law(3.0)})),
            "input_gain: of the observer must be that of the law, which is");
  EXPECT_EQ(refusal(linear_controller(ObserverWithLaw{observer, law(2.5), ErrorBased{}})),
            "input_gain: of the observer must be minus that of the law, which is");
  // b0 comes back as it was given, so the next number is another one.
  EXPECT_EQ(refusal(linear_controller(ObserverWithLaw{observer, law(std::nextafter(2.5, 3.0))})),
            "input_gain: of the observer must be that of the law, which is");
  // In float it is the same number.
  const auto single =
      AdrcLaw<2, float>::make({.controller_bandwidth = 4.0f, .input_gain = static_cast<float>(0.3)})
          .value();
  auto in_double = linear;
  in_double.input_gain = 0.3;
  EXPECT_TRUE(linear_controller(ObserverWithLaw{LinearEso<2>::make(in_double).value(), single})
                  .has_value());
}

// What is neither linear nor has a linear mode.
static_assert(!AnalysedController<Adrc<NonlinearEso<2>>>);
static_assert(!AnalysedObserver<NonlinearEso<2>>);
struct Saturating {
  double operator()(const Vector<double, 3>& estimate) const noexcept {
    return std::tanh(estimate(0));
  }
};
static_assert(!AnalysedObserver<KnownModel<LinearEso<2>, Saturating>>);
static_assert(!AnalysedController<int>);

/// The state of a slow actuator (0.1 s) is computed from u and not corrected: the error decays by
/// that, however fast the observer.
TEST(SlowestPole, SaysWhenAnObserverIsBack) {
  auto observer = esokit::ModelEso<esokit::ModelParts{.order = 1, .actuator = 1}>::make(
                      {.observer_bandwidth = 100,
                       .input_gain = 1,
                       .sample_time = 1e-3,
                       .model = {.actuator = {.time_constant = 0.1}}})
                      .value();
  const double rate = -stability_abscissa(observer_system(observer));
  EXPECT_NEAR(rate, -std::expm1(-0.01), 1e-9);
  (void)observer.update(1, 1e300);
  int needed = 0;
  const int most = 60 + static_cast<int>(1500 / rate);
  for (int k = 1; k <= most; ++k) {
    (void)observer.update(0.5, 0);
    if (!(std::abs(observer.total_disturbance()) < 1e-6)) needed = k + 1;
  }
  EXPECT_LE(needed, most);
  EXPECT_GT(needed, 60 + 1500 / (100 * 1e-3));
}

}  // namespace analysis_controllers_test
