/// @file
/// Standard errors of a fitted model, by a jackknife over stretches of the log.
///
/// If the machine has more than the model, the innovations are not white and formal intervals are
/// several times too short. So the log is cut into stretches and the fit is repeated without each
/// of them (one Gauss-Newton step, all parameters together): any difference between the stretches,
/// whatever its cause, widens the interval.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/fit.hpp>
#include <utility>
#include <vector>

namespace esokit {

/// Variances of latency and squared lag, and their covariance.
struct SplitCovariance {
  double latency = 0.0;     ///< of tau + L, s^2
  double lag_square = 0.0;  ///< of tau^2, s^4
  double both = 0.0;        ///< their covariance, s^3
};

/// Standard errors of a fit.
struct FitErrors {
  double bandwidth = 0.0;        ///< rad/s; 0 if w was given
  double latency = 0.0;          ///< s
  double lag = 0.0;              ///< s: as of `split_errors`
  double dead_time = 0.0;        ///< s: as of `split_errors`
  double pole = 0.0;             ///< 1/s
  double noise = 0.0;            ///< unit of y
  std::vector<double> linear{};  ///< b0 and the columns

  /// Latency and lag of a timed column, by one more step of all parameters.
  struct Times {
    double latency = 0.0;          ///< s
    double lag = 0.0;              ///< s
    SplitCovariance covariance{};  ///< of latency and squared lag
  };
  std::vector<Times> times{};  ///< of all timed columns; zeros of one whose times are not fitted
};

/// Student's t for a two-sided 95 % interval (Cornish-Fisher expansion from the normal). @param
/// freedom degrees of freedom
[[nodiscard]] double student_95(int freedom);

/// Standard errors of lag and dead time: the largest distance from the fit within the ellipse of
/// latency and squared lag of which `t` standard errors are the 95 % interval, divided by `t`.
///
/// The log determines latency and squared lag: in these the ellipse is right, also where the lag is
/// at zero, the end of its range, and has no standard error of its own.
/// @param longest the lag is below it, s, where this is not the latency
[[nodiscard]] std::pair<double, double> split_errors(const FitPoint& at,
                                                     const SplitCovariance& covariance, double t,
                                                     double longest = 0.0);

/// Standard errors of the fit that `fit` returned last, by leaving out one of `stretches` equal
/// stretches at a time.
[[nodiscard]] FitErrors jackknife(InnovationsFit& fit, const Fit& at, bool with_bandwidth,
                                  int stretches = 20);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/intervals.ipp>
#endif
