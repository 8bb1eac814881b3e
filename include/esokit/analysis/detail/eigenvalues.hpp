/// @file
/// Eigenvalues of a complex matrix, by the QR algorithm on the caller's storage, see
/// math/detail/dense.hpp.
#pragma once

#include <complex>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit::detail {

/// Writes the eigenvalues of h, which is overwritten, to `values`. False if the iteration does not
/// converge.
bool eigenvalues(DenseView<std::complex<double>> h, std::complex<double>* values) noexcept;

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/eigenvalues.ipp>
#endif
