#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/detail/b0_evidence.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <limits>
#include <vector>

namespace esokit {

namespace detail {

/// Upper ends of the ranges except the last; ranges with a single value are merged.
inline std::vector<double> schedule_edges(std::vector<double> along, int bins) {
  std::sort(along.begin(), along.end());
  std::vector<double> edges;
  for (int bin = 1; bin < bins; ++bin) {
    const double edge =
        along[along.size() * static_cast<std::size_t>(bin) / static_cast<std::size_t>(bins)];
    if (edge > along.front() && (edges.empty() || edge > edges.back())) edges.push_back(edge);
  }
  return edges;
}

/// How far the b0 of the ranges differ from each other; above 1 by more than chance. One of several
/// may differ by chance: all together must differ by more than chance, and one by more than its
/// interval. @param t Student's factor
inline double schedule_shift(const std::vector<double>& value, const std::vector<double>& error,
                             std::size_t ranges, double t) {
  double weights = 0.0, middle = 0.0, square = 0.0, most = 0.0;
  for (std::size_t bin = 0; bin < ranges; ++bin) {
    const double weight = 1.0 / (error[bin] * error[bin]);
    weights += weight;
    middle += weight * value[bin];
  }
  middle /= weights;
  for (std::size_t bin = 0; bin < ranges; ++bin) {
    const double off = (std::abs)(value[bin] - middle) / error[bin];
    square += off * off;
    most = (std::max)(most, off / t);
  }
  const double freedom = static_cast<double>(ranges) - 1.0;
  const double cube = 1.0 - 2.0 / (9.0 * freedom) + 1.645 * std::sqrt(2.0 / (9.0 * freedom));
  return freedom > 0.0 ? (std::min)(most, std::sqrt(square / (freedom * cube * cube * cube))) : 0.0;
}

ESOKIT_FUNCTION void find_schedule(const FitData& used, const std::vector<double>& along,
                                   const FitModel& model, const IdentifyOptions& options,
                                   Identified& result) {
  const double t = student_95(19);
  const std::vector<double> edges = schedule_edges(along, options.schedule_bins);
  FitData parts = used;
  parts.inputs.assign(edges.size(), std::vector<double>(along.size(), 0.0));
  result.schedule.assign(edges.size() + 1, {});
  for (GainInRange& range : result.schedule) {
    range.from = std::numeric_limits<double>::infinity();
    range.to = -range.from;
  }
  double mean = 0.0;
  for (std::size_t k = 0; k < along.size(); ++k) {
    const auto bin = static_cast<std::size_t>(
        std::upper_bound(edges.begin(), edges.end(), along[k]) - edges.begin());
    GainInRange& range = result.schedule[bin];
    range.from = (std::min)(range.from, along[k]);
    range.to = (std::max)(range.to, along[k]);
    ++range.rows;
    mean += along[k] / static_cast<double>(along.size());
    if (bin > 0) {
      parts.inputs[bin - 1][k] = used.u[k];
      parts.u[k] = 0.0;
    }
  }
  const FitBounds& bounds =
      std::find_if(result.orders.begin(), result.orders.end(), [&](const auto& order) {
        return order.model.order == result.order;
      })->bounds;
  const Plateau& plateau = result.plateau;
  // At the plateau and its neighbours, like b0 itself.
  const auto solved = [&](const FitData& data, std::vector<double>& value,
                          std::vector<double>& error) {
    InnovationsFit fit(data, model, bounds);
    std::vector<double> low, high;
    for (const std::size_t i : {plateau.middle - 1, plateau.middle + 1, plateau.middle}) {
      const Fit found = fit.at(plateau.points[i].fit.at);
      if (low.empty()) low = high = found.linear;
      for (std::size_t c = 0; c < low.size(); ++c) {
        low[c] = (std::min)(low[c], found.linear[c]);
        high[c] = (std::max)(high[c], found.linear[c]);
      }
      if (i == plateau.middle) {
        value = found.linear;
        error = jackknife(fit, found, false).linear;
      }
    }
    for (std::size_t c = 0; c < error.size(); ++c) error[c] += 0.25 * (high[c] - low[c]) / t;
  };
  std::vector<double> value, error;
  solved(parts, value, error);
  for (std::size_t bin = 0; bin < result.schedule.size(); ++bin) {
    result.schedule[bin].input_gain = {value[bin], t * error[bin]};
  }
  result.schedule_shift = schedule_shift(value, error, result.schedule.size(), t);
  FitData line = used;
  line.inputs.assign(1, std::vector<double>(along.size()));
  for (std::size_t k = 0; k < along.size(); ++k) line.inputs[0][k] = used.u[k] * (along[k] - mean);
  solved(line, value, error);
  result.schedule_slope = {value[1], t * error[1]};
}

ESOKIT_FUNCTION double correlation_limit(const Identified& found, const IdentifyOptions& options) {
  const double rows = static_cast<double>(found.log.used) / found.averaged;
  return (std::max)(options.correlation_max, 3.0 / std::sqrt(rows));
}

ESOKIT_FUNCTION bool white(const Identified& found, const IdentifyOptions& options) {
  return found.correlation <= correlation_limit(found, options);
}

ESOKIT_FUNCTION double half_row(const Identified& found) {
  return 0.5 * found.averaged * found.log.sample_time;
}

ESOKIT_FUNCTION bool leads(const Identified& found) {
  if (!(found.lead.time > 0.0)) return false;
  const SecondOpinion& second = found.second_opinion;
  if (!second.informative()) return true;
  return found.lead.left < 0.8 || (std::abs)(second.input_gain.value - found.lead.input_gain) <
                                      (std::abs)(second.input_gain.value - found.input_gain.value);
}

ESOKIT_FUNCTION bool lead_harms(const Identified& found) {
  const double off = (std::abs)(found.lead.input_gain - found.input_gain.value);
  return leads(found) && !(off <= 0.1 * (std::abs)(found.input_gain.value));
}

ESOKIT_FUNCTION bool informed(const Identified& found) {
  const SecondOpinion& second = found.second_opinion;
  if (!second.informative() || lead_harms(found)) return false;
  return found.latency.value >= half_row(found) ||
         (second.explained >= 0.95 &&
          (std::abs)(second.input_gain.value - found.input_gain.value) <=
              (std::max)(0.1 * (std::abs)(found.input_gain.value), found.input_gain.half_width));
}

ESOKIT_FUNCTION double reach_above(const Plateau& plateau, double bandwidth_min) {
  const Fit& here = plateau.points[plateau.middle].fit;
  double reach = 0.0;
  if (here.at.bandwidth > 4.0 * bandwidth_min) return reach;
  const std::size_t high = (std::min)(plateau.middle + 8, plateau.points.size() - 1);
  for (std::size_t i = plateau.middle + 1; i <= high; ++i) {
    const PlateauPoint& point = plateau.points[i];
    const double gained = 0.5 * static_cast<double>(point.fit.rows) *
                          std::log(here.mean_square / point.fit.mean_square);
    if (point.at_bound || !(gained > 10.0)) continue;
    const double apart = (std::abs)(point.fit.linear[0] - here.linear[0]);
    reach = (std::max)(reach, apart - student_95(19) * point.errors.linear[0]);
  }
  return reach;
}

ESOKIT_FUNCTION Estimate widened(const Identified& found, const IdentifyOptions& options) {
  Estimate gain = found.input_gain;
  const auto reach = [&](double to) {
    gain.half_width = (std::max)(gain.half_width, (std::abs)(to - gain.value));
  };
  const bool coloured = !white(found, options);
  if (coloured) gain.half_width += 0.01 * (std::abs)(gain.value);
  // When exactly the machine stands is not known, and that moves b0 by some per cent.
  if (found.held > 0.0) gain.half_width += 0.1 * (std::abs)(gain.value);
  if (informed(found) && (coloured || gain.share() > options.interval_max))
    reach(found.second_opinion.input_gain.value);
  const Estimate& moving = found.in_motion.moving;
  if (found.in_motion.differ()) reach(moving.value > gain.value ? moving.high() : moving.low());
  return gain;
}

}  // namespace detail
}  // namespace esokit
