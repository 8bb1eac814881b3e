/// @file
/// Experiment: moves the real machine with a relay or steps, within limits, and finds b0 and
/// latency; its samples are a log for `identify`.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <esokit/control/cycle_analysis.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>

namespace esokit {

/// How u moves the machine.
enum class Excitation : unsigned char {
  relay,  ///< u0 + A until y has risen by the hysteresis, u0 - A until it has fallen by it, and so
          ///< on
  steps   ///< u0 + A and u0 - A alternately for `half_period` each, the first one half as long
};

/// Config of Experiment.
template <PlainScalar S = double>
struct ExperimentConfig {
  S sample_time{};                            ///< T, s
  Excitation excitation = Excitation::relay;  ///< relay: needs no knowledge of the machine
  S input{};        ///< u0, unit of u: holds the machine at its start position
  S amplitude{};    ///< A, unit of u; negative if a larger u lowers y
  S hysteresis{};   ///< relay: unit of y, a few times the noise; leave out with steps
  S lead{};         ///< relay, order 2: s, about five times lag plus dead time; else leave out
  S half_period{};  ///< steps: s, at least 8 samples; leave out with a relay
  S rest{};         ///< s, time with u0 at the start, in which y0 is measured; 0: y0 is the first y
  S travel{};       ///< largest abs(y - y0), unit of y; beyond it the experiment stops
  S time_limit{};   ///< longest total duration, s
  S hand_over{};    ///< s: relay or steps continue for this time after the last measured cycle
  int cycles = 8;   ///< number of measured cycles, after two to settle; even, 6 .. 200
  Limits<S> limits{};  ///< of the actuator; u0 - A and u0 + A must be within

  /// @cond
  static constexpr auto fields(auto& c) noexcept {
    return detail::tie(c.sample_time, c.excitation, c.input, c.amplitude, c.hysteresis, c.lead,
                       c.half_period, c.rest, c.travel, c.time_limit, c.hand_over, c.cycles,
                       c.limits);
  }
  /// @endcond
};

/// The phase of an experiment.
enum class ExperimentPhase : unsigned char {
  rest,       ///< u0; y0 is measured
  settling,   ///< the first two cycles
  measuring,  ///< the cycles from which the result is computed
  hand_over,  ///< the result is ready; u continues, so that the controller's observer can converge
  done,       ///< u0
  aborted     ///< u0; see `reason`
};

/// Has text.
template <>
inline constexpr bool has_text<ExperimentPhase> = true;

/// Writes the name of the phase.
template <class Stream, std::same_as<ExperimentPhase> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value phase) {
  constexpr const char* names[] = {"rest", "settling", "measuring", "hand_over", "done", "aborted"};
  out << names[static_cast<int>(phase)];
  return out;
}

/// Why an experiment was aborted.
enum class AbortReason : unsigned char {
  none,        ///< not aborted
  travel,      ///< y moved further than `travel`
  time_limit,  ///< it took too long: the relay does not switch, or switches slowly
  bad_sample,  ///< y or the reported u was not finite
  stopped      ///< by `stop`
};

/// Has text.
template <>
inline constexpr bool has_text<AbortReason> = true;

/// Writes the reason.
template <class Stream, std::same_as<AbortReason> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value reason) {
  constexpr const char* names[] = {"none", "travel", "time_limit", "bad_sample", "stopped"};
  out << names[static_cast<int>(reason)];
  return out;
}

/// A row of the log: y, and the u that was held from there to the next row.
template <PlainScalar S>
struct ExperimentRow {
  S time{};  ///< s since the first sample
  S u{};     ///< held from here on
  S y{};     ///< measured
};

