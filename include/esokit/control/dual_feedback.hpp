/// @file
/// The minimum-footprint forms of linear ADRC by G. Herbst (see control/filter_form.hpp): one
/// filter of order N = n + m in place of observer and law.
#pragma once

#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/filter_form.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/kernels.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/gain/feedback_gain.hpp>
#include <esokit/gain/placement.hpp>
#include <esokit/gain/step_status.hpp>
#include <limits>
#include <optional>
#include <type_traits>

namespace esokit {

/// The filter is computed in z^-1, as in the literature. This loses a factor of 1/(1-rho)^N in
/// accuracy; configs that leave fewer than three digits are refused.
struct ShiftOperator {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<ShiftOperator> = make_type_tag<>("ShiftOperator");

/// The filter is computed in delta = z - 1: N more additions, but no digits are lost for any
/// omega_o T.
struct DeltaOperator {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<DeltaOperator> = make_type_tag<>("DeltaOperator");

/// The limited u is fed back to the filter: the dual-feedback form.
struct LimitedFeedback {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<LimitedFeedback> = make_type_tag<>("LimitedFeedback");
/// The filter's own output, before the limits, is fed back: the transfer-function form.
struct UnlimitedFeedback {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<UnlimitedFeedback> = make_type_tag<>("UnlimitedFeedback");

/// Linear ADRC (LinearEso and law with constant gains) as one filter with feedback of y and of the
/// limited u. At sample k, where u is at first the applied u[k-1]:
///
///     s_i = p_i - m_i u,  c = s_1 - n_0 y,
///     u <- limited(c + k_r r),  p_i <- s_(i+1) - n_i y - d_i c
///
/// (with DeltaOperator p_i also gets + s_i). The output equals that of Adrc<LinearEso> in every
/// sample, limited or not. Operations for N = n + m: 3 N + 2 multiplications, 3 N + 1 additions
/// (DeltaOperator: 4 N + 1), N additions for the test that all is finite, and the limits; memory: 3
/// N + 2 coefficients and N states. For n = 2, m = 1: 11 multiplications, 10 (13) and 3 additions,
/// 11 coefficients and 3 states.
///
/// A filter has no prediction: a bad measurement is replaced by the last good one and reported. If
/// samples may be lost, use Adrc.
///
/// With UnlimitedFeedback it is the transfer-function form: the same while u is within its limits,
/// but at a limit its m integrators wind up. Use it only for actuators that never saturate.
template <int Order, Scalar S = double, int Extension = 1, class Operator = ShiftOperator,
          class Feedback = LimitedFeedback, class Placement = EqualPoles>
class DualFeedbackAdrc {
 public:
  static constexpr int order = Order;             ///< n, order of the plant
  static constexpr int size = Order + Extension;  ///< N = n + m
  using scalar_type = S;                          ///< type of signals and settings

  /// Give `controller_bandwidth` or `gains`, not both.
  struct Config {
    typename Placement::template Spec<size, S> observer_bandwidth{};  ///< omega_o, rad/s, or poles
    S controller_bandwidth{};                                         ///< omega_c, rad/s
    std::optional<Array<S, Order>> gains{};                           ///< k_0 .. k_(n-1)
    TimeDomain domain = TimeDomain::continuous;  ///< where the controller's poles are placed
    bool half_gain = false;                      ///< half-gain tuning of the controller
    S input_gain{};                              ///< b0, not zero, negative is fine
    S sample_time{};                             ///< T, s
    Limits<S> limits{};                          ///< of the actuator
  };
  using Status = StatusOf<S>;  ///< StepStatus, for a pack one per lane
  template <class T>
  using with_scalar = DualFeedbackAdrc<Order, T, Extension, Operator, Feedback,
                                       Placement>;  ///< the same with another scalar

