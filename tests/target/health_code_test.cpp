// The C of a monitor, fed by the C of its controller, equals the C++ of both bit for bit: on a
// sound loop, with a b0 of the wrong sign or several times too small, and with bad measurements.
#include <algorithm>
#include <array>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/control/health.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/health_code.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_health_code_test {

using namespace esokit;

template <class C>
auto monitor(typename C::scalar_type noise) {
  using V = typename C::scalar_type;
  constexpr int size = detail::ObserverOfController<C>::type::size;
  return HealthMonitor<size, V>::make({.observer_bandwidth = V(30),
                                       .sample_time = V(0.0078125),
                                       .input_range = V(2.5),
                                       .noise = noise})
      .value();
}

#ifdef ESOKIT_LOADS_C

/// The loop and its monitor in C, in one library.
constexpr const char* both = R"(
unsigned loop_size(void);
unsigned loop_size(void) { return sizeof(loop_state) + sizeof(health_state); }
void both_init(loop_state *o, health_state *h);
void both_init(loop_state *o, health_state *h) { loop_init(o); health_clear(h); }
void both_look(const loop_state *o, health_state *h, double y);
void both_look(const loop_state *o, health_state *h, double y)
{
  health_sample s;
  s.innovation = o->innovation;
  s.asked = o->u_asked;
  s.held = o->u_last;
  s.applied = o->u_applied;
  s.estimate = loop_estimate(o, 0u);
  s.disturbance = loop_estimate(o, ORDER);
  s.measured = (REAL)y;
  s.missed = o->gap;
  s.status = o->status;
  s.runs = o->mode == 0u;
  health_look(h, &s);
}
)";

/// What is public of the C state.
template <class V>
struct Found {
  std::uint32_t samples, rejected, bridged, unsafe;
  V lost, saturated, side, underway, innovation, gain_ratio, sign_ratio, response, evidence,
      opposed;
  V steady, standing;
  bool reversed;
};

/// @param plant_gain over b0 @param stands share of the time for which the sensor stands still
/// @param loses whether some samples in a row are missing @param load amplitude of a sine in y^(n)
/// @param within what goes out of u, if less than 1 @return how often which fault was named
template <class C>
std::array<int, 9> watches(double plant_gain, double bad, std::uint64_t seed, double stands = 0,
                           bool loses = false, double load = 1, double gain = 8,
                           double within = 1) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  std::array<int, 9> named{};
  auto settings = config<C>(gain);
  settings.limits.rate = std::numeric_limits<V>::max();
  C mine = C::make(settings).value();
  auto watch = monitor<C>(V(1e-3));
  const CCode code = to_c(mine, {.name = "loop", .watched = true}).value();
  const CCode health = to_c(watch, mine, {.name = "health", .comment = "a test"}).value();
  const Folder folder;
  folder.write("health.h", health.header);
  folder.write("health.c", mutant(health.source));
  const Library library(folder, code,
                        std::string("#define REAL ") +
                            (sizeof(V) == sizeof(float) ? "float" : "double") + "\n#define ORDER " +
                            std::to_string(C::order) + "u\n#include \"health.c\"\n" + both);
  if (!library.loaded()) {
    ADD_FAILURE() << "does not compile";
    return named;
  }
  std::vector<std::uint64_t> loop(1000);
  std::vector<std::uint64_t> its(1000);
  void (*init)(void*, void*) = nullptr;
  V (*update)(void*, V, V) = nullptr;
  V (*miss)(void*, V) = nullptr;
  unsigned (*applied)(void*, V) = nullptr;
  void (*look)(const void*, void*, double) = nullptr;
  unsigned (*diagnoses)(const void*) = nullptr;
  library.find(init, "both_init");
  library.find(update, "loop_update");
  library.find(miss, "loop_update_without_measurement");
  library.find(applied, "loop_applied");
  library.find(look, "both_look");
  library.find(diagnoses, "health_diagnose");
  init(loop.data(), its.data());
  ChainPlant plant(C::order, 0.0078125, gain * plant_gain, 1.5);
  Random random(seed);
  V r(1);
  int lost = 0;
  V u = mine.output();
  for (int k = 0; k < 20000; ++k) {
    plant.set_disturbance(load * std::sin(0.01 * k));
    plant.step(static_cast<double>(u));
    if (k % 3000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-1, 1));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    if (k % 8000 < 8000 * stands) y = V(0.25);
    if (random.uniform(0, 1) < bad)
      y = random.index(2) == 0 ? hidden_nan<V>() : anything<V>(random);
    if (loses && random.index(500) == 0) lost = random.index(14);
    if (lost > 0) {
      --lost;
      (void)mine.update_without_measurement(r);
      (void)miss(loop.data(), r);
    } else {
      (void)mine.update(y, r);
      (void)update(loop.data(), y, r);
    }
    u = mine.output();
    if (within < 1) {  // something behind the law limits u
      u = std::clamp(u, static_cast<V>(-within), static_cast<V>(within));
      EXPECT_EQ(mine.applied(u), StepStatus::ok);
      (void)applied(loop.data(), u);
    }
    // Every other run without a watched sensor.
    if (seed % 2 == 1) {
      watch.look(mine);
    } else {
      watch.look(mine, y);
    }
    look(loop.data(), its.data(), seed % 2 == 1 ? hidden_nan<double>() : static_cast<double>(y));
    const auto& of_cpp = watch.health();
    Found<V> of_c;
    std::memcpy(&of_c, its.data(), sizeof of_c);
    EXPECT_EQ(of_cpp.samples, of_c.samples);
    EXPECT_EQ(of_cpp.rejected, of_c.rejected) << k;
    EXPECT_EQ(of_cpp.bridged, of_c.bridged) << k;
    EXPECT_EQ(of_cpp.unsafe, of_c.unsafe) << k;
    EXPECT_TRUE(equal_bits(of_cpp.lost, of_c.lost)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.sign_ratio, of_c.sign_ratio)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.steady, of_c.steady)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.standing, of_c.standing)) << k;
    EXPECT_EQ(of_cpp.reversed, of_c.reversed) << k;
    EXPECT_TRUE(equal_bits(of_cpp.saturated, of_c.saturated)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.side, of_c.side)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.underway, of_c.underway)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.innovation, of_c.innovation)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.gain_ratio, of_c.gain_ratio)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.response, of_c.response)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.evidence, of_c.evidence)) << k;
    EXPECT_TRUE(equal_bits(of_cpp.opposed, of_c.opposed)) << k;
    const auto fault = static_cast<unsigned>(diagnose(of_cpp));
    EXPECT_EQ(fault, diagnoses(its.data())) << k;
    ++named[fault];
  }
  return named;
}

