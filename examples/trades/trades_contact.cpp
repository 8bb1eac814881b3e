// A joint that meets an obstacle: from which dhat on it is one. How often the alarm of
// `disturbance_alarm` comes without an obstacle, and how long after a load, against what it says.
// For orders 1 to 3, both signs of b0, and noise that is not white.
//
// Plant       y^(n) = b0 u + d, b0 = 20 or -20; the joint: n = 2, J = 0.05 kg m^2
// Sensor      white noise, sd 1e-4 rad; or through a filter of 2 ms; or 16384 counts a turn
// Controller  omega_c = 15 rad/s, omega_o = 60 rad/s, 1 kHz
// Obstacle    a spring of 5 N m/rad, met at 0.5 rad/s
// Runs        4 hours and 1000 loads for each order and sign; seeds used nowhere else

#include <algorithm>
#include <array>
#include <cmath>
#include <esokit/analysis/disturbance_alarm.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "common/parallel.hpp"
#include "trades/trades.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr double T = 1e-3, inertia = 0.05, spread = 1e-4, hours = 4;
constexpr double count = 2 * std::numbers::pi / 16384;
constexpr long samples = static_cast<long>(hours * 3600 / T);
constexpr std::array rates{6.0, 60.0, 600.0};  // asked for, an hour

template <int Order>
struct Joint {
  explicit Joint(double sign)
      : b0(sign / inertia),
        adrc(Adrc<LinearEso<Order>>::make(
                 {.observer = {.observer_bandwidth = 60, .input_gain = b0, .sample_time = T},
                  .controller_bandwidth = 15})
                 .value()) {}

  /// One sample. @return dhat
  double step(double measured, double wanted, double d) {
    const double rate = b0 * adrc.update(measured, wanted) + d;
    const auto before = x;
    for (std::size_t i = 0; i < x.size(); ++i) {
      double term = 1;
      x[i] = 0;
      for (std::size_t j = i; j < x.size(); ++j) {
        x[i] += term * before[j];
        term *= T / static_cast<double>(j - i + 1);
      }
      x[i] += term * rate;
    }
    return adrc.observer().total_disturbance();
  }

  [[nodiscard]] DisturbanceAlarm alarm(const DisturbanceAlarmConfig& config) const {
    const auto plant = LinearPlant<Order>::chain({.input_gain = b0}).value();
    return disturbance_alarm(plant, adrc, config).value();
  }

  double b0;
  Adrc<LinearEso<Order>> adrc;
  std::array<double, static_cast<std::size_t>(Order)> x{};
};

/// Counts the samples at which dhat comes beyond a threshold.
struct Counter {
  double threshold;
  int side = 0;
  double alarms = 0;

  void look(double dhat) {
    const int now = dhat >= threshold ? 1 : dhat <= -threshold ? -1 : 0;
    if (now != 0 && now != side) ++alarms;
    side = now;
  }
};

DisturbanceAlarmConfig config_of(double rate, double load = 0) {
  return {.false_alarms_per_hour = rate, .load = load, .noise = {.measurement = {spread}}};
}

struct Found {
  std::array<double, rates.size()> alarms{};  ///< false ones, an hour
  DisturbanceAlarm said;                      ///< for one an hour and twice the least load
  std::vector<double> delays;                 ///< measured, sorted
};

template <int Order>
Found measure(double sign, std::uint64_t seed) {
  sim::Gaussian gaussian(seed);
  Joint<Order> joint(sign);
  std::array<Counter, rates.size()> counters{};
  for (std::size_t i = 0; i < rates.size(); ++i) {
    counters[i].threshold = joint.alarm(config_of(rates[i])).threshold;
  }
  for (long k = -10'000; k < samples; ++k) {
    const double dhat = joint.step(joint.x[0] + spread * gaussian.next(), 0, 0);
    for (Counter& each : counters) {
      if (k >= 0) each.look(dhat);
    }
  }
  Found found;
  for (std::size_t i = 0; i < rates.size(); ++i) found.alarms[i] = counters[i].alarms / hours;
  const double load = 2 * joint.alarm(config_of(1)).least_load;
  found.said = joint.alarm(config_of(1, load));
  for (int i = 0; i < 1000; ++i) {
    Joint<Order> fresh(sign);
    const double push = i % 2 == 0 ? load : -load;
    double after = -300;  // so long it is at rest
    while (after < 0 ||
           std::abs(fresh.adrc.observer().total_disturbance()) < found.said.threshold) {
      fresh.step(fresh.x[0] + spread * gaussian.next(), 0, after >= 0 ? push : 0);
      ++after;
    }
    found.delays.push_back((after - 1) * T);
  }
  std::sort(found.delays.begin(), found.delays.end());
  return found;
}

