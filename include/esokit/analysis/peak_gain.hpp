/// @file
/// The largest output that a bounded input can cause: for a linear observer the exact worst case,
/// while a Lyapunov bound is only an upper bound.
#pragma once

#include <cmath>
#include <esokit/analysis/poles.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

/// `peak_gain` on the caller's storage.
/// @param fastest largest magnitude of a pole, for a continuous system @param work 3 n^2 + 2 n
Check<double> peak_gain(const SystemView& system, double abscissa, double fastest,
                        const DenseView<double>& peak, double* work);

}  // namespace detail

/// Peak of each output for each input of magnitude up to one, Outputs x Inputs: the sum (integral)
/// of the magnitude of the impulse response. This bound is sharp: some input of magnitude one comes
/// arbitrarily close to it.
///
/// Accuracy: sampled systems 1e-9, at which the sum is truncated; continuous ones, by the trapezoid
/// rule, about 1e-4.
/// @return error for a system that is not stable, or whose response lasts longer than 1e8 steps or
///         overflows
template <int States, int Inputs, int Outputs>
Expected<EigenMatrix<double, Outputs, Inputs>, Error<double>> peak_gain(
    const LinearSystem<States, Inputs, Outputs>& system) {
  double fastest = 0.0;
  for (const std::complex<double>& p : poles(system)) fastest = (std::max)(fastest, (std::abs)(p));
  EigenMatrix<double, Outputs, Inputs> peak;
  Array<double, 3 * States * States + 2 * States> work;
  if (const auto ok = detail::peak_gain(detail::view_of(system), stability_abscissa(system),
                                        fastest, {peak.data(), Outputs, Inputs}, work.data());
      !ok) {
    return ok.error();
  }
  return peak;
}

/// The same for a system whose sizes are known at run time.
Expected<DynamicMatrix<double>, Error<double>> peak_gain(const DynamicSystem& system);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/peak_gain.ipp>
#endif
