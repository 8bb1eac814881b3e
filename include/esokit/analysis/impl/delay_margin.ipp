#pragma once

#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/margins.hpp>

namespace esokit {

namespace detail {

/// Sampled loop gain with any delay of one input: whole samples as z^-M, the remaining fraction
/// within a sample.
struct DelayedLoopGain {
  DensePlant plant;  ///< continuous
  LinearController controller;
  int channel;
  mutable bool overflows = false;  ///< the scalar cannot hold the plant with some delay

  /// @param fraction of a sample, 0 .. 1
  [[nodiscard]] LoopGain with_fraction(double fraction) const {
    DensePlant late = plant;
    late.dead_time[static_cast<std::size_t>(channel)] = fraction * controller.sample_time;
    LoopGain gain{sampled_plant(late, controller.sample_time), controller, channel};
    const double size = sum_of_magnitudes(gain.plant.now) + sum_of_magnitudes(gain.plant.before);
    if (!is_finite(size)) overflows = true;
    return gain;
  }

  /// log(-L) at a frequency (rad/s) and delay (s): zero if the loop oscillates there.
  [[nodiscard]] std::complex<double> log_minus(double frequency, double delay) const {
    const double T = controller.sample_time;
    const double whole = std::floor(delay / T);
    const auto gain = with_fraction(std::clamp(delay / T - whole, 0.0, 1.0));
    return std::log(-gain(frequency) * std::polar(1.0, -frequency * whole * T));
  }
};

/// Newton's method for log(-L) = 0, from an approximate frequency and delay.
inline std::optional<Margin> refine_delay(const DelayedLoopGain& loop, double frequency,
                                          double delay) {
  const double T = loop.controller.sample_time;
  const double nyquist = std::numbers::pi / T;
  for (int i = 0; i < 40; ++i) {
    const std::complex<double> f = loop.log_minus(frequency, delay);
    if (!is_finite(f.real()) || !is_finite(f.imag())) return std::nullopt;
    if ((std::abs)(f) < 1e-12) return Margin{delay, frequency};
    const double dw = (frequency > 0.5 * nyquist ? -1e-7 : 1e-7) * frequency;
    // Towards the middle of the sample, because the slope changes at whole samples.
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
    frequency = (std::min)(frequency + step_w, nyquist);
    delay += step_t;
    if (delay < 0.0) delay = 0.0;
  }
  return std::nullopt;
}

/// Calls visit(w, L) at every frequency where abs(L) is one.
template <class Response, class Visit>
void gain_crossings(const Response& response, const ScanRange& range, Visit&& visit) {
  scan(response, range,
       [&](double w1, std::complex<double> l1, double w2, std::complex<double> l2) {
         if (((std::abs)(l1) < 1.0) == ((std::abs)(l2) < 1.0)) return;
         const double w = bisect([&](double x) { return (std::abs)(response(x)) - 1.0; }, w1, w2);
         visit(w, response(w));
       });
}

ESOKIT_FUNCTION double lag_to_minus_one(std::complex<double> l) {
  const double lag = std::arg(-l);
  return lag < 0.0 ? lag + 2.0 * std::numbers::pi : lag;
}

/// Delay margin of a continuous loop, where a delay is a phase shift.
inline Margin continuous_delay_margin(const Loop& loop, int channel) {
  std::optional<Margin> least;
  gain_crossings(loop_gain_of(loop, channel), scan_range(loop, channel),
                 [&](double w, std::complex<double> l) {
                   const double delay = lag_to_minus_one(l) / w;
                   if (!least || delay < least->value) least = Margin{delay, w};
                 });
  return least.value_or(Margin{});
}

}  // namespace detail

ESOKIT_FUNCTION Expected<Margin, Error<double>> delay_margin(const Loop& loop, int channel) {
  Rules<double> rules;
  rules.all_of(loop.check_channel("channel", channel))
      .demand(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
              detail::unstable_loop_rule);
  if (!rules) return rules.error();
  const double T = loop.sample_time();
  if (!(T > 0.0)) return detail::continuous_delay_margin(loop, channel);
  const double present = loop.continuous_plant().dead_time[static_cast<std::size_t>(channel)];
  const detail::DelayedLoopGain delayed{loop.continuous_plant(), loop.controller(), channel};
  const auto range = detail::scan_range(loop, channel);
  const double behind = present * (1.0 + 1e-12) + 1e-12 * T;
  std::optional<Margin> least;
  const auto offer = [&](const Margin& edge) {
    if (edge.value > behind && (!least || edge.value < least->value)) least = edge;
  };

  // The crossing frequencies depend on the fraction of a sample.
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

  // At z = -1, where L is real and a whole sample changes its sign.
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
  if (delayed.overflows) {
    return Error<double>{"plant.dead_time", present,
                         "or more gives a sampled plant that the scalar cannot hold"};
  }
  if (!least) return Margin{};
  return Margin{least->value - present, least->frequency};
}

}  // namespace esokit
