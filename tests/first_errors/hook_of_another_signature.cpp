// expect: esokit: a gain law has .* with the right signature
// also: BridgesGapsAsDeclared
#include <esokit/observer/predictor_corrector.hpp>

struct Bridging {
  static constexpr esokit::GainLawTraits traits{.bridges_gaps = true};
  esokit::ScaledGain<3, double> k{};
  const esokit::ScaledGain<3, double>& gain(double) const noexcept { return k; }
  int longest_gap(int asked) const noexcept { return asked; }
  const esokit::ScaledGain<3, double>& gap_gain(unsigned) const noexcept { return k; }
};

auto run() {
  return esokit::PredictorCorrector<2, double, 1, Bridging>::make(
      {.input_gain = 1.0, .sample_time = 1e-3}, Bridging{});
}
