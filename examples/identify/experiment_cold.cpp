// From cold: does the experiment on the machine always end, with a name, within its limits?
//
// Way: sampled, as deployed; the machines in between in ten steps a sample. Random plants and
// faults: --seed, --machines (healthy ones of each kind), --faulty (machines of each kind), --times
// (at which each fault is drawn on each of them).
//
// heater  y' = b0 v - a (y - y_room)            v: u behind a dead time and two lags; u in 0 .. 1
// motor   y' = b0 v - a y                       speed, one way
// tank    y' = b0 v - a sqrt(y)                 level, one valve
// joint   y'' = b0 v - a y' - F sgn(y')         position within a range, both ways
// stand   y' = b0 v - a y + d                   rate of a drone on a stand, both ways
//
// symbol         code                    value                 unit
// b0, a          input_gain, loss        drawn                 unit of y^(n) per unit of u, 1/s
// response       response                a few times noise     unit of y
// its time       response_time           3 to 5 latencies, and 1.5 to 3 times what that move takes
// limits of y    lowest_output, highest_output   room for one response_time and the latency

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/parallel.hpp"
#include "common/report.hpp"

using namespace esokit::examples;
using esokit::AbortReason;
using esokit::Experiment;
using esokit::ExperimentPhase;
using Config = esokit::ExperimentConfig<double>;

namespace {

enum class Kind { heater, motor, tank, joint, stand };
constexpr std::array<const char*, 5> kinds{"heater", "motor", "tank", "joint", "stand"};
enum class Fault { none, still, zero, off, sign, lost, shorted, load, noise };
constexpr std::array<const char*, 9> faults{
    "none",          "sensor stands still", "sensor shows the start", "actuator off",
    "wrong sign",    "sensor lost (NaN)",   "sensor shorted",         "load of 20 to 100 % of u",
    "noise times 30"};
constexpr std::array<const char*, 13> reasons{
    "none",         "travel",      "time_limit",   "bad_sample", "stopped",
    "no_response",  "wrong_sign",  "load_changed", "too_noisy",  "resolution",
    "output_limit", "input_limit", "too_fast"};

struct Machine {
  Kind kind{};
  int order = 1;
  double T{}, input_gain{}, loss{}, lag{}, second_lag{}, dead{}, start{}, noise{}, quantum{};
  double friction{}, load{};
  Config config{};
  Fault fault = Fault::none;
  double fault_time = std::numeric_limits<double>::infinity(), fault_load{};

  [[nodiscard]] double latency() const { return lag + second_lag + dead; }
  /// u from the lower to the upper limit, or the larger of both.
  [[nodiscard]] double range() const {
    return std::max(std::abs(config.limits.lower), config.limits.upper);
  }
};

/// The machine as it runs.
class Run {
 public:
  Run(const Machine& machine, std::uint64_t seed)
      : m_(machine),
        dice_(seed),
        line_(static_cast<std::size_t>(std::lround(machine.dead / h())) + 1, machine.config.input),
        x_(machine.start),
        shown_(machine.start) {}

  void step(double u) {
    const bool faulty = time_ >= m_.fault_time;
    if (m_.fault == Fault::sign) u = -u;
    if (faulty && m_.fault == Fault::off) u = 0;
    const double d = m_.load + (faulty && m_.fault == Fault::load ? m_.fault_load : 0.0);
    for (int i = 0; i < inner; ++i) {
      line_[at_] = u;
      at_ = (at_ + 1) % line_.size();
      first_ += (m_.lag > 0 ? -std::expm1(-h() / m_.lag) : 1.0) * (line_[at_] - first_);
      v_ += (m_.second_lag > 0 ? -std::expm1(-h() / m_.second_lag) : 1.0) * (first_ - v_);
      const double force = m_.input_gain * v_ + d;
      if (m_.kind == Kind::tank) {
        x_ = std::max(x_ + h() * (force - m_.loss * std::sqrt(std::max(x_, 0.0))), 0.0);
      } else if (m_.order == 1) {
        x_ += h() * (force - m_.loss * (x_ - m_.start));
      } else {
        const double a = force - m_.loss * speed_ - m_.friction * std::tanh(speed_ / 1e-3);
        x_ += h() * speed_ + h() * h() / 2 * a;
        speed_ += h() * a;
      }
    }
    time_ += m_.T;
    highest_ = std::max(highest_, x_);
    lowest_ = std::min(lowest_, x_);
  }

