/// @file
/// Plants for the continuous simulation of a closed loop: the concept, and a linear plant with a
/// disturbance. Their states are Eigen's vectors.
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/eigen.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/signals.hpp>
#include <utility>

namespace esokit::sim {

/// A system with one input and one output: x' = derivative(t, x, u), y = output(t, x).
///
/// t is absolute time in seconds, so that the plant may contain disturbances and parameters that
/// change with time. Both functions must be pure: an integrator calls them at times between
/// samples, several times per step and not in order.
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
/// @tparam Disturbance a Signal, d(t) in the unit defined by E of the plant: for a chain that of
///         y^(n), for a transfer function that of u
template <int States, PlainScalar ScalarType = double, class Disturbance = Constant<ScalarType>>
requires Signal<Disturbance, ScalarType>
class DisturbedPlant {
 public:
  static constexpr int states = States;            ///< length of x
  using State = EigenMatrix<ScalarType, states>;   ///< x
  using Linear = LinearPlant<States, ScalarType>;  ///< the plant

  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    Linear plant{};             ///< without dead time, which an ODE cannot have
    Disturbance disturbance{};  ///< d(t)
  };

  /// Returns the errors of the plant's `validate`, and refuses a dead time.
  static Expected<DisturbedPlant, Error<ScalarType>> make(Config config) {
    Rules<ScalarType> rules;
    rules.all_of(config.plant.validate())
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
