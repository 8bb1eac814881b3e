// ADRC against the best PIDs, all tuned by `tune` and `tune_pids` for the same J, to the same
// margins and the same noise in u, on four machines of the trades. Designed once on the nominal
// machine, run on drawn ones.
//
// choosing_pid OUT [--count N] [--seed S]: random plants of each kind (CI: 6).

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <esokit/tune/tuned_controller.hpp>

#include "common/compiled/tune.hpp"
#include "common/figure.hpp"
#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

/// (r, r', ..) of the reference.
using Motion = std::array<double, 5>;

/// y^(n) = b v - a y^(n-1) - friction - gravity + d; v follows u by a lag after a dead time.
struct Machine {
  std::string name;
  TuneModel model;  ///< what the designs know
  double noise;     ///< that u may have, share of its range: what all use that can
  double b, pole, lag, dead_time, friction, gravity, resolution;
};

/// What is wrong in the model that the designs are made for.
enum class Wrong { nothing, no_lag, order };

/// What is done to a machine.
struct Case {
  const char* name;
  double step = 0.0;     ///< of the reference, share of the largest way
  bool profile = false;  ///< along a polynomial instead
  double load = 0.0;     ///< share of half the range of u
  double gap = 0.0;      ///< without samples, latencies
  double loss = 0.0;     ///< share of samples that are lost
  double gain = 1.0;     ///< factor on b
  double later = 0.0;    ///< more dead time, latencies
  double stale = 0.0;    ///< share of samples that show y as it was a latency ago
  bool coarse = false;   ///< encoder
  bool peak = false;     ///< judged by the largest error, else by the integral of its magnitude
  Wrong wrong = Wrong::nothing;  ///< in the model that the designs get
};
const std::vector<Case> cases{
    {.name = "reference step", .step = 0.03},
    {.name = "profile", .step = 0.5, .profile = true, .peak = true},
    {.name = "load step", .load = 0.3},
    {.name = "load step, peak", .load = 0.3, .peak = true},
    {.name = "step into the limits", .step = 1.5},
    {.name = "gap of a latency", .step = 0.5, .profile = true, .gap = 1.0, .peak = true},
    {.name = "gap of three", .step = 0.5, .profile = true, .gap = 3.0, .peak = true},
    {.name = "load, 30 % lost", .load = 0.3, .loss = 0.3},
    {.name = "load, b half", .load = 0.3, .gain = 0.5},
    {.name = "load, b double", .load = 0.3, .gain = 2.0},
    {.name = "load, encoder", .load = 0.3, .coarse = true},
    {.name = "load, later by half", .load = 0.3, .later = 0.5},
    {.name = "load, 30 % late", .load = 0.3, .stale = 0.3},
    {.name = "load, lag unknown", .load = 0.3, .wrong = Wrong::no_lag},
    {.name = "load, order wrong", .load = 0.3, .wrong = Wrong::order}};
constexpr std::size_t load_step = 2;

/// Once a sample: y (NaN: lost), the reference, and what was applied of the last u but what is
/// known of the machine.
using Running = std::function<double(double y, const Motion& r, double applied)>;

struct Row {
  std::string name;
  int numbers;  ///< tuned; 0: by a rule
  double noise, excess, modulus;
  std::function<Running(bool profile)> start;
  int bridges = 0;               ///< samples, the longest gap; 0: has no such limit
  Wrong wrong = Wrong::nothing;  ///< in the model for which it was tuned
};

enum class Lost { y, error, frozen };

