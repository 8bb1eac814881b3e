#include "from_log/parts/show.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <esokit/core/error_text.hpp>
#include <esokit/core/version.hpp>

namespace from_log {
namespace {

using namespace esokit::examples;

std::string with_interval(const esokit::Estimate& estimate, double unit = 1.0) {
  const std::string value = number_text(unit * estimate.value, 4);
  std::string half = number_text(unit * estimate.half_width, 2);
  // Written out where the value is.
  if (value.find('e') == std::string::npos && half.find("e-") != std::string::npos) {
    std::array<char, 64> text{};
    const auto decimals = 1 - static_cast<int>(std::floor(std::log10(unit * estimate.half_width)));
    half.assign(text.data(),
                std::to_chars(text.data(), text.data() + text.size(), unit * estimate.half_width,
                              std::chars_format::fixed, std::min(decimals, 12))
                    .ptr);
  }
  return value + " ± " + half;
}

/// What is wrong and what to do, in words of someone with a log; the numbers come behind it.
std::string in_words(const std::string& field, const esokit::Identified& found) {
  if (field == "lead") {
    return "y moves before u, by " + duration_text(found.lead.time) +
           ": u is most likely logged late, or y early. Log both by one clock, u when it acts.";
  }
  static const std::map<std::string, const char*> all = {
      {"at_once",
       "y reacts in the row in which u changes: u is most likely logged after it acted, or y is an "
       "acceleration or a force. Log u when it acts, and a speed or a position as y, with more "
       "rows "
       "a second."},
      {"rise",
       "y rises or falls faster than u can move it by this b0: u is most likely logged late, or "
       "something else moves y. Log u when it acts, and what else moves y (--measured COLUMN)."},
      {"order",
       "Another order explains this log far better. Give it with --order (a position under a motor "
       "has 2, a speed or a temperature 1), or log the y of this one."},
      {"returns",
       "What was found is the law by which u follows y, not the machine: the reference hardly "
       "moves. "
       "Log again with a reference that steps every few settling times, by as much as the machine "
       "may move. The controller may stay as it is."},
      {"own_input",
       "u depends on y alone: the loop is closed and its reference does not move. Log again with a "
       "reference that steps every few settling times, by as much as the machine may move. The "
       "controller may stay as it is."},
      {"excitation",
       "What u does to y is not seen beside what else moves y. Step u (or the reference) up and "
       "down by a tenth of its range or more, ten times or more, with pauses in which the machine "
       "settles. Or sweep it slowly up to the bandwidth that the controller should have."},
      {"correlation",
       "Something moves y that neither u nor the model has, or y was filtered. Log the u that the "
       "actuator held, y before its filters, and known effects (--measured COLUMN). Steps of u "
       "that last until y settles help, too: then a fit that simulates y from u alone can tell "
       "b0."},
      {"u",
       "u is the same in all rows. Is it the right column (--u)? Else step it up and down ten "
       "times "
       "or more while you log, with pauses in which the machine settles."},
      {"y",
       "y is the same in all rows. Is it the right column (--y), and was the sensor on? Else log a "
       "motion that it can see."},
      {"second_opinion",
       "From row to row y follows u by another b0 than over the whole log. Often the order is not "
       "that of the machine (--order), the actuator saturates or is not linear, or u was logged "
       "late. Log the u that the actuator held, and y without filters."},
      {"plateau",
       "Slow and fast motion give different b0. Log faster steps, or a sweep up to the bandwidth "
       "that the controller should have."},
      {"interval",
       "b0 is not known well enough. Record a longer log, or use larger steps; both make its "
       "interval smaller."},
      {"latency", "u changes too slowly to find lag and dead time: use steps instead of ramps."},
      {"position_shift",
       "A force that depends on y seems to be missing. If it is gravity, add a column with the "
       "sine of the angle to the file, if it is a spring, a column with y, and name the column "
       "with --measured."},
      {"friction_shift",
       "Friction and b0 cannot be separated by this motion. Log motion that is much faster than "
       "the speed at which the machine sticks."},
      {"saturated", "u is mostly at its limits. Log the u that the actuator really held."},
      {"rows",
       "The log is too short. Record at least 200 rows without a gap; 20 s at the sample rate of "
       "the controller are better."}};
  if (field == "latency" && found.latency.value * std::abs(found.pole.value) > 0.8) {
    return "y settles as fast as it begins to react, so lag, dead time and pole cannot be "
           "distinguished. Log more rows per second, and y before its filters.";
  }
  if (field == "rise" && found.late_rows > 0) {
    return "y rises or falls faster than u can move it by this b0: something else moves y. Log "
           "what moves it (--measured COLUMN).";
  }
  // What depends on the size of u looks as if it depended on the frequency.
  if (field == "plateau" && found.by_size.differ()) {
    return "b0 depends on the size of u: the actuator is not proportional. Log the u that it held, "
           "or steps of one size, as large as those of the controller.";
  }
  // What passes within few rows shows lag, pole and friction in few of them.
  const double settles = found.latency.value + 3.0 / found.pole.value;
  const double rows = settles / (found.log.sample_time * found.averaged);
  if ((field == "correlation" || field == "interval" || field == "plateau") &&
      found.pole.value > 0.0 && found.averaged == 1 && rows < 12.0) {
    return "After a step of u, y settles within " + number_text(std::ceil(rows)) +
           " rows: too few to tell lag, pole and friction apart with so few steps. Log five times "
           "as many rows a second, or many more steps.";
  }
  const auto at = all.find(field);
  return at == all.end() ? "" : at->second;
}

/// Every value, or fewer of a long log, by mean.
Figure log_figure(const Input& input, const Findings& findings) {
  Figure figure("log", {.rows = 2, .columns = 2, .panel_height = 160});
  figure.caption("Left: the log (y is " + input.y + ", u is " + input.u +
                 "). Right: the spectra. The log tells most about the frequencies where u and y "
                 "are large; the bandwidth of the controller should be among these.");
  std::vector<double> t = input.log.time;
  if (t.empty()) {
    for (std::size_t k = 0; k < input.log.y.size(); ++k)
      t.push_back(static_cast<double>(k) * input.log.sample_time);
  }
  const auto panel = [&](std::size_t row, const char* name, const std::vector<double>& values,
                         const Spectrum& spectrum, Color color) {
    auto& over_time = figure.panel(row, 0)
                          .x_label("t (s)")
                          .y_label(name + std::string(" (unit of the log)"))
                          .name(name)
                          .line(t, values, {.color = color, .width = 1.0, .column = name});
    // Of a constant gnuplot would choose a range itself, with a warning.
    const auto first =
        std::find_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
    const bool constant = std::none_of(values.begin(), values.end(), [&](double v) {
      return std::isfinite(v) && (v < *first || v > *first);
    });
    if (constant && first != values.end()) {
      const double margin = std::max(0.1 * std::abs(*first), 1e-3);
      over_time.y_range(*first - margin, *first + margin);
    }
    // Of a constant there is none.
    if (std::none_of(spectrum.density.begin(), spectrum.density.end(),
                     [](double d) { return d > 0; }))
      return;
    figure.panel(row, 1)
        .x_label("w (rad/s)")
        .y_label(std::string("density of ") + name)
        .log_x()
        .log_y()
        .name(std::string("spectrum of ") + name)
        .line(spectrum.frequency, spectrum.density, {.color = color, .width = 1.2, .column = name});
  };
  panel(0, "y", input.log.y, findings.y, Color::blue);
  panel(1, "u", input.log.u, findings.u, Color::vermillion);
  return figure;
}

Figure model_figure(const Findings& findings) {
  const esokit::Identified& found = findings.found;
  Figure figure("model", {.rows = 1, .columns = 3, .panel_height = 180});
  figure.caption(
      "Left: b0 as a function of the bandwidth of the fit, with two standard errors; it was taken "
      "at the dashed line. It should be flat around this line. Middle: correlation of the residual "
      "with itself, over the distance in rows; for white noise 95 % of the points are between the "
      "dashed lines; beyond the dotted lines output error has to confirm b0. Right: spectrum of "
      "the "
      "residual; a peak means that something oscillates.");
  const auto& points = found.plateau.points;
  if (points.size() >= 3 && found.plateau.middle > 0) {
    std::vector<double> w, b0, low, high;
    const double size = std::abs(found.input_gain.value);
    for (const auto& point : points) {
      const double value = point.fit.linear[0], error = 2 * point.errors.linear[0];
      // What is not known at all would hide the rest.
      if (!(error < size) || std::abs(value) > 3 * size) continue;
      w.push_back(point.fit.at.bandwidth);
      b0.push_back(value);
      low.push_back(value - error);
      high.push_back(value + error);
    }
    if (w.size() >= 2) {
      figure.panel(0, 0)
          .x_label("w (rad/s)")
          .y_label("b0 (unit of y^{(n)} / u)")
          .log_x()
          .name("plateau")
          .band(w, low, high, {.color = Color::sky, .opacity = 0.3, .column = "b0 +- 2 se"})
          .line(w, b0, {.color = Color::blue, .column = "b0"})
          .vertical_line(points[found.plateau.middle].fit.at.bandwidth);
    }
  }
  std::vector<double> lag;
  for (std::size_t i = 0; i < findings.residual_correlation.size(); ++i)
    lag.push_back(static_cast<double>(i + 1));
  const double most =
      *std::max_element(findings.residual_correlation.begin(), findings.residual_correlation.end(),
                        [](double a, double b) { return std::abs(a) < std::abs(b); });
  const double range = std::max(0.15, 1.15 * std::abs(most));
  figure.panel(0, 1)
      .x_label("distance (rows)")
      .y_label("correlation")
      .name("residual")
      .y_range(-range, range)
      .points(lag, findings.residual_correlation,
              {.color = Color::blue, .marker = Marker::circle, .size = 0.7, .column = "residual"})
      .horizontal_line(findings.correlation_band)
      .horizontal_line(-findings.correlation_band)
      .horizontal_line(0.1, {.color = Color::vermillion, .dash = Dash::dotted})
      .horizontal_line(-0.1, {.color = Color::vermillion, .dash = Dash::dotted});
  if (!findings.residual.frequency.empty()) {
    figure.panel(0, 2)
        .x_label("w (rad/s)")
        .y_label("density of the residual")
        .log_x()
        .log_y()
        .name("spectrum of the residual")
        .line(findings.residual.frequency, findings.residual.density,
              {.color = Color::blue, .width = 1.2, .column = "residual"});
  }
  return figure;
}

std::string derivative_of(int order) {
  return "y" + std::string(static_cast<std::size_t>(order), '\'');
}

std::vector<CsvRow> model_table(const Input& input, const Findings& findings) {
  const esokit::Identified& found = findings.found;
  std::vector<CsvRow> rows{{"quantity", "found, 95 % interval", "unit", "what it is"}};
  const std::string highest = derivative_of(found.order);
  rows.push_back({"order", std::to_string(found.order), "", "integrations from u to y"});
  rows.push_back({"b0", with_interval(found.input_gain), "[" + highest + "] / [u]",
                  "input gain: what one unit of u adds to " + highest});
  if (found.plateau.middle == 0) return rows;
  const auto [per_second, unit] = unit_of(found.latency.value);
  rows.push_back({"lag", with_interval(found.lag, per_second), unit,
                  "time constant of the actuator, first order"});
  rows.push_back({"dead time", with_interval(found.dead_time, per_second), unit,
                  "from a change of u to its first effect"});
  rows.push_back({"lag and dead time", with_interval(found.latency, per_second), unit,
                  "the sum is more accurate than its parts"});
  rows.push_back({"pole", with_interval(found.pole), "1/s", "rate at which free motion decays"});
  rows.push_back(
      {"friction", with_interval(found.friction), "[" + highest + "]", "Coulomb friction"});
  std::string force = "none";
  if (found.position) {
    double low = 0.0, high = 0.0;
    const auto& f = found.position_force;
    for (int i = 0; i <= 100; ++i) {
      const double at = f(f.low + (f.high - f.low) * i / 100);
      low = std::min(low, at);
      high = std::max(high, at);
    }
    force = number_text(low, 3) + " to " + number_text(high, 3);
  }
  rows.push_back({"gravity or spring", force, found.position ? "[" + highest + "]" : "",
                  "a force that depends on y, over the range of the log"});
  for (std::size_t c = 0; c < found.columns.size(); ++c) {
    const esokit::MeasuredEffect& effect = found.columns[c];
    const std::string name = input.measured[c];
    rows.push_back(
        {name, with_interval(effect.gain), "[" + highest + "] / its unit",
         "what one unit of it adds to " + highest + (effect.seen() ? "" : "; it may be nothing")});
    if (!effect.timed) {
      rows.push_back({name + ": lag, dead time", "not found", "",
                      effect.follows_output ? "it is a function of y, and acts at once"
                                            : "it does too little"});
      continue;
    }
    const auto [factor, of_time] = unit_of(effect.latency.value);
    rows.push_back({name + ": lag", with_interval(effect.lag, factor), of_time,
                    "through which it acts, first order"});
    rows.push_back({name + ": dead time", with_interval(effect.dead_time, factor), of_time,
                    "from a change of it to its first effect; straight lines between the rows"});
    rows.push_back({name + ": lag and dead time", with_interval(effect.latency, factor), of_time,
                    "the sum is more accurate than its parts"});
  }
  rows.push_back(
      {"noise", with_interval(found.noise), "[y]", "standard deviation of the measurement noise"});
  rows.push_back({"disturbance", number_text(found.random_walk(), 3), "[" + highest + "]² / s",
                  "rate at which the variance of d grows, as a random walk"});
  rows.push_back(
      {"plateau", number_text(100 * found.plateau.spread, 3) + " %",
       number_text(found.plateau.from, 3) + " to " + number_text(found.plateau.to, 3) + " rad/s",
       "spread of b0 where it was taken; bandwidths at which it stays within 10 %"});
  rows.push_back({"residual", number_text(found.correlation, 2), "",
                  "largest correlation with itself: 0 if the model explains everything"});
  return rows;
}

std::vector<CsvRow> log_table(const Input& input, const Findings& findings) {
  const esokit::LogReport& log = findings.found.log;
  std::vector<CsvRow> rows{{"", "in the log", "how it was read"}};
  rows.push_back({"y", input.y,
                  input.first_order
                      ? "by its name a speed, a temperature or a level, so of order 1; --order "
                        "sets another one"
                      : ""});
  if (input.turn > 0) rows.push_back({"turn of y", number_text(input.turn, 7), "made continuous"});
  rows.push_back({"u", input.u, "held by the actuator from its row to the next"});
  rows.push_back({"time", input.time.empty() ? "none" : input.time,
                  input.time.empty() ? "equal steps, by --sample-time"
                  : input.time_unit == "rows"
                      ? "rows that are counted, by --sample-time"
                      : "read in " + input.time_unit +
                            (input.unit_assumed ? ", by value and step; see --time-unit" : "")});
  for (const std::string& note : input.notes) rows.push_back({"read into it", note, ""});
  rows.push_back(
      {"rows", std::to_string(log.rows),
       input.merged ? "u and y have their own time stamps: a row for each y, u averaged in between"
                    : ""});
  if (input.cut) rows.push_back({"last line", "incomplete", "left out"});
  const auto [per_second, unit] = unit_of(log.sample_time);
  rows.push_back({"sample time", number_text(per_second * log.sample_time, 5) + " " + unit,
                  log.jitter < 1e-9 * log.sample_time
                      ? "no jitter"
                      : "jitter " + number_text(1e3 * log.jitter, 3) + " ms"});
  rows.push_back({"duration", duration_text(log.duration),
                  std::to_string(log.pieces) + (log.pieces == 1 ? " piece" : " pieces")});
  rows.push_back({"missing rows", std::to_string(log.missing),
                  std::to_string(log.rejected) + " rows without a number, " +
                      std::to_string(log.outliers) + " single outliers"});
  for (std::size_t c = 0; c < log.lost.size(); ++c) {
    if (log.lost[c] == 0) continue;
    rows.push_back({input.measured[c] + " lost", std::to_string(log.lost[c]),
                    "rows without it, which was put between its neighbours; of more in succession "
                    "the log is split"});
  }
  rows.push_back(
      {"resolution of y", log.quantisation > 0 ? number_text(log.quantisation, 4) : "fine",
       log.quantisation > 0 ? "steps, as of an encoder or a converter" : "no steps can be seen"});
  rows.push_back({"u at its limits", number_text(100 * log.saturated, 3) + " %",
                  "of the rows have the largest or smallest u"});
  return rows;
}

}  // namespace

std::vector<std::string> why_refused(const Findings& findings) {
  if (!findings.refusal) return {};
  const std::string numbers = esokit::to_text(*findings.refusal);
  std::string words = in_words(findings.refusal->field, findings.found);
  if (std::string_view(findings.refusal->field) == "rows" && !findings.gaps.empty()) {
    words = "The log has " + findings.gaps +
            ": too little is between them. Log without gaps, at a rate that the logger keeps up "
            "with. If the rows are equally far apart and only their stamps are not, use "
            "--sample-time instead of --time.";
  }
  std::vector<std::string> lines{words.empty() ? numbers : words};
  lines.insert(lines.end(), findings.shown.begin(), findings.shown.end());
  if (!words.empty()) lines.push_back("In numbers: " + numbers + ".");
  return lines;
}

std::vector<std::string> in_short(const Findings& findings, const Design& design) {
  std::vector<std::string> all;
  const esokit::Identified& found = findings.found;
  if (findings.seen) {
    all.push_back(
        (findings.refusal ? "Seen, but not to be relied on: order " : "The machine is of order ") +
        std::to_string(found.order) + ", b0 = " + number_text(found.input_gain.value, 4) + " ± " +
        number_text(found.input_gain.half_width, 2) + ", lag and dead time " +
        duration_text(found.latency.value) + "; sampled every " +
        duration_text(found.log.sample_time) + ".");
  }
  const esokit::SecondOpinion& second = findings.found.second_opinion;
  if (findings.seen && second.informative()) {
    const auto& first = found.input_gain;
    const bool agrees = std::abs(second.input_gain.value - first.value) <=
                        second.input_gain.half_width + first.half_width;
    all.push_back("Second fit, which simulates y from u alone: b0 = " +
                  with_interval(second.input_gain) + (agrees ? " (agrees)." : " (differs)."));
  }
  if (findings.seen && !findings.refusal && findings.found.input_gain.share() > 0.1) {
    all.push_back("Warning: b0 is known to " +
                  number_text(100 * findings.found.input_gain.share(), 2) +
                  " % only; a longer log or larger steps tell it better.");
  }
  const auto more = design.summary();
  all.insert(all.end(), more.begin(), more.end());
  if (!design.why_not().empty()) all.push_back("No controller: " + design.why_not());
  return all;
}

Page show(const Settings& settings, const Input& input, const Findings& findings,
          const Design& design) {
  const std::string name = source_of(settings).file_name();
  Page page("From " + name + " to a controller");
  if (!findings.alarms.empty()) {
    std::vector<std::string> lines;
    for (const Alarm& alarm : findings.alarms) lines.push_back(alarm.name + ": " + alarm.text);
    page.box("Alarm: check this before you use any of the results", lines, true);
  }
  if (findings.refusal) {
    std::vector<std::string> lines = why_refused(findings);
    if (findings.seen) lines.push_back("The numbers below are not reliable enough for a design.");
    page.box("Refused: this log cannot be used to design a controller. What to record instead",
             lines, true);
  }
  if (design.made() || (settings.no_design && findings.seen)) {
    page.box(findings.refusal ? "Summary, if the numbers were reliable" : "Summary",
             in_short(findings, design), false);
  }
  page.heading("The log");
  page.table("log", "What was read", log_table(input, findings));
  page.figure(log_figure(input, findings));
  if (findings.seen) {
    page.heading(findings.refusal ? "What was seen" : "What was found");
    page.text(
        "The model is a chain of integrators behind a lag and a dead time, with a pole, friction "
        "and a disturbance that is a random walk.");
    page.table("model", "The machine", model_table(input, findings));
    if (!findings.residual_correlation.empty()) page.figure(model_figure(findings));
  }
  design.show_on(page, findings);
  page.text("Made by from_log of esokit " + std::to_string(ESOKIT_VERSION_MAJOR) + "." +
            std::to_string(ESOKIT_VERSION_MINOR) + "." + std::to_string(ESOKIT_VERSION_PATCH) +
            ": " + settings.command);
  return page;
}

Outcome work_out(const Settings& settings) { return work_out(settings, read_log(settings)); }

Outcome work_out(const Settings& settings, const Input& input) {
  Outcome outcome;
  outcome.input = input;
  outcome.findings = examine(settings, outcome.input);
  const bool usable = outcome.findings.seen && (!outcome.findings.refusal || settings.anyway);
  if (usable && !settings.no_design) {
    if (settings.progress) settings.progress("choosing a controller", -1.0);
    outcome.design = Design::make(settings, input, outcome.findings);
    auto& alarms = outcome.findings.alarms;
    alarms.insert(alarms.end(), outcome.design.alarms().begin(), outcome.design.alarms().end());
  }
  outcome.status = outcome.findings.refusal ? refused
                   : !outcome.findings.alarms.empty() ||
                           (usable && !settings.no_design && !outcome.design.made())
                       ? alarmed
                       : all_clear;
  return outcome;
}

}  // namespace from_log
