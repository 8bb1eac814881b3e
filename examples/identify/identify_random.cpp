// Logs of random plants in a closed loop, identified, beside what made them.
//
// Way: sampled logs; the plant in between by steps of 0.1 ms. Each log has its own seed.
//
// Plant   y^(n) + a y^(n-1) = b0 v(t - L) - friction tanh(speed / v_s) + d,   tau v' + v = u
//         d a random walk; y with white noise or from an encoder
// Loop    u = P or PD of (r - y), r steps or six sines; 15 s
// Joint   y'' = b0 v - a y' - g sin(y + turned) - friction tanh(y' / v_s) under ADRC, one to three
//         sines or steps, 12 s: gravity, which is not in the model
//
// symbol        code          value               unit
// n             order         1 or 2
// b0            input_gain    0.1 .. 1000         unit of y^(n) per unit of u
// tau           lag           2 .. 40             ms
// L             dead_time     0 .. 10             ms
// a             pole          0, or up to 20      1/s, with a (tau + L) below 0.4
// friction, d                 0 .. 0.5            of the rms of b0 u
// T             sample_time   1 .. 4              ms
//
// Jittery: from an encoder, rows of 0.9 to 1.1 T with their stamps, 3 % of them missing
//
// --logs N: so many logs of each kind, --seed S: from this seed on; the page shows the few that
// every run has time for.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include <esokit/identify/identify.hpp>

#include "common/compiled/study.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "identify/random_plant.hpp"

using namespace esokit::examples;
using namespace identify_example;