/// A PID. Along a profile it acts on the error, filter and derivative too, beside a feed-forward of
/// the derivatives of the reference, lag included. A step gets its weight of the reference, or with
/// a bandwidth goes through a reference model of n + 2 poles there, as a profile.
/// @param profile whether the reference is one
Running running(const PlainPidConfig& config, const TuneModel& model, Lost rule, double bandwidth,
                bool profile) {
  const bool by_weight = !profile && !(bandwidth > 0.0);
  return [=, pid = PlainPid::make(config).value(), last = 0.0, last_error = 0.0, last_u = 0.0,
          fed = 0.0, made = Motion{}](double y, const Motion& given, double) mutable {
    const auto n = static_cast<std::size_t>(model.order);
    Motion r = given;
    if (bandwidth > 0.0 && !profile) {
      // made[0 .. n + 1] are the states of the model.
      const int parts = 4;
      for (int part = 0; part < parts; ++part) {
        double top = std::pow(bandwidth, static_cast<double>(n + 2)) * (given[0] - made[0]);
        double binomial = 1.0;
        for (std::size_t i = 1; i < n + 2; ++i) {
          binomial *= static_cast<double>(n + 3 - i) / static_cast<double>(i);
          top -= binomial * std::pow(bandwidth, static_cast<double>(n + 2 - i)) * made[i];
        }
        const double h = model.sample_time / parts;
        made[n + 1] += h * top;
        for (std::size_t i = n + 1; i-- > 0;) made[i] += h * made[i + 1];
      }
      r = made;
    }
    const double now = (r[n] + model.lag * r[n + 1]) / model.input_gain.value;
    if (!std::isfinite(y)) {
      if (rule == Lost::frozen) {
        last_u += now - fed;
        fed = now;
        return last_u;
      }
      y = rule == Lost::y ? last : r[0] - last_error;
    }
    last = y;
    last_error = r[0] - y;
    fed = now;
    last_u = by_weight ? pid.update(y, r[0]) : pid.update(y - r[0], 0.0, now);
    return last_u;
  };
}

