/// @file
/// What the algebraic (FSB) observer must compute, to 100 digits and from its definition: with
/// W[k] = rho^-k [k] [k-1] .. [k-N+1], [i] = (1 - p^i) / (1 - p), the innovations e of the observer
/// obey nabla^N (W e)[k] = W[k] nabla^N y[k] for every measurement y.
#pragma once

#include <cstddef>
#include <cstdint>
#include <support/high_precision.hpp>
#include <utility>
#include <vector>

namespace esokit_test {

/// lambda T and q T of a sampled algebraic observer of N states.
struct AlgebraicReference {
  std::size_t size;
  Big bandwidth;  ///< lambda T
  Big shift;      ///< q T

  /// [count], zero for count <= 0.
  [[nodiscard]] Big bracket(std::int64_t count) const {
    if (count <= 0) return Big(0);
    if (shift == 0) return Big(count);
    return expm1(-shift * Big(count)) / expm1(-shift);
  }

  /// W[k] / W[k+i] for i > 0; zero up to k = N - 1.
  [[nodiscard]] Big weight_ratio(std::int64_t k, std::int64_t i) const {
    Big ratio = exp(-bandwidth * Big(i));
    for (std::size_t s = 0; s < size; ++s) {
      const auto back = static_cast<std::int64_t>(s);
      ratio *= bracket(k - back) / bracket(k + i - back);
    }
    return ratio;
  }

  /// Current-estimator gain at sample k >= N - 1, Nordsieck scaling. If e[k] = 1 is the only
  /// innovation of all, the measurement is one correction and its extrapolation: y[k+i] =
  /// kappa(i), kappa(t) = sum_r k_r t^r. By the definition above that y is the N-fold sum of
  /// (-1)^i C(N,i) W[k] / W[k+i], i = 0 .. N; interpolation at i = 1 .. N gives the k_r.
  [[nodiscard]] std::vector<Big> gain(std::int64_t k) const {
    std::vector<Big> y{Big(1)};
    Big binomial = 1;
    for (std::size_t i = 1; i <= size; ++i) {
      binomial = binomial * Big(size - i + 1) / Big(i);
      const Big ratio = binomial * weight_ratio(k, static_cast<std::int64_t>(i));
      y.push_back(i % 2 == 0 ? ratio : Big(-ratio));
    }
    for (std::size_t pass = 0; pass < size; ++pass) {
      for (std::size_t i = 1; i <= size; ++i) y[i] += y[i - 1];
    }
    // Newton's divided differences at 1 .. N, expanded in powers of t.
    std::vector<Big> d(y.begin() + 1, y.end());
    for (std::size_t j = 1; j < size; ++j) {
      for (std::size_t i = size - 1; i >= j; --i) d[i] = (d[i] - d[i - 1]) / Big(j);
    }
    std::vector<Big> kappa(size, Big(0));
    for (std::size_t j = size; j-- > 0;) {
      std::vector<Big> next(size, Big(0));
      for (std::size_t r = 0; r < size; ++r) {
        next[r] -= kappa[r] * Big(j + 1);
        if (r > 0) next[r] += kappa[r - 1];
      }
      next[0] += d[j];
      kappa = std::move(next);
    }
    return kappa;
  }
};

/// The sheet's formula for the gain, beta_j = C(N,j) sum_i C(j,i) (1-rho)^{j-i} rho^i Q_i: another
/// way to the same numbers. For q > 0.
inline std::vector<Big> printed_algebraic_gain(const AlgebraicReference& observer, std::int64_t k) {
  const std::size_t size = observer.size;
  const auto power = [&](std::int64_t i) { return Big(exp(-observer.shift * Big(i))); };
  const auto rest = [&](std::int64_t i) { return Big(-expm1(-observer.shift * Big(i))); };
  const Big rho = exp(-observer.bandwidth);
  const Big contraction = -expm1(-observer.bandwidth);
  std::vector<std::vector<Big>> t(size + 1, std::vector<Big>(size + 2, Big(0)));
  t[0][0] = 1;
  const auto whole = static_cast<std::int64_t>(size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t r = 0; r <= i + 1; ++r) {
      const auto s = static_cast<std::int64_t>(r);
      t[i + 1][r] = rest(s) * t[i][r];
      if (r > 0) t[i + 1][r] += power(s - whole) * rest(whole + s - 1) * t[i][r - 1];
    }
  }
  std::vector<Big> polynomial{Big(1)};
  Big front = 1;  // C(N,j)
  for (std::size_t j = 1; j <= size; ++j) {
    front = front * Big(size - j + 1) / Big(j);
    Big sum = 0;
    Big choose = 1;  // C(j,i)
    for (std::size_t i = 0; i <= j; ++i) {
      Big q = 0;
      Big product = 1;
      for (std::size_t r = 0; r <= i; ++r) {
        if (r > 0) product *= power(k) / rest(k + static_cast<std::int64_t>(r));
        q += t[i][r] * product;
      }
      sum += choose * pow(contraction, static_cast<int>(j - i)) * pow(rho, static_cast<int>(i)) * q;
      choose = choose * Big(j - i) / Big(i + 1);
    }
    polynomial.push_back(front * sum);
  }
  return reference_current_gain(polynomial);
}

}  // namespace esokit_test
