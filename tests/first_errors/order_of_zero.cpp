// expect: esokit: the plant order must be at least 1
#include <esokit/observer/linear_eso.hpp>

auto observer = esokit::LinearEso<0>::make({});