/// What the sensor shows of an angle in sample k.
using Sensor = double (*)(double angle, sim::Gaussian& gaussian, double& state);
struct OtherNoise {
  const char* name;
  double speed;  ///< rad/s at which the joint moves
  Sensor sensor;
};
double quantised(double angle, sim::Gaussian&, double&) {
  return count * std::round(angle / count);
}
double filtered(double angle, sim::Gaussian& gaussian, double& state) {
  // Of first order, with the standard deviation of the white one.
  const double a = std::exp(-T / 2e-3);
  state = a * state + std::sqrt(1 - a * a) * spread * gaussian.next();
  return angle + state;
}

struct Other {
  DhatNoise dhat;
  double by_white = 0, by_record = 0;  ///< false alarms an hour, 60 being asked for
};

/// An hour after a minute of record.
Other measure(const OtherNoise& of) {
  sim::Gaussian gaussian(7);
  Joint<2> joint(1);
  double state = 0, wanted = 0.4 * count;
  std::vector<double> record;
  auto config = config_of(60);
  config.noise.measurement = {of.sensor == filtered ? spread : count / std::sqrt(12.0)};
  Counter white{joint.alarm(config).threshold}, recorded{0};
  double mean = 0;
  for (long k = 0; k < 3'670'000; ++k) {
    wanted += of.speed * T;
    const double dhat = joint.step(of.sensor(joint.x[0], gaussian, state), wanted, 0);
    if (k >= 10'000 && k < 70'000) record.push_back(dhat);
    if (k == 70'000) {
      for (const double each : record) mean += each / static_cast<double>(record.size());
      config.measured = dhat_noise(record).value();
      recorded.threshold = joint.alarm(config).threshold;
    }
    if (k >= 70'000) {
      white.look(dhat - mean);
      recorded.look(dhat - mean);
    }
  }
  return {*config.measured, white.alarms, recorded.alarms};
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "trades", "contact",
                trades::about("A joint that meets an obstacle",
                              "The threshold on the estimated disturbance and the delay that "
                              "disturbance_alarm computes, against hours of simulated rest and "
                              "thousands of loads; then noise that is not white."));
  const auto found = run_parallel("4 hours at rest, 1000 loads", 6, [](std::size_t job) {
    const double sign = job < 3 ? 1 : -1;
    return job % 3 == 0   ? measure<1>(sign, job + 1)
           : job % 3 == 1 ? measure<2>(sign, job + 1)
                          : measure<3>(sign, job + 1);
  });
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto& [alarms, said, delays] = found[i];
    const std::string name = "order " + std::to_string(i % 3 + 1) + (i < 3 ? "" : ", b0 negative");
    for (std::size_t j = 0; j < rates.size(); ++j) {
      report.check_reference(name, "false alarms an hour, " + shown_text(rates[j]) + " asked for",
                             rates[j], alarms[j],
                             Tolerance::absolute(4 * std::sqrt(rates[j] / hours)), "computed");
    }
    const auto at = [&times = delays](double share) {
      return times[static_cast<std::size_t>(1000 * share)];
    };
    report.expect(name, "delay computed (ms)", 1e3 * said.delay, true, "reported");
    report.expect(name, "delay, median (ms)", 1e3 * at(0.5), at(0.5) <= said.delay + 1e-9,
                  "at most as computed");
    report.expect(name, "latest computed (ms)", 1e3 * said.latest, true, "reported");
    report.expect(name, "delay of 99 % (ms)", 1e3 * at(0.99), at(0.99) <= said.latest + 1e-9,
                  "at most as computed");
  }

  constexpr std::array others{OtherNoise{"filter of 2 ms", 0, filtered},
                              OtherNoise{"encoder, 0.5 rad/s", 0.5, quantised},
                              OtherNoise{"encoder, 0.002 rad/s", 0.002, quantised},
                              OtherNoise{"encoder, at rest", 0, quantised}};
  const auto not_white = run_parallel("noise that is not white", others.size(),
                                      [&](std::size_t job) { return measure(others[job]); });
  for (std::size_t i = 0; i < others.size(); ++i) {
    const auto& [dhat, by_white, by_record] = not_white[i];
    report.expect(others[i].name, "deviation of dhat (N m)", inertia * dhat.deviation, true,
                  "reported");
    report.expect(others[i].name, "false alarms an hour, taken for white", by_white, true,
                  "60 asked for");
    report.expect(others[i].name, "false alarms an hour, from the record", by_record,
                  by_record <= 60 + 5 * std::sqrt(60.0), "60 asked for: at most so many");
  }

  // The obstacle: a spring, which the joint meets at 0.5 rad/s.
  Joint<2> joint(1);
  const auto alarm = joint.alarm(config_of(1));
  sim::Gaussian gaussian(8);
  std::vector<double> t, seen, torque;
  double angle = 0, met = 0, stopped = 0;
  for (int k = 0; k < 1400; ++k) {
    angle += 0.5 * T;
    const double spring = 5 * std::max(0.0, joint.x[0] - 0.5);
    if (met <= 0 && spring > 0) met = k * T;
    const double dhat = joint.step(joint.x[0] + spread * gaussian.next(), angle, -spring / inertia);
    if (stopped <= 0 && k > 600 && std::abs(dhat) >= alarm.threshold) {
      stopped = k * T;
      report.expect("obstacle", "torque at the alarm (N m)", spring, true, "reported");
    }
    t.push_back(1e3 * k * T);
    torque.push_back(spring);
    seen.push_back(-inertia * dhat);
  }
  for (double& each : t) each -= 1e3 * met;
  report.expect("obstacle", "threshold (N m)", inertia * alarm.threshold, true, "reported");
  report.expect("obstacle", "least load, a step (N m)", inertia * alarm.least_load, true,
                "reported");
  report.expect("obstacle", "alarm after (ms)", 1e3 * (stopped - met), stopped > met, "after it");

  // Not noise: 5 rad/s^2 with an inertia that is 10 % larger than b0 says.
  report.expect("motion", "5 rad/s^2, inertia 10 % larger (thresholds)", 0.1 * 5 / alarm.threshold,
                true, "reported");

  Figure figure("contact", {.rows = 1, .columns = 2, .panel_height = 220});
  figure.caption(
      "Left: a joint meets a spring of 5 N m/rad at 0.5 rad/s; its torque, the estimate and, "
      "dotted, the threshold for one false alarm an hour. Right: false alarms counted in four "
      "hours, against "
      "what was asked for; crosses: b0 negative.");
  figure.panel(0, 0)
      .x_label("t after contact (ms)")
      .y_label("torque (N m)")
      .x_range(-50, 100)
      .y_range(-0.02, 0.2)
      .legend(Legend::top_left)
      .line(t, seen, {.name = "estimate", .color = Color::vermillion})
      .line(t, torque, {.name = "obstacle", .color = Color::black, .dash = Dash::dashed})
      .horizontal_line(inertia * alarm.threshold, {.color = Color::blue, .dash = Dash::dotted});
  auto& right = figure.panel(0, 1).x_label("false alarms asked for (1/h)").y_label("counted (1/h)");
  right.log_x().log_y().x_range(3, 1200).y_range(3, 1200).legend(Legend::top_left);
  right.line(rates, rates, {.name = "as computed", .color = Color::grey});
  constexpr std::array colors{Color::blue, Color::vermillion, Color::green};
  for (std::size_t i = 0; i < found.size(); ++i) {
    const std::string name = "n = " + std::to_string(i % 3 + 1);
    right.points(rates, found[i].alarms,
                 {.name = i < 3 ? name : "",
                  .color = colors[i % 3],
                  .marker = i < 3 ? Marker::open_circle : Marker::cross,
                  .column = i < 3 ? name : name + " negative"});
  }
  report.add(figure);
  return report.finish();
}
