// LESO, BESO and ABESO under measurement noise: Figs 1-4, Tables 2-8.
//
// S. Zhang, X. Qi, S. Yang, "An extended state observer with adjustable bandwidth for measurement
// noise", Journal of Systems Engineering and Electronics (2023), doi:10.23919/JSEE.2023.000166.
//
// Way: the paper way, plant and continuous observer as one ODE, Runge-Kutta of order 4 at 10 ms;
// the noise is held, and the observer switches, at these steps.
//
// Plant      x1' = x2,  x2' = (sin x1 + sin x2) / (4 pi) + d* + u,  d* = t / (4 pi) + sin(0.4 t +
// 1)
//            y = x1 + noise
// Observer   z_i' = z_{i+1} + l_i e (+ u for i = 2),  l = (3 W, 3 W^2, W^3),  e = y - z_1
//            LESO  W = w
//            ABESO W = rho w while |e| shrinks, w otherwise
//            BESO  W = rho w while |e| shrinks, w / rho otherwise
// Control    u = 25 (r - z_1) - 10 z_2 - z_3
//
// symbol      code                 value                unit
// w           bandwidths           4..10                rad/s
// rho         ratio                0.7                  -
//             noise_variance       0.001                -
//             step                 0.01                 s
//             duration             20                   s
// x(0)                             (1, 1); observers 0
// r(t)        reference            1: ours, the paper only draws it; 1 + sin t as a variant
// J           Criteria::index      100 (1/20) int |e| dt

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "common/statistics.hpp"
#include "paper3_abeso/paper3.hpp"

using namespace esokit::examples;
using namespace paper3;

namespace {

constexpr std::size_t seeds = 60;
constexpr std::size_t count = 7;
constexpr std::array<double, count> bandwidths = {4, 5, 6, 7, 8, 9, 10};
const std::array<std::string, 3> index_names = {"J_ex", "J_edx", "J_ed"};
const std::array<std::string, 3> rise_names = {"t_r of e_x (s)", "t_r of e_dx (s)",
                                               "t_r of e_d (s)"};
const std::array<std::string, 3> peak_names = {"peak e_x", "peak e_dx", "peak e_d"};

using Rows = std::array<std::array<double, count>, 3>;
// Tables 2, 4, 6 as printed: J_ex, J_edx, J_ed for w = 4 .. 10.
constexpr Rows table2 = {{{1.76, 1.68, 1.65, 1.66, 1.72, 1.74, 1.77},
                          {10.79, 10.73, 11.53, 12.75, 14.85, 16.83, 17.21},
                          {26.03, 26.32, 28.73, 33.48, 40.43, 48.91, 59.03}}};
constexpr Rows table4 = {{{2.84, 2.76, 2.68, 2.59, 2.78, 2.66, 2.77},
                          {19.91, 23.34, 25.85, 27.97, 34.49, 35.36, 39.93},
                          {39.10, 53.34, 70.59, 89.23, 119.52, 142.82, 171.19}}};
constexpr Rows table6 = {{{1.57, 1.50, 1.54, 1.57, 1.67, 1.72, 1.87},
                          {8.97, 8.81, 10.10, 11.03, 14.13, 15.63, 21.54},
                          {23.26, 22.67, 25.05, 28.37, 38.32, 46.61, 63.23}}};
// An independent run of the LESO in the same set-up: J_ed.
constexpr std::array<double, count> independent = {25.81, 26.19, 28.67, 33.46, 40.31, 48.86, 58.91};

// Tables 3 and 5 as printed, w = 5, 6, 7: t_r, then peaks, of e_x, e_dx, e_d.
using Transient = std::array<std::array<double, 3>, 3>;
constexpr Transient table3_rise = {{{.70, .62, .50}, {.64, .52, .46}, {2.09, 1.56, 1.34}}};
constexpr Transient table3_peak = {{{.04, .04, .05}, {.39, .43, .51}, {.53, .62, .73}}};
constexpr Transient table5_rise = {{{.64, .51, .47}, {.57, .47, .39}, {2.22, 2.22, 2.22}}};
constexpr Transient table5_peak = {{{.06, .06, .06}, {.61, .71, .97}, {.94, 1.26, 1.64}}};

/// All runs of an observer: [bandwidth][seed].
struct Runs {
  Kind kind;
  std::array<std::vector<Criteria>, count> at;

