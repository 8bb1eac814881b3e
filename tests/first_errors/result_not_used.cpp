// expect: nodiscard|unused-result
#include <esokit/observer/linear_eso.hpp>

void design() {
  esokit::LinearEso<2>::make({.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = 1e-3});
}
