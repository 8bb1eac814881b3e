#pragma once

#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/st_translator.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

namespace esokit::detail {

/// Reads the C, token by token, and gives the functions to `to`.
class StParser {
 public:
  explicit StParser(StTranslator& to) : to_(to), state_(to.name_ + "_state") {}

  void read(const std::string& text) {
    split(text);
    tokens_.resize(tokens_.size() + 3);  // at_ never goes beyond the first
    while (at_ + 3 < tokens_.size()) item();
    std::string structs;
    for (const std::string& each : order_of_structs_) {
      structs += "TYPE " + each + " :\n  STRUCT\n";
      for (const Variable& field : structs_[each]) structs += "    " + declared(field) + "\n";
      structs += "  END_STRUCT;\nEND_TYPE\n\n";
    }
    for (const int size : arrays_) {
      to_.types_ += "TYPE " + to_.name_ + "_numbers_" + std::to_string(size) + " : ARRAY[0.." +
                    std::to_string(size - 1) + "] OF " + real_ + "; END_TYPE\n\n";
    }
    to_.types_ += structs;
  }

 private:
  using Variable = StTranslator::Variable;
  /// A word or mark, and the comments before it and behind it on its line.
  struct Token {
    std::string text{}, before{}, behind{};
  };
  struct Value {
    std::string text{}, type{};
    bool lazy = false;          ///< only where C evaluates it: a change, a place, a difference
    bool is_one = true;         ///< needs no brackets
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
        std::string token = text.substr(i, end - i);
        if (const auto flag = flags_.find(token); flag != flags_.end()) token = flag->second;
        if (const auto found = constants_.find(token); found != constants_.end()) {
          split(found->second);
        } else {
          tokens_.push_back({token, before});
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
    const std::string value = line.substr(at + 1, line.find(' ', at + 1) - at - 1);
    if (name.compare(0, prefix.size(), prefix) == 0) {
      flags_[name] = StTranslator::number(value) + " (* " + name.substr(prefix.size()) + " *)";
    } else {
      constants_[name] = value;
    }
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
    return structs_.count(of_this(word)) != 0 ? of_this(word) : "";
  }
  /// `const double *name[2]`
  Variable declarator() {
    Variable one;
    one.is_constant = take("const");
    one.type = type(peek());
    if (one.type.empty()) fail("'" + peek() + "' is no type");
    (void)next();
    if (real_.empty() && one.type.find("REAL") != std::string::npos) real_ = one.type;
    one.by_reference = take("*");
    one.name = next();
    for (; take("["); expect("]")) one.sizes.push_back(std::atoi(next().c_str()));
    return one;
  }
  /// Words of Structured Text may not be names.
  static std::string name_of(const std::string& word) {
    return is_word_of_structured_text(word) ? "the_" + word : word;
  }
  std::string declared(const Variable& one) {
    std::string text = one.type;
    if (one.sizes.size() == 1 && one.initial.empty() && text == real_) {
      arrays_.insert(one.sizes[0]);
      text = to_.name_ + "_numbers_" + std::to_string(one.sizes[0]);
    } else if (!one.sizes.empty()) {
      const auto range = [](int size) { return "0.." + std::to_string(size - 1); };
      text = "ARRAY[" + listed(one.sizes, range) + "] OF " + text;
    }
    if (!one.initial.empty()) text += " := [" + one.initial + "]";
    return name_of(one.name) + " : " + text + ";" + (one.comment.empty() ? "" : " " + one.comment);
  }
  static const Variable* found(const std::vector<Variable>& all, const std::string& name) {
    for (const Variable& one : all) {
      if (one.name == name) return &one;
    }
    return nullptr;
  }

  // ---- The file: types, tables, functions.

  void item() {
    const std::string comment = tokens_[at_].before;
    function_ = {};
    locals_.clear();
    if (take("extern")) return skip_behind(";");
    if (take("typedef")) return structure();
    (void)take("static");
    const Variable head = declarator();
    if (peek() == "=") return table(head);
    function_.name = of_this(head.name);
    function_.type = head.type;
    function(comment);
  }

