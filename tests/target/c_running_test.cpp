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
  compiles_elsewhere(code, "loop");
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

/// Other settings while it runs, as by `adopt`.
template <class C>
void adopts(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  auto settings = config<C>(8);
  const C first = C::make(settings).value();
  innermost(settings).observer_bandwidth = V(20);
  if constexpr (requires { settings.controller_bandwidth; }) settings.controller_bandwidth = V(3);
  settings.limits = {V(-1), V(1.5), V(60)};
  const C second = C::make(settings).value();
  settings.missing.most = 3;  // not one of the settings
  const C third = C::make(settings).value();
  CodeOptions options{.name = "loop", .comment = "a test", .settings_in_struct = true};
  CCode code = to_c(first, options).value();
  options.comment = "another";
  options.settings_name = "slow";
  const auto slow = to_c(second, options).value();
  options.settings_name = "other";
  const auto other = to_c(third, options).value();
  const Folder folder;
  const Library library(folder, code,
                        slow.settings + other.settings +
                            "unsigned loop_size(void);\n"
                            "unsigned loop_size(void) { return sizeof(loop_state); }\n");
  ASSERT_TRUE(library.loaded());
  void (*init)(void*) = nullptr;
  V (*update)(void*, V, V) = nullptr;
  V (*estimate)(const void*, unsigned) = nullptr;
  bool (*adopt)(void*, const void*) = nullptr;
  int (*self_test)(V) = nullptr;
  unsigned (*size)() = nullptr;
  const void* sets[3] = {};
  library.find(init, "loop_init");
  library.find(update, "loop_update");
  library.find(estimate, "loop_estimate");
  library.find(adopt, "loop_adopt");
  library.find(self_test, "loop_self_test");
  library.find(size, "loop_size");
  library.find(sets[0], "loop_design");
  library.find(sets[1], "loop_slow");
  library.find(sets[2], "loop_other");
  EXPECT_EQ(self_test(V(0)), 0);
  std::vector<std::uint64_t> state(size() / sizeof(std::uint64_t) + 1);
  init(state.data());
  C mine = first;
  ChainPlant plant(C::order, 0.0078125, 8, 1.5);
  Random random(seed);
  V r(1);
  int limited = 0;
  for (int k = 0; k < 30000 && !testing::Test::HasFailure(); ++k) {
    plant.step(static_cast<double>(mine.output()));
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-4, 4));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    if (random.index(20) == 0) y = random.index(2) == 0 ? hidden_nan<V>() : anything<V>(random);
    const int set = random.index(300);
    if (set < 2) {
      EXPECT_TRUE(mine.adopt(set == 0 ? first : second));
      EXPECT_TRUE(adopt(state.data(), sets[set]));
    }
    if (set == 2) {
      EXPECT_FALSE(adopt(state.data(), sets[2]));
    }
    V given = r;
    if constexpr (!requires { mine.gains(); }) given = (r - y) / V(8);
    const V u = mine.update(y, given);
    EXPECT_TRUE(equal_bits(u, update(state.data(), y, given))) << "sample " << k;
    detail::unroll<std::remove_cvref_t<decltype(mine.observer())>::size>([&](auto row) {
      EXPECT_TRUE(equal_bits(V(mine.observer().template estimate<row>()),
                             estimate(state.data(), unsigned{row})))
          << "sample " << k << ", estimate " << row;
    });
    limited += !equal_bits(mine.output(), mine.requested());
  }
  EXPECT_GT(limited, 3000);
}

TEST(CRunning, AdoptsSettings) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  adopts<Adrc<LinearEso<2, double>>>(701);
  adopts<Adrc<CascadeEso<1, 2, float>>>(711);
  adopts<Adrc<OutlierGate<ModelEso<lag, double>>>>(721);
  adopts<DisturbanceCompensator<LinearEso<1, float>>>(731);
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
