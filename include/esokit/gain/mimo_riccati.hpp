/// @file
/// The gain of MimoExtendedStateFilter: the Riccati recursion of several chains.
#pragma once

#include <cmath>
#include <esokit/gain/detail/covariance_factor.hpp>
#include <esokit/gain/riccati.hpp>
#include <esokit/gain/sampled_gain.hpp>

namespace esokit {

/// The orders n_1 .. n_p of the chains.
template <int... Orders>
struct ChainOrders {
  static_assert(sizeof...(Orders) >= 1, "esokit: at least one chain is needed");
  static_assert(((Orders >= 1) && ...), "esokit: the order of a chain must be at least 1");
  static constexpr int count = static_cast<int>(sizeof...(Orders));  ///< p
  static constexpr int sum = (Orders + ...);                         ///< n_1 + .. + n_p
  static constexpr Array<int, count> values{Orders...};              ///< n_1 .. n_p
};

namespace detail {

/// Where the states of the chains are.
template <class Orders, int Extension>
struct ChainRows {
  static constexpr std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }
  static constexpr int order_of(int chain) noexcept { return Orders::values[index(chain)]; }

  /// Index of the first state of a chain.
  static constexpr int first(int chain) noexcept {
    int begin = 0;
    for (int i = 0; i < chain; ++i) begin += order_of(i) + Extension;
    return begin;
  }

  /// Index after its last state.
  static constexpr int end(int chain) noexcept {
    return first(chain) + order_of(chain) + Extension;
  }
};

/// As RiccatiGain, for several chains. Its data are in the scaling of the states and divided by the
/// unit of the variances.
template <class Orders, Scalar S, int Extension>
struct MimoRiccati : ChainRows<Orders, Extension> {
  using Rows = ChainRows<Orders, Extension>;
  using Rows::end;
  using Rows::first;
  using Rows::index;
  using Rows::order_of;
  static constexpr int outputs = Orders::count;                   ///< p
  static constexpr int size = Orders::sum + outputs * Extension;  ///< N
  using Covariance = Matrix<S, size, size>;
  using OutputCovariance = Matrix<S, outputs, outputs>;
  using Gain = Matrix<S, size, outputs>;
  using Factor = CovarianceFactor<size, S>;
  using Transition = MatrixTransition<size, S>;

  Gain gain = Gain::Zero();  ///< of the next correction, scaled
  Factor factor{};           ///< of P-
  Factor posterior{};        ///< of P after the next correction
  Factor start{};
  Factor noise{};
  Factor limit{};
  CovarianceFactor<outputs, S> measurement{};
  CovarianceFactor<outputs, S> used_measurement{};
  S growth{1};  ///< 1 + theta
  bool corrected = false;
  bool fresh = false;  ///< no step since a reset to the limit
  bool standing = false;
  bool has_limit = false;

  /// A prediction. @param missed of each chain, see MimoExtendedStateFilter
  void advance(const Array<int, outputs>& missed, int max_gap) noexcept {
    if (standing) {
      if (corrected || fresh) {
        corrected = false;
        fresh = false;
        return;
      }
      standing = false;
    }
    if (corrected) factor = posterior;
    corrected = false;
    fresh = false;
    // As in RiccatiGain: in a gap P- of a chain stops growing once an estimate depends on the next
    // measurement only.
    Transition step{transition(), {}};
    Covariance& phi = step.phi;
    Covariance held;  // Q of the chains that still grow
    bool any_held = false;
    for (int chain = 0; chain < outputs; ++chain) {
      if (missed[index(chain)] < 3 || !tells_nothing(chain)) continue;
      if (!any_held) held = noise.matrix();
      any_held = true;
      const S still = S(1) / std::sqrt(growth);
      for (int r = first(chain); r < end(chain); ++r) {
        for (int j = first(chain); j < end(chain); ++j) phi(r, j) *= still;
        for (int j = 0; j < size; ++j) held(r, j) = held(j, r) = S(0);
      }
      // After max_gap the chain will restart, so its covariance no longer matters.
      if (missed[index(chain)] > max_gap + 1) {
        for (int r = first(chain); r < end(chain); ++r) {
          for (int j = first(chain); j < end(chain); ++j) phi(r, j) = r == j ? phi(r, r) : S(0);
        }
      }
    }
    factor.advance(growth, any_held ? Factor::nearest(held) : noise, step);
    prepare_all();
    if (has_limit && factor.close_to(limit, S(1e-3))) stand();
  }

