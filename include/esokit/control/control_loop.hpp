/// @file
/// What every controller with an observer does besides its law: feed back the applied input, limit
/// u, bridge missing samples, start without a bump.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <esokit/control/limiter.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/observer/steady_state.hpp>
#include <optional>

namespace esokit {

/// Holds u at a value at the start, while the observer converges.
template <Scalar S = double>
struct StartHold {
  S time{};   ///< duration, s; 0: none. Rounded up to whole samples of nominal length
  S input{};  ///< u during the hold, within the limits
};

/// What happens if measurements are missing (or NaN).
template <Scalar S = double>
struct MissingRule {
  int most = 50;  ///< missing measurements in a row that the controller bridges, 0 up to
                  ///< 65534 / measurement_divider - 1
  std::optional<S>
      input{};        ///< u in safe mode, approached within the rate limit; left out: the last u
  bool stay = false;  ///< true: safe mode lasts until start(); false: until a measurement
};

/// Settings of a ControlLoop; a controller's config repeats them by name.
template <Scalar S = double>
struct LoopSettings {
  Limits<S> limits{};           ///< of the actuator
  StartHold<S> start_hold{};    ///< u at the start, while the observer converges
  MissingRule<S> missing{};     ///< what to do when measurements are missing
  int measurement_divider = 1;  ///< D: a measurement is due at every D-th step, 1 .. 1000
};

namespace detail {

template <PlainScalar S>
Check<S> check_within(const char* field, const S& input, const Limits<S>& limits) {
  const bool nothing_said = !(input < S(0)) && !(input > S(0));
  return Rules<S>{}
      .finite(field, input)
      .demand(nothing_said || at_most(limits.lower, input),
              {field, input, "must not be below limits.lower", -1, limits.lower, true})
      .demand(nothing_said || at_most(input, limits.upper),
              {field, input, "must not be above limits.upper", -1, limits.upper, true});
}

template <PlainScalar S>
struct CheckedLoop {
  Limiter<S> limiter;
  std::uint32_t hold_samples;
};

/// Checks the settings. Not a member of a class, so that the loops of all observers share its code.
template <PlainScalar S>
Expected<CheckedLoop<S>, Error<S>> check_loop(const LoopSettings<S>& settings, S sample_time,
                                              int max_gap, bool bears_gaps) {
  const auto limiter = Limiter<S>::make(settings.limits, sample_time);
  if (!limiter) return limiter.error();
  const S samples = std::ceil(settings.start_hold.time / sample_time - S(1) / S(1024));
  const int divider = settings.measurement_divider;
  const auto counted = static_cast<S>(divider);
  Rules<S> rules;
  rules.not_negative("start_hold.time", settings.start_hold.time)
      .all_of(check_within("start_hold.input", settings.start_hold.input, settings.limits))
      .demand(samples < S(1 << 24), "start_hold.time", settings.start_hold.time,
              "must be below 2^24 samples");
  if (settings.missing.input) {
    rules.all_of(check_within("missing.input", *settings.missing.input, settings.limits));
  }
  rules.demand(1 <= divider && divider <= 1000, "measurement_divider", counted, "must be 1 .. 1000")
      .demand(divider == 1 || divider <= max_gap,
              {"measurement_divider", counted, "must not be above the observer's max_gap, which is",
               -1, static_cast<S>(max_gap), true})
      .demand(divider == 1 || bears_gaps, "measurement_divider", counted,
              "must be 1: regular gaps restart this observer");
  if (!rules) return rules.error();
  // The observer counts missing samples up to 65533.
  const int most = 65534 / divider - 1;
  rules.demand(0 <= settings.missing.most && settings.missing.most <= most,
               {"missing.most", static_cast<S>(settings.missing.most),
                "must be 0 up to 65534 samples, that is", -1, static_cast<S>(most), true});
  if (!rules) return rules.error();
  return CheckedLoop<S>{*limiter, static_cast<std::uint32_t>(samples)};
}

}  // namespace detail

/// What determines the output at present.
enum class LoopMode : unsigned char {
  running,     ///< the law
  start_hold,  ///< the start hold
  safe         ///< too many measurements are missing
};

/// A LoopMode can be written to a stream, see has_text.
template <>
inline constexpr bool has_text<LoopMode> = true;

/// Writes the name of the mode.
template <class Stream, std::same_as<LoopMode> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value mode) {
  constexpr const char* names[] = {"running", "start_hold", "safe"};
  out << names[static_cast<int>(mode)];
  return out;
}

