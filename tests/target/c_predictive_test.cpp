// The C of a controller in two phases equals it bit for bit: u, estimates and status, with bad and
// missing samples, gaps, reported u before and after `prepare`, starts and resets.
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_predictive_test {

using namespace esokit;

// Refused: a gain that is known with the measurement, a nominal model.
static_assert(detail::Writable<PredictiveAdrc<LinearEso<2>>> &&
              !detail::Writable<PredictiveAdrc<AdjustableBandwidthEso<2>>> &&
              !detail::Writable<PredictiveAdrc<NonlinearEso<2>>>);

#ifdef ESOKIT_LOADS_C

/// The compiled C of a controller in two phases.
template <class V>
class InTwoPhases {
 public:
  InTwoPhases(const Folder& folder, const CCode& code, const std::string& compiler = "gcc -std=c99")
      : library_(folder, code, "loop_state loop_one;\n", compiler) {
    if (!loaded()) return;
    const auto find = [this](auto& function, const char* name) { library_.find(function, name); };
    find(its_, "loop_one");
    find(control_, "loop_control");
    find(without_, "loop_control_without_measurement");
    find(estimate_, "loop_estimate");
    find(start_, "loop_start");
    find(reset_, "loop_reset");
    find(prepare_, "loop_prepare");
    find(applied_, "loop_applied");
    find(self_test_, "loop_self_test");
    void (*init)(const void*) = nullptr;
    find(init, "loop_init");
    init(its_);
  }
  [[nodiscard]] bool loaded() const { return library_.loaded(); }
  V control(V y) { return control_(its_, y); }
  V without() { return without_(its_); }
  V estimate(unsigned row) { return estimate_(its_, row); }
  unsigned start(V y, V u) { return start_(its_, y, u); }
  unsigned reset(V y) { return reset_(its_, y); }
  unsigned prepare(V r) { return prepare_(its_, r); }
  unsigned applied(V u) { return applied_(its_, u); }
  int self_test() { return self_test_(V(0)); }

 private:
  Library library_;
  const void* its_ = nullptr;
  V (*control_)(const void*, V) = nullptr;
  V (*without_)(const void*) = nullptr;
  V (*estimate_)(const void*, unsigned) = nullptr;
  unsigned (*start_)(const void*, V, V) = nullptr;
  unsigned (*reset_)(const void*, V) = nullptr;
  unsigned (*prepare_)(const void*, V) = nullptr;
  unsigned (*applied_)(const void*, V) = nullptr;
  int (*self_test_)(V) = nullptr;
};

/// @param change of the settings @param controls whether it is fast enough to control the plant
template <class C, class Change = void (*)(typename C::Config&)>
void predicts(
    std::uint64_t seed, const Change& change = [](auto&) {}, int samples = 30000,
    bool controls = true) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  using Observer = std::remove_cvref_t<decltype(std::declval<C>().observer())>;
  samples = static_cast<int>(asked("ESOKIT_WRITTEN_SAMPLES", static_cast<std::uint64_t>(samples)));
  seed += asked("ESOKIT_WRITTEN_SEED", 0);
  const Folder folder;
  for (const double input_gain : {8.0, -8.0}) {
    typename C::Config config{};
    config.observer = observer_config<Observer>(input_gain);
    config.controller_bandwidth = V(4);
    config.limits = {V(-3), V(2.5), V(60)};
    config.start_hold = V(0.1);
    // A lost measurement ends in a stated u, in the last one, or, left out, in zero.
    config.missing.most = 6;
    if (seed % 3 == 0) config.missing.input = V(-0.5);
    if (seed % 3 == 1) config.missing.hold = true;
    change(config);
    C mine = C::make(config).value();
    InTwoPhases<V> in_c(folder, to_c(mine, {.name = "loop"}).value());
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(), 0);
    ChainPlant plant(C::order, 0.0078125, input_gain, 1.5);
    Random random(seed++);
    V r(1);
    int lost = 0;
    V drive{};  // what the actuator really holds
    int limited = 0;
    int outliers = 0;
    int safe = 0;
    int bad_references = 0;
    int of_status[64] = {};
    for (int k = 0; k < samples && !testing::Test::HasFailure(); ++k) {
      plant.set_disturbance(2 * std::sin(0.01 * k));
      plant.step(static_cast<double>(drive));
      if (random.index(60) == 0) r = static_cast<V>(random.uniform(-4, 4));
      if (k % 5000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
      V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
      if (lost > 0) --lost;
      if (random.index(200) == 0) lost = 1 + random.index(12);
      if (random.index(100) == 0) y = random.index(2) == 0 ? hidden_nan<V>() : anything<V>(random);
      const V held =
          random.index(10) == 0 ? anything<V>(random) : static_cast<V>(random.uniform(-2, 2));
      const auto tell = [&](V told) {
        EXPECT_EQ(static_cast<unsigned>(mine.applied(told)), in_c.applied(told)) << k;
        if (is_finite(told)) drive = told;
      };
      const auto report = [&] {
        if (random.index(40) != 0) return;
        if (random.index(2) == 0) tell(static_cast<V>(random.uniform(-3, 3)));  // and again
        tell(held);
      };
      const V u = lost > 0 ? mine.control_without_measurement() : mine.control(y);
      const V of_c = lost > 0 ? in_c.without() : in_c.control(y);
      EXPECT_TRUE(equal_bits(u, of_c)) << "sample " << k << ": " << u << ", C " << of_c;
      limited += u <= V(-3) || u >= V(2.5);
      drive = u;
      report();
      const V next = random.index(400) == 0 ? anything<V>(random) : r;
      const auto status = static_cast<unsigned>(mine.prepare(next));
      EXPECT_EQ(status, in_c.prepare(next)) << k;
      ++of_status[status % 64];
      outliers += status / 64 % 2 == 1;
      safe += mine.mode() == LoopMode::safe;
      bad_references += status >= 256;
      report();
      if (random.index(2000) == 0) {
        EXPECT_EQ(static_cast<unsigned>(mine.start(y, held)), in_c.start(y, held)) << k;
        if (random.index(2) == 0) lost = 2;  // the first sample is missing
        if (random.index(2) == 0) tell(static_cast<V>(random.uniform(-3, 3)));  // the operator
      }
      if (random.index(2000) == 0) {
        EXPECT_EQ(static_cast<unsigned>(mine.reset(y)), in_c.reset(y)) << k;
        if (random.index(2) == 0) lost = 2;
      }
      detail::unroll<Observer::size>([&](auto row) {
        EXPECT_TRUE(
            equal_bits(V(mine.observer().template estimate<row>()), in_c.estimate(unsigned{row})))
            << "sample " << k << ", estimate " << row;
      });
    }
    if (!controls) continue;
    if constexpr (requires { config.observer.outlier_threshold; }) {
      EXPECT_EQ(outliers > samples / 2000, config.observer.outlier_threshold > V(0));
    }
    EXPECT_GT(limited, samples / 50);
    EXPECT_GT(safe, samples / 500);
    EXPECT_GT(bad_references, samples / 4000);
    for (const StepStatus status :
         {StepStatus::measurement_rejected, StepStatus::gap_bridged, StepStatus::restarted}) {
      EXPECT_GT(of_status[static_cast<int>(status)], samples / 2000);
    }
  }
}

