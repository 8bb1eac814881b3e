// Text of errors, results and flags: to_text everywhere, std::format where the standard library has
// it (GCC 13, libc++ 17). Without GoogleTest, so that any compiler with any library builds it
// alone:
//   clang++-19 -std=c++20 -stdlib=libc++ -Iinclude -I/usr/include/eigen3 <this file>
#include <cstdio>
#include <esokit/control/control_loop.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/step_status.hpp>
#include <string>

namespace {

int failures = 0;

void expect(const std::string& got, const std::string& wanted) {
  if (got == wanted) return;
  ++failures;
  std::printf("got    '%s'\nwanted '%s'\n", got.c_str(), wanted.c_str());
}

using esokit::Error;
using esokit::Expected;
using esokit::to_text;

}  // namespace

int main() {
  const Error<double> plain{"sample_time", -0.5, "must be finite and positive"};
  const Error<float> full{"gains", 3.0f, "must not be above", 2, 1.5f, true};
  const Expected<int, Error<double>> seven = 7;
  const Expected<int, Error<double>> refused = plain;
  const Expected<void, Error<double>> done;
  expect(to_text(plain), "sample_time = -0.5: must be finite and positive");
  expect(to_text(full), "gains[2] = 3: must not be above 1.5");
  expect(to_text(seven), "7");
  expect(to_text(refused), to_text(plain));
  expect(to_text(done), "ok");
  expect(to_text(esokit::LoopMode::safe), "safe");
#ifdef __cpp_lib_format
  expect(std::format("{}", plain), to_text(plain));
  expect(std::format("{}|{}", full, seven), to_text(full) + "|7");
  expect(std::format("{:>10}|{:*<6}|{:^5}", esokit::LoopMode::safe, done, seven),
         "      safe|ok****|  7  ");
  expect(std::format("{}", refused), to_text(plain));
  expect(std::format("{}", esokit::StepStatus::measurement_rejected),
         to_text(esokit::StepStatus::measurement_rejected));
  // What is not of esokit keeps its own formatter.
  expect(std::format("{:.2f} {:5} {:>4}", 0.125, std::string("abc"), 7), "0.12 abc      7");
#endif
  if (failures == 0) std::puts("ok");
  return failures == 0 ? 0 : 1;
}
