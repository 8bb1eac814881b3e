/// @file
/// Guarded: holds, gates, bounds or leaks the disturbance estimate, or changes b0, for any observer
/// with a constant gain.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/kernels.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/gain/gating_certificate.hpp>
#include <limits>
#include <type_traits>

namespace esokit {

namespace detail {

struct GuardAccess {
  /// The observer in all adapters.
  template <class O>
  static constexpr auto& innermost(O& o) noexcept {
    using Plain = std::remove_const_t<O>;
    if constexpr (observer_traits<Plain>.adapts) {
      using Base = Adapter<typename Plain::Adapted>;
      using Same = std::conditional_t<std::is_const_v<O>, const Base, Base>;
      return innermost(static_cast<Same&>(o).observer_);
    } else {
      return o;
    }
  }
  /// Its scaled states, level by level.
  template <class O>
  static constexpr auto& states(O& o) noexcept {
    return innermost(o).states_;
  }
  /// Whether all estimates that they stand for are finite.
  template <class O, class States>
  static constexpr bool finite(const O& o, const States& states) noexcept {
    return is_finite(innermost(o).probe(states));
  }
};

}  // namespace detail

/// The unit in which dhat stays the same while b0 changes, and in which its bound is given.
enum class DisturbanceUnit : unsigned char {
  output,  ///< unit of y^(n): a force, which is there whatever b0 is
  input,   ///< unit of u: a bias of the actuator, which b0 multiplies
};

/// The end at which a saturated actuator is, if its output is unknown.
enum class Pin : unsigned char {
  free,    ///< none: it delivers what the observer is told
  upper,   ///< at its upper end: a larger u has no effect
  lower,   ///< at its lower end: a smaller u has no effect
  either,  ///< at the end given by the sign of the last u
};

/// Config of Guarded.
template <LoopObserver Observer>
struct GuardedConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  typename Observer::Config observer{};  ///< of the observer itself
  S disturbance_bound{};  ///< largest abs(dhat); 0: no bound. Unit of y^(n) or u, see `unit`
  DisturbanceUnit unit = DisturbanceUnit::output;  ///< what dhat is counted in
  int release_samples = 0;  ///< measurements after the end of a pin until dhat is free, 0 .. 65000
  S leak_time{};            ///< time constant of the decay of dhat, s; 0: none

  /// @cond
  static constexpr auto fields(auto& c) noexcept {
    return detail::tie(c.observer, c.disturbance_bound, c.unit, c.release_samples, c.leak_time);
  }
  /// @endcond
};

/// Guards of dhat for times when the plant does not follow y^(n) = d + b0 u. Each guard is off by
/// default; while all are off, the estimate is bit for bit that of the observer inside.
///
/// - Trust: `set_trust(phi)`, 0 .. 1, multiplies every correction of dhat; y and its derivatives
///   are corrected as usual.
/// - Held: the plant stands or is carried (on the ground, at a brake, with its output off), so the
///   measurement says nothing about d. The trust is 0, and the observer gets `standing_input()`
///   instead of u, which makes y^(n) zero. `Adrc::hold` does this for one sample; on release start
///   the reference at y.
/// - Pinned: the actuator or a mixer is at an end, and its output is not known (a known output is
///   passed as u_applied and needs no guard). dhat may only move in the direction that frees the
///   actuator: upwards if u is at its upper end and b0 > 0. It is free again `release_samples`
///   measurements after the end of the pin; there is no time-out during the pin, because it would
///   only restore the fault. Use it if the output is unrelated to u: if half of u still gets
///   through, dhat compensates the other half, and holding it does more harm than good
///   (examples/guards).
/// - Bound: abs(dhat) <= disturbance_bound, after the correction and before the prediction, at
///   every level of a cascade. A load above it causes a steady error; `bounded()` reports it. With
///   m > 1 a slope of the estimate that would lead out of the bound is set to zero.
/// - Leak: each correction multiplies dhat by exp(-T / leak_time), whatever the trust is, so that a
///   dhat found under other circumstances fades. This removes the integral action: a constant load
///   leaves a steady error, `leak_error()` of the estimate and `Adrc::leak_error()` of y.
/// - A changing b0: `set_input_gain(b)` before a sample, without design work. In Adrc and
///   DisturbanceCompensator the law follows.
///
/// The first three multiply the correction of dhat by a phi in [0, 1], which may change at every
/// sample; so does a bound, with m = 1, while the true d is within it. Errors stay bounded, and
/// decay while the trust returns, if Re G > -1 on the unit circle, where G is the transfer function
/// from the correction of dhat to its innovation (circle criterion). `make` checks this for each
/// level and refuses a level that fails; all poles in one place pass at any bandwidth (tested to n
/// = 5, omega_o T = 20): min Re G is -1/4 (n = 1), -1/3 (n = 2), -3/8 (n = 3) for fast sampling,
/// and never below -1/2. The check includes the leak. With m > 1 a frozen slope would run on, and
/// for VariableTime no gain is known: for these only the bound and b0 are available.
///
/// For constant gains on the chain, as the outermost adapter. Not with KnownModel, because the
/// proof does not cover fbar.
template <LoopObserver Observer>
class Guarded : public NamedAdapter<Guarded<Observer>, Observer, GuardedConfig<Observer>> {
  static_assert(observer_traits<Observer>.bears_guards,
                "esokit: Guarded is proven for constant gains on the chain of integrators: "
                "LinearEso, CascadeEso and adapters of them, without KnownModel");
  using Base = NamedAdapter<Guarded, Observer, GuardedConfig<Observer>>;
  friend Base;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  static constexpr int n = Observer::order;