/// The self-test has each fault, and what takes it back.
TEST(HealthCode, IsTested) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  using C = Adrc<LinearEso<1, float>>;
  const CCode code =
      to_c(monitor<C>(1e-3F), C::make(config<C>(-8)).value(), {.name = "loop"}).value();
  reaches(code);
  notices(code,
          {{"LOOP_SENSOR_STILL;", "LOOP_NONE;"},
           {"LOOP_SATURATED;", "LOOP_NONE;"},
           {"o->reversed = true", "o->reversed = false"},
           {"o->reversed = false", "o->reversed = true"},
           {"THRICE_NOISE)) {", "THRICE_NOISE) && !told) {"},
           {"SIGN_OF_GAIN * limit", "limit"},
           {"o->steady = o->steady + STEP", "o->steady = STEP"},
           {"o->is_free = o->is_free && sample->runs", "o->is_free = o->is_free || sample->runs"}},
          0.0F);
}

/// A monitor that settles in days: the sanitizers look at what counts its samples.
TEST(HealthCode, IsWrittenHoweverSlow) {
  using C = Adrc<LinearEso<1, float>>;
  const auto loop = C::make(config<C>(8)).value();
  for (const float omega : {1e-6F, 1e-9F}) {
    const auto slow = HealthMonitor<2, float>::make({.observer_bandwidth = omega,
                                                     .sample_time = 1e-3F,
                                                     .input_range = 5,
                                                     .memory = 100 / omega});
    ASSERT_TRUE(slow) << slow.error().rule;
    EXPECT_TRUE(to_c(*slow, loop, {.name = "loop", .self_test_samples = 2}));
  }
}

