// Random plants of orders 1 to 3 behind the limits of their actuators: does the controller that
// tune recommends recover from loads, kicks, steps and a lost actuator?
//
// Way: a model with intervals, as a log gives it (overload.hpp), and tune with its defaults. The
// first design runs as an Adrc on a machine with friction, gravity, a second lag, a sensor's lag
// and an encoder that the model does not have. A load pulse as large as u can balance is 100 %. An
// event counts if u can hold its end, and where gravity lets the machine fall, if bang-bang with
// the true state brings it back after one 1 / 0.6 times as large. A PID by the rules of SIMC from
// the same model, with the same limits and the noise in u that is allowed, goes through the same
// events. After load pulses of 50 % there are two more. One is tuned with the true b as those are
// that record the logs of identify/, one is SIMC slowed until it is as quiet as our design.
//
// symbol   code                     value
// back     -                        abs(y - r) below 2 % of its peak + 4 deviations of the noise
// horizon  80 / omega_c             omega_c: mean of the law's n slowest poles (with a lag in the
//                                   law, k_0^(1/(n+1)) is faster than the loop); back in the
//                                   last of four
// slow                              not so, but back if one waits as long as tune's own play
//                                   does: 25 times the event
// locked                            not back, and more than a fifth of the last horizon at a limit
// hunting                           not back, and y oscillates by more than half of its error, off
//                                   the limits
// drifting                          else not back
//
// Order 3 is recommended only if it stands friction, which no model has: an actuator that
// integrates, friction, and the integral of the observer oscillate for ever. What then is not
// recommended is said with its reason, and the runs that a design without this rule would lose are
// not counted.
//
// --machines N --seed S: so many machines, of another draw; the page shows the few that every run
// has time for. --priced N: J without the rules of the first N.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <esokit/tune/tuned_controller.hpp>

#include "choosing/overload.hpp"
#include "common/compiled/tune.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"

using namespace esokit::examples;
using namespace overload_example;

