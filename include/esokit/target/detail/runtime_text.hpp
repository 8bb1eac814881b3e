/// @file
/// The C around what is recorded: the files in target/runtime/, without the parts that a design
/// does not have, and with its names and numbers.
#pragma once

#include <cctype>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/language.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Files of target/runtime/, each one C99 and, for a C++ compiler, the literal that holds it.

namespace runtime {

inline constexpr const char* head =
#include <esokit/target/runtime/head.c>
    ;

}  // namespace runtime

/// Makes the text of a written C from files of target/runtime/. In these
/// - an `#if` over words that begin with ESOKIT_ (with !, && and ||) asks for a feature; it and
///   what is not chosen do not come into the text,
/// - `esokit_` and `ESOKIT_` begin names: they become that of the design,
/// - a word such as DESIGN_Y stands for a text; alone in its line, for lines,
/// - a word such as GATE_MOST is a constant: a header has its value, a source a `#define`,
/// - a `#define` of a small letter is another name for a function, not a part of the text,
/// - `real`, 0.5 and fabs become float, 0.5f and fabsf in single precision.
class RuntimeText {
 public:
  RuntimeText(const std::string& name, bool single);

  /// The writer of its numbers.
  [[nodiscard]] const ListWriter& writer() const { return writer_; }

  void feature(const std::string& name, bool on) {
    if (on) features_.insert(name);
  }
  void replace(const std::string& name, const std::string& text) { words_[name] = text; }
  /// @param text each line with its end
  void lines(const std::string& name, const std::string& text) { lines_[name] = text; }
  void constant(const std::string& name, const std::string& value) {
    constants_.emplace_back(name, value[0] == '-' ? "(" + value + ")" : value);
  }
  void count(const std::string& name, std::size_t value) {
    constant(name, std::to_string(value) + "u");
  }
  template <class S>
  void number(const std::string& name, S value) {
    constant(name, writer_.number(static_cast<double>(value)));
  }
  /// @{
  /// Of several, each with its name.
  void features(std::initializer_list<std::pair<const char*, bool>> all) {
    for (const auto& [name, on] : all) feature(name, on);
  }
  void counts(std::initializer_list<std::pair<const char*, std::size_t>> all) {
    for (const auto& [name, value] : all) count(name, value);
  }
  void numbers(std::initializer_list<std::pair<const char*, double>> all) {
    for (const auto& [name, value] : all) number(name, value);
  }
  /// @}

  /// Whether a condition of an `#if` holds: names with !, joined by &&, these by ||.
  [[nodiscard]] bool has(std::string_view condition) const;

  /// A header: constants are in place.
  [[nodiscard]] std::string header(std::string_view file);
  /// A source of some files: DESIGN_CONSTANTS are the constants that they use.
  [[nodiscard]] std::string source(const std::vector<const char*>& files);
  [[nodiscard]] std::string parts(const std::vector<const char*>& files);

  /// The part of a file that the design has.
  [[nodiscard]] std::string part(std::string_view file);

  [[nodiscard]] static bool uses(std::string_view text, std::string_view word);

 private:
  /// Of an `#if`, until its `#endif`. Others than of features stay in the text.
  struct Branch {
    bool is_of_features, is_active, was_taken;
  };

  static bool begins(std::string_view text, std::string_view with) {
    return text.substr(0, with.size()) == with;
  }
  static bool is_letter(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  }
  static bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

  /// Takes a line that chooses. @return whether it is no part of the text
  [[nodiscard]] bool chooses(std::string_view line, std::vector<Branch>& branches) const;

  /// A line with what its words and numbers stand for.
  [[nodiscard]] std::string named(std::string_view line);
  [[nodiscard]] std::string named_word(const std::string& word) const;

  ListWriter writer_;
  bool in_comment_ = false;
  std::string name_;
  std::string upper_{};
  std::set<std::string, std::less<>> features_{};
  std::map<std::string, std::string> words_{};
  std::map<std::string, std::string, std::less<>> lines_{};
  std::vector<std::pair<std::string, std::string>> constants_{};
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/runtime_text.ipp>
#endif
