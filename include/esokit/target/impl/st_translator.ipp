#pragma once

#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <deque>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/st_translator.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <map>
#include <string>
#include <vector>

namespace esokit::detail {

/// Reads the C, token by token, and gives the functions to `to`.
class StParser {
 public:
  explicit StParser(StTranslator& to) : to_(to), state_(to.name_ + "_state") {}

  void read(const std::string& text) {
    split(text);
    tokens_.resize(tokens_.size() + 3);  // at_ never goes beyond the first
    while (at_ + 3 < tokens_.size()) {
      function_ = {};
      declaration();
    }
    std::string structs;
    for (const Function& each : structs_) {
      structs += "TYPE " + each.name + " :\n  STRUCT\n";
      for (const Variable& field : each.variables) structs += "    " + declared(field) + "\n";
      structs += "  END_STRUCT;\nEND_TYPE\n\n";
    }
    for (const auto& [size, type] : arrays_) to_.types_ += type;
    to_.types_ += structs;
  }

 private:
  using Variable = StTranslator::Variable;
  using Function = StTranslator::Function;
  /// A word or mark, and the comments before it and behind it on its line.
  struct Token {
    std::string text{}, before{}, behind{};
  };
  struct Value {
    std::string text{}, type{};
    bool lazy = false;          ///< only where C evaluates it: a change, a place, a difference
    bool has_sign = false;      ///< of an operator
    bool by_reference = false;  ///< of a function with VAR_IN_OUT
    bool brackets = false;      ///< around it, where it is an operand
    [[nodiscard]] std::string operand() const { return brackets ? "(" + text + ")" : text; }
  };

  // ---- Tokens.

  static bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

  void split(const std::string& text) {
    std::string before;
    bool same_line = false;
    for (std::size_t i = 0, end = 0; i < text.size(); i = end) {
      end = i + 1;
      if (text[i] == '\n') same_line = false;
      if (text[i] == '#') {  // what only another compiler or the self-test reads is skipped
        end = text.find('\n', i);
        if (text.compare(i, 8, "#define ") == 0) define(text.substr(i + 8, end - i - 8));
        if (text.compare(i, 7, "#ifdef ") == 0) end = text.find("\n#endif", i) + 7;
      } else if (text.compare(i, 2, "/*") == 0) {
        end = text.find("*/", i) + 2;
        const std::string comment = filled(text.substr(i + 2, end - i - 4), {{"\n * ", "\n   "}});
        (same_line ? tokens_.back().behind : before) += "(*" + comment + "*)";
      } else if (std::isspace(static_cast<unsigned char>(text[i])) == 0) {
        end = i + length_at(text, i);
        const std::string word = text.substr(i, end - i);
        const auto constant = constants_.find(word);
        const std::string token = constant == constants_.end() ? word : constant->second;
        if (token == word || token.find(' ') != std::string::npos) {
          tokens_.push_back({token, before});
        } else {
          split(token);
        }
        before.clear();
        same_line = true;
      }
    }
  }

  static std::size_t length_at(const std::string& text, std::size_t i) {
    std::size_t n = 0;
    for (char c = text[i];
         std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' ||
         (is_digit(text[i]) && (c == '.' || ((c == '-' || c == '+') && text[i + n - 1] == 'e')));) {
      c = text[i + ++n];
    }
    static const std::string pairs = " -> || && == != <= >= ++ -- ";
    return n > 0 ? n : pairs.find(" " + text.substr(i, 2) + " ") != std::string::npos ? 2 : 1;
  }

  /// `NAME_FLAG 1u`, whose name is said, or a constant.
  void define(const std::string& line) {
    const std::size_t at = line.find(' ');
    if (at == std::string::npos) return;
    const std::string name = line.substr(0, at), prefix = begin_of_constants(to_.name_) + "_";
    std::string value = line.substr(at + 1, line.find(' ', at + 1) - at - 1);
    if (name.compare(0, prefix.size(), prefix) == 0) {
      value = StTranslator::number(value) + " (* " + name.substr(prefix.size()) + " *)";
    }
    constants_[name] = value;
  }