namespace {

struct Outcome {
  Truth truth;
  bool accepted = false;
  std::string refusal;
  int order = 0;
  double error = 0;       // of b0, share
  double half_width = 0;  // share of the true b0
  double latency = 0;     // error, s
  double noise = 0;       // found over true
  Curve plateau = {};     // b0 over the bandwidth at which it is fitted
  std::vector<double> low = {}, high = {};
};

Outcome identified(std::uint64_t seed, Kind kind) {
  const RandomLog made = kind == Kind::joint ? random_joint(seed) : random_log(seed, kind);
  esokit::Log log;
  log.u = made.u;
  log.y = made.y;
  log.time = made.time;
  if (log.time.empty()) log.sample_time = made.truth.sample_time;
  Outcome outcome;
  outcome.truth = made.truth;
  const auto found = compiled::study(log);
  if (!found) {
    outcome.refusal = found.error().field;
    return outcome;
  }
  const auto verdict = esokit::judge(*found, log);
  outcome.accepted = verdict.has_value();
  if (!verdict) outcome.refusal = verdict.error().field;
  outcome.order = found->order;
  outcome.error = found->input_gain.value / made.truth.input_gain - 1;
  outcome.half_width = found->input_gain.half_width / made.truth.input_gain;
  outcome.latency = found->latency.value - made.truth.lag - made.truth.dead_time;
  outcome.noise = found->noise.value / made.truth.noise;
  for (const auto& point : found->plateau.points) {
    const double value = point.fit.linear[0] / made.truth.input_gain;
    const double error = 2 * point.errors.linear[0] / made.truth.input_gain;
    if (!(error < 1)) continue;
    outcome.plateau.add(point.fit.at.bandwidth, value);
    outcome.low.push_back(value - error);
    outcome.high.push_back(value + error);
  }
  return outcome;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

struct Summary {
  double accepted = 0, median = 0, p95 = 0, cover = 0, latency = 0, noise = 0, order = 0;
  double wrongly_refused = 0, wrongly_accepted = 0;
  double outside = 0;                        // accepted with b0 beyond 1.5 half widths
  double narrow_median = 0, narrow_p95 = 0;  // of b0, intervals up to 10 %
};

Summary summarise(const std::vector<Outcome>& outcomes) {
  Summary summary;
  std::vector<double> errors, latencies, narrow;
  double covered = 0, quiet = 0;
  const auto all = static_cast<double>(outcomes.size());
  for (const Outcome& o : outcomes) {
    const bool right = o.order == o.truth.order && std::abs(o.error) < 0.1;
    summary.order += (o.order == o.truth.order ? 1 : 0) / all;
    if (!o.accepted) {
      summary.wrongly_refused += (right ? 1 : 0) / all;
      continue;
    }
    summary.wrongly_accepted += (right ? 0 : 1) / all;
    errors.push_back(std::abs(o.error));
    if (o.half_width <= 0.1 * std::abs(1 + o.error)) narrow.push_back(std::abs(o.error));
    latencies.push_back(std::abs(o.latency));
    covered += std::abs(o.error) <= o.half_width ? 1 : 0;
    summary.outside += (std::abs(o.error) <= 1.5 * o.half_width ? 0 : 1) / all;
    quiet += std::abs(o.noise - 1) <= 0.05 ? 1 : 0;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(errors.size(), 1));
  summary.accepted = static_cast<double>(errors.size()) / all;
  summary.median = quantile(errors, 0.5);
  summary.p95 = quantile(errors, 0.95);
  summary.narrow_median = quantile(narrow, 0.5);
  summary.narrow_p95 = quantile(narrow, 0.95);
  summary.cover = covered / count;
  summary.noise = quiet / count;
  summary.latency = quantile(latencies, 0.5);
  return summary;
}

std::string percent(double share) { return number_text(100 * share, 3); }

}  // namespace

int main(int argc, char** argv) {
  const auto logs = static_cast<std::size_t>(take_count(argc, argv, "--logs", 0));
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 3000));
  Report report(
      argc, argv, "identify", "identify_random",
      {.paper_title = "From a log to a model",
       .citation =
           "No paper. Order, b0, lag, dead time, friction and noise from logs, with intervals",
       .link = "",
       .title = "Random plants",
       .description = "Logs of random plants in a closed loop are identified, and the results are "
                      "compared with the true plants. Fixed seeds.",
       .order = 1});
  const auto many = [&](const char* label, Kind kind, std::size_t count, std::uint64_t first) {
    return run_parallel(label, logs > 0 ? logs : count,
                        [=](std::size_t i) { return identified(first + i, kind); });
  };
  // Seeds on which nothing was chosen: the method was tuned on those below 2000.
  const auto plain = many("random plants", Kind::plain, 60, seed);
  const auto flexible = many("with a flexible mode", Kind::flexible, 12, seed + 10000);
  const auto joints = many("joints under gravity", Kind::joint, 12, seed + 30000);
  const auto still = many("without excitation", Kind::unexcited, 12, seed + 20000);
  const auto jittery = many("jitter, encoder, missing rows", Kind::jittery, 8, seed + 40000);
  const Summary found = summarise(plain), bending = summarise(flexible),
                hanging = summarise(joints), stamped = summarise(jittery);

  // With few logs a share is only known to two standard errors.
  const auto share = [&](const char* name, double asked, double ours, std::size_t of,
                         const char* kind = "random plants") {
    const double slack =
        logs > 0 ? 0.0 : 2 * std::sqrt(asked * (1 - asked) / static_cast<double>(of));
    report.expect(kind, name, ours, ours >= asked - slack,
                  "at least " + number_text(asked, 3) +
                      (slack > 0 ? ", less two standard errors of so few logs" : ""));
  };
  share("share accepted", 0.8, found.accepted, plain.size());
  report.expect("random plants", "b0: median error (share)", found.median, found.median <= 0.02,
                "at most 0.02");
  report.expect("random plants", "b0: 95th percentile of the error (share)", found.p95,
                found.p95 <= 0.1, "at most 0.1");
  share("b0 within its 95 % interval (share)", 0.9, found.cover, plain.size());
  report.expect("random plants", "lag and dead time: median error (ms)", 1e3 * found.latency,
                found.latency <= 1e-3, "at most 1");
  share("noise within 5 % (share)", 0.95, found.noise, plain.size());
  share("order right (share)", 0.98, found.order, plain.size());
  share("share accepted", 0.8, stamped.accepted, jittery.size(), "jitter, encoder, missing rows");
  const auto refused =
      std::count_if(still.begin(), still.end(), [](const Outcome& o) { return !o.accepted; });
  report.expect("without excitation", "refused (share)",
                static_cast<double>(refused) / static_cast<double>(still.size()),
                static_cast<std::size_t>(refused) == still.size(), "all");
  report.check("with a flexible mode", "b0 within its 95 % interval (share of the accepted)",
               std::nullopt, bending.cover);
  report.check("with a flexible mode", "share accepted", std::nullopt, bending.accepted);

  const double few =
      logs > 0 ? 0.0 : 2 * std::sqrt(0.03 * 0.97 / static_cast<double>(joints.size()));
  report.expect("joints under gravity", "accepted with b0 beyond 1.5 half widths (share)",
                hanging.outside, hanging.outside <= 0.03 + few,
                few > 0 ? "at most 0.03, and two standard errors of so few logs" : "at most 0.03");
  report.check("joints under gravity", "b0 within its 95 % interval (share of the accepted)",
               std::nullopt, hanging.cover);
  report.check("joints under gravity", "share accepted", std::nullopt, hanging.accepted);

  std::vector<CsvRow> lines;
  const auto line = [&](const char* name, const Summary& s, std::size_t count) {
    const auto of_accepted = [&](const std::string& text) {
      return s.accepted > 0 ? text : std::string();
    };
    lines.push_back({name, std::to_string(count), percent(s.accepted),
                     of_accepted(percent(s.median)), of_accepted(percent(s.p95)),
                     of_accepted(percent(s.narrow_median)), of_accepted(percent(s.narrow_p95)),
                     of_accepted(percent(s.cover)), of_accepted(number_text(1e3 * s.latency, 3)),
                     of_accepted(percent(s.noise)), percent(s.order), percent(s.wrongly_refused),
                     percent(s.wrongly_accepted)});
  };
  line("random plants", found, plain.size());
  line("with a flexible mode", bending, flexible.size());
  line("joints under gravity", hanging, joints.size());
  line("without excitation", summarise(still), still.size());
  line("jitter, encoder, missing rows", stamped, jittery.size());
  report.table(
      "random",
      "All logs, and the errors of those that were accepted. Wrongly refused: although the order "
      "is right and b0 within 10 %; wrongly accepted: although they are not",
      {"logs", "count", "accepted (%)", "b0: median error (%)", "95th percentile (%)",
       "median, intervals up to 10 % (%)", "95th percentile of these (%)",
       "in its 95 % interval (%)", "lag and dead time: median error (ms)", "noise within 5 % (%)",
       "order right (%)", "wrongly refused (%)", "wrongly accepted (%)"},
      lines);
  std::map<std::string, int> reasons;
  for (const Outcome& o : plain) {
    if (!o.accepted) ++reasons[o.refusal];
  }
  lines.clear();
  for (const auto& [name, count] : reasons) lines.push_back({name, std::to_string(count)});
  if (!lines.empty())
    report.table("refusals", "Why logs of random plants were refused", {"field", "logs"}, lines);

  std::vector<double> half, error;
  for (const Outcome& o : plain) {
    if (!o.accepted || o.order != o.truth.order) continue;
    half.push_back(100 * o.half_width);
    error.push_back(100 * std::abs(o.error));
  }
  Figure figure("errors", {.rows = 1, .columns = 1, .panel_height = 260});
  figure.caption(
      "Each accepted log: error of b0 divided by the half width of its 95 % interval. Below the "
      "line, the true b0 is within the interval.");
  figure.panel(0, 0)
      .log_x()
      .log_y()
      .x_label("half width (% of b0)")
      .y_label("error (% of b0)")
      .x_range(0.05, 20)
      .y_range(0.001, 20)
      .legend(Legend::above)
      .name("errors")
      .points(half, error, {.name = "log", .color = Color::blue})
      .line({0.05, 20}, {0.05, 20}, {.name = "edge of the interval", .color = Color::grey});
  report.add(figure);

  // For the README: the first of each that was neither averaged away nor refused for nothing.
  const auto accepted = std::find_if(plain.begin(), plain.end(), [](const Outcome& o) {
    return o.accepted && o.order == 2 && o.truth.order == 2;
  });
  const auto hidden = std::find_if(flexible.begin(), flexible.end(), [](const Outcome& o) {
    return !o.accepted && !o.plateau.x.empty();
  });
  if (accepted != plain.end() && hidden != flexible.end()) {
    Figure plateau("plateau", {.rows = 1, .columns = 2, .panel_height = 190});
    plateau.caption(
        "b0 over the bandwidth at which it is fitted, with two standard errors, as a share of the "
        "true b0. Left: the first accepted log of order 2. Right: the first refused one of a "
        "machine with a flexible mode (" +
        hidden->refusal + ").");
    for (const Outcome* o : {&*accepted, &*hidden}) {
      plateau.panel(0, o == &*accepted ? 0 : 1)
          .title(o == &*accepted ? "accepted" : "refused")
          .x_label("bandwidth of the fit (rad/s)")
          .y_label("b0 found / true b0")
          .log_x()
          .y_range(0, 2)
          .name(o == &*accepted ? "accepted" : "refused")
          .horizontal_line(1.0)
          .band(o->plateau.x, o->low, o->high,
                {.color = Color::sky, .opacity = 0.3, .column = "two standard errors"})
          .line(o->plateau, {.color = Color::blue, .column = "b0"});
    }
    report.add(plateau);
  }
  return report.finish();
}
