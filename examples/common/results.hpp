/// @file
/// Reads back what the examples wrote below the output folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
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
  std::string kind, name, text, alt, more, figure;
  bool addition = false;
};

struct ExampleResults {
  std::string name;
  std::filesystem::path folder;  ///< relative to the output folder
  std::string title, description;
  std::vector<ContentItem> items;
  int order = 0;
  bool addition = false;
  std::vector<ResultRow> rows;
};

struct PaperResults {
  std::string folder, title, citation, link;
  std::vector<ExampleResults> examples;
};

/// Printed numbers and own checks, never added up.
struct Counts {
  std::size_t met = 0, missed = 0, not_judged = 0, passed = 0, failed = 0;
};

[[nodiscard]] inline Counts count(const PaperResults& paper) {
  Counts counts;
  for (const ExampleResults& example : paper.examples) {
    for (const ResultRow& row : example.rows) {
      const bool printed = !row.fields[2].empty();
      const bool judged = row.outcome != Check::Outcome::reported;
      const bool good = row.outcome == Check::Outcome::pass;
      if (printed) {
        ++(!judged ? counts.not_judged : good ? counts.met : counts.missed);
      } else if (judged) {
        ++(good ? counts.passed : counts.failed);
      }
    }
  }
  return counts;
}

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
  bool additions = false;
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
    } else if (row[0] == "order") {
      example.order = std::stoi(row[2]);
    } else if (row[0] == "addition") {
      example.addition = true;
    } else if (row[0] == "additions") {
      additions = row[2] == "on";
    } else {
      example.items.push_back({row[0], row[1], row[2], row[3], row[4], row[5], additions});
    }
  }
  // Of what could not run, as its data are not here, there is nothing to show.
  const bool empty = example.rows.empty() &&
                     std::all_of(example.items.begin(), example.items.end(),
                                 [](const ContentItem& item) { return item.kind == "remark"; });
  if (!empty) paper.examples.push_back(std::move(example));
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
  std::erase_if(papers, [](const PaperResults& paper) { return paper.examples.empty(); });
  for (PaperResults& paper : papers) {
    std::stable_sort(paper.examples.begin(), paper.examples.end(),
                     [](const ExampleResults& a, const ExampleResults& b) {
                       return std::pair(a.addition, a.order) < std::pair(b.addition, b.order);
                     });
  }
  std::stable_partition(papers.begin(), papers.end(),
                        [](const PaperResults& results) { return !results.link.empty(); });
  return papers;
}

}  // namespace esokit::examples
