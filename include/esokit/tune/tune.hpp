/// @file
/// From a model and a requirement to a ranked list of designs: which observer, which bandwidths.
///
/// ```cpp
/// auto tuning = tune(tune_model(*identified, -12.0, 12.0));
/// std::puts(tuning->designs.front().code.c_str());
/// ```
///
/// 1. J = var(y) + rho var(b0 u~), u~ = u + d / b0, at the samples: the effect of measurement noise
///    and of a random-walk disturbance on the loop (tune/loop_cost.hpp).
/// 2. The requirement sets rho: there is one LQG controller for each rho, and one of them just
/// meets it.
/// 3. J of that controller is J*, the smallest J of all linear controllers (tune/lqg.hpp).
/// 4. For each family J is minimised at this rho under the margins; if it cannot keep them, the
/// design says which one.
/// 5. Designs are ranked by J; those within 1 % by the cost of an update, then by the
///    modulus margin.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <esokit/core/expected.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/problem.hpp>
#include <esokit/tune/search.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace esokit {

/// The best design of a family, or the one closest to the margins if it cannot keep them.
struct TunedDesign {
  std::string name;         ///< description in words
  TuneFamily family{};      ///< how its gains are chosen
  int extension = 1;        ///< m
  int levels = 1;           ///< p
  TuneKnowledge knows{};    ///< what its observer knows
  TuneSettings settings{};  ///< the chosen parameters
  bool feasible = false;    ///< keeps all margins
  std::string constraint;   ///< the margin that limits it, or that it cannot keep; or "none"
  double cost = 0.0;        ///< J
  double excess = 0.0;      ///< sqrt(J / J*)
  double free_excess =
      0.0;  ///< the same without margins; excess / free_excess is the price of the margins
  double output_deviation = 0.0;   ///< standard deviation of y
  double control_deviation = 0.0;  ///< standard deviation of u + d / b0
  double control_noise = 0.0;      ///< standard deviation of u from measurement noise only
  double load_peak = 0.0;          ///< largest abs(y) after a load step that one unit of u balances
  double settling_time = 0.0;      ///< s, to within 2 % after a step of the reference
  double modulus_margin = 0.0;     ///< smallest over the intervals
  double gain_tolerance = 0.0;     ///< factor by which b0 may be wrong in either direction
  double delay_margin = 0.0;       ///< smallest over the intervals, s
  int instructions = 0;            ///< per update of the observer, see update_instructions
  std::string code;                ///< C++ source of the controller, type and config, to paste
  LinearController controller{};   ///< for the analysis, see closed_loop(model, controller)
};

/// The result of `tune`.
struct Tuning {
  TuneModel model{};           ///< as given
  TuneRules rules{};           ///< as given
  double rho = 0.0;            ///< weight of var(b0 u~) in J
  double control_noise = 0.0;  ///< the required value, unit of u; 0 if something else was required
  double optimum = 0.0;        ///< J*
  LoopNumbers lqg{};           ///< of the controller with J*
  std::vector<TunedDesign> designs{};  ///< the best one first, infeasible ones last

  /// The first design, or null if it does not keep the margins.
  [[nodiscard]] const TunedDesign* chosen() const noexcept {
    return !designs.empty() && designs.front().feasible ? &designs.front() : nullptr;
  }
};

/// Instructions of an update of the observer on a Cortex-M4F in float, counted in the disassembly
/// on the path without faults (GCC 12, -O2). The emulator of examples/embedded counts the same
/// within two; its table gives the frozen filter nine more.
inline int update_instructions(int order, TuneFamily family, int extension, int levels,
                               const TuneKnowledge& knows) {
  const auto n = static_cast<std::size_t>(order - 1);
  constexpr int chain[3][2] = {{27, 39}, {39, 50}, {50, 63}};
  constexpr int cascade[3][2] = {{43, 57}, {58, 83}, {76, 115}};
  constexpr int lag[3] = {45, 61, 80}, sensor[3] = {41, 56, 75}, swing[3] = {57, 74, 92};
  constexpr int lag_sensor[3] = {63, 82, 102}, lag_swing[3] = {80, 103, 124};
  if (knows.lag && knows.sensor) return lag_sensor[n];
  if (knows.lag && knows.swing) return lag_swing[n];
  if (knows.lag) return lag[n];
  if (knows.sensor) return sensor[n];
  if (knows.swing) return swing[n];
  if (levels > 1) return cascade[n][static_cast<std::size_t>(levels - 2)];
  return chain[n][static_cast<std::size_t>(extension - 1)] + (family == TuneFamily::filter ? 9 : 0);
}

