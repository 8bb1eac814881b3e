#include <support/no_allocation.hpp>
//
#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <limits>
#include <string>
#include <support/refusal.hpp>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_mimo_adrc_test {

using esokit::EigenMatrix;
using esokit::LinearEso;
using esokit::MimoAdrc;
using Two = MimoAdrc<LinearEso<2>, LinearEso<1>>;

constexpr double period = 1e-3;

Two::Config base() {
  Two::Config config{.observers = {{.observer_bandwidth = 60, .sample_time = period},
                                   {.observer_bandwidth = 40, .sample_time = period}},
                     .controller_bandwidths = {10, 8}};
  config.input_matrix = {{2, 1}, {0.5, 3}};
  return config;
}

/// y_1'' = d_1 + (B u)_1, y_2' = d_2 + (B u)_2, exact for a held u.
struct CoupledPlant {
  EigenMatrix<double, 2, 2> gain;
  ChainPlant first{2, period, 1, -3};
  ChainPlant second{1, period, 1, 2};

  [[nodiscard]] EigenMatrix<double, 2> output() const { return {first.output(), second.output()}; }
  void step(const EigenMatrix<double, 2>& u) {
    const EigenMatrix<double, 2> drive = gain * u;
    first.step(drive(0));
    second.step(drive(1));
  }
};

/// Axes on a circle, and drives that reach the plant late, are what they are in Adrc.
TEST(MimoAdrc, DecoratedChannelsAreThoseOfAdrc) {
  using Axis = esokit::WrappedOutput<LinearEso<1>>;
  MimoAdrc<Axis>::Config circle{
      .observers = {{.observer = {.observer_bandwidth = 20, .sample_time = period}, .period = 360}},
      .controller_bandwidths = {5}};
  circle.input_matrix(0, 0) = 1;
  auto axis = MimoAdrc<Axis>::make(circle).value();
  using Vector1 = EigenMatrix<double, 1>;
  // 350 and -10 degrees are one place.
  ASSERT_EQ(axis.start(Vector1(350.0), Vector1(0.0)), esokit::StepStatus::ok);
  for (const double reference : {350.0, -10.0, 710.0}) {
    EXPECT_NEAR(axis.update(Vector1(350.0), Vector1(reference))(0), 0, 1e-9);
  }

  using Late = esokit::DelayedInput<LinearEso<1>, 8>;
  MimoAdrc<Late>::Config config{
      .observers = {{.observer = {.observer_bandwidth = 20, .sample_time = period}, .delay = 5}},
      .controller_bandwidths = {5}};
  config.input_matrix(0, 0) = 1;
  auto late = MimoAdrc<Late>::make(config).value();
  ASSERT_EQ(late.start(Vector1(1.0), Vector1(5.0)), esokit::StepStatus::ok);
  for (int k = 0; k < 20; ++k) EXPECT_NEAR(late.update(Vector1(1.0), Vector1(1.0))(0), 5, 1e-9);
  config.input_matrix(0, 0) = 2;
  ASSERT_TRUE(late.retune(config).has_value());
  for (int k = 0; k < 20; ++k) EXPECT_NEAR(late.update(Vector1(1.0), Vector1(1.0))(0), 5, 1e-9);
}

/// A disturbance that is measured is told to each channel that has it; a channel alone is Adrc.
TEST(MimoAdrc, MeasuredChannels) {
  using Told = esokit::Measured<LinearEso<1>, 1, 3>;
  Told::Config channel{.observer = {.observer_bandwidth = 20, .sample_time = period}};
  channel.inputs[0] = {-3, 0.05, 2 * period};
  MimoAdrc<Told>::Config alone{.observers = {channel}, .controller_bandwidths = {5}};
  alone.input_matrix(0, 0) = 2;
  auto one = MimoAdrc<Told>::make(alone).value();
  auto with_gain = channel;
  with_gain.observer.input_gain = 2;
  auto same = esokit::Adrc<Told>::make({.observer = with_gain, .controller_bandwidth = 5}).value();

  MimoAdrc<Told, Told>::Config config{.observers = {channel, channel},
                                      .controller_bandwidths = {5, 5}};
  config.input_matrix = {{2, 1}, {0.5, -3}};
  auto both = MimoAdrc<Told, Told>::make(config).value();
  double most = 0;
  for (int k = 0; k < 400; ++k) {
    const double w = k < 50 ? 0 : 1 + std::sin(0.1 * k), y = 0.1 * std::cos(0.03 * k);
    one.observer<0>().measured(w);
    same.measured(w);
    ASSERT_NEAR(one.update(EigenMatrix<double, 1>(y), EigenMatrix<double, 1>(0.5))(0),
                same.update(y, 0.5), 1e-9);
    // u cancels what w does to both, so neither moves.
    both.observer<0>().measured(w);
    both.observer<1>().measured(w);
    const auto u = both.update({0, 0}, {0, 0});
    const double f = both.observer<1>().known_part();
    ASSERT_NEAR(2 * u(0) + u(1), -f, 1e-9);
    ASSERT_NEAR(0.5 * u(0) - 3 * u(1), -f, 1e-9);
    most = std::max(most, std::abs(f));
  }
  EXPECT_GT(most, 3);
}

