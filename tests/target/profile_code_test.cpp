// The C of a profile equals it bit for bit: moves, targets that change on the way, bad ones,
// starts.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/target/profile_code.hpp>
#include <limits>
#include <target/written.hpp>
#include <vector>

namespace esokit_test {
namespace target_profile_code_test {

using namespace esokit;

template <int Order, class S>
SmoothProfile<Order, S> profile(S shortest_time = S(0)) {
  SmoothProfileConfig<Order, S> config{.shortest_time = shortest_time, .sample_time = S(0.004)};
  config.limits[Order - 1] = S(20);
  if constexpr (Order > 1) config.limits[0] = S(3);
  return SmoothProfile<Order, S>::make(config).value();
}

template <int Order, int Capacity, class S>
ApproachProfile<Order, Capacity, S> approach(double gain, double pole) {
  return ApproachProfile<Order, Capacity, S>::make({.pole = S(pole),
                                                    .lag = Order == 2 ? S(0.3) : S(0),
                                                    .input_gain = S(gain),
                                                    .limits = {.lower = S(-10), .upper = S(70)},
                                                    .dead_time = S(0.02 * (Capacity - 1)),
                                                    .bandwidth = S(1.5),
                                                    .sample_time = S(0.02)})
      .value();
}

#ifdef ESOKIT_LOADS_C

template <int Order, class S>
void equals_profile(std::uint64_t seed, S shortest_time = S(0)) {
  SCOPED_TRACE(testing::Message() << "order " << Order << ", " << sizeof(S) << " bytes");
  auto mine = profile<Order, S>(shortest_time);
  const Folder folder;
  const Library library(folder, to_c(mine, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  struct State {
    S start, target;
    std::int32_t sample, samples;
  } its{};
  bool (*reset)(State*, S) = nullptr;
  bool (*update)(State*, S) = nullptr;
  bool (*moves)(const State*) = nullptr;
  void (*motion)(const State*, S*) = nullptr;
  int (*self_test)(S) = nullptr;
  library.find(reset, "loop_reset");
  library.find(update, "loop_update");
  library.find(moves, "loop_moves");
  library.find(motion, "loop_motion");
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(S(0)), 0);
  Random random(seed);
  S target(0);
  int finished = 0;
  int refused = 0;
  for (int k = 0; k < 40000 && !testing::Test::HasFailure(); ++k) {
    if (random.index(50) == 0) target = static_cast<S>(random.uniform(-3, 3));
    S given = target;
    if (random.index(100) == 0) given = anything<S>(random);
    if (random.index(1000) == 0) {
      const S at = random.index(4) == 0 ? hidden_nan<S>() : given;
      EXPECT_EQ(mine.reset(at), reset(&its, at));
    }
    const bool moved = mine.moving();
    const bool good = mine.update(given);
    EXPECT_EQ(good, update(&its, given)) << k;
    EXPECT_EQ(mine.moving(), moves(&its)) << k;
    std::array<S, std::size_t{Order} + 1> of_c{};
    motion(&its, of_c.data());
    const auto of_cpp = mine.motion();
    for (int i = 0; i <= Order; ++i) {
      EXPECT_TRUE(equal_bits(S(of_cpp(i)), of_c[static_cast<std::size_t>(i)]))
          << "sample " << k << ", derivative " << i;
    }
    finished += moved && !mine.moving();
    refused += !good;
    // A move over an absurd way would last for the rest of the test.
    if (detail::absolute(S(of_cpp(0))) > S(100)) {
      EXPECT_EQ(mine.reset(S(0)), reset(&its, S(0)));
    }
  }
  EXPECT_GT(finished, 40);
  EXPECT_GT(refused, 40);
  // Which way is too far: to the last digit.
  const auto accepts = [&](S to) {
    EXPECT_TRUE(mine.reset(S(0)) && reset(&its, S(0)));
    const bool good = mine.update(to);
    EXPECT_EQ(good, update(&its, to)) << to;
    return good;
  };
  S good(1);
  S bad(1);
  while (accepts(bad)) bad = bad * S(2);
  for (S middle = bad / 2; good < middle && middle < bad; middle = good + (bad - good) / 2) {
    (accepts(middle) ? good : bad) = middle;
  }
  EXPECT_GT(good, S(1));
}

TEST(ProfileCode, EqualsTheProfile) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_profile<1, double>(1);
  equals_profile<2, float>(2);
  equals_profile<2, double>(3, 0.5);
  equals_profile<3, double>(4);
  equals_profile<4, float>(5);
}

/// Targets that change on the way, starts elsewhere, and bad numbers of both.
template <int Order, int Capacity, class S>
void equals_approach(std::uint64_t seed, double gain, double pole) {
  SCOPED_TRACE(testing::Message() << Order << " " << Capacity << ", " << sizeof(S) << " bytes");
  auto mine = approach<Order, Capacity, S>(gain, pole);
  const Folder folder;
  const Library library(folder, to_c(mine, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  std::vector<std::uint64_t> its(1000);
  bool (*start)(void*, S, S) = nullptr;
  bool (*update)(void*, S) = nullptr;
  void (*motion)(const void*, S*) = nullptr;
  S (*feed)(const void*) = nullptr;
  int (*self_test)(S) = nullptr;
  library.find(start, "loop_start");
  library.find(update, "loop_update");
  library.find(motion, "loop_motion");
  library.find(feed, "loop_feed");
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(S(0)), 0);
  Random random(seed);
  const auto same = [&](int k) {
    std::array<S, std::size_t{Order} + 1> of_c{};
    motion(its.data(), of_c.data());
    for (int i = 0; i <= Order; ++i) {
      EXPECT_TRUE(equal_bits(S(mine.motion()(i)), of_c[static_cast<std::size_t>(i)]))
          << "sample " << k << ", derivative " << i;
    }
    EXPECT_TRUE(equal_bits(mine.feed(), feed(its.data()))) << k;
  };
  S target(0);
  int refused = 0, starts = 0, exact = 0;
  for (int k = 0; k < 40000 && !testing::Test::HasFailure(); ++k) {
    // Far away for float, whose digits do not hold a small step there.
    if (random.index(80) == 0) target = static_cast<S>(random.uniform(-30, 30) + 3000);
    S given = target;
    if (random.index(100) == 0)
      given = random.index(4) == 0 ? hidden_nan<S>() : anything<S>(random);
    if (random.index(1000) == 0 || k == 50) {
      S y = static_cast<S>(random.uniform(2970, 3030));
      S u = static_cast<S>(random.uniform(-20, 80));
      if (random.index(3) == 0) (random.index(2) == 0 ? y : u) = anything<S>(random);
      const bool started = mine.start(y, u);
      EXPECT_EQ(started, start(its.data(), y, u)) << y << " " << u;
      ++(started ? starts : refused);
      same(k);
    }
    const bool good = mine.update(given);
    EXPECT_EQ(good, update(its.data(), given)) << k;
    refused += !good;
    same(k);
    exact += mine.motion()(0) == target;
    // Back from an absurd place, which would take the rest of the test.
    if (detail::absolute(S(mine.motion()(0))) > S(1e5)) {
      EXPECT_TRUE(mine.start(target, S(1)) && start(its.data(), target, S(1)));
    }
  }
  EXPECT_GT(refused, 40);
  EXPECT_GT(starts, 20);
  EXPECT_GT(exact, 10);
  // What is too far: to the last digit.
  const auto accepts = [&](S y, S u) {
    const bool good = mine.start(y, u);
    EXPECT_EQ(good, start(its.data(), y, u)) << y << " " << u;
    return good;
  };
  for (const bool of_place : {true, false}) {
    const auto fits = [&](S x) { return of_place ? accepts(x, S(1)) : accepts(S(1), x); };
    S good(1);
    S bad = std::numeric_limits<S>::max();
    EXPECT_FALSE(fits(bad));
    for (int i = 0; i < 4000; ++i) {
      // Half way between the exponents first.
      const S middle =
          bad / 2 > good ? S(std::sqrt(good) * std::sqrt(bad)) : good + (bad - good) / 2;
      if (!(good < middle && middle < bad)) break;
      (fits(middle) ? good : bad) = middle;
    }
    EXPECT_GT(good, S(1));
  }
}

TEST(ProfileCode, EqualsTheApproach) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_approach<1, 1, double>(11, 2.0, 0.05);
  equals_approach<1, 6, float>(12, -0.3, 0.0);
  equals_approach<2, 1, float>(13, 0.7, 0.1);
  equals_approach<2, 9, double>(14, -40.0, 0.3);
}

/// Where the samples of its self-test are beyond the scalar.
TEST(ProfileCode, ATestOfItselfHasNumbers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto profile = ApproachProfile<1, 0, float>::make({.input_gain = 1e36F,
                                                           .limits = {.lower = -10, .upper = 10},
                                                           .bandwidth = 0.1F,
                                                           .sample_time = 100})
                           .value();
  const Folder folder;
  const Library library(folder, to_c(profile, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  int (*self_test)(float) = nullptr;
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(0), 0);
}

TEST(ProfileCode, CompilesWithOtherCompilers) {
  const CCode code = to_c(profile<2, float>(), {.name = "move", .comment = "of the axis"}).value();
  EXPECT_NE(code.header.find(" * of the axis\n"), std::string::npos);
  compiles_elsewhere(code, "move");
  compiles_elsewhere(to_c(approach<2, 4, float>(2, 0.1), {.name = "heat"}).value(), "heat");
}

#endif  // ESOKIT_LOADS_C

TEST(ProfileCode, RefusesByName) {
  const auto code = to_c(profile<2, double>(), {.name = "2nd"});
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "name");
  const auto other = to_c(approach<1, 1, double>(2, 0), {.self_test_samples = 0});
  ASSERT_FALSE(other);
  EXPECT_STREQ(other.error().field, "self_test_samples");
}

}  // namespace target_profile_code_test
}  // namespace esokit_test
