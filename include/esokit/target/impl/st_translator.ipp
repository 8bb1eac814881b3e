#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/st_translator.hpp>
#include <esokit/target/written_names.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION StTranslator::StTranslator(const std::string& text, std::string name)
    : name_(std::move(name)) {
  split(text);
  tokens_.push_back({});
  while (error.empty() && at_ + 1 < tokens_.size()) item();
}

ESOKIT_FUNCTION void StTranslator::write_for(const std::string& body) {
  for (const auto& [word, function] : functions_) {
    if (body.find(function.name + "(") != std::string::npos) need(word);
  }
}

ESOKIT_FUNCTION std::string StTranslator::text() {
  std::string structs;
  for (const std::string& type : order_of_structs_) {
    structs += "TYPE " + type + " :\n  STRUCT\n";
    for (const Variable& field : structs_.at(type)) structs += "    " + declared(field) + "\n";
    structs += "  END_STRUCT;\nEND_TYPE\n\n";
  }
  std::string all;
  for (const int size : arrays_) {
    all += "TYPE " + array_name(size) + " : ARRAY[0.." + std::to_string(size - 1) + "] OF " +
           real_ + "; END_TYPE\n\n";
  }
  all += structs;
  for (const std::string& word : order_) {
    if (functions_.at(word).is_needed) all += functions_.at(word).text;
  }
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

ESOKIT_FUNCTION void StTranslator::split(const std::string& text) {
  std::string before;
  bool same_line = false;
  for (std::size_t i = 0, end = 0; i < text.size(); i = end) {
    end = i + 1;
    if (text[i] == '\n') same_line = false;
    if (text[i] == '#') {
      // What only another compiler or the self-test reads is skipped.
      end = text.find('\n', i);
      define(text.substr(i, end - i));
      if (text.compare(i, 7, "#ifdef ") == 0) end = text.find("\n#endif", i) + 7;
    } else if (text.compare(i, 2, "/*") == 0) {
      end = text.find("*/", i) + 2;
      const std::string comment = filled(text.substr(i + 2, end - i - 4), {{"\n * ", "\n   "}});
      (same_line ? tokens_.back().behind : before) += "(*" + comment + "*)";
    } else if (std::isspace(static_cast<unsigned char>(text[i])) == 0) {
      end = i + length_at(text, i);
      const std::string token = text.substr(i, end - i);
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

ESOKIT_FUNCTION std::size_t StTranslator::length_at(const std::string& text, std::size_t i) {
  const auto is = [](int (*kind)(int), char c) { return kind(static_cast<unsigned char>(c)) != 0; };
  const bool is_number = is(std::isdigit, text[i]);
  std::size_t n = 0;
  for (char c = text[i]; is(std::isalnum, c) || c == '_' || (is_number && c == '.') ||
                         (is_number && (c == '-' || c == '+') && text[i + n - 1] == 'e');) {
    c = text[i + ++n];
  }
  static const std::string pairs = " -> || && == != <= >= ++ -- ";
  return n > 0 ? n : pairs.find(" " + text.substr(i, 2) + " ") != std::string::npos ? 2 : 1;
}

ESOKIT_FUNCTION void StTranslator::define(const std::string& line) {
  const std::size_t at = line.find(' ', 8);
  if (line.compare(0, 8, "#define ") != 0 || at == std::string::npos) return;
  const std::string name = line.substr(8, at - 8);
  std::string prefix = name_ + "_";
  for (char& c : prefix) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  (name.compare(0, prefix.size(), prefix) == 0 ? flags_ : constants_)[name] =
      line.substr(at + 1, line.find(' ', at + 1) - at - 1);
}

ESOKIT_FUNCTION std::string StTranslator::next() {
  const std::string token = peek();
  if (at_ + 1 < tokens_.size()) ++at_;
  return token;
}

ESOKIT_FUNCTION bool StTranslator::take(const std::string& token) {
  if (peek() != token) return false;
  (void)next();
  return true;
}

ESOKIT_FUNCTION void StTranslator::skip_to(const std::string& token) {
  while (error.empty() && peek() != token) {
    if (next().empty()) fail("no '" + token + "'");
  }
}

ESOKIT_FUNCTION void StTranslator::fail(const std::string& what) {
  if (error.empty()) error = what + " in '" + function_.name + "'";
  at_ = tokens_.size() - 1;
}

ESOKIT_FUNCTION std::string StTranslator::type(const std::string& word) const {
  if (word == "bool" || word == "void") return "BOOL";
  if (word == "double" || word == "float") return word == "float" ? "REAL" : "LREAL";
  static const std::set<std::string> counts{"unsigned", "int",      "uint8_t",
                                            "uint16_t", "uint32_t", "int32_t"};
  if (counts.count(word) != 0) return "UDINT";
  return structs_.count(of_this(word)) != 0 ? of_this(word) : "";
}

ESOKIT_FUNCTION std::string StTranslator::declared(const Variable& variable) {
  std::string text = variable.type;
  if (variable.sizes.size() == 1 && variable.initial.empty() && text == real_) {
    arrays_.insert(variable.sizes[0]);
    text = array_name(variable.sizes[0]);
  } else if (!variable.sizes.empty()) {
    std::string ranges;
    for (const int size : variable.sizes) {
      ranges += (ranges.empty() ? "0.." : ", 0..") + std::to_string(size - 1);
    }
    text = "ARRAY[" + ranges + "] OF " + text;
  }
  if (!variable.initial.empty()) text += " := [" + variable.initial + "]";
  return variable.name + " : " + text + ";" +
         (variable.comment.empty() ? "" : " " + variable.comment);
}

ESOKIT_FUNCTION StTranslator::Variable StTranslator::declarator() {
  Variable one;
  one.is_constant = take("const");
  one.type = type(peek());
  if (one.type.empty()) fail("'" + peek() + "' is no type");
  (void)next();
  if (real_.empty() && one.type.find("REAL") != std::string::npos) real_ = one.type;
  one.by_reference = take("*");
  one.name = name_of(next());
  for (; take("["); expect("]")) one.sizes.push_back(std::atoi(next().c_str()));
  return one;
}

ESOKIT_FUNCTION void StTranslator::item() {
  function_ = {};
  const std::string comment = tokens_[at_].before;
  if (take("extern")) {
    skip_to(";");
    expect(";");
  } else if (take("typedef")) {
    structure();
  } else {
    (void)take("static");
    const std::string of_c = peek(peek() == "const" ? 2 : 1);
    const Variable head = declarator();
    if (take("=")) {
      table(head);
    } else {
      function(of_c, head, comment);
    }
  }
}

ESOKIT_FUNCTION void StTranslator::structure() {
  expect("struct");
  expect("{");
  std::vector<Variable> fields;
  while (error.empty() && !take("}")) {
    fields.push_back(declarator());
    expect(";");
    fields.back().comment = tokens_[at_ - 1].behind;
  }
  order_of_structs_.push_back(of_this(peek()));
  structs_[of_this(next())] = fields;
  expect(";");
}

ESOKIT_FUNCTION void StTranslator::table(Variable one) {
  std::vector<std::string> numbers;
  int deep = 0;
  do {
    const std::string token = next();
    deep += token == "{" ? 1 : token == "}" ? -1 : 0;
    const bool is_number = std::isdigit(static_cast<unsigned char>(token[0])) != 0;
    const bool is_negative = tokens_[at_ - 2].text == "-";
    if (is_number) numbers.push_back((is_negative ? "-" : "") + number(token));
  } while (deep > 0 && error.empty());
  expect(";");
  if (structs_.count(one.type) != 0) return take_settings(one, numbers);
  for (const std::string& each : numbers) {
    one.initial += (one.initial.empty() ? "" : ", ") + each;
  }
  const auto& given = function_.parameters;
  const bool is_local =
      !function_.name.empty() && (given.empty() || given[0].type != name_ + "_state");
  if (!is_local) tables_.insert(one.name);
  (is_local ? locals_ : structs_[name_ + "_state"]).push_back(one);
}

ESOKIT_FUNCTION void StTranslator::take_settings(const Variable& set,
                                                 const std::vector<std::string>& numbers) {
  std::size_t next = 0;
  for (const Variable& field : structs_[set.type]) {
    const int columns = field.sizes.empty() ? 1 : field.sizes.back();
    const int rows = field.sizes.size() > 1 ? field.sizes[0] : 1;
    for (int i = 0; i < rows * columns && next < numbers.size(); ++i) {
      const std::string row = field.sizes.size() > 1 ? std::to_string(i / columns) + ", " : "";
      const std::string place = "[" + row + std::to_string(i % columns) + "]";
      settings_ += "  settings." + field.name + (field.sizes.empty() ? "" : place) +
                   " := " + numbers[next++] + ";\n";
    }
  }
  set_ = set.name;
  functions_[set_] = {.name = name_ + "_set_first", .type = "BOOL", .text = settings("first")};
  order_.push_back(set_);
}

ESOKIT_FUNCTION void StTranslator::function(const std::string& of_c, const Variable& head,
                                            const std::string& comment) {
  function_.name = of_this(of_c);
  function_.type = head.type;
  expect("(");
  while (error.empty() && !take(")")) {
    Variable one = declarator();
    // Another struct that is read is given by its value.
    const bool whole = one.by_reference && one.is_constant && one.type != name_ + "_state";
    one.by_reference = (one.by_reference && !whole) || !one.sizes.empty();
    function_.parameters.push_back(one);
    (void)take(",");
  }
  if (take(";")) return;
  expect("{");
  lines_.clear();
  locals_ = function_.parameters;
  depth_ = temporaries_ = 0;
  if (of_c == "is_finite") {  // by its value: the largest LREAL is no number to each compiler
    line(function_.name + " := (ABS(x) * 0.5 < ABS(x)) OR (x = 0.0);");
    skip_to("}");
    expect("}");
  } else {
    block();
  }
  for (const auto& [other, its] : functions_) {
    if (its.name == function_.name) fail("a second '" + other + "'");
  }
  function_.text = comment + (comment.empty() ? "" : "\n") + whole_text();
  functions_[of_c] = function_;
  order_.push_back(of_c);
}

ESOKIT_FUNCTION std::string StTranslator::whole_text() {
  if (!lines_.empty() && lines_.back() == std::pair(0, std::string("RETURN;"))) lines_.pop_back();
  std::string in_out, inputs, own, body;
  for (std::size_t i = 0; i < locals_.size(); ++i) {
    const bool is_own = i >= function_.parameters.size();
    (is_own                    ? own
     : locals_[i].by_reference ? in_out
                               : inputs) += "  " + declared(locals_[i]) + "\n";
  }
  for (const auto& [deep, text] : lines_) {
    body += std::string(2 * static_cast<std::size_t>(deep) + 2, ' ') + text + "\n";
  }
  return "FUNCTION " + function_.name + " : " + function_.type + "\n" +
         (in_out.empty() ? "" : "VAR_IN_OUT\n" + in_out + "END_VAR\n") +
         (inputs.empty() ? "" : "VAR_INPUT\n" + inputs + "END_VAR\n") +
         (own.empty() ? "" : "VAR\n" + own + "END_VAR\n") + body + "END_FUNCTION\n\n";
}

ESOKIT_FUNCTION void StTranslator::need(const std::string& word) {
  Function& one = functions_.at(word);
  if (std::exchange(one.is_needed, true)) return;
  for (const std::string& other : one.calls) need(other);
}

ESOKIT_FUNCTION void StTranslator::add_local(const std::string& name, const std::string& its_type) {
  for (const Variable& one : locals_) {
    if (one.name != name) continue;
    if (one.type != its_type || !one.sizes.empty()) fail("two " + name);
    return;
  }
  locals_.push_back({name, its_type});
}

ESOKIT_FUNCTION std::string StTranslator::temporary(const std::string& its_type) {
  const std::string name = "value" + std::to_string(++temporaries_);
  add_local(name, its_type);
  return name;
}

ESOKIT_FUNCTION void StTranslator::block() {
  const auto comment = [this] {  // behind the last line
    const std::string& behind = tokens_[at_ - 1].behind;
    if (!behind.empty() && !lines_.empty()) lines_.back().second += " " + behind;
  };
  comment();
  while (error.empty() && !take("}")) {
    if (!tokens_[at_].before.empty()) line(tokens_[at_].before);
    statement();
    comment();
  }
}

ESOKIT_FUNCTION void StTranslator::body() {
  expect("{");
  ++depth_;
  block();
  --depth_;
}

ESOKIT_FUNCTION void StTranslator::statement() {
  const std::string word = peek();
  if (word == "if") {
    condition();
  } else if (word == "while" || word == "for") {
    loop();
  } else if (take("return")) {
    if (peek() != ";") assign(function_.name, function_.type, expression(function_.name));
    line("RETURN;");
    expect(";");
  } else if (word == "static" || word == "const" || !type(word).empty()) {
    declaration();
  } else if (word == "(" && peek(1) == "void") {
    at_ += 3;
    if (peek() == "memset") {  // of the state: as the variables of a function begin
      skip_to(";");
      add_local("nothing", name_ + "_state");
      line("o := nothing;");
    } else if (const Value value = expression(); value.text.find('(') != std::string::npos) {
      ignore(value);
    }
    expect(";");
  } else {
    (void)take("*");
    const Value left = postfix();
    if (take("=")) {
      assign(left.text, left.type, expression(left.text));
    } else {
      ignore(left);
    }
    expect(";");
  }
}

ESOKIT_FUNCTION void StTranslator::assign(const std::string& left, const std::string& its_type,
                                          const Value& value) {
  if (value.type != its_type) fail(left + " is a " + its_type + ", given a " + value.type);
  if (value.text == set_ && !set_.empty()) {
    function_.calls.insert(set_);
    ignore({name_ + "_set_first(settings := " + left + ")", "BOOL"});
  } else if (value.text != left) {
    line(left + " := " + bare(value) + ";");
  }
}

ESOKIT_FUNCTION void StTranslator::ignore(const Value& value) {
  const std::string name = value.type == "BOOL"    ? "done"
                           : value.type == "UDINT" ? "flags"
                                                   : "unread";
  add_local(name, value.type);
  line(name + " := " + value.text + ";");
}

ESOKIT_FUNCTION void StTranslator::declaration() {
  const bool is_table = take("static");
  const Variable one = declarator();
  if (one.by_reference) fail("a pointer " + one.name);
  if (is_table) {
    expect("=");
    return table(one);
  }
  if (one.sizes.empty()) {
    add_local(one.name, one.type);
  } else {
    locals_.push_back(one);
  }
  if (take("=")) assign(one.name, one.type, expression(one.name));
  expect(";");
}

ESOKIT_FUNCTION void StTranslator::condition(bool is_else) {
  expect("if");
  expect("(");
  if (is_else) ++depth_;
  auto [value, before] = apart([this] { return expression(); });
  expect(")");
  const bool is_inside = is_else && !before.empty();
  if (is_else && !is_inside) --depth_;
  if (is_inside) lines_.emplace_back(depth_ - 1, "ELSE");
  lines_.insert(lines_.end(), before.begin(), before.end());
  line((is_else && !is_inside ? "ELSIF " : "IF ") + bare(value) + " THEN");
  body();
  if (take("else")) {
    if (peek() == "if") {
      condition(true);
    } else {
      line("ELSE");
      const std::size_t empty = lines_.size();
      body();
      if (lines_.size() == empty) lines_.pop_back();
    }
  }
  if (is_inside || !is_else) line("END_IF;");
  if (is_inside) --depth_;
}

ESOKIT_FUNCTION void StTranslator::loop() {
  const bool counts = next() == "for";
  expect("(");
  if (counts) {
    const Value i = postfix();
    expect("=");
    assign(i.text, i.type, expression());
    expect(";");
  }
  const auto [condition, before] = apart([this] { return expression(); });
  if (!before.empty()) fail("a call in the condition of a loop");
  line("WHILE " + bare(condition) + " DO");
  std::string step;
  if (counts) {
    expect(";");
    const std::string sign = next();
    if (sign != "++" && sign != "--") fail("a loop that goes otherwise");
    const std::string i = postfix().text;
    step = i + " := " + i + " " + sign[0] + " 1;";
  }
  expect(")");
  body();
  if (counts) lines_.emplace_back(depth_ + 1, step);
  line("END_WHILE;");
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::expression(const std::string& target) {
  const Value condition = binary(0, target);
  if (!take("?")) return condition;
  const auto choice = [this] {
    ++depth_;
    const auto one = apart([this] { return expression(); });
    --depth_;
    return one;
  };
  const auto [yes, of_yes] = choice();
  expect(":");
  const auto [no, of_no] = choice();
  if (yes.type != no.type) fail("'" + yes.text + "' or '" + no.text + "': of two types");
  if (!yes.lazy && !no.lazy && of_yes.empty() && of_no.empty()) {
    return {"SEL(" + argument(condition) + ", " + bare(no) + ", " + bare(yes) + ")", yes.type,
            condition.lazy, true};
  }
  const std::string name = target.empty() ? temporary(yes.type) : target;
  line("IF " + bare(condition) + " THEN");
  put(of_yes, name, yes);
  line("ELSE");
  put(of_no, name, no);
  line("END_IF;");
  return {name, yes.type, false, true};
}

template <class Parse>
std::pair<StTranslator::Value, StTranslator::Lines> StTranslator::apart(const Parse& parse) {
  Lines lines;
  lines.swap(lines_);
  const Value value = parse();
  lines.swap(lines_);
  return {value, lines};
}

ESOKIT_FUNCTION void StTranslator::put(const Lines& before, const std::string& name,
                                       const Value& value) {
  lines_.insert(lines_.end(), before.begin(), before.end());
  if (value.text != name) lines_.emplace_back(depth_ + 1, name + " := " + bare(value) + ";");
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::binary(std::size_t level,
                                                         const std::string& target) {
  static const std::vector<std::map<std::string, std::string>> levels{
      {{"||", "OR"}},
      {{"&&", "AND"}},
      {{"|", "OR"}},
      {{"&", "AND"}},
      {{"==", "="}, {"!=", "<>"}},
      {{"<", "<"}, {">", ">"}, {"<=", "<="}, {">=", ">="}},
      {{"+", "+"}, {"-", "-"}},
      {{"*", "*"}, {"/", "/"}, {"%", "MOD"}}};
  if (level == levels.size()) return unary();
  Value left = binary(level + 1, level == 0 ? target : "");
  for (auto word = levels[level].find(peek()); word != levels[level].end();
       word = levels[level].find(peek())) {
    (void)next();
    if (level < 2) {
      left = joined(left, word->second, target, level);
      continue;
    }
    const Value right = binary(level + 1);
    const bool of_counts = level < 4 || word->first == "%";
    if (left.type != right.type || (of_counts && left.type != "UDINT")) {
      fail("'" + left.text + " " + word->first + " " + right.text + "' of " + left.type);
    }
    const bool lazy = left.lazy || right.lazy || (word->first == "-" && left.type == "UDINT");
    if (level < 4) {
      left = {"DWORD_TO_UDINT(UDINT_TO_DWORD(" + argument(left) + ") " + word->second +
                  " UDINT_TO_DWORD(" + argument(right) + "))",
              "UDINT", lazy, true};
    } else {
      left = {left.text + " " + word->second + " " + right.text, level < 6 ? "BOOL" : left.type,
              lazy};
    }
  }
  return left;
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::joined(const Value& left, const std::string& word,
                                                         const std::string& target,
                                                         std::size_t level) {
  ++depth_;
  const auto [right, before] = apart([&] { return binary(level + 1); });
  --depth_;
  if (left.type != "BOOL" || right.type != "BOOL") fail(word + " of what is no condition");
  if (!right.lazy && before.empty()) {
    return {left.text + " " + word + " " + right.text, "BOOL", left.lazy};
  }
  const bool is_local = std::any_of(locals_.begin(), locals_.end(), [&](const Variable& one) {
    return one.name == target && one.type == "BOOL";
  });
  const std::string name = is_local ? target : temporary("BOOL");
  if (left.text != name) line(name + " := " + bare(left) + ";");
  line("IF " + std::string(word == "OR" ? "NOT " : "") + name + " THEN");
  put(before, name, right);
  line("END_IF;");
  return {name, "BOOL", false, true};
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::unary() {
  const bool negates = peek() == "!";
  if (negates || peek() == "-") {
    (void)next();
    Value of = unary();
    if ((of.type == "BOOL") != negates || of.type == "UDINT") fail("a sign of '" + of.text + "'");
    of.text.insert(0, negates ? "NOT " : "-");
    of.simple = false;
    return of;
  }
  if (take("&") || take("*")) return postfix();
  if (peek() == "(" && !type(peek(1)).empty() && peek(2) == ")") {
    const std::string to = type(peek(1));
    at_ += 3;
    const Value of = unary();
    if (of.type == to) return of;
    return {of.type + "_TO_" + to + "(" + argument(of) + ")", to, of.lazy, true};
  }
  return postfix();
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::postfix() {
  Value value = primary();
  for (bool indexed = false;; indexed = value.text.back() == ']') {
    if (take("->") || take(".")) {
      const std::vector<Variable>& fields = structs_[value.type];
      const auto one = std::find_if(fields.begin(), fields.end(), [this](const Variable& each) {
        return each.name == name_of(peek());
      });
      if (one == fields.end()) {
        fail("'" + peek() + "' is no part of '" + value.text + "'");
        return value;
      }
      (void)next();
      value = {value.text + "." + one->name, one->type, value.lazy, true, false, one->sizes};
    } else if (take("[")) {
      if (value.sizes.empty()) fail("'" + value.text + "' is no array");
      if (indexed) value.text.pop_back();
      value.text += (indexed ? ", " : "[") + bare(expression()) + "]";
      value.lazy = true;
      expect("]");
    } else {
      return value;
    }
  }
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::primary() {
  const std::string word = next();
  if (word == "(") {
    Value inner = expression();
    expect(")");
    if (!std::exchange(inner.simple, true)) inner.text = "(" + inner.text + ")";
    return inner;
  }
  if (word == "true" || word == "false") {
    return {word == "true" ? "TRUE" : "FALSE", "BOOL", false, true};
  }
  if (!word.empty() && std::isdigit(static_cast<unsigned char>(word[0])) != 0) {
    if (word.find('.') == std::string::npos) return {number(word), "UDINT", false, true};
    const bool single = word.back() == 'f';
    return {single ? number(word) : scaled(std::strtod(word.c_str(), nullptr)),
            single ? "REAL" : "LREAL", false, true};
  }
  if (take("(")) return call(word);
  if (const auto found = flags_.find(word); found != flags_.end()) {
    return {number(found->second) + " (* " + word.substr(name_.size() + 1) + " *)", "UDINT", false,
            true};
  }
  if (word == set_ && !word.empty()) return {set_, name_ + "_settings", false, true};
  const bool of_state = tables_.count(name_of(word)) != 0;
  for (const Variable& one : of_state ? structs_[name_ + "_state"] : locals_) {
    if (one.name != name_of(word)) continue;
    return {(of_state ? "o." : "") + one.name, one.type, of_state, true, false, one.sizes};
  }
  fail("'" + word + "' is not known");
  return {};
}

ESOKIT_FUNCTION std::string StTranslator::argument(const Value& value) {
  if (!value.by_reference) return bare(value);
  const std::string name = temporary(value.type);
  line(name + " := " + value.text + ";");
  return name;
}

ESOKIT_FUNCTION StTranslator::Value StTranslator::call(const std::string& word) {
  static const std::map<std::string, std::string> known{
      {"fabs", "ABS($x)"},
      {"sqrt", "SQRT($x)"},
      {"exp", "EXP($x)"},
      {"pow", "EXPT($x)"},
      {"sin", "SIN($x)"},
      {"cos", "COS($x)"},
      {"tan", "TAN($x)"},
      {"atan", "ATAN($x)"},
      {"round", ""},
      {"ceil", ""},
      {"cbrt", "EXPT($x, 1.0 / 3.0)"},
      {"expm1", "(EXP($x) - 1.0)"},
      {"tanh", "(1.0 - (2.0 / (EXP(2.0 * $x) + 1.0)))"}};
  const std::string stem = word.back() == 'f' ? word.substr(0, word.size() - 1) : word;
  const auto found = known.find(stem);
  const auto own = functions_.find(word);
  if (own == functions_.end() && found == known.end()) fail("'" + word + "' is not known");
  if (!error.empty()) return {};
  Value value{own != functions_.end() ? own->second.name + "(" : "", "", false, true};
  std::size_t i = 0;
  for (; error.empty() && !take(")"); ++i) {
    const Value given = expression();
    value.text += i > 0 ? ", " : "";
    value.lazy = value.lazy || given.lazy;
    if (own == functions_.end()) {
      value.type = given.type;
    } else if (i < own->second.parameters.size()) {
      const Variable& one = own->second.parameters[i];
      value.text += one.name + " := ";
      value.lazy = value.lazy || (one.by_reference && !one.is_constant);
      value.by_reference = value.by_reference || one.by_reference;
      if (one.type != given.type) fail("another type of " + one.name + " of " + word);
    }
    value.text += argument(given);
    (void)take(",");
  }
  if (own == functions_.end()) {
    const std::string& as = found->second;
    value.text = as.empty() ? rounding(stem) + "(x := " + value.text + ")"
                            : filled(as, {{"$x", value.text}});
    return value;
  }
  if (i != own->second.parameters.size()) fail("a call of " + word);
  function_.calls.insert(word);
  value.text += ")";
  value.type = own->second.type;
  return value;
}

ESOKIT_FUNCTION std::string StTranslator::rounding(const std::string& stem) {
  const std::string word = "$" + stem;  // no name of C
  function_.calls.insert(word);
  if (!has(word)) order_.push_back(word);
  functions_[word].name = name_ + "_" + stem;
  functions_[word].text = filled(
      "FUNCTION $f : $REAL\nVAR_INPUT\n  x : $REAL;\nEND_VAR\nVAR\n  size : $REAL;\n"
      "  whole : $REAL;\nEND_VAR\n"
      "  size := ABS(x);\n  IF NOT (size < $W) THEN\n"
      "    $f := x; (* it has no fraction *)\n    RETURN;\n  END_IF;\n"
      "  whole := (size + $W) - $W; (* a half to an even number *)\n"
      "  IF $UP THEN\n    whole := whole + 1.0;\n  END_IF;\n"
      "  $f := SEL(x < 0.0, whole, -whole);\nEND_FUNCTION\n\n",
      {{"$f", name_ + "_" + stem},
       {"$REAL", real_},
       {"$W", real_ == "REAL" ? "8388608.0" : "4503599627370496.0"},
       {"$UP", stem == "ceil" ? "whole < size" : "size - whole >= 0.5"}});
  return functions_[word].name;
}

ESOKIT_FUNCTION std::string StTranslator::scaled(double value) {
  const bool up = (std::abs)(value) > 1;
  std::string by;
  for (; (std::abs)(value) > 1e37 || (value != 0 && (std::abs)(value) < 1e-37);
       value *= up ? 0x1p-126 : 0x1p126) {
    by += up ? " * 8.507059173023462E+37" : " * 1.1754943508222875E-38";
  }
  const std::string text = number(ListWriter(c_language, false).number(value));
  return by.empty() ? text : "(" + text + by + ")";
}

ESOKIT_FUNCTION std::string StTranslator::bare(const Value& value) {
  const std::string& text = value.text;
  if (text.size() < 2 || text.front() != '(' || text.back() != ')' || text[1] == '*') return text;
  int deep = 0;
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    deep += text[i] == '(' ? 1 : text[i] == ')' ? -1 : 0;
    if (deep == 0) return text;
  }
  return text.substr(1, text.size() - 2);
}

}  // namespace esokit::detail
