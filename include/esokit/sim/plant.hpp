/// @file
/// Plants for simulation: a continuous one with a disturbance, and a nonlinear one.
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/eigen.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/signals.hpp>
#include <type_traits>
#include <utility>

/// Simulation: plants, signals, noise, integrators, closed loops, criteria.
namespace esokit::sim {

/// A number, or a vector if Size is not 1.
template <class ScalarType, int Size>
using ScalarOrVector = std::conditional_t<Size == 1, ScalarType, Vector<ScalarType, Size>>;

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
    Linear plant{};             ///< without dead time, which an ODE cannot have
    Disturbance disturbance{};  ///< d(t)
  };

  /// Returns the errors of the plant's `check`, and refuses a dead time.
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

/// A plant given by its equations: x' = f(t, x, u), y = h(t, x). Made by `nonlinear_plant`.
template <int States, class ScalarType, int Inputs, int Outputs, class F, class H>
struct NonlinearPlant {
  static constexpr int states = States;                ///< length of x
  static constexpr int inputs = Inputs;                ///< length of u
  static constexpr int outputs = Outputs;              ///< length of y
  using scalar_type = ScalarType;                      ///< of x, u and y
  using State = Vector<ScalarType, States>;            ///< x
  using Input = ScalarOrVector<ScalarType, Inputs>;    ///< u; a number if it has one element
  using Output = ScalarOrVector<ScalarType, Outputs>;  ///< y; a number if it has one element
  using Time = LaneScalar<ScalarType>;                 ///< t, s

  /// The same with another scalar. Functions that store numbers need a `with_scalar` and `fields`;
  /// others must accept any scalar.
  template <class T>
  requires(esokit::detail::has_other_scalars<F>&&
               esokit::detail::has_other_scalars<H>) using with_scalar =
      NonlinearPlant<States, T, Inputs, Outputs, typename esokit::detail::ForScalar<F, T>::type,
                     typename esokit::detail::ForScalar<H, T>::type>;

  F f;  ///< x' = f(t, x, u)
  H h;  ///< y = h(t, x)

  /// x'. @param t s
  State derivative(const Time& t, const State& x, const Input& u)
      const requires std::is_invocable_v<const F&, const Time&, const State&, const Input&> {
    return f(t, x, u);
  }
  /// y. @param t s
  Output output(const Time& t, const State& x) const { return h(t, x); }

  /// @cond
  static constexpr auto fields(auto& plant) noexcept {
    return esokit::detail::tie(plant.f, plant.h);
  }
  /// @endcond
};

namespace detail {
/// The output type of a plant with another scalar.
template <class Output, class T>
struct OutputIn {
  using type = T;
};
template <class S, int Size, class T>
struct OutputIn<Vector<S, Size>, T> {
  using type = Vector<T, Size>;
};
}  // namespace detail

/// The output function that gives the first states, as many as there are outputs.
template <class Output>
struct FirstStates {
  /// @cond
  template <class T>
  using with_scalar = FirstStates<typename detail::OutputIn<Output, T>::type>;
  /// @endcond

  /// y.
  template <class Time, class State>
  Output operator()(const Time& /*t*/, const State& x) const {
    if constexpr (std::convertible_to<decltype(x(0)), Output>) {
      return x(0);
    } else {
      return x.template head<Output::rows()>();
    }
  }
};

/// Makes a plant from functions. A pendulum is
///
///     nonlinear_plant<2>([](double, const Vector<double, 2>& x, double u) {
///       return Vector<double, 2>{x(1), -9.81 * std::sin(x(0)) + u};
///     });
///
/// y is the first state, or the result of `h(t, x)`. t is absolute time, s. Both functions must be
/// pure, because an integrator calls them at times between samples. A jump of f within a step costs
/// accuracy: pass a load that is switched on to the simulation as its disturbance. @{
template <int States, Scalar ScalarType = double, int Inputs = 1, int Outputs = 1, class F, class H>
NonlinearPlant<States, ScalarType, Inputs, Outputs, F, H> nonlinear_plant(F f, H h) {
  return {std::move(f), std::move(h)};
}
template <int States, Scalar ScalarType = double, int Inputs = 1, int Outputs = 1, class F>
auto nonlinear_plant(F f) {
  using H = FirstStates<ScalarOrVector<ScalarType, Outputs>>;
  return nonlinear_plant<States, ScalarType, Inputs, Outputs>(std::move(f), H{});
}
/// @}

}  // namespace esokit::sim
