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

/// How far the panels reach, and what their zooms show.
struct Look {
  Range v1, v2, estimate;
  Range zoom{20.0, 30.0};
  bool noisy = false;  ///< closer panels for p = 2, 3
};

/// The samples from `from` to `to`, s; a long series is thinned before a panel cuts it.
std::vector<double> cut(const std::vector<double>& values, const std::vector<double>& t,
                        double from, double to) {
  const auto first = std::lower_bound(t.begin(), t.end(), from) - t.begin();
  const auto last = std::upper_bound(t.begin(), t.end(), to) - t.begin();
  return {values.begin() + first, values.begin() + last};
}

Figure draw_tracking(const std::string& name, const std::string& caption,
                     const std::array<PvtolSeries, 3>& runs) {
  Figure figure(name, {.rows = 2, .columns = 2, .panel_height = 215});
  figure.caption(caption);
  auto& path = figure.panel(0, 0).x_label("x (m)").y_label("z (m)").name("path");
  auto& position = figure.panel(0, 1).x_label("t (s)").y_label("x, z (m)").name("position");
  auto& error_x = figure.panel(1, 0).x_label("t (s)").y_label("e_x (m)").name("error_x");
  auto& error_z = figure.panel(1, 1).x_label("t (s)").y_label("e_z (m)").name("error_z");
  const Style reference{.name = "reference", .color = Color::black, .dash = Dash::dashed};
  for (std::size_t p = 0; p < 3; ++p) {
    Style style{.name = level_names[p], .color = colors[p], .width = 1.4};
    path.line(runs[p].x, runs[p].z, style);
    error_x.line(runs[p].t, runs[p].error_x, style);
    error_z.line(runs[p].t, runs[p].error_z, style);
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
  for (auto* panel : {&error_x, &error_z}) {
    panel->legend(Legend::above)
        .x_range(0.0, pvtol_end)
        .inset({.left = 0.36, .bottom = 0.5, .width = 0.6, .height = 0.42, .x = {5.0, 15.0}});
  }
  error_x.y_range(-0.5, 2.0);
  error_z.y_range(-0.5, 2.0);
  return figure;
}

Figure draw_control(const std::string& name, const std::string& caption,
                    const std::array<PvtolSeries, 3>& runs, const Look& look) {
  Figure figure(name, {.rows = look.noisy ? 3U : 2U, .columns = 2, .panel_height = 200});
  figure.caption(caption);
  const std::string v2_label = "v_2 (rad/s²)";
  const std::string x_label = "z_{5x} error (m/s⁴)";
  auto& v1 = figure.panel(0, 0).y_label("v_1 (m/s²)").y_range(look.v1).name("v1");
  auto& v2 = figure.panel(0, 1).y_label(v2_label).y_range(look.v2).name("v2");
  auto& x = figure.panel(1, 0).y_label(x_label).name("disturbance_error_x");
  auto& z = figure.panel(1, 1).y_label("z_{5z} error (m/s⁴)").name("disturbance_error_z");
  for (std::size_t p = 0; p < 3; ++p) {
    const Style style{.name = level_names[p], .color = colors[p], .width = 1.2};
    v1.line(runs[p].t, runs[p].v1, style);
    v2.line(runs[p].t, runs[p].v2, style);
    x.line(runs[p].t, runs[p].estimate_error_x, style);
    z.line(runs[p].t, runs[p].estimate_error_z, style);
  }
  x.y_range(look.estimate);
  z.y_range(look.estimate);
  for (auto* panel : {&v1, &v2, &x, &z}) {
    panel->x_label("t (s)").x_range(0.0, pvtol_end).legend(Legend::above);
    panel->inset({.left = 0.3,
                  .bottom = 0.58,
                  .width = 0.62,
                  .height = 0.37,
                  .x = look.zoom,
                  .frame = !look.noisy,
                  .connect = false});
  }
  if (!look.noisy) return figure;
  // Beside the noise of p = 1 the cascades are flat lines: a closer look at them alone.
  auto& close_v2 = figure.panel(2, 0).y_label(v2_label).name("v2_close");
  auto& close_x = figure.panel(2, 1).y_label(x_label).name("disturbance_error_x_close");
  for (std::size_t p = 1; p < 3; ++p) {
    const Style style{.name = level_names[p], .color = colors[p], .width = 1.2};
    const auto& t = runs[p].t;
    close_v2.line(cut(t, t, 20.0, 22.0), cut(runs[p].v2, t, 20.0, 22.0), style);
    close_x.line(cut(t, t, 20.0, 22.0), cut(runs[p].estimate_error_x, t, 20.0, 22.0), style);
  }
  close_v2.x_range(20.0, 22.0).y_range(-1.0, 1.5);
  close_x.x_range(20.0, 22.0).y_range(-0.6, 0.6);
  for (auto* panel : {&close_v2, &close_x}) panel->x_label("t (s)").legend(Legend::above);
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
  for (std::size_t p = 0; p < 3; ++p) {
    const auto ours = run_pvtol(levels(p), paper_setup(p, 0.0));
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

  const double noisy_control = statistics_of(b[0], &PvtolCriteria::control).mean;
  const double cascade_control = statistics_of(b[1], &PvtolCriteria::control).mean;
  report.claim(
      {.text = "On the aircraft, too, the cascades keep the noise out of the control.",
       .where = "Table 4, B",
       .holds = cascade_control < 0.01 * noisy_control ? Claim::Holds::yes : Claim::Holds::no,
       .here = "int v1^2 + v2^2 is " + shown_text(noisy_control) + " with p = 1 and " +
               shown_text(cascade_control) + " with p = 2.",
       .figure = "fig9"});
  report.correction({.where = "(33), (36)",
                     .printed = "d2'' in the second channel; v1'' counted twice",
                     .correct = "d2; d = x^(4) - u from the exact dynamics",
                     .why = "differentiated twice, theta'' = v2 + d2 holds d2 itself"});

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
      "printed order, RK4 at 1 ms; the observers with p = 1 and 2 start from zero, those with p = "
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
  report.add(
      draw_tracking("fig6", "Fig. 6 (Sim2A): path and tracking errors without noise.", quiet));
  report.add(draw_control("fig7",
                          "Fig. 7 (Sim2A): control and errors of the total disturbances without "
                          "noise. The peaks at the start are cut off.",
                          quiet, {.v1 = {0.0, 4.0}, .v2 = {-2.0, 4.0}, .estimate = {-0.05, 0.1}}));
  report.add(draw_tracking(
      "fig8", "Fig. 8 (Sim2B): path and tracking errors with noise (one seed).", noisy));
  auto figure9 =
      draw_control("fig9",
                   "Fig. 9 (Sim2B): control and errors of the total disturbances with noise (one "
                   "seed); bottom: only the cascades. The peaks at the start are cut off.",
                   noisy,
                   {.v1 = {0.0, 4.0},
                    .v2 = {-150.0, 450.0},
                    .estimate = {-100.0, 300.0},
                    .zoom = {20.0, 20.2},
                    .noisy = true});
  report.add(figure9);
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
  report.add(draw_tracking("wind_tracking",
                           "Our addition: the printed wind, alpha = 3, observers started from the "
                           "true states; no noise.",
                           runs));
  report.add(draw_control(
      "wind_control",
      "Our addition: control and errors of the total disturbances with the printed wind.", runs,
      {.v1 = {0.0, 4.0}, .v2 = {-2.0, 6.0}, .estimate = {-0.2, 0.4}}));
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
