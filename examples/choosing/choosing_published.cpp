// SIMC, AMIGO, the best PIDs and `tune` on plants that PID people know.
//
// Plants: families of the test batch of Astrom and Hagglund (Revisiting the Ziegler-Nichols step
// response method for PID control, J. Process Control 14 (2004) 635-650; Benchmark systems for PID
// control, IFAC PID 2000). Also the example with which Skogestad shows the half rule (Simple
// analytic rules for model reduction and PID controller tuning, J. Process Control 13 (2003)
// 291-309). Criterion: load IAE under a limit of the sensitivity and of the noise in u, with a
// filter of second order on y. It is that of Garpinger, Hagglund and Astrom, Performance and
// robustness trade-offs in PID control, J. Process Control 24 (2014) 568-577. Sweeps: G. Herbst, A
// simulative study on active disturbance rejection control (ADRC) as a control tool for
// practitioners, Electronics 2 (2013) 246-279.

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/library_systems.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/compiled/tune.hpp"
#include "common/figure.hpp"
#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr double largest_sensitivity = 1.6;
constexpr double sensor_noise = 1e-3;

/// gain exp(-dead_time s) prod (1 - zero s) / prod (1 + lag s), over s if it integrates.
struct Plant {
  std::string name;
  std::vector<double> lags, zeros = {};
  double dead_time = 0.0;
  bool integrates = false;
  double least = 0.0;  ///< load IAE of the best PID, found by scipy with a simulation of its own
  double gain = 1.0;
};

/// The plant with the load at its input. Each zero goes with a lag.
detail::DensePlant dense(const Plant& plant) {
  const auto lags = static_cast<int>(plant.lags.size());
  const int n = lags + (plant.integrates ? 1 : 0);
  detail::DensePlant made{DynamicMatrix<double>(n, n),
                          DynamicMatrix<double>(n, 1),
                          DynamicMatrix<double>(1, n),
                          DynamicMatrix<double>(n, 1),
                          {plant.dead_time}};
  // What goes into the next part: of the states, and of u.
  std::vector<double> signal(static_cast<std::size_t>(n));
  double direct = plant.gain;
  for (int i = 0; i < n; ++i) {
    const bool integrator = i >= lags;
    const auto at = static_cast<std::size_t>(i);
    const double rate = integrator ? 1.0 : 1.0 / plant.lags[at];
    for (int j = 0; j < i; ++j) made.a(i, j) = rate * signal[static_cast<std::size_t>(j)];
    made.b(i, 0) = made.e(i, 0) = rate * direct;
    if (!integrator) made.a(i, i) = -rate;
    const double through = !integrator && at < plant.zeros.size() ? -plant.zeros[at] * rate : 0.0;
    for (double& part : signal) part *= through;
    direct *= through;
    signal[at] = 1.0 - through;
  }
  for (int j = 0; j < n; ++j) made.c(0, j) = signal[static_cast<std::size_t>(j)];
  return made;
}

/// k exp(-dead_time s) / ((1 + first s) (1 + second s)); first infinite: 1 / s in place of its lag.
struct Reduced {
  double first = 0.0, second = 0.0, dead_time = 0.0;
};

/// Skogestad's half rule, after a zero in the left half plane has shortened the next larger lag.
/// @param order 1 or 2
Reduced half_rule(const Plant& plant, int order) {
  std::vector<double> lags = plant.lags;
  Reduced found;
  found.dead_time = plant.dead_time;
  for (const double zero : plant.zeros) {
    if (zero > 0.0) {
      found.dead_time += zero;
      continue;
    }
    double* nearest = nullptr;
    for (double& lag : lags)
      if (lag >= -zero && (nearest == nullptr || lag < *nearest)) nearest = &lag;
    if (nearest != nullptr) *nearest += zero;
  }
  if (plant.integrates) lags.push_back(std::numeric_limits<double>::infinity());
  std::sort(lags.begin(), lags.end(), std::greater<>());
  const auto kept = static_cast<std::size_t>(order);
  lags.resize(std::max(lags.size(), kept + 1));
  for (std::size_t i = kept; i < lags.size(); ++i)
    found.dead_time += (i == kept ? 0.5 : 1.0) * lags[i];
  found.first = lags[0];
  (order == 2 ? found.second : found.first) = lags[kept - 1];
  (order == 2 ? found.second : found.first) += 0.5 * lags[kept];
  if (found.second > found.first) std::swap(found.first, found.second);
  return found;
}

