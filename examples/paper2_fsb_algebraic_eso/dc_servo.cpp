// Figures 2 to 6 and Table 2: position control of a DC servo drive from several initial states,
// with the linear and with the algebraic observer.
//
// J. Kasac, A. Pender, M. Pranjic, D. Kotarski, "Frequency-shifting-based algebraic approach to
// extended state observer design", Asian Journal of Control 23 (2021) 2171-2184,
// doi:10.1002/asjc.2516, section 5.1.
//
// Way: continuous simulation. Plant, observer and law are one ODE, RK4 at 1 ms, the law evaluated
// inside the stages. A last table shows as a sampled observer beside it.
//
// Plant      x1' = x2,  x2' = a x2 + b u,  y = x1,
//            a = -(Beq Rm + eta_g eta_m Km Kt Kg^2) / (Jeq Rm),  b = eta_g eta_m Kt Kg / (Jeq Rm)
// Observers  of y'' = d + b0 u with d the total disturbance, here a x2 + (b - b0) u:
//            LESO, all poles at -omega_o;  FSB, Eqs. (35)-(51), estimates zero for t < epsilon
// Law (6)    u = (yd'' - kp (x1h - yd) - kd (x2h - yd') - x3h) / b0,  yd = sin t
//
// symbol      code               value            unit
// Beq         (constant below)   0.004            N m s/rad
// Rm          (constant below)   2.6              Ohm
// eta_g       (constant below)   0.9              -
// eta_m       (constant below)   0.69             -
// Km, Kt      (constant below)   0.00767          V s/rad, N m/A
// Kg          (constant below)   70               -
// Jeq         (constant below)   0.0021           kg m^2
// a, b        a, b               -34.691, 61.065  1/s, rad/(V s^2)
// b0          b0                 1.5 b            rad/(V s^2)
// omega_c     omega_c            10               rad/s; kp = omega_c^2, kd = 2 omega_c
// omega_o     bandwidth          60               rad/s, of the LESO
// lambda      bandwidth          60               rad/s, of the FSB observer
// q           q                  0.1              rad/s
// epsilon     epsilon            0.02             s
//
// Not in the paper, but they reproduce Table 2: b0 = 1.5 b; estimates of the FSB observer are zero
// before epsilon while the law stays on; the LESO starts at zero; 10 s; max |v| and max |d| are of
// the estimates, on the grid of steps; max |u| is of the mean of u that RK4 takes over a step. The
// paper cuts digits off, it does not round.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/closed_loop.hpp>
#include <string>
#include <vector>

#include "common/report.hpp"
#include "paper2_fsb_algebraic_eso/paper2.hpp"

using namespace esokit::examples;
using namespace paper2;
namespace sim = esokit::sim;

