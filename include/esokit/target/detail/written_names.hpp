/// @file
/// Names that a user gives to a written text: which of them the languages and the text itself have.
#pragma once

#include <algorithm>
#include <cctype>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <set>
#include <string>

namespace esokit::detail {

/// The words of Structured Text in the second and third edition of IEC 61131-3: keywords,
/// elementary and generic types, standard functions and function blocks; and what common compilers
/// add.
/// @param word in any case @param in_lists also an operator of an instruction list, which a
/// compiler may take for one in Structured Text, too
[[nodiscard]] bool is_word_of_structured_text(std::string word, bool in_lists = false);

/// The identifiers in a text of C or Structured Text, without those in comments.
[[nodiscard]] std::set<std::string> identifiers_in(const std::string& text);

/// The place of the first character that is wrong in an identifier of C, from 1; 0: none is. An
/// empty name is wrong at 1.
[[nodiscard]] int wrong_place(const std::string& name);

/// Whether a comment leaves the one in which it stands: by a mark, also one that is put together by
/// a continued line. Such a line has a backslash or its trigraph at its end.
[[nodiscard]] bool leaves_comment(const std::string& comment);

/// Headers of C99, C11 and C23: of the same name, `name.h` would be taken for one.
[[nodiscard]] bool is_header_of_c(std::string name);

[[nodiscard]] bool has_small_letter(const std::string& name);

/// What begins the constants of a name: its capitals; of one with capitals the name itself, as
/// those are of another.
[[nodiscard]] std::string begin_of_constants(const std::string& name);

/// Whether names of the options are new in the text that is written with them.
/// @param write options -> the whole text, empty if it cannot be written
/// @param capitals_count false: `Update` is `update`, as in Structured Text
template <class V, class Write>
[[nodiscard]] Check<V> new_names(const CodeOptions& options, const Write& write,
                                 bool capitals_count = true) {
  const std::string begin = "esokit0", settings = "settings0";  // of nobody
  if (options.name == begin) return {};                         // it is asked for here
  CodeOptions as = options;
  as.name = begin;
  as.settings_name = settings;
  const auto in_case = [&](std::string word) {
    for (char& c : word) {
      if (!capitals_count) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    return word;
  };
  std::set<std::string> own, others;
  for (const std::string& each : identifiers_in(write(as))) {
    const std::string word = in_case(each);
    if (word.compare(0, begin.size() + 1, begin + "_") == 0) {
      own.insert(word.substr(begin.size()));
    } else {
      others.insert(word);
    }
  }
  const std::string name = in_case(options.name);
  const bool clashes = std::any_of(own.begin(), own.end(), [&](const std::string& end) {
    return others.count(name + end) != 0;
  });
  return Rules<V>{}
      .demand(!clashes, "name", V(0),
              "is one that the text has already, before the same ending: take another one")
      .demand(!options.settings_in_struct ||
                  (own.count(in_case("_" + options.settings_name)) == 0 &&
                   (capitals_count || own.count(in_case("_set_" + options.settings_name)) == 0)),
              "settings_name", V(0),
              "is one that the text has already behind `name`: take another one");
}

/// The same of a function block, which bears the name alone, beside what it has inside.
/// @param write options -> Expected<std::string, ..>
template <class V, class Write>
[[nodiscard]] Check<V> new_names_in_block(const CodeOptions& options, const Write& write) {
  const std::string& given = options.name;
  if (is_word_of_structured_text(given, true) || given.back() == '_' ||
      given.find("__") != std::string::npos) {
    return Error<V>{"name", V(0),
                    "must be no word of Structured Text, without two _ or one at its end"};
  }
  bool alone = true;
  const auto ok = new_names<V>(
      options,
      [&](const CodeOptions& as) {
        const auto made = write(as);
        const std::string text = made ? *made : std::string();
        std::string name = options.name;
        const auto lower = [](std::string& word) {
          for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
        };
        lower(name);
        for (std::string word : identifiers_in(text)) {
          lower(word);
          alone = alone && word != name;
        }
        return text;
      },
      false);
  if (!ok) return ok.error();
  return Rules<V>{}.demand(alone, "name", V(0),
                           "is that of a variable in the block: take another one");
}

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/written_names.ipp>
#endif
