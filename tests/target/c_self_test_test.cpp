// The self-test of written C reaches nearly all of it, and fails where the C was changed.
#include <target/written.hpp>

#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
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
  return C::make({.observer = settings_of_observer(),
                  .controller_bandwidth = 15,
                  .limits = {.lower = -5, .upper = 5}})
      .value();
}

/// What gcov says of loop.c in per cent: lines, and branches that were taken.
template <class Object>
void reaches(const Object& object) {
  SCOPED_TRACE(testing::internal::GetTypeName<Object>());
  const Folder folder;
  const CCode code = to_c(object, {.name = "loop"}).value();
  folder.write("loop.h", code.header);
  folder.write("loop.c", code.source);
  folder.write("main.c", "#include \"loop.h\"\nint main(void) { return loop_self_test(0.0f); }\n");
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
  reaches(Observer::make(settings_of_observer()).value());
  reaches(controller<Adrc<Observer>>());
  reaches(controller<PredictiveAdrc<Observer>>());
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
