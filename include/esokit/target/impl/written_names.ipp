#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <set>
#include <string>
#include <string_view>

namespace esokit::detail {

ESOKIT_FUNCTION bool is_word_of_structured_text(std::string word, bool in_lists) {
  static const std::set<std::string, std::less<>> words = [] {
    // clang-format off
    constexpr std::string_view all =
        // Keywords of both editions.
        "abstract action any array at by case class configuration constant continue do else elsif "
        "end_action end_case end_class end_configuration end_for end_function end_function_block "
        "end_if end_interface end_method end_namespace end_program end_repeat end_resource end_step "
        "end_struct end_transition end_type end_var end_while exit extends f_edge false final for "
        "from function function_block if implements initial_step int interface internal interval "
        "method mod namespace non_retain not null of on or overlap override priority private program "
        "protected public r_edge read_only read_write ref ref_to repeat resource retain return "
        "single step string struct super task then this to transition true type until using var "
        "var_access var_config var_external var_global var_in_out var_input var_output var_temp "
        "while with xor and "
        // Types.
        "bool byte word dword lword sint int dint lint usint uint udint ulint real lreal time ltime "
        "date ldate tod ltod time_of_day ltime_of_day dt ldt date_and_time ldate_and_time char wchar "
        "string wstring any_derived any_elementary any_magnitude any_num any_real any_int "
        "any_unsigned any_signed any_duration any_bit any_chars any_string any_char any_date "
        "add sub mul div gt ge eq ne le lt "
        // Standard functions.
        "abs sqrt ln log exp sin cos tan asin acos atan atan2 expt move shl shr ror rol sel max min "
        "limit mux trunc trunc_int round len left right mid concat insert delete replace find "
        "concat_date_tod concat_date_ltod concat_dt concat_ldt concat_date concat_tod concat_ltod "
        "split_date split_tod split_ltod split_dt split_ldt day_of_week to_big_endian "
        "to_little_endian from_big_endian from_little_endian is_valid is_valid_bcd upper_bound "
        "lower_bound add_time add_ltime add_tod_time add_ltod_ltime add_dt_time add_ldt_ltime "
        "sub_time sub_ltime sub_date_date sub_ldate_ldate sub_tod_time sub_ltod_ltime sub_tod_tod "
        "sub_ltod_ltod sub_dt_time sub_ldt_ltime sub_dt_dt sub_ldt_ldt mul_time mul_ltime multime "
        "mul_real mul_ltime div_time div_ltime divtime "
        // Standard function blocks.
        "sr rs semaphore r_trig f_trig ctu ctd ctud ctu_dint ctu_lint ctu_udint ctu_ulint ctd_dint "
        "ctd_lint ctd_udint ctd_ulint ctud_dint ctud_lint ctud_udint ctud_ulint tp ton tof tp_time "
        "ton_time tof_time tp_ltime ton_ltime tof_ltime rtc en eno "
        // Of compilers: CODESYS, TwinCAT, TIA.
        "pointer reference adr sizeof bitadr adrinst ini goto label region end_region property "
        "end_property get set var_stat var_inst var_generic persistent bit xint uxint xword pvoid "
        "and_then or_else __try __catch __finally __endtry __new __delete __isvalidref ";
    // clang-format on
    std::set<std::string, std::less<>> made;
    for (std::size_t at = 0; at < all.size();) {
      const std::size_t end = all.find(' ', at);
      made.emplace(all.substr(at, end - at));
      at = end + 1;
    }
    return made;
  }();
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (words.count(word) != 0) return true;
  if (in_lists) {
    for (const char* one : {"ld", "ldn", "st", "stn", "s", "r", "andn", "orn", "xorn", "jmp",
                            "jmpc", "jmpcn", "cal", "calc", "calcn", "ret", "retc", "retcn"}) {
      if (word == one) return true;
    }
  }
  // int_to_real, real_to_string, ..; trunc_.., to_..: conversions of a type.
  static const std::set<std::string, std::less<>> types = {
      "bool",  "byte",   "word",    "dword", "lword",         "sint",       "int",   "dint",
      "lint",  "usint",  "uint",    "udint", "ulint",         "real",       "lreal", "time",
      "ltime", "date",   "ldate",   "tod",   "ltod",          "dt",         "ldt",   "char",
      "wchar", "string", "wstring", "bcd",   "date_and_time", "time_of_day"};
  for (const char* middle : {"_to_", "_trunc_", "_bcd_to_"}) {
    const std::size_t at = word.find(middle);
    if (at != std::string::npos && types.count(word.substr(0, at)) != 0 &&
        (types.count(word.substr(at + std::string_view(middle).size())) != 0 ||
         word.substr(at + std::string_view(middle).size()).compare(0, 4, "bcd_") == 0)) {
      return true;
    }
  }
  for (const std::string_view begin : {"to_", "trunc_", "bcd_to_"}) {
    if (word.compare(0, begin.size(), begin) == 0 && types.count(word.substr(begin.size())) != 0) {
      return true;
    }
  }
  return false;
}

ESOKIT_FUNCTION std::set<std::string> identifiers_in(const std::string& text) {
  std::set<std::string> all;
  const auto inside = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  for (std::size_t at = 0; at < text.size();) {
    const bool of_c = text.compare(at, 2, "/*") == 0;
    if (of_c || text.compare(at, 2, "(*") == 0) {
      const std::size_t close = text.find(of_c ? "*/" : "*)", at + 2);
      at = close == std::string::npos ? text.size() : close + 2;
      continue;
    }
    std::size_t end = at;
    while (end < text.size() && inside(text[end])) ++end;
    if (end > at && std::isdigit(static_cast<unsigned char>(text[at])) == 0) {
      all.insert(text.substr(at, end - at));
    }
    at = (std::max)(end, at + 1);
  }
  return all;
}

ESOKIT_FUNCTION int wrong_place(const std::string& name) {
  const auto right = [&](std::size_t i) {
    const auto c = static_cast<unsigned char>(name[i]);
    return c < 128 && (std::isalpha(c) != 0 || c == '_' || (i > 0 && std::isdigit(c) != 0));
  };
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (!right(i)) return static_cast<int>(i) + 1;
  }
  return name.empty() ? 1 : 0;
}

