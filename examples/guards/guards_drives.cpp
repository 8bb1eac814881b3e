// How often `diagnose` is right about b0 on random drives with much friction and large loads, and
// how often it accuses a healthy one. `--seed 2 --count 30000` draws others, and more.
//
// Way: sampled, the plant in four steps of Euler a sample, with friction that holds it at rest.
//
// symbol   value                               unit
// n        1, 2, 3                             order
// omega_o  30 .. 300, omega_o T 0.02 .. 0.25   rad/s
// omega_c  omega_o / 3 .. 8                    rad/s
// b        5 .. 500, both signs                u is within +-1
// b0 / b   0.6 .. 1.6 where b0 is right
// friction up to 0.4 b, Coulomb with a larger one at rest, and viscous, of the fastest reference
// load     steps within +-0.4 b, periodic, random or only one
// lag      0 .. 3 / omega_o                    of the actuator, not in the model
// noise    0.02 .. 2 % of b in dhat            and the same from the encoder's steps
// r        steps, sine, smooth profile, rest

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <esokit/control/health.hpp>

#include "common/parallel.hpp"
#include "guards/guards.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace guards;

namespace {

constexpr double pi = 3.14159265358979;

enum class Motion { steps, sine, profile, rest };
enum class Load { constant, periodic, random };

/// A drawn drive; forces in the unit of y^(n).
struct Drive {
  int order;
  double sample_time, observer, controller, b, b0, lag;
  double at_rest, coulomb, viscous;
  double noise, count;  ///< standard deviation, and step of the encoder
  Load load;
  double force, load_period;
  Motion motion;
  double amplitude, pace;
  double stop = 1e300, bounce = 0;  ///< where y is stopped (order 2)
};

/// @param times b0 / b; 1 or -1: times a factor of 0.6 .. 1.6
Drive draw(Random& random, double times, bool stops) {
  Drive d{};
  const double kind = random();
  d.order = kind < 0.25 ? 1 : kind < 0.85 ? 2 : 3;
  d.observer = random.logarithmic(30, 300);
  d.sample_time = random.logarithmic(0.02, 0.25) / d.observer;
  d.controller = d.observer / random.between(3, 8);
  const double b = random.logarithmic(5, 500);
  d.b = random() < 0.5 ? b : -b;
  const double mismatch = random() < 0.3 ? 1 : random.logarithmic(0.6, 1.6);
  d.b0 = d.b * times * (std::abs(times) == 1 ? mismatch : 1);
  d.lag = random.between(0, 3) / d.observer;
  d.at_rest = random() < 0.2 ? 0 : b * random.between(0, 0.4);
  d.coulomb = d.at_rest * random.between(0.6, 1);
  if (d.order == 3) d.at_rest = d.coulomb = 0;
  const double which = random();
  d.load = which < 0.15 ? Load::constant : which < 0.6 ? Load::periodic : Load::random;
  d.force = b * random.between(0, 0.4);
  d.load_period = random.logarithmic(10, 300) / d.observer;
  // The standard deviation of dhat by noise of 1.
  const double gain = (d.order == 1   ? 0.5
                       : d.order == 2 ? 0.6
                                      : 0.9) *
                      std::pow(d.observer, d.order + 0.5) * std::sqrt(d.sample_time);
  d.noise = random.logarithmic(2e-4, 2e-2) * b / gain;
  d.count = random.logarithmic(2e-4, 2e-2) * b / gain * std::sqrt(12.0);
  const double way = random();
  d.motion = way < 0.4   ? Motion::steps
             : way < 0.6 ? Motion::sine
             : way < 0.8 ? Motion::profile
                         : Motion::rest;
  d.pace = random.logarithmic(30, 400) / d.observer;
  // The amplitude is what the actuator moves in the time of the motion, and the fastest speed that
  // follows from it bounds the viscous friction.
  const double share = random.logarithmic(0.05, d.motion == Motion::steps ? 3 : 0.5);
  double unit = 0;
  double fastest = 0;
  if (d.motion == Motion::steps) unit = 1 / d.controller, fastest = 2;
  if (d.motion == Motion::sine) unit = d.pace / (2 * pi), fastest = 1;
  if (d.motion == Motion::profile) unit = d.pace / 4, fastest = d.order == 3 ? 1.5 : 4;
  d.amplitude = share * b * std::pow(unit, d.order);
  fastest *= d.amplitude / std::pow(d.motion == Motion::rest ? 1 : unit, d.order - 1);
  d.viscous = random() < 0.2 ? 0 : d.observer * random.logarithmic(0.003, 0.1);
  const double left = (0.4 * b - d.at_rest) * random();
  if (d.viscous * fastest > left) d.viscous = left / fastest;
  if (stops && d.amplitude > 0)
    d.stop = d.amplitude * random.logarithmic(0.1, 1), d.bounce = random.between(0, 0.6);
  return d;
}

/// y^(n) = b v + load - friction, v = u behind the lag.
class Plant {
 public:
  explicit Plant(const Drive& drive) : d_(drive) {}

