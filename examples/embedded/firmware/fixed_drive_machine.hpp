/// @file
/// The machine of fixed_drive.cpp: a winding of 2 mH and 0.5 ohm, a rotor with friction, an encoder
/// and a converter. In float, 125 us at a time.
#pragma once

#include <cstdint>

namespace firmware {

class Machine {
 public:
  /// @param duty counts of the timer, 1200 for 24 V
  void step(std::int32_t duty) {
    constexpr float time = 1.25e-4f;
    const float voltage = static_cast<float>(duty) * (24.0f / 1200.0f);
    current_ += time * (500.0f * voltage - 250.0f * current_ - 8.0f * speed_);
    speed_ += time * (300.0f * current_ - 4.0f * speed_ - load_);
    counts_ += time * speed_ * (4096.0f / 6.2831853f);
    const auto whole = static_cast<std::int32_t>(counts_);
    counts_ -= static_cast<float>(whole);  // what is less than a count
    counter_ = static_cast<std::uint16_t>(counter_ + static_cast<std::uint32_t>(whole));
  }
  void load(float value) { load_ = value; }  ///< rad/s2
  void turn(std::uint16_t to) { counter_ = to; }

  [[nodiscard]] std::uint16_t counter() const { return counter_; }
  /// Counts of the converter, 2048 for 10 A.
  [[nodiscard]] std::int32_t current() const {
    const auto counts = static_cast<std::int32_t>(current_ * (2048.0f / 10.0f));
    return counts > 2047 ? 2047 : counts < -2047 ? -2047 : counts;
  }

 private:
  float current_ = 0;
  float speed_ = 0;
  float load_ = 0;
  float counts_ = 0;
  std::uint16_t counter_ = 0;
};

}  // namespace firmware
