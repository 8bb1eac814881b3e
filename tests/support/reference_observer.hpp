/// @file
/// Observers as state spaces, written from the equations of the papers without the library: each
/// level with its own disturbance, equations (23), (24) of the cascade, in many digits. Compiled
/// once: the many digits cost seconds a translation unit.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

namespace esokit_test {

/// n, m and the bandwidths of the levels; T = 0 is the continuous observer.
struct ReferenceObserver {
  int order, extension;
  std::vector<double> bandwidths;  // rad/s
  double input_gain;
  double sample_time;

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(order + extension); }
  [[nodiscard]] std::size_t levels() const { return bandwidths.size(); }
  [[nodiscard]] std::size_t states() const { return size() * levels(); }

  /// The step as matrices, rounded: next = f xi + y y + u u, zhat = estimate xi.
  struct Matrices {
    std::vector<std::vector<double>> f;
    std::vector<double> y, u;
    std::vector<std::vector<double>> estimate;
  };
  [[nodiscard]] Matrices matrices() const;

  /// From y and u to the estimates at a frequency (rad/s): [estimate][0: y, 1: u].
  [[nodiscard]] std::vector<std::array<std::complex<double>, 2>> response(double frequency) const;
};

}  // namespace esokit_test