  void prepare_all() noexcept {
    Array<bool, outputs> used{};
    used.fill(true);
    prepare(used);
  }

  /// Computes gain and corrected covariance for a measurement with these channels, one after the
  /// other: with R = L D L' the rows of L^-1 y are measurements with independent noise of variances
  /// D.
  void prepare(const Array<bool, outputs>& used) noexcept {
    used_measurement = measurement;
    bool all_used = true;
    for (const bool channel : used) all_used = all_used && channel;
    if (!all_used) {
      OutputCovariance r = measurement.matrix();
      for (int i = 0; i < outputs; ++i) {
        if (used[index(i)]) continue;
        for (int j = 0; j < outputs; ++j) r(i, j) = r(j, i) = S(0);
      }
      used_measurement = CovarianceFactor<outputs, S>::nearest(r);
    }
    // L^-1, row by row.
    OutputCovariance apart = OutputCovariance::Identity();
    for (int i = 0; i < outputs; ++i) {
      for (int k = 0; k < i; ++k) {
        for (int j = 0; j <= k; ++j) apart(i, j) -= used_measurement.lower(i, k) * apart(k, j);
      }
    }
    posterior = factor;
    Gain of_apart = Gain::Zero();  // of L^-1 y
    for (int i = 0; i < outputs; ++i) {
      if (!used[index(i)]) continue;
      Array<S, size> output{};
      for (int j = 0; j <= i; ++j) output[index(first(j))] = apart(i, j);
      const auto k = posterior.correct(output, S(used_measurement.variance(i) / growth));
      // Subtracts what the channels before have already explained.
      for (int j = 0; j < i; ++j) {
        S explained(0);
        for (int l = 0; l <= i; ++l) explained += apart(i, l) * of_apart(first(l), j);
        for (int r = 0; r < size; ++r) of_apart(r, j) -= k[index(r)] * explained;
      }
      set_block(of_apart, 0, i, column(k));
    }
    gain = of_apart * apart;
  }

  /// Restarts chain i with its part of P0, or of the limit.
  void restart_chain(int chain) noexcept {
    Covariance p = factor.matrix();
    const Covariance own_part = (has_limit ? limit : start).matrix();
    for (int r = first(chain); r < end(chain); ++r) {
      for (int i = 0; i < size; ++i) {
        const bool own = i >= first(chain) && i < end(chain);
        p(r, i) = own ? own_part(r, i) : S(0);
        p(i, r) = p(r, i);
      }
    }
    factor = Factor::nearest(p);
    standing = false;
    if (outputs == 1) restart();
  }

  /// With P0, or the limit.
  void restart() noexcept {
    corrected = false;
    fresh = has_limit;
    if (has_limit) {
      stand();
    } else {
      factor = start;
      prepare_all();
    }
  }

  /// C P- C' + R, divided by the unit.
  [[nodiscard]] OutputCovariance seen_covariance() const noexcept {
    const Covariance p = factor.matrix();
    OutputCovariance s = measurement.matrix();
    for (int i = 0; i < outputs; ++i) {
      for (int j = 0; j < outputs; ++j) s(i, j) += p(first(i), first(j));
    }
    return s;
  }

