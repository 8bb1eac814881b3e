#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/plateau.hpp>
#include <limits>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION Plateau find_plateau(InnovationsFit& fit, const Fit& best, double tolerance) {
  Plateau plateau;
  const double ratio = std::sqrt(2.0);
  const auto go = [&](double factor, bool with_first) {
    std::vector<PlateauPoint> found;
    FitPoint point = best.at;
    if (!with_first) point.bandwidth *= factor;
    while (point.bandwidth >= fit.bounds().bandwidth_min &&
           point.bandwidth <= fit.bounds().bandwidth_max) {
      PlateauPoint here;
      here.fit = fit.minimise(point, false, 8);
      here.errors = jackknife(fit, here.fit, false);
      here.at_bound = fit.at_bound(here.fit.at);
      // A fit that starts at a bound would not leave it.
      if (!here.at_bound) point = here.fit.at;
      point.bandwidth = here.fit.at.bandwidth * factor;
      found.push_back(std::move(here));
    }
    return found;
  };
  auto down = go(1.0 / ratio, true);
  const auto up = go(ratio, false);
  std::reverse(down.begin(), down.end());
  plateau.points = std::move(down);
  plateau.points.insert(plateau.points.end(), up.begin(), up.end());
  double least = std::numeric_limits<double>::infinity();
  const auto b0 = [&](std::size_t i) { return plateau.points[i].fit.linear[0]; };
  for (std::size_t i = 1; i + 1 < plateau.points.size(); ++i) {
    const auto [low, high] = std::minmax({b0(i - 1), b0(i), b0(i + 1)});
    double error = 0.0;
    for (std::size_t j = i - 1; j <= i + 1; ++j) {
      error = (std::max)(error, plateau.points[j].errors.linear[0]);
    }
    const double spread = (high - low) / (std::abs)(b0(i));
    const double size = spread * spread + error * error / (b0(i) * b0(i));
    if (size < least) {
      least = size;
      plateau.middle = i;
      plateau.spread = spread;
      plateau.error = plateau.points[i].errors.linear[0];
    }
  }
  if (plateau.middle == 0) {
    plateau.spread = std::numeric_limits<double>::infinity();
    return plateau;
  }
  std::size_t first = plateau.middle, last = plateau.middle;
  const auto within = [&](std::size_t i) {
    return (std::abs)(b0(i) - b0(plateau.middle)) <= tolerance * (std::abs)(b0(plateau.middle));
  };
  while (first > 0 && within(first - 1)) --first;
  while (last + 1 < plateau.points.size() && within(last + 1)) ++last;
  plateau.from = plateau.points[first].fit.at.bandwidth;
  plateau.to = plateau.points[last].fit.at.bandwidth;
  return plateau;
}

}  // namespace esokit
