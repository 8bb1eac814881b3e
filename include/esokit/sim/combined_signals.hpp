/// @file
/// Signals made of signals: a sum, and one that is switched on.
#pragma once

#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/sim/signal.hpp>
#include <utility>

namespace esokit::sim {

/// s(t) = first(t) + second(t). An aggregate, for there is nothing to refuse: `Sum{a, b}`.
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

/// s(t) = signal(t) for t >= time, else 0. The time of the inner signal is not shifted:
/// `5 sin(9 t) from t = 3.5` starts in the middle of its wave.
template <class Inner, PlainScalar ScalarType = double>
requires Signal<Inner, ScalarType>
class SwitchedOn {
 public:
  /// Settings of make.
  struct Config {
    Inner signal{};     ///< what is switched on
    ScalarType time{};  ///< when, s
  };

  /// Refuses a time that is not finite.
  static constexpr Expected<SwitchedOn, Error<ScalarType>> make(Config config) {
    if (Rules<ScalarType> rules; !rules.finite("time", config.time)) return rules.error();
    return SwitchedOn(std::move(config));
  }

  /// s(t), t in s.
  constexpr ScalarType operator()(ScalarType t) const noexcept {
    return t >= config_.time ? config_.signal(t) : ScalarType{};
  }

  /// (s, s', .., s^(Count-1)) at t (s). The jumps at `time` are left out, as in every signal.
  template <int Count>
  requires DifferentiableSignal<Inner, ScalarType>
  constexpr Array<ScalarType, Count> derivatives(ScalarType t) const noexcept {
    if (t >= config_.time) return config_.signal.template derivatives<Count>(t);
    return {};
  }

 private:
  explicit constexpr SwitchedOn(Config config) : config_(std::move(config)) {}

  Config config_;
};

}  // namespace esokit::sim
