// Sim1A and Sim1B: the generic example without and with measurement noise (Figs 3, 4; Tables 1, 2).
//
// K. Lakomy, R. Madonski, "Cascade extended state observer for active disturbance rejection control
// applications under measurement noise", ISA Transactions 109 (2021) 1-10,
// doi:10.1016/j.isatra.2020.09.007.
//
// Way: continuous simulation, plant and continuous observer as one ODE, Runge-Kutta of order 4 at 1
// ms.
//
// Plant      x1' = x2,  x2' = -x1 - 2 x2 + g (u + d*),  y = x1 + w
//            g = (1 + 0.2 tanh(t - 2)) / (|x1| + 1),  d* = 5 sin(9 t) for t >= 3.5 s
// Reference  y_d = unit step at 0.2 s through 1/(0.1 s + 1)^5
// Observer   error-based form of (23), (24), e = y_d - y:
//            xi_1' = A xi_1 - d ghat u + l_1 (e - xi_11)
//            xi_i' = A xi_i + d (-ghat u + sum_{j<i} xi_j3) + l_i (xi_{i-1,1} - xi_i1)
//            zhat = (xi_p1, xi_p2, sum_j xi_j3),  l_i = (3 w_i, 3 w_i^2, w_i^3),  w_i = alpha
//            w_{i-1}
// Control    u = (zhat_3 + 4 zhat_1 + 4 zhat_2) / ghat
//
// symbol      code                 value                unit
// T           duration             5                    s
// ghat        nominal_gain         1                    -
// omega_c     (AdrcLaw)            2, gains 4, 4        rad/s
// omega_o1    table1               250, 60.82, 33.98    rad/s, for p = 1, 2, 3
// alpha       level_factor         2                    -
//             noise_power          1e-9                 height of the noise's spectral density
//             noise_hold           0.01                 s
//             step_time            0.2                  s, of the reference
//
// The text of the paper has d* beside g u, and an observer driven by y. Its numbers come from the
// form above, which its authors' own program runs; the text's form is shown as a variant.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "paper1_cascade_eso/diagrams.hpp"
#include "paper1_cascade_eso/paper1.hpp"

using namespace esokit::examples;
using namespace paper1;

