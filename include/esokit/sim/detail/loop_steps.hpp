/// @file
/// Common parts of the loops: the number of samples in a duration, and the callback.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <limits>
#include <type_traits>

namespace esokit::sim::detail {

/// Checks that `value` is positive and a whole multiple of `part`, and returns the multiple. Both
/// may be rounded decimals. @param precision spacing of the coarser scalar around one
template <PlainScalar ScalarType>
Expected<std::int64_t, Error<ScalarType>> whole_multiple(
    const char* field, ScalarType value, ScalarType part, const char* rule,
    ScalarType precision = std::numeric_limits<ScalarType>::epsilon()) {
  if (Rules<ScalarType> rules; !rules.positive(field, value)) return rules.error();
  const ScalarType ratio = value / part;
  const ScalarType whole = (std::round)(ratio);
  const ScalarType decimal = static_cast<ScalarType>(1e-9);
  const ScalarType rounding = precision * ScalarType{16};
  const ScalarType tolerance = decimal > rounding ? decimal : rounding;
  const ScalarType most = static_cast<ScalarType>(std::int64_t{1} << 40u);
  if (!is_finite(ratio) || !(whole >= ScalarType{1} && whole <= most) ||
      !((std::abs)(ratio - whole) <= tolerance * whole)) {
    return Error<ScalarType>{
        .field = field, .value = value, .rule = rule, .limit = part, .has_limit = true};
  }
  return static_cast<std::int64_t>(whole);
}

/// Calls the callback with the sample, and with further arguments if it takes them. True unless it
/// returned false.
template <class Callback, class Sample, class... More>
bool keep_going(Callback& on_sample, const Sample& sample, More&... more) {
  if constexpr (sizeof...(More) > 0 && !std::invocable<Callback&, const Sample&, More&...>) {
    return keep_going(on_sample, sample);
  } else if constexpr (std::convertible_to<std::invoke_result_t<Callback&, const Sample&, More&...>,
                                           bool>) {
    return static_cast<bool>(on_sample(sample, more...));
  } else {
    on_sample(sample, more...);
    return true;
  }
}

}  // namespace esokit::sim::detail
