/// @file
/// Numbers and comma-separated text as in RFC 4180.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace esokit::examples {

using CsvRow = std::vector<std::string>;

/// Shortest text with at most `digits` significant digits, independent of the locale.
[[nodiscard]] std::string number_text(double value, int digits = 9);

/// One field, quoted only where it has to be.
[[nodiscard]] std::string csv_field(std::string_view text);

/// One line with its line end.
[[nodiscard]] std::string csv_line(const CsvRow& row);

/// Writes the whole text; false if that failed.
[[nodiscard]] bool write_text(const std::string& file, std::string_view text);

}  // namespace esokit::examples