  [[nodiscard]] const std::string& peek(int ahead = 0) const {
    return tokens_[at_ + static_cast<std::size_t>(ahead)].text;
  }
  const std::string& next() { return tokens_[at_ + 3 < tokens_.size() ? at_++ : at_].text; }
  bool take(const std::string& token) { return peek() == token && !next().empty(); }
  void expect(const std::string& token) {
    if (!take(token)) fail("'" + token + "' expected, not '" + peek() + "'");
  }
  void skip_behind(const std::string& token) {
    while (!take(token)) {
      if (next().empty()) return fail("no '" + token + "'");
    }
  }
  void fail(const std::string& what) {
    if (to_.error.empty()) to_.error = what + " in '" + function_.name + "'";
    at_ = tokens_.size() - 3;
  }

  // ---- Types and names.

  [[nodiscard]] std::string of_this(const std::string& word) const {
    return word.compare(0, to_.name_.size() + 1, to_.name_ + "_") == 0 ? word
                                                                       : to_.name_ + "_" + word;
  }
  /// Its name in Structured Text, or nothing.
  [[nodiscard]] std::string type(const std::string& word) const {
    static const std::string counts = " unsigned int uint8_t uint16_t uint32_t int32_t ";
    if (word == "bool" || word == "void") return "BOOL";
    if (word == "double" || word == "float") return word == "float" ? "REAL" : "LREAL";
    if (counts.find(" " + word + " ") != std::string::npos) return "UDINT";
    return found(structs_, of_this(word)) != nullptr ? of_this(word) : "";
  }
  /// `const double *name[2]`
  Variable declarator() {
    Variable one;
    one.is_constant = take("const");
    one.type = type(peek());
    if (one.type.empty()) fail("'" + peek() + "' is no type");
    (void)next();
    if (real_.empty() && one.type.find("REAL") != std::string::npos) real_ = one.type;
    if (take("*")) one.part = "VAR_IN_OUT";
    one.name = next();
    for (; take("["); expect("]")) one.sizes.push_back(std::atoi(next().c_str()));
    return one;
  }
  /// Words of Structured Text may not be names.
  static std::string name_of(const std::string& word) {
    return is_word_of_structured_text(word) ? "the_" + word : word;
  }
  std::string declared(const Variable& one) {
    const auto range = [](int size) { return "0.." + std::to_string(size - 1); };
    std::string text = one.type;
    if (!one.sizes.empty()) text = "ARRAY[" + listed(one.sizes, range) + "] OF " + text;
    if (!one.initial.empty()) {
      text += " := [" + one.initial + "]";
    } else if (one.sizes.size() == 1 && one.type == real_) {
      const std::string name = to_.name_ + "_numbers_" + std::to_string(one.sizes[0]);
      arrays_[one.sizes[0]] = "TYPE " + name + " : " + text + "; END_TYPE\n\n";
      text = name;
    }
    return name_of(one.name) + " : " + text + ";" + (one.comment.empty() ? "" : " " + one.comment);
  }

  // ---- The file: types, tables, functions.

  void structure() {
    Function one;
    skip_behind("{");
    while (to_.error.empty() && !take("}")) {
      one.variables.push_back(declarator());
      expect(";");
      one.variables.back().comment = tokens_[at_ - 1].behind;
    }
    one.name = of_this(next());
    structs_.push_back(one);
    expect(";");
  }

  /// A table lies in the state, where a function has none in itself; settings get a function.
  void table(Variable one) {
    std::vector<std::string> numbers;
    for (; !peek().empty() && peek() != ";"; (void)next()) {
      if (!is_digit(peek()[0])) continue;
      numbers.push_back((tokens_[at_ - 1].text == "-" ? "-" : "") + StTranslator::number(peek()));
    }
    expect(";");
    const Function* type = found(structs_, one.type);
    if (type != nullptr && numbers.empty()) return;  // extern
    if (type != nullptr) return settings(*type, one.name, numbers);
    one.initial = listed(numbers, [](const std::string& each) { return each; });
    const auto& first = function_.variables;
    Function* state = first.empty() || first[0].type == state_ ? found(structs_, state_) : nullptr;
    (state == nullptr ? function_ : *state).variables.push_back(one);
  }

