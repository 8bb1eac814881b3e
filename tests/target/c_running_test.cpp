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
#include <esokit/observer/linear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_running_test {

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

using namespace esokit;

/// The config of the observer in a controller's, inside its adapters.
template <class Config>
auto& innermost(Config& config) {
  if constexpr (requires { config.observer; }) {
    return innermost(config.observer);
  } else {
    return config;
  }
}

TEST(CRunning, OfASchedule) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<AlgebraicEso<2, double>>(30000, 401);
  equals<AlgebraicEso<1, float>>(30000, 411);
  observes<AlgebraicEso<2, float>>(30000, 421);
  equals<DelayedInput<OutlierGate<AlgebraicEso<1, double>>, 3>>(30000, 431);
  const auto slow = [](auto& settings) {  // it never settles, and publishes late
    auto& observer = innermost(settings);
    observer.frequency_shift = {};
    observer.blanking = decltype(observer.frequency_shift)(0.25);
    observer.start_index = 2;
  };
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
      filter.mode = mode;
      filter.inflation_rule = rule;
      if (rule != InflationRule::fixed) filter.inflation = V(0);
      filter.outlier_threshold = V(threshold);
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

/// As of others, see c_code_test.cpp.
template <class C>
void compiles() {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  const CCode code = to_c(C::make(config<C>(8)).value(), {.name = "loop"}).value();
  const Folder folder;
  folder.write("loop.h", code.header);
  folder.write("loop.c", code.source);
  folder.write("loop.cpp", code.source);
  for (const std::string compiler : {"g++ -std=c++11", "clang -std=c99", "tcc"}) {
    const std::string name = compiler.substr(0, compiler.find(' '));
    if (!there(name)) continue;
    EXPECT_TRUE(runs(compiler + (name == "tcc" ? " -Wall -Werror" : strict) +
                     " -DLOOP_SELF_TEST -c -o " + folder.file("loop.o") + " " +
                     folder.file(name == "g++" ? "loop.cpp" : "loop.c")))
        << compiler;
  }
  if (there("cppcheck")) {
    EXPECT_TRUE(
        runs("cppcheck --addon=misra --std=c99 -q --error-exitcode=1 "
             "--suppress=missingIncludeSystem --suppress=misra-c2012-2.5 "
             "--suppress=misra-c2012-15.5 --suppress=misra-c2012-21.15 " +
             folder.file("loop.c") + " >/dev/null 2>&1"));
  }
}

TEST(CRunning, CompilesWithOtherCompilers) {
  compiles<Adrc<AlgebraicEso<2, float>>>();
  compiles<Adrc<ExtendedStateFilter<1, float>>>();
  compiles<Adrc<Guarded<DelayedInput<WrappedOutput<LinearEso<2, float>>, 3>>>>();
}

/// Bad numbers are refused whatever the compiler assumes of them.
template <class C>
void refuses_under_fast_math() {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  const Folder folder;
  InC<V> in_c(folder, to_c(C::make(config<C>(8)).value(), {.name = "loop"}).value(), true,
              "gcc -std=gnu99 -ffast-math -Wno-error");
  ASSERT_TRUE(in_c.loaded());
  for (const V bad : {hidden_nan<V>(), hidden_infinity<V>(), -hidden_infinity<V>()}) {
    for (int k = 0; k < 20; ++k) EXPECT_TRUE(is_finite(in_c.update(V(0.1), V(0.2))));
    EXPECT_TRUE(is_finite(in_c.update(bad, V(0.2))));
    EXPECT_EQ(in_c.probe() % 2, 1u) << "measurement_rejected";
    EXPECT_TRUE(is_finite(in_c.update(V(0.1), bad)));
    in_c.applied(bad);
    EXPECT_TRUE(is_finite(in_c.update(V(0.1), V(0.2))));
    EXPECT_NE(in_c.start(bad, V(0)), 0u);
    EXPECT_NE(in_c.start(V(0), bad), 0u);
    for (unsigned row = 0; row < 2; ++row) EXPECT_TRUE(is_finite(in_c.estimate(row)));
  }
}

TEST(CRunning, RefusesBadNumbersUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  refuses_under_fast_math<Adrc<AlgebraicEso<1, float>>>();
  refuses_under_fast_math<Adrc<ExtendedStateFilter<1, float>>>();
  refuses_under_fast_math<Adrc<Guarded<DelayedInput<WrappedOutput<LinearEso<2, float>>, 3>>>>();
}

#endif

}  // namespace target_c_running_test
}  // namespace esokit_test
