// The controller of a servo as C99 for a project without C++20: loop.h and loop.c in the folder
// that is given, or on the screen. The chip then calls loop_init once and loop_update at each
// sample.
#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <fstream>
#include <string>

int main(int argc, char** argv) {
  const auto controller = esokit::Adrc<esokit::LinearEso<2, float>>::make(
      {.observer = {.observer_bandwidth = 100.0f,  // rad/s
                    .input_gain = 50.0f,
                    .sample_time = 1e-3f,
                    .max_gap = 10},  // each missing sample that is bridged takes a row of gains
       .controller_bandwidth = 15.0f,
       .limits = {.lower = -5.0f, .upper = 5.0f}});  // V
  if (!controller) {
    std::fprintf(stderr, "%s: %s\n", controller.error().field, controller.error().rule);
    return 1;
  }
  const auto code = esokit::to_c(*controller, {.name = "loop", .comment = "angle of the servo"});
  if (!code) {  // which setting C cannot have
    std::fprintf(stderr, "%s: %s\n", code.error().field, code.error().rule);
    return 1;
  }
  if (argc < 2) {
    std::printf("%s\n%s", code->header.c_str(), code->source.c_str());
    return 0;
  }
  const std::string folder = argv[1];
  std::ofstream header(folder + "/loop.h");
  std::ofstream source(folder + "/loop.c");
  header << code->header;
  source << code->source;
  return header && source ? 0 : 1;
}
