#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/log.hpp>
#include <limits>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The step of which all values are multiples within the digits with which they were written; 0 if
/// there is none.
inline double quantisation_step(const std::vector<double>& y) {
  std::vector<double> values = y;
  std::sort(values.begin(), values.end());
  const double range = values.back() - values.front();
  if (!(range > 0.0)) return 0.0;
  std::vector<double> differences;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double difference = values[i] - values[i - 1];
    if (difference > 1e-7 * range) differences.push_back(difference);
  }
  if (differences.empty()) return 0.0;
  double step = *std::min_element(differences.begin(), differences.end());
  // Rounding to decimal digits makes the smallest difference slightly too short or too long.
  for (int pass = 0; pass < 3; ++pass) {
    double sum = 0.0, count = 0.0;
    for (const double difference : differences) {
      const double multiple = (std::round)(difference / step);
      if (multiple >= 1.0 && multiple <= 3.0) sum += difference, count += multiple;
    }
    if (count > 0.0) step = sum / count;
  }
  std::size_t fits = 0;
  for (const double difference : differences) {
    const double multiple = difference / step;
    if ((std::abs)(multiple - (std::round)(multiple)) < 0.15) ++fits;
  }
  return fits * 10 >= differences.size() * 9 ? step : 0.0;
}

/// Puts what lies between their neighbours in the place of values, one or two in succession, that
/// stand far away while their neighbours agree. @return how many
inline std::size_t mend_outliers(std::vector<double>& y) {
  const std::size_t count = y.size();
  if (count < 10) return 0;
  const auto stand_away = [&](std::size_t k, std::size_t length, double least) {
    const double before = y[k - 1], after = y[k + length], middle = 0.5 * (before + after);
    const double jump =
        (std::min)((std::abs)(y[k] - middle), (std::abs)(y[k + length - 1] - middle));
    return jump > least && (std::abs)(after - before) < 0.2 * jump;
  };
  // Distances from the middle of the neighbours, and which of them outliers may have made: these
  // do not tell what is usual.
  std::vector<double> distances, usual;
  for (std::size_t k = 1; k + 1 < count; ++k)
    distances.push_back((std::abs)(y[k] - 0.5 * (y[k - 1] + y[k + 1])));
  const auto quantile = [](std::vector<double> values, std::size_t percent) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * percent / 100);
    std::nth_element(values.begin(), at, values.end());
    return *at;
  };
  std::vector<bool> suspect(count, false);
  if (const double most = quantile(distances, 75); most > 0.0) {
    for (std::size_t k = 2; k + 3 < count; ++k) {
      for (std::size_t length = 1; length <= 2; ++length) {
        if (!stand_away(k, length, 8.0 * most)) continue;
        for (std::size_t i = k - 1; i <= k + length; ++i) suspect[i] = true;
      }
    }
  }
  for (std::size_t k = 1; k + 1 < count; ++k) {
    if (!suspect[k]) usual.push_back(distances[k - 1]);
  }
  const double least = usual.empty() ? 0.0 : 8.0 * quantile(usual, 99);
  std::size_t found = 0;
  if (!(least > 0.0)) return found;
  for (std::size_t length = 1; length <= 2; ++length) {
    for (std::size_t k = 2; k + length + 1 < count; ++k) {
      if (!stand_away(k, length, least)) continue;
      const double before = y[k - 1],
                   step = (y[k + length] - before) / static_cast<double>(length + 1);
      for (std::size_t i = 0; i < length; ++i)
        y[k + i] = before + static_cast<double>(i + 1) * step;
      found += length;
    }
  }
  return found;
}

