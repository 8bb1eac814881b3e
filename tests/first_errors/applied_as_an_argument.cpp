// expect: deleted .*function
// also: call applied\(u\) before update
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

double step(esokit::Adrc<esokit::LinearEso<2>>& loop, double y, double held) {
  return loop.update(y, 1.0, held);
}
