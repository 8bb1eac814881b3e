// The C of what the curve of an actuator is around equals it bit for bit, and what is refused.
#include <array>
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/health.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/health_code.hpp>
#include <support/refusal.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_mapped_test {

using namespace esokit;
using detail::Writable;

using Mapped = MappedInput<LinearEso<2, double>>;

static_assert(Writable<Mapped> && Writable<Adrc<Mapped>> &&
              Writable<MappedInput<Guarded<LinearEso<2>>>>);
// Its first phase is one list.
static_assert(!Writable<PredictiveAdrc<Mapped>>);
static_assert(detail::WatchedController<Adrc<LinearEso<2>>> &&
              !detail::WatchedController<Adrc<Mapped>>);

TEST(CMapped, SaysWhatItDoesNotWrite) {
  FixedPointOptions counts{};
  counts.y = counts.u = {.unit = 1e-3, .most = 4000};
  const auto fixed = to_fixed_c(Adrc<Mapped>::make(config<Adrc<Mapped>>(8)).value(), counts);
  EXPECT_EQ(refusal(fixed),
            "observer: is in MappedInput, which is not written in fixed point: give u the table of "
            "its effect yourself");
}

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

/// Of a curve without a point, with one, and with as many as there may be.
TEST(CMapped, OfAnyCurve) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto with = [](const auto& curve, auto seed) {
    using V = std::remove_cvref_t<decltype(curve.slope_below)>;
    equals_changed<Adrc<MappedInput<LinearEso<2, V>>>>(
        30000, static_cast<std::uint64_t>(seed), "gcc -std=c99",
        [&](auto& settings) { settings.observer.curve = curve; });
  };
  with(ActuatorCurve<float>{.slope_above = 0.75F}, 1401);
  with(ActuatorCurve<float>::two_gains(1.5F, 0.3F), 1411);
  with(ActuatorCurve<double>::square(3), 1421);
  with(ActuatorCurve<double>::from_table<4>({-3, -1, 0.5, 2}, {-2, -1.5, 0.25, 2.5}), 1431);
}

/// A u at a point of the curve is on the line above it, whose rounding there is its own.
TEST(CMapped, AtThePointsOfACurve) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Observer = MappedInput<LinearEso<1, double>>;
  auto settings = observer_config<Observer>(8);
  const std::array<double, 9> points{-7.3, -5.1, -3.7, -1.9, 0.3, 1.1, 3.3, 5.9, 7.7};
  settings.curve = ActuatorCurve<double>::from_table<9>(
      points, {-3.1, -2.9, -1.3, -0.7, 0.1, 0.9, 1.7, 4.1, 4.3});
  auto observer = Observer::make(settings).value();
  const Folder folder;
  InC<double> in_c(folder, to_c(observer, {.name = "loop"}).value(), false);
  ASSERT_TRUE(in_c.loaded());
  for (const double u : points) {
    EXPECT_EQ(static_cast<unsigned>(observer.reset(0.0)), in_c.reset(0.0));
    EXPECT_EQ(static_cast<unsigned>(observer.predict(u)), in_c.predict(u));
    compare_estimates(observer, in_c, 0);
  }
}

/// For what is added to the effect before the curve. At a point rounding may lead beyond it, which
/// its line must not. Nothing is written of a curve that is none.
TEST(CMapped, ItsCurveCanBeCalled) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const Folder folder;
  const auto written = [](const ActuatorCurve<double>& curve) {
    auto settings = config<Adrc<Mapped>>(8);
    settings.observer.curve = curve;
    return to_c(Adrc<Mapped>::make(settings).value(), {.name = "loop"}).value();
  };
  Random random(1491);
  int clamped = 0;
  for (int i = 0; i < 4; ++i) {
    ActuatorCurve<double> curve{.points = 9, .slope_below = 0.7, .slope_above = 1.3};
    double u = -4;
    double effect = -3;
    for (std::size_t k = 0; k < 9; ++k) {
      curve.input[k] = u += random.uniform(0.3, 1.1);
      curve.effect[k] = effect += random.uniform(0.01, 1.1);
    }
    const auto map = ActuatorMap<double>::make(curve).value();
    const Library library(folder, written(curve), "");
    double (*effect_of)(double) = nullptr;
    double (*input_for)(double) = nullptr;
    library.find(effect_of, "loop_effect_of");
    library.find(input_for, "loop_input_for");
    const auto equals_at = [&](double x) {
      EXPECT_EQ(effect_of(x), map.effect(x)) << x;
      EXPECT_EQ(input_for(x), map.input(x)) << x;
    };
    for (int k = 0; k < 300; ++k) equals_at(random.uniform(-9, 9));
    for (std::size_t k = 0; k < 9; ++k) {
      for (double x : {curve.input[k], curve.effect[k]}) {
        for (int back = 0; back < 4; ++back) x = std::nextafter(x, -99.0);
        for (int more = 0; more < 9; ++more, x = std::nextafter(x, 99.0)) equals_at(x);
      }
      clamped += map.effect(std::nextafter(curve.input[k], 99.0)) == curve.effect[k] ? 1 : 0;
    }
  }
  EXPECT_GT(clamped, 0);
  const Library without(folder, written({}), "");
  EXPECT_TRUE(without.loaded());
  EXPECT_FALSE(without.has("loop_effect_of"));
}

/// A law that softens is judged by the u that the actuator would have to put out, not by its
/// effect.
TEST(CMapped, OfALawThatSoftens) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto softens = [](auto& settings) { settings.soften = true; };
  equals_controller<Adrc<MappedInput<LinearEso<3, double>>>>(30000, 1441);
  equals_changed<Adrc<MappedInput<LinearEso<1, double>>, ErrorBased>>(30000, 1461, "gcc -std=c99",
                                                                      softens);
  equals_changed<Adrc<MappedInput<Guarded<LinearEso<2, double>>>>>(30000, 1471, "gcc -std=c99",
                                                                   softens);
  equals_changed<Adrc<MappedInput<DelayedInput<LinearEso<2, float>, 3>>>>(30000, 1481,
                                                                          "gcc -std=c99", softens);
}

TEST(CMapped, AroundWhatItMayBe) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<MappedInput<LinearEso<1, float>>>(30000, 1301);
  equals<MappedInput<DelayedInput<OutlierGate<LinearEso<2, double>>, 3>>>(30000, 1311);
  equals<MappedInput<WrappedOutput<LinearEso<2, float>>>>(30000, 1321);
  equals_controller<Adrc<MappedInput<ModelEso<lag, double>>, ErrorBased>>(30000, 1331,
                                                                          "gcc -std=c99", 2);
  equals_controller<DisturbanceCompensator<MappedInput<Measured<LinearEso<1, double>, 1, 4>>>>(
      30000, 1341);
  equals<MappedInput<Guarded<DelayedInput<LinearEso<2, double>, 3>>>>(30000, 1351);
  equals_controller<Adrc<MappedInput<Guarded<LinearEso<1, float>>>, ErrorBased>>(30000, 1361);
  observes<MappedInput<LinearEso<2, float>>>(30000, 1371);
  observes<MappedInput<Guarded<CascadeEso<1, 2, double>>>>(30000, 1381);
}

TEST(CMapped, CompilesWithOtherCompilers) {
  compiles<Adrc<MappedInput<LinearEso<2, float>>>>();
  compiles<DisturbanceCompensator<MappedInput<Guarded<DelayedInput<LinearEso<1, double>, 3>>>>>();
}

#endif

}  // namespace target_c_mapped_test
}  // namespace esokit_test
