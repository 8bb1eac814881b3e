/// @file
/// The C that esokit writes, function by function as Structured Text.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <esokit/target/list_writer.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Translates C, in the narrow subset that to_c writes, into functions of Structured Text (IEC
/// 61131-3, second edition: no methods, no pointers). A pointer becomes VAR_IN_OUT, a count of any
/// width UDINT, a table a part of the state, a call in a condition a statement before it where C
/// would not always evaluate it. What is no part of the subset ends it: see `error`.
class StTranslator {
 public:
  /// @param text header and source, one after the other @param name before each function and type
  StTranslator(const std::string& text, std::string name) : name_(std::move(name)) {
    split(text);
    parse_file();
  }

  /// What it could not translate; empty: nothing.
  std::string error{};

  /// Whatever `body` calls is written, with all that these call.
  void write_for(const std::string& body) {
    for (auto& [word, function] : functions_) {
      if (body.find(function.name + "(") != std::string::npos) written(word);
    }
  }
  [[nodiscard]] bool has(const std::string& name) const { return functions_.count(name) != 0; }

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

  /// The types, then the functions in the order in which they are needed.
  [[nodiscard]] std::string text() const {
    std::string all;
    for (const std::string& type : order_of_structs_) {
      all += "TYPE " + type + " :\n  STRUCT\n";
      for (const Variable& field : structs_.at(type)) all += "    " + declared(field) + "\n";
      all += "  END_STRUCT;\nEND_TYPE\n\n";
    }
    std::string arrays;
    for (const int size : arrays_) {
      arrays += "TYPE " + array_name(size) + " : ARRAY[0.." + std::to_string(size - 1) + "] OF " +
                real_ + "; END_TYPE\n\n";
    }
    return arrays + all + text_;
  }

  /// A function that gives the settings that the type begins with. @param as behind its name
  [[nodiscard]] std::string settings(const std::string& as) const {
    const std::string name = name_ + "_set_" + as;
    std::string text =
        "FUNCTION " + name + " : BOOL\nVAR_IN_OUT\n  settings : " + name_ + "_settings;\nEND_VAR\n";
    for (const Variable& field : structs_.at(name_ + "_settings")) {
      std::size_t at = 0;
      std::size_t place = 0;
      do {
        const std::size_t end = field.initial.find(',', at);
        text += "  settings." + field.name;
        if (!field.sizes.empty()) {
          const auto row = static_cast<std::size_t>(field.sizes.back());
          text += "[" + std::to_string(place / row) + ", " + std::to_string(place % row) + "]";
        }
        text += " := " + field.initial.substr(at, end - at) + ";\n";
        at = end + 2;
        ++place;
      } while (at != std::string::npos + 2);
    }
    return text + "  " + name + " := TRUE;\nEND_FUNCTION\n\n";
  }

  /// Words of Structured Text may not be names. @param word in any case
  [[nodiscard]] static bool is_taken(std::string word) {
    static const std::string taken =
        " and any array at by byte case concat const constant cos date delete dint div do dt dword "
        "else elsif end eq exit exp expt false find for from function ge gt if insert int le left "
        "len limit lint ln log lreal lt lword max mid min mod move mul mux ne not of on or program "
        "read real repeat replace retain return right rol ror sel shl shr sin sint sqrt step "
        "string struct sub tan task then time to tod true trunc type udint uint until usint var "
        "while with word wstring xor abs add ";
    for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return taken.find(" " + word + " ") != std::string::npos;
  }
  [[nodiscard]] static std::string name_of(const std::string& word) {
    return is_taken(word) ? "the_" + word : word;
  }
  /// One of C.
  static std::string number(std::string text) {
    if (text.compare(0, 2, "0x") == 0) {
      return std::to_string(std::strtoull(text.c_str(), nullptr, 16));
    }
    if (!text.empty() && (text.back() == 'u' || text.back() == 'f')) text.pop_back();
    const std::size_t power = text.find('e');
    if (power != std::string::npos) text[power] = 'E';
    return text;
  }

