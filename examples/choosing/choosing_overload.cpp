// Drawn machines of orders 1 to 3 behind the limits of their actuators: does the controller that
// tune recommends come back after loads, kicks, steps and a lost actuator?
//
// Way: a model with intervals, as a log gives it (overload.hpp); tune with its defaults; the first
// design as the Adrc that runs, on a machine with friction, gravity, a second lag, a sensor's lag
// and an encoder that the model does not have. A load pulse as large as u can balance is 100 %. An
// event counts if u can hold its end, and where gravity lets the machine fall, if bang-bang with
// the true state brings it back after one 1 / 0.6 times as large.
//
// symbol   code                     value
// back     -                        abs(y - r) below 2 % of its peak + 4 deviations of the noise
// horizon  80 / omega_c             omega_c = k_0^(1/n); back after four, for the rest of it
// limits
//
// --machines N --seed S: so many machines, of another draw; the page shows the few that every run
// has time for.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <esokit/tune/controller.hpp>

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
  [[nodiscard]] std::unique_ptr<AnyController> copy() const override {
    return std::make_unique<Held>(*this);
  }
  Controller controller;
};

struct Played {
  bool back = false;
  double peak = 0.0;  ///< largest abs(y - r)
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
  const double start_y = machine.measured();
  controller->start(event.away != 0.0 ? 0.0 : start_y, event.away != 0.0 ? 0.0 : m.held_at(0.0));
  const double noise = std::hypot(m.noise, m.resolution / std::sqrt(12.0));
  Played result;
  double late_peak = 0.0;
  const long begin = event.away != 0.0 ? 0 : first;
  for (long k = 0; k < begin + rest; ++k) {
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
    const double e = std::abs(machine.y() - r[0]);
    result.peak = std::max(result.peak, e);
    if (k >= begin + rest - looked_at) late_peak = std::max(late_peak, e);
  }
  result.back = late_peak <= 0.02 * result.peak + 4.0 * noise;
  return result;
}

/// Whether the event counts, see the head of this file.
bool counts(const Machine& m, const Event& event) {
  if (event.profile && !Profile(m, event.target).possible(m)) return false;
  for (const double y : {0.0, event.target, event.away}) {
    if (m.order == 2 && std::abs(m.held_at(y) - m.middle) > 0.9 * m.half_range) return false;
  }
  const double rate = m.falls(event.target);
  if (!(rate > 0.0)) return true;
  // Bang-bang on y + y' / rate: the direction in which it falls.
  Running machine(m, event.away, 1);
  const auto samples = static_cast<long>((event.load_time + event.off_time + 20.0 / rate) / m.T);
  if (event.kick != 0.0) machine.kick(event.kick / 0.6);
  double start = 0.0, end = 0.0;
  for (long k = 0; k < samples; ++k) {
    const double t = static_cast<double>(k) * m.T;
    const double z = machine.y() - event.target + machine.speed() / rate;
    double u = (z * m.b > 0.0 ? m.lower() : m.upper());
    if (t < event.off_time / 0.6) u = 0.0;
    machine.sample(u, t < event.load_time ? event.load / 0.6 : 0.0, true);
    start = std::max(start, std::abs(z));
    end = std::abs(z);
  }
  return end <= 0.2 * start;
}

struct Outcome {
  int order = 0;
  bool designed = false;
  std::string design;
  double ratio = 0.0;  ///< k_1 / k_0 over the latency
  double lone = 0.0;   ///< latency of the model
  std::vector<std::string> names;
  std::vector<int> back;  ///< 1, 0, or -1: does not count
};

