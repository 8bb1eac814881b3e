// expect: narrow
#include <esokit/observer/linear_eso.hpp>
auto f(int b) { return esokit::LinearEso<2, float>::make({.observer_bandwidth = b}); }
