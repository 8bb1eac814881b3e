// Random dead zones behind one map of 3 V: does the axis come to rest? Without a map and with one,
// with a leak of the disturbance (Guarded) and with Resting, of an axis that is free and of one
// that sticks. `--seed 2 --count 1000` draws others, and more.
//
// Axis   y'' = 50 (u without its dead zone) + load - friction - 3 y', |u| <= 12 V, 1 kHz, at 1 rad;
//        encoder of 4096 counts. Friction: none, or 30 rad/s2 that holds it at rest and 15 that
//        brake it. No load for 20 s, then 40 rad/s2 for 10 s.
// Wrong  dead zones between 2.4 and 3.6 V, so the map is wrong by a fifth at most.

#include <algorithm>
#include <cmath>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "common/parallel.hpp"
#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr double count = 2 * std::numbers::pi / 4096;
constexpr double sample_time = 1e-3, reference = 1, width = 3;

struct Axis {
  double dead = 0, stick = 0, load = 0;
  double y = 0, speed = 0;

  [[nodiscard]] double measured() const { return count * std::round(y / count); }
  void move(double u) {
    constexpr int parts = 20;
    constexpr double step = sample_time / parts;
    const double force = 50 * (std::abs(u) < dead ? 0 : u - std::copysign(dead, u)) + load;
    for (int i = 0; i < parts; ++i) {
      const bool stands = !(std::abs(speed) > 0);
      if (stands && std::abs(force) <= stick) continue;
      const double brakes = 0.5 * stick * std::copysign(1.0, stands ? force : speed);
      const double next = speed + step * (force - brakes - 3 * speed);
      speed = stick > 0 && speed * next < 0 ? 0 : next;
      y += step * speed;
    }
  }
};

/// All laws are of one type: what is left out does nothing.
using Law = Resting<Adrc<MappedInput<Guarded<LinearEso<2>>>>>;
struct Settings {
  const char* name;
  ActuatorCurve<> curve{};
  double leak = 0;
  bool rests = false;
};
Law made(const Settings& settings) {
  return Law::make(
             {.controller = {.observer = {.observer = {.observer = {.observer_bandwidth = 150,
                                                                    .input_gain = 50,
                                                                    .sample_time = sample_time},
                                                       .leak_time = settings.leak},
                                          .curve = settings.curve},
                             .controller_bandwidth = 20,
                             .limits = {.lower = -12, .upper = 12}},
              .rest = {.error = settings.rests ? 1.5 * count : 0,
                       .time = settings.rests ? 0.25 : 0}})
      .value();
}

/// In counts of the encoder.
struct Course {
  double error = 0;   ///< largest from 10 to 20 s
  double way = 0;     ///< gone in this time
  double loaded = 0;  ///< largest error in the last 5 s under a load
};
Course course(Law law, Axis axis) {
  Course all;
  for (int k = 0; k < 30000; ++k) {
    if (k == 20000) axis.load = 40;
    const double before = axis.y;
    axis.move(law.update(axis.measured(), reference));
    const double error = std::abs(axis.y - reference) / count;
    if (k >= 10000 && k < 20000) {
      all.error = std::max(all.error, error);
      all.way += std::abs(axis.y - before) / count;
    }
    if (k >= 25000) all.loaded = std::max(all.loaded, error);
  }
  return all;
}

std::vector<double> random_dead_zones(std::uint64_t seed, std::size_t number, double least) {
  std::mt19937_64 random(seed);
  std::vector<double> all(number);
  for (double& one : all) {
    one = least + (1.2 * width - least) * 0x1p-53 * static_cast<double>(random() >> 11U);
  }
  return all;
}

/// Of one law at each dead zone.
std::vector<Course> courses(const Settings& settings, double stick,
                            const std::vector<double>& dead) {
  const Law law = made(settings);
  return run_parallel(settings.name, dead.size(), [&](std::size_t i) {
    return course(law, {.dead = dead[i], .stick = stick});
  });
}

}  // namespace

int main(int argc, char** argv) {
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 20261127));
  const auto number = static_cast<std::size_t>(take_count(argc, argv, "--count", 100));
  Report report(argc, argv, "actuator", "dead_zones",
                {.paper_title = "Actuators",
                 .citation = "No paper. Public threads that ask for an inverse map or a dead zone",
                 .link = "",
                 .title = "Random dead zones behind one map",
                 .description = "Does the axis come to rest, if the dead zone is not that of the "
                                "map? Dead zones of 0 to 3.6 V, 3 V in the map."});
  const auto hard = ActuatorCurve<>::dead_zone(width);
  const auto soft = ActuatorCurve<>::dead_zone(width, width / 4);
  const Settings laws[] = {{"no map"},
                           {"no map, rest", {}, 0, true},
                           {"map", hard},
                           {"map, rest", hard, 0, true},
                           {"map, leak", hard, 0.3},
                           {"soft map, rest", soft, 0, true},
                           {"soft map, leak, rest", soft, 0.3, true}};
  const auto dead = random_dead_zones(seed, number, 0);
  const auto wrong = random_dead_zones(seed + 1, number, 0.8 * width);
  const int all_of_them = static_cast<int>(number);
  std::vector<CsvRow> rows;
  for (const double stick : {0.0, 30.0}) {
    const std::string kind = stick > 0 ? "sticks: " : "free: ";
    std::vector<Course> without;
    for (const Settings& settings : laws) {
      double less = 0, more = 0, loaded = 0, times = 0;
      int within = 0, at_rest = 0, worse = 0;
      const auto all = courses(settings, stick, dead);
      for (std::size_t i = 0; i < number; ++i) {
        double& largest = dead[i] <= width ? less : more;
        largest = std::max(largest, all[i].error);
        loaded = std::max(loaded, all[i].loaded);
        within += all[i].error <= 1 ? 1 : 0;
        at_rest += all[i].way < 0.01 ? 1 : 0;
      }
      const auto of_wrong = courses(settings, stick, wrong);
      if (without.empty()) without = of_wrong;
      for (std::size_t i = 0; i < number; ++i) {
        const double ratio = of_wrong[i].error / without[i].error;
        worse += ratio > 1.1 ? 1 : 0;
        times = std::max(times, ratio);
      }
      const std::string name = kind + settings.name;
      rows.push_back({name, number_text(less, 2), number_text(more, 2), std::to_string(within),
                      std::to_string(at_rest), number_text(loaded, 2), std::to_string(worse),
                      number_text(times, 3)});
      if (name == "sticks: soft map, rest" || name == "free: soft map, leak, rest") {
        report.expect(name, "wrong by a fifth, worse", worse, worse == 0, "none");
        report.expect(name, "at rest", at_rest, stick > 0 ? at_rest == all_of_them : true,
                      stick > 0 ? "all" : "");
      }
    }
  }
  report.table(
      "found",
      "Largest errors at rest in counts, of random dead zones up to the 3 V of the map and "
      "above; how many stay within one count; how many do not move at all; the largest "
      "error under a load. Then of maps that are wrong by up to a fifth: how many hunt "
      "by more than 1.1 times as much as without a map, and the most.",
      {"law", "up to 3 V", "above", "within one count", "at rest", "under a load", "worse",
       "times"},
      std::move(rows));
  return report.finish();
}
