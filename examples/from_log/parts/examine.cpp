#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <esokit/identify/detail/b0_evidence.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/spectrum.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/compiled/study.hpp"
#include "from_log/parts/from_log.hpp"

namespace from_log {
namespace {

using esokit::examples::number_text;
namespace compiled = esokit::examples::compiled;

/// Welch's mean over half overlapping pieces with Hann's window, each without its trend.
Spectrum spectrum(const std::vector<double>& values, double T) {
  std::size_t length = 64;
  while (length * 2 <= values.size() / 4 && length < 4096) length *= 2;
  Spectrum result;
  if (values.size() < length) return result;
  std::vector<double> sum(length / 2, 0.0);
  std::size_t pieces = 0;
  for (std::size_t from = 0; from + length <= values.size(); from += length / 2) {
    const double count = static_cast<double>(length);
    double mean = 0.0, slope = 0.0;
    for (std::size_t i = 0; i < length; ++i) mean += values[from + i] / count;
    for (std::size_t i = 0; i < length; ++i) {
      slope += (static_cast<double>(i) - (count - 1) / 2) * (values[from + i] - mean);
    }
    slope *= 12.0 / (count * (count * count - 1));
    std::vector<std::complex<double>> x(length);
    double power = 0.0;
    for (std::size_t i = 0; i < length; ++i) {
      const double at = static_cast<double>(i);
      const double window = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * at / count);
      power += window * window;
      x[i] = window * (values[from + i] - mean - slope * (at - (count - 1) / 2));
    }
    esokit::detail::transform(x);
    for (std::size_t i = 1; i < length / 2; ++i) sum[i] += std::norm(x[i]) / power;
    ++pieces;
  }
  for (std::size_t i = 1; i < length / 2; ++i) {
    result.frequency.push_back(2 * std::numbers::pi * static_cast<double>(i) /
                               (T * static_cast<double>(length)));
    result.density.push_back(sum[i] / static_cast<double>(pieces) * T / std::numbers::pi);
  }
  return result;
}

/// What a factor between two units often is.
std::string usual_factor(double ratio) {
  struct Usual {
    double factor;
    const char* text;
  };
  constexpr Usual all[] = {{57.2958, "degrees and radians"},
                           {9.5493, "rev/min and rad/s"},
                           {6.28319, "turns and radians"},
                           {1000, "a unit and its thousandth, as m and mm"},
                           {100, "a fraction and percent, or m and cm"},
                           {10, "a misplaced decimal point"},
                           {9.80665, "kg and N"},
                           {60, "minutes and seconds"}};
  const double size = ratio > 1 ? ratio : 1 / ratio;
  const Usual* best = nullptr;
  for (const Usual& usual : all) {
    const double off = std::abs(std::log(size / usual.factor));
    if (off < 0.08 && (best == nullptr || off < std::abs(std::log(size / best->factor))))
      best = &usual;
  }
  return best == nullptr ? "" : std::string(" (") + best->text + "?)";
}

void sound_alarms(const Settings& settings, const Input& input, Findings& all) {
  const esokit::Identified& found = all.found;
  if (settings.limits) {
    const auto [lower, upper] = *settings.limits;
    double ours = 0.0;
    for (const double u : input.log.u) {
      if (std::isfinite(u)) ours = std::max(ours, std::abs(u));
    }
    const double told = std::max(std::abs(lower), std::abs(upper));
    if (ours > 1.5 * told || ours < told / 50) {
      all.alarms.push_back(
          {"u-unit", "In the log u (" + input.u + ") reaches " + number_text(ours, 4) +
                         ", but the limits that you gave are " + number_text(told, 4) +
                         usual_factor(ours / told) +
                         ". Either the log and the controller use different units of u, or the "
                         "limits are wrong. b0 below is for the unit of the log."});
    }
  }
  const double q = found.log.quantisation;
  if (q > 0.0) {
    const auto [low, high] = std::minmax_element(all.rows.y.begin(), all.rows.y.end());
    const double levels = (*high - *low) / q;
    if (levels < 10) {
      all.alarms.push_back(
          {"quantised",
           "y (" + input.y + ") has a resolution of " + number_text(q, 3) + " and moves by only " +
               number_text(levels, 3) +
               " such steps, too few to see its motion. Record larger motion, or y with a finer "
               "resolution."});
    }
  }
  if (!all.seen) return;
  if (const auto& sizes = found.by_size; sizes.differ()) {
    const std::string text = "b0 is " + number_text(sizes.below.value, 3) + " for u (" + input.u +
                             ") up to " + number_text(sizes.knot, 3) + " and " +
                             number_text(sizes.above.value, 3) +
                             " beyond. Does the actuator saturate, stick, or act as the square of "
                             "u? Record the u that it held, or correct u by its curve: an "
                             "ActuatorMap.";
    // Of a log that is refused it is what was seen.
    if (all.refusal && !settings.anyway) {
      all.shown.insert(all.shown.begin(), text);
    } else {
      all.alarms.push_back({"large-u", text});
    }
  }
  // Of a log that does not tell b0 its sign means nothing, unless a design is asked for anyway.
  if (all.refusal && !settings.anyway) return;
  const double b0 = found.input_gain.value;
  if (found.held > 0.0) {
    all.alarms.push_back(
        {"sticks", "Friction holds the machine in " + number_text(100 * found.held, 2) +
                       " % of the rows: b0 is that of the motion, without u at standstill. A "
                       "controller will stick there, too; record faster motion with larger u."});
  } else if (const auto& motion = found.in_motion; motion.differ()) {
    all.alarms.push_back(
        {"sticks", "Friction holds the machine: b0 is " + number_text(motion.moving.value, 3) +
                       " in motion and " + number_text(motion.at_rest.value, 3) +
                       " in the rows at standstill (" + number_text(100 * motion.still, 2) +
                       " %). Record faster motion with larger u."});
  }
  if (esokit::detail::leads(found)) {
    all.alarms.push_back({"lead", "y (" + input.y + ") moves " + number_text(found.lead.time, 2) +
                                      " s before u: is u logged late?"});
  }
  const double expected = settings.expected_gain.value_or(std::abs(b0));
  const double ratio = b0 / expected;
  if (ratio < 0) {
    all.alarms.push_back(
        {"sign",
         "b0 is " + number_text(b0, 3) +
             (b0 < 0 ? ", that is, a larger u lowers y" : ", that is, a larger u raises y") +
             std::string(settings.expected_gain ? "; you expect " : "") +
             (settings.expected_gain ? number_text(expected, 3) : "") +
             ". With the wrong sign no controller is stable. Check the signs of u and y, in the "
             "recording and in the controller. If the sign found here is right, confirm it with "
             "--b0 " +
             number_text(b0, 3) + "."});
  }
  const double size = std::abs(ratio);
  if (size > 3 || size < 1.0 / 3) {
    all.alarms.push_back(
        {"b0", "b0 is " + number_text(b0, 3) + (ratio < 0 ? ", in magnitude " : ", ") +
                   number_text(size > 1 ? size : 1 / size, 3) + " times as " +
                   (size > 1 ? "large" : "small") + " as the " + number_text(expected, 3) +
                   " that you expect" + usual_factor(size) +
                   ". Check the units of u, y and time, the gear ratio, and scale factors."});
  }
}

/// How often u moves: a move ends a fifth of its range away from where the one before ended.
void say_moves(const Input& input, Findings& all) {
  const auto& rows = all.rows;
  const auto [low, high] = std::minmax_element(rows.u.begin(), rows.u.end());
  if (!(*high > *low)) return;
  const double step = 0.2 * (*high - *low);
  std::vector<double> at;
  double from = rows.u[0];
  std::size_t gradual = 0;
  // To one in the last rows y cannot answer.
  for (std::size_t k = 1; k + rows.u.size() / 100 < rows.u.size(); ++k) {
    if (std::abs(rows.u[k] - from) < step) continue;
    from = rows.u[k];
    if (std::abs(rows.u[k] - rows.u[k - 1]) < 0.5 * step) ++gradual;
    at.push_back(static_cast<double>(k) * rows.sample_time);
  }
  const std::string range = number_text(*low, 4) + " to " + number_text(*high, 4);
  if (at.size() <= 3) {
    if (at.empty()) {
      all.shown.push_back("u (" + input.u + ", " + range +
                          ") never moves by a fifth of its range and stays there.");
      return;
    }
    std::string text = "u (" + input.u + ", " + range + ") moves by a fifth of its range ";
    text += at.size() == 1 ? "once only, " : "only " + std::to_string(at.size()) + " times, first ";
    all.shown.push_back(text + "at " + duration_text(at[0]) +
                        ": what follows from u looks like a drift that begins at about "
                        "that time.");
    return;
  }
  // Moves in succession are one ramp; what is between the others is how long u stays.
  std::vector<double> stays;
  for (std::size_t i = 1; i < at.size(); ++i) stays.push_back(at[i] - at[i - 1]);
  const double stay = esokit::detail::median(stays);
  all.shown.push_back("u (" + input.u + ") moves " + std::to_string(at.size()) +
                      " times by a fifth of its range, " + range + ", or more, every " +
                      duration_text(stay) + " (median)" +
                      (gradual > 0 ? ", " + std::to_string(gradual) +
                                         " of them gradually, which tells b0 less than steps do."
                                   : "."));
  if (all.seen && all.found.latency.value > stay) {
    all.shown.push_back(
        "Lag and dead time, " + duration_text(all.found.latency.value) +
        " as they were found, are longer than that: u moves on before y has answered.");
  }
}

/// Gaps that come every few rows: how many, how long, and how far apart.
std::string gaps_in_words(const esokit::Log& log) {
  std::vector<double> time, steps, gaps;
  for (std::size_t k = 0; k < log.y.size(); ++k) {
    if (!std::isfinite(log.u[k]) || !std::isfinite(log.y[k])) continue;
    time.push_back(log.time.empty() ? static_cast<double>(k) * log.sample_time : log.time[k]);
  }
  for (std::size_t k = 1; k < time.size(); ++k) steps.push_back(time[k] - time[k - 1]);
  const double usual = esokit::detail::median(steps);
  for (const double step : steps) {
    if (!(step < esokit::detail::longest_bridge * usual)) gaps.push_back(step);
  }
  const double apart = static_cast<double>(time.size()) / static_cast<double>(gaps.size() + 1);
  if (time.size() < 200 || gaps.empty() || apart > 2.0 * esokit::detail::shortest_piece) return "";
  return std::to_string(gaps.size()) + (gaps.size() == 1 ? " gap" : " gaps") + " of about " +
         duration_text(esokit::detail::median(gaps)) + ", one every " + number_text(apart, 2) +
         " rows of " + duration_text(usual);
}

/// The name of the column that was refused.
void say_column(const Input& input, Findings& all) {
  const int index = all.refusal->index;
  if (std::string_view(all.refusal->field) != "columns" || index < 0) return;
  all.shown.push_back("Column " + std::to_string(index) + " of --measured is " +
                      input.measured[static_cast<std::size_t>(index)] + ".");
}

/// u as it acted, where it was logged late.
void take_earlier(int rows, Input& input, Findings& all) {
  auto& u = input.log.u;
  const auto by = static_cast<std::size_t>(rows);
  for (std::size_t k = 0; k < u.size(); ++k) u[k] = u[std::min(k + by, u.size() - 1)];
  all.rows = esokit::detail::advanced(std::move(all.rows), by);
  input.notes.insert(
      input.notes.begin(),
      "u (" + input.u + ") was logged late, after it had acted: it was taken " +
          (rows == 1 ? std::string("a row") : std::to_string(rows) + " rows") +
          " earlier, which makes the log far more likely. If not, use --literal late-u.");
}

/// What the curve of an actuator does, in words.
std::string in_words(const esokit::SeenCurve& curve, const std::string& u) {
  const std::string size = number_text(curve.size.value, 3);
  const std::string known = size + " ± " + number_text(curve.size.half_width, 2);
  switch (curve.kind) {
    case esokit::CurveKind::dead_zone:
      return "The actuator has a dead zone: " + u + " does nothing between -" + size + " and " +
             size + " (± " + number_text(curve.size.half_width, 2) +
             "), and beyond acts so much less";
    case esokit::CurveKind::saturation:
      return "The actuator saturates: " + u + " beyond ± " + known + " does nothing more";
    default:
      return "The actuator acts as the square of " + u + ", with its sign";
  }
}

/// A dead zone takes from u whatever y does; friction brakes the motion. A log that tells no
/// friction has a dead zone.
const std::string sticks_or_not =
    " The log also tells friction, so it may be friction that sticks: y stands still under a small "
    "u, too, but one that moves goes on under it. For both take a softness of a fourth, "
    "ActuatorCurve<>::dead_zone(size, size / 4), and Resting around the controller.";

/// The effect in place of u, where the log tells the curve of the actuator: b0 is one number then.
/// Not if the log tells it, and is refused with the curve.
void take_effect(esokit::IdentifyOptions options, Input& input, Findings& all) {
  const esokit::SeenCurve curve = all.found.curve;
  const esokit::Log acted = curve.acted(input.log);
  options.late_input = options.late_input && all.found.late_rows == 0;
  const auto found = compiled::study(acted, options);
  if (!found) return;
  const auto verdict = esokit::judge(*found, acted, options);
  if (!verdict && !all.refusal) return;
  all.refusal.reset();
  if (!verdict) all.refusal = verdict.error();
  const double before = all.found.input_gain.value;
  const bool may_stick =
      curve.kind == esokit::CurveKind::dead_zone && all.found.friction.low() > 0.0;
  all.found = *found;
  all.curve = curve;
  all.rows = compiled::prepare(acted)->data;
  if (found->late_rows > 0) take_earlier(found->late_rows, input, all);
  input.notes.insert(input.notes.begin(),
                     in_words(curve, "u (" + input.u + ")") +
                         ". The squares of what the model does not explain are " +
                         number_text(100 * curve.left, 2) +
                         " % with this curve, and b0 does not depend on the size of u (without it "
                         "b0 is " +
                         number_text(before, 3) +
                         " on the average). So below, u is the effect, in the unit of u, and the "
                         "code puts out the u that has it. If not, use --literal curve." +
                         (may_stick ? sticks_or_not : ""));
}

/// What is left when the model has explained what it can.
void say_residual(const compiled::Residual& residual, Findings& all) {
  const auto& e = residual.values;
  const double T = residual.rows.sample_time, rows = static_cast<double>(e.size());
  if (e.size() < 100) return;
  // A few rows that no machine of this kind makes.
  std::vector<double> sizes;
  double square = 0.0;
  for (const double value : e) sizes.push_back(std::abs(value)), square += value * value;
  const double usual = esokit::detail::median(sizes) / 0.6745;
  double held = 0.0, first = 0.0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < e.size(); ++k) {
    if (sizes[k] < std::max(10 * usual, 1e-300)) continue;
    held += e[k] * e[k];
    if (count++ == 0) first = static_cast<double>(k) * T;
  }
  if (count > 0 && held > 0.5 * square && static_cast<double>(count) < 0.02 * rows) {
    // First, as it may be all that is wrong.
    all.shown.insert(
        all.shown.begin(),
        std::to_string(count) + (count == 1 ? " row has " : " rows have ") +
            number_text(std::round(100 * held / square)) +
            " % of the squares of the residual, the first at " + duration_text(first) +
            ": y there does not follow from u. A value that came late or was wrong, a stop, or a "
            "machine of higher order? Empty the fields of wrong values.");
    return;
  }
  if (const auto line = compiled::line_of(residual)) {
    const double hertz = *line / (2 * std::numbers::pi);
    all.shown.push_back("The residual has a peak at " + number_text(hertz, 3) +
                        " Hz: something oscillates, or turns, at that frequency.");
  }
  const auto& w = all.residual.frequency;
  const auto& density = all.residual.density;
  if (w.size() >= 16) {
    const double middle = esokit::detail::median(density);
    const std::size_t part = w.size() / 16;
    double slow = 0.0, fast = 0.0;
    for (std::size_t i = 0; i < part; ++i) {
      slow += density[i] / static_cast<double>(part);
      fast += density[density.size() - 1 - i] / static_cast<double>(part);
    }
    if (slow > 8 * middle) {
      all.shown.push_back("The residual is slow (most of it below " +
                          number_text(w[part] / (2 * std::numbers::pi), 2) +
                          " Hz): a drift, friction or another load moves y.");
    } else if (fast > 8 * middle) {
      all.shown.push_back("The residual is fast (most of it above " +
                          number_text(w[w.size() - 1 - part] / (2 * std::numbers::pi), 2) +
                          " Hz): noise of y, or a step of its resolution.");
    }
  }
  if (all.residual_correlation[0] < -0.3) {
    all.shown.push_back("The residual changes its sign from row to row (correlation " +
                        number_text(all.residual_correlation[0], 2) +
                        "), as of a speed from counts. Log the counts themselves (the position) "
                        "and give --order 2: of these b0, lag and noise are found.");
  }
  if (all.residual_correlation[0] > 0.3) {
    all.shown.push_back("The residual changes little from row to row (correlation " +
                        number_text(all.residual_correlation[0], 2) +
                        "), as of a y that was filtered, or a machine of higher order.");
  }
  const double pieces = static_cast<double>(all.found.log.pieces);
  if (all.found.log.pieces > 1 && rows < 300 * pieces) {
    all.shown.push_back("The log consists of " + number_text(pieces) + " pieces of about " +
                        number_text(rows / pieces, 3) +
                        " rows: each is short, and how it began is not known. Record without "
                        "gaps, or longer pieces.");
  }
  if (rows < 600) {
    all.shown.push_back(
        "The log is short: " + std::to_string(all.found.log.rows) + " rows, " +
        (all.found.averaged > 1 ? "averaged to " + std::to_string(e.size()) + ", " : "") +
        duration_text(rows * T) + ".");
  }
}

}  // namespace

