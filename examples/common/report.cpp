#include "report.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

namespace esokit::examples {
namespace {

// They begin the note of a known miss, so that a reader of summary.csv (make_page.py is one) can
// tell it from a failure: both have pass = no.
constexpr std::array miss_texts = {"printed number missed",
                                   "the text does not describe what was simulated",
                                   "a claim does not hold", "settings or data not published"};

std::string fixed(double value, int decimals) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string optional_text(const std::optional<double>& number, int digits) {
  return number ? number_text(*number, digits) : "";
}

/// The output folder from the command line.
std::string output_folder(int argc, char** argv) {
  std::optional<std::string> folder;
  for (int i = 1; i < argc; ++i) {
    std::string argument = argv[i];
    const bool help = argument == "--help" || argument == "-h";
    if (argument == "--out" && i + 1 < argc) {
      argument = argv[++i];
    } else if (argument.starts_with("--out=")) {
      argument.erase(0, 6);
    } else if (argument.starts_with("-")) {
      argument.clear();
    }
    if (argument.empty() || folder) {
      std::fprintf(help ? stdout : stderr,
                   "usage: %s [--out DIR | DIR]\nWrites its figures, tables and summary.csv below "
                   "DIR (default: out)\n",
                   std::filesystem::path(argv[0]).filename().c_str());
      std::exit(help ? 0 : 2);
    }
    folder = argument;
  }
  return folder.value_or("out");
}

}  // namespace

/// Two passes: the spread is often 1e-3 of the mean, where sums of squares lose their digits.
Statistics statistics(const std::vector<double>& values) {
  Statistics result{.count = values.size()};
  const auto count = static_cast<double>(values.size());
  for (const double value : values) result.mean += value;
  if (values.empty()) return result;
  result.mean /= count;
  double squares = 0.0;
  for (const double value : values) squares += (value - result.mean) * (value - result.mean);
  if (values.size() > 1) result.standard_deviation = std::sqrt(squares / (count - 1.0));
  result.standard_error = result.standard_deviation / std::sqrt(count);
  return result;
}

std::string shown_text(double value, std::optional<double> like) {
  if (!std::isfinite(value) || value == 0.0) return number_text(value);
  const double size = std::abs(value);
  if (size < 1e-30) return value < 0.0 ? "-0 (above -1e-30)" : "0 (below 1e-30)";
  if (size < 1e-4 || size >= 1e8) return number_text(value, 3);
  int decimals = std::max(0, (like ? 2 : 3) - static_cast<int>(std::floor(std::log10(size))));
  const std::string of_like = like ? number_text(*like) : "e";
  if (of_like.find('e') == std::string::npos) {
    const auto point = std::min(of_like.find('.'), of_like.size() - 1);
    decimals = std::max(static_cast<int>(of_like.size() - point - 1), std::min(decimals, 6));
  }
  return fixed(value, decimals);
}

std::string mean_text(const Statistics& seeds) {
  const double deviation = seeds.standard_deviation;
  if (!std::isfinite(deviation) || deviation <= 0.0) return shown_text(seeds.mean);
  // The deviation with two digits, and as many decimals for both.
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(deviation))), 0, 17);
  return fixed(seeds.mean, decimals) + " (" + fixed(deviation, decimals) + ")";
}

Tolerance Tolerance::absolute(double largest_difference) {
  Tolerance tolerance(0.0);
  tolerance.difference = largest_difference;
  tolerance.rule = "absolute tolerance " + number_text(largest_difference, 4);
  return tolerance;
}
Tolerance Tolerance::deviations(double factor, const Statistics& seeds) {
  Tolerance tolerance(0.0);
  tolerance.difference = factor * seeds.standard_deviation;
  tolerance.rule =
      "within " + number_text(factor, 4) + " sd over " + std::to_string(seeds.count) + " seeds";
  return tolerance;
}
Tolerance Tolerance::or_relative(double share) const {
  Tolerance wider = *this;
  wider.relative = std::max(relative, share);
  wider.rule += " or " + number_text(100.0 * share, 4) + " %";
  return wider;
}

// ---- checks ----

/// Fills relative_error and tolerance; true if `ours` is near enough to `target`.
bool Report::Check::compare(double target, const Tolerance& limit) {
  const double size = std::abs(target);
  const double difference = std::abs(ours.value - target);
  const double allowed = std::max(limit.difference, limit.relative * size);
  if (target != 0.0) relative_error = difference / size;
  tolerance = target != 0.0 ? allowed / size : allowed;
  append_note(limit.rule);
  return difference <= allowed;  // false for a NaN
}

void Report::Check::append_note(const std::string& text) {
  note += (note.empty() || text.empty() ? "" : "; ") + text;
}

std::string Report::Check::ours_text() const {
  if (!ours.deviation) return shown_text(ours.value, paper ? paper : reference);
  return mean_text({.mean = ours.value, .standard_deviation = *ours.deviation});
}

