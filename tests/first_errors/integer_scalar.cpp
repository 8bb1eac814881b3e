// expect: esokit: the scalar is float or double
#include <esokit/observer/linear_eso.hpp>

auto observer = esokit::LinearEso<2, int>::make({});
