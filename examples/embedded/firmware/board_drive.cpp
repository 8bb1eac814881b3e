// A simulated servo for drive.cpp: half a second with a load, and a reference after a tenth of it.

#include "board_drive.hpp"

#include <atomic>

#include "board.hpp"
#include "output.hpp"
#include "servo.hpp"

namespace drive {

namespace {

constinit firmware::Servo servo;
constinit float voltage = 0.0f;
constinit std::atomic<int> steps{0};
constinit bool commanded = false;
constinit Report last;

}  // namespace

float read_angle() {
  servo.step(voltage, 20.0f);
  steps.store(steps.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  return servo.measure();
}

void write_voltage(float value) { voltage = value; }

std::optional<float> received() {
  if (commanded || steps.load(std::memory_order_acquire) < 100) return std::nullopt;
  commanded = true;
  return 1.0f;
}

void send(const Report& report) { last = report; }

bool wait_for_interrupt() {
  if (steps.load(std::memory_order_acquire) < 500) {
    board::wait();
    return true;
  }
  firmware::Line("interrupt").bits(last.angle).bits(last.total_disturbance);
  if (last.mode != esokit::LoopMode::running || !(last.angle > 0.99f && last.angle < 1.01f)) {
    board::finish(1);
  }
  firmware::Line("done");
  return false;
}

}  // namespace drive
