// A drive without floating point: a position controller at 1 kHz and a current controller at 8 kHz,
// both in integers. The encoder is a counter of 16 bits that wraps, the current comes in 12 bits,
// the output is the duty cycle in counts of the timer. The machine beside it is simulated, in
// float: on your board it is what it is.
//
//   at MILLISECOND counter current duty
//   fixed_drive largest error in counts after the moves
//   done

#include <current.h>
#include <position.h>

#include "board.hpp"
#include "fixed_drive_machine.hpp"
#include "output.hpp"

namespace {

position_state position;
current_state current;
std::int32_t wanted_current;  // counts

/// Each 125 us.
std::int32_t current_step(std::int32_t amperes) {
  return current_update(&current, amperes, wanted_current);
}
/// Each 1 ms, before the current.
void position_step(std::uint16_t counter, std::uint16_t reference) {
  wanted_current = position_update(&position, counter, reference);
}

}  // namespace

int run_firmware() {
  firmware::Machine machine;
  machine.turn(65000);  // soon to wrap
  position_init(&position);
  current_init(&current);
  if (position_start(&position, machine.counter(), 0) != 0) return 1;
  if (current_start(&current, machine.current(), 0) != 0) return 1;
  std::uint16_t reference = machine.counter();
  std::uint32_t largest = 0;
  unsigned bad = 0;
  for (int ms = 0; ms < 3000; ++ms) {
    // A turn up, across the wrap, and back; a load comes and goes.
    if (100 <= ms && ms < 612) reference = static_cast<std::uint16_t>(reference + 8);
    if (1500 <= ms && ms < 2012) reference = static_cast<std::uint16_t>(reference - 8);
    machine.load(ms >= 1000 && ms < 2500 ? 300.0f : 0.0f);
    position_step(machine.counter(), reference);
    bad |= position.status;
    std::int32_t duty = 0;
    for (int k = 0; k < 8; ++k) {
      duty = current_step(machine.current());
      bad |= current.status;
      machine.step(duty);
    }
    const auto off =
        static_cast<std::int32_t>(
            static_cast<std::uint32_t>(static_cast<std::uint16_t>(machine.counter() - reference)) ^
            0x8000u) -
        0x8000;
    const bool settled = (ms > 900 && ms < 1000) || (ms > 1300 && ms < 1500) || ms > 2800;
    const auto size = static_cast<std::uint32_t>(off < 0 ? -off : off);
    if (settled && size > largest) largest = size;
    if (ms % 100 == 99) {
      firmware::Line("at")
          .number(static_cast<std::uint32_t>(ms + 1))
          .number(machine.counter())
          .number(static_cast<std::uint32_t>(machine.current() + 2048))
          .number(static_cast<std::uint32_t>(duty + 1200));
    }
  }
  firmware::Line("fixed_drive").number(largest);
  if (bad == 0 && largest <= 2) firmware::Line("done");
  return bad == 0 && largest <= 2 ? 0 : 1;
}
