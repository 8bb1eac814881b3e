/// @file
/// Closed loops of a plant, an observer and a control law in two forms: ContinuousLoop as in the
/// papers (one stacked ODE), SampledLoop as on the real system.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/step_status.hpp>
#include <esokit/eigen.hpp>
#include <esokit/sim/detail/loop_steps.hpp>
#include <esokit/sim/disturbed_plant.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <esokit/sim/signal.hpp>
#include <limits>
#include <type_traits>
#include <utility>

namespace esokit::sim {

/// An observer as an ODE z' = derivative(t, z, y, u), such as ContinuousLinearEso.
/// `begin_step(t, z, y)` is called at step boundaries, the only place where it may change its mode.
template <class O>
concept ContinuousObserverModel = std::copyable<O> &&
    requires(O& observer, const O& constant, const typename O::State& z,
             const typename O::scalar_type& s) {
  { O::states } -> std::convertible_to<int>;
  { constant.derivative(s, z, s, s) } -> std::same_as<typename O::State>;
  { constant.estimate(z) } -> std::same_as<typename O::Estimate>;
  observer.begin_step(s, z, s);
};

/// An observer as it runs in a controller: one `update(y, u_applied)` every `sample_time()`.
template <class O>
concept SampledObserverModel = std::copyable<O> &&
    requires(O& observer, const O& constant, const typename O::scalar_type& s) {
  { observer.update(s, s) } -> std::same_as<StepStatus>;
  { constant.estimate() } -> std::convertible_to<typename O::Estimate>;
  { constant.sample_time() } -> std::convertible_to<typename O::scalar_type>;
};

/// Measurement noise of a simulation, such as HeldNoise: `at(k)` is its value during step k.
template <class N, class ScalarType>
concept NoiseSource = std::copyable<N> && requires(N& noise, std::int64_t k) {
  { noise.at(k) } -> std::convertible_to<ScalarType>;
};

/// The measurement that the observer gets: m(t, y, v) of the output y and the noise v.
template <class M, class ScalarType>
concept MeasurementMap = requires(const M& map, const ScalarType& s) {
  { map(s, s, s) } -> std::convertible_to<ScalarType>;
};

/// u(t, estimate). It must be a pure function, because the continuous loop also calls it at times
/// between steps.
template <class L, class ScalarType, class Estimate>
concept ControlFunction = requires(const L& law, const ScalarType& t, const Estimate& estimate) {
  { law(t, estimate) } -> std::convertible_to<ScalarType>;
};

/// Output-based form: the observer gets the measured output, y + v.
struct MeasuredOutput {
  /// y + v.
  template <PlainScalar ScalarType>
  constexpr ScalarType operator()(ScalarType /*t*/, ScalarType y, ScalarType v) const noexcept {
    return y + v;
  }
};

/// Error-based form: the observer gets the measured error, y_d(t) - (y + v), and needs the input
/// gain -b0. Use `MeasuredError{reference}`.
template <class Reference>
struct MeasuredError {
  Reference reference;  ///< y_d(t), a Signal

  /// y_d(t) - (y + v).
  template <PlainScalar ScalarType>
  requires Signal<Reference, ScalarType>
  constexpr ScalarType operator()(ScalarType t, ScalarType y, ScalarType v) const noexcept {
    return reference(t) - (y + v);
  }
};

/// MeasuredError{y_d}.
template <class Reference>
MeasuredError(Reference) -> MeasuredError<Reference>;

/// No measurement noise.
struct NoNoise {
  /// Zero.
  constexpr int at(std::int64_t /*k*/) const noexcept { return 0; }
};

/// The loop at t = start + k step. Measurement, input and estimate belong to the same time; the
/// input acts from t on.
template <Plant P, class Observer>
struct LoopSample {
  using ScalarType = typename P::State::Scalar;  ///< scalar of the plant

  std::int64_t index{};                    ///< k
  ScalarType t{};                          ///< s
  typename P::State plant_state{};         ///< x(t)
  ScalarType output{};                     ///< y(t), without noise
  ScalarType measurement{};                ///< what the observer got
  ScalarType input{};                      ///< u
  typename Observer::Estimate estimate{};  ///< (y, .., d, ..)
  StepStatus status = StepStatus::ok;      ///< status of a sampled observer's update
};

/// The end of a run.
template <Plant P, class ObserverEnd>
struct LoopEnd {
  typename P::State::Scalar t{};    ///< s
  std::int64_t steps{};             ///< steps carried out
  typename P::State plant_state{};  ///< x(t)
  ObserverEnd observer;             ///< observer state (continuous), or the observer (sampled)
  bool completed = true;            ///< false if the callback stopped the run
};

namespace detail {

template <class State>
auto check_state(const char* field, const State& state) {
  using S = std::remove_cvref_t<decltype(state[0])>;
  Rules<S> rules;
  for (int i = 0; i < static_cast<int>(state.size()); ++i) rules.finite(field, state[i], i);
  return Check<S>(rules);
}

}  // namespace detail

/// The loop as in the papers: plant and continuous observer are stacked into one ODE and integrated
/// with a fixed step. Measurement and control are functions of the present state, so they change
/// within a step; the noise is held over a step.
///
/// ```cpp
/// const sim::ContinuousLoop loop{motor, observer,
///     [&](double, const auto& zhat) { return law.control(zhat, 0.0); }};
/// auto end = loop.run({.duration = 5.0, .step = 1e-3},
///     [](const auto& sample) { std::printf("%g %g\n", sample.t, sample.output); });
/// ```
template <Plant P, ContinuousObserverModel Observer, class Law, class Measurement = MeasuredOutput,
          class Noise = NoNoise>
requires ControlFunction<Law, typename P::State::Scalar, typename Observer::Estimate> &&
    MeasurementMap<Measurement, typename P::State::Scalar> &&
    NoiseSource<Noise, typename P::State::Scalar>
struct ContinuousLoop {
  using ScalarType = typename P::State::Scalar;      ///< scalar of the plant
  using Sample = LoopSample<P, Observer>;            ///< what the callback gets
  using End = LoopEnd<P, typename Observer::State>;  ///< what `run` returns

