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

/// As a number of an error.
inline double number(std::size_t n) { return static_cast<double>(n); }

/// Whether all columns have as many rows as y, and there is a sample time.
inline Check<double> check_lengths(const Log& log) {
  using E = Error<double>;
  const std::size_t count = log.y.size();
  if (log.u.size() != count)
    return E{"u", number(log.u.size()), "must have as many rows as y:", -1, number(count), true};
  if (!log.time.empty() && log.time.size() != count) {
    return E{"time", number(log.time.size()), "must have as many rows as y, or none:",
             -1,     number(count),           true};
  }
  for (std::size_t c = 0; c < log.columns.size(); ++c) {
    if (log.columns[c].size() != count) {
      return E{"columns",
               number(log.columns[c].size()),
               "must have as many rows as y:",
               static_cast<int>(c),
               number(count),
               true};
    }
  }
  Rules<double> rules;
  if (log.time.empty()) rules.positive("sample_time", log.sample_time);
  return rules.not_negative("jitter", log.jitter);
}

/// The rows of a log in which all is finite.
struct ValidRows {
  std::vector<std::size_t> at{};  ///< index in the log
  std::vector<double> time{}, u{}, y{};
  std::vector<std::vector<double>> columns{};

  /// What was held, of rows without y, too.
  std::vector<double> held_time{}, held_u{};

  [[nodiscard]] bool holds_more() const { return held_u.size() != u.size(); }
};

inline Expected<ValidRows, Error<double>> valid_rows(const Log& log, LogReport& report) {
  const std::size_t count = log.y.size();
  report.rows = count;
  std::vector<std::vector<double>> bridged = log.columns;
  for (auto& column : bridged) report.lost.push_back(bridge(column));
  ValidRows rows;
  for (std::size_t k = 0; k < count; ++k) {
    bool finite =
        is_finite(log.u[k]) && is_finite(log.y[k]) && (log.time.empty() || is_finite(log.time[k]));
    for (const auto& column : bridged) finite = finite && is_finite(column[k]);
    if (finite) rows.at.push_back(k);
  }
  report.rejected = count - rows.at.size();
  if (rows.at.size() < 200) {
    return Error<double>{
        "rows", number(rows.at.size()), "are usable, which is too few: record at least", -1, 200.0,
        true};
  }
  // The first time is subtracted, so that stamps since 1970 lose no digits.
  const auto time_of = [&](std::size_t k) {
    return log.time.empty() ? number(k) * log.sample_time : log.time[k] - log.time[rows.at[0]];
  };
  rows.columns.resize(log.columns.size());
  for (const std::size_t k : rows.at) {
    rows.time.push_back(time_of(k));
    rows.u.push_back(log.u[k]);
    rows.y.push_back(log.y[k]);
    for (std::size_t c = 0; c < rows.columns.size(); ++c) rows.columns[c].push_back(bridged[c][k]);
  }
  for (std::size_t i = 0; i < rows.at.size(); ++i) {
    rows.held_time.push_back(rows.time[i]);
    rows.held_u.push_back(rows.u[i]);
    for (std::size_t k = rows.at[i] + 1; i + 1 < rows.at.size() && k < rows.at[i + 1]; ++k) {
      const double at = time_of(k);
      if (!is_finite(log.u[k]) || !(at > rows.held_time.back() && at < rows.time[i + 1])) continue;
      rows.held_time.push_back(at);
      rows.held_u.push_back(log.u[k]);
    }
  }
  return rows;
}

/// Within these limits all squares and powers of T are finite.
inline Check<double> check_sizes(const ValidRows& rows) {
  Rules<double> rules;
  const auto size_fits = [&](const char* field, const std::vector<double>& values, int index = -1) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double largest = (std::max)(-*low, *high);
    rules.demand(largest <= 1e60, field, largest, "is too large: use another unit", index)
        .demand(!(*high > *low) || *high - *low >= 1e-60, field, *high - *low,
                "is the range of its values, which is too small: use another unit", index);
  };
  size_fits("u", rows.held_u);
  size_fits("y", rows.y);
  for (std::size_t c = 0; c < rows.columns.size(); ++c)
    size_fits("columns", rows.columns[c], static_cast<int>(c));
  return rules;
}

/// The row after the last one of the piece that begins at `from`.
inline std::size_t piece_end(const std::vector<double>& time, std::size_t from, double T) {
  std::size_t to = from + 1;
  while (to < time.size() && time[to] - time[to - 1] < longest_bridge * T) ++to;
  return to;
}

