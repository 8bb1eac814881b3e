/// @file
/// Text of an error, for programs that have a console.
#pragma once

#include <esokit/core/error.hpp>
#include <ostream>
#include <sstream>
#include <string>

namespace esokit {

/// Writes `field[index] = value: rule limit`.
template <class ScalarType>
std::ostream& operator<<(std::ostream& out, const Error<ScalarType>& error) {
  out << error.field;
  if (error.index >= 0) out << '[' << error.index << ']';
  out << " = " << error.value << ": " << error.rule;
  if (error.has_limit) out << ' ' << error.limit;
  return out;
}

/// The same as a string.
template <class ScalarType>
std::string to_text(const Error<ScalarType>& error) {
  std::ostringstream out;
  out << error;
  return out.str();
}

}  // namespace esokit
