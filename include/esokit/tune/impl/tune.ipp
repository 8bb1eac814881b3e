#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <esokit/core/expected.hpp>
#include <esokit/tune/controller_source.hpp>
#include <esokit/tune/detail/family_search.hpp>
#include <esokit/tune/impl/families.ipp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/overload.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tune.hpp>
#include <esokit/tune/tuning.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION StepAnswer step_answer(const DynamicSystem& system, int input, double size,
                                       double final, double horizon) {
  const int n = system.a.rows();
  // The states and the constant input.
  DynamicMatrix<double> rates(n + 1, n + 1);
  add(rates, 0, 0, system.a);
  for (int i = 0; i < n; ++i) rates(i, n) = system.b(i, input) * size;
  std::vector<double> x(static_cast<std::size_t>(n) + 1), rate(x.size());
  x.back() = 1.0;
  StepAnswer answer;
  double stride = 1.0;
  for (double k = 0.0, until = 5e4; k <= horizon; k += stride) {
    if (k >= until) {
      const auto square = product(rates, rates);
      add(rates, 0, 0, rates);
      add(rates, 0, 0, square);
      stride *= 2.0;
      until *= 2.0;
    }
    double y = system.d(0, input) * size;
    for (int j = 0; j < n; ++j) y += system.c(0, j) * x[static_cast<std::size_t>(j)];
    answer.peak = (std::max)(answer.peak, (std::abs)(y));
    if ((std::abs)(y - final) > 0.02 * (std::abs)(final))
      answer.settling = (k + stride) * system.sample_time;
    std::fill(rate.begin(), rate.end(), 0.0);
    for (int j = 0; j <= n; ++j) {
      const double value = x[static_cast<std::size_t>(j)];
      for (int i = 0; i < n; ++i) rate[static_cast<std::size_t>(i)] += rates(i, j) * value;
    }
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += rate[i];
  }
  return answer;
}

ESOKIT_FUNCTION std::string in_words(const Overload& event, const TuneModel& model) {
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return std::string(text);
  };
  const std::string share = number(100.0 * event.share) + " % of half the range of u";
  const double seconds = event.latencies * model.latency();
  const std::string time = seconds < 1.0 ? number(1e3 * seconds) + " ms" : number(seconds) + " s";
  switch (event.kind) {
    case OverloadKind::load:
      return "a load of " + share + " for " + time;
    case OverloadKind::kick:
      return "a kick worth " + share + " for " + time;
    default:
      return "a step of the reference as far as " + share + " moves the chain in " + time;
  }
}