/// Moves a machine around an operating point with a relay or with steps, stops by itself, and
/// computes b0 and latency. Call `update` at each sample, like a controller.
///
/// Method: over every two cycles, the complex sums of the n-th differences of y and of u, weighted
/// with the window w = 1 - cos(theta) (theta: 0 to 2 pi over the window) and the harmonics 1 and 3
/// of the cycle:
///
///     H_m = sum w e^(-j m 2 theta) D^n y / (T^n sum w e^(-j m 2 theta) u),   m = 1, 3
///
/// Because w and its slope are zero at both ends and a constant d does not contribute, H is b0
/// e^(-j w L) / (1 + j w tau) at the angular frequency w of the harmonic, whatever the machine does
/// before and after; no describing function is needed. abs(H_3 / H_1) separates lag from dead time,
/// the angle of H_3 shows how wrong this model of the machine is, and the scatter of the H shows
/// the effect of noise. All three contribute to the interval. Damping a y (n = 1) and Coulomb
/// friction (n = 2) turn H_1 and H_3 by different angles; from this they are estimated and
/// corrected for, or refused if too large. Two effects are not modelled: damping with n = 2, which
/// looks like less latency, and a d that rises steadily by r per second, which shifts H by r P /
/// (12 A), where P is the period of a cycle. `identify` can separate them from the log.
///
/// On a machine of order 2 without damping a relay does not reach a stable cycle without `lead`.
/// With it, the relay switches on y + 3 (y - f), where f is y behind a lag of a quarter of `lead`.
///
/// Hand-over: from phase `hand_over` on the result is ready. Make the controller, call its
/// `track(y, reference, u)` while the experiment still moves the machine, and continue with its
/// `update` from phase `done` on. `examples/identify` shows this.
/// @tparam Order n, 1 or 2
template <int Order, PlainScalar S = double>
class Experiment {
  static_assert(Order == 1 || Order == 2, "esokit: an experiment is of order 1 or 2");

 public:
  static constexpr int order = Order;  ///< n
  using scalar_type = S;               ///< type of signals and settings
  using Config = ExperimentConfig<S>;  ///< settings of make
  using Result = ExperimentResult<S>;  ///< the result
  template <class T>
  using with_scalar = Experiment<Order, T>;  ///< the same with another scalar

  /// Checks the settings. @return the experiment before its first sample, or an error
  static Expected<Experiment, Error<S>> make(const Config& config) {
    const bool relay = config.excitation == Excitation::relay;
    const S T = config.sample_time;
    const int cycles = config.cycles;
    Rules<S> rules;
    rules.positive("sample_time", T)
        .finite("input", config.input)
        .nonzero("amplitude", config.amplitude)
        .not_negative("rest", config.rest)
        .positive("travel", config.travel)
        .positive("time_limit", config.time_limit)
        .not_negative("hand_over", config.hand_over)
        .require(6 <= cycles && cycles <= 200 && cycles % 2 == 0, "cycles", static_cast<S>(cycles),
                 "must be even, 6 .. 200");
    if (relay) {
      rules.positive("hysteresis", config.hysteresis)
          .require(
              !(config.hysteresis >= config.travel),
              {"hysteresis", config.hysteresis, "must be below travel", -1, config.travel, true})
          .left_out("half_period", config.half_period, "must be left out with a relay");
    } else {
      rules.left_out("hysteresis", config.hysteresis, "must be left out with steps")
          .positive("half_period", config.half_period);
    }
    if (relay && Order == 2) {
      rules.positive("lead", config.lead);
    } else {
      rules.left_out("lead", config.lead, "must be left out: it is for a relay of order 2");
    }
    if (!rules) return rules.error();
    const auto limiter = Limiter<S>::make(config.limits, T);
    if (!limiter) return limiter.error();
    const S high = config.input + detail::absolute(config.amplitude);
    const S low = config.input - detail::absolute(config.amplitude);
    const S samples = config.time_limit / T;
    rules
        .require(is_finite(high) && !(high > config.limits.upper),
                 {"amplitude", config.amplitude, "with input goes above limits.upper, which is", -1,
                  config.limits.upper, true})
        .require(is_finite(low) && !(low < config.limits.lower),
                 {"amplitude", config.amplitude, "with input goes below limits.lower, which is", -1,
                  config.limits.lower, true})
        .require(is_finite(samples) && samples < S(1 << 24), "time_limit", config.time_limit,
                 "must be below 2^24 samples")
        .require(config.rest < config.time_limit,
                 {"rest", config.rest, "must be below time_limit", -1, config.time_limit, true})
        .require(config.hand_over < config.time_limit,
                 {"hand_over", config.hand_over, "must be below time_limit", -1, config.time_limit,
                  true});
    if (!rules) return rules.error();
    if (!relay) {
      rules
          .require(config.half_period < config.time_limit,
                   {"half_period", config.half_period, "must be below time_limit", -1,
                    config.time_limit, true})
          .require((std::round)(config.half_period / T) >= S(8), "half_period", config.half_period,
                   "must be at least 8 samples");
    }
    const S power = Order == 1 ? T : S(T * T);
    rules.representable("sample_time", T, power, "has a power that the scalar cannot hold");
    if (!rules) return rules.error();
    return Experiment(config, *limiter);
  }