  void settings(const Function& type, const std::string& name,
                const std::vector<std::string>& numbers) {
    std::size_t next = 0;
    for (const Variable& field : type.variables) {
      const int columns = field.sizes.empty() ? 1 : field.sizes.back();
      const int rows = field.sizes.size() > 1 ? field.sizes[0] : 1;
      for (int i = 0; i < rows * columns && next < numbers.size(); ++i) {
        const std::string row = field.sizes.size() > 1 ? std::to_string(i / columns) + ", " : "";
        const std::string place = "[" + row + std::to_string(i % columns) + "]";
        to_.settings_ += "  settings." + name_of(field.name) + (field.sizes.empty() ? "" : place) +
                         " := " + numbers[next++] + ";\n";
      }
    }
    set_ = name;
    to_.functions_.push_back({to_.name_ + "_set_first", "", to_.settings("first")});
  }

  void function(const Variable& head, const std::string& comment) {
    function_.name = of_this(head.name);
    function_.type = head.type;
    for (; to_.error.empty() && !take(")"); ++function_.parameters) {
      Variable one = declarator();
      // Another struct that is read is given by its value.
      const bool is_whole = one.part == "VAR" || (one.is_constant && one.type != state_);
      one.part = is_whole && one.sizes.empty() ? "VAR_INPUT" : "VAR_IN_OUT";
      function_.variables.push_back(one);
      (void)take(",");
    }
    if (take(";")) return;
    lines_.clear();
    temporaries_ = 0;
    if (function_.name == of_this("is_finite")) {
      // By its value: the largest LREAL is no number to each compiler.
      lines_ = {"  " + function_.name + " := (ABS(x) * 0.5 < ABS(x)) OR (x = 0.0);"};
      skip_behind("}");
    } else {
      block();
    }
    if (!lines_.empty() && lines_.back() == "  RETURN;") lines_.pop_back();
    std::string text = comment + (comment.empty() ? "" : "\n");
    text += "FUNCTION " + function_.name + " : " + function_.type + "\n";
    for (const std::string part : {"VAR_IN_OUT", "VAR_INPUT", "VAR"}) {
      std::string inside;
      for (const Variable& one : function_.variables) {
        if (one.part == part) inside += "  " + declared(one) + "\n";
      }
      if (!inside.empty()) text += part + "\n" + inside + "END_VAR\n";
    }
    for (const std::string& each : lines_) text += each + "\n";
    function_.text = text + "END_FUNCTION\n\n";
    to_.functions_.push_back(function_);
  }

  void add_local(const Variable& one) {
    const Variable* other = found(function_.variables, one.name);
    if (other == nullptr) return function_.variables.push_back(one);
    if (other->type != one.type || other->sizes != one.sizes) fail("two " + one.name);
  }

  // ---- Statements.

  void line(const std::string& text) { lines_.push_back(indent_ + text); }

  /// `{ .. }` @param last a statement behind the others
  void block(const std::string& last = "") {
    expect("{");
    indent_ += "  ";
    while (to_.error.empty()) {
      const std::string& behind = tokens_[at_ - 1].behind;  // the last line
      if (!behind.empty() && !lines_.empty()) lines_.back() += " " + behind;
      if (take("}")) break;
      if (!tokens_[at_].before.empty()) line(tokens_[at_].before);
      statement();
    }
    if (!last.empty()) line(last);
    indent_.resize(indent_.size() - 2);
  }

  void statement() {
    if (take("if")) return condition("IF ");
    if (peek() == "while" || peek() == "for") return loop();
    if (peek() == "static" || peek() == "const" || !type(peek()).empty()) return declaration();
    if (take("return")) {
      if (peek() != ";") assign({function_.name, function_.type}, expression());
      line("RETURN;");
    } else {
      const Value left = unary();
      if (take("=")) {
        assign(left, expression());
      } else {
        ignore(left);
      }
    }
    expect(";");
  }

  void assign(const Value& left, const Value& value) {
    if (value.type != left.type) fail(left.text + " is a " + left.type + ", not " + value.type);
    if (value.text == set_ && !set_.empty()) {
      ignore({to_.name_ + "_set_first(settings := " + left.text + ")", "BOOL"});
    } else if (value.text != left.text) {
      line(left.text + " := " + value.text + ";");
    }
  }

