/// @file
/// The error of a refused configuration: which field, which value, which rule.
#pragma once

#include <esokit/core/detail/text.hpp>
#include <esokit/core/lanes.hpp>

#if defined(__linux__) || defined(_WIN32) || defined(__APPLE__)
#include <cstdio>
#endif

namespace esokit {

/// Names the field, its value and the broken rule. Write it to any stream with <<, or include
/// core/error_text.hpp for `to_text` and std::format.
///
/// The value has the scalar type of the config: on a single-precision target a double would link
/// routines for software floating point.
template <class ScalarType>
struct Error {
  const char* field = "";  ///< name of the config member, static storage
  ScalarType value{};      ///< the value that was refused
  const char* rule = "";   ///< the rule it breaks, static storage
  int index = -1;          ///< element of an array member, -1 for a scalar member
  ScalarType limit{};      ///< computed limit of the rule; valid if has_limit
  bool has_limit = false;  ///< whether `limit` is valid
  int lane = -1;           ///< lane of the pack from which the value is, -1 for a plain scalar
};

/// An Error can be written to a stream, see has_text.
template <class ScalarType>
inline constexpr bool has_text<Error<ScalarType>> = true;

/// Writes `field[index] = value: rule limit (lane number)`, without the parts that do not apply.
template <class Stream, class ScalarType>
requires detail::WritesText<Stream, int, ScalarType> Stream& operator<<(
    Stream& out, const Error<ScalarType>& error) {
  out << error.field;
  if (error.index >= 0) out << "[" << error.index << "]";
  out << " = " << error.value << ": " << error.rule;
  if (error.has_limit) out << " " << error.limit;
  if (error.lane >= 0) out << " (lane " << error.lane << ")";
  return out;
}

/// Prints the error before `Expected::value()` ends the program; on systems with a console only.
template <class ScalarType>
void print_last_words([[maybe_unused]] const Error<ScalarType>& error) noexcept {
#if defined(__linux__) || defined(_WIN32) || defined(__APPLE__)
  if constexpr (PlainScalar<ScalarType>) {
    std::fprintf(stderr, "esokit: %s", error.field);
    if (error.index >= 0) std::fprintf(stderr, "[%d]", error.index);
    std::fprintf(stderr, " = %Lg: %s", static_cast<long double>(error.value), error.rule);
    if (error.has_limit) std::fprintf(stderr, " %Lg", static_cast<long double>(error.limit));
    if (error.lane >= 0) std::fprintf(stderr, " (lane %d)", error.lane);
    std::fprintf(stderr, " (value() was called on a refused config)\n");
  }
#endif
}

}  // namespace esokit