  /// One sample. @param y measurement @return u to be held until the next sample
  S update(S y) noexcept { return update(y, output()); }

  /// The same if the actuator reports what it held since the last sample.
  S update(S y, S u_applied) noexcept {
    if (is_finite(u_applied)) limiter_.track(u_applied);
    if (finished()) return put_out(config_.input);
    if (!is_finite(y) || !is_finite(u_applied)) return abort(AbortReason::bad_sample);
    if (count_ > 0) last_row_ = {S(count_ - 1) * config_.sample_time, u_applied, y_[0]};
    const S from_rest = y - rest_;
    if (count_ == 0) {
      rest_ = y;
    } else if (!is_finite(from_rest) || detail::absolute(from_rest) > config_.travel) {
      return abort(is_finite(from_rest) ? AbortReason::travel : AbortReason::bad_sample);
    }
    if (count_ >= limit_samples_) return abort(AbortReason::time_limit);
    ++count_;
    if (cycle_.is_open()) measure(y, u_applied);
    y_[1] = y_[0];
    y_[0] = y;
    u_last_ = u_applied;
    return put_out(next(y));
  }

  /// Ends the experiment: u0 from now on. @return u0
  S stop() noexcept { return finished() ? output() : abort(AbortReason::stopped); }

  /// b0 and latency, from phase `hand_over` on. @return the result, or an error that names the
  /// quantity that is missing or out of range
  [[nodiscard]] Expected<Result, Error<S>> result() const noexcept {
    // An abort during the hand-over does not invalidate the result.
    if (2 * cycle_.windows() < config_.cycles) {
      return Error<S>{"phase", S(static_cast<int>(phase_)), "of the experiment has no result yet"};
    }
    return cycle_.result();
  }

  /// The present phase.
  [[nodiscard]] ExperimentPhase phase() const noexcept { return phase_; }
  /// Why the experiment was aborted.
  [[nodiscard]] AbortReason reason() const noexcept { return reason_; }
  /// True if done or aborted; u is u0.
  [[nodiscard]] bool finished() const noexcept {
    return phase_ == ExperimentPhase::done || phase_ == ExperimentPhase::aborted;
  }
  /// The present u.
  [[nodiscard]] S output() const noexcept { return limiter_.last(); }
  /// y0, the mean of y at rest.
  [[nodiscard]] S rest_output() const noexcept { return rest_; }
  /// T, s.
  [[nodiscard]] S sample_time() const noexcept { return config_.sample_time; }
  /// Samples so far.
  [[nodiscard]] std::int32_t samples() const noexcept { return count_; }
  /// The row of the previous sample, with the u that was applied since; valid from the second
  /// sample on. The collected rows are a log for `identify`.
  [[nodiscard]] const ExperimentRow<S>& row() const noexcept { return last_row_; }

