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

#include <algorithm>
#include <array>
#include <limits>
#include <numbers>
#include <optional>

#include <esokit/analysis/worst_case.hpp>

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

/// The plants among which the paper's is: its gain g follows y, and computing may take a while.
constexpr std::array<Interval<>, 2> plants{{{0.4, 1.2}, {0.0, 5e-3}}};

LinearPlant<2> plant_of(const Array<double, 2>& gain_and_dead_time) {
  return LinearPlant<2>::chain({.coefficients = {1.0, 2.0},
                                .input_gain = gain_and_dead_time[0],
                                .dead_time = gain_and_dead_time[1]})
      .value();
}

/// The worst among them, and the modulus margin against g with no dead time and with the largest.
struct Spread {
  WorstCase<2> worst;
  std::array<std::vector<double>, 2> modulus;
};

template <int Levels>
Spread spread_of(const std::vector<double>& gains) {
  const auto controller = controller_with<2, Levels>(table1[Levels - 1], sample_time, control);
  Spread spread{worst_case(plant_of, plants, controller).value(), {}};
  for (const double gain : gains) {
    spread.modulus[0].push_back(
        margins(plant_of({gain, plants[1].lower}), controller)->modulus.value);
    spread.modulus[1].push_back(
        margins(plant_of({gain, plants[1].upper}), controller)->modulus.value);
  }
  return spread;
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
  Report report(
      argc, argv, folder, "margins",
      about("Margins over the bandwidth of the observer, plant of paper 1",
            "Gain, phase, delay and modulus margin of the sampled loop (T = 1 ms), opened at the "
            "input of the plant. The results are exact, nothing is simulated."));
  const auto grid = log_grid<points>(4.0, 400.0).value();
  Figure figure("margins", {.rows = 2, .columns = 2, .panel_height = 220});
  figure.caption(
      "Margins of the loop with the plant of paper 1 (g = 1), omega_c = 2 rad/s, T = 1 ms; dots: "
      "the bandwidths of Table 1, at which the three observers estimate a disturbance about "
      "equally well. The bandwidth of the observer hardly affects the gain, phase and modulus "
      "margins, but the delay margin is inversely proportional to it. Every level of a cascade "
      "reduces the gain and phase margins.");
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

  std::vector<double> gains;
  for (int i = 0; i <= 40; ++i) gains.push_back(0.4 + 0.02 * i);
  Figure cases("worst_case", {.rows = 1, .columns = 1, .panel_height = 260});
  cases.caption(
      "Modulus margin with the three observers of Table 1, over the plants that the paper allows "
      "(gain g between 0.4 and 1.2) and a dead time of up to 5 ms (solid: none, dashed: 5 ms). "
      "Dots: the worst case that worst_case finds without trying all plants. With one and two "
      "levels the margin is smallest at the largest gain, with three levels at the smallest gain.");
  auto& panel = cases.panel(0, 0).title("modulus margin over the plants").name("worst_case");
  panel.x_label("g").y_label("min abs(1 + L)").x_range(0.35, 1.25).y_range(0.0, 1.0);
  panel.legend(Legend::above);
  const std::array spreads = {spread_of<1>(gains), spread_of<2>(gains), spread_of<3>(gains)};
  std::vector<CsvRow> worst_lines;
  for (std::size_t p = 1; p <= 3; ++p) {
    const WorstCase<2>& worst = spreads[p - 1].worst;
    const auto& [without, late] = spreads[p - 1].modulus;
    const std::string name = "p = " + std::to_string(p);
    panel.line(gains, without, {.name = name, .color = colors[p - 1], .width = 1.8});
    panel.line(
        gains, late,
        {.name = name + ", 5 ms", .color = colors[p - 1], .dash = Dash::dashed, .width = 1.4});
    panel.points(
        {worst.modulus.parameters[0]}, {worst.modulus.value},
        {.color = colors[p - 1], .marker = Marker::circle, .size = 1.4, .column = name + " worst"});
    worst_lines.push_back({name, number_text(worst.modulus.value, 3),
                           number_text(worst.modulus.parameters[0], 3),
                           number_text(1e3 * worst.modulus.parameters[1], 2),
                           number_text(worst.phase.value * 180.0 / std::numbers::pi, 3),
                           number_text(1e3 * worst.delay.value, 3)});
    double least = 1.0;
    for (const auto& curve : {without, late})
      least = std::min(least, *std::ranges::min_element(curve));
    report.expect(name + ", worst case", "modulus margin", worst.modulus.value,
                  worst.stable() && worst.modulus.value <= least * (1.0 + 1e-6),
                  "stable for every plant, and no point of the figure is worse");
  }
  report.add(cases);
  report.table("worst_case", "Worst over g = 0.4 .. 1.2 and a dead time of 0 .. 5 ms",
               {"observer", "modulus", "at g", "at dead time (ms)", "phase (°)", "delay (ms)"},
               worst_lines);
  return report.finish();
}
