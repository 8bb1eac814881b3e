// expect: esokit: a gain law has .* is declared in its .traits.
// also: AdvancesAsDeclared
#include <esokit/observer/predictor_corrector.hpp>

struct Schedule {
  esokit::ScaledGain<3, double> k{};
  void advance() noexcept { k[0] *= 0.5; }  // would never be called: no traits say so
  const esokit::ScaledGain<3, double>& gain(double) const noexcept { return k; }
};

auto run() {
  return esokit::PredictorCorrector<2, double, 1, Schedule>::make(
      {.input_gain = 1.0, .sample_time = 1e-3}, Schedule{});
}