  /// Checks the settings and does all the design work.
  /// @return the controller at rest at zero, or an error that names the field
  static Expected<DualFeedbackAdrc, Error<S>> make(const Config& config) {
    detail::refuse_packs<S>();
    Rules<S> rules;
    if (!rules.nonzero("input_gain", config.input_gain)) return rules.error();
    const auto limiter = Limiter<S>::make(config.limits, config.sample_time);
    if (!limiter) return limiter.error();
    rules.all_of(
        Placement::template check<size, S>("observer_bandwidth", config.observer_bandwidth));
    if (!rules) return rules.error();
    const auto gains = controller_gains(config);
    if (!gains) return gains.error();
    const auto poles =
        Placement::template sample<size, S>(config.observer_bandwidth, config.sample_time);
    Form form = delta_form<Order, size, S>(poles, *gains, config.input_gain, config.sample_time);
    const S bandwidth = Placement::template representative<size, S>(config.observer_bandwidth);
    // The last coefficient of D is prod(1 - rho_i), the smallest for slow poles.
    rules.representable("observer_bandwidth", bandwidth, form.denominator[size],
                        "times sample_time gives a filter the scalar cannot hold");
    for (const S& coefficient : form.measurement) {
      rules.require(is_finite(coefficient), "sample_time", config.sample_time,
                    "gives a filter that the scalar cannot hold");
    }
    if constexpr (!delta) {
      const S unit = S(100) * detail::rounding<S>();
      rules.require(unit < static_cast<S>(1e-3) * form.denominator[size], "observer_bandwidth",
                    bandwidth, "times sample_time leaves too few digits in z; use DeltaOperator");
      form = shift_form<size, S>(form);
    }
    if (!rules) return rules.error();
    return DualFeedbackAdrc(form, *limiter);
  }

  /// One sample. @param y measurement @param reference r
  /// @return u to be held until the next sample, within the limits
  S update(S y, S reference) noexcept {
    S u{};
    if (!step(u, y, reference)) [[unlikely]] {
      if constexpr (!records<S>) return update_guarded(y, reference);
    }
    return u;
  }

  /// What the actuator held since the last sample, if it was not the last output: say it before
  /// `update`. The transfer-function form uses it only for the rate limit. A u that is not finite
  /// changes nothing. @{
  void applied(S u) noexcept { limiter_.track(select(is_finite(u), u, limiter_.last())); }
  S update(S y, S reference, S u) = delete;  // call applied(u) before update
  /// @}

  /// Takes over a plant at rest at y under u, with the reference at y, too. A y or u that is not
  /// finite changes nothing and is reported.
  Status start(S y, S u) noexcept {
    const S c = u - form_.reference * y;
    States state{};
    if constexpr (delta) {
      state[0] = c + form_.measurement[0] * y;
      for (std::size_t i = 1; i < size; ++i) state[i] = inflow(i, y, c) + form_.input[i] * u;
    } else {
      for (std::size_t i = size; i >= 1; --i) {
        state[i - 1] = (i < size ? state[i] : S(0)) - inflow(i, y, c) - form_.input[i] * u;
      }
    }
    S sum = u;
    for (std::size_t i = 0; i < size; ++i) {
      state[i] = state[i] + form_.input[i + 1] * u;
      sum = sum + state[i];
    }
    if (!all(is_finite(sum))) return StepStatus::state_rejected;
    pending_ = state;
    measured_ = y;
    wanted_ = u;
    limiter_.track(u);
    return StepStatus::ok;
  }

  /// New settings while running: restarts in the steady state for the last measurement and u,
  /// because the state of one filter is meaningless for another. At rest u does not jump. A refused
  /// config changes nothing; one whose steady state overflows is refused, too.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`: without design work, so it may
  /// run in an interrupt.
  Check<S> adopt(DualFeedbackAdrc fresh) {
    if (fresh.start(measured_, output()) != StepStatus::ok) {
      return Error<S>{"measurement", measured_,
                      "of the last sample has no steady state that the scalar can hold"};
    }
    fresh.status_ = status_;
    *this = fresh;
    return {};
  }

  /// The present u, within the limits.
  [[nodiscard]] const S& output() const noexcept { return limiter_.last(); }
  /// The u requested by the law, before the limits.
  [[nodiscard]] const S& requested() const noexcept { return wanted_; }
  /// ok, measurement_rejected, or restarted. It restarts in the steady state for y and u if the
  /// state was so large that it could not recover.
  [[nodiscard]] Status status() const noexcept { return status_; }
  /// The filter's coefficients, in z or delta.
  [[nodiscard]] const FilterForm<size, S>& form() const noexcept { return form_; }

 private:
  friend struct detail::LaneAccess;
  template <int OtherOrder, Scalar Other, int OtherExtension, class OtherOperator,
            class OtherFeedback, class OtherPlacement>
  friend class DualFeedbackAdrc;
  static constexpr int data_members = 6;
  using Form = FilterForm<size, S>;
  using States = Array<S, size>;
  static constexpr bool delta = std::is_same_v<Operator, DeltaOperator>;
  static constexpr bool limited = std::is_same_v<Feedback, LimitedFeedback>;

  struct Next {
    States pending;  ///< the next states without the contribution of u
    S control;       ///< c
    S wanted{};
  };

