/// @file
/// Response of a loop to a step of the reference or of a load.
#pragma once

#include <esokit/analysis/loop.hpp>
#include <vector>

namespace esokit {

/// The step and the duration of the response.
struct LoopStep {
  double duration = 0.0;     ///< s; the last sample is at or before it
  int channel = 0;           ///< of r, or of d
  double height = 1.0;       ///< in the unit of r, or of d
  double sample_time = 0.0;  ///< s, for a continuous loop; leave out for a sampled one
};

/// A response at the sample times, from rest at zero; the step is at t = 0.
struct LoopResponse {
  std::vector<double> time;                    ///< s
  std::vector<std::vector<double>> output;     ///< y of each channel
  std::vector<std::vector<double>> control;    ///< u of each channel
  std::vector<std::vector<double>> estimates;  ///< each estimate that the controller gives
};

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

/// Response to a step of a reference, without its derivatives.
/// @return error for an invalid channel or duration
inline Expected<LoopResponse, Error<double>> reference_response(const Loop& loop,
                                                                const LoopStep& step) {
  return detail::respond(loop, step, step.channel, loop.channels());
}

/// Response to a step of the disturbance d of the plant, which enters through E. Errors as for
/// reference_response.
inline Expected<LoopResponse, Error<double>> load_response(const Loop& loop, const LoopStep& step) {
  const int before = 2 * loop.channels();
  return detail::respond(loop, step, before + step.channel, loop.system().b.cols() - before);
}

/// The same for the loop of a plant and a controller, see `closed_loop`. @{
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<LoopResponse, Error<double>> reference_response(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const Controller& controller,
    const LoopStep& step) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return reference_response(*loop, step);
}
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<LoopResponse, Error<double>> load_response(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const Controller& controller,
    const LoopStep& step) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return load_response(*loop, step);
}
/// @}

}  // namespace esokit
