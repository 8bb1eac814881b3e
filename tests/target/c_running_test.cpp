// The C of gains that go on at each sample (the schedule of AlgebraicEso, the recursion of
// ExtendedStateFilter) and of angles equals them bit for bit, as in c_code_test.cpp.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_running_test {

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

using namespace esokit;

TEST(CRunning, OfASchedule) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<AlgebraicEso<2, double>>(30000, 401);
  equals<AlgebraicEso<1, float>>(30000, 411);
  observes<AlgebraicEso<2, float>>(30000, 421);
  equals<DelayedInput<OutlierGate<AlgebraicEso<1, double>>, 3>>(30000, 431);
  const auto slow = [](auto& settings) { slow_down(innermost(settings)); };
  equals_changed<Adrc<AlgebraicEso<2, double>>>(30000, 441, "gcc -std=c99", slow);
  equals_changed<Adrc<AlgebraicEso<1, float>, ErrorBased>>(30000, 451, "gcc -std=c99", slow);
}

TEST(CRunning, OfAFilter) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<ExtendedStateFilter<2, double>>(30000, 461);
  observes<ExtendedStateFilter<1, float>>(30000, 471);
  const auto changed = [](RiccatiMode mode, InflationRule rule, double threshold) {
    return [=](auto& settings) {
      auto& filter = innermost(settings);
      using V = decltype(filter.inflation);
      set_filter(filter, mode, rule, threshold);
      filter.max_gap = 12;
      settings.limits = {V(-1.5), V(1.25), V(60)};  // so that it meets them as often as the others
    };
  };
  const std::string gcc = "gcc -std=c99";
  using Filter = Adrc<ExtendedStateFilter<1, float>>;
  equals_changed<Filter>(30000, 481, gcc, changed(RiccatiMode::frozen, InflationRule::fixed, 0));
  equals_changed<Filter>(30000, 491, gcc,
                         changed(RiccatiMode::recursive, InflationRule::adaptive, 9));
  equals_changed<Adrc<DelayedInput<ExtendedStateFilter<2, double>, 3>>>(
      30000, 501, gcc, changed(RiccatiMode::frozen, InflationRule::none, 25));
}

TEST(CRunning, OfAnglesByTurns) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<WrappedOutput<LinearEso<2, double>>>(30000, 511);
  equals<WrappedOutput<LinearEso<2, float>>>(30000, 521);
  equals<WrappedOutput<LinearEso<3, double>>>(30000, 531);  // it softens
  observes<WrappedOutput<CascadeEso<1, 2, float>>>(30000, 541);
  equals<DelayedInput<WrappedOutput<ModelEso<lag, double>>, 3>>(30000, 551);
  equals<WrappedOutput<AlgebraicEso<1, double>>>(30000, 561);
  equals_controller<Adrc<WrappedOutput<LinearEso<1, float>>, ErrorBased>>(30000, 571);
  equals_controller<DisturbanceCompensator<WrappedOutput<LinearEso<1, double>>>>(30000, 581);
}

/// A gate inside: turns are counted twice.
TEST(CRunning, OfAnglesByTurnsAroundAGate) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<WrappedOutput<OutlierGate<LinearEso<2, double>>>>(30000, 751);
  equals<DelayedInput<WrappedOutput<OutlierGate<LinearEso<2, float>>>, 3>>(30000, 761);
  observes<WrappedOutput<OutlierGate<CascadeEso<1, 2, double>>>>(30000, 771);
  equals<WrappedOutput<OutlierGate<ModelEso<lag, float>>>>(30000, 781);
  equals<Guarded<WrappedOutput<OutlierGate<LinearEso<2, double>>>>>(30000, 791);
  equals<WrappedOutput<ExtendedStateFilter<2, double>>>(30000, 1301);  // it has a gate of its own
  equals_changed<Adrc<WrappedOutput<ExtendedStateFilter<2, double>>>>(
      30000, 1311, "gcc -std=c99",
      [](auto& settings) { innermost(settings).outlier_threshold = 25; });
  equals_changed<DisturbanceCompensator<WrappedOutput<OutlierGate<LinearEso<1, float>>>>>(
      30000, 1321, "gcc -std=c99", [](auto& settings) {
        settings.observer.observer.threshold = settings.observer.observer.running_factor = 0;
      });
}

