// How robust a design is: one controller at 100,000 drives that are not the one it was made for.
// Which of them violates what, the worst one drawn.
//
// Way: sampled, sampled controller; the plants exact between the samples.
//
// Plant       y'' + a y' = b v + d,  v' tau + v = u, y measured with noise
// Controller  Adrc<LinearEso<2>>, made for b = 50, without a lag
// Run         y from 0 to 1 rad, a load of -400 rad/s^2 (8 units of u at b = 50) from 0.5 s on
//
// symbol    code                  value                 unit
// b         input_gain            50 (20 .. 125)        rad/s^2 per unit of u; ratios all alike
// a         friction              3 (0 .. 12)           1/s
// tau       lag                   2 (0.5 .. 12)         ms
//           noise                 0.2 (0.1 .. 0.5)      mrad
// T         T                     1                     ms
// omega_o   observer_bandwidth    150                   rad/s
// omega_c   controller_bandwidth  20                    rad/s
//           limits                -60 .. 60             units of u

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "common/report.hpp"
#include "monte_carlo/drives.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace drives;

namespace {

constexpr std::size_t numbers = 4;
constexpr std::array<const char*, numbers> wishes = {
    "overshoot above 0.05 rad", "not within 2 % by 0.45 s", "dips by more than 0.35 rad",
    "u moves by more than 1.5 at rest"};
constexpr std::array<Color, numbers> colors = {Color::vermillion, Color::purple, Color::blue,
                                               Color::green};

/// A run of each kind for the picture.
struct Seen {
  Curve kept;
  std::array<Curve, numbers> violates;
  Curve few_kept, only_dip, restless;
  std::int64_t dips = 0;  ///< deepest of those that do not overshoot
  double depth = 0.0;
};

}  // namespace

