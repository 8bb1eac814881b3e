/// @file
/// What every example does with its results: compares them with the paper's, writes summary.csv,
/// tables and figures into its own folder, and decides the exit code.
///
/// ```
/// int main(int argc, char** argv) {
///   Report report(argc, argv, "paper1_cascade_eso", "Sim1A",
///                 {.paper_title = "Cascade ESO", .citation = "K. Lakomy, R. Madonski, ...",
///                  .link = "https://doi.org/10.1016/j.isatra.2020.09.007",
///                  .title = "Generic example without noise"});
///   report.check("p = 1", "1e3 int abs(e)", 19.525, ours, 0.006);
///   report.comparison("table2", "Table 2 of the paper, rows A");
///   report.add(figure);
///   return report.finish();
/// }
/// ```
#pragma once

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "check.hpp"
#include "command_line.hpp"
#include "csv.hpp"
#include "figure.hpp"
#include "statistics.hpp"

namespace esokit::examples {

/// What the page out/index.html says of an example.
struct About {
  std::string paper_title = {};  ///< heading of the paper's section
  std::string citation = {};     ///< authors, title, journal, year
  std::string link = {};         ///< the paper's DOI as an address
  std::string title = {};        ///< heading of this example
  std::string description = {};  ///< one or two sentences: what is simulated, which way it runs
};

/// A number of ours, with its spread where it is a mean over seeds.
struct Measured {
  Measured(double number) : value(number) {}
  Measured(const Statistics& seeds) : value(seeds.mean), deviation(seeds.standard_deviation) {}

  double value;
  std::optional<double> deviation;
};

/// One example's results. Console output and files; nothing throws, what fails shows in finish().
class Report {
 public:
  /// Reads `[--out DIR | DIR]` from the command line and makes DIR/<paper>/<example>. A command
  /// line that it does not understand ends the program with exit code 2.
  Report(int argc, char** argv, const std::string& paper, const std::string& example, About about)
      : name_(paper + "/" + example), about_(std::move(about)) {
    folder_ = output_folder(argc, argv, "Writes its figures, tables and summary.csv below") /
              paper / example;
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) fail("cannot make the folder " + folder_.string() + ": " + error.message());
    // Results of an earlier run must not stand for this one if it ends early.
    std::filesystem::remove(folder_ / "summary.csv", error);
    std::filesystem::remove(folder_ / "contents.csv", error);
    std::printf("%s: %s\n", name_.c_str(), about_.title.c_str());
    std::fflush(stdout);
  }

  /// Where the files of this example go.
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

  /// Our number beside the paper's. With a tolerance it must reproduce, without one it is reported
  /// only; `paper` is std::nullopt where the paper has no number.
  void check(std::string case_name, std::string metric, std::optional<double> paper, Measured ours,
             std::optional<Tolerance> tolerance = std::nullopt, std::string note = {}) {
    Check row = make_row(std::move(case_name), std::move(metric), ours, std::move(note));
    row.paper = paper;
    if (paper && tolerance) {
      row.outcome = row.compare(*paper, *tolerance) ? Check::Outcome::pass : Check::Outcome::fail;
    } else if (paper) {
      row.compare(*paper, 0.0);
      row.tolerance.reset();
    } else if (tolerance) {
      row.outcome = Check::Outcome::fail;
      row.append_note("there is a tolerance, but no number to compare with");
    }
    checks_.push_back(std::move(row));
  }

  /// Our number beside one that is not printed in the paper (an independent run, a closed form):
  /// it must reproduce; the paper's column stays empty and the note holds the reference.
  void check_reference(std::string case_name, std::string metric, double reference, Measured ours,
                       const Tolerance& tolerance, const std::string& source = "independent run") {
    Check row = make_row(std::move(case_name), std::move(metric), ours,
                         source + ": " + number_text(reference, 6));
    row.outcome = row.compare(reference, tolerance) ? Check::Outcome::pass : Check::Outcome::fail;
    checks_.push_back(std::move(row));
  }

