// A servo with friction, saturation, sensor dropouts, NaN bursts, a load step and a retune while it
// runs: PID with anti-windup, and ADRC with three observers, side by side.
//
// Way: sampled. Each controller runs once a sample; the plant is integrated in between.
//
// Plant       theta'' = a u - b theta' - c tanh(theta' / w_s) - load(t),  |u| <= u_max,
//             y = theta, quantised by the encoder, with noise
// Controllers u = (v - dhat) / b0 with b0 below the true a by a fifth;
//             PID: the gains that the LESO's ADRC has as a PID (tune/pid_conversion.hpp)
//
// symbol    code               value       unit
// a         true_gain          80          rad/s2 per V
// b         viscous            1.2         1/s
// c         coulomb            8           rad/s2
// w_s       stribeck           0.05        rad/s
// load      load               60          rad/s2, from 2.5 s to 5 s
// u_max     limit              5           V
// b0        nominal_gain       64          rad/s2 per V
// T         sample_time        1e-3        s
// omega_c   controller         25          rad/s
// omega_o   observer           150         rad/s; 220 from 3.2 s on
//
// Time line: steps of the reference at 0.1 s and 1.3 s, load step at 2.5 s, retune at 3.2 s. 10 %
// of the samples are lost from 3.6 s to 4.6 s with a gap of 40 ms at 4 s, 5 % NaN from 4.6 s to 5
// s.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/tune/pid_conversion.hpp>

#include "common/report.hpp"
#include "control_practice/pid.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;
using namespace practice;

namespace {

constexpr double true_gain = 80;
constexpr double viscous = 1.2;
constexpr double coulomb = 8;
constexpr double stribeck = 0.05;
constexpr double load_size = 60;
constexpr double limit = 5;
constexpr double nominal_gain = 64;
constexpr double sample_time = 1e-3;
constexpr double controller = 25;
constexpr double observer = 150;
constexpr double faster_observer = 220;
constexpr double encoder = 2 * 3.14159265358979 / 16384;
constexpr double noise = 1e-4;
constexpr int substeps = 4;
constexpr int seeds = 20;
constexpr int retune_sample = 3200;

using Reference = esokit::Vector<double, 3>;  ///< (r, r', r'')

Reference reference(double t) {
  if (t < 0.1) return {0, 0, 0};
  if (t < 1.3) return {1.5, 0, 0};
  if (t < 3.5) return {-0.5, 0, 0};
  const double phase = 9 * (t - 3.5);
  return {-0.5 + 0.4 * std::sin(phase), 3.6 * std::cos(phase), -32.4 * std::sin(phase)};
}
double load(double t) { return t >= 2.5 && t < 5.0 ? -load_size / true_gain : 0.0; }  // of u

/// Which measurements come, the same for all controllers.
class Sensor {
 public:
  Sensor(std::uint64_t seed, bool faulty) : noise_(seed), faults_(seed + 1000), faulty_(faulty) {}

  double operator()(double t, double angle) {
    const double exact = angle + noise * noise_.next();
    const double draw = faults_.next();  // normal: |draw| > 1.645 in 10 %, > 1.96 in 5 %
    const bool lost = (t >= 3.6 && t < 4.6 && std::abs(draw) > 1.645) || (t >= 4.0 && t < 4.04);
    const bool bad = t >= 4.6 && t < 5.0 && std::abs(draw) > 1.96;
    if (faulty_ && (lost || bad)) return std::numeric_limits<double>::quiet_NaN();
    return encoder * std::round(exact / encoder);
  }

 private:
  esokit::sim::Gaussian noise_, faults_;
  bool faulty_;
};

struct Run {
  std::vector<double> t, angle, input, found;
  double first_overshoot = 0;  ///< of the step at 0.1 s, % of it
  double load_error = 0;       ///< largest |r - theta| in 2.5 .. 3.2 s
  double step_error = 0;       ///< integral of |r - theta| to 2.5 s
  double fault_error = 0;      ///< RMS of what the faults change of theta, 3.6 .. 5 s
  double activity = 0;         ///< RMS of the change of u a sample, 2 .. 2.4 s
  double retune_bump = 0;      ///< change of u at the retune, V
};

/// One controller as the run sees it.
struct Controller {
  static constexpr int order = 2;
  static constexpr esokit::ControllerTraits traits{.takes_derivatives = true};

