// The C of a profile equals it bit for bit: moves, targets that change on the way, bad ones.
#include <array>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/target/profile_code.hpp>
#include <limits>
#include <target/written.hpp>

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

TEST(ProfileCode, CompilesWithOtherCompilers) {
  const CCode code = to_c(profile<2, float>(), {.name = "move", .comment = "of the axis"}).value();
  EXPECT_NE(code.header.find(" * of the axis\n"), std::string::npos);
  compiles_elsewhere(code, "move");
}

#endif  // ESOKIT_LOADS_C

TEST(ProfileCode, RefusesByName) {
  const auto code = to_c(profile<2, double>(), {.name = "2nd"});
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "name");
}

}  // namespace target_profile_code_test
}  // namespace esokit_test