 public:
  using Base::levels;
  using Base::size;
  using typename Base::Config;
  using typename Base::Estimate;

  /// Corrections of dhat may be scaled: trust, pin and hold.
  static constexpr bool gates = size == n + 1 && !observer_traits<Observer>.varies_time;

  /// What it declares beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.acts_by_gain = false;  // by what b0 is now, too
    traits.schedules_input_gain = true;
    traits.gates_disturbance = gates;
    return traits;
  }();

  /// Checks the settings and does all the design work.
  /// @return the observer at rest in zero, nothing pinned, full trust; or an error that names the
  /// field, `level` with its number where the circle criterion fails
  static Expected<Guarded, Error<S>> make(const Config& config) {
    const auto made = Base::make(config);
    if (!made) return made.error();
    if constexpr (gates) {
      for (int level = 0; level < levels; ++level) {
        if (!gating_certified<size, S>(made->level_gain(level), made->leak_)) {
          return Error<S>{"level", static_cast<S>(level),
                          "has a gain that is not proven stable while corrections of dhat are "
                          "scaled (Re G > -1)"};
        }
      }
    }
    return *made;
  }

  /// Takes over the settings of `fresh`, as returned by `make`, without design work. As with
  /// `retune`, trust, pin and the ratio of the present b0 to that of the config are kept.
  Check<S> adopt(const Guarded& fresh) {
    if (auto ok = observer_.adopt(fresh.observer_); !ok) return ok;
    bound_ = fresh.bound_;
    unit_ = fresh.unit_;
    release_samples_ = fresh.release_samples_;
    inverse_gain_ = fresh.inverse_gain_;
    leak_ = fresh.leak_;
    set_weights();
    set_limit();
    keep_bound();
    return {};
  }

  /// One sample, see PredictorCorrector::update.
  StepStatus update(S y, S u_applied) noexcept {
    const Found before = found();
    const StepStatus status = observer_.update(y, S(u_applied * told_ratio_));
    told_ratio_ = gain_ratio_;
    keep_guards(before, status);
    return status;
  }

  /// Time update alone, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    const StepStatus status = observer_.predict(S(u_applied * told_ratio_));
    told_ratio_ = gain_ratio_;
    return status;
  }

  /// Measurement update alone, see PredictorCorrector::correct.
  StepStatus correct(S y) noexcept {
    const Found before = found();
    const StepStatus status = observer_.correct(y);
    keep_guards(before, status);
    return status;
  }

  /// Restarts at (y, 0, .., 0). Trust, pin and b0 stay what they are.
  StepStatus reset(S y) noexcept { return observer_.reset(y); }

  /// Restarts at a given estimate, N x 1, its dhat within the bound.
  StepStatus reset(const Estimate& state) noexcept {
    const StepStatus status = observer_.reset(state);
    if (status == StepStatus::ok) keep_bound();
    return status;
  }

  /// From the next correction on, corrections of dhat are multiplied by `phi`, 0 .. 1. A smaller or
  /// larger phi counts as 0 or 1, one that is not finite changes nothing.
  void set_trust(const S& phi) noexcept requires gates {
    if (!is_finite(phi)) return;
    trust_ = phi < S(0) ? S(0) : phi < S(1) ? phi : S(1);
    set_weights();
  }

  /// States where the actuator is, from the next correction on; call it once or at every sample.
  void set_pin(Pin where) noexcept requires gates {
    if (where == Pin::either) {
      const S u = applied_input();
      side_ = u > S(0) ? side_at_upper() : u < S(0) ? -side_at_upper() : 0;
    } else if (where != Pin::free) {
      side_ = where == Pin::upper ? side_at_upper() : -side_at_upper();
    }
    if (where != Pin::free) {
      release_left_ = 0;
    } else if (pin_ != Pin::free) {
      release_left_ = release_samples_;
    }
    pin_ = where;
    set_weights();
  }

  /// The u under which the plant would stand if d were dhat. While the plant is held, with a trust
  /// of 0, it is given instead of u.
  [[nodiscard]] S standing_input() const noexcept requires gates {
    const S u = -observer_.total_disturbance() * (inverse_gain_ * input_factor_);
    return is_finite(u) ? u : applied_input();
  }

  /// b0 from the coming sample on: it applies to the law's next answer, and to the u given one
  /// sample later, which is that answer. dhat is kept in its unit, see DisturbanceUnit.
  /// @return error for a b that is not finite, has not the sign of the config's input_gain, or is
  /// too far from it for the scalar: nothing changes
  Check<S> set_input_gain(const S& b) noexcept {
    const S ratio = b * inverse_gain_;
    const S factor = S(1) / ratio;
    if (!is_finite(b) || !is_finite(ratio) || !is_finite(factor) || !(ratio > S(0))) {
      return Error<S>{"input_gain",
                      b,
                      "must be finite, not zero, and have the sign of the config's",
                      -1,
                      observer_.input_gain(),
                      true};
    }
    if (unit_ == DisturbanceUnit::input) {
      const S change = ratio * input_factor_;
      auto scaled = detail::GuardAccess::states(observer_);
      for (auto& level : scaled) {
        for (std::size_t r = n; r < size; ++r) level[r] = level[r] * change;
      }
      if (!detail::GuardAccess::finite(observer_, scaled)) {
        return Error<S>{"input_gain", b, "would make the estimate not finite"};
      }
      detail::GuardAccess::states(observer_) = scaled;
    }
    gain_ratio_ = ratio;
    input_factor_ = factor;
    set_limit();
    keep_bound();
    return {};
  }

  /// phi.
  [[nodiscard]] const S& trust() const noexcept { return trust_; }
  /// The end given to `set_pin`.
  [[nodiscard]] Pin pin() const noexcept { return pin_; }
  /// True if something scales the next correction of dhat: less than full trust, a pin or its
  /// release.
  [[nodiscard]] bool gated() const noexcept { return gated_; }
  /// True if dhat is at its bound.
  [[nodiscard]] bool bounded() const noexcept {
    constexpr S rounding = S(1) - S(8) * std::numeric_limits<S>::epsilon();
    return reaches(limit() * rounding);
  }
  /// The steady error x - xhat that the leak causes, with constant y and a constant d = 1 (unit of
  /// y^(n)); zero without a leak. N x 1, (y, .., d).
  [[nodiscard]] Estimate leak_error() const noexcept requires gates {
    if (!(leak_ > S(0))) return Estimate::Zero();
    const auto& model = detail::GuardAccess::innermost(observer_).model();
    // What is found is (1 - leak) / leak of what the levels correct.
    const S kept = (S(1) - leak_) / leak_;
    S left = model.scaled_disturbance(S(1));
    Array<S, size> error{};
    for (int level = 0; level < levels; ++level) {
      const auto k = observer_.level_gain(level);
      // A state stands: what the rows below add to it in a step is what its correction takes.
      const S share = std::get<n - 1>(k) / static_cast<S>(n);
      const S innovation = left / (share + kept * std::get<n>(k));
      left = share * innovation;
      error[n] = left;
      for (int i = n - 2; i >= 0; --i) {
        S sum = k[static_cast<std::size_t>(i)] * innovation;
        for (int j = i + 2; j <= n; ++j) {
          sum = sum - static_cast<S>(binomial(j, i)) * error[static_cast<std::size_t>(j)];
        }
        error[static_cast<std::size_t>(i + 1)] = sum / static_cast<S>(i + 1);
      }
      // A level sees the corrected y of the one before.
      error[0] = error[0] + (S(1) - k[0]) * innovation;
    }
    return model.physical(error);
  }

  /// b0 of now.
  [[nodiscard]] S present_input_gain() const noexcept {
    return observer_.input_gain() * gain_ratio_;
  }
  /// b0 of the config over the present b0: the factor for a law that divides by the first.
  [[nodiscard]] const S& input_factor() const noexcept { return input_factor_; }

  /// Adds `offset` to dhat, within the bound, see PredictorCorrector.
  StepStatus shift_disturbance(const S& offset) noexcept requires ShiftableDisturbance<Observer> {
    const StepStatus status = observer_.shift_disturbance(offset);
    if (status == StepStatus::ok) keep_bound();
    return status;
  }

  /// Input that the last prediction used, by the b0 of now.
  [[nodiscard]] S applied_input() const noexcept {
    return detail::clipped(S(observer_.applied_input() * input_factor_));
  }
  /// The estimate of a plant that stands at y under u.
  [[nodiscard]] Estimate rest(const S& y, const S& u) const noexcept {
    return observer_.rest(y, S(u * gain_ratio_));
  }
  /// Sets the state as if `u` had been applied for a long time.
  void fill_input(const S& u) noexcept requires(observer_traits<Observer>.delays_input) {
    observer_.fill_input(S(u * gain_ratio_));
  }
  /// The actuator held `u_applied`, see PredictorCorrector.
  StepStatus revise_input(const S& u_applied) noexcept requires requires(Observer& o, const S& s) {
    o.revise_input(s);
  }
  { return observer_.revise_input(S(u_applied * gain_ratio_)); }
  /// It would pass the gates.
  StepStatus correct_weighted(const S&, const S&) noexcept = delete;

 private:
  Guarded(const Observer& observer, const Config& config) noexcept
      : Base(observer),
        bound_(config.disturbance_bound),
        inverse_gain_(S(1) / observer.input_gain()),
        leak_(leak_of(config)),
        unit_(config.unit),
        release_samples_(static_cast<std::uint16_t>(config.release_samples)) {
    set_weights();
    set_limit();
  }

  static Check<S> check(const Config& config) {
    return Rules<S>{}
        .invertible("input_gain", chain_config<Observer>(config.observer).input_gain)
        .not_negative("disturbance_bound", config.disturbance_bound)
        .require(0 <= config.release_samples && config.release_samples <= 65000, "release_samples",
                 static_cast<S>(config.release_samples), "must be 0 .. 65000")
        .not_negative("leak_time", config.leak_time)
        .require(gates || !(config.leak_time > S(0)), "leak_time", config.leak_time,
                 "must be 0 with an extension above 1 or a varying sample time")
        .require(!(config.leak_time > S(0)) || leak_of(config) >= std::numeric_limits<S>::epsilon(),
                 "leak_time", config.leak_time,
                 "is so long that a sample changes nothing the scalar can hold");
  }

  /// The part of dhat that goes after each correction.
  static S leak_of(const Config& config) {
    if (!(config.leak_time > S(0))) return S(0);
    return -std::expm1(-chain_config<Observer>(config.observer).sample_time / config.leak_time);
  }

  /// The disturbance states, level by level.
  using Found = Array<S, Base::levels>;
  [[nodiscard]] ESOKIT_INLINE Found found() const noexcept {
    Found all;
    const auto& states = detail::GuardAccess::states(observer_);
    detail::unroll<levels>([&](auto level) ESOKIT_INLINE_LAMBDA {
      std::get<level>(all) = std::get<n>(std::get<level>(states));
    });
    return all;
  }

  /// After a correction. @param before what was found before it: no prediction changes it (m = 1)
  ESOKIT_INLINE void keep_guards(const Found& before, StepStatus status) noexcept {
    if constexpr (gates) {
      if (acts_) [[unlikely]] {
        // What starts anew knows nothing of what was before.
        if (gated_ && !has(status, StepStatus::restarted)) gate(before);
        if (!has(status, StepStatus::measurement_rejected | StepStatus::outlier_rejected)) {
          for (auto& level : detail::GuardAccess::states(observer_)) {
            level[n] = level[n] - leak_ * level[n];
          }
        }
        if (release_left_ > 0 && --release_left_ == 0) set_weights();
      }
    }
    if (beyond_bound()) [[unlikely]]
      keep_bound();
  }

  /// Takes back what of the correction does not count.
  ESOKIT_INLINE void gate(const Found& before) noexcept {
    auto& states = detail::GuardAccess::states(observer_);
    detail::unroll<levels>([&](auto level) ESOKIT_INLINE_LAMBDA {
      S& d = std::get<n>(std::get<level>(states));
      const S moved = d - std::get<level>(before);
      d = std::get<level>(before) + (moved > S(0) ? weight_up_ : weight_down_) * moved;
    });
  }

  ESOKIT_COLD void set_weights() noexcept {
    const bool one_sided = pin_ != Pin::free || release_left_ > 0;
    weight_up_ = one_sided && side_ <= 0 ? S(0) : trust_;
    weight_down_ = one_sided && side_ >= 0 ? S(0) : trust_;
    gated_ = one_sided || trust_ < S(1);
    acts_ = gated_ || leak_ > S(0);
  }

  /// Sign of the corrections of dhat that bring u down.
  [[nodiscard]] signed char side_at_upper() const noexcept {
    return observer_.input_gain() > S(0) ? 1 : -1;
  }

  void set_limit() noexcept {
    const S most = (std::numeric_limits<S>::max)();
    S bound = bound_;
    if (unit_ == DisturbanceUnit::input) {
      bound = bound * detail::absolute(S(observer_.input_gain() * gain_ratio_));
    }
    bound_in_force_ = bound > S(0) && is_finite(bound) ? bound : most;
    limit_ = scaled_limit();
  }

  [[nodiscard]] S scaled_limit() const noexcept {
    const S most = (std::numeric_limits<S>::max)();
    const S scaled =
        detail::GuardAccess::innermost(observer_).model().scaled_disturbance(bound_in_force_);
    return bound_in_force_ < most && is_finite(scaled) ? scaled : most;
  }

  /// The bound in the scaling of the states.
  [[nodiscard]] S limit() const noexcept {
    if constexpr (observer_traits<Observer>.varies_time) {
      return scaled_limit();
    } else {
      return limit_;
    }
  }

  [[nodiscard]] ESOKIT_INLINE bool beyond_bound() const noexcept {
    const S most = limit();
    const auto& states = detail::GuardAccess::states(observer_);
    S sum = std::get<n>(std::get<0>(states));
    bool beyond = detail::absolute(sum) > most;
    detail::unroll<levels - 1>([&](auto below) ESOKIT_INLINE_LAMBDA {
      sum = sum + std::get<n>(std::get<below + 1>(states));
      beyond = beyond || detail::absolute(sum) > most;
    });
    return beyond;
  }

  [[nodiscard]] bool reaches(const S& most) const noexcept {
    S sum{};
    for (const auto& level : detail::GuardAccess::states(observer_)) {
      sum = sum + level[n];
      if (!(detail::absolute(sum) < most)) return true;
    }
    return false;
  }

  /// What each level, with those below it, has found is within the bound.
  ESOKIT_COLD void keep_bound() noexcept {
    const S most = limit();
    S below{};
    for (auto& level : detail::GuardAccess::states(observer_)) {
      const S sum = below + level[n];
      if (detail::absolute(sum) > most) {
        const S end = sum > S(0) ? most : S(-most);
        level[n] = end - below;
        if constexpr (size > n + 1) {
          // The slope of all levels so far is not told apart: that of this one must not lead out.
          if (level[n + 1] * end > S(0)) {
            for (std::size_t r = n + 1; r < size; ++r) level[r] = S(0);
          }
        }
      }
      below = below + level[n];
    }
  }

  S bound_;                ///< as it was given
  S bound_in_force_;       ///< unit of y^(n), at the present b0
  S limit_;                ///< the same, scaled
  S gain_ratio_ = S(1);    ///< b0 of now by that of the config
  S told_ratio_ = S(1);    ///< of the u that is told next: what it was when the law gave it
  S input_factor_ = S(1);  ///< 1 / gain_ratio
  S inverse_gain_;         ///< 1 / b0 of the config
  S leak_;                 ///< part of dhat that goes after each correction
  S trust_ = S(1);
  S weight_up_ = S(1);    ///< what a correction of dhat upwards counts
  S weight_down_ = S(1);  ///< and one downwards
  DisturbanceUnit unit_;
  Pin pin_ = Pin::free;
  signed char side_ = 0;  ///< sign of the corrections that free a pinned actuator; 0: none does
  bool gated_ = false;
  bool acts_ = false;  ///< gated, or leaks: one test in the hot path
  std::uint16_t release_samples_;
  std::uint16_t release_left_ = 0;
};

/// The same for packs, lane by lane.
template <LoopObserver Observer>
requires PackScalar<typename Observer::scalar_type>
class Guarded<Observer> : public PackAdapter<Guarded<Observer>, Guarded<detail::LaneOf<Observer>>,
                                             Observer, GuardedConfig<Observer>> {
 public:
  using Guarded::PackAdapter::PackAdapter;
  template <class T>
  using with_scalar = Guarded<detail::WithScalar<Observer, T>>;  ///< the same with another scalar
};

/// Distinguishes the type in snapshots.
template <LoopObserver Observer>
inline constexpr std::uint32_t type_tag<Guarded<Observer>> = make_type_tag<Observer>("Guarded");

}  // namespace esokit
