/// @file
/// What every controller with an observer does besides its law: feed back the applied input, limit
/// u, bridge missing samples, start without a bump.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <esokit/control/limiter.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/observer/detail/steady_state.hpp>
#include <optional>

namespace esokit {

/// Holds u at a value at the start, while the observer converges.
template <Scalar S = double>
struct StartHold {
  S time{};   ///< duration, s; 0: none. Rounded up to whole samples of nominal length
  S input{};  ///< u during the hold, within the limits
};

/// What happens if measurements are missing (or NaN): they are bridged, then u goes to a value that
/// needs no sensor. Choose it: zero stops most drives; a lifting axis needs the u at which it
/// rests, or zero and a brake; a drone the thrust at which it sinks slowly. With limits that do not
/// contain zero it has to be given. `hold` keeps an actuator at full torque if it was there.
template <Scalar S = double>
struct MissingRule {
  int most = 50;             ///< missing measurements in a row that the controller bridges, 0 up to
                             ///< 65534 / measurement_divider - 1
  std::optional<S> input{};  ///< u in safe mode, within the limits and approached within the rate
                             ///< limit; left out: zero
  bool stay = false;         ///< true: safe mode lasts until start(); false: until a measurement
  bool hold = false;         ///< true, instead of `input`: safe mode holds the last u, for ever
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
  return Rules<S>{}
      .finite(field, input)
      .demand(at_most(limits.lower, input),
              {field, input, "must not be below limits.lower", -1, limits.lower, true})
      .demand(at_most(input, limits.upper),
              {field, input, "must not be above limits.upper", -1, limits.upper, true});
}

/// Of a finished rule. @param divider measurements are due at each so many steps
template <PlainScalar S>
Check<S> check_missing(const MissingRule<S>& missing, const Limits<S>& limits, int divider = 1) {
  constexpr const char* field = "missing.input";
  Rules<S> rules;
  if (missing.input) {
    rules.all_of(check_within(field, *missing.input, limits))
        .demand(!missing.hold, "missing.hold", S(1), "must be left out if missing.input is given");
  } else if (!missing.hold) {
    rules
        .demand(
            !(limits.lower > S(0)),
            {field, S(0), "must be given, as zero is below limits.lower", -1, limits.lower, true})
        .demand(
            !(limits.upper < S(0)),
            {field, S(0), "must be given, as zero is above limits.upper", -1, limits.upper, true});
  }
  // The observer counts missing samples up to 65533.
  const int most = 65534 / divider - 1;
  return rules.demand(0 <= missing.most && missing.most <= most,
                      {"missing.most", static_cast<S>(missing.most),
                       "must be 0 up to 65534 samples, that is", -1, static_cast<S>(most), true});
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
  const StartHold<S>& hold = settings.start_hold;
  rules.not_negative("start_hold.time", hold.time);
  // Of a hold that is left out nothing was said.
  if (hold.time > S(0) || hold.input < S(0) || hold.input > S(0) || !is_finite(hold.input)) {
    rules.all_of(check_within("start_hold.input", hold.input, settings.limits));
  }
  rules.demand(samples < S(1 << 24), "start_hold.time", hold.time, "must be below 2^24 samples")
      .demand(1 <= divider && divider <= 1000, "measurement_divider", counted, "must be 1 .. 1000")
      .demand(divider == 1 || divider <= max_gap,
              {"measurement_divider", counted, "must not be above the observer's max_gap, which is",
               -1, static_cast<S>(max_gap), true})
      .demand(divider == 1 || bears_gaps, "measurement_divider", counted,
              "must be 1: regular gaps restart this observer");
  if (!rules) return rules.error();
  if (auto ok = check_missing(settings.missing, settings.limits, divider); !ok) return ok.error();
  return CheckedLoop<S>{*limiter, static_cast<std::uint32_t>(samples)};
}

}  // namespace detail

/// What determines the output at present.
enum class LoopMode : unsigned char {
  running,     ///< the law
  start_hold,  ///< the start hold
  safe,        ///< too many measurements are missing
  rest         ///< none: the last u is held, see Resting
};

/// A LoopMode can be written to a stream, see has_text.
template <>
inline constexpr bool has_text<LoopMode> = true;