  /// Of a call, which Structured Text has in assignments only.
  void ignore(const Value& value) {
    if (value.text.find('(') == std::string::npos) return;
    const std::string name = value.type == "BOOL"    ? "done"
                             : value.type == "UDINT" ? "flags"
                                                     : "unread";
    add_local({name, value.type});
    line(name + " := " + value.text + ";");
  }

  /// Of a type, a table, a function or a local variable.
  void declaration() {
    const std::string comment = tokens_[at_].before;
    if (take("typedef")) return structure();
    const bool is_table = take("static") || take("extern") || function_.name.empty();
    const Variable one = declarator();
    if (take("(")) return function(one, comment);
    if (one.part != "VAR") fail("a pointer " + one.name);
    if (is_table) return table(one);
    add_local(one);
    if (take("=")) assign({name_of(one.name), one.type}, expression());
    expect(";");
  }

  /// A condition in front of which no statement can stand.
  std::string alone() {
    const std::size_t before = lines_.size();
    const Value value = expression();
    if (lines_.size() != before) fail("'" + value.text + "' needs a statement before it");
    return value.text;
  }

  void condition(const std::string& begin) {
    expect("(");
    line(begin + (begin == "IF " ? expression().text : alone()) + " THEN");
    expect(")");
    block();
    if (take("else")) {
      if (take("if")) return condition("ELSIF ");
      line("ELSE");
      block();
      if (lines_.back() == indent_ + "ELSE") lines_.pop_back();
    }
    line("END_IF;");
  }

  void loop() {
    const bool counts = next() == "for";
    std::string step;
    expect("(");
    if (counts) statement();
    line("WHILE " + alone() + " DO");
    if (counts) {
      expect(";");
      step = peek();
      if (!take("++")) expect("--");
      const std::string i = postfix().text;
      step = i + " := " + i + " " + step[0] + " 1;";
    }
    expect(")");
    block(step);
    line("END_WHILE;");
  }

  // ---- Expressions.

  Value expression() {
    const Value condition = binary();
    if (!take("?")) return condition;
    const Value yes = expression();
    expect(":");
    const Value no = expression();
    if (yes.type != no.type || yes.lazy || no.lazy) fail("'" + yes.text + "' or '" + no.text + "'");
    const std::string choice = no.text + ", " + yes.text;
    return {"SEL(" + argument(condition) + ", " + choice + ")", yes.type, condition.lazy};
  }

  /// Operands of one operator: where two meet the C has brackets.
  Value binary() {
    static const std::map<std::string, std::string> words{
        {"||", "OR"}, {"&&", "AND"}, {"|", "OR"}, {"&", "AND"}, {"==", "="},
        {"!=", "<>"}, {"<", "<"},    {">", ">"},  {"<=", "<="}, {">=", ">="},
        {"+", "+"},   {"-", "-"},    {"*", "*"},  {"/", "/"},   {"%", "MOD"}};
    Value left = unary();
    const std::string sign = peek();
    const auto known = words.find(sign);
    while (known != words.end() && take(sign)) {
      const std::string word = " " + known->second + " ";
      const bool joins = sign == "||" || sign == "&&", of_bits = sign == "|" || sign == "&";
      const std::string of = joins ? "BOOL" : of_bits || sign == "%" ? "UDINT" : left.type;
      const Value right = unary();
      if (left.type != of || right.type != of || (joins && right.lazy)) {
        fail("'" + left.text + word + right.text + "' of " + left.type);
      }
      left.text = of_bits ? "DWORD_TO_UDINT(UDINT_TO_DWORD(" + argument(left) + ")" + word +
                                "UDINT_TO_DWORD(" + argument(right) + "))"
                          : left.operand() + word + right.operand();
      left.lazy = left.lazy || right.lazy || (sign == "-" && of == "UDINT");
      left = {left.text, word.find_first_of("=<>") < word.size() ? "BOOL" : of, left.lazy,
              !of_bits};
    }
    return left;
  }

