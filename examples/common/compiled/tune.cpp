#include "tune.hpp"

namespace esokit::examples::compiled {

Expected<Tuning, Error<double>> tune(const TuneModel& model, const TuneSpecification& specification,
                                     const TuneRules& rules) {
  return esokit::tune(model, specification, rules);
}

std::vector<TunedPid> tune_pids(const Tuning& tuning) { return esokit::tune_pids(tuning); }

Expected<TunedPid, Error<double>> given_pid(const Tuning& tuning, const PlainPidConfig& pid) {
  return esokit::given_pid(tuning, pid);
}

}  // namespace esokit::examples::compiled
