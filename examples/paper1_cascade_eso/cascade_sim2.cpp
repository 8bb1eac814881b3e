// Sim2A and Sim2B: a planar vertical take-off and landing aircraft without and with measurement
// noise (Figs 6 to 9; Tables 3, 4).
//
// K. Lakomy, R. Madonski, "Cascade extended state observer for active disturbance rejection control
// applications under measurement noise", ISA Transactions 109 (2021) 1-10,
// doi:10.1016/j.isatra.2020.09.007.
//
// Way: continuous simulation, plant and both continuous observers as one ODE, Runge-Kutta of order
// 4 at 1 ms.
//
// Plant      x'' = -sin th (v1 + d1),  z'' = cos th (v1 + d1) - 1,  th'' = v2 + d2
//            (v1'', v2) = M(th, v1)^-1 (u_x, u_z),  M(th, a) = [-sin th, -a cos th; cos th, -a sin
//            th] so that x'''' = d_x + u_x and z'''' = d_z + u_z
// Reference  x_d = sin(3 t/4),  z_d = cos(3 t/4)/2 + 1
// Observer   (23), (24) of order 4 + 1 in each channel, driven by x + w_x and z + w_z, ghat = 1
// Control    u = v - dhat,  v = y_d'''' + sum_i k_i (y_d^(i) - yhat^(i))
// Start      x = z = 0, th = 0.6, v1 = 1.5, all rates 0
//
// symbol      code                 value                       unit
// gravity     Pvtol::derivative   1                           m/s^2, as in the plant above
// omega_o1    table3               200, 25.83, 9.65            rad/s, for p = 1, 2, 3
// alpha       factor               2.5 (the text: 3)           -
// k_0 .. k_3  printed_gains        6, 13.5, 13.5, 5.0625       s^-4 .. s^-1, the printed order
//             pvtol_noise_power    1e-17                       height of the noise's spectral
//             density pvtol_noise_hold     0.001                       s pvtol_from           5 (to
//             40)                   s, window of the criteria
// d1, d2      wind                 0 (the text: 0.3 + 0.2 sin t cos t, 0.2 + 0.1 sin(t/2) cos(t/2))
//
// What gives the paper's numbers is not what its text says: no wind, alpha = 2.5, observers of
// p = 1, 2 started from zero and those of p = 3 from the true states. By the letter p = 2 and 3
// diverge: the start-up peak of the observers drives v1 to 0, where M is singular. Both are
// shown, and a set-up of our own that flies with the printed wind.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "paper1_cascade_eso/paper1.hpp"
#include "paper1_cascade_eso/pvtol.hpp"

using namespace esokit::examples;
using namespace paper1;