/// @param whole whether with variants and rules, else only the two of ADRC and the best PID
std::vector<Row> rows_of(const Tuning& tuning, const std::vector<TunedPid>& baselines, bool whole) {
  std::vector<Row> rows;
  const TuneModel& model = tuning.model;
  // Without the gain for a gap: a lost y is replaced by the predicted one, so that the next
  // correction is one of a sample.
  const auto adrc = [&](const std::string& name, const TunedDesign& d, bool gap_gain) {
    std::function<Running(bool)> start;
    int bridges = 0;
    const auto visit = [&](const auto& controller) {
      if (gap_gain) bridges = controller.observer().max_gap();
      start = [controller, gap_gain](bool) {
        return [own = controller, gap_gain](double y, const Motion& r, double applied) mutable {
          typename std::remove_cvref_t<decltype(own)>::Reference::All all;
          for (int i = 0; i < all.rows(); ++i) all(i) = r[static_cast<std::size_t>(i)];
          if (!gap_gain && !std::isfinite(y)) {
            auto ahead = own;
            ahead.applied(applied);
            ahead.update(y, all);
            y = ahead.observer().estimate()(0);
          }
          own.applied(applied);
          return own.update(y, all);
        };
      };
    };
    // What a loop does in a gap is asked here, not where u would be safe.
    const esokit::MissingRule<double> hold{.hold = true};
    const auto made = model.order == 1 ? with_controller<1>(model, d, visit, hold)
                                       : with_controller<2>(model, d, visit, hold);
    if (made)
      rows.push_back(
          {name, d.numbers, d.control_noise, d.excess, d.modulus_margin, start, bridges});
  };
  adrc("ADRC, recommended", *tuning.chosen(), true);
  for (const TunedDesign& d : tuning.designs) {
    if (d.numbers != 2 || !d.feasible || !d.recovers) continue;
    adrc("ADRC, two bandwidths", d, true);
    break;
  }
  if (whole) adrc("ADRC, recommended, no gain for gaps", *tuning.chosen(), false);
  const auto pid = [&](const std::string& name, const TunedPid& baseline, double time, Lost rule,
                       double bandwidth = 0.0) {
    auto config = baseline.pid;
    config.tracking_time = time > 0.0 ? std::max(time, config.sample_time) : 0.0;
    rows.push_back({name, baseline.design.numbers, baseline.design.control_noise,
                    baseline.design.excess, baseline.design.modulus_margin,
                    [=, model = model](bool profile) {
                      return running(config, model, rule, bandwidth, profile);
                    }});
  };
  const TunedPid& best = baselines.front();
  const double ti = best.pid.integral_time(), td = best.pid.derivative_time();
  pid("PID, best", best, std::sqrt(ti * td), Lost::y);
  if (!whole) return rows;
  pid("PID, Tt = Ti", best, ti, Lost::y);
  pid("PID, Tt = Td", best, td, Lost::y);
  pid("PID, clamping", best, 0.0, Lost::y);
  pid("PID, holds the error", best, std::sqrt(ti * td), Lost::error);
  pid("PID, freezes", best, std::sqrt(ti * td), Lost::frozen);
  // As fast as the law of ADRC.
  const auto& law = tuning.chosen()->settings.gains;
  pid("PID, reference model", best, std::sqrt(ti * td), Lost::error,
      1.5 * detail::law_mean(law, model.order));
  for (const TunedPid& baseline : baselines) {
    if (baseline.kind == PidKind::filtered && &baseline != &best && baseline.design.feasible)
      pid("PID, damping 0.707", baseline, baseline.pid.tracking_time, Lost::y);
    if (baseline.kind == PidKind::pi && baseline.design.feasible)
      pid("PI, best", baseline, baseline.pid.tracking_time, Lost::y);
  }
  // By rules. SIMC is slowed down until it is as quiet as asked; AMIGO has nothing to choose.
  const auto ruled = [&](const std::string& name, PlainPidConfig config) {
    config.tracking_time = std::sqrt(config.integral_time() * config.derivative_time());
    config.tracking_time = std::max(config.tracking_time, model.sample_time);
    auto baseline = compiled::given_pid(tuning, config);
    if (!baseline || baseline->design.constraint == "stability") return false;
    if (name == "SIMC" && baseline->design.control_noise > tuning.control_noise) return false;
    baseline->design.numbers = 0;
    pid(name, *baseline, config.tracking_time, Lost::y);
    return true;
  };
  const double b0 = model.input_gain.value;
  const double theta = model.dead_time + 0.5 * model.sample_time;
  for (double slow = model.order == 1 ? theta : theta + model.lag; slow < 1e4 * theta;
       slow *= 1.1) {
    // In series: K_c (1 + 1 / (t_i s)) (1 + t_d s).
    double kc = 0.0, i = 0.0, d = 0.0;
    if (model.order == 1) {
      kc = 1.0 / (b0 * (slow + theta));
      i = std::min(1.0 / std::max(model.pole, 1e-9), 4.0 * (slow + theta));
      d = model.lag;
    } else {
      const double both = slow + theta + model.lag;
      kc = 1.0 / (16.0 * b0 * both * both) * 4.0;
      i = d = 4.0 * both;
    }
    if (ruled("SIMC", {.proportional = kc * (1.0 + d / i),
                       .integral = kc / i,
                       .derivative = kc * d,
                       .derivative_filter = d / 10.0}))
      break;
  }
  // One over T / L, which is infinite if the plant integrates, and the slope after L.
  const bool integrates = model.order == 2;
  const double l = theta + model.lag + (integrates ? 1.0 / model.pole : 0.0);
  const double x = integrates ? 0.0 : model.pole * l, slope = integrates ? b0 / model.pole : b0;
  const double k = (0.45 + 0.2 * x) / (slope * l), d = 0.5 * l / (1.0 + 0.3 * x);
  ruled("AMIGO", {.proportional = k,
                  .integral = k / ((0.8 + 0.4 * x) / (0.1 + x) * l),
                  .derivative = k * d,
                  .derivative_filter = d / 10.0});
  return rows;
}

/// From 0 to 1 in the time 1, at rest with three derivatives; by powers of t: t^4 .. t^7.
Motion polynomial(double t, double height, double time) {
  Motion r{};
  if (t <= 0.0) return r;
  if (t >= time) {
    r[0] = height;
    return r;
  }
  const double x = t / time;
  std::array<double, 8> c{0, 0, 0, 0, 35, -84, 70, -20};
  double scale = height;
  for (double& value : r) {
    for (std::size_t i = 8; i-- > 0;) value = value * x + c[i];
    value *= scale;
    scale /= time;
    for (std::size_t i = 0; i + 1 < 8; ++i) c[i] = static_cast<double>(i + 1) * c[i + 1];
    c[7] = 0.0;
  }
  return r;
}

struct Outcome {
  double error = 0.0, overshoot = 0.0;
};

