#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/error.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/model/measured_input.hpp>
#include <span>
#include <utility>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION MeasuredInput<double> MeasuredEffect::held(double sample_time,
                                                           double input_latency) const {
  const double less = 0.5 * sample_time + input_latency;
  return {gain.value, (std::max)(lag.value - (std::max)(less - dead_time.value, 0.0), 0.0),
          (std::max)(dead_time.value - less, 0.0)};
}

namespace detail {

ESOKIT_FUNCTION double share_left(const std::vector<double>& values,
                                  const std::vector<double>& of) {
  const std::size_t count = values.size(), ranges = std::min<std::size_t>(200, count / 10);
  std::vector<std::size_t> order(count);
  for (std::size_t k = 0; k < count; ++k) order[k] = k;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return of[a] != of[b] ? of[a] < of[b] : a < b; });
  double mean = 0.0, all = 0.0, left = 0.0;
  for (const double value : values) mean += value / static_cast<double>(count);
  for (std::size_t range = 0; range < ranges; ++range) {
    const std::size_t from = count * range / ranges, to = count * (range + 1) / ranges;
    // A straight line, as a function has a slope.
    double x0 = 0.0, y0 = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    const double rows = static_cast<double>(to - from);
    for (std::size_t i = from; i < to; ++i)
      x0 += of[order[i]] / rows, y0 += values[order[i]] / rows;
    for (std::size_t i = from; i < to; ++i) {
      const double x = of[order[i]] - x0, y = values[order[i]] - y0;
      xx += x * x, xy += x * y, yy += y * y;
      all += (values[order[i]] - mean) * (values[order[i]] - mean);
    }
    left += (std::max)(yy - (xx > 0.0 ? xy * xy / xx : 0.0), 0.0);
  }
  return all > 0.0 ? left / all : 0.0;
}

/// Share of the squares of `values` that no straight line over `of` explains.
inline double share_beside(const std::vector<double>& values, const std::vector<double>& of) {
  const double rows = static_cast<double>(values.size());
  double x0 = 0.0, y0 = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  for (std::size_t k = 0; k < values.size(); ++k) x0 += of[k] / rows, y0 += values[k] / rows;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double x = of[k] - x0, y = values[k] - y0;
    xx += x * x, xy += x * y, yy += y * y;
  }
  return yy > 0.0 && xx > 0.0 ? (std::max)(1.0 - xy * xy / (xx * yy), 0.0) : 1.0;
}

ESOKIT_FUNCTION Check<double> tells_itself(const FitData& data, std::size_t c) {
  const auto& column = data.columns[c];
  const auto at = [&](double value, const char* rule, double limit = 0.0, bool limited = false) {
    return Error<double>{"columns", value, rule, static_cast<int>(c), limit, limited};
  };
  const auto [low, high] = std::minmax_element(column.begin(), column.end());
  Rules<double> rules;
  rules.demand(*high > *low, at(*low, "never changes, so it shows nothing: leave it out"));
  rules.demand(share_beside(column, data.u) > follows,
               at(share_beside(column, data.u),
                  "is the share of its squares that does not follow u, so the two cannot be "
                  "distinguished: move it by itself, or leave it out; must be above",
                  follows, true));
  for (std::size_t other = 0; other < c; ++other) {
    rules.demand(share_beside(column, data.columns[other]) > 1e-3 * follows,
                 at(static_cast<double>(other),
                    "is the column that it follows, so the two cannot be distinguished: leave one "
                    "out"));
  }
  return rules;
}

ESOKIT_FUNCTION void make_timed(FitData& data, std::size_t count) {
  data.timed.resize(count);
  for (std::size_t c = 0; c < count; ++c) {
    data.timed[c].measured = data.columns[c];
    data.timed[c].free = share_left(data.columns[c], data.y) > follows;
  }
}

ESOKIT_FUNCTION void take_times(FitData& data, const std::vector<TimedColumn>& from) {
  for (std::size_t c = 0; c < from.size(); ++c) {
    data.timed[c] = from[c];
    data.columns[c] = late(from[c], data.starts, data.sample_time);
  }
}

ESOKIT_FUNCTION std::pair<double, double> time_step(std::vector<double> normal,
                                                    std::vector<double> right, double damping,
                                                    TimeSplit split, double along, double off) {
  const std::size_t all = right.size(), m = all - 2, s = all - 1;
  if (split != TimeSplit::both) {
    for (std::size_t i = 0; i < all; ++i) right[i] -= off * normal[i * all + s];
    for (std::size_t i = 0; i < all; ++i) normal[i * all + m] += along * normal[i * all + s];
    for (std::size_t i = 0; i < all; ++i) normal[m * all + i] += along * normal[s * all + i];
    right[m] += along * right[s];
    for (std::size_t i = 0; i < all; ++i) normal[i * all + s] = normal[s * all + i] = 0.0;
    right[s] = 0.0;
  }
  for (const std::size_t i : {m, s}) normal[i * all + i] *= 1.0 + damping;
  solve_normal(std::move(normal), right, static_cast<int>(all));
  if (split == TimeSplit::both) return {right[m], right[s]};
  return {right[m], off + along * right[m]};
}