namespace {

constexpr std::size_t seeds = 60;
constexpr const char* error_metric = "int sqrt(ex^2 + ez^2) dt";
constexpr const char* control_metric = "int v1^2 + v2^2 dt";
constexpr const char* estimate_metric = "int sqrt(z5x err^2 + z5z err^2) dt";

constexpr std::array table3 = {200.0, 25.83, 9.65};  // omega_o1, rad/s

struct Row {
  double error, control, estimate;
};
// Table 4 as printed.
constexpr std::array<Row, 3> table4_a = {
    {{3.237, 44.508, 0.122}, {3.092, 44.525, 0.122}, {2.990, 44.552, 0.122}}};
constexpr std::array<Row, 3> table4_b = {
    {{3.237, 27813.0, 1121.0}, {3.092, 45.244, 4.562}, {2.990, 44.643, 1.601}}};

/// The set-up that gives Table 4.
PvtolSetup paper_setup(std::size_t p, double noise) {
  return {.bandwidth = table3[p], .true_start = p == 2, .noise_power = noise};
}

/// The text's: wind, alpha = 3, observers from zero.
PvtolSetup literal_setup(std::size_t p) {
  return {.bandwidth = table3[p], .factor = 3.0, .wind = true};
}

/// Ours: the text's, with all observers started from the true states.
PvtolSetup flying_setup(std::size_t p, double noise) {
  return {.bandwidth = table3[p],
          .factor = 3.0,
          .wind = true,
          .true_start = true,
          .noise_power = noise};
}

int levels(std::size_t p) { return static_cast<int>(p) + 1; }

constexpr std::array colors = {Color::blue, Color::vermillion, Color::green};

/// How far the panels reach.
struct Look {
  Range v1, v2, estimate;
};

/// The samples from `from` to `to`, s; a long series is thinned before a panel cuts it.
std::vector<double> cut(const std::vector<double>& values, const std::vector<double>& t,
                        double from, double to) {
  const auto first = std::lower_bound(t.begin(), t.end(), from) - t.begin();
  const auto last = std::upper_bound(t.begin(), t.end(), to) - t.begin();
  return {values.begin() + first, values.begin() + last};
}

/// What is shown of each channel, in rows of two panels.
struct Signal {
  const char* name;
  const char* label;
  std::vector<double> PvtolSeries::*values;
};
constexpr std::array<Signal, 6> signals = {
    {{"error_x", "e_x (m)", &PvtolSeries::error_x},
     {"error_z", "e_z (m)", &PvtolSeries::error_z},
     {"v1", "v_1 (m/s²)", &PvtolSeries::v1},
     {"v2", "v_2 (rad/s²)", &PvtolSeries::v2},
     {"disturbance_error_x", "z_{5x} error (m/s⁴)", &PvtolSeries::estimate_error_x},
     {"disturbance_error_z", "z_{5z} error (m/s⁴)", &PvtolSeries::estimate_error_z}}};

/// The whole run.
Figure draw_whole(const std::string& name, const std::string& caption,
                  const std::array<PvtolSeries, 3>& runs, const Look& look) {
  Figure figure(name, {.rows = 4, .columns = 2, .panel_height = 170});
  figure.caption(caption);
  auto& path = figure.panel(0, 0).x_label("x (m)").y_label("z (m)").name("path");
  auto& position = figure.panel(0, 1).x_label("t (s)").y_label("x, z (m)").name("position");
  const Style reference{.name = "reference", .color = Color::black, .dash = Dash::dashed};
  for (std::size_t p = 0; p < 3; ++p) {
    Style style{.name = level_names[p], .color = colors[p], .width = 1.4};
    path.line(runs[p].x, runs[p].z, style);
    position.line(runs[p].t, runs[p].x, style);
    style.name.clear();
    style.column = "z, " + level_names[p];
    position.line(runs[p].t, runs[p].z, style);
  }
  const double lap = 2.0 * std::numbers::pi / 0.75;
  path.line(cut(runs[0].reference_x, runs[0].t, 0.0, lap),
            cut(runs[0].reference_z, runs[0].t, 0.0, lap), reference);
  // About the same length for a metre of x and of z.
  path.x_range(-1.42, 1.42).y_range(-0.1, 1.6).legend(Legend::bottom_left);
  position.line(runs[0].t, runs[0].reference_x, reference);
  position.line(runs[0].t, runs[0].reference_z,
                {.color = Color::black, .dash = Dash::dashed, .column = "reference z"});
  position.x_range(0.0, pvtol_end).note(20.5, 1.75, "z").note(20.5, -0.85, "x");
  position.y_range(-1.2, 2.0).legend(Legend::above);
  const std::array<Range, 6> ranges = {
      {{-0.5, 2.0}, {-0.5, 2.0}, look.v1, look.v2, look.estimate, look.estimate}};
  for (std::size_t i = 0; i < signals.size(); ++i) {
    auto& panel = figure.panel(1 + i / 2, i % 2).name(signals[i].name);
    panel.x_label("t (s)").y_label(signals[i].label).x_range(0.0, pvtol_end).y_range(ranges[i]);
    panel.legend(i < 2 ? Legend::above : Legend::none);
    for (std::size_t p = 0; p < 3; ++p) {
      panel.line(runs[p].t, runs[p].*signals[i].values,
                 {.name = level_names[p], .color = colors[p], .width = 1.2});
    }
    if (i < 2) {
      panel.inset({.left = 0.36, .bottom = 0.5, .width = 0.6, .height = 0.42, .x = {5.0, 15.0}});
    }
  }
  return figure;
}

/// A part of it; beside the noise of p = 1 the cascades are flat lines, so they have a row alone.
Figure draw_part(const std::string& name, const std::string& caption,
                 const std::array<PvtolSeries, 3>& runs, double from, double to, bool noisy) {
  Figure figure(name, {.rows = noisy ? 4U : 3U, .columns = 2, .panel_height = 150});
  figure.caption(caption);
  const auto add = [&](std::size_t row, std::size_t i, std::size_t first) {
    auto& panel = figure.panel(row, i % 2).x_label("t (s)").y_label(signals[i].label);
    panel.name(signals[i].name + std::string(first > 0 ? "_cascades" : "")).x_range(from, to);
    panel.legend(row == 0 || first > 0 ? Legend::above : Legend::none);
    for (std::size_t p = first; p < 3; ++p) {
      panel.line(cut(runs[p].t, runs[p].t, from, to),
                 cut(runs[p].*signals[i].values, runs[p].t, from, to),
                 {.name = level_names[p], .color = colors[p], .width = 1.2});
    }
  };
  for (std::size_t i = 0; i < signals.size(); ++i) add(i / 2, i, 0);
  if (noisy) {
    add(3, 4, 1);  // z_5x error
    add(3, 3, 1);  // v_2
  }
  return figure;
}

std::array<PvtolSeries, 3> record(PvtolSetup (*setup)(std::size_t, double), double noise) {
  std::array<PvtolSeries, 3> runs;
  for (std::size_t p = 0; p < 3; ++p) (void)run_pvtol(levels(p), setup(p, noise), 1, &runs[p]);
  return runs;
}

/// Criteria of `count` seeds for each p.
std::array<std::vector<PvtolCriteria>, 3> all_seeds(const char* label, std::size_t count,
                                                    PvtolSetup (*setup)(std::size_t, double)) {
  const auto flat = run_parallel(label, 3 * count, [&](std::size_t job) {
    const std::size_t p = job / count;
    return run_pvtol(levels(p), setup(p, pvtol_noise_power), 1 + job % count);
  });
  std::array<std::vector<PvtolCriteria>, 3> runs;
  for (std::size_t job = 0; job < flat.size(); ++job) runs[job / count].push_back(flat[job]);
  return runs;
}

std::string with_deviation(const Statistics& seeds_of) {
  return number_text(seeds_of.mean, 5) + " (" + number_text(seeds_of.standard_deviation, 2) + ")";
}

/// Table 4 and Figs 6 to 9 in the set-up that gives their numbers.
void reproduce(Report& report) {
  const std::string reason =
      "26000 set-ups of an independent search do not give this column; over 0..40 s ours has its "
      "order of magnitude, but not its numbers";
  std::vector<CsvRow> whole;
  std::array<PvtolCriteria, 3> a;
  for (std::size_t p = 0; p < 3; ++p) {
    const PvtolCriteria& ours = a[p] = run_pvtol(levels(p), paper_setup(p, 0.0));
    const std::string name = "Sim2A, " + level_names[p];
    report.known_miss(name, error_metric, table4_a[p].error, ours.error, 0.02, reason);
    report.check(name, control_metric, table4_a[p].control, ours.control, 0.02);
    report.check(name, estimate_metric, table4_a[p].estimate, ours.estimate, 0.02);
    whole.push_back({level_names[p], number_text(table4_a[p].error, 4), number_text(ours.error, 4),
                     number_text(ours.whole_error, 4)});
  }
  const auto b = all_seeds("Sim2B, seeds", seeds, paper_setup);
  for (std::size_t p = 0; p < 3; ++p) {
    const std::string name = "Sim2B, " + level_names[p];
    const auto control = statistics_of(b[p], &PvtolCriteria::control);
    const auto estimate = statistics_of(b[p], &PvtolCriteria::estimate);
    report.known_miss(name, error_metric, table4_b[p].error,
                      statistics_of(b[p], &PvtolCriteria::error), 0.02, reason);
    report.check(name, control_metric, table4_b[p].control, control,
                 Tolerance::deviations(PrintedColumn::within, control).or_relative(0.02));
    report.check(name, estimate_metric, table4_b[p].estimate, estimate,
                 Tolerance::deviations(PrintedColumn::within, estimate).or_relative(0.02));
  }

  report.correction({.where = "(33), (36)",
                     .printed = "d2'' in the second channel; v1'' counted twice",
                     .correct = "d2; d = x^(4) - u from the exact dynamics",
                     .why = "differentiated twice, theta'' = v2 + d2 holds d2 itself"});
  report.correction({.where = "Table 3",
                     .printed = "caption: used in Sim1A and Sim1B",
                     .correct = "Sim2A and Sim2B",
                     .why = "it stands in section 4.2 and has alpha = 3"});

  std::vector<CsvRow> bandwidths;
  for (std::size_t p = 0; p < 3; ++p) {
    CsvRow row{level_names[p]};
    for (std::size_t i = 0; i < 3; ++i) {
      row.push_back(i <= p ? number_text(table3[p] * std::pow(2.5, static_cast<double>(i)), 5)
                           : "");
    }
    for (std::size_t i = 1; i < 3; ++i) {
      row.push_back(i <= p ? number_text(table3[p] * std::pow(3.0, static_cast<double>(i)), 5)
                           : "");
    }
    bandwidths.push_back(row);
  }
  report.table("3",
               "Table 3: bandwidths of the levels (rad/s), omega_oi = alpha^(i-1) omega_o1, with "
               "the alpha = 2.5 that reproduces Table 4, and with the printed alpha = 3",
               {"observer", "omega_o1", "omega_o2, alpha = 2.5", "omega_o3, alpha = 2.5",
                "omega_o2, alpha = 3", "omega_o3, alpha = 3"},
               bandwidths);
  report.comparison("4", "Table 4: criteria over 5..40 s; Sim2B: mean (standard deviation) over " +
                             std::to_string(seeds) + " seeds");
  report.remark(
      "The numbers are reproduced with these settings: no wind, alpha = 2.5, the gains in the "
      "printed order, RK4 at 1 ms. The observers with p = 1 and 2 start from zero, those with p = "
      "3 from the true states.");
  report.not_reproduced(
      "The column of the tracking error in Table 4 is not reproduced: 3.237, 3.092, 2.990 in the "
      "paper, " +
      whole[0][2] + ", " + whole[1][2] + ", " + whole[2][2] +
      " here. An independent search tried 26000 set-ups (axes, sums, squares, weights, windows, "
      "initial states, limits, the error-based form). A window from 0 s, which includes the "
      "start-up, gives the right order of magnitude (" +
      whole[0][3] + ", " + whole[1][3] + ", " + whole[2][3] + " here), but not the numbers.");
  report.table("error", "The tracking error column of Table 4, Sim2A: the paper's and ours",
               {"observer", "paper", "ours, 5..40 s", "ours, 0..40 s"}, whole);

  const auto quiet = record(paper_setup, 0.0);
  const auto noisy = record(paper_setup, pvtol_noise_power);
  report.remark(
      "Figs 7 and 9 of the paper are closer looks at Figs 6 and 8. Which of the signals they show, "
      "and over which time, is not in its text; here they show six signals from 20 s on.");
  report.add(draw_whole("fig6",
                        "Fig. 6 (Sim2A): path, tracking errors, control and errors of the total "
                        "disturbances without noise. The peaks at the start are cut off.",
                        quiet, {.v1 = {0.0, 4.0}, .v2 = {-2.0, 4.0}, .estimate = {-0.05, 0.1}}));
  report.add(
      draw_part("fig7", "Fig. 7 (Sim2A): Fig. 6 from 20 to 30 s.", quiet, 20.0, 30.0, false));
  report.add(draw_whole("fig8",
                        "Fig. 8 (Sim2B): the same as Fig. 6 with noise (one seed). The peaks at "
                        "the start are cut off.",
                        noisy,
                        {.v1 = {0.0, 4.0}, .v2 = {-150.0, 150.0}, .estimate = {-100.0, 100.0}}));
  report.add(draw_part("fig9",
                       "Fig. 9 (Sim2B): Fig. 8 from 20 to 20.5 s; bottom: the cascades alone.",
                       noisy, 20.0, 20.5, true));

  // ---- what the paper claims of it
  const auto verdict = [](bool holds) { return holds ? Claim::Holds::yes : Claim::Holds::no; };
  const auto spread_of = [&](double PvtolCriteria::*number) {
    const double most = std::max({a[0].*number, a[1].*number, a[2].*number});
    return 100.0 * (most / std::min({a[0].*number, a[1].*number, a[2].*number}) - 1.0);
  };
  const double control_spread = spread_of(&PvtolCriteria::control);
  const double estimate_spread = spread_of(&PvtolCriteria::estimate);
  report.claim({.text = "Without noise the aircraft's disturbance errors and control effort are "
                        "comparable for all observers.",
                .where = "4.2, Figs 6, 7; Table 4, A",
                .holds = verdict(control_spread < 20.0 && estimate_spread < 2.0),
                .here = "The integrals of |z5 error| differ by " + number_text(estimate_spread, 2) +
                        " %, those of v1^2 + v2^2 by " + number_text(control_spread, 2) +
                        " % at most.",
                .figure = "fig7"});
  const auto mean_b = [&](std::size_t p, double PvtolCriteria::*number) {
    return statistics_of(b[p], number).mean;
  };
  const auto numbers = [&](double PvtolCriteria::*number) {
    return shown_text(mean_b(0, number)) + ", " + shown_text(mean_b(1, number)) + ", " +
           shown_text(mean_b(2, number));
  };
  const auto falls = [&](std::size_t from, std::size_t to) {
    return mean_b(to, &PvtolCriteria::control) < mean_b(from, &PvtolCriteria::control) &&
           mean_b(to, &PvtolCriteria::estimate) < mean_b(from, &PvtolCriteria::estimate);
  };
  report.claim(
      {.text = "With noise the cascades attenuate it better, above all in the disturbance "
               "estimate and in v2.",
       .where = "4.2, Figs 8, 9; Table 4, B",
       .holds = verdict(falls(0, 1)),
       .here = "int v1^2 + v2^2 is " + numbers(&PvtolCriteria::control) + " for p = 1, 2, 3.",
       .figure = "fig9"});
  report.claim({.text = "The third level reduces the noise further.",
                .where = "4.2, Figs 8, 9; Table 4, B",
                .holds = verdict(falls(1, 2)),
                .here = "The integral of the disturbance error is " +
                        numbers(&PvtolCriteria::estimate) + " for p = 1, 2, 3.",
                .figure = "fig9"});
  double moved = 0.0;
  double largest = 0.0;
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t k = 0; k < quiet[p].t.size(); ++k) {
      if (quiet[p].t[k] < pvtol_from) continue;
      moved = std::max(moved, std::abs(noisy[p].v1[k] - quiet[p].v1[k]));
      largest = std::max(largest, quiet[p].v1[k]);
    }
  }
  report.claim({.text = "The noise does not visibly reach v1.",
                .where = "4.2, Fig 8",
                .holds = verdict(moved < 0.01 * largest),
                .here = "It moves v1 by " + number_text(100.0 * moved / largest, 1) +
                        " % of its largest value at most.",
                .figure = "fig8"});
}

