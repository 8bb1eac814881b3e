// ADRC on a flight controller: one axis of the rate loop of a multirotor, complete: motor lag, gyro
// filter, thrust over throttle, mixer, arming. Everything that you write is in this file.
//
// y  rate of the filtered gyro, rad/s       u  moment wanted from the mixer, -1 .. 1
// b0 (rad/s^2) per u at hover: from a log (from_log), or step u by 0.1 and read the slope
#pragma once

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/health.hpp>
#include <esokit/core/check.hpp>
#include <esokit/observer/model_eso.hpp>

namespace guards {

/// One axis. Call `rate` once a gyro sample, armed or not.
/// @tparam MostDelay samples that the gyro's filters may take: 64 are 8 ms at 8 kHz
template <int MostDelay>
class RateAxisOf {
  // The motor's lag is in the model: the guards hold and bound the disturbance, not what the motor
  // does. The gyro's filters take some samples: u is given to the observer that much later.
  using Lagging = esokit::ModelEso<esokit::ModelParts{.order = 1, .actuator = 1}, float>;
  using Loop = esokit::Adrc<esokit::Guarded<esokit::DelayedInput<Lagging, MostDelay>>>;
  using Monitor = esokit::HealthMonitor<2, float>;

 public:
  struct Config {
    float sample_time = 1e-3f;    // s
    float hover_gain = 600;       // b0 at hover throttle, rad/s^2
    float hover_throttle = 0.4f;  // 0 .. 1
    float motor_lag = 0.02f;      // s
    float gyro_delay = 2e-3f;     // s, of all filters at low frequencies; at most MostDelay samples
    float controller_bandwidth = 75;  // rad/s: how fast the rate follows and a disturbance goes
    float most_disturbance = 0.6f;    // share of u that a disturbance may be given
  };

  static esokit::Expected<RateAxisOf, esokit::Error<float>> make(const Config& config) {
    // Within the two limits the modulus margin is 0.45 and more, with a motor 30 % faster or
    // slower.
    const float by_motor = 2.5f / config.motor_lag;
    const float by_gyro = 0.4f / (config.gyro_delay + config.sample_time);
    esokit::Rules<float> rules;
    rules.positive("sample_time", config.sample_time)
        .positive("motor_lag", config.motor_lag)
        .not_negative("gyro_delay", config.gyro_delay)
        .positive("controller_bandwidth", config.controller_bandwidth)
        .demand(
            config.gyro_delay <= MostDelay * config.sample_time,
            {"gyro_delay", config.gyro_delay, "must be at most MostDelay sample times, which is",
             -1, MostDelay * config.sample_time, true})
        .demand(config.controller_bandwidth <= by_motor,
                {"controller_bandwidth", config.controller_bandwidth,
                 "must be at most 2.5 / motor_lag, which is", -1, by_motor, true})
        .demand(config.controller_bandwidth <= by_gyro,
                {"controller_bandwidth", config.controller_bandwidth,
                 "must be at most 0.4 / (gyro_delay + sample_time), which is", -1, by_gyro, true});
    if (!rules) return rules.error();
    const float observer_bandwidth = 2 * config.controller_bandwidth;
    typename Loop::Config loop;
    loop.observer.observer.observer = {.observer_bandwidth = observer_bandwidth,
                                       .input_gain = config.hover_gain,
                                       .sample_time = config.sample_time,
                                       .model = {.actuator = {config.motor_lag}}};
    loop.observer.observer.delay = static_cast<int>(config.gyro_delay / config.sample_time + 0.5f);
    loop.observer.disturbance_bound = config.most_disturbance;
    loop.observer.unit = esokit::DisturbanceUnit::input;
    // Until the motor has forgotten what the mixer made of u.
    loop.observer.release_samples = static_cast<int>(3 * config.motor_lag / config.sample_time);
    loop.controller_bandwidth = config.controller_bandwidth;
    loop.limits = {.lower = -1, .upper = 1};
    const auto made = Loop::make(loop);
    if (!made) return made.error();
    const auto monitor = Monitor::make({.observer_bandwidth = observer_bandwidth,
                                        .sample_time = config.sample_time,
                                        .input_range = 1});
    if (!monitor) return monitor.error();
    return RateAxisOf(config, *made, *monitor);
  }

  /// @param flying armed, and thrust beyond what lifts off @param mixer_at_limit of the last sample
  /// @return u, -1 .. 1
  float rate(float gyro, float wanted, float throttle, bool flying, bool mixer_at_limit) {
    // More thrust, more moment: b0 goes with the throttle, and never below a fifth of hover's.
    const float share = throttle / config_.hover_throttle;
    (void)loop_.set_input_gain(config_.hover_gain * (share > 0.2f ? share : 0.2f));
    if (!flying) {
      // On the ground the axis cannot turn, and that is no disturbance. The reference begins at y.
      reference_ = gyro;
      return loop_.hold(gyro, gyro, 0);
    }
    loop_.observer().set_pin(mixer_at_limit ? esokit::Pin::either : esokit::Pin::free);
    // The motors cannot follow a step: the reference takes their lag, too.
    reference_ += config_.sample_time / config_.motor_lag * (wanted - reference_);
    const float u = loop_.update(gyro, reference_);
    monitor_.look(loop_);
    return u;
  }

  /// Before each arming, and once a second in the air: wrong_sign is a reason to disarm.
  [[nodiscard]] esokit::LoopFault fault() const { return esokit::diagnose(monitor_.health()); }
  /// What the observer makes of everything that is not the motors, rad/s^2.
  [[nodiscard]] float disturbance() const { return disturbance_parts(loop_).constant; }
  /// For the blackbox: esokit::telemetry(axis.loop(), t, gyro, wanted); as text: health_text.hpp.
  [[nodiscard]] const Loop& loop() const { return loop_; }

 private:
  RateAxisOf(const Config& config, const Loop& loop, const Monitor& monitor)
      : config_(config), loop_(loop), monitor_(monitor) {}

  Config config_;
  Loop loop_;
  Monitor monitor_;
  float reference_ = 0;
};
using RateAxis = RateAxisOf<64>;

}  // namespace guards
