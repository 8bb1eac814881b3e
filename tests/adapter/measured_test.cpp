// Measured: what measured disturbances do is not left to the observer.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/run.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace adapter_measured_test {

using namespace esokit;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

/// y^(n) = f + d + b0 u, f by a lag and a dead time from w: in small parts, each exact in the lag,
/// with its own arithmetic. Not for the chain of order 1 and 2 alone: a pole, an actuator.
struct FinePlant {
  int order = 1;
  double b0 = 2, T = 0.01, d = 0;
  MeasuredInput<double> input{};
  double pole = 0, actuator = 0;
  int parts = 400;

  std::vector<double> w{};
  double f = 0, y = 0, slope = 0, v = 0, known = 0;

  void step(double newest, double u) {
    w.push_back(newest);
    const double h = T / parts;
    const double start = (static_cast<double>(w.size()) - 1) * T;
    for (int i = 0; i < parts; ++i) {
      const auto at = static_cast<int>(std::floor((start + (i + 0.5) * h - input.dead_time) / T));
      const double arrives = at < 0 ? 0 : w[static_cast<std::size_t>(at)];
      const double reach = input.lag > 0 ? 1 - std::exp(-h / input.lag) : 1;
      const double mean = input.lag > 0 ? arrives + (f - arrives) * input.lag / h * reach : arrives;
      f += reach * (arrives - f);
      const double driven =
          actuator > 0 ? v + (u - v) * (1 - actuator / h * -std::expm1(-h / actuator)) : u;
      if (actuator > 0) v += (u - v) * -std::expm1(-h / actuator);
      const double rate = input.gain * mean + d + b0 * driven;
      if (order == 1 && pole > 0) {
        y += (rate / pole - y) * -std::expm1(-h * pole);
      } else if (order == 1) {
        y += h * rate;
      } else {
        y += h * slope + 0.5 * h * h * rate;
        slope += h * rate;
      }
    }
  }
};

template <class O>
typename Measured<O, 1, 5>::Config config(const FinePlant& plant, double bandwidth = 30) {
  typename Measured<O, 1, 5>::Config all{};
  using S = typename O::scalar_type;
  auto& chain = chain_config<O>(all.observer);
  chain.observer_bandwidth = static_cast<S>(bandwidth);
  chain.input_gain = static_cast<S>(plant.b0);
  chain.sample_time = static_cast<S>(plant.T);
  if constexpr (requires { chain.bandwidth_factor; }) chain.bandwidth_factor = S(1.5);
  all.inputs[0] = {static_cast<S>(plant.input.gain), static_cast<S>(plant.input.lag),
                   static_cast<S>(plant.input.dead_time)};
  return all;
}

double moving(int k) { return k < 40 ? 0 : 1 + 2 * std::sin(0.13 * k) + (k % 50 < 25 ? 0 : 1); }

/// The largest part of w's effect that is found instead of known, in a loop; its y.
struct Found {
  double residual = 0, y = 0;
};
template <class O>
Found found_in(FinePlant plant, int samples = 400) {
  using S = typename O::scalar_type;
  using M = Measured<O, 1, 5>;
  auto loop = Adrc<M>::make({.observer = config<O>(plant), .controller_bandwidth = S(5)}).value();
  Found found;
  for (int k = 0; k < samples; ++k) {
    const double w = moving(k);
    loop.measured(static_cast<S>(w));
    const S u = loop.update(static_cast<S>(plant.y), S(0));
    found.residual = std::max(
        found.residual, std::abs(static_cast<double>(loop.observer().residual_disturbance())));
    found.y = std::max(found.y, std::abs(plant.y));
    plant.step(w, static_cast<double>(u));
  }
  return found;
}