  std::string name;
  std::function<double(double, const Reference&)> command;
  std::function<void()> retune;
  std::function<double()> disturbance;

  double update(double y, const Reference& r) { return command(y, r); }
  double update(double y, double r) { return command(y, {r, 0, 0}); }
};

template <class Observer>
Controller adrc(std::string name, std::function<typename Observer::Config(double)> config) {
  using C = esokit::Adrc<Observer>;
  const auto settings = [config](double bandwidth) {
    typename C::Config all{};
    all.observer = config(bandwidth);
    all.controller_bandwidth = controller;
    all.domain = esokit::TimeDomain::sampled;
    all.limits = {.lower = -limit, .upper = limit};
    all.missing = {.most = 100, .input = 0.0};
    return all;
  };
  auto shared = std::make_shared<C>(C::make(settings(observer)).value());
  return {std::move(name), [shared](double y, const Reference& r) { return shared->update(y, r); },
          [shared, settings] { shared->retune(settings(faster_observer)).value(); },
          [shared] { return shared->observer().total_disturbance(); }};
}

std::vector<Controller> controllers() {
  std::vector<Controller> all;
  const auto gains =
      esokit::pid_from_adrc<2>(esokit::AdrcTuning<double>{nominal_gain, controller, observer})
          .value();
  auto pid = std::make_shared<Pid>(Pid::Config{.proportional = gains.proportional,
                                               .integral = gains.integral,
                                               .derivative = gains.derivative,
                                               .derivative_filter = gains.filter_time,
                                               .lower = -limit,
                                               .upper = limit,
                                               .sample_time = sample_time});
  all.push_back({"PID", [pid](double y, const Reference& r) { return pid->update(y, r(0)); }, [] {},
                 [] { return std::numeric_limits<double>::quiet_NaN(); }});
  all.push_back(adrc<esokit::LinearEso<2>>("LESO", [](double bandwidth) {
    return esokit::LinearEso<2>::Config{
        .observer_bandwidth = bandwidth, .input_gain = nominal_gain, .sample_time = sample_time};
  }));
  all.push_back(adrc<esokit::CascadeEso<2, 2>>("cascade", [](double bandwidth) {
    return esokit::CascadeEso<2, 2>::Config{.observer_bandwidth = bandwidth / 2,
                                            .bandwidth_factor = 3,
                                            .input_gain = nominal_gain,
                                            .sample_time = sample_time};
  }));
  all.push_back(adrc<esokit::AlgebraicEso<2>>("algebraic", [](double bandwidth) {
    return esokit::AlgebraicEso<2>::Config{.observer_bandwidth = bandwidth,
                                           .frequency_shift = bandwidth,
                                           .input_gain = nominal_gain,
                                           .sample_time = sample_time,
                                           .measurement_noise = 2e-4,
                                           .disturbance_noise = 50};
  }));
  return all;
}

/// The servo but for the load, which comes in as a disturbance of the voltage.
const auto plant =
    esokit::sim::nonlinear_plant<2>([](double, const esokit::Vector<double, 2>& x, double u) {
      return esokit::Vector<double, 2>{
          x(1), true_gain * u - viscous * x(1) - coulomb * std::tanh(x(1) / stribeck)};
    });

/// @param clean the same run without faults; nullptr: this is it
Run simulate(const Controller& driven, std::uint64_t seed, const Run* clean = nullptr) {
  Run run;
  Sensor sensor(seed, clean != nullptr);
  double last = 0, activity = 0, squares = 0;
  int active = 0, faulty = 0;
  const auto look = [&](const auto& sample, Controller& c) {
    const double t = sample.t, angle = sample.output, u = sample.input;
    if (sample.index + 1 == retune_sample) c.retune();
    if (sample.index == retune_sample) run.retune_bump = std::abs(u - last);
    run.t.push_back(t);
    run.angle.push_back(angle);
    run.input.push_back(u);
    run.found.push_back(c.disturbance());
    const double error = std::abs(sample.reference - angle);
    if (t < 1.3) run.first_overshoot = std::max(run.first_overshoot, 100 * (angle / 1.5 - 1));
    if (t < 2.5) run.step_error += error * sample_time;
    if (t >= 2.5 && t < 3.2) run.load_error = std::max(run.load_error, error);
    if (t >= 2.0 && t < 2.4) {
      activity += (u - last) * (u - last);
      ++active;
    }
    if (clean != nullptr && t >= 3.6 && t < 5.0) {
      const double change = angle - clean->angle[static_cast<std::size_t>(sample.index)];
      squares += change * change;
      ++faulty;
    }
    last = u;
  };
  (void)esokit::sim::run(plant, driven,
                         {.duration = 6.0,
                          .sample_time = sample_time,
                          .reference = reference,
                          .disturbance = load,
                          .sensor = std::ref(sensor),
                          .substeps = substeps},
                         look)
      .value();
  run.activity = std::sqrt(activity / active);
  if (faulty > 0) run.fault_error = std::sqrt(squares / faulty);
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, folder, "servo",
      about("A servo with friction, saturation and lost samples",
            "Friction, saturation, a load step, retuning while the loop runs, lost samples and "
            "NaN: a PID with anti-windup compared with ADRC with three observers. Sampled at 1 ms; "
            "mean and standard deviation over 20 seeds of noise and faults."));
  std::vector<Run> first;
  std::vector<std::string> names;
  for (const Controller& c : controllers()) names.push_back(c.name);
  constexpr std::array colors = {Color::grey, Color::blue, Color::vermillion, Color::green};
  std::vector<Statistics> fault_errors;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::vector<Run> runs;
    for (int seed = 1; seed <= seeds; ++seed) {
      const auto number = static_cast<std::uint64_t>(seed);
      const Run clean = simulate(controllers()[i], number);
      runs.push_back(simulate(controllers()[i], number, &clean));
    }
    const auto of = [&](auto member) { return statistics_of(runs, member); };
    report.check(names[i], "overshoot (% of the step)", std::nullopt, of(&Run::first_overshoot));
    report.check(names[i], "int |e| dt to 2.5 s (rad s)", std::nullopt, of(&Run::step_error));
    report.check(names[i], "peak error after load (mrad)", std::nullopt,
                 statistics_of(runs, [](const Run& run) { return 1e3 * run.load_error; }));
    report.check(names[i], "change by faults, RMS (mrad)", std::nullopt,
                 statistics_of(runs, [](const Run& run) { return 1e3 * run.fault_error; }));
    report.check(names[i], "RMS change of u a sample (mV)", std::nullopt,
                 statistics_of(runs, [](const Run& run) { return 1e3 * run.activity; }));
    report.check(names[i], "change of u at the retune (mV)", std::nullopt,
                 statistics_of(runs, [](const Run& run) { return 1e3 * run.retune_bump; }));
    fault_errors.push_back(of(&Run::fault_error));
    first.push_back(std::move(runs.front()));
  }
  for (std::size_t i = 1; i < names.size(); ++i) {
    report.expect(names[i], "faults cost less than with the PID (ratio)",
                  fault_errors[i].mean / fault_errors[0].mean,
                  fault_errors[i].mean < fault_errors[0].mean, "below 1");
  }
  report.comparison("table", "The controllers compared, mean (standard deviation) over 20 seeds",
                    names,
                    {"overshoot (% of the step)", "int |e| dt to 2.5 s (rad s)",
                     "peak error after load (mrad)", "change by faults, RMS (mrad)",
                     "RMS change of u a sample (mV)", "change of u at the retune (mV)"});

  Figure figure("servo", {.rows = 4, .columns = 2, .panel_height = 165});
  figure.caption(
      "Top: angle. Second row: the first step enlarged, and the error after the load step at 2.5 "
      "s. Third row: error and motor voltage while following a sine with lost samples (3.6 to 4.6 "
      "s, with a gap of 40 ms at 4 s) and NaN (4.6 to 5 s); the load is removed at 5 s. Bottom: "
      "the total disturbance, that is, friction and load, as the observers estimate it.");
  auto& angle = figure.panel(0, 0, 1, 2)
                    .y_label("angle (rad)")
                    .x_range(0, 6)
                    .legend(Legend::above)
                    .name("angle");
  auto& step = figure.panel(1, 0).y_label("angle (rad)").x_range(0.1, 0.7).y_range(1.2, 1.65);
  auto& load_error = figure.panel(1, 1).y_label("error (mrad)").x_range(2.4, 3.2).y_range(-5, 20);
  auto& error = figure.panel(2, 0)
                    .x_label("t (s)")
                    .y_label("error (mrad)")
                    .x_range(3.4, 5.4)
                    .y_range(-150, 250);
  auto& input =
      figure.panel(2, 1).x_label("t (s)").y_label("u (V)").x_range(3.4, 5.4).y_range(-6, 6);
  auto& found = figure.panel(3, 0, 1, 2)
                    .y_label("d (rad/s^2)")
                    .y_range(-120, 120)
                    .x_range(0, 6)
                    .x_label("t (s)");
  step.name("step");
  load_error.name("load_error");
  error.name("error");
  input.name("input");
  found.name("disturbance");
  std::vector<double> wanted;
  for (const double t : first[0].t) wanted.push_back(reference(t)(0));
  angle.line(first[0].t, wanted,
             {.name = "reference", .color = Color::black, .dash = Dash::dashed});
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Style style{.name = names[i],
                      .color = colors[i],
                      .dash = i == 3 ? Dash::dashed : Dash::solid,
                      .width = i == 1 ? 2.4 : 1.2};
    Style quiet = style;
    quiet.name.clear();
    std::vector<double> e;
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      e.push_back(1e3 * (wanted[k] - first[i].angle[k]));
    }
    angle.line(first[i].t, first[i].angle, style);
    step.line(first[i].t, first[i].angle, quiet);
    load_error.line(first[i].t, e, quiet);
    error.line(first[i].t, e, quiet);
    input.line(first[i].t, first[i].input, quiet);
    if (i > 0) found.line(first[i].t, first[i].found, quiet);
  }
  report.add(figure);

  // For the front page: the same runs, PID and LESO alone.
  Figure why("pid_or_adrc", {.rows = 1, .columns = 2, .panel_height = 190});
  why.caption(
      "A PID, and an ADRC that reacts to a load in the same way. Left: a step that saturates the "
      "motor. Right: error while following a sine, with lost samples, a gap of 40 ms, NaN, and the "
      "load being removed.");
  auto& reached = why.panel(0, 0)
                      .x_label("t (s)")
                      .y_label("angle (rad)")
                      .x_range(0.05, 0.7)
                      .y_range(0, 1.75)
                      .legend(Legend::bottom_right)
                      .name("step");
  auto& followed = why.panel(0, 1)
                       .x_label("t (s)")
                       .y_label("error (mrad)")
                       .x_range(3.4, 5.4)
                       .y_range(-150, 250)
                       .name("error");
  reached.line(first[0].t, wanted,
               {.name = "reference", .color = Color::black, .dash = Dash::dashed});
  for (std::size_t i = 0; i < 2; ++i) {
    const Style style{
        .name = i == 0 ? "PID" : "ADRC with a LESO", .color = colors[i], .width = 1.8};
    std::vector<double> e;
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      e.push_back(1e3 * (wanted[k] - first[i].angle[k]));
    }
    reached.line(first[i].t, first[i].angle, style);
    followed.line(first[i].t, e, {.color = colors[i], .width = 1.8});
  }
  report.add(why);
  report.remark(
      "The PID has the gains that correspond to the ADRC with LESO, so both react to slow signals "
      "in the same way. If a sample is missing, the PID holds the last one; the observers predict, "
      "and then correct with the gain that belongs to the length of the gap. The ADRC is also "
      "given the derivatives of the sine, which this PID cannot use.");
  report.remark(
      "The PID is not retuned: its change of u at 3.2 s is noise, and so is most of the change of "
      "the others (in the steady state without noise it is 1e-14, see limits_and_gaps). Once its "
      "bandwidth has fallen, the algebraic observer equals the LESO.");
  return report.finish();
}
