/// @file
/// Checks the numbers of READMEs against what the examples wrote: check_readme OUT README...
///
/// A comment after numbers says where they come from, one source for each of the last numbers of
/// the line before it:
///
///     0.097, 0.093 <!--= sim2: Sim2A, p = 1 -> int e dt; sim2: Sim2A, p = 2 -> int e dt -->
///
/// A source is EXAMPLE: CASE -> METRIC, a row of its summary.csv, or EXAMPLE#NAME: ROW -> COLUMN, a
/// cell of its table_NAME.csv, columns by heading or number, `1..4` for four of them; * and ? match
/// any text (no bar may stand in a row of a table, write ? for it). Before it may stand `max`,
/// `min` or `error` (the greatest relative error, in %), after it `* FACTOR`; of several rows the
/// greatest counts (with min the least). A number must agree in its last printed digit; after "<="
/// it must not be exceeded.

#include <fnmatch.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "csv.hpp"

namespace {

using esokit::examples::CsvRow;

std::string trimmed(const std::string& text) {
  const auto from = text.find_first_not_of(" \n");
  return from == std::string::npos ? ""
                                   : text.substr(from, text.find_last_not_of(" \n") - from + 1);
}

bool matches(const std::string& pattern, const std::string& text) {
  return fnmatch(pattern.c_str(), text.c_str(), FNM_NOESCAPE) == 0;
}

/// The last `count` numbers of a text, as written.
std::vector<std::string> last_numbers(const std::string& text, std::size_t count) {
  std::vector<std::string> numbers;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto digit = [&](std::size_t k) {
      return k < text.size() && text[k] >= '0' && text[k] <= '9';
    };
    if (!digit(i)) continue;
    std::size_t end = i;
    while (digit(end) || (end < text.size() && text[end] == '.' && digit(end + 1))) ++end;
    if (end < text.size() && text[end] == 'e' &&
        (digit(end + 1) || (text[end + 1] == '-' && digit(end + 2)))) {
      end += 2;
      while (digit(end)) ++end;
    }
    const bool minus = i > 0 && text[i - 1] == '-' && (i == 1 || text[i - 2] == ' ');
    numbers.push_back((minus ? "-" : "") + text.substr(i, end - i));
    i = end;
  }
  if (numbers.size() > count)
    numbers.erase(numbers.begin(), numbers.end() - static_cast<std::ptrdiff_t>(count));
  return numbers;
}

/// The number that a source names, or what is wrong with it.
std::optional<double> value_of(std::string source, const std::filesystem::path& folder,
                               std::string& why) {
  double factor = 1.0;
  if (const auto star = source.rfind(" * ");
      star != std::string::npos && star > source.rfind(" -> ") + 3) {
    factor = std::strtod(source.c_str() + star + 3, nullptr);
    source.erase(star);
  }
  std::string mode;
  for (const char* word : {"max ", "min ", "error "}) {
    if (source.starts_with(word)) {
      mode = trimmed(word);
      source.erase(0, mode.size() + 1);
      break;
    }
  }
  const auto colon = source.find(':');
  const auto bar = source.rfind(" -> ");
  if (colon == std::string::npos || bar == std::string::npos || bar < colon) {
    why = "is not EXAMPLE: CASE -> METRIC";
    return std::nullopt;
  }
  const std::string place = trimmed(source.substr(0, colon));
  const std::string row_wanted = trimmed(source.substr(colon + 1, bar - colon - 1));
  const std::string column_wanted = trimmed(source.substr(bar + 4));
  const auto slash = place.find('#');
  const bool table = slash != std::string::npos;
  const auto file = folder / place.substr(0, slash) /
                    (table ? "table_" + place.substr(slash + 1) + ".csv" : "summary.csv");
  const auto text = esokit::examples::read_text(file);
  if (!text) {
    why = "there is no " + file.string();
    return std::nullopt;
  }
  const auto rows = esokit::examples::parse_csv(*text);
  std::optional<double> value;
  const auto take = [&](const std::string& cell, double scale) {
    char* end = nullptr;
    const double number = std::strtod(cell.c_str(), &end) * scale;
    if (end == cell.c_str()) return;
    if (!value || (mode == "min" ? number < *value : number > *value)) value = number;
  };
  for (std::size_t r = 1; r < rows.size(); ++r) {
    const CsvRow& row = rows[r];
    if (!matches(row_wanted, row[0])) continue;
    if (!table && matches(column_wanted, row[1])) {
      take(mode == "error" ? row[4] : row[3], mode == "error" ? 100.0 : 1.0);
    }
    for (std::size_t c = 1; table && c < row.size(); ++c) {
      if (column_wanted == std::to_string(c) || matches(column_wanted, rows[0][c]))
        take(row[c], 1.0);
    }
  }
  if (!value) {
    why = "names no row";
    return std::nullopt;
  }
  return *value * factor;
}