  void step(double u, double load) {
    constexpr int parts = 4;
    const double h = d_.sample_time / parts;
    const double follows = -std::expm1(-h / d_.lag);
    for (int i = 0; i < parts; ++i) {
      motor_ += follows * (u - motor_);
      double& speed = x_[static_cast<std::size_t>(d_.order - 1)];
      const double push = d_.b * motor_ + load - d_.viscous * speed;
      const double before = speed;
      if (moves()) {
        speed += h * (push - std::copysign(d_.coulomb, speed));
        if (d_.coulomb > 0 && speed * before < 0) speed = 0;
      } else if (std::abs(push) > d_.at_rest) {
        speed += h * (push - std::copysign(d_.coulomb, push));
      }
      double mean = (before + speed) / 2;
      for (int j = d_.order - 2; j >= 0; --j) {
        double& x = x_[static_cast<std::size_t>(j)];
        const double was = x;
        x += h * mean;
        mean = (was + x) / 2;
      }
      if (d_.order == 2 && std::abs(x_[0]) > d_.stop) {
        if (x_[0] * speed > 0) speed *= -d_.bounce;
        x_[0] = std::copysign(d_.stop, x_[0]);
      }
    }
  }

  [[nodiscard]] double output() const { return x_[0]; }
  [[nodiscard]] bool moves() const { return x_[static_cast<std::size_t>(d_.order - 1)] != 0; }

