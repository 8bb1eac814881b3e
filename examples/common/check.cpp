#include "check.hpp"

#include <algorithm>
#include <array>
#include <charconv>
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

bool Check::compare(double target, const Tolerance& limit) {
  const double difference = std::abs(ours - target);
  const double allowed = limit.difference(target);
  if (target != 0.0) {
    relative_error = difference / std::abs(target);
    tolerance = allowed / std::abs(target);
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
      return "missed";
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

namespace {

constexpr std::array<std::string_view, 4> miss_texts = {
    "printed number missed", "the text says other than what was simulated", "a claim does not hold",
    "settings or data not published"};

}  // namespace

std::string shown_text(double value, std::optional<double> like) {
  if (!std::isfinite(value) || value == 0.0) return number_text(value);
  const double size = std::abs(value);
  if (size < 1e-30) return value < 0.0 ? "-0 (above -1e-30)" : "0 (below 1e-30)";
  if (size < 1e-4 || size >= 1e8) return number_text(value, 3);
  int decimals = std::max(0, (like ? 2 : 3) - static_cast<int>(std::floor(std::log10(size))));
  std::string of_like = like ? number_text(*like) : std::string();
  if (!of_like.empty() && of_like.find('e') == std::string::npos) {
    const auto point = of_like.find('.');
    const auto printed = point == std::string::npos ? 0 : of_like.size() - point - 1;
    decimals = std::max(static_cast<int>(printed), std::min(decimals, 6));
  }
  std::array<char, 64> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value,
                                    std::chars_format::fixed, decimals);
  return {text.data(), result.ptr};
}

std::string mean_text(double mean, double deviation) {
  if (!std::isfinite(deviation) || deviation <= 0.0) return shown_text(mean);
  // The deviation with two digits, and as many decimals for both.
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(deviation))), 0, 17);
  const auto fixed = [decimals](double value) {
    std::array<char, 400> text{};
    const auto result = std::to_chars(text.data(), text.data() + text.size(), value,
                                      std::chars_format::fixed, decimals);
    return std::string(text.data(), result.ptr);
  };
  return fixed(mean) + " (" + fixed(deviation) + ")";
}

std::string mean_text(const Statistics& seeds) {
  return mean_text(seeds.mean, seeds.standard_deviation);
}

std::string_view miss_text(Miss kind) { return miss_texts[static_cast<std::size_t>(kind)]; }

std::optional<Miss> miss_in(std::string_view note) {
  for (std::size_t i = 0; i < miss_texts.size(); ++i) {
    if (note.starts_with(miss_texts[i])) return static_cast<Miss>(i);
  }
  return std::nullopt;
}

std::string reference_note(double reference, std::string_view source) {
  return "reference " + number_text(reference, 6) + " (" + std::string(source) + ")";
}

}  // namespace esokit::examples