namespace detail {

/// A number as C++ source.
inline std::string source(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  std::string number = text;
  if (number.find_first_of(".en") == std::string::npos) number += ".0";
  return number;
}

/// A family for a model, and how it is searched.
struct Contender {
  TunedDesign design{};
  ObserverKind kind{};
  int observer_numbers = 1;  ///< number of free parameters of the observer
  int law_numbers = 1;
};

/// The data of the problem that a search needs.
struct TuneSearch {
  TuneModel model;
  TuneRules rules;
  double rho;
  double fixed_bandwidth;      ///< omega_c if it is given, else 0
  double reference_bandwidth;  ///< of the law of the LQG controller
  double filter_bandwidth;     ///< of the filter of the LQG controller
  double possible_bandwidth;   ///< largest one that lag and dead time allow
  const LoopCost* cost;

  [[nodiscard]] double slowest() const {
    return 0.05 * std::min({reference_bandwidth, filter_bandwidth, 0.3 * possible_bandwidth});
  }
  [[nodiscard]] double fastest() const {
    return std::min(8.0 * std::max(reference_bandwidth, filter_bandwidth), 3.0 / model.sample_time);
  }

  /// Settings from the logarithms over which the search runs.
  [[nodiscard]] TuneSettings settings(const Contender& c, const std::vector<double>& x) const {
    TuneSettings s;
    const int n = c.kind.order;
    const double T = model.sample_time;
    const auto at = [&](int i) { return std::exp(x[static_cast<std::size_t>(i)]); };
    // If their number is odd, the first is real; the others are pairs.
    const auto poles = [&](int first, int count) {
      std::vector<std::complex<double>> list;
      int i = first;
      if (count % 2 != 0) list.push_back(-at(i++));
      for (; i < first + count; i += 2) {
        const auto pair = pole_pair(at(i), at(i + 1));
        list.insert(list.end(), pair.begin(), pair.end());
      }
      return list;
    };
    const bool free = c.design.family == TuneFamily::free_poles;
    if (free) {
      s.observer_poles = poles(0, c.kind.placed);
    } else if (c.design.family == TuneFamily::filter) {
      // Intensity R T w^(2 (n + 1)) over a sample.
      s.disturbance_bound = model.noise * T * std::pow(at(0), c.kind.size);
    } else {
      s.observer_bandwidth = at(0);
    }
    if (c.design.family == TuneFamily::cascade) s.bandwidth_factor = 1.0 + at(1);
    if (c.design.knows.swing) {
      const double given = model.swings.front().capture_bandwidth;
      s.capture_bandwidth = given > 0.0 ? given : at(1);
    }
    const int law = c.observer_numbers;
    if (c.law_numbers > 0 && free) {
      s.gains = polynomial(poles(law, n));
    } else if (c.law_numbers > 0 && c.design.family == TuneFamily::filter) {
      s.gains = lqr(n, std::pow(at(law), -2 * n));
    } else {
      s.controller_bandwidth = c.law_numbers > 0 ? at(law) : fixed_bandwidth;
      s.gains = polynomial(
          std::vector<std::complex<double>>(static_cast<std::size_t>(n), -s.controller_bandwidth));
    }
    return s;
  }

  /// LQR gains of a chain of n integrators for var(y) + rho var(v).
  [[nodiscard]] std::vector<double> lqr(int n, double weight) const {
    TuneModel chain = model;
    chain.order = n;
    const auto kind = chain_kind(chain, TuneFamily::linear, 1, 1);
    DynamicMatrix<double> a(n, n), b(n, 1), q(n, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) a(i, j) = kind.step(i, j) + (i == j ? 1.0 : 0.0);
      b(i, 0) = kind.step(i, n);
    }
    q(0, 0) = 1.0;
    const auto x = solve_riccati(a, b, weight, q);
    const auto bx = product(transposed(b), x);
    const auto k = product(bx, a);
    const double size = weight + product(bx, b)(0, 0);
    std::vector<double> gains;
    for (int j = 0; j < n; ++j) gains.push_back(k(0, j) / size);
    return gains;
  }

