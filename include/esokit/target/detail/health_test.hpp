/// @file
/// The self-test of a monitor's C: synthetic samples, and what the monitor finds of them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/control/health.hpp>
#include <esokit/observer/concepts.hpp>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Samples of a monitor in a row, each by its number i and by way, which is 1 for `half` of them,
/// then -1 for as many. That of the disturbance is late, as an estimate is.
template <class S>
struct WatchedRow {
  S applied{};  ///< its mean,
  S moves{};    ///< and what way adds
  S disturbance{};
  S beyond{};      ///< u that was asked, beyond what was held
  S oscillates{};  ///< the same, by way
  S slope{};       ///< of the estimate and the measurement, each i
  S innovation{};
  S status{};
  S missed{};
  S stops{};  ///< 1: the law does not determine u
  S half{};
  S times{};

  [[nodiscard]] S way(int i) const { return (i / static_cast<int>(half)) % 2 == 0 ? S(1) : S(-1); }
};

/// What a HealthMonitor looks at, in place of a controller.
template <class S, class Controller>
class WatchedSample {
 public:
  class Observer {
   public:
    using Model =
        std::remove_cvref_t<decltype(std::declval<const Controller&>().observer().model())>;
    static constexpr int size =
        std::remove_cvref_t<decltype(std::declval<const Controller&>().observer())>::size;
    static constexpr ObserverTraits traits{};
    [[nodiscard]] const Model& model() const { return of_->observer().model(); }
    [[nodiscard]] S input_gain() const { return of_->observer().input_gain(); }
    [[nodiscard]] S innovation() const { return innovation_; }
    [[nodiscard]] S applied_input() const { return applied_; }
    [[nodiscard]] S total_disturbance() const { return disturbance_; }
    [[nodiscard]] int missed() const { return missed_; }
    template <int row>
    [[nodiscard]] S estimate() const {
      static_assert(row == 0);
      return place_;
    }

   private:
    friend WatchedSample;
    const Controller* of_{};
    S innovation_{}, applied_{}, disturbance_{}, place_{};
    int missed_{};
  };

  /// @param i number of the sample in its row @param late samples, less than two halves
  WatchedSample(const Controller& of, const WatchedRow<S>& row, int i, int late)
      : limiter_(of.limiter()) {
    const S way = row.way(i);
    observer_.of_ = &of;
    observer_.innovation_ = row.innovation;
    observer_.applied_ = S(row.applied + S(row.moves * way));
    observer_.disturbance_ =
        S(row.disturbance * row.way(i + 2 * static_cast<int>(row.half) - late));
    observer_.place_ = S(row.slope * static_cast<S>(i));
    observer_.missed_ = static_cast<int>(row.missed);
    status_ = static_cast<StepStatus>(static_cast<unsigned>(row.status));
    stops_ = row.stops > S(0);
    asked_ = S(limiter_.last() + S(row.beyond + S(row.oscillates * way)));
  }
  [[nodiscard]] const Observer& observer() const { return observer_; }
  [[nodiscard]] LoopMode mode() const { return stops_ ? LoopMode::safe : LoopMode::running; }
  [[nodiscard]] StepStatus status() const { return status_; }
  [[nodiscard]] S requested() const { return asked_; }
  [[nodiscard]] const auto& limiter() const { return limiter_; }

 private:
  Observer observer_;
  std::remove_cvref_t<decltype(std::declval<const Controller&>().limiter())> limiter_;
  StepStatus status_{};
  bool stops_ = false;
  S asked_{};
};

