/// @file
/// The effect of measurement noise and a noisy disturbance on a loop at rest.
#pragma once

#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <vector>

namespace esokit {

/// White noise on a loop, one standard deviation for each channel; missing entries are zero. For
/// continuous loops the root of the two-sided spectral density, unit times root of s.
struct LoopNoise {
  std::vector<double> measurement{};  ///< of y, independent in each sample
  std::vector<double> disturbance{};  ///< of d, independent in each sample and held until the next
};

namespace detail {

/// The covariance of (r, v, d) of a loop at rest, or what is wrong with the noise or the loop.
Expected<DynamicMatrix<double>, Error<double>> input_covariance(const Loop& loop,
                                                                const LoopNoise& of);

}  // namespace detail

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
Expected<LoopDeviations, Error<double>> noise(const Loop& loop, const LoopNoise& of);

/// The same for the loop of a plant and a controller, see `closed_loop`.
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<LoopDeviations, Error<double>> noise(const LinearPlant<States, S, Inputs, Outputs>& plant,
                                              const Controller& controller, const LoopNoise& of) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return noise(*loop, of);
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/loop_noise.ipp>
#endif
