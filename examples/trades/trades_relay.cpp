// The heater of heater.hpp on a relay: TimeProportioned, with a loop as slow as its window and with
// one that is faster.
//
// Plant    m c T' = U A (Ta - T) + eps sigma A (Ta^4 - T^4) + alpha Q, the sensor 16.4 s behind, as
//          in trades_heater; T of the relay 0.1 s
// Sensor   steps of 0.1 degC
// Course   to 55 degC at 60 s, a fan doubles U at 1600 s, 2400 s

#include <algorithm>
#include <cmath>
#include <esokit/control/time_proportioned.hpp>
#include <string>
#include <utility>
#include <vector>

#include "trades/heater.hpp"
#include "trades/trades.hpp"

using namespace esokit::examples;
using esokit::TimeProportioned;
using trades::Heater;

namespace {

constexpr double room = 23.5, wanted = 55, tick = 0.1;

/// The heater and its sensor.
struct Lab {
  double heater = room;
  double sensor = room;

  [[nodiscard]] double shown() const { return 0.1 * std::round(sensor / 0.1); }

  void step(double power, bool fan) {
    for (int i = 0; i < 2; ++i) {
      const double area = 1.2e-3, h = tick / 2;
      const double convection = (fan ? 10.0 : 5.0) * area * (room - heater);
      const double radiation =
          0.9 * 5.67e-8 * area * (std::pow(room + 273.15, 4) - std::pow(heater + 273.15, 4));
      sensor += h * (heater - sensor) / 16.4;
      heater += h * (convection + radiation + 6.4e-3 * power) / (0.004 * 500);
    }
  }
};

/// How the power gets to the heater.
struct Way {
  double loop = 10;    // s; the sample time of the loop
  double window = 10;  // s; 0: no relay
  double least = 0;    // s; on and off
  bool says = true;    // whether the loop hears what went out
};

struct Trace {
  std::vector<double> t, y, asked;
  double switches = 0;

  /// About the wanted temperature, degC RMS.
  [[nodiscard]] double rms(double from, double to) const {
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      if (t[i] < from || t[i] >= to) continue;
      sum += (y[i] - wanted) * (y[i] - wanted);
      ++count;
    }
    return std::sqrt(sum / count);
  }
  [[nodiscard]] double dip(double from) const {
    double most = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      if (t[i] >= from) most = std::max(most, wanted - y[i]);
    }
    return most;
  }
};

Trace run(const Way& way) {
  Heater heater = Heater::make({.sensor_lag = 16.4, .sample_time = way.loop}).value();
  heater.manual(room, 0);
  const bool relay = way.window > 0;
  auto output = TimeProportioned<>::make({.off = 0,
                                          .on = 100,
                                          .window = relay ? way.window : tick,
                                          .least_on = way.least,
                                          .least_off = way.least,
                                          .sample_time = tick})
                    .value();
  Trace trace;
  Lab lab;
  double u = 0, last = 0, sent = 0;
  const int each = static_cast<int>(std::lround(way.loop / tick));
  for (int k = 0; k < 24000; ++k) {
    const double t = tick * k;
    if (k % each == 0) {
      // Of a loop that is faster than the window: what went out since its last sample.
      if (way.says && way.loop < way.window) heater.applied(sent / each);
      sent = 0;
      u = heater.step(lab.shown(), t < 60 ? room : wanted);
    }
    const double power = !relay ? u : output.update(u) ? 100 : 0;
    if (way.says && relay && way.loop >= way.window) heater.applied(output.applied());
    sent += power;
    if (k > 0 && relay && power != last) trace.switches += 1;
    last = power;
    lab.step(power, t >= 1600);
    trace.t.push_back(t);
    trace.y.push_back(lab.heater);
    trace.asked.push_back(u);
  }
  return trace;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "trades", "relay",
                trades::about("A heater on a relay",
                              "On or off in windows, with a loop as slow as the window and with "
                              "one that is faster."));
  const auto trial = [&](const std::string& name, const Way& way) {
    Trace trace = run(way);
    report.check(name, "error at rest (degC RMS)", std::nullopt, trace.rms(1000, 1600));
    report.check(name, "dip by the fan (degC)", std::nullopt, trace.dip(1600));
    report.check(name, "switches an hour", std::nullopt, trace.switches * 1.5);
    return trace;
  };
  trial("no relay", {.loop = 1, .window = 0});
  trial("window 2 s, loop 2 s", {.loop = 2, .window = 2});
  const Trace good = trial("window 10 s, loop 10 s", {});
  trial("window 10 s, least 4 s", {.least = 4});
  trial("window 10 s, least 4 s, not reported", {.least = 4, .says = false});
  const Trace long_one = trial("window 60 s, loop 60 s", {.loop = 60, .window = 60});
  const Trace bad = trial("window 60 s, loop 1 s", {.loop = 1, .window = 60});
  trial("window 60 s, loop 1 s, not reported", {.loop = 1, .window = 60, .says = false});
  const auto rms = [](const Trace& trace) { return trace.rms(1000, 1600); };
  report.expect("window 10 s, loop 10 s", "error over that of 60 s, loop 1 s", rms(good) / rms(bad),
                rms(good) < 0.1 * rms(bad), "below a tenth");
  report.expect("window 60 s, loop 1 s", "error over that of a loop of 60 s",
                rms(bad) / rms(long_one), rms(bad) > 1.5 * rms(long_one), "above 1.5");

  Figure figure("heater_relay", {.rows = 2, .columns = 1, .panel_height = 190});
  figure.caption(
      "A heater on a relay that is to be at 55 °C: a loop as slow as its window of 10 s, and one "
      "of 1 s in a window of 60 s.");
  const auto part = [](const std::vector<double>& all) {
    std::vector<double> some;
    for (std::size_t k = 10000; k < 13000; k += 5) some.push_back(all[k]);
    return some;
  };
  const auto lines = [&](std::size_t row, const char* label, const auto& of) -> Panel& {
    return figure.panel(row, 0)
        .y_label(label)
        .line(part(bad.t), part(bad.*of),
              {.name = row == 0 ? "loop 1 s, window 60 s" : "", .color = Color::grey})
        .line(part(good.t), part(good.*of),
              {.name = row == 0 ? "loop and window 10 s" : "", .color = Color::blue});
  };
  lines(0, "T (°C)", &Trace::y).hide_x_numbers().legend(Legend::above);
  lines(1, "power asked for (%)", &Trace::asked).x_label("t (s)");
  report.add(figure);
  return report.finish();
}
