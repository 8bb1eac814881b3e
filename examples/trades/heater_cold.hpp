// A heater from cold: it heats up, finds its gain, lag and dead time, and goes on as ADRC with both
// in the model, and with a fan that is measured. For one heater, 0 .. 1, and one sensor.
#pragma once

#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/observer/model_eso.hpp>
#include <optional>

namespace trades {

class ColdHeater {
  // Heat to temperature is one integration, and the sensor lags. The losses are found; those by the
  // fan are given. It acts at once, the heater after its dead time.
  using Slow = esokit::ModelEso<esokit::ModelParts{.order = 1, .sensor = 1}>;

 public:
  using Loop = esokit::Adrc<esokit::DelayedInput<esokit::Measured<Slow>, 100>>;
  using Trial = esokit::Experiment<1>;

  struct Config {
    Trial::Config trial{};   // how it heats up, and what it may do
    double speed = 0.5;      // omega_c times lag and dead time
    double observer = 8;     // omega_o over omega_c
    double fan_cooling = 0;  // 1/s: what the fan takes per second and degree above the room
    double room = 20;        // degC
  };

  static esokit::Expected<ColdHeater, esokit::Error<double>> make(const Config& config) {
    const auto trial = Trial::make(config.trial);
    if (!trial) return trial.error();
    if (!(config.trial.hand_over > 0)) {
      return esokit::Error<double>{"trial.hand_over", config.trial.hand_over,
                                   "must be positive: meanwhile the observer looks on"};
    }
    return ColdHeater(config, *trial);
  }

  /// Once a sample. @param fan 0 .. 1, NaN where it is not known @return power, 0 .. 1
  double step(double temperature, double wanted, double fan) {
    const double held = power_;
    if (!running()) {
      power_ = trial_.update(temperature, held);
      if (trial_.phase() == esokit::ExperimentPhase::hand_over) follow(temperature, held);
      if (!running()) return power_;
    }
    loop_->applied(held);
    loop_->measured(fan * (temperature - config_.room));
    return power_ = loop_->update(temperature, wanted);
  }

  /// Whether the loop controls. If it does not and the trial has finished, the power stays the safe
  /// one, and trial().reason() says why or, where that is none, refused().
  [[nodiscard]] bool running() const {
    return loop_ && trial_.phase() == esokit::ExperimentPhase::done;
  }
  [[nodiscard]] const std::optional<esokit::Error<double>>& refused() const { return refused_; }
  /// Samples in a row without the fan. It is held for 50, then counts as off.
  [[nodiscard]] int fan_lost() const { return loop_ ? loop_->observer().observer().lost() : 0; }

  /// degC/s: what acts on the temperature besides the heater.
  [[nodiscard]] double load() const { return loop_ ? loop_->observer().total_disturbance() : 0; }
  /// What the fan takes, 1/s, from the load without and with it at one temperature.
  [[nodiscard]] double cooling(double without, double with, double temperature) const {
    return (without - with) / (temperature - config_.room);
  }
  /// From now on the fan is known. Nothing jumps.
  esokit::Check<double> set_fan_cooling(double cooling) {
    config_.fan_cooling = cooling;
    return loop_ ? loop_->retune(settings()) : esokit::Check<double>{};
  }

  [[nodiscard]] const Trial& trial() const { return trial_; }
  /// s: the lag in what the trial found, by how much it attenuated the cycle.
  [[nodiscard]] double lag() const {
    const auto found = trial_.result().value();
    const double ratio = found.input_gain / found.least;
    return std::sqrt(std::fmax(ratio * ratio - 1, 0)) / found.frequency;
  }
  /// The loop for what the trial found.
  [[nodiscard]] Loop::Config settings() const {
    const auto found = trial_.result().value();
    const double T = config_.trial.sample_time, bandwidth = config_.speed / found.latency;
    esokit::MeasuredConfig<Slow, 1> observer{
        .observer = {.observer_bandwidth = config_.observer * bandwidth,
                     .input_gain = found.input_gain,
                     .sample_time = T,
                     .model = {.sensor = {.time_constant = std::fmax(lag(), T)}}},
        .inputs = {esokit::MeasuredInput<double>{.gain = -config_.fan_cooling}}};
    const double late = std::fmin((found.latency - lag()) / T, 100);
    return {.observer = {.observer = observer, .delay = static_cast<int>(std::lround(late))},
            .controller_bandwidth = bandwidth,
            .limits = config_.trial.limits,
            .missing = {.most = 30, .input = 0}};  // off, if the sensor stays away
  }

 private:
  ColdHeater(const Config& config, const Trial& trial) : config_(config), trial_(trial) {}

  // While the relay still moves the heater, the observer looks on.
  void follow(double temperature, double held) {
    if (loop_) {
      (void)loop_->track(temperature, temperature, held);
      return;
    }
    const auto found = trial_.result();
    const auto made = found ? Loop::make(settings())
                            : esokit::Expected<Loop, esokit::Error<double>>(found.error());
    if (made) {
      loop_ = *made;
      (void)loop_->start(temperature, held);
    } else {
      refused_ = made.error();
    }
  }

  Config config_;
  Trial trial_;
  std::optional<Loop> loop_{};
  std::optional<esokit::Error<double>> refused_{};
  double power_ = 0;
};

}  // namespace trades
