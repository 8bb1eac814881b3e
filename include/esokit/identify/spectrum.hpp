/// @file
/// Power spectrum of a residual that may have gaps.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/language.hpp>
#include <numbers>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// Fast Fourier transform in place; the size must be a power of two.
void transform(std::vector<std::complex<double>>& x);

}  // namespace detail

/// Calls `use(power)` for each stretch of `length` rows (a power of two); stretches overlap by half
/// and have a raised-cosine window (Welch's method). power[j] is at j / (length / 2) of half the
/// sample rate, j = 0 .. length / 2; for white noise each is on average its variance.
/// @param starts first rows of pieces without a gap @param lead rows at the start of each piece
/// that are not used
template <class Use>
void each_spectrum(const std::vector<double>& values, const std::vector<std::size_t>& starts,
                   std::size_t lead, std::size_t length, const Use& use) {
  std::vector<double> window(length), power(length / 2 + 1);
  double square = 0.0;
  for (std::size_t k = 0; k < length; ++k) {
    const double phase =
        2.0 * std::numbers::pi * (static_cast<double>(k) + 0.5) / static_cast<double>(length);
    window[k] = 0.5 - 0.5 * std::cos(phase);
    square += window[k] * window[k];
  }
  std::vector<std::complex<double>> x(length);
  for (std::size_t piece = 0; piece < starts.size(); ++piece) {
    const std::size_t to = piece + 1 < starts.size() ? starts[piece + 1] : values.size();
    for (std::size_t from = starts[piece] + lead; from + length <= to; from += length / 2) {
      for (std::size_t k = 0; k < length; ++k) x[k] = window[k] * values[from + k];
      detail::transform(x);
      for (std::size_t j = 0; j < power.size(); ++j) power[j] = std::norm(x[j]) / square;
      use(std::as_const(power));
    }
  }
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/spectrum.ipp>
#endif
