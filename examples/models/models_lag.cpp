// A rate loop whose motor lags, and one whose gyro is filtered: with the lag ignored, in the model,
// and 30 % off the model.
//
// Way: sampled, plants exactly; margins and noise from the same controllers by the analysis.
//
// Plant       y' = d + v,  tau v' = u - v  (motor);  tau f' = y - f, f is measured  (gyro)
// Controllers Adrc<LinearEso<1>>, and Adrc<ModelEso<..>> with the lag in the model
//
// symbol   code         value          unit
// T        sample_time  0.001          s
// omega_o  observer     100            rad/s, motor
// tau      lag          15, 20, 40     ms, motor;  2, 5, 10 ms, gyro

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <esokit/gain/pole_set.hpp>

#include "common/report.hpp"
#include "models/models.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace models;

namespace {

constexpr double observer = 100.0;

using Plain = Adrc<LinearEso<1>>;
using Motor = Adrc<ModelEso<ModelParts{.order = 1, .actuator = 1}>>;
using AllPlaced = Adrc<ModelEso<ModelParts{.order = 1, .actuator = 1}, double, PoleSet>>;
using Gyro = Adrc<ModelEso<ModelParts{.order = 1, .sensor = 1}>>;

Plain plain(double bandwidth, double omega_o = observer) {
  return Plain::make({.observer = {.observer_bandwidth = omega_o,
                                   .input_gain = 1.0,
                                   .sample_time = sample_time},
                      .controller_bandwidth = bandwidth})
      .value();
}
Motor motor(double bandwidth, double lag) {
  return Motor::make({.observer = {.observer_bandwidth = observer,
                                   .input_gain = 1.0,
                                   .sample_time = sample_time,
                                   .model = {.actuator = {lag}}},
                      .controller_bandwidth = bandwidth})
      .value();
}
/// The actuator corrected as all else is, every pole at omega_o.
AllPlaced all_placed(double bandwidth, double lag) {
  AllPlaced::Config config{
      .observer = {.input_gain = 1.0, .sample_time = sample_time, .model = {.actuator = {lag}}},
      .controller_bandwidth = bandwidth};
  for (auto& pole : config.observer.poles) pole = -observer;
  return AllPlaced::make(config).value();
}
Gyro gyro(double omega_o, double lag) {
  return Gyro::make({.observer = {.observer_bandwidth = omega_o,
                                  .input_gain = 1.0,
                                  .sample_time = sample_time,
                                  .model = {.sensor = {lag}}},
                     .controller_bandwidth = omega_o / 2})
      .value();
}

auto integrator() { return LinearPlant<1>::chain({.input_gain = 1.0}).value(); }
auto with_motor(double lag) { return with_lag(integrator(), lag).value(); }
auto with_gyro(double lag) { return with_sensor(integrator(), lag).value(); }

/// omega_o and what it gives, the highest with which the loop bears so much more delay.
template <class Make>
double highest_bandwidth(double lag, double delay, const Make& make) {
  const auto plant = with_gyro(lag);
  double best = 0;
  for (double w = 40; w < 600; w *= 1.01) {
    const auto margin = delay_margin(plant, make(w));
    if (margin && margin->value >= delay) best = w;
  }
  return best;
}

void motor_lag(Report& report) {
  const auto overshoot = [](double lag) { return step_of(with_motor(lag), plain(60)).overshoot; };
  report.check_reference("lag ignored, omega_c 60 rad/s", "overshoot at 20 ms (%)", 50.1,
                         overshoot(0.02), Tolerance::absolute(0.5));
  report.check_reference("lag ignored, omega_c 60 rad/s", "overshoot at 10 ms (%)", 23.2,
                         overshoot(0.01), Tolerance::absolute(0.5));

  report.check_reference("lag ignored, omega_c 60 rad/s", "modulus margin at 20 ms", 0.04,
                         price_of(with_motor(0.02), plain(60)).modulus, Tolerance::absolute(0.005));
  // Why a known actuator runs open loop: one that is faster than the observer would be slowed down.
  const Price open = price_of(with_motor(0.002), motor(60, 0.002));
  const Price closed = price_of(with_motor(0.002), all_placed(60, 0.002));
  const char* fast = "lag of 2 ms in the model, omega_c 60 rad/s";
  report.check_reference(fast, "sd of u, run open loop", 15, open.noise, Tolerance::absolute(0.5));
  report.check_reference(fast, "modulus margin, run open loop", 0.62, open.modulus,
                         Tolerance::absolute(0.005));
  report.check_reference(fast, "sd of u, all poles at omega_o", 355, closed.noise,
                         Tolerance::absolute(1));
  report.check_reference(fast, "modulus margin, all poles at omega_o", 0.05, closed.modulus,
                         Tolerance::absolute(0.005));

  std::vector<CsvRow> lines;
  const auto line = [&](const std::string& what, double lag, double rise, double bandwidth,
                        const Step& step, const Price& price) {
    lines.push_back({what + ", " + number_text(1000 * lag, 3) + " ms, rise in " +
                         number_text(1000 * rise, 3) + " ms",
                     number_text(bandwidth, 3), number_text(1000 * step.rise, 3),
                     number_text(step.overshoot, 2), or_unstable(price.noise, 3),
                     or_unstable(price.modulus, 2), or_unstable(1000 * price.delay, 3)});
  };
  Figure figure("motor_lag", {.rows = 1, .columns = 2, .panel_height = 240});
  figure.caption(
      "Step of a rate loop whose motor lags by 20 ms, at equal rise time (0 to 90 %): left 64 ms; "
      "right 35 ms, which the loop that ignores the lag reaches only at the limit of stability. "
      "Dashed: the motor is 30 % slower or faster than the model.");
  int column = 0;
  for (const double rise : {0.064, 0.035}) {
    for (const double lag : {0.015, 0.02, 0.04}) {
      const auto plant = with_motor(lag);
      const double slow = bandwidth_for_rise(
          plant, [](double w) { return plain(w); }, rise, 3, 200);
      const double known = bandwidth_for_rise(
          plant, [&](double w) { return motor(w, lag); }, rise, 10, 300);
      const Step ignored = step_of(plant, plain(slow));
      const Step in_model = step_of(plant, motor(known, lag));
      const auto slower = with_motor(1.3 * lag);
      const auto faster = with_motor(0.7 * lag);
      const Step on_slower = step_of(slower, motor(known, lag));
      const Step on_faster = step_of(faster, motor(known, lag));
      const Price price_ignored = price_of(plant, plain(slow));
      const Price price_known = price_of(plant, motor(known, lag));
      line("ignored", lag, rise, slow, ignored, price_ignored);
      line("in the model", lag, rise, known, in_model, price_known);
      line("motor 30 % slower than the model", lag, rise, known, on_slower,
           price_of(slower, motor(known, lag)));
      line("motor 30 % faster than the model", lag, rise, known, on_faster,
           price_of(faster, motor(known, lag)));
      if (lag < 0.016 || lag > 0.03) continue;
      const std::string name = "motor lag 20 ms, rise " + number_text(1000 * rise, 2) + " ms";
      report.expect(name, "overshoot in the model (%)", in_model.overshoot,
                    in_model.overshoot < 0.1, "none");
      if (column == 0) {
        report.check_reference(name, "overshoot ignored (%)", 4, ignored.overshoot,
                               Tolerance::absolute(0.5));
        report.check_reference(name, "modulus margin ignored", 0.28, price_ignored.modulus,
                               Tolerance::absolute(0.01));
        report.check_reference(name, "modulus margin in the model", 0.63, price_known.modulus,
                               Tolerance::absolute(0.01));
        const double noisier = price_known.noise / price_ignored.noise;
        report.expect(name, "sd of u in the model, of that ignored", noisier,
                      noisier > 2 && noisier < 3, "two to three times");
      } else {
        report.check_reference(name, "modulus margin in the model", 0.6, price_known.modulus,
                               Tolerance::absolute(0.05));
        report.check_reference(name, "overshoot with the lag 30 % off (%)", 6,
                               std::max(on_slower.overshoot, on_faster.overshoot),
                               Tolerance::absolute(0.5));
      }
      figure.panel(0, static_cast<std::size_t>(column++))
          .title("rise in " + number_text(1000 * rise, 2) + " ms")
          .x_label("t (s)")
          .y_label("rate / its reference (-)")
          .x_range(0.0, 0.3)
          .legend(Legend::bottom_right)
          .name("rise" + number_text(1000 * rise, 2))
          .line(ignored.t, ignored.y, {.name = "ignored", .color = Color::vermillion})
          .line(in_model.t, in_model.y, {.name = "in the model", .color = Color::blue})
          .line(on_slower.t, on_slower.y,
                {.name = "motor 30 % slower", .color = Color::sky, .dash = Dash::dashed})
          .line(on_faster.t, on_faster.y,
                {.name = "motor 30 % faster", .color = Color::green, .dash = Dash::dashed});
    }
  }
  report.add(figure);
  report.table("motor_lag",
               "The price: standard deviation of u for noise with a standard deviation of 1 on y, "
               "and the margins. omega_o = 100 rad/s",
               {"motor lag", "omega_c (rad/s)", "rise (ms)", "overshoot (%)", "sd of u",
                "modulus margin", "delay margin (ms)"},
               lines);
}

void gyro_filter(Report& report) {
  constexpr double delay = 5e-3;
  std::vector<CsvRow> lines;
  Figure figure("gyro_filter", {.rows = 1, .columns = 1, .panel_height = 240});
  figure.caption(
      "The true rate after a load step, with a gyro filter of 5 ms; both loops tolerate 5 ms of "
      "additional delay. With the filter in the model the observer may be twice as fast, and the "
      "load moves the rate half as far; the observer estimates the rate itself and not the output "
      "of the filter. Dashed: the filter is 30 % slower or faster than the model.");
  for (const auto& [tau, low, high, ratio] :
       {std::array{0.002, 174.0, 238.0, 1.4}, std::array{0.005, 132.0, 264.0, 2.0},
        std::array{0.010, 100.0, 264.0, 2.6}}) {
    const double lag = tau;
    const auto ignoring = [](double w) { return plain(w / 2, w); };
    const auto knowing = [&](double w) { return gyro(w, lag); };
    const double ignored = highest_bandwidth(lag, delay, ignoring);
    const double known = highest_bandwidth(lag, delay, knowing);
    const std::string name = "gyro filter " + number_text(1000 * lag, 2) + " ms";
    report.check_reference(name, "omega_o ignored (rad/s)", low, ignored, 0.02);
    report.check_reference(name, "omega_o in the model (rad/s)", high, known, 0.02);
    report.check_reference(name, "ratio", ratio, known / ignored, Tolerance::absolute(0.06));
    const auto plant = with_gyro(lag);
    const auto line = [&](const char* what, double w, const Price& price) {
      lines.push_back({std::string(what) + ", " + number_text(1000 * lag, 3) + " ms",
                       number_text(w, 3), or_unstable(price.noise, 3),
                       or_unstable(price.modulus, 2), or_unstable(1000 * price.delay, 3)});
    };
    line("ignored", ignored, price_of(plant, ignoring(ignored)));
    line("in the model", known, price_of(plant, knowing(known)));
    line("filter 30 % slower than the model", known,
         price_of(with_gyro(1.3 * lag), knowing(known)));
    line("filter 30 % faster than the model", known,
         price_of(with_gyro(0.7 * lag), knowing(known)));
    if (lag < 0.004 || lag > 0.006) continue;
    const auto load = [&](const auto& filtered, const auto& controller) {
      std::vector<double> rate;
      const auto run = sim::run(filtered, controller, {.duration = 0.2, .disturbance = 1.0},
                                [&](const auto& sample) { rate.push_back(sample.state(0)); });
      (void)run;
      return rate;
    };
    const auto slow = load(plant, ignoring(ignored));
    const auto fast = load(plant, knowing(known));
    const auto on_slower = load(with_gyro(1.3 * lag), knowing(known));
    const auto on_faster = load(with_gyro(0.7 * lag), knowing(known));
    std::vector<double> time;
    for (std::size_t k = 0; k < slow.size(); ++k)
      time.push_back(sample_time * static_cast<double>(k));
    const double before = *std::max_element(slow.begin(), slow.end());
    const double after = *std::max_element(fast.begin(), fast.end());
    report.expect(name, "largest rate after a load step, of that ignored", after / before,
                  after < 0.7 * before, "below 0.7");
    figure.panel(0, 0)
        .x_label("t (s)")
        .y_label("rate after a load step (rad/s)")
        .legend(Legend::top_right)
        .name("load")
        .line(time, slow, {.name = "ignored", .color = Color::vermillion})
        .line(time, fast, {.name = "in the model", .color = Color::blue})
        .line(time, on_slower,
              {.name = "filter 30 % slower", .color = Color::sky, .dash = Dash::dashed})
        .line(time, on_faster,
              {.name = "filter 30 % faster", .color = Color::green, .dash = Dash::dashed});
  }
  report.add(figure);
  report.table("gyro_filter",
               "The highest omega_o (with omega_c = omega_o / 2) for which the loop tolerates 5 ms "
               "of additional delay; standard deviation of u for noise with a standard deviation "
               "of 1 on the filtered rate",
               {"gyro filter", "omega_o (rad/s)", "sd of u", "modulus margin", "delay margin (ms)"},
               lines);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "models", "lag",
      about("Motor lag and gyro filter",
            "A rate loop, with the lag ignored, in the model, and 30 % different from the model."));
  motor_lag(report);
  gyro_filter(report);
  return report.finish();
}
