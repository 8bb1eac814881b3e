// expect: esokit: to_c writes
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/fixed_point.hpp>
void write(const esokit::LinearEso<2>::Config& config) {
  esokit::to_fixed_c(esokit::LinearEso<2>::make(config), {});
}
