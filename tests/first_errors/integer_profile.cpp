// expect: esokit: the scalar here is float, double
#include <esokit/control/smooth_profile.hpp>
auto c = esokit::SmoothProfile<2, int>::make({});
