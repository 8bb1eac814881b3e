/// @file
/// The C that esokit writes, read: its types and where its functions are.
#pragma once

#include <cctype>
#include <cstddef>
#include <cstdlib>
#include <esokit/target/list_writer.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Reads the C that to_c writes, and declares its types and tables in Structured Text. See
/// StTranslator.
class StFile {
 public:
  /// What could not be translated; empty: nothing.
  std::string error{};

  [[nodiscard]] bool has(const std::string& name) const { return functions_.count(name) != 0; }

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

 protected:
  /// @param text header and source, one after the other @param name before each function and type
  StFile(const std::string& text, std::string name) : name_(std::move(name)) {
    split(text);
    parse_file();
  }

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
  std::set<int> arrays_{};
  std::string where_{};  ///< what is read
  std::string comment_{};
  bool keeps_comments_ = false;
  std::vector<Line> lines_{};
};

}  // namespace esokit::detail
