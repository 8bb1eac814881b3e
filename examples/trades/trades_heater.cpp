// The heater of heater.hpp on the energy balance of a temperature lab: steps by hand, what identify
// finds in their log, the loop with it, and a PI beside it.
//
// Plant       m c T' = U A (Ta - T) + eps sigma A (Ta^4 - T^4) + alpha Q, the sensor 16.4 s behind;
//             m 0.004 kg, c 500, A 1.2e-3 m^2, U 5 W/(m^2 K), eps 0.9, alpha 6.4e-3 W / %, Ta 23.5
//             degC
// Sensor      steps of 0.1 degC, T = 1 s; 20 samples get lost at 1300 s; a fan doubles U at 1600 s
// Steps       100, 5, 70, 20 and 50 % by hand, 20 minutes
// Controller  settling time 150 s; PI of the internal model rule for the same settling time

#include "trades/heater.hpp"

#include <algorithm>
#include <cmath>
#include <esokit/identify/identify.hpp>
#include <limits>
#include <sstream>

#include "common/compiled/study.hpp"
#include "trades/trades.hpp"

using namespace esokit::examples;
using trades::Heater;

namespace {

constexpr double room = 23.5;

struct Trace {
  std::vector<double> t, y, wanted, power;
};

double wanted(double t) { return t < 60 ? room : t < 1000 ? 55 : 45; }

/// The heater and its sensor.
struct Lab {
  double heater = room;
  double sensor = room;

  [[nodiscard]] double shown() const { return 0.1 * std::round(sensor / 0.1); }

  void second(double power, bool fan) {
    for (int i = 0; i < 20; ++i) {
      const double area = 1.2e-3;
      const double convection = (fan ? 10.0 : 5.0) * area * (room - heater);
      const double radiation =
          0.9 * 5.67e-8 * area * (std::pow(room + 273.15, 4) - std::pow(heater + 273.15, 4));
      sensor += 0.05 * (heater - sensor) / 16.4;
      heater += 0.05 * (convection + radiation + 6.4e-3 * power) / (0.004 * 500);
    }
  }
};

template <class Step>
Trace run(Step&& step) {
  Trace trace;
  Lab lab;
  for (int k = 0; k < 2400; ++k) {
    const bool lost = 1300 <= k && k < 1320;
    const double power =
        step(lost ? std::numeric_limits<double>::quiet_NaN() : lab.shown(), wanted(k));
    trace.t.push_back(k);
    trace.y.push_back(lab.heater);
    trace.wanted.push_back(wanted(k));
    trace.power.push_back(power);
    lab.second(power, k >= 1600);
  }
  return trace;
}

double most(const Trace& trace, int from, int to, double sign) {
  double largest = 0;
  for (int k = from; k < to; ++k) {
    const auto i = static_cast<std::size_t>(k);
    largest = std::max(largest, sign * (trace.y[i] - trace.wanted[i]));
  }
  return largest;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "trades", "heater",
      trades::about("A temperature loop",
                    "Order 1 with a slow sensor, power from 0 to 100 %, losses unknown."));
  std::ostringstream rows;
  Lab lab;
  Heater by_hand = Heater::make({}).value();
  by_hand.log_to(&rows);
  for (int k = 0; k < 1200; ++k) {
    const double power = k < 10    ? 0
                         : k < 200 ? 100
                         : k < 400 ? 5
                         : k < 600 ? 70
                         : k < 900 ? 20
                                   : 50;
    by_hand.manual(lab.shown(), power);
    lab.second(power, false);
  }
  const auto found = compiled::identify(trades::rows_of(rows.str())).value();
  const std::string log = "log of 20 min by hand";
  report.check_reference(log, "heating (degC/s per %)", 6.4e-3 / (0.004 * 500),
                         found.input_gain.value, 0.02, "as simulated");
  report.check_reference(log, "sensor lag (s)", 16.4, found.latency.value, 0.05, "as simulated");

  Heater heater =
      Heater::make({.heating = found.input_gain.value, .sensor_lag = found.latency.value}).value();
  heater.manual(room, 0);
  const Trace ours = run([&](double y, double r) { return heater.step(y, r); });

  // SIMC of the slope and the sensor's lag: gain 1 / (b0 (tau_c + theta)), integral 4 (tau_c +
  // theta).
  const double together = 37.5 + found.latency.value;
  const double gain = 1 / (found.input_gain.value * together);
  double integral = 0;
  double last = 0;
  const Trace pi = run([&](double y, double r) {
    if (!std::isfinite(y)) return last;
    const double e = r - y;
    const double u = gain * e + integral;
    last = std::clamp(u, 0.0, 100.0);
    if (u == last) integral += gain * e / (4 * together);
    return last;
  });

  for (const auto& [name, trace] : {std::pair{"PI", &pi}, std::pair{"ADRC", &ours}}) {
    report.expect(name, "overshoot after the step (degC)", most(*trace, 60, 1000, 1), true, "");
    report.expect(name, "undershoot after the step down (degC)", most(*trace, 1060, 1600, -1), true,
                  "");
    report.expect(name, "dip by the fan (degC)", most(*trace, 1600, 2400, -1), true, "");
  }
  const double dip = most(ours, 1600, 2400, -1) / most(pi, 1600, 2400, -1);
  report.expect("ADRC", "dip by the fan, of the PI's", dip, dip < 0.7, "below 0.7");
  const double settled = most(ours, 460, 500, 1) + most(ours, 460, 500, -1);
  report.expect("ADRC", "power before the step (%)",
                *std::max_element(ours.power.begin(), ours.power.begin() + 60), ours.power[59] == 0,
                "the heater is at rest where it is wanted");
  report.expect("ADRC", "error 400 s after the step (degC)", settled, settled < 0.3,
                "within the steps of the sensor");

  Figure figure("heater", {.rows = 2, .columns = 1, .panel_height = 190});
  figure.caption(
      "Temperature of the heater and power: a step up and down, 20 lost samples at 1300 s, a fan "
      "at "
      "1600 s.");
  figure.panel(0, 0)
      .y_label("T (°C)")
      .hide_x_numbers()
      .legend(Legend::above)
      .line(ours.t, ours.wanted, {.name = "wanted", .color = Color::black, .dash = Dash::dashed})
      .line(pi.t, pi.y, {.name = "PI", .color = Color::grey})
      .line(ours.t, ours.y, {.name = "ADRC, sensor in the model", .color = Color::blue});
  figure.panel(1, 0)
      .x_label("t (s)")
      .y_label("power (%)")
      .line(pi.t, pi.power, {.color = Color::grey})
      .line(ours.t, ours.power, {.color = Color::blue});
  report.add(figure);
  return report.finish();
}
