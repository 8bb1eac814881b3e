/// @file
/// The observers that run here, with their settings, for a servo of two integrations.
///
/// symbol    code                  value   unit
/// T         sample_time           1e-3    s
/// b0        input_gain            50      rad/s2 per V
/// omega_o   observer_bandwidth    100     rad/s
/// omega_c   controller_bandwidth  25      rad/s
#pragma once

#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>

#include "updates.hpp"

namespace firmware {

inline constexpr float sample_time = 1e-3f;
inline constexpr float input_gain = 50.0f;
inline constexpr float observer_bandwidth = 100.0f;
inline constexpr float controller_bandwidth = 25.0f;
inline constexpr float noise = 1e-4f;  // rad, largest

struct Linear {
  using Observer = esokit::LinearEso<2, float>;
  static constexpr const char* name = "LinearEso";
  static constexpr Update* update = update_LinearEso;
  static Observer::Config config() {
    return {.observer_bandwidth = observer_bandwidth,
            .input_gain = input_gain,
            .sample_time = sample_time};
  }
};

struct Cascade {
  using Observer = esokit::CascadeEso<2, 3, float>;
  static constexpr const char* name = "CascadeEso";
  static constexpr Update* update = update_CascadeEso;
  static Observer::Config config() {
    return {.observer_bandwidth = observer_bandwidth / 2,
            .bandwidth_factor = 2.0f,
            .input_gain = input_gain,
            .sample_time = sample_time};
  }
};

struct Algebraic {
  using Observer = esokit::AlgebraicEso<2, float>;
  static constexpr const char* name = "AlgebraicEso";
  static constexpr Update* update = update_AlgebraicEso;
  static Observer::Config config() {
    return {.observer_bandwidth = observer_bandwidth,
            .frequency_shift = observer_bandwidth,
            .input_gain = input_gain,
            .sample_time = sample_time};
  }
};

struct AdjustableBandwidth {
  using Observer = esokit::AdjustableBandwidthEso<2, float>;
  static constexpr const char* name = "AdjustableBandwidthEso";
  static constexpr Update* update = update_AdjustableBandwidthEso;
  static Observer::Config config() {
    return {.observer_bandwidth = observer_bandwidth,
            .bandwidth_ratio = 0.5f,
            .input_gain = input_gain,
            .sample_time = sample_time};
  }
};

struct Nonlinear {
  using Observer = esokit::NonlinearEso<2, float>;
  static constexpr const char* name = "NonlinearEso";
  static constexpr Update* update = update_NonlinearEso;
  static Observer::Config config() {
    return {.observer_bandwidth = observer_bandwidth,
            .shape = {.gain_alpha = 0.6f, .alpha = 0.5f, .gain_beta = 0.4f, .beta = 1.0f},
            .error_scale = 0.01f,
            .input_gain = input_gain,
            .sample_time = sample_time};
  }
};

/// Extended state filter: the Riccati recursion at every sample.
struct RecursiveFilter {
  using Observer = esokit::ExtendedStateFilter<2, float>;
  static constexpr const char* name = "ExtendedStateFilter-recursive";
  static constexpr Update* update = update_ExtendedStateFilter;
  static Observer::Config config() {
    Observer::Config config{.input_gain = input_gain,
                            .sample_time = sample_time,
                            .measurement_variance = noise * noise,
                            .disturbance_bounds = {0.0f, 0.0f, 1.0f},
                            .inflation = 0.02f};
    config.initial_covariance = Observer::Covariance::Diagonal({1e-4f, 1.0f, 1e3f});
    return config;
  }
};

/// The same with the limit of its gain, found by `make`.
struct FrozenFilter {
  using Observer = RecursiveFilter::Observer;
  static constexpr const char* name = "ExtendedStateFilter-frozen";
  static constexpr Update* update = update_ExtendedStateFilter;
  static Observer::Config config() {
    auto config = RecursiveFilter::config();
    config.mode = esokit::RiccatiMode::frozen;
    return config;
  }
};

}  // namespace firmware
