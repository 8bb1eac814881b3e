/// @file
/// Printed numbers of single runs, beside ours over many seeds.
#pragma once

#include <cmath>
#include <string>

#include "report.hpp"
#include "statistics.hpp"

namespace esokit::examples {

/// A printed number of one run is met if a single run of ours could give it: within three standard
/// deviations. Where those are more than the number itself, that would say nothing, and it is not
/// judged. `missed`: known to be missed, `note` says why.
inline void check_single_run(Report& report, const std::string& name, const std::string& metric,
                             double printed, const Statistics& ours, const std::string& note,
                             bool missed = false) {
  const auto tolerance = Tolerance::deviations(3.0, ours);
  if (missed) {
    report.known_miss(name, metric, printed, ours, tolerance, note);
  } else if (tolerance.difference(printed) > std::abs(printed)) {
    report.check(name, metric, printed, ours, std::nullopt,
                 "not judged: 3 sd are more than the number");
  } else {
    report.check(name, metric, printed, ours, tolerance, note);
  }
}

}  // namespace esokit::examples
