/// @file
/// `tune`, compiled once for all programs that call it: ten seconds of compile in each otherwise.
#pragma once

#include <vector>

#include <esokit/tune/rivals.hpp>

namespace esokit::examples::compiled {

/// esokit::tune
[[nodiscard]] Expected<Tuning, Error<double>> tune(const TuneModel& model,
                                                   const TuneWish& wish = {},
                                                   const TuneRules& rules = {});
/// esokit::tune_rivals
[[nodiscard]] std::vector<TunedRival> tune_rivals(const Tuning& tuning);
/// esokit::given_rival
[[nodiscard]] Expected<TunedRival, Error<double>> given_rival(const Tuning& tuning,
                                                              const PlainPidConfig& pid);

}  // namespace esokit::examples::compiled
