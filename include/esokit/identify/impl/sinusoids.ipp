#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <esokit/identify/spectrum.hpp>
#include <numbers>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// Ratio of the effect of a continuous sine to that of its column: a column acts by the mean of two
/// rows, held between them, through `order` integrations.
inline double sine_scale(const FitData& data, int order, double frequency) {
  const double half = 0.5 * frequency * data.sample_time;
  const double ratio = std::tan(half) / half;
  if (order == 1) return ratio;
  if (order == 2) return ratio * ratio;
  const double over = std::sin(half) / half;
  return 3.0 * over * over * over / (std::cos(half) * (2.0 + std::cos(2.0 * half)));
}

ESOKIT_FUNCTION void add_sine(FitData& data, int order, double frequency) {
  std::vector<double> cosine(data.y.size()), sine(data.y.size());
  const double scale = sine_scale(data, order, frequency);
  each_time(data, [&](std::size_t k, double time) {
    cosine[k] = scale * std::cos(frequency * time);
    sine[k] = scale * std::sin(frequency * time);
  });
  data.columns.push_back(std::move(cosine));
  data.columns.push_back(std::move(sine));
}

ESOKIT_FUNCTION Line highest_line(const FitData& data, const std::vector<double>& e) {
  constexpr double most = 4194304.0;
  const double T = data.sample_time;
  double from = 0.0, to = 0.0;
  each_time(data, [&](std::size_t, double time) {
    from = (std::min)(from, time);
    to = (std::max)(to, time);
  });
  const double rows = (to - from) / T + 1.0;
  if (!(rows < most)) return {};
  std::size_t length = 2;
  while (static_cast<double>(length) < 2.0 * rows)
    length *= 2;  // so that no line falls between two bins
  std::vector<std::complex<double>> x(length);
  each_time(data, [&](std::size_t k, double time) {
    x[static_cast<std::size_t>(std::lround((time - from) / T))] = e[k];
  });
  transform(x);
  const std::size_t half = length / 2;
  std::vector<double> sums(half + 1, 0.0);
  for (std::size_t j = 0; j < half; ++j) sums[j + 1] = sums[j] + std::norm(x[j]);
  // Lines with fewer than four periods in the log are left out, because drift causes them, too.
  const auto first = static_cast<std::size_t>(std::ceil(4.0 * static_cast<double>(length) / rows));
  // A ringing mode is also high next to its peak, so only a narrow neighbourhood is compared.
  constexpr std::size_t wide = 48, own = 8;
  Line highest;
  // Up to the frequency at which the mean of two rows still represents a sine.
  for (std::size_t j = first; 10 * j < 8 * half; ++j) {
    const std::size_t low = j > wide ? j - wide : 1, high = (std::min)(j + wide, half);
    const std::size_t inner_low = (std::max)(low, j > own ? j - own : 1);
    const std::size_t inner_high = (std::min)(high, j + own);
    const double count = static_cast<double>((high - low) - (inner_high - inner_low));
    if (count < 20.0) continue;
    const double beside = (sums[high] - sums[low]) - (sums[inner_high] - sums[inner_low]);
    const double height = std::norm(x[j]) * count / beside;
    if (height > highest.height) {
      const double part = static_cast<double>(j) / static_cast<double>(half);
      highest = {std::numbers::pi * part / T, height};
    }
  }
  return highest;
}

/// Amplitude at a frequency.
inline double amplitude_of(const FitData& data, const std::vector<double>& values,
                           double frequency) {
  double mean = 0.0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  std::complex<double> sum = 0.0;
  each_time(data, [&](std::size_t k, double time) {
    sum += (values[k] - mean) * std::polar(1.0, -frequency * time);
  });
  return 2.0 * (std::abs)(sum) / static_cast<double>(values.size());
}

ESOKIT_FUNCTION FittedSine fit_sine(const FitData& data, const FitModel& model,
                                    const FitBounds& bounds, const FitPoint& point,
                                    double frequency) {
  InnovationsFit without(data, model, bounds);
  const Fit before = without.at(point);
  const std::size_t c = 1 + data.inputs.size() + data.columns.size();
  FittedSine found;
  double wide = 0.0;
  each_time(data, [&](std::size_t, double time) { wide = (std::max)(wide, (std::abs)(time)); });
  for (int pass = 0; pass < 5; ++pass) {
    FitData with = data;
    add_sine(with, model.order, frequency);
    InnovationsFit fit(with, model, bounds);
    const Fit swinging = fit.at(point);
    const double a = swinging.linear[c], b = swinging.linear[c + 1];
    // The effect of a frequency error: the derivative of a cos + b sin.
    std::vector<double> slope(data.y.size());
    const double scale = sine_scale(data, model.order, frequency);
    each_time(data, [&](std::size_t k, double time) {
      slope[k] = scale * time * (b * std::cos(frequency * time) - a * std::sin(frequency * time));
    });
    with.columns.push_back(std::move(slope));
    InnovationsFit tuned(with, model, bounds);
    const Fit last = tuned.at(point);
    const double change = std::clamp(last.linear[c + 2], -1.0 / wide, 1.0 / wide);
    found.gain = static_cast<double>(before.rows) * std::log(before.mean_square / last.mean_square);
    const bool settled = (std::abs)(change) < 1e-4 / wide;
    if (settled || pass == 4) {
      const FitErrors errors = jackknife(tuned, last, false);
      const double amplitude = std::hypot(a, b);
      found.sine.amplitude = {
          amplitude, std::hypot(a * errors.linear[c], b * errors.linear[c + 1]) / amplitude};
      found.sine.frequency = {frequency + change, errors.linear[c + 2]};
      break;
    }
    frequency += change;
  }
  return found;
}

ESOKIT_FUNCTION std::vector<double> find_sines(FitData data, const FitModel& model,
                                               const FitBounds& bounds, const FitPoint& point,
                                               int most) {
  std::vector<double> frequencies;
  while (static_cast<int>(frequencies.size()) < most) {
    InnovationsFit fit(data, model, bounds);
    const Fit found = fit.at(point);
    const Line line = highest_line(data, fit.residual());
    const double rows = static_cast<double>(found.rows);
    // The largest of this many powers of white noise is about log(rows) times their mean.
    if (!(line.height > 2.0 * std::log(rows))) break;
    const FittedSine swing = fit_sine(data, model, bounds, point, line.frequency);
    const double frequency = swing.sine.frequency.value;
    const double driven = (std::abs)(found.input_gain()) * amplitude_of(data, data.u, frequency);
    const Estimate& amplitude = swing.sine.amplitude;
    if (!(swing.gain > 5.0 * std::log(rows)) ||
        !(amplitude.value > (std::max)(0.2 * driven, 3.0 * amplitude.half_width)))
      break;
    frequencies.push_back(frequency);
    add_sine(data, model.order, frequency);
  }
  return frequencies;
}

}  // namespace detail
}  // namespace esokit