  void structure() {
    expect("struct");
    expect("{");
    std::vector<Variable> fields;
    while (to_.error.empty() && !take("}")) {
      fields.push_back(declarator());
      expect(";");
      fields.back().comment = tokens_[at_ - 1].behind;
    }
    order_of_structs_.push_back(of_this(next()));
    structs_[order_of_structs_.back()] = fields;
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
    if (structs_.count(one.type) != 0) return settings(one, numbers);
    one.initial = listed(numbers, [](const std::string& each) { return each; });
    const bool is_local = !function_.name.empty() && (locals_.empty() || locals_[0].type != state_);
    (is_local ? locals_ : structs_[state_]).push_back(one);
  }

  void settings(const Variable& set, const std::vector<std::string>& numbers) {
    std::size_t next = 0;
    for (const Variable& field : structs_[set.type]) {
      const int columns = field.sizes.empty() ? 1 : field.sizes.back();
      const int rows = field.sizes.size() > 1 ? field.sizes[0] : 1;
      for (int i = 0; i < rows * columns && next < numbers.size(); ++i) {
        const std::string row = field.sizes.size() > 1 ? std::to_string(i / columns) + ", " : "";
        const std::string place = "[" + row + std::to_string(i % columns) + "]";
        to_.settings_ += "  settings." + name_of(field.name) + (field.sizes.empty() ? "" : place) +
                         " := " + numbers[next++] + ";\n";
      }
    }
    set_ = set.name;
    to_.functions_.push_back({to_.name_ + "_set_first", "", to_.settings("first")});
  }

  void function(const std::string& comment) {
    expect("(");
    while (to_.error.empty() && !take(")")) {
      Variable one = declarator();
      // Another struct that is read is given by its value.
      const bool whole = one.by_reference && one.is_constant && one.type != state_;
      one.by_reference = (one.by_reference && !whole) || !one.sizes.empty();
      locals_.push_back(one);
      (void)take(",");
    }
    if (take(";")) return;
    function_.parameters = locals_;
    expect("{");
    lines_.clear();
    temporaries_ = 0;
    if (function_.name == of_this("is_finite")) {
      // By its value: the largest LREAL is no number to each compiler.
      line(function_.name + " := (ABS(x) * 0.5 < ABS(x)) OR (x = 0.0);");
      skip_behind("}");
    } else {
      block();
    }
    function_.text = comment + (comment.empty() ? "" : "\n") + whole_text();
    if (to_.has(function_.name)) fail("a second one");
    to_.functions_.push_back(function_);
  }

  /// Of the function at hand.
  std::string whole_text() {
    if (!lines_.empty() && lines_.back() == "  RETURN;") lines_.pop_back();
    std::string parts[3], text = "FUNCTION " + function_.name + " : " + function_.type + "\n";
    for (std::size_t i = 0; i < locals_.size(); ++i) {
      parts[i >= function_.parameters.size() ? 2
            : locals_[i].by_reference        ? 0
                                             : 1] += "  " + declared(locals_[i]) + "\n";
    }
    static const char* const begins[] = {"VAR_IN_OUT\n", "VAR_INPUT\n", "VAR\n"};
    for (std::size_t i = 0; i < 3; ++i) {
      if (!parts[i].empty()) text += begins[i] + parts[i] + "END_VAR\n";
    }
    for (const std::string& each : lines_) text += each + "\n";
    return text + "END_FUNCTION\n\n";
  }

  void add_local(const Variable& one) {
    const Variable* other = found(locals_, one.name);
    if (other == nullptr) return locals_.push_back(one);
    if (other->type != one.type || other->sizes != one.sizes) fail("two " + one.name);
  }

  // ---- Statements.

  void line(const std::string& text) { lines_.push_back(indent_ + text); }

