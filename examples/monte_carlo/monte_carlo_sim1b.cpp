// Sim1B of paper 1 with very many seeds: where the printed numbers lie among what chance gives.
//
// K. Lakomy, R. Madonski, "Cascade extended state observer for active disturbance rejection control
// applications under measurement noise", ISA Transactions 109 (2021) 1-10,
// doi:10.1016/j.isatra.2020.09.007.
//
// Way: continuous simulation, as in paper1_cascade_eso/cascade_sim1.cpp, whose equations these are:
// plant, observer and criteria as one ODE, Runge-Kutta of order 4 at 1 ms, so many seeds at once as
// a register holds. The noise stands still for 10 ms: it is the input of that ODE, and the loop
// that sim::run closes around it hands the measurement noise of its samples on.
//
// symbol      code            value                unit
// w           (input)         sqrt(1e-9/0.01)      of y, held 10 ms
// omega_o1    table1          250, 60.82, 33.98    rad/s, for p = 1, 2, 3
// alpha       level_factor    2                    -
//
// --runs N: so many seeds; 10,000 if left out, 100,000 take a minute and a half of one core.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <type_traits>
#include <vector>

#include <esokit/sim/monte_carlo.hpp>

#include "common/report.hpp"
#include "paper1_cascade_eso/paper1.hpp"

using namespace esokit::examples;

namespace {

using esokit::Vector;
namespace sim = esokit::sim;

constexpr double step = 1e-3;
constexpr double T = paper1::noise_hold;
constexpr int substeps = 10;
constexpr std::array<const char*, 3> criteria = {"1e3 int |e| dt", "int u^2 dt",
                                                 "int |z3 error| dt"};
constexpr std::array<std::array<double, 3>, 3> printed = {  // Table 2, Sim1B
    {{19.738, 193.93, 8.785}, {12.833, 100.61, 3.162}, {8.952, 93.67, 3.006}}};

/// What depends on t alone, at the half steps.
struct Known {
  double reference, acceleration, gain, disturbance;

  static const Known& at(double t) {
    static const std::vector<Known> all = [] {
      const auto y_d = paper1::reference(0.2);
      std::vector<Known> table;
      for (int i = 0; i <= 10021; ++i) {
        const double time = 0.5 * step * i;
        const auto r = y_d.derivatives<3>(time);
        table.push_back({r[0], r[2], 1.0 + 0.2 * std::tanh(time - 2.0),
                         time >= 3.5 ? 5.0 * std::sin(9.0 * time) : 0.0});
      }
      return table;
    }();
    return all[static_cast<std::size_t>(t * 2.0 / step + 0.5)];
  }
};

/// x = (x1, x2, xi of each level, the three integrals), driven by the noise.
template <class S, int Levels>
struct Loop {
  static constexpr int states = 2 + 3 * Levels + 3;
  template <class Other>
  using with_scalar = Loop<Other, Levels>;

  Vector<S, states> operator()(double t, const Vector<S, states>& x, const S& noise) const {
    using esokit::detail::absolute;
    const Known& known = Known::at(t);
    constexpr int last = 2 + 3 * (Levels - 1);
    S found(0.0);  // what the levels say of the disturbance
    for (int i = 0; i < Levels; ++i) found = found + x(2 + 3 * i + 2);
    const S u = found + S(4.0) * x(last) + S(4.0) * x(last + 1);  // ghat = 1
    const S e = S(known.reference) - x(0) + noise;

    Vector<S, states> rate;
    const S gain = S(known.gain) / (absolute(x(0)) + S(1.0));
    rate(0) = x(1);
    rate(1) = gain * (u + S(known.disturbance)) - x(0) - S(2.0) * x(1);
    S driven = -u;
    S seen = e;
    double w = paper1::table1[Levels - 1];
    for (int i = 0; i < Levels; ++i, w *= paper1::level_factor) {
      const int at = 2 + 3 * i;
      const S innovation = seen - x(at);
      rate(at) = x(at + 1) + S(3.0 * w) * innovation;
      rate(at + 1) = x(at + 2) + driven + S(3.0 * w * w) * innovation;
      rate(at + 2) = S(w * w * w) * innovation;
      driven = driven + x(at + 2);
      seen = x(at);
    }
    const S total = S(known.acceleration) - rate(1) + u;
    rate(states - 3) = S(1e3) * absolute(e);
    rate(states - 2) = u * u;
    rate(states - 1) = absolute(total - found);
    return rate;
  }
};

/// The output is nothing but its noise, ..
template <class S>
struct NoOutput {
  template <class Other>
  using with_scalar = NoOutput<Other>;
  template <class State>
  S operator()(double, const State&) const {
    return S(0.0);
  }
};

/// .. which goes on to the input.
template <class S = double>
struct HandedOn {
  using scalar_type = S;
  template <class Other>
  using with_scalar = HandedOn<Other>;
  S update(const S& noise, const S&) const { return noise; }
};

/// Of many seeds; the last sample is the end, 5 s, and what comes after it is not looked at.
template <int Levels>
sim::MonteCarloOutcome<double> many(std::int64_t runs, double deviation) {
  constexpr int states = Loop<double, Levels>::states;
  const auto measure = [](auto index) {
    constexpr int i = decltype(index)::value;
    return sim::final_value(criteria[i],
                            [](const auto& sample) { return sample.state(states - 3 + i); },
                            {.limit = printed[Levels - 1][i]});
  };
  return sim::monte_carlo(sim::nonlinear_plant<states>(Loop<double, Levels>{}, NoOutput<double>{}),
                          HandedOn<>{},
                          {.runs = runs,
                           .loop = {.duration = paper1::duration + T,
                                    .sample_time = T,
                                    .noise = deviation,
                                    .substeps = substeps}})
      .run(measure(std::integral_constant<int, 0>{}), measure(std::integral_constant<int, 1>{}),
           measure(std::integral_constant<int, 2>{}))
      .value();
}

/// How many seeds have so much, in 40 equal steps; per seed and unit.
struct Histogram {
  explicit Histogram(const sim::RunStatistics& of) {
    const double from = of.quantile(0.0005);
    const double to = of.quantile(0.9995);
    double below = share_below(of, from);
    for (int i = 0; i < 40; ++i) {
      const double edge = from + (to - from) * (i + 1) / 40;
      const double next = share_below(of, edge);
      x.push_back(edge - (to - from) / 80);
      y.push_back((next - below) * 40 / (to - from));
      below = next;
    }
  }
  static double share_below(const sim::RunStatistics& of, double value) {
    double low = 0;
    double high = 1;
    for (int i = 0; i < 40; ++i) {
      const double middle = (low + high) / 2;
      (of.quantile(middle) < value ? low : high) = middle;
    }
    return low;
  }
  std::vector<double> x, y;
};

/// A distance of 1, 2 or 5 times a power of ten that comes three to six times in a width.
double tick(double width) {
  const double power = std::pow(10.0, std::floor(std::log10(width / 3)));
  for (const double times : {5.0, 2.0}) {
    if (times * power <= width / 3) return times * power;
  }
  return power;
}

}  // namespace

