// The C of a time-proportioned output equals it bit for bit: any u, bad ones, a fresh start.
#include <cmath>
#include <cstdint>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/target/time_proportioned_code.hpp>
#include <limits>
#include <target/written.hpp>

namespace esokit_test {
namespace target_time_proportioned_code_test {

using namespace esokit;

template <class S>
TimeProportioned<S> output(double on) {
  return TimeProportioned<S>::make({.off = S(0.3),
                                    .on = static_cast<S>(on),
                                    .window = S(0.64),
                                    .least_on = S(0.06),
                                    .least_off = S(0.1),
                                    .sample_time = S(0.02)})
      .value();
}

#ifdef ESOKIT_LOADS_C

template <class S>
void equals_output(std::uint64_t seed, double on) {
  SCOPED_TRACE(testing::Message() << sizeof(S) << " bytes, on " << on);
  const auto fresh = output<S>(on);
  auto mine = fresh;
  const Folder folder;
  const Library library(folder, to_c(mine, {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  struct State {
    S carried;
    std::int32_t sample, on_samples;
  } its{};
  void (*reset)(State*) = nullptr;
  bool (*begins)(const State*) = nullptr;
  bool (*update)(State*, S) = nullptr;
  S (*applied)(const State*) = nullptr;
  int (*self_test)(S) = nullptr;
  library.find(reset, "loop_reset");
  library.find(begins, "loop_begins");
  library.find(update, "loop_update");
  library.find(applied, "loop_applied");
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(S(0)), 0);
  Random random(seed);
  int ons = 0;
  for (int k = 0; k < 40000 && !testing::Test::HasFailure(); ++k) {
    S u = static_cast<S>(0.3 + (on - 0.3) * random.uniform(-0.2, 1.2));
    if (random.index(20) == 0) u = anything<S>(random);
    if (random.index(20) == 0) u = hidden_nan<S>();
    if (random.index(1000) == 0) {
      mine = fresh;
      reset(&its);
    }
    EXPECT_EQ(mine.begins(), begins(&its)) << k;
    const bool is_on = mine.update(u);
    EXPECT_EQ(is_on, update(&its, u)) << k;
    EXPECT_TRUE(equal_bits(mine.applied(), applied(&its))) << k;
    ons += is_on;
  }
  EXPECT_GT(ons, 10000);
  EXPECT_LT(ons, 30000);
  // Where a window takes a sample more: to the last digit, after one that was off, and on.
  const S range = static_cast<S>(on) - S(0.3);
  for (int half = 1; half < 64; ++half) {
    S u = S(0.3) + range * (static_cast<S>(half) / S(64));
    for (int i = 0; i < 4; ++i) u = std::nextafter(u, -std::numeric_limits<S>::max());
    for (int i = 0; i < 16; ++i) {
      mine = fresh;
      reset(&its);
      for (int k = 0; i % 2 == 1 && k < 32; ++k) {
        EXPECT_TRUE(mine.update(static_cast<S>(on)) && update(&its, static_cast<S>(on)));
      }
      EXPECT_EQ(mine.update(u), update(&its, u)) << half << ", " << i;
      EXPECT_TRUE(equal_bits(mine.applied(), applied(&its))) << half << ", " << i;
      if (i % 2 == 1) u = std::nextafter(u, std::numeric_limits<S>::max());
    }
  }
}

TEST(TimeProportionedCode, EqualsTheOutput) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_output<double>(1, 100);
  equals_output<double>(2, -7);
  equals_output<float>(3, 1);
}

/// Where the samples of its self-test are beyond the scalar.
TEST(TimeProportionedCode, ATestOfItselfHasNumbers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const Folder folder;
  const Library library(folder, to_c(output<float>(-3.3e38), {.name = "loop"}).value(), "");
  ASSERT_TRUE(library.loaded());
  int (*self_test)(float) = nullptr;
  library.find(self_test, "loop_self_test");
  EXPECT_EQ(self_test(0), 0);
}

TEST(TimeProportionedCode, IsTested) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  const auto made = TimeProportioned<float>::make(
      {.off = 0, .on = 1, .window = 10, .least_on = 1, .least_off = 1, .sample_time = 0.1F});
  const CCode code = to_c(made.value(), {.name = "loop"}).value();
  reaches(code);
  notices(code,
          {{"samples = LONGEST;", "samples = WINDOW;"},
           {"least = 1;", "least = SHORTEST;"},
           {"inside = LOW;", "inside = HIGH;"},
           {"samples = 0;\n    }", "samples = least;\n    }"},
           {"o->carried = wanted - (float)o->on_samples", "o->carried = 0.0f"}},
          0.0F);
}

TEST(TimeProportionedCode, CompilesWithOtherCompilers) {
  const CCode code =
      to_c(output<float>(100), {.name = "relay", .comment = "of the heater"}).value();
  EXPECT_NE(code.header.find(" * of the heater\n"), std::string::npos);
  compiles_elsewhere(code, "relay");
}

#endif  // ESOKIT_LOADS_C

TEST(TimeProportionedCode, RefusesByName) {
  const auto code = to_c(output<double>(100), {.name = "2nd"});
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "name");
}

}  // namespace target_time_proportioned_code_test
}  // namespace esokit_test
