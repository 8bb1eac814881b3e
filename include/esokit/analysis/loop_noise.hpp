/// @file
/// The effect of measurement noise and a noisy disturbance on a loop at rest.
#pragma once

#include <cmath>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/loop.hpp>
#include <vector>

namespace esokit {

/// White noise on a loop, one standard deviation for each channel; missing entries are zero. For
/// continuous loops the root of the two-sided spectral density, unit times root of s.
struct LoopNoise {
  std::vector<double> measurement{};  ///< of y, independent in each sample
  std::vector<double> disturbance{};  ///< of d, independent in each sample and held until the next
};

/// Standard deviations of the signals of a loop, one entry per channel (for estimates one per row,
/// channel after channel).
struct LoopDeviations {
  std::vector<double> output;     ///< y, without the noise on its measurement
  std::vector<double> control;    ///< u
  std::vector<double> estimates;  ///< (yhat, .., dhat, ..), if the controller gives them
};

/// The exact standard deviations in the steady state.
/// @return error for a negative noise, more entries than channels, a loop that is not stable, or a
///         u that continuous white noise reaches directly
inline Expected<LoopDeviations, Error<double>> noise(const Loop& loop, const LoopNoise& of) {
  const DynamicSystem& system = loop.system();
  const int q = loop.channels();
  const int inputs = system.b.cols();
  const int outputs = system.c.rows();
  DynamicMatrix<double> input(inputs, inputs);
  Rules<double> rules;
  const auto take = [&](const char* field, const std::vector<double>& deviations, int first,
                        int most) {
    const int count = static_cast<int>(deviations.size());
    rules.demand(count <= most, {field, static_cast<double>(count), "must have at most", -1,
                                 static_cast<double>(most), true});
    for (int i = 0; i < count && i < most; ++i) {
      const double deviation = deviations[static_cast<std::size_t>(i)];
      rules.not_negative(field, deviation, i);
      input(first + i, first + i) = deviation * deviation;
    }
  };
  take("measurement", of.measurement, q, q);
  take("disturbance", of.disturbance, 2 * q, inputs - 2 * q);
  rules.demand(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
               "must be negative: a loop that is not stable has no steady state");
  if (!rules) return rules.error();
  const auto covariance = output_covariance(system, input);
  if (!covariance) return covariance.error();
  LoopDeviations deviations;
  for (int i = 0; i < outputs; ++i) {
    auto& list = i < q ? deviations.output : i < 2 * q ? deviations.control : deviations.estimates;
    list.push_back(std::sqrt((std::max)((*covariance)(i, i), 0.0)));
  }
  return deviations;
}

/// The same for the loop of a plant and a controller, see `closed_loop`.
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<LoopDeviations, Error<double>> noise(const LinearPlant<States, S, Inputs, Outputs>& plant,
                                              const Controller& controller, const LoopNoise& of) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return noise(*loop, of);
}

}  // namespace esokit
