// expect: esokit: no such estimate
#include <esokit/observer/linear_eso.hpp>

double top(const esokit::LinearEso<2>& observer) { return observer.estimate<5>(); }
