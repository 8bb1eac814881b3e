#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/analysis/disturbance_alarm.hpp>
#include <esokit/analysis/loop_response.hpp>
#include <numbers>

namespace esokit {

namespace detail {

/// How often, per sample, a Gaussian sequence enters |x| >= a on one of both sides.
/// @param a in standard deviations @param angle arccos of the correlation from sample to sample
inline double entries_per_sample(double a, double angle) {
  // exp(-a^2 / (1 + cos x)) = exp(-a^2 / 2) exp(-(a tan(x / 2))^2 / 2): nothing is left beyond 9.
  const double end = a > 0.0 ? (std::min)(angle, 2.0 * std::atan(9.0 / a)) : angle;
  constexpr int steps = 256;  // Simpson's rule
  double sum = 0.0;
  for (int i = 0; i <= steps; ++i) {
    const double t = a * std::tan(0.5 * end * i / steps);
    sum += (i == 0 || i == steps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * std::exp(-0.5 * t * t);
  }
  return std::exp(-0.5 * a * a) * sum * end / (3 * steps) / std::numbers::pi;
}

/// The noise of one row of the estimates.
inline Expected<DhatNoise, Error<double>> noise_of_row(const Loop& loop, int row,
                                                       const LoopNoise& of) {
  const auto input = input_covariance(loop, of);
  if (!input) return input.error();
  const DynamicSystem& all = loop.system();
  const int at = 2 * loop.channels() + row;
  const int n = all.a.rows();
  const int inputs = all.b.cols();
  // Two outputs: dhat[k], and dhat[k + 1] - dhat[k] without the noise of k + 1. From the difference
  // a slow dhat keeps the digits that its correlation, nearly one, would lose.
  DynamicSystem two{all.a, all.b, DynamicMatrix<double>(2, n), DynamicMatrix<double>(2, inputs),
                    all.sample_time};
  double fresh = 0.0;
  for (int j = 0; j < n; ++j) {
    two.c(0, j) = all.c(at, j);
    for (int i = 0; i < n; ++i) two.c(1, j) += all.c(at, i) * all.a(i, j);
  }
  for (int j = 0; j < inputs; ++j) {
    two.d(0, j) = all.d(at, j);
    two.d(1, j) = -all.d(at, j);
    for (int i = 0; i < n; ++i) two.d(1, j) += all.c(at, i) * all.b(i, j);
    fresh += all.d(at, j) * (*input)(j, j) * all.d(at, j);
  }
  const auto covariance = output_covariance(two, *input);
  if (!covariance) return covariance.error();
  return DhatNoise{std::sqrt((std::max)((*covariance)(0, 0), 0.0)),
                   std::sqrt((std::max)((*covariance)(1, 1), 0.0) + fresh)};
}

/// The threshold in standard deviations: by bisection, as the rate only falls.
inline double threshold_of_rate(double per_sample, double angle) {
  double low = 0.0;
  double high = 40.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (entries_per_sample(middle, angle) > per_sample ? low : high) = middle;
  }
  return high;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<DhatNoise, Error<double>> dhat_noise(const std::vector<double>& dhat) {
  const auto count = static_cast<double>(dhat.size());
  Rules<double> rules;
  rules.demand(count >= 100.0, "dhat", count, "must be at least 100 values");
  double mean = 0.0;
  for (std::size_t k = 0; k < dhat.size(); ++k) {
    rules.finite("dhat", dhat[k], static_cast<int>(k));
    mean += dhat[k] / count;
  }
  if (!rules) return rules.error();
  double variance = 0.0;
  double change = 0.0;
  for (std::size_t k = 0; k < dhat.size(); ++k) {
    variance += (dhat[k] - mean) * (dhat[k] - mean) / (count - 1.0);
    if (k > 0) change += (dhat[k] - dhat[k - 1]) * (dhat[k] - dhat[k - 1]) / (count - 1.0);
  }
  rules.demand(change > 0.0, "dhat", mean, "must change: a constant one has no noise")
      .finite("dhat", variance)
      .finite("dhat", change);
  if (!rules) return rules.error();
  return DhatNoise{std::sqrt(variance), std::sqrt(change)};
}

ESOKIT_FUNCTION Expected<DisturbanceAlarm, Error<double>> disturbance_alarm(
    const Loop& loop, int row, const DisturbanceAlarmConfig& config) {
  const double T = loop.sample_time();
  Rules<double> rules;
  rules
      .demand(T > 0.0, "sample_time", T,
              "must be that of a sampled loop: an alarm looks at samples")
      .demand(0 <= row && row < loop.system().c.rows() - 2 * loop.channels(), "row", row,
              "must be one of the estimates that the loop has")
      .demand(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
              "must be negative: a loop that is not stable has no steady state")
      .positive("false_alarms_per_hour", config.false_alarms_per_hour)
      .finite("load", config.load);
  if (!rules) return rules.error();
  const auto found = config.measured ? Expected<DhatNoise, Error<double>>(*config.measured)
                                     : detail::noise_of_row(loop, row, config.noise);
  if (!found) return found.error();
  DisturbanceAlarm alarm{.noise = *found};
  const auto& [deviation, change] = alarm.noise;
  rules.positive("deviation", deviation)
      .positive("change", change)
      .demand(change <= 2.0 * deviation * (1.0 + 1e-9), "change", change,
              "must not be above twice the deviation: no signal of that deviation changes so much");
  if (!rules) return rules.error();
  const double angle = 2.0 * std::asin((std::min)(change / (2.0 * deviation), 1.0));
  const double most = detail::entries_per_sample(0.0, angle) / T * 3600.0;
  rules.demand(config.false_alarms_per_hour < most,
               {"false_alarms_per_hour", config.false_alarms_per_hour,
                "must be below those of a threshold of zero, which are", -1, most, true});
  if (!rules) return rules.error();
  const double per_sample = config.false_alarms_per_hour * T / 3600.0;
  alarm.threshold = deviation * detail::threshold_of_rate(per_sample, angle);
  // 99 of 100: one sample is beyond the threshold with this probability.
  const double surely = alarm.threshold + 2.3263478740408408 * deviation;
  // Until the slowest pole has left 1e-13.
  const double samples = std::clamp(std::ceil(-30.0 / loop.stability_abscissa()), 10.0, 1e6);
  const auto response = load_response(loop, {.duration = samples * T, .channel = config.channel});
  if (!response) return response.error();
  double peak = 0.0;
  const auto& dhat = response->estimates[static_cast<std::size_t>(row)];
  for (std::size_t k = 0; k < dhat.size(); ++k) {
    const double unit = std::abs(dhat[k]);
    peak = (std::max)(peak, unit);
    const double now = unit * std::abs(config.load);
    if (now >= alarm.threshold && !is_finite(alarm.delay)) alarm.delay = response->time[k];
    if (now >= surely && !is_finite(alarm.latest)) alarm.latest = response->time[k];
  }
  if (peak > 0.0) alarm.least_load = surely / peak;
  return alarm;
}

}  // namespace esokit
