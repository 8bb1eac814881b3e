// expect: esokit: the scalar is float or double
#include <esokit/observer/cascade_eso.hpp>
auto c = esokit::CascadeEso<2, 2, int>::make({});