ESOKIT_FUNCTION void simulate_law(TunedDesign& d, const TuneModel& model) {
  d.recovers = true;
  d.lost.clear();
  const SofteningLaw law = d.softening_law();
  const auto variants = simulated_variants(model);
  for (std::size_t v = 0; v < variants.size(); ++v) {
    for (const Overload& event : overloads_of(variants[v].model)) {
      const OverloadOutcome outcome = simulate_overload(
          variants[v].model, variants[v].gain, d.controller, event,
          d.simulated_settling(variants[v].model), [](double, double, double, double) {}, law);
      if (outcome.back || !outcome.counts) continue;
      d.recovers = false;
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

ESOKIT_FUNCTION bool simulate_as_is(TunedDesign& d, const TuneModel& model) {
  d.simulated = true;
  if (model.may_rub() && oscillates_with_friction(model, d.controller)) {
    d.recovers = false;
    d.lost_in = friction_overloads[0];
    d.lost_on = static_cast<int>(simulated_variants(model).size()) - 1;
    d.lost = "friction on y'', however small: it acts as a damping, with which the loop oscillates";
    return false;
  }
  simulate_law(d, model);
  return true;
}

/// Simulates a design; one of order 2 softened, and as designed if it does not recover so, the
/// others the other way round. Random plants behind friction and gravity recovered from more and
/// sooner like this (examples/choosing).
inline void simulate_all(TunedDesign& d, const TuneModel& model) {
  const bool possible = d.settings.gains[0] > 0.0;
  d.settings.soften = model.order == 2 && possible;
  if (!simulate_as_is(d, model) || d.recovers || !possible) return;
  d.settings.soften = !d.settings.soften;
  simulate_law(d, model);
}

ESOKIT_FUNCTION void fill_in_loop(
    TunedDesign& d, const TuneSearch& search, LoopNumbers numbers,
    const std::function<TuneSearch::Kept(const LoopNumbers&, double)>& kept_by, double optimum,
    double free_cost) {
  const TuneModel& model = search.model;
  const auto loop = closed_loop(model, d.controller);
  const bool stable = numbers.stable && loop && loop->stable();
  if (stable) {
    exact_deviations(model, *loop, numbers);
    d.pole_damping = search.damping_of(*loop, d.knows.sinusoid);
  }
  const TuneSearch::Kept kept = kept_by(numbers, stable ? d.pole_damping : -1.0);
  d.cost = numbers.cost(search.rho, model.input_gain.value);
  d.excess = std::sqrt(d.cost / optimum);
  d.free_excess = (std::min)(std::sqrt(free_cost / optimum), d.excess);
  d.output_deviation = numbers.output;
  d.control_deviation = numbers.control;
  d.control_noise = numbers.control_noise;
  d.modulus_margin = numbers.modulus;
  d.delay_margin = numbers.delay;
  d.gain_tolerance = numbers.tolerance;
  d.phase_margin = numbers.phase;
  // Stability is decided by the poles, too.
  d.feasible = stable && search.lack(kept, 0.999) <= 0.0;
  if (!stable) {
    d.constraint = "stability";
    return;
  }
  if (d.feasible && d.cost < free_cost * 1.002) {
    d.constraint = "none";
  } else {
    const double gain = numbers.tolerant ? numbers.tolerance / search.rules.gain_factor : kept.gain;
    const std::pair<double, const char*> all[] = {{gain, "b0 wrong by a factor"},
                                                  {kept.modulus, "modulus margin"},
                                                  {kept.delay, "delay margin"},
                                                  {kept.phase, "phase margin"},
                                                  {kept.noise, "noise in u"},
                                                  {kept.poles, "damping of the poles"},
                                                  {kept.damping, "k_1 / k_0 and the latency"},
                                                  {kept.ratio, "omega_c / omega_o"}};
    d.constraint =
        std::min_element(std::begin(all), std::end(all), [](const auto& a, const auto& b) {
          return a.first < b.first;
        })->second;
  }
  const double decay = -std::log1p((std::max)(loop->stability_abscissa(), -0.9));
  const double horizon = 12.0 / decay + 10.0;
  d.settling_time = step_answer(loop->system(), 0, 1.0, 1.0, horizon).settling;
  d.load_peak =
      step_answer(loop->system(), 2, (std::abs)(model.input_gain.value), 0.0, horizon).peak;
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
  fill_in_loop(
      d, search, numbers,
      [&](const LoopNumbers& by, double poles) { return search.kept(c, d.settings, by, poles); },
      optimum, free_cost);
  const auto observer = tuned_observer(c.kind, model.sample_time, d.settings);
  d.law = {gains, observer->input_gain, observer->to_estimate, observer->y_to_estimate};
}

ESOKIT_FUNCTION void rank(std::vector<TunedDesign>& designs, int order) {
  const auto group = [&](const TunedDesign& d) {
    return !d.feasible                                     ? 3
           : !d.recovers                                   ? 2
           : order > 2 && d.simulated && d.settings.soften ? 1
                                                           : 0;
  };
  std::stable_sort(designs.begin(), designs.end(), [&](const TunedDesign& a, const TunedDesign& b) {
    return group(a) != group(b) ? group(a) < group(b) : a.cost < b.cost;
  });
  // The filter also has a covariance, in memory.
  const auto effort = [](const TunedDesign& d) {
    return 2 * d.operations + (d.family == TuneFamily::filter ? 1 : 0);
  };
  for (std::size_t i = 0; i < designs.size(); ++i) {
    std::size_t best = i;
    for (std::size_t j = i + 1; j < designs.size(); ++j) {
      const TunedDesign& a = designs[best];
      const TunedDesign& b = designs[j];
      if (group(b) != group(designs[i]) || b.cost > 1.01 * designs[i].cost) break;
      if (effort(b) < effort(a) ||
          (effort(b) == effort(a) && b.modulus_margin > a.modulus_margin)) {
        best = j;
      }
    }
    std::rotate(designs.begin() + static_cast<std::ptrdiff_t>(i),
                designs.begin() + static_cast<std::ptrdiff_t>(best),
                designs.begin() + static_cast<std::ptrdiff_t>(best) + 1);
  }
}

ESOKIT_FUNCTION std::vector<Contender> contenders(const TuneModel& model, bool law_is_given) {
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
    c.design.operations = update_operations(model.order, m, p, knows);
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
    const bool lag = model.lag > 0.0, sensor = model.sensor > 0.0,
               sinusoid = !model.sinusoids.empty();
    using Lag = std::integral_constant<ModelParts, ModelParts{.order = order, .actuator = 1}>;
    using Sensor = std::integral_constant<ModelParts, ModelParts{.order = order, .sensor = 1}>;
    using Sine = std::integral_constant<ModelParts, ModelParts{.order = order, .resonators = 1}>;
    using LagAndSensor =
        std::integral_constant<ModelParts, ModelParts{.order = order, .actuator = 1, .sensor = 1}>;
    using LagAndSine =
        std::integral_constant<ModelParts,
                               ModelParts{.order = order, .actuator = 1, .resonators = 1}>;
    if (lag) {
      both(Lag{}, "the lag", {.lag = true});
      known(Lag{}, TuneFamily::free_poles, "LinearEso, free poles,", "the lag", {.lag = true});
    }
    if (sensor) both(Sensor{}, "the sensor", {.sensor = true});
    if (sinusoid) both(Sine{}, "the sine", {.sinusoid = true});
    if (lag && sensor) both(LagAndSensor{}, "lag and sensor", {.lag = true, .sensor = true});
    if (lag && sinusoid) both(LagAndSine{}, "lag and sine", {.lag = true, .sinusoid = true});
    return 0;
  });
  return all;
}

/// The specification and the rules, each in itself.
inline Check<double> check_rules(const TuneModel& given, const TuneSpecification& specification,
                                 const TuneRules& rules) {
  Rules<double> checks;
  checks.all_of(given.validate())
      .not_negative("control_noise", specification.control_noise)
      .not_negative("settling_time", specification.settling_time)
      .not_negative("controller_bandwidth", specification.controller_bandwidth)
      .demand(!(specification.settling_time > 0.0 && specification.control_noise > 0.0),
              "settling_time", specification.settling_time,
              "must be left out if control_noise is given")
      .demand(!(specification.controller_bandwidth > 0.0 &&
                (specification.control_noise > 0.0 || specification.settling_time > 0.0)),
              "controller_bandwidth", specification.controller_bandwidth,
              "must be left out if control_noise or settling_time is given")
      .not_negative("modulus_margin", rules.modulus_margin)
      .demand(!(rules.modulus_margin >= 1.0), "modulus_margin", rules.modulus_margin,
              "must be below 1")
      .not_negative("delay_samples", rules.delay_samples)
      .demand(rules.gain_factor >= 1.0 && is_finite(rules.gain_factor), "gain_factor",
              rules.gain_factor, "must be finite and 1 or more")
      .not_negative("phase_margin", rules.phase_margin)
      .demand(!(rules.phase_margin >= 1.5), "phase_margin", rules.phase_margin,
              "must be below 1.5 rad")
      .not_negative("pole_damping", rules.pole_damping)
      .demand(!(rules.pole_damping >= 0.7), "pole_damping", rules.pole_damping, "must be below 0.7")
      .not_negative("damping_latencies", rules.damping_latencies)
      .not_negative("bandwidth_ratio", rules.bandwidth_ratio)
      .not_negative("filter_floor", rules.filter_floor.value_or(0.0))
      .demand(!(rules.filter_floor.value_or(0.0) > 1.0), "filter_floor",
              rules.filter_floor.value_or(0.0), "must not be above 1");
  return checks;
}

/// The slowest bandwidth that is searched, rad/s.
inline double slowest_of(const TuneModel& of) {
  return (std::min)(1e-3 * of.filter_bandwidth(), 1e-2 / of.sample_time);
}

/// The weight of u for which an LQR law has the bandwidth x.
inline double rho_of(double x, int order) { return std::pow(x, -2 * order); }

/// Noise in u of a loop that cancels the disturbance alone.
inline double least_noise(const TuneModel& of, const TuneRules& rules) {
  const double slow = slowest_of(of);
  const LoopNumbers numbers = LoopCost(of, rules, slow)(Lqg(of).controller(rho_of(slow, of.order)));
  return numbers.stable ? numbers.control_noise : 0.0;
}

/// The model with as much disturbance as the rules want at least: no further than half of the noise
/// that is allowed, which leaves as much for the law.
/// @param least noise of the given model @param wanted noise that is allowed
inline TuneModel with_floor(const TuneModel& given, const TuneRules& rules, double least,
                            double wanted) {
  TuneModel model = given;
  const double usual = usual_filter_floor[static_cast<std::size_t>(given.order - 1)];
  const double floor = rules.filter_floor.value_or(usual) / given.latency();
  if (!(given.filter_bandwidth() < floor)) return model;
  const auto noise_at = [&](double bandwidth) {
    model.disturbance = given.disturbance_of(bandwidth);
    return least_noise(model, rules);
  };
  double low = given.filter_bandwidth(), high = floor;
  if (2.0 * noise_at(floor) > wanted) {
    if (2.0 * least > wanted) {
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
  return model;
}

/// The bandwidths between which a law is sought, rad/s.
struct LawRange {
  double slow;
  double fast;
  double damped;  ///< what keeps order 2 from oscillating at its limits, or infinity
};

inline LawRange law_range(const TuneModel& model, const TuneRules& rules) {
  // sqrt(2) / w is k_1 / k_0 of an LQR law, 2 / w that of a given bandwidth.
  const double damped = model.order == 2 && rules.damping_latencies > 0.0
                            ? 1.0 / (rules.damping_latencies * model.latency())
                            : std::numeric_limits<double>::infinity();
  return {slowest_of(model), 0.5 / model.sample_time, damped};
}

/// The bandwidth of the law that the specification asks for, rad/s.
/// @param tuning with model, rules and least_noise; gets what was asked for
/// @param wanted noise that is allowed
inline Expected<double, Error<double>> law_bandwidth(const TuneSpecification& specification,
                                                     double wanted, const LawRange& range,
                                                     Tuning& tuning) {
  const auto& [slow, fast, damped] = range;
  const TuneModel& model = tuning.model;
  const double T = model.sample_time;
  const double delay = model.lag + model.dead_time + model.sensor;
  const double settled = std::array{3.912, 5.834, 7.517}[static_cast<std::size_t>(model.order - 1)];
  Rules<double> checks;
  double w = 0.0;
  if (specification.controller_bandwidth > 0.0) {
    w = specification.controller_bandwidth;
    checks
        .demand(at_most(w, fast),
                {"controller_bandwidth", w, "must not be above half the sample rate, which is", -1,
                 fast, true})
        .demand(at_most(1e-6, w * T), "controller_bandwidth", w,
                "must be at least 1e-6 of the sample rate")
        .demand(at_most(w, 2.0 * damped), {"controller_bandwidth", w,
                                           "is so fast for this latency that the loop "
                                           "would oscillate between its limits for ever; "
                                           "must be at most",
                                           -1, 2.0 * damped, true});
  } else if (specification.settling_time > 0.0) {
    // Of n equal poles w, after the time that u and y need.
    const auto shortest = [&](double x) { return delay + settled / x; };
    const double safe = (std::min)(fast, 2.0 * damped);
    checks
        .demand(
            at_most(shortest(fast), specification.settling_time),
            {"settling_time", specification.settling_time,
             "is shorter than sample time and dead time allow, which is", -1, shortest(fast), true})
        .demand(at_most(shortest(safe), specification.settling_time),
                {"settling_time", specification.settling_time,
                 "is so short for this latency that the loop would oscillate between its limits "
                 "for ever; "
                 "must be at least",
                 -1, shortest(safe), true})
        .demand(at_most(specification.settling_time, shortest(slow)),
                {"settling_time", specification.settling_time,
                 "is far slower than the disturbance; must be at most", -1, shortest(slow), true});
    if (!checks) return checks.error();
    tuning.settling_time = specification.settling_time;
    w = settled / (specification.settling_time - delay);
  } else {
    checks.demand(
        wanted > 1.001 * tuning.least_noise,
        {"control_noise", wanted, "is less than needed to cancel the disturbance alone, which is",
         -1, tuning.least_noise, true});
    if (!checks) return checks.error();
    const Lqg lqg(model);
    const LoopCost cost(model, tuning.rules, slow);
    const auto noise = [&](double x) {
      return cost(lqg.controller(rho_of(x, model.order))).control_noise;
    };
    tuning.control_noise = wanted;
    w = bandwidth_for(noise, wanted, slow, fast);
  }
  if (!checks) return checks.error();
  return w;
}

/// Where the search of a family with free poles begins.
inline std::vector<std::vector<double>> starts_of(const Contender& c,
                                                  const std::vector<Contender>& all,
                                                  const TuneSearch& search, double w) {
  std::vector<std::vector<double>> starts;
  if (c.design.family != TuneFamily::free_poles) return starts;
  starts.push_back(search.start(c, search.filter_bandwidth, w, true));
  // Also from the results of the families that are special cases of this one.
  for (const Contender& other : all) {
    const bool half = other.design.family == TuneFamily::half_gain;
    if (other.design.knows == c.design.knows && other.design.extension == 1 &&
        (half || other.design.family == TuneFamily::linear)) {
      const TuneSettings& found = other.design.settings;
      starts.push_back(search.start(c, found.observer_bandwidth, found.controller_bandwidth, half));
    }
  }
  return starts;
}

/// The settings of one family with the least cost within the rules.
/// @param fine the cost on a finer grid
/// @return the least cost before its damping was asked for
inline double search_family(Contender& c, const std::vector<Contender>& all, double w,
                            TuneSearch& search, const LoopCost& fine) {
  const LoopCost& cost = *search.cost;
  search.seen.clear();
  std::vector<std::vector<double>> starts = starts_of(c, all, search, w);
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
  // What the coarse grid took for enough, and is not; and poles that ring, which few have.
  if (search.lacks(c, best.at, cost, false) <= 0.0) {
    const bool too_coarse = search.lacks(c, best.at, fine, false) > 0.0;
    if (too_coarse || search.lacks(c, best.at, cost, true) > 0.0) {
      search.seen.clear();
      search.cost = too_coarse ? &fine : &cost;
      search.damped = true;
      best = search.least(c, true, {best.at});
      search.seen.clear();
      search.cost = &cost;
      search.damped = false;
    }
  }
  c.design.settings = as_printed(search.settings(c, best.at));
  return least_cost;
}

/// Simulates what the rules ask for, and ranks.
inline void simulate_and_rank(Tuning& tuning) {
  const TuneSimulation how = tuning.rules.simulate;
  if (how == TuneSimulation::all) {
    for (TunedDesign& design : tuning.designs) {
      if (design.feasible) simulate_all(design, tuning.model);
    }
  }
  for (bool again = true; again;) {
    rank(tuning.designs, tuning.model.order);
    TunedDesign& first = tuning.designs.front();
    again = how == TuneSimulation::first && first.feasible && !first.simulated;
    if (again) simulate_all(first, tuning.model);
  }
}

/// One search through all families for the law of bandwidth `w`.
/// @param given_law whether the law is that of equal poles, and not searched for
inline Check<double> search_designs(Tuning& tuning, const Lqg& lqg, double w, bool given_law) {
  const TuneModel& model = tuning.model;
  tuning.rho = rho_of(w, model.order);
  TuneSearch search = search_for(tuning, given_law);
  const LoopCost cost = search.coarse();
  const LoopCost fine(model, tuning.rules, search.slowest(), 50.0);
  search.cost = &cost;
  // A sine of known frequency can be cancelled at no cost, so J* is computed without it.
  TuneModel walking = model;
  walking.sinusoids.clear();
  tuning.lqg = LoopCost(walking, tuning.rules, search.slowest(), 50.0)(lqg.controller(tuning.rho));
  tuning.optimum = tuning.lqg.cost(tuning.rho, model.input_gain.value);
  Rules<double> checks;
  checks.demand(tuning.lqg.stable && tuning.optimum > 0.0 && is_finite(tuning.optimum), "optimum",
                tuning.optimum, "cannot be computed: the numbers of this model are too far apart");
  if (!checks) return checks;
  std::vector<Contender> all = contenders(model, given_law);
  for (Contender& c : all) {
    const double least_cost = search_family(c, all, w, search, fine);
    fill_in(c, search, fine, tuning.optimum, std::exp(least_cost));
  }
  tuning.designs.clear();
  for (Contender& c : all) tuning.designs.push_back(std::move(c.design));
  simulate_and_rank(tuning);
  return checks;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<Tuning, Error<double>> tune(const TuneModel& given,
                                                     const TuneSpecification& specification,
                                                     const TuneRules& rules) {
  if (auto ok = detail::check_rules(given, specification, rules); !ok) return ok.error();
  Tuning tuning;
  tuning.rules = rules;
  tuning.model_disturbance = given.disturbance;
  tuning.least_noise = detail::least_noise(given, rules);
  const double wanted = specification.control_noise > 0.0
                            ? specification.control_noise
                            : usual_control_noise * (given.u_max - given.u_min);
  tuning.model = detail::with_floor(given, rules, tuning.least_noise, wanted);
  const TuneModel& model = tuning.model;
  const detail::LawRange range = detail::law_range(model, rules);
  auto w = detail::law_bandwidth(specification, wanted, range, tuning);
  if (!w) return w.error();
  const Lqg lqg(model);
  const double asked = specification.settling_time;
  // Of order 3 equal poles seldom keep the rules: there the law is searched for, at its rho.
  const bool given_law =
      specification.controller_bandwidth > 0.0 || (asked > 0.0 && model.order < 3);
  // What the lag adds to the settling time depends on the design.
  for (int corrections = 0;; ++corrections) {
    if (auto ok = detail::search_designs(tuning, lqg, *w, given_law); !ok) return ok.error();
    const TunedDesign* chosen = tuning.chosen();
    if (!(asked > 0.0) || chosen == nullptr || corrections == (given_law ? 4 : 2) ||
        (std::abs)(chosen->settling_time - asked) <= (std::max)(0.02 * asked, model.sample_time)) {
      break;
    }
    *w = std::clamp(*w * chosen->settling_time / asked, range.slow,
                    (std::min)(range.fast, 2.0 * range.damped));
  }
  for (TunedDesign& design : tuning.designs) {
    design.code = detail::controller_source(design, model).text(model);
  }
  return tuning;
}

}  // namespace esokit