/// Writes the name of the mode.
template <class Stream, std::same_as<LoopMode> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value mode) {
  constexpr const char* names[] = {"running", "start_hold", "safe", "rest"};
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

/// A law as a ControlLoop asks for it.
template <class U, class Takes>
struct Asked {
  U u;
  Takes takes;  ///< whether what the law is given is finite
  ESOKIT_INLINE auto operator()(bool special) noexcept { return u(special); }
};
template <class U, class Takes>
Asked(U, Takes) -> Asked<U, Takes>;

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
  /// @param watched the law is called at every sample that something is special
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
    const bool ordinary = special_ == false ||
                          (mode_ == LoopMode::running && set_.divider == 1 && elsewhere_ == false);
    return ordinary && detail::LaneAccess::advance(observer_);
  }
  template <class Law>
  ESOKIT_INLINE bool step_all(S& u, const S& measured, Law&& law) noexcept {
    if (!detail::LaneAccess::step(observer_, measured, limiter_.last())) return false;
    status_ = StepStatus::ok;
    u = limited(actuated(law(!(special_ == false))));
    return true;
  }
  /// @endcond

  /// What the actuator held since the last step, if it was not the last output: before the step.
  /// The observer gets it; the rate limit counts from the last output. Only between `start`,
  /// `track` or `hold` and the next step it is the operator's, and the rate limit counts from it.
  /// @return ok, or input_rejected for a u that is not finite, which changes nothing
  StatusType applied(S u) noexcept {
    const auto good = is_finite(u);
    u = select(good, u, limiter_.last());
    if (!(elsewhere_ == false)) [[unlikely]] {
      S command = output();
      bool taken = false;
      for (int i = 0; i < lane_count<S>; ++i) {
        if (!detail::of_lane(elsewhere_, i) || !detail::of_lane(good, i)) continue;
        detail::of_lane(command, i) = detail::of_lane(requested_, i) = detail::of_lane(u, i);
        taken = true;
      }
      if (taken) limiter_.track(command);
    }
    limiter_.applied(u);
    return detail::unless<S>(good, StepStatus::input_rejected);
  }

  /// One sample: the observer's update, then the law.
  /// @param measured measurement at sample k, NaN if missing
  /// @param drive what drove the observer's chain from k - 1 to k: the last output of this loop,
  ///        unless something other than u does
  /// @param law (bool) -> S, the requested u, computed from the new estimate. True in samples in
  ///        which something is special. Its `takes()` is false if what it was given is not finite
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
          return step_seldom<detail::LaneAccess::advances<Observer>>(measured, drive, law);
        status_ = StepStatus::ok;
        return limited(actuated(law(false)));
      }
      return step_any<Advanced>(measured, drive, law);
    }
  }

  /// One sample without a measurement.
  template <class Law>
  S step_without_measurement(Law&& law) noexcept {
    if (too_soon()) return output();
    skip_measurement(limiter_.last());
    return put_out(law);
  }

  /// Manual operation: the observer runs, the output is the operator's, and the next one counts
  /// from it.
  /// @param u_applied what was held from k - 1 to k @return the same
  S track(S measured, S u_applied) noexcept {
    const StatusType told = take_over(u_applied);
    follow(measured, limiter_.last(), told);
    return limiter_.last();
  }

  /// For a plant that is held by something else while u comes from elsewhere: the observer follows
  /// y, dhat is kept; see Guarded. @param u_applied what was held from k - 1 to k @return the same
  template <class O = Observer>
  requires(observer_traits<O>.gates_disturbance) S hold(S measured, S u_applied)
  noexcept {
    const StatusType told = take_over(u_applied);
    follow(measured, observer_.hold(limiter_.last()), told);
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
      elsewhere_ = true;
      steps_ = {};
      set_mode(LoopMode::running);
    }
    return status;
  }

  /// While the law determines u: from now on u is held, and the observer goes on; or the law again.
  void rest(bool at_rest) noexcept {
    if (mode_ == (at_rest ? LoopMode::running : LoopMode::rest)) {
      set_mode(at_rest ? LoopMode::rest : LoopMode::running);
    }
  }

  /// Takes over the settings of `fresh`; state, output and mode are kept. If the observer refuses
  /// them, nothing changes.
  Check<S> adopt(const ControlLoop& fresh) {
    [[maybe_unused]] const S due = unanswered();
    if (auto ok = observer_.adopt(fresh.observer_); !ok) return ok;
    requested_ = output();
    limiter_.adopt(fresh.limiter_, requested_);
    // After a change of the divider the next update is one with a measurement.
    if (set_.divider != fresh.set_.divider) phase_ = 0;
    set_ = fresh.set_;
    set_mode(mode_);
    if constexpr (has_step_time) {
      steps_.asked = 0;
      if (due > S(0)) (void)elapsed(due);
    }
    return {};
  }

  /// Says how much time has passed since the last step (s) if the observer is VariableTime: any. It
  /// is predicted in as many steps as needed, with what drove the chain since the last step.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> elapsed(const S& seconds)
  noexcept {
    O next = observer_;
    // What is no time is refused as it is.
    const auto steps = next.elapsed(seconds < S(0) ? seconds : S(seconds + unanswered()));
    if (!steps) return steps.error();
    return take_time(next, *steps, true);
  }

  /// Sets the length of the next steps (s) if the observer is VariableTime; the rate limit follows.
  /// A length that the observer or the limiter refuses changes nothing.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> set_step_time(const S& seconds)
  noexcept {
    O next = observer_;
    if (auto ok = next.set_step_time(seconds); !ok) return ok;
    return take_time(next, 1, false);
  }

  /// The observer, for its estimates.
  [[nodiscard]] const Observer& observer() const noexcept { return observer_; }
  /// The observer, for its own members.
  [[nodiscard]] Observer& observer() noexcept { return observer_; }
  /// The last output, after the limits.
  [[nodiscard]] S output() const noexcept { return limiter_.commanded(requested_); }
  /// What the actuator holds: the last output, or the u that was reported as applied since.
  [[nodiscard]] const S& held() const noexcept { return limiter_.last(); }
  /// The u requested by the law, before the limits.
  [[nodiscard]] const S& requested() const noexcept { return requested_; }
  /// Status of the observer at the last step.
  [[nodiscard]] StatusType status() const noexcept { return status_; }
  /// What determines the output at present.
  [[nodiscard]] Lanes<LoopMode, S> mode() const noexcept { return mode_; }
  /// D: a measurement is due at every D-th step.
  [[nodiscard]] Lanes<int, S> measurement_divider() const noexcept { return set_.divider; }
  /// Whether no time has passed, or too little for a step, see `elapsed`: the next step changes
  /// nothing.
  [[nodiscard]] bool too_soon() const noexcept {
    if constexpr (has_step_time) {
      return steps_.due == 0;
    } else {
      return false;
    }
  }
  /// The limits, and what the actuator holds.
  [[nodiscard]] const Limiter<S>& limiter() const noexcept { return limiter_; }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr bool has_step_time = observer_traits<Observer>.varies_time;
  static constexpr int data_members = 11;
  struct NoLimits {
    constexpr NoLimits() = default;
    constexpr explicit NoLimits(const Limits<S>&) {}
  };
  /// Steps that the next one consists of, by the time that has passed; 0: too little for one.
  struct Steps {
    std::uint16_t due = 1;
    std::uint16_t asked = 0;  ///< 1: by `elapsed`, and none of them is done
  };
  struct OneStep {};
  /// What a retune replaces.
  struct Set {
    S hold_input{};
    S safe_input{};
    Lanes<std::uint16_t, S> missing_limit{};
    Lanes<std::uint16_t, S> divider{};
    Lanes<bool, S> watched{};
    Lanes<bool, S> hold_safe{};
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
             settings.missing.hold,
             settings.missing.stay,
             decltype(Set::limits)(settings.limits)},
        mode_(hold_samples > 0 ? LoopMode::start_hold : LoopMode::running),
        hold_left_(hold_samples),
        limiter_(limiter),
        observer_(observer) {
    set_mode(mode_);
    // The output before the first step is the hold input, or the value nearest to it within the
    // limits.
    if (hold_samples > 0) limiter_.track(requested_ = limiter_.within(set_.hold_input));
  }

  /// The time of an `elapsed` that no step has answered yet, s: with other settings, or with more
  /// time, it is said again.
  [[nodiscard]] S unanswered() const noexcept {
    if constexpr (has_step_time) {
      if (steps_.asked != 0) return static_cast<S>(steps_.due) * observer_.step_time();
    }
    return S(0);
  }

  /// What follows from the step time of `next`, the observer.
  template <class O>
  Check<S> take_time(const O& next, int steps, bool asked) noexcept {
    if (steps > 0) {
      const auto limiter = Limiter<S>::make(set_.limits, next.step_time());
      if (!limiter) return limiter.error();
      limiter_.adopt(*limiter, output());
    }
    observer_ = next;
    steps_ = {static_cast<std::uint16_t>(steps), static_cast<std::uint16_t>(asked ? 1 : 0)};
    set_mode(mode_);
    return {};
  }

  /// u is commanded elsewhere.
  StatusType take_over(S u) noexcept {
    const auto good = is_finite(u);
    limiter_.track(select(good, u, output()));
    return detail::unless<S>(good, StepStatus::input_rejected);
  }

  /// One sample with a u from elsewhere.
  void follow(S measured, S drive, StatusType told) noexcept {
    if (mode_ == LoopMode::start_hold) mode_ = LoopMode::running;
    if (!too_soon()) observe_specially<false>(measured, drive);
    status_ = status_ | told;
    requested_ = limiter_.last();
    elsewhere_ = true;
    set_mode(mode_);
  }

  template <bool Advanced, class Law>
  ESOKIT_INLINE S step_any(S measured, S drive, Law& law) noexcept {
    if (special_) [[unlikely]] {
      if (too_soon()) return output();
      observe_specially<Advanced>(measured, drive);
      return put_out(law);
    }
    if constexpr (has_step_time) steps_.asked = 0;
    const StepStatus status = observe<Advanced>(measured, drive);
    status_ = status;
    if (status != StepStatus::ok) [[unlikely]] {
      after_trouble(measured);
      return put_out(law);
    }
    return limited(actuated(law(false)));
  }
  template <bool Advanced, class Law>
  ESOKIT_COLD S step_seldom(S measured, S drive, Law law) noexcept {
    return step_any<Advanced>(measured, drive, law);
  }

  template <class Law>
  S put_out(Law law) noexcept {
    if (elsewhere_) {  // u is commanded here again
      elsewhere_ = false;
      set_mode(mode_);
    }
    // Also where it is not used.
    if (!law.takes()) status_ = status_ | StepStatus::reference_rejected;
    return limited(mode_ == LoopMode::running ? actuated(law(true)) : other_output());
  }

  /// The u with the effect that a law asks for.
  ESOKIT_INLINE detail::Turned<Observer, S> actuated(const S& effect) const noexcept {
    return detail::input_for(observer_, effect);
  }

  ESOKIT_INLINE S limited(S wanted) noexcept {
    if constexpr (!records<S>) {  // what is written has it in its shell
      if (const auto good = is_finite(wanted); !all(good)) [[unlikely]]
        wanted = instead_of(wanted);
    }
    requested_ = wanted;
    return limiter_(wanted);
  }

  /// The u for one that is not finite, by a bad reference or an overflow in the law: the last
  /// output.
  ESOKIT_COLD S instead_of(S wanted) noexcept {
    const auto good = is_finite(wanted);
    status_ = status_ | detail::unless<S>(good, StepStatus::reference_rejected);
    return select(good, wanted, output());
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
    pass_pause(drive);
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

  /// All steps since the last one, but for the one that is to follow.
  void pass_pause([[maybe_unused]] S drive) noexcept {
    if constexpr (has_step_time) {
      steps_.asked = 0;
      if (steps_.due == 1) return;
      for (; steps_.due > 1; --steps_.due) (void)observer_.predict(drive);
      set_mode(mode_);
    }
  }

  void skip_measurement(S drive) noexcept {
    pass_pause(drive);
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

  ESOKIT_COLD void judge_missing() noexcept {
    const int missed = observer_.missed();
    if (missed >= set_.missing_limit) {
      set_mode(LoopMode::safe);
    } else if (mode_ == LoopMode::safe && !set_.stay_safe && missed < set_.divider) {
      set_mode(LoopMode::running);
    }
  }

  /// The output if the law does not determine it.
  [[nodiscard]] ESOKIT_COLD S other_output() noexcept {
    if (mode_ == LoopMode::rest) return output();
    if (mode_ == LoopMode::safe) return set_.hold_safe ? output() : set_.safe_input;
    // The step in which the hold ends is still held.
    if (--hold_left_ == 0) set_mode(LoopMode::running);
    return set_.hold_input;
  }

  ESOKIT_COLD void set_mode(Lanes<LoopMode, S> mode) noexcept {
    mode_ = mode;
    special_ = !(mode == LoopMode::running) || !(set_.divider == 1) || set_.watched == true ||
               elsewhere_ == true;
    if constexpr (has_step_time) special_ = special_ || steps_.due != 1;
  }

  [[nodiscard]] std::uint16_t next_phase() const noexcept {
    return static_cast<std::uint16_t>(phase_ + 1 == set_.divider ? 0 : phase_ + 1);
  }

  // What a valid sample touches comes last, beside the weights of a law, and what it writes side by
  // side: a bank of packs waits for memory. The padding of an object holds what is next.
  [[no_unique_address]] Set set_;
  Lanes<LoopMode, S> mode_;
  Lanes<std::uint32_t, S> hold_left_;
  [[no_unique_address]] Limiter<S> limiter_;
  Lanes<std::uint16_t, S> phase_{};
  [[no_unique_address]] std::conditional_t<has_step_time, Steps, OneStep> steps_{};
  Lanes<bool, S> elsewhere_{false};  ///< u was commanded by something else since the last step
  /// True if anything besides the law has to be done: one test in the hot path.
  Lanes<bool, S> special_{false};
  StatusType status_ = StepStatus::ok;
  S requested_{};
  Observer observer_;
};

}  // namespace esokit