/// What AMIGO takes from a step response: where its steepest tangent begins, and the time from
/// there to 63 %. Of an integrating plant the tangent is that of the end, and there is no time.
struct StepModel {
  double dead_time = 0.0, time = 0.0;
};
StepModel step_model(const Plant& plant) {
  double sum = 0.0;
  for (const double lag : plant.lags) sum += lag;
  const auto made = dense(plant);
  const double h = sum / 4000.0;
  const auto held = detail::held_for(made.a, made.b, h);
  const int n = made.a.rows();
  std::vector<double> x(static_cast<std::size_t>(n)), next = x;
  double y = 0.0, steepest = 0.0, reached = 0.0;
  StepModel found;
  for (int k = 0; k < 60000; ++k) {
    for (int i = 0; i < n; ++i) {
      double rate = held.input(i, 0);
      for (int j = 0; j < n; ++j) rate += held.increment(i, j) * x[static_cast<std::size_t>(j)];
      next[static_cast<std::size_t>(i)] = x[static_cast<std::size_t>(i)] + rate;
    }
    x = next;
    double now = 0.0;
    for (int j = 0; j < n; ++j) now += made.c(0, j) * x[static_cast<std::size_t>(j)];
    const double slope = (now - y) / h, t = h * (k + 1);
    if (slope > steepest) {
      steepest = slope;
      found.dead_time = t - 0.5 * h - 0.5 * (now + y) / slope;
    }
    if (now < 1.0 - std::exp(-1.0)) reached = t;
    y = now;
  }
  found.time = plant.integrates ? 0.0 : reached - found.dead_time;
  found.dead_time += plant.dead_time;
  return found;
}

PlainPidConfig pid_of(double gain, double ti, double td, double T) {
  return {.proportional = gain,
          .integral = gain / ti,
          .derivative = gain * td,
          .derivative_filter = 0.1 * td,
          .lower = -1.0,
          .upper = 1.0,
          .sample_time = T};
}

/// By SIMC with tau_c = theta: a PID in series.
PlainPidConfig simc(const Reduced& of, double T) {
  const double theta = of.dead_time + 0.5 * T;
  // k / first of a plant whose gain is 1, or 1 / s.
  const double slope = std::isfinite(of.first) ? 1.0 / of.first : 1.0;
  const double gain = 1.0 / (slope * 2.0 * theta);
  const double ti = std::min(of.first, 8.0 * theta), td = of.second;
  return pid_of(gain * (1.0 + td / ti), ti + td, ti * td / (ti + td), T);
}

/// By AMIGO.
PlainPidConfig amigo(const StepModel& of, double T) {
  const double l = of.dead_time + 0.5 * T, t = of.time;
  if (!(t > 0.0)) return pid_of(0.45 / l, 8.0 * l, 0.5 * l, T);
  return pid_of(0.2 + 0.45 * t / l, (0.4 * l + 0.8 * t) / (l + 0.1 * t) * l,
                0.5 * l * t / (0.3 * l + t), T);
}

/// What a controller does on a plant.
struct Judged {
  double iae = 0.0;          ///< after a step of the load of 1
  double ise = 0.0;          ///< the same with squares
  double sensitivity = 0.0;  ///< Ms
  double noise = 0.0;        ///< standard deviation of u over that of y
};

/// The plant as it is sampled, for many controllers.
class Judge {
 public:
  Judge(const Plant& plant, double T) : T_(T), plant_(detail::sampled_plant(dense(plant), T)) {
    whole_ = static_cast<std::size_t>(plant_.whole[0]);
    constexpr int points = 480;
    for (int i = 0; i <= points; ++i) {
      const double w = std::numbers::pi / T * std::pow(10.0, -4.0 + 4.0 * i / points);
      const std::complex<double> value = std::polar(1.0, w * T) - 1.0;
      values_.push_back(value);
      responses_.push_back(detail::response(plant_, value)(0, 0));
    }
  }

  /// @return infinite numbers for a loop that does not settle
  [[nodiscard]] Judged operator()(const LinearController& controller) const {
    constexpr double never = std::numeric_limits<double>::infinity();
    const LinearController c = detail::closed_upon_itself(controller);
    detail::FastResponse response(c);
    Judged found;
    double least = never;
    for (std::size_t i = 0; i < values_.size(); ++i) {
      const double distance = std::abs(1.0 - responses_[i] * response.at(values_[i]).gain);
      least = std::min(least, distance);
    }
    found.sensitivity = 1.0 / least;
    const auto [sum, squares] = run(c, false);
    found.iae = T_ * sum;
    found.ise = T_ * squares;
    found.noise = std::sqrt(run(c, true).second);
    if (!std::isfinite(found.ise) || !std::isfinite(found.noise))
      return {never, never, never, never};
    return found;
  }