  template <class Number>
  Statistics operator()(std::size_t w, Number number) const {
    return statistics_of(at[w], number);
  }
  Statistics index(std::size_t w, std::size_t i) const {
    return (*this)(w, [i](const Criteria& c) { return c.index[i]; });
  }
};

Runs run_all(const Kind& kind, const std::array<double, count>& at_bandwidth = bandwidths) {
  const auto flat = run_parallel(kind.name, count * seeds, [&](std::size_t job) {
    return run(kind, at_bandwidth[job / seeds], 1 + job % seeds);
  });
  Runs runs{kind, {}};
  for (std::size_t job = 0; job < flat.size(); ++job) runs.at[job / seeds].push_back(flat[job]);
  return runs;
}

/// How much better `ours` is than `base` in %, seed by seed.
template <class Number>
Statistics paired_gain(const std::vector<Criteria>& ours, const std::vector<Criteria>& base,
                       Number number) {
  std::vector<double> gains;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    gains.push_back(100.0 * (1.0 - number(ours[i]) / number(base[i])));
  }
  return statistics(gains);
}

std::string with_deviation(const Statistics& s, int digits = 4) {
  return number_text(s.mean, digits) + " (" + number_text(s.standard_deviation, 2) + ")";
}

std::string case_of(const Kind& kind, double w) {
  return std::string(kind.name) + ", w = " + number_text(w, 3);
}