/// It is written with its state, and what was said since the last sample: the C goes on where it
/// is.
/// @param word 1: then it is started, 2: the actuator holds another u
template <class C>
void goes_on(std::uint64_t seed, int before, int word) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>() + std::to_string(before));
  using V = typename C::scalar_type;
  using Observer = std::remove_cvref_t<decltype(std::declval<C>().observer())>;
  typename C::Config config{};
  config.observer = observer_config<Observer>(8);
  config.controller_bandwidth = V(4);
  config.limits = {V(-3), V(2.5), V(60)};
  config.start_hold = V(0.1);  // 13 samples
  C mine = C::make(config).value();
  Random random(seed);
  const auto measurement = [&] { return static_cast<V>(random.uniform(-0.1, 0.1)); };
  for (int k = 0; k < before; ++k) {
    (void)mine.control(measurement());
    (void)mine.prepare(V(0.5));
  }
  if (word == 1) {
    EXPECT_EQ(mine.start(V(0.25), V(0.5)), StepStatus::ok);
  }
  if (word == 2) {
    EXPECT_EQ(mine.applied(V(0.75)), StepStatus::ok);
  }
  const Folder folder;
  InTwoPhases<V> in_c(folder, to_c(mine, {.name = "loop"}).value());
  ASSERT_TRUE(in_c.loaded());
  EXPECT_EQ(in_c.self_test(), 0);
  for (int k = 0; k < 500 && !testing::Test::HasFailure(); ++k) {
    const V y = measurement();
    if (word == 1 && k == 0) {  // it goes on being the operator's
      EXPECT_EQ(static_cast<unsigned>(mine.applied(V(-0.5))), in_c.applied(V(-0.5)));
    }
    EXPECT_TRUE(equal_bits(mine.control(y), in_c.control(y))) << k;
    EXPECT_EQ(static_cast<unsigned>(mine.prepare(V(-0.5))), in_c.prepare(V(-0.5))) << k;
    detail::unroll<Observer::size>([&](auto row) {
      EXPECT_TRUE(
          equal_bits(V(mine.observer().template estimate<row>()), in_c.estimate(unsigned{row})))
          << k;
    });
  }
}

