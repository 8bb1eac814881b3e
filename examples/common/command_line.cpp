#include "command_line.hpp"

#include <cstdio>
#include <cstdlib>
#include <optional>

namespace esokit::examples {

std::filesystem::path output_folder(int argc, char** argv, const std::string& what) {
  const std::string program =
      argc > 0 ? std::filesystem::path(argv[0]).filename().string() : std::string("example");
  const std::string usage =
      "usage: " + program + " [--out DIR | DIR]\n" + what + " DIR (default: out)";
  const auto refuse = [&](const std::string& why) {
    std::fprintf(stderr, "%s: %s\n%s\n", program.c_str(), why.c_str(), usage.c_str());
    std::exit(2);
  };
  std::optional<std::string> folder;
  for (int i = 1; i < argc; ++i) {
    std::string argument = argv[i];
    if (argument == "--help" || argument == "-h") {
      std::printf("%s\n", usage.c_str());
      std::exit(0);
    }
    if (argument == "--out") {
      if (++i == argc) refuse("--out needs a folder");
      argument = argv[i];
    } else if (argument.starts_with("--out=")) {
      argument.erase(0, 6);
    } else if (argument.starts_with("-")) {
      refuse("unknown option " + argument);
    }
    if (argument.empty()) refuse("the output folder is empty");
    if (folder) refuse("more than one output folder: " + *folder + ", " + argument);
    folder = argument;
  }
  return folder.value_or("out");
}

}  // namespace esokit::examples