/// After a gap that nothing bridges it begins in the steady state of its output, as Adrc does.
TEST(MimoAdrc, RestartAfterALongGapDoesNotBump) {
  auto settings = base();
  std::get<0>(settings.observers).max_gap = 10;
  std::get<1>(settings.observers).max_gap = 10;
  auto controller = Two::make(settings).value();
  const EigenMatrix<double, 2> y(1, 2);
  const EigenMatrix<double, 2> u(3, -1);
  ASSERT_EQ(controller.start(y, u), esokit::StepStatus::ok);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 30; ++k) controller.update({nan, nan}, y);
  EXPECT_LE(eigen(controller.update(y, y) - u).norm(), 1e-9);
  EXPECT_EQ(controller.status(0), esokit::StepStatus::restarted);
}

/// With the right B0 each channel is as if it were alone.
TEST(MimoAdrc, ChannelsAreDecoupled) {
  auto both = Two::make(base()).value();
  auto alone = Adrc<LinearEso<2>>::make(
                   {.observer = {.observer_bandwidth = 60, .input_gain = 1, .sample_time = period},
                    .controller_bandwidth = 10})
                   .value();
  CoupledPlant plant{base().input_matrix};
  ChainPlant single(2, period, 1, -3);
  for (int k = 0; k < 4000; ++k) {
    // The other channel is stepped up and down meanwhile.
    plant.step(both.update(plant.output(), {1, k % 500 < 250 ? 1.0 : -1.0}));
    single.step(alone.update(single.output(), 1.0));
    ASSERT_NEAR(plant.output()(0), single.output(), 1e-9) << k;
  }
  EXPECT_NEAR(plant.output()(0), 1, 1e-6);
}

/// A wrong B0 is disturbance.
/// B0 of each sample, which turns and grows: the loop does not notice. Told late or not at all it
/// does.
TEST(MimoAdrc, InputMatrixOfEachSample) {
  for (const bool told : {true, false}) {
    auto controller = Two::make(base()).value();
    CoupledPlant plant{eigen(base().input_matrix)};
    const EigenMatrix<double, 2> reference(1.0, -2.0);
    double off = 0;
    for (int k = 0; k < 8000; ++k) {
      const double angle = 0.4 * std::sin(0.05 * k);
      const EigenMatrix<double, 2, 2> turn{{std::cos(angle), -std::sin(angle)},
                                           {std::sin(angle), std::cos(angle)}};
      plant.gain = (1 + 0.3 * std::sin(0.31 * k)) * turn * eigen(base().input_matrix);
      if (told) {
        ASSERT_TRUE(controller.set_input_matrix(plant.gain).has_value());
      }
      plant.step(eigen(controller.update(plant.output(), reference)));
      if (k < 6000) continue;
      off = std::max(off, std::abs(plant.output()(0) - 1));
      off = std::max(off, std::abs(controller.observer<0>().total_disturbance() + 3));
    }
    if (told) {
      EXPECT_LT(off, 1e-8);
    } else {
      EXPECT_GT(off, 1e-2);
    }
  }
}

TEST(MimoAdrc, InputMatrixThatIsRefusedChangesNothing) {
  auto controller = Two::make(base()).value();
  const Two::InputMatrix flat{{2, 1}, {4, 2.0001}};
  EXPECT_EQ(refusal(controller.set_input_matrix(flat)),
            "input_matrix: has a condition number (the value here) that must be at most");
  Two::InputMatrix bad = base().input_matrix;
  bad(1, 0) = hidden_nan<double>();
  EXPECT_EQ(refusal(controller.set_input_matrix(bad)), "input_matrix[2]: must be finite");
  EXPECT_EQ(controller.input_matrix(), base().input_matrix);
}

