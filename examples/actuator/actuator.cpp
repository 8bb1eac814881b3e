// Three actuators that are no straight line, with MappedInput and without it. A small motor has a
// dead zone, a Peltier element cools less than it heats, and the thrust of a thruster under water
// is the square of u.
//
// Motor       y'' = 50 (u without its dead zone of 3 V) - 3 y', |u| <= 12 V; encoder of 4096 counts
// Peltier     y' = 0.5 effect(u) + load - (y - 25) / 60, cooling 0.3 times as much, |u| <= 1; the
//             sensor has a lag of 0.5 s
// Thruster    y'' = 2 u |u| + current - 0.4 y', |u| <= 1; y in steps of 1 mm

#include <algorithm>
#include <cmath>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

using Curve = ActuatorCurve<>;

struct Trace {
  std::vector<double> t, y, u;
};

/// @param load at a time, from outside
template <class Loop, class Plant, class Reference, class Load>
Trace run(Loop loop, Plant plant, double seconds, const Reference& reference, const Load& load) {
  const double step = loop.sample_time();
  Trace trace;
  for (int k = 0; k < static_cast<int>(std::lround(seconds / step)); ++k) {
    const double t = k * step;
    trace.t.push_back(t);
    trace.y.push_back(plant.y);
    trace.u.push_back(loop.update(plant.measured(), reference(t)));
    plant.move(trace.u.back(), load(t), step);
  }
  return trace;
}

/// Largest distance to `at` in a time.
double furthest(const Trace& trace, double at, double from, double to) {
  double most = 0;
  for (std::size_t k = 0; k < trace.t.size(); ++k) {
    if (trace.t[k] >= from && trace.t[k] < to) most = std::max(most, std::abs(trace.y[k] - at));
  }
  return most;
}

// ---- A small motor.

constexpr double count = 2 * std::numbers::pi / 4096;

struct Motor {
  double dead = 3, y = 0, speed = 0;
  [[nodiscard]] double measured() const { return count * std::round(y / count); }
  void move(double u, double load, double step) {
    const double acts = std::abs(u) < dead ? 0 : u - std::copysign(dead, u);
    for (int i = 0; i < 20; ++i) {
      speed += step / 20 * (50 * acts + load - 3 * speed);
      y += step / 20 * speed;
    }
  }
};

/// Cools less than it heats.
struct Peltier {
  double cooling = 0.3, y = 25, sensor = 25;
  [[nodiscard]] double measured() const { return sensor; }
  void move(double u, double load, double step) {
    const double effect = u > 0 ? u : cooling * u;
    for (int i = 0; i < 10; ++i) {
      y += step / 10 * (0.5 * effect + load - (y - 25) / 60);
      sensor += step / 10 * (y - sensor) / 0.5;
    }
  }
};

struct Thruster {
  double y = 0, speed = 0;
  [[nodiscard]] double measured() const { return 1e-3 * std::round(y / 1e-3); }
  void move(double u, double load, double step) {
    for (int i = 0; i < 10; ++i) {
      speed += step / 10 * (2 * u * std::abs(u) + load - 0.4 * speed);
      y += step / 10 * speed;
    }
  }
};

/// A loop without a map and one with it, which differ in nothing else.
template <int Order>
struct Both {
  using Observer = LinearEso<Order>;
  Adrc<Observer> without;
  Adrc<MappedInput<Observer>> with;

  Both(const typename Observer::Config& observer, double bandwidth, double most, const Curve& curve)
      : without(Adrc<Observer>::make({.observer = observer,
                                      .controller_bandwidth = bandwidth,
                                      .limits = {.lower = -most, .upper = most}})
                    .value()),
        with(Adrc<MappedInput<Observer>>::make({.observer = {.observer = observer, .curve = curve},
                                                .controller_bandwidth = bandwidth,
                                                .limits = {.lower = -most, .upper = most}})
                 .value()) {}
};

/// y and u of both.
void draw(Report& report, const char* name, const char* caption, const char* y_label,
          const char* u_label, const Trace& without, const Trace& with) {
  Figure figure(name, {.rows = 1, .columns = 2, .panel_height = 200});
  figure.caption(caption);
  const auto panel = [&](std::size_t column, const char* label, const auto& of) {
    figure.panel(0, column)
        .x_label("t (s)")
        .y_label(label)
        .legend(Legend::above)
        .line(without.t, without.*of, {.name = "without the map", .color = Color::grey})
        .line(with.t, with.*of, {.name = "with it", .color = Color::blue});
  };
  panel(0, y_label, &Trace::y);
  panel(1, u_label, &Trace::u);
  report.add(figure);
}

const auto nothing = [](double) { return 0.0; };

