/// @file
/// Augmented models in 100 digits, from the differential equations of their parts: states (f, y,
/// .., v, c, .., q, r, .., l), and what the library publishes of them.
#pragma once

#include <complex>
#include <cstddef>
#include <esokit/model/augmented_model.hpp>
#include <vector>

#include <support/high_precision.hpp>

namespace esokit_test {

using BigMatrix = std::vector<std::vector<Big>>;

inline BigMatrix big_zero(std::size_t rows, std::size_t columns) {
  return BigMatrix(rows, std::vector<Big>(columns, Big(0)));
}
inline BigMatrix big_identity(std::size_t n) {
  BigMatrix m = big_zero(n, n);
  for (std::size_t i = 0; i < n; ++i) m[i][i] = 1;
  return m;
}
inline BigMatrix times(const BigMatrix& a, const BigMatrix& b) {
  BigMatrix c = big_zero(a.size(), b[0].size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < b.size(); ++k) {
      for (std::size_t j = 0; j < b[0].size(); ++j) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}

/// a^-1 b by Gauss and Jordan.
inline BigMatrix solved(BigMatrix a, BigMatrix b) {
  const std::size_t n = a.size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (abs(a[i][k]) > abs(a[pivot][k])) pivot = i;
    }
    std::swap(a[k], a[pivot]);
    std::swap(b[k], b[pivot]);
    for (std::size_t i = 0; i < n; ++i) {
      const Big factor = i == k ? Big(0) : Big(a[i][k] / a[k][k]);
      for (std::size_t j = 0; j < n; ++j) a[i][j] -= factor * a[k][j];
      for (auto& x : b[i]) x -= factor * b[k][static_cast<std::size_t>(&x - b[i].data())];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (auto& x : b[i]) x /= a[i][i];
  }
  return b;
}

/// exp(A T) - I, by its series and squaring.
inline BigMatrix big_exponential(BigMatrix a, double time) {
  const std::size_t n = a.size();
  constexpr int squarings = 24;
  for (auto& row : a) {
    for (Big& x : row) x *= Big(time) / Big(1 << squarings);
  }
  BigMatrix sum = big_zero(n, n);
  BigMatrix term = big_identity(n);
  for (int k = 1; k < 40; ++k) {
    term = times(term, a);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        term[i][j] /= k;
        sum[i][j] += term[i][j];
      }
    }
  }
  for (int s = 0; s < squarings; ++s) {
    const BigMatrix square = times(sum, sum);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) sum[i][j] = 2 * sum[i][j] + square[i][j];
    }
  }
  return sum;
}

/// Coefficients of det(x I - M), by Faddeev and LeVerrier.
inline std::vector<Big> characteristic(const BigMatrix& m) {
  const std::size_t n = m.size();
  std::vector<Big> c{Big(1)};
  BigMatrix b = big_identity(n);
  for (std::size_t k = 1; k <= n; ++k) {
    b = times(m, b);
    Big trace = 0;
    for (std::size_t i = 0; i < n; ++i) trace += b[i][i];
    c.push_back(-trace / Big(k));
    for (std::size_t i = 0; i < n; ++i) b[i][i] += c.back();
  }
  return c;
}

/// An AugmentedModel of the same parts and numbers.
template <esokit::ModelParts Parts>
struct AugmentedReference {
  using Model = esokit::AugmentedModel<Parts, double>;
  static constexpr auto lf = static_cast<std::size_t>(Parts.sensor);
  static constexpr auto n = static_cast<std::size_t>(Parts.order);
  static constexpr auto la = static_cast<std::size_t>(Parts.actuator);
  static constexpr auto m = static_cast<std::size_t>(Parts.constants);
  static constexpr auto k = static_cast<std::size_t>(Parts.resonators);
  static constexpr auto l = static_cast<std::size_t>(Parts.leaky);
  static constexpr std::size_t order = n + la;
  static constexpr std::size_t size = lf + order + m + 2 * k + l;
  static constexpr std::size_t y = lf, v = y + n, c = v + la, q = c + m, fade = q + 2 * k;

  BigMatrix a = big_zero(size + 1, size + 1);  ///< with the input as last state
  BigMatrix published = big_zero(size, size);  ///< the library's states of these, physical units

