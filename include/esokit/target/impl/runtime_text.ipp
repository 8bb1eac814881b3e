#pragma once

#include <cctype>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION RuntimeText::RuntimeText(const std::string& name, bool single)
    : writer_(c_language, single), name_(name) {
  upper_ = begin_of_constants(name);
  replace("real", single ? "float" : "double");
  replace("DESIGN_HEADER", "\"" + name + ".h\"");
  feature("ESOKIT_SINGLE", single);
  for (const char* one : {"fabs", "round", "sqrt", "ceil", "cbrt"}) {
    if (single) replace(one, std::string(one) + "f");
  }
}

ESOKIT_FUNCTION bool RuntimeText::has(std::string_view condition) const {
  const std::size_t either = condition.find(" || ");
  if (either != std::string_view::npos) {
    return has(condition.substr(0, either)) || has(condition.substr(either + 4));
  }
  const std::size_t both = condition.find(" && ");
  if (both != std::string_view::npos) {
    return has(condition.substr(0, both)) && has(condition.substr(both + 4));
  }
  return condition[0] == '!' ? !has(condition.substr(1)) : features_.count(condition) != 0;
}

ESOKIT_FUNCTION std::string RuntimeText::header(std::string_view file) {
  RuntimeText placed = *this;
  for (const auto& [name, value] : constants_) placed.replace(name, value);
  return placed.part(file);
}

ESOKIT_FUNCTION std::string RuntimeText::source(const std::vector<const char*>& files) {
  lines("DESIGN_CONSTANTS", "");
  std::string used;
  const std::string without = parts(files);
  for (const auto& [name, value] : constants_) {
    if (uses(without, name)) used += "#define " + name + " " + value + "\n";
  }
  lines("DESIGN_CONSTANTS", used.empty() ? used : used + "\n");
  return parts(files);
}

ESOKIT_FUNCTION std::string RuntimeText::parts(const std::vector<const char*>& files) {
  std::string text;
  for (const char* file : files) text += part(file);
  return text;
}

ESOKIT_FUNCTION std::string RuntimeText::part(std::string_view file) {
  const std::size_t begin = file.find("#endif\n") + 7;  // behind its wrapping for C++
  file = file.substr(begin, file.rfind("#ifdef __cplusplus\n") - begin);
  std::vector<Branch> branches{{true, true, true}};
  std::string text;
  in_comment_ = false;
  while (!file.empty()) {
    const std::string_view line = file.substr(0, file.find('\n'));
    file.remove_prefix(line.size() + 1);
    if (chooses(line, branches) || !branches.back().is_active) continue;
    const std::size_t first = line.find_first_not_of(' ');
    const auto found = lines_.find(first < line.size() ? line.substr(first) : line);
    if (found != lines_.end()) {
      text += found->second;
    } else if (begins(line, "#define ") && std::islower(static_cast<unsigned char>(line[8]))) {
      const std::size_t blank = line.find(' ', 8);
      replace(std::string(line.substr(8, blank - 8)), std::string(line.substr(blank + 1)));
    } else {
      text += named(line) + "\n";
    }
  }
  return text;
}

ESOKIT_FUNCTION bool RuntimeText::uses(std::string_view text, std::string_view word) {
  for (std::size_t at = 0; (at = text.find(word, at)) != text.npos; at += word.size()) {
    if (!is_letter(text[at - 1]) && !is_letter(text[at + word.size()])) return true;
  }
  return false;
}

ESOKIT_FUNCTION bool RuntimeText::chooses(std::string_view line,
                                          std::vector<Branch>& branches) const {
  const bool is_active = branches.back().is_active;
  if (begins(line, "#if ")) {
    const bool holds = is_active && has(line.substr(4));
    branches.push_back({true, holds, holds || !is_active});
    return true;
  }
  if (begins(line, "#if")) branches.push_back({false, is_active, true});
  const bool ends = begins(line, "#endif");
  if (!ends && !begins(line, "#el")) return false;
  Branch& branch = branches.back();
  const bool is_of_features = branch.is_of_features;
  if (ends) {
    branches.pop_back();
  } else if (is_of_features) {
    branch.is_active = !branch.was_taken && (!begins(line, "#elif") || has(line.substr(6)));
    branch.was_taken = branch.was_taken || branch.is_active;
  }
  return is_of_features;
}

ESOKIT_FUNCTION std::string RuntimeText::named(std::string_view line) {
  std::string out;
  for (std::size_t at = 0; at < line.size();) {
    if (line.substr(at, 2) == (in_comment_ ? "*/" : "/*")) in_comment_ = !in_comment_;
    std::size_t end = at;
    while (end < line.size() && is_letter(line[end])) ++end;
    if (end == at) {
      out += line[at++];
      continue;
    }
    const bool is_number = is_digit(line[at]);
    if (is_number && line.substr(end, 1) == "." && !in_comment_) {
      do ++end;
      while (end < line.size() && is_digit(line[end]));
    }
    const std::string word = std::string(line.substr(at, end - at));
    const bool has_point = word.find('.') != std::string::npos;
    out += is_number ? word + (has_point && writer_.single() ? "f" : "") : named_word(word);
    at = end;
  }
  return out;
}

ESOKIT_FUNCTION std::string RuntimeText::named_word(const std::string& word) const {
  if (const auto found = words_.find(word); found != words_.end()) return found->second;
  if (begins(word, "esokit_")) return name_ + word.substr(6);
  if (begins(word, "ESOKIT_")) return upper_ + word.substr(6);
  return word;
}

}  // namespace esokit::detail
