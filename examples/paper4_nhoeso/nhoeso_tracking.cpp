// Three scenarios of tracking in noise (Figs 3-5, Table 3), and a fair linear observer beside them.
//
// A. T. Azar, F. A. Abdul-Majeed, H. S. Majdi et al., "Parameterization of a Novel Nonlinear
// Estimator for Uncertain SISO Systems with Noise Scenario", Mathematics 10 (2022) 2261,
// doi:10.3390/math10132261.
//
// Way: plant and continuous observer as one ODE, as in the paper; Runge-Kutta of order 4 at 2 ms,
// noise held over 10 ms.
//
// Plant      x1' = x2,  x2' = 0.2 x1 + 0.1 sin x2 + w + (1 + 0.1 sin t) u,  w = e^-t cos t
//            y = x1 + noise
// Observer   z_i' = z_{i+1} + C(N,i) omega_0^i g(e) (+ u for i = 2),  e = y - z_1            (9)
// Reference  r1' = r2,  r2' = -R sign(r1 - r + r2 |r2| / (2R)),  r = cos(0.5 t)
// Control    u = fal(r1 - z_1, a1, d1) + fal(r2 - z_2, a2, d2) - z_3, limited
//
// symbol      code                 value                     unit
//             noise_variance       1e-4                      -             printed
// g           table2_g             .617, .233, .143, .334    -             printed
// R           acceleration         35.93                     1/s^2         fitted, as all below
// a1, d1      fitted_law           0.1953, 0.00099           -
// a2, d2                           0.0300, 0.0978            -
// max |u|     control_limit        20.77                     -
//             duration             10                        s
//             step, hold           0.002, 0.01               s
// omega_0     (cases)              101.66, 10.06, 10.36      rad/s
//             seeds                60                        mean over the noise
// 17 fitted quantities for the 6 numbers of Table 3: a consistent setting, no proof that it is the
// paper's.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/sim/continuous_observer.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "paper4_nhoeso/paper4.hpp"

using namespace esokit::examples;
using namespace paper4;

namespace {

constexpr std::size_t seeds = 60;

using Reference = std::vector<EigenMatrix<double, 2>>;
using Run = std::function<Criteria(double variance, std::uint64_t seed, const Reference& reference,
                                   double step, Series* series)>;

template <class Observer>
Run run_of(const Observer& observer) {
  return
      [observer](double variance, std::uint64_t seed, const Reference& reference, double step,
                 Series* series) { return run(observer, variance, seed, reference, step, series); };
}

template <int Extension>
Run linear(double bandwidth) {
  return run_of(esokit::ContinuousLinearEso<2, double, Extension>::make(
                    {.observer_bandwidth = bandwidth, .input_gain = 1.0})
                    .value());
}

Run nonlinear(double bandwidth, const PowerSumGain<double>& shape, bool unlimited) {
  return run_of(esokit::ContinuousNonlinearEso<2>::make({.observer_bandwidth = bandwidth,
                                                         .shape = shape,
                                                         .unlimited = unlimited,
                                                         .input_gain = 1.0})
                    .value());
}

struct Case {
  std::string name;
  Run run;
  std::optional<std::array<double, 2>> paper = {};  // ITAE, ISU of Table 3
  std::array<double, 4> independent = {};           // mean and sd of ITAE, of ISU in another run
};

/// Scenario 3 as fitted: not Table 2's g_new.
constexpr PowerSumGain<double> fitted_g{
    .gain_alpha = 0.1095, .alpha = 0.728, .gain_beta = 0.0582, .beta = 2.0};

/// As in the ranking: linear observers in vermillion, nonlinear ones in blue.
Figure draw(const std::string& name, const std::string& caption, const Case& scenario,
            const Reference& tracked, bool with_quiet, Color color = Color::blue) {
  Figure figure(name, {.rows = 2, .columns = 2, .panel_height = 210});
  figure.caption(caption);
  Series noisy, quiet;
  (void)scenario.run(noise_variance, 1, tracked, fitted_step, &noisy);
  (void)scenario.run(0.0, 1, tracked, fitted_step, &quiet);
  auto& output = figure.panel(0, 0).x_label("t (s)").y_label("r, x_1 (-)").name("output");
  output.legend(Legend::above)
      .line(noisy.t, noisy.x, {.name = "x_1", .color = color})
      .line(noisy.t, noisy.r, {.name = "r", .color = Color::black, .dash = Dash::dashed});
  auto& error = figure.panel(0, 1).x_label("t (s)").y_label("r − x_1 (-)").name("error");
  auto& control = figure.panel(1, 0).x_label("t (s)").y_label("u (-)").name("control");
  auto& estimate = figure.panel(1, 1).x_label("t (s)").y_label("d, z_3 (-)").name("disturbance");
  error.legend(Legend::above)
      .line(noisy.t, noisy.error, {.name = "in noise", .color = color, .width = 1.2});
  control.legend(Legend::above)
      .line(noisy.t, noisy.u, {.name = "in noise", .color = color, .width = 1.0});
  if (with_quiet) {
    error.line(quiet.t, quiet.error, {.name = "without noise", .color = Color::grey});
    control.line(quiet.t, quiet.u, {.name = "without noise", .color = Color::grey});
  }
  estimate.legend(Legend::above)
      .line(noisy.t, noisy.estimate, {.name = "z_3", .color = color, .width = 1.0})
      .line(noisy.t, noisy.disturbance,
            {.name = "total disturbance", .color = Color::black, .dash = Dash::dashed});
  return figure;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, folder, "tracking",
      about("Tracking in noise (Figs 3-5, Table 3)",
            "An uncertain second-order plant follows cos(t/2) under a nonlinear control law; "
            "linear and nonlinear observers, " +
                std::to_string(seeds) + " noise seeds. Continuous simulation, RK4 at 2 ms.",
            2));

