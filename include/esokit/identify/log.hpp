/// @file
/// A recorded log, a report on it before any fit, and its rows at a constant sample time.
#pragma once

#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/fit.hpp>
#include <vector>

namespace esokit {

/// The columns of a log. Rows with a missing or non-finite u or y are left out; a missing number of
/// another column lies between its neighbours.
struct Log {
  std::vector<double> time{};  ///< time stamps, s, with any origin (also 1970); may be empty
  std::vector<double> u{};     ///< input that the actuator held from its row to the next
  std::vector<double> y{};     ///< output
  double sample_time = 0.0;    ///< T, s, if there are no time stamps

  /// Standard deviation of the clock jitter, s, if there are no time stamps.
  double jitter = 0.0;
  /// Measured disturbances (a fan, a flow, the torque of a load) and known effects that enter where
  /// the disturbance does (sin y of a pendulum), each as long as y. Between rows each is a straight
  /// line.
  std::vector<std::vector<double>> columns{};
  /// A quantity on which b0 may depend (throttle, position, battery voltage), as long as y; may be
  /// empty.
  std::vector<double> schedule{};
};

/// The report on a log before any fit.
struct LogReport {
  std::size_t rows = 0;      ///< rows in the log
  std::size_t used = 0;      ///< rows that were fitted
  std::size_t rejected = 0;  ///< rows with a number that is not finite
  std::size_t outliers =
      0;  ///< values of y, one or two in succession, that do not fit their neighbours

  /// Rows in which a column had no finite number and was put between its neighbours, a column each.
  std::vector<std::size_t> lost{};
  std::size_t missing = 0;   ///< rows that are missing according to the time stamps
  std::size_t pieces = 1;    ///< number of pieces between gaps too long to bridge
  double sample_time = 0.0;  ///< T: the mean step without gaps, s
  double jitter = 0.0;       ///< standard deviation of the steps without gaps, s

  /// The usual step of rows that come in bursts with long gaps between, s: T is longer then, so
  /// that the gaps are bridged. 0: they do not.
  double burst = 0.0;
  double duration = 0.0;      ///< s
  double quantisation = 0.0;  ///< step of y, 0 if none is visible
  double saturated = 0.0;     ///< share of rows with u at its largest or smallest value
};

/// Rows at a constant sample time, and the report on the log.
struct PreparedLog {
  FitData data{};      ///< data for the fit
  LogReport report{};  ///< report on the log
};

namespace detail {

inline constexpr double longest_bridge = 5.5;      ///< the longest step that is no gap, in T
inline constexpr std::size_t shortest_piece = 50;  ///< rows between gaps; fewer are left out

double median(std::vector<double> values);

/// Puts what lies between its neighbours in the place of numbers of a column that are not finite.
/// Up to four in succession, or in a column that is measured seldom three times as many as usually
/// lie between two that are. @return how many
std::size_t bridge(std::vector<double>& column);

}  // namespace detail

/// Checks a log and converts it to a constant sample time. If the time stamps jitter by more than 2
/// % of T, or rows are missing, u is the mean of what the actuator held in the row (also said by
/// rows without y). Then y and the columns are interpolated linearly, and `FitData::measured` has y
/// as and when it was measured.
[[nodiscard]] Expected<PreparedLog, Error<double>> prepare(const Log& log);

/// Twenty evenly spread stretches of `most` rows in total, each with a load of its own; all data if
/// they have no more rows.
[[nodiscard]] FitData excerpt(const FitData& data, std::size_t most);

/// Means of `fold` rows each; the remaining rows of a piece are left out, and so is when y was
/// measured.
[[nodiscard]] FitData averaged(const FitData& data, int fold);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/log.ipp>
#endif