namespace {

constexpr double a =
    -(0.004 * 2.6 + 0.9 * 0.69 * 0.00767 * 0.00767 * 70.0 * 70.0) / (0.0021 * 2.6);  // 1/s
constexpr double b = 0.9 * 0.69 * 0.00767 * 70.0 / (0.0021 * 2.6);
constexpr double b0 = 1.5 * b;
constexpr double omega_c = 10.0;    // rad/s
constexpr double bandwidth = 60.0;  // rad/s
constexpr double q = 0.1;           // rad/s
constexpr double epsilon = 0.02;    // s
constexpr double duration = 10.0;   // s
constexpr double step = 1e-3;       // s

/// The drive; the third state is the integral of u, from which the mean over a step is taken.
struct Servo {
  static constexpr int states = 3;
  using State = EigenMatrix<double, 3>;
  State derivative(double, const State& x, double u) const { return {x(1), a * x(1) + b * u, u}; }
  double output(double, const State& x) const { return x(0); }
};

struct Row {
  double position, velocity;              ///< y(0), y'(0)
  std::array<double, 3> linear, shifted;  ///< printed max |v|, |d|, |u|
  std::array<int, 3> linear_decimals, shifted_decimals;
};

/// Table 2.
constexpr std::array table2 = {
    Row{0.0, 0.0, {1.205, 61.365, 0.673}, {1.134, 58.353, 0.639}, {3, 3, 3}, {3, 3, 3}},
    Row{0.5, 0.0, {18.340, 418.40, 8.830}, {1.037, 53.824, 0.588}, {3, 2, 3}, {3, 3, 3}},
    Row{0.5, -0.3, {18.277, 416.84, 8.798}, {1.037, 53.826, 0.588}, {3, 2, 3}, {3, 3, 3}},
    Row{-0.5, 0.0, {18.039, 418.75, 9.215}, {2.494, 126.63, 1.398}, {3, 2, 3}, {3, 2, 3}},
    Row{-0.5, 0.3, {17.985, 417.19, 9.182}, {2.481, 126.02, 1.391}, {3, 2, 3}, {3, 2, 3}}};
constexpr std::size_t drawn = 2;  // the row of Figs 2 to 6

std::string row_name(const Row& row) {
  return "y(0) = " + number_text(row.position) + ", y'(0) = " + number_text(row.velocity);
}

struct Run {
  std::array<double, 3> most{};  ///< max |v|, |d| (estimates), |u|
  std::vector<double> t, y_estimate, v, v_estimate, v_error, d, d_estimate, u;