  const std::vector<Case> cases = {
      {"scenario 1: LESO, N = 3, omega_0 = 101.66",
       linear<1>(101.66),
       {{41.347519, 2782.555268}},
       {43.3, 28.0, 2787.0, 53.0}},
      {"scenario 2: NHOESO, g of Table 2, omega_0 = 10.06",
       nonlinear(10.06, table2_g, true),
       {{1.321808, 28.825156}},
       {1.354, 0.028, 29.07, 0.96}},
      {"scenario 3: NHOESO, g fitted, omega_0 = 10.36",
       nonlinear(10.36, fitted_g, true),
       {{1.586651, 11.719821}},
       {1.555, 0.076, 12.01, 1.47}},
      {"scenario 3 with g_new of Table 2, unlimited", nonlinear(10.36, table2_g_new, true)},
      {"the same with the default limits of k", nonlinear(10.36, table2_g_new, false)},
      {"fair: LESO, N = 3, omega_0 = 10", linear<1>(10.0)},
      {"fair: LESO, N = 4, omega_0 = 4", linear<2>(4.0)},
  };
  constexpr std::size_t scenarios = 3;
  const std::array<std::string, 2> names = {"ITAE", "ISU"};
  const std::array<double Criteria::*, 2> numbers = {&Criteria::itae, &Criteria::isu};
  const Reference tracked = tracked_reference(fitted_step);
  const auto flat = run_parallel("seeds", cases.size() * seeds, [&](std::size_t job) {
    return cases[job / seeds].run(noise_variance, 1 + job % seeds, tracked, fitted_step, nullptr);
  });
  const auto runs_of = [&](std::size_t i) {
    const auto first = flat.begin() + static_cast<std::ptrdiff_t>(i * seeds);
    return std::vector<Criteria>(first, first + seeds);
  };

