// The same firmware as a program of this computer: the reference for the emulated runs.

#include <cstdio>
#include <cstdlib>

#include "board.hpp"
#include "updates.hpp"

// Nothing is counted here.
unsigned firmware::update_known(void*, float, float) { return 0; }

namespace board {

namespace {
void (*timer_handler)();
}

void write(const char* text) { std::fputs(text, stdout); }

void finish(int status) { std::exit(status); }

void start_timer(void (*handler)()) { timer_handler = handler; }
void stop_timer() { timer_handler = nullptr; }
void wait() { timer_handler(); }

std::uint32_t counter() { return 0; }
bool counts() { return false; }

}  // namespace board

int main() { return run_firmware(); }
