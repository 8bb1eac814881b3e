/// @file
/// Plants given by their equations, for simulation.
#pragma once

#include <concepts>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <type_traits>
#include <utility>

/// Simulation: plants, signals, noise, integrators, closed loops, criteria.
namespace esokit::sim {

/// A number, or a vector if Size is not 1.
template <class ScalarType, int Size>
using ScalarOrVector = std::conditional_t<Size == 1, ScalarType, Vector<ScalarType, Size>>;

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

  /// The same with another scalar. Functions that store numbers need a `with_scalar`; others
  /// must accept any scalar.
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
