/// @file
/// One number beside the paper's, and the rule by which it counts as reproduced.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "csv.hpp"
#include "statistics.hpp"

namespace esokit::examples {

/// How far a number may be from the paper's. A plain number is a relative tolerance.
class Tolerance {
 public:
  Tolerance(double relative) : relative_(relative) {}

  [[nodiscard]] static Tolerance absolute(double largest_difference);

  /// Within `factor` standard deviations of the seeds.
  [[nodiscard]] static Tolerance deviations(double factor, const Statistics& seeds);

  /// This tolerance or a relative one, whichever is the wider.
  [[nodiscard]] Tolerance or_relative(double relative) const;

  /// The largest difference from `reference` that passes.
  [[nodiscard]] double difference(double reference) const;

  /// The rule in words; empty for a plain relative tolerance.
  [[nodiscard]] const std::string& rule() const { return rule_; }

 private:
  double relative_ = 0.0;
  double absolute_ = 0.0;
  std::string rule_;
};

/// One row of summary.csv.
struct Check {
  enum class Outcome { reported, pass, fail, known_miss };

  std::string case_name;
  std::string metric;
  std::optional<double> paper;      ///< printed in the paper
  std::optional<double> reference;  ///< of an own check: an independent run, a closed form
  double ours = 0.0;
  std::optional<double> deviation;  ///< standard deviation over the seeds; for the tables only
  std::optional<double> relative_error;
  std::optional<double> tolerance;  ///< relative; absolute where there is no relative error
  Outcome outcome = Outcome::reported;
  std::string note;

  /// Fills relative_error and tolerance; true if `ours` is near enough to `reference`.
  bool compare(double reference, const Tolerance& limit);

  void append_note(const std::string& text);

  /// "yes", "no", or empty when only reported.
  [[nodiscard]] std::string pass_text() const;

  /// What the console says.
  [[nodiscard]] std::string verdict() const;

  [[nodiscard]] CsvRow csv_row() const;
};

/// A number for a reader: as many decimals as `like` is printed with, but at least three
/// significant digits; without it four. Only very large and very small numbers have an exponent.
[[nodiscard]] std::string shown_text(double value, std::optional<double> like = std::nullopt);

/// "mean (deviation)", the mean with no more digits than mean something beside its scatter.
[[nodiscard]] std::string mean_text(double mean, double deviation);
[[nodiscard]] std::string mean_text(const Statistics& seeds);

/// Kinds of "does not reproduce".
enum class Miss {
  printed_number,  ///< a printed number is missed, and we do not know why
  other_reading,   ///< the text says other than what was simulated; a reading that works exists
  claim,           ///< a claim does not hold
  not_published    ///< settings or data that are needed are not published
};

/// A kind in words. They begin the note of a known miss, so that a reader of summary.csv can tell
/// it from a failure: both have pass = no.
[[nodiscard]] std::string_view miss_text(Miss kind);

/// The kind whose words a note begins with.
[[nodiscard]] std::optional<Miss> miss_in(std::string_view note);

/// "reference 0.5 (an independent run)": how the note of an own check begins.
[[nodiscard]] std::string reference_note(double reference, std::string_view source);

/// The header of summary.csv.
inline constexpr std::string_view summary_header =
    "case,metric,paper,ours,relative_error,tolerance,pass,note\n";

}  // namespace esokit::examples
