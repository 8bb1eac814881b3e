/// @file
/// What `run` takes: plants, controllers that fit them, and settings.
#pragma once

#include <concepts>
#include <cstdint>
#include <esokit/control/controller.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/detail/run_signal.hpp>
#include <esokit/sim/plant.hpp>
#include <esokit/sim/run_result.hpp>
#include <functional>
#include <optional>
#include <type_traits>

namespace esokit::sim {

namespace detail {

template <class P>
inline constexpr bool is_linear_plant = false;
template <int States, class S, int Inputs, int Outputs>
inline constexpr bool is_linear_plant<LinearPlant<States, S, Inputs, Outputs>> = true;

/// Converts a number or a vector to another scalar.
template <class To, class From>
ESOKIT_INLINE auto in_scalar(const From& from) {
  constexpr int size = esokit::detail::vector_size<From>;
  if constexpr (size == 0) {
    return static_cast<To>(from);
  } else {
    Vector<To, size> to;
    for (int i = 0; i < size; ++i) to(i) = static_cast<To>(from(i));
    return to;
  }
}

/// True if a number, or all elements of a vector or state, are finite.
template <class T>
constexpr bool finite_throughout(const T& value) noexcept {
  if constexpr (requires { all(is_finite(value)); }) {
    return all(is_finite(value));
  } else {
    // All elements of packs at once, as each test of all lanes is a branch. Of numbers a copy is
    // tested, else the loop goes on with what the test has moved out of a floating-point register.
    const auto finite_element = [&](int i) ESOKIT_INLINE_LAMBDA {
      auto number = value[i];
      esokit::detail::keep_scalar(number);
      return is_finite(number);
    };
    auto finite = finite_element(0);
    for (int i = 1; i < static_cast<int>(value.size()); ++i) finite = finite && finite_element(i);
    return all(finite);
  }
}

/// Calls f(number) for each element.
template <class T, class F>
ESOKIT_INLINE void each_number(T& value, const F& f) {
  if constexpr (std::is_invocable_v<const F&, T&>) {
    f(value);
  } else {
    for (int i = 0; i < static_cast<int>(value.size()); ++i) f(value[i]);
  }
}

}  // namespace detail

/// A linear plant, or a plant with functions `derivative(t, x, u)` and `output(t, x)` and a State
/// that can be added and scaled like a vector.
template <class P>
concept SampledPlant = std::copy_constructible<P> &&
    (detail::is_linear_plant<P> ||
     requires(
         const P& plant, const typename P::State& x,
         const LaneScalar<typename detail::PlantScalarOf<P>::type>& t,
         const ScalarOrVector<typename detail::PlantScalarOf<P>::type, detail::inputs_of<P>()>& u) {
       { P::states } -> std::convertible_to<int>;
       { plant.derivative(t, x, u) } -> std::same_as<typename P::State>;
       {
         plant.output(t, x)
         } -> std::convertible_to<
             ScalarOrVector<typename detail::PlantScalarOf<P>::type, detail::outputs_of<P>()>>;
     });

/// A controller that fits a plant; measurement and reference are in the controller's scalar.
template <class C, class P>
concept ControllerOf =
    Controller<C,
               ScalarOrVector<typename RunTypes<P, C>::ControllerScalar, RunTypes<P, C>::outputs>,
               ScalarOrVector<typename RunTypes<P, C>::ControllerScalar, RunTypes<P, C>::inputs>>;

namespace detail {
template <class C, class P>
consteval bool is_a_controller() {
  static_assert(ControllerOf<C, P>,
                "esokit: a controller for this plant has u = update(y, r) or is a function "
                "u = controller(y, r), of as many numbers as the plant has outputs and inputs");
  return ControllerOf<C, P>;
}
}  // namespace detail

/// Settings of `run`; all but `duration` may be left out.
template <class P, class C>
struct RunConfig {
  using Types = RunTypes<P, C>;           ///< types of the numbers
  using Time = typename Types::Time;      ///< s
  using Input = typename Types::Input;    ///< u
  using Output = typename Types::Output;  ///< y

  [[no_unique_address]] ByName<RunConfig> by_name{};  ///< nothing to set, see ByName
  Time duration{};                                    ///< s, a whole multiple of the sample time
  Time sample_time{};  ///< T, s; must agree with the controller's, if that has one; left out: that
                       ///< of the controller

  /// r, a number or a function of t; for a controller that takes derivatives, (r, r', ..)
  RunSignal<typename Types::S, Types::references, Types::derivatives> reference{};

  /// d, a number or a function of t, held over an integration step. It enters through E of a linear
  /// plant; in other plants it is added to u.
  RunSignal<typename Types::S, Types::inputs> disturbance{};

  /// w, a number or a function of t, given to a controller that takes one measured disturbance;
  /// NaN: lost. What w does to the plant belongs into `disturbance` or the plant.
  RunSignal<typename Types::S, 1> measured{};

  Output noise{};  ///< standard deviation of the white normal measurement noise, unit of y

  /// The sensor: a function of (t, y), where y includes noise; it may quantise or return NaN
  /// (missing).
  std::function<Output(const Time&, const Output&)> sensor{};
  Time missing{};  ///< share of measurements that are lost at random, 0 .. 1

  /// Jitter of the sample time: a sample takes (1 + jitter r) T with random r in -1 .. 1; 0 .. 0.9
  Time jitter{};
  /// Alternatively a function: time from sample k to the next, s, 0.1 T .. 10 T.
  std::function<Time(std::int64_t)> step_time{};
  std::uint64_t seed = 1;  ///< of noise, missing and jitter; equal seeds give equal runs

  /// The number of this run among many with the same seed. Its random numbers are then
  /// counter-based, as in run `number` of a MonteCarlo; for packs lane i is run number + i. If left
  /// out, the lanes take numbers in turn from one sequence. Packs with a number cannot have jitter,
  /// because all lanes share the time.
  std::optional<std::uint64_t> number{};

  Time dead_time{};  ///< s from u to the plant, in addition to the plant's own dead time
  int substeps =
      1;  ///< integration steps per sample; for a linear plant one is exact, unless d changes in it
  Time start_time{};                                   ///< t of the first sample, s
  Input initial_input{};                               ///< u that was held before the first sample
  typename Types::State state = Types::State::Zero();  ///< x at the start
};

}  // namespace esokit::sim
