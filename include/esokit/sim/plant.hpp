/// @file
/// What a plant of the continuous simulation is, and a linear one with a disturbance.
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/eigen.hpp>
#include <esokit/model/linear_plant.hpp>
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

/// A linear plant with a disturbance d(t), for the continuous simulation.
///
/// @tparam Disturbance a Signal, d(t) in the unit that E of the plant takes: of a chain y^(n), of a
///         transfer function that of u
template <int States, PlainScalar ScalarType = double, class Disturbance = Constant<ScalarType>>
requires Signal<Disturbance, ScalarType>
class DisturbedPlant {
 public:
  static constexpr int states = States;            ///< length of x
  using State = EigenMatrix<ScalarType, states>;   ///< x
  using Linear = LinearPlant<States, ScalarType>;  ///< the plant

  /// Settings of make.
  struct Config {
    Linear plant{};             ///< without dead time, which an ODE cannot have
    Disturbance disturbance{};  ///< d(t)
  };

  /// Refuses a plant that its `check` refuses, and one with a dead time.
  static Expected<DisturbedPlant, Error<ScalarType>> make(Config config) {
    Rules<ScalarType> rules;
    rules.all_of(config.plant.check())
        .left_out("plant.dead_time", config.plant.dead_time,
                  "must be zero in a continuous simulation");
    if (!rules) return rules.error();
    return DisturbedPlant(std::move(config));
  }

  /// x'. @param t s
  State derivative(ScalarType t, const State& x, ScalarType u) const noexcept {
    const Linear& plant = config_.plant;
    const ScalarType d = config_.disturbance(t);
    State rate;
    for (int i = 0; i < states; ++i) {
      ScalarType sum = plant.b(i) * u + plant.e(i) * d;
      for (int j = 0; j < states; ++j) sum += plant.a(i, j) * x[j];
      rate[i] = sum;
    }
    return rate;
  }

  /// y.
  ScalarType output(ScalarType /*t*/, const State& x) const noexcept {
    ScalarType sum(0);
    for (int j = 0; j < states; ++j) sum += config_.plant.c(j) * x[j];
    return sum;
  }

 private:
  explicit DisturbedPlant(Config config) : config_(std::move(config)) {}

  Config config_;
};

}  // namespace esokit::sim