/// A prediction that is off by more turns than the scalar can hold restarts, which opens the gate.
TEST(CRunning, OpensTheGateWhereAnAngleRestarts) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Observer = WrappedOutput<OutlierGate<LinearEso<2, double>>>;
  auto settings = observer_config<Observer>(8);
  innermost(settings).sample_time = 1;
  innermost(settings).observer_bandwidth = 0.5;
  auto observer = Observer::make(settings).value();
  const Folder folder;
  InC<double> in_c(folder, to_c(observer, {.name = "loop"}).value(), false);
  ASSERT_TRUE(in_c.loaded());
  const auto both = [&](auto mine, unsigned its) { EXPECT_EQ(static_cast<unsigned>(mine), its); };
  int opened = 0;
  for (double u = 1e306; u < 5e307; u *= 1.2) {
    both(observer.reset(0.3), in_c.reset(0.3));
    for (int k = 0; k < 40; ++k) both(observer.update(0.3, 0), in_c.observe(0.3, 0));
    const bool closed = !observer.observer().open();
    for (int k = 0; k < 5; ++k) {  // fewer than the gate takes for a restart
      const double held = k == 0 ? u : 0.0;
      both(observer.predict(held), in_c.predict(held));
    }
    both(observer.correct(0.3), in_c.correct(0.3));
    opened += closed && observer.observer().open();
    both(observer.update(1, 0), in_c.observe(1, 0));
    compare_estimates(observer, in_c, 0);
  }
  EXPECT_GT(opened, 0);
}

TEST(CRunning, OfGuards) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<Guarded<LinearEso<2, double>>>(30000, 601);
  equals<Guarded<CascadeEso<1, 3, float>>>(30000, 611);
  equals<Guarded<DelayedInput<WrappedOutput<LinearEso<2, float>>, 3>>>(30000, 621);
  observes<Guarded<OutlierGate<LinearEso<1, double>>>>(30000, 631);
  const auto unbounded = [](auto& settings) { settings.observer.disturbance_bound = 0; };
  equals_changed<DisturbanceCompensator<Guarded<LinearEso<1, float>>>>(30000, 641, "gcc -std=c99",
                                                                       unbounded);
  const auto without_leak = [](auto& settings) { settings.observer.leak_time = 0; };
  equals_changed<Adrc<Guarded<LinearEso<2, double>>, ErrorBased>>(30000, 651, "gcc -std=c99",
                                                                  without_leak);
}

/// Gaps beyond max_gap(), and more of them while corrections are due.
TEST(CRunning, OfLongGaps) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const std::string gcc = "gcc -std=c99";
  const auto fast = [](double bandwidth) {
    return [=](auto& settings) {
      auto& chain = innermost(settings);
      chain.observer_bandwidth = decltype(chain.sample_time)(bandwidth);
      chain.max_gap = 16;
    };
  };
  equals_changed<Adrc<LinearEso<2, double>>>(30000, 1401, gcc, fast(500));
  equals_changed<Adrc<LinearEso<3, float>>>(30000, 1411, gcc, fast(160));
  equals_changed<Adrc<OutlierGate<HalfGainEso<2, double>>>>(30000, 1421, gcc, fast(500));
  equals_changed<Adrc<Guarded<LinearEso<2, float>>>>(30000, 1431, gcc, fast(500));
  equals_changed<Adrc<DelayedInput<WrappedOutput<CascadeEso<2, 2, double>>, 3>>>(30000, 1441, gcc,
                                                                                 fast(300));
  adopts<Adrc<LinearEso<2, double>>>(1451, true, 500);
}

TEST(CRunning, CompilesWithOtherCompilers) {
  compiles<Adrc<AlgebraicEso<2, float>>>();
  compiles<Adrc<ExtendedStateFilter<1, float>>>();
  compiles<Adrc<WrappedOutput<OutlierGate<LinearEso<2, float>>>>>();
  compiles<Adrc<Guarded<DelayedInput<WrappedOutput<LinearEso<2, float>>, 3>>>>();
}

TEST(CRunning, RefusesBadNumbersUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  refuses_under_fast_math<Adrc<AlgebraicEso<1, float>>>();
  refuses_under_fast_math<Adrc<ExtendedStateFilter<1, float>>>();
  refuses_under_fast_math<Adrc<Guarded<DelayedInput<WrappedOutput<LinearEso<2, float>>, 3>>>>();
}

TEST(CRunning, AdoptsSettings) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  adopts<Adrc<LinearEso<2, double>>>(701, true);
  adopts<Adrc<CascadeEso<1, 2, float>>>(711, false);
  adopts<Adrc<OutlierGate<ModelEso<lag, double>>>>(721, true);
  adopts<DisturbanceCompensator<LinearEso<1, float>>>(731, false);
  using Switched = AlgebraicEso<1, double>;
  const auto refused =
      to_c(Switched::make(observer_config<Switched>(8)).value(), {.settings_in_struct = true});
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "settings_in_struct");
  using Softened = Adrc<LinearEso<3, double>>;
  EXPECT_FALSE(to_c(Softened::make(config<Softened>(8)).value(), {.settings_in_struct = true}));
}

#endif

}  // namespace target_c_running_test
}  // namespace esokit_test
