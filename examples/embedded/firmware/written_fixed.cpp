// The C in integers that write_c.cpp wrote: their self-tests, equal in each bit, and what a sample
// costs.
//
//   size NAME bytes
//   count NAME instructions
//   done

#include <current.h>
#include <eso_fixed.h>
#include <eso_fixed16.h>
#include <eso_open.h>
#include <loop_fixed.h>
#include <position.h>

#include "board.hpp"
#include "counting.hpp"
#include "output.hpp"

namespace firmware {

namespace {

// Arguments come as float; these are integers, and the same for all.
[[gnu::noinline]] unsigned nothing(void*, std::int32_t, std::int32_t) {
  asm volatile("");
  return 0;
}
template <class State, class Result, class Y>
struct Called {
  template <Result (*function)(State*, Y, std::int32_t)>
  static unsigned observe(void* o, float, float) {
    return static_cast<unsigned>(function(static_cast<State*>(o), Y(9), 5));
  }
  template <Result (*function)(State*, Y, Y)>
  static unsigned control(void* o, float, float) {
    return static_cast<unsigned>(function(static_cast<State*>(o), Y(9), Y(5)));
  }
};
unsigned call_nothing(void* o, float, float) { return nothing(o, 9, 5); }

template <class State>
void count(const char* name, void (*init)(State*), Update* update) {
  State state;
  init(&state);
  Line("size").word(name).number(sizeof state);
  if (!board::counts()) return;
  const InstructionCounter counter;
  std::uint32_t last = 0;
  std::uint32_t empty = 0;
  for (int k = 0; k < 10; ++k) {
    last = counter.count(update, &state, 0, 0);
    empty = counter.count(call_nothing, &state, 0, 0);
  }
  Line("count").word(name).number(last - empty + 2);
}

bool agrees(const char* name, int failed) {
  if (failed != 0) Line("differs").word(name).number(static_cast<std::uint32_t>(failed));
  return failed == 0;
}

}  // namespace

}  // namespace firmware

int run_firmware() {
  using namespace firmware;
  bool fine = agrees("eso_fixed", eso_fixed_self_test());
  fine = agrees("eso_fixed16", eso_fixed16_self_test()) && fine;
  fine = agrees("eso_open", eso_open_self_test()) && fine;
  fine = agrees("loop_fixed", loop_fixed_self_test()) && fine;
  fine = agrees("position", position_self_test()) && fine;
  fine = agrees("current", current_self_test()) && fine;
  using Plain = std::int32_t;
  count<eso_fixed_state>("eso_fixed", eso_fixed_init,
                         Called<eso_fixed_state, unsigned, Plain>::observe<eso_fixed_update>);
  count<eso_fixed16_state>("eso_fixed16", eso_fixed16_init,
                           Called<eso_fixed16_state, unsigned, Plain>::observe<eso_fixed16_update>);
  count<eso_open_state>("eso_open", eso_open_init,
                        Called<eso_open_state, unsigned, Plain>::observe<eso_open_update>);
  count<loop_fixed_state>("loop_fixed", loop_fixed_init,
                          Called<loop_fixed_state, Plain, Plain>::control<loop_fixed_update>);
  count<position_state>("position", position_init,
                        Called<position_state, Plain, std::uint16_t>::control<position_update>);
  count<current_state>("current", current_init,
                       Called<current_state, Plain, Plain>::control<current_update>);
  if (fine) Line("done");
  return fine ? 0 : 1;
}
