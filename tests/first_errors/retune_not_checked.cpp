// expect: ignoring return
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
void f(esokit::Adrc<esokit::LinearEso<2>>& c, esokit::Adrc<esokit::LinearEso<2>>::Config& config) {
  c.retune(config);
}
