/// @file
/// The input of `tune`: the model, one requirement, and the margins that the loop has to keep.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <esokit/analysis/loop.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/identify.hpp>
#include <optional>
#include <vector>

namespace esokit {

/// A sinusoidal disturbance of known frequency.
struct KnownSinusoid {
  double frequency = 0.0;          ///< w0, rad/s
  double amplitude = 0.0;          ///< unit of y^(n)
  double capture_bandwidth = 0.0;  ///< of an observer that knows it, see Resonance; 0: w0
};

/// What is known of a plant and of its noise and disturbance:
///
///     y^(n) + a y^(n-1) = b0 v(t - L) + d,   tau v' + v = u,   tau_s y_s' + y_s = y
///
/// y_s is measured with white noise; d is a random walk, plus a sine if one is given.
struct TuneModel {
  int order = 1;                    ///< n, 1 to 3
  Estimate input_gain{};            ///< b0 with its interval, unit of y^(n) per unit of u
  double pole = 0.0;                ///< a, 1/s
  double lag = 0.0;                 ///< tau, s; 0: none
  double dead_time = 0.0;           ///< L, s
  double latency_half_width = 0.0;  ///< possible increase of tau + L, s
  double lag_half_width = 0.0;      ///< possible error of tau at the same tau + L, s
  double sensor = 0.0;              ///< tau_s, s; 0: none
  double noise = 0.0;               ///< standard deviation of the measurement noise, unit of y
  double disturbance = 0.0;         ///< q: variance of the increments of d per time
  std::vector<KnownSinusoid> sinusoids{};  ///< none or one
  double sample_time = 0.0;                ///< T of the controller, s
  double u_min = 0.0;                      ///< limits of the actuator
  double u_max = 0.0;                      ///< upper limit, above u_min

  /// u nearest to zero within the limits: what a design states for a lost sensor. Choose your own.
  [[nodiscard]] double safe_input() const noexcept {
    return u_min > 0.0 ? u_min : u_max < 0.0 ? u_max : 0.0;
  }

  /// Order 3: Coulomb friction on y'', unit of y''; 0: none. Left out: not known, and the design is
  /// simulated with up to a quarter of what half the range of u makes of y'' in ten latencies.
  std::optional<double> friction{};

  /// (q / (N^2 T))^(1 / (2 n + 2)): the bandwidth of a Kalman filter for the chain, rad/s.
  [[nodiscard]] double filter_bandwidth() const {
    return std::pow(disturbance / (noise * noise * sample_time), 0.5 / (order + 1.0));
  }

  /// The disturbance of this filter bandwidth.
  [[nodiscard]] double disturbance_of(double bandwidth) const {
    return std::pow(bandwidth, 2 * (order + 1)) * noise * noise * sample_time;
  }

  /// The largest time by which u may be late, with the sample for which it is held, s.
  [[nodiscard]] double latency() const {
    return lag + dead_time + sensor + sample_time + latency_half_width;
  }

  /// Missing samples over which its controllers predict, the observer's `max_gap`: five latencies,
  /// 100 to 400.
  [[nodiscard]] int predicted_samples() const {
    return static_cast<int>(std::clamp(5.0 * latency() / sample_time, 100.0, 400.0));
  }

  /// Order 3: whether a design has to stand friction.
  [[nodiscard]] bool may_rub() const { return order == 3 && !(friction && !(*friction > 0.0)); }

  /// By how much u is late at a low gain, s, see TuneRules::damping_latencies; 0: this does not
  /// matter, or no law is slow enough.
  [[nodiscard]] double lateness() const;

