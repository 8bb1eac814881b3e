// expect: esokit: a gain law has
// also: AdvancesAsDeclared
#include <esokit/observer/predictor_corrector.hpp>
struct Law {
  esokit::ScaledGain<3, double> k{};
  void advance() noexcept {}
  const auto& gain(double) const noexcept { return k; }
};
using P = esokit::PredictorCorrector<2, double, 1, Law>;
auto f() { return P::make({.input_gain = 1.0, .sample_time = 1e-3}, Law{}); }
