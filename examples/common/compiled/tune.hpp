/// @file
/// `tune`, compiled once for all programs that call it: ten seconds of compile in each otherwise.
#pragma once

#include <esokit/tune/tune.hpp>

namespace esokit::examples::compiled {

/// esokit::tune
[[nodiscard]] Expected<Tuning, Error<double>> tune(const TuneModel& model,
                                                   const TuneWish& wish = {},
                                                   const TuneRules& rules = {});

}  // namespace esokit::examples::compiled
