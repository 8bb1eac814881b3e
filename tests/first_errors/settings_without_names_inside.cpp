// expect: esokit: write the names of the settings
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto f() { return esokit::Adrc<esokit::LinearEso<2>>::make({{100.0, 50.0, 1e-3}, 10.0}); }