/// Sim2B with p = 1 is not converged at the paper's step.
void show_step(Report& report) {
  report.additions();
  constexpr std::array steps = {1e-3, 5e-4, 2e-4, 1e-4};
  constexpr std::size_t count = 8;
  const auto runs = run_parallel("Sim2B, p = 1, steps", steps.size() * count, [&](std::size_t job) {
    // The longest first, so that both cores end together.
    auto setup = paper_setup(0, pvtol_noise_power);
    setup.step = steps[steps.size() - 1 - job / count];
    return run_pvtol(1, setup, 1 + job % count);
  });
  std::vector<CsvRow> lines;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto first = runs.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1 - i) * count);
    const std::vector<PvtolCriteria> mine(first, first + count);
    const auto control = statistics_of(mine, &PvtolCriteria::control);
    const auto estimate = statistics_of(mine, &PvtolCriteria::estimate);
    lines.push_back(
        {number_text(1e3 * steps[i]), with_deviation(control), with_deviation(estimate)});
    if (i + 1 == steps.size()) {
      const auto below = [](double paper, double ours) {
        return number_text(100.0 * (1.0 - ours / paper), 2);
      };
      report.not_reproduced(
          "Sim2B with p = 1 depends on the step of the integration: the numbers of the paper are "
          "those of a fixed step of 1 ms. With a step of 0.1 ms, which is small enough, they are " +
              below(table4_b[0].control, control.mean) + " and " +
              below(table4_b[0].estimate, estimate.mean) + " % lower.",
          Miss::not_published);
      const std::string name = "Sim2B, p = 1, step 0.1 ms";
      report.check_reference(
          name, control_metric, 23900.0, control,
          Tolerance::deviations(PrintedColumn::within, control).or_relative(0.02));
      report.check_reference(
          name, estimate_metric, 1029.0, estimate,
          Tolerance::deviations(PrintedColumn::within, estimate).or_relative(0.02));
    }
  }
  report.table(
      "step",
      "Sim2B, p = 1, over the step of the integration (" + std::to_string(count) +
          " seeds, the same at each step): the 27813 and 1121 of the paper are those of 1 ms",
      {"step (ms)", control_metric, estimate_metric}, lines);
}

