#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/detail/b0_evidence.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/detail/row_study.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/identify.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <functional>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// Whether b0 was seen, and the latency is not at the end of its range.
inline bool within_reach(const Identified& found) {
  return !found.at_bound && found.plateau.middle > 0 && found.excitation < excitation_max;
}

ESOKIT_FUNCTION bool better(const Identified& averaged, const Identified& plain,
                            const Identified& best, const IdentifyOptions& options) {
  const double apart = (std::abs)(averaged.input_gain.value - plain.input_gain.value);
  const double span = averaged.averaged * averaged.log.sample_time;
  // A latency that is longer than its range in rows is of another b0; and rows that are too short
  // may see no motion.
  if (!within_reach(best)) {
    return within_reach(averaged) && span * (std::abs)(averaged.pole.value) < 0.2 &&
           3.0 * span <= averaged.latency.value;
  }
  return (white(averaged, options) || averaged.correlation < 0.5 * best.correlation) &&
         apart <= averaged.input_gain.half_width + plain.input_gain.half_width &&
         span * (std::abs)(averaged.pole.value) < 0.2;
}

/// The study of averaged rows that is best, and that of rows as they are.
struct Folded {
  Identified first{};
  Identified best{};
};

/// Studies rows, and averages of them for as long as these help: until the model explains the log,
/// and the latency is within its range, which in rows is limited.
inline std::optional<Folded> study_folds(const FitData& all, bool scheduling,
                                         const IdentifyOptions& options, Identified result,
                                         const std::function<void(double)>& progress) {
  const FitData raw = excerpt(all, options.rows_max);
  result.log.used = raw.y.size();
  result.own_input = own_input(raw);
  result.at_once = at_once(raw);
  std::vector<int> folds = {1, 4, 8, 16, 32, 64, 100};
  if (options.averaged > 0) folds = {options.averaged};
  // Once an order is chosen and at a bound, it alone is tried within wider ones.
  IdentifyOptions how = options;
  bool wide = false;
  std::optional<Folded> found;
  Estimate raw_noise;
  double done = 0.0;
  for (const int fold : folds) {
    // A lag of many rows needs stretches that are longer.
    FitData rows = excerpt(averaged(all, fold), options.rows_max);
    if (rows.y.size() < 200) break;
    std::vector<double> along;
    if (scheduling) {
      along = std::move(rows.columns.back());
      rows.columns.pop_back();
    }
    const double share = 0.6 * (1.0 - done);
    result.averaged = fold;
    result.log.used = rows.y.size() * static_cast<std::size_t>(fold);
    const auto studied = [&] {
      const auto part_done = [&](double part) {
        progress(done + share * (wide ? 0.5 + 0.5 * part : 0.5 * part));
      };
      return RowStudy(rows, along, {how, wide, part_done}, result).run(raw_noise);
    };
    Identified here = studied();
    if (here.at_bound && !wide) {
      wide = true;
      how.orders = {here.order};
      const auto orders = here.orders;
      here = studied();
      for (const OrderFit& order : orders) {
        if (order.model.order != here.order) here.orders.push_back(order);
      }
      std::sort(here.orders.begin(), here.orders.end(),
                [](const auto& a, const auto& b) { return a.model.order < b.model.order; });
    }
    done += share;
    const bool out_of_reach = !within_reach(here);
    if (!found) {
      found = Folded{here, std::move(here)};
    } else if (better(here, found->first, found->best, options)) {
      found->best = std::move(here);
    }
    const bool decided = white(found->best, options) || informed(found->best);
    if ((decided && within_reach(found->best)) || !(result.own_input > own_input_min)) break;
    // At the end of the range of its latency nothing is said of the order.
    if (out_of_reach) how = options, wide = false;
    if (fold >= 16 && within_reach(found->best)) break;
  }
  return found;
}

/// The fit of the order that was chosen.
inline const OrderFit& chosen_fit(const Identified& found) {
  return *std::find_if(found.orders.begin(), found.orders.end(),
                       [&](const OrderFit& order) { return order.model.order == found.order; });
}

/// Whether rows with an earlier u are far more likely at all: by the same model from several
/// starts.
inline bool worth_earlier(const Folded& found, const FitData& raw, const FitData& earlier) {
  const OrderFit& chosen = chosen_fit(found.first);
  const auto least = [&](const FitData& data) {
    InnovationsFit fit(data, chosen.model, chosen.bounds);
    Fit best = fit.minimise(chosen.fit.at, true, 8);
    for (const double latency : {0.5, 3.0, 12.0, 40.0}) {
      FitPoint start = chosen.fit.at;
      start.latency = latency * raw.sample_time;
      const Fit other = fit.minimise(start, true, 8);
      if (other.mean_square < best.mean_square) best = other;
    }
    return static_cast<double>(best.rows) * std::log(best.mean_square);
  };
  return least(earlier) < least(raw) - 40.0;
}

