// What limits, starts, retunes and lost samples do to ADRC, in numbers: a double integrator, known
// exactly, so that every deviation is the controller's.
//
// Way: sampled; the plant is exact between samples.
//
// Plant      y'' = d + b0 u,  d = -3,  b0 = 2
//
// symbol    code          value    unit
// b0        gain          2        1/(V s2) of y
// T         sample_time   1e-3     s
// omega_o   observer      80       rad/s
// omega_c   controller    10       rad/s
// u_max     limit         3        V (half of it goes into d)

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include <esokit/adapter/variable_time.hpp>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>

#include "common/compiled/spectral_radius.hpp"
#include "common/report.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;
using namespace practice;
namespace sim = esokit::sim;

namespace {

constexpr double gain = 2;
constexpr double disturbance = -3;
constexpr double steady_input = 1.5;
constexpr double sample_time = 1e-3;
constexpr double observer_bandwidth = 80;
constexpr double controller_bandwidth = 10;
constexpr double limit = 3;
constexpr double step_size = 10;

using State = esokit::Vector<double, 2>;

constexpr esokit::LinearPlant<2> plant{
    .a = {{0, 1}, {0, 0}}, .b = {0, gain}, .c = {1, 0}, .e = {0, 1}};
/// The same with all states measured.
constexpr esokit::LinearPlant<2, double, 1, 2> open_plant{
    .a = plant.a, .b = plant.b, .c = {{1, 0}, {0, 1}}, .e = plant.e};

using Linear = esokit::LinearEso<2>;
using Cascade = esokit::CascadeEso<2, 2>;
using Algebraic = esokit::AlgebraicEso<2>;

Linear::Config linear(double bandwidth = observer_bandwidth, double b0 = gain) {
  return {.observer_bandwidth = bandwidth, .input_gain = b0, .sample_time = sample_time};
}
Cascade::Config cascade(double bandwidth = observer_bandwidth, double b0 = gain) {
  return {.observer_bandwidth = bandwidth / 2,
          .bandwidth_factor = 2,
          .input_gain = b0,
          .sample_time = sample_time};
}
Algebraic::Config algebraic(double bandwidth = observer_bandwidth, double b0 = gain) {
  return {.observer_bandwidth = bandwidth,
          .frequency_shift = bandwidth / 2,
          .input_gain = b0,
          .sample_time = sample_time};
}

// ---- wind-up

struct StepRun {
  std::vector<double> t, y, u, innovation;
  double overshoot = 0;
};

/// A step from rest; the observer, where there is one, starts without knowing the disturbance.
template <class P, class C, class Reference>
StepRun step_run(const P& of, const C& controller, const Reference& step) {
  StepRun run;
  const auto look = [&](const auto& sample, const C& now) {
    run.t.push_back(sample.t);
    run.y.push_back(sample.state(0));
    run.u.push_back(sample.input);
    run.overshoot = std::max(run.overshoot, sample.state(0) - step_size);
    if constexpr (esokit::controller_traits<C>.observes) {
      run.innovation.push_back(now.observer().innovation());
    }
  };
  (void)sim::run(
      of, controller,
      {.duration = 8.0, .sample_time = sample_time, .reference = step, .disturbance = disturbance},
      look)
      .value();
  return run;
}

/// The law on the true states, limited: the best that can be had.
StepRun true_states() {
  const auto law = [](const State& x, const State& r) {
    const double wanted = (100 * (r(0) - x(0)) - 20 * x(1) - disturbance) / gain;
    return std::clamp(wanted, -limit, limit);
  };
  return step_run(open_plant, law, State{step_size, 0});
}

enum class Told { applied, unlimited, nothing_limited };

template <class Observer>
StepRun step_run(const typename Observer::Config& observer, Told told) {
  using C = esokit::Adrc<Observer>;
  typename C::Config config{};
  config.observer = observer;
  config.controller_bandwidth = controller_bandwidth;
  if (told == Told::applied) config.limits = {.lower = -limit, .upper = limit};
  const auto controller = C::make(config).value();
  if (told != Told::unlimited) return step_run(plant, controller, step_size);
  const auto ignorant = [c = controller](double y, double r) mutable {
    return std::clamp(c.update(y, r), -limit, limit);
  };
  return step_run(plant, ignorant, step_size);
}

template <class Observer>
void wind_up(Report& report, const std::string& name, const typename Observer::Config& observer,
             const StepRun& truth, std::vector<CsvRow>& rows, std::vector<StepRun>* shown) {
  const StepRun limited = step_run<Observer>(observer, Told::applied);
  const StepRun free = step_run<Observer>(observer, Told::nothing_limited);
  const StepRun ignorant = step_run<Observer>(observer, Told::unlimited);
  double worst = 0;
  for (std::size_t k = 0; k < limited.innovation.size(); ++k) {
    worst = std::max(worst, std::abs(limited.innovation[k] - free.innovation[k]));
  }
  const double percent = 100 / step_size;
  report.expect(name, "overshoot minus that of the true states (% of the step)",
                percent * (limited.overshoot - truth.overshoot),
                std::abs(limited.overshoot - truth.overshoot) < 0.01 * step_size, "within 1 %");
  report.expect(name, "innovations minus those without limits", worst, worst < 1e-9, "below 1e-9");
  report.expect(name, "overshoot if given the unlimited u (% of the step)",
                percent * ignorant.overshoot,
                ignorant.overshoot > truth.overshoot + 0.1 * step_size, "clearly worse");
  rows.push_back({name, number_text(percent * truth.overshoot, 4),
                  number_text(percent * limited.overshoot, 4), number_text(worst, 2),
                  number_text(percent * ignorant.overshoot, 4)});
  if (shown != nullptr) *shown = {limited, ignorant};
}

// ---- bumps

template <class Observer, class MakeConfig>
void bumps(Report& report, const std::string& name, MakeConfig&& make_config,
           std::vector<CsvRow>& rows) {
  using C = esokit::Adrc<Observer>;
  const auto config = [&](double bandwidth, double b0, double law) {
    typename C::Config all{};
    all.observer = make_config(bandwidth, b0);
    all.controller_bandwidth = law;
    all.limits = {.lower = -limit, .upper = limit};
    return all;
  };
  auto controller = C::make(config(observer_bandwidth, gain, controller_bandwidth)).value();
  State state{0.7, 0};
  /// Goes on from where it is. @return the first u
  const auto drive = [&](double duration, auto reference) {
    const auto end = sim::run(plant, controller,
                              {.duration = duration,
                               .reference = reference,
                               .disturbance = disturbance,
                               .state = state})
                         .value();
    controller = end.controller;
    state = end.state;
    return end.input.front();
  };
  CsvRow row{name};
  const auto note = [&](const char* what, double before) {
    const double bump = std::abs(drive(0.2, 0.7) - before) / (2 * limit);
    report.expect(name, std::string("bump of u at ") + what + " (share of the range)", bump,
                  bump < 1e-9, "below 1e-9");
    row.push_back(number_text(bump, 2));
  };
  (void)controller.start(0.7, steady_input);
  note("switch-on", steady_input);
  // Away and back, so that nothing is exact any more.
  drive(8.0, [](double t) { return t < 2 ? 0.31 : 0.7; });
  controller.retune(config(1.5 * observer_bandwidth, gain, controller_bandwidth)).value();
  note("a change of omega_o", controller.output());
  controller.retune(config(1.5 * observer_bandwidth, 1.4 * gain, controller_bandwidth)).value();
  note("a change of b0", controller.output());
  controller.retune(config(1.5 * observer_bandwidth, 1.4 * gain, 0.5 * controller_bandwidth))
      .value();
  note("a change of omega_c", controller.output());
  rows.push_back(row);
}

// ---- periodic gaps

template <int Order>
auto observer_of(double omega_t) {
  return esokit::LinearEso<Order>::make(
             {.observer_bandwidth = omega_t, .input_gain = 1, .sample_time = 1})
      .value();
}

template <int Order>
double spectral_radius(double omega_t, int every, bool follow) {
  constexpr int size = Order + 1;
  using Chain = esokit::IntegratorChain<Order, double>;
  auto observer = observer_of<Order>(omega_t);
  for (int i = 0; i < (follow ? every : 1); ++i) observer.predict(0);
  observer.correct(1);
  esokit::EigenMatrix<double, size, size> error =
      esokit::EigenMatrix<double, size, size>::Identity();
  for (int i = 0; i < every; ++i) error = Chain::transition_matrix(1.0) * error;
  error -= eigen(observer.estimate() * Chain::output_matrix() * error);
  return compiled::spectral_radius(error);
}

template <int Order>
void gaps(Report& report, std::vector<CsvRow>& rows) {
  for (const double omega_t : {0.1, 1.0, 3.0}) {
    double largest = 0, nominal = 0;
    int diverging = 0;
    for (int every = 1; every <= 20; ++every) {
      if (every <= observer_of<Order>(omega_t).max_gap() + 1) {
        largest = std::max(largest, spectral_radius<Order>(omega_t, every, true));
      }
      const double radius = spectral_radius<Order>(omega_t, every, false);
      nominal = std::max(nominal, radius);
      diverging += radius > 1 ? 1 : 0;
    }
    const std::string name =
        "N = " + std::to_string(Order + 1) + ", omega_o T = " + number_text(omega_t, 2);
    report.expect(name, "largest spectral radius, one correction in 1 to 20", largest, largest < 1,
                  "below 1");
    rows.push_back(
        {name, number_text(largest, 3), number_text(nominal, 4), std::to_string(diverging)});
  }
}

// ---- faults at random

struct Faults {
  double missing = 0, bad = 0, jitter = 0;
};

/// RMS of r - y along a sine, in units of 1e-3.
double tracking_error(const Faults& faults, std::uint64_t seed) {
  constexpr double nominal = 2e-3;
  using Observer = esokit::VariableTime<Linear>;
  auto controller =
      esokit::Adrc<Observer>::make({.observer = {.observer = {.observer_bandwidth = 120,
                                                              .input_gain = gain,
                                                              .sample_time = nominal},
                                                 .ratio = 1.5},
                                    .controller_bandwidth = 20,
                                    .limits = {.lower = -60, .upper = 60}})
          .value();
  esokit::sim::Gaussian noise(seed), draws(seed + 100);
  const auto happens = [&](double share) {
    // Normal numbers through their distribution function: uniform.
    return std::erfc(-draws.next() / std::sqrt(2.0)) / 2 < share;
  };
  const auto reference = [](double t) {
    return esokit::Vector<double, 3>{std::sin(6 * t), 6 * std::cos(6 * t), -36 * std::sin(6 * t)};
  };
  const auto sensor = [&](double, double y) {
    const double measured = y + 2e-4 * noise.next();
    const bool bad = happens(faults.bad), missing = happens(faults.missing);
    return bad || missing ? std::numeric_limits<double>::quiet_NaN() : measured;
  };
  const auto step_time = [&](std::int64_t) {
    const double uniform = std::erfc(-draws.next() / std::sqrt(2.0)) - 1;
    return nominal * (1 + faults.jitter * uniform);
  };
  const auto run =
      sim::run(plant, controller,
               {.duration = 10000 * nominal,
                .reference = reference,
                .disturbance = [](double t) { return disturbance + 2 * gain * std::sin(9 * t); },
                .sensor = sensor,
                .step_time = step_time,
                .substeps = 5})
          .value();
  double sum = 0, time = 0;
  for (std::size_t k = 1; k < run.t.size(); ++k) {
    if (run.t[k] <= 2) continue;
    const double passed = run.t[k] - run.t[k - 1], error = run.reference[k] - run.output[k];
    sum += error * error * passed;
    time += passed;
  }
  return 1e3 * std::sqrt(sum / time);
}

/// Two runs in two panels, the first thin in red; the legend is in the upper one.
template <class Run>
void draw_pair(Panel& upper, Panel& lower, std::vector<double> Run::*above,
               std::vector<double> Run::*below, const char* name, const Run& run,
               const char* other_name, const Run& other) {
  const auto draw = [&](const Run& one, Style style) {
    upper.line(one.t, one.*above, style);
    style.name.clear();
    lower.line(one.t, one.*below, style);
  };
  draw(run, {.name = name, .color = Color::vermillion, .width = 1.3});
  draw(other, {.name = other_name, .color = Color::blue, .width = 2.4});
}

// ---- a pause of the loop

struct Paused {
  std::vector<double> t, disturbance, error;
  double largest = 0;  ///< abs(dhat - d) from the pause on
};

/// An axis at constant speed; the loop stands still for 20 samples, while u is held. Either it says
/// how much time has passed, or a time that is no step of the observer is left out.
Paused paused(bool says) {
  constexpr double speed = 5, begin = 0.5, end = 0.75;
  using Timed = esokit::Adrc<esokit::VariableTime<Linear>>;
  auto controller = Timed::make({.observer = {.observer = linear(), .ratio = 4},
                                 .controller_bandwidth = controller_bandwidth})
                        .value();
  Paused run;
  State x(0, speed);
  (void)controller.start(0, steady_input);
  double u = steady_input, t = 0;
  for (int k = 0; t < end; ++k) {
    const double dt = k == 600 ? 20 * sample_time : sample_time;
    const double a = disturbance + gain * u;
    x = State(x(0) + dt * x(1) + dt * dt / 2 * a, x(1) + dt * a);
    t += dt;
    if (says ? controller.elapsed(dt) : controller.set_step_time(dt)) {
      u = controller.update(x(0), {speed * t, speed});
    }
    const double off = controller.observer().total_disturbance() - disturbance;
    if (k >= 600) run.largest = std::max(run.largest, std::abs(off));
    if (t < begin) continue;
    run.t.push_back(t);
    run.disturbance.push_back(disturbance + off);
    run.error.push_back(1e3 * (speed * t - x(0)));
  }
  return run;
}

void pause(Report& report) {
  const Paused lost = paused(false), said = paused(true);
  report.expect("a pause of 20 samples, elapsed", "largest abs(dhat - d) after it", said.largest,
                said.largest < 1e-3, "below 1e-3");
  report.expect("a pause of 20 samples, left out", "largest abs(dhat - d) after it", lost.largest,
                lost.largest > 30, "above 30");
  Figure figure("pause", {.rows = 2, .columns = 1, .panel_height = 150});
  figure.caption(
      "An axis at constant speed; the loop pauses for 20 samples while u is held. If the observer "
      "is not given that time, it takes the way of the axis for a load.");
  auto& disturbances =
      figure.panel(0, 0).y_label("disturbance (1/s2)").legend(Legend::above).x_range(0.5, 0.75);
  auto& errors = figure.panel(1, 0).x_label("t (s)").y_label("r - y (1e-3)").x_range(0.5, 0.75);
  disturbances.name("estimate");
  errors.name("error");
  draw_pair(disturbances, errors, &Paused::disturbance, &Paused::error, "pause left out", lost,
            "elapsed", said);
  report.add(figure);
}

// ---- stiction and an encoder

constexpr double encoder_count = 2 * 3.14159265358979324 / 4096;

struct Hunt {
  std::vector<double> t, error, input;
  double way = 0;  ///< counts gone in the last 10 s
};

/// y'' = 50 u minus friction: it sticks up to 60 rad/s2, and brakes with 20 rad/s2 once it moves.
Hunt hunt(const esokit::Rest<double>& rest) {
  constexpr double r = 0.9995, stick = 60, coulomb = 20, viscous = 3, b0 = 50;
  constexpr int parts = 20;
  auto controller = esokit::Resting<esokit::Adrc<Linear>>::make(
                        {.controller = {.observer = linear(150, b0),
                                        .controller_bandwidth = 20,
                                        .limits = {.lower = -12, .upper = 12}},
                         .rest = rest})
                        .value();
  Hunt run;
  double x = 0, v = 0;
  for (int k = 0; k < 20000; ++k) {
    const double u = controller.update(encoder_count * std::round(x / encoder_count), r);
    const double before = x;
    for (int i = 0; i < parts; ++i) {
      const bool stands = !(std::abs(v) > 0);
      if (stands && std::abs(b0 * u) <= stick) continue;
      const double sign = std::copysign(1.0, stands ? u : v);
      const double next = v + sample_time / parts * (b0 * u - coulomb * sign - viscous * v);
      v = v * next < 0 ? 0 : next;
      x += sample_time / parts * v;
    }
    if (k < 10000) continue;
    run.way += std::abs(x - before) / encoder_count;
    run.t.push_back(k * sample_time);
    run.error.push_back((r - x) / encoder_count);
    run.input.push_back(u);
  }
  return run;
}

void rests(Report& report) {
  const Hunt plain = hunt({}), resting = hunt({.error = 1.5 * encoder_count, .time = 0.25});
  report.expect("stiction and an encoder", "counts gone in 10 s at a reference that stands",
                plain.way, plain.way > 100, "above 100");
  report.expect("stiction and an encoder, rest", "counts gone in 10 s at a reference that stands",
                resting.way, resting.way < 1e-9, "0");
  Figure figure("rest", {.rows = 2, .columns = 1, .panel_height = 150});
  figure.caption(
      "An axis with stiction and an encoder at a reference that stands: without rest a "
      "limit cycle, with it the loop holds u.");
  auto& errors = figure.panel(0, 0).y_label("r - y (counts)").legend(Legend::above).x_range(10, 20);
  auto& inputs = figure.panel(1, 0).x_label("t (s)").y_label("u (V)").x_range(10, 20);
  errors.name("error");
  inputs.name("input");
  draw_pair(errors, inputs, &Hunt::error, &Hunt::input, "Adrc", plain, "rest", resting);
  report.add(figure);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "limits_and_gaps",
                about("Limits, start-up, retuning, lost samples",
                      "A double integrator that is known exactly, so that every deviation is "
                      "caused by the controller. Sampled observers."));

