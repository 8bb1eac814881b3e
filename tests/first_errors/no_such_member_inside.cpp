// expect: cannot convert .*LinearEso<2> >::Config|designator 'bandwidth' does not refer to any
// field
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto f() {
  return esokit::Adrc<esokit::LinearEso<2>>::make(
      {.observer = {.bandwidth = 3.0, .input_gain = 1.0, .sample_time = 1e-3},
       .controller_bandwidth = 3.0});
}
