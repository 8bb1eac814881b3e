/// @file
/// How much more delay a loop can take.
#pragma once

#include <esokit/analysis/margins.hpp>

namespace esokit {

namespace detail {

/// Sampled loop gain with any delay of u: whole samples as z^-M, the rest inside a sample.
template <int PlantStates, int ControllerStates>
struct DelayedLoopGain {
  NominalPlant<PlantStates> plant;  ///< continuous
  LinearSystem<ControllerStates, 1, 1> controller;
  mutable std::optional<Error<double>> refused{};  ///< the plant, with some delay

  /// @param fraction of a sample, 0 .. 1
  [[nodiscard]] LoopGain<PlantStates + 1, ControllerStates> with_fraction(double fraction) const {
    const double T = controller.sample_time;
    const auto sampled = sampled_plant(plant, T, fraction * T);
    if (!sampled) {
      refused = sampled.error();
      return {};
    }
    auto late = sampled->template channel<0, 0>();
    balance(late);
    return {late, controller};
  }

  /// log(-L) at a frequency (rad/s) and delay (s): zero where the loop oscillates.
  [[nodiscard]] std::complex<double> log_minus(double frequency, double delay) const {
    const double T = controller.sample_time;
    const double whole = std::floor(delay / T);
    const auto gain = with_fraction(std::clamp(delay / T - whole, 0.0, 1.0));
    return std::log(-gain(frequency) * std::polar(1.0, -frequency * whole * T));
  }
};

/// Newton's method for log(-L) = 0 from a frequency and a delay near by.
template <int PlantStates, int ControllerStates>
std::optional<Margin> refine_delay(const DelayedLoopGain<PlantStates, ControllerStates>& loop,
                                   double frequency, double delay) {
  const double T = loop.controller.sample_time;
  const double nyquist = std::numbers::pi / T;
  for (int i = 0; i < 40; ++i) {
    const std::complex<double> f = loop.log_minus(frequency, delay);
    if (!is_finite(f.real()) || !is_finite(f.imag())) return std::nullopt;
    if (std::abs(f) < 1e-12) return Margin{delay, frequency};
    const double dw = (frequency > 0.5 * nyquist ? -1e-7 : 1e-7) * frequency;
    // Away from the next whole sample, where the slope changes.
    const double position = delay / T - std::floor(delay / T);
    const double dt = (position > 0.5 ? -1e-7 : 1e-7) * T;
    const std::complex<double> by_w = (loop.log_minus(frequency + dw, delay) - f) / dw;
    const std::complex<double> by_t = (loop.log_minus(frequency, delay + dt) - f) / dt;
    const double determinant = by_w.real() * by_t.imag() - by_w.imag() * by_t.real();
    double step_w = -(f.real() * by_t.imag() - f.imag() * by_t.real()) / determinant;
    double step_t = -(by_w.real() * f.imag() - by_w.imag() * f.real()) / determinant;
    if (!is_finite(step_w) || !is_finite(step_t)) return std::nullopt;
    step_w = std::clamp(step_w, -0.2 * frequency, 0.2 * frequency);
    step_t = std::clamp(step_t, -T, T);
    frequency = std::min(frequency + step_w, nyquist);
    delay += step_t;
    if (delay < 0.0) delay = 0.0;
  }
  return std::nullopt;
}

/// Calls visit(w, L) where abs(L) is one.
template <class Response, int Count, class Visit>
void gain_crossings(const Response& response, const ScanRange<Count>& range, Visit&& visit) {
  scan(response, range,
       [&](double w1, std::complex<double> l1, double w2, std::complex<double> l2) {
         if ((std::abs(l1) < 1.0) == (std::abs(l2) < 1.0)) return;
         const double w = bisect([&](double x) { return std::abs(response(x)) - 1.0; }, w1, w2);
         visit(w, response(w));
       });
}

/// Phase lag that turns L to -1, in [0, 2 pi).
inline double lag_to_minus_one(std::complex<double> l) {
  const double lag = std::arg(-l);
  return lag < 0.0 ? lag + 2.0 * std::numbers::pi : lag;
}

}  // namespace detail

/// Least further delay (s) between controller and plant with which a continuous loop oscillates.
/// @return infinity where there is none; error for a loop that is not stable, or is sampled
template <int PlantStates, class Observer>
Expected<Margin, Error<double>> delay_margin(const AdrcLoop<PlantStates, Observer>& loop) {
  if (loop.plant().sampled()) {
    return Error<double>{"plant.sample_time", loop.plant().sample_time,
                         "must be zero here: a sampled loop needs its continuous plant"};
  }
  if (!loop.stable()) {
    return Error<double>{"stability_abscissa", loop.stability_abscissa(),
                         detail::unstable_loop_rule};
  }
  std::optional<Margin> least;
  detail::gain_crossings(detail::loop_gain_of(loop), detail::scan_range(loop),
                         [&](double w, std::complex<double> l) {
                           const double delay = detail::lag_to_minus_one(l) / w;
                           if (!least || delay < least->value) least = Margin{delay, w};
                         });
  return least.value_or(Margin{});
}

/// The same for a sampled loop: the held input reaches the plant later by this time (s), which need
/// not be a whole number of samples.
///
/// Between samples a delay is no mere phase shift e^(-i omega tau): the edge is found on the plant
/// sampled with that delay.
/// @param plant the continuous plant that the loop's was sampled from
/// @param present_delay s, the delay that the loop's plant was sampled with
template <int PlantStates, int SampledStates, class Observer>
Expected<Margin, Error<double>> delay_margin(const AdrcLoop<SampledStates, Observer>& loop,
                                             const NominalPlant<PlantStates>& plant,
                                             double present_delay = 0.0) {
  const double T = loop.plant().sample_time;
  Rules<double> rules;
  rules.require(T > 0.0, "plant.sample_time", T, "must be positive: this is for a sampled loop")
      .not_negative("present_delay", present_delay)
      .and_then([&] { return sampled_plant(plant, T, T); })
      .require(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
               detail::unstable_loop_rule);
  if (!rules) return rules.error();
  const detail::DelayedLoopGain<PlantStates, AdrcLoop<SampledStates, Observer>::observer_states>
      delayed{plant, loop.controller().template channel<0, 0>()};
  const auto range = detail::scan_range(loop);
  const double behind = present_delay * (1.0 + 1e-12) + 1e-12 * T;
  std::optional<Margin> least;
  const auto offer = [&](const Margin& edge) {
    if (edge.value > behind && (!least || edge.value < least->value)) least = edge;
  };

  // Which frequencies cross depends on the fraction of a sample.
  constexpr int fractions = 4;
  for (int i = 0; i < fractions; ++i) {
    const double fraction = double(i) / fractions;
    detail::gain_crossings(delayed.with_fraction(fraction), range,
                           [&](double w, std::complex<double> l) {
                             const double turn = 2.0 * std::numbers::pi / w;
                             double delay = fraction * T + detail::lag_to_minus_one(l) / w;
                             while (delay <= behind) delay += turn;
                             const auto edge = detail::refine_delay(delayed, w, delay);
                             if (edge) offer(*edge);
                           });
  }

  // At z = -1, where L is real and a whole sample turns its sign.
  constexpr int steps = 64;
  const auto at_nyquist = [&](double fraction) {
    return delayed.with_fraction(fraction).at(-2.0).real();
  };
  double before = at_nyquist(0.0);
  for (int i = 1; i <= steps; ++i) {
    const double after = at_nyquist(double(i) / steps);
    for (const double target : {-1.0, 1.0}) {
      if ((before < target) == (after < target)) continue;
      const double fraction = detail::bisect([&](double f) { return at_nyquist(f) - target; },
                                             double(i - 1) / steps, double(i) / steps);
      double delay = (fraction + (target < 0.0 ? 0.0 : 1.0)) * T;
      while (delay <= behind) delay += 2.0 * T;
      offer({delay, std::numbers::pi / T});
    }
    before = after;
  }
  if (delayed.refused) return *delayed.refused;
  if (!least) return Margin{};
  return Margin{least->value - present_delay, least->frequency};
}

}  // namespace esokit
