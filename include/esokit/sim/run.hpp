/// @file
/// run(plant, controller, config): simulates the sampled loop of a plant and a controller as on the
/// real system.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <esokit/control/controller.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/math/detail/fine_sum.hpp>
#include <esokit/sim/counted_gaussian.hpp>
#include <esokit/sim/detail/loop_steps.hpp>
#include <esokit/sim/detail/plant_step.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/plant.hpp>
#include <esokit/sim/run_config.hpp>
#include <esokit/sim/run_result.hpp>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit::sim {

namespace detail {

/// Noise, losses and jitter of a run, each with its own random numbers, so that a change of one
/// does not affect the others.
template <class P, class C>
class RunChance {
  using Types = RunTypes<P, C>;
  using S = typename Types::S;
  using Time = typename Types::Time;
  using Output = typename Types::Output;

 public:
  explicit RunChance(const RunConfig<P, C>& config) : config_(config) {
    bool noisy = false;
    each_number(config.noise,
                [&](const S& deviation) { noisy = noisy || !all(deviation <= S(0.0)); });
    if (config.number) {
      const auto counted = [&](RandomStream stream, int index = 0) {
        return CountedGaussian<S>(config.seed, stream, *config.number, index);
      };
      for (int i = 0; noisy && i < Types::outputs; ++i) {
        counted_noise_.push_back(counted(RandomStream::noise, i));
      }
      if (config.missing > Time(0)) counted_losses_.emplace(counted(RandomStream::losses));
      if (config.jitter > Time(0)) counted_jitter_.emplace(counted(RandomStream::jitter));
    } else {
      if (noisy) noise_.emplace(config.seed);
      if (config.missing > Time(0)) losses_.emplace(config.seed + 1);
      if (config.jitter > Time(0)) jitter_.emplace(config.seed + 2);
    }
    const bool whole = !(config.missing > Time(0)) && !config.sensor;
    quiet_ = !noisy && whole;
    only_noise_ = config.number && noisy && whole;
  }

  /// The measurement of y that the controller gets.
  ESOKIT_INLINE Output measured(Time t, Output y) {
    if (quiet_) return y;
    if (only_noise_) return with_counted_noise(y);
    return disturbed(t, y);
  }

  /// Whether the measurement is y.
  [[nodiscard]] bool quiet() const noexcept { return quiet_; }

  /// Time from this sample to the next, s.
  Time step_time(std::int64_t k, const Time& sample_time) {
    if (config_.step_time) return config_.step_time(k);
    const double uniform =
        counted_jitter_
            ? static_cast<double>(esokit::detail::number_of_lane(counted_jitter_->uniform(), 0))
            : jitter_->uniform();
    const auto share = static_cast<Time>(2.0 * uniform - 1.0);
    return sample_time * (Time(1) + config_.jitter * share);
  }

 private:
  ESOKIT_INLINE Output with_counted_noise(const Output& y) {
    Output noise = config_.noise;
    auto* random = counted_noise_.data();
    each_number(noise, [&](S& deviation)
                           ESOKIT_INLINE_LAMBDA { deviation = deviation * (random++)->next(); });
    return y + noise;
  }
  ESOKIT_COLD Output disturbed(Time t, Output y) {
    Output measured = counted_noise_.empty() ? y : with_counted_noise(y);
    if (noise_) {
      Output noise = config_.noise;
      each_number(noise, [&](S& deviation) {
        for (int i = 0; i < lane_count<S>; ++i) {
          esokit::detail::set_lane(
              deviation,
              esokit::detail::number_of_lane(deviation, i) * static_cast<Time>(noise_->next()), i);
        }
      });
      measured = measured + noise;
    }
    if (config_.sensor) measured = config_.sensor(t, measured);
    if (losses_ || counted_losses_) lose(measured);
    return measured;
  }

