#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdio>
#include <esokit/tune/pid_baselines.hpp>
#include <esokit/tune/pid_conversion.hpp>
#include <esokit/tune/plain_pid.hpp>
#include <esokit/tune/tune.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION LinearController pid_form(const PlainPidConfig& pid) {
  const auto filter = pid.filter();
  const double memory = pid.derivative_memory(), T = pid.sample_time;
  const double rate = pid.integral * T;
  const double back = pid.tracking_time > 0.0 ? T / pid.tracking_time : 0.0;
  // The states: the integral, then yf of the last sample and what else there is of it.
  const bool slope = memory > 0.0, second = filter.a0 != 0.0;
  const int last = 1, next = 2;
  const int states = pid.derivative == 0.0 && filter.a1 == 0.0 ? 1 : slope || second ? 3 : 2;
  LinearController c(states, 1, 0, T);
  // yf and the slope over (states, y).
  std::vector<double> yf(static_cast<std::size_t>(states) + 1), d = yf;
  yf.back() = filter.g;
  if (states > 1) {
    yf[last] = -filter.a1;
    if (second) yf[next] = -filter.a0;
    const double share = (1.0 - memory) / T;
    for (std::size_t i = 0; i < yf.size(); ++i) d[i] = share * yf[i];
    d[last] -= share;
    if (slope) d[next] += memory;
  }
  const auto set = [&](DynamicMatrix<double>& of_state, DynamicMatrix<double>& of_y, int row,
                       const std::vector<double>& of, double factor) {
    for (int i = 0; i < states; ++i) of_state(row, i) += factor * of[static_cast<std::size_t>(i)];
    of_y(row, 0) += factor * of.back();
  };
  // u = K_p (b r - yf) - K_d slope + integral, this sample's part of it included
  set(c.to_u, c.y_to_u, 0, yf, -pid.proportional - rate);
  set(c.to_u, c.y_to_u, 0, d, -pid.derivative);
  c.to_u(0, 0) += 1.0;
  c.r_to_u(0, 0) = pid.proportional * pid.reference_weight + rate;
  // The integral goes on by rate (r - yf) + back (applied - u).
  set(c.a, c.from_y, 0, yf, -rate);
  c.from_r(0, 0) = rate - back * c.r_to_u(0, 0);
  c.from_u(0, 0) = back;
  c.from_y(0, 0) -= back * c.y_to_u(0, 0);
  for (int i = 0; i < states; ++i) c.a(0, i) -= back * c.to_u(0, i);
  if (states > 1) {
    set(c.a, c.from_y, last, yf, 1.0);
    c.a(last, last) -= 1.0;
  }
  if (second) {
    c.a(next, last) += 1.0;
    c.a(next, next) -= 1.0;
  } else if (slope) {
    set(c.a, c.from_y, next, d, 1.0);
    c.a(next, next) -= 1.0;
  }
  return c;
}

ESOKIT_FUNCTION PidSearch::PidSearch(const Tuning& of)
    : tuning(&of),
      search(search_for(of, false)),
      coarse(search.coarse()),
      fine(of.model, of.rules, search.slowest(), 50.0) {
  const TuneModel& model = of.model;
  gain = 1.0 / (std::abs)(model.input_gain.value);
  power = model.order;
  if (model.order == 3 && model.pole > 0.0) {
    gain *= model.pole;
    power = 2;
  }
}

ESOKIT_FUNCTION PlainPidConfig PidSearch::settings(PidKind kind,
                                                   const std::vector<double>& x) const {
  const TuneModel& model = tuning->model;
  PlainPidConfig pid;
  pid.sample_time = model.sample_time;
  pid.lower = model.u_min;
  pid.upper = model.u_max;
  pid.proportional = std::copysign(gain * std::exp(power * x[0]), model.input_gain.value);
  pid.integral = pid.proportional * std::exp(x[1]);
  if (kind == PidKind::pi) return pid;
  pid.derivative = pid.proportional * std::exp(-x[2]);
  if (kind == PidKind::derivative) {
    pid.derivative_filter = std::exp(-x[3]);
  } else {
    pid.filter_frequency = std::exp(x[3]);
    if (kind == PidKind::freely_filtered) pid.filter_damping = std::exp(x[4]);
  }
  return pid;
}

