// The analysis needs neither exceptions nor RTTI, and where sizes are fixed it allocates nothing;
// loops, whose sizes are known at run time only, do.
#include "support/no_allocation.hpp"

#include <cstdio>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
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
  require(peak_gain(error_system(observer)).has_value(), "peak gain");
  require(guard.count() == 0, "no allocation");

  const auto controller = Adrc<CascadeEso<2, 2>>::make({.observer = {.observer_bandwidth = 30.0,
                                                                     .bandwidth_factor = 2.0,
                                                                     .input_gain = 1.0,
                                                                     .sample_time = 1e-3},
                                                        .controller_bandwidth = 4.0})
                              .value();
  const auto plant = LinearPlant<2>::chain({.coefficients = {1.0, 2.0}, .dead_time = 5e-4}).value();
  const auto all = margins(plant, controller);
  require(all.has_value() && all->phase.limited(), "margins");
  require(delay_margin(plant, controller).has_value(), "delay margin");
  return fine ? 0 : 1;
}
