// Logs of real machines, identified, beside what is independently known of them.
//
// Way: logs as they were recorded. The sets are beside the repository (their notes have source,
// licence and what is known); --data names their folder. A set that is not there is left out.

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <esokit/identify/identify.hpp>

#include "common/log_file.hpp"
#include "common/report.hpp"

using namespace esokit::examples;
using esokit::Identified;
using esokit::IdentifyOptions;
using esokit::Log;

namespace {

struct Machine {
  std::string name;
  Identified found;
  std::string verdict;
  bool drawn = false;
};

class Machines {
 public:
  Machines(Report& report, std::filesystem::path data) : report_(report), data_(std::move(data)) {}

  [[nodiscard]] bool has(const char* set) const {
    const bool there = std::filesystem::is_directory(data_ / set);
    std::printf("%s%s\n", there ? "" : "skipped: there is no ", set);
    return there;
  }

  [[nodiscard]] LogFile read(const std::string& file,
                             const std::vector<std::string>& columns) const {
    return {data_ / file, columns};
  }

  /// Studies a log, with a row in the table. The reference holds until the next call.
  const Identified& study(const std::string& name, const Log& log, const std::string& known,
                          const IdentifyOptions& options = {}, bool drawn = false) {
    const auto found = esokit::study(log, options);
    Machine machine{name, {}, "accepted", drawn};
    if (!found) {
      machine.verdict = std::string("refused: ") + found.error().field;
      lines_.push_back({name, known, "", "", "", "", "", "", machine.verdict});
    } else {
      machine.found = *found;
      if (const auto ok = esokit::judge(*found, log, options); !ok) {
        machine.verdict = std::string("refused: ") + ok.error().field;
      }
      const auto both = [](const esokit::Estimate& e, double unit) {
        return number_text(unit * e.value, 3) + " ± " + number_text(unit * e.half_width, 2);
      };
      lines_.push_back({name, known, std::to_string(found->order), both(found->input_gain, 1),
                        both(found->lag, 1e3), both(found->dead_time, 1e3), both(found->noise, 1),
                        std::to_string(found->averaged), machine.verdict});
    }
    machines_.push_back(machine);
    return machines_.back().found;
  }

  [[nodiscard]] bool refused() const { return machines_.back().verdict != "accepted"; }

  void finish() {
    if (lines_.empty()) return;
    report_.table("machines",
                  "What was found, with 95 % intervals, beside what is known. Refused logs show "
                  "their numbers, too: they say why",
                  {"log", "known", "order", "b0", "lag (ms)", "dead time (ms)", "noise", "averaged",
                   "verdict"},
                  lines_);
    struct Curves {
      std::string title;
      std::vector<double> w, b0, low, high;
      double read;
    };
    std::vector<Curves> all;
    for (const Machine& machine : machines_) {
      const auto& points = machine.found.plateau.points;
      if (!machine.drawn || points.size() < 3) continue;
      Curves curves{machine.name, {}, {},
                    {},           {}, points[machine.found.plateau.middle].fit.at.bandwidth};
      const double size = std::abs(machine.found.input_gain.value);
      for (const auto& point : points) {
        const double value = point.fit.linear[0], error = 2 * point.errors.linear[0];
        // What is not known at all would hide the rest.
        if (!(error < size) || std::abs(value) > 3 * size) continue;
        curves.w.push_back(point.fit.at.bandwidth);
        curves.b0.push_back(value);
        curves.low.push_back(value - error);
        curves.high.push_back(value + error);
      }
      if (curves.w.size() >= 2) all.push_back(std::move(curves));
    }
    Figure figure("plateaus", {.rows = (all.size() + 1) / 2, .columns = 2, .panel_height = 150});
    figure.caption(
        "b0 over the bandwidth w of the filter, with two standard errors; lag, dead time and pole "
        "fitted anew at each. Dashed: where b0 was read. A machine is known where the curve is "
        "flat; where it is not, b0 is one number a band.");
    for (std::size_t i = 0; i < all.size(); ++i) {
      figure.panel(i / 2, i % 2)
          .title(all[i].title)
          .x_label("w (rad/s)")
          .y_label("b0")
          .log_x()
          .name("machine" + std::to_string(i + 1))
          .band(all[i].w, all[i].low, all[i].high,
                {.color = Color::sky, .opacity = 0.3, .column = "b0 +- 2 se"})
          .line(all[i].w, all[i].b0, {.color = Color::blue, .column = "b0"})
          .vertical_line(all[i].read);
    }
    report_.add(figure);
  }