/// By the letter of the text p = 2 and 3 do not fly.
void show_literal(Report& report) {
  std::array<PvtolSeries, 3> runs;
  std::vector<CsvRow> lines;
  for (std::size_t p = 0; p < 3; ++p) {
    const auto ours = run_pvtol(levels(p), literal_setup(p), 0, &runs[p]);
    const bool flies = ours.end >= pvtol_end;
    const std::string name = "literal text, " + level_names[p];
    // When a lost run ends is chance; when v1 comes to 0 is not.
    if (p == 0) {
      report.expect(name, "end of the run (s)", ours.end, flies, "flies for 40 s");
    } else {
      report.expect(name, "v1 < 0.05 first at (s)", ours.singular_time,
                    !flies && ours.singular_time > 0.0 && ours.singular_time < 0.5,
                    "M becomes singular in the start-up peak, and the run diverges");
    }
    lines.push_back({level_names[p], flies ? "flies" : "diverges",
                     ours.singular_time >= 0.0 ? number_text(ours.singular_time, 4) : "never",
                     number_text(ours.end, 4)});
  }
  report.table("literal",
               "The set-up of the text (wind, alpha = 3, observers started from zero): v1 below "
               "0.05 means that M is almost singular",
               {"observer", "outcome", "v1 < 0.05 first at (s)", "end of the run (s)"}, lines);
  report.not_reproduced(
      "With the set-up of the text (wind, alpha = 3, observers started from zero) the aircraft "
      "does not fly with p = 2 and p = 3: the start-up peak of the observers drives v1 to 0.",
      Miss::other_reading);
  Figure figure("literal", {.rows = 1, .columns = 2, .panel_height = 200});
  figure.caption(
      "The set-up of the text (wind, alpha = 3, observers started from zero): the thrust v_1 "
      "reaches 0, where M is singular, and the run diverges.");
  auto& v1 = figure.panel(0, 0).x_label("t (s)").y_label("v_1 (m/s²)").name("v1");
  auto& error = figure.panel(0, 1).x_label("t (s)").y_label("|e| (m)").name("error");
  for (std::size_t p = 0; p < 3; ++p) {
    const Style style{.name = level_names[p], .color = colors[p]};
    std::vector<double> distance;
    for (std::size_t i = 0; i < runs[p].t.size(); ++i) {
      distance.push_back(std::hypot(runs[p].error_x[i], runs[p].error_z[i]));
    }
    v1.line(cut(runs[p].t, runs[p].t, 0.0, 1.5), cut(runs[p].v1, runs[p].t, 0.0, 1.5), style);
    error.line(runs[p].t, distance, style);
  }
  v1.x_range(0.0, 1.5).y_range(-2.0, 6.0).horizontal_line(0.0).legend(Legend::above);
  error.x_range(0.0, 15.0).y_range(1e-3, 1e2).log_y().legend(Legend::above);
  report.add(figure);
}

