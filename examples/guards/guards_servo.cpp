// A servo on its bad days: an observer that is given another u than the actuator got, settings that
// forward Euler does not bear, a hard stop. A wrong sign and a b0 ten times too small are found and
// taken to the safe output; how often, a thousand servos show.
//
// Way: sampled, the plant exactly (y'' = b u + d, held) but for stop and lag.
//
// symbol   code         value            unit
// y        y            0 .. 2           rad
// b        b0           200              rad/s^2 for u = 1, all that the drive can
// T        sample_time  0.001, 0.005     s
// omega_o  observer     60 .. 600        rad/s
// omega_c  controller   omega_o / 3 .. 8 rad/s

#include <array>
#include <cstdint>

#include <esokit/analysis/health_text.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/control/health.hpp>

#include "common/parallel.hpp"
#include "guards/guards.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace guards;

namespace {

using Servo = Adrc<LinearEso<2>>;

Servo servo(double observer, double controller, double b0, double sample_time, double limit = 1) {
  return Servo::make({.observer = {.observer_bandwidth = observer,
                                   .input_gain = b0,
                                   .sample_time = sample_time},
                      .controller_bandwidth = controller,
                      .limits = {.lower = -limit, .upper = limit}})
      .value();
}

/// y'' = b u + d, exactly.
struct Mass {
  double y = 0;
  double speed = 0;
  void step(double push, double T) {
    y += T * speed + T * T / 2 * push;
    speed += T * push;
  }
};

void draw(Report& report, const std::string& name, const std::string& caption, const Trace& bad,
          const Trace& good, const std::string& bad_name, const std::string& good_name,
          const Range& range, bool disturbance = false) {
  Figure figure(name, {.rows = 1, .columns = 2, .panel_height = 220});
  figure.caption(caption);
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("y (rad)")
      .y_range(range)
      .legend(Legend::above)
      .line(bad.t, bad.y, {.name = bad_name, .color = Color::vermillion})
      .line(good.t, good.y, {.name = good_name, .color = Color::blue});
  figure.panel(0, 1)
      .x_label("t (s)")
      .y_label(disturbance ? "dhat (rad/s²)" : "u (-)")
      .line(bad.t, disturbance ? bad.d : bad.u, {.color = Color::vermillion})
      .line(good.t, disturbance ? good.d : good.u, {.color = Color::blue});
  report.add(figure);
}

/// Somewhere between law and actuator u is scaled (percent, per unit, a battery's sag), and the
/// observer is given the number of the other side: a fifth of what was applied.
void scaled(Report& report) {
  constexpr double T = 1e-3;
  const auto run = [](double given) {
    auto loop = servo(150, 60, 200, T);
    Mass mass;
    Trace trace;
    double motor = 0;
    double held = 0;
    for (int k = 0; k < 2000; ++k) {
      loop.applied(given * held);
      held = loop.update(mass.y, 0.2);
      trace.add(k * T, mass.y, held, loop.observer().total_disturbance());
      for (int i = 0; i < 5; ++i) {
        motor += T / 5 / 0.005 * (held - motor);
        mass.step(200 * motor, T / 5);
      }
    }
    return trace;
  };
  const Trace bad = run(0.2);
  const Trace good = run(1);
  int turns = 0;
  for (std::size_t k = 1000; k < 2000; ++k) {
    turns += (bad.y[k] - bad.y[k - 1]) * (bad.y[k - 1] - bad.y[k - 2]) < 0 ? 1 : 0;
  }
  const std::string name = "observer given a scaled u";
  report.expect(name, "frequency of the limit cycle (Hz)", turns / 2.0, turns > 30 && turns < 60,
                "15 to 30 (the record has 25)");
  const double cycle = peak(bad, bad.u, 1, 2);
  report.expect(name, "largest u at rest, given a fifth", cycle, cycle > 0.3, "above 0.3");
  const double rest = peak(good, good.u, 1, 2);
  report.expect(name, "largest u at rest, given what was applied", rest, rest < 0.01, "below 0.01");
  draw(report, "scaled",
       "The observer is passed a fifth of the u that the actuator got: dhat compensates the rest, "
       "but late, and the loop oscillates over the full range of u. If the applied u is passed, "
       "the loop is at rest.",
       bad, good, "passed a fifth of u", "passed the applied u", {});
}

/// 600 rad/s at 200 Hz.
void euler(Report& report) {
  constexpr double T = 5e-3;
  constexpr double w = 600;
  Trace bad, good;
  {
    Mass mass;
    double z0 = 0, z1 = 0, z2 = 0;
    double u = 0;
    for (int k = 0; k < 400 && std::abs(z0) < 1e6; ++k) {
      const double e = mass.y - z0;
      z0 += T * (z1 + 3 * w * e);
      z1 += T * (z2 + 200 * u + 3 * w * w * e);
      z2 += T * w * w * w * e;
      const double r = 0.1;
      u = std::clamp((400 * (r - z0) - 40 * z1 - z2) / 200, -1.0, 1.0);
      bad.add(k * T, mass.y, u, z2);
      mass.step(200 * u + 20, T);
    }
  }
  {
    auto loop = servo(w, 20, 200, T);
    Mass mass;
    for (int k = 0; k < 400; ++k) {
      const double u = loop.update(mass.y, 0.1);
      good.add(k * T, mass.y, u, loop.observer().total_disturbance());
      mass.step(200 * u + 20, T);
    }
  }
  const std::string name = "600 rad/s at 200 Hz";
  const double samples = static_cast<double>(bad.t.size());
  report.expect(name, "forward Euler: samples until the estimate is beyond 1e6", samples,
                samples < 50, "diverges");
  report.expect(name, "sampled exactly: error at the end (rad)", std::abs(good.y.back() - 0.1),
                std::abs(good.y.back() - 0.1) < 1e-6, "none");
  draw(report, "euler",
       "omega_o = 600 rad/s at 200 Hz (omega_o T = 3) under a load. An observer by forward Euler "
       "diverges in a few samples; designed in discrete time, it is stable for any omega_o T.",
       bad, good, "forward Euler", "sampled exactly", {-0.05, 0.25});
}

/// The axis runs into its stop at speed and is pressed against it for half a second.
void stop(Report& report) {
  constexpr double T = 1e-3;
  const auto run = [](bool guarded) {
    using Loop = Adrc<Guarded<LinearEso<2>>>;
    Loop::Config config{.controller_bandwidth = 30, .limits = {.lower = -1, .upper = 1}};
    config.observer.observer = {.observer_bandwidth = 150, .input_gain = 200, .sample_time = T};
    if (guarded) config.observer.disturbance_bound = 100;
    auto loop = Loop::make(config).value();
    Mass mass;
    Trace trace;
    for (int k = 0; k < 1500; ++k) {
      const double t = k * T;
      const double r = t < 0.8 ? 2.0 : 0.1;
      const double u = loop.update(mass.y, r);
      trace.add(t, mass.y, u, loop.observer().total_disturbance());
      mass.step(200 * u, T);
      if (mass.y > 0.3) mass.y = 0.3, mass.speed = std::min(mass.speed, 0.0);
    }
    return trace;
  };
  const Trace bad = run(false);
  const Trace good = run(true);
  const std::string name = "hard stop at speed";
  const double most_bad = peak(bad, bad.d, 0, 1.5);
  const double most = peak(good, good.d, 0, 1.5);
  report.expect(name, "largest dhat without (rad/s²; b0 = 200)", most_bad, most_bad > 400,
                "above 2 b0");
  report.expect(name, "largest dhat with a bound of b0 / 2 (rad/s²)", most, most < 100.001,
                "at the bound");
  const double swing_bad = 0.1 - *std::min_element(bad.y.begin() + 800, bad.y.end());
  const double swing = 0.1 - *std::min_element(good.y.begin() + 800, good.y.end());
  report.expect(name, "undershoot on the way back without (rad)", swing_bad, true, "reported");
  report.expect(name, "undershoot on the way back with it (rad)", swing, swing <= swing_bad + 1e-4,
                "not more");
  draw(report, "stop",
       "The axis hits its stop at 0.3 at speed, is pressed against it until 0.8 s, and goes back. "
       "The impact is a disturbance many times larger than the actuator can compensate; with the "
       "bound, dhat stays within what the actuator can do.",
       bad, good, "without", "dhat bounded", {}, true);
}

// ---- wrong b0, found

enum class Wrong { healthy, sign, small, large };

/// What a run shows: when u first showed the fault (s), when it first was at a limit, and when it
/// was found out.
struct Found {
  double excited = -1, limited = -1, sign = -1, small = -1;
  double observer = 1;  ///< omega_o
  double ratio = 1;     ///< at the end
  double highest = 1;   ///< b / b0 by a probe, and its 95 %
};

/// What a probe is to find, and the largest b / b0 that is called too large.
constexpr double probe_amplitude = 0.2;
constexpr double called_too_large = 0.4;

/// Friction, lag, noise, bias and a slow load; b0 within a factor of 1.6, or wrong.
Found watch(Wrong wrong, bool steps, std::uint64_t seed, double duration, Trace* trace = nullptr,
            bool safe = false, bool probed = false) {
  constexpr double T = 1e-3;
  Random random{seed};
  const double b = random.logarithmic(5, 500);
  const double damping = random.between(0, 5);
  const double friction = b * random.between(0, 0.05);
  const double bias = b * random.between(-0.3, 0.3);
  const double observer = random.logarithmic(60, 200);
  const double controller = observer / random.between(3, 8);
  const double lag = random.between(0.2e-3, 1.5e-3);
  const double load = b * 0.05;
  const double period = random.between(0.3, 1.2);
  const double other = random.logarithmic(0.6, 1.6);
  const double b0 = wrong == Wrong::healthy ? b * other
                    : wrong == Wrong::sign  ? -b * other
                    : wrong == Wrong::small ? b / 10
                                            : b * 10;
  // Noise that is 0.02 to 2 % of the range in dhat / b.
  const double noise =
      random.logarithmic(2e-4, 2e-2) * b / (0.6 * std::pow(observer, 2.5) * std::sqrt(T));
  auto loop = servo(observer, controller, b0, T);
  auto monitor =
      HealthMonitor<3>::make(
          {.observer_bandwidth = observer, .sample_time = T, .input_range = 1, .noise = noise})
          .value();
  auto probe = GainProbe<3>::make({.observer_bandwidth = observer,
                                   .sample_time = T,
                                   .amplitude = probe_amplitude,
                                   .travel = 1e3,
                                   .limits = {.lower = -1, .upper = 1}})
                   .value();
  Found found;
  found.observer = observer;
  Mass mass;
  double motor = 0;
  double u = 0;
  bool stopped = false;
  for (int k = 0; k * T < duration; ++k) {
    const double t = k * T;
    const double r = steps ? (std::fmod(t, 2 * period) < period ? 0.3 : -0.3) : 0.0;
    const double y = mass.y + noise * random.normal();
    loop.applied(u);
    u = stopped ? loop.track(y, r, 0) : loop.update(y, r);
    if (probed && t > 1) u = probe.update(loop, y);
    monitor.look(loop);
    const auto& health = monitor.health();
    if (found.excited < 0 && health.evidence > 0) found.excited = t;
    if (found.limited < 0 && health.saturated > 0) found.limited = t;
    const LoopFault fault = diagnose(health);
    if (fault == LoopFault::wrong_sign && found.sign < 0) found.sign = t;
    if (fault == LoopFault::gain_too_small && found.small < 0) found.small = t;
    stopped = stopped || (safe && (found.sign >= 0 || found.small >= 0));
    if (trace) trace->add(t, mass.y, u, loop.observer().total_disturbance());
    motor += -std::expm1(-T / lag) * (u - motor);
    mass.step(b * motor + bias + load * std::sin(10 * t / period) - damping * mass.speed -
                  friction * std::tanh(mass.speed / 0.01),
              T);
  }
  found.ratio = monitor.health().gain_ratio;
  if (const auto result = probe.result()) {
    found.highest = result->gain_ratio + result->half_width;
  }
  return found;
}

void find(Report& report) {
  struct Group {
    Wrong wrong;
    bool steps;
    int count;
    double duration;
    const char* name;
  };
  const std::array groups{
      Group{Wrong::sign, true, 1000, 2, "wrong sign, a step"},
      Group{Wrong::sign, false, 1000, 2, "wrong sign, a regulator"},
      Group{Wrong::small, true, 1000, 2, "b0 ten times too small, a step"},
      Group{Wrong::small, false, 1000, 2, "b0 ten times too small, a regulator"},
      Group{Wrong::healthy, true, 2500, 10, "healthy, steps"},
      Group{Wrong::healthy, false, 2500, 10, "healthy, a regulator"}};
  int alarms = 0;
  std::vector<CsvRow> rows;
  for (const Group& group : groups) {
    const auto all = run_parallel(group.name, static_cast<std::size_t>(group.count), [&](auto i) {
      return watch(group.wrong, group.steps, 15485863u * (i + 1), group.duration);
    });
    int excited = 0, limited = 0, right = 0, quick = 0, quick_of_limited = 0, any = 0;
    for (const Found& one : all) {
      const double soon = (group.steps ? 25 : 50) / one.observer;
      excited += one.excited >= 0 ? 1 : 0;
      limited += one.limited >= 0 ? 1 : 0;
      const double when = group.wrong == Wrong::sign ? one.sign : one.small;
      right += when >= 0 ? 1 : 0;
      quick += when >= 0 && when - one.excited <= soon ? 1 : 0;
      quick_of_limited += one.limited >= 0 && when >= 0 && when - one.limited <= soon ? 1 : 0;
      any += one.sign >= 0 || one.small >= 0 ? 1 : 0;
    }
    const double of_excited = 100.0 * quick / std::max(excited, 1);
    const double of_limited = 100.0 * quick_of_limited / std::max(limited, 1);
    if (group.wrong == Wrong::healthy) {
      alarms += any;
      rows.push_back({group.name, std::to_string(group.count), std::to_string(excited), "-", "-",
                      std::to_string(limited), "-", std::to_string(any)});
      continue;
    }
    rows.push_back({group.name, std::to_string(group.count), std::to_string(excited),
                    std::to_string(right), number_text(of_excited, 4), std::to_string(limited),
                    number_text(of_limited, 4), "-"});
    // Friction holds some regulators still whatever b0 is: u answers the load alone.
    const bool may_rest = group.wrong == Wrong::small && !group.steps;
    const bool sign = group.wrong == Wrong::sign;
    const double in_time = may_rest ? of_limited : of_excited;
    report.expect(
        group.name,
        may_rest ? "found in time, of those at a limit (%)" : "found in time, of those excited (%)",
        in_time, in_time >= 99.8 && (!sign || right == group.count),
        sign ? "at least 99.8, and all in the end" : "at least 99.8");
  }
  report.expect("healthy, 5,000 runs of 10 s", "false alarms", alarms, alarms <= 1, "at most one");
  report.table(
      "found",
      "Faults found by the estimate of b / b0. In time means within 25 / omega_o (step) or "
      "50 / omega_o (regulator) after u first moves enough, or "
      "reaches a limit",
      {"runs", "count", "u moved enough", "found within 2 s", "in time (% of those)",
       "u reached a limit", "in time (% of those)", "false alarms"},
      rows);
  Trace bad, good;
  (void)watch(Wrong::sign, true, 7, 1.5, &bad);
  const Found one = watch(Wrong::sign, true, 7, 1.5, &good, true);
  const std::string name = "a wrong sign, and the safe output";
  const double away = peak(bad, bad.y, 0, 1.5);
  const double safe = peak(good, good.y, 0, 1.5);
  report.expect(name, "found after (s)", one.sign, one.sign > 0 && one.sign < 0.2, "below 0.2");
  report.expect(name, "largest y without (rad)", away, away > 3 * safe, "runs away");
  report.expect(name, "largest y with it (rad)", safe, true, "reported");
  draw(report, "safe",
       "A wrong sign of b0: the status is ok all the time, and the axis diverges. With the "
       "diagnosis u is set to zero; after that only bias and friction move the axis.",
       bad, good, "without", "diagnosed, u = 0", {});
}

/// Small steps on top of the u of a regulator under its load.
void probe(Report& report) {
  for (const Wrong wrong : {Wrong::large, Wrong::healthy}) {
    const bool large = wrong == Wrong::large;
    const auto all = run_parallel(
        large ? "probed, b0 too large" : "probed, healthy", 1000,
        [&](auto i) { return watch(wrong, false, 32452843u * (i + 1), 3, nullptr, false, true); });
    int called = 0;
    for (const Found& one : all) called += one.highest < called_too_large ? 1 : 0;
    if (large) {
      report.expect("b0 ten times too large, probed", "found by steps of a fifth of the range (%)",
                    called / 10.0, called >= 995, "at least 99.5");
    } else {
      report.expect("healthy, probed", "false alarms in 1,000", called, called == 0, "none");
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "guards", "servo",
                about("Failures of a servo",
                      "An observer that gets another u than the actuator, forward Euler, a hard "
                      "stop, a wrong b0."));
  scaled(report);
  euler(report);
  stop(report);
  find(report);
  probe(report);
  return report.finish();
}
