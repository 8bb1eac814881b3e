// A heater with a slow sensor, 0 .. 100 %: the whole of a temperature loop, with manual operation,
// new settings while it runs, an alarm and a log that from_log reads.
//
// temperature, wanted  degC       power  %, 0 .. 100
#pragma once

#include <esokit/analysis/health_text.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/model_eso.hpp>
#include <ostream>

namespace trades {

class Heater {
  // Heat to temperature is one integration. The sensor's lag is known, so it is no disturbance. The
  // losses to the room are one: the observer finds them.
  using Observer = esokit::ModelEso<esokit::ModelParts{.order = 1, .sensor = 1}>;
  using Loop = esokit::Adrc<Observer>;

 public:
  struct Config {
    double heating = 0.0032;     // degC/s per %: the slope after a step of the power, over the step
    double sensor_lag = 16;      // s
    double settling_time = 150;  // s; not much below 5 sensor lags
    double sample_time = 1;      // s
  };

  static esokit::Expected<Heater, esokit::Error<double>> make(const Config& config) {
    const double bandwidth = 4 / config.settling_time;  // order 1
    const auto loop =
        Loop::make({.observer = {.observer_bandwidth = 4 * bandwidth,
                                 .input_gain = config.heating,
                                 .sample_time = config.sample_time,
                                 .model = {.sensor = {.time_constant = config.sensor_lag}}},
                    .controller_bandwidth = bandwidth,
                    .limits = {.lower = 0, .upper = 100},
                    .missing = {.most = 30, .input = 0}});  // off, if the sensor stays away
    if (!loop) return loop.error();
    return Heater(*loop);
  }

  /// Once a sample, in automatic. @param temperature NaN where there is none @return power
  double step(double temperature, double wanted) {
    const double power = loop_.update(temperature, wanted);
    log(temperature, wanted);
    return power;
  }

  /// The power that really went out since `step`, where it is not what that returned.
  void applied(double power) { (void)loop_.applied(power); }

  /// Once a sample while someone else sets the power, and before the first `step`: from there the
  /// loop takes over without a jump.
  void manual(double temperature, double power) {
    // Before the first sample the observer believes in 0 degC.
    if (started_) {
      (void)loop_.track(temperature, temperature, power);
    } else {
      started_ = loop_.start(temperature, power) == esokit::StepStatus::ok;
    }
    log(temperature, temperature);
  }

  /// No measurement for 30 samples: the heater is off.
  [[nodiscard]] bool sensor_lost() const { return loop_.mode() == esokit::LoopMode::safe; }

  /// Other settings while it runs. If they are refused, nothing changes.
  esokit::Expected<void, esokit::Error<double>> set(const Config& config) {
    const auto fresh = make(config);
    if (!fresh) return fresh.error();
    return loop_.adopt(fresh->loop_);
  }

  /// From now on each sample writes a row there, until null is given.
  void log_to(std::ostream* log) {
    log_ = log;
    if (log_) esokit::write_header<Observer::size>(*log_);
  }

 private:
  explicit Heater(const Loop& loop) : loop_(loop) {}

  void log(double temperature, double wanted) {
    if (log_) esokit::write_row(*log_, esokit::telemetry(loop_, time_, temperature, wanted));
    time_ += loop_.observer().sample_time();
  }

  Loop loop_;
  std::ostream* log_ = nullptr;
  double time_ = 0;
  bool started_ = false;
};

}  // namespace trades
