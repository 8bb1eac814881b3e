/// @file
/// Adrc: active disturbance rejection control with any observer of the library, complete with
/// limits, start, missing samples and retuning.
#pragma once

#include <esokit/control/adrc_law.hpp>
#include <esokit/control/control_loop.hpp>
#include <esokit/control/controller.hpp>
#include <esokit/control/detail/softening.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/feedback_gain.hpp>
#include <type_traits>

namespace esokit {

/// Config of Adrc, of either form. Give `controller_bandwidth` or `gains`, not both.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct AdrcConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<AdrcConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};  ///< includes T and b0, in both forms that of the plant
  S controller_bandwidth{};              ///< omega_c, rad/s
  std::optional<Array<S, Observer::order>> gains{};  ///< k_0 .. k_(n-1), replace omega_c
  TimeDomain domain = TimeDomain::continuous;        ///< where the controller's poles are placed
  bool half_gain = false;  ///< half-gain tuning of the controller; for the observer use HalfGainEso
  Limits<S> limits{};      ///< of the actuator
  StartHold<S> start_hold{};    ///< u at the start, while the observer converges
  MissingRule<S> missing{};     ///< what to do when measurements are missing
  int measurement_divider = 1;  ///< D: a measurement is due at every D-th update, the others ignore
                                ///< y; 1 .. 1000, not above the observer's max_gap
  std::optional<bool> soften{};  ///< lower gains while u is at its limits, see Softening. Left out:
                                 ///< for n >= 3, if limits.lower and limits.upper are given
};

