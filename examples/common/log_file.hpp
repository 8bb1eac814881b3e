/// @file
/// Columns of numbers from CSV files as people have them, with errors that say where.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <streambuf>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
#include <version>
#ifndef __wasi__  // a page in a browser has no files
#include <filesystem>
#include <fstream>
#endif

#include "common/csv.hpp"
#include "common/stamps.hpp"

namespace esokit::examples {

/// A problem with a file or the command line; what() is for the user.
struct LogError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A file, or its bytes where they are there already, as on a page in a browser.
class LogSource {
 public:
  /// @param bytes have to stay there for as long as they are read
  LogSource(std::string name, std::string_view bytes) : name_(std::move(name)), bytes_(bytes) {}

  /// Its path, for errors; its name without the folder.
  [[nodiscard]] const std::string& path() const { return name_; }
  [[nodiscard]] std::string file_name() const {
    return name_.substr(name_.find_last_of(separators) + 1);
  }

#ifndef __wasi__
  LogSource(const std::filesystem::path& file) : name_(file.string()), file_(file) {}

  [[nodiscard]] std::unique_ptr<std::streambuf> open() const {
    if (bytes_) return std::make_unique<Bytes>(*bytes_);
    std::error_code ignored;
    if (std::filesystem::is_directory(file_, ignored)) throw LogError(name_ + " is a folder");
    auto stream = std::make_unique<std::filebuf>();
    if (stream->open(file_, std::ios::in | std::ios::binary) == nullptr)
      throw LogError("cannot read " + name_);
    return stream;
  }
  [[nodiscard]] double size() const {
    std::error_code ignored;
    return bytes_ ? static_cast<double>(bytes_->size())
                  : static_cast<double>(std::filesystem::file_size(file_, ignored));
  }
#else
  [[nodiscard]] std::unique_ptr<std::streambuf> open() const {
    return std::make_unique<Bytes>(*bytes_);
  }
  [[nodiscard]] double size() const { return static_cast<double>(bytes_->size()); }
#endif

 private:
#ifdef _WIN32
  static constexpr const char* separators = "/\\:";
#else
  static constexpr const char* separators = "/";
#endif

  struct Bytes : std::streambuf {
    explicit Bytes(std::string_view bytes) {
      char* const first = const_cast<char*>(bytes.data());  // nobody writes to it
      setg(first, first, first + bytes.size());
    }
  };

  std::string name_;
  std::optional<std::string_view> bytes_;
#ifndef __wasi__
  std::filesystem::path file_;
#endif
};

/// As std::from_chars, which not every library has for numbers that are not whole.
template <class Number>
std::from_chars_result number_from_chars(const char* first, const char* last, Number& number) {
#ifdef __cpp_lib_to_chars
  return std::from_chars(first, last, number);
#else
  // Digits of a whole number that is exact, over or times a power of ten that is: rounded once.
  const char* at = first;
  const bool negative = at != last && *at == '-';
  if (negative) ++at;
  double whole = 0;
  int digits = 0, places = 0;
  bool point = false;
  for (;
       at != last && (point ? *at >= '0' && *at <= '9' : *at == '.' || (*at >= '0' && *at <= '9'));
       ++at) {
    if (*at == '.') {
      point = true;
      continue;
    }
    whole = 10 * whole + (*at - '0');
    ++digits;
    places += point ? 1 : 0;
  }
  if (at == last && digits > 0 && digits <= 15) {
    constexpr std::array tens = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
    whole /= tens[static_cast<std::size_t>(places)];
    if constexpr (sizeof(Number) > sizeof(double)) {
      if (places == 0) {
        number = negative ? -whole : whole;
        return {last, std::errc{}};
      }
    } else {
      number = negative ? -whole : whole;
      return {last, std::errc{}};
    }
  }
  // strto.. also takes blanks, a plus and hexadecimal digits.
  const std::string text(first, last);
  if (text.empty() || text.find_first_of(" \t\n\v\f\rxXpP+(") == 0 ||
      text.find_first_of("xXpP(") != std::string::npos)
    return {first, std::errc::invalid_argument};
  char* end = nullptr;
  if constexpr (sizeof(Number) > sizeof(double)) {
    number = std::strtold(text.c_str(), &end);
  } else {
    number = std::strtod(text.c_str(), &end);
  }
  return {first + (end - text.c_str()),
          end == text.c_str() ? std::errc::invalid_argument : std::errc{}};
#endif
}

/// The lines of a text file as UTF-8, whatever ends them: \n, \r\n or \r. With a byte order mark
/// the file may be UTF-16; what is no UTF-8 is taken for Latin-1.
class TextLines {
 public:
  explicit TextLines(const LogSource& file) : bytes_(file.open()) {
    const int first = bytes_->sgetc();
    if (first == 0xFF || first == 0xFE) {
      bytes_->sbumpc();
      const int second = bytes_->sbumpc();
      if (first + second != 0xFF + 0xFE) throw LogError(file.path() + " is not a text file");
      wide_ = first == 0xFF ? Wide::little : Wide::big;
    }
  }