  /// A statement about our number that must hold; `rule` says it in words ("diverges").
  void expect(std::string case_name, std::string metric, Measured ours, bool holds,
              std::string rule) {
    Check row = make_row(std::move(case_name), std::move(metric), ours, std::move(rule));
    row.outcome = holds ? Check::Outcome::pass : Check::Outcome::fail;
    checks_.push_back(std::move(row));
  }

  /// A number of the paper that is known not to reproduce; `reason` says why, or what was tried.
  /// Shown as not reproduced, without failing the program. Should it reproduce after all, it
  /// passes.
  void known_miss(std::string case_name, std::string metric, double paper, Measured ours,
                  const Tolerance& tolerance, const std::string& reason) {
    Check row = make_row(std::move(case_name), std::move(metric), ours, {});
    row.paper = paper;
    const bool near = row.compare(paper, tolerance);
    row.outcome = near ? Check::Outcome::pass : Check::Outcome::known_miss;
    const std::string limits = std::exchange(row.note, {});
    row.append_note(near ? "was marked as a known miss, but reproduces"
                         : std::string(known_miss_prefix) + ": " + reason);
    row.append_note(limits);
    checks_.push_back(std::move(row));
  }

  /// The checks so far as a table with a line a case and a column a metric, paper beside ours.
  /// `cases` and `metrics` choose and order; empty means all.
  void comparison(const std::string& name, const std::string& caption,
                  std::vector<std::string> cases = {}, std::vector<std::string> metrics = {}) {
    const auto collect = [this](std::vector<std::string>& names, std::string Check::*member) {
      if (!names.empty()) return;
      for (const Check& row : checks_) {
        if (std::find(names.begin(), names.end(), row.*member) == names.end()) {
          names.push_back(row.*member);
        }
      }
    };
    collect(cases, &Check::case_name);
    collect(metrics, &Check::metric);

    std::vector<CsvRow> lines(1, CsvRow{"case"});
    for (const std::string& metric : metrics) {
      for (const char* part : {", paper", ", ours", ", pass"}) lines[0].push_back(metric + part);
    }
    for (const std::string& case_name : cases) {
      CsvRow line{case_name};
      for (const std::string& metric : metrics) {
        const auto row = std::find_if(checks_.begin(), checks_.end(), [&](const Check& check) {
          return check.case_name == case_name && check.metric == metric;
        });
        const bool found = row != checks_.end();
        line.push_back(found && row->paper ? number_text(*row->paper, 6) : "");
        line.push_back(found ? measured_text(*row) : "");
        line.push_back(found ? row->verdict() : "");
      }
      lines.push_back(std::move(line));
    }
    write_table("comparison", name, caption, lines);
  }

  /// A table with free columns: table_NAME.csv and a table on the page.
  void table(const std::string& name, const std::string& caption, CsvRow header,
             std::vector<CsvRow> rows) {
    rows.insert(rows.begin(), std::move(header));
    write_table("table", name, caption, rows);
  }

  /// Writes the figure's data, draws it and shows it on the page.
  void add(const Figure& figure) {
    if (const auto error = figure.write(folder_)) {
      fail(*error);
    } else {
      contents_.push_back({"figure", figure.name(), figure.caption(), figure.alt()});
    }
  }

  /// A paragraph for the page: conventions, variants, what the reader should see.
  void remark(std::string text) { contents_.push_back({"remark", "", std::move(text), ""}); }

  /// Says plainly what of the paper did not reproduce; shown here and at the top of the page.
  void not_reproduced(std::string text) {
    contents_.push_back({"not_reproduced", "", std::move(text), ""});
  }

