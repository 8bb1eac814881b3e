/// @file
/// Converts PID gains to ADRC and back: for a first guess from a tuned PID, and to express an ADRC
/// as a PID.
///
/// Continuous linear ADRC of order n is, from y to u, exactly
///
///     n = 1:  (K_p + K_i / s) / (tau s + 1),
///             tau = 1 / M
///     n = 2:  (K_p + K_i / s + K_d s) / (tau2 s^2 + tau1 s + 1),
///             tau2 = 1 / M, tau1 = (l1 + k1) / M
///
/// with M = l1 + k0 or l2 + k1 l1 + k0; with omega_o = kappa omega_c all gains are rational in
/// kappa (compare G. Herbst, Control Theory and Technology 19 (2021) 19-34).
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <limits>

namespace esokit {

/// u = K_p e + K_i int e + K_d e', with the denominator tau2 s^2 + tau1 s + 1.
template <PlainScalar S = double>
struct PidGains {
  S proportional{};         ///< K_p, unit of u per unit of y
  S integral{};             ///< K_i, unit of K_p per s
  S derivative{};           ///< K_d, unit of K_p times s; zero for PI
  S filter_time{};          ///< tau1, s
  S filter_time_squared{};  ///< tau2, s^2; zero for PI
};

/// A continuous linear ADRC, given by b0 and its bandwidths.
template <PlainScalar S = double>
struct AdrcTuning {
  S input_gain{};            ///< b0
  S controller_bandwidth{};  ///< omega_c, rad/s
  S observer_bandwidth{};    ///< omega_o, rad/s
};

/// Gains of the PI (Order 1) or PID (Order 2) that is equal to the ADRC.
/// @return error for an input gain of zero, a bandwidth that is not positive, or gains that the
///         scalar cannot hold
template <int Order, PlainScalar S>
Expected<PidGains<S>, Error<S>> pid_from_adrc(const AdrcTuning<S>& tuning) {
  static_assert(Order == 1 || Order == 2, "esokit: PID is for orders 1 and 2");
  Rules<S> rules;
  rules.nonzero("input_gain", tuning.input_gain)
      .positive("controller_bandwidth", tuning.controller_bandwidth)
      .positive("observer_bandwidth", tuning.observer_bandwidth);
  if (!rules) return rules.error();
  constexpr const char* too_far =
      "with controller_bandwidth and input_gain gives a PID that the scalar cannot hold";
  const S c = tuning.controller_bandwidth;
  const S o = tuning.observer_bandwidth;
  PidGains<S> pid;
  if constexpr (Order == 1) {
    const S m = S(2) * o + c;
    pid.proportional = o * (S(2) * c + o) / (tuning.input_gain * m);
    pid.integral = c * o * o / (tuning.input_gain * m);
    pid.filter_time = S(1) / m;
  } else {
    const S m = S(3) * o * o + S(6) * c * o + c * c;
    const S front = o / (tuning.input_gain * m);
    pid.proportional = front * o * c * (S(3) * c + S(2) * o);
    pid.integral = front * o * o * c * c;
    pid.derivative = front * (S(3) * c * c + S(6) * c * o + o * o);
    pid.filter_time = (S(3) * o + S(2) * c) / m;
    pid.filter_time_squared = S(1) / m;
    rules.representable("observer_bandwidth", o, pid.derivative, too_far)
        .representable("observer_bandwidth", o, pid.filter_time_squared, too_far);
  }
  for (const S& result : {pid.proportional, pid.integral, pid.filter_time}) {
    rules.representable("observer_bandwidth", o, result, too_far);
  }
  if (!rules) return rules.error();
  return pid;
}

/// The ADRC that has the given PID gains (its filter may differ).
///
/// PI: any `bandwidth_ratio` kappa = omega_o / omega_c is possible, so the given one is used. PID:
/// kappa follows from K_p^2 / (K_i K_d) = (2 kappa + 3)^2 / (kappa^2 + 6 kappa + 3). For kappa >= 1
/// that lies between 2.5 and 4; 4 is Ziegler and Nichols' T_i = 4 T_d. Outside this range, and if
/// kappa would be above `bandwidth_ratio`, no ADRC has these gains. They are refused, and `limit`
/// in the error is the nearest K_d for which there is one. Use it only if it is close to your K_d;
/// otherwise b0 is wrong by the same factor.
/// @param pid gains, not zero and of one sign; its filter is ignored
/// @param bandwidth_ratio kappa for PI, largest kappa for PID; 3 .. 10 gives good step responses,
///        less gives less noise
/// @return error for gains that are zero, have different signs or belong to no ADRC, and for a
///         ratio that is not positive (PI) or not above 1 (PID)
template <int Order, PlainScalar S>
Expected<AdrcTuning<S>, Error<S>> adrc_from_pid(const PidGains<S>& pid, S bandwidth_ratio = S(10)) {
  static_assert(Order == 1 || Order == 2, "esokit: PID is for orders 1 and 2");
  Rules<S> rules;
  const S rate = pid.integral / pid.proportional;
  rules.nonzero("proportional", pid.proportional)
      .nonzero("integral", pid.integral)
      .demand(rate > S(0), "integral", pid.integral, "must have the sign of proportional")
      .positive("bandwidth_ratio", bandwidth_ratio);
  if (!rules) return rules.error();
  AdrcTuning<S> tuning;
  S kappa = bandwidth_ratio;
  if constexpr (Order == 1) {
    tuning.controller_bandwidth = rate * (S(2) + kappa) / kappa;
    const S m = (S(2) * kappa + S(1)) * tuning.controller_bandwidth;
    tuning.observer_bandwidth = kappa * tuning.controller_bandwidth;
    tuning.input_gain = tuning.observer_bandwidth *
                        (S(2) * tuning.controller_bandwidth + tuning.observer_bandwidth) /
                        (pid.proportional * m);
  } else {
    const S ratio = rate * pid.derivative / pid.proportional;  // K_i K_d / K_p^2
    rules.nonzero("derivative", pid.derivative)
        .demand(ratio > S(0), "derivative", pid.derivative, "must have the sign of proportional")
        .above("bandwidth_ratio", bandwidth_ratio, S(1));
    if (!rules) return rules.error();
    // (1 - 4q) kappa^2 + (6 - 12q) kappa + (3 - 9q) = 0 with q = K_i K_d / K_p^2, its larger root.
    const S a = S(4) * ratio - S(1);
    const S b = S(12) * ratio - S(6);
    const S c = S(9) * ratio - S(3);
    S square = b * b - S(4) * a * c;
    // At kappa = 1 it is zero except for rounding.
    const S rounding = S(64) * detail::rounding<S>();
    if (square < S(0) && square > -rounding * (b * b)) square = S(0);
    const S root = a > S(0) && square >= S(0) ? (-b + std::sqrt(square)) / (S(2) * a) : S(-1);
    const bool too_much = a > S(0) && square < S(0);
    const S edge = bandwidth_ratio * (S(1) + rounding * bandwidth_ratio);
    if (too_much || !(a > S(0)) || root > edge) {
      kappa = too_much ? S(1) : bandwidth_ratio;
      const S both = S(2) * kappa + S(3);
      const S nearest = (kappa * kappa + S(6) * kappa + S(3)) / (both * both);
      return Error<S>{"derivative",
                      pid.derivative,
                      "belongs to no ADRC with this proportional, integral and bandwidth_ratio; "
                      "the nearest that does is",
                      -1,
                      nearest * pid.proportional / rate,
                      true};
    }
    kappa = root < S(1) ? S(1) : root;
    tuning.controller_bandwidth = rate * (S(3) + S(2) * kappa) / kappa;
    tuning.observer_bandwidth = kappa * tuning.controller_bandwidth;
    const S m = S(3) * kappa * kappa + S(6) * kappa + S(1);
    tuning.input_gain = tuning.controller_bandwidth * tuning.controller_bandwidth * kappa * kappa *
                        (S(3) + S(2) * kappa) / (pid.proportional * m);
  }
  rules.representable("proportional", pid.proportional, tuning.input_gain,
                      "gives an input gain that the scalar cannot hold");
  if (!rules) return rules.error();
  return tuning;
}

}  // namespace esokit