  double measured() {
    const bool faulty = time_ >= m_.fault_time;
    std::normal_distribution<double> normal;
    double noise = m_.noise;
    if (faulty && m_.fault == Fault::noise) noise = 30 * std::max(m_.noise, m_.quantum);
    double y = x_ + noise * normal(dice_);
    y = std::round(y / m_.quantum) * m_.quantum;
    if (!faulty) shown_ = y;
    if (!faulty) return y;
    switch (m_.fault) {
      case Fault::still:
        return shown_;
      case Fault::zero:
        return m_.start;
      case Fault::lost:
        return std::numeric_limits<double>::quiet_NaN();
      case Fault::shorted:
        return 1e4 * m_.config.highest_output;
      default:
        return y;
    }
  }

  /// Whether the true y was beyond its limits by more than a sample and the noise.
  [[nodiscard]] bool beyond() const {
    const double room = 2 * m_.T * m_.input_gain * m_.range() + m_.quantum + 5 * m_.noise;
    return highest_ > m_.config.highest_output + room || lowest_ < m_.config.lowest_output - room;
  }
  [[nodiscard]] double time() const { return time_; }
  [[nodiscard]] double y() const { return x_; }

 private:
  static constexpr int inner = 10;
  [[nodiscard]] double h() const { return m_.T / inner; }