TEST(Measured, IsExactForOrderOne) {
  for (const double b0 : {2.0, -2.0}) {
    for (const double lag : {0.0, 1e-5, 0.004, 0.3, 50.0}) {
      for (const double dead_time : {0.0, 0.01, 0.0237, 0.05}) {
        SCOPED_TRACE(testing::Message() << b0 << ' ' << lag << ' ' << dead_time);
        // Whole parts, so that w changes where a part ends.
        const FinePlant plant{
            .b0 = b0, .input = {-3, lag, std::round(dead_time * 4e4) / 4e4}, .parts = 400};
        // w's effect is 12; what remains is the rounding of 400 parts a sample.
        EXPECT_LT(found_in<LinearEso<1>>(plant).residual, 3e-9);
        EXPECT_LT(found_in<LinearEso<1>>(plant).y, 3e-10);
      }
    }
  }
  const FinePlant plant{.input = {-3, 0.3, 0.0235}};
  EXPECT_LT((found_in<CascadeEso<1, 2>>(plant).residual), 3e-9);
  EXPECT_LT((found_in<LinearEso<1, double, 2>>(plant).residual), 3e-9);
  EXPECT_LT((found_in<LinearEso<1, float>>(plant).residual), 2e-3);
}

TEST(Measured, OfOrderTwoIsExactWithoutALagAndOfSecondOrderWithOne) {
  const FinePlant whole{.order = 2, .input = {4, 0, 0.02}};
  EXPECT_LT(found_in<LinearEso<2>>(whole).residual, 3e-8);
  // T^3 f' / 12 in y a sample: the residual falls with T^2 at the same w(t).
  const auto residual = [](double T) {
    FinePlant plant{.order = 2, .T = T, .input = {4, 0.1, 0}};
    auto loop = Adrc<Measured<LinearEso<2>, 1, 5>>::make(
                    {.observer = config<LinearEso<2>>(plant), .controller_bandwidth = 5})
                    .value();
    double most = 0;
    for (int k = 0; k < 2 / T; ++k) {
      const double w = k * T < 0.2 ? 0 : 1;
      loop.measured(w);
      const double u = loop.update(plant.y, 0.0);
      most = std::max(most, std::abs(loop.observer().residual_disturbance()));
      plant.step(w, u);
    }
    return most;
  };
  const double ratio = residual(0.01) / residual(0.005);
  EXPECT_GT(ratio, 3.3);
  EXPECT_LT(ratio, 4.7);
  EXPECT_LT(residual(0.005), 0.01 * 4);
}

/// With poles and an actuator in the model, f acts behind the actuator: the constant of d does not
/// have it.
TEST(Measured, ActsBehindTheActuator) {
  using Model = ModelEso<ModelParts{.order = 1, .plant_poles = true, .actuator = 1}>;
  FinePlant plant{.input = {-3, 0, 0.02}, .pole = 4, .actuator = 0.05};
  auto settings = config<Model>(plant);
  settings.observer.model = {.plant = {4}, .actuator = {.time_constant = 0.05}};
  auto observer = Measured<Model, 1, 5>::make(settings).value();
  double u = 0;
  for (int k = 0; k < 300; ++k) {
    const double w = moving(k);
    observer.measured(w);
    observer.update(plant.y, u);
    const auto z = observer.estimate();
    ASSERT_NEAR(observer.model().constant(z), observer.known_part(), 2e-8) << k;
    ASSERT_NEAR(z(0), plant.y, 1e-9);
    u = std::sin(0.2 * k);
    plant.step(w, u);
  }
}

TEST(Measured, AGainWrongBy30PercentLeaves30PercentToTheObserver) {
  FinePlant plant{.input = {-3, 0.05, 0.01}};
  auto settings = config<LinearEso<1>>(plant);
  for (const double factor : {0.7, 1.3, -1.0}) {
    settings.inputs[0].gain = -3 * factor;
    FinePlant one = plant;
    auto loop =
        Adrc<Measured<LinearEso<1>, 1, 5>>::make({.observer = settings, .controller_bandwidth = 5})
            .value();
    for (int k = 0; k < 500; ++k) {
      loop.measured(2);
      one.step(2, loop.update(one.y, 0.0));
    }
    EXPECT_NEAR(loop.observer().residual_disturbance(), -6 * (1 - factor), 1e-9);
    EXPECT_NEAR(loop.observer().total_disturbance(), -6, 1e-9);
    EXPECT_NEAR(one.y, 0, 1e-9);
  }
}