 private:
  struct Token {
    std::string text;
    bool is_comment;
    bool same_line;  ///< as the one before
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
    std::string name;
    std::string type;
    std::string comment{};
    std::vector<Variable> parameters{};
    std::size_t body = 0;
    bool changes = false;  ///< something that it is given
    bool done = false;
  };
  struct Line {
    int depth;
    std::string text;
  };
  struct Value {
    std::string text;
    std::string type{};
    bool changes = false;    ///< what it calls changes something
    bool guarded = false;    ///< may be evaluated only where it is chosen: an index, a difference
    bool is_simple = false;  ///< needs no parentheses
    std::vector<int> sizes{};
    bool by_reference = false;  ///< of a function with VAR_IN_OUT
  };

  // ---- Tokens.

  void split(const std::string& text) {
    static const char* const signs[] = {
        "->", "||", "&&", "==", "!=", "<=", ">=", "++", "--", "|=", ">>="};
    bool same_line = false;
    for (std::size_t i = 0; i < text.size();) {
      const char c = text[i];
      if (c == '\n') same_line = false;
      if (std::isspace(static_cast<unsigned char>(c)) != 0) {
        ++i;
        continue;
      }
      std::size_t length = 1;
      bool is_comment = false;
      if (c == '#') {
        length = text.find('\n', i) - i;
        define(text.substr(i, length));
        i += length;
        continue;
      }
      if (text.compare(i, 2, "/*") == 0) {
        length = text.find("*/", i) + 2 - i;
        is_comment = true;
      } else if (c == '"') {
        length = text.find('"', i + 1) + 1 - i;
      } else if (is_of_word(c)) {
        while (is_of_word(text[i + length]) || is_of_number(text, i, length)) ++length;
      } else {
        for (const std::string sign : signs) {
          if (text.compare(i, sign.size(), sign) == 0) length = sign.size();
        }
      }
      tokens_.push_back({text.substr(i, length), is_comment, same_line});
      same_line = true;
      i += length;
    }
  }
  static bool is_of_word(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  }
  /// A point, or the sign of an exponent.
  static bool is_of_number(const std::string& text, std::size_t from, std::size_t length) {
    const char c = text[from + length];
    if (std::isdigit(static_cast<unsigned char>(text[from])) == 0) return false;
    return c == '.' || ((c == '+' || c == '-') && text[from + length - 1] == 'e');
  }
  /// `#define NAME 1u`, with what is said of it.
  void define(const std::string& line) {
    if (line.compare(0, 8, "#define ") != 0) return;
    const std::size_t at = line.find(' ', 8);
    if (at == std::string::npos) return;
    const std::size_t end = line.find(' ', at + 1);
    defined_[line.substr(8, at - 8)] = number(line.substr(at + 1, end - at - 1));
  }

  [[nodiscard]] const std::string& peek(std::size_t ahead = 0) {
    static const std::string none{};
    skip_comments();
    std::size_t i = at_;
    for (; ahead > 0 && i < tokens_.size(); --ahead) {
      ++i;
      while (i < tokens_.size() && tokens_[i].is_comment) ++i;
    }
    return i < tokens_.size() ? tokens_[i].text : none;
  }
  /// Comments before what is next belong to it, those behind what was last to that.
  void skip_comments() {
    for (; at_ < tokens_.size() && tokens_[at_].is_comment; ++at_) {
      const std::string comment = in_words(tokens_[at_].text);
      if (tokens_[at_].same_line && !lines_.empty() && keeps_comments_) {
        lines_.back().text += " " + comment;
      } else {
        comment_ += (comment_.empty() ? "" : "\n") + comment;
      }
    }
  }
  static std::string in_words(const std::string& comment) {
    std::string text = comment.substr(2, comment.size() - 4);
    for (std::size_t at = 0; (at = text.find("\n", at)) != std::string::npos; ++at) {
      while (at + 1 < text.size() && (text[at + 1] == ' ' || text[at + 1] == '*')) {
        text.erase(at + 1, 1);
      }
      text.insert(at + 1, "   ");
    }
    return "(*" + text + "*)";
  }
  std::string next() {
    const std::string token = peek();
    if (at_ < tokens_.size()) ++at_;
    return token;
  }
  bool take(const std::string& token) {
    if (peek() != token) return false;
    ++at_;
    return true;
  }
  void expect(const std::string& token) {
    if (!take(token)) fail("'" + token + "' expected, not '" + peek() + "'");
  }
  void fail(const std::string& what) {
    if (error.empty()) error = what + (where_.empty() ? "" : " in " + where_);
    at_ = tokens_.size();
  }

  // ---- Types and names.