  const StepRun truth = true_states();
  std::vector<CsvRow> rows;
  std::vector<StepRun> shown;
  wind_up<Linear>(report, "LESO", linear(), truth, rows, &shown);
  wind_up<Cascade>(report, "cascade", cascade(), truth, rows, nullptr);
  wind_up<Algebraic>(report, "algebraic", algebraic(), truth, rows, nullptr);
  report.table("windup", "A step of 10 with |u| limited to 3: overshoot in % of the step",
               {"observer", "law on the true states", "ADRC, observer gets the applied u",
                "change of its innovations by the limits", "ADRC, observer gets the unlimited u"},
               rows);
  Figure figure("windup", {.rows = 2, .columns = 1, .panel_height = 200});
  figure.caption(
      "A step of 10 with |u| limited to 3. If the observer gets the applied input, the loop "
      "behaves as if the control law knew the true states; the overshoot is then caused by the "
      "saturation alone.");
  auto& output = figure.panel(0, 0).y_label("y (-)").legend(Legend::above).x_range(0, 8);
  auto& input = figure.panel(1, 0).x_label("t (s)").y_label("u (-)").x_range(0, 8).y_range(-4, 4);
  output.name("output");
  input.name("input");
  const auto draw = [&](const StepRun& run, Style style) {
    output.line(run.t, run.y, style);
    style.name.clear();
    input.line(run.t, run.u, style);
  };
  draw(shown[1], {.name = "gets the unlimited u", .color = Color::vermillion, .width = 1.3});
  draw(shown[0], {.name = "ADRC", .color = Color::blue, .width = 2.4});
  draw(truth, {.name = "true states", .color = Color::black, .dash = Dash::dashed, .width = 1.3});
  report.add(figure);

