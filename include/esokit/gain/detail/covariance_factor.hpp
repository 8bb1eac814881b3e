/// @file
/// An error covariance of the chain in square-root form, P = L D L'.
///
/// Nothing is ever subtracted from a variance: the measurement update scales one variance, the time
/// update sums squares (modified weighted Gram-Schmidt, C. L. Thornton). So P stays symmetric and
/// positive semidefinite in float, which the plain and the Joseph form do not guarantee. In
/// comparison with the array form with square roots it needs N divisions a step and no root, is
/// equally accurate and, for N = 3, 1.4 times as fast.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/combinatorics.hpp>
#include <limits>
#include <optional>
#include <type_traits>

namespace esokit {

namespace detail {

/// Calls f(0), .., f(Count - 1): unrolled, or in a loop for large sizes. Unrolled, f takes its
/// index as a constant (`auto`, not int): what an `if` leaves out is then not compiled at all, also
/// where the optimiser does not see to it (-O0, -Og).
template <int Count, bool Unrolled, class Function>
ESOKIT_INLINE constexpr void repeat(Function&& f) noexcept {
  if constexpr (Unrolled) {
    unroll<Count>(f);
  } else {
    for (int i = 0; i < Count; ++i) f(i);
  }
}

}  // namespace detail

/// Phi of the chain in Nordsieck scaling, known at compile time.
struct PascalTransition {};

/// Phi of any other model.
template <int Size, Scalar S>
struct MatrixTransition {
  Matrix<S, Size, Size> phi;   ///< N x N, scaled
  Array<int, Size> degrees{};  ///< power of T in the scaling of each state

  /// Phi of a model.
  template <class Model>
  static MatrixTransition of(const Model& model) noexcept {
    MatrixTransition transition{model.increment() + Matrix<S, Size, Size>::Identity(), {}};
    for (int i = 0; i < Size; ++i) {
      transition.degrees[static_cast<std::size_t>(i)] = model.degree(i);
    }
    return transition;
  }

  /// Members of a model, see SampledModel.
  /// @{
  [[nodiscard]] Matrix<S, Size, Size> increment() const noexcept {
    return phi - Matrix<S, Size, Size>::Identity();
  }
  [[nodiscard]] int degree(int row) const noexcept {
    return degrees[static_cast<std::size_t>(row)];
  }
  /// @}
};

/// P = L D L', N x N, in the Nordsieck scaling of the chain (all states have the unit of y), with L
/// unit lower triangular and D diagonal, not negative.
///
/// The first state is the measured one, so the first column of L is the direction of the gain. A
/// measurement changes only D_1: P C' = D_1 l_1, and C l_i = 0 for i > 1.
template <int Size, Scalar S>
class CovarianceFactor {
  static constexpr bool unrolled = Size <= 5;
  static constexpr int below_diagonal = Size * (Size - 1) / 2;

 public:
  using Square = Matrix<S, Size, Size>;  ///< N x N

  /// P = 0.
  CovarianceFactor() noexcept {
    for (S& d : variances_) d = S(0.0);
    for (S& l : lower_) l = S(0.0);
  }

  /// Factors a symmetric matrix. Returns nothing if it is not positive semidefinite within
  /// rounding, that is, even with variances larger by a share of 8 N eps. Reads the lower triangle.
  static std::optional<CovarianceFactor> from_matrix(const Square& p) noexcept {
    CovarianceFactor factor;
    if (factor.set<false>(p)) return factor;
    // Nearly singular: the rounding of an element is amplified by the small pivots before it.
    Square larger = p;
    for (int i = 0; i < Size; ++i) {
      if (!all(p(i, i) >= S(0.0))) return std::nullopt;
      larger(i, i) = p(i, i) + rounding_of_factors() * p(i, i);
    }
    return factor.set<false>(larger) ? std::optional(factor) : std::nullopt;
  }

  /// The same for a matrix that is positive semidefinite except for rounding; indefinite remainders
  /// are dropped.
  static CovarianceFactor nearest(const Square& p) noexcept {
    CovarianceFactor factor;
    factor.set<true>(p);
    return factor;
  }

  /// L D L', N x N.
  [[nodiscard]] Square matrix() const noexcept {
    Square p;
    for (int i = 0; i < Size; ++i) {
      for (int j = 0; j <= i; ++j) {
        S sum(0.0);
        for (int k = 0; k <= j; ++k) sum = sum + lower(i, k) * lower(j, k) * variance(k);
        p(i, j) = sum;
        p(j, i) = sum;
      }
    }
    return p;
  }

