// Logs of random plants, identified, tuned, and the chosen controller on the plant that made the
// log: do the margins hold there?
//
// Way: sampled logs (identify/random_plant.hpp); the loop of the true plant and the chosen
// controller exactly, without its friction.
//
// symbol   code                   value
// u range  u_min, u_max           the largest abs(u) of the log, both ways
// asked    -                      noise in u: 5 % of that range
// margins  TuneRules              modulus 0.5, delay 2 samples, b0 wrong by 2
//
// --logs N: so many logs; the page shows the few that every run has time for.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/tune/tune.hpp>

#include "common/compiled/study.hpp"
#include "common/compiled/tune.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "identify/random_plant.hpp"

using namespace esokit::examples;
using namespace identify_example;

namespace {

struct Outcome {
  bool accepted = false;  // by identify
  bool chosen = false;    // by tune
  bool right_order = false;
  bool modulus = false, delay = false, gain = false;  // margins that hold
  double modulus_margin = 0;
  double excess = 0;

  [[nodiscard]] bool holds() const { return modulus && delay && gain; }
};

Outcome tuned(std::uint64_t seed) {
  const RandomLog made = random_log(seed);
  const Truth& truth = made.truth;
  esokit::Log log;
  log.u = made.u;
  log.y = made.y;
  log.sample_time = truth.sample_time;
  Outcome outcome;
  const auto found = compiled::identify(log);
  if (!found) return outcome;
  outcome.accepted = true;
  outcome.right_order = found->order == truth.order;
  double largest = 0;
  for (const double u : made.u) largest = std::max(largest, std::abs(u));
  const auto model = esokit::tune_model(*found, -largest, largest);
  const auto tuning = compiled::tune(model);
  if (!tuning || tuning->chosen() == nullptr) return outcome;
  outcome.chosen = true;
  const esokit::TunedDesign& design = *tuning->chosen();
  outcome.excess = design.excess;
  esokit::TuneModel plant = model;
  plant.order = truth.order;
  plant.input_gain = {truth.input_gain, 0.0};
  plant.pole = truth.pole;
  plant.lag = truth.lag;
  plant.dead_time = truth.dead_time;
  const auto loop = closed_loop(plant, design.controller);
  if (!loop || !loop->stable()) return outcome;
  const esokit::TuneRules rules;
  outcome.modulus_margin = margins(*loop)->modulus.value;
  outcome.modulus = outcome.modulus_margin >= rules.modulus_margin;
  outcome.delay = delay_margin(*loop)->value >= rules.delay_samples * truth.sample_time;
  outcome.gain = true;
  for (const double factor : {rules.gain_factor, 1.0 / rules.gain_factor}) {
    const auto wrong = closed_loop(plant, design.controller, factor);
    outcome.gain = outcome.gain && wrong && wrong->stable();
  }
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  const auto logs = static_cast<std::size_t>(take_count(argc, argv, "--logs", 0));
  Report report(
      argc, argv, "choosing", "random",
      {.paper_title = "Choosing an observer",
       .citation = "Our own numbers; the observers are those of the papers",
       .link = "",
       .title = "From a log to margins on the true plant",
       .description = "Random plants: a log of each is identified, a controller is chosen for the "
                      "model, and its margins are computed with the true plant."});
  const auto outcomes = run_parallel("random plants", logs > 0 ? logs : 16,
                                     [](std::size_t i) { return tuned(9000 + i); });
  double accepted = 0, chosen = 0, holds = 0, modulus = 0, delay = 0, gain = 0, order = 0;
  std::vector<double> least;
  for (const Outcome& o : outcomes) {
    accepted += o.accepted ? 1 : 0;
    if (!o.chosen) continue;
    ++chosen;
    order += o.right_order ? 1 : 0;
    holds += o.holds() ? 1 : 0;
    modulus += o.modulus ? 1 : 0;
    delay += o.delay ? 1 : 0;
    gain += o.gain ? 1 : 0;
    least.push_back(o.modulus_margin);
  }
  std::sort(least.begin(), least.end());
  const double of = std::max(chosen, 1.0);
  // Of few logs one may be the one in a hundred.
  report.expect("random plants", "all margins hold on the true plant (share)", holds / of,
                holds >= std::min(0.99 * of, of - 1), "0.99, or all but one");
  report.expect("random plants", "a design that keeps its margins (share of accepted logs)",
                chosen / std::max(accepted, 1.0), chosen == accepted, "all");
  report.table("random", "What holds on the true plants",
               {"logs", "count", "accepted", "order right", "all hold", "modulus", "delay",
                "b0 wrong by 2", "least modulus margin", "5th percentile", "median"},
               {{"random plants", std::to_string(outcomes.size()), number_text(accepted, 4),
                 number_text(order, 4), number_text(holds, 4), number_text(modulus, 4),
                 number_text(delay, 4), number_text(gain, 4),
                 number_text(least.empty() ? 0 : least.front(), 3),
                 number_text(least.empty() ? 0 : least[least.size() / 20], 3),
                 number_text(least.empty() ? 0 : least[least.size() / 2], 3)}});
  return report.finish();
}
