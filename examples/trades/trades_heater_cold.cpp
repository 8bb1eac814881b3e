// The heater of heater_cold.hpp on the energy balance of a temperature lab: from cold to a loop
// that knows its gain, lag and dead time. A fan is not measured, measured, measured wrongly and
// lost. Beside it are a PI and a predictor of lag and dead time (Smith), tuned by the same rule.
//
// Plant    m c T' = U A (Ta - T) + eps sigma A (Ta^4 - T^4) + P u(t - 2 s); the fan doubles U
//          m 0.004 kg, c 500, A 1.2e-3 m^2, U 5 W/(m^2 K), eps 0.9, P 0.64 W, Ta 23.5 degC
// Sensor   14.4 s behind, steps of 0.0625 degC; T = 0.1 s; u in 0 .. 1
// Rule     least area while the fan is on and after it, with a modulus margin of 0.5 at gain and
//          latency 30 % off, and a noise of at most 0.03 in u

#include "trades/heater_cold.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "trades/trades.hpp"

using namespace esokit;
using namespace esokit::examples;
using trades::ColdHeater;

namespace {

constexpr double T = 0.1, room = 23.5, wanted = 50, tick = 0.0625;
constexpr double least_modulus = 0.5, most_noise = 0.03;

/// The block, its heater and its sensor, in steps of 25 ms.
class Lab {
 public:
  /// At rest there, if a temperature is given.
  explicit Lab(double start = room) : block_(start), sensor_(start) { line_.fill(holding()); }

  [[nodiscard]] double block() const { return block_; }
  [[nodiscard]] double shown() const { return tick * std::round(sensor_ / tick); }
  /// The power that holds it.
  [[nodiscard]] double holding() const { return -losses(0) / 0.64; }

  void step(double power, double fan) {
    at_ = (at_ + 1) % line_.size();
    const double late = line_[at_];
    line_[at_] = power;
    for (int i = 0; i < 4; ++i) {
      sensor_ += T / 4 * (block_ - sensor_) / 14.4;
      block_ += T / 4 * (losses(fan) + 0.64 * late) / (0.004 * 500);
    }
  }

 private:
  [[nodiscard]] double losses(double fan) const {
    const double area = 1.2e-3;
    return (1 + fan) * 5 * area * (room - block_) +
           0.9 * 5.67e-8 * area * (std::pow(room + 273.15, 4) - std::pow(block_ + 273.15, 4));
  }

