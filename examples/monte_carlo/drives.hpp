/// @file
/// The study of `monte_carlo` and of its parts: one controller at drives that are not the one it
/// was made for.
#pragma once

#include <cstdint>

#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/monte_carlo.hpp>

namespace drives {

namespace sim = esokit::sim;

inline constexpr double T = 1e-3;
inline constexpr double input_gain = 50;
inline constexpr double load = -400;

using Controller = esokit::Adrc<esokit::LinearEso<2>>;
using Drive = esokit::LinearPlant<3>;

inline Drive drive(double b, double friction, double lag) {
  return with_lag(esokit::LinearPlant<2>::chain({.coefficients = {0, friction}, .input_gain = b})
                      .value(),
                  lag)
      .value();
}

inline Controller controller() {
  return Controller::make(
             {.observer = {.observer_bandwidth = 150, .input_gain = input_gain, .sample_time = T},
              .controller_bandwidth = 20,
              .limits = {.lower = -60, .upper = 60}})
      .value();
}

/// What is drawn of a run.
struct Machine {
  double gain, friction, lag, noise;

  explicit Machine(sim::Draw& draw)
      : gain(draw.uniform_ratio(20, 125)),
        friction(draw.uniform(0, 12)),
        lag(draw.uniform(0.5e-3, 12e-3)),
        noise(draw.uniform(0.1e-3, 0.5e-3)) {}
};

inline constexpr auto vary = [](auto& trial, sim::Draw& draw) {
  const Machine machine(draw);
  trial.plant = drive(machine.gain, machine.friction, machine.lag);
  trial.noise = machine.noise;
};

inline sim::MonteCarloConfig<Drive, Controller> config(std::int64_t runs) {
  return {.runs = runs,
          .loop = {.duration = 1.0,
                   .reference = 1.0,
                   .disturbance = [](double t) { return t < 0.5 - T / 2 ? 0.0 : load; },
                   .seed = 22}};
}

inline const auto position_error = [](const auto& s) { return s.output - s.reference; };
inline const auto overshoot =
    sim::largest("overshoot (rad)", position_error, {.to = 0.5, .limit = 0.05});
inline const auto settling = sim::settling_time("settling time to 2 % (s)", position_error, 0.02,
                                                {.to = 0.5, .limit = 0.45});
inline const auto dip =
    sim::largest("dip under load (rad)", [](const auto& s) { return s.reference - s.output; },
                 {.from = 0.5, .limit = 0.35});
inline const auto chatter =
    sim::root_mean_square("rms of u at rest", [](const auto& s) { return s.input; },
                          {.from = 0.45, .to = 0.499, .limit = 1.5});

/// @param threads 0: one per core
inline auto study(std::int64_t runs, int threads = 0) {
  auto settings = config(runs);
  settings.threads = threads;
  return sim::monte_carlo(drive(input_gain, 3, 2e-3), controller(), settings, vary);
}

}  // namespace drives
