// The rate loop of flight_controller.hpp at 8 kHz with a gyro filter of 4 ms and motors that lag by
// 30 ms: how fast it follows, what a gust does, and which settings it refuses.
//
// Plant       y' = b v + d, tau v' = u - v, b = 600 rad/s^2, abs(u) <= 1; gyro: lag of 4 ms, noise
// Controller  RateAxis: omega_c = 20 .. 80 rad/s, omega_o = 2 omega_c

#include <algorithm>
#include <cmath>
#include <cstring>
#include <esokit/analysis/margins.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/gaussian.hpp>
#include <string>
#include <vector>

#include "guards/flight_controller.hpp"
#include "trades/trades.hpp"

using namespace esokit;
using namespace esokit::examples;
using guards::RateAxis;

namespace {

constexpr double rate_hz = 8000, lag = 0.03, filter = 0.004, gain = 600;

struct Flight {
  std::vector<double> t, wanted, rate, u, found, gust;
  double rise = 0;       ///< of the first step, 10 to 90 %, s
  double overshoot = 0;  ///< of it, %
  double deviation = 0;  ///< under the gust, rad/s
};

/// A step of 3 rad/s at 0.1 s, a gust of 60 rad/s^2 from 0.8 to 1.3 s.
/// @param given the lag of the motors that the controller is given
Flight fly(float bandwidth, double given = lag) {
  auto axis = RateAxis::make({.sample_time = static_cast<float>(1 / rate_hz),
                              .hover_gain = static_cast<float>(gain),
                              .motor_lag = static_cast<float>(given),
                              .gyro_delay = static_cast<float>(filter),
                              .controller_bandwidth = bandwidth})
                  .value();
  Flight flight;
  sim::Gaussian noise(4);
  double y = 0, v = 0, gyro = 0, u = 0, begin = 0;
  for (int k = 0; k < static_cast<int>(1.6 * rate_hz); ++k) {
    const double t = k / rate_hz;
    const double wanted = t < 0.1 ? 0 : 3;
    const double gust = t >= 0.8 && t < 1.3 ? 60 : 0;
    gyro += (y + 0.05 * noise.next() - gyro) / (filter * rate_hz);
    const double held = u;  // a sample later, by the bus
    u = static_cast<double>(
        axis.rate(static_cast<float>(gyro), static_cast<float>(wanted), 0.4f, true, false));
    if (k % 8 == 0) {
      flight.t.push_back(t);
      flight.wanted.push_back(wanted);
      flight.rate.push_back(y);
      flight.u.push_back(u);
      flight.found.push_back(static_cast<double>(axis.disturbance()));
      flight.gust.push_back(gust);
    }
    if (y < 0.3) begin = t;
    if (flight.rise == 0 && y >= 2.7) flight.rise = t - begin;
    if (t < 0.8) flight.overshoot = std::max(flight.overshoot, 100 * (y / 3 - 1));
    if (gust > 0) flight.deviation = std::max(flight.deviation, std::abs(y - wanted));
    v += (held - v) / (lag * rate_hz);
    y += (gain * v + gust) / rate_hz;
  }
  return flight;
}

/// The rule that refuses a config, "" if none does.
std::string refused(const RateAxis::Config& config) {
  const auto made = RateAxis::make(config);
  return made ? "" : made.error().rule;
}

/// Smallest modulus margin over sample times, lags and gyro delays, of bandwidths up to both
/// limits.
double least_margin() {
  using Wide = Adrc<Guarded<DelayedInput<ModelEso<ModelParts{.order = 1, .actuator = 1}>, 64>>>;
  double least = 1;
  for (const double sample_time : {1e-3, 2.5e-4, 1.25e-4}) {
    for (const double motor : {0.01, 0.02, 0.03, 0.05}) {
      for (const double gyro : {0.0, 0.001, 0.002, 0.004, 0.008}) {
        const double most = std::min(2.5 / motor, 0.4 / (gyro + sample_time));
        for (const double share : {0.3, 0.6, 0.999}) {
          Wide::Config config{.controller_bandwidth = share * most,
                              .limits = {.lower = -1, .upper = 1}};
          config.observer.observer.observer = {.observer_bandwidth = 2 * share * most,
                                               .input_gain = gain,
                                               .sample_time = sample_time,
                                               .model = {.actuator = {motor}}};
          config.observer.observer.delay = static_cast<int>(gyro / sample_time + 0.5);
          const auto loop = Wide::make(config);
          for (const double real : {0.7, 1.0, 1.3}) {
            const auto chain = LinearPlant<1>::chain({.input_gain = gain}).value();
            const auto plant =
                with_lag(with_lag(chain, real * motor).value(), std::max(gyro, 1e-6)).value();
            const auto found = loop ? margins(plant, *loop) : loop.error();
            least = std::min(least, found ? found->modulus.value : 0.0);
          }
        }
      }
    }
  }
  return least;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "trades", "drone",
                trades::about("The rate loop of a drone",
                              "One axis at 8 kHz with a gyro filter of 4 ms and motors that lag by "
                              "30 ms: bandwidth, a gust, and settings that are refused."));
  const Flight slow = fly(20);
  const Flight middle = fly(40);
  const Flight fast = fly(80);
  const auto row = [&](const char* name, const Flight& flight) {
    report.expect(name, "rise of a step, 10 to 90 % (ms)", 1e3 * flight.rise, true, "reported");
    report.expect(name, "overshoot (%)", flight.overshoot, flight.overshoot < 20, "below 20");
    report.expect(name, "largest deviation under the gust (rad/s)", flight.deviation, true,
                  "reported");
  };
  row("20 rad/s", slow);
  row("40 rad/s", middle);
  row("80 rad/s", fast);
  report.expect("bandwidth", "rise at 80 over that at 20 rad/s", fast.rise / slow.rise,
                fast.rise < 0.7 * slow.rise, "below 0.7");
  report.expect("bandwidth", "deviation at 80 over that at 20 rad/s",
                fast.deviation / slow.deviation, fast.deviation < 0.4 * slow.deviation,
                "below 0.4");
  const Flight guessed = fly(80, 0.02);
  row("80 rad/s, given a motor lag of 20 ms", guessed);

