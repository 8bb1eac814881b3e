// The joint of joint.hpp on a simulated arm: a guessed inertia, a log of ten seconds under that
// loop, the inertia that identify finds in it, the loop with it. Then a motor wired the wrong way
// round.
//
// Plant       J y'' = u - 0.05 y' - 0.4 tanh(y' / 0.02) - 1.5 sin y, J = 0.05 kg m^2
// Sensor      encoder, 16384 ticks a turn; 1 kHz
// Controller  settling time 0.3 s, |u| <= 6 N m, guessed J = 0.02

#include "trades/joint.hpp"

#include <array>
#include <cmath>
#include <esokit/identify/identify.hpp>
#include <numbers>
#include <sstream>

#include "common/compiled/study.hpp"
#include "trades/trades.hpp"

using namespace esokit;
using namespace esokit::examples;
using trades::Joint;

namespace {

constexpr double inertia = 0.05;
constexpr double tick = 2 * std::numbers::pi / 16384;

double load_torque(double angle, double speed) {
  return 0.05 * speed + 0.4 * std::tanh(speed / 0.02) + 1.5 * std::sin(angle);
}

/// Where the joint shall be, its speed and acceleration: sines, so that u says something about J.
std::array<double, 3> wanted(double t) {
  return {0.5 * std::sin(3 * t) + 0.15 * std::sin(11 * t),
          1.5 * std::cos(3 * t) + 1.65 * std::cos(11 * t),
          -4.5 * std::sin(3 * t) - 18.15 * std::sin(11 * t)};
}

struct Trace {
  std::vector<double> t, error, load, found;
};

/// @param wired 1, or -1: the wrong way round @param complaint if given, one about the sign ends
/// the run
Trace drive(Joint& joint, double seconds, double wired, std::string* complaint = nullptr) {
  Trace trace;
  double angle = 0;
  double speed = 0;
  constexpr int fine = 20;
  for (int k = 0; k < static_cast<int>(1000 * seconds); ++k) {
    const double t = k * 1e-3;
    const double torque = joint.cycle(tick * std::round(angle / tick), wanted(t));
    trace.t.push_back(t);
    trace.error.push_back(1e3 * (wanted(t)[0] - angle));
    trace.load.push_back(load_torque(angle, speed));
    trace.found.push_back(joint.load());
    if (complaint != nullptr && k % 20 == 0) {
      *complaint = joint.complaint();
      if (complaint->find("sign") != std::string::npos) break;
    }
    for (int i = 0; i < fine; ++i) {
      speed += 1e-3 / fine * (wired * torque - load_torque(angle, speed)) / inertia;
      angle += 1e-3 / fine * speed;
    }
  }
  return trace;
}

double rms(const std::vector<double>& values, std::size_t from) {
  double sum = 0;
  for (std::size_t k = from; k < values.size(); ++k) sum += values[k] * values[k];
  return std::sqrt(sum / static_cast<double>(values.size() - from));
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "trades", "joint",
                trades::about("A joint of a robot",
                              "A class for a node: parameters by name, a log, the inertia found "
                              "from the log, and a diagnosis."));
  Joint::Parameters parameters{
      {"inertia", 0.02}, {"settling_time", 0.3}, {"most_torque", 6}, {"rate", 1000}};
  std::ostringstream log;
  Joint joint = Joint::make(parameters).value();
  joint.log_to(&log);
  const Trace guessed = drive(joint, 10, 1);
  joint.log_to(nullptr);

  const auto found = compiled::identify(trades::rows_of(log.str()));
  const double seen = 1 / found.value().input_gain.value;
  report.check_reference("log of 10 s under the guess", "inertia (kg m^2)", inertia, seen, 0.05,
                         "as simulated");

  parameters["inertia"] = seen;
  joint = Joint::make(parameters).value();
  const Trace known = drive(joint, 10, 1);
  report.expect("inertia guessed 2.5 times too small", "RMS error after 1 s (mrad)",
                rms(guessed.error, 1000), true, "");
  report.expect("inertia from the log", "RMS error after 1 s (mrad)", rms(known.error, 1000),
                rms(known.error, 1000) < rms(guessed.error, 1000), "less than guessed");

  joint = Joint::make(parameters).value();
  std::string complaint;
  const Trace reversed = drive(joint, 2, -1, &complaint);
  report.expect("motor the wrong way round", "complaint after (s)", reversed.t.back(),
                complaint.find("sign") != std::string::npos && reversed.t.back() < 0.5,
                "names the sign");

  parameters["rate"] = -1;
  const bool refused = !Joint::make(parameters) && !joint.set(parameters).empty();
  report.expect("a rate of -1 Hz", "settings refused", refused ? 1 : 0, refused,
                "and the loop goes on as it was");

  Figure figure("joint", {.rows = 1, .columns = 2, .panel_height = 200});
  figure.caption(
      "Left: error with the inertia guessed 2.5 times too small, and with the one found in that "
      "run's log. Right: torque of friction and gravity, as it is and as dhat says.");
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("error (mrad)")
      .x_range(4, 6)
      .legend(Legend::above)
      .line(guessed.t, guessed.error, {.name = "inertia guessed", .color = Color::grey})
      .line(known.t, known.error, {.name = "inertia from the log", .color = Color::blue});
  figure.panel(0, 1)
      .x_label("t (s)")
      .y_label("load (N m)")
      .x_range(4, 6)
      .legend(Legend::above)
      .line(known.t, known.load, {.name = "true load", .color = Color::black, .dash = Dash::dashed})
      .line(known.t, known.found, {.name = "estimate", .color = Color::vermillion});
  report.add(figure);
  report.remark("The complaint: " + complaint);
  return report.finish();
}
