// Start-up, semihosting and timer of a RISC-V hart in machine mode.

#include <cstdint>
#include <cstdlib>

#include "board.hpp"

extern "C" {
// Set by the linker script.
extern std::uint32_t data_load, data_begin, data_end, bss_begin, bss_end;
void reset_handler();
void trap_handler();
}

namespace {

constexpr std::uintptr_t timer_compare = 0x02004000;  // of the machine timer on QEMU's virt board
constexpr std::uintptr_t timer_value = 0x0200BFF8;
constexpr std::uint64_t timer_period = 10000;  // 1 ms

volatile std::uint32_t& device(std::uintptr_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}

void (*timer_handler)();

void next_interrupt() {
  const std::uint64_t now = device(timer_value) | (std::uint64_t{device(timer_value + 4)} << 32u);
  const std::uint64_t then = now + timer_period;
  device(timer_compare + 4) = 0xFFFFFFFFu;  // none while the two halves disagree
  device(timer_compare) = static_cast<std::uint32_t>(then);
  device(timer_compare + 4) = static_cast<std::uint32_t>(then >> 32u);
}

/// The emulator (or a debugger) carries it out; it knows the call by the three instructions.
[[gnu::noinline]] std::uintptr_t semihosting(std::uintptr_t operation, std::uintptr_t argument) {
  register std::uintptr_t a0 asm("a0") = operation;
  register std::uintptr_t a1 asm("a1") = argument;
  asm volatile(
      ".option push\n"
      ".option norvc\n"
      ".balign 16\n"
      "slli zero, zero, 0x1f\n"
      "ebreak\n"
      "srai zero, zero, 7\n"
      ".option pop\n"
      : "+r"(a0)
      : "r"(a1)
      : "memory");
  return a0;
}

}  // namespace

// The first instruction of the image: stack, floating-point unit on, then C++.
asm(".section .vectors, \"ax\"\n"
    ".globl start\n"
    "start:\n"
    ".option push\n"
    ".option norelax\n"
    "la gp, __global_pointer$\n"
    ".option pop\n"
    "la sp, stack_top\n"
    "li t0, 0x2000\n"
    "csrs mstatus, t0\n"
    "csrwi fcsr, 0\n"
    "la t0, trap_handler\n"
    "csrw mtvec, t0\n"
    "j reset_handler\n"
    ".previous\n");

asm(".section .text.update_known, \"ax\"\n"
    ".balign 4\n"
    ".globl update_known\n"
    ".type update_known, %function\n"
    "update_known:\n"
    "li a0, 128\n"
    "1:\n"
    ".rept 6\n nop\n .endr\n"
    "addi a0, a0, -1\n"
    "bnez a0, 1b\n"
    "li a0, 0\n"
    "ret\n"
    ".previous\n");

extern "C" {

void reset_handler() {
  for (std::uint32_t *to = &data_begin, *from = &data_load; to != &data_end;) *to++ = *from++;
  for (std::uint32_t* to = &bss_begin; to != &bss_end;) *to++ = 0;
  // No constructors are called: run.sh checks that there are none.
  board::finish(run_firmware());
}

[[gnu::interrupt, gnu::aligned(4)]] void trap_handler() {
  std::uint32_t cause = 0;
  asm volatile("csrr %0, mcause" : "=r"(cause));
  if (cause != 0x80000007u || timer_handler == nullptr) {
    board::write("fault\n");
    board::finish(3);
  }
  next_interrupt();
  timer_handler();
}

}  // extern "C"

// esokit::Expected ends a wrong program with abort(); the C library's raises a signal. Firmware
// stops in its own way.
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
  next_interrupt();
  asm volatile("csrs mie, %0\n csrsi mstatus, 8" : : "r"(0x80) : "memory");
}

void stop_timer() {
  asm volatile("csrci mstatus, 8\n csrc mie, %0" : : "r"(0x80) : "memory");
  timer_handler = nullptr;
}

void wait() { asm volatile("wfi" ::: "memory"); }

std::uint32_t counter() {
  std::uint32_t value = 0;
  asm volatile("csrr %0, minstret" : "=r"(value) : : "memory");
  return value;
}

bool counts() { return true; }

}  // namespace board
