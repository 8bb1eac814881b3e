/// @file
/// Comma-separated text as in RFC 4180: quoting and numbers.
#pragma once

#include <filesystem>
#include <optional>
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

/// Writes the whole text, or returns what went wrong.
[[nodiscard]] std::optional<std::string> write_text(const std::filesystem::path& file,
                                                    std::string_view text);

/// The whole file; empty optional if it cannot be read.
[[nodiscard]] std::optional<std::string> read_text(const std::filesystem::path& file);

}  // namespace esokit::examples
