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
/// 4. For each family J is minimised at this rho under the rules; if it cannot keep them, the
/// design says which one.
///    Of free poles J and margins of a chain are the same however they are divided between observer
///    and law: the division is that at which the search ends, which starts from the law of the LQG
///    controller; where a rule binds, that of all divisions that breaks the rules least.
/// 5. Designs are ranked by J; those within 1 % by the cost of an update, then by the
///    modulus margin.
/// 6. The first is played within the limits of u: if it does not come back from an overload, it
///    ranks behind and the next is played (tune/play.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <esokit/core/expected.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/play.hpp>
#include <esokit/tune/problem.hpp>
#include <esokit/tune/search.hpp>
#include <limits>
#include <map>
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
  int numbers = 0;          ///< how many were chosen for J; what the model tells does not count
  TuneKnowledge knows{};    ///< what its observer knows
  TuneSettings settings{};  ///< the chosen parameters
  bool feasible = false;    ///< keeps all rules: margins, noise in u, and what lets it come back
  std::string constraint;   ///< the rule that limits it, or that it cannot keep; or "none"
  bool played = false;      ///< within the limits, see TuneRules::play
  bool comes_back = true;   ///< from all that was played; true if nothing was
  std::string lost;         ///< in words, what it does not come back from
  PlayEvent lost_in{};      ///< this event, on variant `lost_on` of the plant
  int lost_on = 0;          ///< see played_variants
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
  double phase_margin = 0.0;       ///< smallest over the intervals, rad
  double damping_latencies = 0.0;  ///< k_1 / k_0 over TuneModel::latency, 0 if there is no k_1
  double bandwidth_ratio = 0.0;    ///< omega_c / omega_o, geometric means of poles
  int instructions = 0;            ///< per update of the observer, see update_instructions
  std::string code;                ///< C++ source of the controller, type and config, to paste
  LinearController controller{};   ///< for the analysis, see closed_loop(model, controller)
  PlayedLaw law{};                 ///< what softening has to know, see `played_law`

  /// The law for `play`: none, that is the linear one, unless it softens at the limits.
  [[nodiscard]] PlayedLaw played_law() const { return settings.soften ? law : PlayedLaw{}; }
  /// The settling time for `play` on one of `played_variants`, s: with friction 32 / omega_c of a
  /// law.
  [[nodiscard]] double played_settling(const TuneModel& variant) const {
    return variant.friction.value_or(0.0) > 0.0 && !settings.gains.empty()
               ? 32.0 / detail::law_mean(settings.gains, variant.order)
               : settling_time;
  }
};

/// The result of `tune`.
struct Tuning {
  TuneModel model{};               ///< as given, with at least the disturbance of the floor
  TuneRules rules{};               ///< as given
  double model_disturbance = 0.0;  ///< that of the given model; model.disturbance may be larger
  double rho = 0.0;                ///< weight of var(b0 u~) in J
  double control_noise = 0.0;  ///< the required value, unit of u; 0 if something else was required
  double settling_time = 0.0;  ///< the required value, s; 0 if something else was required
  double least_noise = 0.0;    ///< what cancelling the given disturbance alone needs, unit of u
  double optimum = 0.0;        ///< J*
  LoopNumbers lqg{};           ///< of the controller with J*
  std::vector<TunedDesign> designs{};  ///< the best one first, then what does not come back when
                                       ///< played, infeasible ones last

  /// The first design, or null if it does not keep the rules or does not come back.
  [[nodiscard]] const TunedDesign* chosen() const noexcept {
    return !designs.empty() && designs.front().feasible && designs.front().comes_back
               ? &designs.front()
               : nullptr;
  }
};

/// Something that has to be looked at before a design is used.
struct TuneAlarm {
  const char* name = "";  ///< one word
  std::string text;       ///< a sentence
};

/// What speaks against a design that keeps its rules: a settling time above the one asked, noise in
/// u above usual_control_noise, more than three times the deviations of the best linear controller,
/// and what it does not come back from, or that nothing was played.
inline std::vector<TuneAlarm> alarms(const Tuning& tuning, const TunedDesign& design) {
  std::vector<TuneAlarm> all;
  const double range = tuning.model.u_max - tuning.model.u_min;
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return std::string(text);
  };
  if (!design.comes_back) {
    all.push_back(
        {"overload", "This design does not come back from " + design.lost +
                         ": u goes from limit to limit or stays at one, or y swings for ever."});
  } else if (!design.played) {
    all.push_back({"overload",
                   "This design was not played within the limits of u: whether it "
                   "comes back from an overload is not known."});
  }
  if (tuning.settling_time > 0.0 && design.settling_time > 1.05 * tuning.settling_time) {
    all.push_back(
        {"settling",
         "A step of the reference settles in " + number(design.settling_time) + " s, asked was " +
             number(tuning.settling_time) +
             " s: its slowest poles are those of the observer, or the rules allow no faster law."});
  }
  if (design.control_noise > 1.001 * usual_control_noise * range) {
    all.push_back({"noise", "Noise moves u by " + number(100.0 * design.control_noise / range) +
                                " % of its range (standard deviation); usual is " +
                                number(100.0 * usual_control_noise) +
                                " %. The least that cancels the disturbance of the log is " +
                                number(100.0 * tuning.least_noise / range) +
                                " %. Measure y with less noise, or sample faster."});
  }
  if (design.excess > 3.0) {
    all.push_back({"excess", "Deviations of y and u are " + number(design.excess) +
                                 " times those of the best linear controller: the rules leave "
                                 "little of what this machine could do. It is limited by: " +
                                 design.constraint + "."});
  }
  return all;
}

