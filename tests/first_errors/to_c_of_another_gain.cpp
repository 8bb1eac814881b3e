// expect: esokit: to_c writes LinearEso, HalfGainEso, ReducedOrderEso and CascadeEso
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/target/c_code.hpp>

void write(const esokit::Adrc<esokit::AdjustableBandwidthEso<2>>& controller) {
  esokit::to_c(controller);
}
