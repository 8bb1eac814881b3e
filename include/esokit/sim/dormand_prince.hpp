/// @file
/// The method of Dormand and Prince, with fixed or error-controlled steps.
#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/sim/runge_kutta.hpp>

namespace esokit::sim {

/// Dormand and Prince's method of order 5, with an embedded one of order 4.
///
/// Source: J. R. Dormand, P. J. Prince, J. Computational and Applied Mathematics 6 (1980) 19-26.
struct DormandPrince {
  /// See ButcherTableau.
  /// @{
  static constexpr int stages = 7;
  static constexpr int order = 5;
  static constexpr std::array<std::array<long double, 7>, 7> a{
      {{0, 0, 0, 0, 0, 0, 0},
       {1 / 5.0L, 0, 0, 0, 0, 0, 0},
       {3 / 40.0L, 9 / 40.0L, 0, 0, 0, 0, 0},
       {44 / 45.0L, -56 / 15.0L, 32 / 9.0L, 0, 0, 0, 0},
       {19372 / 6561.0L, -25360 / 2187.0L, 64448 / 6561.0L, -212 / 729.0L, 0, 0, 0},
       {9017 / 3168.0L, -355 / 33.0L, 46732 / 5247.0L, 49 / 176.0L, -5103 / 18656.0L, 0, 0},
       {35 / 384.0L, 0, 500 / 1113.0L, 125 / 192.0L, -2187 / 6784.0L, 11 / 84.0L, 0}}};
  static constexpr std::array<long double, 7> b = a[6];
  static constexpr std::array<long double, 7> c{0, 0.2L, 0.3L, 0.8L, 8 / 9.0L, 1, 1};
  /// @}

  /// Weights of the stages in x5 - x4, the results of order 5 and 4.
  static constexpr std::array<long double, 7> difference{
      71 / 57600.0L, 0, -71 / 16695.0L, 71 / 1920.0L, -17253 / 339200.0L, 22 / 525.0L, -1 / 40.0L};
};

/// DormandPrince with error-controlled steps: the result is x5, and each element of x5 - x4 must be
/// within max(absolute_tolerance, relative_tolerance M), where M is the largest magnitude of this
/// element so far. With q, the largest ratio of error to tolerance,
/// - a step with q <= 1 is accepted; the next is q^(-1/5) / 1.25 times as long, at most five times,
///   and not longer if the step was refused before;
/// - a step with q > 1 is repeated with max(0.1, 0.8 q^(-1/5)) times its length, from the second
///   time on with half the length;
/// - the first step is 0.8 relative_tolerance^(1/5) times the smallest M / |x'|, where M is at
///   least absolute_tolerance / relative_tolerance;
/// - a step that is shortened to reach `end` does not shorten the next.
///
/// The right-hand side may jump at `end`, because none of its values is kept for the next step. One
/// object integrates one trajectory.
/// @tparam State a fixed Eigen vector
template <class State>
class VariableStep {
 public:
  using ScalarType = typename State::Scalar;  ///< type of state and time

  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};                 ///< nothing to set, see ByName
    ScalarType relative_tolerance = static_cast<ScalarType>(1e-3);  ///< below 1
    ScalarType absolute_tolerance = static_cast<ScalarType>(1e-6);  ///< unit of the state
  };

  /// Refuses tolerances that are not positive, and a relative tolerance of 1 or more.
  static Expected<VariableStep, Error<ScalarType>> make(const Config& config) {
    Rules<ScalarType> rules;
    rules.positive("relative_tolerance", config.relative_tolerance)
        .demand(config.relative_tolerance < ScalarType{1}, "relative_tolerance",
                config.relative_tolerance, "must be below 1")
        .positive("absolute_tolerance", config.absolute_tolerance);
    if (!rules) return rules.error();
    return VariableStep(config);
  }

  /// One accepted step of x' = rhs(t, x) from t, at most to `end`.
  /// @param rhs as in `step` @param t s, below `end` @param x in: state at t, out: state at the new
  /// time
  /// @param end s, reached exactly
  /// @return the new time, s; or an error, with x unchanged, if the step would fall below the
  /// resolution of time because the solution or rhs jumps or is not finite
  template <class Rhs>
  requires RightHandSide<std::remove_reference_t<Rhs>, State, ScalarType>
      Expected<ScalarType, Error<ScalarType>> advance(Rhs&& rhs, ScalarType t, State& x,
                                                      ScalarType end) {
    largest_ = largest_.cwiseMax(x.cwiseAbs());
    const ScalarType relative = config_.relative_tolerance;
    const auto scale = [&](const State& magnitude) -> State {
      return magnitude.cwiseMax(config_.absolute_tolerance / relative);
    };
    if (!(next_ > ScalarType{})) {
      const State rate = rhs(t, x);
      const ScalarType fastest = rate.cwiseQuotient(scale(largest_)).cwiseAbs().maxCoeff();
      next_ = fastest > ScalarType{} ? fraction(0.8) * fifth_root(relative) / fastest : end - t;
    }
    ScalarType h = next_;
    for (bool refused = false;; refused = true) {
      const bool cut = !(t + h < end);
      if (cut) h = end - t;
      if (!(t + h > t)) {
        return Error<ScalarType>{
            .field = "t",
            .value = t,
            .rule = "is the time at which the step falls below the resolution of time"};
      }
      State difference = State::Zero();
      const State result = stages(rhs, t, x, h, difference);
      const State magnitude = largest_.cwiseMax(result.cwiseAbs());
      const ScalarType q =
          difference.cwiseQuotient(scale(magnitude)).cwiseAbs().maxCoeff() / relative;
      const bool finite = is_finite(result.sum()) && is_finite(difference.sum());
      if (finite && q <= ScalarType{1}) {
        const ScalarType proposed =
            refused ? h : h * (std::min)(ScalarType{5}, fraction(0.8) / fifth_root(q));
        next_ = cut && !refused ? (std::max)(next_, proposed) : proposed;
        x = result;
        return cut ? end : t + h;
      }
      const ScalarType shorter = finite ? fraction(0.8) / fifth_root(q) : ScalarType{};
      h *= refused ? fraction(0.5) : (std::max)(fraction(0.1), shorter);
    }
  }

 private:
  explicit VariableStep(const Config& config) : config_(config) {}

  static constexpr ScalarType fraction(double value) { return static_cast<ScalarType>(value); }
  static ScalarType fifth_root(ScalarType q) { return std::pow(q, fraction(0.2)); }

  /// Returns x5, and x5 - x4 in `difference`.
  template <class Rhs>
  static State stages(Rhs& rhs, ScalarType t, const State& x, ScalarType h, State& difference) {
    constexpr auto weight = [](long double entry) { return static_cast<ScalarType>(entry); };
    using M = DormandPrince;
    std::array<State, M::stages> k;
    State at = x;
    for (std::size_t i = 0; i < k.size(); ++i) {
      at = x;
      for (std::size_t j = 0; j < i; ++j) at += h * weight(M::a[i][j]) * k[j];
      k[i] = rhs(t + weight(M::c[i]) * h, at);
      difference += h * weight(M::difference[i]) * k[i];
    }
    return at;  // the last stage is taken at the result
  }

  Config config_;
  ScalarType next_{};  ///< s; zero before the first step
  State largest_ = State::Zero();
};

}  // namespace esokit::sim
