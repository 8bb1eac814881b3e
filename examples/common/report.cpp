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

#include "system.hpp"

namespace esokit::examples {
namespace {

// They begin the note of a known miss, so that a reader of summary.csv (make_page.py is one) can
// tell it from a failure: both have pass = no.
constexpr std::array miss_texts = {"printed number missed",
                                   "the text does not describe what was simulated",
                                   "settings or data not published"};

// They begin the note of a column's row in the same way.
constexpr std::array column_texts = {"reproduces", "doubtful", "does not reproduce", "not judged"};
constexpr const char* column_metric = "chi-square of the column";

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
                   path_of(argv[0]).filename().string().c_str());
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
  const auto decimals_for = [](int digits, double number) {
    return std::clamp(digits - 1 - static_cast<int>(std::floor(std::log10(number))), 0, 17);
  };
  // The deviation with two digits, and as many decimals for both; but the mean with four digits at
  // most. Where the deviation is nothing beside that, it says only this.
  const double size = std::max(std::abs(seeds.mean), deviation);
  const int decimals = std::min(decimals_for(2, deviation), decimals_for(4, size));
  const std::string spread = fixed(deviation, decimals);
  const bool seen = spread.find_first_of("123456789") != std::string::npos;
  return fixed(seeds.mean, decimals) + " (" + (seen ? spread : "nearly 0") + ")";
}

double chi_square_tail(double chi_square, int degrees_of_freedom) {
  // Q(a + 1, x) = Q(a, x) + x^a e^-x / Gamma(a + 1), from Q(1, x) or Q(1/2, x).
  const double x = 0.5 * chi_square;
  double a = degrees_of_freedom % 2 == 0 ? 1.0 : 0.5;
  double tail = degrees_of_freedom % 2 == 0 ? std::exp(-x) : std::erfc(std::sqrt(x));
  for (; a < 0.5 * degrees_of_freedom && x > 0.0; a += 1.0) {
    tail += std::exp(a * std::log(x) - x - std::lgamma(a + 1.0));
  }
  return tail;
}

double SingleRun::deviation() const {
  return std::hypot(ours.standard_deviation, ours.standard_error);
}
bool SingleRun::too_wide() const {
  return 3.0 * ours.standard_deviation > PrintedColumn::widest * std::abs(printed);
}

PrintedColumn::PrintedColumn(const std::vector<SingleRun>& numbers, int fitted) {
  for (const SingleRun& number : numbers) {
    if (number.too_wide()) continue;
    ++judged;
    chi_square += number.z() * number.z();
  }
  degrees_of_freedom = judged - fitted;
  if (degrees_of_freedom <= 0) return;
  probability = chi_square_tail(chi_square, degrees_of_freedom);
  rms = std::sqrt(chi_square / degrees_of_freedom);
  verdict = probability >= least_probability ? Verdict::reproduced
            : rms <= largest_rms             ? Verdict::doubtful
                                             : Verdict::not_reproduced;
}

std::string PrintedColumn::rule(std::size_t seeds) {
  const auto text = [](double number) { return number_text(number, 3); };
  return "Printed numbers of single runs with noise, beside mean and standard deviation (sd) of "
         "ours over " +
         std::to_string(seeds) + " seeds. Where 3 sd are more than " + text(100.0 * widest) +
         " % of a number, it can only be missed, beyond 3 sd. The others of a column are judged "
         "together, by p, the probability of a larger sum of z^2; z is the difference in sd. The "
         "column reproduces if p is " +
         text(100.0 * least_probability) + " % or more, and does not if the rms of z is above " +
         text(largest_rms) +
         "; between the two it is doubtful. A number of a column that reproduces is met within " +
         text(within) + " sd, else missed.";
}

std::string PrintedColumn::verdict_text() const {
  return column_texts[static_cast<std::size_t>(verdict)];
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
Tolerance Tolerance::means(double factor, const Statistics& seeds, std::size_t other_count) {
  Tolerance tolerance(0.0);
  tolerance.difference =
      factor * std::hypot(seeds.standard_error,
                          seeds.standard_deviation / std::sqrt(static_cast<double>(other_count)));
  tolerance.rule = "within " + number_text(factor, 4) + " standard errors of the means over " +
                   std::to_string(seeds.count) + " and " + std::to_string(other_count) + " seeds";
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

void Report::check_column(const std::string& name, const std::vector<SingleRun>& numbers,
                          PrintedColumn::Verdict expected, int fitted) {
  const PrintedColumn column(numbers, fitted);
  for (const SingleRun& number : numbers) {
    const double limit = number.too_wide() ? 3.0 : PrintedColumn::within;
    const double z = number.z();
    const bool near = std::abs(z) <= limit;
    std::string said;
    if (!near) {
      said = miss_texts[0] + (": by " + number_text(std::abs(z), 3) + " sd");
    } else if (number.too_wide()) {
      said = "not judged: 3 sd are more than " + number_text(100.0 * PrintedColumn::widest) +
             " % of it";
    } else if (column.verdict != PrintedColumn::Verdict::reproduced) {
      said = "not judged: near, but " + name + ": " + column.verdict_text();
    }
    Check& row = begin(number.case_name, number.metric, number.ours, said);
    row.paper = number.printed;
    Tolerance tolerance = Tolerance::deviations(limit, number.ours);
    tolerance.difference = limit * number.deviation();
    row.compare(number.printed, tolerance);
    row.append_note(number.note);
    row.outcome = !near          ? Check::Outcome::known_miss
                  : said.empty() ? Check::Outcome::pass
                                 : Check::Outcome::reported;
  }
  const std::string unexpected =
      column.verdict == expected
          ? ""
          : "expected: " + std::string(column_texts[static_cast<std::size_t>(expected)]) + "; ";
  std::string said = unexpected + column.verdict_text();
  if (column.degrees_of_freedom <= 0) {
    said += ": " + std::to_string(column.judged) + " numbers to judge";
    if (fitted > 0) said += ", " + std::to_string(fitted) + " quantities fitted";
  } else {
    said += ": " + std::to_string(column.degrees_of_freedom) +
            " degrees of freedom, p = " + number_text(column.probability, 2) +
            ", rms z = " + number_text(column.rms, 3);
  }
  constexpr std::array outcomes = {Check::Outcome::pass, Check::Outcome::known_miss,
                                   Check::Outcome::known_miss, Check::Outcome::reported};
  Check& row = begin(name, column_metric, column.chi_square, said);
  row.outcome = unexpected.empty() ? outcomes[static_cast<std::size_t>(column.verdict)]
                                   : Check::Outcome::fail;
  const bool judged = column.degrees_of_freedom > 0;
  columns_.push_back({name, std::to_string(numbers.size()), std::to_string(column.judged),
                      judged ? std::to_string(column.degrees_of_freedom) : "",
                      judged ? shown_text(column.chi_square) : "",
                      judged ? number_text(column.probability, 2) : "",
                      judged ? number_text(column.rms, 3) : "", column.verdict_text()});
}

void Report::columns(std::size_t seeds) {
  table("columns", "What reproduces. " + PrintedColumn::rule(seeds),
        {"column", "printed", "in chi-square", "degrees of freedom", "chi-square", "p", "rms z",
         "verdict"},
        columns_);
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
      if (row.metric == column_metric) continue;
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
    // A metric of other cases has no column here.
    if (std::all_of(rows.begin(), rows.end(), [](const Check* row) { return row == nullptr; })) {
      continue;
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
