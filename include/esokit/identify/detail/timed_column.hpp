/// @file
/// A measured disturbance on its way to the machine: a column of a log through a lag and a dead
/// time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/language.hpp>
#include <vector>

namespace esokit {

/// A measured column, and the times that its effect takes. Between its rows it is a straight line.
struct TimedColumn {
  std::vector<double> measured{};  ///< as in the log, one value a row
  double latency = 0.0;            ///< lag plus dead time, s
  double lag_square = 0.0;         ///< square of the lag, s^2, at most that of the latency

  /// Whether the times are fitted. Those of a function of y are not, as a column that is late and a
  /// pole look the same there; nor those of a column that does nothing.
  bool free = true;

  /// The lag, s.
  [[nodiscard]] double lag() const { return std::sqrt(lag_square); }
  /// The dead time, s.
  [[nodiscard]] double dead_time() const { return (std::max)(latency - lag(), 0.0); }
};

namespace detail {

/// `measured` through a lag and a dead time, which may be negative: the exact answer to a straight
/// line between the rows, at each row. A piece begins and ends at rest.
/// @param starts first rows of the pieces @param T sample time, s
std::vector<double> late(const std::vector<double>& measured,
                         const std::vector<std::size_t>& starts, double T, double lag,
                         double dead_time);

/// The same with the times of the column, moved by so much.
std::vector<double> late(const TimedColumn& column, const std::vector<std::size_t>& starts,
                         double T, double longer = 0.0, double square = 0.0);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/timed_column.ipp>
#endif
