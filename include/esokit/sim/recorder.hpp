/// @file
/// Named columns of samples, and their CSV file.
#pragma once

#include <cerrno>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstdio>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/sim/file_error.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace esokit::sim {

namespace detail {

/// The rule that names[i] breaks, or null.
inline const char* broken_column_name(std::span<const std::string> names, std::size_t i) {
  if (names[i].empty()) return "must not be empty";
  if (names[i].find_first_of(",\"\r\n") != std::string::npos) {
    return "must hold no comma, quote or line break";
  }
  for (std::size_t j = 0; j < i; ++j) {
    if (names[j] == names[i]) return "must differ from the other names";
  }
  return nullptr;
}

}  // namespace detail

/// Records one row a sample into memory that is taken once, in `make`.
///
/// A row beyond the capacity is dropped; `record` says so, and `write_csv` fails after it has
/// written the rows it has, so that a cut recording is never taken for a whole one.
template <int Columns, PlainScalar ScalarType = double>
class Recorder {
  static_assert(Columns >= 1);

 public:
  /// Settings of make.
  struct Config {
    Array<std::string, Columns> names{};  ///< header of each column
    std::size_t capacity = 0;             ///< most rows
  };

  /// Refuses names that are empty, given twice, or hold a comma, quote or line break (the value of
  /// the error is then the length of the name), and a capacity that is zero or beyond memory.
  static Expected<Recorder, Error<ScalarType>> make(Config config) {
    for (std::size_t i = 0; i < Columns; ++i) {
      if (const char* rule = detail::broken_column_name(config.names, i)) {
        return Error<ScalarType>{.field = "names",
                                 .value = static_cast<ScalarType>(config.names[i].size()),
                                 .rule = rule,
                                 .index = static_cast<int>(i)};
      }
    }
    const std::size_t most = std::vector<ScalarType>{}.max_size() / Columns;
    if (config.capacity < 1 || config.capacity > most) {
      return Error<ScalarType>{.field = "capacity",
                               .value = static_cast<ScalarType>(config.capacity),
                               .rule = "must be at least 1 and at most",
                               .limit = static_cast<ScalarType>(most),
                               .has_limit = true};
    }
    return Recorder(std::move(config));
  }

  /// Adds a row, one value a column in the order of the names; false if it was dropped.
  template <class... Values>
  requires(sizeof...(Values) == Columns && (std::convertible_to<Values, ScalarType> &&
                                            ...)) bool record(const Values&... values) noexcept {
    if (rows_ == config_.capacity) {
      ++dropped_;
      return false;
    }
    std::size_t column = 0;
    ((data_[column++ * config_.capacity + rows_] = static_cast<ScalarType>(values)), ...);
    ++rows_;
    return true;
  }

  /// Rows recorded.
  std::size_t rows() const noexcept { return rows_; }
  /// Rows that came when it was full.
  std::size_t dropped() const noexcept { return dropped_; }
  /// Header of each column.
  const Array<std::string, Columns>& names() const noexcept { return config_.names; }

  /// The samples of a column; valid until the recorder is gone or cleared.
  template <int Index>
  std::span<const ScalarType> column() const noexcept {
    static_assert(Index >= 0 && Index < Columns);
    return at(Index);
  }

  /// The same by name; nothing if there is no such column.
  std::optional<std::span<const ScalarType>> column(std::string_view name) const noexcept {
    for (std::size_t i = 0; i < Columns; ++i) {
      if (config_.names[i] == name) return at(i);
    }
    return std::nullopt;
  }

  /// Forgets all rows, keeps the memory.
  void clear() noexcept {
    rows_ = 0;
    dropped_ = 0;
  }

  /// Writes a header and all rows, each number in the shortest form that reads back to the same
  /// bits. The folder must exist.
  /// @return error for a file that cannot be opened or written, or if rows were dropped
  Expected<void, FileError> write_csv(const std::string& path) const {
    return write(path, rows_, [](std::size_t i) { return i; });
  }

  /// Writes the given rows only (see decimation.hpp). Errors as above, and for a row that was not
  /// recorded.
  Expected<void, FileError> write_csv(const std::string& path,
                                      std::span<const std::size_t> rows) const {
    for (const std::size_t row : rows) {
      if (row >= rows_) return FileError{path, "asked for a row that was not recorded", 0};
    }
    return write(path, rows.size(), [rows](std::size_t i) { return rows[i]; });
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  explicit Recorder(Config config)
      : config_(std::move(config)), data_(Columns * config_.capacity) {}

  std::span<const ScalarType> at(std::size_t column) const noexcept {
    return {data_.data() + column * config_.capacity, rows_};
  }

  std::string header() const {
    std::string line;
    for (const std::string& name : config_.names) line += (line.empty() ? "" : ",") + name;
    return line + '\n';
  }

  void append_row(std::string& line, std::size_t row) const {
    for (std::size_t i = 0; i < Columns; ++i) {
      char text[64];  // the longest shortest form, of a 113-bit long double, has 44
      const auto end = std::to_chars(text, text + sizeof text, at(i)[row]).ptr;
      line.append(text, end);
      line += i + 1 < Columns ? ',' : '\n';
    }
  }

  template <class RowOf>
  Expected<void, FileError> write(const std::string& path, std::size_t count, RowOf row_of) const {
    errno = 0;
    std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "w"));
    if (!file) return FileError{path, "cannot be opened for writing", errno};
    std::string line = header();
    bool good = std::fwrite(line.data(), 1, line.size(), file.get()) == line.size();
    for (std::size_t i = 0; good && i < count; ++i) {
      line.clear();
      append_row(line, row_of(i));
      good = std::fwrite(line.data(), 1, line.size(), file.get()) == line.size();
    }
    // The buffer reaches the disk at the close, so a full disk may show only here.
    const bool closed = std::fclose(file.release()) == 0;
    if (!good || !closed) return FileError{path, "cannot be written", errno};
    if (dropped_ > 0) return FileError{path, "is incomplete: rows beyond the capacity dropped", 0};
    return {};
  }

  Config config_;
  std::vector<ScalarType> data_;  ///< one column after the other
  std::size_t rows_ = 0;
  std::size_t dropped_ = 0;
};

}  // namespace esokit::sim