Figure draw_errors(const std::string& name, const Kind& kind, const std::string& caption) {
  Figure figure(name, {.rows = 2, .columns = 2, .panel_height = 215});
  figure.caption(caption);
  std::array<Series, 3> runs;
  for (std::size_t i = 0; i < 3; ++i) (void)run(kind, bandwidths[1 + i], 1, &runs[i]);
  constexpr std::array<const char*, 3> labels = {"e_x", "e_{dx}", "e_d"};
  for (std::size_t i = 0; i < 3; ++i) {
    // Room above for the two enlargements.
    double least = 0.0;
    double largest = 0.0;
    for (const Series& one : runs) {
      least = std::min(least, *std::min_element(one.error[i].begin(), one.error[i].end()));
      largest = std::max(largest, *std::max_element(one.error[i].begin(), one.error[i].end()));
    }
    const double span = largest - least;
    auto& panel = figure.panel(i / 2, i % 2)
                      .x_label("t (s)")
                      .y_label(std::string(labels[i]) + " (-)")
                      .name(std::string("error_") + (i == 0   ? "x"
                                                     : i == 1 ? "dx"
                                                              : "d"))
                      .y_range(least - 0.1 * span, largest + 1.3 * span)
                      .legend(Legend::above);
    constexpr std::array colors = {Color::blue, Color::green, Color::vermillion};
    for (std::size_t w = 3; w-- > 0;) {  // the noisiest first
      panel.line(
          runs[w].t, runs[w].error[i],
          {.name = "w = " + number_text(bandwidths[1 + w], 2), .color = colors[w], .width = 1.1});
    }
    panel
        .inset({.left = 0.16,
                .bottom = 0.56,
                .width = 0.3,
                .height = 0.4,
                .x = {0.0, 2.0},
                .frame = false,
                .connect = false})
        .inset({.left = 0.6, .bottom = 0.56, .width = 0.37, .height = 0.4, .x = {14.0, 16.0}});
  }
  figure.panel(1, 1)
      .x_label("t (s)")
      .y_label("d (-)")
      .name("disturbance")
      .legend(Legend::above)
      .line(runs[2].t, runs[2].estimate,
            {.name = "estimate, w = 7", .color = Color::vermillion, .width = 1.1})
      .line(runs[2].t, runs[2].disturbance,
            {.name = "total disturbance", .color = Color::black, .dash = Dash::dashed});
  return figure;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "noise",
                about("Three observers under noise (Figs 1-4, Tables 2-8)",
                      "A second-order plant under a growing sine disturbance, controlled through "
                      "LESO, BESO and ABESO; bandwidths 4 to 10 rad/s, " +
                          std::to_string(seeds) +
                          " noise seeds. Paper way: continuous observer, RK4 at 10 ms."));

  const Runs linear = run_all(leso);
  const Runs bi = run_all(beso);
  const Runs adjustable = run_all(abeso);
  const Runs bi_printed = run_all(beso_printed);
  const Runs adjustable_printed = run_all(abeso_printed);
  // The linear observer that has the bandwidth which the ABESO has on average.
  std::array<double, count> mean_bandwidth{};
  for (std::size_t w = 0; w < count; ++w) {
    mean_bandwidth[w] = adjustable(w, &Criteria::mean_bandwidth).mean;
  }
  Kind at_mean = leso;
  at_mean.name = "LESO at mean bandwidth";
  const Runs linear_at_mean = run_all(at_mean, mean_bandwidth);

  // ---- Tables 2, 4, 6
  const std::string no_convention =
      "384 combinations of sign, hold, step, start, weights and units were tried, and none gives "
      "the printed BESO and ABESO";
  for (std::size_t w = 0; w < count; ++w) {
    const std::string name = case_of(leso, bandwidths[w]);
    report.known_miss(name, index_names[0], table2[0][w], linear.index(w, 0), 0.02,
                      "ours is about 0.3 lower throughout, in every convention tried");
    if (bandwidths[w] == 8.0 || bandwidths[w] == 9.0) {
      report.known_miss(name, index_names[1], table2[1][w], linear.index(w, 1), 0.02,
                        "the printed column has a jump here that no run shows");
    } else {
      report.check(name, index_names[1], table2[1][w], linear.index(w, 1), 0.02);
    }
    report.check(name, index_names[2], table2[2][w], linear.index(w, 2), 0.02);
  }
  for (std::size_t w = 0; w < count; ++w) {
    report.check_reference(case_of(leso, bandwidths[w]), "J_ed, second run", independent[w],
                           linear.index(w, 2),
                           Tolerance::deviations(3.0, linear.index(w, 2)).or_relative(0.01));
  }
  for (std::size_t w = 0; w < count; ++w) {
    for (std::size_t i = 0; i < 3; ++i) {
      report.known_miss(case_of(beso, bandwidths[w]), index_names[i], table4[i][w], bi.index(w, i),
                        0.02, no_convention);
    }
  }
  for (std::size_t w = 0; w < count; ++w) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::string name = case_of(abeso, bandwidths[w]);
      if (bandwidths[w] == 6.0 && i == 2) {
        report.check(name, index_names[i], table6[i][w], adjustable.index(w, i), std::nullopt,
                     "within 2 %, which its neighbours are not");
        continue;
      }
      report.known_miss(name, index_names[i], table6[i][w], adjustable.index(w, i), 0.02,
                        no_convention);
    }
  }

  // ---- Tables 3, 5, 7
  const std::string own_definition =
      "by our definition, see the table; by the paper's it would be another number";
  for (std::size_t w = 1; w <= 3; ++w) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto rise = [i](const Criteria& c) { return c.rise[i]; };
      const auto peak = [i](const Criteria& c) { return c.peak[i]; };
      // The paper shows one run: it must be one that our seeds could give.
      report.check(case_of(leso, bandwidths[w]), rise_names[i], table3_rise[i][w - 1],
                   linear(w, rise), Tolerance::deviations(2.0, linear(w, rise)), own_definition);
      report.check(case_of(leso, bandwidths[w]), peak_names[i], table3_peak[i][w - 1],
                   linear(w, peak), Tolerance::deviations(2.0, linear(w, peak)), own_definition);
      report.known_miss(case_of(beso, bandwidths[w]), rise_names[i], table5_rise[i][w - 1],
                        bi(w, rise), 0.02, no_convention);
      report.known_miss(case_of(beso, bandwidths[w]), peak_names[i], table5_peak[i][w - 1],
                        bi(w, peak), 0.02, no_convention);
      report.check(case_of(abeso, bandwidths[w]), rise_names[i], std::nullopt, adjustable(w, rise));
      report.check(case_of(abeso, bandwidths[w]), peak_names[i], std::nullopt, adjustable(w, peak));
    }
  }

  const auto cases = [](const Kind& kind, std::size_t from, std::size_t to) {
    std::vector<std::string> names;
    for (std::size_t w = from; w <= to; ++w) names.push_back(case_of(kind, bandwidths[w]));
    return names;
  };
  const std::vector<std::string> indexes(index_names.begin(), index_names.end());
  const std::vector<std::string> transients = {rise_names[0], rise_names[1], rise_names[2],
                                               peak_names[0], peak_names[1], peak_names[2]};
  const std::string mean = ", mean (standard deviation) over " + std::to_string(seeds) + " seeds";
  report.comparison("2", "Table 2: LESO, J = 100 (1/20) int |e| dt" + mean, cases(leso, 0, 6),
                    indexes);
  report.comparison("3", "Table 3: LESO" + mean, cases(leso, 1, 3), transients);
  report.remark(
      "t_r and peak in Tables 3, 5 and 7 are by our definition, the one that fits Table 3: t_r is "
      "when the error is back in [-0.01, 0.01] after its first overshoot (e_d: after its second), "
      "peak the largest error after t_r (e_d: after 5 s).");
  report.comparison("4", "Table 4: BESO" + mean, cases(beso, 0, 6), indexes);
  report.comparison("5", "Table 5: BESO" + mean, cases(beso, 1, 3), transients);
  report.comparison("6", "Table 6: ABESO" + mean, cases(abeso, 0, 6), indexes);
  report.comparison("7", "Table 7: ABESO (the paper's was not available to us)" + mean,
                    cases(abeso, 1, 3), transients);

  // ---- Table 8, and what the gain is
  constexpr std::size_t w7 = 3;
  const auto ed = [](const Criteria& c) { return c.index[2]; };
  const auto ed_steady = [](const Criteria& c) { return c.steady[2]; };
  const auto ed_transient = [](const Criteria& c) { return c.index[2] - c.steady[2]; };
  constexpr std::array<double, 3> reduction = {4.89, 13.46, 15.28};
  constexpr std::array<double, 3> beso_reduction = {39.26, 60.56, 68.21};
  std::vector<CsvRow> lines;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto number = [i](const Criteria& c) { return c.index[i]; };
    const auto gain = paired_gain(adjustable.at[w7], linear.at[w7], number);
    const auto over_beso = paired_gain(adjustable.at[w7], bi.at[w7], number);
    report.known_miss("ABESO against LESO, w = 7", "less " + index_names[i] + " (%)", reduction[i],
                      gain, 0.02, no_convention);
    report.known_miss("ABESO against BESO, w = 7", "less " + index_names[i] + " (%)",
                      beso_reduction[i], over_beso, 0.02, no_convention);
    lines.push_back(
        {index_names[i], number_text(table2[i][w7]), with_deviation(linear.index(w7, i)),
         number_text(table4[i][w7]), with_deviation(bi.index(w7, i)), number_text(table6[i][w7]),
         with_deviation(adjustable.index(w7, i)), number_text(reduction[i]),
         with_deviation(gain, 3), number_text(beso_reduction[i]), with_deviation(over_beso, 3)});
  }
  report.table("8", "Table 8: w = 7" + mean + "; reductions are paired, seed by seed, in %",
               {"index", "LESO, paper", "LESO, ours", "BESO, paper", "BESO, ours", "ABESO, paper",
                "ABESO, ours", "less than LESO, paper", "ours", "less than BESO, paper", "ours"},
               lines);
  const auto gain7 = paired_gain(adjustable.at[w7], linear.at[w7], ed);
  report.check_reference("ABESO, w = 7", "J_ed, second run", 29.98, adjustable.index(w7, 2),
                         Tolerance::deviations(3.0, adjustable.index(w7, 2)));
  report.check_reference("ABESO against LESO, w = 7", "paired gain in J_ed (%)", 10.7, gain7,
                         Tolerance::absolute(1.5), "independent run, 1.5 sd");
  report.check_reference("ABESO, w = 7", "mean bandwidth (rad/s)", 5.95, mean_bandwidth[w7], 0.01);
  report.check("BESO, w = 7", "J_ed, second run", std::nullopt, bi.index(w7, 2), std::nullopt,
               "independent run: 49.5; we do not know why it differs by 7 %");
  const auto printed_gain = paired_gain(adjustable_printed.at[w7], linear.at[w7], ed);
  report.check_reference("ABESO with the printed sign, w = 7", "paired gain in J_ed (%)", -46.0,
                         printed_gain, Tolerance::absolute(4.0));
  report.check("BESO with the printed sign, w = 7", "J_ed", std::nullopt, bi_printed.index(w7, 2),
               std::nullopt, "independent run: 85.7");
  const auto steady7 = paired_gain(adjustable.at[w7], linear.at[w7], ed_steady);
  report.expect("ABESO against LESO, w = 7", "paired gain in J_ed for t > 5 s (%)", steady7,
                std::abs(steady7.mean) < steady7.standard_deviation,
                "no gain but for the transient: within a standard deviation of zero");

  lines.clear();
  for (std::size_t w = 0; w < count; ++w) {
    const auto& a = adjustable.at[w];
    const auto& l = linear.at[w];
    lines.push_back({number_text(bandwidths[w], 3), with_deviation(paired_gain(a, l, ed), 3),
                     with_deviation(paired_gain(a, l, ed_transient), 3),
                     with_deviation(paired_gain(a, l, ed_steady), 3),
                     number_text(mean_bandwidth[w], 3),
                     with_deviation(paired_gain(linear_at_mean.at[w], l, ed), 3),
                     with_deviation(paired_gain(linear_at_mean.at[w], l, ed_transient), 3),
                     with_deviation(paired_gain(linear_at_mean.at[w], l, ed_steady), 3),
                     with_deviation(paired_gain(adjustable_printed.at[w], l, ed), 3),
                     with_deviation(paired_gain(bi.at[w], l, ed), 3),
                     with_deviation(paired_gain(bi_printed.at[w], l, ed), 3)});
  }
  report.table("gain",
               "Where the gain is: reduction of J_ed against the LESO of the same w in %, paired, "
               "mean (standard deviation) over " +
                   std::to_string(seeds) +
                   " seeds, in all and in the two parts of the run. The LESO at the ABESO's mean "
                   "bandwidth stands beside it.",
               {"w (rad/s)", "ABESO", "t < 5 s", "t > 5 s", "mean bandwidth", "LESO at it",
                "t < 5 s", "t > 5 s", "ABESO, printed sign", "BESO", "BESO, printed sign"},
               lines);

  // Both readings of the sign.
  lines.clear();
  for (std::size_t w = 0; w < count; ++w) {
    CsvRow row{number_text(bandwidths[w], 3)};
    for (std::size_t i = 0; i < 3; ++i) {
      row.insert(row.end(), {number_text(table4[i][w]), with_deviation(bi.index(w, i)),
                             with_deviation(bi_printed.index(w, i))});
    }
    for (std::size_t i = 0; i < 3; ++i) {
      row.insert(row.end(), {number_text(table6[i][w]), with_deviation(adjustable.index(w, i)),
                             with_deviation(adjustable_printed.index(w, i))});
    }
    lines.push_back(row);
  }
  CsvRow readings{"w (rad/s)"};
  for (const char* name : {"BESO ", "ABESO "}) {
    for (const std::string& index : index_names) {
      readings.insert(readings.end(), {name + index + ", paper", "|e|", "e"});
    }
  }
  report.table(
      "sign",
      "Both readings of the sign: |e| is ours and the paper's text, e the printed equation" + mean,
      readings, lines);

  report.not_reproduced(
      "Tables 4 to 8, BESO and ABESO: no convention that we tried gives them. With the sign of "
      "d|e|/dt (the text) the ABESO is about 10 % better than the LESO in J_ed at w = 7 (paper: 15 "
      "%), with the printed sign of de/dt it is about 46 % worse. Table 4 is near the printed sign "
      "in J_ed (within 8 %) and J_edx (15 %), not in J_ex.");
  report.not_reproduced(
      "J_ex of Table 2 comes out 0.3 lower, and J_edx is off at w = 8 and 9, in every convention "
      "tried.");
  // The variant of the reference.
  lines.clear();
  const auto sine =
      run_parallel("LESO and ABESO, r = 1 + sin t", 2 * count * seeds, [](std::size_t job) {
        const std::size_t w = job / seeds % count;
        return run(job < count * seeds ? leso : abeso, bandwidths[w], 1 + job % seeds, nullptr,
                   Reference::sine);
      });
  for (std::size_t w = 0; w < count; ++w) {
    const auto of = [&](std::size_t kind) {
      const auto first = sine.begin() + static_cast<std::ptrdiff_t>((kind * count + w) * seeds);
      return std::vector<Criteria>(first, first + seeds);
    };
    const auto l = of(0);
    const auto a = of(1);
    CsvRow row{number_text(bandwidths[w], 3)};
    for (std::size_t i = 0; i < 3; ++i) {
      row.push_back(number_text(table2[i][w]));
      row.push_back(
          with_deviation(statistics_of(l, [i](const Criteria& c) { return c.index[i]; })));
    }
    row.push_back(with_deviation(paired_gain(a, l, ed), 3));
    lines.push_back(row);
  }
  report.table("sine",
               "Variant: the reference 1 + sin t. LESO beside Table 2, and the ABESO's paired gain",
               {"w (rad/s)", "J_ex, paper", "ours", "J_edx, paper", "ours", "J_ed, paper", "ours",
                "ABESO: less J_ed (%)"},
               lines);
  report.remark(
      "The paper shows a curve of the reference, no formula. With r = 1 the J_ed of the LESO is "
      "within 2 % of Table 2 at every bandwidth, with r = 1 + sin t it is 2.4 % low at w = 4; what "
      "is said of the observers holds for both.");
  report.remark(
      "What the ABESO gains it gains in the transient at the start, where a large error shrinks "
      "and the lower bandwidth overshoots less; for t > 5 s nothing is left. From w = 7 on a plain "
      "LESO at the ABESO's mean bandwidth does better; below, where lag and not noise makes the "
      "error, it does worse. With the best bandwidth for each, the ABESO (w = 5) has 8 % less J_ed "
      "than the LESO (w = 4 to 4.25).");

  // ---- figures
  Series series;
  Series variant;
  (void)run(leso, 7.0, 1, &series);
  (void)run(leso, 7.0, 1, &variant, Reference::sine);
  Figure first("fig1", {.rows = 1, .columns = 2, .panel_height = 200});
  first.caption(
      "Fig. 1: the reference and the total disturbance at w = 7 (LESO); dashed the variant 1 + sin "
      "t "
      "of the reference.");
  auto& references =
      first.panel(0, 0).x_label("t (s)").y_label("r (-)").name("reference").y_range(-0.5, 2.5);
  references.legend(Legend::above)
      .line(series.t, series.reference, {.name = "1"})
      .line(variant.t, variant.reference, {.name = "1 + sin t", .dash = Dash::dashed});
  first.panel(0, 1)
      .x_label("t (s)")
      .y_label("d (-)")
      .name("disturbance")
      .legend(Legend::above)
      .line(series.t, series.disturbance, {.name = "r = 1"})
      .line(variant.t, variant.disturbance, {.name = "r = 1 + sin t", .dash = Dash::dashed});
  report.add(first);
  report.add(draw_errors("fig2", leso,
                         "Fig. 2: LESO. Estimation errors for w = 5, 6, 7 with the start and a "
                         "piece of the steady state enlarged, and the disturbance with its "
                         "estimate at w = 7."));
  report.add(draw_errors("fig3", beso, "Fig. 3: BESO, the same."));
  report.add(draw_errors("fig4", abeso, "Fig. 4: ABESO, the same."));

  Figure gains("gain", {.rows = 1, .columns = 2, .panel_height = 230});
  gains.caption(
      "Left: J_ed over the bandwidth, both readings of the sign (bands: standard deviation over "
      "the "
      "seeds; crosses: printed in the paper). Right: paired reduction against the LESO of the same "
      "w, in the two parts of the run.");
  auto& left = gains.panel(0, 0).x_label("w (rad/s)").y_label("J_{ed} (10^{-2})").name("index");
  left.legend(Legend::top_left);
  const auto add = [&](const Runs& runs, Color color, Dash dash) {
    std::vector<double> middle, low, high;
    for (std::size_t w = 0; w < count; ++w) {
      const auto s = runs.index(w, 2);
      middle.push_back(s.mean);
      low.push_back(s.mean - s.standard_deviation);
      high.push_back(s.mean + s.standard_deviation);
    }
    left.band(bandwidths, low, high, {.color = color, .opacity = 0.25});
    left.line(bandwidths, middle, {.name = runs.kind.name, .color = color, .dash = dash});
  };
  add(linear, Color::black, Dash::solid);
  add(adjustable, Color::blue, Dash::solid);
  add(adjustable_printed, Color::blue, Dash::dashed);
  add(bi, Color::vermillion, Dash::solid);
  add(bi_printed, Color::vermillion, Dash::dashed);
  left.points(bandwidths, table2[2], {.color = Color::black, .marker = Marker::cross});
  left.points(bandwidths, table6[2], {.color = Color::blue, .marker = Marker::cross});
  left.points(bandwidths, table4[2], {.color = Color::vermillion, .marker = Marker::cross});
  auto& right = gains.panel(0, 1)
                    .x_label("w (rad/s)")
                    .y_label("less J_{ed} than the LESO (%)")
                    .name("parts")
                    .legend(Legend::bottom_right);
  right.horizontal_line(0.0);
  const auto part = [&](const Runs& runs, auto number, const std::string& name, Color color,
                        Dash dash) {
    std::vector<double> middle;
    for (std::size_t w = 0; w < count; ++w) {
      middle.push_back(paired_gain(runs.at[w], linear.at[w], number).mean);
    }
    right.line(bandwidths, middle, {.name = name, .color = color, .dash = dash});
  };
  part(adjustable, ed_transient, "ABESO, t < 5 s", Color::blue, Dash::solid);
  part(linear_at_mean, ed_transient, "LESO at its mean, t < 5 s", Color::green, Dash::solid);
  part(adjustable, ed_steady, "ABESO, t > 5 s", Color::blue, Dash::dashed);
  part(linear_at_mean, ed_steady, "LESO at its mean, t > 5 s", Color::green, Dash::dashed);
  report.add(gains);
  return report.finish();
}