  /// The next line, without its end; false after the last.
  bool next(std::string& line) {
    line.clear();
    whole_ = false;
    bool any = false;
    for (int c = character(); c >= 0; c = character()) {
      any = true;
      if (c == '\n' && after_return_) {
        after_return_ = false;
        any = false;
        continue;
      }
      after_return_ = c == '\r';
      if (c == '\n' || c == '\r') {
        whole_ = true;
        break;
      }
      if (wide_ == Wide::no) {
        line += static_cast<char>(c);
      } else {
        add(line, static_cast<unsigned>(c));
      }
    }
    if (any && number_++ == 0 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
    if (!is_utf8(line)) {
      std::string text;
      for (const char c : line) add(text, static_cast<unsigned char>(c));
      line = text;
    }
    return any;
  }
  /// Whether the line had an end.
  [[nodiscard]] bool whole() const { return whole_; }
  /// Of the line, from 1.
  [[nodiscard]] std::size_t number() const { return number_; }
  /// Bytes that were read.
  [[nodiscard]] std::size_t read() const { return read_; }

 private:
  enum class Wide { no, little, big };

  int byte() {
    const int c = bytes_->sbumpc();
    if (c >= 0) ++read_;
    return c;
  }
  int unit() {
    const int one = byte(), two = byte();
    if (two < 0) return -1;
    return wide_ == Wide::little ? one + 256 * two : 256 * one + two;
  }
  int character() {
    if (wide_ == Wide::no) return byte();
    const int high = unit();
    if (high < 0xD800 || high > 0xDBFF) return high;
    const int low = unit();
    return low < 0 ? -1 : 0x10000 + ((high & 0x3FF) << 10) + (low & 0x3FF);
  }

  static void add(std::string& text, unsigned c) {
    const auto put = [&](unsigned first, int more) {
      text += static_cast<char>(first | c >> (6 * more));
      while (more-- > 0) text += static_cast<char>(0x80U | (c >> (6 * more) & 0x3FU));
    };
    if (c < 0x80) {
      put(0, 0);
    } else if (c < 0x800) {
      put(0xC0, 1);
    } else if (c < 0x10000) {
      put(0xE0, 2);
    } else {
      put(0xF0, 3);
    }
  }
  static bool is_utf8(const std::string& text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
      const auto c = static_cast<unsigned char>(text[i]);
      if (c < 0x80) continue;
      int more = c >= 0xF0 && c < 0xF8 ? 3 : c >= 0xE0 ? 2 : c >= 0xC2 ? 1 : 0;
      if (more == 0 || c >= 0xF8) return false;
      for (; more > 0; --more) {
        if (++i == text.size() || (static_cast<unsigned char>(text[i]) & 0xC0U) != 0x80U)
          return false;
      }
    }
    return true;
  }

  std::unique_ptr<std::streambuf> bytes_;
  Wide wide_ = Wide::no;
  bool whole_ = false, after_return_ = false;
  std::size_t number_ = 0, read_ = 0;
};

/// The wanted columns of a CSV file. Lines that begin with # or % or // are comments. The numbers
/// begin where a line looks like those further down. Up to five lines directly above it name the
/// columns (names, units), or the last comment, or a label before each number (u:1.5, "u: 1.5 V",
/// u=1.5). Other lines between them are left out. Columns are named by them, by what follows the
/// last / or . of a name or by its beginning where that is one column's alone, or by their number
/// from 1 (@2: where a name is a number, too). Where the separator is no comma, a comma in a number
/// is a decimal one. A number may have a unit behind it, ON and true are 1. What may be read in two
/// ways is refused.
class LogFile {
 public:
  /// Reads the header and the first row alone.
  explicit LogFile(LogSource file, char separator = 0)
      : file_(std::move(file)), separator_(separator) {
    read({}, true);
  }

  /// @param separator ',' ';' '\t' '|' or ' '; 0: the one that makes most numbers of the lines
  /// @param stamps which of the wanted columns has time stamps, which then begin at zero
  LogFile(LogSource file, const std::vector<std::string>& wanted, char separator = 0,
          std::optional<std::size_t> stamps = std::nullopt)
      : file_(std::move(file)), separator_(separator), stamps_(stamps), columns_(wanted.size()) {
    read(wanted, false);
  }

  [[nodiscard]] const std::vector<double>& column(std::size_t i) const { return columns_[i]; }
  [[nodiscard]] std::size_t rows() const { return lines_.size(); }
  /// Line of the file that a row came from.
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_[row]; }
  /// The lines of names, a name for each column; none without a header.
  [[nodiscard]] const std::vector<std::vector<std::string>>& headers() const { return headers_; }
  /// How many columns the file has.
  [[nodiscard]] std::size_t columns() const { return count_; }
  /// Full name of a wanted column: as in the header, else its number.
  [[nodiscard]] std::string name(std::size_t i) const {
    return header_name(places_[i].header, places_[i].column);
  }
  /// What the lines of names below that of its name say of a wanted column: its unit, perhaps.
  [[nodiscard]] std::string below(std::size_t i) const {
    const std::size_t next = places_[i].header + 1;
    return next < headers_.size() ? header_name(next, places_[i].column) : "";
  }
  /// "FILE, line 17: " of a row.
  [[nodiscard]] std::string where(std::size_t row) const { return at(lines_[row]); }
  /// Where a wanted column is, from 1.
  [[nodiscard]] std::size_t place(std::size_t i) const { return places_[i].column + 1; }
  /// What stands behind the numbers of a wanted column: its unit.
  [[nodiscard]] const std::string& cell_unit(std::size_t i) const { return cells_[i].unit; }
  /// How many fields of a wanted column are words: ON, true, ERR.
  [[nodiscard]] std::size_t switched(std::size_t i) const { return cells_[i].switched; }
  [[nodiscard]] std::size_t failed(std::size_t i) const { return cells_[i].failed; }
  /// Lines without the labels of the others, which were left out.
  [[nodiscard]] std::size_t other_lines() const { return other_lines_; }
  /// Whether the last line was cut in the middle and left out.
  [[nodiscard]] bool cut() const { return cut_; }
  /// The stamps: whether they are numbers, and the first.
  [[nodiscard]] const StampReader& stamps() const { return reader_; }
  /// The names, in words, of many columns the first.
  [[nodiscard]] std::string there() const {
    if (headers_.empty()) return "numbers 1 to " + std::to_string(count_);
    constexpr std::size_t most = 16;
    std::string text;
    for (const auto& names : headers_) {
      if (!text.empty()) text += "; also called ";
      std::size_t shown = 0;
      for (std::size_t i = 0; i < names.size() && shown < most; ++i) {
        if (!names[i].empty()) text += (shown++ == 0 ? "" : ", ") + names[i];
      }
      if (names.size() > most) text += " and " + std::to_string(names.size() - most) + " more";
    }
    return text;
  }

