/// @file
/// A contact, a collision, a jam: from which dhat on it is one, and how late that is seen.
#pragma once

#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <limits>
#include <optional>
#include <vector>

namespace esokit {

/// How dhat moves while nothing happens, about its mean.
struct DhatNoise {
  double deviation = 0.0;  ///< standard deviation of dhat, in its unit
  double change = 0.0;     ///< of its change from one sample to the next, the same unit
};

/// From a record of dhat while nothing happens: for noise that is not white (a filtered sensor, the
/// counts of an encoder, friction).
/// @param dhat every sample, in order, at least 100; no gaps
/// @return error for a shorter record, a value that is not finite, or a dhat that never changes
Expected<DhatNoise, Error<double>> dhat_noise(const std::vector<double>& dhat);

/// Settings of `disturbance_alarm`.
struct DisturbanceAlarmConfig {
  double false_alarms_per_hour = 1.0;   ///< from noise alone, on both sides together
  double load = 0.0;                    ///< the step of d to find, in its unit; either sign
  int channel = 0;                      ///< of that d
  LoopNoise noise{};                    ///< white and Gaussian
  std::optional<DhatNoise> measured{};  ///< instead of `noise`; see `dhat_noise`
};

/// When dhat is an alarm, and how soon.
struct DisturbanceAlarm {
  /// Alarm if dhat is this far from what it is without the load, or further; unit of dhat.
  double threshold = 0.0;
  DhatNoise noise{};  ///< of dhat

  /// The smallest step of d that is found in at least 99 of 100 cases, in its unit.
  double least_load = std::numeric_limits<double>::infinity();
  /// From the sample at which the load begins to that of the alarm, without noise, s. With
  /// noise at least half of the alarms come no later. Infinity: a load too small.
  double delay = std::numeric_limits<double>::infinity();
  /// In at least 99 of 100 cases the alarm is not later, s. Infinity: a load too small.
  double latest = std::numeric_limits<double>::infinity();
};

/// The alarm for one row of the estimates of a loop.
///
/// A false alarm is a sample at which dhat is beyond the threshold on a side on which it was not at
/// the sample before. For Gaussian noise the mean number of them is exact, for any correlation
///
///     rate = 1 / (pi T) integral of exp(-a^2 / (1 + cos(x))) dx over 0 .. arccos(rho)
///
/// where a is the threshold in standard deviations and rho the correlation of dhat from sample to
/// sample, from the loop. For small T this is Rice's formula. An alarm that stays on until it is
/// reset counts at most as often. Two things are not noise, and the threshold does not contain
/// them: the mean of dhat (gravity, friction), and what a motion puts there if b0 is wrong.
/// Subtract what is known.
/// @param row of the estimates: with one channel the order n
/// @return error for a continuous loop, one that is not stable, no such row, a dhat without noise,
///         more false alarms than a threshold of zero gives, or a number that is not finite
Expected<DisturbanceAlarm, Error<double>> disturbance_alarm(const Loop& loop, int row,
                                                            const DisturbanceAlarmConfig& config);

/// The same for the loop of a plant and a controller, see `closed_loop`. For another type than an
/// Adrc, a PredictiveAdrc or a DisturbanceCompensator give the loop and the row.
template <int States, Scalar S, class Controller>
requires requires { Controller::order; }
Expected<DisturbanceAlarm, Error<double>> disturbance_alarm(const LinearPlant<States, S>& plant,
                                                            const Controller& controller,
                                                            const DisturbanceAlarmConfig& config) {
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  return disturbance_alarm(*loop, Controller::order, config);
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/disturbance_alarm.ipp>
#endif