  const RateAxis::Config good{.sample_time = 1.25e-4f, .gyro_delay = 4e-3f};
  const auto names = [&](const char* what, RateAxis::Config config, const char* rule) {
    const bool is = std::strcmp(rule, refused(config).c_str()) == 0;
    report.expect("refused", what, is ? 1 : 0, is, *rule == '\0' ? "not refused" : rule);
  };
  auto config = good;
  names("gyro filter of 4 ms at 8 kHz", config, "");
  config.gyro_delay = 8.2e-3f;
  config.controller_bandwidth = 10;
  names("gyro filter of 8.2 ms at 8 kHz", config,
        "must be at most MostDelay sample times, which is");
  config = good;
  config.motor_lag = 0.03f;
  config.controller_bandwidth = 83;
  names("83 rad/s with motors of 30 ms", config, "");
  config.controller_bandwidth = 84;
  names("84 rad/s with motors of 30 ms", config, "must be at most 2.5 / motor_lag, which is");
  config = good;
  config.controller_bandwidth = 98;
  names("98 rad/s with a gyro filter of 4 ms", config,
        "must be at most 0.4 / (gyro_delay + sample_time), which is");
  config.controller_bandwidth = 0;
  names("0 rad/s", config, "must be finite and positive");
  config = good;
  config.sample_time = 0;
  names("no sample time", config, "must be finite and positive");
  const double least = least_margin();
  report.expect("within both limits", "least modulus margin, motor 30 % faster or slower", least,
                least > 0.45, "above 0.45");

  Figure figure("drone", {.rows = 3, .columns = 1, .panel_height = 130});
  figure.caption(
      "A step of the wanted rate at 0.1 s and a gust from 0.8 to 1.3 s, at three bandwidths. The "
      "motors lag by 30 ms, the gyro's filter takes 4 ms, 8 kHz.");
  const Column t = fast.t;
  figure.panel(0, 0)
      .y_label("rate (rad/s)")
      .hide_x_numbers()
      .legend(Legend::above)
      .line(t, fast.wanted, {.name = "wanted", .color = Color::grey, .width = 1})
      .line(t, slow.rate, {.name = "20 rad/s", .color = Color::orange})
      .line(t, middle.rate, {.name = "40 rad/s", .color = Color::green})
      .line(t, fast.rate, {.name = "80 rad/s", .color = Color::blue});
  figure.panel(1, 0)
      .y_label("u (-)")
      .hide_x_numbers()
      .line(t, slow.u, {.color = Color::orange})
      .line(t, middle.u, {.color = Color::green})
      .line(t, fast.u, {.color = Color::blue});
  figure.panel(2, 0)
      .x_label("t (s)")
      .y_label("gust (rad/s^2)")
      .legend(Legend::above)
      .line(t, fast.gust, {.name = "gust", .color = Color::black, .dash = Dash::dashed})
      .line(t, slow.found, {.name = "found at 20", .color = Color::orange})
      .line(t, middle.found, {.name = "at 40", .color = Color::green})
      .line(t, fast.found, {.name = "at 80 rad/s", .color = Color::blue});
  report.add(figure);
  return report.finish();
}
