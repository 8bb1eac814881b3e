/// @file
/// The error of a file that could not be written.
#pragma once

#include <cstdio>
#include <cstring>
#include <esokit/core/language.hpp>
#include <string>

namespace esokit::sim {

/// Which file, what went wrong, and the system's error number where it has one.
struct FileError {
  std::string path;         ///< as given by the caller
  const char* reason = "";  ///< static storage
  int code = 0;             ///< errno, 0 if the system was not at fault
};

/// `path: reason (system text)`.
inline std::string to_text(const FileError& error) {
  std::string text = error.path + ": " + error.reason;
  if (error.code != 0) text = text + " (" + std::strerror(error.code) + ")";
  return text;
}

/// Last words before `Expected::value()` on an error ends the program.
inline void print_last_words(const FileError& error) noexcept {
  std::fprintf(stderr, "esokit: %s: %s\n", error.path.c_str(), error.reason);
}

}  // namespace esokit::sim
