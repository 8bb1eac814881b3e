/// @file
/// The concept of a signal.
#pragma once

#include <array>
#include <concepts>
#include <esokit/core/scalar.hpp>

namespace esokit::sim {

/// A function of time, s(t), for example a lambda.
template <class S, class ScalarType = double>
concept Signal = std::copy_constructible<S> && requires(const S& s, ScalarType t) {
  { s(t) } -> std::same_as<ScalarType>;
};

/// A signal that also knows its derivatives: `derivatives<Count>(t)` is (s, s', .., s^(Count-1)).
///
/// Where a derivative jumps, its limit from the right is given; impulses are left out.
template <class S, class ScalarType = double>
concept DifferentiableSignal = Signal<S, ScalarType> && requires(const S& s, ScalarType t) {
  { s.template derivatives<1>(t) } -> std::same_as<std::array<ScalarType, 1>>;
  { s.template derivatives<5>(t) } -> std::same_as<std::array<ScalarType, 5>>;
};

}  // namespace esokit::sim