  Machine m_;
  std::mt19937_64 dice_;
  std::vector<double> line_;
  std::size_t at_ = 0;
  double x_, shown_, first_ = 0, v_ = 0, speed_ = 0, time_ = 0;
  double highest_ = -std::numeric_limits<double>::infinity();
  double lowest_ = std::numeric_limits<double>::infinity();
};

Machine draw(Kind kind, std::uint64_t seed) {
  std::mt19937_64 dice(seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(dice);
  };
  const auto spread = [&](double a, double b) {
    return std::exp(uniform(std::log(a), std::log(b)));
  };
  Machine m;
  m.kind = kind;
  Config& c = m.config;
  if (kind == Kind::heater || kind == Kind::motor || kind == Kind::tank) {
    double full = 1, rise = 0, weakest = 0, settling = 0;
    if (kind == Kind::heater) {
      m.T = 0.1;
      m.start = uniform(5, 30);
      rise = uniform(20, 200);
      settling = spread(60, 600);
      m.loss = 1 / settling;
      m.input_gain = rise * uniform(1.3, 4) / settling;
      m.lag = spread(1, 0.1 * settling);
      m.dead = spread(0.3, 0.05 * settling);
      m.second_lag = uniform(0, 0.3) * m.lag;
      m.noise = uniform(0.01, 0.1);
      m.quantum = uniform(0, 1) < 0.5 ? 0.0625 : 0.25;
      weakest = m.input_gain - m.loss * rise;
      c.hysteresis = std::max({1.0, 6 * m.noise, 4 * m.quantum});
      c.response = 2;
      c.rest = 5;
    } else if (kind == Kind::motor) {
      m.T = 2e-4;
      rise = uniform(20, 300);
      settling = spread(0.05, 1);
      full = uniform(3, 24);
      m.loss = 1 / settling;
      m.input_gain = rise * uniform(1.3, 4) / settling / full;
      m.lag = spread(1e-3, 0.05 * settling);
      m.dead = spread(1e-3, 0.04 * settling);
      m.noise = rise * uniform(5e-4, 3e-3);
      m.quantum = rise / 500;
      weakest = m.input_gain * full - m.loss * rise;
      c.hysteresis = 0.02 * rise;
      c.response = 0.05 * rise;
      c.rest = 0.02;
    } else {
      m.T = 0.5;
      rise = uniform(0.1, 1);
      settling = spread(30, 600);
      m.input_gain = rise / settling * uniform(1.5, 4);
      m.loss = m.input_gain * uniform(0.2, 0.6) / std::sqrt(rise);
      m.lag = spread(0.5, 0.05 * settling);
      m.dead = spread(0.3, 0.05 * settling);
      m.noise = rise * uniform(1e-3, 5e-3);
      m.quantum = rise / 1000;
      weakest = m.input_gain - m.loss * std::sqrt(rise);
      c.hysteresis = 0.02 * rise;
      c.response = 0.05 * rise;
      c.rest = 10;
    }
    c.amplitude = 0.45 * full;
    c.approach = {{.input = full, .output = m.start + rise}};
    c.limits = {.lower = 0, .upper = full};
    c.response_time = uniform(1.5, 3) * c.response / weakest + uniform(3, 5) * m.latency();
    const double room = (c.response_time + 3 * m.latency()) * m.input_gain * full;
    c.travel = rise;
    c.lowest_output = m.start - 0.2 * rise - room;
    c.highest_output = m.start + 1.1 * rise + room;
    c.time_limit = 60 * settling + 400 * m.latency();
    c.sample_time = m.T;
    return m;
  }
  const double A = kind == Kind::joint ? uniform(0.5, 1) : uniform(0.1, 0.4);
  c.amplitude = A;
  c.limits = {.lower = -1, .upper = 1};
  c.time_limit = 30;
  double room = 0;
  if (kind == Kind::joint) {
    m.order = 2;
    m.T = 1e-3;
    m.start = uniform(-1, 1);
    m.input_gain = spread(5, 200);
    m.loss = uniform(0, 3);
    m.lag = spread(2e-3, 15e-3);
    m.dead = spread(1e-3, 6e-3);
    m.friction = uniform(0, 0.15) * m.input_gain * A;
    m.quantum = 2 * 3.14159265358979 / 4096;
    const double fastest = m.input_gain * A;
    c.lead = 5 * m.latency();
    c.hysteresis = std::max(0.02, 0.1 * fastest * c.lead * c.lead);
    c.response = 4 * m.quantum;
    c.response_time = uniform(1.2, 2) * (3 * c.lead + 3 * std::sqrt(2 * c.hysteresis / fastest));
    c.travel = std::max(0.5, 30 * fastest * c.lead * c.lead);
    c.rest = 0.05;
    room = fastest * c.response_time * (c.lead + c.response_time);
  } else {
    m.T = 2e-3;
    m.input_gain = spread(20, 400);
    m.loss = uniform(0, 1);
    m.lag = spread(0.02, 0.06);
    m.dead = spread(2e-3, 10e-3);
    m.noise = uniform(5e-3, 0.03);
    m.quantum = 1e-3;
    const double fastest = m.input_gain * A;
    m.load = uniform(-0.2, 0.2) * fastest;
    c.hysteresis = std::max(6 * m.noise, 0.2 * fastest * m.latency());
    c.response = 6 * m.noise + 0.3 * fastest * m.latency();
    c.response_time = uniform(3, 5) * m.latency() + uniform(1.5, 3) * c.response / (0.8 * fastest);
    c.travel = 5 * fastest * m.latency() + 10 * c.hysteresis;
    room = 1.2 * fastest * (c.response_time + 3 * m.latency());
  }
  c.lowest_output = m.start - c.travel - room;
  c.highest_output = m.start + c.travel + room;
  c.sample_time = m.T;
  return m;
}

struct Outcome {
  AbortReason reason{};
  ExperimentPhase phase{};
  bool beyond = false, unsafe = false, endless = false;
  std::optional<esokit::ExperimentResult<double>> result;
  double time = 0;
};

template <int Order>
Outcome play_order(const Machine& machine, std::uint64_t seed) {
  auto experiment = Experiment<Order>::make(machine.config).value();
  Run run(machine, seed);
  Outcome outcome;
  const double most = machine.config.time_limit + 2 * machine.T;
  while (!experiment.finished() && run.time() < most) run.step(experiment.update(run.measured()));
  outcome.endless = !experiment.finished();
  outcome.time = run.time();
  outcome.reason = experiment.reason();
  outcome.phase = experiment.phase();
  outcome.unsafe = experiment.output() != machine.config.input;
  if (const auto result = experiment.result()) outcome.result = *result;
  // What still moves by itself: not a load, nor what goes on by its speed or without a u that
  // holds.
  const bool coasts =
      machine.kind == Kind::heater || machine.kind == Kind::motor || machine.kind == Kind::tank;
  if (coasts && machine.fault != Fault::load) {
    for (double t = 0; t < 10 * machine.latency(); t += machine.T) run.step(experiment.update(0));
  }
  outcome.beyond = run.beyond();
  return outcome;
}

Outcome play(const Machine& machine, std::uint64_t seed) {
  return machine.order == 1 ? play_order<1>(machine, seed) : play_order<2>(machine, seed);
}

/// All faults on a machine.
std::vector<Outcome> with_faults(const Machine& healthy, std::uint64_t seed, std::int64_t times) {
  const double whole = play(healthy, seed).time;
  std::mt19937_64 dice(seed + 1);
  std::vector<Outcome> outcomes;
  for (std::size_t f = 1; f < faults.size(); ++f) {
    const auto fault = static_cast<Fault>(f);
    for (std::int64_t i = 0; i < (fault == Fault::sign ? 1 : times); ++i) {
      Machine machine = healthy;
      machine.fault = fault;
      machine.fault_time = std::uniform_real_distribution<double>(0, whole)(dice);
      machine.fault_load = (dice() % 2 == 0 ? 1 : -1) * machine.range() * machine.input_gain *
                           std::uniform_real_distribution<double>(0.2, 1)(dice);
      outcomes.push_back(play(machine, seed));
    }
  }
  return outcomes;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

std::string of(std::size_t part, std::size_t whole) {
  return std::to_string(part) + " of " + std::to_string(whole);
}

/// One heater from cold, and the controller that takes over.
void draw_one(Report& report) {
  Machine heater;
  heater.kind = Kind::heater;
  heater.T = 0.1;
  heater.start = 22;
  heater.input_gain = 1.8;
  heater.loss = 1.0 / 120;
  heater.lag = 4;
  heater.second_lag = 1;
  heater.dead = 2;
  heater.noise = 0.03;
  heater.quantum = 0.0625;
  heater.config = {.sample_time = 0.1,
                   .amplitude = 0.4,
                   .hysteresis = 1,
                   .rest = 5,
                   .approach = {{.input = 1, .output = 100}},
                   .response = 2,
                   .response_time = 30,
                   .travel = 30,
                   .lowest_output = 0,
                   .highest_output = 150,
                   .time_limit = 1200,
                   .hand_over = 60,
                   .limits = {.lower = 0, .upper = 1}};
  using Controller = esokit::Adrc<esokit::LinearEso<1>>;
  auto experiment = Experiment<1>::make(heater.config).value();
  std::optional<Controller> controller;
  Run run(heater, 1);
  std::vector<double> time, y, u;
  double hand_over = 0, centred = 0, worst = 0;
  while (run.time() < hand_over + 150 || hand_over == 0) {
    const double measured = run.measured(), held = u.empty() ? 0.0 : u.back();
    double next = 0;
    if (!experiment.finished()) {
      next = experiment.update(measured);
      if (centred == 0 && experiment.phase() == ExperimentPhase::settling) centred = run.time();
      if (experiment.phase() == ExperimentPhase::hand_over) {
        if (!controller) {
          const auto found = experiment.result().value();
          const double omega_c = 0.25 / found.latency;
          controller = Controller::make({.observer = {.observer_bandwidth = 3 * omega_c,
                                                      .input_gain = found.input_gain,
                                                      .sample_time = heater.T},
                                         .controller_bandwidth = omega_c,
                                         .limits = heater.config.limits})
                           .value();
          (void)controller->start(measured, held);
        } else {
          (void)controller->track(measured, 100.0, held);
        }
      }
    }
    if (experiment.finished()) {
      if (hand_over == 0) hand_over = run.time();
      controller->applied(held);
      next = controller->update(measured, 100.0);
      if (run.time() > hand_over + 60) worst = std::max(worst, std::abs(run.y() - 100));
    }
    time.push_back(run.time());
    y.push_back(run.y());
    u.push_back(next);
    run.step(next);
  }
  const auto found = experiment.result().value();
  report.check_reference("one heater", "b0 (K/s)", heater.input_gain, found.input_gain,
                         found.input_gain_half_width / heater.input_gain, "within its interval");
  report.check_reference("one heater", "u that holds 100", 78.0 / 120 / 1.8, experiment.centre(),
                         0.05);
  report.expect("one heater", "largest error from 60 s after the hand-over on (K)", worst,
                worst < 1.0, "the controller holds it");
  Figure figure("from_cold", {.rows = 2, .columns = 1, .panel_height = 190});
  figure.caption(
      "A heater from 22 to 100 degrees: full power until y will arrive by itself, full power and "
      "none in turn for two cycles, which show that u = " +
      number_text(experiment.centre(), 3) +
      " holds it (first dashed line); from there 0.4 more and less, for b0 = " +
      number_text(found.input_gain, 3) + " +- " + number_text(found.input_gain_half_width, 1) +
      " K/s (true 1.8); at the second dashed line ADRC takes over.");
  figure.panel(0, 0)
      .y_label("y (degrees)")
      .name("y")
      .line(time, y, {.color = Color::blue, .column = "y"})
      .vertical_line(centred)
      .vertical_line(hand_over);
  figure.panel(1, 0)
      .x_label("t (s)")
      .y_label("u")
      .name("u")
      .line(time, u, {.color = Color::vermillion, .column = "u"})
      .vertical_line(centred)
      .vertical_line(hand_over);
  report.add(figure);
}

}  // namespace

int main(int argc, char** argv) {
  const auto machines = static_cast<std::size_t>(take_count(argc, argv, "--machines", 20));
  const auto faulty = static_cast<std::size_t>(take_count(argc, argv, "--faulty", 3));
  const auto times = take_count(argc, argv, "--times", 4);
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  Report report(argc, argv, "identify", "experiment_cold",
                {.paper_title = "From a log to a model",
                 .citation = "No paper. Order, b0, lag, dead time, friction and noise from logs, "
                             "with intervals",
                 .link = "",
                 .title = "From cold: heat up, measure, hand over, and every way it can end",
                 .description = "Heaters, motors, tanks, joints and drones on a stand, drawn; and "
                                "eight faults at drawn times.",
                 .order = 4});
  draw_one(report);

  const auto number = [&](std::size_t k, std::size_t i) { return (seed * 5 + k) * 1'000'000 + i; };
  std::size_t endless = 0, unsafe = 0, beyond = 0, runs = 0;
  const auto count = [&](const Outcome& o) {
    ++runs;
    endless += o.endless ? 1U : 0U;
    unsafe += o.unsafe ? 1 : 0;
    beyond += o.beyond ? 1 : 0;
  };
  std::vector<CsvRow> rows;
  std::size_t results = 0, covered = 0;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const auto kind = static_cast<Kind>(k);
    const auto outcomes = run_parallel(kinds[k], machines, [&](std::size_t i) {
      return play(draw(kind, number(k, i)), number(k, i));
    });
    std::size_t found = 0, within = 0, aborted = 0;
    std::vector<double> errors, widths;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const Outcome& o = outcomes[i];
      count(o);
      aborted += o.phase == ExperimentPhase::aborted ? 1 : 0;
      if (!o.result) continue;
      const double b = draw(kind, number(k, i)).input_gain;
      const double error = std::abs(o.result->input_gain - b);
      ++found;
      within += error <= o.result->input_gain_half_width ? 1U : 0U;
      errors.push_back(error / b);
      widths.push_back(o.result->input_gain_half_width / b);
    }
    results += found;
    covered += within;
    rows.push_back({kinds[k], of(found, machines), of(aborted, machines), of(within, found),
                    number_text(100 * quantile(errors, 0.5), 2),
                    number_text(100 * quantile(errors, 0.95), 2),
                    number_text(100 * quantile(widths, 0.5), 2)});
  }
  report.table("healthy", "Healthy machines",
               {"machine", "result", "aborted", "b0 within its interval", "error of b0, median (%)",
                "95 % (%)", "half width, median (%)"},
               rows);

  // fault -> reason -> number
  std::array<std::array<std::size_t, reasons.size()>, faults.size()> ends{};
  std::array<std::size_t, faults.size()> refused{}, found{}, wrong{};
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const auto kind = static_cast<Kind>(k);
    const auto outcomes =
        run_parallel(std::string(kinds[k]) + ", faults", faulty, [&](std::size_t i) {
          const std::uint64_t own = number(k, i) + 500'000;
          return with_faults(draw(kind, own), own, times);
        });
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const double b = draw(kind, number(k, i) + 500'000).input_gain;
      std::size_t next = 0;
      for (std::size_t f = 1; f < faults.size(); ++f) {
        const auto of_it = static_cast<Fault>(f) == Fault::sign ? 1 : times;
        for (std::int64_t j = 0; j < of_it; ++j) {
          const Outcome& o = outcomes[i][next++];
          count(o);
          if (o.reason != AbortReason::none) {
            ++ends[f][static_cast<std::size_t>(o.reason)];
          } else if (!o.result) {
            ++refused[f];
          } else {
            ++found[f];
            wrong[f] +=
                std::abs(o.result->input_gain - b) > o.result->input_gain_half_width ? 1U : 0U;
          }
        }
      }
    }
  }
  CsvRow head{"fault"};
  for (std::size_t r = 1; r < reasons.size(); ++r) {
    if (r != static_cast<std::size_t>(AbortReason::stopped)) head.push_back(reasons[r]);
  }
  head.insert(head.end(), {"refused by result()", "result", "of these beyond their interval"});
  std::vector<CsvRow> table;
  for (std::size_t f = 1; f < faults.size(); ++f) {
    CsvRow row{faults[f]};
    for (std::size_t r = 1; r < reasons.size(); ++r) {
      if (r != static_cast<std::size_t>(AbortReason::stopped)) {
        row.push_back(std::to_string(ends[f][r]));
      }
    }
    row.insert(row.end(),
               {std::to_string(refused[f]), std::to_string(found[f]), std::to_string(wrong[f])});
    table.push_back(row);
  }
  report.table("faults", "How experiments with a fault ended, all machines", head, table);
  report.check("all", "runs", {}, static_cast<double>(runs));
  report.expect("all", "without an end", static_cast<double>(endless), endless == 0, "none");
  report.expect("all", "ended with another u than the safe one", static_cast<double>(unsafe),
                unsafe == 0, "none");
  report.expect("all", "y beyond its limits", static_cast<double>(beyond), beyond == 0, "none");
  report.check("healthy", "with a result (share)", {},
               static_cast<double>(results) / static_cast<double>(kinds.size() * machines));
  report.check("healthy", "b0 within its interval (share)", {},
               static_cast<double>(covered) / static_cast<double>(results));
  return report.finish();
}