  template <class Sample>
  void add(const Sample& sample, bool keep) {
    const auto& x = sample.plant_state;
    const auto& z = sample.estimate;
    most[0] = std::max(most[0], std::abs(z(1)));
    most[1] = std::max(most[1], std::abs(z(2)));
    if (!keep) return;
    t.push_back(sample.t);
    y_estimate.push_back(z(0));
    v.push_back(x(1));
    v_estimate.push_back(z(1));
    v_error.push_back(z(1) - x(1));
    d.push_back(a * x(1) + (b - b0) * sample.input);
    d_estimate.push_back(z(2));
    u.push_back(sample.input);
  }
};

double control(double t, const EigenMatrix<double, 3>& estimate) {
  static const auto law =
      esokit::AdrcLaw<2>::make({.controller_bandwidth = omega_c, .input_gain = b0}).value();
  return law.control(estimate, EigenMatrix<double, 3>(std::sin(t), std::cos(t), -std::sin(t)));
}

/// Continuous simulation.
template <class Observer>
Run run_paper(const Observer& observer, const Row& row, bool keep) {
  const sim::ContinuousLoop loop{Servo{}, observer, control};
  Run run;
  double integral = 0.0;
  (void)loop
      .run({.duration = duration,
            .step = step,
            .plant_state = EigenMatrix<double, 3>(row.position, row.velocity, 0.0)},
           [&](const auto& sample) {
             run.add(sample, keep);
             if (sample.index > 0) {
               const double mean = (sample.plant_state(2) - integral) / step;
               run.most[2] = std::max(run.most[2], std::abs(mean));
             }
             integral = sample.plant_state(2);
           })
      .value();
  return run;
}

/// The sampled observer: sampled every millisecond, input held.
template <class Observer>
Run run_deployed(const Observer& observer, const Row& row) {
  const sim::SampledLoop loop{Servo{}, observer, control};
  Run run;
  (void)loop
      .run({.duration = duration,
            .sample_time = step,
            .plant_state = EigenMatrix<double, 3>(row.position, row.velocity, 0.0)},
           [&](const auto& sample) {
             run.add(sample, false);
             run.most[2] = std::max(run.most[2], std::abs(sample.input));
           })
      .value();
  return run;
}

enum class Digits { cut_off, rounded, differ };

/// How our number gives the printed digits.
Digits printed_digits(double ours, double printed, int decimals) {
  const double scale = std::pow(10.0, decimals);
  const double digits = std::round(printed * scale);
  if (std::floor(ours * scale) == digits) return Digits::cut_off;
  return std::round(ours * scale) == digits ? Digits::rounded : Digits::differ;
}

/// Whole time at the left, the first 0.3 s at the right.
struct Drawing {
  static constexpr double shown_start = 0.3;  // s
  Figure figure;
  Drawing(const std::string& name, const std::string& caption, const std::string& label)
      : figure(name, {.rows = 1, .columns = 2, .panel_height = 260}) {
    figure.caption(caption);
    for (std::size_t c = 0; c < 2; ++c) {
      figure.panel(0, c).x_label("t (s)").y_label(c == 0 ? label : "");
    }
    figure.panel(0, 0).x_range(0.0, duration).legend(Legend::above).name("whole");
    figure.panel(0, 1).x_range(0.0, shown_start).legend(Legend::above).name("start");
  }
  Drawing& line(const std::vector<double>& t, const std::vector<double>& y, const Style& style) {
    // The start alone, so that it is not thinned with the rest.
    const auto few = std::upper_bound(t.begin(), t.end(), shown_start) - t.begin();
    figure.panel(0, 0).line(t, y, style);
    figure.panel(0, 1).line(std::vector<double>(t.begin(), t.begin() + few),
                            std::vector<double>(y.begin(), y.begin() + few), style);
    return *this;
  }
};

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, folder, "dc_servo",
      about("DC servo drive (Figs 2-6, Table 2)",
            "Tracking of sin t from five initial states with a linear and with the algebraic "
            "observer. Continuous simulation: plant, observer and law as one ODE, RK4 at 1 ms.",
            1));
  for (const auto& [where, printed, correct] :
       {std::array{"(11)", "the second term (misprint)", "-3 (s + 2q) u(s + 2q)"},
        std::array{"(28)", "w3~ (misprint)", "w3~ = G w1bar + G^2 w2bar + G^3 w3bar"},
        std::array{"section 4.1", "Cbar (misprint)",
                   "Cbar = [[-1, 0, 0], [-2 lambda, -1, 0], [-lambda^2, -lambda, -1]]"}}) {
    report.correction(
        {.where = where,
         .printed = printed,
         .correct = correct,
         .why = "from the derivation, in our copy of the text; (35) to (51) are right as printed"});
  }
  report.correction({.where = "Table 2",
                     .printed = "caption: system parameters, with and without noise",
                     .correct = "largest estimates and control, without noise",
                     .why = "as its columns and section 5.1 say"});
  report.correction({.where = "section 4.2",
                     .printed = "the transient depends only on the controller bandwidth omega_o",
                     .correct = "omega_c",
                     .why = "omega_o is the observer bandwidth; Table 1 has it right"});
  report.remark(
      "Needed for the numbers of the paper, but not printed in it: b0 = 1.5 b; the linear observer "
      "starts at zero. Before epsilon the estimates of the algebraic observer (FSB) are zero, and "
      "the control law acts on them.");
  report.remark(
      "The columns v and d are those of the estimates; max |u| is that of the mean of u over an "
      "RK4 step.");

  const auto linear = linear_observer<2>(bandwidth, b0);
  const BlankedFilter<2> shifted(bandwidth, q, b0, epsilon);
  const std::array<std::string, 3> metrics = {"max |v|", "max |d|", "max |u|"};
  Run linear_drawn;
  Run shifted_drawn;
  int equal = 0;
  int cut_off = 0;
  std::string others;
  for (std::size_t i = 0; i < table2.size(); ++i) {
    const Row& row = table2[i];
    const Run one = run_paper(linear, row, i == drawn);
    const Run two = run_paper(shifted, row, i == drawn);
    for (std::size_t m = 0; m < 3; ++m) {
      const auto compare = [&](const std::string& observer, double printed, double ours,
                               int decimals) {
        const Digits digits = printed_digits(ours, printed, decimals);
        cut_off += digits == Digits::cut_off ? 1 : 0;
        equal += digits != Digits::differ ? 1 : 0;
        if (digits != Digits::cut_off) {
          others += " " + observer + ", " + row_name(row) + ", " + metrics[m] + ": printed " +
                    number_text(printed, 6) + ", ours " + number_text(ours, 7) + ".";
        }
        report.check(row_name(row), observer + " " + metrics[m], printed, ours, 2e-3,
                     digits == Digits::cut_off   ? "all printed digits, cut off"
                     : digits == Digits::rounded ? "all printed digits, rounded"
                                                 : "last printed digit differs");
      };
      compare("LESO", row.linear[m], one.most[m], row.linear_decimals[m]);
      compare("FSB", row.shifted[m], two.most[m], row.shifted_decimals[m]);
    }
    if (i == drawn) {
      linear_drawn = one;
      shifted_drawn = two;
    }
  }
  report.expect("Table 2", "entries with every printed digit, of 30", equal, equal >= 29,
                "at least 29, cut off or rounded");
  report.check("Table 2", "of these, cut off", std::nullopt, cut_off);
  std::vector<std::string> rows;
  for (const Row& row : table2) rows.push_back(row_name(row));
  report.comparison("table2",
                    "Table 2: largest velocity and disturbance estimate and largest control", rows,
                    {"LESO max |v|", "LESO max |d|", "LESO max |u|", "FSB max |v|", "FSB max |d|",
                     "FSB max |u|"});
  report.remark(
      "Of the 30 entries " + std::to_string(cut_off) +
      " agree in every printed digit when ours are cut off, as those of the paper are, and " +
      std::to_string(equal) + " when they are cut off or rounded. The others:" + others +
      " Both depend on how the stages of the integrator treat the switch at epsilon: a switch at "
      "the boundary of a step gives 58.358 and 53.8239, a step of 0.1 ms 58.3574 and 53.8239.");

  // The sampled observer beside it.
  std::vector<CsvRow> lines;
  const auto deployed = esokit::AlgebraicEso<2>::make({.observer_bandwidth = bandwidth,
                                                       .frequency_shift = q,
                                                       .input_gain = b0,
                                                       .sample_time = step,
                                                       .blanking = epsilon})
                            .value();
  const auto at_once = esokit::AlgebraicEso<2>::make({.observer_bandwidth = bandwidth,
                                                      .frequency_shift = q,
                                                      .input_gain = b0,
                                                      .sample_time = step})
                           .value();
  const auto sampled_linear =
      esokit::LinearEso<2>::make(
          {.observer_bandwidth = bandwidth, .input_gain = b0, .sample_time = step})
          .value();
  for (const Row& row : table2) {
    const auto add = [&](const std::string& name, const Run& run) {
      lines.push_back({row_name(row), name, shown_text(run.most[0]), shown_text(run.most[1]),
                       shown_text(run.most[2])});
    };
    add("LinearEso", run_deployed(sampled_linear, row));
    const Run held = run_deployed(deployed, row);
    add("AlgebraicEso, blanking 20 ms", held);
    add("AlgebraicEso, default blanking (2 samples)", run_deployed(at_once, row));
    // The two ways differ by about a sample: 1 ms in 20 of blanking.
    report.expect(row_name(row), "deployed: max |d|", held.most[1],
                  std::abs(held.most[1] / run_paper(shifted, row, false).most[1] - 1.0) < 0.1,
                  "within 10 % of the continuous simulation");
  }
  report.additions();
  report.table("deployed",
               "The same with sampled observers (our addition) at 1 ms, input held. Without "
               "measurement noise there is no reason to wait, and the default blanking of two "
               "samples avoids the jump at epsilon",
               {"case", "observer", "max |v|", "max |d|", "max |u|"}, lines);

  // Figures, row 3 of the table.
  const std::string start = " y(0) = 0.5, y'(0) = -0.3; right: the first 0.3 s.";
  const auto& t = linear_drawn.t;
  std::vector<double> reference;
  std::vector<double> reference_rate;
  for (const double time : t) {
    reference.push_back(std::sin(time));
    reference_rate.push_back(std::cos(time));
  }
  const Style desired{.name = "reference", .color = Color::black, .dash = Dash::dashed};
  const Style leso{.name = "LESO", .color = Color::vermillion};
  const Style fsb{.name = "FSB", .color = Color::blue};
  report.additions(false);
  report.add(Drawing("fig2", "Fig 2: estimated position." + start, "position estimate (rad)")
                 .line(t, reference, desired)
                 .line(t, linear_drawn.y_estimate, leso)
                 .line(t, shifted_drawn.y_estimate, fsb)
                 .figure);
  report.add(Drawing("fig3", "Fig 3: estimated velocity. The linear observer peaks." + start,
                     "velocity estimate (rad/s)")
                 .line(t, reference_rate, desired)
                 .line(t, linear_drawn.v_estimate, leso)
                 .line(t, shifted_drawn.v_estimate, fsb)
                 .figure);
  report.add(Drawing("fig4",
                     "Fig 4: error of the velocity estimate. That of the FSB observer is the "
                     "velocity itself until epsilon = 0.02 s; after that both observers lag behind "
                     "the disturbance by the same amount." +
                         start,
                     "velocity error (rad/s)")
                 .line(t, linear_drawn.v_error, leso)
                 .line(t, shifted_drawn.v_error, fsb)
                 .figure);
  report.add(Drawing("fig5",
                     "Fig 5: estimate of the total disturbance. The dotted lines are the true "
                     "disturbances, a x2 + (b - b0) u, which differ because u differs." +
                         start,
                     "disturbance (rad/s^2)")
                 .line(t, linear_drawn.d_estimate, leso)
                 .line(t, shifted_drawn.d_estimate, fsb)
                 .line(t, linear_drawn.d,
                       {.name = "true (LESO)", .color = Color::orange, .dash = Dash::dotted})
                 .line(t, shifted_drawn.d,
                       {.name = "true (FSB)", .color = Color::sky, .dash = Dash::dotted})
                 .figure);
  report.add(Drawing("fig6", "Fig 6: control." + start, "u (V)")
                 .line(t, linear_drawn.u, leso)
                 .line(t, shifted_drawn.u, fsb)
                 .figure);

  // ---- what the paper claims of it
  const auto from = [&](double time) {
    return static_cast<std::size_t>(std::lower_bound(t.begin(), t.end(), time - 1e-9) - t.begin());
  };
  const auto largest = [](const std::vector<double>& values, std::size_t first = 0) {
    double most = 0.0;
    for (std::size_t k = first; k < values.size(); ++k) most = std::max(most, std::abs(values[k]));
    return most;
  };
  const auto verdict = [](bool holds) { return holds ? Claim::Holds::yes : Claim::Holds::no; };
  std::vector<double> apart;
  for (std::size_t k = 0; k < t.size(); ++k) {
    apart.push_back(linear_drawn.y_estimate[k] - shifted_drawn.y_estimate[k]);
  }
  report.claim({.text = "The estimated positions are similar.",
                .where = "5.1, Fig 2",
                .holds = verdict(largest(apart, from(1.0)) < 0.05),
                .here = "They differ by up to " + number_text(largest(apart), 2) +
                        " rad at first, and by up to " + number_text(largest(apart, from(1.0)), 2) +
                        " rad after 1 s.",
                .figure = "fig2"});
  const auto peaks = [&](const char* what, std::size_t m, const std::string& unit,
                         const char* where, const char* figure) {
    const double leso_peak = linear_drawn.most[m];
    const double fsb_peak = shifted_drawn.most[m];
    report.claim({.text = std::string("The linear observer peaks in ") + what +
                          ", the algebraic one does not.",
                  .where = where,
                  .holds = verdict(leso_peak > 5.0 * fsb_peak),
                  .here = "Largest: " + number_text(leso_peak, 4) + " with the linear, " +
                          number_text(fsb_peak, 4) + unit + " with the algebraic observer.",
                  .figure = figure});
  };
  peaks("the estimated velocity", 0, " rad/s", "5.1, Fig 3", "fig3");
  const double linear_error = largest(linear_drawn.v_error);
  const double shifted_error = largest(shifted_drawn.v_error);
  report.claim({.text = "The velocity error is much larger with the linear observer.",
                .where = "5.1, Fig 4",
                .holds = verdict(linear_error > 5.0 * shifted_error),
                .here = "Largest: " + number_text(linear_error, 3) + " and " +
                        number_text(shifted_error, 2) +
                        " rad/s (the velocity itself, until epsilon). Later both have the same.",
                .figure = "fig4"});
  peaks("the estimated disturbance", 1, " rad/s^2", "5.1, Fig 5", "fig5");
  peaks("the control", 2, " V", "5.1, Fig 6", "fig6");
  // An overshoot: an estimate larger than anything that there is to estimate.
  const double velocity_share = largest(shifted_drawn.v_estimate) / largest(shifted_drawn.v);
  const double disturbance_share = largest(shifted_drawn.d_estimate) / largest(shifted_drawn.d);
  report.claim({.text = "The algebraic observer finds velocity and disturbance without overshoot.",
                .where = "5.1",
                .holds = verdict(velocity_share < 1.01 && disturbance_share < 1.01),
                .here = "Its largest estimates are " + number_text(100.0 * velocity_share, 3) +
                        " and " + number_text(100.0 * disturbance_share, 3) +
                        " % of the largest true velocity and disturbance.",
                .figure = "fig5"});
  const auto ratio = [](const Row& row) { return row.linear[0] / row.shifted[0]; };
  double least_ratio = 1e9;
  for (std::size_t i = 1; i < table2.size(); ++i) {
    least_ratio = std::min(least_ratio, ratio(table2[i]));
  }
  report.claim(
      {.text = "For all initial states the maxima are much larger with the linear observer.",
       .where = "Table 2",
       .holds = ratio(table2[0]) > 2.0 ? Claim::Holds::yes
                : least_ratio > 2.0    ? Claim::Holds::partly
                                       : Claim::Holds::no,
       .here = "From the four that are not zero the velocity estimate is " +
               number_text(least_ratio, 2) +
               " times as large or more. From zero, where nothing "
               "peaks, it is " +
               number_text(ratio(table2[0]), 3) + " times as large.",
       .figure = "table2"});

  // For the README: the starts of Figs 3 and 6 side by side.
  Figure peak("peak", {.rows = 1, .columns = 2, .panel_height = 190});
  peak.caption("The starts of Figs 3 and 6: velocity as it is and as it is estimated, and u." +
               std::string(" y(0) = 0.5, y'(0) = -0.3."));
  const auto few = std::upper_bound(t.begin(), t.end(), Drawing::shown_start) - t.begin();
  const auto begin = [&](const std::vector<double>& values) {
    return std::vector<double>(values.begin(), values.begin() + few);
  };
  peak.panel(0, 0)
      .x_label("t (s)")
      .y_label("velocity estimate (rad/s)")
      .legend(Legend::top_right)
      .name("velocity")
      .line(begin(t), begin(linear_drawn.v_estimate), leso)
      .line(begin(t), begin(shifted_drawn.v_estimate),
            {.name = "AlgebraicEso", .color = Color::blue})
      .line(begin(t), begin(shifted_drawn.v),
            {.name = "true (FSB)", .color = Color::black, .dash = Dash::dotted});
  peak.panel(0, 1)
      .x_label("t (s)")
      .y_label("u (V)")
      .name("control")
      .line(begin(t), begin(linear_drawn.u), {.color = Color::vermillion, .column = "LESO"})
      .line(begin(t), begin(shifted_drawn.u), {.color = Color::blue, .column = "AlgebraicEso"});
  report.add(peak);
  return report.finish();
}