/// On the ground with the operator's u: no dhat moves, and the first free step does not kick. One
/// channel has the lag of its actuator in the model, and b0 of what it delivers changes.
TEST(MimoAdrc, HeldAndScheduled) {
  using Motor = esokit::Guarded<esokit::ModelEso<esokit::ModelParts{.order = 1, .actuator = 1}>>;
  using Plain = esokit::Guarded<LinearEso<1>>;
  using Loop = MimoAdrc<Motor, Plain>;
  Loop::Config config{.controller_bandwidths = {10, 8}};
  config.input_matrix = {{2, 1}, {0.5, 3}};
  std::get<0>(config.observers).observer = {
      .observer_bandwidth = 60, .sample_time = period, .model = {.actuator = {0.02}}};
  std::get<1>(config.observers).observer = {.observer_bandwidth = 40, .sample_time = period};
  auto loop = Loop::make(config).value();
  const Loop::InputMatrix gain = config.input_matrix;
  const Loop::InputMatrix later{{2.5, 1}, {0.25, 2}};
  ASSERT_EQ(loop.start({0.5, -1.0}, {0.25, 0.5}), esokit::StepStatus::ok);
  // At rest: d = -B0 u.
  const Loop::Output d = -(gain * Loop::Output{0.25, 0.5});
  double lagging = (gain * Loop::Output{0.25, 0.5})(0);
  Loop::Output y{0.5, -1.0};
  const auto found = [&] {
    return Loop::Output{esokit::disturbance_parts(loop.observer<0>()).constant,
                        loop.observer<1>().total_disturbance()};
  };
  const double left = std::exp(-period / 0.02);
  for (int k = 0; k < 500; ++k) {
    const Loop::Output u{0.1 * std::sin(0.01 * k), -0.3};
    lagging = (gain * u)(0) + (lagging - (gain * u)(0)) * left;
    // The sample that ends now still has the B0 of before.
    if (k == 499) {
      ASSERT_TRUE(loop.set_input_matrix(later).has_value());
    }
    ASSERT_EQ(loop.hold(y, u), u);
    for (int i = 0; i < 2; ++i) ASSERT_NEAR(found()(i), d(i), 1e-11);
    ASSERT_FALSE(loop.observer<0>().gated());
  }
  double share = 1;
  for (int k = 0; k < 3000; ++k) {
    const Loop::Output drive = later * loop.output();
    y(0) += share * (period * drive(0) + (lagging - drive(0)) * 0.02 * (1 - left)) + period * d(0);
    y(1) += period * (drive(1) + d(1));
    lagging = drive(0) + (lagging - drive(0)) * left;
    share = 1 + 0.5 * std::sin(0.2 * k);
    ASSERT_TRUE(loop.observer<0>().set_input_gain(share).has_value());
    (void)loop.update(y, {0.5, -1.0});
    for (int i = 0; i < 2; ++i) ASSERT_NEAR(found()(i), d(i), 1e-9) << k;
  }
  EXPECT_NEAR(y(0), 0.5, 0.05);
  EXPECT_NEAR(y(1), -1, 1e-9);
}

TEST(MimoAdrc, WrongMatrix) {
  auto config = base();
  config.input_matrix = {{1.7, 0.6}, {0.8, 3.4}};
  auto controller = Two::make(config).value();
  CoupledPlant plant{base().input_matrix};
  for (int k = 0; k < 8000; ++k) plant.step(controller.update(plant.output(), {1, -1}));
  EXPECT_NEAR(plant.output()(0), 1, 1e-6);
  EXPECT_NEAR(plant.output()(1), -1, 1e-6);
}

