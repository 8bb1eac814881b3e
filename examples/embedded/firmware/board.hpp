/// @file
/// The little that the firmware wants of what it runs on: text out, a timer interrupt, a counter,
/// an end. One implementation a machine: board_cortex_m.cpp, board_riscv.cpp, board_host.cpp.
#pragma once

#include <cstdint>

/// The program; its result is the status of the run. The board starts it.
int run_firmware();

namespace board {

/// Sends text to the console (semihosting on the targets).
void write(const char* text);

/// Ends the run; 0 is success.
[[noreturn]] void finish(int status);

/// Calls `handler` from the timer interrupt, again and again until `stop_timer`.
void start_timer(void (*handler)());
void stop_timer();

/// Until an interrupt has come.
void wait();

/// Unit unknown, modulo `counter_modulus`; grows by the same for each instruction under an emulator
/// that says so, see counting.hpp.
std::uint32_t counter();
inline constexpr std::uint32_t counter_modulus =
#if defined(__ARM_ARCH)
    1u << 24u;  // SysTick
#else
    0;  // of 32 bits
#endif

/// False where `counter` counts nothing.
bool counts();

}  // namespace board
