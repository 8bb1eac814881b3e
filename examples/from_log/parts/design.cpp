#include "from_log/parts/design.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>

#include <esokit/analysis/loop_response.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>

namespace from_log {
namespace {

using namespace esokit::examples;
using esokit::Identified;
using esokit::LinearController;
using esokit::Loop;

/// f(the plant that was found).
template <class F>
auto with_plant(const Identified& found, F&& f) {
  switch (found.order) {
    case 1:
      return f(found.plant<1>());
    case 2:
      return f(found.plant<2>());
    default:
      return f(found.plant<3>());
  }
}

/// y of the machine that was found under the u of the log, with its noise and its disturbance.
esokit::FitData simulated(const Identified& found, const esokit::FitData& rows) {
  esokit::FitData out = rows;
  const double T = rows.sample_time;
  const std::size_t count = rows.y.size();
  std::vector<double> walk(count + 1, 0.0);
  esokit::sim::Gaussian gaussian(1);
  for (std::size_t k = 1; k <= count; ++k)
    walk[k] = walk[k - 1] + std::sqrt(found.random_walk() * T) * gaussian.next();
  with_plant(found, [&](const auto& plant) {
    if (!plant) return 0;
    std::size_t row = 0;
    const auto recorded = [&rows, &row](double, double) {
      return rows.u[std::min(row++, rows.u.size() - 1)];
    };
    const auto run = esokit::sim::run(
        *plant, recorded,
        {.duration = static_cast<double>(count - 1) * T,
         .sample_time = T,
         .disturbance =
             [&](double t) {
               return walk[std::min(static_cast<std::size_t>(t / T + 1e-6), count)];
             },
         .noise = found.noise.value});
    if (run) {
      for (std::size_t k = 0; k < std::min(count, run->measurement.size()); ++k)
        out.y[k] = run->measurement[k];
    }
    return 0;
  });
  out.starts = {0};
  return out;
}

std::string percent(double share) { return number_text(100 * share, 3) + " %"; }

std::string overshoot_text(const StepOfCode& step) {
  return step.overshoot < 1e-4 ? "does not overshoot" : "overshoots by " + percent(step.overshoot);
}

/// Who wins, in words: J is what everything was tuned for.
std::string against_pid(const std::vector<esokit::TunedPid>& baselines,
                        const esokit::TunedDesign& taken) {
  const esokit::TunedDesign& best = baselines.front().design;
  if (!best.feasible) {
    return "No PID keeps these rules; the nearest, " + best.name + ", misses: " + best.constraint +
           ".";
  }
  const double ratio = best.cost / taken.cost;
  const std::string what = best.name + " (" + std::to_string(best.numbers) +
                           " tuned numbers; this design: " + std::to_string(taken.numbers) + ")";
  // Of the deviations, as in the table: the root of J.
  const std::string by = percent(std::abs(std::sqrt(ratio) - 1.0));
  const std::string lost = best.recovers ? "" : " But it does not recover from " + best.lost + ".";
  if (ratio > 1.01) {
    return "The best PID under the same rules is the " + what + "; its deviations of y and u are " +
           by + " larger." + lost;
  }
  if (ratio < 1.0 / 1.01) {
    return "A PID does better here: the " + what + " has deviations of y and u that are " + by +
           " smaller under the same rules. Its code is below." + lost;
  }
  return "A PID does as well here: the " + what +
         ", tuned for the same under the same rules, is within 1 %. Its code is below." + lost;
}

/// Of a machine of order 1 whose limits are not symmetric: where it worked in the log, and what u
/// has left there. Else empty.
std::string what_is_left(const esokit::TuneModel& model, const esokit::FitData& rows) {
  const double range = model.u_max - model.u_min;
  if (model.order != 1 || std::abs(model.u_min + model.u_max) < 0.1 * range || rows.u.empty())
    return "";
  double u = 0.0, y = 0.0;
  for (std::size_t k = 0; k < rows.u.size(); ++k) {
    u += rows.u[k] / static_cast<double>(rows.u.size());
    y += rows.y[k] / static_cast<double>(rows.u.size());
  }
  const double up = model.u_max - u, down = u - model.u_min;
  const double slope = std::abs(model.input_gain.value);
  const auto text = [](double x) { return number_text(x, 3); };
  return "In the log u was " + text(u) + " on average and y " + text(y) + ". There u has " +
         text(up) + " left upwards, which move y by at most " + text(slope * up) +
         " a second, and " + text(down) + " downwards, " + text(slope * down) + " a second." +
         (model.u_min >= 0.0 ? " No u pulls: y falls no faster than it does by itself." : "");
}

/// What the measured disturbances take of u in the log, what is left of d without them, and how far
/// they would move y under the code, with and without measuring.
std::string what_measuring_saves(const esokit::Tuning& tuning, const esokit::TunedDesign& taken,
                                 const Pasting& pasting, const esokit::FitData& rows,
                                 const Identified& found) {
  const std::size_t count = rows.y.size();
  const double T = rows.sample_time;
  // As straight lines between the rows, and from rest.
  std::vector<double> force(count, 0.0);
  std::string names;
  for (const Feed& feed : pasting.feeds) {
    const auto& effect = found.columns[feed.column];
    const auto late = esokit::detail::late(rows.columns[feed.column], {0}, T, effect.lag.value,
                                           effect.dead_time.value);
    for (std::size_t k = 0; k < count; ++k) force[k] += effect.gain.value * (late[k] - late[0]);
    names += (names.empty() ? "" : " and ") + feed.name;
  }
  double sum = 0.0, square = 0.0;
  for (const double f : force) sum += f, square += f * f;
  const double rows_double = static_cast<double>(count);
  const double deviation = std::sqrt(std::max(square - sum * sum / rows_double, 0.0) / rows_double);
  esokit::Tuning wide = tuning;  // a machine that moves by more than its limits says nothing
  wide.model.u_min = -1e9 * (tuning.model.u_max - tuning.model.u_min);
  wide.model.u_max = -wide.model.u_min;
  const auto largest = [&](bool measures) {
    Pasting simulated = pasting;
    simulated.friction = 0.0;
    simulated.by_position = false;
    Acting measured{.force = force};
    for (Feed& feed : simulated.feeds) {
      measured.w.push_back(rows.columns[feed.column]);
      feed.rest = measured.w.back()[0];
      if (!measures) feed.factor = 0.0;
    }
    double most = 0.0;
    for (const double y :
         step_of_code(simulated, wide, taken, 0.0, T * (rows_double - 1.0), 0.0, 0, &measured).y)
      most = std::max(most, std::abs(y - simulated.start_y));
    return most;
  };
  return "Measuring " + names + " saves: in this log it takes " +
         percent(deviation / std::abs(found.input_gain.value) /
                 (tuning.model.u_max - tuning.model.u_min)) +
         " of the range of u (standard deviation); the rest of d grows at " +
         percent(std::sqrt(found.random_walk() / found.random_walk_unmeasured())) +
         " of the rate without it. Under this code what " + names +
         " did in the log would move y by up to " + number_text(largest(true), 2) +
         "; not measured, by up to " + number_text(largest(false), 2) + ".";
}

/// Why there may be no design of order 3, and what to do.
const std::string three_integrators =
    "Friction acts as a large damping on small motions. Behind an actuator that integrates, it "
    "leaves three integrators with that of the observer, and no law of this kind brings these to "
    "rest. Measure what the actuator sets (force, pressure, speed), control it by an inner loop of "
    "order 1, and y by an outer one of order 2; or, if the machine has no friction, say so: "
    "--friction 0.";

}  // namespace

Design Design::make(const Settings& settings, const Input& input, const Findings& findings) {
  Design design;
  const Identified& found = findings.found;
  const auto [least, largest] = std::minmax_element(findings.rows.u.begin(), findings.rows.u.end());
  auto limits = std::pair(*least, *largest);
  if (settings.limits) {
    limits = {findings.curve.effect(settings.limits->first),
              findings.curve.effect(settings.limits->second)};
  }
  auto model = as_printed(esokit::tune_model(found, limits.first, limits.second));
  model.friction = settings.friction;
  const double range = limits.second - limits.first;
  esokit::TuneSpecification wish;
  wish.settling_time = settings.settling_time;
  wish.controller_bandwidth = settings.controller;
  if (settings.noise_share > 0.0) wish.control_noise = settings.noise_share * range;
  auto tuning = esokit::tune(model, wish, settings.rules);
  // A machine that settles sooner by itself need not be held back.
  std::string sooner;
  if (!tuning && std::string_view(tuning.error().field) == "settling_time" &&
      wish.settling_time > tuning.error().limit) {
    sooner = "A settling time of " + number_text(wish.settling_time, 3) +
             " s is longer than this machine takes by itself, " +
             number_text(tuning.error().limit, 3) +
             " s, so it cannot be asked of a feedback: the design is that without this "
             "specification. To move more "
             "slowly, let the reference move slowly.";
    wish.settling_time = 0.0;
    tuning = esokit::tune(model, wish, settings.rules);
  }
  if (!tuning) {
    const auto& error = tuning.error();
    design.why_not_ = esokit::to_text(error);
    if (std::string_view(error.field) == "control_noise") {
      design.alarms_.push_back(
          {"noise", "Noise may move u by " + percent(error.value / range) +
                        " of its range (standard deviation), but cancelling the disturbance of "
                        "this log alone needs " +
                        percent(error.limit / range) +
                        ". Measure y with less noise, or sample faster; with --noise and a larger "
                        "number there is a design, and this alarm again."});
    }
    return design;
  }
  design.tuning_ = *tuning;
  const auto rank = static_cast<std::size_t>(settings.rank - 1);
  if (rank >= tuning->designs.size() || !tuning->designs[rank].feasible ||
      (rank == 0 && tuning->chosen() == nullptr)) {
    design.why_not_ =
        rank > 0 ? "There is no design of rank " + std::to_string(settings.rank) +
                       " that keeps the rules."
        : tuning->designs.front().feasible
            ? "No design is recommended: none recovers from an overload, the first not from " +
                  tuning->designs.front().lost +
                  (model.may_rub() ? ". " + three_integrators
                                   : ". Relax the requirement: --noise, --settling, --omega-c.")
            : "No family keeps the rules; the nearest, " + tuning->designs.front().name +
                  ", misses: " + tuning->designs.front().constraint +
                  ". Relax the requirement: --noise, --settling, --omega-c.";
    return design;
  }
  design.taken_ = rank;
  const esokit::TunedDesign& taken = design.taken();
  auto loop = esokit::closed_loop(model, taken.controller);
  if (!loop) {
    design.why_not_ = esokit::to_text(loop.error());
    return design;
  }
  design.loop_ = *loop;
  const double T = model.sample_time;
  const LinearController form = design.form();
  const Replay all = through(form, found.input_gain.value, found.order, findings.rows);
  design.pasting_ = Pasting::make(settings, input, findings, model, all,
                                  Feed::make(input, found, model, findings.rows));
  design.told_ = told_rows(design.pasting_.feeds, findings.rows);
  const esokit::FitData& rows = design.told_;
  design.replay_ = through(form, found.input_gain.value, found.order, rows);
  design.code_ = pasted_code(design.pasting_, *tuning, taken, rows);
  for (const auto& alarm : esokit::alarms(*tuning, taken))
    design.alarms_.push_back({alarm.name, alarm.text});
  // Of order 1 no further than u holds against the pole.
  const double duration = std::min(10 * taken.settling_time + 300 * model.latency(), 200'000.0 * T);
  const StepOfCode step = step_of_code(
      design.pasting_, *tuning, taken,
      esokit::overload_distance(model, 1.0, esokit::overloads.back()), duration, 0.0, 0);
  design.summary_ = {
      "Chosen: " + taken.name + ". A step of the reference by " + number_text(step.height, 3) +
          ", through the profile of the code, settles in " + duration_text(step.settling) +
          " and " + overshoot_text(step) +
          ", within the limits of u. A load step that takes a tenth of the range of u moves y by "
          "at most " +
          number_text(0.1 * range * taken.load_peak, 3) +
          ". Noise causes a standard deviation of u of " + percent(taken.control_noise / range) +
          " of its range.",
      "The modulus margin is " + number_text(taken.modulus_margin, 2) + ", the delay margin " +
          duration_text(taken.delay_margin) + ", the phase margin " +
          number_text(taken.phase_margin * 180 / std::numbers::pi, 3) +
          "°, each the smallest over the intervals. Errors of y and u are " +
          number_text(100 * (taken.excess - 1), 2) +
          " % above the theoretical best, which has no safety margin."};
  design.baselines_ = esokit::tune_pids(*tuning);
  design.summary_.push_back(against_pid(design.baselines_, taken));
  if (const auto& best = design.baselines_.front(); best.design.feasible) {
    const StepOfCode bare = step_of_pid(design.pasting_, model, best.pid, step.height, duration);
    design.summary_.push_back("The same step, given at once to the " + best.design.name +
                              ", settles in " + duration_text(bare.settling) + " and " +
                              overshoot_text(bare) + ".");
  }
  if (settings.pid) {
    const auto given = esokit::given_pid(*tuning, *settings.pid);
    if (!given) throw LogError("--pid: " + esokit::to_text(given.error()));
    design.migration_ = esokit::migration(*tuning, *given, taken);
    design.to_best_ = esokit::migration(*tuning, *given, design.baselines_.front().design);
    design.migrates_ = true;
    design.baselines_.push_back(*given);
  }
  if (taken.simulated && taken.recovers) {
    design.summary_.push_back(
        "It was simulated with limits and noise, on the model and at the ends of its intervals. It "
        "recovers from " +
        esokit::detail::in_words(esokit::overloads[0], model) + " and from " +
        esokit::detail::in_words(esokit::overloads[1], model) + ". It also recovers from " +
        esokit::detail::in_words(esokit::overloads[2], model) + " and from " +
        esokit::detail::in_words(esokit::overloads[3], model) + ".");
  }
  if (tuning->model.disturbance > 1.001 * tuning->model_disturbance) {
    design.summary_.push_back(
        "The disturbance of the log changes slowly: an observer with a bandwidth of " +
        number_text(model.filter_bandwidth(), 3) +
        " rad/s follows it. A log without loads does not show those of tomorrow, so the design "
        "reckons with a disturbance for which it takes " +
        number_text(tuning->model.filter_bandwidth(), 3) + " rad/s.");
  }
  if (taken.bandwidth_ratio > 1.0) {
    design.summary_.push_back(
        "The poles of the law are " + number_text(taken.bandwidth_ratio, 3) +
        " times as fast as those of the observer (geometric means), where the rule of thumb has "
        "the observer 5 to 10 times as fast. The loop has all these poles, whichever part they "
        "belong to; a faster observer would pass more noise to u, and a slower law would give way "
        "to loads.");
  }
  if (!design.pasting_.feeds.empty())
    design.summary_.push_back(
        what_measuring_saves(*tuning, taken, design.pasting_, findings.rows, found));
  if (!sooner.empty()) design.summary_.push_back(sooner);
  if (settings.settling_time > 0.0) {
    design.summary_.push_back("A step that is so small that u stays within its limits settles in " +
                              number_text(taken.settling_time, 3) + " s; asked for were " +
                              number_text(settings.settling_time, 3) + " s." +
                              (taken.settling_time > 1.5 * settings.settling_time
                                   ? " It is slower than that; --omega-c sets a faster law."
                                   : ""));
  }
  if (!settings.limits) {
    design.summary_.push_back(
        "The limits of " + std::string(findings.curve.seen() ? "the effect of u" : "u") +
        " are those that the log shows, " + number_text(limits.first, 4) + " to " +
        number_text(limits.second, 4) + "; set others with --limits.");
  }
  if (const auto left = what_is_left(tuning->model, findings.rows); !left.empty())
    design.summary_.push_back(left);
  const esokit::FitData machine = simulated(found, rows);
  const Replay expected = through(form, found.input_gain.value, found.order, machine);
  const auto settling = std::min<std::size_t>(
      static_cast<std::size_t>(taken.settling_time / T) + 20, findings.rows.y.size() / 4);
  design.replay_.band = quantile(settled(expected.innovation, machine, settling), 0.95);
  const auto ours = settled(design.replay_.innovation, rows, settling);
  const auto inside =
      std::count_if(ours.begin(), ours.end(), [&](double e) { return e <= design.replay_.band; });
  design.replay_.inside =
      static_cast<double>(inside) / static_cast<double>(std::max<std::size_t>(ours.size(), 1));
  return design;
}

namespace {

/// Every design where its noise and its errors are, and the least that any linear controller has.
Figure tradeoff_figure(const esokit::Tuning& tuning, std::size_t taken) {
  Figure figure("tradeoff", {.rows = 1, .columns = 1, .panel_height = 260});
  figure.caption(
      "Each number is a design of the table below. Designs further to the right have more noise in "
      "u, designs further up larger deviations of y (by noise and disturbance together). The curve "
      "is the best possible linear controller without margins; the square is the chosen design.");
  const esokit::TuneModel& model = tuning.model;
  const double range = model.u_max - model.u_min;
  const int n = model.order;
  const esokit::Lqg lqg(model);
  const double w0 = std::pow(tuning.rho, -0.5 / n);
  const esokit::LoopCost cost(model, tuning.rules, 0.05 * w0);
  std::vector<double> noise, output;
  for (int i = -12; i <= 12; ++i) {
    const double w = std::min(w0 * std::pow(10.0, i / 16.0), 1.0 / model.sample_time);
    const auto numbers = cost(lqg.controller(std::pow(w, -2 * n)));
    if (!numbers.stable) continue;
    noise.push_back(100 * numbers.control_noise / range);
    output.push_back(numbers.output);
  }
  auto& panel = figure.panel(0, 0)
                    .x_label("standard deviation of u by noise (% of its range)")
                    .y_label("standard deviation of y (unit of y)")
                    .name("tradeoff");
  if (!noise.empty())
    panel.line(noise, output, {.name = "best linear controller (LQG)", .color = Color::grey});
  // Of both, as the logarithm of the largest over the least.
  const auto span = [](const std::vector<double>& a, const std::vector<double>& b) {
    double least = a[0], largest = a[0];
    for (const auto* values : {&a, &b}) {
      for (const double value : *values) {
        least = std::min(least, value);
        largest = std::max(largest, value);
      }
    }
    return std::log(largest / least);
  };
  std::vector<double> x, y, beside;  // beside: where what a label stands for ends
  std::vector<std::string> labels;
  for (std::size_t i = 0; i < tuning.designs.size(); ++i) {
    const auto& design = tuning.designs[i];
    if (!(design.control_noise > 0.0)) continue;
    x.push_back(100 * design.control_noise / range);
    y.push_back(design.output_deviation);
    // Numbers that would stand on each other stand behind one another.
    const auto near = [&](std::size_t k) {
      return std::abs(std::log(x[k] / x.back())) < 0.05 * span(x, noise) &&
             std::abs(std::log(y[k] / y.back())) < 0.06 * span(y, output);
    };
    std::size_t at = 0;
    while (at + 1 < x.size() && !(labels[at].size() > 0 && near(at))) ++at;
    labels.resize(x.size());
    beside.push_back(x.back());
    beside[at] = std::max(beside[at], x.back());
    labels[at] += (labels[at].empty() ? " " : ", ") + std::to_string(i + 1);
  }
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (!labels[k].empty()) panel.note(beside[k] * 1.02, y[k], labels[k]);
  }
  if (!x.empty()) {
    panel.points(x, y, {.color = Color::blue, .marker = Marker::circle, .column = "designs"});
  }
  // Numbers stand at decades: within one the axis is even. No point on the frame.
  if (!x.empty()) {
    if (span(x, noise) > std::log(20)) panel.log_x();
    if (span(y, output) > std::log(20)) panel.log_y();
    auto all = x;
    all.insert(all.end(), noise.begin(), noise.end());
    const auto [least, largest] = std::minmax_element(all.begin(), all.end());
    panel.x_range(0.9 * *least, 1.05 * *largest);
  }
  const auto& chosen = tuning.designs[taken];
  panel.points({100 * chosen.control_noise / range}, {chosen.output_deviation},
               {.name = chosen.name,
                .color = Color::vermillion,
                .marker = Marker::square,
                .size = 1.6,
                .column = "taken"});
  return figure;
}

/// The event that a design does not recover from.
Figure lost_figure(const esokit::Tuning& tuning, const esokit::TunedDesign& design) {
  Figure figure("overload", {.rows = 2, .columns = 1, .panel_height = 150});
  figure.caption("This is why designs rank behind: " + design.name + " does not recover from " +
                 design.lost + ". Simulated with limits and noise.");
  const auto variants = esokit::simulated_variants(tuning.model);
  const auto& variant = variants[static_cast<std::size_t>(design.lost_on)];
  std::vector<double> t, y, u;
  const auto simulated = esokit::simulate_overload(
      variant.model, variant.gain, design.controller, design.lost_in,
      design.simulated_settling(variant.model),
      [&](double now, double, double output, double control) {
        t.push_back(now);
        y.push_back(output);
        u.push_back(control);
      },
      design.softening_law());
  // The event and what comes first tell it.
  const auto rows = std::min<std::size_t>(
      t.size(), static_cast<std::size_t>((5 * design.lost_in.latencies * tuning.model.latency() +
                                          std::min(simulated.time, 5 * design.settling_time)) /
                                         tuning.model.sample_time));
  for (auto* column : {&t, &y, &u}) column->resize(rows);
  figure.panel(0, 0)
      .y_label("y (unit of the log)")
      .name("y")
      .line(t, y, {.color = Color::blue, .column = "y"});
  figure.panel(1, 0)
      .x_label("t (s)")
      .y_label("u (unit of the log)")
      .name("u")
      .line(t, u, {.color = Color::vermillion, .column = "u"});
  return figure;
}

/// C++ of a baseline that compiles as it is and checks itself.
std::string pid_program(const esokit::TunedPid& baseline, const ActuatorCode& actuator) {
  const auto exact = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", value);
    return std::string(text);
  };
  auto pid = esokit::PlainPid::make(baseline.pid).value();
  const double half = 0.5 * (baseline.pid.upper - baseline.pid.lower);
  const double step = 0.02 * half / std::abs(baseline.pid.proportional);
  std::string wanted;
  for (int k = 0; k < 12; ++k)
    wanted += (k > 0 ? "," : "") + std::string(k % 4 == 0 ? "\n      " : " ") +
              exact(actuator.input(pid.update(step * (k % 5), 10 * step)));
  return "// " + baseline.design.name + R"(, as from_log tuned it.
#include <cmath>
#include <cstdio>
)" + (actuator.curved() ? "#include <esokit/adapter/actuator_map.hpp>\n" : "") +
         R"(#include <esokit/tune/plain_pid.hpp>

int main() {
  )" + baseline.design.code +
         (actuator.curved() ? "  // The u that has the effect for which the controller asks.\n"
                              "  const auto actuator = " +
                                  actuator.made() + ".value();\n"
                            : std::string()) +
         R"(  if (!controller) return 1;
  // Self-check: the u that from_log computed.
  const double wanted[] = {)" +
         wanted + R"(};
  for (int k = 0; k < 12; ++k) {
    const double u = )" +
         actuator.from("controller->update(" + exact(step) + " * (k % 5), 10 * " + exact(step) +
                       ")") +
         R"(;
    if (!(std::abs(u - wanted[k]) <= )" +
         exact(1e-8 * half * actuator.steepest()) + R"()) {
      std::printf("self-check: sample %d: u is not that of from_log\n", k);
      return 1;
    }
  }
  std::puts("self-check: ok");
  return 0;
}
)";
}

