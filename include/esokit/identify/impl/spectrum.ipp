#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <esokit/identify/spectrum.hpp>
#include <numbers>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n / 2;
    for (; (j & bit) != 0; bit /= 2) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  for (std::size_t length = 2; length <= n; length *= 2) {
    const std::size_t half = length / 2;
    for (std::size_t k = 0; k < half; ++k) {
      const double angle =
          -2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(length);
      const std::complex<double> turn(std::cos(angle), std::sin(angle));
      for (std::size_t i = k; i < n; i += length) {
        const std::complex<double> odd = x[i + half] * turn;
        x[i + half] = x[i] - odd;
        x[i] += odd;
      }
    }
  }
}

}  // namespace detail
}  // namespace esokit
