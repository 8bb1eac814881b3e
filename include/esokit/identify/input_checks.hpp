/// @file
/// What a log tells about its u: an actuator that is not linear, friction that holds against it, u
/// logged late, y that follows at once.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <utility>
#include <vector>

namespace esokit {

/// b0 at small and at large u: the slopes of a line that bends at abs(u) = `knot`.
struct GainBySize {
  double knot = 0.0;  ///< half way between the smallest and the largest abs(u), unit of u; 0: u
                      ///< does not tell the two apart (it has two levels)
  Estimate below{};   ///< b0 below it
  Estimate above{};   ///< b0 above it

  /// Whether the two differ by a quarter, and by more than their intervals: the actuator saturates,
  /// or its effect is not proportional to u.
  [[nodiscard]] bool differ() const { return knot > 0.0 && differs(below, above); }

  /// Whether two numbers differ by a quarter, and by more than their intervals.
  [[nodiscard]] static bool differs(const Estimate& a, const Estimate& b);
};

/// b0 in motion and at standstill, where the speed is below a tenth of its rms.
struct GainInMotion {
  double still = 0.0;  ///< share of the rows at standstill; 0: not tried
  Estimate moving{};   ///< b0 in motion
  Estimate at_rest{};  ///< b0 at standstill
  double all = 0.0;    ///< b0 of all rows

  /// Whether b0 is smaller at standstill, as by `GainBySize`, and that of all rows is a tenth off
  /// that of the motion: friction holds the machine against u, and it matters.
  [[nodiscard]] bool differ() const;
};

/// How early y moves. No machine moves before its input: such a log has u late or y early.
struct Lead {
  double time = 0.0;        ///< s by which y moves before u; 0: it does not
  double input_gain = 0.0;  ///< b0 with u earlier by this time
  double left = 1.0;        ///< of the mean square of output error, if u is that much earlier
};

namespace detail {

/// b0 and that of the further input of `data` alone, at the bandwidth of `at`.
std::pair<Estimate, Estimate> two_gains(const FitData& data, const FitModel& model,
                                        const FitBounds& bounds, const FitPoint& at);

/// b0 in motion and at standstill, at the bandwidth of `here`. @param speed of each row
GainInMotion gain_in_motion(const FitData& data, const FitModel& model, const FitBounds& bounds,
                            const Fit& here, const std::vector<double>& speed);

/// b0 at small and at large u, at the bandwidth of `at`.
GainBySize gain_by_size(const FitData& data, const FitModel& model, const FitBounds& bounds,
                        const FitPoint& at);

/// The same rows with u as it is logged `rows` later.
FitData advanced(FitData data, std::size_t rows);

/// The lead of y, by a fit with u advanced by ten rows: it must leave less than three quarters of
/// the mean square of `here`.
Lead lead_of(const FitData& data, const FitModel& model, const FitBounds& bounds, const Fit& here);

/// Between the fastest rise and the fastest fall of y over `window` s; 0 if no piece is so long.
double span_of_rates(const FitData& data, double window);

/// The values of each row less their mean, as they were `by` rows before; zeros in the first two
/// rows.
std::vector<double> delayed(const std::vector<double>& values, std::size_t by);

std::vector<double> ones(std::size_t rows);

/// Share of u that does not follow from y_k, y_(k-1), u_(k-1): 0 if u comes from a controller whose
/// reference never moves.
double own_input(const FitData& data);

/// Slope of the straight line that u follows over y.
double slope_of_law(const FitData& data);

/// Whether y follows u within the row: u of the last three rows explains y, and y of the row before
/// adds little. Of less than four changes of u nothing is said.
bool at_once(const FitData& data);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/input_checks.ipp>
#endif
