// What must not get into the firmware, one kind at a time. run.sh --self-test links each of these
// into an image of its own and wants its check of the link to refuse it.

#if defined(VIOLATES_heap)
#include <cstdlib>
extern "C" void* violation(std::size_t size) { return std::malloc(size); }

#elif defined(VIOLATES_exceptions)
extern "C" int violation(int (*function)()) {
  try {
    return function();
  } catch (...) {
    return 0;
  }
}

#elif defined(VIOLATES_doubles)
extern "C" double violation(double a, float b) { return a * static_cast<double>(b); }

#elif defined(VIOLATES_text)
#include <iostream>
extern "C" void violation() { std::cout << "text"; }

#elif defined(VIOLATES_constructors)
extern "C" int violation_source();
extern "C" int violation_source() { return 1; }
extern "C" {
volatile int violation = violation_source() + 1;
}
#endif
