// Which observer: every family at its best for one specification after another, beside the least
// that any linear controller can do. The ranking is that of `tune`; this is its picture without
// units.
//
// Way: exact (the loop at the samples, under noise and a disturbance that walks; tune/tune.hpp).
//
// Plant   y^(n) = b0 v + d,   tau v' + v = u,   d a random walk, in one case with a slow sine
//
// symbol    code            value            unit
// n         order           1, 2             -
// T         sample_time     0.001            s
// w_k       -               30               rad/s, bandwidth of the Kalman filter
// w_r       -               w_k / 8 .. 2 w_k rad/s, bandwidth of the LQG law: rho = w_r^(-2n)
// tau       lag             0.01             s, in one case
//           sinusoids       5                rad/s, amplitude 3 q^(1/2), in one case
//
// w_k = (q / (R T))^(1 / (2 (n + 1)))

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <esokit/analysis/frequency_response.hpp>
#include <esokit/tune/tune.hpp>

#include "common/compiled/tune.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr double filter_bandwidth = 30.0;
constexpr int wishes = 7;

struct Case {
  std::string name;
  TuneModel model;
};

TuneModel plain(int order) {
  TuneModel model;
  model.order = order;
  model.input_gain = {1.0, 0.0};
  model.noise = 1e-3;
  model.sample_time = 1e-3;
  model.disturbance =
      model.noise * model.noise * model.sample_time * std::pow(filter_bandwidth, 2 * (order + 1));
  model.u_min = -1e3;
  model.u_max = 1e3;
  return model;
}

std::vector<Case> cases() {
  std::vector<Case> all{{"n = 1", plain(1)}, {"n = 2", plain(2)}};
  all.push_back({"n = 2, lag", plain(2)});
  all.back().model.lag = 0.01;
  all.push_back({"n = 2, slow sine", plain(2)});
  TuneModel& swinging = all.back().model;
  swinging.sinusoids = {{5.0, 3.0 * std::sqrt(swinging.disturbance), 0.0}};
  return all;
}

/// Noise in u of the LQG whose law has this bandwidth: the specification that leads to it.
double wish_of(const TuneModel& model, double bandwidth) {
  TuneModel walking = model;
  walking.sinusoids.clear();
  const LoopCost cost(walking, {}, 0.1 * bandwidth);
  return cost(Lqg(model).controller(std::pow(bandwidth, -2 * model.order))).control_noise;
}

/// What is drawn; the rest is in the table.
const std::map<std::string, Style>& styles() {
  static const std::map<std::string, Style> all = {
      {"LinearEso", {.name = "LESO", .color = Color::blue, .width = 1.8}},
      {"HalfGainEso", {.name = "half gain", .color = Color::orange, .width = 1.8}},
      {"LinearEso, m = 2", {.name = "LESO, m = 2", .color = Color::sky, .width = 1.8}},
      {"CascadeEso, p = 2", {.name = "cascade p = 2", .color = Color::vermillion, .width = 1.8}},
      {"CascadeEso, p = 3", {.name = "cascade p = 3", .color = Color::green, .width = 1.8}},
      {"frozen filter, LQR gains", {.name = "filter, LQR", .color = Color::purple, .width = 1.8}},
      {"LinearEso, free poles", {.name = "free poles", .color = Color::black, .width = 1.8}},
      {"LinearEso that knows the lag",
       {.name = "LESO, knows it", .color = Color::blue, .dash = Dash::dashed, .width = 1.8}},
      {"LinearEso that knows the sine",
       {.name = "LESO, knows it", .color = Color::blue, .dash = Dash::dashed, .width = 1.8}},
      {"LinearEso, free poles, that knows the lag",
       {.name = "free, knows it", .color = Color::black, .dash = Dash::dashed, .width = 1.8}}};
  return all;
}

