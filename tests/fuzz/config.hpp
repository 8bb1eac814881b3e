/// @file
/// Random configs: one line for each name that a member of a config may have. A new observer or
/// controller whose members are named as the others' needs nothing here.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "fuzz/tape.hpp"

namespace fuzz {

/// What the drawn settings promise; of a plain config only.
struct Promise {
  double sample_time = 1e-2;  ///< T, s
  double slowest = 1;         ///< least omega T of what was drawn
  double waiting = 0;         ///< samples of holds and schedules
  bool certain = true;        ///< false: settings that promise no convergence
  bool stays_safe = false;
};

/// Fills a config from a tape. Sizes follow T and the order, so that most plain configs are good.
template <class S>
class Filler {
 public:
  /// @param chains lengths of the chains that the states are of, where there are several
  Filler(Tape& tape, int order, std::vector<int> chains = {})
      : tape_(tape), order_(order), chains_(std::move(chains)) {
    promise.sample_time = static_cast<double>(tape.number<S>({1e-4, 1, true}, "(time)"));
    // On a tape with bad numbers this one may be bad too, and only scales the others.
    if (!(promise.sample_time >= 1e-4 && promise.sample_time <= 1)) promise.sample_time = 1e-2;
  }

  Promise promise;

  template <class Config>
  void fill(Config& config) {
    if constexpr (requires { std::tuple_size<Config>::value; }) {
      std::apply([this](auto&... each) { (this->fill(each), ...); }, config);
    } else {
      fill_members(config);
    }
  }

 private:
  using Bandwidth = Range;

  [[nodiscard]] double time() const { return promise.sample_time; }
  /// n! / T^n: what one unit of y within a sample is, in the unit of y^(n).
  [[nodiscard]] double per_sample(int n) const {
    double unit = 1;
    for (int i = 1; i <= n; ++i) unit *= i / time();
    return unit;
  }

  /// Which derivative a state is of.
  [[nodiscard]] int row(int state) const {
    for (const int length : chains_) {
      if (state < length) return state;
      state -= length;
    }
    return state;
  }

  template <class T>
  void number(const char* name, T& member, const Range& range) {
    member = tape_.number<T>(range, name);
  }
  template <class T, std::size_t Count>
  void number(const char* name, std::array<T, Count>& members, const Range& range) {
    for (T& member : members) number(name, member, range);
  }
  template <class T>
  void number(const char* name, std::optional<T>& member, const Range& range) {
    if (!tape_.once_in(4, name)) return;
    member.emplace();
    number(name, *member, range);
  }

  template <class T>
  void bandwidth(const char* name, T& member) {
    number(name, member, Range{0.05 / time(), 3 / time(), true});
    seen(member);
  }
  template <class T>
  void seen(const T& value) {
    if constexpr (std::is_arithmetic_v<T>) {
      const double slow = static_cast<double>(value) * time();
      if (slow > 0 && slow < promise.slowest) promise.slowest = slow;
    } else if constexpr (requires { value.has_value(); }) {
      if (value) seen(*value);
    } else {
      for (const auto& each : value) seen(each);
    }
  }

  template <class T, std::size_t Count>
  void poles(const char* name, std::array<std::complex<T>, Count>& poles) {
    for (std::size_t i = 0; i < Count;) {
      const auto re = -tape_.number<T>({0.1 / time(), 2 / time(), true}, name);
      seen(T(-re));
      if (i + 1 < Count && tape_.once_in(2)) {
        const auto im = tape_.number<T>({0.0, 0.5 / time()}, name);
        poles[i++] = {re, im};
        poles[i++] = {re, -im};
      } else {
        poles[i++] = re;
      }
    }
  }
  template <class T, std::size_t Size, std::size_t Levels>
  void poles(const char* name, std::array<std::array<std::complex<T>, Size>, Levels>& levels) {
    for (auto& level : levels) poles(name, level);
  }

  /// Positive semidefinite, in `unit` of each state, if the tape is plain.
  template <class T, int Size>
  void covariance(const char* name, esokit::Matrix<T, Size, Size>& p, double power) {
    esokit::Matrix<T, Size, Size> root = esokit::Matrix<T, Size, Size>::Zero();
    for (int i = 0; i < Size; ++i) {
      for (int j = 0; j <= i; ++j) {
        const Range range = i == j ? Range{0.1, 1, true} : Range{-0.3, 0.3};
        root(i, j) =
            tape_.number<T>(range, name) * static_cast<T>(std::pow(1 / time(), power * row(i)));
      }
    }
    p = root * root.transpose();
    for (int i = 0; i < Size; ++i) {
      for (int j = 0; j < i; ++j) p(j, i) = p(i, j);
    }
    // One element alone makes it anything but a covariance.
    if (tape_.once_in(20, name)) p(0, Size - 1) = tape_.number<T>({0, 0}, name);
  }
  template <class T>
  void covariance(const char* name, std::optional<T>& p, double power) {
    if (!tape_.once_in(6, name)) return;
    p.emplace();
    covariance(name, *p, power);
  }

