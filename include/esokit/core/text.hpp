/// @file
/// How results and flags become text, without a header of a stream: <<, on whatever takes a C
/// string.
#pragma once

#include <esokit/core/language.hpp>
#include <type_traits>

namespace esokit {

/// True for the types of esokit that have text: Error, Expected, StepStatus, LoopMode. They go into
/// any stream by <<; `to_text` and std::format are in core/error_text.hpp.
template <class T>
inline constexpr bool has_text = false;

namespace detail {

/// A stream, or a logger of the user's; none of ours is one.
template <class Stream, class... Values>
concept WritesText = std::is_class_v<Stream> && !has_text<Stream> &&
                     requires(Stream & out, const char* text, const Values&... values) {
  out << text;
  (out << ... << values);
};

}  // namespace detail
}  // namespace esokit
