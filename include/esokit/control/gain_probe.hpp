/// @file
/// GainProbe: adds small steps to the u of a running loop and finds b / b0 from them, under any
/// load.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/control/control_loop.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/expected.hpp>
#include <type_traits>

namespace esokit {

/// Config of GainProbe.
template <PlainScalar S = double>
struct GainProbeConfig {
  [[no_unique_address]] ByName<GainProbeConfig> by_name{};  ///< nothing to set, see ByName
  S observer_bandwidth{};  ///< omega_o, rad/s: magnitude of the observer's poles, or their mean
  S sample_time{};         ///< T, s; omega_o T is at most 1
  S amplitude{};           ///< A, unit of u: several times the u that overcomes friction
  S travel{};              ///< largest abs(y - y0), unit of y; beyond it the probe ends
  int periods = 8;         ///< measured periods, after one to settle; 10 / omega_o each; 6 .. 200
  Limits<S> limits{};      ///< of the actuator: u plus the steps is kept within them
};

/// The result of a probe.
template <PlainScalar S>
struct GainProbeResult {
  S gain_ratio{};  ///< b / b0
  S half_width{};  ///< of the 95 % interval, from the scatter between periods
};

/// Adds steps v of +-A to the u of a loop, and finds b / b0 from their effect:
///
///     b / b0 = 1 + sum w psi / sum w phi,   phi = b0 u, w = v, psi = dhat
///
/// with phi and w filtered by the observer's poles, and phi, psi and w high-passed at omega_o / 3.
/// Both sums are taken twice, with w and with w delayed by a quarter of a period (because the loop
/// shifts the phase of v), and combined by least squares. Load and noise are not correlated with v,
/// so on average they do not affect the result: this distinguishes a b0 that is too large from a
/// load that drives u, which HealthMonitor cannot. Friction that keeps the plant at rest looks like
/// a b0 that is too large.
///
/// After each `loop.update(y, r)`: `applied = probe.update(loop, y)` is the u to be held until the
/// next sample; before the next update tell the loop, `loop.applied(applied)`. After the end or an
/// abort it is the u of the loop.
/// @tparam Size N, number of states of the observer
template <int Size, class S = double>
requires(detail::is_a_plain_scalar<S>()) class GainProbe {
  static_assert(Size >= 2, "esokit: an observer has at least two states");

 public:
  using scalar_type = S;              ///< type of signals and settings
  using Config = GainProbeConfig<S>;  ///< settings of make
  using Result = GainProbeResult<S>;  ///< the result

  /// Checks the settings. @return the probe before its first sample, or an error
  static Expected<GainProbe, Error<S>> make(const Config& config) {
    Rules<S> rules;
    rules.positive("observer_bandwidth", config.observer_bandwidth)
        .positive("sample_time", config.sample_time)
        .positive("amplitude", config.amplitude)
        .positive("travel", config.travel)
        .demand(6 <= config.periods && config.periods <= 200, "periods",
                static_cast<S>(config.periods), "must be 6 .. 200");
    if (!rules) return rules.error();
    const S x = config.observer_bandwidth * config.sample_time;
    rules
        .demand(detail::at_most(x, S(1)), {"observer_bandwidth", config.observer_bandwidth,
                                           "times sample_time must be at most", -1, S(1), true})
        .demand(detail::below(S(S(5) / x), S(1 << 24)), "observer_bandwidth",
                config.observer_bandwidth, "makes half a period longer than 2^24 samples");
    if (!rules) return rules.error();
    const auto limiter = Limiter<S>::make(config.limits, config.sample_time);
    if (!limiter) return limiter.error();
    return GainProbe(config, *limiter);
  }

  /// After each sample of the controller. @param y the measurement that the controller got
  /// @return u to be held until the next sample; then tell the controller by `applied(u)`
  template <class Controller>
  S update(const Controller& controller, const S& y) noexcept {
    const auto& observer = controller.observer();
    using Observer = std::remove_cvref_t<decltype(observer)>;
    static_assert(Observer::size == Size, "esokit: a probe has as many poles as the observer");
    // The rate limit counts from what this returned, not from what the actuator reports.
    if (!started_) limiter_.track(observer.applied_input());
    if (finished()) return limiter_(controller.output());
    const bool runs = controller.mode() == LoopMode::running;
    if (!started_) rest_ = y;
    started_ = true;
    const S away = y - rest_;
    if (!runs || !is_finite(away) || detail::absolute(away) > travel_) {
      aborted_ = true;
      return limiter_(controller.output());
    }
    S b = observer.input_gain();
    if constexpr (observer_traits<Observer>.schedules_input_gain) b = observer.present_input_gain();
    add(b * detail::effect_of(observer, S(observer.applied_input())), observer.total_disturbance());
    if (finished()) return limiter_(controller.output());
    ++phase_;
    if (phase_ == half_samples_ / 2) late_step_ = step_;
    if (phase_ >= half_samples_) {
      phase_ = 0;
      step_ = -step_;
    }
    return limiter_(controller.output() + step_);
  }

  /// True if all periods are measured or the probe was aborted.
  [[nodiscard]] bool finished() const noexcept { return aborted_ || measured_ >= periods_; }
  /// True if y moved further than `travel` or was not finite, or the law did not determine u.
  [[nodiscard]] bool aborted() const noexcept { return aborted_; }

  /// b / b0, once the probe has finished.
  [[nodiscard]] Expected<Result, Error<S>> result() const noexcept {
    if (aborted_ || measured_ < periods_) {
      return Error<S>{"periods", static_cast<S>(measured_),
                      "are too few: not finished, or aborted"};
    }
    const auto& [y0, y1, x0, x1] = sums_;
    const S square = x0 * x0 + x1 * x1;
    const S slope = (x0 * y0 + x1 * y1) / square;
    // Squared contributions of the periods to the slope, summed.
    const Array<S, 4> weights{x0, x1, -slope * x0, -slope * x1};
    S scatter{};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        scatter = scatter + weights[i] * products_[4 * i + j] * weights[j];
      }
    }
    if (!(scatter > S(0))) scatter = S(0);
    const S count = static_cast<S>(periods_);
    // Student's factor for six periods.
    const S half_width = S(2.571f) * std::sqrt(scatter * count / (count - S(1))) / square;
    if (!is_finite(half_width) || !is_finite(slope) || !(square > S(0))) {
      return Error<S>{"amplitude", amplitude_, "does not show in u: the actuator is at its limits"};
    }
    return Result{S(1) + slope, half_width};
  }

 private:
  GainProbe(const Config& config, const Limiter<S>& limiter) noexcept
      : limiter_(limiter),
        amplitude_(config.amplitude),
        travel_(config.travel),
        step_(config.amplitude),
        late_step_(-config.amplitude),
        periods_(config.periods) {
    const S x = config.observer_bandwidth * config.sample_time;
    pole_ = std::exp(-x);
    slow_ = -std::expm1(-x / S(3));
    half_samples_ = static_cast<std::int32_t>((std::round)(S(5) / x));
    // The first step is half as long, so that y oscillates around its start.
    phase_ = half_samples_ / 2;
  }

  /// A signal filtered by the poles, minus its slow mean.
  struct Filtered {
    Array<S, Size> stages{};
    S mean{};
    S operator()(S x, const S& pole, const S& slow) noexcept {
      for (S& stage : stages) {
        stage = x + pole * (stage - x);
        x = stage;
      }
      mean = mean + slow * (x - mean);
      return x - mean;
    }
  };

  void add(const S& drive, const S& disturbance) noexcept {
    // The step that was held since the last sample, and the one a quarter of a period ago, because
    // the loop shifts the phase of v.
    const S first = of_step_(last_step_, pole_, slow_);
    const S second = of_late_step_(last_late_step_, pole_, slow_);
    last_step_ = step_;
    last_late_step_ = late_step_;
    const S x = of_drive_(drive, pole_, slow_);
    slow_disturbance_ = slow_disturbance_ + slow_ * (disturbance - slow_disturbance_);
    const S y = disturbance - slow_disturbance_;
    const Array<S, 4> now{first * y, second * y, first * x, second * x};
    for (std::size_t i = 0; i < 4; ++i) period_[i] = period_[i] + now[i];
    if (++count_ < 2 * half_samples_) return;
    count_ = 0;
    if (settled_) {
      for (std::size_t i = 0; i < 4; ++i) {
        sums_[i] = sums_[i] + period_[i];
        for (std::size_t j = 0; j < 4; ++j) {
          products_[4 * i + j] = products_[4 * i + j] + period_[i] * period_[j];
        }
      }
      ++measured_;
    }
    settled_ = true;
    period_ = {};
  }

  Limiter<S> limiter_;
  S amplitude_, travel_, step_, late_step_;
  S last_step_{}, last_late_step_{};
  S pole_{}, slow_{};
  S rest_{};
  Filtered of_step_{}, of_late_step_{}, of_drive_{};
  S slow_disturbance_{};
  Array<S, 4> period_{}, sums_{};
  Array<S, 16> products_{};
  std::int32_t half_samples_{}, phase_{}, count_ = 0;
  int periods_;
  int measured_ = 0;
  bool started_ = false, settled_ = false, aborted_ = false;
};

/// Distinguishes the type in snapshots.
template <int Size, PlainScalar S>
inline constexpr std::uint32_t type_tag<GainProbe<Size, S>> = make_type_tag<S>("GainProbe", Size);

}  // namespace esokit