  /// `{ .. }`, of which the first is taken already.
  void block() {
    const auto comment = [this] {  // behind the last line
      const std::string& behind = tokens_[at_ - 1].behind;
      if (!behind.empty() && !lines_.empty()) lines_.back() += " " + behind;
    };
    comment();
    while (to_.error.empty() && !take("}")) {
      if (!tokens_[at_].before.empty()) line(tokens_[at_].before);
      statement();
      comment();
    }
  }
  /// @param last a statement behind the others
  void body(const std::string& last = "") {
    expect("{");
    indent_ += "  ";
    block();
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
      if (take("(")) skip_behind(")");  // void
      if (peek() == "memset") return clear();
      (void)take("*");
      const Value left = postfix();
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

  /// memset of the state: as the variables of a function begin.
  void clear() {
    add_local({"nothing", state_});
    line("o := nothing;");
    skip_behind(";");
  }

  void declaration() {
    const bool is_table = take("static");
    const Variable one = declarator();
    if (one.by_reference) fail("a pointer " + one.name);
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
    const std::string holds = begin == "IF " ? expression().text : alone();
    expect(")");
    line(begin + holds + " THEN");
    body();
    if (take("else")) {
      if (take("if")) return condition("ELSIF ");
      line("ELSE");
      const std::size_t empty = lines_.size();
      body();
      if (lines_.size() == empty) lines_.pop_back();
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
    body(step);
    line("END_WHILE;");
  }

  // ---- Expressions.

  Value expression() {
    const Value condition = binary(0);
    if (!take("?")) return condition;
    const Value yes = expression();
    expect(":");
    const Value no = expression();
    if (yes.type != no.type || yes.lazy || no.lazy) fail("'" + yes.text + "' or '" + no.text + "'");
    const std::string choice = no.text + ", " + yes.text;
    return {"SEL(" + argument(condition) + ", " + choice + ")", yes.type, condition.lazy};
  }

  Value binary(int least) {
    // Levels: the higher, the nearer the operands; 0, 1: of conditions; 2, 3: of bits. Last: of
    // which type alone.
    using Operator = std::tuple<int, const char*, const char*>;
    static const std::map<std::string, Operator> operators{
        {"||", {0, "OR", "BOOL"}},  {"&&", {1, "AND", "BOOL"}}, {"|", {2, "OR", "UDINT"}},
        {"&", {3, "AND", "UDINT"}}, {"==", {4, "=", ""}},       {"!=", {4, "<>", ""}},
        {"<", {5, "<", ""}},        {">", {5, ">", ""}},        {"<=", {5, "<=", ""}},
        {">=", {5, ">=", ""}},      {"+", {6, "+", ""}},        {"-", {6, "-", ""}},
        {"*", {7, "*", ""}},        {"/", {7, "/", ""}},        {"%", {7, "MOD", "UDINT"}}};
    Value left = unary();
    for (auto one = operators.find(peek());
         one != operators.end() && std::get<0>(one->second) >= least;
         one = operators.find(peek())) {
      const auto& [level, word, only] = one->second;
      const bool is_difference = next() == "-" && left.type == "UDINT";
      const Value right = binary(level + 1);
      if (left.type != right.type || (*only != '\0' && left.type != only) ||
          (level < 2 && right.lazy)) {
        fail("'" + left.text + " " + word + " " + right.text + "' of " + left.type);
      }
      const bool is_lazy = left.lazy || right.lazy || is_difference, of_bits = level / 2 == 1;
      left.text = of_bits ? "DWORD_TO_UDINT(UDINT_TO_DWORD(" + argument(left) + ") " + word +
                                " UDINT_TO_DWORD(" + argument(right) + "))"
                          : left.operand() + " " + word + " " + right.operand();
      left = {left.text, level < 6 && !of_bits ? "BOOL" : left.type, is_lazy, of_bits};
    }
    return left;
  }

  Value unary() {
    const bool negates = peek() == "!";
    if (negates || peek() == "-") {
      (void)next();
      Value of = unary();
      if ((of.type == "BOOL") != negates || of.type == "UDINT") fail("a sign of '" + of.text + "'");
      return {(negates ? "NOT " : "-") + of.operand(), of.type, of.lazy, false, of.by_reference};
    }
    if (take("&") || take("*")) return postfix();
    if (peek() == "(" && !type(peek(1)).empty() && peek(2) == ")") {
      const std::string to = type(peek(1));
      at_ += 3;
      const Value of = unary();
      if (of.type == to) return of;
      return {of.type + "_TO_" + to + "(" + argument(of) + ")", to, of.lazy};
    }
    return postfix();
  }

  Value postfix() {
    Value value = primary();
    while (to_.error.empty()) {
      if (take("->") || take(".")) {
        const Variable* one = found(structs_[value.type], peek());
        if (one == nullptr) return fail("no '" + peek() + "' in '" + value.text + "'"), value;
        (void)next();
        value = {value.text + "." + name_of(one->name), one->type, value.lazy};
      } else if (take("[")) {
        const bool goes_on = value.text.back() == ']';
        value.text =
            goes_on ? value.text.substr(0, value.text.size() - 1) + ", " : value.text + "[";
        value = {value.text + expression().text + "]", value.type, true};
        expect("]");
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
      expect(")");
      inner.brackets = inner.brackets || !inner.is_one;
      return inner;
    }
    if (word == "true" || word == "false") return {word == "true" ? "TRUE" : "FALSE", "BOOL"};
    if (is_digit(word[0])) {
      if (word.find('.') == std::string::npos) return {StTranslator::number(word), "UDINT"};
      if (word.back() == 'f') return {StTranslator::number(word), "REAL"};
      return scaled(std::strtod(word.c_str(), nullptr));
    }
    if (take("(")) return call(word);
    if (word == set_) return {set_, to_.name_ + "_settings"};
    if (const Variable* one = found(locals_, word)) return {name_of(word), one->type};
    const Variable* one = found(structs_[state_], word);
    if (one != nullptr && !one->initial.empty()) return {"o." + name_of(word), one->type};
    fail("'" + word + "' is not known");
    return {};
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
    const bool is_own = to_.has(name);
    if (!is_own && of_c == known.end()) return fail("'" + word + "' is not known"), Value{};
    const StTranslator::Function library{"", real_, "", {{"", real_}, {"", real_}}};
    const StTranslator::Function& function = is_own ? *to_.found(name) : library;
    Value value{"", function.type};
    std::size_t i = 0;
    for (; !take(")") && i < function.parameters.size(); ++i) {
      const Variable& one = function.parameters[i];
      const Value given = expression();
      if (one.type != given.type) fail("another type of " + one.name + " of " + word);
      value.text += (i > 0 ? ", " : "") + (is_own ? name_of(one.name) + " := " : "");
      value.text += argument(given);
      value.lazy = value.lazy || given.lazy || (one.by_reference && !one.is_constant);
      value.by_reference = value.by_reference || one.by_reference;
      (void)take(",");
    }
    if (!is_own) return {filled(of_c->second, {{"$x", value.text}}), real_, value.lazy};
    if (i != function.parameters.size() || tokens_[at_ - 1].text != ")") fail("a call of " + word);
    value.text = name + "(" + value.text + ")";
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
    to_.functions_.push_back({name, real_, text, {{"x", real_}}});
    return name;
  }
  /// An LREAL beyond what a REAL holds, which not each compiler takes: times a power of 2^126.
  static Value scaled(double value) {
    const bool up = (std::abs)(value) > 1;
    std::string by;
    for (; (std::abs)(value) > 1e37 || (value != 0 && (std::abs)(value) < 1e-37);
         value *= up ? 0x1p-126 : 0x1p126) {
      by += up ? " * 8.507059173023462E+37" : " * 1.1754943508222875E-38";
    }
    const std::string text = StTranslator::number(ListWriter(c_language, false).number(value)) + by;
    return {text, "LREAL", false, true, false, !by.empty()};
  }

  StTranslator& to_;
  std::string state_;  ///< the name of its type
  std::string real_{};
  std::vector<Token> tokens_{};
  std::size_t at_ = 0;
  std::map<std::string, std::string> flags_{};      ///< with the name of the design
  std::map<std::string, std::string> constants_{};  ///< others
  std::map<std::string, std::vector<Variable>> structs_{};
  std::vector<std::string> order_of_structs_{};
  std::set<int> arrays_{};  ///< sizes of arrays of numbers
  std::string set_{};       ///< the name of the settings

  // Of the function at hand.
  StTranslator::Function function_{};
  std::vector<Variable> locals_{};  ///< parameters first
  std::vector<std::string> lines_{};
  std::string indent_ = "  ";
  int temporaries_ = 0;
};

ESOKIT_FUNCTION StTranslator::StTranslator(const std::string& text, const std::string& name)
    : name_(name) {
  StParser(*this).read(text);
}

ESOKIT_FUNCTION void StTranslator::write_for(const std::string& body) {
  for (Function& one : functions_) {
    if (one.is_needed || body.find(one.name + "(") == std::string::npos) continue;
    one.is_needed = true;
    write_for(one.text);
  }
}

ESOKIT_FUNCTION std::string StTranslator::text() const {
  std::string all = types_;
  for (const Function& one : functions_) all += one.is_needed ? one.text : "";
  return all;
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