  void lose(Output& measured) {
    const auto missing = static_cast<double>(config_.missing);
    bool lost[static_cast<std::size_t>(lane_count<S>)];
    if (losses_) {
      for (bool& one : lost) one = losses_->uniform() < missing;
    } else {
      const S uniform = counted_losses_->uniform();
      for (int i = 0; i < lane_count<S>; ++i) {
        lost[i] = static_cast<double>(esokit::detail::number_of_lane(uniform, i)) < missing;
      }
    }
    each_number(measured, [&](S& number) {
      for (int i = 0; i < lane_count<S>; ++i) {
        if (lost[i]) esokit::detail::set_lane(number, std::numeric_limits<Time>::quiet_NaN(), i);
      }
    });
  }

  const RunConfig<P, C>& config_;
  bool quiet_ = false;
  bool only_noise_ = false;  ///< counter-based; the usual case of many runs
  std::optional<Gaussian> noise_, losses_, jitter_;
  std::vector<CountedGaussian<S>> counted_noise_;  ///< one per output
  std::optional<CountedGaussian<S>> counted_losses_, counted_jitter_;
};

/// A signal of a run in its loop: a constant is read once, as no compiler knows that it is one.
template <class Signal>
class RunningSignal {
  using Time = typename Signal::Time;
  using Value = typename Signal::Value;

 public:
  explicit RunningSignal(const Signal& signal) : signal_(signal), constant_(signal.constant()) {
    if (constant_) signal.write(Time(0), now_);
  }

  /// Its value at t, from now on that of `now`.
  ESOKIT_INLINE const Value& at(const Time& t) {
    if (!constant_) signal_.write(t, now_);
    return now_;
  }
  [[nodiscard]] ESOKIT_INLINE const Value& now() const noexcept { return now_; }
  /// A constant was checked before.
  [[nodiscard]] ESOKIT_INLINE bool finite() const noexcept {
    return constant_ || finite_throughout(now_);
  }

 private:
  const Signal& signal_;
  bool constant_;
  Value now_{};
};

/// A run with checked settings.
template <class P, class C>
class Run {
  using Types = RunTypes<P, C>;
  using S = typename Types::S;
  using Own = typename Types::ControllerScalar;
  using Time = typename Types::Time;
  using Input = typename Types::Input;
  using Output = typename Types::Output;
  using Reference = Vector<S, Types::references>;
  using Outcome = Expected<RunEnd<P, C>, Error<Time>>;

 public:
  Run(const P& plant, const RunConfig<P, C>& config, Time sample_time, Time dead_time,
      std::int64_t samples)
      : plant_(plant),
        config_(config),
        sample_time_(sample_time),
        dead_time_(dead_time),
        samples_(samples),
        even_(!config.step_time && !(config.jitter > Time(0))),
        oldest_(static_cast<int>(std::ceil(dead_time / shortest())) + 1),
        inputs_(oldest_, config.initial_input),
        lengths_(even_ ? 0 : oldest_, sample_time),
        chance_(config) {
    if constexpr (is_linear_plant<P> && Types::outputs == 1) {
      for (int i = 0; i < P::states; ++i) {
        const S from_first = plant.c(i) - S(i == 0 ? 1.0 : 0.0);
        first_ = first_ && all(esokit::detail::absolute(from_first) <= S(0.0));
      }
    }
  }

  template <class Callback>
  Outcome operator()(const C& controller, Callback& on_sample) {
    if (!even_) return drive<false, false>(controller, on_sample);
    if (auto ok = cut(sample_time_); !ok) {
      Error<Time> error = ok.error();
      error.field = "sample_time";
      return error;
    }
    if (steps_.size() > 1 || stretches_[0].age > 0)
      return drive<true, false>(controller, on_sample);
    if (first_ && chance_.quiet()) return drive<true, true, true>(controller, on_sample);
    return drive<true, true>(controller, on_sample);
  }

 private:
  /// The shortest possible sample.
  [[nodiscard]] Time shortest() const { return even_ ? sample_time_ : sample_time_ / Time(10); }

  /// Computes the stretches of a sample of this length.
  Check<Time> cut(const Time& whole) {
    arrivals_.assign(1, dead_time_);
    for (int age = 0; arrivals_.back() > rounding_of(whole); ++age) {
      arrivals_.push_back(even_ ? dead_time_ - static_cast<Time>(age + 1) * sample_time_
                                : arrivals_.back() - lengths_[age]);
    }
    cut_sample(stretches_, whole, config_.substeps, arrivals_);
    steps_.clear();
    for (const auto& stretch : stretches_) {
      const auto step = PlantStep<P>::make(plant_, stretch.length);
      if (!step) return step.error();
      steps_.push_back(*step);
    }
    return {};
  }