  Value unary() {
    const bool negates = peek() == "!";
    if (negates || peek() == "-") {
      (void)next();
      Value of = unary();
      if ((of.type == "BOOL") != negates || of.type == "UDINT") fail("a sign of '" + of.text + "'");
      return {(negates ? "NOT " : "-") + of.operand(), of.type, of.lazy, true, of.by_reference};
    }
    if (peek() == "(" && !type(peek(1)).empty() && peek(2) == ")") {
      const std::string word = peek(1), to = type(word);
      at_ += 3;
      const Value of = unary();
      if (of.type == to || word == "void") return of;
      return {of.type + "_TO_" + to + "(" + argument(of) + ")", to, of.lazy};
    }
    (void)(take("&") || take("*"));
    return postfix();
  }

  Value postfix() {
    Value value = primary();
    while (to_.error.empty()) {
      if (take("->") || take(".")) {
        const Function* type = found(structs_, value.type);
        const Variable* one = type == nullptr ? nullptr : found(type->variables, peek());
        if (one == nullptr) return fail("no '" + peek() + "' in '" + value.text + "'"), value;
        (void)next();
        value = {value.text + "." + name_of(one->name), one->type, value.lazy};
      } else if (take("[")) {
        std::string places = expression().text;
        for (expect("]"); take("["); expect("]")) places += ", " + expression().text;
        value = {value.text + "[" + places + "]", value.type, true};
      } else {
        break;
      }
    }
    return value;
  }

  Value primary() {
    const std::string word = next();
    if (word == "(") {
      Value inner = expression();
      inner.brackets = inner.brackets || inner.has_sign;
      return expect(")"), inner;
    }
    if (word == "true" || word == "false") return {word == "true" ? "TRUE" : "FALSE", "BOOL"};
    if (is_digit(word[0])) {
      if (word.find('.') == std::string::npos) return {StTranslator::number(word), "UDINT"};
      if (word.back() == 'f') return {StTranslator::number(word), "REAL"};
      return scaled(std::strtod(word.c_str(), nullptr));
    }
    if (take("(") && word == "memset") {  // of the state: as the variables of a function begin
      add_local({"nothing", state_});
      line("o := nothing;");
      return skip_behind(")"), Value{};
    }
    if (tokens_[at_ - 1].text == "(") return call(word);
    if (word == set_) return {set_, to_.name_ + "_settings"};
    if (const Variable* one = found(function_.variables, word)) return {name_of(word), one->type};
    const Function* state = found(structs_, state_);
    const Variable* one = state == nullptr ? nullptr : found(state->variables, word);
    if (one != nullptr && !one->initial.empty()) return {"o." + name_of(word), one->type};
    return fail("'" + word + "' is not known"), Value{};
  }

  /// In the brackets of another call. A call with VAR_IN_OUT stands before it: not each compiler
  /// takes it inside.
  std::string argument(const Value& value) {
    if (!value.by_reference) return value.text;
    const std::string name = "value" + std::to_string(++temporaries_);
    add_local({name, value.type});
    line(name + " := " + value.text + ";");
    return name;
  }

  Value call(const std::string& word) {
    constexpr const char* tanh = "(1.0 - (2.0 / (EXP(2.0 * $x) + 1.0)))";
    static const std::map<std::string, std::string> known{
        {"fabs", "ABS($x)"},          {"sqrt", "SQRT($x)"}, {"exp", "EXP($x)"},
        {"pow", "EXPT($x)"},          {"sin", "SIN($x)"},   {"cos", "COS($x)"},
        {"tan", "TAN($x)"},           {"atan", "ATAN($x)"}, {"cbrt", "EXPT($x, 1.0 / 3.0)"},
        {"expm1", "(EXP($x) - 1.0)"}, {"tanh", tanh}};
    const std::string stem = word.back() == 'f' ? word.substr(0, word.size() - 1) : word;
    const bool rounds = stem == "round" || stem == "ceil";
    const auto of_c = known.find(stem);
    const std::string name = rounds ? rounding(stem) : of_this(word);
    const Function library{"", real_, "", {{"", real_}, {"", real_}}, 2};
    const Function* own = found(to_.functions_, name);
    if (own == nullptr && of_c == known.end()) return fail("'" + word + "' is not known"), Value{};
    const Function& function = own != nullptr ? *own : library;
    Value value{"", function.type};
    std::size_t i = 0;
    for (; !take(")") && i < function.parameters; ++i) {
      const Variable& one = function.variables[i];
      const bool by_reference = one.part == "VAR_IN_OUT";
      const Value given = expression();
      if (one.type != given.type) fail("another type of " + one.name + " of " + word);
      value.text += (i > 0 ? ", " : "") + (own != nullptr ? name_of(one.name) + " := " : "");
      value.text += argument(given);
      value.lazy = value.lazy || given.lazy || (by_reference && !one.is_constant);
      value.by_reference = value.by_reference || by_reference;
      (void)take(",");
    }
    if (tokens_[at_ - 1].text != ")" || (own != nullptr && i != function.parameters)) {
      fail("a call of " + word);
    }
    value.text = filled(own != nullptr ? name + "($x)" : of_c->second, {{"$x", value.text}});
    return value;
  }

