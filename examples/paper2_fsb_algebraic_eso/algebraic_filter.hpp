/// @file
/// The algebraic observer as in its paper: a linear filter with time-varying input and output
/// matrices (J. Kasac, A. Pender, M. Pranjic, D. Kotarski, Asian Journal of Control 23 (2021)
/// 2171-2184, Eqs. (35)-(51)), here for any order and any number of extended states.
///
/// x' = A x + b1(t) y + b2(t) u, x(0) = 0; (y, .., y^(n-1), d, .., d^(m-1)) = C(t) x, t > 0. With
/// N = n + m, E = e^{-qt}, w = (1 - E) / q (which is t for q = 0), g = w^N, G_j = (D + lambda)^j g:
///
///     A = -lambda I + (ones on the first superdiagonal)                        (35)-(40)
///     b1_r = (-1)^{r+1} C(N,r) G_r, r = 1 .. N
///     b2_r = b0 (-1)^{r-n} C(m,r-n) G_{r-n}, r = n .. N, else 0
///     C_{k+1,r+1} = C(N-1-r,k-r) P_{k-r} / g, 0 <= r <= k < N                  (45)-(51)
///
/// P_j as in ContinuousAlgebraicGain: C(t) b1(t) = L(t). The paper has g = (E - 1)^N and an x that
/// is (-q)^N times this one. The factor cancels, and without it q = 0 is regular.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/sim/continuous_gain_law.hpp>

namespace esokit::examples {

/// The filter's equations for simulation, to be stacked with those of a plant. It gives the same
/// estimates as ContinuousAlgebraicEso but is regular at t = 0: its state always starts at zero, so
/// there are no initial conditions to choose.
///
/// The outputs are divided by g, which is about t^N. Near t = 0 this amplifies the rounding and
/// integration errors of the state, so the paper uses the outputs only from a time epsilon on.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
class AlgebraicFilter {
 public:
  static constexpr int order = Order;                             ///< n, order of the plant
  static constexpr int extension = Extension;                     ///< m, extended states
  static constexpr int size = ChainSize<Order, Extension>::size;  ///< N = n + m
  static constexpr int states = size;                             ///< length of x
  using scalar_type = S;                                          ///< type of states and settings
  using Estimate = Vector<S, size>;      ///< (y, .., y^(n-1), d, .., d^(m-1)), N x 1
  using State = Vector<S, size>;         ///< x, N x 1
  using Square = Matrix<S, size, size>;  ///< N x N

  /// Settings of make.
  struct Config {
    S observer_bandwidth{};  ///< lambda >= 0, rad/s
    S frequency_shift{};     ///< q >= 0, rad/s
    S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero
  };

  /// Checks the settings and does all the design work.
  /// @return the filter's equations, or an error that names the field
  static Expected<AlgebraicFilter, Error<S>> make(const Config& config) {
    Rules<S> rules;
    rules.nonzero("input_gain", config.input_gain)
        .not_negative("observer_bandwidth", config.observer_bandwidth)
        .not_negative("frequency_shift", config.frequency_shift);
    if (!rules) return rules.error();
    return AlgebraicFilter(config);
  }

  /// A, N x N, 1/s.
  [[nodiscard]] Square state_matrix() const {
    Square a = Square::Zero();
    for (int i = 0; i < size; ++i) {
      a(i, i) = -config_.observer_bandwidth;
      if (i + 1 < size) a(i, i + 1) = S(1.0);
    }
    return a;
  }

  /// b1(t), N x 1, for t >= 0 (s).
  [[nodiscard]] State measurement_vector(const S& t) const {
    return measurement_vector(shifted_weights(t));
  }

  /// b2(t), N x 1, for t >= 0 (s).
  [[nodiscard]] State input_vector(const S& t) const { return input_vector(shifted_weights(t)); }

  /// C(t), N x N, lower triangular, for t > 0 (s).
  [[nodiscard]] Square output_matrix(const S& t) const {
    const auto p = law().factors(t);
    const S inverse = S(1.0) / power(weight(t), size);
    Square c = Square::Zero();
    for (int k = 0; k < size; ++k) {
      for (int r = 0; r <= k; ++r) {
        const S factor =
            S(binomial_table<size, detail::TableScalar<S>>[static_cast<std::size_t>(size - 1 - r)]
                                                          [static_cast<std::size_t>(k - r)]) *
            p[static_cast<std::size_t>(k - r)];
        c(k, r) = factor * inverse;
      }
    }
    return c;
  }