/// Our addition: with the observers started from the true states the printed wind is no harm.
void show_flying(Report& report) {
  constexpr std::size_t count = 20;
  const auto b = all_seeds("with wind, seeds", count, flying_setup);
  std::vector<CsvRow> lines;
  for (std::size_t p = 0; p < 3; ++p) {
    const auto ours = run_pvtol(levels(p), flying_setup(p, 0.0));
    const std::string name = "wind, our set-up, " + level_names[p];
    report.expect(name, "end of the run (s)", ours.end, ours.end >= pvtol_end, "flies for 40 s");
    report.check(name, error_metric, std::nullopt, ours.error);
    report.check(name, control_metric, std::nullopt, ours.control);
    report.check(name, estimate_metric, std::nullopt, ours.estimate);
    lines.push_back({level_names[p] + ", without noise", number_text(ours.error, 4),
                     number_text(ours.control, 5), number_text(ours.estimate, 4)});
  }
  for (std::size_t p = 0; p < 3; ++p) {
    lines.push_back({level_names[p] + ", with noise",
                     with_deviation(statistics_of(b[p], &PvtolCriteria::error)),
                     with_deviation(statistics_of(b[p], &PvtolCriteria::control)),
                     with_deviation(statistics_of(b[p], &PvtolCriteria::estimate))});
  }
  report.table("wind",
               "Our addition: the printed wind and alpha = 3, all observers started from the true "
               "states; noise: mean (standard deviation) over " +
                   std::to_string(count) + " seeds",
               {"case", error_metric, control_metric, estimate_metric}, lines);
  const auto runs = record(flying_setup, 0.0);
  report.add(draw_whole("wind",
                        "Our addition: the printed wind, alpha = 3, observers started from the "
                        "true states; no noise.",
                        runs, {.v1 = {0.0, 4.0}, .v2 = {-2.0, 6.0}, .estimate = {-0.2, 0.4}}));
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, folder, "sim2",
      about("Sim2A and Sim2B: PVTOL aircraft (Figs 6 to 9; Tables 3, 4)",
            "Tracking of an ellipse by an aircraft with two coupled channels of order 4, "
            "without (A) and with (B) measurement noise. Continuous simulation, RK4 at 1 ms.",
            3));
  reproduce(report);
  show_step(report);
  show_literal(report);
  show_flying(report);
  return report.finish();
}
