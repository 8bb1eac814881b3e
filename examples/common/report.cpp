#include "report.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <system_error>
#include <utility>

#include "command_line.hpp"

namespace esokit::examples {
namespace {

Check make_row(std::string_view case_name, std::string_view metric, const Measured& ours,
               std::string_view note) {
  Check row;
  row.case_name = case_name;
  row.metric = metric;
  row.ours = ours.value;
  row.deviation = ours.deviation;
  row.note = note;
  if (ours.deviation) row.append_note("sd " + number_text(*ours.deviation, 3));
  return row;
}

std::string measured_text(const Check& row) {
  return row.deviation ? mean_text(row.ours, *row.deviation)
                       : shown_text(row.ours, row.paper ? row.paper : row.reference);
}

/// Letters of a UTF-8 text, which printf would pad by its bytes.
std::size_t text_width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
}

}  // namespace

Report::Report(int argc, char** argv, const std::string& paper, const std::string& example,
               About about)
    : name_(paper + "/" + example), about_(std::move(about)) {
  folder_ = output_folder(argc, argv, "Writes its figures, tables and summary.csv below") / paper /
            example;
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) fail("cannot make the folder " + folder_.string() + ": " + error.message());
  // Results of an earlier run must not stand for this one if it ends early.
  std::filesystem::remove(folder_ / "summary.csv", error);
  std::filesystem::remove(folder_ / "contents.csv", error);
  std::printf("%s: %s\n", name_.c_str(), about_.title.c_str());
  std::fflush(stdout);
}

void Report::check(std::string_view case_name, std::string_view metric, std::optional<double> paper,
                   Measured ours, std::optional<Tolerance> tolerance, std::string_view note) {
  Check row = make_row(case_name, metric, ours, note);
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

void Report::check_reference(std::string_view case_name, std::string_view metric, double reference,
                             Measured ours, const Tolerance& tolerance, std::string_view source) {
  Check row = make_row(case_name, metric, ours, reference_note(reference, source));
  row.reference = reference;
  row.outcome = row.compare(reference, tolerance) ? Check::Outcome::pass : Check::Outcome::fail;
  checks_.push_back(std::move(row));
}

void Report::expect(std::string_view case_name, std::string_view metric, Measured ours, bool holds,
                    std::string_view rule) {
  Check row = make_row(case_name, metric, ours, rule);
  row.outcome = holds ? Check::Outcome::pass : Check::Outcome::fail;
  checks_.push_back(std::move(row));
}

void Report::known_miss(std::string_view case_name, std::string_view metric, double paper,
                        Measured ours, const Tolerance& tolerance, std::string_view reason,
                        Miss kind) {
  Check row = make_row(case_name, metric, ours, {});
  row.paper = paper;
  const bool near = row.compare(paper, tolerance);
  row.outcome = near ? Check::Outcome::pass : Check::Outcome::known_miss;
  const std::string limits = std::exchange(row.note, {});
  row.append_note(near ? "was marked as a known miss, but reproduces"
                       : std::string(miss_text(kind)) + ": " + std::string(reason));
  row.append_note(limits);
  checks_.push_back(std::move(row));
}

void Report::comparison(const std::string& name, const std::string& caption,
                        std::vector<std::string> cases, std::vector<std::string> metrics) {
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

  const auto find = [this](const std::string& case_name, const std::string& metric) {
    const auto row = std::find_if(checks_.begin(), checks_.end(), [&](const Check& check) {
      return check.case_name == case_name && check.metric == metric;
    });
    return row == checks_.end() ? nullptr : &*row;
  };
  std::vector<CsvRow> lines(1 + cases.size());
  lines[0].push_back("case");
  for (std::size_t i = 0; i < cases.size(); ++i) lines[i + 1].push_back(cases[i]);
  for (const std::string& metric : metrics) {
    bool any_paper = false;
    bool any_reference = false;
    for (const std::string& case_name : cases) {
      const Check* row = find(case_name, metric);
      any_paper = any_paper || (row != nullptr && row->paper);
      any_reference = any_reference || (row != nullptr && row->reference);
    }
    if (any_paper) lines[0].push_back(metric + ", paper");
    if (any_reference) lines[0].push_back(metric + ", reference");
    for (const char* part : {", ours", ", result"}) lines[0].push_back(metric + part);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const Check* row = find(cases[i], metric);
      const auto add = [&](const std::optional<double>& number) {
        lines[i + 1].push_back(number ? number_text(*number, 6) : "");
      };
      if (any_paper) add(row == nullptr ? std::nullopt : row->paper);
      if (any_reference) add(row == nullptr ? std::nullopt : row->reference);
      lines[i + 1].push_back(row == nullptr ? "" : measured_text(*row));
      lines[i + 1].push_back(row == nullptr ? "" : row->verdict());
    }
  }
  write_table("comparison", name, caption, lines);
}

