/// @file
/// The chain of integrators on which the observers are built, in physical units.
#pragma once

#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/model/scaled_chain.hpp>

namespace esokit {

/// Continuous and exactly sampled matrices of z = (y, y', .., y^(n-1), d, d', .., d^(m-1)).
///
/// z' = A z + B u, y = C z; z[k+1] = Phi z[k] + Gamma u[k] for an input held over the sample. A is
/// nilpotent, so Phi and Gamma are finite sums, and exact. N = n + m.
/// @tparam Order n, @tparam ScalarType scalar, @tparam Extension m
template <int Order, Scalar ScalarType = double, int Extension = 1>
struct IntegratorChain : ChainSize<Order, Extension> {
  using ChainSize<Order, Extension>::size;
  using State = Vector<ScalarType, size>;         ///< z, N x 1
  using Square = Matrix<ScalarType, size, size>;  ///< N x N

  /// A, N x N: ones on the first superdiagonal.
  static Square state_matrix() {
    Square a = Square::Zero();
    for (int i = 0; i + 1 < size; ++i) a(i, i + 1) = ScalarType(1.0);
    return a;
  }

  /// B, N x 1: `input_gain` (b0, unit of y^(n) per unit of u) at row n - 1.
  static State input_matrix(const ScalarType& input_gain) {
    State b = State::Zero();
    b(Order - 1) = input_gain;
    return b;
  }

  /// C, 1 x N: the first state is measured.
  static RowVector<ScalarType, size> output_matrix() {
    RowVector<ScalarType, size> c = RowVector<ScalarType, size>::Zero();
    c(0) = ScalarType(1.0);
    return c;
  }

  /// Phi(T) = exp(A T), N x N: Phi_ij = T^(j-i) / (j-i)!.
  /// @param sample_time T, s
  static Square transition_matrix(const ScalarType& sample_time) {
    Square phi = Square::Identity();
    for (int i = 0; i < size; ++i) {
      for (int j = i + 1; j < size; ++j) {
        phi(i, j) = phi(i, j - 1) * sample_time / detail::integer<ScalarType>(j - i);
      }
    }
    return phi;
  }

  /// Gamma(T), N x 1: Gamma_i = b0 T^(n-i) / (n-i)! for i < n, else 0.
  /// @param sample_time T, s @param input_gain b0, unit of y^(n) per unit of u
  static State sampled_input_matrix(const ScalarType& sample_time, const ScalarType& input_gain) {
    State gamma = State::Zero();
    ScalarType term = input_gain;
    for (int i = Order - 1; i >= 0; --i) {
      term = term * sample_time / detail::integer<ScalarType>(Order - i);
      gamma(i) = term;
    }
    return gamma;
  }
};

}  // namespace esokit