  DualFeedbackAdrc(const Form& form, const Limiter<S>& limiter) noexcept
      : form_(form), limiter_(limiter), wanted_(limiter.last()) {}

  static Expected<Array<S, Order>, Error<S>> controller_gains(const Config& config) {
    if (!config.gains) {
      return feedback_gain<Order, S>({config.controller_bandwidth, config.domain, config.half_gain},
                                     config.sample_time);
    }
    const auto law = AdrcLaw<Order, S>::make({.controller_bandwidth = config.controller_bandwidth,
                                              .gains = config.gains,
                                              .input_gain = config.input_gain});
    if (!law) return law.error();
    return law->gains();
  }

  [[nodiscard]] ESOKIT_INLINE Next next(S y, S u) const noexcept {
    Next step;
    const States state = detail::subtract_scaled<1>(pending_, form_.input, u);
    step.control = state[0] - form_.measurement[0] * y;
    detail::unroll<size>([&](auto i) ESOKIT_INLINE_LAMBDA {
      S z = -(std::get<i + 1>(form_.measurement) * y +
              std::get<i + 1>(form_.denominator) * step.control);
      if constexpr (i + 1 < size) z = z + std::get<i + 1>(state);
      if constexpr (delta) z = z + std::get<i>(state);
      std::get<i>(step.pending) = z;
    });
    return step;
  }

  /// n_i y + d_i c.
  [[nodiscard]] S inflow(std::size_t i, S y, S c) const noexcept {
    return form_.measurement[i] * y + form_.denominator[i] * c;
  }

  /// Finite only if all numbers of the step are finite.
  [[nodiscard]] ESOKIT_INLINE static S probe(const Next& step) noexcept {
    return detail::plus_all(step.wanted, step.pending);
  }

  /// For packs and while all is well: one sample. False, and nothing has changed, otherwise.
  /// @{
  static constexpr bool advance() noexcept { return true; }
  ESOKIT_INLINE bool step(S& u, const S& y, const S& reference) noexcept {
    Next step = next(y, limited ? limiter_.last() : wanted_);
    step.wanted = step.control + form_.reference * reference;
    // States stored one by one and loaded as a pair would stall the next step.
    detail::keep_scalars(step.pending);
    if (!all(is_finite(probe(step)))) [[unlikely]]
      return false;
    pending_ = step.pending;
    measured_ = y;
    wanted_ = step.wanted;
    status_ = StepStatus::ok;
    u = limiter_(step.wanted);
    return true;
  }
  S update_advanced(const S& y, const S& reference) noexcept { return update(y, reference); }
  /// @}

  ESOKIT_COLD S update_guarded(S y, S reference) noexcept {
    const S u = limited ? limiter_.last() : wanted_;
    Next step = next(y, u);
    status_ = StepStatus::ok;
    if (is_finite(probe(step))) {
      measured_ = y;
    } else {
      const Next without = next(measured_, u);
      // The state is the cause if the last measurement would also fail, or if this one is no
      // larger.
      const bool state_is_to_blame =
          is_finite(y) &&
          (!is_finite(probe(without)) || detail::absolute(y) <= detail::absolute(measured_));
      if (state_is_to_blame && start(y, limiter_.last()) == StepStatus::ok) {
        status_ = StepStatus::restarted;
        step = next(y, limiter_.last());
      } else {
        status_ = StepStatus::measurement_rejected;
        step = without;
      }
    }
    if (is_finite(probe(step))) pending_ = step.pending;
    step.wanted = step.control + form_.reference * reference;
    wanted_ = is_finite(step.wanted) ? step.wanted : limiter_.last();
    return limiter_(wanted_);
  }

  Form form_;
  Limiter<S> limiter_;
  States pending_{};
  S measured_ = S(0.0);
  S wanted_;
  Status status_ = StepStatus::ok;
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension, class Operator, class Feedback, class Placement>
inline constexpr std::uint32_t
    type_tag<DualFeedbackAdrc<Order, S, Extension, Operator, Feedback, Placement>> =
        make_type_tag<S, Operator, Feedback, Placement>("DualFeedbackAdrc", Order, Extension);

/// The transfer-function form: winds up if u is limited.
template <int Order, Scalar S = double, int Extension = 1, class Operator = ShiftOperator,
          class Placement = EqualPoles>
using TransferFunctionAdrc =
    DualFeedbackAdrc<Order, S, Extension, Operator, UnlimitedFeedback, Placement>;

}  // namespace esokit