TEST(HealthCode, EqualsTheMonitor) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, double>>;
  using Small = Adrc<LinearEso<1, float>>;
  using Cascade = Adrc<CascadeEso<1, 2, float>>;
  const auto often = [](const std::array<int, 9>& named, LoopFault fault) {
    EXPECT_GT(named[static_cast<std::size_t>(fault)], 300)
        << static_cast<int>(fault) << " of " << testing::PrintToString(named);
  };
  often(watches<C>(1, 0.02, 1), LoopFault::none);
  often(watches<C>(1, 0, 1, 0, false, 1, -8), LoopFault::none);  // a negative b0
  (void)watches<Small>(0.3, 0, 2, 0, false, 12, -8);             // at its limits
  often(watches<C>(-1, 0, 2), LoopFault::wrong_sign);
  often(watches<Small>(6, 0, 3), LoopFault::innovation_too_large);
  often(watches<Cascade>(1, 0.3, 4), LoopFault::measurements_rejected);
  (void)watches<Adrc<OutlierGate<LinearEso<2, double>>>>(1, 0.05, 10, 0, true);
  often(watches<C>(1, 0, 6, 0.8), LoopFault::sensor_still);
  often(watches<Small>(-1, 0.01, 8, 0.3), LoopFault::wrong_sign);
  often(watches<C>(1, 0, 14, 0, false, 4, 8, 0.1), LoopFault::saturated);
  // Half of b0, with the wrong sign and loads that help back: where sign_ratio becomes clear.
  for (const double load : {12, 15}) (void)watches<Small>(-0.5, 0, 12, 0, false, load);
}

/// What is found at, beside and between all limits.
template <class V>
void diagnoses_alike(std::uint64_t seed) {
  using C = Adrc<LinearEso<1, V>>;
  const auto watch = monitor<C>(V(1e-3));
  const Folder folder;
  const Library library(folder,
                        to_c(watch, C::make(config<C>(8)).value(), {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  unsigned (*diagnoses)(const void*) = nullptr;
  library.find(diagnoses, "loop_diagnose");
  Random random(seed);
  const auto about = [&](std::initializer_list<double> limits) {
    const double one = limits.begin()[random.index(static_cast<int>(limits.size()))];
    const double beside = 1 + 1e-3 * random.uniform(-1, 1);
    const int how = random.index(3);
    return static_cast<V>(how == 0 ? one : how == 1 ? one * beside : one * random.uniform(-2, 2));
  };
  std::array<int, 9> named{};
  std::vector<std::uint64_t> its(1000);
  for (int k = 0; k < 100000; ++k) {
    Health<V> health = watch.health();
    health.response = about({2.5, 12});
    health.gain_ratio = about({-0.5, -0.12, 0.25, 3, static_cast<double>(health.response) / 4});
    health.evidence = about({1, 5, 50});
    health.sign_ratio = about({-0.25, 0, 1});
    health.opposed = about({4});
    health.steady = about({40});
    health.saturated = about({0.05, 0.5, 0.7});
    health.side = static_cast<V>(about({0.8}) * health.saturated);
    health.underway = about({0, 0.1, 0.5, static_cast<double>(health.saturated) - 0.5});
    health.lost = about({0.1, 0});
    health.standing = about({0.99, 0});
    health.innovation = about({3 * static_cast<double>(health.innovation_of_noise)});
    health.reversed = random.index(50) == 0;
    const Found<V> found{0,
                         0,
                         0,
                         0,
                         health.lost,
                         health.saturated,
                         health.side,
                         health.underway,
                         health.innovation,
                         health.gain_ratio,
                         health.sign_ratio,
                         health.response,
                         health.evidence,
                         health.opposed,
                         health.steady,
                         health.standing,
                         health.reversed};
    std::memcpy(its.data(), &found, sizeof found);
    const auto fault = static_cast<unsigned>(diagnose(health));
    ASSERT_EQ(fault, diagnoses(its.data())) << k;
    ++named[fault];
  }
  for (unsigned fault = 0; fault < named.size(); ++fault) {
    if (fault == static_cast<unsigned>(LoopFault::bounded)) continue;
    EXPECT_GT(named[fault], 300) << fault;
  }
}

TEST(HealthCode, DiagnosesAlike) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  diagnoses_alike<double>(1);
  diagnoses_alike<float>(2);
}

TEST(HealthCode, CompilesWithOtherCompilers) {
  using C = Adrc<LinearEso<2, float>>;
  const C controller = C::make(config<C>(8)).value();
  const CCode code = to_c(monitor<C>(0.001f), controller).value();
  compiles_elsewhere(code, "health");
}

#endif  // ESOKIT_LOADS_C

TEST(HealthCode, RefusesByName) {
  using C = Adrc<LinearEso<2, float>>;
  const C controller = C::make(config<C>(8)).value();
  const auto code = to_c(monitor<C>(0.001f), controller, {.name = "a b"});
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "name");
}

}  // namespace target_health_code_test
}  // namespace esokit_test
