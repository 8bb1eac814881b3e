/// @file
/// How results and flags become text: << on anything that takes C strings and numbers, so
/// that no stream header is needed.
#pragma once

#include <esokit/core/language.hpp>
#include <type_traits>

namespace esokit {

/// True for the types of esokit that can be written as text, such as Error, Expected, StepStatus
/// and LoopMode: with << to any stream, or with `to_text` and std::format of core/error_text.hpp.
template <class T>
inline constexpr bool has_text = false;

namespace detail {

/// A stream, or a logger of the user; types of esokit with text are excluded.
/// A << of ours that asks this takes its value by a deduced type: for a named one GCC 11 asks here
/// what it is just asking.
template <class Stream, class... Values>
concept WritesText = std::is_class_v<Stream> && !has_text<Stream> &&
                     requires(Stream & out, const char* text, const Values&... values) {
  out << text;
  (out << ... << values);
};

}  // namespace detail
}  // namespace esokit
