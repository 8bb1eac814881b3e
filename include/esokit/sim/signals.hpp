/// @file
/// Signals with exact derivatives: constant, step, sine, a step behind equal lags, and sums.
///
/// A signal that begins at `time` is active for t >= time, without tolerance. On a grid t = k h, a
/// start computed as k0 h is active at sample k0; one written as a decimal number may be active one
/// sample later.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/math/combinatorics.hpp>
#include <esokit/sim/signal.hpp>
#include <limits>

namespace esokit::sim {

/// s(t) = value. The default is zero.
template <PlainScalar ScalarType = double>
class Constant {
 public:
  /// Settings of make.
  struct Config {
    ScalarType value{};  ///< the value at all times
  };

  /// Zero.
  constexpr Constant() = default;

  /// Refuses a value that is not finite.
  static constexpr Expected<Constant, Error<ScalarType>> make(const Config& config) {
    if (Rules<ScalarType> rules; !rules.finite("value", config.value)) return rules.error();
    return Constant(config);
  }

  /// s(t), t in s.
  constexpr ScalarType operator()(ScalarType /*t*/) const noexcept { return config_.value; }

  /// (s, s', .., s^(Count-1)) at t (s).
  template <int Count>
  constexpr Array<ScalarType, Count> derivatives(ScalarType /*t*/) const noexcept {
    static_assert(Count >= 1);
    return {config_.value};
  }

 private:
  explicit constexpr Constant(const Config& config) : config_(config) {}

  Config config_{};
};

/// s(t) = size for t >= time, else 0; its derivatives are zero.
template <PlainScalar ScalarType = double>
class Step {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType time{};                               ///< start, s
    ScalarType size{1};                              ///< height
  };

  /// Refuses members that are not finite.
  static constexpr Expected<Step, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.finite("time", config.time).finite("size", config.size);
    if (!rules) return rules.error();
    return Step(config);
  }

  /// s(t), t in s.
  constexpr ScalarType operator()(ScalarType t) const noexcept {
    return t >= config_.time ? config_.size : ScalarType{};
  }

  /// (s, s', .., s^(Count-1)) at t (s).
  template <int Count>
  constexpr Array<ScalarType, Count> derivatives(ScalarType t) const noexcept {
    static_assert(Count >= 1);
    return {(*this)(t)};
  }

 private:
  explicit constexpr Step(const Config& config) : config_(config) {}

  Config config_;
};

/// s(t) = offset + amplitude sin(angular_frequency t + phase).
template <PlainScalar ScalarType = double>
class Sine {
 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType amplitude{1};                         ///< peak, in the unit of the signal
    ScalarType angular_frequency{1};                 ///< rad/s
    ScalarType phase{};                              ///< rad
    ScalarType offset{};                             ///< mean value
  };

  /// Refuses members that are not finite.
  static constexpr Expected<Sine, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.finite("amplitude", config.amplitude)
        .finite("angular_frequency", config.angular_frequency)
        .finite("phase", config.phase)
        .finite("offset", config.offset);
    if (!rules) return rules.error();
    return Sine(config);
  }

  /// s(t), t in s.
  ScalarType operator()(ScalarType t) const noexcept {
    return config_.offset +
           config_.amplitude * std::sin(config_.angular_frequency * t + config_.phase);
  }

  /// (s, s', .., s^(Count-1)) at t (s).
  template <int Count>
  Array<ScalarType, Count> derivatives(ScalarType t) const noexcept {
    static_assert(Count >= 1);
    const ScalarType angle = config_.angular_frequency * t + config_.phase;
    const ScalarType sine = std::sin(angle);
    const ScalarType cosine = std::cos(angle);
    const std::array<ScalarType, 4> cycle{sine, cosine, -sine, -cosine};
    Array<ScalarType, Count> result{};
    ScalarType scale = config_.amplitude;
    for (std::size_t j = 0; j < result.size(); ++j) {
      result[j] = scale * cycle[j % 4];
      scale *= config_.angular_frequency;
    }
    result[0] += config_.offset;
    return result;
  }

 private:
  explicit constexpr Sine(const Config& config) : config_(config) {}

  Config config_;
};

