/// @file
/// WrappedOutput: an observer of an angle, whose measurement jumps by a period.
#pragma once

#include <cmath>
#include <esokit/core/type_tag.hpp>
#include <esokit/observer/loop_observer.hpp>

namespace esokit {

/// Takes the innovation to the nearest period, so a measurement in any branch (0..2 pi, -180..180)
/// may be fed as it comes, and keeps z_1 within half a period of zero, so that float stays exact
/// after many turns.
template <LoopObserver Observer>
class WrappedOutput : public Observer {
  using S = typename Observer::scalar_type;

 public:
  /// Settings of make.
  struct Config {
    typename Observer::Config observer{};  ///< of the observer itself
    S period{};                            ///< of y, in its unit: 2 pi, 360
  };

  /// Checks the settings and does all the design work.
  /// @return the observer at rest in zero, or an error that names the field
  static Expected<WrappedOutput, Error<S>> make(const Config& config) {
    if (auto ok = check_positive("period", config.period); !ok) return ok.error();
    if (auto ok = check_representable("period", config.period, S(S(1) / config.period),
                                      "has an inverse that the scalar cannot hold");
        !ok) {
      return ok.error();
    }
    auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    return WrappedOutput(*observer, config.period);
  }

  /// New settings while running: the estimate is kept. A refused config changes nothing.
  Check<S> retune(const Config& config) {
    auto fresh = make(config);
    if (!fresh) return fresh.error();
    if (auto ok = Observer::retune(config.observer); !ok) return ok;
    period_ = fresh->period_;
    inverse_period_ = fresh->inverse_period_;
    return {};
  }

  /// One sample, see PredictorCorrector::update. @param y in any branch
  StepStatus update(S y, S u_applied) noexcept {
    const StepStatus predicted = predict(u_applied);
    return predicted | correct(y);
  }

  /// Time update alone, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    const StepStatus status = Observer::predict(u_applied);
    recentre();
    return status;
  }

  /// Measurement update alone. @param y in any branch
  StepStatus correct(S y) noexcept {
    // The innovation is that of level 1, whose z_1 the correction will subtract.
    const S predicted = Observer::level_estimate(0)(0);
    const StepStatus status = Observer::correct(predicted + wrap(y - predicted));
    recentre();
    return status;
  }

  /// Starts anew at (y, 0, .., 0), y taken to the nearest period around zero.
  StepStatus reset(S y) noexcept {
    const StepStatus status = Observer::reset(y);
    recentre();
    return status;
  }

  /// Starts anew at a given estimate, N x 1.
  StepStatus reset(const typename Observer::Estimate& state) noexcept {
    const StepStatus status = Observer::reset(state);
    recentre();
    return status;
  }

  /// The difference `angle` to the nearest whole period, in -period/2 .. period/2.
  [[nodiscard]] S wrap(const S& angle) const noexcept {
    return angle - period_ * std::round(angle * inverse_period_);
  }

  /// Of y, in its unit.
  [[nodiscard]] const S& period() const noexcept { return period_; }

 private:
  WrappedOutput(const Observer& observer, const S& period) noexcept
      : Observer(observer), period_(period), inverse_period_(S(1) / period) {}

  void recentre() noexcept {
    const S turns = std::round(Observer::level_estimate(Observer::levels - 1)(0) * inverse_period_);
    if (turns < S(0) || turns > S(0)) [[unlikely]]
      Observer::shift_output(-(turns * period_));
  }

  S period_;
  S inverse_period_;
};

/// Told apart in snapshots.
template <LoopObserver Observer>
inline constexpr std::uint32_t type_tag<WrappedOutput<Observer>> =
    make_type_tag<Observer>("WrappedOutput");

}  // namespace esokit
