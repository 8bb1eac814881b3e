// expect: esokit: Packed::make takes a function that gives each lane its config
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
auto f(const esokit::LinearEso<2>::Config& config) {
  return esokit::Packed<esokit::LinearEso<2>, 4>::make(config);
}