ESOKIT_FUNCTION double PidSearch::value(PidKind kind, const std::vector<double>& x,
                                        double price) const {
  const double slow = std::log(search.slowest()), fast = std::log(search.fastest());
  // A PID with a small or large part is one without this part.
  const std::array<double, 5> low{slow - 2.0, slow - 6.0, slow - 3.0, slow, std::log(0.001)};
  const std::array<double, 5> high{fast + 1.0, fast, fast + 5.0, fast + 2.0, std::log(30.0)};
  double outside = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i)
    outside += (std::max)(low[i] - x[i], 0.0) + (std::max)(x[i] - high[i], 0.0);
  if (outside > 0.0) return 1e4 * (1.0 + outside);
  const PlainPidConfig pid = settings(kind, x);
  const LoopNumbers numbers = (*cost)(closed_upon_itself(pid_form(pid)));
  const double j = numbers.cost(search.rho, tuning->model.input_gain.value);
  if (!numbers.stable || !(j > 0.0) || !is_finite(j)) return 1e4;
  const double poles = search.damped ? search.damping_of(pid_form(pid), false) : TuneSearch::any;
  return std::log(j) + price * TuneSearch::lack(search.kept(numbers, poles), 1.004);
}

ESOKIT_FUNCTION double PidSearch::lack(PidKind kind, const std::vector<double>& x) const {
  const LinearController form = pid_form(settings(kind, x));
  return TuneSearch::lack(
      search.kept((*cost)(closed_upon_itself(form)), search.damping_of(form, false)), 0.9995);
}

ESOKIT_FUNCTION std::vector<double> PidSearch::equal_to(const LinearController& c) const {
  if (c.states() != 3) return {};
  const double T = tuning->model.sample_time;
  auto poles = poles_of(c.a);
  std::sort(poles.begin(), poles.end(),
            [](const auto& a, const auto& b) { return (std::abs)(a) < (std::abs)(b); });
  // The integrator first.
  const std::complex<double> p = std::log(1.0 + poles[1]) / T, q = std::log(1.0 + poles[2]) / T;
  const double w = std::sqrt((std::abs)(p * q)), damping = -0.5 * (p + q).real() / w;
  PlainPidConfig pid;
  pid.sample_time = T;
  pid.filter_frequency = w;
  pid.filter_damping = damping;
  const auto filter = pid.filter();
  // C z (z - 1) / F = K_p z (z - 1) + K_i T z^2 + K_d / T (z - 1)^2 at three places.
  FastResponse response(closed_upon_itself(c));
  DynamicMatrix<double> left(3, 3), right(3, 1);
  const double unit = search.reference_bandwidth;
  for (int i = 0; i < 3; ++i) {
    const double s = unit * (1 << i), x = s * T, z = 1.0 + x;
    const double f = filter.g * z * z / (z * z + filter.a1 * z + filter.a0);
    right(i, 0) = -response.at(x).gain.real() / f;
    left(i, 0) = 1.0;
    left(i, 1) = z / s;
    left(i, 2) = s / z;
  }
  solve_in_place(left.view(), right.view());
  const double sign = std::copysign(1.0, tuning->model.input_gain.value);
  for (int i = 0; i < 3; ++i)
    if (!(sign * right(i, 0) > 0.0) || !(w > 0.0) || !(damping > 0.0)) return {};
  return {std::log(sign * right(0, 0) / gain) / power, std::log(right(1, 0) / right(0, 0)),
          std::log(right(0, 0) / right(2, 0)), std::log(w), std::log(damping)};
}

