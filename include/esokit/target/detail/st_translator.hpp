/// @file
/// The C that esokit writes, function by function as Structured Text.
#pragma once

#include <cstddef>
#include <deque>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <string>
#include <vector>

namespace esokit::detail {

/// The one of that name, or null.
template <class All>
auto found(All& all, const std::string& name) -> decltype(&all[0]) {
  for (auto& one : all) {
    if (one.name == name) return &one;
  }
  return nullptr;
}

class StParser;

/// Translates C, in the narrow subset that to_c writes, into functions of Structured Text (IEC
/// 61131-3, second edition: no methods, no pointers). The subset: declaration, assignment, if,
/// else, for, while, return, call. A pointer becomes VAR_IN_OUT, a count of any width UDINT, a
/// table a part of the state. Structured Text evaluates both sides of a condition and of a choice:
/// what C evaluates only behind another one neither changes anything nor is a place or a difference
/// of counts. What is no part of the subset ends it: see `error`.
class StTranslator {
 public:
  /// What could not be translated; empty: nothing.
  std::string error{};

  /// @param text header and source, one after the other @param name before each function and type
  StTranslator(const std::string& text, const std::string& name);

  [[nodiscard]] bool has(const std::string& name) const {
    return found(functions_, name) != nullptr;
  }
  /// `body`, behind the types and all functions that it needs.
  [[nodiscard]] std::string text_for(const std::string& body) const;
  /// A function that gives the settings of the C to a variable. @param as behind its name
  [[nodiscard]] std::string settings(const std::string& as) const;

  /// A number of C.
  [[nodiscard]] static std::string number(std::string text);

 private:
  friend class StParser;
  struct Variable {
    std::string name{}, type{};
    std::vector<int> sizes{};  ///< of an array
    bool is_constant = false;
    std::string part = "VAR";  ///< or VAR_IN_OUT, VAR_INPUT
    std::string initial{}, comment{};
  };
  /// Or a struct, whose variables are its fields.
  struct Function {
    std::string name{}, type{}, text{};
    std::vector<Variable> variables{};
    std::size_t parameters = 0;  ///< so many of them, the first
  };
  std::string name_, types_{};
  std::string settings_{};            ///< the statements that give them
  std::deque<Function> functions_{};  ///< what is called before what calls it
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/st_translator.ipp>
#endif