  /// How much of the margins is missing: shares, 0 if none.
  struct Lack {
    double modulus, delay, gain;
    [[nodiscard]] double sum() const { return modulus + delay + gain; }
  };
  [[nodiscard]] Lack lack(const LoopNumbers& numbers, double more = 1.0) const {
    const double modulus = more * rules.modulus_margin;
    const double delay = more * rules.delay_samples * model.sample_time;
    return {modulus > 0.0 ? std::max(1.0 - numbers.modulus / modulus, 0.0) : 0.0,
            delay > 0.0 ? std::max(1.0 - numbers.delay / delay, 0.0) : 0.0,
            numbers.tolerant ? 0.0 : std::max(1.0 - numbers.tolerance / rules.gain_factor, 0.02)};
  }

  /// log J plus a penalty on missing margins.
  [[nodiscard]] double value(const Contender& c, const std::vector<double>& x, double price) const {
    double outside = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      outside += std::max(low(c, i) - x[i], 0.0) + std::max(x[i] - high(c, i), 0.0);
    }
    if (outside > 0.0) return 1e4 * (1.0 + outside);
    const auto controller = tuned_controller(c.kind, model.sample_time, settings(c, x));
    if (!controller) return 1e5;
    const LoopNumbers numbers = (*cost)(*controller);
    if (!numbers.stable) return 1e4;
    const double j = numbers.cost(rho, model.input_gain.value);
    if (!(j > 0.0) || !is_finite(j)) return 1e4;
    return std::log(j) + price * lack(numbers, 1.004).sum();
  }

  /// Whether variable `index` of the search is a damping; the others are factors or bandwidths.
  [[nodiscard]] bool damping(const Contender& c, std::size_t index) const {
    if (c.design.family != TuneFamily::free_poles) return false;
    const int i = static_cast<int>(index);
    const int count = i < c.observer_numbers ? c.kind.placed : c.kind.order;
    const int place = i < c.observer_numbers ? i : i - c.observer_numbers;
    return (place - count % 2) % 2 != 0 && place >= count % 2;
  }
  [[nodiscard]] bool factor(const Contender& c, std::size_t i) const {
    return c.design.family == TuneFamily::cascade && i == 1;
  }
  [[nodiscard]] bool capture(const Contender& c, std::size_t i) const {
    return c.design.knows.swing && c.observer_numbers == 2 && i == 1;
  }
  [[nodiscard]] double low(const Contender& c, std::size_t i) const {
    return std::log(damping(c, i)   ? 0.2
                    : factor(c, i)  ? 0.1
                    : capture(c, i) ? 0.003 * model.swings.front().frequency
                                    : slowest());
  }
  [[nodiscard]] double high(const Contender& c, std::size_t i) const {
    return std::log(damping(c, i)   ? 4.0
                    : factor(c, i)  ? 8.0
                    : capture(c, i) ? 3.0 * model.swings.front().frequency
                                    : fastest());
  }

  /// A start for the search for free poles: bandwidths `o` of the observer and `l` of the law, with
  /// the poles of half gains or all in one place.
  [[nodiscard]] std::vector<double> start(const Contender& c, double o, double l, bool half) const {
    std::vector<double> x;
    for (std::size_t i = 0; i < static_cast<std::size_t>(c.observer_numbers + c.law_numbers); ++i) {
      const bool of_observer = static_cast<int>(i) < c.observer_numbers;
      double value = damping(c, i) ? std::log(half ? 0.6 : 0.95) : std::log(of_observer ? o : l);
      // With a lag the law has one more pole, that of the lag.
      if (!of_observer && half && c.design.knows.lag && static_cast<int>(i) == c.observer_numbers &&
          c.kind.order % 2 != 0) {
        value = std::max(value, -std::log(model.lag));
      }
      x.push_back(std::clamp(value, low(c, i), high(c, i)));
    }
    return x;
  }

  /// The minimum of a family. @param starts start points in place of a scan
  [[nodiscard]] SearchPoint least(const Contender& c, bool margins,
                                  const std::vector<std::vector<double>>& starts) const {
    // With many variables the penalty begins low and rises: it leads along the edge of a margin, on
    // which a simplex would collapse with a high penalty. After a scan this is not needed.
    const bool rising = margins && !starts.empty();
    double price = rising ? 5.0 : margins ? 40.0 : 0.0;
    const auto f = [&](const std::vector<double>& x) { return value(c, x, price); };
    const auto numbers = static_cast<std::size_t>(c.observer_numbers + c.law_numbers);
    SearchPoint best;
    best.value = std::numeric_limits<double>::infinity();
    std::vector<double> step(numbers, 0.25);
    const auto from_here = [&](const std::vector<double>& start, int evaluations) {
      auto found = simplex_search(f, start, step, evaluations * static_cast<int>(numbers));
      if (found.value < best.value) best = std::move(found);
    };
    if (starts.empty()) {
      std::vector<double> from, to;
      std::vector<int> points;
      for (std::size_t i = 0; i < numbers; ++i) {
        from.push_back(low(c, i));
        to.push_back(high(c, i));
        points.push_back(factor(c, i) ? 4 : numbers > 2 ? 9 : 12);
        step[i] = 0.5 * (to[i] - from[i]) / (points[i] - 1);
      }
      for (const SearchPoint& start : grid_search(f, from, to, points, 3)) {
        from_here(start.at, 40);
      }
    }
    for (const auto& start : starts) from_here(start, 60);
    for (const double next : {price, 4.0 * price, 16.0 * price}) {
      price = next;
      best.value = f(best.at);
      for (int again = 0; again < (rising ? 3 : 6); ++again) {
        const double before = best.value;
        for (double& s : step) s = again % 2 == 0 ? 0.1 : -0.05;
        from_here(best.at, 30);
        if (!(best.value < before - 2e-4)) break;
      }
      if (!rising) break;
    }
    return best;
  }
};

