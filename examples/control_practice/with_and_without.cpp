// What esokit does, in one picture: the servo of the first program in README.md is pushed, the
// observer finds the push, and the controller cancels it; beside it the same controller without.
//
// Way: sampled. Each controller runs once a sample; the plant is sampled exactly.
//
// Plant       y'' = b0 u - friction y' + d(t),  |u| <= limit;  y comes from an encoder
// Controllers u = (omega_c^2 (r - z_1) - 2 omega_c z_2 - dhat) / b0, with dhat and with 0 instead
//
// symbol    code               value       unit
// b0        input_gain         50          rad/s2 per unit of u
//           friction           3           1/s, not known to the controllers
// d         load               -20         rad/s2, from 1 s to 2.5 s; then +-20 at 0.5 Hz
// omega_o   observer           100         rad/s
// omega_c   controller         10          rad/s
// T         sample_time        1e-3        s

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/run.hpp>

#include "common/report.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;

namespace {

constexpr double pi = 3.14159265358979;
constexpr double input_gain = 50;
constexpr double friction = 3;
constexpr double load_size = 20;
constexpr double observer = 100;
constexpr double controller = 10;
constexpr double sample_time = 1e-3;
constexpr double limit = 5;
constexpr double tick = 2 * pi / 16384;  // of the encoder
constexpr double pushed = 1.0, swings = 2.5;

using Observer = esokit::LinearEso<2>;
constexpr Observer::Config observer_config{
    .observer_bandwidth = observer, .input_gain = input_gain, .sample_time = sample_time};

double load(double t) {
  if (t < pushed) return 0;
  return t < swings ? -load_size : -load_size * std::cos(pi * (t - swings));
}

/// The law without the estimated disturbance.
struct Without {
  Observer observer;
  double u = 0;

  double update(double y, double r) {
    (void)observer.update(y, u);
    const auto z = observer.estimate();
    u = std::clamp((controller * controller * (r - z(0)) - 2 * controller * z(1)) / input_gain,
                   -limit, limit);
    return u;
  }
};

struct Run {
  std::vector<double> t, angle, acts, found;
  double deviation = 0;    ///< largest |r - y| from the push on
  double remaining = 0;    ///< |r - y| before the load begins to oscillate
  double found_after = 0;  ///< s from the push until dhat is within 5 % of it for good
};

template <class Controller, class Found>
Run simulate(const Controller& driven, Found found) {
  const auto plant =
      esokit::LinearPlant<2>::chain({.coefficients = {0, friction}, .input_gain = input_gain})
          .value();
  Run run;
  double last = 0;
  const auto look = [&](const auto& sample, Controller& c) {
    const double speed = (sample.output - last) / sample_time;
    last = sample.output;
    run.t.push_back(sample.t);
    run.angle.push_back(sample.output);
    run.acts.push_back(load(sample.t) - friction * speed);
    run.found.push_back(found(c));
    const double error = std::abs(sample.reference - sample.output);
    if (sample.t >= pushed) run.deviation = std::max(run.deviation, error);
    if (sample.t < swings) {
      run.remaining = error;
      if (sample.t >= pushed && std::abs(run.found.back() - run.acts.back()) > 0.05 * load_size) {
        run.found_after = sample.t - pushed + sample_time;
      }
    }
  };
  (void)esokit::sim::run(
      plant, driven,
      {.duration = 5.0,
       .sample_time = sample_time,
       .reference = [](double t) { return t < 0.1 ? 0.0 : 1.0; },
       .disturbance = load,
       .sensor = [](double, double angle) { return tick * std::round(angle / tick); }},
      look)
      .value();
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, practice::folder, "with_and_without",
                practice::about("A disturbance found and cancelled",
                                "A servo is pushed; the same controller with the disturbance that "
                                "its observer finds, and without it. Sampled at 1 ms."));
  const auto adrc = esokit::Adrc<Observer>::make({.observer = observer_config,
                                                  .controller_bandwidth = controller,
                                                  .limits = {.lower = -limit, .upper = limit}})
                        .value();
  const Run with = simulate(adrc, [](const auto& c) { return c.observer().total_disturbance(); });
  const Run without = simulate(Without{Observer::make(observer_config).value()},
                               [](const Without& c) { return c.observer.total_disturbance(); });

  report.check("with", "largest deviation (rad)", std::nullopt, with.deviation);
  report.check("without", "largest deviation (rad)", std::nullopt, without.deviation);
  report.check("with", "found after (ms)", std::nullopt, 1e3 * with.found_after);
  report.check("without over with", "largest deviation", std::nullopt,
               without.deviation / with.deviation);
  report.expect("with", "remains under a constant load (rad)", with.remaining,
                with.remaining < 2 * tick, "below two steps of the encoder");
  // At rest the law's omega_c^2 (r - y) holds against the load.
  report.check_reference("without", "remains under a constant load (rad)",
                         load_size / (controller * controller), without.remaining, 1e-2,
                         "load / omega_c^2");

  Figure figure("with_and_without", {.rows = 2, .columns = 1, .panel_height = 170});
  figure.caption(
      "A servo pushed by a load that the controller does not know. Top: its angle, with the "
      "estimated disturbance cancelled and without. Bottom: the disturbance that acts (load and "
      "friction), and the observer's estimate of it.");
  auto& angle = figure.panel(0, 0)
                    .y_label("angle (rad)")
                    .x_range(0, 5)
                    .y_range(0, 1.4)
                    .hide_x_numbers()
                    .legend(Legend::above)
                    .name("angle");
  std::vector<double> wanted;
  for (const double t : with.t) wanted.push_back(t < 0.1 ? 0.0 : 1.0);
  angle.line(with.t, wanted, {.name = "reference", .color = Color::black, .dash = Dash::dashed});
  angle.line(without.t, without.angle,
             {.name = "not cancelled", .color = Color::vermillion, .width = 2.2});
  angle.line(with.t, with.angle, {.name = "cancelled", .color = Color::blue, .width = 2.2});
  auto& disturbance = figure.panel(1, 0)
                          .x_label("t (s)")
                          .y_label("disturbance (rad/s^2)")
                          .x_range(0, 5)
                          .y_range(-30, 30)
                          .legend(Legend::above)
                          .name("disturbance");
  disturbance.line(with.t, with.acts,
                   {.name = "acts on the servo", .color = Color::grey, .width = 4});
  disturbance.line(with.t, with.found,
                   {.name = "found by the observer", .color = Color::blue, .width = 1.6});
  report.add(figure);
  return report.finish();
}
