// expect: (cannot convert|no viable conversion).*AdrcConfig.*
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto f(const esokit::Adrc<esokit::LinearEso<2>>::Config& config) {
  return esokit::Adrc<esokit::LinearEso<2, float>>::make(config);
}
