/// @file
/// Fixed-step explicit Runge-Kutta integration. The stepper works for any system: it needs a
/// right-hand side rhs(t, x) and a state that can be added and scaled.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <esokit/core/scalar.hpp>
#include <esokit/sim/butcher_tableau.hpp>
#include <type_traits>

namespace esokit::sim {

/// The classical Runge-Kutta method of order 4.
struct RungeKutta4 {
  /// See ButcherTableau.
  /// @{
  static constexpr int stages = 4;
  static constexpr int order = 4;
  static constexpr std::array<std::array<long double, 4>, 4> a{
      {{0, 0, 0, 0}, {0.5L, 0, 0, 0}, {0, 0.5L, 0, 0}, {0, 0, 1, 0}}};
  static constexpr std::array<long double, 4> b{1 / 6.0L, 1 / 3.0L, 1 / 3.0L, 1 / 6.0L};
  static constexpr std::array<long double, 4> c{0, 0.5L, 0.5L, 1};
  /// @}
};

/// A right-hand side of x' = rhs(t, x). It must return a State and not an expression template,
/// whose operands would no longer exist.
template <class Rhs, class State, class ScalarType>
concept RightHandSide = requires(Rhs& rhs, ScalarType t, const State& x) {
  requires std::same_as<std::remove_cvref_t<decltype(rhs(t, x))>, State>;
};

namespace detail {

/// A tableau entry in the scalar type; scalars that are not plain are converted from double.
template <class ScalarType>
constexpr ScalarType coefficient(long double value) {
  if constexpr (PlainScalar<ScalarType>) {
    return static_cast<ScalarType>(value);
  } else {
    return ScalarType(static_cast<double>(value));
  }
}

/// h times a tableau entry.
template <class ScalarType>
constexpr ScalarType scaled(long double weight, ScalarType h) {
  return weight == 1 ? h : coefficient<ScalarType>(weight) * h;
}

/// A number of the type of time as a factor for a state; for packs the same in each lane.
template <class State, class ScalarType>
constexpr auto factor(const ScalarType& number) {
  if constexpr (requires { requires(lane_count<typename State::value_type> > 1); }) {
    return typename State::value_type(static_cast<double>(number));
  } else {
    return number;
  }
}

/// Weight of stage J in the row `Stage` of the tableau; the row `stages` holds the result weights.
template <class Method, int Stage, int J>
constexpr long double weight_of() {
  if constexpr (Stage == Method::stages) {
    return entry(Method::b[J]);
  } else {
    return entry(Method::a[Stage][J]);
  }
}

// Each stage is a separate local variable that is passed on by reference. An array of stages would
// stay in memory and, for two states at g++ -O2, take 2.4 times as long as hand-written code.

/// sum + h (w_J first + w_{J+1} rest..), without zero weights. The sum is passed on unevaluated, so
/// that Eigen evaluates it in one pass.
template <class Method, int Stage, int J, class State, class ScalarType, class Sum>
[[gnu::__always_inline__]] inline State advanced(ScalarType /*h*/, const Sum& sum) {
  return sum;
}
template <class Method, int Stage, int J, class State, class ScalarType, class Sum, class... Rest>
[[gnu::__always_inline__]] inline State advanced(ScalarType h, const Sum& sum, const State& first,
                                                 const Rest&... rest) {
  constexpr long double weight = weight_of<Method, Stage, J>();
  if constexpr (weight == 0) {
    return advanced<Method, Stage, J + 1, State>(h, sum, rest...);
  } else {
    return advanced<Method, Stage, J + 1, State>(h, sum + factor<State>(scaled(weight, h)) * first,
                                                 rest...);
  }
}

/// Evaluates the stages from number sizeof...(k) on, and sums them.
template <class Method, class Rhs, class State, class ScalarType, class... Stages>
[[gnu::__always_inline__]] inline State finish_step(Rhs& rhs, ScalarType t, const State& x,
                                                    ScalarType h, const Stages&... k) {
  constexpr int stage = sizeof...(k);
  if constexpr (stage == Method::stages) {
    return advanced<Method, stage, 0, State>(h, x, k...);
  } else if constexpr (stage == 0) {
    const State next = rhs(t, x);
    return finish_step<Method>(rhs, t, x, h, next);
  } else {
    constexpr long double node = entry(Method::c[stage]);
    const State argument = advanced<Method, stage, 0, State>(h, x, k...);
    const State next = rhs(t + scaled(node, h), argument);
    return finish_step<Method>(rhs, t, x, h, k..., next);
  }
}

}  // namespace detail

/// One step of x' = rhs(t, x) from t to t + h.
///
/// The state is a scalar, a fixed Eigen vector, or any copyable type with `x + x` and `scalar * x`.
/// Inputs and noise that are held over a step belong in the closure of rhs. Switch between steps
/// only, because a jump within a step reduces the order of accuracy.
///
/// @param rhs called `Method::stages` times as rhs(time, state)
/// @param t   time at the start of the step, s
/// @param x   state at t
/// @param h   step, s; a negative one integrates backwards
/// @return the state at t + h
template <ExplicitRungeKutta Method = RungeKutta4, class State, class ScalarType, class Rhs>
requires RightHandSide<std::remove_reference_t<Rhs>, State, ScalarType>
[[nodiscard]] State step(Rhs&& rhs, ScalarType t, const State& x, ScalarType h) {
  return detail::finish_step<Method>(rhs, t, x, h);
}

/// `steps` steps from t0. The time of a step is t0 + k h, so that rounding does not accumulate.
/// @param rhs as in `step` @param t0 s @param x state at t0 @param h step, s
/// @return the state at t0 + steps h
template <ExplicitRungeKutta Method = RungeKutta4, class State, PlainScalar ScalarType, class Rhs>
requires RightHandSide<std::remove_reference_t<Rhs>, State, ScalarType>
[[nodiscard]] State integrate(Rhs&& rhs, ScalarType t0, State x, ScalarType h, std::int64_t steps) {
  for (std::int64_t k = 0; k < steps; ++k) {
    x = step<Method>(rhs, t0 + static_cast<ScalarType>(k) * h, x, h);
  }
  return x;
}

}  // namespace esokit::sim
