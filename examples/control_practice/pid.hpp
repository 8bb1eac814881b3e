/// @file
/// A PID controller as it stands in many machines: filtered derivative of the measurement,
/// anti-windup by back-calculation. The one that the examples compare with and wrap.
#pragma once

#include <algorithm>
#include <cmath>

namespace practice {

class Pid {
 public:
  struct Config {
    double proportional = 0, integral = 0, derivative = 0;
    double derivative_filter = 0;  ///< s
    double lower = 0, upper = 0;   ///< of u
    double sample_time = 0;        ///< s
  };

  explicit Pid(const Config& config) : config_(config) {}

  /// @param y NaN where missing: the last one is taken, as is usual
  double update(double y, double reference) {
    if (!std::isfinite(y)) y = last_;
    if (!started_) last_ = y;
    started_ = true;
    const double blend = config_.sample_time / (config_.derivative_filter + config_.sample_time);
    slope_ += blend * ((y - last_) / config_.sample_time - slope_);
    last_ = y;
    const double error = reference - y;
    const double wanted = config_.proportional * error + integral_ - config_.derivative * slope_;
    const double u = std::clamp(wanted, config_.lower, config_.upper);
    wanted_ = wanted;
    integral_ += config_.integral * config_.sample_time * error;
    applied(u);
    return u;
  }

  /// What was really applied of the last output: the integrator gives way.
  void applied(double u) {
    const double rate = config_.integral / config_.proportional * config_.sample_time;
    integral_ += 2 * rate * (u - wanted_);
    wanted_ = u;
  }

  /// Output goes on from u at the measurement y; the integrator makes it so.
  void start(double y, double reference, double u) {
    if (!started_) last_ = y;
    integral_ = u - config_.proportional * (reference - y) + config_.derivative * slope_;
    wanted_ = u;
    started_ = true;
  }

 private:
  Config config_;
  double integral_ = 0, slope_ = 0, last_ = 0, wanted_ = 0;
  bool started_ = false;
};

}  // namespace practice
