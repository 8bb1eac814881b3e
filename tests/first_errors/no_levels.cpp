// expect: esokit: at least one level is needed
#include <esokit/observer/cascade_eso.hpp>

auto observer = esokit::CascadeEso<2, 0>::make({});
