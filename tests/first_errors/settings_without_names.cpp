// expect: esokit: write the names of the settings
#include <esokit/observer/linear_eso.hpp>
auto f() { return esokit::LinearEso<2>::make({1e-3, 50.0, 100.0}); }