  /// Bound on the covariance of the error of the present estimate, scaled.
  [[nodiscard]] Covariance covariance() const noexcept {
    const Covariance p = factor.matrix();
    if (!corrected) return p;
    // (I - K C) P- (I - K C)' + K R K' with R, not R / (1 + theta).
    Covariance rest = Covariance::Identity();
    for (int i = 0; i < outputs; ++i) {
      for (int r = 0; r < size; ++r) rest(r, first(i)) -= gain(r, i);
    }
    // The gain is zero for channels that were left out.
    const auto spread = gain * used_measurement.matrix();
    const auto of_noise =
        plus_product_transposed<size, outputs, size, S>(Covariance::Zero(), spread, gain, S(1));
    return plus_product_transposed<size, size, size, S>(of_noise, rest * p, rest, S(1));
  }

  /// True if the recursion stays within the range of the scalar.
  [[nodiscard]] bool fits() const {
    MimoRiccati run = *this;
    for (int k = 0; k < 8 * size; ++k) {
      if (!all_finite(run.gain) || !all_finite(run.factor.matrix())) return false;
      run.corrected = true;
      run.advance({}, 1);
    }
    return true;
  }

  bool freeze(const Covariance& disturbed, const Vector<S, size>& root_units) {
    RiccatiModel<size, outputs, S> model;
    model.transition = transition();
    model.noise = in_units(disturbed, root_units.data());
    model.measurement = measurement.matrix() / growth;
    model.inflation = growth;
    Gain first_gain = Gain::Zero();
    for (int chain = 0; chain < outputs; ++chain) {
      model.output(chain, first(chain)) = S(1);
      const int last = first(chain) + order_of(chain) + Extension - 1;
      if (!(growth > S(1)) && !(model.noise(last, last) > S(0))) return false;
    }
    // All poles at zero.
    unroll<outputs>([&](auto chain) {
      constexpr int length = Orders::values[chain] + Extension;
      const auto k = current_gain<length, S>(EqualSampledPoles<length, S>{S(1)}.weights());
      set_block(first_gain, first(chain), int{chain}, column(k));
    });
    const auto covariance = riccati_covariance<size, outputs, S>(model, first_gain);
    if (!covariance) return false;
    factor = Factor::nearest(*covariance);
    // The recursion is run at the end, as for a single chain, because it is more accurate.
    constexpr int most_steps = 2000;
    Gain last = Gain::Zero();
    for (int step = 0; step < most_steps; ++step) {
      prepare_all();
      if (!all_finite(gain)) return false;
      const S change = largest_magnitude(gain - last);
      const bool done = !(change > S(2) * rounding<S>() * largest_magnitude(gain));
      last = gain;
      if (done && step > 3) break;
      factor = posterior;
      factor.advance_seldom(growth, noise, Transition{transition(), {}});
    }
    limit = factor;
    has_limit = true;
    return true;
  }

 private:
  /// True if P- of the chain is so large in comparison with R that the estimate depends on the next
  /// measurement only.
  [[nodiscard]] bool tells_nothing(int chain) const noexcept {
    const Covariance p = factor.matrix();
    const OutputCovariance r = measurement.matrix();
    S variance(0);
    S loudest(0);
    for (int i = first(chain); i < end(chain); ++i) variance = larger(variance, p(i, i));
    for (int i = 0; i < outputs; ++i) loudest = larger(loudest, r(i, i));
    return variance > loudest / rounding<S>();
  }

  [[nodiscard]] static Covariance transition() noexcept {
    Covariance phi = Covariance::Zero();
    for (int chain = 0; chain < outputs; ++chain) {
      for (int i = 0; i < order_of(chain) + Extension; ++i) {
        for (int j = i; j < order_of(chain) + Extension; ++j) {
          phi(first(chain) + i, first(chain) + j) =
              binomial_table<size, S>[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)];
        }
      }
    }
    return phi;
  }

  void stand() noexcept {
    factor = limit;
    prepare_all();
    standing = true;
  }
};

}  // namespace detail
}  // namespace esokit