/// A sample time that bridges the gaps of rows that come in bursts, which no piece of `T` holds:
/// the shortest with nine tenths of the rows in pieces. `T` itself if most rows are in pieces, or
/// there is none up to 5 T: across longer gaps nothing is seen of a machine for which T was chosen.
/// So, too, where u is another one behind half of the gaps: what it was in them is not known.
inline double bridging_time(const std::vector<double>& time, const std::vector<double>& u,
                            double T) {
  const auto share_in_pieces = [&](double step) {
    std::size_t rows = 0;
    for (std::size_t from = 0, to = 0; from < time.size(); from = to) {
      to = piece_end(time, from, step);
      if (to - from >= shortest_piece) rows += to - from;
    }
    return number(rows) / number(time.size());
  };
  if (share_in_pieces(T) >= 0.5) return T;
  std::vector<double> gaps;
  std::size_t moved = 0;
  for (std::size_t k = 1; k < time.size(); ++k) {
    const double step = time[k] - time[k - 1];
    if (step < longest_bridge * T) continue;
    gaps.push_back(step);
    moved += u[k] != u[k - 1] ? 1U : 0U;
  }
  if (2 * moved >= gaps.size()) return T;
  std::sort(gaps.begin(), gaps.end());
  for (const double part : {0.5, 0.75, 0.9, 0.95, 0.98, 0.99}) {
    // A quarter, so that a gap may be a third longer than this one.
    const double step = 0.25 * gaps[static_cast<std::size_t>(part * number(gaps.size() - 1))];
    if (share_in_pieces(step) >= 0.9) return step <= 5.0 * T ? step : T;
  }
  return T;
}

/// Sample time, jitter and duration from the steps of time, which must rise.
inline Check<double> find_sample_time(const Log& log, const ValidRows& rows, LogReport& report) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < rows.time.size(); ++k) {
    if (!(rows.time[k] > rows.time[k - 1]))
      return Error<double>{"time", rows.time[k], "does not rise", static_cast<int>(rows.at[k])};
    steps.push_back(rows.time[k] - rows.time[k - 1]);
  }
  if (auto fits = check_sizes(rows); !fits) return fits;
  const double middle = median(steps);
  double sum = 0.0, square = 0.0, regular = 0.0;
  for (const double step : steps) {
    if (step < 1.6 * middle) sum += step, regular += 1.0;
  }
  const double usual = log.time.empty() ? log.sample_time : sum / regular;
  if (!(usual >= 1e-12 && usual <= 1e12))
    return Error<double>{"sample_time", usual, "must be between 1e-12 s and 1e12 s"};
  for (const double step : steps) {
    if (step < 1.6 * middle) square += (step - usual) * (step - usual);
  }
  report.sample_time = bridging_time(rows.time, rows.u, usual);
  report.burst = report.sample_time > usual ? usual : 0.0;
  report.jitter = log.time.empty() ? log.jitter : std::sqrt(square / regular);
  report.duration = rows.time.back();
  return {};
}

/// Share of rows with u at its largest or smallest value.
inline double share_at_ends(const std::vector<double>& u) {
  const auto [least, largest] = std::minmax_element(u.begin(), u.end());
  const double reach = 1e-6 * (*largest - *least);
  std::size_t ends = 0;
  for (const double value : u) {
    if (value <= *least + reach || value >= *largest - reach) ++ends;
  }
  return number(ends) / number(u.size());
}

/// Lays valid rows onto a grid of one sample time, piece by piece between long gaps.
class Gridded {
 public:
  Gridded(const ValidRows& rows, LogReport& report, FitData& data)
      : rows_(rows), report_(report), data_(data), as_logged_(!rows.holds_more()) {
    data_.sample_time = report.sample_time;
    data_.starts.clear();
    data_.columns.resize(rows.columns.size());
  }

  void all_pieces() {
    const double T = data_.sample_time;
    const std::vector<double>& time = rows_.time;
    std::size_t from = 0;
    while (from < time.size()) {
      const std::size_t to = piece_end(time, from, T);
      if (to - from >= shortest_piece) piece(from, to);
      if (to < time.size()) {
        const double rows_between = (std::round)((time[to] - time[to - 1]) / T) - 1.0;
        report_.missing += static_cast<std::size_t>((std::min)(rows_between, 1e15));
      }
      from = to;
    }
    if (as_logged_) data_.measured = data_.offsets = {};
    report_.pieces = data_.starts.size();
    data_.one_load = data_.unknown_before = true;
  }

