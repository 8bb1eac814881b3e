/// @file
/// Standard errors of a fitted model, by a jackknife over stretches of the log.
///
/// If the machine has more than the model, the innovations are not white and formal intervals are
/// several times too short. So the log is cut into stretches and the fit is repeated without each
/// of them (one Gauss-Newton step, all parameters together): any difference between the stretches,
/// whatever its cause, widens the interval.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/fit.hpp>
#include <vector>

namespace esokit {

/// Standard errors of a fit.
struct FitErrors {
  double bandwidth = 0.0;        ///< rad/s; 0 if w was given
  double latency = 0.0;          ///< s
  double lag = 0.0;              ///< s
  double dead_time = 0.0;        ///< s
  double pole = 0.0;             ///< 1/s
  double noise = 0.0;            ///< unit of y
  std::vector<double> linear{};  ///< b0 and the columns
};

/// Student's t for a two-sided 95 % interval (Cornish-Fisher expansion from the normal). @param
/// freedom degrees of freedom
[[nodiscard]] inline double student_95(int freedom) {
  const double z = 1.959963985;
  const double n = freedom;
  return z + (z * z * z + z) / (4.0 * n) +
         (5.0 * std::pow(z, 5) + 16.0 * z * z * z + 3.0 * z) / (96.0 * n * n);
}

/// Standard errors of the fit that `fit` returned last, by leaving out one of `stretches` equal
/// stretches at a time.
[[nodiscard]] inline FitErrors jackknife(InnovationsFit& fit, const Fit& at, bool with_bandwidth,
                                         int stretches = 20) {
  const auto sensitivities = fit.sensitivities(at, with_bandwidth);
  const auto& jacobian = sensitivities.columns;
  const auto& residual = fit.residual();
  const std::size_t count = jacobian.size();
  const std::size_t free = sensitivities.free.size();
  const std::size_t rows = residual.size();
  std::vector<std::vector<double>> normals(static_cast<std::size_t>(stretches));
  std::vector<std::vector<double>> rights(static_cast<std::size_t>(stretches));
  std::vector<double> squares(static_cast<std::size_t>(stretches));
  std::vector<double> normal(count * count, 0.0), right(count, 0.0);
  double square = 0.0;
  for (std::size_t s = 0; s < normals.size(); ++s) {
    const std::size_t from = rows * s / normals.size(), to = rows * (s + 1) / normals.size();
    InnovationsFit::normal_equations(jacobian, residual, normals[s], rights[s], from, to);
    for (std::size_t k = from; k < to; ++k) squares[s] += residual[k] * residual[k];
    for (std::size_t i = 0; i < normal.size(); ++i) normal[i] += normals[s][i];
    for (std::size_t i = 0; i < right.size(); ++i) right[i] += rights[s][i];
    square += squares[s];
  }
  // The results without each stretch: w, latency, lag, dead time, pole, noise, linear.
  const std::size_t quantities = 6 + at.linear.size();
  std::vector<std::vector<double>> values;
  for (std::size_t s = 0; s < normals.size(); ++s) {
    std::vector<double> without = normal, step = right;
    for (std::size_t i = 0; i < without.size(); ++i) without[i] -= normals[s][i];
    for (std::size_t i = 0; i < step.size(); ++i) step[i] -= rights[s][i];
    detail::solve_normal(without, step, static_cast<int>(count));
    double log_w = 0.0, log_latency = 0.0;
    double share_square = at.at.lag_share * at.at.lag_share;
    double product = at.at.pole * at.at.latency;
    for (std::size_t i = 0; i < free; ++i) {
      const double by = std::clamp(-step[i], -0.7, 0.7);
      switch (sensitivities.free[i]) {
        case 0:
          log_w = by;
          break;
        case 1:
          log_latency = by;
          break;
        case 2:
          share_square += by;
          break;
        default:
          product += by;
      }
    }
    const double latency = at.at.latency * std::exp(log_latency);
    const double share = std::sqrt(std::clamp(share_square, 0.0, 1.0));
    std::vector<double> value = {
        at.at.bandwidth * std::exp(log_w),
        latency,
        latency * share,
        latency * (1.0 - share),
        product / latency,
        at.noise * std::sqrt((1.0 - squares[s] / square) * static_cast<double>(stretches) /
                             static_cast<double>(stretches - 1))};
    for (std::size_t i = 0; i < at.linear.size(); ++i)
      value.push_back(at.linear[i] - step[free + i]);
    values.push_back(std::move(value));
  }
  const double n = static_cast<double>(stretches);
  std::vector<double> errors(quantities);
  for (std::size_t q = 0; q < quantities; ++q) {
    double mean = 0.0, sum = 0.0;
    for (const auto& value : values) mean += value[q] / n;
    for (const auto& value : values) sum += (value[q] - mean) * (value[q] - mean);
    errors[q] = std::sqrt(sum * (n - 1.0) / n);
  }
  return {errors[0],
          errors[1],
          errors[2],
          errors[3],
          errors[4],
          errors[5],
          {errors.begin() + 6, errors.end()}};
}

}  // namespace esokit