 private:
  Report& report_;
  std::filesystem::path data_;
  std::vector<Machine> machines_;
  std::vector<CsvRow> lines_;
};

constexpr double degree = 3.14159265358979323846 / 180;

void crazyflie(Report& report, Machines& machines) {
  const LogFile file = machines.read("crazyflie_motor_lag/roll_pitch.csv",
                                     {"t_s", "gx_dps", "gy_dps", "m1", "m2", "m3", "m4"});
  for (const bool roll : {true, false}) {
    Log log;
    log.time = file.column(0);
    for (std::size_t k = 0; k < file.rows(); ++k) {
      const double m1 = file.column(3)[k], m2 = file.column(4)[k];
      const double m3 = file.column(5)[k], m4 = file.column(6)[k];
      log.u.push_back((roll ? -m1 - m2 + m3 + m4 : -m1 + m2 + m3 - m4) / 65536);
      log.y.push_back(file.column(roll ? 1 : 2)[k] * degree);
    }
    const std::string name = roll ? "Crazyflie, roll" : "Crazyflie, pitch";
    // Bench (another airframe): b0 370 and 368; the source: a motor lag of 72 ms.
    const double bench = (roll ? 370 : 368) / 0.072;
    (void)machines.study(name + ", rate", log,
                         roll ? "b0 370, lag 72 ms (bench)" : "b0 368, lag 72 ms (bench)", {},
                         roll);
    IdentifyOptions twin;
    twin.orders = {2};
    twin.pole = false;
    twin.averaged = 8;
    const Identified& second = machines.study(name + ", as order 2", log,
                                              "b0/lag " + number_text(bench, 4) + " (bench)", twin);
    report.check_reference(name, "as order 2: b0, bench b0/lag", bench, second.input_gain.value,
                           0.1, "bench numbers of another airframe, 10 % is the tightest claim");
  }
  const LogFile other =
      machines.read("crazyflie_motor_lag/yaw.csv", {"t_s", "gz_dps", "m1", "m2", "m3", "m4"});
  Log log;
  log.time = other.column(0);
  for (std::size_t k = 0; k < other.rows(); ++k) {
    log.u.push_back(
        (-other.column(2)[k] + other.column(3)[k] - other.column(4)[k] + other.column(5)[k]) /
        65536);
    log.y.push_back(other.column(1)[k] * degree);
  }
  const Identified& yaw =
      machines.study("Crazyflie, yaw, rate", log, "b0 36 (bench), order 1", {}, true);
  report.expect("Crazyflie, yaw", "order", yaw.order, yaw.order == 1, "1");
  report.check_reference("Crazyflie, yaw", "b0", 36, yaw.input_gain.value, 0.1, "bench");
}

Log angle_log(const LogFile& file, bool gravity) {
  Log log;
  log.time = file.column(0);
  log.u = file.column(1);
  log.y = file.column(2);
  if (gravity) {
    log.columns.emplace_back();
    for (const double y : log.y) log.columns[0].push_back(-std::sin(y));
  }
  return log;
}

void pendulum(Report& report, Machines& machines) {
  for (const char* name : {"ddp", "direct_collocation"}) {
    const LogFile file = machines.read(std::string("dfki_simple_pendulum/") + name + ".csv",
                                       {"t_s", "u_Nm", "y_rad"});
    const std::string title =
        std::string(name) == "ddp" ? "pendulum, ddp" : "pendulum, collocation";
    const Identified& found =
        machines.study(title, angle_log(file, true),
                       "b0 6.69, m g l / J 20.0 (weighed); noise 0.84 mrad", {}, true);
    report.expect(title, "order", found.order, found.order == 2, "2");
    report.check_reference(title, "noise (mrad)", 0.84, 1e3 * found.noise.value, 0.1,
                           "steps of 2.9 mrad over sqrt(12)");
    const auto& likely = found.orders[1].fit.at;
    report.check(title, "dead time at the bandwidth of the likelihood (ms)", std::nullopt,
                 1e3 * likely.latency, std::nullopt, "16 to 18 expected");
    report.check(title, "b0 there", std::nullopt, found.orders[1].fit.linear[0]);
    if (!found.columns.empty()) {
      report.check(title, "m g l / J (1/s2)", std::nullopt, found.columns[0].value, std::nullopt,
                   "20.0 by weighed parts");
    }
  }
}

void mass_change(Report& report, Machines& machines) {
  double b0[2] = {};
  for (const int run : {0, 1}) {
    const LogFile file = machines.read(
        std::string("dfki_pendulum_mass_change/energy_shaping") + (run == 0 ? "" : "_1kg") + ".csv",
        {"t_s", "u_Nm", "y_rad"});
    IdentifyOptions options;
    options.orders = {2};
    options.averaged = 1;
    options.friction = false;
    options.pole = false;
    const Identified& found = machines.study(
        run == 0 ? "energy shaping" : "energy shaping, 1 kg", angle_log(file, false),
        run == 0 ? "b0 6.69 (weighed), below 20 rad/s" : "b0 3.80 if the weight is 1.0 kg", options,
        true);
    for (const auto& point : found.plateau.points) {
      // 10 to 20 rad/s, where the notes beside the data read it.
      if (point.fit.at.bandwidth < 15) b0[run] = point.fit.linear[0];
    }
    report.expect(run == 0 ? "energy shaping" : "energy shaping, 1 kg", "refused",
                  machines.refused() ? 1 : 0, machines.refused(),
                  "b0 depends on the bandwidth: no number may be given");
  }
  report.check("energy shaping", "b0 below 15 rad/s", std::nullopt, b0[0], std::nullopt,
               "5.2 to 6.2 by an independent trial");
  report.check("energy shaping, 1 kg", "b0 below 15 rad/s", std::nullopt, b0[1], std::nullopt,
               "3.2 to 3.7 by an independent trial");
  const LogFile still =
      machines.read("dfki_pendulum_mass_change/gravity_compensation.csv", {"t_s", "u_Nm", "y_rad"});
  (void)machines.study("gravity compensation", angle_log(still, false),
                       "u is a function of y: must be refused");
  report.expect("gravity compensation", "refused", machines.refused() ? 1 : 0, machines.refused(),
                "u is a function of y");
}

void servo(Report& report, Machines& machines) {
  const auto study = [&](const char* file, const char* title,
                         const IdentifyOptions& options) -> const Identified& {
    const LogFile log =
        machines.read(std::string("servo_relay_pid/") + file, {"t_s", "u_pct", "y_deg"});
    return machines.study(title, angle_log(log, false),
                          "b0 0.575 at 100 % (same record); steps of 3.5 deg", options, true);
  };
  const Identified& relay = study("relay.csv", "servo, relay", {});
  report.expect("servo, relay", "order", relay.order, relay.order == 1, "1");
  report.check_reference("servo, relay", "step of the encoder (deg)", 450.0 / 128,
                         relay.log.quantisation, 0.001, "10 bits");
  report.check_reference("servo, relay", "b0 (deg/s per %)", 0.575, relay.input_gain.value, 0.1,
                         "slew of the same record");
  report.check_reference("servo, relay", "noise (deg)", 450.0 / 128 / std::sqrt(12.0),
                         relay.noise.value, 0.25, "rounding alone; 1.25 by an independent trial");
  (void)study("pid_sine.csv", "servo, PID on a sine", {});
}

void tclab(Report& report, Machines& machines) {
  const LogFile file = machines.read("tclab_energy_balance/tclab.csv",
                                     {"t_s", "Q1_pct", "Q2_pct", "T1_degC", "T2_degC"});
  for (const std::size_t heater : {std::size_t{1}, std::size_t{2}}) {
    Log log;
    log.time = file.column(0);
    log.u = file.column(heater);
    log.y = file.column(2 + heater);
    IdentifyOptions options;
    options.orders = {1, 2};
    const std::string name = "TCLab, heater " + std::to_string(heater);
    const Identified& found =
        machines.study(name, log,
                       heater == 1 ? "b0 0.0032, lag 16.4 s (fitted to this record)"
                                   : "b0 0.0016, lag 16.4 s (fitted)",
                       options);
    report.check(name, "latency (s)", std::nullopt, found.latency.value);
  }
}

void acrobot(Machines& machines) {
  for (const std::size_t joint : {std::size_t{1}, std::size_t{2}}) {
    const std::string number = std::to_string(joint);
    const LogFile file = machines.read("dfki_acrobot_perturbed/run04.csv",
                                       {"t_s", "taumeas" + number + "_Nm", "y" + number + "_rad"});
    IdentifyOptions options;
    options.orders = {2};
    (void)machines.study("acrobot, run 04, joint " + number, angle_log(file, false),
                         joint == 1 ? "b0 16 to 22, with the pose" : "b0 33 to 71, with the pose",
                         options, joint == 2);
  }
}

}  // namespace