  /// D_i, i = 0 .. N - 1; the first is the variance of the measured state.
  [[nodiscard]] constexpr const S& variance(int i) const noexcept { return variances_[index(i)]; }
  /// Replaces D_i. @param d not negative
  constexpr void set_variance(int i, const S& d) noexcept { variances_[index(i)] = d; }

  /// L_ij, i and j from 0 to N - 1.
  [[nodiscard]] constexpr S lower(int i, int j) const noexcept {
    if (i < j) return S(0.0);
    return i == j ? S(1.0) : lower_[packed(i, j)];
  }

  /// The gain k = share l_1, share = D_1 / (D_1 + r).
  [[nodiscard]] ESOKIT_INLINE constexpr ScaledGain<Size, S> gain(const S& share) const noexcept {
    ScaledGain<Size, S> gain;
    gain[0] = share;
    detail::repeat<Size - 1, unrolled>([&](auto i) ESOKIT_INLINE_LAMBDA {
      gain[index(i + 1)] = share * lower_[packed(i + 1, 0)];
    });
    return gain;
  }

  /// P <- P - k c P for a measurement c x with noise of variance r, for any c (G. J. Bierman,
  /// 1977). States that are known exactly are not corrected.
  /// @param output c, N elements @return k = P c' / (c P c' + r), N elements
  Array<S, Size> correct(const Array<S, Size>& output, const S& noise) noexcept {
    Array<S, Size> gain;
    gain.fill(S(0.0));
    S sum = noise;
    S inverse = inverse_of_normal(sum);
    for (int j = Size - 1; j >= 0; --j) {
      S seen = output[index(j)];
      for (int i = j + 1; i < Size; ++i) seen = seen + lower(i, j) * output[index(i)];
      const S spread = variances_[index(j)] * seen;
      const S share = inverse * seen;
      for (int i = j + 1; i < Size; ++i) {
        S& l = lower_[packed(i, j)];
        const S old = l;
        l = old - gain[index(i)] * share;
        gain[index(i)] = gain[index(i)] + old * spread;
      }
      gain[index(j)] = spread;
      const S before = sum;
      sum = before + spread * seen;
      inverse = inverse_of_normal(sum);
      const auto some = inverse > S(0.0);
      variances_[index(j)] = variances_[index(j)] * select(some, S(before * inverse), S(1.0));
    }
    for (S& k : gain) k = k * inverse;
    return gain;
  }

  /// One sample ahead: P <- inflation Phi P Phi' + Q.
  /// @param inflation > 0 @param noise Q, in the same scaling @param transition Phi
  /// @tparam DiagonalNoise Q is diagonal, which saves a tenth of the time
  template <bool DiagonalNoise = false, class Transition = PascalTransition>
  ESOKIT_INLINE constexpr void advance(const S& inflation, const CovarianceFactor& noise,
                                       const Transition& transition = {}) noexcept {
    advance_by<DiagonalNoise, unrolled>(inflation, noise, transition);
  }

  /// The same in loops, for calls outside the hot path: the unrolled form takes a large part of a
  /// filter's compile time.
  template <class Transition = PascalTransition>
  [[gnu::__noinline__]] constexpr void advance_seldom(const S& inflation,
                                                      const CovarianceFactor& noise,
                                                      const Transition& transition = {}) noexcept {
    advance_by<false, false>(inflation, noise, transition);
  }

  /// True if L is the identity.
  [[nodiscard]] constexpr bool diagonal() const noexcept {
    for (const S& l : lower_) {
      if (all(detail::absolute(l) > S(0.0))) return false;
    }
    return true;
  }

  /// sum_i w_i (Phi P Phi')_ii.
  template <class Transition = PascalTransition>
  [[nodiscard]] constexpr S transported_trace(const Array<S, Size>& weights,
                                              const Transition& transition = {}) const noexcept {
    S sum(0.0);
    detail::repeat<Size, unrolled>([&](auto i) ESOKIT_INLINE_LAMBDA {
      S diagonal(0.0);
      detail::repeat<Size, unrolled>([&](auto k) ESOKIT_INLINE_LAMBDA {
        const S x = transported<unrolled>(transition, i, k);
        diagonal = diagonal + x * x * variances_[index(k)];
      });
      sum = sum + weights[index(i)] * diagonal;
    });
    return sum;
  }