  template <class E>
  void choice(const char* name, E& member, int count) {
    member = static_cast<E>(tape_.choice(count, name));
  }
  /// Now and then, as it takes a promise away.
  void allowance(const char* name, bool& member) {
    member = tape_.once_in(12, name);
    if (member) promise.certain = false;
  }

  template <class Limits>
  void limits(Limits& limits) {
    if constexpr (requires { limits.size(); }) {
      for (auto& each : limits) this->limits(each);
    } else {
      const int kind = tape_.choice(4, "limits");
      if (kind == 0) return;
      const double lowest = kind == 1 ? 0.5 : -5;  // of kind 1 zero is not within
      number("lower", limits.lower, {lowest, lowest + 1});
      number("upper", limits.upper, {2, 5});
      if (kind == 3) number("rate", limits.rate, {1 / time(), 100 / time(), true});
    }
  }

  /// Of an actuator: any points, with slopes that a loop bears.
  template <class Curve>
  void curve(Curve& curve) {
    curve.points = tape_.integer(0, static_cast<int>(curve.input.size()), "curve.points");
    double u = -2, effect = -2;
    for (std::size_t i = 0; i < curve.input.size(); ++i) {
      number("curve.input", curve.input[i], {u, u + 0.2});
      number("curve.effect", curve.effect[i], {effect, effect + 0.2});
      u += 0.5;
      effect += 0.5;
    }
    number("curve.slope_below", curve.slope_below, {0.7, 1.3});
    number("curve.slope_above", curve.slope_above, {0.7, 1.3});
  }

  template <class Rule>
  void missing(Rule& rule) {
    rule.most = tape_.integer(0, 40, "missing.most");
    number("missing.input", rule.input, {1.5, 2});
    rule.stay = tape_.once_in(5, "missing.stay");
    rule.hold = (!rule.input || tape_.once_in(20, "both")) && tape_.once_in(2, "missing.hold");
    promise.stays_safe = promise.stays_safe || rule.stay;
  }

  /// (A, B, C, E) of a plant of relative degree `order_` whose states couple as those of a chain,
  /// what feeds back slower than a sample; with zeros, and d elsewhere than u.
  template <class Plant>
  void plant(Plant& plant) {
    constexpr int states = Plant::states;
    const auto T = time();
    plant.c(0) = 1;
    for (int i = 0; i < states; ++i) {
      for (int j = 0; j <= i; ++j) {
        const double slow = std::pow(0.01 / T, i - j + 1);
        number("model.plant.a", plant.a(i, j), {-slow, slow});
      }
      if (i + 1 < states) plant.a(i, i + 1) = 1;
      const double fast = std::pow(0.05 / T, i - order_ + 1);
      if (i + 1 == order_) number("model.plant.b", plant.b(i), {0.5, 2, true, true});
      if (i + 1 > order_) number("model.plant.b", plant.b(i), {-fast, fast});
      const double size = std::pow(0.05 / T, i - states + 1);
      number("model.plant.e", plant.e(i),
             i + 1 < states ? Range{-size, size} : Range{0.5, 2, true});
    }
  }

  /// The numbers of an AugmentedModel's parts.
  template <class Settings>
  void parts(Settings& model) {
    const auto T = time();
    const auto lag = [&](auto& part, const char* name) {
      if constexpr (requires { part.time_constant; }) {
        number(name, part.time_constant, {T, 50 * T, true});
      } else if constexpr (requires { part.frequency; }) {
        number(name, part.frequency, {0.02 / T, 1 / T, true});
      }
    };
    lag(model.sensor, "model.sensor");
    if constexpr (requires { model.plant.dead_time; }) {
      plant(model.plant);
    } else {
      lag(model.actuator, "model.actuator");
      for (std::size_t i = 0; i < model.plant.size(); ++i) {
        const double slow = std::pow(0.01 / T, static_cast<int>(model.plant.size() - i));
        number("model.plant", model.plant[i], {-slow, slow});
      }
    }
    for (auto& resonance : model.resonators) {
      number("model.resonators", resonance.frequency, {0.02 / T, 0.5 / T, true});
    }
    for (auto& tau : model.first_order) number("model.first_order", tau, {20 * T, 500 * T, true});
    // What is open loop, or captures by its frequency, decays by that.
    promise.slowest = std::min(promise.slowest, 0.02);
  }