std::string Report::Check::verdict() const {
  constexpr std::array words = {"reported", "ok", "FAILED", "missed"};
  return words[static_cast<std::size_t>(outcome)];
}

Report::Check& Report::begin(std::string_view case_name, std::string_view metric,
                             const Measured& ours, std::string_view note) {
  checks_.push_back({std::string(case_name), std::string(metric), ours, std::string(note)});
  if (ours.deviation) checks_.back().append_note("sd " + number_text(*ours.deviation, 3));
  return checks_.back();
}

void Report::check(std::string_view case_name, std::string_view metric, std::optional<double> paper,
                   const Measured& ours, const std::optional<Tolerance>& tolerance,
                   std::string_view note) {
  Check& row = begin(case_name, metric, ours, note);
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
}

void Report::check_single_run(std::string_view case_name, std::string_view metric, double printed,
                              const Statistics& ours, std::string_view note, bool missed) {
  const auto tolerance = Tolerance::deviations(3.0, ours);
  if (missed) {
    known_miss(case_name, metric, printed, ours, tolerance, note);
  } else if (tolerance.difference > std::abs(printed)) {
    check(case_name, metric, printed, ours, std::nullopt,
          "not judged: 3 sd are more than the number");
  } else {
    check(case_name, metric, printed, ours, tolerance, note);
  }
}

void Report::check_reference(std::string_view case_name, std::string_view metric, double reference,
                             const Measured& ours, const Tolerance& tolerance,
                             std::string_view source) {
  Check& row = begin(case_name, metric, ours,
                     "reference " + number_text(reference, 6) + " (" + std::string(source) + ")");
  row.reference = reference;
  row.outcome = row.compare(reference, tolerance) ? Check::Outcome::pass : Check::Outcome::fail;
}

void Report::expect(std::string_view case_name, std::string_view metric, const Measured& ours,
                    bool holds, std::string_view rule) {
  begin(case_name, metric, ours, rule).outcome =
      holds ? Check::Outcome::pass : Check::Outcome::fail;
}

void Report::known_miss(std::string_view case_name, std::string_view metric, double paper,
                        const Measured& ours, const Tolerance& tolerance, std::string_view reason,
                        Miss kind) {
  Check& row = begin(case_name, metric, ours, {});
  row.paper = paper;
  const bool near = row.compare(paper, tolerance);
  row.outcome = near ? Check::Outcome::pass : Check::Outcome::known_miss;
  const std::string limits = std::exchange(
      row.note, near ? "was marked as a known miss, but reproduces"
                     : miss_texts[static_cast<std::size_t>(kind)] + (": " + std::string(reason)));
  row.append_note(limits);
}

// ---- what the page shows ----

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

  std::vector<CsvRow> lines{{"case"}};
  for (const std::string& case_name : cases) lines.push_back({case_name});
  for (const std::string& metric : metrics) {
    std::vector<const Check*> rows;
    for (const std::string& case_name : cases) {
      const auto row = std::find_if(checks_.begin(), checks_.end(), [&](const Check& check) {
        return check.case_name == case_name && check.metric == metric;
      });
      rows.push_back(row == checks_.end() ? nullptr : &*row);
    }
    const auto column = [&](const char* heading, auto text, bool always) {
      if (!always && std::all_of(rows.begin(), rows.end(), [&](const Check* row) {
            return row == nullptr || text(*row).empty();
          })) {
        return;
      }
      lines[0].push_back(metric + heading);
      for (std::size_t i = 0; i < rows.size(); ++i) {
        lines[i + 1].push_back(rows[i] == nullptr ? "" : text(*rows[i]));
      }
    };
    column(
        ", paper", [](const Check& row) { return optional_text(row.paper, 6); }, false);
    column(
        ", reference", [](const Check& row) { return optional_text(row.reference, 6); }, false);
    column(
        ", ours", [](const Check& row) { return row.ours_text(); }, true);
    column(
        ", result", [](const Check& row) { return row.verdict(); }, true);
  }
  write_table("comparison", name, caption, lines);
}

void Report::table(const std::string& name, const std::string& caption, CsvRow header,
                   std::vector<CsvRow> rows) {
  rows.insert(rows.begin(), std::move(header));
  write_table("table", name, caption, rows);
}

void Report::add(const Figure& figure) {
  if (!figure.write(folder_)) return fail("cannot draw the figure " + figure.name());
  contents_.push_back({"figure", figure.name(), figure.caption(), figure.caption(),
                       std::to_string(figure.grid().rows), std::to_string(figure.grid().columns)});
}

void Report::diagram(const std::string& name, const std::string& caption, std::string_view svg) {
  write(name + ".svg", svg);
  contents_.push_back({"diagram", name, caption});
}

void Report::link(const std::string& file, const std::string& text) {
  contents_.push_back({"page", file, text});
}

void Report::remark(const std::string& text) { contents_.push_back({"remark", "", text}); }

void Report::not_reproduced(const std::string& text, Miss kind) {
  contents_.push_back({"not_reproduced", miss_texts[static_cast<std::size_t>(kind)], text});
}

