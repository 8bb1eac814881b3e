// The C of guards and of measured disturbances equals them bit for bit, as in c_code_test.cpp.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_guarded_test {

using namespace esokit;
using detail::Writable;
template <class Observer>
using Late = Measured<Observer, 1, 4>;

// Told twice, and around an angle or in a guard.
static_assert(Writable<Measured<LinearEso<2>>> && Writable<Measured<LinearEso<2>, 2>> &&
              !Writable<Measured<Measured<LinearEso<2>>>> &&
              !Writable<Measured<WrappedOutput<LinearEso<2>>>> &&
              !Writable<Guarded<Measured<LinearEso<2>>>>);

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

TEST(CGuarded, OfAMeasuredDisturbance) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<Late<LinearEso<2, double>>>(30000, 801);
  equals_changed<Adrc<Measured<LinearEso<1, float>>>>(
      30000, 811, "gcc -std=c99", [](auto& settings) {  // no dead time, no lag
        settings.observer.inputs[0] = {.gain = -3.0F};
      });
  observes<Late<CascadeEso<1, 2, float>>>(30000, 821);
  equals<DelayedInput<OutlierGate<Late<ModelEso<lag, double>>>, 3>>(30000, 831);
  equals<WrappedOutput<Late<LinearEso<2, double>>>>(30000, 841);
  equals<Late<DelayedInput<AlgebraicEso<1, double>, 3>>>(30000, 851);
  equals<Late<ExtendedStateFilter<2, double>>>(30000, 861);
  equals_controller<Adrc<Late<OutlierGate<LinearEso<1, float>>>, ErrorBased>>(30000, 871);
  equals_controller<DisturbanceCompensator<Late<LinearEso<1, double>>>>(30000, 881, "gcc -std=c99",
                                                                        3);
}

/// Each with a dead time, a lag and losses of its own.
TEST(CGuarded, OfSeveralMeasuredDisturbances) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<Measured<LinearEso<2, double>, 2, 4>>(30000, 941);
  equals<DelayedInput<OutlierGate<Measured<LinearEso<2, float>, 3, 4>>, 3>>(30000, 951);
  observes<Measured<CascadeEso<1, 2, double>, 3, 4>>(30000, 961);
  equals<WrappedOutput<Measured<ExtendedStateFilter<2, double>, 2, 4>>>(30000, 971);
  equals_controller<Adrc<Measured<LinearEso<1, float>, 2, 4>, ErrorBased>>(30000, 981,
                                                                           "gcc -std=c99", 2);
}

/// The self-test pins, holds, releases, and changes trust and b0.
TEST(CGuarded, IsTested) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  using C = Adrc<Guarded<LinearEso<2, float>>, ErrorBased>;
  auto settings = config<C>(8);
  settings.observer.release_samples = 3;
  settings.start_hold = {};
  const CCode code = to_c(C::make(settings).value(), {.name = "loop"}).value();
  reaches(code);
  notices(code,
          {{"(where > LOOP_PIN_EITHER)", "(where > 99u)"},
           {"(where == LOOP_PIN_EITHER)", "(where == 99u)"},
           {"o->release_left = RELEASE", "o->release_left = 0u"},
           {"(trust < 0.0f) ? 0.0f", "(trust < 0.0f) ? 0.25f"},
           {"(moved > 0.0f) ? o->weight_up", "(moved < 0.0f) ? o->weight_up"},
           {"(sum > 0.0f) ? most : -most", "(sum > 0.0f) ? most : most"},
           {"o->unsettled = 1u", "o->unsettled = 0u"},
           {"o->held = 0u;\n  set_weights(o)", "o->held = 0u"},
           {"(ratio > 0.0f)", "(ratio > -9.0f)"}},
          0.0F);
  reaches(to_c(Guarded<LinearEso<2, float>>::make(settings.observer).value(), {.name = "loop"})
              .value());
}

/// Pin, hold, release and a changing b0, which every comparison of a Guarded has, with a bound in
/// the unit of u and a time after a pin.
TEST(CGuarded, OfPinHoldAndGain) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto by_input = [](auto& settings) {
    settings.observer.unit = DisturbanceUnit::input;
    settings.observer.disturbance_bound = 1;
    settings.observer.release_samples = 20;
    settings.observer.leak_time = 0;
  };
  equals_changed<Adrc<Guarded<OutlierGate<CascadeEso<1, 2, double>>>>>(30000, 901, "gcc -std=c99",
                                                                       by_input);
  equals_changed<Adrc<Guarded<LinearEso<2, float>>, ErrorBased>>(30000, 911, "gcc -std=c99",
                                                                 [&](auto& settings) {
                                                                   by_input(settings);
                                                                   settings.measurement_divider = 2;
                                                                 });
  equals<Guarded<LinearEso<3, double>>>(30000, 921);  // it softens: no changing b0
}