/// Response of 1/(tau s + 1)^Order to a step of `size` at `time`, from rest: the reference of many
/// ADRC papers. It has Order - 1 continuous derivatives; the derivative of order Order jumps at
/// `time` to size/tau^Order; at the jump the value from the right is given.
///
/// With x = (t - time)/tau and the Erlang densities g_k(x) = x^(k-1) e^-x / (k-1)! the value is
/// size (1 - g_1 - .. - g_Order), and since g_k' = g_{k-1} - g_k the derivative j > 0 is
/// size/tau^j sum_i (-1)^(j-1-i) C(j-1, i) g_{Order-i}.
template <int Order, PlainScalar ScalarType = double>
class FilteredStep {
  static_assert(Order >= 1 && Order <= 16);

 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    ScalarType time{};                               ///< start, s
    ScalarType size{1};                              ///< final value
    ScalarType time_constant{1};                     ///< tau of each lag, s
  };

  /// Refuses members that are not finite and a time constant that is not positive.
  static constexpr Expected<FilteredStep, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.finite("time", config.time)
        .finite("size", config.size)
        .positive("time_constant", config.time_constant);
    if (!rules) return rules.error();
    return FilteredStep(config);
  }

  /// s(t), t in s.
  ScalarType operator()(ScalarType t) const noexcept { return derivatives<1>(t)[0]; }

  /// (s, s', .., s^(Count-1)) at t (s), Count up to 20.
  template <int Count>
  Array<ScalarType, Count> derivatives(ScalarType t) const noexcept {
    static_assert(Count >= 1 && Count <= 20);
    Array<ScalarType, Count> result{};
    if (!(t >= config_.time)) return result;
    const ScalarType x = scaled_time(t);
    const Densities g = densities(x);
    result[0] = config_.size * rise(x, g);
    ScalarType scale = config_.size;
    for (int j = 1; j < Count; ++j) {
      scale /= config_.time_constant;
      ScalarType sum{};
      for (int i = 0; i < j && i < Order; ++i) {
        const ScalarType weight = static_cast<ScalarType>(binomial(j - 1, i));
        const ScalarType term = weight * g[static_cast<std::size_t>(Order - i)];
        sum += (j - 1 - i) % 2 == 0 ? term : -term;
      }
      result[static_cast<std::size_t>(j)] = scale * sum;
    }
    return result;
  }

 private:
  /// g_k at index k, 1..Order+1.
  using Densities = Array<ScalarType, Order + 2>;

  explicit constexpr FilteredStep(const Config& config) : config_(config) {}

  /// Limited to a range beyond which all densities are zero, so that 0 times infinity cannot occur.
  ScalarType scaled_time(ScalarType t) const noexcept {
    const ScalarType x = (t - config_.time) / config_.time_constant;
    const ScalarType most{20000};
    return x < most ? x : most;
  }

  static Densities densities(ScalarType x) noexcept {
    Densities g{};
    g[1] = std::exp(-x);
    for (std::size_t k = 1; k <= Order; ++k) g[k + 1] = g[k] * x / static_cast<ScalarType>(k);
    return g;
  }

  /// 1 - g_1 - .. - g_Order = g_{Order+1} (1 + x/(Order+1) + x^2/((Order+1)(Order+2)) + ..). The
  /// series is used if the difference would cancel.
  static ScalarType rise(ScalarType x, const Densities& g) noexcept {
    if (x > static_cast<ScalarType>(Order + 1)) {
      ScalarType tail{};
      for (std::size_t k = 1; k <= Order; ++k) tail += g[k];
      return ScalarType{1} - tail;
    }
    ScalarType term{1};
    ScalarType sum{1};
    for (int k = 1; term > std::numeric_limits<ScalarType>::epsilon() * sum; ++k) {
      term *= x / static_cast<ScalarType>(Order + k);
      sum += term;
    }
    return g[Order + 1] * sum;
  }

  Config config_;
};

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