void Report::claim(const Claim& claim) {
  constexpr std::array verdicts = {"holds", "holds in part", "does not hold", "not tested"};
  contents_.push_back({"claim", claim.where, claim.text,
                       verdicts[static_cast<std::size_t>(claim.holds)], claim.here, claim.figure});
}

void Report::correction(const Correction& correction) {
  contents_.push_back(
      {"correction", correction.where, correction.printed, correction.correct, correction.why});
}

void Report::additions(bool on) { contents_.push_back({"additions", "", on ? "on" : "off"}); }

void Report::cover(const std::string& figure) { contents_.push_back({"cover", figure}); }

// ---- begin and end ----

std::string take_option(int& argc, char** argv, std::string_view name, std::string otherwise) {
  char** const end = argv + argc;
  char** const found = std::find(argv, end, name);
  if (end - found < 2) return otherwise;
  otherwise = found[1];
  std::copy(found + 2, end, found);
  argc -= 2;
  return otherwise;
}

std::int64_t take_count(int& argc, char** argv, std::string_view name, std::int64_t otherwise) {
  const std::string given = take_option(argc, argv, name, std::to_string(otherwise));
  std::int64_t count = 0;
  const char* const end = given.data() + given.size();
  const auto read = std::from_chars(given.data(), end, count);
  if (read.ec != std::errc{} || read.ptr != end || count < 0) {
    std::fprintf(stderr, "%.*s %s: must be a whole number, 0 or more\n",
                 static_cast<int>(name.size()), name.data(), given.c_str());
    std::exit(2);
  }
  return count;
}

Report::Report(int argc, char** argv, const std::string& paper, const std::string& example,
               About about)
    : name_(paper + "/" + example),
      folder_(output_folder(argc, argv) + "/" + name_),
      about_(std::move(about)) {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) fail("cannot make the folder " + folder_ + ": " + error.message());
  // Results of an earlier run must not stand for this one if it ends early.
  std::filesystem::remove(folder_ + "/summary.csv", error);
  std::filesystem::remove(folder_ + "/contents.csv", error);
  std::printf("%s: %s\n", name_.c_str(), about_.title.c_str());
  std::fflush(stdout);
}

Report::~Report() = default;

int Report::finish() {
  std::string summary = "case,metric,paper,ours,relative_error,tolerance,pass,note\n";
  std::ptrdiff_t failed = 0;
  for (const Check& row : checks_) {
    constexpr std::array pass = {"", "yes", "no", "no"};
    summary += csv_line({row.case_name, row.metric, optional_text(row.paper, 9),
                         number_text(row.ours.value), optional_text(row.relative_error, 4),
                         optional_text(row.tolerance, 4),
                         pass[static_cast<std::size_t>(row.outcome)], row.note});
    std::printf("  %-8s %s, %s: %s", row.verdict().c_str(), row.case_name.c_str(),
                row.metric.c_str(), row.ours_text().c_str());
    if (row.paper) std::printf(", paper %s", number_text(*row.paper, 6).c_str());
    if (row.relative_error) std::printf(", error %.3g %%", 100.0 * *row.relative_error);
    std::printf("\n");
    failed += row.outcome == Check::Outcome::fail ? 1 : 0;
  }
  std::vector<CsvRow> about = {{"kind", "name", "text", "alt", "more", "figure"},
                               {"paper_title", "", about_.paper_title},
                               {"citation", "", about_.citation},
                               {"link", "", about_.link},
                               {"title", "", about_.title},
                               {"description", "", about_.description},
                               {"order", "", std::to_string(about_.order)}};
  if (about_.addition) about.push_back({"addition"});
  std::string contents;
  for (const auto* rows : {&about, &contents_}) {
    for (CsvRow row : *rows) {
      row.resize(6);
      contents += csv_line(row);
    }
  }
  write("contents.csv", contents);
  write("summary.csv", summary);
  std::fflush(stdout);
  if (failed > 0) {
    std::fprintf(stderr, "%s: %td of %zu checks failed\n", name_.c_str(), failed, checks_.size());
  }
  for (const std::string& problem : problems_) {
    std::fprintf(stderr, "%s: %s\n", name_.c_str(), problem.c_str());
  }
  return failed > 0 || !problems_.empty() ? 1 : 0;
}

void Report::write_table(const char* kind, const std::string& name, const std::string& caption,
                         const std::vector<CsvRow>& lines) {
  std::string text;
  for (const CsvRow& line : lines) text += csv_line(line);
  const std::string file = "table_" + name + ".csv";
  write(file, text);
  contents_.push_back({kind, file, caption});
}

void Report::write(const std::string& file, std::string_view text) {
  if (!write_text(folder_ + "/" + file, text)) fail("cannot write " + folder_ + "/" + file);
}

void Report::fail(const std::string& problem) {
  std::fprintf(stderr, "%s: %s\n", name_.c_str(), problem.c_str());
  problems_.push_back(problem);
}

}  // namespace esokit::examples
