/// @file
/// Gains of the sampled observer to 100 digits, by another formula than the library's.
#pragma once

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <complex>
#include <cstddef>
#include <vector>

namespace esokit_test {

/// 100 digits: the formula below cancels up to N ln(1 / omega_o T) of them.
using Big = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<100>,
                                          boost::multiprecision::et_off>;

using Poles = std::vector<std::complex<long double>>;

/// beta_0 .. beta_N of prod(delta + a_i) = sum_j beta_j delta^(N-j), a_i = 1 - exp(p_i T): the
/// characteristic polynomial of the sampled error in delta = z - 1.
inline std::vector<Big> reference_polynomial(const Poles& poles, long double sample_time) {
  std::vector<Big> re{Big(1)};
  std::vector<Big> im{Big(0)};
  for (const auto& pole : poles) {
    const Big decay = exp(Big(pole.real()) * Big(sample_time));
    const Big phase = Big(pole.imag()) * Big(sample_time);
    const Big a_re = 1 - decay * cos(phase);
    const Big a_im = -decay * sin(phase);
    re.emplace_back(0);
    im.emplace_back(0);
    for (std::size_t j = re.size() - 1; j > 0; --j) {
      const Big was = re[j - 1];
      re[j] += a_re * was - a_im * im[j - 1];
      im[j] += a_re * im[j - 1] + a_im * was;
    }
  }
  return re;
}

/// Signed Stirling numbers of the first kind, s(n, k) for n, k < size.
inline std::vector<std::vector<Big>> reference_stirling(std::size_t size) {
  std::vector<std::vector<Big>> s(size, std::vector<Big>(size, Big(0)));
  s[0][0] = 1;
  for (std::size_t n = 1; n < size; ++n) {
    for (std::size_t k = 1; k <= n; ++k) s[n][k] = s[n - 1][k - 1] - Big(n - 1) * s[n - 1][k];
  }
  return s;
}

/// Pascal's triangle or, with alternating signs, its inverse, applied to a gain.
inline std::vector<Big> pascal_times(const std::vector<Big>& x, bool inverse) {
  std::vector<Big> result(x.size(), Big(0));
  for (std::size_t r = 0; r < x.size(); ++r) {
    Big weight = 1;  // C(c, r)
    for (std::size_t c = r; c < x.size(); ++c) {
      result[r] += inverse && (c - r) % 2 == 1 ? Big(-weight * x[c]) : Big(weight * x[c]);
      weight = weight * Big(c + 1) / Big(c + 1 - r);
    }
  }
  return result;
}

/// Predictor gain l in Nordsieck scaling: l_r = sum_{j>=r} s(j, r) / j! beta_{j+1} (DESIGN.md).
inline std::vector<Big> reference_predictor_gain(const std::vector<Big>& polynomial) {
  const std::size_t size = polynomial.size() - 1;
  const auto stirling = reference_stirling(size);
  std::vector<Big> gain(size, Big(0));
  for (std::size_t r = 0; r < size; ++r) {
    Big factorial = 1;
    for (std::size_t j = 0; j < size; ++j) {
      if (j > 0) factorial *= Big(j);
      if (j >= r) gain[r] += stirling[j][r] / factorial * polynomial[j + 1];
    }
  }
  return gain;
}

/// Current-estimator gain k = Phi^-1 l.
inline std::vector<Big> reference_current_gain(const std::vector<Big>& polynomial) {
  return pascal_times(reference_predictor_gain(polynomial), true);
}

/// |value - reference| / |reference|.
template <class T>
double relative_error(T value, const Big& reference) {
  return static_cast<double>(abs((Big(value) - reference) / reference));
}

}  // namespace esokit_test
