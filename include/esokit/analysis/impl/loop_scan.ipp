#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/detail/loop_scan.hpp>
#include <esokit/analysis/loop.hpp>
#include <limits>
#include <numbers>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION LoopGain loop_gain_of(const Loop& loop, int channel) {
  return {loop.plant(), loop.controller(), channel};
}

ESOKIT_FUNCTION ScanRange scan_range(const Loop& loop, int channel) {
  ScanRange range;
  const double T = loop.sample_time();
  double slowest = (std::numeric_limits<double>::max)();
  double fastest = 0.0;
  const auto look = [&](const std::vector<std::complex<double>>& poles, bool stable) {
    for (const std::complex<double>& p : poles) {
      const double size = T > 0.0 ? (std::abs)(p) / T : (std::abs)(p);
      // Integrators are computed as poles of the size of rounding errors.
      if (!stable && !(size > 1e-9 * fastest)) continue;
      if (stable) fastest = (std::max)(fastest, size);
      slowest = (std::min)(slowest, size);
      range.features.push_back(T > 0.0 ? (std::abs)(std::arg(1.0 + p)) / T : (std::abs)(p.imag()));
    }
  };
  look(loop.poles(), true);
  look(poles_of(loop.plant().a), false);
  look(poles_of(loop.controller().a), false);
  if (loop.channels() > 1) {
    look(poles_of(closed_system(loop.plant(), loop.controller(), channel).a), false);
  }
  range.from = 1e-3 * slowest;
  range.to = T > 0.0 ? std::numbers::pi / T : 1e3 * fastest;
  range.from =
      (std::max)((std::min)(range.from, 1e-3 * range.to), (std::numeric_limits<double>::min)());
  std::sort(range.features.begin(), range.features.end());
  return range;
}

ESOKIT_FUNCTION double loop_gain_at_zero(const LoopGain& response, const ScanRange& range) {
  const std::complex<double> l = response.at(0.0);
  return (std::abs)(l) <= 2.0 * (std::abs)(response(range.from))
             ? l.real()
             : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace esokit::detail
