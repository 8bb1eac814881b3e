// A geared DC servo that follows a sine (G. Keiel's log). The disturbance repeats with every
// period, friction above all. A resonator at that frequency takes most of it out of what has to be
// found. The log is in examples/data.
//
// Way: sampled observers on a measured log, as it was logged.
//
// Model  y' = d + b0 u(t - 40 ms);  u in % of full drive, y in degrees, counted by 3.5 degrees
//
// symbol   code      value  unit
// T        -         20     ms
// b0       gain      0.575  deg/s per %, read off another log of the same servo at full drive
// w0       -         0.628  rad/s, that of the reference
// omega_o  observer  3      rad/s

#include <array>
#include <cmath>
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

constexpr double time_step = 0.02;
constexpr double gain = 0.575;
constexpr double observer = 3.0;
constexpr double frequency = 2 * std::numbers::pi * 0.1;
constexpr int delay = 2;

template <int Resonators>
using Servo = DelayedInput<ModelEso<ModelParts{.order = 1, .resonators = Resonators}>, 2>;

struct Found {
  std::vector<double> total, rest;          ///< dhat, and what of it does not oscillate, deg/s
  double deviation = 0, left = 0, rms = 0;  ///< sd of the two; RMS of the innovation, deg
};

double deviation(const std::vector<double>& x, std::size_t first) {
  double sum = 0, squares = 0;
  for (std::size_t k = first; k < x.size(); ++k) {
    sum += x[k];
    squares += x[k] * x[k];
  }
  const auto count = static_cast<double>(x.size() - first);
  return std::sqrt(squares / count - sum * sum / (count * count));
}

/// @param frequencies of the resonators, rad/s
template <std::size_t Resonators>
Found found(const LogFile& log, const std::array<double, Resonators>& frequencies) {
  using Eso = Servo<static_cast<int>(Resonators)>;
  typename Eso::Config config{
      .observer = {.observer_bandwidth = observer, .input_gain = gain, .sample_time = time_step},
      .delay = delay};
  auto& resonators = config.observer.model.resonators;
  for (std::size_t i = 0; i < resonators.size(); ++i) resonators[i].frequency = frequencies[i];
  auto eso = Eso::make(config).value();
  Found result;
  double squares = 0;
  const std::size_t settled = 750;  // 15 s
  for (std::size_t k = 1; k < log.rows(); ++k) {
    (void)eso.update(log.column(1)[k], log.column(0)[k - 1]);
    result.total.push_back(eso.total_disturbance());
    result.rest.push_back(eso.observer().model().constant(eso.estimate()));
    if (k >= settled) squares += eso.innovation() * eso.innovation();
  }
  result.deviation = deviation(result.total, settled);
  result.left = deviation(result.rest, settled);
  result.rms = std::sqrt(squares / static_cast<double>(log.rows() - settled));
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "models", "servo",
                about("A servo that follows a sine",
                      "The log of a geared DC servo: how much of its disturbance repeats with "
                      "every period and is taken by a resonator."));
  const LogFile log(measured_data() / "servo_relay_pid" / "pid_sine.csv", {"u_pct", "y_deg"});
  const Found none = found<0>(log, {});
  const Found one = found<1>(log, {frequency});
  const Found two = found<2>(log, {frequency, 3 * frequency});
  const Found wrong = found<1>(log, {1.3 * frequency});
  std::vector<CsvRow> lines;
  const auto share = [&](const Found& f) {
    return 100 * (1 - f.left * f.left / (none.deviation * none.deviation));
  };
  const auto line = [&](const char* what, const Found& f) {
    lines.push_back(
        {what, number_text(f.left, 3), number_text(share(f), 3), number_text(f.rms, 3)});
  };
  line("none", none);
  line("0.1 Hz", one);
  line("0.1 Hz, 0.3 Hz", two);
  line("0.13 Hz, 30 % too high", wrong);
  report.expect("servo, sine of 0.1 Hz", "share of dhat's variance that a resonator takes (%)",
                share(one), share(one) > 80, "above 80");
  report.expect("servo, sine of 0.1 Hz", "the same 30 % too high (%)", share(wrong),
                share(wrong) < share(one), "less");
  std::vector<double> t, a, b, c;
  for (std::size_t k = 0; k < none.total.size(); ++k) {
    t.push_back(time_step * static_cast<double>(k));
    a.push_back(none.total[k]);
    b.push_back(one.rest[k]);
    c.push_back(wrong.rest[k]);
  }
  Figure figure("servo", {.rows = 1, .columns = 1, .panel_height = 240});
  figure.caption(
      "A DC servo that follows a sine of 0.1 Hz, omega_o = 3 rad/s: the estimated disturbance "
      "(friction, dead band), and what remains of it if a resonator at that frequency takes its "
      "part. Dashed: the frequency of the resonator is 30 % too high.");
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("dhat (deg/s)")
      .legend(Legend::above)
      .name("servo")
      .line(t, a, {.name = "no model of it", .color = Color::vermillion, .width = 1.0})
      .line(t, b, {.name = "left beside a resonator", .color = Color::blue, .width = 1.2})
      .line(t, c, {.name = "30 % too high", .color = Color::sky, .dash = Dash::dashed});
  report.add(figure);
  report.table(
      "servo", "What remains of dhat without the part of the resonators, after 15 s",
      {"resonators", "sd of the rest (deg/s)", "share taken (%)", "RMS of the innovation (deg)"},
      lines);
  return report.finish();
}
