/// @file
/// b0 as a function of the bandwidth of the observer; the result is its value where it does not
/// depend on the bandwidth.
///
/// The likelihood chooses the bandwidth that explains the noise. If a machine is more than a chain
/// (flexible modes, coloured noise, vibration), b0 at this bandwidth is wrong. So b0 is computed
/// over a range of bandwidths, with lag, dead time and pole fitted again for each, and taken where
/// it is constant.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <vector>

namespace esokit {

/// The fit at one bandwidth.
struct PlateauPoint {
  Fit fit{};              ///< fit with w given
  FitErrors errors{};     ///< errors of the fit
  bool at_bound = false;  ///< a parameter is at a bound of its range
};

/// Fits for several bandwidths, and where they agree.
struct Plateau {
  std::vector<PlateauPoint> points{};  ///< by rising bandwidth, by a factor of sqrt(2)
  std::size_t middle = 0;  ///< index: middle of the three neighbours that agree best; 0: none
  double spread = 0.0;     ///< (largest - smallest) / middle of b0 over those three
  double error = 0.0;      ///< standard error of b0 at the middle one
  double from = 0.0;       ///< rad/s, lowest bandwidth at which b0 is within the tolerance
  double to = 0.0;         ///< rad/s, highest bandwidth at which b0 is within the tolerance
};

/// Fits at bandwidths around that of `best`.
[[nodiscard]] Plateau find_plateau(InnovationsFit& fit, const Fit& best, double tolerance = 0.1);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/plateau.ipp>
#endif
