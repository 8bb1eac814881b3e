/// @file
/// Settings of RiccatiGain.
#pragma once

#include <esokit/gain/detail/covariance_factor.hpp>

namespace esokit {

/// How the inflation theta is chosen.
enum class InflationRule : unsigned char {
  fixed,     ///< theta > 0 as given
  adaptive,  ///< at every sample the theta that minimises the weighted trace of the bound
  none,      ///< the plain Kalman filter
};

/// How the gain is obtained.
enum class RiccatiMode : unsigned char {
  recursive,  ///< by the recursion, at every sample
  frozen,     ///< its limit, computed in make; after missing samples the recursion runs until it is
              ///< back
  start_table,  ///< the first gains, from P0, from a table made in make; then the limit
};

/// Settings of RiccatiGain. All covariances are in the scaling of the model's states and divided by
/// `unit`.
template <int Size, Scalar S>
struct RiccatiSettings {
  CovarianceFactor<Size, S> start{};          ///< P0, of the first prediction
  CovarianceFactor<Size, S> noise{};          ///< Q
  S measurement{};                            ///< R
  S unit{1.0};                                ///< unit of all variances, in unit of y squared
  InflationRule rule = InflationRule::fixed;  ///< how theta is chosen
  S inflation{};                              ///< theta of the fixed rule
  Array<S, Size> trace_weights{};             ///< W of the adaptive rule
  RiccatiMode mode = RiccatiMode::recursive;  ///< how the gain is obtained
};

}  // namespace esokit