/// Each actuator has its limits, and the observers are told: innovations as without.
TEST(MimoAdrc, Limits) {
  auto limited_config = base();
  limited_config.limits[0] = {.lower = -3, .upper = 5};
  limited_config.limits[1] = {.lower = -4, .upper = 2, .rate = 200};
  auto free = Two::make(base()).value();
  auto limited = Two::make(limited_config).value();
  CoupledPlant a{base().input_matrix};
  CoupledPlant b = a;
  int at_limit = 0;
  for (int k = 0; k < 3000; ++k) {
    a.step(free.update(a.output(), {1, -1}));
    const EigenMatrix<double, 2> u = limited.update(b.output(), {1, -1});
    ASSERT_GE(u(0), -3);
    ASSERT_LE(u(0), 5);
    ASSERT_GE(u(1), -4);
    ASSERT_LE(u(1), 2);
    at_limit += u(0) >= 5 || u(1) <= -4 ? 1 : 0;
    b.step(u);
    ASSERT_NEAR(free.observer<0>().innovation(), limited.observer<0>().innovation(), 1e-9);
    ASSERT_NEAR(free.observer<1>().innovation(), limited.observer<1>().innovation(), 1e-9);
  }
  EXPECT_GT(at_limit, 20);
  EXPECT_NEAR(b.output()(0), 1, 1e-4);
}

TEST(MimoAdrc, StartAndRetuneDoNotBump) {
  auto controller = Two::make(base()).value();
  CoupledPlant plant{base().input_matrix};
  const EigenMatrix<double, 2> steady =
      eigen(base().input_matrix).inverse() * EigenMatrix<double, 2>(3, -2);
  const EigenMatrix<double, 2> y(0.4, -0.2);
  plant.first.set_state({0.4, 0});
  plant.second.set_state({-0.2});
  EXPECT_EQ(controller.start(y, steady), StepStatus::ok);
  for (int k = 0; k < 50; ++k) {
    const EigenMatrix<double, 2> u = controller.update(plant.output(), y);
    ASSERT_LT((u - steady).norm(), 1e-9);
    plant.step(u);
  }
  auto changed = base();
  changed.input_matrix = {{1.5, 0.2}, {0.9, 2}};
  std::get<0>(changed.observers).observer_bandwidth = 90;
  changed.controller_bandwidths = {7, 11};
  ASSERT_TRUE(controller.retune(changed).has_value());
  EXPECT_LT(eigen((controller.update(plant.output(), y) - steady)).norm(), 1e-9);
  eigen(changed.input_matrix).setZero();
  EXPECT_EQ(refusal(controller.retune(changed)),
            "input_matrix: has a condition number (the value here) that must be at most");
  EXPECT_EQ(controller.start({hidden_nan<double>(), 0}, steady), StepStatus::state_rejected);
}

TEST(MimoAdrc, BadSamplesOfOneChannel) {
  auto controller = Two::make(base()).value();
  auto missing = controller;
  const double nan = hidden_nan<double>();
  controller.update({nan, 0.1}, {0, 0});
  EXPECT_EQ(controller.status(0), StepStatus::measurement_rejected);
  EXPECT_EQ(controller.status(1), StepStatus::ok);
  EXPECT_EQ(controller.observer<0>().missed(), 1);
  EXPECT_EQ(controller.observer<1>().missed(), 0);
  const EigenMatrix<double, 2> before = controller.output();
  EXPECT_EQ(controller.update({0, 0.1}, {nan, nan}), before);
  EXPECT_TRUE(std::isfinite(controller.update({0, 0.1}, {0, 0}).sum()));
  EXPECT_EQ(controller.applied({nan, 0.5}), StepStatus::input_rejected);
  controller.update({0, 0.1}, {0, 0});
  EXPECT_TRUE(std::isfinite(controller.output().sum()));
  {
    const NoAllocation guard;
    missing.update({0.1, nan}, {0, 1});
    missing.start({0, 0}, {1, 1});
    EXPECT_EQ(guard.count(), 0);
  }
}

/// A bad reference is that channel's business: it keeps its (B0 u)_i, the other is controlled as
/// ever.
TEST(MimoAdrc, BadReferenceOfOneChannel) {
  for (const double bad : {hidden_nan<double>(), hidden_infinity<double>()}) {
    for (const int channel : {0, 1}) {
      auto controller = Two::make(base()).value();
      const EigenMatrix<double, 2, 2> b0 = base().input_matrix;
      EigenMatrix<double, 2> y(0.1, -0.2);
      for (int k = 0; k < 5; ++k) controller.update(y, {0.3, 0.4});
      for (int k = 0; k < 20; ++k) {
        auto other = controller;
        const EigenMatrix<double, 2> held = b0 * controller.output();
        EigenMatrix<double, 2> r(0.3, 0.4);
        const EigenMatrix<double, 2> good = b0 * other.update(y, r);
        r(channel) = bad;
        const EigenMatrix<double, 2> drive = b0 * controller.update(y, r);
        ASSERT_NEAR(drive(channel), held(channel), 1e-9 * std::abs(held(channel)));
        ASSERT_NEAR(drive(1 - channel), good(1 - channel), 1e-9 * std::abs(good(1 - channel)));
        ASSERT_EQ(controller.status(channel), StepStatus::reference_rejected);
        ASSERT_EQ(controller.status(1 - channel), StepStatus::ok);
        y += EigenMatrix<double, 2>(0.01, -0.01);
      }
    }
  }
}

