// expect: esokit: a nonlinear gain is the type of a function
#include <esokit/observer/nonlinear_eso.hpp>
auto c = esokit::NonlinearEso<2, double, 2, double>::make({});
