/// @file
/// DelayedInput: an observer for a plant whose input acts a known number of samples late.
#pragma once

#include <esokit/adapter/adapter.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/core/unroll.hpp>

namespace esokit {

/// Config of DelayedInput.
template <LoopObserver Observer>
struct DelayedInputConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  typename Observer::Config observer{};  ///< config of the observer
  int delay = 0;                         ///< d, samples, 0 .. Capacity
};

/// Passes u[k-d] instead of u[k] to the observer (for a delay of d sample times by bus, drive or
/// computation), so that the observer sees each y with the u that caused it, and the delay does not
/// appear as a disturbance.
///
/// The estimate is for the present sample; the effect of inputs that are still in the delay line is
/// not predicted.
/// @tparam Capacity largest d of a config; the memory is Capacity + 1 scalars
template <LoopObserver Observer, int Capacity>
class DelayedInput : public NamedAdapter<DelayedInput<Observer, Capacity>, Observer,
                                         DelayedInputConfig<Observer>> {
  using Base = NamedAdapter<DelayedInput, Observer, DelayedInputConfig<Observer>>;
  friend Base;
  using Base::observer_;
  static_assert(Capacity >= 1, "esokit: a delay line needs a capacity of at least 1");
  using S = typename Observer::scalar_type;

 public:
  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.delays_input = true;
    traits.acts_by_gain = false;
    return traits;
  }();

  /// One sample. @param y measurement @param u_applied u[k], not delayed; the delay is applied here
  StepStatus update(S y, S u_applied) noexcept {
    const StepStatus status = push(u_applied);
    return status | observer_.update(y, delayed());
  }

  /// Time update only, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    const StepStatus status = push(u_applied);
    return status | observer_.predict(delayed());
  }

  /// Fills the delay line as if `u` had been applied for a long time. A u that is not finite
  /// changes nothing.
  void fill_input(const S& u) noexcept {
    if (!is_finite(u)) return;
    inputs_.fill(u);
  }

  /// Deleted, because the observer was given the input of d samples ago.
  StepStatus revise_input(const S&) noexcept = delete;

  /// d, samples.
  [[nodiscard]] int delay() const noexcept { return delay_; }

 private:
  friend struct detail::RecordAccess;
  static constexpr int length = Capacity + 1;

  DelayedInput(const Observer& observer, const DelayedInputConfig<Observer>& config) noexcept
      : Base(observer), delay_(config.delay) {}

  static Check<S> check(const DelayedInputConfig<Observer>& config) {
    return Rules<S>{}.require(0 <= config.delay && config.delay <= Capacity,
                              {"delay", static_cast<S>(config.delay),
                               "must be 0 up to the capacity of the delay line, which is", -1,
                               static_cast<S>(Capacity), true});
  }

  /// Keeps the inputs in the delay line.
  void take(const DelayedInput& fresh) noexcept { delay_ = fresh.delay_; }

  /// Replaces a bad input by the last good one at once, so that it is reported now and not d
  /// samples later.
  StepStatus push(const S& u) noexcept {
    const S last = inputs_[static_cast<std::size_t>(newest_)];
    newest_ = newest_ + 1 == length ? 0 : newest_ + 1;
    const bool good = is_finite(u);
    inputs_[static_cast<std::size_t>(newest_)] = good ? u : last;
    return good ? StepStatus::ok : StepStatus::input_rejected;
  }

  [[nodiscard]] const S& delayed() const noexcept {
    const int at = newest_ - delay_;
    return inputs_[static_cast<std::size_t>(at < 0 ? at + length : at)];
  }

  Array<S, length> inputs_{};
  int delay_;
  int newest_ = 0;
};

/// Distinguishes the type in snapshots.
template <LoopObserver Observer, int Capacity>
inline constexpr std::uint32_t type_tag<DelayedInput<Observer, Capacity>> =
    make_type_tag<Observer>("DelayedInput", Capacity);

}  // namespace esokit