/// The response of y to a step: largest magnitude, and the time after which it stays within 2 % of
/// `final`.
struct StepAnswer {
  double peak = 0.0;
  double settling = 0.0;
};
inline StepAnswer step_answer(const DynamicSystem& system, int input, double size, double final,
                              int steps) {
  const int n = system.a.rows();
  std::vector<double> x(static_cast<std::size_t>(n)), rate(static_cast<std::size_t>(n));
  StepAnswer answer;
  for (int k = 0; k <= steps; ++k) {
    double y = system.d(0, input) * size;
    for (int j = 0; j < n; ++j) y += system.c(0, j) * x[static_cast<std::size_t>(j)];
    answer.peak = std::max(answer.peak, std::abs(y));
    if (std::abs(y - final) > 0.02 * std::abs(final))
      answer.settling = (k + 1) * system.sample_time;
    for (int i = 0; i < n; ++i) rate[static_cast<std::size_t>(i)] = system.b(i, input) * size;
    for (int j = 0; j < n; ++j) {
      const double value = x[static_cast<std::size_t>(j)];
      for (int i = 0; i < n; ++i) rate[static_cast<std::size_t>(i)] += system.a(i, j) * value;
    }
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += rate[i];
  }
  return answer;
}

/// Computes the results of a design from its settings.
inline void fill_in(Contender& c, const TuneSearch& search, const LoopCost& fine, double optimum,
                    double free_cost) {
  TunedDesign& d = c.design;
  const TuneModel& model = search.model;
  const auto controller = tuned_controller(c.kind, model.sample_time, d.settings);
  if (!controller) return;
  d.controller = *controller;
  const LoopNumbers numbers = fine(*controller);
  d.cost = numbers.cost(search.rho, model.input_gain.value);
  d.excess = std::sqrt(d.cost / optimum);
  d.free_excess = std::min(std::sqrt(free_cost / optimum), d.excess);
  d.output_deviation = numbers.output;
  d.control_deviation = numbers.control;
  d.control_noise = numbers.control_noise;
  d.modulus_margin = numbers.modulus;
  d.delay_margin = numbers.delay;
  d.gain_tolerance = numbers.tolerance;
  const auto lack = search.lack(numbers, 0.999);
  d.feasible = numbers.stable && lack.sum() <= 0.0;
  if (!numbers.stable) {
    d.constraint = "stability";
  } else if (!d.feasible) {
    d.constraint = lack.gain > 0.0             ? "b0 wrong by a factor"
                   : lack.modulus > lack.delay ? "modulus margin"
                                               : "delay margin";
  } else if (d.cost < free_cost * 1.002) {
    d.constraint = "none";
  } else {
    const double modulus = numbers.modulus / search.rules.modulus_margin;
    const double delay = numbers.delay / (search.rules.delay_samples * model.sample_time);
    const double gain = numbers.tolerance / search.rules.gain_factor;
    d.constraint = gain < std::min(modulus, delay) ? "b0 wrong by a factor"
                   : modulus <= delay              ? "modulus margin"
                                                   : "delay margin";
  }
  if (!numbers.stable) return;
  const auto loop = closed_loop(model, *controller);
  if (!loop || !loop->stable()) {
    // Stability is decided by the poles.
    d.feasible = false;
    d.constraint = "stability";
    return;
  }
  const double decay = -std::log1p(std::max(loop->stability_abscissa(), -0.9));
  const int steps = static_cast<int>(std::min(12.0 / decay, 50000.0)) + 10;
  d.settling_time = step_answer(loop->system(), 0, 1.0, 1.0, steps).settling;
  d.load_peak = step_answer(loop->system(), 2, std::abs(model.input_gain.value), 0.0, steps).peak;
}

