/// @file
/// Experiment: moves the real machine with a relay or steps, within limits, and finds b0 and
/// latency; its samples are a log for `identify`.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/control/cycle_analysis.hpp>
#include <esokit/control/experiment_config.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/expected.hpp>

namespace esokit {

/// Moves a machine around an operating point with a relay or with steps, stops by itself, and
/// computes b0 and latency. Call `update` at each sample, like a controller.
///
/// Method: over every two cycles, the complex sums of the n-th differences of y and of u. They are
/// weighted with the window w = 1 - cos(theta) (theta: 0 to 2 pi over the window) and the harmonics
/// 1 and 3 of the cycle:
///
///     H_m = sum w e^(-j m 2 theta) D^n y / (T^n sum w e^(-j m 2 theta) u),   m = 1, 3
///
/// Because w and its slope are zero at both ends and a constant d does not contribute, H is b0
/// e^(-j w L) / (1 + j w tau). Here w is the angular frequency of the harmonic; what the machine
/// does before and after does not matter. No describing function is needed. abs(H_3 / H_1)
/// separates lag from dead time, the angle of H_3 shows how wrong this model of the machine is, and
/// the scatter of the H shows the effect of noise. All three contribute to the interval. Damping a
/// y (n = 1) and Coulomb friction (n = 2) turn H_1 and H_3 by different angles; from this they are
/// estimated and corrected for, or refused if too large. Two effects are not modelled. Damping with
/// n = 2 looks like less latency. A d that rises steadily by r per second shifts H by r P / (12 A),
/// where P is the period of a cycle. `identify` can separate them from the log.
///
/// On a machine of order 2 without damping a relay does not reach a stable cycle without `lead`.
/// With it, the relay switches on y + 3 (y - f), where f is y behind a lag of a quarter of `lead`.
///
/// From cold (order 1, `approach`): after `rest` u is the approach's until y, as it rises, will
/// reach `output` within the time that its first `response` took. There the relay switches between
/// u0 and the approach's u. The mean of u over a whole cycle is the u that holds `output`, and the
/// measured cycles move u around that, with a hysteresis of at least what y moves in the latency.
///
/// Limits are those of y, of y' (`fastest`), of u and of time. Whatever happens ends within
/// `time_limit` with a `reason`, and with the safe u. Where u drives y further than the safe u does
/// (with safe u = u0 on both sides), y has to follow it by `response` in each `response_time`. So a
/// sensor that stands still is noticed within that time, in which u may move y by b0 A times it:
/// leave as much room. On a side where the safe u leads as far or further, only `time_limit` ends
/// it; during approach and centring on the side that is nearer to the safe u. No u stops a machine
/// of order 2 in its motion, nor holds one that was turned on by something else: that is for brakes
/// and end stops.
///
/// Hand-over: from phase `hand_over` on the result is ready. Make the controller and call its
/// `track(y, reference, u)` while the experiment still moves the machine. Continue with its
/// `update` from phase `done` on, before the first of them `applied(u)` with the u that the
/// experiment gave last. `examples/identify` shows this.
/// @tparam Order n, 1 or 2
template <int Order, class S = double>
requires(detail::is_a_plain_scalar<S>()) class Experiment {
  static_assert(Order == 1 || Order == 2, "esokit: an experiment is of order 1 or 2");

 public:
  static constexpr int order = Order;  ///< n
  using scalar_type = S;               ///< type of signals and settings
  using Config = ExperimentConfig<S>;  ///< settings of make
  using Result = ExperimentResult<S>;  ///< the result

  /// Checks the settings. @return the experiment before its first sample, or an error
  static Expected<Experiment, Error<S>> make(const Config& config) {
    const auto limiter = detail::checked_experiment<Order>(config);
    if (!limiter) return limiter.error();
    return Experiment(config, *limiter);
  }

  /// One sample. @param y measurement @return u to be held until the next sample
  S update(S y) noexcept { return update(y, output()); }

  /// The same if the actuator reports what it held since the last sample.
  S update(S y, S u_applied) noexcept {
    if (finished()) return put_out(end_input());
    if (!is_finite(y) || !is_finite(u_applied)) return abort(AbortReason::bad_sample);
    if (count_ > 0) last_row_ = {S(count_ - 1) * config_.sample_time, u_applied, y_[0]};
    if (count_ == 0) rest_ = y;
    const S from_rest = y - rest_;
    if (!is_finite(from_rest)) return abort(AbortReason::bad_sample);
    if (y < config_.lowest_output || y > config_.highest_output) {
      return abort(goes_wrong(from_rest) ? AbortReason::wrong_sign : AbortReason::output_limit);
    }
    const bool underway =
        phase_ == ExperimentPhase::approach || phase_ == ExperimentPhase::centring;
    if (!underway && detail::absolute(from_rest) > config_.travel) {
      return abort(goes_wrong(from_rest) ? AbortReason::wrong_sign : AbortReason::travel);
    }
    if (count_ >= limit_samples_) return abort(AbortReason::time_limit);
    ++count_;
    look_at_steps(y);
    if (too_fast(y)) {
      return abort(goes_wrong(from_rest) ? AbortReason::wrong_sign : AbortReason::too_fast);
    }
    if (const AbortReason why = watched(y); why != AbortReason::none) return abort(why);
    if (cycle_.is_open()) measure(y, u_applied);
    y_[1] = y_[0];
    y_[0] = y;
    u_last_ = u_applied;
    return put_out(next(y));
  }

  /// Ends the experiment: the safe u from now on. @return it
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
  /// True if done or aborted; u is u0 or the safe u.
  [[nodiscard]] bool finished() const noexcept {
    return phase_ == ExperimentPhase::done || phase_ == ExperimentPhase::aborted;
  }
  /// The present u.
  [[nodiscard]] S output() const noexcept { return limiter_.last(); }
  /// y0, the mean of y at rest; after an approach its `output`.
  [[nodiscard]] S rest_output() const noexcept { return rest_; }
  /// The u around which the relay or the steps move: u0; after an approach, the u that holds its
  /// `output`.
  [[nodiscard]] S centre() const noexcept { return centre_; }
  /// Fastest abs(dy/dt) of the approach, unit of y per s; 0 without.
  [[nodiscard]] S approach_slope() const noexcept { return fastest_; }
  /// s from the approach's u to a y that moves, by that slope; 0 without.
  [[nodiscard]] S approach_delay() const noexcept {
    const S delay =
        fastest_ > S(0) ? S(responded_) * config_.sample_time - config_.response / fastest_ : S(0);
    return delay > S(0) ? delay : S(0);
  }
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
        hand_over_samples_(to_samples(config.hand_over)),
        response_samples_(to_samples(config.response_time)),
        piece_samples_(samples_of_a_piece(config)),
        centre_(config.input),
        amplitude_(config.amplitude),
        hysteresis_(config.hysteresis) {
    limiter_.track(config.input);
    if (config.lead > S(0)) follow_ = -std::expm1(S(-4) * config.sample_time / config.lead);
  }

  static std::int32_t samples_of_a_piece(const Config& config) noexcept {
    if (!(config.fastest > S(0))) return 0;
    const S samples = config.response / config.fastest / config.sample_time;
    return samples < S(1 << 24) ? static_cast<std::int32_t>(samples) : 1 << 24;
  }

  [[nodiscard]] std::int32_t to_samples(S seconds) const noexcept {
    return static_cast<std::int32_t>((std::round)(seconds / config_.sample_time));
  }

  /// u after the end.
  [[nodiscard]] S end_input() const noexcept {
    return phase_ == ExperimentPhase::aborted ? config_.safe_input.value_or(config_.input)
                                              : config_.input;
  }

  S abort(AbortReason reason) noexcept {
    phase_ = ExperimentPhase::aborted;
    reason_ = reason;
    return put_out(end_input());
  }

  /// The way that u drives y: 1 or -1.
  [[nodiscard]] S way() const noexcept { return side_ ? S(1) : S(-1); }
  /// True if u has made its first move only, and y went the other way.
  [[nodiscard]] bool goes_wrong(S from_rest) const noexcept {
    return first_move_ && way() * from_rest < S(0);
  }

  /// Noise at rest, and the smallest step of y.
  void look_at_steps(S y) noexcept {
    const S step = count_ > 1 ? detail::absolute(S(y - y_[0])) : S(0);
    if (step > S(0) && (!(smallest_step_ > S(0)) || step < smallest_step_)) smallest_step_ = step;
    if (phase_ == ExperimentPhase::rest) noise_ += (step * step / S(2) - noise_) / S(count_);
  }

  /// Looks at y in pieces of the time in which it at most moves by `response`.
  [[nodiscard]] bool too_fast(S y) noexcept {
    if (!(config_.fastest > S(0))) return false;
    const bool fast = count_ > 1 && detail::absolute(S(y - piece_start_)) > config_.response;
    if (count_ == 1 || count_ - piece_since_ >= piece_samples_) {
      piece_start_ = y;
      piece_since_ = count_;
    }
    return fast;
  }

  /// u has moved: from here on y has to follow.
  void watch_from(S y) noexcept {
    watch_start_ = farthest_ = y;
    watched_since_ = count_;
    watching_ = response_samples_ > 0 && !safe_is_beyond();
  }

  /// True if the safe u leads at least as far as u does on this side: then nothing can run away.
  [[nodiscard]] bool safe_is_beyond() const noexcept {
    const S safe = config_.safe_input.value_or(config_.input);
    const S here = moved(side_), there = moved(!side_);
    const S size = detail::absolute(safe) + detail::absolute(centre_);
    if (phase_ == ExperimentPhase::approach || phase_ == ExperimentPhase::centring) {
      // A machine that returns by itself may be slow: the nearer side is not watched.
      return detail::below(detail::absolute(S(here - safe)), detail::absolute(S(there - safe)),
                           size);
    }
    return here > there ? detail::at_most(here, safe, size) : detail::at_most(safe, here, size);
  }

  /// Why y does not follow u, if it does not.
  AbortReason watched(S y) noexcept {
    if (!watching_) return AbortReason::none;
    const S back = way() * (y - watch_start_);
    if (first_move_ && !(back > -config_.response)) return AbortReason::wrong_sign;
    if (way() * (y - farthest_) < S(0)) farthest_ = y;
    if (!(way() * (y - farthest_) < config_.response)) {
      if (smallest_step_ > config_.response / S(2)) return AbortReason::resolution;
      watch_start_ = farthest_ = y;
      watched_since_ = count_;
    } else if (count_ - watched_since_ >= response_samples_) {
      return back > -config_.response ? AbortReason::no_response : AbortReason::load_changed;
    }
    return AbortReason::none;
  }

  S put_out(S wanted) noexcept { return limiter_(wanted); }

  /// Adds a sample to the window.
  void measure(S y, S u_applied) noexcept {
    S difference = y - y_[0];
    S input = u_applied - centre_;
    if constexpr (Order == 2) {
      difference -= y_[0] - y_[1];
      input = (input + (u_last_ - centre_)) / S(2);
    }
    if (cycle_.add(difference, input) && 2 * cycle_.windows() >= config_.cycles) {
      phase_ = ExperimentPhase::hand_over;
      phase_start_ = count_;
    }
  }

  /// u from this sample on.
  S next(S y) noexcept {
    using P = ExperimentPhase;
    if (phase_ == P::rest) {
      rest_ += (y - rest_) / S(count_);
      if (count_ <= rest_samples_) return config_.input;
      if (!quiet()) return abort(AbortReason::too_noisy);
      lagging_ = y - rest_;
      side_ = first_move_ = true;
      switched_ = count_ - half_samples_ / 2;
      phase_ = P::settling;
      if (config_.approach) begin_approach(y);
      watch_from(y);
      return moved(side_);
    }
    if (phase_ == P::hand_over && count_ - phase_start_ >= hand_over_samples_) {
      phase_ = P::done;
      return config_.input;
    }
    if (phase_ == P::approach && !arrives(y)) return moved(side_);
    if (phase_ == P::approach) {
      if (way() * (config_.approach->output + way() * (config_.hysteresis + coast_)) >
          way() * (side_ ? config_.highest_output : config_.lowest_output)) {
        return abort(AbortReason::output_limit);
      }
      begin_relay(y, !side_);
      return moved(side_);
    }
    if (phase_ == P::centring) add_to_mean();
    // After the approach y arrives by itself.
    const bool coasts =
        phase_ == P::centring && cycles_ < 0 && side_ != rises_ && count_ - switched_ < responded_;
    if (!coasts && switches(y - rest_)) {
      side_ = !side_;
      first_move_ = false;
      const std::int32_t cycle = count_ - up_;
      switched_ = count_;
      if (side_) {
        up_ = count_;
        ++cycles_;
        if (phase_ == P::centring && cycles_ == 2 && !centred()) {
          return abort(AbortReason::input_limit);
        }
        // The first of the settling cycles have no complete cycle before them.
        if (phase_ == P::settling && cycles_ > 2) phase_ = P::measuring;
        if (phase_ == P::measuring && !cycle_.is_open()) cycle_.open(2 * cycle);
      }
      watch_from(y);
    }
    return moved(side_);
  }

  /// True if noise at rest and resolution leave room for hysteresis and response.
  [[nodiscard]] bool quiet() const noexcept {
    if (count_ < 8) return true;
    const S noise = std::sqrt(noise_);
    return !(S(2) * noise > config_.hysteresis && config_.excitation == Excitation::relay) &&
           !(S(4) * noise > config_.response && response_samples_ > 0);
  }

  /// Towards `output`, or, if y is already beyond it, straight to the relay.
  void begin_approach(S y) noexcept {
    const ExperimentApproach<S>& approach = *config_.approach;
    rises_ = (approach.input > config_.input) == (config_.amplitude > S(0));
    phase_ = ExperimentPhase::approach;
    side_ = rises_;
    start_output_ = y;
    phase_start_ = count_;
    if (!(way() * (approach.output - y) > S(0))) begin_relay(y, !side_);
  }

  /// True if y, as it moves, reaches `output` in the time that its first response took.
  [[nodiscard]] bool arrives(S y) noexcept {
    const S moved_by = way() * (y - start_output_);
    if (responded_ == 0) {
      if (moved_by < config_.response) return false;
      responded_ = count_ - phase_start_;
      slope_ = moved_by / S(responded_);
    } else {
      slope_ += (way() * (y - y_[1]) - slope_) / S(responded_);
    }
    coast_ = slope_ > S(0) ? slope_ * S(responded_) : S(0);
    const S slope = slope_ / config_.sample_time;
    if (slope > fastest_) fastest_ = slope;
    return !(way() * (config_.approach->output - y) > coast_);
  }

  /// A relay between u0 and the approach's u, to find the u that holds `output`.
  void begin_relay(S y, bool side) noexcept {
    phase_ = ExperimentPhase::centring;
    rest_ = config_.approach->output;
    side_ = side;
    first_move_ = false;
    switched_ = count_;
    cycles_ = -1;  // y may still be on its way: the first cycle is none
    watch_from(y);
  }

  void add_to_mean() noexcept {
    if (cycles_ != 1) return;
    mean_ += (u_last_ - mean_) / S(count_ - up_);
  }

  /// The measured cycles move u around its mean. @return false if a limit is too near
  [[nodiscard]] bool centred() noexcept {
    const S below = mean_ - config_.limits.lower, above = config_.limits.upper - mean_;
    const S room = below < above ? below : above;
    const S wanted = detail::absolute(config_.amplitude);
    if (!(room >= wanted / S(10))) return false;
    centre_ = mean_;
    if (room < wanted) amplitude_ = config_.amplitude > S(0) ? room : S(-room);
    cycle_ = detail::CycleAnalysis<Order, S>(config_.sample_time, amplitude_);
    // A smaller move of u takes longer.
    const S longer = (config_.approach->input - mean_) / amplitude_;
    const S samples = S(response_samples_) * detail::absolute(longer);
    response_samples_ =
        samples < S(limit_samples_) ? static_cast<std::int32_t>(samples) : limit_samples_;
    if (response_samples_ < 1) response_samples_ = 1;
    // Below what y moves within the latency, lag and dead time would not be distinguished.
    const S least = slope_ * (approach_delay() / config_.sample_time) / detail::absolute(longer);
    const S up = config_.highest_output - rest_, down = rest_ - config_.lowest_output;
    const bool fits = S(2) * least < up && S(2) * least < down && S(2) * least < config_.travel;
    if (least > hysteresis_ && fits) hysteresis_ = least;
    cycles_ = 0;
    phase_ = ExperimentPhase::settling;
    return true;
  }

  [[nodiscard]] bool switches(S deviation) noexcept {
    if (config_.excitation == Excitation::steps) return count_ - switched_ >= half_samples_;
    S seen = deviation;
    if constexpr (Order == 2) {
      lagging_ += follow_ * (deviation - lagging_);
      seen += S(3) * (deviation - lagging_);
    }
    // With amplitude < 0 each side of u moves y the other way; `side_` already includes this.
    return side_ ? seen > hysteresis_ : seen < -hysteresis_;
  }

  /// u of a side.
  [[nodiscard]] S moved(bool side) const noexcept {
    if (phase_ == ExperimentPhase::approach || phase_ == ExperimentPhase::centring) {
      return side == rises_ ? config_.approach->input : config_.input;
    }
    return side ? centre_ + amplitude_ : centre_ - amplitude_;
  }

  Config config_;
  Limiter<S> limiter_;
  detail::CycleAnalysis<Order, S> cycle_;
  std::int32_t rest_samples_, limit_samples_, half_samples_, hand_over_samples_, response_samples_;
  std::int32_t piece_samples_;
  S centre_, amplitude_, hysteresis_;
  S smallest_step_{}, noise_{};
  S watch_start_{}, farthest_{}, piece_start_{};
  S start_output_{}, slope_{}, fastest_{}, coast_{}, mean_{};
  std::int32_t watched_since_ = 0, responded_ = 0, piece_since_ = 0;
  bool watching_ = false, first_move_ = false, rises_ = true;
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
