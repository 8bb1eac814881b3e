/// @file
/// The tracking differentiator as in the paper, as an ODE.
#pragma once

#include <cmath>
#include <esokit/eigen.hpp>

namespace paper4 {

/// r1' = r2, r2' = -R sign(r1 - r + r2 |r2| / (2R)). Sampled, its r2 would chatter by R times the
/// sample time; esokit::TrackingDifferentiator does not.
struct SignDifferentiator {
  double acceleration;  ///< R > 0, unit of the reference / s^2

  /// d/dt (r1, r2).
  [[nodiscard]] esokit::EigenMatrix<double, 2> rate(const esokit::EigenMatrix<double, 2>& state,
                                                    double reference) const {
    const double curve = state(0) - reference + state(1) * std::abs(state(1)) / (2 * acceleration);
    return {state(1), curve > 0 ? -acceleration : curve < 0 ? acceleration : 0.0};
  }
};

}  // namespace paper4
