/// @file
/// Response of a loop to a step of the reference or of a load.
#pragma once

#include <esokit/analysis/loop.hpp>
#include <esokit/core/detail/compiled.hpp>
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

/// Response to a step of a reference, without its derivatives.
/// @return error for an invalid channel or duration
Expected<LoopResponse, Error<double>> reference_response(const Loop& loop, const LoopStep& step);

/// Response to a step of the disturbance d of the plant, which enters through E. Errors as for
/// reference_response.
Expected<LoopResponse, Error<double>> load_response(const Loop& loop, const LoopStep& step);

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

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/loop_response.ipp>
#endif
