// expect: narrow
#include <esokit/observer/linear_eso.hpp>

auto design(double bandwidth) {
  return esokit::LinearEso<2, float>::make(
      {.observer_bandwidth = bandwidth, .input_gain = 1.0f, .sample_time = 1e-3f});
}