 private:
  friend struct detail::LaneAccess;
  Experiment(const Config& config, const Limiter<S>& limiter) noexcept
      : config_(config),
        limiter_(limiter),
        cycle_(config.sample_time, config.amplitude),
        rest_samples_(to_samples(config.rest)),
        limit_samples_(to_samples(config.time_limit)),
        half_samples_(to_samples(config.half_period)),
        hand_over_samples_(to_samples(config.hand_over)) {
    limiter_.track(config.input);
    if (config.lead > S(0)) follow_ = -std::expm1(S(-4) * config.sample_time / config.lead);
  }

  [[nodiscard]] std::int32_t to_samples(S seconds) const noexcept {
    return static_cast<std::int32_t>((std::round)(seconds / config_.sample_time));
  }

  S abort(AbortReason reason) noexcept {
    phase_ = ExperimentPhase::aborted;
    reason_ = reason;
    return put_out(config_.input);
  }

  S put_out(S wanted) noexcept { return limiter_(wanted); }

  /// Adds a sample to the window.
  void measure(S y, S u_applied) noexcept {
    S difference = y - y_[0];
    S input = u_applied - config_.input;
    if constexpr (Order == 2) {
      difference -= y_[0] - y_[1];
      input = (input + (u_last_ - config_.input)) / S(2);
    }
    if (cycle_.add(difference, input) && 2 * cycle_.windows() >= config_.cycles) {
      phase_ = ExperimentPhase::hand_over;
      phase_start_ = count_;
    }
  }

  /// u from this sample on.
  S next(S y) noexcept {
    if (phase_ == ExperimentPhase::rest) {
      rest_ += (y - rest_) / S(count_);
      if (count_ <= rest_samples_) return config_.input;
      phase_ = ExperimentPhase::settling;
      lagging_ = y - rest_;
      side_ = true;
      switched_ = count_ - half_samples_ / 2;
      return moved();
    }
    if (phase_ == ExperimentPhase::hand_over && count_ - phase_start_ >= hand_over_samples_) {
      phase_ = ExperimentPhase::done;
      return config_.input;
    }
    if (switches(y - rest_)) {
      side_ = !side_;
      const bool up = side_;
      const std::int32_t cycle = count_ - up_;
      switched_ = count_;
      if (up) {
        up_ = count_;
        ++cycles_;
        // The first of the settling cycles have no complete cycle before them.
        if (phase_ == ExperimentPhase::settling && cycles_ > 2) phase_ = ExperimentPhase::measuring;
        if (phase_ == ExperimentPhase::measuring && !cycle_.is_open()) cycle_.open(2 * cycle);
      }
    }
    return moved();
  }

  [[nodiscard]] bool switches(S deviation) noexcept {
    if (config_.excitation == Excitation::steps) return count_ - switched_ >= half_samples_;
    S seen = deviation;
    if constexpr (Order == 2) {
      lagging_ += follow_ * (deviation - lagging_);
      seen += S(3) * (deviation - lagging_);
    }
    // With amplitude < 0 each side of u moves y the other way; `side_` already includes this.
    return side_ ? seen > config_.hysteresis : seen < -config_.hysteresis;
  }

  [[nodiscard]] S moved() const noexcept {
    return side_ ? config_.input + config_.amplitude : config_.input - config_.amplitude;
  }

  Config config_;
  Limiter<S> limiter_;
  detail::CycleAnalysis<Order, S> cycle_;
  std::int32_t rest_samples_, limit_samples_, half_samples_, hand_over_samples_;
  S follow_{};
  S u_last_{};
  S rest_{};
  S lagging_{};
  S y_[2]{};
  ExperimentRow<S> last_row_{};
  std::int32_t count_ = 0, switched_ = 0, up_ = 0, phase_start_ = 0;
  int cycles_ = 0;
  bool side_ = true;
  ExperimentPhase phase_ = ExperimentPhase::rest;
  AbortReason reason_ = AbortReason::none;
};

}  // namespace esokit