  // ---- What the language lacks.

  /// To the nearest whole number, a half away from zero, or up: not a function of each PLC.
  /// @return its name
  std::string rounding(const std::string& stem) {
    const std::string name = to_.name_ + "_" + stem;
    if (to_.has(name)) return name;
    const std::string text = filled(
        "FUNCTION $f : $REAL\nVAR_INPUT\n  x : $REAL;\nEND_VAR\nVAR\n  size : $REAL;\n"
        "  whole : $REAL;\nEND_VAR\n"
        "  size := ABS(x);\n  IF NOT (size < $W) THEN\n"
        "    $f := x; (* it has no fraction *)\n    RETURN;\n  END_IF;\n"
        "  whole := (size + $W) - $W; (* a half to an even number *)\n"
        "  IF $UP THEN\n    whole := whole + 1.0;\n  END_IF;\n"
        "  $f := SEL(x < 0.0, whole, -whole);\nEND_FUNCTION\n\n",
        {{"$f", name},
         {"$REAL", real_},
         {"$W", real_ == "REAL" ? "8388608.0" : "4503599627370496.0"},
         {"$UP", stem == "ceil" ? "whole < size" : "size - whole >= 0.5"}});
    to_.functions_.push_back({name, real_, text, {{"x", real_}}, 1});
    return name;
  }
  /// An LREAL beyond what a REAL holds, which not each compiler takes: times a power of 2^126.
  static Value scaled(double value) {
    std::string by;
    for (; value > 1e37; value *= 0x1p-126) by += " * 8.507059173023462E+37";
    for (; value > 0 && value < 1e-37; value *= 0x1p126) by += " * 1.1754943508222875E-38";
    const std::string text = StTranslator::number(ListWriter(c_language, false).number(value)) + by;
    return {text, "LREAL", false, false, false, !by.empty()};
  }

  StTranslator& to_;
  std::string state_;  ///< the name of its type
  std::string real_{};
  std::vector<Token> tokens_{};
  std::size_t at_ = 0;
  std::map<std::string, std::string> constants_{};
  std::deque<Function> structs_{};
  std::map<int, std::string> arrays_{};  ///< types of arrays of numbers, by their size
  std::string set_{};                    ///< the name of the settings

  // Of the function at hand.
  Function function_{};
  std::vector<std::string> lines_{};
  std::string indent_{};
  int temporaries_ = 0;
};

ESOKIT_FUNCTION StTranslator::StTranslator(const std::string& text, const std::string& name)
    : name_(name) {
  StParser(*this).read(text);
}

ESOKIT_FUNCTION std::string StTranslator::text_for(const std::string& body) const {
  std::string text = body;
  for (auto one = functions_.rbegin(); one != functions_.rend(); ++one) {
    if (text.find(one->name + "(") != std::string::npos) text = one->text + text;
  }
  return types_ + text;
}

ESOKIT_FUNCTION std::string StTranslator::settings(const std::string& as) const {
  const std::string name = name_ + "_set_" + as;
  return "FUNCTION " + name + " : BOOL\nVAR_IN_OUT\n  settings : " + name_ +
         "_settings;\nEND_VAR\n" + settings_ + "  " + name + " := TRUE;\nEND_FUNCTION\n\n";
}

ESOKIT_FUNCTION std::string StTranslator::number(std::string text) {
  if (text.back() == 'u' || text.back() == 'f') text.pop_back();
  return filled(text, {{"e", "E"}});
}

}  // namespace esokit::detail
