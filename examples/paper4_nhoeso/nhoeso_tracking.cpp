// Three scenarios of tracking in noise (Figs 3-5, Table 3), and a fair linear observer beside them.
//
// A. T. Azar, F. A. Abdul-Majeed, H. S. Majdi et al., "Parameterization of a Novel Nonlinear
// Estimator for Uncertain SISO Systems with Noise Scenario", Mathematics 10 (2022) 2261,
// doi:10.3390/math10132261.
//
// Way: the paper way, plant and continuous observer as one ODE, Runge-Kutta of order 4 at 10 ms;
// noise and control are held over a step.
//
// Plant      x1' = x2,  x2' = 0.2 x1 + 0.1 sin x2 + w + (1 + 0.1 sin t) u,  w = e^-t cos t
//            y = x1 + noise
// Observer   z_i' = z_{i+1} + C(N,i) omega_0^i g(e) (+ u for i = 2),  e = y - z_1            (9)
// Reference  r1' = r2,  r2' = -R sign(r1 - cos(0.5 t) + r2 |r2| / (2R))
// Control    u = fal(r1 - z_1, a1, d1) + fal(r2 - z_2, a2, d2) - z_3
//
// symbol      code                 value                     unit
// R           acceleration         12.4                      1/s^2
// a1, d1      exponents, widths    1, 0.021                  -
// a2, d2                           0.1, 0.001                -
//             noise_variance       1e-4                      -
//             duration, step       10, 0.01                  s
//             seeds                60                        mean over the noise
// Of these the paper has the noise alone, and no bandwidths. In a search over some 6600 settings
// all missed Table 3 by a factor of 2 or more somewhere; this is one of the nearer ones.

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <esokit/observer/linear_eso.hpp>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "common/statistics.hpp"
#include "paper4_nhoeso/paper4.hpp"

using namespace esokit::examples;
using namespace paper4;

namespace {

constexpr std::size_t seeds = 60;

using Run = std::function<Criteria(double variance, std::uint64_t seed, Series* series)>;

template <int Extension>
Run linear(double bandwidth) {
  const auto observer = esokit::ContinuousLinearEso<2, double, Extension>::make(
                            {.observer_bandwidth = bandwidth, .input_gain = 1.0})
                            .value();
  return [observer](double variance, std::uint64_t seed, Series* series) {
    return run(observer, variance, seed, series);
  };
}

Run nonlinear(double bandwidth, const PowerSumGain<double>& shape, bool unlimited) {
  const auto observer = esokit::ContinuousNonlinearEso<2>::make({.observer_bandwidth = bandwidth,
                                                                 .shape = shape,
                                                                 .unlimited = unlimited,
                                                                 .input_gain = 1.0})
                            .value();
  return [observer](double variance, std::uint64_t seed, Series* series) {
    return run(observer, variance, seed, series);
  };
}

struct Case {
  std::string name;
  Run run;
  std::optional<std::array<double, 2>> paper = {};        // ITAE, ISU of Table 3
  std::array<std::optional<double>, 2> independent = {};  // of another run in a like setting
};

/// Tuned for scenario 3 as (29) asks: alpha -> 1, beta -> 1 + 2/n, both K small.
constexpr PowerSumGain<double> tuned{
    .gain_alpha = 0.234, .alpha = 1.0, .gain_beta = 0.049, .beta = 2.0};

Figure draw(const std::string& name, const std::string& caption, const Case& scenario,
            bool with_quiet) {
  Figure figure(name, {.rows = 2, .columns = 2, .panel_height = 210});
  figure.caption(caption);
  Series noisy, quiet;
  (void)scenario.run(noise_variance, 1, &noisy);
  (void)scenario.run(0.0, 1, &quiet);
  auto& output = figure.panel(0, 0).x_label("t (s)").y_label("r_1, x_1 (-)").name("output");
  output.legend(Legend::above)
      .line(noisy.t, noisy.x, {.name = "x_1", .color = Color::blue})
      .line(noisy.t, noisy.r, {.name = "r_1", .color = Color::black, .dash = Dash::dashed});
  auto& error = figure.panel(0, 1).x_label("t (s)").y_label("r_1 − x_1 (-)").name("error");
  auto& control = figure.panel(1, 0).x_label("t (s)").y_label("u (-)").name("control");
  auto& estimate = figure.panel(1, 1).x_label("t (s)").y_label("d, z_3 (-)").name("disturbance");
  error.legend(Legend::above)
      .line(noisy.t, noisy.error, {.name = "in noise", .color = Color::blue, .width = 1.2});
  control.legend(Legend::above)
      .line(noisy.t, noisy.u, {.name = "in noise", .color = Color::blue, .width = 1.0});
  if (with_quiet) {
    error.line(quiet.t, quiet.error, {.name = "without noise", .color = Color::vermillion});
    control.line(quiet.t, quiet.u, {.name = "without noise", .color = Color::vermillion});
  }
  estimate.legend(Legend::above)
      .line(noisy.t, noisy.estimate, {.name = "z_3", .color = Color::blue, .width = 1.0})
      .line(noisy.t, noisy.disturbance,
            {.name = "total disturbance", .color = Color::black, .dash = Dash::dashed});
  return figure;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "tracking",
                about("Tracking in noise (Figs 3-5, Table 3)",
                      "An uncertain second-order plant follows cos(t/2) through a nonlinear law; "
                      "linear and nonlinear observers, " +
                          std::to_string(seeds) +
                          " noise seeds. Paper way: continuous observer, RK4 at 10 ms."));

