#include "tune.hpp"

namespace esokit::examples::compiled {

Expected<Tuning, Error<double>> tune(const TuneModel& model, const TuneWish& wish,
                                     const TuneRules& rules) {
  return esokit::tune(model, wish, rules);
}

}  // namespace esokit::examples::compiled
