/// @file
/// The C that esokit writes, function by function as Structured Text.
#pragma once

#include <algorithm>
#include <cstddef>
#include <esokit/core/compiled.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/written_names.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Translates C, in the narrow subset that to_c writes, into functions of Structured Text (IEC
/// 61131-3, second edition: no methods, no pointers). The subset: declaration, assignment, if,
/// else, for, while, return, call. A pointer becomes VAR_IN_OUT, a count of any width UDINT, a
/// table a part of the state; what C evaluates only behind a condition gets statements of its own.
/// What is no part of the subset ends it: see `error`.
class StTranslator {
 public:
  /// What could not be translated; empty: nothing.
  std::string error{};

  /// @param text header and source, one after the other @param name before each function and type
  StTranslator(const std::string& text, std::string name);

  [[nodiscard]] bool has(const std::string& name) const { return functions_.count(name) != 0; }

  /// Whatever `body` calls is written, with all that these call.
  void write_for(const std::string& body);
  /// The types, then the functions that are needed.
  [[nodiscard]] std::string text();
  /// A function that gives the settings of the C to a variable. @param as behind its name
  [[nodiscard]] std::string settings(const std::string& as) const;

  /// Words of Structured Text may not be names. @param word in any case
  [[nodiscard]] static bool is_taken(const std::string& word) {
    return is_word_of_structured_text(word);
  }
  /// A number of C.
  [[nodiscard]] static std::string number(std::string text);

 private:
  struct Token {
    std::string text{};
    std::string before{};  ///< comments, in the language
    std::string behind{};  ///< on its line
  };
  struct Variable {
    std::string name;
    std::string type;
    std::vector<int> sizes{};  ///< of an array
    bool by_reference = false;
    bool is_constant = false;
    std::string initial{};
    std::string comment{};
  };
  struct Function {
    std::string name{};
    std::string type{};
    std::vector<Variable> parameters{};
    std::string text{};
    std::set<std::string> calls{};
    bool is_needed = false;
  };
  struct Value {
    std::string text{};
    std::string type{};
    bool lazy = false;          ///< only where C evaluates it: a change, a place, a difference
    bool simple = false;        ///< needs no parentheses
    bool by_reference = false;  ///< of a function with VAR_IN_OUT
    std::vector<int> sizes{};
  };
  using Lines = std::vector<std::pair<int, std::string>>;  ///< with their depth

  // ---- Tokens.

  void split(const std::string& text);
  static std::size_t length_at(const std::string& text, std::size_t i);
  /// `#define NAME_FLAG 1u`, whose name is said, or a constant.
  void define(const std::string& line);
  [[nodiscard]] const std::string& peek(std::size_t ahead = 0) const {
    return tokens_[(std::min)(at_ + ahead, tokens_.size() - 1)].text;
  }
  std::string next();
  bool take(const std::string& token);
  void expect(const std::string& token) {
    if (!take(token)) fail("'" + token + "' expected, not '" + peek() + "'");
  }
  void skip_to(const std::string& token);
  void fail(const std::string& what);

  // ---- Types and names.

  [[nodiscard]] static std::string name_of(const std::string& word) {
    return is_taken(word) ? "the_" + word : word;
  }
  [[nodiscard]] std::string of_this(const std::string& word) const {
    return word.compare(0, name_.size() + 1, name_ + "_") == 0 ? word : name_ + "_" + word;
  }
  /// Its name in Structured Text, or nothing.
  [[nodiscard]] std::string type(const std::string& word) const;
  [[nodiscard]] std::string array_name(int size) const {
    return name_ + "_numbers_" + std::to_string(size);
  }
  std::string declared(const Variable& variable);
  /// `const double *name[2]`
  Variable declarator();

  // ---- The file: types, tables, functions.

  void item();
  void structure();
  /// A table lies in the state, where a function has none in itself; settings get a function.
  void table(Variable one);
  void take_settings(const Variable& set, const std::vector<std::string>& numbers);
  void function(const std::string& of_c, const Variable& head, const std::string& comment);
  /// Of the function at hand.
  std::string whole_text();
  void need(const std::string& word);
  void add_local(const std::string& name, const std::string& its_type);
  std::string temporary(const std::string& its_type);

  // ---- Statements.

  void line(const std::string& text) { lines_.emplace_back(depth_, text); }

  /// `{ .. }`, of which the first is taken already.
  void block();
  void body();
  void statement();
  void assign(const std::string& left, const std::string& its_type, const Value& value);
  void ignore(const Value& value);
  void declaration();
  /// One behind ELSE that needs a statement before it stands inside.
  void condition(bool is_else = false);
  void loop();

  // ---- Expressions, by precedence. `target`: where the value may be put by statements before.

  Value expression(const std::string& target = "");
  /// What is parsed, and the statements that it needs before it.
  template <class Parse>
  std::pair<Value, Lines> apart(const Parse& parse);
  void put(const Lines& before, const std::string& name, const Value& value);
  Value binary(std::size_t level, const std::string& target = "");
  /// C evaluates the right side only where the left one does not decide.
  Value joined(const Value& left, const std::string& word, const std::string& target,
               std::size_t level);
  Value unary();
  Value postfix();
  Value primary();
  /// In the brackets of another call. A call with VAR_IN_OUT stands before it: not each compiler
  /// takes it inside.
  std::string argument(const Value& value);
  Value call(const std::string& word);

  // ---- What the language lacks.

  /// To the nearest whole number, a half away from zero, or up: not a function of each PLC.
  /// @return its name
  std::string rounding(const std::string& stem);
  /// An LREAL beyond what a REAL holds, which not each compiler takes: times a power of 2^126.
  static std::string scaled(double value);
  /// Without parentheses around all of it.
  static std::string bare(const Value& value);

  std::string name_;
  std::string real_{};
  std::vector<Token> tokens_{};
  std::size_t at_ = 0;
  std::map<std::string, std::string> flags_{};      ///< with the name of the design
  std::map<std::string, std::string> constants_{};  ///< others
  std::map<std::string, std::vector<Variable>> structs_{};
  std::vector<std::string> order_of_structs_{};
  std::map<std::string, Function> functions_{};  ///< by their names in C
  std::vector<std::string> order_{};
  std::set<std::string> tables_{};  ///< in the state
  std::string set_{};               ///< the name of the settings
  std::string settings_{};          ///< the statements that give them
  std::set<int> arrays_{};          ///< sizes of arrays of numbers

  // Of the function at hand.
  Function function_{};
  Lines lines_{};
  std::vector<Variable> locals_{};
  int depth_ = 0;
  int temporaries_ = 0;
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/st_translator.ipp>
#endif
