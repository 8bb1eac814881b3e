/// @file
/// One number beside the paper's, and the rule by which it counts as reproduced.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "csv.hpp"
#include "statistics.hpp"

namespace esokit::examples {

/// How far a number may be from the paper's. A plain number is a relative tolerance.
class Tolerance {
 public:
  Tolerance(double relative) : relative_(relative) {}

  [[nodiscard]] static Tolerance absolute(double largest_difference) {
    Tolerance tolerance(0.0);
    tolerance.absolute_ = largest_difference;
    tolerance.rule_ = "absolute tolerance " + number_text(largest_difference, 4);
    return tolerance;
  }

  /// Within `factor` standard deviations of the seeds.
  [[nodiscard]] static Tolerance deviations(double factor, const Statistics& seeds) {
    Tolerance tolerance(0.0);
    tolerance.absolute_ = factor * seeds.standard_deviation;
    tolerance.rule_ =
        "within " + number_text(factor, 4) + " sd over " + std::to_string(seeds.count) + " seeds";
    return tolerance;
  }

  /// This tolerance or a relative one, whichever is the wider.
  [[nodiscard]] Tolerance or_relative(double relative) const {
    Tolerance wider = *this;
    wider.relative_ = std::max(relative_, relative);
    wider.rule_ += " or " + number_text(100.0 * relative, 4) + " %";
    return wider;
  }

  /// The largest difference from `reference` that passes.
  [[nodiscard]] double difference(double reference) const {
    return std::max(absolute_, relative_ * std::abs(reference));
  }

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
  std::optional<double> paper;
  double ours = 0.0;
  std::optional<double> deviation;  ///< standard deviation over the seeds; for the tables only
  std::optional<double> relative_error;
  std::optional<double> tolerance;  ///< relative; absolute where there is no relative error
  Outcome outcome = Outcome::reported;
  std::string note;

  /// Fills relative_error and tolerance; true if `ours` is near enough to `reference`.
  bool compare(double reference, const Tolerance& limit) {
    const double difference = std::abs(ours - reference);
    const double allowed = limit.difference(reference);
    if (reference != 0.0) {
      relative_error = difference / std::abs(reference);
      tolerance = allowed / std::abs(reference);
    } else {
      tolerance = allowed;
    }
    append_note(limit.rule());
    return difference <= allowed;  // false for a NaN
  }

  void append_note(const std::string& text) {
    if (text.empty()) return;
    if (!note.empty()) note += "; ";
    note += text;
  }

  /// "yes", "no", or empty when only reported.
  [[nodiscard]] std::string pass_text() const {
    switch (outcome) {
      case Outcome::pass:
        return "yes";
      case Outcome::fail:
      case Outcome::known_miss:
        return "no";
      case Outcome::reported:
        break;
    }
    return "";
  }

  /// What the console says.
  [[nodiscard]] std::string verdict() const {
    switch (outcome) {
      case Outcome::pass:
        return "ok";
      case Outcome::fail:
        return "FAILED";
      case Outcome::known_miss:
        return "not reproduced";
      case Outcome::reported:
        break;
    }
    return "reported";
  }

  [[nodiscard]] CsvRow csv_row() const {
    const auto text = [](const std::optional<double>& number, int digits) {
      return number ? number_text(*number, digits) : std::string();
    };
    return {case_name,
            metric,
            text(paper, 9),
            number_text(ours),
            text(relative_error, 4),
            text(tolerance, 4),
            pass_text(),
            note};
  }
};

/// Begins the note of a miss that is known, so that a reader of summary.csv can tell it from a
/// failure: both have pass = no.
inline constexpr std::string_view known_miss_prefix = "not reproduced";

/// The header of summary.csv.
inline constexpr std::string_view summary_header =
    "case,metric,paper,ours,relative_error,tolerance,pass,note\n";

}  // namespace esokit::examples
