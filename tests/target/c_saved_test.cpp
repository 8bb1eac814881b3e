// The C of a controller or an observer whose state is kept over a restart: it goes on as the C++
// does after a gap of as many samples, and takes no state that is damaged or of another design.
#include <target/written.hpp>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/structured_text.hpp>

namespace esokit_test {
namespace target_c_saved_test {

using namespace esokit;

/// Without a limit of rate and a start hold, which count from what is commanded here.
template <class C>
typename C::Config plain_config() {
  auto settings = config<C>(8);
  of_controller(settings).limits.rate = Limits<typename C::scalar_type>{}.rate;
  of_controller(settings).start_hold = {};
  return settings;
}

template <class C>
C controller_of() {
  return C::make(plain_config<C>()).value();
}

const CodeOptions saves{.name = "loop", .saves_state = true};

TEST(CSaved, IsRefusedByName) {
  using C = Adrc<LinearEso<2>>;
  const auto block = to_structured_text(controller_of<C>(), saves);
  ASSERT_FALSE(block);
  EXPECT_STREQ(block.error().field, "saves_state");
  FixedPointOptions fixed;
  fixed.code = saves;
  const auto counts = to_fixed_c(controller_of<C>(), fixed);
  ASSERT_FALSE(counts);
  EXPECT_STREQ(counts.error().field, "saves_state");
  const auto phases =
      to_c(PredictiveAdrc<LinearEso<2>>::make(
               {.observer = observer_config<LinearEso<2>>(8), .controller_bandwidth = 4})
               .value(),
           saves);
  ASSERT_FALSE(phases);
  EXPECT_STREQ(phases.error().field, "saves_state");
}

#ifdef ESOKIT_LOADS_C

/// Samples that are missing, in which u acts, of something else than a controller that rests.
template <class C, class V>
void miss(C& controller, int samples, V u, V r) {
  if constexpr (detail::IsResting<C>::value) {
    for (int k = 0; k < samples; ++k) (void)controller.track(hidden_nan<V>(), r, u);
    return;
  }
  for (int k = 0; k < samples; ++k) {
    (void)controller.applied(u);
    (void)controller.update_without_measurement(r);
  }
  (void)controller.applied(u);
}

/// Now and then a restart, with the state of before and a gap.
template <class C>
void goes_on(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  const Folder folder;
  C controller = controller_of<C>();
  const CCode code = to_c(controller, saves).value();
  InC<V> in_c(folder, code, true);
  ASSERT_TRUE(in_c.loaded());
  EXPECT_EQ(in_c.self_test(V(0)), 0);
  ChainPlant plant(C::order, 0.0078125, 8, 1.5);
  Random random(seed);
  V r(1);
  int loads = 0;
  for (int k = 0; k < 20000 && !testing::Test::HasFailure(); ++k) {
    plant.step(static_cast<double>(controller.output()));
    if (k % 5000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-4, 4));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    if constexpr (
        observer_traits<std::remove_cvref_t<decltype(controller.observer())>>.wraps_output) {
      y = std::remainder(y, V(2.5));
    }
    if (random.index(30) == 0) y = hidden_nan<V>();
    tell_measured(controller, in_c, random, k);
    if (random.index(100) == 0) {
      const auto saved = in_c.save();
      const C before = controller;
      for (int i = random.index(5); i >= 0; --i) in_c.update(V(0.25), V(i));  // lost
      constexpr int least = detail::IsResting<C>::value ? 1 : 0;
      const int samples = least + (random.index(3) == 0 ? random.index(100) : random.index(8));
      const V u = random.index(2) == 0 ? V(0) : static_cast<V>(random.uniform(-2, 2));
      EXPECT_FALSE(in_c.load(saved, 0, hidden_nan<V>()));
      ASSERT_TRUE(in_c.load(saved, static_cast<std::uint32_t>(samples), u));
      controller = before;
      miss(controller, samples, u, r);
      ++loads;
    }
    const V mine = controller.update(y, r);
    EXPECT_TRUE(equal_bits(mine, in_c.update(y, r))) << "sample " << k << ", " << loads;
    const unsigned probe = in_c.probe();
    EXPECT_EQ(probe % 512, static_cast<unsigned>(controller.status())) << k;
    EXPECT_EQ(probe / 512 % 128, static_cast<unsigned>(controller.mode())) << k;
    compare_estimates(controller.observer(), in_c, k);
  }
  EXPECT_GT(loads, 100);
}

TEST(CSaved, GoesOnAfterTheGap) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  goes_on<Adrc<LinearEso<2, float>>>(1);
#ifndef ESOKIT_ONE_TYPE
  goes_on<Adrc<CascadeEso<2, 3, double>>>(2);
  goes_on<Adrc<DelayedInput<OutlierGate<LinearEso<2, double>>, 4>>>(3);
  goes_on<Adrc<WrappedOutput<LinearEso<2, float>>>>(4);
  goes_on<Adrc<Measured<LinearEso<1, double>, 1, 8>>>(5);
  goes_on<Adrc<AlgebraicEso<2, double>>>(6);
  goes_on<Adrc<ExtendedStateFilter<2, float>>>(7);
  goes_on<Adrc<LinearEso<1, float>, ErrorBased>>(8);
  goes_on<Resting<Adrc<LinearEso<2, double>>>>(9);
#endif
}