 private:
  /// The sums of abs(y) and y^2 after a step of the load, or of u after an impulse in y.
  [[nodiscard]] std::pair<double, double> run(const LinearController& c, bool impulse) const {
    const int n = plant_.a.rows(), m = c.states();
    std::array<double, 16> x{}, dx{}, z{}, dz{};
    std::vector<double> line(whole_ + 2);
    double sum = 0.0, squares = 0.0, quiet = 0.0;
    for (std::size_t k = 0; k < 60000; ++k) {
      double y = 0.0;
      for (int i = 0; i < n; ++i) y += plant_.c(0, i) * x[static_cast<std::size_t>(i)];
      const double seen = y + (impulse && k == 0 ? 1.0 : 0.0);
      double u = c.y_to_u(0, 0) * seen;
      for (int i = 0; i < m; ++i) u += c.to_u(0, i) * z[static_cast<std::size_t>(i)];
      line[k % line.size()] = u;
      const double added = std::abs(impulse ? u : y);
      sum += added;
      squares += added * added;
      if (!(sum < 1e9)) return {sum, std::numeric_limits<double>::infinity()};
      quiet = added < 1e-7 * sum ? quiet + 1.0 : 0.0;
      if (quiet > static_cast<double>(whole_) + 200.0) return {sum, squares};
      const double load = impulse ? 0.0 : 1.0;
      const double now = k >= whole_ ? line[(k - whole_) % line.size()] : 0.0;
      const double before = k > whole_ ? line[(k - whole_ - 1) % line.size()] : 0.0;
      for (int i = 0; i < n; ++i) {
        double rate = plant_.now(i, 0) * now + plant_.before(i, 0) * before + plant_.e(i, 0) * load;
        for (int j = 0; j < n; ++j) rate += plant_.a(i, j) * x[static_cast<std::size_t>(j)];
        dx[static_cast<std::size_t>(i)] = rate;
      }
      for (int i = 0; i < m; ++i) {
        double rate = c.from_y(i, 0) * seen;
        for (int j = 0; j < m; ++j) rate += c.a(i, j) * z[static_cast<std::size_t>(j)];
        dz[static_cast<std::size_t>(i)] = rate;
      }
      for (std::size_t i = 0; i < x.size(); ++i) {
        x[i] += dx[i];
        z[i] += dz[i];
      }
    }
    return {sum, squares};
  }

  double T_;
  detail::SampledPlant plant_;
  std::size_t whole_ = 0;
  std::vector<std::complex<double>> values_, responses_;
};

/// The PID with a filter of second order on y that has the least IAE on this plant, with no more
/// than this noise and the largest sensitivity.
PlainPidConfig best_pid(const Judge& judge, const std::vector<PlainPidConfig>& starts,
                        double noise) {
  const PlainPidConfig& like = starts.front();
  const auto made = [&](const std::vector<double>& x) {
    PlainPidConfig pid = like;
    pid.proportional = std::exp(x[0]);
    pid.integral = pid.proportional * std::exp(-x[1]);
    pid.derivative = pid.proportional * std::exp(x[2]);
    pid.derivative_filter = 0.0;
    pid.filter_frequency = std::exp(x[3]);
    return pid;
  };
  double price = 5.0;
  const auto value = [&](const std::vector<double>& x) {
    if (x[3] > std::log(3.0 / like.sample_time)) return 1e4 + x[3];
    const Judged found = judge(detail::pid_form(made(x)));
    if (!std::isfinite(found.iae)) return 1e3;
    return std::log(found.iae) +
           price * (std::max(std::log(found.sensitivity / largest_sensitivity), 0.0) +
                    std::max(std::log(found.noise / noise), 0.0));
  };
  detail::SearchPoint best{std::numeric_limits<double>::infinity(), {}};
  for (const PlainPidConfig& start : starts) {
    const double td = std::max(start.derivative_time(), 4.0 * like.sample_time);
    const std::vector<double> x{
        std::log(start.proportional), std::log(start.integral_time()), std::log(td),
        std::log(start.filter_frequency > 0.0 ? start.filter_frequency : 6.0 / td)};
    auto found = detail::simplex_search(value, x, std::vector<double>(4, 0.2), 300);
    if (found.value < best.value) best = std::move(found);
  }
  for (int again = 0; again < 6; ++again) {
    price *= 3.0;
    best = detail::simplex_search(value, best.at,
                                  std::vector<double>(4, again % 2 == 0 ? 0.1 : -0.05), 200);
  }
  return made(best.at);
}