int main(int argc, char** argv) {
  const std::int64_t runs = take_count(argc, argv, "--runs", 100000);
  Report report(
      argc, argv, "monte_carlo", "drive",
      {.paper_title = "Monte Carlo",
       .citation = "No paper. 100,000 runs: one design on random plants, and the noise of a paper",
       .title = "One design on 100,000 random drives",
       .description = "One controller, designed for one drive, controls drives with another "
                      "inertia, friction, lag and noise: how many meet the requirements, which do "
                      "not, and the worst run.",
       .order = 1});

  // All numbers go into the statistics; the picture takes what the first runs violate.
  auto settings = config(runs);
  constexpr std::int64_t drawn = 4000, few = 1000;
  Seen seen;
  std::array<std::int64_t, numbers + 1> violated{};  // so many of the limits at once
  const std::array limits = {overshoot.options.limit, settling.options.limit, dip.options.limit,
                             chatter.options.limit};
  settings.on_run = [&](std::int64_t run, std::span<const double> number) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < numbers; ++i) count += number[i] <= limits[i] ? 0u : 1u;
    ++violated[count];
    if (number[0] <= limits[0] && number[2] > seen.depth) {
      seen.depth = number[2];
      seen.dips = run;
    }
    if (run >= drawn) return;
    sim::Draw draw(settings.loop.seed, run);
    const Machine machine(draw);
    if (count == 0) seen.kept.add(machine.gain, 1e3 * machine.lag);
    for (std::size_t i = 0; i < numbers; ++i) {
      if (!(number[i] <= limits[i])) seen.violates[i].add(machine.gain, 1e3 * machine.lag);
    }
    if (run >= few) return;
    Curve& group = count == 0                                ? seen.few_kept
                   : count == 1 && !(number[2] <= limits[2]) ? seen.only_dip
                                                             : seen.restless;
    group.add(machine.gain, 1e3 * machine.lag);
  };
  const auto study = sim::monte_carlo(drive(input_gain, 3, 2e-3), controller(), settings, vary);
  const auto outcome = study.run(overshoot, settling, dip, chatter).value();

  std::vector<CsvRow> rows;
  for (std::size_t i = 0; i < numbers; ++i) {
    const auto& number = outcome.numbers[i];
    const double kept = 100 * outcome.share_kept(i);
    rows.push_back({number.name(), shown_text(number.limit()), number_text(kept, 4),
                    shown_text(number.mean()), shown_text(number.deviation()),
                    shown_text(number.quantile(0.5)), shown_text(number.quantile(0.95)),
                    shown_text(number.quantile(0.999)), shown_text(number.largest()),
                    std::to_string(number.run_of_largest())});
    report.check("random drives", number.name() + ", share that keeps its limit (%)", std::nullopt,
                 kept);
    const auto worst = study.replay(number.run_of_largest()).value();
    double again = 0;
    for (std::size_t k = 0; k < worst.t.size(); ++k) {
      if (i == 0 && worst.t[k] < 0.5005) again = std::max(again, worst.output[k] - 1);
      if (i == 2 && worst.t[k] > 0.4995) again = std::max(again, 1 - worst.output[k]);
    }
    if (i == 0 || i == 2) {
      report.expect("random drives", number.name() + ", the worst run again", again,
                    again == number.largest(), "the same number as in the study, to the bit");
    }
  }
  report.check("random drives", "all four kept (%)", std::nullopt,
               100.0 * static_cast<double>(violated[0]) / static_cast<double>(runs));
  report.expect("random drives", "runs that fail", static_cast<double>(outcome.failed),
                outcome.failed == 0, "none");

  Figure figure("drives", {.rows = 2, .columns = 2, .panel_height = 230});
  figure.caption("Of the first " + std::to_string(drawn) +
                 " drives, those that violate each of the four requirements, over their gain and "
                 "their lag; grey: drives that meet all of them. The cross is the drive for which "
                 "the controller was designed. Friction and noise differ, too.");
  for (std::size_t i = 0; i < numbers; ++i) {
    figure.panel(i / 2, i % 2)
        .title(wishes[i])
        .x_label("b (rad/s^2)")
        .y_label("lag (ms)")
        .x_range(20, 125)
        .y_range(0, 12)
        .points(seen.kept.x, seen.kept.y, {.color = Color::grey, .size = 0.3, .opacity = 0.5})
        .points(seen.violates[i].x, seen.violates[i].y,
                {.color = colors[i], .size = 0.4, .opacity = 0.8})
        .points(Column{input_gain}, Column{2.0},
                {.color = Color::black, .marker = Marker::cross, .size = 2});
  }
  report.add(figure);

  // For the README: the first few, in one panel.
  Figure which("which", {.rows = 1, .columns = 1, .panel_height = 240});
  which.caption("The first " + std::to_string(few) +
                " drives by gain and lag. The cross is the drive that the design was made for.");
  which.panel(0, 0)
      .x_label("gain b of the drive (rad/s^2)")
      .y_label("lag (ms)")
      .x_range(20, 125)
      .y_range(0, 12)
      .legend(Legend::above)
      .name("drives")
      .points(seen.few_kept.x, seen.few_kept.y,
              {.name = "keep all four limits", .color = Color::grey, .size = 0.6})
      .points(seen.only_dip.x, seen.only_dip.y,
              {.name = "dip too far under the load", .color = Color::blue, .size = 0.8})
      .points(seen.restless.x, seen.restless.y,
              {.name = "overshoot or do not settle", .color = Color::vermillion, .size = 0.8})
      .points(Column{input_gain}, Column{2.0},
              {.color = Color::black, .marker = Marker::cross, .size = 2});
  report.add(which);

  Figure worst("worst", {.rows = 2, .columns = 1, .panel_height = 200});
  worst.caption(
      "Forty of the drives (grey), the drive of the design without noise (black), the run with the "
      "largest overshoot (the observer takes the effect of the lag for a load), and the run that "
      "the load moves most among those without overshoot.");
  auto& position = worst.panel(0, 0).y_label("y (rad)").legend(Legend::above).name("position");
  auto& input = worst.panel(1, 0).x_label("t (s)").y_label("u (-)").name("input");
  const auto add = [&](const auto& run, const Style& style) {
    position.line(run.t, run.output, style);
    Style bare = style;
    bare.name.clear();
    input.line(run.t, run.input, bare);
  };
  for (std::int64_t run = 0; run < 40; ++run) {
    add(study.replay(run).value(),
        {.name = run == 0 ? "drives" : "", .color = Color::grey, .width = 0.6, .opacity = 0.5});
  }
  add(study.replay(outcome.numbers[0].run_of_largest()).value(),
      {.name = "largest overshoot", .color = colors[0]});
  add(study.replay(seen.dips).value(),
      {.name = "deepest dip without overshoot", .color = colors[2]});
  add(sim::run(drive(input_gain, 3, 2e-3), controller(), config(1).loop).value(),
      {.name = "the drive of the design", .color = Color::black});
  position.horizontal_line(1 + overshoot.options.limit);
  report.add(worst);

  report.table("numbers", "The four numbers of " + std::to_string(runs) + " drives",
               {"number", "limit", "keep it, %", "mean", "deviation", "median", "95 %", "99.9 %",
                "worst", "run of the worst"},
               rows);
  std::vector<CsvRow> machines;
  for (const std::size_t i : {0u, 1u, 2u, 3u}) {
    sim::Draw draw(settings.loop.seed, outcome.numbers[i].run_of_largest());
    const Machine machine(draw);
    machines.push_back({outcome.numbers[i].name(), shown_text(machine.gain),
                        shown_text(machine.friction), shown_text(1e3 * machine.lag),
                        shown_text(1e3 * machine.noise)});
  }
  report.table("worst", "Which drives are the worst",
               {"number", "b (rad/s^2)", "a (1/s)", "lag (ms)", "noise (mrad)"}, machines);
  report.remark("On " + std::to_string(outcome.threads) + " threads, " +
                std::to_string(outcome.lanes) + " runs at once on each (" + sim::instruction_set +
                "). Neither changes a digit.");
  return report.finish();
}
