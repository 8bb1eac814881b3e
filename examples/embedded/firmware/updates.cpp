// Compiled on its own, so that each function is one `update` and can be measured as such.
#include "updates.hpp"

#include "designs.hpp"

namespace firmware {

namespace {

template <class Design>
[[gnu::always_inline]] inline unsigned update(void* observer, float y, float u_applied) {
  return static_cast<unsigned>(
      static_cast<typename Design::Observer*>(observer)->update(y, u_applied));
}

}  // namespace

extern "C" {

unsigned update_LinearEso(void* observer, float y, float u_applied) {
  return update<Linear>(observer, y, u_applied);
}
unsigned update_CascadeEso(void* observer, float y, float u_applied) {
  return update<Cascade>(observer, y, u_applied);
}
unsigned update_AlgebraicEso(void* observer, float y, float u_applied) {
  return update<Algebraic>(observer, y, u_applied);
}
unsigned update_AdjustableBandwidthEso(void* observer, float y, float u_applied) {
  return update<AdjustableBandwidth>(observer, y, u_applied);
}
unsigned update_NonlinearEso(void* observer, float y, float u_applied) {
  return update<Nonlinear>(observer, y, u_applied);
}
unsigned update_ExtendedStateFilter(void* observer, float y, float u_applied) {
  return update<RecursiveFilter>(observer, y, u_applied);
}

}  // extern "C"

}  // namespace firmware
