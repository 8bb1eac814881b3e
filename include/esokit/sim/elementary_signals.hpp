/// @file
/// Constant, step and sine with exact derivatives.
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
#include <esokit/sim/signal.hpp>

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

}  // namespace esokit::sim