Outcome run(const Machine& machine, const Case& asked, Running controller, std::uint64_t seed) {
  const TuneModel& model = machine.model;
  const double T = model.sample_time, latency = model.latency();
  const double half = 0.5 * (model.u_max - model.u_min), b0 = model.input_gain.value;
  const auto n = static_cast<std::size_t>(model.order);
  const double way = asked.step * overload_distance(model, 1.0, overloads.back());
  const double moving = 60.0 * latency, b = machine.b * asked.gain;
  constexpr int parts = 5;
  const double h = T / parts;
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<double> line(
      static_cast<std::size_t>(std::lround((machine.dead_time + asked.later * latency) / h)) + 1);
  std::size_t at = 0;
  double y = 0.0, speed = 0.0, v = 0.0, u = 0.0, known = 0.0;
  std::vector<double> history;  // of what was measured
  const auto old = static_cast<std::size_t>(std::lround(latency / T));
  const double decay = machine.lag > 0.0 ? std::exp(-h / machine.lag) : 0.0;
  // Friction of a speed is that of y itself.
  const double rub_scale =
      model.order == 1 ? 0.01 * half * b0 * latency : 0.002 * half * b0 * latency;
  const auto rub = [&](double of) { return machine.friction * std::tanh(of / rub_scale); };
  Outcome result;
  const auto last = static_cast<long>(200.0 * latency / T);
  const double begin = 10.0 * latency, gap_from = begin + 0.4 * moving;
  for (long k = 0; k < last; ++k) {
    const double t = static_cast<double>(k) * T;
    Motion r{};
    if (asked.profile) {
      r = polynomial(t - begin, way, moving);
    } else if (t >= begin) {
      r[0] = way;
    }
    const double error = r[0] - y;
    if (t >= begin) {
      result.error =
          asked.peak ? std::max(result.error, std::abs(error)) : result.error + T * std::abs(error);
      if (asked.step > 0.0) result.overshoot = std::max(result.overshoot, -error / way);
    }
    double measured = y + model.noise * normal(generator);
    if (asked.coarse) measured = machine.resolution * std::round(measured / machine.resolution);
    history.push_back(measured);
    const double chance = uniform(generator);
    if (chance < asked.stale)
      measured = history[history.size() - std::min(history.size(), old + 1)];
    const bool lost = chance < asked.loss ||
                      (asked.gap > 0.0 && t >= gap_from && t < gap_from + asked.gap * latency);
    if (lost) measured = std::numeric_limits<double>::quiet_NaN();
    const double wanted = controller(measured, r, u - known);
    // What is known along the reference, for all alike: pole, friction, gravity.
    const bool steps = !asked.profile;
    known = steps ? 0.0
                  : (model.pole * r[n - 1] + rub(r[n - 1]) +
                     (model.order == 2 ? machine.gravity * std::sin(r[0]) : 0.0)) /
                        b0;
    u = std::clamp(wanted + known, -half, half);
    const double d = t >= begin ? asked.load * half * b0 : 0.0;
    for (int part = 0; part < parts; ++part) {
      line[at] = u;
      at = (at + 1) % line.size();
      const double late = line[at];
      v = late + decay * (v - late);
      if (model.order == 1) {
        y += h * (b * v - machine.pole * y - rub(y) + d);
      } else {
        speed +=
            h * (b * v - machine.pole * speed - rub(speed) - machine.gravity * std::sin(y) + d);
        y += h * speed;
      }
    }
    if (!(std::abs(y) < 1e12)) return {std::numeric_limits<double>::infinity(), 10.0};
  }
  return result;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

std::vector<Machine> machines() {
  // Disturbed so much that margins limit all designs. The noise in u is the next smaller of 1, 2,
  // 5, 10 .. to what the quietest of ADRC and of the PIDs with a filter of second order has without
  // a limit (2.5, 0.69, 0.11 and 1.3 % of the range), so that all have the same.
  const auto made = [](std::string name, TuneModel model, double noise, double friction,
                       double gravity, double resolution) {
    model.latency_half_width = 0.05 * model.latency();
    model.disturbance = model.disturbance_of((model.order == 1 ? 2.0 : 1.0) / model.latency());
    return Machine{std::move(name), model,     noise,           model.input_gain.value,
                   model.pole,      model.lag, model.dead_time, friction,
                   gravity,         resolution};
  };
  TuneModel joint{.order = 2,
                  .input_gain = {80.0, 4.0},
                  .pole = 1.0,
                  .lag = 0.004,
                  .dead_time = 0.001,
                  .noise = 1e-4,
                  .disturbance = 1.0,
                  .sample_time = 1e-3,
                  .u_min = -5.0,
                  .u_max = 5.0};
  TuneModel drive{.order = 1,
                  .input_gain = {400.0, 20.0},
                  .pole = 5.0,
                  .lag = 0.015,
                  .dead_time = 0.001,
                  .noise = 0.3,
                  .disturbance = 1.0,
                  .sample_time = 1e-3,
                  .u_min = -10.0,
                  .u_max = 10.0};
  TuneModel heater{.order = 1,
                   .input_gain = {0.02, 0.001},
                   .pole = 1.0 / 300.0,
                   .lag = 30.0,
                   .dead_time = 20.0,
                   .noise = 0.03,
                   .disturbance = 1.0,
                   .sample_time = 1.0,
                   .u_min = -50.0,
                   .u_max = 50.0};
  TuneModel rate{.order = 1,
                 .input_gain = {2000.0, 100.0},
                 .pole = 1.0,
                 .lag = 0.03,
                 .dead_time = 0.002,
                 .noise = 0.5,
                 .disturbance = 1.0,
                 .sample_time = 1e-3,
                 .u_min = -1.0,
                 .u_max = 1.0};
  return {made("joint", joint, 0.02, 12.0, 25.0, 1e-3), made("drive", drive, 0.005, 60.0, 0.0, 2.0),
          made("heater", heater, 0.001, 0.0, 0.0, 0.1), made("rate", rate, 0.01, 0.0, 0.0, 4.0)};
}

/// The model that the designs get. Of order 1 the lag becomes a pole of order 2; of order 2 a pole
/// becomes the lag of order 1, and its lag dead time.
TuneModel mistaken(TuneModel model, Wrong wrong) {
  if (wrong == Wrong::no_lag) model.lag = 0.0;
  if (wrong == Wrong::order && model.order == 1) {
    const double factor = 1.0 / model.lag;
    model.order = 2;
    model.pole += factor;
    model.input_gain = {factor * model.input_gain.value, factor * model.input_gain.half_width};
    model.lag = 0.0;
  } else if (wrong == Wrong::order) {
    const double factor = 1.0 / model.pole;
    model.order = 1;
    model.dead_time += model.lag;
    model.lag = factor;
    model.pole = 0.0;
    model.input_gain = {factor * model.input_gain.value, factor * model.input_gain.half_width};
  }
  return model;
}

}  // namespace

