/// @file
/// Text of the types with `has_text` (errors, results, flags), for programs with a console.
/// std::format is tested with Clang 19 and libc++; GCC has it from version 13, where it is not
/// tested.
#pragma once

#include <esokit/core/detail/text.hpp>
#include <sstream>
#include <string>
#include <version>
#ifdef __cpp_lib_format
#include <format>
#endif

namespace esokit {

/// What << writes, as a string.
template <class T>
requires has_text<T> && detail::WritesText<std::ostream, T> std::string to_text(const T& value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace esokit

#ifdef __cpp_lib_format
/// Lets std::format write these types, with width and fill as for a string.
template <class T>
requires requires(const T& value) { esokit::to_text(value); }
struct std::formatter<T> : std::formatter<std::string> {
  auto format(const T& value, auto& context) const {
    return std::formatter<std::string>::format(esokit::to_text(value), context);
  }
};
#endif
