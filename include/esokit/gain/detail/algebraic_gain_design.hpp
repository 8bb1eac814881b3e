/// @file
/// The design of AlgebraicEso in make: how long the estimates are blanked, and the schedule.
#pragma once

#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/gain/algebraic_gain.hpp>

namespace esokit::detail {

/// Ratio of the variance of the highest estimate after `count` samples to the tolerated one: (sigma
/// / tolerated)^2 F / (count (count T)^(2N-2)), F = (2N-1)! (2N-2)! / ((N-1)!)^2 = (2N-1)
/// prod_{i=1..N-1} (N-1+i)^2. Multiplied in this order, it overflows or underflows only if the
/// comparison with 1 is clear anyway.
template <int Size, Scalar S, class Config>
S noise_ratio(const Config& config, const S& count) {
  constexpr int last = Size - 1;
  const S level = config.measurement_noise / config.disturbance_noise;
  const S rate = S(1.0) / (count * config.sample_time);
  S ratio = level * level / count;
  for (int i = last; i > 0; --i) {
    const S factor = integer<S>(last + i) * rate;
    ratio = ratio * factor * factor;
  }
  return ratio * integer<S>(2 * last + 1);
}

/// The smallest number of samples from `low` to 1e6 for which enough(count) is true, or an error.
/// Needs no logarithm or root, so that it works for every scalar.
template <Scalar S, class Enough>
Expected<std::uint32_t, Error<S>> smallest_count(const char* field, const S& value,
                                                 std::uint32_t low, const Enough& enough) {
  std::uint32_t high = 1000000;
  if (!enough(integer<S>(high))) {
    return Error<S>{field, value, "gives a blanking of more than 1e6 samples"};
  }
  while (low < high) {
    const std::uint32_t middle = (low + high) / 2;
    if (enough(integer<S>(middle))) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return high;
}

/// Number of samples for which the estimates are blanked after a start.
template <int Size, Scalar S, class Config>
Expected<std::uint32_t, Error<S>> blanking_samples(const Config& config) {
  Rules<S> rules;
  rules.not_negative("measurement_noise", config.measurement_noise)
      .not_negative("disturbance_noise", config.disturbance_noise);
  const bool noise = all(config.measurement_noise > S(0.0));
  rules.demand(noise == all(config.disturbance_noise > S(0.0)),
               noise ? "disturbance_noise" : "measurement_noise", S(0.0),
               "must be given together with the other noise level");
  if (config.blanking) rules.not_negative("blanking", *config.blanking);
  if (!rules) return rules.error();
  if (config.blanking) {
    // A blanking that is 20.0001 samples because of rounding counts as 20.
    const S samples = *config.blanking / config.sample_time - S(1e-3);
    return smallest_count<S>("blanking", *config.blanking, 0u,
                             [&](const S& count) { return all(count >= samples); });
  }
  if (noise) {
    return smallest_count<S>(
        "measurement_noise", config.measurement_noise, std::uint32_t{Size - 1},
        [&](const S& count) { return all(S(1.0) >= noise_ratio<Size, S>(config, count)); });
  }
  return std::uint32_t{Size - 1};
}

/// The law for a config of AlgebraicEso; it cannot settle before the blanking has ended.
template <int Size, Scalar S, class Config>
Expected<AlgebraicGain<Size, S>, Error<S>> design_algebraic_gain(const Config& config) {
  using Law = AlgebraicGain<Size, S>;
  const S& bandwidth = config.observer_bandwidth;
  const S& shift = config.frequency_shift;
  constexpr const char* not_held = "times sample_time gives a gain that the scalar cannot hold";
  Rules<S> rules;
  rules.not_negative("observer_bandwidth", bandwidth)
      .not_negative("frequency_shift", shift)
      .demand(all(bandwidth > S(0.0)) || !all(shift > S(0.0)) || config.allow_vanishing_gain,
              "observer_bandwidth", bandwidth,
              "must be above zero if frequency_shift is: the gains vanish (or set "
              "allow_vanishing_gain)")
      .demand(0 <= config.start_index && config.start_index <= 1000000, "start_index",
              integer<S>(config.start_index), "must be 0 .. 1000000");
  if (!rules) return rules.error();
  const auto blanking = blanking_samples<Size, S>(config);
  if (!blanking) return blanking.error();
  if (all(bandwidth > S(0.0))) {
    const auto settled = current_gain<Size, S>(
        EqualSampledPoles<Size, S>::from_bandwidth(bandwidth, config.sample_time).weights());
    rules.representable("observer_bandwidth", bandwidth, settled.back(), not_held);
  }
  const Expected<Law, Error<S>> law(Law(bandwidth, shift, config.sample_time,
                                        static_cast<std::uint32_t>(config.start_index), *blanking));
  for (const S& gain : law->gain(S(0.0))) {
    rules.representable("frequency_shift", shift, gain, not_held);
  }
  if (!rules) return rules.error();
  return law;
}

}  // namespace esokit::detail