namespace {

/// A controller whose type is forgotten.
struct AnyController {
  virtual ~AnyController() = default;
  virtual double update(double y, const std::array<double, 4>& r) = 0;
  virtual void start(double y, double u) = 0;
  [[nodiscard]] virtual double softness() const { return 1.0; }
  [[nodiscard]] virtual std::unique_ptr<AnyController> copy() const = 0;
};

template <class Controller>
struct Held final : AnyController {
  explicit Held(const Controller& c) : controller(c) {}
  double update(double y, const std::array<double, 4>& r) override {
    esokit::Vector<double, Controller::order + 1> motion;
    for (int i = 0; i <= Controller::order; ++i) motion(i) = r[static_cast<std::size_t>(i)];
    return controller.update(y, motion);
  }
  void start(double y, double u) override { (void)controller.start(y, u); }
  [[nodiscard]] double softness() const override { return controller.softness(); }
  [[nodiscard]] std::unique_ptr<AnyController> copy() const override {
    return std::make_unique<Held>(*this);
  }
  Controller controller;
};

struct HeldPid final : AnyController {
  explicit HeldPid(const Pid& p) : pid(p) {}
  double update(double y, const std::array<double, 4>& r) override { return pid.update(y, r[0]); }
  void start(double y, double u) override { pid.start(y, u); }
  [[nodiscard]] std::unique_ptr<AnyController> copy() const override {
    return std::make_unique<HeldPid>(*this);
  }
  Pid pid;
};

enum class Kind { back, slow, locked, hunting, drifting };
constexpr std::array<const char*, 5> kinds{"back", "slow", "locked up", "hunting", "drifting"};

struct Played {
  Kind kind = Kind::back;
  double peak = 0.0;        ///< largest abs(y - r)
  double integral = 0.0;    ///< of abs(y - r), in four horizons
  double late = 0.0;        ///< largest abs(y - r) in the last horizon, in deviations of the noise
  double late_share = 0.0;  ///< the same over the peak
  double at_limits = 0.0;   ///< share of the last horizon
};

/// One event, from rest at 0.
Played played(const Machine& m, const AnyController& fresh, const Event& event, double omega_c,
              std::uint64_t seed) {
  Running machine(m, event.away, seed);
  const auto controller = fresh.copy();
  const Profile profile(m, event.target);
  const double T = m.T;
  const auto first = static_cast<long>(std::lround(20.0 / omega_c / T)) + 50;
  const double last_act =
      std::max({event.load_time, event.off_time, event.profile ? profile.duration() : 0.0});
  const auto rest = static_cast<long>(std::lround((320.0 / omega_c + last_act) / T));
  const auto looked_at = static_cast<long>(std::lround(80.0 / omega_c / T));
  // For what is not back: as long as play.hpp waits.
  const auto patience = static_cast<long>(25.0 * std::max(last_act, 30.0 * m.latency) / T);
  const double start_y = machine.measured();
  controller->start(event.away != 0.0 ? 0.0 : start_y, event.away != 0.0 ? 0.0 : m.held_at(0.0));
  const double noise = std::hypot(m.noise, m.resolution / std::sqrt(12.0));
  Played result;
  double late = 0.0, lowest = 0.0, highest = 0.0;
  long limited = 0;
  const long begin = event.away != 0.0 ? 0 : first;
  long k = 0;
  // Until sample `end`, looking at the last horizon.
  const auto run_until = [&](long end) {
    for (; k < end; ++k) {
      const double t = static_cast<double>(k - begin) * T;
      const bool on = k >= begin;
      if (k == begin && event.kick != 0.0) machine.kick(event.kick);
      std::array<double, 4> r{};
      if (on) {
        if (event.profile)
          r = profile.at(t);
        else
          r[0] = event.target;
      }
      double u = controller->update(machine.measured(), r);
      if (on && t < event.off_time) u = 0.0;
      machine.sample(u, on && t < event.load_time ? event.load : 0.0);
      if (!on) continue;
      const double e = machine.y() - r[0];
      result.peak = std::max(result.peak, std::abs(e));
      if (k < begin + rest) result.integral += T * std::abs(e);
      if (k < end - looked_at) continue;
      const bool first_look = k == end - looked_at;
      late = first_look ? std::abs(e) : std::max(late, std::abs(e));
      lowest = first_look ? e : std::min(lowest, e);
      highest = first_look ? e : std::max(highest, e);
      limited = (first_look ? 0 : limited) + (u <= m.lower() || u >= m.upper() ? 1 : 0);
    }
    return late <= 0.02 * result.peak + 4.0 * noise;
  };
  if (!run_until(begin + rest)) {
    result.kind = run_until(begin + rest + patience + looked_at) ? Kind::slow
                  : 5 * limited > looked_at                      ? Kind::locked
                  : 0.5 * (highest - lowest) > 0.5 * late        ? Kind::hunting
                                                                 : Kind::drifting;
  }
  result.late = late / noise;
  result.late_share = late / result.peak;
  result.at_limits = static_cast<double>(limited) / static_cast<double>(looked_at);
  return result;
}

/// Whether the event counts, see the head of this file.
bool counts(const Machine& m, const Event& event) {
  if (event.profile && !Profile(m, event.target).possible(m)) return false;
  for (const double y : {0.0, event.target, event.away}) {
    // A speed is held against friction, too.
    const double rubs = m.order == 1 && y != 0.0 ? m.friction / std::abs(m.b) : 0.0;
    if (std::abs(m.held_at(y) - m.middle) + rubs > 0.9 * m.half_range) return false;
  }
  const double rate = m.falls(event.target);
  if (!(rate > 0.0)) return true;
  // Bang-bang on the direction in which it falls.
  Running machine(m, event.away, 1);
  const auto samples = static_cast<long>((event.load_time + event.off_time + 20.0 / rate) / m.T);
  if (event.kick != 0.0) machine.kick(event.kick / 0.6);
  double start = 0.0, end = 0.0;
  for (long k = 0; k < samples; ++k) {
    const double t = static_cast<double>(k) * m.T;
    const double z = machine.falling(event.target, rate);
    double u = (z * m.b > 0.0 ? m.lower() : m.upper());
    if (t < event.off_time / 0.6) u = 0.0;
    machine.sample(u, t < event.load_time ? event.load / 0.6 : 0.0, true);
    start = std::max(start, std::abs(z));
    end = std::abs(z);
  }
  return end <= 0.2 * start;
}

/// Without an event, at rest at 0.
struct Idle {
  double noise = 0.0;     ///< standard deviation of u
  double softness = 1.0;  ///< the least
};
Idle idle(const Machine& m, const AnyController& fresh, double omega_c, std::uint64_t seed) {
  Running machine(m, 0.0, seed);
  const auto controller = fresh.copy();
  controller->start(machine.measured(), m.held_at(0.0));
  const auto settled = static_cast<long>(std::lround(20.0 / omega_c / m.T)) + 50;
  constexpr long samples = 5000;
  Idle result;
  double sum = 0.0, squares = 0.0;
  for (long k = -settled; k < samples; ++k) {
    const double u = controller->update(machine.measured(), {});
    machine.sample(u, 0.0);
    result.softness = std::min(result.softness, controller->softness());
    if (k < 0) continue;
    const double off = u - m.held_at(0.0);
    sum += off;
    squares += off * off;
  }
  result.noise = std::sqrt(std::max(squares - sum * sum / samples, 0.0) / samples);
  return result;
}

/// The PIDs that a design is compared with.
constexpr std::array<const char*, 3> rivals{"the PID of the log", "SIMC, as noisy as ours",
                                            "SIMC, as fast as its rule and 5 % noise allow"};

struct Outcome {
  int order = 0;
  bool designed = false;
  std::string design;
  std::string alarms;                    ///< their names; none: recommended
  double ratio = 0.0;                    ///< k_1 / k_0 over the latency
  double friction = 0.0, gravity = 0.0;  ///< share of half the range (order 3: of 10 latencies)
  std::vector<std::string> names;
  std::vector<bool> counted;
  std::vector<Played> own, pid;  ///< of the events that count, else empty ones; `pid`: the fastest
  bool compared = false;         ///< with the baselines, after load pulses of 50 %
  std::array<double, 3> peak{}, integral{};  ///< largest, ours over theirs
  double noise = 0.0;                        ///< standard deviation of u, idle
  std::array<double, 3> rival_noise{};       ///< the same
  std::optional<bool> acts{};                ///< order 2, softened and back from all: acts on noise
  std::optional<std::array<double, 3>> price{};  ///< see `price`
};

template <int Order>
Outcome with_order(const Drawn& all, const esokit::TunedDesign& design, std::uint64_t number) {
  Outcome outcome;
  const Machine& m = all.machine;
  outcome.designed = true;
  outcome.design = design.name;
  const auto& gains = design.settings.gains;
  outcome.ratio = design.damping_latencies;
  const double most = std::abs(m.b) * m.half_range * (Order == 3 ? 10.0 * m.latency : 1.0);
  outcome.friction = m.friction / most;
  outcome.gravity = m.gravity / most;
  const double omega_c = esokit::detail::law_mean(gains, Order);
  Dice dice(77 + number);
  const auto list = events(m, dice);
  const auto ok = esokit::with_controller<Order>(all.model, design, [&](const auto& controller) {
    const Held held(controller);
    const double usual = esokit::usual_control_noise * (all.model.u_max - all.model.u_min);
    const std::array<HeldPid, 3> pids{
        HeldPid(Pid::of_log(m, dice)),
        HeldPid(Pid::simc(all.model, std::min(design.control_noise, usual))),
        HeldPid(Pid::simc(all.model, usual))};
    for (const Event& event : list) {
      const bool is_counted = counts(m, event);
      outcome.names.push_back(event.name);
      outcome.counted.push_back(is_counted);
      outcome.own.push_back(is_counted ? played(m, held, event, omega_c, number) : Played{});
      outcome.pid.push_back(is_counted ? played(m, pids.back(), event, omega_c, number) : Played{});
      if (!is_counted || event.name.find("of 50 %") == std::string::npos) continue;
      outcome.compared = true;
      for (std::size_t i = 0; i < pids.size(); ++i) {
        const Played other = played(m, pids[i], event, omega_c, number);
        outcome.peak[i] = std::max(outcome.peak[i], outcome.own.back().peak / other.peak);
        outcome.integral[i] =
            std::max(outcome.integral[i], outcome.own.back().integral / other.integral);
      }
    }
    const Idle resting = idle(m, held, omega_c, number);
    outcome.noise = resting.noise;
    for (std::size_t i = 0; i < pids.size(); ++i) {
      outcome.rival_noise[i] = idle(m, pids[i], omega_c, number).noise;
    }
    const auto not_back = [](const Played& own) { return own.kind != Kind::back; };
    if (Order == 2 && design.settings.soften &&
        std::none_of(outcome.own.begin(), outcome.own.end(), not_back)) {
      outcome.acts = resting.softness < 1.0;
    }
  });
  if (!ok) outcome.design += " (" + std::string(ok.error().field) + ")";
  return outcome;
}

/// What coming back costs, in sqrt(J): the rules alone; the rules, in the problem with the floor of
/// the disturbance; both, with the disturbance that the log has.
std::optional<std::array<double, 3>> price(const esokit::TuneModel& model,
                                           const esokit::Tuning& tuning) {
  constexpr esokit::TuneRules free{
      .damping_latencies = 0.0, .bandwidth_ratio = 0.0, .simulate = esokit::TuneSimulation::none};
  auto free_of_log = free;
  free_of_log.filter_floor = 0.0;
  const auto unruled = compiled::tune(model, {}, free);
  const auto least = compiled::tune(model, {}, free_of_log);
  const auto ruled = compiled::tune(model, {}, {.filter_floor = 0.0});
  if (!unruled || !least || !ruled) return std::nullopt;
  for (const auto* each : {&*unruled, &*least, &*ruled}) {
    if (each->chosen() == nullptr) return std::nullopt;
  }
  const double best = least->chosen()->cost;
  const esokit::LoopCost cost(model, least->rules, 1e-3 * model.filter_bandwidth());
  return std::array<double, 3>{
      std::sqrt(ruled->chosen()->cost / best),
      std::sqrt(tuning.chosen()->cost / unruled->chosen()->cost),
      std::sqrt(cost(tuning.chosen()->controller).cost(least->rho, model.input_gain.value) / best)};
}

Outcome play(std::uint64_t seed, std::uint64_t number, bool priced) {
  const Drawn all = drawn(seed, number);
  Outcome outcome;
  outcome.order = all.machine.order;
  const auto tuning = compiled::tune(all.model);
  if (!tuning || tuning->chosen() == nullptr) {
    outcome.design = !tuning ? std::string(tuning.error().field) + " " + tuning.error().rule
                     : tuning->designs.front().feasible
                         ? "none recovers, the first not from " + tuning->designs.front().lost
                         : "none keeps the rules: " + tuning->designs.front().constraint;
    return outcome;
  }
  const auto& design = *tuning->chosen();
  outcome = all.machine.order == 1   ? with_order<1>(all, design, number)
            : all.machine.order == 2 ? with_order<2>(all, design, number)
                                     : with_order<3>(all, design, number);
  outcome.order = all.machine.order;
  for (const auto& alarm : esokit::alarms(*tuning, design)) {
    outcome.alarms += (outcome.alarms.empty() ? "" : " ") + std::string(alarm.name);
  }
  if (priced) outcome.price = price(all.model, *tuning);
  return outcome;
}

/// Quantile of numbers in any order, 0 of none.
double quantile(std::vector<double> all, double share) {
  if (all.empty()) return 0.0;
  std::sort(all.begin(), all.end());
  return all[static_cast<std::size_t>(share * static_cast<double>(all.size() - 1))];
}

/// Pulses up to 100 %, and the profile.
bool is_small(const std::string& name) {
  return name == "profile" ||
         (name.find("pulse") != std::string::npos && name.find("150") == std::string::npos);
}

}  // namespace

