/// @file
/// The error of a refused configuration: which field, which value, which rule.
#pragma once

#include <esokit/core/scalar.hpp>
#include <esokit/core/text.hpp>

#if defined(__linux__) || defined(_WIN32) || defined(__APPLE__)
#include <cstdio>
#endif

namespace esokit {

/// Names the field, its value and the rule that it breaks. Goes into any stream by <<; `to_text`
/// and std::format are in core/error_text.hpp, which firmware need not include.
///
/// The value is held in the scalar of the config: a double in here would link soft-float helpers on
/// a single-precision target.
template <class ScalarType>
struct Error {
  const char* field = "";  ///< name of the config member, static storage
  ScalarType value{};      ///< the value that was refused
  const char* rule = "";   ///< the rule it breaks, static storage
  int index = -1;          ///< element of an array member, -1 for a scalar member
  ScalarType limit{};      ///< computed limit that belongs to the rule, if has_limit
  bool has_limit = false;  ///< whether `limit` says anything
};

/// Has text.
template <class ScalarType>
inline constexpr bool has_text<Error<ScalarType>> = true;

/// Writes `field[index] = value: rule limit`.
template <class Stream, class ScalarType>
requires detail::WritesText<Stream, int, ScalarType> Stream& operator<<(
    Stream& out, const Error<ScalarType>& error) {
  out << error.field;
  if (error.index >= 0) out << "[" << error.index << "]";
  out << " = " << error.value << ": " << error.rule;
  if (error.has_limit) out << " " << error.limit;
  return out;
}

/// Last words before `Expected::value()` on an error ends the program; desktop systems only.
template <class ScalarType>
void print_last_words([[maybe_unused]] const Error<ScalarType>& error) noexcept {
#if defined(__linux__) || defined(_WIN32) || defined(__APPLE__)
  if constexpr (PlainScalar<ScalarType>) {
    std::fprintf(stderr, "esokit: %s", error.field);
    if (error.index >= 0) std::fprintf(stderr, "[%d]", error.index);
    std::fprintf(stderr, " = %Lg: %s", static_cast<long double>(error.value), error.rule);
    if (error.has_limit) std::fprintf(stderr, " %Lg", static_cast<long double>(error.limit));
    std::fprintf(stderr, " (value() was called on a refused config)\n");
  }
#endif
}

}  // namespace esokit