template <int Order>
Outcome with_order(const Drawn& all, const esokit::TunedDesign& design, std::uint64_t number) {
  Outcome outcome;
  const Machine& m = all.machine;
  outcome.designed = true;
  outcome.design = design.name;
  const auto& gains = design.settings.gains;
  outcome.lone =
      all.model.lag + all.model.dead_time + all.model.sensor + m.T + all.model.latency_half_width;
  if (gains.size() > 1) outcome.ratio = gains[1] / gains[0] / outcome.lone;
  const double omega_c = std::pow(gains[0], 1.0 / static_cast<double>(gains.size()));
  Dice dice(77 + number);
  const auto list = events(m, dice);
  const auto ok = esokit::with_controller<Order>(all.model, design, [&](const auto& controller) {
    const Held held(controller);
    for (const Event& event : list) {
      outcome.names.push_back(event.name);
      outcome.back.push_back(
          !counts(m, event) ? -1 : (played(m, held, event, omega_c, number).back ? 1 : 0));
    }
  });
  if (!ok) outcome.design += " (" + std::string(ok.error().field) + ")";
  return outcome;
}

Outcome play(std::uint64_t seed, std::uint64_t number) {
  const Drawn all = drawn(seed, number);
  Outcome outcome;
  outcome.order = all.machine.order;
  const auto tuning = compiled::tune(all.model);
  if (!tuning || tuning->chosen() == nullptr) {
    outcome.design =
        tuning ? "none feasible" : std::string(tuning.error().field) + " " + tuning.error().rule;
    return outcome;
  }
  const auto& design = *tuning->chosen();
  outcome = all.machine.order == 1   ? with_order<1>(all, design, number)
            : all.machine.order == 2 ? with_order<2>(all, design, number)
                                     : with_order<3>(all, design, number);
  outcome.order = all.machine.order;
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  const auto machines = static_cast<std::size_t>(take_count(argc, argv, "--machines", 12));
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  Report report(
      argc, argv, "choosing", "overload",
      {.paper_title = "Choosing an observer",
       .citation = "Our own numbers; the observers are those of the papers",
       .link = "",
       .title = "Does a recommended design come back after an overload?",
       .description = "Drawn machines behind limits, with friction, gravity, a lag and an "
                      "encoder that the model does not have: load pulses, kicks, steps and "
                      "a lost actuator."});
  const auto outcomes =
      run_parallel("machines", machines, [seed](std::size_t i) { return play(seed, i); });
  // name -> order -> {counted, stuck}
  std::map<std::string, std::array<std::array<int, 2>, 3>> table;
  std::vector<std::string> names;
  std::array<int, 3> designed{}, count{};
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& o = outcomes[i];
    const auto n = static_cast<std::size_t>(o.order - 1);
    ++count[n];
    if (!o.designed) {
      std::printf("  machine %zu, order %d: no design: %s\n", i, o.order, o.design.c_str());
      continue;
    }
    ++designed[n];
    for (std::size_t e = 0; e < o.names.size(); ++e) {
      if (!table.contains(o.names[e])) names.push_back(o.names[e]);
      auto& cell = table[o.names[e]][n];
      if (o.back[e] < 0) continue;
      ++cell[0];
      if (o.back[e] > 0) continue;
      ++cell[1];
      std::printf("  machine %zu, order %d, %s: not back after %s (k_1 / k_0 = %.3g latencies)\n",
                  i, o.order, o.design.c_str(), o.names[e].c_str(), o.ratio);
    }
  }
  std::vector<CsvRow> rows;
  std::array<int, 3> stuck{}, small{};
  for (const std::string& name : names) {
    CsvRow row{name};
    for (std::size_t n = 0; n < 3; ++n) {
      const auto [counted, not_back] = table[name][n];
      row.push_back(std::to_string(not_back) + " of " + std::to_string(counted));
      stuck[n] += not_back;
      const bool beyond = name.find("pulse") == std::string::npos && name != "profile";
      if (!beyond && name.find("150") == std::string::npos) small[n] += not_back;
    }
    rows.push_back(row);
  }
  report.table("overload", "Runs that did not come back, of those that count",
               {"event", "order 1", "order 2", "order 3"}, rows);
  report.check("orders 1 and 2", "not back after pulses up to 100 % and after the profile", {},
               small[0] + small[1]);
  report.check(
      "all", "machines with a design (share)", {},
      static_cast<double>(designed[0] + designed[1] + designed[2]) / static_cast<double>(machines));
  std::printf("not back in all, by order: %d %d %d\n", stuck[0], stuck[1], stuck[2]);
  return report.finish();
}