TEST(MimoAdrc, BadConfigIsRefusedByName) {
  const auto error = [](auto change) {
    auto config = base();
    change(config);
    const auto made = Two::make(config);
    return made;
  };
  using C = Two::Config;
  EXPECT_EQ(refusal(error([](C&) {})), "accepted");
  auto singular = error([](C& c) { c.input_matrix = {{1, 2}, {2, 4}}; });
  EXPECT_EQ(refusal(singular),
            "input_matrix: has a condition number (the value here) that must be at most");
  EXPECT_TRUE(std::isinf(singular.error().value));
  EXPECT_EQ(refusal(error([](C& c) { eigen(c.input_matrix).setZero(); })),
            "input_matrix: has a condition number (the value here) that must be at most");
  auto ill = error([](C& c) { c.input_matrix = {{1, 1}, {1, 1.0001}}; });
  EXPECT_EQ(refusal(ill),
            "input_matrix: has a condition number (the value here) that must be at most");
  // kappa_1 = 4.0004 * (2 / 0.0001 / ..): by hand (|a|+|c|) (|d|+|b|) / |ad - bc| ~ 4 / 1e-4.
  EXPECT_NEAR(ill.error().value, 4e4, 10);
  EXPECT_EQ(ill.error().limit, 1000);
  // Units do not matter: rows and columns in other units, the same condition.
  EXPECT_NEAR(error([](C& c) {
                c.input_matrix = {{1e6, 1e-3}, {1, 1.0001e-9}};
              })
                  .error()
                  .value,
              4e4, 10);
  EXPECT_EQ(refusal(error([](C& c) { c.input_matrix = {{2e6, 1e-3}, {1, 3e-9}}; })), "accepted");
  EXPECT_EQ(
      refusal(error([](C& c) { c.input_matrix(0, 1) = std::numeric_limits<double>::quiet_NaN(); })),
      "input_matrix[1]: must be finite");
  EXPECT_EQ(refusal(error([](C& c) { c.condition_limit = 1; })),
            "condition_limit: must be finite and above");
  auto bandwidth = error([](C& c) { c.controller_bandwidths[1] = 0; });
  EXPECT_EQ(refusal(bandwidth), "controller_bandwidths[1]: must be finite and positive");
  auto gain = error([](C& c) { std::get<1>(c.observers).input_gain = 3; });
  EXPECT_EQ(refusal(gain), "input_gain[1]: is given by input_matrix: leave it out");
  EXPECT_EQ(refusal(error([](C& c) { std::get<1>(c.observers).sample_time = 1; })),
            "sample_time[1]: must be the same in all channels, as");
  EXPECT_EQ(refusal(error([](C& c) { c.limits[1] = {.lower = 1, .upper = 0}; })),
            "limits.lower[1]: must be below limits.upper");
}

TEST(MimoAdrc, BadNumberAnywhereInTheInputMatrix) {
  Two::Config config{.observers = {{.observer_bandwidth = 50, .sample_time = 1e-3},
                                   {.observer_bandwidth = 50, .sample_time = 1e-3}},
                     .controller_bandwidths = {10, 10}};
  config.input_matrix = {{2, 1}, {0.5, 3}};
  ASSERT_EQ(refusal(Two::make(config)), "accepted");
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (const double bad : {hidden_nan<double>(), hidden_infinity<double>()}) {
        auto changed = config;
        changed.input_matrix(i, j) = bad;
        EXPECT_EQ(refusal(Two::make(changed)),
                  "input_matrix[" + std::to_string(2 * i + j) + "]: must be finite");
      }
    }
  }
}

}  // namespace control_mimo_adrc_test
}  // namespace esokit_test