  /// Settings of run.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};    ///< nothing to set, see ByName
    ScalarType duration{};                             ///< s, a whole multiple of `step`
    ScalarType step{};                                 ///< s
    ScalarType start_time{};                           ///< s
    typename P::State plant_state = P::State::Zero();  ///< x at the start
    typename Observer::State observer_state = Observer::State::Zero();  ///< z at the start
  };

  P plant;                    ///< copied into the loop, like all members
  Observer observer;          ///< equations of the observer
  Law law;                    ///< u(t, estimate)
  Measurement measurement{};  ///< what the observer is fed
  Noise noise{};              ///< v, held over a step

  /// Runs from the config's states; equal runs give equal results. `on_sample(const Sample&)` is
  /// called at the start of each step and at the end; if it returns a bool, false stops the run.
  /// @return the end of the run, or an error that names the field of the config
  template <ExplicitRungeKutta Method = RungeKutta4, std::invocable<const Sample&> Callback>
  Expected<End, Error<ScalarType>> run(const Config& config, Callback&& on_sample) const {
    if (Rules<ScalarType> rules; !rules.positive("step", config.step)) return rules.error();
    const auto steps = detail::whole_multiple("duration", config.duration, config.step,
                                              "must be a whole multiple of step, which is");
    if (!steps) return steps.error();
    Rules<ScalarType> rules;
    rules.finite("start_time", config.start_time)
        .all_of(detail::check_state("plant_state", config.plant_state))
        .all_of(detail::check_state("observer_state", config.observer_state));
    if (!rules) return rules.error();

    Observer eso = observer;
    Noise source = noise;
    Stacked state = stacked(config.plant_state, config.observer_state);
    for (std::int64_t k = 0;; ++k) {
      const ScalarType t = config.start_time + static_cast<ScalarType>(k) * config.step;
      const auto v = static_cast<ScalarType>(source.at(k));
      Sample sample;
      sample.index = k;
      sample.t = t;
      sample.plant_state = plant_part(state);
      const typename Observer::State z = observer_part(state);
      sample.output = plant.output(t, sample.plant_state);
      sample.measurement = static_cast<ScalarType>(measurement(t, sample.output, v));
      sample.estimate = eso.estimate(z);
      sample.input = static_cast<ScalarType>(law(t, sample.estimate));
      const bool stopped = !detail::keep_going(on_sample, sample);
      if (stopped || k == *steps) return End{t, k, sample.plant_state, z, !stopped};

      eso.begin_step(t, z, sample.measurement);
      const auto rate = [&](ScalarType time, const Stacked& s) -> Stacked {
        const typename P::State x = plant_part(s);
        const typename Observer::State estimate = observer_part(s);
        const auto u = static_cast<ScalarType>(law(time, eso.estimate(estimate)));
        const auto m = static_cast<ScalarType>(measurement(time, plant.output(time, x), v));
        return stacked(plant.derivative(time, x, u), eso.derivative(time, estimate, m, u));
      };
      state = sim::step<Method>(rate, t, state, config.step);
    }
  }

 private:
  using Stacked = EigenMatrix<ScalarType, P::states + Observer::states>;

  static Stacked stacked(const typename P::State& x, const typename Observer::State& z) {
    Stacked state;
    state.template head<P::states>() = x;
    for (int i = 0; i < Observer::states; ++i) state(P::states + i) = z(i);
    return state;
  }
  static typename P::State plant_part(const Stacked& state) {
    return state.template head<P::states>();
  }
  static typename Observer::State observer_part(const Stacked& state) {
    return state.template tail<Observer::states>();
  }
};

/// ContinuousLoop{plant, observer, law}, optionally with measurement and noise.
/// @{
template <class P, class Observer, class Law>
ContinuousLoop(P, Observer, Law) -> ContinuousLoop<P, Observer, Law>;
template <class P, class Observer, class Law, class Measurement>
ContinuousLoop(P, Observer, Law, Measurement) -> ContinuousLoop<P, Observer, Law, Measurement>;
template <class P, class Observer, class Law, class Measurement, class Noise>
ContinuousLoop(P, Observer, Law, Measurement, Noise)
    -> ContinuousLoop<P, Observer, Law, Measurement, Noise>;
