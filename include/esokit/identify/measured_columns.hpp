/// @file
/// Measured disturbances in a log: how much each adds to y^(n), through which lag and dead time.
#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/error.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/model/measured_input.hpp>
#include <utility>
#include <vector>

namespace esokit {

/// What a measured column w adds to y^(n): gain times w, through a lag and a dead time.
struct MeasuredEffect {
  Estimate gain{};       ///< unit of y^(n) per unit of w
  Estimate latency{};    ///< lag plus dead time, s
  Estimate lag{};        ///< of first order, s
  Estimate dead_time{};  ///< s; w is a straight line between the rows, so one that is held from its
                         ///< row to the next comes half a row later

  /// Whether the log tells the times: not of a column that is a function of y, nor of one that does
  /// too little. Then lag and dead time are zero.
  bool timed = false;
  bool follows_output = false;  ///< it is a function of y
  std::size_t lost = 0;         ///< rows in which w was missing, and lies between its neighbours

  /// Whether the effect is seen in the log: its interval does not contain zero.
  [[nodiscard]] bool seen() const { return gain.half_width < (std::abs)(gain.value); }
  /// The settings of `Measured`, where w is held from its sample to the next: half a sample less of
  /// latency, first of dead time, then of lag.
  /// @param sample_time s @param input_latency how much later u acts than the observer knows, s:
  /// the law is given w so much sooner
  [[nodiscard]] MeasuredInput<double> held(double sample_time, double input_latency = 0.0) const;
};

namespace detail {

/// Share of the squares of `values` that is not a function of `of`: of its mean over ranges of `of`
/// with equal numbers of rows.
double share_left(const std::vector<double>& values, const std::vector<double>& of);

/// A column that follows another one leaves less than this share of its squares.
constexpr double follows = 1e-3;

/// Whether column `c` of the log can be distinguished from a constant, from u and from those before
/// it.
Check<double> tells_itself(const FitData& data, std::size_t c);

/// Makes the first `count` columns timed ones, still at once.
void make_timed(FitData& data, std::size_t count);

/// Takes the times of another fit.
void take_times(FitData& data, const std::vector<TimedColumn>& from);

/// Which of the two times a step moves.
enum class TimeSplit { both, lag, dead_time };

/// A damped Gauss-Newton step of latency and squared lag, the last two of `normal`; with one of
/// them, the squared lag moves by `off`, and by `along` times the step of the latency.
std::pair<double, double> time_step(std::vector<double> normal, std::vector<double> right,
                                    double damping, TimeSplit split, double along, double off);

/// Finds the times of each timed column, with all else at `at` but for the linear numbers: from a
/// grid (if `search`), then by Gauss-Newton steps. One column after the other, twice.
void find_times(FitData& data, const FitModel& model, const FitBounds& bounds, const FitPoint& at,
                bool search);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/measured_columns.ipp>
#endif