  /// True if every D_i and L_ij differs by at most a share from that of `other`.
  [[nodiscard]] constexpr bool close_to(const CovarianceFactor& other,
                                        const S& share) const noexcept {
    const auto close = [&share](const S& a, const S& b) {
      return all(detail::absolute(S(a - b)) <= share * detail::absolute(b));
    };
    for (std::size_t i = 0; i < variances_.size(); ++i) {
      if (!close(variances_[i], other.variances_[i])) return false;
    }
    for (std::size_t i = 0; i < lower_.size(); ++i) {
      if (!close(lower_[i], other.lower_[i])) return false;
    }
    return true;
  }

  /// P times a factor.
  constexpr void scale(const S& factor) noexcept {
    for (S& d : variances_) d = d * factor;
  }

  /// Converts to other units: state i is multiplied by `unit`^degree, all variances by `factor`.
  template <class Transition = PascalTransition>
  constexpr void rescale(const S& unit, const S& factor,
                         const Transition& transition = {}) noexcept {
    for (int i = 0; i < Size; ++i) {
      S scale = factor;
      for (int k = 0; k < degree(transition, i); ++k) scale = scale * unit * unit;
      variances_[index(i)] = variances_[index(i)] * scale;
      S ratio(1.0);
      int reached = degree(transition, i);
      for (int j = i + 1; j < Size; ++j) {
        for (; reached < degree(transition, j); ++reached) ratio = ratio * unit;
        lower_[packed(j, i)] = lower_[packed(j, i)] * ratio;
      }
    }
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 2;

  template <bool DiagonalNoise, bool Unrolled, class Transition>
  ESOKIT_INLINE constexpr void advance_by(const S& inflation, const CovarianceFactor& noise,
                                          const Transition& transition) noexcept {
    // The rows of [Phi L, L_Q] with the weights [inflation D, D_Q] are made orthogonal one by one.
    // Of the right half only the part below the diagonal is stored, negated; the diagonal is one.
    Array<S, Size> weights;
    Array<Array<S, Size>, Size> rows;
    Array<Array<S, Size>, Size> noise_rows;
    detail::repeat<Size, Unrolled>([&](auto k) ESOKIT_INLINE_LAMBDA {
      weights[index(k)] = inflation * variances_[index(k)];
      detail::repeat<Size, Unrolled>([&](auto i) ESOKIT_INLINE_LAMBDA {
        rows[index(i)][index(k)] = transported<Unrolled>(transition, i, k);
        if constexpr (!DiagonalNoise) {
          if (k < i) noise_rows[index(i)][index(k)] = -noise.lower_[packed(i, k)];
        }
      });
    });
    detail::repeat<Size, Unrolled>([&](auto i) ESOKIT_INLINE_LAMBDA {
      const auto& row = rows[index(i)];
      const auto& noise_row = noise_rows[index(i)];
      Array<S, Size> weighted;
      Array<S, Size> noise_weighted;
      // Two separate sums, one for the terms that become available late, because latency limits the
      // speed.
      S early = noise.variances_[index(i)];
      S late = S(0.0);
      detail::repeat<Size, Unrolled>([&](auto k) ESOKIT_INLINE_LAMBDA {
        weighted[index(k)] = weights[index(k)] * row[index(k)];
        const S term = weighted[index(k)] * row[index(k)];
        late = k == 0 ? term : S(late + term);
        if (k < i) {
          noise_weighted[index(k)] = noise.variances_[index(k)] * noise_row[index(k)];
          early = early + noise_weighted[index(k)] * noise_row[index(k)];
        }
      });
      const S variance = early + late;
      variances_[index(i)] = variance;
      if (i == Size - 1) return;
      const S inverse = inverse_of(variance);
      detail::repeat<Size, Unrolled>([&](auto j) ESOKIT_INLINE_LAMBDA {
        if (j <= i) return;
        auto& other = rows[index(j)];
        auto& noise_other = noise_rows[index(j)];
        S product = weighted[0] * other[0];
        S noise_product = S(0.0);
        detail::repeat<Size, Unrolled>([&](auto k) ESOKIT_INLINE_LAMBDA {
          if (k > 0) product = product + weighted[index(k)] * other[index(k)];
          if (k >= i) return;
          const S term = noise_weighted[index(k)] * noise_other[index(k)];
          noise_product = k == 0 ? term : S(noise_product + term);
        });
        if constexpr (!DiagonalNoise) {
          const S term = noise.variances_[index(i)] * noise_other[index(i)];
          noise_product = i == 0 ? S(-term) : S(noise_product - term);
        }
        if (!DiagonalNoise || i > 0) product = product + noise_product;
        const S l = product * inverse;
        lower_[packed(j, i)] = l;
        detail::repeat<Size, Unrolled>([&](auto k) ESOKIT_INLINE_LAMBDA {
          other[index(k)] = other[index(k)] - l * row[index(k)];
          if (k < i) noise_other[index(k)] = noise_other[index(k)] - l * noise_row[index(k)];
        });
        if constexpr (DiagonalNoise) {
          noise_other[index(i)] = l;
        } else {
          noise_other[index(i)] = noise_other[index(i)] + l;
        }
      });
    });
  }

  static constexpr std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }

  static constexpr S rounding_of_factors() noexcept {
    return S(8.0 * Size) * detail::rounding<S>();
  }

  template <bool Lenient>
  bool set(const Square& p) noexcept {
    const S unit = rounding_of_factors();
    Square rest = p;
    for (int k = 0; k < Size; ++k) {
      const S pivot = rest(k, k);
      if (!all(is_finite(p(k, k))) || !all(p(k, k) >= S(0.0))) return false;
      // A pivot of rounding errors only: the state is a combination of those before it, and the
      // rest of its column must also be rounding errors.
      const bool lost = !all(pivot > unit * p(k, k));
      if (!Lenient && !all(pivot >= -(unit * p(k, k)))) return false;
      variances_[index(k)] = lost ? S(0.0) : pivot;
      for (int j = k + 1; j < Size; ++j) {
        if (!all(is_finite(rest(j, k)))) return false;
        const S ratio = lost ? S(0.0) : S(rest(j, k) / pivot);
        if (!Lenient && lost) {
          // Compared as correlations: the states may differ by many orders.
          const S bound = S(2.0) * unit * p(j, j);
          if (!all(rest(j, k) * rest(j, k) <= (unit * p(k, k)) * (S(2.0) * bound))) return false;
        }
        lower_[packed(j, k)] = ratio;
      }
      for (int j = k + 1; j < Size; ++j) {
        for (int i = k + 1; i <= j; ++i) {
          rest(j, i) = rest(j, i) - lower(j, k) * lower(i, k) * variances_[index(k)];
        }
      }
    }
    return true;
  }

  /// Index of L_ij, i > j, stored column by column.
  static constexpr std::size_t packed(int i, int j) noexcept {
    return index(j * (2 * Size - j - 1) / 2 + i - j - 1);
  }

  static constexpr int degree(const PascalTransition&, int i) noexcept { return i; }
  static constexpr int degree(const MatrixTransition<Size, S>& transition, int i) noexcept {
    return transition.degree(i);
  }

  /// (Phi L)_ik.
  template <bool Unrolled>
  [[nodiscard]] constexpr S transported(const MatrixTransition<Size, S>& transition, int i,
                                        int k) const noexcept {
    S sum = transition.phi(i, k);
    for (int j = k + 1; j < Size; ++j) sum = sum + transition.phi(i, j) * lower_[packed(j, k)];
    return sum;
  }

  /// The same for the chain: sum_j C(j, i) L_jk.
  template <bool Unrolled>
  [[nodiscard]] ESOKIT_INLINE constexpr S transported(const PascalTransition&, int i,
                                                      int k) const noexcept {
    // Starts with the first term instead of zero, which would cost an addition.
    S sum = k < i ? lower_[packed(i, k)] : S(binomial(k, i));
    detail::repeat<Size, Unrolled>([&](auto j) ESOKIT_INLINE_LAMBDA {
      if (j <= i || j <= k) return;
      const S& l = lower_[packed(j, k)];
      sum = sum + (binomial(j, i) == 1   ? l
                   : binomial(j, i) == 2 ? S(l + l)
                                         : S(S(binomial(j, i)) * l));
    });
    return sum;
  }

  /// C(j, i) in the scalar type of tables.
  static constexpr detail::TableScalar<S> binomial(int j, int i) noexcept {
    return binomial_table<Size, detail::TableScalar<S>>[index(j)][index(i)];
  }

  /// 1 / x, or zero if x is too small to have an inverse.
  static constexpr S inverse_of_normal(const S& x) noexcept {
    const auto some = x >= detail::smallest_normal<S>();
    return select(some, S(S(1.0) / select(some, x, S(1.0))), S(0.0));
  }

  static constexpr S inverse_of(const S& variance) noexcept {
    const auto some = variance > S(0.0);
    return select(some, S(S(1.0) / select(some, variance, S(1.0))), S(0.0));
  }

  Array<S, Size> variances_;
  Array<S, below_diagonal> lower_;
};

}  // namespace esokit