/// Type and config of the controller as C++ source.
inline std::string controller_source(const TunedDesign& d, const TuneModel& model) {
  const std::string n = std::to_string(model.order);
  const auto list = [](const std::vector<double>& numbers) {
    std::string text;
    for (const double number : numbers) text += (text.empty() ? "" : ", ") + source(number);
    return text;
  };
  const auto poles = [&](std::string text) {
    for (const auto& p : d.settings.observer_poles) {
      text += (text.empty() ? "{" : ", {") + source(p.real()) + ", " + source(p.imag()) + "}";
    }
    return ".poles = {{" + text + "}}";
  };
  std::string type, config;
  if (d.knows.any()) {
    type = "esokit::ModelEso<esokit::ModelParts{.order = " + n;
    std::string parts;
    const auto part = [&](const std::string& text) { parts += (parts.empty() ? "" : ", ") + text; };
    if (d.knows.lag) {
      type += ", .actuator = 1";
      part(".actuator = {.time_constant = " + source(model.lag) + "}");
    }
    if (d.knows.sensor) {
      type += ", .sensor = 1";
      part(".sensor = {.time_constant = " + source(model.sensor) + "}");
    }
    if (d.knows.swing) {
      type += ", .resonators = 1";
      part(".resonators = {{{.frequency = " + source(model.swings.front().frequency) +
           ", .capture_bandwidth = " + source(d.settings.capture_bandwidth) + "}}}");
    }
    const bool free = d.family == TuneFamily::free_poles;
    type += d.family == TuneFamily::half_gain ? "}, double, esokit::HalfGainPoles>"
            : free                            ? "}, double, esokit::PoleSet>"
                                              : "}>";
    // The pole of the lag is kept.
    config = free ? poles("{" + source(-1.0 / model.lag) + ", 0.0}")
                  : ".observer_bandwidth = " + source(d.settings.observer_bandwidth);
    config += ", .input_gain = " + source(model.input_gain.value) +
              ", .sample_time = " + source(model.sample_time) + ", .model = {" + parts + "}";
  } else {
    const std::string common = ".input_gain = " + source(model.input_gain.value) +
                               ", .sample_time = " + source(model.sample_time);
    const std::string bandwidth =
        ".observer_bandwidth = " + source(d.settings.observer_bandwidth) + ", ";
    switch (d.family) {
      case TuneFamily::linear:
        type = "esokit::LinearEso<" + n + (d.extension > 1 ? ", double, 2>" : ">");
        config = bandwidth + common;
        break;
      case TuneFamily::half_gain:
        type = "esokit::HalfGainEso<" + n + ">";
        config = bandwidth + common;
        break;
      case TuneFamily::cascade:
        type = "esokit::CascadeEso<" + n + ", " + std::to_string(d.levels) + ">";
        config = bandwidth + ".bandwidth_factor = " + source(d.settings.bandwidth_factor) + ", " +
                 common;
        break;
      case TuneFamily::filter: {
        type = "esokit::ExtendedStateFilter<" + n + ">";
        std::vector<double> bounds(static_cast<std::size_t>(model.order), 0.0);
        bounds.push_back(d.settings.disturbance_bound);
        config = common + ", .measurement_variance = " + source(model.noise * model.noise) +
                 ", .disturbance_bounds = {{" + list(bounds) +
                 "}}, .bound_factor = 1.0, .inflation_rule = esokit::InflationRule::none, "
                 ".mode = esokit::RiccatiMode::frozen";
        break;
      }
      case TuneFamily::free_poles:
        type = "esokit::LinearEso<" + n + ", double, 1, esokit::PoleSet>";
        config = poles("") + ", " + common;
        break;
    }
  }
  const bool by_bandwidth = d.settings.controller_bandwidth > 0.0;
  return "using Observer = " + type + ";\n" +
         "auto controller = esokit::Adrc<Observer>::make({.observer = {" + config + "},\n" +
         (by_bandwidth ? "    .controller_bandwidth = " + source(d.settings.controller_bandwidth)
                       : "    .gains = {{" + list(d.settings.gains) + "}}") +
         ",\n    .limits = {.lower = " + source(model.u_min) + ", .upper = " + source(model.u_max) +
         "}});\n";
}

