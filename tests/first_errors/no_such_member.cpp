// expect: cannot convert .*LinearEso<2>::Config|designator 'bandwidth' does not refer to any field
#include <esokit/observer/linear_eso.hpp>

auto observer =
    esokit::LinearEso<2>::make({.bandwidth = 50.0, .input_gain = 1.0, .sample_time = 1e-3});
