// Which observer: what each of them makes of measurement noise, against how far its disturbance
// estimate is off when the disturbance moves. Lower left is better; a curve is one observer with
// all its bandwidths.
//
// Way: sampled, sampled observers. Linear ones exactly (Lyapunov equations and frequency
// responses; the walk of the LESO with m = 2 is simulated); the ABESO, whose gain depends on the
// error, by simulation, noise and disturbance each alone.
//
// symbol    code         value        unit
// n         order        2            -
// T         sample_time  0.001        s
// omega_o   grid         6 .. 300     rad/s
// alpha     -            2            cascade
// rho       -            0.7          ABESO
//           slow         5            rad/s, of the sine in the second panel

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>

#include "common/parallel.hpp"
#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr int order = 2;
constexpr double sample_time = 1e-3;
constexpr int points = 33;
constexpr double slow = 5.0;

struct Point {
  double setting = 0.0;  // omega_o in rad/s, or q of the filter
  double noise = 0.0;    // sd of dhat for noise of 1 on y, 1/s^2
  double walk = 0.0;     // rms of d - dhat for a d that walks by 1 a square root of a second
  double sine = 0.0;     // abs(1 - dhat/d) at `slow`
};

struct Family {
  std::string name;
  std::string cost;  // of an update, LinearEso = 1
  std::vector<Point> points;
};

/// The plant stands still: u takes off the true d at once, and the observer, which is told that u,
/// has to find d. So a d that walks far away costs no digits.
template <class Observer>
double simulated(Observer observer, double noise, const std::function<double(int)>& d, int samples,
                 int settle) {
  sim::Gaussian gaussian(7);
  double sum = 0.0;
  double now = d(0);
  for (int k = 1; k < samples; ++k) {
    observer.update(noise * gaussian.next(), -now);
    const double error = now - observer.total_disturbance();
    if (k >= settle) sum += error * error;
    now = d(k);
  }
  return std::sqrt(sum / (samples - settle));
}

constexpr int samples = 2'000'000;
constexpr int settle = 20'000;

template <class Observer>
double simulated_walk(const Observer& observer) {
  sim::Gaussian steps(11);
  double at = 0.0;
  const auto walk = [&](int) { return at += std::sqrt(sample_time) * steps.next(); };
  return simulated(observer, 0.0, walk, samples, settle);
}

template <class Observer>
Point simulate(const Observer& observer, double setting) {
  const auto none = [](int) { return 0.0; };
  const auto sine = [](int k) { return std::sin(slow * sample_time * (k + 0.5)); };
  return {setting, simulated(observer, 1.0, none, samples, settle), simulated_walk(observer),
          std::numbers::sqrt2 * simulated(observer, 0.0, sine, samples, settle)};
}

template <class Observer>
Point exact(const Observer& observer, double setting) {
  const auto deviation = [&](const EstimationNoise& noise) {
    const auto covariance = estimation_error_covariance(observer, noise).value();
    return std::sqrt(covariance(order, order));
  };
  const auto channel = estimation_system(observer).template channel<1, order>();
  const auto response = frequency_response(channel, slow).value()(0, 0);
  double walk = 0.0;
  if constexpr (Observer::extension == 1) {
    walk = deviation({.disturbance = 1.0});
  } else {  // the exact one is for a walk of the highest derivative
    walk = simulated_walk(observer);
  }
  return {setting, deviation({.measurement = 1.0}), walk, std::abs(1.0 - response)};
}

template <class Make>
Family sweep(std::string name, std::string cost, double from, double to, const Make& make) {
  Family curve{std::move(name), std::move(cost), {}};
  for (const double setting : log_grid<points>(from, to).value()) {
    curve.points.push_back(exact(make(setting), setting));
  }
  return curve;
}