namespace detail {

/// A difference of angles by the shorter way; any other number as it is.
template <class Observer, Scalar S>
ESOKIT_INLINE S wrapped(const Observer& observer, const S& difference) noexcept {
  if constexpr (observer_traits<Observer>.wraps_output) {
    return observer.wrap(difference);
  } else {
    return difference;
  }
}

/// Converts a u computed with b0 of the observer's config to the present b0.
template <class Observer, Scalar S>
ESOKIT_INLINE S by_present_gain(const Observer& observer, const S& u) noexcept {
  if constexpr (observer_traits<Observer>.schedules_input_gain) {
    return u * observer.input_factor();
  } else {
    return u;
  }
}

}  // namespace detail

/// An observer, the limits of an actuator, and rules for start-up and for missing or invalid
/// measurements. `step` runs one sample with any law; a controller (Adrc, DisturbanceCompensator)
/// is such a loop with a law.
///
/// The observer gets the limited u, or the one that the actuator reports.
template <LoopObserver Observer>
class ControlLoop {
 public:
  using S = typename Observer::scalar_type;  ///< type of signals and settings
  using scalar_type = S;                     ///< the same type
  using StatusType = StatusOf<S>;            ///< StepStatus, for a pack one per lane

  /// Checks the settings.
  /// @param observer as returned by its `make`
  /// @param watched the law is told at every sample that something is special
  /// @return the loop, with the observer in its present state, or an error that names the field
  static Expected<ControlLoop, Error<S>> make(const Observer& observer,
                                              const LoopSettings<S>& settings,
                                              bool watched = false) {
    const auto checked = detail::check_loop(settings, observer.sample_time(), observer.max_gap(),
                                            observer_traits<Observer>.bears_regular_gaps);
    if (!checked) return checked.error();
    if constexpr (has_step_time) {
      const int divider = settings.measurement_divider;
      Rules<S> rules;
      rules.demand(divider == 1 || observer.bridges(divider), "measurement_divider",
                   static_cast<S>(divider),
                   "must be so small that VariableTime bridges as many of its longest steps");
      if (!rules) return rules.error();
    }
    return ControlLoop(observer, checked->limiter, settings, checked->hold_samples, watched);
  }

