/// @file
/// The command line of the examples and of make_index: nothing but the output folder.
#pragma once

#include <filesystem>
#include <string>

namespace esokit::examples {

/// The folder from `[--out DIR | DIR]`, or "out". Ends the program with exit code 2 and the usage
/// if the command line says anything else.
[[nodiscard]] std::filesystem::path output_folder(int argc, char** argv, const std::string& what);

}  // namespace esokit::examples