/// All families for a model. A template, as `tune`, so that it costs compile time only where it is
/// called.
template <class = void>
std::vector<Contender> contenders(const TuneModel& model, bool law_is_given) {
  std::vector<Contender> all;
  const auto take = [&](TuneFamily family, std::string name, const TuneKnowledge& knows, int m,
                        int p, std::optional<ObserverKind> kind) {
    if (!kind) return;
    Contender c;
    c.design.family = family;
    c.design.name = std::move(name);
    c.design.knows = knows;
    c.design.extension = m;
    c.design.levels = p;
    c.design.instructions = update_instructions(model.order, family, m, p, knows);
    c.kind = std::move(*kind);
    if (family == TuneFamily::cascade) c.observer_numbers = 2;
    if (family == TuneFamily::free_poles) {
      c.observer_numbers = c.kind.placed;
      c.law_numbers = c.kind.order;
    }
    if (knows.swing && !(model.swings.front().capture_bandwidth > 0.0)) c.observer_numbers = 2;
    if (law_is_given) c.law_numbers = 0;
    all.push_back(std::move(c));
  };
  const auto chain = [&](TuneFamily family, std::string name, int m, int p) {
    take(family, std::move(name), {}, m, p, chain_kind(model, family, m, p));
  };
  const std::string n = std::to_string(model.order);
  chain(TuneFamily::linear, "LinearEso", 1, 1);
  chain(TuneFamily::half_gain, "HalfGainEso", 1, 1);
  chain(TuneFamily::linear, "LinearEso, m = 2", 2, 1);
  chain(TuneFamily::cascade, "CascadeEso, p = 2", 1, 2);
  chain(TuneFamily::cascade, "CascadeEso, p = 3", 1, 3);
  chain(TuneFamily::filter, "frozen filter, LQR gains", 1, 1);
  chain(TuneFamily::free_poles, "LinearEso, free poles", 1, 1);
  with_number<1, 3>(model.order, [&](auto number) {
    constexpr int order = number();
    const auto known = [&](auto parts, TuneFamily family, const char* type, const char* what,
                           const TuneKnowledge& knows) {
      constexpr ModelParts p = decltype(parts)::value;
      take(family, std::string(type) + " that knows " + what, knows, 1, 1,
           known_kind<p>(model, family));
    };
    const auto both = [&](auto parts, const char* what, const TuneKnowledge& knows) {
      known(parts, TuneFamily::linear, "LinearEso", what, knows);
      known(parts, TuneFamily::half_gain, "HalfGainEso", what, knows);
    };
    const bool lag = model.lag > 0.0, sensor = model.sensor > 0.0, swing = !model.swings.empty();
    using L = std::integral_constant<ModelParts, ModelParts{.order = order, .actuator = 1}>;
    if (lag) {
      both(L{}, "the lag", {.lag = true});
      known(L{}, TuneFamily::free_poles, "LinearEso, free poles,", "the lag", {.lag = true});
    }
    using F = std::integral_constant<ModelParts, ModelParts{.order = order, .sensor = 1}>;
    if (sensor) both(F{}, "the sensor", {.sensor = true});
    using Q = std::integral_constant<ModelParts, ModelParts{.order = order, .resonators = 1}>;
    if (swing) both(Q{}, "the swing", {.swing = true});
    using LF =
        std::integral_constant<ModelParts, ModelParts{.order = order, .actuator = 1, .sensor = 1}>;
    if (lag && sensor) both(LF{}, "lag and sensor", {.lag = true, .sensor = true});
    using LQ = std::integral_constant<ModelParts,
                                      ModelParts{.order = order, .actuator = 1, .resonators = 1}>;
    if (lag && swing) both(LQ{}, "lag and swing", {.lag = true, .swing = true});
    return 0;
  });
  return all;
}

