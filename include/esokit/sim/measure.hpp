/// @file
/// Measure: a criterion of a run, one number computed from its samples.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>

namespace esokit::sim {

/// The samples that a Measure uses, and the limit for its result.
struct MeasureOptions {
  [[no_unique_address]] ByName<MeasureOptions> by_name{};  ///< nothing to set, see ByName
  double from = 0.0;                                       ///< s, time of the first sample used
  double to = std::numeric_limits<double>::infinity();     ///< s, time of the last sample used

  /// The result must not be above this; finite, or left out.
  double limit = std::numeric_limits<double>::infinity();
};

/// A criterion of a run, one number computed from `of(sample)` or `of(sample, controller)` at its
/// samples.
///
/// The function must accept any scalar, because it is also called with packs of runs. Made by
/// `largest`, `average`, `root_mean_square`, `final_value` and `settling_time`. A run fails if its
/// result is not finite, if its window has no sample, or, for `largest` and `settling_time`, if
/// of(sample) is not finite in the window.
template <class Reduce, class F>
struct Measure {
  std::string name;        ///< name of the criterion
  F of;                    ///< function of a sample
  MeasureOptions options;  ///< window and limit
  Reduce reduce{};         ///< reduces the numbers of all samples to one
};

namespace detail {

struct Largest {
  static constexpr bool needs_each = true;  ///< a comparison would ignore a NaN
  template <class S>
  static S start() {
    return S(std::numeric_limits<LaneScalar<S>>::lowest());
  }
  template <class S>
  ESOKIT_INLINE void add(S& sum, const S& value, const LaneScalar<S>&) const {
    sum = select(sum < value, value, sum);
  }
  static double end(double sum, double) { return sum; }
};
struct Average {
  static constexpr bool needs_each = false;
  template <class S>
  static S start() {
    return S(0.0);
  }
  template <class S>
  ESOKIT_INLINE void add(S& sum, const S& value, const LaneScalar<S>&) const {
    sum = sum + value;
  }
  static double end(double sum, double samples) { return sum / samples; }
};
struct RootMeanSquare : Average {
  template <class S>
  ESOKIT_INLINE void add(S& sum, const S& value, const LaneScalar<S>&) const {
    sum = sum + value * value;
  }
  static double end(double sum, double samples) { return std::sqrt(sum / samples); }
};
struct FinalValue : Average {
  template <class S>
  ESOKIT_INLINE void add(S& sum, const S& value, const LaneScalar<S>&) const {
    sum = value;
  }
  static double end(double sum, double) { return sum; }
};
struct SettlingTime : FinalValue {
  static constexpr bool needs_each = true;
  template <class S>
  ESOKIT_INLINE void add(S& sum, const S& value, const LaneScalar<S>& passed) const {
    sum = select(esokit::detail::absolute(value) > S(band), S(static_cast<double>(passed)), sum);
  }
  double band;
};

/// A controller as a Measure sees it.
template <class C>
const auto& seen(const C& controller) noexcept {
  if constexpr (requires { controller.together(); }) {
    return controller.together();
  } else {
    return controller;
  }
}

/// Accumulates one result per lane of a run or pack of runs.
template <class S, class Reduce, class F>
struct Meter {
  explicit Meter(const Measure<Reduce, F>& m) : measure(m), sum(Reduce::template start<S>()) {}

  template <class Sample, class Control>
  ESOKIT_INLINE void add(const Sample& sample, const Control& given) {
    const auto& controller = detail::seen(given);
    using Now = std::remove_cvref_t<decltype(controller)>;
    using Seconds = LaneScalar<S>;
    // Whether a sample is used must not depend on the rounding of t.
    const double t = static_cast<double>(sample.t);
    if (t < measure.options.from - 1e-9 || t > measure.options.to + 1e-9) return;
    ++samples;
    const auto passed = static_cast<Seconds>(t - measure.options.from);
    const S value = [&] {
      if constexpr (std::is_invocable_v<const F&, const Sample&, const Now&>) {
        return S(measure.of(sample, controller));
      } else {
        return S(measure.of(sample));
      }
    }();
    if constexpr (Reduce::needs_each) finite = finite && all(is_finite(value));
    measure.reduce.add(sum, value, passed);
  }
  [[nodiscard]] double number(int lane) const {
    return measure.reduce.end(static_cast<double>(esokit::detail::number_of_lane(sum, lane)),
                              static_cast<double>(samples));
  }
  [[nodiscard]] const char* wrong(double number) const {
    if (samples == 0) return "(its window) has no sample";
    return finite && is_finite(number) ? nullptr : "(its number) is not finite";
  }

  const Measure<Reduce, F>& measure;
  S sum;
  std::int64_t samples = 0;
  bool finite = true;
};

}  // namespace detail

/// The largest of(sample) in a run: for `s.output - s.reference` the overshoot.
template <class F>
Measure<detail::Largest, F> largest(std::string name, F of, MeasureOptions options = {}) {
  return {std::move(name), std::move(of), options};
}
/// The mean of of(sample) over the samples of a run.
template <class F>
Measure<detail::Average, F> average(std::string name, F of, MeasureOptions options = {}) {
  return {std::move(name), std::move(of), options};
}
/// The root mean square of of(sample).
template <class F>
Measure<detail::RootMeanSquare, F> root_mean_square(std::string name, F of,
                                                    MeasureOptions options = {}) {
  return {std::move(name), std::move(of), options};
}
/// of(sample) at the last sample.
template <class F>
Measure<detail::FinalValue, F> final_value(std::string name, F of, MeasureOptions options = {}) {
  return {std::move(name), std::move(of), options};
}
/// The last time at which abs(of(sample)) was above `band`, s after `options.from`.
/// @param band 0 or above
template <class F>
Measure<detail::SettlingTime, F> settling_time(std::string name, F of, double band,
                                               MeasureOptions options = {}) {
  return {std::move(name), std::move(of), options, {{}, band}};
}

}  // namespace esokit::sim
