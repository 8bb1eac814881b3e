/// @file
/// What a controller asks of an observer. Every observer of the library meets it, and so do the
/// decorators (DelayedInput, WrappedOutput, VariableTime, KnownModel, OutlierGate), which are
/// observers again.
#pragma once

#include <concepts>
#include <esokit/core/scalar.hpp>
#include <esokit/design/check.hpp>
#include <esokit/observer/step_status.hpp>

namespace esokit {

/// A sampled observer of a plain scalar with a Config. A control loop branches on limits, modes and
/// bad samples, which a pack cannot.
template <class O>
concept LoopObserver = std::copyable<O> && PlainScalar<typename O::scalar_type> &&
    requires(O& observer, const O& constant, const typename O::scalar_type& s,
             const typename O::Estimate& state, const typename O::Config& config) {
  requires O::order >= 1 && O::size > O::order;
  { O::make(config) } -> std::same_as<Expected<O, Error<typename O::scalar_type>>>;
  { observer.retune(config) } -> std::same_as<Check<typename O::scalar_type>>;
  { observer.update(s, s) } -> std::same_as<StepStatus>;
  { observer.predict(s) } -> std::same_as<StepStatus>;
  { observer.correct(s) } -> std::same_as<StepStatus>;
  { observer.reset(s) } -> std::same_as<StepStatus>;
  { observer.reset(state) } -> std::same_as<StepStatus>;
  { constant.estimate() } -> std::convertible_to<typename O::Estimate>;
  { constant.template estimate<0>() } -> std::convertible_to<typename O::scalar_type>;
  { constant.total_disturbance() } -> std::convertible_to<typename O::scalar_type>;
  { constant.applied_input() } -> std::convertible_to<typename O::scalar_type>;
  { constant.input_gain() } -> std::convertible_to<typename O::scalar_type>;
  { constant.sample_time() } -> std::convertible_to<typename O::scalar_type>;
  { constant.missed() } -> std::convertible_to<int>;
};

/// The config that names `input_gain` and `sample_time`: a decorator's config nests that of the
/// observer in it as `observer`.
template <class Config>
constexpr auto& chain_config(Config& config) noexcept {
  if constexpr (requires { config.observer; }) {
    return chain_config(config.observer);
  } else {
    return config;
  }
}

/// Whether the observer keeps its bandwidth where only every D-th sample brings a measurement.
/// AlgebraicEso does not: a gap among its first samples starts its schedule anew.
template <class Observer>
inline constexpr bool bears_regular_gaps = !requires(Observer & observer) {
  observer.rearm();
};

}  // namespace esokit
