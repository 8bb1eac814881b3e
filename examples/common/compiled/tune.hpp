/// @file
/// `tune`, compiled once for all programs that call it: ten seconds of compile in each otherwise.
#pragma once

#include <vector>

#include <esokit/tune/pid_baselines.hpp>

namespace esokit::examples::compiled {

/// esokit::tune
[[nodiscard]] Expected<Tuning, Error<double>> tune(const TuneModel& model,
                                                   const TuneSpecification& specification = {},
                                                   const TuneRules& rules = {});
/// esokit::tune_pids
[[nodiscard]] std::vector<TunedPid> tune_pids(const Tuning& tuning);
/// esokit::given_pid
[[nodiscard]] Expected<TunedPid, Error<double>> given_pid(const Tuning& tuning,
                                                          const PlainPidConfig& pid);

}  // namespace esokit::examples::compiled
