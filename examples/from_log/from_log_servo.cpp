// The whole procedure, once: 20 s of log of a servo under a badly tuned PID, one command, and the
// controller that it chooses on the true machine, compared with the PID.
//
// Way: sampled. Each controller runs once a sample; the plant is integrated in between. The log is
// a file, and from_log sees nothing but this file and the limits of u.
//
// Plant       theta'' = a v - b theta' - c tanh(theta' / w_s) - load(t),  tau v' + v = u(t - L),
//             |u| <= u_max, y = theta, quantised by the encoder, with noise
// PID         K_p 3, K_i 1, K_d 0.1: overshoots, and oscillates under a load
//
// symbol    code        value     unit
// a         gain        80        rad/s2 per V
// b         viscous     1.2       1/s
// c         coulomb     8         rad/s2
// w_s       stribeck    0.05      rad/s
// tau       lag         4e-3      s
// L         dead_time   2e-3      s
// u_max     limit       5         V
// T         T           1e-3      s

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>

#include "common/report.hpp"
#include "common/system.hpp"
#include "control_practice/pid.hpp"
#include "from_log/parts/show.hpp"

using namespace esokit::examples;

namespace {

constexpr double gain = 80, viscous = 1.2, coulomb = 8, stribeck = 0.05;
constexpr double lag = 4e-3, dead_time = 2e-3, limit = 5, T = 1e-3;
constexpr double encoder = 2 * 3.14159265358979 / 16384, noise = 2e-4;

struct Run {
  std::vector<double> t, r, y, u;
};

/// f(t, y): the u of a controller. load: rad/s2
template <class Control, class Reference, class Load>
Run simulate(double duration, std::uint64_t seed, Control control, const Reference& reference,
             const Load& load) {
  using State = esokit::Vector<double, 3>;
  const auto plant = esokit::sim::nonlinear_plant<3>([&](double t, const State& x, double u) {
    return State{x(1),
                 gain * x(2) - viscous * x(1) - coulomb * std::tanh(x(1) / stribeck) - load(t),
                 (u - x(2)) / lag};
  });
  Run run;
  esokit::sim::Gaussian gaussian(seed);
  double now = 0;
  const auto controller = [&](double y, double r) {
    const double u = std::clamp(control(y, r), -limit, limit);
    run.t.push_back(now);
    run.r.push_back(r);
    run.u.push_back(u);
    now += T;
    return u;
  };
  const auto result =
      esokit::sim::run(plant, controller,
                       {.duration = duration,
                        .sample_time = T,
                        .reference = [&](double t) { return reference(t); },
                        .sensor =
                            [&](double, double y) {
                              return encoder * std::round((y + noise * gaussian.next()) / encoder);
                            },
                        .dead_time = dead_time,
                        .substeps = 4});
  run.y = result.value().measurement;
  const std::size_t rows = std::min(run.t.size(), run.y.size());
  for (auto* column : {&run.t, &run.r, &run.y, &run.u}) column->resize(rows);
  return run;
}

/// Steps at random times, as an operator makes them.
double moved(double t) {
  constexpr double levels[] = {0, 1.2, -0.5, 0.4, -1.3, 0.9, 0.1, 1.4, -0.8, -1.2, 0.6, -0.2, 1.0};
  const double at = (t + 0.35 * std::sin(1.7 * t)) / 0.8;
  return levels[static_cast<std::size_t>(std::clamp(at, 0.0, 1e3)) % 13];
}
double swaying(double t) { return 6 * std::sin(0.7 * t); }

practice::Pid pid() {
  return practice::Pid({.proportional = 3,
                        .integral = 1,
                        .derivative = 0.1,
                        .derivative_filter = 0.01,
                        .lower = -limit,
                        .upper = limit,
                        .sample_time = T});
}

double largest(const Run& run, double from, double to) {
  double most = 0;
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    if (run.t[k] >= from && run.t[k] < to) most = std::max(most, std::abs(run.r[k] - run.y[k]));
  }
  return most;
}
double rms(const Run& run, double from, double to) {
  double sum = 0, count = 0;
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    if (run.t[k] < from || run.t[k] >= to) continue;
    sum += std::pow(run.r[k] - run.y[k], 2);
    ++count;
  }
  return std::sqrt(sum / count);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "from_log", "from_log_servo",
                {.paper_title = "From a log to a controller",
                 .citation = "No paper. One command from a CSV file to a controller, on simulated "
                             "and real machines",
                 .link = "",
                 .title = "The whole procedure: a servo under a badly tuned PID",
                 .description = "20 s of log, one command, and the new controller on the same "
                                "simulated servo. Sampled controllers.",
                 .order = 1});
  // 1. Record.
  auto bad = pid();
  const Run log = simulate(
      20, 1, [&](double y, double r) { return bad.update(y, r); }, moved, swaying);
  std::string text = "t_s,torque_V,angle_rad\n";
  for (std::size_t k = 0; k < log.t.size(); ++k) {
    text += number_text(log.t[k], 8) + ',' + number_text(log.u[k], 7) + ',' +
            number_text(log.y[k], 9) + '\n';
  }
  from_log::Settings settings;
  settings.file = report.folder() + "/servo.csv";
  if (!write_text(settings.file, text)) return 1;

  // 2. One command.
  settings.limits = {-limit, limit};
  settings.command = "from_log servo.csv --limits 5";
  settings.out = report.folder();
  std::optional<from_log::Outcome> outcome;
  try {
    outcome = from_log::work_out(settings);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "from_log_servo: %s\n", error.what());
    return 1;
  }
  // This folder is the example's own: a page of the run before goes.
  for (const auto& entry : std::filesystem::directory_iterator(report.folder())) {
    if (entry.path().extension() == ".html") std::filesystem::remove(entry.path());
  }
  const std::string page = outcome->page(settings).write(settings.out, from_log::stem_of(settings));
  if (page.empty()) return 1;
  report.link(esokit::examples::path_of(page).filename().string(), "The page that from_log writes");
  report.expect("log", "status", outcome->status, outcome->status == from_log::all_clear,
                "0: there is a design and no alarm");
  if (!outcome->design.made()) return report.finish() | 1;
  const auto& found = outcome->findings.found;
  report.check_reference("log", "b0 (rad/s2 per V)", gain, found.input_gain.value, 0.02, "true");
  report.check_reference("log", "lag and dead time (ms)", 1e3 * (lag + dead_time),
                         1e3 * found.latency.value, Tolerance::absolute(0.5), "true");
  report.check_reference("log", "Coulomb friction (rad/s2)", coulomb, found.friction.value, 0.05,
                         "true");

  // 3. The new loop on the true machine.
  const auto& tuning = outcome->design.tuning();
  const auto& taken = outcome->design.taken();
  const auto& pasting = outcome->design.pasting();
  const auto steps = [](double t) { return t < 0.2 ? 0.0 : t < 2 ? 1.5 : -0.5; };
  // The profile of the code is the reference of both.
  from_log::Runner planner(pasting, tuning, taken);
  planner.start(0, 0);
  std::vector<double> plan;
  for (int k = 0; k <= 6000; ++k) {
    (void)planner.update(0, steps(k * T));
    plan.push_back(planner.motion()[0]);
  }
  const auto row = [](double t) { return static_cast<std::size_t>(std::lround(t / T)); };
  const auto reference = [&](double t) { return plan[std::min<std::size_t>(row(t), 6000)]; };
  const auto load = [](double t) { return t >= 3.5 && t < 5 ? 60.0 : 0.0; };
  const auto with_pid = [&](std::uint64_t seed) {
    auto controller = pid();
    return simulate(
        6, seed, [&](double y, double r) { return controller.update(y, r); }, reference, load);
  };
  const auto with_new = [&](const from_log::Pasting& what, std::uint64_t seed) {
    from_log::Runner controller(what, tuning, taken);
    controller.start(0, 0);
    int k = 0;
    return simulate(
        6, seed, [&](double y, double) { return controller.update(y, steps(T * k++)); }, reference,
        load);
  };
  auto bare = pasting;
  bare.friction = 0;
  const Run before = with_pid(2), after = with_new(pasting, 2), left_out = with_new(bare, 2);

  struct Measure {
    const char* name;
    double (*of)(const Run&);
  };
  constexpr Measure measures[] = {
      {"largest error after the steps (mrad)",
       [](const Run& run) { return 1e3 * largest(run, 0.2, 3.5); }},
      {"RMS error, steps (mrad)", [](const Run& run) { return 1e3 * rms(run, 0.2, 3.5); }},
      {"largest error after the load (mrad)",
       [](const Run& run) { return 1e3 * largest(run, 3.5, 5); }},
      {"error under the load, 1 s later (mrad)",
       [](const Run& run) { return 1e3 * rms(run, 4.5, 5); }}};
  std::vector<CsvRow> lines;
  for (const Measure& measure : measures) {
    const double pid_value = measure.of(before), value = measure.of(after);
    report.check("PID", measure.name, std::nullopt, pid_value);
    report.check("from the log", measure.name, std::nullopt, value);
    report.check("without friction", measure.name, std::nullopt, measure.of(left_out));
    lines.push_back({measure.name, number_text(pid_value, 3), number_text(value, 3),
                     number_text(pid_value / value, 3)});
  }
  report.table("result", "Both controllers on the true machine; from the log: " + taken.name,
               {"", "PID", "from the log", "PID / from the log"}, lines);
  report.expect("from the log", "largest error after the load, share of the PID's",
                measures[2].of(after) / measures[2].of(before),
                measures[2].of(after) < 0.2 * measures[2].of(before), "below a fifth");
  report.expect("from the log", "RMS error of the steps, share of the PID's",
                measures[1].of(after) / measures[1].of(before),
                measures[1].of(after) < 0.2 * measures[1].of(before), "below a fifth");

  Figure figure("servo", {.rows = 4, .columns = 1, .panel_height = 130});
  figure.caption(
      "Top: the log, 20 s under the badly tuned PID. Below: the same machine with a reference "
      "profile and a load, under that PID and under the controller that one command chose from "
      "the log (" +
      taken.name + ").");
  figure.panel(0, 0)
      .title("recorded")
      .x_label("t (s)")
      .y_label("angle (rad)")
      .legend(Legend::above)
      .name("log")
      .line(log.t, log.r, {.name = "reference", .color = Color::black, .width = 0.8})
      .line(log.t, log.y, {.name = "angle, bad PID", .color = Color::vermillion, .width = 1.2});
  figure.panel(1, 0)
      .title("before and after")
      .x_label("t (s)")
      .y_label("angle (rad)")
      .legend(Legend::above)
      .name("angle")
      .line(before.t, before.r, {.name = "reference", .color = Color::black, .dash = Dash::dashed})
      .line(before.t, before.y, {.name = "bad PID", .color = Color::vermillion})
      .line(after.t, after.y, {.name = "from the log", .color = Color::blue});
  const auto error = [](const Run& run) {
    std::vector<double> e;
    for (std::size_t k = 0; k < run.t.size(); ++k) e.push_back(1e3 * (run.r[k] - run.y[k]));
    return e;
  };
  figure.panel(2, 0)
      .x_label("t (s)")
      .y_label("error (mrad)")
      .name("error")
      .line(before.t, error(before), {.color = Color::vermillion, .column = "bad PID"})
      .line(after.t, error(after), {.color = Color::blue, .column = "from the log"});
  figure.panel(3, 0)
      .x_label("t (s)")
      .y_label("u (V)")
      .name("u")
      .line(after.t, after.u, {.color = Color::blue, .width = 1.0, .column = "from the log"})
      .line(before.t, before.u, {.color = Color::vermillion, .width = 1.2, .column = "bad PID"});
  report.add(figure);

  // For the README: the same machine before and after.
  Figure result("before_and_after", {.rows = 1, .columns = 2, .panel_height = 190});
  result.caption(
      "The two steps and the load of the whole way, with the PID of the log and with the "
      "controller that from_log made of it.");
  const Style dashed{.name = "reference", .color = Color::black, .dash = Dash::dashed};
  result.panel(0, 0)
      .x_label("t (s)")
      .y_label("angle (rad)")
      .legend(Legend::above)
      .name("angle")
      .line(before.t, before.r, dashed)
      .line(before.t, before.y, {.name = "old PID", .color = Color::vermillion})
      .line(after.t, after.y, {.name = "from the log", .color = Color::blue});
  result.panel(0, 1)
      .x_label("t (s)")
      .y_label("error (mrad)")
      .name("error")
      .line(before.t, error(before), {.color = Color::vermillion, .column = "old PID"})
      .line(after.t, error(after), {.color = Color::blue, .column = "from the log"});
  report.add(result);
  return report.finish();
}
