// The analysis needs neither exceptions nor RTTI, and where sizes are fixed it allocates nothing.
#include "support/no_allocation.hpp"

#include <cstdio>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/error_bound.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/analysis/peak_gain.hpp>
#include <esokit/observer/cascade_eso.hpp>

int main() {
  using namespace esokit;
  const auto observer = CascadeEso<2, 2>::make({.observer_bandwidth = 30.0,
                                                .bandwidth_factor = 2.0,
                                                .input_gain = 1.0,
                                                .sample_time = 1e-3})
                            .value();
  const ContinuousCascadeEso<2, 2>::Config config{
      .observer_bandwidth = 30.0, .bandwidth_factor = 2.0, .input_gain = 1.0};
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 4.0, .input_gain = 1.0}).value();
  const auto plant = CompanionPlant<2>{{1.0, 2.0}, 1.0}.system().value();

  const esokit_test::NoAllocation guard;
  bool fine = true;
  const auto require = [&](bool holds, const char* what) {
    if (holds) return;
    std::printf("failed: %s\n", what);
    fine = false;
  };
  require(
      estimation_error_covariance(observer, {.measurement = 1.0, .disturbance = 1.0}).has_value(),
      "covariance");
  const auto grid = log_grid<50>(1.0, 3000.0).value();
  require((bode<0, 2>(observer_system(observer), grid)).has_value(), "bode");
  const auto loop = adrc_loop(sampled_plant(plant, 1e-3, 5e-4).value(), observer, law);
  require(loop.has_value(), "loop");
  const auto all = margins(*loop);
  require(all.has_value() && all->phase.limited(), "margins");
  require(delay_margin(*loop, plant, 5e-4).has_value(), "delay margin");
  require(peak_gain(error_system(observer)).has_value(), "peak gain");
  require(cascade_error_bounds<2>(config, {.disturbance_rate = 1.0}).has_value(), "cascade bound");
  require(switched_error_bound<3>({10.0, 0.7}, {.disturbance_rate = 1.0}).has_value(),
          "switched bound");
  require(!switched_error_bound<3>({10.0, 0.2}, {.disturbance_rate = 1.0}).has_value(),
          "refused bound");
  require(guard.count() == 0, "no allocation");
  return fine ? 0 : 1;
}
