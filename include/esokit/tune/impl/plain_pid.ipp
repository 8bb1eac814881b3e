#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/tune/plain_pid.hpp>

namespace esokit {

ESOKIT_FUNCTION PlainPidConfig::Filter PlainPidConfig::filter() const {
  if (!(filter_frequency > 0.0)) return {0.0, 0.0, 1.0};
  const double x = filter_frequency * sample_time, z = filter_damping;
  const double root = std::sqrt((std::abs)(1.0 - z * z)) * x, decay = std::exp(-z * x);
  const double sum =
      z < 1.0 ? 2.0 * decay * std::cos(root) : std::exp(root - z * x) + std::exp(-root - z * x);
  const double product = decay * decay;
  return {-sum, product, 1.0 - sum + product};
}

ESOKIT_FUNCTION Check<double> PlainPidConfig::validate() const {
  Rules<double> rules;
  rules.demand(is_finite(proportional), "proportional", proportional, "must be finite")
      .demand(is_finite(integral), "integral", integral, "must be finite")
      .demand(is_finite(derivative), "derivative", derivative, "must be finite")
      .not_negative("derivative_filter", derivative_filter)
      .not_negative("filter_frequency", filter_frequency)
      .positive("filter_damping", filter_damping)
      .demand(is_finite(reference_weight), "reference_weight", reference_weight, "must be finite")
      .not_negative("tracking_time", tracking_time)
      .positive("sample_time", sample_time)
      .demand(lower < upper, "upper", upper, "must be above lower")
      .demand(!(tracking_time > 0.0 && tracking_time < sample_time), "tracking_time", tracking_time,
              "must be 0 or at least a sample");
  if (!rules) return rules.error();
  return {};
}

ESOKIT_FUNCTION Expected<PlainPid, Error<double>> PlainPid::make(const Config& config) {
  if (auto ok = config.validate(); !ok) return ok.error();
  return PlainPid(config);
}

ESOKIT_FUNCTION double PlainPid::update(double y, double reference, double added) noexcept {
  if (!(is_finite(y) && is_finite(reference) && is_finite(added))) return output_;
  if (!started_) start(y, reference, 0.0);
  const double filtered = filter_.g * y - filter_.a1 * last_ - filter_.a0 * before_;
  const double slope =
      memory_ * slope_ + (1.0 - memory_) * (filtered - last_) / config_.sample_time;
  const double step = config_.integral * config_.sample_time * (reference - filtered);
  const double wanted = config_.proportional * (config_.reference_weight * reference - filtered) -
                        config_.derivative * slope + integral_ + step + added;
  const double u = std::clamp(wanted, config_.lower, config_.upper);
  double integral = integral_;
  if (config_.tracking_time > 0.0) {
    integral += step + config_.sample_time / config_.tracking_time * (u - wanted);
  } else if (u == wanted || (wanted - u) * step < 0.0) {
    integral += step;
  }
  if (!(is_finite(slope) && is_finite(wanted) && is_finite(integral))) return output_;
  before_ = last_;
  last_ = filtered;
  slope_ = slope;
  integral_ = integral;
  return output_ = u;
}

ESOKIT_FUNCTION void PlainPid::start(double y, double reference, double u) noexcept {
  const double integral = u - config_.proportional * (config_.reference_weight * reference - y);
  if (!(is_finite(y) && is_finite(u) && is_finite(integral))) return;
  last_ = before_ = y;
  slope_ = 0.0;
  integral_ = integral;
  output_ = std::clamp(u, config_.lower, config_.upper);
  started_ = true;
}

}  // namespace esokit
