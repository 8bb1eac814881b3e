/// @file
/// Columns of numbers from CSV files as people have them, with errors that say where.
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
#include <utility>
#include <vector>

#include "common/csv.hpp"

namespace esokit::examples {

/// A problem with a file or the command line; what() is for the user.
struct LogError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The wanted columns of a CSV file. Lines that begin with # or % or // are comments; the first
/// line with a field that is no number is the header, or the last comment before the numbers if it
/// has as many fields. Columns are named by it, by what follows the last / or . of a name or by its
/// beginning where that is one column's alone, or by their number from 1. Where the separator is no
/// comma, a comma in a number is a decimal one.
class LogFile {
 public:
  /// Reads the header and the first row alone.
  explicit LogFile(const std::filesystem::path& file, char separator = 0)
      : file_(file), separator_(separator) {
    read({}, true);
  }

  /// @param separator ',' ';' '\t' '|' or ' '; 0: the first of ; tab | , that the header has, else
  ///        blanks
  LogFile(const std::filesystem::path& file, const std::vector<std::string>& wanted,
          char separator = 0)
      : file_(file), separator_(separator), columns_(wanted.size()) {
    read(wanted, false);
  }

  [[nodiscard]] const std::vector<double>& column(std::size_t i) const { return columns_[i]; }
  [[nodiscard]] std::size_t rows() const { return lines_.size(); }
  /// Line of the file that a row came from.
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_[row]; }
  /// Names of all columns of the file; none without a header.
  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  /// How many columns the file has.
  [[nodiscard]] std::size_t columns() const { return count_; }
  /// Full name of a wanted column: as in the header, else its number.
  [[nodiscard]] std::string name(std::size_t i) const {
    return header_.empty() ? std::to_string(places_[i] + 1) : header_[places_[i]];
  }
  /// "FILE, line 17: " of a row.
  [[nodiscard]] std::string where(std::size_t row) const { return at(lines_[row]); }
  /// Whether the last line was cut in the middle and left out.
  [[nodiscard]] bool cut() const { return cut_; }

 private:
  [[nodiscard]] std::string at(std::size_t line) const {
    return file_.string() + ", line " + std::to_string(line) + ": ";
  }

  void read(const std::vector<std::string>& wanted, bool header_only) {
    std::error_code ignored;
    if (std::filesystem::is_directory(file_, ignored)) {
      throw LogError(file_.string() + " is a folder");
    }
    const auto bytes = std::filesystem::file_size(file_, ignored);
    std::ifstream stream(file_, std::ios::binary);
    if (!stream) throw LogError("cannot read " + file_.string());
    std::string line, comment;
    std::vector<std::string_view> fields;
    std::size_t number = 0, read = 0, shown = 0;
    bool units = false;
    while (std::getline(stream, line)) {
      ++number;
      read += line.size() + 1;
      const bool whole = !stream.eof();
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
      if (line.find_first_not_of(" \t,;|") == std::string::npos) continue;
      if (const auto after = after_comment_mark(line)) {
        if (lines_.empty()) comment = line.substr(*after);
        continue;
      }
      if (separator_ == 0) separator_ = guess_separator(line);
      split(line, fields);
      if (places_.empty() && lines_.empty()) {
        if (header_.empty() && !all_numbers(fields)) {
          for (const auto& field : fields) header_.emplace_back(field);
          count_ = header_.size();
          continue;
        }
        // A line of units below the header.
        if (!header_.empty() && !units && no_numbers(fields)) {
          units = true;
          continue;
        }
        if (header_.empty()) take_comment(comment, fields.size());
        count_ = header_.empty() ? fields.size() : header_.size();
        if (header_only) return;
        for (const std::string& name : wanted) places_.push_back(find_column(name));
      }
      if (!whole && fields.size() < count_) {
        cut_ = true;
        break;
      }
      for (std::size_t i = 0; i < places_.size(); ++i) {
        columns_[i].push_back(value(number, fields, places_[i]));
      }
      lines_.push_back(number);
      if (read >= shown + 64'000'000) {
        shown = read;
        std::fprintf(stderr, "reading %s: %3.0f %%\n", file_.filename().c_str(),
                     100.0 * static_cast<double>(read) / static_cast<double>(bytes));
      }
    }
    if (lines_.empty()) throw LogError(file_.string() + ": no line with numbers");
  }

  /// Where the text of a comment starts.
  static std::optional<std::size_t> after_comment_mark(const std::string& line) {
    const auto from = line.find_first_not_of(" \t");
    const std::string_view text = std::string_view(line).substr(from);
    const bool slashes = text.starts_with("//");
    if (!slashes && text.front() != '#' && text.front() != '%') return std::nullopt;
    return std::min(line.size(), line.find_first_not_of("#%/ \t", from));
  }

  /// The names are often in the last comment before the numbers.
  void take_comment(const std::string& comment, std::size_t count) {
    std::vector<std::string_view> fields;
    if (comment.empty()) return;
    split(comment, fields);
    if (fields.size() != count || all_numbers(fields)) return;
    for (const auto& field : fields) header_.emplace_back(field);
  }

  static char guess_separator(const std::string& line) {
    for (const char c : {';', '\t', '|', ','}) {
      if (line.find(c) != std::string::npos) return c;
    }
    return ' ';
  }

