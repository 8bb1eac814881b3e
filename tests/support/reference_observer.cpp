#include "support/reference_observer.hpp"

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <utility>

#include "support/high_precision.hpp"
#include "support/numbers.hpp"

namespace esokit_test {
namespace {

using BigVector = std::vector<Big>;
using BigMatrix = std::vector<BigVector>;

/// x of a x = b by elimination with row pivoting.
BigVector solve(BigMatrix a, BigVector b) {
  const std::size_t n = b.size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (abs(a[i][k]) > abs(a[pivot][k])) pivot = i;
    }
    std::swap(a[k], a[pivot]);
    std::swap(b[k], b[pivot]);
    for (std::size_t i = k + 1; i < n; ++i) {
      if (a[i][k] == 0) continue;
      const Big factor = a[i][k] / a[k][k];
      for (std::size_t j = k; j < n; ++j) a[i][j] -= factor * a[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t j = i + 1; j < n; ++j) b[i] -= a[i][j] * b[j];
    b[i] /= a[i][i];
  }
  return b;
}

/// Real and imaginary part of (value I - a)^-1 b.
struct BigComplexVector {
  BigVector re, im;
};
BigComplexVector resolvent(const BigMatrix& a, const BigVector& b, const Big& re, const Big& im) {
  const std::size_t n = b.size();
  BigMatrix stacked(2 * n, BigVector(2 * n, Big(0)));
  BigVector right(2 * n, Big(0));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      stacked[i][j] = -a[i][j];
      stacked[n + i][n + j] = -a[i][j];
    }
    stacked[i][i] += re;
    stacked[n + i][n + i] += re;
    stacked[i][n + i] -= im;
    stacked[n + i][i] += im;
    right[i] = b[i];
  }
  const BigVector x = solve(stacked, right);
  return {BigVector(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(n)),
          BigVector(x.begin() + static_cast<std::ptrdiff_t>(n), x.end())};
}

using Response = std::vector<std::array<std::complex<double>, 2>>;

/// The same in many digits.
struct BigObserver : ReferenceObserver {
  /// Gains of a level in physical units.
  [[nodiscard]] BigVector gain(std::size_t level) const {
    const Big w = bandwidths[level];
    BigVector k(size());
    if (sample_time > 0) {
      const Poles poles(size(), {-static_cast<long double>(bandwidths[level]), 0.0L});
      k = reference_current_gain(reference_polynomial(poles, sample_time));
      for (std::size_t r = 0; r < size(); ++r) {
        for (std::size_t i = 1; i <= r; ++i) k[r] *= Big(i) / Big(sample_time);
      }
    } else {
      for (std::size_t r = 0; r < size(); ++r) {
        k[r] = Big(choose(static_cast<int>(size()), static_cast<int>(r) + 1)) *
               pow(w, static_cast<int>(r) + 1);
      }
    }
    return k;
  }

  /// One step of the sampled observer, xi after the correction; or d xi / dt of the continuous one.
  [[nodiscard]] BigVector advance(const BigVector& xi, const Big& y, const Big& u) const {
    const std::size_t N = size();
    const auto n = static_cast<std::size_t>(order);
    BigVector next(xi.size(), Big(0));
    BigVector found(N, Big(0));  // disturbances of the levels before, before this step
    Big measured = y;
    for (std::size_t level = 0; level < levels(); ++level) {
      const BigVector k = gain(level);
      const std::size_t first = level * N;
      BigVector driven(N);  // own plant states, and the disturbance that drives them
      for (std::size_t r = 0; r < N; ++r) {
        driven[r] = xi[first + r];
        if (r >= n) driven[r] += found[r];
      }
      const Big input = Big(input_gain) * u;
      BigVector change(N, Big(0));
      if (sample_time > 0) {
        const Big T = sample_time;
        for (std::size_t r = 0; r < N; ++r) {
          // Taylor series over the sample; a disturbance row keeps to the level's own.
          Big term = 1;
          for (std::size_t c = r; c < N; ++c) {
            change[r] += term * (r < n ? driven[c] : xi[first + c]);
            if (c == n && r < n) change[r] += term * input;
            term *= T / Big(c + 1 - r);
          }
        }
        const Big e = measured - change[0];
        for (std::size_t r = 0; r < N; ++r) next[first + r] = change[r] + k[r] * e;
        measured = next[first];
      } else {
        const Big e = measured - xi[first];
        for (std::size_t r = 0; r < N; ++r) {
          Big rate = k[r] * e;
          if (r + 1 < N) rate += r + 1 <= n ? driven[r + 1] : xi[first + r + 1];
          if (r + 1 == n) rate += input;
          next[first + r] = rate;
        }
        measured = xi[first];
      }
      for (std::size_t r = n; r < N; ++r) found[r] += xi[first + r];
    }
    return next;
  }