 private:
  struct Place {
    std::size_t column = 0, header = 0;
  };
  struct Head {
    std::string text;
    std::size_t number = 0;
    bool comment = false, whole = false;
  };
  using Fields = std::vector<std::string_view>;

  [[nodiscard]] std::string at(std::size_t line) const {
    return file_.path() + ", line " + std::to_string(line) + ": ";
  }
  [[nodiscard]] std::string header_name(std::size_t header, std::size_t column) const {
    return header < headers_.size() && column < headers_[header].size()
               ? headers_[header][column]
               : std::to_string(column + 1);
  }

  void read(const std::vector<std::string>& wanted, bool header_only) {
    TextLines lines(file_);
    std::string line;
    const auto next = [&](Head& head) {
      while (lines.next(line)) {
        if (lines.number() == 1) packed_ = line.starts_with("PK") || line.starts_with("\x1f\x8b");
        if (line.find('\0') != std::string::npos) {
          if (lines.number() < 100 && packed_) {
            throw LogError(file_.path() +
                           ": it is packed (a workbook, a zip or gz file), no text: unpack it, or "
                           "save it as CSV");
          }
          throw LogError(at(lines.number()) +
                         "it has a zero byte: it is no text, or UTF-16 without its mark; save it "
                         "as UTF-8");
        }
        tidy(line);
        if (line.find_first_not_of(" \t,;|[]") == std::string::npos) continue;
        const auto after = after_comment_mark(line);
        head = {after ? line.substr(*after) : line, lines.number(), after.has_value(),
                lines.whole()};
        return true;
      }
      return false;
    };
    // What numbers, names and separators are the first lines say together.
    constexpr std::size_t ahead = 200;
    std::vector<Head> heads;
    std::size_t text_lines = 0;
    for (Head head; text_lines < ahead && next(head);) {
      text_lines += head.comment ? 0 : 1;
      heads.push_back(std::move(head));
    }
    const std::size_t begin = understand(heads);
    if (header_only) return;
    for (const std::string& name : wanted) places_.push_back(find_column(name));
    cells_.resize(wanted.size());
    std::size_t shown = 0;
    Fields fields;
    std::string too_short;  // said of a line that only the last one may be
    const auto take = [&](const Head& head) {
      if (head.comment) return;
      if (!too_short.empty()) throw LogError(too_short);
      split(head.text, separator_, fields);
      if (!labels_.empty() && std::all_of(fields.begin(), fields.end(),
                                          [](std::string_view field) { return field.empty(); })) {
        ++other_lines_;
        return;
      }
      if (fields.size() < count_) {
        const auto lost = std::find_if(places_.begin(), places_.end(), [&](const Place& place) {
          return place.column >= fields.size();
        });
        cut_ = !head.whole || lost != places_.end();
        if (cut_ && head.whole)
          too_short =
              lacking(head.number, fields, static_cast<std::size_t>(lost - places_.begin()));
        if (cut_) return;
      }
      check_count(head.number, fields);
      for (std::size_t i = 0; i < places_.size(); ++i) {
        columns_[i].push_back(value(head.number, fields, i));
      }
      lines_.push_back(head.number);
      if (lines.read() >= shown + 64'000'000) {
        shown = lines.read();
        std::fprintf(stderr, "reading %s: %3.0f %%\n", file_.file_name().c_str(),
                     100.0 * static_cast<double>(shown) / file_.size());
      }
    };
    for (std::size_t i = begin; i < heads.size(); ++i) take(heads[i]);
    for (Head head; next(head);) take(head);
    if (lines_.empty()) throw LogError(file_.path() + ": no line with numbers");
  }