/// Before y has moved, u is lower by g w / b0, within the limits; in either form.
TEST(Measured, IsCancelledAtOnceAndWithinTheLimits) {
  for (const double b0 : {2.0, -2.0}) {
    FinePlant plant{.b0 = b0, .input = {3, 0, 0}};
    using M = Measured<LinearEso<1>, 1, 5>;
    const AdrcConfig<M> settings{
        .observer = config<LinearEso<1>>(plant), .controller_bandwidth = 5, .limits = {-1, 1}};
    auto loop = Adrc<M>::make(settings).value();
    auto by_error = Adrc<M, ErrorBased>::make(settings).value();
    auto helper = DisturbanceCompensator<M>::make({.observer = settings.observer}).value();
    for (const double w : {0.25, -0.5, 2.0}) {
      auto one = loop;
      auto other = by_error;
      one.measured(w);
      other.measured(w);
      helper.measured(w);
      const double wanted = -3 * w / b0;
      EXPECT_DOUBLE_EQ(one.update(0, 0), std::clamp(wanted, -1.0, 1.0));
      EXPECT_DOUBLE_EQ(one.requested(), wanted);
      EXPECT_DOUBLE_EQ(other.update(0, 0), std::clamp(wanted, -1.0, 1.0));
      auto first = helper;
      EXPECT_DOUBLE_EQ(first.update(0, 0), wanted);
    }
  }
}

TEST(Measured, TheTwoPhasesGiveTheSame) {
  const FinePlant machine{.order = 2, .d = 0.5, .input = {4, 0.1, 0.013}};
  using M = Measured<LinearEso<2>, 1, 5>;
  auto loop =
      Adrc<M>::make({.observer = config<LinearEso<2>>(machine), .controller_bandwidth = 5}).value();
  auto early = PredictiveAdrc<M>::make(
                   {.observer = config<LinearEso<2>>(machine), .controller_bandwidth = 5})
                   .value();
  FinePlant plant = machine;
  early.set_reference(1.0);
  for (int k = 0; k < 300; ++k) {
    const bool lost = k % 17 == 3 || (k > 100 && k < 180);
    if (!lost) {
      loop.measured(moving(k));
      early.measured(moving(k));
    }
    const double u = loop.update(plant.y, 1.0);
    ASSERT_NEAR(early.control(plant.y), u, 1e-9) << k;
    ASSERT_EQ(early.observer().lost(), loop.observer().lost()) << k;
    early.prepare(1.0);
    plant.step(moving(k), u);
  }
}

