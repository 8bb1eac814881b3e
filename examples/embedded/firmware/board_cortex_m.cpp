// Start-up, semihosting and SysTick of a Cortex-M, nothing of a vendor in it.

#include <cstdint>
#include <cstdlib>

#include "board.hpp"

extern "C" {
// Set by the linker script.
extern std::uint32_t data_load, data_begin, data_end, bss_begin, bss_end, stack_top;
void reset_handler();
void fault_handler();
void systick_handler();
}

namespace {

volatile std::uint32_t& device(std::uintptr_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}
constexpr std::uintptr_t systick_control = 0xE000E010;
constexpr std::uintptr_t systick_reload = 0xE000E014;
constexpr std::uintptr_t systick_value = 0xE000E018;
#if defined(__ARM_FP)
constexpr std::uintptr_t coprocessor_access = 0xE000ED88;
#endif

constexpr std::uint32_t run = 5;            // core clock, no interrupt
constexpr std::uint32_t run_interrupt = 7;  // the same with the interrupt

void (*timer_handler)();

/// The emulator (or a debugger) carries it out.
std::uintptr_t semihosting(std::uintptr_t operation, std::uintptr_t argument) {
  register std::uintptr_t r0 asm("r0") = operation;
  register std::uintptr_t r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

[[gnu::section(".vectors"), gnu::used]] const std::uintptr_t vectors[16] = {
    reinterpret_cast<std::uintptr_t>(&stack_top),
    reinterpret_cast<std::uintptr_t>(&reset_handler),
    reinterpret_cast<std::uintptr_t>(&fault_handler),  // NMI
    reinterpret_cast<std::uintptr_t>(&fault_handler),  // hard fault
    reinterpret_cast<std::uintptr_t>(&fault_handler),
    reinterpret_cast<std::uintptr_t>(&fault_handler),
    reinterpret_cast<std::uintptr_t>(&fault_handler),
    0,
    0,
    0,
    0,
    reinterpret_cast<std::uintptr_t>(&fault_handler),  // supervisor call
    0,
    0,
    reinterpret_cast<std::uintptr_t>(&fault_handler),
    reinterpret_cast<std::uintptr_t>(&systick_handler),
};

}  // namespace

asm(".section .text.update_known, \"ax\"\n"
    ".balign 4\n"
    ".syntax unified\n"
    ".thumb\n"
    ".thumb_func\n"
    ".globl update_known\n"
    ".type update_known, %function\n"
    "update_known:\n"
    "movs r0, #128\n"
    "1:\n"
    ".rept 6\n nop\n .endr\n"
    "subs r0, #1\n"
    "bne 1b\n"
    "movs r0, #0\n"
    "bx lr\n"
    ".previous\n");

extern "C" {

void reset_handler() {
#if defined(__ARM_FP)
  device(coprocessor_access) = device(coprocessor_access) | (0xFu << 20u);
  asm volatile("dsb\n isb" ::: "memory");
#endif
  for (std::uint32_t *to = &data_begin, *from = &data_load; to != &data_end;) *to++ = *from++;
  for (std::uint32_t* to = &bss_begin; to != &bss_end;) *to++ = 0;
  // No constructors are called: run.sh checks that there are none.
  device(systick_reload) = board::counter_modulus - 1;
  device(systick_value) = 0;
  device(systick_control) = run;
  board::finish(run_firmware());
}

void fault_handler() {
  board::write("fault\n");
  board::finish(3);
}

void systick_handler() {
  if (timer_handler != nullptr) timer_handler();
}

}  // extern "C"

// esokit::Expected ends a wrong program with abort(); newlib's raises a signal, and with signals
// comes the heap. Firmware stops in its own way.
extern "C" void abort() {
  board::write("abort\n");
  board::finish(2);
}

namespace board {

void write(const char* text) { semihosting(0x04, reinterpret_cast<std::uintptr_t>(text)); }

void finish(int status) {
  // The plain exit of a 32-bit target knows success and failure only.
  semihosting(0x18, status == 0 ? 0x20026 : 0x20024);
  for (;;) {
  }
}

void start_timer(void (*handler)()) {
  timer_handler = handler;
  device(systick_reload) = (1u << 19u) - 1;
  device(systick_value) = 0;
  device(systick_control) = run_interrupt;
}

void stop_timer() {
  device(systick_control) = run;
  device(systick_reload) = counter_modulus - 1;
  device(systick_value) = 0;
  timer_handler = nullptr;
}

void wait() { asm volatile("wfi" ::: "memory"); }

std::uint32_t counter() { return counter_modulus - 1 - device(systick_value); }

bool counts() { return true; }

}  // namespace board
