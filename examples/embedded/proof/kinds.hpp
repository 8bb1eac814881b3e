// What the programs that write the kinds for prove.sh have in common: the configs, and the files
// NAME.[hc] in a folder NAME of the folder that is given. For each they print NAME, what it is, and
// between which limits u has to stay.
#pragma once

#include <cstdio>
#include <esokit/control/limiter.hpp>
#include <esokit/target/c_code.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <type_traits>
#include <utility>

namespace proof_kinds {

using namespace esokit;

inline std::string folder;
inline bool all_written = true;

inline void refused(const std::string& name, const auto& error) {
  std::fprintf(stderr, "%s: %s %s\n", name.c_str(), error.field, error.rule);
  all_written = false;
}

/// @param limits of u, or "- -"
inline void write_files(const std::string& name, const std::string& title,
                        const std::string& limits, const CCode& code) {
  const std::string at = folder + "/" + name;
  std::filesystem::create_directories(at);
  std::ofstream(at + "/" + name + ".h") << code.header;
  std::ofstream(at + "/" + name + ".c") << code.source;
  std::printf("%s\t%s\t%s\n", name.c_str(), title.c_str(), limits.c_str());
}

template <class Made, class... As>
void write_as(const std::string& name, const std::string& title, const std::string& limits,
              CodeOptions options, const Made& made, const As&... as) {
  options.name = name;
  if (!made) return refused(name, made.error());
  const auto code = to_c(*made, as..., options);
  if (!code) return refused(name, code.error());
  write_files(name, title, limits, *code);
}

inline constexpr const char* no_limits = "-\t-";

template <class V>
Limits<V> limits_of_u() {
  return {.lower = V(-2), .upper = V(7)};
}

template <class Observer>
auto observer_of() {
  using V = typename Observer::scalar_type;
  typename Observer::Config config{};
  if constexpr (requires { config.observer; }) {
    config.observer = observer_of<typename Observer::Adapted>();
    if constexpr (requires { config.delay; }) config.delay = 4;
    if constexpr (requires { config.threshold; }) config.threshold = V(0.05);
    if constexpr (requires { config.period; }) config.period = V(6.2831853);
    if constexpr (requires { config.inputs; }) config.inputs[0] = {V(-3), V(0.003), V(0.002)};
    if constexpr (requires { config.curve; }) {
      config.curve = decltype(config.curve)::dead_zone(V(0.5), V(0.25));
    }
  } else {
    if constexpr (requires { config.observer_bandwidth; }) {
      config.observer_bandwidth = V(100);
    } else {
      config.measurement_variance = V(1e-6);
      config.disturbance_bounds[Observer::size - 1] = V(0.5);
      config.inflation = V(0.02);
    }
    if constexpr (requires { config.frequency_shift; }) config.frequency_shift = V(20);
    config.input_gain = V(50);
    config.sample_time = V(1e-3);
    config.max_gap = 3;
    if constexpr (requires { config.shape.gain_alpha; }) {
      config.shape.gain_alpha = V(0.6);
      config.shape.alpha = V(0.75);
      config.shape.gain_beta = V(0.25);
      config.shape.beta = V(0.5);
    }
    if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = V(1.5);
    if constexpr (requires { config.model.actuator.time_constant; }) {
      config.model.actuator.time_constant = V(0.01);
    }
    if constexpr (requires { decltype(config.model.plant)::chain; }) {
      using Plant = decltype(config.model.plant);
      config.model.plant =
          Plant::chain({.coefficients = {V(0.5), V(0.5)}, .input_gain = V(50)}).value();
    }
    if constexpr (requires { config.model.resonators; }) {
      for (auto& resonance : config.model.resonators) resonance.frequency = V(25);
    }
  }
  return config;
}

template <class C>
typename C::Config config_of() {
  using V = typename C::scalar_type;
  typename C::Config config{};
  config.observer = observer_of<std::remove_cvref_t<decltype(std::declval<C&>().observer())>>();
  if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth = V(15);
  config.limits = limits_of_u<V>();
  return config;
}

template <class C, class Change = void (*)(typename C::Config&)>
void write_controller(
    const std::string& name, const std::string& title, CodeOptions options = {},
    Change change = [](typename C::Config&) {}) {
  auto config = config_of<C>();
  change(config);
  write_as(name, title, "-2\t7", options, C::make(config));
}

template <class Observer>
void write_observer(const std::string& name, const std::string& title) {
  write_as(name, title, no_limits, {}, Observer::make(observer_of<Observer>()));
}

}  // namespace proof_kinds