bool agrees(const std::string& printed, double value, bool at_most) {
  const double number = std::strtod(printed.c_str(), nullptr);
  if (at_most) return value <= number;
  const auto exponent = printed.find('e');
  const auto point = printed.find('.');
  const std::size_t end = std::min(exponent, printed.size());
  double unit =
      point == std::string::npos ? 1.0 : std::pow(10.0, -static_cast<double>(end - point - 1));
  if (exponent != std::string::npos)
    unit *= std::pow(10.0, std::atof(printed.c_str() + exponent + 1));
  return std::abs(value - number) <= 0.501 * unit;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: check_readme OUT README...\n");
    return 2;
  }
  int passed = 0;
  int failed = 0;
  for (int i = 2; i < argc; ++i) {
    const std::filesystem::path readme = argv[i];
    const auto text = esokit::examples::read_text(readme);
    if (!text) {
      std::printf("cannot read %s\n", readme.c_str());
      ++failed;
      continue;
    }
    const auto folder =
        std::filesystem::path(argv[1]) / std::filesystem::absolute(readme).parent_path().filename();
    constexpr std::string_view open = "<!--=";
    std::size_t from = 0;
    for (auto at = text->find(open); at != std::string::npos; at = text->find(open, at + 1)) {
      // The line before the comment, from the end of the comment before.
      from = std::max(from, text->rfind('\n', at) + 1);
      const std::string before = text->substr(from, at - from);
      const auto close = text->find("-->", at);
      std::string sources = text->substr(at + open.size(), close - at - open.size());
      from = close + 3;
      std::vector<std::string> all;
      for (std::size_t k = 0; k <= sources.size();) {
        const auto next = std::min(sources.find(';', k), sources.size());
        const std::string source = trimmed(sources.substr(k, next - k));
        const auto dots = source.rfind("..");
        const auto arrow = source.rfind("-> ");
        if (arrow != std::string::npos && dots != std::string::npos && dots > arrow) {
          for (int c = std::atoi(source.c_str() + arrow + 3);
               c <= std::atoi(source.c_str() + dots + 2); ++c) {
            all.push_back(source.substr(0, arrow + 3) + std::to_string(c));
          }
        } else {
          all.push_back(source);
        }
        k = next + 1;
      }
      const auto numbers = last_numbers(before, all.size());
      for (std::size_t k = 0; k < all.size(); ++k) {
        const bool at_most = all[k].starts_with("<=");
        std::string why = "there is no number before it";
        std::optional<double> value;
        if (k < numbers.size())
          value = value_of(trimmed(all[k].substr(at_most ? 2 : 0)), folder, why);
        if (value && agrees(numbers[k], *value, at_most)) {
          ++passed;
          continue;
        }
        ++failed;
        if (value) {
          std::printf("%s says %s, the run %s: %s\n", readme.c_str(), numbers[k].c_str(),
                      esokit::examples::number_text(*value, 7).c_str(), all[k].c_str());
        } else {
          std::printf("%s: %s: %s\n", readme.c_str(), all[k].c_str(), why.c_str());
        }
      }
    }
  }
  std::printf("%d passed, %d failed\n", passed, failed);
  return failed == 0 && passed > 0 ? 0 : 1;
}