 private:
  Drive d_;
  std::array<double, 3> x_{};
  double motor_ = 0;
};

/// omega_o t at which u first moved by 2 % of its range in a machine that was not held by friction,
/// and at which a fault was first named; or -1.
struct Found {
  double moved = -1, sign = -1, small = -1;
};

template <int Order>
Found watch(const Drive& d, Random random, double duration) {
  auto loop = Adrc<LinearEso<Order>>::make({.observer = {.observer_bandwidth = d.observer,
                                                         .input_gain = d.b0,
                                                         .sample_time = d.sample_time},
                                            .controller_bandwidth = d.controller,
                                            .limits = {.lower = -1, .upper = 1}})
                  .value();
  auto monitor = HealthMonitor<Order + 1>::make({.observer_bandwidth = d.observer,
                                                 .sample_time = d.sample_time,
                                                 .input_range = 1,
                                                 .noise = std::hypot(d.noise, d.count / 3.5)})
                     .value();
  Plant plant(d);
  Found found;
  double load = d.load == Load::constant ? d.force : 0;
  double next_load = 0, next_step = 0, target = 0, fast = 0, slow = 0;
  const double w = d.observer * d.sample_time;
  for (int k = 0; k * w < duration; ++k) {
    const double t = k * d.sample_time;
    if (d.load == Load::periodic) {
      load = std::fmod(t, d.load_period) < d.load_period / 2 ? d.force : -d.force;
    } else if (d.load == Load::random && t >= next_load) {
      load = d.force * random.between(-1, 1);
      next_load = t - d.load_period * std::log(1 - random());
    }
    if (d.motion == Motion::steps && t >= next_step) {
      target = d.amplitude * random.between(-1, 1);
      next_step = t + d.pace;
    } else if (d.motion == Motion::sine) {
      target = d.amplitude * std::sin(2 * pi * t / d.pace);
    } else if (d.motion == Motion::profile) {
      const double phase = std::fmod(t / d.pace, 2);
      const double s = phase < 1 ? phase : 2 - phase;
      target = 4 * d.amplitude * s * s * (3 - 2 * s);
    }
    const double y = d.count * std::round((plant.output() + d.noise * random.normal()) / d.count);
    const double u = loop.update(y, target);
    monitor.look(loop);
    fast += -std::expm1(-w) * (u - fast);
    slow += -std::expm1(-w / 3) * (fast - slow);
    if (found.moved < 0 && plant.moves() && std::abs(fast - slow) > 0.02) found.moved = k * w;
    const LoopFault fault = diagnose(monitor.health());
    if (found.sign < 0 && fault == LoopFault::wrong_sign) found.sign = k * w;
    if (found.small < 0 && fault == LoopFault::gain_too_small) found.small = k * w;
    plant.step(u, load);
  }
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  const auto count = static_cast<std::size_t>(take_count(argc, argv, "--count", 1000));
  Report report(
      argc, argv, "guards", "drives",
      about("The sign and size of b0 on random drives",
            "How often a wrong b0 is found, and how often a healthy drive is accused, with "
            "friction and loads up to 40 % of the range."));
  struct Group {
    const char* name;
    double times;
    bool stops;
  };
  std::vector<CsvRow> rows;
  for (const Group& group :
       {Group{"healthy", 1, false}, Group{"wrong sign", -1, false},
        Group{"b0 3 times too small", 1.0 / 3, false}, Group{"b0 5 times too small", 0.2, false},
        Group{"b0 10 times too small", 0.1, false}, Group{"healthy, against stops", 1, true},
        Group{"wrong sign, against stops", -1, true}}) {
    // A fault has 100 / omega_o from the first motion, which comes before 300.
    constexpr double latest = 300;
    const double duration = group.times == 1 ? 600 : latest + 100;
    const auto all = run_parallel(group.name, count, [&](std::size_t i) {
      Random random{(seed << 32u) + 15485863u * i};
      const Drive drive = draw(random, group.times, group.stops);
      return drive.order == 1   ? watch<1>(drive, random, duration)
             : drive.order == 2 ? watch<2>(drive, random, duration)
                                : watch<3>(drive, random, duration);
    });
    int moved = 0, sign = 0, small = 0, in_time = 0;
    for (const Found& one : all) {
      sign += one.sign >= 0 ? 1 : 0;
      small += one.small >= 0 ? 1 : 0;
      if (one.moved < 0 || one.moved >= latest) continue;
      ++moved;
      const double when = group.times < 0 ? one.sign : one.small;
      in_time += when >= 0 && when <= one.moved + 100 ? 1 : 0;
    }
    const double percent = 100.0 * in_time / std::max(moved, 1);
    const bool healthy = group.times == 1;
    rows.push_back({group.name, std::to_string(moved), healthy ? "-" : number_text(percent, 4),
                    std::to_string(sign), std::to_string(small)});
    const double per_30000 = 30000.0 / static_cast<double>(std::max<std::size_t>(count, 1));
    if (healthy && !group.stops) {
      report.expect(group.name, "called a wrong sign", sign, sign * per_30000 <= 3,
                    "at most 3 of 30,000");
      report.expect(group.name, "called too small", small, small * per_30000 <= 30,
                    "at most 1 of 1,000");
    } else if (group.times == -1 && !group.stops) {
      report.expect(group.name, "named in time, of those that moved (%)", percent,
                    moved - in_time <= std::max(1, moved / 40), "misses at most 1 of 40");
    } else {
      report.expect(group.name, healthy ? "called a wrong sign" : "named in time (%)",
                    healthy ? sign : percent, true, "reported");
    }
  }
  report.table(
      "found",
      "Faults named on random drives. In time means within 100 / omega_o after u first "
      "moves by 2 % of half its range, high-passed at omega_o / 3, in a drive that is not "
      "held by friction",
      {"drives", "moved", "named in time (% of those)", "called a wrong sign", "called too small"},
      rows);
  return report.finish();
}
