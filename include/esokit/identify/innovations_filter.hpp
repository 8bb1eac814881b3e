/// @file
/// The Kalman filter of an innovations fit: data, model and point of a fit, and the innovations of
/// one point.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <esokit/identify/spectrum.hpp>
#include <esokit/math/detail/dense.hpp>
#include <memory>
#include <vector>

namespace esokit {

/// An estimated number with its 95 % interval.
struct Estimate {
  double value = 0.0;       ///< best estimate
  double half_width = 0.0;  ///< the interval is value - half_width .. value + half_width
  [[nodiscard]] double low() const { return value - half_width; }   ///< lower end
  [[nodiscard]] double high() const { return value + half_width; }  ///< upper end

  /// Half width divided by the magnitude.
  [[nodiscard]] double share() const { return half_width / (std::abs)(value); }
};

/// Rows with a constant sample time, for the fit.
struct FitData {
  double sample_time = 0.0;            ///< T, s
  std::vector<double> u;               ///< input, held from its row to the next
  std::vector<double> y;               ///< output, measured at its row
  std::vector<std::size_t> starts{0};  ///< index of the first row of each piece without a gap

  /// What was measured near each row, if not at it: `y` is then a straight line between these. NaN:
  /// nothing. Empty: y itself.
  std::vector<double> measured{};
  std::vector<double> offsets{};  ///< how much later than its row it was measured, s, as `measured`

  /// Whether something was measured in a row.
  [[nodiscard]] bool has(std::size_t row) const {
    return measured.empty() || is_finite(measured[row]);
  }

  /// Times of these rows, s; empty: no gap in time.
  std::vector<double> start_times{};

  /// Whether the disturbance, a random walk, goes on from piece to piece (with one integrator);
  /// else it is unknown anew, as y is.
  bool one_load = false;

  /// Whether u before a piece is unknown: then what the lag has left of it is fitted, a number for
  /// each piece. Else u was at rest.
  bool unknown_before = false;

  /// More inputs that reach the plant through the same lag and dead time, each as long as u.
  std::vector<std::vector<double>> inputs{};

  /// Columns with known effects that enter where the disturbance does, each as long as y: friction,
  /// a known load.
  std::vector<std::vector<double>> columns{};

  /// What the first of `columns` are made of, those whose effect may be late.
  std::vector<TimedColumn> timed{};

  std::ptrdiff_t friction = -1;  ///< index of the column that is friction, whose number is not
                                 ///< negative; -1: none
  int averaged =
      1;  ///< rows of the log that were averaged into one; above 1 the input is linear between rows
};

/// The model that is fitted.
struct FitModel {
  int order = 2;      ///< n, 1 to 3
  int extension = 1;  ///< m, 1 or 2
  bool pole = true;   ///< whether a may differ from zero
};

/// The parameters on which the innovations depend nonlinearly.
struct FitPoint {
  double bandwidth = 0.0;  ///< w, rad/s: w^(2 (n + m)) is the intensity of the disturbance divided
                           ///< by that of the noise
  double latency = 0.0;    ///< tau + L, s
  double lag_share = 0.5;  ///< tau / (tau + L)
  double pole = 0.0;       ///< a, 1/s

  [[nodiscard]] double lag() const { return latency * lag_share; }                ///< tau, s
  [[nodiscard]] double dead_time() const { return latency * (1.0 - lag_share); }  ///< L, s
};

/// A fitted model.
struct Fit {
  FitPoint at{};                 ///< the nonlinear parameters
  std::vector<double> linear{};  ///< b0, then one number for each further input and each column
  double mean_square = 0.0;      ///< of the innovations, unit of y squared
  double noise = 0.0;            ///< standard deviation of the measurement noise
  double disturbance = 0.0;      ///< intensity of d^(m): variance of its increments per time
  std::size_t rows = 0;          ///< number of innovations used
  bool converged = false;        ///< whether the last step was small
  [[nodiscard]] double input_gain() const { return linear.empty() ? 0.0 : linear[0]; }  ///< b0
};

/// Bounds of the fitted parameters.
struct FitBounds {
  double bandwidth_min = 0.0;  ///< of w, rad/s
  double bandwidth_max = 0.0;  ///< of w, rad/s
  double latency_min = 0.0;    ///< of tau + L, s
  double latency_max = 0.0;    ///< of tau + L, s; the first rows of a piece, for this time, are not
                               ///< used (unless much of the motion of u lies there)
  double pole_latency = 0.5;   ///< largest a (tau + L): beyond it pole and lag are exchanged
};

namespace detail {

/// Of the rows from a start on, until steady.
struct GainsFromStart {
  std::vector<double> gains{};    // one per state in each row
  std::vector<double> weights{};  // sqrt(steady variance / variance)
};

/// The result of the Riccati recursion; it depends on w and a only.
struct GainTable {
  double bandwidth = 0.0;
  double pole = 0.0;
  GainsFromStart first{};        // nothing is known
  GainsFromStart next{};         // of the other pieces, if the load goes on from piece to piece
  double steady_variance = 1.0;  // of an innovation, divided by that of the noise
  // Variances of the steady state before a measurement, then after so many rows without one.
  std::vector<std::vector<double>> waited{};
};

/// The tables of the last few points, the latest first: those beside one point share some.
using GainTables = std::array<std::shared_ptr<const GainTable>, 3>;

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/innovations_filter.ipp>
#endif