TEST(CPredictive, GoesOnWhereItIs) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Plain = PredictiveAdrc<LinearEso<2, double>>;
  for (const int before : {0, 5}) goes_on<Plain>(981, before, 0);
  for (const int word : {0, 1, 2}) goes_on<Plain>(982, 300, word);
#ifndef ESOKIT_ONE_TYPE
  goes_on<PredictiveAdrc<ExtendedStateFilter<1, float>>>(991, 40, 0);
  goes_on<PredictiveAdrc<AlgebraicEso<1, float>>>(1001, 40, 0);
#endif
}

TEST(CPredictive, EqualsTheController) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  predicts<PredictiveAdrc<LinearEso<2, double>>>(801);
  predicts<PredictiveAdrc<LinearEso<1, float>>>(811);
  predicts<PredictiveAdrc<HalfGainEso<2, float>>>(821);
  predicts<PredictiveAdrc<ModelEso<lag, double>>>(831);
}

/// A rate of which u cannot hold every step.
TEST(CPredictive, OfARateBelowTheDigits) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const float digits : {0.05f, 3.0f}) {
    const auto slow = [digits](auto& settings) {
      settings.limits.rate = digits * std::numeric_limits<float>::epsilon() * 128;
    };
    predicts<PredictiveAdrc<LinearEso<1, float>>>(815, slow, 30000, false);
  }
}

#ifndef ESOKIT_ONE_TYPE

/// EPADRC.
TEST(CPredictive, OfAFilter) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  predicts<PredictiveAdrc<ExtendedStateFilter<2, double>>>(841);
  predicts<PredictiveAdrc<ExtendedStateFilter<1, float>>>(851);
  const auto changed = [](RiccatiMode mode, InflationRule rule, double threshold) {
    return [=](auto& settings) {
      set_filter(settings.observer, mode, rule, threshold);
      settings.observer.max_gap = 7;
    };
  };
  using Filter = PredictiveAdrc<ExtendedStateFilter<1, float>>;
  predicts<Filter>(861, changed(RiccatiMode::frozen, InflationRule::fixed, 0));
  predicts<Filter>(871, changed(RiccatiMode::recursive, InflationRule::adaptive, 9));
  predicts<PredictiveAdrc<ExtendedStateFilter<2, double>>>(
      881, changed(RiccatiMode::frozen, InflationRule::none, 25));
}

TEST(CPredictive, OfASchedule) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  predicts<PredictiveAdrc<AlgebraicEso<2, double>>>(891);
  predicts<PredictiveAdrc<AlgebraicEso<1, float>>>(901);
  const auto slow = [](auto& settings) { slow_down(settings.observer); };
  predicts<PredictiveAdrc<AlgebraicEso<2, float>>>(911, slow);
  predicts<PredictiveAdrc<AlgebraicEso<1, double>>>(921, slow);
}