/// More than can be counted are as many as can be.
TEST(CSaved, OfAGapWithoutEnd) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<1, double>>;
  C controller = controller_of<C>();
  const Folder folder;
  InC<double> in_c(folder, to_c(controller, saves).value(), true);
  ASSERT_TRUE(in_c.loaded());
  EXPECT_EQ(controller.update(0.5, 1), in_c.update(0.5, 1));
  ASSERT_TRUE(in_c.load(in_c.save(), 4000000000U, 0));
  miss(controller, 65535, 0.0, 1.0);
  compare_estimates(controller.observer(), in_c, 0);
  EXPECT_EQ(controller.update(hidden_nan<double>(), 1), in_c.update(hidden_nan<double>(), 1));
  EXPECT_EQ(controller.mode(), LoopMode::safe);
  EXPECT_EQ(in_c.probe() / 512 % 128, static_cast<unsigned>(LoopMode::safe));
}

/// A limit of rate counts from the u that acts.
TEST(CSaved, RateCountsFromTheUThatActs) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, double>>;
  auto settings = plain_config<C>();
  settings.limits.rate = 64;  // 0.5 a sample
  const Folder folder;
  InC<double> in_c(folder, to_c(C::make(settings).value(), saves).value(), true);
  ASSERT_TRUE(in_c.loaded());
  for (int k = 0; k < 100; ++k) in_c.update(0, 4);
  EXPECT_EQ(in_c.update(0, 4), 2.5);
  const auto saved = in_c.save();
  ASSERT_TRUE(in_c.load(saved, 3, 0.25));
  EXPECT_EQ(in_c.update(0, 4), 0.75);
  ASSERT_TRUE(in_c.load(saved, 3, 0.25));
  EXPECT_EQ(in_c.applied(1.0), 0u);  // by something else, up to now
  EXPECT_EQ(in_c.update(0, 4), 1.5);
}

/// Each bit of the state, another design and another size are refused, and nothing changes.
TEST(CSaved, RefusesForeignAndDamaged) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, double>>;
  const Folder folder;
  InC<double> in_c(folder, to_c(controller_of<C>(), saves).value(), true);
  auto other = plain_config<C>();
  other.observer.observer_bandwidth = 31;
  InC<double> foreign(folder, to_c(C::make(other).value(), saves).value(), true);
  ASSERT_TRUE(in_c.loaded() && foreign.loaded());
  for (int k = 0; k < 50; ++k) {
    in_c.update(0.01 * k, 1);
    foreign.update(0.01 * k, 1);
  }
  const auto saved = in_c.save();
  const auto state = in_c.state();
  EXPECT_FALSE(in_c.load(foreign.save(), 0, 0));
  constexpr std::size_t head = 3 * sizeof(std::uint32_t);  // design, size, CRC
  const std::size_t bytes = (saved.size() - 1) * sizeof(std::uint64_t);
  for (std::size_t bit = 0; bit < 8 * bytes; ++bit) {
    const std::size_t byte = bit / 8;
    if (head <= byte && byte < head + sizeof(std::uint32_t)) continue;  // before a double
    auto damaged = saved;
    damaged[byte / 8] ^= std::uint64_t{1} << (bit % 64);
    EXPECT_FALSE(in_c.load(damaged, 0, 0)) << "bit " << bit;
    EXPECT_EQ(in_c.state(), state);
  }
  EXPECT_TRUE(in_c.load(saved, 0, 0));
}

/// CRC-32, as in zip.
std::uint32_t crc_of(const unsigned char* bytes, std::size_t count) {
  std::uint32_t crc = 0xffffffffU;
  for (std::size_t i = 0; i < count; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
  }
  return ~crc;
}