/// The search for the times of one column, at one point of the model.
class TimeSearch {
 public:
  TimeSearch(FitData& data, const FitModel& model, const FitBounds& bounds, const FitPoint& at,
             std::size_t number)
      : data_(data),
        bounds_(bounds),
        at_(at),
        number_(number),
        column_(data.timed[number]),
        fit_(data, model, bounds),
        rows_(fit_.at(at).rows),
        own_(2 + data.inputs.size() + number),
        parts_(fit_.parts()),
        least_(square(linear_)) {}

  /// Tries times over the whole range.
  void look_around() {
    const double T = data_.sample_time;
    for (const double rows : {1.0, 2.5, 6.0, 15.0, 40.0, 100.0}) {
      if (rows * T > bounds_.latency_max) break;
      for (const double share : {0.0, 0.7, 1.0})
        (void)attempt(rows * T, std::pow(share * rows * T, 2));
    }
  }

  /// Goes down by steps of Gauss and Newton, damped.
  void descend() {
    double damping = 1e-3;
    for (int step = 0; step < 8; ++step) {
      std::vector<std::vector<double>> jacobian(parts_.begin() + 1, parts_.end());
      for (auto& moves : fit_.time_sensitivities(at_, number_, linear_[own_ - 1]))
        jacobian.push_back(std::move(moves));
      std::vector<double> residual = parts_[0];
      for (std::size_t i = 0; i < linear_.size(); ++i) {
        for (std::size_t k = 0; k < residual.size(); ++k)
          residual[k] += linear_[i] * parts_[i + 1][k];
      }
      std::vector<double> normal, right;
      InnovationsFit::normal_equations(jacobian, residual, normal, right);
      const double before = least_;
      bool better = false;
      const double latency = column_.latency, lag_square = column_.lag_square;
      while (!better && damping < 1e4) {
        // Both times, or one of them where the other is at zero.
        for (const TimeSplit split : {TimeSplit::both, TimeSplit::lag, TimeSplit::dead_time}) {
          const double along = split == TimeSplit::lag ? 2.0 * latency : 0.0;
          const double off = split == TimeSplit::lag    ? lag_square - latency * latency
                             : split == TimeSplit::both ? 0.0
                                                        : lag_square;
          const auto [by, square_by] = time_step(normal, right, damping, split, along, off);
          if (attempt(latency - by, lag_square - square_by)) better = true;
          if (split == TimeSplit::both && better && column_.lag_square > 0.0 &&
              column_.lag_square < column_.latency * column_.latency)
            break;
        }
        damping *= better ? 0.2 : 8.0;
      }
      if (!better || !(before - least_ > 1e-6 * least_)) break;
    }
  }

  /// The best of so many times makes something of nothing: without the column the likelihood has to
  /// be lower by more than the three numbers cost.
  void drop_if_chance() {
    std::fill(parts_[own_].begin(), parts_[own_].end(), 0.0);
    const double rows = static_cast<double>(rows_);
    column_.free = rows * std::log(square(linear_) / least_) > 3.0 * std::log(rows);
    if (!column_.free) column_.latency = column_.lag_square = 0.0;
  }

 private:
  /// Mean square with this column. @param linear receives the numbers of all
  double square(std::vector<double>& linear) {
    std::vector<double> normal;
    InnovationsFit::normal_equations(std::span(parts_).subspan(1), parts_[0], normal, linear);
    const std::vector<double> right = linear;
    for (double& value : linear) value = -value;
    solve_normal(normal, linear, static_cast<int>(linear.size()));
    double sum = dot(parts_[0].data(), parts_[0].data(), parts_[0].size());
    for (std::size_t i = 0; i < linear.size(); ++i) sum += linear[i] * right[i];
    return sum;
  }

  /// Takes these times if they are better. @return whether they are
  bool attempt(double latency, double lag_square) {
    TimedColumn trial = column_;
    trial.latency = std::clamp(latency, 0.0, bounds_.latency_max);
    trial.lag_square = std::clamp(lag_square, 0.0, trial.latency * trial.latency);
    std::vector<double> kept = parts_[own_], numbers;
    parts_[own_] = fit_.column_innovations(at_, late(trial, data_.starts, data_.sample_time));
    const double left = square(numbers);
    if (!(left < least_)) {
      parts_[own_] = std::move(kept);
      return false;
    }
    least_ = left;
    linear_ = std::move(numbers);
    column_.latency = trial.latency;
    column_.lag_square = trial.lag_square;
    return true;
  }

  FitData& data_;
  const FitBounds& bounds_;
  const FitPoint& at_;
  std::size_t number_;
  TimedColumn& column_;
  InnovationsFit fit_;
  std::size_t rows_;
  std::size_t own_;  ///< of the column among the parts
  std::vector<std::vector<double>> parts_;
  std::vector<double> linear_{};
  double least_;
};

ESOKIT_FUNCTION void find_times(FitData& data, const FitModel& model, const FitBounds& bounds,
                                const FitPoint& at, bool search) {
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t c = 0; c < data.timed.size(); ++c) {
      if (!data.timed[c].free) continue;
      TimeSearch times(data, model, bounds, at, c);
      if (search && pass == 0) times.look_around();
      times.descend();
      if (search) times.drop_if_chance();
      data.columns[c] = late(data.timed[c], data.starts, data.sample_time);
    }
    if (data.timed.size() < 2) break;
  }
}

}  // namespace detail
}  // namespace esokit