  /// @tparam First if y may be the first state, it is
  template <bool First>
  ESOKIT_INLINE Output output(const Time& t, const typename P::State& x) const {
    if constexpr (is_linear_plant<P>) {
      if constexpr (Types::outputs == 1) {
        if (First || first_) return x(0);
      }
      return plant_.output(x);
    } else {
      return plant_.output(t, x);
    }
  }

  /// Calls use(r), with derivatives if the controller takes them.
  template <class Use>
  ESOKIT_INLINE static void with(const Reference& reference, bool plain, const Use& use) {
    if constexpr (Types::references == 1) {
      use(in_scalar<Own>(reference(0)));
    } else if constexpr (Types::derivatives) {
      if (plain) [[likely]] {
        use(in_scalar<Own>(reference(0)));
      } else {
        use(in_scalar<Own>(reference));
      }
    } else {
      use(in_scalar<Own>(reference));
    }
  }

  /// The reference without its derivatives.
  ESOKIT_INLINE static auto of_channels(const Reference& reference) {
    if constexpr (Types::references > 1 && !Types::derivatives) {
      return reference;
    } else {
      return reference(0);
    }
  }

  /// The controller's u.
  ESOKIT_INLINE static Input asked(C& controller, const Output& measurement,
                                   const Reference& reference, bool plain) {
    Input u;
    with(reference, plain, [&](const auto& r) ESOKIT_INLINE_LAMBDA {
      using Wanted = ScalarOrVector<Own, Types::inputs>;
      u = in_scalar<S>(
          static_cast<Wanted>(esokit::detail::command(controller, in_scalar<Own>(measurement), r)));
    });
    return u;
  }

  [[nodiscard]] Check<Time> allowed(Time passed) const {
    if (esokit::detail::at_most(shortest(), passed) &&
        esokit::detail::at_most(passed, Time(sample_time_ * Time(10)))) {
      return {};
    }
    return Error<Time>{"step_time", passed,       "must be 0.1 .. 10 times sample_time, which is",
                       -1,          sample_time_, true};
  }

  /// Moves x through the stretches of the sample at t. @return false if the disturbance was not
  /// finite
  template <class Disturbance>
  ESOKIT_INLINE bool pass(const Time& t, typename P::State& x, Disturbance& disturbance) {
    bool good = true;
    for (std::size_t i = 0; i < stretches_.size(); ++i) {
      const Time start = t + stretches_[i].start;
      const auto& d = disturbance.at(start);
      good = good && disturbance.finite();
      x = steps_[i](start, x, inputs_[stretches_[i].age], d);
    }
    return good;
  }