  /// @cond
  /// For packs: whether no lane needs more than the observer's step and the law; then this step. A
  /// template, as an explicit instantiation would ask it of every observer.
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) ESOKIT_INLINE bool advance() noexcept {
    const bool ordinary = special_ == false || (mode_ == LoopMode::running && set_.divider == 1);
    return ordinary && detail::LaneAccess::advance(observer_);
  }
  template <class Law>
  ESOKIT_INLINE bool step_all(S& u, const S& measured, Law&& law) noexcept {
    if (!detail::LaneAccess::step(observer_, measured, limiter_.last())) return false;
    status_ = StepStatus::ok;
    u = limited(law(!(special_ == false)));
    return true;
  }
  /// @endcond

  /// What the actuator held since the last step, if it was not the last output: before the step.
  /// A u that is not finite changes nothing.
  void applied(S u) noexcept { limiter_.track(select(is_finite(u), u, limiter_.last())); }

  /// One sample: the observer's update, then the law.
  /// @param measured measurement at sample k, NaN if missing
  /// @param drive what drove the observer's chain from k - 1 to k: the last output of this loop,
  ///        unless something other than u does
  /// @param law (bool) -> S, the requested u, computed from the new estimate. True in samples in
  ///        which something is special
  /// @tparam Advanced of a lane, after `advance`
  /// @return u for k .. k+1
  template <bool Advanced = false, class Law>
  ESOKIT_INLINE S step(S measured, S drive, Law&& law) noexcept {
    if constexpr (records<S>) {
      S u{};
      if (!advance()) (void)measured[0];  // a mode, or a divider: branches
      (void)step_all(u, measured, law);
      return u;
    } else {
      if constexpr (!Advanced && detail::LaneAccess::steps<Observer>) {
        // What is seldom is called last, so that nothing has to be kept for later.
        if (special_ || !detail::LaneAccess::advance(observer_)) [[unlikely]]
          return step_seldom<false>(measured, drive, law);
        if (!detail::LaneAccess::step(observer_, measured, drive)) [[unlikely]]
          return step_seldom<true>(measured, drive, law);
        status_ = StepStatus::ok;
        return limited(law(false));
      }
      return step_any<Advanced>(measured, drive, law);
    }
  }

  /// One sample without a measurement.
  template <class Law>
  S step_without_measurement(Law&& law) noexcept {
    skip_measurement(limiter_.last());
    return put_out(law);
  }

  /// Manual operation: the observer runs, the output is the operator's.
  /// @param u_applied what was held from k - 1 to k @return the same
  S track(S measured, S u_applied) noexcept {
    applied(u_applied);
    follow(measured, limiter_.last());
    return limiter_.last();
  }

  /// For a plant that is held by something else while u comes from elsewhere: the observer follows
  /// y, dhat is kept; see Guarded. @param u_applied what was held from k - 1 to k @return the same
  template <class O = Observer>
  requires(observer_traits<O>.gates_disturbance) S hold(S measured, S u_applied)
  noexcept {
    applied(u_applied);
    follow(measured, observer_.hold(limiter_.last()));
    observer_.release();
    return limiter_.last();
  }

  /// Starts in the steady state at y under u, dhat = -b0 u. Ends the start hold and safe mode.
  /// @return ok, or input_rejected or state_rejected if u or y is not finite: nothing changes then
  StatusType start(S measured, S u) noexcept {
    if (!all(is_finite(u))) return StepStatus::input_rejected;
    if (!all(is_finite(measured))) return StepStatus::state_rejected;
    const StatusType status = detail::start_at_rest(observer_, measured, u);
    if (status == StepStatus::ok) {
      limiter_.track(u);
      requested_ = u;
      set_mode(LoopMode::running);
    }
    return status;
  }

  /// Takes over the settings of `fresh`; state, output and mode are kept. If the observer refuses
  /// them, nothing changes.
  Check<S> adopt(const ControlLoop& fresh) {
    if (auto ok = observer_.adopt(fresh.observer_); !ok) return ok;
    limiter_.adopt(fresh.limiter_);
    // After a change of the divider the next update is one with a measurement.
    if (set_.divider != fresh.set_.divider) phase_ = 0;
    set_ = fresh.set_;
    set_mode(mode_);
    return {};
  }

  /// Sets the length of the next step (s) if the observer is VariableTime; the rate limit follows.
  /// A length that the observer refuses changes nothing.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> set_step_time(const S& seconds)
  noexcept {
    if (auto ok = observer_.set_step_time(seconds); !ok) return ok;
    const auto limiter = Limiter<S>::make(set_.limits, seconds);
    if (!limiter) return limiter.error();
    limiter_.adopt(*limiter);
    return {};
  }

  /// The observer, for its estimates.
  [[nodiscard]] const Observer& observer() const noexcept { return observer_; }
  /// The observer, for its own members.
  [[nodiscard]] Observer& observer() noexcept { return observer_; }
  /// The last output, after the limits, or the u that was reported as applied since.
  [[nodiscard]] const S& output() const noexcept { return limiter_.last(); }
  /// The u requested by the law, before the limits.
  [[nodiscard]] const S& requested() const noexcept { return requested_; }
  /// Status of the observer at the last step.
  [[nodiscard]] StatusType status() const noexcept { return status_; }
  /// What determines the output at present.
  [[nodiscard]] Lanes<LoopMode, S> mode() const noexcept { return mode_; }
  /// D: a measurement is due at every D-th step.
  [[nodiscard]] Lanes<int, S> measurement_divider() const noexcept { return set_.divider; }
  /// The limits, and the output that they last let through.
  [[nodiscard]] const Limiter<S>& limiter() const noexcept { return limiter_; }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr bool has_step_time = observer_traits<Observer>.varies_time;
  static constexpr int data_members = 9;
  struct NoLimits {
    constexpr NoLimits() = default;
    constexpr explicit NoLimits(const Limits<S>&) {}
  };
  /// What a retune replaces.
  struct Set {
    S hold_input{};
    S safe_input{};
    Lanes<std::uint16_t, S> missing_limit{};
    Lanes<std::uint16_t, S> divider{};
    Lanes<bool, S> watched{};
    Lanes<bool, S> has_safe_input{};
    Lanes<bool, S> stay_safe{};
    [[no_unique_address]] std::conditional_t<has_step_time, Limits<S>, NoLimits> limits{};
  };

  ControlLoop(const Observer& observer, const Limiter<S>& limiter, const LoopSettings<S>& settings,
              std::uint32_t hold_samples, bool watched) noexcept
      : set_{settings.start_hold.input,
             settings.missing.input.value_or(S(0)),
             static_cast<std::uint16_t>((settings.missing.most + 1) * settings.measurement_divider),
             static_cast<std::uint16_t>(settings.measurement_divider),
             watched,
             settings.missing.input.has_value(),
             settings.missing.stay,
             decltype(Set::limits)(settings.limits)},
        mode_(hold_samples > 0 ? LoopMode::start_hold : LoopMode::running),
        hold_left_(hold_samples),
        limiter_(limiter),
        observer_(observer) {
    set_mode(mode_);
    // The output before the first step is the hold input, or the value nearest to it within the
    // limits.
    if (hold_samples > 0) limiter_.track(limiter_.within(set_.hold_input));
  }

  /// One sample with a u from elsewhere.
  void follow(S measured, S drive) noexcept {
    if (mode_ == LoopMode::start_hold) set_mode(LoopMode::running);
    observe_specially<false>(measured, drive);
    requested_ = limiter_.last();
  }

  template <bool Advanced, class Law>
  ESOKIT_INLINE S step_any(S measured, S drive, Law& law) noexcept {
    if (special_) [[unlikely]] {
      observe_specially<Advanced>(measured, drive);
      return put_out(law);
    }
    const StepStatus status = observe<Advanced>(measured, drive);
    status_ = status;
    if (status != StepStatus::ok) [[unlikely]] {
      after_trouble(measured);
      return put_out(law);
    }
    return limited(law(false));
  }
  template <bool Advanced, class Law>
  ESOKIT_COLD S step_seldom(S measured, S drive, Law law) noexcept {
    return step_any<Advanced>(measured, drive, law);
  }

  template <class Law>
  S put_out(Law law) noexcept {
    return limited(mode_ == LoopMode::running ? S(law(true)) : other_output());
  }

  ESOKIT_INLINE S limited(S wanted) noexcept {
    // A bad reference or an overflow in the law: keeps the last output.
    if (const auto good = is_finite(wanted); records<S> || !all(good)) [[unlikely]]
      wanted = select(good, wanted, limiter_.last());
    requested_ = wanted;
    return limiter_(wanted);
  }

  template <bool Advanced>
  ESOKIT_INLINE StepStatus observe(S measured, S drive) noexcept {
    if constexpr (Advanced) {
      return detail::LaneAccess::update_advanced(observer_, measured, drive);
    } else {
      return observer_.update(measured, drive);
    }
  }

  template <bool Advanced>
  ESOKIT_COLD void observe_specially(S measured, S drive) noexcept {
    if (phase_ != 0) {
      skip_measurement(drive);
      return;
    }
    phase_ = next_phase();
    const bool as_planned = observer_.missed() == set_.divider - 1;
    status_ = observe<Advanced>(measured, drive);
    if (status_ == StepStatus::ok && mode_ == LoopMode::running) return;
    after_trouble(measured);
    if (as_planned && status_ == StepStatus::gap_bridged) status_ = StepStatus::ok;
  }

  void skip_measurement(S drive) noexcept {
    phase_ = next_phase();
    status_ = observer_.predict(drive);
    judge_missing();
  }

  ESOKIT_COLD void after_trouble(S measured) noexcept {
    // After a gap too long to bridge, the observer would restart with dhat = 0. The steady state
    // under the present u is a better guess and causes no bump.
    if (has(status_, StepStatus::restarted)) {
      (void)observer_.reset(observer_.equilibrium(measured, S(observer_.applied_input())));
    }
    judge_missing();
  }

  void judge_missing() noexcept {
    const int missed = observer_.missed();
    if (missed >= set_.missing_limit) {
      set_mode(LoopMode::safe);
    } else if (mode_ == LoopMode::safe && !set_.stay_safe && missed < set_.divider) {
      set_mode(LoopMode::running);
    }
  }

  /// The output if the law does not determine it.
  [[nodiscard]] ESOKIT_COLD S other_output() noexcept {
    if (mode_ == LoopMode::safe) return set_.has_safe_input ? set_.safe_input : limiter_.last();
    // The step in which the hold ends is still held.
    if (--hold_left_ == 0) set_mode(LoopMode::running);
    return set_.hold_input;
  }

  void set_mode(Lanes<LoopMode, S> mode) noexcept {
    mode_ = mode;
    special_ = !(mode == LoopMode::running) || !(set_.divider == 1) || set_.watched == true;
  }

  [[nodiscard]] std::uint16_t next_phase() const noexcept {
    return static_cast<std::uint16_t>(phase_ + 1 == set_.divider ? 0 : phase_ + 1);
  }

  // What a good sample touches comes last, beside the weights of a law, and what it writes side by
  // side: a bank of packs waits for memory. The padding of an object holds what is next.
  [[no_unique_address]] Set set_;
  Lanes<LoopMode, S> mode_;
  Lanes<std::uint16_t, S> phase_{};
  Lanes<std::uint32_t, S> hold_left_;
  [[no_unique_address]] Limiter<S> limiter_;
  StatusType status_ = StepStatus::ok;
  /// True if anything besides the law has to be done: one test in the hot path.
  Lanes<bool, S> special_{false};
  S requested_{};
  Observer observer_;
};

}  // namespace esokit