/// Instructions of an update of the observer on a Cortex-M4F in float, counted in the disassembly
/// on the path without faults (GCC 12, -O2). The emulator of examples/embedded counts the same
/// within two; its table gives the frozen filter nine more.
inline int update_instructions(int order, TuneFamily family, int extension, int levels,
                               const TuneKnowledge& knows) {
  const auto n = static_cast<std::size_t>(order - 1);
  constexpr int chain[3][2] = {{27, 39}, {39, 50}, {50, 63}};
  constexpr int cascade[3][2] = {{43, 57}, {58, 83}, {76, 115}};
  constexpr int lag[3] = {45, 61, 80}, sensor[3] = {41, 56, 75}, sinusoid[3] = {57, 74, 92};
  constexpr int lag_sensor[3] = {63, 82, 102}, lag_sinusoid[3] = {80, 103, 124};
  if (knows.lag && knows.sensor) return lag_sensor[n];
  if (knows.lag && knows.sinusoid) return lag_sinusoid[n];
  if (knows.lag) return lag[n];
  if (knows.sensor) return sensor[n];
  if (knows.sinusoid) return sinusoid[n];
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

/// The number that stands in the source.
inline double printed(double value) { return std::strtod(source(value).c_str(), nullptr); }

/// The settings that stand in the source, so that what is said of a design is said of its code.
inline TuneSettings as_printed(TuneSettings s) {
  for (double* number :
       {&s.observer_bandwidth, &s.bandwidth_factor, &s.disturbance_bound, &s.capture_bandwidth}) {
    *number = printed(*number);
  }
  for (auto& pole : s.observer_poles) pole = {printed(pole.real()), printed(pole.imag())};
  if (s.controller_bandwidth > 0.0) {
    s.controller_bandwidth = printed(s.controller_bandwidth);
    s.gains =
        polynomial(std::vector<std::complex<double>>(s.gains.size(), -s.controller_bandwidth));
  } else {
    for (double& gain : s.gains) gain = printed(gain);
  }
  return s;
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
  double most_noise;           ///< in u, 0 if something else is required
  const LoopCost* cost;

  /// Of a point that was evaluated: log J, what its rules lack, and log omega_c.
  struct Seen {
    double value = 0.0, lack = 0.0, speed = 0.0;
  };
  mutable std::map<std::vector<double>, Seen> seen{};  ///< of one contender

  /// J says nothing of the reference, and is often the same for a slow law and a fast observer: a
  /// law ten times as fast is worth 0.7 % of J.
  static constexpr double worth_of_speed = 0.003;

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
    if (c.design.knows.sinusoid) {
      const double given = model.sinusoids.front().capture_bandwidth;
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

  /// The cost for the search, which requires slightly larger margins, because its frequency grid is
  /// coarse.
  [[nodiscard]] LoopCost coarse() const {
    TuneRules strict = rules;
    strict.gain_factor *= 1.01;
    return {model, strict, slowest(), 14.0};
  }

  /// What the rules are about: of each the number that a design has, over the one that is required;
  /// infinite if nothing is.
  struct Kept {
    double modulus, delay, gain, phase, noise, damping, ratio;
  };
  [[nodiscard]] static double over(double has, double required) {
    return required > 0.0 ? has / required : std::numeric_limits<double>::infinity();
  }
  /// Those that any controller has to keep.
  [[nodiscard]] Kept kept(const LoopNumbers& numbers) const {
    constexpr double any = std::numeric_limits<double>::infinity();
    return {over(numbers.modulus, rules.modulus_margin),
            over(numbers.delay, rules.delay_samples * model.sample_time),
            numbers.tolerant ? std::max(numbers.tolerance / rules.gain_factor, 1.0)
                             : std::min(numbers.tolerance / rules.gain_factor, 0.98),
            over(numbers.phase, rules.phase_margin),
            most_noise > 0.0 ? most_noise / numbers.control_noise : any,
            any,
            any};
  }
  [[nodiscard]] Kept kept(const Contender& c, const TuneSettings& s,
                          const LoopNumbers& numbers) const {
    const int n = model.order;
    Kept all = kept(numbers);
    if (n > 1)
      all.damping = over(s.gains[1] / s.gains[0], rules.damping_latencies * model.lateness());
    if (n == 3 && rules.bandwidth_ratio > 0.0) {
      all.ratio = rules.bandwidth_ratio * observer_mean(c.design.family, c.kind, model, s) /
                  law_mean(s.gains, n);
    }
    return all;
  }
  /// How much is missing: the sum of shares, 0 if nothing is.
  [[nodiscard]] static double lack(const Kept& kept, double more = 1.0) {
    double sum = std::max(1.0 - kept.gain, 0.0);
    for (const double share :
         {kept.modulus, kept.delay, kept.phase, kept.noise, kept.damping, kept.ratio}) {
      sum += std::max(1.0 - share / more, 0.0);
    }
    return sum;
  }

  /// log J plus a penalty on broken rules.
  [[nodiscard]] double value(const Contender& c, const std::vector<double>& x, double price) const {
    double outside = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      outside += std::max(low(c, i) - x[i], 0.0) + std::max(x[i] - high(c, i), 0.0);
    }
    if (outside > 0.0) return 1e4 * (1.0 + outside);
    // The search with rules comes back to the points of that without.
    auto [at, added] = seen.try_emplace(x);
    Seen& found = at->second;
    if (!added) return found.value + price * found.lack - worth_of_speed * found.speed;
    const TuneSettings chosen = settings(c, x);
    const auto controller = tuned_controller(c.kind, model.sample_time, chosen);
    if (!controller || (c.design.family == TuneFamily::free_poles && runs_away(*controller))) {
      found.value = 1e5;
      return found.value;
    }
    const LoopNumbers numbers = (*cost)(*controller);
    const double j = numbers.cost(rho, model.input_gain.value);
    if (!numbers.stable || !(j > 0.0) || !is_finite(j)) {
      found.value = 1e4;
    } else {
      // Behind limits a slow law comes back more often, except of one integrator.
      const auto& k = chosen.gains;
      found = {std::log(j), lack(kept(c, chosen, numbers), 1.004),
               model.order == 1 ? std::log(k[0]) / static_cast<double>(k.size()) : 0.0};
    }
    return found.value + price * found.lack - worth_of_speed * found.speed;
  }

  /// Whether a controller is not stable by itself, which poles of little damping can make of it;
  /// its integrator may stand.
  [[nodiscard]] static bool runs_away(const LinearController& controller) {
    const auto poles = poles_of(controller.a);
    return std::any_of(poles.begin(), poles.end(),
                       [](const auto& pole) { return std::abs(1.0 + pole) > 1.0 + 1e-7; });
  }

  /// What a point lacks of the rules, by this cost.
  [[nodiscard]] double lacks(const Contender& c, const std::vector<double>& x,
                             const LoopCost& by) const {
    const TuneSettings chosen = settings(c, x);
    const auto controller = tuned_controller(c.kind, model.sample_time, chosen);
    return controller ? lack(kept(c, chosen, by(*controller)), 0.9995) : 1e5;
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
    return c.design.knows.sinusoid && c.observer_numbers == 2 && i == 1;
  }
  [[nodiscard]] double low(const Contender& c, std::size_t i) const {
    return std::log(damping(c, i)   ? 0.001
                    : factor(c, i)  ? 0.1
                    : capture(c, i) ? 0.003 * model.sinusoids.front().frequency
                                    : slowest());
  }
  [[nodiscard]] double high(const Contender& c, std::size_t i) const {
    return std::log(damping(c, i)   ? 4.0
                    : factor(c, i)  ? 8.0
                    : capture(c, i) ? 3.0 * model.sinusoids.front().frequency
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

  /// The same free poles, divided otherwise between observer and law: all that there are.
  [[nodiscard]] std::vector<std::vector<double>> divisions(const Contender& c,
                                                           const std::vector<double>& x) const {
    // A pair is one unit, as its poles cannot be divided.
    std::vector<std::complex<double>> reals, pairs;
    for (const auto& [first, count] :
         {std::pair(0, c.kind.placed), std::pair(c.observer_numbers, c.kind.order)}) {
      int i = first;
      if (count % 2 != 0) reals.emplace_back(-std::exp(x[static_cast<std::size_t>(i++)]));
      for (; i < first + count; i += 2) {
        const auto pair = pole_pair(std::exp(x[static_cast<std::size_t>(i)]),
                                    std::exp(x[static_cast<std::size_t>(i) + 1]));
        if (pair[0].imag() != 0.0) {
          pairs.push_back(pair[0]);
        } else {
          reals.insert(reals.end(), pair.begin(), pair.end());
        }
      }
    }
    std::vector<std::vector<double>> all;
    const std::size_t units = reals.size() + pairs.size();
    for (unsigned chosen = 0; chosen < 1U << units; ++chosen) {
      std::vector<double> found;
      for (const bool of_law : {false, true}) {
        std::vector<double> own;
        std::vector<std::complex<double>> twos;
        for (std::size_t i = 0; i < units; ++i) {
          if (((chosen >> i & 1U) != 0) != of_law) continue;
          if (i < reals.size()) {
            own.push_back(-reals[i].real());
          } else {
            twos.push_back(pairs[i - reals.size()]);
          }
        }
        const auto count = static_cast<std::size_t>(of_law ? c.kind.order : c.kind.placed);
        if (own.size() + 2 * twos.size() != count) break;
        std::sort(own.begin(), own.end());
        std::size_t i = 0;
        if (count % 2 != 0) found.push_back(std::log(own[i++]));
        for (; i + 1 < own.size(); i += 2) {
          const double w = std::sqrt(own[i] * own[i + 1]);
          found.push_back(std::log(w));
          found.push_back(std::log(0.5 * (own[i] + own[i + 1]) / w));
        }
        for (const auto& pole : twos) {
          found.push_back(std::log(std::abs(pole)));
          found.push_back(std::log(-pole.real() / std::abs(pole)));
        }
      }
      if (found.size() != x.size()) continue;
      for (std::size_t i = 0; i < found.size(); ++i) {
        found[i] = std::clamp(found[i], low(c, i), high(c, i));
      }
      all.push_back(std::move(found));
    }
    return all;
  }

  /// The minimum of a family. @param starts start points in place of a scan
  [[nodiscard]] SearchPoint least(const Contender& c, bool margins,
                                  const std::vector<std::vector<double>>& starts) const {
    // With many variables the penalty begins low and rises: it leads along the edge of a rule, on
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
      for (const SearchPoint& start : grid_search(f, from, to, points, margins ? 2 : 3)) {
        from_here(start.at, 40);
      }
    }
    for (const auto& start : starts) from_here(start, 30);
    for (const double next : {price, 4.0 * price, 16.0 * price}) {
      price = next;
      best.value = f(best.at);
      int in_vain = 0;
      for (int again = 0; again < (rising ? 10 : 6) && in_vain < (rising ? 2 : 1); ++again) {
        const double before = best.value;
        for (std::size_t i = 0; i < numbers; ++i) {
          // A simplex of another shape finds ways along an edge on which the last one collapsed.
          const bool other_way = rising && (again / 2 >> i % 3 & 1) != 0;
          step[i] =
              (again % 2 == 0 ? 0.1 : -0.05) * (rising ? 2.0 : 1.0) * (other_way ? -1.0 : 1.0);
        }
        from_here(best.at, 30);
        in_vain = best.value < before - (rising ? 2e-5 : 2e-4) ? 0 : in_vain + 1;
      }
      if (!rising) break;
    }
    return best;
  }
};

/// The search of a problem whose rho is known.
inline TuneSearch search_for(const Tuning& tuning, bool given_law) {
  const TuneModel& model = tuning.model;
  const double w = std::pow(tuning.rho, -0.5 / model.order);
  return {model,
          tuning.rules,
          tuning.rho,
          given_law ? w : 0.0,
          w,
          model.filter_bandwidth(),
          1.0 / (model.lag + model.dead_time + model.sensor + 1.5 * model.sample_time),
          tuning.control_noise,
          nullptr};
}

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

/// An event in words.
inline std::string in_words(const PlayEvent& event, const TuneModel& model) {
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return std::string(text);
  };
  const std::string share = number(100.0 * event.share) + " % of half the range of u";
  const double seconds = event.latencies * model.latency();
  const std::string time = seconds < 1.0 ? number(1e3 * seconds) + " ms" : number(seconds) + " s";
  switch (event.kind) {
    case PlayKind::load:
      return "a load of " + share + " for " + time;
    case PlayKind::kick:
      return "a kick worth " + share + " for " + time;
    default:
      return "a step of the reference as far as " + share + " moves the chain in " + time;
  }
}

/// Plays all events on all variants of the plant, until one is lost.
inline void play_law(TunedDesign& d, const TuneModel& model) {
  d.comes_back = true;
  d.lost.clear();
  const PlayedLaw law = d.played_law();
  const auto variants = played_variants(model);
  for (std::size_t v = 0; v < variants.size(); ++v) {
    for (const PlayEvent& event : played_events(variants[v].model)) {
      const Played played = play(
          variants[v].model, variants[v].gain, d.controller, event,
          d.played_settling(variants[v].model), [](double, double, double, double) {}, law);
      if (played.back || !played.counts) continue;
      d.comes_back = false;
      d.lost_in = event;
      d.lost_on = static_cast<int>(v);
      d.lost = in_words(event, model) +
               (*variants[v].model.friction > 0.0
                    ? ", with friction of " + source(*variants[v].model.friction) + " on y''"
                : v > 0 ? ", with b0 and the latency at the ends of their intervals"
                        : "");
      return;
    }
  }
}

/// Plays a controller as it is; false if no other way to act at its limits can help.
inline bool play_as_is(TunedDesign& d, const TuneModel& model) {
  d.played = true;
  if (model.may_rub() && swings_with_friction(model, d.controller)) {
    d.comes_back = false;
    d.lost_in = friction_events[0];
    d.lost_on = static_cast<int>(played_variants(model).size()) - 1;
    d.lost = "friction on y'', however small: it acts as a damping, with which the loop swings";
    return false;
  }
  play_law(d, model);
  return true;
}

/// Plays a design; one of order 2 softened, and as designed if it does not come back so, the others
/// the other way round. Drawn machines behind friction and gravity came back from more and sooner
/// like this (examples/choosing).
inline void play_all(TunedDesign& d, const TuneModel& model) {
  const bool possible = d.settings.gains[0] > 0.0;
  d.settings.soften = model.order == 2 && possible;
  if (!play_as_is(d, model) || d.comes_back || !possible) return;
  d.settings.soften = !d.settings.soften;
  play_law(d, model);
}

/// What the loop of a design does, and the rule that limits it. @param kept by `numbers`
inline void fill_in_loop(TunedDesign& d, const TuneSearch& search, const LoopNumbers& numbers,
                         const TuneSearch::Kept& kept, double optimum, double free_cost) {
  const TuneModel& model = search.model;
  d.cost = numbers.cost(search.rho, model.input_gain.value);
  d.excess = std::sqrt(d.cost / optimum);
  d.free_excess = std::min(std::sqrt(free_cost / optimum), d.excess);
  d.output_deviation = numbers.output;
  d.control_deviation = numbers.control;
  d.control_noise = numbers.control_noise;
  d.modulus_margin = numbers.modulus;
  d.delay_margin = numbers.delay;
  d.gain_tolerance = numbers.tolerance;
  d.phase_margin = numbers.phase;
  d.feasible = numbers.stable && search.lack(kept, 0.999) <= 0.0;
  if (!numbers.stable) {
    d.constraint = "stability";
    return;
  }
  if (d.feasible && d.cost < free_cost * 1.002) {
    d.constraint = "none";
  } else {
    const double gain = numbers.tolerant ? numbers.tolerance / search.rules.gain_factor : kept.gain;
    const std::pair<double, const char*> all[] = {
        {gain, "b0 wrong by a factor"},   {kept.modulus, "modulus margin"},
        {kept.delay, "delay margin"},     {kept.phase, "phase margin"},
        {kept.noise, "noise in u"},       {kept.damping, "k_1 / k_0 and the latency"},
        {kept.ratio, "omega_c / omega_o"}};
    d.constraint =
        std::min_element(std::begin(all), std::end(all), [](const auto& a, const auto& b) {
          return a.first < b.first;
        })->second;
  }
  const auto loop = closed_loop(model, d.controller);
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

/// Computes the results of a design from its settings.
inline void fill_in(Contender& c, const TuneSearch& search, const LoopCost& fine, double optimum,
                    double free_cost) {
  TunedDesign& d = c.design;
  const TuneModel& model = search.model;
  const auto controller = tuned_controller(c.kind, model.sample_time, d.settings);
  if (!controller) return;
  d.controller = *controller;
  const LoopNumbers numbers = fine(*controller);
  const auto& gains = d.settings.gains;
  d.settings.soften = model.order > 1 && gains[0] > 0.0;
  d.damping_latencies = gains.size() > 1 ? gains[1] / gains[0] / model.latency() : 0.0;
  d.bandwidth_ratio =
      law_mean(gains, model.order) / observer_mean(d.family, c.kind, model, d.settings);
  d.numbers = c.observer_numbers + c.law_numbers;
  fill_in_loop(d, search, numbers, search.kept(c, d.settings, numbers), optimum, free_cost);
  const auto observer = tuned_observer(c.kind, model.sample_time, d.settings);
  d.law = {gains, observer->input_gain, observer->to_estimate, observer->y_to_estimate};
}

/// By J; among the remaining designs within 1 % of the smallest J, the cheapest update comes next.
/// Behind is what has to be softened beyond order 2, then what does not come back, last what does
/// not keep the rules.
inline void rank(std::vector<TunedDesign>& designs, int order) {
  const auto group = [&](const TunedDesign& d) {
    return !d.feasible ? 3 : !d.comes_back ? 2 : order > 2 && d.played && d.settings.soften ? 1 : 0;
  };
  std::stable_sort(designs.begin(), designs.end(), [&](const TunedDesign& a, const TunedDesign& b) {
    return group(a) != group(b) ? group(a) < group(b) : a.cost < b.cost;
  });
  for (std::size_t i = 0; i < designs.size(); ++i) {
    std::size_t best = i;
    for (std::size_t j = i + 1; j < designs.size(); ++j) {
      const TunedDesign& a = designs[best];
      const TunedDesign& b = designs[j];
      if (group(b) != group(designs[i]) || b.cost > 1.01 * designs[i].cost) break;
      if (b.instructions < a.instructions ||
          (b.instructions == a.instructions && b.modulus_margin > a.modulus_margin)) {
        best = j;
      }
    }
    std::rotate(designs.begin() + static_cast<std::ptrdiff_t>(i),
                designs.begin() + static_cast<std::ptrdiff_t>(best),
                designs.begin() + static_cast<std::ptrdiff_t>(best) + 1);
  }
}

/// The controller as C++ source, in its parts.
struct ControllerSource {
  std::string observer;  ///< its type
  std::string config;    ///< of the observer, without its braces
  std::string law;       ///< `.gains = ..` or `.controller_bandwidth = ..`
  std::string soften;    ///< `.soften = ..`

  /// Type and config, to paste.
  [[nodiscard]] std::string text(const TuneModel& model) const {
    return "using Observer = " + observer + ";\n" +
           "auto controller = esokit::Adrc<Observer>::make({.observer = {" + config + "},\n    " +
           law + ",\n    .limits = {.lower = " + source(model.u_min) +
           ", .upper = " + source(model.u_max) + "}, " + soften + "});\n";
  }
};
inline ControllerSource controller_source(const TunedDesign& d, const TuneModel& model) {
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
    if (d.knows.sinusoid) {
      type += ", .resonators = 1";
      part(".resonators = {{{.frequency = " + source(model.sinusoids.front().frequency) +
           ", .capture_bandwidth = " + source(d.settings.capture_bandwidth) + "}}}");
    }
    const bool free = d.family == TuneFamily::free_poles;
    type += d.family == TuneFamily::half_gain ? "}, double, esokit::HalfGainPoles>"
            : free                            ? "}, double, esokit::PoleSet>"
                                              : "}>";
    // The pole of the lag is kept.
    config = free ? poles("{-1.0 / " + source(model.lag) + ", 0.0}")
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
        config = common + ", .measurement_variance = " + source(model.noise) + " * " +
                 source(model.noise) + ", .disturbance_bounds = {{" + list(bounds) +
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
  return {type, config,
          d.settings.controller_bandwidth > 0.0
              ? ".controller_bandwidth = " + source(d.settings.controller_bandwidth)
              : ".gains = {{" + list(d.settings.gains) + "}}",
          std::string(".soften = ") + (d.settings.soften ? "true" : "false")};
}

/// All families for a model. A template, as `tune`, so that it costs compile time only where it is
/// called.
template <TuneKnowledge Parts = tune_knows_all>
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
    if (knows.sinusoid && !(model.sinusoids.front().capture_bandwidth > 0.0))
      c.observer_numbers = 2;
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
    [[maybe_unused]] constexpr int order = number();
    [[maybe_unused]] const auto known = [&](auto parts, TuneFamily family, const char* type,
                                            const char* what, const TuneKnowledge& knows) {
      constexpr ModelParts p = decltype(parts)::value;
      take(family, std::string(type) + " that knows " + what, knows, 1, 1,
           known_kind<p>(model, family));
    };
    [[maybe_unused]] const auto both = [&](auto parts, const char* what,
                                           const TuneKnowledge& knows) {
      known(parts, TuneFamily::linear, "LinearEso", what, knows);
      known(parts, TuneFamily::half_gain, "HalfGainEso", what, knows);
    };
    [[maybe_unused]] const bool lag = model.lag > 0.0, sensor = model.sensor > 0.0,
                                sinusoid = !model.sinusoids.empty();
    if constexpr (Parts.lag) {
      using L = std::integral_constant<ModelParts, ModelParts{.order = order, .actuator = 1}>;
      if (lag) {
        both(L{}, "the lag", {.lag = true});
        known(L{}, TuneFamily::free_poles, "LinearEso, free poles,", "the lag", {.lag = true});
      }
    }
    if constexpr (Parts.sensor) {
      using F = std::integral_constant<ModelParts, ModelParts{.order = order, .sensor = 1}>;
      if (sensor) both(F{}, "the sensor", {.sensor = true});
    }
    if constexpr (Parts.sinusoid) {
      using Q = std::integral_constant<ModelParts, ModelParts{.order = order, .resonators = 1}>;
      if (sinusoid) both(Q{}, "the sine", {.sinusoid = true});
    }
    if constexpr (Parts.lag && Parts.sensor) {
      using LF = std::integral_constant<ModelParts,
                                        ModelParts{.order = order, .actuator = 1, .sensor = 1}>;
      if (lag && sensor) both(LF{}, "lag and sensor", {.lag = true, .sensor = true});
    }
    if constexpr (Parts.lag && Parts.sinusoid) {
      using LQ = std::integral_constant<ModelParts,
                                        ModelParts{.order = order, .actuator = 1, .resonators = 1}>;
      if (lag && sinusoid) both(LQ{}, "lag and sine", {.lag = true, .sinusoid = true});
    }
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
/// @tparam Parts what a model may have that an observer could know: the fewer, the less is compiled
/// @return error for a model that `check` refuses or with other parts, more than one requirement,
/// or a requirement that
///         no controller can meet
template <TuneKnowledge Parts = tune_knows_all>
[[nodiscard]] Expected<Tuning, Error<double>> tune(const TuneModel& given,
                                                   const TuneWish& wish = {},
                                                   const TuneRules& rules = {}) {
  Rules<double> checks;
  checks.all_of(given.check())
      .require(Parts.lag || !(given.lag > 0.0), "lag", given.lag,
               "is not among the parts that this tune is compiled for")
      .require(Parts.sensor || !(given.sensor > 0.0), "sensor", given.sensor,
               "is not among the parts that this tune is compiled for")
      .require(Parts.sinusoid || given.sinusoids.empty(), "sinusoids",
               static_cast<double>(given.sinusoids.size()),
               "are not among the parts that this tune is compiled for")
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
               rules.gain_factor, "must be finite and 1 or more")
      .not_negative("phase_margin", rules.phase_margin)
      .require(!(rules.phase_margin >= 1.5), "phase_margin", rules.phase_margin,
               "must be below 1.5 rad")
      .not_negative("damping_latencies", rules.damping_latencies)
      .not_negative("bandwidth_ratio", rules.bandwidth_ratio)
      .not_negative("filter_floor", rules.filter_floor.value_or(0.0))
      .require(!(rules.filter_floor.value_or(0.0) > 1.0), "filter_floor",
               rules.filter_floor.value_or(0.0), "must not be above 1");
  if (!checks) return checks.error();
  const int n = given.order;
  const double T = given.sample_time;
  const double b0 = given.input_gain.value;
  Tuning tuning;
  tuning.rules = rules;
  tuning.model_disturbance = given.disturbance;
  const double latency = given.latency();
  const double fast = 0.5 / T;
  const auto rho_of = [n](double x) { return std::pow(x, -2 * n); };
  const auto slowest_of = [&](const TuneModel& of) {
    return std::min(1e-3 * of.filter_bandwidth(), 1e-2 / T);
  };
  const auto least_noise = [&](const TuneModel& of) {
    const double slow = slowest_of(of);
    const LoopNumbers numbers = LoopCost(of, rules, slow)(Lqg(of).controller(rho_of(slow)));
    return numbers.stable ? numbers.control_noise : 0.0;
  };
  tuning.least_noise = least_noise(given);
  const double wanted = wish.control_noise > 0.0
                            ? wish.control_noise
                            : usual_control_noise * (given.u_max - given.u_min);
  TuneModel model = given;
  const double floor =
      rules.filter_floor.value_or(usual_filter_floor[static_cast<std::size_t>(n - 1)]) / latency;
  if (given.filter_bandwidth() < floor) {
    // No further than half of the noise that is allowed, which leaves as much for the law.
    const auto noise_at = [&](double bandwidth) {
      model.disturbance = given.disturbance_of(bandwidth);
      return least_noise(model);
    };
    double low = given.filter_bandwidth(), high = floor;
    if (2.0 * noise_at(floor) > wanted) {
      if (2.0 * tuning.least_noise > wanted) {
        high = low;
      } else {
        for (int i = 0; i < 12; ++i) {
          const double middle = std::sqrt(low * high);
          (2.0 * noise_at(middle) > wanted ? high : low) = middle;
        }
        high = low;
      }
    }
    model.disturbance =
        high > given.filter_bandwidth() ? given.disturbance_of(high) : given.disturbance;
  }
  tuning.model = model;
  const Lqg lqg(model);
  const double slow = slowest_of(model);
  // What keeps order 2 from swinging at its limits: sqrt(2) / w is k_1 / k_0 of an LQR law, 2 / w
  // that of a given bandwidth.
  const double damped = n == 2 && rules.damping_latencies > 0.0
                            ? 1.0 / (rules.damping_latencies * latency)
                            : std::numeric_limits<double>::infinity();
  const double delay = model.lag + model.dead_time + model.sensor;
  const double settled = std::array{3.912, 5.834, 7.517}[static_cast<std::size_t>(n - 1)];
  double w = 0.0;
  if (wish.controller_bandwidth > 0.0) {
    w = wish.controller_bandwidth;
    checks
        .require(w <= fast, {"controller_bandwidth", w,
                             "must not be above half the sample rate, which is", -1, fast, true})
        .require(w * T >= 1e-6, "controller_bandwidth", w,
                 "must be at least 1e-6 of the sample rate")
        .require(w <= 2.0 * damped,
                 {"controller_bandwidth", w,
                  "is so fast for this latency that the loop would swing at its limits for ever; "
                  "must be at most",
                  -1, 2.0 * damped, true});
  } else if (wish.settling_time > 0.0) {
    // Of n equal poles w, after the time that u and y need.
    const auto shortest = [&](double x) { return delay + settled / x; };
    const double safe = std::min(fast, 2.0 * damped);
    checks
        .require(
            shortest(fast) <= wish.settling_time,
            {"settling_time", wish.settling_time,
             "is shorter than sample time and dead time allow, which is", -1, shortest(fast), true})
        .require(shortest(safe) <= wish.settling_time,
                 {"settling_time", wish.settling_time,
                  "is so short for this latency that the loop would swing at its limits for ever; "
                  "must be at least",
                  -1, shortest(safe), true})
        .require(shortest(slow) >= wish.settling_time,
                 {"settling_time", wish.settling_time,
                  "is far slower than the disturbance; must be at most", -1, shortest(slow), true});
    if (!checks) return checks.error();
    tuning.settling_time = wish.settling_time;
    w = settled / (wish.settling_time - delay);
  } else {
    checks.require(
        wanted > 1.001 * tuning.least_noise,
        {"control_noise", wanted, "is less than needed to cancel the disturbance alone, which is",
         -1, tuning.least_noise, true});
    if (!checks) return checks.error();
    const LoopCost cost(model, rules, slow);
    const auto noise = [&](double x) { return cost(lqg.controller(rho_of(x))).control_noise; };
    tuning.control_noise = wanted;
    w = detail::bandwidth_for(noise, wanted, slow, fast);
  }
  if (!checks) return checks.error();
  // Of order 3 equal poles seldom keep the rules: there the law is searched for, at its rho.
  const bool given_law = wish.controller_bandwidth > 0.0 || (wish.settling_time > 0.0 && n < 3);
  // What the lag adds to the settling time depends on the design.
  for (int corrections = 0;; ++corrections) {
    tuning.rho = rho_of(w);

    detail::TuneSearch search = detail::search_for(tuning, given_law);
    const LoopCost cost = search.coarse();
    const LoopCost fine(model, rules, search.slowest(), 50.0);
    search.cost = &cost;
    // A sine of known frequency can be cancelled at no cost, so J* is computed without it.
    TuneModel walking = model;
    walking.sinusoids.clear();
    tuning.lqg = LoopCost(walking, rules, search.slowest(), 50.0)(lqg.controller(tuning.rho));
    tuning.optimum = tuning.lqg.cost(tuning.rho, b0);
    checks.require(tuning.lqg.stable && tuning.optimum > 0.0 && is_finite(tuning.optimum),
                   "optimum", tuning.optimum,
                   "cannot be computed: the numbers of this model are too far apart");
    if (!checks) return checks.error();
    std::vector<detail::Contender> all = detail::contenders<Parts>(model, given_law);
    for (detail::Contender& c : all) {
      search.seen.clear();
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
      const double least_cost = search.seen.at(free.at).value;
      auto best = free;
      best.value = search.value(c, free.at, 40.0);
      if (best.value > free.value) {
        if (c.design.family == TuneFamily::free_poles && c.law_numbers > 0) {
          // Divided otherwise the same poles give nearly the same J and margins.
          best.value = std::numeric_limits<double>::infinity();
          for (auto& x : search.divisions(c, free.at)) {
            const double value = search.value(c, x, 40.0);
            if (value < best.value) best = {value, std::move(x)};
          }
          if (best.value < 1e3) starts.insert(starts.begin(), best.at);
        }
        if (best.value > free.value + (starts.empty() ? 2e-3 : 2e-4)) {
          best = search.least(c, true, starts);
        }
      }
      // What the coarse grid took for enough, and is not.
      if (search.lacks(c, best.at, cost) <= 0.0 && search.lacks(c, best.at, fine) > 0.0) {
        search.seen.clear();
        search.cost = &fine;
        best = search.least(c, true, {best.at});
        search.seen.clear();
        search.cost = &cost;
      }
      c.design.settings = detail::as_printed(search.settings(c, best.at));
      detail::fill_in(c, search, fine, tuning.optimum, std::exp(least_cost));
    }
    tuning.designs.clear();
    for (detail::Contender& c : all) tuning.designs.push_back(std::move(c.design));
    if (rules.play == TunePlay::all) {
      for (TunedDesign& design : tuning.designs) {
        if (design.feasible) detail::play_all(design, model);
      }
    }
    for (bool again = true; again;) {
      detail::rank(tuning.designs, n);
      TunedDesign& first = tuning.designs.front();
      again = rules.play == TunePlay::first && first.feasible && !first.played;
      if (again) detail::play_all(first, model);
    }
    const TunedDesign* chosen = tuning.chosen();
    if (!(wish.settling_time > 0.0) || chosen == nullptr || corrections == (given_law ? 4 : 2) ||
        std::abs(chosen->settling_time - wish.settling_time) <=
            std::max(0.02 * wish.settling_time, T)) {
      break;
    }
    w = std::clamp(w * chosen->settling_time / wish.settling_time, slow,
                   std::min(fast, 2.0 * damped));
  }
  for (TunedDesign& design : tuning.designs) {
    design.code = detail::controller_source(design, model).text(model);
  }
  return tuning;
}

}  // namespace esokit
