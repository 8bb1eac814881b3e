/// @file
/// The search of one family for the settings with the least cost within the rules.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/tune/controller_source.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/problem.hpp>
#include <esokit/tune/search.hpp>
#include <esokit/tune/tuning.hpp>
#include <limits>
#include <map>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

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
  bool damped = false;  ///< whether each evaluation looks at the poles of the loop

  /// Of a point that was evaluated: log J, what its rules lack, and log omega_c.
  struct Seen {
    double value = 0.0, lack = 0.0, speed = 0.0;
  };
  mutable std::map<std::vector<double>, Seen> seen{};  ///< of one contender

  /// J says nothing of the reference, and is often the same for a slow law and a fast observer: a
  /// law ten times as fast is worth 0.7 % of J.
  static constexpr double worth_of_speed = 0.003;

  [[nodiscard]] double slowest() const {
    return 0.05 * (std::min)({reference_bandwidth, filter_bandwidth, 0.3 * possible_bandwidth});
  }
  [[nodiscard]] double fastest() const {
    return (std::min)(8.0 * (std::max)(reference_bandwidth, filter_bandwidth),
                      3.0 / model.sample_time);
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
    double modulus, delay, gain, phase, noise, poles, damping, ratio;
  };
  [[nodiscard]] static double over(double has, double required) {
    return required > 0.0 ? has / required : std::numeric_limits<double>::infinity();
  }
  static constexpr double any = std::numeric_limits<double>::infinity();

  /// The damping of the poles of a loop, see TuneRules::pole_damping; negative if it is not stable.
  [[nodiscard]] double damping_of(const Loop& loop, bool knows_sinusoid) const {
    return pole_damping(loop, knows_sinusoid ? model.sinusoids.front().frequency : 0.0);
  }
  [[nodiscard]] double damping_of(const LinearController& controller, bool knows_sinusoid) const {
    const auto loop = closed_loop(model, controller);
    return loop ? damping_of(*loop, knows_sinusoid) : -1.0;
  }

  /// Those that any controller has to keep. @param poles damping of the poles, if it is known
  [[nodiscard]] Kept kept(const LoopNumbers& numbers, double poles = any) const {
    return {over(numbers.modulus, rules.modulus_margin),
            over(numbers.delay, rules.delay_samples * model.sample_time),
            numbers.tolerant ? (std::max)(numbers.tolerance / rules.gain_factor, 1.0)
                             : (std::min)(numbers.tolerance / rules.gain_factor, 0.98),
            over(numbers.phase, rules.phase_margin),
            most_noise > 0.0 ? most_noise / numbers.control_noise : any,
            over(poles, rules.pole_damping),
            any,
            any};
  }
  [[nodiscard]] Kept kept(const Contender& c, const TuneSettings& s, const LoopNumbers& numbers,
                          double poles = any) const {
    const int n = model.order;
    Kept all = kept(numbers, poles);
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
    double sum = (std::max)(1.0 - kept.gain, 0.0);
    for (const double share :
         {kept.modulus, kept.delay, kept.phase, kept.noise, kept.poles, kept.damping, kept.ratio}) {
      sum += (std::max)(1.0 - share / more, 0.0);
    }
    return sum;
  }

  /// log J plus a penalty on broken rules.
  [[nodiscard]] double value(const Contender& c, const std::vector<double>& x, double price) const {
    double outside = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      outside += (std::max)(low(c, i) - x[i], 0.0) + (std::max)(x[i] - high(c, i), 0.0);
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
      const double poles = damped ? damping_of(*controller, c.design.knows.sinusoid) : any;
      found = {std::log(j), lack(kept(c, chosen, numbers, poles), 1.004),
               model.order == 1 ? std::log(k[0]) / static_cast<double>(k.size()) : 0.0};
    }
    return found.value + price * found.lack - worth_of_speed * found.speed;
  }

  /// Whether a controller is not stable by itself, which poles of little damping can make of it;
  /// its integrator may stand.
  [[nodiscard]] static bool runs_away(const LinearController& controller) {
    const auto poles = poles_of(controller.a);
    return std::any_of(poles.begin(), poles.end(),
                       [](const auto& pole) { return (std::abs)(1.0 + pole) > 1.0 + 1e-7; });
  }

  /// What a point lacks of the rules, by this cost. @param whole with the poles of the loop
  [[nodiscard]] double lacks(const Contender& c, const std::vector<double>& x, const LoopCost& by,
                             bool whole) const {
    const TuneSettings chosen = settings(c, x);
    const auto controller = tuned_controller(c.kind, model.sample_time, chosen);
    if (!controller) return 1e5;
    const double poles = whole ? damping_of(*controller, c.design.knows.sinusoid) : any;
    return lack(kept(c, chosen, by(*controller), poles), 0.9995);
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
        value = (std::max)(value, -std::log(model.lag));
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
          found.push_back(std::log((std::abs)(pole)));
          found.push_back(std::log(-pole.real() / (std::abs)(pole)));
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

}  // namespace detail
}  // namespace esokit
