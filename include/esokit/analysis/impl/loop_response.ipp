#pragma once

#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/loop_response.hpp>
#include <vector>

namespace esokit {

namespace detail {

/// @param input column of the loop's system
inline Expected<LoopResponse, Error<double>> respond(const Loop& loop, const LoopStep& step,
                                                     int input, int inputs) {
  const DynamicSystem& system = loop.system();
  const bool sampled = loop.sample_time() > 0.0;
  Rules<double> rules;
  rules
      .demand(0 <= step.channel && step.channel < inputs, "channel", step.channel,
              "must be one that the loop has")
      .positive("duration", step.duration)
      .finite("height", step.height);
  if (sampled) {
    rules.left_out("sample_time", step.sample_time, "must be left out: the loop has one");
  } else {
    rules.positive("sample_time", step.sample_time);
  }
  if (!rules) return rules.error();
  const double T = sampled ? loop.sample_time() : step.sample_time;
  rules.demand(step.duration / T < 1e7, "duration", step.duration, "must be below 1e7 samples");
  if (!rules) return rules.error();
  const int n = system.a.rows();
  DynamicMatrix<double> b(n, 1);
  for (int i = 0; i < n; ++i) b(i, 0) = system.b(i, input);
  HeldFor held{system.a, b};
  if (!sampled) held = held_for(system.a, b, T);
  const int q = loop.channels();
  const int outputs = system.c.rows();
  LoopResponse response;
  response.output.resize(static_cast<std::size_t>(q));
  response.control.resize(static_cast<std::size_t>(q));
  response.estimates.resize(static_cast<std::size_t>(outputs - 2 * q));
  const auto record = [&](int row) -> std::vector<double>& {
    if (row < q) return response.output[static_cast<std::size_t>(row)];
    if (row < 2 * q) return response.control[static_cast<std::size_t>(row - q)];
    return response.estimates[static_cast<std::size_t>(row - 2 * q)];
  };
  std::vector<double> x(static_cast<std::size_t>(n));
  std::vector<double> rate(static_cast<std::size_t>(n));
  const auto samples = static_cast<long>(step.duration / T * (1.0 + 1e-12));
  for (long k = 0; k <= samples; ++k) {
    response.time.push_back(static_cast<double>(k) * T);
    bool finite = true;  // also what a finite state gives may be too large
    for (int row = 0; row < outputs; ++row) {
      double sum = system.d(row, input) * step.height;
      for (int i = 0; i < n; ++i) sum += system.c(row, i) * x[static_cast<std::size_t>(i)];
      finite = finite && is_finite(sum);
      record(row).push_back(sum);
    }
    for (int i = 0; i < n; ++i) {
      double sum = held.input(i, 0) * step.height;
      for (int j = 0; j < n; ++j) sum += held.increment(i, j) * x[static_cast<std::size_t>(j)];
      rate[static_cast<std::size_t>(i)] = sum;
    }
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += rate[i];
    rules.demand(finite && is_finite(sum_of_magnitudes(x.data(), n)), "duration", step.duration,
                 "gives a response that the scalar cannot hold: the loop is not stable");
    if (!rules) return rules.error();
  }
  return response;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<LoopResponse, Error<double>> reference_response(const Loop& loop,
                                                                         const LoopStep& step) {
  return detail::respond(loop, step, step.channel, loop.channels());
}

ESOKIT_FUNCTION Expected<LoopResponse, Error<double>> load_response(const Loop& loop,
                                                                    const LoopStep& step) {
  const int before = 2 * loop.channels();
  return detail::respond(loop, step, before + step.channel, loop.system().b.cols() - before);
}

}  // namespace esokit
