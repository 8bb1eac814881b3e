#pragma once

#include <algorithm>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION bool SecondOpinion::agrees(double gain) const {
  const double ratio = gain / input_gain.value;
  return 0.6 <= ratio && ratio <= 1.7;
}

ESOKIT_FUNCTION SecondOpinion second_opinion(const FitData& data, const FitModel& model,
                                             FitBounds bounds, const FitPoint& at,
                                             double bandwidth) {
  bounds.bandwidth_min = (std::min)(bounds.bandwidth_min, bandwidth);
  InnovationsFit fit(data, model, bounds);
  FitPoint start = at;
  start.bandwidth = bandwidth;
  std::vector<Fit> starts{fit.at(fit.inside(start))};
  const double duration = data.sample_time * static_cast<double>(data.y.size());
  for (const double pole : {0.0, 3.0, 10.0, 30.0, 100.0}) {
    for (const double latency : {0.01, 0.1, 0.4, 1.0}) {
      starts.push_back(
          fit.at(fit.inside({bandwidth, latency * bounds.latency_max, 0.7, pole / duration})));
    }
  }
  std::partial_sort(starts.begin() + 1, starts.begin() + 2, starts.end(),
                    [](const Fit& a, const Fit& b) { return a.mean_square < b.mean_square; });
  Fit best = fit.minimise(starts[0].at, false, 8);
  const Fit other = fit.minimise(starts[1].at, false, 8);
  if (other.mean_square < best.mean_square) best = other;
  best = fit.minimise(best.at, false);
  best = fit.at(best.at);
  const FitErrors errors = jackknife(fit, best, false);
  InnovationsFit without(data, model, bounds);
  without.ignore_input();
  const double left = without.minimise(best.at, false, 8).mean_square;
  return {{best.linear[0], student_95(19) * errors.linear[0]},
          1.0 - best.mean_square / left,
          bandwidth};
}

}  // namespace esokit
