// No log? A relay on a servo finds b0 and latency within limits, and ADRC takes over from it.
//
// Way: sampled, as deployed; the servo in between by steps of 0.05 ms. One seed.
//
// Servo    y'' = b0 v(t - L) - a y' - F tanh(y' / v_s) + d,   tau v' + v = u;   y from an encoder
// Relay    u = u0 + A, u0 - A in turns, switched by y with a lead; two cycles settle, eight count
// Then     identify() of the same rows; Adrc with the b0 and latency that the relay found
//
// symbol        code           value         unit
// b0            input_gain     40            rad/s2 per unit of u
// tau, L        lag, dead      6, 2          ms
// a             pole           1             1/s
// F             friction       0.1           of b0 A
// d             load           -4            rad/s2
// step of y     encoder        2 pi / 4096   rad
// T             T              1             ms

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/identify/identify.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/compiled/study.hpp"
#include "common/report.hpp"

using namespace esokit::examples;
using esokit::Adrc;
using esokit::Experiment;
using esokit::ExperimentPhase;
using esokit::LinearEso;

namespace {

constexpr double T = 1e-3;
constexpr double b0 = 40, lag = 6e-3, dead = 2e-3, pole = 1, load = -4;
constexpr double amplitude = 1, u0 = -load / b0;
constexpr double encoder = 2 * 3.14159265358979323846 / 4096;

class Servo {
 public:
  Servo(double friction_share) : friction_(friction_share * b0 * amplitude) {}

  void step(double u) {
    for (int i = 0; i < inner; ++i) {
      line_[at_] = u;
      at_ = (at_ + 1) % line_.size();
      v_ += (1 - std::exp(-h / lag)) * (line_[at_] - v_);
      const double acceleration =
          b0 * v_ - pole * speed_ - friction_ * std::tanh(speed_ / 0.01) + load;
      y_ += h * speed_ + h * h / 2 * acceleration;
      speed_ += h * acceleration;
    }
  }
  [[nodiscard]] double y() const { return std::round(y_ / encoder) * encoder; }
  [[nodiscard]] double true_y() const { return y_; }
  [[nodiscard]] double speed() const { return speed_; }
  /// What the law of a perfect observer would answer to: all of y'' but b0 u.
  [[nodiscard]] double disturbance(double u) const {
    return b0 * (v_ - u) - pole * speed_ - friction_ * std::tanh(speed_ / 0.01) + load;
  }