Findings examine(const Settings& settings, Input& input) {
  Findings all;
  all.alarms = input.alarms;
  esokit::IdentifyOptions options;
  if (!settings.orders.empty()) {
    options.orders = settings.orders;
  } else if (input.first_order) {
    options.orders = {1};
  }
  options.late_input = !settings.literal.contains("late-u");
  if (settings.progress) {
    options.progress = [&](double share) { settings.progress("finding the machine", share); };
  } else if (input.log.y.size() > 200'000) {
    options.progress = [](double share) {
      std::fprintf(stderr, "identifying the model: %3.0f %%\n", 100 * share);
    };
  }
  all.gaps = gaps_in_words(input.log);
  if (const auto prepared = compiled::prepare(input.log)) {
    all.rows = prepared->data;
    all.found.log = prepared->report;
    const double T = all.rows.sample_time;
    if (prepared->report.burst > 0.0) {
      input.notes.insert(input.notes.begin(), "The rows come in bursts: " + all.gaps +
                                                  ". They were read every " + duration_text(T) +
                                                  ", which bridges the gaps.");
    }
    all.u = spectrum(all.rows.u, T);
    all.y = spectrum(all.rows.y, T);
  } else {
    all.refusal = prepared.error();
    say_column(input, all);
    return all;
  }
  const auto found = compiled::study(input.log, options);
  if (!found) {
    all.refusal = found.error();
    say_column(input, all);
    say_moves(input, all);
    sound_alarms(settings, input, all);
    return all;
  }
  all.found = *found;
  all.seen = true;
  if (found->late_rows > 0) take_earlier(found->late_rows, input, all);
  if (const auto verdict = esokit::judge(*found, input.log, options); !verdict)
    all.refusal = verdict.error();
  if (found->curve.seen() && !settings.literal.contains("curve")) take_effect(options, input, all);
  const auto residual = compiled::residual_of(all.found, all.rows);
  const auto& e = residual.values;
  double square = 0.0;
  for (const double value : e) square += value * value;
  for (std::size_t lag = 1; lag <= 40 && lag < e.size(); ++lag) {
    double sum = 0.0;
    for (std::size_t k = lag; k < e.size(); ++k) sum += e[k] * e[k - lag];
    all.residual_correlation.push_back(sum / square);
  }
  all.correlation_band = 1.96 / std::sqrt(static_cast<double>(e.size()));
  all.residual = spectrum(e, residual.rows.sample_time);
  say_moves(input, all);
  say_residual(residual, all);
  sound_alarms(settings, input, all);
  return all;
}

}  // namespace from_log