void Report::table(const std::string& name, const std::string& caption, CsvRow header,
                   std::vector<CsvRow> rows) {
  rows.insert(rows.begin(), std::move(header));
  write_table("table", name, caption, rows);
}

void Report::add(const Figure& figure) {
  if (const auto error = figure.write(folder_)) {
    fail(*error);
  } else {
    add_content("figure", figure.name(), figure.caption(), figure.alt(),
                std::to_string(figure.grid().rows), std::to_string(figure.grid().columns));
  }
}

void Report::diagram(const std::string& name, const std::string& caption, std::string_view svg) {
  write(name + ".svg", svg);
  add_content("diagram", name, caption);
}

void Report::remark(std::string_view text) { add_content("remark", "", text); }

void Report::not_reproduced(std::string_view text, Miss kind) {
  add_content("not_reproduced", miss_text(kind), text);
}

void Report::claim(const Claim& claim) {
  constexpr std::array verdicts = {"holds", "holds in part", "does not hold", "not tested"};
  add_content("claim", claim.where, claim.text, verdicts[static_cast<std::size_t>(claim.holds)],
              claim.here, claim.figure);
}

void Report::correction(const Correction& correction) {
  add_content("correction", correction.where, correction.printed, correction.correct,
              correction.why);
}

void Report::additions(bool on) { add_content("additions", "", on ? "on" : "off"); }

void Report::cover(std::string_view figure) { add_content("cover", figure, ""); }

void Report::add_content(std::string_view kind, std::string_view name, std::string_view text,
                         std::string_view alt, std::string_view more, std::string_view figure) {
  contents_.push_back({std::string(kind), std::string(name), std::string(text), std::string(alt),
                       std::string(more), std::string(figure)});
}

int Report::finish() {
  print_checks();
  std::string summary{summary_header};
  for (const Check& check : checks_) summary += csv_line(check.csv_row());
  std::string contents = csv_line({"kind", "name", "text", "alt", "more", "figure"});
  for (const auto& [kind, text] :
       {std::pair<const char*, const std::string&>{"paper_title", about_.paper_title},
        {"citation", about_.citation},
        {"link", about_.link},
        {"title", about_.title},
        {"description", about_.description}}) {
    contents += csv_line({kind, "", text, "", "", ""});
  }
  contents += csv_line({"order", "", std::to_string(about_.order), "", "", ""});
  if (about_.addition) contents += csv_line({"addition", "", "", "", "", ""});
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

void Report::print_checks() const {
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

void Report::write_table(const char* kind, const std::string& name, const std::string& caption,
                         const std::vector<CsvRow>& lines) {
  std::string text;
  for (const CsvRow& line : lines) text += csv_line(line);
  const std::string file = "table_" + name + ".csv";
  write(file, text);
  add_content(kind, file, caption);
}

void Report::write(const std::string& file, std::string_view text) {
  if (auto error = write_text(folder_ / file, text)) fail(*std::move(error));
}

void Report::fail(std::string problem) {
  std::fprintf(stderr, "%s: %s\n", name_.c_str(), problem.c_str());
  problems_.push_back(std::move(problem));
}

}  // namespace esokit::examples
