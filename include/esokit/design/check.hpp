/// @file
/// The rules that configs are checked against, each with its own wording.
#pragma once

#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>
#include <limits>

namespace esokit {

/// Outcome of a check: success, or the error of the value.
template <Scalar S>
using Check = Expected<void, Error<S>>;

namespace detail {

/// Smallest positive normal number of the scalar, or of double for types that do not say.
template <Scalar S>
constexpr S smallest_normal() noexcept {
  if constexpr (std::numeric_limits<S>::is_specialized) {
    return (std::numeric_limits<S>::min)();
  } else {
    return S((std::numeric_limits<double>::min)());
  }
}

template <Scalar S>
constexpr S magnitude(const S& value) noexcept {
  return select(value < S(0.0), S(-value), value);
}

}  // namespace detail

// Each check tests finiteness by bits before it compares: under -ffast-math a comparison with NaN
// may go either way.

/// Neither NaN nor infinite.
template <Scalar S>
constexpr Check<S> check_finite(const char* field, const S& value, int index = -1) {
  if (!all(is_finite(value))) return Error<S>{field, value, "must be finite", index};
  return {};
}

/// Finite and above zero.
template <Scalar S>
constexpr Check<S> check_positive(const char* field, const S& value, int index = -1) {
  if (!all(is_finite(value)) || !all(value > S(0.0))) {
    return Error<S>{field, value, "must be finite and positive", index};
  }
  return {};
}

/// Finite and zero or above.
template <Scalar S>
constexpr Check<S> check_not_negative(const char* field, const S& value, int index = -1) {
  if (!all(is_finite(value)) || !all(value >= S(0.0))) {
    return Error<S>{field, value, "must be finite and not negative", index};
  }
  return {};
}

/// Finite and not zero; either sign.
template <Scalar S>
constexpr Check<S> check_nonzero(const char* field, const S& value, int index = -1) {
  if (!all(is_finite(value)) || !all(detail::magnitude(value) > S(0.0))) {
    return Error<S>{field, value, "must be finite and not zero (negative is fine)", index};
  }
  return {};
}

/// Finite and above a limit, which the error carries.
template <Scalar S>
constexpr Check<S> check_above(const char* field, const S& value, const S& limit) {
  if (!all(is_finite(value)) || !all(value > limit)) {
    return Error<S>{field, value, "must be finite and above", -1, limit, true};
  }
  return {};
}

/// `derived` is a normal number, neither overflowed nor lost in the subnormals; the error names the
/// config field that it was computed from.
template <Scalar S>
constexpr Check<S> check_representable(const char* field, const S& value, const S& derived,
                                       const char* rule, int index = -1) {
  if (!all(is_finite(derived)) ||
      !all(detail::magnitude(derived) >= detail::smallest_normal<S>())) {
    return Error<S>{field, value, rule, index};
  }
  return {};
}

namespace detail {

/// `retune` of all that has `make` and `adopt`: designs once.
template <class T>
Check<typename T::scalar_type> retune(T& object, const typename T::Config& config) {
  const auto fresh = T::make(config);
  if (!fresh) return fresh.error();
  return object.adopt(*fresh);
}

}  // namespace detail

}  // namespace esokit