  /// dx/dt, N x 1. @param t s, >= 0 @param x N x 1 @param y measurement @param u input
  [[nodiscard]] State derivative(const S& t, const State& x, const S& y, const S& u) const {
    const Weights weights = shifted_weights(t);
    const State b1 = measurement_vector(weights);
    const State b2 = input_vector(weights);
    State rate;
    for (int i = 0; i < size; ++i) {
      S sum = b1(i) * y + b2(i) * u - config_.observer_bandwidth * x(i);
      if (i + 1 < size) sum = sum + x(i + 1);
      rate(i) = sum;
    }
    return rate;
  }

  /// C(t) x = (y, .., y^(n-1), d, .., d^(m-1)) for t > 0 (s).
  [[nodiscard]] Estimate estimate(const S& t, const State& x) const {
    const auto p = law().factors(t);
    const S g = power(weight(t), size);
    // x / g is computed first: it has the size of the signals, while P / g may overflow.
    Estimate estimate;
    for (int k = 0; k < size; ++k) {
      S sum(0.0);
      for (int r = 0; r <= k; ++r) {
        const S factor =
            S(binomial_table<size, detail::TableScalar<S>>[static_cast<std::size_t>(size - 1 - r)]
                                                          [static_cast<std::size_t>(k - r)]) *
            p[static_cast<std::size_t>(k - r)];
        sum = sum + factor * (x(r) / g);
      }
      estimate(k) = sum;
    }
    return estimate;
  }

  /// The settings.
  [[nodiscard]] const Config& config() const noexcept { return config_; }

 private:
  using Weights = Array<S, size + 1>;  ///< G_0 .. G_N

  explicit AlgebraicFilter(const Config& config) : config_(config) {}

  [[nodiscard]] ContinuousAlgebraicGain<size, S> law() const {
    return {config_.observer_bandwidth, config_.frequency_shift};
  }

  /// w(t) = (1 - e^{-qt}) / q, s.
  [[nodiscard]] S weight(const S& t) const {
    using std::expm1;
    const S& q = config_.frequency_shift;
    const auto shifting = q > S(0.0);
    return select(shifting, S(-expm1(-(q * t))), t) / select(shifting, q, S(1.0));
  }

  static S power(const S& base, int exponent) {
    S value(1.0);
    for (int i = 0; i < exponent; ++i) value = value * base;
    return value;
  }

  /// G_j = sum_r c_{j,r} M_r, M_r = N! / (N-r)! w^{N-r} E^r. From D M_r = M_{r+1} - r q M_r follows
  /// c_{j+1,r} = (lambda - r q) c_{j,r} + c_{j,r-1}. For small qt the term r = j dominates and
  /// nothing cancels, while the paper's sums of e^{-iqt} lose all digits.
  [[nodiscard]] Weights shifted_weights(const S& t) const {
    using std::exp;
    const S& q = config_.frequency_shift;
    const S w = weight(t);
    const S decay = exp(-(q * t));
    Weights basis{};
    S front(1.0);
    for (int r = 0; r <= size; ++r) {
      basis[static_cast<std::size_t>(r)] = front * power(w, size - r);
      front = front * decay * detail::integer<S>(size - r);
    }
    Weights coefficients{};
    for (S& c : coefficients) c = S(0.0);
    coefficients[0] = S(1.0);
    Weights weights{};
    weights[0] = basis[0];
    for (int j = 1; j <= size; ++j) {
      S sum(0.0);
      for (int r = j; r >= 0; --r) {
        const auto i = static_cast<std::size_t>(r);
        S c = (config_.observer_bandwidth - detail::integer<S>(r) * q) * coefficients[i];
        if (r > 0) c = c + coefficients[i - 1];
        coefficients[i] = c;
        sum = sum + c * basis[i];
      }
      weights[static_cast<std::size_t>(j)] = sum;
    }
    return weights;
  }

  [[nodiscard]] State measurement_vector(const Weights& weights) const {
    State b1;
    for (int i = 0; i < size; ++i) {
      b1(i) = S((i % 2 == 0 ? 1.0 : -1.0) * binomial(size, i + 1)) *
              weights[static_cast<std::size_t>(i + 1)];
    }
    return b1;
  }

  [[nodiscard]] State input_vector(const Weights& weights) const {
    State b2 = State::Zero();
    for (int j = 0; j <= Extension; ++j) {
      b2(Order - 1 + j) = S((j % 2 == 0 ? 1.0 : -1.0) * binomial(Extension, j)) *
                          config_.input_gain * weights[static_cast<std::size_t>(j)];
    }
    return b2;
  }

  Config config_;
};

}  // namespace esokit::examples
