#pragma once

#include <cmath>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/analysis/lyapunov.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

// All matrices are n x n, column-major, in storage of the caller.

/// out = a b', all n x n; `out` is neither of them.
template <class T>
constexpr void multiply_transposed(const T* a, const T* b, T* out, int n) noexcept {
  for (int i = 0; i < n * n; ++i) out[i] = T(0.0);
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < n; ++j) {
      const T factor = b[k * n + j];
      for (int i = 0; i < n; ++i) out[j * n + i] = out[j * n + i] + a[k * n + i] * factor;
    }
  }
}

/// Largest row sum of a^2; its root has the size of the poles.
inline double square_size(const double* a, double* work, int n) noexcept {
  multiply(a, a, work, n);
  return row_norm(work, n);
}

/// Writes P to p. @param work 3 n^2
inline bool solve_lyapunov_once(const double* a, const double* q, double* p, double* work, int n,
                                bool sampled) noexcept {
  double* const e = work;
  double* const work1 = work + n * n;
  double* const work2 = work + 2 * n * n;
  if (sampled) {
    for (int i = 0; i < n * n; ++i) {
      e[i] = a[i];
      p[i] = q[i];
    }
    return sum_by_doubling(e, p, work1, work2, n);
  }
  // Cayley transform, s = c (z - 1) / (z + 1). The sampled equation has the same P for (cI - A)^-1
  // (cI + A) and 2 c (cI - A)^-1 Q (cI - A)^-T.
  const double c = std::sqrt(square_size(a, work1, n));
  if (!is_finite(c) || !(c > 0.0)) return false;
  const auto shift = [&](double* to) {
    for (int i = 0; i < n * n; ++i) to[i] = -a[i];
    for (int i = 0; i < n; ++i) to[i * n + i] += c;
  };
  for (int i = 0; i < n * n; ++i) {
    e[i] = 2.0 * a[i];
    work2[i] = 2.0 * c * q[i];
  }
  shift(work1);
  solve_in_place(DenseView<double>{work1, n}, DenseView<double>{e, n});
  shift(work1);
  solve_in_place(DenseView<double>{work1, n}, DenseView<double>{work2, n});
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) p[j * n + i] = work2[i * n + j];
  }
  shift(work1);
  solve_in_place(DenseView<double>{work1, n}, DenseView<double>{p, n});
  return sum_by_doubling(e, p, work1, work2, n);
}

/// Writes D P + P D' [+ D P D'] + Q to `residual`, and returns its largest element as a share of
/// its terms. @param work 2 n^2
inline double lyapunov_residual(const double* a, const double* q, const double* p, double* residual,
                                double* work, int n, bool sampled) noexcept {
  double* const ap = work;
  double* const last = work + n * n;
  multiply(a, p, ap, n);
  multiply_transposed(ap, a, last, n);
  double worst = 0.0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      double size = absolute(q[j * n + i]);
      for (int k = 0; k < n; ++k) {
        size += absolute(a[k * n + i] * p[j * n + k]) + absolute(p[k * n + i] * a[k * n + j]);
      }
      double sum = q[j * n + i] + ap[j * n + i] + ap[i * n + j];
      if (sampled) sum += last[j * n + i];
      residual[j * n + i] = sum;
      const double share = size > 0.0 ? absolute(sum) / size : 0.0;
      if (!(share <= worst)) worst = share;
    }
  }
  return worst;
}

ESOKIT_FUNCTION Check<double> solve_lyapunov(const double* a, const double* q, double* p,
                                             double* work, int n, bool sampled) {
  double* const residual = work + 3 * n * n;
  double* const correction = work + 4 * n * n;
  if (!solve_lyapunov_once(a, q, p, work, n, sampled)) {
    return Error<double>{"system", 0.0, "is not stable: the stationary covariance does not exist"};
  }
  lyapunov_residual(a, q, p, residual, work, n, sampled);
  if (solve_lyapunov_once(a, residual, correction, work, n, sampled)) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        p[j * n + i] += 0.5 * (correction[j * n + i] + correction[i * n + j]);
      }
    }
  }
  const double share = lyapunov_residual(a, q, p, residual, work, n, sampled);
  return Rules<double>{}.demand(share <= 1e-11, "system", share,
                                "leaves too large a residual in the Lyapunov equation");
}

}  // namespace detail
}  // namespace esokit
