/// @file
/// Recorded calls as lines of a language: the names and expressions of to_c.
#pragma once

#include <array>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/recorder.hpp>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Keys and what stands for them.
using Words = std::vector<std::pair<std::string, std::string>>;

/// `text` with each key replaced, in the order of the words.
std::string filled(std::string text, const Words& words);

/// A language: how it writes numbers and operations. `a`, `b`, `c` behind a dollar are operands.
struct Language {
  const char* real[2];             ///< double, float
  const char* number_suffix[2];    ///< of a constant
  const char* from_state;          ///< before the name of a number of the object
  std::array<const char*, 26> of;  ///< each Operation
};

inline constexpr Language c_language{
    {"double", "float"},
    {"", "f"},
    "o->",
    {"",          "",           "$a + $b",    "$a - $b",       "$a * $b",       "$a / $b",
     "-$a",       "fabs$f($a)", "sqrt$f($a)", "pow$f($a, $b)", "exp$f($a)",     "expm1$f($a)",
     "sin$f($a)", "cos$f($a)",  "tan$f($a)",  "atan$f($a)",    "tanh$f($a)",    "$a ? $b : $c",
     "$a < $b",   "$a > $b",    "$a <= $b",   "$a >= $b",      "is_finite($a)", "$a && $b",
     "$a || $b",  "!$a"}};

/// A recorded call with names.
struct NamedCall {
  std::string name;
  std::vector<std::string> arguments;
  bool has_output = false;
};

/// A call as lines.
struct WrittenCall {
  struct Line {
    std::string name;
    std::string expression;
    bool is_condition;
  };
  std::vector<Line> reads{};          ///< the numbers of the object that it needs
  std::vector<Line> lines{};          ///< what is computed, in its order
  std::vector<std::string> checks{};  ///< if one does not hold, the call changes nothing
  std::vector<std::pair<std::string, std::string>> results{};  ///< a number, and what it becomes
  std::string output{};                                        ///< what is returned, if anything
  std::vector<std::string> unused{};                           ///< arguments
};

/// What `one` makes of each, with commas.
template <class All, class One>
std::string listed(const All& all, const One& one) {
  std::string text;
  for (const auto& each : all) text += (text.empty() ? "" : ", ") + one(each);
  return text;
}

/// What `one` makes of 0 .. count - 1, one after the other; `counted`: with commas.
/// @{
template <class Count, class One>
std::string each(Count count, const One& one) {
  std::string text;
  for (Count i = 0; i < count; ++i) text += one(i);
  return text;
}
template <class Count, class One>
std::string counted(Count count, const One& one) {
  return each(count, [&](Count i) { return (i > 0 ? ", " : "") + one(i); });
}
/// @}

/// Writes recorded calls line by line.
class ListWriter {
 public:
  ListWriter(const Language& language, bool single) : language_(&language), single_(single) {}

  std::vector<std::string> members{};  ///< a name for each number of the object
  std::vector<bool> live{};            ///< the numbers that the state needs
  std::vector<bool> settings{};        ///< those of them that are settings

  [[nodiscard]] std::string real() const { return language_->real[single_ ? 1 : 0]; }
  [[nodiscard]] bool single() const { return single_; }
  /// The number, read back bit for bit.
  [[nodiscard]] std::string number(double value) const;
  /// `{1.0, 2.0}`
  template <class Numbers>
  [[nodiscard]] std::string numbers(const Numbers& all) const {
    return "{" + listed(all, [&](auto x) { return number(static_cast<double>(x)); }) + "}";
  }
  /// The same, a line for each.
  template <class Rows>
  [[nodiscard]] std::string rows(const Rows& all) const {
    std::string text;
    for (const auto& row : all) text += "    " + numbers(row) + ",\n";
    return text;
  }

  /// Which instructions are needed for checks, outputs and live numbers.
  [[nodiscard]] std::vector<bool> needed(const RecordedCall& call) const;

  /// Adds the numbers that the calls read to the live ones.
  void find_live(const RecordedObject& all);

  /// The lines of a call.
  [[nodiscard]] WrittenCall written(const NamedCall& names, const RecordedCall& call) const;

 private:
  /// How often each result is used; twice, if it needs a name.
  [[nodiscard]] std::vector<int> counted(const RecordedCall& call,
                                         const std::vector<bool>& need) const;

  const Language* language_;
  bool single_;
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/list_writer.ipp>
#endif