/// The rows: each fault, and what takes it back. @param range of u @param middle of u @param half
/// samples in which the filters of the monitor settle @param memory samples
template <class S>
std::vector<WatchedRow<S>> watched_rows(S range, S middle, S gain, S half, S memory, S divider) {
  constexpr S largest = (std::numeric_limits<S>::max)();
  const S few = S(8) * half;
  const S full = S(range * gain);
  const auto moved = [&](S share, S ratio) {
    return WatchedRow<S>{.applied = middle,
                         .moves = S(share * range),
                         .disturbance = S(S(ratio - S(1)) * S(share * full)),
                         .slope = S(1),
                         .half = half,
                         .times = few};
  };
  const auto changed = [](WatchedRow<S> row, const auto& change) {
    change(row);
    return row;
  };
  const auto remembered = [&](WatchedRow<S>& row) { row.times = memory; };
  // What no u and no plant cause: it clears the sums.
  const auto absurd = changed(moved(S(0.5), S(1)), [&](auto& row) { row.moves = largest; });
  const auto surely = [&](WatchedRow<S>& row) { row.times = S(4) * few; };
  const auto at_ends = [&](WatchedRow<S>& row) {
    row.half = S(2) * few;
    row.times = S(8) * few;
  };
  return {
      moved(S(0.5), S(1)),
      absurd,
      moved(S(0.5), S(4)),
      absurd,
      moved(S(0.5), S(0.0625)),
      absurd,
      // A wrong sign by small moves, by large ones, and near the ends of u.
      changed(moved(S(0.125), S(-1)), surely),
      absurd,
      // Until u moves y the right way.
      moved(S(0.5), S(1)),
      absurd,
      changed(moved(S(0.5), S(-1)), surely),
      absurd,
      moved(S(0.5), S(1)),
      absurd,
      changed(moved(S(1.125), S(-1)), at_ends),
      absurd,
      moved(S(0.5), S(1)),
      absurd,
      changed(moved(S(1.125), S(0.8125)), at_ends),
      changed(moved(S(1.125), S(-0.25)), at_ends),
      absurd,
      changed(moved(S(0.5), S(1)), remembered),
      absurd,
      changed(moved(S(0.5), S(2)), [&](auto& row) { row.oscillates = range; }),
      changed(moved(S(0.5), S(2)),
              [&](auto& row) {
                row.oscillates = range;
                row.times = memory;
              }),
      absurd,
      changed(moved(S(0.5), S(1)), remembered),
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.status = S(1);
                row.times = S(memory / S(2));
              }),
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.status = S(8);
                row.missed = divider;
              }),
      changed(moved(S(0.5), S(1)), [&](auto& row) { row.stops = S(1); }),
      // A sensor that stands still, then u at its limits while y moves there, back, or not.
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.slope = S(0);
                row.times = S(6) * memory;
              }),
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.beyond = range;
                row.times = memory;
              }),
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.beyond = -range;
                row.times = S(2) * memory;
              }),
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.beyond = range;
                row.slope = S(0);
                row.times = S(2) * memory;
              }),
      changed(moved(S(0.5), S(1)), remembered),
      changed(moved(S(0.5), S(1)),
              [&](auto& row) {
                row.innovation = full;
                row.times = memory;
              }),
      changed(moved(S(0.5), S(1)), [&](auto& row) { row.innovation = largest; }),
      changed(moved(S(0.5), S(1)), [&](auto& row) { row.disturbance = largest; }),
  };
}

/// Samples in which the filters of a monitor settle, or a bound that is never reached in a row.
template <class S>
int bounded_samples(S samples) {
  return static_cast<int>((std::min)(samples, S(1000000)));
}

/// The rows with what is found after each: the fault, and numbers of Health.
/// @param range, middle of u @param step of the filters, per measurement @param memory samples
/// @param late samples by which the disturbance is
template <class S, class Monitor, class Controller>
std::vector<std::vector<S>> watched_self_test(Monitor monitor, const Controller& controller,
                                              S range, S middle, S step, S memory, int divider,
                                              int late, int most) {
  const S half =
      static_cast<S>(bounded_samples(S(std::ceil(S(S(4) / step)) * static_cast<S>(divider))));
  const auto rows =
      watched_rows<S>(range, middle, S(controller.observer().input_gain()), half,
                      (std::min)(std::ceil(memory), S(20000)), static_cast<S>(divider));
  std::vector<std::vector<S>> found;
  monitor.clear();
  for (const WatchedRow<S>& row : rows) {
    if (static_cast<int>(found.size()) >= most) break;
    const int times = static_cast<int>((std::min)(row.times, S(200000)));
    for (int i = 0; i < times; ++i) {
      const WatchedSample<S, Controller> sample(controller, row, i, late);
      monitor.look(sample, sample.observer().template estimate<0>());
    }
    const Health<S>& h = monitor.health();
    found.push_back({row.applied,
                     row.moves,
                     row.disturbance,
                     row.beyond,
                     row.oscillates,
                     row.slope,
                     row.innovation,
                     row.status,
                     row.missed,
                     row.stops,
                     row.half,
                     static_cast<S>(times),
                     static_cast<S>(static_cast<unsigned>(diagnose(h))),
                     h.gain_ratio,
                     h.sign_ratio,
                     h.response,
                     h.evidence,
                     h.opposed,
                     h.steady,
                     h.standing,
                     h.saturated,
                     h.side,
                     h.underway,
                     h.lost,
                     h.innovation});
  }
  return found;
}

}  // namespace esokit::detail
