// How soon what from_log pastes settles, beside a PI or PID by the rules of SIMC that is slowed
// until it puts the same noise into u. Random plants that settle by themselves, after a step of r
// and after a load. Ours goes through the profile of its code, the PID gets the step at once.
//
// Plant  order 1: y' = -a y + b v(t - L) + d, order 2: y'' = -a y' + b v(t - L) + d; tau v' + v = u
//        The controllers are from a model with b wrong by up to 8 %, a by 20 %, L and tau by 15 %.
//
// symbol  code       value
// T       1          s
// 1 / a   1 / pole   30 .. 1500 T
// tau     lag        0, or 0.5 T .. 0.15 / a
// L       dead_time  0 .. 7 T
// u       lower ..   -50 .. 50, or 0 .. 100
//
// --count N, --seed S: so many plants of each order, other ones.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <esokit/tune/tune.hpp>

#include "choosing/overload.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "from_log/settling.hpp"

using namespace esokit::examples;
using from_log::Machine;
using from_log::Settling;

namespace {

struct Answer {
  double settling = 0, overshoot = 0, peak = 0, area = 0;
};

/// @param load of y^(n), from the beginning on
template <class Control>
Answer answer_of(const Settling& plant, double step, double load, Control control) {
  Machine machine(plant, load);
  const int rows = static_cast<int>(6000 + 20 / plant.pole);
  Answer answer;
  for (int k = 0; k < rows; ++k) {
    machine.update(control(machine.measured(), plant.y + step));
    const double error = machine.y() - plant.y - step;
    if (step > 0 && std::abs(error) > 0.02 * step) answer.settling = k + 2;
    if (step > 0) answer.overshoot = std::max(answer.overshoot, error / step);
    answer.peak = std::max(answer.peak, std::abs(error));
    answer.area += std::abs(error);
  }
  return answer;
}

/// Ours over the PID's.
struct Ratios {
  bool designed = false;
  double settling = 0, peak = 0, area = 0;
  double overshoot = 0, their_overshoot = 0;  ///< shares of the step
};

/// @return measured by a number, and by an encoder whose steps make the noise of the model
std::array<Ratios, 2> compared(int order, std::uint64_t seed) {
  overload_example::Dice random(seed);
  Settling plant = from_log::random_plant(order, random);
  const auto tuning = esokit::tune(plant.model, {}, {.simulate = esokit::TuneSimulation::none});
  if (!tuning || !tuning->designs.front().feasible) return {};
  const esokit::TunedDesign& design = tuning->designs.front();
  const double half = 0.5 * (plant.model.u_max - plant.model.u_min);
  const from_log::Pasting pasting = from_log::pasting_of(plant);
  const auto ours = [&](double step, double load) {
    from_log::Runner runner(pasting, *tuning, design);
    runner.start(plant.y, plant.u);
    return answer_of(plant, step, load, [&](double y, double r) { return runner.update(y, r); });
  };
  const auto theirs = [&](double step, double load) {
    auto pid = overload_example::Pid::simc(plant.model, design.control_noise);
    pid.start(plant.y, plant.u);
    return answer_of(plant, step, load, [&](double y, double r) { return pid.update(y, r); });
  };
  const double load = 0.2 * half * pasting.input_gain;
  const auto ratios = [&] {
    const Answer moved = ours(plant.step, 0), reference = theirs(plant.step, 0);
    const Answer loaded = ours(0, load), held = theirs(0, load);
    return Ratios{.designed = true,
                  .settling = moved.settling / reference.settling,
                  .peak = loaded.peak / held.peak,
                  .area = loaded.area / held.area,
                  .overshoot = moved.overshoot,
                  .their_overshoot = reference.overshoot};
  };
  std::array<Ratios, 2> all{ratios(), {}};
  if (order == 1) return all;
  plant.count = std::sqrt(12.0) * plant.model.noise;
  all[1] = ratios();
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(take_count(argc, argv, "--count", 40));
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  Report report(
      argc, argv, "from_log", "from_log_settling",
      {.paper_title = "From a log to a controller",
       .citation = "No paper. The code that is pasted, beside a PID by SIMC (Skogestad 2003)",
       .link = "",
       .title = "How soon it settles",
       .description =
           "Random plants that settle by themselves. A step of the reference and a load, "
           "under the code that from_log pastes and under a PI or PID by SIMC with the "
           "same noise in u.",
       .order = 3});
  std::vector<CsvRow> rows;
  std::array<std::vector<std::array<Ratios, 2>>, 2> of_order;
  for (const int order : {1, 2}) {
    of_order[static_cast<std::size_t>(order - 1)] =
        run_parallel("order " + std::to_string(order), count, [&](std::size_t i) {
          return compared(order,
                          (seed << 32u) + 1'000'003u * i + static_cast<std::uint64_t>(order));
        });
  }
  struct Group {
    const char* name;
    std::size_t order;
    std::size_t measured;
  };
  for (const Group& group :
       {Group{"order 1", 1, 0}, Group{"order 2", 2, 0}, Group{"order 2 with an encoder", 2, 1}}) {
    const std::string name = group.name;
    std::vector<Ratios> all;
    for (const auto& both : of_order[group.order - 1]) all.push_back(both[group.measured]);
    const auto part = [&](double Ratios::*member, double share) {
      std::vector<double> values;
      for (const Ratios& one : all) {
        if (one.designed) values.push_back(one.*member);
      }
      return from_log::quantile(values, share);
    };
    const auto designed =
        std::count_if(all.begin(), all.end(), [](const Ratios& one) { return one.designed; });
    const double few = static_cast<double>(designed);
    report.expect(name, "settling over SIMC's, median", part(&Ratios::settling, 0.5),
                  part(&Ratios::settling, 0.5) <= 1, "at most 1");
    report.expect(name, "settling over SIMC's, 95 %", part(&Ratios::settling, 0.95),
                  part(&Ratios::settling, 0.95) <= 1.3, "at most 1.3");
    report.expect(name, "load peak over SIMC's, median", part(&Ratios::peak, 0.5),
                  part(&Ratios::peak, 0.5) <= 1, "at most 1");
    report.expect(name, "load peak over SIMC's, 95 %", part(&Ratios::peak, 0.95),
                  part(&Ratios::peak, 0.95) <= 1.2, "at most 1.2");
    report.expect(name, "load area over SIMC's, median", part(&Ratios::area, 0.5),
                  part(&Ratios::area, 0.5) <= 1, "at most 1");
    report.expect(name, "load area over SIMC's, 95 %", part(&Ratios::area, 0.95),
                  part(&Ratios::area, 0.95) <= 1.2, "at most 1.2");
    report.check(name, "largest overshoot (%)", std::nullopt, 100 * part(&Ratios::overshoot, 1));
    report.check(name, "largest overshoot of SIMC's (%)", std::nullopt,
                 100 * part(&Ratios::their_overshoot, 1));
    report.check(name, "plants with a design", std::nullopt, few);
    rows.push_back({name, std::to_string(designed), number_text(part(&Ratios::settling, 0.5), 3),
                    number_text(part(&Ratios::settling, 0.95), 3),
                    number_text(100 * part(&Ratios::overshoot, 1), 3),
                    number_text(part(&Ratios::peak, 0.5), 3),
                    number_text(part(&Ratios::area, 0.5), 3)});
  }
  report.table("settling", "The pasted code over SIMC with the same noise in u",
               {"plants", "with a design", "settling, median", "settling, 95 %",
                "largest overshoot (%)", "load peak, median", "load area, median"},
               rows);
  return report.finish();
}