  const std::vector<Case> cases = {
      {"scenario 1: LESO, N = 3, omega_0 = 80.3",
       linear<1>(80.3),
       {{41.347519, 2782.555268}},
       {10.7, 3371.0}},
      {"scenario 2: NHOESO, g of Table 2, omega_0 = 8.8",
       nonlinear(8.8, table2_g, true),
       {{1.321808, 28.825156}},
       {3.62, 19.0}},
      {"scenario 3: NHOESO by (29), omega_0 = 9.4",
       nonlinear(9.4, tuned, true),
       {{1.586651, 11.719821}},
       {2.39, 11.5}},
      {"scenario 3 with g_new of Table 2, unlimited",
       nonlinear(9.4, table2_g_new, true),
       {},
       {54.0, 69376.0}},
      {"the same with the default limits of k", nonlinear(9.4, table2_g_new, false)},
      {"fair: LESO, N = 3, omega_0 = 12", linear<1>(12.0), {}, {2.06, 8.5}},
      {"fair: LESO, N = 4, omega_0 = 5", linear<2>(5.0), {}, {0.96, 6.3}},
  };
  (void)reference();  // made once, before the threads ask for it
  const auto runs = run_parallel("seeds", cases.size() * seeds, [&](std::size_t job) {
    return cases[job / seeds].run(noise_variance, 1 + job % seeds, nullptr);
  });

  std::vector<CsvRow> lines;
  const std::string reason =
      "the paper does not say bandwidths, fal, R, duration, step and start; of the settings that "
      "were "
      "tried all miss by a factor of 2 or more somewhere";
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto first = runs.begin() + static_cast<std::ptrdiff_t>(i * seeds);
    const std::vector<Criteria> own(first, first + seeds);
    const Case& c = cases[i];
    CsvRow line{c.name};
    const std::array<const char*, 2> names = {"ITAE", "ISU"};
    const std::array<double Criteria::*, 2> numbers = {&Criteria::itae, &Criteria::isu};
    for (std::size_t k = 0; k < 2; ++k) {
      const auto ours = statistics_of(own, numbers[k]);
      const std::string note =
          c.independent[k]
              ? "independent run in a like setting: " + number_text(*c.independent[k]) + ", " +
                    number_text(std::abs(ours.mean - *c.independent[k]) / ours.standard_deviation,
                                2) +
                    " sd away"
              : "";
      if (c.paper) {
        report.known_miss(c.name, names[k], (*c.paper)[k], ours, 0.02,
                          note.empty() ? reason : reason + "; " + note);
      } else {
        report.check(c.name, names[k], std::nullopt, ours, std::nullopt, note);
      }
      const Criteria quiet = c.run(0.0, 1, nullptr);
      line.push_back(c.paper ? number_text((*c.paper)[k]) : "");
      line.push_back(number_text(ours.mean, 4) + " (" + number_text(ours.standard_deviation, 2) +
                     ")");
      line.push_back(number_text(quiet.*numbers[k], 4));
      line.push_back(c.independent[k] ? number_text(*c.independent[k]) : "");
    }
    const auto amplitude = statistics_of(own, &Criteria::amplitude);
    line.push_back(number_text(amplitude.mean, 3));
    lines.push_back(line);
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
  report.table("3",
               "Table 3: ITAE = int t |r1 - x1| dt and ISU = int u^2 dt over 10 s, mean (standard "
               "deviation) over " +
                   std::to_string(seeds) +
                   " seeds, and one run without noise; last column: largest |x1 - z1| for t > 5 s",
               {"case", "ITAE, paper", "ITAE, ours", "without noise", "independent run",
                "ISU, paper", "ISU, ours", "without noise", "independent run", "estimation error"},
               lines);
  report.not_reproduced(
      "Table 3: most of the setting cannot be found in the paper (bandwidths, fal, R, duration, "
      "step, start), and none of those that were tried gives its numbers. Ours has the ISU of the "
      "scenarios in the same order. Scenario 2 hangs on details: without noise its ITAE is 98, "
      "with "
      "noise 16 +- 6 (another run: 3.6).");
  report.not_reproduced(
      "That the nonlinear observer is better than a linear one: scenario 1 compares with a linear "
      "observer whose bandwidth (80 rad/s) was tuned without noise. A linear observer at 12 rad/s "
      "(N = 3) or 5 rad/s (N = 4) does as well as scenario 3 or better.");

  report.add(draw("fig3",
                  "Fig. 3, scenario 1: LESO with 80.3 rad/s, tuned without noise, in noise (one "
                  "seed) and without.",
                  cases[0], true));
  report.add(
      draw("fig4",
           "Fig. 4, scenario 2: NHOESO with g of Table 2, tuned without noise, in noise (one "
           "seed) and without.",
           cases[1], true));
  report.add(draw("fig5", "Fig. 5, scenario 3: NHOESO with parameters chosen by (29), in noise.",
                  cases[2], false));
  report.add(draw("cycle",
                  "Scenario 3 with the g_new that Table 2 prints, without limits: the limit cycle.",
                  cases[3], false));
  report.add(
      draw("limited", "The same with the default limits of k: no limit cycle.", cases[4], false));
  report.add(
      draw("fair", "A fair linear comparison: LESO with N = 4 at 5 rad/s.", cases[6], false));
  return report.finish();
}
