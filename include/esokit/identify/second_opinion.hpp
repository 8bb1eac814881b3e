/// @file
/// A second opinion on b0: the same fit at so low a bandwidth that it is one of output error.
///
/// Coloured innovations (a slow sensor, speed from counts, friction that sticks) tell that the
/// likelihood is not exact, but hardly that b0 is wrong. Output error believes u and the model
/// alone over the whole log, where the innovations believe y from row to row. If both find the same
/// b0, it can be trusted.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>

namespace esokit {

/// b0 by output error, and what it is worth.
struct SecondOpinion {
  Estimate input_gain{};  ///< b0
  double explained = 0;  ///< share of the squares that u explains: of those that are left without u
  double bandwidth = 0;  ///< of the filter, rad/s; 0: not tried

  /// Whether it tells anything: u explains 70 %, and the half width is below half of b0.
  [[nodiscard]] bool informative() const {
    return explained >= 0.7 && input_gain.half_width < 0.5 * (std::abs)(input_gain.value);
  }

  /// Whether b0 is close enough to this one to be the same.
  [[nodiscard]] bool agrees(double gain) const;
};

/// The fit at `bandwidth` from the best of several starts.
/// @param at the fit at the plateau, one of the starts
[[nodiscard]] SecondOpinion second_opinion(const FitData& data, const FitModel& model,
                                           FitBounds bounds, const FitPoint& at, double bandwidth);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/second_opinion.ipp>
#endif
