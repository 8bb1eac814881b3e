/// @file
/// The parts of a model: lags of actuator and sensor, and disturbances that are constant,
/// sinusoidal or decaying.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

/// Which parts a model has. Their numbers are in its Settings.
struct ModelParts {
  int order = 1;               ///< n: the plant is y^(n) = -a_(n-1) y^(n-1) - .. - a_0 y + d + b0 v
  int states = 0;              ///< above 0: the plant is a LinearPlant of so many states, and the
                               ///< order its relative degree; it contains the actuator
  bool plant_poles = false;    ///< a_0 .. a_(n-1) are known; false: they are zero, a chain
  int actuator = 0;            ///< order of the lag from u to v: 0 (v = u), 1 or 2
  int sensor = 0;              ///< order of the lag from y to the measured value: 0, 1 or 2
  int constants = 1;           ///< m: the disturbance has m integrators, at least one
  int resonators = 0;          ///< number of sines of known frequency in the disturbance
  int first_order = 0;         ///< number of first-order disturbances, each with a time constant
  bool follows_speed = false;  ///< one factor changes all frequencies of the resonators while
                               ///< running
};

/// The lag of an actuator or a sensor; empty for order 0.
template <int Order, Scalar S>
struct Lag {};

/// tau v' = u - v.
template <Scalar S>
struct Lag<1, S> {
  S time_constant{};  ///< tau, s
};

/// v'' = w^2 (u - v) - 2 zeta w v'.
template <Scalar S>
struct Lag<2, S> {
  S frequency{};       ///< w, rad/s
  S damping = S(1.0);  ///< zeta; 1: two equal time constants 1 / w

  /// The lag with these two time constants, s.
  static Lag of_time_constants(const S& first, const S& second) noexcept {
    const S root = std::sqrt(first * second);
    return {S(1) / root, (first + second) / (S(2) * root)};
  }
};

/// A sinusoidal disturbance of known frequency.
template <Scalar S>
struct Resonance {
  S frequency{};          ///< w0, rad/s
  S damping{};            ///< damping ratio of the sine, 0 to below 1
  S capture_bandwidth{};  ///< s, rad/s: its poles go to -s +- j w0. Left out: w0. More captures it
                          ///< faster, and with more error in its frequency, at more noise
};

/// A sine at the present time: q = amplitude sin(phase).
template <Scalar S>
struct Phasor {
  S amplitude;  ///< unit of the disturbance
  S phase;      ///< rad
};