std::string number_or_dash(bool there, double value) { return there ? number_text(value, 3) : "-"; }

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "choosing", "tradeoff",
                {.paper_title = "Choosing an observer",
                 .citation = "Our own numbers; the observers are those of the papers",
                 .link = "",
                 .title = "Every observer family at its best, for several requirements",
                 .description = "The ranking by tune/, over the noise that u may have: each family "
                                "with its margins, compared with the best linear controller."});

  const auto all = cases();
  const auto bandwidths = log_grid<wishes>(filter_bandwidth / 8.0, 2.0 * filter_bandwidth).value();
  const auto tunings = run_parallel("tune", all.size() * wishes, [&](std::size_t i) {
    const TuneModel& model = all[i / wishes].model;
    const double wish = wish_of(model, bandwidths[i % wishes]);
    return compiled::tune(model, {.control_noise = wish}, {.filter_floor = 0.0}).value();
  });

  Figure figure("tradeoff", {.rows = 2, .columns = 2, .panel_height = 260});
  figure.caption(
      "A point is the best design of a family for one requirement; a curve ends where it cannot "
      "keep the margins. Across: the requirement, as the bandwidth of the law over that of the "
      "filter in the best linear controller (left: little noise in u). Up: sqrt(J / J*), 1 for "
      "that controller, which keeps no margins; 1.1 means deviations 10 % larger. Lower left: it "
      "pays to have the lag in the model; lower right: a slow, smooth disturbance.");
  for (std::size_t c = 0; c < all.size(); ++c) {
    Panel& panel = figure.panel(c / 2, c % 2).title(all[c].name);
    panel.name("case" + std::to_string(c + 1))
        .log_x()
        .x_range(0.1, 2.5)
        .x_label("bandwidth of the law / of the filter")
        .y_label("root of J / J*")
        // From a little below 1, where the best of n = 1 run: not along the frame.
        .y_range(c == 0   ? Range{0.996, 1.08}
                 : c == 1 ? Range{0.98, 1.5}
                 : c == 2 ? Range{0.9, 3.0}
                          : Range{0.7, 6.5})
        .legend(Legend::above);
    for (const auto& [name, style] : styles()) {
      std::vector<double> x, y;
      for (std::size_t w = 0; w < wishes; ++w) {
        for (const TunedDesign& design : tunings[c * wishes + w].designs) {
          if (design.name != name || !design.feasible) continue;
          x.push_back(bandwidths[w] / filter_bandwidth);
          y.push_back(design.excess);
        }
      }
      if (!x.empty()) panel.line(x, y, style);
    }
  }
  report.add(figure);

  // The ranking at one specification, as `tune` gives it.
  constexpr std::size_t middle = 4;
  for (std::size_t c = 0; c < all.size(); ++c) {
    const Tuning& tuning = tunings[c * wishes + middle];
    std::vector<CsvRow> lines;
    for (const TunedDesign& d : tuning.designs) {
      const bool known = d.feasible;
      lines.push_back({d.name, number_or_dash(known, d.excess), number_text(d.free_excess, 3),
                       number_or_dash(known, 1e3 * d.output_deviation),
                       number_or_dash(known, d.control_noise / tuning.control_noise),
                       number_or_dash(known, d.settling_time), number_text(d.modulus_margin, 3),
                       std::to_string(d.operations), d.constraint});
    }
    report.table("ranking" + std::to_string(c + 1),
                 all[c].name + ": the ranking for the requirement with a control law " +
                     number_text(bandwidths[middle] / filter_bandwidth, 3) +
                     " times as fast as the filter",
                 {"family", "sqrt(J / J*)", "the same without margins", "sd of y (1e-3)",
                  "noise in u / noise allowed", "settling time (s)", "modulus margin",
                  "operations per update", "limited by"},
                 lines);
  }

  for (std::size_t c = 0; c < all.size(); ++c) {
    for (std::size_t w = 0; w < wishes; ++w) {
      const Tuning& tuning = tunings[c * wishes + w];
      const std::string name =
          all[c].name + ", " + number_text(bandwidths[w] / filter_bandwidth, 3);
      double least = 1e300;
      for (const TunedDesign& d : tuning.designs) least = std::min(least, d.excess);
      report.expect(name, "smallest of all families (root of J / J*)", least, least > 0.999,
                    "none is better than the LQG");
    }
  }
  return report.finish();
}
