// Logs of real machines, identified, beside what is independently known of them.
//
// Way: logs as they were recorded. examples/data/README.md has their source, licence and what is
// known.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <esokit/identify/identify.hpp>

#include "common/compiled/study.hpp"
#include "common/log_file.hpp"
#include "common/measured_data.hpp"
#include "common/parallel.hpp"
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
  explicit Machines(Report& report) : report_(report) {}

  [[nodiscard]] LogFile read(const std::string& file,
                             const std::vector<std::string>& columns) const {
    return {measured_data() / file, columns};
  }

  /// Studies a log, with a row in the table. The reference holds until the next call.
  const Identified& study(const std::string& name, const Log& log, const std::string& known,
                          const IdentifyOptions& options = {}, bool drawn = false) {
    return add(name, log, compiled::study(log, options), known, options, drawn);
  }

  /// The same of a study that was made before.
  const Identified& add(const std::string& name, const Log& log,
                        const esokit::Expected<Identified, esokit::Error<double>>& found,
                        const std::string& known, const IdentifyOptions& options = {},
                        bool drawn = false) {
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
  [[nodiscard]] const std::string& verdict() const { return machines_.back().verdict; }

  void finish() {
    report_.table("machines",
                  "What was found, with 95 % intervals, and what is known. The table also shows "
                  "the numbers of refused logs",
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
        "are fitted anew at each w. Dashed: where b0 was taken. Where the curve is flat, b0 is "
        "known; where it is not, b0 depends on the frequency.");
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

/// A force is no chain; its integral is one of order 1: b0 is what a newton of thrust gives,
/// 1/mass.
void thrust(Report& report, Machines& machines) {
  const LogFile file =
      machines.read("crazyflie_motor_lag/thrust.csv", {"t_s", "az_g", "m1", "m2", "m3", "m4"});
  Log log;
  log.time = file.column(0);
  double mean = 0;
  for (const double a : file.column(1)) mean += a / static_cast<double>(file.rows());
  double speed = 0;
  for (std::size_t k = 0; k < file.rows(); ++k) {
    // Of one motor, by the bench: 0.0677 m + 0.0915 m^2 N.
    double newton = 0;
    for (std::size_t motor = 2; motor < 6; ++motor) {
      const double m = file.column(motor)[k] / 65536;
      newton += 0.0677 * m + 0.0915 * m * m;
    }
    log.u.push_back(newton);
    log.y.push_back(speed);
    const double T = k + 1 < file.rows() ? log.time[k + 1] - log.time[k] : 0.0;
    speed += 9.81 * (file.column(1)[k] - mean) * T;
  }
  IdentifyOptions options;
  options.orders = {1};
  options.friction = false;
  options.pole = false;
  const Identified& found =
      machines.study("Crazyflie, thrust, integral of az", log,
                     "lag 72 ms (source); filter of az about 5 ms", options, true);
  report.check_reference("Crazyflie, thrust", "lag and dead time (ms)", 72,
                         1e3 * found.latency.value, 0.15,
                         "by the source on other logs of the same machine; 70 to 75 by a "
                         "regression on this one");
  report.check("Crazyflie, thrust", "mass, 1 / b0 (g)", std::nullopt, 1e3 / found.input_gain.value,
               std::nullopt, "27 bare; decks are not named");
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

/// b0 by the energy of the weighed pendulum, without any filter or lag. It is what the reported
/// torque should have done to v^2 / 2 + m g l / J (1 - cos y), less friction. @param friction a
/// column for it; not where u follows the speed, then the two are one
double b0_by_energy(const LogFile& file, std::size_t rows, bool friction) {
  constexpr double gravity = 20.04;  // m g l / J, weighed
  Eigen::MatrixXd columns(rows, friction ? 3 : 2);
  Eigen::VectorXd energy(rows);
  double work = 0, way = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    const double v = file.column(3)[k];
    energy(row) = v * v / 2 + gravity * (1 - std::cos(file.column(2)[k]));
    columns(row, 0) = work;
    columns(row, 1) = 1;
    if (friction) columns(row, 2) = -way;
    if (k + 1 < rows) {
      const double T = file.column(0)[k + 1] - file.column(0)[k];
      work += file.column(1)[k] * v * T;
      way += std::abs(v) * T;
    }
  }
  return columns.colPivHouseholderQr().solve(energy)(0);
}

/// One machine, four runs: m g l / J has no torque in it, b0 has. What is accepted has to agree
/// with the energy, which knows no lag, noise or bandwidth.
struct Swing {
  std::string name;
  double b0, half_width, gravity, energy, weighed;
  std::string verdict;
};

void pendulum(Report& report, Machines& machines, std::vector<Swing>& swings) {
  for (const char* name : {"ddp", "direct_collocation"}) {
    const LogFile file = machines.read(std::string("dfki_simple_pendulum/") + name + ".csv",
                                       {"t_s", "u_Nm", "y_rad", "v_rad_s"});
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
    const double energy = b0_by_energy(file, file.rows(), true);
    const double gravity = found.columns.empty() ? 0 : found.columns[0].gain.value;
    report.check(title, "m g l / J (1/s2)", std::nullopt, gravity, std::nullopt,
                 "20.0 by weighed parts");
    report.check(title, "b0 by the energy of the weighed pendulum", std::nullopt, energy);
    swings.push_back({title, found.input_gain.value, found.input_gain.half_width, gravity, energy,
                      6.69, machines.verdict()});
  }
}

void mass_change(Report& report, Machines& machines, std::vector<Swing>& swings) {
  double b0[2] = {};
  for (const int run : {0, 1}) {
    const LogFile file = machines.read(
        std::string("dfki_pendulum_mass_change/energy_shaping") + (run == 0 ? "" : "_1kg") + ".csv",
        {"t_s", "u_Nm", "y_rad", "v_rad_s"});
    IdentifyOptions options;
    options.orders = {2};
    options.averaged = 1;
    // u follows the speed, and so does friction: what there is of it is in b0.
    options.friction = false;
    options.pole = false;
    const std::string title = run == 0 ? "energy shaping" : "energy shaping, 1 kg";
    const std::string known = run == 0 ? "b0 6.69 (weighed), m g l / J 20.0"
                                       : "b0 3.80, m g l / J 19.9 if the weight is 1.0 kg";
    const Log whole = angle_log(file, true);
    (void)machines.study(title, whole, known, options, true);
    report.expect(title, "refused", machines.refused() ? 1 : 0, machines.refused(),
                  "thrown over by hand, 30 Hz in the gear: b0 depends on the bandwidth");
    // Until it is up, and before a hand throws it over: 4.3 and 8.3 s by the notes.
    const std::size_t rows = run == 0 ? 840 : 1640;
    Log up;
    const auto cut = [rows](const std::vector<double>& all) {
      return std::vector<double>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(rows));
    };
    up.time = cut(whole.time);
    up.u = cut(whole.u);
    up.y = cut(whole.y);
    up.columns = {cut(whole.columns[0])};
    const Identified& found = machines.study(title + ", swing-up alone", up, known, options, true);
    b0[run] = found.input_gain.value;
    const double gravity = found.columns.empty() ? 0 : found.columns[0].gain.value;
    report.check_reference(title, "swing-up: m g l / J (1/s2)", run == 0 ? 20.04 : 19.86, gravity,
                           0.1, "weighed parts, no torque in it");
    swings.push_back({title + ", swing-up", found.input_gain.value, found.input_gain.half_width,
                      gravity, b0_by_energy(file, rows, false), run == 0 ? 6.69 : 3.80,
                      machines.verdict()});
  }
  report.check_reference("energy shaping", "ratio of b0 with 1 kg", 3.80 / 6.69, b0[1] / b0[0], 0.2,
                         "if the weight is 1.0 kg; no claim is tighter than 20 %");
  const LogFile still =
      machines.read("dfki_pendulum_mass_change/gravity_compensation.csv", {"t_s", "u_Nm", "y_rad"});
  (void)machines.study("gravity compensation", angle_log(still, false),
                       "u is a function of y: must be refused");
  report.expect("gravity compensation", "refused", machines.refused() ? 1 : 0, machines.refused(),
                "u is a function of y");
}

void swing_table(Report& report, const std::vector<Swing>& swings) {
  std::vector<CsvRow> lines;
  for (const Swing& s : swings) {
    // No claim of these sets is tighter than 20 %, nor than the interval.
    report.expect(s.name, "b0 over that by the energy", s.b0 / s.energy,
                  s.verdict != "accepted" ||
                      std::abs(s.b0 - s.energy) < std::hypot(0.2 * s.energy, s.half_width),
                  "if accepted, off by at most 20 % and the interval, added as squares");
    lines.push_back({s.name, number_text(s.b0, 3) + " ± " + number_text(s.half_width, 2),
                     number_text(s.energy, 3), number_text(s.weighed, 3),
                     number_text(s.b0 / s.weighed, 2), number_text(s.gravity, 3), s.verdict});
  }
  report.table("torque",
               "The drive of the pendulum reports too much torque: m g l / J, which does not "
               "depend on the torque, is that of the weighed parts. b0 is too small, and so is b0 "
               "from the energy that the torque should have supplied",
               {"run", "b0", "b0 by energy", "b0 weighed", "found over weighed",
                "m g l / J (weighed 20.0 and 19.9)", "verdict"},
               lines);
}

void servo(Report& report, Machines& machines) {
  const auto study = [&](const char* file, const char* title, const IdentifyOptions& options,
                         bool drawn) -> const Identified& {
    const LogFile log =
        machines.read(std::string("servo_relay_pid/") + file, {"t_s", "u_pct", "y_deg"});
    return machines.study(title, angle_log(log, false),
                          "b0 0.575 at 100 % (same record); steps of 3.5 deg", options, drawn);
  };
  const Identified& relay = study("relay.csv", "servo, relay", {}, true);
  report.expect("servo, relay", "order", relay.order, relay.order == 1, "1");
  report.check_reference("servo, relay", "step of the encoder (deg)", 450.0 / 128,
                         relay.log.quantisation, 0.001, "10 bits");
  report.check_reference("servo, relay", "b0 (deg/s per %)", 0.575, relay.input_gain.value, 0.1,
                         "slew of the same record");
  report.check_reference("servo, relay", "noise (deg)", 450.0 / 128 / std::sqrt(12.0),
                         relay.noise.value, 0.25, "rounding alone; 1.25 by an independent trial");
  // Left to itself it takes order 2, of which b0 means nothing, and refuses it.
  (void)study("pid_sine.csv", "servo, PID on a sine, any order", {}, false);
  IdentifyOptions first;
  first.orders = {1};
  // The notes' speed over drive, from the same records: b0 is 1 if that is all.
  const auto speed = [](double drive) {
    constexpr double at[] = {0, 20, 25, 55, 85, 100}, deg[] = {0, 0, 21, 45, 57, 57};
    const double size = std::abs(drive);
    std::size_t i = 1;
    while (i < 5 && size > at[i]) ++i;
    const double share = std::min((size - at[i - 1]) / (at[i] - at[i - 1]), 1.0);
    return std::copysign(deg[i - 1] + share * (deg[i] - deg[i - 1]), drive);
  };
  struct Record {
    const char *file, *title, *known;
    double trial;
  };
  for (const auto& [file, title, known, trial] :
       {Record{"relay.csv", "servo, relay", "", 0},
        {"pid_sine.csv", "servo, PID on a sine", "b0 0.58 to 0.66 at 2 to 25 rad/s (trial)", 1.01},
        {"pid_step.csv", "servo, PID on steps", "b0 0.64 to 0.67 at 2 to 12 rad/s (trial)", 1.14},
        {"repetitive_sine.csv", "servo, repetitive", "b0 0.33 to 0.63 at 2 to 25 rad/s (trial)",
         0.58}}) {
    Log log = angle_log(
        machines.read(std::string("servo_relay_pid/") + file, {"t_s", "u_pct", "y_deg"}), false);
    const std::string name = title;
    if (trial > 0) {
      const Identified& found = machines.study(name + ", order 1", log, known, first, true);
      double there = 0;
      for (const auto& point : found.plateau.points) {
        if (point.fit.at.bandwidth < 6) there = point.fit.linear[0];
      }
      report.check(name, "b0 as order 1, near 5 rad/s", std::nullopt, there, std::nullopt,
                   "in a trial " + number_text(0.575 * trial, 2));
    }
    for (double& u : log.u) u = speed(u);
    const Identified& found =
        machines.study(name + ", u by its curve", log, "b0 1 (curve of the same records)", first);
    report.check(name, "b0 as order 1, u by the curve of the drive", std::nullopt,
                 found.input_gain.value, std::nullopt, machines.verdict());
  }
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
    report.check(name, "latency (s)", std::nullopt, found.latency.value, std::nullopt,
                 "20 is a thirtieth of the log, the longest that is looked for");
    if (heater != 1) continue;
    // Without that end, at bandwidths between those of the plateau and of the likelihood.
    const auto rows = compiled::prepare(log);
    for (const double w : {0.05, 0.1, 0.2}) {
      const esokit::Fit free = compiled::minimised(
          rows->data, {1, 1, true}, {0.01, 1.5, 0.05, 40.0, 0.5}, {w, 15.0, 0.7, 0.003});
      report.check_reference(name, "lag, latency up to 40 s, w = " + number_text(w, 2) + " (s)",
                             16.38, free.at.lag(), 0.25, "fitted to the same record by the notes");
    }
  }
}