/// Settings are those that are in force, wherever they lie; what was due is counted with them.
TEST(CSaved, KeepsSettings) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, double>>;
  CodeOptions options = saves;
  options.settings_in_struct = true;
  const Folder folder;
  auto settings = plain_config<C>();
  settings.observer.observer_bandwidth = 500;  // of gaps of so many samples some are due
  settings.observer.max_gap = 20;
  settings.missing.most = 50;
  const C controller = C::make(settings).value();
  EXPECT_GT(controller.observer().longest_gap(), controller.observer().max_gap());
  InC<double> in_c(folder, to_c(controller, options).value(), true);
  ASSERT_TRUE(in_c.loaded());
  C mine = controller;
  Random random(3);
  int recovering = 0;
  int lost = 0;
  for (int k = 0; k < 3000 && !testing::Test::HasFailure(); ++k) {
    if (random.index(20) == 0) {
      auto saved = in_c.save();
      auto* words = reinterpret_cast<std::uint32_t*>(saved.data());
      auto* state = reinterpret_cast<unsigned char*>(&saved[2]);
      std::memset(state, 0xa5, sizeof(void*));  // the pointer, as if it were of another image
      EXPECT_FALSE(in_c.load(saved, 0, 0));
      words[2] = crc_of(state, words[1]);
      recovering += mine.observer().recovering() > 0;
      const int samples = random.index(12);
      ASSERT_TRUE(in_c.load(saved, static_cast<std::uint32_t>(samples), 0.5));
      EXPECT_TRUE(mine.adopt(controller));
      miss(mine, samples, 0.5, 1.0);
    }
    double y = random.uniform(-1, 1);
    if (lost == 0 && random.index(15) == 0) lost = random.index(40);
    if (lost > 0 && lost-- > 0) y = hidden_nan<double>();
    EXPECT_TRUE(equal_bits(mine.update(y, 1.0), in_c.update(y, 1.0))) << k;
    compare_estimates(mine.observer(), in_c, k);
  }
  EXPECT_GT(recovering, 10);
}

/// After a load with other settings in force as much is due as after a change of settings: a gap
/// that would be bridged by what was due before restarts.
TEST(CSaved, CountsAnewWhatIsDue) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, double>>;
  CodeOptions options = saves;
  options.settings_in_struct = true;
  auto settings = plain_config<C>();
  settings.observer.observer_bandwidth = 100;
  settings.observer.max_gap = 20;
  settings.missing.most = 50;
  const C fresh = C::make(settings).value();
  const int longest = fresh.observer().longest_gap();
  const Folder folder;
  InC<double> in_c(folder, to_c(fresh, options).value(), true);
  ASSERT_TRUE(in_c.loaded());
  const auto begin = in_c.state();
  int more = 0;
  for (int gap = 1; gap <= longest; ++gap) {
    C mine = fresh;
    in_c.state() = begin;
    const auto sample = [&](double y) {
      EXPECT_TRUE(equal_bits(mine.update(y, 1.0), in_c.update(y, 1.0))) << gap;
      EXPECT_EQ(in_c.probe() % 512, static_cast<unsigned>(mine.status())) << gap;
    };
    const auto lose = [&](int samples) {
      for (int i = 0; i < samples; ++i) sample(hidden_nan<double>());
    };
    sample(0.1);
    lose(gap);
    sample(0.2);
    const int due = mine.observer().recovering();
    ASSERT_TRUE(in_c.load(in_c.save(), 0, 0.5));
    EXPECT_TRUE(mine.adopt(fresh));
    miss(mine, 0, 0.5, 1.0);
    for (int i = 0; i < due; ++i) sample(0.3);
    more += mine.observer().recovering() > 0;
    lose(longest - 1);
    sample(0.4);
  }
  EXPECT_GT(more, 3);
}

TEST(CSaved, OfAnObserver) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using O = LinearEso<2, double>;
  O observer = O::make(observer_config<O>(8)).value();
  const Folder folder;
  InC<double> in_c(folder, to_c(observer, saves).value(), false);
  ASSERT_TRUE(in_c.loaded());
  Random random(9);
  for (int k = 0; k < 2000; ++k) {
    if (k % 50 == 0) {
      const int samples = random.index(20);
      const auto saved = in_c.save();
      ASSERT_TRUE(in_c.load(saved, static_cast<std::uint32_t>(samples), 0.5));
      for (int i = 0; i < samples; ++i) (void)observer.predict(0.5);
    }
    const double y = random.uniform(-1, 1), u = random.uniform(-1, 1);
    EXPECT_EQ(static_cast<unsigned>(observer.update(y, u)), in_c.observe(y, u));
    compare_estimates(observer, in_c, k);
  }
}

TEST(CSaved, CompilesWithOtherCompilers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  compiles_elsewhere(to_c(controller_of<Adrc<LinearEso<2, float>>>(), saves).value(), "loop");
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_saved_test
}  // namespace esokit_test
