/// @file
/// Follows a loop gain over the frequency in steps short enough to miss no crossing, for the
/// margins.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/loop.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <vector>

namespace esokit::detail {

/// L = -P C of one channel.
struct LoopGain {
  SampledPlant plant;
  LinearController controller;  ///< with its own u as the applied u
  int channel;

  [[nodiscard]] std::complex<double> operator()(double frequency) const {
    return at(frequency_operator(frequency, controller.sample_time));
  }
  /// @param value value of D: i omega, or z - 1
  [[nodiscard]] std::complex<double> at(std::complex<double> value) const {
    return loop_gain_of_channel(response(plant, value), response(controller, value), channel);
  }
};

LoopGain loop_gain_of(const Loop& loop, int channel);

/// The frequency range in which a loop gain is examined: from well below its slowest pole to pi / T
/// or well above its fastest pole. It has the frequencies of all poles, near which the gain may
/// change fast.
struct ScanRange {
  std::vector<double> features;  ///< rad/s, rising
  double from = 0.0;
  double to = 0.0;
};

ScanRange scan_range(const Loop& loop, int channel);

/// L at frequency zero, which is real; NaN if plant or controller integrates. As this makes L
/// infinite in theory but only very large in numbers, it is recognised by the rise from the lowest
/// frequency, at which everything slow has ended.
double loop_gain_at_zero(const LoopGain& response, const ScanRange& range);

/// Calls visit(w1, L1, w2, L2) for adjacent intervals in which L changes by less than a fifth of
/// its magnitude and less than half its distance from -1.
template <class Response, class Visit>
void scan_piece(const Response& response, double w1, std::complex<double> l1, double w2,
                std::complex<double> l2, int depth, Visit& visit) {
  const double step = (std::abs)(l2 - l1);
  const double size = (std::min)((std::abs)(l1), (std::abs)(l2));
  const double distance = (std::min)((std::abs)(1.0 + l1), (std::abs)(1.0 + l2));
  const bool fine = step <= (std::min)(0.2 * size, 0.5 * distance) ||
                    (std::max)((std::abs)(l1), (std::abs)(l2)) < 1e-9;
  if (fine || depth == 0) {
    visit(w1, l1, w2, l2);
    return;
  }
  const double middle = std::sqrt(w1 * w2);
  const std::complex<double> l = response(middle);
  scan_piece(response, w1, l1, middle, l, depth - 1, visit);
  scan_piece(response, middle, l, w2, l2, depth - 1, visit);
}

template <class Response, class Visit>
void scan(const Response& response, const ScanRange& range, Visit&& visit) {
  double w1 = range.from;
  std::complex<double> l1 = response(w1);
  const auto go_to = [&](double w2) {
    // Poles that differ by rounding only are one feature.
    if (!(w2 > w1 * (1.0 + 1e-7)) || w2 > range.to) return;
    const double start = w1;
    // The root of the quotient, because the quotient itself may overflow.
    const double root = std::sqrt(w2) / std::sqrt(start);
    const int pieces = 2 + static_cast<int>(std::ceil(60.0 * std::log10(root)));
    for (int i = 1; i <= pieces; ++i) {
      const double part = std::pow(root, double(i) / pieces);
      const double w = i == pieces ? w2 : start * part * part;
      const std::complex<double> l = response(w);
      if (is_finite(l.real()) && is_finite(l.imag())) {
        if (is_finite(l1.real()) && is_finite(l1.imag())) {
          scan_piece(response, w1, l1, w, l, 14, visit);
        }
        w1 = w;
        l1 = l;
      }
    }
  };
  for (const double feature : range.features) {
    // Close to the pole but not at it, because it may lie on the axis.
    go_to(feature * (1.0 - 1e-6));
    go_to(feature * (1.0 + 1e-6));
  }
  go_to(range.to);
}

/// Root of f in [low, high] by bisection to the last digits; f has different signs at the ends.
template <class Function>
double bisect(const Function& f, double low, double high) {
  const bool rising = f(low) < 0.0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    if (!(middle > low) || !(middle < high)) break;
    ((f(middle) < 0.0) == rising ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Position of the minimum of f in [low, high] by golden section.
template <class Function>
double golden_section(const Function& f, double low, double high) {
  constexpr double ratio = 0.6180339887498949;
  double a = high - ratio * (high - low);
  double b = low + ratio * (high - low);
  double fa = f(a);
  double fb = f(b);
  for (int i = 0; i < 60 && high - low > 1e-12 * high; ++i) {
    if (fa < fb) {
      high = b;
      b = a;
      fb = fa;
      a = high - ratio * (high - low);
      fa = f(a);
    } else {
      low = a;
      a = b;
      fa = fb;
      b = low + ratio * (high - low);
      fb = f(b);
    }
  }
  return fa < fb ? a : b;
}

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/loop_scan.ipp>
#endif
