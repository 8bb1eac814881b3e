/// @file
/// What the examples of this paper share: its name, Table 1's plant and observers, the runs of the
/// generic example, with these observers or with yours, and its figure.
///
/// K. Lakomy, R. Madonski, "Cascade extended state observer for active disturbance rejection
/// control applications under measurement noise", ISA Transactions 109 (2021) 1-10,
/// doi:10.1016/j.isatra.2020.09.007.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/sim/continuous_observer.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/sim/closed_loop.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/signals.hpp>
#include <esokit/sim/trapezoid.hpp>

#include "common/report.hpp"

namespace paper1 {

using esokit::EigenMatrix;
namespace sim = esokit::sim;

inline const std::string folder = "paper1_cascade_eso";

inline esokit::examples::About about(std::string title, std::string description, int order,
                                     bool addition = false) {
  return {.paper_title = "Cascade extended state observer",
          .citation =
              "K. Lakomy, R. Madonski, Cascade extended state observer for active disturbance "
              "rejection control applications under measurement noise, ISA Transactions 109 (2021) "
              "1-10",
          .link = "https://doi.org/10.1016/j.isatra.2020.09.007",
          .title = std::move(title),
          .description = std::move(description),
          .order = order,
          .addition = addition};
}

/// Names of the levels p = 1, 2, 3; p = 1 is the standard ESO.
inline const std::array<std::string, 3> level_names = {"p = 1", "p = 2", "p = 3"};

// ---- the generic example, Sim1A and Sim1B ----

inline constexpr double duration = 5.0;                                 // T, s
inline constexpr double nominal_gain = 1.0;                             // ghat
inline constexpr double noise_power = 1e-9;                             // of Sim1B
inline constexpr double noise_hold = 0.01;                              // s
inline constexpr double level_factor = 2.0;                             // alpha
inline constexpr std::array<double, 3> table1 = {250.0, 60.82, 33.98};  // omega_o1, rad/s

/// A function of time, kept at the half steps of 1 ms, the same in every run, and computed
/// elsewhere.
template <class Function>
class Kept {
 public:
  explicit Kept(Function function) : function_(function) {
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      const double t = static_cast<double>(i / 2) * 1e-3 + (i % 2 == 0 ? 0.0 : 0.5e-3);
      kept_[i] = {t, function_(t)};
    }
  }
  double operator()(double t) const noexcept {
    const auto i = static_cast<std::size_t>(t * 2e3 + 0.5);
    return i < kept_.size() && kept_[i].t == t ? kept_[i].value : function_(t);
  }

 private:
  struct Point {
    double t, value;
  };
  Function function_;
  std::vector<Point> kept_ = std::vector<Point>(10001);
};

/// x1' = x2,  x2' = -x1 - 2 x2 + g u + d,  g = (1 + 0.2 tanh(t - 2)) / (|x1| + 1), where d is g d*
/// (what reproduces the paper's numbers) or d* (what its text says), d* = 5 sin(9 t) from 3.5 s.
class GenericPlant {
 public:
  static constexpr int states = 2;
  using State = EigenMatrix<double, 2>;

  enum class Disturbance { through_gain, beside_gain };

  explicit GenericPlant(Disturbance where = Disturbance::through_gain) : where_(where) {}

  State derivative(double t, const State& x, double u) const noexcept {
    return {x(1), acceleration(t, x, u)};
  }
  double output(double, const State& x) const noexcept { return x(0); }

  double acceleration(double t, const State& x, double u) const noexcept {
    static const Kept gain([](double time) { return 1.0 + 0.2 * std::tanh(time - 2.0); });
    static const Kept disturbance(
        [](double time) { return time >= 3.5 ? 5.0 * std::sin(9.0 * time) : 0.0; });
    const double g = gain(t) / (std::abs(x(0)) + 1.0);
    const double external = disturbance(t);
    const double d = where_ == Disturbance::through_gain ? g * external : external;
    return -x(0) - 2.0 * x(1) + g * u + d;
  }

 private:
  Disturbance where_;
};

/// The variants of the set-up that the paper's text and its numbers speak of.
struct Setup {
  bool error_based = true;  ///< observer driven by y_d - y; false: by y
  double step_time = 0.2;   ///< of the reference, s
  GenericPlant::Disturbance disturbance = GenericPlant::Disturbance::through_gain;
};

