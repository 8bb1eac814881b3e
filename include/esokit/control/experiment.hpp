/// @file
/// Experiment: moves the real machine with a relay or steps, within limits, and finds b0 and
/// latency; its samples are a log for `identify`.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
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

/// The result of an experiment, for y^(n) = b0 v(t - L) + d, tau v' + v = u.
template <PlainScalar S>
struct ExperimentResult {
  S input_gain{};             ///< b0, unit of y^(n) per unit of u
  S input_gain_half_width{};  ///< of the 95 % interval of b0
  S least{};                  ///< abs(b0) if all of the latency were dead time
  S largest{};                ///< abs(b0) if all of it were lag
  S latency{};                ///< lag plus dead time, s
  S pole{};                   ///< order 1: a of y' + a y, 1/s; 0 if not visible
  S friction{};               ///< order 2: Coulomb friction, unit of y^(n); 0 if not visible
  S frequency{};              ///< frequency of the cycle, rad/s
  int windows{};              ///< number of windows of two cycles, on which the interval is based
};

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
    if (count_ > 1 && phase_ == ExperimentPhase::measuring) add(y, u_applied);
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
    using E = Error<S>;
    // An abort during the hand-over does not invalidate the result.
    if (2 * windows_ < config_.cycles)
      return E{"phase", S(static_cast<int>(phase_)), "of the experiment has no result yet"};
    if (least_window_ < 48)
      return E{"cycle",
               S(least_window_) / S(2),
               "(the shortest, in samples) must be at least",
               -1,
               S(24),
               true};
    const S sign = config_.amplitude < S(0) ? S(-1) : S(1);
    const Complex one{sign * first_.mean.re, sign * first_.mean.im};
    const Complex three{sign * third_.mean.re, sign * third_.mean.im};
    const S size = magnitude(one);
    const E unusable{"input_gain", size, "is not usable"};
    if (!is_finite(size) || !is_finite(third_.square) || !(size > S(0))) return unusable;
    // Damping (order 1) and friction (order 2) turn H_1 in one direction, and H_3 less or in the
    // other.
    const Complex lost = Order == 1 ? Complex{one.im, -one.re} : rubbed_.mean;
    const Complex lost_third =
        Order == 1 ? Complex{three.im / S(3), -three.re / S(3)} : rubbed_third_.mean;
    const S most = Order == 1 ? S(1.2f) : S(0.9f) * size;
    Split at = split(one, three);
    const S simple = at.gain();
    S loss(0);
    const S scatter = student() * third_.error() / magnitude(three);
    // Only if the misfit is larger than noise alone may cause.
    if (at.misfit < S(0) && !(at.misfit > -scatter)) {
      const auto without = [&](S share) {
        return split(plus(one, lost, share), plus(three, lost_third, share));
      };
      constexpr int steps = 16;
      S below(0), above(0);
      for (int i = 1; i <= steps && !(above > S(0)); ++i) {
        const S force = most * S(i) / S(steps);
        (without(force).misfit < S(0) ? below : above) = force;
      }
      if (above > S(0)) {
        for (int i = 0; i < 30; ++i) {
          const S middle = (below + above) / S(2);
          (without(middle).misfit < S(0) ? below : above) = middle;
        }
        loss = above;
        at = without(loss);
        at.misfit = S(0);
      }
    }
    if (!(at.angle > S(0)) || at.angle > S(1.5)) {
      return E{"latency", at.angle / frequency_,
               "does not fit: friction or damping is too large for this amplitude, or the order or "
               "the sign of amplitude is wrong"};
    }
    // Relative to b0 A, or to the frequency.
    const S share = Order == 1 ? loss : S(loss / at.gain());
    if (Order == 2 && share > S(0.25))
      return E{"friction",
               share,
               "as a share of b0 A is too large: use a larger amplitude; must be at most",
               -1,
               S(0.25),
               true};
    if (Order == 1 && share > S(1))
      return E{"pole",
               share,
               "as a share of the frequency is too large: use a smaller hysteresis or half_period; "
               "must be at most",
               -1,
               S(1),
               true};
    if (detail::absolute(at.misfit) > S(0.5) && detail::absolute(at.misfit) > S(2) * scatter) {
      return E{"misfit",
               at.misfit,
               "of the third harmonic, rad, is too large: the machine has another order or more "
               "than lag and dead time, or damping or friction is too large; must be at most",
               -1,
               S(0.5),
               true};
    }
    S unsure = std::sqrt(at.misfit * at.misfit + scatter * scatter);
    // If u has no third harmonic, or noise hides it, lag and dead time are not separated.
    if (!is_finite(unsure) || unsure > S(1)) unsure = S(1);
    const S middle = at.gain();
    const S down = middle - at.gain(at.ratio * (S(1) + unsure));
    const S up = at.gain(at.ratio * (S(1) - unsure)) - middle;
    const S lag_or_dead = down > up ? down : up;
    const S repeat = student() * first_.error() * middle / size;
    // The uncertainty from this correction: a part of the change, and the effect of an error of the
    // estimated loss. Friction lowers b0 by about twice the square of its share, and was assumed to
    // act equally long in both directions.
    const S changed = detail::absolute(middle - simple);
    S rubbed;
    if constexpr (Order == 2) {
      const S off = unsure / S(4);
      rubbed = changed / S(2) + middle * (S(2) * off * (S(2) * share + off) +
                                          S(1.5) * share * detail::absolute(uneven_));
    } else {
      const S off = S(0.375f) * unsure;
      rubbed = changed / S(4) + middle * off * (share + off / S(2));
    }
    Result found;
    found.input_gain = sign * middle;
    // The error of treating the lag between samples.
    const S turn = frequency_ * config_.sample_time;
    const S sampled = middle * turn * turn / S(8);
    found.input_gain_half_width = std::sqrt(lag_or_dead * lag_or_dead + repeat * repeat +
                                            rubbed * rubbed + sampled * sampled);
    // Sums that only the interval has may have overflowed.
    if (!is_finite(found.input_gain_half_width)) return unusable;
    found.least = at.size;
    found.largest = at.size * std::sqrt(S(1) + at.longest);
    found.latency = (at.dead + at.x) / frequency_;
    (Order == 1 ? found.pole : found.friction) =
        loss * (Order == 1 ? frequency_ : detail::absolute(config_.amplitude));
    found.frequency = frequency_;
    found.windows = windows_;
    return found;
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
  struct Complex {
    S re{}, im{};
  };

  /// Running mean and scatter.
  struct Spread {
    Complex mean{};
    S square{};
    int count = 0;
    void add(Complex value) noexcept {
      ++count;
      const Complex before{value.re - mean.re, value.im - mean.im};
      mean.re += before.re / S(count);
      mean.im += before.im / S(count);
      square += before.re * (value.re - mean.re) + before.im * (value.im - mean.im);
    }
    /// Standard error of the mean.
    [[nodiscard]] S error() const noexcept {
      return std::sqrt((square > S(0) ? square : S(0)) / S(count * (count - 1)));
    }
  };

  /// Separates lag and dead time by H_1 and H_3: the squared ratio of their magnitudes is (1 + x^2)
  /// / (1 + 9 x^2), x = w tau.
  struct Split {
    S size{}, angle{}, longest{}, ratio{}, x{}, dead{}, misfit{};
    [[nodiscard]] S square_of_lag(S r) const noexcept {
      const S below = S(9) * r * r - S(1);
      const S square = below > S(0) ? (S(1) - r * r) / below : longest;
      return square < S(0) ? S(0) : square > longest ? longest : square;
    }
    [[nodiscard]] S gain(S r) const noexcept { return size * std::sqrt(S(1) + square_of_lag(r)); }
    [[nodiscard]] S gain() const noexcept { return gain(ratio); }
  };

  static Split split(const Complex& one, const Complex& three) noexcept {
    Split at;
    at.size = magnitude(one);
    at.angle = std::atan2(-one.im, one.re);
    const S tangent = at.angle > S(0) && at.angle < S(1.5) ? std::tan(at.angle) : S(0);
    at.longest = tangent * tangent;
    at.ratio = magnitude(three) / at.size;
    at.x = std::sqrt(at.square_of_lag(at.ratio));
    at.dead = at.angle - std::atan(at.x);
    const S expected = S(3) * at.dead + std::atan(S(3) * at.x);
    const S c = std::cos(expected), s = std::sin(expected);
    at.misfit = std::atan2(three.re * s + three.im * c, three.re * c - three.im * s);
    return at;
  }

  static Complex plus(const Complex& a, const Complex& b, S factor) noexcept {
    return {a.re + factor * b.re, a.im + factor * b.im};
  }

  /// Sums over two cycles.
  struct Sums {
    Complex y{}, u{};
    /// The sum of z divided by the sum of u.
    [[nodiscard]] Complex over_input(const Complex& z) const noexcept {
      const S square = u.re * u.re + u.im * u.im;
      return {(z.re * u.re + z.im * u.im) / square, (z.im * u.re - z.re * u.im) / square};
    }
    void add(S weight, S c, S s, S difference, S input) noexcept {
      y.re += weight * c * difference;
      y.im -= weight * s * difference;
      u.re += weight * c * input;
      u.im -= weight * s * input;
    }
    [[nodiscard]] Complex ratio(S power) const noexcept {
      const Complex h = over_input(y);
      return {h.re / power, h.im / power};
    }
  };

  Experiment(const Config& config, const Limiter<S>& limiter) noexcept
      : config_(config),
        limiter_(limiter),
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

  static S magnitude(const Complex& z) noexcept { return std::hypot(z.re, z.im); }

  /// Student's factor for the 95 % interval of a mean of `windows_` numbers.
  [[nodiscard]] S student() const noexcept {
    constexpr float table[] = {4.303f, 3.182f, 2.776f, 2.571f, 2.447f, 2.365f, 2.306f, 2.262f};
    return windows_ <= 10 ? static_cast<S>(table[windows_ - 3]) : static_cast<S>(2.228f);
  }

  S abort(AbortReason reason) noexcept {
    phase_ = ExperimentPhase::aborted;
    reason_ = reason;
    return put_out(config_.input);
  }

  S put_out(S wanted) noexcept { return limiter_(wanted); }

  /// Adds a sample to the window.
  void add(S y, S u_applied) noexcept {
    if (window_ == 0) return;
    const S weight = S(1) - turn_.re;
    const S c2 = turn_.re * turn_.re - turn_.im * turn_.im, s2 = S(2) * turn_.re * turn_.im;
    const S c4 = c2 * c2 - s2 * s2, s4 = S(2) * c2 * s2;
    S difference = y - y_[0];
    S input = u_applied - config_.input;
    if constexpr (Order == 2) {
      difference -= y_[0] - y_[1];
      input = (input + (u_last_ - config_.input)) / S(2);
    }
    sums_[0].add(weight, c2, s2, difference, input);
    level_ += weight * input;
    sums_[1].add(weight, c2 * c4 - s2 * s4, s2 * c4 + c2 * s4, difference, input);
    const Complex next{turn_.re * step_.re - turn_.im * step_.im,
                       turn_.re * step_.im + turn_.im * step_.re};
    // Corrects the rounding error of its length.
    const S length = S(1.5) - (next.re * next.re + next.im * next.im) / S(2);
    turn_ = {next.re * length, next.im * length};
    if (--left_ == 0) close_window();
  }

  void open_window(std::int32_t samples) noexcept {
    window_ = left_ = samples;
    const S angle = S(6.283185307179586L) / S(samples);
    step_ = {std::cos(angle), std::sin(angle)};
    turn_ = {S(1), S(0)};
    sums_[0] = sums_[1] = {};
    level_ = S(0);
    if (least_window_ == 0 || samples < least_window_) least_window_ = samples;
  }

  void close_window() noexcept {
    const S T = config_.sample_time;
    const S power = Order == 1 ? T : S(T * T);
    first_.add(sums_[0].ratio(power));
    third_.add(sums_[1].ratio(power));
    if constexpr (Order == 2) add_friction();
    ++windows_;
    const S uneven = level_ / (S(window_) * config_.amplitude);
    uneven_ += (uneven - uneven_) / static_cast<S>(windows_);
    frequency_ +=
        (S(12.566370614359172L) / (S(window_) * T) - frequency_) / static_cast<S>(windows_);
    window_ = 0;
    if (2 * windows_ >= config_.cycles) {
      phase_ = ExperimentPhase::hand_over;
      phase_start_ = count_;
    }
  }

  /// Adds the contribution to H of a friction force A with the sign of the speed. The speed is
  /// approximated by its first and third harmonic, those of the acceleration divided by j and 3 j,
  /// which give its zeros.
  void add_friction() noexcept {
    const Complex one{sums_[0].y.im, -sums_[0].y.re};
    const Complex three{sums_[1].y.im / S(3), -sums_[1].y.re / S(3)};
    S t = S(-1.5707963267948966L) - std::atan2(one.im, one.re);
    S c{}, s{}, c3{}, s3{};
    const auto turn = [&] {
      c = std::cos(t), s = std::sin(t);
      c3 = std::cos(S(3) * t), s3 = std::sin(S(3) * t);
    };
    for (int i = 0; i < 4; ++i) {
      turn();
      const S value = one.re * c - one.im * s + three.re * c3 - three.im * s3;
      const S slope = -(one.re * s + one.im * c) - S(3) * (three.re * s3 + three.im * c3);
      if (slope > S(0)) t -= value / slope;
    }
    turn();
    // Harmonic m of sgn sin(angle - t) is 4 / (pi m) sin; its sum over the window is half of that.
    const S size = S(0.6366197723675814L) * S(window_) * config_.amplitude;
    rubbed_.add(sums_[0].over_input({-size * s, -size * c}));
    rubbed_third_.add(sums_[1].over_input({-size / S(3) * s3, -size / S(3) * c3}));
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
        if (phase_ == ExperimentPhase::measuring && window_ == 0) open_window(2 * cycle);
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
  std::int32_t rest_samples_, limit_samples_, half_samples_, hand_over_samples_;
  S follow_{};
  S u_last_{};
  S rest_{};
  S lagging_{};
  S y_[2]{};
  ExperimentRow<S> last_row_{};
  Complex turn_{}, step_{};
  Sums sums_[2]{};
  Spread first_{}, third_{}, rubbed_{}, rubbed_third_{};
  S level_{}, uneven_{};
  S frequency_{};
  std::int32_t count_ = 0, switched_ = 0, up_ = 0, phase_start_ = 0;
  std::int32_t window_ = 0, left_ = 0, least_window_ = 0;
  int cycles_ = 0, windows_ = 0;
  bool side_ = true;
  ExperimentPhase phase_ = ExperimentPhase::rest;
  AbortReason reason_ = AbortReason::none;
};

}  // namespace esokit
