// from_log, and beside its page the controller as C99 and as Structured Text, in float: drive.h,
// drive.c, drive.st. A program of its own, as its fifteen types of controllers take as long to
// compile as all of from_log.
//
//   from_log_c drive.csv --y angle --u torque --limits -5,5

#include <cctype>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <esokit/core/error_text.hpp>
#include <esokit/tune/tuned_code.hpp>

#include "from_log/parts/command.hpp"

namespace {

/// An identifier from the name of a file.
std::string identifier(const std::string& stem) {
  std::string name;
  for (const char c : stem) name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) != 0 ? "loop_" + name
                                                                                : name;
}

void write_code(const from_log::Design& design, const std::string& page) {
  if (design.pasting().actuator.curved()) {
    std::fprintf(stderr,
                 "no C: a controller behind the curve of an actuator is written in C++ only; "
                 "--literal curve leaves the curve out\n");
    return;
  }
  const auto& model = design.tuning().model;
  const auto stem = std::filesystem::path(page).replace_extension();
  const esokit::CodeOptions options{.name = identifier(stem.filename().string()),
                                    .comment = design.taken().name};
  const auto code = esokit::detail::with_number<1, 3>(model.order, [&](auto order) {
    return esokit::tuned_code<order(), float>(model, design.taken(), options);
  });
  if (!code) {
    std::fprintf(stderr, "no C: %s\n", esokit::to_text(code.error()).c_str());
    return;
  }
  const auto put = [&](const char* ending, const std::string& text) {
    const auto path = stem.parent_path() / (options.name + ending);
    std::ofstream(path) << text;
    std::printf("%s\n", path.string().c_str());
  };
  put(".h", code->c.header);
  put(".c", code->c.source);
  put(".st", code->structured_text);
}

}  // namespace

int main(int argc, char** argv) { return from_log::command(argc, argv, write_code); }