TEST(Measured, ALostOneIsHeldThenDroppedAndComesBack) {
  auto settings = config<LinearEso<1>>({.input = {3, 0, 0}});
  settings.most_lost = 4;
  const auto fresh = Measured<LinearEso<1>, 1, 5>::make(settings).value();
  for (int kind = 0; kind < 5; ++kind) {
    auto o = fresh;
    o.measured(0.5);
    o.update(0, 0);
    EXPECT_EQ(o.known_part(), 1.5);
    for (int k = 1; k < 9; ++k) {
      constexpr std::array<double, 4> bad{nan, infinite, -infinite, 1e308};
      if (kind < 4) o.measured(bad[static_cast<std::size_t>(kind)]);
      if (k % 2 == 0) {
        o.update(0, 0);
      } else {
        o.predict(0);
      }
      EXPECT_EQ(o.lost(), k);
      EXPECT_EQ(o.dropped(), k > 4);
      EXPECT_EQ(o.known_part(), k > 4 ? 0.0 : 1.5) << k;
      EXPECT_TRUE(is_finite(o.total_disturbance()));
    }
    o.measured(-1);
    o.update(0, 0);
    EXPECT_EQ(o.lost(), 0);
    EXPECT_FALSE(o.dropped());
    EXPECT_EQ(o.known_part(), -3);
  }
  // For as long as it takes.
  auto o = fresh;
  for (int k = 0; k < 70'000; ++k) o.predict(0);
  EXPECT_TRUE(o.dropped());
}

/// Several, each with its own path and losses.
TEST(Measured, SeveralAddUp) {
  using M = Measured<LinearEso<1>, 2, 3>;
  M::Config settings{.observer = {.observer_bandwidth = 30, .input_gain = 2, .sample_time = 0.01}};
  settings.inputs = {{{.gain = 3}, {.gain = -5, .dead_time = 0.02}}};
  settings.most_lost = 1;
  auto o = M::make(settings).value();
  const auto give = [&](double a, double b) {
    o.measured(Vector<double, 2>{a, b});
    o.update(0, 0);
    return o.known_part();
  };
  EXPECT_EQ(give(1, 1), 3);
  EXPECT_EQ(give(1, nan), 3);
  EXPECT_EQ(o.lost(0), 0);
  EXPECT_EQ(o.lost(1), 1);
  EXPECT_EQ(give(1, nan), -2);
  EXPECT_EQ(give(1, nan), -2);
  EXPECT_EQ(give(nan, 2), 3);
  EXPECT_TRUE(!o.dropped(0) && !o.dropped(1));
}

TEST(Measured, ARetuneKeepsWhatIsCancelledAndTheMemory) {
  FinePlant plant{.d = 0.5, .input = {-3, 0.1, 0.02}};
  using M = Measured<LinearEso<1>, 1, 5>;
  auto settings = config<LinearEso<1>>(plant);
  settings.inputs[0].gain = -1;
  auto loop = Adrc<M>::make({.observer = settings, .controller_bandwidth = 5}).value();
  for (int k = 0; k < 200; ++k) {
    loop.measured(moving(k));
    plant.step(moving(k), loop.update(plant.y, 0.0));
  }
  const double total = loop.observer().total_disturbance();
  settings.inputs[0].gain = -3;
  auto told = loop;
  ASSERT_TRUE(told.retune({.observer = settings, .controller_bandwidth = 5}));
  EXPECT_EQ(told.observer().total_disturbance(), total);
  EXPECT_NEAR(told.observer().known_part(), 3 * loop.observer().known_part(), 1e-12);
  // A refused one changes nothing.
  settings.inputs[0].dead_time = 0.06;
  const auto before = snapshot(told);
  EXPECT_FALSE(told.retune({.observer = settings, .controller_bandwidth = 5}));
  auto again = from_snapshot<Adrc<M>>(before).value();
  // Once d is found, it does not move with w any more.
  for (int k = 200; k < 900; ++k) {
    told.measured(moving(k));
    again.measured(moving(k));
    const double u = told.update(plant.y, 0.0);
    ASSERT_EQ(again.update(plant.y, 0.0), u);
    plant.step(moving(k), u);
    if (k > 600) {
      ASSERT_NEAR(told.observer().residual_disturbance(), 0.5, 1e-8) << k;
    }
  }
}

/// A gain that makes of a w in the memory more than the scalar holds is refused.
TEST(Measured, ARetuneThatOverflowsIsRefused) {
  using M = Measured<LinearEso<1>, 1, 5>;
  auto settings = config<LinearEso<1>>({.input = {3, 0, 0.03}});
  auto o = M::make(settings).value();
  o.measured(1e200);
  o.update(0, 0);
  o.measured(0);
  o.update(0, 0);
  settings.inputs[0].gain = 1e150;
  const auto refused = o.retune(settings);
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "inputs.gain");
  EXPECT_EQ(o.known_part(), 0);
  settings.inputs[0].gain = 1e50;
  EXPECT_TRUE(o.retune(settings));
  for (int k = 0; k < 9; ++k) o.update(0, 0);
  EXPECT_TRUE(is_finite(o.total_disturbance()));
}

/// Guards scale what is found, not what is told: with no trust, pinned or held, dhat moves by f
/// only.
TEST(Measured, GuardsDoNotHoldWhatIsTold) {
  const auto run = [](auto fresh) {
    for (int kind = 0; kind < 3; ++kind) {
      auto o = fresh;
      for (int k = 0; k < 5; ++k) o.update(0, 0);
      if (kind == 0) o.set_trust(0);
      if (kind == 1) o.set_pin(Pin::upper);
      double u = 0;
      for (int k = 0; k < 40; ++k) {
        const double w = moving(30 + k);
        o.measured(w);
        if (kind == 2) u = o.hold(u);
        const double before = o.observer().known_part();
        const double dhat = o.total_disturbance();
        o.update(0, u);
        const double found = o.total_disturbance() - dhat - (o.observer().known_part() - before);
        // b0 > 0 at the upper limit: dhat may only rise.
        if (kind == 1) {
          EXPECT_GE(found, -1e-12) << k;
        } else {
          EXPECT_NEAR(found, 0, 1e-12) << kind << ' ' << k;
        }
      }
    }
  };
  run(Guarded<Measured<LinearEso<1>, 1, 5>>::make(
          {.observer = config<LinearEso<1>>({.input = {3, 0.1, 0.02}})})
          .value());
  run(Guarded<Measured<CascadeEso<1, 2>, 1, 5>>::make(
          {.observer = config<CascadeEso<1, 2>>({.input = {3, 0.1, 0.02}})})
          .value());
  // The bound is one of f + d.
  auto o = Guarded<Measured<LinearEso<1>, 1, 5>>::make(
               {.observer = config<LinearEso<1>>({.input = {3, 0, 0}}), .disturbance_bound = 2})
               .value();
  o.measured(1);
  o.predict(0);
  EXPECT_EQ(o.total_disturbance(), 2);
}