  [[nodiscard]] static const std::map<std::string, std::string>& scalars() {
    static const std::map<std::string, std::string> all{
        {"bool", "BOOL"},      {"double", "LREAL"},   {"float", "REAL"},    {"unsigned", "UDINT"},
        {"int", "UDINT"},      {"uint8_t", "UDINT"},  {"int32_t", "UDINT"}, {"uint16_t", "UDINT"},
        {"uint32_t", "UDINT"}, {"uint64_t", "UDINT"}, {"void", "BOOL"}};
    return all;
  }
  [[nodiscard]] bool is_type(const std::string& word) const {
    return scalars().count(word) != 0 || structs_.count(of_this(word)) != 0;
  }
  std::string type(const std::string& word) {
    const auto found = scalars().find(word);
    if (found == scalars().end()) return of_this(word);
    if (word == "double" || word == "float") {
      if (real_.empty()) real_ = found->second;
    }
    return found->second;
  }
  [[nodiscard]] std::string of_this(const std::string& word) const {
    return word.compare(0, name_.size() + 1, name_ + "_") == 0 ? word : name_ + "_" + word;
  }
  [[nodiscard]] std::string array_name(int size) const {
    return name_ + "_numbers_" + std::to_string(size);
  }
  [[nodiscard]] std::string declared(const Variable& variable) const {
    std::string text = variable.name + " : ";
    const bool named = variable.sizes.size() == 1 && variable.initial.empty();
    if (named && variable.type == real_) {
      text += array_name(variable.sizes[0]);
    } else if (!variable.sizes.empty()) {
      text += "ARRAY[";
      for (std::size_t i = 0; i < variable.sizes.size(); ++i) {
        text += (i > 0 ? ", 0.." : "0..") + std::to_string(variable.sizes[i] - 1);
      }
      text += "] OF " + variable.type;
    } else {
      text += variable.type;
    }
    if (!variable.initial.empty()) {
      text += " := " + (variable.sizes.empty() ? variable.initial : "[" + variable.initial + "]");
    }
    return text + ";" + (variable.comment.empty() ? "" : " " + variable.comment);
  }

  /// To the line of others of its type.
  void add_declared(std::string& lines, const Variable& variable) const {
    const std::string line = declared(variable);
    const std::string kind = line.substr(variable.name.size());
    const std::size_t at = lines.rfind("\n  ");
    const std::size_t last = at == std::string::npos ? 0 : at + 1;
    const std::size_t from = lines.size() < kind.size() + 1 ? 0 : lines.size() - kind.size() - 1;
    if (lines.size() > last && lines.compare(from, std::string::npos, kind + "\n") == 0 &&
        lines.size() - last + variable.name.size() < 90) {
      lines.insert(from, ", " + variable.name);
    } else {
      lines += "  " + line + "\n";
    }
  }

  // ---- The file.

