// expect: cannot convert .*LinearEso<2>::Config.*LinearEso<2, float>::Config|no viable conversion
// from .*double.*float
#include <esokit/observer/linear_eso.hpp>
auto f(const esokit::LinearEso<2>::Config& config) {
  return esokit::LinearEso<2, float>::make(config);
}