  static std::string_view trimmed(std::string_view text) {
    const auto from = text.find_first_not_of(" \t\"");
    if (from == std::string_view::npos) return {};
    return text.substr(from, text.find_last_not_of(" \t\"") - from + 1);
  }

  void split(std::string_view line, std::vector<std::string_view>& fields) const {
    fields.clear();
    while (true) {
      if (separator_ == ' ') {
        const auto from = line.find_first_not_of(" \t");
        if (from == std::string_view::npos) return;
        line.remove_prefix(from);
      }
      // A separator within quotation marks separates nothing.
      const auto first = line.find_first_not_of(' ');
      const bool quoted = first != std::string_view::npos && line[first] == '"';
      const auto closing = quoted ? line.find('"', first + 1) : std::string_view::npos;
      const auto from = closing == std::string_view::npos ? 0 : closing;
      const auto end =
          separator_ == ' ' ? line.find_first_of(" \t", from) : line.find(separator_, from);
      fields.push_back(trimmed(line.substr(0, end)));
      if (end == std::string_view::npos) return;
      line.remove_prefix(end + 1);
    }
  }

  /// A number, or NaN for an empty field and the usual words for one that is missing.
  [[nodiscard]] std::optional<double> parse(std::string_view text) const {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    if (text.empty() || text == "nan" || text == "NaN" || text == "NAN" || text == "NA") return nan;
    if (text.front() == '+') text.remove_prefix(1);
    std::array<char, 64> point{};
    if (const auto comma = text.find(',');
        separator_ != ',' && comma != std::string_view::npos && text.size() < point.size()) {
      std::copy(text.begin(), text.end(), point.begin());
      point[comma] = '.';
      text = {point.data(), text.size()};
    }
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (end != text.data() + text.size()) return std::nullopt;
    // Too small or too large for a double is a number nevertheless: zero or infinite.
    if (error == std::errc::result_out_of_range)
      return std::strtod(std::string(text).c_str(), nullptr);
    if (error != std::errc{}) return std::nullopt;
    return number;
  }

  [[nodiscard]] bool all_numbers(const std::vector<std::string_view>& fields) const {
    return std::all_of(fields.begin(), fields.end(),
                       [&](std::string_view field) { return parse(field).has_value(); });
  }
  [[nodiscard]] bool no_numbers(const std::vector<std::string_view>& fields) const {
    return std::all_of(fields.begin(), fields.end(), [&](std::string_view field) {
      return field.empty() || !parse(field).has_value();
    });
  }

  [[nodiscard]] std::size_t find_column(const std::string& name) const {
    const auto exact = std::find(header_.begin(), header_.end(), name);
    if (exact != header_.end()) return static_cast<std::size_t>(exact - header_.begin());
    std::vector<std::size_t> ends;
    for (std::size_t i = 0; i < header_.size(); ++i) {
      const std::string& full = header_[i];
      if (full.size() > name.size() && full.ends_with(name) && !name.empty() &&
          (full[full.size() - name.size() - 1] == '/' ||
           full[full.size() - name.size() - 1] == '.')) {
        ends.push_back(i);
      }
    }
    if (ends.size() == 1) return ends[0];
    if (ends.size() > 1) {
      throw LogError(file_.string() + ": '" + name + "' is " + header_[ends[0]] + " and " +
                     header_[ends[1]]);
    }
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (error == std::errc{} && end == name.data() + name.size() && number >= 1 &&
        number <= count_) {
      return number - 1;
    }
    std::vector<std::size_t> begins;
    for (std::size_t i = 0; i < header_.size(); ++i) {
      if (!name.empty() && header_[i].starts_with(name)) begins.push_back(i);
    }
    if (begins.size() == 1) return begins[0];
    std::string there;
    for (const std::string& column : header_) there += (there.empty() ? "" : ", ") + column;
    throw LogError(file_.string() + ": no column '" + name + "'; there " +
                   (header_.empty() ? "is no header and are " + std::to_string(count_) + " columns"
                                    : "are " + there));
  }

  [[nodiscard]] double value(std::size_t line, const std::vector<std::string_view>& fields,
                             std::size_t place) const {
    const std::string column =
        header_.empty() ? std::to_string(place + 1) : "'" + header_[place] + "'";
    if (place >= fields.size()) {
      throw LogError(at(line) + "only " + std::to_string(fields.size()) + " fields, none for " +
                     column);
    }
    if (const auto number = parse(fields[place])) return *number;
    throw LogError(at(line) + "'" + std::string(fields[place]) + "' in column " + column +
                   " is not a number");
  }

  std::filesystem::path file_;
  char separator_;
  std::size_t count_ = 0;
  bool cut_ = false;
  std::vector<std::string> header_;
  std::vector<std::size_t> places_;
  std::vector<std::vector<double>> columns_;
  std::vector<std::size_t> lines_;
};

/// Refuses times that do not rise.
inline void check_time(const LogFile& log, const std::vector<double>& time) {
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!std::isfinite(time[i])) throw LogError(log.where(i) + "the time is missing");
    if (i > 0 && !(time[i] > time[i - 1])) {
      throw LogError(log.where(i) + "time " +
                     (time[i] < time[i - 1] ? "runs backwards" : "stands still") + ", from " +
                     number_text(time[i - 1]) + " to " + number_text(time[i]) + " s");
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

}  // namespace esokit::examples