int main(int argc, char** argv) {
  // The sources are in examples/identify of the repository.
  const auto root = std::filesystem::path(__FILE__).parent_path().parent_path().parent_path();
  std::filesystem::path data = (root / ".." / "shared" / "data").lexically_normal();
  std::vector<char*> rest;
  for (int i = 0; i < argc; ++i) {
    if (std::string(argv[i]) == "--data" && i + 1 < argc) {
      data = argv[++i];
    } else {
      rest.push_back(argv[i]);
    }
  }
  Report report(static_cast<int>(rest.size()), rest.data(), "identify", "identify_machines",
                {.paper_title = "From a log to a model",
                 .citation = "No paper: order, b0, lag, dead time, friction and noise from logs, "
                             "with intervals",
                 .link = "",
                 .title = "Real machines",
                 .description = "Logs of real machines, identified, beside what is independently "
                                "known of them.",
                 .order = 2});
  try {
    Machines machines(report, data);
    if (machines.has("crazyflie_motor_lag")) crazyflie(report, machines);
    if (machines.has("dfki_simple_pendulum")) pendulum(report, machines);
    if (machines.has("dfki_pendulum_mass_change")) mass_change(report, machines);
    if (machines.has("servo_relay_pid")) servo(report, machines);
    if (machines.has("tclab_energy_balance")) tclab(report, machines);
    if (machines.has("dfki_acrobot_perturbed")) acrobot(machines);
    machines.finish();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "identify_machines: %s\n", error.what());
    return 2;
  }
  return report.finish();
}