  /// Finds separator, names, and where the numbers begin.
  std::size_t understand(const std::vector<Head>& heads) {
    std::vector<std::size_t> text;
    for (std::size_t i = 0; i < heads.size(); ++i) {
      if (!heads[i].comment) text.push_back(i);
    }
    if (text.empty()) throw LogError(file_.path() + ": no line with numbers");
    // The last third is numbers: no header is so long.
    const std::size_t body = text.size() - std::max<std::size_t>(1, text.size() / 3);
    if (separator_ == 0 || separator_ == ' ') {
      if (const auto begin = understand_labels(heads, text, body)) return *begin;
    }
    if (separator_ == 0) {
      int most = std::numeric_limits<int>::min();
      for (const char c : {';', '\t', '|', ',', ' '}) {
        const Shape shape = shape_of(heads, text, body, c);
        const int score = 10'000 * shape.numbers - std::min(shape.filled, 9'999);
        if (score > most) most = score, separator_ = c;
      }
    }
    const Shape shape = shape_of(heads, text, body, separator_);
    Fields fields;
    std::size_t first = 0;
    for (; first < text.size(); ++first) {
      split(heads[text[first]].text, separator_, fields);
      if (fields.size() >= shape.count && numbers_in(shape, fields) == Numbers::all) break;
    }
    if (first == text.size() || shape.numbers == 0) {
      throw LogError(file_.path() + ": no line with numbers; line " +
                     std::to_string(heads[text[0]].number) + " is '" +
                     heads[text[0]].text.substr(0, 60) + "'");
    }
    const std::size_t begin = text[first];
    const auto name_line = [&](const Head& head) {
      while (!fields.empty() && fields.back().empty()) fields.pop_back();
      if (!headers_.empty() && fields.size() != headers_[0].size()) return false;
      headers_.emplace(headers_.begin(), fields.begin(), fields.end());
      header_line_ = head.number;
      return headers_.size() < 5;
    };
    for (std::size_t i = first; i-- > 0;) {
      const Head& head = heads[text[i]];
      split(head.text, separator_, fields);
      const Numbers kind = numbers_in(shape, fields);
      const auto words = std::count_if(fields.begin(), fields.end(),
                                       [](std::string_view field) { return !field.empty(); });
      if (words < 2 && shape.count > 1) break;
      // A name may be a number, too. Below names it is a bad row.
      if (kind != Numbers::none && headers_.empty() && (i > 0 || kind == Numbers::all))
        refuse_row(head.number, shape, fields);
      if ((kind != Numbers::none && i > 0) || !name_line(head)) break;
    }
    if (headers_.empty()) {
      for (std::size_t i = begin; i-- > 0 && heads[i].comment;) {
        split(heads[i].text, separator_, fields);
        if (fields.size() == shape.count && !all_numbers(fields) && !name_line(heads[i])) break;
      }
    }
    split(heads[begin].text, separator_, fields);
    labelled_ = headers_.empty() && std::any_of(fields.begin(), fields.end(), [](auto field) {
                  return !label_of(field).empty();
                });
    if (labelled_) {
      headers_.emplace_back();
      for (const auto& field : fields)
        headers_[0].emplace_back(parse_stamp(field) ? "time" : label_of(field));
    }
    if (headers_.empty()) understand_words(heads, text, body, shape);
    count_ = headers_.empty() ? shape.count : headers_[0].size();
    if (!headers_.empty() && separator_ == ' ' && fields.size() != count_) {
      throw LogError(at(heads[begin].number) + "it has " + std::to_string(fields.size()) +
                     " fields, but line " + std::to_string(header_line_) + " has " +
                     std::to_string(count_) +
                     " names; between blanks a name must be one word, and each column has one");
    }
    return begin;
  }

  /// A label and what stands behind its colon or equals sign.
  struct Labelled {
    std::string_view label, value;
    bool apart = false;  ///< with a blank or an equals sign between them
  };
  /// The labels of a line: "sec: 0.29  out=64.00", {"t": 1}; before the first one a stamp or a
  /// number has none.
  static void labels_of(std::string_view line, std::vector<Labelled>& all) {
    constexpr std::string_view ends = " \t,;|{}[]\"'";
    all.clear();
    if (const auto arrow = line.find(" -> "); arrow != std::string_view::npos) {
      if (const auto stamp = trimmed(line.substr(0, arrow)); parse_stamp(stamp)) {
        all.push_back({{}, stamp, false});
        line.remove_prefix(arrow + 4);
      }
    }
    const auto in_number = [&](std::size_t i) {
      const auto digit = [&](std::size_t at) {
        return at < line.size() && line[at] >= '0' && line[at] <= '9';
      };
      return line[i] == ',' && i > 0 && digit(i - 1) && digit(i + 1);
    };
    for (std::size_t from = 0, i = 0; i < line.size(); ++i) {
      if (line[i] != ':' && line[i] != '=') continue;
      std::size_t end = i;
      while (end > from && (line[end - 1] == ' ' || line[end - 1] == '"' || line[end - 1] == '\''))
        --end;
      std::size_t begin = end;
      while (begin > from && ends.find(line[begin - 1]) == std::string_view::npos) --begin;
      const auto first = static_cast<unsigned char>(begin < end ? line[begin] : ' ');
      if (!(first > 127 || std::isalpha(first) != 0 || first == '_')) continue;
      if (all.empty() && begin > 0) {
        if (const auto stamp = stamp_before(line.substr(0, begin)); !stamp.empty())
          all.push_back({{}, stamp, false});
      }
      std::size_t value = i + 1;
      while (value < line.size() &&
             (line[value] == ' ' || line[value] == '\t' || line[value] == '"'))
        ++value;
      from = value;
      while (from < line.size() &&
             (ends.find(line[from]) == std::string_view::npos || in_number(from)))
        ++from;
      from = with_unit(line, value, from);
      // What is before another label is the name of a part of the program: "motor: u=0.5".
      const std::string_view text = line.substr(value, from - value);
      if (!text.empty() && std::isalpha(static_cast<unsigned char>(text[0])) != 0 &&
          text.find_first_of(":=") != std::string_view::npos) {
        from = value;
        continue;
      }
      all.push_back(
          {line.substr(begin, end - begin), text, line[i] == '=' || value > i + 1 || end < i});
      i = from > i ? from - 1 : i;
    }
  }

  /// The end of a number with its unit of time: "t: 100 ms u: 2", but not "t: 100 s: 2".
  static std::size_t with_unit(std::string_view line, std::size_t value, std::size_t end) {
    if (end >= line.size() || line[end] != ' ' || !is_number(line.substr(value, end - value)))
      return end;
    const std::size_t behind = std::min(line.find_first_of(" \t,;|:=", end + 1), line.size());
    const std::size_t next = line.find_first_not_of(' ', behind);
    const std::string_view unit = line.substr(end + 1, behind - end - 1);
    const bool time = unit == "s" || unit == "ms" || unit == "us" || unit == "min";
    const bool label = next != std::string_view::npos && (line[next] == ':' || line[next] == '=');
    return time && !label ? behind : end;
  }

  /// The stamp or number of a line before its labels: "12.5 u=1", "[12.5] u=1", "I (1234) motor:
  /// u=1", "2024-03-01 12:00:00,010 INFO u=1".
  static std::string_view stamp_before(std::string_view before) {
    const auto first = before.find_first_not_of(" \t,;|{}[]()\"'");
    if (first == std::string_view::npos) return {};
    const auto word_from = [&](std::size_t from) {
      return before.substr(from, before.find_first_of(" \t;|{}[]()\"'", from) - from);
    };
    std::string_view word = word_from(first);
    if (const auto second = before.find_first_not_of(' ', first + word.size());
        second != std::string_view::npos) {
      const auto both = before.substr(first, second - first + word_from(second).size());
      if (parse_stamp(both)) return both;
    }
    while (word.ends_with(',')) word.remove_suffix(1);
    if (is_number(word)) return word;
    const auto open = before.find_first_of("([", first);
    if (open == std::string_view::npos || before[open - 1] != ' ') return {};
    const auto inside = before.find_first_not_of(' ', open + 1);
    if (inside == std::string_view::npos) return {};
    word = word_from(inside);
    return !word.empty() && is_number(word) ? word : std::string_view{};
  }

  /// Lines of labels with blanks or equals signs, of which at least two have numbers.
  /// @return the first such line
  std::optional<std::size_t> understand_labels(const std::vector<Head>& heads,
                                               const std::vector<std::size_t>& text,
                                               std::size_t body) {
    std::vector<Labelled> found;
    std::vector<std::string> names;
    std::vector<std::size_t> seen, numbers;
    std::size_t apart = 0;
    for (std::size_t i = body; i < text.size(); ++i) {
      labels_of(heads[text[i]].text, found);
      for (const Labelled& one : found) {
        const auto at = static_cast<std::size_t>(std::find(names.begin(), names.end(), one.label) -
                                                 names.begin());
        if (at == names.size())
          names.emplace_back(one.label), seen.push_back(0), numbers.push_back(0);
        ++seen[at];
        numbers[at] += is_value(one.value) ? 1U : 0U;
        apart += one.apart ? 1U : 0U;
      }
    }
    const std::size_t lines = text.size() - body;
    std::size_t columns = 0;
    for (std::size_t c = 0; c < names.size(); ++c) {
      if (3 * seen[c] < 2 * lines || seen[c] > lines) continue;
      labels_.push_back(names[c]);
      columns += 2 * numbers[c] > seen[c] ? 1U : 0U;
    }
    if (columns < 2 || apart < lines) {
      labels_.clear();
      return std::nullopt;
    }
    separator_ = ' ';
    headers_.assign(1, labels_);
    for (auto& name : headers_[0]) {
      if (name.empty()) name = "time";
    }
    count_ = labels_.size();
    Fields fields;
    for (const std::size_t i : text) {
      split(heads[i].text, separator_, fields);
      if (std::none_of(fields.begin(), fields.end(),
                       [](std::string_view field) { return field.empty(); }))
        return header_line_ = heads[i].number, i;
    }
    return text[body];
  }

  /// Of the lines that are numbers: how many fields, and which are numbers.
  struct Shape {
    std::size_t count = 0;
    int numbers = 0;
    int filled = 0;  // not those that are always empty, as after a separator at the end
    std::vector<bool> number;
  };
  [[nodiscard]] Shape shape_of(const std::vector<Head>& heads, const std::vector<std::size_t>& text,
                               std::size_t body, char separator) const {
    std::vector<std::size_t> counts;
    std::vector<int> filled, numbers;
    Fields fields;
    for (std::size_t i = body; i < text.size(); ++i) {
      split(heads[text[i]].text, separator, fields);
      counts.push_back(fields.size());
      filled.resize(std::max(filled.size(), fields.size()));
      numbers.resize(filled.size());
      for (std::size_t c = 0; c < fields.size(); ++c) {
        if (fields[c].empty()) continue;
        ++filled[c];
        if (is_value(fields[c])) ++numbers[c];
      }
    }
    Shape shape;
    std::sort(counts.begin(), counts.end());
    shape.count = counts[counts.size() / 2];
    for (std::size_t c = 0; c < filled.size(); ++c) {
      shape.number.push_back(c < shape.count && 2 * numbers[c] > filled[c]);
      shape.numbers += shape.number.back() ? 1 : 0;
      shape.filled += c < shape.count && filled[c] > 0 ? 1 : 0;
    }
    return shape;
  }

  /// Names in fields of their own, each before its number: t,0.01,PWM,120,Enc1,-44.9
  void understand_words(const std::vector<Head>& heads, const std::vector<std::size_t>& text,
                        std::size_t body, const Shape& shape) {
    Fields fields, last;
    split(heads[text[body]].text, separator_, last);
    // The last line may be cut.
    const auto end = text.end() - (body + 1 < text.size() ? 1 : 0);
    std::vector<std::string> names(shape.count), words(shape.count);
    std::size_t named = 0;
    for (std::size_t c = 0; c + 1 < std::min(shape.count, last.size()); ++c) {
      if (shape.number[c] || !shape.number[c + 1] || last[c].empty()) continue;
      const bool same =
          std::all_of(text.begin() + static_cast<std::ptrdiff_t>(body), end, [&](std::size_t i) {
            split(heads[i].text, separator_, fields);
            return c < fields.size() && fields[c] == last[c];
          });
      if (!same) return;
      names[c + 1] = words[c + 1] = last[c];
      ++named;
    }
    // Each number has one.
    if (named < 2 || named != static_cast<std::size_t>(shape.numbers)) return;
    headers_.assign(1, names);
    words_ = words;
  }

  enum class Numbers { none, some, all };
  /// Of the fields that are to be numbers.
  [[nodiscard]] Numbers numbers_in(const Shape& shape, const Fields& fields) const {
    std::size_t are = 0, values = 0, filled = 0;
    for (std::size_t c = 0; c < std::min(fields.size(), shape.number.size()); ++c) {
      if (!shape.number[c] || fields[c].empty()) continue;
      ++filled;
      if (is_number(fields[c]) || !unit_behind(fields[c]).empty()) ++are;
      if (is_value(fields[c])) ++values;
    }
    // A name may be "on", too.
    return are == 0 ? Numbers::none : values < filled ? Numbers::some : Numbers::all;
  }

  [[noreturn]] void refuse_row(std::size_t line, const Shape& shape, const Fields& fields) const {
    for (std::size_t c = 0; c < std::min(fields.size(), shape.number.size()); ++c) {
      if (shape.number[c] && !fields[c].empty() && !is_value(fields[c])) {
        throw LogError(at(line) + "'" + std::string(fields[c]) + "' in column " +
                       std::to_string(c + 1) + " is not a number");
      }
    }
    throw LogError(at(line) + "it has " + std::to_string(fields.size()) +
                   " fields, the lines below have " + std::to_string(shape.count));
  }

  /// More numbers than names: the names are shifted, or the comma is a decimal one.
  void check_count(std::size_t line, const Fields& fields) const {
    for (std::size_t i = count_; i < fields.size(); ++i) {
      if (fields[i].empty() || !is_number(fields[i])) continue;
      throw LogError(
          at(line) + "it has " + std::to_string(fields.size()) + " fields, but " +
          (headers_.empty() ? "the lines before have " + std::to_string(count_)
                            : "line " + std::to_string(header_line_) + " has " +
                                  std::to_string(count_) + " names") +
          (separator_ == ',' ? "; with decimal commas the separator must be another one" : ""));
    }
  }

  /// Minus signs and blanks of typesetters, and what stands around the objects of a JSON array.
  static void tidy(std::string& line) {
    if (line.find_first_of("\xE2\xC2") != std::string::npos) {
      for (const auto& [other, plain] : {std::pair<std::string_view, char>{"\xE2\x88\x92", '-'},
                                         {"\xE2\x80\xAF", ' '},
                                         {"\xC2\xA0", ' '}}) {
        for (auto at = line.find(other); at != std::string::npos; at = line.find(other, at))
          line.replace(at, other.size(), 1, plain);
      }
    }
    const auto first = line.find_first_not_of(" \t[,");
    const auto last = line.find_last_not_of(" \t],");
    if (first != std::string::npos && line[first] == '{' && line[last] == '}')
      line = line.substr(first, last - first + 1);
  }

  /// Where the text of a comment starts.
  static std::optional<std::size_t> after_comment_mark(const std::string& line) {
    const auto from = line.find_first_not_of(" \t");
    const std::string_view text = std::string_view(line).substr(from);
    const bool slashes = text.starts_with("//");
    if (!slashes && text.front() != '#' && text.front() != '%') return std::nullopt;
    return std::min(line.size(), line.find_first_not_of("#%/ \t", from));
  }

  static std::string_view trimmed(std::string_view text) {
    const auto from = text.find_first_not_of(" \t\"");
    if (from == std::string_view::npos) return {};
    return text.substr(from, text.find_last_not_of(" \t\"") - from + 1);
  }

  /// The u of u:1.5.
  static std::string_view label_of(std::string_view field) {
    if (field.empty() || field[0] < 'A') return {};
    const auto colon = field.find(':');
    return colon == std::string_view::npos ? std::string_view{} : field.substr(0, colon);
  }

  void split(std::string_view line, char separator, Fields& fields) const {
    fields.clear();
    if (!labels_.empty()) {
      std::vector<Labelled> found;
      labels_of(line, found);
      for (const std::string& label : labels_) {
        const auto at = std::find_if(found.begin(), found.end(),
                                     [&](const Labelled& one) { return one.label == label; });
        fields.push_back(at == found.end() ? std::string_view{} : at->value);
      }
      return;
    }
    // The Arduino IDE writes "12:00:00.010 -> " before what it received.
    if (const auto arrow = line.find(" -> "); arrow != std::string_view::npos) {
      if (const auto stamp = trimmed(line.substr(0, arrow)); parse_stamp(stamp)) {
        fields.push_back(stamp);
        line.remove_prefix(arrow + 4);
      }
    }
    while (true) {
      if (separator == ' ') {
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
          separator == ' ' ? line.find_first_of(" \t", from) : line.find(separator, from);
      fields.push_back(trimmed(line.substr(0, end)));
      if (end == std::string_view::npos) return;
      line.remove_prefix(end + 1);
    }
  }

  /// A number, or NaN for an empty field and the usual words for one that is missing.
  template <class Number = double>
  [[nodiscard]] static std::optional<Number> parse(std::string_view text) {
    constexpr Number nan = std::numeric_limits<Number>::quiet_NaN();
    if (text.empty()) return nan;
    if (text.front() > '9' || text.front() == '#' || text.front() == '-') {
      for (const std::string_view word : {"nan", "NaN", "NAN", "NA", "N/A", "#N/A", "null", "NULL",
                                          "None", "-nan", "-nan(ind)"}) {
        if (text == word) return nan;
      }
    }
    if (text.front() == '+') text.remove_prefix(1);
    std::array<char, 64> point{};
    const auto comma = text.find(',');
    const auto exponent = text.find_first_of("dD");  // of Fortran: 1.5D-03
    if ((comma != std::string_view::npos || exponent != std::string_view::npos) &&
        text.size() < point.size()) {
      // A separator of thousands, or of columns.
      if (comma != std::string_view::npos &&
          (comma + 1 == text.size() || text.find('.') != std::string_view::npos))
        return std::nullopt;
      if (exponent != std::string_view::npos && (exponent == 0 || exponent + 1 == text.size()))
        return std::nullopt;
      std::copy(text.begin(), text.end(), point.begin());
      if (comma != std::string_view::npos) point[comma] = '.';
      if (exponent != std::string_view::npos) point[exponent] = 'e';
      text = {point.data(), text.size()};
    }
    Number number = 0;
    const auto [end, error] = number_from_chars(text.data(), text.data() + text.size(), number);
    if (end != text.data() + text.size()) return std::nullopt;
    // Too small or too large is a number nevertheless: zero or infinite.
    if (error == std::errc::result_out_of_range)
      return static_cast<Number>(std::strtold(std::string(text).c_str(), nullptr));
    if (error != std::errc{}) return std::nullopt;
    return number;
  }

  /// Words that stand for a number: 1, 0, or NaN where a sensor failed.
  [[nodiscard]] static std::optional<double> word_value(std::string_view field) {
    if (field.empty() || field.size() > 12) return std::nullopt;
    std::string text(field);
    for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    for (const std::string_view one : {"on", "true", "ein", "an", "yes", "high", "wahr", "vrai"}) {
      if (text == one) return 1.0;
    }
    for (const std::string_view zero : {"off", "false", "aus", "no", "low", "falsch", "faux"}) {
      if (text == zero) return 0.0;
    }
    for (const std::string_view lost :
         {"err",     "error",   "fail",        "failed",  "fault",    "bad",
          "invalid", "ovf",     "ol",          "-",       "--",       "---",
          "?",       "#value!", "#ref!",       "#div/0!", "#num!",    "missing",
          "n/a",     "na",      "nil",         "none",    "overflow", "overrange",
          "\\n",     "--.-",    "unavailable", "unknown", "timeout",  "disconnected"}) {
      if (text == lost) return std::numeric_limits<double>::quiet_NaN();
    }
    return std::nullopt;
  }

  /// How long the number is that a text begins with.
  [[nodiscard]] static std::size_t number_length(std::string_view text) {
    std::size_t i = 0, digits = 0;
    const auto run = [&] {
      for (; i < text.size() && text[i] >= '0' && text[i] <= '9'; ++i) ++digits;
    };
    if (i < text.size() && (text[i] == '-' || text[i] == '+')) ++i;
    run();
    if (i + 1 < text.size() && (text[i] == '.' || text[i] == ',') && text[i + 1] >= '0' &&
        text[i + 1] <= '9')
      ++i, run();
    if (digits == 0) return 0;
    if (i + 1 < text.size() && (text[i] == 'e' || text[i] == 'E')) {
      const std::size_t before = i, had = digits;
      i += text[i + 1] == '-' || text[i + 1] == '+' ? 2U : 1U;
      run();
      if (digits == had) i = before;
    }
    return i;
  }
  /// The unit behind a number: 23.5 °C, 12%, 0.3 m/s.
  [[nodiscard]] static std::string_view unit_behind(std::string_view field) {
    const std::size_t length = number_length(field);
    if (length == 0 || length == field.size()) return {};
    const std::string_view unit = trimmed(field.substr(length));
    const auto first = static_cast<unsigned char>(unit.empty() ? '0' : unit.front());
    if (!(first > 127 || std::isalpha(first) != 0 || first == '%') || unit.size() > 10 ||
        unit.find_first_of(" \t:;,|0123456789-+") != std::string_view::npos)
      return {};
    return unit;
  }

  /// Whether a field of a column of numbers may say so.
  static bool is_value(std::string_view field) {
    return is_number(field) || word_value(field).has_value() || !unit_behind(field).empty();
  }
  static bool is_number(std::string_view field) {
    if (const auto label = label_of(field); !label.empty()) field.remove_prefix(label.size() + 1);
    return parse(field).has_value() || parse_stamp(field).has_value();
  }
  [[nodiscard]] bool all_numbers(const Fields& fields) const {
    return std::all_of(fields.begin(), fields.end(),
                       [](std::string_view field) { return is_number(field); });
  }

  /// The column of which alone `fits` is true of a name, in the first line of names that has one.
  template <class Fits>
  [[nodiscard]] std::optional<Place> only(const std::string& name, const Fits& fits) const {
    for (std::size_t h = 0; h < headers_.size(); ++h) {
      std::vector<std::size_t> found;
      for (std::size_t i = 0; i < headers_[h].size(); ++i) {
        if (fits(headers_[h][i])) found.push_back(i);
      }
      if (found.size() == 1) return Place{found[0], h};
      if (found.size() > 1) {
        throw LogError(file_.path() + ": '" + name + "' is " + headers_[h][found[0]] + " and " +
                       headers_[h][found[1]] + ", columns " + std::to_string(found[0] + 1) +
                       " and " + std::to_string(found[1] + 1));
      }
    }
    return std::nullopt;
  }

  [[nodiscard]] Place find_column(const std::string& name) const {
    const auto numbered = [&](std::string_view digits) -> std::size_t {
      std::size_t number = 0;
      const auto [end, error] =
          std::from_chars(digits.data(), digits.data() + digits.size(), number);
      const bool whole = error == std::errc{} && end == digits.data() + digits.size();
      return whole && number <= count_ ? number : 0;
    };
    const std::size_t number = numbered(name);
    if (name.starts_with('@')) {
      if (const std::size_t at = numbered(std::string_view(name).substr(1)); at > 0)
        return {at - 1, 0};
    }
    if (const auto named = only(name, [&](const std::string& full) { return full == name; });
        named && number > 0 && named->column != number - 1) {
      throw LogError(file_.path() + ": '" + name + "' is the name of column " +
                     std::to_string(named->column + 1) + " and the number of column " + name +
                     ": write @" + std::to_string(named->column + 1) + " or @" + name +
                     ", which are numbers");
    }
    if (const auto exact = only(name, [&](const std::string& full) { return full == name; }))
      return *exact;
    const auto ends = only(name, [&](const std::string& full) {
      if (!(full.size() > name.size() && full.ends_with(name) && !name.empty())) return false;
      const char before = full[full.size() - name.size() - 1];
      return before == '/' || before == '.';
    });
    if (ends) return *ends;
    if (number > 0) return {number - 1, 0};
    const auto begins = only(
        name, [&](const std::string& full) { return !name.empty() && full.starts_with(name); });
    if (begins) return *begins;
    throw LogError(file_.path() + ": no column '" + name + "'; there " +
                   (headers_.empty() ? "is no header and are " + std::to_string(count_) + " columns"
                                     : "are " + there()));
  }

  /// How a wanted column is called in an error.
  [[nodiscard]] std::string called(std::size_t wanted) const {
    return headers_.empty() ? std::to_string(places_[wanted].column + 1) : "'" + name(wanted) + "'";
  }
  [[nodiscard]] std::string lacking(std::size_t line, const Fields& fields,
                                    std::size_t wanted) const {
    return at(line) + "only " + std::to_string(fields.size()) + " fields, none for " +
           called(wanted);
  }

  [[nodiscard]] double value(std::size_t line, const Fields& fields, std::size_t wanted) {
    const std::size_t place = places_[wanted].column;
    const auto column = [&] { return called(wanted); };
    std::string_view field = fields[place];
    if (!words_.empty() && (place == 0 || fields[place - 1] != words_[place])) {
      throw LogError(at(line) + "'" + std::string(place == 0 ? "" : fields[place - 1]) +
                     "' stands before column " + column() + " instead of its name");
    }
    const char* wrong = nullptr;
    if (labelled_) {
      const auto label = label_of(field);
      if (label != headers_[0][place] && !parse_stamp(field))
        wrong = "does not have the label of the first row";
      if (!label.empty()) field.remove_prefix(label.size() + 1);
    }
    Cells& cells = cells_[wanted];
    if (const auto unit = unit_behind(field); !unit.empty() && !parse_stamp(field)) {
      if (cells.unit.empty() && cells.numbers == 0) cells.unit = unit;
      if (cells.unit != unit) {
        throw LogError(at(line) + "'" + std::string(field) + "' in column " + column() +
                       " has the unit " + std::string(unit) + ", the numbers before have " +
                       (cells.unit.empty() ? "none" : cells.unit) +
                       ": write all of them in one unit");
      }
      field = trimmed(field.substr(0, number_length(field)));
    }
    double found = 0;
    if (stamps_ == wanted) {
      std::optional<long double> number = parse(field);
      // More digits than a double has are those of nanoseconds since 1970.
      if (number && field.size() > 15) number = parse<long double>(field);
      if (number) {
        ++cells.numbers;
        found =
            std::isfinite(*number) ? reader_.number(*number, wrong) : static_cast<double>(*number);
      } else if (const auto stamp = parse_stamp(field)) {
        found = reader_.stamp(*stamp, wrong);
      } else {
        wrong = "is neither a number nor a time like 2024-03-01T12:00:00.01 or 12:00:00.01";
      }
    } else if (const auto number = parse(field)) {
      found = *number;
      if (!field.empty()) ++cells.numbers;
    } else if (const auto stands_for = word_value(field)) {
      found = *stands_for;
      ++(std::isfinite(found) ? cells.switched : cells.failed);
    } else {
      wrong = why_no_number(field);
    }
    if (wrong != nullptr) {
      throw LogError(at(line) + "'" + std::string(fields[place]) + "' in column " + column() + " " +
                     wrong);
    }
    check_commas(line, field);
    return found;
  }

  /// What is wrong with a field that is not a number, and what to do.
  [[nodiscard]] const char* why_no_number(std::string_view field) const {
    if (!headers_.empty() && std::any_of(headers_.begin(), headers_.end(), [&](const auto& names) {
          return std::find(names.begin(), names.end(), field) != names.end();
        }))
      return "is a name, not a number: a second recording begins here; cut the file";
    if (field.size() > 2 && field.front() == '\'' && field.back() == '\'')
      return "is not a number: write it without quotation marks";
    const bool digits =
        std::count_if(field.begin(), field.end(), [](char c) { return c >= '0' && c <= '9'; }) > 3;
    const auto apart = field.find_first_of(" ',");
    if (digits && apart != std::string_view::npos && apart + 4 <= field.size() &&
        field.find_first_not_of("+-0123456789.,' ") == std::string_view::npos)
      return "is not a number: write it without separators of thousands";
    return "is not a number";
  }

  /// 1,234 is 1.234 or 1234: that others have a decimal point decides for neither.
  void check_commas(std::size_t line, std::string_view field) {
    const bool comma = field.find(',') != std::string_view::npos;
    if (!comma && (field.find('.') == std::string_view::npos)) return;
    if (field.find(':') != std::string_view::npos) return;
    // Between commas it was in quotation marks: after "0,25" all are decimal ones.
    if (comma && separator_ == ',' && comma_line_ == 0 && field.size() == field.find(',') + 4 &&
        field.find_first_of("123456789") < field.find(',')) {
      throw LogError(at(line) + "'" + std::string(field) +
                     "' has a decimal comma or one of thousands: write it without separators of "
                     "thousands, or with a point");
    }
    (comma ? comma_line_ : point_line_) = line;
    if (comma_line_ == 0 || point_line_ == 0) return;
    throw LogError(at(line) + "'" + std::string(field) + "' has a decimal " +
                   (comma ? "comma" : "point") + ", the numbers before (line " +
                   std::to_string(comma ? point_line_ : comma_line_) + ") have a " +
                   (comma ? "point" : "comma"));
  }

  /// What the fields of a column are beside numbers.
  struct Cells {
    std::string unit;
    std::size_t numbers = 0, switched = 0, failed = 0;
  };

  LogSource file_;
  char separator_;
  std::optional<std::size_t> stamps_;
  std::size_t count_ = 0, header_line_ = 0, comma_line_ = 0, point_line_ = 0, other_lines_ = 0;
  bool cut_ = false, labelled_ = false, packed_ = false;
  std::vector<std::vector<std::string>> headers_;
  std::vector<std::string> labels_;  // where each line has them
  std::vector<std::string> words_;   // what stands before each number, where that is its name
  std::vector<Place> places_;
  std::vector<Cells> cells_;
  std::vector<std::vector<double>> columns_;
  std::vector<std::size_t> lines_;
  StampReader reader_;
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
