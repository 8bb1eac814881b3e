// A servo drive, complete: a controller in a timer interrupt, references in and reports out without
// locks. Yours to write are this file, drive_design.hpp and the functions of your board.

#include <esokit/core/snapshot.hpp>
#include <optional>

#include "board.hpp"
#include "board_drive.hpp"
#include "double_buffer.hpp"
#include "drive_design.hpp"
#include "pasted.hpp"

namespace {

using drive::Controller;
using firmware::DoubleBuffer;

// Static, and set up by the compiler: no heap, no constructor that runs before main.
constinit std::optional<Controller> controller;
constinit DoubleBuffer<float> reference;  // rad
constinit DoubleBuffer<drive::Report> report;

/// The timer interrupt, once a sample time.
void control_step() {
  const float angle = drive::read_angle();  // NaN where the sensor did not answer
  drive::write_voltage(controller->update(angle, reference.read()));
  report.write({angle, controller->observer().total_disturbance(), controller->mode()});
}

/// The design of the host, from words in flash; or designed here, which takes four times the flash.
auto design() {
#ifdef DRIVE_MAKE
  return Controller::make(drive::config());
#else
  return esokit::from_snapshot<Controller>(drive::words);
#endif
}

}  // namespace

/// Your main.
int run_firmware() {
  const auto made = design();
  if (!made) return 1;  // the words are of another version, or were changed
  controller.emplace(*made);
  board::start_timer(control_step);
  while (drive::wait_for_interrupt()) {
    if (const auto wanted = drive::received()) reference.write(*wanted);
    drive::send(report.read());
  }
  board::stop_timer();
  return 0;
}