/// Bandwidth that gives as much noise as asked for, and the errors there; along a curve the noise
/// grows with the setting.
std::optional<Point> at_noise(const Family& curve, double noise) {
  for (std::size_t i = 1; i < curve.points.size(); ++i) {
    const Point& a = curve.points[i - 1];
    const Point& b = curve.points[i];
    if (!(a.noise <= noise && noise <= b.noise)) continue;
    const double share = std::log(noise / a.noise) / std::log(b.noise / a.noise);
    const auto mixed = [&](double x, double y) { return x * std::pow(y / x, share); };
    return Point{mixed(a.setting, b.setting), noise, mixed(a.walk, b.walk), mixed(a.sine, b.sine)};
  }
  return std::nullopt;
}

std::vector<double> column(const Family& curve, double Point::*member) {
  std::vector<double> result;
  for (const Point& point : curve.points) result.push_back(point.*member);
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "choosing", "tradeoff",
      {.paper_title = "Choosing an observer",
       .citation = "Our own numbers; the observers are those of the papers",
       .link = "",
       .title = "Noise against disturbance error, every observer",
       .description = "Sampled observers of a plant of order 2 at 1 kHz, over all bandwidths."});

  std::vector<Family> curves;
  curves.push_back(sweep("LESO", "1", 6.0, 300.0, [](double w) {
    return LinearEso<order>::make(
               {.observer_bandwidth = w, .input_gain = 1.0, .sample_time = sample_time})
        .value();
  }));
  curves.push_back(sweep("LESO, m = 2", "1.3", 6.0, 300.0, [](double w) {
    return LinearEso<order, double, 2>::make(
               {.observer_bandwidth = w, .input_gain = 1.0, .sample_time = sample_time})
        .value();
  }));
  curves.push_back(sweep("half gain", "1", 6.0, 300.0, [](double w) {
    return HalfGainEso<order>::make(
               {.observer_bandwidth = w, .input_gain = 1.0, .sample_time = sample_time})
        .value();
  }));
  curves.push_back(sweep("cascade p = 2", "1.8", 3.0, 150.0, [](double w) {
    return CascadeEso<order, 2>::make({.observer_bandwidth = w,
                                       .bandwidth_factor = 2.0,
                                       .input_gain = 1.0,
                                       .sample_time = sample_time})
        .value();
  }));
  curves.push_back(sweep("cascade p = 3", "2.6", 1.5, 75.0, [](double w) {
    return CascadeEso<order, 3>::make({.observer_bandwidth = w,
                                       .bandwidth_factor = 2.0,
                                       .input_gain = 1.0,
                                       .sample_time = sample_time})
        .value();
  }));
  // The plain Kalman filter for a d that walks: R = 1, and q from slow to fast.
  curves.push_back(sweep("filter (Kalman gain)", "1 (frozen)", 0.3, 1e6, [](double q) {
    ExtendedStateFilter<order>::Config config;
    config.input_gain = 1.0;
    config.sample_time = sample_time;
    config.measurement_variance = 1.0;
    // The walk drives y and y' within the sample as well.
    EigenMatrix<double, 3, 3> noise;
    const double t = sample_time;
    noise << t * t * t * t * t / 20, t * t * t * t / 8, t * t * t / 6, t * t * t * t / 8,
        t * t * t / 3, t * t / 2, t * t * t / 6, t * t / 2, t;
    config.process_covariance = EigenMatrix<double, 3, 3>(q * q * noise);
    config.initial_covariance = EigenMatrix<double, 3, 3>::Identity();
    config.inflation_rule = InflationRule::none;
    config.mode = RiccatiMode::frozen;
    return ExtendedStateFilter<order>::make(config).value();
  }));

  Family switched{"ABESO (simulated)", "1.3", {}};
  const auto settings = log_grid<9>(6.0, 300.0).value();
  switched.points = run_parallel("ABESO", settings.size(), [&](std::size_t i) {
    const double w = settings[i];
    return simulate(AdjustableBandwidthEso<order>::make({.observer_bandwidth = w,
                                                         .bandwidth_ratio = 0.7,
                                                         .input_gain = 1.0,
                                                         .sample_time = sample_time})
                        .value(),
                    w);
  });

  Figure figure("tradeoff", {.rows = 1, .columns = 2, .panel_height = 300});
  figure.caption(
      "n = 2, T = 1 ms; each curve is one observer, slow at the left, fast at the right. "
      "Horizontal: "
      "standard deviation of dhat for measurement noise of 1. Vertical: how far dhat is off "
      "because "
      "the disturbance moves, left as a random walk, right as a sine of 5 rad/s. The Kalman gain "
      "is "
      "the least that a linear observer can do on the left, and the LESO is next to it: for a "
      "disturbance that may jump at any time nothing beats it. On the right, where the disturbance "
      "is slow and smooth, the second extended state and the cascade are far better at equal "
      "noise.");
  auto& left = figure.panel(0, 0).title("d walks at random").name("walk");
  auto& right = figure.panel(0, 1).title("d swings slowly").name("sine");
  left.y_label("rms of d − dhat (s^{1/2})").y_range(1e-2, 1.0).legend(Legend::bottom_left);
  right.y_label("abs(1 − dhat/d)").y_range(1e-4, 10.0).legend(Legend::bottom_left);
  constexpr std::array colors = {Color::blue,       Color::sky,   Color::orange,
                                 Color::vermillion, Color::green, Color::black};
  for (Panel* panel : {&left, &right}) {
    panel->log_x().log_y().x_label("sd of dhat / sd of noise (s^{-2})").x_range(10.0, 1e4);
  }
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const Style style{.name = curves[i].name,
                      .color = colors[i],
                      .dash = i + 1 == curves.size() ? Dash::dashed : Dash::solid,
                      .width = 1.8};
    const auto noise = column(curves[i], &Point::noise);
    left.line(noise, column(curves[i], &Point::walk), style);
    right.line(noise, column(curves[i], &Point::sine), style);
  }
  const Style crosses{
      .name = switched.name, .color = Color::purple, .marker = Marker::cross, .size = 1.3};
  left.points(column(switched, &Point::noise), column(switched, &Point::walk), crosses);
  right.points(column(switched, &Point::noise), column(switched, &Point::sine), crosses);
  report.add(figure);

  constexpr double budget = 500.0;
  std::vector<CsvRow> lines;
  std::vector<Point> chosen;
  curves.push_back(switched);
  for (const Family& curve : curves) {
    const auto point = at_noise(curve, budget);
    chosen.push_back(point.value_or(Point{}));
    lines.push_back({curve.name, number_text(chosen.back().setting, 3),
                     number_text(chosen.back().walk, 3), number_text(chosen.back().sine, 3),
                     curve.cost});
  }
  report.table("budget",
               "At equal noise, sd of dhat = " + number_text(budget, 3) +
                   " for noise of 1: the bandwidth that gives it, and the errors",
               {"observer", "omega_o (rad/s); filter: q", "random walk (s^{1/2})",
                "sine of 5 rad/s", "cost of an update"},
               lines);

  // The simulation's way of driving the observer, against the exact one.
  const auto leso = LinearEso<order>::make(
      {.observer_bandwidth = 40.0, .input_gain = 1.0, .sample_time = sample_time});
  const Point truth = exact(*leso, 40.0);
  const Point run = simulate(*leso, 40.0);
  report.check_reference("LESO, 40 rad/s", "simulated noise", truth.noise, run.noise, 0.02,
                         "exact");
  report.check_reference("LESO, 40 rad/s", "simulated walk", truth.walk, run.walk, 0.04, "exact");
  report.check_reference("LESO, 40 rad/s", "simulated sine", truth.sine, run.sine, 0.03, "exact");
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (i == 5) continue;
    report.expect(curves[i].name, "walk error against the Kalman gain's (ratio)",
                  chosen[i].walk / chosen[5].walk, chosen[i].walk > 0.99 * chosen[5].walk,
                  "none is better than the Kalman gain");
  }
  return report.finish();
}
