/// @file
/// Expressions of C in Structured Text.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/st_file.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Expressions, with what has to stand before them. See StTranslator.
class StExpressions : public StFile {
 protected:
  using StFile::StFile;

  struct Value {
    std::string text;
    std::string type{};
    bool changes = false;    ///< what it calls changes something
    bool guarded = false;    ///< may be evaluated only where it is chosen: an index, a difference
    bool is_simple = false;  ///< needs no parentheses
    std::vector<int> sizes{};
    bool by_reference = false;  ///< of a function with VAR_IN_OUT
  };

  void line(const std::string& text) {
    if (!comment_.empty()) {
      std::string comment;
      comment.swap(comment_);
      lines_.push_back({depth_, comment});
    }
    lines_.push_back({depth_, text});
  }
  void add_local(const Variable& variable) {
    for (const Variable& one : locals_) {
      if (one.name != variable.name) continue;
      if (one.type != variable.type || one.sizes != variable.sizes) {
        fail("two variables " + one.name);
      }
      return;
    }
    locals_.push_back(variable);
    locals_.back().comment.clear();
  }

  // ---- Expressions, by precedence. `target`: where the value may be put by statements before.

  Value expression(const std::string& target = "") {
    const Value condition = chained_or(target);
    if (!take("?")) return condition;
    std::vector<Line> outer;
    outer.swap(lines_);
    ++depth_;
    const Value yes = expression();
    std::vector<Line> of_yes;
    of_yes.swap(lines_);
    expect(":");
    const Value no = expression();
    std::vector<Line> of_no;
    of_no.swap(lines_);
    --depth_;
    outer.swap(lines_);
    if (yes.type != no.type) fail("'" + yes.text + "' or '" + no.text + "': of two types");
    const bool both = !yes.changes && !no.changes && !yes.guarded && !no.guarded;
    if (both && of_yes.empty() && of_no.empty()) {
      return {"SEL(" + argument(condition) + ", " + bare(no) + ", " + bare(yes) + ")", yes.type,
              false, condition.guarded, true};
    }
    const std::string name = target.empty() ? temporary(yes.type) : target;
    line("IF " + bare(condition) + " THEN");
    put(of_yes, name, yes);
    line("ELSE");
    put(of_no, name, no);
    line("END_IF;");
    return {name, yes.type, false, false, true};
  }
  void put(const std::vector<Line>& before, const std::string& name, const Value& value) {
    lines_.insert(lines_.end(), before.begin(), before.end());
    ++depth_;
    line(name + " := " + bare(value) + ";");
    --depth_;
  }
  std::string temporary(const std::string& its_type, const std::string& stem = "chosen") {
    const std::string name = stem + std::to_string(++temporaries_);
    add_local({name, its_type});
    return name;
  }
  Value chained_or(const std::string& target) {
    Value left = chained_and(target);
    while (take("||")) left = joined(left, "OR", target, [this] { return chained_and(""); });
    return left;
  }
  Value chained_and(const std::string& target) {
    Value left = chained_bits();
    while (take("&&")) left = joined(left, "AND", target, [this] { return chained_bits(); });
    return left;
  }
  /// C evaluates the right side only where the left one does not decide.
  template <class Parse>
  Value joined(const Value& left, const std::string& word, const std::string& target,
               const Parse& parse) {
    std::vector<Line> outer;
    outer.swap(lines_);
    ++depth_;
    const Value right = parse();
    --depth_;
    std::vector<Line> before;
    before.swap(lines_);
    outer.swap(lines_);
    if (left.type != "BOOL" || right.type != "BOOL") fail(word + " of what is no condition");
    if (!right.changes && !right.guarded && before.empty()) {
      return {left.text + " " + word + " " + right.text, "BOOL", left.changes, left.guarded};
    }
    const bool is_local = std::any_of(locals_.begin(), locals_.end(), [&](const Variable& one) {
      return one.name == target && one.type == "BOOL";
    });
    const std::string name = is_local ? target : temporary("BOOL");
    if (left.text != name) line(name + " := " + bare(left) + ";");
    line("IF " + std::string(word == "OR" ? "NOT " : "") + name + " THEN");
    put(before, name, right);
    line("END_IF;");
    return {name, "BOOL", false, false, true};
  }
  Value bits(const std::string& word, const Value& left, const Value& right) {
    if (left.type != "UDINT" || right.type != "UDINT") fail("bits of what is no count");
    std::string upper = word;
    for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    const std::string name =
        helper("bits_" + word, "UDINT", "a, b : UDINT", "",
               "  $f := DWORD_TO_UDINT(UDINT_TO_DWORD(a) " + upper + " UDINT_TO_DWORD(b));\n");
    return {name + "(a := " + argument(left) + ", b := " + argument(right) + ")", "UDINT",
            left.changes || right.changes, left.guarded || right.guarded, true};
  }
  Value chained_bits() {
    Value left = chained_mask();
    while (take("|")) left = bits("or", left, chained_mask());
    return left;
  }
  Value chained_mask() {
    Value left = binary(0);
    while (take("&")) left = bits("and", left, binary(0));
    return left;
  }
  Value binary(std::size_t level) {
    static const std::vector<std::vector<std::pair<std::string, std::string>>> levels{
        {{"==", "="}, {"!=", "<>"}},
        {{"<", "<"}, {">", ">"}, {"<=", "<="}, {">=", ">="}},
        {{"+", "+"}, {"-", "-"}},
        {{"*", "*"}, {"/", "/"}, {"%", "MOD"}}};
    if (level == levels.size()) return unary();
    Value left = binary(level + 1);
    for (bool found = true; found;) {
      found = false;
      for (const auto& [sign, word] : levels[level]) {
        if (!take(sign)) continue;
        const Value right = binary(level + 1);
        if (left.type != right.type) {
          fail("'" + left.text + " " + sign + " " + right.text + "' of " + left.type + " and " +
               right.type);
        }
        left = {left.text + " " + word + " " + right.text, level < 2 ? "BOOL" : left.type,
                left.changes || right.changes,
                left.guarded || right.guarded || (sign == "-" && left.type == "UDINT")};
        found = true;
        break;
      }
    }
    return left;
  }
  Value unary() {
    if (take("!")) {
      Value of = unary();
      if (of.type != "BOOL") fail("'" + of.text + "' is no condition");
      of.text = "NOT " + of.text;
      of.is_simple = false;
      return of;
    }
    if (take("-")) {
      Value of = unary();
      of.text = "-" + of.text;
      of.is_simple = false;
      return of;
    }
    if (take("&") || take("*")) {
      if (sets_.count(peek()) == 0) return postfix();
      next();  // what the type begins with
      return {};
    }
    if (peek() == "(" && is_type(peek(1)) && peek(2) == ")") {
      ++at_;
      const std::string to = type(next());
      expect(")");
      Value of = unary();
      if (of.type == to) return of;
      of.text = of.type + "_TO_" + to + "(" + argument(of) + ")";
      of.by_reference = false;
      of.type = to;
      of.is_simple = true;
      return of;
    }
    return postfix();
  }
  Value postfix() {
    Value value = primary();
    for (;;) {
      if (take("->") || take(".")) {
        const std::string field = name_of(next());
        const auto fields = structs_.find(value.type);
        bool found = false;
        if (fields != structs_.end()) {
          for (const Variable& one : fields->second) {
            if (one.name != field) continue;
            value = {value.text + "." + field, one.type, false, value.guarded, true, one.sizes};
            found = true;
            break;
          }
        }
        if (!found) fail("'" + field + "' is no part of '" + value.text + "'");
      } else if (take("[")) {
        const Value place = expression();
        expect("]");
        if (value.text.back() == ']') {
          value.text.back() = ',';
          value.text += " " + bare(place) + "]";
        } else {
          value.text += "[" + bare(place) + "]";
        }
        value.guarded = true;
      } else {
        return value;
      }
    }
  }
  Value primary() {
    const std::string word = next();
    if (word == "(") {
      Value inner = expression();
      expect(")");
      if (!inner.is_simple) inner.text = "(" + inner.text + ")";
      inner.is_simple = true;
      return inner;
    }
    if (word.empty()) {
      fail("the end");
      return {};
    }
    if (std::isdigit(static_cast<unsigned char>(word[0])) != 0) {
      const std::string text = number(word);
      const bool single = word.back() == 'f' && word[1] != 'x';
      if (!single && text.find('.') != std::string::npos) {
        const double value = std::strtod(word.c_str(), nullptr);
        const double size = (std::abs)(value);
        if (size > 1e37 || (size > 0 && size < 1e-37)) return scaled(value);
      }
      return {text,
              text.find('.') == std::string::npos ? "UDINT"
              : single                            ? "REAL"
                                                  : "LREAL",
              false, false, true};
    }
    if (word == "true" || word == "false") {
      return {word == "true" ? "TRUE" : "FALSE", "BOOL", false, false, true};
    }
    if (peek() == "(") return call(word);
    if (const auto found = defined_.find(word); found != defined_.end()) {
      return {found->second + " (* " + short_of(word) + " *)", "UDINT", false, false, true};
    }
    const std::string name = name_of(word);
    if (const auto row = rows_.find(name); row != rows_.end()) {
      return {row->second.first + "[" + name + "]", row->second.second, false, true, true};
    }
    for (const Variable& one : locals_) {
      if (one.name == name) return {name, one.type, false, false, true, one.sizes};
    }
    if (tables_.count(name) != 0) return {"o." + name, real_, false, true, true};
    fail("'" + word + "' is not known");
    return {};
  }
  /// In the brackets of another call. A call with VAR_IN_OUT stands before it: not each compiler
  /// takes it inside.
  std::string argument(const Value& value) {
    if (!value.by_reference) return bare(value);
    const std::string name = temporary(value.type, "result");
    line(name + " := " + value.text + ";");
    return name;
  }
  Value call(const std::string& word) {
    expect("(");
    std::vector<Value> given;
    while (error.empty() && !take(")")) {
      given.push_back(expression());
      (void)take(",");
    }
    if (given.empty()) fail("a call of " + word + " without arguments");
    if (!error.empty()) return {};
    const std::string first = argument(given[0]);
    const std::string stem = word.back() == 'f' ? word.substr(0, word.size() - 1) : word;
    if (word == "is_finite") {
      // The largest LREAL is a number that not each compiler takes.
      return {helper("is_finite", "BOOL", "", "",
                     "  (* FALSE for NaN and infinity *)\n  $f := (ABS(x) * 0.5 < ABS(x)) OR (x = "
                     "0.0);\n") +
                  "(" + first + ")",
              "BOOL", false, given[0].guarded, true};
    }
    static const std::map<std::string, std::string> known{
        {"fabs", "ABS"}, {"sqrt", "SQRT"}, {"exp", "EXP"}, {"pow", "EXPT"},
        {"sin", "SIN"},  {"cos", "COS"},   {"tan", "TAN"}, {"atan", "ATAN"}};
    std::string text;
    std::string its_type = real_;
    bool changes = false;
    const auto own = functions_.find(word);
    const bool named = own != functions_.end();
    if (const auto found = known.find(stem); found != known.end()) {
      text = found->second;
      its_type = given[0].type;
    } else if (stem == "tanh") {
      return {"(1.0 - (2.0 / (EXP(2.0 * " + argument(given[0]) + ") + 1.0)))", real_, false, false,
              true};
    } else if (stem == "cbrt") {
      return {"EXPT(" + first + ", 1.0 / 3.0)", real_, false, false, true};
    } else if (stem == "expm1") {
      return {"(EXP(" + first + ") - 1.0)", real_, false, false, true};
    } else if (stem == "round" || stem == "ceil") {
      text = rounding(stem);
    } else if (named) {
      text = own->second.name;
      its_type = own->second.type;
      changes = own->second.changes;
      calls_.push_back(word);
      if (own->second.parameters.size() != given.size()) fail("a call of " + word);
    } else {
      fail("'" + word + "' is no known function");
    }
    std::string arguments;
    bool guarded = false;
    for (std::size_t i = 0; i < given.size(); ++i) {
      const Value& one = given[i];
      arguments += (arguments.empty() ? "" : ", ") +
                   (named && (given.size() > 1 || own->second.parameters[0].by_reference)
                        ? own->second.parameters[i].name + " := "
                        : "") +
                   (i == 0 ? first : argument(one));
      changes = changes || one.changes;
      guarded = guarded || one.guarded;
    }
    bool by_reference = false;
    if (named) {
      for (const Variable& one : own->second.parameters) {
        by_reference = by_reference || one.by_reference;
      }
    }
    return {text + "(" + arguments + ")", its_type, changes, guarded, true, {}, by_reference};
  }
  /// A function that is not translated. @param inputs those that are not one x @return its name
  std::string helper(const std::string& stem, const std::string& its_type,
                     const std::string& inputs, const std::string& own, const std::string& body) {
    const std::string name = name_ + "_" + stem;
    if (!helpers_.insert(name).second) return name;
    text_ += "FUNCTION " + name + " : " + its_type + "\nVAR_INPUT\n  " +
             (inputs.empty() ? "x : " + real_ : inputs) + ";\nEND_VAR\n" +
             (own.empty() ? "" : "VAR\n  " + own + ";\nEND_VAR\n") + filled(body, {{"$f", name}}) +
             "END_FUNCTION\n\n";
    return name;
  }
  /// An LREAL beyond what a REAL holds, which not each compiler takes: times a power of 2^126.
  Value scaled(double value) {
    const bool up = (std::abs)(value) > 1;
    const double by = up ? 0x1p-126 : 0x1p126;
    int times = 0;
    for (; (std::abs)(value) > 1e37 || (std::abs)(value) < 1e-37; ++times) value *= by;
    const std::string name = helper(
        up ? "scaled_up" : "scaled_down", "LREAL", "x : LREAL;\n  times : UDINT", "i : UDINT",
        std::string("  $f := x;\n  FOR i := 1 TO times DO\n    $f := $f * ") +
            (up ? "8.507059173023462E+37" : "1.1754943508222875E-38") + ";\n  END_FOR;\n");
    return {name + "(x := " + number(ListWriter(c_language, false).number(value)) +
                ", times := " + std::to_string(times) + ")",
            "LREAL", false, false, true};
  }
  /// To the nearest whole number, a half away from zero, or up: not a function of each PLC.
  std::string rounding(const std::string& stem) {
    return helper(stem, real_, "", "size, whole : " + real_,
                  filled("  size := ABS(x);\n"
                         "  IF NOT (size < $W) THEN\n"
                         "    $f := x; (* it has no fraction *)\n"
                         "    RETURN;\n"
                         "  END_IF;\n"
                         "  whole := (size + $W) - $W; (* a half to an even number *)\n"
                         "  IF $UP THEN\n"
                         "    whole := whole + 1.0;\n"
                         "  END_IF;\n"
                         "  $f := SEL(x < 0.0, whole, -whole);\n",
                         {{"$W", real_ == "REAL" ? "8388608.0" : "4503599627370496.0"},
                          {"$UP", stem == "ceil" ? "whole < size" : "size - whole >= 0.5"}}));
  }
  /// Without parentheses around all of it.
  static std::string bare(const Value& value) {
    const std::string& text = value.text;
    if (text.size() < 2 || text.front() != '(' || text.back() != ')' || text[1] == '*') return text;
    int deep = 0;
    for (std::size_t i = 0; i + 1 < text.size(); ++i) {
      deep += text[i] == '(' ? 1 : text[i] == ')' ? -1 : 0;
      if (deep == 0) return text;
    }
    return text.substr(1, text.size() - 2);
  }

  // Of the function at hand.
  int depth_ = 0;
  int temporaries_ = 0;
  std::vector<Variable> locals_{};
  std::map<std::string, std::pair<std::string, std::string>> rows_{};
  std::vector<std::string> calls_{};
  std::set<std::string> helpers_{};
};

}  // namespace esokit::detail
