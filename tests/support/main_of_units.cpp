// The main() of a program of several test files (tests/CMakeLists.txt). Called by the name of one
// of them, <area>_<name>_test, it runs the cases of that file, otherwise all; a filter of the
// caller that names cases stands for itself.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <string>

namespace {

/// The name of the program that a file would be by itself; empty where its case is registered
/// nowhere.
std::string program_of(const testing::TestInfo& test) {
  if (test.file() == nullptr) return "";
  const std::filesystem::path file(test.file());
  return file.parent_path().filename().string() + "_" + file.stem().string();
}

/// The cases of one file as a filter of GoogleTest; empty if it has none.
std::string cases_of(const std::string& program) {
  std::string cases;
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  for (int i = 0; i < all.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *all.GetTestSuite(i);
    for (int k = 0; k < suite.total_test_count(); ++k) {
      const testing::TestInfo& test = *suite.GetTestInfo(k);
      if (program_of(test) == program) {
        cases += std::string(suite.name()) + "." + test.name() + ":";
      }
    }
  }
  return cases;
}

}  // namespace

int main(int count, char** arguments) {
  testing::InitGoogleTest(&count, arguments);
  const std::string program = std::filesystem::path(arguments[0]).stem().string();
  std::string& filter = testing::GTEST_FLAG(filter);
  if (program.ends_with("_test") && (filter == "*" || filter.starts_with("-"))) {
    const std::string cases = cases_of(program);
    if (cases.empty()) {
      std::fprintf(stderr, "%s: no case is of this file\n", program.c_str());
      return 1;
    }
    filter = cases + (filter == "*" ? "" : filter);
  }
  return RUN_ALL_TESTS();
}
