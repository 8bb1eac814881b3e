/// @file
/// The C that esokit writes, function by function as Structured Text.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <esokit/target/st_expressions.hpp>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Translates C, in the narrow subset that to_c writes, into functions of Structured Text (IEC
/// 61131-3, second edition: no methods, no pointers). A pointer becomes VAR_IN_OUT, a count of any
/// width UDINT, a table a part of the state, a call in a condition a statement before it where C
/// would not always evaluate it. What is no part of the subset ends it: see `error`.
class StTranslator : public StExpressions {
 public:
  /// @param text header and source, one after the other @param name before each function and type
  StTranslator(const std::string& text, std::string name) : StExpressions(text, std::move(name)) {}

  /// Whatever `body` calls is written, with all that these call.
  void write_for(const std::string& body) {
    for (auto& [word, function] : functions_) {
      if (body.find(function.name + "(") != std::string::npos) written(word);
    }
  }

  /// All the numbers that `function` sets are from now on the initial values of the state.
  void initial_from(const std::string& function) {
    if (!has(function)) return;
    const Function before = functions_.at(function);
    begin(before);
    block();
    for (const Line& line : lines_) {
      const std::size_t middle = line.text.find(" := ");
      std::string left = line.text.substr(2, middle - 2);
      std::string value = line.text.substr(middle + 4);
      if (!value.empty()) value.pop_back();
      left = left.substr(0, left.find('['));
      for (Variable& field : structs_[before.parameters[0].type]) {
        if (field.name != left) continue;
        field.initial += (field.initial.empty() ? "" : ", ") + value;
      }
    }
  }

 private:
  // ---- Functions.

  void begin(const Function& function) {
    at_ = function.body;
    where_ = function.name;
    lines_.clear();
    locals_.clear();
    rows_.clear();
    temporaries_ = 0;
    depth_ = 0;
    for (const Variable& one : function.parameters) locals_.push_back(one);
    function_ = function.name;
    type_ = function.type;
    keeps_comments_ = true;
    comment_.clear();
  }
  void written(const std::string& name) {
    Function& function = functions_.at(name);
    if (function.done || !error.empty()) return;
    function.done = true;
    begin(function);
    block();
    keeps_comments_ = false;
    if (!lines_.empty() && lines_.back().text == "RETURN;" && lines_.back().depth == 0) {
      lines_.pop_back();
    }
    std::string text = function.comment + (function.comment.empty() ? "" : "\n") + "FUNCTION " +
                       function.name + " : " + function.type + "\n";
    std::string in_out;
    std::string inputs;
    std::string own;
    for (std::size_t i = 0; i < locals_.size(); ++i) {
      add_declared(i >= function.parameters.size() ? own
                   : locals_[i].by_reference       ? in_out
                                                   : inputs,
                   locals_[i]);
    }
    if (!in_out.empty()) text += "VAR_IN_OUT\n" + in_out + "END_VAR\n";
    if (!inputs.empty()) text += "VAR_INPUT\n" + inputs + "END_VAR\n";
    if (!own.empty()) text += "VAR\n" + own + "END_VAR\n";
    for (const Line& line : lines_) {
      text += std::string(2 * static_cast<std::size_t>(line.depth) + 2, ' ') + line.text + "\n";
    }
    text += "END_FUNCTION\n\n";
    std::vector<std::string> calls;
    calls.swap(calls_);
    for (const std::string& one : calls) written(one);
    text_ += text;
  }

  /// `{ .. }`, of which the first is taken already.
  void block() {
    while (error.empty() && !take("}")) statement();
    comment_.clear();
  }
  void body() {
    ++depth_;
    const std::size_t before = lines_.size();
    expect("{");
    block();
    if (lines_.size() == before) line(";");
    --depth_;
  }