TEST(CPredictive, OfACascade) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  predicts<PredictiveAdrc<CascadeEso<2, 2, double>>>(931);
  predicts<PredictiveAdrc<CascadeEso<1, 3, float>>>(941);
  predicts<PredictiveAdrc<ModelCascadeEso<lag, 2, double>>>(951);
}

inline constexpr ModelParts shown{.order = 1, .sensor = 1};
template <class V, class Model = AugmentedModel<shown, V>>
using FilterOfASensor =
    ExtendedStateFilter<Model::order, V, Model::extension, NoNominalModel, 0, Model>;

/// A sensor in the model: y is not its first state.
TEST(CPredictive, OfASensor) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  predicts<PredictiveAdrc<ModelEso<everything, double>>>(961);
  predicts<PredictiveAdrc<ModelCascadeEso<everything, 2, float>>>(971);
  predicts<PredictiveAdrc<FilterOfASensor<double>>>(981, [](auto& settings) {
    settings.observer.plant_model.sensor.time_constant = 0.03;
    settings.observer.disturbance_bounds = {0, 0.5, 0};
    settings.observer.outlier_threshold = 25;
  });
}

#endif  // ESOKIT_ONE_TYPE

template <class C>
C made() {
  typename C::Config config{
      .observer = observer_config<std::remove_cvref_t<decltype(std::declval<C>().observer())>>(8)};
  config.controller_bandwidth = 4;
  if constexpr (requires { config.observer.outlier_threshold; }) {
    config.observer.outlier_threshold = 9;
  }
  return C::make(config).value();
}

template <class C>
void refuses_in_two_phases() {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  const Folder folder;
  InTwoPhases<V> in_c(folder, to_c(made<C>(), {.name = "loop"}).value(),
                      "gcc -std=gnu99 -ffast-math -Wno-error");
  ASSERT_TRUE(in_c.loaded());
  const auto sample = [&](V y, V next) {
    EXPECT_TRUE(is_finite(in_c.control(y)));
    return in_c.prepare(next);
  };
  for (const V bad : {hidden_nan<V>(), hidden_infinity<V>(), -hidden_infinity<V>()}) {
    for (int k = 0; k < 20; ++k) (void)sample(V(0.1), V(0.2));
    EXPECT_EQ(sample(bad, V(0.2)) % 2, 1u) << "measurement_rejected";
    (void)sample(V(0.1), bad);
    (void)sample(V(0.1), V(0.2));
    EXPECT_EQ(in_c.applied(bad), 2u) << "input_rejected";
    (void)sample(V(0.1), V(0.2));
    EXPECT_NE(in_c.start(bad, V(0)), 0u);
    EXPECT_NE(in_c.start(V(0), bad), 0u);
  }
}

TEST(CPredictive, RefusesUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  refuses_in_two_phases<PredictiveAdrc<LinearEso<2, float>>>();
  refuses_in_two_phases<PredictiveAdrc<ExtendedStateFilter<2>>>();
  refuses_in_two_phases<PredictiveAdrc<AlgebraicEso<2, float>>>();
  refuses_in_two_phases<PredictiveAdrc<CascadeEso<1, 2>>>();
}

TEST(CPredictive, CompilesWithOtherCompilers) {
  const auto controller = made<PredictiveAdrc<LinearEso<2, float>>>();
  const CodeOptions loop{.name = "loop"};
  compiles_elsewhere(to_c(controller, loop).value(), "loop");
  compiles_elsewhere(to_c(made<PredictiveAdrc<ExtendedStateFilter<2>>>(), loop).value(), "loop");
  compiles_elsewhere(to_c(made<PredictiveAdrc<AlgebraicEso<2, float>>>(), loop).value(), "loop");
  compiles_elsewhere(to_c(made<PredictiveAdrc<CascadeEso<1, 2>>>(), loop).value(), "loop");
  const auto refused = to_c(controller, {.settings_in_struct = true});
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "settings_in_struct");
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_predictive_test
}  // namespace esokit_test
