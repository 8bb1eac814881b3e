#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION std::vector<double> late(const std::vector<double>& measured,
                                         const std::vector<std::size_t>& starts, double T,
                                         double lag, double dead_time) {
  std::vector<double> out(measured.size());
  const double rows = dead_time / T;
  const double whole = std::floor(rows);
  const double part = rows - whole;  // of a row
  const auto back = static_cast<std::ptrdiff_t>(whole);
  // Within a row the delayed column is two straight lines: up to `part` rows, and after it.
  struct Stretch {
    double decay, from, to;  // v = decay v + from a + to b
  };
  const auto stretch = [&](double time) {
    if (!(lag > 0.01 * T)) return Stretch{0.0, 0.0, 1.0};
    const double x = time / lag, decay = std::exp(-x);
    const double mean = x > 1e-6 ? -std::expm1(-x) / x : 1.0 - 0.5 * x;
    return Stretch{decay, mean - decay, 1.0 - mean};
  };
  const Stretch first = stretch(part * T), second = stretch((1.0 - part) * T);
  for (std::size_t piece = 0; piece < starts.size(); ++piece) {
    const auto from = static_cast<std::ptrdiff_t>(starts[piece]);
    const auto to = static_cast<std::ptrdiff_t>(piece + 1 < starts.size() ? starts[piece + 1]
                                                                          : measured.size());
    const auto at = [&](std::ptrdiff_t k) {
      return measured[static_cast<std::size_t>(std::clamp(k, from, to - 1))];
    };
    double before = (1.0 - part) * at(from - back) + part * at(from - back - 1);
    double v = before;
    for (std::ptrdiff_t k = from; k < to; ++k) {
      out[static_cast<std::size_t>(k)] = v;
      const double knee = at(k - back);
      const double after = (1.0 - part) * at(k + 1 - back) + part * knee;
      if (part > 0.0) v = first.decay * v + first.from * before + first.to * knee;
      v = second.decay * v + second.from * knee + second.to * after;
      before = after;
    }
  }
  return out;
}

ESOKIT_FUNCTION std::vector<double> late(const TimedColumn& column,
                                         const std::vector<std::size_t>& starts, double T,
                                         double longer, double square) {
  const double lag = std::sqrt((std::max)(column.lag_square + square, 0.0));
  return late(column.measured, starts, T, lag, column.latency + longer - lag);
}

}  // namespace detail
}  // namespace esokit
