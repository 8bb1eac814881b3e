#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <numbers>
#include <utility>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION double student_95(int freedom) {
  const double z = 1.959963985;
  const double n = freedom;
  return z + (z * z * z + z) / (4.0 * n) +
         (5.0 * std::pow(z, 5) + 16.0 * z * z * z + 3.0 * z) / (96.0 * n * n);
}

ESOKIT_FUNCTION std::pair<double, double> split_errors(const FitPoint& at,
                                                       const SplitCovariance& covariance, double t,
                                                       double longest) {
  // The squared lag is between zero and the squared latency, so a larger error says nothing more.
  longest = (std::max)(longest, at.latency);
  const double square = (std::min)(longest * longest, t * std::sqrt(covariance.lag_square));
  const double along = t * std::sqrt(covariance.latency);
  const double correlation =
      covariance.both / std::sqrt(covariance.latency * covariance.lag_square);
  const double shared = is_finite(correlation) ? std::clamp(correlation, -1.0, 1.0) : 0.0;
  const double alone = std::sqrt(1.0 - shared * shared);
  double lag = 0.0, dead_time = 0.0;
  constexpr int directions = 64;
  for (int i = 0; i < directions; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / directions;
    const double latency =
        (std::max)(at.latency + along * (shared * std::cos(angle) + alone * std::sin(angle)), 0.0);
    const double tau = (std::min)(
        std::sqrt((std::max)(at.lag() * at.lag() + square * std::cos(angle), 0.0)), latency);
    lag = (std::max)(lag, (std::abs)(tau - at.lag()));
    dead_time = (std::max)(dead_time, (std::abs)(latency - tau - at.dead_time()));
  }
  return {lag / t, dead_time / t};
}

namespace detail {

/// Normal equations and squares of the stretches of a log, and their sums.
struct StretchSums {
  std::vector<std::vector<double>> normals, rights;
  std::vector<double> squares, normal, right;
  double square = 0.0;

  StretchSums(const std::vector<std::vector<double>>& jacobian, const std::vector<double>& residual,
              std::size_t stretches)
      : normals(stretches),
        rights(stretches),
        squares(stretches),
        normal(jacobian.size() * jacobian.size(), 0.0),
        right(jacobian.size(), 0.0) {
    const std::size_t rows = residual.size();
    for (std::size_t s = 0; s < stretches; ++s) {
      const std::size_t from = rows * s / stretches, to = rows * (s + 1) / stretches;
      InnovationsFit::normal_equations(jacobian, residual, normals[s], rights[s], from, to);
      for (std::size_t k = from; k < to; ++k) squares[s] += residual[k] * residual[k];
      for (std::size_t i = 0; i < normal.size(); ++i) normal[i] += normals[s][i];
      for (std::size_t i = 0; i < right.size(); ++i) right[i] += rights[s][i];
      square += squares[s];
    }
  }

  /// The Gauss-Newton step from all rows but those of stretch s.
  [[nodiscard]] std::vector<double> step_without(std::size_t s) const {
    std::vector<double> without = normal, step = right;
    for (std::size_t i = 0; i < without.size(); ++i) without[i] -= normals[s][i];
    for (std::size_t i = 0; i < step.size(); ++i) step[i] -= rights[s][i];
    solve_normal(without, step, static_cast<int>(right.size()));
    return step;
  }
};

/// w, latency, squared lag and pole after a step. @param free numbers of what the step moves
inline std::vector<double> point_after(const FitPoint& at, const std::vector<int>& free,
                                       const std::vector<double>& step) {
  double log_w = 0.0, log_latency = 0.0;
  double share_square = at.lag_share * at.lag_share;
  double product = at.pole * at.latency;
  for (std::size_t i = 0; i < free.size(); ++i) {
    const double by = std::clamp(-step[i], -0.7, 0.7);
    switch (free[i]) {
      case 0:
        log_w = by;
        break;
      case 1:
        log_latency = by;
        break;
      case 2:
        // Not limited: at a limit all stretches would agree.
        share_square -= step[i];
        break;
      default:
        product += by;
    }
  }
  const double latency = at.latency * std::exp(log_latency);
  return {at.bandwidth * std::exp(log_w), latency, latency * latency * share_square,
          product / latency};
}

}  // namespace detail

ESOKIT_FUNCTION FitErrors jackknife(InnovationsFit& fit, const Fit& at, bool with_bandwidth,
                                    int stretches) {
  const auto sensitivities = fit.sensitivities(at, with_bandwidth, true);
  const auto& jacobian = sensitivities.columns;
  const auto& residual = fit.residual();
  const std::size_t count = jacobian.size();
  const std::size_t free = sensitivities.free.size();
  const detail::StretchSums sums(jacobian, residual, static_cast<std::size_t>(stretches));
  // The results without each stretch: w, latency, squared lag, pole, noise, linear, times.
  const std::size_t linear = free + at.linear.size();  // behind them
  const std::size_t quantities = 5 + count - free;
  const auto& timed = fit.data().timed;
  const auto each_time = [&](const auto& use) {
    std::size_t next = linear;
    for (const TimedColumn& column : timed) {
      if (column.free) use(column, next), next += 2;
    }
  };
  std::vector<std::vector<double>> values;
  for (std::size_t s = 0; s < sums.squares.size(); ++s) {
    const std::vector<double> step = sums.step_without(s);
    std::vector<double> value = detail::point_after(at.at, sensitivities.free, step);
    value.push_back(at.noise *
                    std::sqrt((1.0 - sums.squares[s] / sums.square) *
                              static_cast<double>(stretches) / static_cast<double>(stretches - 1)));
    for (std::size_t i = 0; i < at.linear.size(); ++i)
      value.push_back(at.linear[i] - step[free + i]);
    each_time([&](const TimedColumn& column, std::size_t i) {
      value.push_back(column.latency - step[i]);
      value.push_back(column.lag_square - step[i + 1]);
    });
    values.push_back(std::move(value));
  }
  const double n = static_cast<double>(stretches);
  std::vector<double> means(quantities);
  for (const auto& value : values) {
    for (std::size_t q = 0; q < quantities; ++q) means[q] += value[q] / n;
  }
  const auto covariance = [&](std::size_t p, std::size_t q) {
    double sum = 0.0;
    for (const auto& value : values) sum += (value[p] - means[p]) * (value[q] - means[q]);
    return sum * (n - 1.0) / n;
  };
  const auto error = [&](std::size_t q) { return std::sqrt(covariance(q, q)); };
  const auto [lag, dead_time] = split_errors(
      at.at, {covariance(1, 1), covariance(2, 2), covariance(1, 2)}, student_95(stretches - 1));
  FitErrors errors{error(0), error(1), lag, dead_time, error(3), error(4), {}, {}};
  for (std::size_t q = 5; q < 5 + at.linear.size(); ++q) errors.linear.push_back(error(q));
  errors.times.resize(timed.size());
  if (linear == count) return errors;
  std::vector<double> right = sums.right;
  detail::solve_normal(sums.normal, right, static_cast<int>(count));
  each_time([&](const TimedColumn& column, std::size_t i) {
    const std::size_t q = 5 + i - free;
    FitErrors::Times& found = errors.times[static_cast<std::size_t>(&column - timed.data())];
    found.latency = (std::max)(column.latency - right[i], 0.0);
    found.lag =
        (std::min)(std::sqrt((std::max)(column.lag_square - right[i + 1], 0.0)), found.latency);
    found.covariance = {covariance(q, q), covariance(q + 1, q + 1), covariance(q, q + 1)};
  });
  return errors;
}

}  // namespace esokit
