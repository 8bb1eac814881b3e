/// @file
/// What a plant is, and linear plants with a disturbance.
#pragma once

#include <concepts>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/eigen.hpp>
#include <esokit/sim/signals.hpp>
#include <type_traits>
#include <utility>

/// Simulation: plants, signals, noise, integrators, closed loops, criteria.
namespace esokit::sim {

/// A system with one input and one output: x' = derivative(t, x, u), y = output(t, x).
///
/// t is absolute time in seconds, so that disturbances and parameters that change with time may
/// live in the plant. Both functions are pure: an integrator calls them at times between samples,
/// several times a step and not in order.
template <class P>
concept Plant = requires(const P& plant, const typename P::State& x,
                         const typename P::State::Scalar& scalar) {
  { P::states } -> std::convertible_to<int>;
  requires P::states >= 1;
  requires std::same_as<typename P::State, EigenMatrix<typename P::State::Scalar, P::states>>;
  { plant.derivative(scalar, x, scalar) } -> std::same_as<typename P::State>;
  { plant.output(scalar, x) } -> std::same_as<typename P::State::Scalar>;
};

/// y^(Order) = d(t) + b0 u, with x = (y, y', .., y^(Order-1)).
///
/// @tparam Disturbance a Signal, d(t) in the unit of y^(Order)
template <int Order, PlainScalar ScalarType = double, class Disturbance = Constant<ScalarType>>
requires Signal<Disturbance, ScalarType>
class IntegratorChainPlant {
  static_assert(Order >= 1);

 public:
  static constexpr int states = Order;            ///< length of x
  using State = EigenMatrix<ScalarType, states>;  ///< x

  /// Settings of make.
  struct Config {
    ScalarType input_gain{1};   ///< b0, unit of y^(Order) per unit of u; not zero
    Disturbance disturbance{};  ///< d(t)
  };

  /// Refuses an input gain that is zero or not finite.
  static Expected<IntegratorChainPlant, Error<ScalarType>> make(Config config) {
    if (Rules<ScalarType> rules; !rules.nonzero("input_gain", config.input_gain))
      return rules.error();
    return IntegratorChainPlant(std::move(config));
  }

  /// x'. @param t s
  State derivative(ScalarType t, const State& x, ScalarType u) const noexcept {
    State rate;
    for (int i = 0; i + 1 < states; ++i) rate[i] = x[i + 1];
    rate[states - 1] = total_disturbance(t, x) + config_.input_gain * u;
    return rate;
  }

  /// y.
  ScalarType output(ScalarType /*t*/, const State& x) const noexcept { return x[0]; }

  /// d(t), unit of y^(Order).
  ScalarType total_disturbance(ScalarType t, const State& /*x*/) const noexcept {
    return config_.disturbance(t);
  }

 private:
  explicit IntegratorChainPlant(Config config) : config_(std::move(config)) {}

  Config config_;
};

/// y^(Order) + a_{Order-1} y^(Order-1) + .. + a_0 y = b u + d(t), with x = (y, .., y^(Order-1)).
///
/// @tparam Disturbance a Signal, d(t) in the unit of y^(Order)
template <int Order, PlainScalar ScalarType = double, class Disturbance = Constant<ScalarType>>
requires Signal<Disturbance, ScalarType>
class LinearPlant {
  static_assert(Order >= 1);

 public:
  static constexpr int states = Order;            ///< length of x
  using State = EigenMatrix<ScalarType, states>;  ///< x

  /// Settings of make.
  struct Config {
    Array<ScalarType, Order> coefficients{};  ///< a_0 .. a_{Order-1}, s^-(Order-i)
    ScalarType input_gain{1};                 ///< b, unit of y^(Order) per unit of u; not zero
    Disturbance disturbance{};                ///< d(t)
  };

  /// Refuses coefficients that are not finite and an input gain that is zero or not finite.
  static Expected<LinearPlant, Error<ScalarType>> make(Config config) {
    Rules<ScalarType> rules;
    rules.finite("coefficients", config.coefficients).nonzero("input_gain", config.input_gain);
    if (!rules) return rules.error();
    return LinearPlant(std::move(config));
  }

  /// x'. @param t s
  State derivative(ScalarType t, const State& x, ScalarType u) const noexcept {
    State rate;
    for (int i = 0; i + 1 < states; ++i) rate[i] = x[i + 1];
    rate[states - 1] = total_disturbance(t, x) + config_.input_gain * u;
    return rate;
  }

  /// y.
  ScalarType output(ScalarType /*t*/, const State& x) const noexcept { return x[0]; }

  /// d(t) - a_0 y - .. - a_{Order-1} y^(Order-1): what an observer with b0 = b calls the total
  /// disturbance.
  ScalarType total_disturbance(ScalarType t, const State& x) const noexcept {
    ScalarType sum = config_.disturbance(t);
    for (int i = 0; i < states; ++i) {
      sum -= config_.coefficients[static_cast<std::size_t>(i)] * x[i];
    }
    return sum;
  }

 private:
  explicit LinearPlant(Config config) : config_(std::move(config)) {}

  Config config_;
};

}  // namespace esokit::sim
