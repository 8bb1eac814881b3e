/// @file
/// OutlierGate: treats a finite outlier as a missing sample, for any observer.
#pragma once

#include <cstdint>
#include <esokit/adapter/adapter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>

namespace esokit {

/// Config of OutlierGate.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) struct OutlierGateConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<OutlierGateConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};                       ///< config of the observer
  S threshold{};          ///< innovations up to this are accepted, unit of y; 0: no gate
  S running_factor{};     ///< and those up to this times the running mean of abs(innovation)
                          ///< (0.8 standard deviations if Gaussian); 0: threshold only
  int most_in_a_row = 5;  ///< consecutive outliers that are rejected, 1 .. 65000
};

/// Rejects a measurement whose innovation is too large: the observer only predicts, and the next
/// correction uses the gain for the gap. Without a gate a single y of 1e30 spoils the estimate of a
/// linear observer for ln 1e30 / (omega_o T) samples.
///
/// A measurement is accepted if abs(y - z_1) <= M max(threshold, running_factor m). Here m is the
/// running mean of abs(y - z_1) over about 64 measurements and M the number of sample times since
/// the last correction (D if only every D-th sample has a measurement). The gate never stays shut:
/// after `most_in_a_row` rejected measurements it opens and accepts everything until as many in a
/// row are within the limit. So it follows a true step of y, of any size, after `most_in_a_row`
/// samples, or after longest_gap() if fewer: then the observer restarts. It begins open, also by
/// reset.
///
/// It can be combined with the other adapters; WrappedOutput must be outside, because it determines
/// the turn of y. ExtendedStateFilter has its own gate, which uses the variance of the innovation.
template <class Observer>
requires(detail::bears_a_gate<Observer>()) class OutlierGate
    : public NamedAdapter<OutlierGate<Observer>, Observer, OutlierGateConfig<Observer>> {
  using Base = NamedAdapter<OutlierGate, Observer, OutlierGateConfig<Observer>>;
  friend Base;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  static_assert(!observer_traits<Observer>.wraps_output,
                "esokit: put WrappedOutput around OutlierGate, not inside it");

 public:
  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.rejects_outliers = true;
    return traits;
  }();

  /// One sample, see PredictorCorrector::update; reports `outlier_rejected` if y was rejected.
  StepStatus update(S y, S u_applied) noexcept {
    if (!gated()) return observer_.update(y, u_applied);
    const StepStatus predicted = observer_.predict(u_applied);
    return predicted | correct(y);
  }

  /// Measurement update only.
  StepStatus correct(S y) noexcept {
    if (gated() && !lets_in(y)) return StepStatus::outlier_rejected;
    return observer_.correct(y);
  }

  /// Restarts at (y, 0, .., 0), with the gate open.
  StepStatus reset(S y) noexcept { return open_after(observer_.reset(y)); }

  /// Restarts at a given estimate, N x 1.
  StepStatus reset(const typename Observer::Estimate& state) noexcept {
    return open_after(observer_.reset(state));
  }

  /// The innovation up to which a measurement is accepted if none is missing, unit of y.
  [[nodiscard]] S limit() const noexcept {
    const S running = running_factor_ * mean_;
    return running > threshold_ ? running : threshold_;
  }

  /// True while every measurement is accepted: at the start, and after too many outliers in a row.
  [[nodiscard]] bool open() const noexcept { return open_; }

 private:
  friend struct detail::RecordAccess;
  OutlierGate(const Observer& observer, const OutlierGateConfig<Observer>& config) noexcept
      : Base(observer),
        threshold_(config.threshold),
        running_factor_(config.running_factor),
        most_in_a_row_(static_cast<std::uint16_t>(config.most_in_a_row)) {}

  static Check<S> validate(const OutlierGateConfig<Observer>& config) {
    return Rules<S>{}
        .not_negative("threshold", config.threshold)
        .not_negative("running_factor", config.running_factor)
        .demand(!(config.running_factor > S(0)) || config.threshold > S(0), "threshold",
                config.threshold,
                "must be positive if running_factor is: without noise nothing would pass")
        .demand(1 <= config.most_in_a_row && config.most_in_a_row <= 65000, "most_in_a_row",
                static_cast<S>(config.most_in_a_row), "must be 1 .. 65000");
  }

  void take(const OutlierGate& fresh) noexcept {
    threshold_ = fresh.threshold_;
    running_factor_ = fresh.running_factor_;
    most_in_a_row_ = fresh.most_in_a_row_;
  }

  [[nodiscard]] bool gated() const noexcept { return threshold_ > S(0); }

  [[nodiscard]] S expected() const noexcept {
    if constexpr (observer_traits<Observer>.measures_first_row) {
      return observer_.level_estimate(0)(0);
    } else {
      return observer_.predicted_measurement();
    }
  }

  /// True if y may be used. Also true for a y that is not finite, which `correct` rejects, and for
  /// one that restarts the observer.
  bool lets_in(const S& y) noexcept {
    // The innovation of level 1, as in the correction.
    const S innovation = y - expected();
    if (!is_finite(innovation)) return true;
    if (this->restarts()) {
      set_open(true);
      return true;
    }
    const int samples = this->missed() > 1 ? this->missed() : 1;
    const S distance = detail::absolute(innovation);
    const S most = limit() * static_cast<S>(samples);
    const bool fits = distance <= most;
    if (!fits && !open_ && count_ < most_in_a_row_) {
      ++count_;
      return false;
    }
    // Larger values count as the limit, so that no outlier and no gap widens the gate for long.
    const S counted = distance < limit() ? distance : limit();
    mean_ += (counted - mean_) * static_cast<S>(1.0 / 64);
    if (open_ && fits) {
      if (++count_ >= most_in_a_row_) set_open(false);
    } else {
      set_open(open_ || !fits);
    }
    return true;
  }

  void set_open(bool open) noexcept {
    open_ = open;
    count_ = 0;
  }

  StepStatus open_after(StepStatus status) noexcept {
    if (status == StepStatus::ok) set_open(true);
    return status;
  }

  S threshold_;
  S running_factor_;
  S mean_{};  ///< of abs(innovation)
  std::uint16_t most_in_a_row_;
  std::uint16_t count_ = 0;  ///< consecutive: rejected if closed, within the limit if open
  bool open_ = true;
};

/// Distinguishes the type in snapshots.
template <class Observer>
inline constexpr std::uint32_t type_tag<OutlierGate<Observer>> =
    make_type_tag<Observer>("OutlierGate");

}  // namespace esokit