/// A start at rest under w: u stays, whatever w is, and only its change is cancelled.
TEST(Measured, AStartTakesThePlantAtRest) {
  using M = Measured<LinearEso<1>, 1, 5>;
  auto loop = Adrc<M>::make({.observer = config<LinearEso<1>>({.input = {3, 0.1, 0.02}}),
                             .controller_bandwidth = 5})
                  .value();
  loop.measured(7);
  ASSERT_EQ(loop.start(20, 0.25), StepStatus::ok);
  for (int k = 0; k < 50; ++k) {
    loop.measured(7);
    ASSERT_NEAR(loop.update(20, 20), 0.25, 1e-12) << k;
  }
  EXPECT_NEAR(loop.observer().known_part(), 21, 1e-12);
}

TEST(Measured, BadSettingsAreRefused) {
  const auto settings = config<LinearEso<1>>({.input = {3, 0.1, 0.05}});
  using M = Measured<LinearEso<1>, 1, 5>;
  EXPECT_TRUE(M::make(settings));
  const auto refused = [&](auto change, const char* field) {
    auto bad = settings;
    change(bad);
    const auto made = M::make(bad);
    ASSERT_FALSE(made);
    EXPECT_STREQ(made.error().field, field);
  };
  refused([](auto& c) { c.inputs[0].gain = nan; }, "inputs.gain");
  refused([](auto& c) { c.inputs[0].gain = infinite; }, "inputs.gain");
  refused([](auto& c) { c.inputs[0].lag = -1e-9; }, "inputs.lag");
  refused([](auto& c) { c.inputs[0].lag = infinite; }, "inputs.lag");
  refused([](auto& c) { c.inputs[0].lag = 10'001; }, "inputs.lag");
  refused([](auto& c) { c.inputs[0].dead_time = -1e-9; }, "inputs.dead_time");
  refused([](auto& c) { c.inputs[0].dead_time = 0.0501; }, "inputs.dead_time");
  refused([](auto& c) { c.most_lost = -1; }, "most_lost");
  refused([](auto& c) { c.most_lost = 65536; }, "most_lost");
}

/// Any calls in any order: nothing becomes infinite, a copy goes on alike, f is what an
/// independent computation gives, and with good samples d is found again.
TEST(Measured, AnyCallsInAnyOrder) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    FinePlant plant{
        .b0 = random.index(2) == 0 ? 2.0 : -2.0,
        .d = random.uniform(-2, 2),
        .input = {random.uniform(-4, 4), random.index(3) == 0 ? 0 : 0.2 * random.uniform(0, 1),
                  0.0025 * random.index(20)},
        .parts = 40};
    using M = Measured<LinearEso<1>, 1, 5>;
    auto settings = config<LinearEso<1>>(plant);
    settings.most_lost = random.index(6);
    auto o = M::make(settings).value();
    constexpr std::array<double, 8> odd{nan, infinite, -infinite, 1e308, -1e308, 1e3, 0, 1e-310};
    for (int k = 0; k < 300; ++k) {
      if (random.index(3) > 0) o.measured(random.uniform(-3, 3));
      if (random.index(9) == 0) o.measured(odd[static_cast<std::size_t>(random.index(8))]);
      const double y =
          random.index(9) == 0 ? odd[static_cast<std::size_t>(random.index(3))] : plant.y;
      const double u = random.index(9) == 0 ? nan : random.uniform(-1, 1);
      switch (random.index(12)) {
        case 0:
          o.predict(u);
          break;
        case 1:
          o.correct(y);
          break;
        case 2:
          o.revise_measured();
          break;
        case 3:
          o.settle_measured();
          break;
        case 4:
          o.reset(random.uniform(-5, 5));
          break;
        case 5: {
          auto other = settings;
          other.inputs[0].gain = random.uniform(-4, 4);
          other.inputs[0].lag = 0.1 * random.index(3);
          other.inputs[0].dead_time = 0.01 * random.index(7);
          const bool fits = other.inputs[0].dead_time < 0.055;
          ASSERT_EQ(o.retune(other).has_value(), fits);
          break;
        }
        default: {
          M copy = o;
          ASSERT_EQ(o.update(y, u), copy.update(y, u));
          ASSERT_EQ(o.total_disturbance(), copy.total_disturbance());
        }
      }
      for (const double x : o.estimate()) ASSERT_TRUE(is_finite(x)) << k;
      ASSERT_TRUE(is_finite(o.known_part()));
    }
    ASSERT_TRUE(o.retune(settings));
    double u = 0;
    for (int k = 0; k < 900; ++k) {
      const double w = moving(k);
      o.measured(w);
      o.update(plant.y, u);
      if (k > 600) {
        ASSERT_NEAR(o.residual_disturbance(), plant.d, 1e-6) << k;
      }
      u = random.uniform(-1, 1);
      plant.step(w, u);
    }
  }
}

