// The self-test of written C reaches nearly all of it, and fails where the C was changed.
#include <target/written.hpp>

#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/profile_code.hpp>
#include <fstream>
#include <string>

namespace esokit_test {
namespace target_c_self_test_test {

#ifdef ESOKIT_LOADS_C

using namespace esokit;

using Observer = LinearEso<2, float>;

Observer::Config settings_of_observer() {
  return {.observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3F, .max_gap = 10};
}

template <class C>
C controller() {
  typename C::Config settings{};
  settings.observer = {.observer_bandwidth = 100,
                       .input_gain = 50,
                       .sample_time = typename C::scalar_type(1e-3),
                       .max_gap = 10};
  settings.controller_bandwidth = 15;
  settings.limits.lower = -5;
  settings.limits.upper = 5;
  return C::make(settings).value();
}

/// What gcov says of loop.c in per cent: lines, and branches that were taken. @param given to the
/// self-test
void reaches(const CCode& code, const std::string& given = "0.0f") {
  const Folder folder;
  folder.write("loop.h", code.header);
  folder.write("loop.c", code.source);
  folder.write("main.c",
               "#include \"loop.h\"\nint main(void) { return loop_self_test(" + given + "); }\n");
  ASSERT_TRUE(runs("cd " + folder.file("") +
                   " && gcc -std=c99 -O0 --coverage -DLOOP_SELF_TEST main.c loop.c -o all -lm && "
                   "./all && gcov -b all-loop.gcda >found.txt 2>&1"));
  std::ifstream text(folder.file("found.txt"));
  double lines = 0;
  double branches = 0;
  bool is_it = false;
  for (std::string line; std::getline(text, line);) {
    if (line.rfind("File ", 0) == 0) is_it = line == "File 'loop.c'";
    if (!is_it) continue;
    std::sscanf(line.c_str(), "Lines executed:%lf", &lines);
    std::sscanf(line.c_str(), "Taken at least once:%lf", &branches);
  }
  EXPECT_GE(lines, 95);
  EXPECT_GE(branches, 85);
}

TEST(CSelfTest, ReachesNearlyAll) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  const CodeOptions loop{.name = "loop"};
  reaches(to_c(Observer::make(settings_of_observer()).value(), loop).value());
  reaches(to_c(controller<Adrc<Observer>>(), loop).value());
  reaches(to_c(controller<PredictiveAdrc<Observer>>(), loop).value());
}

TEST(CSelfTest, ReachesNearlyAllOfAProfile) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  SmoothProfileConfig<2, float> settings{.sample_time = 0.004F};
  settings.limits = {3.0F, 20.0F};
  reaches(to_c(SmoothProfile<2, float>::make(settings).value(), {.name = "loop"}).value());
}

template <class C>
CCode in_integers() {
  FixedPointOptions options;
  options.y = {.unit = 6.2831853 / 4096, .most = 2048};
  options.u = {.unit = 0.01, .most = 1000};
  options.code.name = "loop";
  return to_fixed_c(controller<C>(), options).value().code;
}

TEST(CSelfTest, ReachesNearlyAllInIntegers) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  reaches(in_integers<Adrc<LinearEso<2>>>(), "");
}

TEST(CSelfTest, FailsWhereTheCodeWasChanged) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  struct Change {
    const char *from, *to;
  };
  const CCode code = to_c(controller<Adrc<Observer>>(), {.name = "loop"}).value();
  for (const auto& [from, to] : {Change{"", ""}, Change{"row = elapsed - 1u", "row = 0u * elapsed"},
                                 Change{"o->gap > ROWS", "o->gap > 60000u"},
                                 Change{"o->gap >= MISSING_LIMIT", "o->gap >= 60000u"},
                                 Change{"(status & LOOP_RESTARTED) != 0u", "status > 999u"},
                                 Change{"u = commanded(o)", "u = 0.5f * commanded(o)"}}) {
    SCOPED_TRACE(from);
    CCode changed = code;
    const std::size_t at = changed.source.find(from);
    ASSERT_NE(at, std::string::npos);
    changed.source.replace(at, std::string(from).size(), to);
    const Folder folder;
    const Library library(folder, changed, "", "gcc -std=c99 -Wno-error");
    int (*self_test)(float) = nullptr;
    library.find(self_test, "loop_self_test");
    ASSERT_NE(self_test, nullptr);
    EXPECT_EQ(self_test(0) == 0, from[0] == '\0');
  }
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_self_test_test
}  // namespace esokit_test