/// @}

/// The loop as on the real system: at each sample the observer is updated with the measurement and
/// the input that was held until now, and the law is computed once. Its u is held for a sample
/// time, over which only the plant is integrated.
///
/// A law with limits returns the limited u, because the actuator holds what the law returns.
template <Plant P, SampledObserverModel Observer, class Law, class Measurement = MeasuredOutput,
          class Noise = NoNoise>
requires ControlFunction<Law, typename P::State::Scalar, typename Observer::Estimate> &&
    MeasurementMap<Measurement, typename P::State::Scalar> &&
    NoiseSource<Noise, typename P::State::Scalar>
struct SampledLoop {
  using ScalarType = typename P::State::Scalar;  ///< scalar of the plant
  using Sample = LoopSample<P, Observer>;        ///< what the callback gets
  using End = LoopEnd<P, Observer>;              ///< what `run` returns

  /// Settings of run.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType duration{};                           ///< s, a whole multiple of `sample_time`
    ScalarType sample_time{};                        ///< T, s; that of the observer
    int substeps = 1;            ///< integration steps of the plant per sample, 1 or more
    ScalarType start_time{};     ///< s
    ScalarType initial_input{};  ///< u that was held before the start
    typename P::State plant_state = P::State::Zero();  ///< x at the start
  };

  P plant;                    ///< copied into the loop, like all members
  Observer observer;          ///< with its state one sample before the start
  Law law;                    ///< u(t, estimate), called once a sample
  Measurement measurement{};  ///< what the observer is fed
  Noise noise{};              ///< v, one value per sample

  /// Same as ContinuousLoop::run; `on_sample` is called once a sample and at the end, after the
  /// update. It sees the samples only, not the plant between them.
  template <ExplicitRungeKutta Method = RungeKutta4, std::invocable<const Sample&> Callback>
  Expected<End, Error<ScalarType>> run(const Config& config, Callback&& on_sample) const {
    const auto own = static_cast<typename Observer::scalar_type>(observer.sample_time());
    const auto given = static_cast<typename Observer::scalar_type>(config.sample_time);
    Rules<ScalarType> rules;
    rules.positive("sample_time", config.sample_time)
        .demand(esokit::detail::same(given, own), {.field = "sample_time",
                                                   .value = config.sample_time,
                                                   .rule = "must be that of the observer, which is",
                                                   .limit = static_cast<ScalarType>(own),
                                                   .has_limit = true});
    if (!rules) return rules.error();
    const auto samples =
        detail::whole_multiple("duration", config.duration, config.sample_time,
                               "must be a whole multiple of sample_time, which is");
    if (!samples) return samples.error();
    rules
        .demand(config.substeps >= 1, "substeps", static_cast<ScalarType>(config.substeps),
                "must be 1 or more")
        .finite("start_time", config.start_time)
        .finite("initial_input", config.initial_input)
        .all_of(detail::check_state("plant_state", config.plant_state));
    if (!rules) return rules.error();

    End end{config.start_time, 0, config.plant_state, observer, true};
    Noise source = noise;
    const ScalarType step = config.sample_time / static_cast<ScalarType>(config.substeps);
    ScalarType u = config.initial_input;
    for (std::int64_t k = 0;; ++k) {
      const ScalarType t = config.start_time + static_cast<ScalarType>(k) * config.sample_time;
      Sample sample;
      sample.index = k;
      sample.t = t;
      sample.plant_state = end.plant_state;
      sample.output = plant.output(t, end.plant_state);
      const auto v = static_cast<ScalarType>(source.at(k));
      sample.measurement = static_cast<ScalarType>(measurement(t, sample.output, v));
      sample.status = end.observer.update(sample.measurement, u);
      sample.estimate = end.observer.estimate();
      u = static_cast<ScalarType>(law(t, sample.estimate));
      sample.input = u;
      end.t = t;
      end.steps = k;
      end.completed = detail::keep_going(on_sample, sample);
      if (!end.completed || k == *samples) return end;

      const auto rate = [&](ScalarType time, const typename P::State& x) ->
          typename P::State { return plant.derivative(time, x, u); };
      end.plant_state = integrate<Method>(rate, t, end.plant_state, step, config.substeps);
    }
  }
};

/// SampledLoop{plant, observer, law}, optionally with measurement and noise.
/// @{
template <class P, class Observer, class Law>
SampledLoop(P, Observer, Law) -> SampledLoop<P, Observer, Law>;
template <class P, class Observer, class Law, class Measurement>
SampledLoop(P, Observer, Law, Measurement) -> SampledLoop<P, Observer, Law, Measurement>;
template <class P, class Observer, class Law, class Measurement, class Noise>
SampledLoop(P, Observer, Law, Measurement, Noise)
    -> SampledLoop<P, Observer, Law, Measurement, Noise>;
/// @}

}  // namespace esokit::sim