int main(int argc, char** argv) {
  std::size_t count = 6;
  std::uint64_t seed = 47;
  std::vector<char*> rest;
  for (int i = 0; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--count" && i + 1 < argc) {
      count = std::strtoul(argv[++i], nullptr, 10);
    } else if (name == "--seed" && i + 1 < argc) {
      seed = std::strtoul(argv[++i], nullptr, 10);
    } else {
      rest.push_back(argv[i]);
    }
  }
  Report report(
      static_cast<int>(rest.size()), rest.data(), "choosing", "pid",
      {.title = "Against the best PID",
       .description = "ADRC and PIDs, all tuned for the same J under the same margins and noise in "
                      "u, on random plants: who wins where, and by how much."});
  struct Verdict {
    std::string where, variant;
    double ratio;
    bool recommended, both_lost;
  };
  std::vector<Verdict> verdicts;
  Figure figure("pid", {.rows = 1, .columns = 1, .panel_height = 400});
  figure.caption(
      "Errors of the recommended ADRC over those of the best PID, with the anti-windup, the rule "
      "for lost samples and the reference model that are best in this case: to the left of 1 ADRC "
      "is better, to the right the PID. Medians of random plants. Both are tuned for the same J, "
      "margins and noise in u, with the same feed-forward.");
  Panel& panel = figure.panel(0, 0)
                     .log_x()
                     .x_range(0.01, 50.0)
                     .y_range(0.2, static_cast<double>(cases.size()) + 1.0)
                     .y_tick(100.0)
                     .x_label("error of ADRC / error of the best PID")
                     .legend(Legend::above)
                     .name("ratios")
                     .vertical_line(1.0);
  for (std::size_t c = 0; c < cases.size(); ++c)
    panel.note(0.0107, static_cast<double>(cases.size() - c), cases[c].name);
  const std::array<Marker, 4> markers{Marker::circle, Marker::square, Marker::triangle,
                                      Marker::cross};
  std::size_t drawn_machines = 0;
  for (const Machine& nominal : machines()) {
    const TuneSpecification wish{.control_noise =
                                     nominal.noise * (nominal.model.u_max - nominal.model.u_min)};
    const auto tuning = compiled::tune(nominal.model, wish);
    if (!tuning || tuning->chosen() == nullptr) {
      report.expect(nominal.name, "designs", 0.0, false, "there is one");
      continue;
    }
    const auto baselines = compiled::tune_pids(*tuning);
    auto rows = rows_of(*tuning, baselines, true);
    const std::size_t right = rows.size();
    for (const Wrong wrong : {Wrong::no_lag, Wrong::order}) {
      TuneModel model = mistaken(nominal.model, wrong);
      model.disturbance = model.disturbance_of(nominal.model.filter_bandwidth());
      const auto made = compiled::tune(model, wish);
      if (!made || made->chosen() == nullptr) {
        report.expect(nominal.name, "designs for a wrong model", 0.0, false, "there is one");
        continue;
      }
      for (Row& row : rows_of(*made, compiled::tune_pids(*made), false)) {
        row.wrong = wrong;
        rows.push_back(std::move(row));
      }
    }
    // Errors by row, case and machine.
    std::vector<std::vector<std::vector<Outcome>>> all(
        rows.size(), std::vector<std::vector<Outcome>>(cases.size()));
    std::mt19937_64 generator(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (std::size_t i = 0; i < count; ++i) {
      Machine drawn = nominal;
      const auto about = [&](double by) { return std::pow(by, uniform(generator)); };
      drawn.b *= about(1.15);
      drawn.pole *= about(1.5);
      drawn.lag *= about(1.15);
      drawn.dead_time *= about(1.15);
      drawn.friction *= about(1.5);
      drawn.gravity *= about(1.3);
      for (std::size_t row = 0; row < rows.size(); ++row) {
        for (std::size_t c = 0; c < cases.size(); ++c)
          if (cases[c].wrong == rows[row].wrong)
            all[row][c].push_back(
                run(drawn, cases[c], rows[row].start(cases[c].profile), seed + i));
      }
    }
    std::size_t best = 0;
    while (rows[best].name != "PID, best") ++best;
    std::vector<CsvRow> lines;
    std::vector<std::string> head{"controller",     "tuned numbers",
                                  "root of J / J*", "noise in u, % of its range",
                                  "modulus margin", "longest gap, latencies"};
    for (const Case& c : cases) head.emplace_back(c.name);
    head.emplace_back("overshoot of the step, %");
    head.emplace_back("overshoot from the limits, %");
    // The row of the same name that was tuned for what the case says; none for the other variants.
    const auto as_in = [&](std::size_t row, std::size_t c) {
      std::size_t found = 0;
      while (found < rows.size() &&
             (rows[found].name != rows[row].name || rows[found].wrong != cases[c].wrong))
        ++found;
      return found;
    };
    for (std::size_t row = 0; row < right; ++row) {
      CsvRow line{
          rows[row].name,
          rows[row].numbers > 0 ? std::to_string(rows[row].numbers) : "-",
          number_text(rows[row].excess, 3),
          number_text(100.0 * rows[row].noise / (nominal.model.u_max - nominal.model.u_min), 3),
          number_text(rows[row].modulus, 2),
          rows[row].bridges == 0
              ? "-"
              : number_text(rows[row].bridges * nominal.model.sample_time / nominal.model.latency(),
                            2)};
      for (std::size_t c = 0; c < cases.size(); ++c) {
        const std::size_t own = as_in(row, c);
        if (own == rows.size()) {
          line.emplace_back("-");
          continue;
        }
        // What a wrong model costs: over the best PID that has the right one.
        const auto& whole = all[best][cases[c].wrong == Wrong::nothing ? c : load_step];
        std::vector<double> ratios;
        for (std::size_t i = 0; i < count; ++i)
          ratios.push_back(all[own][c][i].error / whole[i].error);
        const double ratio = median(ratios);
        line.push_back(std::isfinite(ratio) && ratio < 1e3 ? number_text(ratio, 3) : "lost");
      }
      for (const std::size_t c : {std::size_t{0}, std::size_t{4}}) {
        std::vector<double> over;
        for (const Outcome& one : all[row][c]) over.push_back(100.0 * one.overshoot);
        line.push_back(number_text(median(over), 2));
      }
      lines.push_back(line);
    }
    // ADRC beside the best variant of the best PID, case by case.
    const auto typical = [&](std::size_t row, std::size_t c) {
      std::vector<double> errors;
      for (const Outcome& one : all[row][c]) errors.push_back(one.error);
      return median(errors);
    };
    Column ratios, places;
    for (std::size_t c = 0; c < cases.size(); ++c) {
      std::size_t variant = as_in(best, c);
      for (std::size_t row = variant; row < rows.size(); ++row) {
        if (rows[row].wrong == cases[c].wrong && rows[row].name.starts_with("PID") &&
            typical(row, c) < 0.999 * typical(variant, c))
          variant = row;
      }
      // Which of two loops in a limit cycle has the larger one is no verdict.
      const double lost = cases[c].wrong == Wrong::nothing ? std::numeric_limits<double>::infinity()
                                                           : 10.0 * typical(best, load_step);
      for (std::size_t row = 0; row < 2; ++row) {
        const double error = typical(as_in(row, c), c);
        verdicts.push_back({rows[row].name + ": " + nominal.name + ", " + cases[c].name,
                            rows[variant].name, error / typical(variant, c), row == 0,
                            error > lost && typical(variant, c) > lost});
        if (row > 0 || verdicts.back().both_lost) continue;
        ratios.push_back(verdicts.back().ratio);
      }
      if (ratios.size() > places.size()) places.push_back(static_cast<double>(cases.size() - c));
    }
    panel.points(ratios, places,
                 {.name = nominal.name,
                  .marker = markers[drawn_machines++],
                  .size = 1.4,
                  .column = nominal.name});
    report.table(nominal.name,
                 nominal.name +
                     ": errors over those of the best PID (sqrt(Ti Td), holds y), "
                     "medians of " +
                     std::to_string(count) +
                     " random plants. A lag that is not known and a wrong order: over the load "
                     "step of the PID that has the right model",
                 head, lines);
    // In percent, of ADRC and of the PIDs with a filter of second order.
    double noise_apart = 0.0;
    for (const Row& row : rows) {
      if (row.wrong == Wrong::nothing && (row.numbers == 4 || row.numbers == 5 || row.bridges > 0))
        noise_apart = std::max(noise_apart, 100.0 * std::abs(row.noise / wish.control_noise - 1.0));
    }
    report.expect(nominal.name, "noise in u, away from the one asked for, %", noise_apart,
                  noise_apart < 2.0, "< 2");
    report.expect(nominal.name, "root of J / J* of the best PID", baselines.front().design.excess,
                  baselines.front().design.feasible && baselines.front().design.recovers,
                  "keeps the rules and recovers");
  }
  report.add(figure);
  std::stable_sort(verdicts.begin(), verdicts.end(),
                   [](const Verdict& a, const Verdict& b) { return a.ratio > b.ratio; });
  std::vector<CsvRow> lines;
  std::array<int, 2> won{}, tied{}, lost{};
  for (const Verdict& verdict : verdicts) {
    const bool tie = verdict.both_lost || std::abs(std::log(verdict.ratio)) < std::log(1.05);
    (tie ? tied : verdict.ratio > 1.0 ? lost : won)[verdict.recommended ? 0 : 1] += 1;
    lines.push_back({verdict.where, verdict.variant, number_text(verdict.ratio, 3),
                     verdict.both_lost     ? "both are lost"
                     : tie                 ? "tie"
                     : verdict.ratio > 1.0 ? "the PID wins"
                                           : "ADRC wins"});
  }
  report.table("verdicts",
               "Errors of ADRC over those of the best PID with the variant that is best in this "
               "case; within 5 % is a tie, and so is a wrong model with which both have ten times "
               "the error of the best PID that has the right one",
               {"where", "the PID", "ratio", "verdict"}, lines);
  std::vector<CsvRow> counted;
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
    counted.push_back({i == 0 ? "ADRC, recommended" : "ADRC, two bandwidths",
                       std::to_string(lost[i]), std::to_string(tied[i]), std::to_string(won[i])});
  }
  report.table("counted", "Of all cases and machines", {"", "the PID wins", "tie", "ADRC wins"},
               counted);
  return report.finish();
}