/// Whether u was logged late. That must make the log far more likely, and output error must find
/// the same b0, of the same sign as before. For where u follows from y of its own row, an earlier u
/// predicts the noise of y.
inline bool far_more_likely(const Folded& earlier, const Folded& as_logged) {
  const Identified& found = earlier.best;
  const SecondOpinion& second = found.second_opinion;
  const SecondOpinion& before = as_logged.best.second_opinion;
  if (!(chosen_fit(earlier.first).criterion < chosen_fit(as_logged.first).criterion - 40.0))
    return false;
  if (found.at_once || leads(found) || !second.informative() ||
      !second.agrees(found.input_gain.value))
    return false;
  if (before.informative() && before.input_gain.value * second.input_gain.value < 0.0) return false;
  return second.explained > before.explained - 0.02;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<Identified, Error<double>> study(const Log& log,
                                                          const IdentifyOptions& options) {
  using E = Error<double>;
  const bool scheduling = !log.schedule.empty();
  if (scheduling && log.schedule.size() != log.y.size()) {
    return E{"schedule",
             static_cast<double>(log.schedule.size()),
             "must have as many rows as y, or none:",
             -1,
             static_cast<double>(log.y.size()),
             true};
  }
  Rules<double> rules;
  const auto number = [](auto value) { return static_cast<double>(value); };
  rules
      .demand(0 <= options.extension && options.extension <= 2, "extension",
              number(options.extension), "must be 0 (chosen), 1 or 2")
      .demand(2 <= options.schedule_bins && options.schedule_bins <= 20, "schedule_bins",
              number(options.schedule_bins), "must be 2 to 20")
      .demand(0 <= options.averaged, "averaged", number(options.averaged),
              "must be 0 (chosen), 1 or more")
      .demand(0 <= options.sinusoids, "sinusoids", number(options.sinusoids),
              "must not be negative")
      // Twenty stretches of at least 50 rows; of fewer rows they would overlap.
      .demand(1000 <= options.rows_max, "rows_max", number(options.rows_max),
              "must be at least 1000");
  if (!rules) return rules.error();
  // The scheduling column is processed like the columns, as the last of them.
  const auto with_schedule = [&] {
    Log all = log;
    all.columns.push_back(log.schedule);
    return prepare(all);
  };
  auto prepared = scheduling ? with_schedule() : prepare(log);
  if (!prepared) return prepared.error();
  if (options.progress) options.progress(0.1);
  if (options.orders.empty()) return E{"orders", 0.0, "must not be empty"};
  for (const int order : options.orders) {
    if (order < 1 || order > 3) return E{"orders", static_cast<double>(order), "must be 1, 2 or 3"};
  }
  Identified result;
  result.log = prepared->report;
  const FitData raw = excerpt(prepared->data, options.rows_max);
  const auto [least, largest] = std::minmax_element(raw.u.begin(), raw.u.end());
  if (!(*largest > *least))
    return E{"u", *least, "never changes: record a log in which the input moves"};
  const auto [lowest, highest] = std::minmax_element(raw.y.begin(), raw.y.end());
  if (!(*highest > *lowest))
    return E{"y", *lowest, "never changes: record a log in which the output moves"};
  for (std::size_t c = 0; c < log.columns.size(); ++c) {
    if (auto told = detail::tells_itself(raw, c); !told) return told.error();
  }
  const auto studied = [&](const FitData& rows, double from, double share) {
    return detail::study_folds(rows, scheduling, options, result, [&](double part) {
      if (options.progress) options.progress(from + share * part);
    });
  };
  auto found = studied(prepared->data, 0.1, 0.5);
  if (!found)
    return E{"averaged", static_cast<double>(options.averaged), "leaves fewer than 200 rows"};
  // Of a u that follows from y of its row alone, an earlier one tells that law and no machine.
  if (options.late_input && detail::own_input(raw) > detail::own_input_min) {
    for (int rows = 1; rows <= 2; ++rows) {
      const FitData earlier = detail::advanced(prepared->data, static_cast<std::size_t>(rows));
      if (!detail::worth_earlier(*found, raw, excerpt(earlier, options.rows_max))) break;
      result.late_rows = rows;
      auto again = studied(earlier, 0.6, 0.3);
      if (!again || !detail::far_more_likely(*again, *found)) break;
      found = std::move(again);
    }
  }
  if (options.progress) options.progress(1.0);
  return found->best;
}

ESOKIT_FUNCTION Check<double> judge(const Identified& found, const Log& log,
                                    const IdentifyOptions& options) {
  Rules<double> rules;
  const double T = found.log.sample_time;
  const double jitter = log.time.empty() ? found.log.jitter / T : 0.0;
  rules.demand(jitter <= 0.05, "jitter", jitter,
               "is the jitter over T without time stamps, above 0.05: record the time of each row");
  rules.demand(options.applied || found.log.saturated < 0.5, "saturated", found.log.saturated,
               "is the share of rows with u at its limits: record the u that the actuator held");
  rules.demand(found.own_input > detail::own_input_min, "own_input", found.own_input,
               "is the share of u that does not follow from y, which is too small: record a "
               "moving reference");
  rules.demand(!found.at_once, "at_once", found.latency.value,
               "is the latency found, but y follows u at once: is y an acceleration or a force? "
               "Record its speed or position, or more rows per second");
  const bool excited = found.plateau.middle > 0 && found.excitation < detail::excitation_max;
  rules.demand(excited, "excitation", found.plateau.middle > 0 ? found.excitation : 1.0,
               "is the smallest relative error of b0 and too large: what of y follows from u is "
               "not distinct from the rest; record several steps that last until y settles, or a "
               "sweep");
  // Behind it: of a log that moves next to nothing this is no finding.
  rules.demand(
      found.returns >= 0.1, "returns", found.returns,
      "is how fast y returns by what u follows of y, which is next to nothing: the law of u "
      "was found and no machine; record a moving reference");
  rules.demand(
      !(found.other_order.left < 1.0 / std::numbers::e), "order", static_cast<double>(found.order),
      "is the order, but where b0 was found another one leaves less than 1 / e of the mean square: "
      "give that one, or a y of this one (a position under a motor has order 2, a speed 1)");
  if (!rules) return rules;
  const SecondOpinion& second = found.second_opinion;
  const bool informed = detail::informed(found);
  const double widest = informed ? options.interval_agreed : options.interval_max;
  // A lead does no harm if b0 is nearly the same without it. Feedback from y makes small ones up.
  const double off = (std::abs)(found.lead.input_gain - found.input_gain.value);
  rules.demand(!detail::lead_harms(found) ||
                   (off <= found.input_gain.half_width && found.input_gain.share() <= widest),
               "lead", found.lead.time, "is the time by which y moves before u: is u logged late?");
  rules.demand(detail::white(found, options) || informed,
               {"correlation", found.correlation,
                "is the correlation of the innovations, so the model lacks something, and output "
                "error does not tell b0 either: record longer, with steps of u that last until y "
                "settles, or add known effects as columns; must be at most",
                -1, detail::correlation_limit(found, options), true});
  // Of 226 accepted logs of random machines one was above 1: its b0 was beyond its interval.
  rules.demand(found.rise < 1.25, "rise", found.rise,
               "is how fast y rises and falls over what b0 times the range of u allows: something "
               "else moves y, or u was logged late; record u when it acts");
  rules.demand(!informed || second.agrees(found.input_gain.value),
               {"second_opinion", found.input_gain.value / second.input_gain.value,
                "is b0 over that of output error: they must agree by 0.6 to 1.7"});
  rules.demand(!found.at_bound, "latency", found.latency.value,
               "(or the pole) is at the end of its range: record faster changes of u");
  rules.demand(found.plateau.spread <= options.plateau_max,
               {"plateau", found.plateau.spread,
                "is the relative change of b0 between neighbouring bandwidths, so there is no "
                "plateau: record more motion in the band of the controller; must be at most",
                -1, options.plateau_max, true});
  rules.demand(options.scheduled || found.schedule_shift <= 1.0, "schedule", found.schedule_shift,
               "is the change of b0 along the scheduling column over its interval: ask for b0 "
               "over the column (scheduled = true), or record at one setting");
  rules.demand(found.position_shift <= options.position_shift_max,
               {"position_shift", found.position_shift,
                "is the change of b0 in half widths if a force depends on y, so gravity or a "
                "spring is missing: add it as a column (sin y, y), or record motion with more "
                "frequencies; must be at most",
                -1, options.position_shift_max, true});
  rules.demand(found.friction_shift <= options.friction_shift_max,
               {"friction_shift", found.friction_shift,
                "is the change of b0 between two scales of friction in standard errors: record "
                "faster motion; must be at most",
                -1, options.friction_shift_max, true});
  rules.demand(
      found.input_gain.share() <= widest,
      {"interval", found.input_gain.share(),
       "is the half width of b0 over b0: record longer or with larger steps; must be at most", -1,
       widest, true});
  return rules;
}

ESOKIT_FUNCTION Expected<Identified, Error<double>> identify(const Log& log,
                                                             const IdentifyOptions& options) {
  auto found = study(log, options);
  if (!found) return found.error();
  if (auto verdict = judge(*found, log, options); !verdict) return verdict.error();
  return found;
}

}  // namespace esokit
