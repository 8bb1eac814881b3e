#include "tune.hpp"

namespace esokit::examples::compiled {

Expected<Tuning, Error<double>> tune(const TuneModel& model, const TuneWish& wish,
                                     const TuneRules& rules) {
  return esokit::tune(model, wish, rules);
}

std::vector<TunedRival> tune_rivals(const Tuning& tuning) { return esokit::tune_rivals(tuning); }

Expected<TunedRival, Error<double>> given_rival(const Tuning& tuning, const PlainPidConfig& pid) {
  return esokit::given_rival(tuning, pid);
}

}  // namespace esokit::examples::compiled
