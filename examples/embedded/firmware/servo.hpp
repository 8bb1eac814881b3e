/// @file
/// The simulated plant and its sensor: y'' = a u - c y' - load, with noise on y that is the same on
/// every machine.
#pragma once

#include <cstdint>

#include "designs.hpp"

namespace firmware {

class Servo {
 public:
  /// One sample time under u (V). @param load rad/s2
  void step(float u, float load) {
    constexpr float gain = 60.0f;     // a, rad/s2 per V; the observers believe 50
    constexpr float friction = 3.0f;  // c, 1/s
    const float acceleration = gain * u - friction * velocity_ - load;
    position_ = position_ + sample_time * (velocity_ + (0.5f * sample_time) * acceleration);
    velocity_ = velocity_ + sample_time * acceleration;
  }

  [[nodiscard]] float position() const { return position_; }

  /// Position with the sensor's noise, rad.
  float measure() {
    state_ = state_ * 1664525u + 1013904223u;
    const float unit = static_cast<float>(static_cast<std::int32_t>(state_ >> 8u) - (1 << 23)) /
                       static_cast<float>(1 << 23);
    return position_ + noise * unit;
  }

 private:
  float position_ = 0.0f;
  float velocity_ = 0.0f;
  std::uint32_t state_ = 1;
};

}  // namespace firmware