ESOKIT_FUNCTION std::size_t bridge(std::vector<double>& column) {
  std::vector<std::size_t> good;
  std::vector<double> steps;
  for (std::size_t k = 0; k < column.size(); ++k) {
    if (!is_finite(column[k])) continue;
    if (!good.empty()) steps.push_back(static_cast<double>(k - good.back()));
    good.push_back(k);
  }
  const double longest = (std::max)(5.0, 3.0 * median(steps));
  std::size_t found = 0;
  for (std::size_t i = 1; i < good.size(); ++i) {
    const std::size_t from = good[i - 1], to = good[i];
    const double rows = static_cast<double>(to - from);
    if (to == from + 1 || rows > longest) continue;
    for (std::size_t k = from + 1; k < to; ++k, ++found)
      column[k] = column[from] + (column[to] - column[from]) * static_cast<double>(k - from) / rows;
  }
  return found;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<PreparedLog, Error<double>> prepare(const Log& log) {
  using E = Error<double>;
  const std::size_t count = log.y.size();
  const auto size = [](std::size_t n) { return static_cast<double>(n); };
  if (log.u.size() != count)
    return E{"u", size(log.u.size()), "must have as many rows as y:", -1, size(count), true};
  if (!log.time.empty() && log.time.size() != count) {
    return E{"time", size(log.time.size()), "must have as many rows as y, or none:",
             -1,     size(count),           true};
  }
  for (std::size_t c = 0; c < log.columns.size(); ++c) {
    if (log.columns[c].size() != count) {
      return E{"columns",
               size(log.columns[c].size()),
               "must have as many rows as y:",
               static_cast<int>(c),
               size(count),
               true};
    }
  }
  Rules<double> rules;
  if (log.time.empty()) rules.positive("sample_time", log.sample_time);
  rules.not_negative("jitter", log.jitter);
  if (!rules) return rules.error();
  PreparedLog prepared;
  LogReport& report = prepared.report;
  report.rows = count;
  std::vector<std::vector<double>> bridged = log.columns;
  for (auto& column : bridged) report.lost.push_back(detail::bridge(column));
  std::vector<std::size_t> good;
  for (std::size_t k = 0; k < count; ++k) {
    bool finite =
        is_finite(log.u[k]) && is_finite(log.y[k]) && (log.time.empty() || is_finite(log.time[k]));
    for (const auto& column : bridged) finite = finite && is_finite(column[k]);
    if (finite) good.push_back(k);
  }
  report.rejected = count - good.size();
  if (good.size() < 200)
    return E{"rows", size(good.size()), "are usable, which is too few: record at least", -1, 200.0,
             true};
  // The first time is subtracted, so that stamps since 1970 lose no digits.
  std::vector<double> time, u, y;
  std::vector<std::vector<double>> columns(log.columns.size());
  for (const std::size_t k : good) {
    time.push_back(log.time.empty() ? size(k) * log.sample_time : log.time[k] - log.time[good[0]]);
    u.push_back(log.u[k]);
    y.push_back(log.y[k]);
    for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(bridged[c][k]);
  }
  // What was held, of rows without y, too.
  std::vector<double> held_time, held_u;
  for (std::size_t i = 0; i < good.size(); ++i) {
    held_time.push_back(time[i]);
    held_u.push_back(u[i]);
    for (std::size_t k = good[i] + 1; i + 1 < good.size() && k < good[i + 1]; ++k) {
      const double at =
          log.time.empty() ? size(k) * log.sample_time : log.time[k] - log.time[good[0]];
      if (!is_finite(log.u[k]) || !(at > held_time.back() && at < time[i + 1])) continue;
      held_time.push_back(at);
      held_u.push_back(log.u[k]);
    }
  }
  std::vector<double> steps;
  for (std::size_t k = 1; k < time.size(); ++k) {
    if (!(time[k] > time[k - 1])) {
      return E{"time", time[k], "does not rise", static_cast<int>(good[k])};
    }
    steps.push_back(time[k] - time[k - 1]);
  }
  // Within these limits all squares and powers of T are finite.
  const auto size_fits = [&](const char* field, const std::vector<double>& values, int index = -1) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double largest = (std::max)(-*low, *high);
    rules.demand(largest <= 1e60, field, largest, "is too large: use another unit", index)
        .demand(!(*high > *low) || *high - *low >= 1e-60, field, *high - *low,
                "is the range of its values, which is too small: use another unit", index);
  };
  size_fits("u", held_u);
  size_fits("y", y);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    size_fits("columns", columns[c], static_cast<int>(c));
  }
  if (!rules) return rules.error();
  const double middle = detail::median(steps);
  double sum = 0.0, square = 0.0, regular = 0.0;
  for (const double step : steps) {
    if (step < 1.6 * middle) sum += step, regular += 1.0;
  }
  const double T = log.time.empty() ? log.sample_time : sum / regular;
  rules.demand(T >= 1e-12 && T <= 1e12, "sample_time", T, "must be between 1e-12 s and 1e12 s");
  if (!rules) return rules.error();
  for (const double step : steps) {
    if (step < 1.6 * middle) square += (step - T) * (step - T);
  }
  report.sample_time = T;
  report.jitter = log.time.empty() ? log.jitter : std::sqrt(square / regular);
  report.duration = time.back();
  report.outliers = detail::mend_outliers(y);
  const auto [least, largest] = std::minmax_element(u.begin(), u.end());
  const double reach = 1e-6 * (*largest - *least);
  std::size_t ends = 0;
  for (const double value : u) {
    if (value <= *least + reach || value >= *largest - reach) ++ends;
  }
  report.saturated = size(ends) / size(u.size());
  report.quantisation = detail::quantisation_step(y);

  FitData& data = prepared.data;
  data.sample_time = T;
  data.starts.clear();
  data.columns.resize(columns.size());
  constexpr double longest_bridge = 5.5;  // rows
  bool as_logged = held_u.size() == u.size();
  std::size_t from = 0, held_at = 0;
  while (from < time.size()) {
    std::size_t to = from + 1;
    while (to < time.size() && time[to] - time[to - 1] < longest_bridge * T) ++to;
    const std::size_t rows = to - from;
    bool uniform = report.jitter < 0.02 * T && held_u.size() == u.size();
    for (std::size_t k = from + 1; k < to; ++k)
      uniform = uniform && time[k] - time[k - 1] < 1.6 * T;
    if (rows >= 50) {
      data.starts.push_back(data.y.size());
      data.start_times.push_back(time[from]);
      if (uniform) {
        data.u.insert(data.u.end(), u.begin() + static_cast<std::ptrdiff_t>(from),
                      u.begin() + static_cast<std::ptrdiff_t>(to));
        data.y.insert(data.y.end(), y.begin() + static_cast<std::ptrdiff_t>(from),
                      y.begin() + static_cast<std::ptrdiff_t>(to));
        data.measured.insert(data.measured.end(), y.begin() + static_cast<std::ptrdiff_t>(from),
                             y.begin() + static_cast<std::ptrdiff_t>(to));
        data.offsets.resize(data.y.size(), 0.0);
        for (std::size_t c = 0; c < columns.size(); ++c) {
          data.columns[c].insert(data.columns[c].end(),
                                 columns[c].begin() + static_cast<std::ptrdiff_t>(from),
                                 columns[c].begin() + static_cast<std::ptrdiff_t>(to));
        }
      } else {
        as_logged = false;
        std::size_t k = from;
        const auto grid = static_cast<std::size_t>(std::lround((time[to - 1] - time[from]) / T));
        report.missing += grid + 1 > rows ? grid + 1 - rows : 0;
        for (std::size_t g = 0; g < grid; ++g) {
          const double t = time[from] + size(g) * T;
          while (k + 2 < to && time[k + 1] <= t) ++k;
          const double share = std::clamp((t - time[k]) / (time[k + 1] - time[k]), 0.0, 1.0);
          data.y.push_back(y[k] + share * (y[k + 1] - y[k]));
          data.measured.push_back(std::numeric_limits<double>::quiet_NaN());
          data.offsets.push_back(0.0);
          for (std::size_t c = 0; c < columns.size(); ++c) {
            data.columns[c].push_back(columns[c][k] + share * (columns[c][k + 1] - columns[c][k]));
          }
          double held = 0.0, at = t;
          while (held_at + 1 < held_u.size() && held_time[held_at + 1] <= t) ++held_at;
          for (std::size_t j = held_at; at < t + T; ++j) {
            const double end = j + 1 < held_u.size() ? (std::min)(held_time[j + 1], t + T) : t + T;
            held += held_u[j] * (std::max)(end - at, 0.0);
            at = (std::max)(end, at);
          }
          data.u.push_back(held / T);
        }
        // Each measurement to the nearest row, or the next if that has one.
        for (std::size_t g = 0, i = from; i < to; ++i) {
          const double rows_on = (time[i] - time[from]) / T;
          const auto row = (std::max)(g, static_cast<std::size_t>(std::lround(rows_on)));
          const double late = rows_on - size(row);
          if (row >= grid || late < -0.75) continue;
          data.measured[data.starts.back() + row] = y[i];
          data.offsets[data.starts.back() + row] = late * T;
          g = row + 1;
        }
      }
    }
    if (to < time.size()) {
      const double rows_between = (std::round)((time[to] - time[to - 1]) / T) - 1.0;
      report.missing += static_cast<std::size_t>((std::min)(rows_between, 1e15));
    }
    from = to;
  }
  if (as_logged) data.measured = data.offsets = {};
  report.pieces = data.starts.size();
  data.one_load = data.unknown_before = true;
  if (data.y.size() < 200)
    return E{"rows",
             size(data.y.size()),
             "between gaps are too few: record without gaps at least",
             -1,
             200.0,
             true};
  return prepared;
}