namespace detail {

/// @param q the sine @param r the same sine a quarter period ahead
template <PlainScalar S>
Phasor<S> phasor_of(const S& q, const S& r) noexcept {
  return {std::hypot(q, r), std::atan2(q, r)};
}

/// Coefficients of a lag of order l with denominator s^l + .. + a_0, in units of T: T^(l-i) a_i for
/// i < l, then 1.
/// @{
template <PlainScalar S>
Array<S, 1> scaled_lag(const Lag<0, S>&, const S&) noexcept {
  return {S(1)};
}
template <PlainScalar S>
Array<S, 2> scaled_lag(const Lag<1, S>& lag, const S& time) noexcept {
  return {time / lag.time_constant, S(1)};
}
template <PlainScalar S>
Array<S, 3> scaled_lag(const Lag<2, S>& lag, const S& time) noexcept {
  const S angle = lag.frequency * time;
  return {angle * angle, S(2) * lag.damping * angle, S(1)};
}
/// @}

/// Bandwidth of a sensor, 1/s.
/// @{
template <PlainScalar S>
S sensor_rate(const Lag<1, S>& lag) noexcept {
  return S(1) / lag.time_constant;
}
template <PlainScalar S>
S sensor_rate(const Lag<2, S>& lag) noexcept {
  return lag.frequency;
}
/// @}

/// Writes T A of a sensor into a: its states come first, and it follows y, which is state `Order`.
template <int Order, PlainScalar S, int Rows, int Columns>
void set_sensor_rates(Matrix<S, Rows, Columns>& a, const Lag<Order, S>& sensor, const S& time) {
  if constexpr (Order == 1) {
    a(0, 1) = scaled_lag(sensor, time)[0];
    a(0, 0) = -a(0, 1);
  } else if constexpr (Order == 2) {
    const S angle = sensor.frequency * time;
    a(0, 1) = angle;
    a(1, 0) = -angle;
    a(1, 1) = -scaled_lag(sensor, time)[1];
    a(1, 2) = angle;
  }
}

/// Writes T A of the resonators, two states each, and of the first-order disturbances, one each,
/// from state `first` on.
template <PlainScalar S, int Rows, int Columns, std::size_t Sines, std::size_t FirstOrders>
void set_sinusoid_rates(Matrix<S, Rows, Columns>& a, int first,
                        const std::array<Resonance<S>, Sines>& resonators,
                        const std::array<S, FirstOrders>& first_order, const S& time) {
  int q = first;
  for (const auto& resonance : resonators) {
    const S w = resonance.frequency * time;
    a(q, q + 1) = w;
    a(q + 1, q) = -w;
    a(q + 1, q + 1) = S(-2) * resonance.damping * w;
    q += 2;
  }
  for (const S& tau : first_order) {
    a(q, q) = -time / tau;
    ++q;
  }
}

/// The sensor's states f as a function of those of the plant, f = g x, if the sensor keeps its own
/// poles. For order 1 g solves g A + rate g = rate C; for order 2 the second row is f' / w. The
/// first state of x is y.
/// @param rates T A of the plant
template <int Order, PlainScalar S, int Size>
Matrix<S, Order, Size> shown_by_sensor(const Lag<Order, S>& sensor, const S& time,
                                       const Matrix<S, Size, Size>& rates) {
  const auto lag = scaled_lag(sensor, time);
  Matrix<S, Size, Size> shows = Matrix<S, Size, Size>::Identity();
  if constexpr (Order == 1) {
    shows += rates / lag[0];
  } else {
    shows += rates * (lag[1] / lag[0]) + rates * rates / lag[0];
  }
  auto output = Vector<S, Size>::Zero();
  output(0) = S(1);
  const auto first = solved(shows.transpose(), output).transpose();
  Matrix<S, Order, Size> shown;
  set_block(shown, 0, 0, first);
  if constexpr (Order == 2) set_block(shown, 1, 0, first * rates / (sensor.frequency * time));
  return shown;
}

/// Real and imaginary part of the poles of the resonators, 1/s: -s +- j w0.
template <PlainScalar S, std::size_t Sines>
Array<Array<S, 2>, static_cast<int>(Sines)> own_pairs(
    const std::array<Resonance<S>, Sines>& resonators) {
  Array<Array<S, 2>, static_cast<int>(Sines)> pairs{};
  for (std::size_t c = 0; c < Sines; ++c) {
    const auto& resonance = resonators[c];
    const bool given = resonance.capture_bandwidth > S(0);
    pairs[c] = {-(given ? resonance.capture_bandwidth : resonance.frequency), resonance.frequency};
  }
  return pairs;
}

// ---- Rules.

/// @{
template <PlainScalar S>
void check_lag(Rules<S>&, const char*, const char*, const Lag<0, S>&, const S&) {}
template <PlainScalar S>
void check_lag(Rules<S>& rules, const char* field, const char*, const Lag<1, S>& lag,
               const S& time) {
  rules.positive(field, lag.time_constant)
      .demand(at_most(time, S(lag.time_constant * S(100))), field, lag.time_constant,
              "must be at least a hundredth of sample_time");
}
template <PlainScalar S>
void check_lag(Rules<S>& rules, const char* field, const char* damping, const Lag<2, S>& lag,
               const S& time) {
  // The faster of two time constants is 1 / (w spread).
  const S spread =
      lag.damping > S(1) ? S(lag.damping + std::sqrt(lag.damping * lag.damping - S(1))) : S(1);
  rules.positive(field, lag.frequency)
      .positive(damping, lag.damping)
      .demand(at_most(S(lag.frequency * time), S(100)), field, lag.frequency,
              "must be at most a hundred times the sample rate")
      .demand(at_most(S(spread * lag.frequency * time), S(100)), damping, lag.damping,
              "gives a time constant below a hundredth of sample_time");
}
/// @}

template <int Order, PlainScalar S>
void check_sensor(Rules<S>& rules, const Lag<Order, S>& sensor, const S& time) {
  check_lag(rules, Order == 1 ? "model.sensor.time_constant" : "model.sensor.frequency",
            "model.sensor.damping", sensor, time);
}

/// Element `index` must differ from those before it, of which `other` is one.
template <PlainScalar S>
void check_apart(Rules<S>& rules, const char* field, const S& value, int index, const S& other) {
  rules.demand(below(S(S(1e-3) * value), absolute(S(value - other)), other),
               {field, value, "must differ by a thousandth of itself from", index, other, true});
}

template <PlainScalar S, std::size_t Sines>
void check_resonators(Rules<S>& rules, const std::array<Resonance<S>, Sines>& resonators,
                      const S& time) {
  for (std::size_t i = 0; i < Sines; ++i) {
    const auto& resonance = resonators[i];
    const auto c = static_cast<int>(i);
    rules.positive("model.resonators.frequency", resonance.frequency, c)
        .demand(below(S(resonance.frequency * time), S(3.1)), "model.resonators.frequency",
                resonance.frequency, "must be below half the sample rate", c)
        .demand(
            is_finite(resonance.damping) && resonance.damping >= S(0) && resonance.damping < S(1),
            "model.resonators.damping", resonance.damping, "must be 0 or above, below 1", c)
        .not_negative("model.resonators.capture_bandwidth", resonance.capture_bandwidth, c);
    for (std::size_t before = 0; before < i; ++before) {
      check_apart(rules, "model.resonators.frequency", resonance.frequency, c,
                  resonators[before].frequency);
    }
  }
}

template <PlainScalar S, std::size_t FirstOrders>
void check_first_order(Rules<S>& rules, const std::array<S, FirstOrders>& first_order,
                       const S& time) {
  for (std::size_t i = 0; i < FirstOrders; ++i) {
    const S& tau = first_order[i];
    const auto c = static_cast<int>(i);
    rules.positive("model.first_order", tau, c)
        .demand(at_most(time, S(tau * S(100))), "model.first_order", tau,
                "must be at least a hundredth of sample_time", c);
    for (std::size_t before = 0; before < i; ++before) {
      check_apart(rules, "model.first_order", tau, c, first_order[before]);
    }
  }
}

}  // namespace detail

}  // namespace esokit
