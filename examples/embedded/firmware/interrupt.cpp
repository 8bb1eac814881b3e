#include "interrupt.hpp"

#include <atomic>
#include <esokit/control/adrc.hpp>
#include <optional>

#include "board.hpp"
#include "double_buffer.hpp"
#include "output.hpp"
#include "servo.hpp"

namespace firmware {

namespace {

using Controller = esokit::Adrc<Linear::Observer>;

struct Command {
  float reference = 0.0f;  // rad
};
struct Report {
  float measurement = 0.0f;        // rad
  float total_disturbance = 0.0f;  // rad/s2
  esokit::StepStatus status = esokit::StepStatus::ok;
};

// Static, and set up by the compiler: no heap, no constructor that runs before main.
constinit std::optional<Controller> controller;
constinit DoubleBuffer<Command> command;
constinit DoubleBuffer<Report> report;
constinit std::atomic<int> steps{0};

// Stands for the converter and the output stage.
constinit Servo servo;
constinit float output = 0.0f;

/// The interrupt: measure, one step, put out, report.
void control_step() {
  servo.step(output, 20.0f);
  const float y = servo.measure();
  output = controller->update(y, command.read().reference);
  report.write({y, controller->observer().total_disturbance(), controller->status()});
  steps.store(steps.load(std::memory_order_relaxed) + 1, std::memory_order_release);
}

}  // namespace

bool run_from_interrupt() {
  const auto made = Controller::make({.observer = Linear::config(),
                                      .controller_bandwidth = controller_bandwidth,
                                      .limits = {.lower = -5.0f, .upper = 5.0f}});
  if (!made) return false;
  controller.emplace(*made);  // before the timer starts

  board::start_timer(control_step);
  bool commanded = false;
  for (int done = 0; done < 500;) {
    board::wait();
    done = steps.load(std::memory_order_acquire);
    if (done >= 100 && !commanded) {
      command.write({1.0f});
      commanded = true;
    }
  }
  board::stop_timer();

  const Report last = report.read();
  Line("interrupt").bits(last.measurement).bits(last.total_disturbance);
  return last.status == esokit::StepStatus::ok && last.measurement > 0.99f &&
         last.measurement < 1.01f;
}

}  // namespace firmware