  rows.clear();
  bumps<Linear>(report, "LESO", linear, rows);
  bumps<Cascade>(report, "cascade", cascade, rows);
  bumps<Algebraic>(report, "algebraic", algebraic, rows);
  report.table("bumps", "Step of u in the steady state, divided by the range of u",
               {"observer", "switch-on", "omega_o times 1.5", "b0 times 1.4", "omega_c halved"},
               rows);

  rows.clear();
  gaps<1>(report, rows);
  gaps<2>(report, rows);
  gaps<3>(report, rows);
  gaps<4>(report, rows);
  report.table("gaps",
               "One measurement in M samples, M = 1 to 20: largest spectral radius of the "
               "estimation error with the gain for M T, and with the gain for T, as in most code",
               {"observer", "gain for M T", "gain for T", "patterns of 20 that diverge with it"},
               rows);

  rows.clear();
  const auto fault_case = [&](const char* name, const Faults& faults) {
    std::vector<double> errors;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) errors.push_back(tracking_error(faults, seed));
    return std::pair(std::string(name), statistics(errors));
  };
  const auto clean = fault_case("no faults", {});
  const std::vector<std::pair<std::string, Statistics>> cases = {
      clean, fault_case("10 % of the samples missing", {.missing = 0.1}),
      fault_case("1 % NaN", {.bad = 0.01}),
      fault_case("sample time jitters by 20 %", {.jitter = 0.2}),
      fault_case("all of it", {.missing = 0.1, .bad = 0.01, .jitter = 0.2})};
  for (const auto& [name, error] : cases) {
    const double ratio = error.mean / clean.second.mean;
    report.expect(name, "RMS tracking error (1e-3)", error, ratio < 1.5, "below 1.5 of no faults");
    rows.push_back(
        {name, number_text(error.mean, 4) + " (" + number_text(error.standard_deviation, 2) + ")",
         number_text(ratio, 4)});
  }
  report.table("faults",
               "Sine as the reference and as the disturbance, T = 2 ms, noise on y: RMS tracking "
               "error in 1e-3, mean (standard deviation) over 20 seeds",
               {"case", "RMS error", "ratio"}, rows);
  pause(report);
  rests(report);
  return report.finish();
}