 private:
  static constexpr double h = 5e-5;
  static constexpr int inner = 20;
  double friction_;
  std::vector<double> line_ = std::vector<double>(static_cast<std::size_t>(dead / h) + 1, u0);
  std::size_t at_ = 0;
  double v_ = u0, y_ = 0, speed_ = 0;
};

constexpr esokit::ExperimentConfig<double> relay{.sample_time = T,
                                                 .input = u0,
                                                 .amplitude = amplitude,
                                                 .hysteresis = 0.02,
                                                 .lead = 0.05,
                                                 .rest = 0.1,
                                                 .travel = 1,
                                                 .time_limit = 5,
                                                 .hand_over = 0.2,
                                                 .limits = {.lower = -2, .upper = 2}};

using Controller = Adrc<LinearEso<2>>;

Controller::Config settings(const esokit::ExperimentResult<double>& found) {
  // Slow enough for the latency that was found: it costs 7 degrees at omega_c.
  const double omega_c = 0.125 / found.latency;
  return {.observer = {.observer_bandwidth = 4 * omega_c,
                       .input_gain = found.input_gain,
                       .sample_time = T},
          .controller_bandwidth = omega_c,
          .limits = relay.limits};
}

/// What the relay finds with more or less friction.
CsvRow alone(double friction) {
  auto experiment = Experiment<2>::make(relay).value();
  Servo servo(friction);
  while (!experiment.finished()) servo.step(experiment.update(servo.y()));
  const auto result = experiment.result();
  const std::string share = number_text(100 * friction, 3);
  if (!result) return {share, "", "", "", "", std::string("refused: ") + result.error().field};
  return {share,
          number_text(result->input_gain, 4),
          number_text(result->input_gain_half_width, 2),
          number_text(1e3 * result->latency, 3),
          number_text(100 * result->friction / (b0 * amplitude), 3),
          "accepted"};
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "identify", "identify_experiment",
      {.paper_title = "From a log to a model",
       .citation =
           "No paper. Order, b0, lag, dead time, friction and noise from logs, with intervals",
       .link = "",
       .title = "If there is no log: a relay experiment",
       .description =
           "An unknown servo: a relay within limits finds b0 and latency, then ADRC takes over.",
       .order = 3});
  auto experiment = Experiment<2>::make(relay).value();
  std::optional<Controller> controller;
  Servo servo(0.1);
  esokit::Log log;
  std::vector<double> time, y, u, reference;
  double hand_over = 0, first = 0, before = 0, law = 0, rested = 0, along = 0;
  for (int k = 0; k < 5000; ++k) {
    const double now = k * T, measured = servo.y();
    const double held = u.empty() ? u0 : u.back();
    const double r = now < 3 ? 0.0 : now < 4 ? 0.5 : 0.0;
    double next = 0;
    if (!experiment.finished()) {
      next = experiment.update(measured);
      if (experiment.samples() > 1) {
        log.time.push_back(experiment.row().time);
        log.u.push_back(experiment.row().u);
        log.y.push_back(experiment.row().y);
      }
      if (experiment.phase() == ExperimentPhase::hand_over) {
        if (!controller) {
          controller = Controller::make(settings(experiment.result().value())).value();
          (void)controller->start(measured, held);
        } else {
          (void)controller->track(measured, 0.0, held);
        }
      }
    }
    if (experiment.finished()) {
      if (hand_over == 0) {
        hand_over = now;
        before = held;
        const auto k1 = controller->gains();
        const double b = controller->observer().input_gain();
        law = (-k1[0] * servo.true_y() - k1[1] * servo.speed() - servo.disturbance(held)) / b +
              (b - b0) / b * held;
        auto whole = Controller::make(settings(experiment.result().value())).value();
        for (std::size_t i = 0; i < log.y.size(); ++i) {
          (void)whole.track(log.y[i], 0.0, i == 0 ? u0 : log.u[i - 1]);
        }
        whole.applied(held);
        along = whole.update(measured, 0.0);
        auto other = Controller::make(settings(experiment.result().value())).value();
        (void)other.start(measured, held);
        rested = other.update(measured, 0.0);
      }
      controller->applied(held);
      next = controller->update(measured, r);
      if (hand_over == now) first = next;
    }
    time.push_back(now);
    y.push_back(servo.true_y());
    reference.push_back(now < hand_over || hand_over == 0 ? std::numeric_limits<double>::quiet_NaN()
                                                          : r);
    u.push_back(next);
    servo.step(next);
  }
  const auto found = experiment.result().value();
  report.check_reference("servo", "b0 by the relay", b0, found.input_gain, 0.03,
                         "friction of a tenth is found and taken out");
  report.check("servo", "half width of its interval", std::nullopt, found.input_gain_half_width);
  report.check_reference("servo", "lag and dead time by the relay (ms)", 1e3 * (lag + dead),
                         1e3 * found.latency, 0.15, "damping shortens it");
  report.check_reference("servo", "friction by the relay (rad/s2)", 0.1 * b0 * amplitude,
                         found.friction, 0.25);
  report.check("servo", "relay done after (s)", std::nullopt, hand_over);
  const auto identified = compiled::study(log, {.orders = {2}});
  if (identified) {
    report.check_reference("servo", "b0 by identify, same rows", b0, identified->input_gain.value,
                           0.03, "with friction as a column");
    report.check("servo", "half width of its interval, identify", std::nullopt,
                 identified->input_gain.half_width);
    const auto verdict = esokit::judge(*identified, log);
    report.check("servo", "identify accepts the rows of the relay", std::nullopt,
                 verdict ? 1.0 : 0.0, std::nullopt, verdict ? "" : verdict.error().field);
  }
  report.check("hand-over", "u before", std::nullopt, before);
  report.check("hand-over", "first u of the controller", std::nullopt, first);
  report.expect("hand-over", "first u less that of a controller led from the first row",
                std::abs(first - along), std::abs(first - along) < 1e-3 * amplitude,
                "below 1e-3 A: 0.2 s are 20 / omega_o");
  report.check("hand-over", "first u less what the law asks of the true state", std::nullopt,
               std::abs(first - law), std::nullopt, "the observer does not know of the lag");
  report.expect("hand-over", "the same of a controller that was started at rest",
                std::abs(rested - law), std::abs(rested - law) > 2 * std::abs(first - law),
                "worse: it does not know that the servo moves");
  double overshoot = 0, worst = 0;
  for (std::size_t k = 0; k < time.size(); ++k) {
    if (time[k] > 3 && time[k] < 4) overshoot = std::max(overshoot, y[k] - 0.5);
    if (time[k] < 3) worst = std::max(worst, std::abs(y[k]));
  }
  report.expect("servo", "largest travel in the experiment (rad)", worst, worst < relay.travel,
                "below the limit");
  report.expect("servo", "overshoot of the step to 0.5 (rad)", overshoot, overshoot < 0.05,
                "a tenth");
  report.expect("servo", "error at 4 s (rad)", std::abs(y[3999] - 0.5),
                std::abs(y[3999] - 0.5) < 3 * encoder, "three steps of the encoder");

  std::vector<CsvRow> lines;
  for (const double friction : {0.0, 0.05, 0.1, 0.2, 0.3, 0.5}) lines.push_back(alone(friction));
  report.table("friction", "Effect of friction on the results of the relay (true: b0 = 40, 8 ms)",
               {"friction (% of b0 A)", "b0", "half width", "lag and dead time (ms)",
                "friction found (%)", "verdict"},
               lines);

  Figure figure("relay", {.rows = 2, .columns = 1, .panel_height = 190});
  figure.caption(
      "A relay moves the servo for two seconds and finds b0 " + number_text(found.input_gain, 3) +
      " (true 40) and a latency of " + number_text(1e3 * found.latency, 2) +
      " ms; at the dashed line ADRC, designed from these two numbers while the relay was still "
      "on, takes over. Steps of the reference at 3 and 4 s.");
  figure.panel(0, 0)
      .y_label("y (rad)")
      .name("y")
      .legend(Legend::above)
      .line(time, reference, {.name = "reference", .color = Color::grey})
      .line(time, y, {.name = "y", .color = Color::blue})
      .vertical_line(hand_over);
  figure.panel(1, 0)
      .x_label("t (s)")
      .y_label("u")
      .name("u")
      .line(time, u, {.color = Color::vermillion, .column = "u"})
      .vertical_line(hand_over);
  report.add(figure);
  return report.finish();
}
