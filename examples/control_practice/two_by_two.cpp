// Two inputs, two outputs: channels of different order, decoupled by the input matrix, limits on
// each actuator; beside two single loops that know nothing of each other.
//
// Way: sampled, 2 ms.
//
// Plant    y_1'' = -y_1' + 2 u_1 + 1.4 u_2 + w_1(t),   y_2' = -2 y_2 + 1.2 u_1 + 3 u_2 + w_2(t)
// Model    y_1'' = d_1 + (B0 u)_1,  y_2' = d_2 + (B0 u)_2,  B0 = (1.8 1.2; 1 2.6): ten to twenty
//          percent off the truth
//
// symbol    code         value        unit
// omega_o   observers    80, 60       rad/s
// omega_c   controllers  8, 10        rad/s
// |u|       limits       50, 30       V
// w_1, w_2  disturbance  -4 from 3 s, 5 from 4.5 s

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/run.hpp>

#include "common/report.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;
using namespace practice;

namespace {

using Pair = esokit::Vector<double, 2>;
using esokit::LinearEso;
using Mimo = esokit::MimoAdrc<LinearEso<2>, LinearEso<1>>;

constexpr double sample_time = 2e-3;

Mimo::Config config() {
  Mimo::Config settings{.observers = {{.observer_bandwidth = 80, .sample_time = sample_time},
                                      {.observer_bandwidth = 60, .sample_time = sample_time}},
                        .controller_bandwidths = {8, 10},
                        .limits = {{{.lower = -50, .upper = 50}, {.lower = -30, .upper = 30}}}};
  settings.input_matrix = {{1.8, 1.2}, {1.0, 2.6}};
  return settings;
}

using Plant = esokit::LinearPlant<3, double, 2, 2>;

constexpr Plant plant{.a = {{0, 1, 0}, {0, -1, 0}, {0, 0, -2}},
                      .b = {{0, 0}, {2, 1.4}, {1.2, 3}},
                      .c = {{1, 0, 0}, {0, 0, 1}},
                      .e = {{0, 0}, {1, 0}, {0, 1}}};

struct Run {
  std::vector<double> t;
  esokit::Array<std::vector<double>, 2> y, u;
  double crossed_to_1 = 0;  ///< what the step of y_2 at 2 s does to y_1
  double crossed_to_2 = 0;  ///< what the step of y_1 at 0.5 s does to y_2
  double final_error = 0;
};

template <class C>
Run simulate(const C& controller) {
  const auto recorded =
      esokit::sim::run(plant, controller,
                       {.duration = 6.0,
                        .sample_time = sample_time,
                        .reference =
                            [](double t) {
                              return Pair{t < 0.5 ? 0.0 : 1.0, t < 2 ? 0.0 : 1.0};
                            },
                        .disturbance =
                            [](double t) {
                              return Pair{t >= 3 ? -4.0 : 0.0, t >= 4.5 ? 5.0 : 0.0};
                            }})
          .value();
  Run run{recorded.t, recorded.output, recorded.input};
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double t = run.t[k], y1 = run.y[0][k], y2 = run.y[1][k];
    if (t < 2) run.crossed_to_2 = std::max(run.crossed_to_2, std::abs(y2));
    if (t >= 2 && t < 3) run.crossed_to_1 = std::max(run.crossed_to_1, std::abs(y1 - 1));
    run.final_error = std::max(std::abs(y1 - 1), std::abs(y2 - 1));
  }
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "two_by_two",
                about("Two inputs, two outputs",
                      "A channel of order 2 and one of order 1, coupled through their inputs: "
                      "decoupled by B0^-1, and as two separate loops. Sampled at 2 ms."));
  const Run decoupled = simulate(Mimo::make(config()).value());

  const auto matrix = config().input_matrix;
  auto first = esokit::Adrc<LinearEso<2>>::make({.observer = {.observer_bandwidth = 80,
                                                              .input_gain = matrix(0, 0),
                                                              .sample_time = sample_time},
                                                 .controller_bandwidth = 8,
                                                 .limits = {.lower = -50, .upper = 50}})
                   .value();
  auto second = esokit::Adrc<LinearEso<1>>::make({.observer = {.observer_bandwidth = 60,
                                                               .input_gain = matrix(1, 1),
                                                               .sample_time = sample_time},
                                                  .controller_bandwidth = 10,
                                                  .limits = {.lower = -30, .upper = 30}})
                    .value();
  const Run single = simulate([&](const Pair& y, const Pair& r) {
    return Pair{first.update(y(0), r(0)), second.update(y(1), r(1))};
  });

  for (const auto& [name, run] :
       {std::pair<std::string, const Run&>{"decoupled", decoupled}, {"two single loops", single}}) {
    report.check(name, "step of y_1 seen in y_2", std::nullopt, run.crossed_to_2);
    report.check(name, "step of y_2 seen in y_1", std::nullopt, run.crossed_to_1);
    report.check(name, "error in the end", std::nullopt, run.final_error);
  }
  report.expect("decoupled", "coupling, ratio to single loops",
                decoupled.crossed_to_2 / single.crossed_to_2,
                decoupled.crossed_to_2 < 0.5 * single.crossed_to_2, "below 0.5");
  report.expect("decoupled", "no steady error", decoupled.final_error, decoupled.final_error < 1e-3,
                "below 1e-3");
  report.comparison("table", "Coupling with and without B0^-1");

  auto ill = config();
  ill.input_matrix = {{1, 1}, {1, 1.001}};
  const auto refused = Mimo::make(ill);
  report.expect("ill-conditioned B0", "condition number", refused ? 0.0 : refused.error().value,
                !refused, refused ? "accepted" : "refused: " + esokit::to_text(refused.error()));

  Figure figure("two_by_two", {.rows = 2, .columns = 2, .panel_height = 190});
  figure.caption(
      "Steps of r_1 at 0.5 s and r_2 at 2 s, disturbances at 3 s and 4.5 s. B0 is wrong by ten to "
      "twenty percent; the observers estimate the remaining coupling as a disturbance.");
  auto& y1 = figure.panel(0, 0).y_label("y_1 (-)").x_range(0, 6).legend(Legend::above).name("y1");
  auto& y2 = figure.panel(0, 1).y_label("y_2 (-)").x_range(0, 6).name("y2");
  auto& u1 = figure.panel(1, 0).x_label("t (s)").y_label("u_1 (V)").x_range(0, 6).name("u1");
  auto& u2 = figure.panel(1, 1).x_label("t (s)").y_label("u_2 (V)").x_range(0, 6).name("u2");
  const auto draw = [&](const Run& run, const Style& style) {
    Style quiet = style;
    quiet.name.clear();
    y1.line(run.t, run.y[0], style);
    y2.line(run.t, run.y[1], quiet);
    u1.line(run.t, run.u[0], quiet);
    u2.line(run.t, run.u[1], quiet);
  };
  draw(single, {.name = "two single loops", .color = Color::grey});
  draw(decoupled, {.name = "decoupled", .color = Color::blue});
  report.add(figure);
  return report.finish();
}
