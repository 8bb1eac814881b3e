// A nano quadrotor in free flight (Crazyflie): what the rate observer makes of the log with the
// motor's lag ignored and in the model. The log is in examples/data.
//
// Way: sampled observers on a measured log, as it was logged.
//
// Model  y' = d + v,  tau v' = b0 u(t - 4 ms) - v;  u in units of one motor, y in rad/s
//
// symbol   code         value      unit
// T        from the log 0.99e-3    s
// b0       gain         370, 368   rad/s^2, roll and pitch: another airframe, on the bench
// tau      lag          72         ms, by the authors of the log
// omega_o  observer     50         rad/s

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/observer/model_eso.hpp>

#include "common/log_file.hpp"
#include "common/measured_data.hpp"
#include "common/report.hpp"
#include "models/models.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace models;

namespace {

constexpr double lag = 0.072;
constexpr double observer = 50.0;
constexpr int delay = 4;
constexpr double loop_swing = 2 * std::numbers::pi * 6.5;  // rad/s

using Plain = DelayedInput<LinearEso<1>, 8>;
using Motor = DelayedInput<ModelEso<ModelParts{.order = 1, .actuator = 1}>, 8>;
using Swinging = DelayedInput<ModelEso<ModelParts{.order = 1, .actuator = 1, .resonators = 1}>, 8>;

struct Log {
  std::vector<double> t, y, u;
  double sample_time = 0;
};

Log read(const std::filesystem::path& file, bool pitch) {
  const LogFile log(file, {"t_s", pitch ? "gy_dps" : "gx_dps", "m1", "m2", "m3", "m4"});
  Log all;
  all.t = log.column(0);
  const double sign[4] = {-1, pitch ? 1.0 : -1.0, 1, pitch ? -1.0 : 1.0};
  for (std::size_t k = 0; k < log.rows(); ++k) {
    all.y.push_back(log.column(1)[k] * std::acos(-1.0) / 180);
    double u = 0;
    for (std::size_t i = 0; i < 4; ++i) u += sign[i] * log.column(2 + i)[k] / 65536;
    all.u.push_back(u);
  }
  all.sample_time = (all.t.back() - all.t.front()) / static_cast<double>(all.t.size() - 1);
  return all;
}

struct Found {
  std::vector<double> disturbance;
  double innovation = 0, deviation = 0;  ///< RMS of the innovation, rad/s; sd of d, rad/s^2
};

/// @param disturbance d of y' = d + v, of an observer
template <class Observer, class Disturbance>
Found found(const Log& log, Observer eso, const Disturbance& disturbance) {
  Found result;
  double squares = 0, sum = 0, sum_squares = 0, count = 0;
  for (std::size_t k = 1; k < log.y.size(); ++k) {
    (void)eso.update(log.y[k], log.u[k - 1]);
    const double d = disturbance(eso);
    result.disturbance.push_back(d);
    if (k < 500) continue;
    squares += eso.innovation() * eso.innovation();
    sum += d;
    sum_squares += d * d;
    ++count;
  }
  result.innovation = std::sqrt(squares / count);
  result.deviation = std::sqrt(sum_squares / count - sum * sum / (count * count));
  return result;
}

void axis(Report& report, const std::filesystem::path& file, bool pitch, std::vector<CsvRow>& lines,
          Figure& figure) {
  const Log log = read(file, pitch);
  const double gain = pitch ? 368 : 370;
  const auto plain = Plain::make({.observer = {.observer_bandwidth = observer,
                                               .input_gain = gain,
                                               .sample_time = log.sample_time},
                                  .delay = delay})
                         .value();
  const auto motor = [&](double tau) {
    return Motor::make({.observer = {.observer_bandwidth = observer,
                                     .input_gain = gain,
                                     .sample_time = log.sample_time,
                                     .model = {.actuator = {tau}}},
                        .delay = delay})
        .value();
  };
  const auto of_model = [](const auto& eso) {
    return eso.observer().model().constant(eso.estimate());
  };
  // Where the loop itself oscillates most: u has its peak there in both axes.
  const auto swinging =
      Swinging::make({.observer = {.observer_bandwidth = observer,
                                   .input_gain = gain,
                                   .sample_time = log.sample_time,
                                   .model = {.actuator = {lag}, .resonators = {{{loop_swing}}}}},
                      .delay = delay})
          .value();
  const Found ignored = found(log, plain, [](const Plain& eso) { return eso.total_disturbance(); });
  const Found known = found(log, motor(lag), of_model);
  const Found too_short = found(log, motor(0.7 * lag), of_model);
  const Found too_long = found(log, motor(1.3 * lag), of_model);
  const Found beside = found(log, swinging, of_model);
  const std::string name = pitch ? "pitch" : "roll";
  const auto line = [&](const char* what, const Found& f) {
    lines.push_back(
        {name + ", " + what, number_text(1000 * f.innovation, 3), number_text(f.deviation, 3)});
  };
  line("ignored", ignored);
  line("in the model", known);
  line("model 30 % short", too_short);
  line("model 30 % long", too_long);
  line("in the model, beside a resonator at 6.5 Hz", beside);
  report.expect(name, "RMS of the innovation, of that ignored",
                known.innovation / ignored.innovation, known.innovation < 0.8 * ignored.innovation,
                "below 0.8");
  report.expect(name, "sd of dhat, of that ignored", known.deviation / ignored.deviation,
                known.deviation < 0.6 * ignored.deviation, "below 0.6");
  std::vector<double> t, a, b;
  for (std::size_t k = 3000; k < 5000; k += 2) {
    t.push_back(log.t[k]);
    a.push_back(ignored.disturbance[k]);
    b.push_back(known.disturbance[k]);
  }
  figure.panel(pitch ? 1 : 0, 0)
      .title(name)
      .x_label("t (s)")
      .y_label("dhat (rad/s^2)")
      .legend(Legend::above)
      .name(name)
      .line(t, a, {.name = "motor lag ignored", .color = Color::vermillion, .width = 1.0})
      .line(t, b, {.name = "in the model", .color = Color::blue, .width = 1.0});
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "models", "crazyflie",
                about("A quadrotor's motors",
                      "Logs of a Crazyflie in free flight: the estimated disturbance if the lag of "
                      "the motors is ignored, and if it is in the model."));
  const auto file = measured_data() / "crazyflie_motor_lag" / "roll_pitch.csv";
  std::vector<CsvRow> lines;
  Figure figure("crazyflie", {.rows = 2, .columns = 1, .panel_height = 200});
  figure.caption(
      "Crazyflie, roll and pitch manoeuvres, b0 from a bench test of another airframe, lag of 72 "
      "ms from the authors of the log, omega_o = 50 rad/s. Without the lag in the model, most of "
      "the estimated disturbance is the difference between command and thrust while the motors "
      "accelerate.");
  axis(report, file, false, lines, figure);
  axis(report, file, true, lines, figure);
  report.add(figure);
  report.table("crazyflie", "Innovation and disturbance of the log",
               {"axis, motor lag", "RMS of the innovation (mrad/s)", "sd of dhat (rad/s2)"}, lines);
  return report.finish();
}