 private:
  void piece(std::size_t from, std::size_t to) {
    data_.starts.push_back(data_.y.size());
    data_.start_times.push_back(rows_.time[from]);
    bool uniform =
        report_.jitter < 0.02 * data_.sample_time && !rows_.holds_more() && !(report_.burst > 0.0);
    for (std::size_t k = from + 1; k < to; ++k)
      uniform = uniform && rows_.time[k] - rows_.time[k - 1] < 1.6 * data_.sample_time;
    if (uniform) {
      take(from, to);
    } else {
      as_logged_ = false;
      resample(from, to);
    }
  }

  /// Rows as they are.
  void take(std::size_t from, std::size_t to) {
    const auto append = [&](std::vector<double>& all, const std::vector<double>& more) {
      all.insert(all.end(), more.begin() + static_cast<std::ptrdiff_t>(from),
                 more.begin() + static_cast<std::ptrdiff_t>(to));
    };
    append(data_.u, rows_.u);
    append(data_.y, rows_.y);
    append(data_.measured, rows_.y);
    data_.offsets.resize(data_.y.size(), 0.0);
    for (std::size_t c = 0; c < data_.columns.size(); ++c)
      append(data_.columns[c], rows_.columns[c]);
  }

  /// y and columns on straight lines between their rows, and u as the mean of what was held.
  void resample(std::size_t from, std::size_t to) {
    const double T = data_.sample_time;
    const std::vector<double>& time = rows_.time;
    const auto grid = static_cast<std::size_t>(std::lround((time[to - 1] - time[from]) / T));
    report_.missing += grid + 1 > to - from ? grid + 1 - (to - from) : 0;
    std::size_t k = from;
    for (std::size_t g = 0; g < grid; ++g) {
      const double t = time[from] + number(g) * T;
      while (k + 2 < to && time[k + 1] <= t) ++k;
      const double share = std::clamp((t - time[k]) / (time[k + 1] - time[k]), 0.0, 1.0);
      const auto between = [&](const std::vector<double>& of) {
        return of[k] + share * (of[k + 1] - of[k]);
      };
      data_.y.push_back(between(rows_.y));
      data_.measured.push_back(std::numeric_limits<double>::quiet_NaN());
      data_.offsets.push_back(0.0);
      for (std::size_t c = 0; c < data_.columns.size(); ++c)
        data_.columns[c].push_back(between(rows_.columns[c]));
      data_.u.push_back(mean_input(t));
    }
    // Each measurement to the nearest row, or the next if that has one.
    for (std::size_t g = 0, i = from; i < to; ++i) {
      const double rows_on = (time[i] - time[from]) / T;
      const auto row = (std::max)(g, static_cast<std::size_t>(std::lround(rows_on)));
      const double late = rows_on - number(row);
      if (row >= grid || late < -0.75) continue;
      data_.measured[data_.starts.back() + row] = rows_.y[i];
      data_.offsets[data_.starts.back() + row] = late * T;
      g = row + 1;
    }
  }

  /// Of what was held from t to t + T; t rises from call to call.
  double mean_input(double t) {
    const double T = data_.sample_time;
    const std::vector<double>& since = rows_.held_time;
    double held = 0.0, at = t;
    while (held_at_ + 1 < since.size() && since[held_at_ + 1] <= t) ++held_at_;
    for (std::size_t j = held_at_; at < t + T; ++j) {
      const double end = j + 1 < since.size() ? (std::min)(since[j + 1], t + T) : t + T;
      held += rows_.held_u[j] * (std::max)(end - at, 0.0);
      at = (std::max)(end, at);
    }
    return held / T;
  }

  const ValidRows& rows_;
  LogReport& report_;
  FitData& data_;
  bool as_logged_;
  std::size_t held_at_ = 0;
};

}  // namespace detail

ESOKIT_FUNCTION Expected<PreparedLog, Error<double>> prepare(const Log& log) {
  if (auto ok = detail::check_lengths(log); !ok) return ok.error();
  PreparedLog prepared;
  LogReport& report = prepared.report;
  auto rows = detail::valid_rows(log, report);
  if (!rows) return rows.error();
  if (auto ok = detail::find_sample_time(log, *rows, report); !ok) return ok.error();
  report.outliers = detail::mend_outliers(rows->y);
  report.saturated = detail::share_at_ends(rows->u);
  report.quantisation = detail::quantisation_step(rows->y);
  FitData& data = prepared.data;
  detail::Gridded(*rows, report, data).all_pieces();
  if (data.y.size() < 200) {
    return Error<double>{"rows",
                         detail::number(data.y.size()),
                         "between gaps are too few: record without gaps at least",
                         -1,
                         200.0,
                         true};
  }
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
