/// @file
/// A PID as it runs in many machines, to compare with: what `tune_pids` tunes, as code.
#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit {

/// Settings of a PlainPid.
struct PlainPidConfig {
  [[no_unique_address]] ByName<PlainPidConfig> by_name{};  ///< nothing to set, see ByName
  double proportional = 0.0;                               ///< K_p, unit of u per unit of y
  double integral = 0.0;                                   ///< K_i, unit of K_p per s
  double derivative = 0.0;                                 ///< K_d, unit of K_p times s
  double derivative_filter = 0.0;  ///< T_f of a filter of first order on the derivative, s; 0: none
  double filter_frequency = 0.0;   ///< of a filter of second order on y, rad/s; 0: none
  double filter_damping = 0.707;   ///< of this filter
  double reference_weight = 1.0;  ///< b: the proportional part acts on b r - y, the derivative on y
  double tracking_time = 0.0;  ///< T_t of back-calculation, s; 0: the integral stops at the limits
  double lower = 0.0;          ///< limits of u
  double upper = 0.0;          ///< upper limit, above lower
  double sample_time = 0.0;    ///< T, s

  /// K_p / K_i, s; of no use without an integral.
  [[nodiscard]] double integral_time() const { return proportional / integral; }
  /// K_d / K_p, s.
  [[nodiscard]] double derivative_time() const { return derivative / proportional; }

  /// The filter on y: yf[k] + a_1 yf[k-1] + a_0 yf[k-2] = g y[k], the poles as sampled.
  struct Filter {
    double a1;  ///< of yf[k-1]
    double a0;  ///< of yf[k-2]
    double g;   ///< of y[k]
  };
  /// Its coefficients.
  [[nodiscard]] Filter filter() const;
  /// Share of the last value in the filtered derivative.
  [[nodiscard]] double derivative_memory() const {
    return derivative_filter > 0.0 ? std::exp(-sample_time / derivative_filter) : 0.0;
  }

  /// An error for a number that is not allowed.
  [[nodiscard]] Check<double> validate() const;
};

/// PID in backward differences on the filtered y: for a plant of order 2 it has the same poles and
/// zeros from y to u as an Adrc with LinearEso<2>.
class PlainPid {
 public:
  using Config = PlainPidConfig;  ///< what it is made from

  /// @return error for a number that is not allowed
  [[nodiscard]] static Expected<PlainPid, Error<double>> make(const Config& config);

  /// u for the measurement y and the reference, within the limits. A number that is not finite, or
  /// too large for the sums, changes nothing: u is kept. @param added to u, for a reference whose
  /// derivatives are known
  double update(double y, double reference, double added = 0.0) noexcept;

  /// From rest at y: goes on from u at this reference; what is not finite changes nothing.
  void start(double y, double reference, double u) noexcept;

 private:
  explicit PlainPid(const Config& config)
      : config_(config),
        filter_(config.filter()),
        memory_(config.derivative_memory()),
        output_(std::clamp(0.0, config.lower, config.upper)) {}

  Config config_;
  Config::Filter filter_;
  double memory_, output_, last_ = 0.0, before_ = 0.0, slope_ = 0.0, integral_ = 0.0;
  bool started_ = false;
};

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/plain_pid.ipp>
#endif
