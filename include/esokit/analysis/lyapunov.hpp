/// @file
/// Lyapunov equations of linear systems, by doubling (Smith's squared method).
#pragma once

#include <esokit/analysis/linear_system.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

/// `solve_lyapunov` on the caller's storage. @param p is written @param work 5 n^2
Check<double> solve_lyapunov(const double* a, const double* q, double* p, double* work, int n,
                             bool sampled);

}  // namespace detail

/// Solves A P + P A' + Q = 0 (continuous) or P = A P A' + Q (sampled), N x N.
///
/// By doubling, one step of iterative refinement, and a check of the residual against the size of
/// its terms. About log2(1 / (1 - spectral radius)) + 6 steps of three matrix products.
/// @param a A, or A - I for a sampled system, as LinearSystem keeps it @param q symmetric
/// @return error if A is not stable, or the residual is above 1e-11 of its terms
template <int N>
Expected<EigenMatrix<double, N, N>, Error<double>> solve_lyapunov(
    const EigenMatrix<double, N, N>& a, const EigenMatrix<double, N, N>& q, bool sampled) {
  EigenMatrix<double, N, N> p;
  Array<double, 5 * N * N> work;
  if (const auto ok = detail::solve_lyapunov(a.data(), q.data(), p.data(), work.data(), N, sampled);
      !ok) {
    return ok.error();
  }
  return p;
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/lyapunov.ipp>
#endif