  AugmentedReference(const typename Model::Settings& s, double input_gain) {
    if constexpr (lf == 1) {
      a[0][0] = -1 / Big(s.sensor.time_constant);
      a[0][y] = -a[0][0];
    } else if constexpr (lf == 2) {
      const Big w = s.sensor.frequency;
      a[0][1] = w;
      a[1][y] = w;
      a[1][0] = -w;
      a[1][1] = -2 * w * Big(s.sensor.damping);
    }
    for (std::size_t i = 0; i + 1 < n; ++i) a[y + i][y + i + 1] = 1;
    const std::size_t top = y + n - 1;
    if constexpr (Parts.plant_poles) {
      for (std::size_t i = 0; i < n; ++i) a[top][y + i] -= Big(s.plant[i]);
    }
    a[top][la == 0 ? size : v] += Big(input_gain);
    a[top][c] += 1;
    for (std::size_t i = 0; i < k; ++i) a[top][q + 2 * i] += 1;
    for (std::size_t i = 0; i < l; ++i) a[top][fade + i] += 1;
    if constexpr (la == 1) {
      a[v][size] = 1 / Big(s.actuator.time_constant);
      a[v][v] = -a[v][size];
    } else if constexpr (la == 2) {
      const Big w = s.actuator.frequency;
      a[v][v + 1] = 1;
      a[v + 1][size] = w * w;
      a[v + 1][v] = -w * w;
      a[v + 1][v + 1] = -2 * w * Big(s.actuator.damping);
    }
    for (std::size_t i = 0; i + 1 < m; ++i) a[c + i][c + i + 1] = 1;
    for (std::size_t i = 0; i < k; ++i) {
      const Big w = s.resonators[i].frequency;
      a[q + 2 * i][q + 2 * i + 1] = w;
      a[q + 2 * i + 1][q + 2 * i] = -w;
      a[q + 2 * i + 1][q + 2 * i + 1] = -2 * w * Big(s.resonators[i].damping);
    }
    for (std::size_t i = 0; i < l; ++i) a[fade + i][fade + i] = -1 / Big(s.leaky[i]);

    for (std::size_t i = 0; i < lf; ++i) published[i][i] = 1;
    BigMatrix row = big_zero(1, size + 1);
    row[0][y] = 1;
    for (std::size_t r = 0; r <= order; ++r) {
      for (std::size_t j = 0; j < size; ++j) published[lf + r][j] = row[0][j];
      row = times(row, a);
      row[0][size] = 0;  // u is not part of D
    }
    for (std::size_t i = 1; i < m; ++i) published[lf + order + i][c + i] = 1;
    for (std::size_t i = 0; i < 2 * k + l; ++i) published[lf + order + m + i][q + i] = 1;
  }

  /// Phi - I, and Gamma as last column, of the published states in physical units.
  [[nodiscard]] BigMatrix step(double time) const {
    const BigMatrix all = big_exponential(a, time);
    BigMatrix inner = big_zero(size, size + 1);
    for (std::size_t i = 0; i < size; ++i) inner[i] = all[i];
    const BigMatrix left = times(published, inner);
    // left = step published, from behind: published' step' = left'.
    BigMatrix transposed = big_zero(size, size);
    BigMatrix right = big_zero(size, size);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        transposed[j][i] = published[i][j];
        right[j][i] = left[i][j];
      }
    }
    const BigMatrix step = solved(transposed, right);
    BigMatrix result = big_zero(size, size + 1);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) result[i][j] = step[j][i];
      result[i][size] = left[i][size];
    }
    return result;
  }
};

/// Poles of a lag, 1/s.
/// @{
inline Poles poles_of(const esokit::Lag<0, double>&) { return {}; }
inline Poles poles_of(const esokit::Lag<1, double>& lag) {
  return {std::complex<long double>(-1.0L / static_cast<long double>(lag.time_constant), 0)};
}
inline Poles poles_of(const esokit::Lag<2, double>& lag) {
  const std::complex<long double> root = std::sqrt(std::complex<long double>(
      static_cast<long double>(lag.damping) * static_cast<long double>(lag.damping) - 1.0L, 0));
  const auto w = static_cast<long double>(lag.frequency);
  const std::complex<long double> middle(-static_cast<long double>(lag.damping), 0);
  return {w * (middle + root), w * (middle - root)};
}
/// @}

}  // namespace esokit_test
