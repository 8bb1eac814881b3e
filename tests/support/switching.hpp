/// @file
/// Error dynamics of observers as dense matrices, written from the definition, and how fast
/// products of two of them grow.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/analysis/detail/eigenvalues.hpp>
#include <stdexcept>

namespace esokit_test {

template <int N>
using Square = Eigen::Matrix<double, N, N>;
template <int N>
using Column = Eigen::Matrix<double, N, 1>;

/// A - l C of the continuous chain.
template <int N>
Square<N> continuous_error_matrix(const Column<N>& gain) {
  Square<N> a = Square<N>::Zero();
  for (int i = 0; i + 1 < N; ++i) a(i, i + 1) = 1;
  a.col(0) -= gain;
  return a;
}

/// (I - k C) Phi of the scaled chain, Phi_ij = C(j, i).
template <int N, class Gain>
Square<N> sampled_error_matrix(const Gain& gain) {
  Square<N> phi = Square<N>::Zero();
  for (int j = 0; j < N; ++j) {
    phi(0, j) = 1;
    for (int i = 1; i <= j; ++i) phi(i, j) = phi(i, j - 1) + phi(i - 1, j - 1);  // Pascal
  }
  Square<N> correction = Square<N>::Identity();
  for (int i = 0; i < N; ++i) correction(i, 0) -= gain[static_cast<std::size_t>(i)];
  return correction * phi;
}

/// (A - I)(A + I)^-1.
template <int N>
Square<N> cayley(const Square<N>& a) {
  const Square<N> identity = Square<N>::Identity();
  return (a - identity) * (a + identity).inverse();
}

/// Eigenvalues. Not by Eigen, whose solver takes seconds to compile for each size: by the kernel of
/// analysis/, which has its own test and which no certificate uses.
template <int N>
Eigen::Matrix<std::complex<double>, N, 1> eigenvalues(const Square<N>& a) {
  Eigen::Matrix<std::complex<double>, N, N> work = a;
  Eigen::Matrix<std::complex<double>, N, 1> values;
  if (!esokit::detail::eigenvalues({work.data(), N}, values.data())) {
    throw std::runtime_error("no eigenvalues");
  }
  return values;
}

/// The test as the theorem states it: no eigenvalue of a b on the negative real axis. `guard` is
/// the angle to the axis, in radians, below which an eigenvalue counts as on it.
template <int N>
bool product_avoids_negative_axis(const Square<N>& a, const Square<N>& b, double guard = 1e-5) {
  for (const std::complex<double>& value : eigenvalues<N>(a * b)) {
    if (value.real() < 0 && std::abs(value.imag()) <= guard * std::abs(value)) return false;
  }
  return true;
}

template <int N>
double spectral_radius(const Square<N>& a) {
  return eigenvalues<N>(a).cwiseAbs().maxCoeff();
}

/// Largest real part of the eigenvalues.
template <int N>
double spectral_abscissa(const Square<N>& a) {
  return eigenvalues<N>(a).real().maxCoeff();
}

/// exp(a t) by scaling and squaring of the Taylor series.
template <int N>
Square<N> exponential(const Square<N>& a, double t) {
  int halvings = 0;
  while (a.cwiseAbs().rowwise().sum().maxCoeff() * std::abs(t) / std::ldexp(1.0, halvings) > 0.25) {
    ++halvings;
  }
  const Square<N> small = a * (t / std::ldexp(1.0, halvings));
  Square<N> term = Square<N>::Identity();
  Square<N> sum = term;
  for (int i = 1; i < 20; ++i) {
    term = term * small / i;
    sum += term;
  }
  for (int i = 0; i < halvings; ++i) sum = sum * sum;
  return sum;
}

/// Growth rate (1/s) of the error under a for t_a, b for t_b, and again.
template <int N>
double periodic_growth(const Square<N>& a, double t_a, const Square<N>& b, double t_b) {
  const Square<N> period = exponential<N>(b, t_b) * exponential<N>(a, t_a);
  return std::log(spectral_radius<N>(period)) / (t_a + t_b);
}

}  // namespace esokit_test
