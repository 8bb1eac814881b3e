/// @file
/// The extended state filter on dense matrices in physical units, as the paper writes it (with its
/// corrections), in any scalar: an oracle that shares no code with the library.
///
/// S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen, Energies 15 (2022) 5799, (4), (10), (11), (24).
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace esokit_test {

template <int Order, class S, int Extension = 1>
struct DenseFilter {
  static constexpr int size = Order + Extension;
  using Square = Eigen::Matrix<S, size, size>;
  using State = Eigen::Matrix<S, size, 1>;

  Square a, q, p;
  State b, z = State::Zero();
  S r{};
  S theta{};
  bool plain = false;  ///< the plain Kalman filter

  DenseFilter(double sample_time, double input_gain) {
    a.setZero();
    b.setZero();
    for (int i = 0; i < size; ++i) {
      S term = 1;
      for (int j = i; j < size; ++j) {
        a(i, j) = term;
        term = term * S(sample_time) / S(j - i + 1);
      }
    }
    // The input acts where the disturbance does.
    b = a.col(Order) * S(input_gain);
    b.tail(Extension).setZero();
    q.setZero();
    p.setZero();
  }

  S innovation_variance() const { return p(0, 0) + (plain ? r : S(r / (S(1) + theta))); }

  /// L = P C' / s of the present P.
  State current_gain() const { return p.col(0) / innovation_variance(); }

  /// z+ = A z + B u - K (y - C z), K = -A L, and (11).
  void step_predictor_form(S y, S u) {
    const State k = -(a * current_gain());
    z = (a * z + b * u - k * (y - z(0))).eval();
    step_covariance(k);
  }

  /// A sample without a measurement: K = 0.
  void step_blind(S u) {
    z = (a * z + b * u).eval();
    step_covariance(State::Zero());
  }

  void step_covariance(const State& k) {
    Square closed = a;
    closed.col(0) += k;
    const Square homogeneous = closed * p * closed.transpose();
    const Square noise = k * r * k.transpose();
    if (plain) {
      p = homogeneous + noise + q;
    } else {
      p = homogeneous * (S(1) + theta) + noise + q * ((S(1) + theta) / theta);
    }
    p = ((p + p.transpose().eval()) / S(2)).eval();
  }
};

}  // namespace esokit_test
