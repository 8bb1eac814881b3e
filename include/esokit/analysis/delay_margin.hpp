/// @file
/// How much additional delay a loop tolerates.
#pragma once

#include <esokit/analysis/margins.hpp>
#include <esokit/core/detail/compiled.hpp>

namespace esokit {

namespace detail {

/// The phase lag that turns L to -1, in [0, 2 pi).
double lag_to_minus_one(std::complex<double> l);

}  // namespace detail

/// Smallest additional delay (s) of one u at which the loop oscillates, on top of the dead time of
/// the plant. It need not be a whole number of samples. In a sampled loop a fraction of a sample is
/// not just a phase shift e^(-i omega tau), so the plant is sampled with that delay.
/// @param channel 0 .. q - 1
/// @return infinity if there is no limit; error for a loop that is not stable, or no such channel
Expected<Margin, Error<double>> delay_margin(const Loop& loop, int channel = 0);

/// The same for the loop of a plant and a controller, see `closed_loop`.
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
Expected<Margin, Error<double>> delay_margin(const LinearPlant<States, S, Inputs, Outputs>& plant,
                                             const Controller& controller, int channel = 0) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return delay_margin(*loop, channel);
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/delay_margin.ipp>
#endif