/// Active disturbance rejection control, u = (v - dhat) / b0, with an observer and within the
/// limits of an actuator.
///
/// Timing: `update` at sample k takes y[k] and the present reference and returns the u to be held
/// until k + 1. The observer takes the limited u that `update` returned last as the input from k -
/// 1 to k; if the actuator reports another value, say `applied(u)` before `update`. Limits of rate
/// count from what `update` returned, not from what is reported: a sensor of u has errors and the
/// actuator lags.
///
/// Start: after `make` the controller is at y = 0, u = 0. `start(y, u)` takes over a plant at rest
/// at y under u without a bump: with the reference at y, or a profile that starts at y, the
/// first output is this u. During manual operation pass the operator's u to `track`, then
/// continue with `update`; u does not jump if the plant has come to rest (dhat = -b0 u) and the
/// reference is at y. After both the rate limit counts from that u.
///
/// Retuning (`retune`, any member of the config): the estimate and u are kept. A change of omega_o
/// does not change u if the innovation is zero. A change of b0 is moved into dhat as (b0_old -
/// b0_new) u, with the u before the last sample, so that u changes by no more than is usual within
/// a sample. A change of omega_c changes u by (dk_0 (r - y) - dk_1 y' ..) / b0. In the steady state
/// none of them makes u jump.
///
/// Missing measurements: NaN or `update_without_measurement`. The observer predicts, and later
/// corrects with the gain for the whole gap. After more than `missing.most` missing measurements in
/// a row, `mode()` is `safe` and u goes to `missing.input`, by default to zero: see MissingRule for
/// what to choose.
///
/// Overload (`soften`): for n >= 3 (of the law, so with the lag of an actuator in the model) a loop
/// is stable for a range of gains only, and limits lower its gain. Below that range it oscillates
/// from limit to limit for ever, after one overload. The same happens for n = 2 if k_1 / k_0 is
/// smaller than the latency of the plant. So the law gets softer while it asks for more than u can
/// give, and slowly recovers, see Softening. The analysis
/// (`linear_controller`, `margins`) is of the law as designed, `softness()` 1; below, the loop is
/// another one. PredictiveAdrc and MimoAdrc do not have it.
///
/// If the reference is not finite, u is kept (in the error-based form the measurement counts as
/// missing); each such sample reports `reference_rejected`. It is for you to decide for how long
/// that may last: u is then no answer to y. An applied u that is not finite is reported, and
/// replaced by the last output. No call allocates, throws or locks.
///
/// Delays, angles, a changing sample time, known nonlinear terms and the curve of an actuator are
/// handled by the observer: put DelayedInput, WrappedOutput, VariableTime, KnownModel or
/// MappedInput around it. They can be nested, with DelayedInput outside KnownModel.
/// @tparam Form OutputBased or ErrorBased
template <class Observer, class Form = OutputBased>
requires(detail::goes_into_a_loop<Observer>()) class Adrc {
  static constexpr bool error_based = std::is_same_v<Form, ErrorBased>;
  static_assert(AdrcForm<Form>, "esokit: the form is OutputBased or ErrorBased");

 public:
  static constexpr int order = Observer::order;        ///< n, order of the plant
  using scalar_type = typename Observer::scalar_type;  ///< type of signals and settings
  using S = scalar_type;                               ///< the same type
  using Reference = esokit::Reference<order, S>;       ///< r, `{r, r1}` or a vector

  /// What the controller can do beyond `update(y, reference)`.
  static constexpr ControllerTraits traits{
      .takes_derivatives = true,
      .knows_sample_time = true,
      .varies_time = observer_traits<Observer>.varies_time,
      .takes_measured = observer_traits<Observer>.takes_measured,
      .observes = true};

  using Config = AdrcConfig<Observer>;  ///< settings of make
  using StatusType = StatusOf<S>;       ///< StepStatus, for a pack one per lane

  /// The same with another scalar.
  template <class T>
  requires LoopObserver<detail::WithScalar<Observer, T>>
  using with_scalar = Adrc<detail::WithScalar<Observer, T>, Form>;

  /// Checks the settings and does all the design work.
  /// @return the controller, or an error that names the field
  static Expected<Adrc, Error<S>> make(const Config& config) {
    static_assert(detail::refuses_packs<S>());
    const auto observer = Observer::make(observer_config(config));
    if (!observer) return observer.error();
    const auto law = make_law(config, *observer);
    if (!law) return law.error();
    const auto weights = scaled(*law, *observer);
    if (!weights) return weights.error();
    const auto soft = Soft::make(*law, config.limits, config.soften);
    if (!soft) return soft.error();
    const auto loop = Loop::make(
        *observer, {config.limits, config.start_hold, config.missing, config.measurement_divider},
        soft->on());
    if (!loop) return loop.error();
    return Adrc(*loop, *law, *weights, *soft, config);
  }

  /// One sample. @param y measurement, NaN if missing
  /// @param reference r, if it is constant; `{r, r1}` or a vector (r, r', ..) of up to n + 1
  /// elements, if it moves. The error-based form uses only r
  /// @return u to be held until the next sample, within the limits
  ESOKIT_INLINE S update(S y, const Reference& reference) noexcept {
    y = measured(y, reference(0));
    return reference.moves() ? stepped(y, reference.all()) : stepped(y, reference(0));
  }

  /// What the actuator held since the last sample, if it was not the last output: say it before
  /// `update`. @return ok, or input_rejected for a u that is not finite, which changes nothing @{
  StatusType applied(S u) noexcept { return loop_.applied(u); }
  S update(S y, const Reference& reference, S u) = delete;  // call applied(u) before update
  /// @}

  /// w[k], before the sample in which it is first used; for Adrc<Measured<..>>. @param w a number,
  /// or a vector of several; NaN: lost
  template <class W, class O = Observer>
  requires(observer_traits<O>.takes_measured) void measured(const W& w) noexcept {
    if constexpr (!error_based) {
      observer().measured(w);
    } else if constexpr (detail::vector_size<W> == 0) {
      observer().measured(S(-w));
    } else {
      Vector<S, detail::vector_size<W>> opposite = w;
      for (S& one : opposite) one = -one;
      observer().measured(opposite);
    }
  }

  /// One sample whose measurement is missing.
  S update_without_measurement(const Reference& reference) noexcept {
    return reference.moves() ? loop_.step_without_measurement(asked(reference.all()))
                             : loop_.step_without_measurement(asked(reference(0)));
  }

  /// Manual operation: the observer runs, u is the operator's.
  /// @param u_applied what the actuator held since the last sample @return the same
  S track(S y, S reference, S u_applied) noexcept {
    soft_.reset();
    return loop_.track(measured(y, reference), u_applied);
  }

  /// For a plant that is held by something else: the observer follows y, dhat is kept, u is the
  /// caller's; see Guarded. On release begin with the reference at y.
  /// @param u_applied what the actuator held since the last sample @return the same
  template <class O = Observer>
  requires(observer_traits<O>.gates_disturbance) S hold(S y, S reference, S u_applied)
  noexcept {
    soft_.reset();
    return loop_.hold(measured(y, reference), u_applied);
  }

  /// Sets b0 before the next sample. @return as for Guarded::set_input_gain
  template <class O = Observer>
  requires(observer_traits<O>.schedules_input_gain) Check<S> set_input_gain(const S& b)
  noexcept { return observer().set_input_gain(error_based ? S(-b) : b); }

  /// y - r in the steady state, within the limits, for a constant d = 1 (unit of y^(n)): the steady
  /// error caused by the leak of Guarded, unit of y.
  template <class O = Observer>
  requires(observer_traits<O>.gates_disturbance) [[nodiscard]] S leak_error() const noexcept {
    // In the steady state b0 u = -d, which must equal the output of the law.
    const auto left = observer().leak_error();
    S sum = left(order);
    for (int i = 0; i < order; ++i) sum = sum + gains()[static_cast<std::size_t>(i)] * left(i);
    return sum / gains()[0];
  }

  /// Takes over a plant at rest at y under u, with the reference at y, too.
  StatusType start(S y, S u) noexcept { return start(y, u, y); }

  /// Takes over a plant at rest at y under u. @param reference r, used by the error-based form only
  /// @return ok, or input_rejected or state_rejected if u or y is not finite: nothing changes then
  StatusType start(S y, S u, S reference) noexcept {
    // Tested one by one: under -ffast-math a compiler may replace y - y by zero.
    if (!all(is_finite(y)) || !all(is_finite(reference))) return StepStatus::state_rejected;
    const StatusType status = loop_.start(measured(y, reference), u);
    if (status == StepStatus::ok) soft_.reset();
    return status;
  }

  /// From the next sample on u is held and the observer goes on, or the law determines u again. It
  /// has no effect in the start hold and in safe mode; Resting decides when.
  void rest(bool at_rest) noexcept { loop_.rest(at_rest); }

  /// New settings while running. A refused config changes nothing. A running start hold keeps its
  /// duration; a new one has no effect.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`: without design work, so it may
  /// run in an interrupt.
  Check<S> adopt(const Adrc& fresh) {
    if (auto ok = loop_.adopt(fresh.loop_); !ok) return ok;
    law_ = fresh.law_;
    weights_ = fresh.weights_;
    soft_.adopt(fresh.soft_);
    spec_ = fresh.spec_;
    // Time that has passed counts under the new settings, too.
    if constexpr (observer_traits<Observer>.varies_time) {
      (void)with_gains([](Loop&) { return Check<S>{}; });
    }
    return {};
  }

  /// Says that `seconds` have passed since the last sample: any time, before each one. For
  /// Adrc<VariableTime<..>>:
  ///
  ///     if (controller.elapsed(seconds)) u = controller.update(y, r);
  ///
  /// After a pause the observer first predicts in steps of at most T what happened under the u that
  /// was held, so that nothing is lost. After more than max_gap + 1 of them it restarts. With a
  /// time below T / ratio, also zero, `update` changes nothing and returns the last u: that time
  /// counts with the next one. A time that is negative or not finite is refused and changes
  /// nothing. The observer's gains, the rate limit (for one step, also after a pause) and, if
  /// placed in the sampled domain, the controller's gains follow.
  ///
  /// Said twice before an `update`, both count; a `retune` in between changes nothing of it. If the
  /// scalar cannot hold the rate limit over it, it is refused and does not count.
  ///
  /// `to_c` refuses VariableTime, and says what to do instead.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> elapsed(const S& seconds)
  noexcept {
    return with_gains([&](Loop& loop) { return loop.elapsed(seconds); });
  }

  /// The same for all of the next steps, each of that length: one outside T / ratio .. T ratio is
  /// refused and changes nothing.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> set_step_time(const S& seconds)
  noexcept {
    return with_gains([&](Loop& loop) { return loop.set_step_time(seconds); });
  }

  /// The observer, for its estimates.
  [[nodiscard]] const Observer& observer() const noexcept { return loop_.observer(); }
  /// The observer, for its own members (AlgebraicEso::rearm).
  [[nodiscard]] Observer& observer() noexcept { return loop_.observer(); }
  /// T, s.
  [[nodiscard]] S sample_time() const noexcept { return loop_.observer().sample_time(); }
  /// The present u, within the limits, whatever is reported as applied.
  [[nodiscard]] S output() const noexcept { return loop_.output(); }
  /// The u requested by the law, before the limits.
  [[nodiscard]] const S& requested() const noexcept { return loop_.requested(); }
  /// The limits of u.
  [[nodiscard]] const Limiter<S>& limiter() const noexcept { return loop_.limiter(); }
  /// Status of the observer at the last sample.
  [[nodiscard]] StatusType status() const noexcept { return loop_.status(); }
  /// Whether u is determined by the law, the start hold or the rule for missing measurements.
  [[nodiscard]] Lanes<LoopMode, S> mode() const noexcept { return loop_.mode(); }
  /// Whether too little time has passed for a sample, see `elapsed`: `update` changes nothing.
  [[nodiscard]] bool too_soon() const noexcept { return loop_.too_soon(); }
  /// k_0 .. k_(n-1).
  [[nodiscard]] const Array<S, order>& gains() const noexcept { return law_.gains(); }
  /// s: the part of its bandwidth that the law has left, 1 unless it is softened, see Softening.
  [[nodiscard]] S softness() const noexcept { return S(1.0) / soft_.slowness(); }
  /// D: a measurement is due at every D-th update.
  [[nodiscard]] Lanes<int, S> measurement_divider() const noexcept {
    return loop_.measurement_divider();
  }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr int data_members = 5;
  static constexpr bool advances = detail::LaneAccess::advances<Observer>;

  using Loop = ControlLoop<Observer>;
  using Law = AdrcLaw<order, S>;
  struct Nothing {};
  /// For a constant reference: w_i = k_i i! / (T^i b0) and w_n = n! / (T^n b0), a third of the
  /// multiplications of the law on physical estimates.
  static constexpr bool scales = observer_traits<Observer>.publishes_chain;
  using Weights = std::conditional_t<scales, Array<S, order + 1>, Nothing>;
  using Soft = Softening<order, S>;
  /// u for a reference, as ControlLoop asks for it.
  template <class Given>
  ESOKIT_INLINE auto asked(const Given& reference) noexcept {
    if constexpr (std::is_same_v<Given, S>) {  // a number that need not lie in memory
      return detail::Asked{[this, reference](bool special) ESOKIT_INLINE_LAMBDA {
                             return special ? judged(reference) : command(reference);
                           },
                           [reference] { return all(is_finite(reference)); }};
    } else {
      return detail::Asked{[this, &reference](bool special) ESOKIT_INLINE_LAMBDA {
                             return special ? judged(reference) : command(reference);
                           },
                           [&reference] {
                             bool good = true;
                             for (int i = 0; i < (error_based ? 1 : order + 1); ++i) {
                               good = good && all(is_finite(reference(i)));
                             }
                             return good;
                           }};
    }
  }
  struct NoSpec {
    constexpr NoSpec() = default;
    constexpr explicit NoSpec(const FeedbackSpec<S>&) {}
  };
  static constexpr bool has_step_time = observer_traits<Observer>.varies_time;
  static constexpr bool wraps = observer_traits<Observer>.wraps_output;

  Adrc(const Loop& loop, const Law& law, const Weights& weights, const Soft& soft,
       const Config& config) noexcept
      : loop_(loop), weights_(weights), law_(law), soft_(soft), spec_(spec(config)) {}

  static FeedbackSpec<S> spec(const Config& config) noexcept {
    return {config.controller_bandwidth, config.domain, config.half_gain};
  }

  static typename Observer::Config observer_config(const Config& config) noexcept {
    auto observer = config.observer;
    // e'' = r'' - d - b0 u.
    if constexpr (error_based)
      chain_config<Observer>(observer).input_gain = -chain_config<Observer>(observer).input_gain;
    return observer;
  }

  /// Changes the step time of the loop, and by it the gains of the sampled domain.
  template <class Change>
  Check<S> with_gains(Change change) noexcept {
    if (!(spec_.domain == TimeDomain::sampled && spec_.bandwidth > S(0))) return change(loop_);
    Loop next = loop_;
    if (auto ok = change(next); !ok) return ok;
    const auto gains = feedback_gain<order, S>(spec_, next.observer().step_time());
    if (!gains) return gains.error();
    const auto law = Law::make({.gains = *gains, .input_gain = law_.input_gain()});
    if (!law) return law.error();
    const auto& limiter = loop_.limiter();
    const auto soft =
        Soft::make(*law, {.lower = limiter.lower(), .upper = limiter.upper()}, soft_.on());
    if (!soft) return soft.error();
    loop_ = next;
    law_ = *law;
    soft_.adopt(*soft);
    return {};
  }

  static Expected<Weights, Error<S>> scaled(const Law& law, const Observer& observer) {
    Weights weights{};
    if constexpr (scales) {
      const S rate = S(1) / observer.sample_time();
      S unit = S(1) / law.input_gain();
      for (int i = 0; i <= order; ++i) {
        if (i > 0) unit = unit * (static_cast<S>(i) * rate);
        const auto row = static_cast<std::size_t>(i);
        weights[row] = i < order ? law.gains()[row] * unit : unit;
        if (!is_finite(weights[row])) {
          return Error<S>{"sample_time", observer.sample_time(),
                          "with these gains gives a law that the scalar cannot hold"};
        }
      }
    }
    return weights;
  }

  static Expected<Law, Error<S>> make_law(const Config& config, const Observer& observer) {
    // With an actuator in the model this is the b of the model, for example b0 / tau.
    const S input_gain = error_based ? S(-observer.input_gain()) : S(observer.input_gain());
    const S sample_time = observer.sample_time();
    if (config.gains) {
      if (config.half_gain) {
        return Error<S>{"half_gain", S(1), "must be left out if gains is given"};
      }
      return Law::make({.controller_bandwidth = config.controller_bandwidth,
                        .gains = config.gains,
                        .input_gain = input_gain});
    }
    const auto gains = feedback_gain<order, S>(spec(config), sample_time);
    if (!gains) return gains.error();
    return Law::make({.gains = *gains, .input_gain = input_gain});
  }

  /// The measurement for the observer.
  [[nodiscard]] ESOKIT_INLINE S measured(S y, S reference) const noexcept {
    if constexpr (!error_based) {
      return y;
    } else {
      S e = reference - y;
#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
      // If reference and y are the same variable, a compiler may replace their difference by zero
      // even for NaN.
      e = select(is_finite(y), e, y);
#endif
      return e;
    }
  }

  /// A sample, for a constant and for a moving reference.
  template <class Given>
  ESOKIT_INLINE S stepped(S y, Given reference) noexcept {
    return loop_.step(y, loop_.held(), asked(reference));
  }

  [[nodiscard]] ESOKIT_INLINE S command(S reference) const noexcept {
    if constexpr (scales) {
      // Apart from the first term, so that both are computed in parallel.
      const S rest = detail::weighed_estimates<1, order>(weights_, observer());
      const S x = observer().template scaled_estimate<0>();
      const S u = error_based
                      ? S(weights_[0] * x + rest)
                      : S(weights_[0] * detail::wrapped(observer(), S(reference - x)) - rest);
      return detail::by_present_gain(observer(), u);
    } else {
      return command(Reference(reference).all());
    }
  }

  [[nodiscard]] S command(typename Reference::All reference) const noexcept {
    const auto estimate = observer().estimate();
    if constexpr (error_based) {
      return detail::by_present_gain(observer(), law_.control_error_based(estimate));
    } else {
      if constexpr (wraps) {
        reference(0) = estimate(0) + observer().wrap(reference(0) - estimate(0));
      }
      return detail::by_present_gain(observer(), law_.control(estimate, reference));
    }
  }

  /// The differences of which the law is the sum.
  [[nodiscard]] typename Reference::All lacks(const Reference& reference) const noexcept {
    const auto estimate = observer().estimate();
    typename Reference::All e;
    for (int i = 0; i <= order; ++i) {
      e(i) = error_based ? S(estimate(i)) : S(reference(i) - estimate(i));
    }
    if (!error_based) e(0) = detail::wrapped(observer(), S(e(0)));
    return e;
  }

  /// u by the softened law, which is judged by it.
  template <class Given>
  [[nodiscard]] ESOKIT_COLD S judged(Given given) noexcept {
    S u = command(given);
    if (all(!soft_.on())) return u;
    u = eased(u, given);
    judge(detail::input_for(observer(), u));
    return u;
  }

  /// By the softened law. @param u by the one as designed
  template <class Given>
  [[nodiscard]] ESOKIT_INLINE S eased(const S& u, const Given& given) const noexcept {
    const auto designed = soft_.slowness() <= S(1.0);
    if (!records<S> && all(designed)) return u;
    const S less = soft_.control(law_, lacks(given));
    return select(designed, u, detail::by_present_gain(observer(), less));
  }

  /// @param u asked of the actuator
  ESOKIT_INLINE void judge(const S& u) noexcept { soft_.judge(u, loop_.limiter(), step_time()); }

  /// For packs, see ControlLoop.
  /// @{
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) ESOKIT_INLINE bool advance() noexcept {
    return loop_.advance();
  }
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>)  //
      ESOKIT_INLINE bool step(S& u, S y, const Reference& reference) noexcept {
    y = measured(y, reference(0));
    return reference.moves() ? loop_.step_all(u, y, asked(reference.all()))
                             : loop_.step_all(u, y, asked(reference(0)));
  }
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) S update_advanced(S y, const Reference& reference)
  noexcept {
    y = measured(y, reference(0));
    return reference.moves() ? loop_.template step<true>(y, loop_.held(), asked(reference.all()))
                             : loop_.template step<true>(y, loop_.held(), asked(reference(0)));
  }
  /// @}

  [[nodiscard]] S step_time() const noexcept {
    if constexpr (has_step_time) {
      return observer().step_time();
    } else {
      return sample_time();
    }
  }

  Loop loop_;
  [[no_unique_address]] Weights weights_;
  Law law_;
  Soft soft_;
  [[no_unique_address]] std::conditional_t<has_step_time, FeedbackSpec<S>, NoSpec> spec_;
};

/// Distinguishes the type in snapshots.
template <class Observer, class Form>
inline constexpr std::uint32_t type_tag<Adrc<Observer, Form>> =
    make_type_tag<Observer, Form>("Adrc");

}  // namespace esokit