  /// An error for a number that is not allowed, or so large or small that nothing can be computed
  /// with it.
  [[nodiscard]] Check<double> validate() const;
};

/// Factor from a 95 % to a 99 % interval: 2.576 / 1.960 standard errors.
inline constexpr double interval_of_99 = 1.314;

/// The model that was identified from a log, for a controller with the sample time of the log. The
/// intervals of b0, lag and latency are widened from 95 % to 99 %, so that the margins hold on the
/// machine. For a disturbance with a slope (m = 2) stands the random walk of equal power where it
/// comes above the noise. The log's columns count as measured: `disturbance` is what they leave,
/// and found.random_walk_unmeasured() what it would be without them.
/// @param u_min lower limit of the actuator, unit of u @param u_max above u_min
TuneModel tune_model(const Identified& found, double u_min, double u_max);

/// Share of the range of u that noise may cause if nothing else is required.
inline constexpr double usual_control_noise = 0.05;

/// The requirement. Give at most one of these.
struct TuneSpecification {
  /// Standard deviation of u that the measurement noise may cause, unit of u. If nothing is given:
  /// usual_control_noise of u_max - u_min.
  double control_noise = 0.0;
  /// s, to within 2 % after a step of the reference that stays within the limits. The law of orders
  /// 1 and 2 is given by it, so that the recommended design settles in this time; there is an alarm
  /// if it does not.
  double settling_time = 0.0;
  double controller_bandwidth =
      0.0;  ///< omega_c, rad/s: the law is given, only the observer is chosen
};

/// Which designs are simulated within the limits of u, see tune/overload.hpp.
enum class TuneSimulation : unsigned char {
  none,   ///< no design
  first,  ///< in the order of the ranking, until one recovers: that one is recommended
  all     ///< every design that keeps the rules: longer by a quarter
};

/// TuneRules::filter_floor of orders 1 to 3: with it load steps mostly move y less than with a PID
/// of the SIMC rule (85 to 100 of 100 random plants). Falls with the order: a loop around one
/// integrator is stable at any low gain; around two or three, the faster it is, the less saturation
/// it recovers from.
inline constexpr std::array<double, 3> usual_filter_floor{0.7, 0.4, 0.2};

/// What a loop has to keep. Margins: for the nominal model, and with b0 at both ends of its
/// interval, the largest latency, and the largest and smallest share of lag in it.
struct TuneRules {
  double modulus_margin = 0.5;  ///< smallest abs(1 + L)
  double delay_samples = 2.0;   ///< smallest delay margin, samples
  double gain_factor =
      2.0;  ///< the loop stays stable with b0 too large or too small by this factor
  double phase_margin = 0.0;  ///< smallest phase margin, rad; 0: not required

  /// Smallest damping of the poles of the nominal loop, but those of a known sine: no oscillation
  /// lasts, nor does u alternate from sample to sample for long. With 0.1 each period has at most
  /// 53 % of the one before it. 0: not required.
  double pole_damping = 0.1;

  /// Order 2: smallest k_1 / k_0, in TuneModel::latency. Limits act as a lower gain of u, and at a
  /// low gain a chain of two integrators whose u is late is stable only if k_1 / k_0 is above the
  /// latency. Friction does the same to order 3, where the lag 1 / a of its actuator counts as
  /// well. 0: not required.
  double damping_latencies = 1.3;
  /// Order 3: largest omega_c / omega_o, the geometric means of the poles of law and observer.
  /// Three integrators are stable at no very low gain, so it helps and does not suffice. Below, it
  /// adds nothing to damping_latencies. 0: not required.
  double bandwidth_ratio = 5.0;
  /// Smallest filter bandwidth that is reckoned with, in 1 / TuneModel::latency, as far as the
  /// control noise allows: a log without disturbances does not show the loads of tomorrow. Left
  /// out: usual_filter_floor of the order; 0: none.
  std::optional<double> filter_floor{};
  TuneSimulation simulate = TuneSimulation::first;  ///< what does not recover ranks behind
};

namespace detail {

/// The plant of a model with states (y, .., y^(n-1), v, y_s); d enters at y^(n).
/// @param gain factor on b0
DensePlant dense_plant(const TuneModel& model, double gain = 1.0);

/// A plant at the ends of the intervals: the factor on b0, and the other numbers. The first two
/// differ in b0 and dead time only.
struct PlantVariant {
  TuneModel model;
  double gain = 1.0;
};

std::vector<PlantVariant> plant_variants(const TuneModel& model);

}  // namespace detail

/// The loop of a model's plant and a controller, for the functions of the analysis.
/// @param gain factor on b0 of the plant, not of the controller
LoopResult closed_loop(const TuneModel& model, const LinearController& controller,
                       double gain = 1.0);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/specification.ipp>
#endif
