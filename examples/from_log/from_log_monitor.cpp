// What the monitor that from_log pastes says of an hour on random plants that settle by themselves,
// those of settling.hpp: of healthy ones, whose model is wrong within its intervals, and with a
// fault. The design, its profile and the monitor are those of the pasted code, the gate and the
// bound of dhat are left out.
//
// T          1 s, 3600 samples; r moves each quarter of an hour, up and down
// y          with the noise of the model
// monitor    with settings from a log of 2000 samples of this loop, in order
//
// --count N, --seed S: so many plants of each order, other ones.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include <esokit/control/health.hpp>
#include <esokit/tune/tune.hpp>
#include <esokit/tune/tuned_controller.hpp>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "from_log/settling.hpp"

using namespace esokit::examples;
using esokit::LoopFault;
using from_log::Machine;
using from_log::Settling;

namespace {

/// What is wrong from the beginning on.
struct Fault {
  const char* name = "healthy";
  double gain = 1;   ///< of the plant, times
  double noise = 1;  ///< times
  double lost = 0;   ///< share of the measurements
  double load = 0;   ///< of half the range of u, after a minute
  LoopFault named = LoopFault::none;
  LoopFault too = LoopFault::none;  ///< whose advice names it, too
};

constexpr std::array<Fault, 8> faults{
    {{},
     {.name = "wrong sign", .gain = -1, .named = LoopFault::wrong_sign},
     {.name = "b0 5 times too small", .gain = 5, .named = LoopFault::gain_too_small},
     {.name = "b0 10 times too small", .gain = 10, .named = LoopFault::gain_too_small},
     {.name = "a fifth is lost", .lost = 0.2, .named = LoopFault::measurements_rejected},
     {.name = "a load above the range",
      .load = 2.2,
      .named = LoopFault::saturated,
      .too = LoopFault::wrong_sign},
     {.name = "10 times the noise", .noise = 10, .named = LoopFault::innovation_too_large},
     {.name = "a load of 0.4 of the range",
      .load = 0.8,
      .named = LoopFault::gain_too_large_or_disturbed}}};

/// Of LoopFault, in its order.
constexpr std::array<const char*, 9> names{
    "none",        "wrong sign", "gain too small",       "measurements rejected",
    "saturated",   "bounded",    "innovation too large", "gain too large or disturbed",
    "sensor still"};

/// What was named, and after which time the first was, s; -1: never.
struct Named {
  bool designed = false;
  double first = -1, expected = -1, advised = -1;
  LoopFault what = LoopFault::none;
};

template <class Controller>
Named hour(Controller controller, from_log::Runner::Profile profile, const Settling& plant,
           const from_log::Watch& watch, const Fault& fault, overload_example::Dice random) {
  using Observer = std::remove_cvref_t<decltype(controller.observer())>;
  using Model = std::remove_cvref_t<decltype(controller.observer().model())>;
  using Monitor = esokit::HealthMonitor<Observer::size - esokit::detail::simulated_lag<Model>>;
  const auto& m = plant.model;
  auto monitor = Monitor::make({.observer_bandwidth = watch.bandwidth,
                                .sample_time = m.sample_time,
                                .input_range = 0.5 * (m.u_max - m.u_min),
                                .noise = watch.noise,
                                .latency = watch.latency,
                                .memory = watch.memory,
                                .divider = watch.divider})
                     .value();
  Settling faulty = plant;
  faulty.gain *= fault.gain;
  Machine machine(faulty);
  (void)controller.start(plant.y, plant.u);
  double u = plant.u;
  Named named{.designed = true};
  for (int k = 0; k < 3600; ++k) {
    if (k == 60) machine.set_load(-fault.load * 0.5 * (m.u_max - m.u_min) * plant.gain);
    const double target = plant.y + ((k / 900) % 2 == 0 && k >= 60 ? plant.step : 0.0);
    const bool lost = random.with(fault.lost);
    const double noise = fault.noise * m.noise * random.normal();
    const double y = lost ? std::numeric_limits<double>::quiet_NaN() : machine.y() + noise;
    std::visit(
        [&](auto& moves) {
          if (k == 0) {
            if constexpr (requires { moves.feed(); }) {
              (void)moves.start(plant.y, plant.u);
            } else {
              (void)moves.reset(plant.y);
            }
          }
          (void)moves.update(target);
          const auto motion = moves.motion();
          double more = 0;
          if constexpr (requires { moves.feed(); }) {
            more = moves.feed();
          } else {
            more = m.pole * motion(1) / m.input_gain.value;
          }
          double of_law = 0;
          // The profile of the design has as many derivatives as its law.
          if constexpr (std::is_same_v<std::remove_cv_t<decltype(motion)>,
                                       typename Controller::Reference::All>) {
            of_law = controller.update(y, motion);
          }
          const double fed = controller.mode() == esokit::LoopMode::safe ? 0.0 : more;
          u = std::clamp(of_law + fed, m.u_min, m.u_max);
          (void)controller.applied(u - fed);
        },
        profile);
    monitor.look(controller);
    const LoopFault what = esokit::diagnose(monitor.health());
    if (what != LoopFault::none && named.first < 0) {
      named.first = k;
      named.what = what;
    }
    if (what != LoopFault::none && what == fault.named && named.expected < 0) named.expected = k;
    if (what != LoopFault::none && (what == fault.named || what == fault.too)) named.advised = k;
    machine.update(u);
  }
  return named;
}

using All = std::array<Named, faults.size()>;

template <int Order>
All hours(std::uint64_t seed) {
  All all;
  overload_example::Dice random(seed);
  const Settling plant = from_log::random_plant(Order, random);
  const auto tuning = esokit::tune(plant.model, {}, {.simulate = esokit::TuneSimulation::none});
  if (!tuning || !tuning->designs.front().feasible) return all;
  const esokit::TunedDesign& design = tuning->designs.front();
  const from_log::Pasting pasting = from_log::pasting_of(plant);
  // A log of this loop.
  esokit::FitData rows;
  rows.sample_time = plant.model.sample_time;
  from_log::Runner runner(pasting, *tuning, design);
  runner.start(plant.y, plant.u);
  Machine machine(plant);
  for (int k = 0; k < 2000; ++k) {
    rows.y.push_back(machine.y() + plant.model.noise * random.normal());
    rows.u.push_back(
        runner.update(rows.y.back(), plant.y + ((k / 500) % 2 == 1 ? plant.step : 0.0)));
    machine.update(rows.u.back());
  }
  const from_log::Watch watch = from_log::watch_of(*tuning, design, rows);
  const auto profile = from_log::Runner::profile_of(pasting, tuning->model,
                                                    static_cast<int>(design.settings.gains.size()));
  // As pasted: the law may ask for what is added to it, too.
  esokit::TuneModel wide = tuning->model;
  wide.u_min -= pasting.reach();
  wide.u_max += pasting.reach();
  const auto made = esokit::with_controller<Order>(wide, design, [&](const auto& controller) {
    for (std::size_t i = 0; i < faults.size(); ++i)
      all[i] = hour(controller, profile, plant, watch, faults[i], random);
  });
  if (!made) return {};
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(take_count(argc, argv, "--count", 20));
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  Report report(argc, argv, "from_log", "from_log_monitor",
                {.paper_title = "From a log to a controller",
                 .citation = "No paper. The monitor that is pasted, on random plants",
                 .link = "",
                 .title = "An hour under the monitor",
                 .description = "Random plants that settle by themselves, healthy and with a "
                                "fault, under the code that from_log pastes and its monitor.",
                 .order = 4});
  std::vector<CsvRow> table;
  for (const int order : {1, 2}) {
    const std::string name = "order " + std::to_string(order);
    const auto all = run_parallel(name, count, [&](std::size_t i) {
      const auto own = (seed << 32u) + 1'000'003u * i + static_cast<std::uint64_t>(order);
      return order == 1 ? hours<1>(own) : hours<2>(own);
    });
    for (std::size_t f = 0; f < faults.size(); ++f) {
      double plants = 0, alarms = 0, found = 0, advised = 0;
      std::array<int, names.size()> first{};
      std::vector<double> times;
      for (const All& one : all) {
        if (!one[f].designed) continue;
        plants += 1;
        alarms += one[f].first >= 0 ? 1 : 0;
        found += one[f].expected >= 0 ? 1 : 0;
        advised += one[f].advised >= 0 ? 1 : 0;
        if (one[f].expected >= 0) times.push_back(one[f].expected);
        ++first[static_cast<std::size_t>(one[f].what)];
      }
      const std::string where = name + ", " + faults[f].name;
      if (f == 0) {
        report.check(where, "plants", std::nullopt, plants);
        report.expect(where, "false alarms", alarms, alarms == 0, "none in an hour");
      } else {
        const double percent = 100 / std::max(plants, 1.0);
        report.check(where, "with an alarm (%)", std::nullopt, percent * alarms);
        report.check(where, "named (%)", std::nullopt, percent * found);
        if (faults[f].too != LoopFault::none)
          report.check(where, "in the advice (%)", std::nullopt, percent * advised);
      }
      std::string said;
      for (std::size_t i = 1; i < first.size(); ++i) {
        if (first[i] == 0) continue;
        said += (said.empty() ? "" : ", ") + std::to_string(first[i]) + " " + names[i];
      }
      table.push_back({where, number_text(plants, 4), number_text(alarms, 4), number_text(found, 4),
                       times.empty() ? "-" : number_text(from_log::quantile(times, 0.5), 3), said});
    }
  }
  report.table(
      "named", "What the monitor named in an hour",
      {"plants", "number", "with an alarm", "named rightly", "after (s), median", "first alarm"},
      table);
  return report.finish();
}