int main(int argc, char** argv) {
  const std::int64_t runs = take_count(argc, argv, "--runs", 10000);
  Report report(
      argc, argv, "monte_carlo", "sim1b",
      {.paper_title = "Monte Carlo",
       .title = "Sim1B of paper 1 with very many seeds",
       .description = "The noisy simulation of paper 1 with very many seeds, in packs: how the "
                      "criteria of its Table 2 scatter, and where in this scatter the printed "
                      "numbers are, each of which is from a single run.",
       .order = 2});

  // The same ODE as the program of the paper: without noise, and by the mean over its seeds.
  const auto check_quiet = [&](int levels, const sim::MonteCarloOutcome<double>& quiet) {
    const auto theirs =
        paper1::run_generic(levels, paper1::table1[static_cast<std::size_t>(levels - 1)], 0.0, 0);
    const double numbers[] = {theirs.error, theirs.control, theirs.estimate};
    for (std::size_t i = 0; i < 3; ++i) {
      report.check_reference(
          "without noise, " + paper1::level_names[static_cast<std::size_t>(levels - 1)],
          criteria[i], numbers[i], quiet.numbers[i].mean(), 1e-3,
          "cascade_sim1, sums in place of integrals");
    }
  };
  check_quiet(1, many<1>(1, 0.0));
  check_quiet(2, many<2>(1, 0.0));
  check_quiet(3, many<3>(1, 0.0));

  const double noise = std::sqrt(paper1::noise_power / paper1::noise_hold);
  const std::array<sim::MonteCarloOutcome<double>, 3> all = {
      many<1>(runs, noise), many<2>(runs, noise), many<3>(runs, noise)};
  std::vector<CsvRow> rows;
  Figure figure("scatter", {.rows = 3, .columns = 3, .panel_height = 120});
  figure.caption("Sim1B with " + std::to_string(runs) +
                 " seeds: distribution of the criteria of Table 2 for p = 1, 2, 3. Dashed: the "
                 "printed numbers, each from a single run.");
  constexpr std::array colors = {Color::blue, Color::vermillion, Color::green};
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto& number = all[p].numbers[i];
      const double below = all[p].share_kept(i);
      rows.push_back({paper1::level_names[p] + ", " + criteria[i], shown_text(printed[p][i]),
                      shown_text(number.mean()), shown_text(number.deviation()),
                      shown_text(number.quantile(0.05)), shown_text(number.quantile(0.95)),
                      shown_text(number.smallest()), shown_text(number.largest()),
                      number_text(100 * below, 3)});
      const std::string name = "p = " + std::to_string(p + 1);
      report.expect(name, criteria[i], Measured(number.mean()), all[p].failed == 0,
                    "every seed gives a number");
      report.expect(name, std::string(criteria[i]) + ", % of seeds below the printed", 100 * below,
                    below > 0.005 && below < 0.995, "the printed number lies in the middle 99 %");
      const Histogram histogram(number);
      figure.panel(p, i)
          .x_label(p == 2 ? criteria[i] : "")
          .y_label(i == 0 ? name : "")
          .y_range({.from = 0.0})
          .x_tick(tick(histogram.x.back() - histogram.x.front()))
          .line(histogram.x, histogram.y, {.color = colors[p], .column = name})
          .vertical_line(printed[p][i]);
    }
  }
  report.table("scatter", "Sim1B, " + std::to_string(runs) + " seeds, and the printed numbers",
               {"criterion", "printed", "mean", "deviation", "5 %", "95 %", "least", "most",
                "seeds below the printed, %"},
               rows);
  report.add(figure);
  report.remark("On " + std::to_string(all[0].threads) + " threads, " +
                std::to_string(all[0].lanes) + " runs at once on each (" + sim::instruction_set +
                "). Neither changes a digit.");
  return report.finish();
}