using Settling = Guarded<LinearEso<2, double, 1, PoleSet>>;
void pair(Adrc<Settling>::Config& settings) {
  auto& observer = settings.observer.observer;
  observer.poles[0] = -20;
  observer.poles[1] = {-3, 20};
  observer.poles[2] = {-3, -20};
}

/// A fast pair beside slow poles is proven only with corrections frozen for 302 samples after a
/// hold.
TEST(CGuarded, FrozenAfterAHold) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_changed<Adrc<Settling>>(30000, 931, "gcc -std=c99", pair);
}

/// Also where corrections begin to be weighed just before these samples end.
TEST(CGuarded, PinnedAtTheEndOfSettling) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<Settling>;
  auto settings = config<C>(8);
  pair(settings);
  const C made = C::make(settings).value();
  const Folder folder;
  InC<double> in_c(folder, to_c(made, {.name = "loop"}).value(), true);
  ASSERT_TRUE(in_c.loaded());
  const auto fresh = in_c.state();
  for (int pinned = 290; pinned < 310; ++pinned) {
    C controller = made;
    in_c.state() = fresh;
    for (int k = 0; k < 450; ++k) {
      const double y = std::sin(0.05 * k);
      if (k == 3 + pinned) {
        controller.observer().set_pin(Pin::upper);
        in_c.set_pin(Pin::upper);
      }
      const bool holds = k < 3;
      const double u = holds ? controller.hold(y, 0, 0.5) : controller.update(y, 0);
      EXPECT_TRUE(equal_bits(u, holds ? in_c.hold(y, 0.5) : in_c.update(y, 0)))
          << pinned << ", sample " << k;
    }
  }
}

/// A u that the present b0 makes larger than a number can be has a side, too; zero has none.
TEST(CGuarded, PinnedUnderTheLargestAndNoInput) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<Guarded<LinearEso<2, double>>>;
  const C made = C::make(config<C>(8)).value();
  const Folder folder;
  InC<double> in_c(folder, to_c(made, {.name = "loop"}).value(), true);
  ASSERT_TRUE(in_c.loaded());
  const auto fresh = in_c.state();
  for (const double u : {1.5e308, -1.5e308, 0.0}) {
    C controller = made;
    in_c.state() = fresh;
    for (int k = 0; k < 50; ++k) {
      if (k == 3) {
        EXPECT_EQ(controller.applied(u), StepStatus::ok);
        EXPECT_EQ(in_c.applied(u), 0u);
      }
      if (k == 4) {
        EXPECT_TRUE(controller.set_input_gain(4));
        EXPECT_TRUE(in_c.set_input_gain(4));
        controller.observer().set_pin(Pin::either);
        in_c.set_pin(Pin::either);
      }
      EXPECT_TRUE(equal_bits(controller.update(0.1, 0), in_c.update(0.1, 0))) << u << " " << k;
      compare_estimates(controller.observer(), in_c, k);
    }
  }
}

TEST(CGuarded, CompilesWithOtherCompilers) {
  compiles<Adrc<Late<LinearEso<2, float>>>>();
  compiles<Adrc<Measured<LinearEso<2, float>, 3, 4>>>();
  compiles<Adrc<Guarded<DelayedInput<WrappedOutput<CascadeEso<2, 2, float>>, 3>>>>();
  compiles<DisturbanceCompensator<DelayedInput<OutlierGate<Late<LinearEso<1, double>>>, 3>>>();
}

/// A w that is not finite is lost, whatever the compiler assumes of it.
TEST(CGuarded, RefusesABadMeasuredDisturbanceUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<Late<LinearEso<2, float>>>;
  const Folder folder;
  InC<float> in_c(folder, to_c(C::make(config<C>(8)).value(), {.name = "loop"}).value(), true,
                  "gcc -std=gnu99 -ffast-math -Wno-error");
  ASSERT_TRUE(in_c.loaded());
  for (const float bad : {hidden_nan<float>(), hidden_infinity<float>(), -1e38F}) {
    for (int k = 0; k < 30; ++k) {
      in_c.measured(k < 10 ? bad : 0.5F);
      EXPECT_TRUE(is_finite(in_c.update(0.1F, 0.2F)));
      EXPECT_TRUE(is_finite(in_c.estimate(2)));
      EXPECT_EQ(in_c.probe() % 256, 0u);
    }
  }
}

#endif

}  // namespace target_c_guarded_test
}  // namespace esokit_test
