#include "check.hpp"

#include <algorithm>
#include <cmath>

namespace esokit::examples {

Tolerance Tolerance::absolute(double largest_difference) {
  Tolerance tolerance(0.0);
  tolerance.absolute_ = largest_difference;
  tolerance.rule_ = "absolute tolerance " + number_text(largest_difference, 4);
  return tolerance;
}

Tolerance Tolerance::deviations(double factor, const Statistics& seeds) {
  Tolerance tolerance(0.0);
  tolerance.absolute_ = factor * seeds.standard_deviation;
  tolerance.rule_ =
      "within " + number_text(factor, 4) + " sd over " + std::to_string(seeds.count) + " seeds";
  return tolerance;
}

Tolerance Tolerance::or_relative(double relative) const {
  Tolerance wider = *this;
  wider.relative_ = std::max(relative_, relative);
  wider.rule_ += " or " + number_text(100.0 * relative, 4) + " %";
  return wider;
}

double Tolerance::difference(double reference) const {
  return std::max(absolute_, relative_ * std::abs(reference));
}

bool Check::compare(double reference, const Tolerance& limit) {
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

void Check::append_note(const std::string& text) {
  if (text.empty()) return;
  if (!note.empty()) note += "; ";
  note += text;
}

std::string Check::pass_text() const {
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

std::string Check::verdict() const {
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

CsvRow Check::csv_row() const {
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

}  // namespace esokit::examples
