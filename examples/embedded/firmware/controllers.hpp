/// @file
/// Controllers whose whole step is measured: the law, its limits and the observer below it. And
/// observers that know more of their plant than its order, alone.
#pragma once

#include <esokit/control/adrc.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/model_eso.hpp>

#include "designs.hpp"

namespace firmware {

extern "C" {
Update update_Adrc;
Update update_AdrcLimited;
Update update_MimoAdrc;
Update update_MotorLag1;
Update update_MotorLag2;
Update update_SensorLag1;
Update update_SensorLag2;
Update update_Resonator;
}

/// One loop as most have it.
struct Single {
  using Controller = esokit::Adrc<Linear::Observer>;
  static constexpr const char* name = "Adrc";
  static constexpr Update* update = update_Adrc;
  static auto make() {
    return Controller::make({.observer = Linear::config(),
                             .controller_bandwidth = controller_bandwidth,
                             .limits = {.lower = -5.0f, .upper = 5.0f}});
  }
};

/// The same with a limit of the rate of u, too.
struct Limited {
  using Controller = Single::Controller;
  static constexpr const char* name = "AdrcLimited";
  static constexpr Update* update = update_AdrcLimited;
  static auto make() {
    return Controller::make({.observer = Linear::config(),
                             .controller_bandwidth = controller_bandwidth,
                             .limits = {.lower = -5.0f, .upper = 5.0f, .rate = 2000.0f}});
  }
};

/// Two coupled channels.
struct Double {
  using Controller = esokit::MimoAdrc<Linear::Observer, Linear::Observer>;
  static constexpr const char* name = "MimoAdrc";
  static constexpr Update* update = update_MimoAdrc;
  static auto make() {
    Controller::Config config{
        .controller_bandwidths = {controller_bandwidth, controller_bandwidth}};
    std::get<0>(config.observers) = {.observer_bandwidth = observer_bandwidth,
                                     .sample_time = sample_time};
    std::get<1>(config.observers) = std::get<0>(config.observers);
    config.input_matrix = {{input_gain, 0.2f * input_gain}, {0.1f * input_gain, input_gain}};
    for (auto& limits : config.limits) limits = {.lower = -5.0f, .upper = 5.0f};
    return Controller::make(config);
  }
};

/// `LinearEso` with a model of these parts.
template <esokit::ModelParts parts>
struct Modelled {
  using Observer = esokit::ModelEso<parts, float>;
  static auto make() {
    typename Observer::Config config{.observer_bandwidth = observer_bandwidth,
                                     .input_gain = input_gain,
                                     .sample_time = sample_time};
    if constexpr (parts.actuator > 0) config.model.actuator.time_constant = 0.02f;
    if constexpr (parts.sensor > 0) config.model.sensor.time_constant = 0.005f;
    if constexpr (parts.resonators > 0) config.model.resonators[0].frequency = 50.0f;
    return Observer::make(config);
  }
};
struct MotorLag1 : Modelled<{.order = 1, .actuator = 1}> {
  static constexpr const char* name = "MotorLag1";
  static constexpr Update* update = update_MotorLag1;
};
struct MotorLag2 : Modelled<{.order = 2, .actuator = 1}> {
  static constexpr const char* name = "MotorLag2";
  static constexpr Update* update = update_MotorLag2;
};
struct SensorLag1 : Modelled<{.order = 1, .sensor = 1}> {
  static constexpr const char* name = "SensorLag1";
  static constexpr Update* update = update_SensorLag1;
};
struct SensorLag2 : Modelled<{.order = 2, .sensor = 1}> {
  static constexpr const char* name = "SensorLag2";
  static constexpr Update* update = update_SensorLag2;
};
struct Resonator : Modelled<{.order = 2, .resonators = 1}> {
  static constexpr const char* name = "Resonator";
  static constexpr Update* update = update_Resonator;
};

}  // namespace firmware
