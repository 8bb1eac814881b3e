/// @file
/// Controllers whose whole step is measured: the law, its limits and the observer below it.
#pragma once

#include <esokit/control/adrc.hpp>
#include <esokit/control/mimo_adrc.hpp>

#include "designs.hpp"

namespace firmware {

extern "C" {
Update update_Adrc;
Update update_AdrcLimited;
Update update_MimoAdrc;
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

}  // namespace firmware
