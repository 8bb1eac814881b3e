// What an update costs: LinearEso over the number N = n + m of its states, CascadeEso<2, p> over
// its levels p, measured on the machine that runs this.
//
// Way: banks of 16 observers, one update of each after the other; bursts of some 20 us of all of
// them in turn, the least of many. What else the machine does can only add to that.

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <esokit/core/packed.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/report.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr int bank = 16;
constexpr int rounds = 300;

/// An observer's bursts, ns an update, of a pack of a lane.
struct Timed {
  int place;  // N or p
  std::function<double()> burst;
  double least = 1e9;
};

template <class Observer>
Timed measured(int place, const Observer& observer) {
  using S = typename Observer::scalar_type;
  return {place, [observers = std::vector<Observer>(bank, observer)]() mutable {
            using Clock = std::chrono::steady_clock;
            constexpr int turns = 400;
            S y(0.3);
            S u(0.1);
            const auto began = Clock::now();
            for (int turn = 0; turn < turns; ++turn) {
              for (auto& one : observers) (void)one.update(y, u);
              asm volatile("" : : "r"(observers.data()) : "memory");
            }
            const std::chrono::duration<double, std::nano> took = Clock::now() - began;
            return took.count() / (turns * bank * lane_count<S>);
          }};
}

template <class Observer>
Timed measured(int place, const Observer& observer, bool packed) {
  return packed ? measured(place, Packed<Observer>(observer)) : measured(place, observer);
}
template <int Order>
Timed linear(bool packed) {
  return measured(
      Order + 1,
      LinearEso<Order>::make({.observer_bandwidth = 60.0, .input_gain = 2.0, .sample_time = 1e-3})
          .value(),
      packed);
}
template <int Levels>
Timed cascade(bool packed) {
  return measured(Levels,
                  CascadeEso<2, Levels>::make({.observer_bandwidth = 60.0,
                                               .bandwidth_factor = 1.5,
                                               .input_gain = 2.0,
                                               .sample_time = 1e-3})
                      .value(),
                  packed);
}

std::vector<Timed> over_states(bool packed) {
  return {linear<1>(packed), linear<2>(packed), linear<3>(packed), linear<4>(packed),
          linear<5>(packed)};
}
std::vector<Timed> over_levels(bool packed) {
  return {cascade<1>(packed), cascade<2>(packed), cascade<3>(packed), cascade<4>(packed)};
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "choosing", "cost",
                {.paper_title = "Choosing an observer",
                 .title = "What an update costs",
                 .description = "Time of an update over the number of states and of levels, with "
                                "double and with packs of double, measured on this machine.",
                 .order = 2});
  std::vector<Timed> families[2][2] = {{over_states(false), over_states(true)},
                                       {over_levels(false), over_levels(true)}};
  for (int round = 0; round < rounds; ++round) {
    for (auto& family : families) {
      for (auto& kind : family) {
        for (auto& one : kind) one.least = std::min(one.least, one.burst());
      }
    }
  }
  const std::string pack = "a lane of " + std::to_string(default_lanes<double>);
  Figure figure("cost", {.rows = 1, .columns = 2, .panel_height = 220});
  figure.caption(
      "Time of an update in a bank of 16 observers: LinearEso over its number of states N = n + 1, "
      "CascadeEso<2, p> over its number of levels; with double, and per lane of a pack. Measured "
      "in this run.");
  std::vector<CsvRow> rows;
  for (std::size_t i = 0; i < 2; ++i) {
    auto& panel = figure.panel(0, i)
                      .x_label(i == 0 ? "states N" : "levels p")
                      .y_label("ns an update")
                      .y_range({.from = 0.0})
                      .x_tick(1)
                      .legend(Legend::top_left);
    for (std::size_t kind = 0; kind < 2; ++kind) {
      Curve curve;
      for (const auto& one : families[i][kind]) curve.add(one.place, one.least);
      const Color color = kind == 0 ? Color::blue : Color::vermillion;
      const std::string name = kind == 0 ? "double" : pack;
      panel.line(curve, {.name = name, .color = color});
      panel.points(curve.x, curve.y, {.color = color, .column = name + " points"});
    }
    for (std::size_t k = 0; k < families[i][0].size(); ++k) {
      const double alone = families[i][0][k].least;
      const double lane = families[i][1][k].least;
      rows.push_back({(i == 0 ? "LinearEso, N = " : "CascadeEso<2, p>, p = ") +
                          std::to_string(families[i][0][k].place),
                      number_text(alone, 3), number_text(lane, 3), number_text(alone / lane, 3)});
    }
  }
  report.add(figure);
  report.table("cost", "ns an update",
               {"observer", "double", pack, "lanes updated in the time of one double"}, rows);
  // Shown, not judged: they are those of the machine.
  const auto& states = families[0][0];
  const auto& levels = families[1][0];
  report.check("bank", "N = 6 over N = 2", std::nullopt,
               states.back().least / states.front().least);
  report.check("bank", "p = 4 over p = 1", std::nullopt,
               levels.back().least / levels.front().least);
  return report.finish();
}
