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

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "csv.hpp"
#include "figure.hpp"

namespace esokit::examples {

/// What the page out/index.html says of an example.
struct About {
  std::string paper_title = {};  ///< heading of the paper's section
  std::string citation = {};     ///< authors, title, journal, year
  std::string link = {};         ///< the paper's DOI as an address
  std::string title = {};        ///< heading of this example
  std::string description = {};  ///< one or two sentences: what is simulated, which way it runs
  int order = 100;               ///< place on the paper's page, as in the paper; then by name
  bool addition = false;         ///< nothing of it is in the paper
};

/// What the paper says, and whether it holds here: once for each claim, its only verdict. `holds`
/// is computed by the program.
struct Claim {
  enum class Holds { yes, partly, no, not_tested };

  std::string text = {};   ///< the claim, in our words
  std::string where = {};  ///< section, figure or table of the paper
  Holds holds = Holds::not_tested;
  std::string here = {};    ///< what comes out here, with its numbers
  std::string figure = {};  ///< name of our figure or table that shows it
};

/// A printed formula that cannot be what was computed.
struct Correction {
  std::string where = {};    ///< number of the equation or table
  std::string printed = {};  ///< as it stands in the paper
  std::string correct = {};  ///< as it must be
  std::string why = {};      ///< the reason, with numbers
};

/// Kinds of "does not reproduce".
enum class Miss {
  printed_number,  ///< a printed number is missed, and we do not know why
  other_reading,   ///< the text does not describe what was simulated; another reading works
  not_published    ///< settings or data that are needed are not published
};

/// Mean and spread of one number over the seeds.
struct Statistics {
  std::size_t count = 0;
  double mean = 0.0;
  double standard_deviation = 0.0;  ///< of the sample: divided by count - 1; 0 for one value
  double standard_error = 0.0;      ///< of the mean
};
[[nodiscard]] Statistics statistics(const std::vector<double>& values);

/// Of the number that `number` takes out of every run, e.g. `statistics_of(runs, &Run::error)`.
template <class Runs, class Number>
[[nodiscard]] Statistics statistics_of(const Runs& runs, Number number) {
  std::vector<double> values;
  for (const auto& run : runs) values.push_back(static_cast<double>(std::invoke(number, run)));
  return statistics(values);
}

/// A number for a reader: as many decimals as `like` is printed with, but at least three
/// significant digits; without it four. Only very large and very small numbers have an exponent.
[[nodiscard]] std::string shown_text(double value, std::optional<double> like = std::nullopt);

/// "mean (deviation)", the mean with no more digits than mean something beside its scatter.
[[nodiscard]] std::string mean_text(const Statistics& seeds);

/// A number of ours, with its spread where it is a mean over seeds.
struct Measured {
  Measured(double number) : value(number) {}
  Measured(const Statistics& seeds) : value(seeds.mean), deviation(seeds.standard_deviation) {}

  double value;
  std::optional<double> deviation;
};

/// A printed number that is of one run with noise, beside ours over the seeds.
struct SingleRun {
  std::string case_name, metric;
  double printed = 0.0;
  Statistics ours;
  std::string note = {};

  /// Standard deviation of the difference: a single run's and that of our mean.
  [[nodiscard]] double deviation() const;
  /// z: the difference in these.
  [[nodiscard]] double z() const { return (printed - ours.mean) / deviation(); }
  /// A run scatters so much that being near would say nothing.
  [[nodiscard]] bool too_wide() const;
};

/// How printed numbers of single runs are judged, for all papers; `rule` says it to a reader.
///
/// The numbers of a column (or of a table) are judged together, by chi-square = sum of z^2 with z
/// the difference in standard deviations of a single run. `probability` is that of a larger sum if
/// the numbers were independent. The runs of a paper may share their noise; then the sum scatters
/// more, at most as if all z were one number, which is what `largest_rms` is for.
struct PrintedColumn {
  enum class Verdict { reproduced, doubtful, not_reproduced, not_judged };

  static constexpr double within = 2.0;              ///< sd, of a single number that is met
  static constexpr double widest = 0.2;              ///< share of a number that 3 sd may be
  static constexpr double least_probability = 0.05;  ///< of a column that is reproduced
  static constexpr double largest_rms = 2.0;         ///< of z in a column that is not refuted

  /// `fitted`: how many quantities of our set-up were chosen such that these numbers come near.
  PrintedColumn(const std::vector<SingleRun>& numbers, int fitted = 0);

  [[nodiscard]] static std::string rule(std::size_t seeds);
  [[nodiscard]] std::string verdict_text() const;

  int judged = 0;  ///< numbers that are not too wide; only they are in the sum
  int degrees_of_freedom = 0;
  double chi_square = 0.0, probability = 1.0;
  double rms = 0.0;  ///< of z: the root of chi-square over degrees of freedom
  Verdict verdict = Verdict::not_judged;
};

/// Probability that chi-square is larger, for a whole number of degrees of freedom.
[[nodiscard]] double chi_square_tail(double chi_square, int degrees_of_freedom);

/// How far a number may be from the paper's. A plain number is a relative tolerance.
struct Tolerance {
  Tolerance(double share) : relative(share) {}
  [[nodiscard]] static Tolerance absolute(double largest_difference);
  /// Within `factor` standard deviations of the seeds.
  [[nodiscard]] static Tolerance deviations(double factor, const Statistics& seeds);
  /// Two means over seeds, ours and one over `other_count` seeds of another program: within
  /// `factor` standard errors of their difference.
  [[nodiscard]] static Tolerance means(double factor, const Statistics& seeds,
                                       std::size_t other_count);
  /// This tolerance or a relative one, whichever is the wider.
  [[nodiscard]] Tolerance or_relative(double share) const;

