// expect: esokit: to_c writes
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
auto f(const esokit::MimoAdrc<esokit::LinearEso<2>, esokit::LinearEso<2>>& c) {
  return esokit::to_c(c);
}
