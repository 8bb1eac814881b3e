// expect: const.*discards qualifiers|no matching member function
// also: const
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
double f(const esokit::Adrc<esokit::LinearEso<2>>& c) { return c.update(1.0, 2.0); }