ESOKIT_FUNCTION bool leaves_comment(const std::string& comment) {
  for (const char* mark : {"/*", "*/", "(*", "*)"}) {
    if (comment.find(mark) != std::string::npos) return true;
  }
  for (const std::string_view goes_on : {"\\", "?\?/"}) {
    for (std::size_t at = comment.find(goes_on); at != std::string::npos;
         at = comment.find(goes_on, at + 1)) {
      // GCC takes blanks before the end of the line for nothing.
      const std::size_t next = comment.find_first_not_of(" \t\r\v\f", at + goes_on.size());
      if (next == std::string::npos || comment[next] == '\n') return true;
    }
  }
  return comment.find('\0') != std::string::npos;
}

ESOKIT_FUNCTION bool is_header_of_c(std::string name) {
  static const std::set<std::string, std::less<>> headers = {
      "assert", "complex", "ctype",     "errno",  "fenv",   "float",    "inttypes", "iso646",
      "limits", "locale",  "math",      "setjmp", "signal", "stdalign", "stdarg",   "stdatomic",
      "stdbit", "stdbool", "stdckdint", "stddef", "stdint", "stdio",    "stdlib",   "stdnoreturn",
      "string", "tgmath",  "threads",   "time",   "uchar",  "wchar",    "wctype"};
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return headers.count(name) != 0;
}

ESOKIT_FUNCTION bool has_small_letter(const std::string& name) {
  return std::any_of(name.begin(), name.end(), [](char c) { return 'a' <= c && c <= 'z'; });
}

ESOKIT_FUNCTION std::string begin_of_constants(const std::string& name) {
  std::string upper = name;
  for (char& c : upper) {
    if ('A' <= c && c <= 'Z') return name;
    c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return upper;
}

}  // namespace esokit::detail