  /// @tparam Even all samples are equally long @tparam Direct each is one stretch under its own u
  /// @tparam Plain the measurement is y, and y needs no product with C
  template <bool Even, bool Direct, bool Plain = false, class Callback>
  [[gnu::__noinline__]] Outcome drive(C controller, Callback& on_sample) {
    // Local copies of everything that is used in every sample, so that the compiler knows that
    // nothing changes it.
    auto x = config_.state;
    Time t = config_.start_time;
    esokit::detail::FineSum<Time> clock(t);
    Time passed = sample_time_;  // time since the last sample
    RunningSignal reference(config_.reference);
    RunningSignal disturbance(config_.disturbance);
    (void)reference.at(t);
    const bool plain = config_.reference.plain();
    const auto direct = [&] {
      if constexpr (Direct) {
        return steps_[0];
      } else {
        return nullptr;
      }
    }();
    if constexpr (controller_traits<C>.two_phases) {
      with(reference.now(), plain, [&](const auto& r) { controller.set_reference(r); });
    }
    for (std::int64_t k = 0;; ++k) {
      const Output y = output<Plain>(t, x);
      const Output measurement = Plain ? y : chance_.measured(t, y);
      if constexpr (!Even && controller_traits<C>.varies_time) {
        if (const auto ok = controller.elapsed(Own(passed)); !ok) {
          return as_error<Time>(ok.error());
        }
      }
      if constexpr (controller_traits<C>.takes_measured) {
        controller.measured(in_scalar<Own>(config_.measured(t)(0)));
      }
      const Input u = asked(controller, measurement, reference.now(), plain);
      if (!finite_throughout(u)) [[unlikely]] {
        return Error<Time>{"controller", t, "gave an input that is not finite at this time"};
      }
      Time end = config_.start_time + static_cast<Time>(k + 1) * sample_time_;
      if constexpr (!Even) {
        passed = chance_.step_time(k, sample_time_);
        if (const auto ok = allowed(passed); !ok) return ok.error();
        clock.add(passed);
        end = clock.value();
      }
      RunSample<P, C> sample{k, t, x, y, measurement, of_channels(reference.now()), u};
      (void)reference.at(end);
      if constexpr (controller_traits<C>.two_phases) {
        with(reference.now(), plain, [&](const auto& r) { (void)controller.prepare(r); });
      }
      if (!keep_going(on_sample, std::as_const(sample), controller)) {
        return RunEnd<P, C>{t, k + 1, x, std::move(controller), false};
      }

      bool good = true;
      if constexpr (Direct) {
        const auto& d = disturbance.at(t);
        good = disturbance.finite();
        x = direct(t, x, u, d);
      } else {
        inputs_.push(u);
        if constexpr (!Even) {
          if (auto ok = cut(passed); !ok) return ok.error();
          lengths_.push(passed);
        }
        good = pass(t, x, disturbance);
      }
      if (!good) [[unlikely]] {
        return Error<Time>{"disturbance", t, "is not finite in the sample at this time"};
      }
      if (!finite_throughout(x)) [[unlikely]] {
        return Error<Time>{"plant", t,
                           "has a state that is not finite after the sample at this time"};
      }
      t = end;
      if (k + 1 == samples_) return RunEnd<P, C>{t, k + 1, x, std::move(controller), true};
    }
  }

  const P& plant_;
  const RunConfig<P, C>& config_;
  Time sample_time_, dead_time_;
  std::int64_t samples_;
  bool even_;
  int oldest_;         ///< largest age of an input, samples
  bool first_ = true;  ///< y needs no product with C: a linear plant's is its first state
  InputQueue<Input> inputs_;
  InputQueue<Time> lengths_;
  RunChance<P, C> chance_;
  std::vector<Time> arrivals_;
  std::vector<Stretch<Time>> stretches_;
  std::vector<PlantStep<P>> steps_;  ///< one per stretch
};

}  // namespace detail

