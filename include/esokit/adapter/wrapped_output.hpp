/// @file
/// WrappedOutput: an observer of an angle, whose measurement jumps by a period.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/type_tag.hpp>
#include <limits>
#include <type_traits>

namespace esokit {

/// Config of WrappedOutput.
template <LoopObserver Observer>
struct WrappedOutputConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  typename Observer::Config observer{};  ///< of the observer itself
  S period{};                            ///< of y, in its unit: 2 pi, 360

  /// @cond
  static constexpr auto fields(auto& c) noexcept { return detail::tie(c.observer, c.period); }
  /// @endcond
};

/// Counts the turns, so a measurement in any branch (0..2 pi, -180..180) can be used as it comes.
/// z_1 is kept within half a period of zero, so that float stays exact after many turns.
///
/// Turns are counted from one measurement to the next, not from the prediction. The observer sees
/// an angle without jumps and behaves as it does on one: every omega_o T is allowed, and the true
/// angle is the only equilibrium. (If the innovation is taken modulo one period, as is often done,
/// every y' + k period / T is an equilibrium: after one bad sample an axis at rest may be estimated
/// as spinning for ever.)
///
/// Requirements on y, including its noise:
/// - between neighbouring measurements (D samples apart if only every D-th sample has one) it moves
///   by less than half a period;
/// - the motion changes by less than a quarter of a period against the average of the last eight;
///   over a gap it is that average, continued.
///
/// A measurement that breaks the second rule is placed in the turn nearest to the prediction and
/// reported as `turn_assumed`, so that an outlier does not change the turn; after three in a row,
/// turns are counted again. Once y is good, turns are correct from the 30th measurement on,
/// whatever happened before, and from then on the observer converges as without turns.
///
/// If a good y cannot correct the state, or the scalar cannot hold the turns, the observer restarts
/// from y and reports `restarted`.
///
/// With a gate inside, a rejected measurement counts as missing. The exception: if the last eight
/// measurements, and all since the gate last accepted one, keep the second rule, the estimate is
/// wrong and the turns are counted from the rejected measurements.
///
/// An axis that turns by more than half a period a sample cannot be distinguished from a slower
/// one: the actuator must not be able to drive it so fast.
template <ShiftableOutput Observer>
class WrappedOutput
    : public NamedAdapter<WrappedOutput<Observer>, Observer, WrappedOutputConfig<Observer>> {
  using Base = NamedAdapter<WrappedOutput, Observer, WrappedOutputConfig<Observer>>;
  friend Base;
  using Base::observer_;
  using S = typename Observer::scalar_type;

 public:
  /// What it declares beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.wraps_output = true;
    return traits;
  }();

  /// One sample, see PredictorCorrector::update. @param y in any branch; one so large that its
  /// rounding is an eighth of a period is rejected
  StepStatus update(S y, S u_applied) noexcept {
    if (const Reading reading = take(y, this->missed() + 1); reading.counted) [[likely]] {
      return keep(reading, observer_.update(reading.y + reading.turns * period_, u_applied));
    }
    const StepStatus predicted = predict(u_applied);
    return predicted | correct(y);
  }

  /// Time update alone, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    const StepStatus status = observer_.predict(u_applied);
    recentre();
    return status;
  }

  /// Measurement update alone. @param y in any branch
  StepStatus correct(S y) noexcept {
    Reading reading = take(y, this->missed());
    if (!reading.usable) return StepStatus::measurement_rejected;
    if (reading.fits && !is_finite(reading.turns * period_)) [[unlikely]] {
      // The prediction has run off by more turns than the scalar holds: what it says of the turn
      // would leave no innovation that leads back.
      return restart(reading);
    }
    if (!reading.counted) {
      reading.turns = (std::round)((predicted() - reading.y) * inverse_period_);
    }
    return keep(reading, observer_.correct(reading.y + reading.turns * period_));
  }

  /// Restarts at (y, 0, .., 0), y taken to the nearest period around zero. A y that `update`
  /// would reject changes nothing and is reported.
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

  /// The turns would no longer be those of y.
  StepStatus shift_output(const S&) noexcept = delete;

  /// Its y would not be in the right branch.
  StepStatus correct_weighted(const S&, const S&) noexcept = delete;

  /// The difference `angle` to the nearest whole period, in -period/2 .. period/2.
  [[nodiscard]] S wrap(const S& angle) const noexcept {
    if (detail::absolute(angle) <= half_period()) return angle;
    return angle - period_ * (std::round)(angle * inverse_period_);
  }

  /// Of y, in its unit.
  [[nodiscard]] const S& period() const noexcept { return period_; }

 private:
  /// Where the turns stand.
  struct Count {
    S y{};                         ///< the last measurement that was taken, wrapped
    S turns{};                     ///< whole; y + turns periods is where the observer's z_1 belongs
    S motion{};                    ///< of y within `samples`, average; at most half a period
    std::uint16_t samples = none;  ///< 65535: motion is not known
    std::uint8_t gaps = 0;         ///< measurements that came later than after `samples`, in a row
    std::uint8_t doubts = 0;       ///< measurements with a turn_assumed in a row, 3 at most
    bool begun = false;            ///< there is a last measurement
  };

  /// The same of every measurement, whatever a gate makes of it. What the gate lets in depends on
  /// the estimate: turns that are counted between those alone may keep a wrong one for good.
  struct Heard {
    Count count{};
    std::uint16_t at = 0;       ///< missed() at the last one
    std::uint8_t steady = 0;    ///< in a row that moved as before, 255 at most
    std::uint8_t rejected = 0;  ///< since the gate last let one in, 255 at most
  };

  /// What the correction will subtract from the measurement: of level 1, as a sensor shows it.
  [[nodiscard]] S predicted() const noexcept {
    if constexpr (observer_traits<Observer>.measures_first_row) {
      return observer_.level_estimate(0)(0);
    } else {
      return observer_.predicted_measurement();
    }
  }

  /// What a measurement is taken for.
  struct Reading {
    S y{};                 ///< wrapped
    S turns{};             ///< if counted
    S step{};              ///< from the last measurement, to the nearest period
    int samples = 0;       ///< since then
    int missed = 0;        ///< samples since a measurement was let in
    bool usable = false;   ///< its branch can be told
    bool fits = true;      ///< it moved as before
    bool counted = false;  ///< false: the turn is that of the prediction
    bool heard = false;    ///< its turn is counted through rejected ones
  };

  static constexpr std::uint16_t none = 65535;
  static constexpr std::uint8_t most_doubts = 3;
  static constexpr std::uint8_t most_gaps = 8;
  static constexpr std::uint8_t enough_steady = 8;
  static constexpr bool gated = observer_traits<Observer>.rejects_outliers;

  WrappedOutput(const Observer& observer, const WrappedOutputConfig<Observer>& config) noexcept
      : Base(observer), period_(config.period), inverse_period_(S(1) / config.period) {}

  static Check<S> check(const WrappedOutputConfig<Observer>& config) {
    return Rules<S>{}.positive("period", config.period).invertible("period", config.period);
  }

  /// Of another period the turns are counted anew.
  void take(const WrappedOutput& fresh) noexcept {
    if (!(fresh.period_ < period_ || fresh.period_ > period_)) return;
    period_ = fresh.period_;
    inverse_period_ = fresh.inverse_period_;
    forget();
    recentre();
  }

  [[nodiscard]] S half_period() const noexcept { return period_ * static_cast<S>(0.5); }

  /// Not so where a rounding of y is an eighth of a period or more.
  [[nodiscard]] bool can_be_told(const S& y) const noexcept {
    constexpr S most_turns = S(1) / (S(8) * detail::rounding<S>());
    const S turns = y * inverse_period_;
    return is_finite(turns) && detail::absolute(turns) < most_turns;
  }

  /// A measurement, `missed` samples after the last one that was let in.
  [[nodiscard]] Reading take(const S& y, int missed) const noexcept {
    Reading reading = read(count_, y, missed);
    reading.missed = missed;
    if constexpr (gated) {
      if (heard_.rejected > 0 && heard_.steady >= enough_steady &&
          heard_.steady >= heard_.rejected) {
        Reading heard = read(heard_.count, y, missed - heard_.at);
        if (!heard.fits || !heard.counted) return reading;
        heard.missed = missed;
        heard.heard = true;
        return heard;
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

  /// Takes over what the observer has taken.
  StepStatus keep(const Reading& reading, StepStatus status) noexcept {
    // y can be held, so it is the state that cannot be corrected with it.
    if (has(status, StepStatus::measurement_rejected)) [[unlikely]] {
      const bool input = has(status, StepStatus::input_rejected);
      return restart(reading) | (input ? StepStatus::input_rejected : StepStatus::ok);
    }
    if constexpr (gated) {
      if (has(status, StepStatus::outlier_rejected)) {
        hear(reading);
        recentre();
        return status;
      }
    }
    if (!reading.fits) status |= StepStatus::turn_assumed;
    if constexpr (gated) {
      if (!reading.heard) learn(count_, reading);
      hear(reading);
      // Turns count from what the observer has taken.
      if (reading.heard) {
        count_ = heard_.count;
      } else {
        heard_.count.turns = count_.turns;
      }
      heard_.at = 0;
      heard_.rejected = 0;
    } else {
      learn(count_, reading);
    }
    recentre();
    return status;
  }

  void hear(const Reading& taken) noexcept {
    if constexpr (gated) {
      const Reading reading = read(heard_.count, taken.y, taken.missed - heard_.at);
      const bool steady = reading.fits && heard_.count.samples != none;
      heard_.steady = steady ? one_more(heard_.steady) : std::uint8_t{0};
      heard_.rejected = one_more(heard_.rejected);
      heard_.at = static_cast<std::uint16_t>(taken.missed);
      learn(heard_.count, reading);
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
      // A gap. That of neighbours is not known for ever, they may not come again.
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
    if constexpr (gated) heard_ = Heard{};
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
    if constexpr (gated) heard_.count.turns -= turns;
  }

  S period_;
  S inverse_period_;
  Count count_{};
  struct Nothing {};
  [[no_unique_address]] std::conditional_t<gated, Heard, Nothing> heard_{};
};

/// The same for packs, lane by lane.
template <ShiftableOutput Observer>
requires PackScalar<typename Observer::scalar_type>
class WrappedOutput<Observer>
    : public PackAdapter<WrappedOutput<Observer>, WrappedOutput<detail::LaneOf<Observer>>, Observer,
                         WrappedOutputConfig<Observer>> {
 public:
  using WrappedOutput::PackAdapter::PackAdapter;
  template <class T>
  using with_scalar =
      WrappedOutput<detail::WithScalar<Observer, T>>;  ///< the same with another scalar
};

/// Distinguishes the type in snapshots.
template <ShiftableOutput Observer>
inline constexpr std::uint32_t type_tag<WrappedOutput<Observer>> =
    make_type_tag<Observer>("WrappedOutput");

}  // namespace esokit