ESOKIT_FUNCTION std::vector<std::vector<double>> PidSearch::starts(
    PidKind kind, const std::vector<std::vector<double>>& more) const {
  std::vector<SearchPoint> all;
  const auto n = static_cast<std::size_t>(numbers(kind));
  const auto take = [&](std::vector<double> x) {
    x.resize(n);
    const double j = value(kind, x, 1.0);
    all.push_back({j, std::move(x)});
  };
  for (const auto& x : more) take(x);
  const double w0 = (std::min)(search.reference_bandwidth, search.possible_bandwidth);
  for (const double share : {0.125, 0.25, 0.5, 1.0, 2.0}) {
    for (const double of_integral : {1.5, 4.0, 12.0}) {
      for (const double of_derivative : {0.6, 1.2, 8.0}) {
        for (const double of_filter : {2.0, 8.0}) {
          const double w = share * w0;
          take({std::log(w), std::log(w / of_integral), std::log(w * of_derivative),
                std::log(w * of_filter), std::log(0.8)});
          if (kind == PidKind::pi) break;
        }
        if (kind == PidKind::pi) break;
      }
    }
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.value < b.value; });
  std::vector<std::vector<double>> best;
  for (const SearchPoint& point : all) {
    // Designs that equal each other are one start.
    const auto same = [&](const std::vector<double>& x) {
      double apart = 0.0;
      for (std::size_t i = 0; i < n; ++i) apart = (std::max)(apart, (std::abs)(x[i] - point.at[i]));
      return apart < 0.1;
    };
    if (best.size() < 2 && std::none_of(best.begin(), best.end(), same)) best.push_back(point.at);
  }
  return best;
}

ESOKIT_FUNCTION SearchPoint PidSearch::least(PidKind kind, bool rules,
                                             const std::vector<std::vector<double>>& starts) const {
  SearchPoint best;
  best.value = std::numeric_limits<double>::infinity();
  const auto n = static_cast<std::size_t>(numbers(kind));
  double price = rules ? 5.0 : 0.0;
  const auto f = [&](const std::vector<double>& x) { return value(kind, x, price); };
  const auto from = [&](const std::vector<double>& start, double step, int evaluations) {
    auto found =
        simplex_search(f, start, std::vector<double>(n, step), evaluations * static_cast<int>(n));
    if (found.value < best.value) best = std::move(found);
  };
  for (const auto& start : starts) from(start, 0.2, 40);
  for (int round = 0; round < (rules ? 4 : 1); ++round) {
    if (round > 0) price *= 4.0;
    best.value = f(best.at);
    for (int again = 0; again < 6; ++again) {
      const double before = best.value;
      from(best.at, again % 2 == 0 ? 0.2 : -0.1, 30);
      if (!(best.value < before - 2e-5)) break;
    }
  }
  return best;
}

/// The PID as C++ source.
inline std::string pid_source(const PlainPidConfig& pid) {
  std::string text =
      "auto controller = esokit::PlainPid::make({.proportional = " + source(pid.proportional) +
      ", .integral = " + source(pid.integral);
  const auto more = [&](const char* name, double value) {
    text += std::string(", ") + name + " = " + source(value);
  };
  if (pid.derivative != 0.0) more(".derivative", pid.derivative);
  if (pid.derivative_filter > 0.0) more(".derivative_filter", pid.derivative_filter);
  if (pid.filter_frequency > 0.0) {
    text += ",\n    .filter_frequency = " + source(pid.filter_frequency);
    more(".filter_damping", pid.filter_damping);
  }
  text += ",\n    .reference_weight = " + source(pid.reference_weight);
  more(".tracking_time", pid.tracking_time);
  more(".lower", pid.lower);
  more(".upper", pid.upper);
  return text + ", .sample_time = " + source(pid.sample_time) + "});\n";
}

ESOKIT_FUNCTION PlainPidConfig as_printed(PlainPidConfig pid) {
  for (double* number :
       {&pid.proportional, &pid.integral, &pid.derivative, &pid.derivative_filter,
        &pid.filter_frequency, &pid.filter_damping, &pid.reference_weight, &pid.tracking_time}) {
    *number = printed(*number);
  }
  return pid;
}