  void statement() {
    const std::string word = peek();
    if (word == "{") {
      ++at_;
      block();
    } else if (word == "if") {
      chain();
    } else if (word == "while") {
      ++at_;
      expect("(");
      const std::size_t before = lines_.size();
      const Value condition = expression();
      expect(")");
      if (lines_.size() != before) fail("a call in the condition of a loop");
      line("WHILE " + bare(condition) + " DO");
      body();
      line("END_WHILE;");
    } else if (word == "for") {
      loop();
    } else if (word == "switch") {
      cases();
    } else if (word == "return") {
      ++at_;
      if (peek() != ";") {
        assign(function_, type_, expression(function_));
      }
      expect(";");
      line("RETURN;");
    } else if (word == "(" && peek(1) == "void") {
      at_ += 3;
      if (peek() == "memset") {  // before the first values: those of the type are zero
        while (error.empty() && peek() != ";") ++at_;
      }
      const Value value = peek() == ";" ? Value{} : expression();
      expect(";");
      if (value.text.find('(') != std::string::npos) ignore(value);
    } else if (word == "static" || word == "const" || is_type(word)) {
      declaration();
    } else {
      (void)take("*");
      const Value left = postfix();
      const std::string sign = next();
      if (sign == ";") {
        ignore(left);
        return;
      }
      if (sign == "=") {
        assign(left.text, left.type, expression(left.text));
      } else if (sign == "|=") {
        line(left.text + " := " + bits("or", left, expression()).text + ";");
      } else if (sign == ">>=") {
        const int by = std::atoi(next().c_str());
        line(left.text + " := " + left.text + " / " + std::to_string(1 << by) + ";");
      } else {
        fail("'" + sign + "' behind '" + left.text + "'");
      }
      expect(";");
    }
  }
  void assign(const std::string& left, const std::string& its_type, const Value& value) {
    if (value.text == left || value.text.empty()) return;  // it is done
    if (value.type != its_type) fail(left + " is a " + its_type + ", given a " + value.type);
    line(left + " := " + bare(value) + ";");
  }
  void ignore(const Value& value) {
    const std::string name = value.type == "BOOL"    ? "done"
                             : value.type == "UDINT" ? "flags"
                                                     : "unread";
    add_local({name, value.type});
    line(name + " := " + value.text + ";");
  }
  void declaration() {
    const bool is_static = take("static");
    Variable one = declarator();
    if (is_static) {
      expect("=");
      one.initial = initializer();
      expect(";");
      const bool has_state =
          std::any_of(locals_.begin(), locals_.end(),
                      [this](const Variable& other) { return other.type == name_ + "_state"; });
      if (has_state) {
        add_table(one);
      } else {
        add_local(one);
      }
      return;
    }
    if (one.by_reference) {  // of a row of a table: its number
      expect("=");
      const Value row = postfix();
      expect(";");
      const std::size_t at = row.text.find('[');
      rows_[one.name] = {row.text.substr(0, at), row.type};
      add_local({one.name, "UDINT"});
      line(one.name + " := " + row.text.substr(at + 1, row.text.size() - at - 2) + ";");
      return;
    }
    one.by_reference = false;
    add_local(one);
    if (!take("=")) {
      expect(";");
      return;
    }
    if (take("{")) {
      std::size_t i = 0;
      while (error.empty() && !take("}")) {
        std::string left = one.name + "[" + std::to_string(i) + "]";
        std::string its_type = one.type;
        if (one.sizes.empty()) {
          const Variable& field = structs_[one.type][i];
          left = one.name + "." + field.name;
          its_type = field.type;
        }
        assign(left, its_type, expression(left));
        (void)take(",");
        ++i;
      }
    } else {
      assign(one.name, one.type, expression(one.name));
    }
    expect(";");
  }

  /// if, else if, else. One that needs a statement before it stands inside an ELSE.
  void chain() {
    expect("if");
    expect("(");
    const Value first = expression();
    expect(")");
    line("IF " + bare(first) + " THEN");
    body();
    int inside = 0;
    while (take("else")) {
      if (!take("if")) {
        const std::size_t before = lines_.size();
        line("ELSE");
        body();
        if (lines_.size() == before + 2 && lines_.back().text == ";") lines_.resize(before);
        break;
      }
      expect("(");
      std::vector<Line> before;
      before.swap(lines_);
      ++depth_;
      const Value condition = expression();
      --depth_;
      before.swap(lines_);
      expect(")");
      if (before.empty()) {
        line("ELSIF " + bare(condition) + " THEN");
      } else {
        line("ELSE");
        lines_.insert(lines_.end(), before.begin(), before.end());
        ++inside;
        ++depth_;
        line("IF " + bare(condition) + " THEN");
      }
      body();
    }
    for (; inside > 0; --inside) {
      line("END_IF;");
      --depth_;
    }
    line("END_IF;");
  }
  void loop() {
    expect("for");
    expect("(");
    const std::string name = name_of(next());
    expect("=");
    const std::string from = bare(expression());
    expect(";");
    if (next() != name) fail("a loop of another variable");
    const std::string sign = next();
    std::string to = bare(expression());
    expect(";");
    const std::string step = next();
    expect(name);
    expect(")");
    if (step == "++" && (sign == "<" || sign == "<=")) {
      const bool is_number = to.find_first_not_of("0123456789") == std::string::npos;
      if (sign == "<") to = is_number ? std::to_string(std::atoi(to.c_str()) - 1) : to + " - 1";
      line("FOR " + name + " := " + from + " TO " + to + " DO");
      body();
      line("END_FOR;");
      return;
    }
    if (step != "--" || sign != ">") fail("a loop that goes otherwise");
    line(name + " := " + from + ";");
    line("WHILE " + name + " > " + to + " DO");
    body();
    lines_.push_back({depth_ + 1, name + " := " + name + " - 1;"});
    line("END_WHILE;");
  }
  void cases() {
    expect("switch");
    expect("(");
    const Value of = expression();
    expect(")");
    expect("{");
    line("CASE " + bare(of) + " OF");
    while (error.empty() && !take("}")) {
      if (take("default")) {
        expect(":");
        expect("break");
        expect(";");
        continue;
      }
      expect("case");
      ++depth_;
      line(number(next()) + ":");
      expect(":");
      ++depth_;
      while (error.empty() && !take("break")) statement();
      expect(";");
      depth_ -= 2;
    }
    line("END_CASE;");
  }

  std::string function_{};
  std::string type_{};
};

}  // namespace esokit::detail
