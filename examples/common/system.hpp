/// @file
/// What Linux and Windows do differently. Texts are UTF-8 on both: on Windows a program says so in
/// its manifest (from_log/windows.manifest), and argv, fopen and the streams then take them as
/// such.
#pragma once

#include <filesystem>
#include <string>

namespace esokit::examples {

/// The path of a UTF-8 text; on Windows the library's own conversion would take each byte for a
/// letter.
[[nodiscard]] std::filesystem::path path_of(const std::string& text);

/// Makes an empty file; false and errno EEXIST if there is one, even if another program made it
/// just now.
[[nodiscard]] bool create_new(const std::string& file);

/// A new empty folder for temporary files, empty text if there can be none.
[[nodiscard]] std::string new_scratch_folder();

/// The file of this program, empty if the system does not say.
[[nodiscard]] std::filesystem::path this_program();

/// Runs a Python script with this text as its input; true if it ended well.
[[nodiscard]] bool run_python(const std::filesystem::path& script, const std::string& input);

/// Makes the terminal show UTF-8 where it does not by itself.
void print_utf8();

}  // namespace esokit::examples
