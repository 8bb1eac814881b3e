/// @file
/// The response of a chain of equal first-order lags to a step, in closed form.
#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/math/combinatorics.hpp>
#include <esokit/sim/signal.hpp>
#include <limits>

namespace esokit::sim {

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

}  // namespace esokit::sim