ESOKIT_FUNCTION FitData excerpt(const FitData& data, std::size_t most) {
  if (data.y.size() <= most) return data;
  constexpr std::size_t stretches = 20;
  const std::size_t length = std::max<std::size_t>(most / stretches, 50);
  FitData out;
  out.sample_time = data.sample_time;
  out.averaged = data.averaged;
  out.unknown_before = data.unknown_before;
  out.starts.clear();
  out.columns.resize(data.columns.size());
  std::size_t piece = 0;
  for (std::size_t s = 0; s < stretches; ++s) {
    const std::size_t from = data.y.size() / stretches * s;
    while (piece + 1 < data.starts.size() && data.starts[piece + 1] <= from) ++piece;
    const auto start = [&](std::size_t of, std::size_t row) {
      out.starts.push_back(out.y.size());
      const double time = data.start_times.size() == data.starts.size()
                              ? data.start_times[of]
                              : data.sample_time * static_cast<double>(data.starts[of]);
      out.start_times.push_back(time +
                                data.sample_time * static_cast<double>(row - data.starts[of]));
    };
    start(piece, from);
    std::size_t next = piece + 1;
    for (std::size_t k = from; k < (std::min)(from + length, data.y.size()); ++k) {
      if (next < data.starts.size() && data.starts[next] == k) {
        if (k > from) start(next, k);
        ++next;
      }
      out.u.push_back(data.u[k]);
      out.y.push_back(data.y[k]);
      if (!data.measured.empty()) {
        out.measured.push_back(data.measured[k]);
        out.offsets.push_back(data.offsets[k]);
      }
      for (std::size_t c = 0; c < data.columns.size(); ++c) {
        out.columns[c].push_back(data.columns[c][k]);
      }
    }
  }
  return out;
}

ESOKIT_FUNCTION FitData averaged(const FitData& data, int fold) {
  if (fold <= 1) return data;
  FitData out;
  out.sample_time = data.sample_time * fold;
  out.averaged = data.averaged * fold;
  out.one_load = data.one_load;
  out.unknown_before = data.unknown_before;
  out.starts.clear();
  out.columns.resize(data.columns.size());
  const auto by = static_cast<std::size_t>(fold);
  for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
    const std::size_t to = piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.y.size();
    out.starts.push_back(out.y.size());
    if (data.start_times.size() == data.starts.size()) {
      out.start_times.push_back(data.start_times[piece] + 0.5 * (fold - 1) * data.sample_time);
    }
    for (std::size_t k = data.starts[piece]; k + by <= to; k += by) {
      const auto mean = [&](const std::vector<double>& values) {
        double sum = 0.0;
        for (std::size_t i = 0; i < by; ++i) sum += values[k + i];
        return sum / fold;
      };
      out.u.push_back(mean(data.u));
      out.y.push_back(mean(data.y));
      for (std::size_t c = 0; c < data.columns.size(); ++c)
        out.columns[c].push_back(mean(data.columns[c]));
    }
  }
  return out;
}

}  // namespace esokit