/// Simulates a plant with a controller as on the real system: at each sample the controller gets
/// the measurement and the reference, and the u that it returns is held until the next sample.
///
/// ```cpp
/// auto run = sim::run(plant, controller, {.duration = 2.0, .reference = 1.0, .noise = 1e-3});
/// ```
///
/// A linear plant is sampled exactly, others are integrated (Runge-Kutta of order 4, `substeps`
/// steps per sample). Inputs change between integration steps only. For continuous simulation as in
/// the papers use ContinuousLoop.
///
/// The controller is copied, and the copy is in the result. Limits are the controller's task: the
/// simulation adds none to the u that it returns.
/// @param plant LinearPlant, nonlinear_plant(..), or a type with `derivative` and `output`
/// @param controller any controller of esokit, or your own `u = controller(y, reference)`, for
///        example a lambda; y is NaN if the measurement is missing
/// @param on_sample called once a sample with a RunSample, after the controller, and with the
///        controller itself if it takes a second argument (to retune it, say); if it returns false,
///        the run stops
/// @return the end of the run; or an error that names the field of the config, or `plant`,
///         `controller`, `disturbance` or `sensor` with the time at which its result was not finite
template <SampledPlant P, class C, class Callback>
requires(detail::is_a_controller<C, P>())
    Expected<RunEnd<P, C>, Error<typename RunTypes<P, C>::Time>> run(
        const P& plant, C controller, const std::type_identity_t<RunConfig<P, C>>& config,
        Callback&& on_sample) {
  using Types = RunTypes<P, C>;
  using S = typename Types::S;
  using Time = typename Types::Time;
  using Own = typename Types::ControllerScalar;

  const auto sample_time = detail::run_sample_time<P, C>(controller, config);
  if (!sample_time) return sample_time.error();
  const Time T = *sample_time;
  const auto coarser =
      (std::max)(static_cast<Time>(std::numeric_limits<LaneScalar<Own>>::epsilon()),
                 std::numeric_limits<Time>::epsilon());
  const auto samples = detail::whole_multiple(
      "duration", config.duration, T, "must be a whole multiple of sample_time, which is", coarser);
  if (!samples) return samples.error();
  Rules<Time> rules;
  const auto numbers_of = [&](const char* field, const auto& numbers, auto rule) {
    int index = 0;
    const bool several = esokit::detail::vector_size<std::remove_cvref_t<decltype(numbers)>> > 1;
    detail::each_number(numbers, [&](const S& number) {
      for (int i = 0; i < lane_count<S>; ++i) {
        (rules.*rule)(field, esokit::detail::number_of_lane(number, i), several ? index : -1);
      }
      ++index;
    });
  };
  using Rule = Rules<Time>& (Rules<Time>::*)(const char*, const Time&, int);
  const Rule finite = &Rules<Time>::finite, not_negative = &Rules<Time>::not_negative;
  if (config.reference.constant()) numbers_of("reference", config.reference(Time(0)), finite);
  if (config.disturbance.constant()) numbers_of("disturbance", config.disturbance(Time(0)), finite);
  numbers_of("noise", config.noise, not_negative);
  rules.not_negative("missing", config.missing)
      .demand(!(config.missing > Time(1)), "missing", config.missing, "must not be above 1")
      .not_negative("jitter", config.jitter)
      .demand(!(config.jitter > Time(0.9)), "jitter", config.jitter, "must not be above 0.9")
      .demand(lane_count<S> == 1 || !config.number || !(config.jitter > Time(0)), "jitter",
              config.jitter, "must be left out if packs run by number")
      .not_negative("dead_time", config.dead_time)
      .demand(config.substeps >= 1 && config.substeps <= 1000000, "substeps",
              static_cast<Time>(config.substeps), "must be 1 .. 1000000")
      .finite("start_time", config.start_time);
  numbers_of("initial_input", config.initial_input, finite);
  numbers_of("state", config.state, finite);
  Time dead_time = config.dead_time;
  if constexpr (detail::is_linear_plant<P>) {
    if (const auto ok = plant.validate(); rules && !ok) {
      return detail::as_error<Time>(ok.error());
    }
    const Time first = esokit::detail::number_of_lane(plant.dead_time, 0);
    for (int i = 1; i < lane_count<S>; ++i) {
      const Time other = esokit::detail::number_of_lane(plant.dead_time, i);
      rules.demand(esokit::detail::same(other, first), "dead_time", other,
                   "must be the same in all lanes");
    }
    dead_time += first;
  }
  const bool even = !(config.jitter > Time(0)) && !config.step_time;
  const Time shortest = even ? T : T / Time(10);
  rules.demand(esokit::detail::below(Time(dead_time / shortest), Time(1e6)), "dead_time", dead_time,
               "must be below 1e6 samples (1e5 with jitter)");
  if (!rules) return rules.error();

  detail::Run<P, C> driven(plant, config, T, dead_time, *samples);
  return driven(controller, on_sample);
}

/// The same, with a recording of all samples.
template <SampledPlant P, class C>
requires(detail::is_a_controller<C, P>())
    Expected<Recording<P, C>, Error<typename RunTypes<P, C>::Time>> run(
        const P& plant, C controller, const std::type_identity_t<RunConfig<P, C>>& config) {
  RunRecord<P, C> record;
  auto end = run(plant, std::move(controller), config,
                 [&](const auto& sample, const C& now) { record.add(sample, now); });
  if (!end) return end.error();
  return Recording<P, C>{std::move(*end), std::move(record)};
}

}  // namespace esokit::sim
