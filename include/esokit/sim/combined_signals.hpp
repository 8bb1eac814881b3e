/// @file
/// The sum of two signals.
#pragma once

#include <cstddef>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/sim/signal.hpp>

namespace esokit::sim {

/// s(t) = first(t) + second(t). An aggregate, because it cannot be invalid: `Sum{a, b}`.
template <class First, class Second>
struct Sum {
  First first;    ///< a Signal
  Second second;  ///< a Signal

  /// s(t), t in s.
  template <PlainScalar ScalarType>
  requires Signal<First, ScalarType> && Signal<Second, ScalarType>
  constexpr ScalarType operator()(ScalarType t) const noexcept { return first(t) + second(t); }

  /// (s, s', .., s^(Count-1)) at t (s).
  template <int Count, PlainScalar ScalarType>
  requires DifferentiableSignal<First, ScalarType> && DifferentiableSignal<Second, ScalarType>
  constexpr Array<ScalarType, Count> derivatives(ScalarType t) const noexcept {
    auto result = first.template derivatives<Count>(t);
    const auto other = second.template derivatives<Count>(t);
    for (std::size_t j = 0; j < result.size(); ++j) result[j] += other[j];
    return result;
  }
};

/// Sum{a, b}.
template <class First, class Second>
Sum(First, Second) -> Sum<First, Second>;

}  // namespace esokit::sim
