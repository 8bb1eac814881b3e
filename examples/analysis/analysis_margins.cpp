// How much gain, phase and delay the loop of paper 1's plant can take, against the bandwidth of its
// observer.
//
// Plant and settings: the generic example of K. Lakomy, R. Madonski, ISA Transactions 109 (2021)
// 1-10, doi:10.1016/j.isatra.2020.09.007, with its gain g frozen at 1; the margins are ours.
//
// Way: sampled, sampled observers and a plant sampled exactly; nothing is simulated.
//
// symbol     code            value                 unit
// plant      LinearPlant     y'' + 2 y' + y = u    -
// ghat       input_gain      1                     -
// omega_c    control         2 (gains 4, 4)        rad/s
// omega_o1   grid            4 .. 400              rad/s
// alpha      level_factor    2                     -
// T          sample_time     0.001                 s
// Table 1    table1          250, 60.82, 33.98     rad/s, for p = 1, 2, 3

#include <array>
#include <limits>
#include <numbers>
#include <optional>

#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/margins.hpp>

#include "analysis/analysis.hpp"

using namespace esokit::examples;
using namespace analysis;

namespace {

constexpr double sample_time = 1e-3;
constexpr double control = 2.0;
constexpr int points = 70;
constexpr std::array<double, 3> table1 = {250.0, 60.82, 33.98};

struct LoopMargins {
  double increase, decrease, phase, delay, modulus, lower, upper;
};

template <int Levels>
LoopMargins margins_at(double bandwidth) {
  const auto plant = LinearPlant<2>::chain({.coefficients = {1.0, 2.0}}).value();
  const auto loop = closed_loop(plant, controller_with<2, Levels>(bandwidth, sample_time, control));
  const auto all = margins(*loop).value();
  const auto range = input_gain_range(*loop).value();
  const auto value = [](const Margin& margin) {  // nothing is drawn where there is no limit
    return margin.limited() ? margin.value : std::numeric_limits<double>::quiet_NaN();
  };
  return {value(all.gain_increase),
          value(all.gain_decrease),
          value(all.phase) * 180.0 / std::numbers::pi,
          value(delay_margin(*loop).value()) * 1e3,
          value(all.modulus),
          range.lower,
          range.upper};
}

LoopMargins margins_at(std::size_t levels, double bandwidth) {
  switch (levels) {
    case 1:
      return margins_at<1>(bandwidth);
    case 2:
      return margins_at<2>(bandwidth);
    default:
      return margins_at<3>(bandwidth);
  }
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "margins",
                about("Margins against the observer's bandwidth, plant of paper 1",
                      "Gain, phase, delay and modulus margin of the sampled loop (T = 1 ms), "
                      "opened at the plant's input. Exact, nothing is simulated."));
  const auto grid = log_grid<points>(4.0, 400.0).value();
  Figure figure("margins", {.rows = 2, .columns = 2, .panel_height = 220});
  figure.caption(
      "Margins of the loop with the plant of paper 1 (g = 1), omega_c = 2 rad/s, T = 1 ms; dots: "
      "the bandwidths of Table 1, at which the three observe a disturbance about equally well. The "
      "bandwidth of the observer hardly touches gain, phase and modulus, but the delay that the "
      "loop "
      "can take falls as one over it; every level of a cascade costs gain and phase.");
  auto& gain = figure.panel(1, 0).title("gain margin, upwards").name("gain");
  auto& phase = figure.panel(0, 0).title("phase margin").name("phase");
  auto& delay = figure.panel(1, 1).title("delay margin").name("delay");
  auto& modulus = figure.panel(0, 1).title("modulus margin").name("modulus");
  gain.y_label("factor").log_y().legend(Legend::above);
  phase.y_label("phase (°)").y_range(0.0, 90.0).y_tick(15.0).legend(Legend::above);
  delay.y_label("delay (ms)").log_y().legend(Legend::above);
  modulus.y_label("min abs(1 + L)").y_range(0.0, 1.0).y_tick(0.2).legend(Legend::above);
  for (Panel* panel : {&gain, &phase, &delay, &modulus}) {
    panel->log_x().x_label("ω_{o1} (rad/s)").x_range(4.0, 400.0);
  }
  constexpr std::array colors = {Color::blue, Color::vermillion, Color::green};
  std::vector<CsvRow> lines;
  double before = 1.0;
  for (std::size_t p = 1; p <= 3; ++p) {
    std::array<std::vector<double>, 4> curves;
    for (const double w : grid) {
      const LoopMargins m = margins_at(p, w);
      curves[0].push_back(m.increase);
      curves[1].push_back(m.phase);
      curves[2].push_back(m.delay);
      curves[3].push_back(m.modulus);
    }
    const std::string name = "p = " + std::to_string(p);
    const LoopMargins at = margins_at(p, table1[p - 1]);
    const std::array dots = {at.increase, at.phase, at.delay, at.modulus};
    const std::array<Panel*, 4> panels = {&gain, &phase, &delay, &modulus};
    for (std::size_t i = 0; i < 4; ++i) {
      panels[i]->line(grid, curves[i], {.name = name, .color = colors[p - 1], .width = 1.8});
      panels[i]->points({table1[p - 1]}, {dots[i]},
                        {.color = colors[p - 1],
                         .marker = Marker::circle,
                         .size = 1.3,
                         .column = name + " Table 1"});
    }
    lines.push_back({name, number_text(table1[p - 1], 4), number_text(at.increase, 4),
                     number_text(at.phase, 3), number_text(at.delay, 3), number_text(at.modulus, 3),
                     number_text(at.lower, 3),
                     std::isfinite(at.upper) ? number_text(at.upper, 3) : "no limit"});
    // The paper's g wanders between 0.8 / 2 (y near 1) and 1.2, ghat / g between 0.83 and 2.5.
    report.expect(name + ", Table 1", "least stable ghat / g", at.lower, at.lower < 0.83,
                  "below 0.83, the least that the paper's plant has");
    report.expect(name + ", Table 1", "modulus margin", at.modulus, at.modulus < before,
                  "every level costs robustness: the peak of the sensitivity is its inverse");
    before = at.modulus;
    report.check(name + ", Table 1", "delay margin (ms)", std::nullopt, at.delay);
  }
  report.add(figure);
  report.table("margins", "At the bandwidths of Table 1 of the paper",
               {"observer", "omega_o1 (rad/s)", "gain upwards", "phase (°)", "delay (ms)",
                "modulus", "least ghat/g", "greatest ghat/g"},
               lines);
  return report.finish();
}