ESOKIT_FUNCTION void judge(TunedPid& baseline, const TuneSearch& search, const LoopCost& fine,
                           double optimum, double free_cost, bool chosen) {
  TunedDesign& d = baseline.design;
  const TuneModel& model = search.model;
  baseline.pid = as_printed(baseline.pid);
  const double ti = baseline.pid.integral_time(), td = baseline.pid.derivative_time();
  std::vector<double> times{baseline.pid.tracking_time};
  if (chosen) times = td > 0.0 ? std::vector{std::sqrt(ti * td), ti, td} : std::vector{ti};
  const auto formed = [&](double weight, double time) {
    baseline.pid.reference_weight = weight;
    baseline.pid.tracking_time = time > 0.0 ? (std::max)(printed(time), model.sample_time) : 0.0;
    d.controller = pid_form(baseline.pid);
  };
  formed(baseline.pid.reference_weight, times[0]);
  const LoopNumbers numbers = fine(closed_upon_itself(d.controller));
  const auto filled = [&] {
    fill_in_loop(
        d, search, numbers,
        [&](const LoopNumbers& by, double poles) { return search.kept(by, poles); }, optimum,
        free_cost);
  };
  filled();
  if (numbers.stable && chosen) {
    double soonest = std::numeric_limits<double>::infinity(), best = 1.0;
    for (const double weight : {1.0, 0.8, 0.6, 0.4, 0.2, 0.0}) {
      formed(weight, times[0]);
      filled();
      if (d.settling_time < soonest) {
        soonest = d.settling_time;
        best = weight;
      }
    }
    formed(best, times[0]);
    filled();
  }
  if ((d.feasible || (!chosen && d.constraint != "stability")) &&
      search.rules.simulate != TuneSimulation::none) {
    for (const double time : times) {
      formed(baseline.pid.reference_weight, time);
      if (!simulate_as_is(d, model) || d.recovers) break;
    }
  }
  d.code = pid_source(baseline.pid);
}

}  // namespace detail

ESOKIT_FUNCTION std::vector<TunedPid> tune_pids(const Tuning& tuning) {
  std::vector<TunedPid> baselines;
  if (tuning.designs.empty()) return baselines;
  detail::PidSearch of(tuning);
  std::vector<std::vector<double>> known;
  for (const TunedDesign& design : tuning.designs) {
    auto equal = of.equal_to(design.controller);
    if (!equal.empty()) known.push_back(std::move(equal));
  }
  // From the one with most numbers to those that are special cases of it or near to it.
  const std::pair<PidKind, const char*> kinds[] = {
      {PidKind::freely_filtered, "PID, filter of second order on y"},
      {PidKind::filtered, "PID, filter of second order on y, damping 0.707"},
      {PidKind::derivative, "PID, filtered derivative"},
      {PidKind::pi, "PI"}};
  for (const auto& [kind, name] : kinds) {
    const auto numbers = static_cast<std::size_t>(detail::PidSearch::numbers(kind));
    const auto from = of.starts(kind, known);
    const auto free = of.least(kind, false, from);
    auto best = free;
    best.value = of.value(kind, free.at, 40.0);
    if (best.value > free.value + 1e-4) {
      auto again = from;
      again.push_back(free.at);
      best = of.least(kind, true, again);
    }
    // What the coarse grid took for enough, and is not; and poles that ring.
    of.cost = &of.fine;
    of.search.damped = true;
    if (of.lack(kind, best.at) > 0.0) best = of.least(kind, true, {best.at});
    // Never worse than what is known to be one of these.
    if (kind == PidKind::freely_filtered) {
      for (const auto& x : known) {
        const bool keeps = of.lack(kind, best.at) <= 0.0;
        if (of.lack(kind, x) <= 0.0 &&
            (!keeps || of.value(kind, x, 0.0) < of.value(kind, best.at, 0.0))) {
          best.at = x;
        }
      }
    }
    of.cost = &of.coarse;
    of.search.damped = false;
    known.push_back(best.at);
    TunedPid baseline;
    baseline.kind = kind;
    baseline.pid = of.settings(kind, best.at);
    baseline.design.name = name;
    baseline.design.numbers = static_cast<int>(numbers);
    detail::judge(baseline, of.search, of.fine, tuning.optimum, std::exp(free.value), true);
    baselines.push_back(std::move(baseline));
  }
  std::stable_sort(baselines.begin(), baselines.end(), [](const TunedPid& a, const TunedPid& b) {
    const auto group = [](const TunedDesign& d) { return !d.feasible ? 2 : !d.recovers ? 1 : 0; };
    return group(a.design) != group(b.design) ? group(a.design) < group(b.design)
                                              : a.design.cost < b.design.cost;
  });
  return baselines;
}

