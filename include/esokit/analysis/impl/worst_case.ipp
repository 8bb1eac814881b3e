#pragma once

#include <algorithm>
#include <cstddef>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/worst_case.hpp>
#include <limits>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION Check<double> judge(const LoopResult& loop, Badness& worst) {
  if (!loop) return loop.error();
  const double abscissa = loop->stability_abscissa();
  worst = {abscissa, 0.0, -1.0, 1.0, 0.0, 0.0};
  if (!loop->stable()) return {};
  constexpr double none = -std::numeric_limits<double>::infinity();
  worst = {abscissa, none, none, 0.0, none, none};
  const auto take = [&](std::size_t i, double value) { worst[i] = (std::max)(worst[i], value); };
  for (int channel = 0; channel < loop->channels(); ++channel) {
    const auto m = margins(*loop, channel);
    if (!m) return m.error();
    const auto delay = delay_margin(*loop, channel);
    if (!delay) return delay.error();
    take(1, -m->modulus.value);
    take(2, -m->gain_increase.value);
    take(3, m->gain_decrease.value);
    take(4, -m->phase.value);
    take(5, -delay->value);
  }
  return {};
}

ESOKIT_FUNCTION Check<double> find_worst(const PlantStudy& plants,
                                         const std::vector<Interval<>>& ranges, int points,
                                         int halvings, Found& found) {
  const std::size_t count = ranges.size();
  const auto offer = [&](const std::vector<double>& at) -> Check<double> {
    Badness bad{};
    if (auto ok = plants.look(plants.study, at, bad); !ok) return ok;
    for (std::size_t i = 0; i < bad.size(); ++i) {
      if (!found.at[i].empty() && bad[i] <= found.value[i]) continue;
      found.value[i] = bad[i];
      found.at[i] = at;
    }
    return {};
  };
  std::vector<int> index(count);
  for (bool more = true; more;) {
    std::vector<double> at(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double share = static_cast<double>(index[i]) / (points - 1);
      at[i] = ranges[i].lower + share * (ranges[i].upper - ranges[i].lower);
    }
    if (auto ok = offer(at); !ok) return ok;
    more = false;
    for (std::size_t i = 0; i < count && !more; ++i) {
      more = ++index[i] < points;
      if (!more) index[i] = 0;
    }
  }
  for (std::size_t kind = 0; kind < found.at.size(); ++kind) {
    double share = 0.5 / (points - 1);
    for (int step = 0; step < halvings; ++step) {
      const double before = found.value[kind];
      for (std::size_t i = 0; i < count; ++i) {
        for (const double sign : {-1.0, 1.0}) {
          std::vector<double> at = found.at[kind];
          at[i] = std::clamp(at[i] + sign * share * (ranges[i].upper - ranges[i].lower),
                             ranges[i].lower, ranges[i].upper);
          if (auto ok = offer(at); !ok) return ok;
        }
      }
      if (!(found.value[kind] > before)) share *= 0.5;
    }
  }
  return {};
}

}  // namespace detail
}  // namespace esokit