/// Bandwidth w of the LQG law, rho = w^(-2n), that meets a requirement: the monotonic function
/// `rises(w)` shall be `wanted`.
template <class Function>
double bandwidth_for(const Function& rises, double wanted, double low, double high) {
  for (int i = 0; i < 40 && high > low * 1.0005; ++i) {
    const double middle = std::sqrt(low * high);
    (rises(middle) < wanted ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

}  // namespace detail

/// Finds designs for a model, the best one first.
/// @return error for a model that `check` refuses, more than one requirement, or a requirement that
///         no controller can meet
template <class = void>
[[nodiscard]] Expected<Tuning, Error<double>> tune(const TuneModel& model,
                                                   const TuneWish& wish = {},
                                                   const TuneRules& rules = {}) {
  Rules<double> checks;
  checks.all_of(model.check())
      .not_negative("control_noise", wish.control_noise)
      .not_negative("settling_time", wish.settling_time)
      .not_negative("controller_bandwidth", wish.controller_bandwidth)
      .require(!(wish.settling_time > 0.0 && wish.control_noise > 0.0), "settling_time",
               wish.settling_time, "must be left out if control_noise is given")
      .require(!(wish.controller_bandwidth > 0.0 &&
                 (wish.control_noise > 0.0 || wish.settling_time > 0.0)),
               "controller_bandwidth", wish.controller_bandwidth,
               "must be left out if control_noise or settling_time is given")
      .not_negative("modulus_margin", rules.modulus_margin)
      .require(!(rules.modulus_margin >= 1.0), "modulus_margin", rules.modulus_margin,
               "must be below 1")
      .not_negative("delay_samples", rules.delay_samples)
      .require(rules.gain_factor >= 1.0 && is_finite(rules.gain_factor), "gain_factor",
               rules.gain_factor, "must be finite and 1 or more");
  if (!checks) return checks.error();
  const int n = model.order;
  const double T = model.sample_time;
  const double b0 = model.input_gain.value;
  Tuning tuning;
  tuning.model = model;
  tuning.rules = rules;
  const double filter_bandwidth = model.filter_bandwidth();
  const double latency = model.lag + model.dead_time + model.sensor + 1.5 * T;
  const Lqg lqg(model);
  const double slow = std::min(1e-3 * filter_bandwidth, 1e-2 / T), fast = 0.5 / T;
  const auto rho_of = [n](double w) { return std::pow(w, -2 * n); };
  double w = 0.0;
  if (wish.controller_bandwidth > 0.0) {
    w = wish.controller_bandwidth;
    checks
        .require(w <= fast, {"controller_bandwidth", w,
                             "must not be above half the sample rate, which is", -1, fast, true})
        .require(w * T >= 1e-6, "controller_bandwidth", w,
                 "must be at least 1e-6 of the sample rate");
  } else if (wish.settling_time > 0.0) {
    const auto settling = [&](double x) { return -lqg.settling(rho_of(x)); };
    checks
        .require(-settling(fast) <= wish.settling_time,
                 {"settling_time", wish.settling_time,
                  "is shorter than sample time and dead time allow, which is", -1, -settling(fast),
                  true})
        .require(
            -settling(slow) >= wish.settling_time,
            {"settling_time", wish.settling_time,
             "is far slower than the disturbance; must be at most", -1, -settling(slow), true});
    if (!checks) return checks.error();
    w = detail::bandwidth_for(settling, -wish.settling_time, slow, fast);
  } else {
    const LoopCost cost(model, rules, slow);
    const auto noise = [&](double x) { return cost(lqg.controller(rho_of(x))).control_noise; };
    const double least = noise(slow);
    double wanted = wish.control_noise;
    if (wanted > 0.0) {
      checks.require(
          wanted > 1.001 * least,
          {"control_noise", wanted, "is less than needed to cancel the disturbance alone, which is",
           -1, least, true});
    } else {
      wanted = std::max(0.05 * (model.u_max - model.u_min), 2.0 * least);
    }
    if (!checks) return checks.error();
    tuning.control_noise = wanted;
    w = detail::bandwidth_for(noise, wanted, slow, fast);
  }
  if (!checks) return checks.error();
  tuning.rho = rho_of(w);

  detail::TuneSearch search{
      model,         rules,  tuning.rho, wish.controller_bandwidth, w, filter_bandwidth,
      1.0 / latency, nullptr};
  // The search requires slightly larger margins, because its frequency grid is coarse.
  TuneRules strict = rules;
  strict.gain_factor *= 1.01;
  const LoopCost cost(model, strict, search.slowest(), 14.0);
  const LoopCost fine(model, rules, search.slowest(), 50.0);
  search.cost = &cost;
  // A sine of known frequency can be cancelled at no cost, so J* is computed without it.
  TuneModel walking = model;
  walking.swings.clear();
  tuning.lqg = LoopCost(walking, rules, search.slowest(), 50.0)(lqg.controller(tuning.rho));
  tuning.optimum = tuning.lqg.cost(tuning.rho, b0);
  checks.require(tuning.lqg.stable && tuning.optimum > 0.0 && is_finite(tuning.optimum), "optimum",
                 tuning.optimum, "cannot be computed: the numbers of this model are too far apart");
  if (!checks) return checks.error();
  std::vector<detail::Contender> all = detail::contenders(model, wish.controller_bandwidth > 0.0);
  for (detail::Contender& c : all) {
    std::vector<std::vector<double>> starts;
    if (c.design.family == TuneFamily::free_poles) {
      starts.push_back(search.start(c, search.filter_bandwidth, w, true));
      // Also from the results of the families that are special cases of this one.
      for (const detail::Contender& other : all) {
        const bool half = other.design.family == TuneFamily::half_gain;
        if (other.design.knows == c.design.knows && other.design.extension == 1 &&
            (half || other.design.family == TuneFamily::linear)) {
          const TuneSettings& found = other.design.settings;
          starts.push_back(
              search.start(c, found.observer_bandwidth, found.controller_bandwidth, half));
        }
      }
    }
    const auto free = search.least(c, false, starts);
    auto best = free;
    if (search.value(c, free.at, 1.0) > free.value) {
      best = search.least(c, true, starts);
    }
    c.design.settings = search.settings(c, best.at);
    detail::fill_in(c, search, fine, tuning.optimum, std::exp(free.value));
    c.design.code = detail::controller_source(c.design, model);
  }
  for (detail::Contender& c : all) tuning.designs.push_back(std::move(c.design));
  // Ranks by J; among the remaining designs within 1 % of the smallest J, the cheapest update comes
  // next.
  std::stable_sort(tuning.designs.begin(), tuning.designs.end(),
                   [](const TunedDesign& a, const TunedDesign& b) {
                     return a.feasible != b.feasible ? a.feasible : a.cost < b.cost;
                   });
  for (std::size_t i = 0; i < tuning.designs.size(); ++i) {
    std::size_t best = i;
    for (std::size_t j = i + 1; j < tuning.designs.size(); ++j) {
      const TunedDesign& a = tuning.designs[best];
      const TunedDesign& b = tuning.designs[j];
      if (b.feasible != tuning.designs[i].feasible || b.cost > 1.01 * tuning.designs[i].cost) break;
      if (b.instructions < a.instructions ||
          (b.instructions == a.instructions && b.modulus_margin > a.modulus_margin)) {
        best = j;
      }
    }
    std::rotate(tuning.designs.begin() + static_cast<std::ptrdiff_t>(i),
                tuning.designs.begin() + static_cast<std::ptrdiff_t>(best),
                tuning.designs.begin() + static_cast<std::ptrdiff_t>(best) + 1);
  }
  return tuning;
}

}  // namespace esokit