std::vector<CsvRow> ranking(const esokit::Tuning& tuning,
                            const std::vector<esokit::TunedPid>& baselines) {
  const double range = tuning.model.u_max - tuning.model.u_min;
  std::vector<CsvRow> rows{{"", "tuned numbers", "times the best", "the same without margins",
                            "standard deviation of y", "noise in u, % of its range",
                            "y after a load of 10 %", "settling time of a small step (s)",
                            "modulus margin", "delay margin (ms)", "operations", "limited by"}};
  // Zero where a design was not simulated.
  const auto simulated = [](double value) { return value > 0.0 ? number_text(value, 3) : "-"; };
  const auto row = [&](const std::string& before, const esokit::TunedDesign& d) {
    rows.push_back({before + d.name +
                        (!d.feasible   ? " (does not keep the rules)"
                         : !d.recovers ? " (does not recover from an overload)"
                                       : ""),
                    d.numbers > 0 ? std::to_string(d.numbers) : "-", number_text(d.excess, 3),
                    number_text(d.free_excess, 3), number_text(d.output_deviation, 3),
                    number_text(100 * d.control_noise / range, 3),
                    simulated(0.1 * range * d.load_peak), simulated(d.settling_time),
                    number_text(d.modulus_margin, 2), number_text(1e3 * d.delay_margin, 3),
                    d.operations > 0 ? std::to_string(d.operations) : "-", d.constraint});
  };
  for (std::size_t i = 0; i < tuning.designs.size(); ++i)
    row(std::to_string(i + 1) + " ", tuning.designs[i]);
  for (const auto& baseline : baselines) row("baseline: ", baseline.design);
  return rows;
}

}  // namespace