/// Each joint with what the identified masses make of both torques, M^-1 tau, as u, gravity with
/// Coriolis and friction as columns: b0 and gravity are 1 if the masses are right.
void acrobot(Report& report, Machines& machines) {
  const std::vector<std::string> runs = {"01", "04", "05"};
  std::vector<Log> logs;
  for (const std::string& run : runs) {
    const LogFile file = machines.read(
        "dfki_acrobot_perturbed/run" + run + ".csv",
        {"t_s", "taumeas1_Nm", "taumeas2_Nm", "y1_rad", "y2_rad", "v1_rad_s", "v2_rad_s"});
    Log joint[2];
    for (Log& log : joint) {
      log.time = file.column(0);
      log.columns.resize(2);
    }
    joint[0].y = file.column(3);
    joint[1].y = file.column(4);
    for (std::size_t k = 0; k < file.rows(); ++k) {
      constexpr double I1 = .031887199591513114, I2 = .05086984812807257,
                       rotor = 6.287203962819607e-05, m1 = .5234602302310271,
                       m2 = .6255677234174437, l = .2, r1 = .2, r2 = .25569305436052964, g = 9.81;
      const double tau1 = file.column(1)[k], tau2 = file.column(2)[k];
      const double y1 = file.column(3)[k], y2 = file.column(4)[k];
      const double v1 = file.column(5)[k], v2 = file.column(6)[k];
      const double c = m2 * l * r2 * std::cos(y2), s = m2 * l * r2 * std::sin(y2);
      const double M11 = I1 + I2 + m2 * l * l + 2 * c + 37 * rotor, M12 = I2 + c - 6 * rotor,
                   M22 = I2 + 36 * rotor, det = M11 * M22 - M12 * M12;
      const double lower = m2 * g * r2 * std::sin(y1 + y2);
      const auto add = [&](double one, double two, std::vector<double>& at1,
                           std::vector<double>& at2) {
        at1.push_back((M22 * one - M12 * two) / det);
        at2.push_back((M11 * two - M12 * one) / det);
      };
      add(tau1, tau2, joint[0].u, joint[1].u);
      add(2 * s * v1 * v2 + s * v2 * v2 - (m1 * r1 + m2 * l) * g * std::sin(y1) - lower,
          -s * v1 * v1 - lower, joint[0].columns[0], joint[1].columns[0]);
      add(-.16 * std::atan(100 * v1), -.12 * std::atan(100 * v2), joint[0].columns[1],
          joint[1].columns[1]);
    }
    for (Log& log : joint) logs.push_back(std::move(log));
  }
  IdentifyOptions options;
  options.orders = {2};
  options.pole = false;
  options.friction = false;
  options.late_columns = false;  // gravity, Coriolis and friction act at once
  const auto found = run_parallel("acrobot", logs.size(), [&](std::size_t i) {
    return std::optional(compiled::study(logs[i], options));
  });
  std::vector<double> gains[2];
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const std::size_t joint = i % 2;
    const Identified& one =
        machines.add("acrobot, run " + runs[i / 2] + ", joint " + std::to_string(joint + 1),
                     logs[i], *found[i], "b0 1: u by the source's masses", options, i == 3);
    gains[joint].push_back(one.input_gain.value);
  }
  for (const std::size_t joint : {std::size_t{0}, std::size_t{1}}) {
    std::sort(gains[joint].begin(), gains[joint].end());
    report.check("acrobot, joint " + std::to_string(joint + 1), "b0, median of three runs",
                 std::nullopt, gains[joint][1], std::nullopt,
                 joint == 0
                     ? "1 by the source's masses; 0.89 +- 0.11 from injected pulses (notes)"
                     : "1 by the source's masses; 0.95 +- 0.16 from injected pulses (notes)");
  }
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "identify", "identify_machines",
      {.paper_title = "From a log to a model",
       .citation =
           "No paper. Order, b0, lag, dead time, friction and noise from logs, with intervals",
       .link = "",
       .title = "Real machines",
       .description = "Logs of real machines are identified, and the results are compared with "
                      "what is known independently.",
       .order = 2});
  try {
    Machines machines(report);
    std::vector<Swing> swings;
    crazyflie(report, machines);
    thrust(report, machines);
    pendulum(report, machines, swings);
    mass_change(report, machines, swings);
    servo(report, machines);
    tclab(report, machines);
    acrobot(report, machines);
    machines.finish();
    swing_table(report, swings);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "identify_machines: %s\n", error.what());
    return 2;
  }
  return report.finish();
}
