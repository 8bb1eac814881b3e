#pragma once

#include <cmath>
#include <esokit/analysis/lyapunov.hpp>
#include <esokit/analysis/lyapunov_matrix.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION void symmetric_eigenvalues(DenseView<double> a, DenseView<double> v) noexcept {
  const int n = a.rows;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) v(i, j) = i == j ? 1.0 : 0.0;
  }
  for (int sweep = 0; sweep < 40; ++sweep) {
    bool rotated = false;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        const double off = a(p, q);
        if (!(absolute(off) > 1e-17 * (absolute(a(p, p)) + absolute(a(q, q))))) continue;
        rotated = true;
        const double ratio = (a(q, q) - a(p, p)) / (2.0 * off);
        const double tangent =
            (ratio < 0.0 ? -1.0 : 1.0) / (absolute(ratio) + std::sqrt(1.0 + ratio * ratio));
        const double c = 1.0 / std::sqrt(1.0 + tangent * tangent);
        const double s = tangent * c;
        const auto rotate = [&](double& x, double& y) {
          const double old = x;
          x = c * old - s * y;
          y = s * old + c * y;
        };
        for (int k = 0; k < n; ++k) rotate(a(k, p), a(k, q));
        for (int k = 0; k < n; ++k) rotate(a(p, k), a(q, k));
        for (int k = 0; k < n; ++k) rotate(v(k, p), v(k, q));
      }
    }
    if (!rotated) return;
  }
}

}  // namespace detail
}  // namespace esokit
