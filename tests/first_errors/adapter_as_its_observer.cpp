// expect: (conversion|invalid initiali[sz]ation|non-const lvalue reference).*LinearEso
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/observer/linear_eso.hpp>

void run(esokit::DelayedInput<esokit::LinearEso<2>, 3>& delayed) {
  esokit::LinearEso<2>& observer = delayed;  // its update would skip the delay
  observer.update(1.0, 2.0);
}
