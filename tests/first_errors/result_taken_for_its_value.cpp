// expect: Expected<.*LinearEso
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
esokit::LinearEso<2> f(const esokit::LinearEso<2>::Config& config) {
  esokit::LinearEso<2> o = esokit::LinearEso<2>::make(config);
  return o;
}