  double block_, sensor_;
  std::array<double, 20> line_{};
  std::size_t at_ = 0;
};

/// What the trial found, and the losses at rest.
struct Model {
  double gain = 0, lag = 0, dead = 0, pole = 0;
};

/// Deviations of u from the first one, by deviations of y.
using Law = std::function<double(double y)>;

struct Pulse {
  std::vector<double> t, y, u;
  double most = 0;  ///< largest deviation
  double area = 0;  ///< its integral
};

/// The fan from 50 to 450 s, at rest before.
/// @param given what a fan adds to u, by the temperature shown
Pulse pulse(const Law& law, const Law& given = nullptr) {
  Pulse pulse;
  Lab lab(wanted);
  const double rest = lab.holding();
  for (int k = 0; k < 8500; ++k) {
    const double t = k * T, fan = t >= 50 && t < 450 ? 1 : 0;
    const double known = given ? fan * given(lab.shown()) : 0;
    const double u = std::clamp(rest + law(lab.shown() - wanted) + known, 0.0, 1.0);
    const double error = std::abs(lab.block() - wanted);
    pulse.most = std::max(pulse.most, error);
    pulse.area += T * error;
    if (k % 10 == 0) {
      pulse.t.push_back(t);
      pulse.y.push_back(lab.block());
      pulse.u.push_back(u);
    }
    lab.step(u, fan);
  }
  return pulse;
}

/// K in 1 / (b0 latency) and T_i in latencies; of ADRC omega_c times latency and omega_o / omega_c.
struct Numbers {
  double first = 0, second = 0;
};

/// A controller without limits as it stands, for a pulse that reaches none.
Law played(const LinearController& c) {
  return [c, z = std::vector<double>(static_cast<std::size_t>(c.states()))](double y) mutable {
    double u = c.y_to_u(0, 0) * y;
    for (int i = 0; i < c.states(); ++i) u += c.to_u(0, i) * z[static_cast<std::size_t>(i)];
    auto next = z;
    for (int i = 0; i < c.states(); ++i) {
      double& state = next[static_cast<std::size_t>(i)];
      state += c.from_y(i, 0) * y + c.from_u(i, 0) * u;
      for (int j = 0; j < c.states(); ++j) state += c.a(i, j) * z[static_cast<std::size_t>(j)];
    }
    z = next;
    return u;
  };
}

LinearController pi(const Model& model, const Numbers& numbers) {
  const double latency = model.lag + model.dead, gain = numbers.first / (model.gain * latency);
  LinearController c(1, 1, 0, T);
  c.from_y(0, 0) = -gain * T / (numbers.second * latency);
  c.to_u(0, 0) = 1;
  c.y_to_u(0, 0) = -gain + c.from_y(0, 0);
  return c;
}

/// A PI of y + what the model shows without its dead time - what it shows with it.
LinearController smith(const Model& model, const Numbers& numbers) {
  const int late = static_cast<int>(std::lround(model.dead / T)), states = 3 + late;
  const LinearController inner = pi(model, numbers);
  LinearController c(states, 1, 0, T);
  // The integral; the block and the sensor of the model; the sensor of late to 1 samples ago.
  std::vector<double> feed(static_cast<std::size_t>(states));
  feed[2] = 1;
  feed[2 + static_cast<std::size_t>(late)] -= 1;
  c.from_y(0, 0) = inner.from_y(0, 0);
  c.y_to_u(0, 0) = inner.y_to_u(0, 0);
  c.to_u(0, 0) = 1;
  for (int i = 1; i < states; ++i) {
    c.a(0, i) = inner.from_y(0, 0) * feed[static_cast<std::size_t>(i)];
    c.to_u(0, i) = inner.y_to_u(0, 0) * feed[static_cast<std::size_t>(i)];
  }
  c.a(1, 1) = -model.pole * T;
  c.from_u(1, 0) = model.gain * T;
  c.a(2, 1) = T / model.lag;
  c.a(2, 2) = -T / model.lag;
  for (int i = 3; i < states; ++i) {
    c.a(i, i) = -1;
    c.a(i, i - 1) = 1;
  }
  return c;
}

LinearController adrc(const ColdHeater::Loop::Config& found, const Model& model,
                      const Numbers& numbers) {
  auto config = found;
  config.controller_bandwidth = numbers.first / (model.lag + model.dead);
  config.observer.observer.observer.observer_bandwidth =
      numbers.second * config.controller_bandwidth;
  return linear_controller(ColdHeater::Loop::make(config).value()).value();
}

struct Judged {
  double modulus = -1, noise = 1e9;
};
Judged judged(const LinearController& controller, const Model& model, double gain, double slower) {
  LinearPlant<2> plant{};
  const double lag = slower * model.lag;
  plant.a = {{-model.pole, 0}, {1 / lag, -1 / lag}};
  plant.b = {{gain * model.gain}, {0}};
  plant.c = {{0, 1}};
  plant.e = {{1}, {0}};
  plant.dead_time = slower * model.dead;
  const auto loop = closed_loop(plant, controller);
  if (!loop || !loop->stable()) return {};
  const auto found = margins(*loop);
  const auto sigma = noise(*loop, {.measurement = {tick / std::sqrt(12.0)}});
  return found && sigma ? Judged{found->modulus.value, sigma->control[0]} : Judged{};
}

double least_of(const LinearController& controller, const Model& model) {
  double least = 1e9;
  for (const double gain : {1.3, 1.0, 0.7}) {
    for (const double slower : {1.3, 1.0, 0.7}) {
      if (least < least_modulus) return least;
      least = std::min(least, judged(controller, model, gain, slower).modulus);
    }
  }
  return least;
}

struct Way {
  std::string name;
  std::function<LinearController(const Numbers&)> form;
  Numbers numbers{};
  Pulse fan{};
};

/// The rule: on a grid around `from`, then on finer ones around the best.
void choose(Way& way, const Model& model, const Numbers& from) {
  way.numbers = from;
  double least = std::numeric_limits<double>::infinity();
  double step = 1.5;
  for (int pass = 0; pass < 3; ++pass, step = std::sqrt(step)) {
    const Numbers centre = way.numbers;
    const int reach = pass == 0 ? 3 : 2;
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        const Numbers numbers{centre.first * std::pow(step, i), centre.second * std::pow(step, j)};
        const LinearController form = way.form(numbers);
        const Pulse fan = pulse(played(form));
        if (fan.area >= least || least_of(form, model) < least_modulus) continue;
        if (judged(form, model, 1, 1).noise > most_noise) continue;
        least = fan.area;
        way.numbers = numbers;
        way.fan = fan;
      }
    }
  }
}

