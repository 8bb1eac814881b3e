// A study in parts: what it costs to cut it, to send and to merge its records, and what would limit
// a thousand cores.
//
// Way: as monte_carlo; times are those of one thread's processor, so that other programs beside it
// do not count.
//
// symbol    code       value                  unit
// n         parts      1, 2, 4, 8, 16         parts of the study
//           runs       65,536                 runs, 16 blocks of 4096
// t_r       a_run      measured               s of a run
// t_s       start_up   measured               s until the first run: what tells the study from
// others t_m       a_merge    measured               s to read and join the record of a block

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <sstream>
#include <string>
#include <vector>

#include "common/report.hpp"
#include "monte_carlo/drives.hpp"

using namespace esokit;
using namespace esokit::examples;
using drives::chatter;
using drives::dip;
using drives::overshoot;
using drives::settling;

namespace {

double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Time of n equal machines: start, the largest part in whole blocks, all records read by one.
double on_paper(double runs, double parts, double start_up, double a_run, double a_merge) {
  const auto all = static_cast<std::int64_t>(runs);
  const auto blocks = static_cast<double>(sim::block_count(all));
  const double largest = std::ceil(blocks / parts) * static_cast<double>(sim::runs_in_block(all));
  return start_up + std::min(largest, runs) * a_run + blocks * a_merge;
}

}  // namespace

int main(int argc, char** argv) {
  const std::int64_t runs = take_count(argc, argv, "--runs", 65536);
  Report report(argc, argv, "monte_carlo", "parts",
                {.paper_title = "Monte Carlo",
                 .citation = "No paper. 100,000 runs: one design on random plants, and the noise "
                             "of a paper",
                 .title = "A study in parts",
                 .description = "The study of the drives, cut into parts for many processes or "
                                "machines and merged: every figure stays the same to the last bit. "
                                "What cutting and merging cost, and what limits many cores.",
                 .order = 3});
  const auto study = drives::study(runs, 1);
  const auto whole = study.run(overshoot, settling, dip, chatter).value();

  Curve largest_part, merging, ideal;
  double a_run = 0.0, start_up = 0.0, a_merge = 0.0;
  std::vector<CsvRow> rows;
  for (const std::int64_t parts : {1, 2, 4, 8, 16}) {
    std::vector<std::string> sent;
    double most = 0.0, least = 1e9, sum = 0.0;
    for (std::int64_t i = 0; i < parts; ++i) {
      sim::StudyRecords own;
      const double began = seconds();
      (void)study.identity(overshoot, settling, dip, chatter);
      start_up = seconds() - began;
      study.run_part(own, {i, parts}, overshoot, settling, dip, chatter).value();
      const double took = seconds() - began - start_up;
      most = std::max(most, took);
      least = std::min(least, took);
      sum += took;
      std::ostringstream text;
      own.write(text);
      sent.push_back(text.str());
    }
    const double began = seconds();
    sim::StudyRecords all(study.identity(overshoot, settling, dip, chatter).value());
    std::size_t bytes = 0;
    for (const std::string& text : sent) {
      std::istringstream in(text);
      all.add(sim::StudyRecords::read(in).value()).value();
      bytes += text.size();
    }
    const auto merged = study.outcome(all, overshoot, settling, dip, chatter).value();
    const double merge = seconds() - began;
    bool same = merged.runs == whole.runs && merged.failed == whole.failed;
    for (std::size_t k = 0; k < whole.numbers.size(); ++k) {
      same = same && merged.numbers[k] == whole.numbers[k];
    }
    report.expect("merged", "parts: " + std::to_string(parts), same ? 1.0 : 0.0, same,
                  "all figures equal those of one process to the last bit");
    if (parts == 1) a_run = sum / static_cast<double>(runs);
    a_merge = std::max(merge - 2.0 * start_up, 0.0) / static_cast<double>(sim::block_count(runs));
    largest_part.add(static_cast<double>(parts), most);
    merging.add(static_cast<double>(parts), merge);
    ideal.add(static_cast<double>(parts), largest_part.y[0] / static_cast<double>(parts));
    rows.push_back({std::to_string(parts), shown_text(most), shown_text(most / least),
                    shown_text(merge), shown_text(static_cast<double>(bytes) / 1e3)});
  }

  Figure figure("time", {.rows = 1, .columns = 2, .panel_height = 260});
  figure.caption(
      "Left: measured here, the time that the slowest part takes, and that of merging. Right: on "
      "paper from these numbers, for as many equal cores as parts. A study has at most 4096 "
      "blocks, so the curves have steps where a part is a few blocks; below that merging, which "
      "one process does, and the start of each process remain.");
  figure.panel(0, 0)
      .title("measured, " + std::to_string(runs) + " runs")
      .x_label("parts (-)")
      .y_label("time (s)")
      .log_x()
      .log_y()
      .legend(Legend::above)
      .line(largest_part.x, largest_part.y, {.name = "slowest part", .color = Color::blue})
      .line(ideal.x, ideal.y, {.name = "ideal", .color = Color::grey})
      .line(merging.x, merging.y, {.name = "merging", .color = Color::vermillion});
  auto& paper = figure.panel(0, 1)
                    .title("on paper")
                    .x_label("cores (-)")
                    .y_label("time (s)")
                    .log_x()
                    .log_y()
                    .legend(Legend::above);
  const std::vector<std::pair<double, Color>> studies = {
      {1e6, Color::green}, {1e8, Color::blue}, {1e9, Color::vermillion}};
  std::vector<CsvRow> limits;
  for (const auto& [size, color] : studies) {
    Curve curve;
    for (double cores = 1.0; cores <= 4096.0; cores *= 1.05) {
      curve.add(cores, on_paper(size, std::floor(cores), start_up, a_run, a_merge));
    }
    char name[40];
    std::snprintf(name, sizeof name, "10^%.0f runs", std::log10(size));
    paper.line(curve.x, curve.y, {.name = name, .color = color});
    const double one = on_paper(size, 1, start_up, a_run, a_merge);
    const double thousand = on_paper(size, 1000, start_up, a_run, a_merge);
    const auto blocks = static_cast<double>(sim::block_count(static_cast<std::int64_t>(size)));
    limits.push_back({name, shown_text(one), shown_text(thousand), shown_text(one / thousand),
                      shown_text(start_up), shown_text(blocks * a_merge),
                      shown_text(std::ceil(blocks / 1000) * 1000 / blocks)});
  }
  report.add(figure);
  report.table("measured", "Parts of " + std::to_string(runs) + " runs, as measured here",
               {"parts", "slowest part (s)", "slowest / fastest", "merging (s)", "records (kB)"},
               rows);
  report.table("limits", "What 1,000 equal cores would give, on paper",
               {"study", "one core (s)", "1,000 cores (s)", "times faster", "start (s)",
                "merging (s)", "largest part / equal part"},
               limits);
  report.remark(
      "Not in it: the start of the process by a scheduler (seconds on a cluster), the file system, "
      "and unequal machines: the study takes as long as the slowest one. Cut it into several times "
      "as many parts as machines, and let the scheduler hand them out.");
  return report.finish();
}