void motor(Report& report) {
  const Both<2> loops({.observer_bandwidth = 150, .input_gain = 50, .sample_time = 1e-3}, 20, 12,
                      Curve::dead_zone(3));
  const auto one = [](double) { return 1.0; };
  const auto course = [&](const auto& loop, double dead, double seconds) {
    return run(loop, Motor{.dead = dead}, seconds, one, nothing);
  };
  const auto oscillation = [&](const auto& loop, double dead) {
    return 1e3 * furthest(course(loop, dead, 20), 1, 10, 20);
  };
  const double without = oscillation(loops.without, 3);
  const double with = oscillation(loops.with, 3);
  report.expect("motor", "error without (mrad)", without, without > 50, "a limit cycle");
  report.expect("motor", "error with (mrad)", with, with < 1e3 * count, "below a count");
  double less = 0;
  for (const double dead : {0.0, 0.75, 1.5, 2.25, 2.7})
    less = std::max(less, oscillation(loops.with, dead));
  report.expect("motor, dead zone 0 .. 2.7 V", "error with 3 V (mrad)", less, less < 7, "chatters");
  const double more = oscillation(loops.with, 3.6);
  report.expect("motor, dead zone 3.6 V", "error with 3 V (mrad)", more, more > less,
                "a limit cycle");
  report.expect("motor, dead zone 3.6 V", "error without (mrad)", oscillation(loops.without, 3.6),
                true, "");
  draw(report, "motor", "A motor that does nothing below 3 of 12 V, to be at 1 rad.", "angle (rad)",
       "u (V)", course(loops.without, 3, 4), course(loops.with, 3, 4));
}

void peltier(Report& report) {
  Both<1> loops({.observer_bandwidth = 2, .input_gain = 0.5, .sample_time = 0.1}, 0.4, 1,
                Curve::two_gains(1, 0.3));
  (void)loops.without.start(25, 0);
  (void)loops.with.start(25, 0);
  const auto room = [](double) { return 25.0; };
  const auto loads = [](double t) {
    return t >= 10 && t < 40 ? -0.1 : t >= 70 && t < 100 ? 0.1 : 0.0;
  };
  const Trace without = run(loops.without, Peltier{}, 120, room, loads);
  const Trace with = run(loops.with, Peltier{}, 120, room, loads);
  const Trace even = run(loops.without, Peltier{.cooling = 1}, 120, room, loads);
  const auto warm = [](const Trace& trace) { return furthest(trace, 25, 70, 100); };
  const auto cold = [](const Trace& trace) { return furthest(trace, 25, 10, 40); };
  report.expect("peltier, load 0.1 K/s", "error without (K)", warm(without), true, "");
  report.expect("peltier, load 0.1 K/s", "error with (K)", warm(with),
                std::abs(warm(with) / warm(even) - 1) < 0.1, "as with one gain, within 10 %");
  report.expect("peltier, load 0.1 K/s", "error with one gain (K)", warm(even), true, "");
  report.expect("peltier, load -0.1 K/s", "error with (K)", cold(with), true, "");
  draw(report, "peltier",
       "A Peltier element that cools 0.3 times as much as it heats: a loss from 10 to 40 s, heat "
       "from 70 to 100 s.",
       "temperature (degC)", "u", without, with);
}

void thruster(Report& report) {
  const Both<2> loops({.observer_bandwidth = 7.2, .input_gain = 2, .sample_time = 0.02}, 1.2, 1,
                      Curve::square(1));
  const auto wanted = [](double t) { return t < 1 ? 0.0 : 1.0; };
  const auto current = [](double t) { return t < 30 ? 0.0 : 0.05; };
  const Trace without = run(loops.without, Thruster{}, 60, wanted, current);
  const Trace with = run(loops.with, Thruster{}, 60, wanted, current);
  const auto still = [](const Trace& trace) { return 1e3 * furthest(trace, 1, 15, 30); };
  const auto pushed = [](const Trace& trace) { return 1e3 * furthest(trace, 1, 30, 60); };
  report.expect("thruster, 15 .. 30 s", "error without (mm)", still(without), true, "");
  report.expect("thruster, 15 .. 30 s", "error with (mm)", still(with),
                still(with) < 0.2 * still(without), "a fifth at most");
  report.expect("thruster, in a current", "error without (mm)", pushed(without), true, "");
  report.expect("thruster, in a current", "error with (mm)", pushed(with),
                pushed(with) < 0.5 * pushed(without), "half at most");
  draw(report, "thruster", "A vehicle under water, to be 1 m further on; a current from 30 s on.",
       "way (m)", "u", without, with);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "actuator", "actuator",
                {.paper_title = "Actuators",
                 .citation = "No paper. Public threads that ask for an inverse map or a dead zone",
                 .link = "",
                 .title = "A dead zone, two gains, a square",
                 .description = "With MappedInput and without it."});
  motor(report);
  peltier(report);
  thruster(report);
  return report.finish();
}