  void parse_file() {
    while (!peek().empty() && error.empty()) {
      if (take("extern")) {
        if (take("\"C\"")) {
          expect("{");
        } else {
          while (error.empty() && !take(";")) ++at_;
        }
      } else if (take("typedef")) {
        parse_struct();
      } else if (!take("}")) {
        parse_item();
      }
    }
    at_ = 0;
  }
  void parse_struct() {
    expect("struct");
    expect("{");
    std::vector<Variable> fields;
    keeps_comments_ = true;
    while (error.empty() && peek() != "}") {
      lines_.clear();
      fields.push_back(declarator());
      expect(";");
      lines_.push_back({0, ""});
      (void)peek();
      if (!lines_.back().text.empty()) fields.back().comment = lines_.back().text.substr(1);
    }
    keeps_comments_ = false;
    lines_.clear();
    comment_.clear();
    expect("}");
    const std::string name = of_this(next());
    structs_[name] = fields;
    order_of_structs_.push_back(name);
    expect(";");
  }
  /// `const double *name[2]`
  Variable declarator() {
    Variable one;
    one.is_constant = take("const");
    const std::string word = next();
    if (!is_type(word)) fail("'" + word + "' is no type");
    one.type = type(word);
    one.by_reference = take("*");
    one.name = name_of(next());
    while (take("[")) {
      one.sizes.push_back(std::atoi(next().c_str()));
      expect("]");
    }
    if (one.sizes.size() == 1 && one.type == real_) arrays_.insert(one.sizes[0]);
    return one;
  }
  void parse_item() {
    const std::string comment = comment_;
    comment_.clear();
    const bool is_static = take("static");
    (void)take("const");
    const std::string of_c = peek(1);  // the same as a word of Structured Text, perhaps
    Variable head = declarator();
    if (take("=")) {
      head.initial = initializer();
      expect(";");
      if (structs_.count(head.type) != 0) {
        take_settings(head);
      } else {
        add_table(head);
      }
      return;
    }
    expect("(");
    Function function{of_this(of_c), head.type, comment};
    while (error.empty() && !take(")")) {
      if (take("void")) continue;
      Variable one = declarator();
      const bool whole = one.by_reference && one.is_constant && one.type != name_ + "_state";
      one.by_reference = (one.by_reference && !whole) || !one.sizes.empty();
      function.changes = function.changes || (one.by_reference && !one.is_constant);
      function.parameters.push_back(one);
      (void)take(",");
    }
    if (take(";")) return;
    comment_.clear();
    function.body = at_ + 1;
    int depth = 0;
    do {
      depth += peek() == "{" ? 1 : peek() == "}" ? -1 : 0;
      ++at_;
    } while (depth > 0 && at_ < tokens_.size());
    comment_.clear();
    // A function of the file and one that it gives to others: the first is what does it.
    if (!is_static && functions_.count(short_of(function.name)) != 0) return;
    functions_[of_c] = function;
  }
  [[nodiscard]] std::string short_of(const std::string& name) const {
    return name.substr(name_.size() + 1);
  }
  std::string initializer() {
    std::string text;
    int depth = 0;
    do {
      if (take("{")) {
        ++depth;
      } else if (take("}")) {
        --depth;
      } else if (take(",")) {
      } else {
        const bool negative = take("-");
        text += (text.empty() ? "" : ", ") + std::string(negative ? "-" : "") + number(next());
      }
    } while (depth > 0 && error.empty());
    comment_.clear();
    return text;
  }
  /// The settings of the design are what its type begins with.
  void take_settings(const Variable& set) {
    sets_.insert(set.name);
    std::size_t at = 0;
    for (Variable& field : structs_[set.type]) {
      std::size_t count = 1;
      for (const int size : field.sizes) count *= static_cast<std::size_t>(size);
      std::size_t end = at;
      for (; count > 0 && end != std::string::npos; --count) {
        end = set.initial.find(',', end + (end > at ? 1 : 0));
      }
      field.initial = set.initial.substr(at, end - at);
      at = end + 2;
    }
  }
  /// A table of the file, or of a function with a state, lies in the state.
  void add_table(Variable table) {
    auto& fields = structs_[name_ + "_state"];
    for (const Variable& field : fields) {
      if (field.name != table.name) continue;
      if (field.initial != table.initial) fail("two tables of one name");
      return;
    }
    if (table.sizes.size() == 1) arrays_.erase(table.sizes[0]);
    tables_.insert(table.name);
    fields.push_back(std::move(table));
  }

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

  void line(const std::string& text) {
    if (!comment_.empty()) {
      std::string comment;
      comment.swap(comment_);
      lines_.push_back({depth_, comment});
    }
    lines_.push_back({depth_, text});
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
        const double size = std::abs(value);
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
    const bool up = std::abs(value) > 1;
    const double by = up ? 0x1p-126 : 0x1p126;
    int times = 0;
    for (; std::abs(value) > 1e37 || std::abs(value) < 1e-37; ++times) value *= by;
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

  std::string name_;
  std::string real_{};
  std::string text_{};
  std::vector<Token> tokens_{};
  std::size_t at_ = 0;
  std::map<std::string, std::string> defined_{};
  std::map<std::string, std::vector<Variable>> structs_{};
  std::vector<std::string> order_of_structs_{};
  std::map<std::string, Function> functions_{};
  std::set<std::string> tables_{};
  std::set<std::string> sets_{};
  std::set<std::string> helpers_{};
  std::set<int> arrays_{};
  // Of the function at hand.
  std::string where_{};
  std::string function_{};
  std::string type_{};
  std::string comment_{};
  bool keeps_comments_ = false;
  int depth_ = 0;
  int temporaries_ = 0;
  std::vector<Line> lines_{};
  std::vector<Variable> locals_{};
  std::map<std::string, std::pair<std::string, std::string>> rows_{};
  std::vector<std::string> calls_{};
};

}  // namespace esokit::detail
