/// @file
/// The parts of a run: a sample cut where another input arrives, and a plant advanced over one of
/// these parts.
#pragma once

#include <algorithm>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/sim/held_plant.hpp>
#include <esokit/sim/run_config.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <limits>
#include <type_traits>
#include <vector>

namespace esokit::sim {

namespace detail {

/// A part of a sample in which the input that arrives at the plant is constant.
template <class Time>
struct Stretch {
  Time start;   ///< s after the sample
  Time length;  ///< s
  int age;      ///< age of the input, samples; 0: the newest
};

/// Stretches of up to this length are rounding errors and are dropped.
template <class Time>
Time rounding_of(const Time& sample_time) {
  return sample_time * (std::max)(Time(1e-9), 16 * std::numeric_limits<Time>::epsilon());
}

/// Divides a sample of length `whole` into stretches: at the integration steps, and where another
/// input arrives after the dead time. Cuts that differ by rounding only are the same.
/// @param arrivals when the input of age 0, 1, .. arrives, s after the sample; the last one has
///        already arrived
template <class Time>
void cut_sample(std::vector<Stretch<Time>>& stretches, const Time& whole, int substeps,
                const std::vector<Time>& arrivals) {
  const Time rounding = rounding_of(whole);
  stretches.clear();
  int age = static_cast<int>(arrivals.size()) - 1;
  Time from(0);
  for (int i = 1; i <= substeps;) {
    const Time grid =
        i == substeps ? whole : whole * static_cast<Time>(i) / static_cast<Time>(substeps);
    const Time next = age > 0 ? arrivals[static_cast<std::size_t>(age - 1)] : whole;
    const bool another = age > 0 && next < grid - rounding;
    const Time to = another ? next : grid;
    if (to - from > rounding) {
      stretches.push_back({from, to - from, age});
      from = to;
    }
    if (!another) ++i;
    if (i <= substeps && age > 0 && next <= to + rounding) --age;
  }
}

/// The inputs that have not arrived at the plant yet.
template <class Input>
class InputQueue {
 public:
  InputQueue(int length, const Input& before)
      : inputs_(static_cast<std::size_t>(length) + 1, before) {}

  void push(const Input& u) {
    newest_ = newest_ + 1 == inputs_.size() ? 0 : newest_ + 1;
    inputs_[newest_] = u;
  }
  /// @param age samples; 0 is the one pushed last
  const Input& operator[](int age) const {
    const auto back = static_cast<std::size_t>(age);
    return inputs_[newest_ >= back ? newest_ - back : newest_ + inputs_.size() - back];
  }

 private:
  std::vector<Input> inputs_;
  std::size_t newest_ = 0;
};

/// Converts an error to the scalar of time; of a pack its first lane.
template <class Time, class From>
Error<Time> as_error(const Error<From>& error) {
  const auto one = [](const From& x) {
    return static_cast<Time>(esokit::detail::number_of_lane(x, 0));
  };
  return {error.field,      one(error.value), error.rule, error.index,
          one(error.limit), error.has_limit,  error.lane};
}

/// The sample time T, or an error if it does not fit the controller.
template <class P, class C>
Expected<typename RunTypes<P, C>::Time, Error<typename RunTypes<P, C>::Time>> run_sample_time(
    const C& controller, const RunConfig<P, C>& config) {
  using Time = typename RunTypes<P, C>::Time;
  Time given = config.sample_time;
  Rules<Time> rules;
  if constexpr (controller_traits<C>.knows_sample_time) {
    const auto own = controller.sample_time();
    using Own = std::remove_cvref_t<decltype(own)>;
    using OwnTime = LaneScalar<Own>;
    rules.not_negative("sample_time", given);
    if (!rules) return rules.error();
    if (!(given > Time(0))) given = static_cast<Time>(esokit::detail::number_of_lane(own, 0));
    for (int i = 0; i < lane_count<Own>; ++i) {
      const OwnTime in_lane = esokit::detail::number_of_lane(own, i);
      const auto asked = static_cast<OwnTime>(given);
      rules.demand(esokit::detail::same(asked, in_lane),
                   {"sample_time", given, "must be that of the controller, which is", -1,
                    static_cast<Time>(in_lane), true});
    }
  }
  rules.positive("sample_time", given);
  if (!rules) return rules.error();
  return given;
}

/// Advances the plant over one stretch.
template <class P>
class PlantStep {
  using Time = LaneScalar<typename PlantScalarOf<P>::type>;

 public:
  static Expected<PlantStep, Error<Time>> make(const P& plant, const Time& length) {
    return PlantStep(plant, length);
  }

  template <class Input, class Disturbance>
  ESOKIT_INLINE typename P::State operator()(const Time& t, const typename P::State& x,
                                             const Input& u, const Disturbance& d) const {
    Input sum = u;
    if constexpr (esokit::detail::vector_size<Input> == 0) {
      sum = sum + d(0);
    } else {
      sum += d;
    }
    const auto rate = [&](const Time& time, const typename P::State& state) {
      return plant_->derivative(time, state, sum);
    };
    return sim::step(rate, t, x, length_);
  }

 private:
  PlantStep(const P& plant, const Time& length) : plant_(&plant), length_(length) {}

  const P* plant_;
  Time length_;
};

/// Advances a linear plant exactly.
template <int States, class S, int Inputs, int Outputs>
class PlantStep<LinearPlant<States, S, Inputs, Outputs>> {
  using P = LinearPlant<States, S, Inputs, Outputs>;
  using Time = LaneScalar<S>;

 public:
  static Expected<PlantStep, Error<Time>> make(const P& plant, const Time& length) {
    const auto held = held_plant(plant, S(length));
    if (!held) return as_error<Time>(held.error());
    return PlantStep(*held);
  }

  template <class Input>
  ESOKIT_INLINE typename P::State operator()(const Time&, const typename P::State& x,
                                             const Input& u, const Vector<S, Inputs>& d) const {
    return held_.advanced(x, Vector<S, Inputs>(u), d);
  }

 private:
  explicit PlantStep(const HeldPlant<States, S, Inputs>& held) : held_(held) {}

  HeldPlant<States, S, Inputs> held_;
};
}  // namespace detail

}  // namespace esokit::sim
