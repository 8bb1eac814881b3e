// expect: esokit: a reference has r and at most as many derivatives
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
double f(esokit::Adrc<esokit::LinearEso<1>>& c) { return c.update(1.0, {2.0, 1.0, 3.0, 4.0}); }
