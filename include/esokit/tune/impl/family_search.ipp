#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/tune/controller_source.hpp>
#include <esokit/tune/detail/family_search.hpp>
#include <esokit/tune/detail/search.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tuning.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION double TuneSearch::fastest() const {
  return (std::min)(8.0 * (std::max)(reference_bandwidth, filter_bandwidth),
                    3.0 / model.sample_time);
}

ESOKIT_FUNCTION TuneSettings TuneSearch::settings(const Contender& c,
                                                  const std::vector<double>& x) const {
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

ESOKIT_FUNCTION std::vector<double> TuneSearch::lqr(int n, double weight) const {
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

ESOKIT_FUNCTION LoopCost TuneSearch::coarse() const {
  TuneRules strict = rules;
  strict.gain_factor *= 1.01;
  return {model, strict, slowest(), 14.0};
}

ESOKIT_FUNCTION double TuneSearch::damping_of(const LinearController& controller,
                                              bool knows_sinusoid) const {
  const auto loop = closed_loop(model, controller);
  return loop ? damping_of(*loop, knows_sinusoid) : -1.0;
}

ESOKIT_FUNCTION TuneSearch::Kept TuneSearch::kept(const LoopNumbers& numbers, double poles) const {
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

ESOKIT_FUNCTION TuneSearch::Kept TuneSearch::kept(const Contender& c, const TuneSettings& s,
                                                  const LoopNumbers& numbers, double poles) const {
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

ESOKIT_FUNCTION double TuneSearch::lack(const Kept& kept, double more) {
  double sum = (std::max)(1.0 - kept.gain, 0.0);
  for (const double share :
       {kept.modulus, kept.delay, kept.phase, kept.noise, kept.poles, kept.damping, kept.ratio}) {
    sum += (std::max)(1.0 - share / more, 0.0);
  }
  return sum;
}

ESOKIT_FUNCTION double TuneSearch::value(const Contender& c, const std::vector<double>& x,
                                         double price) const {
  double outside = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    outside += (std::max)(low(c, i) - x[i], 0.0) + (std::max)(x[i] - high(c, i), 0.0);
  }
  if (outside > 0.0) return 1e4 * (1.0 + outside);
  // The search with rules returns to the points of that without.
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
    // Behind limits a slow law recovers more often, except of one integrator.
    const auto& k = chosen.gains;
    const double poles = damped ? damping_of(*controller, c.design.knows.sinusoid) : any;
    found = {std::log(j), lack(kept(c, chosen, numbers, poles), 1.004),
             model.order == 1 ? std::log(k[0]) / static_cast<double>(k.size()) : 0.0};
  }
  return found.value + price * found.lack - worth_of_speed * found.speed;
}

ESOKIT_FUNCTION bool TuneSearch::runs_away(const LinearController& controller) {
  const auto poles = poles_of(controller.a);
  return std::any_of(poles.begin(), poles.end(),
                     [](const auto& pole) { return (std::abs)(1.0 + pole) > 1.0 + 1e-7; });
}

ESOKIT_FUNCTION double TuneSearch::lacks(const Contender& c, const std::vector<double>& x,
                                         const LoopCost& by, bool whole) const {
  const TuneSettings chosen = settings(c, x);
  const auto controller = tuned_controller(c.kind, model.sample_time, chosen);
  if (!controller) return 1e5;
  const double poles = whole ? damping_of(*controller, c.design.knows.sinusoid) : any;
  return lack(kept(c, chosen, by(*controller), poles), 0.9995);
}

ESOKIT_FUNCTION bool TuneSearch::damping(const Contender& c, std::size_t index) const {
  if (c.design.family != TuneFamily::free_poles) return false;
  const int i = static_cast<int>(index);
  const int count = i < c.observer_numbers ? c.kind.placed : c.kind.order;
  const int place = i < c.observer_numbers ? i : i - c.observer_numbers;
  return (place - count % 2) % 2 != 0 && place >= count % 2;
}

ESOKIT_FUNCTION double TuneSearch::low(const Contender& c, std::size_t i) const {
  return std::log(damping(c, i)   ? 0.001
                  : factor(c, i)  ? 0.1
                  : capture(c, i) ? 0.003 * model.sinusoids.front().frequency
                                  : slowest());
}

ESOKIT_FUNCTION double TuneSearch::high(const Contender& c, std::size_t i) const {
  return std::log(damping(c, i)   ? 4.0
                  : factor(c, i)  ? 8.0
                  : capture(c, i) ? 3.0 * model.sinusoids.front().frequency
                                  : fastest());
}

ESOKIT_FUNCTION std::vector<double> TuneSearch::start(const Contender& c, double o, double l,
                                                      bool half) const {
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

ESOKIT_FUNCTION std::vector<std::vector<double>> TuneSearch::divisions(
    const Contender& c, const std::vector<double>& x) const {
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

ESOKIT_FUNCTION SearchPoint TuneSearch::least(
    const Contender& c, bool margins, const std::vector<std::vector<double>>& starts) const {
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
        step[i] = (again % 2 == 0 ? 0.1 : -0.05) * (rising ? 2.0 : 1.0) * (other_way ? -1.0 : 1.0);
      }
      from_here(best.at, 30);
      in_vain = best.value < before - (rising ? 2e-5 : 2e-4) ? 0 : in_vain + 1;
    }
    if (!rising) break;
  }
  return best;
}

ESOKIT_FUNCTION TuneSearch search_for(const Tuning& tuning, bool given_law) {
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