  template <class Config>
  void fill_members(Config& config) {
    const auto T = time();
    const double unit = per_sample(order_);
// A name, and how its values are drawn.
#define MEMBER(name, draw)                              \
  if constexpr (requires { config.name; }) {            \
    auto& member = config.name;                         \
    constexpr const char* text = #name;                 \
    (draw);                                             \
    static_cast<void>(text), static_cast<void>(member); \
  }
    MEMBER(sample_time, number(text, member, {T, T}))
    if (!input_matrix_says_it_) {
      MEMBER(input_gain, number(text, member, {1e-2 * unit, 10 * unit, true, true}))
    }
    MEMBER(max_gap, member = tape_.integer(1, 60, text))
    // Observers.
    if constexpr (requires { config.level_bandwidths; }) {
      if (tape_.once_in(4, "by level")) {
        bandwidth("level_bandwidths", config.level_bandwidths);
      } else {
        bandwidth("observer_bandwidth", config.observer_bandwidth);
        number("bandwidth_factor", config.bandwidth_factor, {1.2, 3});
      }
    } else {
      MEMBER(observer_bandwidth, observer_bandwidth(text, member))
    }
    MEMBER(poles, poles(text, member))
    MEMBER(disturbance_bound, number(text, member, {0, 100 * unit}))
    MEMBER(unit, choice(text, member, 2))
    MEMBER(release_samples,
           promise.waiting += static_cast<double>(member = tape_.integer(0, 60, text)))
    MEMBER(leak_time, tape_.once_in(3, text)
                          ? static_cast<void>(number(text, member, {0.1 * T, 1000 * T, true}))
                          : static_cast<void>(member))
    MEMBER(level_poles, poles(text, member))
    MEMBER(bandwidth_ratio, number(text, member, {0.6, 1.4}))
    MEMBER(rule, choice(text, member, 2))
    MEMBER(allow_uncertified_switching, allowance(text, member))
    MEMBER(frequency_shift, number(text, member, {0.01 / T, 1 / T, true}))
    MEMBER(start_index, member = tape_.once_in(4, text) ? tape_.integer(0, 200, text) : 0)
    MEMBER(allow_vanishing_gain, allowance(text, member))
    MEMBER(error_scale, number(text, member, {0.1, 10, true}))
    MEMBER(shape, fill(member))
    MEMBER(gain_alpha, number(text, member, {0.5, 1}))
    MEMBER(alpha, number(text, member, {0.5, 1}))
    MEMBER(gain_beta, number(text, member, {0, 0.5}))
    MEMBER(beta, number(text, member, {0.2, 2}))
    MEMBER(exponent, number(text, member, {0.4, 1}))
    MEMBER(linear_width, number(text, member, {0.05, 1, true}))
    MEMBER(gain_min, number(text, member, {0.7, 0.9}))
    MEMBER(gain_max, number(text, member, {1, 1.2}))
    MEMBER(allow_uncertified_gain, allowance(text, member))
    MEMBER(unlimited, allowance(text, member))
    // The filters.
    MEMBER(measurement_variance, number(text, member, {1e-3, 1, true}))
    if constexpr (requires { config.disturbance_bounds; }) {
      constexpr std::size_t states = std::tuple_size_v<decltype(config.disturbance_bounds)>;
      for (std::size_t i = 0; i < states; ++i) {
        const double change = per_sample(row(static_cast<int>(i)));
        number("disturbance_bounds", config.disturbance_bounds[i], {0.05 * change, change, true});
      }
      // A filter has no bandwidth in its config; of the least bounds and the most noise it is this.
      promise.slowest = std::min(promise.slowest, 0.05);
      covariance("process_covariance", config.process_covariance, 1);
      if (config.process_covariance) config.disturbance_bounds = {};
      covariance("initial_covariance", config.initial_covariance, 1);
      choice("inflation_rule", config.inflation_rule, 3);
      if (config.inflation_rule == static_cast<decltype(config.inflation_rule)>(0)) {
        number("inflation", config.inflation, {0.01, 1, true});
      }
      choice("mode", config.mode, 3);
    }
    MEMBER(bound_factor, number(text, member, {1, 4}))
    MEMBER(trace_weights, number(text, member, {0.5, 2}))
    MEMBER(measurement_covariance, covariance(text, member, 0))
    if constexpr (requires { config.measurement_noise; }) {
      if (tape_.once_in(6, "by noise")) {
        number("measurement_noise", config.measurement_noise, {1e-3, 1e-2, true});
        number("disturbance_noise", config.disturbance_noise, {unit, 100 * unit, true});
        promise.waiting += 1000;
      }
    }
    if constexpr (requires { config.outlier_threshold; }) {
      if (tape_.once_in(4, "gated")) number("outlier_threshold", config.outlier_threshold, {7, 50});
    }
    // Adapters.
    MEMBER(delay, member = tape_.integer(0, 4, text))
    MEMBER(period, number(text, member, {6, 7}))
    if constexpr (requires { config.most_in_a_row; }) {
      if (!tape_.once_in(8, "no gate")) {
        number("threshold", config.threshold, {0.5, 5, true});
        if (tape_.once_in(2)) number("running_factor", config.running_factor, {3, 10});
      }
      config.most_in_a_row = tape_.integer(1, 20, "most_in_a_row");
    }
    if constexpr (requires { config.most_lost; }) {
      for (auto& input : config.inputs) {
        number("inputs.gain", input.gain, {-5 * unit, 5 * unit});
        if (tape_.once_in(2)) number("inputs.lag", input.lag, {0.01 * T, 50 * T, true});
        if (tape_.once_in(2)) number("inputs.dead_time", input.dead_time, {0, 2 * T});
      }
      config.most_lost = tape_.integer(0, 60, "most_lost");
      promise.slowest = std::min(promise.slowest, 0.02);  // by the lag
      promise.waiting += 64;
    }
    MEMBER(ratio, number(text, member, {2, 4}))
    if constexpr (requires { config.model.coefficient; }) {
      number("model.coefficient", config.model.coefficient, {-0.01 / T, 0.01 / T});
    }
    if constexpr (requires { config.model.resonators; }) parts(config.model);
    // Controllers. B0 says what input_gain would.
    if constexpr (requires { config.condition_limit; }) {
      input_matrix_says_it_ = true;
      config.input_matrix =
          tape_.matrix<S, std::remove_reference_t<decltype(config.input_matrix)>::rows(),
                       std::remove_reference_t<decltype(config.input_matrix)>::cols()>(signal);
      number("condition_limit", config.condition_limit, {100, 1000});
    } else if constexpr (requires { config.input_matrix; }) {
      config.input_matrix =
          tape_.matrix<S, std::remove_reference_t<decltype(config.input_matrix)>::rows(),
                       std::remove_reference_t<decltype(config.input_matrix)>::cols()>(signal);
    }
    MEMBER(observer, fill(member))
    MEMBER(observers, fill(member))
    MEMBER(controller, fill(member))
    if constexpr (requires { config.rest.error; }) {
      if (!tape_.once_in(4, "no rest")) {
        config.controller.measurement_divider = 1;
        number("rest.error", config.rest.error, {0.01, 2, true});
        if (tape_.once_in(2)) number("rest.time", config.rest.time, {0, 60 * T});
      }
    }
    MEMBER(curve, curve(member))
    if constexpr (requires { config.curve, config.observer.leak_time; }) {
      // The plant has no curve: there is something to leak, or that is beyond the bound.
      const auto& guards = config.observer;
      if (guards.leak_time > 0 || guards.disturbance_bound > 0) promise.certain = false;
    }
    MEMBER(controller_bandwidths, number(text, member, {0.01 / T, 0.2 / T, true}))
    if constexpr (requires { config.controller_bandwidth, config.gains; }) {
      if (tape_.once_in(4, "by gains")) {
        config.gains.emplace();
        for (std::size_t i = 0; i < config.gains->size(); ++i) {
          const double k = std::pow(0.1 / T, order_ - static_cast<int>(i));
          number("gains", (*config.gains)[i], {0.1 * k, k, true});
        }
      } else {
        number("controller_bandwidth", config.controller_bandwidth, {0.01 / T, 0.2 / T, true});
      }
    } else {
      MEMBER(gains, number(text, member, {0.1, 10, true}))
    }
    MEMBER(domain, choice(text, member, 2))
    MEMBER(half_gain, member = tape_.once_in(5, text))
    MEMBER(soften, tape_.once_in(3, text) ? static_cast<void>(member = tape_.once_in(2, text))
                                          : static_cast<void>(member))
    if constexpr (requires { S(config.limits[0]); }) {  // of a profile
      for (std::size_t i = 0; i < config.limits.size(); ++i) {
        const double fast = std::pow(T, -static_cast<double>(i + 1));
        number("limits", config.limits[i], {1e-3 * fast, fast, true});
      }
      MEMBER(shortest_time, number(text, member, {0, 20 * T}))
    } else {
      MEMBER(limits, limits(member))
    }
    if constexpr (requires {
                    config.pole;
                    config.bandwidth;
                  }) {
      number("pole", config.pole, {0, 0.05 / T});
      if (order_ == 2) number("lag", config.lag, {T, 20 * T, true});
      if (order_ == 2) number("dead_time", config.dead_time, {0, 3 * T});
      number("bandwidth", config.bandwidth, {0.01 / T, 1 / T, true});
    }
    if constexpr (requires { config.least_on; }) {
      number("off", config.off, {-10, 10});
      number("on", config.on, {-10, 10});
      config.window = static_cast<decltype(config.window)>(T * tape_.integer(1, 60, "window"));
      number("least_on", config.least_on, {0, 4 * T});
      number("least_off", config.least_off, {0, 4 * T});
    }
    if constexpr (requires { config.hand_over; }) {
      const bool relay = tape_.choice(2, "excitation") == 0;
      if (!relay) config.excitation = static_cast<decltype(config.excitation)>(1);
      number("input", config.input, {0, 0.5});
      number("amplitude", config.amplitude, {0.1, 1, true, true});
      if (relay) {
        number("hysteresis", config.hysteresis, {0.01, 0.5, true});
        if (order_ == 2) number("lead", config.lead, {2 * T, 50 * T, true});
      } else {
        number("half_period", config.half_period, {9 * T, 40 * T});
      }
      number("rest", config.rest, {0, 10 * T});
      number("travel", config.travel, {1, 10, true});
      if (tape_.once_in(2, "watched")) {
        number("response", config.response, {0.01, 1, true});
        number("response_time", config.response_time, {2 * T, 90 * T, true});
        if (tape_.once_in(2, "timed")) number("fastest", config.fastest, {0.01, 1 / T, true});
      }
      if (tape_.once_in(2, "limits of y")) {
        number("lowest_output", config.lowest_output, {-10, -2});
        number("highest_output", config.highest_output, {2, 10});
        if (order_ == 1 && relay && tape_.once_in(2, "approach")) {
          config.approach.emplace();
          number("approach.input", config.approach->input, {0.6, 2});
          number("approach.output", config.approach->output, {-1, 1});
        }
      }
      number("safe_input", config.safe_input, {-0.5, 0.5});
      number("time_limit", config.time_limit, {100 * T, 5000 * T, true});
      number("hand_over", config.hand_over, {0, 20 * T});
      config.cycles = tape_.integer(6, 13, "cycles");
      config.cycles -= config.cycles % 2;
      promise.certain = false;
    }
    if constexpr (requires { config.start_hold.time; }) {
      if (tape_.once_in(3, "start_hold")) {
        number("start_hold.time", config.start_hold.time, {0, 20 * T});
        number("start_hold.input", config.start_hold.input, {1.5, 2});
        promise.waiting += 20;
      }
    } else {
      MEMBER(blanking, number(text, member, {0, 20 * T}))
    }
    if constexpr (requires { config.missing.size(); }) {
      for (auto& each : config.missing) missing(each);
    } else if constexpr (requires { config.missing.most; }) {
      missing(config.missing);
    }
    if constexpr (requires { config.measurement_divider; }) {
      if (tape_.once_in(4, "divided")) {
        config.measurement_divider = tape_.integer(1, 6, "measurement_divider");
      }
    }
    MEMBER(compensation_gain, number(text, member, {0.1 / unit, 10 / unit, true, true}))
    if constexpr (!requires { config.start_hold.time; }) {
      MEMBER(start_hold, number(text, member, {0, 20 * T}))
    }
    // Laws.
    MEMBER(exponents, number(text, member, {0.3, 3}))
    MEMBER(linear_widths, number(text, member, {0.01, 1, true}))
    MEMBER(acceleration, number(text, member, {0.01 / (T * T), 1 / (T * T), true}))
    MEMBER(filter_time, number(text, member, {T, 5 * T}))
#undef MEMBER
  }

  template <class T>
  void observer_bandwidth(const char* name, T& member) {
    if constexpr (requires { member.front().real(); }) {
      poles(name, member);
    } else {
      bandwidth(name, member);
    }
  }

  Tape& tape_;
  int order_;
  std::vector<int> chains_;
  bool input_matrix_says_it_ = false;
};

}  // namespace fuzz
