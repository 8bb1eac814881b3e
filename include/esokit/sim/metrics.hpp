/// @file
/// Criteria of a recorded response. Inside a loop use the accumulators on which they are based:
/// Trapezoid, PeakMeter, StepResponse.
#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/core/expected.hpp>
#include <esokit/sim/peak.hpp>           // IWYU pragma: export
#include <esokit/sim/series.hpp>         // IWYU pragma: export
#include <esokit/sim/step_response.hpp>  // IWYU pragma: export
#include <esokit/sim/trapezoid.hpp>      // IWYU pragma: export
#include <esokit/sim/window.hpp>         // IWYU pragma: export
#include <optional>

namespace esokit::sim {

/// Integral of integrand(t, value) over the window by the trapezoid rule; times in seconds.
template <PlainScalar ScalarType, class Integrand>
Trapezoid<ScalarType> accumulate(const Series<ScalarType>& series, const Window<ScalarType>& window,
                                 Integrand&& integrand) {
  Trapezoid<ScalarType> sum(window);
  for (std::size_t i = 0; i < series.size(); ++i) {
    const ScalarType t = series.time(i);
    sum.add(t, integrand(t, series.value(i)));
  }
  return sum;
}

/// Integral of e.
template <PlainScalar ScalarType>
ScalarType integral(const Series<ScalarType>& series, const Window<ScalarType>& window = {}) {
  return accumulate(series, window, [](ScalarType, ScalarType e) { return e; }).value();
}

/// Integral of abs(e) (IAE).
template <PlainScalar ScalarType>
ScalarType integral_abs(const Series<ScalarType>& series, const Window<ScalarType>& window = {}) {
  return accumulate(series, window, [](ScalarType, ScalarType e) { return (std::abs)(e); }).value();
}

/// Integral of e^2 (ISE).
template <PlainScalar ScalarType>
ScalarType integral_square(const Series<ScalarType>& series,
                           const Window<ScalarType>& window = {}) {
  return accumulate(series, window, [](ScalarType, ScalarType e) { return e * e; }).value();
}

/// Integral of (t - origin) abs(e) (ITAE); `origin` is the time of the step, in seconds.
template <PlainScalar ScalarType>
ScalarType integral_time_abs(const Series<ScalarType>& series,
                             const Window<ScalarType>& window = {}, ScalarType origin = {}) {
  return accumulate(series, window,
                    [origin](ScalarType t, ScalarType e) { return (t - origin) * (std::abs)(e); })
      .value();
}

/// Root mean square over the time covered; nothing if this time is zero.
template <PlainScalar ScalarType>
std::optional<ScalarType> rms(const Series<ScalarType>& series,
                              const Window<ScalarType>& window = {}) {
  const auto sum = accumulate(series, window, [](ScalarType, ScalarType e) { return e * e; });
  if (!(sum.duration() > ScalarType{})) return std::nullopt;
  return std::sqrt(sum.value() / sum.duration());
}

/// The sample of largest magnitude; nothing if the window holds no sample.
template <PlainScalar ScalarType>
std::optional<Peak<ScalarType>> peak(const Series<ScalarType>& series,
                                     const Window<ScalarType>& window = {}) {
  PeakMeter<ScalarType> meter(window);
  for (std::size_t i = 0; i < series.size(); ++i) meter.add(series.time(i), series.value(i));
  return meter.value();
}

/// Overshoot, settling time and rise time: a StepResponse to which all samples were added. Returns
/// the same errors as StepResponse::make.
template <PlainScalar ScalarType>
Expected<StepResponse<ScalarType>, Error<ScalarType>> step_response(
    const Series<ScalarType>& series, const typename StepResponse<ScalarType>::Config& config) {
  auto meter = StepResponse<ScalarType>::make(config);
  if (!meter) return meter;
  for (std::size_t i = 0; i < series.size(); ++i) meter->add(series.time(i), series.value(i));
  return meter;
}

}  // namespace esokit::sim