/// Steps of any length: f follows them.
TEST(Measured, AroundVariableTime) {
  using M = Measured<VariableTime<LinearEso<1>>, 1, 5>;
  auto settings = config<VariableTime<LinearEso<1>>>({.input = {3, 0.1, 0}});
  settings.observer.ratio = 3;
  auto o = M::make(settings).value();
  FinePlant plant{.input = {3, 0.1, 0}};
  Random random(5);
  double u = 0, w = 0, last = 0.01, y = 0;
  for (int k = 0; k < 400; ++k) {
    ASSERT_TRUE(o.set_step_time(last));
    w = moving(k);
    o.measured(w);
    o.update(y, u);
    // Exact in each sample; f was known for the length of the step before only.
    if (k > 0) {
      ASSERT_NEAR(o.residual_disturbance(), 0, 1e-9) << k;
    }
    u = random.uniform(-1, 1);
    last = 0.01 * std::exp(random.uniform(-1, 1));
    plant.T = last;
    plant.w.clear();
    plant.step(w, u);
    y = plant.y;
  }
}

/// A simulation hands w over; lanes do as one.
TEST(Measured, InARun) {
  const auto plant = LinearPlant<1>::chain({.input_gain = 2}).value();
  using M = Measured<LinearEso<1>, 1, 5>;
  const auto loop = [&](double gain) {
    return Adrc<M>::make({.observer = config<LinearEso<1>>({.input = {gain, 0, 0}}),
                          .controller_bandwidth = 5})
        .value();
  };
  const auto fan = [](double t) { return t < 1 ? 0.0 : 1.0; };
  const auto most = [&](double gain) {
    double y = 0;
    sim::RunConfig<LinearPlant<1>, Adrc<M>> settings{.duration = 3};
    settings.disturbance = [&](double t) { return -3 * fan(t); };
    settings.measured = fan;
    const auto end = sim::run(plant, loop(gain), settings, [&](const auto& sample) {
      y = std::max(y, std::abs(sample.output));
    });
    EXPECT_TRUE(end.has_value());
    return y;
  };
  EXPECT_GT(most(0), 0.05);
  EXPECT_LT(most(-3), 1e-12);
  EXPECT_NEAR(most(0.7 * -3) / most(0), 0.3, 1e-9);
}

static_assert(sizeof(Measured<LinearEso<1, float>>) % 4 == 0);
static_assert(PredictableObserver<Measured<LinearEso<2>>>);
static_assert(!PredictableObserver<DelayedInput<Measured<LinearEso<2>>, 2>>);
static_assert(observer_traits<Guarded<Measured<LinearEso<2>>>>.takes_measured);
static_assert(!observer_traits<LinearEso<2>>.takes_measured);

}  // namespace adapter_measured_test
}  // namespace esokit_test
