// Compiled on its own, so that each function is one `update` of a controller and can be measured.
#include <bit>
#include <cstdint>

#include "controllers.hpp"

namespace firmware {

namespace {

/// The bits of u.
template <class Design>
[[gnu::always_inline]] inline unsigned update(void* controller, float y, float r) {
  return static_cast<unsigned>(
      std::bit_cast<std::uint32_t>(static_cast<Design::Controller*>(controller)->update(y, r)));
}

}  // namespace

extern "C" {

unsigned update_Adrc(void* controller, float y, float r) {
  return update<Single>(controller, y, r);
}
unsigned update_AdrcLimited(void* controller, float y, float r) {
  return update<Limited>(controller, y, r);
}
/// Both channels see the same: the work is that of two.
unsigned update_MimoAdrc(void* controller, float y, float r) {
  using Output = Double::Controller::Output;
  const auto u = static_cast<Double::Controller*>(controller)->update(Output{y, y}, Output{r, r});
  return static_cast<unsigned>(std::bit_cast<std::uint32_t>(u(0)));
}

}  // extern "C"

}  // namespace firmware
