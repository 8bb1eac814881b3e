// expect: esokit: to_c writes
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
auto f(const esokit::LinearEso<2>::Config& config) {
  return esokit::to_c(esokit::LinearEso<2>::make(config));
}
