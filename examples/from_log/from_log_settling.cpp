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
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include <esokit/tune/tune.hpp>

#include "choosing/overload.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "from_log/parts/paste.hpp"

using namespace esokit::examples;

namespace {

/// A plant, and how wrong its model is.
struct Settling {
  esokit::TuneModel model{};
  double pole = 0, gain = 0, lag = 0;  ///< of the plant
  std::size_t late = 0;                ///< samples of its dead time
  double y = 0, u = 0;                 ///< where it rests
  double step = 0;                     ///< of r
};

Settling random_plant(int order, overload_example::Dice& random) {
  Settling all;
  auto& m = all.model;
  const auto logarithmic = [&](double low, double high) {
    return std::exp(random.between(std::log(low), std::log(high)));
  };
  const bool one_sided = order == 1 && random.with(0.5);
  m.order = order;
  m.sample_time = 1;
  m.pole = 1 / logarithmic(30, 1500);
  m.lag = random.with(0.3) ? 0 : logarithmic(0.5, 0.15 / m.pole);
  m.dead_time = std::floor(random.between(0, 8));
  // The range of u moves y by 100, or y' by 1.
  m.input_gain = {order == 1 ? m.pole : 0.01 * m.pole, 0};
  m.input_gain.half_width = 0.08 * m.input_gain.value;
  m.latency_half_width = 0.1 * (m.lag + m.dead_time);
  m.noise = logarithmic(0.005, 0.3) * (order == 1 ? 1 : 0.1);
  m.disturbance = m.disturbance_of(logarithmic(0.002, 0.1) / (1 + 0.2 * (m.dead_time + m.lag)));
  m.u_min = one_sided ? 0 : -50;
  m.u_max = one_sided ? 100 : 50;
  all.y = one_sided ? 20 : 0;
  all.step = logarithmic(3, order == 1 ? 45 : 30);
  const double late = random.between(-0.15, 0.15);
  all.pole = m.pole * random.between(0.8, 1.2);
  all.gain = m.input_gain.value * random.between(0.92, 1.08);
  all.lag = m.lag * (1 + late);
  all.late = static_cast<std::size_t>(std::lround(m.dead_time * (1 + late)));
  all.u = order == 1 ? all.pole * all.y / all.gain : 0;
  return all;
}

struct Answer {
  double settling = 0, overshoot = 0, peak = 0, area = 0;
};

/// @param load of y^(n), from the beginning on
template <class Control>
Answer answer_of(const Settling& plant, double step, double load, Control control) {
  std::deque<double> line(plant.late, plant.u);
  double y = plant.y, rate = 0, v = plant.u;
  const int rows = static_cast<int>(6000 + 20 / plant.pole);
  Answer answer;
  for (int k = 0; k < rows; ++k) {
    line.push_back(control(y, plant.y + step));
    const double u = line.front();
    line.pop_front();
    constexpr int parts = 20;
    constexpr double h = 1.0 / parts;
    for (int i = 0; i < parts; ++i) {
      v = plant.lag > 0 ? v - std::expm1(-h / plant.lag) * (u - v) : u;
      if (plant.model.order == 1) {
        y += h * (plant.gain * v - plant.pole * y + load);
      } else {
        const double change = plant.gain * v - plant.pole * rate + load;
        y += h * (rate + 0.5 * h * change);
        rate += h * change;
      }
    }
    const double error = y - plant.y - step;
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

Ratios compared(int order, std::uint64_t seed) {
  overload_example::Dice random(seed);
  const Settling plant = random_plant(order, random);
  const auto tuning = esokit::tune(plant.model, {}, {.simulate = esokit::TuneSimulation::none});
  if (!tuning || !tuning->designs.front().feasible) return {};
  const esokit::TunedDesign& design = tuning->designs.front();
  const double half = 0.5 * (plant.model.u_max - plant.model.u_min);
  from_log::Pasting pasting;
  pasting.order = order;
  pasting.input_gain = plant.model.input_gain.value;
  pasting.pole = plant.model.pole;
  pasting.dead_time = plant.model.dead_time;
  pasting.room = half * pasting.input_gain;
  pasting.shortest = 4 * plant.model.latency();
  pasting.pole_reach = 2 * half;
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
  const Answer moved = ours(plant.step, 0), reference = theirs(plant.step, 0);
  const Answer loaded = ours(0, load), held = theirs(0, load);
  return {.designed = true,
          .settling = moved.settling / reference.settling,
          .peak = loaded.peak / held.peak,
          .area = loaded.area / held.area,
          .overshoot = moved.overshoot,
          .their_overshoot = reference.overshoot};
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
  for (const int order : {1, 2}) {
    const std::string name = "order " + std::to_string(order);
    const auto all = run_parallel(name, count, [&](std::size_t i) {
      return compared(order, (seed << 32u) + 1'000'003u * i + static_cast<std::uint64_t>(order));
    });
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
