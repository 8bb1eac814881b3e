// expect: cannot convert .*CascadeEso.*LinearEso|no viable conversion from .*CascadeEso.*LinearEso
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
auto f(const esokit::CascadeEso<2, 2>::Config& config) {
  return esokit::LinearEso<2>::make(config);
}
