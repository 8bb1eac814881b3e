/// @file
/// What drive.cpp wants of its board beside the timer. board_drive.cpp has a simulated servo for
/// it; on your board these are the converter or encoder, the output stage and the bus.
#pragma once

#include <esokit/control/control_loop.hpp>
#include <optional>

namespace drive {

struct Report {
  float angle = 0.0f;              // rad
  float total_disturbance = 0.0f;  // rad/s2
  esokit::LoopMode mode = esokit::LoopMode::running;
};

float read_angle();               ///< rad
void write_voltage(float value);  ///< V
std::optional<float> received();  ///< a new reference, rad
void send(const Report& report);
bool wait_for_interrupt();  ///< false: the program is to end, which yours is not

}  // namespace drive
