/// @file
/// A PID as it runs in many machines, to compare with: what `tune_rivals` tunes, as code.
#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/core/check.hpp>
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
  [[nodiscard]] Filter filter() const {
    if (!(filter_frequency > 0.0)) return {0.0, 0.0, 1.0};
    const double x = filter_frequency * sample_time, z = filter_damping;
    const double root = std::sqrt((std::abs)(1.0 - z * z)) * x, decay = std::exp(-z * x);
    const double sum =
        z < 1.0 ? 2.0 * decay * std::cos(root) : std::exp(root - z * x) + std::exp(-root - z * x);
    const double product = decay * decay;
    return {-sum, product, 1.0 - sum + product};
  }
  /// Share of the last value in the filtered derivative.
  [[nodiscard]] double derivative_memory() const {
    return derivative_filter > 0.0 ? std::exp(-sample_time / derivative_filter) : 0.0;
  }

  /// An error for a number that is not allowed.
  [[nodiscard]] Check<double> validate() const {
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
        .demand(!(tracking_time > 0.0 && tracking_time < sample_time), "tracking_time",
                tracking_time, "must be 0 or at least a sample");
    if (!rules) return rules.error();
    return {};
  }
};

/// PID in backward differences on the filtered y: for a plant of order 2 it has the same poles and
/// zeros from y to u as an Adrc with LinearEso<2>.
class PlainPid {
 public:
  using Config = PlainPidConfig;  ///< what it is made from

  /// @return error for a number that is not allowed
  [[nodiscard]] static Expected<PlainPid, Error<double>> make(const Config& config) {
    if (auto ok = config.validate(); !ok) return ok.error();
    return PlainPid(config);
  }

  /// u for the measurement y and the reference, within the limits. A number that is not finite, or
  /// too large for the sums, changes nothing: u is kept. @param added to u, for a reference whose
  /// derivatives are known
  double update(double y, double reference, double added = 0.0) noexcept {
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

  /// From rest at y: goes on from u at this reference; what is not finite changes nothing.
  void start(double y, double reference, double u) noexcept {
    const double integral = u - config_.proportional * (config_.reference_weight * reference - y);
    if (!(is_finite(y) && is_finite(u) && is_finite(integral))) return;
    last_ = before_ = y;
    slope_ = 0.0;
    integral_ = integral;
    output_ = std::clamp(u, config_.lower, config_.upper);
    started_ = true;
  }

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