int main(int argc, char** argv) {
  const auto machines = static_cast<std::size_t>(take_count(argc, argv, "--machines", 12));
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  const auto priced = static_cast<std::size_t>(take_count(argc, argv, "--priced", 3));
  Report report(
      argc, argv, "choosing", "overload",
      {.paper_title = "Choosing an observer",
       .citation = "Our own numbers; the observers are those of the papers",
       .link = "",
       .title = "Does a recommended design recover from an overload?",
       .description = "Random plants behind limits, with friction, gravity, a lag and an "
                      "encoder that the model does not have: load pulses, kicks, steps and "
                      "a lost actuator."});
  const auto outcomes =
      run_parallel("machines", machines, [&](std::size_t i) { return play(seed, i, i < priced); });
  // name -> order -> {counted, stuck}, and the same of the PID
  struct Cell {
    int counted = 0, stuck = 0, pid = 0;
  };
  std::map<std::string, std::array<Cell, 3>> table;
  std::vector<std::string> names;
  std::array<int, 3> designed{}, alarmed{}, count{}, bad{}, compared{};
  std::array<std::array<int, kinds.size()>, 3> of_kind{}, pid_too{};
  // By order and baseline.
  std::array<std::array<int, rivals.size()>, 3> better{};
  std::array<std::array<std::vector<double>, rivals.size()>, 3> peaks, integrals, noises;
  std::array<std::array<std::vector<double>, 3>, 3> prices;
  int sound = 0, acting = 0;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& o = outcomes[i];
    const auto n = static_cast<std::size_t>(o.order - 1);
    ++count[n];
    if (!o.designed) {
      std::printf("  machine %zu, order %d: no design: %s\n", i, o.order, o.design.c_str());
      continue;
    }
    ++designed[n];
    alarmed[n] += o.alarms.empty() ? 0 : 1;
    bool small_lost = false;
    for (std::size_t r = 0; r < rivals.size() && o.compared; ++r) {
      better[n][r] += o.peak[r] <= 1.0 && o.integral[r] <= 1.0 ? 1 : 0;
      peaks[n][r].push_back(o.peak[r]);
      integrals[n][r].push_back(o.integral[r]);
      noises[n][r].push_back(o.rival_noise[r] / o.noise);
    }
    compared[n] += o.compared ? 1 : 0;
    sound += o.acts ? 1 : 0;
    acting += o.acts.value_or(false) ? 1 : 0;
    for (std::size_t r = 0; r < 3 && o.price; ++r) prices[n][r].push_back((*o.price)[r]);
    for (std::size_t e = 0; e < o.names.size(); ++e) {
      if (!table.contains(o.names[e])) names.push_back(o.names[e]);
      auto& cell = table[o.names[e]][n];
      if (!o.counted[e]) continue;
      const Played& own = o.own[e];
      const Played& pid = o.pid[e];
      ++cell.counted;
      cell.pid += pid.kind != Kind::back ? 1 : 0;
      if (own.kind == Kind::back) continue;
      ++cell.stuck;
      ++of_kind[n][static_cast<std::size_t>(own.kind)];
      if (pid.kind != Kind::back) ++pid_too[n][static_cast<std::size_t>(own.kind)];
      small_lost = small_lost || is_small(o.names[e]);
      std::printf(
          "  machine %zu, order %d, %s%s: not back after %s: %s (%.2g of the horizon at a limit, "
          "error %.3g deviations of the noise and %.2g of the peak; friction %.2g, gravity %.2g of "
          "u; k_1 / k_0 = %.3g latencies); PID: %s, %.3g deviations\n",
          i, o.order, o.design.c_str(),
          o.alarms.empty() ? "" : (" with an alarm (" + o.alarms + ")").c_str(), o.names[e].c_str(),
          kinds[static_cast<std::size_t>(own.kind)], own.at_limits, own.late, own.late_share,
          o.friction, o.gravity, o.ratio, kinds[static_cast<std::size_t>(pid.kind)], pid.late);
    }
    bad[n] += small_lost ? 1 : 0;
  }
  std::vector<CsvRow> rows;
  std::array<int, 3> stuck{}, small{}, runs_beyond{}, beyond{};
  for (const std::string& name : names) {
    CsvRow row{name};
    for (std::size_t n = 0; n < 3; ++n) {
      const Cell& cell = table[name][n];
      row.push_back(std::to_string(cell.stuck) + " of " + std::to_string(cell.counted) + " (PID " +
                    std::to_string(cell.pid) + ")");
      stuck[n] += cell.stuck;
      (is_small(name) ? small[n] : beyond[n]) += cell.stuck;
      if (!is_small(name)) runs_beyond[n] += cell.counted;
    }
    rows.push_back(row);
  }
  report.table("overload", "Runs that did not recover, of those that count",
               {"event", "order 1", "order 2", "order 3"}, rows);
  std::vector<CsvRow> explained;
  for (std::size_t kind = 1; kind < kinds.size(); ++kind) {
    CsvRow row{kinds[kind]};
    for (std::size_t n = 0; n < 3; ++n) {
      row.push_back(std::to_string(of_kind[n][kind]) + " (" + std::to_string(pid_too[n][kind]) +
                    ")");
    }
    explained.push_back(row);
  }
  report.table("kinds", "How they did not; in brackets: nor did the PID",
               {"kind", "order 1", "order 2", "order 3"}, explained);
  std::vector<CsvRow> against, costs;
  for (std::size_t n = 0; n < 3; ++n) {
    const std::string order = std::to_string(n + 1);
    for (std::size_t i = 0; i < rivals.size() && compared[n] > 0; ++i) {
      against.push_back(
          {order, rivals[i], std::to_string(better[n][i]) + " of " + std::to_string(compared[n]),
           number_text(quantile(peaks[n][i], 0.5), 2), number_text(quantile(peaks[n][i], 0.9), 2),
           number_text(quantile(integrals[n][i], 0.5), 2),
           number_text(quantile(integrals[n][i], 0.9), 2),
           number_text(quantile(noises[n][i], 0.5), 2)});
    }
    const std::array<const char*, 3> of{"rules", "rules, with the floor",
                                        "rules and floor, under the disturbance of the log"};
    for (std::size_t i = 0; i < of.size(); ++i) {
      if (prices[n][i].empty()) continue;
      costs.push_back({order, of[i], std::to_string(prices[n][i].size()),
                       number_text(quantile(prices[n][i], 0.5), 4),
                       number_text(quantile(prices[n][i], 0.9), 4)});
    }
  }
  report.table("baselines", "After load pulses of 50 %, ours over theirs: 1 is as good",
               {"order", "PID", "peak and IAE both better", "peak, median", "p90", "IAE, median",
                "p90", "noise in u, theirs over ours"},
               against);
  report.table("price", "What coming back costs: sqrt(J) over that without",
               {"order", "of", "machines", "median", "p90"}, costs);
  report.check("orders 1 and 2", "not back after pulses up to 100 % and after the profile", {},
               small[0] + small[1]);
  const auto share = [](int part, int whole) {
    return static_cast<double>(part) / static_cast<double>(std::max(whole, 1));
  };
  report.check("orders 1 and 2", "not back after the other events (share)", {},
               share(beyond[0] + beyond[1], runs_beyond[0] + runs_beyond[1]));
  report.check("order 3", "machines not back after pulses up to 100 % or the profile (share)", {},
               share(bad[2], designed[2]));
  for (std::size_t i = 0; i < rivals.size(); ++i) {
    report.check(
        rivals[i], "both better, pulses of 50 % (share)", {},
        share(better[0][i] + better[1][i] + better[2][i], compared[0] + compared[1] + compared[2]));
  }
  report.check("order 2", "softening acts on noise alone, of those back from all (share)", {},
               share(acting, sound));
  report.check("orders 1 and 2", "machines with a design (share)", {},
               share(designed[0] + designed[1], count[0] + count[1]));
  report.check("order 3", "machines with a design that stands friction (share)", {},
               share(designed[2], count[2]));
  std::printf("not back in all, by order: %d %d %d\n", stuck[0], stuck[1], stuck[2]);
  for (std::size_t n = 0; n < 3; ++n) {
    std::printf(
        "order %zu: %d of %d machines designed (%d with an alarm), %d with a small event lost; "
        "beyond %d of %d runs\n",
        n + 1, designed[n], count[n], alarmed[n], bad[n], beyond[n], runs_beyond[n]);
  }
  return report.finish();
}