ESOKIT_FUNCTION Expected<TunedPid, Error<double>> given_pid(const Tuning& tuning,
                                                            PlainPidConfig pid) {
  pid.lower = tuning.model.u_min;
  pid.upper = tuning.model.u_max;
  pid.sample_time = tuning.model.sample_time;
  Rules<double> rules;
  rules.all_of(pid.validate())
      .demand(!tuning.designs.empty(), "tuning.designs", 0.0, "must not be empty");
  if (!rules) return rules.error();
  TunedPid baseline;
  baseline.kind = PidKind::given;
  baseline.pid = pid;
  baseline.design.name = "the given PID";
  const auto search = detail::search_for(tuning, false);
  const LoopCost fine(tuning.model, tuning.rules, search.slowest(), 50.0);
  detail::judge(baseline, search, fine, tuning.optimum, std::numeric_limits<double>::infinity(),
                false);
  return baseline;
}

ESOKIT_FUNCTION Migration migration(const Tuning& tuning, const TunedPid& from,
                                    const TunedDesign& to) {
  Migration found;
  const TunedDesign& pid = from.design;
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return std::string(text);
  };
  // `now` after, `was` before; more is better or worse.
  const auto compare = [&](const char* what, double was, double now, bool more_is_better,
                           double unit, const char* unit_name) {
    const std::string text = std::string(what) + ": " + number(unit * now) + unit_name +
                             " instead of " + number(unit * was) + unit_name;
    const bool tie = (std::abs)(now - was) <= 0.01 * (std::max)((std::abs)(now), (std::abs)(was));
    (tie ? found.ties : (now > was) == more_is_better ? found.gains : found.losses).push_back(text);
  };
  const double range = tuning.model.u_max - tuning.model.u_min;
  if (!(pid.output_deviation > 0.0) || pid.constraint == "stability") {
    found.gains.push_back("with this model the PID is not stable");
  } else {
    compare("largest y after a load of a tenth of the range of u", 0.1 * range * pid.load_peak,
            0.1 * range * to.load_peak, false, 1.0, "");
    compare("standard deviation of y", pid.output_deviation, to.output_deviation, false, 1.0, "");
    compare("noise in u", pid.control_noise / range, to.control_noise / range, false, 100.0,
            " % of its range");
    compare("settling time of a small step", pid.settling_time, to.settling_time, false, 1.0, " s");
    compare("modulus margin", pid.modulus_margin, to.modulus_margin, true, 1.0, "");
    compare("delay margin", pid.delay_margin, to.delay_margin, true, 1e3, " ms");
    compare("factor by which b0 may be wrong", pid.gain_tolerance, to.gain_tolerance, true, 1.0,
            "");
    if (pid.simulated && to.simulated) {
      const std::string back = "it recovers from the overloads that were simulated";
      if (pid.recovers == to.recovers) {
        (pid.recovers ? found.ties : found.losses)
            .push_back(pid.recovers ? back : "both do not recover from an overload");
      } else if (to.recovers) {
        found.gains.push_back(back + "; the PID does not recover from " + pid.lost);
      } else {
        found.losses.push_back("it does not recover from " + to.lost + ", the PID does");
      }
    }
  }
  const PidGains<double> gains{.proportional = from.pid.proportional,
                               .integral = from.pid.integral,
                               .derivative = from.pid.derivative};
  const auto take = [&](const auto& equal) {
    if (equal) found.equal = *equal;
  };
  if (tuning.model.order == 1) take(adrc_from_pid<1>(gains));
  if (tuning.model.order == 2) take(adrc_from_pid<2>(gains));
  return found;
}

}  // namespace esokit
