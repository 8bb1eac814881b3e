// An existing PID stays: the disturbance compensator is put between it and the actuator, while the
// machine runs, without a bump.
//
// Way: sampled, 1 ms.
//
// Plant       y'' = -2 y' + 50 u - load(t),  |u| <= 4
// Controller  PID (its own integrator, filter, anti-windup), the same gains throughout
// Compensator u = limited(u0 - dhat / b0), LinearEso<2>
//
// symbol    code          value    unit
// b0        nominal_gain  50       -
// omega_o   observer      60       rad/s
// T         sample_time   1e-3     s
// load      load          40 from 1 s, 40 more from 4 s, of y''
//
// The compensator follows from 0 s on; at 2.5 s it is switched on. The PID's integrator carries the
// load then; compensator and integrator change places without a step of u.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/run.hpp>

#include "common/report.hpp"
#include "control_practice/pid.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;
using namespace practice;

namespace {

constexpr double nominal_gain = 50;
constexpr double observer = 60;
constexpr double sample_time = 1e-3;
constexpr double limit = 4;
constexpr double switch_on = 2.5;
constexpr int switched_on = 2500;  ///< the sample

double load(double t) { return t < 1 ? 0 : t < 4 ? -40 : -80; }

struct Run {
  std::vector<double> t, y, u, base;
  double bump = 0;         ///< change of u in the sample at the switch, in V
  double first_load = 0;   ///< largest |1 - y| after the load at 1 s
  double second_load = 0;  ///< after the load at 4 s
};

Run simulate(bool wrap) {
  Pid pid({.proportional = 4,
           .integral = 8,
           .derivative = 0.35,
           .derivative_filter = 5e-3,
           .lower = -limit,
           .upper = limit,
           .sample_time = sample_time});
  using Compensator = esokit::DisturbanceCompensator<esokit::LinearEso<2>>;
  auto compensator = Compensator::make({.observer = {.observer_bandwidth = observer,
                                                     .input_gain = nominal_gain,
                                                     .sample_time = sample_time},
                                        .limits = {.lower = -limit, .upper = limit}})
                         .value();
  pid.start(1, 1, 0);
  (void)compensator.start(1, 0);
  Run run;
  double u = 0;
  const auto controller = [&](double y, double r) {
    const auto since = static_cast<int>(run.base.size()) - switched_on;
    const double before = u;
    double base = 0;
    if (!wrap || since < 0) {
      (void)compensator.track(y, u);
      base = u = pid.update(y, r);
    } else if (since == 0) {
      // The PID gives up what the compensator brings.
      (void)compensator.track(y, u);
      base = compensator.base_output();
      pid.start(y, r, base);
    } else {
      base = pid.update(y, r);
      u = compensator.update(y, base);
      // What was applied of u0: for the PID's anti-windup.
      pid.applied(u - compensator.compensation());
    }
    if (since == 0 || since == 1) run.bump = std::max(run.bump, std::abs(u - before));
    run.base.push_back(base);
    return u;
  };
  const auto plant =
      esokit::LinearPlant<2>::chain({.coefficients = {0, 2}, .input_gain = nominal_gain}).value();
  const auto recorded = esokit::sim::run(plant, controller,
                                         {.duration = 6.0,
                                          .sample_time = sample_time,
                                          .reference = 1.0,
                                          .disturbance = load,
                                          .state = {1, 0}})
                            .value();
  run.t = recorded.t;
  run.y = recorded.output;
  run.u = recorded.input;
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double t = run.t[k], error = std::abs(1 - run.y[k]);
    if (t >= 1 && t < 2.4) run.first_load = std::max(run.first_load, error);
    if (t >= 4) run.second_load = std::max(run.second_load, error);
  }
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "pid_wrapping",
                about("Wrapping an existing PID",
                      "A disturbance compensator is switched on around a PID while the machine "
                      "runs; the gains of the PID do not change. Sampled at 1 ms."));
  const Run plain = simulate(false);
  const Run wrapped = simulate(true);
  report.check("PID", "peak error after the load at 1 s", std::nullopt, plain.first_load);
  report.check("PID", "peak error after the load at 4 s", std::nullopt, plain.second_load);
  report.check("PID, wrapped at 2.5 s", "peak error after the load at 1 s", std::nullopt,
               wrapped.first_load);
  report.check("PID, wrapped at 2.5 s", "peak error after the load at 4 s", std::nullopt,
               wrapped.second_load);
  report.expect("PID, wrapped at 2.5 s", "the compensator helps (ratio of the peaks)",
                wrapped.second_load / plain.second_load,
                wrapped.second_load < 0.5 * plain.second_load, "below 0.5");
  report.expect("PID, wrapped at 2.5 s", "jump of u at the switch (share of the range)",
                wrapped.bump / (2 * limit), wrapped.bump < 0.001 * 2 * limit,
                "below 0.1 %; the plant is not quite at rest");
  report.comparison(
      "table", "The second load step, as large as the first, with and without the compensator");
  Figure figure("pid_wrapping", {.rows = 2, .columns = 1, .panel_height = 200});
  figure.caption(
      "Load steps at 1 s and 4 s; from 2.5 s on the compensator is between the PID and the "
      "actuator. Bottom: u, and the output of the PID itself, which falls to zero when the "
      "compensator is switched on and takes over the load.");
  auto& output =
      figure.panel(0, 0).y_label("y (-)").x_range(0, 6).legend(Legend::above).name("output");
  auto& input = figure.panel(1, 0)
                    .x_label("t (s)")
                    .y_label("u (V)")
                    .x_range(0, 6)
                    .legend(Legend::above)
                    .name("input");
  output.line(plain.t, plain.y, {.name = "PID", .color = Color::grey})
      .line(wrapped.t, wrapped.y, {.name = "PID, wrapped from 2.5 s on", .color = Color::blue})
      .vertical_line(switch_on);
  input.line(plain.t, plain.u, {.name = "u of the PID", .color = Color::grey})
      .line(wrapped.t, wrapped.u, {.name = "u, wrapped", .color = Color::blue})
      .line(wrapped.t, wrapped.base,
            {.name = "PID's output, wrapped", .color = Color::vermillion, .dash = Dash::dashed})
      .vertical_line(switch_on);
  report.add(figure);
  return report.finish();
}
