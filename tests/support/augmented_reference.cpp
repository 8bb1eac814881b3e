#include "support/augmented_reference.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "support/high_precision.hpp"

namespace esokit_test {
namespace {

using BigMatrix = std::vector<std::vector<Big>>;

BigMatrix big_zero(std::size_t rows, std::size_t columns) {
  return BigMatrix(rows, std::vector<Big>(columns, Big(0)));
}
BigMatrix big_identity(std::size_t n) {
  BigMatrix m = big_zero(n, n);
  for (std::size_t i = 0; i < n; ++i) m[i][i] = 1;
  return m;
}
BigMatrix times(const BigMatrix& a, const BigMatrix& b) {
  BigMatrix c = big_zero(a.size(), b[0].size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < b.size(); ++k) {
      for (std::size_t j = 0; j < b[0].size(); ++j) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}

/// a^-1 b by Gauss and Jordan.
BigMatrix solved(BigMatrix a, BigMatrix b) {
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
BigMatrix big_exponential(BigMatrix a, double time) {
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
std::vector<Big> characteristic(const BigMatrix& m) {
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

Table rounded(const BigMatrix& m) {
  Table result;
  for (const auto& row : m) {
    result.emplace_back();
    for (const Big& x : row) result.back().push_back(static_cast<long double>(x));
  }
  return result;
}

struct BigReference {
  BigMatrix a;          ///< with the input as last state
  BigMatrix published;  ///< the library's states of these, physical units
  std::size_t size;

  BigReference(const AugmentedReference& of, const esokit::ModelParts& parts,
               const AugmentedNumbers& s, double input_gain)
      : a(big_zero(of.size + 1, of.size + 1)),
        published(big_zero(of.size, of.size)),
        size(of.size) {
    const std::size_t y = of.y, v = of.v, c = of.c, q = of.q, fade = of.fade;
    const std::size_t lf = y, n = v - y, la = c - v, order = n + la, m = q - c;
    const std::size_t k = s.resonators.size(), l = s.first_order.size();
    if (lf == 1) {
      a[0][0] = -1 / Big(s.sensor[0]);
      a[0][y] = -a[0][0];
    } else if (lf == 2) {
      const Big w = s.sensor[0];
      a[0][1] = w;
      a[1][y] = w;
      a[1][0] = -w;
      a[1][1] = -2 * w * Big(s.sensor[1]);
    }
    for (std::size_t i = 0; i + 1 < n; ++i) a[y + i][y + i + 1] = 1;
    const std::size_t top = y + n - 1;
    if (parts.plant_poles) {
      for (std::size_t i = 0; i < n; ++i) a[top][y + i] -= Big(s.plant[i]);
    }
    a[top][la == 0 ? size : v] += Big(input_gain);
    a[top][c] += 1;
    for (std::size_t i = 0; i < k; ++i) a[top][q + 2 * i] += 1;
    for (std::size_t i = 0; i < l; ++i) a[top][fade + i] += 1;
    if (la == 1) {
      a[v][size] = 1 / Big(s.actuator[0]);
      a[v][v] = -a[v][size];
    } else if (la == 2) {
      const Big w = s.actuator[0];
      a[v][v + 1] = 1;
      a[v + 1][size] = w * w;
      a[v + 1][v] = -w * w;
      a[v + 1][v + 1] = -2 * w * Big(s.actuator[1]);
    }
    for (std::size_t i = 0; i + 1 < m; ++i) a[c + i][c + i + 1] = 1;
    for (std::size_t i = 0; i < k; ++i) {
      const Big w = s.resonators[i][0];
      a[q + 2 * i][q + 2 * i + 1] = w;
      a[q + 2 * i + 1][q + 2 * i] = -w;
      a[q + 2 * i + 1][q + 2 * i + 1] = -2 * w * Big(s.resonators[i][1]);
    }
    for (std::size_t i = 0; i < l; ++i) a[fade + i][fade + i] = -1 / Big(s.first_order[i]);

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

}  // namespace

AugmentedReference::AugmentedReference(const esokit::ModelParts& parts, AugmentedNumbers numbers,
                                       double input_gain)
    : y(static_cast<std::size_t>(parts.sensor)),
      v(y + static_cast<std::size_t>(parts.order)),
      c(v + static_cast<std::size_t>(parts.actuator)),
      q(c + static_cast<std::size_t>(parts.constants)),
      fade(q + 2 * numbers.resonators.size()),
      size(fade + numbers.first_order.size()),
      parts_(parts),
      numbers_(std::move(numbers)),
      input_gain_(input_gain) {}

Table AugmentedReference::natural_step(double time) const {
  return rounded(big_exponential(BigReference(*this, parts_, numbers_, input_gain_).a, time));
}

Table AugmentedReference::step(double time) const {
  return rounded(BigReference(*this, parts_, numbers_, input_gain_).step(time));
}

Table AugmentedReference::published() const {
  return rounded(BigReference(*this, parts_, numbers_, input_gain_).published);
}

std::vector<long double> AugmentedReference::natural(
    const std::vector<long double>& published) const {
  BigMatrix column;
  for (const long double x : published) column.push_back({Big(x)});
  std::vector<long double> result;
  for (const auto& row :
       solved(BigReference(*this, parts_, numbers_, input_gain_).published, column)) {
    result.push_back(static_cast<long double>(row[0]));
  }
  return result;
}

double AugmentedReference::worst_coefficient(const std::vector<double>& gain,
                                             const std::vector<int>& degrees, const Poles& poles,
                                             double time) const {
  // (I - k C) Phi - I
  BigMatrix m = BigReference(*this, parts_, numbers_, input_gain_).step(time);
  for (auto& row : m) row.resize(size);
  std::vector<Big> output = m[0];
  output[0] += 1;
  for (std::size_t i = 0; i < size; ++i) {
    Big k = gain[i];
    for (int j = 1; j <= degrees[i]; ++j) k *= Big(j) / Big(time);
    for (std::size_t j = 0; j < size; ++j) m[i][j] -= k * output[j];
  }
  const auto got = characteristic(m);
  const auto wanted = reference_polynomial(poles, static_cast<long double>(time));
  double worst = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    worst = std::max(worst, std::abs(static_cast<double>(Big(got[i] / wanted[i] - 1))));
  }
  return worst;
}

}  // namespace esokit_test