ColdHeater::Config settings() {
  ColdHeater::Config config{};
  config.room = room;
  config.trial = {.sample_time = T,
                  .amplitude = 0.4,
                  .hysteresis = 1,
                  .rest = 5,
                  .approach = {{.input = 1, .output = wanted}},
                  .response = 1,
                  .response_time = 60,
                  .travel = 15,
                  .lowest_output = 10,
                  .highest_output = 75,
                  .time_limit = 3000,
                  .hand_over = 120,
                  .cycles = 6,
                  .limits = {.lower = 0, .upper = 1}};
  return config;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "trades", "heater_cold",
      trades::about("A heater from cold, and a fan that is measured",
                    "Heat-up, autotune and hand-over; ADRC with lag and dead time in the "
                    "model; a fan of 100 %; a PI and a Smith predictor by the same rule."));

  // What the trial finds.
  ColdHeater heater = ColdHeater::make(settings()).value();
  Lab lab;
  while (!heater.trial().finished()) {
    lab.step(heater.step(lab.shown(), wanted, 0), 0);
  }
  const auto found = heater.trial().result().value();
  report.check_reference("trial", "heating at full power (degC/s)", 0.64 / 2, found.input_gain,
                         found.input_gain_half_width / 0.32, "within its interval");
  report.check_reference("trial", "lag (s)", 14.4, heater.lag(), 0.1, "as simulated");
  report.check_reference("trial", "lag and dead time (s)", 16.4, found.latency, 0.1,
                         "as simulated");
  report.expect("trial", "how long it takes (s)", heater.trial().samples() * T, true, "reported");
  const Model model{.gain = found.input_gain,
                    .lag = heater.lag(),
                    .dead = found.latency - heater.lag(),
                    .pole = found.input_gain * heater.trial().centre() / (wanted - room)};

  // The same rule for all.
  std::array<Way, 3> ways{
      Way{"PI", [&](const Numbers& numbers) { return pi(model, numbers); }},
      Way{"Smith predictor", [&](const Numbers& numbers) { return smith(model, numbers); }},
      Way{"ADRC, fan not known",
          [&](const Numbers& numbers) { return adrc(heater.settings(), model, numbers); }}};
  choose(ways[0], model, {0.7, 5});
  choose(ways[1], model, {0.8, 4});
  choose(ways[2], model, {0.45, 8});
  for (const Way& way : ways) {
    const bool ours = &way == &ways[2];
    report.expect(way.name, ours ? "omega_c times latency" : "gain times b0 and latency",
                  way.numbers.first, true, "reported");
    report.expect(way.name, ours ? "omega_o over omega_c" : "integral time over latency",
                  way.numbers.second, true, "reported");
    const LinearController form = way.form(way.numbers);
    const double least = least_of(form, model), sigma = judged(form, model, 1, 1).noise;
    report.expect(way.name, "least modulus margin, 30 % off", least, least >= least_modulus,
                  "at least 0.5");
    report.expect(way.name, "noise in u", sigma, sigma <= most_noise, "at most 0.03");
    report.expect(way.name, "dip by the fan (degC)", way.fan.most, true, "reported");
    report.expect(way.name, "its area (degC s)", way.fan.area, true, "reported");
  }

  // A sensor that stands still from 40 times of the trial on: where that ends it, the power stays
  // off.
  const double whole = heater.trial().samples() * T;
  int ended = 0, heated = 0;
  for (int i = 0; i < 40; ++i) {
    heater = ColdHeater::make(settings()).value();
    lab = Lab();
    double shown = room, power = 0, after = -1;
    for (int k = 0; after < 1000; ++k) {
      if (k * T < (i + 0.5) / 40 * whole) shown = lab.shown();
      power = heater.step(shown, wanted, 0);
      if (heater.trial().phase() == esokit::ExperimentPhase::done) break;
      if (heater.trial().finished()) after += 1;
      if (after >= 0 && power > 0) ++heated;
      lab.step(power, 0);
    }
    ended += after >= 0 ? 1 : 0;
  }
  report.expect("sensor stands still", "of 40 times, the trial is ended", ended, ended >= 30,
                "else just before the end");
  report.expect("sensor stands still", "samples with power after that", heated, heated == 0,
                "none");

  // The class from cold: the fan at 400 s after the hand-over, and again each 800 s.
  auto config = settings();
  config.speed = ways[2].numbers.first;
  config.observer = ways[2].numbers.second;
  heater = ColdHeater::make(config).value();
  lab = Lab();
  std::vector<double> t, y, u, told_t, told_y, told_u;
  std::array<double, 5> dip{};
  double start = 0, jump = 0, load_before = 0, cooling = 0, goal = wanted, held = 0;
  constexpr double pause = 400, period = 800;
  for (int k = 0;; ++k) {
    const double time = k * T, since = start > 0 ? time - start : -1;
    const double turn = std::floor(since / period);
    if (turn >= 5) break;
    const auto at = static_cast<std::size_t>(std::max(turn, 0.0));
    const double within = since - turn * period;
    const double fan = since > 0 && within >= pause ? 1 : 0;
    // Known from the second time on; 30 % too little the third time, lost the fourth; at 40 degC
    // the fifth.
    const auto now = [&](double then) { return since > 0 && std::abs(within - then) < T / 2; };
    if (now(pause)) load_before = heater.load();
    if (now(period - T) && at == 0) cooling = heater.cooling(load_before, heater.load(), wanted);
    if (now(pause - 100) && at > 0) {
      if (!heater.set_fan_cooling((at == 2 ? 0.7 : 1.0) * cooling)) return 1;
    }
    if (at == 4) goal = 40;
    const double given = at == 3 ? std::numeric_limits<double>::quiet_NaN() : fan;
    const double power = heater.step(lab.shown(), goal, given);
    if (start == 0 && heater.trial().finished()) {
      start = time;
      jump = std::abs(power - heater.trial().centre());
    }
    if (start > 0 && within >= pause) dip[at] = std::max(dip[at], goal - lab.block());
    if (start > 0 && since > 60 && since < pause) {
      held = std::max(held, std::abs(lab.block() - wanted));
    }
    if (k % 10 == 0 && at == 1 && within >= pause - 50) {
      told_t.push_back(within - pause + 50);
      told_y.push_back(lab.block());
      told_u.push_back(power);
    }
    if (k % 20 == 0) {
      t.push_back(time);
      y.push_back(lab.block());
      u.push_back(power);
    }
    lab.step(power, fan);
  }
  report.expect("from cold", "u at the hand-over, from the u that holds", jump, jump < 0.1,
                "no jump: the relay moved it by 0.4");
  report.expect("from cold", "largest error 60 s after it (degC)", held, held < 0.5, "it holds");
  const double doubled = 5 * 1.2e-3 / (0.004 * 500);
  report.check_reference("from cold", "what the fan takes (1/s)", doubled, cooling, 0.15,
                         "as simulated");
  report.expect("fan", "dip, not given (degC)", dip[0], true, "reported");
  report.expect("fan", "dip, given (degC)", dip[1], dip[1] < 0.3, "below 0.3");
  report.expect("fan", "dip, given 30 % too little (degC)", dip[2], dip[2] < dip[0],
                "below what it is if not given");
  report.expect("fan", "dip, lost (degC)", dip[3], std::abs(dip[3] / dip[0] - 1) < 0.2,
                "as if it were not given");
  report.expect("fan", "dip at 40 degC, given (degC)", dip[4], dip[4] < 0.3,
                "what was found at 50 degC is true at 40");

  // The others, given the same.
  for (const Way& way : {ways[0], ways[1]}) {
    const Pulse fan = pulse(played(way.form(way.numbers)),
                            [&](double shown) { return cooling * (shown - room) / model.gain; });
    report.expect(way.name, "dip, the fan fed forward (degC)", fan.most, true, "reported");
    report.expect(way.name, "its area, the fan fed forward (degC s)", fan.area, true, "reported");
  }

  Figure figure("heater_cold", {.rows = 2, .columns = 2, .panel_height = 190});
  figure.caption(
      "Left, from cold: full power, a relay that finds gain, lag and dead time, ADRC from the "
      "dashed line on, and five times a fan of 100 % for 400 s: not given, given, given 30 % too "
      "little, lost, given at 40 degrees. Right: a fan from 50 to 450 s under a PI and a Smith "
      "predictor, and under ADRC, fan not known and given; all tuned by one rule.");
  figure.panel(0, 0)
      .y_label("T (°C)")
      .hide_x_numbers()
      .name("from cold")
      .line(t, y, {.color = Color::blue})
      .vertical_line(start);
  figure.panel(1, 0)
      .x_label("t (s)")
      .y_label("power")
      .name("power from cold")
      .line(t, u, {.color = Color::blue})
      .vertical_line(start);
  auto& right = figure.panel(0, 1).hide_x_numbers().legend(Legend::above).name("fan");
  auto& power = figure.panel(1, 1).x_label("t (s)").name("power under the fan");
  const std::array<Color, 3> colors{Color::grey, Color::vermillion, Color::blue};
  for (std::size_t i = 0; i < ways.size(); ++i) {
    right.line(Column(ways[i].fan.t), ways[i].fan.y, {.name = ways[i].name, .color = colors[i]});
    power.line(Column(ways[i].fan.t), ways[i].fan.u, {.color = colors[i]});
  }
  right.line(Column(told_t), told_y, {.name = "ADRC, fan known", .color = Color::green});
  power.line(Column(told_t), told_u, {.color = Color::green});
  report.add(figure);
  return report.finish();
}