/// The reference of Sim1.
struct Reference : sim::FilteredStep<5> {
  std::shared_ptr<const Kept<sim::FilteredStep<5>>> kept;  ///< its values

  double operator()(double t) const noexcept { return (*kept)(t); }
};

inline Reference reference(double step_time) {
  const auto make = [](double time) {
    const auto step =
        sim::FilteredStep<5>::make({.time = time, .size = 1.0, .time_constant = 0.1}).value();
    return Reference{step, std::make_shared<const Kept<sim::FilteredStep<5>>>(step)};
  };
  static const Reference standard = make(0.2);
  return step_time == 0.2 ? standard : make(step_time);
}

/// The noise of Sim1B; power 0 is Sim1A.
inline sim::HeldNoise<> measurement_noise(double power, double step, std::uint64_t seed) {
  return sim::HeldNoise<>::make({.power = power, .hold = noise_hold, .step = step, .seed = seed})
      .value();
}

/// The criteria of Tables 2.
struct Criteria {
  double error = 0.0;     ///< 1e3 int |e| dt
  double control = 0.0;   ///< int u^2 dt
  double estimate = 0.0;  ///< int |z3 error| dt
};

/// The signals of Figs 3 and 4.
struct Series {
  std::vector<double> t, reference, output, error, control;
  std::vector<double> output_estimate_error;  ///< z1 error
  std::vector<double> estimate_error;         ///< z3 error
};

/// A curve of Figs 3 and 4.
struct NamedSeries {
  std::string name;
  Series series;
};

/// Adds up the criteria over a run, and keeps the signals if asked to.
class Meter {
 public:
  explicit Meter(Series* series = nullptr) : series_(series) {}

  void add(double t, double y_d, double y, double measured_error, double u, double z1_error,
           double z3_error) {
    error_.add(t, std::abs(measured_error));
    control_.add(t, u * u);
    estimate_.add(t, std::abs(z3_error));
    if (series_ == nullptr) return;
    series_->t.push_back(t);
    series_->reference.push_back(y_d);
    series_->output.push_back(y);
    series_->error.push_back(measured_error);
    series_->control.push_back(u);
    series_->output_estimate_error.push_back(z1_error);
    series_->estimate_error.push_back(z3_error);
  }

  Criteria criteria() const { return {1e3 * error_.value(), control_.value(), estimate_.value()}; }

 private:
  Series* series_;
  sim::Trapezoid<> error_, control_, estimate_;
};

/// One run of Sim1 as a continuous simulation, with any observer of order 2 with one extended
/// state: one of esokit/sim/continuous_observer.hpp, or a class of your own with the members that
/// ContinuousObserverModel names. Unless the set-up says otherwise it is driven by y_d - y, so its
/// input gain is -nominal_gain.
template <sim::ContinuousObserverModel Observer>
Criteria run_generic(const Observer& observer, double power, std::uint64_t seed,
                     const Setup& setup = {}, Series* series = nullptr, double step = 1e-3) {
  const GenericPlant plant(setup.disturbance);
  const auto y_d = reference(setup.step_time);
  const auto law =
      esokit::AdrcLaw<2>::make({.controller_bandwidth = 2.0, .input_gain = nominal_gain})
          .value();  // gains 4, 4
  const auto noise = measurement_noise(power, step, seed);

  Meter meter(series);
  const auto record = [&](const auto& sample) {
    const auto r = y_d.template derivatives<3>(sample.t);
    const double acceleration = plant.acceleration(sample.t, sample.plant_state, sample.input);
    // What the disturbance of the observer's chain is: e'' = D - ghat u, or y'' = D + ghat u.
    const double total = setup.error_based ? r[2] - acceleration + nominal_gain * sample.input
                                           : acceleration - nominal_gain * sample.input;
    const double error = setup.error_based ? sample.measurement : r[0] - sample.measurement;
    const double first = setup.error_based ? r[0] - sample.output : sample.output;
    meter.add(sample.t, r[0], sample.output, error, sample.input, first - sample.estimate(0),
              total - sample.estimate(2));
  };
  if (setup.error_based) {
    const sim::ContinuousLoop loop{
        plant, observer,
        [&law](double, const EigenMatrix<double, 3>& e) { return law.control_error_based(e); },
        sim::MeasuredError{y_d}, noise};
    (void)loop.run({.duration = duration, .step = step}, record).value();
  } else {
    const sim::ContinuousLoop loop{plant, observer,
                                   [&](double t, const EigenMatrix<double, 3>& z) {
                                     const auto r = y_d.template derivatives<3>(t);
                                     return law.control(z,
                                                        EigenMatrix<double, 3>(r[0], r[1], r[2]));
                                   },
                                   sim::MeasuredOutput{}, noise};
    (void)loop.run({.duration = duration, .step = step}, record).value();
  }
  return meter.criteria();
}

