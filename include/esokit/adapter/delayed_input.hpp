/// @file
/// DelayedInput: an observer for a plant whose input acts a known number of samples late.
#pragma once

#include <cstdint>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/lanes.hpp>

namespace esokit {

/// Config of DelayedInput.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct DelayedInputConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<DelayedInputConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};                        ///< config of the observer
  int delay = 0;                                               ///< d, samples, 0 .. Capacity
};

/// Passes u[k-d] instead of u[k] to the observer, for a delay of d sample times by bus, drive or
/// computation. So the observer sees each y with the u that caused it, and the delay does not
/// appear as a disturbance.
///
/// The estimate is for the present sample; the effect of inputs that are still in the delay line is
/// not predicted.
/// Packs compute all lanes at once while these agree on d and the place in the delay line.
/// @tparam Capacity largest d of a config; the memory is Capacity + 1 scalars
template <class Observer, int Capacity>
requires(detail::goes_into_a_loop<Observer>()) class DelayedInput
    : public NamedAdapter<DelayedInput<Observer, Capacity>, Observer,
                          DelayedInputConfig<Observer>> {
  using Base = NamedAdapter<DelayedInput, Observer, DelayedInputConfig<Observer>>;
  friend Base;
  friend struct detail::LaneAccess;
  using Base::observer_;
  static_assert(Capacity >= 1, "esokit: a delay line needs a capacity of at least 1");
  using S = typename Observer::scalar_type;
  using StatusType = StatusOf<S>;

 public:
  /// The same with another scalar. Not one that records, as the place in the line changes.
  template <class T>
  requires(Capacity <= 65535 && !records<T> &&
           LoopObserver<detail::WithScalar<Observer, T>>) using with_scalar =
      DelayedInput<detail::WithScalar<Observer, T>, Capacity>;

  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.delays_input = true;
    traits.acts_by_gain = false;
    return traits;
  }();

  /// One sample. @param y measurement @param u_applied u[k], not delayed; the delay is applied here
  StatusType update(S y, S u_applied) noexcept {
    const StepStatus status = push(u_applied);
    return status | observer_.update(y, delayed());
  }

  /// Time update only, see PredictorCorrector::predict.
  StatusType predict(S u_applied) noexcept {
    const StepStatus status = push(u_applied);
    return status | observer_.predict(delayed());
  }

  /// Fills the delay line as if `u` had been applied for a long time. A u that is not finite
  /// changes nothing.
  void fill_input(const S& u) noexcept {
    if (!is_finite(u)) return;
    rest_.inputs.fill(u);
  }

  /// Deleted, because the observer was given the input of d samples ago.
  StepStatus revise_input(const S&) noexcept = delete;

  /// d, samples.
  [[nodiscard]] Lanes<int, S> delay() const noexcept { return rest_.delay; }

 private:
  friend struct detail::RecordAccess;
  static constexpr int length = Capacity + 1;
  static constexpr bool advances = detail::LaneAccess::advances<Observer>;

  DelayedInput(const Observer& observer, const DelayedInputConfig<Observer>& config) noexcept
      : Base(observer) {
    rest_.delay = config.delay;
  }

  static Check<S> validate(const DelayedInputConfig<Observer>& config) {
    return Rules<S>{}.demand(0 <= config.delay && config.delay <= Capacity,
                             {"delay", static_cast<S>(config.delay),
                              "must be 0 up to the capacity of the delay line, which is", -1,
                              static_cast<S>(Capacity), true});
  }

  /// Keeps the inputs in the delay line.
  void take(const DelayedInput& fresh) noexcept { rest_.delay = fresh.rest_.delay; }

  /// Replaces a bad input by the last good one at once, so that it is reported now and not d
  /// samples later.
  StepStatus push(const S& u) noexcept {
    const S last = input(rest_.newest);
    rest_.newest = after(rest_.newest);
    const bool good = is_finite(u);
    input(rest_.newest) = good ? u : last;
    return good ? StepStatus::ok : StepStatus::input_rejected;
  }

  [[nodiscard]] const S& delayed() noexcept { return input(before(rest_.newest, rest_.delay)); }

  /// For packs, see PredictorCorrector. Templates, as an explicit instantiation would ask it of
  /// every observer.
  /// @{
  template <class O = Observer>
  requires(detail::LaneAccess::steps<O>) ESOKIT_INLINE bool advance() noexcept {
    return lanes_agree<O>() && detail::LaneAccess::advance(observer_);
  }
  template <class O = Observer>
  ESOKIT_INLINE bool step(const S& y, const S& u) noexcept {
    return passed<O>(u, [&](const S& acts) ESOKIT_INLINE_LAMBDA {
      return detail::LaneAccess::step(observer_, y, acts);
    });
  }
  template <class O = Observer>
  StatusType update_advanced(const S& y, const S& u) noexcept {
    const StepStatus status = push(u);
    return status | detail::LaneAccess::update_advanced(observer_, y, delayed());
  }
  template <class O = Observer>
  ESOKIT_INLINE bool advance_predict() noexcept {
    return lanes_agree<O>() && detail::LaneAccess::advance_predict(observer_);
  }
  template <class O = Observer>
  ESOKIT_INLINE bool predict_all(const S& u) noexcept {
    return passed<O>(u, [&](const S& acts) ESOKIT_INLINE_LAMBDA {
      return detail::LaneAccess::predict_all(observer_, acts);
    });
  }
  template <class O = Observer>
  StatusType predict_advanced(const S& u) noexcept {
    const StepStatus status = push(u);
    return status | detail::LaneAccess::predict_advanced(observer_, delayed());
  }
  template <class O = Observer>
  ESOKIT_INLINE bool correct_all(const S& y) noexcept {
    return detail::LaneAccess::correct_all(observer_, y);
  }
  /// Whether all lanes are at the same place and have the same delay.
  template <class O>
  [[nodiscard]] ESOKIT_INLINE bool lanes_agree() const noexcept {
    if constexpr (lane_count<S> == 1) {
      return true;
    } else {
      return agree(rest_.newest) && agree(rest_.delay);
    }
  }
  /// A step of the observer with the input of d samples ago; then u is in the line. False, and
  /// nothing has changed, if u is not finite or the step says so.
  template <class O, class Step>
  ESOKIT_INLINE bool passed(const S& u, const Step& observer_step) noexcept {
    if (!all(is_finite(u))) [[unlikely]]
      return false;
    const int delay = detail::of_lane(rest_.delay, 0);
    const int next = after(detail::of_lane(rest_.newest, 0));
    if (!observer_step(delay == 0 ? u : input(before(next, delay)))) [[unlikely]]
      return false;
    detail::assign(input(next), u);
    rest_.newest = static_cast<std::uint16_t>(next);
    return true;
  }
  /// @}

  static constexpr int after(int at) noexcept { return at + 1 == length ? 0 : at + 1; }
  static constexpr int before(int at, int delay) noexcept {
    const int place = at - delay;
    return place < 0 ? place + length : place;
  }
  S& input(int at) noexcept { return rest_.inputs[static_cast<std::size_t>(at)]; }

  /// A place in the line. In packs short, as they ask at every sample whether all lanes agree.
  using Place = Lanes<std::conditional_t<lane_count<S> == 1, int, std::uint16_t>, S>;
  struct Rest {
    Array<S, length> inputs{};
    Place delay{};   ///< d
    Place newest{};  ///< in `inputs`
  };
  Rest rest_;
};

/// Distinguishes the type in snapshots.
template <class Observer, int Capacity>
inline constexpr std::uint32_t type_tag<DelayedInput<Observer, Capacity>> =
    make_type_tag<Observer>("DelayedInput", Capacity);

}  // namespace esokit