  /// (24): plant states of the last level, disturbances of all levels together.
  [[nodiscard]] BigVector estimate(const BigVector& xi) const {
    const std::size_t N = size();
    BigVector z(N, Big(0));
    for (std::size_t level = 0; level < levels(); ++level) {
      for (std::size_t r = 0; r < N; ++r) {
        if (r >= static_cast<std::size_t>(order) || level + 1 == levels())
          z[r] += xi[level * N + r];
      }
    }
    return z;
  }

  /// The step as matrices: next = f xi + g_y y + g_u u.
  struct BigMatrices {
    BigMatrix f;
    BigVector y, u;
  };
  [[nodiscard]] BigMatrices exact_matrices() const {
    const std::size_t n = states();
    BigMatrices m{BigMatrix(n, BigVector(n)), {}, {}};
    const BigVector zero(n, Big(0));
    for (std::size_t j = 0; j < n; ++j) {
      BigVector unit = zero;
      unit[j] = 1;
      const BigVector column = advance(unit, 0, 0);
      for (std::size_t i = 0; i < n; ++i) m.f[i][j] = column[i];
    }
    m.y = advance(zero, 1, 0);
    m.u = advance(zero, 0, 1);
    return m;
  }

  /// From y and u to the estimates at a frequency (rad/s): [estimate][0: y, 1: u].
  ///
  /// Sampled, xi[k] = f xi[k-1] + g_y y[k] + g_u u[k-1], so from y: z (zI - f)^-1 g_y, from u
  /// (zI - f)^-1 g_u.
  [[nodiscard]] Response exact_response(double frequency) const {
    const BigMatrices m = exact_matrices();
    Big re = 0;
    Big im = frequency;
    if (sample_time > 0) {
      const Big angle = Big(frequency) * Big(sample_time);
      re = cos(angle);
      im = sin(angle);
    }
    Response result(size());
    for (int input = 0; input < 2; ++input) {
      BigComplexVector x = resolvent(m.f, input == 0 ? m.y : m.u, re, im);
      if (sample_time > 0 && input == 0) {
        for (std::size_t i = 0; i < states(); ++i) {
          const Big real = x.re[i] * re - x.im[i] * im;
          x.im[i] = x.re[i] * im + x.im[i] * re;
          x.re[i] = real;
        }
      }
      const BigVector z_re = estimate(x.re);
      const BigVector z_im = estimate(x.im);
      for (std::size_t r = 0; r < size(); ++r) {
        result[r][static_cast<std::size_t>(input)] = {static_cast<double>(z_re[r]),
                                                      static_cast<double>(z_im[r])};
      }
    }
    return result;
  }
};

}  // namespace

ReferenceObserver::Matrices ReferenceObserver::matrices() const {
  const BigObserver exact{*this};
  const auto m = exact.exact_matrices();
  const std::size_t n = states();
  const auto rounded = [](const BigVector& row) {
    std::vector<double> result;
    for (const Big& value : row) result.push_back(static_cast<double>(value));
    return result;
  };
  Matrices result{{}, rounded(m.y), rounded(m.u), {size(), std::vector<double>(n)}};
  for (const BigVector& row : m.f) result.f.push_back(rounded(row));
  for (std::size_t j = 0; j < n; ++j) {
    BigVector unit(n, Big(0));
    unit[j] = 1;
    const BigVector z = exact.estimate(unit);
    for (std::size_t r = 0; r < size(); ++r) result.estimate[r][j] = static_cast<double>(z[r]);
  }
  return result;
}

Response ReferenceObserver::response(double frequency) const {
  return BigObserver{*this}.exact_response(frequency);
}

}  // namespace esokit_test
