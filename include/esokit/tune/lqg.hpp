/// @file
/// The controller with the smallest J of all linear controllers: constant Kalman gain, LQR gains,
/// and -dhat / b0.
///
/// It knows lag, sensor and dead time, but guarantees no margins. With u~ = u + d / b0 in place of
/// u the regulator is that for the plant without disturbance; for a dead time of D samples the
/// state is predicted D samples ahead.
#pragma once

#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/tune/specification.hpp>

namespace esokit {

namespace detail {

DynamicMatrix<double> transposed(const DynamicMatrix<double>& a);

/// X = A' X A - A' X B (R + B' X B)^-1 B' X A + Q, one input, by the structure-preserving doubling
/// algorithm (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, Int. J. Control 77 (2004) 767-788).
/// Gives the smallest solution, which is stabilising if all unstable modes of A are observable
/// through Q.
/// @param q positive semidefinite
DynamicMatrix<double> solve_riccati(DynamicMatrix<double> a, const DynamicMatrix<double>& b,
                                    double r, DynamicMatrix<double> q);

}  // namespace detail

/// The LQG controllers of a model, one for each rho.
class Lqg {
 public:
  /// @param model checked model
  explicit Lqg(const TuneModel& model);

  /// Feedback of u~ for var(y) + rho var(b0 u~).
  [[nodiscard]] DynamicMatrix<double> feedback(double rho) const;

  /// The controller, with its own u as the applied u.
  [[nodiscard]] LinearController controller(double rho) const;

 private:
  /// Phi of the plant without the disturbance.
  [[nodiscard]] DynamicMatrix<double> phi_block(int n) const;

  detail::SampledPlant plant_;
  double b0_;
  int order_;
  int whole_ = 0;
  bool fraction_ = false;
  DynamicMatrix<double> phi_, kalman_, a_, b_, rest_;
};

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/lqg.ipp>
#endif
