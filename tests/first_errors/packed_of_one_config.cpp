// expect: esokit: Packed::make takes a function that gives each lane its config
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
auto c = esokit::Packed<esokit::LinearEso<2>, 4>::make(
    {.observer_bandwidth = 3.0, .input_gain = 1.0, .sample_time = 1e-3});
