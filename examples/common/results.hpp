/// @file
/// Reads back what the examples wrote below the output folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "check.hpp"
#include "csv.hpp"

namespace esokit::examples {

/// One row of a summary.csv, as text.
struct ResultRow {
  CsvRow fields;
  Check::Outcome outcome = Check::Outcome::reported;
};

/// A figure, table or paragraph, in the order in which the example gave them.
struct ContentItem {
  std::string kind, name, text, alt;
};

struct ExampleResults {
  std::string name;
  std::filesystem::path folder;  ///< relative to the output folder
  std::string title, description;
  std::vector<ContentItem> items;
  std::vector<ResultRow> rows;

  [[nodiscard]] std::size_t count(Check::Outcome outcome) const {
    return static_cast<std::size_t>(
        std::count_if(rows.begin(), rows.end(),
                      [outcome](const ResultRow& row) { return row.outcome == outcome; }));
  }
};

struct PaperResults {
  std::string folder, title, citation, link;
  std::vector<ExampleResults> examples;
};

namespace detail {

[[nodiscard]] inline std::vector<CsvRow> read_csv(const std::filesystem::path& file,
                                                  std::size_t columns) {
  const auto text = read_text(file);
  if (!text) throw std::runtime_error("cannot read " + file.string());
  std::vector<CsvRow> rows = parse_csv(*text);
  for (const CsvRow& row : rows) {
    const std::size_t expected = columns == 0 ? rows.front().size() : columns;
    if (row.size() != expected) {
      throw std::runtime_error(file.string() + ": a row has " + std::to_string(row.size()) +
                               " fields, not " + std::to_string(expected));
    }
  }
  if (rows.empty()) throw std::runtime_error(file.string() + " is empty");
  return rows;
}

[[nodiscard]] inline Check::Outcome outcome_of(const CsvRow& fields) {
  const std::string& pass = fields[6];
  if (pass == "yes") return Check::Outcome::pass;
  if (pass.empty()) return Check::Outcome::reported;
  return miss_in(fields[7]) ? Check::Outcome::known_miss : Check::Outcome::fail;
}

inline void read_example(const std::filesystem::path& out, const std::filesystem::path& folder,
                         PaperResults& paper) {
  ExampleResults example;
  example.name = folder.filename().string();
  example.folder = folder.lexically_relative(out);
  const auto summary = read_csv(folder / "summary.csv", 8);
  if (csv_line(summary.front()) != summary_header) {
    throw std::runtime_error((folder / "summary.csv").string() + ": not the header of a summary");
  }
  for (std::size_t i = 1; i < summary.size(); ++i) {
    example.rows.push_back({summary[i], outcome_of(summary[i])});
  }
  for (const CsvRow& row : read_csv(folder / "contents.csv", 6)) {
    const auto keep_first = [&](std::string& text) {
      if (text.empty()) text = row[2];
    };
    if (row[0] == "kind") continue;
    if (row[0] == "paper_title") {
      keep_first(paper.title);
    } else if (row[0] == "citation") {
      keep_first(paper.citation);
    } else if (row[0] == "link") {
      keep_first(paper.link);
    } else if (row[0] == "title") {
      example.title = row[2];
    } else if (row[0] == "description") {
      example.description = row[2];
    } else if (row[0] != "order" && row[0] != "addition") {
      example.items.push_back({row[0], row[1], row[2], row[3]});
    }
  }
  paper.examples.push_back(std::move(example));
}

}  // namespace detail

/// All papers below `out`, in the order of their folders' names, then what is not a paper. Throws
/// std::runtime_error with the reason if there are none or a file is not as Report writes it.
[[nodiscard]] inline std::vector<PaperResults> read_results(const std::filesystem::path& out) {
  std::error_code error;
  if (!std::filesystem::is_directory(out, error)) {
    throw std::runtime_error("there is no folder " + out.string());
  }
  std::vector<std::filesystem::path> folders;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(out)) {
    if (entry.path().filename() == "summary.csv") folders.push_back(entry.path().parent_path());
  }
  if (folders.empty()) {
    throw std::runtime_error("no summary.csv below " + out.string() + ": run an example first");
  }
  std::sort(folders.begin(), folders.end());
  std::vector<PaperResults> papers;
  for (const auto& folder : folders) {
    const std::string name = folder.parent_path().lexically_relative(out).string();
    if (papers.empty() || papers.back().folder != name) {
      papers.emplace_back();
      papers.back().folder = name;
    }
    detail::read_example(out, folder, papers.back());
  }
  std::stable_partition(papers.begin(), papers.end(),
                        [](const PaperResults& results) { return !results.link.empty(); });
  return papers;
}

}  // namespace esokit::examples
