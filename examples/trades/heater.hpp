// A heater with a slow sensor, 0 .. 100 %: the whole of a temperature loop.
//
// temperature, wanted  degC       power  %, 0 .. 100
#pragma once

#include <esokit/control/adrc.hpp>
#include <esokit/observer/model_eso.hpp>

namespace trades {

class Heater {
  // Heat to temperature is one integration; the sensor follows the heater by a lag of its own,
  // which is known and so no disturbance. Losses to the room are one, and are found.
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

  /// Once a sample. @param temperature NaN where there is none @return power
  double step(double temperature, double wanted) { return loop_.update(temperature, wanted); }

  /// Before the first step: what the sensor shows, and the power that runs.
  void start(double temperature, double power) {
    (void)loop_.track(temperature, temperature, power);
  }

 private:
  explicit Heater(const Loop& loop) : loop_(loop) {}
  Loop loop_;
};

}  // namespace trades
