/// @file
/// Comparisons with the high-precision references of gains. Compiled once: the many digits cost
/// five seconds a translation unit.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace esokit_test {

using Poles = std::vector<std::complex<long double>>;

/// The smallest of the last gains prod(1 - rho) / (N-1)! of all levels.
long double smallest_gain(const std::vector<Poles>& level_poles, long double sample_time);

/// Estimates of all levels after an innovation of 1, rows up to `order` of the level's own, the
/// rest summed over the levels. Values between `smallest` and `largest` are judged; returns how
/// many.
int compare_gains(const std::vector<std::vector<long double>>& estimates, int order,
                  const std::vector<Poles>& level_poles, long double sample_time,
                  long double tolerance, long double smallest, long double largest);

/// The polynomial in z - 1 that physical gains make, against that of the poles.
void compare_polynomial(const std::vector<long double>& gain, const Poles& poles,
                        long double sample_time, long double tolerance);

/// Current-estimator gain of an algebraic observer of `size` states at sample k, Nordsieck scaling.
/// @param bandwidth lambda T @param shift q T
std::vector<double> reference_algebraic_gain(std::size_t size, double bandwidth, double shift,
                                             std::int64_t k);

/// States in physical units at the last sample, of the polynomial of degree N - 1 that fits all y
/// best once the effect of the inputs is taken out.
std::vector<double> least_squares_states(const std::vector<double>& y, const std::vector<double>& u,
                                         std::size_t order, std::size_t extension,
                                         double input_gain, double sample_time);

}  // namespace esokit_test