/// The same with a cascade of `Levels` levels, the first one at `bandwidth`.
template <int Levels>
Criteria run_generic(double bandwidth, double power, std::uint64_t seed, const Setup& setup = {},
                     Series* series = nullptr, double step = 1e-3) {
  typename esokit::ContinuousCascadeEso<2, Levels>::Config config{
      .observer_bandwidth = bandwidth,
      .input_gain = setup.error_based ? -nominal_gain : nominal_gain};
  if (Levels > 1) config.bandwidth_factor = level_factor;
  const auto observer = esokit::ContinuousCascadeEso<2, Levels>::make(config).value();
  return run_generic(observer, power, seed, setup, series, step);
}

/// The same with the number of levels chosen at run time, 1 to 3.
inline Criteria run_generic(int levels, double bandwidth, double power, std::uint64_t seed,
                            const Setup& setup = {}, Series* series = nullptr, double step = 1e-3) {
  if (levels == 1) return run_generic<1>(bandwidth, power, seed, setup, series, step);
  if (levels == 2) return run_generic<2>(bandwidth, power, seed, setup, series, step);
  return run_generic<3>(bandwidth, power, seed, setup, series, step);
}

/// The curves of Fig 3 (power 0) or Fig 4 (noise_power, seed 1): p = 1, 2, 3 at Table 1.
inline std::vector<NamedSeries> paper_runs(double power) {
  std::vector<NamedSeries> runs;
  for (std::size_t p = 0; p < 3; ++p) {
    runs.push_back({level_names[p], {}});
    (void)run_generic(static_cast<int>(p) + 1, table1[p], power, 1, {}, &runs.back().series);
  }
  return runs;
}

/// Figs 3 and 4: output, tracking error, errors of the first and the last estimate, control.
inline esokit::examples::Figure draw(const std::string& name, const std::string& caption,
                                     const std::vector<NamedSeries>& runs, bool noisy) {
  using namespace esokit::examples;
  Figure figure(name, {.rows = 3, .columns = 2, .panel_height = 190});
  figure.caption(caption);
  auto& output = figure.panel(0, 0).y_label("y_d, y (-)").name("output");
  auto& error = figure.panel(0, 1).y_label("e = y_d − y (-)").name("error");
  auto& first = figure.panel(1, 0).y_label("z_1 error (-)").name("output_estimate_error");
  auto& estimate = figure.panel(1, 1).y_label("z_3 error (-)").name("disturbance_error");
  auto& control = figure.panel(2, 0, 1, 2).y_label("u (-)").name("control");
  output.line(runs.front().series.t, runs.front().series.reference,
              {.name = "y_d", .color = Color::black, .dash = Dash::dashed});
  constexpr std::array colors = {Color::blue, Color::vermillion, Color::green, Color::purple,
                                 Color::orange};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Series& run = runs[i].series;
    const Style style{
        .name = runs[i].name, .color = colors[i % colors.size()], .width = noisy ? 1.1 : 1.6};
    output.line(run.t, run.output, style);
    error.line(run.t, run.error, style);
    first.line(run.t, run.output_estimate_error, style);
    estimate.line(run.t, run.estimate_error, style);
    control.line(run.t, run.control, style);
  }
  if (noisy) {
    const Inset zoom{.left = 0.2,
                     .bottom = 0.62,
                     .width = 0.6,
                     .height = 0.34,
                     .x = {2.0, 2.5},
                     .connect = false};
    control.y_range(-30, 80).inset(zoom);
    estimate.y_range(-15, 40).inset(zoom);
  }
  output.y_range(-0.1, 1.1).y_tick(0.2).inset(
      {.left = 0.5, .bottom = 0.2, .width = 0.46, .height = 0.5, .x = {3.4, 4.6}});
  for (auto* panel : {&output, &error, &first, &estimate, &control}) {
    panel->x_label("t (s)").legend(Legend::above);
  }
  return figure;
}

}  // namespace paper1