  /// Prints the checks, writes summary.csv and contents.csv. The exit code of the program: non-zero
  /// if a number that must reproduce was missed, or a figure or file could not be written.
  [[nodiscard]] int finish() {
    print_checks();
    std::string summary{summary_header};
    for (const Check& check : checks_) summary += csv_line(check.csv_row());
    std::string contents = csv_line({"kind", "name", "text", "alt"});
    for (const auto& [kind, text] :
         {std::pair<const char*, const std::string&>{"paper_title", about_.paper_title},
          {"citation", about_.citation},
          {"link", about_.link},
          {"title", about_.title},
          {"description", about_.description}}) {
      contents += csv_line({kind, "", text, ""});
    }
    for (const CsvRow& row : contents_) contents += csv_line(row);
    write("contents.csv", contents);
    write("summary.csv", summary);

    const auto failed = std::count_if(checks_.begin(), checks_.end(), [](const Check& check) {
      return check.outcome == Check::Outcome::fail;
    });
    if (failed > 0) {
      std::fprintf(stderr, "%s: %d of %d checks failed\n", name_.c_str(), static_cast<int>(failed),
                   static_cast<int>(checks_.size()));
    }
    for (const std::string& problem : problems_) {
      std::fprintf(stderr, "%s: %s\n", name_.c_str(), problem.c_str());
    }
    std::fflush(stdout);
    return failed > 0 || !problems_.empty() ? 1 : 0;
  }

 private:
  static Check make_row(std::string case_name, std::string metric, const Measured& ours,
                        std::string note) {
    Check row;
    row.case_name = std::move(case_name);
    row.metric = std::move(metric);
    row.ours = ours.value;
    row.deviation = ours.deviation;
    row.note = std::move(note);
    if (ours.deviation) row.append_note("sd " + number_text(*ours.deviation, 3));
    return row;
  }

  static std::string measured_text(const Check& row) {
    std::string text = number_text(row.ours, 5);
    if (row.deviation) text += " (" + number_text(*row.deviation, 2) + ")";
    return text;
  }

  /// Letters of a UTF-8 text, which printf would pad by its bytes.
  static std::size_t text_width(const std::string& text) {
    return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
      return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
    }));
  }

  void print_checks() const {
    std::size_t case_width = 4;
    std::size_t metric_width = 6;
    for (const Check& row : checks_) {
      case_width = std::max(case_width, text_width(row.case_name));
      metric_width = std::max(metric_width, text_width(row.metric));
    }
    const auto padded = [](const std::string& text, std::size_t width) {
      return text + std::string(width - text_width(text), ' ');
    };
    const auto print = [&](const CsvRow& cells) {
      std::printf("  %s  %s  %11s  %18s  %9s  %9s  %s\n", padded(cells[0], case_width).c_str(),
                  padded(cells[1], metric_width).c_str(), cells[2].c_str(), cells[3].c_str(),
                  cells[4].c_str(), cells[5].c_str(), cells[6].c_str());
    };
    const auto percent = [](const std::optional<double>& share) {
      return share ? number_text(100.0 * *share, 3) + " %" : std::string();
    };
    if (!checks_.empty()) {
      print({"case", "metric", "paper", "ours", "error", "allowed", ""});
    }
    for (const Check& row : checks_) {
      // Without a relative error the tolerance is absolute.
      const std::string allowed = row.relative_error || !row.tolerance
                                      ? percent(row.tolerance)
                                      : number_text(*row.tolerance, 3);
      print({row.case_name, row.metric, row.paper ? number_text(*row.paper, 6) : "",
             measured_text(row), percent(row.relative_error), allowed, row.verdict()});
    }
  }

  void write_table(const char* kind, const std::string& name, const std::string& caption,
                   const std::vector<CsvRow>& lines) {
    std::string text;
    for (const CsvRow& line : lines) text += csv_line(line);
    const std::string file = "table_" + name + ".csv";
    write(file, text);
    contents_.push_back({kind, file, caption, ""});
  }

  void write(const std::string& file, std::string_view text) {
    if (auto error = write_text(folder_ / file, text)) fail(*std::move(error));
  }

  /// Said at once, as the run may still be long, and again at the end.
  void fail(std::string problem) {
    std::fprintf(stderr, "%s: %s\n", name_.c_str(), problem.c_str());
    problems_.push_back(std::move(problem));
  }

  std::string name_;
  About about_;
  std::filesystem::path folder_;
  std::vector<Check> checks_;
  std::vector<CsvRow> contents_;
  std::vector<std::string> problems_;
};

}  // namespace esokit::examples
