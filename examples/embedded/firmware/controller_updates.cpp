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

template <class Design>
[[gnu::always_inline]] inline unsigned observed(void* observer, float y, float u_applied) {
  return static_cast<unsigned>(static_cast<Design::Observer*>(observer)->update(y, u_applied));
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

unsigned update_MotorLag1(void* observer, float y, float u) {
  return observed<MotorLag1>(observer, y, u);
}
unsigned update_MotorLag2(void* observer, float y, float u) {
  return observed<MotorLag2>(observer, y, u);
}
unsigned update_SensorLag1(void* observer, float y, float u) {
  return observed<SensorLag1>(observer, y, u);
}
unsigned update_SensorLag2(void* observer, float y, float u) {
  return observed<SensorLag2>(observer, y, u);
}
unsigned update_Resonator(void* observer, float y, float u) {
  return observed<Resonator>(observer, y, u);
}

}  // extern "C"

}  // namespace firmware
