// expect: esokit: the scalar is float or double
#include <esokit/observer/algebraic_eso.hpp>
auto c = esokit::AlgebraicEso<2, int>::make({});
