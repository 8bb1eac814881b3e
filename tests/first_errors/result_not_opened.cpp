// expect: no member named .?update
#include <esokit/observer/linear_eso.hpp>

void run() {
  auto observer = esokit::LinearEso<2>::make(
      {.observer_bandwidth = 50.0, .input_gain = 1.0, .sample_time = 1e-3});
  observer.update(1.0, 2.0);
}
