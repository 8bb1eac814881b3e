/// @file
/// WrappedOutput: an observer for an angle whose measurement jumps by a period at each turn.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <limits>
#include <type_traits>

namespace esokit {

/// Config of WrappedOutput.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct WrappedOutputConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<WrappedOutputConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};                         ///< config of the observer
  S period{};  ///< period of y in its unit: 2 pi, 360
};

/// Counts the turns, so that a measurement in any branch (0 .. 2 pi, -180 .. 180) can be used
/// directly. z_1 is kept within half a period of zero, so that float keeps its resolution after
/// many turns.
///
/// Turns are counted from one measurement to the next, not from the prediction. So the observer
/// sees an angle without jumps: every omega_o T is allowed, and the true angle is the only
/// equilibrium. (If the innovation is taken modulo one period, as is often done, every y' + k
/// period / T is an equilibrium. After one bad sample an axis at rest may be estimated as spinning
/// forever.)
///
/// Requirements on y, including its noise:
/// - y moves by less than half a period between consecutive measurements (D samples apart if only
///   every D-th sample has one);
/// - this motion differs by less than a quarter of a period from the average of the last eight;
///   during a gap the average is assumed to continue.
///
/// A measurement that violates the second requirement is placed in the turn nearest to the
/// prediction and reported as `turn_assumed`, so that an outlier does not change the turn. After
/// three in a row, turns are counted again. Once y meets the requirements, turns are correct from
/// the 30th measurement on, whatever happened before, and the observer converges as without turns.
///
/// If a good y cannot correct the state, or the number of turns is too large for the scalar, the
/// observer restarts from y and reports `restarted`.
///
/// With an outlier gate inside, a rejected measurement counts as missing. Exception: if the last
/// eight measurements, and all since the gate last accepted one, meet the second requirement, the
/// estimate is wrong, and the turns are counted from the rejected measurements.
///
/// An axis that turns by more than half a period a sample cannot be distinguished from a slower
/// one: the actuator must not be able to drive it so fast.
template <class Observer>
requires(detail::shifts_output<Observer>()) class WrappedOutput
    : public NamedAdapter<WrappedOutput<Observer>, Observer, WrappedOutputConfig<Observer>> {
  using Base = NamedAdapter<WrappedOutput, Observer, WrappedOutputConfig<Observer>>;
  friend Base;
  using Base::observer_;
  using S = typename Observer::scalar_type;

 public:
  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.wraps_output = true;
    return traits;
  }();

  /// One sample, see PredictorCorrector::update. @param y in any branch; rejected if it is so large
  /// that its rounding is an eighth of a period
  StepStatus update(S y, S u_applied) noexcept {
    if (const Reading reading = take(y, this->missed() + 1); reading.counted) [[likely]] {
      return keep(reading, observer_.update(reading.y + reading.turns * period_, u_applied));
    }
    const StepStatus predicted = predict(u_applied);
    return predicted | correct(y);
  }

  /// Time update only, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    const StepStatus status = observer_.predict(u_applied);
    recentre();
    return status;
  }

  /// Measurement update only. @param y in any branch
  StepStatus correct(S y) noexcept {
    Reading reading = take(y, this->missed());
    if (!reading.usable) return StepStatus::measurement_rejected;
    if (reading.fits && !is_finite(reading.turns * period_)) [[unlikely]] {
      // The prediction is off by more turns than the scalar can hold: the turn taken from it would
      // leave an innovation of zero, and the estimate would not recover.
      return restart(reading);
    }
    if (!reading.counted) {
      reading.turns = (std::round)((predicted() - reading.y) * inverse_period_);
    }
    return keep(reading, observer_.correct(reading.y + reading.turns * period_));
  }

  /// Restarts at (y, 0, .., 0), with y wrapped to the period around zero. A y that `update` would
  /// reject changes nothing and is reported.
  StepStatus reset(S y) noexcept {
    if (!can_be_told(y)) return StepStatus::state_rejected;
    return begin(observer_.reset(wrap(y)));
  }

  /// Restarts at a given estimate, N x 1.
  StepStatus reset(const typename Observer::Estimate& state) noexcept {
    if (!can_be_told(state(0))) return StepStatus::state_rejected;
    typename Observer::Estimate wrapped = state;
    wrapped(0) = wrap(state(0));
    return begin(observer_.reset(wrapped));
  }

  /// Deleted, because the turns would no longer be those of y.
  StepStatus shift_output(const S&) noexcept = delete;

  /// `angle` minus the nearest multiple of the period, in -period/2 .. period/2.
  [[nodiscard]] S wrap(const S& angle) const noexcept {
    if (detail::absolute(angle) <= half_period()) return angle;
    return angle - period_ * (std::round)(angle * inverse_period_);
  }

  /// The period of y, in its unit.
  [[nodiscard]] const S& period() const noexcept { return period_; }

 private:
  friend struct detail::RecordAccess;
  /// The state of the count of turns.
  struct Count {
    S y{};       ///< last measurement used, wrapped
    S turns{};   ///< whole number; z_1 of the observer belongs at y + turns periods
    S motion{};  ///< average motion of y within `samples`; at most half a period
    std::uint16_t samples = none;  ///< 65535: motion is unknown
    std::uint8_t gaps = 0;         ///< consecutive measurements that came after more than `samples`
    std::uint8_t doubts = 0;       ///< consecutive measurements with turn_assumed, at most 3
    bool begun = false;            ///< true if there is a last measurement
  };

  /// A second count over all measurements, including those that a gate rejects. The gate decides by
  /// the estimate, so turns counted between accepted measurements only could stay wrong forever.
  struct Seen {
    Count count{};
    std::uint16_t at = 0;       ///< missed() at the last measurement
    std::uint8_t steady = 0;    ///< consecutive measurements that moved as before, at most 255
    std::uint8_t rejected = 0;  ///< measurements since the gate last accepted one, at most 255
  };

  /// The prediction of the measurement that the correction will use: that of level 1, as a sensor
  /// shows it.
  [[nodiscard]] S predicted() const noexcept {
    if constexpr (observer_traits<Observer>.measures_first_row) {
      return observer_.level_estimate(0)(0);
    } else {
      return observer_.predicted_measurement();
    }
  }

  /// The interpretation of a measurement.
  struct Reading {
    S y{};                 ///< wrapped
    S turns{};             ///< its turn, if counted
    S step{};              ///< motion since the last measurement, by the nearest turn
    int samples = 0;       ///< samples since then
    int missed = 0;        ///< samples since a measurement was accepted
    bool usable = false;   ///< small enough to determine its turn
    bool fits = true;      ///< it moved as expected
    bool counted = false;  ///< false: the turn follows from the prediction
    bool seen = false;     ///< its turn is counted from rejected measurements
  };

  static constexpr std::uint16_t none = 65535;
  static constexpr std::uint8_t most_doubts = 3;
  static constexpr std::uint8_t most_gaps = 8;
  static constexpr std::uint8_t enough_steady = 8;
  static constexpr bool gated = observer_traits<Observer>.rejects_outliers;

  WrappedOutput(const Observer& observer, const WrappedOutputConfig<Observer>& config) noexcept
      : Base(observer), period_(config.period), inverse_period_(S(1) / config.period) {}

  static Check<S> validate(const WrappedOutputConfig<Observer>& config) {
    return Rules<S>{}.positive("period", config.period).invertible("period", config.period);
  }

  /// With another period the count of turns starts again.
  void take(const WrappedOutput& fresh) noexcept {
    if (!(fresh.period_ < period_ || fresh.period_ > period_)) return;
    period_ = fresh.period_;
    inverse_period_ = fresh.inverse_period_;
    forget();
    recentre();
  }

  [[nodiscard]] S half_period() const noexcept { return period_ * static_cast<S>(0.5); }

  /// True if the rounding of y is less than an eighth of a period.
  [[nodiscard]] bool can_be_told(const S& y) const noexcept {
    constexpr S most_turns = S(1) / (S(8) * detail::rounding<S>());
    const S turns = y * inverse_period_;
    return is_finite(turns) && detail::absolute(turns) < most_turns;
  }

  /// Interprets a measurement, `missed` samples after the last accepted one.
  [[nodiscard]] Reading take(const S& y, int missed) const noexcept {
    Reading reading = read(count_, y, missed);
    reading.missed = missed;
    if constexpr (gated) {
      if (seen_.rejected > 0 && seen_.steady >= enough_steady && seen_.steady >= seen_.rejected) {
        Reading seen = read(seen_.count, y, missed - seen_.at);
        if (!seen.fits || !seen.counted) return reading;
        seen.missed = missed;
        seen.seen = true;
        return seen;
      }
    }
    return reading;
  }

  [[nodiscard]] Reading read(const Count& count, const S& y, int samples) const noexcept {
    Reading reading;
    if (!can_be_told(y)) [[unlikely]]
      return reading;
    reading.usable = true;
    reading.y = wrap(y);
    reading.samples = samples;
    if (!count.begun) [[unlikely]]
      return reading;
    const S change = reading.y - count.y;
    reading.step = wrap(change);
    const S expected = expected_motion(count, samples);
    const S crossed = detail::absolute(S(expected - change)) <= half_period()
                          ? S(0)
                          : (std::round)((expected - change) * inverse_period_);
    const S motion = change + crossed * period_;
    if (count.samples != none) {
      const S quarter = half_period() * static_cast<S>(0.5);
      reading.fits = detail::absolute(motion - expected) <= quarter &&
                     (samples > count.samples || detail::absolute(motion) <= half_period());
    }
    reading.turns = count.turns + crossed;
    reading.counted =
        (reading.fits || count.doubts >= most_doubts) && is_finite(reading.turns * period_);
    return reading;
  }

  [[nodiscard]] static S expected_motion(const Count& count, int samples) noexcept {
    if (count.samples == none || samples == 0) return S(0);
    if (samples == count.samples) return count.motion;
    return count.motion * (static_cast<S>(samples) / static_cast<S>(count.samples));
  }

  StepStatus restart(const Reading& reading) noexcept {
    return reset(reading.y) == StepStatus::ok ? StepStatus::restarted
                                              : StepStatus::measurement_rejected;
  }

  /// Updates the count after the correction by the observer.
  StepStatus keep(const Reading& reading, StepStatus status) noexcept {
    // y itself is acceptable, so it is the state that cannot be corrected.
    if (has(status, StepStatus::measurement_rejected)) [[unlikely]] {
      const bool input = has(status, StepStatus::input_rejected);
      return restart(reading) | (input ? StepStatus::input_rejected : StepStatus::ok);
    }
    if (gated && has(status, StepStatus::outlier_rejected)) {
      hear(reading);
      recentre();
      return status;
    }
    if (!reading.fits) status |= StepStatus::turn_assumed;
    if (!reading.seen) learn(count_, reading);
    if constexpr (gated) {
      hear(reading);
      // Turns are counted from the measurements that the observer has used.
      if (reading.seen) {
        count_ = seen_.count;
      } else {
        seen_.count.turns = count_.turns;
      }
      seen_.at = 0;
      seen_.rejected = 0;
    }
    recentre();
    return status;
  }

  void hear(const Reading& taken) noexcept {
    if constexpr (gated) {
      const Reading reading = read(seen_.count, taken.y, taken.missed - seen_.at);
      const bool steady = reading.fits && seen_.count.samples != none;
      seen_.steady = steady ? one_more(seen_.steady) : std::uint8_t{0};
      seen_.rejected = one_more(seen_.rejected);
      seen_.at = static_cast<std::uint16_t>(taken.missed);
      learn(seen_.count, reading);
    }
  }

  [[nodiscard]] static std::uint8_t one_more(std::uint8_t count) noexcept {
    return static_cast<std::uint8_t>(count < 255 ? count + 1 : count);
  }

  static void learn(Count& count, const Reading& reading) noexcept {
    learn_motion(count, reading);
    count.y = reading.y;
    count.turns = reading.turns;
    if (reading.fits) {
      count.doubts = 0;
    } else if (count.doubts < most_doubts) {
      ++count.doubts;
    }
    count.begun = true;
  }

  static void learn_motion(Count& count, const Reading& reading) noexcept {
    if (!count.begun || reading.samples == 0) return;
    if (reading.samples > count.samples) {
      // A gap. After too many of them the motion between consecutive measurements counts as
      // unknown, because these may never come again.
      if (++count.gaps >= most_gaps) count.samples = none;
      return;
    }
    count.gaps = 0;
    if (reading.samples < count.samples || count.doubts >= most_doubts) {
      count.motion = reading.step;
      count.samples = static_cast<std::uint16_t>(reading.samples);
    } else if (reading.fits) {
      count.motion += (reading.step - count.motion) * static_cast<S>(0.125);
    }
  }

  void forget() noexcept {
    count_ = Count{};
    seen_ = {};
  }

  StepStatus begin(StepStatus status) noexcept {
    if (status == StepStatus::ok) forget();
    return status;
  }

  void recentre() noexcept {
    const S z = observer_.level_estimate(Observer::levels - 1)(0);
    if (detail::absolute(z) <= half_period()) [[likely]]
      return;
    const S turns = (std::round)(z * inverse_period_);
    if (observer_.shift_output(-(turns * period_)) != StepStatus::ok) return;
    count_.turns -= turns;
    if constexpr (gated) seen_.count.turns -= turns;
  }

  S period_;
  S inverse_period_;
  Count count_{};
  struct Nothing {};
  [[no_unique_address]] std::conditional_t<gated, Seen, Nothing> seen_{};
};

/// Distinguishes the type in snapshots.
template <class Observer>
inline constexpr std::uint32_t type_tag<WrappedOutput<Observer>> =
    make_type_tag<Observer>("WrappedOutput");

}  // namespace esokit