/// The printed model of Skogestad's example (half rule), beside ours.
void half_rules(Report& report, const std::vector<Plant>& plants) {
  const Reduced one = half_rule(plants.back(), 1), two = half_rule(plants.back(), 2);
  const auto check = [&](const char* what, double printed, double ours) {
    report.check("half rule", what, printed, ours, Tolerance(1e-9));
  };
  check("tau_1 of one lag", 2.5, one.first);
  check("theta of one lag", 1.47, one.dead_time);
  check("tau_1 of two", 2.0, two.first);
  check("tau_2 of two", 1.2, two.second);
  check("theta of two", 0.77, two.dead_time);
  // Where the second derivative of the step response of 1 / (s + 1)^4 is zero, t = 3.
  const StepModel four = step_model(plants[2]);
  const double e3 = std::exp(3.0);
  report.check_reference("1 / (s + 1)^4", "L of AMIGO", 3.0 - (e3 - 13.0) / 4.5, four.dead_time,
                         1e-3, "closed form");
}

/// Herbst's process of order 1, K / (T s + 1) with K = T = 1, b_0 = K / T, settling time 1 s, while
/// K or T differs. The observer is ten times as fast as the law.
void sweep(Report& report) {
  constexpr double wc = 4.0, wo = 40.0, T = 0.0025;
  const auto adrc = Adrc<LinearEso<1>>::make(
      {.observer = {.observer_bandwidth = wo, .input_gain = 1.0, .sample_time = T},
       .controller_bandwidth = wc});
  // With the same response to the reference, which it gets by cancelling the pole.
  const PlainPidConfig cancelling{
      .proportional = wc, .integral = wc, .lower = -1.0, .upper = 1.0, .sample_time = T};
  // With the gains of this ADRC.
  const double sum = 2.0 * wo + wc, kp = (2.0 * wo * wc + wo * wo) / sum;
  PlainPidConfig equal = cancelling;
  equal.proportional = kp;
  equal.integral = wo * wo * wc / sum;
  equal.filter_frequency = 2.0 * sum;
  equal.filter_damping = 1.0;
  equal.reference_weight = wc / kp;
  const std::array<LinearController, 3> all{linear_controller(*adrc).value(),
                                            detail::pid_form(cancelling), detail::pid_form(equal)};
  std::vector<CsvRow> rows;
  double apart = 0.0;
  for (const bool gain : {true, false}) {
    for (const double factor : {0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0}) {
      const Plant plant{.name = "", .lags = {gain ? 1.0 : factor}, .gain = gain ? factor : 1.0};
      CsvRow row{std::string(gain ? "K = " : "T = ") + number_text(factor)};
      CsvRow loads;
      std::vector<double> times;
      for (const LinearController& controller : all) {
        const auto loop = Loop::make(dense(plant), controller).value();
        times.push_back(detail::step_answer(loop.system(), 0, 1.0, 1.0, 40000).settling);
        row.push_back(number_text(times.back(), 3));
        loads.push_back(number_text(Judge(plant, T)(controller).iae, 3));
      }
      apart = std::max(apart, std::abs(times[2] / times[0] - 1.0));
      row.insert(row.end(), loads.begin(), loads.end());
      rows.push_back(row);
    }
  }
  report.expect("sweep", "settling times of the PI with the gains of the ADRC, apart (share)",
                apart, apart < 0.02, "within 2 %");
  report.table("sweep",
               "Herbst's process K / (T s + 1), designed for K = T = 1: settling time (2 %) of a "
               "step of the reference, s, and load IAE",
               {"plant", "settling: ADRC", "settling: PI with the same step",
                "settling: PI with the gains of the ADRC", "IAE: ADRC",
                "IAE: PI with the same step", "IAE: PI with the gains of the ADRC"},
               rows);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "choosing", "published",
      {.title = "Plants that are published",
       .description = "SIMC, AMIGO, the best PIDs and ADRC on plants of the test batch of Astrom "
                      "and Hagglund: load IAE, sensitivity and noise, all judged on the plant "
                      "itself."});
  const std::vector<Plant> plants{
      {.name = "P1, T = 1: e^-s / (1 + s)", .lags = {1.0}, .dead_time = 1.0, .least = 1.50503},
      {.name = "P2, T = 0.2: e^-s / (1 + 0.2 s)^2",
       .lags = {0.2, 0.2},
       .dead_time = 1.0,
       .least = 1.63257},
      {.name = "P4, n = 4: 1 / (s + 1)^4", .lags = {1.0, 1.0, 1.0, 1.0}, .least = 1.93689},
      {.name = "P5, a = 0.1: 1 / ((1 + s) (1 + a s) (1 + a^2 s) (1 + a^3 s))",
       .lags = {1.0, 0.1, 0.01, 0.001},
       .least = 0.0047480},
      {.name = "P5, a = 0.5", .lags = {1.0, 0.5, 0.25, 0.125}, .least = 0.496679},
      {.name = "P6, T = L = 0.5: e^-0.5 s / (s (1 + 0.5 s))",
       .lags = {0.5},
       .dead_time = 0.5,
       .integrates = true,
       .least = 4.20641},
      {.name = "P8, a = 1: (1 - s) / (s + 1)^3",
       .lags = {1.0, 1.0, 1.0},
       .zeros = {1.0},
       .least = 3.57204},
      {.name = "Skogestad: (1 - 0.3 s) (1 + 0.08 s) / ((1 + 2 s) (1 + s) (1 + 0.4 s) (1 + 0.2 s) "
               "(1 + 0.05 s)^3)",
       .lags = {2.0, 1.0, 0.4, 0.2, 0.05, 0.05, 0.05},
       .zeros = {0.3, -0.08},
       .least = 1.72052}};
  half_rules(report, plants);
  Figure figure("iae", {.rows = 1, .columns = 1, .panel_height = 330});
  figure.caption(
      "Load IAE over that of the best PID for the plant itself, all with the sampling and the "
      "noise "
      "of AMIGO as limit (SIMC and AMIGO as their rules say).");
  Panel& panel = figure.panel(0, 0)
                     .log_x()
                     .x_range(0.05, 20.0)
                     .y_range(0.2, static_cast<double>(plants.size()) + 1.0)
                     .y_tick(100.0)
                     .x_label("load IAE / load IAE of the best PID on the plant")
                     .legend(Legend::above)
                     .name("iae")
                     .vertical_line(1.0);
  const std::array<const char*, 5> names{"SIMC", "AMIGO", "PID on the model", "ADRC",
                                         "ADRC, two bandwidths"};
  std::array<Column, 5> over;
  Column places;
  std::vector<CsvRow> lines, ratios, verdicts;
  int won = 0, tied = 0, lost = 0;
  for (const Plant& plant : plants) {
    const StepModel step = step_model(plant);
    const Reduced two = half_rule(plant, 2);
    const double T = std::min(step.dead_time, 4.0 * two.dead_time) / 20.0;
    const Judge judge(plant, T);
    const PlainPidConfig by_simc = simc(two, T), by_amigo = amigo(step, T);
    const Judged of_amigo = judge(detail::pid_form(by_amigo));
    const auto tuned = [&](TuneModel model) {
      model.dead_time = two.dead_time;
      model.noise = sensor_noise;
      model.sample_time = T;
      model.u_min = -1.0;
      model.u_max = 1.0;
      TuneRules rules;
      rules.modulus_margin = 1.0 / largest_sensitivity;
      rules.simulate = TuneSimulation::none;
      // So large that J is nearly the ISE of a load step, as far as the noise allows.
      double fast = 16.0;
      for (;; fast *= 0.5) {
        model.disturbance = model.disturbance_of(fast / model.latency());
        auto tuning =
            compiled::tune(model, {.control_noise = of_amigo.noise * sensor_noise}, rules);
        if (tuning || fast < 1.0) return tuning;
      }
    };
    const double slope = std::isfinite(two.first) ? 1.0 / two.first : 1.0;
    const auto tuning =
        tuned({.order = 1, .input_gain = {slope, 0.0}, .pole = 1.0 / two.first, .lag = two.second});
    if (!tuning || tuning->chosen() == nullptr) {
      report.expect(plant.name, "designs", 0.0, false, "there is one");
      continue;
    }
    const auto baselines = compiled::tune_pids(*tuning);
    const auto baseline = std::find_if(baselines.begin(), baselines.end(), [](const TunedPid& of) {
      return of.kind == PidKind::filtered;
    });
    const PlainPidConfig best = best_pid(judge, {by_simc, by_amigo, baseline->pid}, of_amigo.noise);
    const Judged least = judge(detail::pid_form(best));
    report.check_reference(plant.name, "load IAE of the best PID", plant.least, least.iae, 0.003,
                           "scipy");
    report.expect(
        plant.name, "Ms of the best PID", least.sensitivity,
        least.sensitivity < 1.001 * largest_sensitivity && least.noise < 1.001 * of_amigo.noise,
        "within the limits, also of noise");
    std::array<Judged, 5> all{judge(detail::pid_form(by_simc)),
                              of_amigo,
                              judge(detail::pid_form(baseline->pid)),
                              judge(tuning->chosen()->controller),
                              {}};
    const auto two_numbers =
        std::find_if(tuning->designs.begin(), tuning->designs.end(),
                     [](const TunedDesign& d) { return d.numbers == 2 && d.feasible; });
    if (two_numbers != tuning->designs.end()) all[4] = judge(two_numbers->controller);
    const auto add = [&](const std::string& name, const Judged& found) {
      lines.push_back({plant.name + ": " + name, number_text(found.iae, 3),
                       number_text(found.iae / least.iae, 3),
                       number_text(std::sqrt(found.ise / least.ise), 3),
                       number_text(found.sensitivity, 3), number_text(found.noise, 3)});
    };
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!(all[i].iae > 0.0)) continue;
      add(i == 3   ? "ADRC, recommended (" + tuning->chosen()->name + ")"
          : i == 4 ? "ADRC, two bandwidths (" + two_numbers->name + ")"
                   : names[i],
          all[i]);
      over[i].push_back(all[i].iae / least.iae);
    }
    add("PID, best on the plant", least);
    const double place = static_cast<double>(plants.size() - places.size());
    panel.note(0.052, place, plant.name.substr(0, plant.name.find(':')));
    places.push_back(place);
    const double against = all[3].iae / all[2].iae;
    const bool tie = std::abs(std::log(against)) < std::log(1.05);
    (tie ? tied : against > 1.0 ? lost : won) += 1;
    verdicts.push_back(
        {plant.name, number_text(against, 3), number_text(all[4].iae / all[2].iae, 3),
         number_text(all[3].iae / all[0].iae, 3), number_text(all[3].iae / all[1].iae, 3),
         tie             ? "tie"
         : against > 1.0 ? "the PID wins"
                         : "ADRC wins"});
  }
  const std::array<Marker, 5> markers{Marker::triangle, Marker::cross, Marker::open_circle,
                                      Marker::circle, Marker::square};
  for (std::size_t i = 0; i < names.size(); ++i)
    panel.points(over[i], places,
                 {.name = names[i], .marker = markers[i], .size = 1.4, .column = names[i]});
  report.add(figure);
  report.table("verdicts",
               "Load IAE of ADRC over that of others: of the best PID for the same model, margins "
               "and noise (within 5 % is a tie), and of the rules, which have other margins and "
               "noise (below)",
               {"plant", "recommended, over the PID", "two bandwidths, over the PID",
                "recommended, over SIMC", "recommended, over AMIGO", "verdict"},
               verdicts);
  report.table(
      "counted", "ADRC and the best PID for the same model",
      {"", "the PID wins", "tie", "ADRC wins"},
      {{"ADRC, recommended", std::to_string(lost), std::to_string(tied), std::to_string(won)}});
  report.table(
      "loops",
      "All loops, on the plants themselves: load IAE, over that of the best PID, the same "
      "for the root of the ISE, largest sensitivity, standard deviation of u over that of "
      "a white noise of y",
      {"plant and controller", "load IAE", "over the best", "root of ISE", "Ms", "noise gain"},
      lines);
  sweep(report);
  report.remark(
      "All models come from the half rule: a lag of the plant and one of the actuator. "
      "AMIGO gets what it is made for, the tangent and the 63 % of the step response. "
      "SIMC has tau_c = theta; it and AMIGO filter the derivative with a tenth of T_d. The best "
      "PIDs have a filter of second order on y, damping 0.707, Ms <= 1.6 and at most the noise of "
      "AMIGO; so has tune, whose disturbance is so large that J is nearly the ISE of a load "
      "step.");
  return report.finish();
}