void Design::show_on(Page& page, const Findings& findings) const {
  if (tuning_) {
    page.heading("Which observer");
    page.figure(tradeoff_figure(*tuning_, taken_));
    page.table(
        "observers",
        "The observer families, each tuned for this requirement, ranked by the deviations "
        "of y and u together, compared with the best linear controller (sqrt(J / J*); "
        "within 1 % the cheaper one comes first). The operations (sums, products, comparisons) "
        "are those of an update of the observer. --rank takes another row",
        ranking(*tuning_, baselines_));
    if (!baselines_.empty()) {
      page.text(
          "The PIDs are baselines, each at its own optimum of the same J, under the same margins, "
          "intervals and noise in u. J sees neither windup nor lost samples.");
    }
  }
  if (migrates_) {
    page.heading("From your PID to this design");
    const auto list = [](const std::vector<std::string>& all) {
      std::string text;
      for (const auto& one : all) text += (text.empty() ? "" : "; ") + one;
      return text.empty() ? std::string("nothing") : text;
    };
    page.text("You gain: " + list(migration_.gains) + ".");
    page.text("You lose: " + list(migration_.losses) + ".");
    page.text("The same within 1 %: " + list(migration_.ties) + ".");
    if (migration_.equal) {
      const auto& equal = *migration_.equal;
      page.text("The gains of your PID are those of an ADRC with b0 = " +
                number_text(equal.input_gain, 3) +
                ", omega_c = " + number_text(equal.controller_bandwidth, 3) +
                " rad/s and omega_o = " + number_text(equal.observer_bandwidth, 3) + " rad/s.");
    }
    if (!baselines_.front().design.feasible) {
      page.text("No PID keeps the rules.");
    } else {
      page.text("Before you change: the best PID would do this by numbers alone: " +
                list(to_best_.gains) + "; and lose: " + list(to_best_.losses) + ".");
    }
  }
  if (tuning_) {
    for (const auto& design : tuning_->designs) {
      if (!design.feasible || design.recovers) continue;
      page.figure(lost_figure(*tuning_, design));
      break;
    }
  }
  if (!made()) {
    if (!why_not_.empty()) page.box("No controller", {why_not_}, true);
    return;
  }
  const Identified& found = findings.found;
  const esokit::TunedDesign& chosen = taken();
  const double range = tuning_->model.u_max - tuning_->model.u_min;

  page.heading("The loop");
  Figure loop("loop", {.rows = 2, .columns = 3, .panel_height = 170});
  std::vector<double> w, gain, phase;
  const double nyquist = std::numbers::pi / found.log.sample_time;
  double before = -180;
  for (int i = 0; i <= 300; ++i) {
    const double at = nyquist * std::pow(10.0, -4.0 * (300 - i) / 300.0) * (1 - 1e-9);
    const auto l = loop_->loop_gain(at);
    if (!l) continue;
    double degrees = std::arg(*l) * 180 / std::numbers::pi;
    degrees += 360 * std::round((before - degrees) / 360);
    before = degrees;
    w.push_back(at);
    gain.push_back(std::abs(*l));
    phase.push_back(degrees);
  }
  const auto margins = esokit::margins(*loop_).value();
  loop.caption(
      "Left: loop gain L with the identified machine, without its intervals (dashed: the "
      "frequencies where abs(L) is one and where the phase is -180°; the margins above are the "
      "smallest over the intervals). "
      "Middle: response to a step of the reference. Right: response to a load step that "
      "takes a tenth of the range of u. Both hold while u is within its limits.");
  double peak = 0.0;
  const auto bode = [&](Panel& panel) {
    if (margins.phase.limited()) panel.vertical_line(margins.phase.frequency);
    if (margins.gain_increase.limited()) panel.vertical_line(margins.gain_increase.frequency);
  };
  auto& upper =
      loop.panel(0, 0).x_label("w (rad/s)").y_label("abs L (-)").log_x().log_y().name("gain");
  upper.line(w, gain, {.color = Color::blue, .column = "gain"}).horizontal_line(1.0);
  bode(upper);
  auto& lower =
      loop.panel(1, 0).x_label("w (rad/s)").y_label("phase of L (°)").log_x().name("phase");
  lower.line(w, phase, {.color = Color::blue, .column = "phase"}).horizontal_line(-180.0);
  bode(lower);
  const double duration = std::max(4 * chosen.settling_time, 40 * found.log.sample_time);
  const auto step = esokit::reference_response(*loop_, {.duration = duration}).value();
  const auto load = esokit::load_response(*loop_, {.duration = duration,
                                                   .height = 0.1 * range * found.input_gain.value})
                        .value();
  const auto answer = [&](std::size_t column, const esokit::LoopResponse& of, const char* title,
                          const std::string& after, Color color) {
    loop.panel(0, column)
        .title(title)
        .x_label("t (s)")
        .y_label("y (unit of y)")
        .name("y" + after)
        .line(of.time, of.output[0], {.color = color, .column = "y"});
    loop.panel(1, column)
        .x_label("t (s)")
        .y_label("u (unit of u)")
        .name("u" + after)
        .line(of.time, of.control[0], {.color = color, .column = "u"});
  };
  answer(1, step, "step of the reference by 1", "", Color::blue);
  answer(2, load, "load step", " after the load", Color::vermillion);
  page.figure(loop);
  for (const double u : step.control[0]) peak = std::max(peak, std::abs(u));
  page.text("A step of the reference by more than " + number_text(0.5 * range / peak, 2) +
            " drives u to its limits" +
            ". The code below passes it through a profile that does not.");

  page.heading("The log through this observer");
  Figure replay("replay", {.rows = 3, .columns = 1, .panel_height = 150});
  replay.caption(
      "Top: y and its estimate. Middle: u, and the estimated disturbance in units of u. Bottom: "
      "the innovation; " +
      number_text(100 * replay_.inside, 3) +
      " % of the rows are within the dashed lines. If the machine equals the model, 95 % are.");
  const auto& t = replay_.t;
  replay.panel(0, 0)
      .y_label("y (unit of the log)")
      .legend(Legend::above)
      .name("y")
      .line(t, findings.rows.y, {.name = "y", .color = Color::grey, .width = 1.0})
      .line(t, replay_.estimate, {.name = "estimate", .color = Color::blue, .width = 1.1});
  replay.panel(1, 0)
      .y_label("u, d / b0 (unit of u)")
      .legend(Legend::above)
      .name("u")
      .line(t, findings.rows.u, {.name = "u", .color = Color::grey, .width = 1.0})
      .line(t, replay_.load, {.name = "dhat / b0", .color = Color::vermillion, .width = 1.1});
  replay.panel(2, 0)
      .x_label("t (s)")
      .y_label("innovation (unit of y)")
      .name("innovation")
      .line(t, replay_.innovation, {.color = Color::blue, .width = 0.8, .column = "innovation"})
      .horizontal_line(replay_.band)
      .horizontal_line(-replay_.band);
  page.figure(replay);

  page.heading(findings.refusal ? "Paste this only if you know that the model is right"
                                : "Paste this");
  page.text(
      "This program compiles as it is, with esokit on the include path: g++ -std=c++20 -O2. It "
      "checks itself: that compiler, settings and copy give the u that from_log computed. It has "
      "the controller, a profile for the reference within the limits of u, a monitor and guards, "
      "with settings from the log" +
      pasting_.used() + ".");
  page.code(code_);
  for (std::size_t i = 0; i < tuning_->designs.size(); ++i) {
    const auto& other = tuning_->designs[i];
    if (i == taken_ || !other.feasible) continue;
    page.code(pasted_code(pasting_, *tuning_, other, told_),
              "The code for number " + std::to_string(i + 1) + ", " + other.name);
  }
  for (const auto& baseline : baselines_) {
    if (baseline.design.feasible && baseline.kind != esokit::PidKind::given)
      page.code(pid_program(baseline, pasting_.actuator), "The code for " + baseline.design.name);
  }
}

}  // namespace from_log
