/// @file
/// Columns of numbers from any CSV file, with errors that say where.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/csv.hpp"

namespace practice {

/// A problem with a file or the command line; what() is for the user.
struct LogError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The wanted columns of a CSV file. A first line with a field that is no number is a header.
/// Columns are named by it, or by their number from 1.
class LogFile {
 public:
  /// @param separator ',' ';' '\t' or ' '; 0: the first of these (but ' ') that line 1 contains
  LogFile(const std::filesystem::path& file, const std::vector<std::string>& wanted,
          char separator = 0) {
    std::error_code ignored;
    if (std::filesystem::is_directory(file, ignored)) {
      throw LogError(file.string() + " is a folder");
    }
    const auto bytes = std::filesystem::file_size(file, ignored);
    std::ifstream stream(file, std::ios::binary);
    if (!stream) throw LogError("cannot read " + file.string());
    std::string line;
    std::vector<std::string_view> fields;
    std::vector<std::size_t> places;
    std::size_t number = 0;
    std::size_t read = 0;
    std::size_t shown = 0;
    columns_.resize(wanted.size());
    while (std::getline(stream, line)) {
      ++number;
      read += line.size() + 1;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
      if (line.find_first_not_of(" \t,;") == std::string::npos) continue;
      if (separator == 0) separator = guess_separator(line);
      split(line, separator, fields);
      if (places.empty() && columns_[0].empty() && !all_numbers(fields)) {
        for (const auto& field : fields) header_.emplace_back(field);
        places = find_columns(file, wanted);
        continue;
      }
      if (places.empty()) places = find_columns(file, wanted, fields.size());
      for (std::size_t i = 0; i < places.size(); ++i) {
        columns_[i].push_back(value(file, number, fields, places[i], wanted[i]));
      }
      lines_.push_back(number);
      if (read >= shown + 64'000'000) {
        shown = read;
        std::fprintf(stderr, "reading %s: %3.0f %%\n", file.filename().c_str(),
                     100.0 * static_cast<double>(read) / static_cast<double>(bytes));
      }
    }
    if (lines_.empty()) throw LogError(file.string() + ": no line with numbers");
  }

  [[nodiscard]] const std::vector<double>& column(std::size_t i) const { return columns_[i]; }
  [[nodiscard]] std::size_t rows() const { return lines_.size(); }
  /// Line of the file that a row came from.
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_[row]; }

 private:
  static char guess_separator(const std::string& line) {
    for (const char c : {';', '\t', ','}) {
      if (line.find(c) != std::string::npos) return c;
    }
    return ' ';
  }

  static std::string_view trimmed(std::string_view text) {
    const auto from = text.find_first_not_of(" \t\"");
    if (from == std::string_view::npos) return {};
    return text.substr(from, text.find_last_not_of(" \t\"") - from + 1);
  }

  static void split(std::string_view line, char separator, std::vector<std::string_view>& fields) {
    fields.clear();
    while (true) {
      if (separator == ' ') {
        const auto from = line.find_first_not_of(' ');
        if (from == std::string_view::npos) return;
        line.remove_prefix(from);
      }
      // A separator within quotation marks separates nothing.
      const auto first = line.find_first_not_of(' ');
      const bool quoted = first != std::string_view::npos && line[first] == '"';
      const auto closing = quoted ? line.find('"', first + 1) : std::string_view::npos;
      const auto end = line.find(separator, closing == std::string_view::npos ? 0 : closing);
      fields.push_back(trimmed(line.substr(0, end)));
      if (end == std::string_view::npos) return;
      line.remove_prefix(end + 1);
    }
  }

  /// A number, or NaN for an empty field and the usual words for one that is missing.
  static std::optional<double> parse(std::string_view text) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    if (text.empty() || text == "nan" || text == "NaN" || text == "NAN" || text == "NA") return nan;
    if (text.front() == '+') text.remove_prefix(1);
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (end != text.data() + text.size()) return std::nullopt;
    // Too small or too large for a double is a number nevertheless: zero or infinite.
    if (error == std::errc::result_out_of_range)
      return std::strtod(std::string(text).c_str(), nullptr);
    if (error != std::errc{}) return std::nullopt;
    return number;
  }

  static bool all_numbers(const std::vector<std::string_view>& fields) {
    return std::all_of(fields.begin(), fields.end(),
                       [](std::string_view field) { return parse(field).has_value(); });
  }

  [[nodiscard]] std::vector<std::size_t> find_columns(const std::filesystem::path& file,
                                                      const std::vector<std::string>& wanted,
                                                      std::size_t count = 0) const {
    if (!header_.empty()) count = header_.size();
    std::vector<std::size_t> places;
    for (const std::string& name : wanted) {
      const auto at = std::find(header_.begin(), header_.end(), name);
      if (at != header_.end()) {
        places.push_back(static_cast<std::size_t>(at - header_.begin()));
        continue;
      }
      std::size_t number = 0;
      const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
      if (error == std::errc{} && end == name.data() + name.size() && number >= 1 &&
          number <= count) {
        places.push_back(number - 1);
        continue;
      }
      std::string there;
      for (const std::string& column : header_) there += (there.empty() ? "" : ", ") + column;
      throw LogError(file.string() + ": no column '" + name + "'; there " +
                     (header_.empty() ? "is no header and are " + std::to_string(count) + " columns"
                                      : "are " + there));
    }
    return places;
  }

  static double value(const std::filesystem::path& file, std::size_t line,
                      const std::vector<std::string_view>& fields, std::size_t place,
                      const std::string& name) {
    const std::string where = file.string() + ", line " + std::to_string(line) + ": ";
    if (place >= fields.size()) {
      throw LogError(where + "only " + std::to_string(fields.size()) + " fields, none for '" +
                     name + "'");
    }
    if (const auto number = parse(fields[place])) return *number;
    throw LogError(where + "'" + std::string(fields[place]) + "' in column '" + name +
                   "' is not a number");
  }

  std::vector<std::string> header_;
  std::vector<std::vector<double>> columns_;
  std::vector<std::size_t> lines_;
};

/// Refuses times that do not rise; `lines` are of the file.
inline void check_time(const std::filesystem::path& file, const LogFile& log,
                       const std::vector<double>& time) {
  for (std::size_t i = 0; i < time.size(); ++i) {
    const std::string where = file.string() + ", line " + std::to_string(log.line(i)) + ": ";
    if (!std::isfinite(time[i])) throw LogError(where + "the time is missing");
    if (i > 0 && !(time[i] > time[i - 1])) {
      throw LogError(where + "time " + (time[i] < time[i - 1] ? "runs backwards" : "stands still") +
                     ", from " + esokit::examples::number_text(time[i - 1]) + " to " +
                     esokit::examples::number_text(time[i]) + " s");
    }
  }
}

/// The middle one of the steps of `time`, s.
[[nodiscard]] inline double median_step(const std::vector<double>& time) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  if (steps.empty()) throw LogError("a log of one sample has no sample time");
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace practice