namespace {

constexpr std::size_t seeds = 100;
constexpr const char* error_metric = "1e3 int |e| dt";
constexpr const char* control_metric = "int u^2 dt";
constexpr const char* estimate_metric = "int |z3 error| dt";

// Table 2 as printed.
constexpr std::array<Criteria, 3> table2_a = {
    {{19.525, 79.076, 0.956}, {12.351, 89.958, 0.957}, {8.346, 84.804, 0.955}}};
constexpr std::array<Criteria, 3> table2_b = {
    {{19.738, 193.93, 8.785}, {12.833, 100.61, 3.162}, {8.952, 93.67, 3.006}}};

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "sim1",
                about("Sim1A and Sim1B: generic example (Figs 3, 4; Tables 1, 2)",
                      "A second-order plant under a sine disturbance, without (A) and with (B) "
                      "measurement noise. Continuous simulation, RK4 at 1 ms.",
                      1));

  // Sim1A, Sim1B's first seed for the figure, and all seeds for the table.
  const auto quiet = paper_runs(0.0);
  const auto noisy = paper_runs(noise_power);
  std::array<Criteria, 3> a;
  for (std::size_t p = 0; p < 3; ++p) {
    a[p] = run_generic(static_cast<int>(p) + 1, table1[p], 0.0, 0);
  }
  const auto runs = run_parallel("Sim1B, seeds", 3 * seeds, [](std::size_t job) {
    const std::size_t p = job / seeds;
    return run_generic(static_cast<int>(p) + 1, table1[p], noise_power, 1 + job % seeds);
  });

  std::vector<CsvRow> bandwidths;
  for (std::size_t p = 0; p < 3; ++p) {
    const std::string name = "Sim1A, " + level_names[p];
    report.check(name, error_metric, table2_a[p].error, a[p].error, 0.006);
    report.check(name, control_metric, table2_a[p].control, a[p].control, 0.006);
    report.check(name, estimate_metric, table2_a[p].estimate, a[p].estimate, 0.006);
    CsvRow row{level_names[p]};
    for (std::size_t i = 0; i < 3; ++i) {
      const double w = table1[p] * std::pow(level_factor, static_cast<double>(i));
      row.push_back(i <= p ? number_text(w, 5) : "");
    }
    bandwidths.push_back(row);
  }
  std::vector<SingleRun> noisy_numbers;
  for (std::size_t p = 0; p < 3; ++p) {
    const std::string name = "Sim1B, " + level_names[p];
    const std::vector<Criteria> b(runs.begin() + static_cast<std::ptrdiff_t>(p * seeds),
                                  runs.begin() + static_cast<std::ptrdiff_t>((p + 1) * seeds));
    const auto compare = [&](const char* metric, double paper, double Criteria::*number) {
      noisy_numbers.push_back({name, metric, paper, statistics_of(b, number)});
    };
    compare(error_metric, table2_b[p].error, &Criteria::error);
    compare(control_metric, table2_b[p].control, &Criteria::control);
    compare(estimate_metric, table2_b[p].estimate, &Criteria::estimate);
  }
  report.check_column("Table 2, rows B", noisy_numbers, PrintedColumn::Verdict::reproduced);
  report.diagram("diagram1", "Fig. 1: disturbance rejection with an extended state observer.",
                 loop_diagram());
  report.diagram(
      "diagram2",
      "Fig. 2: the cascade observer. Only the slow first level gets the noisy measurement.",
      cascade_diagram());
  report.table("1", "Table 1: bandwidths of the levels, omega_oi = 2^(i-1) omega_o1 (rad/s)",
               {"observer", "omega_o1", "omega_o2", "omega_o3"}, bandwidths);
  report.comparison("2", "Table 2: criteria over 0..5 s; Sim1B: mean (standard deviation) over " +
                             std::to_string(seeds) + " seeds");
  report.columns(seeds);
  report.remark(
      "The numbers are reproduced with these settings: the observer is driven by the error y_d − y "
      "with input gain −ghat, d* enters through g, and the reference steps at 0.2 s. All states "
      "start at zero, and e contains the noise. The noise is band-limited white noise of power "
      "1e-9, held over 10 ms.");

  report.add(draw("fig3",
                  "Fig. 3 (Sim1A): tracking, errors of the estimates and control without "
                  "noise. The disturbance 5 sin(9 t) acts from 3.5 s.",
                  quiet, false));
  report.add(draw("fig4",
                  "Fig. 4 (Sim1B): the same with measurement noise (one seed). The standard "
                  "observer passes the noise on to u, the cascades do not.",
                  noisy, true));

  const auto verdict = [](bool holds) { return holds ? Claim::Holds::yes : Claim::Holds::no; };
  const auto three = [](double one, double two, double three_levels) {
    return shown_text(one) + ", " + shown_text(two) + ", " + shown_text(three_levels);
  };
  const auto spread_of = [&](double Criteria::*number) {
    const double most = std::max({a[0].*number, a[1].*number, a[2].*number});
    return 100.0 * (most / std::min({a[0].*number, a[1].*number, a[2].*number}) - 1.0);
  };
  const double estimate_spread = spread_of(&Criteria::estimate);
  report.claim({.text = "Without noise the three observers of Table 1 estimate the disturbance "
                        "equally well.",
                .where = "4.1, Fig 3; Table 2, A",
                .holds = verdict(estimate_spread < 2.0),
                .here = "The integrals of |z3 error| differ by " + number_text(estimate_spread, 2) +
                        " % at most.",
                .figure = "fig3"});
  const double control_spread = spread_of(&Criteria::control);
  report.claim({.text = "Without noise their control effort is comparable.",
                .where = "4.1, Fig 3; Table 2, A",
                .holds = verdict(control_spread < 20.0),
                .here = "The integrals of u^2 differ by " + number_text(control_spread, 2) +
                        " % at most, as those in the paper.",
                .figure = "fig3"});
  report.claim(
      {.text = "Without noise the cascades track better.",
       .where = "4.1, Fig 3; Table 2, A",
       .holds = verdict(a[1].error < a[0].error && a[2].error < a[0].error),
       .here = "1e3 int |e| is " + three(a[0].error, a[1].error, a[2].error) + " for p = 1, 2, 3.",
       .figure = "fig3"});
  std::array<double, 3> first{};
  for (std::size_t p = 0; p < 3; ++p) {
    for (const double error : quiet[p].series.output_estimate_error) {
      first[p] = std::max(first[p], std::abs(error));
    }
  }
  report.claim({.text = "The error of z1 differs noticeably.",
                .where = "4.1, Fig 3",
                .holds = verdict(std::max(first[1], first[2]) > 2.0 * first[0]),
                .here = "The largest one is " + number_text(first[1] / first[0], 2) +
                        " times that of p = 1 with p = 2, and " +
                        number_text(first[2] / first[0], 2) + " times with p = 3.",
                .figure = "fig3"});
  const auto mean_b = [&](std::size_t p, double Criteria::*number) {
    const auto begin = runs.begin() + static_cast<std::ptrdiff_t>(p * seeds);
    return statistics_of(std::vector<Criteria>(begin, begin + seeds), number).mean;
  };
  const auto drop = [&](double Criteria::*number, std::size_t from, std::size_t to) {
    return 100.0 * (1.0 - mean_b(to, number) / mean_b(from, number));
  };
  const double control_drop = drop(&Criteria::control, 0, 1);
  const double estimate_drop = drop(&Criteria::estimate, 0, 1);
  report.claim({.text = "With noise the cascades attenuate it better, above all in the disturbance "
                        "estimate and in u.",
                .where = "4.1, Fig 4; Table 2, B",
                .holds = verdict(control_drop > 0.0 && estimate_drop > 0.0),
                .here = "From p = 1 to 2, int |z3 error| falls by " +
                        number_text(estimate_drop, 2) + " %, int u^2 by " +
                        number_text(control_drop, 2) + " %.",
                .figure = "fig4"});
  const double control_more = drop(&Criteria::control, 1, 2);
  const double estimate_more = drop(&Criteria::estimate, 1, 2);
  report.claim({.text = "The third level reduces the noise further.",
                .where = "4.1, Fig 4; Table 2, B",
                .holds = verdict(control_more > 0.0 && estimate_more > 0.0),
                .here = "From p = 2 to 3, int |z3 error| falls by " +
                        number_text(estimate_more, 2) + " %, int u^2 by " +
                        number_text(control_more, 2) + " %.",
                .figure = "fig4"});
  report.correction({.where = "(26)",
                     .printed = "b' in front of d'; Gamma_ij for j < i-1 (misprint)",
                     .correct = "b d'; Gamma_ij = b b'(l_{j+1} - l_j) c' for j < i-1",
                     .why = "the printed one leaves a residual; (28) to (30) then contain omega_j "
                            "(alpha^{n+1} - 1) instead of omega_j"});
  report.correction({.where = "(9) to (30)",
                     .printed = "kappa_max the largest kappa (3 for n = 2)",
                     .correct = "the 2-norm of kappa (4.36)",
                     .why = "the norm of the gain enters the bound"});
  report.correction({.where = "(7), (27)",
                     .printed = "lambda_min(P) |zeta| <= V <= lambda_max(P) |zeta|; Lambda_i with "
                                "minus signs",
                     .correct = "|zeta|^2 in both; Lambda_i like Lambda_1 and Lambda_2",
                     .why = "V is quadratic; (28) follows from positive entries"});
  report.correction({.where = "(30), (22)",
                     .printed = "(30): omega^{n-1}; (22), first line: no gamma",
                     .correct = "omega^n; gamma in front",
                     .why = "from the derivation; the bounds hold in this form (analysis_bounds)"});

  // For the README: a piece of Fig 4, and the first and the last observer alone.
  Figure piece("in_noise", {.rows = 1, .columns = 2, .panel_height = 190});
  piece.caption("Fig 4 from 2 to 2.4 s: one level (LESO) and three under the same noise.");
  for (const std::size_t p : {0u, 2u}) {
    const auto shown = [&](const std::vector<double>& values) {
      std::vector<double> out;
      for (std::size_t k = 0; k < values.size(); ++k) {
        if (noisy[p].series.t[k] >= 2.0 && noisy[p].series.t[k] <= 2.4) out.push_back(values[k]);
      }
      return out;
    };
    const Style style{.name = p == 0 ? "LESO (p = 1)" : "cascade, p = 3",
                      .color = p == 0 ? Color::blue : Color::green};
    const auto t = shown(noisy[p].series.t);
    piece.panel(0, 0)
        .x_label("t (s)")
        .y_label("u (-)")
        .legend(Legend::above)
        .name("control")
        .line(t, shown(noisy[p].series.control), style);
    piece.panel(0, 1)
        .x_label("t (s)")
        .y_label("error of the disturbance (-)")
        .legend(Legend::above)
        .name("estimate")
        .line(t, shown(noisy[p].series.estimate_error), style);
  }
  report.add(piece);

  // The variant that the text describes.
  report.additions();
  std::vector<CsvRow> lines;
  double least = 100.0;
  double most = 0.0;
  for (const double step_time : {0.2, 0.0}) {
    const Setup literal{.error_based = false,
                        .step_time = step_time,
                        .disturbance = GenericPlant::Disturbance::beside_gain};
    const std::string label = "literal text, step at " + number_text(step_time, 2) + " s, ";
    const double low = step_time > 0.0 ? 39.0 : 41.0;
    const double high = step_time > 0.0 ? 45.0 : 47.0;
    for (std::size_t p = 0; p < 3; ++p) {
      const auto ours = run_generic(static_cast<int>(p) + 1, table1[p], 0.0, 0, literal);
      const std::string name = label + level_names[p];
      // Shown only: the printed numbers are judged in the set-up that they come from.
      report.check(name, error_metric, std::nullopt, ours.error);
      report.check(name, control_metric, std::nullopt, ours.control);
      report.check(name, estimate_metric, std::nullopt, ours.estimate);
      const double excess = 100.0 * (ours.control / table2_a[p].control - 1.0);
      least = std::min(least, excess);
      most = std::max(most, excess);
      report.expect(name, "int u^2 dt above the paper's (%)", excess,
                    std::round(excess) >= low && std::round(excess) <= high,
                    "expected " + number_text(low, 3) + " to " + number_text(high, 3) +
                        " %: the numbers of the paper do not come from the form in its text");
      lines.push_back({name, number_text(ours.error, 5), number_text(ours.control, 5),
                       number_text(ours.estimate, 4), number_text(excess, 3)});
    }
  }
  report.table(
      "literal",
      "Variant: Sim1A as described in the text (observer driven by y, d* added to g u). int u^2 is "
      "far from that of the paper",
      {"case", error_metric, control_metric, estimate_metric, "int u^2 dt above the paper's (%)"},
      lines);
  report.not_reproduced(
      "Sim1A as described in the text (observer driven by y, d* added to g u) gives an int u^2 "
      "that is " +
          number_text(least, 2) + " to " + number_text(most, 2) +
          " % above Table 2 (step at 0.2 s or at 0 s). The error-based form with d* through g "
          "gives "
          "Table 2.",
      Miss::other_reading);

  Figure variant("literal", {.rows = 1, .columns = 2, .panel_height = 200});
  variant.caption(
      "Sim1A, p = 2: the set-up that reproduces Table 2, and the set-up that the text describes.");
  paper1::Series text;
  (void)run_generic(2, table1[1], 0.0, 0,
                    {.error_based = false,
                     .step_time = 0.2,
                     .disturbance = GenericPlant::Disturbance::beside_gain},
                    &text);
  variant.panel(0, 0)
      .x_label("t (s)")
      .y_label("u (-)")
      .legend(Legend::above)
      .name("control")
      .line(quiet[1].series.t, quiet[1].series.control, {.name = "set-up of Table 2"})
      .line(text.t, text.control, {.name = "set-up of the text", .dash = Dash::dashed});
  variant.panel(0, 1)
      .x_label("t (s)")
      .y_label("z_3 error (-)")
      .legend(Legend::above)
      .name("disturbance_error")
      .line(quiet[1].series.t, quiet[1].series.estimate_error, {.name = "set-up of Table 2"})
      .line(text.t, text.estimate_error, {.name = "set-up of the text", .dash = Dash::dashed});
  report.add(variant);
  return report.finish();
}