  double relative = 0.0;
  double difference = 0.0;  ///< the absolute part
  std::string rule = {};    ///< in words; empty for a plain relative tolerance
};

/// What follows `name` ("--runs") on the command line, of which both are taken out for Report;
/// `otherwise` if it is not there.
std::string take_option(int& argc, char** argv, std::string_view name, std::string otherwise);
/// The same for a number of runs or logs. What is no such number ends the program with exit code 2.
std::int64_t take_count(int& argc, char** argv, std::string_view name, std::int64_t otherwise);

/// One example's results. Console output and files; nothing throws, what fails shows in finish().
class Report {
 public:
  /// Reads `[--out DIR | DIR]` from the command line and makes DIR/<paper>/<example>. A command
  /// line that it does not understand ends the program with exit code 2.
  Report(int argc, char** argv, const std::string& paper, const std::string& example, About about);
  Report(const Report&) = delete;
  ~Report();

  /// Where the files of this example go.
  [[nodiscard]] const std::string& folder() const { return folder_; }

  /// Our number beside the paper's printed one. With a tolerance it must reproduce, without one it
  /// is not judged; `paper` is std::nullopt where the paper prints no number.
  void check(std::string_view case_name, std::string_view metric, std::optional<double> paper,
             const Measured& ours, const std::optional<Tolerance>& tolerance = std::nullopt,
             std::string_view note = {});

  /// Printed numbers of single runs, judged as a column and one by one (see PrintedColumn). A
  /// number is met if it is near and its column is reproduced; one that is far is missed, which
  /// does not fail the program. What fails it is a verdict on the column other than `expected`.
  void check_column(const std::string& name, const std::vector<SingleRun>& numbers,
                    PrintedColumn::Verdict expected, int fitted = 0);

  /// The columns so far as a table, with the rule.
  void columns(std::size_t seeds);

  /// Our number beside one that is not printed in the paper (an independent run, a closed form):
  /// it must reproduce. An own check: the paper's column stays empty, and the note begins with the
  /// reference and its source, which the page shows in a column of its own.
  void check_reference(std::string_view case_name, std::string_view metric, double reference,
                       const Measured& ours, const Tolerance& tolerance,
                       std::string_view source = "independent run");

  /// A statement about our number that must hold; `rule` says it in words ("diverges").
  void expect(std::string_view case_name, std::string_view metric, const Measured& ours, bool holds,
              std::string_view rule);

  /// A printed number that is known to be missed; `reason` says why, or what was tried. Shown as
  /// missed, with its kind, without failing the program. Should it be met after all, it passes.
  void known_miss(std::string_view case_name, std::string_view metric, double paper,
                  const Measured& ours, const Tolerance& tolerance, std::string_view reason,
                  Miss kind = Miss::printed_number);

  /// The checks so far as a table with a line a case and a column a metric, paper beside ours.
  /// `cases` and `metrics` choose and order; empty means all.
  void comparison(const std::string& name, const std::string& caption,
                  std::vector<std::string> cases = {}, std::vector<std::string> metrics = {});

  /// A table with free columns: table_NAME.csv and a table on the page.
  void table(const std::string& name, const std::string& caption, CsvRow header,
             std::vector<CsvRow> rows);

  /// Writes the figure's data, draws it and shows it on the page.
  void add(const Figure& figure);
  /// A drawing that is not a plot: NAME.svg with this text.
  void diagram(const std::string& name, const std::string& caption, std::string_view svg);
  /// A file in the example's folder that the page leads to.
  void link(const std::string& file, const std::string& text);
  /// A paragraph for the page: conventions, variants, what the reader should see.
  void remark(const std::string& text);
  /// Says plainly what of the paper did not reproduce; shown at the top of its page.
  void not_reproduced(const std::string& text, Miss kind = Miss::printed_number);
  /// Shown in tables at the top of the paper's page.
  void claim(const Claim& claim);
  void correction(const Correction& correction);
  /// All figures, tables and remarks from here on are additions of ours (or, with false, the
  /// paper's again): they come after the paper's own, at the end of its page.
  void additions(bool on = true);

  /// Prints the checks, writes summary.csv and contents.csv. The exit code of the program: non-zero
  /// if a number that must reproduce was missed, or a figure or file could not be written.
  [[nodiscard]] int finish();

 private:
  /// One row of summary.csv.
  struct Check {
    enum class Outcome { reported, pass, fail, known_miss };

    std::string case_name, metric;
    Measured ours;
    std::string note;
    std::optional<double> paper = {};      ///< printed in the paper
    std::optional<double> reference = {};  ///< of an own check
    Outcome outcome = Outcome::reported;
    std::optional<double> relative_error = {};
    std::optional<double> tolerance = {};  ///< relative; absolute where there is no relative error

    bool compare(double target, const Tolerance& limit);
    void append_note(const std::string& text);
    [[nodiscard]] std::string ours_text() const;
    [[nodiscard]] std::string verdict() const;
  };

  Check& begin(std::string_view case_name, std::string_view metric, const Measured& ours,
               std::string_view note);
  void write_table(const char* kind, const std::string& name, const std::string& caption,
                   const std::vector<CsvRow>& lines);
  void write(const std::string& file, std::string_view text);
  /// Said at once, as the run may still be long, and again at the end.
  void fail(const std::string& problem);

  std::string name_, folder_;
  About about_;
  std::vector<Check> checks_;
  std::vector<CsvRow> columns_;
  std::vector<CsvRow> contents_;  ///< kind, name, text, alt, more, figure
  std::vector<std::string> problems_;
};

}  // namespace esokit::examples