  std::vector<CsvRow> lines;
  std::vector<SingleRun> numbers_of_paper;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto own = runs_of(i);
    const Case& c = cases[i];
    const Criteria quiet = c.run(0.0, 1, tracked, fitted_step, nullptr);
    CsvRow line{c.name};
    for (std::size_t k = 0; k < 2; ++k) {
      const auto ours = statistics_of(own, numbers[k]);
      if (c.paper) {
        numbers_of_paper.push_back({c.name, names[k], (*c.paper)[k], ours});
      } else {
        report.check(c.name, names[k], std::nullopt, ours);
      }
      line.push_back(mean_text(ours));
      line.push_back(shown_text(quiet.*numbers[k]));
    }
    for (std::size_t k = 0; k < 2 && c.paper; ++k) {
      const double mean = c.independent[2 * k];
      const double deviation = c.independent[2 * k + 1];
      const auto both = Tolerance::means(3.0,
                                         {.count = 60,
                                          .standard_deviation = deviation,
                                          .standard_error = deviation / std::sqrt(60.0)},
                                         seeds);
      // The unlimited gain chatters at the step of the integration, and a step of 1 ms for 2 ms
      // changes scenario 2 by 6 %: two programs agree no better.
      report.check_reference(c.name, names[k] + ", independent run", mean,
                             statistics_of(own, numbers[k]), both.or_relative(0.06),
                             "an independent run in this setting");
    }
    const auto amplitude = statistics_of(own, &Criteria::amplitude);
    line.push_back(shown_text(amplitude.mean));
    lines.push_back(line);
    if (i == 1) {
      report.expect(c.name, "ITAE without noise", quiet.itae, quiet.itae < 2.0,
                    "works without noise");
    }
    if (i == 3) {
      report.expect(c.name, "amplitude of the estimation error, t > 5 s", amplitude,
                    amplitude.mean > 1.7 && amplitude.mean < 2.3,
                    "limit cycle; 1.98 for the observer alone");
    }
    if (i == 4) {
      report.expect(c.name, "amplitude of the estimation error, t > 5 s", amplitude,
                    amplitude.mean < 0.1, "no limit cycle");
    }
  }
  // More quantities are fitted than there are numbers, so being near says nothing.
  report.check_column("Table 3", numbers_of_paper, PrintedColumn::Verdict::not_judged, 17);
  report.comparison(
      "3",
      "Table 3: ITAE = int t |r - x1| dt and ISU = int u^2 dt over 10 s. The paper prints the "
      "noise, the plant, the form of the control law and g of scenario 2. The other 17 quantities, "
      "among them the three bandwidths, are fitted to these six numbers. Ours: mean (standard "
      "deviation) over " +
          std::to_string(seeds) +
          " seeds; not judged, because more is fitted than there are numbers",
      {cases[0].name, cases[1].name, cases[2].name}, {names[0], names[1]});

  report.add(draw("fig3",
                  "Fig. 3, scenario 1: LESO, with noise (one seed) and without. Its 101.66 rad/s "
                  "are fitted here, the paper prints no bandwidth. With noise the control stays at "
                  "its limits. The panel of the error is our addition.",
                  cases[0], tracked, true, Color::vermillion));
  report.add(draw("fig4",
                  "Fig. 4, scenario 2: NHOESO with g of Table 2, at 10.06 rad/s (fitted), with "
                  "noise (one seed) and without.",
                  cases[1], tracked, true));
  report.add(draw("fig5",
                  "Fig. 5, scenario 3: NHOESO with a fitted g at 10.36 rad/s (fitted), with noise "
                  "and without.",
                  cases[2], tracked, true));

  const auto mean_of = [&](std::size_t i, double Criteria::*number) {
    return statistics_of(runs_of(i), number).mean;
  };
  const auto both = [&](std::size_t i) {
    return "ITAE " + shown_text(mean_of(i, &Criteria::itae), 1.0) + ", ISU " +
           shown_text(mean_of(i, &Criteria::isu), 1.0);
  };
  const auto better = [&](std::size_t i, std::size_t than) {
    return mean_of(i, &Criteria::itae) < mean_of(than, &Criteria::itae) &&
           mean_of(i, &Criteria::isu) < mean_of(than, &Criteria::isu);
  };
  using Holds = Claim::Holds;
  const auto verdict = [](bool holds) { return holds ? Holds::yes : Holds::no; };
  report.claim({.text = "The LESO tuned without noise responds worst to noise.",
                .where = "6, Fig 3; Table 3",
                .holds = verdict(better(1, 0) && better(2, 0)),
                .here = "In the fitted setting: " + both(0) + "; scenario 2: " + both(1) + ".",
                .figure = "fig3"});
  // Total variation per noise value, in one seed.
  const auto chatter = [&](std::size_t i, std::vector<double> Series::*signal) {
    Series series;
    (void)cases[i].run(noise_variance, 1, tracked, fitted_step, &series);
    const auto& values = series.*signal;
    double sum = 0.0;
    for (std::size_t k = 1; k < values.size(); ++k) sum += std::abs(values[k] - values[k - 1]);
    return sum / (duration / hold);
  };
  const std::array<double, 3> chatter_u = {chatter(0, &Series::u), chatter(1, &Series::u),
                                           chatter(2, &Series::u)};
  const std::array<double, 3> chatter_z = {
      chatter(0, &Series::estimate), chatter(1, &Series::estimate), chatter(2, &Series::estimate)};
  report.claim({.text = "The NHOESO tuned without noise tracks better, and u and the disturbance "
                        "estimate chatter much less.",
                .where = "6, Fig 4; Table 3",
                .holds = verdict(better(1, 0) && chatter_u[1] < 0.5 * chatter_u[0] &&
                                 chatter_z[1] < 0.5 * chatter_z[0]),
                .here = "In the fitted setting the total variation of u per noise value is " +
                        number_text(chatter_u[1], 2) + " (LESO " + number_text(chatter_u[0], 2) +
                        "), that of z_3 " + number_text(chatter_z[1], 2) + " (LESO " +
                        number_text(chatter_z[0], 2) + ").",
                .figure = "fig4"});
  const double less_effort =
      100.0 * (1.0 - mean_of(2, &Criteria::isu) / mean_of(1, &Criteria::isu));
  report.check("Table 3", "ISU less in scenario 3 than in 2 (%)", 59.3, less_effort, std::nullopt,
               "not judged: g and bandwidths are fitted");
  report.claim({.text = "With parameters by (29) chatter and control energy fall further, ISU by "
                        "59.3 %.",
                .where = "6, Fig 5; Table 3",
                .holds = mean_of(3, &Criteria::isu) < mean_of(1, &Criteria::isu) ? Holds::yes
                         : less_effort > 0.0                                     ? Holds::partly
                                                                                 : Holds::no,
                .here = "With a fitted g ISU falls by " + number_text(less_effort, 2) +
                        " %, the total variation of u per noise value to " +
                        number_text(chatter_u[2], 2) +
                        ". With the g_new that Table 2 prints the loop cycles (" + both(3) + ").",
                .figure = "fig5"});
  report.claim({.text = "Parameters by (29) improve the accuracy of the response.",
                .where = "6, Fig 5",
                .holds = verdict(mean_of(2, &Criteria::itae) < mean_of(1, &Criteria::itae)),
                .here = "ITAE rises from " + number_text(mean_of(1, &Criteria::itae), 3) + " to " +
                        number_text(mean_of(2, &Criteria::itae), 3) +
                        ", in Table 3 from 1.322 to 1.587.",
                .figure = "3"});
  const Criteria without_noise = cases[2].run(0.0, 1, tracked, fitted_step, nullptr);
  const double more_error = 100.0 * (mean_of(2, &Criteria::itae) / without_noise.itae - 1.0);
  const double more_effort = mean_of(2, &Criteria::isu) / without_noise.isu;
  report.claim({.text = "With parameters by (29) noise has a negligible effect on the performance.",
                .where = "7",
                .holds = more_error > 20.0   ? Holds::no
                         : more_effort > 1.2 ? Holds::partly
                                             : Holds::yes,
                .here = "With the fitted g it raises ITAE by " + number_text(more_error, 1) +
                        " %, but ISU to " + number_text(more_effort, 2) +
                        " times that without noise.",
                .figure = "cases"});
  report.claim({.text = "The nonlinear function filters without a delay in the estimation error.",
                .where = "7",
                .here = "The paper shows no result for it. g(e) has no memory; where k(e) < 1 the "
                        "observer has a lower bandwidth.",
                .figure = "fig5"});
  report.claim({.text = "In noise the NHOESO has the least estimation errors at moderate energy.",
                .where = "6, before Table 3",
                .holds = verdict(!better(6, 2) || mean_of(6, &Criteria::amplitude) >
                                                      mean_of(2, &Criteria::amplitude)),
                .here = "A LESO of N = 4 at 4 rad/s has less of both (" + both(6) +
                        "; scenario 3: " + both(2) + ") and the smallest error of z_1.",
                .figure = "cases"});
  report.not_reproduced(
      "Table 3 comes out near with settings of which 17 quantities are fitted to its 6 numbers "
      "(limit on u, bandwidths, fal, R, duration, step, g of scenario 3). They are consistent with "
      "the paper, but need not be those of the paper.",
      Miss::not_published);
  report.additions();
  report.table("cases",
               "All cases, mean (standard deviation) over " + std::to_string(seeds) +
                   " seeds, and one run without noise; last column: largest |x1 - z1| for t > 5 s",
               {"case", "ITAE", "without noise", "ISU", "without noise", "estimation error"},
               lines);

  // The spread of scenario 1: a drift under a control that stands at its limits.
  std::vector<double> drift;
  for (const Criteria& c : runs_of(0)) drift.push_back(c.itae);
  std::sort(drift.begin(), drift.end());
  const auto share = [&](double part) {
    return shown_text(drift[static_cast<std::size_t>(part * static_cast<double>(seeds - 1) + 0.5)]);
  };
  report.table("spread",
               "Scenario 1, ITAE over " + std::to_string(seeds) +
                   " seeds: a drift while the control is at its limits, with a heavy-tailed "
                   "distribution (printed: 41.347519)",
               {"least", "16 %", "median", "84 %", "largest"},
               {{share(0.0), share(0.16), share(0.5), share(0.84), share(1.0)}});

  // The unlimited gain grows as e vanishes, and chatters at the step.
  constexpr std::array steps = {0.002, 0.001, 0.0005};
  constexpr std::size_t few = 20;
  std::vector<Reference> references;
  for (const double step : steps) references.push_back(tracked_reference(step));
  const auto stepped = run_parallel("steps", steps.size() * scenarios * few, [&](std::size_t job) {
    const std::size_t k = steps.size() - 1 - job / (scenarios * few);  // the longest first
    return cases[job / few % scenarios].run(noise_variance, 1 + job % few, references[k], steps[k],
                                            nullptr);
  });
  lines.clear();
  for (std::size_t i = 0; i < scenarios; ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      CsvRow line{cases[i].name, names[k]};
      for (std::size_t j = 0; j < steps.size(); ++j) {
        const auto first = stepped.begin() + static_cast<std::ptrdiff_t>(
                                                 ((steps.size() - 1 - j) * scenarios + i) * few);
        line.push_back(
            mean_text(statistics_of(std::vector<Criteria>(first, first + few), numbers[k])));
      }
      lines.push_back(line);
    }
  }
  report.table("step",
               "The same over the step of the integration, " + std::to_string(few) +
                   " seeds: without a limit on k scenario 2 depends on it",
               {"case", "quantity", "2 ms", "1 ms", "0.5 ms"}, lines);
  report.add(draw("cycle",
                  "Scenario 3 with the g_new that Table 2 prints, without limits: the limit cycle.",
                  cases[3], tracked, false));
  report.add(draw("limited", "The same with the default limits of k: no limit cycle.", cases[4],
                  tracked, false));
  report.add(draw("fair", "A fair linear comparison: LESO with N = 4 at 4 rad/s.", cases[6],
                  tracked, true, Color::vermillion));

  // For the README: all cases at a glance.
  Figure ranking("ranking", {.rows = 1, .columns = 1, .panel_height = 230});
  ranking.caption(
      "Tracking error (ITAE) and control effort (ISU) of the table of all cases in noise: means "
      "over the seeds. Less is better in both. The bandwidths of the scenarios are fitted.");
  struct Shown {
    const char* name;
    Color color;
    Marker marker;
  };
  constexpr std::array<Shown, 7> shown = {
      {{"scenario 1: linear, 101.66 rad/s", Color::vermillion, Marker::circle},
       {"scenario 2: nonlinear, g of Table 2", Color::blue, Marker::circle},
       {"scenario 3: nonlinear, g fitted", Color::blue, Marker::square},
       {"scenario 3 with g_{new} of Table 2", Color::blue, Marker::triangle},
       {"the same within proven limits", Color::blue, Marker::open_circle},
       {"linear, N = 3, 10 rad/s", Color::vermillion, Marker::square},
       {"linear, N = 4, 4 rad/s", Color::vermillion, Marker::triangle}}};
  Panel& both_numbers = ranking.panel(0, 0)
                            .x_label("tracking error: integral of t |r − x_1| dt")
                            .y_label("effort: integral of u^2 dt")
                            .log_x()
                            .log_y()
                            .x_range(0.7, 5000)
                            .y_range(2, 10000)
                            .legend(Legend::bottom_right)
                            .name("means");
  for (std::size_t i = 0; i < shown.size(); ++i) {
    both_numbers.points(
        Column{mean_of(i, &Criteria::itae)}, Column{mean_of(i, &Criteria::isu)},
        {.name = shown[i].name, .color = shown[i].color, .marker = shown[i].marker, .size = 1.6});
  }
  report.add(ranking);
  return report.finish();
}
