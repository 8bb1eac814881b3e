// The C that write_c.cpp wrote: 10,000 samples of each self-test, bit for bit, and what a sample
// costs.
//
//   size NAME bytes
//   count NAME instructions
//   done

#include <eso.h>
#include <loop.h>

#include "board.hpp"
#include "counting.hpp"
#include "output.hpp"

namespace firmware {

namespace {

unsigned update_eso(void* o, float y, float u) {
  return eso_update(static_cast<eso_state*>(o), y, u);
}
unsigned update_loop(void* o, float y, float r) {
  auto* state = static_cast<loop_state*>(o);
  (void)loop_update(state, y, r);
  return state->status;
}

template <class State>
void count(const char* name, void (*init)(State*), Update* update) {
  State state;
  init(&state);
  Line("size").word(name).number(sizeof state);
  if (!board::counts()) return;
  const InstructionCounter counter;
  std::uint32_t last = 0;
  for (int k = 0; k < 10; ++k) last = counter.count(update, &state, 0.25f, 0.5f);
  Line("count").word(name).number(last);
}

bool agrees(const char* name, int failed) {
  if (failed != 0) Line("differs").word(name).number(static_cast<std::uint32_t>(failed));
  return failed == 0;
}

}  // namespace

}  // namespace firmware

int run_firmware() {
  using namespace firmware;
  const bool fine =
      agrees("eso", eso_self_test(0.0f)) && agrees("loop", loop_self_test(0.0f));
  count<eso_state>("eso", eso_init, update_eso);
  count<loop_state>("loop", loop_init, update_loop);
  if (fine) Line("done");
  return fine ? 0 : 1;
}
