// Logs of ordinary machines as people record them, identified, beside what made them.
//
// Way: sampled logs of 300 to 10,000 rows; the plant in between by 16 steps a row. Each log has its
// own seed. The order is given, as from_log takes it from the names of the columns.
//
// Plant   y^(n) + a y^(n-1) = b0 v(t - L) - friction + d,   tau v' + v = u, often a second lag
//         friction holds at standstill; d an ambient that drifts
// y       with noise, in steps of an encoder, speed from counts, filtered, late, with an offset,
//         with spikes
// u       steps, few steps, PRBS, sines, ramps; PI controller (n = 1) or PD (n = 2) on steps
//
// Not ordinary: commands beyond a saturating actuator, a square valve, a dead zone, y before u, y
// that has nothing to do with u, a reference that never moves, y an acceleration
//
// --count N: so many logs of each kind; --seed S: from this seed on. Every run has time for a few.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <esokit/identify/identify.hpp>

#include "common/compiled/study.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "identify/ordinary_log.hpp"

using namespace esokit::examples;
using namespace identify_example;

namespace {

struct Outcome {
  std::string refusal;  // empty: accepted
  double error = 0;     // of b0, share
  bool covered = false;
  bool wrong = false;   // of the other sign, or off by a factor of two
  bool warned = false;  // that b0 differs with u or at standstill, or that y is early
  esokit::CurveKind curve = esokit::CurveKind::straight;
  double size_error = 0;  // of the curve, share of the true one
};

Outcome identified(std::uint64_t seed, Habit habit) {
  const OrdinaryLog made = ordinary_log(seed, habit);
  esokit::Log log;
  log.u = made.u;
  log.y = made.y;
  log.sample_time = made.truth.sample_time;
  esokit::IdentifyOptions options;
  options.orders = {made.truth.order};
  const auto found = compiled::study(log, options);
  if (!found) return {.refusal = found.error().field};
  Outcome outcome;
  outcome.curve = found->curve.kind;
  outcome.size_error = std::abs(found->curve.size.value / made.curve_size - 1);
  if (const auto verdict = esokit::judge(*found, log, options); !verdict)
    outcome.refusal = verdict.error().field;
  const esokit::Estimate& b0 = found->input_gain;
  outcome.error = std::abs(b0.value / made.truth.input_gain - 1);
  outcome.covered = b0.low() <= made.most && b0.high() >= made.least;
  outcome.wrong = !(b0.value > 0.5 * made.least && b0.value < 2 * made.most);
  outcome.warned = found->by_size.differ() || found->in_motion.differ() || found->lead.time > 0;
  return outcome;
}

std::string percent(double share) { return number_text(100 * share, 3); }

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(take_count(argc, argv, "--count", 0));
  // Nothing was chosen on the seeds from here on: the method was tuned on those below 2000.
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 40000));
  Report report(
      argc, argv, "identify", "identify_ordinary",
      {.paper_title = "From a log to a model",
       .citation =
           "No paper. Order, b0, lag, dead time, friction and noise from logs, with intervals",
       .link = "",
       .title = "Ordinary machines",
       .description = "Logs of heaters, tanks, motors and servos as people record them are "
                      "identified, and the results are compared with the true plants. Fixed seeds.",
       .order = 3});
  struct Kind {
    const char* name;
    Habit habit;
    std::size_t few;
    double asked;  // share accepted; 0: nothing is asked
    bool machine;  // which b0 describes
    esokit::CurveKind curve = esokit::CurveKind::straight;
  };
  constexpr Kind kinds[] = {
      {"order 1, open loop", Habit::open, 8, 0.85, true},
      {"order 1, PI controller", Habit::pi, 8, 0.6, true},
      {"order 2, servo", Habit::servo, 6, 0.6, true},
      {"saturating actuator", Habit::saturating, 2, 0, true, esokit::CurveKind::saturation},
      {"square valve", Habit::square, 2, 0, true, esokit::CurveKind::square},
      {"dead zone", Habit::dead_zone, 2, 0, true, esokit::CurveKind::dead_zone},
      {"servo with a dead zone", Habit::dead_servo, 2, 0, true, esokit::CurveKind::dead_zone},
      {"y before u", Habit::early, 2, 0, false},
      {"y unrelated to u", Habit::unrelated, 2, 0, false},
      {"reference never moves", Habit::regulator, 2, 0, false},
      {"y an acceleration", Habit::acceleration, 2, 0, false}};
  std::vector<CsvRow> lines;
  for (const Kind& kind : kinds) {
    const std::size_t logs = count > 0 ? count : kind.few;
    const auto outcomes = run_parallel(
        kind.name, logs, [&](std::size_t i) { return identified(seed + i, kind.habit); });
    std::vector<double> errors;
    std::map<std::string, int> reasons;
    double accepted = 0, covered = 0, wrong = 0, warned = 0, named = 0, other = 0, near = 0;
    for (const Outcome& o : outcomes) {
      if (o.curve != esokit::CurveKind::straight) {
        named += 1;
        other += o.curve != kind.curve ? 1 : 0;
        near += o.size_error < 0.1 ? 1 : 0;
      }
      if (!o.refusal.empty()) {
        ++reasons[o.refusal];
        continue;
      }
      accepted += 1;
      covered += o.covered ? 1 : 0;
      wrong += o.wrong ? 1 : 0;
      warned += o.warned ? 1 : 0;
      errors.push_back(o.error);
    }
    std::sort(errors.begin(), errors.end());
    std::string why;
    for (const auto& [field, times] : reasons)
      why += (why.empty() ? "" : ", ") + field + " " + std::to_string(times);
    const double all = static_cast<double>(logs);
    lines.push_back({kind.name, std::to_string(logs), percent(accepted / all),
                     accepted > 0 && kind.machine ? percent(covered / accepted) : "",
                     errors.empty() || !kind.machine ? "" : percent(errors[errors.size() / 2]),
                     kind.machine ? number_text(wrong, 4) : "",
                     accepted > 0 ? percent(warned / accepted) : "", number_text(named, 4),
                     number_text(other, 4), number_text(near, 4), why});
    if (kind.asked > 0) {
      // With few logs a share is only known to two standard errors.
      const double slack = count > 0 ? 0.0 : 2 * std::sqrt(kind.asked * (1 - kind.asked) / all);
      report.expect(kind.name, "accepted (share)", accepted / all,
                    accepted / all >= kind.asked - slack,
                    "at least " + number_text(kind.asked, 2) +
                        (slack > 0 ? ", less two standard errors of so few logs" : ""));
      report.expect(kind.name, "accepted with b0 of the other sign or off by two", wrong,
                    wrong == 0, "none");
    }
  }
  report.table(
      "ordinary", "All logs, and why some were refused",
      {"logs", "count", "accepted (%)", "b0 in its 95 % interval (%)", "b0: median error (%)",
       "wrong by sign or a factor of two", "of the accepted, warned of (%)", "a curve is named",
       "of another kind", "its size within 10 %", "refused for"},
      lines);
  return report.finish();
}
